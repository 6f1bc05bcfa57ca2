//! Who is told what a renderer does.

use super::engines::Fallback;
use super::output::{Output, Triangles};
use super::timeline::StepKind;
use crate::backend::RayJob;
use crate::image::Image;
use crate::progress::Progress;
use std::sync::Arc;

/// Told when steps begin and end, to show progress, and what passes write, to look into it.
pub trait Observer {
    /// A step begins; `progress` moves while it runs, if the step can tell.
    fn begin(&mut self, kind: StepKind, name: &str, progress: &Arc<Progress>);
    /// It ended.
    fn end(&mut self);
    /// A pass wrote a channel.
    fn wrote(&mut self, output: &Output<'_>) {
        let _ = output;
    }
    /// A raster pass wrote triangle ids.
    fn wrote_triangles(&mut self, triangles: &Triangles<'_>) {
        let _ = triangles;
    }
    /// A ray pass ran; the picture is not yet rounded to the format of its target.
    fn traced(&mut self, pass: &str, job: &RayJob<'_>, picture: &Image) {
        let _ = (pass, job, picture);
    }
    /// Whether to show ([`Self::wrote`]) what was accumulated so far, after each batch of samples.
    fn wants_picture(&mut self) -> bool {
        false
    }
    /// A ray backend failed, and another takes its place.
    fn fell_back(&mut self, fallback: &Fallback) {
        let _ = fallback;
    }
}

/// Shows nothing.
#[derive(Debug, Default, Clone, Copy)]
pub struct Silent;

impl Observer for Silent {
    fn begin(&mut self, _: StepKind, _: &str, _: &Arc<Progress>) {}
    fn end(&mut self) {}
}
