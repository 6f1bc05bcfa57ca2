//! How finely things are built for a wanted number of triangles.

/// The level of detail of everything that has a fixed share of the triangles. Paving, roof tiles and leaves take what
/// is left over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Detail {
    /// 0 up to 3.
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

    /// Whether a thing that appears at `tier` is built.
    pub(super) fn at_least(self, tier: u32) -> bool {
        self.tier >= tier
    }

    /// One level coarser.
    pub(super) fn lower(self) -> Self {
        Self { tier: self.tier.saturating_sub(1) }
    }

    /// Segments around a circle that has `usual` of them in the shipped scene; a multiple of four.
    pub(super) fn round(self, usual: u32) -> u32 {
        let wanted = match self.tier {
            0 => usual * 2 / 5,
            1 => usual,
            2 => usual * 2,
            _ => usual * 4,
        };
        wanted.max(4).next_multiple_of(4)
    }

    /// Pieces along a curve that has `usual` of them in the shipped scene.
    pub(super) fn curve(self, usual: u32) -> u32 {
        match self.tier {
            0 => (usual / 2).max(2),
            1 => usual,
            2 => usual * 2,
            _ => usual * 4,
        }
    }
}
