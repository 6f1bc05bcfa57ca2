//! The interface between effects and acceleration structures: the ray queries that effects make of a scene.

use super::fan::{Candidates, Neighbourhood};
use super::parallel::{Decided, Estimates};
use super::ray::{Fan, Hit, PACKET, Packet, PacketHits, Ray, Recent};
use glam::Vec3;

/// The purpose of a ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Shadow ray: does light arrive?
    Shadow,
    /// Ambient occlusion ray: is something near?
    Occlusion,
    /// Reflected ray: what does a surface mirror?
    Reflected,
    /// Refracted ray: what is seen through a surface?
    Refracted,
    /// Camera ray: what does a pixel show?
    Camera,
}

impl Purpose {
    /// The name as it is printed.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Shadow => "shadow",
            Self::Occlusion => "occlusion",
            Self::Reflected => "reflected",
            Self::Refracted => "refracted",
            Self::Camera => "camera",
        }
    }
}

/// Description of the rays that a program is about to trace.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Announcement {
    /// Purpose of the rays.
    pub purpose: Purpose,
    /// Number of glass surfaces on the path before these rays; only for reflected and refracted rays.
    pub bounce: u32,
    /// Factor of the ray's result in the colour of the surface that the ray leaves.
    pub weight: f32,
}

/// The ray queries that effects make.
///
/// Each query takes a closure that accepts or rejects a candidate hit. Effects use it for alpha-cut textures, and for glass that shadow
/// rays pass. The closure is called for triangles of **transparent materials only** (the set of transparent materials is given when the
/// tracer is built). The order of the calls is not specified; a candidate may come more than once or not at all. Hits on other triangles
/// are accepted without a call.
pub trait Tracer: Sync {
    /// Whether the tracer supports exact spheres ([`Geometry::spheres`](curitiba_pipeline::scene::Geometry::spheres)). Hits on spheres have
    /// ids beyond those of the triangles, and no barycentric coordinates. For a tracer without spheres, effects are compiled without them.
    const SPHERES: bool = false;

    /// The nearest accepted hit; of several at the same distance, the one with the lowest triangle id.
    fn closest(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> Option<Hit>;

    /// Whether any accepted hit exists other than on the sky ([`Geometry::sky`](curitiba_pipeline::scene::Geometry::sky)). Any such hit may
    /// end the search.
    fn occluded(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> bool;

    /// An accepted hit that is not on the sky; `None` where [`Self::occluded`] is false. Of several hits the tracer may choose any, but
    /// always the same. The default is [`Self::closest`], which is valid only for scenes without a sky.
    fn any(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        self.closest(ray, accept)
    }

    /// Which of up to 64 rays are stopped by a triangle whose id `blocks` accepts: one bit a ray, the first ray in the lowest bit. All
    /// triangles must be transparent. `recent` is a cache that successive calls with similar rays share.
    ///
    /// The result is the same as calling [`Self::occluded`] for each ray.
    fn blocked_by(&self, rays: &[Ray], recent: &mut Recent, mut blocks: impl FnMut(u32) -> bool) -> u64 {
        let _ = recent;
        let bit = |(index, ray): (usize, &Ray)| u64::from(self.occluded(ray, |hit| blocks(hit.triangle))) << index;
        rays.iter().enumerate().map(bit).sum()
    }

    /// Whether [`Self::announce`] does anything; if not, calls may be left out.
    const LISTENS: bool = false;

    /// Announces the purpose of the rays that follow. Most tracers ignore it, at no cost; a [`Recorder`](super::Recorder) keeps it.
    #[inline(always)]
    fn announce(&self, rays: Announcement) {
        let _ = rays;
    }

    /// Whether it is certain that no ray from `origin` into the half space of `normal` (a unit vector) meets a triangle within `t_max`.
    /// `false` means "not known": a tracer may always return it.
    fn clear_above(&self, origin: Vec3, normal: Vec3, t_max: f32) -> bool {
        let _ = (origin, normal, t_max);
        false
    }

    /// Collects the triangles that rays of a neighbourhood may meet, so that many rays can be tested against them. `false` means that
    /// `candidates` must not be used: there are too many triangles to be worth it, or the tracer does not support it.
    fn gather(&self, around: &Neighbourhood, candidates: &mut Candidates) -> bool {
        let _ = (around, candidates);
        false
    }

    /// The number of rays of a fan that are not blocked.
    ///
    /// The result is the same as calling [`Self::occluded`] for each ray.
    fn count_open(&self, fan: &Fan<'_>, accept: impl FnMut(&Hit) -> bool) -> u32 {
        let mut accept = accept;
        fan.rays().filter(|ray| !self.occluded(ray, &mut accept)).count() as u32
    }

    /// For each fan, the number of its rays that are not blocked. Consecutive fans share one list of candidate triangles where few
    /// triangles are near them; `candidates` is the buffer for that list.
    ///
    /// The result is the same as calling [`Self::occluded`] for each ray. `accept` also receives the index of the ray's fan.
    ///
    /// # Panics
    /// If `open` is not as long as `fans`.
    fn count_open_near(
        &self,
        fans: &[Fan<'_>],
        open: &mut [u32],
        candidates: &mut Candidates,
        mut accept: impl FnMut(usize, &Hit) -> bool,
    ) {
        assert_eq!(fans.len(), open.len(), "one count for each fan");
        let runs = fans.chunks(Neighbourhood::FANS).zip(open.chunks_mut(Neighbourhood::FANS));
        for (number, (fans, open)) in runs.enumerate() {
            let gathered = Neighbourhood::of(fans).is_some_and(|around| self.gather(&around, candidates));
            for (index, (fan, open)) in fans.iter().zip(open).enumerate() {
                let mut accept = |hit: &Hit| accept(number * Neighbourhood::FANS + index, hit);
                let count = if gathered { candidates.count_open_of_fan(fan, &mut accept) } else { None };
                *open = count.unwrap_or_else(|| self.count_open(fan, accept));
            }
        }
    }

    /// The nearest accepted hits of the rays of packets, for example of neighbouring pixels.
    ///
    /// The result is the same as calling [`Self::closest`] for each ray. `accept` also receives the ray's number: 16 times the index of its
    /// packet, plus its lane.
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

    /// Whether [`Self::decide`] ever decides a ray.
    fn decides(&self) -> bool {
        false
    }

    /// Decides, for rays whose origins are known only within an error bound, whether they are blocked, where that is certain for all
    /// origins within the bound. Only the undecided rays then need to be traced. A tracer may always decide none.
    fn decide(&self, estimates: &Estimates, decided: &mut Decided) {
        let _ = estimates;
        decided.clear();
    }

    /// Which rays of packets are blocked, one bit a ray.
    ///
    /// The result is the same as calling [`Self::occluded`] for each ray; `accept` as in [`Self::closest_packets`].
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

    /// As [`Self::occluded_packets`], for rays that [`Self::decide`] left undecided: the methods of [`Self::decide`] are not tried again.
    ///
    /// # Panics
    /// As [`Self::occluded_packets`].
    fn occluded_undecided(&self, packets: &[Packet], blocked: &mut [u16], accept: impl FnMut(usize, &Hit) -> bool) {
        self.occluded_packets(packets, blocked, accept);
    }
}
