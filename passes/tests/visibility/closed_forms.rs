//! Pairs of triangles whose answer has a closed form.

use super::*;
use curitiba_passes::visibility::{Class, Sampler};

/// Form factor of two parallel unit right triangles at a distance of 1.
const FACING: f64 = 0.115_049;

#[test]
fn parallel_triangles_are_open_without_a_ray_and_exchange_what_the_integral_says() {
    let row = row(&facing(), [0, 1], options(64));
    assert_eq!((row.class, row.visibility, row.error, row.samples), (Class::Open, Some(1.0), 0.0, 0));
    let [f, g] = row.form_factors.expect("asked for");
    assert!((f - FACING).abs() < 1e-6 && (f - g).abs() < 1e-12, "{f} {g}");
}

#[test]
fn one_two_dimensional_point_for_both_triangles_is_wrong_by_more_than_six_percent() {
    // Negative control: the snippet of the reviewed document, in which one Hammersley point serves both triangles.
    let weigh = |shared: bool| {
        let (n, [a, b]) = (1 << 16, facing());
        let halton = |mut index: u32, base: u32| {
            let (mut value, mut place) = (0.0, 1.0 / f64::from(base));
            while index > 0 {
                value += f64::from(index % base) * place;
                index /= base;
                place /= f64::from(base);
            }
            value
        };
        let at = |[p, q, r]: Triangle, x: f64, y: f64| {
            let root = x.sqrt();
            let [p, q, r] = [p, q, r].map(|corner| corner.as_dvec3());
            p * (1.0 - root) + q * root * (1.0 - y) + r * root * y
        };
        let mut sum = 0.0;
        for index in 0..n {
            let (x, y) = ((f64::from(index) + 0.5) / f64::from(n), halton(index, 2));
            let (z, w) = if shared { (x, y) } else { (halton(index, 3), halton(index, 5)) };
            let along = at(b, z, w) - at(a, x, y);
            sum += along.z.powi(2) / along.length_squared().powi(2) / std::f64::consts::PI;
        }
        0.5 * sum / f64::from(n)
    };
    let (shared, four) = (weigh(true), weigh(false));
    assert!((four - FACING).abs() < 2e-5, "{four}");
    assert!((shared - 0.10751).abs() < 2e-5 && (shared / FACING - 1.0) < -0.06, "{shared}");
}

/// Visibility and form factor of the unit triangles, with the half plane x < c in the middle between them.
const HALF_BLOCKED: [(f32, f64, f64); 3] =
    [(0.1, 0.930_4, 0.106_266), (0.25, 0.656_25, 0.072_889), (0.5, 1.0 / 6.0, 0.019_890)];

#[test]
fn a_half_plane_leaves_what_the_polynomial_says() {
    for (c, visibility, form_factor) in HALF_BLOCKED {
        let s = 2.0 * f64::from(c);
        let polynomial = 1.0 - (2.0 * s * s - 4.0 * s.powi(3) / 3.0 + s.powi(4) / 6.0);
        assert!((polynomial - visibility).abs() < 1e-6);
        let scene = [facing(), half_plane(c)].concat();
        for sampler in [Sampler::Sobol, Sampler::Hammersley] {
            let row = row(&scene, [0, 1], Options { sampler, ..options(8192) });
            let found = row.visibility.expect("they face each other");
            assert_eq!((row.class, row.samples, row.valid), (Class::Sampled, 8192, 8192));
            assert!((found - visibility).abs() < 4.0 * row.error.max(1e-4), "{c}: {found} ± {}", row.error);
            assert!(row.error < 3e-3, "{}", row.error);
            let [f, _] = row.form_factors.expect("asked for");
            let error = row.form_factor_errors[0];
            assert!((f - form_factor).abs() < 4.0 * error.max(1e-5) && error < 4e-4, "{c}: {f} ± {error}");
        }
    }
}

#[test]
fn the_product_of_visibility_and_open_form_factor_is_not_the_form_factor() {
    let scene = [facing(), half_plane(0.25)].concat();
    let row = row(&scene, [0, 1], options(8192));
    let product = row.visibility.expect("seen") * FACING;
    assert!((product / 0.072_889 - 1.0).abs() > 0.01, "the control sees a difference: {product}");
}

