//! What rays must have in common to go down the tree together.

use super::lanes::{Mask, NO_LANES, WIDE};
use super::packet::Packet;

/// What rays must have in common: the axis along which the direction is longest (bits 0 and 1), the sign of each
/// component (2 to 4), and which components are zero (5 to 7).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Class(u32);

impl Class {
    /// Of a beam without rays.
    pub(super) const EMPTY: Self = Self(0);
    /// Of rays that meet nothing, see [`Query::new`](super::query::Query::new).
    const NONE: u32 = u32::MAX;

    /// Signs and zeros: what rays of one traversal have in common.
    pub(super) fn octant(self) -> u32 {
        self.0 >> 2
    }

    /// The axis along which the direction is longest.
    pub(super) fn axis(self) -> usize {
        (self.0 & 3) as usize
    }

    /// Whether the component along an axis is zero.
    pub(super) fn is_zero(self, axis: usize) -> bool {
        self.0 >> (5 + axis) & 1 == 1
    }

    /// Per axis: 1 where rays run towards lower coordinates, else 0.
    pub(super) fn backward(self) -> [usize; 3] {
        [2, 3, 4].map(|bit| (self.0 >> bit & 1) as usize)
    }
}

/// The classes of a packet's rays.
#[derive(Debug, Clone, Copy)]
pub(super) struct Classes([u32; WIDE]);

impl Classes {
    pub(super) const NONE: Self = Self([Class::NONE; WIDE]);

    /// Rays that [`Query::new`](super::query::Query::new) would refuse have none.
    #[inline(always)]
    pub(super) fn of(packet: &Packet) -> Self {
        let mut classes = [0; WIDE];
        let interval = packet.t_min < packet.t_max && packet.t_max > 0.0;
        for lane in 0..WIDE {
            let [o, d] = [&packet.origin, &packet.direction].map(|v| [v[0][lane], v[1][lane], v[2][lane]]);
            let zero_or_nan = o[0] * 0.0 + d[0] * 0.0 + (o[1] * 0.0 + d[1] * 0.0) + (o[2] * 0.0 + d[2] * 0.0);
            let length = d.map(f32::abs);
            // Components whose reciprocal would overflow count as zero.
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
            let class = axis | negative[0] << 2 | negative[1] << 3 | negative[2] << 4;
            let class = class | zero[0] << 5 | zero[1] << 6 | zero[2] << 7;
            let valid = zero_or_nan == 0.0 && longest >= f32::MIN_POSITIVE;
            classes[lane] = if valid { class } else { Class::NONE };
        }
        if interval { Self(classes) } else { Self::NONE }
    }

    /// The lanes that have a class.
    #[inline(always)]
    pub(super) fn valid(&self) -> Mask {
        let mut lanes = NO_LANES;
        for (lane, class) in self.0.iter().enumerate() {
            lanes |= Mask::from(*class != Class::NONE) << lane;
        }
        lanes
    }

    /// The class of a lane that has one.
    #[inline(always)]
    pub(super) fn get(&self, lane: usize) -> Class {
        Class(self.0[lane])
    }

    /// The lanes of a class.
    #[inline(always)]
    pub(super) fn lanes(&self, class: Class) -> Mask {
        let mut lanes = NO_LANES;
        for (lane, other) in self.0.iter().enumerate() {
            lanes |= Mask::from(*other == class.0) << lane;
        }
        lanes
    }
}
