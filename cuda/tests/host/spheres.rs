//! Exact spheres. The intersection test, the tree over many spheres and points on spheres are compared bit for bit; the programs that trace
//! them are compiled for the host as those in `glass.rs`.

use super::glass::{Asked, PIXELS, ROUNDING, Scene, differences, each_pixel, several, solid, under_a_sky};
use super::lights::{asked, lamps};
use super::{Random, compiled_with, run, words};
use curitiba_cuda::spheres::Packed;
use curitiba_passes::trace::{Hit, Ray, SphereTree, SurfacePoint};
use curitiba_pipeline::backend::NO_TRIANGLE;
use curitiba_pipeline::glass::{Dielectric, GlassShadow, Shape};
use curitiba_pipeline::programs::{Fresnel, RayProgram, TextureLod};
use curitiba_pipeline::scene::{Geometry, Sphere};
use glam::Vec3;
use std::path::Path;

/// Spheres as a host program reads them.
pub(crate) fn sphere_words(packed: &Packed) -> Vec<u32> {
    let mut input = vec![packed.nodes.len() as u32];
    for node in &packed.nodes {
        input.extend(node.low.map(f32::to_bits).into_iter().chain([node.first]));
        input.extend(node.high.map(f32::to_bits).into_iter().chain([node.count]));
    }
    input.push(packed.list.len() as u32);
    for sphere in &packed.list {
        input.extend(sphere.center.map(f32::to_bits).into_iter().chain([sphere.radius.to_bits()]));
        input.extend([sphere.id, sphere.place, 0, 0]);
    }
    input.push(packed.first);
    input
}

fn compiled(name: &str, change: Option<[&str; 2]>) -> Option<std::path::PathBuf> {
    compiled_with("spheres.cpp", name, change.map(|change| ("spheres.cuh", change)))
}

/// A program's answer for a ray: the nearest sphere, its distance, and whether any sphere is hit.
fn answer(tree: &SphereTree, ray: &Ray) -> [u32; 3] {
    let all: &mut dyn FnMut(&Hit) -> bool = &mut |_| true;
    let (hit, any) = (tree.closest(ray, all), tree.occluded(ray, all));
    let [id, t] = hit.map_or([u32::MAX, 0], |hit| [hit.triangle, hit.t.to_bits()]);
    [id, t, any.into()]
}

/// Whether all words are equal. Zeros of either sign are equal.
fn same(found: &[u32], expected: &[u32]) -> bool {
    found.len() == expected.len()
        && found.iter().zip(expected).all(|(a, b)| a == b || f32::from_bits(*a) == f32::from_bits(*b))
}

/// Spheres of any size at any place. Each has a ray from far away, from within or from its surface, which ends before, in or behind the sphere.
fn cases() -> Vec<(Sphere, Ray, f32)> {
    let (mut random, mut cases) = (Random(21), Vec::new());
    for (radius, away) in [(1e-4, 0.0), (1e-4, 1.0), (0.3, 0.0), (1.0, 100.0), (250.0, 300.0), (1e-4, 1e4)] {
        for from in [3.0_f32, 1e4, 1e8, 0.0, -1.0] {
            for index in 0..1500 {
                let sphere = Sphere { center: random.cube() * away, radius, material: 0 };
                let along = if index % 5 == 0 { Vec3::AXES[index % 3] } else { random.direction() };
                let aside = along.any_orthonormal_vector();
                let (origin, direction) = match from {
                    // The ray passes through the sphere, within a millionth of its rim, or past it. Along an axis, the rim touches the sphere's box.
                    1.0.. => {
                        let share = [0.5, 1.0 + 1e-6 * (index % 7) as f32 - 3e-6, 1.2][index % 3];
                        (sphere.center + (aside * share - along * from) * radius, along)
                    }
                    0.0 => (sphere.center + random.direction() * radius * 0.9, along),
                    _ => {
                        let point = SurfacePoint::on_sphere(&sphere, sphere.center + random.direction() * radius);
                        let flat = along.cross(point.normal).normalize_or(aside);
                        let tilt = [1.0, 1e-3, 1e-7][index % 3] * random.cube().x;
                        let direction = (flat + point.normal * tilt).normalize();
                        (point.spawn(direction), direction)
                    }
                };
                let distance = origin.distance(sphere.center);
                let (t_min, t_max) =
                    [(0.0, f32::INFINITY), (-f32::MAX, f32::INFINITY), (0.0, distance), (distance, 1e9)][index / 3 % 4];
                cases.push((sphere, Ray { origin, direction, t_min, t_max }, distance));
            }
        }
    }
    cases
}

