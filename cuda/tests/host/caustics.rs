//! Light that glass focuses: exact spheres, and meshes, at which photons are shot. The bundles of rays behind a sphere are compared bit for bit;
//! the programs that show focused light are compiled for the host as those in `glass.rs`.

use super::glass::{
    Asked, Divided, PIXELS, ROUNDING, Scene, cuboid, differences, each_pixel, flat, several, solid, under_a_sky,
};
use super::lights::asked;
use super::ways::{BOTH, dispersing, frosted, owned, uncut};
use super::{Random, compiled_with, run};
use curitiba_cuda::focused::{FocusedTables, cloud, nodes};
use curitiba_cuda::layout::{Focused, Lens, PhotonCloud, Turned};
use curitiba_passes::effects::constants::CELLS;
use curitiba_passes::effects::dielectric::{self, Ball, Cloud};
use curitiba_pipeline::glass::{Dielectric, GlassShadow};
use curitiba_pipeline::programs::{Fresnel, RayProgram, TextureLod};
use curitiba_pipeline::scene::Sphere;
use glam::{DVec2, DVec3, Vec3};
use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};

fn wide(number: f64) -> [u32; 2] {
    let bits = number.to_bits();
    [bits as u32, (bits >> 32) as u32]
}

fn turned_words(ray: &Turned) -> impl Iterator<Item = u32> + use<> {
    let Turned { sin, cos, inner, direction: [x, z], rate } = *ray;
    [sin, cos, inner, x, z, rate].into_iter().flat_map(wide)
}

/// The spheres that focus light as a host program reads them.
pub(crate) fn lens_words(tables: &FocusedTables) -> Vec<u32> {
    let FocusedTables { list, nodes, points, by_sphere, described } = tables;
    let mut input = vec![list.len() as u32];
    for Lens { center, radius, index, id, material, node } in list {
        input.extend(center.iter().chain([radius, index]).map(|number| number.to_bits()));
        input.extend([id, material, node]);
    }
    input.push(nodes.len() as u32);
    input.extend(nodes.iter().flat_map(turned_words));
    input.push(points.len() as u32 / 2);
    input.extend(points.iter().copied().flat_map(wide));
    input.push(by_sphere.len() as u32);
    input.extend(by_sphere);
    let Focused { axis, across, blur, .. } = described;
    input.extend(axis.iter().chain(across).chain([blur]).copied().flat_map(wide));
    input
}

/// The photons of each target as a host program reads them.
pub(crate) fn photon_words(clouds: &[Cloud]) -> Vec<u32> {
    let mut input = vec![clouds.len() as u32];
    for own in clouds {
        let PhotonCloud { low, high, radius, cells, weight, .. } = cloud(own);
        input.extend(low.into_iter().chain(high).chain([radius, cells, weight]).map(f32::to_bits));
        input.push(own.starts().len() as u32);
        input.extend(own.starts());
        input.push(own.photons().len() as u32);
        input.extend(bytemuck::cast_slice::<_, u32>(own.photons()));
    }
    input
}

fn functions(name: &str, change: Option<[&str; 2]>) -> Option<PathBuf> {
    compiled_with("ball.cpp", name, change.map(|change| ("ball.cuh", change)))
}

/// A ray of the processor in the device's layout.
fn turned(ray: &dielectric::Turned) -> Turned {
    let (sin, cos, inner, direction) = (ray.sin, ray.cos, ray.inner, ray.direction.to_array());
    Turned { sin, cos, inner, direction, rate: ray.rate() }
}

const INDICES: [f64; 5] = [1.0001, 1.2, 1.33, 1.5, 2.42];

/// Rays behind spheres: how many differ, and how many were compared.
fn rays_that_differ(program: &Path) -> [usize; 2] {
    let (mut differ, mut all) = (0, 0);
    for index in INDICES {
        let mut input = wide(index).to_vec();
        let mut expected: Vec<Vec<u32>> = Vec::new();
        for step in 0..=1000 {
            let incidence = FRAC_PI_2 * f64::from(step) / 1000.0;
            input.extend(wide(incidence));
            let ray = dielectric::Turned::at(incidence, index);
            let ends = [ray.entry(), ray.exit()].into_iter().flat_map(|end| end.to_array());
            expected.push(turned_words(&turned(&ray)).chain(ends.flat_map(wide)).collect());
        }
        for (found, expected) in run(program, "rays", &input).as_chunks::<20>().0.iter().zip(expected) {
            differ += usize::from(found[..] != expected);
            all += 1;
        }
    }
    [differ, all]
}

