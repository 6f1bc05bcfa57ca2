//! Tests of all programs together, and the scenes that tests of programs are written in.

mod agreement;
mod spheres;
pub mod terminator;
pub(crate) mod world;
