//! Cameras and lights of jobs.

use crate::gbuffer::Rect;
use crate::pixel_samples::PixelSamples;
use glam::{DMat4, DVec3, Mat4, Vec3, Vec4};

/// A camera ready for a viewport. World positions are relative to [`RenderScene::origin`](crate::scene::RenderScene::origin), as
/// the scene holds them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// World to clip space, right-handed, with reversed depth: 1 at the near plane, 0 at the far plane.
    pub clip_from_world: Mat4,
    /// Camera position in world space.
    pub eye: Vec3,
    /// Like [`Self::clip_from_world`], but for positions minus [`Self::eye`]; `None` near the origin. Rasterisers prefer this matrix. Far
    /// from the origin [`Self::clip_from_world`] has a large translation, and the product of that matrix and a position loses digits that
    /// the difference of position and eye keeps.
    pub clip_from_eye: Option<Mat4>,
    /// Side of the square over which a texture lookup is filtered, in pixels: 1 for one sample a pixel, below 1 for several.
    pub footprint: f32,
    /// Clip plane of a mirrored camera: the plane of its mirror. Fragments with `dot(plane, (p, 1)) < 0` lie behind the mirror and
    /// are not drawn. `p` is the position minus the offset that [`Self::projection`] returns. `None` clips nothing.
    pub clip_plane: Option<Vec4>,
}

impl View {
    /// A camera near the origin: without [`Self::clip_from_eye`] and without a clip plane, with a footprint of one pixel.
    #[must_use]
    pub fn new(clip_from_world: Mat4, eye: Vec3) -> Self {
        Self { clip_from_world, eye, clip_from_eye: None, footprint: 1.0, clip_plane: None }
    }

    /// The camera for sample number `sample` of every pixel of a viewport: shifted so that this sample falls on the pixel's centre.
    #[must_use]
    pub fn of_sample(self, viewport: Rect, samples: PixelSamples, sample: u32) -> Self {
        let [right, down] = samples.offset(sample).map(f64::from);
        let [width, height] = [viewport.width, viewport.height].map(|side| f64::from(side.max(1)));
        // Clip space is 2 wide and 2 high, with y upwards. The picture moves in the direction opposite to the sample's offset.
        let moved = DMat4::from_translation(DVec3::new(-2.0 * right / width, 2.0 * down / height, 0.0));
        Self { footprint: samples.side(), ..self.mapped(moved) }
    }

    /// The same camera with `map` applied after its projection. The matrices are multiplied in `f64`.
    #[must_use]
    pub fn mapped(self, map: DMat4) -> Self {
        let of = |matrix: Mat4| (map * matrix.as_dmat4()).as_mat4();
        Self { clip_from_world: of(self.clip_from_world), clip_from_eye: self.clip_from_eye.map(of), ..self }
    }

    /// The projection for rasterisers: a matrix, and the offset to subtract from positions before it is applied.
    #[must_use]
    pub fn projection(&self) -> (Mat4, Vec3) {
        self.clip_from_eye.map_or((self.clip_from_world, Vec3::ZERO), |matrix| (matrix, self.eye))
    }
}

/// The cone of rays through a pixel in the middle of the picture: at the distance t from the eye, in scene units, the cone has a width of
/// `width + spread * t` perpendicular to the ray. At an angle a from the axis of a perspective camera, the cone of a pixel is narrower: by
/// the factor cos² a in the radial direction of the picture, and by cos a perpendicular to the radial direction.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PixelCone {
    /// Width at the eye: 0 with perspective.
    pub width: f32,
    /// Growth of the width for each scene unit of distance; 0 without perspective.
    pub spread: f32,
}

