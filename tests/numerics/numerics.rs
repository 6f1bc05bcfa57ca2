//! Hard cases of floating point; each also runs a method that fails, as a control. See `docs/numerics.md`.

#[path = "../../passes/tests/trace_scenes/mod.rs"]
mod trace_scenes;

mod gbuffer;
mod glass;
mod intersection;
mod offsets;
mod sampling;
