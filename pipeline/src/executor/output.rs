//! What passes write, shown to observers, and whether it is made of numbers that mean something.

use super::{ChangeError, Observer, Renderer, channel_of};
use crate::backend::{GBuffer, NO_TRIANGLE};
use crate::plan::{Plan, PlannedPass, Work};
use crate::programs::Writes;
use crate::project::{ChannelRef, PassKind};
use crate::raster_effects::EffectProgram;
use rayon::prelude::*;

/// How far a normal's length may be from 1: what 16-bit floats and the interpolation of unit normals leave.
const NORMAL_TOLERANCE: f32 = 1e-2;

/// What the pixels of an output may be. A value that is not a number or infinite is wrong everywhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Range {
    /// Every channel is 0 or more. All may be above 1, alpha too: the raster pass lights the four channels alike.
    Color,
    /// Every channel is a share, 0..=1: light that arrives, openness.
    Share,
    /// A position, of which every finite one is possible; the fourth channel is a cosine, 0..=1.
    Position,
    /// A unit vector (its length within 0.01 of 1) and 0, or all 0 where nothing is seen.
    Normal,
}

/// A channel of a render target, or of the window, as a pass left it.
#[derive(Debug, Clone)]
pub struct Output<'a> {
    /// The pass that wrote it.
    pub pass: &'a str,
    /// `library::texture`, or `window`.
    pub channel: String,
    /// What its pixels may be.
    pub range: Range,
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Top row first, rounded to the declared format: what later passes read.
    pub pixels: &'a [[f32; 4]],
}

/// What is wrong with the values of one component of an output.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Faults {
    /// Values that are not a number.
    pub nan: u64,
    /// Values that are infinite.
    pub infinite: u64,
    /// Values below 0 where 0 is the least, as of colours and shares.
    pub negative: u64,
    /// Other finite values outside the range.
    pub out_of_range: u64,
    /// Index of the first pixel with any of them.
    pub first: Option<usize>,
}

impl Faults {
    /// All of them.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.nan + self.infinite + self.negative + self.out_of_range
    }

    /// Counts a value that has to be in `low..=high`.
    fn count(&mut self, index: usize, value: f32, low: f32, high: f32) {
        let counter = if value.is_nan() {
            &mut self.nan
        } else if value.is_infinite() {
            &mut self.infinite
        } else if value < 0.0 && low >= 0.0 {
            &mut self.negative
        } else if value < low || value > high {
            &mut self.out_of_range
        } else {
            return;
        };
        *counter += 1;
        self.first.get_or_insert(index);
    }

    /// The sum of two counts, of parts of an output or of frames.
    #[must_use]
    pub fn and(self, later: Self) -> Self {
        Self {
            nan: self.nan + later.nan,
            infinite: self.infinite + later.infinite,
            negative: self.negative + later.negative,
            out_of_range: self.out_of_range + later.out_of_range,
            first: match (self.first, later.first) {
                (Some(a), Some(b)) => Some(a.min(b)),
                (a, b) => a.or(b),
            },
        }
    }
}

impl Output<'_> {
    /// Names of the four components.
    #[must_use]
    pub fn components(&self) -> [&'static str; 4] {
        match self.range {
            Range::Color | Range::Share => ["red", "green", "blue", "alpha"],
            Range::Position => ["x", "y", "z", "cosine"],
            Range::Normal => ["x", "y", "z", "w"],
        }
    }

    /// Counts what is wrong, by component. A normal of a wrong length is counted once, in its first component.
    #[must_use]
    pub fn faults(&self) -> [Faults; 4] {
        let count = |(index, pixel): (usize, &[f32; 4])| {
            let mut faults = [Faults::default(); 4];
            let limits = match self.range {
                Range::Color => [(0.0, f32::MAX); 4],
                Range::Share => [(0.0, 1.0); 4],
                Range::Position => [(f32::MIN, f32::MAX), (f32::MIN, f32::MAX), (f32::MIN, f32::MAX), (0.0, 1.0)],
                Range::Normal => {
                    let side = (-1.0 - NORMAL_TOLERANCE, 1.0 + NORMAL_TOLERANCE);
                    [side, side, side, (-0.0, 0.0)]
                }
            };
            for ((faults, value), (low, high)) in faults.iter_mut().zip(pixel).zip(limits) {
                faults.count(index, *value, low, high);
            }
            if self.range == Range::Normal && faults.iter().all(|faults| faults.total() == 0) {
                let length = pixel[..3].iter().map(|value| value * value).sum::<f32>().sqrt();
                if length != 0.0 {
                    faults[0].count(index, length, 1.0 - NORMAL_TOLERANCE, 1.0 + NORMAL_TOLERANCE);
                }
            }
            faults
        };
        let merge = |a: [Faults; 4], b: [Faults; 4]| std::array::from_fn(|i| a[i].and(b[i]));
        let pixels = self.pixels.par_iter().enumerate().with_min_len(4096);
        pixels.map(count).reduce(|| [Faults::default(); 4], merge)
    }
}

