//! Candidates for the place of a pass: its program with other settings, a raster effect in its place, or rays in its place.

use crate::pipeline::plan::{Plan, PlannedPass, Work};
use crate::pipeline::programs::{Fidelity, Fresnel, RayParams, RayProgram, Sampler};
use crate::pipeline::project::{ChannelRef, EffectPass, PassKind, Project, RayPass};
use crate::pipeline::raster_effects::{
    Border, EFFECT_PROGRAMS, EffectParams, EffectProgram, EffectProgramInfo, Missing, Parallax,
};

/// Numbers of occlusion rays per point.
const SAMPLES: [u32; 9] = [1, 2, 4, 8, 16, 32, 64, 128, 256];
const SUN_SAMPLES: [u32; 7] = [1, 2, 4, 8, 16, 32, 64];
/// Numbers of occlusion rays per point as square strata.
const SQUARES: [u32; 8] = [1, 4, 9, 16, 36, 64, 144, 256];
/// Numbers of slices (directions), and of steps (depths read in each half of a slice).
const SLICES_AND_STEPS: [(u32, u32); 6] = [(1, 4), (2, 4), (2, 8), (4, 8), (8, 8), (8, 16)];
/// Numbers of slices and steps, with the levels of the filter that follows.
const FILTERED: [(u32, u32, u32); 3] = [(1, 4, 2), (2, 4, 1), (2, 8, 1)];
/// Numbers of rays, with the levels of the filter that follows. With more rays, the error is smaller without a filter.
const FILTERED_RAYS: [(u32, u32); 5] = [(1, 2), (2, 2), (4, 1), (4, 2), (8, 1)];
/// Numbers of slices and steps, and levels of the filter, for occlusion by sectors of a bitmask.
const SECTORS: [(u32, u32, u32); 3] = [(2, 4, 1), (4, 8, 0), (8, 16, 0)];
/// Side of shadow maps, in quarters of the side that fits the picture, and number of filtered texels on each side of the central one.
const SHADOW_MAPS: [(u32, u32); 7] = [(2, 0), (4, 0), (4, 1), (8, 0), (8, 1), (16, 0), (16, 1)];
/// As [`SHADOW_MAPS`], for maps where rays decide the borders of shadows.
const BORDERED: [(u32, u32); 3] = [(2, 0), (4, 0), (4, 1)];
/// Greatest numbers of planes of glass that act as mirrors.
const PLANES: [u32; 4] = [1, 4, 16, 64];
/// Side of a cube map's face, in quarters of the side that fits the picture.
const CUBE_MAPS: [u32; 4] = [1, 2, 4, 8];

/// Inputs of the candidates in addition to the pass.
#[derive(Debug, Clone, Copy)]
struct Frame<'a> {
    project: &'a Project,
    fidelity: Fidelity,
    /// Size of the G-buffer in pixels.
    size: [u32; 2],
}

/// A pass that can take the place of the declared one.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Name for readers: `ssao samples=16`.
    pub label: String,
    /// The pass.
    pub kind: PassKind,
}

/// A pass that has candidates.
#[derive(Debug, Clone)]
pub struct Slot {
    /// Index into the pipeline's passes.
    pub pass: usize,
    /// Its name.
    pub name: String,
    /// The candidates; the first is the declared pass, with the settings of `--set`.
    pub candidates: Vec<Candidate>,
}

/// Names of a variant's candidates, with the names of their passes if there are several passes.
#[must_use]
pub fn label(slots: &[Slot], variant: &[usize]) -> String {
    let of_slot = |(slot, candidate): (&Slot, &usize)| match slots.len() {
        1 => slot.candidates[*candidate].label.clone(),
        _ => format!("{}: {}", slot.name, slot.candidates[*candidate].label),
    };
    slots.iter().zip(variant).map(of_slot).collect::<Vec<_>>().join("; ")
}

/// The passes of a plan that have more than one candidate.
#[must_use]
pub fn slots(plan: &Plan) -> Vec<Slot> {
    let slot = |planned: &PlannedPass| {
        let pass = plan.pass(planned);
        let frame =
            Frame { project: &plan.project, fidelity: plan.settings.fidelity, size: plan.whole_size(pass.target) };
        let candidates = match (&pass.kind, &planned.work) {
            (PassKind::Ray(ray), Work::Rays { params, .. }) => {
                of_rays(frame, &RayPass { params: *params, ..ray.clone() })
            }
            (PassKind::Effect(effect), Work::Effect { params, .. }) => {
                of_effect(frame, &EffectPass { params: *params, ..effect.clone() })
            }
            _ => return None,
        };
        (candidates.len() > 1).then(|| Slot { pass: planned.pass, name: pass.name.clone(), candidates })
    };
    plan.passes.iter().filter_map(slot).collect()
}

fn of_rays(frame: Frame<'_>, declared: &RayPass) -> Vec<Candidate> {
    let mut candidates = vec![Candidate { label: ray_label(declared), kind: PassKind::Ray(declared.clone()) }];
    add_rays(&mut candidates, declared, frame.fidelity);
    add_effects(&mut candidates, declared.program, frame, |program| {
        with_buffers(frame.project, effect_of(declared, program))
    });
    candidates
}

