//! The tracer seam, and the tracers of the processor: effects see rays, hits and [`Tracer`], and nothing of the
//! acceleration structure.
//!
//! * [`Bvh`] is the fast one: watertight (Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1),
//!   2013), with conservative box tests.
//! * [`BruteForce`] is the reference that tests compare with.
//! * [`Double`] gives the same answers as it, fast enough for reference pictures.
//! * [`Recorder`] keeps every ray of a pixel, for people to read.
//! * [`SurfacePoint`] starts secondary rays so that they do not hit the surface they leave.

mod beam;
mod binary;
mod block;
mod brute;
mod build;
mod bundle;
mod bvh;
mod class;
mod clear;
mod collapse;
mod descent;
pub mod device;
mod directions;
mod dispatch;
mod double;
mod emit;
mod estimate;
mod extremes;
mod face;
mod facet;
mod fan;
mod lanes;
mod nearby;
mod node;
mod offset;
mod outline;
mod packet;
mod parallel;
mod query;
mod record;
mod snap;
mod stack;
mod triangles;
mod wave;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use brute::BruteForce;
pub use bvh::{Bvh, Quality};
pub use directions::Directions;
pub use dispatch::Lanes;
pub(crate) use dispatch::{Detected, Work};
pub use double::Double;
pub(crate) use estimate::Faces;
pub use estimate::{Decided, Estimates};
pub(crate) use lanes::{F16, LANES, Mask, Simd, higher, lower, vector_at};
pub use nearby::{Nearby, Neighbourhood};
pub use offset::SurfacePoint;
pub use packet::{PACKET, Packet, PacketHits};
pub use record::{Event, Outcome, RecordedRay, Recorder};
pub(crate) use snap::{Points, at_vertices, half_of, vertices};

use glam::Vec3;

/// A ray and the open interval of distances in which it meets surfaces.
///
/// The interval is open on both sides: a surface exactly at `t_min` or at `t_max` is not hit. In particular a ray whose
/// origin lies exactly on a triangle does not hit it at distance 0. Rays with a component that is not finite, without a
/// direction, or with an empty interval miss everything.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Origin, world.
    pub origin: Vec3,
    /// Direction, unit length; distances are multiples of it.
    pub direction: Vec3,
    /// Hits have `t > t_min`; 0 or more.
    pub t_min: f32,
    /// Hits have `t < t_max`; may be infinite.
    pub t_max: f32,
}

/// Where a ray meets a triangle. Both sides of a triangle are hit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance along the ray.
    pub t: f32,
    /// Triangle id, as in [`Geometry::triangles`](curitiba_pipeline::scene::Geometry::triangles).
    pub triangle: u32,
    /// Barycentric coordinate of corner 1.
    pub u: f32,
    /// Barycentric coordinate of corner 2.
    pub v: f32,
}

/// What a ray is traced for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Whether light arrives.
    Shadow,
    /// Whether something is near.
    Occlusion,
    /// What a surface mirrors.
    Reflected,
    /// What is seen through a surface.
    Refracted,
}

impl Purpose {
    /// As it is printed.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Shadow => "shadow",
            Self::Occlusion => "occlusion",
            Self::Reflected => "reflected",
            Self::Refracted => "refracted",
        }
    }
}

/// What a program says of the rays that it is about to trace.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Announcement {
    /// What for.
    pub purpose: Purpose,
    /// Glass surfaces met before; only for reflected and refracted rays.
    pub bounce: u32,
    /// What the ray's result is multiplied by in the colour of the surface that it leaves.
    pub weight: f32,
}