/// Points behind, beside and before a sphere, on the axis, near it and on caustics, with the width of a mean.
fn points(random: &mut Random, index: f64) -> Vec<(DVec2, f64)> {
    let focus = index / (2.0 * (index - 1.0));
    let mut points = Vec::new();
    for number in 0..1500_usize {
        let width = [1e-3, 1e-3, 0.02, 0.3][number % 4];
        let unit = f64::from(random.unit());
        let place = match number % 5 {
            0 => focus.min(20.0) * (0.8 + 0.4 * f64::from(random.unit())),
            1 => 1.0 + 0.3 * unit,
            _ => 6.0 * f64::from(random.unit()) - 1.0,
        };
        let distance = match number % 7 {
            0 => 0.0,
            1 => width * unit,
            2 => 3.0 * width * unit,
            // Where the outermost rays cross, and where few rays come.
            3 => 0.2 * unit,
            _ => 3.0 * unit,
        };
        if DVec2::new(distance, place).length_squared() > 1.0 {
            points.push((DVec2::new(distance, place), width));
        }
    }
    points
}

/// Points near spheres: for how many the bundles differ, how many bundles there are in all, how many points get several, and how many points were
/// compared.
fn bundles_that_differ(program: &Path) -> [usize; 4] {
    let mut random = Random(41);
    let (mut differ, mut bundles, mut several, mut all) = (0, 0, 0, 0);
    for index in INDICES {
        let ball = Ball::new(index);
        let tables = FocusedTables {
            nodes: nodes(&ball),
            points: ball.quadratures().flat_map(|point| point.to_array()).collect(),
            ..FocusedTables::default()
        };
        let mut input = wide(index).to_vec();
        input.extend(lens_words(&tables));
        let mut expected: Vec<Vec<u32>> = Vec::new();
        for (at, width) in points(&mut random, index) {
            input.extend([at.x, at.y, width].into_iter().flat_map(wide));
            let kept = |ray: &dielectric::Turned| DVec3::new(ray.cos, ray.inner, 0.5 * ray.sin);
            let (mut words, mut count) = (vec![0], 0);
            ball.bundles(at, width, kept, |bundle| {
                count += 1;
                words.extend(turned_words(&turned(&bundle.ray)));
                words.extend([bundle.side].into_iter().chain(bundle.strength.to_array()).flat_map(wide));
            });
            words[0] = count;
            bundles += count as usize;
            several += usize::from(count > 1);
            expected.push(words);
        }
        let mut found = &run(program, "bundles", &input)[..];
        for expected in expected {
            let (own, rest) = found.split_at(found.len().min(1 + 20 * found[0] as usize));
            differ += usize::from(own != expected);
            found = rest;
            all += 1;
        }
        assert!(found.is_empty());
    }
    [differ, bundles, several, all]
}

#[test]
fn rays_and_bundles_behind_a_sphere_have_the_bits_of_the_processor() {
    let Some(program) = functions("ball", None) else { return };
    let [differ, all] = rays_that_differ(&program);
    assert!(differ == 0 && all == 5 * 1001, "{differ} of {all} rays differ");
    let [differ, bundles, several, all] = bundles_that_differ(&program);
    assert!(differ == 0 && all > 6000, "the bundles of {differ} of {all} points differ");
    assert!(bundles > 3000 && several > 500, "{bundles} bundles, {several} points get several");
    for (name, change, of_rays) in [
        ("ball-turn", ["-2.0 * half_sin * half_cos", "-2.0 * half_sin * cos"], true),
        ("ball-exit", ["ray.sin * -ray.direction[0] + ray.cos", "ray.sin * ray.direction[0] + ray.cos"], true),
        // Both sides of the axis are one.
        ("ball-side", ["at.x = -at.x;", ""], false),
        // Near the axis, rays that must be turned are missing.
        ("ball-axis", ["reach = distance < width ? width + distance : width;", "reach = width;"], false),
        // Extrema within a step are not looked for.
        ("ball-turns", ["bool turns = rate_before * rate < 0.0;", "bool turns = false;"], false),
        // Pieces that belong together are bundles of their own.
        ("ball-joins", ["is_open && open.end >= low", "is_open && open.end > low"], false),
        // The quadrature near the axis has few points.
        ("ball-points", ["(near_axis ? POINTS : 0)", "0"], false),
        ("ball-root", ["value / rate", "value / (2.0 * rate)"], false),
    ] {
        let changed = functions(name, Some(change)).expect("there is a compiler");
        let differ = if of_rays { rays_that_differ(&changed)[0] } else { bundles_that_differ(&changed)[0] };
        assert!(differ > 0, "{change:?} is not noticed");
    }
    assert_eq!(nodes(&Ball::new(1.5)).len(), CELLS + 1);
}