#[test]
fn squares_exchange_the_catalogued_form_factors() {
    let floor = quad(v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(1.0, 1.0, 0.0), v(0.0, 1.0, 0.0));
    let ceiling = quad(v(0.0, 0.0, 1.0), v(0.0, 1.0, 1.0), v(1.0, 1.0, 1.0), v(1.0, 0.0, 1.0));
    let wall = quad(v(0.0, 0.0, 0.0), v(0.0, 1.0, 0.0), v(0.0, 1.0, 1.0), v(0.0, 0.0, 1.0));
    let pairs = [[0, 2], [0, 3], [1, 2], [1, 3]];
    let sum = |scene: &[Triangle], samples: u32| {
        let rows = rows(scene, &pairs, options(samples));
        // The mean over both halves of the floor, each with both halves of the other square.
        let factors: f64 = rows.iter().map(|row| 0.5 * row.form_factors.expect("asked for")[0]).sum();
        let variance: f64 = rows.iter().map(|row| (0.5 * row.form_factor_errors[0]).powi(2)).sum();
        (factors, variance.sqrt())
    };
    // Configurations C-11 and C-14 of Howell's catalogue.
    let (parallel, error) = sum(&[floor, ceiling].concat(), 64);
    assert!((parallel - 0.199_824_9).abs() < 1e-6 && error == 0.0, "{parallel}");
    let (perpendicular, error) = sum(&[floor, wall].concat(), 64);
    assert!((perpendicular - 0.200_043_8).abs() < 1e-6 && error == 0.0, "{perpendicular}");
    let (half, error) = sum(&[floor, ceiling, half_plane(0.5)].concat(), 16_384);
    assert!((half - 0.099_912_4).abs() < 4.0 * error && error < 2e-4, "{half} ± {error}");
}

#[test]
fn rows_of_closed_rooms_sum_to_one_without_a_ray() {
    for room in [boxed(v(0.0, 0.0, 0.0), v(3.0, 2.0, 4.0), true), sphere(1), sphere(2)] {
        let rows = rows(&room, &all_pairs(room.len()), options(64));
        assert!(rows.iter().all(|row| row.samples == 0 && matches!(row.class, Class::Open | Class::Never)));
        let opens = rows.iter().filter(|row| row.class == Class::Open);
        assert!(opens.clone().count() > 0 && opens.clone().all(|row| row.visibility == Some(1.0)));
        for (sum, _) in row_sums(room.len(), &rows) {
            assert!((sum - 1.0).abs() < 1e-4, "{} triangles: {sum}", room.len());
        }
    }
}

#[test]
fn rows_of_a_room_with_a_box_in_it_sum_to_one_within_their_errors() {
    let room = boxed(v(0.0, 0.0, 0.0), v(3.0, 2.0, 4.0), true);
    let scene = [room, boxed(v(1.0, 0.5, 1.0), v(2.0, 1.5, 2.0), false)].concat();
    let rows = rows(&scene, &all_pairs(scene.len()), options(1024));
    assert!(rows.iter().any(|row| row.class == Class::Sampled));
    for (sum, variance) in row_sums(scene.len(), &rows) {
        assert!((sum - 1.0).abs() < 4.0 * variance.sqrt() + 1e-4, "{sum} ± {}", variance.sqrt());
        assert!(variance.sqrt() < 0.01);
    }
}

#[test]
fn what_looks_away_or_lies_in_one_plane_never_sees_and_is_absent_or_zero() {
    let [a, b] = facing();
    let back = [b[0], b[2], b[1]];
    let beside = a.map(|corner| corner + v(3.0, 0.5, 0.0));
    let thin = [v(0.0, 0.0, 2.0), v(1.0, 0.0, 2.0), v(2.0, 0.0, 2.0)];
    let scene = [a, b, back, beside, thin];
    for (pair, facing) in [[0, 2], [0, 3], [1, 2], [0, 4], [1, 1]].into_iter().flat_map(|pair| BOTH.map(|f| (pair, f)))
    {
        let row = row(&scene, pair, Options { facing, ..options(64) });
        let expected = if facing == Facing::Zero { Some(0.0) } else { None };
        assert_eq!((row.class, row.visibility, row.form_factors), (Class::Never, expected, Some([0.0; 2])), "{pair:?}");
    }
}

