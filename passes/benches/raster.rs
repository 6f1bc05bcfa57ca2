//! Milliseconds of a draw on the processor, by stage: a field of hills at 1024 x 1024, with three sets of attachments.
//!
//! `cargo bench -p curitiba-passes --bench raster [-- <million triangles>...]`; without arguments 0.1, 1 and 10.

#[path = "../tests/raster/common/mod.rs"]
mod common;

use curitiba_passes::raster::cpu::{CpuRasteriser, InstructionSet, Stages};
use curitiba_pipeline::backend::{Attachments, GBuffer, NO_TRIANGLE, Rasteriser};
use std::time::{Duration, Instant};

/// Number of draws, of which the fastest and the median are reported.
const DRAWS: usize = 40;

fn main() {
    let asked: Vec<f64> = std::env::args().skip(1).filter_map(|argument| argument.parse().ok()).collect();
    let asked = if asked.is_empty() { vec![0.1, 1.0, 10.0] } else { asked };
    let cores = std::thread::available_parallelism().map_or(1, |cores| cores.get());
    for millions in asked {
        let cells = if millions == 0.1 { 224 } else { (millions * 0.5e6).sqrt() as u32 };
        let (scene, view) = common::terrain(cells);
        let shades = [common::grey()];
        for (name, attachments) in [
            ("color position normal", Attachments { triangle: false, ..common::ALL }),
            ("all four", common::ALL),
            ("triangle", Attachments { triangle: true, ..Attachments::default() }),
        ] {
            let job = common::job(&scene, &shades, view, 1024, 1024, attachments);
            for threads in [1, cores] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
                for set in InstructionSet::ALL.into_iter().filter(|set| set.available()) {
                    let mut rasteriser = CpuRasteriser::with_instruction_set(set).expect("available");
                    let mut target = GBuffer::new(1024, 1024, attachments);
                    let draws = if millions > 5.0 { DRAWS / 4 } else { DRAWS };
                    let mut times: Vec<(Duration, Stages)> = (0..draws)
                        .map(|_| {
                            let start = Instant::now();
                            pool.install(|| rasteriser.draw(&job, &mut target)).expect("drawn");
                            (start.elapsed(), rasteriser.stages())
                        })
                        .collect();
                    times.sort_by_key(|(time, _)| *time);
                    let ms = |time: Duration| time.as_secs_f64() * 1e3;
                    let (best, stages) = times[0];
                    let covered = match attachments.triangle {
                        true => {
                            let covered = target.triangle.iter().filter(|id| **id != NO_TRIANGLE).count();
                            format!(", {:.0} % covered", covered as f64 / 10_485.76)
                        }
                        false => String::new(),
                    };
                    println!(
                        "{} triangles, {name}, {threads} threads, {}: best {:.2} ms (vertices {:.2}, bins {:.2}, tiles {:.2}), median {:.2} ms{covered}",
                        scene.geometry.triangles.len(),
                        set.name(),
                        ms(best),
                        ms(stages.vertices),
                        ms(stages.bins),
                        ms(stages.tiles),
                        ms(times[times.len() / 2].0),
                    );
                }
            }
        }
    }
}
