//! Reads a stage's declarations, and rewrites its source in the form that the compiler supports.
//!
//! This module goes through a file statement by statement. [`declarations`] reads declarations outside functions, [`blocks`] those in blocks,
//! and [`body`] copies functions token by token.

mod blocks;
mod body;
mod declarations;
mod images;
mod storage;

pub(super) use images::image;
pub(super) use storage::{counters, counting_name};

use super::tokens::{Kind, Token};
use super::{Attribute, FRAME, Fault, Fixed, Sampler, SamplerKind, Stage, StorageBuffer};
use std::collections::HashMap;

/// Prefix of generated names.
pub(super) const OURS: &str = "curitiba_";
/// The block of the uniforms that are declared outside blocks.
pub(super) const LOOSE: &str = "curitiba_Uniforms";
/// Prefix of the names of Boolean uniforms in the block [`LOOSE`].
pub(super) const TRUTH: &str = "curitiba_u_";

/// A variable between the stages, an attribute, or a result.
#[derive(Debug, Clone)]
pub(super) struct Variable {
    /// Name that links the variable to the other stage: its own name, after the name of its block and a dot if it is in a block.
    pub key: String,
    /// Name in the rewritten source.
    pub global: String,
    pub kind: String,
    /// Number of elements of an array, or of columns of a matrix; `None` for other types.
    pub parts: Option<usize>,
    pub flat: bool,
    pub location: Option<u32>,
    pub used: bool,
    pub token: Token,
}

/// A uniform that is declared outside blocks.
#[derive(Debug, Clone)]
pub(super) struct Uniform {
    pub name: String,
    /// Type without the length of an array, such as `vec4`.
    pub kind: String,
    pub array: String,
    pub default: Option<[f32; 4]>,
    pub token: Token,
}

impl Uniform {
    /// Whether it is Boolean; blocks hold Booleans as numbers.
    pub fn is_truth(&self) -> bool {
        matches!(self.kind.as_str(), "bool" | "bvec2" | "bvec3" | "bvec4")
    }

    /// Type and name with which the block [`LOOSE`] declares the uniform.
    pub fn held(&self) -> (String, String) {
        match self.is_truth() {
            true => (self.kind.replace("bvec", "uvec").replace("bool", "uint"), format!("{TRUTH}{}", self.name)),
            false => (self.kind.clone(), self.name.clone()),
        }
    }
}

/// A rewritten function of the file. Functions come after everything else, callees before callers.
#[derive(Debug)]
struct Function {
    name: String,
    text: String,
    origins: Vec<Origin>,
    /// Names in it that are followed by an opening bracket.
    calls: Vec<String>,
}

/// Where a part of the rewritten source comes from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Origin {
    /// Offset of the part's first byte in the rewritten source.
    pub at: usize,
    /// Offset, in the file, of the first byte from which the part comes.
    pub start: usize,
    /// Offset, in the file, of one past the last byte from which the part comes.
    pub end: usize,
}

/// A stage after reading.
#[derive(Debug)]
pub(super) struct Stated {
    /// The rewritten source.
    pub text: String,
    /// Origins of the parts of [`Self::text`], in their order.
    pub origins: Vec<Origin>,
    /// Variables declared `in`.
    pub inputs: Vec<Variable>,
    /// Variables declared `out`.
    pub outputs: Vec<Variable>,
    /// Uniforms outside blocks that are used.
    pub uniforms: Vec<Uniform>,
    /// Blocks that are read, in the order of their bindings.
    pub blocks: Vec<String>,
    /// By the names of a block and a member: the member's declaration in the file, bytes.
    pub members: HashMap<(String, String), [usize; 2]>,
    /// Samplers that are used.
    pub samplers: Vec<Sampler>,
    /// Buffers that it binds, in the order of their bindings.
    pub storage: Vec<StorageBuffer>,
    /// Whether it reads `gl_FragCoord`.
    pub coordinates: bool,
    /// Whether it writes `gl_FragDepth`.
    pub depth: bool,
    /// Where the file declares `early_fragment_tests`, bytes.
    pub early: Option<[usize; 2]>,
    /// Uniform arrays with initial values. They are constants, since nothing can be mapped to them.
    pub fixed: Vec<Fixed>,
    /// Invocations of a compute shader's work group, in each direction.
    pub group: [u32; 3],
}

