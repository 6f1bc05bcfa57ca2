//! What a pass knows beside the scene: materials, sizes of textures, occlusion points, and tables of weights.

use super::layout::{Params, SHADE_CUT, SHADE_GLASS, SHADE_SHADOW_GLASS, SHADE_VERTEX_COLORS, SHADE_WORDS};
use crate::effects::Preparation;
use crate::effects::constants::{MAX_DEPTH, NO_TEXTURE, THROUGH_GLASS, THROUGH_GLASS_ENTRIES};
use crate::sampling::HemisphereSampler;
use curitiba_pipeline::backend::{RayJob, Shade};
use curitiba_pipeline::color::DECODED;
use curitiba_pipeline::programs::{Fidelity, Fresnel};

/// The words of group 2, and where its parts begin.
#[derive(Debug)]
pub struct Tables {
    pub words: Vec<u32>,
    pub params: Params,
}

impl Tables {
    /// Those of a job.
    ///
    /// # Errors
    /// What is wrong with the number of samples.
    pub fn of(job: &RayJob<'_>) -> Result<Self, String> {
        let Preparation { sampler, open_share, to_light, light_color } = Preparation::of(job)?;
        let (strata, points) = match sampler {
            None => (0, Vec::new()),
            Some(HemisphereSampler::Strata { side }) => (side, Vec::new()),
            Some(HemisphereSampler::Sobol(points)) => (0, points),
        };
        let mut words = shades(job);
        let mut part = |more: Vec<u32>| {
            let place = words.len() as u32;
            words.extend(more);
            place
        };
        let textures_at = part(textures(job));
        let points_at = part(points.into_flattened());
        let bits = |number: f32| number.to_bits();
        // Never at the front, where the materials are.
        let decoded_at = if job.scene.decodes_texels() { part(DECODED.map(f32::to_bits).into()) } else { 0 };
        let open_share_at = part(open_share.into_iter().map(bits).collect());
        let through_glass = (0..THROUGH_GLASS_ENTRIES as i32).map(|count| THROUGH_GLASS.powi(count));
        let through_glass_at = part(through_glass.map(bits).collect());
        let cut = job.fidelity == Fidelity::Corrected && job.shades.iter().any(|shade| shade.alpha_cutoff.is_some());
        let params = Params {
            eye: job.eye.to_array(),
            to_light: to_light.to_array(),
            seed: job.seed,
            light_color: light_color.to_array(),
            samples: job.program.info().samples(&job.params),
            strata,
            depth: job.params.depth.min(MAX_DEPTH),
            width: job.width,
            height: job.height,
            origin: job.origin,
            textures_at,
            points_at,
            open_share_at,
            through_glass_at,
            cut: u32::from(cut),
            schlick: u32::from(job.params.fresnel == Fresnel::Schlick),
            decoded_at,
            radius: job.params.radius,
            index: job.params.index,
            ..Params::default()
        };
        Ok(Self { words, params })
    }
}

/// The first texel, width and height of each texture.
fn textures(job: &RayJob<'_>) -> Vec<u32> {
    let mut first = 0;
    let size = |texture: &curitiba_pipeline::scene::texture::Texture| {
        let level = &texture.levels[0];
        let place = first;
        first += level.texels.len() as u32;
        [place, level.width, level.height]
    };
    job.scene.textures.iter().flat_map(size).collect()
}

/// What the job knows of the materials.
fn shades(job: &RayJob<'_>) -> Vec<u32> {
    let set = |flags: &[bool], material: usize, flag: u32| {
        if flags.get(material).copied().unwrap_or(false) { flag } else { 0 }
    };
    let shade = |(material, shade): (usize, &Shade)| -> [u32; SHADE_WORDS as usize] {
        let cutoff = shade.alpha_cutoff.filter(|_| job.fidelity == Fidelity::Corrected);
        let flags = set(job.glass, material, SHADE_GLASS)
            | set(job.shadow_glass, material, SHADE_SHADOW_GLASS)
            | if cutoff.is_some() { SHADE_CUT } else { 0 }
            | if shade.vertex_colors { SHADE_VERTEX_COLORS } else { 0 };
        let [red, green, blue, _] = shade.diffuse.to_array().map(f32::to_bits);
        // An infinite cutoff, which leaves nothing, is above every alpha; programs know no infinities.
        let cutoff = cutoff.unwrap_or(0.0).min(f32::MAX);
        [red, green, blue, flags, shade.texture.unwrap_or(NO_TEXTURE), cutoff.to_bits()]
    };
    job.shades.iter().enumerate().flat_map(shade).collect()
}
