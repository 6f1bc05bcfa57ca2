//! The tracer of reference pictures: double precision, and as simple as a tree can be.

use super::brute_force::{finite_triangles, hit, intersect};
use crate::trace::ray::{Hit, Ray};
use crate::trace::tracer::Tracer;
use curitiba_pipeline::scene::{Geometry, TriangleRanges};
use glam::DVec3;

/// A binary tree over triangles in `f64`, which gives exactly the results of [`BruteForce`](crate::trace::BruteForce).
///
/// It shares no code with [`Bvh`](crate::trace::Bvh): neither the tree, nor the box test, nor the triangle test, nor the precision. Boxes
/// are larger than their triangles by far more than rounding can matter, and a box that the ray meets is left unvisited only where it
/// begins clearly behind the nearest hit. So the tree affects only the time, not the results.
///
/// Built by the surface-area heuristic in 16 bins (Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007). About 150
/// to 250 bytes a triangle.
#[derive(Debug, Clone)]
pub struct Double {
    nodes: Vec<Node>,
    triangles: Vec<([DVec3; 3], u32, bool)>,
    /// Triangles of the sky, which block no shadow or occlusion ray.
    sky: TriangleRanges,
    /// By how much boxes were enlarged. Also the distance by which a box must begin behind the nearest hit to be skipped.
    slack: f64,
}

#[derive(Debug, Clone, Copy)]
struct Bounds {
    low: DVec3,
    high: DVec3,
}

#[derive(Debug, Clone, Copy)]
struct Node {
    bounds: Bounds,
    /// Index of the first triangle of a leaf. For an inner node, the index of its second child; its first child follows it.
    first: u32,
    /// Number of triangles in a leaf; 0 for an inner node.
    count: u32,
}

const LEAF: usize = 4;
const BINS: usize = 16;

/// From this depth on, triangles are halved by their order. So the tree is at most this many plus 32 levels deep.
const BALANCED_BELOW: usize = 64;
const STACK: usize = 128;

impl Bounds {
    const EMPTY: Self = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    fn of(points: &[DVec3]) -> Self {
        points.iter().fold(Self::EMPTY, |bounds, p| Self { low: bounds.low.min(*p), high: bounds.high.max(*p) })
    }

    fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    fn half_area(self) -> f64 {
        let side = (self.high - self.low).max(DVec3::ZERO);
        side.x * side.y + side.y * side.z + side.z * side.x
    }

    /// Distance at which a line enters the box, if it meets the box between `t_min` and `t_max`.
    fn enter(&self, line: &Line, t_min: f64, t_max: f64) -> Option<f64> {
        let (mut enter, mut leave) = (t_min, t_max);
        for axis in 0..3 {
            let (low, high) = (self.low[axis] - line.origin[axis], self.high[axis] - line.origin[axis]);
            if line.direction[axis] == 0.0 {
                if low > 0.0 || high < 0.0 {
                    return None;
                }
            } else {
                let (a, b) = (low * line.inverse[axis], high * line.inverse[axis]);
                enter = enter.max(a.min(b));
                leave = leave.min(a.max(b));
            }
        }
        (enter <= leave).then_some(enter)
    }
}

/// A ray in `f64`.
#[derive(Debug, Clone, Copy)]
pub struct DoubleRay {
    /// Origin, world.
    pub origin: DVec3,
    /// Unit direction.
    pub direction: DVec3,
    /// Hits must have `t > t_min`; 0 or more.
    pub t_min: f64,
    /// Hits must have `t < t_max`.
    pub t_max: f64,
}

impl From<&Ray> for DoubleRay {
    fn from(ray: &Ray) -> Self {
        let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        Self { origin, direction, t_min: f64::from(ray.t_min.max(0.0)), t_max: f64::from(ray.t_max) }
    }
}

/// Where a [`DoubleRay`] hits a triangle, or an exact sphere in reference pictures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DoubleHit {
    /// Distance along the ray.
    pub t: f64,
    /// Barycentric coordinate of corner 1.
    pub u: f64,
    /// Barycentric coordinate of corner 2.
    pub v: f64,
    /// Id of the triangle or sphere.
    pub triangle: u32,
}

impl DoubleHit {
    fn of((found, triangle, _): (DVec3, u32, bool)) -> Self {
        Self { t: found.x, u: found.y, v: found.z, triangle }
    }
}

