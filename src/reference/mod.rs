//! References: what the picture of a row should be, rendered by ourselves with more care than any row is.
//!
//! | the row computes | its reference |
//! |---|---|
//! | nothing by rays | the cpu rasteriser's picture |
//! | rays without noise | the same G-buffer, traced in `f64` by [`Double`](crate::passes::trace::Double) |
//! | ambient occlusion | the mean of two renders with different seeds and as many samples as it takes |
//! | a raster effect | the reference of the ray program in its place, with the constants that both have |
//!
//! All are of the corrected programs, whatever the row's fidelity: an error is against what is right. G-buffers are the
//! cpu rasteriser's, whatever drew the row.
//!
//! The number of samples is doubled until the estimated error of the reference is ten times below what is compared with
//! it. The estimate is half the root mean square difference of the two renders: that of their mean, if their errors are
//! independent and unbiased. The power that occlusion is raised to makes a bias that shrinks with the square of the
//! noise, far below it at the sample counts used here.
//!
//! Which of these references a row meets depends on the rows before it. With a fixed number of samples
//! ([`References::with_samples`]) it depends on the row alone, so that rows may be shared out over processes.
//!
//! # References of the picture
//!
//! All of these judge the effect alone: they share the G-buffer, the programs and their formulas with the rows. What a row shows of the
//! *picture* is judged by another one, which [`reference`](crate::passes::reference) renders from the camera in `f64`, with many samples a pixel. It
//! takes long, so it is made on demand alone ([`References::make`]); rows are compared with it where it is kept
//! ([`References::compare_picture`]).
//!
//! # Where they are kept
//! References are kept in a folder, as EXR files with a JSON file beside each. The name is a hash of everything that
//! determines the picture: the passes and their constants, the view, the lights, the size, the scene's content, the
//! sample count, and [`FORMAT`] for the programs themselves. Two versions of this program share none.

mod blocks;
mod cache;
mod make;
mod picture;
mod plan;
mod rays;

pub use blocks::Part;
pub use make::{Made, Of};

use crate::OpenError;
use crate::bench::Case;
use crate::bench::model::RowError;
use crate::passes::raster::cpu::CpuRasteriser;
use crate::passes::reference as renderer_of_pictures;
use crate::pipeline::executor::{Engines, Observer, RenderError, Renderer};
use crate::pipeline::image::Image;
use crate::pipeline::metrics::{self, Comparison, MetricError};
use crate::shard::Shard;
use blocks::{Blocks, Done};
use cache::{Entry, Folder};
use plan::{Kind, Request};
use rays::{ReferenceRays, Sampling};
use std::cell::Cell;
use std::collections::HashMap;
use std::path::PathBuf;
use std::rc::Rc;
use std::time::{Duration, Instant};

/// Changes whenever the same passes give other pictures than before: references of another format are not used.
pub const FORMAT: u32 = 2;

/// How many times the estimated error of a reference is to be below what is compared with it.
pub const MARGIN: f64 = 10.0;

/// Most samples of each of the two renders of a reference with noise.
pub const MOST_SAMPLES: u32 = 65_536;

/// Samples of each of the two renders of a reference with noise: the first, and the most.
const SAMPLES: (u32, u32) = (256, MOST_SAMPLES);

/// Samples a pixel that a reference of a picture may have: powers of two from the first to the second.
pub const PICTURE_SAMPLES: (u32, u32) = (64, 65_536);

/// Samples a pixel of a block of a reference of the picture. Changing it changes references of more samples: see [`FORMAT`] and that of pictures.
const PICTURE_BLOCK: u32 = 1024;

/// The same of each of the two renders of a reference of the effect. Numbers of samples that are no multiple of it are not cut into blocks.
const EFFECT_BLOCK: u32 = 4096;

/// Seeds of the two renders; far from those that people choose.
const SEEDS: [u32; 2] = [0x9e37_79b9, 0x7f4a_7c15];

/// Why a row has no error.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReferenceError {
    /// The reference's project, plan or engines.
    #[error("the reference cannot be opened: {0}")]
    Open(#[from] OpenError),
    /// Rendering it.
    #[error("the reference cannot be rendered: {0}")]
    Render(#[from] RenderError),
    /// Comparing with it.
    #[error("the picture cannot be compared with its reference: {0}")]
    Metric(#[from] MetricError),
    /// What the reference renderer does not know.
    #[error("the picture has no reference: {0}")]
    Picture(String),
    /// A reference without noise has no samples to choose.
    #[error(
        "the reference of the effect has no noise, so it has no samples to share out: the first row that asks for it makes it"
    )]
    NoNoise,
    /// A block of it cannot be kept for the others.
    #[error("{0}")]
    Keep(String),
    /// The reference of the picture is not kept; the command that makes it.
    #[error("the reference of the picture is not made; this makes it: {0}")]
    NoPicture(String),
}

