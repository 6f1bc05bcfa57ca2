//! The shadow terminator: how much of a smooth-shaded, coarse sphere falls into the shadow of its own triangles.

use super::world::{Shot, World, grid};
use curitiba_pipeline::programs::Fidelity::Corrected;
use curitiba_pipeline::programs::{RayParams, RayProgram};
use glam::Vec3;
use std::f32::consts::PI;

/// A unit sphere of rings and segments, flat or with the normals of the sphere.
fn sphere(rings: u32, smooth: bool) -> World {
    let mut world = World::lit_along(Vec3::new(-0.62, 0.55, -0.56));
    let paint = world.paint(Vec3::splat(0.5));
    let at = |i: u32, j: u32| {
        let (theta, phi) = (PI * i as f32 / rings as f32, PI * (j % (2 * rings)) as f32 / rings as f32);
        let ring = if i.is_multiple_of(rings) { 0.0 } else { theta.sin() };
        Vec3::new(ring * phi.cos(), ring * phi.sin(), theta.cos())
    };
    for i in 0..rings {
        for j in 0..2 * rings {
            let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            let mut add = |triangle: [Vec3; 3]| {
                let flat = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).normalize();
                world.triangle(paint, triangle, if smooth { triangle } else { [flat; 3] });
            };
            if i + 1 < rings {
                add([corners[0], corners[1], corners[2]]);
            }
            if i > 0 {
                add([corners[0], corners[2], corners[3]]);
            }
        }
    }
    world
}

/// Of the pixels that face the light by their normal: the share in shadow, the largest cosine among those, and the share
/// of the irradiance lost.
fn falsely_shadowed(rings: u32, smooth: bool) -> (f64, f32, f64) {
    let world = sphere(rings, smooth);
    let (mut lit, mut shadowed, mut most) = (0, 0, 0.0_f32);
    let (mut all, mut lost) = (0.0, 0.0);
    for eye in [Vec3::new(4.0, 3.0, 5.0), Vec3::new(-5.0, 2.0, -3.0), Vec3::new(1.0, -6.0, 2.0)] {
        let side = eye.any_orthonormal_vector();
        let shot = Shot::of(&world, eye, grid(96, Vec3::ZERO, side, side.cross(eye).normalize()));
        let (pixels, _) =
            shot.run_on(&world.tree(), &shot.job(RayProgram::DeferredShadows, Corrected, RayParams::default()));
        for (pixel, position) in pixels.iter().zip(&shot.position) {
            let cos = position[3];
            if cos <= 0.0 {
                continue;
            }
            lit += 1;
            all += f64::from(cos);
            if pixel[0] < 1.0 {
                shadowed += 1;
                most = most.max(cos);
                lost += f64::from(cos);
            }
        }
    }
    assert!(lit > 3000, "{lit}");
    (f64::from(shadowed) / f64::from(lit), most, lost / all)
}

#[test]
fn a_flat_shaded_convex_body_is_never_in_its_own_shadow() {
    for rings in [4, 8, 16] {
        assert_eq!(falsely_shadowed(rings, false).0, 0.0, "{rings}");
    }
}

/// A known limit, stated in `docs/numerics.md`: where interpolated normals face the light and the triangle does not, the
/// triangle decides. The figures shrink with the square of the tessellation.
#[test]
fn the_shadow_terminator_of_smooth_spheres_is_as_large_as_documented() {
    let limits = [(4, 0.12, 0.45, 0.04), (8, 0.065, 0.28, 0.011), (16, 0.035, 0.15, 0.0035)];
    for (rings, share, cos, lost) in limits {
        let found = falsely_shadowed(rings, true);
        println!(
            "{} x {rings}: {:.2} % of the lit pixels, cosine up to {:.2}, {:.3} % of the irradiance",
            2 * rings,
            found.0 * 100.0,
            found.1,
            found.2 * 100.0
        );
        assert!(found.0 < share && found.1 < cos && found.2 < lost, "{rings}: {found:?}");
        assert!(
            found.0 > share * 0.3,
            "the documented limit is gone, and the page is to be changed: {rings} {found:?}"
        );
    }
}
