//! Paths that a device follows. Each path is one pixel of a picture that is made for the purpose. The G-buffer entries of that pixel are
//! copies of those of the path's own pixel.

use super::allocation::Sampled;
use super::rounds::{FollowPaths, WAYS, each_path, sample, stochastic};
use crate::effects::dielectric::{Met, Sample};
use crate::sampling::hash::pixel_key;
use curitiba_pipeline::backend::{BackendError, NO_TRIANGLE, RayJob, RayStats};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::memory::Refused;
use curitiba_pipeline::programs::RayParams;
use std::time::Duration;

/// Width in pixels of the pictures whose pixels are paths.
const WIDTH: u32 = 256;

/// A picture is handed to the device once it has this many paths. It may have more, because the paths that a round adds to one pixel are
/// all put into one picture.
const PATHS: usize = 1 << 16;

/// Which ways of a path a device program follows.
#[derive(Debug, Clone, Copy)]
pub enum Sampling<'a> {
    /// All ways that the job asks for.
    All,
    /// Way 0 of the first half of each pixel. The fourth channel of the picture is 1 more than the stochastic events of the path ([`Met::bits`]).
    First,
    /// Some ways of each pixel of the job: the key of their random numbers, the number of the first way, the number of ways, and 0. The fourth
    /// channel is as with [`Self::First`].
    Listed(&'a [[u32; 4]]),
}

impl<'a> Sampling<'a> {
    /// Whether the ways are a sample.
    #[must_use]
    pub fn is_sampled(self) -> bool {
        !matches!(self, Self::All)
    }

    /// The ways of each pixel; empty unless they are listed.
    #[must_use]
    pub fn list(self) -> &'a [[u32; 4]] {
        match self {
            Self::Listed(list) => list,
            Self::All | Self::First => &[],
        }
    }
}

/// Runs on a device a job whose glass is sampled to the error `asked`. `run` runs a job whose parameters ask for no error, and follows the
/// ways that its [`Sampling`] states. `refused` makes the error if host memory is not enough. The G-buffer must be in host memory.
///
/// # Errors
/// Those of `run`, and `refused`.
pub fn sample_on_device(
    job: &RayJob<'_>,
    asked: f32,
    (output, progress): (&mut Image, &Progress),
    run: &mut dyn FnMut(&RayJob<'_>, Sampling<'_>, &mut Image) -> Result<RayStats, BackendError>,
    refused: &dyn Fn(Refused) -> BackendError,
) -> Result<RayStats, BackendError> {
    // The more `paths` a job asks for, the fewer pixels a backend puts into a launch. Here a path has `WAYS` ways at most.
    let params = RayParams { error: 0.0, paths: WAYS, ..job.params };
    let job_of_paths = RayJob { params, ..*job };
    let mut device =
        Device { job: &job_of_paths, run, refused, picture: Picture::default(), stats: RayStats::default() };
    let spent = sample(&mut device, (asked, job.params.paths), output, progress)?;
    Ok(RayStats { adaptive: Some(spent), ..device.stats })
}

/// The paths of a pass.
struct Device<'d, 'j> {
    job: &'d RayJob<'j>,
    run: &'d mut dyn FnMut(&RayJob<'_>, Sampling<'_>, &mut Image) -> Result<RayStats, BackendError>,
    refused: &'d dyn Fn(Refused) -> BackendError,
    picture: Picture,
    stats: RayStats,
}

/// A picture whose pixels are paths. Every list has one entry for each path.
#[derive(Debug, Default)]
struct Picture {
    position: Vec<[f32; 4]>,
    normal: Vec<[f32; 4]>,
    color: Vec<[f32; 4]>,
    triangle: Vec<u32>,
    ways: Vec<[u32; 4]>,
    /// For each path: the place of its pixel in the list of pixels, the half, and the number of ways.
    paths: Vec<(usize, u32, u32)>,
}

