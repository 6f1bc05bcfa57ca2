//! Candidates: triangles near a set of points, gathered once. Short rays from those points are tested against these triangles only.

use super::cone_test::{Cone, Cones, TriangleGroup, Viewpoint};
use crate::trace::ray::{Directions, Fan, Hit, Ray};
use crate::trace::rounding::{END_ERROR, LONGEST, Verdict};
use crate::trace::simd::{
    Detected, F16, Kernel, Mask, NO_LANES, Simd, WIDE, first_lane, first_wide_lane, load_axes, vector_at, without_first,
};
use crate::trace::single::blocked;
use crate::trace::tree::{Ball, Bounds, Child, Plane, PreparedRay, Stack, WideTree, half_balls, slack};
use glam::Vec3;

/// Greatest number of gathered triangles.
const GATHERED: usize = 512;
/// At most this many triangles are gathered, plus three for every two rays. With a limit of 160 triangles for sixteen rays, short rays on a
/// scan and in Sponza took more than twice as long as without gathering.
const FEW_GATHERED: usize = 16;
/// Triangles are gathered only in scenes that are more than this many times as long as the rays.
const LONG: f32 = 4.0;
/// Greatest number of nodes and leaves that the search visits before it gives up; fewer where fewer triangles may be gathered.
const VISITS: usize = 256;
/// Vectors of rays that are tested together.
const VECTORS: usize = 8;

/// The origins of rays that are to be tested together, and their length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbourhood {
    /// The bounding box of the origins: low and high corner, world.
    pub origins: [Vec3; 2],
    /// If given, a unit vector such that `direction · above >= 0` for all rays, up to rounding.
    pub above: Option<Vec3>,
    /// Hits have `t > t_min`; 0 or more.
    pub t_min: f32,
    /// Hits have `t < t_max`.
    pub t_max: f32,
    /// Approximate number of rays: the more rays, the more triangles are worth gathering.
    pub rays: usize,
}

impl Neighbourhood {
    /// Fans that share a neighbourhood: those of 4 x 4 pixels.
    pub(crate) const FANS: usize = 16;

    /// The neighbourhood of fans; `None` if there are none, their intervals differ, or an origin is not finite.
    pub(crate) fn of(fans: &[Fan<'_>]) -> Option<Self> {
        let &Fan { origin, above, t_min, t_max, .. } = fans.first()?;
        let mut around = Self { origins: [origin; 2], above, t_min, t_max, rays: 0 };
        for fan in fans {
            if (fan.t_min, fan.t_max) != (t_min, t_max) {
                return None;
            }
            around.origins = [around.origins[0].min(fan.origin), around.origins[1].max(fan.origin)];
            around.above = around.above.filter(|above| fan.above == Some(*above));
            around.rays += fan.directions.len();
        }
        let finite = fans.iter().all(|fan| fan.origin.is_finite());
        finite.then_some(around)
    }
}

/// Triangles that [`Tracer::gather`](crate::trace::Tracer::gather) found, and buffers for testing rays against them. Rays that start in
/// their neighbourhood get the same results as from [`Tracer::occluded`](crate::trace::Tracer::occluded), bit for bit.
#[derive(Debug)]
pub struct Candidates {
    groups: Vec<TriangleGroup>,
    used: usize,
    /// Groups that rays from the box of the last [`Self::narrow`] may meet: the group's index and the mask of its triangles.
    near: Vec<(u32, Mask)>,
    /// Bounds of the scene; the rounding of the watertight test depends on them.
    bounds: Bounds,
    slack: Vec3,
    center: Vec3,
    t_min: f32,
    t_max: f32,
    instruction_set: Detected,
    origin: Vec3,
    /// The triangles as cones seen from `origin`. Only the first `facing` groups are valid.
    cones: Vec<Cones>,
    facing: usize,
    directions: Directions,
}

impl Default for Candidates {
    fn default() -> Self {
        Self {
            groups: Vec::new(),
            used: 0,
            near: Vec::new(),
            bounds: Bounds::EMPTY,
            slack: Vec3::ZERO,
            center: Vec3::ZERO,
            t_min: 0.0,
            t_max: 0.0,
            instruction_set: Detected::cached(),
            origin: Vec3::ZERO,
            cones: Vec::new(),
            facing: 0,
            directions: Directions::default(),
        }
    }
}

impl Candidates {
    /// Keeps the triangles that some rays may meet. The rays start in the box `origins` (low and high corner), a part of the neighbourhood,
    /// and have `direction · above >= 0`. Each call starts again from all gathered triangles.
    pub fn narrow(&mut self, origins: [Vec3; 2], above: Option<Vec3>) {
        self.instruction_set.run(Narrow { candidates: self, origins, above });
    }

