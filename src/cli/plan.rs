//! `curitiba plan`: prints what would be done, and why.

use super::{
    Failure, ask_engines, failure, print_outside, print_warnings, say_prose, set_threads, tell_fastest, width,
};
use anstyle::{AnsiColor, Style};
use curitiba::args::ProjectArgs;
use curitiba::pipeline::diagnostic::Decision;
use curitiba::pipeline::files::record_files_read;
use curitiba::pipeline::glass::{GlassShadow, caustics, decide};
use curitiba::pipeline::memory::mebibytes;
use curitiba::pipeline::plan::{Plan, PlannedPass, Traced, Work};
use curitiba::pipeline::programs::{Fidelity, RayProgram};
use curitiba::pipeline::project::PassKind;
use curitiba::pipeline::scene::{
    self, BuildOptions, LoadOptions, Material, Needs, RenderScene, Scene, TextureSource, statistics,
};
use curitiba::{BackendChoice, OpenError};
use glam::Vec3;
use std::path::PathBuf;
use std::sync::Arc;

const BUILT: Style = AnsiColor::Green.on_default();
const LEFT_OUT: Style = AnsiColor::Yellow.on_default();

/// Prints the plan of a project; its scenes are read for their materials.
pub fn run(args: &ProjectArgs) -> Result<(), Failure> {
    set_threads(args.threads)?;
    tell_fastest(args.choice());
    record_files_read();
    let settings = args.settings();
    let project = settings.open(&args.path).map_err(OpenError::from)?;
    failure::print_problems(&project.problems);
    let mut plan = Plan::new(project, settings).map_err(|error| Failure::from(OpenError::from(error)))?;
    ask_engines(&mut plan, args.choice())?;
    print_warnings(&plan.warnings);
    let [width, height] = plan.window;
    let (path, pipeline) = (plan.project.path.display(), &plan.project.pipelines[plan.pipeline].name);
    let targets = mebibytes(plan.target_bytes());
    say_prose(&format!("{path}: pipeline `{pipeline}`, window {width} x {height}, targets {targets}"), 2);
    crate::say!("\npasses");
    for planned in &plan.passes {
        say_prose(&format!("  {}", describe(&plan, planned)), 4);
    }
    crate::say!("\ndecisions");
    let scenes = plan.scene_sets.iter().map(|set| load(&plan, set)).collect::<Result<Vec<_>, _>>();
    for decision in &plan.decisions {
        print_decision(decision);
    }
    let scenes = scenes?;
    let has_filter = !matches!(args.choice().backend, BackendChoice::Cuda | BackendChoice::Optix);
    let filters = if has_filter { filters(&plan, &scenes) } else { Vec::new() };
    for decision in glass(&plan, &scenes)?.iter().chain(&structures(&plan, &scenes)).chain(&filters) {
        print_decision(decision);
    }
    let textures = scenes.iter().flat_map(|scene| &scene.textures).flat_map(texture_files);
    print_outside(&args.path, textures.cloned());
    Ok(())
}

/// Loads the files of a set of scenes as far as a plan needs them: materials, and the names of their textures.
fn load(plan: &Plan, set: &[usize]) -> Result<Scene, Failure> {
    let files = set.iter().flat_map(|index| &plan.project.scenes[*index].files).map(|file| file.path.clone());
    let needs = Needs { normals: false, ..plan.needs };
    let options = LoadOptions { needs, max_bytes: plan.settings.max_memory };
    let loaded = scene::load(&files.collect::<Vec<_>>(), &options, &|_| {})?;
    print_warnings(&loaded.warnings);
    Ok(loaded)
}

fn texture_files(source: &TextureSource) -> Vec<&PathBuf> {
    match source.texels().0 {
        TextureSource::File(path) => vec![path],
        TextureSource::Masked { color, mask } => vec![color, mask],
        TextureSource::Embedded { .. }
        | TextureSource::Sampled { .. }
        | TextureSource::Data { .. }
        | TextureSource::Clear { .. } => Vec::new(),
    }
}

