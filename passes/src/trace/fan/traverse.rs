//! Traverses the tree with many rays from one origin.
//!
//! Sixteen rays traverse the tree together, one a lane, until few of them are left; those go on singly ([`RayQueue`]). As the origin is
//! common, its part of a slab test is computed once for all nodes. What is left is two fused multiply-adds, two minima and two maxima along
//! each axis, whatever the directions. In a leaf of triangles, too, what depends only on the origin is computed once: the planes through
//! the origin and the edges ([`LeafCones`]).

#![allow(clippy::needless_range_loop, reason = "an axis indexes several arrays side by side")]

use super::leaf_cones::LeafCones;
use crate::trace::ray::{Fan, Hit, Ray};
use crate::trace::rounding::{LEAST_COMPONENT, LONGEST};
use crate::trace::simd::{
    F16, Kernel, LANES, Mask, NO_LANES, Plain, Simd, WIDE, first_wide_lane, load_axes, without_first,
};
use crate::trace::single::{FEW, QueuedRays, RayQueue, Waiting, occluded};
use crate::trace::tree::{Child, Leaf, Line, Node, Plane, PreparedRay, Stack, Start, WideTree};
use glam::Vec3;

/// See [`Tracer::count_open`](crate::trace::Tracer::count_open).
pub(crate) struct CountOpen<'a, A> {
    pub(crate) tree: &'a WideTree,
    pub(crate) fan: &'a Fan<'a>,
    pub(crate) accept: A,
}

impl<A: FnMut(&Hit) -> bool> Kernel<u32> for CountOpen<'_, A> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> u32 {
        let Fan { origin, above, t_min, t_max, directions } = *self.fan;
        let rays = directions.len() as u32;
        let (Some(start), false) =
            (Start::new(origin, (t_min, t_max), &self.tree.bounds), self.tree.root == Child::NONE)
        else {
            return rays;
        };
        let common = Common { start, plane: above.map(|normal| Plane { origin, normal }) };
        let mut blocked = 0;
        for directions in directions.chunks(WIDE) {
            let lanes = FanLanes::new(simd, &common.start, directions);
            let regular = lanes.regular & (!NO_LANES >> (Mask::BITS as usize - directions.len()));
            for (lane, &direction) in directions.iter().enumerate() {
                if regular >> lane & 1 == 0 {
                    blocked += u32::from(self.alone(&Ray { origin, direction, t_min, t_max }));
                }
            }
            if regular != NO_LANES {
                blocked += self.together(simd, &common, &lanes, regular).count_ones();
            }
        }
        rays - blocked
    }
}

/// The data that all rays of a fan share.
struct Common {
    start: Start,
    plane: Option<Plane>,
}

/// Up to sixteen rays, one a lane. Reciprocals and shears are computed by the operations of [`PreparedRay::new`].
struct FanLanes {
    direction: [F16; 3],
    inverse: [F16; 3],
    /// Minus the origin times the inverse direction, for low and for high planes, each with its own moved origin from [`Start::farthest`].
    offset: [[F16; 3]; 2],
    shear: [F16; 2],
    /// Rays whose largest direction component, by absolute value, is x, and rays whose largest is y.
    longest: [Mask; 2],
    /// Rays that may traverse the tree together.
    regular: Mask,
}

