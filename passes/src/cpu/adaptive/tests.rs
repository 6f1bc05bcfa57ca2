//! Adaptively sampled pictures against converged ones, over many seeds.

use crate::cpu;
use crate::effects::tests::world::{Shot, World};
use crate::trace::Bvh;
use curitiba_pipeline::backend::{PathsSpent, RayCounts, RayJob};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::glass::{Dielectric, GlassRule, PathLimits, Roulette, Shape};
use curitiba_pipeline::image::Image;
use curitiba_pipeline::programs::Fidelity::Corrected;
use curitiba_pipeline::programs::{RayParams, RayProgram};
use glam::{DVec3, Vec3, Vec4};

const SIDE: u32 = 14;

/// The most paths of a pixel in these tests.
const MOST: u32 = 4096;

fn params() -> RayParams {
    RayParams { glass: GlassRule::Auto, depth: 4, samples: 0, paths: MOST, ..RayParams::default() }
}

fn solid(index: f32) -> Dielectric {
    Dielectric { shape: Shape::Solid, index, filter: Vec3::ONE, ..Dielectric::default() }
}

/// A scene of stochastic glass.
struct Case {
    name: &'static str,
    world: World,
    params: RayParams,
    /// The error that is asked for.
    error: f32,
    /// Parameters of the converged picture, which is the mean over `seeds` seeds.
    converged: RayParams,
    seeds: u32,
}

fn stripes(world: &mut World) {
    world.beyond = Vec3::new(0.2, 0.3, 0.5);
    let paint = world.paint(Vec3::new(2.4, 2.0, 1.6));
    for column in -3..=3 {
        world.quad(paint, Vec3::new(0.8 * column as f32, 0.0, -3.0), Vec3::X * 0.2, Vec3::Y * 1.2);
    }
}

/// A frosted pane before stripes.
fn frosted() -> Case {
    let mut world = World::lit_along(Vec3::new(0.3, -0.4, -1.0));
    let glass = world.dielectric(Dielectric { alpha: 0.1, shape: Shape::Thin, ..solid(1.5) });
    world.quad(glass, Vec3::new(0.1, 0.0, 0.0), Vec3::X * 1.1, Vec3::Y * 1.1);
    stripes(&mut world);
    Case { name: "frosted pane", world, params: params(), error: 0.03, converged: params(), seeds: 8 }
}

/// A slightly rough pane before a stripe, which is seen through only a part of the pane.
fn stripe() -> Case {
    let mut world = World { beyond: Vec3::new(0.2, 0.3, 0.5), ..World::lit_along(Vec3::new(0.3, -0.4, -1.0)) };
    let glass = world.dielectric(Dielectric { alpha: 0.015, shape: Shape::Thin, ..solid(1.5) });
    world.quad(glass, Vec3::new(0.1, 0.0, 0.0), Vec3::X * 1.1, Vec3::Y * 1.1);
    let paint = world.paint(Vec3::new(2.4, 2.0, 1.6));
    world.quad(paint, Vec3::new(0.5, 0.3, -1.0), Vec3::X * 0.08, Vec3::Y * 0.6);
    Case { name: "stripe", world, params: params(), error: 0.01, converged: params(), seeds: 8 }
}

/// Walls of different colours around a block in which paths of little weight end by Russian roulette.
fn roulette() -> Case {
    let mut world = World::lit_along(Vec3::new(0.3, -0.4, -1.0));
    let glass = world.dielectric(Dielectric { extinction: Vec3::new(0.1, 0.3, 0.6), ..solid(1.8) });
    let half = Vec3::new(1.0, 0.8, 0.6);
    for (x, y, z) in [(Vec3::X, Vec3::Y, Vec3::Z), (Vec3::Y, Vec3::Z, Vec3::X), (Vec3::Z, Vec3::X, Vec3::Y)] {
        for side in [1.0, -1.0] {
            world.quad(glass, z * half * side, x * half * side, y * half);
        }
    }
    stripes(&mut world);
    let limits = PathLimits { cutoff: 0.2, roulette: Roulette::On, ..PathLimits::DEFAULT };
    Case {
        name: "roulette",
        world,
        params: RayParams { limits, ..params() },
        error: 0.005,
        converged: params(),
        seeds: 1,
    }
}

