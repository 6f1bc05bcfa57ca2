//! Glass as each material says (`glass=auto`): bodies that light enters and leaves, thin walls, and the report's panes.
//!
//! From the ground up: `media` knows in which bodies a point of a path lies, `eye` in which the camera is,
//! `slab` what a wall with two faces does, `filter` what a surface takes beside Fresnel's share, `shadow` what is
//! left of light that falls straight through, and `walk` follows paths. May use: what is about one point, beside this folder.
//!
//! Radiance is not scaled by the square of the index inside a body, as basic radiance would be: it cancels where light leaves again,
//! and the light that falls on a surface inside is not scaled either.

mod eye;
mod filter;
mod media;
mod shadow;
mod slab;
mod walk;

pub(crate) use eye::around_eye;
pub use media::{Border, Crossing, Media};
pub use slab::{Slab, slab};
pub(super) use walk::Walk;

#[cfg(test)]
mod tests;
