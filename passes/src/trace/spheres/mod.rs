//! Rays against exact spheres: the test, and a tree over many.
//!
//! `sphere` tests one ray and one sphere; `tree` holds many spheres. May use: `rounding`, `ray`, `tree`.

mod sphere;
mod tree;

pub use tree::{Content, DEPTH, SphereTree};

/// The error bound of points on spheres, with its name in device code.
pub const BOUNDS: [(&str, f32); 1] = [("SPHERE_OFFSET", crate::trace::rounding::SPHERE_OFFSET)];
#[cfg(test)]
pub(crate) use sphere::roots;
