//! The two rasterisers side by side: hills of 100,352 triangles, 1024 x 1024 pixels, all attachments.
//!
//! Threads: `RAYON_NUM_THREADS` for the processor, `LP_NUM_THREADS` for Mesa's software driver.

#[path = "../tests/raster/common/mod.rs"]
mod common;

use criterion::{Criterion, criterion_group, criterion_main};
use curitiba_passes::raster::cpu::CpuRasteriser;
use curitiba_passes::raster::gpu::{AdapterChoice, WgpuRasteriser};
use curitiba_pipeline::backend::{GBuffer, Rasteriser};
use std::sync::Arc;

const SIZE: u32 = 1024;

fn raster(criterion: &mut Criterion) {
    let (scene, view) = common::terrain(224);
    let (scene, shades) = (Arc::new(scene), [common::grey()]);
    let job = common::job(&scene, &shades, view, SIZE, SIZE, common::ALL);
    let mut target = GBuffer::new(SIZE, SIZE, common::ALL);
    let mut group = criterion.benchmark_group("raster/terrain");
    group.sample_size(20);
    let mut cpu = CpuRasteriser::new();
    println!("cpu: {}", cpu.device());
    cpu.upload(&scene).expect("uploads");
    group.bench_function("cpu/draw", |b| b.iter(|| cpu.draw(&job, &mut target).expect("draws")));
    match WgpuRasteriser::new(AdapterChoice::Any) {
        Ok(mut gpu) => {
            println!("wgpu: {}", gpu.device());
            group.bench_function("wgpu/upload", |b| b.iter(|| gpu.upload(&scene).expect("uploads")));
            gpu.upload(&scene).expect("uploads");
            group.bench_function("wgpu/draw", |b| b.iter(|| gpu.draw(&job, &mut target).expect("draws")));
            gpu.draw(&job, &mut target).expect("draws");
            group.bench_function("wgpu/read back", |b| {
                b.iter(|| gpu.read_back(&job, job.attachments, &mut target).expect("reads"))
            });
        }
        Err(error) => println!("skipped: {error}"),
    }
    group.finish();
}

criterion_group!(benches, raster);
criterion_main!(benches);
