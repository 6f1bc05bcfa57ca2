//! The traversal stack.
#![allow(unsafe_code, reason = "entries that were not pushed are not initialised")]

use std::mem::MaybeUninit;

/// Entries of a traversal stack. The builder bounds the depth of the tree so that no ray needs more
/// ([`MAX_DEPTH`](super::build::MAX_DEPTH)).
pub(super) const STACK: usize = 256;

/// A stack of fixed size, not cleared when it is made: clearing costs more than a short ray.
///
/// Invariant: the entries below `len` are initialised.
pub(super) struct Stack<T = u64> {
    entries: [MaybeUninit<T>; STACK],
    len: usize,
}

impl<T: Copy + PartialOrd> Stack<T> {
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self { entries: [const { MaybeUninit::uninit() }; STACK], len: 0 }
    }

    /// Adds an entry.
    ///
    /// # Panics
    /// If the stack is full, which the bound on the tree's depth excludes.
    #[inline(always)]
    pub(super) fn push(&mut self, entry: T) {
        self.entries[self.len].write(entry);
        self.len += 1;
    }

    /// Takes the entry that was added last.
    #[inline(always)]
    pub(super) fn pop(&mut self) -> Option<T> {
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

    /// Moves the entries from `start` on that are told below the others, which are then popped first.
    #[inline(always)]
    pub(super) fn lower_from(&mut self, start: usize, is_low: impl Fn(T) -> bool) {
        let mut low = start;
        for next in start..self.len {
            // SAFETY: `next` is below `len`.
            let entry = unsafe { self.entries[next].assume_init() };
            if is_low(entry) {
                // SAFETY: `low` is at most `next`, which is below `len`.
                let other = unsafe { self.entries[low].assume_init() };
                self.entries[low].write(entry);
                self.entries[next].write(other);
                low += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn popped(mut stack: Stack<u32>) -> Vec<u32> {
        std::iter::from_fn(|| stack.pop()).collect()
    }

    fn of(entries: &[u32]) -> Stack<u32> {
        let mut stack = Stack::new();
        for &entry in entries {
            stack.push(entry);
        }
        stack
    }

    #[test]
    fn the_smallest_of_the_sorted_entries_is_popped_first() {
        let mut stack = of(&[0, 7, 3, 9, 3, 1]);
        stack.sort_from(2);
        assert_eq!(popped(stack), [1, 3, 3, 9, 7, 0]);
    }

    #[test]
    fn lowered_entries_are_popped_after_the_others_and_before_the_old() {
        let mut stack = of(&[0, 7, 2, 9, 4, 1]);
        stack.lower_from(1, |entry| entry % 2 == 0);
        let popped = popped(stack);
        assert!(popped[..3].iter().all(|entry| entry % 2 == 1), "{popped:?}");
        assert!(popped[3..5].contains(&2) && popped[3..5].contains(&4) && popped[5] == 0, "{popped:?}");
    }
}
