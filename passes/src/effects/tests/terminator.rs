//! The shadow terminator: how much of a coarse, smooth-shaded sphere lies in the shadow of its own triangles.

use super::world::{Shot, World, grid};
use crate::effects::SHADOWED;
use curitiba_pipeline::backend::NO_TRIANGLE;
use curitiba_pipeline::programs::Fidelity::Corrected;
use curitiba_pipeline::programs::{RayParams, RayProgram};
use glam::Vec3;
use std::f32::consts::PI;

/// A unit sphere of `rings` rings and twice as many segments, flat-shaded or with the normals of the exact sphere.
pub fn sphere(rings: u32, smooth: bool) -> World {
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

/// Looks at the pixels whose shading normal faces the light. Returns the share of them that is in shadow, the largest
/// light cosine of a shadowed pixel, and the share of the irradiance that is lost.
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

/// Measures the light that triangles facing away from the light would lose: see `docs/numerics.md`.
#[test]
fn smooth_spheres_are_hardly_in_their_own_shadow() {
    for rings in [4, 8, 16] {
        let (share, cos, lost) = falsely_shadowed(rings, true);
        println!(
            "{} x {rings}: {:.3} % of the lit pixels, cosine up to {cos:.3}, {:.4} % lost",
            2 * rings,
            share * 100.0,
            lost * 100.0
        );
        assert!(share <= 0.005 && lost < 1e-4, "{rings}: {share} {cos} {lost}");
    }
}

/// For each pixel of a coarse, smooth-shaded sphere: the light's cosine on the exact sphere, and the light's share in `final`. The share is
/// the pixel's colour over the colour that it was lit with, without occlusion.
fn shares_in_final(rings: u32, params: RayParams) -> Vec<(f32, f32)> {
    let world = sphere(rings, true);
    let to_light = Vec3::new(0.62, -0.55, 0.56).normalize();
    let mut found = Vec::new();
    for eye in [Vec3::new(4.0, 3.0, 5.0), Vec3::new(-5.0, 2.0, -3.0), Vec3::new(1.0, -6.0, 2.0)] {
        let side = eye.any_orthonormal_vector();
        let shot = Shot::of(&world, eye, grid(96, Vec3::ZERO, side, side.cross(eye).normalize()));
        let (pixels, _) = shot.run_on(&world.tree(), &shot.job(RayProgram::Final, Corrected, params));
        let seen = pixels.iter().zip(&shot.color).zip(&shot.normal).zip(&shot.triangle);
        found.extend(seen.filter(|(_, id)| **id != NO_TRIANGLE).map(|(((pixel, color), normal), _)| {
            (Vec3::from_slice(normal).normalize().dot(to_light), pixel[0] / color[0])
        }));
    }
    found
}

/// The border of the light follows the smooth surface, not the edges of triangles. Where the smooth surface faces away from the light it is dark,
/// although its triangle does not face away; where the smooth surface faces the light it is lit.
#[test]
fn the_border_of_the_light_is_that_of_the_smooth_surface() {
    for rings in [4, 8, 16] {
        let shares = shares_in_final(rings, RayParams { samples: 0, ..RayParams::default() });
        let of = |lit: bool| shares.iter().filter(move |(cosine, _)| cosine.abs() > 1e-5 && (*cosine > 0.0) == lit);
        let (lit, dark) = (of(true).count(), of(false).count());
        assert!(lit > 3000 && dark > 3000, "{rings}: {lit} {dark}");
        assert_eq!(of(false).filter(|(_, share)| *share != SHADOWED).count(), 0, "{rings}: light on the far side");
        let falsely = of(true).filter(|(_, share)| *share != 1.0).count();
        assert!((falsely as f64) <= 0.005 * lit as f64, "{rings}: {falsely} of {lit} are dark");
    }
}

/// As above, for a disc. Farther from the border than half its angle, the disc is wholly above or below the horizon; at the border, half of it is.
#[test]
fn the_penumbra_on_a_smooth_sphere_is_a_band_around_its_border() {
    let (sun, rings) = (12.0_f32, 8);
    let params = RayParams { sun, sun_samples: 64, samples: 0, ..RayParams::default() };
    let shares = shares_in_final(rings, params);
    let half = (sun / 2.0).to_radians().sin();
    let (mut border, mut dark) = (Vec::new(), 0);
    for (cosine, share) in &shares {
        if *cosine < -1.01 * half {
            assert_eq!(*share, SHADOWED, "cosine {cosine}");
            dark += 1;
        } else if cosine.abs() < 0.05 * half {
            border.push(f64::from(*share));
        }
    }
    let mean = border.iter().sum::<f64>() / border.len() as f64;
    assert!(dark > 2000 && border.len() > 30, "{dark} {}", border.len());
    assert!((mean - 0.75).abs() < 0.02, "at the border half of the disc is seen: {mean}");
}

/// Light cosine and light share of every pixel that shows a surface, seen from `eye`.
fn shares_seen(world: &World, eye: Vec3, targets: impl IntoIterator<Item = Vec3>) -> Vec<(f32, f32)> {
    let shot = Shot::of(world, eye, targets);
    let job = shot.job(RayProgram::DeferredShadows, Corrected, RayParams::default());
    let (pixels, _) = shot.run_on(&world.tree(), &job);
    let seen = pixels.iter().zip(&shot.position).zip(&shot.triangle);
    seen.filter(|(_, id)| **id != NO_TRIANGLE).map(|((pixel, position), _)| (position[3], pixel[0])).collect()
}

/// A box of base 1 x 1 and small height, whose faces share the normals at its corners, lit by a low sun. Its underside
/// is dark, though the normals near its rim face the sun.
#[test]
fn no_light_leaks_to_the_underside_of_a_thin_slab() {
    for height in [0.2, 0.01, 1e-4] {
        for spread in [0.0_f32, 0.5, 1.0, 2.0] {
            let mut world = World::lit_along(Vec3::new(-0.8, -0.35, -0.1));
            let paint = world.paint(Vec3::splat(0.5));
            let corner = |i: usize| {
                let side = |bit: usize| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
                Vec3::new(side(0), side(1), side(2))
            };
            let at = |i: usize| corner(i) * Vec3::new(0.5, 0.5 * height, 0.5);
            // From flat normals to those of a cube, and beyond.
            let normal = |i: usize| (corner(i) * Vec3::new(spread, 1.0, spread)).normalize();
            for quad in [[0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5], [0, 2, 3, 1], [4, 5, 7, 6]] {
                for [a, b, c] in [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]] {
                    world.triangle(paint, [at(a), at(b), at(c)], [normal(a), normal(b), normal(c)]);
                }
            }
            let below = grid(64, Vec3::new(0.0, -0.5 * height, 0.0), Vec3::X * 0.45, Vec3::Z * 0.45);
            let seen = shares_seen(&world, Vec3::new(0.1, -3.0, 0.2), below);
            let faces = seen.iter().filter(|(cosine, _)| *cosine > 0.0).count();
            let leaks = seen.iter().filter(|(cosine, share)| *cosine > 0.0 && *share == 1.0).count();
            assert!(seen.len() > 3000 && (spread < 0.5 || faces > 50), "{height} {spread}: {} {faces}", seen.len());
            assert_eq!(leaks, 0, "{height} {spread}: of {faces}");
        }
    }
}

