//! Writing rendered pictures to files.

use super::parts::{Told, cut};
use super::{Observer, Progress, RenderError, Renderer, StepKind};
use crate::backend::Rect;
use crate::image::{
    Colors, Content, Image, Layer, RowLayer, VisibleRows, count_non_finite, legend, write_exr_of, write_exr_rows_of,
    write_png_rows,
};
use crate::image::{DisplayRows, write_codes, write_displayed};
use crate::memory::Refused;
use crate::project::ChannelRef;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Names of the channels of a colour layer. The fourth is no opacity: raster passes light it like the colours. Viewers would use a channel
/// `A` as opacity, and show the picture darker or mixed with their background.
const COLOR: [&str; 4] = ["R", "G", "B", "W"];

/// The error for an EXR file of a picture that a device displayed in 8 bits.
const NO_FLOATS: &str = "the last frame was rendered for a picture of 8 bits, and an EXR file holds floats: render it again, by \
                         Renderer::draw_frame_for with the file's path, or by draw_frame";

/// A file that was written.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Written {
    /// Path of the file.
    pub path: PathBuf,
    /// Description of its contents.
    pub what: String,
    /// For positions in false colours: the range of positions that each colour channel represents.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub legend: Option<String>,
}

/// Result of [`Renderer::render_and_save`] and [`Renderer::save_checked`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Saved {
    /// The files written.
    pub files: Vec<Written>,
    /// Number of the picture's pixels with a value that is not finite.
    pub not_finite: usize,
    /// Whether all pixels of the picture have the same colour.
    pub is_blank: bool,
}

impl Renderer {
    /// The files that [`Self::save`] writes, each with its contents. A channel has its short name if that is unique among the shown
    /// channels, otherwise its library in front: `out.pos.exr`, `out.Deferred.pos.exr`. Characters that some file system forbids
    /// (`/ \ : * ? " < > |` and control characters) become `_`.
    #[must_use]
    pub fn outputs(&self, path: &Path) -> Vec<(PathBuf, String)> {
        let mut files = vec![(path.to_owned(), "window".to_owned())];
        for (channel, name) in self.plan.shown.iter().zip(self.shown_names()) {
            let full = self.full_name(*channel);
            files.push((path.with_extension(format!("{name}.exr")), full.clone()));
            files.push((path.with_extension(format!("{name}.png")), format!("{full}, made visible")));
        }
        files
    }

    /// Writes the window to `path` (`.png` or `.exr`). Beside it, writes every shown channel of a target as `.exr` and as `.png`: colours as they are
    /// displayed, positions and normals in false colours. These are the files of [`Self::outputs`]; before rendering,
    /// [`check_outputs`](crate::files::check_outputs) checks whether they can be written.
    ///
    /// # Errors
    /// If a file cannot be written, or the extension is another one. Files written before stay.
    pub fn save(&mut self, path: &Path, observer: &mut dyn Observer) -> io::Result<Vec<Written>> {
        let (exr, display) = (is_exr(path)?, self.plan.display);
        let mut written = Vec::new();
        let files = self.outputs(path);
        let (window_file, channel_files) = files.split_at(1);
        if let Some(displayed) = self.displayed.take() {
            let result = match exr {
                true => Err(io::Error::new(io::ErrorKind::InvalidInput, NO_FLOATS)),
                false => {
                    self.timed(&window_file[0], &mut written, observer, |path| write_codes(path, &displayed.codes))
                }
            };
            self.displayed = Some(displayed);
            result?;
        } else {
            let window = self.lend(None)?;
            let result = self.timed(&window_file[0], &mut written, observer, |path| {
                if exr {
                    write_exr_of(path, Layer { name: "window", channels: COLOR, image: &window }, Some(display.space))
                } else {
                    write_displayed(path, &window, display)
                }
            });
            self.take_back(None, window);
            result?;
        }
        for (channel, files) in self.plan.shown.clone().into_iter().zip(channel_files.chunks_exact(2)) {
            self.save_channel(channel, [&files[0], &files[1]], &mut written, observer)?;
        }
        Ok(written)
    }

