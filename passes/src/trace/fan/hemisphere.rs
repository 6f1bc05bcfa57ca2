//! The cheapest test of many short rays: whether no triangle is within reach of any of them.

use crate::trace::simd::{Kernel, NO_LANES, Simd, first_lane, without_first};
use crate::trace::tree::{Ball, Bounds, Child, Plane, Stack, WideTree, half_balls, slack};

/// Nodes and leaves visited before the search gives up. Then the rays are traced, which is always correct.
const VISITS: usize = 32;

/// See [`Tracer::clear_above`](crate::trace::Tracer::clear_above).
pub(crate) struct ClearAbove<'a> {
    pub(crate) tree: &'a WideTree,
    pub(crate) plane: Plane,
    pub(crate) t_max: f32,
}

impl Kernel<bool> for ClearAbove<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> bool {
        let origins = Bounds::of(&[self.plane.origin]);
        let slack = slack(&self.tree.bounds, &origins);
        let Some((low, high)) = half_balls(&origins, self.plane.normal, self.t_max, slack) else { return false };
        let ball = Ball::new(origins, self.t_max, slack);
        let mut stack = Stack::new();
        let mut current = self.tree.root;
        if current == Child::NONE {
            return true;
        }
        for _ in 0..VISITS {
            if current.is_leaf() {
                let leaf = &self.tree.leaves[current.index()];
                let near = leaf.overlapping(simd, &low, &high);
                if near != NO_LANES && near & !leaf.behind(simd, self.plane) & !leaf.outside(simd, &ball) != NO_LANES {
                    return false;
                }
            } else {
                let node = &self.tree.nodes[current.index()];
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

    /// A floor of two triangles at a height, 600 by 600 units.
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