impl FanLanes {
    #[inline(always)]
    fn new<S: Simd>(simd: S, start: &Start, directions: &[Vec3]) -> Self {
        let mut d = [F16([1.0; WIDE]); 3];
        for (lane, direction) in directions.iter().enumerate() {
            for axis in 0..3 {
                d[axis].0[lane] = direction[axis];
            }
        }
        let one = simd.wide_splat(1.0);
        let mut regular = !NO_LANES;
        let wide = load_axes(simd, &d);
        let mut size = wide;
        let mut inverse = wide;
        for axis in 0..3 {
            size[axis] = simd.wide_abs(wide[axis]);
            regular &= simd.wide_at_most(simd.wide_splat(LEAST_COMPONENT), size[axis]);
            regular &= simd.wide_at_most(size[axis], simd.wide_splat(LONGEST));
            inverse[axis] = simd.wide_div(one, wide[axis]);
        }
        let mut offset = [[F16::ZERO; 3]; 2];
        for (offset, origin) in offset.iter_mut().zip(start.farthest()) {
            for axis in 0..3 {
                let product = simd.wide_mul(simd.wide_splat(-origin[axis]), inverse[axis]);
                regular &= simd.wide_at_most(simd.wide_abs(product), simd.wide_splat(f32::MAX));
                offset[axis] = simd.wide_store(product);
            }
        }
        let along_x = simd.wide_at_most(size[1], size[0]) & simd.wide_at_most(size[2], size[0]);
        let along_y = simd.wide_at_most(size[2], size[1]) & !along_x;
        let longest = [along_x, along_y];
        let main = pick(simd, longest, wide);
        let shear =
            [pick(simd, longest, [wide[1], wide[2], wide[0]]), pick(simd, longest, [wide[2], wide[0], wide[1]])];
        Self {
            direction: d,
            offset,
            inverse: [simd.wide_store(inverse[0]), simd.wide_store(inverse[1]), simd.wide_store(inverse[2])],
            shear: [simd.wide_store(simd.wide_div(shear[0], main)), simd.wide_store(simd.wide_div(shear[1], main))],
            longest,
            regular,
        }
    }

    /// The ray in a lane, in the form of the triangle test.
    #[inline(always)]
    fn line(&self, start: &Start, lane: usize) -> Line {
        let longest = if self.longest[0] >> lane & 1 == 1 { 0 } else { 2 - (self.longest[1] >> lane & 1) as usize };
        start.line(at(&self.direction, lane), [self.shear[0].0[lane], self.shear[1].0[lane]], longest)
    }
}

/// Up to sixteen rays of a fan, with the data that all its rays share.
struct Spread<'a> {
    common: &'a Common,
    lanes: &'a FanLanes,
}

impl Spread<'_> {
    /// Which of the rays in `mask` a leaf stops.
    #[inline(always)]
    fn stopped<S: Simd>(
        &self,
        simd: S,
        leaf: &Leaf,
        mut mask: Mask,
        accept: &mut impl FnMut(usize, &Hit) -> bool,
    ) -> Mask {
        let mut stopped = NO_LANES;
        let cones = LeafCones::new(simd, leaf, self.common.start.origin(), self.common.plane);
        if cones.are_missed() {
            return stopped;
        }
        // First all rays that may be stopped, then the watertight test of each: a branch in between would be mispredicted.
        let mut possible = NO_LANES;
        while mask != NO_LANES {
            let ray = first_wide_lane(mask);
            mask = without_first(mask);
            possible |= Mask::from(cones.may_stop(simd, at(&self.lanes.direction, ray))) << ray;
        }
        while possible != NO_LANES {
            let ray = first_wide_lane(possible);
            possible = without_first(possible);
            let mut accept = |hit: &Hit| accept(ray, hit);
            stopped |= Mask::from(self.is_stopped(simd, ray, leaf, &mut accept)) << ray;
        }
        stopped
    }

    /// Pushes the children that any ray meets, each with the mask of the rays that meet it.
    #[inline(always)]
    fn visit<S: Simd>(&self, simd: S, node: &Node, mask: Mask, stack: &mut Stack) {
        let Self { common, lanes } = self;
        let used = node.used(simd);
        let (t_min, t_max) = (simd.wide_splat(common.start.t_min), simd.wide_splat(common.start.t_max));
        let inverse = load_axes(simd, &lanes.inverse);
        let offset = [load_axes(simd, &lanes.offset[0]), load_axes(simd, &lanes.offset[1])];
        let mut room = stack.room();
        // All eight children without a branch: how many are used and met is not predictable.
        for lane in 0..LANES {
            let (mut enter, mut leave) = (t_min, t_max);
            for axis in 0..3 {
                let (low, high) = (node.planes[0][axis].0[lane], node.planes[1][axis].0[lane]);
                let a = simd.wide_about_mul_add(simd.wide_splat(low), inverse[axis], offset[0][axis]);
                let b = simd.wide_about_mul_add(simd.wide_splat(high), inverse[axis], offset[1][axis]);
                enter = simd.wide_max_or(simd.wide_min_or(a, b), enter);
                leave = simd.wide_min_or(simd.wide_max_or(a, b), leave);
            }
            let met = simd.wide_at_most(enter, leave) & mask & (used >> lane & 1).wrapping_neg();
            room.push_if(met != NO_LANES, u64::from(met) << 32 | u64::from(node.children[lane].0));
        }
        room.keep();
    }
}

