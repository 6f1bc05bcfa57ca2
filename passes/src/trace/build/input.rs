//! The triangles that a tree is built over.

use crate::trace::tree::{Bounds, TRANSPARENT};
use curitiba_pipeline::progress::Progress;
use curitiba_pipeline::scene::Geometry;
use glam::{Vec3, Vec3A};
use rayon::prelude::*;

/// Triangles that a thread takes at a time. Triangles of two such parts never become one leaf of the binary tree.
const GRAIN: usize = 8192;

/// The triangles of a scene that one tree holds, read where the scene stores them. A copy with all corners would be several times as large,
/// and neighbouring triangles of a leaf share vertices in the cache.
pub(crate) struct Triangles<'a> {
    geometry: &'a Geometry,
    /// For each material, whether it is transparent; empty if none is.
    transparent: &'a [bool],
    /// Whether the tree holds the triangles of the sky, instead of all others.
    of_sky: bool,
}

impl<'a> Triangles<'a> {
    /// All triangles but those of the sky.
    ///
    /// # Panics
    /// If there are 2³¹ triangles or more.
    pub(crate) fn new(geometry: &'a Geometry, transparent: &'a [bool]) -> Self {
        assert!(geometry.triangles.len() < TRANSPARENT as usize, "a tree holds fewer than 2^31 triangles");
        Self { geometry, transparent: if transparent.contains(&true) { transparent } else { &[] }, of_sky: false }
    }

    /// The triangles of the sky; `None` if there is none.
    pub(crate) fn sky(self) -> Option<Self> {
        (!self.geometry.sky.is_empty()).then_some(Self { of_sky: true, ..self })
    }

    /// Whether a triangle is in the tree.
    #[inline]
    fn is_in(&self, id: u32) -> bool {
        self.geometry.sky.contains(id) == self.of_sky
    }

    /// The corners of a triangle; NaN for a corner whose index is out of range.
    #[inline]
    pub(crate) fn corners(&self, id: u32) -> [Vec3; 3] {
        let [a, b, c] = self.geometry.triangles[id as usize];
        [*self.position(a), *self.position(b), *self.position(c)]
    }

    /// The corners of a triangle as vectors, loaded directly from the scene: a vector load that follows scalar stores to the same place
    /// would stall.
    #[inline]
    fn wide_corners(&self, id: u32) -> [Vec3A; 3] {
        let [a, b, c] = self.geometry.triangles[id as usize];
        [Vec3A::from(*self.position(a)), Vec3A::from(*self.position(b)), Vec3A::from(*self.position(c))]
    }

    /// The bounds of a triangle.
    #[inline]
    pub(crate) fn extent(&self, id: u32) -> Extent {
        Extent::of(self.wide_corners(id))
    }

    /// The bounds of some triangles.
    #[inline]
    pub(crate) fn bounds(&self, ids: &[u32]) -> Bounds {
        ids.iter().map(|id| self.extent(*id)).fold(Extent::EMPTY, Extent::union).bounds()
    }

    #[inline]
    fn position(&self, vertex: u32) -> &Vec3 {
        self.geometry.positions.get(vertex as usize).unwrap_or(&Vec3::NAN)
    }

    /// The id of a triangle; [`TRANSPARENT`] is set if its material is transparent.
    #[inline]
    pub(crate) fn marked(&self, id: u32) -> u32 {
        if !self.transparent.is_empty() && self.is_transparent(id) { id | TRANSPARENT } else { id }
    }

    fn is_transparent(&self, id: u32) -> bool {
        let batches = &self.geometry.batches;
        let next = batches.partition_point(|batch| batch.first <= id);
        let batch = next.checked_sub(1).map(|last| batches[last]).filter(|batch| id - batch.first < batch.count);
        batch.is_some_and(|batch| self.transparent.get(batch.material as usize) == Some(&true))
    }
}

/// A leaf of the binary tree: one triangle, or two with consecutive ids. The lowest bit says whether there is a second one; the other bits
/// are the id of the first.
#[derive(Debug, Clone, Copy)]
pub(crate) struct InputLeaf(u32);

impl InputLeaf {
    pub(crate) fn first(self) -> u32 {
        self.0 >> 1
    }

    pub(crate) fn count(self) -> u32 {
        (self.0 & 1) + 1
    }
}

