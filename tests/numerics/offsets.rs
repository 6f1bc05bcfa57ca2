//! Secondary rays at every scale and distance from the origin, at angles up to 89.9 degrees.

use crate::trace_scenes::{Random, geometry, ray};
use curitiba_passes::trace::{Bvh, Hit, Quality, Ray, SurfacePoint, Tracer};
use curitiba_pipeline::scene::{BuildOptions, Group, Material, Mesh, Needs, Object, RenderScene, Scene};
use glam::{DVec3, Mat3, Mat4, Vec3};

const OPAQUE: fn(&Hit) -> bool = |_| unreachable!("opaque triangles are accepted without asking");
const SCALES: [f32; 5] = [1e-6, 1e-3, 1.0, 1e3, 1e6];
/// Distances from the origin.
const PLACES: [f32; 4] = [0.0, 1.0, 1e3, 1e6];
const ANGLES: [f32; 5] = [0.0, 45.0, 80.0, 89.0, 89.9];

/// A direction at this angle from a normal.
fn tilted(normal: Vec3, degrees: f32, random: &mut Random) -> Vec3 {
    let across = normal.cross(random.direction()).normalize_or(normal.any_orthonormal_vector());
    let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
    (normal.as_dvec3() * cos + across.as_dvec3() * sin).as_vec3().normalize()
}

/// A triangle of about this size at this distance from the origin; `None` where `f32` makes it degenerate.
fn placed(scale: f32, place: f32, random: &mut Random) -> Option<[Vec3; 3]> {
    let a = random.direction() * place + random.cube() * scale;
    let (e1, e2) = (random.direction() * scale, random.direction() * scale);
    let corners = [a, a + e1, a + e2];
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    let flat = (b - a).cross(c - a).length() < 0.2 * f64::from(scale).powi(2);
    let kept = ((b - a).length() / f64::from(scale) - 1.0).abs() < 0.2
        && ((c - a).length() / f64::from(scale) - 1.0).abs() < 0.2;
    (!flat && kept).then_some(corners)
}

#[test]
fn a_triangle_is_not_in_its_own_shadow_at_any_scale_place_and_angle() {
    let mut random = Random::new(20);
    let (mut tested, mut naive, mut impossible) = (0_u32, [0_u32; 3], 0);
    for scale in SCALES {
        for place in PLACES {
            let mut here = [0_u32; 3];
            let mut count = 0;
            for _ in 0..400 {
                let Some(corners) = placed(scale, place, &mut random) else {
                    impossible += 1;
                    continue;
                };
                let scene = geometry(&[(0, vec![corners])]);
                let bvh = Bvh::build(&scene, &[], Quality::Fast);
                let [a, b, c] = corners;
                let (u, v) = (0.1 + 0.4 * random.unit(), 0.1 + 0.3 * random.unit());
                let stored = a + (b - a) * u + (c - a) * v;
                let normal = (b.as_dvec3() - a.as_dvec3()).cross(c.as_dvec3() - a.as_dvec3()).normalize().as_vec3();
                for degrees in ANGLES {
                    for side in [1.0, -1.0] {
                        let onward = tilted(normal * side, degrees, &mut random);
                        let snapped = SurfacePoint::snap(&scene, 0, stored);
                        let hit = Hit { t: 1.0, triangle: 0, u, v };
                        for point in [snapped, SurfacePoint::from_hit(&scene, &hit)] {
                            count += 1;
                            let start = point.spawn(onward);
                            assert!(
                                !bvh.occluded(&ray(start, onward), OPAQUE),
                                "scale {scale}, {place} away, {degrees} degrees: {corners:?}, {stored}, {onward}"
                            );
                        }
                        // Negative controls: without an offset, with the usual fixed offset, and with the usual least
                        // distance.
                        here[0] += u32::from(bvh.occluded(&ray(stored, onward), OPAQUE));
                        here[1] += u32::from(bvh.occluded(&ray(stored + normal * side * 1e-4, onward), OPAQUE));
                        here[2] += u32::from(bvh.occluded(&Ray { t_min: 1e-4, ..ray(stored, onward) }, OPAQUE));
                    }
                }
            }
            if count > 0 {
                let share = |hits: u32| 200.0 * f64::from(hits) / f64::from(count);
                println!(
                    "scale {scale:e}, {place:e} away, {count} rays: no offset {:.2} %, 1e-4 along the normal {:.2} %, t above 1e-4 {:.2} %",
                    share(here[0]),
                    share(here[1]),
                    share(here[2])
                );
            }
            tested += count;
            for (sum, hits) in naive.iter_mut().zip(here) {
                *sum += hits;
            }
        }
    }
    assert!(tested > 80_000, "{tested}, and {impossible} triangles that f32 cannot hold");
    assert!(naive.iter().all(|hits| *hits > 1000), "of {} naive rays hit their own triangle: {naive:?}", tested / 2);
}

