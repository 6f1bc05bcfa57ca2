//! Writing what was rendered.

use super::{Observer, Progress, Renderer, StepKind};
use crate::image::{Content, Image, Layer, make_visible, write_exr, write_png};
use crate::plan::Work;
use crate::project::ChannelRef;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// A file that was written.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Written {
    /// Where.
    pub path: PathBuf,
    /// What it holds.
    pub what: String,
}

impl Renderer {
    /// Writes the window to `path` (`.png` or `.exr`) and every shown channel beside it, as `.exr` with named channels
    /// and as `.png` made visible: `out.pos.exr`, `out.pos.png`.
    ///
    /// # Errors
    /// If a file cannot be written, or the extension is neither; files written before stay.
    pub fn save(&mut self, path: &Path, observer: &mut dyn Observer) -> io::Result<Vec<Written>> {
        let mut written = Vec::new();
        let window = self.window_image();
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_lowercase();
        let exr = match extension.as_str() {
            "png" => false,
            "exr" => true,
            _ => {
                let message = format!("{}: a picture is written as .png or .exr", path.display());
                return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
            }
        };
        self.timed(path, "window", &mut written, observer, || {
            if exr {
                write_exr(path, Layer { name: "window", channels: ["R", "G", "B", "A"], image: &window })
            } else {
                write_png(path, &window)
            }
        })?;
        for channel in self.plan.shown.clone() {
            self.save_channel(path, channel, &mut written, observer)?;
        }
        Ok(written)
    }

    fn save_channel(
        &mut self,
        path: &Path,
        channel: ChannelRef,
        written: &mut Vec<Written>,
        observer: &mut dyn Observer,
    ) -> io::Result<()> {
        let target = &self.plan.project.targets[channel.target];
        let name = target.channels[channel.channel].name.clone();
        let full = format!("{}::{name}", target.library);
        let planned = self.plan.targets[channel.target];
        let image = Image { width: planned.width, height: planned.height, pixels: self.channel(channel).to_vec() };
        let content = self.content(channel);
        let channels = match content {
            Content::Color => ["R", "G", "B", "A"],
            Content::Position => ["X", "Y", "Z", "cosine"],
            Content::Normal => ["X", "Y", "Z", "W"],
        };
        let beside = |extension: &str| path.with_extension(format!("{name}.{extension}"));
        let (exr, png) = (beside("exr"), beside("png"));
        self.timed(&exr, &full, written, observer, || write_exr(&exr, Layer { name: &full, channels, image: &image }))?;
        let visible = make_visible(&image, content);
        self.timed(&png, &format!("{full}, made visible"), written, observer, || write_png(&png, &visible))
    }

    /// What a channel holds: raster passes write positions and normals, all others colours.
    fn content(&self, channel: ChannelRef) -> Content {
        let by_raster = self.plan.passes.iter().any(|planned| {
            matches!(planned.work, Work::Raster { .. }) && self.plan.pass(planned).target == Some(channel.target)
        });
        match channel.channel {
            1 if by_raster => Content::Position,
            2 if by_raster => Content::Normal,
            _ => Content::Color,
        }
    }

    fn timed(
        &mut self,
        path: &Path,
        what: &str,
        written: &mut Vec<Written>,
        observer: &mut dyn Observer,
        write: impl FnOnce() -> io::Result<()>,
    ) -> io::Result<()> {
        let name = path.display().to_string();
        observer.begin(StepKind::Write, &name, &Arc::new(Progress::default()));
        let start = Instant::now();
        let result = write();
        observer.end();
        result.map_err(|error| io::Error::new(error.kind(), format!("{name}: {error}")))?;
        self.timeline.record(StepKind::Write, &name, start.elapsed());
        written.push(Written { path: path.to_owned(), what: what.to_owned() });
        Ok(())
    }
}