impl PixelCone {
    /// The cone of a view's pixels, for a viewport of this width and height in pixels. The cone is as wide as the longer side of a pixel,
    /// as in rasterisers, times [`View::footprint`].
    #[must_use]
    pub fn of(view: &View, [width, height]: [u32; 2]) -> Self {
        let matrix = view.clip_from_eye.unwrap_or(view.clip_from_world).as_dmat4();
        let [right, up, forward] = [0, 1, 3].map(|row| matrix.row(row).truncate());
        // Clip space is 2 wide and 2 high. Where its fourth coordinate is 1, the distance along the axis is 1 / |forward|.
        let side = |row: DVec3, count: u32| {
            let across = if forward == DVec3::ZERO { row } else { row.reject_from(forward) / forward.length() };
            2.0 / (across.length() * f64::from(count.max(1)))
        };
        let side = (side(right, width).max(side(up, height)) * f64::from(view.footprint)) as f32;
        if forward == DVec3::ZERO { Self { width: side, spread: 0.0 } } else { Self { width: 0.0, spread: side } }
    }
}

/// The directional light of a pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sun {
    /// Unit direction in which the light travels.
    pub direction: Vec3,
    /// Colour of the light.
    pub color: Vec3,
}

/// A point light of a pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lamp {
    /// Position in world space.
    pub position: Vec3,
    /// Colour of the light.
    pub color: Vec3,
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::camera::rh;

    /// Sides of the middle pixel in `f64`, measured between the scene positions of its edges.
    fn measured(view: &View, [width, height]: [u32; 2], depth: f64) -> [f64; 2] {
        let inverse = view.clip_from_world.as_dmat4().inverse();
        let at = |x: f64, y: f64| inverse.project_point3(DVec3::new(x, y, depth));
        let [half_x, half_y] = [width, height].map(|count| 1.0 / f64::from(count));
        [at(-half_x, 0.0).distance(at(half_x, 0.0)), at(0.0, -half_y).distance(at(0.0, half_y))]
    }

    #[test]
    fn a_pixels_cone_is_as_wide_as_the_pixel() {
        let (eye, direction) = (Vec3::new(3.0, 2.0, -5.0), Vec3::new(0.3, -0.4, 0.8).normalize());
        let look = rh::view::look_to_mat4(eye, direction, Vec3::Y);
        let size = [640, 480];
        for aspect in [4.0 / 3.0, 2.0] {
            let projection = rh::proj::directx::perspective(0.9, aspect, 100.0, 0.1);
            let view = View::new(projection * look, eye);
            let PixelCone { width, spread } = PixelCone::of(&view, size);
            assert_eq!(width, 0.0);
            let depth = 0.02;
            let middle = view.clip_from_world.as_dmat4().inverse().project_point3(DVec3::new(0.0, 0.0, depth));
            let sides = measured(&view, size, depth);
            let found = f64::from(spread) * middle.distance(eye.as_dvec3());
            assert!((found / sides[0].max(sides[1]) - 1.0).abs() < 1e-4, "{aspect}: {found} {sides:?}");
            assert!(aspect < 1.5 || sides[0] > 1.4 * sides[1], "the longer of unlike sides: {sides:?}");
            let four = PixelSamples::new(4).expect("it is a number of samples");
            let sample = view.of_sample(Rect { x: 0, y: 0, width: 640, height: 480 }, four, 3);
            assert!((PixelCone::of(&sample, size).spread / spread - 0.5).abs() < 1e-6, "samples share a pixel");
            let turned = projection * rh::view::look_to_mat4(Vec3::ZERO, direction, Vec3::Y);
            let far = View { clip_from_eye: Some(turned), ..View::new(Mat4::ZERO, eye) };
            assert!((PixelCone::of(&far, size).spread / spread - 1.0).abs() < 1e-6, "far from the origin");
        }
        let flat = View::new(rh::proj::directx::orthographic(-8.0, 8.0, -3.0, 3.0, 50.0, 0.0) * look, eye);
        let PixelCone { width, spread } = PixelCone::of(&flat, size);
        let sides = measured(&flat, size, 0.5);
        assert!((f64::from(width) / sides[0].max(sides[1]) - 1.0).abs() < 1e-4 && spread == 0.0, "{width} {sides:?}");
    }
}
