//! Distributions against closed forms, and bit-exact values that implementations in other languages must reproduce.

use super::hash::{dimensions, path_key, pcg4d, pixel_key, unit};
use super::hemisphere::{Basis, concentric_disk, cosine};
use super::owen_sobol::{laine_karras, reversed_sobol, scramble_reversed};
use super::sine_noise;
use super::{HemisphereSampler, square_root};
use crate::trace::Directions;
use curitiba_pipeline::programs::Sampler;
use glam::{Vec2, Vec3};
use std::collections::HashSet;

/// Pearson's chi-square statistic of values in [0, 1) over 64 equal cells.
fn chi_square(values: &[f32]) -> f64 {
    let mut cells = [0u32; 64];
    values.iter().for_each(|v| cells[((v * 64.0) as usize).min(63)] += 1);
    let expected = values.len() as f64 / 64.0;
    cells.iter().map(|count| (f64::from(*count) - expected).powi(2) / expected).sum()
}

#[test]
fn the_hash_has_its_reference_values() {
    // Values from an independent implementation in another language.
    assert_eq!(pcg4d([0; 4]), [0x0f02_f829, 0x2d56_8769, 0x32b0_c43b, 0xd325_48ea]);
    assert_eq!(pcg4d([1, 2, 3, 4]), [0x3622_cd16, 0xf114_71d8, 0xe110_9b3f, 0x02b9_4c2f]);
    assert_eq!(pcg4d([u32::MAX; 4]), [0x974e_d892, 0xc015_dc67, 0x9f95_5760, 0xa1bb_a208]);
    assert_eq!(pixel_key(1023, 511, 42), 0x7779_a360);
}

#[test]
fn pixel_keys_are_uniform_and_distinct() {
    // 99.9 % of uniform samples have a statistic below 103 (63 degrees of freedom).
    for offset in [0, 1_000_000] {
        let keys: Vec<u32> = (0..512 * 512).map(|i| pixel_key(offset + i % 512, offset + i / 512, 7)).collect();
        let values: Vec<f32> = keys.iter().map(|key| unit(*key)).collect();
        assert!(chi_square(&values) < 103.0, "{}", chi_square(&values));
        // 2^18 draws from 2^24 values leave 260,106 distinct ones on average.
        let distinct = values.iter().map(|v| v.to_bits()).collect::<HashSet<_>>().len();
        assert!(distinct > 259_600, "{distinct}");
        let equal = keys.windows(2).filter(|pair| pair[0] == pair[1]).count();
        assert_eq!(equal, 0, "neighbours");
    }
}

#[test]
fn the_reports_noise_fails_far_from_the_origin() {
    // The negative control of the test above, and the reason for difference 4 of `docs/fidelity.md`: 512 x 512 points, 0.01 apart.
    let noise = |offset: f32| -> Vec<f32> {
        let at = |i: u32| offset + i as f32 * 0.01;
        (0..512 * 512).map(|i| sine_noise::rand(Vec2::new(at(i % 512), at(i / 512))).abs()).collect()
    };
    let equal = |values: &[f32]| {
        let pairs = values.chunks(512).flat_map(|row| row.windows(2));
        pairs.filter(|pair| pair[0] == pair[1]).count() as f64 / (511.0 * 512.0)
    };
    let (near, far) = (noise(0.0), noise(1e5));
    assert!(equal(&near) < 0.01 && equal(&far) > 0.5, "{} {}", equal(&near), equal(&far));
    assert!(chi_square(&far) > 1000.0, "{}", chi_square(&far));
    assert!(sine_noise::rand(Vec2::new(0.3, 0.0)) < 0.0, "the fraction keeps its sign");
}

