//! The data of a pass in addition to the scene: materials, texture sizes, occlusion points, glass, lights, and tables of weights.

use super::layout::{
    BODY_HEAD, BODY_WORDS, HEAD_PHOTONS, LARGEST_RANGE, LIGHT_CONE, LIGHT_HEAD, LIGHT_PLACE, LIGHT_WORDS, Params,
    SAMPLE_HEAD, SHADE_CUT, SHADE_GLASS, SHADE_GLOW, SHADE_NORMAL_MAP, SHADE_SHADOW_GLASS, SHADE_SKY, SHADE_TARGET,
    SHADE_VERTEX_COLORS, SHADE_WORDS, SHAPE_OPAQUE, SHAPE_PANE, SHAPE_SOLID, SHAPE_THIN, TEXTURE_WORDS,
    VERTEX_COLORS_DISPLAY, VERTEX_COLORS_LINEAR, VERTEX_COLORS_NONE, WRAP_CLAMP, WRAP_MIRROR, WRAP_REPEAT,
};
use super::{lenses, photons};
use crate::adaptive::Sampling;
use crate::effects::constants::{MAX_DEPTH, NO_TEXTURE, THROUGH_GLASS, THROUGH_GLASS_ENTRIES};
use crate::effects::dielectric::{Focused, REFERENCE_WAVELENGTH, facets, spectrum};
use crate::effects::{LightTable, Preparation};
use crate::sampling::HemisphereSampler;
use crate::sampling::cone::ConeSampler;
use curitiba_pipeline::backend::{Cone, Light, RayJob, Shade};
use curitiba_pipeline::color::{ColorSpace, DECODED};
use curitiba_pipeline::glass::{CutoffColor, Dielectric, GlassShadow, Reflectance, Roulette, Shape, Stratum};
use curitiba_pipeline::programs::{Fidelity, RayParams};
use curitiba_pipeline::scene::texture::{Texture, Wrap};
use glam::Vec3;

/// The words of group 2, and the parameters with the places at which its parts begin.
#[derive(Debug)]
pub struct Tables {
    pub words: Vec<u32>,
    pub params: Params,
}

impl Tables {
    /// The tables of a job, for the ways of paths that `sampling` tells. `focused` is the light that glass focuses in the job. `has_levels` is whether
    /// the textures are on the device with all of their mip levels.
    ///
    /// # Errors
    /// If the number of samples is not valid, or if there is too little memory; the message says why.
    pub fn of(job: &RayJob<'_>, sampling: Sampling<'_>, focused: &Focused, has_levels: bool) -> Result<Self, String> {
        let Focused { lenses, photons } = focused;
        let Preparation { sampler, open_share, to_light, light_color, disc } = Preparation::of(job)?;
        let (strata, points) = match sampler {
            None => (0, Vec::new()),
            Some(HemisphereSampler::Strata { side }) => (side, Vec::new()),
            Some(HemisphereSampler::Sobol(points)) => (0, points),
        };
        let mut words = shades(job, !photons.is_empty());
        let mut part = |more: Vec<u32>| {
            let place = words.len() as u32;
            words.extend(more);
            place
        };
        let textures_at = part(textures(job, has_levels));
        let points_at = part(points.into_flattened());
        let bits = |number: f32| number.to_bits();
        // Never at 0, where the materials are, so 0 can mean that texels are not decoded.
        let decoded_at = if job.scene.decodes_texels() { part(DECODED.map(f32::to_bits).into()) } else { 0 };
        let open_share_at = part(open_share.into_iter().map(bits).collect());
        let through_glass = (0..THROUGH_GLASS_ENTRIES as i32).map(|count| THROUGH_GLASS.powi(count));
        let through_glass_at = part(through_glass.map(bits).collect());
        let bodies_at = if job.dielectrics.is_empty() {
            0
        } else {
            let strata_at = part(spectrum_words(job, sampling.is_sampled()));
            let facets_at = part(facets(job).into_flattened());
            let straight = matches!(job.params.shadow, GlassShadow::Straight | GlassShadow::Caustic);
            // Never at 0 or 1, where the materials are.
            let lenses_at = part(Vec::new());
            let mut light = straight.into();
            if !focused.is_empty() {
                part(lenses::words(job, lenses, lenses_at));
                light = lenses_at;
            }
            if sampling.is_sampled() {
                let list = sampling.list();
                let list_at = if list.is_empty() { 0 } else { part(list.as_flattened().to_vec()) };
                let head: [u32; SAMPLE_HEAD as usize] = [list_at, job.params.first_path];
                part(head.to_vec());
            }
            part(bodies(job, light, [strata_at, facets_at]))
        };
        // Never at 0, where the materials are: 0 means no table, for programs of `Lighting::Sun`.
        let lights_at = match LightTable::of(job) {
            Some(table) => {
                let disc_at = part(disc.as_ref().map_or(Vec::new(), |disc| disc.points().as_flattened().to_vec()));
                part(lights(job, &table, (disc.as_ref(), disc_at)))
            }
            None => 0,
        };
        // Photons come last: they may be many, and the list does not grow again.
        if !focused.is_empty() {
            let photons_at = photons::append(&mut words, photons).map_err(|refused| refused.to_string())?;
            words[(bodies_at + HEAD_PHOTONS) as usize] = photons_at;
        }
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
            fresnel: job.params.fresnel as u32,
            decoded_at,
            radius: job.params.radius,
            index: job.params.index,
            beyond: job.beyond.to_array(),
            bodies_at,
            cone_width: job.cone.width,
            cone_spread: job.cone.spread,
            lights_at,
            ..Params::default()
        };
        Ok(Self { words, params })
    }
}

