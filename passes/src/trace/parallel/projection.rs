//! Triangles and ray origins projected along one direction, and certain verdicts on sixteen rays against a triangle.
//!
//! The watertight test computes with rounded differences to the ray's origin. It accepts a line only if the origin lies in the triangle of
//! the rounded corners. Let `u` = 2⁻²⁴, and let `S` be the largest coordinate, relative to a centre in the tile, of the triangle's corners
//! and of all origins. Projected corners and points are off by at most 5 u S here, and by as much in the watertight test. So a triangle is
//! missed if its bounds are [`COORDINATE_UNITS`] u S away, or if a line through the ray's point has all corners on one side by 15 u S. It
//! is hit if the edge functions, products of coordinates up to `D`, are positive by 30 u S D, where `D` is the extent of the triangle and
//! of all points. With the rounding of the products both bounds are below [`EDGE_UNITS`] u S D.
//!
//! The watertight test decides the side of a plane on which a ray starts by an `f64` distance. So for misses only the rounding here counts.
//! Along each axis it is [`HEIGHT_UNITS`] u times the products that make up the normal's component, times the distance that multiplies the
//! component. Bounding each axis separately loses nothing where a triangle lies flat along an axis. For hits, [`DOUBT`] is added.

#![allow(clippy::needless_range_loop, reason = "an axis indexes several arrays side by side")]

use crate::trace::packet::Octant;
use crate::trace::ray::Packet;
use crate::trace::rounding::{
    COORDINATE_UNITS, DOUBT, EDGE_UNITS, HEIGHT_UNITS, LARGEST_COORDINATE, TINY, UNIT_ROUNDOFF,
};
use crate::trace::simd::{F16, Mask, NO_LANES, Simd};
use crate::trace::tree::{Bounds, Leaf, Node, permutation};
use glam::Vec3;

/// The direction of projection, and the origin of coordinates.
pub(crate) struct Projection {
    axes: [usize; 3],
    shear: [f32; 2],
    /// Whether the direction runs towards lower coordinates along its longest axis.
    pub(crate) is_backward: bool,
    direction: [f32; 3],
    center: [f32; 3],
    /// Largest coordinates of ray origins, relative to the centre.
    size: Vec3,
    /// Error of the plane test for hits: [`DOUBT`] u times the sum of the largest distances of the scene from any origin.
    doubt: f32,
    /// Bounds on the errors of the origins by axis, and of their projections.
    blur: Vec3,
    blur_across: [f32; 2],
}

/// The rays of a packet, projected along the direction.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ProjectedRays {
    /// Origins, relative to the centre.
    origin: [F16; 3],
    /// Projected origins.
    across: [F16; 2],
    pub(crate) zone: Zone,
    /// Bounds of the origins, relative to the centre.
    low: [f32; 3],
    high: [f32; 3],
}

impl Default for ProjectedRays {
    fn default() -> Self {
        Self::NONE
    }
}

impl ProjectedRays {
    pub(crate) const NONE: Self =
        Self { origin: [F16::ZERO; 3], across: [F16::ZERO; 2], zone: Zone::EMPTY, low: [0.0; 3], high: [0.0; 3] };

    /// Largest coordinates of the origins, by axis.
    #[inline(always)]
    fn size(&self) -> Vec3 {
        Vec3::from_array(self.high).max(-Vec3::from_array(self.low))
    }
}

/// A rectangle of projected origins, and where along the direction the first ray starts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Zone {
    low: [f32; 2],
    high: [f32; 2],
    /// Coordinate along the longest axis: the least of all origins, or the greatest for backward rays.
    first: f32,
}

impl Zone {
    const EMPTY: Self = Self { low: [f32::INFINITY; 2], high: [f32::NEG_INFINITY; 2], first: f32::NAN };

    /// Grows to include another zone that is not empty.
    #[inline(always)]
    pub(crate) fn join(&mut self, other: &Self, is_backward: bool) {
        for axis in 0..2 {
            self.low[axis] = self.low[axis].min(other.low[axis]);
            self.high[axis] = self.high[axis].max(other.high[axis]);
        }
        self.first = if is_backward { self.first.max(other.first) } else { self.first.min(other.first) };
    }

    #[inline(always)]
    pub(crate) fn area(&self) -> f32 {
        (self.high[0] - self.low[0]) * (self.high[1] - self.low[1])
    }

