//! The choice of the instruction set, and the traversal stack: the two places that need `unsafe`.
#![allow(
    unsafe_code,
    reason = "functions compiled for a detected instruction set; a stack that is not cleared per ray"
)]

use std::mem::MaybeUninit;

/// An instruction set that the traversal is compiled for. All give the same bits: nothing is fused or reassociated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lanes {
    /// AVX-512 F, VL, BW and DQ, at 256 bits.
    Avx512,
    /// AVX2 and BMI.
    Avx2,
    /// What every processor of the target has.
    Portable,
}

/// An instruction set that this processor was seen to have: the invariant of [`Detected::run`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Detected(Lanes);

/// Work that can be compiled for several instruction sets; `run` must be `#[inline(always)]`.
pub(super) trait Work {
    type Output;
    fn run(self) -> Self::Output;
}

impl Detected {
    /// `lanes`, if this processor has it.
    pub(super) fn new(lanes: Lanes) -> Option<Self> {
        let present = match lanes {
            #[cfg(target_arch = "x86_64")]
            Lanes::Avx512 => {
                is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("bmi1")
                    && is_x86_feature_detected!("bmi2")
                    && is_x86_feature_detected!("lzcnt")
                    && is_x86_feature_detected!("popcnt")
            }
            #[cfg(target_arch = "x86_64")]
            Lanes::Avx2 => {
                is_x86_feature_detected!("avx2")
                    && is_x86_feature_detected!("bmi1")
                    && is_x86_feature_detected!("bmi2")
                    && is_x86_feature_detected!("lzcnt")
                    && is_x86_feature_detected!("popcnt")
            }
            Lanes::Portable => true,
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        };
        present.then_some(Self(lanes))
    }

    /// The widest instruction set of this processor.
    pub(super) fn best() -> Self {
        [Lanes::Avx512, Lanes::Avx2].into_iter().find_map(Self::new).unwrap_or(Self(Lanes::Portable))
    }

    /// Which it is.
    pub(super) fn lanes(self) -> Lanes {
        self.0
    }

    /// Runs `work`, compiled for this instruction set.
    #[inline(always)]
    pub(super) fn run<W: Work>(self, work: W) -> W::Output {
        match self.0 {
            // SAFETY: a `Detected` holds only what `Detected::new` saw on this processor, and the features that
            // `run_avx512` enables are those checked there for this variant.
            #[cfg(target_arch = "x86_64")]
            Lanes::Avx512 => unsafe { run_avx512(work) },
            // SAFETY: as above, with the features of `run_avx2`.
            #[cfg(target_arch = "x86_64")]
            Lanes::Avx2 => unsafe { run_avx2(work) },
            _ => run_portable(work),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq,bmi1,bmi2,lzcnt,popcnt")]
fn run_avx512<W: Work>(work: W) -> W::Output {
    work.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
fn run_avx2<W: Work>(work: W) -> W::Output {
    work.run()
}

#[inline(never)]
fn run_portable<W: Work>(work: W) -> W::Output {
    work.run()
}

/// Entries of a traversal stack. The builder bounds the depth of the tree so that no ray needs more
/// ([`MAX_DEPTH`](super::build::MAX_DEPTH)).
pub(super) const STACK: usize = 256;

/// A stack of fixed size on the thread's stack, not cleared when it is made: clearing costs more than a short ray.
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

    #[inline(always)]
    pub(super) fn pop(&mut self) -> Option<u64> {
        self.len = self.len.checked_sub(1)?;
        // SAFETY: entries below `len` were written by `push`, and `len` was above this index.
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
            // SAFETY: entries below `len` were written by `push`.
            let entry = unsafe { self.entries[next].assume_init() };
            let mut slot = next;
            while slot > start {
                // SAFETY: entries below `len` were written by `push`.
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
