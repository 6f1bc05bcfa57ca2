//! Up to sixteen rays with one main axis and one octant, prepared as [`PreparedRay`] prepares a single ray.

#![allow(clippy::needless_range_loop, reason = "an axis indexes several arrays side by side")]

use super::interval::Interval;
use super::octant::Octant;
use crate::trace::ray::{Hit, Packet, PacketHits};
use crate::trace::rounding::{
    DOUBT, FAR, LARGEST_REACH, LONGEST_DIRECTION, SLAB_ERROR, SLAB_ORIGIN_ERROR, UNIT_ROUNDOFF,
};
use crate::trace::simd::{F8, F16, Mask, NO_LANES, Simd, WIDE};
use crate::trace::single::{QueuedRays, blocked};
use crate::trace::tree::{Bounds, Leaf, Line, Node, PreparedRay, permutation};

/// Rays of one packet and one octant. The data of lanes that are not in `open` has no meaning.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PreparedPacket {
    /// The rays that are still traced. Occlusion queries remove a ray when it is blocked.
    pub(crate) open: Mask,
    pub(crate) octant: Octant,
    pub(super) axes: [usize; 3],
    pub(super) t_min: f32,
    pub(super) t_max: f32,
    pub(super) origin: [F16; 3],
    pub(super) direction: [F16; 3],
    pub(super) shear: [F16; 2],
    pub(super) near_origin: [F16; 3],
    pub(super) far_origin: [F16; 3],
    pub(super) inverse: [F16; 3],
    pub(super) far_inverse: [F16; 3],
    /// Distance of each ray's nearest hit so far; `t_max` before there is one.
    pub(super) limit: F16,
    /// Barycentric coordinates of the nearest hits; valid for the lanes of `hit`.
    pub(super) u: F16,
    pub(super) v: F16,
    /// The triangle ids of the nearest hits, as bits. 0 where there is no hit: no id is lower, so a candidate at exactly `t_max` is not
    /// taken.
    pub(super) triangle: F16,
    pub(super) hit: Mask,
    /// For [`TrianglePlane::decide`](super::plane_test::TrianglePlane::decide): the error bound of `p`, and `1 / t_max`.
    pub(super) doubt: F16,
    pub(super) shortness: f32,
}

impl PreparedPacket {
    pub(crate) const EMPTY: Self = Self {
        open: NO_LANES,
        octant: Octant::EMPTY,
        axes: [0; 3],
        t_min: 0.0,
        t_max: 0.0,
        origin: [F16::ZERO; 3],
        direction: [F16::ZERO; 3],
        shear: [F16::ZERO; 2],
        near_origin: [F16::ZERO; 3],
        far_origin: [F16::ZERO; 3],
        inverse: [F16::ZERO; 3],
        far_inverse: [F16::ZERO; 3],
        limit: F16::ZERO,
        u: F16::ZERO,
        v: F16::ZERO,
        triangle: F16::ZERO,
        hit: NO_LANES,
        doubt: F16::ZERO,
        shortness: 0.0,
    };

