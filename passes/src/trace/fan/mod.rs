//! Fans: many short rays from one origin, or from origins near each other, as ambient occlusion traces them.
//!
//! Three methods, from cheap to expensive: a proof that no triangle is in reach (`hemisphere`); a list of the few triangles in reach,
//! gathered once (`candidates`, `cone_test`); and the traversal of the tree by the fan (`traverse`, `leaf_cones`).
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