impl From<renderer_of_pictures::ReferenceError> for ReferenceError {
    fn from(error: renderer_of_pictures::ReferenceError) -> Self {
        use renderer_of_pictures::ReferenceError as Error;
        match error {
            Error::Refused(refused) => Self::Render(refused.into()),
            Error::Cancelled => Self::Render(RenderError::Cancelled),
            error => Self::Picture(error.to_string()),
        }
    }
}

/// A reference picture.
#[derive(Debug, Clone)]
pub struct Reference {
    /// The picture.
    pub picture: Image,
    /// What it is, in words.
    pub what: String,
    /// Its name in the folder.
    pub key: String,
    /// Estimated root mean square error of its own; 0 where it has no noise.
    pub own_error: f64,
    /// Samples of each of its two renders, of the picture's reference of both; 0 where it has no noise.
    pub samples: u32,
}

/// Makes references, and keeps them.
pub struct References {
    folder: Folder,
    /// The same of references of pictures.
    folder_of_pictures: Folder,
    allowance: Duration,
    /// Samples of every reference with noise, where they are not to be refined.
    fixed: Option<u32>,
    /// By what a request says of itself: the content of its scenes.
    fingerprints: HashMap<String, Vec<String>>,
    /// By what determines a reference but for its samples.
    held: HashMap<String, Held>,
    /// By what a request says of itself: what determines its reference of the picture but for its samples.
    materials_of_pictures: HashMap<String, String>,
    /// References of pictures, by what determines them but for their samples.
    pictures: HashMap<String, Reference>,
    /// The renderer of the request served last.
    open: Option<(String, Open)>,
    warnings: Vec<String>,
}

struct Held {
    reference: Reference,
    /// How long rendering took.
    took: Duration,
    /// Time spent on this reference by this process.
    spent: Duration,
}

struct Open {
    renderer: Renderer,
    sampling: Rc<Cell<Sampling>>,
}

impl References {
    /// Keeps references in `folder`, which is made when the first is written; `allowance` is the time that refining one
    /// reference may take. The first render of a reference is made whatever it takes.
    #[must_use]
    pub fn new(folder: PathBuf, allowance: Duration) -> Self {
        Self {
            folder_of_pictures: Folder::new(folder.join("pictures")),
            folder: Folder::new(folder),
            allowance,
            fixed: None,
            fingerprints: HashMap::new(),
            held: HashMap::new(),
            materials_of_pictures: HashMap::new(),
            pictures: HashMap::new(),
            open: None,
            warnings: Vec::new(),
        }
    }

    /// Takes references of exactly this many samples in each of their two renders, 1 to [`MOST_SAMPLES`], whatever the rows ask for and
    /// however long they take: a row's error then depends on nothing but the row. `None` refines them.
    #[must_use]
    pub fn with_samples(self, samples: Option<u32>) -> Self {
        Self { fixed: samples.map(|samples| samples.clamp(1, MOST_SAMPLES)), ..self }
    }

    /// Where references are kept unless a folder is named: `CURITIBA_CACHE`, or `curitiba/references` in the user's
    /// cache folder (`XDG_CACHE_HOME`, `HOME/.cache`, `LOCALAPPDATA`), or in the folder for temporary files.
    #[must_use]
    pub fn default_folder() -> PathBuf {
        let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
        variable("CURITIBA_CACHE").unwrap_or_else(|| {
            variable("XDG_CACHE_HOME")
                .or_else(|| variable("HOME").map(|home| home.join(".cache")))
                .or_else(|| variable("LOCALAPPDATA"))
                .unwrap_or_else(std::env::temp_dir)
                .join("curitiba")
                .join("references")
        })
    }

