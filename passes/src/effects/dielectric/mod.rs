//! Glass whose kind each material states (`glass=auto`): bodies that light enters and leaves, thin walls, and the report's panes.
//!
//! From the ground up: `media` knows in which bodies a point of a path lies, and `eye` in which the camera is. `slab` is a wall with two
//! faces. `filter` is the light that a surface takes beside Fresnel's share, and `shadow` the light that is left after falling straight
//! through. `ball` is parallel light in a sphere, `lenses` are the spheres that focus it, and `caustic` is the light that this adds to
//! surfaces. `targets` are the meshes that focus light, and `photon_map` is the light that landed. `variant` says what device programs
//! support, and `ways` which ways are followed. `branch` is a way on from a surface, `limits` says where it is not followed, and `facets`
//! are the microfacets of a rough surface. `walk` follows paths, `solid` is the surface of a body, and `photons` follows light to surfaces. May use:
//! the modules about one point, beside this folder.
//!
//! Radiance is not scaled by the square of the index inside a body: the factor cancels where light leaves again, and the light that falls
//! on a surface inside is not scaled either.

pub(crate) mod ball;
mod branch;
mod caustic;
mod eye;
mod facets;
mod filter;
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
pub(crate) use eye::{around_eye, asks_for_lenses, lenses};
pub use facets::Facet as Microfacet;
pub use lenses::{Lens, Lenses};
pub use media::{Border, Crossing, MOST, Media};
pub use photon_map::{Cloud, Photon, PhotonMap};
pub(crate) use photons::{photons, targets};
pub use slab::{Slab, slab};
pub use targets::{Target, Targets};
pub use variant::{Variant, ways_of_path};
pub(crate) use variant::{disperses, is_rough};
pub use walk::MOST_SURFACES;
pub(super) use walk::Walk;
pub(super) use ways::{AllWays, Ways};
pub use ways::{Met, Sample};

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

/// The strata of the spectrum that a job asks for; empty where no body disperses light.
#[must_use]
pub fn spectrum(job: &RayJob<'_>) -> Vec<Stratum> {
    if disperses(&job.params, job.dielectrics) { strata(job.params.wavelengths) } else { Vec::new() }
}

#[cfg(test)]
mod tests;
