//! Eight ray origins at a time, bit for bit those of [`SurfacePoint`]; the vertices of sixteen triangles are gathered
//! for two such groups.

use super::surface_point::{Place, SurfacePoint, project};
use crate::trace::simd::{F8, F16, LANES, Mask, Simd, WIDE};
use glam::{DVec3, Vec3};

/// The vertex indices of sixteen triangles, `[corner][triangle]`.
///
/// # Panics
/// If there is no such triangle.
#[inline(always)]
pub(crate) fn vertices<S: Simd>(simd: S, triangles: &[[u32; 3]], of: &[u32; WIDE]) -> [[u32; WIDE]; 3] {
    let triangles: &[[f32; 3]] = bytemuck::cast_slice(triangles);
    let [a, b, c] = simd.gather(triangles, of);
    [bytemuck::cast(a.0), bytemuck::cast(b.0), bytemuck::cast(c.0)]
}

/// Values at the vertices of sixteen triangles, `[corner][axis]`.
///
/// # Panics
/// If there is no such vertex.
#[inline(always)]
pub(crate) fn at_vertices<S: Simd>(simd: S, values: &[Vec3], [a, b, c]: &[[u32; WIDE]; 3]) -> [[F16; 3]; 3] {
    let values: &[[f32; 3]] = bytemuck::cast_slice(values);
    [simd.gather(values, a), simd.gather(values, b), simd.gather(values, c)]
}

/// The first (0) or second (1) half of sixteen vectors.
#[inline(always)]
pub(crate) fn half_of<S: Simd>(simd: S, axes: &[F16; 3], half: usize) -> [S::Vector; 3] {
    let of = |axis: usize| F8(axes[axis].0.as_chunks().0[half]);
    [simd.load(&of(0)), simd.load(&of(1)), simd.load(&of(2))]
}

#[inline(always)]
pub(crate) fn double(axes: &[F16; 3], lane: usize) -> DVec3 {
    DVec3::new(axes[0].0[lane].into(), axes[1].0[lane].into(), axes[2].0[lane].into())
}

/// Points on eight triangles. Eight `f64` fill one vector, so intermediate values are not spilled to memory.
pub(crate) struct SurfacePoints {
    position: [F8; 3],
    normal: [F8; 3],
    error: F8,
    /// 1 where a point is certainly not near a border; else 0.
    inside: F8,
}

impl SurfacePoints {
    /// Projects positions onto triangles, for half 0 or 1 of sixteen. The corners are `[corner][axis]`; the positions
    /// lie near the triangles.
    #[inline(always)]
    pub(crate) fn snap([a, b, c]: &[[F16; 3]; 3], positions: &[F16; 3], half: usize) -> Self {
        let zero = F8([0.0; LANES]);
        let mut points = Self { position: [zero; 3], normal: [zero; 3], error: zero, inside: zero };
        for lane in 0..LANES {
            let of = half * LANES + lane;
            let corners = [double(a, of), double(b, of), double(c, of)];
            let place = Place::at(corners, project(corners, double(positions, of)));
            for axis in 0..3 {
                points.position[axis].0[lane] = place.position[axis] as f32;
                points.normal[axis].0[lane] = place.normal[axis] as f32;
            }
            points.error.0[lane] = place.error;
            points.inside.0[lane] = f32::from(u8::from(place.is_inside));
        }
        points
    }

    /// The point in a lane. It differs from [`SurfacePoint::snap`] where it may be [near a border](Self::near).
    #[inline(always)]
    pub(crate) fn point(&self, lane: usize) -> SurfacePoint {
        let at = |axes: &[F8; 3]| Vec3::new(axes[0].0[lane], axes[1].0[lane], axes[2].0[lane]);
        SurfacePoint::inside(at(&self.position), at(&self.normal), self.error.0[lane])
    }

    /// The normals of all eight points.
    #[inline(always)]
    pub(crate) fn normals<S: Simd>(&self, simd: S) -> [S::Vector; 3] {
        [simd.load(&self.normal[0]), simd.load(&self.normal[1]), simd.load(&self.normal[2])]
    }

    /// The positions of all eight points.
    #[inline(always)]
    pub(crate) fn positions<S: Simd>(&self, simd: S) -> [S::Vector; 3] {
        [simd.load(&self.position[0]), simd.load(&self.position[1]), simd.load(&self.position[2])]
    }

