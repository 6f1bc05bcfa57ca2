//! Blocks of up to eight triangles and the watertight test of one ray against all of them.

use super::Hit;
use super::lanes::{F8, LANES, Mask, NO_LANES, first_lane, without_first};
use super::query::Query;
use glam::Vec3;

/// Marks a triangle whose hits need the accept closure; the other bits are its id.
pub(super) const TRANSPARENT: u32 = 1 << 31;

/// Up to eight triangles, structure of arrays. Unused lanes hold NaN, which no comparison accepts.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct Block {
    /// `[corner][axis]`.
    corners: [[F8; 3]; 3],
    /// Triangle ids, with [`TRANSPARENT`].
    ids: [u32; LANES],
}

/// What the triangle test leaves in lanes for the few triangles that pass.
struct Sheared {
    /// Edge functions.
    edges: [F8; 3],
    /// Sheared corners `[corner][x, y]` and the distance along the main axis.
    corners: [[F8; 3]; 3],
}

impl Block {
    pub(super) const EMPTY: Self = Self { corners: [[F8([f32::NAN; LANES]); 3]; 3], ids: [0; LANES] };

    /// Puts a triangle into a lane.
    pub(super) fn set(&mut self, lane: usize, corners: [Vec3; 3], id: u32) {
        for (corner, position) in corners.iter().enumerate() {
            for axis in 0..3 {
                self.corners[corner][axis].0[lane] = position[axis];
            }
        }
        self.ids[lane] = id;
    }

    /// Copies a triangle of another block into a lane.
    #[inline(always)]
    pub(super) fn copy_lane(&mut self, lane: usize, other: &Block, from: usize) {
        for corner in 0..3 {
            for axis in 0..3 {
                self.corners[corner][axis].0[lane] = other.corners[corner][axis].0[from];
            }
        }
        self.ids[lane] = other.ids[from];
    }

    /// The lanes whose bounds meet a box.
    #[inline(always)]
    pub(super) fn overlapping(&self, low: &[f32; 3], high: &[f32; 3]) -> Mask {
        let [a, b, c] = &self.corners;
        let mut outside = F8::splat(0.0);
        for axis in 0..3 {
            let least = a[axis].min_or(b[axis]).min_or(c[axis]);
            let most = a[axis].max_or(b[axis]).max_or(c[axis]);
            outside = (least - F8::splat(high[axis])).max_or(F8::splat(low[axis]) - most).max_or(outside);
        }
        // The difference is 0, or NaN in unused lanes.
        (outside + (a[0] - a[0])).at_most(F8::splat(0.0))
    }

    /// The lanes whose triangle the whole line may meet, sign tests only.
    #[inline(always)]
    fn test(&self, query: &Query) -> (Mask, Sheared) {
        let [x, y, z] = query.axes;
        let [shear_x, shear_y, _] = query.shear.map(F8::splat);
        let origin = query.origin.map(F8::splat);
        let sheared = self.corners.each_ref().map(|corner| {
            let along = corner[z] - origin[z];
            [corner[x] - origin[x] - shear_x * along, corner[y] - origin[y] - shear_y * along, along]
        });
        let [[ax, ay, _], [bx, by, _], [cx, cy, _]] = sheared;
        let edges = [cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax];
        let least = edges[0].min_or(edges[1]).min_or(edges[2]);
        let most = edges[0].max_or(edges[1]).max_or(edges[2]);
        let zero = F8::splat(0.0);
        (zero.at_most(least) | most.at_most(zero), Sheared { edges, corners: sheared })
    }

    /// Shows `found` the hits of the block with `t_min < t <= t_limit`, and stops when it returns true.
    ///
    /// `found` gets the hit and whether its triangle is transparent, and returns whether to stop; `t_limit` is what it
    /// left. Returns whether it stopped.
    #[inline(always)]
    pub(super) fn intersect(
        &self,
        query: &Query,
        t_limit: &mut f32,
        mut found: impl FnMut(Hit, bool, &mut f32) -> bool,
    ) -> bool {
        let (mut lanes, sheared) = self.test(query);
        while lanes != NO_LANES {
            let lane = first_lane(lanes);
            lanes = without_first(lanes);
            let Some((t, u, v)) = self.solve(query, &sheared, lane, *t_limit) else { continue };
            let id = self.ids[lane];
            let hit = Hit { t, triangle: id & !TRANSPARENT, u, v };
            if found(hit, id & TRANSPARENT != 0, t_limit) {
                return true;
            }
        }
        false
    }

    /// Distance and barycentric coordinates in one lane that passed the sign tests.
    #[inline(always)]
    fn solve(&self, query: &Query, sheared: &Sheared, lane: usize, t_limit: f32) -> Option<(f32, f32, f32)> {
        let [a, b, c] = sheared.edges.map(|edge| edge.0[lane]);
        let along = [0, 1, 2].map(|corner| sheared.corners[corner][2].0[lane]);
        let (t, u, v) = if a == 0.0 || b == 0.0 || c == 0.0 {
            solve_exactly(sheared, lane, along, query.shear[2])?
        } else {
            let determinant = a + b + c;
            let t = (a * along[0] + b * along[1] + c * along[2]) * query.shear[2] / determinant;
            (t, b / determinant, c / determinant)
        };
        if !(t > query.t_min && t <= t_limit) {
            return None;
        }
        // A distance below the entry of the triangle's own bounds is a rounding error; without it, no box around the
        // triangle can be entered beyond its hit, and culling by distance never depends on the tree.
        let corners = [0, 1, 2].map(|corner| [0, 1, 2].map(|axis| self.corners[corner][axis].0[lane]));
        let entry = query.entry(&corners);
        Some((if t < entry { entry } else { t }, u, v))
    }
}

/// The edge functions in `f64`, where products of `f32` are exact and the sign of their difference is right: what makes
/// shared edges and vertices watertight. A rounded difference of rounded products has the right sign unless it is zero.
#[cold]
#[inline(never)]
fn solve_exactly(sheared: &Sheared, lane: usize, along: [f32; 3], scale: f32) -> Option<(f32, f32, f32)> {
    let [[ax, ay], [bx, by], [cx, cy]] =
        [0, 1, 2].map(|corner| [0, 1].map(|axis| f64::from(sheared.corners[corner][axis].0[lane])));
    let [a, b, c] = [cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax];
    let determinant = a + b + c;
    if (a < 0.0 || b < 0.0 || c < 0.0) && (a > 0.0 || b > 0.0 || c > 0.0) || determinant == 0.0 {
        return None;
    }
    let [az, bz, cz] = along.map(f64::from);
    let t = (a * az + b * bz + c * cz) / determinant * f64::from(scale);
    Some((t as f32, (b / determinant) as f32, (c / determinant) as f32))
}