fn describe(plan: &Plan, planned: &PlannedPass) -> String {
    let pass = plan.pass(planned);
    let target = match pass.target {
        Some(target) => format!("`{}::{}`", plan.project.targets[target].library, plan.project.targets[target].name),
        None => "the window".to_owned(),
    };
    let [width, height] = plan.target_size(pass.target);
    let what = match (&planned.work, &pass.kind) {
        (Work::Raster { .. }, _) => "draws triangles".to_owned(),
        (Work::Rays { params, .. }, PassKind::Ray(ray)) => {
            let info = ray.program.info();
            let values: Vec<String> = info.params.iter().map(|name| format!("{name}={}", params.get(name))).collect();
            format!("runs `{}` {}", info.stem, values.join(" "))
        }
        (Work::Effect { params, .. }, PassKind::Effect(effect)) => {
            let info = effect.program.info();
            let values: Vec<String> = info.params.iter().map(|name| format!("{name}={}", params.get(name))).collect();
            format!("computes `{}` by raster {}", info.name, values.join(" "))
        }
        (Work::Intersection { .. }, PassKind::Intersection(intersection)) => {
            let buffer = &plan.project.targets[intersection.rays];
            let (most, rays) = (intersection.count.most(), format!("{}::{}", buffer.library, buffer.name));
            format!("traces up to {most} rays of `{rays}`, which every surface stops, and writes the nearest hits")
        }
        (Work::Compute, PassKind::Compute(compute)) => {
            let [x, y, z] = compute.groups;
            let stored = compute.shader.buffers_stored().map(|channel| {
                let target = &plan.project.targets[channel.target];
                format!("`{}::{}`", target.library, target.channels[channel.channel].name)
            });
            let stored = stored.collect::<Vec<_>>().join(", ");
            return format!(
                "{}: runs a compute shader in {x} x {y} x {z} work groups, which stores to {stored}",
                pass.name
            );
        }
        (Work::Off { .. }, _) => "is switched off, and fills its target".to_owned(),
        _ => "fills a rectangle".to_owned(),
    };
    format!("{}: {} into {target}, {width} x {height}", pass.name, what.trim_end())
}

/// Decisions about the glass of each set of scenes, if a pass asks for it.
fn glass(plan: &Plan, scenes: &[Scene]) -> Result<Vec<Decision>, Failure> {
    let mut decisions = Vec::new();
    for (set, scene) in scenes.iter().enumerate() {
        let asks = |planned: &PlannedPass| {
            matches!(planned.work, Work::Rays { scene_set, .. } if scene_set == set) && plan.asks_materials(planned)
        };
        if !plan.passes.iter().any(asks) {
            continue;
        }
        let needs = Needs::NOTHING;
        let options = BuildOptions { needs, max_bytes: plan.settings.max_memory, ..BuildOptions::default() };
        let (built, _) = RenderScene::build(scene.clone(), &options)?;
        let mut built = Arc::new(built);
        let decided = decide(&mut built, &plan.project.path);
        print_warnings(&decided.warnings);
        decisions.extend(decided.decisions);
        for planned in plan.passes.iter().filter(|planned| asks(planned)) {
            if matches!(&planned.work, Work::Rays { params, .. } if params.shadow == GlassShadow::Caustic) {
                let name = &plan.pass(planned).name;
                decisions.extend(caustics(name, &built, &decided.dielectrics, plan.photons(planned)));
            }
        }
        let blended = |material: &&Material| {
            material.transmission_texture.is_some_and(|texture| scene.textures[texture as usize].is_clear())
        };
        decisions.extend(scene.materials.iter().filter(blended).map(|material| Decision {
            what: format!("material `{}` blended texel by texel", material.name),
            built: true,
            why: "the alpha of its texture is half clear over areas, not only at edges".into(),
        }));
    }
    Ok(decisions)
}