    /// What went wrong with the folder since this was last asked: damaged files, files that cannot be written.
    pub fn take_warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    /// Compares a row's picture with its reference, which is refined until its own error is [`MARGIN`] times below the
    /// row's, or the time or the samples are used up; then the row says by how much it falls short.
    ///
    /// # Errors
    /// If the reference cannot be rendered, or the pictures cannot be compared.
    pub fn compare(
        &mut self,
        case: &Case,
        picture: &Image,
        observer: &mut dyn Observer,
    ) -> Result<RowError, ReferenceError> {
        let request = Request::new(case)?;
        let base = self.first(&request, observer)?;
        let (comparison, short) = loop {
            let reference = &self.held[&base].reference;
            let options = metrics::Options { display: request.plan.display, ..metrics::Options::default() };
            let comparison = metrics::compare(picture, &reference.picture, &options)?;
            let wanted = comparison.rmse / MARGIN;
            if reference.own_error <= wanted {
                break (comparison, None);
            }
            if let Some(end) = self.refine(&request, &base, wanted, observer)? {
                break (comparison, Some(end));
            }
        };
        let Reference { what, key, own_error, .. } = &self.held[&base].reference;
        let reference = match short {
            None => what.clone(),
            Some(end) => format!("{what}; {}", shortfall(&comparison, *own_error, end)),
        };
        Ok(RowError::Against { reference, key: key.clone(), own_error: *own_error, comparison })
    }

    /// The reference of a case, as good as it is already; rendered if there is none yet.
    ///
    /// # Errors
    /// If it cannot be rendered.
    pub fn get(&mut self, case: &Case, observer: &mut dyn Observer) -> Result<Reference, ReferenceError> {
        let request = Request::new(case)?;
        let base = self.first(&request, observer)?;
        Ok(self.held[&base].reference.clone())
    }

    /// Compares a row's picture with the reference of the picture, if it is kept; else says why it is not, and how it is made. Nothing is
    /// rendered.
    ///
    /// # Errors
    /// If the scene cannot be loaded, or the pictures cannot be compared.
    pub fn compare_picture(
        &mut self,
        case: &Case,
        picture: &Image,
        observer: &mut dyn Observer,
    ) -> Result<RowError, ReferenceError> {
        match self.picture(case, observer) {
            Ok(Reference { picture: right, what, key, own_error, .. }) => {
                let options = metrics::Options { display: case.display, ..metrics::Options::default() };
                let comparison = metrics::compare(picture, right, &options)?;
                let (reference, key, own_error) = (what.clone(), key.clone(), *own_error);
                Ok(RowError::Against { reference, key, own_error, comparison })
            }
            Err(error @ (ReferenceError::Picture(_) | ReferenceError::NoPicture(_))) => {
                Ok(RowError::Missing(error.to_string()))
            }
            Err(error) => Err(error),
        }
    }

    /// The reference of a case's picture, if it is kept.
    ///
    /// # Errors
    /// If it is not, with the command that makes it; if the scene cannot be loaded, whose content is a part of what it is kept by.
    pub fn picture(&mut self, case: &Case, observer: &mut dyn Observer) -> Result<&Reference, ReferenceError> {
        let request = Request::of_picture(case)?;
        if let Some(why) = picture::unsupported(&request.plan) {
            return Err(ReferenceError::Picture(why));
        }
        let missing = || ReferenceError::NoPicture(picture::command(case));
        if self.folder_of_pictures.is_empty() {
            // The scene need not be loaded.
            return Err(missing());
        }
        let base = self.base_of_picture(&request, observer)?;
        self.kept_picture(&request, &base).ok_or_else(missing)
    }

    /// The best reference of a picture that is kept.
    fn kept_picture(&mut self, request: &Request, base: &str) -> Option<&Reference> {
        if !self.pictures.contains_key(base) {
            let (least, most) = PICTURE_SAMPLES;
            for samples in std::iter::successors(Some(most), |samples| (*samples > least).then_some(samples / 2)) {
                match self.folder_of_pictures.load(&picture_material(base, samples), request.plan.window) {
                    Ok(Some(entry)) => {
                        self.pictures.insert(base.to_owned(), picture_reference(base, samples, entry));
                        break;
                    }
                    Ok(None) => {}
                    Err(why) => self.warnings.push(why),
                }
            }
        }
        self.pictures.get(base)
    }

    /// What determines the reference of a picture but for its samples.
    fn base_of_picture(&mut self, request: &Request, observer: &mut dyn Observer) -> Result<String, ReferenceError> {
        let identity = request.identity();
        if let Some(base) = self.materials_of_pictures.get(&identity) {
            return Ok(base.clone());
        }
        let open = self.open(request, observer)?;
        let job = picture::job(&open.renderer, 0..1).map_err(ReferenceError::Picture)?;
        let base = picture::material(&job, request.plan.display.space);
        self.materials_of_pictures.insert(identity, base.clone());
        Ok(base)
    }

