//! Tests of all programs together, and the scenes that tests of programs are written in.

mod agreement;
mod spheres;
mod sun;
pub mod terminator;
pub(crate) mod world;
