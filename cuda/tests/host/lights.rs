//! Several lights, lights with a place, and lights that are discs. The light that arrives at a point is compared bit for bit; the programs that
//! use such lights are compiled for the host as those in `glass.rs`.

use super::glass::{Asked, ROUNDING, WHOLE, differences, several, under_a_sky};
use super::{Random, compiled, compiled_with, light_words, run, words};
use curitiba_cuda::scene::lights as device_lights;
use curitiba_passes::sampling::cone::ConeSampler;
use curitiba_passes::sampling::hash::light_key;
use curitiba_pipeline::backend::{Cone, Light};
use curitiba_pipeline::glass::GlassShadow;
use curitiba_pipeline::programs::{Fresnel, RayProgram, TextureLod};
use glam::Vec3;
use std::path::Path;

/// A light of any kind, and a point to which it may shine.
fn light(random: &mut Random, index: usize) -> (Light, Vec3) {
    let place = random.cube() * [1.0, 30.0, 1e12][index % 3];
    let off = random.cube() * [1.0, 1e-6, 20.0, 0.0, 1e20][index / 3 % 5];
    let outer = 1.9 * random.unit() - 0.95;
    let inner = if index.is_multiple_of(4) { outer } else { outer + (1.0 - outer) * random.unit() };
    let exponent = [0.0, 1.0, 8.5, 128.0][index / 2 % 4];
    let kind = index / 60 % 4;
    let has_cone = kind > 1;
    let direction = if has_cone || kind == 0 { random.direction() } else { Vec3::ZERO };
    let attenuation = [[1.0, 0.0, 0.0], [0.2, 0.3, 0.5], [0.0, 0.0, 1.0]][index / 15 % 3];
    let range = [f32::INFINITY, 0.5 + 20.0 * random.unit()][index / 7 % 2];
    let light = Light {
        place: (kind > 0).then_some(place),
        direction,
        color: random.cube().abs(),
        attenuation,
        range,
        cone: has_cone.then_some(Cone { inner, outer, exponent }),
    };
    (light, place + off)
}

/// For lights and points: how many results differ (powers: by more than their rounding), how many lights arrive in part, and how many were
/// compared.
fn arriving_that_differ(program: &Path) -> [usize; 3] {
    let mut random = Random(11);
    let cases: Vec<(Light, Vec3)> = (0..24_000).map(|index| light(&mut random, index)).collect();
    let lights: Vec<Light> = cases.iter().map(|(light, _)| *light).collect();
    let mut input = Vec::new();
    for (light, (_, point)) in device_lights(&lights).iter().zip(&cases) {
        input.extend(light_words(light).chain(words([*point])));
    }
    let found = run(program, "lights", &input);
    let (mut differ, mut parts) = (0, 0);
    for (found, (light, point)) in found.as_chunks::<4>().0.iter().zip(&cases) {
        let expected = light.at(*point);
        let towards = [found[0], found[1], found[2]].map(f32::from_bits);
        // The device rounds a power once; the processor's library comes close to that.
        let powers = if light.cone.is_some_and(|cone| cone.exponent != 0.0) { 4 } else { 0 };
        let apart = found[3].abs_diff(expected.factor.to_bits());
        differ += usize::from(Vec3::from(towards) != expected.towards || apart > powers);
        parts += usize::from(expected.factor > 0.0 && expected.factor < 1.0);
    }
    [differ, parts, found.len() / 4]
}

#[test]
fn what_arrives_of_lights_has_the_bits_of_the_processor() {
    let Some(program) = compiled("lights", None) else { return };
    let [differ, parts, all] = arriving_that_differ(&program);
    assert!(differ == 0 && all == 24_000 && parts > 1000, "{differ} of {all} differ, {parts} arrive in part");
    for (name, header, change) in [
        ("lights-divisor", "params.cuh", ["LEAST_DIVISOR = 1e-12f", "LEAST_DIVISOR = 1e-9f"]),
        ("lights-edge", "lights.cuh", ["float edge = share * share", "float edge = share"]),
    ] {
        let changed = compiled_with("functions.cpp", name, Some((header, change))).expect("there is a compiler");
        assert!(arriving_that_differ(&changed)[0] > 0, "{change:?} is not noticed");
    }
}

