//! Rough bodies and walls.

use super::*;
use curitiba_pipeline::glass::strata;

fn rough(alpha: f32, index: f32) -> Dielectric {
    Dielectric { alpha, ..solid(index, Vec3::ZERO) }
}

fn paths(paths: u32, depth: u32) -> RayParams {
    RayParams { paths, ..auto(depth) }
}

/// One face of an infinite body: light of 1 above it, and below it a floor of the brightness `below`.
fn face(alpha: f32, below: f32) -> World {
    let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::Y) };
    let glass = world.dielectric(rough(alpha, 1.5));
    world.quad(glass, Vec3::ZERO, Vec3::X * 300.0, Vec3::Y * 300.0);
    // Ambient light alone: 0.3 of the colour.
    let floor = world.paint(Vec3::splat(below / 0.3));
    world.quad(floor, Vec3::Z * -1.0, Vec3::X * 900.0, Vec3::Y * 900.0);
    world
}

/// R + T / n² with light of 1 on both sides: .466667 would be lossless. Values of Mitsuba 3.9.1, each within .0009.
#[test]
fn a_rough_face_in_white_light_loses_what_single_scattering_loses() {
    for (alpha, expected) in [(0.05, 0.46737), (0.1, 0.46668), (0.2, 0.46364), (0.3, 0.45917), (0.5, 0.44592)] {
        let world = face(alpha, 1.0 / 2.25);
        let shots = (0..16).map(|step| Vec3::new(0.3 + 0.1 * step as f32, 0.4, 5.0));
        let found: Vec<f32> = shots.map(|eye| look(&world, eye, Vec3::NEG_Z, paths(4096, 5)).0[1]).collect();
        let mean = found.iter().sum::<f32>() / found.len() as f32;
        let scatter = found.iter().map(|value| (value - mean).powi(2)).sum::<f32>() / 15.0 / 16.0;
        let tolerance = 9e-4 + 3.0 * scatter.sqrt();
        assert!((mean - expected).abs() < tolerance && tolerance < 1.5e-3, "{alpha}: {mean} ± {tolerance}");
    }
}

#[test]
fn rough_glass_never_gains_light() {
    for (alpha, depth) in [(1e-4, 5), (0.05, 0), (0.3, 3), (1.0, 2)] {
        let mut world = World { beyond: Vec3::ONE, ..World::lit_along(Vec3::NEG_Z) };
        let glass = world.dielectric(Dielectric { spread: 0.02, ..rough(alpha, 1.5) });
        let water = world.dielectric(rough(alpha * 0.5, 1.33));
        let wall = world.dielectric(Dielectric { alpha, ..thin(1.5) });
        ball(&mut world, glass, Vec3::ZERO, 1.0, 3);
        ball(&mut world, water, Vec3::new(0.1, 0.0, 0.0), 0.7, 3);
        world.quad(wall, Vec3::new(0.0, 0.0, 1.5), Vec3::X * 2.0, Vec3::Y * 2.0);
        let mut brightest = 0.0_f32;
        for step in 0..8 {
            let eye = Vec3::new(0.13 * step as f32, 0.03, 3.0);
            let params = RayParams { wavelengths: 3, ..paths(8, depth) };
            let (pixel, _) = look(&world, eye, Vec3::NEG_Z, params);
            brightest = brightest.max(Vec3::from_slice(&pixel).max_element());
        }
        assert!(brightest < 1.0 + 1e-5, "alpha {alpha}: {brightest}");
        // Nearly smooth glass loses hardly more light than its coarse triangles send to the wrong side.
        assert!(brightest > if alpha < 0.1 { 0.99 } else { 0.2 }, "alpha {alpha}: {brightest}");
    }
}

