//! How much time the builder spends.

use obvhs::ploc::PlocSearchDistance;

/// How much time [`Bvh::build`](crate::trace::Bvh::build) spends on the tree.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Quality {
    /// For geometry that is traced little.
    Fast,
    /// What measured best over a frame of about ten million rays.
    #[default]
    Balanced,
    /// For geometry that is traced long.
    Slow,
}

impl Quality {
    pub(crate) fn effort(self, triangles: usize) -> Effort {
        // Reinsertion searches the whole tree for each candidate: its share shrinks where there are many.
        let share = |most: f32| (most / triangles.max(1) as f32).min(1.0);
        match self {
            Self::Fast => Effort { search: PlocSearchDistance::Minimum, threshold: 0, reinsertion: 0.0 },
            Self::Balanced => {
                Effort { search: PlocSearchDistance::Low, threshold: 0, reinsertion: 0.03 * share(4.0e5) }
            }
            Self::Slow => Effort { search: PlocSearchDistance::VeryHigh, threshold: 1, reinsertion: share(1.0e6) },
        }
    }
}

/// How much time to spend on the tree.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Effort {
    pub(crate) search: PlocSearchDistance,
    /// Passes that look at direct neighbours only.
    pub(crate) threshold: usize,
    /// Share of the nodes that are put elsewhere where that is better, in a first pass; later passes take fewer.
    pub(crate) reinsertion: f32,
}
