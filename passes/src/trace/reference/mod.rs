//! Two references in `f64` that share no code with the fast tracer, nor with each other's search.
//!
//! [`BruteForce`] tests every triangle; [`Double`] gives its answers from a tree of its own, fast enough for pictures.
//! May use: `tracer`, `ray`.

mod brute_force;
mod double;

pub use brute_force::BruteForce;
pub use double::{Double, DoubleHit, DoubleRay};