    /// Prepares for rays from `origin` with `direction · above >= 0`, where `above` is a unit vector. The origin must lie in the
    /// neighbourhood, and in the box of the last [`Self::narrow`]. Returns whether any triangle may block such a ray.
    ///
    /// Inlined, or `above` would be copied as a whole just after its parts were written, which stalls some processors.
    #[inline(always)]
    pub fn turn_to(&mut self, origin: Vec3, above: Option<Vec3>) -> bool {
        self.instruction_set.run(TurnTo { candidates: self, origin, above })
    }

    /// [`Self::count_open`] for a fan, after [`Self::turn_to`] its origin.
    pub(crate) fn count_open_of_fan(&mut self, fan: &Fan<'_>, accept: impl FnMut(&Hit) -> bool) -> Option<u32> {
        if !self.turn_to(fan.origin, fan.above) {
            return Some(fan.directions.len() as u32);
        }
        let mut directions = std::mem::take(&mut self.directions);
        directions.clear();
        directions.extend(fan.directions.iter().copied());
        let open = self.count_open(&directions, accept);
        self.directions = directions;
        open
    }

    /// How many of these rays from the origin of the last [`Self::turn_to`] hit nothing; `None` if a direction is not finite, or longer
    /// than 1 by more than rounding. `accept` as in [`Tracer`](crate::trace::Tracer).
    pub fn count_open(&self, directions: &Directions, mut accept: impl FnMut(&Hit) -> bool) -> Option<u32> {
        self.count_open_rays(directions, &mut accept)
    }

    /// Compiled once for all closures: `accept` is called for transparent triangles only, so the dynamic call is rare.
    fn count_open_rays(&self, directions: &Directions, accept: &mut dyn FnMut(&Hit) -> bool) -> Option<u32> {
        self.instruction_set.run(CountOpen { candidates: self, directions, accept })
    }

    fn clear(&mut self) {
        self.used = 0;
        self.facing = 0;
        self.near.clear();
    }

    #[inline(always)]
    fn push(&mut self, corners: [[f32; 3]; 3], id: u32, transparent: bool) {
        let (index, lane) = (self.used / WIDE, self.used % WIDE);
        if lane == 0 {
            if index == self.groups.len() {
                self.groups.push(TriangleGroup::EMPTY);
            } else {
                self.groups[index].clear();
            }
        }
        self.groups[index].set(lane, corners, id, transparent);
        self.used += 1;
    }
}

/// See [`Tracer::gather`](crate::trace::Tracer::gather).
pub(crate) struct Gather<'a> {
    pub(crate) tree: &'a WideTree,
    pub(crate) instruction_set: Detected,
    pub(crate) around: &'a Neighbourhood,
    pub(crate) candidates: &'a mut Candidates,
}

/// Volumes that contain all rays of a neighbourhood.
struct Zone {
    low: [f32; 3],
    high: [f32; 3],
    plane: Option<Plane>,
    ball: Ball,
}

impl Zone {
    fn of(around: &Neighbourhood, scene: &Bounds, slack: Vec3) -> Option<Self> {
        let interval = around.t_min < around.t_max && around.t_max > 0.0;
        let origins = Bounds { low: around.origins[0], high: around.origins[1] };
        let finite = origins.low.is_finite() && origins.high.is_finite();
        // Long rays reach too many triangles.
        let longest = (scene.high - scene.low).max_element();
        if !interval || !finite || longest.is_nan() || around.t_max * LONG >= longest {
            return None;
        }
        let radius = around.t_max * LONGEST;
        let (low, high) = match around.above {
            Some(normal) => half_balls(&origins, normal, radius, slack)?,
            None => {
                let size = origins.low.abs().max(origins.high.abs());
                let pad = Vec3::splat(radius) + (Vec3::splat(radius) + size) * END_ERROR + slack;
                let (low, high) = (origins.low - pad, origins.high + pad);
                (low.is_finite() && high.is_finite()).then_some((low.to_array(), high.to_array()))?
            }
        };
        let plane = around.above.map(|normal| Plane::behind_all(&origins, normal));
        Some(Self { low, high, plane, ball: Ball::new(origins, radius, slack) })
    }
}