/// What effects ask of a scene.
///
/// Each query takes a closure that says whether there really is a surface at a candidate hit: it is how alpha-cut
/// textures and glass that shadow rays pass work. It is shown candidates **on triangles of transparent materials only**
/// (what is transparent is said when the tracer is built), in no particular order, some perhaps more than once and not
/// all of them; hits on other triangles are accepted without asking.
pub trait Tracer: Sync {
    /// The nearest accepted hit; of several at the same distance, the one with the lowest triangle id.
    fn closest(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> Option<Hit>;

    /// Whether any accepted hit exists; the order of the search is free.
    fn occluded(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> bool;

    /// Told what the next rays are for. Tracers ignore it, at no cost; a [`Recorder`] keeps it.
    #[inline(always)]
    fn announce(&self, rays: Announcement) {
        let _ = rays;
    }

    /// Whether it is certain that no ray from `origin` into the half space of `normal` (a unit vector) meets a triangle
    /// within `t_max`. False says nothing: a tracer may always answer so.
    fn clear_above(&self, origin: Vec3, normal: Vec3, t_max: f32) -> bool {
        let _ = (origin, normal, t_max);
        false
    }

    /// Collects the triangles that the rays of a neighbourhood may meet, to be asked many times. False says nothing, and
    /// leaves `nearby` without use: they are too many to be worth it, or the tracer does not know how.
    fn gather(&self, around: &Neighbourhood, nearby: &mut Nearby) -> bool {
        let _ = (around, nearby);
        false
    }

    /// How many rays of a fan are not blocked.
    ///
    /// The result is that of asking [`Self::occluded`] for each of them.
    fn count_open(&self, fan: &Fan<'_>, accept: impl FnMut(&Hit) -> bool) -> u32 {
        let mut accept = accept;
        fan.rays().filter(|ray| !self.occluded(ray, &mut accept)).count() as u32
    }

    /// How many rays of each of some fans are not blocked. Where the triangles near some that follow each other are few, they
    /// are gathered; `nearby` is room for them.
    ///
    /// The result is that of asking [`Self::occluded`] for each ray; `accept` is told the ray's fan.
    ///
    /// # Panics
    /// If `open` is not as long as `fans`.
    fn count_open_near(
        &self,
        fans: &[Fan<'_>],
        open: &mut [u32],
        nearby: &mut Nearby,
        mut accept: impl FnMut(usize, &Hit) -> bool,
    ) {
        assert_eq!(fans.len(), open.len(), "one count for each fan");
        let runs = fans.chunks(Neighbourhood::FANS).zip(open.chunks_mut(Neighbourhood::FANS));
        for (number, (fans, open)) in runs.enumerate() {
            let gathered = Neighbourhood::of(fans).is_some_and(|around| self.gather(&around, nearby));
            for (index, (fan, open)) in fans.iter().zip(open).enumerate() {
                let mut accept = |hit: &Hit| accept(number * Neighbourhood::FANS + index, hit);
                let count = if gathered { nearby.count_open_of_fan(fan, &mut accept) } else { None };
                *open = count.unwrap_or_else(|| self.count_open(fan, accept));
            }
        }
    }

    /// The nearest accepted hits of the rays of some packets, those of neighbouring pixels for example.
    ///
    /// The result is that of asking [`Self::closest`] for each ray. `accept` is told the ray as 16 times its packet plus
    /// its lane.
    ///
    /// # Panics
    /// If `hits` is not as long as `packets`.
    fn closest_packets(
        &self,
        packets: &[Packet],
        hits: &mut [PacketHits],
        mut accept: impl FnMut(usize, &Hit) -> bool,
    ) {
        assert_eq!(packets.len(), hits.len(), "one result for each packet");
        for (index, (packet, hits)) in packets.iter().zip(hits).enumerate() {
            *hits = PacketHits::NONE;
            for lane in packet.lanes() {
                if let Some(hit) = self.closest(&packet.ray(lane), |hit| accept(index * PACKET + lane, hit)) {
                    hits.set(lane, &hit);
                }
            }
        }
    }

    /// Whether [`Self::decide`] is of use.
    const DECIDES: bool = false;

    /// What is certain of rays of which only estimates are known, so that the others alone need to be traced. Nothing: a
    /// tracer may always answer so.
    fn decide(&self, estimates: &Estimates, decided: &mut Decided) {
        let _ = estimates;
        decided.clear();
    }

    /// Which rays of some packets meet anything, one bit a ray.
    ///
    /// The result is that of asking [`Self::occluded`] for each ray; `accept` as in [`Self::closest_packets`].
    ///
    /// # Panics
    /// If `blocked` is not as long as `packets`.
    fn occluded_packets(&self, packets: &[Packet], blocked: &mut [u16], mut accept: impl FnMut(usize, &Hit) -> bool) {
        assert_eq!(packets.len(), blocked.len(), "one result for each packet");
        for (index, (packet, blocked)) in packets.iter().zip(blocked).enumerate() {
            *blocked = 0;
            for lane in packet.lanes() {
                let stopped = self.occluded(&packet.ray(lane), |hit| accept(index * PACKET + lane, hit));
                *blocked |= u16::from(stopped) << lane;
            }
        }
    }

    /// The same of rays of which [`Self::decide`] said nothing: what did not help there need not be tried again.
    ///
    /// # Panics
    /// As [`Self::occluded_packets`].
    fn occluded_undecided(&self, packets: &[Packet], blocked: &mut [u16], accept: impl FnMut(usize, &Hit) -> bool) {
        self.occluded_packets(packets, blocked, accept);
    }
}

/// Many rays from one origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fan<'a> {
    /// Origin, world.
    pub origin: Vec3,
    /// A unit vector that no direction looks against, where there is one: `direction · above >= 0`, but for rounding. What
    /// lies wholly below the origin's plane is then met by no ray.
    pub above: Option<Vec3>,
    /// Hits have `t > t_min`; 0 or more.
    pub t_min: f32,
    /// Hits have `t < t_max`; may be infinite.
    pub t_max: f32,
    /// Unit directions.
    pub directions: &'a [Vec3],
}

impl Fan<'_> {
    /// The rays one by one.
    pub fn rays(&self) -> impl Iterator<Item = Ray> + '_ {
        let Self { origin, t_min, t_max, .. } = *self;
        self.directions.iter().map(move |&direction| Ray { origin, direction, t_min, t_max })
    }
}
