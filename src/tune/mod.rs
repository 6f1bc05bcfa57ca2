//! Chooses raster or rays for each effect of a project, and their settings, by measuring on this machine: the least error within a time, or the
//! least time within an error.
//!
//! 1. [`candidates`] lists the candidates for the place of each ray and effect pass.
//! 2. Each candidate is measured, with the other passes as they are declared ([`Machine`]).
//! 3. Where several passes have candidates, combinations are estimated from the times and errors of step 2, and those with the best estimates are
//!    measured.
//! 4. The best three by the goal are measured again in rounds, until they stay the best three ([`search`]).

pub mod candidates;
mod choose;
pub mod machine;
mod search;
#[cfg(test)]
mod tests;

pub use candidates::{Candidate, Slot, label};
pub use choose::{Goal, Trial, ranked};
pub use machine::Bench;
pub use search::{Found, search};

/// For each slot, the index of the chosen candidate.
pub type Variant = Vec<usize>;

/// Result of one run of a variant.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Wall times of whole frames, milliseconds.
    pub frames_ms: Vec<f64>,
    /// The picture's error; less is better.
    pub error: f64,
}

/// Renders variants: this machine, or a simulated one in tests.
pub trait Machine {
    /// Renders some frames of a variant.
    ///
    /// # Errors
    /// Why this variant cannot be rendered or judged; others may be.
    fn run(&mut self, variant: &[usize]) -> Result<Run, String>;
}
