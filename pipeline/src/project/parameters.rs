//! Common parts of passes that run one program per pixel: parameters in attributes, and input buffers.

use super::ChannelRef;
use super::loader::Loader;
use super::passes::PassContext;
use super::report::{shown, suggest};
use crate::programs::ParamInfo;

/// Variables that channels are bound to: position, normal, colour.
const BUFFERS: [&str; 3] = ["pos_buffer", "norm_buffer", "color_buffer"];

/// The inputs that a program reads.
#[derive(Clone, Copy)]
pub(super) struct Reads<'a> {
    /// Name of the program.
    pub name: &'a str,
    /// Buffers that the program reads.
    pub buffers: &'a [&'static str],
    /// Parameters that the program reads.
    pub params: &'a [&'static str],
}

impl Loader {
    /// Reads the attributes of the pass element other than `name` and `class`. Calls `set` for each with the attribute's name in
    /// lower case and its value. Returns whether all are valid.
    pub fn parameters(
        &mut self,
        context: &PassContext<'_>,
        program: Option<Reads<'_>>,
        table: &[ParamInfo],
        mut set: impl FnMut(&str, &str) -> Result<(), String>,
    ) -> bool {
        let mut whole = true;
        for attribute in &context.element.attributes {
            let name = attribute.name.to_ascii_lowercase();
            // Ray passes without buffers name their program in an attribute; effect passes use an element.
            let is_program = name == "program" && program.is_some_and(|program| program.buffers.is_empty());
            if ["name", "class"].contains(&name.as_str()) || is_program {
                continue;
            }
            let problem = if !table.iter().any(|param| param.name == name) {
                let message = format!("pass `{}` has an unknown attribute `{name}`", shown(&context.name));
                let valid = ["name", "class"].into_iter().chain(table.iter().map(|param| param.name));
                Some((attribute.name_span, message, suggest(&name, valid)))
            } else if let Some(program) = program.filter(|program| !program.params.contains(&name.as_str())) {
                let message = format!("program `{}` reads no parameter `{name}`", program.name);
                let reads = if program.params.is_empty() { "nothing".to_owned() } else { program.params.join(", ") };
                Some((attribute.name_span, message, format!("it reads {reads}")))
            } else {
                set(&name, &attribute.value.text).err().map(|help| {
                    (attribute.value.span, format!("`{}` is not a value of `{name}`", attribute.value.shown()), help)
                })
            };
            if let Some((at, message, help)) = problem {
                self.report.error_help(at, message, || help);
                whole = false;
            }
        }
        whole
    }

    /// The channels that the child element of one of these names binds to position, normal and colour. `None` after an error, such
    /// as a missing buffer that the program reads.
    pub fn inputs(
        &mut self,
        context: &mut PassContext<'_>,
        names: &[&str],
        program: Option<Reads<'_>>,
    ) -> Option<[Option<ChannelRef>; 3]> {
        let element = context.element;
        let mut inputs = [None; 3];
        let mut given = [false; 3];
        let mut whole = true;
        let container = self.single(element, names);
        if let Some(list) = container {
            self.expect(list, &["buffer"], &[]);
        }
        for buffer in container.into_iter().flat_map(|list| list.children_named(&["buffer"])) {
            self.expect(buffer, &[], &["var", "texture"]);
            let (var, texture) = (self.required(buffer, "var"), self.required(buffer, "texture"));
            let channel = texture.and_then(|texture| self.find_texture(texture, None));
            whole &= channel.is_some();
            let (Some(var), Some(texture)) = (var, texture) else {
                whole = false;
                continue;
            };
            let Some(index) = BUFFERS.iter().position(|name| *name == var.text) else {
                let message = format!("`{}` is not a buffer that a program reads", var.shown());
                self.report.error_help(var.span, message, || suggest(&var.text, BUFFERS));
                whole = false;
                continue;
            };
            if given[index] {
                self.report.error(var.span, format!("`{}` is bound twice", var.shown()));
                whole = false;
            }
            given[index] = true;
            match program {
                Some(program) if !program.buffers.contains(&BUFFERS[index]) => {
                    self.report
                        .note(var.span, format!("program `{}` does not read `{}`", program.name, BUFFERS[index]));
                }
                _ => {
                    inputs[index] = channel;
                    Self::reads(context, channel, texture.span);
                }
            }
        }
        let Some(program) = program else { return whole.then_some(inputs) };
        for (index, buffer) in BUFFERS.iter().enumerate().filter(|(_, buffer)| program.buffers.contains(buffer)) {
            if !given[index] {
                let at = container.unwrap_or(element).span;
                let message = format!("program `{}` reads `{buffer}`, which the pass does not hand it", program.name);
                self.report.error_help(at, message, || {
                    let name = names[0];
                    format!("valid: <buffer var=\"{buffer}\" texture=\"Library::channel\"/> in <{name}>")
                });
                whole = false;
            }
        }
        whole.then_some(inputs)
    }
}