#[test]
fn keys_of_pixels_paths_and_seeds_are_unrelated() {
    let key = pixel_key(3, 4, 5);
    let others = [
        pixel_key(4, 3, 5),
        pixel_key(3, 4, 6),
        pixel_key(3, 5, 4),
        path_key(key, 0),
        path_key(key, 1),
        path_key(path_key(key, 0), 1),
        path_key(path_key(key, 1), 0),
    ];
    for (i, a) in others.iter().enumerate() {
        for b in others[i + 1..].iter().chain([&key]) {
            // Unrelated words differ in 16 of 32 bits on average, with a standard deviation of 2.8.
            assert!((5..=27).contains(&(a ^ b).count_ones()), "{a:x} {b:x}");
        }
    }
    assert_ne!(dimensions(key, 0), dimensions(key, 1));
    assert_ne!(dimensions(key, 0)[0], dimensions(key, 0)[1]);
}

#[test]
fn unit_numbers_stay_below_one() {
    assert_eq!(unit(0), 0.0);
    assert_eq!(unit(u32::MAX), 1.0 - f32::EPSILON / 2.0);
    assert_eq!(unit(1 << 31), 0.5);
}

#[test]
fn sobol_points_have_their_reference_values() {
    // Computed from direction numbers (each is the one before, xor that one shifted right by one), in another language.
    let table: [(u32, u32, u32); 7] = [
        (0, 0, 0),
        (1, 0x8000_0000, 0x8000_0000),
        (2, 0x4000_0000, 0xc000_0000),
        (3, 0xc000_0000, 0x4000_0000),
        (5, 0xa000_0000, 0x2000_0000),
        (100, 0x2600_0000, 0xc600_0000),
        (65_535, 0xffff_0000, 0x0001_0000),
    ];
    for (index, x, y) in table {
        assert_eq!(reversed_sobol(index).map(u32::reverse_bits), [x, y], "{index}");
    }
    let scrambled = [(0, 0x1a35_c7cf), (1, 0xb911_fa0b), (2, 0x4843_a445), (100, 0x3203_6e7e), (65_535, 0xcb5f_eae2)];
    for (index, expected) in scrambled {
        assert_eq!(scramble_reversed(index, 0x1234_5678), expected, "{index}");
    }
    // Each bit depends only on the same and lower bits, so inputs with equal low bits have results with equal low bits.
    assert_eq!(laine_karras(0x5_1234, 99) & 0xffff, laine_karras(0xa_1234, 99) & 0xffff);
}

/// Number of elementary intervals of area 2^-k that do not hold exactly one of the first 2^k points.
fn misplaced(points: &[Vec2], k: u32) -> usize {
    let mut wrong = 0;
    for columns in 0..=k {
        let mut cells = vec![0u32; 1 << k];
        for point in points {
            let (x, y) = ((point.x * (1 << columns) as f32) as usize, (point.y * (1 << (k - columns)) as f32) as usize);
            cells[(y << columns) + x] += 1;
        }
        wrong += cells.iter().filter(|count| **count != 1).count();
    }
    wrong
}

#[test]
fn scrambled_sobol_points_fill_every_elementary_interval_once() {
    for k in 0..=8 {
        let sampler = HemisphereSampler::new(Sampler::Sobol, 1 << k).expect("any count is valid");
        for key in 0..50 {
            let mut points = Vec::new();
            sampler.points(pixel_key(key, 1, 2), |point| points.push(point));
            assert_eq!(misplaced(&points, k), 0, "2^{k} points, key {key}");
        }
    }
    let mut independent = Vec::new();
    (0..64).for_each(|i| independent.push(Vec2::from_array(dimensions(9, i).map(unit))));
    assert!(misplaced(&independent, 6) > 100, "control");
}

#[test]
fn each_stratum_holds_one_point() {
    let sampler = HemisphereSampler::new(Sampler::Strata, 49).expect("a square");
    assert_eq!(sampler.samples(), 49);
    for key in 0..50 {
        let mut cells = [0u32; 49];
        sampler.points(key, |p| cells[(p.x * 7.0) as usize * 7 + (p.y * 7.0) as usize] += 1);
        assert_eq!(cells, [1; 49]);
    }
    let message = HemisphereSampler::new(Sampler::Strata, 50).expect_err("not a square");
    assert!(message.contains("49 and 64"), "{message}");
    assert_eq!(square_root(65_536), Ok(256));
    assert!(square_root(u32::MAX).is_err());
}

