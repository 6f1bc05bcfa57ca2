//! Chooses for each effect of a project raster or rays, and their settings, by measuring on this machine: the least error within a time,
//! or the least time within an error.
//!
//! 1. [`candidates`] lists what can stand in the place of each ray and effect pass.
//! 2. Each is measured with the other passes as they are declared ([`Machine`]).
//! 3. Where several passes have candidates, combinations are estimated from these times and errors, and the best few are measured.
//! 4. The first three by the goal are measured again in turns, until they stay the first three ([`search`]).

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

/// By slot, the index of the candidate that stands there.
pub type Variant = Vec<usize>;

/// What one run of a variant gave.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Times of whole frames, milliseconds by the clock.
    pub frames_ms: Vec<f64>,
    /// The picture's error; infinite if it has none.
    pub error: f64,
}

/// Renders variants: this machine, or one that a test makes up.
pub trait Machine {
    /// Renders some frames of a variant.
    ///
    /// # Errors
    /// Why this variant cannot be rendered or judged; others may be.
    fn run(&mut self, variant: &[usize]) -> Result<Run, String>;
}
