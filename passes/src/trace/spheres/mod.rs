//! Rays against exact spheres: the test, and a tree over many.
//!
//! `sphere` tests one ray and one sphere; `tree` holds many spheres. May use: `ray`.

mod sphere;
mod tree;

pub use tree::SphereTree;