impl FollowPaths for Device<'_, '_> {
    fn first(&mut self, output: &mut Image) -> Result<Vec<Sampled>, BackendError> {
        let stats = (self.run)(self.job, Sampling::First, output)?;
        add(&mut self.stats, stats);
        let geometry = &self.job.scene.geometry;
        let material = |id| geometry.sphere(id).map_or_else(|| geometry.material_of(id), |sphere| sphere.material);
        let is_glass = |id: u32| id != NO_TRIANGLE && self.job.glass[material(id) as usize];
        let pixels = stochastic(output, |index| match is_glass(self.job.triangle[index]) {
            true => met(output.pixels[index]),
            false => Met::default(),
        });
        for pixel in output.pixels.iter_mut().zip(self.job.triangle).filter(|(_, triangle)| is_glass(**triangle)) {
            pixel.0[3] = 1.0;
        }
        pixels.map_err(self.refused)
    }

    fn extend(
        &mut self,
        pixels: &mut [Sampled],
        count: &(dyn Fn(usize, &Sampled) -> u32 + Sync),
        progress: &Progress,
    ) -> Result<(), BackendError> {
        for place in 0..pixels.len() {
            if self.picture.paths.len() >= PATHS {
                self.follow(pixels)?;
            }
            if progress.is_cancelled() {
                break;
            }
            let count = count(place, &pixels[place]);
            each_path(&mut pixels[place], count, |pixel, half, first, ways| {
                self.picture.push(self.job, pixel.index as usize, place, (half, first, ways));
            });
        }
        self.follow(pixels)
    }
}

impl Device<'_, '_> {
    /// Follows the paths of the picture, and adds what they show to their pixels.
    fn follow(&mut self, pixels: &mut [Sampled]) -> Result<(), BackendError> {
        let Picture { position, normal, color, triangle, ways, paths } = &mut self.picture;
        if paths.is_empty() {
            return Ok(());
        }
        let height = paths.len().div_ceil(WIDTH as usize);
        let all = height * WIDTH as usize;
        // The rest of the last row shows nothing.
        position.resize(all, [0.0; 4]);
        normal.resize(all, [0.0; 4]);
        color.resize(all, [0.0; 4]);
        triangle.resize(all, NO_TRIANGLE);
        ways.resize(all, [0; 4]);
        let mut output = Image::filled(WIDTH, height as u32, [0.0; 4]);
        let job = RayJob {
            width: WIDTH,
            height: height as u32,
            position: position.as_slice(),
            normal: normal.as_slice(),
            color: color.as_slice(),
            triangle: triangle.as_slice(),
            ..*self.job
        };
        let stats = (self.run)(&job, Sampling::Listed(ways), &mut output)?;
        add(&mut self.stats, stats);
        for ((place, half, ways), color) in paths.drain(..).zip(output.pixels) {
            pixels[place].add(half, color, ways, met(color));
        }
        position.clear();
        normal.clear();
        color.clear();
        triangle.clear();
        ways.clear();
        Ok(())
    }
}

impl Picture {
    /// Adds some ways of a pixel: the half, the number of the first way, and the number of ways.
    fn push(&mut self, job: &RayJob<'_>, index: usize, place: usize, (half, first, ways): (u32, u32, u32)) {
        self.position.push(job.position[index]);
        self.normal.push(job.normal[index]);
        self.color.push(job.color[index]);
        self.triangle.push(job.triangle[index]);
        let (x, y) = (job.origin[0] + index as u32 % job.width, job.origin[1] + index as u32 / job.width);
        let key = Sample::key_of_half(pixel_key(x, y, job.seed), half);
        self.ways.push([key, first, ways, 0]);
        self.paths.push((place, half, ways));
    }
}

/// The stochastic events that a device program wrote beside a colour.
fn met(color: [f32; 4]) -> Met {
    Met::of_bits((color[3] - 1.0) as u8)
}

/// Adds the statistics of a launch.
fn add(sum: &mut RayStats, stats: RayStats) {
    let time = |sum: &mut Option<Duration>, time: Option<Duration>| {
        if let Some(time) = time {
            *sum = Some(sum.unwrap_or_default() + time);
        }
    };
    sum.rays += stats.rays;
    time(&mut sum.upload, stats.upload);
    time(&mut sum.read_back, stats.read_back);
    time(&mut sum.device_time, stats.device_time);
    sum.held_bytes = sum.held_bytes.max(stats.held_bytes);
}
