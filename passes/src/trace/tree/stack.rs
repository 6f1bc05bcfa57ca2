//! The traversal stack.
#![allow(unsafe_code, reason = "entries that were not pushed are not initialised")]

use crate::trace::simd::{LANES, WIDE};
use std::mem::MaybeUninit;

/// Entries of a traversal stack. The builder bounds the depth of the tree so that no ray needs more
/// (`MAX_DEPTH` in `build/emit.rs`).
pub(crate) const STACK: usize = 256;

/// A stack of fixed capacity, uninitialised when it is made: clearing it takes longer than tracing a short ray.
///
/// Invariant: the entries below `len` are initialised.
pub(crate) struct Stack<T = u64> {
    entries: [MaybeUninit<T>; STACK],
    len: usize,
}

impl<T: Copy + PartialOrd> Stack<T> {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self { entries: [const { MaybeUninit::uninit() }; STACK], len: 0 }
    }

    /// Pushes an entry.
    ///
    /// # Panics
    /// If the stack is full, which the bound on the tree's depth excludes.
    #[inline(always)]
    pub(crate) fn push(&mut self, entry: T) {
        self.entries[self.len].write(entry);
        self.len += 1;
    }

    /// Room for eight entries on top.
    ///
    /// # Panics
    /// If there is none, which the bound on the tree's depth excludes.
    #[inline(always)]
    pub(crate) fn room(&mut self) -> Room<'_, T> {
        let entries = self.entries[self.len..].first_chunk_mut().expect("the depth of the tree is bounded");
        Room { entries, len: &mut self.len, count: 0 }
    }

    /// Pops the entry that was pushed last.
    #[inline(always)]
    pub(crate) fn pop(&mut self) -> Option<T> {
        self.len = self.len.checked_sub(1)?;
        // SAFETY: the index is the last one below the old `len`, so by the invariant of `Stack` the entry is initialised.
        Some(unsafe { self.entries[self.len].assume_init() })
    }

    #[inline(always)]
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Sorts the entries from `start` on so that the smallest is popped first.
    #[inline(always)]
    pub(crate) fn sort_from(&mut self, start: usize) {
        for next in start + 1..self.len {
            // SAFETY: `next` is below `len`, so by the invariant of `Stack` the entry is initialised.
            let entry = unsafe { self.entries[next].assume_init() };
            let mut slot = next;
            while slot > start {
                // SAFETY: `slot - 1` is below `next`, which is below `len`: initialised by the invariant of `Stack`.
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

/// Room on top of a stack. Its count stays in a register while it is filled, so that nothing waits for memory.
pub(crate) struct Room<'a, T> {
    entries: &'a mut [MaybeUninit<T>; LANES],
    len: &'a mut usize,
    count: usize,
}

impl<T: Copy> Room<'_, T> {
    /// Adds an entry if a condition holds, without a branch.
    #[inline(always)]
    pub(crate) fn push_if(&mut self, condition: bool, entry: T) {
        self.entries[self.count % LANES].write(entry);
        self.count += usize::from(condition);
    }

    /// Pushes the added entries onto the stack.
    ///
    /// # Panics
    /// If there are more than eight.
    #[inline(always)]
    pub(crate) fn keep(self) {
        assert!(self.count <= LANES, "room for eight");
        *self.len += self.count;
    }
}

/// A list of up to `N` entries, each with its ray; also uninitialised when it is made.
///
/// Invariant: the entries and rays below `len` are initialised.
pub(crate) struct List<const N: usize> {
    entries: [MaybeUninit<u32>; N],
    rays: [MaybeUninit<u8>; N],
    len: usize,
}

impl<const N: usize> List<N> {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self { entries: [const { MaybeUninit::uninit() }; N], rays: [const { MaybeUninit::uninit() }; N], len: 0 }
    }

    #[inline(always)]
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Appends an entry once for each of the first `count` rays.
    ///
    /// # Panics
    /// If there is no room for `R` entries, or `count` is greater than `R`.
    #[inline(always)]
    pub(crate) fn append_rays<const R: usize>(&mut self, entry: u32, rays: [u8; R], count: u32) {
        let range = self.len..self.len + R;
        for room in &mut self.entries[range.clone()] {
            room.write(entry);
        }
        for (room, ray) in self.rays[range].iter_mut().zip(rays) {
            room.write(ray);
        }
        assert!(count as usize <= R, "the first of those given");
        self.len += count as usize;
    }

    /// Appends the first `count` of eight entries, all of one ray.
    ///
    /// # Panics
    /// If there is no room for eight, or `count` is greater than eight.
    #[inline(always)]
    pub(crate) fn append(&mut self, entries: [u32; LANES], ray: u8, count: u32) {
        let range = self.len..self.len + LANES;
        for (room, entry) in self.entries[range.clone()].iter_mut().zip(entries) {
            room.write(entry);
        }
        for room in &mut self.rays[range] {
            room.write(ray);
        }
        assert!(count as usize <= LANES, "the first of eight");
        self.len += count as usize;
    }

    /// Pops the entry that was appended last.
    ///
    /// # Panics
    /// If the list is empty.
    #[inline(always)]
    pub(crate) fn pop(&mut self) -> (u32, usize) {
        let last = self.len.checked_sub(1).expect("an entry");
        let entry = self.get(last);
        self.len = last;
        entry
    }

    /// Pops the eight entries that were appended last, or all if there are fewer.
    #[inline(always)]
    pub(crate) fn take(&mut self) -> List<LANES> {
        let first = self.len.saturating_sub(LANES);
        let mut taken = List::new();
        taken.entries.copy_from_slice(&self.entries[first..first + LANES]);
        taken.rays.copy_from_slice(&self.rays[first..first + LANES]);
        taken.len = self.len - first;
        self.len = first;
        taken
    }

    /// An entry and its ray; only the lowest four bits of the ray are returned.
    ///
    /// # Panics
    /// If there is no such entry.
    #[inline(always)]
    pub(crate) fn get(&self, index: usize) -> (u32, usize) {
        assert!(index < self.len, "an entry of the list");
        // SAFETY: the index is below `len`, so by the invariant of `List` the entry and its ray are initialised.
        unsafe { (self.entries[index].assume_init(), usize::from(self.rays[index].assume_init()) % WIDE) }
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
    fn entries_whose_condition_does_not_hold_are_not_pushed() {
        let mut stack = of(&[5]);
        let mut room = stack.room();
        room.push_if(false, 6);
        room.push_if(true, 7);
        room.push_if(false, 8);
        room.keep();
        assert_eq!(popped(stack), [7, 5]);
    }

    #[test]
    #[should_panic(expected = "room for eight")]
    fn there_is_room_for_eight_entries() {
        let mut stack = of(&[]);
        let mut room = stack.room();
        for entry in 0..9 {
            room.push_if(true, entry);
        }
        room.keep();
    }

    #[test]
    #[should_panic(expected = "the depth of the tree is bounded")]
    fn there_is_no_room_on_a_full_stack() {
        of(&[0; STACK - LANES + 1]).room();
    }

    #[test]
    fn a_list_keeps_the_order_and_the_rays() {
        let mut list = List::<20>::new();
        list.append_rays(7, [2, 5, 9, 9], 2);
        list.append([8, 9, 0, 0, 0, 0, 0, 0], 4, 2);
        let all: Vec<_> = (0..list.len()).map(|index| list.get(index)).collect();
        assert_eq!(all, [(7, 2), (7, 5), (8, 4), (9, 4)]);
        assert_eq!((list.pop(), list.len()), ((9, 4), 3));
    }

    #[test]
    fn the_last_eight_entries_are_taken() {
        let mut list = List::<20>::new();
        list.append([0, 1, 2, 3, 4, 5, 6, 7], 1, 8);
        list.append([8, 9, 10, 0, 0, 0, 0, 0], 3, 3);
        let taken = list.take();
        let all: Vec<_> = (0..taken.len()).map(|index| taken.get(index)).collect();
        assert_eq!(all, [(3, 1), (4, 1), (5, 1), (6, 1), (7, 1), (8, 3), (9, 3), (10, 3)]);
        assert_eq!(list.len(), 3);
        assert_eq!((list.take().len(), list.len(), list.take().len()), (3, 0, 0));
    }

    #[test]
    #[should_panic(expected = "an entry of the list")]
    fn what_was_not_added_to_a_list_is_not_read() {
        List::<20>::new().get(0);
    }
}