impl Kernel<bool> for Gather<'_> {
    /// Finds the triangles whose bounds meet the zone of all rays. Returns false if there are too many such triangles, or the search takes
    /// too many visits.
    ///
    /// The zone's box is grown by more than the rounding error of the triangle test, so the box meets the bounds of every triangle that a
    /// ray would hit.
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> bool {
        let Self { tree, instruction_set, around, candidates } = self;
        candidates.clear();
        let origins = Bounds { low: around.origins[0], high: around.origins[1] };
        let slack = slack(&tree.bounds, &origins);
        let Some(zone) = Zone::of(around, &tree.bounds, slack) else { return false };
        (candidates.bounds, candidates.slack, candidates.instruction_set) = (tree.bounds, slack, instruction_set);
        (candidates.t_min, candidates.t_max) = (around.t_min, around.t_max);
        candidates.center = origins.low.midpoint(origins.high);
        let most = GATHERED.min(FEW_GATHERED + 3 * around.rays / 2);
        let mut stack = Stack::new();
        let mut current = tree.root;
        if current == Child::NONE {
            return true;
        }
        for _ in 0..VISITS.min(most) {
            if current.is_leaf() {
                let leaf = &tree.leaves[current.index()];
                let mut lanes = leaf.overlapping(simd, &zone.low, &zone.high);
                if let Some(plane) = zone.plane
                    && lanes != NO_LANES
                {
                    lanes &= !leaf.behind(simd, plane);
                }
                if lanes != NO_LANES {
                    lanes &= !leaf.outside(simd, &zone.ball);
                }
                if candidates.used + lanes.count_ones() as usize > most {
                    return false;
                }
                while lanes != NO_LANES {
                    let lane = first_lane(lanes);
                    lanes = without_first(lanes);
                    candidates.push(leaf.corners(lane), leaf.triangle(lane), leaf.is_transparent(lane));
                }
            } else {
                let node = &tree.nodes[current.index()];
                let mut lanes = node.overlapping(simd, &zone.low, &zone.high);
                if let Some(plane) = zone.plane
                    && lanes != NO_LANES
                {
                    lanes &= !node.behind(simd, plane);
                }
                while lanes != NO_LANES {
                    stack.push(u64::from(node.children[first_lane(lanes)].0));
                    lanes = without_first(lanes);
                }
            }
            match stack.pop() {
                Some(entry) => current = Child(entry as u32),
                None => {
                    candidates.near.clear();
                    for (group, number) in candidates.groups[..candidates.used.div_ceil(WIDE)].iter_mut().zip(0..) {
                        group.finish(candidates.center);
                        candidates.near.push((number, group.used()));
                    }
                    return true;
                }
            }
        }
        false
    }
}

struct Narrow<'a> {
    candidates: &'a mut Candidates,
    origins: [Vec3; 2],
    above: Option<Vec3>,
}

impl Kernel<()> for Narrow<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { candidates, origins: [low, high], above } = self;
        let origins = Bounds { low, high };
        let ball = Ball::new(origins, candidates.t_max * LONGEST, candidates.slack);
        let plane = above.map(|normal| Plane::behind_all(&origins, normal));
        candidates.near.clear();
        for (group, number) in candidates.groups[..candidates.used.div_ceil(WIDE)].iter().zip(0..) {
            let near = group.near(simd, &ball, plane);
            if near != NO_LANES {
                candidates.near.push((number, near));
            }
        }
    }
}

struct TurnTo<'a> {
    candidates: &'a mut Candidates,
    origin: Vec3,
    above: Option<Vec3>,
}

impl Kernel<bool> for TurnTo<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> bool {
        let Self { candidates, origin, above } = self;
        candidates.origin = origin;
        candidates.facing = 0;
        let view = Viewpoint {
            origin,
            plane: above.map(|normal| Plane { origin, normal }),
            ball: Ball::new(Bounds { low: origin, high: origin }, candidates.t_max * LONGEST, candidates.slack),
            t_min: candidates.t_min,
            t_max: candidates.t_max,
            center: candidates.center,
        };
        for &(number, near) in &candidates.near {
            if candidates.facing == candidates.cones.len() {
                candidates.cones.push(Cones::EMPTY);
            }
            let cones = &mut candidates.cones[candidates.facing];
            if candidates.groups[number as usize].seen_from(simd, near, &view, cones) {
                cones.group = number;
                candidates.facing += 1;
            }
        }
        candidates.facing > 0
    }
}

struct CountOpen<'a, A> {
    candidates: &'a Candidates,
    directions: &'a Directions,
    accept: A,
}

