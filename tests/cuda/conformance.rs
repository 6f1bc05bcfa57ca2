//! The conformance matrix: every program, fidelity, view and ray backend.

use super::lamps::add_lamps;
use super::{PROJECTS, loaded, project, there};
use curitiba::compare::{Operand, compare};
use curitiba::conformance::{Beside, Found, Record};
use curitiba::engines::ray_backend;
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::pipeline::backend::RayCounts;
use curitiba::pipeline::color::ColorSpace;
use curitiba::pipeline::executor::{Engines, Renderer, Silent};
use curitiba::pipeline::metrics::Options;
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::Fidelity;
use curitiba::pipeline::project::Project;
use curitiba::{BackendChoice, Choice};
use std::sync::{Arc, Mutex};

/// The fidelities, some with a setting that the project does not have.
const VARIANTS: [(Fidelity, Option<&str>); 3] =
    [(Fidelity::Corrected, None), (Fidelity::Corrected, Some("pass2.fresnel=schlick")), (Fidelity::Thesis, None)];

/// Runs a project's ray pass on the processor and on another backend, at 256 x 256.
fn record(
    backend: BackendChoice,
    name: &str,
    camera: &str,
    (fidelity, set): (Fidelity, Vec<String>),
    color: Option<ColorSpace>,
    found: &Arc<Mutex<Found>>,
) {
    record_of(loaded(name), backend, name, camera, (fidelity, set), color, found);
}

/// Runs the ray pass of each project with its settings; `None` without the backend. Pictures are within the limits.
pub(crate) fn compared(backend: BackendChoice, runs: Vec<(Project, &str, &[&str])>) -> Option<Vec<Record>> {
    there(Choice::CPU.traced_by(backend))?;
    let found = Arc::new(Mutex::new(Found::default()));
    let count = runs.len();
    for (project, name, set) in runs {
        let set = set.iter().map(|one| (*one).to_owned()).collect();
        // The camera of a project that was made from a scene file has another name.
        let of_file = project.cameras.iter().any(|camera| camera.name == "MainCamera");
        let camera = if of_file { "MainCamera" } else { "Camera" };
        record_of(project, backend, name, camera, (Fidelity::Corrected, set), None, &found);
    }
    let records = std::mem::take(&mut found.lock().expect("no panic while it was held").records);
    assert_eq!(records.len(), count, "a pass did not run");
    for record in &records {
        let words = record.in_words();
        println!("{words}");
        assert!(record.within_limits, "farther off than it may be: {words}");
    }
    Some(records)
}

