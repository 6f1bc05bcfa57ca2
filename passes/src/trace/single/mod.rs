//! Single rays: the watertight test of a ray and a leaf, and the traversal of the tree.
//!
//! [`RayQueue`] interleaves several single rays: packets and fans end in it where few of their rays are left in a subtree.
//! May use: `tree`, `ray`, `rounding`, `simd`.

mod leaf_test;
mod ray_queue;
mod traverse;

#[cfg(test)]
pub(crate) use leaf_test::decide;
pub(crate) use ray_queue::{FEW, QueuedRays, RayQueue, Waiting};
pub(crate) use traverse::{AnyHit, BlockedBy, Closest, Occluded, approach, blocked, closest, occluded};
