//! One triangle against many rays from one origin, in vectors of rays: cheap, and sure of all but a few.
//!
//! Seen from a common origin a triangle is the cone of the three planes through the origin and its edges, and the plane it
//! lies in; a ray is tested by its dot products with their four normals. These are computed in `f32` with a bound on
//! how far they, and the watertight test of [`Block`](super::block::Block), can be from the truth. Where a product is farther
//! from 0 than that, both tests agree; the rays in between are put to the watertight test. So the result is the same, bit for
//! bit, as testing each ray by itself.

use super::lanes::{F16, Mask, NO_LANES, Simd, WIDE};
use super::query::UNIT_ROUNDOFF;
use glam::{DVec3, Vec3};

/// Vectors of rays that are tested together.
const VECTORS: usize = 8;
/// Rays that are tested together.
pub(super) const CHUNK: usize = VECTORS * WIDE;

/// Error of an edge function in units of roundoff times the largest coordinates of its two corners.
///
/// The watertight test shears a corner with an error of at most 5 u (|x| + |z|), that is 10 u M, M being its largest
/// coordinate relative to the origin; its products then err by 80 u M M' and their rounding by 16 u M M'. The dot product
/// here errs by 4 u times the sum of the magnitudes of its terms, at most 24 u M M'.
const EDGE_ERROR: f64 = 128.0 * UNIT_ROUNDOFF as f64;
/// Error of the dot product of a direction and a normal whose largest component is 1.
const PLANE_ERROR: f64 = 16.0 * UNIT_ROUNDOFF as f64;
/// Relative margin of distances, above the rounding of both tests.
const MARGIN: f64 = 1.0e-6;
/// Heights of the origin above a plane below this share of the coordinates are not told from 0.
const FLAT: f64 = 1.0e-12;
/// Coordinates between which the watertight test neither overflows nor underflows, so that its error is relative.
const SIZES: std::ops::Range<f64> = 1.0e-15..1.0e15;
/// Largest component of a direction that the bounds allow.
pub(super) const LONGEST: f32 = 1.0 + 1.0e-5;

/// Directions of up to [`CHUNK`] rays, structure of arrays, and which of them are still open.
pub(super) struct Rays {
    directions: [[F16; 3]; VECTORS],
    open: [Mask; VECTORS],
    vectors: usize,
}

impl Rays {
    /// # Panics
    /// If there are more than [`CHUNK`].
    #[inline(always)]
    pub(super) fn new(directions: &[Vec3]) -> Self {
        let mut rays = Self {
            directions: [[F16([0.0; WIDE]); 3]; VECTORS],
            open: [NO_LANES; VECTORS],
            vectors: directions.len().div_ceil(WIDE),
        };
        for (index, vector) in directions.chunks(WIDE).enumerate() {
            rays.open[index] = (1 << vector.len()) - 1;
            for (lane, direction) in vector.iter().enumerate() {
                for axis in 0..3 {
                    rays.directions[index][axis].0[lane] = direction[axis];
                }
            }
        }
        rays
    }

    /// How many are open.
    #[inline(always)]
    pub(super) fn count(&self) -> u32 {
        self.open[..self.vectors].iter().map(|open| open.count_ones()).sum()
    }

    /// Closes the rays that a triangle stops; `unsure` decides about those, by their index, for which its bounds do not.
    /// Returns whether any ray is left.
    #[inline(always)]
    pub(super) fn close<S: Simd>(&mut self, simd: S, facet: &Facet, mut unsure: impl FnMut(usize) -> bool) -> bool {
        let mut left = NO_LANES;
        for (index, (directions, open)) in self.directions.iter().zip(&mut self.open).take(self.vectors).enumerate() {
            if *open == NO_LANES {
                continue;
            }
            let Verdict { hit, miss } = facet.test(simd, directions);
            *open &= !hit;
            let mut undecided = *open & !miss;
            while undecided != NO_LANES {
                let lane = undecided.trailing_zeros();
                undecided &= undecided - 1;
                if unsure(index * WIDE + lane as usize) {
                    *open &= !(1 << lane);
                }
            }
            left |= *open;
        }
        left != NO_LANES
    }
}

/// What is certain of sixteen rays.
struct Verdict {
    hit: Mask,
    miss: Mask,
}

