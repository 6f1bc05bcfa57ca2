//! Estimates of the light on a tile's pixels, made without the exact origins of their rays.

use super::sides::{ALL, dot, sides_of_corners, signs};
use crate::effects::tile::{Area, PART, PARTS, TILE, corner_of};
use crate::effects::{Coverage, Pass};
use crate::trace::{
    Estimates, Faces, Kernel, LANES, Mask, PACKET, Simd, Tracer, at_vertices, half_of, vector_at, vertices,
};
use curitiba_pipeline::backend::NO_TRIANGLE;
use curitiba_pipeline::scene::Geometry;
use glam::Vec3;

/// Greatest number of triangles that a tile with a [`Sketch`] may show.
const MOST: usize = 128;
/// Least cosine between triangle and light for which the lit side is certain.
const GRAZING: f32 = 1.0e-4;
/// Least distance of the viewer from a triangle's plane for which the viewer's side is certain, relative to the size of
/// the coordinates: 32 units of rounding error.
const ASIDE: f32 = 32.0 / 16_777_216.0;

/// The sketch of a tile: its pixels, by part, and the triangles that they show.
#[derive(Debug)]
pub(super) struct Sketch {
    pub(super) estimates: Estimates,
    /// Whether any pixel has a usable estimate.
    pub(super) is_of_use: bool,
    /// One bit a pixel: pixels with a triangle and with a light cosine above 0, by the shading normal.
    pub(super) shown: [u16; PARTS],
    /// Shown pixels whose triangle is not in the list yet.
    left: [u16; PARTS],
    /// Pixels whose triangle faces away from the light.
    pub(super) dark: [u16; PARTS],
    /// The triangles that the tile shows; `faces` has their geometry, sixteen triangles a vector.
    triangles: [u32; MOST],
    faces: [Faces; MOST / PACKET],
    count: usize,
    /// For each triangle and part, one bit a pixel: the pixels that show the triangle.
    showing: [[u16; PARTS]; MOST],
}

impl Default for Sketch {
    #[expect(clippy::large_stack_arrays, reason = "made once a worker, which then keeps it on the heap")]
    fn default() -> Self {
        Self {
            estimates: Estimates::default(),
            is_of_use: false,
            shown: [0; PARTS],
            left: [0; PARTS],
            dark: [0; PARTS],
            triangles: [0; MOST],
            faces: [Faces::default(); MOST / PACKET],
            count: 0,
            showing: [[0; PARTS]; MOST],
        }
    }
}

/// Kernel that sketches a tile; returns false if the tile shows too many triangles or is cut off at the image's border.
pub(super) struct Draw<'a, T, C> {
    pub(super) sketch: &'a mut Sketch,
    pub(super) pass: &'a Pass<'a, T, C>,
    /// A reference, not a copy: a load of the whole struct stalls if its fields were just stored one by one.
    pub(super) area: &'a Area,
}

impl<T: Tracer, C: Coverage> Kernel<bool> for Draw<'_, T, C> {
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> bool {
        let Self { sketch, pass, area } = self;
        if area.width < TILE || area.height < TILE {
            return false;
        }
        sketch.is_of_use = false;
        if !sketch.find(simd, pass, area) {
            return false;
        }
        let Some(extent) = sketch.center(simd) else { return true };
        let eye = pass.job.eye;
        let light = pass.to_light;
        sketch.estimates.direction = light;
        let (mut dark, mut doubtful) = (0_u128, 0_u128);
        let mut error = Vec3::ZERO;
        for chunk in 0..sketch.count.div_ceil(PACKET) {
            let used = u32::MAX >> (32 - PACKET.min(sketch.count - chunk * PACKET));
            let scene = &pass.job.scene.geometry;
            let (turned, doubts) = sketch.triangles_of(simd, chunk, scene, (eye, light), extent);
            dark |= u128::from(turned & used) << (chunk * PACKET);
            doubtful |= u128::from(doubts & used) << (chunk * PACKET);
            let of = used & !turned & !doubts;
            error = error.max(sketch.faces[chunk].error(simd, of, sketch.estimates.center, extent));
        }
        sketch.estimates.error = error;
        for (index, showing) in sketch.showing[..sketch.count].iter().enumerate() {
            if dark >> index & 1 == 1 {
                for (dark, showing) in sketch.dark.iter_mut().zip(showing) {
                    *dark |= showing;
                }
            } else if doubtful >> index & 1 == 0 {
                let face = (&sketch.faces[index / PACKET], index % PACKET);
                sketch.is_of_use |= sketch.estimates.estimate(simd, showing, face);
            }
        }
        true
    }
}

