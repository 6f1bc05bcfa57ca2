//! Parts of a picture: `--crop`, and bands of rows that are rendered one after another.
//!
//! A pixel of a part equals that pixel of the whole picture, bit for bit. Parts use the camera of the whole picture, random numbers
//! depend on the pixel's place in the whole picture, and parts are cut at the engines' tile borders ([`ALIGNMENT`]), so that a tile
//! of a part is a tile of the whole. A part may therefore extend beyond the requested rectangle by less than [`ALIGNMENT`] pixels
//! on each side; these pixels are rendered and not written.
//!
//! Some passes need the whole picture ([`Plan::needs_whole`]). Then `--crop` renders all of it and writes the crop, and bands are
//! refused with the reason.

use super::{Plan, PlanError, Work};
use crate::backend::{Attachments, Limits, Rect};
use crate::gbuffer::ALIGNMENT;
use crate::memory::mebibytes;
use crate::project::{ChannelRef, PassKind, QuadPass};

/// Largest side of the blocks in which a rasteriser draws, one after another, a picture that exceeds its limits. Each block has its
/// own projection.
pub const BLOCK: u32 = 4096;

/// If targets take more than half of the allowed memory, the picture is cut into bands whose targets take about `1 / SHARE` of the
/// allowed memory. The rest is for the scene.
const SHARE: u64 = 4;

/// Subject of the decisions about parts.
const WHAT: &str = "parts of the picture";

/// A part of the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    /// The rectangle that is rendered.
    pub rendered: Rect,
    /// The rectangle of [`Self::rendered`] that is written.
    pub written: Rect,
}

/// How the picture is divided.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Parts {
    /// The rectangle of the picture that is written.
    pub crop: Rect,
    /// The parts, from top to bottom; at least one.
    pub list: Vec<Part>,
}

impl Parts {
    /// One part: the whole picture.
    #[must_use]
    pub fn whole([width, height]: [u32; 2]) -> Self {
        let all = Rect { x: 0, y: 0, width, height };
        Self { crop: all, list: vec![Part { rendered: all, written: all }] }
    }

    /// Cuts the crop into at most `bands` bands of about equal height.
    fn bands(crop: Rect, [width, height]: [u32; 2], bands: u32) -> Self {
        let down = |pixels: u32| pixels / ALIGNMENT * ALIGNMENT;
        let up = |pixels: u32, side: u32| pixels.next_multiple_of(ALIGNMENT).min(side);
        let (left, right) = (down(crop.x), up(crop.x + crop.width, width));
        let (top, bottom) = (down(crop.y), up(crop.y + crop.height, height));
        let rows = (bottom - top).div_ceil(ALIGNMENT).div_ceil(bands.max(1)) * ALIGNMENT;
        let part = |first: u32| {
            let last = (first + rows).min(bottom);
            let (upper, lower) = (first.max(crop.y), last.min(crop.y + crop.height));
            Part {
                rendered: Rect { x: left, y: first, width: right - left, height: last - first },
                written: Rect { x: crop.x, y: upper, width: crop.width, height: lower - upper },
            }
        };
        Self { crop, list: (top..bottom).step_by(rows as usize).map(part).collect() }
    }

    /// Width and height that every part fits into.
    #[must_use]
    pub fn largest(&self) -> (u32, u32) {
        let side = |side: fn(&Part) -> u32| self.list.iter().map(side).max().unwrap_or(0);
        (side(|part| part.rendered.width), side(|part| part.rendered.height))
    }

    /// Number of pixels of the largest part.
    fn pixels(&self) -> u64 {
        let area = |part: &Part| u64::from(part.rendered.width) * u64::from(part.rendered.height);
        self.list.iter().map(area).max().unwrap_or(0)
    }
}

