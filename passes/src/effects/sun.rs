//! Soft shadows: a directional light is a disc in the sky, sampled by one ray to each of its sample points.
//!
//! The light's share is the mean over directions that are uniform over the disc's solid angle. Each direction counts as
//! a point light would: a side of a triangle facing away from it is dark without a ray, except where the triangle
//! approximates a round surface that faces it (`terminator`). The cosine of the light stays that of the disc's centre,
//! by which colours were lit. For a disc above the horizon of its surface, the mean of the cosines is this cosine times
//! (1 + cos a) / 2, where a is the disc's half angle. For the sun of the sky this factor is 1 - 5e-6.

use super::coverage::Coverage;
use super::light::shares_of_light;
use super::pass::Pass;
use crate::sampling::cone::ConeSampler;
use crate::trace::{Hit, PACKET, Packet, Purpose, SurfacePoint, Tracer};
use glam::Vec3;

/// Packets that are traced in one call.
const TOGETHER: usize = 16;

/// A side of a surface that light may fall on.
#[derive(Debug, Clone, Copy)]
pub(super) struct LitSide<'p> {
    pub(super) point: &'p SurfacePoint,
    /// Unit normal of the side.
    pub(super) facing: Vec3,
    pub(super) triangle: u32,
}

/// A light's disc as seen from a side of a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Disc<'p> {
    pub(super) sampler: &'p ConeSampler,
    /// Unit vector to its centre.
    pub(super) center: Vec3,
    /// Scrambles the points of the disc.
    pub(super) key: u32,
    pub(super) side: LitSide<'p>,
}

impl Disc<'_> {
    /// The share of the light that comes from each sample point of the disc.
    pub(super) fn weight(&self) -> f32 {
        1.0 / self.sampler.samples() as f32
    }
}

/// Buffers for rays to the disc.
#[derive(Debug, Default)]
pub(super) struct DiscRays {
    packets: Vec<Packet>,
    rays: usize,
    blocked: Vec<u16>,
    /// Glass surfaces that rays cross: index of the ray, and distance.
    crossings: Vec<(u32, f32)>,
    distances: Vec<f32>,
}

impl DiscRays {
    fn push(&mut self, origin: Vec3, direction: Vec3) {
        let (index, lane) = (self.rays / PACKET, self.rays % PACKET);
        if index == self.packets.len() {
            self.packets.push(Packet::new(0.0, f32::INFINITY));
        }
        if lane == 0 {
            self.packets[index].active = 0;
        }
        self.packets[index].set(lane, origin, direction);
        self.rays += 1;
    }

    /// Traces the rays, and returns the sum of their light shares; the share of a blocked ray is `hidden`. `stops` gets each hit with the index of
    /// its ray.
    fn trace<T: Tracer>(
        &mut self,
        tracer: &T,
        hidden: f32,
        stops: &mut impl FnMut(u32, &Hit, &mut Vec<(u32, f32)>) -> bool,
    ) -> f64 {
        let Self { packets, rays, blocked, crossings, distances } = self;
        let packets = &packets[..rays.div_ceil(PACKET)];
        blocked.clear();
        blocked.resize(packets.len(), 0);
        crossings.clear();
        tracer.occluded_packets(packets, blocked, |ray, hit| stops(ray as u32, hit, crossings));
        let mut sum = 0.0;
        shares_of_light(hidden, *rays, blocked, crossings, distances, |_, share| sum += f64::from(share));
        *rays = 0;
        sum
    }
}

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    /// The disc of a pass's only light as seen from a side of a surface; `None` where the light is a point.
    pub(super) fn disc_of_sun<'p>(&'p self, key: u32, side: LitSide<'p>) -> Option<Disc<'p>> {
        self.disc.as_ref().map(|sampler| Disc { sampler, center: self.to_light, key, side })
    }

    /// Calls `each` with the origin and the direction of every ray to the disc's points.
    /// Directions from which the side is dark get no ray. Where the triangle approximates a round surface, one further ray,
    /// counted in `rays`, tests whether a hit that `stops` accepts lies between the point and the lifted point.
    pub(super) fn to_disc(
        &self,
        disc: &Disc<'_>,
        rays: &mut u64,
        stops: impl Fn(&Hit) -> bool,
        mut each: impl FnMut(Vec3, Vec3),
    ) {
        let (side, mut is_cut_off) = (disc.side, None);
        let horizon = self.horizon(side.triangle, side.point, side.facing);
        for direction in disc.sampler.directions(disc.center, disc.key) {
            if horizon.dot(direction) <= 0.0 {
                continue;
            }
            if side.facing.dot(direction) > 0.0 {
                each(side.point.spawn(direction), direction);
            } else if let Some(lifted) = self.lifted(side.triangle, side.point, (side.facing, direction))
                && !*is_cut_off.get_or_insert_with(|| self.is_cut_off(&lifted, rays, &stops))
            {
                each(lifted.origin(), direction);
            }
        }
    }

    /// The light's share at a side of a surface: the mean over the disc, whose hidden parts count as `hidden`. `stops` gets each hit with the index
    /// of its ray, and notes the glass surfaces that the ray crosses; `cuts_off` is the `stops` of [`Self::to_disc`].
    pub(super) fn disc_share(
        &self,
        (disc, hidden): (&Disc<'_>, f32),
        (buffers, rays): (&mut DiscRays, &mut u64),
        cuts_off: impl Fn(&Hit) -> bool,
        mut stops: impl FnMut(u32, &Hit, &mut Vec<(u32, f32)>) -> bool,
    ) -> f32 {
        let samples = disc.sampler.samples();
        let (mut traced, mut sum) = (0, 0.0);
        buffers.rays = 0;
        self.to_disc(disc, rays, cuts_off, |origin, direction| {
            buffers.push(origin, direction);
            traced += 1;
            if buffers.rays == TOGETHER * PACKET {
                self.announce_visibility(Purpose::Shadow, disc.weight());
                sum += buffers.trace(self.tracer, hidden, &mut stops);
            }
        });
        self.announce_visibility(Purpose::Shadow, disc.weight());
        sum += buffers.trace(self.tracer, hidden, &mut stops);
        *rays += traced;
        let dark = f64::from(samples) - traced as f64;
        ((sum + f64::from(hidden) * dark) / f64::from(samples)) as f32
    }
}
