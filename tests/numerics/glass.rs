//! The algebra of a smooth interface: conservation, reversibility, the critical angle, and the error of shortcuts.

use crate::trace_scenes::Random;
use curitiba_passes::effects::{fresnel, schlick as approximate};
use glam::Vec3;

/// Refractive indices of the far side over the near side: glasses and diamond in both directions, 1, and values next to 1.
fn indices() -> Vec<f32> {
    let real = [1.1_f32, 1.33, 1.5, 2.42, 4.0];
    let mut all = real.to_vec();
    all.extend(real.map(|index| 1.0 / index));
    all.extend([1.0, 1.0 + f32::EPSILON, 1.0 - f32::EPSILON / 2.0, 1.000_01, 0.999_99, 0.2, 100.0]);
    all
}

/// Angles of incidence in degrees: over the whole range, near 0 and 90, and around the critical angle of each index.
fn angles(index: f32) -> Vec<f64> {
    let mut all: Vec<f64> = (0..=900).map(|tenth| f64::from(tenth) / 10.0).collect();
    all.extend([1e-6, 1e-3, 89.9, 89.99, 89.9999, 90.0]);
    if index < 1.0 {
        let critical = f64::from(index).asin().to_degrees();
        for step in -200..=200 {
            // Up to 1e-6 radians on both sides, as in the table of hard cases, and a wider ring.
            all.extend([critical + f64::from(step) * 2.9e-7, critical + f64::from(step) * 1e-3]);
        }
    }
    all.retain(|angle| (0.0..=90.0).contains(angle));
    all
}

/// The transmitted share by Fresnel's amplitude coefficients of transmission. The code under test does not use them.
fn transmittance(cos: f64, cos_refracted: f64, index: f64) -> f64 {
    let perpendicular = 2.0 * cos / (cos + index * cos_refracted);
    let parallel = 2.0 * cos / (index * cos + cos_refracted);
    let beam = index * cos_refracted / cos;
    beam * 0.5 * (perpendicular * perpendicular + parallel * parallel)
}

#[test]
fn what_is_reflected_and_what_is_transmitted_add_up_to_one() {
    let mut most = 0.0_f64;
    let mut near_critical = 0;
    for index in indices() {
        for angle in angles(index) {
            let cos = angle.to_radians().cos() as f32;
            let interface = fresnel(cos, index);
            assert!((0.0..=1.0).contains(&interface.reflectance), "{index} {angle}: {interface:?}");
            assert!((0.0..=1.0).contains(&interface.cos_refracted), "{index} {angle}: {interface:?}");
            if interface.reflectance >= 1.0 || cos == 0.0 {
                continue;
            }
            // The `f32` inputs of the code under test are used, so that only its own arithmetic is judged. The refracted cosine is
            // computed by Snell's law in f64, because next to the critical angle the rounding of its f32 value is magnified.
            let (c, n) = (f64::from(cos), f64::from(index));
            let refracted = (n * n - 1.0 + c * c).max(0.0).sqrt() / n;
            assert!((refracted - f64::from(interface.cos_refracted)).abs() < 1e-6, "{index} {angle}");
            let sum = f64::from(interface.reflectance) + transmittance(c, refracted, n);
            most = most.max((sum - 1.0).abs());
            near_critical += usize::from(interface.cos_refracted < 1e-3);
        }
    }
    println!("|R + T - 1| is at most {most:.1e}; {near_critical} angles lie next to a critical one");
    assert!(most <= 1e-6 && near_critical > 100, "{most} {near_critical}");
}

