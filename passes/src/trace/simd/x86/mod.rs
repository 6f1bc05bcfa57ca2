//! The vector instructions of x86-64: one file for each instruction set, and one for the operations that both write alike. May use the
//! vectors of `simd/vector.rs`; only the choice in `simd/dispatch.rs` uses these files.

mod avx2;
mod avx512;
mod common;

pub(crate) use avx2::Avx2;
pub(crate) use avx512::Avx512;
