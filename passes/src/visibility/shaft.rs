//! The shaft of a pair, and the triangles in it.

use super::surfaces::Surfaces;
use super::tree::{LEAF, Leaf, NONE, Node, Tree, WIDE};
use crate::trace::{Detected, Kernel, Simd};
use glam::{DVec3, Vec3};

/// Greatest number of gathered triangles; where there are more, segments are traced.
pub(super) const GATHERED: usize = 128;
/// Unit roundoff of `f32`.
const ROUNDOFF: f32 = 1.0 / 16_777_216.0;
/// Rounding error of a coordinate in `f64`, relative to the largest coordinate in the computation.
pub(super) const TINY: f64 = 1.0e-14;

/// A convex polygon: a triangle, or the part of one on one side of a plane.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Polygon {
    corners: [DVec3; 4],
    count: usize,
}

impl Polygon {
    /// The part of a triangle where `height` is positive.
    pub(super) fn above(corners: [DVec3; 3], height: impl Fn(DVec3) -> f64) -> Self {
        let heights = corners.map(&height);
        let mut part = Self::default();
        for index in 0..3 {
            let (here, next) = (index, (index + 1) % 3);
            if heights[here] > 0.0 {
                part.push(corners[here]);
            }
            if (heights[here] > 0.0) != (heights[next] > 0.0) {
                let share = heights[here] / (heights[here] - heights[next]);
                part.push(corners[here].lerp(corners[next], share));
            }
        }
        part
    }

    fn push(&mut self, corner: DVec3) {
        if self.count < 4 {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }

    /// The corners, in the order of the triangle's.
    pub(super) fn corners(&self) -> &[DVec3] {
        &self.corners[..self.count]
    }

    /// The edges: each corner with the next one.
    pub(super) fn edges(&self) -> impl Iterator<Item = (DVec3, DVec3)> + '_ {
        (0..self.count).map(|index| (self.corners[index], self.corners[(index + 1) % self.count]))
    }

    /// A triangle fan of the polygon, around its first corner.
    pub(super) fn fan(&self) -> impl Iterator<Item = [DVec3; 3]> + '_ {
        self.corners().windows(2).skip(1).map(|pair| [self.corners[0], pair[0], pair[1]])
    }

    /// The mean of the corners.
    fn middle(&self) -> DVec3 {
        self.corners().iter().sum::<DVec3>() / self.count as f64
    }

    pub(super) fn area(&self) -> f64 {
        0.5 * self.fan().map(|[a, b, c]| (b - a).cross(c - a)).sum::<DVec3>().length()
    }
}

/// One triangle of a pair, relative to the pair's origin.
#[derive(Debug, Clone, Copy)]
pub(super) struct Side {
    pub(super) id: u32,
    /// Corners of the triangle, moved inward and off its surface ([`Surface::start`](super::surfaces::Surface::start)). Segments run
    /// between points of these moved triangles.
    pub(super) start: [DVec3; 3],
    /// Unit normal of the front.
    pub(super) normal: DVec3,
    /// The part of `start` that is in front of the other side.
    pub(super) front: Polygon,
    /// Area of the triangle itself.
    pub(super) area: f64,
}

impl Side {
    fn new(surfaces: &Surfaces, id: u32, origin: DVec3) -> Option<Self> {
        let [a, b, c] = surfaces.corners(id);
        let cross = (b - a).cross(c - a);
        let length = cross.length();
        let start = surfaces.all[id as usize].start.map(|corner| corner.as_dvec3() - origin);
        let usable = length > 0.0 && start.iter().all(|corner| corner.is_finite());
        let normal = cross / length;
        usable.then_some(Self { id, start, normal, front: Polygon::default(), area: 0.5 * length })
    }

    /// Signed distance of a point in front of the side's plane.
    pub(super) fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point - self.start[0])
    }
}

/// Two triangles that face each other at least in part.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair {
    /// Origin that the pair's positions are relative to. It is itself relative to [`Surfaces::shift`].
    pub(super) origin: DVec3,
    pub(super) sides: [Side; 2],
}

