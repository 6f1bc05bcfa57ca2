//! The processor's rasteriser against an independent one, and against closed forms.

mod common;

use common::{ALL, camera, grey, job, soup};
use curitiba_passes::raster::cpu::CpuRasteriser;
use curitiba_pipeline::backend::{GBuffer, RasterJob, Rasteriser};

fn draw(job: &RasterJob<'_>) -> GBuffer {
    let mut target = GBuffer::new(job.viewport.width, job.viewport.height, job.attachments);
    CpuRasteriser::new().draw(job, &mut target).expect("drawn");
    target
}

#[test]
fn random_soups_cover_the_pixels_that_exact_arithmetic_says() {
    // Kind, triangles, least share of compared pixels, least covered pixels.
    for (kind, count, share, covered) in [
        (0, 300, 0.95, 5000),
        (1, 400, 0.95, 500),
        (2, 4000, 0.95, 500),
        (3, 40, 0.9, 5000),
        (4, 30, 0.9, 5000),
        (5, 60, 0.8, 2000),
        (6, 60, 0.8, 5000),
    ] {
        for seed in 0..3 {
            let (scene, shades) = (soup(kind, count, seed), [grey()]);
            let job = job(&scene, &shades, camera(1.25), 150, 120, ALL);
            let seen = common::reference::draw(&job);
            let difference = common::reference::compare(&seen, &draw(&job).triangle);
            println!("kind {kind} seed {seed}: {difference:?}");
            assert_eq!(difference.wrong, 0, "kind {kind} seed {seed}: {difference:?}");
            assert!(difference.compared as f64 >= share * 150.0 * 120.0, "kind {kind}: {difference:?}");
            assert!(difference.covered >= covered, "kind {kind}: {difference:?}");
        }
    }
}