/// A directional light, a lamp whose light ends, one inside of the veiled box, and a spot light.
pub(crate) fn lamps() -> Vec<Light> {
    let lamp = |place: Vec3, color: Vec3, range: f32| Light {
        place: Some(place),
        direction: Vec3::ZERO,
        color,
        attenuation: [0.3, 0.0, 0.1],
        range,
        cone: None,
    };
    vec![
        Light {
            place: None,
            direction: Vec3::new(-0.4, -0.8, -0.5).normalize(),
            color: Vec3::new(0.3, 0.3, 0.25),
            ..lamp(Vec3::ZERO, Vec3::ONE, f32::INFINITY)
        },
        lamp(Vec3::new(-2.5, 2.0, 2.0), Vec3::new(1.2, 0.4, 0.1), 8.0),
        lamp(Vec3::new(0.9, 0.7, 0.1), Vec3::new(0.1, 0.5, 0.2), f32::INFINITY),
        Light {
            direction: Vec3::new(-0.5, -0.8, -0.4).normalize(),
            cone: Some(Cone { inner: 0.95, outer: 0.7, exponent: 2.0 }),
            ..lamp(Vec3::new(2.0, 3.0, 2.5), Vec3::new(0.2, 0.5, 1.5), f32::INFINITY)
        },
    ]
}

const SOURCES: [(RayProgram, &str); 4] = [
    (RayProgram::DeferredShadows, "lights_shadows.cpp"),
    (RayProgram::Reflection, "lights_mirrors.cpp"),
    (RayProgram::Refraction, "lights_refraction.cpp"),
    (RayProgram::Final, "lights_final.cpp"),
];

pub(crate) fn asked(program: RayProgram, shadow: GlassShadow, lights: &[Light]) -> Asked<'_> {
    Asked {
        program,
        fresnel: Fresnel::Exact,
        shadow,
        depth: 3,
        lod: TextureLod::Zero,
        lights,
        sun: 0.0,
        samples: 0,
        after: None,
        panes: false,
        photons: (0, 0.0),
        divided: WHOLE,
    }
}

#[test]
fn programs_of_several_lights_show_what_the_processors_do() {
    let lights = lamps();
    for (program, source) in SOURCES {
        let Some(compiled) = compiled_with(source, &format!("lights-{program:?}"), None) else { return };
        for (scene, around) in [(several(), "nothing"), (under_a_sky(), "a sky")] {
            for shadow in [GlassShadow::Straight, GlassShadow::Report] {
                let (largest, counts, _) = differences(&compiled, &scene, asked(program, shadow, &lights));
                let what = format!("{program:?} {shadow:?} in {around}");
                assert!(largest < ROUNDING && counts == 0, "{what}: {largest}, {counts} counts differ");
            }
        }
    }
}

#[test]
fn mirrors_of_several_lights_that_see_no_sky_are_noticed() {
    let change = ["if (!pass.closest_or_sky(spawn(", "if (!pass.closest(spawn("];
    let change = Some(("reflection.cuh", change));
    let Some(compiled) = compiled_with("lights_mirrors.cpp", "mirrors-changed", change) else { return };
    let lights = lamps();
    let (largest, ..) =
        differences(&compiled, &under_a_sky(), asked(RayProgram::Reflection, GlassShadow::Report, &lights));
    assert!(largest > 1e-1, "{largest}");
}

#[test]
fn a_wrong_word_of_what_lights_leave_is_noticed() {
    let (scene, lights) = (several(), lamps());
    for (header, change) in [
        // Rays go on behind a lamp.
        ("light_share.cuh", ["sqrtf(dot(way, way)) * (1.0f - BEFORE_LIGHT)", "INFINITY"]),
        // An opaque occluder lets light through.
        ("lights.cuh", ["return params.in_shadow;", "return 0.5f;"]),
    ] {
        let Some(compiled) = compiled_with("lights_final.cpp", "lights-changed", Some((header, change))) else {
            return;
        };
        let asked = asked(RayProgram::Final, GlassShadow::Straight, &lights);
        let (largest, ..) = differences(&compiled, &scene, asked);
        assert!(largest > 1e-3, "{change:?} is not noticed: {largest}");
    }
}

