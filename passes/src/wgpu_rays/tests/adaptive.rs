//! Adaptive sampling of stochastic glass, compared with the processor: path by path, and as whole pictures.

use super::caustics::meshes;
use super::functions::answers;
use super::glass::{FEW, auto, several, several_of, shot, ways};
use super::pictures::differing;
use super::{picture, rays, rays_in_turn};
use crate::adaptive::Sampling;
use crate::cpu::{CpuRays, new_pass};
use crate::effects::dielectric::{Met, Sample, Variant};
use crate::effects::tests::world::{Shot, World, grid};
use crate::effects::{AlphaTested, Pixel, Workspace, combined, refraction};
use crate::raster::gpu::AdapterKind;
use crate::sampling::hash::{FACET_ORDER, FACETS, SPECTRUM, dimensions, pixel_key, unit};
use crate::sampling::owen_sobol::{laine_karras, reversed_sobol, scramble_reversed};
use crate::wgpu_rays::WgpuRays;
use crate::wgpu_rays::layout::BODY_HEAD;
use crate::wgpu_rays::programs::{Kind, Stage, source};
use crate::wgpu_rays::split::Split;
use curitiba_pipeline::backend::{NO_TRIANGLE, PathsSpent, RayBackend, RayJob};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::glass::{GlassShadow, PathLimits, Roulette};
use curitiba_pipeline::image::Image;
use curitiba_pipeline::programs::{Fidelity, RayParams, RayProgram, TextureLod};
use curitiba_pipeline::scene::RenderScene;
use glam::Vec3;
use std::cell::Cell;
use std::sync::Arc;

const EYE: Vec3 = Vec3::new(0.2, 0.4, 7.0);
/// Width of the pictures whose pixels are paths.
const WIDTH: usize = 64;

/// Ways of a pixel: the half, the number of the first way, and the number of ways.
const ASKED: [[u32; 3]; 8] =
    [[0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 2, 2], [0, 4, 4], [1, 4, 4], [0, 13, 1], [1, 1000, 3]];

const ROULETTE: PathLimits = PathLimits { cutoff: 0.1, roulette: Roulette::On, ..PathLimits::DEFAULT };

/// The G-buffer of some pixels of a job, in rows.
#[derive(Default)]
struct Paths {
    position: Vec<[f32; 4]>,
    normal: Vec<[f32; 4]>,
    color: Vec<[f32; 4]>,
    triangle: Vec<u32>,
    list: Vec<[u32; 4]>,
}

impl Paths {
    fn of(job: &RayJob<'_>, asked: &[(usize, [u32; 3])]) -> Self {
        let mut paths = Self::default();
        for (index, [half, first, ways]) in asked {
            paths.position.push(job.position[*index]);
            paths.normal.push(job.normal[*index]);
            paths.color.push(job.color[*index]);
            paths.triangle.push(job.triangle[*index]);
            let pixel = pixel_of(job, *index);
            paths.list.push([Sample::key_of_half(pixel_key(pixel.x, pixel.y, job.seed), *half), *first, *ways, 0]);
        }
        let all = asked.len().next_multiple_of(WIDTH);
        paths.position.resize(all, [0.0; 4]);
        paths.normal.resize(all, [0.0; 4]);
        paths.color.resize(all, [0.0; 4]);
        paths.triangle.resize(all, NO_TRIANGLE);
        paths.list.resize(all, [0; 4]);
        paths
    }

    fn run(&self, rays: &mut WgpuRays, job: &RayJob<'_>) -> Vec<[f32; 4]> {
        let job = RayJob {
            width: WIDTH as u32,
            height: (self.list.len() / WIDTH) as u32,
            position: &self.position,
            normal: &self.normal,
            color: &self.color,
            triangle: &self.triangle,
            ..*job
        };
        traced(rays, &job, Sampling::Listed(&self.list))
    }
}

fn traced(rays: &mut WgpuRays, job: &RayJob<'_>, sampling: Sampling<'_>) -> Vec<[f32; 4]> {
    let mut output = Image::filled(job.width, job.height, [f32::NAN; 4]);
    rays.trace(job, (sampling, None), Some(&mut output), &Progress::default()).expect("a complete job");
    output.pixels
}

