//! A stage's declarations, and its text as the compiler takes it.

use super::tokens::{Kind, Token};
use super::{Attribute, FRAME, Fault, Sampler, Stage};
use std::collections::{HashMap, HashSet};

/// What names of our own begin with.
pub(super) const OURS: &str = "curitiba_";
/// The block of the uniforms that are declared outside blocks.
pub(super) const LOOSE: &str = "curitiba_Uniforms";

/// Functions whose first argument is a sampler, and what they are called today.
const SAMPLING: [(&str, &str); 17] = [
    ("texture", "texture"),
    ("textureLod", "textureLod"),
    ("textureGrad", "textureGrad"),
    ("textureOffset", "textureOffset"),
    ("textureLodOffset", "textureLodOffset"),
    ("textureProj", "textureProj"),
    ("textureProjLod", "textureProjLod"),
    ("texelFetch", "texelFetch"),
    ("texelFetchOffset", "texelFetchOffset"),
    ("textureSize", "textureSize"),
    ("textureGather", "textureGather"),
    ("textureQueryLevels", "textureQueryLevels"),
    ("texture2D", "texture"),
    ("texture2DLod", "textureLod"),
    ("texture2DProj", "textureProj"),
    ("texture2DProjLod", "textureProjLod"),
    ("textureQueryLod", "textureQueryLod"),
];

/// Variables of the language that are not there, and why.
const WITHOUT: [(&str, &str); 12] = [
    ("gl_InstanceID", "scenes are drawn once, without instances"),
    ("gl_VertexID", "vertices are numbered otherwise than in the engine"),
    ("gl_PrimitiveID", "triangles are numbered otherwise than in the engine"),
    ("gl_FragDepth", "depth is that of the triangles"),
    ("gl_PointSize", "triangles alone are drawn"),
    ("gl_PointCoord", "triangles alone are drawn"),
    ("gl_ClipDistance", "nothing is clipped but at the viewport"),
    ("gl_Layer", "targets have one layer"),
    ("gl_ViewportIndex", "a pass has one viewport"),
    ("gl_FragData", "declare the results: layout(location = 0) out vec4 color"),
    ("gl_SampleID", "a pixel has one sample a pass"),
    ("gl_ModelViewProjectionMatrix", "map a uniform to RENDERER PROJECTION_VIEW_MODEL"),
];

/// A variable between stages, an attribute, or a result.
#[derive(Debug, Clone)]
pub(super) struct Variable {
    /// What links it to the other stage: its name, with that of its block before.
    pub key: String,
    /// What it is called in the rewritten text.
    pub global: String,
    pub kind: String,
    pub flat: bool,
    pub location: Option<u32>,
    pub used: bool,
    pub token: Token,
}

/// A uniform that is declared outside blocks.
#[derive(Debug, Clone)]
pub(super) struct Uniform {
    pub name: String,
    /// With the length of an array, as in `vec4` or `float[4]`.
    pub kind: String,
    pub array: String,
    pub default: Option<[f32; 4]>,
    pub token: Token,
}

/// A function of the file, rewritten: functions stand behind all else, those that are called first.
#[derive(Debug)]
struct Function {
    name: String,
    text: String,
    origins: Vec<Origin>,
    /// Names that are followed by a bracket in it.
    calls: Vec<String>,
}

/// Where something of the rewritten text comes from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Origin {
    /// First byte of the rewritten text.
    pub at: usize,
    /// First byte of the file.
    pub start: usize,
    /// One past the last byte of the file.
    pub end: usize,
}

/// A stage that was read.
#[derive(Debug)]
pub(super) struct Stated {
    /// The file's text, rewritten.
    pub text: String,
    /// In the order of the text.
    pub origins: Vec<Origin>,
    /// `in`.
    pub inputs: Vec<Variable>,
    /// `out`.
    pub outputs: Vec<Variable>,
    /// Those that are read.
    pub uniforms: Vec<Uniform>,
    /// Blocks that are read, in the order of their bindings.
    pub blocks: Vec<String>,
    /// Where members of blocks are declared.
    pub members: HashMap<(String, String), [usize; 2]>,
    /// Those that are read.
    pub samplers: Vec<Sampler>,
    /// Whether it reads `gl_FragCoord`.
    pub coordinates: bool,
}