    #[inline(always)]
    fn pad(&mut self, across: [f32; 2], along: f32) {
        for axis in 0..2 {
            self.low[axis] -= across[axis];
            self.high[axis] += across[axis];
        }
        self.first += along;
    }
}

impl Projection {
    #[inline(always)]
    pub(crate) fn new(octant: Octant, center: [f32; 3], direction: [f32; 3]) -> Self {
        let axes @ [x, y, z] = permutation(octant.axis());
        // As in the watertight test, components too small to have a reciprocal count as 0.
        let direction = direction.map(|d| if d.abs() < f32::MIN_POSITIVE { d * 0.0 } else { d });
        let shear = [direction[x] / direction[z], direction[y] / direction[z]];
        let is_backward = octant.backward()[z] == 1;
        Self {
            axes,
            shear,
            is_backward,
            direction,
            center,
            size: Vec3::ZERO,
            doubt: f32::INFINITY,
            blur: Vec3::ZERO,
            blur_across: [0.0; 2],
        }
    }

    /// The projection for origins that may be off by `blur` along each axis.
    #[inline(always)]
    pub(crate) fn blurred(self, blur: Vec3) -> Self {
        let [x, y, z] = self.axes;
        // Slightly more, for the rounding of this sum.
        let across = |side: usize, axis: usize| (blur[axis] + self.shear[side].abs() * blur[z]) * 1.001;
        Self { blur, blur_across: [across(0, x), across(1, y)], ..self }
    }

    /// Computes the bounds that depend on how far origins and the scene reach from the centre, and grows the zones by the rounding errors
    /// and by the error of the origins. Returns false if products of coordinates might overflow.
    #[inline(always)]
    pub(crate) fn settle(&mut self, scene: &Bounds, seen: &mut [ProjectedRays]) -> bool {
        self.size = seen.iter().fold(Vec3::ZERO, |size, seen| size.max(seen.size())) + self.blur;
        let center = Vec3::from_array(self.center);
        let reach = (scene.low - center).abs().max((scene.high - center).abs()) + self.size;
        self.doubt = reach.element_sum() * (DOUBT * UNIT_ROUNDOFF);
        let reach = reach.max_element();
        for seen in seen {
            let rounding = reach * (COORDINATE_UNITS * UNIT_ROUNDOFF) + TINY;
            let along = rounding + self.blur[self.axes[2]];
            let across = self.blur_across.map(|blur| rounding + blur);
            seen.zone.pad(across, if self.is_backward { along } else { -along });
        }
        reach <= LARGEST_COORDINATE
    }

    #[inline(always)]
    pub(crate) fn packet<S: Simd>(&self, simd: S, packet: &Packet, valid: Mask) -> ProjectedRays {
        let mut origin = [simd.wide_splat(0.0); 3];
        for axis in 0..3 {
            let from = simd.wide_load(&F16(packet.origin[axis]));
            origin[axis] = simd.wide_sub(from, simd.wide_splat(self.center[axis]));
        }
        self.rays(simd, origin, valid)
    }

    /// Projects rays whose origins are relative to the centre.
    #[inline(always)]
    pub(crate) fn rays<S: Simd>(&self, simd: S, mut origin: [S::Wide; 3], valid: Mask) -> ProjectedRays {
        let zero = simd.wide_splat(0.0);
        let (x_low, x_high) = reach(simd, origin[0], valid);
        let (y_low, y_high) = reach(simd, origin[1], valid);
        let (z_low, z_high) = reach(simd, origin[2], valid);
        for axis in 0..3 {
            origin[axis] = simd.wide_select(valid, origin[axis], zero);
        }
        let [x, y, z] = self.axes;
        let across = |side: usize, axis: usize| {
            let moved = simd.wide_mul(origin[z], simd.wide_splat(self.shear[side]));
            simd.wide_sub(origin[axis], moved)
        };
        let (a, b) = (across(0, x), across(1, y));
        let ((a_low, a_high), (b_low, b_high)) = (reach(simd, a, valid), reach(simd, b, valid));
        // Selected component by component: a vector load that follows scalar stores to the same array would stall.
        let of_z = |at_x: f32, at_y: f32, at_z: f32| match z {
            0 => at_x,
            1 => at_y,
            _ => at_z,
        };
        let first = if self.is_backward { of_z(x_high, y_high, z_high) } else { of_z(x_low, y_low, z_low) };
        ProjectedRays {
            origin: [simd.wide_store(origin[0]), simd.wide_store(origin[1]), simd.wide_store(origin[2])],
            across: [simd.wide_store(a), simd.wide_store(b)],
            zone: Zone { low: [a_low, b_low], high: [a_high, b_high], first },
            low: [x_low, y_low, z_low],
            high: [x_high, y_high, z_high],
        }
    }

