//! Choice of the origin of a scene's coordinates.
//!
//! Buildings and terrains often use map coordinates. `f32` has 24 bits: a million units from the origin its spacing is a sixteenth
//! of a unit, and products of such coordinates with a matrix lose further digits. So coordinates of a scene far from the origin are
//! stored relative to an origin near the scene, and files whose numbers have more digits than `f32` are read relative to that
//! origin before rounding.

use super::{Mesh, Scene};
use glam::{DMat4, DVec3, Vec3};
use rayon::prelude::*;

/// A scene is far from the origin if its distance exceeds this many times its longest side. At 16 sides `f32` coordinates have an
/// error of at most one millionth (2^-20) of that side, less than a thousandth of a pixel in a picture of 1024 pixels that shows the
/// whole scene.
const FAR: f64 = 16.0;

/// Lowest and highest corner of a box.
pub(crate) type Bounds = [DVec3; 2];

/// The origin for contents in a box: 0, unless the box is farther away than [`FAR`] times its longest side; then a point near its
/// centre.
///
/// The origin is a multiple of a power of two that is at least twice the longest side. Moving a scene by a multiple of that power
/// therefore leaves its relative coordinates unchanged, bit for bit; and the origin is exact in `f32`.
pub(crate) fn origin_for([low, high]: Bounds) -> DVec3 {
    let side = (high - low).max_element();
    let away = low.max(-high).max_element();
    if !(away.is_finite() && side.is_finite() && away > FAR * side) {
        return DVec3::ZERO;
    }
    let step = (2.0 * side).max(away * 2.0_f64.powi(-22)).log2().ceil().exp2();
    let origin = (0.5 * (low + high) / step).round() * step;
    // At the ends of the range of f64 the step may be 0 or infinite.
    if origin.is_finite() { origin } else { DVec3::ZERO }
}

/// The bounding box of the finite points; `None` if there are none.
pub(crate) fn bounds(points: &[Vec3]) -> Option<Bounds> {
    let none = || [Vec3::INFINITY, Vec3::NEG_INFINITY];
    let with = |[low, high]: [Vec3; 2], point: &Vec3| match point.is_finite() {
        true => [low.min(*point), high.max(*point)],
        false => [low, high],
    };
    let join = |a: [Vec3; 2], b: [Vec3; 2]| [a[0].min(b[0]), a[1].max(b[1])];
    let [low, high] = points.par_iter().with_min_len(1 << 14).fold(none, with).reduce(none, join);
    low.is_finite().then(|| [low.as_dvec3(), high.as_dvec3()])
}

/// A box around placed meshes: the bounding box of the placed corners of their own boxes.
pub(crate) fn placed_bounds(meshes: &[Mesh], placed: impl Iterator<Item = (u32, DMat4)>) -> Option<Bounds> {
    let boxes: Vec<Option<Bounds>> = meshes.iter().map(|mesh| bounds(&mesh.positions)).collect();
    let mut whole: Option<Bounds> = None;
    for (mesh, transform) in placed {
        let Some([low, high]) = boxes[mesh as usize] else { continue };
        for corner in 0..8 {
            let side = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
            let at = transform.transform_point3(DVec3::new(side(0), side(1), side(2)));
            if at.is_finite() {
                whole = Some(whole.map_or([at, at], |[low, high]| [low.min(at), high.max(at)]));
            }
        }
    }
    whole
}

/// Moves the origin of a scene near its contents if they lie far from 0. Returns the new origin, or 0 if the origin stays. `exact` has the
/// transform of each object in `f64`, before rounding.
pub(crate) fn move_near(scene: &mut Scene, exact: &[DMat4]) -> DVec3 {
    let placed = scene.objects.iter().zip(exact).map(|(object, exact)| (object.mesh, *exact));
    let origin = placed_bounds(&scene.meshes, placed).map_or(DVec3::ZERO, origin_for);
    if origin != DVec3::ZERO {
        scene.origin = origin;
        for (object, exact) in scene.objects.iter_mut().zip(exact) {
            object.transform = (DMat4::from_translation(-origin) * exact).as_mat4();
        }
    }
    origin
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_scenes_stay_and_far_ones_have_an_origin_of_few_bits() {
        let cube = |center: DVec3, half: f64| [center - half, center + half];
        for near in [DVec3::ZERO, DVec3::splat(3.0), DVec3::new(40.0, 0.0, -45.0)] {
            assert_eq!(origin_for(cube(near, 1.5)), DVec3::ZERO, "{near}");
        }
        assert_eq!(origin_for([DVec3::NEG_INFINITY, DVec3::INFINITY]), DVec3::ZERO);
        assert_eq!(origin_for([DVec3::NAN, DVec3::NAN]), DVec3::ZERO);
        for distance in [1e3, 1e4, 1e5, 1e6, 1e7] {
            for off in [DVec3::ZERO, DVec3::new(1.0, 0.5, -1.2)] {
                for axis in [DVec3::X, -DVec3::Y, DVec3::new(1.0, 0.0, -1.0)] {
                    let origin = origin_for(cube(axis * distance + off, 1.5));
                    assert_eq!(origin, axis * distance, "{axis} {distance} {off}");
                }
            }
        }
        for (center, half) in [(DVec3::new(554_321.7, 5_812_345.6, 45.3), 60.0), (DVec3::splat(-1e30), 1.0)] {
            let origin = origin_for(cube(center, half));
            assert_eq!(origin.as_vec3().as_dvec3(), origin, "an f32");
            assert!((origin - center).abs().max_element() <= (4.0 * half).max(center.abs().max_element() * 4e-7));
        }
    }

    #[test]
    fn boxes_leave_out_what_is_not_finite() {
        let points = [Vec3::new(1.0, f32::NAN, 0.0), Vec3::ONE, Vec3::new(2.0, 3.0, -1.0), Vec3::INFINITY];
        assert_eq!(bounds(&points), Some([DVec3::new(1.0, 1.0, -1.0), DVec3::new(2.0, 3.0, 1.0)]));
        assert_eq!(bounds(&points[..1]), None);
    }
}
