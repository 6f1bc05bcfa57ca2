//! The cheapest answer about many short rays: that nothing is in reach of any of them.

use super::bvh::Bvh;
use super::dispatch::Work;
use super::lanes::{Mask, NO_LANES, Simd, first_lane, without_first};
use super::node::Child;
use super::query::{Bounds, UNIT_ROUNDOFF};
use super::stack::Stack;
use glam::Vec3;

/// Nodes and blocks looked into at most before giving up: rays are traced instead, which is never wrong.
const VISITS: usize = 32;

/// A plane through the origin of rays that all leave to the side of its normal.
///
/// Such a ray meets only points on that side, so a triangle with all corners on the other is met by none. This is how
/// the floor that an occlusion ray starts from, and all that is flush with it, drop out exactly.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plane {
    pub(super) origin: Vec3,
    pub(super) normal: Vec3,
}

impl Plane {
    /// Behind which is what lies behind the planes through all points of a box.
    pub(super) fn behind_all(origins: &Bounds, normal: Vec3) -> Self {
        Self { origin: Vec3::select(normal.cmpge(Vec3::ZERO), origins.low, origins.high), normal }
    }

    /// The lanes whose points are certainly all on the far side, or on the plane. `low` and `high` are bounds of each
    /// lane's points by axis.
    ///
    /// The sum is compared with its own rounding error: four operations deep, each off by at most half an ulp of a term.
    #[inline(always)]
    pub(super) fn behind<S: Simd>(&self, simd: S, low: [S::Vector; 3], high: [S::Vector; 3]) -> Mask {
        let zero = simd.splat(0.0);
        let (mut height, mut size) = (zero, zero);
        for axis in 0..3 {
            // The corner that is farthest along the normal.
            let corner = if self.normal[axis] >= 0.0 { high[axis] } else { low[axis] };
            let part = simd.mul(simd.sub(corner, simd.splat(self.origin[axis])), simd.splat(self.normal[axis]));
            let minus = simd.sub(zero, part);
            height = simd.sub(height, minus);
            size = simd.sub(size, simd.min_or(part, minus));
        }
        simd.at_most(simd.about_mul_add(size, simd.splat(8.0 * UNIT_ROUNDOFF), height), zero)
    }
}

/// What rays of some length from the points of a box stay in: all that is no farther from it, grown by more than their
/// rounding. From one point it is a ball.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ball {
    pub(super) origins: Bounds,
    /// The square of the radius.
    pub(super) square: f32,
}

impl Ball {
    /// `pad`: by how much, along each axis, a box may be missed by a ray that its triangle's test accepts.
    pub(super) fn new(origins: Bounds, radius: f32, pad: Vec3) -> Self {
        let grown = radius * (1.0 + 1.0e-4) + 2.0 * pad.length();
        Self { origins, square: grown * grown }
    }

    /// The lanes of boxes that certainly lie outside; of what is not a number nothing is certain.
    #[inline(always)]
    pub(super) fn misses<S: Simd>(&self, simd: S, low: [S::Vector; 3], high: [S::Vector; 3]) -> Mask {
        let zero = simd.splat(0.0);
        let mut distance = zero;
        for axis in 0..3 {
            let below = simd.sub(low[axis], simd.splat(self.origins.high[axis]));
            let above = simd.sub(simd.splat(self.origins.low[axis]), high[axis]);
            let outside = simd.max_or(simd.max_or(below, above), zero);
            distance = simd.about_mul_add(outside, outside, distance);
        }
        simd.at_most(simd.splat(self.square), distance)
    }
}

/// See [`Tracer::clear_above`](super::Tracer::clear_above).
pub(super) struct ClearAbove<'a> {
    pub(super) bvh: &'a Bvh,
    pub(super) plane: Plane,
    pub(super) t_max: f32,
}

impl Work<bool> for ClearAbove<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> bool {
        let origins = Bounds::of(&[self.plane.origin]);
        let slack = slack(&self.bvh.bounds, &origins);
        let Some((low, high)) = half_balls(&origins, self.plane.normal, self.t_max, slack) else { return false };
        let ball = Ball::new(origins, self.t_max, slack);
        let mut stack = Stack::new();
        let mut current = self.bvh.root;
        if current == Child::NONE {
            return true;
        }
        for _ in 0..VISITS {
            if current.is_block() {
                let block = &self.bvh.blocks[current.index()];
                let near = block.overlapping(simd, &low, &high);
                if near != NO_LANES && near & !block.behind(simd, self.plane) & !block.outside(simd, &ball) != NO_LANES
                {
                    return false;
                }
            } else {
                let node = &self.bvh.nodes[current.index()];
                let mut lanes = node.overlapping(simd, &low, &high);
                if lanes != NO_LANES {
                    lanes &= !node.behind(simd, self.plane);
                }
                while lanes != NO_LANES {
                    stack.push(u64::from(node.children[first_lane(lanes)].0));
                    lanes = without_first(lanes);
                }
            }
            match stack.pop() {
                Some(entry) => current = Child(entry as u32),
                None => return true,
            }
        }
        false
    }
}

