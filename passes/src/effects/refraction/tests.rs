use crate::effects::fresnel;
use crate::effects::tests::world::{BACKGROUND, Shot, World, assert_close};
use curitiba_pipeline::backend::RayCounts;
use curitiba_pipeline::programs::Fidelity::{self, Corrected, Thesis};
use curitiba_pipeline::programs::{Fresnel, RayParams, RayProgram};
use glam::Vec3;

const FRONT: Vec3 = Vec3::new(0.9, 0.2, 0.1);
const BEHIND: Vec3 = Vec3::new(0.1, 0.6, 0.3);
const ANGLES: [f32; 8] = [0.0, 15.0, 30.0, 45.0, 60.0, 66.0, 75.0, 85.0];

/// Panes at these heights, above a ground at z = -9 and below a ceiling at z = 9, in ambient light only.
fn panes(heights: &[f32], flipped: bool) -> World {
    let mut world = World::lit_along(Vec3::Y);
    let glass = world.glass();
    let (front, behind) = (world.paint(FRONT), world.paint(BEHIND));
    for height in heights {
        let x = if flipped { Vec3::NEG_X } else { Vec3::X };
        world.quad(glass, Vec3::Z * *height, x * 300.0, Vec3::Y * 300.0);
    }
    world.quad(front, Vec3::Z * 9.0, Vec3::X * 900.0, Vec3::NEG_Y * 900.0);
    world.quad(behind, Vec3::Z * -9.0, Vec3::X * 900.0, Vec3::Y * 900.0);
    world
}

/// The colour of a pixel that sees the highest pane from above, at this angle from its normal.
fn look(world: &World, degrees: f32, fidelity: Fidelity, params: RayParams) -> ([f32; 4], RayCounts) {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let eye = Vec3::new(0.3, 0.4, 5.0);
    let shot = Shot::of(world, eye, [eye + Vec3::new(sin, 0.0, -cos)]);
    assert_eq!(shot.color[0], [1.0, 0.0, 1.0, 0.0], "glass is seen");
    let (pixels, rays) = shot.run(RayProgram::Refraction, fidelity, params);
    (pixels[0], rays)
}

fn reflectance(degrees: f32, index: f32) -> f32 {
    fresnel(degrees.to_radians().cos(), index).reflectance
}

#[test]
fn a_pane_blends_both_sides_by_fresnel_weights() {
    for flipped in [false, true] {
        let world = panes(&[0.0], flipped);
        for index in [1.1, 1.5] {
            for degrees in ANGLES {
                let params = RayParams { index, ..RayParams::default() };
                let (pixel, rays) = look(&world, degrees, Corrected, params);
                let r = reflectance(degrees, index);
                let expected = 0.3 * (r * FRONT + (1.0 - r) * BEHIND);
                assert_close(pixel, expected, 2e-6, format!("{degrees} degrees, index {index}, flipped {flipped}"));
                assert_eq!((rays.reflected, rays.refracted, rays.total()), (1, 1, 2));
                assert_eq!(pixel[3], 1.0);
            }
        }
    }
}

/// Schlick's reflectance in `f64`, for an index above 1.
fn schlick(degrees: f32, index: f32) -> f32 {
    let (cos, index) = (f64::from(degrees.to_radians().cos()), f64::from(index));
    let zero = ((index - 1.0) / (index + 1.0)).powi(2);
    (zero + (1.0 - zero) * (1.0 - cos).powi(5)) as f32
}

#[test]
fn a_pane_that_asks_for_schlicks_weights_has_them_and_no_other_has() {
    let world = panes(&[0.0], false);
    for index in [1.1, 1.5] {
        let mut apart = 0.0_f32;
        for degrees in ANGLES {
            let params = RayParams { index, ..RayParams::default() };
            let (exact, _) = look(&world, degrees, Corrected, params);
            let approximate = RayParams { fresnel: Fresnel::Schlick, ..params };
            let (pixel, rays) = look(&world, degrees, Corrected, approximate);
            let r = schlick(degrees, index);
            let expected = 0.3 * (r * FRONT + (1.0 - r) * BEHIND);
            assert_close(pixel, expected, 2e-6, format!("{degrees} degrees, index {index}"));
            assert_eq!((rays.reflected, rays.refracted), (1, 1), "the rays are the same");
            // `final` shows the same glass.
            let (sin, cos) = degrees.to_radians().sin_cos();
            let eye = Vec3::new(0.3, 0.4, 5.0);
            let shot = Shot::of(&world, eye, [eye + Vec3::new(sin, 0.0, -cos)]);
            let bare = RayParams { samples: 0, ..approximate };
            let (all, _) = shot.run(RayProgram::Final, Corrected, bare);
            let (all_exact, _) = shot.run(RayProgram::Final, Corrected, RayParams { samples: 0, ..params });
            let shift = (exact[0] - pixel[0]).abs();
            apart = apart.max(shift);
            assert!(shift < 1e-3 || all != all_exact, "{degrees} degrees, index {index}: `final` does not listen");
        }
        // At 75 and 85 degrees the approximation is off by up to a fifth, and so a pixel by up to 0.3 x 0.8 of that.
        assert!(apart > 5e-3, "index {index}: the two weights cannot be told apart: {apart}");
    }
}

