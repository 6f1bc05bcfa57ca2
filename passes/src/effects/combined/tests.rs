use crate::effects::fresnel;
use crate::effects::tests::world::{BACKGROUND, Shot, World, assert_close};
use curitiba_pipeline::backend::RayCounts;
use curitiba_pipeline::programs::Fidelity::{self, Corrected, Thesis};
use curitiba_pipeline::programs::{RayParams, RayProgram};
use glam::{Vec3, Vec4};

/// Parameters without occlusion.
fn bare() -> RayParams {
    RayParams { samples: 0, ..RayParams::default() }
}

fn run(shot: &Shot<'_>, fidelity: Fidelity, params: RayParams) -> (Vec<[f32; 4]>, RayCounts) {
    shot.run(RayProgram::Final, fidelity, params)
}

/// A floor in z = 0 under light that falls perpendicularly, with panes or a roof above.
fn floor(panes: u32, roof: bool) -> (World, u32) {
    let mut world = World::lit_along(Vec3::NEG_Z);
    let paint = world.paint(Vec3::new(0.5, 0.6, 0.7));
    let glass = world.glass();
    world.quad(paint, Vec3::ZERO, Vec3::X * 9.0, Vec3::Y * 9.0);
    if roof {
        world.quad(paint, Vec3::Z * 50.0, Vec3::X * 9.0, Vec3::Y * 9.0);
    }
    for pane in 0..panes {
        world.quad(glass, Vec3::Z * (2.0 + pane as f32), Vec3::X * 9.0, Vec3::Y * 9.0);
    }
    (world, paint)
}

const EYE: Vec3 = Vec3::new(0.3, 0.2, 1.5);

#[test]
fn each_pane_takes_a_tenth_of_the_light_in_corrected_only() {
    for panes in 0..=4 {
        let (world, paint) = floor(panes, false);
        // The second target lies on the diagonal that the two triangles of each pane share: the ray hits both, and the
        // pane counts once.
        for target in [Vec3::new(0.4, 0.1, 0.0), Vec3::ZERO] {
            let shot = Shot::of(&world, EYE, [target]);
            let (pixels, rays) = run(&shot, Corrected, bare());
            let expected = world.lit(paint, 1.0);
            assert_close(pixels[0], expected * 0.9f32.powi(panes as i32), 1e-6, format!("{panes} panes"));
            assert_eq!((rays.shadow, rays.total()), (1, 1));
            let (pixels, _) = run(&shot, Thesis, bare());
            assert_close(pixels[0], expected, 1e-6, "a miss resets the payload");
        }
    }
}

#[test]
fn opaque_surfaces_leave_half_of_the_light_whatever_glass_is_between() {
    for panes in 0..=3 {
        let (world, paint) = floor(panes, true);
        let shot = Shot::of(&world, EYE, [Vec3::new(0.4, 0.1, 0.0)]);
        for fidelity in [Corrected, Thesis] {
            let (pixels, _) = run(&shot, fidelity, bare());
            assert_close(pixels[0], 0.5 * world.lit(paint, 1.0), 1e-6, format!("{fidelity:?}, {panes} panes"));
        }
    }
}

#[test]
fn surfaces_turned_away_from_the_light_are_shadowed_without_a_ray() {
    let (mut world, paint) = floor(0, false);
    world.sun.as_mut().expect("a sun").direction = Vec3::Z;
    let shot = Shot::of(&world, EYE, [Vec3::new(0.4, 0.1, 0.0)]);
    let (pixels, rays) = run(&shot, Corrected, bare());
    assert_close(pixels[0], 0.5 * world.lit(paint, 0.0), 1e-6, "ambient, shadowed");
    assert_eq!(rays.total(), 0);
}

