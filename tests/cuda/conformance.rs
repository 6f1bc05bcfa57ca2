//! The conformance matrix: every program, fidelity, view and tracer.

use super::{PROJECTS, project, there};
use curitiba::compare::{Operand, compare};
use curitiba::conformance::{Beside, Found};
use curitiba::engines::ray_backend;
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::pipeline::executor::{Engines, Renderer, Silent};
use curitiba::pipeline::metrics::Options;
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::Fidelity;
use curitiba::pipeline::project;
use curitiba::{BackendChoice, Choice};
use std::sync::{Arc, Mutex};

/// Fidelities, and what is set of them beyond the project.
const VARIANTS: [(Fidelity, Option<&str>); 3] =
    [(Fidelity::Corrected, None), (Fidelity::Corrected, Some("pass2.fresnel=schlick")), (Fidelity::Thesis, None)];

fn matrix(backend: BackendChoice) {
    if there(Choice::CPU.traced_by(backend)).is_none() {
        return;
    }
    let found = Arc::new(Mutex::new(Found::default()));
    for name in PROJECTS {
        for camera in ["MainCamera", "Vidro"] {
            for (fidelity, weights) in VARIANTS {
                let glass = matches!(name, "SceneRefract" | "SceneFinal");
                if weights.is_some() && !glass {
                    continue;
                }
                let project = project::load(&project(name)).expect("the project loads");
                let occlusion = matches!(name, "SceneSSAO" | "SceneFinal");
                let settings = Settings {
                    camera: Some(camera.to_owned()),
                    size: Some([256, 256]),
                    fidelity,
                    set: weights
                        .into_iter()
                        .chain(occlusion.then_some("pass2.samples=25"))
                        .map(str::to_owned)
                        .collect(),
                    ..Settings::default()
                };
                let beside = Beside {
                    cpu: ray_backend(Choice::CPU).expect("always there"),
                    others: vec![ray_backend(Choice::CPU.traced_by(backend)).expect("it was there before")],
                    found: Arc::clone(&found),
                    project: name.to_owned(),
                    camera: Some(camera.to_owned()),
                    runs: 2,
                    compare: true,
                };
                let engines = Engines::new(Box::new(CpuRasteriser::new()), Box::new(beside));
                let plan = Plan::new(project, settings).expect("the plan stands");
                let mut renderer = Renderer::new(plan, engines, &mut Silent).expect("ready");
                renderer.frame(&mut Silent).expect("rendered");
            }
        }
    }
    let found = found.lock().expect("no panic while it was held");
    // Two projects with glass that is weighed have a variant more.
    assert_eq!(found.records.len(), (PROJECTS.len() * 2 + 2) * 2, "a pass of the matrix did not run");
    for record in &found.records {
        let words = record.in_words();
        println!("{words}");
        assert!(record.within_limits, "farther off than it may be: {words}");
        let times = record.device_ms.len() == 1 && record.device_ms_median > 0.0;
        assert!(times, "the device's own clock: {words}");
        // Our own tracer leaves out the rays that the processor leaves out, or traces them: together they are as many.
        let cpu = record.cpu_rays.expect("the processor ran");
        if record.backend == "cuda" {
            let (mine, theirs) = (record.rays, cpu);
            assert_eq!(mine.occlusion + mine.certain, theirs.occlusion + theirs.certain, "{words}");
            let others = |rays: curitiba::pipeline::backend::RayCounts| [rays.shadow, rays.reflected, rays.refracted];
            assert_eq!(others(mine), others(theirs), "{words}");
        }
    }
}

#[test]
fn every_program_on_our_own_tracer_computes_what_the_processor_does() {
    matrix(BackendChoice::Cuda);
}

#[test]
fn every_program_on_optix_computes_what_the_processor_does() {
    matrix(BackendChoice::Optix);
}

#[test]
fn two_backends_are_compared_by_their_names_in_the_settings_of_a_project() {
    if there(Choice::CPU.traced_by(BackendChoice::Cuda)).is_none() {
        return;
    }
    let path = project("SceneShadows");
    let [test, reference] = ["cuda", "cpu"].map(|backend| {
        let text = format!("{}@backend={backend},raster=cpu,size=96x64", path.display());
        (text.clone(), Operand::parse(&text).expect("valid"))
    });
    let sides = [(test.0.as_str(), &test.1), (reference.0.as_str(), &reference.1)];
    let compared = compare(sides, 1, &Options::default(), &mut Silent).expect("compared");
    assert_eq!(compared.test.rendered.map(|rendered| rendered.rays), Some("cuda"));
    assert_eq!(compared.reference.rendered.map(|rendered| rendered.rays), Some("cpu"));
    assert!(compared.comparison.rmse < 1e-6, "{}", compared.comparison.rmse);
}
