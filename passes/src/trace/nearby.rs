//! The triangles near a point, or near several, gathered once: short rays from there are tested against them alone.

use super::bvh::{Bvh, blocked};
use super::clear::{Ball, Plane, half_balls, slack};
use super::directions::Directions;
use super::dispatch::{Detected, Work};
use super::facet::{Facet, Facets, Group, LONGEST, Verdict, View};
use super::lanes::{F16, Mask, NO_LANES, Simd, WIDE, first_lane, first_wide_lane, load_axes, vector_at, without_first};
use super::node::Child;
use super::query::{Bounds, Query, UNIT_ROUNDOFF};
use super::stack::Stack;
use super::{Fan, Hit, Ray};
use glam::Vec3;

/// Triangles gathered at most.
const GATHERED: usize = 512;
/// Triangles gathered for however few rays, to which come three for each two rays. With 160 for sixteen rays, short rays
/// on a scan and in Sponza took more than twice as long as by themselves.
const FEW_GATHERED: usize = 16;
/// How many times longer than the rays a scene must be for triangles to be gathered.
const LONG: f32 = 4.0;
/// Nodes and blocks looked into at most before giving up.
const VISITS: usize = 256;
/// Vectors of rays that are tested together.
const VECTORS: usize = 8;

/// Where rays start that are to be tested together, and how far they reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbourhood {
    /// The box of their origins: low and high corner, world.
    pub origins: [Vec3; 2],
    /// A unit vector that no direction looks against, where there is one for all of them.
    pub above: Option<Vec3>,
    /// Hits have `t > t_min`; 0 or more.
    pub t_min: f32,
    /// Hits have `t < t_max`.
    pub t_max: f32,
    /// How many rays there are, about: the more, the more triangles are worth gathering.
    pub rays: usize,
}

impl Neighbourhood {
    /// Fans whose neighbourhood is gathered at once: those of 4 x 4 pixels.
    pub(super) const FANS: usize = 16;

    /// That of some fans; `None` if their intervals differ, or an origin is not finite.
    pub(super) fn of(fans: &[Fan<'_>]) -> Option<Self> {
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

/// Triangles that [`Tracer::gather`](super::Tracer::gather) found, and the buffers that it takes to ask them. Rays that
/// start in their neighbourhood are answered as by [`Tracer::occluded`](super::Tracer::occluded), to the bit.
#[derive(Debug)]
pub struct Nearby {
    groups: Vec<Group>,
    used: usize,
    /// The groups that may be met from the part that was last narrowed to, by number, and which of their triangles.
    near: Vec<(u32, Mask)>,
    /// Of the scene: what the watertight test rounds depends on it.
    bounds: Bounds,
    slack: Vec3,
    center: Vec3,
    t_min: f32,
    t_max: f32,
    lanes: Detected,
    origin: Vec3,
    /// As the origin sees them; only the first `facing` count.
    facets: Vec<Facets>,
    facing: usize,
    directions: Directions,
}

impl Default for Nearby {
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
            lanes: Detected::cached(),
            origin: Vec3::ZERO,
            facets: Vec::new(),
            facing: 0,
            directions: Directions::default(),
        }
    }
}

impl Nearby {
    /// Leaves out what rays from the points of a part of the neighbourhood do not meet: from its low to its high corner, above
    /// planes of a normal if there is one. What an earlier call left out is back.
    pub fn narrow(&mut self, origins: [Vec3; 2], above: Option<Vec3>) {
        self.lanes.run(Narrow { nearby: self, origins, above });
    }

    /// Turns to the rays from `origin`, which lies in the neighbourhood and the part last narrowed to, that do not look
    /// against `above`, a unit vector. Returns whether any triangle may be in their way.
    ///
    /// In line, or `above` would be copied as a whole just after its parts were written, which makes some processors wait.
    #[inline(always)]
    pub fn turn_to(&mut self, origin: Vec3, above: Option<Vec3>) -> bool {
        self.lanes.run(TurnTo { nearby: self, origin, above })
    }

    /// As [`Self::count_open`], after turning to the fan's origin.
    pub(super) fn count_open_of_fan(&mut self, fan: &Fan<'_>, accept: impl FnMut(&Hit) -> bool) -> Option<u32> {
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

    /// How many of these rays from the origin last turned to meet nothing; `None` if a direction is longer than 1 by more
    /// than rounding. `accept` as in [`Tracer`](super::Tracer).
    pub fn count_open(&self, directions: &Directions, mut accept: impl FnMut(&Hit) -> bool) -> Option<u32> {
        self.count_open_rays(directions, &mut accept)
    }

    /// Compiled once for whatever `accept` is: it is called for transparent triangles only.
    fn count_open_rays(&self, directions: &Directions, accept: &mut dyn FnMut(&Hit) -> bool) -> Option<u32> {
        self.lanes.run(CountOpen { nearby: self, directions, accept })
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
                self.groups.push(Group::EMPTY);
            } else {
                self.groups[index].clear();
            }
        }
        self.groups[index].set(lane, corners, id, transparent);
        self.used += 1;
    }
}

