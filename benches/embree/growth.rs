//! Growth of our time with triangles and pixels, and its scaling with threads.

use crate::contest::{Contestant, Times, rounds};
use crate::duel::pool;
use crate::effects::{self, Picture};
use crate::rays::{self, Count, Mode};
use crate::scenes::{self, Subject};
use curitiba::environment::{Environment, peak_memory};
use curitiba::passes::cpu::CpuRays;
use curitiba::passes::trace::{Bvh, Quality};
use curitiba::pipeline::backend::RayBackend as _;
use serde::Serialize;

/// Triangles of the square in the series with a fixed number of pixels; the other two series use `USUAL`.
const TRIANGLES: [u32; 4] = [10_000, 100_000, 1_000_000, 10_000_000];
const USUAL: u32 = 100_000;

/// One kind of work at one point of a series.
#[derive(Serialize)]
struct Sample {
    work: &'static str,
    /// Number of rays asked for, including those that needed no tracing; for builds, number of triangles.
    count: u64,
    times: Times,
}

/// All kinds of work at one point.
#[derive(Serialize)]
struct Point {
    triangles: usize,
    /// Pixels along a side.
    size: u32,
    threads: usize,
    bytes_per_triangle: f64,
    load_average: Option<f64>,
    samples: Vec<Sample>,
}

/// The exponent of a power law through the points, by least squares of the logarithms.
#[derive(Serialize)]
struct Slope {
    work: &'static str,
    /// Exponent of the processor time.
    slope: f64,
    /// Greatest factor between a point and the fitted law.
    largest_factor: f64,
}

#[derive(Serialize)]
struct Efficiency {
    work: &'static str,
    threads: usize,
    /// Wall time of one thread, over the number of threads times the wall time of all.
    efficiency: f64,
    /// Processor time of one thread over that of all threads: the cost of sharing caches and memory.
    efficiency_cpu: f64,
}

/// The results file.
#[derive(Serialize)]
pub struct Growth {
    format: u32,
    command: String,
    started_unix_s: u64,
    environment: Environment,
    rounds: usize,
    peak_bytes: Option<u64>,
    triangles: Vec<Point>,
    triangle_slopes: Vec<Slope>,
    pixels: Vec<Point>,
    pixel_slopes: Vec<Slope>,
    threads: Vec<Point>,
    efficiencies: Vec<Efficiency>,
}

/// Measures the three series with at most `most` triangles.
///
/// # Errors
/// The reason why a scene cannot be prepared.
pub fn measure(command: String, size: u32, most: u32, threads: usize, count: usize) -> Result<Growth, String> {
    let mut growth = Growth {
        format: 1,
        command,
        started_unix_s: std::time::SystemTime::UNIX_EPOCH.elapsed().map_or(0, |time| time.as_secs()),
        environment: Environment::here(),
        rounds: count,
        peak_bytes: None,
        triangles: Vec::new(),
        triangle_slopes: Vec::new(),
        pixels: Vec::new(),
        pixel_slopes: Vec::new(),
        threads: Vec::new(),
        efficiencies: Vec::new(),
    };
    for triangles in TRIANGLES.into_iter().filter(|triangles| *triangles <= most) {
        let subject = scenes::open(&format!("square:{triangles}"), None, size)?;
        growth.triangles.push(point(&subject, size, 1, count)?);
    }
    growth.triangle_slopes = slopes(&growth.triangles, |point| point.triangles as f64);
    for size in [size / 4, size / 2, size, size * 2] {
        let subject = scenes::open(&format!("square:{USUAL}"), None, size)?;
        growth.pixels.push(point(&subject, size, 1, count)?);
    }
    growth.pixel_slopes = slopes(&growth.pixels, |point| f64::from(point.size).powi(2));
    let subject = scenes::open(&format!("square:{USUAL}"), None, size)?;
    for threads in 1..=threads {
        growth.threads.push(point(&subject, size, threads, count)?);
    }
    growth.efficiencies = efficiencies(&growth.threads);
    growth.peak_bytes = peak_memory();
    Ok(growth)
}