/// A prism before stripes.
fn prism() -> Case {
    let mut world = World::lit_along(Vec3::new(0.3, -0.4, -1.0));
    let glass = world.dielectric(Dielectric { spread: 0.06, ..solid(1.6) });
    let corners = [Vec3::new(-1.0, 0.0, 0.8), Vec3::new(1.1, 0.0, 0.5), Vec3::new(0.2, 0.0, -0.9)];
    for (from, to) in [(0, 1), (1, 2), (2, 0)].map(|(from, to)| (corners[from], corners[to])) {
        world.quad(glass, from.midpoint(to), (to - from) * 0.5, Vec3::Y);
    }
    let up = corners.map(|corner| corner + Vec3::Y);
    let [a, b, c] = corners.map(|corner| corner - Vec3::Y);
    world.triangle(glass, up, [Vec3::Y; 3]);
    world.triangle(glass, [a, c, b], [Vec3::NEG_Y; 3]);
    stripes(&mut world);
    let params = RayParams { wavelengths: 256, ..params() };
    Case { name: "prism", world, params, error: 0.002, converged: params, seeds: 1 }
}

impl Case {
    fn shot(&self, side: u32) -> Shot<'_> {
        let at = move |i: u32| 2.6 * ((i as f32 + 0.5) / side as f32 - 0.5);
        let targets = (0..side * side).map(|i| Vec3::new(at(i % side), at(i / side), 0.6));
        Shot::of(&self.world, Vec3::new(0.3, 0.5, 6.0), targets).rows(side)
    }

    fn adaptive(&self) -> RayParams {
        RayParams { error: self.error, ..self.params }
    }

    /// The converged picture.
    fn converged(&self, shot: &Shot<'_>, tree: &Bvh) -> Pictures {
        let mut pictures = Pictures::default();
        for seed in 0..self.seeds {
            let (pixels, _, spent) = run(shot, tree, RayProgram::Refraction, (self.converged, 1000 + seed));
            assert_eq!(spent, None);
            pictures.add(&pixels);
        }
        pictures
    }
}

/// The same picture with several seeds.
#[derive(Default)]
struct Pictures {
    count: u32,
    sums: Vec<[DVec3; 2]>,
}

impl Pictures {
    fn add(&mut self, picture: &[DVec3]) {
        self.count += 1;
        self.sums.resize(picture.len(), [DVec3::ZERO; 2]);
        for ([sum, squares], pixel) in self.sums.iter_mut().zip(picture) {
            *sum += *pixel;
            *squares += *pixel * *pixel;
        }
    }

    fn mean(&self) -> Vec<DVec3> {
        self.sums.iter().map(|[sum, _]| *sum / f64::from(self.count)).collect()
    }

    /// The squares of the standard errors of the mean; 0 for a single picture.
    fn variances(&self) -> Vec<DVec3> {
        let count = f64::from(self.count);
        let variance = |[sum, squares]: &[DVec3; 2]| {
            (*squares / count - *sum * *sum / (count * count)).max(DVec3::ZERO) / (count - 1.0).max(1.0)
        };
        self.sums.iter().map(variance).collect()
    }

    /// Mean squared difference to other pictures, in units of the squared standard error: 1 if the means agree. Values without noise are left out.
    fn score(&self, others: &Self) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        let means = self.mean().into_iter().zip(others.mean());
        for ((one, other), (a, b)) in means.zip(self.variances().into_iter().zip(others.variances())) {
            for channel in 0..3 {
                let variance = a[channel] + b[channel];
                if variance > 1e-12 {
                    sum += (one[channel] - other[channel]).powi(2) / variance;
                    count += 1.0;
                }
            }
        }
        assert!(count > 50.0, "{count} values have noise");
        sum / count
    }
}

