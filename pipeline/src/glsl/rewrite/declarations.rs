//! Declarations outside functions and blocks: attributes, variables between the stages, results, uniforms.

use super::super::tokens::{Kind, Token};
use super::super::{Fault, Fixed, Sampler, SamplerKind, Stage};
use super::{OURS, Reader, Uniform, Variable};

/// Longest array that can pass between the stages.
const MAX_PARTS: usize = 8;

/// Longest array of samplers or images.
const MAX_ELEMENTS: usize = 16;

/// Largest number of a binding, and of an offset in bytes.
const MAX_OFFSET: u32 = 1 << 20;

/// Qualifiers before the type of a declaration.
#[derive(Debug, Default)]
pub(super) struct Qualifiers {
    pub storage: Option<Storage>,
    pub flat: bool,
    pub location: Option<u32>,
    pub std140: bool,
    pub std430: bool,
    pub readonly: bool,
    /// Binding point of a buffer.
    pub binding: Option<u32>,
    /// Offset of a counter in its buffer, bytes.
    pub offset: Option<u32>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Storage {
    In,
    Out,
    Uniform,
    /// A shader storage buffer.
    Buffer,
}

/// One name of a declaration.
pub(super) struct Declarator {
    pub token: Token,
    /// Length of the array as written, such as `[4]`; empty without an array.
    pub array: String,
    /// Indices of the tokens of the initial value, which follow `=`; `None` without one.
    pub initialiser: Option<std::ops::Range<usize>>,
}

impl<'a> Reader<'a> {
    pub(super) fn qualifiers(&mut self) -> Result<Qualifiers, Fault> {
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
                "buffer" => found.storage = Some(Storage::Buffer),
                "readonly" => found.readonly = true,
                "coherent" | "volatile" | "restrict" | "writeonly" => {}
                "shared" if self.stage == Stage::Compute => {}
                "subroutine" | "shared" | "patch" => {
                    return Err(self.fault(token, format!("`{}` is not supported", token.text), ""));
                }
                _ => break,
            }
            self.at += 1;
        }
        Ok(found)
    }

    pub(super) fn layout(&mut self, found: &mut Qualifiers) -> Result<(), Fault> {
        self.expect("(")?;
        loop {
            let token = self.next()?;
            if token.is(")") {
                return Ok(());
            }
            match token.text.as_str() {
                "std140" => found.std140 = true,
                "std430" => found.std430 = true,
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
                "binding" | "offset" if self.peek(0).is_some_and(|next| next.is("=")) => {
                    let value = self.peek(1).ok_or_else(|| self.fault(token, "a layout without its number", ""))?;
                    let Some(number) = value.text.parse::<u32>().ok().filter(|number| *number <= MAX_OFFSET) else {
                        let message = format!("`{}` is no {}", value.text, token.text);
                        return Err(self.fault(value, message, "valid: 0 to 1048576"));
                    };
                    let place = if token.is_word("binding") { &mut found.binding } else { &mut found.offset };
                    *place = Some(number);
                    self.at += 2;
                }
                "early_fragment_tests" => self.done.early = Some([token.start, token.end]),
                "local_size_x" => self.group_side(0, token)?,
                "local_size_y" => self.group_side(1, token)?,
                "local_size_z" => self.group_side(2, token)?,
                _ => {}
            }
        }
    }

    pub(super) fn declaration(&mut self, qualifiers: &Qualifiers, storage: Storage) -> Result<(), Fault> {
        let kind = self.word("a type")?;
        if self.peek(0).is_some_and(|token| token.is("{")) {
            return self.block(qualifiers, storage, kind);
        }
        if storage == Storage::Buffer {
            let message = format!("`{}` is a buffer without its block", kind.text);
            return Err(self.fault(kind, message, "valid: layout(std430, binding = 1) buffer Name { … };"));
        }
        if self.peek(0).is_some_and(|token| token.is(";")) {
            // A type without a name declares nothing.
            self.at += 1;
            return Ok(());
        }
        let kind_array = self.array()?;
        loop {
            let declarator = self.declarator(&kind_array)?;
            let name = &declarator.token;
            if name.text.starts_with(OURS) || name.text.starts_with("gl_") {
                return Err(self.fault(name, format!("`{}` is a reserved name", name.text), ""));
            }
            match storage {
                Storage::Uniform if kind.is_word("atomic_uint") => self.counter(qualifiers, &declarator)?,
                Storage::Uniform if kind.is_word("image2D") => self.image(qualifiers, &declarator)?,
                Storage::Uniform => self.uniform(kind, declarator)?,
                Storage::In | Storage::Out | Storage::Buffer => {
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

    /// Reads the length of an array as written, such as `[4]`; empty without an array.
    pub(super) fn array(&mut self) -> Result<String, Fault> {
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

    pub(super) fn declarator(&mut self, kind_array: &str) -> Result<Declarator, Fault> {
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

    /// An input or output of a stage. Its type must be one that can pass between stages.
    pub(super) fn variable(
        &self,
        qualifiers: &Qualifiers,
        kind: &Token,
        declarator: &Declarator,
        key: String,
        global: String,
    ) -> Result<Variable, Fault> {
        const PASSED: [&str; 12] =
            ["float", "vec2", "vec3", "vec4", "int", "ivec2", "ivec3", "ivec4", "uint", "uvec2", "uvec3", "uvec4"];
        const MATRICES: [(&str, &str, usize); 6] = [
            ("mat2", "vec2", 2),
            ("mat2x2", "vec2", 2),
            ("mat3", "vec3", 3),
            ("mat3x3", "vec3", 3),
            ("mat4", "vec4", 4),
            ("mat4x4", "vec4", 4),
        ];
        let token = &declarator.token;
        let (name, array) = (&token.text, &declarator.array);
        let matrix = MATRICES.iter().find(|(matrix, ..)| *matrix == kind.text);
        let length = array.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')?.parse::<usize>().ok());
        let parts = match (matrix, length) {
            (Some((.., columns)), None) if array.is_empty() => Some(*columns),
            (None, Some(length)) if (1..=MAX_PARTS).contains(&length) => Some(length),
            (None, None) if array.is_empty() => None,
            _ => {
                let message = format!("`{name}` is an array of a kind that does not pass from stage to stage");
                let help = format!("valid: 1 to {MAX_PARTS} numbers or vectors, their count written as a number");
                return Err(self.fault(token, message, &help));
            }
        };
        if matrix.is_none() && !PASSED.contains(&kind.text.as_str()) {
            let message = format!("`{name}` is of type `{}`, which does not pass from stage to stage", kind.text);
            let help = "valid: float, int, uint, vectors of them, square matrices, and arrays of numbers and vectors";
            return Err(self.fault(kind, message, help));
        }
        let whole = kind.text.starts_with(['i', 'u']);
        let (kind, location) = (kind.text.clone(), qualifiers.location);
        let flat = qualifiers.flat || whole;
        Ok(Variable { key, global, kind, parts, flat, location, used: true, token: token.clone() })
    }

    pub(super) fn keep(&mut self, storage: Storage, variable: Variable) {
        // The file's own global variable holds the value. The generated `main` copies it from the stage's input or to its output.
        let array = variable.parts.filter(|_| !variable.kind.starts_with("mat"));
        let array = array.map_or(String::new(), |length| format!("[{length}]"));
        let text = format!("{} {}{array} ;", variable.kind, variable.global);
        self.put(&text, &variable.token);
        match storage {
            Storage::In => self.done.inputs.push(variable),
            _ => self.done.outputs.push(variable),
        }
    }

    pub(super) fn uniform(&mut self, kind: &Token, declarator: Declarator) -> Result<(), Fault> {
        let Declarator { token, array, initialiser } = declarator;
        if self.uses(&token.text) < 2 {
            return Ok(());
        }
        let sampled = [
            ("sampler2D", SamplerKind::Color),
            ("sampler2DShadow", SamplerKind::Compared),
            ("samplerCube", SamplerKind::Cube),
        ];
        if let Some((_, sampler)) = sampled.into_iter().find(|(name, _)| *name == kind.text) {
            let at = [token.start, token.end];
            for name in self.elements(&token, &array)? {
                self.sampler_names.insert(name.clone(), sampler);
                self.done.samplers.push(Sampler { name, kind: sampler, stage: self.stage, at });
            }
            return Ok(());
        }
        let why = match kind.text.as_str() {
            name if name.contains("sampler") => Some("samplers of this type are not supported"),
            name if name.contains("image") => Some("images of this type are not supported"),
            "mat2" | "mat2x2" | "mat3x2" | "mat4x2" => Some("uniforms of matrices with two rows are not supported"),
            name if name.starts_with('d') => Some("numbers of 64 bits are not supported"),
            _ => None,
        };
        if let Some(why) = why {
            let help = match kind.text.as_str() {
                name if name.contains("sampler") => "valid: sampler2D, sampler2DShadow, samplerCube",
                name if name.contains("image") => "valid: image2D",
                _ => "",
            };
            return Err(self.fault(kind, format!("`{}` is of type `{}`: {why}", token.text, kind.text), help));
        }
        const NUMBERS: [&str; 22] = [
            "bool", "bvec2", "bvec3", "bvec4", "float", "vec2", "vec3", "vec4", "int", "ivec2", "ivec3", "ivec4",
            "uint", "uvec2", "uvec3", "uvec4", "mat3", "mat4", "mat2x3", "mat2x4", "mat3x3", "mat4x4",
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
        if let (Some(range), false) = (&initialiser, array.is_empty()) {
            return self.fixed(kind, &token, &array, range.clone());
        }
        let default = match initialiser {
            Some(range) => Some(self.constant(range, &token)?),
            None => None,
        };
        let uniform = Uniform { name: token.text.clone(), kind: kind.text.clone(), array, default, token };
        if uniform.is_truth() {
            if !uniform.array.is_empty() {
                return Err(self.fault(&uniform.token, "an array of truth values, which no block holds", "use int"));
            }
            // Blocks hold numbers; the generated `main` converts them to Booleans.
            self.put(&format!("{} {} ;", uniform.kind, uniform.name), &uniform.token);
        }
        self.done.uniforms.push(uniform);
        Ok(())
    }

    /// The names of an array's elements that are used, as `name[1]`; for a sampler or image that is no array, its own name. Each element
    /// becomes a sampler or image of its own, so indices must be literal numbers.
    pub(super) fn elements(&self, token: &Token, array: &str) -> Result<Vec<String>, Fault> {
        let name = &token.text;
        if array.is_empty() {
            return Ok(vec![name.clone()]);
        }
        let length = array.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')?.parse::<usize>().ok());
        let Some(length) = length.filter(|length| (1..=MAX_ELEMENTS).contains(length)) else {
            let message = format!("`{name}{array}` is an array of a length that is not supported");
            return Err(self.fault(token, message, &format!("valid: 1 to {MAX_ELEMENTS}, written as a number")));
        };
        let element = |index: usize| format!("{name}[{index}]");
        let used = |index: &usize| {
            let number = index.to_string();
            let is =
                |four: &[Token]| four[0].is_word(name) && four[1].is("[") && four[2].text == number && four[3].is("]");
            // In the declaration itself, the length of the array stands where uses have an index.
            self.tokens.windows(4).any(|four| is(four) && four[0].start != token.start)
        };
        Ok((0..length).filter(used).map(element).collect())
    }

    /// The name of the sampler or image at the next tokens, and its number of tokens. `None` if no name is there, or its index is not a number.
    pub(super) fn element(&self) -> Option<(String, usize)> {
        let first = self.peek(0).filter(|first| first.kind == Kind::Word)?;
        if !self.peek(1).is_some_and(|next| next.is("[")) {
            return Some((first.text.clone(), 1));
        }
        let index: u32 = self.peek(2)?.text.parse().ok()?;
        self.peek(3).filter(|close| close.is("]"))?;
        Some((format!("{}[{index}]", first.text), 4))
    }

    /// Reads an array with initial values. It becomes a constant, since nothing can be mapped to it.
    fn fixed(&mut self, kind: &Token, name: &Token, array: &str, range: std::ops::Range<usize>) -> Result<(), Fault> {
        let tokens = &self.tokens[range];
        let inner = match tokens {
            [open, inner @ .., close] if open.is("{") && close.is("}") => inner,
            [of, rest @ ..] if of.is_word(&kind.text) => {
                let open = rest.iter().position(|token| token.is("("));
                match (open, rest.last()) {
                    (Some(open), Some(close)) if close.is(")") => &rest[open + 1..rest.len() - 1],
                    _ => &[],
                }
            }
            _ => &[],
        };
        if inner.is_empty() {
            let message = format!("the values that `{}` begins with cannot be read", name.text);
            let help = format!("valid: {{ … }}, or {}{array}( … )", kind.text);
            return Err(self.fault(tokens.first().unwrap_or(name), message, &help));
        }
        let inner: Vec<Token> = inner.to_vec();
        // A comma may follow the last value.
        let end = inner.len() - usize::from(inner.last().is_some_and(|last| last.is(",")));
        let (mut depth, mut values) = (0_usize, 1_usize);
        for token in &inner[..end] {
            match token.text.as_str() {
                "(" | "{" | "[" => depth += 1,
                ")" | "}" | "]" => depth = depth.saturating_sub(1),
                "," if depth == 0 => values += 1,
                _ => {}
            }
        }
        if array != format!("[{values}]") {
            let message = format!("`{}{array}` begins with {values} values", name.text);
            return Err(self.fault(name, message, "valid: as many as the array has, its length written as a number"));
        }
        self.put(&format!("const {} {}{array} = {}{array} (", kind.text, name.text, kind.text), name);
        for token in &inner[..end] {
            self.put(&token.text, token);
        }
        self.put(") ;", name);
        let at = [name.start, name.end];
        self.done.fixed.push(Fixed { name: name.text.clone(), stage: self.stage, at });
        Ok(())
    }

    /// Reads an initial value, a number or a vector of numbers. Components that it lacks are 0.
    pub(super) fn constant(&self, range: std::ops::Range<usize>, name: &Token) -> Result<[f32; 4], Fault> {
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
                    "bool" => 1,
                    "vec2" | "ivec2" | "uvec2" | "bvec2" => 2,
                    "vec3" | "ivec3" | "uvec3" | "bvec3" => 3,
                    "vec4" | "ivec4" | "uvec4" | "bvec4" => 4,
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
            let value: f32 = match number.text.as_str() {
                "true" => 1.0,
                "false" => 0.0,
                text => text.trim_end_matches('u').parse().map_err(|_| unread())?,
            };
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
}
