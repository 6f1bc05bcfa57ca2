//! Panes: the pieces of glass that may get a cube map, and the choice of panes in a frame.

use super::bounds::{Bounds, Frustum};
use super::cube;
use super::proxy::{Eye, Proxy};
use curitiba_pipeline::backend::View;
use curitiba_pipeline::scene::{Geometry, TriangleRanges};
use glam::Vec3;
use rayon::prelude::*;

/// A connected piece of glass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pane {
    /// The box around the pane's triangles.
    pub bounds: Bounds,
    /// Number of the pane's triangles.
    pub triangles: u32,
}

/// Groups the triangles of glass materials into panes: triangles with a common corner position are in one pane. Panes
/// are ordered by their first triangle. Exact spheres are in no pane. Takes 16 bytes for each corner of a glass triangle, and as much again
/// while the corners are collected.
#[must_use]
pub fn find(geometry: &Geometry, glass: &[bool]) -> Vec<Pane> {
    let ranges = TriangleRanges::of_triangles(geometry, glass);
    let triangles: Vec<u32> = ranges.as_slice().iter().flat_map(|&[first, end]| first..end).collect();
    // Adding 0 turns -0 into 0.
    let key = |position: Vec3| position.to_array().map(|value| (value + 0.0).to_bits());
    let mut corners: Vec<([u32; 3], u32)> = triangles
        .par_iter()
        .enumerate()
        .flat_map_iter(|(index, triangle)| geometry.corners(*triangle).map(|corner| (key(corner), index as u32)))
        .collect();
    corners.par_sort_unstable();

    let mut sets = DisjointSets::new(triangles.len());
    for pair in corners.windows(2) {
        if pair[0].0 == pair[1].0 {
            sets.join(pair[0].1, pair[1].1);
        }
    }
    drop(corners);
    let mut pane_of_root = vec![u32::MAX; triangles.len()];
    let mut panes: Vec<Pane> = Vec::new();
    for (index, triangle) in triangles.iter().enumerate() {
        let pane = &mut pane_of_root[sets.root(index as u32) as usize];
        if *pane == u32::MAX {
            *pane = panes.len() as u32;
            panes.push(Pane { bounds: Bounds::EMPTY, triangles: 0 });
        }
        let pane = &mut panes[*pane as usize];
        pane.bounds = geometry.corners(*triangle).into_iter().fold(pane.bounds, Bounds::with);
        pane.triangles += 1;
    }
    panes
}

/// A union-find structure (Galler and Fischer 1964), with path halving; the root is the lowest member.
struct DisjointSets(Vec<u32>);

impl DisjointSets {
    fn new(len: usize) -> Self {
        Self((0..len as u32).collect())
    }

    fn root(&mut self, mut member: u32) -> u32 {
        while self.0[member as usize] != member {
            let parent = self.0[member as usize];
            self.0[member as usize] = self.0[parent as usize];
            member = self.0[member as usize];
        }
        member
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

/// The viewpoint of a cube map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Probe {
    /// The centre of the pane's box.
    pub center: Vec3,
    /// Nearest distance drawn: a thousandth of the pane's radius, so that the surfaces that the pane touches are seen.
    pub near: f32,
    /// Farthest distance drawn: beyond the scene.
    pub far: f32,
    /// The pane's box.
    pub bounds: Bounds,
    /// Index of the pane in the scene.
    pub pane: u32,
    /// The box that approximates the surroundings; `None` without parallax correction by boxes.
    pub proxy: Option<Proxy>,
}

impl Probe {
    /// The probe of a pane with box `pane`, in a scene with bounds `scene`.
    #[must_use]
    pub fn new(pane: &Bounds, scene: &Bounds) -> Self {
        let center = pane.center();
        let scale = center.abs().max_element();
        let farthest = (scene.max - center).max(center - scene.min).max(Vec3::ZERO).length();
        let far = (farthest * 1.01).max(scale * 1e-5).max(f32::MIN_POSITIVE * 1e12);
        let near = (pane.radius() * 1e-3).clamp(far * 1e-6, far * 0.5);
        Self { center, near, far, bounds: *pane, pane: 0, proxy: None }
    }

    /// The camera of a face, as [`cube::view`].
    ///
    /// # Panics
    /// If `face` is not below [`cube::FACES`].
    #[must_use]
    pub fn view(&self, face: usize) -> View {
        cube::view(face, self.center, self.near, self.far)
    }

    /// The viewpoint from which the probe's proxy is computed.
    #[must_use]
    pub fn eye(&self) -> Eye {
        let half = (self.bounds.max - self.bounds.min) * 0.5;
        Eye { center: self.center, near: self.near, far: self.far, half }
    }

    /// Direction in which the cube map is looked up, for a ray from the world position `place` along the unit vector
    /// `direction`.
    #[must_use]
    #[inline]
    pub fn toward(&self, place: Vec3, direction: Vec3) -> Vec3 {
        self.proxy.map_or(direction, |proxy| proxy.toward(place - self.center, direction))
    }
}

/// The probes of a frame; keeps its memory from frame to frame.
#[derive(Debug, Default)]
pub struct Probes {
    ranked: Vec<(f64, u32)>,
    chosen: Vec<Probe>,
}

impl Probes {
    /// Chooses up to `most` panes whose boxes cover the most area of the picture; panes out of view are never chosen.
    /// Equals are ranked in the order of the panes.
    pub fn choose(&mut self, panes: &[Pane], scene: &Bounds, camera: &View, most: u32) -> &[Probe] {
        self.ranked.clear();
        self.chosen.clear();
        if let Some(frustum) = Frustum::new(&camera.clip_from_world) {
            let areas = panes.iter().map(|pane| frustum.area_of(&pane.bounds, camera.eye));
            self.ranked.extend(areas.zip(0u32..).filter(|(area, _)| *area > 0.0));
        }
        self.ranked.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let best = self.ranked.iter().take(most as usize);
        let probe = |(_, pane): &(f64, u32)| Probe { pane: *pane, ..Probe::new(&panes[*pane as usize].bounds, scene) };
        self.chosen.extend(best.map(probe));
        &self.chosen
    }

    /// The probes chosen last.
    #[must_use]
    pub fn chosen(&self) -> &[Probe] {
        &self.chosen
    }

    /// The probes chosen last, mutable so that they can receive proxies.
    pub fn chosen_mut(&mut self) -> &mut [Probe] {
        &mut self.chosen
    }
}

/// Index of the probe whose pane's box is nearest to a position; the first of equals. `None` if there is no probe.
#[must_use]
#[inline]
pub fn nearest(probes: &[Probe], position: Vec3) -> Option<usize> {
    let distances = probes.iter().map(|probe| probe.bounds.distance_squared(position));
    distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).map(|(index, _)| index)
}
