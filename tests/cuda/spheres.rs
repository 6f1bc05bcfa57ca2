//! Exact spheres, of glass and of other materials, in every program.

use super::conformance::record_of;
use super::lamps::add_lamps;
use super::{project, there};
use curitiba::conformance::Found;
use curitiba::pipeline::backend::RayCounts;
use curitiba::pipeline::glass::{GlassRule, GlassShadow};
use curitiba::pipeline::programs::{Fidelity, RayProgram};
use curitiba::pipeline::project::{self, MaterialPattern, PassKind, Project};
use curitiba::{BackendChoice, Choice};
use std::sync::{Arc, Mutex};

fn loaded(name: &str) -> Project {
    project::load(&project(name)).expect("the project loads")
}

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

#[test]
fn exact_spheres_on_our_own_tracer_are_the_processors() {
    let backend = BackendChoice::Cuda;
    if there(Choice::CPU.traced_by(backend)).is_none() {
        return;
    }
    let found = Arc::new(Mutex::new(Found::default()));
    let run = |project: Project, name: &str, set: &[&str]| {
        let set = set.iter().map(|one| (*one).to_owned()).collect();
        record_of(project, backend, name, "MainCamera", (Fidelity::Corrected, set), None, &found);
    };
    for name in ["glass/Spheres", "glass/Shells"] {
        // Variants with one kernel and with several, and with texture lookups at level 0 and by ray cones.
        for set in [
            &["pass2.samples=0"][..],
            &["pass2.samples=16"],
            &["pass2.samples=2", "pass2.texturelod=cones", "pass2.fresnel=schlick"],
            &["pass2.samples=9", "pass2.sun=4", "pass2.sunsamples=4"],
        ] {
            run(loaded(name), name, set);
        }
        let mut in_lights = loaded(name);
        add_lamps(&mut in_lights, "MainCamera");
        run(in_lights, name, &["pass2.samples=4"]);
    }
    for program in PROGRAMS {
        let name = program.info().stem;
        let occlusion = matches!(program, RayProgram::Ssao | RayProgram::Final);
        // With few rays for each point, all of them are traced; with more rays, nearby geometry decides some of them without tracing.
        let sets = if occlusion { &["pass2.samples=4", "pass2.samples=16", "pass2.samples=144"][..] } else { &[] };
        for set in sets.chunks(1).chain((!occlusion).then_some(&[][..])) {
            run(opaque(program), name, set);
        }
    }
    let found = found.lock().expect("no panic while it was held");
    assert_eq!(found.records.len(), 2 * 5 + 3 + 2 * 3, "a pass did not run");
    for record in &found.records {
        let words = record.in_words();
        println!("{words}");
        assert!(record.within_limits, "farther off than it may be: {words}");
        let cpu = record.cpu_rays.expect("the processor ran");
        let glass = |rays: RayCounts| [rays.reflected, rays.refracted, rays.lost];
        assert_eq!(glass(record.rays), glass(cpu), "{words}");
        // With glass as each material says, `final` on the processor also visits surfaces of no weight.
        if !record.project.starts_with("glass/") {
            let occlusion = |rays: RayCounts| rays.occlusion + rays.certain;
            assert_eq!(occlusion(record.rays), occlusion(cpu), "{words}");
        }
        let compared = record.comparison.as_ref().expect("compared");
        let exact = matches!(record.program, "ssao" | "deferredShadows");
        assert!(!exact || compared.identical == compared.pixels, "not every bit: {words}");
    }
}

#[test]
fn optix_refuses_exact_spheres_by_name() {
    let Some(rays) = there(Choice::CPU.traced_by(BackendChoice::Optix)) else { return };
    assert!(!rays.traces_spheres());
}
