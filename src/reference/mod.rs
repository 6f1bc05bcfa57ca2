//! References: what the picture of a row of a benchmark table should be, rendered more accurately than any row.
//!
//! | the row computes | its reference |
//! |---|---|
//! | nothing by rays | the cpu rasteriser's picture |
//! | rays without noise | the same G-buffer, traced in `f64` by [`Double`](crate::passes::trace::Double) |
//! | ambient occlusion, or shadows of a light's disc | the mean of two renders with different seeds and as many samples as needed |
//! | a raster effect | the reference of the ray program in its place, with the constants that both have |
//!
//! All references use the corrected programs, whatever the row's fidelity: errors are measured against the correct result.
//! G-buffers are the cpu rasteriser's, whatever drew the row.
//!
//! The number of samples is doubled until the estimated error of the reference is at most a tenth of the row's error. The estimate is half the root
//! mean square difference of the two renders, which is the error of their mean if their errors are independent and unbiased. The exponent of
//! occlusion causes a bias that shrinks with the square of the noise; at the numbers of samples used here it is far below the noise.
//!
//! With doubling, the reference that a row is compared with depends on the rows before that row. With a fixed number of samples
//! ([`References::with_samples`]) it depends on the row alone, so that rows can be distributed over processes.
//!
//! # References of the picture
//!
//! The references above judge the effect alone: they use the same G-buffer, programs and formulas as the rows. The *picture* of a
//! row is judged by another reference, which [`reference`](crate::passes::reference) renders from the camera in `f64` with many
//! samples a pixel. This takes long, so it is made only on demand ([`References::make`]); rows are compared with it if it is stored
//! ([`References::compare_picture`]).
//!
//! # Storage
//! References are stored in a folder, as EXR files with a JSON file beside each. The file name is a hash of everything that
//! determines the picture: the passes and their constants, the view, the lights, the size, the scene's content, the number of
//! samples, and [`FORMAT`] and the program's version for the programs themselves. Different versions of this program share no references.

mod blocks;
mod cache;
mod make;
mod memory;
mod picture;
mod plan;
mod rays;

pub use blocks::Part;
pub use make::{Made, Of};
pub use memory::InMemory;

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

/// Must change whenever the same passes give different pictures: references of another format are not used.
pub const FORMAT: u32 = 3;

/// Least ratio between a measured error and the estimated error of its reference.
pub const MARGIN: f64 = 10.0;

/// Greatest number of samples of each of the two renders of a reference with noise.
pub const MOST_SAMPLES: u32 = 65_536;

/// First and largest number of samples of each of the two renders of a reference with noise.
const SAMPLES: (u32, u32) = (256, MOST_SAMPLES);

/// Valid numbers of samples a pixel of a reference of the picture: powers of two from the first to the second.
pub const PICTURE_SAMPLES: (u32, u32) = (64, 65_536);

/// Samples a pixel of a block of a reference of the picture. Like [`FORMAT`], it is part of what determines references with more samples:
/// if it changes, they have other file names.
const PICTURE_BLOCK: u32 = 1024;

/// Samples in a block of each of the two renders of a reference of the effect. Numbers of samples that are no multiple of this are rendered in one
/// piece.
const EFFECT_BLOCK: u32 = 4096;

/// Seeds of the two renders, far from those that users choose.
const SEEDS: [u32; 2] = [0x9e37_79b9, 0x7f4a_7c15];

/// Why there is no reference, or no comparison with it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReferenceError {
    /// The reference's project, plan or engines could not be opened.
    #[error("the reference cannot be opened: {0}")]
    Open(#[from] OpenError),
    /// The reference could not be rendered.
    #[error("the reference cannot be rendered: {0}")]
    Render(#[from] RenderError),
    /// The picture could not be compared with the reference.
    #[error("the picture cannot be compared with its reference: {0}")]
    Metric(#[from] MetricError),
    /// The picture contains something that the reference renderer does not support.
    #[error("the picture has no reference: {0}")]
    Picture(String),
    /// The reference has no noise, so there is no number of samples to choose.
    #[error(
        "the reference of the effect has no noise, so it has no samples to share out: the first row that asks for it makes it"
    )]
    NoNoise,
    /// A block of the reference cannot be stored for other processes.
    #[error("{0}")]
    Keep(String),
    /// The reference of the picture is not stored; contains the command that makes it.
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
    /// Description of the reference.
    pub what: String,
    /// File name in the folder.
    pub key: String,
    /// Estimated root mean square error of the reference itself; 0 without noise.
    pub own_error: f64,
    /// Samples of each of its two renders, or of both together for a reference of the picture; 0 without noise.
    pub samples: u32,
}

/// Makes and stores references.
pub struct References {
    folder: Folder,
    /// Folder of the references of pictures.
    folder_of_pictures: Folder,
    allowance: Duration,
    /// Number of samples of every reference with noise; `None` if they are refined.
    fixed: Option<u32>,
    /// Hashes of the scenes of a request, by the request's identity.
    fingerprints: HashMap<String, Vec<String>>,
    /// References in memory, by what determines them except the number of samples.
    held: HashMap<String, Held>,
    /// What determines the reference of the picture except the number of samples, by the request's identity.
    materials_of_pictures: HashMap<String, String>,
    /// References of pictures in memory, by what determines them except the number of samples.
    pictures: HashMap<String, Reference>,
    /// The renderer of the last request, with the request's identity.
    open: Option<(String, Open)>,
    warnings: Vec<String>,
}

