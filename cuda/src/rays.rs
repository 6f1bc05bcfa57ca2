//! The ray backend of a GPU, whichever tracer it asks.

use crate::device::{Buffer, Device};
use crate::layout::{BLOCK_HEIGHT, MAX_DEPTH, Params, RAY_COUNT_KINDS, RAY_COUNT_SLOTS, THROUGH_GLASS_ENTRIES};
use crate::scene::{SceneBuffers, shades};
use cudarc::driver::sys::CUevent_flags;
use curitiba_passes::cpu::{check, may_trace};
use curitiba_passes::effects::constants::THROUGH_GLASS;
use curitiba_passes::sampling::owen_sobol::reversed_sobol;
use curitiba_passes::sampling::square_root;
use curitiba_pipeline::backend::{BackendError, BuildStats, RayBackend, RayCounts, RayJob, RayStats};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::programs::{Fidelity, Fresnel, RayProgram, Sampler};
use curitiba_pipeline::scene::RenderScene;
use glam::Vec3;
use std::sync::Arc;
use std::time::Duration;

/// What traces the rays of the device programs.
pub trait DeviceTracer: Sized {
    /// `cuda` or `optix`.
    const NAME: &'static str;
    /// About how many bytes of host and device memory a triangle takes in the structure and while it is built.
    const BYTES_PER_TRIANGLE: u64;
    /// Finds what it needs on the device.
    ///
    /// # Errors
    /// If something is missing; says what, and what to do.
    fn new(device: &Device) -> Result<Self, BackendError>;
    /// What is to be known of it beyond the device; may be empty.
    fn description(&self) -> String;
    /// Builds the structure; the old one is released first.
    ///
    /// # Errors
    /// If the device cannot hold it.
    fn build(
        &mut self,
        device: &Device,
        scene: &RenderScene,
        filtered: &[bool],
        buffers: &SceneBuffers,
    ) -> Result<BuildStats, BackendError>;
    /// Releases the structure: until the next build there is nothing to hit.
    fn clear(&mut self);
    /// Makes a program ready to launch; done once for each.
    ///
    /// # Errors
    /// If the driver refuses it.
    fn load(&mut self, device: &Device, program: RayProgram) -> Result<(), BackendError>;
    /// Starts a loaded program over the rows that the parameters name.
    ///
    /// # Errors
    /// If the launch fails.
    fn launch(
        &mut self,
        device: &Device,
        program: RayProgram,
        fidelity: Fidelity,
        params: &mut Params,
    ) -> Result<(), BackendError>;
}

/// Our own traversal, compiled to kernels.
pub type CudaRays = DeviceRays<crate::bvh::BvhTracer>;

/// NVIDIA's OptiX, from the driver.
pub type OptixRays = DeviceRays<crate::optix::OptixTracer>;

/// Pixels of one launch at most: long passes are cut, so that no kernel runs into a display driver's time limit unless a
/// pixel is very dear, and progress is seen.
const PIXELS_OF_LAUNCH: u32 = 1 << 20;

/// The place of a point, given with its bits reversed, on a Z-shaped curve.
fn morton(reversed: &[u32; 2]) -> u64 {
    (0..32).fold(0, |code, bit| code << 2 | u64::from(reversed[0] >> bit & 1) << 1 | u64::from(reversed[1] >> bit & 1))
}

/// Device images and tables that are kept from pass to pass.
#[derive(Debug, Default)]
struct Images {
    position: Buffer<f32>,
    normal: Buffer<f32>,
    color: Buffer<f32>,
    triangle: Buffer<u32>,
    output: Buffer<f32>,
    counts: Buffer<u64>,
    sobol: Buffer<u32>,
    open_share: Buffer<f32>,
    through_glass: Buffer<f32>,
    shades: Buffer<crate::layout::Shade>,
}

/// A ray backend on the first GPU.
#[derive(Debug)]
pub struct DeviceRays<T> {
    device: Device,
    tracer: T,
    built: Option<(Arc<RenderScene>, SceneBuffers)>,
    images: Images,
}

impl<T: DeviceTracer> DeviceRays<T> {
    /// A backend with nothing built.
    ///
    /// # Errors
    /// If there is no driver, an old one, or no GPU; says which, and what to do.
    pub fn new() -> Result<Self, BackendError> {
        let device = Device::first(T::NAME)?;
        let tracer = T::new(&device)?;
        Ok(Self { device, tracer, built: None, images: Images::default() })
    }

