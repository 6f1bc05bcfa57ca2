//! Light that a sphere focuses, against closed forms and against rays that are counted where they arrive.

use crate::effects::dielectric::ball::{Ball, Bundle, Turned};
use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};

/// Fresnel's share of unpolarised light, in `f64`.
fn reflectance(cos: f64, index: f64) -> f64 {
    let inner = (1.0 - (1.0 - cos * cos) / (index * index)).sqrt();
    let (s, p) = ((cos - index * inner) / (cos + index * inner), (index * cos - inner) / (index * cos + inner));
    0.5 * (s * s + p * p)
}

fn clear(index: f64) -> impl Fn(&Turned) -> DVec3 {
    move |ray| DVec3::splat((1.0 - reflectance(ray.cos, index)).powi(2))
}

/// The irradiance at the point `at` of a plane perpendicular to the axis, and the bundles that bring it.
fn irradiance(ball: &Ball, index: f64, at: DVec2, width: f64) -> (f64, Vec<Bundle>) {
    let mut bundles = Vec::new();
    ball.bundles(at, width, clear(index), |bundle| bundles.push(bundle));
    (bundles.iter().map(|bundle| bundle.strength.x * bundle.ray.direction.y).sum(), bundles)
}

/// The mean irradiance of a ring of a plane perpendicular to the axis.
fn ring(ball: &Ball, index: f64, height: f64, [inner, outer]: [f64; 2], steps: u32) -> f64 {
    let square =
        |step: u32| inner * inner + (outer * outer - inner * inner) * (f64::from(step) + 0.5) / f64::from(steps);
    let sum: f64 =
        (0..steps).map(|step| irradiance(ball, index, DVec2::new(square(step).sqrt(), height), 1e-3).0).sum();
    sum / f64::from(steps)
}

#[test]
fn on_the_axis_the_strength_is_that_of_a_thick_lens() {
    for (index, height, width) in
        [(1.5_f64, 2.0_f64, 1e-4), (1.5, 3.0, 1e-4), (1.33, 1.2, 1e-4), (2.42, 4.0, 1e-4), (1.05, 1.0, 1e-4)]
    {
        let focal = index / (2.0 * (index - 1.0));
        let faces = (4.0 * index / ((index + 1.0) * (index + 1.0))).powi(2);
        let expected = faces / (1.0 - height / focal).powi(2);
        let (_, bundles) = irradiance(&Ball::new(index), index, DVec2::new(0.0, height), width);
        // The middle bundle alone: other rays may cross the axis there, too.
        let middle = bundles.iter().filter(|bundle| bundle.ray.sin < 0.01);
        let found: f64 = middle.map(|bundle| bundle.strength.x).sum();
        assert!((found / expected - 1.0).abs() < 1e-5, "{index} {height}: {found} {expected}");
    }
    let at_two = irradiance(&Ball::new(1.5), 1.5, DVec2::new(0.0, 2.0), 1e-4).0;
    assert!((at_two - 8.2944).abs() < 1e-3, "{at_two}");
    // Control: without Fresnel's share it would be 9.
    assert!((at_two - 9.0).abs() > 0.5);
}

#[test]
fn rings_below_a_sphere_have_the_means_of_an_independent_computation() {
    let ball = Ball::new(1.5);
    let rings = [
        ([0.0, 0.1], 6.807),
        ([0.1, 0.2], 4.058),
        ([0.2, 0.3], 2.234),
        ([0.3, 0.5], 1.039),
        ([0.5, 1.0], 0.2768),
        ([1.0, 2.0], 0.0384),
    ];
    for (range, expected) in rings {
        let found = ring(&ball, 1.5, 2.0, range, 400);
        assert!((found / expected - 1.0).abs() < 2e-3, "{range:?}: {found} {expected}");
    }
    let off = ring(&Ball::new(1.53), 1.53, 2.0, [0.0, 0.1], 400);
    assert!((off / 6.807 - 1.0).abs() > 0.1, "control: {off}");
}

/// Refracts by Snell's law in vectors. Returns the direction and the share that is let through.
fn refract(direction: DVec3, normal: DVec3, ratio: f64) -> (DVec3, f64) {
    let cos = -direction.dot(normal);
    let inner = (1.0 - ratio * ratio * (1.0 - cos * cos)).sqrt();
    let index = 1.0 / ratio;
    let share = if index > 1.0 { reflectance(cos, index) } else { reflectance(inner, ratio) };
    (ratio * direction + (ratio * cos - inner) * normal, 1.0 - share)
}

/// Follows a ray that meets the sphere at (x, y), by vectors in three dimensions: where it leaves, its direction, and the share that it keeps.
fn through(x: f64, y: f64, index: f64) -> (DVec3, DVec3, f64) {
    let entry = DVec3::new(x, y, -(1.0 - x * x - y * y).sqrt());
    let (inside, first) = refract(DVec3::Z, entry, 1.0 / index);
    let exit = entry - 2.0 * entry.dot(inside) * inside;
    let (direction, second) = refract(inside, -exit, index);
    (exit, direction, first * second)
}

