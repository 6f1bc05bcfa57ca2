//! Tests against closed forms and independent implementations, and pictures that the metrics must refuse.
//!
//! The constants named `ORACLE` were printed by `tests/oracle/metrics.py` with flip-evaluator 1.7 and scikit-image 0.26.0
//! on numpy 2.4.6; the pictures here are made by the same integer formulas.

use super::*;

fn picture(width: u32, height: u32, value: impl Fn(i64, i64, i64) -> i64) -> Image {
    let pixel = |index: i64| {
        let (x, y) = (index % i64::from(width), index / i64::from(width));
        let channel = |c: i64| value(x, y, c) as f32 / 255.0;
        [channel(0), channel(1), channel(2), 1.0]
    };
    Image { width, height, pixels: (0..i64::from(width) * i64::from(height)).map(pixel).collect() }
}

fn smooth(x: i64, y: i64, c: i64) -> i64 {
    (x * 5 + y * 3 + c * 40) % 256
}

fn disc(x: i64, y: i64, c: i64) -> i64 {
    let inside = (x - 20).pow(2) + (y - 16).pow(2) < 64;
    if inside { (smooth(x, y, c) + 60).min(255) } else { smooth(x, y, c) }
}

fn noisy(x: i64, y: i64, c: i64) -> i64 {
    let noise = (x * 7919 + y * 104_729 + c * 1_299_709 + x * y * 31) % 25 - 12;
    (smooth(x, y, c) + noise).clamp(0, 255)
}

fn colored(x: i64, y: i64, c: i64) -> i64 {
    smooth(x, y, 2 - c)
}

fn other(x: i64, y: i64, c: i64) -> i64 {
    (x * x + 3 * y * y + c * 85) % 256
}

const WIDTH: u32 = 61;
const HEIGHT: u32 = 47;

struct Oracle {
    name: &'static str,
    value: fn(i64, i64, i64) -> i64,
    rmse: f64,
    psnr: f64,
    ssim: f64,
    /// FLIP at 67 and at 30 pixels per degree.
    flip: [f64; 2],
    /// FLIP at 67 pixels per degree, of the pixels (0, 0), (20, 16), (28, 16), (60, 46).
    pixels: [f64; 4],
}

const ORACLE: [Oracle; 4] = [
    Oracle {
        name: "disc",
        value: disc,
        rmse: 0.053_363_647,
        psnr: 25.455_090_0,
        ssim: 0.901_458_628,
        flip: [0.073_602, 0.058_325],
        pixels: [0.0, 0.741_840, 0.520_739, 0.0],
    },
    Oracle {
        name: "noisy",
        value: noisy,
        rmse: 0.027_965_478,
        psnr: 31.067_554_9,
        ssim: 0.932_065_837,
        flip: [0.066_804, 0.141_605],
        pixels: [0.051_558, 0.109_102, 0.070_076, 0.135_852],
    },
    Oracle {
        name: "colored",
        value: colored,
        rmse: 0.363_395_668,
        psnr: 8.792_405_1,
        ssim: 0.863_926_510,
        flip: [0.716_789, 0.738_202],
        pixels: [0.451_003, 0.795_370, 0.742_828, 0.346_295],
    },
    Oracle {
        name: "other",
        value: other,
        rmse: 0.400_980_856,
        psnr: 7.937_527_2,
        ssim: 0.025_519_376,
        flip: [0.776_843, 0.830_064],
        pixels: [0.768_600, 0.716_955, 0.971_029, 0.970_083],
    },
];

#[track_caller]
fn near(found: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((found - expected).abs() <= tolerance, "{what}: {found}, expected {expected}");
}

fn default(test: &Image, reference: &Image) -> Comparison {
    compare(test, reference, &Options::default()).expect("comparable")
}

#[test]
fn independent_programs_find_the_same_rmse_psnr_and_ssim() {
    let reference = picture(WIDTH, HEIGHT, smooth);
    for oracle in &ORACLE {
        let found = default(&picture(WIDTH, HEIGHT, oracle.value), &reference);
        near(found.rmse, oracle.rmse, 1e-8, oracle.name);
        near(found.psnr, oracle.psnr, 1e-6, oracle.name);
        near(found.ssim, oracle.ssim, 1e-6, oracle.name);
    }
}