impl Pair {
    /// `None` if no segment leaves the front of both, or one has no area or a corner that is not finite.
    ///
    /// Which points of one side are in front of the other does not depend on where a segment ends on the other. So the segments that leave
    /// both fronts are those between two convex polygons.
    pub(super) fn new(surfaces: &Surfaces, [a, b]: [u32; 2]) -> Option<Self> {
        let origin = surfaces.all[a as usize].start[0].as_dvec3();
        let mut a = Side::new(surfaces, a, origin)?;
        let mut b = Side::new(surfaces, b, origin)?;
        a.front = Polygon::above(a.start, |point| b.height(point));
        b.front = Polygon::above(b.start, |point| a.height(point));
        let seen = a.front.count >= 3 && b.front.count >= 3;
        seen.then_some(Self { origin, sides: [a, b] })
    }

    /// The share of segments that leave both fronts.
    pub(super) fn valid_share(&self) -> f64 {
        let share = |side: &Side| {
            let [a, b, c] = side.start;
            (side.front.area() / (0.5 * (b - a).cross(c - a).length())).min(1.0)
        };
        share(&self.sides[0]) * share(&self.sides[1])
    }
}

/// A triangle that may block, relative to the pair's origin.
#[derive(Debug, Clone, Copy)]
pub(super) struct Blocker {
    pub(super) corners: [DVec3; 3],
}

/// Greatest number of faces of the hull of two polygons of four corners.
const FACES: usize = 10;
/// [`FACES`], rounded up to whole vectors.
const LANES: usize = 16;

/// The convex hull of both sides. A point `x` is inside if `normal · x <= offset` for all faces.
#[derive(Debug, Clone)]
pub(super) struct Shaft {
    faces: [(DVec3, f64); FACES],
    count: usize,
    corners: [DVec3; 8],
    corner_count: usize,
    /// Normals by axis and offsets, one lane a face. Unused lanes have every point inside.
    normals: [[f64; LANES]; 3],
    offsets: [f64; LANES],
    /// The corners by axis: four lanes a side; unused lanes repeat the last corner.
    ends: [[f64; 8]; 3],
    /// The middles of the fronts of both sides.
    axis: [DVec3; 2],
    /// The largest coordinate of a corner.
    size: f64,
}

impl Shaft {
    /// Each face of the hull, other than the polygons themselves, holds an edge of one polygon and a corner of the other, and each edge
    /// bounds one such face. The face is found by rotating a plane about the edge until all of the other polygon is inside.
    pub(super) fn new(pair: &Pair) -> Self {
        let [a, b] = &pair.sides;
        let mut corners = [DVec3::ZERO; 8];
        let mut corner_count = 0;
        for corner in a.front.corners().iter().chain(b.front.corners()) {
            corners[corner_count] = *corner;
            corner_count += 1;
        }
        let size = corners[..corner_count].iter().fold(0.0_f64, |size, corner| size.max(corner.abs().max_element()));
        let mut ends = [[0.0; 8]; 3];
        for lane in 0..8 {
            let corners = [a, b][lane / 4].front.corners();
            let corner = corners[(lane % 4).min(corners.len() - 1)];
            for axis in 0..3 {
                ends[axis][lane] = corner[axis];
            }
        }
        let mut shaft = Self {
            faces: [(DVec3::ZERO, 0.0); FACES],
            count: 0,
            corners,
            corner_count,
            normals: [[0.0; LANES]; 3],
            offsets: [f64::INFINITY; LANES],
            ends,
            axis: [a, b].map(|side| side.front.middle()),
            size,
        };
        shaft.push(-a.normal);
        shaft.push(-b.normal);
        for (base, other) in [(a, b), (b, a)] {
            for (from, to) in base.front.edges() {
                let along = to - from;
                let mut face = DVec3::ZERO;
                for corner in other.front.corners() {
                    let toward = *corner - from;
                    if face == DVec3::ZERO || face.dot(toward) > 0.0 {
                        face = along.cross(toward);
                    }
                }
                shaft.push(face);
            }
        }
        shaft
    }

    fn push(&mut self, normal: DVec3) {
        let normal = normal.normalize_or_zero();
        if normal != DVec3::ZERO && self.count < FACES {
            let offset = self.corners().iter().fold(f64::NEG_INFINITY, |most, corner| most.max(normal.dot(*corner)));
            self.faces[self.count] = (normal, offset);
            for axis in 0..3 {
                self.normals[axis][self.count] = normal[axis];
            }
            self.offsets[self.count] = offset;
            self.count += 1;
        }
    }

    pub(super) fn corners(&self) -> &[DVec3] {
        &self.corners[..self.corner_count]
    }

    pub(super) fn faces(&self) -> &[(DVec3, f64)] {
        &self.faces[..self.count]
    }

