//! Light that exact spheres focus, compared with the processor's.

use super::conformance::compared;
use super::{file, loaded, there};
use curitiba::conformance::Record;
use curitiba::pipeline::backend::RayCounts;
use curitiba::pipeline::executor::Silent;
use curitiba::pipeline::plan::Settings;
use curitiba::{BackendChoice, Choice};

/// Under a point and under a disc; where nothing is near points, few rays and many; with each kind of texture lookup and of weights; with paths that
/// are followed as ways; and where spheres touch and lie in each other. The last is a control without focused light.
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
    // Without focused light the backends leave out other rays of shadows than the processor, as in all tests of `final`.
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

/// Only the processor shoots photons. They are refused where a pass has meshes that they are shot at.
#[test]
fn photons_at_meshes_are_refused_by_name() {
    for backend in [BackendChoice::Cuda, BackendChoice::Optix] {
        let Some(rays) = there(Choice::CPU.traced_by(backend)) else { continue };
        assert!(!rays.shoots_photons());
        let open = |name: &str, set: &[&str]| {
            let set = set.iter().map(|one| format!("pass2.{one}")).collect();
            let settings = Settings { size: Some([8, 8]), set, ..Settings::default() };
            let path = file(&format!("xml_projects/glass/{name}.xml"));
            curitiba::open(&path, settings, Choice::CPU.traced_by(backend), &mut Silent)
        };
        let refused = open("MeshCaustics", &[]).err().expect("it has photons").to_string();
        let words = ["photons=", "material `", "photons=0"];
        assert!(words.iter().all(|word| refused.contains(word)), "{refused}");
        assert!(open("MeshCaustics", &["photons=0"]).is_ok(), "light goes straight through meshes");
        assert!(open("Caustics", &["photons=1000"]).is_ok(), "photons are shot at no sphere");
    }
}
