//! The traversal stack.
#![allow(unsafe_code, reason = "entries that were not pushed are not initialised")]

use std::mem::MaybeUninit;

/// Entries of a traversal stack. The builder bounds the depth of the tree so that no ray needs more
/// ([`MAX_DEPTH`](super::build::MAX_DEPTH)).
pub(super) const STACK: usize = 256;

/// A stack of fixed size, not cleared when it is made: clearing costs more than a short ray.
///
/// Invariant: the entries below `len` are initialised.
pub(super) struct Stack {
    entries: [MaybeUninit<u64>; STACK],
    len: usize,
}

impl Stack {
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self { entries: [const { MaybeUninit::uninit() }; STACK], len: 0 }
    }

    /// Adds an entry.
    ///
    /// # Panics
    /// If the stack is full, which the bound on the tree's depth excludes.
    #[inline(always)]
    pub(super) fn push(&mut self, entry: u64) {
        self.entries[self.len].write(entry);
        self.len += 1;
    }

    /// Takes the entry that was added last.
    #[inline(always)]
    pub(super) fn pop(&mut self) -> Option<u64> {
        self.len = self.len.checked_sub(1)?;
        // SAFETY: the index is the last one below the old `len`.
        Some(unsafe { self.entries[self.len].assume_init() })
    }

    #[inline(always)]
    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// Sorts the entries from `start` on so that the smallest is popped first.
    #[inline(always)]
    pub(super) fn sort_from(&mut self, start: usize) {
        for next in start + 1..self.len {
            // SAFETY: `next` is below `len`.
            let entry = unsafe { self.entries[next].assume_init() };
            let mut slot = next;
            while slot > start {
                // SAFETY: `slot - 1` is below `next`, which is below `len`.
                let previous = unsafe { self.entries[slot - 1].assume_init() };
                if previous >= entry {
                    break;
                }
                self.entries[slot].write(previous);
                slot -= 1;
            }
            self.entries[slot].write(entry);
        }
    }
}