/// Reads a stage whose first block gets the binding `first_block`.
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
        sampler_names: HashMap::new(),
        counters: HashMap::new(),
        images: HashMap::new(),
        next_offset: HashMap::new(),
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
            storage: Vec::new(),
            coordinates: false,
            depth: false,
            early: None,
            fixed: Vec::new(),
            group: [1; 3],
        },
        sized: false,
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
    if stage == Stage::Compute && reader.faults.is_empty() {
        reader.check_group();
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

/// The order of functions in which callees come before callers. Functions that recurse, which GLSL forbids, get an arbitrary order.
fn in_order(functions: &[Function]) -> Vec<usize> {
    let mut named: HashMap<&str, Vec<usize>> = HashMap::new();
    for (index, function) in functions.iter().enumerate() {
        named.entry(&function.name).or_default().push(index);
    }
    let (mut order, mut seen) = (Vec::new(), vec![false; functions.len()]);
    for first in 0..functions.len() {
        // Stack of functions, each with the number of its calls that were looked at.
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

/// Reads the tokens of a stage.
struct Reader<'a> {
    stage: Stage,
    tokens: &'a [Token],
    at: usize,
    counts: HashMap<&'a str, usize>,
    first_block: usize,
    /// By instance name of an interface block: the rewritten names of its members.
    instances: HashMap<String, HashMap<String, String>>,
    sampler_names: HashMap<String, SamplerKind>,
    /// Atomic counters by name.
    counters: HashMap<String, storage::Counter>,
    /// Indices of images in the list of buffers, by name.
    images: HashMap<String, usize>,
    /// By binding point: the offset in bytes of the next counter that declares none.
    next_offset: HashMap<u32, u32>,
    functions: Vec<Function>,
    faults: Vec<Fault>,
    done: Stated,
    /// Whether the size of work groups is declared.
    sized: bool,
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

    /// Skips to the token after the next semicolon.
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
}

/// A sampler's name without brackets. An array element gets a name that begins with a digit, which no name of the file does.
fn plain(sampler: &str) -> String {
    match sampler.strip_suffix(']').and_then(|name| name.split_once('[')) {
        Some((array, index)) => format!("{index}_of_{array}"),
        None => sampler.to_owned(),
    }
}

/// The name of a sampler's texture in the rewritten source.
pub(super) fn texture_name(sampler: &str) -> String {
    format!("{OURS}t_{}", plain(sampler))
}

/// The name of the sampler itself in the rewritten source.
pub(super) fn sampler_name(sampler: &str) -> String {
    format!("{OURS}s_{}", plain(sampler))
}

/// The name of the function that compares a depth with a sampler's texture.
pub(super) fn compare_name(sampler: &str) -> String {
    format!("{OURS}c_{}", plain(sampler))
}

/// The name of the comparing function that divides by the last coordinate first.
pub(super) fn compare_projected_name(sampler: &str) -> String {
    format!("{OURS}p_{}", plain(sampler))
}

/// The name of the function that reads a texel at an offset.
pub(super) fn beside_name(sampler: &str) -> String {
    format!("{OURS}b_{}", plain(sampler))
}

/// The attribute with a name.
pub(super) fn attribute(name: &str) -> Option<Attribute> {
    Attribute::ALL.into_iter().find(|attribute| attribute.name() == name)
}

/// Declares the block of uniforms outside blocks: those of the file, sizes of images and, where the file reads `gl_FragCoord`, [`FRAME`].
/// Empty if there are none.
pub(super) fn loose_block(stated: &Stated, binding: usize) -> String {
    if stated.uniforms.is_empty() && !stated.coordinates {
        return String::new();
    }
    let mut text = format!("layout(std140, set = 0, binding = {binding}) uniform {LOOSE} {{\n");
    for uniform in &stated.uniforms {
        let (kind, name) = uniform.held();
        text += &format!("{kind} {name}{};\n", uniform.array);
    }
    if stated.coordinates {
        text += &format!("vec4 {FRAME};\n");
    }
    text + "};\n"
}
