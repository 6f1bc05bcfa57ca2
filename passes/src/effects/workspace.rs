//! Buffers and counts that a worker keeps from pixel to pixel.

use super::deferred_shadows;
use super::sun::DiscRays;
use super::tile_surfaces::TileSurfaces;
use crate::trace::{Candidates, Directions, Hit};
use curitiba_pipeline::backend::RayCounts;
use glam::Vec3;

/// Buffers that a worker keeps from pixel to pixel, and its counts.
#[derive(Debug, Default)]
pub struct Workspace {
    /// Rays traced.
    pub rays: RayCounts,
    /// Place of the current pixel in its tile: row by row, [`TILE`](super::TILE) places a row.
    pub place: usize,
    /// Results for the tile's pixels that were computed before the pixels themselves.
    pub surfaces: TileSurfaces,
    /// Results that were computed for a whole tile of `deferredShadows`.
    pub(super) shadows: deferred_shadows::Tile,
    pub(super) disc: DiscRays,
    pub(super) directions: Directions,
    /// The occlusion directions again as a list, for rays that are traced one by one.
    pub(super) loose: Vec<Vec3>,
    pub(super) candidates: Candidates,
    pub(super) crossings: Vec<f32>,
    /// Distances of the clear panes that a shadow ray of a camera program crosses.
    pub(super) panes: Vec<f32>,
    /// Glass surfaces that a shadow ray crosses.
    pub(super) through: Vec<Hit>,
}

impl Workspace {
    /// Resets the counts, and forgets the results of the last tile, which may be of another pass.
    pub(crate) fn begin(&mut self) {
        self.rays = RayCounts::default();
        self.place = 0;
        self.surfaces.forget();
        self.shadows.forget();
    }
}