/// Adds spheres of which some focus light: a clear one, one that absorbs and scatters, one of diamond; and one in a body of triangles, two that
/// touch and one of index 1, which focus none. One that is no glass is before the blue one, and one behind the clear one.
fn with_lenses(mut scene: Scene) -> Scene {
    let sphere = |center: [f32; 3], radius: f32| Sphere { center: center.into(), radius, material: 0 };
    let clear = solid(1.5);
    let blue =
        Dielectric { extinction: Vec3::new(1.2, 0.5, 0.1), veil: 0.1, filter: Vec3::new(0.9, 1.0, 0.8), ..solid(1.33) };
    scene.add_spheres(&[
        (clear, Vec3::ONE, sphere([1.3, 0.6, 2.2], 0.35)),
        (blue, Vec3::new(0.3, 0.4, 0.9), sphere([-0.8, 0.55, 2.8], 0.3)),
        (solid(2.42), Vec3::ONE, sphere([-0.3, 0.3, 3.2], 0.15)),
        (Dielectric { priority: 4, ..solid(2.4) }, Vec3::ONE, sphere([1.0, 0.7, -0.1], 0.25)),
        (clear, Vec3::ONE, sphere([0.2, 0.45, 2.6], 0.2)),
        (clear, Vec3::ONE, sphere([0.5, 0.45, 2.6], 0.2)),
        (solid(1.0), Vec3::ONE, sphere([0.0, 1.7, 1.5], 0.25)),
        (Dielectric::default(), Vec3::ONE, sphere([-0.45, 1.25, 3.24], 0.24)),
        (Dielectric::default(), Vec3::ONE, sphere([1.09, 0.17, 1.93], 0.07)),
    ]);
    scene
}

/// Number of pixels that a program changes by more than a fiftieth where spheres focus light.
fn changed_by_focus(program: &Path, scene: &Scene, asked: Asked<'_>) -> usize {
    let colors = |shadow: GlassShadow| {
        let mut found = Vec::with_capacity(PIXELS);
        each_pixel(program, scene, Asked { shadow, ..asked }, |_, _, [color, _]| found.push(color));
        found
    };
    let (straight, focused) = (colors(GlassShadow::Straight), colors(GlassShadow::Caustic));
    straight.iter().zip(&focused).filter(|(a, b)| (**a - **b).abs().max_element() > 0.02).count()
}

/// Compares pictures of focused light with the processor's, and checks that they show some.
fn compare(source: &str, scene: &Scene, asked: Asked<'_>, what: &str) -> Option<()> {
    let compiled = compiled_with(source, "caustics", None)?;
    let (largest, counts, shown) = differences(&compiled, scene, asked);
    println!("{source}, {what}: {largest}");
    assert!(largest < ROUNDING && counts == 0, "{source}, {what}: {largest}, {counts} counts differ");
    assert!(shown > PIXELS / 5, "{source}, {what}: {shown} pixels show glass");
    let changed = changed_by_focus(&compiled, scene, asked);
    assert!(changed > 20, "{source}, {what}: {changed} pixels show focused light");
    Some(())
}

fn focused(depth: u32) -> Asked<'static> {
    Asked { depth, ..asked(RayProgram::Final, GlassShadow::Caustic, &[]) }
}

#[test]
fn focused_light_of_the_device_programs_is_the_processors() {
    for scene in [with_lenses(several()), with_lenses(under_a_sky())] {
        for (asked, what) in [
            (focused(5), "a point"),
            (Asked { fresnel: Fresnel::Schlick, samples: 9, ..focused(0) }, "Schlick, with occlusion"),
            (Asked { lod: TextureLod::Cones, ..focused(2) }, "cones"),
        ] {
            let Some(()) = compare("spheres_final.cpp", &scene, asked, what) else { return };
        }
        for sun in [0.5, 12.0] {
            let asked = Asked { sun, ..focused(3) };
            let Some(()) = compare("spheres_lights_final.cpp", &scene, asked, &format!("a disc of {sun}")) else {
                return;
            };
        }
    }
}

