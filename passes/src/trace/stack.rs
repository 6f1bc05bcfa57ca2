//! The traversal stack.
#![allow(unsafe_code, reason = "entries that were not pushed are not initialised")]

use super::lanes::{LANES, WIDE};
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

    /// Room for eight entries on top.
    ///
    /// # Panics
    /// If there is none, which the bound on the tree's depth excludes.
    #[inline(always)]
    pub(super) fn room(&mut self) -> Room<'_, T> {
        let entries = self.entries[self.len..].first_chunk_mut().expect("the depth of the tree is bounded");
        Room { entries, len: &mut self.len, count: 0 }
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
}

/// Room on top of a stack. Its count is not in memory while it is filled, so that nothing waits for it.
pub(super) struct Room<'a, T> {
    entries: &'a mut [MaybeUninit<T>; LANES],
    len: &'a mut usize,
    count: usize,
}

impl<T: Copy> Room<'_, T> {
    /// Adds an entry where a condition holds, without a jump.
    #[inline(always)]
    pub(super) fn push_if(&mut self, condition: bool, entry: T) {
        self.entries[self.count % LANES].write(entry);
        self.count += usize::from(condition);
    }

    /// The entries are on the stack.
    ///
    /// # Panics
    /// If they are more than eight.
    #[inline(always)]
    pub(super) fn keep(self) {
        assert!(self.count <= LANES, "room for eight");
        *self.len += self.count;
    }
}

/// Entries of each of [`Stacks`].
pub(super) const STACKED: usize = 48;

/// A short stack for each of sixteen rays, not cleared either.
///
/// Invariant: the entries of a ray below its `len` are initialised.
pub(super) struct Stacks {
    entries: [[MaybeUninit<u32>; STACKED]; WIDE],
    len: [u32; WIDE],
}

impl Stacks {
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self { entries: [const { [const { MaybeUninit::uninit() }; STACKED] }; WIDE], len: [0; WIDE] }
    }

    #[inline(always)]
    pub(super) fn len(&self, ray: usize) -> usize {
        self.len[ray] as usize
    }

    /// Empties all.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.len = [0; WIDE];
    }

    /// Adds an entry to a ray's, and returns how many these are now.
    ///
    /// # Panics
    /// If they are [`STACKED`].
    #[inline(always)]
    pub(super) fn push(&mut self, ray: usize, entry: u32) -> usize {
        let len = self.len(ray);
        self.entries[ray][len].write(entry);
        self.len[ray] += 1;
        len + 1
    }

    /// Adds the first of eight entries to a ray's, and returns how many these are now.
    ///
    /// # Panics
    /// If there is no room for eight, or they are said to be more.
    #[inline(always)]
    pub(super) fn append(&mut self, ray: usize, entries: [u32; LANES], count: u32) -> usize {
        let len = self.len(ray);
        let room: &mut [MaybeUninit<u32>] = &mut self.entries[ray][len..len + LANES];
        for (room, entry) in room.iter_mut().zip(entries) {
            room.write(entry);
        }
        assert!(count as usize <= LANES, "the first of eight");
        self.len[ray] += count;
        self.len(ray)
    }

    /// Takes the entry that was added last to a ray's.
    ///
    /// # Panics
    /// If there is none.
    #[inline(always)]
    pub(super) fn pop(&mut self, ray: usize) -> u32 {
        let last = self.len(ray).checked_sub(1).expect("an entry");
        self.len[ray] = last as u32;
        // SAFETY: the index is the last one below the old length.
        unsafe { self.entries[ray][last].assume_init() }
    }
}

/// Up to `N` entries with the ray of each, not cleared either.
///
/// Invariant: the entries and rays below `len` are initialised.
pub(super) struct List<const N: usize> {
    entries: [MaybeUninit<u32>; N],
    rays: [MaybeUninit<u8>; N],
    len: usize,
}

impl<const N: usize> List<N> {
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self { entries: [const { MaybeUninit::uninit() }; N], rays: [const { MaybeUninit::uninit() }; N], len: 0 }
    }

    #[inline(always)]
    pub(super) fn len(&self) -> usize {
        self.len
    }

    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.len = 0;
    }

    /// Adds an entry.
    ///
    /// # Panics
    /// If there is no room.
    #[inline(always)]
    pub(super) fn push(&mut self, entry: u32, ray: u32) {
        self.entries[self.len].write(entry);
        self.rays[self.len].write(ray as u8);
        self.len += 1;
    }

    /// Adds the first of eight entries, all of one ray.
    ///
    /// # Panics
    /// If there is no room for eight, or they are said to be more.
    #[inline(always)]
    pub(super) fn append(&mut self, entries: [u32; LANES], ray: u8, count: u32) {
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

    /// An entry and its ray.
    ///
    /// # Panics
    /// If there is no such entry.
    #[inline(always)]
    pub(super) fn get(&self, index: usize) -> (u32, usize) {
        assert!(index < self.len, "an entry of the list");
        // SAFETY: the index is below `len`.
        unsafe { (self.entries[index].assume_init(), self.rays[index].assume_init().into()) }
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
    fn each_ray_has_its_own_stack() {
        let mut stacks = Stacks::new();
        assert_eq!(stacks.push(3, 30), 1);
        assert_eq!(stacks.append(3, [31, 32, 33, 0, 0, 0, 0, 0], 2), 3);
        assert_eq!(stacks.append(15, [50; LANES], LANES as u32), LANES);
        assert_eq!([stacks.pop(3), stacks.pop(3), stacks.pop(3)], [32, 31, 30]);
        assert_eq!((stacks.len(3), stacks.len(15), stacks.pop(15)), (0, LANES, 50));
        stacks.clear();
        assert_eq!(stacks.len(15), 0);
    }

    #[test]
    fn a_list_keeps_the_order_and_the_rays() {
        let mut list = List::<20>::new();
        list.push(7, 2);
        list.append([8, 9, 0, 0, 0, 0, 0, 0], 4, 2);
        list.push(10, 1);
        let all: Vec<_> = (0..list.len()).map(|index| list.get(index)).collect();
        assert_eq!(all, [(7, 2), (8, 4), (9, 4), (10, 1)]);
        list.clear();
        assert_eq!(list.len(), 0);
    }

    #[test]
    #[should_panic(expected = "an entry of the list")]
    fn what_was_not_added_to_a_list_is_not_read() {
        List::<20>::new().get(0);
    }
}
