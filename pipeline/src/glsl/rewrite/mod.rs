//! A stage's declarations, and its text as the compiler takes it.
//!
//! Here is what goes through a file, statement by statement; [`declarations`] reads what is declared outside functions, [`blocks`] what is
//! declared in blocks, and [`body`] copies functions, word by word.

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

/// What names of our own begin with.
pub(super) const OURS: &str = "curitiba_";
/// The block of the uniforms that are declared outside blocks.
pub(super) const LOOSE: &str = "curitiba_Uniforms";
/// What a uniform of truth values is called in that block: its name behind this.
pub(super) const TRUTH: &str = "curitiba_u_";

/// A variable between stages, an attribute, or a result.
#[derive(Debug, Clone)]
pub(super) struct Variable {
    /// What links it to the other stage: its name, with that of its block before.
    pub key: String,
    /// What it is called in the rewritten text.
    pub global: String,
    pub kind: String,
    /// Elements of an array, or columns of a matrix.
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
    /// With the length of an array, as in `vec4` or `float[4]`.
    pub kind: String,
    pub array: String,
    pub default: Option<[f32; 4]>,
    pub token: Token,
}

impl Uniform {
    /// Whether it is of truth values, which blocks hold as numbers.
    pub fn is_truth(&self) -> bool {
        matches!(self.kind.as_str(), "bool" | "bvec2" | "bvec3" | "bvec4")
    }

    /// How its block declares it: type and name.
    pub fn held(&self) -> (String, String) {
        match self.is_truth() {
            true => (self.kind.replace("bvec", "uvec").replace("bool", "uint"), format!("{TRUTH}{}", self.name)),
            false => (self.kind.clone(), self.name.clone()),
        }
    }
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
    /// Buffers that it binds, in the order of their bindings.
    pub storage: Vec<StorageBuffer>,
    /// Whether it reads `gl_FragCoord`.
    pub coordinates: bool,
    /// Whether it writes `gl_FragDepth`.
    pub depth: bool,
    /// Where it says `early_fragment_tests`.
    pub early: Option<[usize; 2]>,
    /// Arrays with the values that they begin with, and where they are declared: constants, since nothing can be mapped to them.
    pub fixed: Vec<Fixed>,
    /// Of a compute shader: invocations of a work group in each direction.
    pub group: [u32; 3],
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
struct Reader<'a> {
    stage: Stage,
    tokens: &'a [Token],
    at: usize,
    counts: HashMap<&'a str, usize>,
    first_block: usize,
    /// Instances of interface blocks: to the names of their members.
    instances: HashMap<String, HashMap<String, String>>,
    sampler_names: HashMap<String, SamplerKind>,
    /// Atomic counters by name.
    counters: HashMap<String, storage::Counter>,
    /// Images by name: their places among the buffers.
    images: HashMap<String, usize>,
    /// By binding point, where the next counter is that does not say it, bytes.
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
}

/// A sampler's name, that of an element of an array without its brackets: no name of the file begins with a digit.
fn plain(sampler: &str) -> String {
    match sampler.strip_suffix(']').and_then(|name| name.split_once('[')) {
        Some((array, index)) => format!("{index}_of_{array}"),
        None => sampler.to_owned(),
    }
}

/// What a sampler's texture is called in the rewritten text.
pub(super) fn texture_name(sampler: &str) -> String {
    format!("{OURS}t_{}", plain(sampler))
}

/// What its sampler is called there.
pub(super) fn sampler_name(sampler: &str) -> String {
    format!("{OURS}s_{}", plain(sampler))
}

/// What the function is called there that compares a depth with its texture.
pub(super) fn compare_name(sampler: &str) -> String {
    format!("{OURS}c_{}", plain(sampler))
}

/// What the one is called that divides by the last coordinate before.
pub(super) fn compare_projected_name(sampler: &str) -> String {
    format!("{OURS}p_{}", plain(sampler))
}

/// What the function is called there that reads a texel beside another.
pub(super) fn beside_name(sampler: &str) -> String {
    format!("{OURS}b_{}", plain(sampler))
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
        let (kind, name) = uniform.held();
        text += &format!("{kind} {name}{};\n", uniform.array);
    }
    if stated.coordinates {
        text += &format!("vec4 {FRAME};\n");
    }
    text + "};\n"
}