    /// Copies a pass's images and tables to the device and describes them.
    fn describe(&mut self, job: &RayJob<'_>) -> Result<Params, BackendError> {
        let (device, images) = (&self.device, &mut self.images);
        let cast = bytemuck::cast_slice::<[f32; 4], f32>;
        device.replace("the positions", &mut images.position, cast(job.position))?;
        device.replace("the normals", &mut images.normal, cast(job.normal))?;
        device.replace("the colours", &mut images.color, cast(job.color))?;
        device.replace("the triangle ids", &mut images.triangle, job.triangle)?;
        let pixels = job.width as usize * job.height as usize;
        if images.output.0.as_ref().is_none_or(|output| output.len() < 4 * pixels) {
            images.output = Buffer::default();
            let room = device.stream().alloc_zeros(4 * pixels);
            images.output.0 = Some(room.map_err(|error| device.fault("making room for the picture", &error))?);
        }
        let samples = if job.program.info().params.contains(&"samples") { job.params.samples } else { 0 };
        let stratified = job.fidelity == Fidelity::Thesis || job.params.sampler == Sampler::Strata;
        let wrong = |why: String| check::missing(T::NAME, job, &why);
        let strata = if stratified { square_root(samples).map_err(wrong)? } else { 0 };
        if samples > 0 {
            let share = |open: u32| (open as f32 / samples as f32).powf(job.params.intensity);
            let shares: Vec<f32> = (0..=samples).map(share).collect();
            device.replace("the table of open shares", &mut images.open_share, &shares)?;
            if strata == 0 {
                let mut points: Vec<[u32; 2]> = (0..samples).map(reversed_sobol).collect();
                // Scrambling keeps neighbours in both dimensions neighbours: rays side by side go the same way.
                points.sort_by_key(morton);
                device.replace("the occlusion points", &mut images.sobol, points.as_flattened())?;
            }
        }
        let through: Vec<f32> = (0..THROUGH_GLASS_ENTRIES as i32).map(|count| THROUGH_GLASS.powi(count)).collect();
        device.replace("the table of glass", &mut images.through_glass, &through)?;
        device.replace("the materials", &mut images.shades, &shades(job))?;
        let counts = vec![0; (RAY_COUNT_SLOTS * RAY_COUNT_KINDS) as usize];
        device.replace("the ray counts", &mut images.counts, &counts)?;
        let (to_light, light_color) = job.sun.map_or((Vec3::ZERO, Vec3::ZERO), |sun| (-sun.direction, sun.color));
        Ok(Params {
            position: images.position.address(device),
            normal: images.normal.address(device),
            color: images.color.address(device),
            triangle: images.triangle.address(device),
            output: images.output.address(device),
            positions: 0,
            normals: 0,
            texcoords: 0,
            triangles: 0,
            materials: 0,
            shades: images.shades.address(device),
            textures: 0,
            texels: 0,
            sobol: images.sobol.address(device),
            open_share: images.open_share.address(device),
            through_glass: images.through_glass.address(device),
            ray_counts: images.counts.address(device),
            nodes: 0,
            leaves: 0,
            handle: 0,
            node_count: 0,
            width: job.width,
            height: job.height,
            first_row: 0,
            rows: job.height,
            seed: job.seed,
            samples,
            strata,
            depth: job.params.depth.min(MAX_DEPTH),
            cut: u32::from(
                job.fidelity == Fidelity::Corrected && job.shades.iter().any(|shade| shade.alpha_cutoff.is_some()),
            ),
            radius: job.params.radius,
            index: job.params.index,
            eye: job.eye.to_array(),
            to_light: to_light.to_array(),
            light_color: light_color.to_array(),
            scene_low: [0.0; 3],
            scene_high: [0.0; 3],
            schlick: u32::from(job.params.fresnel == Fresnel::Schlick),
        })
    }

    /// Runs a pass in bands of rows and returns the time that the device took.
    fn launch_bands(
        &mut self,
        job: &RayJob<'_>,
        params: &mut Params,
        progress: &Progress,
    ) -> Result<Duration, BackendError> {
        let band = (PIXELS_OF_LAUNCH / job.width.max(1)).next_multiple_of(BLOCK_HEIGHT).max(BLOCK_HEIGHT);
        let bands = job.height.div_ceil(band);
        progress.start(u64::from(bands));
        let (device, mut total) = (&self.device, 0.0);
        let doing = || format!("running `{}`", job.program.info().stem);
        for index in 0..bands {
            params.first_row = index * band;
            params.rows = band.min(job.height - params.first_row);
            let event = || device.stream().record_event(Some(CUevent_flags::CU_EVENT_DEFAULT));
            let start = event().map_err(|error| device.fault(&doing(), &error))?;
            self.tracer.launch(device, job.program, job.fidelity, params)?;
            let timed = event().and_then(|end| start.elapsed_ms(&end));
            total += f64::from(timed.map_err(|error| device.fault(&doing(), &error))?);
            progress.advance(1);
        }
        Ok(Duration::from_secs_f64(total.max(0.0) * 1e-3))
    }