#[test]
fn light_takes_the_same_way_back_with_the_same_weight() {
    let mut random = Random::new(30);
    let mut compared = 0;
    // An index of 100 refracts all light to within half a degree of the normal, where an f32 direction determines its
    // angle poorly.
    for index in indices().into_iter().filter(|index| *index <= 4.0) {
        for angle in angles(index) {
            let normal = random.direction();
            let across = normal.any_orthonormal_vector();
            let (sin, cos) = angle.to_radians().sin_cos();
            let incoming = (across.as_dvec3() * sin - normal.as_dvec3() * cos).as_vec3();
            let there = fresnel(-incoming.dot(normal), index);
            let Some(refracted) = there.refract(incoming, normal, index) else { continue };
            assert!(refracted.is_finite() && (refracted.length() - 1.0).abs() < 1e-6, "{index} {angle}");
            // Next to the critical or the grazing angle, the cosine on one side determines the other poorly in f32.
            let slope = f64::from(there.cos_refracted).min(cos);
            if slope < 0.05 {
                continue;
            }
            compared += 1;
            let back = fresnel(refracted.dot(-normal), 1.0 / index);
            assert!(
                f64::from((back.reflectance - there.reflectance).abs()) < 2e-5 / slope,
                "{index} {angle}: {there:?} {back:?}"
            );
            let returned = back.refract(-refracted, -normal, 1.0 / index).expect("the way back is open");
            // Refraction to a denser side and back magnifies the rounding of the direction.
            let bound = 2e-6 * index.max(1.0 / index).powi(2) / slope as f32;
            assert!((returned + incoming).length() < bound, "{index} {angle}: {returned} {incoming}");
        }
    }
    assert!(compared > 8000, "{compared}");
}

#[test]
fn an_interface_of_index_one_is_not_there() {
    for degree in 0..90 {
        let (sin, cos) = (degree as f32).to_radians().sin_cos();
        let incoming = Vec3::new(sin, 0.0, -cos);
        let interface = fresnel(cos, 1.0);
        assert!(interface.reflectance < 1e-12, "{degree}: {interface:?}");
        let refracted = interface.refract(incoming, Vec3::Z, 1.0).expect("nothing reflects");
        assert!((refracted - incoming).length() < 2e-7, "{degree}");
    }
}

/// The textbook code in `f32`, without a guard: it refracts, and computes the share from both cosines.
fn unguarded(cos: f32, index: f32) -> f32 {
    let eta = 1.0 / index;
    let refracted = (1.0 - eta * eta * (1.0 - cos * cos)).sqrt();
    let perpendicular = (cos - index * refracted) / (cos + index * refracted);
    let parallel = (index * cos - refracted) / (index * cos + refracted);
    0.5 * (perpendicular * perpendicular + parallel * parallel)
}

#[test]
fn the_unguarded_formula_gives_nan_where_ours_reflects_totally() {
    let (mut nan, mut total, mut wrong_side) = (0, 0, 0);
    for index in indices().into_iter().filter(|index| *index < 1.0) {
        for angle in angles(index) {
            let cos = angle.to_radians().cos() as f32;
            let ours = fresnel(cos, index);
            nan += usize::from(unguarded(cos, index).is_nan());
            total += usize::from(ours.reflectance == 1.0);
            // The answer in f64 for the same f32 cosine.
            let c = f64::from(cos);
            let beyond = 1.0 - c * c >= f64::from(index).powi(2);
            assert!(!beyond || ours.reflectance == 1.0, "{index} {angle}: {ours:?}");
            wrong_side += usize::from(unguarded(cos, index).is_nan() != beyond);
        }
    }
    println!("{nan} NaN of the unguarded formula, {total} total reflections of ours; f32 errs about {wrong_side}");
    assert!(nan > 1000 && total > 1000, "{nan} {total}");
    assert!(wrong_side > 10, "f32 tells the critical angle as well as f64: {wrong_side}");
}

#[test]
fn cosines_a_rounding_error_above_one_are_as_one() {
    for index in indices() {
        for cos in [1.0 + f32::EPSILON, 1.0 + 1e-6, 1.000_1] {
            assert_eq!(fresnel(cos, index), fresnel(1.0, index), "{index} {cos}");
        }
    }
    // Cosines above 1 occur: rounding makes many vectors that are normalised in f32 slightly longer than 1.
    let mut random = Random::new(31);
    let longer = (0..10_000).map(|_| random.direction()).filter(|v| v.length_squared() > 1.0).count();
    assert!(longer > 500, "{longer} of 10,000");
}

