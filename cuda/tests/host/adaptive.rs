//! Adaptive sampling of stochastic glass: the paths of the device programs, compiled for the host, compared with those of the processor.

use super::compiled_with;
use super::glass::{Asked, SIZE, Scene, pixels_of, rasterised, several, with_job};
use super::lights::asked;
use super::ways::{dispersing, frosted};
use curitiba_passes::adaptive::{self, Sampling, sample_on_device};
use curitiba_passes::cpu;
use curitiba_pipeline::backend::{PathsSpent, RayCounts, RayJob, RayStats};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::glass::{GlassShadow, PathLimits, Roulette};
use curitiba_pipeline::image::Image;
use curitiba_pipeline::programs::{RayParams, RayProgram};
use std::path::Path;

/// An error that is not reached, and the number of paths that each pixel has then.
const ENOUGH: (f32, u32) = (0.001, 16);

/// The two pictures of a pass that samples glass to an error: how many pixels differ by more than a thousandth, and what each spent.
struct Compared {
    differ: u64,
    found: PathsSpent,
    expected: PathsSpent,
}

impl Compared {
    /// Whether the device program follows the paths of the processor. A pixel that is first found to be divided while its paths are followed gets
    /// fewer ways at once on the processor, so a few pixels may differ.
    fn agree(&self) -> bool {
        let Self { differ, found, expected } = self;
        let few = expected.pixels / 30;
        *differ <= few && found.pixels == expected.pixels && found.paths.abs_diff(expected.paths) <= expected.paths / 30
    }
}

/// Runs a pass in which each pixel has at most this number of paths, on both.
fn compare(program: &Path, scene: &Scene, asked: Asked<'_>, (error, paths): (f32, u32)) -> Compared {
    let tree = scene.tree();
    let seen = rasterised(scene, &tree);
    with_job(scene, &seen, asked, |job| {
        let job = &RayJob { params: RayParams { error, paths, ..job.params }, ..*job };
        let error = adaptive::asked(job).expect("its glass is stochastic");
        let progress = Progress::default();
        let [mut expected, mut found] = [(); 2].map(|()| Image::filled(SIZE, SIZE, [0.0; 4]));
        let theirs = cpu::trace(&tree, job, &mut expected, &progress).expect("the job is whole");
        let mut run = |job: &RayJob<'_>, sampling: Sampling<'_>, output: &mut Image| {
            let mut rays = RayCounts::default();
            for (output, pixel) in output.pixels.iter_mut().zip(pixels_of(program, job, sampling)) {
                *output = [0, 1, 2, 3].map(|channel| f32::from_bits(pixel[channel]));
                rays.reflected += u64::from(pixel[4]);
                rays.refracted += u64::from(pixel[5]);
            }
            Ok(RayStats { rays, ..RayStats::default() })
        };
        let mine = sample_on_device(job, error, (&mut found, &progress), &mut run, &|refused| panic!("{refused}"));
        let mine = mine.expect("the program runs");
        let pairs = || found.pixels.iter().zip(&expected.pixels);
        assert!(pairs().all(|(found, expected)| found[3] == expected[3]), "the fourth channel is that of a picture");
        let is_off = |(found, expected): &(&[f32; 4], &[f32; 4])| {
            found
                .iter()
                .zip(*expected)
                .map(|(found, expected)| (found - expected).abs())
                .any(|off| off > 1e-3 || off.is_nan())
        };
        let (found, expected) = (mine.adaptive.expect("it samples"), theirs.adaptive.expect("it samples"));
        println!(
            "{} pixels differ; {found}; {expected}; {:?} {:?}",
            pairs().filter(is_off).count(),
            mine.rays,
            theirs.rays
        );
        Compared { differ: pairs().filter(is_off).count() as u64, found, expected }
    })
}

/// A pass whose paths of little weight go on by chance.
fn by_chance(program: RayProgram) -> Asked<'static> {
    let mut asked = Asked { depth: 4, ..asked(program, GlassShadow::Straight, &[]) };
    asked.divided.limits = PathLimits { cutoff: 0.1, roulette: Roulette::On, ..PathLimits::DEFAULT };
    asked
}

/// A pass whose glass divides paths by colour, too.
fn by_color(program: RayProgram) -> Asked<'static> {
    let mut asked = Asked { depth: 2, ..asked(program, GlassShadow::Straight, &[]) };
    asked.divided.wavelengths = 8;
    asked
}

const SOURCES: [(RayProgram, &str); 2] =
    [(RayProgram::Refraction, "ways_refraction.cpp"), (RayProgram::Final, "ways_final.cpp")];

#[test]
fn paths_of_samples_are_those_of_the_processor() {
    for (program, source) in SOURCES {
        let Some(compiled) = compiled_with(source, "adaptive", None) else { return };
        let rough = Asked { depth: 2, ..asked(program, GlassShadow::Straight, &[]) };
        let cases = [
            (frosted(dispersing(several())), by_color(program), "both"),
            (several(), by_chance(program), "by chance"),
            (frosted(several()), rough, "rough"),
            (dispersing(several()), by_color(program), "dispersing"),
        ];
        // `final` follows paths through the same functions.
        let count = if program == RayProgram::Final { 2 } else { cases.len() };
        for (index, (scene, asked, what)) in cases.into_iter().take(count).enumerate() {
            // In the first case no pixel has all paths in the end, and rounds decide which get more.
            let limits = if index == 0 { (0.011, 256) } else { ENOUGH };
            let compared = compare(&compiled, &scene, asked, limits);
            let Compared { differ, found, expected } = &compared;
            assert!(compared.agree(), "{source}, {what}: {differ} pixels differ, {found:?} {expected:?}");
            assert!(found.pixels > 60 && found.mean() > 6.0, "{source}, {what}: {found:?}");
            assert!(index > 0 || (found.met && found.exhausted < found.pixels / 2), "{source}, {what}: {found:?}");
        }
    }
}

#[test]
fn a_wrong_word_of_samples_is_noticed() {
    let (rough, colors, chance) = (frosted(several()), frosted(dispersing(several())), several());
    let refraction = RayProgram::Refraction;
    let plain = Asked { depth: 2, ..asked(refraction, GlassShadow::Straight, &[]) };
    let mut unnoticed = Vec::new();
    for (scene, asked, change) in [
        (&rough, plain, ["now.path.sample = first + way;", "now.path.sample = way;"]),
        (&rough, plain, ["dimensions(now.path.key, HASH_FACET_ORDER).x", "0u"]),
        (&colors, by_color(refraction), ["float3 rest = splat(1.0f);", "float3 rest = splat(0.0f);"]),
        (&chance, by_chance(refraction), ["if (is_sample(params)) met |= MET_CHANCE;", ""]),
        (&chance, by_chance(refraction), ["path.sample == NO_WAY && first > 0 ? first : path.sample", "path.sample"]),
    ] {
        let Some(compiled) = compiled_with("ways_refraction.cpp", "adaptive-changed", Some(("ways.cuh", change)))
        else {
            return;
        };
        if compare(&compiled, scene, asked, ENOUGH).agree() {
            unnoticed.push(change);
        }
    }
    assert!(unnoticed.is_empty(), "{unnoticed:?}");
}