    /// Prepares the rays of some lanes, all of one octant. The operations are those of [`PreparedRay::new`].
    #[inline(always)]
    pub(crate) fn prepare<S: Simd>(
        &mut self,
        simd: S,
        packet: &Packet,
        (lanes, octant): (Mask, Octant),
        scene: &Bounds,
    ) {
        let zero = simd.wide_splat(0.0);
        let axes = permutation(octant.axis());
        self.open = lanes;
        self.octant = octant;
        self.axes = axes;
        self.t_min = packet.t_min.max(0.0) + 0.0;
        self.t_max = packet.t_max;
        let mut direction = [zero; 3];
        let mut inverse = [zero; 3];
        let mut reach = [zero; 3];
        let mut origin = [zero; 3];
        for axis in 0..3 {
            origin[axis] = simd.wide_load(&F16(packet.origin[axis]));
            let d = simd.wide_load(&F16(packet.direction[axis]));
            // In one octant this component is zero for all rays or for none. The product keeps the sign.
            direction[axis] = if octant.is_zero(axis) { simd.wide_mul(d, zero) } else { d };
            inverse[axis] = simd.wide_div(simd.wide_splat(1.0), direction[axis]);
            let low = simd.wide_abs(simd.wide_sub(simd.wide_splat(scene.low[axis]), origin[axis]));
            let high = simd.wide_abs(simd.wide_sub(simd.wide_splat(scene.high[axis]), origin[axis]));
            reach[axis] = simd.wide_min_or(simd.wide_max_or(low, high), simd.wide_splat(LARGEST_REACH));
        }
        let [x, y, z] = axes;
        self.shear = [
            simd.wide_store(simd.wide_div(direction[x], direction[z])),
            simd.wide_store(simd.wide_div(direction[y], direction[z])),
        ];
        let backward = octant.backward();
        for axis in 0..3 {
            let span = simd.wide_mul(simd.wide_add(reach[axis], reach[z]), simd.wide_splat(SLAB_ERROR));
            let own = simd.wide_mul(simd.wide_abs(origin[axis]), simd.wide_splat(SLAB_ORIGIN_ERROR));
            let pad = simd.wide_add(span, own);
            let (less, more) = (simd.wide_sub(origin[axis], pad), simd.wide_add(origin[axis], pad));
            let (near, far) = if backward[axis] == 0 { (more, less) } else { (less, more) };
            self.near_origin[axis] = simd.wide_store(near);
            self.far_origin[axis] = simd.wide_store(far);
            self.origin[axis] = simd.wide_store(origin[axis]);
            self.direction[axis] = simd.wide_store(direction[axis]);
            self.inverse[axis] = simd.wide_store(inverse[axis]);
            self.far_inverse[axis] = simd.wide_store(simd.wide_mul(inverse[axis], simd.wide_splat(FAR)));
        }
        let mut longest = zero;
        let mut all = simd.wide_splat(f32::MIN_POSITIVE / UNIT_ROUNDOFF);
        for axis in 0..3 {
            longest = simd.wide_max_or(simd.wide_abs(direction[axis]), longest);
            all = simd.wide_add(all, reach[axis]);
        }
        let doubt = simd.wide_add(
            simd.wide_mul(all, simd.wide_splat(DOUBT * UNIT_ROUNDOFF)),
            simd.wide_splat(self.t_min * (DOUBT * UNIT_ROUNDOFF)),
        );
        // The error bounds of `p` and `q` hold for unit directions only.
        let unit = simd.wide_at_most(longest, simd.wide_splat(LONGEST_DIRECTION));
        self.doubt = simd.wide_store(simd.wide_select(unit, doubt, simd.wide_splat(f32::INFINITY)));
        self.shortness = 1.0 / packet.t_max;
        self.limit = F16([packet.t_max; WIDE]);
        self.triangle = F16::ZERO;
        self.hit = NO_LANES;
    }

    /// The rays that enter the box in a lane of a node before their limit, as by [`PreparedRay::slabs`] for each ray.
    #[inline(always)]
    pub(crate) fn entering<S: Simd>(&self, simd: S, planes: &[[F8; 3]; 2], lane: usize) -> Mask {
        let mut enter = simd.wide_splat(self.t_min);
        let mut leave = simd.wide_load(&self.limit);
        let backward = self.octant.backward();
        for axis in 0..3 {
            let side = backward[axis] & 1;
            let (inverse, far_inverse) = (simd.wide_load(&self.inverse[axis]), simd.wide_load(&self.far_inverse[axis]));
            let near =
                simd.wide_sub(simd.wide_splat(planes[side][axis].0[lane]), simd.wide_load(&self.near_origin[axis]));
            let far =
                simd.wide_sub(simd.wide_splat(planes[1 - side][axis].0[lane]), simd.wide_load(&self.far_origin[axis]));
            enter = simd.wide_max_or(simd.wide_mul(near, inverse), enter);
            leave = simd.wide_min_or(simd.wide_mul(far, far_inverse), leave);
        }
        simd.wide_at_most(enter, leave)
    }

    /// The interval of the slab-test operands of the open rays.
    #[inline(always)]
    pub(crate) fn interval<S: Simd>(&self, simd: S) -> Interval {
        let backward = self.octant.backward();
        let mut interval = Interval {
            near_origin: [0.0; 3],
            far_origin: [0.0; 3],
            inverse: [[0.0; 3]; 2],
            far_inverse: [[0.0; 3]; 2],
            backward,
            t_min: self.t_min,
            t_max: self.t_max,
        };
        for axis in 0..3 {
            let near = self.range(simd, &self.near_origin[axis]);
            let far = self.range(simd, &self.far_origin[axis]);
            let inverse = self.range(simd, &self.inverse[axis]);
            let (near, far) = if backward[axis] == 0 { (near.1, far.0) } else { (near.0, far.1) };
            interval.near_origin[axis] = near;
            interval.far_origin[axis] = far;
            interval.inverse[0][axis] = inverse.0;
            interval.inverse[1][axis] = inverse.1;
            interval.far_inverse[0][axis] = inverse.0 * FAR;
            interval.far_inverse[1][axis] = inverse.1 * FAR;
        }
        interval
    }