#[test]
fn background_keeps_its_colour_in_corrected_and_is_shadowed_from_the_origin_in_thesis() {
    // A background pixel's cleared position is the origin. That lies on the floor, below the roof.
    let (world, _) = floor(0, true);
    let shot = Shot::of(&world, EYE, [EYE + Vec3::X]);
    assert_eq!(run(&shot, Corrected, RayParams::default()), (vec![BACKGROUND], RayCounts::default()));
    let (pixels, rays) = run(&shot, Thesis, RayParams::default());
    assert_close(pixels[0], 0.5 * Vec4::from_array(BACKGROUND).truncate(), 1e-7, "shadowed background");
    assert_eq!((pixels[0][3], rays.shadow), (1.0, 1));
}

#[test]
fn occlusion_multiplies_the_shadowed_colour_and_glass_does_not_occlude() {
    let params = RayParams { samples: 64, radius: 1.0, intensity: 1.0, ..RayParams::default() };
    let value = |occluder_is_glass: bool, fidelity| {
        let (mut world, paint) = floor(0, false);
        let glass = 1;
        // A wall at x = 0, parallel to the light: it throws no shadow on the floor.
        let material = if occluder_is_glass { glass } else { paint };
        world.quad(material, Vec3::ZERO, Vec3::Y * 9.0, Vec3::Z * 9.0);
        let targets = (0..200).map(|i| Vec3::new(0.25, 0.002 * i as f32, 0.0));
        let shot = Shot::of(&world, EYE, targets);
        let (pixels, rays) = run(&shot, fidelity, params);
        assert!(rays.shadow == 200 && rays.occlusion > 200 * 55);
        let sum: f32 = pixels.iter().map(|pixel| pixel[0]).sum();
        sum / 200.0 / world.lit(paint, 1.0).x
    };
    assert!((value(false, Corrected) - 0.657_481).abs() < 5e-3, "{}", value(false, Corrected));
    assert!((value(true, Corrected) - 1.0).abs() < 1e-5);
    assert!((value(true, Thesis) - 1.0).abs() < 1e-5);
    assert!(value(false, Thesis) < 0.85);
}

/// A pane in z = 0 seen at an angle, with a white wall above it and nothing below.
fn mirror(index: f32) -> (World, u32, RayParams) {
    let mut world = World::lit_along(Vec3::new(0.0, 0.0, 1.0));
    let paint = world.paint(Vec3::new(0.9, 0.6, 0.3));
    let glass = world.glass();
    world.quad(glass, Vec3::ZERO, Vec3::X * 50.0, Vec3::Y * 50.0);
    // The wall faces down, to the pane and to the light from below.
    world.quad(paint, Vec3::Z * 9.0, Vec3::X * 90.0, Vec3::NEG_Y * 90.0);
    let params = RayParams { index, ..bare() };
    (world, paint, params)
}

/// Looks at the pane at 70 degrees from its normal: total reflection for an index below 0.93.
fn look(world: &World, fidelity: Fidelity, params: RayParams) -> ([f32; 4], RayCounts) {
    let eye = Vec3::new(-1.0, 0.1, 1.0);
    let (sin, cos) = 70f32.to_radians().sin_cos();
    let shot = Shot::of(world, eye, [eye + Vec3::new(sin, 0.0, -cos)]);
    assert_eq!(shot.color[0], [1.0, 0.0, 1.0, 0.0]);
    let (pixels, rays) = run(&shot, fidelity, params);
    (pixels[0], rays)
}

#[test]
fn what_a_mirror_shows_is_lit_and_shadowed_on_the_viewers_side() {
    let (world, paint, params) = mirror(0.9);
    // The pane stands between the wall and the light.
    let (pixel, rays) = look(&world, Corrected, params);
    assert_close(pixel, 0.9 * world.lit(paint, 1.0), 1e-6, "lit through the pane");
    assert_eq!((rays.reflected, rays.refracted, rays.shadow), (1, 0, 1));
    // The report's program flips the normal away from the viewer, and so from the light: ambient light only, and glass takes nothing.
    let (pixel, _) = look(&world, Thesis, params);
    assert_close(pixel, world.lit(paint, 0.0), 1e-6, "lit on the wrong side");
}

