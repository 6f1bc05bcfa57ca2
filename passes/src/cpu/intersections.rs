//! Traces the rays of a storage buffer.

use crate::trace::{Hit, Ray, Tracer};
use curitiba_pipeline::backend::{IntersectionJob, NO_HIT, Query};
use curitiba_pipeline::executor::Progress;
use glam::DVec3;
use rayon::prelude::*;

/// Rays that a thread traces between two checks for cancellation.
const PIECE: usize = 1024;

/// Traces a job's rays into `hits`, one entry a ray, and returns how many were traced. Rays that cannot meet anything are not counted.
pub(super) fn trace<T: Tracer>(
    tracer: &T,
    job: &IntersectionJob<'_>,
    hits: &mut [[f32; 4]],
    progress: &Progress,
) -> u64 {
    progress.start(job.rays.len() as u64);
    let pieces = job.rays.par_chunks(PIECE).zip(hits.par_chunks_mut(PIECE));
    let traced = pieces.map(|(rays, hits)| {
        // After a cancellation the output is discarded.
        if progress.is_cancelled() {
            return 0;
        }
        let mut traced = 0;
        for (ray, written) in rays.iter().zip(hits) {
            let prepared = prepare(*ray, job.scene.origin);
            traced += u64::from(prepared.is_some());
            let hit = prepared.and_then(|(ray, length)| {
                let hit = match job.query {
                    Query::Closest => tracer.closest(&ray, |_| true)?,
                    Query::Any => tracer.any(&ray, |_| true)?,
                };
                Some(record(hit, length))
            });
            *written = hit.unwrap_or(NO_HIT);
        }
        progress.advance(rays.len() as u64);
        traced
    });
    traced.sum()
}

/// Converts a ray of the buffer to a ray with a unit direction and an origin relative to the scene's origin. Also returns the length of the
/// buffer's direction, which is the unit of the buffer's distances. `None` for a ray that can meet nothing.
fn prepare([from, along]: [[f32; 4]; 2], origin: DVec3) -> Option<(Ray, f64)> {
    let [[x, y, z, least], [right, up, back, greatest]] = [from, along].map(|ray| ray.map(f64::from));
    let direction = DVec3::new(right, up, back);
    let length = direction.length();
    let start = DVec3::new(x, y, z) - origin;
    // Comparisons with NaN are false.
    let meets = start.is_finite() && length.is_finite() && length > 0.0 && least.is_finite() && least < greatest;
    if !meets {
        return None;
    }
    let ray = Ray {
        origin: start.as_vec3(),
        direction: (direction / length).as_vec3(),
        t_min: (least * length).max(0.0) as f32,
        t_max: (greatest * length) as f32,
    };
    Some((ray, length))
}

