//! Every bound on a rounding error, with its derivation, and the verdict that such a bound allows.
//!
//! `u` is [`UNIT_ROUNDOFF`]. A test with a bound says "hit" or "miss" only where the value that it computes is farther from 0 than the
//! bound; where the value is nearer, the watertight test decides. Too wide a bound costs time, and too small a bound gives a wrong picture:
//! tests with each bound reduced check that wrong verdicts appear. The bounds that device code needs are written from here to
//! `cuda/programs/params.cuh`.

use super::simd::Mask;

/// The certain verdicts on several rays, or on one ray and several triangles: one bit a lane. Lanes in neither mask are undecided.
pub(crate) struct Verdict {
    pub(crate) hit: Mask,
    pub(crate) miss: Mask,
}

/// Unit roundoff of `f32`, 2⁻²⁴: a rounded operation has the exact result times `1 + e`, `|e| <= u`.
pub(crate) const UNIT_ROUNDOFF: f32 = 1.0 / 16_777_216.0;

// The slab test of a ray and a box (see `PreparedRay`). The origin of the slabs is moved outward by the error of the shear.

/// Error of a sheared coordinate, relative to the sum of the scene's largest distances from the origin along two axes. The test errs by
/// `5 u (|x| + |z|)`; the rest is margin.
pub(crate) const SLAB_ERROR: f32 = 8.0 * UNIT_ROUNDOFF;
/// Rounding error of the moved origin itself, relative to its coordinates: one unit in the last place.
pub(crate) const SLAB_ORIGIN_ERROR: f32 = 2.0 * UNIT_ROUNDOFF;
/// How much farther the origin is moved for the slab test with fused multiply-add, relative to the distances and coordinates: see
/// `Start::farthest`.
pub(crate) const FUSED_SLAB_ERROR: f32 = 16.0 * UNIT_ROUNDOFF;
/// Distances of the scene from an origin are clamped to this, so that products with them stay finite.
pub(crate) const LARGEST_REACH: f32 = 1.0e30;

/// Factor by which the distances of far planes of boxes grow: Ize, "Robust BVH Ray Traversal", JCGT 2(2), 2013. The far distance must grow
/// by 6 u, twice the error of a slab distance.
pub(crate) const FAR: f32 = 1.0 + 8.0 * UNIT_ROUNDOFF;

// Volumes that all rays of a group stay in (see `tree/volumes.rs`).

/// Error of the height of a point above a plane, relative to the sum of the absolute values of the three products that add up to the
/// height. The addition is four operations deep, each off by at most half a unit in the last place of a term.
pub(crate) const SIDE_ERROR: f32 = 8.0 * UNIT_ROUNDOFF;
/// Factor by which the radius of a bounding ball is grown.
pub(crate) const BALL_MARGIN: f32 = 1.0 + 1.0e-4;
/// Error of a ray's end point, relative to the ray's length and to its origin's coordinates.
pub(crate) const END_ERROR: f32 = 32.0 * UNIT_ROUNDOFF;
/// Error of the rim of a half ball, relative to its radius: four times the square root of [`UNIT_ROUNDOFF`], since the rim is the root
/// of a difference near 0.
pub(crate) const RIM_ERROR: f32 = 4.0 / 4096.0;

// The edge functions of a triangle.

/// Error of an edge function whose plane passes through a common origin, in units of `M M'`: `M` and `M'` are the largest coordinates of
/// its two corners relative to that origin.
///
/// The watertight test shears a corner with an error of at most `5 u (|x| + |z|)`, that is `10 u M`. Its products then err by
/// `80 u M M'`, and their rounding by `16 u M M'`. The normal through the origin errs by `8 u M M'` along each axis (the relative corners
/// by `u` each, two products and their difference), which is `14 u M M'` for a unit direction; the dot product with it errs by
/// `4 u` times the sum of its terms, `24 u M M'` at most. The sum of all is `134 u M M'`.
pub(crate) const EDGE_ERROR: f32 = 144.0 * UNIT_ROUNDOFF;
/// Range of the largest coordinate relative to the origin, from `SMALLEST` to [`LARGEST`], in which the watertight test neither underflows
/// nor overflows, so that its error is relative.
pub(crate) const SMALLEST: f32 = 1.0e-15;
/// See [`SMALLEST`].
pub(crate) const LARGEST: f32 = 1.0e15;
/// Greatest length of a direction for which [`EDGE_ERROR`] and the bounds below it hold: a unit vector, up to rounding.
pub(crate) const LONGEST: f32 = 1.0 + 1.0e-5;

