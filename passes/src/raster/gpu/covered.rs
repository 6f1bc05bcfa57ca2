//! Which pixels of a picture an axis-parallel box can cover.

use curitiba_pipeline::backend::{Rect, View};
use glam::Vec3;

/// Margin around the projected box, in pixels, because corners of triangles are snapped and sums are rounded.
const MARGIN: f64 = 1.0;

/// The pixels of `part` that may show something in a box, which is given by two opposite corners. The result is relative to the corner of
/// `part`; `size` is the picture's size. The result is the whole part if a corner of the box is not in front of the eye.
pub(super) fn covered(view: &View, size: [u32; 2], part: Rect, [low, high]: [Vec3; 2]) -> Rect {
    let whole = Rect { x: 0, y: 0, ..part };
    let (clip, eye) = view.projection();
    let (clip, eye) = (clip.as_dmat4(), eye.as_dvec3());
    let [mut from, mut to] = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    for corner in 0..8 {
        let take = |axis: usize| if corner >> axis & 1 == 1 { high[axis] } else { low[axis] };
        let at = clip * (Vec3::new(take(0), take(1), take(2)).as_dvec3() - eye).extend(1.0);
        if !(at.is_finite() && at.w > 0.0) {
            return whole;
        }
        // Rows count downwards.
        let place = [0.5 + 0.5 * at.x / at.w, 0.5 - 0.5 * at.y / at.w];
        for axis in 0..2 {
            let pixel = place[axis] * f64::from(size[axis]);
            (from[axis], to[axis]) = (from[axis].min(pixel), to[axis].max(pixel));
        }
    }
    // Casts saturate at the ends of the range of `u32`.
    let span = |axis: usize, start: u32, length: u32| {
        let clamped = |pixel: f64| (pixel as u32).clamp(start, start + length) - start;
        let first = clamped((from[axis] - MARGIN).floor());
        (first, clamped((to[axis] + MARGIN).ceil()) - first)
    };
    let ((x, width), (y, height)) = (span(0, part.x, part.width), span(1, part.y, part.height));
    Rect { x, y, width, height }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::camera::rh::proj::directx::{orthographic, perspective_infinite_reverse};
    use glam::camera::rh::view::look_at_mat4;

    /// Cameras with and without perspective look at boxes that lie before, around, beside and behind them.
    #[test]
    fn what_a_point_of_the_box_covers_lies_within() {
        let size = [640, 360];
        let part = Rect { x: 37, y: 20, width: 500, height: 300 };
        let mut random = {
            let mut state = 7_u32;
            move || {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 8) as f32 / 16_777_216.0
            }
        };
        let (mut small, mut inside) = (0, 0);
        for turn in 0..400 {
            let mut place = |scale: f32| Vec3::new(random() - 0.5, random() - 0.5, random() - 0.5) * scale;
            let (eye, low) = (place(20.0), place(20.0));
            let high = low + (place(6.0)).abs();
            let look = look_at_mat4(eye, place(4.0), Vec3::Y);
            let project = match turn % 2 {
                0 => perspective_infinite_reverse(0.9, 16.0 / 9.0, 0.01),
                _ => orthographic(-8.0, 8.0, -4.5, 4.5, 0.1, 100.0),
            };
            let view = View::new(project * look, eye);
            let found = covered(&view, size, part, [low, high]);
            assert!(found.x + found.width <= part.width && found.y + found.height <= part.height, "{found:?}");
            small += u32::from(found.width * found.height < part.width * part.height / 4);
            for _ in 0..50 {
                let at = low + (high - low) * Vec3::new(random(), random(), random());
                let clip = view.clip_from_world * at.extend(1.0);
                if clip.w <= 0.0 {
                    continue;
                }
                let (x, y) = (320.0 + 320.0 * clip.x / clip.w, 180.0 - 180.0 * clip.y / clip.w);
                let (x, y) = ((x - 37.0).floor(), (y - 20.0).floor());
                if x < 0.0 || y < 0.0 || x >= 500.0 || y >= 300.0 {
                    continue;
                }
                let (x, y) = (x as u32, y as u32);
                inside += 1;
                let within = x >= found.x && y >= found.y && x < found.x + found.width && y < found.y + found.height;
                assert!(within, "{turn}: {x} {y} in {found:?}");
            }
        }
        assert!(small > 100 && inside > 1000, "control: {small} {inside}");
    }

    #[test]
    fn a_box_beside_the_picture_covers_nothing_and_one_around_the_eye_may_cover_all() {
        let (size, part) = ([100, 100], Rect { x: 0, y: 0, width: 100, height: 100 });
        let view = View::new(perspective_infinite_reverse(1.0, 1.0, 0.1), Vec3::ZERO);
        let beside = covered(&view, size, part, [Vec3::new(50.0, 0.0, -3.0), Vec3::new(51.0, 1.0, -2.0)]);
        assert_eq!(beside.width, 0);
        assert_eq!(covered(&view, size, part, [Vec3::splat(-1.0), Vec3::ONE]), part);
        let unknown = covered(&view, size, part, [Vec3::splat(f32::NAN), Vec3::ONE]);
        assert_eq!(unknown, part);
    }
}
