//! Secondary rays neither hit the surface they leave nor miss another surface close to it.

use crate::trace_scenes::{Random, geometry, ray};
use curitiba_passes::trace::{Bvh, Hit, Quality, Ray, SurfacePoint, Tracer};
use curitiba_pipeline::scene::Geometry;
use glam::Vec3;

const OPAQUE: fn(&Hit) -> bool = |_| unreachable!("opaque triangles are accepted without asking");
const PER_SCENE: usize = 100_000;

/// A parallelogram of two triangles with edges of about 0.2 `scale`, at a random place at distance `center` from the
/// origin.
fn patch(scale: f32, center: f32, random: &mut Random) -> [[Vec3; 3]; 2] {
    let a = random.direction() * center + random.cube() * scale;
    let (e1, e2) = (random.direction() * 0.2 * scale, random.direction() * 0.2 * scale);
    [[a, a + e1, a + e2], [a + e1, a + e1 + e2, a + e2]]
}

/// The hit of a test's primary ray on its patch, and a cosine-distributed direction of the secondary ray.
struct Sample {
    scene: Geometry,
    bvh: Bvh,
    hit: Hit,
    primary: Ray,
    outward: Vec3,
    onward: Vec3,
}

fn sample(scale: f32, center: f32, gap: Option<f32>, random: &mut Random) -> Option<Sample> {
    let patch = patch(scale, center, random);
    let [a, b, c] = patch[0];
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let (u, v) = (random.unit() * 0.5, random.unit() * 0.5);
    let target = a + (b - a) * u + (c - a) * v;
    let origin = target + random.direction() * scale * (1.0 + 9.0 * random.unit());
    let direction = (target - origin).normalize();
    let outward = if normal.dot(direction) > 0.0 { -normal } else { normal };
    let mut triangles = patch.to_vec();
    if let Some(gap) = gap {
        // A parallel copy of the patch in front of it, three times as large.
        let middle = (a + b + c) / 3.0;
        triangles.push(patch[0].map(|corner| middle + (corner - middle) * 3.0 + outward * gap));
    }
    let scene = geometry(&[(0, triangles)]);
    let only_patch = Geometry { triangles: scene.triangles[..2].to_vec(), ..scene.clone() };
    let primary = ray(origin, direction);
    let hit = Bvh::build(&only_patch, &[], Quality::Fast).closest(&primary, OPAQUE)?;
    let bvh = Bvh::build(&scene, &[], Quality::Fast);
    let onward = random.cosine(outward);
    Some(Sample { scene, bvh, hit, primary, outward, onward })
}

fn scales() -> impl Iterator<Item = (f32, f32)> {
    [1e-3, 1.0, 1e3, 1e6].into_iter().flat_map(|scale| [0.0, 1.0, 1e3].map(|ratio| (scale, ratio)))
}

#[test]
fn no_ray_hits_the_surface_it_leaves() {
    let mut naive = [0; 3];
    let mut tested = 0;
    for (scale, ratio) in scales() {
        let mut random = Random::new(8);
        let mut own = [0; 3];
        for _ in 0..PER_SCENE {
            let Some(sample) = sample(scale, scale * ratio, None, &mut random) else { continue };
            tested += 1;
            let stored = sample.primary.origin + sample.primary.direction * sample.hit.t;
            let starts = [
                SurfacePoint::from_hit(&sample.scene, &sample.hit).spawn(sample.onward),
                SurfacePoint::snap(&sample.scene, sample.hit.triangle, stored).spawn(sample.onward),
                // A naive renderer's origin: a fixed distance along the normal.
                stored + sample.outward * 1e-4,
            ];
            for (count, start) in own.iter_mut().zip(starts) {
                *count += usize::from(sample.bvh.occluded(&ray(start, sample.onward), OPAQUE));
            }
            naive[0] += usize::from(sample.bvh.occluded(&ray(stored, sample.onward), OPAQUE));
        }
        assert_eq!(own[..2], [0, 0], "scale {scale}, distance {ratio} scales");
        naive[1] += usize::from(own[2] > PER_SCENE / 10);
    }
    assert!(tested >= 1_000_000, "{tested}");
    assert!(naive[0] > tested / 4, "without an offset, {} of {tested} hit", naive[0]);
    assert!(naive[1] >= 2, "with a fixed offset, {} of 12 scenes fail", naive[1]);
}

/// On a wall that is large compared with its distance from the origin, the error of the hit distance must stay below
/// the origin's offset, however flat the ray.
#[test]
fn no_ray_hits_the_large_wall_it_leaves() {
    let mut random = Random::new(11);
    for turn in 0..3 {
        let turned = |p: Vec3| Vec3::from([p[turn], p[(turn + 1) % 3], p[(turn + 2) % 3]]);
        for size in [1.0, 30.0, 3000.0, 1e6] {
            let height = 0.3 + random.unit();
            let corners = [(-1.0, -1.0), (1.0, -0.9), (1.1, 1.0), (-0.8, 1.2)]
                .map(|(x, y)| turned(Vec3::new(x * size, y * size, height)));
            let [a, b, c, d] = corners;
            let scene = geometry(&[(0, vec![[a, b, c], [a, c, d]])]);
            let bvh = Bvh::build(&scene, &[], Quality::Balanced);
            let mut own = 0;
            for _ in 0..50_000 {
                let target = turned(Vec3::new(random.cube().x * size * 0.7, random.cube().x * size * 0.7, height));
                let triangle = u32::from(SurfacePoint::snap(&scene, 0, target).position.distance(target) > 1e-3 * size);
                let point = SurfacePoint::snap(&scene, triangle, target);
                let mut onward = random.cosine(point.normal);
                if random.below(2) == 0 {
                    onward = (onward - point.normal * onward.dot(point.normal) * 0.999).normalize();
                }
                own += usize::from(bvh.occluded(&ray(point.spawn(onward), onward), OPAQUE));
            }
            assert_eq!(own, 0, "size {size}");
        }
    }
}

