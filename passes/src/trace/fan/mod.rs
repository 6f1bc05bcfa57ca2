//! Fans: many short rays from one origin, or from origins near each other, as ambient occlusion traces them.
//!
//! From cheap to expensive: nothing is in reach (`hemisphere`); few triangles are in reach and are gathered once (`candidates`,
//! `cone_test`); the fan traverses the tree (`traverse`, `leaf_cones`).
//! May use: `single`, `tree`, `ray`, `rounding`, `simd`.

mod candidates;
mod cone_test;
mod hemisphere;
mod leaf_cones;
mod traverse;

pub(crate) use candidates::Gather;
pub use candidates::{Candidates, Neighbourhood};
pub(crate) use hemisphere::ClearAbove;
pub(crate) use traverse::CountOpen;