    /// Writes a shown channel as `.exr`, and in false colours as `.png`.
    fn save_channel(
        &mut self,
        channel: ChannelRef,
        [exr, png]: [&(PathBuf, String); 2],
        written: &mut Vec<Written>,
        observer: &mut dyn Observer,
    ) -> io::Result<()> {
        let image = self.lend(Some(channel))?;
        let (name, content) = (self.full_name(channel), self.content(channel));
        let channels = match content {
            Content::Color => COLOR,
            Content::Position => ["X", "Y", "Z", "cosine"],
            Content::Normal => ["X", "Y", "Z", "W"],
        };
        // A factor, such as occlusion, is written like any colour: as a grey of that brightness.
        let own = (content == Content::Color).then_some(self.plan.display);
        let (display, space) = (own.unwrap_or_default(), own.map(|display| display.space));
        let layer = Layer { name: &name, channels, image: &image };
        let mut result = self.timed(exr, written, observer, |path| write_exr_of(path, layer, space));
        if result.is_ok() {
            let mut visible = VisibleRows::new(&image, content);
            let mut displayed = DisplayRows::new(&mut visible, display);
            result = self.timed(png, written, observer, |path| write_png_rows(path, &mut displayed));
            if let Some(png) = written.last_mut().filter(|_| result.is_ok()) {
                png.legend = legend(&image.pixels, content);
            }
        }
        self.take_back(Some(channel), image);
        result
    }

    /// Takes the pixels of a channel (`None`: of the window) for writing: the buffer itself if all of it is written, otherwise a copy of
    /// the crop. Targets of another size than the window are written whole.
    fn lend(&mut self, channel: Option<ChannelRef>) -> Result<Image, Refused> {
        let held = self.pixels_mut(channel).0;
        let written = self.written_of(held);
        let (_, pixels) = self.pixels_mut(channel);
        if written == held {
            return Ok(Image { width: held.width, height: held.height, pixels: std::mem::take(pixels) });
        }
        cut(held, pixels, written)
    }

    /// The part that is written of the rectangle that a target, or the window, holds.
    fn written_of(&self, held: Rect) -> Rect {
        let of_window = self.plan.in_parts() || [held.width, held.height] == self.plan.window;
        if of_window { self.plan.parts.list[self.part].written } else { held }
    }