impl QueuedRays for Spread<'_> {
    #[inline(always)]
    fn meeting<S: Simd>(&self, simd: S, node: &Node, ray: usize) -> Mask {
        let Self { common, lanes } = self;
        let mut enter = simd.splat(common.start.t_min);
        let mut leave = simd.splat(common.start.t_max);
        for axis in 0..3 {
            let inverse = simd.splat(lanes.inverse[axis].0[ray]);
            let (low, high) = (simd.load(&node.planes[0][axis]), simd.load(&node.planes[1][axis]));
            let a = simd.about_mul_add(low, inverse, simd.splat(lanes.offset[0][axis].0[ray]));
            let b = simd.about_mul_add(high, inverse, simd.splat(lanes.offset[1][axis].0[ray]));
            enter = simd.max_or(simd.min_or(a, b), enter);
            leave = simd.min_or(simd.max_or(a, b), leave);
        }
        simd.at_most(enter, leave) & node.used(simd)
    }

    #[inline(always)]
    fn is_stopped<S: Simd>(&self, simd: S, ray: usize, leaf: &Leaf, accept: &mut impl FnMut(&Hit) -> bool) -> bool {
        leaf.stops(simd, &self.lanes.line(&self.common.start, ray), || self.prepared(ray), accept)
    }

    #[inline(always)]
    fn prepared(&self, ray: usize) -> PreparedRay {
        let Self { common: Common { start, .. }, lanes } = self;
        start.prepared(lanes.line(start, ray), at(&lanes.inverse, ray))
    }
}

/// The three components of a vector in a lane.
#[inline(always)]
fn at(values: &[F16; 3], lane: usize) -> [f32; 3] {
    [values[0].0[lane], values[1].0[lane], values[2].0[lane]]
}

/// For each ray, `x`, `y` or `z` according to its largest direction component.
#[inline(always)]
fn pick<S: Simd>(simd: S, [along_x, along_y]: [Mask; 2], [x, y, z]: [S::Wide; 3]) -> S::Wide {
    simd.wide_select(along_x, x, simd.wide_select(along_y, y, z))
}

impl<A: FnMut(&Hit) -> bool> CountOpen<'_, A> {
    /// Whether a single ray is blocked. All instruction sets give the same bits, so the portable one serves all and is compiled once.
    #[cold]
    #[inline(never)]
    fn alone(&mut self, ray: &Ray) -> bool {
        match PreparedRay::new(ray, &self.tree.bounds) {
            Some(prepared) => occluded(Plain, self.tree, self.tree.root, &prepared, &mut self.accept),
            None => false,
        }
    }

    /// Which of the regular rays are blocked.
    #[inline(always)]
    fn together<S: Simd>(&mut self, simd: S, common: &Common, lanes: &FanLanes, regular: Mask) -> Mask {
        let Self { tree, accept, .. } = self;
        let mut accept = |_: usize, hit: &Hit| accept(hit);
        let rays = Spread { common, lanes };
        let mut open = regular;
        let mut stack = Stack::new();
        let mut nodes = Waiting::new();
        let mut leaves = Waiting::new();
        let mut queue = RayQueue::new(&mut nodes, &mut leaves);
        let (mut current, mut mask) = (tree.root, regular);
        loop {
            if current.is_leaf() {
                let leaf = &tree.leaves[current.index()];
                if mask & (mask - 1) != NO_LANES {
                    open &= !rays.stopped(simd, leaf, mask, &mut accept);
                } else if queue.leave(current, mask) {
                    open = queue.finish(simd, tree, &rays, open, &mut accept);
                }
            } else if mask.count_ones() as usize <= FEW {
                if queue.leave(current, mask) {
                    open = queue.finish(simd, tree, &rays, open, &mut accept);
                }
            } else {
                rays.visit(simd, &tree.nodes[current.index()], mask, &mut stack);
            }
            loop {
                let Some(entry) = stack.pop() else {
                    if queue.is_waiting() {
                        open = queue.finish(simd, tree, &rays, open, &mut accept);
                    }
                    return regular & !open;
                };
                mask = (entry >> 32) as Mask & open;
                if mask != NO_LANES {
                    current = Child(entry as u32);
                    break;
                }
            }
        }
    }
}
