//! The ray programs, generic over [`Tracer`](crate::trace::Tracer). Each program has a folder of its own; those whose
//! rays start at the camera share the folder `camera`.
//!
//! A program is a function of a pixel. Each that reads a G-buffer exists twice: `thesis` follows the report's device code to the letter,
//! `corrected` mends the differences that are numbered below and in `docs/fidelity.md`.
//!
//! | # | `thesis` | `corrected` |
//! |---|---|---|
//! | 1 | the refraction discriminant serves as transmittance, below 0 at grazing angles | exact unpolarised Fresnel |
//! | 2 | glass seen in or through glass loses its refracted colour | both colours are blended |
//! | 3 | `final`: a miss resets what glass took from the light | 0.9 for each glass surface crossed |
//! | 4 | noise from the sine of the position | a counter-based hash |
//! | 5 | rays start at the stored position, hits nearer than 1e-4 (1e-3) are skipped | rays start off the exact triangle, by its rounding error |
//! | 6 | `final`: occlusion darkens glass pixels | glass pixels have no occlusion of their own |
//! | 7 | background pixels trace rays | they are left alone |
//! | 8 | a surface's side follows its winding (`final`: the wrong one) or the shading normal | the geometric normal decides, whatever the winding |
//! | 9 | a pixel is glass if its colour is the mask (x > 0, 0, z > 0, 0); its normal is used as stored | if its triangle's material is; its normal is turned to the viewer |
//! | 10 | textures' alpha is ignored | rays pass where a material is cut out |
//! | 11 | the occlusion hemisphere lies where the normal points | on the viewer's side; directions below the triangle are mirrored at its plane |
//! | 12 | shadows and `ssao` write their value into the alpha too | alpha is 1 |
//!
//! Where the printed code leaves a choice, this is what `thesis` does:
//! - `reflection` declares `MAX_DEPTH` and reads `MAXDEPTH`; both are the parameter `depth`.
//! - `reflection` does not dim secondary bounces; `refraction` and `final` do, by 0.99, but not at total reflection.
//!   `corrected` does not dim them in `reflection` either; in the other two it dims every secondary bounce.
//! - `refraction` and `final` trace a refracted ray at secondary glass and drop its colour. Such rays are not traced here:
//!   the picture is the same, the ray count lower than the report's. Whether refraction is possible still decides the 0.99.
//! - `final` never sets the payload's value before its first shadow ray. Every ray ends in an opaque hit (0.5) or a miss
//!   (1), which set it, so nothing undefined is seen.
//! - Noise below 0 puts occlusion samples of the first stratum outside the square; their directions are NaN. Such a ray hits
//!   nothing and counts as open. So does each ray of a background pixel, whose normal is 0.
//! - `ssao` divides by 0 for 0 samples; here they switch it off, as in `final`.

//!
//! Modules, lower layers first: `interpolate`, `ray_cone`, `coverage`, `pass`, `tile`. Then the modules about one point: `spheres`, `light`,
//! `material`, `surface`, `optics`, `terminator`, `sun`, `lights` and `thesis`. Then those about a tile, `visible_pixels` and `tile_surfaces`;
//! `workspace`; `occlusion`, `preparation` and `tile_occlusion`; and `dielectric`, glass whose kind each material states. Above them are the
//! programs, one folder each, and `camera`. All may use the crate's modules `trace` and `sampling`.

pub mod camera;
pub mod combined;
mod coverage;
pub mod deferred_shadows;
pub mod dielectric;
pub mod dummy;
mod interpolate;
mod light;
mod lights;
mod material;
mod occlusion;
mod optics;
mod pass;
mod preparation;
mod ray_cone;
pub mod reflection;
pub mod refraction;
mod spheres;
pub mod ssao;
mod sun;
mod surface;
mod terminator;
mod thesis;
mod tile;
mod tile_occlusion;
mod tile_surfaces;
mod visible_pixels;
mod workspace;

pub use coverage::{AlphaTested, ByCones, Coverage, Opaque};
pub use light::SHADOWED;
pub use lights::{LightTable, Lighting, disc_rays};
pub use occlusion::open_shares;
pub use optics::{Interface, fresnel, interface, interface_of, polarised, reflect, schlick};
pub(crate) use pass::opaque;
pub use pass::{Pass, Pixel};
pub use preparation::Preparation;
pub use ray_cone::{Cone, Footprint, LevelZero, RayCone, TextureArea, curvature};
pub use terminator::{horizon, is_turned, way_onto_round};
pub use tile::{Area, TILE};
pub use tile_surfaces::TileSurfaces;
pub use workspace::Workspace;

/// Constants that other implementations of the programs (in device languages) must share with these, beside the
/// formulas.
pub mod constants {
    pub use super::dielectric::{CELLS, LENS_WIDTH, MOST_SURFACES, POINTS, POINTS_AT_AXIS};
    pub use super::dielectric::{MET_CHANCE, MET_DIVIDED};
    pub use super::dielectric::{PHOTON_ALIKE, PHOTON_FLAT, PHOTON_GRAZING};
    pub use super::light::{SHADOWED, THROUGH_GLASS};
    pub use super::lights::BEFORE_LIGHT;
    pub use super::material::{AMBIENT, LEAST_SQUARE};
    pub use super::optics::{REFLECTED, REFRACTED, SCATTERED};
    pub use super::terminator::ROUND;
    pub use super::thesis::{BOUNCE, EPSILON, REFRACTED_EPSILON};
    pub use crate::sampling::hash::{
        DIMENSIONS, DISC, FACET_ORDER, FACETS, LIGHTS, PATH, PIXEL, ROULETTE, SCRAMBLE, SPECTRUM,
    };

    pub use curitiba_pipeline::backend::LEAST_DIVISOR;

    /// In tables of device programs: the texture index of a material without a texture.
    pub const NO_TEXTURE: u32 = u32::MAX;
    /// Greatest number of glass bodies that a point of a path is known to lie in at once.
    pub const MOST_BODIES: u32 = super::dielectric::MOST as u32;
    /// Greatest value of the parameter `depth`: the deepest glass bounce that a device program has room for.
    pub const MAX_DEPTH: u32 = 16;
    /// Greatest number of glass surfaces that a device program tells apart along one shadow ray.
    pub const MAX_CROSSINGS: u32 = 32;
    /// Length of the device programs' table of the light that is left after a number of glass surfaces crossed.
    pub const THROUGH_GLASS_ENTRIES: u32 = 64;
}

#[cfg(test)]
pub(crate) mod tests;
