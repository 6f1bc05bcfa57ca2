//! Random numbers with several samples per pixel: sequences continue from sample to sample, and noise falls together
//! with aliasing.

use super::{file, frame, opened, rms, samples, settings};
use curitiba::passes::cpu::CpuRays;
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::pipeline::backend::{BackendError, BuildStats, RayBackend, RayJob, RayStats, Rect};
use curitiba::pipeline::executor::{Engines, Goal, Progress, Renderer, Silent};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::{Fidelity, RayParams, RayProgram};
use curitiba::pipeline::project;
use curitiba::pipeline::scene::RenderScene;
use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

/// For each job: the index of the first sample, of the first path and of the first disc sample, and the seed.
type Noted = Rc<RefCell<Vec<[u32; 4]>>>;

/// The processor's backend, which records these indices and the seed for each job.
struct Noting {
    rays: CpuRays,
    continues: bool,
    noted: Noted,
}

impl RayBackend for Noting {
    fn name(&self) -> &'static str {
        "noting"
    }
    fn device(&self) -> String {
        "for a test".to_owned()
    }
    fn supports(&self, _: RayProgram, _: Fidelity) -> Result<(), BackendError> {
        Ok(())
    }
    fn continues_sequences(&self) -> bool {
        self.continues
    }
    fn traces_sun_discs(&self) -> bool {
        true
    }
    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        self.rays.build(scene, filtered)
    }
    fn bytes_per_triangle(&self) -> u64 {
        self.rays.bytes_per_triangle()
    }
    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        let RayParams { first, first_path, first_sun, .. } = job.params;
        self.noted.borrow_mut().push([first, first_path, first_sun, job.seed]);
        self.rays.run(job, output, progress)
    }
}

fn noted(settings: Settings, continues: bool) -> (Vec<[u32; 4]>, Image) {
    noted_of("SceneSSAO", settings, continues)
}

fn noting(name: &str, settings: Settings, continues: bool) -> (Renderer, Noted) {
    let plan = Plan::new(project::load(&file(name)).expect("it loads"), settings).expect("a plan");
    let noted = Noted::default();
    let rays = Noting { rays: CpuRays::new(), continues, noted: Rc::clone(&noted) };
    let engines = Engines::new(Box::new(CpuRasteriser::new()), Box::new(rays));
    (Renderer::new(plan, engines, &mut Silent).expect("the scene loads"), noted)
}

fn noted_of(name: &str, settings: Settings, continues: bool) -> (Vec<[u32; 4]>, Image) {
    let (mut renderer, noted) = noting(name, settings, continues);
    let picture = frame(&mut renderer);
    let list = noted.borrow().clone();
    (list, picture)
}

#[test]
fn sequences_go_on_and_others_have_seeds_of_their_own() {
    let settings = Settings { seed: 5, ..settings("SceneSSAO", 4) };
    // Each sample of the pixel takes four occlusion samples, and sixteen paths through rough glass.
    let (going_on, picture) = noted(settings.clone(), true);
    assert_eq!(going_on, [[0, 0, 0, 5], [4, 16, 0, 5], [8, 32, 0, 5], [12, 48, 0, 5]]);
    // Rays to the light's disc continue in the same way.
    let set = vec!["pass2.sun=4".to_owned(), "pass2.sunsamples=3".to_owned()];
    let (of_sun, _) = noted_of("SceneShadows", Settings { set, ..settings.clone() }, true);
    assert_eq!(of_sun.iter().map(|noted| noted[2..].to_vec()).collect::<Vec<_>>(), [[0, 5], [3, 5], [6, 5], [9, 5]]);
    let strata =
        Settings { set: vec!["pass2.samples=4".to_owned(), "pass2.sampler=strata".to_owned()], ..settings.clone() };
    let thesis = Settings { fidelity: Fidelity::Thesis, ..settings.clone() };
    for (settings, continues) in [(settings, false), (strata, true), (thesis, true)] {
        let (seeded, other) = noted(settings, continues);
        let mut seeds: Vec<u32> = seeded
            .iter()
            .map(|[first, first_path, first_sun, seed]| {
                assert_eq!((*first, *first_path, *first_sun), (0, 0, 0));
                *seed
            })
            .collect();
        assert_eq!((seeds.len(), seeds[0]), (4, 5), "the first sample is the picture's");
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), 4);
        assert!(rms(&other, &picture) < 0.1, "another noise of the same picture");
    }
}

#[test]
fn backends_that_do_not_continue_a_sequence_accumulate_nothing() {
    let accumulated = |continues: bool| {
        let (mut renderer, noted) = noting("SceneSSAO", settings("SceneSSAO", 1), continues);
        let done = renderer.accumulate(Goal::Samples(16), &mut Silent).map(|done| done.samples());
        let firsts = noted.borrow().iter().map(|noted| noted[0]).collect::<Vec<_>>();
        (done.map_err(|error| error.to_string()), firsts)
    };
    let (done, firsts) = accumulated(true);
    assert_eq!((done, firsts), (Ok(16), (0..16).collect()));
    let (refused, firsts) = accumulated(false);
    let error = refused.expect_err("refused");
    assert!(error.contains("`noting` does not continue") && error.contains("--set pass2.backend=cpu"), "{error}");
    assert!(firsts.is_empty(), "nothing was traced");
}

/// Aliasing and noise fall together. The reference has other random numbers.
#[test]
fn occlusion_tends_to_its_mean() {
    for (name, intensity) in [("SceneSSAO", "pass2.intensity=1"), ("SceneFinal", "pass2.intensity=1")] {
        let of = |count: u32, own: u32, seed: u32| Settings {
            seed,
            size: Some([64, 48]),
            aa: samples(count),
            set: vec![format!("pass2.samples={own}"), intensity.to_owned()],
            ..Settings::default()
        };
        let reference = frame(&mut opened(name, of(64, 64, 77)));
        let errors = [1, 4, 16, 64].map(|count| rms(&frame(&mut opened(name, of(count, 4, 0))), &reference));
        println!("{name}: {errors:.5?}");
        assert!(errors.windows(2).all(|errors| errors[1] < 0.6 * errors[0]), "{name}: {errors:?}");
    }
}

/// In a part of a large picture, each pixel shows a single surface, so the only error is noise. The noise falls as fast as
/// that of one sequence, which is faster than with independent random numbers.
#[test]
fn noise_falls_as_that_of_one_sequence() {
    let of = |continues: bool, count: u32, own: u32, seed: u32| {
        let settings = Settings {
            seed,
            size: Some([1024, 1024]),
            crop: Some(Rect { x: 448, y: 704, width: 64, height: 64 }),
            aa: samples(count),
            set: vec![format!("pass2.samples={own}"), "pass2.intensity=1".to_owned(), "pass2.radius=8".to_owned()],
            ..Settings::default()
        };
        noted(settings, continues).1
    };
    // The reference uses the same positions in the pixels and other random numbers, so the difference is noise.
    let reference = of(true, 16, 256, 77);
    let error = |continues: bool| {
        let squares = [0, 1, 2].map(|seed| rms(&of(continues, 16, 4, seed), &reference).powi(2));
        (squares.iter().sum::<f64>() / 3.0).sqrt()
    };
    let (going_on, seeded) = (error(true), error(false));
    println!("one sequence {going_on:.5}, sixteen {seeded:.5}");
    assert!(going_on < 0.85 * seeded, "{going_on} and {seeded}");
}
