//! Packets of rays: similar rays share the work of the traversal.

use super::ray::{Hit, Ray};
use glam::Vec3;

/// Rays in a packet.
pub const PACKET: usize = 16;
/// Greatest number of packets that are traced together: the packets of a tile.
pub(crate) const TOGETHER: usize = 16;

/// Up to sixteen rays as a structure of arrays. Faster than single rays where they start near each other and run in
/// similar directions, as for 4 x 4 neighbouring pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct Packet {
    /// Origins by axis, world.
    pub origin: [[f32; PACKET]; 3],
    /// Unit directions by axis.
    pub direction: [[f32; PACKET]; 3],
    /// Hits have `t > t_min`; 0 or more.
    pub t_min: f32,
    /// Hits have `t < t_max`; may be infinite.
    pub t_max: f32,
    /// The rays that are traced: one bit a ray, ray 0 in the lowest. The data of other lanes is not read.
    pub active: u16,
}

impl Packet {
    /// A packet without rays, whose interval is empty.
    pub(crate) const NONE: Self =
        Self { origin: [[0.0; PACKET]; 3], direction: [[0.0; PACKET]; 3], t_min: 0.0, t_max: 0.0, active: 0 };

    /// A packet without rays, with an interval of distances.
    #[must_use]
    pub fn new(t_min: f32, t_max: f32) -> Self {
        Self { t_min, t_max, ..Self::NONE }
    }

    /// Puts a ray into a lane.
    ///
    /// # Panics
    /// If there is no such lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, origin: Vec3, direction: Vec3) {
        for axis in 0..3 {
            self.origin[axis][lane] = origin[axis];
            self.direction[axis][lane] = direction[axis];
        }
        self.active |= 1 << lane;
    }

    /// The ray in a lane.
    ///
    /// # Panics
    /// If there is no such lane.
    #[must_use]
    #[inline(always)]
    pub fn ray(&self, lane: usize) -> Ray {
        let at = |values: &[[f32; PACKET]; 3]| Vec3::new(values[0][lane], values[1][lane], values[2][lane]);
        Ray { origin: at(&self.origin), direction: at(&self.direction), t_min: self.t_min, t_max: self.t_max }
    }

    /// The lanes that are traced.
    pub fn lanes(&self) -> impl Iterator<Item = usize> + use<> {
        let active = self.active;
        (0..PACKET).filter(move |lane| active >> lane & 1 == 1)
    }
}

/// Hits of the rays of a packet, as a structure of arrays.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct PacketHits {
    /// Distances. This and the following fields are valid only for the rays in [`Self::hit`].
    pub t: [f32; PACKET],
    /// Barycentric coordinates of corner 1.
    pub u: [f32; PACKET],
    /// Barycentric coordinates of corner 2.
    pub v: [f32; PACKET],
    /// Triangle ids.
    pub triangle: [u32; PACKET],
    /// The rays that hit something, one bit a ray.
    pub hit: u16,
}

impl PacketHits {
    /// No ray hits anything.
    pub const NONE: Self = Self { t: [0.0; PACKET], u: [0.0; PACKET], v: [0.0; PACKET], triangle: [0; PACKET], hit: 0 };

    /// The hit of the ray in a lane; `None` for a miss.
    #[must_use]
    pub fn get(&self, lane: usize) -> Option<Hit> {
        let hit = Hit { t: self.t[lane], triangle: self.triangle[lane], u: self.u[lane], v: self.v[lane] };
        (self.hit >> lane & 1 == 1).then_some(hit)
    }

    /// Stores the hit of the ray in a lane.
    pub fn set(&mut self, lane: usize, hit: &Hit) {
        self.t[lane] = hit.t;
        self.u[lane] = hit.u;
        self.v[lane] = hit.v;
        self.triangle[lane] = hit.triangle;
        self.hit |= 1 << lane;
    }
}
