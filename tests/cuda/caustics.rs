//! Light that glass focuses, exact spheres and meshes, compared with the processor's.

use super::conformance::compared;
use super::loaded;
use curitiba::BackendChoice;
use curitiba::conformance::Record;
use curitiba::pipeline::backend::RayCounts;

/// With a light that is a point and with one that is a disc; without occlusion, with few occlusion rays and with many; with each kind of
/// texture lookup and of reflection's weights; with paths that are followed as ways; and where spheres touch and lie in each other.
/// The last run is a control without focused light.
const RUNS: [(&str, &[&str]); 9] = [
    ("glass/Caustics", &["pass2.sun=0", "pass2.samples=0"]),
    ("glass/Caustics", &["pass2.sun=0", "pass2.samples=2"]),
    ("glass/Caustics", &["pass2.sun=0", "pass2.samples=16", "pass2.texturelod=cones", "pass2.fresnel=schlick"]),
    ("glass/Caustics", &["pass2.sunsamples=4"]),
    ("glass/Caustics", &["pass2.sun=0", "pass2.samples=9", "pass2.cutoff=0.02"]),
    ("glass/Caustics", &["pass2.sunsamples=4", "pass2.samples=0", "pass2.cutoff=0.02"]),
    ("glass/Spheres", &["pass2.samples=4", "pass2.shadow=caustic"]),
    ("glass/Shells", &["pass2.samples=4", "pass2.shadow=caustic"]),
    ("glass/Caustics", &["pass2.sun=0", "pass2.samples=0", "pass2.shadow=straight"]),
];

fn focused(backend: BackendChoice) {
    let runs = RUNS.map(|(name, set)| (loaded(name), name, set));
    let Some(records) = compared(backend, Vec::from(runs)) else { return };
    for record in &records {
        let (words, cpu) = (record.in_words(), record.cpu_rays.expect("the processor ran"));
        if backend == BackendChoice::Cuda {
            let glass = |rays: RayCounts| [rays.reflected, rays.refracted, rays.lost];
            assert_eq!(glass(record.rays), glass(cpu), "{words}");
        }
    }
    // Without focused light, the backends and the processor leave out different shadow rays, as in all tests of `final`.
    for record in &records[..RUNS.len() - 1] {
        let (own, cpu) = (record.rays.shadow, record.cpu_rays.expect("the processor ran").shadow);
        assert!(own.abs_diff(cpu) <= cpu / 50, "{}: {own} and {cpu} rays of shadows", record.in_words());
    }
    let shadow = |record: &Record| record.rays.shadow;
    assert!(shadow(&records[0]) > 5 * shadow(&records[8]), "control: {:?} {:?}", records[0].rays, records[8].rays);
}

#[test]
fn light_that_spheres_focus_on_our_own_tracer_is_the_processors() {
    focused(BackendChoice::Cuda);
}

#[test]
fn light_that_spheres_focus_on_optix_is_the_processors() {
    focused(BackendChoice::Optix);
}

/// Photons at meshes: with a light that is a point and with lights that are discs; without occlusion, with few occlusion rays and with
/// many; with paths that are followed as ways; and with `photonradius` set. The last run is a control without photons.
const PHOTON_RUNS: [(&str, &[&str]); 7] = [
    ("glass/MeshCaustics", &["pass2.photons=20000", "pass2.sun=0", "pass2.samples=0"]),
    ("glass/MeshCaustics", &["pass2.photons=20000", "pass2.sun=0", "pass2.samples=2", "pass2.fresnel=schlick"]),
    ("glass/MeshCaustics", &["pass2.photons=20000", "pass2.sun=0", "pass2.samples=16", "pass2.texturelod=cones"]),
    ("glass/MeshCaustics", &["pass2.photons=3000", "pass2.sunsamples=4", "pass2.samples=4", "pass2.photonradius=0.3"]),
    ("glass/MeshCaustics", &["pass2.photons=20000", "pass2.sun=0", "pass2.samples=9", "pass2.cutoff=0.02"]),
    ("glass/MeshCaustics", &["pass2.photons=20000", "pass2.sunsamples=4", "pass2.samples=0", "pass2.cutoff=0.02"]),
    ("glass/MeshCaustics", &["pass2.photons=0", "pass2.sunsamples=4", "pass2.samples=0"]),
];

/// The processor shoots the photons of all backends, so they are the same; the devices look them up.
fn lit_by_photons(backend: BackendChoice) {
    let runs = PHOTON_RUNS.map(|(name, set)| (loaded(name), name, set));
    let Some(records) = compared(backend, Vec::from(runs)) else { return };
    let (control, shot) = records.split_last().expect("there are runs");
    for record in shot {
        let cpu = record.cpu_rays.expect("the processor ran");
        assert!(cpu.photons.landed > 100, "{}: {:?}", record.in_words(), cpu.photons);
        assert_eq!(record.rays.photons, cpu.photons, "{}", record.in_words());
    }
    assert!(control.rays.photons.is_empty(), "{:?}", control.rays);
}

#[test]
fn light_of_photons_on_our_own_tracer_is_the_processors() {
    lit_by_photons(BackendChoice::Cuda);
}

#[test]
fn light_of_photons_on_optix_is_the_processors() {
    lit_by_photons(BackendChoice::Optix);
}