impl Sketch {
    /// Lists the triangles that the pixels show; false if there are too many.
    #[inline(always)]
    fn find<S: Simd, T: Tracer, C: Coverage>(&mut self, simd: S, pass: &Pass<'_, T, C>, area: &Area) -> bool {
        (self.dark, self.estimates.valid) = ([0; PARTS], [0; PARTS]);
        let zero = simd.wide_splat(0.0);
        for part in 0..PARTS {
            let (right, down) = corner_of(part);
            let first = (area.y + down) * area.stride + area.x + right;
            let rows = [first, first + area.stride, first + 2 * area.stride, first + 3 * area.stride];
            for row in rows {
                if let Some(position) = pass.job.position.get(row + TILE) {
                    simd.prefetch(position);
                    if right == 0 {
                        simd.prefetch(&pass.job.triangle[row + TILE]);
                    }
                }
            }
            let [x, y, z, w] = simd.columns(four_each(pass.job.position, &rows));
            self.estimates.origin[part] = [x, y, z];
            let ids = simd.quarters(four_each(pass.job.triangle, &rows));
            self.estimates.triangle[part] = ids;
            let background = simd.wide_equal(&ids, NO_TRIANGLE);
            let shown = (simd.wide_below(zero, simd.wide_load(&w)) & !background) as u16;
            (self.shown[part], self.left[part]) = (shown, shown);
        }
        self.count = 0;
        for part in 0..PARTS {
            while self.left[part] != 0 {
                if self.count == MOST {
                    return false;
                }
                let id = self.estimates.triangle[part][self.left[part].trailing_zeros() as usize % PACKET];
                self.triangles[self.count] = id;
                // Earlier parts have no pixels left; to skip them would take a branch.
                for (part, left) in self.left.iter_mut().enumerate() {
                    let showing = *left & simd.wide_equal(&self.estimates.triangle[part], id) as u16;
                    self.showing[self.count][part] = showing;
                    *left &= !showing;
                }
                self.count += 1;
            }
        }
        true
    }

    /// Makes positions relative to one of them, the centre, and returns their largest distance from it for each axis;
    /// `None` if no pixel is shown.
    #[inline(always)]
    fn center<S: Simd>(&mut self, simd: S) -> Option<Vec3> {
        let part = self.shown.iter().position(|shown| *shown != 0)?;
        let center = vector_at(&self.estimates.origin[part], self.shown[part].trailing_zeros() as usize);
        self.estimates.center = center;
        let zero = simd.wide_splat(0.0);
        let mut extent = [zero; 3];
        for (origin, shown) in self.estimates.origin.iter_mut().zip(self.shown) {
            for (axis, origin) in origin.iter_mut().enumerate() {
                let from = simd.wide_sub(simd.wide_load(origin), simd.wide_splat(center[axis]));
                let from = simd.wide_select(Mask::from(shown), from, zero);
                *origin = simd.wide_store(from);
                extent[axis] = simd.wide_max_or(simd.wide_abs(from), extent[axis]);
            }
        }
        Some(Vec3::from_array(extent.map(|extent| simd.wide_most(extent))))
    }

    /// Prepares sixteen triangles. Returns the mask of those facing away from the light, and the mask of those for
    /// which that is uncertain.
    #[inline(always)]
    fn triangles_of<S: Simd>(
        &mut self,
        simd: S,
        chunk: usize,
        geometry: &Geometry,
        (eye, light): (Vec3, Vec3),
        extent: Vec3,
    ) -> (Mask, Mask) {
        // Fill unused lanes of the last sixteen with the first triangle.
        let first = self.triangles[0];
        self.triangles[self.count.min((chunk + 1) * PACKET)..(chunk + 1) * PACKET].fill(first);
        let ids = &self.triangles.as_chunks().0[chunk];
        let vertices = vertices(simd, &geometry.triangles, ids);
        let corners = at_vertices(simd, &geometry.positions, &vertices);
        let normals = (!geometry.normals.is_empty()).then(|| at_vertices(simd, &geometry.normals, &vertices));
        let faces = &mut self.faces[chunk];
        let (mut dark, mut doubtful) = (0, 0);
        for half in 0..2 {
            faces.set(&corners, half, light, (self.estimates.center, extent));
            let normal = half_of(simd, &faces.normal, half);
            let (above, below) = match &normals {
                Some(corners) => sides_of_corners(simd, normal, corners, half),
                None => {
                    let [a, b, c] = corners.each_ref().map(|corner| half_of(simd, corner, half));
                    eye_sides(simd, normal, [a, b, c], eye)
                }
            };
            let towards = dot(simd, normal, [simd.splat(light.x), simd.splat(light.y), simd.splat(light.z)]);
            let faces_light = simd.at_most(simd.splat(GRAZING), towards);
            dark |= (below & faces_light) << (half * LANES);
            doubtful |= (!((above | below) & faces_light) & ALL) << (half * LANES);
        }
        (dark, doubtful)
    }
}

/// Four consecutive values, from each of four first indices.
///
/// # Panics
/// If `values` is too short.
#[inline(always)]
fn four_each<'v, V>(values: &'v [V], [a, b, c, d]: &[usize; PART]) -> [&'v [V; PART]; PART] {
    let four = |first: usize| &values[first..first + PART].as_chunks().0[0];
    [four(*a), four(*b), four(*c), four(*d)]
}

/// The lanes where the viewer is clearly on the side of the triangle's normal, and those where it is clearly on the
/// other side.
#[inline(always)]
fn eye_sides<S: Simd>(simd: S, normal: [S::Vector; 3], corners: [[S::Vector; 3]; 3], eye: Vec3) -> (Mask, Mask) {
    let eye = eye.to_array().map(|eye| simd.splat(eye));
    let [a, ..] = corners;
    let to_eye = [simd.sub(eye[0], a[0]), simd.sub(eye[1], a[1]), simd.sub(eye[2], a[2])];
    let zero = simd.splat(0.0);
    let mut size = zero;
    for point in [eye].into_iter().chain(corners) {
        for coordinate in point {
            size = simd.add(size, simd.max_or(coordinate, simd.sub(zero, coordinate)));
        }
    }
    let (height, margin) = (dot(simd, normal, to_eye), simd.mul(size, simd.splat(ASIDE)));
    let (above, _) = signs(simd, simd.sub(height, margin));
    let (_, below) = signs(simd, simd.add(height, margin));
    (above, below)
}
