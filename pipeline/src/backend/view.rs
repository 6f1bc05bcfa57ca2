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
    /// Like [`Self::clip_from_world`], but for positions minus [`Self::eye`]. Rasterisers project with it where it is given: a
    /// camera far from the origin has a large translation in its matrix, and the product loses digits that the difference keeps.
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