impl Plan {
    /// Why a pass needs the whole picture at once; `None` if every pixel of every pass can be computed without the others.
    #[must_use]
    pub fn needs_whole(&self) -> Option<String> {
        self.passes.iter().find_map(|planned| {
            let pass = self.pass(planned);
            let size = self.target_size(pass.target);
            if size != self.window {
                let [width, height] = size;
                return Some(format!(
                    "pass `{}` writes {width} x {height} pixels, which are not the window's",
                    pass.name
                ));
            }
            let whole = Rect { x: 0, y: 0, width: size[0], height: size[1] };
            match (&planned.work, &pass.kind) {
                (Work::Raster { viewport, .. } | Work::Quad { viewport }, _) if *viewport != whole => {
                    Some(format!("pass `{}` fills a part of its target", pass.name))
                }
                (Work::Raster { .. }, PassKind::Raster(raster)) if self.project.is_of_light(raster.camera) => {
                    Some(format!("pass `{}` draws what a light sees, which is not the picture", pass.name))
                }
                (Work::Raster { .. }, PassKind::Raster(raster))
                    if super::liveness::sampled(raster).next().is_some() =>
                {
                    Some(format!(
                        "pass `{}` draws by an own shader, which may read all of what other passes wrote",
                        pass.name
                    ))
                }
                (Work::Raster { .. }, kind) if !kind.bound().is_empty() => Some(format!(
                    "pass `{}` draws by an own shader that stores, whatever part of the picture is asked for",
                    pass.name
                )),
                (Work::Compute, _) => Some(format!(
                    "pass `{}` runs a compute shader, which may read and store all of an image",
                    pass.name
                )),
                (Work::Quad { .. }, PassKind::Quad(quad)) if quad.shader.is_some() => Some(format!(
                    "pass `{}` fills its target by an own shader, which may read all of a texture",
                    pass.name
                )),
                (Work::Quad { .. }, PassKind::Quad(quad)) if self.shows_random(quad) => {
                    Some(format!("pass `{}` shows a texture of random numbers, which has its own size", pass.name))
                }
                (Work::Rays { .. }, _) if self.filter_levels(planned) > 0 => Some(format!(
                    "pass `{}` filters what it writes, so its pixels depend on others of the picture",
                    pass.name
                )),
                (Work::Rays { .. }, _) if self.sampled_to(planned).is_some() => Some(format!(
                    "pass `{}` gives each pixel as many paths as the error of all of its picture takes",
                    pass.name
                )),
                (Work::Effect { .. }, PassKind::Effect(effect)) => Some(format!(
                    "pass `{}` computes `{}`, whose pixels depend on others of the picture",
                    pass.name,
                    effect.program.info().name
                )),
                _ => None,
            }
        })
    }

    fn shows_random(&self, quad: &QuadPass) -> bool {
        let random = |channel: &ChannelRef| self.project.targets[channel.target].contents.is_some();
        super::liveness::sources(quad).iter().any(random)
    }