/// The authors' program computes in 32-bit floats, this one in 64-bit floats.
#[test]
fn the_authors_program_finds_the_same_flip() {
    let reference = picture(WIDTH, HEIGHT, smooth);
    for oracle in &ORACLE {
        let test = picture(WIDTH, HEIGHT, oracle.value);
        for (pixels_per_degree, expected) in [67.0, 30.0].into_iter().zip(oracle.flip) {
            let options = Options { pixels_per_degree, ..Options::default() };
            let found = compare(&test, &reference, &options).expect("comparable");
            near(found.flip, expected, 2e-4, &format!("{} at {pixels_per_degree}", oracle.name));
        }
        let map = flip_map(&test, &reference, &Options::default()).expect("comparable");
        for ((x, y), expected) in [(0, 0), (20, 16), (28, 16), (60, 46)].into_iter().zip(oracle.pixels) {
            let found = map.values[y * WIDTH as usize + x];
            near(found, expected, 1e-3, &format!("{} at {x}, {y}", oracle.name));
        }
    }
}

#[test]
fn equal_pictures_have_no_error() {
    let image = picture(WIDTH, HEIGHT, other);
    let found = default(&image, &image);
    assert_eq!((found.rmse, found.relative_mse, found.max, found.outliers), (0.0, 0.0, 0.0, 0.0));
    assert_eq!((found.psnr, found.energy_ratio, found.flip), (f64::INFINITY, 1.0, 0.0));
    near(found.ssim, 1.0, 1e-12, "ssim");
    assert_eq!(found.pixels, u64::from(WIDTH * HEIGHT));
}

#[test]
fn constant_pictures_have_their_closed_forms() {
    let (test, reference) =
        (Image::filled(32, 16, [0.75, 0.75, 0.75, 1.0]), Image::filled(32, 16, [0.5, 0.5, 0.5, 1.0]));
    let found = default(&test, &reference);
    near(found.rmse, 0.25, 1e-12, "rmse");
    near(found.relative_mse, 0.0625 / 0.26, 1e-12, "relative mse");
    assert_eq!((found.max, found.outliers), (0.25, 1.0));
    near(found.psnr, -20.0 * 0.25_f64.log10(), 1e-9, "psnr");
    near(found.energy_ratio, 1.5, 1e-12, "energy");
    // Without variance only the luminance term of SSIM is left.
    near(found.ssim, (2.0 * 0.75 * 0.5 + 1e-4) / (0.5625 + 0.25 + 1e-4), 1e-9, "ssim");
    // No filter and no feature changes a constant: FLIP is the redistributed difference in L* of two greys.
    let lightness = |value: f64| 116.0 * ((value + 0.055) / 1.055).powf(2.4).cbrt() - 16.0;
    let difference = (lightness(0.75) - lightness(0.5)).powf(0.7);
    // HyAB of Hunt-adjusted green and blue, from their CIELAB values.
    let (green, blue) = ([87.7347, -86.1827, 83.1793], [32.2970, 79.1875, -107.8602]);
    let hunt = |lab: [f64; 3]| [lab[0], lab[0] * lab[1] / 100.0, lab[0] * lab[2] / 100.0];
    let (green, blue) = (hunt(green), hunt(blue));
    let largest = (green[0] - blue[0] + (green[1] - blue[1]).hypot(green[2] - blue[2])).powf(0.7);
    near(found.flip, 0.95 * difference / (0.4 * largest), 1e-4, "flip");
}

#[test]
fn black_against_white_and_against_black_is_the_whole_range() {
    let (black, white) = (Image::filled(20, 20, [0.0; 4]), Image::filled(20, 20, [1.0; 4]));
    let found = default(&white, &black);
    assert_eq!((found.rmse, found.max, found.energy_ratio), (1.0, 1.0, f64::INFINITY));
    near(found.relative_mse, 100.0, 1e-9, "relative mse");
    near(found.psnr, 0.0, 1e-12, "psnr");
    near(found.ssim, 1e-4 / 1.0001, 1e-9, "ssim");
    near(found.flip, 0.97, 0.02, "flip");
    assert_eq!(default(&black, &white).energy_ratio, 0.0);
    assert_eq!(default(&black, &black).energy_ratio, 1.0);
}

