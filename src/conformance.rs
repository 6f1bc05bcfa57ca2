//! Conformance of ray backends: every ray pass of a project runs on the processor and, with the same G-buffer, on other backends,
//! and the pictures are compared pixel by pixel in full precision.

use crate::pipeline::backend::{BackendError, BuildStats, RayBackend, RayCounts, RayJob, RayStats};
use crate::pipeline::executor::{Progress, median};
use crate::pipeline::glass::Dielectric;
use crate::pipeline::image::Image;
use crate::pipeline::programs::{Fidelity, RayParams, RayProgram};
use crate::pipeline::scene::RenderScene;
use serde::Serialize;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// Limits for the share of pixels that differ by more than a given amount.
///
/// Our own tracer on CUDA finds the same hits as the processor; what differs is the order in which the colours of glass are summed.
/// OptiX has its own triangle test, so rays through edges and grazing rays may differ; and the report's noise function (the
/// fraction of a sine times 43758) gives other occlusion rays for a hit that differs in its last bit. Our tracer on wgpu finds the
/// same hits wherever the driver rounds as the processor does; elsewhere directions differ in their last bits, like OptiX's hits.
pub const LIMITS: [Limit; 5] = [
    Limit { backend: "cuda", noise_at_hits: false, difference: 1e-5, share: 1e-4 },
    Limit { backend: "optix", noise_at_hits: false, difference: 1e-2, share: 2e-3 },
    Limit { backend: "optix", noise_at_hits: true, difference: 1e-2, share: 0.15 },
    Limit { backend: "wgpu", noise_at_hits: false, difference: 1e-2, share: 2e-3 },
    Limit { backend: "wgpu", noise_at_hits: true, difference: 1e-2, share: 0.15 },
];

/// A limit for differences between pictures.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Limit {
    /// The backend that it applies to.
    pub backend: &'static str,
    /// Whether it applies to `final` in thesis fidelity only. Limits without this flag do not apply to `final` in thesis fidelity, except those of
    /// `cuda`.
    pub noise_at_hits: bool,
    /// Difference in any component that a pixel may have.
    pub difference: f32,
    /// Share of pixels that may differ by more than [`Self::difference`].
    pub share: f64,
}

impl Limit {
    /// The limit for a pass. A backend without a limit of its own has the strictest one.
    #[must_use]
    pub fn of(backend: &str, job: &RayJob<'_>) -> Self {
        let noise = backend != "cuda" && (job.program, job.fidelity) == (RayProgram::Final, Fidelity::Thesis);
        let fits = |limit: &Self| limit.backend == backend && limit.noise_at_hits == noise;
        LIMITS.into_iter().find(fits).unwrap_or(LIMITS[0])
    }
}

/// Result of comparing two pictures of a pass.
#[derive(Debug, Clone, Serialize)]
pub struct Comparison {
    /// Number of pixels.
    pub pixels: usize,
    /// Number of pixels whose four components are equal bit by bit.
    pub identical: usize,
    /// Largest difference of a component; infinite if only one of the two is a number.
    pub max_difference: f32,
    /// Root mean square difference over all components.
    pub rmse: f64,
    /// Number of pixels with a component that differs by more than 1e-6.
    pub above_1e_6: usize,
    /// Number of pixels with a component that differs by more than 1e-5.
    pub above_1e_5: usize,
    /// Number of pixels with a component that differs by more than 1e-3.
    pub above_1e_3: usize,
    /// Number of pixels with a component that differs by more than 1e-2.
    pub above_1e_2: usize,
}

impl Comparison {
    /// Whether at most the limit's share of pixels differs by more than the limit's difference, which must be 1e-5 or 1e-2.
    #[must_use]
    pub fn is_within(&self, limit: &Limit) -> bool {
        let above = if limit.difference > 1e-3 { self.above_1e_2 } else { self.above_1e_5 };
        above as f64 <= limit.share * self.pixels as f64
    }
}

/// Result of one pass on one backend.
#[derive(Debug, Clone, Serialize)]
pub struct Record {
    /// Stem of the project's file.
    pub project: String,
    /// Name of the camera; `None` for each pass's own.
    pub camera: Option<String>,
    /// `corrected` or `thesis`.
    pub fidelity: String,
    /// Name of the backend.
    pub backend: &'static str,
    /// Name of the program.
    pub program: &'static str,
    /// Number of triangles of the scene.
    pub triangles: usize,
    /// Device times of all runs except the first, milliseconds.
    pub device_ms: Vec<f64>,
    /// Median of the device times.
    pub device_ms_median: f64,
    /// Median host time of the same runs, milliseconds.
    pub host_ms_median: f64,
    /// Time of the single run on the processor, milliseconds; `None` if it was skipped.
    pub cpu_ms: Option<f64>,
    /// Number of rays of a run.
    pub rays: RayCounts,
    /// Number of rays of the processor's run.
    pub cpu_rays: Option<RayCounts>,
    /// Millions of rays per second of device time, without those of photons.
    pub mrays_per_second: f64,
    /// Comparison with the processor's picture; `None` if the processor's run was skipped.
    pub comparison: Option<Comparison>,
    /// Whether the comparison is within [`LIMITS`]; true without a comparison.
    pub within_limits: bool,
}

