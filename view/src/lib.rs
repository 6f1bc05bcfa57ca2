//! A window on Curitiba's renderer.
//!
//! [`worker`] owns a renderer on a thread of its own and knows nothing of windows: commands go in, pictures and facts come out. [`app`] holds
//! what is shown, and [`draw`] draws it with egui. Nothing is drawn that a [`Renderer`](curitiba::pipeline::executor::Renderer) did not return.
#![forbid(unsafe_code)]

pub mod app;
pub mod args;
pub mod camera;
pub mod canvas;
pub mod theme;
pub mod worker;

mod texture;
mod ui;

pub use ui::draw;
