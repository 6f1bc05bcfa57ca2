//! The report's plots, drawn by plotters as SVG whose colours follow the page: light, dark or printed.

mod bars;
mod canvas;
mod graph;
mod scaling;
mod speed;
mod threads;

pub use bars::frame_bars;
pub use graph::pass_graph;
pub use scaling::{Fit, fit, scaling_plot};
pub use speed::speed_against_error;
pub use threads::threads_plot;

/// A finished plot.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Plot {
    /// An `svg` element for the page; its colours are the page's CSS variables.
    pub inline: String,
    /// The same plot as a file of its own.
    pub file: String,
}