    /// A copy of the part of a channel that [`Self::save`] writes.
    ///
    /// # Panics
    /// If there is no memory for it.
    #[must_use]
    pub fn channel_image(&self, channel: ChannelRef) -> Image {
        let held = self.targets[channel.target].held();
        cut(held, self.channel(channel), self.written_of(held)).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Gives a buffer that [`Self::lend`] took back to its target.
    fn take_back(&mut self, channel: Option<ChannelRef>, image: Image) {
        let (_, pixels) = self.pixels_mut(channel);
        if pixels.is_empty() {
            *pixels = image.pixels;
        }
    }

    /// The rectangle of the picture that a target, or the window, holds, and the pixels of a channel.
    pub(super) fn pixels_mut(&mut self, channel: Option<ChannelRef>) -> (Rect, &mut Vec<[f32; 4]>) {
        let (buffer, channel) = match channel {
            None => (&mut self.window, 0),
            Some(channel) => (&mut self.targets[channel.target], channel.channel),
        };
        let held = buffer.held();
        let pixels = match channel {
            0 => &mut buffer.color,
            1 => &mut buffer.position,
            _ => &mut buffer.normal,
        };
        (held, pixels)
    }

    /// Writes the picture of the last frame as [`Self::save`] does. Also tells how many of the rendered pixels are not finite, and whether all of
    /// them have one colour; with a crop, more pixels may be rendered than are written.
    ///
    /// # Errors
    /// As [`Self::save`].
    pub fn save_checked(&mut self, path: &Path, observer: &mut dyn Observer) -> io::Result<Saved> {
        let pixels = &self.window.color;
        let (not_finite, is_blank) = match &self.displayed {
            Some(displayed) => (displayed.not_finite, displayed.is_blank),
            None => (count_non_finite(pixels), Colors::of(pixels).is_one()),
        };
        Ok(Saved { files: self.save(path, observer)?, not_finite, is_blank })
    }

    /// Renders a frame and writes it as [`Self::save`] does. A picture rendered in bands is written band by band and never exists
    /// as a whole in memory.
    ///
    /// # Errors
    /// As [`Self::frame`] and [`Self::save`].
    pub fn render_and_save(&mut self, path: &Path, observer: &mut dyn Observer) -> Result<Saved, RenderError> {
        self.settle(observer)?;
        if self.plan.parts.list.len() == 1 {
            self.draw_frame_for(path, observer)?;
            return Ok(self.save_checked(path, observer)?);
        }
        let (exr, display) = (is_exr(path)?, self.plan.display);
        let name = path.display().to_string();
        let start = Instant::now();
        let mut rows = self.rows(observer);
        let result = if exr {
            let layer = RowLayer { name: "window", channels: COLOR, rows: &mut rows };
            write_exr_rows_of(path, &mut [layer], Some(display.space))
        } else {
            write_png_rows(path, &mut DisplayRows::new(&mut rows, display))
        };
        let Told { failed, not_finite, colors, took } = rows.told();
        if let Some(error) = failed {
            return Err(error);
        }
        result.map_err(|error| io::Error::new(error.kind(), format!("{name}: {error}")))?;
        self.timeline.record(StepKind::Write, &name, start.elapsed().saturating_sub(took));
        let files = vec![Written { path: path.to_owned(), what: "window".to_owned(), legend: None }];
        Ok(Saved { files, not_finite, is_blank: colors.is_one() })
    }

    /// Full name of a channel: `library::channel`.
    fn full_name(&self, channel: ChannelRef) -> String {
        let target = &self.plan.project.targets[channel.target];
        format!("{}::{}", target.library, target.channels[channel.channel].name)
    }

    /// The part of the shown channels' file names that identifies the channel.
    fn shown_names(&self) -> Vec<String> {
        let targets = &self.plan.project.targets;
        let own = |channel: &ChannelRef| safe(&targets[channel.target].channels[channel.channel].name);
        // Compared without case: file systems may not distinguish `pos` from `Pos`.
        let alike = |name: &str| {
            let same = |other: &&ChannelRef| own(other).to_lowercase() == name.to_lowercase();
            self.plan.shown.iter().filter(same).count()
        };
        let name = |channel: &ChannelRef| match own(channel) {
            name if alike(&name) > 1 => format!("{}.{name}", safe(&targets[channel.target].library)),
            name => name,
        };
        self.plan.shown.iter().map(name).collect()
    }

    /// The content of a channel, which decides its false colours. Channels 1 and 2 of a target that a raster pass draws hold positions and
    /// normals; all other channels hold colours.
    #[must_use]
    pub fn content(&self, channel: ChannelRef) -> Content {
        self.plan.content(channel)
    }

    fn timed(
        &mut self,
        (path, what): &(PathBuf, String),
        written: &mut Vec<Written>,
        observer: &mut dyn Observer,
        write: impl FnOnce(&Path) -> io::Result<()>,
    ) -> io::Result<()> {
        let name = path.display().to_string();
        observer.begin(StepKind::Write, &name, &Arc::new(Progress::default()));
        let start = Instant::now();
        let result = write(path);
        observer.end();
        result.map_err(|error| io::Error::new(error.kind(), format!("{name}: {error}")))?;
        self.timeline.record(StepKind::Write, &name, start.elapsed());
        written.push(Written { path: path.clone(), what: what.clone(), legend: None });
        Ok(())
    }
}

/// Whether the extension of a path is `exr` and not `png`; an error for any other.
pub(super) fn is_exr(path: &Path) -> io::Result<bool> {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_lowercase();
    match extension.as_str() {
        "png" => Ok(false),
        "exr" => Ok(true),
        _ => {
            let message = format!("{}: a picture is written as .png or .exr", path.display());
            Err(io::Error::new(io::ErrorKind::InvalidInput, message))
        }
    }
}

/// The name with `_` for every character that some file system forbids.
fn safe(name: &str) -> String {
    let bad = |letter: char| letter.is_control() || "/\\:*?\"<>|".contains(letter);
    let safe: String = name.chars().map(|letter| if bad(letter) { '_' } else { letter }).collect();
    if safe.trim().is_empty() { "_".to_owned() } else { safe }
}
