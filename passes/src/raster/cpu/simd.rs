//! Compiles the same source for several instruction sets, and chooses one of them at run time.
//!
//! Kernels are plain Rust on 8-wide arrays. Inlined into a function with a target feature, they are compiled to the
//! vectors of that instruction set. No fast-math flag is set, so the compiler never contracts a multiplication and an
//! addition, and all instruction sets give the same bits.
#![allow(unsafe_code, reason = "calling a function compiled for an instruction set that was detected")]

/// The instruction set that the kernels run in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InstructionSet {
    /// The one that the program was compiled for (SSE2 on x86-64, NEON on AArch64).
    Portable,
    /// AVX2.
    Avx2,
    /// AVX-512 F, VL, DQ and BW, on 256-bit vectors with masks.
    Avx512,
}

impl InstructionSet {
    /// All instruction sets; each has the instructions of those before it.
    pub const ALL: [Self; 3] = [Self::Portable, Self::Avx2, Self::Avx512];

    /// The name, for reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Portable => {
                if cfg!(target_arch = "aarch64") {
                    "NEON"
                } else if cfg!(target_feature = "sse2") {
                    "SSE2"
                } else {
                    "portable"
                }
            }
            Self::Avx2 => "AVX2",
            Self::Avx512 => "AVX-512",
        }
    }

    /// Whether this processor has the instruction set.
    #[must_use]
    pub fn available(self) -> bool {
        #[cfg(target_arch = "x86_64")]
        match self {
            Self::Portable => true,
            Self::Avx2 => is_x86_feature_detected!("avx2"),
            Self::Avx512 => {
                is_x86_feature_detected!("avx2")
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512bw")
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        return self == Self::Portable;
    }

    /// The last set of [`Self::ALL`] that this processor has.
    #[must_use]
    pub fn best() -> Self {
        Self::ALL.into_iter().rev().find(|set| set.available()).unwrap_or(Self::Portable)
    }
}

/// Work that is compiled once for each instruction set. `run` and everything it calls must be `#[inline(always)]`, or
/// it is not compiled for the set.
pub(super) trait Kernel {
    /// The result.
    type Output;
    /// Does the work.
    fn run(self) -> Self::Output;
}

/// An instruction set that was detected on this processor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Detected(InstructionSet);

impl Detected {
    /// `None` if this processor lacks the set.
    pub fn new(set: InstructionSet) -> Option<Self> {
        set.available().then_some(Self(set))
    }

    pub fn set(self) -> InstructionSet {
        self.0
    }

    /// Runs a kernel compiled for the set.
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self.0 {
            InstructionSet::Portable => kernel.run(),
            // SAFETY: `Detected` is only made after `available` found every feature that the function enables.
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx2 => unsafe { avx2(kernel) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx512 => unsafe { avx512(kernel) },
            #[cfg(not(target_arch = "x86_64"))]
            _ => kernel.run(),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,avx512f,avx512vl,avx512dq,avx512bw")]
fn avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}