/// For spheres with a ray each: how many answers differ, how many points differ, how many rays hit their sphere, and how many cases there are.
fn cases_that_differ(program: &Path) -> [usize; 4] {
    let cases = cases();
    let (mut input, mut expected) = (Vec::new(), Vec::new());
    for (sphere, ray, distance) in &cases {
        let geometry = Geometry { spheres: vec![*sphere], ..Geometry::default() };
        let tree = SphereTree::build(&geometry, &[]);
        input.extend(words([sphere.center]).chain([sphere.radius.to_bits()]));
        input.extend(words([ray.origin, ray.direction]).chain([ray.t_min, ray.t_max, *distance].map(f32::to_bits)));
        let stored = SurfacePoint::on_sphere(sphere, ray.origin);
        let met = SurfacePoint::on_sphere_by(sphere, ray, *distance);
        let mut points: Vec<u32> = Vec::new();
        for point in [stored, met] {
            points.extend(words([point.position, point.normal]).chain([point.error.to_bits()]));
            points.extend(words([point.spawn(ray.direction)]));
        }
        expected.push((answer(&tree, ray), points));
    }
    let found = run(program, "alone", &input);
    let (found, rest) = found.as_chunks::<23>();
    assert!(rest.is_empty() && found.len() == expected.len());
    let (mut differ, mut points, mut hits) = (0, 0, 0);
    for (found, (answer, of_points)) in found.iter().zip(&expected) {
        differ += usize::from(!same(&found[..3], answer));
        points += usize::from(!same(&found[3..], of_points));
        hits += usize::from(answer[0] != u32::MAX);
    }
    [differ, points, hits, cases.len()]
}

#[test]
fn rays_meet_spheres_and_leave_them_with_the_bits_of_the_processor() {
    let Some(program) = compiled("spheres", None) else { return };
    let [differ, points, hits, all] = cases_that_differ(&program);
    assert!(differ == 0 && points == 0, "{differ} answers and {points} points of {all} differ");
    assert!(all == 45_000 && (15_000..35_000).contains(&hits), "{hits} of {all} are met");
    for (name, change, of_points) in [
        // The usual forms of the roots, whose terms cancel out.
        (
            "discriminant",
            [
                "sphere.radius * sphere.radius - dot(nearest, nearest)",
                "b * b - (dot(from, from) - sphere.radius * sphere.radius)",
            ],
            false,
        ),
        (
            "product",
            [
                "(distance - sphere.radius) * (distance + sphere.radius)",
                "dot(from, from) - sphere.radius * sphere.radius",
            ],
            false,
        ),
        // The test omits the sphere's box.
        ("box", [" || !boxes.meets(sphere, limit)", ""], false),
        ("offset", ["(SPHERE_OFFSET / OFFSET_UNITS)", "(3.0f / OFFSET_UNITS)"], true),
        ("side", ["((double)t < b ? -half : half)", "((double)t <= b ? half : -half)"], true),
    ] {
        let changed = compiled(&format!("spheres-{name}"), Some(change)).expect("there is a compiler");
        let [differ, points, ..] = cases_that_differ(&changed);
        assert!(if of_points { points } else { differ } > 0, "{change:?} is not noticed");
    }
}

/// Many spheres of any size around a centre, some in others, behind triangles.
fn swarm(random: &mut Random, count: u32, center: Vec3) -> Geometry {
    let sphere = |index: u32| {
        let radius = [1e-3, 0.05, 0.4][index as usize % 3] * (0.2 + random.unit());
        Sphere { center: center + random.cube() * 3.0, radius, material: index % 2 }
    };
    Geometry { triangles: vec![[0, 1, 2]; 5], spheres: (0..count).map(sphere).collect(), ..Geometry::default() }
}

const CENTERS: [Vec3; 3] = [Vec3::ZERO, Vec3::new(30.0, -20.0, 10.0), Vec3::new(1e4, 3e3, 0.0)];

