//! Two reference tracers in `f64`. They share no code with the fast tracer, and their searches are independent of each other.
//!
//! [`BruteForce`] tests every triangle. [`Double`] gives the same results from a tree of its own, fast enough for pictures.
//! May use: `tracer`, `ray`.

mod brute_force;
mod double;

pub use brute_force::BruteForce;
pub use double::{Double, DoubleHit, DoubleRay};