fn of_effect(frame: Frame<'_>, declared: &EffectPass) -> Vec<Candidate> {
    let mut candidates = vec![Candidate { label: effect_label(declared), kind: PassKind::Effect(declared.clone()) }];
    let rays = rays_of(declared);
    add(&mut candidates, Candidate { label: ray_label(&rays), kind: PassKind::Ray(rays.clone()) });
    add_rays(&mut candidates, &rays, frame.fidelity);
    add_effects(&mut candidates, rays.program, frame, |program| {
        with_buffers(frame.project, EffectPass { program, ..declared.clone() })
    });
    candidates
}

/// Adds a candidate, unless there is one with the same label.
fn add(candidates: &mut Vec<Candidate>, candidate: Candidate) {
    if !candidates.iter().any(|known| known.label == candidate.label) {
        candidates.push(candidate);
    }
}

/// Adds a ray pass with other values of the settings that its program reads.
fn add_rays(candidates: &mut Vec<Candidate>, pass: &RayPass, fidelity: Fidelity) {
    let info = pass.program.info();
    let mut put = |params: RayParams| {
        let pass = RayPass { params, ..pass.clone() };
        add(candidates, Candidate { label: ray_label(&pass), kind: PassKind::Ray(pass) });
    };
    if info.samples(&pass.params) > 0 {
        let strata = fidelity == Fidelity::Thesis || pass.params.sampler == Sampler::Strata;
        let counts: &[u32] = if strata { &SQUARES } else { &SAMPLES };
        counts.iter().for_each(|samples| put(RayParams { samples: *samples, filter: 0, ..pass.params }));
        if info.reads("filter") && fidelity == Fidelity::Corrected && !strata {
            FILTERED_RAYS.iter().for_each(|(samples, filter)| {
                put(RayParams { samples: *samples, filter: *filter, ..pass.params });
            });
        }
    }
    if info.sun_samples(&pass.params) > 0 && fidelity == Fidelity::Corrected {
        SUN_SAMPLES
            .iter()
            .for_each(|sun_samples| put(RayParams { sun_samples: *sun_samples, filter: 0, ..pass.params }));
        if info.reads("filter") {
            FILTERED_RAYS.iter().for_each(|(sun_samples, filter)| {
                put(RayParams { sun_samples: *sun_samples, filter: *filter, ..pass.params });
            });
        }
    }
    if info.reads("fresnel") && fidelity == Fidelity::Corrected {
        // `S` and `P` ask for polarised light, which is a different picture: other Fresnel terms do not replace them.
        match pass.params.fresnel {
            Fresnel::S | Fresnel::P => put(pass.params),
            Fresnel::Exact | Fresnel::Schlick => {
                [Fresnel::Exact, Fresnel::Schlick]
                    .into_iter()
                    .for_each(|fresnel| put(RayParams { fresnel, ..pass.params }));
            }
        }
    }
}

/// Adds the raster effects that correspond to a ray program, each with several settings.
fn add_effects(
    candidates: &mut Vec<Candidate>,
    program: RayProgram,
    frame: Frame<'_>,
    pass_of: impl Fn(EffectProgram) -> EffectPass,
) {
    for info in EFFECT_PROGRAMS.iter().filter(|info| info.counterpart == program) {
        let like = pass_of(info.program);
        for params in settings(info, shared(info.program, &like.params, frame.size), frame.fidelity) {
            let pass = EffectPass { params, ..like.clone() };
            add(candidates, Candidate { label: effect_label(&pass), kind: PassKind::Effect(pass) });
        }
    }
}

/// The default settings of an effect for a picture of this size, with those settings of `like` that define what is computed.
fn shared(program: EffectProgram, like: &EffectParams, size: [u32; 2]) -> EffectParams {
    let EffectParams { radius, intensity, index, fresnel, sun, texture_lod, .. } = *like;
    let map_size = EffectParams::fitted_map_size(program, size);
    EffectParams { map_size, radius, intensity, index, fresnel, sun, texture_lod, ..EffectParams::default() }
}