    /// Bound on the rounding error of the height over a face, for a point whose largest coordinate is `size`.
    pub(super) fn slack(&self, size: f64) -> f64 {
        TINY * self.size.max(size)
    }

    /// Heights of a point over all faces.
    #[inline(always)]
    pub(super) fn heights(&self, point: DVec3) -> [f64; LANES] {
        let [x, y, z] = &self.normals;
        let mut heights = [0.0; LANES];
        for lane in 0..LANES {
            heights[lane] = point.x * x[lane] + point.y * y[lane] + point.z * z[lane] - self.offsets[lane];
        }
        heights
    }

    /// Heights of the corners of both sides over a plane through a point: four lanes a side.
    #[inline(always)]
    pub(super) fn ends_over(&self, normal: DVec3, point: DVec3) -> [f64; 8] {
        let [x, y, z] = &self.ends;
        let mut heights = [0.0; 8];
        for lane in 0..8 {
            let (x, y, z) = (x[lane] - point.x, y[lane] - point.y, z[lane] - point.z);
            heights[lane] = normal.x * x + normal.y * y + normal.z * z;
        }
        heights
    }

    /// Whether a triangle has points inside the shaft; touching the shaft's surface does not count.
    #[inline(always)]
    fn meets(&self, corners: &[DVec3; 3]) -> bool {
        let [a, b, c] = *corners;
        let size = a.abs().max(b.abs()).max(c.abs()).max_element();
        let slack = self.slack(size);
        // Calls, not closures: a closure would be compiled for the baseline instruction set.
        let heights = [self.heights(a), self.heights(b), self.heights(c)];
        // `cuts`: for each face, whether any corner is outside it. `beyond`: number of faces that have all corners outside. `outside`: for
        // each corner, the number of faces that it is outside of.
        let mut cuts = [0_u64; LANES];
        let (mut beyond, mut outside) = (0_u64, [0_u64; 3]);
        for lane in 0..LANES {
            let mut out = [0_u64; 3];
            for corner in 0..3 {
                out[corner] = u64::from(heights[corner][lane] >= -slack);
            }
            beyond += out[0] & out[1] & out[2];
            cuts[lane] = out[0] | out[1] | out[2];
            for corner in 0..3 {
                outside[corner] += out[corner];
            }
        }
        if beyond != 0 {
            return false;
        }
        let cross = (b - a).cross(c - a).normalize_or_zero();
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for height in self.ends_over(cross, a) {
            low = if height < low { height } else { low };
            high = if height > high { height } else { high };
        }
        if low >= -slack || high <= slack {
            return false;
        }
        outside.contains(&0) || self.axis_crosses(corners) || self.leaves_some(corners, &cuts, slack)
    }

    /// Whether the segment between the middles of both sides certainly crosses a triangle: this finds most triangles that span the shaft.
    #[inline(always)]
    fn axis_crosses(&self, [a, b, c]: &[DVec3; 3]) -> bool {
        let [from, to] = self.axis;
        let along = to - from;
        let (a, b, c) = (*a - from, *b - from, *c - from);
        let (x, y, z) = (a.cross(b).dot(along), b.cross(c).dot(along), c.cross(a).dot(along));
        // A margin far above rounding.
        let least = 1e-9 * (x.abs() + y.abs() + z.abs());
        let passes = (x > least && y > least && z > least) || (x < -least && y < -least && z < -least);
        let normal = (b - a).cross(c - a);
        let (start, end) = (-normal.dot(a), normal.dot(along - a));
        passes && start * end < 0.0 && start.abs().min(end.abs()) > 1e-9 * (start.abs() + end.abs())
    }

    /// Clips a triangle at the faces that may cut it, and returns whether anything is left.
    fn leaves_some(&self, corners: &[DVec3; 3], cuts: &[u64; LANES], slack: f64) -> bool {
        const MOST: usize = 3 + FACES;
        let mut polygons = [[DVec3::ZERO; MOST]; 2];
        polygons[0][..3].copy_from_slice(corners);
        let (mut count, mut turned) = (3, false);
        for ((normal, offset), _) in self.faces().iter().zip(cuts).filter(|(_, cuts)| **cuts != 0) {
            let height = |point: DVec3| normal.dot(point) - offset + slack;
            let [first, second] = &mut polygons;
            let (polygon, kept) = if turned { (second, first) } else { (first, second) };
            let mut kept_count = 0;
            let mut keep = |point: DVec3| {
                if kept_count < MOST {
                    kept[kept_count] = point;
                    kept_count += 1;
                }
            };
            let (mut here, mut h) = (polygon[count - 1], height(polygon[count - 1]));
            for next in &polygon[..count] {
                let n = height(*next);
                if (h < 0.0) != (n < 0.0) {
                    keep(here.lerp(*next, h / (h - n)));
                }
                if n < 0.0 {
                    keep(*next);
                }
                (here, h) = (*next, n);
            }
            count = kept_count;
            turned = !turned;
            if count < 3 {
                return false;
            }
        }
        true
    }

