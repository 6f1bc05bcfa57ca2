//! The query for which rays of a storage buffer are traced.

/// Which hit of a ray is wanted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Query {
    /// The closest hit.
    #[default]
    Closest,
    /// Any hit, for rays of which it only matters whether they hit something: the search ends at the first hit that it finds. The backend
    /// chooses the hit, independent of the number of threads.
    Any,
}