#[test]
fn what_a_mirror_shows_is_shadowed_by_opaque_surfaces() {
    let (mut world, paint, params) = mirror(0.9);
    world.quad(paint, Vec3::Z * -1.0, Vec3::X * 90.0, Vec3::Y * 90.0);
    let (pixel, _) = look(&world, Corrected, params);
    assert_close(pixel, 0.5 * world.lit(paint, 1.0), 1e-6, "blocked from below");
}

#[test]
fn what_a_mirror_shows_is_occluded_once_by_what_surrounds_it() {
    let (mut world, paint, params) = mirror(0.9);
    // An upright wall, a quarter of the radius behind the point that the mirrored ray hits. The closed form is in the tests of `ssao`.
    let met = -1.0 + 10.0 * 70f32.to_radians().tan();
    world.quad(paint, Vec3::new(met + 0.25, 0.1, 9.0), Vec3::Y * 9.0, Vec3::Z * 3.0);
    let params = RayParams { samples: 64, radius: 1.0, intensity: 1.0, ..params };
    let (pixel, rays) = look(&world, Corrected, params);
    assert_eq!((rays.reflected, rays.shadow, rays.occlusion), (1, 1, 64));
    let open = pixel[0] / (0.9 * world.lit(paint, 1.0).x);
    assert!((open - 0.657_481).abs() < 0.06, "{open}");
}

#[test]
fn occlusion_darkens_glass_itself_in_thesis_only() {
    let (mut world, paint, params) = mirror(0.9);
    let (clear, _) = look(&world, Corrected, params);
    let (clear_thesis, _) = look(&world, Thesis, params);
    // A post on the pane, right behind the point that the pixel shows, and not in the path of the mirrored ray.
    let x = -1.0 + 70f32.to_radians().tan();
    world.quad(paint, Vec3::new(x, 0.2, 0.0), Vec3::X, Vec3::Z * 0.5);
    let params = RayParams { samples: 100, radius: 0.5, intensity: 1.6, ..params };
    let (pixel, rays) = look(&world, Corrected, params);
    assert_eq!((pixel, rays.occlusion), (clear, 100), "the wall's occlusion only, and it is open");
    let (pixel, rays) = look(&world, Thesis, params);
    assert!(pixel[0] < 0.9 * clear_thesis[0] && rays.occlusion > 150, "{pixel:?}");
}

#[test]
fn glass_blends_by_fresnel_weights_as_refraction_does() {
    let (mut world, paint, params) = mirror(1.5);
    let ground = world.paint(Vec3::new(0.1, 0.2, 0.6));
    world.quad(ground, Vec3::Z * -3.0, Vec3::X * 90.0, Vec3::Y * 90.0);
    let (pixel, rays) = look(&world, Corrected, params);
    let r = fresnel(70f32.to_radians().cos(), 1.5).reflectance;
    // Light comes from below. The ground hides the wall from it, and the ground's upper side faces away from it.
    let expected = r * 0.5 * world.lit(paint, 1.0) + (1.0 - r) * 0.5 * world.lit(ground, 0.0);
    assert_close(pixel, expected, 2e-6, "blend");
    assert_eq!((rays.reflected, rays.refracted, rays.shadow), (1, 1, 1));
}

#[test]
fn black_pixels_trace_nothing_in_corrected() {
    let mut world = World::lit_along(Vec3::NEG_Z);
    let black = world.paint(Vec3::ZERO);
    world.quad(black, Vec3::ZERO, Vec3::X, Vec3::Y);
    let shot = Shot::of(&world, EYE, [Vec3::new(0.1, 0.2, 0.0)]);
    let (pixels, rays) = run(&shot, Corrected, RayParams::default());
    assert_eq!((pixels, rays.total()), (vec![[0.0, 0.0, 0.0, 1.0]], 0));
}
