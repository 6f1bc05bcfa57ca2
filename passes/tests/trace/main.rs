//! Everything that the tracer answers, in one program: what is generic in it is compiled once.

#[path = "../trace_scenes/mod.rs"]
mod trace_scenes;

mod agreement;
mod double;
mod hard_cases;
mod offset;
mod packets;
mod parallel;
mod together;
