//! How much of a step is still computed after a frame is cancelled in the middle of it: the part that each thread is
//! working on, and no more.
//!
//! Another thread cancels at pseudo-random moments. Only counts are asserted, not times; times are printed.

use super::{bits, file};
use curitiba::Choice;
use curitiba::pipeline::executor::{Observer, Progress, RenderError, Renderer, Silent, StepKind};
use curitiba::pipeline::plan::Settings;
use std::sync::atomic::{AtomicBool, Ordering, fence};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Number of frames to be cancelled in the middle of the step, and greatest number of tries to get them.
const WANTED: usize = 5;
const TRIES: usize = 100;

/// Hands the progress of a step to another thread.
struct Shows<'a> {
    kind: StepKind,
    running: &'a Mutex<Option<Arc<Progress>>>,
}

impl Observer for Shows<'_> {
    fn begin(&mut self, kind: StepKind, _: &str, progress: &Arc<Progress>) {
        if kind == self.kind {
            *self.running.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(progress));
        }
    }
    fn end(&mut self) {}
}

/// The result of one try: parts done when it was cancelled, parts done at the end, their total, and the time from
/// cancelling to the end.
struct Try {
    asked: u64,
    end: u64,
    total: u64,
    took: Duration,
}

/// Renders a frame, and cancels it when the share `when` (0..1) of a step is done; `None` if the frame ended first.
fn one_try(renderer: &mut Renderer, kind: StepKind, when: f64) -> Option<Try> {
    let (running, over) = (Mutex::new(None), AtomicBool::new(false));
    let stop = renderer.cancellation();
    let (asked, ended) = std::thread::scope(|scope| {
        let watcher = scope.spawn(|| {
            while !over.load(Ordering::Relaxed) {
                let step: Option<Arc<Progress>> = running.lock().unwrap_or_else(PoisonError::into_inner).clone();
                if let Some(step) = step {
                    let (done, total) = step.get();
                    if total > 0 && done as f64 >= when * total as f64 {
                        let now = Instant::now();
                        stop.cancel();
                        fence(Ordering::SeqCst);
                        return Some((now, step.get().0, step));
                    }
                }
                std::thread::yield_now();
            }
            None
        });
        let result = renderer.frame(&mut Shows { kind, running: &running });
        let end = Instant::now();
        over.store(true, Ordering::Relaxed);
        let asked = watcher.join().expect("the watcher does not panic");
        (asked, result.map(drop).map_err(|error| (error, end)))
    });
    stop.reset();
    let (now, asked, step) = asked?;
    let (end, total) = step.get();
    match ended {
        Err((RenderError::Cancelled, returned)) => Some(Try { asked, end, total, took: returned - now }),
        Err((error, _)) => panic!("{error}"),
        // It was cancelled only when the last pass was done.
        Ok(()) => None,
    }
}

/// Pseudo-random numbers, the same in every run (the 64-bit congruential generator of Knuth, MMIX).
fn parts() -> impl Iterator<Item = f64> {
    let mut state = 1_u64;
    std::iter::repeat_with(move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / (1_u64 << 24) as f64
    })
}

#[test]
fn threads_end_what_they_are_at_in_every_kind_of_pass() {
    let threads = rayon::current_num_threads() as u64;
    let size = Some([1024, 1024]);
    for (name, kind, set) in [
        ("SceneNoEffects", StepKind::Raster, None),
        ("SceneSSAO", StepKind::Rays, Some("pass2.samples=4")),
        ("raster/SceneShadowMap", StepKind::Effect, None),
    ] {
        let settings = Settings { size, set: set.map(str::to_owned).into_iter().collect(), ..Settings::default() };
        let mut renderer = curitiba::open(file(name), settings, Choice::CPU, &mut Silent).expect("the project opens");
        let whole = bits(&renderer.frame(&mut Silent).expect("the frame renders"));
        let mut times = Vec::new();
        let mut most = 0;
        for when in parts().take(TRIES) {
            let Some(tried) = one_try(&mut renderer, kind, 0.95 * when) else { continue };
            assert!(
                tried.end - tried.asked <= threads,
                "{name}: {} of {} parts were done, at last {}, by {threads} threads",
                tried.asked,
                tried.total,
                tried.end
            );
            most = most.max(tried.end - tried.asked);
            times.push(tried.took);
            if times.len() == WANTED {
                break;
            }
        }
        assert_eq!(times.len(), WANTED, "{name}: in {TRIES} tries");
        times.sort();
        println!(
            "{name}, {} given up {WANTED} times: at most {most} parts more by {threads} threads; {:.1} ms in the middle, {:.1} ms at most",
            kind.name(),
            times[WANTED / 2].as_secs_f64() * 1e3,
            times[WANTED - 1].as_secs_f64() * 1e3
        );
        // A cancelled frame leaves nothing behind.
        assert!(bits(&renderer.update(&mut Silent).expect("the frame renders")) == whole, "{name}");
    }
}
