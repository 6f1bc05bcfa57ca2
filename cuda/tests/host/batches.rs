//! Batches of the Sobol sequences: the points that the headers take from the table of a batch, and the programs that run on one batch, are
//! compared with the processor's.

use super::glass::{Asked, ROUNDING, Scene, differences, each_pixel, several};
use super::lights::asked;
use super::{Random, compiled_with, run};
use curitiba_cuda::sobol_table::table;
use curitiba_passes::sampling::HemisphereSampler;
use curitiba_pipeline::glass::GlassShadow;
use curitiba_pipeline::programs::{RayProgram, Sampler};
use std::path::Path;

/// Sizes of successive batches. Some are powers of 4 and some are not; some start at a multiple of their size and some do not. One has several
/// blocks.
const BATCHES: [u32; 7] = [4, 12, 7, 25, 16, 64, 333];

fn sampler(first: u32, samples: u32) -> HemisphereSampler {
    HemisphereSampler::from(Sampler::Sobol, first, samples).expect("far from the end of the sequence")
}

/// The device's table for the `samples` points after the first `first` ones of the sequence.
fn table_of(first: u32, samples: u32) -> Vec<u32> {
    match sampler(first, samples) {
        HemisphereSampler::Sobol(points) => table(points),
        HemisphereSampler::Strata { .. } => unreachable!("Sobol points were asked for"),
    }
}

/// The bits of points, in order.
fn sorted(mut points: Vec<[u32; 2]>) -> Vec<[u32; 2]> {
    points.sort_unstable();
    points
}

fn points_of_processor(sampler: &HemisphereSampler, key: u32) -> Vec<[u32; 2]> {
    let mut points = Vec::new();
    sampler.points(key, |point| points.push(point.to_array().map(f32::to_bits)));
    points
}

/// The points of a key in two orders: that of warps which trace the rays of many points together, and that of rays of one point after the
/// other.
fn points_of_device(program: &Path, table: &[u32], samples: u32, key: u32) -> [Vec<[u32; 2]>; 2] {
    let mut input = vec![samples, key, table.len() as u32];
    input.extend(table);
    let found = run(program, "turns", &input);
    let found = found.as_chunks::<4>().0;
    assert_eq!(found.len(), samples as usize);
    [0, 2].map(|at| found.iter().map(|words| [words[at], words[at + 1]]).collect())
}

/// Number of batches and keys for which the device's points differ from the processor's. A key also counts if all its batches together do
/// not give the points of the whole sequence.
fn batches_that_differ(program: &Path, table_of: impl Fn(u32, u32) -> Vec<u32>) -> usize {
    let (mut random, mut differ) = (Random(31), 0);
    for key in [0; 6].map(|_| random.bits()) {
        let (mut first, mut all) = (0, Vec::new());
        for samples in BATCHES {
            let expected = points_of_processor(&sampler(first, samples), key);
            let [together, alone] = points_of_device(program, &table_of(first, samples), samples, key);
            // The rays of one point also have the processor's order.
            differ += usize::from(alone != expected || sorted(together.clone()) != sorted(expected));
            all.extend(together);
            first += samples;
        }
        differ += usize::from(sorted(all) != sorted(points_of_processor(&sampler(0, first), key)));
    }
    differ
}

/// For batches that are one block: how many points of two keys at the same turn lie in different squares, and how many were compared.
fn turns_apart(program: &Path) -> [usize; 2] {
    let (mut random, mut apart, mut all) = (Random(32), 0, 0);
    for (first, digits) in [(0, 1), (12, 1), (16, 2), (64, 3), (1024, 4)] {
        let samples = 1 << (2 * digits);
        let table = table_of(first, samples);
        let turns = [0; 2].map(|_| points_of_device(program, &table, samples, random.bits())[0].clone());
        let square = |point: &[u32; 2]| point.map(|bits| (f32::from_bits(bits) * (1 << digits) as f32) as u32);
        apart += turns[0].iter().zip(&turns[1]).filter(|(a, b)| square(a) != square(b)).count();
        all += samples as usize;
    }
    [apart, all]
}

#[test]
fn batches_of_the_sequence_have_the_processors_points_on_the_device() {
    let Some(program) = compiled_with("functions.cpp", "turns", None) else { return };
    assert_eq!(batches_that_differ(&program, table_of), 0);
    assert_eq!(turns_apart(&program), [0, 4 + 4 + 16 + 64 + 256]);
    // As a negative control, every batch gets the first points of the sequence.
    assert!(batches_that_differ(&program, |_, samples| table_of(0, samples)) > 30);
    for (name, change) in [
        ("turns-blocks", ["return first + (spread_bits(x)", "return (spread_bits(x)"]),
        ("turns-digits", ["scramble_reversed(sobol.y, seeds.y)", "scramble_reversed(sobol.y, seeds.x)"]),
    ] {
        let changed = compiled_with("functions.cpp", name, Some(("fan.cuh", change))).expect("there is a compiler");
        assert!(batches_that_differ(&changed, table_of) > 0, "{change:?} is not noticed");
    }
    // The same points in another order.
    let change = ["unscramble_reversed(even_bits(square), seeds.x, digits)", "even_bits(square)"];
    let changed =
        compiled_with("functions.cpp", "turns-order", Some(("fan.cuh", change))).expect("there is a compiler");
    assert!(
        batches_that_differ(&changed, table_of) == 0 && turns_apart(&changed)[0] > 100,
        "{change:?} is not noticed"
    );
}

/// The programs that take samples: of occlusion and of a light's disc.
const PROGRAMS: [(RayProgram, &str, f32); 3] = [
    (RayProgram::Ssao, "occlusion.cpp", 0.0),
    (RayProgram::DeferredShadows, "lights_shadows.cpp", 12.0),
    (RayProgram::Final, "lights_final.cpp", 12.0),
];

/// A batch of `samples` occlusion samples after `after` earlier ones. A disc has five samples.
fn batch(program: RayProgram, sun: f32, after: u32, samples: u32) -> Asked<'static> {
    Asked { sun, samples, after: Some(after), ..asked(program, GlassShadow::Straight, &[]) }
}

/// The device program's result for each pixel.
fn picture(program: &Path, scene: &Scene, asked: Asked<'_>) -> Vec<[u32; 3]> {
    let mut picture = Vec::new();
    each_pixel(program, scene, asked, |_, _, [found, _]| picture.push(found.to_array().map(f32::to_bits)));
    picture
}

#[test]
fn programs_on_a_batch_of_a_sequence_compute_what_the_processors_do() {
    let scene = several();
    for (program, source, sun) in PROGRAMS {
        let Some(compiled) = compiled_with(source, "batches", None) else { return };
        let mut pictures = Vec::new();
        for (after, samples) in [(0, 7), (7, 25), (32, 16)] {
            let asked = batch(program, sun, after, samples);
            let (largest, counts, _) = differences(&compiled, &scene, asked);
            let what = format!("{program:?}, {samples} after {after}");
            assert!(largest < ROUNDING && counts == 0, "{what}: {largest}, {counts} counts differ");
            assert!(program == RayProgram::Final || largest == 0.0, "{what}: {largest}");
            pictures.push(picture(&compiled, &scene, asked));
        }
        // The same number of samples from another place in the sequence gives other pixels.
        let others = picture(&compiled, &scene, batch(program, sun, 100, 7));
        let differ = pictures[0].iter().zip(&others).filter(|(a, b)| a != b).count();
        assert!(differ > 20, "{program:?}: {differ} pixels differ");
    }
}