#[test]
fn the_reports_weights_leave_0_to_1() {
    let world = panes(&[0.0], false);
    for degrees in ANGLES {
        let (pixel, _) = look(&world, degrees, Thesis, RayParams::default());
        let cos = degrees.to_radians().cos();
        let weight = 1.0 - 1.21 * (1.0 - cos * cos);
        let expected = 0.3 * (weight * BEHIND + (1.0 - weight) * FRONT);
        assert_close(pixel, expected, 2e-6, format!("{degrees} degrees"));
        if degrees > 70.0 {
            assert!(pixel[0] > 0.3 * FRONT.x, "a grazing pane glows: more than the mirrored wall itself");
        }
    }
}

#[test]
fn a_pane_behaves_alike_from_both_sides_in_corrected_only() {
    let from = |flipped, degrees, fidelity| look(&panes(&[0.0], flipped), degrees, fidelity, RayParams::default()).0;
    for degrees in ANGLES {
        assert_eq!(from(false, degrees, Corrected), from(true, degrees, Corrected));
    }
    // Seen from behind beyond the critical angle of 65.4 degrees, the report's pane reflects totally.
    assert_close(from(true, 75.0, Thesis), 0.3 * FRONT, 1e-6, "total reflection");
    assert_ne!(from(true, 75.0, Thesis), from(false, 75.0, Thesis));
}

#[test]
fn glass_behind_glass_keeps_its_refracted_colour_in_corrected_only() {
    let world = panes(&[0.0, -2.0], false);
    let params = RayParams { depth: 1, ..RayParams::default() };
    for degrees in ANGLES {
        let r = reflectance(degrees, 1.1);
        // Refraction at the first pane bends the ray, so it meets the second pane nearer to its normal.
        let inner = (degrees.to_radians().sin() / 1.1).asin().to_degrees();
        let r2 = reflectance(inner, 1.1);
        // The second pane reflects light to the first one, beyond the depth: black.
        let expected = 0.3 * (r * FRONT + (1.0 - r) * 0.99 * (1.0 - r2) * BEHIND);
        let (pixel, rays) = look(&world, degrees, Corrected, params);
        assert_close(pixel, expected, 2e-6, format!("{degrees} degrees"));
        assert_eq!((rays.reflected, rays.refracted), (2, 2));

        let (pixel, _) = look(&world, degrees, Thesis, params);
        let weight = 1.0 - 1.21 * degrees.to_radians().sin().powi(2);
        assert_close(pixel, (1.0 - weight) * 0.3 * FRONT, 2e-6, format!("{degrees} degrees: nothing behind is seen"));
    }
}

#[test]
fn deeper_bounces_add_up_as_a_recursion_by_hand_does() {
    // Two panes of constant reflectance (seen along the normal), and every path between them up to the depth.
    let world = panes(&[0.0, -2.0], false);
    let r = f64::from(reflectance(0.0, 1.1));
    let t = 1.0 - r;
    // The colour seen after `bounces` glass hits by a ray between the panes.
    fn between(bounces: u32, depth: u32, up: bool, r: f64) -> [f64; 2] {
        if bounces >= depth {
            return [0.0; 2];
        }
        let (through, back) = (1.0 - r, between(bounces + 1, depth, !up, r));
        let exit = if up { [through, 0.0] } else { [0.0, through] };
        [0, 1].map(|i| 0.99 * (exit[i] + r * back[i]))
    }
    for depth in 0..=8 {
        let inside = between(0, depth, false, r);
        let [front, behind] = [r + t * inside[0], t * inside[1]].map(|weight| weight as f32);
        let params = RayParams { depth, ..RayParams::default() };
        let (pixel, _) = look(&world, 0.0, Corrected, params);
        assert_close(pixel, 0.3 * (front * FRONT + behind * BEHIND), 2e-6, format!("depth {depth}"));
    }
}