/// For each texture: index of its first texel, width, height, wrapping along u and v, and whether its nearest texel is read where it is
/// magnified.
fn textures(job: &RayJob<'_>, has_levels: bool) -> Vec<u32> {
    let mut first = 0;
    let size = |texture: &Texture| -> [u32; TEXTURE_WORDS as usize] {
        let level = &texture.levels[0];
        let place = first;
        let levels = if has_levels { &texture.levels[..] } else { &texture.levels[..1] };
        first += levels.iter().map(|level| level.texels.len() as u32).sum::<u32>();
        let [u, v] = texture.sampling.wrap.map(|wrap| match wrap {
            Wrap::Repeat => WRAP_REPEAT,
            Wrap::Mirror => WRAP_MIRROR,
            Wrap::Clamp => WRAP_CLAMP,
        });
        [place, level.width, level.height, u, v, u32::from(texture.sampling.is_nearest())]
    };
    job.scene.textures.iter().flat_map(size).collect()
}

/// The job's shading data, by material. `has_photons` is whether the job has photons.
fn shades(job: &RayJob<'_>, has_photons: bool) -> Vec<u32> {
    let set = |flags: &[bool], material: usize, flag: u32| {
        if flags.get(material).copied().unwrap_or(false) { flag } else { 0 }
    };
    let stops = |material: usize| has_photons && job.dielectrics.get(material).is_some_and(Dielectric::bends_light);
    let shade = |(material, shade): (usize, &Shade)| -> [u32; SHADE_WORDS as usize] {
        let cutoff = shade.alpha_cutoff.filter(|_| job.fidelity == Fidelity::Corrected);
        let flags = set(job.glass, material, SHADE_GLASS)
            | set(job.shadow_glass, material, SHADE_SHADOW_GLASS)
            | if cutoff.is_some() { SHADE_CUT } else { 0 }
            | if shade.vertex_colors { SHADE_VERTEX_COLORS } else { 0 }
            | if shade.glow.is_some() { SHADE_GLOW } else { 0 }
            | if shade.normal_map.is_some() { SHADE_NORMAL_MAP } else { 0 }
            | if stops(material) { SHADE_TARGET } else { 0 }
            | if job.scene.materials.get(material).is_some_and(|material| material.sky) { SHADE_SKY } else { 0 };
        let glow = shade.glow.map_or([0; 3], |glow| glow.color.to_array().map(f32::to_bits));
        let glow_texture = shade.glow.and_then(|glow| glow.texture).unwrap_or(NO_TEXTURE);
        let [red, green, blue, _] = shade.diffuse.to_array().map(f32::to_bits);
        // An infinite cutoff, which cuts out everything, becomes the largest finite number: programs have no
        // infinities.
        let cutoff = cutoff.unwrap_or(0.0).min(f32::MAX);
        let texture = shade.texture.unwrap_or(NO_TEXTURE);
        let [shines_red, shines_green, shines_blue] = glow;
        let normals = shade.normal_map.map_or([NO_TEXTURE, 0], |map| [map.texture, map.scale.to_bits()]);
        let [normal_texture, normal_scale] = normals;
        [
            red,
            green,
            blue,
            flags,
            texture,
            cutoff.to_bits(),
            shines_red,
            shines_green,
            shines_blue,
            glow_texture,
            normal_texture,
            normal_scale,
        ]
    };
    job.shades.iter().enumerate().flat_map(shade).collect()
}

/// The words before the lights ([`LIGHT_HEAD`]), the lights, and for each material the emission that counts where it is textured
/// (`programs/lights.wgsl`). `disc_at` is the place of the points of the discs.
fn lights(job: &RayJob<'_>, table: &LightTable, (disc, disc_at): (Option<&ConeSampler>, u32)) -> Vec<u32> {
    let (samples, height) = disc.map_or((0, 0.0), |disc| (disc.samples(), disc.height()));
    let head: [u32; LIGHT_HEAD as usize] =
        [table.lights.len() as u32, table.hidden.to_bits(), samples, height.to_bits(), disc_at];
    let emissions = job.shades.iter().flat_map(|shade| shade.emission.truncate().to_array()).map(f32::to_bits);
    head.into_iter().chain(table.lights.iter().flat_map(light)).chain(emissions).collect()
}