#[test]
fn segments_that_leave_a_back_are_left_out_or_count_as_blocked() {
    // The wall stands at x = 1/2 across the floor triangle and faces -x, so it sees only a part of the floor.
    let floor = [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0)];
    let wall = [v(0.5, 0.0, 0.5), v(0.5, 0.0, 1.0), v(0.5, 1.0, 0.5)];
    // The part with x < 1/2 is three quarters of the area.
    let [skip, zero] = BOTH.map(|facing| row(&[floor, wall], [0, 1], Options { facing, ..options(64) }));
    assert_eq!((skip.class, skip.visibility), (Class::Open, Some(1.0)));
    let share = zero.visibility.expect("a part is seen");
    assert!(zero.class == Class::Open && (share - 0.75).abs() < 1e-5, "{share}");
    // Because of a small triangle far below the wall's upper end, the pair is sampled. The policies then differ in their
    // divisor.
    let speck = [v(0.1, 0.1, 0.3), v(0.2, 0.1, 0.3), v(0.1, 0.2, 0.3)];
    let [skip, zero] = BOTH.map(|facing| row(&[floor, wall, speck], [0, 1], Options { facing, ..options(4096) }));
    assert_eq!(skip.class, Class::Sampled);
    assert!((f64::from(skip.valid) / 4096.0 - 0.75).abs() < 0.01);
    let (s, z) = (skip.visibility.expect("seen"), zero.visibility.expect("seen"));
    assert!((z - s * f64::from(skip.valid) / 4096.0).abs() < 1e-12 && s < 1.0, "{s} {z}");
}

#[test]
fn a_wall_of_any_shape_that_fills_the_shaft_closes_it() {
    let [a, b] = facing();
    let plate = |height: &dyn Fn(f32, f32) -> f32, cells: i32| {
        let mut wall = Vec::new();
        for i in -cells..2 * cells {
            for j in -cells..2 * cells {
                let at = |i: i32, j: i32| {
                    let (x, y) = (i as f32 / cells as f32, j as f32 / cells as f32);
                    v(x, y, height(x, y))
                };
                wall.extend(quad(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)));
            }
        }
        wall
    };
    for (name, wall) in [
        ("one triangle", vec![[v(-9.0, -9.0, 0.5), v(30.0, -9.0, 0.5), v(-9.0, 30.0, 0.5)]]),
        ("two", half_plane(20.0).to_vec()),
        ("a grid", plate(&|_, _| 0.5, 3)),
        ("a hill", plate(&|x, y| 0.5 + 0.05 * (x * 3.0).sin() * (y * 2.0).cos(), 3)),
    ] {
        let scene = [vec![a, b], wall.clone()].concat();
        let closed = row(&scene, [0, 1], options(64));
        assert_eq!((closed.class, closed.visibility, closed.samples), (Class::Closed, Some(0.0), 0), "{name}");
        assert_eq!(closed.form_factors, Some([0.0; 2]));
        if wall.len() > 2 {
            // Control: without the triangle in the middle the wall has a hole, and the pair is not closed.
            let middle = (0..wall.len())
                .min_by_key(|index| {
                    let [p, q, r] = wall[*index];
                    (((p + q + r) / 3.0 - v(0.33, 0.33, 0.5)).length() * 1e6) as i64
                })
                .expect("a wall");
            let mut holed = wall;
            holed.remove(middle);
            let scene = [vec![a, b], holed].concat();
            assert_eq!(row(&scene, [0, 1], options(64)).class, Class::Sampled, "{name}");
        }
    }
}

#[test]
fn copies_of_a_triangle_are_counted() {
    let [a, b] = facing();
    let turned = [a[1], a[2], a[0]];
    let flipped = [a[1], a[0], a[2]];
    let surfaces = |triangles: &[Triangle]| Surfaces::new(&geometry(triangles), &[]);
    assert_eq!(surfaces(&[a, b]).duplicates(), 0);
    assert_eq!(surfaces(&[a, b, turned, flipped]).duplicates(), 2);
    // The triangles touch each other and do not block segments that leave them.
    assert_eq!(row(&[a, b, turned], [0, 1], options(64)).visibility, Some(1.0));
}