// The plane of a triangle, tested by rays from a common origin.

/// Error of the dot product of a direction and a normal whose largest component is 1.
pub(crate) const PLANE_ERROR: f32 = 16.0 * UNIT_ROUNDOFF;
/// Error of the height of an origin above a plane, relative to the height of the group's centre and to the distance of the origin from that
/// centre: three products and three sums of numbers that were rounded once.
pub(crate) const HEIGHT_ERROR: f32 = 16.0 * UNIT_ROUNDOFF;
/// Least height of the origin above a plane, relative to the triangle's largest coordinate, at which the plane decides misses. From there
/// on, no ray that is nearly parallel to the plane meets the triangle, even with its corners moved by the error of the watertight test,
/// `30 u`.
pub(crate) const EDGE_ON: f32 = 256.0 * UNIT_ROUNDOFF;
/// Relative margin of distances, above the rounding errors of the plane test and of the watertight test.
pub(crate) const DISTANCE_MARGIN: f32 = 2.0e-6;
/// A triangle's normal must be at least this share of the product of the lengths of its edges to be trusted. That is far above the rounding
/// of `f64`, and makes the largest component of a trusted normal correct to the last bit of `f32`.
pub(crate) const SHARPEST: f64 = 1.0e-8;

// The plane of a triangle, tested without its distance (see `packet/plane_test.rs`).

/// Bound on the errors of `p` and `q` in the plane test, in units of `u R` and of `u`: above the sum of the errors that are listed there.
pub(crate) const DOUBT: f32 = 64.0;
/// Largest component of a direction for which [`DOUBT`] holds.
pub(crate) const LONGEST_DIRECTION: f32 = 1.0 + 1.0e-3;
/// Triangles thinner than this share of their length are left to the watertight test: their normal, in `f64`, is less precise than the
/// plane test needs.
pub(crate) const THIN: f64 = 1.0e-7;
/// Range, from `SMALLEST_SQUARE` to [`LARGEST_SQUARE`], of the error bound of `p` in which the plane test of a leaf neither underflows nor
/// overflows. The sum of squared edge lengths must also be at least `SMALLEST_SQUARE`.
pub(crate) const SMALLEST_SQUARE: f32 = 1.0e-25;
/// See [`SMALLEST_SQUARE`].
pub(crate) const LARGEST_SQUARE: f32 = 1.0e25;

// Triangles and origins projected along a common direction (see `parallel/projection.rs`).

/// Largest coordinate, relative to the tile's centre, for which no product overflows.
pub(crate) const LARGEST_COORDINATE: f32 = 1.0e8;
/// Error of a projected coordinate, in units of `u S`.
pub(crate) const COORDINATE_UNITS: f32 = 32.0;
/// Error of a projected edge function, in units of `u S D`.
pub(crate) const EDGE_UNITS: f32 = 96.0;
/// Error of the height of an origin above a triangle's plane, in units of `u` times the products that it is made of.
pub(crate) const HEIGHT_UNITS: f32 = 24.0;
/// Absolute error that is added to every bound: above the error of products that underflow.
pub(crate) const TINY: f32 = 1.0e-30;

// Where rays leave a surface (see `origin/surface_point.rs`).