/// Light on a screen of any tilt, cell by cell: the light of counted rays against the light of bundles.
#[test]
fn screens_of_any_tilt_get_what_counted_rays_bring() {
    let side = 1000;
    let step = 2.0 / f64::from(side);
    for (index, center, normal, half) in [
        (1.5, DVec3::new(0.1, -0.05, 2.0), DVec3::new(0.0, 0.0, -1.0), 0.5),
        (1.5, DVec3::new(0.3, 0.2, 2.6), DVec3::new(0.5, 0.3, -1.0), 0.4),
        (1.33, DVec3::new(0.3, 0.4, 3.0), DVec3::new(-1.0, 0.4, -0.6), 0.2),
        (2.42, DVec3::new(0.0, 0.9, 1.4), DVec3::new(0.1, -1.0, -0.2), 0.3),
    ] {
        let normal: DVec3 = normal.normalize();
        let (u, v) = normal.any_orthonormal_pair();
        const CELLS: usize = 6;
        let mut counted = [[0.0; CELLS]; CELLS];
        for row in 0..side {
            for column in 0..side {
                let place = |index: u32| (f64::from(index) + 0.5) * step - 1.0;
                let (x, y) = (place(column), place(row));
                if x * x + y * y >= 1.0 {
                    continue;
                }
                let (exit, direction, kept) = through(x, y, index);
                let t = (center - exit).dot(normal) / direction.dot(normal);
                let met = exit + t * direction - center;
                let cell = |axis: DVec3| ((met.dot(axis) / half + 1.0) * 0.5 * CELLS as f64).floor();
                let (i, j) = (cell(u), cell(v));
                let inside = |cell: f64| (0.0..CELLS as f64).contains(&cell);
                if t > 0.0 && direction.dot(normal) < 0.0 && inside(i) && inside(j) {
                    counted[i as usize][j as usize] += kept * step * step;
                }
            }
        }
        let ball = Ball::new(index);
        let area = (2.0 * half / CELLS as f64).powi(2);
        const FINE: usize = 8;
        let (mut worst, mut brightest): (f64, f64) = (0.0, 0.0);
        for (i, column) in counted.iter().enumerate() {
            for (j, light) in column.iter().enumerate() {
                let mut sum = 0.0;
                for fine in 0..FINE * FINE {
                    let place = |cell: usize, part: usize| {
                        half * (2.0 * (cell as f64 + (part as f64 + 0.5) / FINE as f64) / CELLS as f64 - 1.0)
                    };
                    let point = center + u * place(i, fine % FINE) + v * place(j, fine / FINE);
                    let away = DVec3::new(point.x, point.y, 0.0);
                    ball.bundles(DVec2::new(away.length(), point.z), 1e-3, clear(index), |bundle| {
                        let turned = bundle.ray.direction;
                        let direction = away.normalize() * (bundle.side * turned.x) + DVec3::Z * turned.y;
                        sum += bundle.strength.x * (-direction.dot(normal)).max(0.0);
                    });
                }
                let (found, counted) = (sum / (FINE * FINE) as f64, light / area);
                worst = worst.max((found - counted).abs());
                brightest = brightest.max(counted);
            }
        }
        assert!(brightest > 0.2 && worst < 0.02 * brightest.max(1.0), "{index} {center}: {worst} of {brightest}");
    }
}

#[test]
fn a_far_plane_gets_all_the_light_that_passes() {
    for (index, height, expected) in [(1.33, 3.0, 0.882_30), (1.33, 50.0, 0.882_30), (1.2, 20.0, f64::NAN)] {
        // All that passes the faces: the integral of (1 - R)² over the disc.
        let steps = 20_000;
        let share = |step: u32| {
            let square = (f64::from(step) + 0.5) / f64::from(steps);
            (1.0 - reflectance((1.0 - square).sqrt(), index)).powi(2)
        };
        let passes = (0..steps).map(share).sum::<f64>() / f64::from(steps);
        assert!(expected.is_nan() || (passes - expected).abs() < 2e-5, "{passes}");
        // Rings whose radii are tangents of equal steps of the angle, up to the largest.
        let largest = 2.0 * (FRAC_PI_2 - (1.0 / index).asin());
        let (ball, rings) = (Ball::new(index), 4000);
        let radius =
            |ring: f64| (height + 1.0) * (largest * ring / f64::from(rings)).tan() + 1.0 * ring / f64::from(rings);
        let sum: f64 = (0..rings)
            .map(|ring| {
                let [inner, middle, outer] = [0.0, 0.5, 1.0].map(|part| radius(f64::from(ring) + part));
                let area = outer * outer - inner * inner;
                area * irradiance(&ball, index, DVec2::new(middle, height), 1e-3).0
            })
            .sum();
        assert!((sum - passes).abs() < 2e-3, "{index} {height}: {sum} {passes}");
    }
}

