//! Tests of all programs together, and the scenes that tests of programs are written in.

mod agreement;
pub mod terminator;
pub(crate) mod world;
