//! Compares the backend with the processor. Without an adapter, tests that need one print `skipped: why` and pass; with
//! `CURITIBA_REQUIRE_GPU_TESTS=1` they fail instead.

mod adaptive;
mod bundles;
mod caustics;
mod cones;
mod functions;
mod glass;
mod leaks;
mod lights;
mod limits;
mod photons;
mod pictures;
mod sphere_functions;
mod sphere_glass;
mod spheres;
mod texts;

use super::*;
use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, PoisonError};

/// A backend; `None`, after printing why, where this machine has no device.
fn rays() -> Option<WgpuRays> {
    match WgpuRays::new(AdapterChoice::Any) {
        Ok(rays) => Some(rays),
        Err(error) => {
            assert!(std::env::var_os("CURITIBA_REQUIRE_GPU_TESTS").is_none_or(|value| value != "1"), "{error}");
            eprintln!("skipped: {error}");
            None
        }
    }
}

/// Idle backends, with their compiled kernels; software drivers take seconds to compile each.
static WAITING: Mutex<Vec<WgpuRays>> = Mutex::new(Vec::new());

/// A backend that tests use one after the other. If a test fails, later tests do not use its backend.
struct InTurn(Option<WgpuRays>);

impl Deref for InTurn {
    type Target = WgpuRays;

    fn deref(&self) -> &WgpuRays {
        self.0.as_ref().expect("there until it is dropped")
    }
}

impl DerefMut for InTurn {
    fn deref_mut(&mut self) -> &mut WgpuRays {
        self.0.as_mut().expect("there until it is dropped")
    }
}

impl Drop for InTurn {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            WAITING.lock().unwrap_or_else(PoisonError::into_inner).extend(self.0.take());
        }
    }
}

/// As [`rays`], for tests that change nothing of the backend itself.
fn rays_in_turn() -> Option<InTurn> {
    let waiting = WAITING.lock().unwrap_or_else(PoisonError::into_inner).pop();
    Some(InTurn(Some(waiting.or_else(rays)?)))
}

/// The picture of a job on a backend, with its statistics.
fn picture(rays: &mut dyn RayBackend, job: &RayJob<'_>) -> (Vec<[f32; 4]>, RayStats) {
    // Filled with NaN, which no program writes.
    let mut output = Image::filled(job.width, job.height, [f32::NAN; 4]);
    let stats = rays.run(job, &mut output, &Progress::default()).expect("a complete job");
    (output.pixels, stats)
}

fn bits(picture: &[[f32; 4]]) -> Vec<[u32; 4]> {
    picture.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}