/// As [`record`], for a loaded project.
pub(crate) fn record_of(
    project: Project,
    backend: BackendChoice,
    name: &str,
    camera: &str,
    (fidelity, set): (Fidelity, Vec<String>),
    color: Option<ColorSpace>,
    found: &Arc<Mutex<Found>>,
) {
    let (camera_name, size) = (Some(camera.to_owned()), Some([256, 256]));
    let settings = Settings { camera: camera_name, size, fidelity, color, set, ..Settings::default() };
    let beside = Beside {
        cpu: ray_backend(Choice::CPU).expect("always there"),
        others: vec![ray_backend(Choice::CPU.traced_by(backend)).expect("it was there before")],
        found: Arc::clone(found),
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
                let occlusion = matches!(name, "SceneSSAO" | "SceneFinal");
                let set = weights.into_iter().chain(occlusion.then_some("pass2.samples=25"));
                record(backend, name, camera, (fidelity, set.map(str::to_owned).collect()), None, &found);
            }
            // The panes show textured surfaces, so texels are decoded.
            let occlusion = (name == "SceneFinal").then(|| "pass2.samples=25".to_owned());
            if matches!(name, "SceneReflect" | "SceneFinal") {
                let set = (Fidelity::Corrected, occlusion.into_iter().collect());
                record(backend, name, camera, set, Some(ColorSpace::Linear), &found);
            }
        }
    }
    let found = found.lock().expect("no panic while it was held");
    // The two projects with Fresnel weights have one more variant each, and two projects are also rendered in linear light.
    assert_eq!(found.records.len(), (PROJECTS.len() * 2 + 2 + 2) * 2, "a pass of the matrix did not run");
    for record in &found.records {
        let words = record.in_words();
        println!("{words}");
        assert!(record.within_limits, "farther off than it may be: {words}");
        let times = record.device_ms.len() == 1 && record.device_ms_median > 0.0;
        assert!(times, "the device's own clock: {words}");
        // Our own tracer may trace rays that the processor finds unnecessary; the sum is the same.
        let cpu = record.cpu_rays.expect("the processor ran");
        if record.backend == "cuda" {
            let (mine, theirs) = (record.rays, cpu);
            assert_eq!(mine.occlusion + mine.certain, theirs.occlusion + theirs.certain, "{words}");
            let others = |rays: RayCounts| [rays.shadow, rays.reflected, rays.refracted];
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

/// Glass as each material says, in front of a background, with straight shadows: balls of several kinds, a filled drinking
/// glass with a bubble, and panes.
fn glass(backend: BackendChoice) {
    if there(Choice::CPU.traced_by(backend)).is_none() {
        return;
    }
    let found = Arc::new(Mutex::new(Found::default()));
    for name in ["glass/balls", "glass/filled", "glass/panes"] {
        for set in [&["pass2.samples=0"][..], &["pass2.fresnel=schlick", "pass2.shadow=report", "pass2.samples=9"]] {
            let set = set.iter().map(|one| (*one).to_owned()).collect();
            record(backend, name, "MainCamera", (Fidelity::Corrected, set), None, &found);
        }
    }
    let found = found.lock().expect("no panic while it was held");
    assert_eq!(found.records.len(), 6, "a pass did not run");
    for record in &found.records {
        let words = record.in_words();
        println!("{words}");
        assert!(record.within_limits, "farther off than it may be: {words}");
        let cpu = record.cpu_rays.expect("the processor ran");
        assert!(record.rays.refracted > 1000, "no glass is seen: {words}");
        if record.backend == "cuda" {
            let others = |rays: RayCounts| [rays.reflected, rays.refracted, rays.lost];
            assert_eq!(others(record.rays), others(cpu), "{words}");
        }
    }
}

#[test]
fn glass_as_each_material_says_on_our_own_tracer_is_the_processors() {
    glass(BackendChoice::Cuda);
}

#[test]
fn glass_as_each_material_says_on_optix_is_the_processors() {
    glass(BackendChoice::Optix);
}

/// Texture lookups by ray cones, in the square and behind glass as each material says.
fn cones(backend: BackendChoice) {
    if there(Choice::CPU.traced_by(backend)).is_none() {
        return;
    }
    let found = Arc::new(Mutex::new(Found::default()));
    let views = ["MainCamera", "Vidro"];
    let mirrors = ["SceneReflect", "SceneRefract"].into_iter().flat_map(|name| views.map(|view| (name, view, None)));
    let lit = views.map(|view| ("SceneFinal", view)).into_iter();
    let lit = lit.chain(["glass/balls", "glass/filled", "glass/panes"].map(|name| (name, "MainCamera")));
    let lit = lit.flat_map(|(name, view)| ["pass2.samples=0", "pass2.samples=9"].map(|set| (name, view, Some(set))));
    for (name, camera, samples) in mirrors.chain(lit) {
        let set = ["pass2.texturelod=cones"].into_iter().chain(samples).map(str::to_owned).collect();
        // In linear light, mip levels are decoded.
        let color = (name == "SceneReflect").then_some(ColorSpace::Linear);
        record(backend, name, camera, (Fidelity::Corrected, set), color, &found);
    }
    let found = found.lock().expect("no panic while it was held");
    assert_eq!(found.records.len(), 4 + 10, "a pass did not run");
    for record in &found.records {
        let words = record.in_words();
        println!("{words}");
        assert!(record.within_limits, "farther off than it may be: {words}");
        let cpu = record.cpu_rays.expect("the processor ran");
        if record.backend == "cuda" {
            let others = |rays: RayCounts| [rays.reflected, rays.refracted, rays.lost];
            assert_eq!(others(record.rays), others(cpu), "{words}");
        }
    }
}

/// The sun with a point light and two spot lights, in the square and with glass as each material says.
fn lights(backend: BackendChoice) {
    if there(Choice::CPU.traced_by(backend)).is_none() {
        return;
    }
    let found = Arc::new(Mutex::new(Found::default()));
    let views = ["MainCamera", "Vidro"];
    let names = ["SceneShadows", "SceneReflect", "SceneRefract", "SceneFinal"];
    let square = names.into_iter().flat_map(|name| views.map(|view| (name, view)));
    for (name, camera) in square.chain([("glass/balls", "MainCamera"), ("glass/panes", "MainCamera")]) {
        // Variants with one kernel and with several, each with texture lookups at level 0 and by ray cones.
        let sets: &[&[&str]] = match name {
            "SceneShadows" => &[&[]],
            "SceneReflect" | "SceneRefract" => &[&[], &["pass2.texturelod=cones"]],
            "SceneFinal" => &[&["pass2.samples=0"], &["pass2.samples=9"]],
            _ => &[&["pass2.samples=9"], &["pass2.samples=2", "pass2.shadow=report"]],
        };
        for set in sets {
            let mut project = loaded(name);
            add_lamps(&mut project, camera);
            let set = set.iter().map(|one| (*one).to_owned()).collect();
            record_of(project, backend, name, camera, (Fidelity::Corrected, set), None, &found);
        }
    }
    let found = found.lock().expect("no panic while it was held");
    assert_eq!(found.records.len(), 2 + 4 + 4 + 4 + 4, "a pass did not run");
    for record in &found.records {
        let words = record.in_words();
        println!("{words}");
        assert!(record.within_limits, "farther off than it may be: {words}");
        let cpu = record.cpu_rays.expect("the processor ran");
        if matches!(record.program, "deferredShadows" | "final") {
            assert!(cpu.shadow > 10_000, "a light throws no shadows: {words}");
        }
        if record.backend == "cuda" {
            // On the processor, `final` also lights surfaces that add nothing to the pixel.
            let shadow = |rays: RayCounts| if record.program == "final" { 0 } else { rays.shadow };
            let others = |rays: RayCounts| [shadow(rays), rays.reflected, rays.refracted, rays.lost];
            assert_eq!(others(record.rays), others(cpu), "{words}");
        }
    }
}

#[test]
fn several_lights_on_our_own_tracer_are_the_processors() {
    lights(BackendChoice::Cuda);
}

#[test]
fn several_lights_on_optix_are_the_processors() {
    lights(BackendChoice::Optix);
}

/// Lights that are discs, in the square and with glass as each material says: the sun alone, and together with a point light and two spot lights.
fn discs(backend: BackendChoice) {
    if there(Choice::CPU.traced_by(backend)).is_none() {
        return;
    }
    let found = Arc::new(Mutex::new(Found::default()));
    let views = ["MainCamera", "Vidro"];
    let square = ["SceneShadows", "SceneFinal"].into_iter().flat_map(|name| views.map(|view| (name, view)));
    let glass = [("glass/balls", "MainCamera"), ("glass/panes", "MainCamera")];
    for (name, camera) in square.chain(glass) {
        let sets: &[&[&str]] = match name {
            "SceneShadows" => &[&["pass2.sunsamples=16"], &["pass2.sunsamples=100"]],
            "SceneFinal" => &[&["pass2.samples=0", "pass2.sunsamples=4"], &["pass2.samples=9", "pass2.sunsamples=4"]],
            _ => &[
                &["pass2.samples=9", "pass2.sunsamples=4"],
                &["pass2.samples=2", "pass2.sunsamples=4", "pass2.shadow=report"],
            ],
        };
        for (set, among_lamps) in sets.iter().flat_map(|set| [(set, false), (set, true)]) {
            let mut project = loaded(name);
            if among_lamps {
                add_lamps(&mut project, camera);
            }
            let set = set.iter().copied().chain(["pass2.sun=4"]).map(str::to_owned).collect();
            record_of(project, backend, name, camera, (Fidelity::Corrected, set), None, &found);
        }
    }
    let found = found.lock().expect("no panic while it was held");
    assert_eq!(found.records.len(), 2 * (4 + 4 + 2 + 2), "a pass did not run");
    for record in &found.records {
        let words = record.in_words();
        println!("{words}");
        assert!(record.within_limits, "farther off than it may be: {words}");
        let cpu = record.cpu_rays.expect("the processor ran");
        assert!(cpu.shadow > 50_000, "a light throws no shadows: {words}");
        if record.backend == "cuda" && record.program == "deferredShadows" {
            assert_eq!(record.rays.shadow, cpu.shadow, "{words}");
        }
    }
}

#[test]
fn lights_that_are_discs_on_our_own_tracer_are_the_processors() {
    discs(BackendChoice::Cuda);
}

#[test]
fn lights_that_are_discs_on_optix_are_the_processors() {
    discs(BackendChoice::Optix);
}

#[test]
fn ray_cones_on_our_own_tracer_are_the_processors() {
    cones(BackendChoice::Cuda);
}

#[test]
fn ray_cones_on_optix_are_the_processors() {
    cones(BackendChoice::Optix);
}

/// Few and many rays from a point, of any length, take different paths through the kernels.
#[test]
fn occlusion_on_our_own_tracer_is_the_processors_whatever_the_rays() {
    if there(Choice::CPU.traced_by(BackendChoice::Cuda)).is_none() {
        return;
    }
    let found = Arc::new(Mutex::new(Found::default()));
    let sets = [
        "samples=1",
        "samples=5",
        "samples=6",
        "samples=64",
        "samples=300",
        "sampler=strata,samples=49",
        "radius=20,samples=9",
        "radius=0.01",
    ];
    for set in sets {
        for name in ["SceneSSAO", "SceneFinal"] {
            let set = set.split(',').map(|one| format!("pass2.{one}")).collect();
            record(BackendChoice::Cuda, name, "Vidro", (Fidelity::Corrected, set), None, &found);
        }
    }
    let found = found.lock().expect("no panic while it was held");
    assert_eq!(found.records.len(), 2 * sets.len());
    for (record, set) in found.records.iter().zip(sets.iter().flat_map(|set| [set; 2])) {
        let words = format!("{set}: {}", record.in_words());
        println!("{words}");
        assert!(record.within_limits, "{words}");
        let compared = record.comparison.as_ref().expect("compared");
        assert!(record.program != "ssao" || compared.identical == compared.pixels, "not every bit: {words}");
        let cpu = record.cpu_rays.expect("the processor ran");
        assert_eq!(record.rays.occlusion + record.rays.certain, cpu.occlusion + cpu.certain, "{words}");
    }
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