#[test]
fn an_index_below_one_reflects_totally_beyond_the_critical_angle() {
    let world = panes(&[0.0], false);
    let params = RayParams { index: 0.9, ..RayParams::default() };
    // The critical angle is asin(0.9) = 64.16 degrees.
    for degrees in [65.0, 75.0, 85.0] {
        for fidelity in [Corrected, Thesis] {
            let (pixel, rays) = look(&world, degrees, fidelity, params);
            assert_close(pixel, 0.3 * FRONT, 1e-6, degrees);
            assert_eq!((rays.reflected, rays.refracted), (1, 0), "a branch of weight 0 is not traced");
        }
    }
    let (pixel, rays) = look(&world, 60.0, Corrected, params);
    let r = reflectance(60.0, 0.9);
    assert!(r > 0.02 && r < 0.5, "{r}");
    assert_close(pixel, 0.3 * (r * FRONT + (1.0 - r) * BEHIND), 2e-6, "below the critical angle");
    assert_eq!(rays.refracted, 1);
}

#[test]
fn the_reports_bounces_are_dimmed_unless_they_reflect_totally() {
    // A second pane at right angles, so that the mirrored ray reaches the front wall after one secondary bounce.
    let mut world = panes(&[0.0], false);
    let glass = 0;
    world.quad(glass, Vec3::new(100.0, 0.0, 0.0), Vec3::Z * 8.0, Vec3::Y * 300.0);
    let params = |index| RayParams { index, ..RayParams::default() };
    let weight_behind = |index: f32, d: f32| 1.0 - index * index * d.to_radians().sin().powi(2);
    // 85 degrees: the mirrored ray rises 8.7 cm a metre, meets the upright pane at 5 degrees, and goes back.
    let (pixel, _) = look(&world, 85.0, Thesis, params(1.1));
    let weight = weight_behind(1.1, 85.0);
    assert_close(pixel, weight * 0.3 * BEHIND + (1.0 - weight) * 0.99 * 0.3 * FRONT, 3e-6, "dimmed once");
    // With an index of 0.05 both bounces reflect totally, and nothing is dimmed.
    let (pixel, _) = look(&world, 85.0, Thesis, params(0.05));
    assert_close(pixel, 0.3 * FRONT, 1e-6, "not dimmed");
    // In corrected fidelity every secondary bounce is dimmed.
    let (pixel, _) = look(&world, 85.0, Corrected, params(0.05));
    assert_close(pixel, 0.99 * 0.3 * FRONT, 1e-6, "dimmed");
}

#[test]
fn bent_normals_never_send_light_through_the_surface() {
    // The normals are so tilted that mirroring by them would go below the pane: the geometric normal is used.
    let mut world = panes(&[0.0], false);
    world.bend_normals(Vec3::new(-1.0, 0.0, 0.1));
    let (pixel, _) = look(&world, 60.0, Corrected, RayParams::default());
    let r = reflectance(60.0, 1.1);
    // The walls are lit by their own bent normals, flipped to face the ray. Light travels along y, so only ambient light remains.
    assert_close(pixel, 0.3 * (r * FRONT + (1.0 - r) * BEHIND), 2e-6, "geometric");
}

#[test]
fn background_and_other_pixels_keep_their_colour() {
    let world = panes(&[0.0], false);
    let eye = Vec3::new(0.0, 0.0, 5.0);
    let shot = Shot::of(&world, eye, [Vec3::Z * 9.0, Vec3::new(1e6, 0.0, 5.0)]);
    for fidelity in [Corrected, Thesis] {
        let (pixels, rays) = shot.run(RayProgram::Refraction, fidelity, RayParams::default());
        assert_eq!((pixels[0], pixels[1], rays.total()), (shot.color[0], BACKGROUND, 0));
    }
}

#[test]
fn cut_out_parts_are_seen_through_in_corrected_only() {
    let mut world = panes(&[0.0], false);
    let leaves = world.picture([[255, 255, 255, 255], [255, 255, 255, 0]], Some(0.5));
    world.quad(leaves, Vec3::Z * -1.0, Vec3::X * 100.0, Vec3::Y * 100.0);
    let color = |x: f32, fidelity| {
        let shot = Shot::of(&world, Vec3::new(x, 0.4, 5.0), [Vec3::new(x, 0.4, 0.0)]);
        shot.run(RayProgram::Refraction, fidelity, RayParams::default()).0[0]
    };
    let r = reflectance(0.0, 1.1);
    // White texels in ambient light, and the ground through the hole.
    assert_close(color(-50.0, Corrected), 0.3 * (r * FRONT + (1.0 - r) * Vec3::ONE), 2e-6, "leaf");
    assert_close(color(50.0, Corrected), 0.3 * (r * FRONT + (1.0 - r) * BEHIND), 2e-6, "hole");
    assert_close(color(50.0, Thesis), Vec3::splat(0.3), 2e-6, "no hole");
}
