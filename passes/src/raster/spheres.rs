//! Which pixels an exact sphere covers, for both rasterisers.

use curitiba_pipeline::scene::Sphere;
use glam::{DMat4, DVec3, DVec4};
use std::ops::Range;

/// The columns and rows of a viewport of `size` pixels that a sphere covers, with a margin. `matrix` maps from positions relative to
/// `eye` to clip space. `None` where the sphere is behind the eye or outside the viewport.
pub(in crate::raster) fn covered_pixels(
    sphere: &Sphere,
    (matrix, eye): (&DMat4, DVec3),
    size: [f64; 2],
) -> Option<[Range<usize>; 2]> {
    let center = (sphere.center.as_dvec3() - eye).extend(1.0);
    let [right, up, _, w] = [0, 1, 2, 3].map(|row| matrix.row(row));
    let radius = f64::from(sphere.radius);
    let range = |row: DVec4, side: f64, flip: f64| {
        let (low, high) = extent(center, radius, row * flip, w)?;
        // From -1..1 to pixels, with a margin of one pixel on each side for rounding.
        let pixel = |at: f64| (0.5 * at + 0.5) * side;
        let (low, high) = (pixel(low).floor() - 1.0, pixel(high).ceil() + 1.0);
        let range = low.clamp(0.0, side) as usize..high.clamp(0.0, side) as usize;
        (!range.is_empty()).then_some(range)
    };
    Some([range(right, size[0], 1.0)?, range(up, size[1], -1.0)?])
}

/// The interval of a sphere along an axis of the screen: the least and greatest x/w. The dot products of a point with `row`
/// and `w` are the point's x and w. `None` where the whole sphere is behind the eye.
///
/// The plane x = k w touches the sphere where (x - k w)² = r² |∇(x - k w)|², a quadratic equation in k.
fn extent(center: DVec4, radius: f64, row: DVec4, w: DVec4) -> Option<(f64, f64)> {
    let (x, depth, square) = (row.dot(center), w.dot(center), radius * radius);
    let (along_x, along_w) = (row.truncate(), w.truncate());
    if depth + radius * along_w.length() <= 0.0 {
        return None;
    }
    let a = depth * depth - square * along_w.length_squared();
    // Where a part of the sphere is behind the eye, the interval is unbounded.
    if depth <= 0.0 || a <= 1e-9 * depth * depth {
        return Some((f64::NEG_INFINITY, f64::INFINITY));
    }
    let b = x * depth - square * along_x.dot(along_w);
    let c = x * x - square * along_x.length_squared();
    let root = (b * b - a * c).max(0.0).sqrt();
    Some(((b - root) / a, (b + root) / a))
}
