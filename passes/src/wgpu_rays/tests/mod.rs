//! Compares the backend with the processor. Without an adapter, tests that need one print `skipped: why` and pass; with
//! `CURITIBA_REQUIRE_GPU_TESTS=1` they fail instead.

mod cones;
mod functions;
mod glass;
mod leaks;
mod lights;
mod limits;
mod pictures;
mod texts;

use super::*;

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