fn run(
    shot: &Shot<'_>,
    tree: &Bvh,
    program: RayProgram,
    (params, seed): (RayParams, u32),
) -> (Vec<DVec3>, RayCounts, Option<PathsSpent>) {
    let job = RayJob { seed, ..shot.job(program, Corrected, params) };
    let mut output = Image::filled(job.width, job.height, [f32::NAN; 4]);
    let stats = cpu::trace(tree, &job, &mut output, &Progress::default()).expect("a complete job");
    let pixels = output.pixels.iter().map(|pixel| Vec4::from_array(*pixel).truncate().as_dvec3());
    (pixels.collect(), stats.rays, stats.adaptive)
}

/// The root mean square difference over `pixels` pixels.
fn off(found: &[DVec3], expected: &[DVec3], pixels: u64) -> f64 {
    let sum: f64 = found.iter().zip(expected).map(|(a, b)| (*a - *b).length_squared()).sum();
    (sum / (3.0 * pixels as f64)).sqrt()
}

#[test]
fn the_error_is_met_in_95_of_100_seeds_and_the_mean_is_that_of_all_paths() {
    for case in [frosted(), roulette(), prism()] {
        let (shot, tree) = (case.shot(SIDE), case.world.tree());
        let converged = case.converged(&shot, &tree);
        let expected = converged.mean();
        let (mut pictures, mut within, mut paths, mut squares) = (Pictures::default(), 0, 0.0, 0.0);
        for seed in 0..100 {
            let (found, _, spent) = run(&shot, &tree, RayProgram::Refraction, (case.adaptive(), seed));
            let spent = spent.expect("it is sampled");
            assert!(spent.met && spent.pixels > 50 && spent.paths >= 4 * spent.pixels, "{}: {spent}", case.name);
            let error = off(&found, &expected, spent.pixels);
            within += u32::from(error <= f64::from(case.error));
            (paths, squares) = (paths + 0.01 * spent.mean(), squares + 0.01 * error * error);
            pictures.add(&found);
        }
        let score = pictures.score(&converged);
        assert!(within >= 95, "{}: {within}", case.name);
        assert!(score < 1.5, "{}: {score}", case.name);
        // The error is not met by overspending. The prism is exempt: its first paths already show most of the spectrum.
        let reached = squares.sqrt() / f64::from(case.error);
        assert!(reached > 0.6 || case.name == "prism", "{}: {reached}, {paths} paths", case.name);
        let brighter = Pictures {
            sums: converged.sums.iter().map(|[sum, squares]| [*sum * 1.03, *squares]).collect(),
            ..converged
        };
        let control = pictures.score(&brighter);
        assert!(control > 3.0, "control: {}: {control}", case.name);
    }
}

#[test]
fn where_a_part_is_noisy_less_than_two_thirds_of_the_paths_of_uniform_sampling_are_spent() {
    let case = stripe();
    let (shot, tree) = (case.shot(2 * SIDE), case.world.tree());
    let expected = case.converged(&shot, &tree).mean();
    let seeds = 6;
    let of_seeds = |params: RayParams| {
        let (mut squares, mut paths, mut within) = (0.0, 0.0, 0);
        for seed in 0..seeds {
            let (found, _, spent) = run(&shot, &tree, RayProgram::Refraction, (params, seed));
            let error = off(&found, &expected, shot.color.len() as u64);
            squares += error * error / f64::from(seeds);
            within +=
                u32::from(spent.is_some_and(|spent| off(&found, &expected, spent.pixels) <= f64::from(case.error)));
            paths += spent.map_or(f64::from(params.paths), |spent| spent.mean()) / f64::from(seeds);
        }
        (squares.sqrt(), paths, within)
    };
    let (reached, spent, within) = of_seeds(case.adaptive());
    // Uniform sampling runs without `error=`. Between two powers of two, its error is interpolated as a power of the number of paths.
    let mut before: Option<(f64, f64)> = None;
    let mut needed = None;
    for paths in (3..=12).map(|power| 1 << power) {
        let (error, paths, _) = of_seeds(RayParams { paths, ..case.params });
        if let Some((more, fewer)) = before.filter(|_| error <= reached) {
            let share = (more / reached).ln() / (more / error).ln();
            needed = Some(fewer * (paths / fewer).powf(share));
            break;
        }
        before = Some((error, paths));
    }
    let needed = needed.expect("uniform sampling reaches the error");
    assert!(within + 1 >= seeds, "{within} of {seeds}");
    // Measured: 0.605 of the paths of uniform sampling.
    assert!(spent < 2.0 / 3.0 * needed, "{spent} of {needed} for {reached}");
}

