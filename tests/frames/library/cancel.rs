//! Cancelled frames.

use super::setters::RAYS;
use super::{bits, file, frame, opened, ran, settings, update};
use curitiba::passes::cpu;
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::passes::trace::{Bvh, Hit, Quality, Ray, Tracer};
use curitiba::pipeline::backend::{BackendError, BuildStats, RayBackend, RayJob, RayStats};
use curitiba::pipeline::executor::{
    Cancellation, Engines, Observer, Progress, RenderError, Renderer, Silent, StepKind,
};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::{Fidelity, RayProgram};
use curitiba::pipeline::project;
use curitiba::pipeline::scene::RenderScene;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

#[test]
fn a_frame_that_is_given_up_leaves_no_half_picture() {
    let mut renderer = opened("SceneFinal", settings("SceneFinal"));
    let before = bits(&frame(&mut renderer));
    let stop = renderer.cancellation();
    renderer.set_parameter("pass2", "radius", "3").expect("it can be set");
    stop.cancel();
    for _ in 0..2 {
        assert!(matches!(renderer.update(&mut Silent), Err(RenderError::Cancelled)));
    }
    assert!(matches!(renderer.frame(&mut Silent), Err(RenderError::Cancelled)));
    stop.reset();
    // Cancels in the middle of the ray pass, from a thread other than the rendering one.
    let mut at = StopAtRays(&stop);
    assert!(matches!(renderer.update(&mut at), Err(RenderError::Cancelled)));
    assert!(ran(&renderer).is_empty());
    stop.reset();
    let after = bits(&update(&mut renderer));
    assert_eq!(ran(&renderer), RAYS);
    let mut fresh = settings("SceneFinal");
    fresh.set.push("pass2.radius=3".to_owned());
    assert!(after == bits(&frame(&mut opened("SceneFinal", fresh))) && after != before);
}

struct StopAtRays<'a>(&'a Cancellation);

impl Observer for StopAtRays<'_> {
    fn begin(&mut self, kind: StepKind, _: &str, _: &Arc<Progress>) {
        if kind == StepKind::Rays {
            self.0.cancel();
        }
    }
    fn end(&mut self) {}
}

/// A tracer that cancels at a ray in the middle of the picture, and records how many tiles are done at that moment.
struct Tripwire<'a> {
    bvh: &'a Bvh,
    rays: &'a AtomicU64,
    stop_at: u64,
    stop: &'a Cancellation,
    progress: &'a Progress,
    done: &'a OnceLock<u64>,
}

impl Tripwire<'_> {
    fn count(&self) {
        if self.rays.fetch_add(1, Ordering::SeqCst) + 1 == self.stop_at {
            self.stop.cancel();
            self.done.set(self.progress.get().0).expect("one ray has this number");
        }
    }
}

impl Tracer for Tripwire<'_> {
    fn closest(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        self.count();
        self.bvh.closest(ray, accept)
    }

    fn occluded(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> bool {
        self.count();
        self.bvh.occluded(ray, accept)
    }
}

/// The processor's backend with that tracer. Records how many tiles were done when it was cancelled and when it returned,
/// and the total.
#[derive(Default)]
struct Stopped {
    bvh: Option<Bvh>,
    rays: Arc<AtomicU64>,
    stop_at: u64,
    stop: Arc<OnceLock<Cancellation>>,
    told: Arc<OnceLock<[u64; 3]>>,
}

impl RayBackend for Stopped {
    fn name(&self) -> &'static str {
        "cpu"
    }
    fn device(&self) -> String {
        "for a test".to_owned()
    }
    fn supports(&self, _: RayProgram, _: Fidelity) -> Result<(), BackendError> {
        Ok(())
    }
    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        self.bvh = Some(Bvh::build(&scene.geometry, filtered, Quality::default()));
        Ok(BuildStats::default())
    }
    fn bytes_per_triangle(&self) -> u64 {
        300
    }
    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        let (done, never) = (OnceLock::new(), Cancellation::new());
        let stop = self.stop.get().unwrap_or(&never);
        let (bvh, rays, stop_at) = (self.bvh.as_ref().expect("it was built"), &*self.rays, self.stop_at);
        let result = cpu::trace(&Tripwire { bvh, rays, stop_at, stop, progress, done: &done }, job, output, progress);
        if let Some(done) = done.get() {
            let (end, total) = progress.get();
            self.told.set([*done, end, total]).expect("one frame is stopped");
        }
        result
    }
}

#[test]
fn what_was_begun_ends_with_its_tile() {
    let settings =
        || Settings { size: Some([320, 320]), set: vec!["pass2.samples=4".to_owned()], ..Settings::default() };
    let open = |backend: Stopped| {
        let plan =
            Plan::new(project::load(&file("SceneSSAO")).expect("the project loads"), settings()).expect("a plan");
        let engines = Engines::new(Box::new(CpuRasteriser::new()), Box::new(backend));
        Renderer::new(plan, engines, &mut Silent).expect("the scene loads")
    };
    // The number of rays is needed to cancel in the middle of them.
    let backend = Stopped::default();
    let rays = Arc::clone(&backend.rays);
    frame(&mut open(backend));
    let all = rays.load(Ordering::SeqCst);
    assert!(all > 10_000, "{all} rays");
    let (stop, told) = (Arc::new(OnceLock::new()), Arc::new(OnceLock::new()));
    let mut renderer =
        open(Stopped { stop_at: all / 2, stop: Arc::clone(&stop), told: Arc::clone(&told), ..Stopped::default() });
    stop.set(renderer.cancellation()).expect("it is set once");
    assert!(matches!(renderer.frame(&mut Silent), Err(RenderError::Cancelled)));
    let [then, end, total] = *told.get().expect("it was stopped");
    assert_eq!(total, 400);
    let threads = rayon::current_num_threads() as u64;
    assert!(then > 20 && end < total, "stopped in the middle: {then} of {total} tiles, at last {end}");
    // Each thread finishes its current tile.
    assert!(end - then <= threads, "{} tiles more, by {threads} threads", end - then);
}
