//! Rays one by one: the watertight test of a ray and a leaf, and the way of one ray down the tree.
//!
//! [`RayQueue`] takes several rays on together where each of them is alone in its part of the tree: packets and fans end in it.
//! May use: `tree`, `ray`, `rounding`, `simd`.

mod leaf_test;
mod ray_queue;
mod traverse;

#[cfg(test)]
pub(crate) use leaf_test::decide;
pub(crate) use ray_queue::{FEW, QueuedRays, RayQueue, Waiting};
pub(crate) use traverse::{BlockedBy, Closest, Occluded, approach, blocked, closest, occluded};
