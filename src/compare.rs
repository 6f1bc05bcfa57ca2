//! Comparing two pictures, or two ways to render a project.

use crate::bench::Case;
use crate::pipeline::color::{ColorSpace, Display, decode, decode_slope};
use crate::pipeline::diagnostic::{Problems, WarningGroup};
use crate::pipeline::executor::{Observer, Renderer, median};
use crate::pipeline::image::{Image, ReadImageError, Variance, read_image};
use crate::pipeline::metrics::{self, Comparison, ErrorMap, Estimate, MetricError, Options, Which, ZTest};
use crate::reference::{ReferenceError, References};
use crate::spec::{Spec, SpecError};
use crate::{Choice, OpenError};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Greatest number of seeds with which a project is rendered.
pub const MAX_SEEDS: u32 = 10_000;

/// One of the two things to compare.
#[derive(Debug, Clone)]
pub enum Operand {
    /// A picture in a file.
    Picture(PathBuf),
    /// A project, which is rendered with its settings.
    Project(Box<Spec>),
}

impl Operand {
    /// Parses the name of a picture (`.png`, `.exr`), or a [`Spec`] of a project or scene.
    ///
    /// # Errors
    /// If it is neither of them.
    pub fn parse(text: &str) -> Result<Self, SpecError> {
        if Spec::is_project(text) {
            return Ok(Self::Project(Box::new(Spec::parse(text)?)));
        }
        let extension = Path::new(text).extension().map(|extension| extension.to_ascii_lowercase());
        if extension.is_some_and(|extension| extension == "png" || extension == "exr") {
            return Ok(Self::Picture(text.into()));
        }
        Err(SpecError {
            text: text.to_owned(),
            position: 1,
            message: "this is neither a picture nor a project or scene".to_owned(),
            help: "valid: FILE.png, FILE.exr, or PROJECT.xml@SETTING,SETTING, or a scene (.glb, .gltf, .obj, .cbo, .nbo, .3ds, .dae, .mesh.xml, a folder) likewise".to_owned(),
        })
    }
}