    /// The children of a node that rays of a zone may enter.
    #[inline(always)]
    pub(crate) fn children<S: Simd>(&self, simd: S, node: &Node, zone: &Zone) -> Mask {
        let [x, y, z] = self.axes;
        let [low, high] = node.load(simd);
        let center = simd.splat(self.center[z]);
        let (from, to) = (simd.sub(low[z], center), simd.sub(high[z], center));
        let mut lanes = self.ahead(simd, from, to, zone);
        for (side, axis) in [x, y].into_iter().enumerate() {
            let (center, shear) = (simd.splat(self.center[axis]), simd.splat(self.shear[side]));
            let (from, to) = (simd.mul(from, shear), simd.mul(to, shear));
            let (less, more) = if self.shear[side] < 0.0 { (to, from) } else { (from, to) };
            let least = simd.sub(simd.sub(low[axis], center), more);
            let most = simd.sub(simd.sub(high[axis], center), less);
            lanes &= simd.at_most(least, simd.splat(zone.high[side])) & simd.at_most(simd.splat(zone.low[side]), most);
        }
        lanes
    }

    /// The lanes that do not lie behind the origins of all rays.
    #[inline(always)]
    fn ahead<S: Simd>(&self, simd: S, low: S::Vector, high: S::Vector, zone: &Zone) -> Mask {
        let first = simd.splat(zone.first);
        if self.is_backward { simd.at_most(low, first) } else { simd.at_most(first, high) }
    }

    /// The triangles of a leaf that rays of a zone may hit.
    #[inline(always)]
    pub(crate) fn triangles<S: Simd>(&self, simd: S, leaf: &Leaf, zone: &Zone) -> Mask {
        let [x, y, z] = self.axes;
        let zero = simd.splat(0.0);
        let mut corners = [[zero; 3]; 3];
        for axis in 0..3 {
            let [a, b, c] = leaf.coordinates(simd, axis);
            let center = simd.splat(self.center[axis]);
            corners[axis] = [simd.sub(a, center), simd.sub(b, center), simd.sub(c, center)];
        }
        let [a, b, c] = corners[z];
        let mut lanes = self.ahead(simd, simd.min_or(simd.min_or(a, b), c), simd.max_or(simd.max_or(a, b), c), zone);
        for (side, axis) in [x, y].into_iter().enumerate() {
            let shear = simd.splat(self.shear[side]);
            let a = simd.sub(corners[axis][0], simd.mul(corners[z][0], shear));
            let b = simd.sub(corners[axis][1], simd.mul(corners[z][1], shear));
            let c = simd.sub(corners[axis][2], simd.mul(corners[z][2], shear));
            let least = simd.min_or(simd.min_or(a, b), c);
            let most = simd.max_or(simd.max_or(a, b), c);
            lanes &= simd.at_most(least, simd.splat(zone.high[side])) & simd.at_most(simd.splat(zone.low[side]), most);
        }
        lanes
    }
}

/// The least and the greatest of the numbers in the lanes `of`.
#[inline(always)]
fn reach<S: Simd>(simd: S, numbers: S::Wide, of: Mask) -> (f32, f32) {
    let low = simd.wide_select(of, numbers, simd.wide_splat(f32::INFINITY));
    let high = simd.wide_select(of, numbers, simd.wide_splat(f32::NEG_INFINITY));
    (simd.wide_least(low), simd.wide_most(high))
}

