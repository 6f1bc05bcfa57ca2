//! The choice of the instruction set at run time.

use super::portable::Plain;
use super::vector::Kernel;
#[cfg(target_arch = "x86_64")]
use super::x86::{Avx2, Avx512};

/// An instruction set that the traversal is compiled for. All give the same bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InstructionSet {
    /// AVX-512 F, VL, BW and DQ; vectors of eight numbers use 256 bits, vectors of sixteen 512.
    Avx512,
    /// AVX2, FMA and bit manipulation.
    Avx2,
    /// The baseline that every processor of the target has.
    Portable,
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
    /// `set`, if this processor has it; else `None`.
    pub(crate) fn new(set: InstructionSet) -> Option<Self> {
        match set {
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx512 => Avx512::detect().map(Self::Avx512),
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx2 => Avx2::detect().map(Self::Avx2),
            InstructionSet::Portable => Some(Self::Portable),
            #[cfg(not(target_arch = "x86_64"))]
            _ => None,
        }
    }

    /// The widest instruction set of this processor.
    pub(crate) fn best() -> Self {
        [InstructionSet::Avx512, InstructionSet::Avx2].into_iter().find_map(Self::new).unwrap_or(Self::Portable)
    }

    /// [`Self::best`], detected once.
    pub(crate) fn cached() -> Self {
        static BEST: std::sync::OnceLock<Detected> = std::sync::OnceLock::new();
        *BEST.get_or_init(Self::best)
    }

    /// The instruction set without the proof that it is present.
    pub(crate) fn set(self) -> InstructionSet {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => InstructionSet::Avx512,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => InstructionSet::Avx2,
            Self::Portable => InstructionSet::Portable,
        }
    }

    /// Runs a kernel, compiled for this instruction set.
    #[inline(always)]
    pub(crate) fn run<T>(self, kernel: impl Kernel<T>) -> T {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(simd) => simd.run(kernel),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(simd) => simd.run(kernel),
            Self::Portable => kernel.run(Plain),
        }
    }
}
