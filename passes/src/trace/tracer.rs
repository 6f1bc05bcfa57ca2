//! What effects ask of a scene: the seam between programs and acceleration structures.

use super::fan::{Candidates, Neighbourhood};
use super::parallel::{Decided, Estimates};
use super::ray::{Fan, Hit, PACKET, Packet, PacketHits, Ray, Recent};
use glam::Vec3;

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
    /// What a pixel shows.
    Camera,
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
            Self::Camera => "camera",
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
    /// Whether it knows exact spheres ([`Geometry::spheres`](curitiba_pipeline::scene::Geometry::spheres)). Their hits have ids beyond those of
    /// the triangles, and no barycentric coordinates. Effects on a tracer that knows none are compiled without them.
    const SPHERES: bool = false;

    /// The nearest accepted hit; of several at the same distance, the one with the lowest triangle id.
    fn closest(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> Option<Hit>;

    /// Whether any accepted hit exists; the order of the search is free.
    fn occluded(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> bool;

    /// Which of up to 64 rays are stopped by a triangle that `blocks` takes by its id: one bit a ray, the first lowest. All triangles
    /// must be transparent. `recent` is room that is used again for rays like these.
    ///
    /// The result is that of asking [`Self::occluded`] for each ray.
    fn blocked_by(&self, rays: &[Ray], recent: &mut Recent, mut blocks: impl FnMut(u32) -> bool) -> u64 {
        let _ = recent;
        let bit = |(index, ray): (usize, &Ray)| u64::from(self.occluded(ray, |hit| blocks(hit.triangle))) << index;
        rays.iter().enumerate().map(bit).sum()
    }

    /// Told what the next rays are for. Tracers ignore it, at no cost; a [`Recorder`](super::Recorder) keeps it.
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
    /// leaves `candidates` without use: they are too many to be worth it, or the tracer does not know how.
    fn gather(&self, around: &Neighbourhood, candidates: &mut Candidates) -> bool {
        let _ = (around, candidates);
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
    /// are gathered; `candidates` is room for them.
    ///
    /// The result is that of asking [`Self::occluded`] for each ray; `accept` is told the ray's fan.
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
