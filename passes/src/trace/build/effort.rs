//! How much time the builder spends.

/// How much time [`Bvh::build`](crate::trace::Bvh::build) spends on the tree.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Quality {
    /// Builds fastest; for geometry that few rays are traced in.
    Fast,
    /// Least time for building and tracing together, measured for a frame of about ten million rays.
    #[default]
    Balanced,
    /// Slowest to build, fastest to trace; for geometry that many rays are traced in.
    Slow,
}

impl Quality {
    pub(crate) fn effort(self, triangles: usize) -> Effort {
        // Reinsertion searches the whole tree for each candidate, so the share of candidates shrinks as the tree grows.
        let share = |most: f32| (most / triangles.max(1) as f32).min(1.0);
        match self {
            Self::Fast => Effort { search: Search::One, threshold: 0, reinsertion: 0.0 },
            Self::Balanced => Effort { search: Search::Five, threshold: 0, reinsertion: 0.03 * share(4.0e5) },
            Self::Slow => Effort { search: Search::ThirtyTwo, threshold: 1, reinsertion: share(1.0e6) },
        }
    }
}

/// How many neighbours on each side, in the order of their Morton codes, the clustering looks at for the one to merge a node with. The clustering is
/// compiled for each number.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Search {
    One,
    /// With obvhs's own number, 6, building takes a fourteenth longer, and rays are no faster.
    Five,
    ThirtyTwo,
}

/// Parameters of obvhs's builder.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Effort {
    pub(crate) search: Search,
    /// Number of passes of the clustering, from the first on, that look at direct neighbours only.
    pub(crate) threshold: usize,
    /// Share of the nodes that the first pass of reinsertion tries to move to a better place; later passes try fewer.
    pub(crate) reinsertion: f32,
}