/// Relative difference below which two distances are equal for [`Double::first`]: some thousand times the rounding of `f64`.
const TIE: f64 = 1.0e-12;

struct Line {
    origin: DVec3,
    direction: DVec3,
    inverse: DVec3,
}

/// A triangle while the tree is built.
struct Item {
    bounds: Bounds,
    center: DVec3,
    index: u32,
}

impl Double {
    /// Takes all triangles whose corners are finite; `transparent` as in [`Bvh::build`](crate::trace::Bvh::build).
    #[must_use]
    pub fn build(geometry: &Geometry, transparent: &[bool]) -> Self {
        let unsorted = finite_triangles(geometry, transparent);
        let mut items: Vec<Item> = unsorted
            .iter()
            .zip(0..)
            .map(|((corners, ..), index)| {
                let bounds = Bounds::of(corners);
                Item { bounds, center: (bounds.low + bounds.high) * 0.5, index }
            })
            .collect();
        let whole = items.iter().fold(Bounds::EMPTY, |bounds, item| bounds.union(item.bounds));
        let extent = whole.low.abs().max(whole.high.abs()).max_element();
        let slack = if extent.is_finite() { extent * 1.0e-7 } else { 0.0 };
        let mut nodes = Vec::with_capacity(items.len());
        if !items.is_empty() {
            divide(&mut items, 0, 0, &mut nodes);
        }
        for node in &mut nodes {
            node.bounds.low -= slack;
            node.bounds.high += slack;
        }
        let triangles = items.iter().map(|item| unsorted[item.index as usize]).collect();
        Self { nodes, triangles, sky: geometry.sky.clone(), slack }
    }

    /// Number of nodes.
    #[must_use]
    pub fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// Memory of nodes and triangles, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice()) + size_of_val(self.triangles.as_slice())
    }

    /// The nearest hit, in `f64`. Hits on transparent triangles count only if `accept` returns true; of hits at one distance (up to
    /// rounding), the lowest id wins.
    pub fn first(&self, ray: &DoubleRay, mut accept: impl FnMut(&DoubleHit) -> bool) -> Option<DoubleHit> {
        let mut best: Option<(DVec3, u32, bool)> = None;
        self.walk(ray, |candidate| {
            let nearer = best.is_none_or(|best| {
                let (t, tie) = (candidate.0.x, TIE * best.0.x);
                t < best.0.x - tie || (t <= best.0.x + tie && candidate.1 < best.1)
            });
            if nearer && (!candidate.2 || accept(&DoubleHit::of(candidate))) {
                best = Some(candidate);
            }
            best.map_or(f64::INFINITY, |best| best.0.x * (1.0 + TIE))
        });
        best.map(DoubleHit::of)
    }

    /// Whether there is a hit other than on the sky: on an opaque triangle, or on a transparent one that `accept` accepts.
    pub fn any(&self, ray: &DoubleRay, mut accept: impl FnMut(&DoubleHit) -> bool) -> bool {
        let mut blocked = false;
        self.walk(ray, |candidate| {
            let stops = !self.sky.contains(candidate.1) && (!candidate.2 || accept(&DoubleHit::of(candidate)));
            blocked = blocked || stops;
            if blocked { f64::NEG_INFINITY } else { f64::INFINITY }
        });
        blocked
    }

    /// Passes the candidates of a ray to `visit`, which returns the distance beyond which no more candidates are wanted.
    fn walk(&self, ray: &DoubleRay, mut visit: impl FnMut((DVec3, u32, bool)) -> f64) {
        let DoubleRay { origin, direction, t_min, t_max } = *ray;
        if !origin.is_finite() || !direction.is_finite() || direction == DVec3::ZERO || self.nodes.is_empty() {
            return;
        }
        let line = Line { origin, direction, inverse: direction.recip() };
        let mut limit = f64::INFINITY;
        let mut stack = [(0_u32, 0.0_f64); STACK];
        let mut top = 0;
        if self.nodes[0].bounds.enter(&line, t_min - self.slack, t_max + self.slack).is_some() {
            top = 1;
        }
        while top > 0 {
            top -= 1;
            let (index, enter) = stack[top];
            if enter > limit + self.slack {
                continue;
            }
            let node = self.nodes[index as usize];
            if node.count > 0 {
                let first = node.first as usize;
                for (corners, id, transparent) in &self.triangles[first..first + node.count as usize] {
                    if let Some(found) = intersect(corners, origin, direction)
                        && found.x > t_min
                        && found.x < t_max
                    {
                        limit = visit((found, *id, *transparent));
                    }
                }
                continue;
            }
            let until = t_max.min(limit) + self.slack;
            let children = [index + 1, node.first];
            let met = children.map(|child| self.nodes[child as usize].bounds.enter(&line, t_min - self.slack, until));
            // The nearer child must be popped first, so it is pushed last.
            let nearer = usize::from(met[1].unwrap_or(f64::INFINITY) < met[0].unwrap_or(f64::INFINITY));
            for child in [1 - nearer, nearer] {
                if let Some(enter) = met[child] {
                    stack[top] = (children[child], enter);
                    top += 1;
                }
            }
        }
    }
}