impl<A: FnMut(&Hit) -> bool> Kernel<Option<u32>> for CountOpen<'_, A> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> Option<u32> {
        let mut open = 0;
        let mut left = self.directions.len();
        let after = self.candidates.t_min > 0.0;
        for vectors in self.directions.vectors.chunks(VECTORS) {
            let rays = left.min(VECTORS * WIDE);
            left -= rays;
            open += if after {
                self.chunk::<S, true>(simd, vectors, rays)?
            } else {
                self.chunk::<S, false>(simd, vectors, rays)?
            };
        }
        Some(open)
    }
}

impl<A: FnMut(&Hit) -> bool> CountOpen<'_, A> {
    /// Number of the first `rays` rays of some vectors that no triangle stops; `None` if a direction is not finite, or longer than 1 by
    /// more than rounding.
    #[inline(always)]
    fn chunk<S: Simd, const AFTER: bool>(&mut self, simd: S, vectors: &[[F16; 3]], rays: usize) -> Option<u32> {
        let mut open = [NO_LANES; VECTORS];
        for (index, (vector, open)) in vectors.iter().zip(&mut open).enumerate() {
            if !are_short(simd, vector) {
                return None;
            }
            let rays = (rays - index * WIDE).min(WIDE);
            *open = (1 << rays) - 1;
        }
        let candidates = self.candidates;
        for cones in &candidates.cones[..candidates.facing] {
            let mut seen = cones.seen;
            while seen != NO_LANES {
                let lane = first_wide_lane(seen);
                seen = without_first(seen);
                let cone = Cone::new(simd, cones, lane);
                let mut undecided = [NO_LANES; VECTORS];
                let (some, left) = if cone.is_sided {
                    close::<S, AFTER, true>(simd, &cone, vectors, &mut open, &mut undecided)
                } else {
                    close::<S, AFTER, false>(simd, &cone, vectors, &mut open, &mut undecided)
                };
                if some != NO_LANES {
                    for ((vector, open), undecided) in vectors.iter().zip(&mut open).zip(undecided) {
                        if undecided != NO_LANES {
                            *open &= !self.stopped(simd, cones.group, lane, vector, undecided);
                        }
                    }
                }
                if left == NO_LANES {
                    return Some(0);
                }
            }
        }
        Some(open.iter().map(|open| open.count_ones()).sum())
    }

    /// Which of the rays in a mask a triangle stops, by the watertight test.
    #[inline(always)]
    fn stopped<S: Simd>(&mut self, simd: S, group: u32, lane: usize, vector: &[F16; 3], mut rays: Mask) -> Mask {
        let candidates = self.candidates;
        let leaf = candidates.groups[group as usize].leaf(lane);
        let mut stopped = NO_LANES;
        while rays != NO_LANES {
            let index = first_wide_lane(rays);
            rays = without_first(rays);
            let direction = vector_at(vector, index);
            let ray = Ray { origin: candidates.origin, direction, t_min: candidates.t_min, t_max: candidates.t_max };
            let Some(prepared) = PreparedRay::new(&ray, &candidates.bounds) else { continue };
            stopped |= Mask::from(blocked(simd, &leaf, &prepared, &mut self.accept)) << index;
        }
        stopped
    }
}

/// Removes from `open` the rays that a triangle certainly stops, and sets `undecided` to those that the test leaves undecided. Returns two
/// masks over all vectors: lanes with an undecided ray, and lanes with an open ray. There are no branches within a vector, so none is
/// mispredicted.
#[inline(always)]
fn close<S: Simd, const AFTER: bool, const SIDED: bool>(
    simd: S,
    cone: &Cone<S>,
    vectors: &[[F16; 3]],
    open: &mut [Mask; VECTORS],
    undecided: &mut [Mask; VECTORS],
) -> (Mask, Mask) {
    let (mut some, mut left) = (NO_LANES, NO_LANES);
    for ((vector, open), undecided) in vectors.iter().zip(open).zip(undecided) {
        let Verdict { hit, miss } = cone.test::<AFTER, SIDED>(simd, vector);
        *open &= !hit;
        *undecided = *open & !miss;
        some |= *undecided;
        left |= *open;
    }
    (some, left)
}

/// Whether every direction is finite and certainly no longer than [`LONGEST`].
#[inline(always)]
fn are_short<S: Simd>(simd: S, vector: &[F16; 3]) -> bool {
    let [x, y, z] = load_axes(simd, vector);
    let square = simd.wide_about_mul_add(z, z, simd.wide_about_mul_add(y, y, simd.wide_mul(x, x)));
    simd.wide_at_most(square, simd.wide_splat(LONGEST)) == (1 << WIDE) - 1
}
