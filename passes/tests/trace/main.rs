//! All tests of the tracer in one program, so that generic code is compiled once.

#[path = "../trace_scenes/mod.rs"]
mod trace_scenes;

mod agreement;
mod double;
mod hard_cases;
mod offset;
mod packets;
mod parallel;
mod together;
