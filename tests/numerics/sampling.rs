//! Statistics of the samples: moments, correlations, and the error of ambient occlusion against the number of samples.

use curitiba_passes::sampling::hash::{dimensions, path_key, pcg4d, pixel_key, unit};
use curitiba_passes::sampling::{HemisphereSampler, sine_noise};
use curitiba_passes::trace::Directions;
use curitiba_pipeline::programs::Sampler;
use glam::{Vec2, Vec3};

const SIDE: u32 = 256;

/// Pearson's correlation coefficient.
fn correlation(a: &[f32], b: &[f32]) -> f64 {
    let count = a.len() as f64;
    let mean = |v: &[f32]| v.iter().map(|x| f64::from(*x)).sum::<f64>() / count;
    let (ma, mb) = (mean(a), mean(b));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        let (x, y) = (f64::from(*x) - ma, f64::from(*y) - mb);
        ab += x * y;
        aa += x * x;
        bb += y * y;
    }
    ab / (aa * bb).sqrt()
}

/// One number for each pixel of a grid; `at` returns the number for a column and a row.
fn grid(at: impl Fn(u32, u32) -> f32) -> Vec<f32> {
    (0..SIDE * SIDE).map(|i| at(i % SIDE, i / SIDE)).collect()
}

/// Greatest correlation of a grid with itself, shifted by some pixels.
fn self_correlation(at: impl Fn(u32, u32) -> f32) -> f64 {
    let plain = grid(&at);
    let shifts = [(1, 0), (0, 1), (1, 1), (2, 0), (16, 0), (0, 64), (255, 1)];
    shifts.iter().map(|(x, y)| correlation(&plain, &grid(|i, j| at(i + x, j + y))).abs()).fold(0.0, f64::max)
}

/// Five standard deviations of the correlation coefficient of independent numbers.
const UNRELATED: f64 = 5.0 / SIDE as f64;

#[test]
fn numbers_of_neighbouring_and_far_pixels_dimensions_and_seeds_are_not_correlated() {
    for far in [0, 4096, 1_000_000, u32::MAX - 2 * SIDE] {
        for seed in [0, 1, 77] {
            let first = |x: u32, y: u32| unit(dimensions(pixel_key(far + x, far + y, seed), 3)[0]);
            let found = self_correlation(first);
            assert!(found < UNRELATED, "{far} {seed}: {found}");
            let plain = grid(first);
            let others = [
                grid(|x, y| unit(dimensions(pixel_key(far + x, far + y, seed), 3)[1])),
                grid(|x, y| unit(dimensions(pixel_key(far + x, far + y, seed), 4)[0])),
                grid(|x, y| unit(dimensions(pixel_key(far + x, far + y, seed + 1), 3)[0])),
                grid(|x, y| unit(dimensions(path_key(pixel_key(far + x, far + y, seed), 0), 3)[0])),
                grid(|x, y| unit(dimensions(path_key(pixel_key(far + x, far + y, seed), 1), 3)[0])),
            ];
            for (index, other) in others.iter().enumerate() {
                let found = correlation(&plain, other).abs();
                assert!(found < UNRELATED, "{far} {seed}, number {index}: {found}");
            }
        }
    }
    // Negative control: the report's noise, far from the origin.
    let found = self_correlation(|x, y| sine_noise::rand(Vec2::new(1e5 + x as f32 * 0.01, 1e5 + y as f32 * 0.01)));
    assert!(found > 0.5, "{found}");
}

#[test]
fn sample_points_have_the_moments_of_uniform_numbers() {
    for sampler in [Sampler::Sobol, Sampler::Strata] {
        for samples in [1, 4, 16, 64] {
            let points = HemisphereSampler::new(sampler, samples).expect("a square");
            let pixels = 200_000 / samples;
            let mut sums = [0.0_f64; 6];
            for pixel in 0..pixels {
                points.points(pixel_key(pixel % 512, pixel / 512, 9), |p| {
                    let (x, y) = (f64::from(p.x), f64::from(p.y));
                    let terms = [x, y, x * x, y * y, x * y, x * x * x];
                    sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
                });
            }
            let count = f64::from(pixels * samples);
            for (sum, expected) in sums.iter().zip([0.5, 0.5, 1.0 / 3.0, 1.0 / 3.0, 0.25, 0.25]) {
                // Five standard deviations for independent numbers; stratified ones are closer.
                assert!((sum / count - expected).abs() < 5.0 * 0.3 / count.sqrt(), "{sampler:?} {samples}: {sums:?}");
            }
        }
    }
}