#[test]
fn focused_light_of_glass_that_is_followed_as_ways_is_the_processors() {
    let of = |scene: Scene, divided: Divided, what: &'static str| (scene, divided, what);
    let scene = || with_lenses(several());
    for (scene, divided, what) in [
        of(scene(), uncut(), "smooth"),
        of(owned(scene()), uncut(), "reflectances of materials' own"),
        of(owned(frosted(dispersing(scene()))), BOTH, "rough, and colours bent apart"),
    ] {
        let asked = Asked { divided, ..focused(2) };
        let Some(()) = compare("ways_spheres_final.cpp", &scene, asked, what) else { return };
        let soft = Asked { sun: 3.0, ..asked };
        let Some(()) = compare("ways_spheres_lights_final.cpp", &scene, soft, what) else { return };
    }
}

/// The material of the larger ball of [`several`].
const BALL: usize = 2;

/// Adds a mesh of index 1, which bends no light and is no target, and steps on which photons land beside the floor.
fn with_steps(mut scene: Scene) -> Scene {
    let low = Vec3::new(0.1, 0.2, 2.4);
    scene.add(solid(1.0), Vec3::ONE, &cuboid(low, low + 0.4), flat);
    for (x, z) in [(-1.8, -0.9), (0.3, -0.6), (1.0, -0.5)] {
        let low = Vec3::new(x, 0.0, z);
        scene.add(Dielectric::default(), Vec3::ONE, &cuboid(low, low + Vec3::new(0.5, 0.15, 0.5)), flat);
    }
    scene
}

/// Photons of meshes, alone and beside spheres that focus light, under a point and under a disc, and where paths are followed as ways.
#[test]
fn light_of_photons_of_the_device_programs_is_the_processors() {
    let photons = |asked: Asked<'static>| Asked { photons: (20_000, 0.0), ..asked };
    let whole = photons(focused(4));
    for (source, scene, asked, what) in [
        ("spheres_final.cpp", several(), whole, "photons"),
        ("spheres_final.cpp", under_a_sky(), photons(Asked { samples: 9, ..focused(0) }), "photons, with occlusion"),
        ("spheres_final.cpp", with_lenses(several()), whole, "photons beside spheres"),
        ("spheres_final.cpp", several().cut_out(BALL), whole, "photons of a ball with holes"),
        ("spheres_lights_final.cpp", several(), Asked { sun: 3.0, ..whole }, "photons of a disc"),
        ("ways_spheres_final.cpp", several(), Asked { divided: uncut(), ..whole }, "photons and ways"),
        (
            "ways_spheres_final.cpp",
            frosted(dispersing(several())),
            Asked { divided: BOTH, ..photons(focused(2)) },
            "photons of rough glass that disperses light",
        ),
    ] {
        let Some(()) = compare(source, &scene, asked, what) else { return };
    }
}

#[test]
fn a_wrong_word_of_the_light_of_photons_is_noticed() {
    // Few photons over wide discs: many cells share an entry, and discs reach around corners and beyond steps.
    let (asked, mut unnoticed) = (Asked { photons: (200, 0.4), ..focused(4) }, Vec::new());
    for (header, change) in [
        // Light also passes straight through the meshes.
        ("scene.cuh", ["body.shape == SHAPE_SOLID && body.index > 1.0f", "false"]),
        // Meshes stop light in their holes.
        ("scene.cuh", ["        if (!covers(params, hit)) return false;\n", ""]),
        // Bodies of index 1 stop light.
        ("scene.cuh", ["body.shape == SHAPE_SOLID && body.index > 1.0f", "body.shape == SHAPE_SOLID"]),
        // No photon counts, and photons in two cells of one entry count twice.
        ("focus.cuh", ["number < focused.cloud_count", "number < 0u"]),
        ("focus.cuh", ["if (again) continue;", ""]),
        ("focus.cuh", ["73856093u", "73856095u"]),
        // Photons count whatever their normal, and their height above the tangent plane.
        ("focus.cuh", ["dot(normal, facing) >= PHOTON_ALIKE", "dot(normal, facing) >= -1.0f"]),
        ("focus.cuh", ["fabsf(height) <= PHOTON_FLAT * cloud.radius", "true"]),
        // Weights are equal, and light is not that of the surface.
        ("focus.cuh", ["(1.0f - fmaxf(distance, 0.0f) / square)", "0.5f"]),
        ("focus.cuh", ["weight / cosine", "weight"]),
        ("focus.cuh", ["lit.share(color, -direction)", "lit.share(color, normal)"]),
    ] {
        let Some(compiled) = compiled_with("spheres_final.cpp", "photons-changed", Some((header, change))) else {
            return;
        };
        let (largest, ..) = differences(&compiled, &with_steps(several()).cut_out(BALL), asked);
        if largest <= 1e-3 {
            unnoticed.push((header, change, largest));
        }
    }
    assert!(unnoticed.is_empty(), "{unnoticed:?}");
}

