//! Light that a sphere focuses, as programs sum it in 32 bits, against `Ball::bundles` in `f64`, point by point.

use super::functions::{Random, answers};
use super::rays;
use crate::effects::dielectric::ball::{Ball, Turned};
use crate::wgpu_rays::WgpuRays;
use crate::wgpu_rays::{lenses, programs};
use glam::{DVec2, DVec3};

/// Numbers of input, and words of output, of a case.
const GIVEN: usize = 8;
const WORDS: usize = 6;

const ENTRY: &str = "
fn point_place(point: u32) -> u32 { return 2u * point; }
fn kept_by(ray: Turned) -> vec3f { return vec3f(1.0, ray.cos, ray.inner); }
var<private> total: vec3f;
var<private> moment: vec2f;
var<private> number: f32;
fn take_bundle(bundle: Bundle, ray: Turned, side: f32) {
    total += bundle.strength;
    moment += bundle.strength.x * vec2f(-side * ray.turn_sin, ray.turn_cos);
    number += 1.0;
}
@compute @workgroup_size(64) fn functions(@builtin(global_invocation_id) id: vec3u) {
    let k = 8u * id.x;
    if k + params.zero >= arrayLength(&given) { return; }
    let x = Wide(given[k], given[k + 1u]);
    let width = given[k + 4u];
    let reach = select(width, width + x.h, x.h < width);
    find_bundles(Aim(x, Wide(given[k + 2u], given[k + 3u]), width, reach, given[k + 5u], u32(given[k + 6u])));
    let o = 6u * id.x;
    put3(o, total); put(o + 3u, moment.x); put(o + 4u, moment.y); put(o + 5u, number);
}
";

const INDICES: [f32; 4] = [1.05, 1.33, 1.5, 2.42];

#[derive(Debug, Clone, Copy)]
struct Case {
    ball: usize,
    at: DVec2,
    width: f32,
}

/// Distance from the axis at which the ray of an angle of incidence meets a plane perpendicular to the axis.
fn met(index: f64, incidence: f64, height: f64) -> f64 {
    let ray = Turned::at(incidence, index);
    let exit = ray.exit();
    exit.x + ray.direction.x / ray.direction.y * (height - exit.y)
}

/// Distances from the axis at which rays are densest on a plane, because the distance has an extremum over the angle of incidence: the bright
/// rings.
fn folds(index: f64, height: f64) -> Vec<f64> {
    let steps = 4000;
    let end = 0.98 * Turned::at(1.0, index).sin.asin().max(0.9);
    let radius = |step: i32| met(index, end * f64::from(step) / f64::from(steps), height);
    (1..steps)
        .filter(|step| (radius(*step) - radius(step - 1)) * (radius(step + 1) - radius(*step)) <= 0.0)
        .map(|step| radius(step).abs())
        .collect()
}

fn cases() -> Vec<Case> {
    let mut random = Random(23);
    let mut cases = Vec::new();
    for (ball, index) in INDICES.into_iter().enumerate() {
        let mut add = |x: f64, y: f64, width: f32| {
            if x * x + y * y > 1.02 && x >= 0.0 {
                // Programs get positions in two numbers, which have 48 bits together.
                cases.push(Case { ball, at: DVec2::new(x, y), width });
            }
        };
        for width in [1e-3_f32, 5e-3, 0.05, 1.5] {
            for _ in 0..700 {
                let far = f64::from(random.unit() * 5.0).exp2();
                let angle = f64::from(random.unit()) * std::f64::consts::PI;
                add(far * angle.sin(), far * angle.cos(), width);
                // Near the axis, at a distance of up to four widths, and on it.
                let near = f64::from(random.unit() * random.unit()) * 4.0 * f64::from(width);
                add(near, far.max(1.03), width);
                add(0.0, far.max(1.03), width);
            }
            for step in 0..40 {
                let height = 1.03 + 0.05 * f64::from(step);
                for fold in folds(index.into(), height) {
                    for part in [-3.0, -1.0, -0.3, 0.0, 0.4, 1.1, 5.0] {
                        add(fold + part * f64::from(width), height, width);
                    }
                }
            }
        }
    }
    cases
}

/// In `f64`: the sums of strengths, plain and times both cosines of the ray; the sum of strengths times directions; the number of bundles.
fn expected(ball: &Ball, case: &Case) -> (DVec3, DVec2, u32) {
    let (mut total, mut moment, mut number) = (DVec3::ZERO, DVec2::ZERO, 0);
    let kept = |ray: &Turned| DVec3::new(1.0, ray.cos, ray.inner);
    ball.bundles(case.at, case.width.into(), kept, |bundle| {
        total += bundle.strength;
        moment += bundle.strength.x * DVec2::new(bundle.side * bundle.ray.direction.x, bundle.ray.direction.y);
        number += 1;
    });
    (total, moment, number)
}