    fn read_counts(&self) -> Result<RayCounts, BackendError> {
        let mut sums = vec![0_u64; (RAY_COUNT_SLOTS * RAY_COUNT_KINDS) as usize];
        if let Some(counts) = &self.images.counts.0 {
            let copied = self.device.stream().memcpy_dtoh(counts, &mut sums);
            copied.map_err(|error| self.device.fault("reading the ray counts", &error))?;
        }
        self.synchronise("reading the ray counts")?;
        let mut kinds = [0_u64; RAY_COUNT_KINDS as usize];
        for slot in sums.chunks_exact(kinds.len()) {
            kinds.iter_mut().zip(slot).for_each(|(kind, count)| *kind += count);
        }
        let [shadow, occlusion, reflected, refracted, certain] = kinds;
        Ok(RayCounts { shadow, occlusion, reflected, refracted, certain })
    }

    fn synchronise(&self, doing: &str) -> Result<(), BackendError> {
        self.device.stream().synchronize().map_err(|error| self.device.fault(doing, &error))
    }
}

impl<T: DeviceTracer> RayBackend for DeviceRays<T> {
    fn name(&self) -> &'static str {
        T::NAME
    }

    fn device(&self) -> String {
        let more = self.tracer.description();
        let separator = if more.is_empty() { "" } else { ", " };
        format!("{}{separator}{more}", self.device.description())
    }

    fn supports(&self, _: RayProgram, _: Fidelity) -> Result<(), BackendError> {
        Ok(())
    }

    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        // The old scene and structure are released first: two would not always fit.
        self.built = None;
        self.tracer.clear();
        let buffers = SceneBuffers::new(&self.device, scene)?;
        let mut stats = self.tracer.build(&self.device, scene, filtered, &buffers)?;
        stats.bytes += buffers.bytes();
        self.synchronise("building")?;
        self.built = Some((Arc::clone(scene), buffers));
        Ok(stats)
    }

    fn bytes_per_triangle(&self) -> u64 {
        T::BYTES_PER_TRIANGLE
    }

    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        check::images(T::NAME, job, output)?;
        if job.program != RayProgram::Dummy {
            check::scene(T::NAME, job)?;
        }
        if output.pixels.is_empty() {
            return Ok(RayStats::default());
        }
        self.tracer.load(&self.device, job.program)?;
        let mut params = self.describe(job)?;
        // Kept until the kernels are done.
        let unbuilt;
        match &self.built {
            _ if job.program == RayProgram::Dummy => {}
            Some((scene, buffers)) if std::ptr::eq(&raw const **scene, job.scene) => {
                buffers.fill(&self.device, &mut params);
            }
            _ if !may_trace(job) => {
                self.built = None;
                self.tracer.clear();
                unbuilt = SceneBuffers::new(&self.device, job.scene)?;
                unbuilt.fill(&self.device, &mut params);
            }
            _ => return Err(check::missing(T::NAME, job, "its scene's acceleration structure was not built")),
        }
        let device_time = self.launch_bands(job, &mut params, progress)?;
        let pixels = bytemuck::cast_slice_mut::<[f32; 4], f32>(&mut output.pixels);
        if let Some(picture) = &self.images.output.0 {
            let part = picture.slice(..pixels.len());
            let copied = self.device.stream().memcpy_dtoh(&part, pixels);
            copied.map_err(|error| self.device.fault("reading the picture", &error))?;
        }
        let rays = self.read_counts()?;
        Ok(RayStats { rays, device_time: Some(device_time) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sorted_points_that_follow_each_other_lie_in_one_part_of_the_square() {
        let mut points: Vec<[u32; 2]> = (0..64).map(reversed_sobol).collect();
        let quarter = |point: &[u32; 2]| point.map(|coordinate| coordinate & 1);
        let changes =
            |points: &[[u32; 2]]| points.windows(2).filter(|pair| quarter(&pair[0]) != quarter(&pair[1])).count();
        assert!(changes(&points) > 30);
        points.sort_by_key(morton);
        assert_eq!(changes(&points), 3);
    }
}
