//! The watertight test of a triangle against the rays of a packet: sixteen rays at a time, with the operations, and so the bits, of
//! [`Leaf`]'s test of one ray.

#![allow(clippy::needless_range_loop, reason = "an axis indexes several arrays side by side")]

use super::plane_test::TrianglePlane;
use super::prepared_packet::PreparedPacket;
use crate::trace::ray::Hit;
use crate::trace::rounding::Verdict;
use crate::trace::simd::{Mask, NO_LANES, Plain, Simd, first_wide_lane, load_axes, without_first};
use crate::trace::single::QueuedRays as _;
use crate::trace::tree::Leaf;
use glam::DVec3;

impl PreparedPacket {
    /// Removes from `open` the rays that the triangle in a lane of a leaf stops.
    #[inline(always)]
    pub(crate) fn stop<S: Simd>(
        &mut self,
        simd: S,
        (leaf, lane): (&Leaf, usize),
        accept: &mut impl FnMut(usize, &Hit) -> bool,
    ) {
        let corners = leaf.corners(lane);
        let Lines { mut sure, touched, edges } = self.lines(simd, &corners);
        if sure | touched == NO_LANES {
            return;
        }
        let transparent = leaf.is_transparent(lane);
        if !transparent && sure != NO_LANES {
            let Verdict { hit, miss } = TrianglePlane::new(&corners).decide(simd, self);
            self.open &= !(sure & hit);
            sure &= !(hit | miss);
        }
        let mut t = simd.wide_splat(0.0);
        if sure != NO_LANES {
            (sure, t) = self.reach(simd, &corners, sure);
            sure &= simd.wide_below(t, simd.wide_load(&self.limit));
        }
        if transparent && sure != NO_LANES {
            let [u, v] = barycentric(simd, edges);
            sure = accepted(simd, sure, leaf.triangle(lane), [t, u, v], accept);
        }
        self.open &= !sure;
        if touched != NO_LANES {
            self.one_by_one(touched, (leaf, lane), |packet, ray, hit, transparent| {
                if hit.t < packet.t_max && (!transparent || accept(ray, hit)) {
                    packet.open &= !(1 << ray);
                }
            });
        }
    }