/// Why a comparison failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CompareError {
    /// A picture cannot be read.
    #[error(transparent)]
    Read(#[from] ReadImageError),
    /// A project cannot be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// A frame cannot be rendered.
    #[error(transparent)]
    Render(#[from] crate::pipeline::executor::RenderError),
    /// The two cannot be compared with each other.
    #[error("{0}")]
    Mismatch(String),
    /// An option does not apply to these two.
    #[error("{0}")]
    Usage(String),
}

/// One of the two things, as a picture.
#[derive(Debug, Clone)]
pub struct Side {
    /// Name as the user wrote it.
    pub name: String,
    /// The picture; with several seeds their mean.
    pub image: Image,
    /// Names of its channels.
    pub channels: [String; 4],
    /// Largest integer of a PNG's channels; `None` for floats.
    pub steps: Option<u32>,
    /// Colour space before conversion to [`Compared::space`]; `None` for an EXR file that does not say.
    pub space: Option<ColorSpace>,
    /// Variance of the mean, if known.
    pub variance: Option<Variance>,
    /// How it was rendered; `None` for a picture from a file, and for a stored reference.
    pub rendered: Option<Rendered>,
}

/// Details of a rendered picture.
#[derive(Debug, Clone, Serialize)]
pub struct Rendered {
    /// Median host time of a frame in milliseconds, without loading and building. No frames of warm-up come before; `curitiba bench`
    /// measures properly.
    pub frame_ms: f64,
    /// Number of frames rendered: one for each seed.
    pub frames: u32,
    /// Seed of the first frame; seeds increase by one per frame.
    pub first_seed: u32,
    /// Name of the rasteriser.
    pub raster: &'static str,
    /// Device and driver of the rasteriser.
    pub raster_device: String,
    /// Name of the ray backend.
    pub rays: &'static str,
    /// Device and driver of the ray backend.
    pub rays_device: String,
    /// Warnings of the scene, with counts.
    pub warnings: Vec<String>,
    /// Warnings and notes of the project.
    #[serde(skip)]
    pub problems: Problems,
}

/// Result of a comparison.
#[derive(Debug, Clone)]
pub struct Compared {
    /// The picture that is judged.
    pub test: Side,
    /// The picture that it is compared with.
    pub reference: Side,
    /// The metrics.
    pub comparison: Comparison,
    /// Result of the z-test; `None` unless both have a variance.
    pub z_test: Option<ZTest>,
    /// FLIP error of every pixel.
    pub flip: ErrorMap,
    /// Colour space of the comparison, to which both sides are converted: linear if they hold colours and either is linear radiance.
    pub space: ColorSpace,
    /// Notes for the reader about these two pictures.
    pub notes: Vec<String>,
}

/// Reads or renders both pictures and compares them. With `seeds` of 2 or more each project is rendered with that many seeds, and
/// the means are compared; the two sides use different seeds, since the noise test needs independent samples.
///
/// # Errors
/// If a picture cannot be read or rendered, or the two do not match.
pub fn compare(
    [test, reference]: [(&str, &Operand); 2],
    seeds: u32,
    options: &Options<'_>,
    observer: &mut dyn Observer,
) -> Result<Compared, CompareError> {
    if seeds == 0 || seeds > MAX_SEEDS {
        return Err(CompareError::Usage(format!("{seeds} seeds; valid: 1 to {MAX_SEEDS}")));
    }
    let is_project = |operand: &Operand| matches!(operand, Operand::Project(spec) if !spec.is_reference);
    if seeds > 1 && !is_project(test.1) && !is_project(reference.1) {
        return Err(CompareError::Usage("--seeds renders projects, and both are pictures".to_owned()));
    }
    let first_seeds = first_seeds(test.1, reference.1, seeds);
    let test = obtain(test.0, test.1, first_seeds[0], seeds, observer)?;
    let reference = obtain(reference.0, reference.1, first_seeds[1], seeds, observer)?;
    if test.channels[..3] != reference.channels[..3] {
        return Err(CompareError::Mismatch(format!(
            "{} holds the channels {} and {} holds {}\n       compare pictures of the same content; `curitiba render \
             --show` writes positions and normals, the plain output writes colours",
            test.name,
            test.channels.join(" "),
            reference.name,
            reference.channels.join(" ")
        )));
    }
    let space = common_space(&test, &reference);
    let mut notes = notes(&test, &reference, seeds);
    notes.extend(note_of_space(&test, &reference, space));
    let (test, reference) = (in_space(test, space), in_space(reference, space));
    let options = &Options { display: Display::of(space), ..*options };
    let explain = |error| match error {
        MetricError::Option { .. } => CompareError::Usage(error.to_string()),
        error => CompareError::Mismatch(explain(&error, &test.name, &reference.name)),
    };
    let (comparison, flip) = metrics::compare_with_map(&test.image, &reference.image, options).map_err(explain)?;
    let z_test = match (&test.variance, &reference.variance) {
        (Some(a), Some(b)) => Some(metrics::z_test(estimate(&test, a), estimate(&reference, b)).map_err(explain)?),
        _ => None,
    };
    Ok(Compared { test, reference, comparison, z_test, flip, space, notes })
}

/// The colour space of the comparison: linear if both sides hold colours, and either says that it is linear radiance.
fn common_space(test: &Side, reference: &Side) -> ColorSpace {
    let linear = |side: &Side| side.space == Some(ColorSpace::Linear);
    let colors = test.channels[0] == "R" || test.channels[0] == "Y";
    if colors && (linear(test) || linear(reference)) { ColorSpace::Linear } else { ColorSpace::Report }
}

/// Converts a side of display values to linear radiance if that is the space of the comparison. Its variance is multiplied by the
/// squared slope of the transfer function.
fn in_space(mut side: Side, space: ColorSpace) -> Side {
    if space == ColorSpace::Report || side.space != Some(ColorSpace::Report) {
        return side;
    }
    if let Some(variance) = &mut side.variance {
        for (variance, pixel) in variance.of_mean.pixels.iter_mut().zip(&side.image.pixels) {
            for channel in 0..3 {
                let slope = decode_slope(pixel[channel]);
                variance[channel] *= slope * slope;
            }
        }
    }
    for pixel in &mut side.image.pixels {
        let [r, g, b, alpha] = *pixel;
        let [r, g, b] = [r, g, b].map(decode);
        *pixel = [r, g, b, alpha];
    }
    side
}

/// Notes about the colours of a comparison of linear radiance; none for other comparisons.
fn note_of_space(test: &Side, reference: &Side, space: ColorSpace) -> Vec<String> {
    let sides = [test, reference];
    let coded = sides.into_iter().filter(|side| side.space == Some(ColorSpace::Report));
    let unknown = sides.into_iter().filter(|side| side.space.is_none());
    let mut notes = Vec::new();
    if space == ColorSpace::Linear {
        notes.push(
            "compared as linear radiance; SSIM and FLIP of what is displayed without exposure or tone curve".to_owned(),
        );
        notes.extend(coded.map(|side| format!("{} holds display values: they were decoded from sRGB", side.name)));
        notes.extend(unknown.map(|side| {
            format!("{} does not say what its colours are: they were taken for linear radiance", side.name)
        }));
    }
    notes
}

fn estimate<'a>(side: &'a Side, variance: &'a Variance) -> Estimate<'a> {
    Estimate { mean: &side.image, variance_of_mean: &variance.of_mean, samples: variance.samples }
}

/// First seeds of the two sides. If both are rendered with several seeds, the two ranges of seeds do not overlap.
fn first_seeds(test: &Operand, reference: &Operand, seeds: u32) -> [u32; 2] {
    let own = |operand: &Operand| match operand {
        Operand::Project(spec) => spec.settings.seed,
        Operand::Picture(_) => 0,
    };
    let (first, second) = (own(test), own(reference));
    let renders = |operand: &Operand| matches!(operand, Operand::Project(spec) if !spec.is_reference);
    let both = renders(test) && renders(reference);
    // Seeds wrap around, so the distance is the smaller of the two differences.
    let distance = first.wrapping_sub(second).min(second.wrapping_sub(first));
    if both && seeds > 1 && distance < seeds { [first, first.wrapping_add(seeds)] } else { [first, second] }
}

fn obtain(
    name: &str,
    operand: &Operand,
    first_seed: u32,
    seeds: u32,
    observer: &mut dyn Observer,
) -> Result<Side, CompareError> {
    match operand {
        Operand::Picture(path) => {
            let picture = read_image(path)?;
            Ok(Side {
                name: name.to_owned(),
                image: picture.image,
                channels: picture.channels,
                steps: picture.steps,
                space: picture.space,
                variance: picture.variance,
                rendered: None,
            })
        }
        Operand::Project(spec) if spec.is_reference => reference_of_picture(name, spec, observer),
        Operand::Project(spec) => render(name, spec, first_seed, seeds, observer),
    }
}

/// The stored reference of a project's picture.
fn reference_of_picture(name: &str, spec: &Spec, observer: &mut dyn Observer) -> Result<Side, CompareError> {
    let case = Case::new(&spec.project, spec.settings.clone(), Choice::CPU)?;
    let mut references = References::new(References::default_folder(), Duration::ZERO);
    let found = references.picture(&case, observer).cloned();
    let damaged = references.take_warnings();
    let reference = found.map_err(|error| match error {
        ReferenceError::Open(error) => CompareError::Open(error),
        ReferenceError::Render(error) => CompareError::Render(error),
        error => {
            CompareError::Usage(damaged.into_iter().chain([error.to_string()]).collect::<Vec<_>>().join("\n       "))
        }
    })?;
    Ok(Side {
        name: format!("{name}: {}, standard error {:.5}", reference.what, reference.own_error),
        image: reference.picture,
        channels: ["R", "G", "B", "A"].map(str::to_owned),
        steps: None,
        space: Some(case.display.space),
        variance: None,
        rendered: None,
    })
}

fn render(
    name: &str,
    spec: &Spec,
    first_seed: u32,
    seeds: u32,
    observer: &mut dyn Observer,
) -> Result<Side, CompareError> {
    let mut settings = spec.settings.clone();
    settings.seed = first_seed;
    let mut renderer = crate::open(&spec.project, settings, spec.choice, observer)?;
    let mut moments = None;
    for index in 0..seeds {
        renderer.set_seed(first_seed.wrapping_add(index));
        let frame = renderer.frame(observer)?;
        moments.get_or_insert_with(|| Moments::new(&frame)).add(&frame);
    }
    let moments = moments.unwrap_or_else(|| Moments::new(&renderer.window_image()));
    Ok(Side {
        name: name.to_owned(),
        image: moments.mean(),
        channels: ["R", "G", "B", "A"].map(str::to_owned),
        steps: None,
        space: Some(renderer.plan().display.space),
        variance: (seeds > 1).then(|| Variance { of_mean: moments.variance_of_mean(), samples: Some(seeds) }),
        rendered: Some(rendered(&renderer, first_seed, seeds)),
    })
}

fn rendered(renderer: &Renderer, first_seed: u32, frames: u32) -> Rendered {
    let steps = renderer.timeline().rows.iter().filter(|row| row.kind.per_frame());
    // A frame's time is the sum of its steps; steps that run several times in a frame count each time.
    let times: Vec<Vec<f64>> = steps.map(|row| per_frame(&row.host_ms, frames as usize)).collect();
    let whole: Vec<f64> = (0..frames as usize).map(|frame| times.iter().map(|step| step[frame]).sum()).collect();
    Rendered {
        frame_ms: median(&whole),
        frames,
        first_seed,
        raster: renderer.engines().raster.name(),
        raster_device: renderer.engines().raster.device(),
        rays: renderer.engines().rays.name(),
        rays_device: renderer.engines().rays.device(),
        warnings: renderer.warnings().groups().iter().map(WarningGroup::to_string).collect(),
        problems: renderer.plan().project.problems.clone(),
    }
}

/// The samples of a step, summed per frame.
fn per_frame(samples: &[f64], frames: usize) -> Vec<f64> {
    (0..frames)
        .map(|frame| samples[frame * samples.len() / frames..(frame + 1) * samples.len() / frames].iter().sum())
        .collect()
}

/// Running mean and sum of squared deviations of pictures (Welford 1962), in `f64`.
struct Moments {
    width: u32,
    height: u32,
    count: u32,
    /// Mean and sum of squared deviations of each value.
    values: Vec<[[f64; 2]; 4]>,
}

impl Moments {
    fn new(like: &Image) -> Self {
        let values = vec![[[0.0; 2]; 4]; like.pixels.len()];
        Self { width: like.width, height: like.height, count: 0, values }
    }

    fn add(&mut self, image: &Image) {
        self.count += 1;
        let count = f64::from(self.count);
        for (moments, pixel) in self.values.iter_mut().zip(&image.pixels) {
            for ([mean, squares], value) in moments.iter_mut().zip(pixel) {
                let value = f64::from(*value);
                let before = value - *mean;
                *mean += before / count;
                *squares += before * (value - *mean);
            }
        }
    }

    fn image(&self, of: impl Fn([f64; 2]) -> f64) -> Image {
        let pixels = self.values.iter().map(|moments| moments.map(|value| of(value) as f32)).collect();
        Image { width: self.width, height: self.height, pixels }
    }

    fn mean(&self) -> Image {
        self.image(|[mean, _]| mean)
    }

    fn variance_of_mean(&self) -> Image {
        let count = f64::from(self.count);
        self.image(|[_, squares]| squares / (count - 1.0) / count)
    }
}

/// The error with the user's names of the two pictures, and a remedy.
fn explain(error: &MetricError, test: &str, reference: &str) -> String {
    let name = |which: Which| match which {
        Which::Test => test,
        Which::Reference => reference,
    };
    match error {
        MetricError::Size { test: a, reference: b } => format!(
            "{test} is {} x {} pixels and {reference} is {} x {}\n       only pictures of one size can be compared; \
             render at one size: PROJECT.xml@size={}x{}",
            a[0], a[1], b[0], b[1], b[0], b[1]
        ),
        MetricError::NotFinite { which, x, y, channel, value, count } => format!(
            "{}: {count} pixel{} not finite, the first at x {x}, y {y} (from the top left, counted from 0): {channel} \
             is {value}\n       nothing is compared with such a picture; render it again, and look for the pass that \
             makes them with `curitiba render --show all`",
            name(*which),
            if *count == 1 { " is" } else { "s are" }
        ),
        _ => format!("{test} and {reference}: {error}"),
    }
}

fn notes(test: &Side, reference: &Side, seeds: u32) -> Vec<String> {
    let mut notes = Vec::new();
    for (side, other) in [(test, reference), (reference, test)] {
        if let (Some(steps), None) = (side.steps, other.steps) {
            notes.push(format!(
                "{} is a PNG: its values are cut to 0 to 1 and rounded to 1/{steps}, those of {} are not; compare .exr \
                 files for the whole range",
                side.name, other.name
            ));
        }
    }
    if test.channels[0] != "R" && test.channels[0] != "Y" {
        let held = test.channels[..3].join(" ");
        notes.push(format!("the channels are {held}: PSNR, SSIM and FLIP take them for colours and say little"));
    }
    if let (Some(a), Some(b)) = (&test.variance, &reference.variance)
        && (a.samples.is_none() || b.samples.is_none())
    {
        notes.push(
            "the number of samples behind a variance is not known: the z-test takes the variance as exact".to_owned(),
        );
    }
    let carries = |side: &Side| side.variance.is_some();
    if carries(test) != carries(reference) {
        let (with, without) = if carries(test) { (test, reference) } else { (reference, test) };
        notes.push(format!(
            "no z-test: {} carries a variance and {} does not; it needs --seeds N of a project, or an .exr with a layer \
             `variance`",
            with.name, without.name
        ));
    }
    if let (Some(a), Some(b), true) = (&test.rendered, &reference.rendered, seeds > 1) {
        let last = |rendered: &Rendered| rendered.first_seed.wrapping_add(rendered.frames - 1);
        notes.push(format!(
            "seeds {} to {} against {} to {}: a test of noise needs different ones",
            a.first_seed,
            last(a),
            b.first_seed,
            last(b)
        ));
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_of_known_samples() {
        let sample = |value: f32| Image::filled(2, 1, [value, -value, 0.5, 1.0]);
        let mut moments = Moments::new(&sample(0.0));
        for value in [2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0] {
            moments.add(&sample(value));
        }
        assert_eq!(moments.mean().pixels, vec![[5.0, -5.0, 0.5, 1.0]; 2]);
        let variance = moments.variance_of_mean().pixels[1];
        assert!((variance[0] - 32.0 / 7.0 / 8.0).abs() < 1e-6 && variance[2] == 0.0, "{variance:?}");
    }

    #[test]
    fn seeds_of_the_two_sides_never_overlap() {
        let operand = |text: &str| Operand::parse(text).expect("valid");
        let seeds = |a: &str, b: &str, count| first_seeds(&operand(a), &operand(b), count);
        assert_eq!(seeds("p.xml", "p.xml", 1), [0, 0]);
        assert_eq!(seeds("p.xml", "p.xml", 8), [0, 8]);
        assert_eq!(seeds("p.xml@seed=5", "p.xml@seed=7", 2), [5, 7]);
        assert_eq!(seeds("p.xml@seed=5", "p.xml@seed=7", 3), [5, 8]);
        assert_eq!(seeds("p.xml@seed=1", "p.xml@seed=4294967295", 4), [1, 5]);
        assert_eq!(seeds("p.xml", "a.exr", 4), [0, 0]);
    }

    #[test]
    fn operands_are_pictures_or_projects() {
        assert!(matches!(Operand::parse("a@b.PNG"), Ok(Operand::Picture(_))));
        assert!(matches!(Operand::parse("a.xml@seed=1"), Ok(Operand::Project(_))));
        for text in ["a.jpg", "a", ""] {
            assert!(Operand::parse(text).expect_err("neither").to_string().contains(".exr"));
        }
        assert!(Operand::parse("a.xml@sed=1").expect_err("a typing error").to_string().contains("`seed`"));
    }

    #[test]
    fn steps_that_run_twice_a_frame_are_summed() {
        assert_eq!(per_frame(&[1.0, 2.0, 3.0, 4.0], 2), [3.0, 7.0]);
        assert_eq!(per_frame(&[1.0, 2.0, 3.0], 3), [1.0, 2.0, 3.0]);
        assert_eq!(per_frame(&[5.0], 2), [0.0, 5.0]);
    }
}