/// Result of building an acceleration structure.
#[derive(Debug, Clone, Serialize)]
pub struct Build {
    /// Stem of the project's file.
    pub project: String,
    /// Name of the backend.
    pub backend: &'static str,
    /// Number of triangles of the scene.
    pub triangles: usize,
    /// Host time, milliseconds.
    pub ms: f64,
    /// Memory of the structure, bytes.
    pub bytes: u64,
    /// Number of nodes; 0 if the backend does not report it.
    pub nodes: u64,
}

/// Results of all passes so far.
#[derive(Debug, Default)]
pub struct Found {
    /// Results of passes.
    pub records: Vec<Record>,
    /// Results of building structures.
    pub builds: Vec<Build>,
}

/// The processor's backend, with other backends that run the same jobs. Later passes read the processor's pictures.
pub struct Beside {
    /// The processor's backend.
    pub cpu: Box<dyn RayBackend>,
    /// The backends that are compared with it.
    pub others: Vec<Box<dyn RayBackend>>,
    /// Receives the results.
    pub found: Arc<Mutex<Found>>,
    /// Stem of the project's file, for the results.
    pub project: String,
    /// Name of the camera, for the results.
    pub camera: Option<String>,
    /// Runs of each pass on the other backends, at least 2; the first is not timed.
    pub runs: u32,
    /// Whether the processor runs too. Otherwise passes are only timed, and the picture is not usable.
    pub compare: bool,
}

impl Beside {
    fn record(
        &mut self,
        index: usize,
        job: &RayJob<'_>,
        cpu: Option<(&Image, f64, RayCounts)>,
    ) -> Result<(), BackendError> {
        let other = &mut self.others[index];
        let mut output = Image::filled(job.width, job.height, [f32::NAN; 4]);
        let (mut device_ms, mut host_ms, mut rays) = (Vec::new(), Vec::new(), RayCounts::default());
        for run in 0..self.runs.max(2) {
            let start = Instant::now();
            let stats = other.run(job, &mut output, &Progress::default())?;
            let host = start.elapsed().as_secs_f64() * 1e3;
            rays = stats.rays;
            if run > 0 {
                host_ms.push(host);
                device_ms.extend(stats.device_time.map(|time| time.as_secs_f64() * 1e3));
            }
        }
        let comparison = cpu.map(|(picture, ..)| compare(&picture.pixels, &output.pixels));
        let device_ms_median = median(&device_ms);
        // The rays of photons are the processor's on all backends.
        let on_device = rays.total() - rays.photons.rays;
        let limit = Limit::of(other.name(), job);
        let within_limits = comparison.as_ref().is_none_or(|found| found.is_within(&limit));
        let record = Record {
            project: self.project.clone(),
            camera: self.camera.clone(),
            fidelity: format!("{:?}", job.fidelity).to_lowercase(),
            backend: other.name(),
            program: job.program.info().stem,
            triangles: job.scene.geometry.triangles.len(),
            device_ms_median,
            host_ms_median: median(&host_ms),
            device_ms,
            cpu_ms: cpu.map(|(_, ms, _)| ms),
            rays,
            cpu_rays: cpu.map(|(.., rays)| rays),
            mrays_per_second: on_device as f64 / device_ms_median.max(1e-9) / 1e3,
            comparison,
            within_limits,
        };
        self.found.lock().unwrap_or_else(PoisonError::into_inner).records.push(record);
        Ok(())
    }
}

/// Compares two pictures pixel by pixel.
#[must_use]
pub fn compare(expected: &[[f32; 4]], found: &[[f32; 4]]) -> Comparison {
    let mut result = Comparison {
        pixels: expected.len(),
        identical: 0,
        max_difference: 0.0,
        rmse: 0.0,
        above_1e_6: 0,
        above_1e_5: 0,
        above_1e_3: 0,
        above_1e_2: 0,
    };
    for (a, b) in expected.iter().zip(found) {
        if a.map(f32::to_bits) == b.map(f32::to_bits) {
            result.identical += 1;
            continue;
        }
        // If only one of the two is a number, the difference is infinite.
        let difference = |a: f32, b: f32| {
            let difference = (a - b).abs();
            if difference.is_nan() && !(a.is_nan() && b.is_nan()) { f32::INFINITY } else { difference.max(0.0) }
        };
        let worst = (0..4).map(|channel| difference(a[channel], b[channel])).fold(0.0, f32::max);
        result.max_difference = result.max_difference.max(worst);
        result.rmse += (0..4).map(|channel| f64::from(difference(a[channel], b[channel])).powi(2)).sum::<f64>() / 4.0;
        result.above_1e_6 += usize::from(worst > 1e-6);
        result.above_1e_5 += usize::from(worst > 1e-5);
        result.above_1e_3 += usize::from(worst > 1e-3);
        result.above_1e_2 += usize::from(worst > 1e-2);
    }
    result.rmse = (result.rmse / expected.len().max(1) as f64).sqrt();
    result
}