/// Schlick's approximation, with the cosine on the side of the lower index, and total reflection.
fn schlick(cos: f64, index: f64) -> f64 {
    let zero = ((index - 1.0) / (index + 1.0)).powi(2);
    let cos = if index < 1.0 {
        let square = 1.0 - (1.0 - cos * cos) / (index * index);
        if square <= 0.0 {
            return 1.0;
        }
        square.sqrt()
    } else {
        cos
    };
    zero + (1.0 - zero) * (1.0 - cos).powi(5)
}

/// The option `fresnel=schlick` against the formula in `f64`, for every index and angle of this file.
#[test]
fn schlicks_share_is_the_formulas_and_stays_between_0_and_1() {
    let (mut compared, mut near_critical) = (0, 0);
    for index in indices() {
        for angle in angles(index) {
            let cos = angle.to_radians().cos() as f32;
            let ours = approximate(cos, index);
            assert!((0.0..=1.0).contains(&ours.reflectance), "{index} {angle}: {ours:?}");
            assert!((0.0..=1.0).contains(&ours.cos_refracted), "{index} {angle}: {ours:?}");
            let total = ours.reflectance >= 1.0;
            let incoming = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, -cos);
            let refracted = ours.refract(incoming, Vec3::Z, index);
            assert!(refracted.is_none_or(|direction| direction.is_finite()) && (refracted.is_none() || !total));
            // Next to the critical angle, the rounding of the cosine decides.
            let (c, n) = (f64::from(cos), f64::from(index));
            if (n * n - 1.0 + c * c).abs() < 1e-5 {
                near_critical += 1;
                continue;
            }
            let expected = schlick(c, n);
            // The slope of the refracted cosine magnifies the rounding error of its square.
            let bound = 1e-6 + if index < 1.0 { 5e-7 / (n * n - 1.0 + c * c).abs().sqrt() / n } else { 0.0 };
            let found = f64::from(ours.reflectance);
            assert!((found - expected).abs() < bound, "{index} {angle}: {found} {expected}");
            compared += 1;
        }
    }
    assert!(compared > 8000 && near_critical > 100, "{compared} {near_critical}");
    // Light has the same weight in both directions of a path.
    for index in [1.1_f32, 1.33, 1.5, 2.42] {
        for degree in 0..88 {
            let there = approximate((degree as f32).to_radians().cos(), index);
            let back = approximate(there.cos_refracted, 1.0 / index);
            assert!((there.reflectance - back.reflectance).abs() < 2e-5, "{index} {degree}: {there:?} {back:?}");
        }
    }
    // Control: Fresnel's reflectance differs.
    assert!((approximate(0.12, 1.1).reflectance - fresnel(0.12, 1.1).reflectance).abs() > 0.2);
}

/// The numbers in the document for Schlick's approximation: its greatest error by index, in both directions.
#[test]
fn schlicks_error_is_as_documented() {
    for (index, expected) in [(1.1_f64, 0.2105), (1.33, 0.0599), (1.5, 0.0357), (2.42, 0.0757)] {
        for relative in [index, 1.0 / index] {
            let error = |step: i32| {
                let cos = (f64::from(step) * 0.01).to_radians().cos();
                (f64::from(approximate(cos as f32, relative as f32).reflectance)
                    - f64::from(fresnel(cos as f32, relative as f32).reflectance))
                .abs()
            };
            let most = (0..9000).map(error).fold(0.0, f64::max);
            assert!((most - expected).abs() < 6e-4, "{relative}: {most}");
        }
    }
}

/// The report's weight 1 - K² (1 - cos²), against the transmitted share for glass of that index.
#[test]
fn the_reports_weight_is_off_by_more_than_one() {
    let error = |step: i32| {
        let cos = (f64::from(step) * 0.01).to_radians().cos();
        let weight = 1.0 - 1.21 * (1.0 - cos * cos);
        (weight - (1.0 - f64::from(fresnel(cos as f32, 1.1).reflectance))).abs()
    };
    let (most, at) = (0..9000).map(|step| (error(step), step)).fold((0.0, 0), |a, b| if b.0 > a.0 { b } else { a });
    assert!((most - 1.040).abs() < 2e-3 && (f64::from(at) * 0.01 - 74.0).abs() < 0.5, "{most} at {at}");
}
