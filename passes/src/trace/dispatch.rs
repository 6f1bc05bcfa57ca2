//! The choice of the instruction set at run time.

use super::lanes::{Plain, Simd};
#[cfg(target_arch = "x86_64")]
use super::x86::{Avx2, Avx512};

/// An instruction set that the traversal is compiled for. All give the same bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lanes {
    /// AVX-512 F, VL, BW and DQ, at 256 bits.
    Avx512,
    /// AVX2, FMA and bit manipulation.
    Avx2,
    /// What every processor of the target has.
    Portable,
}

/// Work that is compiled for several instruction sets; `run` must be `#[inline(always)]`.
pub(crate) trait Work<T> {
    fn run<S: Simd>(self, simd: S) -> T;
}

/// An instruction set that this processor has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Detected {
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    Portable,
}

impl Detected {
    /// `lanes`, if this processor has it.
    pub(crate) fn new(lanes: Lanes) -> Option<Self> {
        match lanes {
            #[cfg(target_arch = "x86_64")]
            Lanes::Avx512 => Avx512::detect().map(Self::Avx512),
            #[cfg(target_arch = "x86_64")]
            Lanes::Avx2 => Avx2::detect().map(Self::Avx2),
            Lanes::Portable => Some(Self::Portable),
            #[cfg(not(target_arch = "x86_64"))]
            _ => None,
        }
    }

    /// The widest instruction set of this processor.
    pub(super) fn best() -> Self {
        [Lanes::Avx512, Lanes::Avx2].into_iter().find_map(Self::new).unwrap_or(Self::Portable)
    }

    /// [`Self::best`], found out once.
    pub(crate) fn cached() -> Self {
        static BEST: std::sync::OnceLock<Detected> = std::sync::OnceLock::new();
        *BEST.get_or_init(Self::best)
    }

    /// Which it is.
    pub(super) fn lanes(self) -> Lanes {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => Lanes::Avx512,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => Lanes::Avx2,
            Self::Portable => Lanes::Portable,
        }
    }

    /// Runs `work`, compiled for this instruction set.
    #[inline(always)]
    pub(crate) fn run<T>(self, work: impl Work<T>) -> T {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(simd) => simd.run(work),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(simd) => simd.run(work),
            Self::Portable => work.run(Plain),
        }
    }
}