/// Decisions whether each tracing pass needs an acceleration structure, which depends on the scene's materials.
fn structures(plan: &Plan, scenes: &[Scene]) -> Vec<Decision> {
    let mut decisions = Vec::new();
    for planned in &plan.passes {
        let Some(Traced { scene_set, .. }) = plan.traced(planned) else { continue };
        let (built, why) = plan.needs_structure(planned, &scenes[scene_set].materials);
        let what = format!("acceleration structure for pass `{}`", plan.pass(planned).name);
        decisions.push(Decision { what, built, why });
    }
    decisions
}

/// Recommends a filter for passes of occlusion if it at least halves their noise, by [`recommended_filter`].
fn filters(plan: &Plan, scenes: &[Scene]) -> Vec<Decision> {
    if plan.settings.fidelity != Fidelity::Corrected || plan.in_parts() {
        return Vec::new();
    }
    let of = |planned: &PlannedPass| {
        let (Work::Rays { scene_set, params, .. }, PassKind::Ray(ray)) = (&planned.work, &plan.pass(planned).kind)
        else {
            return None;
        };
        let [low, high] = statistics(&scenes[*scene_set]).bounds?.map(|corner| Vec3::from(corner).as_dvec3());
        let share = f64::from(params.radius) / (high - low).length();
        let elsewhere = ["cuda", "optix"].map(|name| format!("{}.backend={name}", plan.pass(planned).name));
        let has_none = plan.settings.set.iter().any(|set| elsewhere.contains(set));
        let is_open = ray.program == RayProgram::Ssao && params.filter == 0 && !has_none;
        let levels = recommended_filter(params.samples, share).filter(|_| is_open)?;
        let why = format!(
            "recommended, and not asked for: of {} samples and a radius of {:.0} % of the scene's diagonal filter={levels} leaves half the noise or less for a few \
             per cent of time; it softens shadows of contact",
            params.samples,
            share * 100.0
        );
        Some(Decision { what: format!("filter of pass `{}`", plan.pass(planned).name), built: false, why })
    };
    plan.passes.iter().filter_map(of).collect()
}

/// The recommended levels of the filter for this number of occlusion rays, and for a radius that is this share of the scene's diagonal. `None` if
/// no filter is recommended.
///
/// By the tables of `docs/projects.md`: at short radii, more rays cost less than a filter. With more than 16 rays, the noise is less than the error
/// of the filter's blur.
fn recommended_filter(samples: u32, share: f64) -> Option<u32> {
    const LONG: f64 = 0.03;
    match samples {
        1..=4 if share > LONG => Some(2),
        5..=16 if share > LONG => Some(1),
        _ => None,
    }
}

fn print_decision(decision: &Decision) {
    let (style, mark) = if decision.built { (BUILT, "yes") } else { (LEFT_OUT, "no ") };
    let text = format!("  {mark} {}: {}", decision.what, decision.why);
    let lines = width::folded_by(&text, INDENT, width::of_terminal());
    for (index, line) in lines.iter().enumerate() {
        match line.strip_prefix("  ").and_then(|line| line.strip_prefix(mark)).filter(|_| index == 0) {
            Some(rest) => crate::say!("  {style}{mark}{style:#}{rest}"),
            None => crate::say!("{line}"),
        }
    }
}

/// Number of spaces before the continuation lines of a decision.
const INDENT: usize = 6;

#[cfg(test)]
mod tests {
    use super::recommended_filter;

    #[test]
    fn a_filter_is_recommended_to_few_rays_of_a_long_radius_alone() {
        let of = |samples| recommended_filter(samples, 0.05);
        assert_eq!([0, 1, 4, 5, 16, 17].map(of), [None, Some(2), Some(2), Some(1), Some(1), None]);
        assert_eq!([0.03, f64::NAN, 0.0].map(|share| recommended_filter(4, share)), [None; 3]);
    }
}
