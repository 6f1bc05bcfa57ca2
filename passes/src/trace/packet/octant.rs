//! The octant and main axis of a ray: rays that share both traverse the tree together.

use crate::trace::ray::Packet;
use crate::trace::simd::{Mask, NO_LANES, WIDE};

/// Octant and main axis of a direction in eight bits: the axis of the largest component (bits 0 and 1), the sign of each component (bits 2
/// to 4), and which components are zero (bits 5 to 7).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Octant(u32);

impl Octant {
    /// The octant of a packet without rays.
    pub(crate) const EMPTY: Self = Self(0);
    /// Marks rays that hit nothing; see [`PreparedRay::new`](crate::trace::tree::PreparedRay::new).
    const NONE: u32 = u32::MAX;

    /// Signs and zeros without the main axis; the rays of a group share them.
    pub(crate) fn signs(self) -> u32 {
        self.0 >> 2
    }

    /// Axis of the largest component of the direction.
    pub(crate) fn axis(self) -> usize {
        (self.0 & 3) as usize
    }

    /// Whether the component along an axis is zero.
    pub(crate) fn is_zero(self, axis: usize) -> bool {
        self.0 >> (5 + axis) & 1 == 1
    }

    /// Per axis: 1 where the rays run towards lower coordinates, else 0.
    pub(crate) fn backward(self) -> [usize; 3] {
        [2, 3, 4].map(|bit| (self.0 >> bit & 1) as usize)
    }
}

/// The octants of a packet's rays, by lane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Octants([u32; WIDE]);

impl Octants {
    pub(crate) const NONE: Self = Self([Octant::NONE; WIDE]);

    /// The octants of a packet. Rays for which [`PreparedRay::new`](crate::trace::tree::PreparedRay::new) would return `None` get
    /// `Octant::NONE`.
    #[inline(always)]
    pub(crate) fn of(packet: &Packet) -> Self {
        let mut octants = [0; WIDE];
        let interval = packet.t_min < packet.t_max && packet.t_max > 0.0;
        for lane in 0..WIDE {
            let [o, d] = [&packet.origin, &packet.direction].map(|v| [v[0][lane], v[1][lane], v[2][lane]]);
            let zero_or_nan = o[0] * 0.0 + d[0] * 0.0 + (o[1] * 0.0 + d[1] * 0.0) + (o[2] * 0.0 + d[2] * 0.0);
            let length = d.map(f32::abs);
            // A component whose reciprocal would overflow counts as zero.
            let zero = length.map(|length| u32::from(length < f32::MIN_POSITIVE));
            let negative = d.map(|d| d.to_bits() >> 31);
            let longest = length[0].max(length[1]).max(length[2]);
            let axis = if length[0] == longest {
                0
            } else if length[1] == longest {
                1
            } else {
                2
            };
            let octant = axis | negative[0] << 2 | negative[1] << 3 | negative[2] << 4;
            let octant = octant | zero[0] << 5 | zero[1] << 6 | zero[2] << 7;
            let valid = zero_or_nan == 0.0 && longest >= f32::MIN_POSITIVE;
            octants[lane] = if valid { octant } else { Octant::NONE };
        }
        if interval { Self(octants) } else { Self::NONE }
    }

    /// The lanes whose rays can hit something.
    #[inline(always)]
    pub(crate) fn valid(&self) -> Mask {
        let mut lanes = NO_LANES;
        for (lane, octant) in self.0.iter().enumerate() {
            lanes |= Mask::from(*octant != Octant::NONE) << lane;
        }
        lanes
    }

    /// The octant of a lane, which must be one of [`Self::valid`].
    #[inline(always)]
    pub(crate) fn get(&self, lane: usize) -> Octant {
        Octant(self.0[lane])
    }

    /// The lanes whose rays have this octant.
    #[inline(always)]
    pub(crate) fn lanes(&self, octant: Octant) -> Mask {
        let mut lanes = NO_LANES;
        for (lane, other) in self.0.iter().enumerate() {
            lanes |= Mask::from(*other == octant.0) << lane;
        }
        lanes
    }
}
