//! Rays against exact spheres: the test, and a tree over many.
//!
//! `sphere` is one ray and one sphere; `tree` are many spheres. May use: `ray`.

mod sphere;
mod tree;

pub use tree::SphereTree;