/// Reads a stage whose first block gets the binding after `first_block`.
pub(super) fn read(stage: Stage, tokens: &[Token], first_block: usize) -> Result<Stated, Vec<Fault>> {
    let mut counts = HashMap::new();
    for token in tokens.iter().filter(|token| token.kind == Kind::Word) {
        *counts.entry(token.text.as_str()).or_insert(0_usize) += 1;
    }
    let mut reader = Reader {
        stage,
        tokens,
        at: 0,
        counts,
        first_block,
        instances: HashMap::new(),
        sampler_names: HashSet::new(),
        functions: Vec::new(),
        faults: Vec::new(),
        done: Stated {
            text: String::new(),
            origins: Vec::new(),
            inputs: Vec::new(),
            outputs: Vec::new(),
            uniforms: Vec::new(),
            blocks: Vec::new(),
            members: HashMap::new(),
            samplers: Vec::new(),
            coordinates: false,
        },
    };
    while reader.at < tokens.len() {
        let before = reader.at;
        if let Err(fault) = reader.statement() {
            reader.faults.push(fault);
            reader.recover();
        }
        if reader.at == before {
            reader.at += 1;
        }
    }
    if !tokens.windows(2).any(|pair| pair[0].is_word("main") && pair[1].is("(")) {
        let message = format!("the {stage} has no main()");
        reader.faults.push(Fault { stage, start: 0, end: 0, message, help: None });
    }
    if !reader.faults.is_empty() {
        return Err(reader.faults);
    }
    let (mut done, functions) = (reader.done, reader.functions);
    for index in in_order(&functions) {
        let function = &functions[index];
        let shift = done.text.len();
        done.text.push_str(&function.text);
        done.origins.extend(function.origins.iter().map(|origin| Origin { at: origin.at + shift, ..*origin }));
    }
    Ok(done)
}

/// The order in which functions stand behind those that they call. Where they call each other in a circle, which is no GLSL, they stand
/// as in the file.
fn in_order(functions: &[Function]) -> Vec<usize> {
    let mut named: HashMap<&str, Vec<usize>> = HashMap::new();
    for (index, function) in functions.iter().enumerate() {
        named.entry(&function.name).or_default().push(index);
    }
    let (mut order, mut seen) = (Vec::new(), vec![false; functions.len()]);
    for first in 0..functions.len() {
        // What waits: a function, and how many of its calls were looked at.
        let mut waiting = vec![(first, 0)];
        while let Some((index, call)) = waiting.pop() {
            if call == 0 {
                if seen[index] {
                    continue;
                }
                seen[index] = true;
            }
            match functions[index].calls.get(call) {
                Some(called) => {
                    waiting.push((index, call + 1));
                    waiting.extend(named.get(called.as_str()).into_iter().flatten().rev().map(|called| (*called, 0)));
                }
                None => order.push(index),
            }
        }
    }
    order
}

/// What stands before a declaration's type.
#[derive(Debug, Default)]
struct Qualifiers {
    storage: Option<Storage>,
    flat: bool,
    location: Option<u32>,
    std140: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Storage {
    In,
    Out,
    Uniform,
}

/// One name of a declaration.
struct Declarator {
    token: Token,
    /// `[4]`, or nothing.
    array: String,
    /// Indices of the tokens behind `=`.
    initialiser: Option<std::ops::Range<usize>>,
}

struct Reader<'a> {
    stage: Stage,
    tokens: &'a [Token],
    at: usize,
    counts: HashMap<&'a str, usize>,
    first_block: usize,
    /// Instances of interface blocks: to the names of their members.
    instances: HashMap<String, HashMap<String, String>>,
    sampler_names: HashSet<String>,
    functions: Vec<Function>,
    faults: Vec<Fault>,
    done: Stated,
}