/// For rays among many spheres: how many answers differ, how many rays hit a sphere, and how many rays there are.
fn rays_that_differ(program: &Path) -> [usize; 3] {
    let mut random = Random(22);
    let (mut differ, mut hits, mut all) = (0, 0, 0);
    for center in CENTERS {
        for count in [3, 300] {
            let geometry = swarm(&mut random, count, center);
            let tree = SphereTree::build(&geometry, &[false, true]);
            let mut input = sphere_words(&Packed::of(&geometry, &[false, true]));
            let mut expected = Vec::new();
            for index in 0..6000_usize {
                let sphere = &geometry.spheres[index % count as usize];
                let goal = sphere.center + random.direction() * sphere.radius * [0.0, 0.7, 1.0, 1.001][index % 4];
                let origin = if index % 7 == 0 { goal } else { center + random.cube() * 5.0 };
                let direction = match index % 11 {
                    0 => Vec3::AXES[index % 3],
                    1 => Vec3::new(1e-30, -1e-42, 1.0),
                    _ => (goal - origin).normalize_or(random.direction()),
                };
                let distance = (goal - origin).length();
                let (t_min, t_max) =
                    [(0.0, f32::INFINITY), (0.0, distance), (distance, 9.0), (0.01, 0.5)][index / 4 % 4];
                let ray = Ray { origin, direction, t_min, t_max };
                input.extend(words([origin, direction]).chain([t_min, t_max].map(f32::to_bits)));
                expected.push(answer(&tree, &ray));
            }
            let found = run(program, "rays", &input);
            for (found, expected) in found.as_chunks::<3>().0.iter().zip(&expected) {
                differ += usize::from(!same(found, expected));
                hits += usize::from(expected[0] != u32::MAX);
                all += 1;
            }
        }
    }
    [differ, hits, all]
}

#[test]
fn the_tree_over_spheres_leads_to_what_the_processor_finds() {
    let Some(program) = compiled("spheres", None) else { return };
    let [differ, hits, all] = rays_that_differ(&program);
    assert!(
        differ == 0 && all == 36_000 && (10_000..30_000).contains(&hits),
        "{differ} of {all} differ, {hits} meet any"
    );
    for (name, change) in [
        ("padding", ["(reach * 16.0f + absolute(origin) * 8.0f)", "(reach * -4e4f)"]),
        ("second", ["stack[waiting++] = swaps ? first : first + 1;", "stack[waiting++] = swaps ? first + 1 : first;"]),
        ("nearest", ["            limit = hit.t;\n            break;", "            break;"]),
    ] {
        let changed = compiled(&format!("spheres-{name}"), Some(change)).expect("there is a compiler");
        // Without the limit, more nodes are opened, but the hits are the same.
        let noticed = rays_that_differ(&changed)[0] > 0;
        assert_eq!(noticed, name != "nearest", "{change:?}");
    }
}

/// Points among spheres: for how many a ray of the given length hits a sphere although the program reports none near; for how many it reports
/// a sphere near, and for how many it reports none.
fn points_that_are_wrong(program: &Path) -> [usize; 3] {
    let mut random = Random(23);
    let (mut wrong, mut near, mut apart) = (0, 0, 0);
    for center in CENTERS {
        let geometry = swarm(&mut random, 40, center);
        let tree = SphereTree::build(&geometry, &[]);
        let mut input = sphere_words(&Packed::of(&geometry, &[]));
        let mut asked = Vec::new();
        for index in 0..3000_usize {
            let sphere = &geometry.spheres[index % 40];
            let length = [0.01, 0.1, 0.7][index % 3];
            // The distance from the surface, outside or inside, is about the length of the ray.
            let off = length * (0.97 + 0.06 * random.unit());
            let distance = if index % 2 == 0 { sphere.radius + off } else { (sphere.radius - off).abs() };
            let origin = sphere.center + random.direction() * distance;
            input.extend(words([origin]).chain([length.to_bits()]));
            asked.push((origin, length, sphere.center));
        }
        for ((origin, length, middle), found) in asked.iter().zip(run(program, "near", &input)) {
            if found == 1 {
                near += 1;
                continue;
            }
            apart += 1;
            let towards = (middle - *origin).normalize_or(Vec3::X);
            let meets = |direction: Vec3| {
                let ray = Ray { origin: *origin, direction, t_min: 0.0, t_max: *length };
                tree.occluded(&ray, &mut |_| true)
            };
            let any = meets(towards) || meets(-towards) || (0..20).any(|_| meets(random.direction()));
            wrong += usize::from(any);
        }
    }
    [wrong, near, apart]
}

#[test]
fn no_ray_of_a_point_that_no_sphere_is_near_meets_one() {
    let Some(program) = compiled("spheres", None) else { return };
    let [wrong, near, apart] = points_that_are_wrong(&program);
    assert!(wrong == 0 && near > 3000 && apart > 1000, "{wrong} wrong, {near} near, {apart} apart");
    let change = ["length * 1.001f", "length * 0.98f"];
    let changed = compiled("spheres-near", Some(change)).expect("there is a compiler");
    assert!(points_that_are_wrong(&changed)[0] > 0, "{change:?} is not noticed");
}

fn sphere(center: [f32; 3], radius: f32) -> Sphere {
    Sphere { center: center.into(), radius, material: 0 }
}