    /// What determines a reference but for its samples, with the content of its scenes.
    fn base(&mut self, request: &Request, observer: &mut dyn Observer) -> Result<String, ReferenceError> {
        let identity = request.identity();
        if !self.fingerprints.contains_key(&identity) {
            let open = self.open(request, observer)?;
            let hashes = open.renderer.scenes().map(|scene| format!("{:032x}", scene.fingerprint())).collect();
            self.fingerprints.insert(identity.clone(), hashes);
        }
        Ok(request.base(&self.fingerprints[&identity]))
    }

    /// Makes sure that there is a reference, and returns what determines it but for its samples.
    fn first(&mut self, request: &Request, observer: &mut dyn Observer) -> Result<String, ReferenceError> {
        let base = self.base(request, observer)?;
        if self.held.contains_key(&base) {
            return Ok(base);
        }
        let levels: Vec<u32> = match (request.kind, self.fixed) {
            (Kind::Converged, Some(samples)) => vec![samples],
            (Kind::Converged, None) => {
                std::iter::successors(Some(SAMPLES.1), |n| (*n > SAMPLES.0).then_some(n / 2)).collect()
            }
            (Kind::Raster | Kind::Exact, _) => vec![0],
        };
        for samples in levels {
            match self.folder.load(&material(&base, samples), request.plan.window) {
                Ok(Some(entry)) => {
                    self.hold(request, &base, samples, entry, Duration::ZERO);
                    return Ok(base);
                }
                Ok(None) => {}
                Err(why) => self.warnings.push(format!("{why}; it is rendered again")),
            }
        }
        let samples = if request.kind == Kind::Converged { self.fixed.unwrap_or(SAMPLES.0) } else { 0 };
        self.render(request, &base, samples, Shard::WHOLE, observer)?;
        Ok(base)
    }

    /// Renders a reference with more samples, or says why it does not.
    fn refine(
        &mut self,
        request: &Request,
        base: &str,
        wanted: f64,
        observer: &mut dyn Observer,
    ) -> Result<Option<&'static str>, ReferenceError> {
        let held = &self.held[base];
        if self.fixed.is_some() {
            return Ok(Some("the number of samples is fixed"));
        }
        let samples = held.reference.samples;
        if samples == 0 || samples >= SAMPLES.1 {
            return Ok(Some("the most samples are used up"));
        }
        let left = self.allowance.saturating_sub(held.spent).as_secs_f64();
        // The error of these points falls no faster than as 1 / n: fewer doublings than this would not do.
        let doublings = (held.reference.own_error / wanted).log2().ceil().clamp(1.0, 8.0) as u32;
        let affordable = (0..=doublings).rev().find(|n| held.took.as_secs_f64() * f64::from(1 << n) <= left);
        match affordable {
            None | Some(0) => Ok(Some("the time allowed for it is used up")),
            Some(n) => {
                self.render(request, base, (samples << n).min(SAMPLES.1), Shard::WHOLE, observer)?;
                Ok(None)
            }
        }
    }

    /// Renders a reference, or a shard of its blocks, of which it says how far they are.
    fn render(
        &mut self,
        request: &Request,
        base: &str,
        samples: u32,
        shard: Shard,
        observer: &mut dyn Observer,
    ) -> Result<Option<Part>, ReferenceError> {
        let folder = self.folder.clone();
        let count = if is_in_blocks(samples) { samples / EFFECT_BLOCK } else { 1 };
        let base_of_blocks = format!("{base}\nseeds {SEEDS:?}, blocks of {EFFECT_BLOCK} samples");
        let blocks = Blocks { folder: &folder, base: base_of_blocks, count, size: request.plan.window };
        let mut warnings = Vec::new();
        let open = self.open(request, observer)?;
        let done = if samples == 0 {
            let start = Instant::now();
            let picture = open.renderer.frame(observer)?;
            Done::Whole(Entry { picture, own_error: 0.0, took: start.elapsed() })
        } else {
            blocks.work(shard, &mut warnings, &mut |index| {
                let length = samples / count;
                let mut render = |seed: u32| {
                    open.sampling.set(Sampling { all: samples, first: index * length, samples: length, seed });
                    open.renderer.frame(observer)
                };
                Ok([render(SEEDS[0])?, render(SEEDS[1])?])
            })?
        };
        self.warnings.append(&mut warnings);
        let entry = match done {
            Done::Part(part) => return Ok(Some(part)),
            Done::Whole(entry) => entry,
        };
        match folder.store(&material(base, samples), &entry) {
            Err(why) => self.warnings.push(why),
            Ok(()) => blocks.forget(),
        }
        if let Some(held) = self.held.get(base) {
            folder.forget(&material(base, held.reference.samples));
        }
        let took = entry.took;
        self.hold(request, base, samples, entry, took);
        Ok(None)
    }

    fn hold(&mut self, request: &Request, base: &str, samples: u32, entry: Entry, spent: Duration) {
        let spent = spent + self.held.get(base).map_or(Duration::ZERO, |held| held.spent);
        let reference = Reference {
            picture: entry.picture,
            what: request.words(samples),
            key: Folder::key(&material(base, samples)),
            own_error: entry.own_error,
            samples,
        };
        self.held.insert(base.to_owned(), Held { reference, took: entry.took, spent });
    }

    fn open(&mut self, request: &Request, observer: &mut dyn Observer) -> Result<&mut Open, ReferenceError> {
        let identity = request.identity();
        if self.open.as_ref().is_none_or(|(open, _)| *open != identity) {
            // The old one is released first: two would not always fit.
            self.open = None;
            let sampling =
                Rc::new(Cell::new(Sampling { all: SAMPLES.0, first: 0, samples: SAMPLES.0, seed: SEEDS[0] }));
            let rays = ReferenceRays::new(request.kind == Kind::Exact, Rc::clone(&sampling));
            let engines = Engines::new(Box::new(CpuRasteriser::new()), Box::new(rays));
            let renderer = Renderer::new(request.plan.clone(), engines, observer)?;
            self.open = Some((identity, Open { renderer, sampling }));
        }
        match &mut self.open {
            Some((_, open)) => Ok(open),
            None => unreachable!("it was opened above"),
        }
    }
}