/// The triangle ids that a raster pass wrote.
#[derive(Debug, Clone)]
pub struct Triangles<'a> {
    /// The pass.
    pub pass: &'a str,
    /// How many triangles its scene has; ids are below this, or [`NO_TRIANGLE`].
    pub count: usize,
    /// Pixels a row.
    pub width: u32,
    /// The ids.
    pub ids: &'a [u32],
}

impl Triangles<'_> {
    /// Ids that name no triangle.
    #[must_use]
    pub fn faults(&self) -> Faults {
        let mut faults = Faults::default();
        for (index, id) in self.ids.iter().enumerate() {
            if *id != NO_TRIANGLE && *id as usize >= self.count {
                faults.out_of_range += 1;
                faults.first.get_or_insert(index);
            }
        }
        faults
    }
}

/// See [`Renderer::read_back_everything`].
pub(super) fn read_back_everything(plan: &mut Plan) {
    for planned in &mut plan.passes {
        match &mut planned.work {
            Work::Raster { attachments, host, .. } => *host = *attachments,
            // Observers are shown what ray passes read, too.
            Work::Rays { resident, .. } => *resident = None,
            Work::Effect { .. } | Work::Off { .. } | Work::Quad { .. } => {}
        }
    }
}

impl Renderer {
    /// Copies every attachment of raster passes into host memory from now on, so that observers see all that is written.
    /// Without this, attachments that only the rasteriser's device reads are not shown to them.
    pub fn read_back_everything(&mut self) {
        self.shows_everything = true;
        read_back_everything(&mut self.plan);
        if let Some(next) = &mut self.next {
            read_back_everything(next);
        }
    }

    /// Takes [`Self::read_back_everything`] back: only what the plan asks for is copied into host memory.
    ///
    /// # Errors
    /// As the setters; then everything is copied as before.
    pub fn read_back_as_planned(&mut self) -> Result<(), ChangeError> {
        let before = std::mem::replace(&mut self.shows_everything, false);
        let result = self.propose(self.project().clone(), self.settings().clone());
        if result.is_err() {
            self.shows_everything = before;
        }
        result
    }

    /// Whether [`Self::channel`] gives what the last frame left in a channel: a pass of its plan writes it, and it was copied into host
    /// memory where a device drew it. What a setter asked for since is not counted.
    #[must_use]
    pub fn holds(&self, channel: ChannelRef) -> bool {
        let slot = (Some(channel.target), channel.channel);
        let mut writers = self.plan.passes.iter().filter(|planned| self.plan.access(planned).writes.contains(&slot));
        let held = |planned: &PlannedPass| {
            let Work::Raster { attachments, host, traced, .. } = planned.work else { return true };
            let held = match self.engines.raster.needs_read_back() {
                true => self.in_host(Some(channel.target), host, traced),
                false => attachments,
            };
            [held.color, held.position, held.normal].get(channel.channel) == Some(&true)
        };
        // Of several writers the last one counts.
        writers.next_back().is_some_and(held) && !self.channel(channel).is_empty()
    }