impl<'a> Reader<'a> {
    fn peek(&self, ahead: usize) -> Option<&'a Token> {
        self.tokens.get(self.at + ahead)
    }

    fn fault(&self, token: &Token, message: impl Into<String>, help: &str) -> Fault {
        token.fault(self.stage, message, help)
    }

    fn next(&mut self) -> Result<&'a Token, Fault> {
        let token = self.tokens.get(self.at);
        self.at += 1;
        token.ok_or_else(|| match self.tokens.last() {
            Some(last) => self.fault(last, "the file ends inside a declaration", ""),
            None => Fault { stage: self.stage, start: 0, end: 0, message: "the file is empty".to_owned(), help: None },
        })
    }

    fn word(&mut self, what: &str) -> Result<&'a Token, Fault> {
        let token = self.next()?;
        if token.kind == Kind::Word {
            return Ok(token);
        }
        Err(self.fault(token, format!("`{}` where {what} is expected", token.text), ""))
    }

    fn expect(&mut self, sign: &str) -> Result<(), Fault> {
        let token = self.next()?;
        if token.is(sign) {
            return Ok(());
        }
        Err(self.fault(token, format!("`{}` where `{sign}` is expected", token.text), ""))
    }

    /// Goes on behind the next semicolon.
    fn recover(&mut self) {
        while let Some(token) = self.peek(0) {
            self.at += 1;
            if token.is(";") {
                return;
            }
        }
    }

    fn uses(&self, name: &str) -> usize {
        self.counts.get(name).copied().unwrap_or(0)
    }

    fn put(&mut self, text: &str, token: &Token) {
        self.done.origins.push(Origin { at: self.done.text.len(), start: token.start, end: token.end });
        self.done.text.push_str(text);
        self.done.text.push(if matches!(text, ";" | "{" | "}") { '\n' } else { ' ' });
    }

    fn statement(&mut self) -> Result<(), Fault> {
        let Some(first) = self.peek(0) else { return Ok(()) };
        if first.is(";") {
            self.at += 1;
            return Ok(());
        }
        if first.is_word("precision") || first.is_word("invariant") && self.peek(2).is_some_and(|token| token.is(";")) {
            self.recover();
            return Ok(());
        }
        let begin = self.at;
        let qualifiers = self.qualifiers()?;
        if self.peek(0).is_some_and(|token| token.is(";")) {
            // `layout(early_fragment_tests) in;`
            self.at += 1;
            return Ok(());
        }
        match qualifiers.storage {
            Some(storage) => self.declaration(&qualifiers, storage),
            None => {
                self.at = begin;
                self.copy_statement()
            }
        }
    }

    fn qualifiers(&mut self) -> Result<Qualifiers, Fault> {
        let mut found = Qualifiers::default();
        while let Some(token) = self.peek(0).filter(|token| token.kind == Kind::Word) {
            match token.text.as_str() {
                "layout" => {
                    self.at += 1;
                    self.layout(&mut found)?;
                    continue;
                }
                "in" | "attribute" => found.storage = Some(Storage::In),
                "varying" if self.stage == Stage::Fragment => found.storage = Some(Storage::In),
                "out" | "varying" => found.storage = Some(Storage::Out),
                "uniform" => found.storage = Some(Storage::Uniform),
                "flat" => found.flat = true,
                "noperspective" => {
                    return Err(self.fault(token, "`noperspective` is not supported", "valid: smooth, flat"));
                }
                "smooth" | "centroid" | "sample" | "highp" | "mediump" | "lowp" | "precise" => {}
                "buffer" => {
                    return Err(self.fault(token, "a shader storage buffer, which is not supported", "read a uniform"));
                }
                "coherent" | "volatile" | "restrict" | "readonly" | "writeonly" => {
                    let message = "an image or a buffer that the shader stores to, which is not supported";
                    return Err(self.fault(token, message, "write results with `out`"));
                }
                "subroutine" | "shared" | "patch" => {
                    return Err(self.fault(token, format!("`{}` is not supported", token.text), ""));
                }
                _ => break,
            }
            self.at += 1;
        }
        Ok(found)
    }

    fn layout(&mut self, found: &mut Qualifiers) -> Result<(), Fault> {
        self.expect("(")?;
        loop {
            let token = self.next()?;
            if token.is(")") {
                return Ok(());
            }
            match token.text.as_str() {
                "std140" => found.std140 = true,
                "std430" => return Err(self.fault(token, "`std430` is for storage buffers", "valid: std140")),
                "row_major" => return Err(self.fault(token, "`row_major` is not supported", "valid: column_major")),
                "location" if self.peek(0).is_some_and(|next| next.is("=")) => {
                    let value = self.peek(1).ok_or_else(|| self.fault(token, "a location without its number", ""))?;
                    let number = value.text.parse::<u32>().ok().filter(|number| *number < 64);
                    let Some(number) = number else {
                        return Err(self.fault(value, format!("`{}` is no location", value.text), "valid: 0 to 63"));
                    };
                    found.location = Some(number);
                    self.at += 2;
                }
                _ => {}
            }
        }
    }

    fn declaration(&mut self, qualifiers: &Qualifiers, storage: Storage) -> Result<(), Fault> {
        let kind = self.word("a type")?;
        if self.peek(0).is_some_and(|token| token.is("{")) {
            return self.block(qualifiers, storage, kind);
        }
        let kind_array = self.array()?;
        loop {
            let declarator = self.declarator(&kind_array)?;
            let name = &declarator.token;
            if name.text.starts_with(OURS) || name.text.starts_with("gl_") {
                return Err(self.fault(name, format!("`{}` is a reserved name", name.text), ""));
            }
            match storage {
                Storage::Uniform => self.uniform(kind, declarator)?,
                Storage::In | Storage::Out => {
                    let variable =
                        self.variable(qualifiers, kind, &declarator, name.text.clone(), name.text.clone())?;
                    let used = self.uses(&name.text) > 1;
                    self.keep(storage, Variable { used, ..variable });
                }
            }
            let token = self.next()?;
            if token.is(";") {
                return Ok(());
            }
            if !token.is(",") {
                return Err(self.fault(token, format!("`{}` where `;` is expected", token.text), ""));
            }
        }
    }

    /// `[4]` as a text, or nothing.
    fn array(&mut self) -> Result<String, Fault> {
        let mut text = String::new();
        while self.peek(0).is_some_and(|token| token.is("[")) {
            while let Ok(token) = self.next() {
                text.push_str(&token.text);
                if token.is("]") {
                    break;
                }
            }
        }
        Ok(text)
    }

    fn declarator(&mut self, kind_array: &str) -> Result<Declarator, Fault> {
        let token = self.word("a name")?.clone();
        let array = format!("{kind_array}{}", self.array()?);
        let mut initialiser = None;
        if self.peek(0).is_some_and(|token| token.is("=")) {
            self.at += 1;
            let begin = self.at;
            let mut depth = 0_usize;
            while let Some(next) = self.peek(0) {
                match next.text.as_str() {
                    "(" | "{" | "[" => depth += 1,
                    ")" | "}" | "]" => depth = depth.saturating_sub(1),
                    "," | ";" if depth == 0 => break,
                    _ => {}
                }
                self.at += 1;
            }
            initialiser = Some(begin..self.at);
        }
        Ok(Declarator { token, array, initialiser })
    }

    /// A variable of a stage's border; its type must be one that passes it.
    fn variable(
        &self,
        qualifiers: &Qualifiers,
        kind: &Token,
        declarator: &Declarator,
        key: String,
        global: String,
    ) -> Result<Variable, Fault> {
        const PASSED: [&str; 12] =
            ["float", "vec2", "vec3", "vec4", "int", "ivec2", "ivec3", "ivec4", "uint", "uvec2", "uvec3", "uvec4"];
        let token = &declarator.token;
        if !declarator.array.is_empty() {
            let message = format!("`{}` is an array, which does not pass from stage to stage", token.text);
            return Err(self.fault(token, message, "declare its elements one by one"));
        }
        if !PASSED.contains(&kind.text.as_str()) {
            let message =
                format!("`{}` is of type `{}`, which does not pass from stage to stage", token.text, kind.text);
            return Err(self.fault(
                kind,
                message,
                "valid: float, int, uint and vectors of them; a matrix by its columns",
            ));
        }
        let flat = qualifiers.flat || !(kind.text == "float" || kind.text.starts_with("vec"));
        let (kind, location) = (kind.text.clone(), qualifiers.location);
        Ok(Variable { key, global, kind, flat, location, used: true, token: token.clone() })
    }

    fn keep(&mut self, storage: Storage, variable: Variable) {
        // The value lives in a variable of the file's own; ours at the border are copied by our `main`.
        let text = format!("{} {} ;", variable.kind, variable.global);
        self.put(&text, &variable.token);
        match storage {
            Storage::In => self.done.inputs.push(variable),
            _ => self.done.outputs.push(variable),
        }
    }

    fn uniform(&mut self, kind: &Token, declarator: Declarator) -> Result<(), Fault> {
        let Declarator { token, array, initialiser } = declarator;
        if self.uses(&token.text) < 2 {
            return Ok(());
        }
        if kind.text == "sampler2D" {
            if !array.is_empty() {
                return Err(self.fault(&token, "an array of samplers, which is not supported", "declare one by one"));
            }
            self.sampler_names.insert(token.text.clone());
            let at = [token.start, token.end];
            self.done.samplers.push(Sampler { name: token.text, stage: self.stage, at });
            return Ok(());
        }
        let why = match kind.text.as_str() {
            name if name.contains("sampler") => Some("samplers of this type are not supported"),
            name if name.contains("image") => Some("loading from and storing to images is not supported"),
            "atomic_uint" => Some("atomic counters are not supported"),
            "bool" | "bvec2" | "bvec3" | "bvec4" => Some("uniforms of truth values are not supported"),
            "mat2" | "mat2x2" | "mat3x2" | "mat4x2" => Some("uniforms of matrices with two rows are not supported"),
            name if name.starts_with('d') => Some("numbers of 64 bits are not supported"),
            _ => None,
        };
        if let Some(why) = why {
            let help = match kind.text.as_str() {
                "bool" => "declare it as int",
                name if name.contains("sampler") => "valid: sampler2D",
                _ => "",
            };
            return Err(self.fault(kind, format!("`{}` is of type `{}`: {why}", token.text, kind.text), help));
        }
        const NUMBERS: [&str; 18] = [
            "float", "vec2", "vec3", "vec4", "int", "ivec2", "ivec3", "ivec4", "uint", "uvec2", "uvec3", "uvec4",
            "mat3", "mat4", "mat2x3", "mat2x4", "mat3x3", "mat4x4",
        ];
        if !NUMBERS.contains(&kind.text.as_str()) {
            let message = format!(
                "`{}` is of type `{}`: uniforms outside blocks are numbers, vectors and matrices",
                token.text, kind.text
            );
            return Err(self.fault(kind, message, "put it into a uniform block"));
        }
        if array.chars().any(|c| !c.is_ascii_digit() && !matches!(c, '[' | ']')) || array.contains("[]") {
            let message = format!("the length of the array `{}` is not written as a number", token.text);
            return Err(self.fault(&token, message, ""));
        }
        let default = match initialiser {
            Some(range) => Some(self.constant(range, &token)?),
            None => None,
        };
        self.done.uniforms.push(Uniform { name: token.text.clone(), kind: kind.text.clone(), array, default, token });
        Ok(())
    }

    /// A number, or a vector of numbers.
    fn constant(&self, range: std::ops::Range<usize>, name: &Token) -> Result<[f32; 4], Fault> {
        let tokens = &self.tokens[range];
        let unread = || {
            let message = format!("the value that `{}` begins with cannot be read", name.text);
            self.fault(
                tokens.first().unwrap_or(name),
                message,
                "valid: a number, or a vector of numbers: vec2(1.0, -2.0)",
            )
        };
        let (numbers, vector) = match tokens {
            [kind, open, inner @ .., close] if open.is("(") && close.is(")") => {
                let length = match kind.text.as_str() {
                    "float" | "int" | "uint" => 1,
                    "vec2" | "ivec2" | "uvec2" => 2,
                    "vec3" | "ivec3" | "uvec3" => 3,
                    "vec4" | "ivec4" | "uvec4" => 4,
                    _ => return Err(unread()),
                };
                (inner, Some(length))
            }
            all => (all, None),
        };
        let mut values = Vec::new();
        for part in numbers.split(|token| token.is(",")) {
            let (negative, number) = match part {
                [minus, number] if minus.is("-") => (true, number),
                [plus, number] if plus.is("+") => (false, number),
                [number] => (false, number),
                _ => return Err(unread()),
            };
            let value: f32 = number.text.trim_end_matches('u').parse().map_err(|_| unread())?;
            values.push(if negative { -value } else { value });
        }
        let mut found = [0.0; 4];
        match (vector, values.len()) {
            (None, 1) => found[0] = values[0],
            (Some(length), 1) => found[..length].fill(values[0]),
            (Some(length), count) if length == count => found[..length].copy_from_slice(&values),
            _ => return Err(unread()),
        }
        Ok(found)
    }

    fn block(&mut self, qualifiers: &Qualifiers, storage: Storage, name: &'a Token) -> Result<(), Fault> {
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
            Storage::Uniform => self.uniform_block(name, &members, instance.as_ref()),
            Storage::In | Storage::Out => self.interface(storage, name, &members, instance.as_ref()),
        }
    }

    fn recover_block(&mut self) {
        while let Some(token) = self.peek(0) {
            self.at += 1;
            if token.is("}") {
                break;
            }
        }
        self.recover();
    }

    fn uniform_block(
        &mut self,
        name: &Token,
        members: &[(Qualifiers, &Token, Declarator)],
        instance: Option<&Token>,
    ) -> Result<(), Fault> {
        let read = match instance {
            Some(instance) => self.uses(&instance.text) > 1,
            None => members.iter().any(|(_, _, member)| self.uses(&member.token.text) > 1),
        };
        if !read {
            return Ok(());
        }
        if name.text.starts_with(OURS) {
            return Err(self.fault(name, format!("`{}` is a reserved name", name.text), ""));
        }
        let binding = self.first_block + self.done.blocks.len();
        self.put(&format!("layout ( std140 , set = 0 , binding = {binding} ) uniform"), name);
        self.put(&name.text, name);
        self.put("{", name);
        for (_, kind, member) in members {
            if matches!(kind.text.as_str(), "bool" | "bvec2" | "bvec3" | "bvec4") {
                return Err(self.fault(kind, "uniforms of truth values are not supported", "declare it as int"));
            }
            self.put(&kind.text, kind);
            self.put(&format!("{}{}", member.token.text, member.array), &member.token);
            self.put(";", &member.token);
            let at = [member.token.start, member.token.end];
            self.done.members.insert((name.text.clone(), member.token.text.clone()), at);
        }
        self.put("}", name);
        if let Some(instance) = instance {
            self.put(&instance.text, instance);
        }
        self.put(";", name);
        self.done.blocks.push(name.text.clone());
        Ok(())
    }

    fn interface(
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

    fn reads_member(&self, instance: &str, member: &str) -> bool {
        let reads = |three: &[Token]| three[0].is_word(instance) && three[1].is(".") && three[2].is_word(member);
        self.tokens.windows(3).any(reads)
    }

    /// Copies a structure, a constant or a variable of the file to its text, and a function to the functions. Declarations of functions
    /// are left out: functions stand behind those that they call.
    fn copy_statement(&mut self) -> Result<(), Fault> {
        let structure = self.peek(0).is_some_and(|token| token.is_word("struct"));
        let (begin, text, origins) = (self.at, self.done.text.len(), self.done.origins.len());
        let (mut depth, mut assigned, mut called) = (0_usize, false, None);
        while self.at < self.tokens.len() {
            let from = self.at;
            self.copy_token()?;
            for (index, token) in self.tokens[from..self.at.min(self.tokens.len())].iter().enumerate() {
                match token.text.as_str() {
                    "(" if depth == 0 && !assigned && called.is_none() => (called, depth) = (Some(from + index), 1),
                    "{" | "(" | "[" if token.kind == Kind::Sign => depth += 1,
                    "}" | ")" | "]" if token.kind == Kind::Sign => depth = depth.saturating_sub(1),
                    "=" if depth == 0 => assigned = true,
                    _ => {}
                }
            }
            let token = &self.tokens[self.at.min(self.tokens.len()) - 1];
            let body = token.is("}");
            let ends = depth == 0 && (token.is(";") || body && !structure && !assigned);
            if !ends {
                continue;
            }
            let Some(bracket) = called.filter(|_| !structure && !assigned) else { return Ok(()) };
            let text = self.done.text.split_off(text);
            let shift = self.done.text.len();
            let origins = self.done.origins.split_off(origins);
            if body {
                let called = self.tokens[bracket..self.at].windows(2);
                let calls = called.filter(|two| two[0].kind == Kind::Word && two[1].is("("));
                self.functions.push(Function {
                    name: self.tokens[bracket.saturating_sub(1).max(begin)].text.clone(),
                    text,
                    origins: origins.into_iter().map(|origin| Origin { at: origin.at - shift, ..origin }).collect(),
                    calls: calls.map(|two| two[0].text.clone()).collect(),
                });
            }
            return Ok(());
        }
        Ok(())
    }

    fn copy_token(&mut self) -> Result<(), Fault> {
        let token = &self.tokens[self.at];
        self.at += 1;
        if token.kind != Kind::Word {
            self.put(&token.text, token);
            return Ok(());
        }
        let word = token.text.as_str();
        let after_dot = self.at >= 2 && self.tokens[self.at - 2].is(".");
        let called = self.peek(0).is_some_and(|next| next.is("("));
        if after_dot {
            self.put(word, token);
            return Ok(());
        }
        if word.starts_with(OURS) {
            return Err(self.fault(token, format!("`{word}` is a reserved name"), ""));
        }
        if word == "main" && called {
            self.put("curitiba_main", token);
            return Ok(());
        }
        if let Some((_, now)) = SAMPLING.iter().find(|(name, _)| *name == word && called) {
            self.put(now, token);
            return self.sampled();
        }
        if let Some(members) = self.instances.get(word)
            && self.peek(0).is_some_and(|next| next.is("."))
        {
            let member = self.peek(1).ok_or_else(|| self.fault(token, "a block without its member", ""))?;
            let Some(global) = members.get(&member.text).cloned() else {
                let mut names: Vec<&str> = members.keys().map(String::as_str).collect();
                names.sort_unstable();
                let message = format!("`{word}` has no member `{}`", member.text);
                return Err(self.fault(member, message, &format!("valid: {}", names.join(", "))));
            };
            self.at += 2;
            self.put(&global, token);
            return Ok(());
        }
        if let Some((name, why)) = WITHOUT.iter().find(|(name, _)| *name == word) {
            return Err(self.fault(token, format!("`{name}` is not there: {why}"), ""));
        }
        let replaced = match word {
            "gl_FragCoord" => {
                self.done.coordinates = true;
                "curitiba_FragCoord"
            }
            "gl_FragColor" => {
                if !self.done.outputs.iter().any(|output| output.key == "gl_FragColor") {
                    let global = "curitiba_FragColor".to_owned();
                    let (key, kind, location) = ("gl_FragColor".to_owned(), "vec4".to_owned(), Some(0));
                    let token = token.clone();
                    self.done.outputs.push(Variable { key, global, kind, flat: false, location, used: true, token });
                }
                "curitiba_FragColor"
            }
            "dFdy" | "dFdyFine" | "dFdyCoarse" if called => "curitiba_dFdy",
            other => other,
        };
        self.put(replaced, token);
        Ok(())
    }

    /// Behind the name of a function that samples: its bracket, and its sampler.
    fn sampled(&mut self) -> Result<(), Fault> {
        let open = self.next()?;
        self.put("(", open);
        let Some(first) = self.peek(0) else { return Ok(()) };
        let alone = self.peek(1).is_some_and(|next| next.is(",") || next.is(")"));
        if first.kind == Kind::Word && alone && self.sampler_names.contains(&first.text) {
            self.at += 1;
            let (texture, sampler) = (texture_name(&first.text), sampler_name(&first.text));
            self.put(&format!("sampler2D ( {texture} , {sampler} )"), first);
            return Ok(());
        }
        let help = "valid: a `uniform sampler2D` of this file, by its name";
        Err(self.fault(first, format!("`{}` is not a sampler that is declared above", first.text), help))
    }
}

/// What a sampler's texture is called in the rewritten text.
pub(super) fn texture_name(sampler: &str) -> String {
    format!("{OURS}t_{sampler}")
}

/// What its sampler is called there.
pub(super) fn sampler_name(sampler: &str) -> String {
    format!("{OURS}s_{sampler}")
}

/// The attribute of that name.
pub(super) fn attribute(name: &str) -> Option<Attribute> {
    Attribute::ALL.into_iter().find(|attribute| attribute.name() == name)
}

/// How the members of the loose block are declared: those of the file and, where it reads `gl_FragCoord`, [`FRAME`].
pub(super) fn loose_block(stated: &Stated, binding: usize) -> String {
    if stated.uniforms.is_empty() && !stated.coordinates {
        return String::new();
    }
    let mut text = format!("layout(std140, set = 0, binding = {binding}) uniform {LOOSE} {{\n");
    for uniform in &stated.uniforms {
        text += &format!("{} {}{};\n", uniform.kind, uniform.name, uniform.array);
    }
    if stated.coordinates {
        text += &format!("vec4 {FRAME};\n");
    }
    text + "};\n"
}
