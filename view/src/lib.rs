//! A window on Curitiba's renderer.
//!
//! [`worker`] owns a renderer on a thread of its own and does not depend on the window: it receives commands, and returns pictures and facts. Once
//! it knows the window's device, it uploads the pictures to the device. [`app`] holds the state of the window, and [`draw`] draws it with egui. All
//! that it shows of a project was returned by a [`Renderer`](curitiba::pipeline::executor::Renderer).
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