/// A triangle as rays from one origin see it.
pub(super) struct Facet {
    /// Normals of the planes through the origin and each edge, in units of their error.
    edges: [[f32; 3]; 3],
    /// Normal of the triangle, away from the origin, largest component 1.
    normal: [f32; 3],
    /// `direction · normal` up to which the plane is certainly met beyond `t_max`, if at all.
    beyond: f32,
    /// From which on it is certainly met before `t_max`.
    within: f32,
    /// Up to which it is certainly met after `t_min`.
    after: f32,
    /// Whether hits must be asked for one by one.
    transparent: bool,
}

impl Facet {
    /// Prepares a triangle. Where nothing can be said of it, as of a degenerate one, all rays are undecided.
    #[inline(always)]
    pub(super) fn new(corners: [[f32; 3]; 3], transparent: bool, origin: Vec3, t_min: f32, t_max: f32) -> Self {
        let origin = origin.as_dvec3();
        let [a, b, c] = corners.map(|corner| DVec3::from_array(corner.map(f64::from)) - origin);
        let size = [a, b, c].map(|corner| corner.abs().max_element());
        let bounded = size.iter().all(|size| SIZES.contains(size));
        let error = if bounded { EDGE_ERROR } else { f64::NAN };
        // One division an edge; its rounding is far below the bounds' margin.
        let edge = |from: DVec3, to: DVec3, scale: f64| (from.cross(to) * (1.0 / (error * scale))).as_vec3().to_array();
        let edges = [edge(b, c, size[1] * size[2]), edge(c, a, size[2] * size[0]), edge(a, b, size[0] * size[1])];
        let normal = (b - a).cross(c - a);
        let normal = normal * (1.0 / normal.abs().max_element());
        let height = normal.dot(a);
        let (normal, height) = if height < 0.0 { (-normal, -height) } else { (normal, height) };
        let (beyond, within, after) = if height > FLAT * size[0] {
            // Adding zero turns -0 into 0.
            let (least, most) = (height / f64::from(t_max), height / f64::from(t_min.max(0.0) + 0.0));
            (
                least * (1.0 - MARGIN) - PLANE_ERROR,
                least * (1.0 + MARGIN) + PLANE_ERROR,
                most * (1.0 - MARGIN) - PLANE_ERROR,
            )
        } else {
            (f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY)
        };
        Self {
            edges,
            normal: normal.as_vec3().to_array(),
            beyond: beyond as f32,
            within: within as f32,
            after: after as f32,
            transparent,
        }
    }

    /// What is certain of sixteen rays. Comparisons with what is not a number are false, so nothing is.
    #[inline(always)]
    fn test<S: Simd>(&self, simd: S, directions: &[F16; 3]) -> Verdict {
        let rays = [simd.wide_load(&directions[0]), simd.wide_load(&directions[1]), simd.wide_load(&directions[2])];
        let (a, b, c) =
            (dot(simd, rays, &self.edges[0]), dot(simd, rays, &self.edges[1]), dot(simd, rays, &self.edges[2]));
        let least = simd.wide_min_or(simd.wide_min_or(a, b), c);
        let most = simd.wide_max_or(simd.wide_max_or(a, b), c);
        let along = dot(simd, rays, &self.normal);
        let (one, minus_one) = (simd.wide_splat(1.0), simd.wide_splat(-1.0));
        let beside = simd.wide_at_most(least, minus_one) & simd.wide_at_most(one, most);
        // Nearly parallel rays are undecided: the watertight test may find them in a triangle that is seen edge-on.
        let parallel = PLANE_ERROR as f32;
        let away = simd.wide_at_most(along, simd.wide_splat(-parallel));
        let far = simd.wide_at_most(simd.wide_splat(parallel), along)
            & simd.wide_at_most(along, simd.wide_splat(self.beyond));
        let miss = beside | away | far;
        if self.transparent {
            return Verdict { hit: NO_LANES, miss };
        }
        let inside = simd.wide_at_most(one, least) | simd.wide_at_most(most, minus_one);
        let reached = simd.wide_at_most(simd.wide_splat(self.within), along)
            & simd.wide_at_most(along, simd.wide_splat(self.after));
        Verdict { hit: inside & reached, miss }
    }
}

#[inline(always)]
fn dot<S: Simd>(simd: S, [x, y, z]: [S::Wide; 3], normal: &[f32; 3]) -> S::Wide {
    let xy = simd.wide_about_mul_add(y, simd.wide_splat(normal[1]), simd.wide_mul(x, simd.wide_splat(normal[0])));
    simd.wide_about_mul_add(z, simd.wide_splat(normal[2]), xy)
}