#[test]
fn a_single_pixel_is_counted_once() {
    let reference = Image::filled(40, 25, [0.5; 4]);
    let mut test = reference.clone();
    test.pixels[25 * 20 + 7][1] += 0.25;
    let found = default(&test, &reference);
    near(found.rmse, (0.0625_f64 / 3000.0).sqrt(), 1e-12, "rmse");
    assert_eq!(found.max, 0.25);
    near(found.outliers, 1.0 / 1000.0, 1e-15, "outliers");
    assert!(found.ssim < 1.0 && found.ssim > 0.8, "{found:?}");
    assert!(found.flip > 1e-5 && found.flip < 0.05, "{found:?}");
    let map = flip_map(&test, &reference, &Options::default()).expect("comparable");
    let largest = (0..map.values.len()).max_by(|a, b| map.values[*a].total_cmp(&map.values[*b]));
    assert_eq!(largest, Some(25 * 20 + 7));
    assert_eq!(map.values[24 * 40 + 39], 0.0, "far from the pixel");
}

#[test]
fn two_steps_of_eight_bits_are_no_outlier_and_three_are() {
    let reference = picture(16, 16, |_, _, _| 100);
    for (steps, share) in [(2, 0.0), (3, 1.0)] {
        assert_eq!(default(&picture(16, 16, |_, _, _| 100 + steps), &reference).outliers, share);
    }
    let options = Options { outlier_threshold: 1.5 / 255.0, ..Options::default() };
    let found = compare(&picture(16, 16, |_, _, _| 102), &reference, &options).expect("comparable");
    assert_eq!(found.outliers, 1.0);
}

#[test]
fn values_above_one_count_in_linear_metrics_and_not_in_what_is_displayed() {
    let (test, reference) = (Image::filled(16, 16, [4.0; 4]), Image::filled(16, 16, [2.0; 4]));
    let found = default(&test, &reference);
    assert_eq!((found.rmse, found.energy_ratio, found.flip), (2.0, 2.0, 0.0));
    near(found.ssim, 1.0, 1e-12, "ssim");
}

#[test]
fn a_mask_restricts_every_metric() {
    let reference = picture(WIDTH, HEIGHT, smooth);
    let mut test = reference.clone();
    let left: Vec<bool> = (0..WIDTH * HEIGHT).map(|index| index % WIDTH < 30).collect();
    for (pixel, left) in test.pixels.iter_mut().zip(&left) {
        if !left {
            *pixel = [1.0, 0.0, 1.0, 1.0];
        }
    }
    // Around these pixels, no window of SSIM and no filter of FLIP reaches the border at column 30.
    let far: Vec<bool> = (0..WIDTH * HEIGHT).map(|index| index % WIDTH < 15).collect();
    let found = compare(&test, &reference, &Options { mask: Some(&far), ..Options::default() }).expect("comparable");
    assert_eq!((found.rmse, found.max, found.outliers, found.energy_ratio), (0.0, 0.0, 0.0, 1.0));
    assert_eq!((found.pixels, found.flip), (u64::from(15 * HEIGHT), 0.0));
    near(found.ssim, 1.0, 1e-12, "ssim");
    let right: Vec<bool> = left.iter().map(|left| !left).collect();
    let found = compare(&test, &reference, &Options { mask: Some(&right), ..Options::default() }).expect("comparable");
    assert!(found.rmse > 0.3 && found.flip > 0.3 && found.ssim < 0.5 && found.outliers > 0.9, "{found:?}");
    let all = vec![true; left.len()];
    let masked = compare(&test, &reference, &Options { mask: Some(&all), ..Options::default() }).expect("comparable");
    assert_eq!(masked, default(&test, &reference));
    let corner: Vec<bool> = (0..WIDTH * HEIGHT).map(|index| index == 0).collect();
    let found = compare(&test, &reference, &Options { mask: Some(&corner), ..Options::default() }).expect("comparable");
    near(found.ssim, 1.0, 1e-12, "the nearest window serves a pixel at the edge");
}

