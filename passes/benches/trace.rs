//! The tracer against the traversal of the library that builds its binary tree, with the same rays.
//!
//! `cargo bench -p curitiba-passes --bench trace`. Throughput is in rays per second (for builds, triangles per second),
//! on one thread except for builds. Before timing, both must find the same number of hits, except for rays that pass
//! between triangles in the library, which is not watertight.

#[path = "../tests/trace_scenes/mod.rs"]
mod trace_scenes;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use curitiba_passes::trace::{Bvh, Fan, Hit, InstructionSet, Quality, Ray, SurfacePoint, Tracer};
use curitiba_pipeline::scene::Geometry;
use glam::Vec3;
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::ray::RayHit;
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;
use std::time::Duration;
use trace_scenes::{Random, geometry, ray, terrain};

const OPAQUE: fn(&Hit) -> bool = |_| unreachable!("opaque triangles are accepted without asking");
/// Cells along a side of the height field, which has 100,352 triangles.
const CELLS: usize = 224;
const SIZE: usize = 256;
const DIRECTIONS: usize = 16;

/// The library's tree and triangles.
struct Peer {
    tree: Bvh2,
    triangles: Vec<RtTriangle>,
}

fn peer_triangles(geometry: &Geometry) -> Vec<Triangle> {
    let corners = (0..geometry.triangles.len()).map(|triangle| geometry.corners(triangle as u32));
    corners.map(|[a, b, c]| Triangle { v0: a.into(), v1: b.into(), v2: c.into() }).collect()
}

impl Peer {
    fn build(triangles: &[Triangle]) -> Self {
        let tree = build_bvh2_from_tris(triangles, BvhBuildParams::medium_build(), &mut Duration::default());
        let triangles =
            tree.primitive_indices.iter().map(|&index| RtTriangle::from(&triangles[index as usize])).collect();
        Self { tree, triangles }
    }

    fn ray(ray: &Ray) -> obvhs::ray::Ray {
        obvhs::ray::Ray::new(ray.origin.into(), ray.direction.into(), ray.t_min, ray.t_max)
    }

    fn closest(&self, ray: &Ray) -> bool {
        let mut hit = RayHit::none();
        self.tree.ray_traverse(Self::ray(ray), &mut hit, |ray, index| self.triangles[index].intersect(ray));
        hit.t < ray.t_max
    }

    fn occluded(&self, ray: &Ray) -> bool {
        !self.tree.ray_traverse_miss(Self::ray(ray), |ray, index| self.triangles[index].intersect(ray))
    }
}

/// Cosine-distributed directions from one point.
struct Bundle {
    origin: Vec3,
    directions: Vec<Vec3>,
}

struct Rays {
    primary: Vec<Ray>,
    shadow: Vec<Ray>,
    bundles: Vec<Bundle>,
}

fn rays(geometry: &Geometry, bvh: &Bvh) -> Rays {
    let (eye, target, sun) = (Vec3::new(-17.0, 9.0, -17.0), Vec3::new(-4.0, 0.5, -3.0), Vec3::new(0.45, 0.8, 0.35));
    let sun = sun.normalize();
    let forward = (target - eye).normalize();
    let right = forward.cross(Vec3::Y).normalize() * 0.577;
    let up = right.cross(forward);
    let mut rays = Rays { primary: Vec::new(), shadow: Vec::new(), bundles: Vec::new() };
    let mut random = Random::new(12);
    for pixel in 0..SIZE * SIZE {
        let [x, y] = [pixel % SIZE, pixel / SIZE].map(|k| (k as f32 + 0.5) / SIZE as f32 * 2.0 - 1.0);
        let primary = ray(eye, (forward + right * x - up * y).normalize());
        rays.primary.push(primary);
        let Some(hit) = bvh.closest(&primary, OPAQUE) else { continue };
        let point = SurfacePoint::from_hit(geometry, &hit);
        let outward = if point.normal.dot(primary.direction) > 0.0 { -point.normal } else { point.normal };
        if outward.dot(sun) > 0.0 {
            rays.shadow.push(ray(point.spawn(sun), sun));
        }
        let directions = (0..DIRECTIONS).map(|_| random.cosine(outward)).collect();
        rays.bundles.push(Bundle { origin: point.spawn(outward), directions });
    }
    rays
}

