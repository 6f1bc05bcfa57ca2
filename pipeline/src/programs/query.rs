//! What is asked of the rays of a storage buffer.

/// Which of the hits of a ray is asked for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Query {
    /// The nearest.
    #[default]
    Closest,
    /// Any one, for rays of which only whether they hit something is read: the search ends at the first that it finds. Which one is the
    /// backend's choice, the same whatever the number of threads.
    Any,
}