    /// Gathers the triangles that have points inside the shaft, except the pair's own; false if there are more than [`GATHERED`].
    pub(super) fn gather(&self, surfaces: &Surfaces, pair: &Pair, room: &mut Gathered) -> bool {
        room.blockers.clear();
        Detected::cached().run(Descent { shaft: self, surfaces, pair, room })
    }
}

/// The triangles that a descent finds, and its stack.
#[derive(Debug, Default)]
pub(super) struct Gathered {
    pub(super) blockers: Vec<Blocker>,
    stack: Vec<u32>,
}

/// The faces in `f32`, rounded outwards, relative to a point near the shaft.
struct Rough {
    normals: [Vec3; FACES],
    offsets: [f32; FACES],
    count: usize,
    low: Vec3,
    high: Vec3,
    origin: Vec3,
    /// Largest distance of the shaft's box from the origin along an axis.
    size: f32,
}

impl Rough {
    fn new(shaft: &Shaft, origin: DVec3) -> Self {
        let near = origin.as_vec3();
        let mut rough = Self {
            normals: [Vec3::ZERO; FACES],
            offsets: [0.0; FACES],
            count: shaft.count,
            low: Vec3::INFINITY,
            high: Vec3::NEG_INFINITY,
            origin: near,
            size: 0.0,
        };
        // The origin of a pair is an `f32` position, so the conversion loses nothing.
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for corner in shaft.corners() {
            (low, high) = (low.min(*corner), high.max(*corner));
        }
        let size = shaft.size as f32;
        let pad = (origin.abs().as_vec3() + Vec3::splat(size)) * (4.0 * ROUNDOFF);
        rough.low = (low + origin).as_vec3() - pad;
        rough.high = (high + origin).as_vec3() + pad;
        rough.size = size + 2.0 * pad.max_element();
        for (index, (normal, _)) in shaft.faces().iter().enumerate() {
            let rounded = normal.as_vec3();
            let wide = rounded.as_dvec3();
            let most = shaft.corners().iter().fold(f64::NEG_INFINITY, |most, corner| most.max(wide.dot(*corner)));
            rough.normals[index] = rounded;
            rough.offsets[index] = most as f32 + size * (2.0 * ROUNDOFF);
        }
        rough
    }

    /// The children that may have points inside the shaft, one bit each. Only the part of a child's box inside the shaft's box is tested.
    #[inline(always)]
    fn enters(&self, node: &Node) -> u32 {
        let (mut low, mut high) = ([[0.0_f32; WIDE]; 3], [[0.0_f32; WIDE]; 3]);
        let mut out = [0_u32; WIDE];
        for axis in 0..3 {
            let (least, most, origin) = (self.low[axis], self.high[axis], self.origin[axis]);
            for lane in 0..WIDE {
                let (l, h) = (node.low[axis][lane], node.high[axis][lane]);
                let l = if l > least { l } else { least };
                let h = if h < most { h } else { most };
                out[lane] |= u32::from(l > h);
                low[axis][lane] = l - origin;
                high[axis][lane] = h - origin;
            }
        }
        // Error of one subtraction, three products and two sums of numbers of at most `size`.
        let slack = 8.0 * ROUNDOFF * self.size;
        for (normal, offset) in self.normals[..self.count].iter().zip(self.offsets) {
            let x = if normal.x >= 0.0 { &low[0] } else { &high[0] };
            let y = if normal.y >= 0.0 { &low[1] } else { &high[1] };
            let z = if normal.z >= 0.0 { &low[2] } else { &high[2] };
            for lane in 0..WIDE {
                let least = normal.x * x[lane] + normal.y * y[lane] + normal.z * z[lane];
                out[lane] |= u32::from(least > offset + slack);
            }
        }
        bits(&out)
    }

