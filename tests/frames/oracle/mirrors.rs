//! The mirrors of `reflection`, compared with the results that `tests/oracle/mirrors.py` stored.
//!
//! These pictures have no noise: the oracle's standard errors are 0. For the z-test, the standard error is a hundred-thousandth of the value, plus
//! the change when the eye is rounded, which a path over a round mirror magnifies.

use super::{Difference, Stored, agrees, glass_of, load};
use curitiba::pipeline::programs::RayParams;
use glam::{Quat, Vec3};

/// Eight units in the last place, for distances of 2 to 4 from the origin.
const ROUNDING: f64 = 8.0 * 2.0 * f32::EPSILON as f64;

/// The scene as it is stored agrees.
fn agreed(name: &str, least: usize, unmatched: usize) -> Stored {
    let stored: Stored = load(name);
    let found = glass_of(&stored, ROUNDING, |_| {});
    println!("{name}: {found:?}");
    assert!(found.pixels >= least && found.unmatched <= unmatched && agrees(&found), "{name}: {found:?}");
    stored
}

/// A control: with a mistake the scene does not agree.
fn refused(what: &str, stored: &Stored, change: impl Fn(&mut RayParams)) -> Difference {
    let wrong = glass_of(stored, ROUNDING, change);
    println!("{what}: {wrong:?}");
    assert!(!agrees(&wrong), "{what}: {wrong:?}");
    wrong
}

/// The scene with the normals of its mirrors turned by this angle, in degrees.
fn turned(stored: &Stored, degrees: f32) -> Stored {
    let turn = Quat::from_axis_angle(Vec3::ONE.normalize(), degrees.to_radians());
    let mut turned = stored.clone();
    for [a, b, c, _] in stored.triangles.iter().filter(|triangle| stored.materials[triangle[3] as usize].glass) {
        for vertex in [*a, *b, *c].map(|vertex| vertex as usize) {
            turned.normals[vertex] = (turn * Vec3::from(stored.normals[vertex])).into();
        }
    }
    turned
}

#[test]
fn a_flat_mirror_shows_the_room_alike() {
    let stored = agreed("mirror", 450, 2);
    refused("normals turned by a hundredth of a degree", &turned(&stored, 0.01), |_| {});
}

#[test]
fn mirrors_show_one_another_alike_and_end_after_as_many() {
    let stored = agreed("mirrors", 450, 4);
    for depth in [4, 6] {
        refused(&format!("depth {depth}"), &stored, |params| params.depth = depth);
    }
    refused("normals turned by a hundredth of a degree", &turned(&stored, 0.01), |_| {});
}

#[test]
fn a_round_mirror_over_another_shows_the_room_and_the_background_alike() {
    let stored = agreed("mirror_ball", 350, 12);
    for depth in [1, 3] {
        refused(&format!("depth {depth}"), &stored, |params| params.depth = depth);
    }
    refused("another background", &Stored { beyond: Some(0.1201), ..stored.clone() }, |_| {});
    refused("normals turned by a hundredth of a degree", &turned(&stored, 0.01), |_| {});
}

#[test]
fn a_mirror_shows_diffuse_light_by_interpolated_normals_alike() {
    let stored = agreed("mirror_lit", 350, 2);
    let sun = Vec3::from(stored.sun.expect("a sun"));
    let low = Quat::from_axis_angle(sun.any_orthonormal_vector(), 0.05_f32.to_radians()) * sun;
    refused("the sun turned by a twentieth of a degree", &Stored { sun: Some(low.into()), ..stored.clone() }, |_| {});
    let mut flat = stored.clone();
    for [a, b, c, _] in stored.triangles.iter().filter(|triangle| !stored.materials[triangle[3] as usize].glass) {
        [a, b, c].into_iter().for_each(|vertex| flat.normals[*vertex as usize] = [0.0, 0.0, 1.0]);
    }
    refused("a wall without bent normals", &flat, |_| {});
}
