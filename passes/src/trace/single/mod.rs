//! Single rays: the watertight test of a ray and a leaf, and the traversal of the tree.
//!
//! [`RayQueue`] interleaves several single occlusion rays: packets and fans hand their rays to it where few are left in a subtree.
//! May use: `tree`, `ray`, `rounding`, `simd`.

mod leaf_test;
mod ray_queue;
mod traverse;

#[cfg(test)]
pub(crate) use leaf_test::decide;
pub(crate) use ray_queue::{FEW, QueuedRays, RayQueue, Waiting};
pub(crate) use traverse::{AnyHit, BlockedBy, Closest, Occluded, approach, blocked, closest, occluded};