/// Whether the reference of a case has noise: whether there are samples to choose a number of.
///
/// # Errors
/// As [`Case::new`].
pub fn has_noise(case: &Case) -> Result<bool, OpenError> {
    Ok(Request::new(case)?.kind == Kind::Converged)
}

/// Whether a reference of so many samples is the mean of blocks.
fn is_in_blocks(samples: u32) -> bool {
    samples > EFFECT_BLOCK && samples.is_multiple_of(EFFECT_BLOCK)
}

/// Everything that determines a reference, in words.
fn material(base: &str, samples: u32) -> String {
    let blocks = if is_in_blocks(samples) { format!(" in blocks of {EFFECT_BLOCK}") } else { String::new() };
    format!("{base}\nsamples {samples}{blocks}, seeds {SEEDS:?}")
}

/// The same of a reference of a picture.
fn picture_material(base: &str, samples: u32) -> String {
    let blocks = if samples > PICTURE_BLOCK { format!(" in blocks of {PICTURE_BLOCK}") } else { String::new() };
    format!("{}, {samples} samples a pixel{blocks}", from_the_camera(base))
}

fn from_the_camera(base: &str) -> String {
    format!("{base}\nfrom the camera, format {}", picture::FORMAT)
}

fn picture_reference(base: &str, samples: u32, entry: Entry) -> Reference {
    Reference {
        picture: entry.picture,
        what: picture::words(samples),
        key: Folder::key(&picture_material(base, samples)),
        own_error: entry.own_error,
        samples,
    }
}

fn shortfall(comparison: &Comparison, own_error: f64, end: &str) -> String {
    let times = comparison.rmse / own_error;
    format!("its own error is only {times:.1} times below this row's, not {MARGIN:.0}: {end}")
}

/// The mean, and the estimated root mean square error of it over the three colours.
fn mean_of_two(mut first: Image, second: &Image) -> (Image, f64) {
    let mut squares = 0.0;
    for (a, b) in first.pixels.iter_mut().zip(&second.pixels) {
        squares += (0..3).map(|i| (f64::from(a[i]) - f64::from(b[i])).powi(2)).sum::<f64>();
        *a = std::array::from_fn(|i| f32::midpoint(a[i], b[i]));
    }
    let values = (first.pixels.len() * 3).max(1) as f64;
    (first, (squares / values).sqrt() / 2.0)
}

#[cfg(test)]
mod tests;