fn pixel_of(job: &RayJob<'_>, index: usize) -> Pixel {
    Pixel { x: index as u32 % job.width, y: index as u32 / job.width, index }
}

/// What the processor's samples show and meet, with the fourth channel of a device's picture.
fn expected(world: &World, job: &RayJob<'_>, asked: &[(usize, [u32; 3])]) -> Vec<[f32; 4]> {
    let tree = world.tree();
    let coverage = AlphaTested { scene: job.scene, shades: job.shades };
    let pass = new_pass(job, &tree, coverage, None).expect("complete");
    let mut work = Workspace::default();
    work.begin();
    let mut sample = |(index, [half, first, ways]): &(usize, [u32; 3])| {
        let (met, pixel) = (Cell::new(Met::default()), pixel_of(job, *index));
        let sample = Sample { half: *half, first: *first, ways: *ways, offset: job.params.first_path, met: &met };
        let [red, green, blue, _] = match job.program {
            RayProgram::Final => combined::bodies::sample(&pass, pixel, sample, &mut work),
            _ => refraction::corrected::sample(&pass, pixel, sample, &mut work),
        };
        [red, green, blue, 1.0 + f32::from(met.get().bits())]
    };
    asked.iter().map(&mut sample).collect()
}

/// Follows some ways of all pixels that show glass, and compares colours and stochastic events with the processor's. `events` are the bits that many
/// paths must have. The test runs once for each of `rooms`: a greatest number of points in the list, or `None` for no limit.
fn same_paths(world: &World, program: RayProgram, params: RayParams, events: u8, rooms: &[Option<u32>]) -> Option<()> {
    let mut rays = rays_in_turn()?;
    let shot = shot(world, EYE);
    let scene: Arc<RenderScene> = Arc::new(world.scene.clone());
    let job = RayJob { scene: &scene, seed: 5, ..shot.job(program, Fidelity::Corrected, params) };
    rays.build(&scene, &vec![true; scene.materials.len()]).expect("built");
    let is_glass = |id: u32| id != NO_TRIANGLE && job.glass[scene.geometry.material_of(id) as usize];
    let glass: Vec<_> = (0..job.triangle.len()).filter(|index| is_glass(job.triangle[*index])).collect();
    // Each pixel twice, with different ways.
    let asked = (0..2 * glass.len()).map(|i| (glass[i / 2], ASKED[(i + i / 16) % ASKED.len()]));
    let asked: Vec<_> = asked.collect();
    assert!(asked.len() > 1000, "{}", asked.len());
    let expected = expected(world, &job, &asked);
    let with = |bit: u8| expected.iter().filter(|color| (color[3] as u8 - 1) & bit != 0).count();
    println!("{program:?}: {} paths, {} by chance, {} divided", asked.len(), with(1), with(2));
    for bit in [1, 2].into_iter().filter(|bit| events & bit != 0) {
        assert!(with(bit) > 100, "{program:?}: {} with {bit}", with(bit));
    }
    let paths = Paths::of(&job, &asked);
    for room in rooms {
        rays.room = *room;
        let found = paths.run(&mut rays, &job);
        rays.room = None;
        let off = differing(&found[..asked.len()], &expected, 0.01);
        println!("{program:?}: {off} paths are off, with room for {room:?} points");
        assert!(off <= FEW, "{program:?} {params:?} {room:?}: {off} paths are off");
        assert!(found[asked.len()..].iter().all(|color| *color == [0.0; 4]), "the rest shows nothing");
    }
    // Control: other ways of the same pixels.
    let other: Vec<_> = asked.iter().map(|(index, [half, first, ways])| (*index, [*half, first + 1, *ways])).collect();
    let found = Paths::of(&job, &other).run(&mut rays, &job);
    let changed = differing(&found[..asked.len()], &expected, 0.01);
    assert!(changed > 5 * FEW, "control: {program:?}: {changed} paths are off");
    // The first path of each pixel of the picture.
    if program == RayProgram::Refraction {
        let asked: Vec<_> = asked.iter().map(|(index, _)| (*index, [0, 0, 1])).collect();
        let picture = traced(&mut rays, &job, Sampling::First);
        let found: Vec<_> = asked.iter().map(|(index, _)| picture[*index]).collect();
        let off = differing(&found, &self::expected(world, &job, &asked), 0.01);
        assert!(off <= FEW, "{program:?} {params:?}: {off} first paths are off");
    }
    Some(())
}