struct Held {
    reference: Reference,
    /// Time of rendering the reference, by whichever process.
    took: Duration,
    /// Time that this process has spent on this reference and on those with fewer samples.
    spent: Duration,
}

struct Open {
    renderer: Renderer,
    sampling: Rc<Cell<Sampling>>,
}

impl References {
    /// References in `folder`, which is made when the first reference is written. `allowance` is the time for refining one reference; the first
    /// render of a reference is made however long it takes.
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

    /// Uses exactly this number of samples, 1 to [`MOST_SAMPLES`], in each of the two renders of references with noise, however long they
    /// take. A row's error then depends only on the row. `None` refines references as needed.
    #[must_use]
    pub fn with_samples(self, samples: Option<u32>) -> Self {
        Self { fixed: samples.map(|samples| samples.clamp(1, MOST_SAMPLES)), ..self }
    }

    /// Default folder: `CURITIBA_CACHE`, or `curitiba/references` in the user's cache folder (`XDG_CACHE_HOME`, `HOME/.cache`,
    /// `LOCALAPPDATA`), or in the folder for temporary files.
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

    /// Releases the last scene. It is loaded again when a reference needs it.
    pub(crate) fn close(&mut self) {
        self.open = None;
    }

    /// Returns and clears warnings about the folder: damaged files, and files that could not be written.
    pub fn take_warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    /// Compares a row's picture with its reference. The reference is refined until its own error is at most the row's error divided by [`MARGIN`],
    /// or until time or samples are used up. If they are used up, the description of the reference in the result says how much is missing.
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

    /// The current reference of a case; it is rendered if there is none yet.
    ///
    /// # Errors
    /// If it cannot be rendered.
    pub fn get(&mut self, case: &Case, observer: &mut dyn Observer) -> Result<Reference, ReferenceError> {
        let request = Request::new(case)?;
        let base = self.first(&request, observer)?;
        Ok(self.held[&base].reference.clone())
    }

    /// Compares a row's picture with the reference of the picture, if that reference is stored; otherwise the result says why it is missing, and
    /// how to make it. Nothing is rendered.
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

    /// The stored reference of a case's picture.
    ///
    /// # Errors
    /// If the reference is not stored, with the command that makes it; if the picture cannot have one; or if the scene, whose content is part
    /// of the file's name, cannot be loaded.
    pub fn picture(&mut self, case: &Case, observer: &mut dyn Observer) -> Result<&Reference, ReferenceError> {
        let request = Request::of_picture(case)?;
        if let Some(why) = picture::unsupported(&request.plan) {
            return Err(ReferenceError::Picture(why));
        }
        let missing = || ReferenceError::NoPicture(picture::command(case));
        if self.folder_of_pictures.is_empty() {
            // No reference is stored, so the scene need not be loaded.
            return Err(missing());
        }
        let base = self.base_of_picture(&request, observer)?;
        self.kept_picture(&request, &base).ok_or_else(missing)
    }

    /// The stored reference of a picture; of several, the one with the most samples. `None` if none is stored.
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

    /// What determines the reference of a picture, except the number of samples.
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

    /// Text of everything that determines a reference, except the number of samples; it contains the hashes of the scenes.
    fn base(&mut self, request: &Request, observer: &mut dyn Observer) -> Result<String, ReferenceError> {
        let identity = request.identity();
        if !self.fingerprints.contains_key(&identity) {
            let open = self.open(request, observer)?;
            let hashes = open.renderer.scenes().map(|scene| format!("{:032x}", scene.fingerprint())).collect();
            self.fingerprints.insert(identity.clone(), hashes);
        }
        Ok(request.base(&self.fingerprints[&identity]))
    }

    /// Makes sure that a first reference exists, and returns what determines it except the number of samples.
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

    /// Renders a reference with more samples and returns `None`, or renders nothing and returns the reason.
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
        // The error of Sobol points falls at most as fast as 1 / n, so fewer doublings would not suffice.
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

    /// Renders and stores a reference, or the blocks of a shard. Returns the state of the blocks; `None` for a complete reference.
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
            Ok(()) => {
                let before = self.held.get(base).map(|held| held.reference.samples);
                if let Some(before) = before.filter(|before| *before < samples) {
                    folder.forget(&material(base, before));
                }
                blocks.forget();
            }
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
            // The old renderer is dropped first: two may not fit into memory.
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

/// The command that makes the reference of a case's picture.
#[must_use]
pub fn command_of_picture(case: &Case) -> String {
    picture::command(case)
}

/// Whether the reference of a case has noise, so that its number of samples can be chosen.
///
/// # Errors
/// As [`Case::new`].
pub fn has_noise(case: &Case) -> Result<bool, OpenError> {
    Ok(Request::new(case)?.kind == Kind::Converged)
}

/// Whether a reference of the effect with this number of samples is divided into blocks.
fn is_in_blocks(samples: u32) -> bool {
    samples > EFFECT_BLOCK && samples.is_multiple_of(EFFECT_BLOCK)
}

/// Text of everything that determines a reference.
fn material(base: &str, samples: u32) -> String {
    let blocks = if is_in_blocks(samples) { format!(" in blocks of {EFFECT_BLOCK}") } else { String::new() };
    format!("{base}\nsamples {samples}{blocks}, seeds {SEEDS:?}")
}

/// Text of everything that determines a reference of a picture.
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

/// The mean of two renders, and its estimated root mean square error over the three colours.
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