/// Sixteen triangles, projected along the direction.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ProjectedTriangles {
    low: [F16; 2],
    high: [F16; 2],
    /// Normals of the edges, pointing inward.
    edge: [[F16; 2]; 3],
    /// With `n` the normal of an edge and `p` a projected origin: if `n · p < outside` for any edge, the ray misses the triangle; if
    /// `n · p > inside` for all edges, its line passes through the triangle.
    outside: [F16; 3],
    inside: [F16; 3],
    /// Normals of the planes, with the sign for which `n · direction > 0`.
    normal: [F16; 3],
    /// With `n` this normal and `o` an origin: if `n · o > beyond`, the ray starts beyond the plane and misses the triangle; if
    /// `n · o < before`, it starts before the plane. Infinite where that is never certain.
    beyond: F16,
    before: F16,
}

impl ProjectedTriangles {
    pub(crate) const EMPTY: Self = Self {
        low: [F16::ZERO; 2],
        high: [F16::ZERO; 2],
        edge: [[F16::ZERO; 2]; 3],
        outside: [F16::ZERO; 3],
        inside: [F16::ZERO; 3],
        normal: [F16::ZERO; 3],
        beyond: F16::ZERO,
        before: F16::ZERO,
    };

    /// Projects sixteen triangles, given as `[corner][axis]`; `opaque` says which of them stop every ray that meets them.
    ///
    /// Let `S` be the largest coordinate of corners and origins relative to the centre, and `D` the extent of triangle and zone, summed
    /// over both axes. A projected corner is `q = (x - sx z, y - sy z)`, with an error of `E = COORDINATE_UNITS u S` an axis. The bounds
    /// are those of the corners, grown by `E`. The edge from `q` to `r` has the normal `n = (q.y - r.y, r.x - q.x)`, with the sign for
    /// which it points towards the third corner `s`. Its function `n · p` errs by `F = EDGE_UNITS u S D`, plus `|n| · b` where origins are
    /// only known within `b`. So
    ///
    /// * `outside = min(n · q, n · r, n · s) - F - |n| · b`,
    /// * `inside = max(n · q, n · r) + F + |n| · b`.
    #[inline(always)]
    pub(crate) fn new<S: Simd>(
        simd: S,
        view: &Projection,
        zone: &Zone,
        triangles: &[[&F16; 3]; 3],
        opaque: Mask,
    ) -> Self {
        let zero = simd.wide_splat(0.0);
        let unit = simd.wide_splat(UNIT_ROUNDOFF);
        let mut corners = [[zero; 3]; 3];
        let mut size = zero;
        for corner in 0..3 {
            for axis in 0..3 {
                let at = simd.wide_sub(simd.wide_load(triangles[corner][axis]), simd.wide_splat(view.center[axis]));
                corners[corner][axis] = at;
                size = simd.wide_max_or(simd.wide_abs(at), size);
            }
        }
        let error = simd.wide_mul(simd.wide_add(size, simd.wide_splat(view.size.max_element())), unit);
        let mut outlines = Self::EMPTY;
        let [x, y, z] = view.axes;
        let mut at = [[zero; 2]; 3];
        let mut extent = zero;
        let pad = simd.wide_about_mul_add(error, simd.wide_splat(COORDINATE_UNITS), simd.wide_splat(TINY));
        for (side, axis) in [x, y].into_iter().enumerate() {
            for corner in 0..3 {
                let moved = simd.wide_mul(corners[corner][z], simd.wide_splat(view.shear[side]));
                at[corner][side] = simd.wide_sub(corners[corner][axis], moved);
            }
            let [a, b, c] = [at[0][side], at[1][side], at[2][side]];
            let low = simd.wide_sub(simd.wide_min_or(simd.wide_min_or(a, b), c), pad);
            let high = simd.wide_add(simd.wide_max_or(simd.wide_max_or(a, b), c), pad);
            outlines.low[side] = simd.wide_store(low);
            outlines.high[side] = simd.wide_store(high);
            let least = simd.wide_min_or(low, simd.wide_splat(zone.low[side]));
            let most = simd.wide_max_or(high, simd.wide_splat(zone.high[side]));
            extent = simd.wide_add(extent, simd.wide_sub(most, least));
        }
        let edge_error = simd.wide_mul(simd.wide_mul(error, extent), simd.wide_splat(EDGE_UNITS));
        let edge_error = simd.wide_add(edge_error, simd.wide_splat(TINY));
        for edge in 0..3 {
            let (from, to, other) = (at[edge], at[(edge + 1) % 3], at[(edge + 2) % 3]);
            let normal = [simd.wide_sub(from[1], to[1]), simd.wide_sub(to[0], from[0])];
            let across = [simd.wide_sub(other[0], from[0]), simd.wide_sub(other[1], from[1])];
            let turned = simd.wide_below(dot(simd, normal, across), zero);
            let normal = [
                simd.wide_select(turned, simd.wide_sub(zero, normal[0]), normal[0]),
                simd.wide_select(turned, simd.wide_sub(zero, normal[1]), normal[1]),
            ];
            let (a, b, c) = (dot(simd, normal, from), dot(simd, normal, to), dot(simd, normal, other));
            let least = simd.wide_min_or(simd.wide_min_or(a, b), c);
            let mut error = edge_error;
            for side in 0..2 {
                let blur = simd.wide_splat(view.blur_across[side]);
                error = simd.wide_about_mul_add(simd.wide_abs(normal[side]), blur, error);
            }
            outlines.edge[edge] = [simd.wide_store(normal[0]), simd.wide_store(normal[1])];
            outlines.outside[edge] = simd.wide_store(simd.wide_sub(least, error));
            outlines.inside[edge] = simd.wide_store(simd.wide_add(simd.wide_max_or(a, b), error));
        }
        outlines.set_plane(simd, view, triangles, corners[0], opaque);
        outlines
    }