/// A sheet close above the lit side of a sphere keeps the light off, however near it is: points are not lifted through
/// the sheet.
#[test]
fn no_light_leaks_through_a_sheet_close_to_a_smooth_sphere() {
    for gap in [0.03, 0.01, 1e-3] {
        let world = |sheet: bool| {
            let mut world = sphere(8, true);
            if sheet {
                let paint = world.paint(Vec3::splat(0.5));
                let ball = sphere(8, true);
                let scene = &ball.scene.geometry;
                for triangle in 0..scene.triangles.len() as u32 {
                    let corners = scene.corners(triangle).map(|corner| corner * (1.0 + gap));
                    let flat = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
                    world.triangle(paint, corners, [flat; 3]);
                }
            }
            world
        };
        // The pixels of the bare sphere, used as the G-buffer of the wrapped one: all of them must be dark.
        let (bare, wrapped) = (world(false), world(true));
        let eyes = [Vec3::new(4.0, 3.0, 5.0), Vec3::new(-5.0, 2.0, -3.0), Vec3::new(1.0, -6.0, 2.0)];
        let (mut lit, mut leaks) = (0, 0);
        for eye in eyes {
            let side = eye.any_orthonormal_vector();
            let shot = Shot::of(&bare, eye, grid(64, Vec3::ZERO, side, side.cross(eye).normalize()));
            let shot = shot.in_world(&wrapped);
            let job = shot.job(RayProgram::DeferredShadows, Corrected, RayParams::default());
            let (pixels, _) = shot.run_on(&wrapped.tree(), &job);
            for (pixel, _) in pixels.iter().zip(&shot.position).filter(|(_, position)| position[3] > 0.0) {
                lit += 1;
                leaks += usize::from(pixel[0] == 1.0);
            }
        }
        assert!(lit > 1500, "{lit}");
        assert_eq!(leaks, 0, "gap {gap}: of {lit}");
    }
}