fn bundle_rays(bundles: &[Bundle], t_max: f32) -> Vec<Ray> {
    let rays = |bundle: &Bundle| {
        let origin = bundle.origin;
        bundle.directions.iter().map(move |&direction| Ray { origin, direction, t_min: 0.0, t_max }).collect::<Vec<_>>()
    };
    bundles.iter().flat_map(rays).collect()
}

fn instruction_sets() -> impl Iterator<Item = (&'static str, InstructionSet)> {
    [("avx512", InstructionSet::Avx512), ("avx2", InstructionSet::Avx2), ("portable", InstructionSet::Portable)]
        .into_iter()
}

fn trace(criterion: &mut Criterion) {
    let geometry = geometry(&[(0, terrain(CELLS))]);
    let bvh = Bvh::build(&geometry, &[], Quality::Balanced);
    let peer = Peer::build(&peer_triangles(&geometry));
    let rays = rays(&geometry, &bvh);
    let (short, long) = (0.5, 30.0);
    let sets = [
        ("primary", rays.primary.clone()),
        ("shadow", rays.shadow.clone()),
        ("ao short", bundle_rays(&rays.bundles, short)),
        ("ao long", bundle_rays(&rays.bundles, long)),
    ];
    for (name, set) in &sets {
        let is_closest = *name == "primary";
        let ours = |bvh: &Bvh| {
            let hit =
                |ray: &&Ray| if is_closest { bvh.closest(ray, OPAQUE).is_some() } else { bvh.occluded(ray, OPAQUE) };
            set.iter().filter(hit).count()
        };
        let theirs =
            || set.iter().filter(|ray| if is_closest { peer.closest(ray) } else { peer.occluded(ray) }).count();
        let (our_hits, their_hits) = (ours(&bvh), theirs());
        assert!(our_hits.abs_diff(their_hits) <= 10 + set.len() / 10_000, "{name}: {our_hits} and {their_hits} hits");
        assert!(our_hits > set.len() / 100, "{name}: {our_hits} hits of {}", set.len());
        let mut group = criterion.benchmark_group(format!("{name}, one thread"));
        group.throughput(Throughput::Elements(set.len() as u64)).sample_size(10);
        for (name, lanes) in instruction_sets() {
            let Some(bvh) = Bvh::build(&geometry, &[], Quality::Balanced).with_instruction_set(lanes) else { continue };
            group.bench_function(name, |bencher| bencher.iter(|| ours(&bvh)));
        }
        group.bench_function("obvhs", |bencher| bencher.iter(theirs));
        if name.starts_with("ao") {
            let t_max = if *name == "ao short" { short } else { long };
            let open = |bundle: &Bundle| {
                let Bundle { origin, directions, .. } = bundle;
                let fan = Fan { origin: *origin, above: None, t_min: 0.0, t_max, directions };
                bvh.count_open(&fan, OPAQUE) as usize
            };
            let bundles = || rays.bundles.iter().map(open).sum::<usize>();
            assert_eq!(bundles(), set.len() - our_hits, "{name}");
            group.bench_function("bundles", |bencher| bencher.iter(bundles));
        }
        group.finish();
    }
}

fn build(criterion: &mut Criterion) {
    let geometry = geometry(&[(0, terrain(CELLS))]);
    let triangles = peer_triangles(&geometry);
    let mut group = criterion.benchmark_group(format!("build, {} threads", rayon::current_num_threads()));
    group.throughput(Throughput::Elements(triangles.len() as u64)).sample_size(10);
    for quality in [Quality::Fast, Quality::Balanced, Quality::Slow] {
        group.bench_function(format!("{quality:?}").to_lowercase(), |bencher| {
            bencher.iter(|| Bvh::build(&geometry, &[], quality));
        });
    }
    group.bench_function("obvhs", |bencher| bencher.iter(|| Peer::build(&triangles)));
    group.finish();
}

criterion_group!(benches, build, trace);
criterion_main!(benches);
