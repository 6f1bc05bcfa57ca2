//! Projects and material libraries: contents that load, and messages about contents that do not.

mod camera;
mod dialects;
mod effects;
mod errors;
mod left_out;
mod lights;
mod passes;
mod real;
mod robust;
mod scenes;
mod support;
mod viewports;
