//! A tracer that keeps what it is asked and what it answers.

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
    /// Something is in the way; of all that is, the nearest.
    Blocked(Hit),
    /// Nothing is in the way.
    Open,
}

/// A ray with its answer.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedRay {
    /// What it was traced for.
    pub purpose: Purpose,
    /// Glass surfaces met before it.
    pub bounce: u32,
    /// The ray's share of the pixel: the product of the weights along its path. Visibilities multiply the colour that they
    /// belong to, so a shadow ray has the weight of that colour, and each of N occlusion rays the N-th part of it.
    pub weight: f32,
    /// The ray.
    pub ray: Ray,
    /// The triangle or sphere that it leaves; `None` at a pixel that shows none.
    pub leaves: Option<u32>,
    /// Distance of its origin from that triangle's plane, positive on the side to which the ray goes; 0 without one.
    pub offset: f64,
    /// What it met.
    pub outcome: Outcome,
    /// Candidates on transparent materials, and whether there was a surface: alpha cut-outs, glass that lets light pass.
    pub asked: Vec<(Hit, bool)>,
}

/// What the recorder saw, in order.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// A ray.
    Ray(RecordedRay),
    /// It was certain, without a ray, that nothing is within `t_max` of `origin` on the side of `normal`.
    Certain {
        /// Origin of the rays that were not traced.
        origin: Vec3,
        /// Unit normal.
        normal: Vec3,
        /// How far they would have gone.
        t_max: f32,
    },
}

#[derive(Debug)]
struct Log {
    announced: Announcement,
    /// The weight of the ray of each bounce on the current path.
    weights: Vec<f32>,
    /// The triangle that the rays of each bounce leave.
    surfaces: Vec<Option<u32>>,
    events: Vec<Event>,
}

/// Answers as another tracer does, one ray at a time, and keeps every question and answer of **one pixel**.
///
/// For people who look into a pixel; it locks and allocates for each ray.
#[derive(Debug)]
pub struct Recorder<'a, T> {
    inner: &'a T,
    geometry: &'a Geometry,
    log: Mutex<Log>,
}

impl<'a, T: Tracer> Recorder<'a, T> {
    /// A recorder of a pixel that shows `triangle` of the scene that `inner` was built on.
    #[must_use]
    pub fn new(inner: &'a T, geometry: &'a Geometry, triangle: Option<u32>) -> Self {
        let announced = Announcement { purpose: Purpose::Shadow, bounce: 0, weight: 1.0 };
        let log = Log { announced, weights: Vec::new(), surfaces: vec![triangle], events: Vec::new() };
        Self { inner, geometry, log: Mutex::new(log) }
    }

    /// What was recorded.
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
        // Rays of light and occlusion leave the surface that was found last.
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

/// `accept`, with every question and its answer kept.
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

    fn closest(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        let mut asked = Vec::new();
        let hit = self.inner.closest(ray, listen(&mut asked, &mut accept));
        self.record(ray, hit.map_or(Outcome::Miss, Outcome::Hit), asked);
        hit
    }

    fn occluded(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> bool {
        let mut asked = Vec::new();
        let blocked = self.inner.occluded(ray, listen(&mut asked, &mut accept));
        // A second question says by what; asking `accept` again is allowed.
        let blocker = if blocked { self.inner.closest(ray, &mut accept) } else { None };
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
