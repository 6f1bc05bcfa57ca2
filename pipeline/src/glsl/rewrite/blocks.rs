//! Uniform and storage blocks, and interface blocks between the stages.

use super::super::Fault;
use super::super::tokens::{Kind, Token};
use super::declarations::{Declarator, Qualifiers, Storage};
use super::{OURS, Reader, Variable};
use std::collections::HashMap;

impl<'a> Reader<'a> {
    pub(super) fn block(&mut self, qualifiers: &Qualifiers, storage: Storage, name: &'a Token) -> Result<(), Fault> {
        if name.text == "gl_PerVertex" {
            self.recover_block();
            return Ok(());
        }
        self.expect("{")?;
        let mut members: Vec<(Qualifiers, &'a Token, Declarator)> = Vec::new();
        while !self.peek(0).is_some_and(|token| token.is("}")) {
            let own = self.qualifiers()?;
            let kind = self.word("a type")?;
            let kind_array = self.array()?;
            loop {
                members.push((
                    Qualifiers { flat: own.flat || qualifiers.flat, location: own.location, ..Qualifiers::default() },
                    kind,
                    self.declarator(&kind_array)?,
                ));
                let token = self.next()?;
                if token.is(";") {
                    break;
                }
                if !token.is(",") {
                    return Err(self.fault(token, format!("`{}` where `;` is expected", token.text), ""));
                }
            }
        }
        self.expect("}")?;
        let instance = match self.peek(0) {
            Some(token) if token.kind == Kind::Word => Some(self.next()?.clone()),
            _ => None,
        };
        if let Some(token) = self.peek(0).filter(|token| token.is("[")) {
            return Err(self.fault(token, format!("an array of blocks `{}`, which is not supported", name.text), ""));
        }
        self.expect(";")?;
        match storage {
            Storage::Uniform if qualifiers.std430 => {
                Err(self.fault(name, "`std430` is for storage buffers", "valid: std140"))
            }
            Storage::Uniform => self.uniform_block(name, &members, instance.as_ref()),
            Storage::Buffer => self.storage_block(qualifiers, name, &members, instance.as_ref()),
            Storage::In | Storage::Out => self.interface(storage, name, &members, instance.as_ref()),
        }
    }

    pub(super) fn recover_block(&mut self) {
        while let Some(token) = self.peek(0) {
            self.at += 1;
            if token.is("}") {
                break;
            }
        }
        self.recover();
    }

    /// Whether a block is used beyond its declaration: by its instance name, or without one by its members' names.
    pub(super) fn uses_block(&self, members: &[(Qualifiers, &Token, Declarator)], instance: Option<&Token>) -> bool {
        match instance {
            Some(instance) => self.uses(&instance.text) > 1,
            None => members.iter().any(|(_, _, member)| self.uses(&member.token.text) > 1),
        }
    }

    /// Refuses a name that has the prefix of generated names.
    pub(super) fn not_reserved(&self, name: &Token) -> Result<(), Fault> {
        match name.text.starts_with(OURS) {
            true => Err(self.fault(name, format!("`{}` is a reserved name", name.text), "")),
            false => Ok(()),
        }
    }

    /// Writes a block's name, members and instance. Boolean members are refused; `truth` is the message and the help for them.
    pub(super) fn put_block(
        &mut self,
        name: &Token,
        members: &[(Qualifiers, &Token, Declarator)],
        instance: Option<&Token>,
        truth: [&str; 2],
    ) -> Result<(), Fault> {
        self.put(&name.text, name);
        self.put("{", name);
        for (_, kind, member) in members {
            if matches!(kind.text.as_str(), "bool" | "bvec2" | "bvec3" | "bvec4") {
                return Err(self.fault(kind, truth[0], truth[1]));
            }
            if kind.text.contains("sampler") || kind.text.contains("image") {
                let message =
                    format!("`{}` is of type `{}` in a block, which is not supported", member.token.text, kind.text);
                return Err(self.fault(kind, message, "bind the textures, and declare a `uniform sampler2D` for each"));
            }
            self.put(&kind.text, kind);
            self.put(&format!("{}{}", member.token.text, member.array), &member.token);
            self.put(";", &member.token);
        }
        self.put("}", name);
        if let Some(instance) = instance {
            self.put(&instance.text, instance);
        }
        self.put(";", name);
        Ok(())
    }

    pub(super) fn uniform_block(
        &mut self,
        name: &Token,
        members: &[(Qualifiers, &Token, Declarator)],
        instance: Option<&Token>,
    ) -> Result<(), Fault> {
        if !self.uses_block(members, instance) {
            return Ok(());
        }
        self.not_reserved(name)?;
        let binding = self.first_block + self.done.blocks.len();
        self.put(&format!("layout ( std140 , set = 0 , binding = {binding} ) uniform"), name);
        self.put_block(name, members, instance, ["uniforms of truth values are not supported", "declare it as int"])?;
        for (_, _, member) in members {
            let at = [member.token.start, member.token.end];
            self.done.members.insert((name.text.clone(), member.token.text.clone()), at);
        }
        self.done.blocks.push(name.text.clone());
        Ok(())
    }

    pub(super) fn interface(
        &mut self,
        storage: Storage,
        name: &Token,
        members: &[(Qualifiers, &Token, Declarator)],
        instance: Option<&Token>,
    ) -> Result<(), Fault> {
        let mut globals = HashMap::new();
        for (qualifiers, kind, member) in members {
            let own = &member.token.text;
            let global = match instance {
                Some(instance) => format!("{OURS}{}_{own}", instance.text),
                None => own.clone(),
            };
            let key = format!("{}.{own}", name.text);
            let variable = self.variable(qualifiers, kind, member, key, global.clone())?;
            let used = match instance {
                Some(instance) => self.reads_member(&instance.text, own),
                None => self.uses(own) > 1,
            };
            globals.insert(own.clone(), global);
            self.keep(storage, Variable { used, ..variable });
        }
        if let Some(instance) = instance {
            self.instances.insert(instance.text.clone(), globals);
        }
        Ok(())
    }

    pub(super) fn reads_member(&self, instance: &str, member: &str) -> bool {
        let reads = |three: &[Token]| three[0].is_word(instance) && three[1].is(".") && three[2].is_word(member);
        self.tokens.windows(3).any(reads)
    }
}