#[test]
fn pictures_smaller_than_the_window_are_compared() {
    for (width, height) in [(1, 1), (1, 40), (40, 1), (3, 3), (10, 11), (11, 10)] {
        let reference = picture(width, height, smooth);
        let same = default(&reference, &reference);
        near(same.ssim, 1.0, 1e-12, "ssim");
        let found = default(&picture(width, height, |x, y, c| 255 - smooth(x, y, c)), &reference);
        assert!(found.ssim < 0.9 && found.flip > 0.1, "{width} x {height}: {found:?}");
    }
}

#[test]
fn what_cannot_be_compared_says_why() {
    let image = Image::filled(4, 3, [0.5; 4]);
    let fails = |test: &Image, options: &Options<'_>| compare(test, &image, options).expect_err("not comparable");
    let options = Options::default();
    assert!(matches!(fails(&Image::filled(3, 4, [0.5; 4]), &options), MetricError::Size { test: [3, 4], .. }));
    let empty = Image::filled(0, 3, [0.0; 4]);
    assert!(matches!(compare(&empty, &empty, &options), Err(MetricError::Empty { .. })));
    let short = Image { pixels: vec![[0.5; 4]; 11], ..image.clone() };
    assert!(matches!(fails(&short, &options), MetricError::Malformed { pixels: 11, .. }));
    let mut broken = image.clone();
    broken.pixels[6] = [0.5, f32::NEG_INFINITY, f32::NAN, 1.0];
    broken.pixels[9][0] = f32::NAN;
    let message = fails(&broken, &options).to_string();
    assert!(
        message.contains("2 pixels") && message.contains("x 2, y 1") && message.contains("green is -inf"),
        "{message}"
    );
    let alpha = Image::filled(4, 3, [0.5, 0.5, 0.5, f32::NAN]);
    assert!(compare(&alpha, &image, &options).is_ok(), "alpha is not compared");
    assert!(matches!(fails(&image, &Options { mask: Some(&[true]), ..options }), MetricError::Mask { mask: 1, .. }));
    let mask = [false; 12];
    assert_eq!(fails(&image, &Options { mask: Some(&mask), ..options }), MetricError::TooFew { left: 0, floor: 1 });
    assert!(matches!(fails(&image, &Options { min_pixels: 13, ..options }), MetricError::TooFew { left: 12, .. }));
    for wrong in [f64::NAN, 0.0, 1e9] {
        let options = Options { pixels_per_degree: wrong, ..options };
        assert!(matches!(fails(&image, &options), MetricError::Option { name: "pixels per degree", .. }));
    }
    assert!(matches!(fails(&image, &Options { outlier_threshold: -1.0, ..options }), MetricError::Option { .. }));
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let (test, reference) = (picture(150, 140, noisy), picture(150, 140, smooth));
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| default(&test, &reference))
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn every_metric_is_in_the_registry_once_and_reads_its_own_value() {
    let found = Comparison {
        pixels: 9,
        rmse: 1.0,
        relative_mse: 2.0,
        max: 3.0,
        psnr: 4.0,
        ssim: 5.0,
        flip: 6.0,
        energy_ratio: 7.0,
        outliers: 8.0,
    };
    let values: Vec<f64> = METRICS.iter().map(|metric| (metric.value)(&found)).collect();
    assert_eq!(values, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
}

#[test]
fn infinities_survive_json() {
    let black = Image::filled(2, 2, [0.0; 4]);
    for test in [black.clone(), Image::filled(2, 2, [1.0; 4])] {
        let found = default(&test, &black);
        let text = serde_json::to_string(&found).expect("JSON");
        assert!(text.contains("null"), "{text}");
        assert_eq!(serde_json::from_str::<Comparison>(&text).expect("JSON"), found);
    }
}
