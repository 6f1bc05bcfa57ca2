//! The wide tree in memory, and what every traversal of it needs: prepared rays, volumes, stacks.
//!
//! Data and box tests only: `build` builds the tree; `single`, `packet`, `fan` and `parallel` traverse it.
//! May use: `ray`, `rounding`, `simd`.

mod leaf;
mod node;
mod prepared_ray;
mod stack;
mod volumes;
mod wide_tree;

pub(crate) use leaf::{Leaf, TRANSPARENT};
pub(crate) use node::{Child, Node};
pub(crate) use prepared_ray::{Line, PreparedRay, Start, permutation};
pub(crate) use stack::{List, STACK, Stack};
pub(crate) use volumes::{Ball, Bounds, Plane, half_balls, slack};
pub(crate) use wide_tree::WideTree;