    /// Shows what a pass wrote.
    pub(super) fn show_outputs(&self, planned: &PlannedPass, observer: &mut dyn Observer) {
        let pass = self.plan.pass(planned);
        let buffer: &GBuffer = pass.target.map_or(&self.window, |target| &self.targets[target]);
        let mut show = |channel: usize, range: Range| {
            let name = match pass.target {
                Some(target) => {
                    let target = &self.plan.project.targets[target];
                    let texture = target.channels.get(channel).map_or("no texture", |texture| texture.name.as_str());
                    format!("{}::{texture}", target.library)
                }
                None => "window".to_owned(),
            };
            let (width, height) = (buffer.width, buffer.height);
            let pixels = channel_of(buffer, channel);
            observer.wrote(&Output { pass: &pass.name, channel: name, range, width, height, pixels });
        };
        match (&planned.work, &pass.kind) {
            (Work::Raster { scene_set, attachments, host, traced, .. }, _) => {
                let held = match self.engines.raster.needs_read_back() {
                    true => self.in_host(pass.target, *host, *traced),
                    false => *attachments,
                };
                for (channel, (shown, range)) in
                    [(held.color, Range::Color), (held.position, Range::Position), (held.normal, Range::Normal)]
                        .into_iter()
                        .enumerate()
                {
                    if shown {
                        show(channel, range);
                    }
                }
                if held.triangle {
                    let count = self.scenes[*scene_set].scene.geometry.triangles.len();
                    let (width, ids) = (buffer.width, buffer.triangle.as_slice());
                    observer.wrote_triangles(&Triangles { pass: &pass.name, count, width, ids });
                }
            }
            (_, PassKind::Ray(ray)) => show(
                0,
                match ray.program.info().writes {
                    Writes::Share => Range::Share,
                    Writes::Color => Range::Color,
                },
            ),
            (_, PassKind::Effect(effect)) => show(
                0,
                match effect.program {
                    EffectProgram::ShadowMap | EffectProgram::DepthOcclusion | EffectProgram::HorizonOcclusion => {
                        Range::Share
                    }
                    EffectProgram::CubeReflection | EffectProgram::CubeRefraction => Range::Color,
                },
            ),
            _ => show(0, Range::Color),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn faults(range: Range, pixels: &[[f32; 4]]) -> [Faults; 4] {
        let channel = "library::texture".to_owned();
        Output { pass: "pass1", channel, range, width: pixels.len() as u32, height: 1, pixels }.faults()
    }

    #[test]
    fn sound_values_of_every_range_have_no_fault() {
        let none = [Faults::default(); 4];
        assert_eq!(faults(Range::Color, &[[0.0, 7.5, 0.2, 1.0], [-0.0; 4]]), none);
        assert_eq!(faults(Range::Share, &[[0.0, 1.0, 0.5, 1.0]]), none);
        assert_eq!(faults(Range::Position, &[[-1e30, 3.0, 0.0, 1.0], [0.0; 4]]), none);
        assert_eq!(faults(Range::Normal, &[[0.0, -1.0, 0.0, 0.0], [0.0; 4], [0.6, 0.0, 0.801, -0.0]]), none);
    }

    #[test]
    fn each_kind_of_wrong_value_is_counted_where_it_is() {
        let mut pixels = vec![[0.5, 0.5, 0.5, 1.0]; 10_000];
        pixels[9000][1] = f32::NAN;
        pixels[77][1] = f32::NAN;
        pixels[50][2] = f32::NEG_INFINITY;
        pixels[60][0] = -1e-20;
        pixels[70][3] = -0.25;
        let found = faults(Range::Color, &pixels);
        let clean = Faults::default();
        assert_eq!(found[0], Faults { negative: 1, first: Some(60), ..clean });
        assert_eq!(found[1], Faults { nan: 2, first: Some(77), ..clean });
        assert_eq!(found[2], Faults { infinite: 1, first: Some(50), ..clean });
        assert_eq!(found[3], Faults { negative: 1, first: Some(70), ..clean });
        assert_eq!(
            faults(Range::Share, &[[0.5, 0.5, 0.5, 1.001]])[3],
            Faults { out_of_range: 1, first: Some(0), ..clean }
        );
        assert_eq!(faults(Range::Share, &[[1.5, 0.5, -0.5, 1.0]]).map(|faults| faults.total()), [1, 0, 1, 0]);
        // A colour may be above 1, a share may not; a position may be negative, its cosine may not.
        assert_eq!(faults(Range::Color, &[[1.5, 0.5, 0.5, 1.0]]), [clean; 4]);
        assert_eq!(faults(Range::Position, &[[-1.0, 0.0, 0.0, -0.5]])[3].negative, 1);
        assert_eq!(faults(Range::Normal, &[[0.5, 0.5, 0.5, 0.0]])[0].out_of_range, 1);
        assert_eq!(faults(Range::Normal, &[[0.0, 0.0, 1.0, 0.25]])[3].out_of_range, 1);
    }

    #[test]
    fn ids_of_no_triangle_are_counted() {
        let triangles = Triangles { pass: "pass1", count: 5, width: 4, ids: &[0, 4, NO_TRIANGLE, 5] };
        assert_eq!(triangles.faults(), Faults { out_of_range: 1, first: Some(3), ..Faults::default() });
    }
}