/// See [`Tracer::gather`](super::Tracer::gather).
pub(super) struct Gather<'a> {
    pub(super) bvh: &'a Bvh,
    pub(super) around: &'a Neighbourhood,
    pub(super) nearby: &'a mut Nearby,
}

/// What contains all rays of a neighbourhood.
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
        // Long rays have too many triangles in reach.
        let longest = (scene.high - scene.low).max_element();
        if !interval || !finite || longest.is_nan() || around.t_max * LONG >= longest {
            return None;
        }
        let radius = around.t_max * LONGEST;
        let (low, high) = match around.above {
            Some(normal) => half_balls(&origins, normal, radius, slack)?,
            None => {
                let size = origins.low.abs().max(origins.high.abs());
                let pad = Vec3::splat(radius) + (Vec3::splat(radius) + size) * (32.0 * UNIT_ROUNDOFF) + slack;
                let (low, high) = (origins.low - pad, origins.high + pad);
                (low.is_finite() && high.is_finite()).then_some((low.to_array(), high.to_array()))?
            }
        };
        let plane = around.above.map(|normal| Plane::behind_all(&origins, normal));
        Some(Self { low, high, plane, ball: Ball::new(origins, radius, slack) })
    }
}

impl Work<bool> for Gather<'_> {
    /// Finds the triangles whose bounds meet what contains all rays; gives up if they are too many or too hard to find.
    ///
    /// The box is grown by more than the rounding of the triangle test, so that what a ray would hit is in it.
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> bool {
        let Self { bvh, around, nearby } = self;
        nearby.clear();
        let origins = Bounds { low: around.origins[0], high: around.origins[1] };
        let slack = slack(&bvh.bounds, &origins);
        let Some(zone) = Zone::of(around, &bvh.bounds, slack) else { return false };
        (nearby.bounds, nearby.slack, nearby.lanes) = (bvh.bounds, slack, bvh.lanes);
        (nearby.t_min, nearby.t_max) = (around.t_min, around.t_max);
        nearby.center = origins.low.midpoint(origins.high);
        let most = GATHERED.min(FEW_GATHERED + 3 * around.rays / 2);
        let mut stack = Stack::new();
        let mut current = bvh.root;
        if current == Child::NONE {
            return true;
        }
        for _ in 0..VISITS.min(most) {
            if current.is_block() {
                let block = &bvh.blocks[current.index()];
                let mut lanes = block.overlapping(simd, &zone.low, &zone.high);
                if let Some(plane) = zone.plane
                    && lanes != NO_LANES
                {
                    lanes &= !block.behind(simd, plane);
                }
                if lanes != NO_LANES {
                    lanes &= !block.outside(simd, &zone.ball);
                }
                if nearby.used + lanes.count_ones() as usize > most {
                    return false;
                }
                while lanes != NO_LANES {
                    let lane = first_lane(lanes);
                    lanes = without_first(lanes);
                    nearby.push(block.corners(lane), block.triangle(lane), block.is_transparent(lane));
                }
            } else {
                let node = &bvh.nodes[current.index()];
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
                    nearby.near.clear();
                    for (group, number) in nearby.groups[..nearby.used.div_ceil(WIDE)].iter_mut().zip(0..) {
                        group.finish(nearby.center);
                        nearby.near.push((number, group.used()));
                    }
                    return true;
                }
            }
        }
        false
    }
}

struct Narrow<'a> {
    nearby: &'a mut Nearby,
    origins: [Vec3; 2],
    above: Option<Vec3>,
}

impl Work<()> for Narrow<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { nearby, origins: [low, high], above } = self;
        let origins = Bounds { low, high };
        let ball = Ball::new(origins, nearby.t_max * LONGEST, nearby.slack);
        let plane = above.map(|normal| Plane::behind_all(&origins, normal));
        nearby.near.clear();
        for (group, number) in nearby.groups[..nearby.used.div_ceil(WIDE)].iter().zip(0..) {
            let near = group.near(simd, &ball, plane);
            if near != NO_LANES {
                nearby.near.push((number, near));
            }
        }
    }
}