    /// Points that may be so near a border that rays start at another point.
    #[inline(always)]
    pub(crate) fn near<S: Simd>(&self, simd: S) -> Mask {
        simd.at_most(simd.load(&self.inside), simd.splat(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::simd::{Detected, InstructionSet, Kernel};
    use curitiba_pipeline::scene::{Batch, Geometry};

    struct Snap<'a> {
        geometry: &'a Geometry,
        triangles: &'a [u32; WIDE],
        positions: &'a [F16; 3],
    }

    impl Kernel<([SurfacePoints; 2], Mask)> for Snap<'_> {
        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> ([SurfacePoints; 2], Mask) {
            let vertices = vertices(simd, &self.geometry.triangles, self.triangles);
            let corners = at_vertices(simd, &self.geometry.positions, &vertices);
            let [low, high] =
                [SurfacePoints::snap(&corners, self.positions, 0), SurfacePoints::snap(&corners, self.positions, 1)];
            let near = low.near(simd) | high.near(simd) << LANES;
            ([low, high], near)
        }
    }

    /// The projections of positions onto triangles, bit for bit as by [`SurfacePoint::snap`].
    fn snap_by(
        simd: Detected,
        geometry: &Geometry,
        positions: &[(u32, Vec3)],
        mut each: impl FnMut(usize, SurfacePoint),
    ) {
        for (chunk, positions) in positions.chunks(WIDE).enumerate() {
            // Unused lanes of the last chunk repeat the first triangle.
            let (mut triangles, mut stored) = ([positions[0].0; WIDE], [F16::ZERO; 3]);
            for (lane, &(triangle, position)) in (0..WIDE).zip(positions) {
                triangles[lane] = triangle;
                // Component by component: a vector store followed by loads of other sizes would stall.
                for axis in 0..3 {
                    stored[axis].0[lane] = position[axis];
                }
            }
            let (points, near) = simd.run(Snap { geometry, triangles: &triangles, positions: &stored });
            for (lane, &(triangle, position)) in (0..WIDE).zip(positions) {
                let point = if near >> lane & 1 == 1 {
                    SurfacePoint::snap(geometry, triangle, position)
                } else {
                    points[lane / LANES].point(lane % LANES)
                };
                each(chunk * WIDE + lane, point);
            }
        }
    }

    #[test]
    fn points_snapped_together_are_those_snapped_one_by_one() {
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 8_388_608.0 - 1.0
        };
        let mut vector = move || Vec3::new(random(), random(), random());
        let mut geometry = Geometry::default();
        for index in 0..60 {
            let center = vector() * 10.0;
            let spread = if index % 10 == 9 { 0.0 } else { 1.0 };
            geometry.positions.extend([0, 1, 2].map(|_| center + vector() * spread));
            geometry.triangles.push([3 * index, 3 * index + 1, 3 * index + 2]);
        }
        geometry.batches.push(Batch { material: 0, first: 0, count: 60 });
        let mut positions: Vec<(u32, Vec3)> = (0..60).map(|t| (t, geometry.corners(t)[0] + vector() * 0.7)).collect();
        // Positions on a corner and on a border, where rays start inside; and one that is not finite.
        positions.extend((0..60).map(|t| (t, geometry.corners(t)[t as usize % 3])));
        positions.extend((0..60).map(|t| (t, geometry.corners(t)[0].midpoint(geometry.corners(t)[1]))));
        positions.push((3, Vec3::NAN));
        for simd in [InstructionSet::Avx512, InstructionSet::Avx2, InstructionSet::Portable]
            .into_iter()
            .filter_map(Detected::new)
        {
            let (mut seen, mut drawn) = (0, 0);
            snap_by(simd, &geometry, &positions, |index, point| {
                let (triangle, position) = positions[index];
                assert_eq!(point, SurfacePoint::snap(&geometry, triangle, position), "{simd:?} {index}");
                assert_eq!(index, seen);
                drawn += usize::from(point.is_drawn_in());
                seen += 1;
            });
            assert_eq!(seen, positions.len());
            assert!(drawn > 50, "{drawn}");
            snap_by(simd, &geometry, &[], |_, _| panic!("there is none"));
        }
    }

    #[test]
    fn points_that_are_not_near_a_border_start_where_they_are() {
        let mut geometry = Geometry::default();
        geometry.positions.extend([Vec3::new(100.0, 2.0, 0.0), Vec3::new(101.0, 2.0, 0.0), Vec3::new(100.0, 2.0, 1.0)]);
        geometry.triangles.push([0, 1, 2]);
        geometry.batches.push(Batch { material: 0, first: 0, count: 1 });
        let (mut inside, mut near) = (0, 0);
        for step in 0..2000 {
            // Distances inside the border from a millionth of the triangle's size to a hundredth.
            let share = 10.0_f32.powf(-6.0 + 4.0 * step as f32 / 2000.0);
            let position = Vec3::new(100.0 + share, 2.0, 0.3);
            let mut stored = [F16::ZERO; 3];
            for axis in 0..3 {
                stored[axis] = F16([position[axis]; WIDE]);
            }
            let snap = Snap { geometry: &geometry, triangles: &[0; WIDE], positions: &stored };
            let (points, mask) = Detected::cached().run(snap);
            assert!(mask == 0 || mask == 0xffff, "{mask:b}");
            if mask == 0 {
                inside += 1;
                let exact = SurfacePoint::snap(&geometry, 0, position);
                assert_eq!(points[0].point(0), exact, "{share}");
            } else {
                near += 1;
            }
        }
        // The margin is 32 * 2^-24 * 101.5, about 2e-4 of this triangle, and counts twice.
        assert!((500..1500).contains(&inside) && near > 500, "{inside} {near}");
    }
}