    /// Sets the plane: its normal, and the bounds on heights of origins.
    ///
    /// Let `e` and `f` be edges of the triangle, `a` its first corner relative to the centre, `d` the direction, and let origins be up to
    /// `s` from the centre, known within `b`. The normal is `n = e x f`; along each axis it errs by `H = HEIGHT_UNITS u (|e f'| + |e' f|)`,
    /// from the two products whose difference it is. Then, summed over the axes,
    ///
    /// * the height `n · (o - a)` errs by at most `h = H · (|a| + s) + |n| · b`,
    /// * the slope `n · d` errs by at most `H · |d|`; if the slope is smaller, the ray may be parallel to the plane, and nothing is
    ///   certain.
    ///
    /// With the sign of `n` for which `n · d > 0`: `beyond = n · a + h`, and `before = n · a - h - max |n| doubt`, where `doubt` is the
    /// error of the distance test (`DOUBT` in `rounding.rs`).
    #[inline(always)]
    fn set_plane<S: Simd>(
        &mut self,
        simd: S,
        view: &Projection,
        triangles: &[[&F16; 3]; 3],
        corner: [S::Wide; 3],
        opaque: Mask,
    ) {
        let zero = simd.wide_splat(0.0);
        // Edges from the original corners: relative to the centre, corners are rounded.
        let mut edges = [[zero; 3]; 2];
        for axis in 0..3 {
            let from = simd.wide_load(triangles[0][axis]);
            edges[0][axis] = simd.wide_sub(simd.wide_load(triangles[1][axis]), from);
            edges[1][axis] = simd.wide_sub(simd.wide_load(triangles[2][axis]), from);
        }
        let (mut normal, mut slope, mut longest) = ([zero; 3], zero, zero);
        let (mut of_height, mut of_slope) = (simd.wide_splat(TINY), simd.wide_splat(TINY));
        for axis in 0..3 {
            let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
            let (a, b) = (simd.wide_mul(edges[0][next], edges[1][last]), simd.wide_mul(edges[0][last], edges[1][next]));
            normal[axis] = simd.wide_sub(a, b);
            let error = simd.wide_add(simd.wide_abs(a), simd.wide_abs(b));
            let error = simd.wide_mul(error, simd.wide_splat(HEIGHT_UNITS * UNIT_ROUNDOFF));
            let distance = simd.wide_add(simd.wide_abs(corner[axis]), simd.wide_splat(view.size[axis]));
            of_height = simd.wide_about_mul_add(error, distance, of_height);
            let blur = simd.wide_splat(view.blur[axis]);
            of_height = simd.wide_about_mul_add(simd.wide_abs(normal[axis]), blur, of_height);
            let direction = view.direction[axis];
            of_slope = simd.wide_about_mul_add(error, simd.wide_splat(direction.abs()), of_slope);
            slope = simd.wide_about_mul_add(normal[axis], simd.wide_splat(direction), slope);
            longest = simd.wide_max_or(simd.wide_abs(normal[axis]), longest);
        }
        let turned = simd.wide_below(slope, zero);
        let mut offset = zero;
        for axis in 0..3 {
            let turned = simd.wide_select(turned, simd.wide_sub(zero, normal[axis]), normal[axis]);
            offset = simd.wide_about_mul_add(turned, corner[axis], offset);
            self.normal[axis] = simd.wide_store(turned);
        }
        // Where this is false, a ray may be parallel to the plane, or a number is NaN, and nothing is certain.
        let decides = simd.wide_below(of_slope, simd.wide_abs(slope));
        let beyond = simd.wide_add(offset, of_height);
        let of_hit = simd.wide_mul(longest, simd.wide_splat(view.doubt));
        let before = simd.wide_sub(simd.wide_sub(offset, of_height), of_hit);
        self.beyond = simd.wide_store(simd.wide_select(decides, beyond, simd.wide_splat(f32::INFINITY)));
        self.before = simd.wide_store(simd.wide_select(decides & opaque, before, simd.wide_splat(f32::NEG_INFINITY)));
    }