#[test]
fn an_occluder_is_seen_from_a_fifty_thousandth_of_size_and_distance() {
    let mut random = Random::new(21);
    let (mut tested, mut fixed_missed) = (0, 0);
    for scale in SCALES {
        for place in PLACES {
            let gap = 2e-5 * (scale + place);
            if gap > 0.1 * scale {
                // The offset would have to be finer than the resolution of the triangle's coordinates.
                continue;
            }
            for _ in 0..400 {
                let Some([a, b, c]) = placed(scale, place, &mut random) else { continue };
                let normal = (b - a).cross(c - a).normalize();
                let middle = (a + b + c) / 3.0;
                let above = [a, b, c].map(|corner| middle + (corner - middle) * 3.0 + normal * gap);
                let scene = geometry(&[(0, vec![[a, b, c], above])]);
                let bvh = Bvh::build(&scene, &[], Quality::Fast);
                let onward = tilted(normal, 60.0 * random.unit(), &mut random);
                let point = SurfacePoint::snap(&scene, 0, middle);
                tested += 1;
                assert!(bvh.occluded(&ray(point.spawn(onward), onward), OPAQUE), "scale {scale}, {place} away");
                fixed_missed += usize::from(!bvh.occluded(&ray(middle + normal * 1e-4, onward), OPAQUE));
            }
        }
    }
    assert!(tested > 3000, "{tested}");
    assert!(fixed_missed > 500, "a fixed offset misses {fixed_missed} of {tested}");
}

/// A closed box with walls of two triangles each.
fn room(scale: f32, place: Vec3) -> Vec<[Vec3; 3]> {
    let corner = |i: usize| {
        let at = |bit: usize| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
        place + Vec3::new(at(0), at(1), at(2)) * scale
    };
    let quad = |a, b, c, d| [[corner(a), corner(b), corner(c)], [corner(a), corner(c), corner(d)]];
    [quad(0, 1, 3, 2), quad(4, 6, 7, 5), quad(0, 4, 5, 1), quad(2, 3, 7, 6), quad(0, 2, 6, 4), quad(1, 5, 7, 3)]
        .concat()
}

/// The room, rotated about an axis that is not a coordinate axis, so that its walls are flat only up to rounding.
fn turned_room(scale: f32, place: Vec3) -> Vec<[Vec3; 3]> {
    let turn = Mat3::from_axis_angle(Vec3::new(0.48, -0.6, 0.64), 0.7);
    let mut triangles = room(scale, Vec3::ZERO);
    triangles.iter_mut().flatten().for_each(|corner| *corner = turn * *corner + place);
    triangles
}

#[test]
fn no_light_leaks_out_of_a_closed_room() {
    for build in [room, turned_room] {
        no_light_leaks_out_of(build);
    }
}

fn no_light_leaks_out_of(room: fn(f32, Vec3) -> Vec<[Vec3; 3]>) {
    let mut random = Random::new(22);
    let (mut tested, mut fixed_leaks, mut seam_rays, mut plain_leaks) = (0, 0, 0, 0);
    for scale in SCALES {
        for place in PLACES {
            if place > 1e4 * scale {
                continue;
            }
            let place = random.direction() * place;
            let scene = geometry(&[(0, room(scale, place))]);
            let bvh = Bvh::build(&scene, &[], Quality::Fast);
            for index in 0..4000_u32 {
                let triangle = random.below(12) as u32;
                let [a, b, c] = scene.corners(triangle);
                // Half of the points lie within a ten-thousandth of an edge, and some of them on it.
                let near = if index % 2 == 0 { 1e-4 * random.unit() } else { random.unit() };
                let (u, v) = (near, (1.0 - near) * random.unit());
                let point = SurfacePoint::snap(&scene, triangle, a + (b - a) * u + (c - a) * v);
                let inward =
                    if (place - point.position).dot(point.normal) < 0.0 { -point.normal } else { point.normal };
                let onward = random.cosine(inward);
                let start = point.spawn(onward);
                let blocked = bvh.occluded(&ray(start, onward), OPAQUE);
                tested += 1;
                assert!(blocked, "scale {scale}, at {place}: {start} along {onward}");
                // Negative control: the origin without its move along the plane. Near a border, where another wall is within rounding
                // distance, this origin may be on or behind that wall.
                let plain = point.position + point.normal * (start - point.position).dot(point.normal);
                let borders = [(a, b), (b, c), (c, a)].map(|(from, to)| {
                    let along = (to - from).as_dvec3().normalize();
                    (point.position - from).as_dvec3().reject_from_normalized(along).length()
                });
                if borders.into_iter().fold(f64::MAX, f64::min) <= 64.0 * f64::from(point.error) {
                    seam_rays += 1;
                    plain_leaks += usize::from(!bvh.occluded(&ray(plain, onward), OPAQUE));
                }
                fixed_leaks += usize::from(!bvh.occluded(&ray(point.position + inward * 1e-4, onward), OPAQUE));
            }
        }
    }
    println!(
        "{tested} rays: none leaks; along the normal alone, within 64 rounding errors of a border, {plain_leaks} of {seam_rays}; 1e-4 along the normal {fixed_leaks}"
    );
    assert!(tested > 20_000, "{tested}");
    assert!(fixed_leaks > 1000, "a fixed offset leaves small rooms: {fixed_leaks}");
    assert!(plain_leaks > 50, "control: {plain_leaks} of {seam_rays} in the seams");
}

