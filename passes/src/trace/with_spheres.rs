//! Exact spheres added to the triangles of another tracer.

use super::fan::{Candidates, Neighbourhood};
use super::ray::{Fan, Hit, PACKET, Packet, PacketHits, Ray};
use super::spheres::SphereTree;
use super::tracer::{Announcement, Tracer};
use glam::Vec3;

/// A tracer of triangles with exact spheres added. A scene without spheres uses the tracer of triangles directly.
#[derive(Debug)]
pub struct WithSpheres<'a, T> {
    /// The triangles.
    pub triangles: &'a T,
    /// The spheres of the same scene.
    pub spheres: &'a SphereTree,
}

impl<T> WithSpheres<'_, T> {
    /// Whether a ray of length `t_max` that starts in the box may meet a sphere. Errs on the side of `true`.
    fn is_near(&self, [low, high]: [Vec3; 2], t_max: f32) -> bool {
        let center = low.midpoint(high);
        // The factor and the summand are above the rounding errors of the centre and of the origins.
        self.spheres.reaches(center, (high.distance(center) + t_max) * 1.001 + center.abs().max_element() * 1e-6)
    }
}

impl<T: Tracer> Tracer for WithSpheres<'_, T> {
    const SPHERES: bool = true;
    const LISTENS: bool = T::LISTENS;

    fn closest(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        let triangle = self.triangles.closest(ray, &mut accept);
        let nearer = Ray { t_max: triangle.map_or(ray.t_max, |hit| hit.t), ..*ray };
        self.spheres.closest(&nearer, &mut accept).or(triangle)
    }

    fn occluded(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> bool {
        self.spheres.occluded(ray, &mut accept) || self.triangles.occluded(ray, &mut accept)
    }

    fn any(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        self.spheres.closest(ray, &mut accept).or_else(|| self.triangles.any(ray, &mut accept))
    }

    fn announce(&self, rays: Announcement) {
        self.triangles.announce(rays);
    }

    fn clear_above(&self, origin: Vec3, normal: Vec3, t_max: f32) -> bool {
        !self.is_near([origin; 2], t_max) && self.triangles.clear_above(origin, normal, t_max)
    }

    fn gather(&self, around: &Neighbourhood, candidates: &mut Candidates) -> bool {
        !self.is_near(around.origins, around.t_max) && self.triangles.gather(around, candidates)
    }

    fn count_open(&self, fan: &Fan<'_>, mut accept: impl FnMut(&Hit) -> bool) -> u32 {
        if !self.is_near([fan.origin; 2], fan.t_max) {
            return self.triangles.count_open(fan, accept);
        }
        fan.rays().filter(|ray| !self.occluded(ray, &mut accept)).count() as u32
    }

    fn closest_packets(
        &self,
        packets: &[Packet],
        hits: &mut [PacketHits],
        mut accept: impl FnMut(usize, &Hit) -> bool,
    ) {
        self.triangles.closest_packets(packets, hits, &mut accept);
        for (index, (packet, hits)) in packets.iter().zip(hits).enumerate() {
            for lane in packet.lanes() {
                let ray = packet.ray(lane);
                let nearer = Ray { t_max: hits.get(lane).map_or(ray.t_max, |hit| hit.t), ..ray };
                if let Some(hit) = self.spheres.closest(&nearer, &mut |hit| accept(index * PACKET + lane, hit)) {
                    hits.set(lane, &hit);
                }
            }
        }
    }

    fn occluded_packets(&self, packets: &[Packet], blocked: &mut [u16], mut accept: impl FnMut(usize, &Hit) -> bool) {
        self.triangles.occluded_packets(packets, blocked, &mut accept);
        for (index, (packet, blocked)) in packets.iter().zip(blocked).enumerate() {
            for lane in packet.lanes() {
                if *blocked >> lane & 1 == 1 {
                    continue;
                }
                let stops = self.spheres.occluded(&packet.ray(lane), &mut |hit| accept(index * PACKET + lane, hit));
                *blocked |= u16::from(stops) << lane;
            }
        }
    }
}
