//! Observers of a renderer.

use super::engines::Fallback;
use super::output::{Output, Triangles};
use super::timeline::StepKind;
use crate::backend::RayJob;
use crate::image::Image;
use crate::progress::Progress;
use std::sync::Arc;

/// Notified when steps begin and end, to show progress, and of the outputs of passes, to inspect them.
pub trait Observer {
    /// A step begins. `progress` advances while it runs, if the step can report progress.
    fn begin(&mut self, kind: StepKind, name: &str, progress: &Arc<Progress>);
    /// The step ended.
    fn end(&mut self);
    /// A pass wrote a channel.
    fn wrote(&mut self, output: &Output<'_>) {
        let _ = output;
    }
    /// A raster pass wrote triangle ids.
    fn wrote_triangles(&mut self, triangles: &Triangles<'_>) {
        let _ = triangles;
    }
    /// A ray pass ran whose inputs and picture are in host memory. `picture` is not yet rounded to the format of its target.
    fn traced(&mut self, pass: &str, job: &RayJob<'_>, picture: &Image) {
        let _ = (pass, job, picture);
    }
    /// Whether the accumulated picture is shown ([`Self::wrote`]) after each batch of samples. If not, it is shown only after the last
    /// batch.
    fn wants_picture(&mut self) -> bool {
        false
    }
    /// A ray backend failed and another one took over.
    fn fell_back(&mut self, fallback: &Fallback) {
        let _ = fallback;
    }
}

/// An observer that ignores everything.
#[derive(Debug, Default, Clone, Copy)]
pub struct Silent;

impl Observer for Silent {
    fn begin(&mut self, _: StepKind, _: &str, _: &Arc<Progress>) {}
    fn end(&mut self) {}
}