fn light(light: &Light) -> [u32; LIGHT_WORDS as usize] {
    let has_place = if light.place.is_some() { LIGHT_PLACE } else { 0 };
    let has_cone = if light.cone.is_some() { LIGHT_CONE } else { 0 };
    let [x, y, z] = light.place.unwrap_or_default().to_array().map(f32::to_bits);
    let [along_x, along_y, along_z] = light.direction.to_array().map(f32::to_bits);
    let [red, green, blue] = light.color.to_array().map(f32::to_bits);
    let [constant, linear, quadratic] = light.attenuation.map(f32::to_bits);
    let Cone { inner, outer, exponent } = light.cone.unwrap_or(Cone { inner: 0.0, outer: 0.0, exponent: 0.0 });
    [
        x,
        y,
        z,
        has_place | has_cone,
        along_x,
        along_y,
        along_z,
        light.range.min(LARGEST_RANGE).to_bits(),
        red,
        green,
        blue,
        exponent.to_bits(),
        constant,
        linear,
        quadratic,
        inner.to_bits(),
        outer.to_bits(),
    ]
}

/// The strata of the spectrum: a wavelength and its weights for each. Where ways are sampled, the reference wavelength follows.
fn spectrum_words(job: &RayJob<'_>, sampled: bool) -> Vec<u32> {
    let words = |stratum: Stratum| [stratum.wavelength, stratum.weight.x, stratum.weight.y, stratum.weight.z];
    let reference = sampled.then_some(Stratum { wavelength: REFERENCE_WAVELENGTH, weight: Vec3::ONE });
    spectrum(job).into_iter().chain(reference).flat_map(words).map(f32::to_bits).collect()
}

/// The settings of the pass for paths in glass (`BODY_HEAD`), then the glass of each material: `Body` of `programs/media.wgsl`. `light` is the
/// first word of the settings. `strata_at` and `facets_at` are the places of the strata of the spectrum and of the points of facets. The place of
/// the photons ([`HEAD_PHOTONS`]) is left at 0.
fn bodies(job: &RayJob<'_>, light: u32, [strata_at, facets_at]: [u32; 2]) -> Vec<u32> {
    let RayParams { limits, first, first_path, .. } = &job.params;
    let head: [u32; BODY_HEAD as usize] = [
        light,
        limits.cutoff.to_bits(),
        limits.reflections,
        limits.refractions,
        (limits.roulette == Roulette::On).into(),
        (limits.cutoff_color == CutoffColor::Background).into(),
        first ^ first_path.rotate_left(16),
        strata_at,
        spectrum(job).len() as u32,
        facets_at,
        facets(job).len() as u32,
        0,
    ];
    head.into_iter().chain(job.dielectrics.iter().flat_map(|dielectric| body(job, dielectric))).collect()
}

fn body(job: &RayJob<'_>, dielectric: &Dielectric) -> [u32; BODY_WORDS as usize] {
    let geometry = &job.scene.geometry;
    let vertex_colors = match geometry.color_space {
        _ if !dielectric.filter_vertex_colors || geometry.colors.is_empty() => VERTEX_COLORS_NONE,
        ColorSpace::Report => VERTEX_COLORS_DISPLAY,
        ColorSpace::Linear => VERTEX_COLORS_LINEAR,
    };
    let shape = match dielectric.shape {
        Shape::Opaque => SHAPE_OPAQUE,
        Shape::Pane => SHAPE_PANE,
        Shape::Thin => SHAPE_THIN,
        Shape::Solid => SHAPE_SOLID,
    };
    let [absorbs_red, absorbs_green, absorbs_blue] = dielectric.extinction.to_array().map(f32::to_bits);
    let [mirrors_red, mirrors_green, mirrors_blue] = dielectric.mirrors().to_array().map(f32::to_bits);
    // An exponent below 0 means that there is no curve; the exponent of a curve is at least 0.
    let none = Reflectance { minimum: 0.0, maximum: 0.0, exponent: -1.0 };
    let Reflectance { minimum, maximum, exponent } = dielectric.reflectance.unwrap_or(none);
    let [passes_red, passes_green, passes_blue] = dielectric.filter.to_array().map(f32::to_bits);
    [
        shape,
        dielectric.index.to_bits(),
        absorbs_red,
        absorbs_green,
        absorbs_blue,
        passes_red,
        passes_green,
        passes_blue,
        dielectric.filter_texture.unwrap_or(NO_TEXTURE),
        dielectric.veil.to_bits(),
        dielectric.thickness.to_bits(),
        dielectric.priority.into(),
        vertex_colors,
        dielectric.spread.to_bits(),
        dielectric.alpha.to_bits(),
        dielectric.roughness_texture.unwrap_or(NO_TEXTURE),
        mirrors_red,
        mirrors_green,
        mirrors_blue,
        minimum.to_bits(),
        maximum.to_bits(),
        exponent.to_bits(),
        dielectric.transmission_texture.unwrap_or(NO_TEXTURE),
    ]
}