#[test]
fn paths_of_a_sample_are_those_of_the_processor() {
    let rough = several_of(ways([0.2, 0.0, 0.3], [0.0; 3]));
    let flint = several_of(ways([0.0; 3], [0.15, 0.2, 0.0]));
    let both_ways = several_of(ways([0.1, 0.0, 0.2], [0.15, 0.2, 0.0]));
    let params = RayParams { paths: 4, wavelengths: 64, ..auto(2, GlassShadow::Report, 0) };
    let offset = RayParams { first_path: 24, first: 3, ..params };
    let limited = |params: RayParams| RayParams { limits: ROULETTE, ..params };
    for (world, params, events) in [
        (&rough, offset, 2),
        (&flint, RayParams { depth: 4, ..params }, 2),
        (&both_ways, limited(offset), 3),
        (&flint, limited(RayParams { wavelengths: 5, ..params }), 3),
        (&several(), limited(params), 1),
    ] {
        let Some(()) = same_paths(world, RayProgram::Refraction, params, events, &[None]) else { return };
    }
}

/// Whether there is no driver of a GPU: software drivers take many minutes for the kernels of `final` and for pictures of many paths.
fn is_slow() -> bool {
    let is_slow = rays().is_none_or(|rays| rays.gpu.adapter.kind == AdapterKind::Software);
    if is_slow {
        println!("skipped: software drivers take many minutes");
    }
    is_slow
}

#[test]
fn light_at_the_ends_of_a_samples_paths_is_that_of_the_processor() {
    if is_slow() {
        return;
    }
    let both_ways = several_of(ways([0.1, 0.0, 0.2], [0.15, 0.2, 0.0]));
    let params = RayParams { paths: 4, wavelengths: 64, limits: ROULETTE, ..auto(2, GlassShadow::Straight, 2) };
    // Without room for points, one thread computes each pixel.
    same_paths(&both_ways, RayProgram::Final, params, 3, &[None, Some(0)]);
}

/// The root mean square difference of the colours. The sum over all pixels is divided by this number of pixels.
fn off(found: &[[f32; 4]], expected: &[[f32; 4]], pixels: u64) -> f64 {
    let channels = |pair: (&[f32; 4], &[f32; 4])| (0..3).map(|i| f64::from(pair.0[i] - pair.1[i]).powi(2)).sum::<f64>();
    (found.iter().zip(expected).map(channels).sum::<f64>() / (3.0 * pixels as f64)).sqrt()
}