impl Tracer for Double {
    fn closest(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        let mut best: Option<(DVec3, u32, bool)> = None;
        self.walk(&ray.into(), |candidate| {
            let nearer = best.is_none_or(|best| (candidate.0.x, candidate.1) < (best.0.x, best.1));
            if nearer && (!candidate.2 || accept(&hit(candidate))) {
                best = Some(candidate);
            }
            best.map_or(f64::INFINITY, |best| best.0.x)
        });
        best.map(hit)
    }

    fn occluded(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> bool {
        let mut blocked = false;
        self.walk(&ray.into(), |candidate| {
            let stops = !self.sky.contains(candidate.1) && (!candidate.2 || accept(&hit(candidate)));
            blocked = blocked || stops;
            if blocked { f64::NEG_INFINITY } else { f64::INFINITY }
        });
        blocked
    }
}

/// Appends the tree over `items` to `nodes`. `first` is the index of the first item's triangle.
fn divide(items: &mut [Item], first: usize, depth: usize, nodes: &mut Vec<Node>) {
    let bounds = items.iter().fold(Bounds::EMPTY, |bounds, item| bounds.union(item.bounds));
    let index = nodes.len();
    nodes.push(Node { bounds, first: first as u32, count: items.len() as u32 });
    if items.len() <= LEAF {
        return;
    }
    let split = if depth < BALANCED_BELOW { partition(items) } else { items.len() / 2 };
    let (left, right) = items.split_at_mut(split);
    divide(left, first, depth + 1, nodes);
    nodes[index].first = nodes.len() as u32;
    nodes[index].count = 0;
    divide(right, first + split, depth + 1, nodes);
}

/// Reorders the items into two non-empty parts and returns the index at which the second begins.
fn partition(items: &mut [Item]) -> usize {
    let centers = items.iter().fold(Bounds::EMPTY, |b, item| b.union(Bounds { low: item.center, high: item.center }));
    let side = centers.high - centers.low;
    let mut best = (f64::INFINITY, 0, 0);
    let bin = |axis: usize, item: &Item| {
        let place = (item.center[axis] - centers.low[axis]) / side[axis] * BINS as f64;
        (place as usize).min(BINS - 1)
    };
    for axis in 0..3 {
        if side[axis] <= 0.0 {
            continue;
        }
        let mut bins = [(Bounds::EMPTY, 0_usize); BINS];
        for item in items.iter() {
            let (bounds, count) = &mut bins[bin(axis, item)];
            *bounds = bounds.union(item.bounds);
            *count += 1;
        }
        for border in 1..BINS {
            let cost = |bins: &[(Bounds, usize)]| {
                let sum =
                    |(bounds, count): (Bounds, usize), bin: &(Bounds, usize)| (bounds.union(bin.0), count + bin.1);
                let (bounds, count) = bins.iter().fold((Bounds::EMPTY, 0), sum);
                if count == 0 { f64::INFINITY } else { bounds.half_area() * count as f64 }
            };
            let cost = cost(&bins[..border]) + cost(&bins[border..]);
            if cost < best.0 {
                best = (cost, axis, border);
            }
        }
    }
    let (cost, axis, border) = best;
    if !cost.is_finite() {
        return items.len() / 2;
    }
    let mut split = 0;
    for index in 0..items.len() {
        if bin(axis, &items[index]) < border {
            items.swap(index, split);
            split += 1;
        }
    }
    split
}