#[test]
fn sample_coordinates_are_uniform_for_every_sampler() {
    for sampler in [Sampler::Sobol, Sampler::Strata] {
        for samples in [1, 4, 9, 100] {
            let directions = HemisphereSampler::new(sampler, samples).expect("a square");
            let (mut xs, mut ys) = (Vec::new(), Vec::new());
            for key in 0..60_000 / samples {
                directions.points(pixel_key(key, 0, 3), |p| {
                    xs.push(p.x);
                    ys.push(p.y);
                });
            }
            assert!(chi_square(&xs) < 103.0 && chi_square(&ys) < 103.0, "{sampler:?} {samples}");
            assert!(xs.iter().chain(&ys).all(|v| (0.0..1.0).contains(v)));
        }
    }
}

#[test]
fn bases_are_orthonormal_for_every_normal() {
    let mut normals = vec![
        Vec3::Z,
        Vec3::NEG_Z,
        Vec3::new(1e-20, 0.0, -1.0),
        Vec3::new(0.0, -1e-20, -1.0),
        Vec3::X,
        Vec3::NEG_Y,
        Vec3::new(1.0, 0.0, -0.0),
    ];
    for i in 0..200_000u32 {
        let [a, b, c, _] = pcg4d([i, 0, 0, 0]).map(unit);
        // Half of the normals have 1 + z log-uniform in 1e-12..1, where other constructions lose all digits.
        let z = if i % 2 == 0 { 2.0 * a - 1.0 } else { -1.0 + 10f32.powf(-12.0 * c) };
        let (sin, cos) = (std::f32::consts::TAU * b).sin_cos();
        let radius = if i % 2 == 0 { (1.0 - z * z).max(0.0).sqrt() } else { (2.0 * 10f32.powf(-12.0 * c)).sqrt() };
        normals.push(Vec3::new(radius * cos, radius * sin, z).normalize());
    }
    for normal in normals {
        let basis = Basis::around(normal);
        let (t, b, n) = (basis.tangent.as_dvec3(), basis.bitangent.as_dvec3(), normal.as_dvec3());
        let errors = [t.dot(b), t.dot(n), b.dot(n), t.length_squared() - 1.0, b.length_squared() - 1.0];
        let worst = errors.into_iter().map(f64::abs).fold(0.0, f64::max);
        assert!(worst <= 4e-7, "{normal}: {errors:?}");
        assert!(t.cross(b).dot(n) > 0.99, "right-handed");
    }
}

#[test]
fn the_concentric_map_keeps_areas_and_is_exact_on_its_axes() {
    assert_eq!(concentric_disk(Vec2::splat(0.5)), Vec2::ZERO);
    assert_eq!(concentric_disk(Vec2::new(0.0, 0.5)), Vec2::new(-1.0, 0.0));
    let side = 1000;
    let (mut inner, mut right, mut diagonal) = (0, 0, 0);
    for i in 0..side * side {
        let point = Vec2::new((i % side) as f32 + 0.5, (i / side) as f32 + 0.5) / side as f32;
        let disk = concentric_disk(point);
        assert!(disk.length() <= 1.0 + 1e-6);
        // The concentric map with functions of the standard library, in `f64`.
        let s = 2.0 * point - Vec2::ONE;
        let (radius, angle) = if s.x.abs() > s.y.abs() {
            (s.x, std::f64::consts::FRAC_PI_4 * f64::from(s.y) / f64::from(s.x))
        } else {
            (s.y, std::f64::consts::FRAC_PI_2 - std::f64::consts::FRAC_PI_4 * f64::from(s.x) / f64::from(s.y))
        };
        let reference = Vec2::new(angle.cos() as f32, angle.sin() as f32) * radius;
        assert!((disk - reference).length() < 3e-7, "{point}: {disk} {reference}");
        inner += usize::from(disk.length() < 0.5);
        right += usize::from(disk.x > 0.5);
        diagonal += usize::from(disk.x > disk.y && disk.y > 0.0);
    }
    let share = |count: usize| count as f64 / f64::from(side * side);
    assert!((share(inner) - 0.25).abs() < 1e-3 && (share(diagonal) - 0.125).abs() < 1e-3);
    // Area of the disk's segment beyond half the radius: 1/3 - √3 / (4π).
    assert!((share(right) - 0.195_501).abs() < 1e-3);
}