#[test]
fn an_occluder_a_thousandth_above_the_surface_is_seen() {
    let mut fixed_offset_missed = 0;
    for (scale, ratio) in scales().filter(|&(_, ratio)| ratio <= 1.0) {
        let mut random = Random::new(9);
        let mut missed = 0;
        for _ in 0..PER_SCENE / 10 {
            let Some(sample) = sample(scale, scale * ratio, Some(1e-3 * scale), &mut random) else { continue };
            let seen = |start| sample.bvh.occluded(&ray(start, sample.outward), OPAQUE);
            let stored = sample.primary.origin + sample.primary.direction * sample.hit.t;
            missed += usize::from(!seen(SurfacePoint::from_hit(&sample.scene, &sample.hit).spawn(sample.outward)));
            let snapped = SurfacePoint::snap(&sample.scene, sample.hit.triangle, stored);
            missed += usize::from(!seen(snapped.spawn(sample.outward)));
            fixed_offset_missed += usize::from(!seen(stored + sample.outward * 1e-4));
        }
        assert_eq!(missed, 0, "scale {scale}, distance {ratio} scales");
    }
    assert!(fixed_offset_missed > 1000, "{fixed_offset_missed}");
}

/// A tilted plane as a G-buffer stores it: positions with the error of a 16-bit float, far from the eye and the origin.
#[test]
fn a_position_stored_with_a_large_error_is_brought_back_to_its_triangle() {
    let mut random = Random::new(10);
    let mut unsnapped = 0;
    for (depth, eye) in
        [(5.0, Vec3::ZERO), (50.0, Vec3::ZERO), (500.0, Vec3::ZERO), (50.0, Vec3::new(5000.0, 100.0, -3000.0))]
    {
        for _ in 0..20 {
            let forward = random.direction();
            let normal = random.cosine(-forward);
            let side = normal.any_orthonormal_vector();
            let (e1, e2) = (side * depth, normal.cross(side) * depth);
            let middle = eye + forward * depth;
            let corners = [middle - e1 - e2, middle + e1 - e2, middle + e1 + e2, middle - e1 + e2];
            let scene =
                geometry(&[(0, vec![[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]])]);
            let bvh = Bvh::build(&scene, &[], Quality::Fast);
            for _ in 0..1000 {
                let direction = (middle + (e1 * random.cube().x + e2 * random.cube().y) * 0.9 - eye).normalize();
                let Some(hit) = bvh.closest(&ray(eye, direction), OPAQUE) else { continue };
                let stored = (eye + direction * hit.t) + random.cube() * depth * (1.0 / 2048.0);
                let onward = random.cosine(normal);
                let point = SurfacePoint::snap(&scene, hit.triangle, stored);
                assert!((point.position - stored).length() < depth * 1e-3);
                assert!(!bvh.occluded(&ray(point.spawn(onward), onward), OPAQUE), "depth {depth}, eye {eye}");
                unsnapped += usize::from(bvh.occluded(&ray(stored + normal * 1e-4, onward), OPAQUE));
            }
        }
    }
    assert!(unsnapped > 10_000, "{unsnapped}");
}

#[test]
fn a_point_outside_its_triangle_comes_to_the_edge_and_degenerate_triangles_give_a_corner() {
    let scene = geometry(&[(0, vec![[Vec3::ZERO, Vec3::X, Vec3::Y], [Vec3::ONE; 3]])]);
    let point = SurfacePoint::snap(&scene, 0, Vec3::new(0.25, 0.5, 0.01));
    assert!((point.position - Vec3::new(0.25, 0.5, 0.0)).length() < 1e-7);
    // The plane contains the origin, so only half the distance of 0.75 to the farthest corner enters the error.
    assert_eq!((point.normal, point.error), (Vec3::Z, 0.375 / 16_777_216.0));
    let outside = SurfacePoint::snap(&scene, 0, Vec3::new(2.0, 2.0, 0.0)).position;
    assert!((outside - Vec3::new(0.5, 0.5, 0.0)).length() < 1e-6, "{outside}");
    assert_eq!(SurfacePoint::snap(&scene, 0, Vec3::new(-1.0, -2.0, 3.0)).position, Vec3::ZERO);
    for position in [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY] {
        let point = SurfacePoint::snap(&scene, 1, position);
        assert_eq!((point.position, point.normal), (Vec3::ONE, Vec3::ZERO));
        assert_eq!(point.spawn(Vec3::X), Vec3::ONE);
    }
    assert_eq!(SurfacePoint::snap(&scene, 0, Vec3::NAN).position, Vec3::ZERO);
}