    /// Chooses the parts: the requested ones, or bands if the targets would otherwise take more than half of the allowed memory.
    pub(super) fn choose_parts(&mut self) -> Result<(), PlanError> {
        let [width, height] = self.window;
        let crop = self.settings.crop.unwrap_or(Rect { x: 0, y: 0, width, height });
        let inside =
            |start: u32, length: u32, side: u32| length > 0 && start.checked_add(length).is_some_and(|end| end <= side);
        if !inside(crop.x, crop.width, width) || !inside(crop.y, crop.height, height) {
            let Rect { x, y, width: columns, height: rows } = crop;
            return Err(PlanError::new(
                format!("--crop {x},{y},{columns}x{rows} does not lie in the window of {width} x {height} pixels"),
                "columns and rows count from 0,0 at the top left; a crop has at least one pixel",
            ));
        }
        self.parts.crop = crop;
        if let Some(reason) = self.needs_whole() {
            if self.settings.bands.is_some_and(|bands| bands > 1) {
                return Err(PlanError::new(
                    format!("--bands is not possible: {reason}"),
                    "leave it out, and raise --max-memory if the picture does not fit",
                ));
            }
            self.render_whole(reason);
            return Ok(());
        }
        let allowed = self.settings.max_memory / SHARE;
        self.parts = Parts::bands(crop, self.window, self.settings.bands.unwrap_or(1));
        let mut why = match (self.settings.bands, self.settings.crop) {
            (Some(_), _) => "--bands asks for them",
            (None, Some(_)) => "--crop asks for them",
            (None, None) => "",
        };
        // Shown channels must be kept whole, so the picture is not cut.
        let may_cut = self.settings.bands.is_none() && self.shown.is_empty();
        if may_cut && self.target_bytes() > self.settings.max_memory / 2 {
            let most = crop.height.div_ceil(ALIGNMENT) + 1;
            let bytes = self.target_bytes().div_ceil(allowed.max(1)).min(u64::from(most)) as u32;
            self.parts = Parts::bands(crop, self.window, bytes);
            // Rounding to tiles may have left the bands too large.
            if self.target_bytes() > self.settings.max_memory / 2 {
                self.parts = Parts::bands(crop, self.window, most);
            }
            why = "the targets of all of it would take more than half of --max-memory";
        }
        if !why.is_empty() {
            let bands = self.parts.list.len();
            let plural = if bands == 1 { "" } else { "s" };
            let [first, ..] = &self.parts.list[..] else { return Ok(()) };
            let Rect { width, height, .. } = first.rendered;
            let size = format!("{bands} band{plural} of {width} x {height} pixels, {}", mebibytes(self.target_bytes()));
            self.decide(WHAT.to_owned(), true, format!("{size}: {why}"));
        }
        if self.parts.list.len() > 1 && !self.shown.is_empty() {
            return Err(PlanError::new(
                "--show keeps whole channels, and the picture is rendered in bands",
                "leave --show out, show a --crop, or raise --max-memory",
            ));
        }
        Ok(())
    }

    /// Renders the whole picture at once and writes the crop of it.
    fn render_whole(&mut self, reason: String) {
        let Parts { list, .. } = Parts::whole(self.window);
        let crop = self.parts.crop;
        self.parts.list = list.into_iter().map(|part| Part { written: crop, ..part }).collect();
        if self.settings.crop.is_some() {
            self.decide(WHAT.to_owned(), false, format!("the whole picture is rendered and a part written: {reason}"));
        }
    }

    /// Bytes of the targets, the window, the depths that passes store for later passes, the sums and shares of samples, the filters,
    /// adaptive sampling and photons, for the largest part.
    #[must_use]
    pub fn target_bytes(&self) -> u64 {
        let bytes = |target: &super::PlannedTarget| {
            let Attachments { color, position, normal, triangle } = target.stored;
            let pixel = 16 * (u64::from(color) + u64::from(position) + u64::from(normal)) + 4 * u64::from(triangle);
            pixel * self.held_pixels([target.width, target.height])
        };
        let mut left: Vec<Option<usize>> = Vec::new();
        for planned in &self.passes {
            let target = self.pass(planned).target;
            let leaves = matches!(&planned.work, Work::Raster { load_store, .. } if load_store.store_depth);
            if leaves && !left.contains(&target) {
                left.push(target);
            }
        }
        let depths = left.into_iter().map(|target| 4 * self.held_pixels(self.target_size(target))).sum::<u64>();
        let targets = 16 * self.parts.pixels() + self.targets.iter().map(bytes).sum::<u64>();
        targets
            + depths
            + self.sum_bytes()
            + self.share_bytes()
            + self.filter_bytes()
            + self.adaptive_bytes()
            + self.photon_bytes()
    }

    /// Number of pixels held for a target or window of this size: those of the largest part if it is rendered in parts.
    pub(super) fn held_pixels(&self, [width, height]: [u32; 2]) -> u64 {
        if self.in_parts() { self.parts.pixels() } else { u64::from(width) * u64::from(height) }
    }

