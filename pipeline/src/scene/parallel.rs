//! Parallel operations on long lists.

use crate::memory::zeroed;
use bytemuck::Zeroable;
use rayon::prelude::*;
use std::alloc::{Layout, handle_alloc_error};

/// Number of items that a task copies.
const CHUNK: usize = 1 << 16;

/// A list of zeros in untouched memory: its pages are first touched by the threads that write it, in parallel. Readers of files book the
/// memory first. If the allocation fails nevertheless, the process ends as with `vec!`.
pub(super) fn zeros<T: Zeroable>(count: usize) -> Vec<T> {
    zeroed(count).unwrap_or_else(|_| match Layout::array::<T>(count) {
        Ok(layout) => handle_alloc_error(layout),
        Err(_) => panic!("a list of {count} items is longer than any memory"),
    })
}

/// Splits a list into consecutive parts of the given lengths.
pub(super) fn parts<T>(mut list: &mut [T], lengths: impl IntoIterator<Item = usize>) -> Vec<&mut [T]> {
    let mut parts = Vec::new();
    for length in lengths {
        let (part, rest) = std::mem::take(&mut list).split_at_mut(length);
        parts.push(part);
        list = rest;
    }
    parts
}

/// Concatenates lists.
pub(super) fn concatenate<T: Copy + Zeroable + Send + Sync>(lists: &[&[T]]) -> Vec<T> {
    let mut all = zeros(lists.iter().map(|list| list.len()).sum());
    let places = parts(&mut all, lists.iter().map(|list| list.len()));
    places.into_par_iter().zip(lists).for_each(|(place, list)| {
        place.par_chunks_mut(CHUNK).zip(list.par_chunks(CHUNK)).for_each(|(to, from)| to.copy_from_slice(from));
    });
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_all_lengths_are_put_one_after_the_other() {
        let lists: Vec<Vec<u32>> = [0, 3, 0, CHUNK + 5, 1].iter().map(|length| (0..*length as u32).collect()).collect();
        let slices: Vec<&[u32]> = lists.iter().map(Vec::as_slice).collect();
        assert_eq!(concatenate(&slices), lists.concat());
        assert!(concatenate::<u32>(&[]).is_empty());
    }
}