/// Calls `test` with a wgpu backend, a processor backend and a job of a few pixels of the world. `test` chooses the job's parameters.
fn with_both(world: &World, program: RayProgram, test: impl FnOnce(&mut WgpuRays, &mut CpuRays, &RayJob<'_>)) {
    let Some(mut rays) = rays_in_turn() else { return };
    let shot = Shot::of(world, EYE, grid(SIDE, EYE - Vec3::Z * 4.0, Vec3::X * 2.6, Vec3::Y * 2.2)).rows(SIDE);
    let scene: Arc<RenderScene> = Arc::new(world.scene.clone());
    let job = RayJob { scene: &scene, ..shot.job(program, Fidelity::Corrected, RayParams::default()) };
    let mut cpu = CpuRays::new();
    for backend in [&mut *rays as &mut dyn RayBackend, &mut cpu] {
        backend.build(&scene, &vec![true; scene.materials.len()]).expect("built");
    }
    test(&mut rays, &mut cpu, &job);
}

/// Side of the pictures that are sampled to an error.
const SIDE: u32 = 24;
const ALL: u64 = (SIDE * SIDE) as u64;

#[test]
fn a_picture_reaches_the_error_that_is_asked_for() {
    if is_slow() {
        return;
    }
    let params = RayParams { paths: 1024, limits: ROULETTE, ..auto(2, GlassShadow::Report, 0) };
    let rough = several_of(ways([0.1, 0.0, 0.15], [0.0; 3]));
    let both_ways = several_of(ways([0.1, 0.0, 0.2], [0.15, 0.2, 0.0]));
    let spectral = RayParams { wavelengths: 64, paths: 128, ..params };
    // The converged pictures: of all ways without roulette, and of many samples.
    let uniform = RayParams { paths: 4096, limits: PathLimits::DEFAULT, ..params };
    let samples = RayParams { error: 0.003, paths: 1 << 13, ..spectral };
    // The first picture reaches its error after some rounds; the second one has too few paths for it.
    for (world, params, converged, error) in [(&rough, params, uniform, 0.012), (&both_ways, spectral, samples, 0.004)]
    {
        with_both(world, RayProgram::Refraction, |rays, cpu, job| {
            let asked = RayJob { params: RayParams { error, ..params }, ..*job };
            let (found, stats) = picture(rays, &asked);
            let (theirs, of_processor) = picture(cpu, &asked);
            let (converged, _) = picture(cpu, &RayJob { params: converged, seed: 77, ..*job });
            let (plain, of_plain) = picture(rays, &RayJob { params: RayParams { paths: 64, ..params }, ..*job });
            let spent = stats.adaptive.expect("it is sampled");
            let expected = of_processor.adaptive.expect("it is sampled");
            let error_found = off(&found, &converged, spent.pixels);
            println!("{spent}\n{expected}\n{error_found}, {} pixels differ", differing(&found, &theirs, 0.001));
            println!("{:?}\n{:?}", stats.rays, of_processor.rays);
            let PathsSpent { met, pixels, paths, most, exhausted, .. } = spent;
            assert!((50..300).contains(&pixels) && paths >= 64 * pixels && most <= params.paths, "{spent}");
            assert!(paths > 64 * pixels, "{spent}: there are rounds");
            assert!(met == expected.met && exhausted.abs_diff(expected.exhausted) <= 6, "{spent}");
            let most_off = if met { 1.2 * f64::from(error) } else { 2.0 * spent.error };
            assert!(error_found < most_off, "{spent}: {error_found}");
            // Control: with one path a pixel, the error is far larger.
            let first = traced(rays, &RayJob { params: RayParams { paths: 4, ..params }, ..*job }, Sampling::First);
            let of_first = off(&first, &converged, pixels);
            assert!(of_first > 3.0 * error_found, "control: {of_first}");
            // The rounds are those of the processor, up to the pixels where the last bit decides.
            assert!(pixels.abs_diff(expected.pixels) <= 6 && paths.abs_diff(expected.paths) <= expected.paths / 10);
            assert!(differing(&found, &theirs, error) <= (pixels / 20) as usize);
            let close = stats.rays.refracted.abs_diff(of_processor.rays.refracted);
            assert!(close <= of_processor.rays.refracted / 10, "{:?} {:?}", stats.rays, of_processor.rays);
            // Pixels without stochastic glass are as without, and the others are not.
            let alike = ALL - differing(&found, &plain, 1e-6) as u64;
            assert!(alike >= ALL - pixels && alike < ALL - pixels / 2, "{alike}: {spent}");
            assert!(found.iter().zip(&plain).all(|(found, plain)| found[3] == plain[3]), "the fourth channel");
            assert!(of_plain.adaptive.is_none());
        });
    }
}

#[test]
fn glass_that_is_not_stochastic_is_not_sampled() {
    let params = RayParams { paths: 64, ..auto(2, GlassShadow::Report, 0) };
    with_both(&several(), RayProgram::Refraction, |rays, _, job| {
        let [(plain, of_plain), (found, stats)] =
            [0.0, 0.01].map(|error| picture(rays, &RayJob { params: RayParams { error, ..params }, ..*job }));
        assert!(found == plain && stats.rays == of_plain.rays && stats.adaptive.is_none());
    });
}

#[test]
fn photons_are_shot_once_for_all_rounds() {
    if is_slow() {
        return;
    }
    let params =
        RayParams { paths: 64, photons: 5000, limits: ROULETTE, error: 0.004, ..auto(2, GlassShadow::Caustic, 0) };
    with_both(&meshes(), RayProgram::Final, |rays, cpu, job| {
        let job = RayJob { params, ..*job };
        let [(found, mine), (expected, theirs)] = [picture(rays, &job), picture(cpu, &job)];
        println!("{:?}\n{:?}\n{:?} {:?}", mine.rays, theirs.rays, mine.adaptive, theirs.adaptive);
        assert_eq!(mine.rays.photons, theirs.rays.photons);
        assert!(mine.rays.photons.shot > 0 && mine.rays.photons.landed > 0, "{:?}", mine.rays.photons);
        assert!(mine.adaptive.is_some_and(|spent| spent.pixels > 20 && spent.paths > 4 * spent.pixels));
        let off = differing(&found, &expected, 0.01);
        assert!(off <= (ALL / 100) as usize, "{off} pixels are off");
    });
}

const ENTRY: &str = "
@compute @workgroup_size(64) fn functions(@builtin(global_invocation_id) id: vec3u) {
    let k = 2u * id.x;
    if k + params.zero >= arrayLength(&given) { return; }
    now.path.key = u32(given[k]) * 2654435761u;
    now.path.sample = u32(given[k + 1u]);
    let point = facet_point();
    put(3u * id.x, point.x);
    put(3u * id.x + 1u, point.y);
    found[3u * id.x + 2u] = stratum_of_way(now.path.sample);
}
";

#[test]
fn points_of_facets_and_strata_of_ways_are_those_of_the_processor() {
    let Some(rays) = rays() else { return };
    let cases: Vec<[f32; 2]> =
        (0..3000_u32).map(|i| [i.wrapping_mul(7919) % 100_003, i % 1025].map(|i| i as f32)).collect();
    let kind = Kind { sampled: true, ..Kind::plain(RayProgram::Refraction, Variant::Ways) };
    let text = source(kind, Stage::Whole, (rays.arithmetic, TextureLod::Zero), Split::default()).expect("written");
    // All parameters are 0 in this test; the settings lie behind the two words of samples.
    let text = text.replace("params.bodies_at", "(2u + params.zero)");
    for (offset, strata) in [(0, 256), (77, 37), (u32::MAX - 500, 2)] {
        let mut tables = vec![0, offset];
        // All settings have the number of strata.
        tables.resize(2 + BODY_HEAD as usize, strata);
        let expected: Vec<[u32; 3]> = cases
            .iter()
            .map(|[key, way]| {
                let (key, number) = ((*key as u32).wrapping_mul(2_654_435_761), offset.wrapping_add(*way as u32));
                let in_order = |order: u32| laine_karras(number.reverse_bits(), order).reverse_bits();
                let point = reversed_sobol(in_order(dimensions(key, FACET_ORDER)[0]));
                let (seeds, [seed, order]) = (dimensions(key, FACETS), dimensions(key, SPECTRUM));
                let [x, y] = [0, 1].map(|axis| unit(scramble_reversed(point[axis], seeds[axis])).to_bits());
                let place = scramble_reversed(in_order(order), seed);
                [x, y, ((u64::from(place) * u64::from(strata)) >> 32) as u32]
            })
            .collect();
        let off = |change: [&str; 2]| {
            assert!(text.contains(change[0]), "{change:?}");
            let text = text.replace(change[0], change[1]) + ENTRY;
            let found: Vec<[u32; 3]> = answers(&rays.gpu, text, (&[], &tables), &cases);
            found.iter().zip(&expected).filter(|(found, expected)| found != expected).count()
        };
        assert_eq!(off(["fn facet_point", "fn facet_point"]), 0, "{offset} {strata}");
        // Controls: each of these parts matters.
        for change in [
            ["dimensions(key, HASH_FACET_ORDER).x", "dimensions(key, HASH_FACETS).x"],
            ["v ^= v >> 4u & 0x0f0f0f0fu;", ""],
            ["in_order(way, seeds.y), seeds.x", "in_order(way, seeds.x), seeds.y"],
            ["reverseBits(tables[", "(tables["],
            ["now.path.key, HASH_SPECTRUM", "now.path.key, HASH_FACETS"],
        ] {
            let off = off(change);
            assert!(off > 500, "{change:?}: {off}");
        }
    }
}
