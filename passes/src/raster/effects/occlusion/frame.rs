//! Values that all pixels of an ambient occlusion share.

use crate::raster::effects::screen::camera::ScreenCamera;
use curitiba_pipeline::backend::EffectJob;
use glam::{Vec3, Vec4};

/// Increments of the jitters of a slice's two sides from one slice to the next, in units of 2⁻³². They are those of the sequence R2 (Roberts,
/// "The Unreasonable Effectiveness of Quasirandom Sequences", 2018), which spreads points evenly in a square: `2³² / p` and `2³² / p²` with
/// `p³ = p + 1`.
pub const JITTERS: [u32; 2] = [0xc13f_a9a9, 0x91e1_0da6];

/// Values that all pixels of an ambient occlusion share.
#[derive(Debug, Clone)]
pub struct Occlusion<'a> {
    /// The G-buffer, by pixel. Where no surface is seen, all numbers of the position and of the normal are 0.
    pub(super) position: &'a [[f32; 4]],
    pub(super) normal: &'a [[f32; 4]],
    /// Rows of the matrix from a position, relative to [`Self::from`], to `(column w, row w, w)`; columns and rows are in
    /// pixels from the upper left corner.
    pub(super) rows: [[f32; 4]; 3],
    pub(super) from: Vec3,
    pub(super) eye: Vec3,
    pub(super) width: u32,
    pub(super) height: u32,
    /// Greatest distance of a step from its pixel, in pixels: [`most_pixels`].
    pub(super) most: f32,
    pub(super) seed: u32,
    pub(super) radius: f32,
    pub(super) intensity: f32,
    pub(super) thickness: f32,
    pub(super) steps: u32,
    /// For each slice, cosine and sine of its angle from the first slice.
    pub(super) turns: Vec<[f32; 2]>,
}

/// Greatest distance of a step from its pixel, in pixels. It is greater than every distance within a picture of this size.
#[must_use]
pub fn most_pixels(width: u32, height: u32) -> f32 {
    width as f32 + height as f32
}

impl<'a> Occlusion<'a> {
    /// The values of a job, whose buffers must fit together and whose parameters must be valid.
    #[must_use]
    pub fn new(job: &EffectJob<'a>) -> Self {
        let camera = ScreenCamera::or_blind(&job.view, job.width, job.height);
        let w = if camera.perspective() { camera.depths } else { Vec4::W };
        let turn = |index: u32| {
            let (sin, cos) = (std::f64::consts::PI * f64::from(index) / f64::from(job.params.slices)).sin_cos();
            [cos as f32, sin as f32]
        };
        Self {
            position: job.position,
            normal: job.normal,
            rows: [camera.columns, camera.rows, w].map(|row| row.to_array()),
            from: camera.from.truncate(),
            eye: job.view.eye,
            width: job.width,
            height: job.height,
            most: most_pixels(job.width, job.height),
            seed: job.seed,
            radius: job.params.radius,
            intensity: job.params.intensity,
            thickness: job.params.thickness,
            steps: job.params.steps,
            turns: (0..job.params.slices).map(turn).collect(),
        }
    }

    /// The same values with an exponent (`intensity`) of 1.
    #[must_use]
    pub fn plain(self) -> Self {
        Self { intensity: 1.0, ..self }
    }
}