fn record(hit: Hit, length: f64) -> [f32; 4] {
    [(f64::from(hit.t) / length) as f32, f32::from_bits(hit.triangle), hit.u, hit.v]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::CpuRays;
    use curitiba_pipeline::backend::RayBackend;
    use curitiba_pipeline::progress::Cancellation;
    use curitiba_pipeline::scene::{Geometry, RenderScene};
    use glam::Vec3;
    use std::sync::Arc;

    /// Two triangles perpendicular to the axis z, at z = 0 and z = 1 relative to the scene's origin `origin`.
    fn scene(origin: DVec3) -> Arc<RenderScene> {
        let at = |z: f32| [Vec3::new(0.0, 0.0, z), Vec3::new(1.0, 0.0, z), Vec3::new(0.0, 1.0, z)];
        let positions = [at(0.0), at(1.0)].concat();
        let geometry = Geometry { positions, triangles: vec![[0, 1, 2], [3, 4, 5]], ..Geometry::default() };
        Arc::new(RenderScene { geometry, origin, ..RenderScene::default() })
    }

    fn traced(scene: &Arc<RenderScene>, rays: &[[[f32; 4]; 2]]) -> (Vec<[f32; 4]>, u64) {
        let mut backend = CpuRays::new();
        backend.build(scene, &[]).expect("it is built");
        let mut hits = vec![[7.0; 4]; rays.len()];
        let job = IntersectionJob { scene, rays, query: Query::Closest };
        let stats = backend.intersect(&job, &mut hits, &Progress::default()).expect("it traces");
        (hits, stats.rays.buffer)
    }

    fn bits(hit: [f32; 4]) -> [u32; 4] {
        hit.map(f32::to_bits)
    }

    #[test]
    fn a_hit_is_the_distance_the_triangle_and_its_place_in_it() {
        let (from, down) = ([0.25, 0.5, 3.0, 0.0], [0.0, 0.0, -1.0, f32::INFINITY]);
        let rays = [
            [from, down],
            // Distances are in multiples of the direction's length.
            [from, [0.0, 0.0, -4.0, 10.0]],
            [[0.25, 0.5, 3.0, 0.5 + 1e-6], [0.0, 0.0, -4.0, 10.0]],
            // The interval ends before the second triangle, or begins behind it.
            [from, [0.0, 0.0, -1.0, 1.9]],
            [[0.25, 0.5, 3.0, 3.1], down],
            // Beside the triangles.
            [[0.75, 0.5, 3.0, 0.0], down],
            // From the other side.
            [[0.25, 0.5, -1.0, 0.0], [0.0, 0.0, 1.0, 10.0]],
            [[0.25, 0.5, -1.0, -3.0], [0.0, 0.0, 1.0, 10.0]],
        ];
        let (hits, count) = traced(&scene(DVec3::ZERO), &rays);
        let hit = |t: f32, triangle: u32| [t, f32::from_bits(triangle), 0.25, 0.5];
        let wanted =
            [hit(2.0, 1), hit(0.5, 1), hit(0.75, 0), NO_HIT, NO_HIT, NO_HIT, hit(1.0, 0), hit(1.0, 0)].map(bits);
        assert_eq!(hits.into_iter().map(bits).collect::<Vec<_>>(), wanted);
        assert_eq!(count, 8);
        assert_eq!(bits(NO_HIT), [(-1.0_f32).to_bits(), -1_i32 as u32, 0, 0]);
    }

    #[test]
    fn rays_that_are_none_meet_nothing() {
        let good = [[0.25, 0.5, 3.0, 0.0], [0.0, 0.0, -1.0, 10.0]];
        let mut rays = vec![good];
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for place in 0..8 {
                // An interval may have an infinite end.
                if place == 7 && value == f32::INFINITY {
                    continue;
                }
                let mut bad = good;
                bad.as_flattened_mut()[place] = value;
                rays.push(bad);
            }
        }
        rays.push([good[0], [0.0, 0.0, 0.0, 10.0]]);
        rays.push([good[0], [0.0, 0.0, -1.0, 0.0]]);
        rays.push([[f32::MAX; 4], [f32::MAX; 4]]);
        rays.push([good[0], [f32::MIN_POSITIVE, 0.0, 0.0, f32::MAX]]);
        let (hits, count) = traced(&scene(DVec3::ZERO), &rays);
        assert_eq!(hits[0][0], 3.0 - 1.0);
        assert!(hits[1..].iter().all(|hit| bits(*hit) == bits(NO_HIT)), "{hits:?}");
        assert_eq!(count, 2, "the good one, and one that runs sideways");
    }

    #[test]
    fn rays_are_in_the_world_and_not_at_the_origin_of_the_scene() {
        let origin = DVec3::new(4096.0, -8192.0, 16384.0);
        let ray = [[4096.25, -8191.5, 16387.0, 0.0], [0.0, 0.0, -1.0, 10.0]];
        let (hits, _) = traced(&scene(origin), &[ray]);
        assert_eq!(bits(hits[0]), bits([2.0, f32::from_bits(1), 0.25, 0.5]));
    }

    #[test]
    fn it_is_given_up_between_pieces_and_needs_a_structure() {
        let scene = scene(DVec3::ZERO);
        let rays = vec![[[0.25, 0.5, 3.0, 0.0], [0.0, 0.0, -1.0, 10.0]]; 4 * PIECE];
        let job = IntersectionJob { scene: &scene, rays: &rays, query: Query::Any };
        let mut hits = vec![[7.0; 4]; rays.len()];
        let mut backend = CpuRays::new();
        assert!(backend.intersect(&job, &mut hits, &Progress::default()).is_err(), "nothing is built");
        backend.build(&scene, &[]).expect("it is built");
        let stop = Cancellation::new();
        stop.cancel();
        let progress = Progress::until(&stop);
        let stats = backend.intersect(&job, &mut hits, &progress).expect("it stops");
        assert!(progress.is_given_up() && stats.rays.buffer == 0 && hits.iter().all(|hit| *hit == [7.0; 4]));
        let progress = Progress::default();
        backend.intersect(&job, &mut hits, &progress).expect("it traces");
        assert_eq!(progress.get(), (4 * PIECE as u64, 4 * PIECE as u64));
        assert!(hits.iter().all(|hit| hit[0] == 2.0 || hit[0] == 3.0));
    }

    /// Triangles all over a cube, and rays between points of it. An any hit is one of the hits that an `f64` search of all triangles finds, and
    /// exists exactly where that search finds one. The closest hit is the nearest of them.
    #[test]
    fn any_hit_is_one_of_all_and_the_same_on_any_number_of_threads() {
        let mut state = 1_u32;
        let mut number = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let mut point = || Vec3::new(number(), number(), number());
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for index in 0..400 {
            let center = point();
            positions.extend([(); 3].map(|()| center + (point() - 0.5) * 0.2));
            triangles.push([3 * index, 3 * index + 1, 3 * index + 2]);
        }
        let rays: Vec<[[f32; 4]; 2]> = (0..3000)
            .map(|_| {
                let (from, to) = (point(), point());
                [from.extend(0.0).to_array(), (to - from).extend(1.0).to_array()]
            })
            .collect();
        let hits_of = |[from, along]: [[f32; 4]; 2]| {
            let [from, along] = [from, along].map(|ray| DVec3::new(ray[0].into(), ray[1].into(), ray[2].into()));
            let hit = |triangle: &[u32; 3]| {
                let [a, b, c] = triangle.map(|corner| positions[corner as usize].as_dvec3());
                let (right, up, across) = (b - a, c - a, along.cross(c - a));
                let determinant = right.dot(across);
                let (offset, turned) = (from - a, (from - a).cross(right));
                let (u, v, t) = (offset.dot(across), along.dot(turned), up.dot(turned));
                let [u, v, t] = [u, v, t].map(|value| value / determinant);
                // Least margin of the barycentric coordinates and of `t` within their ranges; negative outside the triangle or the interval.
                let inside = u.min(v).min(1.0 - u - v).min(t).min(1.0 - t);
                (inside, [t, u, v])
            };
            triangles.iter().map(hit).collect::<Vec<_>>()
        };
        let geometry = Geometry { positions: positions.clone(), triangles: triangles.clone(), ..Geometry::default() };
        let scene = Arc::new(RenderScene { geometry, ..RenderScene::default() });
        let mut backend = CpuRays::new();
        backend.build(&scene, &[]).expect("it is built");
        let mut traced = |query, threads: usize| {
            let mut hits = vec![[7.0; 4]; rays.len()];
            let job = IntersectionJob { scene: &scene, rays: &rays, query };
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| backend.intersect(&job, &mut hits, &Progress::default())).expect("it traces");
            hits
        };
        let (any, closest) = (traced(Query::Any, 1), traced(Query::Closest, 1));
        assert_eq!(any.as_flattened().iter().map(|v| v.to_bits()).collect::<Vec<_>>(), {
            let again = traced(Query::Any, 3);
            again.as_flattened().iter().map(|v| v.to_bits()).collect::<Vec<_>>()
        });
        let (mut hit, mut farther) = (0, 0);
        for ((ray, any), closest) in rays.iter().zip(&any).zip(&closest) {
            let all = hits_of(*ray);
            let sure = all.iter().any(|(inside, _)| *inside > 1e-5);
            let possible = all.iter().any(|(inside, _)| *inside > -1e-5);
            let is_hit = any[1].to_bits() != u32::MAX;
            assert!(
                is_hit == (closest[1].to_bits() != u32::MAX) && (is_hit || !sure) && (possible || !is_hit),
                "{ray:?}"
            );
            if is_hit {
                let (inside, place) = all[any[1].to_bits() as usize];
                let off = [any[0], any[2], any[3]].into_iter().zip(place).map(|(a, b)| (f64::from(a) - b).abs());
                assert!(inside > -1e-5 && off.fold(0.0, f64::max) < 1e-3, "{any:?} {place:?}");
                let nearest =
                    all.iter().filter(|(inside, _)| *inside > 1e-5).map(|(_, [t, ..])| *t).fold(1.0, f64::min);
                assert!(f64::from(closest[0]) < nearest + 1e-5, "{closest:?} {nearest}");
                hit += 1;
                farther += usize::from(any[0] > closest[0]);
            }
        }
        // Control: many rays hit several triangles, and the search ended before the nearest.
        assert!(hit > 500 && farther > 100, "{hit} rays hit, {farther} not the nearest");
    }
}