fn point(subject: &Subject, size: u32, threads: usize, count: usize) -> Result<Point, String> {
    let workers = pool(threads);
    let scene = &*subject.scene;
    let geometry = &scene.geometry;
    let bvh = workers.install(|| Bvh::build(geometry, &[], Quality::Balanced));
    let sets = rays::generate(subject, &bvh, size);
    let mut work: Vec<(&'static str, u64, Contestant<'_>)> = vec![(
        "build",
        geometry.triangles.len() as u64,
        Contestant::new("build", || Bvh::build(geometry, &[], Quality::Balanced).node_count() as u64),
    )];
    for set in sets.iter().filter(|set| matches!(set.name, "primary" | "shadow")) {
        let trace = || rays::ours(set, &bvh, Mode::Packets { coherent: true }, &Count);
        work.push((set.name, set.count, Contestant::new(set.name, trace)));
    }
    for (name, job) in subject.jobs.iter().filter(|(name, _)| *name != "shadows") {
        let mut backend = CpuRays::new();
        let built = workers.install(|| backend.build(&subject.scene, &job.filtered()));
        built.map_err(|error| error.to_string())?;
        let mut picture = Picture::new(job, scene);
        let pass = move || {
            effects::ours(&mut backend, job, scene, &mut picture);
            picture.rays.total() + picture.rays.certain
        };
        work.push((name, 0, Contestant::new(*name, pass)));
    }
    let (names, mut contestants): (Vec<_>, Vec<_>) =
        work.into_iter().map(|(name, rays, one)| ((name, rays), one)).unzip();
    rounds(&mut contestants, count, &workers);
    let mut samples = Vec::new();
    print!("{:9} triangles, {size:4} x {size:4}, {threads} threads:", geometry.triangles.len());
    for ((work, known), contestant) in names.into_iter().zip(&contestants) {
        print!("  {work} {:.1} ms", contestant.times.cost() * 1e3);
        let count = if known > 0 { known } else { contestant.result };
        samples.push(Sample { work, count, times: contestant.times.clone() });
    }
    println!();
    Ok(Point {
        triangles: geometry.triangles.len(),
        size,
        threads,
        bytes_per_triangle: bvh.bytes() as f64 / geometry.triangles.len() as f64,
        load_average: Environment::here().load_average,
        samples,
    })
}

/// The exponent of `y = c x^exponent` by least squares of the logarithms, and the greatest factor between a point and
/// the law.
fn power_law(points: &[(f64, f64)]) -> (f64, f64) {
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let mean = |value: fn(&(f64, f64)) -> f64| logs.iter().map(value).sum::<f64>() / logs.len() as f64;
    let (x, y) = (mean(|log| log.0), mean(|log| log.1));
    let across: f64 = logs.iter().map(|log| (log.0 - x) * (log.1 - y)).sum();
    let slope = across / logs.iter().map(|log| (log.0 - x).powi(2)).sum::<f64>();
    let off = logs.iter().map(|log| (log.1 - y - slope * (log.0 - x)).abs()).fold(0.0, f64::max);
    (slope, off.exp())
}

fn slopes(points: &[Point], value: fn(&Point) -> f64) -> Vec<Slope> {
    if points.len() < 2 {
        return Vec::new();
    }
    let works = points[0].samples.iter().map(|sample| sample.work).enumerate();
    let fit = |(index, work): (usize, &'static str)| {
        let of: Vec<(f64, f64)> =
            points.iter().map(|point| (value(point), point.samples[index].times.cost())).collect();
        let (slope, largest_factor) = power_law(&of);
        println!("  {work}: exponent {slope:.2}, at most a factor of {largest_factor:.2} off");
        Slope { work, slope, largest_factor }
    };
    works.map(fit).collect()
}

fn efficiencies(points: &[Point]) -> Vec<Efficiency> {
    let Some((first, others)) = points.split_first() else { return Vec::new() };
    let mut found = Vec::new();
    for point in others {
        for (alone, together) in first.samples.iter().zip(&point.samples) {
            let efficiency = alone.times.wall() / (point.threads as f64 * together.times.wall());
            let efficiency_cpu = alone.times.cost() / together.times.cost();
            println!(
                "  {} on {}: efficiency {efficiency:.2}, by processor time {efficiency_cpu:.2}",
                alone.work, point.threads
            );
            found.push(Efficiency { work: alone.work, threads: point.threads, efficiency, efficiency_cpu });
        }
    }
    found
}
