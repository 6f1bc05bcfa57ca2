//! Sizes, places and shapes where a fixed epsilon fails.

use super::*;
use curitiba_passes::visibility::Class;

fn scaled(scene: &[Triangle], scale: f32, to: Vec3) -> Vec<Triangle> {
    scene.iter().map(|triangle| triangle.map(|corner| corner * scale + to)).collect()
}

#[test]
fn sizes_from_a_millionth_to_a_million_see_the_same() {
    let scene = [facing(), half_plane(0.25)].concat();
    for exponent in -6..=6 {
        let scene = scaled(&scene, 10f32.powi(exponent), Vec3::ZERO);
        let row = row(&scene, [0, 1], options(4096));
        let (seen, [f, _]) = (row.visibility.expect("seen"), row.form_factors.expect("asked for"));
        assert!((seen - 0.656_25).abs() < 4.0 * row.error.max(1e-4), "1e{exponent}: {row:?}");
        assert!((f - 0.072_889).abs() < 4.0 * row.form_factor_errors[0].max(2e-5), "1e{exponent}: {row:?}");
        let open = super::row(&scene[..2], [0, 1], options(64));
        assert!(open.class == Class::Open && (open.form_factors.expect("asked for")[0] - 0.115_049).abs() < 1e-6);
    }
}

#[test]
fn places_up_to_a_million_sizes_away_see_the_same() {
    // Numbers that `f32` can hold there: the blocker's border is at 1/4, and the grid at 2^20 is 1/8.
    let scene = [facing(), half_plane(0.25)].concat();
    for place in [16.0, 1024.0, 65_536.0, 1_048_576.0] {
        let scene = scaled(&scene, 1.0, v(place, -place, place));
        let row = row(&scene, [0, 1], options(4096));
        assert!((row.visibility.expect("seen") - 0.656_25).abs() < 4.0 * row.error.max(1e-4), "{place}: {row:?}");
        let open = super::row(&scene[..2], [0, 1], options(64));
        assert!(open.class == Class::Open && (open.form_factors.expect("asked for")[0] - 0.115_049).abs() < 1e-6);
    }
}

#[test]
fn a_blocker_at_a_hundred_thousandth_of_the_distance_is_seen() {
    let close = quad(v(-9.0, -9.0, 1e-5), v(0.25, -9.0, 1e-5), v(0.25, 9.0, 1e-5), v(-9.0, 9.0, 1e-5));
    let scene = [facing(), close].concat();
    // The visible part of the floor, where x > 1/4: (3/4)².
    let row = row(&scene, [0, 1], options(8192));
    assert!((row.visibility.expect("seen") - 0.5625).abs() < 4.0 * row.error.max(2e-4), "{row:?}");
    // Negative control: a segment that starts after a ten-thousandth of its length misses the blocker.
    let epsilon = |from: DVec3, to: DVec3| from + (to - from) * 1e-4;
    let mut random = Random(9);
    let mut open = 0;
    for _ in 0..2000 {
        let from = on(&scene[0], random.number(), random.number());
        let to = on(&scene[1], random.number(), random.number());
        open += i32::from(!scene[2..].iter().any(|triangle| blocks(triangle, epsilon(from, to), to, 0.0)));
    }
    assert_eq!(open, 2000);
}

#[test]
fn slivers_are_seen_as_other_triangles_are() {
    // Strips of 1 : 10 000. By symmetry the half plane x < 1/2 in the middle leaves half of a strip along x.
    let low = quad(v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(1.0, 1e-4, 0.0), v(0.0, 1e-4, 0.0));
    let high = quad(v(0.0, 0.0, 1.0), v(0.0, 1e-4, 1.0), v(1.0, 1e-4, 1.0), v(1.0, 0.0, 1.0));
    let scene = [low, high, half_plane(0.5)].concat();
    let rows = rows(&scene, &[[0, 2], [0, 3], [1, 2], [1, 3]], options(4096));
    let mean = rows.iter().map(|row| row.visibility.expect("seen")).sum::<f64>() / 4.0;
    let error = rows.iter().map(|row| row.error.powi(2)).sum::<f64>().sqrt() / 4.0;
    assert!((mean - 0.5).abs() < 4.0 * error.max(2e-4), "{mean} ± {error}");
}

#[test]
fn faces_that_share_an_edge_do_not_shade_each_other() {
    // Two walls that form a corner, rotated so that no coordinate is exact; each consists of many adjacent triangles.
    let turn = glam::Mat3::from_euler(glam::EulerRot::XYZ, 0.3, 0.7, 1.1);
    let mut scene = Vec::new();
    for i in 0..4 {
        for j in 0..4 {
            let at = |x: i32, y: i32, up: bool| {
                let (x, y) = (x as f32 * 0.25, y as f32 * 0.25);
                turn * if up { v(x, 0.0, y) } else { v(x, y, 0.0) } + v(5.0, 3.0, 1.0)
            };
            scene.extend(quad(at(i, j, false), at(i + 1, j, false), at(i + 1, j + 1, false), at(i, j + 1, false)));
            scene.extend(quad(at(i, j, true), at(i, j + 1, true), at(i + 1, j + 1, true), at(i + 1, j, true)));
        }
    }
    let rows = rows(&scene, &all_pairs(scene.len()), options(64));
    let across: Vec<&Row> = rows.iter().filter(|row| row.pair[0] / 2 % 2 != row.pair[1] / 2 % 2).collect();
    assert_eq!(across.len(), 32 * 32);
    assert!(across.iter().all(|row| row.class == Class::Open && row.visibility == Some(1.0)));
    let (sum, area) = (across.iter().map(|row| row.form_factors.expect("asked for")[0]).sum::<f64>(), 1.0 / 32.0);
    assert!((sum * area - 0.200_043_8).abs() < 1e-5, "{}", sum * area);
}