/// Directions to discs: how many differ, and how many were compared.
fn directions_that_differ(program: &Path) -> [usize; 2] {
    let mut random = Random(13);
    let (mut input, mut expected) = (Vec::new(), Vec::new());
    for index in 0..2000 {
        let degrees = [0.0, 1e-3, 0.53, 10.0, 90.0][index % 5];
        let disc =
            ConeSampler::new(degrees, random.bits() >> 20, 1 + index as u32 % 7).expect("a part of the sequence");
        let (key, number, axis) = (random.bits(), index as u32 % 3, random.direction());
        input.extend([key, number, disc.height().to_bits()].into_iter().chain(words([axis])));
        input.push(disc.samples());
        input.extend(disc.points().as_flattened());
        expected.extend(words(disc.directions(axis, light_key(key, number))));
    }
    let found = run(program, "discs", &input);
    assert_eq!(found.len(), expected.len());
    [found.iter().zip(&expected).filter(|(found, expected)| found != expected).count(), expected.len() / 3]
}

#[test]
fn directions_to_discs_have_the_bits_of_the_processor() {
    let Some(program) = compiled("discs", None) else { return };
    let [differ, all] = directions_that_differ(&program);
    assert!(differ == 0 && all > 7000, "{differ} of {all} differ");
    for (name, header, change) in [
        ("discs-cap", "sampling.cuh", ["height * (2.0f - below)", "height * (1.0f - below)"]),
        ("discs-hash", "params.cuh", ["HASH_DISC = 4294967293u", "HASH_DISC = 4294967295u"]),
        ("discs-lights", "params.cuh", ["BRANCH_LIGHTS = 536870912u", "BRANCH_LIGHTS = 0u"]),
    ] {
        let changed = compiled_with("functions.cpp", name, Some((header, change))).expect("there is a compiler");
        assert!(directions_that_differ(&changed)[0] > 0, "{change:?} is not noticed");
    }
}

/// The lamps with another directional light.
fn two_suns() -> Vec<Light> {
    let mut lights = lamps();
    let direction = Vec3::new(0.6, -0.7, -0.2).normalize();
    lights.push(Light { direction, color: Vec3::new(0.1, 0.2, 0.4), ..lights[0] });
    lights
}

#[test]
fn programs_of_lights_that_are_discs_show_what_the_processors_do() {
    let (scene, lamps, sky) = (several(), two_suns(), under_a_sky());
    for (program, source) in [SOURCES[0], SOURCES[3]] {
        let Some(compiled) = compiled_with(source, &format!("discs-{program:?}"), None) else { return };
        for (lights, scene) in [(&[][..], &scene), (&lamps, &scene), (&lamps, &sky)] {
            for shadow in [GlassShadow::Straight, GlassShadow::Report] {
                let soft = Asked { sun: 12.0, ..asked(program, shadow, lights) };
                let (largest, counts, _) = differences(&compiled, scene, soft);
                let what = format!("{program:?} {shadow:?} of {} lights", lights.len().max(1));
                assert!(largest < ROUNDING && counts == 0, "{what}: {largest}, {counts} counts differ");
                let exact = program == RayProgram::DeferredShadows && lights.is_empty();
                assert!(!exact || largest == 0.0, "{what}: {largest}");
            }
        }
    }
}

#[test]
fn a_wrong_word_of_the_mean_over_a_disc_is_noticed() {
    for change in [
        // A direction below the surface is left out of the mean instead of counting as shadow.
        [
            "if (is_disc && dot(side, pass.light_direction) <= 0.0f) {\n            sum = sum + splat(in_shadow(params));",
            "if (is_disc && dot(side, pass.light_direction) <= 0.0f) {",
        ],
        // The facing side is always the triangle's, even where the triangle stands for a round surface.
        ["is_disc ? horizon(params, triangle, point, facing) : facing", "facing"],
        // Every ray goes to the disc's centre.
        ["is_disc ? disc_direction(__ldg(params.disc + i), seeds, basis, params.disc_height) : towards", "towards"],
    ] {
        let change = Some(("light_share.cuh", change));
        let Some(compiled) = compiled_with("lights_shadows.cpp", "discs-changed", change) else { return };
        let soft = Asked { sun: 90.0, ..asked(RayProgram::DeferredShadows, GlassShadow::Report, &[]) };
        let (largest, ..) = differences(&compiled, &several(), soft);
        assert!(largest > 1e-2, "{change:?} is not noticed: {largest}");
    }
}
