//! Up to sixteen rays with one main axis and one octant, prepared as [`Query`] prepares one, and the watertight test of a
//! triangle against them: sixteen rays at a time, with the operations and so the bits of [`Block`]'s test of one ray.

#![allow(clippy::needless_range_loop, reason = "an axis indexes several arrays side by side")]

use super::block::Block;
use super::extremes::Extremes;
use super::face::{DOUBT, Face, LONGEST};
use super::facet::Verdict;
use super::lanes::{F8, F16, Mask, NO_LANES, Plain, Simd, WIDE, first_wide_lane, load_axes, without_first};
use super::node::Node;
use super::packet::Packet;
use super::query::{Bounds, FAR, Line, Query, UNIT_ROUNDOFF, permutation};
use super::wave::Rays;
use super::{Hit, PacketHits};
use glam::DVec3;

/// What rays must have in common: the axis along which the direction is longest (bits 0 and 1), the sign of each
/// component (2 to 4), and which components are zero (5 to 7).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Class(u32);

impl Class {
    /// Of rays that meet nothing, see [`Query::new`].
    const NONE: u32 = u32::MAX;

    /// Signs and zeros: what rays of one traversal have in common.
    pub(super) fn octant(self) -> u32 {
        self.0 >> 2
    }

    /// The axis along which the direction is longest.
    pub(super) fn axis(self) -> usize {
        (self.0 & 3) as usize
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

    /// Rays that [`Query::new`] would refuse have none.
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

/// Rays of one packet and one class. What lanes hold that are not `open` means nothing.
#[derive(Debug, Clone, Copy)]
pub(super) struct Beam {
    /// The rays that are still looking.
    pub(super) open: Mask,
    pub(super) class: Class,
    axes: [usize; 3],
    t_min: f32,
    t_max: f32,
    origin: [F16; 3],
    direction: [F16; 3],
    shear: [F16; 2],
    near_origin: [F16; 3],
    far_origin: [F16; 3],
    inverse: [F16; 3],
    far_inverse: [F16; 3],
    /// The nearest distances so far, at first `t_max`.
    limit: F16,
    /// Where they are; the lanes of `hit` say where there is any.
    u: F16,
    v: F16,
    /// The bits of triangle ids; 0 where there is no hit, so that none is below.
    triangle: F16,
    hit: Mask,
    /// For [`Face::decide`]: how far a numerator may be from the truth, and `1 / t_max`.
    doubt: F16,
    shortness: f32,
}

impl Beam {
    pub(super) const EMPTY: Self = Self {
        open: NO_LANES,
        class: Class(0),
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

    /// Prepares the rays of some lanes, all of one class. The operations are those of [`Query::new`].
    #[inline(always)]
    pub(super) fn prepare<S: Simd>(&mut self, simd: S, packet: &Packet, (lanes, class): (Mask, Class), scene: &Bounds) {
        let zero = simd.wide_splat(0.0);
        let axes = permutation(class.axis());
        self.open = lanes;
        self.class = class;
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
            // Of one class, all are zero or none is; the product keeps the sign.
            direction[axis] = if class.0 >> (5 + axis) & 1 == 1 { simd.wide_mul(d, zero) } else { d };
            inverse[axis] = simd.wide_div(simd.wide_splat(1.0), direction[axis]);
            let low = absolute(simd, simd.wide_sub(simd.wide_splat(scene.low[axis]), origin[axis]));
            let high = absolute(simd, simd.wide_sub(simd.wide_splat(scene.high[axis]), origin[axis]));
            reach[axis] = simd.wide_min_or(simd.wide_max_or(low, high), simd.wide_splat(1.0e30));
        }
        let [x, y, z] = axes;
        self.shear = [
            simd.wide_store(simd.wide_div(direction[x], direction[z])),
            simd.wide_store(simd.wide_div(direction[y], direction[z])),
        ];
        let backward = class.backward();
        for axis in 0..3 {
            let span = simd.wide_mul(simd.wide_add(reach[axis], reach[z]), simd.wide_splat(8.0 * UNIT_ROUNDOFF));
            let own = simd.wide_mul(absolute(simd, origin[axis]), simd.wide_splat(2.0 * UNIT_ROUNDOFF));
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
            longest = simd.wide_max_or(absolute(simd, direction[axis]), longest);
            all = simd.wide_add(all, reach[axis]);
        }
        let doubt = simd.wide_add(
            simd.wide_mul(all, simd.wide_splat(DOUBT * UNIT_ROUNDOFF)),
            simd.wide_splat(self.t_min * (DOUBT * UNIT_ROUNDOFF)),
        );
        // What is said of the numerators holds for unit vectors.
        let unit = simd.wide_at_most(longest, simd.wide_splat(LONGEST));
        self.doubt = simd.wide_store(simd.wide_select(unit, doubt, simd.wide_splat(f32::INFINITY)));
        self.shortness = 1.0 / packet.t_max;
        self.limit = F16([packet.t_max; WIDE]);
        self.triangle = F16::ZERO;
        self.hit = NO_LANES;
    }

    /// The rays whose lines meet the inside of a triangle, and those whose lines pass through an edge or a corner, which
    /// have to be asked one by one.
    #[inline(always)]
    fn lines<S: Simd>(&self, simd: S, [a, b, c]: &[[f32; 3]; 3]) -> Lines<S> {
        let [a, b, c] = [self.seen(simd, a), self.seen(simd, b), self.seen(simd, c)];
        let edges = [edge(simd, c, b), edge(simd, a, c), edge(simd, b, a)];
        let least = simd.wide_min_or(simd.wide_min_or(edges[0], edges[1]), edges[2]);
        let most = simd.wide_max_or(simd.wide_max_or(edges[0], edges[1]), edges[2]);
        let zero = simd.wide_splat(0.0);
        let inside = (simd.wide_at_most(zero, least) | simd.wide_at_most(most, zero)) & self.open;
        if inside == NO_LANES {
            return Lines { sure: NO_LANES, touched: NO_LANES, edges };
        }
        let sure = (simd.wide_below(zero, least) | simd.wide_below(most, zero)) & self.open;
        Lines { sure, touched: inside & !sure, edges }
    }

    /// Where rays whose lines meet a triangle do, and those of them which do so up to their limits.
    #[inline(always)]
    fn reach<S: Simd>(&self, simd: S, corners: &[[f32; 3]; 3], sure: Mask) -> (Mask, S::Wide) {
        let t = self.distance(simd, corners);
        let (t_min, limit) = (simd.wide_splat(self.t_min), simd.wide_load(&self.limit));
        let (infinity, minus) = (simd.wide_splat(f32::INFINITY), simd.wide_splat(f32::NEG_INFINITY));
        let finite = simd.wide_below(minus, t) & simd.wide_below(t, infinity);
        let within = simd.wide_below(t_min, t) & simd.wide_at_most(t, limit);
        let possible = sure & (within | !finite);
        if possible == NO_LANES {
            return (NO_LANES, t);
        }
        // As in `Block::solve`, the distance is kept within the triangle's own bounds.
        let (enter, leave) = self.interval(simd, corners);
        let t = simd.wide_max_or(enter, simd.wide_min_or(t, leave));
        (possible & simd.wide_below(t_min, t) & simd.wide_at_most(t, limit), t)
    }

    /// A corner as the rays see it: sheared. Where it lies along the main axis is not needed.
    #[inline(always)]
    fn seen<S: Simd>(&self, simd: S, corner: &[f32; 3]) -> [S::Wide; 2] {
        let [x, y, z] = self.axes;
        let along = simd.wide_sub(simd.wide_splat(corner[z]), simd.wide_load(&self.origin[z]));
        let across_x = simd.wide_sub(simd.wide_splat(corner[x]), simd.wide_load(&self.origin[x]));
        let across_y = simd.wide_sub(simd.wide_splat(corner[y]), simd.wide_load(&self.origin[y]));
        [
            simd.wide_sub(across_x, simd.wide_mul(simd.wide_load(&self.shear[0]), along)),
            simd.wide_sub(across_y, simd.wide_mul(simd.wide_load(&self.shear[1]), along)),
        ]
    }

    /// [`Query::plane_distance`] of all rays.
    #[inline(always)]
    fn distance<S: Simd>(&self, simd: S, corners: &[[f32; 3]; 3]) -> S::Wide {
        let point = |p: &[f32; 3]| DVec3::new(p[0].into(), p[1].into(), p[2].into());
        let [a, b, c] = [point(&corners[0]), point(&corners[1]), point(&corners[2])];
        let normal = (b - a).cross(c - a);
        simd.wide_plane(normal, a, load_axes(simd, &self.origin), load_axes(simd, &self.direction))
    }

    /// [`Query::interval`] of all rays.
    #[inline(always)]
    fn interval<S: Simd>(&self, simd: S, [a, b, c]: &[[f32; 3]; 3]) -> (S::Wide, S::Wide) {
        let mut enter = simd.wide_splat(self.t_min);
        let mut leave = simd.wide_splat(f32::INFINITY);
        let backward = self.class.backward();
        for axis in 0..3 {
            let least = a[axis].min(b[axis]).min(c[axis]);
            let most = a[axis].max(b[axis]).max(c[axis]);
            let (near, far) = if backward[axis] == 0 { (least, most) } else { (most, least) };
            let inverse = simd.wide_load(&self.inverse[axis]);
            let near = simd.wide_sub(simd.wide_splat(near), simd.wide_load(&self.near_origin[axis]));
            let far = simd.wide_sub(simd.wide_splat(far), simd.wide_load(&self.far_origin[axis]));
            enter = simd.wide_max_or(simd.wide_mul(near, inverse), enter);
            leave = simd.wide_min_or(simd.wide_mul(far, simd.wide_load(&self.far_inverse[axis])), leave);
        }
        (enter, leave)
    }

    /// The rays that are in the box in a lane of a node up to their limit, by [`Query::slabs`] for each.
    #[inline(always)]
    pub(super) fn entering<S: Simd>(&self, simd: S, planes: &[[F8; 3]; 2], lane: usize) -> Mask {
        let mut enter = simd.wide_splat(self.t_min);
        let mut leave = simd.wide_load(&self.limit);
        let backward = self.class.backward();
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

    /// The extremes of the open rays.
    #[inline(always)]
    pub(super) fn extremes<S: Simd>(&self, simd: S) -> Extremes {
        let backward = self.class.backward();
        let mut extremes = Extremes {
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
            extremes.near_origin[axis] = near;
            extremes.far_origin[axis] = far;
            extremes.inverse[0][axis] = inverse.0;
            extremes.inverse[1][axis] = inverse.1;
            extremes.far_inverse[0][axis] = inverse.0 * FAR;
            extremes.far_inverse[1][axis] = inverse.1 * FAR;
        }
        extremes
    }

    /// The rays that may meet something nearer than what they met, or as near, in a box that is entered from a distance on.
    #[inline(always)]
    pub(super) fn reaching<S: Simd>(&self, simd: S, enter: f32) -> Mask {
        simd.wide_at_most(simd.wide_splat(enter), simd.wide_load(&self.limit))
    }

    /// The distance up to which any open ray looks.
    #[inline(always)]
    pub(super) fn farthest<S: Simd>(&self, simd: S) -> f32 {
        self.range(simd, &self.limit).1
    }

    /// The nearest hit of a ray so far.
    #[inline(always)]
    pub(super) fn best(&self, ray: usize) -> Option<Hit> {
        (self.hit >> ray & 1 == 1).then_some(self.at(ray))
    }

    /// What a ray met, if it met anything.
    #[inline(always)]
    fn at(&self, ray: usize) -> Hit {
        Hit { t: self.limit.0[ray], triangle: self.triangle.0[ray].to_bits(), u: self.u.0[ray], v: self.v.0[ray] }
    }

    /// Sets the nearest hit of a ray.
    #[inline(always)]
    pub(super) fn keep(&mut self, ray: usize, hit: &Hit) {
        self.limit.0[ray] = hit.t;
        self.u.0[ray] = hit.u;
        self.v.0[ray] = hit.v;
        self.triangle.0[ray] = f32::from_bits(hit.triangle);
        self.hit |= 1 << ray;
    }

    /// Closes the rays that the triangle in a lane of a block stops.
    #[inline(always)]
    pub(super) fn stop<S: Simd>(
        &mut self,
        simd: S,
        (block, lane): (&Block, usize),
        accept: &mut impl FnMut(usize, &Hit) -> bool,
    ) {
        let corners = block.corners(lane);
        let Lines { mut sure, touched, edges } = self.lines(simd, &corners);
        if sure | touched == NO_LANES {
            return;
        }
        let transparent = block.is_transparent(lane);
        if !transparent && sure != NO_LANES {
            let Verdict { hit, miss } = Face::new(&corners).decide(simd, self);
            self.open &= !(sure & hit);
            sure &= !(hit | miss);
        }
        let mut t = simd.wide_splat(0.0);
        if sure != NO_LANES {
            (sure, t) = self.reach(simd, &corners, sure);
            sure &= simd.wide_below(t, simd.wide_load(&self.limit));
        }
        if transparent && sure != NO_LANES {
            let t = simd.wide_store(t);
            let [u, v] = barycentric(simd, edges);
            let (u, v) = (simd.wide_store(u), simd.wide_store(v));
            let triangle = block.triangle(lane);
            let mut asked = sure;
            while asked != NO_LANES {
                let ray = first_wide_lane(asked);
                asked = without_first(asked);
                let hit = Hit { t: t.0[ray], triangle, u: u.0[ray], v: v.0[ray] };
                if !accept(ray, &hit) {
                    sure &= !(1 << ray);
                }
            }
        }
        self.open &= !sure;
        if touched != NO_LANES {
            self.one_by_one(touched, (block, lane), |beam, ray, hit, transparent| {
                if hit.t < beam.t_max && (!transparent || accept(ray, hit)) {
                    beam.open &= !(1 << ray);
                }
            });
        }
    }

    /// Keeps the hits on the triangle in a lane of a block that are nearer than those so far.
    #[inline(always)]
    pub(super) fn approach<S: Simd>(
        &mut self,
        simd: S,
        (block, lane): (&Block, usize),
        accept: &mut impl FnMut(usize, &Hit) -> bool,
    ) {
        let corners = block.corners(lane);
        let Lines { mut sure, touched, edges } = self.lines(simd, &corners);
        if sure | touched == NO_LANES {
            return;
        }
        let mut t = simd.wide_splat(0.0);
        if sure != NO_LANES {
            (sure, t) = self.reach(simd, &corners, sure);
        }
        let triangle = block.triangle(lane);
        let limit = simd.wide_load(&self.limit);
        let mut nearer = sure & simd.wide_below(t, limit);
        let tied = sure & !nearer;
        if tied != NO_LANES {
            for (ray, best) in self.triangle.0.iter().enumerate() {
                nearer |= tied & Mask::from(triangle < best.to_bits()) << ray;
            }
        }
        if nearer != NO_LANES {
            let [u, v] = barycentric(simd, edges);
            if block.is_transparent(lane) {
                let (t, u, v) = (simd.wide_store(t), simd.wide_store(u), simd.wide_store(v));
                let mut asked = nearer;
                while asked != NO_LANES {
                    let ray = first_wide_lane(asked);
                    asked = without_first(asked);
                    let hit = Hit { t: t.0[ray], triangle, u: u.0[ray], v: v.0[ray] };
                    if !accept(ray, &hit) {
                        nearer &= !(1 << ray);
                    }
                }
            }
            self.limit = simd.wide_store(simd.wide_select(nearer, t, limit));
            self.u = simd.wide_store(simd.wide_select(nearer, u, simd.wide_load(&self.u)));
            self.v = simd.wide_store(simd.wide_select(nearer, v, simd.wide_load(&self.v)));
            let (own, best) = (simd.wide_splat(f32::from_bits(triangle)), simd.wide_load(&self.triangle));
            self.triangle = simd.wide_store(simd.wide_select(nearer, own, best));
            self.hit |= nearer;
        }
        if touched != NO_LANES {
            self.one_by_one(touched, (block, lane), |beam, ray, hit, transparent| {
                let (limit, best) = (beam.limit.0[ray], beam.triangle.0[ray].to_bits());
                let nearer = hit.t < limit || hit.t == limit && hit.triangle < best;
                if nearer && (!transparent || accept(ray, hit)) {
                    beam.keep(ray, hit);
                }
            });
        }
    }

    /// Shows the hits of single rays on the triangle in a lane of a block up to their limits. All instruction sets give the
    /// same bits; the portable one needs no compiling for each.
    #[cold]
    #[inline(never)]
    fn one_by_one(
        &mut self,
        mut rays: Mask,
        (block, lane): (&Block, usize),
        mut found: impl FnMut(&mut Self, usize, &Hit, bool),
    ) {
        let triangle = block.triangle(lane);
        while rays != NO_LANES {
            let ray = first_wide_lane(rays);
            rays = without_first(rays);
            let query = self.query(ray);
            let mut limit = self.limit.0[ray];
            block.intersect(Plain, &query, &mut limit, |hit, transparent, _| {
                if hit.triangle == triangle {
                    found(self, ray, &hit, transparent);
                }
                false
            });
        }
    }

    /// Writes what the rays met.
    pub(super) fn report(&self, hits: &mut PacketHits) {
        for ray in (0..WIDE).filter(|ray| self.hit >> ray & 1 == 1) {
            hits.set(ray, &self.at(ray));
        }
    }

    /// The least and the greatest of some values of the open rays.
    #[inline(always)]
    fn range<S: Simd>(&self, simd: S, values: &F16) -> (f32, f32) {
        let values = simd.wide_load(values);
        let low = simd.wide_select(self.open, values, simd.wide_splat(f32::INFINITY));
        let high = simd.wide_select(self.open, values, simd.wide_splat(f32::NEG_INFINITY));
        (simd.wide_least(low), simd.wide_most(high))
    }

    /// What [`Face::decide`] asks of rays: origins, directions, `t_min`, `1 / t_max`, and how far numerators may be off.
    #[inline(always)]
    pub(super) fn decided_by(&self) -> (&[F16; 3], &[F16; 3], f32, f32, &F16) {
        (&self.origin, &self.direction, self.t_min, self.shortness, &self.doubt)
    }

    /// The rays whose lines pass through the inside of a triangle.
    #[cfg(test)]
    pub(super) fn passing<S: Simd>(&self, simd: S, corners: &[[f32; 3]; 3]) -> Mask {
        self.lines(simd, corners).sure
    }

    /// Widens or narrows the bounds of [`Face::decide`].
    #[cfg(test)]
    pub(super) fn scale_doubt(&mut self, factor: f32) {
        self.doubt.0 = self.doubt.0.map(|doubt| doubt * factor);
    }
}

/// Rays whose lines meet a triangle.
struct Lines<S: Simd> {
    /// Those whose lines do.
    sure: Mask,
    /// Those whose lines pass through an edge or a corner, and may.
    touched: Mask,
    edges: [S::Wide; 3],
}

impl Rays for Beam {
    #[inline(always)]
    fn meeting<S: Simd>(&self, simd: S, node: &Node, ray: usize) -> Mask {
        self.query(ray).slabs(simd, &node.planes, self.t_max).0
    }

    #[inline(always)]
    fn is_stopped<S: Simd>(&self, simd: S, ray: usize, block: &Block, accept: &mut impl FnMut(&Hit) -> bool) -> bool {
        let query = self.query(ray);
        block.stops(simd, &query.line, || query, accept)
    }

    /// What [`Query::new`] makes of a ray, from what is here.
    #[inline(always)]
    fn query(&self, ray: usize) -> Query {
        let at = |values: &[F16; 3]| [values[0].0[ray], values[1].0[ray], values[2].0[ray]];
        let line = Line {
            origin: at(&self.origin),
            direction: at(&self.direction),
            axes: self.axes,
            shear: [self.shear[0].0[ray], self.shear[1].0[ray]],
            t_min: self.t_min,
            t_max: self.t_max,
            shortness: self.shortness,
            // No edge of a normal's largest component 1 is counted there, but their squares, of which it is at most half.
            doubt: 0.5 * self.doubt.0[ray],
        };
        Query::of_beam(
            line,
            self.class.backward(),
            (at(&self.near_origin), at(&self.far_origin)),
            (at(&self.inverse), at(&self.far_inverse)),
        )
    }
}

#[inline(always)]
fn absolute<S: Simd>(simd: S, values: S::Wide) -> S::Wide {
    simd.wide_max_or(values, simd.wide_sub(simd.wide_splat(0.0), values))
}

/// The edge function of two corners as rays see them.
#[inline(always)]
fn edge<S: Simd>(simd: S, p: [S::Wide; 2], q: [S::Wide; 2]) -> S::Wide {
    simd.wide_sub(simd.wide_mul(p[0], q[1]), simd.wide_mul(p[1], q[0]))
}

/// Barycentric coordinates of corners 1 and 2 from edge functions.
#[inline(always)]
fn barycentric<S: Simd>(simd: S, [a, b, c]: [S::Wide; 3]) -> [S::Wide; 2] {
    let determinant = simd.wide_add(simd.wide_add(a, b), c);
    [simd.wide_div(b, determinant), simd.wide_div(c, determinant)]
}
