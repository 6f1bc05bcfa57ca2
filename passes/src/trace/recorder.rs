//! A tracer that records its queries and their results.

use super::ray::{Hit, Ray};
use super::tracer::{Announcement, Purpose, Tracer};
use curitiba_pipeline::scene::Geometry;
use glam::{DVec3, Vec3};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What a recorded ray met.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// The nearest surface.
    Hit(Hit),
    /// Nothing in its interval.
    Miss,
    /// Something blocks the ray; the hit is the nearest that does.
    Blocked(Hit),
    /// Nothing blocks the ray.
    Open,
}

/// A ray and its result.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedRay {
    /// Purpose of the ray.
    pub purpose: Purpose,
    /// Number of glass surfaces on the path before the ray.
    pub bounce: u32,
    /// The ray's share of the pixel: the product of the weights along its path. A visibility is a factor of a colour: a shadow ray has the
    /// weight of that colour, and each of N occlusion rays has 1/N of it.
    pub weight: f32,
    /// The ray.
    pub ray: Ray,
    /// Id of the triangle or sphere that the ray leaves; `None` if it leaves none, as at a pixel that shows no surface.
    pub leaves: Option<u32>,
    /// Distance of the ray's origin from the plane of that triangle, or from the surface of that sphere: positive on the side to which the
    /// ray goes; 0 if the ray leaves no surface.
    pub offset: f64,
    /// What the ray met.
    pub outcome: Outcome,
    /// Candidate hits on transparent materials, each with whether it was accepted: alpha cut-outs, glass that lets light pass.
    pub asked: Vec<(Hit, bool)>,
}

/// One thing that the recorder saw.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// A ray was traced.
    Ray(RecordedRay),
    /// A tracer was certain, without tracing rays, that nothing lies within `t_max` of `origin` on the side of `normal`.
    Certain {
        /// Origin of the rays that were not traced.
        origin: Vec3,
        /// Unit normal of the half space.
        normal: Vec3,
        /// Length of the rays that were not traced.
        t_max: f32,
    },
}

#[derive(Debug)]
struct Log {
    announced: Announcement,
    /// Weight of the rays at each bounce on the current path.
    weights: Vec<f32>,
    /// For each bounce on the current path, the triangle that its rays leave.
    surfaces: Vec<Option<u32>>,
    events: Vec<Event>,
}

/// Forwards queries to another tracer, one ray at a time, and records all queries and results of **one pixel**.
///
/// For inspecting a pixel; it locks a mutex and allocates for each ray.
#[derive(Debug)]
pub struct Recorder<'a, T> {
    inner: &'a T,
    geometry: &'a Geometry,
    log: Mutex<Log>,
}

impl<'a, T: Tracer> Recorder<'a, T> {
    /// A recorder for a pixel that shows `triangle` (`None`: no surface) of the scene that `inner` was built on.
    #[must_use]
    pub fn new(inner: &'a T, geometry: &'a Geometry, triangle: Option<u32>) -> Self {
        let announced = Announcement { purpose: Purpose::Shadow, bounce: 0, weight: 1.0 };
        let log = Log { announced, weights: Vec::new(), surfaces: vec![triangle], events: Vec::new() };
        Self { inner, geometry, log: Mutex::new(log) }
    }

    /// The recorded events, in order.
    #[must_use]
    pub fn events(self) -> Vec<Event> {
        self.log.into_inner().unwrap_or_else(PoisonError::into_inner).events
    }

    fn log(&self) -> MutexGuard<'_, Log> {
        self.log.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn record(&self, ray: &Ray, outcome: Outcome, asked: Vec<(Hit, bool)>) {
        let mut log = self.log();
        let Announcement { purpose, bounce, weight } = log.announced;
        let leads_on = matches!(purpose, Purpose::Reflected | Purpose::Refracted | Purpose::Camera);
        // Shadow and occlusion rays leave the surface that was found last.
        let leaves = if leads_on { log.surfaces.get(bounce as usize) } else { log.surfaces.last() };
        let leaves = leaves.copied().flatten();
        let path: f32 = log.weights.iter().product();
        let weight = if leads_on { path } else { path * weight };
        let offset = leaves.map_or(0.0, |triangle| self.distance(triangle, ray));
        if leads_on {
            log.surfaces.truncate(bounce as usize + 1);
            log.surfaces.push(match &outcome {
                Outcome::Hit(hit) => Some(hit.triangle),
                _ => None,
            });
        }
        log.events.push(Event::Ray(RecordedRay { purpose, bounce, weight, ray: *ray, leaves, offset, outcome, asked }));
    }

    /// The nearest accepted hit that is not on the sky, which stops no shadow or occlusion ray.
    fn blocker(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        let mut left = *ray;
        loop {
            let hit = self.inner.closest(&left, &mut accept)?;
            if !self.geometry.sky.contains(hit.triangle) {
                return Some(hit);
            }
            // A tracer in `f64` would find a hit again whose distance was rounded down.
            left.t_min = if hit.t > left.t_min { hit.t } else { hit.t.next_up() };
        }
    }

