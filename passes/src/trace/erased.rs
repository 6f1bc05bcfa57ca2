//! Tracers behind a trait object, so that programs are compiled once for all of them.

use super::fan::{Candidates, Neighbourhood};
use super::parallel::{Decided, Estimates};
use super::ray::{Fan, Hit, Packet, PacketHits, Ray, Recent};
use super::tracer::{Announcement, Tracer};
use glam::Vec3;

/// The queries of [`Tracer`] as a trait that can be a trait object. Every tracer implements it.
pub trait DynTracer: Sync {
    /// [`Tracer::SPHERES`].
    fn knows_spheres(&self) -> bool;

    /// [`Tracer::LISTENS`].
    fn listens(&self) -> bool;

    /// [`Tracer::closest`].
    fn closest_of(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> Option<Hit>;

    /// [`Tracer::occluded`].
    fn is_occluded(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> bool;

    /// [`Tracer::any`].
    fn any_of(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> Option<Hit>;

    /// [`Tracer::blocked_by`].
    fn find_blocked_by(&self, rays: &[Ray], recent: &mut Recent, blocks: &mut dyn FnMut(u32) -> bool) -> u64;

    /// [`Tracer::announce`].
    fn hear(&self, rays: Announcement);

    /// [`Tracer::clear_above`].
    fn is_clear_above(&self, origin: Vec3, normal: Vec3, t_max: f32) -> bool;

    /// [`Tracer::gather`].
    fn gather_near(&self, around: &Neighbourhood, candidates: &mut Candidates) -> bool;

    /// [`Tracer::count_open`].
    fn count_open_of(&self, fan: &Fan<'_>, accept: &mut dyn FnMut(&Hit) -> bool) -> u32;

    /// [`Tracer::closest_packets`].
    fn closest_of_packets(
        &self,
        packets: &[Packet],
        hits: &mut [PacketHits],
        accept: &mut dyn FnMut(usize, &Hit) -> bool,
    );

    /// [`Tracer::occluded_packets`].
    fn occluded_of_packets(&self, packets: &[Packet], blocked: &mut [u16], accept: &mut dyn FnMut(usize, &Hit) -> bool);

    /// [`Tracer::occluded_undecided`].
    fn occluded_of_undecided(
        &self,
        packets: &[Packet],
        blocked: &mut [u16],
        accept: &mut dyn FnMut(usize, &Hit) -> bool,
    );

    /// [`Tracer::decides`].
    fn decides_some(&self) -> bool;

    /// [`Tracer::decide`].
    fn decide_of(&self, estimates: &Estimates, decided: &mut Decided);
}

impl<T: Tracer> DynTracer for T {
    fn knows_spheres(&self) -> bool {
        T::SPHERES
    }

    fn listens(&self) -> bool {
        T::LISTENS
    }

    fn closest_of(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> Option<Hit> {
        self.closest(ray, accept)
    }

    fn is_occluded(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> bool {
        self.occluded(ray, accept)
    }

    fn any_of(&self, ray: &Ray, accept: &mut dyn FnMut(&Hit) -> bool) -> Option<Hit> {
        self.any(ray, accept)
    }

    fn find_blocked_by(&self, rays: &[Ray], recent: &mut Recent, blocks: &mut dyn FnMut(u32) -> bool) -> u64 {
        self.blocked_by(rays, recent, blocks)
    }

    fn hear(&self, rays: Announcement) {
        self.announce(rays);
    }

    fn is_clear_above(&self, origin: Vec3, normal: Vec3, t_max: f32) -> bool {
        self.clear_above(origin, normal, t_max)
    }

    fn gather_near(&self, around: &Neighbourhood, candidates: &mut Candidates) -> bool {
        self.gather(around, candidates)
    }

    fn count_open_of(&self, fan: &Fan<'_>, accept: &mut dyn FnMut(&Hit) -> bool) -> u32 {
        self.count_open(fan, accept)
    }

    fn closest_of_packets(
        &self,
        packets: &[Packet],
        hits: &mut [PacketHits],
        accept: &mut dyn FnMut(usize, &Hit) -> bool,
    ) {
        self.closest_packets(packets, hits, accept);
    }

    fn occluded_of_packets(
        &self,
        packets: &[Packet],
        blocked: &mut [u16],
        accept: &mut dyn FnMut(usize, &Hit) -> bool,
    ) {
        self.occluded_packets(packets, blocked, accept);
    }

    fn occluded_of_undecided(
        &self,
        packets: &[Packet],
        blocked: &mut [u16],
        accept: &mut dyn FnMut(usize, &Hit) -> bool,
    ) {
        self.occluded_undecided(packets, blocked, accept);
    }

    fn decides_some(&self) -> bool {
        self.decides()
    }

    fn decide_of(&self, estimates: &Estimates, decided: &mut Decided) {
        self.decide(estimates, decided);
    }
}

/// A [`Tracer`] that forwards to another through a trait object. `SPHERES` says whether programs are compiled with exact spheres.
#[derive(Clone, Copy)]
pub(crate) struct Erased<'a, const SPHERES: bool> {
    tracer: &'a dyn DynTracer,
    /// [`Tracer::LISTENS`] of that tracer. If it is false, an announcement costs only a comparison.
    listens: bool,
}

impl<'a, const SPHERES: bool> Erased<'a, SPHERES> {
    pub(crate) fn new(tracer: &'a dyn DynTracer) -> Self {
        Self { tracer, listens: tracer.listens() }
    }
}

impl<const SPHERES: bool> Tracer for Erased<'_, SPHERES> {
    const SPHERES: bool = SPHERES;
    const LISTENS: bool = true;

    fn closest(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        self.tracer.closest_of(ray, &mut accept)
    }

    fn occluded(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> bool {
        self.tracer.is_occluded(ray, &mut accept)
    }

    fn any(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        self.tracer.any_of(ray, &mut accept)
    }

    fn blocked_by(&self, rays: &[Ray], recent: &mut Recent, mut blocks: impl FnMut(u32) -> bool) -> u64 {
        self.tracer.find_blocked_by(rays, recent, &mut blocks)
    }

    #[inline(always)]
    fn announce(&self, rays: Announcement) {
        if self.listens {
            self.tracer.hear(rays);
        }
    }

    fn clear_above(&self, origin: Vec3, normal: Vec3, t_max: f32) -> bool {
        self.tracer.is_clear_above(origin, normal, t_max)
    }

    fn gather(&self, around: &Neighbourhood, candidates: &mut Candidates) -> bool {
        self.tracer.gather_near(around, candidates)
    }

    fn count_open(&self, fan: &Fan<'_>, mut accept: impl FnMut(&Hit) -> bool) -> u32 {
        self.tracer.count_open_of(fan, &mut accept)
    }

    fn closest_packets(
        &self,
        packets: &[Packet],
        hits: &mut [PacketHits],
        mut accept: impl FnMut(usize, &Hit) -> bool,
    ) {
        self.tracer.closest_of_packets(packets, hits, &mut accept);
    }

    fn occluded_packets(&self, packets: &[Packet], blocked: &mut [u16], mut accept: impl FnMut(usize, &Hit) -> bool) {
        self.tracer.occluded_of_packets(packets, blocked, &mut accept);
    }

    fn occluded_undecided(&self, packets: &[Packet], blocked: &mut [u16], mut accept: impl FnMut(usize, &Hit) -> bool) {
        self.tracer.occluded_of_undecided(packets, blocked, &mut accept);
    }

    fn decides(&self) -> bool {
        self.tracer.decides_some()
    }

    fn decide(&self, estimates: &Estimates, decided: &mut Decided) {
        self.tracer.decide_of(estimates, decided);
    }
}