    /// Keeps those hits on the triangle in a lane of a leaf that are nearer than the nearest so far, or as near with a lower id.
    #[inline(always)]
    pub(crate) fn approach<S: Simd>(
        &mut self,
        simd: S,
        (leaf, lane): (&Leaf, usize),
        accept: &mut impl FnMut(usize, &Hit) -> bool,
    ) {
        let corners = leaf.corners(lane);
        let Lines { mut sure, touched, edges } = self.lines(simd, &corners);
        if sure | touched == NO_LANES {
            return;
        }
        let mut t = simd.wide_splat(0.0);
        if sure != NO_LANES {
            (sure, t) = self.reach(simd, &corners, sure);
        }
        let triangle = leaf.triangle(lane);
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
            if leaf.is_transparent(lane) {
                nearer = accepted(simd, nearer, triangle, [t, u, v], accept);
            }
            self.limit = simd.wide_store(simd.wide_select(nearer, t, limit));
            self.u = simd.wide_store(simd.wide_select(nearer, u, simd.wide_load(&self.u)));
            self.v = simd.wide_store(simd.wide_select(nearer, v, simd.wide_load(&self.v)));
            let (own, best) = (simd.wide_splat(f32::from_bits(triangle)), simd.wide_load(&self.triangle));
            self.triangle = simd.wide_store(simd.wide_select(nearer, own, best));
            self.hit |= nearer;
        }
        if touched != NO_LANES {
            self.one_by_one(touched, (leaf, lane), |packet, ray, hit, transparent| {
                let (limit, best) = (packet.limit.0[ray], packet.triangle.0[ray].to_bits());
                let nearer = hit.t < limit || hit.t == limit && hit.triangle < best;
                if nearer && (!transparent || accept(ray, hit)) {
                    packet.keep(ray, hit);
                }
            });
        }
    }

    /// Calls `found` for the hits of single rays on the triangle in a lane of a leaf, up to their limits. All instruction sets give the
    /// same bits, so the portable one serves all and is compiled once.
    #[cold]
    #[inline(never)]
    fn one_by_one(
        &mut self,
        mut rays: Mask,
        (leaf, lane): (&Leaf, usize),
        mut found: impl FnMut(&mut Self, usize, &Hit, bool),
    ) {
        let triangle = leaf.triangle(lane);
        while rays != NO_LANES {
            let ray = first_wide_lane(rays);
            rays = without_first(rays);
            let prepared = self.prepared(ray);
            let mut limit = self.limit.0[ray];
            leaf.intersect(Plain, &prepared, &mut limit, |hit, transparent, _| {
                if hit.triangle == triangle {
                    found(self, ray, &hit, transparent);
                }
                false
            });
        }
    }

    /// The rays whose lines pass through the inside of a triangle, and the rays whose lines pass through an edge or a corner, which must be
    /// tested singly.
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

    /// For rays whose lines pass through a triangle: the mask of those that meet it after `t_min` and within their limit, and the
    /// distances.
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
        // As in `Leaf::solve`, the distance is clamped to the triangle's own bounds.
        let (enter, leave) = self.span(simd, corners);
        let t = simd.wide_max_or(enter, simd.wide_min_or(t, leave));
        (possible & simd.wide_below(t_min, t) & simd.wide_at_most(t, limit), t)
    }

    /// A corner relative to the rays' origins and sheared. Its coordinate along the main axis is not needed.
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

    /// [`PreparedRay::plane_distance`](crate::trace::tree::PreparedRay::plane_distance) of all rays.
    #[inline(always)]
    fn distance<S: Simd>(&self, simd: S, corners: &[[f32; 3]; 3]) -> S::Wide {
        let point = |p: &[f32; 3]| DVec3::new(p[0].into(), p[1].into(), p[2].into());
        let [a, b, c] = [point(&corners[0]), point(&corners[1]), point(&corners[2])];
        let normal = (b - a).cross(c - a);
        simd.wide_plane(normal, a, load_axes(simd, &self.origin), load_axes(simd, &self.direction))
    }

    /// [`PreparedRay::span`](crate::trace::tree::PreparedRay::span) of all rays.
    #[inline(always)]
    fn span<S: Simd>(&self, simd: S, [a, b, c]: &[[f32; 3]; 3]) -> (S::Wide, S::Wide) {
        let mut enter = simd.wide_splat(self.t_min);
        let mut leave = simd.wide_splat(f32::INFINITY);
        let backward = self.octant.backward();
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

    /// The rays whose lines pass through the inside of a triangle.
    #[cfg(test)]
    pub(crate) fn passing<S: Simd>(&self, simd: S, corners: &[[f32; 3]; 3]) -> Mask {
        self.lines(simd, corners).sure
    }
}

/// The rays of a packet whose lines pass through a triangle.
struct Lines<S: Simd> {
    /// Rays whose lines pass through the inside.
    sure: Mask,
    /// Rays whose lines pass through an edge or a corner: they may hit the triangle.
    touched: Mask,
    edges: [S::Wide; 3],
}

/// Of the rays in a mask, those whose hits on a transparent triangle, at `t` with barycentric coordinates `u` and `v`, are accepted.
#[inline(always)]
fn accepted<S: Simd>(
    simd: S,
    rays: Mask,
    triangle: u32,
    [t, u, v]: [S::Wide; 3],
    accept: &mut impl FnMut(usize, &Hit) -> bool,
) -> Mask {
    let (t, u, v) = (simd.wide_store(t), simd.wide_store(u), simd.wide_store(v));
    let (mut accepted, mut asked) = (rays, rays);
    while asked != NO_LANES {
        let ray = first_wide_lane(asked);
        asked = without_first(asked);
        let hit = Hit { t: t.0[ray], triangle, u: u.0[ray], v: v.0[ray] };
        if !accept(ray, &hit) {
            accepted &= !(1 << ray);
        }
    }
    accepted
}

/// The edge function of two sheared corners.
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
