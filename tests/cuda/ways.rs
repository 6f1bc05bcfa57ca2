//! Glass that is rough, disperses colours or has a reflectance of its own, and paths that are cut off, compared with the processor's.

use super::conformance::compared;
use super::lamps::add_lamps;
use super::{file, loaded};
use curitiba::BackendChoice;
use curitiba::conformance::Record;
use curitiba::pipeline::backend::RayCounts;
use curitiba::pipeline::project::{Project, SceneOptions, SceneProjects};

/// As [`compared`]; all pictures show glass. On our own tracer, the number of rays in glass equals the processor's.
fn agrees(backend: BackendChoice, runs: Vec<(Project, &str, &[&str])>) -> Option<Vec<Record>> {
    let records = compared(backend, runs)?;
    for record in &records {
        let words = record.in_words();
        assert!(record.rays.refracted > 1000, "no glass is seen: {words}");
        if record.backend == "cuda" {
            let glass = |rays: RayCounts| [rays.reflected, rays.refracted, rays.lost];
            assert_eq!(glass(record.rays), glass(record.cpu_rays.expect("the processor ran")), "{words}");
        }
    }
    Some(records)
}

fn cut_off(backend: BackendChoice) {
    let sets: [&[&str]; 6] = [
        &["pass2.samples=0"],
        &["pass2.samples=0", "pass2.cutoff=0.02"],
        &["pass2.samples=16", "pass2.cutoff=0.1", "pass2.cutoffcolor=background"],
        &["pass2.samples=0", "pass2.reflections=1", "pass2.refractions=4"],
        &["pass2.samples=0", "pass2.cutoff=0.05", "pass2.roulette=on"],
        &["pass2.samples=0", "pass2.cutoff=0.05", "pass2.roulette=on", "pass2.shadow=report"],
    ];
    let runs = sets.map(|set| (loaded("glass/balls"), "glass/balls", set));
    let Some(records) = agrees(backend, Vec::from(runs)) else { return };
    let rays = |record: &Record| record.rays.reflected + record.rays.refracted;
    assert!(rays(&records[1]) < rays(&records[0]), "nothing is cut off");
}

#[test]
fn paths_that_are_cut_off_on_our_own_tracer_are_the_processors() {
    cut_off(BackendChoice::Cuda);
}

#[test]
fn paths_that_are_cut_off_on_optix_are_the_processors() {
    cut_off(BackendChoice::Optix);
}

fn colors(backend: BackendChoice) {
    let sets: [&[&str]; 4] = [
        &["pass2.samples=0", "pass2.depth=3"],
        &["pass2.samples=4", "pass2.wavelengths=5", "pass2.depth=2"],
        &["pass2.samples=0", "pass2.wavelengths=4", "pass2.texturelod=cones", "pass2.fresnel=schlick"],
        &["pass2.samples=0", "pass2.wavelengths=4", "pass2.cutoff=0.01"],
    ];
    agrees(backend, Vec::from(sets.map(|set| (loaded("glass/Prism"), "glass/Prism", set))));
}

#[test]
fn colours_on_our_own_tracer_are_bent_apart_as_the_processors() {
    colors(BackendChoice::Cuda);
}

#[test]
fn colours_on_optix_are_bent_apart_as_the_processors() {
    colors(BackendChoice::Optix);
}

fn rough(backend: BackendChoice) {
    let sets: [&[&str]; 3] = [
        &["pass2.samples=0", "pass2.paths=8", "pass2.depth=2"],
        &["pass2.samples=16", "pass2.paths=4", "pass2.depth=1"],
        &["pass2.samples=0", "pass2.paths=4", "pass2.texturelod=cones", "pass2.cutoff=0.005", "pass2.roulette=on"],
    ];
    let mut runs: Vec<(Project, &str, &[&str])> =
        Vec::from(sets.map(|set| (loaded("glass/Frosted"), "glass/Frosted", set)));
    let mut in_lights = loaded("glass/Frosted");
    add_lamps(&mut in_lights, "MainCamera");
    runs.push((in_lights, "glass/Frosted", &["pass2.samples=4", "pass2.paths=4", "pass2.depth=1"]));
    agrees(backend, runs);
}

#[test]
fn rough_glass_on_our_own_tracer_is_the_processors() {
    rough(BackendChoice::Cuda);
}

#[test]
fn rough_glass_on_optix_is_the_processors() {
    rough(BackendChoice::Optix);
}

fn spheres(backend: BackendChoice) {
    let sets: [&[&str]; 2] =
        [&["pass2.samples=0", "pass2.cutoff=0.02"], &["pass2.samples=9", "pass2.cutoff=0.05", "pass2.roulette=on"]];
    let names = ["glass/Spheres", "glass/Shells"];
    let runs = names.iter().flat_map(|name| sets.map(|set| (loaded(name), *name, set)));
    agrees(backend, runs.collect());
}

#[test]
fn exact_spheres_on_our_own_tracer_are_followed_by_cut_off_paths_as_the_processors() {
    spheres(BackendChoice::Cuda);
}

#[test]
fn exact_spheres_on_optix_are_followed_by_cut_off_paths_as_the_processors() {
    spheres(BackendChoice::Optix);
}

/// The balls, with reflectances and colours of their own.
fn own(backend: BackendChoice) {
    let mut changed = std::fs::read_to_string(file("xml_projects/glass/scenes/balls.gltf")).expect("readable");
    for (name, extras) in [
        ("clear glass", r#"{"schlick":{"minimum":0.1,"maximum":0.8,"exponent":3},"reflectionColor":[1,0.6,0.3]}"#),
        ("diamond", r#"{"reflectionColor":[0.5,0.9,1],"refractionColor":[0.9,0.8,1]}"#),
    ] {
        let named = format!("\"name\": \"{name}\",");
        assert_eq!(changed.matches(&named).count(), 1, "{name}");
        changed = changed.replace(&named, &format!("{named} \"extras\": {extras},"));
    }
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("own.gltf"), changed).expect("a file");
    let project = || {
        let options = SceneOptions { effects: "shadows,glass".parse().ok(), ..SceneOptions::default() };
        SceneProjects::new(&[folder.path().join("own.gltf")], &options, None, 1 << 28).expect("a scene").project()
    };
    let runs: Vec<(Project, &str, &[&str])> =
        vec![(project(), "own", &["pass2.shadow=straight"]), (project(), "own", &["pass2.shadow=report"])];
    agrees(backend, runs);
}

#[test]
fn reflectances_of_their_own_on_our_own_tracer_are_the_processors() {
    own(BackendChoice::Cuda);
}

#[test]
fn reflectances_of_their_own_on_optix_are_the_processors() {
    own(BackendChoice::Optix);
}