#[test]
fn a_wrong_word_of_focused_light_is_noticed() {
    let (point, mut unnoticed) = (focused(3), Vec::new());
    for (source, header, asked, change) in [
        // No light is focused.
        (
            "spheres_final.cpp",
            "final.cuh",
            point,
            ["!(params.asks & ASKS_FOCUSED) || keeps_color", "params.asks != 0u || keeps_color"],
        ),
        // Light passes straight through spheres, too.
        (
            "spheres_final.cpp",
            "scene.cuh",
            point,
            ["if (focused && focuses(params, hit.triangle, crossings->origin)) return true;", ""],
        ),
        // The sphere stops the light that it focuses.
        (
            "spheres_final.cpp",
            "scene.cuh",
            point,
            ["if (focused && hit.triangle == crossings->without) return false;", ""],
        ),
        // Light is not dimmed by the second face.
        ("spheres_final.cpp", "focus.cuh", point, ["kept = passes * passes * faces", "kept = passes * faces"]),
        // Nothing before or behind the sphere stops it.
        ("spheres_final.cpp", "focus.cuh", point, ["way < 3 &&", "way < 2 &&"]),
        ("spheres_final.cpp", "focus.cuh", point, ["way = 0; way < 3", "way = 1; way < 3"]),
        // The colour that is seen contains another light.
        (
            "spheres_final.cpp",
            "final.cuh",
            point,
            ["lit.cosine = fmaxf(pass.position().w, 0.0f);", "lit.cosine = 0.5f;"],
        ),
        // Textured surfaces count as white.
        (
            "spheres_final.cpp",
            "final.cuh",
            point,
            ["shade.texture != NO_TEXTURE ? vector_of(shade.diffuse) : splat(1.0f)", "splat(1.0f)"],
        ),
        // The disc blurs nothing.
        (
            "spheres_lights_final.cpp",
            "focus.cuh",
            Asked { sun: 3.0, ..point },
            ["fmax(LENS_WIDTH, sqrt(squared) * focused.blur)", "LENS_WIDTH"],
        ),
        // The reflectance is that of another material.
        (
            "ways_spheres_final.cpp",
            "focus.cuh",
            Asked { divided: uncut(), ..point },
            ["OF_WAYS(lens.material, )", "OF_WAYS(0u, )"],
        ),
    ] {
        let scene = with_lenses(several());
        let scene = if source.starts_with("ways") { owned(scene) } else { scene };
        let Some(compiled) = compiled_with(source, "caustics-changed", Some((header, change))) else { return };
        let (largest, ..) = differences(&compiled, &scene, asked);
        if largest <= 1e-3 {
            unnoticed.push((source, change, largest));
        }
    }
    assert!(unnoticed.is_empty(), "{unnoticed:?}");
}

/// Where nothing asks for focused light, spheres that would focus it change nothing.
#[test]
fn lenses_change_nothing_unless_they_are_asked_for() {
    let Some(compiled) = compiled_with("spheres_final.cpp", "caustics", None) else { return };
    for shadow in [GlassShadow::Straight, GlassShadow::Report] {
        let (largest, counts, _) = differences(&compiled, &with_lenses(several()), Asked { shadow, ..focused(3) });
        assert!(largest < ROUNDING && counts == 0, "{shadow:?}: {largest}, {counts} counts differ");
    }
}