/// Settings of an effect. Those that differ in one parameter only are ordered from coarse to fine.
fn settings(info: &EffectProgramInfo, base: EffectParams, fidelity: Fidelity) -> Vec<EffectParams> {
    let reads = |name: &str| info.params.contains(&name);
    if reads("slices") {
        let plain = SLICES_AND_STEPS.map(|(slices, steps)| EffectParams { slices, steps, ..base });
        let filtered = |(slices, steps, filter)| EffectParams { slices, steps, filter, ..base };
        let by_sectors = SECTORS.into_iter().filter(|_| reads("bitmask")).map(filtered);
        // The G-buffer shows only the surface of solids, so occluders are taken to be as thick as twice the radius.
        let by_sectors = by_sectors.map(|params| EffectParams {
            bitmask: true,
            thickness: (2.0 * base.radius).min(f32::MAX),
            ..params
        });
        plain.into_iter().chain(FILTERED.map(filtered)).chain(by_sectors).collect()
    } else if reads("pcf") {
        let map = |(quarters, pcf)| EffectParams { map_size: base.map_size * quarters / 4, pcf, ..base };
        // In thesis fidelity, and with soft shadows, no pixels are left to rays.
        let bordered = BORDERED.into_iter().filter(|_| fidelity == Fidelity::Corrected && base.sun == 0.0);
        let bordered = bordered.map(|setting| EffectParams { border: Border::Rays, ..map(setting) });
        SHADOW_MAPS.into_iter().map(map).chain(bordered).collect()
    } else if reads("missing") {
        // In thesis fidelity no pixels are left to rays.
        let ways = [Missing::Own, Missing::Cube, Missing::Rays];
        let left = |missing: &Missing| *missing != Missing::Rays || fidelity == Fidelity::Corrected;
        ways.into_iter().filter(left).map(|missing| EffectParams { missing, ..base }).collect()
    } else if reads("planes") {
        PLANES.map(|planes| EffectParams { planes, ..base }).to_vec()
    } else {
        let each = |quarters| {
            let map_size = base.map_size * quarters / 4;
            [Parallax::None, Parallax::Box].map(|parallax| EffectParams { map_size, parallax, ..base })
        };
        CUBE_MAPS.into_iter().flat_map(each).collect()
    }
}

fn effect_of(rays: &RayPass, program: EffectProgram) -> EffectPass {
    let RayParams { radius, intensity, index, fresnel, sun, texture_lod, .. } = rays.params;
    let params = EffectParams { radius, intensity, index, fresnel, sun, texture_lod, ..EffectParams::default() };
    let rays = rays.clone();
    EffectPass {
        scenes: rays.scenes,
        camera: rays.camera,
        lights: rays.lights.clone(),
        program,
        params,
        position: rays.position,
        normal: rays.normal,
        color: rays.color,
        colors: rays.colors,
        glass: rays.glass,
    }
}

/// Adds the colour and normal channels that an effect reads and `effect` lacks, because the corresponding ray program does not read them. The
/// channels are taken from the target of the effect's positions, into which the deferred program writes colour, position and normal in this order.
fn with_buffers(project: &Project, effect: EffectPass) -> EffectPass {
    let Some(ChannelRef { target, channel: 1 }) = effect.position else { return effect };
    let info = effect.program.info();
    let beside = |buffer: &str, channel: usize, handed: Option<ChannelRef>| {
        let is_there = info.buffers.contains(&buffer) && channel < project.targets[target].channels.len();
        handed.or_else(|| is_there.then_some(ChannelRef { target, channel }))
    };
    let (color, normal) = (beside("color_buffer", 0, effect.color), beside("norm_buffer", 2, effect.normal));
    EffectPass { color, normal, ..effect }
}

fn rays_of(effect: &EffectPass) -> RayPass {
    let program = effect.program.info().counterpart;
    let effect = effect.clone();
    let through = program.info().names("any_hit_shadow_glass");
    RayPass {
        scenes: effect.scenes,
        camera: effect.camera,
        lights: effect.lights.clone(),
        program,
        params: effect.params.by_rays(),
        position: effect.position,
        normal: effect.normal,
        color: effect.color,
        colors: effect.colors,
        shadow_glass: if through { effect.glass.clone() } else { Vec::new() },
        glass: effect.glass,
        from_camera: None,
    }
}

/// Name of a candidate by rays: the program, and the settings in which candidates differ.
fn ray_label(pass: &RayPass) -> String {
    let info = pass.program.info();
    let mut label = info.stem.to_owned();
    if info.samples(&pass.params) > 0 {
        label += &format!(" samples={}", pass.params.samples);
    }
    if info.sun_samples(&pass.params) > 0 {
        label += &format!(" sunsamples={}", pass.params.sun_samples);
    }
    if info.reads("fresnel") && pass.params.fresnel != Fresnel::Exact {
        label += &format!(" fresnel={}", pass.params.fresnel.name());
    }
    if info.filter_levels(&pass.params) > 0 {
        label += &format!(" filter={}", pass.params.filter);
    }
    label
}

fn effect_label(pass: &EffectPass) -> String {
    const OPTIONS: [&str; 5] = ["parallax", "bitmask", "thickness", "filter", "border"];
    const SAID: [&str; 7] = ["mapsize", "cascades", "pcf", "slices", "steps", "planes", "missing"];
    let info = pass.program.info();
    let without_maps = pass.program.marches() && pass.params.missing != Missing::Cube;
    let said = SAID.iter().filter(|name| info.params.contains(name) && !(without_maps && **name == "mapsize"));
    let usual = EffectParams::default();
    // `OPTIONS` are named only where they differ from the defaults.
    let options = OPTIONS.iter().filter(|name| info.params.contains(name) && pass.params.get(name) != usual.get(name));
    said.chain(options).fold(info.name.to_owned(), |label, name| label + &format!(" {name}={}", pass.params.get(name)))
}