#[test]
fn the_stated_error_bounds_the_distance_from_the_plane() {
    let mut random = Random::new(23);
    let mut worst = 0.0_f64;
    for scale in SCALES {
        for place in PLACES {
            for _ in 0..2000 {
                let Some(corners) = placed(scale, place, &mut random) else { continue };
                let scene = geometry(&[(0, vec![corners])]);
                let (u, v) = (random.unit() * 0.5, random.unit() * 0.5);
                let point = SurfacePoint::from_hit(&scene, &Hit { t: 1.0, triangle: 0, u, v });
                let [a, b, c] = corners.map(|corner| corner.as_dvec3());
                let normal: DVec3 = (b - a).cross(c - a).normalize();
                let distance = (point.position.as_dvec3() - a).dot(normal).abs();
                worst = worst.max(distance / f64::from(point.error));
            }
        }
    }
    println!("points are off their planes by at most {worst:.2} of the stated error");
    assert!(worst <= 1.0, "{worst}");
    assert!(worst > 0.05, "the bound is of another order than the error: {worst}");
}

/// Number of rays in a thousand that leave closed rooms of this size, whose centre is at this distance from the origin of
/// the positions.
fn leaks(size: f64, distance: f64, recentred: bool) -> f64 {
    let mut random = Random::new(24);
    let (mut leaks, mut tested) = (0_u32, 0_u32);
    for _ in 0..40 {
        // Places as in files that position their objects: exact in f64, and here exact in f32 as well.
        let place = (random.direction() * distance as f32).round();
        let positions = turned_room(0.5 * size as f32, Vec3::ZERO).into_iter().flatten().collect();
        let triangles = (0..12).map(|id| [3 * id, 3 * id + 1, 3 * id + 2]).collect();
        let mesh = Mesh { positions, groups: vec![Group { material: 0, triangles }], ..Mesh::default() };
        let object = Object { name: String::new(), mesh: 0, transform: Mat4::from_translation(place) };
        let scene = Scene {
            meshes: vec![mesh],
            objects: vec![object],
            materials: vec![Material::default()],
            ..Scene::default()
        };
        let origin = (!recentred).then_some(DVec3::ZERO);
        let (built, _) =
            RenderScene::build(scene, &BuildOptions { needs: Needs::NOTHING, origin, ..BuildOptions::default() })
                .unwrap();
        let scene = built.geometry;
        let middle = (place.as_dvec3() - built.origin).as_vec3();
        let bvh = Bvh::build(&scene, &[], Quality::Fast);
        for _ in 0..scene.triangles.len() * 50 {
            let triangle = random.below(scene.triangles.len()) as u32;
            let [a, b, c] = scene.corners(triangle);
            let (u, v) = (random.unit(), random.unit());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let point = SurfacePoint::snap(&scene, triangle, a + (b - a) * u + (c - a) * v);
            let inward = if (middle - point.position).dot(point.normal) < 0.0 { -point.normal } else { point.normal };
            let onward = random.cosine(inward);
            leaks += u32::from(!bvh.occluded(&ray(point.spawn(onward), onward), OPAQUE));
            tested += 1;
        }
    }
    1e3 * f64::from(leaks) / f64::from(tested.max(1))
}

/// A room smaller than the offset of its own rays cannot keep them inside. The limit depends on the distance from the origin
/// of the positions. Scenes are recentred, so a room that is the whole scene does not leak, wherever its file places it.
#[test]
fn rooms_leak_below_the_documented_share_of_their_distance_from_the_origin() {
    // Powers of two, so that the rooms' numbers are exact in f64 at every distance.
    let far = 2.0_f64.powi(20);
    for (share, leaky) in [(-15, false), (-16, false), (-18, true), (-20, true)] {
        let size = far * 2.0_f64.powi(share);
        let (plain, recentred) = (leaks(size, far, false), leaks(size, far, true));
        println!(
            "rooms of {:.1e} of their distance: {plain:.2} of 1000 leave, {recentred:.2} near an origin of their own",
            size / far
        );
        assert_eq!(plain > 0.0, leaky, "{share}: {plain}");
        assert_eq!(recentred, 0.0, "{share}");
    }
}
