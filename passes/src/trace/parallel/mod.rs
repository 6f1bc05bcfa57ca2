//! Parallel rays: shadow rays of a tile's pixels to a distant light, tested against lists of triangles.
//!
//! Triangles and origins are projected along the direction (`projection`). The triangles that may block rays of a tile are collected
//! (`list`) and compared with the rays (`tile`), both for exact rays (`exact`) and for rays whose origins are only estimated (`estimate`,
//! `decide`).
//! May use: `packet`, `origin`, `tree`, `ray`, `rounding`, `simd`.

mod decide;
mod estimate;
mod exact;
mod list;
mod projection;
mod tile;

pub(crate) use decide::decide;
pub(crate) use estimate::Faces;
pub use estimate::{Decided, Estimates};
pub(crate) use exact::occluded;
