//! From triangles to the wide tree: a binary tree by clustering (`ploc`), its cheapest collapse into wide nodes
//! (`collapse`), and the writing of those (`emit`).
//!
//! The layout of leaves is a parameter (`leaf_format`): the processor's tree has leaves of eight triangles, the GPU's
//! wide tree (`gpu_tree`) leaves of three. `gpu_binary` writes the binary tree itself, for any GPU.
//! May use: `tree`, `rounding`, `simd`.

mod builder;
mod collapse;
mod effort;
mod emit;
pub mod gpu_binary;
pub mod gpu_tree;
mod input;
mod leaf_format;
mod ploc;
#[cfg(test)]
mod soup;

pub(crate) use builder::{Built, STEPS, build_until};
pub use effort::Quality;
pub(crate) use input::Triangles;