/// What the first pass over all triangles finds.
pub(crate) struct Survey {
    /// Bounds of the kept triangles: those of the tree whose corners are all finite.
    pub(crate) bounds: Bounds,
    /// Number of kept triangles.
    pub(crate) triangles: usize,
    /// The kept triangles, as leaves of the binary tree.
    pub(crate) leaves: Vec<InputLeaf>,
}

impl Survey {
    /// Surveys all triangles. If wide leaves hold at least four triangles (`most`), two consecutive triangles become one leaf where they
    /// share an edge and `is_pair` accepts their joint box. The result does not depend on the number of threads, not even in the sign of a
    /// zero. `None` if cancelled, which is checked between the parts that threads take.
    pub(crate) fn new(triangles: &Triangles<'_>, most: usize, progress: &Progress) -> Option<Self> {
        let count = triangles.geometry.triangles.len();
        let part = |part: usize| {
            let ids = part * GRAIN..count.min((part + 1) * GRAIN);
            (!progress.is_cancelled()).then(|| Self::part(triangles, ids, most))
        };
        let parts = (0..count.div_ceil(GRAIN)).into_par_iter().map(part).collect::<Option<Vec<Self>>>()?;
        let mut all = Self { bounds: Bounds::EMPTY, triangles: 0, leaves: Vec::new() };
        all.leaves.reserve_exact(parts.iter().map(|part| part.leaves.len()).sum());
        for part in parts {
            all.bounds = all.bounds.union(part.bounds);
            all.triangles += part.triangles;
            all.leaves.extend_from_slice(&part.leaves);
        }
        Some(all)
    }

    fn part(triangles: &Triangles<'_>, ids: std::ops::Range<usize>, most: usize) -> Self {
        let mut leaves: Vec<InputLeaf> = Vec::with_capacity(ids.len());
        let (mut all, mut count) = (Extent::EMPTY, 0);
        // The previous triangle, if it was kept and is in no pair yet.
        let mut alone: Option<([Vec3A; 3], Extent)> = None;
        for id in ids {
            let corners = triangles.wide_corners(id as u32);
            // `x * 0` is NaN where a coordinate `x` is not finite.
            let [a, b, c] = corners;
            if a * 0.0 + b * 0.0 + c * 0.0 != Vec3A::ZERO || !triangles.is_in(id as u32) {
                alone = None;
                continue;
            }
            let own = Extent::of(corners);
            all = all.union(own);
            count += 1;
            if let Some((before, extent)) = &alone
                && most >= 4
                && is_pair(before, &corners, *extent, own)
                && let Some(last) = leaves.last_mut()
            {
                last.0 |= 1;
                alone = None;
            } else {
                leaves.push(InputLeaf((id as u32) << 1));
                alone = Some((corners, own));
            }
        }
        Self { bounds: all.bounds(), triangles: count, leaves }
    }
}

/// [`Bounds`] as vectors.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Extent {
    pub(crate) low: Vec3A,
    pub(crate) high: Vec3A,
}

impl Extent {
    pub(crate) const EMPTY: Self = Self { low: Vec3A::INFINITY, high: Vec3A::NEG_INFINITY };

    #[inline]
    fn of([a, b, c]: [Vec3A; 3]) -> Self {
        let of = |corner: Vec3A| Self { low: corner, high: corner };
        Self::EMPTY.union(of(a)).union(of(b)).union(of(c))
    }

    #[inline]
    pub(crate) fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    #[inline]
    pub(crate) fn bounds(self) -> Bounds {
        Bounds { low: self.low.into(), high: self.high.into() }
    }

    /// Half the surface area.
    #[inline]
    fn half_area(self) -> f32 {
        let size = self.high - self.low;
        let [x, y, z] = (size * Vec3A::new(size.y, size.z, size.x)).to_array();
        x + y + z
    }
}

/// Whether two triangles form one leaf: they share at least two corners, and the box around both has no more surface than their two boxes
/// together.
#[inline]
fn is_pair(first: &[Vec3A; 3], second: &[Vec3A; 3], own: Extent, other: Extent) -> bool {
    let shared = first.iter().filter(|corner| second.contains(corner)).count();
    shared >= 2 && own.union(other).half_area() <= (own.half_area() + other.half_area())
}