    /// Two masks: the triangles that may have points inside the shaft, and those of them that certainly have one. A triangle certainly has
    /// one if a corner lies inside all faces by more than the rounding error.
    #[allow(clippy::needless_range_loop, reason = "a lane indexes several arrays side by side")]
    #[inline(always)]
    fn meets(&self, leaf: &Leaf) -> [u32; 2] {
        let mut out = [0_u32; WIDE];
        let mut outside = [[0_u32; WIDE]; 3];
        let mut relative = [[[0.0_f32; WIDE]; 3]; 3];
        let mut size = [0.0_f32; WIDE];
        for axis in 0..3 {
            let (least, most, origin) = (self.low[axis], self.high[axis], self.origin[axis]);
            for lane in 0..WIDE {
                let [a, b, c] = [0, 1, 2].map(|corner: usize| leaf.corners[corner][axis][lane]);
                let below = (a < least) & (b < least) & (c < least);
                let above = (a > most) & (b > most) & (c > most);
                out[lane] |= u32::from(below | above);
            }
            for corner in 0..3 {
                for lane in 0..WIDE {
                    let value = leaf.corners[corner][axis][lane] - origin;
                    relative[corner][axis][lane] = value;
                    let length = value.abs();
                    size[lane] = if length > size[lane] { length } else { size[lane] };
                }
            }
        }
        for (normal, offset) in self.normals[..self.count].iter().zip(self.offsets) {
            for lane in 0..WIDE {
                let [a, b, c] = [0, 1, 2].map(|corner: usize| {
                    let [x, y, z] = &relative[corner];
                    normal.x * x[lane] + normal.y * y[lane] + normal.z * z[lane]
                });
                let limit = offset + 8.0 * ROUNDOFF * size[lane];
                out[lane] |= u32::from((a > limit) & (b > limit) & (c > limit));
                // Includes the rounding of the normal and of the offset.
                let deep = offset - 32.0 * ROUNDOFF * (size[lane] + self.size);
                for (corner, height) in [a, b, c].into_iter().enumerate() {
                    // NaN counts as outside.
                    outside[corner][lane] |= 1 - u32::from(height < deep);
                }
            }
        }
        let met = bits(&out);
        let [a, b, c] = outside.each_ref().map(bits);
        [met, met & (a | b | c)]
    }
}

/// The lanes that hold 0, one bit each.
#[inline(always)]
fn bits(out: &[u32; WIDE]) -> u32 {
    let mut bits = 0;
    for (lane, out) in out.iter().enumerate() {
        bits |= (1 - (out & 1)) << lane;
    }
    bits
}

struct Descent<'a> {
    shaft: &'a Shaft,
    surfaces: &'a Surfaces,
    pair: &'a Pair,
    room: &'a mut Gathered,
}

impl Kernel<bool> for Descent<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> bool {
        let Self { shaft, surfaces, pair, room } = self;
        let Tree { nodes, leaves } = &surfaces.tree;
        let own = pair.sides.map(|side| side.id);
        let rough = Rough::new(shaft, pair.origin);
        let Gathered { blockers, stack } = room;
        stack.clear();
        if !nodes.is_empty() {
            stack.push(0);
        }
        while let Some(entry) = stack.pop() {
            if entry & LEAF == 0 {
                let node = &nodes[entry as usize];
                let mut entered = rough.enters(node);
                while entered != 0 {
                    let lane = entered.trailing_zeros() as usize;
                    entered &= entered - 1;
                    if node.children[lane] != NONE {
                        stack.push(node.children[lane]);
                    }
                }
                continue;
            }
            let leaf = &leaves[(entry & !LEAF) as usize];
            let [mut met, sure] = rough.meets(leaf);
            while met != 0 {
                let lane = met.trailing_zeros() as usize;
                met &= met - 1;
                let id = leaf.ids[lane];
                if id == NONE || own.contains(&id) {
                    continue;
                }
                let mut corners = [DVec3::ZERO; 3];
                for (corner, [x, y, z]) in corners.iter_mut().zip(&leaf.corners) {
                    *corner = Vec3::new(x[lane], y[lane], z[lane]).as_dvec3() - pair.origin;
                }
                if sure >> lane & 1 == 1 || shaft.meets(&corners) {
                    if blockers.len() == GATHERED {
                        return false;
                    }
                    blockers.push(Blocker { corners });
                }
            }
        }
        true
    }
}
