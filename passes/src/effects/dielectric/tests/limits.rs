//! Branches that are cut off: the colour that replaces them, and Russian roulette, which keeps the mean.

use super::spheres::{impact, look, run};
use super::*;
use curitiba_pipeline::glass::{CutoffColor, PathLimits, Roulette};

fn limited(depth: u32, limits: PathLimits) -> RayParams {
    RayParams { limits, ..auto(depth) }
}

/// A sphere of glass in an environment of 1.
fn white_sphere() -> World {
    let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
    let glass = world.dielectric(solid(1.5, Vec3::ZERO));
    world.sphere(glass, Vec3::ZERO, 1.0);
    world
}

#[test]
fn each_kind_of_bounce_has_its_own_limit() {
    let world = white_sphere();
    for b in [0.0, 0.5, 0.9] {
        let (r, _) = impact(b.into(), 1.5);
        let color = |limits: PathLimits| look(&world, Vec3::new(b, 0.0, 3.0), Vec3::NEG_Z, limited(16, limits)).0;
        for most in 0..6 {
            // Reflected once outside, or up to `most` times inside.
            let inside: f64 = (0..=most).map(|k| r.powi(k as i32)).sum();
            let outside = if most > 0 { r } else { 0.0 };
            let expected = (outside + (1.0 - r).powi(2) * inside) as f32;
            let found = color(PathLimits { reflections: most, ..PathLimits::DEFAULT });
            assert_close(found, Vec3::splat(expected), 3e-6, format!("{b}: {most} reflections"));
        }
        for (most, expected) in [(0, r), (1, r), (2, 1.0)] {
            let found = color(PathLimits { refractions: most, ..PathLimits::DEFAULT });
            assert_close(found, Vec3::splat(expected as f32), 3e-6, format!("{b}: {most} refractions"));
            // A branch that is cut off has the colour of the background, which everything has here.
            let cutoff_color = CutoffColor::Background;
            let found = color(PathLimits { refractions: most, cutoff_color, ..PathLimits::DEFAULT });
            assert_close(found, Vec3::ONE, 3e-6, format!("{b}: {most} refractions, background"));
        }
    }
}

#[test]
fn what_is_cut_off_is_missing_or_has_the_colour_that_stands_for_it() {
    let world = white_sphere();
    let (whole, all) = look(&world, Vec3::new(0.9, 0.0, 3.0), Vec3::NEG_Z, auto(16));
    let (r, _) = impact(0.9, 1.5);
    // Ways of weight R, (1 - R) R, and so on: those of R² and less are cut off.
    let cutoff = 0.9 * (r * (1.0 - r).powi(2)) as f32;
    assert!(f64::from(cutoff) > r * r * (1.0 - r));
    let at = |cutoff_color| {
        let limits = PathLimits { cutoff, cutoff_color, ..PathLimits::DEFAULT };
        look(&world, Vec3::new(0.9, 0.0, 3.0), Vec3::NEG_Z, limited(16, limits))
    };
    let (black, rays) = at(CutoffColor::Black);
    let expected = r + (1.0 - r).powi(2) * (1.0 + r);
    assert_close(black, Vec3::splat(expected as f32), 3e-6, "two ways inside");
    assert!(rays.total() < all.total() / 2, "{rays:?} {all:?}");
    assert_close(at(CutoffColor::Background).0, Vec3::from_slice(&whole), 3e-6, "the background stands for the rest");
}

/// Coloured walls around a body of glass, so that every branch has another colour.
fn colored() -> World {
    let mut world = World { beyond: Vec3::new(0.3, 0.7, 1.0), ..World::lit_along(Vec3::new(0.3, -0.4, -1.0)) };
    let glass = world.dielectric(solid(1.8, Vec3::new(0.1, 0.3, 0.6)));
    let paint = world.paint(Vec3::new(0.9, 0.5, 0.2));
    block(&mut world, glass, Vec3::ZERO, Vec3::new(1.0, 0.8, 0.6), true);
    world.quad(paint, Vec3::new(0.0, 0.0, -3.0), Vec3::X * 2.0, Vec3::Y * 2.0);
    world.quad(paint, Vec3::new(-3.0, 0.0, 0.0), Vec3::Y * 3.0, Vec3::Z * 3.0);
    world
}

#[test]
fn chance_keeps_the_mean_and_the_cutoff_alone_does_not() {
    let world = colored();
    let tree = world.tree();
    let eye = Vec3::new(1.5, 1.1, 4.0);
    let shot = Shot::of(&world, eye, [Vec3::new(0.2, 0.1, 0.6)]);
    let render = |seed: u32, limits: PathLimits| {
        let mut job = shot.job(RayProgram::Refraction, Corrected, limited(8, limits));
        job.seed = seed;
        let (pixels, rays) = shot.run_on(&tree, &job);
        (Vec3::from_slice(&pixels[0]).as_dvec3(), rays.total())
    };
    let (whole, all) = render(0, PathLimits::DEFAULT);
    let limits = PathLimits { cutoff: 0.2, roulette: Roulette::On, ..PathLimits::DEFAULT };
    let seeds = 4000;
    let (mut sum, mut squares, mut rays) = (glam::DVec3::ZERO, glam::DVec3::ZERO, 0);
    for seed in 0..seeds {
        let (color, traced) = render(seed, limits);
        sum += color;
        squares += color * color;
        rays += traced;
    }
    let count = f64::from(seeds);
    let mean = sum / count;
    let error = ((squares / count - mean * mean) / (count - 1.0)).to_array().map(|square| square.max(0.0).sqrt());
    let (biased, _) = render(0, PathLimits { roulette: Roulette::Off, ..limits });
    for channel in 0..3 {
        let (error, whole) = (error[channel], whole[channel]);
        assert!(error > 0.0 && (mean[channel] - whole).abs() < 4.0 * error, "{channel}: {mean} {whole} {error}");
        assert!((biased[channel] - whole).abs() > 10.0 * error, "control: {channel}: {biased} {whole} {error}");
    }
    assert!(rays < all * u64::from(seeds) / 3, "{rays} rays of {seeds} pictures, {all} of the whole");
}

#[test]
fn chance_depends_on_the_seed_alone() {
    let world = colored();
    let shot = Shot::of(&world, Vec3::new(1.5, 1.1, 4.0), (0..64).map(|i| Vec3::new(0.02 * i as f32 - 0.6, 0.1, 0.6)));
    let limits = PathLimits { cutoff: 0.3, roulette: Roulette::On, ..PathLimits::DEFAULT };
    let render = |first| {
        let params = RayParams { first, ..limited(6, limits) };
        run(&world, &shot, RayProgram::Refraction, params).0
    };
    assert_eq!(render(0), render(0));
    assert_ne!(render(0), render(16), "other samples of a pixel are other chances");
}
