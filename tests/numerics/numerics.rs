//! Hard cases of floating point. As a control, many tests also run a method that fails. See `docs/numerics.md`.

#[path = "../../passes/tests/trace_scenes/mod.rs"]
mod trace_scenes;

mod gbuffer;
mod glass;
mod intersection;
mod offsets;
mod sampling;