/// By how much, along each axis, a box may be missed by a ray from a point of `origins` that its triangle's test accepts.
pub(super) fn slack(scene: &Bounds, origins: &Bounds) -> Vec3 {
    let reach = (scene.low - origins.high).abs().max((scene.high - origins.low).abs());
    let reach = reach.max((scene.low - origins.low).abs()).max((scene.high - origins.high).abs());
    let size = origins.low.abs().max(origins.high.abs());
    (reach + Vec3::splat(reach.max_element())) * (8.0 * UNIT_ROUNDOFF) + size * (2.0 * UNIT_ROUNDOFF)
}

/// The box around the halves, on the side of a normal, of balls around all points of a box, grown by more than the rounding
/// of a ray's end and by a slack; nothing where it overflows.
#[inline(always)]
pub(super) fn half_balls(origins: &Bounds, normal: Vec3, radius: f32, slack: Vec3) -> Option<([f32; 3], [f32; 3])> {
    let (mut low, mut high) = ([0.0; 3], [0.0; 3]);
    for axis in 0..3 {
        let normal = normal[axis];
        // The farthest point of the half ball against the normal lies on its rim.
        let rim = (1.0 - normal * normal).max(0.0).sqrt() + 4.0 * UNIT_ROUNDOFF.sqrt();
        let (back, front) = if normal >= 0.0 { (rim.min(1.0), 1.0) } else { (1.0, rim.min(1.0)) };
        let size = origins.low[axis].abs().max(origins.high[axis].abs());
        let pad = (radius + size) * (32.0 * UNIT_ROUNDOFF) + slack[axis];
        low[axis] = origins.low[axis] - radius * back - pad;
        high[axis] = origins.high[axis] + radius * front + pad;
    }
    let finite = low.iter().chain(&high).all(|value| value.is_finite());
    finite.then_some((low, high))
}

#[cfg(test)]
mod tests {
    use crate::trace::{Bvh, Quality, Ray, Tracer};
    use curitiba_pipeline::scene::{Batch, Geometry};
    use glam::Vec3;

    fn scene(corners: &[[Vec3; 3]]) -> Bvh {
        let count = corners.len() as u32;
        let geometry = Geometry {
            positions: corners.iter().flatten().copied().collect(),
            triangles: (0..count).map(|triangle| [3 * triangle, 3 * triangle + 1, 3 * triangle + 2]).collect(),
            batches: vec![Batch { material: 0, first: 0, count }],
            ..Geometry::default()
        };
        Bvh::build(&geometry, &[], Quality::Balanced)
    }

    /// A floor of two triangles at a height, as large as a town.
    fn floor(height: f32) -> Vec<[Vec3; 3]> {
        let at = |x: f32, z: f32| Vec3::new(x, height, z);
        let [a, b, c, d] = [at(-300.0, -300.0), at(300.0, -300.0), at(300.0, 300.0), at(-300.0, 300.0)];
        vec![[a, b, c], [a, c, d]]
    }

    struct Random(u64);

    impl Random {
        fn signed(&mut self) -> f32 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 40) as f32 / 8_388_608.0 - 1.0
        }

        fn direction(&mut self) -> Vec3 {
            loop {
                let vector = Vec3::new(self.signed(), self.signed(), self.signed());
                if (0.01..1.0).contains(&vector.length_squared()) {
                    return vector.normalize();
                }
            }
        }
    }

    #[test]
    fn a_floor_is_clear_above_and_not_below() {
        for height in [0.0, 1.0, 1e4] {
            let bvh = scene(&floor(height));
            let origin = Vec3::new(12.3, height + height.abs().max(1.0) * 1e-6, -7.7);
            assert!(bvh.clear_above(origin, Vec3::Y, 0.5), "above the floor at {height}");
            assert!(!bvh.clear_above(origin, Vec3::NEG_Y, 0.5), "below, the floor at {height} is in the way");
        }
    }

    #[test]
    fn something_in_reach_is_never_overlooked() {
        let ceiling = |gap: f32| scene(&[floor(0.0), floor(gap)].concat());
        let origin = Vec3::new(3.0, 1e-4, 5.0);
        assert!(!ceiling(0.499).clear_above(origin, Vec3::Y, 0.5));
        assert!(ceiling(0.502).clear_above(origin, Vec3::Y, 0.5));
    }

    #[test]
    fn where_it_is_clear_no_ray_is_blocked() {
        let mut random = Random(5);
        let (mut clear, mut blocked) = (0, 0);
        for _ in 0..60 {
            let soup: Vec<[Vec3; 3]> = (0..200)
                .map(|_| {
                    let center = Vec3::new(random.signed(), random.signed(), random.signed()) * 4.0;
                    [0, 1, 2].map(|_| center + random.direction() * 0.4)
                })
                .collect();
            let bvh = scene(&soup);
            for _ in 0..100 {
                let origin = Vec3::new(random.signed(), random.signed(), random.signed()) * 4.0;
                let normal = random.direction();
                let certain = bvh.clear_above(origin, normal, 0.5);
                clear += u32::from(certain);
                for _ in 0..20 {
                    let mut direction = random.direction();
                    if direction.dot(normal) < 0.0 {
                        direction = -direction;
                    }
                    let hit = bvh.occluded(&Ray { origin, direction, t_min: 0.0, t_max: 0.5 }, |_| true);
                    assert!(!(certain && hit), "a ray from {origin} along {direction} is blocked");
                    blocked += u32::from(hit);
                }
            }
        }
        assert!(clear > 500 && blocked > 500, "the test saw both: {clear} clear origins, {blocked} blocked rays");
    }
}
