//! Exact spheres, of glass and of other materials, in every program.

use super::conformance::compared;
use super::lamps::add_lamps;
use super::loaded;
use curitiba::BackendChoice;
use curitiba::conformance::Record;
use curitiba::pipeline::backend::RayCounts;
use curitiba::pipeline::glass::{GlassRule, GlassShadow};
use curitiba::pipeline::programs::RayProgram;
use curitiba::pipeline::project::{MaterialPattern, PassKind, Project};
use curitiba::pipeline::scene::LoadOptions;
use std::sync::Arc;

/// The spheres of `glass/Spheres` with another program. The spheres of two materials are panes or mirrors, and the others are not glass.
fn opaque(program: RayProgram) -> Project {
    let mut project = loaded("glass/Spheres");
    for pass in project.pipelines.iter_mut().flat_map(|pipeline| &mut pipeline.passes) {
        if let PassKind::Ray(ray) = &mut pass.kind {
            let glass = ["diamond", "water"].map(|name| MaterialPattern::Named(name.to_owned())).to_vec();
            (ray.program, ray.glass, ray.shadow_glass) = (program, glass.clone(), glass);
            (ray.params.glass, ray.params.shadow) = (GlassRule::Pane, GlassShadow::Report);
        }
    }
    project
}

const PROGRAMS: [RayProgram; 5] =
    [RayProgram::DeferredShadows, RayProgram::Reflection, RayProgram::Refraction, RayProgram::Ssao, RayProgram::Final];

/// The spheres of a project, without its meshes.
fn alone(mut project: Project) -> Project {
    let decl = &mut project.scenes[0];
    let mut scene = decl.load(&LoadOptions::default(), &|_| {}).expect("the scene loads");
    scene.objects.clear();
    scene.meshes.clear();
    scene.files.clear();
    decl.files.clear();
    decl.shapes.clear();
    decl.memory = Some(Arc::new(scene));
    project
}

type Run = (Project, &'static str, &'static [&'static str]);

/// The programs with spheres that are panes, mirrors and opaque, of all spheres and meshes or of what `part` leaves.
fn programs(part: impl Fn(Project) -> Project) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for program in PROGRAMS {
        let occlusion = matches!(program, RayProgram::Ssao | RayProgram::Final);
        // With few rays for each point, all of them are traced; with more rays, nearby geometry decides some of them without tracing.
        let sets: &[&[&str]] = match occlusion {
            true => &[&["pass2.samples=4"], &["pass2.samples=16"], &["pass2.samples=144"]],
            false => &[&[]],
        };
        runs.extend(sets.iter().map(|set| (part(opaque(program)), program.info().stem, *set)));
    }
    runs
}

/// Asserts that there are as many rays as on the processor, and that pictures of shadows and occlusion have its bits.
fn is_exact(record: &Record) {
    let (words, cpu) = (record.in_words(), record.cpu_rays.expect("the processor ran"));
    let glass = |rays: RayCounts| [rays.reflected, rays.refracted, rays.lost];
    assert_eq!(glass(record.rays), glass(cpu), "{words}");
    // With `glass="auto"`, `final` on the processor also traces occlusion rays at surfaces that add nothing to the pixel.
    if !record.project.starts_with("glass/") {
        let occlusion = |rays: RayCounts| rays.occlusion + rays.certain;
        assert_eq!(occlusion(record.rays), occlusion(cpu), "{words}");
    }
    let compared = record.comparison.as_ref().expect("compared");
    let exact = matches!(record.program, "ssao" | "deferredShadows");
    assert!(!exact || compared.identical == compared.pixels, "not every bit: {words}");
}

fn among_meshes(backend: BackendChoice) -> Option<Vec<Record>> {
    let mut runs: Vec<Run> = Vec::new();
    for name in ["glass/Spheres", "glass/Shells"] {
        // Variants with one kernel and with several, and with texture lookups at level 0 and by ray cones.
        let sets: [&[&str]; 4] = [
            &["pass2.samples=0"],
            &["pass2.samples=16"],
            &["pass2.samples=2", "pass2.texturelod=cones", "pass2.fresnel=schlick"],
            &["pass2.samples=9", "pass2.sun=4", "pass2.sunsamples=4"],
        ];
        runs.extend(sets.map(|set| (loaded(name), name, set)));
        let mut in_lights = loaded(name);
        add_lamps(&mut in_lights, "MainCamera");
        runs.push((in_lights, name, &["pass2.samples=4"]));
    }
    runs.extend(programs(|project| project));
    compared(backend, runs)
}

#[test]
fn exact_spheres_on_our_own_tracer_are_the_processors() {
    among_meshes(BackendChoice::Cuda).iter().flatten().for_each(is_exact);
}

#[test]
fn exact_spheres_on_optix_are_the_processors() {
    for record in among_meshes(BackendChoice::Optix).iter().flatten() {
        let glass = record.project.starts_with("glass/");
        assert!(!glass || record.rays.refracted > 1000, "no glass is seen: {}", record.in_words());
    }
}

/// Without triangles, whose test is OptiX's own, both tracers are exact.
fn without_meshes(backend: BackendChoice) {
    compared(backend, programs(alone)).iter().flatten().for_each(|record| {
        assert_eq!(record.triangles, 0);
        is_exact(record);
    });
}

#[test]
fn spheres_alone_on_our_own_tracer_are_the_processors() {
    without_meshes(BackendChoice::Cuda);
}

#[test]
fn spheres_alone_on_optix_are_the_processors() {
    without_meshes(BackendChoice::Optix);
}
