//! Hard cases of floating point, each with the method that fails beside ours: see `docs/numerics.md`.

#[path = "../../passes/tests/trace_scenes/mod.rs"]
mod trace_scenes;

mod gbuffer;
mod glass;
mod intersection;
mod offsets;
mod sampling;