#[test]
fn the_bright_ring_of_a_fold_is_where_rays_turn_back() {
    let (ball, height) = (Ball::new(1.33), 1.2);
    let light = |step: u32| irradiance(&ball, 1.33, DVec2::new(f64::from(step) * 1e-4, height), 1e-3).0;
    let brightest = (1000..4000).max_by(|a, b| light(*a).total_cmp(&light(*b))).expect("some");
    // The fold is at the maximum of rho(i), found by steps; rho is the coordinate x at which a ray meets the plane.
    let rho = |step: u32| {
        let ray = Turned::at(FRAC_PI_2 * f64::from(step) / 1e5, 1.33);
        let exit = ray.exit();
        exit.x + ray.direction.x / ray.direction.y * (height - exit.y)
    };
    let fold = (0..70_000).map(rho).fold(0.0, f64::max);
    assert!((fold - 0.2065).abs() < 2e-4, "{fold}");
    assert!((f64::from(brightest) * 1e-4 - fold).abs() < 2e-3, "{brightest} {fold}");
}

#[test]
fn nothing_is_infinite_and_the_width_keeps_the_sum() {
    for index in [1.33, 1.5, 2.42] {
        let ball = Ball::new(index);
        // The focus, the axis before it, folds and the sphere itself.
        for height in [-2.0, -0.5, 0.0, 0.9, 1.01, 1.2, index / (2.0 * (index - 1.0)), 3.0, 1e4] {
            for radius in [0.0, 1e-9, 1e-3, 0.1, 0.2065, 0.9, 1.0, 1.5, 100.0] {
                let at = DVec2::new(radius, height);
                for width in [1e-4, 1e-3, 0.05, 2.0] {
                    ball.bundles(
                        at,
                        width,
                        |_| DVec3::ONE,
                        |bundle| {
                            let strength = bundle.strength.x;
                            // The bound: all the light of the sphere goes through the disc.
                            assert!(
                                strength >= 0.0 && strength <= 1.01 / (width * width),
                                "{index} {at} {width}: {strength}"
                            );
                        },
                    );
                }
            }
        }
        // The sum over a disc about the axis does not depend on the width by which points are blurred.
        let sum = |width: f64| -> f64 {
            let steps = 3000;
            let radius = |step: u32| 0.8 * (f64::from(step) + 0.5) / f64::from(steps);
            let at = |step: u32| DVec2::new(radius(step), 1.3);
            (0..steps).map(|step| radius(step) * irradiance(&ball, index, at(step), width).0).sum::<f64>() * 0.8
                / f64::from(steps)
        };
        let [fine, coarse] = [1e-3, 2e-2].map(sum);
        assert!((fine / coarse - 1.0).abs() < 0.02, "{index}: {fine} {coarse}");
    }
}

#[test]
fn a_sphere_that_hardly_bends_light_leaves_it_as_it_is() {
    let index = 1.0 + 1e-9;
    let ball = Ball::new(index);
    for height in [1.5, 4.0, 20.0] {
        for (radius, tolerance) in [(0.0, 1e-5), (0.1, 1e-5), (0.5, 1e-5), (0.9, 1e-5), (0.99, 2e-4)] {
            let (light, bundles) = irradiance(&ball, index, DVec2::new(radius, height), 1e-3);
            assert!((light - 1.0).abs() < tolerance, "{height} {radius}: {light}");
            let rays: Vec<f64> = bundles.iter().map(|bundle| bundle.ray.sin * bundle.side).collect();
            assert!(rays.len() == 1 && (rays[0] - radius).abs() < 1e-4 || radius == 0.0, "{rays:?}");
        }
        assert_eq!(irradiance(&ball, index, DVec2::new(1.01, height), 1e-3).0, 0.0);
    }
}

#[test]
fn rays_are_turned_by_the_closed_form_and_pass_at_their_distance() {
    for index in [1.1_f64, 1.33, 1.5, 2.42] {
        for step in 1..90 {
            let incidence = f64::from(step) * PI / 180.0;
            let ray = Turned::at(incidence, index);
            let turned = 2.0 * (incidence - (incidence.sin() / index).asin());
            let found = (-ray.direction.x).atan2(ray.direction.y);
            assert!((found - turned).abs() < 1e-12, "{index} {step}");
            let (exit, direction, _) = through(incidence.sin(), 0.0, index);
            assert!((ray.exit() - DVec2::new(exit.x, exit.z)).length() < 1e-9, "{index} {step}");
            assert!((ray.direction - DVec2::new(direction.x, direction.z)).length() < 1e-9);
            assert!(((ray.exit() - ray.entry()).length() - 2.0 * ray.inner).abs() < 1e-12);
        }
    }
}
