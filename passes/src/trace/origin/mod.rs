//! Where secondary rays start: exact points of triangles, moved off them by a bound of their rounding error.
//!
//! [`SurfacePoint`] is one point. [`SurfacePoints`] are eight points at a time, with the same bits.
//! May use: `ray`, `rounding`, `simd`.

mod sphere_point;
mod surface_point;
mod surface_points;

pub use surface_point::SurfacePoint;
pub(crate) use surface_point::{higher, largest, unit_or_zero};
pub(crate) use surface_points::{SurfacePoints, at_vertices, double, half_of, vertices};
