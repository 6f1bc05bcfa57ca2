//! Glass whose kind each material states (`glass=auto`): bodies that light enters and leaves, thin walls, and the report's panes.
//!
//! Modules, lower layers first. `media` lists the bodies that a point of a path lies in, and `eye` the bodies that the camera lies in. `slab` is a
//! wall with two faces. `filter` has the properties of a surface that Fresnel's equations do not give, and `shadow` the light that glass lets
//! straight through. `ball` is the refraction of parallel light by a sphere, `lenses` are the spheres that focus light, and `caustic` adds the
//! focused light to surfaces. `targets` are the meshes that focus light, `photon_map` stores the photons that landed, and `focused` holds lenses and
//! photons. `variant` states which glass device programs support, and `ways` which ways of a divided path are followed. `branch` is a continuation
//! of a path at a surface, `limits` cuts branches off, and `facets` are the microfacets of a rough surface. `walk` follows paths from the camera,
//! `solid` is the surface of a body, and `photons` follows light to surfaces. These modules may use those modules of the parent folder that concern
//! one point.
//!
//! Radiance is not scaled by the square of the index inside a body: the factor cancels where light leaves again, and the light that falls
//! on a surface inside is not scaled either.

pub(crate) mod ball;
mod branch;
mod caustic;
mod eye;
mod facets;
mod filter;
mod focused;
mod lenses;
mod limits;
mod media;
mod photon_map;
mod photons;
mod shadow;
mod slab;
mod solid;
mod targets;
mod variant;
mod walk;
mod ways;

pub use ball::{Ball, Bundle, CELLS, POINTS, POINTS_AT_AXIS, Turned};
pub(super) use caustic::Lit;
pub use caustic::{WIDTH as LENS_WIDTH, axis as light_axis, blur as light_blur};
pub(crate) use eye::{around_eye, asks_for_focus, lenses};
pub use facets::Facet as Microfacet;
pub use focused::Focused;
pub use lenses::{Lens, Lenses};
pub use media::{Border, Crossing, MOST, Media};
pub use photon_map::{ALIKE as PHOTON_ALIKE, Cloud, FLAT as PHOTON_FLAT, Photon, PhotonMap};
pub use photons::{GRAZING as PHOTON_GRAZING, shoots_photons};
pub(crate) use photons::{photons, targets};
pub use slab::{Slab, slab};
pub use solid::REFERENCE as REFERENCE_WAVELENGTH;
pub use targets::{Target, Targets};
pub use variant::{Variant, ways_of_path};
pub(crate) use variant::{disperses, is_rough};
pub use walk::MOST_SURFACES;
pub(super) use walk::Walk;
pub(super) use ways::{AllWays, Ways};
pub use ways::{MET_CHANCE, MET_DIVIDED, Met, Sample};

use crate::sampling::owen_sobol::reversed_sobol;
use curitiba_pipeline::backend::RayJob;
use curitiba_pipeline::glass::{Stratum, strata};

/// For each path through rough glass, its Sobol point in the unit square, bits reversed; empty where no glass is rough.
#[must_use]
pub fn facets(job: &RayJob<'_>) -> Vec<[u32; 2]> {
    if !is_rough(job.dielectrics) {
        return Vec::new();
    }
    (0..job.params.paths).map(|path| reversed_sobol(job.params.first_path.wrapping_add(path))).collect()
}

/// The strata of the spectrum that a job requests; empty where no body disperses light.
#[must_use]
pub fn spectrum(job: &RayJob<'_>) -> Vec<Stratum> {
    if disperses(&job.params, job.dielectrics) { strata(job.params.wavelengths) } else { Vec::new() }
}

#[cfg(test)]
mod tests;
