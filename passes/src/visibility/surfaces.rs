//! The triangles of a scene, prepared for pairs.

use super::points;
use super::tree::Tree;
use crate::trace::SurfacePoint;
use curitiba_pipeline::scene::{Geometry, TriangleRanges};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;

/// A triangle, prepared for pairs. Positions are relative to [`Surfaces::shift`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Surface {
    /// Corners of the moved triangle, whose points are the ends of segments: the triangle's corners, moved inward from the borders and off
    /// the front by their error bounds. The bounds are convex over the triangle, so every point between these corners is at least as far
    /// off as its own bound requires.
    pub(super) start: [Vec3; 3],
    /// Hash that chooses the triangle's sample points.
    pub(super) key: [u32; 2],
}

/// The triangles of a scene, with a tree over those that block.
///
/// Takes about 130 bytes a triangle, in addition to its copy of the geometry, which [`Self::geometry`] lends to the tracer.
#[derive(Debug)]
pub struct Surfaces {
    geometry: Geometry,
    see_through: TriangleRanges,
    see_through_materials: Vec<bool>,
    pub(super) all: Vec<Surface>,
    pub(super) tree: Tree,
    shift: Vec3,
    duplicates: usize,
}

impl Surfaces {
    /// Takes all triangles. Those of materials that `see_through` marks block nothing (materials beyond its end are opaque).
    ///
    /// A scene that lies far from the origin is moved to the origin if that is exact for every position. Rounding errors are then relative
    /// to the size of the scene and not to its place.
    #[must_use]
    pub fn new(geometry: &Geometry, see_through: &[bool]) -> Self {
        let shift = shift_of(&geometry.positions);
        let local = Geometry {
            positions: geometry.positions.iter().map(|position| *position - shift).collect(),
            triangles: geometry.triangles.clone(),
            batches: geometry.batches.clone(),
            ..Geometry::default()
        };
        let see_through_materials = see_through.to_vec();
        let see_through = TriangleRanges::new(geometry, see_through);
        let all = (0..local.triangles.len() as u32)
            .into_par_iter()
            .map(|id| surface(&local, id, geometry.corners(id).map(|corner| corner.to_array().map(f32::to_bits))))
            .collect();
        let tree = Tree::build(&local, |id| !see_through.contains(id));
        let duplicates = duplicates(geometry);
        Self { geometry: local, see_through, see_through_materials, all, tree, shift, duplicates }
    }

    /// The geometry to build a tracer on. Build it with [`Self::marks`], so that every material is transparent:
    /// [`Estimator`](super::Estimator) itself decides which hits count.
    #[must_use]
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// Flags to build a tracer with, one for each material: all are set, so that the tracer treats every material as transparent.
    #[must_use]
    pub fn marks(&self) -> Vec<bool> {
        let most = self.geometry.batches.iter().map(|batch| batch.material).max();
        vec![true; most.map_or(0, |most| most as usize + 1)]
    }

    /// For each material, whether its triangles block nothing; materials beyond the end of the list block.
    #[must_use]
    pub fn see_through_materials(&self) -> &[bool] {
        &self.see_through_materials
    }

    /// The offset that was subtracted from every position.
    #[must_use]
    pub fn shift(&self) -> Vec3 {
        self.shift
    }

    /// Number of triangles; valid ids are below it.
    #[must_use]
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// Whether there are no triangles.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Number of triangles with the same corners as an earlier one, in any order. Neither of such a pair blocks what the other sends, so
    /// their number is reported.
    #[must_use]
    pub fn duplicates(&self) -> usize {
        self.duplicates
    }

    /// Number of triangles that block nothing.
    #[must_use]
    pub fn see_through(&self) -> usize {
        self.see_through.as_slice().iter().map(|[first, end]| (end - first) as usize).sum()
    }

    /// Whether a triangle can block.
    pub(super) fn is_opaque(&self, triangle: u32) -> bool {
        !self.see_through.contains(triangle)
    }

    /// The area of a triangle, in the unit of the positions squared.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    pub fn area(&self, triangle: u32) -> f64 {
        let [a, b, c] = self.corners(triangle);
        0.5 * (b - a).cross(c - a).length()
    }

    /// Corners relative to the shift.
    pub(super) fn corners(&self, triangle: u32) -> [DVec3; 3] {
        self.geometry.corners(triangle).map(|corner| corner.as_dvec3())
    }
}

fn surface(local: &Geometry, id: u32, bits: [[u32; 3]; 3]) -> Surface {
    let corners = local.corners(id);
    let start = corners.map(|corner| {
        let point = SurfacePoint::snap(local, id, corner);
        point.spawn(point.normal)
    });
    Surface { start, key: points::key(&bits) }
}

/// The first position, if the scene is farther from the origin than twice its size and all positions can be expressed relative to it
/// without rounding; else 0.
fn shift_of(positions: &[Vec3]) -> Vec3 {
    let Some(&first) = positions.first() else { return Vec3::ZERO };
    let (low, high) = positions.iter().fold((first, first), |(low, high), p| (low.min(*p), high.max(*p)));
    let far = low.abs().max(high.abs()).max_element() > 2.0 * (high - low).max_element();
    let exact = |p: &Vec3| (*p - first).as_dvec3() + first.as_dvec3() == p.as_dvec3();
    if far && positions.iter().all(exact) { first } else { Vec3::ZERO }
}

fn duplicates(geometry: &Geometry) -> usize {
    let mut seen: HashMap<[[u32; 3]; 3], ()> = HashMap::with_capacity(geometry.triangles.len());
    let place = |id: u32| {
        // Adding 0 turns -0 into 0.
        let mut corners = geometry.corners(id).map(|corner| (corner + 0.0).to_array().map(f32::to_bits));
        corners.sort_unstable();
        corners
    };
    (0..geometry.triangles.len() as u32).filter(|id| seen.insert(place(*id), ()).is_some()).count()
}
