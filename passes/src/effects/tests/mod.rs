//! Tests of all programs together, and the scenes for the tests of single programs.

mod agreement;
pub(crate) mod cones;
mod lights;
mod sky;
mod spheres;
mod sun;
pub mod terminator;
pub(crate) mod world;
