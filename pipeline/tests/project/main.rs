//! Projects and material libraries: what loads, and the messages about what does not.

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