impl RayBackend for Beside {
    fn name(&self) -> &'static str {
        self.cpu.name()
    }

    fn device(&self) -> String {
        self.cpu.device()
    }

    fn supports(&self, program: RayProgram, fidelity: Fidelity) -> Result<(), BackendError> {
        self.others.iter().try_for_each(|other| other.supports(program, fidelity))
    }

    fn supports_glass(
        &self,
        program: RayProgram,
        params: &RayParams,
        dielectrics: &[Dielectric],
    ) -> Result<(), BackendError> {
        self.others.iter().try_for_each(|other| other.supports_glass(program, params, dielectrics))
    }

    fn traces_sun_discs(&self) -> bool {
        self.others.iter().all(|other| other.traces_sun_discs())
    }

    fn knows_lights(&self) -> bool {
        self.others.iter().all(|other| other.knows_lights())
    }

    fn sees_skies(&self) -> bool {
        self.others.iter().all(|other| other.sees_skies())
    }

    fn traces_spheres(&self) -> bool {
        self.others.iter().all(|other| other.traces_spheres())
    }

    fn traces_cones(&self) -> bool {
        self.others.iter().all(|other| other.traces_cones())
    }

    fn shoots_photons(&self) -> bool {
        self.others.iter().all(|other| other.shoots_photons())
    }

    fn continues_sequences(&self) -> bool {
        self.others.iter().all(|other| other.continues_sequences())
    }

    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        for other in &mut self.others {
            let start = Instant::now();
            let stats = other.build(scene, filtered)?;
            let ms = start.elapsed().as_secs_f64() * 1e3;
            let triangles = scene.geometry.triangles.len();
            let (project, backend) = (self.project.clone(), other.name());
            let build = Build { project, backend, triangles, ms, bytes: stats.bytes, nodes: stats.nodes };
            self.found.lock().unwrap_or_else(PoisonError::into_inner).builds.push(build);
        }
        if self.compare { self.cpu.build(scene, filtered) } else { Ok(BuildStats::default()) }
    }

    fn bytes_per_triangle(&self) -> u64 {
        self.others.iter().map(|other| other.bytes_per_triangle()).sum::<u64>() + self.cpu.bytes_per_triangle()
    }

    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        let start = Instant::now();
        let stats = if self.compare { self.cpu.run(job, output, progress)? } else { RayStats::default() };
        let ms = start.elapsed().as_secs_f64() * 1e3;
        for index in 0..self.others.len() {
            let cpu = self.compare.then_some((&*output, ms, stats.rays));
            self.record(index, job, cpu)?;
        }
        Ok(stats)
    }
}

impl Record {
    /// The result as a line of text.
    #[must_use]
    pub fn in_words(&self) -> String {
        format!(
            "{} {:?} {} {}: {:.3} ms on the device, {:.0} Mrays/s, {}",
            self.project,
            self.camera,
            self.fidelity,
            self.backend,
            self.device_ms_median,
            self.mrays_per_second,
            self.comparison.as_ref().map_or("not compared".to_owned(), |found| format!("{found:?}"))
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PIXELS: usize = 1000;

    fn with(changed: usize, by: f32) -> Comparison {
        let expected = vec![[0.5; 4]; PIXELS];
        let mut found = expected.clone();
        found[..changed].iter_mut().for_each(|pixel| pixel[1] += by);
        compare(&expected, &found)
    }

    #[test]
    fn pixels_that_are_off_are_counted_and_judged_by_the_limit_of_their_backend() {
        let [cuda, optix, noisy, wgpu, _] = &LIMITS;
        assert!(with(0, 0.0).is_within(cuda) && with(0, 0.0).identical == PIXELS);
        assert!(with(PIXELS, 5e-6).is_within(cuda), "rounding passes");
        assert!(!with(1, 1e-4).is_within(cuda), "one pixel in a thousand is too many for our own tracer");
        assert!(with(2, 0.1).is_within(optix) && !with(3, 0.1).is_within(optix));
        assert!(with(2, 0.1).is_within(wgpu) && !with(3, 0.1).is_within(wgpu));
        assert!(with(150, 0.1).is_within(noisy) && !with(151, 0.1).is_within(noisy));
        let known = with(4, 0.25);
        assert!((known.rmse - (0.0625_f64 * 4.0 / 4000.0).sqrt()).abs() < 1e-9 && known.max_difference == 0.25);
    }

    #[test]
    fn what_is_a_number_on_one_side_only_is_as_far_off_as_can_be() {
        let found = with(3, f32::NAN);
        assert_eq!((found.max_difference, found.above_1e_2), (f32::INFINITY, 3));
        let both = compare(&[[f32::NAN; 4]], &[[-f32::NAN; 4]]);
        assert_eq!((both.max_difference, both.above_1e_6), (0.0, 0));
    }
}