/// Adds spheres beside the scene's bodies of triangles: an absorbing sphere with a bubble, a core that reaches out of it and has a higher
/// priority, one in a body of triangles, one of index 1, a thin one, a pane, a veiled one, and three that are not glass.
pub(crate) fn with_spheres(mut scene: Scene) -> Scene {
    let sigma = Vec3::new(0.1, 0.4, 0.9);
    let textured =
        Dielectric { filter_texture: Some(0), transmission_texture: Some(0), filter_vertex_colors: true, ..solid(1.6) };
    let thin = Dielectric { shape: Shape::Thin, thickness: 0.1, extinction: sigma, ..solid(1.4) };
    scene.add_spheres(&[
        (Dielectric { extinction: sigma, priority: 1, ..solid(1.5) }, Vec3::ONE, sphere([0.1, 1.2, 2.2], 0.5)),
        (Dielectric { priority: 2, extinction: sigma * 2.0, ..solid(1.33) }, Vec3::ONE, sphere([0.5, 1.3, 2.3], 0.3)),
        (Dielectric { priority: 3, ..solid(1.0) }, Vec3::ONE, sphere([0.0, 1.2, 2.2], 0.2)),
        (
            Dielectric { priority: 4, extinction: Vec3::splat(0.5), ..solid(2.4) },
            Vec3::ONE,
            sphere([1.0, 0.7, -0.1], 0.25),
        ),
        (solid(1.0), Vec3::ONE, sphere([-0.2, 0.3, 2.9], 0.25)),
        (thin, Vec3::ONE, sphere([-1.0, 0.4, 2.4], 0.3)),
        (Dielectric { shape: Shape::Pane, ..solid(1.5) }, Vec3::ONE, sphere([1.1, 0.5, 2.4], 0.3)),
        (Dielectric { veil: 0.4, ..textured }, Vec3::new(0.3, 0.9, 0.5), sphere([-0.5, 1.7, 1.5], 0.3)),
        (Dielectric::default(), Vec3::new(0.9, 0.4, 0.1), sphere([0.2, 0.4, -1.2], 0.5)),
        (Dielectric::default(), Vec3::new(0.2, 0.4, 0.9), sphere([-0.6, 0.2, 2.0], 0.2)),
        (Dielectric::default(), Vec3::new(0.7, 0.7, 0.2), sphere([1.4, 1.2, 1.6], 0.25)),
    ]);
    scene
}

/// Spheres alone, without any triangle.
fn alone() -> Scene {
    with_spheres(Scene::new(Vec3::new(0.3, 1.4, 5.0), Vec3::new(0.0, 0.7, 0.0)))
}

/// The camera is in a sphere of dyed glass within a larger one, with other things in and around them.
fn inside() -> Scene {
    let mut scene = several().seen(Vec3::new(0.1, 1.0, 2.6), Vec3::new(0.0, 0.7, 0.0));
    let dye = |sigma: Vec3, priority| Dielectric { extinction: sigma, priority, ..solid(1.3) };
    scene.add_spheres(&[
        (dye(Vec3::new(0.02, 0.1, 0.6), 0), Vec3::ONE, sphere([0.1, 1.0, 2.4], 1.5)),
        (dye(Vec3::new(0.5, 0.2, 0.05), 1), Vec3::ONE, sphere([0.0, 1.0, 2.3], 0.9)),
        (Dielectric::default(), Vec3::new(0.9, 0.4, 0.1), sphere([-0.2, 0.8, 1.9], 0.2)),
    ]);
    scene
}

const SOURCES: [(RayProgram, &str); 5] = [
    (RayProgram::DeferredShadows, "spheres_shadows.cpp"),
    (RayProgram::Reflection, "spheres_mirrors.cpp"),
    (RayProgram::Refraction, "spheres_refraction.cpp"),
    (RayProgram::Ssao, "spheres_occlusion.cpp"),
    (RayProgram::Final, "spheres_final.cpp"),
];

/// How many pixels show spheres.
fn pixels_of_spheres(program: &Path, scene: &Scene, asked: Asked<'_>) -> usize {
    let mut shown = 0;
    each_pixel(program, scene, asked, |seen, pixel, _| {
        let id = seen.triangle[pixel];
        shown += usize::from(id != NO_TRIANGLE && scene.is_sphere(id));
    });
    shown
}

