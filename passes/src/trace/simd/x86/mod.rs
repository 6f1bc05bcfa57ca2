//! The vector instructions of x86-64: a file an instruction set, and what both spell alike. May use the vectors of `simd/vector.rs`; nothing but the
//! choice in `simd/dispatch.rs` uses it.

mod avx2;
mod avx512;
mod common;

pub(crate) use avx2::Avx2;
pub(crate) use avx512::Avx512;