/// The device's output for each case; `change` is applied to the source of the programs.
fn found(rays: &WgpuRays, balls: &[Ball], cases: &[Case], change: impl Fn(String) -> String) -> Vec<[f32; WORDS]> {
    let mut tables: Vec<u32> =
        balls[0].quadratures().flat_map(|point| point.as_vec2().to_array()).map(f32::to_bits).collect();
    let places: Vec<u32> = balls
        .iter()
        .map(|ball| {
            let place = tables.len() as u32;
            tables.extend(lenses::nodes(ball));
            place
        })
        .collect();
    let given: Vec<[f32; GIVEN]> = cases
        .iter()
        .map(|Case { ball, at, width }| {
            let [[x, x_rest], [y, y_rest]] = at.to_array().map(|number| {
                let high = number as f32;
                [high, (number - f64::from(high)) as f32]
            });
            [x, x_rest, y, y_rest, *width, INDICES[*ball], places[*ball] as f32, 0.0]
        })
        .collect();
    let text = change(programs::ball(rays.arithmetic)) + ENTRY;
    let words: Vec<[u32; WORDS]> = answers(&rays.gpu, text, (&[], &tables), &given);
    words.into_iter().map(|words| words.map(f32::from_bits)).collect()
}

/// Errors relative to the light, or to a thousandth of the sun's light where that is more: the largest, the root mean square, and the case
/// of the largest.
#[derive(Debug)]
struct Errors {
    largest: f64,
    mean: f64,
    worst: Option<Case>,
}

fn errors<'c>(pairs: impl Iterator<Item = (&'c Case, f64, f64)>) -> Errors {
    let mut errors = Errors { largest: 0.0, mean: 0.0, worst: None };
    let mut number = 0.0;
    for (case, found, expected) in pairs {
        let error = (found - expected).abs() / expected.abs().max(1e-3);
        errors.mean += error * error;
        number += 1.0;
        if error > errors.largest || error.is_nan() {
            (errors.largest, errors.worst) = (error, Some(*case));
        }
    }
    errors.mean = (errors.mean / number).sqrt();
    errors
}

#[test]
fn the_light_of_a_sphere_is_that_of_the_processor_in_f64() {
    let Some(rays) = rays() else { return };
    let balls = INDICES.map(|index| Ball::new(index.into()));
    let cases = cases();
    let answers: Vec<_> = cases.iter().map(|case| expected(&balls[case.ball], case)).collect();
    let words = found(&rays, &balls, &cases, |text| text);
    let of = |words: &[[f32; WORDS]], asked: &dyn Fn(&Case) -> bool| {
        let all = cases.iter().zip(words).zip(&answers).filter(|((case, _), _)| asked(case));
        errors(all.map(|((case, words), (total, ..))| (case, f64::from(words[0]), total.x)))
    };
    let near = |case: &Case| case.at.length() < 8.0;
    let far = |case: &Case| case.at.length() >= 8.0;
    let (near_errors, far_errors) = (of(&words, &near), of(&words, &far));
    let lit = answers.iter().filter(|(total, ..)| total.x > 1e-3).count();
    println!("{} points, {lit} of them lit: near {near_errors:?}; far {far_errors:?}", cases.len());
    assert!(lit > cases.len() / 4 && cases.len() > 20_000, "{lit} of {}", cases.len());
    assert!(near_errors.largest < 1e-3 && near_errors.mean < 2e-5, "{near_errors:?}");
    assert!(far_errors.largest < 2e-3 && far_errors.mean < 3e-5, "{far_errors:?}");
    // The sums with the cosines, and those with the directions.
    let mut numbers = 0;
    for ((case, words), (total, moment, number)) in cases.iter().zip(&words).zip(&answers) {
        let scale = total.x.max(1e-3);
        let vectors = [(words[1], total.y), (words[2], total.z), (words[3], moment.x), (words[4], moment.y)];
        for (found, expected) in vectors {
            assert!((f64::from(found) - expected).abs() < 2e-3 * scale, "{case:?}: {words:?} {total} {moment}");
        }
        numbers += usize::from(words[5] != *number as f32);
    }
    println!("{numbers} have another number of bundles");
    assert!(numbers * 100 < cases.len(), "{numbers}");
    // Controls: m in 32 bits alone, and an index that is off by a fiftieth.
    let plain = found(&rays, &balls, &cases, |text| {
        let [exact, bare] =
            ["add(across, minus(sin)).h, along", "(aim.x.h * turn_cos.h + aim.z.h * turn_sin.h) - sin.h, along"];
        assert_eq!(text.matches(exact).count(), 1);
        text.replace(exact, bare)
    });
    // Compared off the axis, where no other error is as large as the error of m.
    let narrow = |case: &Case| far(case) && case.width < 2e-3 && case.at.x > 0.1;
    let (plain, wide) = (of(&plain, &narrow), of(&words, &narrow));
    println!("off the axis, far: {wide:?}; in 32 bits: {plain:?}");
    assert!(plain.largest > 4.0 * wide.largest && plain.mean > 1.5 * wide.mean, "control: {plain:?} {wide:?}");
    let others = INDICES.map(|index| Ball::new(f64::from(index) * 1.02));
    let other = of(&found(&rays, &others, &cases, |text| text), &near);
    assert!(other.mean > 0.05, "control: {other:?}");
}