    /// The triangles that the rays of a packet may hit.
    #[inline(always)]
    pub(crate) fn meeting<S: Simd>(&self, simd: S, seen: &ProjectedRays) -> Mask {
        let zone = &seen.zone;
        let low = [simd.wide_splat(zone.low[0]), simd.wide_splat(zone.low[1])];
        let high = [simd.wide_splat(zone.high[0]), simd.wide_splat(zone.high[1])];
        let mut apart = NO_LANES;
        for side in 0..2 {
            apart |= simd.wide_below(high[side], simd.wide_load(&self.low[side]));
            apart |= simd.wide_below(simd.wide_load(&self.high[side]), low[side]);
        }
        for edge in 0..3 {
            let mut most = simd.wide_splat(0.0);
            for side in 0..2 {
                let normal = simd.wide_load(&self.edge[edge][side]);
                let farther = simd.wide_max_or(simd.wide_mul(normal, low[side]), simd.wide_mul(normal, high[side]));
                most = simd.wide_add(most, farther);
            }
            apart |= simd.wide_below(most, simd.wide_load(&self.outside[edge]));
        }
        // Lower bound of `n · o` over all origins.
        let mut least = simd.wide_splat(0.0);
        for axis in 0..3 {
            let normal = simd.wide_load(&self.normal[axis]);
            let low = simd.wide_mul(normal, simd.wide_splat(seen.low[axis]));
            let high = simd.wide_mul(normal, simd.wide_splat(seen.high[axis]));
            least = simd.wide_add(least, simd.wide_min_or(low, high));
        }
        !(apart | simd.wide_below(simd.wide_load(&self.beyond), least))
    }

    /// The rays that a triangle certainly stops, and the rays that it may stop.
    #[inline(always)]
    pub(crate) fn stops<S: Simd>(&self, simd: S, lane: usize, seen: &ProjectedRays, open: Mask) -> (Mask, Mask) {
        let mut height = simd.wide_splat(0.0);
        for axis in 0..3 {
            let normal = simd.wide_splat(self.normal[axis].0[lane]);
            height = simd.wide_about_mul_add(normal, simd.wide_load(&seen.origin[axis]), height);
        }
        let mut possible = open & !simd.wide_below(simd.wide_splat(self.beyond.0[lane]), height);
        let at = [simd.wide_load(&seen.across[0]), simd.wide_load(&seen.across[1])];
        let mut inside = !NO_LANES;
        for edge in 0..3 {
            let [a, b] = &self.edge[edge];
            let inward = dot(simd, [simd.wide_splat(a.0[lane]), simd.wide_splat(b.0[lane])], at);
            possible &= !simd.wide_below(inward, simd.wide_splat(self.outside[edge].0[lane]));
            inside &= simd.wide_below(simd.wide_splat(self.inside[edge].0[lane]), inward);
        }
        let certain = possible & inside & simd.wide_below(height, simd.wide_splat(self.before.0[lane]));
        (certain, possible & !certain)
    }
}

#[inline(always)]
fn dot<S: Simd>(simd: S, [a, b]: [S::Wide; 2], [x, y]: [S::Wide; 2]) -> S::Wide {
    simd.wide_about_mul_add(b, y, simd.wide_mul(a, x))
}
