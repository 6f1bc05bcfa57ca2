//! Storage buffers and atomic counters. Both become storage buffers, whose group and binding are assigned here.

use super::super::tokens::{Kind, Token};
use super::super::{Fault, Held, Stage, StorageBuffer};
use super::declarations::{Declarator, Qualifiers};
use super::{OURS, Reader};

/// Functions of atomic counters, with the names of the generated functions, to which the buffer's index is appended.
const COUNTING: [(&str, &str); 3] =
    [("atomicCounterIncrement", "up"), ("atomicCounterDecrement", "down"), ("atomicCounter", "count")];

/// Memory barriers. Calls of them are left out: a pass ends before its stores are read, and `barrier()` also waits for the stores of a work
/// group.
const WAITING: [&str; 6] = [
    "memoryBarrier",
    "memoryBarrierBuffer",
    "memoryBarrierImage",
    "memoryBarrierAtomicCounter",
    "memoryBarrierShared",
    "groupMemoryBarrier",
];

/// Bytes from one counter to the next: each is a 32-bit number.
const COUNTER_BYTES: u32 = 4;

/// An atomic counter: the index of its buffer, and its number within the buffer.
#[derive(Debug, Clone, Copy)]
pub(super) struct Counter {
    buffer: usize,
    word: u32,
}

/// The name of the generated function `what` (such as `up`) for the counters of the buffer with an index.
pub(in super::super) fn counting_name(what: &str, buffer: usize) -> String {
    format!("{OURS}{what}{buffer}")
}

/// Declares the counter buffer with this index, and its functions. The functions are not atomic here: the front end supports no atomic
/// counters, so their bodies are replaced after parsing.
pub(in super::super) fn counters(buffer: usize) -> String {
    let [up, down, count] = COUNTING.map(|(_, what)| counting_name(what, buffer));
    let all = format!("{OURS}n{buffer}");
    format!(
        "layout(std430, set = 2, binding = {buffer}) buffer {OURS}N{buffer} {{ uint {all}[]; }};
uint {up}(uint at) {{ {all}[at] = {all}[at] + 1u; return {all}[at]; }}
uint {down}(uint at) {{ {all}[at] = {all}[at] - 1u; return {all}[at]; }}
uint {count}(uint at) {{ return {all}[at]; }}
"
    )
}

impl Reader<'_> {
    /// The index of the buffer of the kind `held` at a binding point. The buffer is added if it is missing. With `fresh` (for blocks), a
    /// buffer that is there already is a fault.
    pub(super) fn storage(&mut self, point: u32, held: Held, token: &Token, fresh: bool) -> Result<usize, Fault> {
        let known = self.done.storage.iter().position(|buffer| buffer.point == point && buffer.held == held);
        match known {
            Some(_) if fresh => {
                let message = format!("a second buffer of binding point {point}");
                Err(self.fault(token, message, "declare what it holds once, as one structure"))
            }
            Some(index) => Ok(index),
            None => {
                let (name, at) = (token.text.clone(), [token.start, token.end]);
                let (readonly, read, written) = (false, false, false);
                self.done.storage.push(StorageBuffer { name, point, held, readonly, read, written, at });
                Ok(self.done.storage.len() - 1)
            }
        }
    }

    pub(super) fn in_pixels(&self, token: &Token) -> Result<(), Fault> {
        match self.stage {
            Stage::Fragment | Stage::Compute => Ok(()),
            Stage::Vertex => {
                let message =
                    format!("`{}` is a buffer or an image in a vertex shader, which is not supported", token.text);
                Err(self.fault(token, message, "use it in the pixel shader"))
            }
        }
    }

    /// `layout(std430, binding = 1) buffer Name { … } instance;`.
    pub(super) fn storage_block(
        &mut self,
        qualifiers: &Qualifiers,
        name: &Token,
        members: &[(Qualifiers, &Token, Declarator)],
        instance: Option<&Token>,
    ) -> Result<(), Fault> {
        if !self.uses_block(members, instance) {
            return Ok(());
        }
        self.in_pixels(name)?;
        self.not_reserved(name)?;
        let index = self.storage(qualifiers.binding.unwrap_or(0), Held::Block, name, true)?;
        self.done.storage[index].readonly = qualifiers.readonly;
        let rules = if qualifiers.std140 { "std140" } else { "std430" };
        let only = if qualifiers.readonly { "readonly " } else { "" };
        self.put(&format!("layout ( {rules} , set = 2 , binding = {index} ) {only}buffer"), name);
        self.put_block(name, members, instance, ["buffers of truth values are not supported", "declare it as uint"])
    }

    /// `layout(binding = 1, offset = 4) uniform atomic_uint name;`.
    pub(super) fn counter(&mut self, qualifiers: &Qualifiers, declarator: &Declarator) -> Result<(), Fault> {
        let token = &declarator.token;
        let point = qualifiers.binding.unwrap_or(0);
        let next = self.next_offset.entry(point).or_insert(0);
        let offset = qualifiers.offset.unwrap_or(*next);
        *next = offset.saturating_add(COUNTER_BYTES);
        if self.uses(&token.text) < 2 {
            return Ok(());
        }
        if !declarator.array.is_empty() {
            return Err(self.fault(token, "an array of atomic counters, which is not supported", "declare one by one"));
        }
        if !offset.is_multiple_of(COUNTER_BYTES) {
            return Err(self.fault(token, format!("a counter at byte {offset}"), "valid: multiples of 4"));
        }
        self.in_pixels(token)?;
        let buffer = self.storage(point, Held::Counters, token, false)?;
        self.counters.insert(token.text.clone(), Counter { buffer, word: offset / COUNTER_BYTES });
        Ok(())
    }

    /// Rewrites a call that counts, and leaves out a memory barrier. Returns `false` for any other call.
    pub(super) fn counted(&mut self, token: &Token) -> Result<bool, Fault> {
        if WAITING.contains(&token.text.as_str()) && self.peek(1).is_some_and(|token| token.is(")")) {
            self.at += 2;
            return Ok(true);
        }
        let Some((_, what)) = COUNTING.iter().find(|(name, _)| token.is_word(name)) else { return Ok(false) };
        self.expect("(")?;
        let name = self.next()?;
        let Some(Counter { buffer, word }) = self.counters.get(&name.text).copied().filter(|_| name.kind == Kind::Word)
        else {
            let help = "valid: a `uniform atomic_uint` of this file, by its name";
            return Err(self.fault(name, format!("`{}` is not a counter that is declared above", name.text), help));
        };
        self.put(&format!("{} ( {word}u", counting_name(what, buffer)), token);
        Ok(true)
    }
}
