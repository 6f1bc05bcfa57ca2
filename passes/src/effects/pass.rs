//! A pass and its pixels: the arguments of every program.

use super::camera::Eye;
use super::coverage::Coverage;
use super::dielectric::{Focused, Media, Targets};
use crate::sampling::HemisphereSampler;
use crate::sampling::cone::ConeSampler;
use crate::sampling::hash::pixel_key;
use crate::trace::{Hit, Tracer};
use curitiba_pipeline::backend::{NO_TRIANGLE, RayJob};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::glass::Stratum;
use curitiba_pipeline::scene::TriangleRanges;
use glam::{Vec3, Vec4};

/// Values that all pixels of one pass share. The lengths of the job's slices were checked against its size.
#[derive(Debug)]
pub struct Pass<'a, T, C> {
    /// The job.
    pub job: &'a RayJob<'a>,
    /// The acceleration structure of the job's scene.
    pub tracer: &'a T,
    /// Where triangles of the scene are cut out.
    pub coverage: C,
    /// Unit vector towards the light; 0 where the program does not read it.
    pub to_light: Vec3,
    /// The light's colour; 0 where the program does not read it.
    pub light_color: Vec3,
    /// Occlusion directions in `corrected`; `None` switches occlusion off.
    pub occlusion: Option<HemisphereSampler>,
    /// Strata along one side of the occlusion square in `thesis`; 0 switches occlusion off.
    pub strata: u32,
    /// See [`open_shares`](super::open_shares); empty where occlusion is off.
    pub open_share: Vec<f32>,
    /// Triangles that are glass to radiance rays.
    pub glass: TriangleRanges,
    /// Triangles that are glass to shadow rays, which pass them.
    pub shadow_glass: TriangleRanges,
    /// The glass bodies that the camera is in.
    pub around_eye: Media,
    /// The strata of the spectrum; empty where no body disperses light.
    pub spectrum: Vec<Stratum>,
    /// Sobol points with their bits reversed, one for each path, by which rough glass is sampled; empty where no glass
    /// is rough.
    pub facets: Vec<[u32; 2]>,
    /// The meshes at which photons are shot: they block straight light. Empty where a pass shoots no photons.
    pub targets: Targets,
    /// The light that glass focuses, with `shadow=caustic`; else none.
    pub focused: Focused,
    /// Directions to the discs of directional lights; `None` where these are points.
    pub disc: Option<ConeSampler>,
    /// The rays of the camera; `None` for programs that read a G-buffer.
    pub eye: Option<Eye>,
    /// The progress by which the pass may be cancelled; `None` where nobody can cancel it.
    pub progress: Option<&'a Progress>,
}

/// A pixel of the pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pixel {
    /// Column.
    pub x: u32,
    /// Row from the top.
    pub y: u32,
    /// `y * width + x`.
    pub index: usize,
}

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    /// The key of a pixel's random numbers; it depends on the pixel's place in the whole picture, not in the part that
    /// is rendered.
    pub(super) fn key(&self, pixel: Pixel) -> u32 {
        let [x, y] = self.job.origin;
        pixel_key(x + pixel.x, y + pixel.y, self.job.seed)
    }

    pub(super) fn position(&self, pixel: Pixel) -> Vec4 {
        Vec4::from_array(self.job.position[pixel.index])
    }

    pub(super) fn normal(&self, pixel: Pixel) -> Vec3 {
        Vec4::from_array(self.job.normal[pixel.index]).truncate()
    }

    pub(super) fn triangle(&self, pixel: Pixel) -> Option<u32> {
        Some(self.job.triangle[pixel.index]).filter(|triangle| *triangle != NO_TRIANGLE)
    }

    /// Whether a triangle belongs to a sky, which keeps its colour whatever the light.
    pub(super) fn is_sky(&self, triangle: u32) -> bool {
        self.job.scene.geometry.sky.contains(triangle)
    }

    pub(super) fn is_glass(&self, triangle: u32) -> bool {
        self.glass.contains(triangle)
    }

    /// Whether a hit stops light: there is a surface, and it is not glass that shadow rays pass.
    pub(super) fn stops_light(&self, hit: &Hit) -> bool {
        !self.passes_light(hit) && self.covers(hit)
    }

    pub(super) fn passes_light(&self, hit: &Hit) -> bool {
        self.shadow_glass.contains(hit.triangle)
    }
}

/// A colour with alpha 1.
pub(crate) fn opaque(color: Vec3) -> [f32; 4] {
    color.extend(1.0).to_array()
}