/// Units of rounding error by which [`SurfacePoint::spawn`](super::SurfacePoint::spawn) moves the origin off the surface. Of 4.8 million
/// hits over twelve combinations of scale and distance from the origin, 8 units left a few self-intersections and 16 none.
pub(crate) const OFFSET_UNITS: f32 = 32.0;
/// Offset of ray origins on a sphere, in units of [`UNIT_ROUNDOFF`] times (largest coordinate of the centre + radius). It covers the
/// rounding of the point, of the ray's origin, and of the centre relative to that origin. Of 240,000 rays over twelve combinations of size
/// and place, along the surface and off it, none met the sphere that it left.
pub(crate) const SPHERE_OFFSET: f32 = 4.0;
/// Share of the distance to the farthest corner that is added to a point's rounding error before [`OFFSET_UNITS`] multiplies the sum. It
/// stands for the error of the triangle test. The test uses corners relative to the ray's origin, so it errs even where the coordinates
/// along the normal are exactly 0.
pub(crate) const OFFSET_REACH: f64 = 0.5;
/// Distance that ray origins keep from the borders of their triangle, in units of the point's rounding error along its worst axis. Without
/// this distance, another surface that stands on a border could pass through the origin, or lie behind the origin of a ray that goes to it.
pub(crate) const OFFSET_MARGIN: f64 = 32.0;

// Estimates of ray origins (see `parallel/estimate.rs`).

/// Square of the least ratio of a triangle's width to its length for which origins on it are estimated.
pub(crate) const THIN_SQUARE: f64 = 1.0e-6;
/// Factor in two terms of the error of an estimate: this times `u` times the largest coordinate, and this times `u E`.
pub(crate) const COORDINATES_ERROR: f32 = 4.0;
/// Factor in the third term of the error of an estimate: this times `u Q` along the normal.
pub(crate) const SHIFT_ERROR: f64 = 24.0;

// Rays of a fan.

/// Least component of a direction that is traversed together with others: with smaller components, products with reciprocals could
/// overflow.
pub(crate) const LEAST_COMPONENT: f32 = 1.0e-18;

// Cone tests on a device, where the normal and the height of a triangle are computed in `f64` for each origin.

/// [`SHARPEST`] for device code: for a triangle just sharp enough, the rounding error of the normal is below `u / 32` times the triangle's
/// largest coordinate relative to the origin.
pub(crate) const DEVICE_SHARPEST: f64 = 1.0e-6;
/// Error of the height from its own rounding, relative to the height.
pub(crate) const DEVICE_HEIGHT_ERROR: f32 = 4.0 * UNIT_ROUNDOFF;
/// Error of the height from the rounding of the normal, relative to the triangle's largest coordinate.
pub(crate) const DEVICE_NORMAL_ERROR: f32 = 0.25 * UNIT_ROUNDOFF;

/// The bounds that device code uses, with their names there.
pub(crate) const OF_DEVICE: &[(&str, f32)] = &[
    ("UNIT_ROUNDOFF", UNIT_ROUNDOFF),
    ("SLAB_ERROR", SLAB_ERROR),
    ("SLAB_ORIGIN_ERROR", SLAB_ORIGIN_ERROR),
    ("LARGEST_REACH", LARGEST_REACH),
    ("FAR_PLANES", FAR),
    ("SIDE_ERROR", SIDE_ERROR),
    ("BALL_MARGIN", BALL_MARGIN),
    ("END_ERROR", END_ERROR),
    ("RIM_ERROR", RIM_ERROR),
    ("EDGE_ERROR", EDGE_ERROR),
    ("SMALLEST", SMALLEST),
    ("LARGEST", LARGEST),
    ("LONGEST", LONGEST),
    ("PLANE_ERROR", PLANE_ERROR),
    ("EDGE_ON", EDGE_ON),
    ("DISTANCE_MARGIN", DISTANCE_MARGIN),
    ("DEVICE_HEIGHT_ERROR", DEVICE_HEIGHT_ERROR),
    ("DEVICE_NORMAL_ERROR", DEVICE_NORMAL_ERROR),
    ("OFFSET_UNITS", OFFSET_UNITS),
    ("OFFSET_REACH", OFFSET_REACH as f32),
    ("OFFSET_MARGIN", OFFSET_MARGIN as f32),
];