#[test]
fn hemisphere_directions_are_cosine_distributed_unit_vectors() {
    let sampler = HemisphereSampler::new(Sampler::Sobol, 256).expect("any count is valid");
    let normal = Vec3::new(0.3, -0.5, -0.8).normalize();
    let (mut directions, mut squares) = (Directions::default(), Vec::new());
    for key in 0..200 {
        sampler.directions(pixel_key(key, 0, 1), normal, None, &mut directions);
        for direction in directions.iter() {
            assert!((direction.length() - 1.0).abs() < 1e-6);
            let cos = direction.dot(normal);
            assert!(cos >= -1e-7);
            // The square of the cosine of a cosine-distributed direction is uniform.
            squares.push((cos * cos).min(1.0 - f32::EPSILON));
        }
    }
    assert!(chi_square(&squares) < 103.0, "{}", chi_square(&squares));
    assert_eq!(cosine(Vec2::splat(0.5)), Vec3::Z);
}

#[test]
fn the_reports_hemisphere_is_the_polar_map() {
    let direction = sine_noise::polar_cosine(Vec2::new(0.25, 0.25));
    assert!((direction - Vec3::new(0.0, 0.5, 0.75f32.sqrt())).length() < 1e-6);
    assert!(sine_noise::polar_cosine(Vec2::new(-0.01, 0.5)).x.is_nan());
    let basis = sine_noise::optix_basis(Vec3::new(0.6, 0.0, 0.8));
    assert!(basis.tangent.dot(basis.normal).abs() < 1e-7 && basis.bitangent == Vec3::new(0.0, -1.0, 0.0));
    assert!(sine_noise::optix_basis(Vec3::ZERO).bitangent.is_nan());
}

#[test]
fn directions_computed_in_vectors_are_those_of_their_points_bit_for_bit() {
    let normal = Vec3::new(0.3, -0.8, 0.5).normalize();
    let basis = Basis::around(normal);
    for (sampler, counts) in [(Sampler::Sobol, [1, 15, 16, 17, 100, 1000]), (Sampler::Strata, [1, 4, 16, 25, 100, 900])]
    {
        for samples in counts {
            let sampler = HemisphereSampler::new(sampler, samples).expect("a square");
            for key in 0..50 {
                let mut together = Directions::default();
                together.extend([Vec3::ONE; 3]);
                let mut alone = Vec::new();
                sampler.points(key, |point| alone.push(basis.to_world(cosine(point))));
                sampler.directions(key, normal, None, &mut together);
                assert!(together.iter().eq(alone.iter().copied()), "{samples} samples, key {key}");
                sampler.directions(key, normal, Some(Vec3::X), &mut together);
                assert_eq!(together.len(), alone.len());
                for (mirrored, direction) in together.iter().zip(&alone) {
                    assert_eq!(
                        mirrored,
                        if direction.x < 0.0 { *direction * Vec3::new(-1.0, 1.0, 1.0) } else { *direction }
                    );
                }
            }
        }
    }
}

#[test]
fn sobol_points_that_follow_each_other_lie_in_one_part_of_the_square() {
    let quarter = |point: &[u32; 2]| point.map(|coordinate| coordinate & 1);
    let changes = |points: &[[u32; 2]]| points.windows(2).filter(|pair| quarter(&pair[0]) != quarter(&pair[1])).count();
    let sequence: Vec<[u32; 2]> = (0..64).map(reversed_sobol).collect();
    assert!(changes(&sequence) > 30);
    let HemisphereSampler::Sobol(points) = HemisphereSampler::new(Sampler::Sobol, 64).expect("any number") else {
        panic!("another sampler");
    };
    assert_eq!(changes(&points), 3);
}