/// The light that a rough wall scatters has the same sum as that of a smooth wall, where facets hide nothing.
#[test]
fn a_frosted_wall_scatters_what_it_reflects_and_what_it_lets_through() {
    let place = |alpha: f32| {
        let mut world = World::lit_along(Vec3::Y);
        let glass = world.dielectric(Dielectric { alpha, ..thin(1.5) });
        let (front, behind) = (world.paint(FRONT), world.paint(BEHIND));
        world.quad(glass, Vec3::ZERO, Vec3::X * 300.0, Vec3::Y * 300.0);
        world.quad(front, Vec3::Z * 9.0, Vec3::X * 900.0, Vec3::NEG_Y * 900.0);
        world.quad(behind, Vec3::Z * -9.0, Vec3::X * 900.0, Vec3::Y * 900.0);
        world
    };
    let smooth = Vec3::from_slice(&look(&place(0.0), Vec3::new(0.3, 0.4, 5.0), down(20.0), paths(256, 5)).0);
    // The tail of GGX: two facets in ten thousand are so steep that they send light into the wall.
    let (pixel, rays) = look(&place(0.01), Vec3::new(0.3, 0.4, 5.0), down(20.0), paths(4096, 5));
    assert_close(pixel, smooth, 3e-4, "both sides are of one colour each");
    assert!(rays.reflected > 4086 && rays.refracted > 4086 && rays.reflected <= 4096, "{rays:?}");
    // In front of a small bright square the wall blurs: much of the light comes from the darker wall around the square.
    let blurred = |alpha: f32| {
        let mut world = place(alpha);
        let dot = world.paint(Vec3::ONE);
        world.quad(dot, Vec3::Z * -8.0, Vec3::X * 0.3, Vec3::Y * 0.3);
        Vec3::from_slice(&look(&world, Vec3::new(0.01, 0.02, 5.0), Vec3::NEG_Z, paths(256, 5)).0).x
    };
    let [sharp, soft] = [0.0, 0.2].map(blurred);
    assert!(sharp > 0.28 && soft < 0.2 && soft > 0.03, "{sharp} {soft}");
}

#[test]
fn smooth_glass_beside_rough_is_as_it_was_to_the_bit() {
    let place = |alpha: f32| {
        let mut world = World::lit_along(Vec3::new(0.3, -1.0, 0.4));
        let plain = world.dielectric(Dielectric { spread: 0.02, ..solid(1.5, Vec3::new(0.1, 0.2, 0.3)) });
        let other = world.dielectric(rough(alpha, 1.6));
        ball(&mut world, plain, Vec3::new(-1.5, 0.0, 0.0), 1.0, 3);
        ball(&mut world, other, Vec3::new(60.0, 0.0, 0.0), 1.0, 3);
        room(&mut world);
        world
    };
    let render = |world: &World, x: f32, samples: u32| {
        let targets = (0..16).map(|i| Vec3::new(x + (i % 4) as f32 * 0.4 - 0.6, (i / 4) as f32 * 0.4 - 0.6, 0.1));
        let shot = Shot::of(world, Vec3::new(x, 0.2, 7.0), targets);
        shot.run_on(&world.tree(), &shot.job(RayProgram::Final, Corrected, RayParams { samples, ..paths(4, 3) }))
    };
    let [frosted, clear] = [place(0.3), place(0.0)];
    assert_eq!(render(&frosted, -1.5, 4), render(&clear, -1.5, 4), "the same rays, too");
    let [(one, many), (other, few)] = [&frosted, &clear].map(|world| render(world, 60.0, 4));
    assert!(one != other && many.refracted > 3 * few.refracted, "control: {many:?} {few:?}");
}

/// A wall whose texels have one green value is like a wall with another factor; a value of 0 is smooth glass, to the bit.
#[test]
fn a_texture_of_roughness_multiplies_the_factor_by_its_green_channel() {
    let place = |alpha: f32, texels: Option<[[u8; 4]; 2]>| {
        let mut world = World::lit_along(Vec3::new(0.3, -1.0, 0.4));
        let roughness_texture = texels.map(|texels| {
            world.picture(texels, None);
            world.scene.textures.len() as u32 - 1
        });
        let wall = world.dielectric(Dielectric { alpha, roughness_texture, ..thin(1.5) });
        world.quad(wall, Vec3::ZERO, Vec3::X * 3.0, Vec3::Y * 3.0);
        room(&mut world);
        world
    };
    let render = |world: &World, x: f32| {
        let targets = (0..9).map(|i| Vec3::new(x, i as f32 * 0.3 - 1.2, 0.0));
        let shot = Shot::of(world, Vec3::new(x, 0.2, 5.0), targets);
        shot.run_on(&world.tree(), &shot.job(RayProgram::Refraction, Corrected, paths(16, 3)))
    };
    let half = 128.0 / 255.0_f32;
    let even = render(&place(0.36, Some([[255, 128, 9, 255]; 2])), 0.0);
    let apart = |other: &(Vec<[f32; 4]>, RayCounts)| {
        let pairs = even.0.iter().zip(&other.0);
        pairs.map(|(a, b)| (Vec4::from(*a) - Vec4::from(*b)).abs().max_element()).fold(0.0, f32::max)
    };
    let [same, other] = [0.36 * half * half, 0.36].map(|alpha| apart(&render(&place(alpha, None), 0.0)));
    assert!(same < 1e-4 && other > 1e-3, "{same}; control, the factor alone: {other}");
    // At the centres of both texels.
    let split = place(0.36, Some([[255, 0, 255, 255], [0, 255, 0, 255]]));
    let (clear, rough) = (render(&split, -1.5), render(&split, 1.5));
    assert!(rough.1.refracted > 8 * clear.1.refracted, "{:?} {:?}", clear.1, rough.1);
    let smooth = place(0.36, Some([[255, 0, 255, 255]; 2]));
    assert_eq!(render(&smooth, 0.0), render(&place(0.0, None), 0.0), "no path is divided");
}

