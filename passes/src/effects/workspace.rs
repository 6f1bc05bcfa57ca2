//! What a worker keeps from pixel to pixel.

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
    /// The place of the pixel that is computed in its tile, row by row, [`TILE`](super::TILE) a row.
    pub place: usize,
    /// What is known of the tile's pixels before they are computed.
    pub surfaces: TileSurfaces,
    /// The same of a tile of the shadow program.
    pub(super) shadows: deferred_shadows::Tile,
    pub(super) disc: DiscRays,
    pub(super) directions: Directions,
    /// The same where rays are traced one by one.
    pub(super) loose: Vec<Vec3>,
    pub(super) candidates: Candidates,
    pub(super) crossings: Vec<f32>,
    /// The same of clear panes.
    pub(super) panes: Vec<f32>,
    /// Surfaces of glass that a shadow ray crosses.
    pub(super) through: Vec<Hit>,
}

impl Workspace {
    /// Forgets the pass before: its counts, and what was known of its last tile.
    pub(crate) fn begin(&mut self) {
        self.rays = RayCounts::default();
        self.place = 0;
        self.surfaces.forget();
        self.shadows.forget();
    }
}
