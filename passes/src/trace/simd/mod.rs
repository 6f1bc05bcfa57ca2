//! Vectors of eight and of sixteen numbers, and the choice of the instruction set at run time.
//!
//! Holds the trait [`Simd`] with its three implementations (AVX-512, AVX2, plain loops) and [`Kernel`], the work that is compiled
//! for each of them. Every instruction set gives the same bits.
//! May use: nothing else of the tracer.

mod dispatch;
mod portable;
mod vector;
#[cfg(target_arch = "x86_64")]
mod x86;

pub(crate) use dispatch::Detected;
pub use dispatch::InstructionSet;
pub(crate) use portable::Plain;
pub(crate) use vector::{
    F8, F16, Kernel, LANES, Mask, NO_LANES, Simd, WIDE, first_lane, first_wide_lane, higher, load_axes, lower,
    vector_at, without_first,
};
