//! The six ray programs, one folder each, generic over [`Tracer`].
//!
//! A program is a function of a pixel. Each exists twice: `thesis` follows the report's device code to the letter,
//! `corrected` mends the differences that are numbered below and in `docs/fidelity.md`.
//!
//! | # | `thesis` | `corrected` |
//! |---|---|---|
//! | 1 | the refraction discriminant serves as transmittance, below 0 at grazing angles | exact unpolarised Fresnel |
//! | 2 | glass seen in or through glass loses its refracted colour | both colours are blended |
//! | 3 | `final`: a miss resets what glass took from the light | 0.9 for each glass surface crossed |
//! | 4 | noise from the sine of the position | a counter-based hash |
//! | 5 | rays start at the stored position, hits nearer than 1e-4 (1e-3) are skipped | rays start off the exact triangle, by its rounding error |
//! | 6 | `final`: occlusion darkens glass pixels | glass has none of its own |
//! | 7 | background pixels trace rays | they are left alone |
//! | 8 | a surface's side follows its winding (`final`: the wrong one) or the shading normal | the geometric normal decides, whatever the winding |
//! | 9 | a pixel is glass if its colour is the mask (x > 0, 0, z > 0, 0); its normal is used as stored | if its triangle's material is; its normal is turned to the viewer |
//! | 10 | textures' alpha is ignored | rays pass where a material is cut out |
//! | 11 | the occlusion hemisphere lies where the normal points | on the viewer's side; directions below the triangle are mirrored at its plane |
//! | 12 | shadows and `ssao` write their value into the alpha too | alpha is 1 |
//!
//! Where the printed code leaves a choice, this is what `thesis` does:
//! - `reflection` declares `MAX_DEPTH` and reads `MAXDEPTH`; both are the parameter `depth`.
//! - `reflection` does not dim secondary bounces; `refraction` and `final` do, by 0.99, but not at total reflection. Both
//!   fidelities keep the first; `corrected` dims every secondary bounce of the other two alike.
//! - `refraction` and `final` trace a refracted ray at secondary glass and drop its colour. Its rays are not traced here:
//!   the picture is the same, the ray count lower than the report's. Whether refraction is possible still decides the 0.99.
//! - `final` never sets the payload's value before its first shadow ray. Every ray ends in an opaque hit (0.5) or a miss
//!   (1), which set it, so nothing undefined is seen.
//! - Noise below 0 puts occlusion samples of the first stratum outside the square; their directions are not numbers. Such
//!   a ray meets nothing and counts as open. So does each ray of a background pixel, whose normal is 0.
//! - `ssao` divides by 0 for 0 samples; here they switch it off, as in `final`.

pub mod combined;
pub mod deferred_shadows;
pub mod dummy;
mod lights;
mod material;
mod neighbours;
mod occlusion;
mod optics;
mod optix;
pub mod reflection;
pub mod refraction;
mod shown;
pub mod ssao;
mod surface;

pub use lights::{Area, Lights, TILE};
pub use material::{AlphaTested, Coverage, Opaque};
pub use occlusion::{SHADOWED, open_shares};
pub use optics::{Interface, fresnel, interface, reflect, schlick};

use crate::sampling::HemisphereSampler;
use crate::trace::{Directions, Hit, Nearby, Tracer};
use curitiba_pipeline::backend::{NO_TRIANGLE, RayCounts, RayJob};
use curitiba_pipeline::scene::TriangleRanges;
use glam::{Vec3, Vec4};

/// What other spellings of the programs must have in common with these, beside the formulas.
pub mod constants {
    pub use super::material::AMBIENT;
    pub use super::occlusion::{SHADOWED, THROUGH_GLASS};
    pub use super::optix::{BOUNCE, EPSILON, REFRACTED_EPSILON};
    pub use super::refraction::corrected::{REFLECTED, REFRACTED};
    pub use crate::sampling::hash::{DIMENSIONS, PATH, PIXEL, SCRAMBLE};
}

/// What the pixels of one pass have in common. The job's slices were checked against its sizes.
#[derive(Debug)]
pub struct Pass<'a, T, C> {
    /// The job.
    pub job: &'a RayJob<'a>,
    /// Its scene's acceleration structure.
    pub tracer: &'a T,
    /// Where its triangles are cut out.
    pub coverage: C,
    /// Unit vector towards the light; 0 where the program does not read it.
    pub to_light: Vec3,
    /// The light's colour; 0 where the program does not read it.
    pub light_color: Vec3,
    /// Occlusion directions in `corrected`; `None` switches occlusion off.
    pub occlusion: Option<HemisphereSampler>,
    /// Strata a side in `thesis`; 0 switches occlusion off.
    pub strata: u32,
    /// See [`open_shares`]; empty where occlusion is off.
    pub open_share: Vec<f32>,
    /// The triangles of glass, for radiance rays.
    pub glass: TriangleRanges,
    /// Those that shadow rays pass.
    pub shadow_glass: TriangleRanges,
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

/// Buffers that a worker keeps from pixel to pixel, and its counts.
#[derive(Debug, Default)]
pub struct Workspace {
    /// Rays traced.
    pub rays: RayCounts,
    /// The place of the pixel that is computed in its tile, row by row, [`TILE`] a row.
    pub place: usize,
    /// What is known of the tile's pixels before they are computed.
    pub lights: Lights,
    /// The same of a tile of the shadow program.
    shadows: deferred_shadows::Tile,
    directions: Directions,
    /// The same where rays are traced one by one.
    loose: Vec<Vec3>,
    nearby: Nearby,
    crossings: Vec<f32>,
}

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    fn position(&self, pixel: Pixel) -> Vec4 {
        Vec4::from_array(self.job.position[pixel.index])
    }

    fn normal(&self, pixel: Pixel) -> Vec3 {
        Vec4::from_array(self.job.normal[pixel.index]).truncate()
    }

    fn triangle(&self, pixel: Pixel) -> Option<u32> {
        Some(self.job.triangle[pixel.index]).filter(|triangle| *triangle != NO_TRIANGLE)
    }

    fn is_glass(&self, triangle: u32) -> bool {
        self.glass.contains(triangle)
    }

    /// Whether a hit stops light: covered, and not glass that shadow rays pass.
    fn stops_light(&self, hit: &Hit) -> bool {
        !self.passes_light(hit) && self.coverage.covers(hit)
    }

    fn passes_light(&self, hit: &Hit) -> bool {
        self.shadow_glass.contains(hit.triangle)
    }
}

/// A colour with alpha 1.
fn opaque(color: Vec3) -> [f32; 4] {
    color.extend(1.0).to_array()
}

#[cfg(test)]
mod agreement;
#[cfg(test)]
mod terminator;
#[cfg(test)]
pub(crate) mod testing;