    fn distance(&self, triangle: u32, ray: &Ray) -> f64 {
        if let Some(sphere) = self.geometry.sphere(triangle) {
            let from = ray.origin.as_dvec3() - sphere.center.as_dvec3();
            let above = from.length() - f64::from(sphere.radius);
            return if from.dot(ray.direction.as_dvec3()) < 0.0 { -above } else { above };
        }
        let [a, b, c] = self.geometry.corners(triangle).map(|corner| corner.as_dvec3());
        let normal: DVec3 = (b - a).cross(c - a).normalize_or_zero();
        let distance = (ray.origin.as_dvec3() - a).dot(normal);
        if normal.dot(ray.direction.as_dvec3()) < 0.0 { -distance } else { distance }
    }
}

/// Wraps `accept` so that each candidate is added to `asked`, with whether it was accepted.
fn listen<'l>(
    asked: &'l mut Vec<(Hit, bool)>,
    accept: &'l mut impl FnMut(&Hit) -> bool,
) -> impl FnMut(&Hit) -> bool + 'l {
    |hit| {
        let accepted = accept(hit);
        asked.push((*hit, accepted));
        accepted
    }
}

impl<T: Tracer> Tracer for Recorder<'_, T> {
    const SPHERES: bool = T::SPHERES;
    const LISTENS: bool = true;

    fn closest(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        let mut asked = Vec::new();
        let hit = self.inner.closest(ray, listen(&mut asked, &mut accept));
        self.record(ray, hit.map_or(Outcome::Miss, Outcome::Hit), asked);
        hit
    }

    fn occluded(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> bool {
        let mut asked = Vec::new();
        let blocked = self.inner.occluded(ray, listen(&mut asked, &mut accept));
        // Further queries find the blocker; calling `accept` again is allowed.
        let blocker = if blocked { self.blocker(ray, &mut accept) } else { None };
        self.record(ray, blocker.map_or(Outcome::Open, Outcome::Blocked), asked);
        blocked
    }

    fn clear_above(&self, origin: Vec3, normal: Vec3, t_max: f32) -> bool {
        let clear = self.inner.clear_above(origin, normal, t_max);
        if clear {
            self.log().events.push(Event::Certain { origin, normal, t_max });
        }
        clear
    }

    fn announce(&self, rays: Announcement) {
        let mut log = self.log();
        log.announced = rays;
        if matches!(rays.purpose, Purpose::Reflected | Purpose::Refracted | Purpose::Camera) {
            log.weights.truncate(rays.bounce as usize);
            log.weights.push(rays.weight);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::{BruteForce, Bvh, Quality};
    use curitiba_pipeline::scene::{Batch, TriangleRanges};

    #[test]
    fn what_stops_a_ray_is_no_sky_before_it() {
        let mut geometry = Geometry::default();
        // From near to far: two triangles of a sky and a wall.
        for (id, z) in [1.0, 2.0, 3.0].into_iter().enumerate() {
            geometry.positions.extend([[-9.0, -9.0], [9.0, -9.0], [0.0, 9.0]].map(|[x, y]| Vec3::new(x, y, z)));
            geometry.triangles.push([0, 1, 2].map(|corner| 3 * id as u32 + corner));
        }
        geometry.batches = vec![Batch { material: 0, first: 0, count: 2 }, Batch { material: 1, first: 2, count: 1 }];
        geometry.sky = TriangleRanges::of_triangles(&geometry, &[true, false]);
        let tree = Bvh::build(&geometry, &[], Quality::Fast);
        let recorder = Recorder::new(&tree, &geometry, None);
        let ray = Ray { origin: Vec3::ZERO, direction: Vec3::Z, t_min: 0.0, t_max: 10.0 };
        assert_eq!(tree.closest(&ray, |_| true).map(|hit| hit.triangle), Some(0), "the sky is nearer");
        assert!(recorder.occluded(&ray, |_| true));
        assert!(!recorder.occluded(&Ray { t_max: 2.5, ..ray }, |_| true));
        let outcome = |event| match event {
            Event::Ray(ray) => ray.outcome,
            Event::Certain { .. } => Outcome::Miss,
        };
        let outcomes: Vec<_> = recorder.events().into_iter().map(outcome).collect();
        let [Outcome::Blocked(hit), Outcome::Open] = outcomes[..] else { panic!("{outcomes:?}") };
        assert_eq!((hit.triangle, hit.t), (2, 3.0));
        // A tracer in `f64`, whose distances to the sky are rounded up or down.
        let brute_force = BruteForce::new(&geometry, &[]);
        let recorder = Recorder::new(&brute_force, &geometry, None);
        let mut rounded_down = 0;
        for factor in 1..=40_u8 {
            let ray = Ray { direction: Vec3::Z * f32::from(factor), ..ray };
            rounded_down += u32::from(f64::from(1.0 / f32::from(factor)) < 1.0 / f64::from(factor));
            assert!(recorder.occluded(&ray, |_| true), "{factor}");
            assert!(!recorder.occluded(&Ray { t_max: 2.5 / f32::from(factor), ..ray }, |_| true), "{factor}");
        }
        assert!(rounded_down > 0, "no distance is rounded down");
    }
}
