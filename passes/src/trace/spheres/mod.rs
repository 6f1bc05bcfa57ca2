//! Rays against exact spheres: the test, and a tree over many.
//!
//! `sphere` tests one ray and one sphere; `tree` holds many spheres. May use: `rounding`, `ray`, `tree`.

mod sphere;
mod tree;

#[cfg(feature = "wgpu")]
pub(crate) use tree::Content;
pub use tree::SphereTree;

/// The error bound of points on spheres, with its name in device code.
#[cfg(feature = "wgpu")]
pub(crate) const BOUNDS: [(&str, f32); 1] = [("SPHERE_OFFSET", crate::trace::rounding::SPHERE_OFFSET)];
#[cfg(test)]
pub(crate) use sphere::roots;