#[test]
fn programs_of_scenes_with_spheres_show_what_the_processors_do() {
    let scenes = [with_spheres(several()), with_spheres(under_a_sky()), alone(), inside()];
    for (program, source) in SOURCES {
        let Some(compiled) = compiled_with(source, "spheres", None) else { return };
        for (index, scene) in scenes.iter().enumerate() {
            let straight = asked(program, GlassShadow::Straight, &[]);
            for asked in [
                Asked { depth: 5, samples: 9, ..straight },
                Asked { shadow: GlassShadow::Report, fresnel: Fresnel::Schlick, lod: TextureLod::Cones, ..straight },
                Asked { panes: true, shadow: GlassShadow::Report, depth: 3, samples: 4, ..straight },
            ] {
                // Where glass is panes, programs do not support a sky.
                if asked.panes && index == 1 {
                    continue;
                }
                let (largest, counts, _) = differences(&compiled, scene, asked);
                let what = format!("{program:?} of scene {index}, {:?}, panes {}", asked.shadow, asked.panes);
                assert!(largest < ROUNDING && counts == 0, "{what}: {largest}, {counts} counts differ");
                let exact = matches!(program, RayProgram::DeferredShadows | RayProgram::Ssao);
                assert!(!exact || largest == 0.0, "{what}: {largest}");
            }
            // The camera sees the same for every program.
            if program == RayProgram::DeferredShadows {
                let shown = pixels_of_spheres(&compiled, scene, straight);
                assert!(shown > PIXELS / 6, "scene {index}: {shown} pixels show spheres");
            }
        }
    }
}

#[test]
fn programs_of_scenes_with_spheres_and_several_lights_show_what_the_processors_do() {
    let lights = lamps();
    for (program, source) in
        [(RayProgram::DeferredShadows, "spheres_lights_shadows.cpp"), (RayProgram::Final, "spheres_lights_final.cpp")]
    {
        let Some(compiled) = compiled_with(source, "spheres", None) else { return };
        for scene in [with_spheres(several()), with_spheres(under_a_sky())] {
            let several = asked(program, GlassShadow::Straight, &lights);
            let soft = Asked { sun: 12.0, ..asked(program, GlassShadow::Straight, &[]) };
            for asked in [several, Asked { shadow: GlassShadow::Report, ..several }, soft] {
                let (largest, counts, _) = differences(&compiled, &scene, asked);
                assert!(largest < ROUNDING && counts == 0, "{program:?}: {largest}, {counts} counts differ");
            }
        }
    }
}

#[test]
fn a_wrong_word_of_what_is_said_of_spheres_is_noticed() {
    let straight =
        |program| Asked { depth: 5, lod: TextureLod::Cones, samples: 9, ..asked(program, GlassShadow::Straight, &[]) };
    for (program, header, change) in [
        // The sphere's index comes from another place than its id.
        (
            RayProgram::Refraction,
            "scene.cuh",
            ["spheres.list[spheres.list[id - spheres.first].place]", "spheres.list[id - spheres.first]"],
        ),
        // Spheres show what every material of the triangles shows.
        (
            RayProgram::Final,
            "scene.cuh",
            [
                "shade.texture = shade.glow_texture = NO_TEXTURE;",
                "shade = params.shades[0], shade.texture = NO_TEXTURE;",
            ],
        ),
        // The curvature is that of a plane.
        (
            RayProgram::Refraction,
            "ray_cone.cuh",
            ["copysignf(1.0f / sphere.radius, dot(position - vector_of(sphere.center), facing))", "0.0f"],
        ),
        // The side is that of the other crossing.
        (
            RayProgram::Final,
            "bodies.cuh",
            [
                "sphere_normal(params, crossings, direction, hit), direction) < 0.0f",
                "sphere_normal(params, crossings, direction, hit), direction) > 0.0f",
            ],
        ),
        // A hit is at the farther point of the sphere.
        (RayProgram::Refraction, "spheres.cuh", ["((double)t < b ? -half : half)", "half"]),
        // Spheres occlude no light.
        (
            RayProgram::DeferredShadows,
            "spheres.cuh",
            ["blocked = !(sphere.id & TRANSPARENT) ||", "blocked = hit.t < 0.0f &&"],
        ),
        (RayProgram::Ssao, "spheres.cuh", ["blocked = !(sphere.id & TRANSPARENT) ||", "blocked = hit.t < 0.0f &&"]),
        // Spheres are not seen in mirrors.
        (RayProgram::Reflection, "spheres.cuh", ["            best = hit;\n            limit", "            limit"]),
    ] {
        let (_, source) = SOURCES.into_iter().find(|(own, _)| *own == program).expect("listed");
        let Some(compiled) = compiled_with(source, "spheres-changed", Some((header, change))) else { return };
        let (largest, ..) = differences(&compiled, &with_spheres(several()), straight(program));
        assert!(largest > 1e-3, "{program:?}: {change:?} is not noticed: {largest}");
    }
}
