//! Level of detail for a wanted number of triangles.

/// Level of detail of the parts with a fixed share of the triangles. Paving, roof tiles and leaves use the triangles that remain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Detail {
    /// 0 (coarsest) to 3.
    pub tier: u32,
}

impl Detail {
    pub(super) fn of(triangles: u32) -> Self {
        let tier = match triangles {
            0..46_000 => 0,
            46_000..120_000 => 1,
            120_000..800_000 => 2,
            _ => 3,
        };
        Self { tier }
    }

    /// Whether a part that appears at level `tier` is built.
    pub(super) fn at_least(self, tier: u32) -> bool {
        self.tier >= tier
    }

    /// One level coarser.
    pub(super) fn lower(self) -> Self {
        Self { tier: self.tier.saturating_sub(1) }
    }

    /// Segments of a circle that has `usual` segments in the shipped scene; a multiple of four.
    pub(super) fn round(self, usual: u32) -> u32 {
        let wanted = match self.tier {
            0 => usual * 2 / 5,
            1 => usual,
            2 => usual * 2,
            _ => usual * 4,
        };
        wanted.max(4).next_multiple_of(4)
    }

    /// Pieces of a curve that has `usual` pieces in the shipped scene.
    pub(super) fn curve(self, usual: u32) -> u32 {
        match self.tier {
            0 => (usual / 2).max(2),
            1 => usual,
            2 => usual * 2,
            _ => usual * 4,
        }
    }
}