#[test]
fn rough_glass_is_the_same_for_any_number_of_threads() {
    let mut world = World::lit_along(Vec3::new(0.3, -1.0, 0.4));
    let glass = world.dielectric(Dielectric { spread: 0.02, ..rough(0.2, 1.5) });
    let wall = world.dielectric(Dielectric { alpha: 0.1, ..thin(1.5) });
    ball(&mut world, glass, Vec3::ZERO, 1.5, 3);
    world.quad(wall, Vec3::new(0.0, 0.0, 3.0), Vec3::X * 2.0, Vec3::Y);
    room(&mut world);
    let targets = (0..24 * 24).map(|i| Vec3::new((i % 24) as f32 * 0.2 - 2.4, (i / 24) as f32 * 0.2 - 2.4, 0.1));
    let shot = Shot::of(&world, Vec3::new(0.1, 0.2, 7.0), targets).rows(24);
    let params = RayParams { samples: 4, wavelengths: 3, ..paths(4, 1) };
    let (tree, job) = (world.tree(), shot.job(RayProgram::Final, Corrected, params));
    let render = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
        pool.install(|| shot.run_on(&tree, &job))
    };
    let one = render(1);
    assert!(one.1.refracted > 1000, "{:?}", one.1);
    assert_eq!([render(2), render(5)], [one.clone(), one.clone()]);
    // Tile by tile or pixel by pixel, and another seed.
    let alone = crate::cpu::trace_pixel(&tree, &job, 12, 12).expect("a complete job");
    assert_eq!(alone, one.0[12 * 24 + 12]);
    let other = shot.run_on(&tree, &RayJob { seed: 1, ..job }).0;
    let differs = one.0.iter().zip(&other).filter(|(one, other)| one != other).count();
    assert!(differs > 50, "control: {differs}");
}

/// Batches of paths are one sequence: four batches of 16 paths equal one of 64, but for rounding.
#[test]
fn paths_go_on_where_others_ended() {
    let world = face(0.3, 0.2);
    let render = |first_path: u32, count: u32| {
        let params = RayParams { first_path, ..paths(count, 3) };
        Vec3::from_slice(&look(&world, Vec3::new(0.3, 0.4, 5.0), down(40.0), params).0)
    };
    let whole = render(0, 64);
    let mean = (0..4).map(|batch| render(16 * batch, 16)).sum::<Vec3>() / 4.0;
    assert!((whole - mean).abs().max_element() < 1e-6, "{whole} {mean}");
    assert!((render(0, 16) - render(16, 16)).abs().max_element() > 1e-6, "control");
}

/// Each wavelength meets the microfacets that glass of its index alone would meet.
#[test]
fn rough_glass_that_disperses_is_the_weighted_sum_of_its_colours() {
    let glass = Dielectric { spread: 0.1, ..rough(0.2, 1.6) };
    let show = |glass: Dielectric, wavelengths: u32| {
        let mut world = face(0.2, 0.1);
        world.dielectrics[0] = glass;
        let params = RayParams { wavelengths, ..paths(16, 3) };
        Vec3::from_slice(&look(&world, Vec3::new(0.3, 0.4, 5.0), down(50.0), params).0)
    };
    let expected: Vec3 =
        strata(8).iter().map(|stratum| stratum.weight * show(rough(0.2, glass.index_at(stratum.wavelength)), 16)).sum();
    let found = show(glass, 8);
    assert!((found - expected).abs().max_element() < 1e-5, "{found} {expected}");
    assert!((show(glass, 1) - expected).abs().max_element() > 1e-4, "control");
}