#[test]
fn the_picture_the_rays_and_what_was_spent_do_not_depend_on_the_threads() {
    let case = prism();
    let (shot, tree) = (case.shot(SIDE), case.world.tree());
    let render = |threads, seed| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
        pool.install(|| run(&shot, &tree, RayProgram::Final, (RayParams { samples: 4, ..case.adaptive() }, seed)))
    };
    let one = render(1, 7);
    assert!(one.2.is_some_and(|spent| spent.pixels > 50 && spent.most > 8), "{:?}", one.2);
    assert_eq!([render(3, 7), render(16, 7)], [one.clone(), one.clone()]);
    assert_ne!(render(3, 8).0, one.0, "control: another seed");
}

/// A clear face and a frosted pane before a wall.
#[test]
fn what_has_no_stochastic_glass_is_as_without_to_the_bit() {
    let world = |alpha: f32| {
        let mut world = World { beyond: Vec3::new(0.2, 0.3, 0.5), ..World::lit_along(Vec3::new(0.3, -0.4, -1.0)) };
        let clear = world.dielectric(solid(1.5));
        let pane = world.dielectric(Dielectric { alpha, shape: Shape::Thin, ..solid(1.5) });
        let paint = world.paint(Vec3::new(0.9, 0.5, 0.2));
        world.quad(clear, Vec3::new(-0.6, 0.0, 0.0), Vec3::X * 0.5, Vec3::Y);
        world.quad(pane, Vec3::new(0.6, 0.0, 0.0), Vec3::X * 0.5, Vec3::Y * 0.6);
        world.quad(paint, Vec3::new(0.0, 0.0, -2.0), Vec3::X * 2.0, Vec3::Y * 2.0);
        world
    };
    let (world, without) = (world(0.1), world(0.0));
    for program in [RayProgram::Refraction, RayProgram::Final] {
        let params = RayParams { samples: 4, paths: 64, ..params() };
        let render = |world: &World, error| {
            let at = |i: u32| 2.6 * ((i as f32 + 0.5) / SIDE as f32 - 0.5);
            let shot = Shot::of(
                world,
                Vec3::new(0.3, 0.5, 6.0),
                (0..SIDE * SIDE).map(|i| Vec3::new(at(i % SIDE), at(i / SIDE), 0.6)),
            );
            run(&shot.rows(SIDE), &world.tree(), program, (RayParams { error, ..params }, 3))
        };
        let [plain, sampled] = [0.0, 0.02].map(|error| render(&world, error));
        let spent = sampled.2.expect("it is sampled");
        let alike = plain.0.iter().zip(&sampled.0).filter(|(one, other)| one == other).count() as u64;
        let all = u64::from(SIDE * SIDE);
        assert!(spent.pixels > 20 && spent.pixels < all / 2, "{spent}");
        assert!(alike >= all - spent.pixels && alike < all, "{alike} of {all}: {spent}");
        assert_eq!(plain.2, None);
        // A scene without stochastic glass traces the same rays with `error=` as without.
        assert_eq!(render(&without, 0.02), render(&without, 0.0));
    }
}

#[test]
fn an_error_that_the_most_paths_do_not_reach_is_said_to_be_not_met() {
    let case = frosted();
    let (shot, tree) = (case.shot(SIDE), case.world.tree());
    let params = RayParams { error: 1e-4, paths: 9, ..case.params };
    let spent = run(&shot, &tree, RayProgram::Refraction, (params, 0)).2.expect("it is sampled");
    assert!(!spent.met && spent.most == 8 && spent.exhausted == spent.pixels, "{spent:?}");
    assert!(spent.error > 0.01 && spent.to_string().starts_with("ERROR NOT MET, paths ran out"), "{spent}");
}