    /// The rays whose nearest hit so far is at `enter` or beyond: in a box entered at that distance they may find a hit as near, or nearer.
    #[inline(always)]
    pub(crate) fn reaching<S: Simd>(&self, simd: S, enter: f32) -> Mask {
        simd.wide_at_most(simd.wide_splat(enter), simd.wide_load(&self.limit))
    }

    /// The greatest limit of the open rays.
    #[inline(always)]
    pub(crate) fn farthest<S: Simd>(&self, simd: S) -> f32 {
        self.range(simd, &self.limit).1
    }

    /// The nearest hit of a ray so far.
    #[inline(always)]
    pub(crate) fn best(&self, ray: usize) -> Option<Hit> {
        (self.hit >> ray & 1 == 1).then_some(self.at(ray))
    }

    /// The nearest hit of a ray, which must be in `hit`.
    #[inline(always)]
    fn at(&self, ray: usize) -> Hit {
        Hit { t: self.limit.0[ray], triangle: self.triangle.0[ray].to_bits(), u: self.u.0[ray], v: self.v.0[ray] }
    }

    /// Sets the nearest hit of a ray.
    #[inline(always)]
    pub(crate) fn keep(&mut self, ray: usize, hit: &Hit) {
        self.limit.0[ray] = hit.t;
        self.u.0[ray] = hit.u;
        self.v.0[ray] = hit.v;
        self.triangle.0[ray] = f32::from_bits(hit.triangle);
        self.hit |= 1 << ray;
    }

    /// Writes the nearest hits into `hits`.
    pub(crate) fn report(&self, hits: &mut PacketHits) {
        for ray in (0..WIDE).filter(|ray| self.hit >> ray & 1 == 1) {
            hits.set(ray, &self.at(ray));
        }
    }

    /// The least and the greatest of the values of the open rays.
    #[inline(always)]
    fn range<S: Simd>(&self, simd: S, values: &F16) -> (f32, f32) {
        let values = simd.wide_load(values);
        let low = simd.wide_select(self.open, values, simd.wide_splat(f32::INFINITY));
        let high = simd.wide_select(self.open, values, simd.wide_splat(f32::NEG_INFINITY));
        (simd.wide_least(low), simd.wide_most(high))
    }

    /// The operands of [`TrianglePlane::decide`](super::plane_test::TrianglePlane::decide): origins, directions, `t_min`, `1 / t_max`, and
    /// the error bound of `p`.
    #[inline(always)]
    pub(crate) fn decided_by(&self) -> (&[F16; 3], &[F16; 3], f32, f32, &F16) {
        (&self.origin, &self.direction, self.t_min, self.shortness, &self.doubt)
    }

    /// Scales the error bounds of [`TrianglePlane::decide`](super::plane_test::TrianglePlane::decide).
    #[cfg(test)]
    pub(crate) fn scale_doubt(&mut self, factor: f32) {
        self.doubt.0 = self.doubt.0.map(|doubt| doubt * factor);
    }
}

impl QueuedRays for PreparedPacket {
    #[inline(always)]
    fn meeting<S: Simd>(&self, simd: S, node: &Node, ray: usize) -> Mask {
        self.prepared(ray).slabs(simd, &node.planes, self.t_max).0
    }

    #[inline(always)]
    fn is_stopped<S: Simd>(&self, simd: S, ray: usize, leaf: &Leaf, accept: &mut impl FnMut(&Hit) -> bool) -> bool {
        blocked(simd, leaf, &self.prepared(ray), accept)
    }

    /// The ray in a lane, as [`PreparedRay::new`] would prepare it.
    #[inline(always)]
    fn prepared(&self, ray: usize) -> PreparedRay {
        let at = |values: &[F16; 3]| [values[0].0[ray], values[1].0[ray], values[2].0[ray]];
        let line = Line {
            origin: at(&self.origin),
            direction: at(&self.direction),
            axes: self.axes,
            shear: [self.shear[0].0[ray], self.shear[1].0[ray]],
            t_min: self.t_min,
            t_max: self.t_max,
            shortness: self.shortness,
            // The single ray's bound is in units of the edges' squared lengths, not of the normal's largest component, which is at most
            // half of their sum.
            doubt: 0.5 * self.doubt.0[ray],
        };
        PreparedRay::of_packet(
            line,
            self.octant.backward(),
            (at(&self.near_origin), at(&self.far_origin)),
            (at(&self.inverse), at(&self.far_inverse)),
        )
    }
}