struct TurnTo<'a> {
    nearby: &'a mut Nearby,
    origin: Vec3,
    above: Option<Vec3>,
}

impl Work<bool> for TurnTo<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> bool {
        let Self { nearby, origin, above } = self;
        nearby.origin = origin;
        nearby.facing = 0;
        let view = View {
            origin,
            plane: above.map(|normal| Plane { origin, normal }),
            ball: Ball::new(Bounds { low: origin, high: origin }, nearby.t_max * LONGEST, nearby.slack),
            t_min: nearby.t_min,
            t_max: nearby.t_max,
            center: nearby.center,
        };
        for &(number, near) in &nearby.near {
            if nearby.facing == nearby.facets.len() {
                nearby.facets.push(Facets::EMPTY);
            }
            let facets = &mut nearby.facets[nearby.facing];
            if nearby.groups[number as usize].seen_from(simd, near, &view, facets) {
                facets.group = number;
                nearby.facing += 1;
            }
        }
        nearby.facing > 0
    }
}

struct CountOpen<'a, A> {
    nearby: &'a Nearby,
    directions: &'a Directions,
    accept: A,
}

impl<A: FnMut(&Hit) -> bool> Work<Option<u32>> for CountOpen<'_, A> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> Option<u32> {
        let mut open = 0;
        let mut left = self.directions.len();
        let after = self.nearby.t_min > 0.0;
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
    /// How many of the first rays of some vectors none of the triangles stops.
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
        let nearby = self.nearby;
        for facets in &nearby.facets[..nearby.facing] {
            let mut seen = facets.seen;
            while seen != NO_LANES {
                let lane = first_wide_lane(seen);
                seen = without_first(seen);
                let facet = Facet::new(simd, facets, lane);
                let mut undecided = [NO_LANES; VECTORS];
                let (some, left) = if facet.is_sided {
                    close::<S, AFTER, true>(simd, &facet, vectors, &mut open, &mut undecided)
                } else {
                    close::<S, AFTER, false>(simd, &facet, vectors, &mut open, &mut undecided)
                };
                if some != NO_LANES {
                    for ((vector, open), undecided) in vectors.iter().zip(&mut open).zip(undecided) {
                        if undecided != NO_LANES {
                            *open &= !self.stopped(simd, facets.group, lane, vector, undecided);
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

    /// Which of some rays a triangle stops, by the watertight test.
    #[inline(always)]
    fn stopped<S: Simd>(&mut self, simd: S, group: u32, lane: usize, vector: &[F16; 3], mut rays: Mask) -> Mask {
        let nearby = self.nearby;
        let block = nearby.groups[group as usize].block(lane);
        let mut stopped = NO_LANES;
        while rays != NO_LANES {
            let index = first_wide_lane(rays);
            rays = without_first(rays);
            let direction = vector_at(vector, index);
            let ray = Ray { origin: nearby.origin, direction, t_min: nearby.t_min, t_max: nearby.t_max };
            let Some(query) = Query::new(&ray, &nearby.bounds) else { continue };
            stopped |= Mask::from(blocked(simd, &block, &query, &mut self.accept)) << index;
        }
        stopped
    }
}

/// Closes the rays of some vectors that a triangle certainly stops, and notes those of which that is not certain. Returns whether
/// there are any of these, and any that are open, in any lane. Without a jump in a vector: none is guessed.
#[inline(always)]
fn close<S: Simd, const AFTER: bool, const SIDED: bool>(
    simd: S,
    facet: &Facet<S>,
    vectors: &[[F16; 3]],
    open: &mut [Mask; VECTORS],
    undecided: &mut [Mask; VECTORS],
) -> (Mask, Mask) {
    let (mut some, mut left) = (NO_LANES, NO_LANES);
    for ((vector, open), undecided) in vectors.iter().zip(open).zip(undecided) {
        let Verdict { hit, miss } = facet.test::<AFTER, SIDED>(simd, vector);
        *open &= !hit;
        *undecided = *open & !miss;
        some |= *undecided;
        left |= *open;
    }
    (some, left)
}

/// Whether no direction is longer than [`LONGEST`], nor anything but numbers.
#[inline(always)]
fn are_short<S: Simd>(simd: S, vector: &[F16; 3]) -> bool {
    let [x, y, z] = load_axes(simd, vector);
    let square = simd.wide_about_mul_add(z, z, simd.wide_about_mul_add(y, y, simd.wide_mul(x, x)));
    simd.wide_at_most(square, simd.wide_splat(LONGEST)) == (1 << WIDE) - 1
}
