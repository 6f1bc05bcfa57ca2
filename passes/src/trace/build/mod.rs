//! From triangles to the wide tree: a binary tree by clustering (`ploc`), the cheapest collapse of it into wide nodes
//! (`collapse`), and the writing of those (`emit`).
//!
//! The layout of leaves is a parameter (`leaf_format`): the processor's tree has leaves of eight triangles, the GPU's
//! (`gpu_tree`) of three. For any GPU, the binary tree is written as it is (`gpu_binary`).
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

pub(crate) use builder::build_until;
pub use effort::Quality;
pub(crate) use input::Triangles;
