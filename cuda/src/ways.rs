//! Parameters and tables for paths that split in glass or are cut off there, in the device's layout.

use crate::layout::{Face, NO_TEXTURE, WAYS_BACKGROUND, WAYS_CUT, WAYS_ROULETTE, WAYS_SAMPLED, Ways};
use curitiba_passes::adaptive::Sampling;
use curitiba_passes::effects::dielectric::{REFERENCE_WAVELENGTH, facets, spectrum};
use curitiba_pipeline::backend::RayJob;
use curitiba_pipeline::glass::{CutoffColor, Dielectric, Reflectance, Roulette, Stratum};
use curitiba_pipeline::programs::RayParams;
use glam::Vec3;

/// The tables of a pass whose programs split paths into ways (branches): the programs of `Variant::Ways`.
#[derive(Debug, Clone, PartialEq)]
pub struct WayTables {
    /// Glass data of each material.
    pub faces: Vec<Face>,
    /// The strata of the spectrum, four numbers each: weights of red, green and blue, and wavelength. Behind the last is the wavelength at which
    /// materials state their index; empty without dispersion.
    pub strata: Vec<f32>,
    /// The points of the unit square from which microfacets are sampled, two numbers each.
    pub facets: Vec<u32>,
    /// The parameters, without the addresses of these tables.
    pub ways: Ways,
}

impl WayTables {
    /// The tables of a job whose paths follow these ways.
    #[must_use]
    pub fn of(job: &RayJob<'_>, sampling: Sampling<'_>) -> Self {
        let RayParams { limits, first, first_path, .. } = &job.params;
        let (strata, facets) = (spectrum(job), facets(job));
        let asked = |flag: u32, is_asked: bool| if is_asked { flag } else { 0 };
        let ways = Ways {
            stratum_count: strata.len() as u32,
            facet_count: facets.len() as u32,
            asks: asked(WAYS_CUT, limits.cut())
                | asked(WAYS_ROULETTE, limits.roulette == Roulette::On)
                | asked(WAYS_BACKGROUND, limits.cutoff_color == CutoffColor::Background)
                | asked(WAYS_SAMPLED, sampling.is_sampled()),
            cutoff: limits.cutoff,
            reflections: limits.reflections,
            refractions: limits.refractions,
            chances: first ^ first_path.rotate_left(16),
            offset: *first_path,
            ..Ways::default()
        };
        let numbers = |Stratum { wavelength, weight }: &Stratum| [weight.x, weight.y, weight.z, *wavelength];
        let reference = Stratum { wavelength: REFERENCE_WAVELENGTH, weight: Vec3::ONE };
        let reference = (!strata.is_empty()).then_some(&reference);
        Self {
            faces: job.dielectrics.iter().map(face).collect(),
            strata: strata.iter().chain(reference).flat_map(numbers).collect(),
            facets: facets.into_flattened(),
            ways,
        }
    }
}

fn face(dielectric: &Dielectric) -> Face {
    // A negative exponent means that the material has no curve of reflectance, and Fresnel's share is used.
    let none = Reflectance { minimum: 0.0, maximum: 0.0, exponent: -1.0 };
    let Reflectance { minimum, maximum, exponent } = dielectric.reflectance.unwrap_or(none);
    Face {
        spread: dielectric.spread,
        alpha: dielectric.alpha,
        roughness_texture: dielectric.roughness_texture.unwrap_or(NO_TEXTURE),
        mirrors: dielectric.mirrors().to_array(),
        minimum,
        maximum,
        exponent,
    }
}