/// Distance of a wall in radii, for which the open share has a closed form.
const DISTANCE: f64 = 0.3;

fn closed_form() -> f64 {
    1.0 - (DISTANCE.acos() - DISTANCE * (1.0 - DISTANCE * DISTANCE).sqrt()) / std::f64::consts::PI
}

/// Root mean square error and bias over many pixels; `directions` writes a pixel's directions.
fn error(samples: u32, mut directions: impl FnMut(u32, &mut Directions)) -> (f64, f64) {
    const PIXELS: u32 = 10_000;
    let mut buffer = Directions::default();
    let (mut square, mut sum) = (0.0, 0.0);
    for pixel in 0..PIXELS {
        directions(pixel, &mut buffer);
        // The wall is rotated against the axes of the samples.
        let toward = Vec2::from_angle(3.7).as_dvec2();
        let blocked = |d: &Vec3| DISTANCE < d.truncate().as_dvec2().dot(toward);
        let open = 1.0 - buffer.iter().filter(blocked).count() as f64 / f64::from(samples);
        square += (open - closed_form()).powi(2);
        sum += open - closed_form();
    }
    ((square / f64::from(PIXELS)).sqrt(), sum / f64::from(PIXELS))
}

#[test]
fn the_error_of_ambient_occlusion_falls_with_the_samples_as_documented() {
    // Greatest errors at 4, 16, 64 and 256 samples, and the slope from 16 to 256.
    let limits = [
        ("sobol", [0.136, 0.0505, 0.0195, 0.0062], -0.65),
        ("strata", [0.175, 0.059, 0.0215, 0.0076], -0.65),
        ("independent", [0.235, 0.120, 0.0600, 0.0300], -0.45),
    ];
    for (name, errors, slope) in limits {
        let mut found = Vec::new();
        for samples in [4_u32, 16, 64, 256] {
            let ours = match name {
                "sobol" => Some(Sampler::Sobol),
                "strata" => Some(Sampler::Strata),
                _ => None,
            };
            let ours = ours.map(|sampler| HemisphereSampler::new(sampler, samples).expect("a square"));
            let (rms, bias) = error(samples, |pixel, directions| match &ours {
                Some(sampler) => sampler.directions(pixel_key(pixel % 100, pixel / 100, 5), Vec3::Z, None, directions),
                None => {
                    directions.clear();
                    directions.extend((0..samples).map(|sample| {
                        let [x, y, ..] = pcg4d([pixel, sample, 1, 2]).map(unit);
                        let (sin, cos) = (std::f32::consts::TAU * y).sin_cos();
                        Vec3::new(x.sqrt() * cos, x.sqrt() * sin, (1.0 - x).sqrt())
                    }));
                }
            });
            // Four standard deviations of the mean over ten thousand pixels.
            assert!(bias.abs() < 4.0 * rms / 100.0, "{name} {samples}: bias {bias}");
            found.push(rms);
        }
        let fall = (found[3] / found[1]).ln() / 16_f64.ln();
        println!("{name}: {:.4} {:.4} {:.4} {:.4}, slope {fall:.2}", found[0], found[1], found[2], found[3]);
        assert!(found.iter().zip(errors).all(|(found, limit)| *found < limit), "{name}: {found:?}");
        assert!(
            if name == "independent" { fall > -0.55 && fall < slope } else { fall < slope },
            "{name}: slope {fall}"
        );
    }
}

#[test]
fn the_errors_of_neighbouring_pixels_are_not_correlated() {
    for sampler in [Sampler::Sobol, Sampler::Strata] {
        let directions = HemisphereSampler::new(sampler, 4).expect("a square");
        let open = |x: u32, y: u32| {
            let mut buffer = Directions::default();
            directions.directions(pixel_key(x, y, 11), Vec3::Z, None, &mut buffer);
            buffer.iter().filter(|d| !(d.x < 0.0 && DISTANCE < -f64::from(d.x))).count() as f32
        };
        let found = self_correlation(open);
        assert!(found < UNRELATED, "{sampler:?}: {found}");
    }
}