    /// Whether targets hold only a part of the picture at a time.
    #[must_use]
    pub fn in_parts(&self) -> bool {
        let [width, height] = self.window;
        self.parts.list.iter().any(|part| part.rendered != Rect { x: 0, y: 0, width, height })
    }

    /// Fails if engines with these names and limits cannot carry out the plan; the error has a remedy. Adds the decisions that the limits
    /// enforce.
    ///
    /// # Errors
    /// If the picture, or a part, exceeds an engine's limits.
    pub fn fit(&mut self, raster: (&str, Limits), rays: (&str, Limits)) -> Result<(), PlanError> {
        let (engine, limits) = raster;
        let draws = |planned: &super::PlannedPass| matches!(planned.work, Work::Raster { .. } | Work::Effect { .. });
        let largest = self.passes.iter().filter(|planned| draws(planned)).map(|planned| {
            let [width, height] = self.target_size(self.pass(planned).target);
            width.max(height)
        });
        if let Some(largest) = largest.max().filter(|largest| *largest > limits.side) {
            let side = limits.side;
            let too_large = format!("{engine} draws at most {side} pixels a side, and a target has {largest}");
            if let Some(reason) = self.needs_whole() {
                return Err(PlanError::new(
                    format!("{too_large}; it cannot be drawn in blocks: {reason}"),
                    format!("valid: --size up to {side}x{side}"),
                ));
            }
            if self.passes.iter().any(|planned| self.draws_own(planned)) {
                return Err(PlanError::new(
                    format!("{too_large}; a pass with own shaders is not drawn in blocks"),
                    format!("valid: --size up to {side}x{side}"),
                ));
            }
            let block = BLOCK.min(side / ALIGNMENT * ALIGNMENT);
            if block == 0 {
                return Err(PlanError::new(too_large, "use --raster cpu"));
            }
            self.block = Some(block);
            self.decide(format!("blocks of {block} x {block} pixels"), true, too_large);
        }
        let (engine, limits) = rays;
        let traces = self.passes.iter().any(|planned| matches!(planned.work, Work::Rays { .. }));
        if traces && !limits.parts && self.in_parts() {
            let reason = format!("{engine} traces whole pictures only");
            if self.parts.list.len() > 1 {
                return Err(PlanError::new(
                    format!("the picture is rendered in {} bands, and {reason}", self.parts.list.len()),
                    "use --backend cpu, or leave --bands out and raise --max-memory",
                ));
            }
            self.render_whole(reason);
            self.check_memory()?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_cover_the_crop_once_and_lie_on_tiles() {
        let window = [1000, 777];
        for crop in [[0, 0, 1000, 777], [13, 70, 500, 300], [999, 776, 1, 1], [64, 64, 64, 64], [63, 63, 2, 650]] {
            let [x, y, width, height] = crop;
            let crop = Rect { x, y, width, height };
            for bands in [1, 2, 3, 7, 100] {
                let parts = Parts::bands(crop, window, bands);
                assert!(parts.list.len() <= bands as usize && !parts.list.is_empty());
                let (mut next, mut rows) = (crop.y, 0);
                for Part { rendered, written } in &parts.list {
                    assert_eq!((written.x, written.y, written.width), (crop.x, next, crop.width));
                    assert!(written.height > 0, "{crop:?} in {bands}");
                    assert_eq!((rendered.x % ALIGNMENT, rendered.y % ALIGNMENT), (0, 0));
                    let (right, bottom) = (rendered.x + rendered.width, rendered.y + rendered.height);
                    assert!(right % ALIGNMENT == 0 || right == window[0]);
                    assert!(bottom % ALIGNMENT == 0 || bottom == window[1]);
                    assert!(rendered.x <= written.x && written.x + written.width <= right);
                    assert!(rendered.y <= written.y && written.y + written.height <= bottom);
                    next += written.height;
                    rows += written.height;
                }
                assert_eq!(rows, crop.height);
            }
        }
    }
}
