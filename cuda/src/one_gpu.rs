//! The ray programs on one GPU, with any tracer. [`crate::multi_gpu`] makes a backend from one or several `OneGpu`.

use crate::device::{Address, Device};
use crate::focused::FocusedTables;
use crate::images::{FocusedBuffers, Images};
use crate::layout::{
    ASKS_EYE, ASKS_FOCUSED, ASKS_STRAIGHT, BLOCK_HEIGHT, EXCEPTION_SLOT, MAX_DEPTH, MEDIA_BYTES, Params,
    RAY_COUNT_KINDS, REACHES, THROUGH_GLASS_ENTRIES,
};
use crate::peers::{Copies, Lent, copy_here, copy_parts};
use crate::programs::Key;
use crate::scene::{SceneBuffers, bodies, emissions, lights, shades};
use crate::shared_gbuffer::Joined;
use crate::sobol_table::table;
use crate::staging::Staging;
use crate::stripes::{Launch, Stripe, launches, pixels_of_launch};
use crate::ways::WayTables;
use cudarc::driver::CudaEvent;
use cudarc::driver::sys::CUevent_flags;
use curitiba_passes::adaptive::Sampling;
use curitiba_passes::cpu::{check, may_trace};
use curitiba_passes::effects::constants::THROUGH_GLASS;
use curitiba_passes::effects::dielectric::{Focused, Variant};
use curitiba_passes::effects::{LightTable, Preparation};
use curitiba_passes::sampling::HemisphereSampler;
use curitiba_passes::sampling::cone::ConeSampler;
use curitiba_pipeline::backend::{BackendError, BuildStats, PixelCone, RayCounts, RayJob, RayStats};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::glass::{GlassShadow, Shape};
use curitiba_pipeline::programs::{Fidelity, RayProgram, TextureLod};
use curitiba_pipeline::scene::RenderScene;
use curitiba_pipeline::shared::{SharedGBuffer, after_picture};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Traces the rays of the device programs.
pub trait DeviceTracer: Sized + Send {
    /// Name of the tracer: `cuda` or `optix`.
    const NAME: &'static str;
    /// Approximate host and device memory that a triangle takes, in the structure and during its build together, in bytes.
    const BYTES_PER_TRIANGLE: u64;
    /// What the processor computes from a scene, once for all GPUs.
    type Prepared: Sync;
    /// Prepares a scene. `filtered` is as in [`RayBackend::build`](curitiba_pipeline::backend::RayBackend::build).
    fn prepare(scene: &RenderScene, filtered: &[bool]) -> Self::Prepared;
    /// Prepares the tracer on a device.
    ///
    /// # Errors
    /// If something is missing; the message says what, and what to do.
    fn new(device: &Device) -> Result<Self, BackendError>;
    /// The device programs of a key; `None` if there are none and the pass must run on another backend.
    fn program(key: Key) -> Option<&'static str>;
    /// Details of the tracer in addition to the device's name; may be empty.
    fn description(&self) -> String;
    /// Builds the structure. The caller has released the previous one with [`Self::clear`].
    ///
    /// # Errors
    /// If it does not fit into the device's memory.
    fn build(
        &mut self,
        device: &Device,
        scene: &RenderScene,
        filtered: &[bool],
        prepared: &Self::Prepared,
        buffers: &SceneBuffers,
    ) -> Result<BuildStats, BackendError>;
    /// Releases the structure: until the next build there is nothing to hit.
    fn clear(&mut self);
    /// Device memory in bytes that is kept between passes, without the structure.
    fn held_bytes(&self) -> u64;
    /// Loads the job's program; each variant is compiled once.
    ///
    /// # Errors
    /// If the driver refuses it.
    fn load(&mut self, device: &Device, job: &RayJob<'_>) -> Result<(), BackendError>;
    /// Starts the job's program, which must be loaded, on the rows that the parameters name.
    ///
    /// # Errors
    /// If the launch fails.
    fn launch(&mut self, device: &Device, job: &RayJob<'_>, params: &mut Params) -> Result<(), BackendError>;
}

/// Greatest number of launches in flight: enough that the device need not wait for the host between two of them.
const LAUNCHES_AHEAD: usize = 3;

/// The message for a code that the exception program reported.
fn stopped(program: RayProgram, code: i64) -> String {
    let meaning = match code {
        -1 => "the stack was full",
        -2 => "rays were nested too deeply",
        _ => "see OptiX's list of exceptions",
    };
    let stem = program.info().stem;
    format!("running `{stem}`: OptiX stopped it with exception {code}: {meaning}; please report it, with the project")
}

/// A job on a device.
#[derive(Clone, Copy)]
pub(crate) struct Work<'a> {
    pub job: &'a RayJob<'a>,
    /// The light that glass focuses in it.
    pub focused: &'a Focused,
    /// Which ways its paths follow.
    pub sampling: Sampling<'a>,
}

/// One GPU with its own copy of scene and structure.
#[derive(Debug)]
pub(crate) struct OneGpu<T> {
    pub device: Device,
    pub tracer: T,
    built: Option<(Arc<RenderScene>, SceneBuffers)>,
    images: Images,
    joined: Option<Joined>,
    staging: Staging,
}

impl<T: DeviceTracer> OneGpu<T> {
    /// A GPU without a structure.
    pub fn new(device: Device) -> Result<Self, BackendError> {
        let tracer = T::new(&device)?;
        Ok(Self { device, tracer, built: None, images: Images::default(), joined: None, staging: Staging::default() })
    }

    /// Opens a G-buffer that the rasteriser fills; releases the one opened before.
    pub fn join(&mut self, shared: SharedGBuffer) -> Result<(), BackendError> {
        self.joined = None;
        self.joined = Some(Joined::open(&self.device, shared)?);
        Ok(())
    }

    /// The shared G-buffer of a job and the semaphore value to wait for; `None` for a job that reads no shared G-buffer.
    fn shared(&self, job: &RayJob<'_>) -> Result<Option<(&Joined, u64)>, BackendError> {
        let Some(value) = job.shared else { return Ok(None) };
        match self.joined.as_ref().filter(|joined| joined.has_size(job.width, job.height)) {
            Some(joined) => Ok(Some((joined, value))),
            None => Err(check::missing(T::NAME, job, "no shared G-buffer of its size was opened")),
        }
    }

    /// Copies the rows of the G-buffer that are computed here to the device.
    fn copy(&mut self, job: &RayJob<'_>, stripes: &[Stripe<'_>]) -> Result<Duration, BackendError> {
        let start = Instant::now();
        let (device, images) = (&self.device, &mut self.images);
        let cast = bytemuck::cast_slice::<[f32; 4], f32>;
        let parts: Vec<_> = stripes.iter().map(|stripe| stripe.range(job.width)).collect();
        let fours: Vec<_> = parts.iter().map(|part| 4 * part.start..4 * part.end).collect();
        device.replace_parts("the positions", &mut images.position, cast(job.position), &fours)?;
        device.replace_parts("the normals", &mut images.normal, cast(job.normal), &fours)?;
        device.replace_parts("the colours", &mut images.color, cast(job.color), &fours)?;
        device.replace_parts("the triangle ids", &mut images.triangle, job.triangle, &parts)?;
        self.synchronise("copying the G-buffer")?;
        Ok(start.elapsed())
    }

    /// Lends the shared G-buffer of a job to other GPUs, as a copy in this GPU's memory: other GPUs can read the memory that the rasteriser
    /// allocated only as slowly as host memory.
    #[allow(unsafe_code, reason = "copies from the memory of the rasteriser")]
    pub fn lend(&mut self, job: &RayJob<'_>) -> Result<Lent, BackendError> {
        self.device.bind()?;
        let Some((joined, value)) = self.shared(job)? else {
            return Err(check::missing(T::NAME, job, "no shared G-buffer was handed over"));
        };
        joined.wait(&self.device, value)?;
        let [position, normal, color, triangle] = joined.attachments(&self.device);
        let (device, images) = (&self.device, &mut self.images);
        let pixels = job.width as usize * job.height as usize;
        let floats = [
            ("the positions", &mut images.position, position),
            ("the normals", &mut images.normal, normal),
            ("the colours", &mut images.color, color),
        ];
        let mut attachments = [0; 4];
        for ((what, buffer, from), attachment) in floats.into_iter().zip(&mut attachments) {
            // SAFETY: attachments have four numbers for each pixel of the picture, whose size was compared, and live until the pass has
            // ended.
            *attachment = unsafe { copy_here(device, what, buffer, from, 4 * pixels) }?;
        }
        // SAFETY: as above, with one number a pixel.
        attachments[3] = unsafe { copy_here(device, "the triangle ids", &mut images.triangle, triangle, pixels) }?;
        let ready = device.stream().record_event(None);
        let ready = ready.map_err(|error| device.fault("waiting for the rasteriser", &error))?;
        Ok(Lent { context: Arc::clone(device.context()), attachments, ready })
    }

    /// Starts copying those rows of a lent G-buffer that are computed here.
    #[allow(unsafe_code, reason = "copies from the memory of another GPU")]
    fn borrow(&mut self, job: &RayJob<'_>, lent: &Lent, stripes: &[Stripe<'_>]) -> Result<Copies, BackendError> {
        let (device, images) = (&self.device, &mut self.images);
        let parts: Vec<_> = stripes.iter().map(|stripe| stripe.range(job.width)).collect();
        let fours: Vec<_> = parts.iter().map(|part| 4 * part.start..4 * part.end).collect();
        let pixels = job.width as usize * job.height as usize;
        let [position, normal, color, triangle] = lent.attachments.map(|from| (&*lent.context, from));
        let floats = [
            ("the positions", &mut images.position, position),
            ("the normals", &mut images.normal, normal),
            ("the colours", &mut images.color, color),
        ];
        Copies::start(device, lent, || {
            for (what, buffer, from) in floats.into_iter().filter(|(_, _, from)| from.1 != 0) {
                // SAFETY: attachments have four numbers for each pixel of the picture, whose size the lender compared, and live until
                // the pass has ended.
                unsafe { copy_parts(device, what, buffer, from, 4 * pixels, &fours) }?;
            }
            if triangle.1 != 0 {
                // SAFETY: as above, with one number a pixel.
                unsafe { copy_parts(device, "the triangle ids", &mut images.triangle, triangle, pixels, &parts) }?;
            }
            Ok(())
        })
    }

    /// Addresses of positions, normals, colours and triangle ids: in the shared G-buffer or, if `copied`, in this GPU's copy.
    fn gbuffer(&self, job: &RayJob<'_>, copied: bool) -> Result<[Address; 4], BackendError> {
        let (device, images) = (&self.device, &self.images);
        if !copied && let Some((joined, _)) = self.shared(job)? {
            return Ok(joined.attachments(device));
        }
        let (position, normal, color) = (&images.position, &images.normal, &images.color);
        let floats = [position, normal, color].map(|buffer| buffer.address(device));
        Ok([floats[0], floats[1], floats[2], images.triangle.address(device)])
    }

    /// Copies a pass's tables to the device, and fills in the launch parameters. Kernels write the picture to the address `picture`; for `None`,
    /// to a buffer of this GPU.
    fn describe(
        &mut self,
        Work { job, focused, sampling }: Work<'_>,
        copied: bool,
        picture: Option<Address>,
    ) -> Result<Params, BackendError> {
        let [position, normal, color, triangle] = self.gbuffer(job, copied)?;
        let (device, images) = (&self.device, &mut self.images);
        if picture.is_none() {
            let pixels = job.width as usize * job.height as usize;
            device.reserve("the picture", &mut images.output, 4 * pixels)?;
        }
        let prepared = Preparation::of(job).map_err(|why| check::missing(T::NAME, job, &why))?;
        let Preparation { sampler, open_share, to_light, light_color, disc } = prepared;
        let samples = job.program.info().samples(&job.params);
        let (strata, points) = match sampler {
            None => (0, Vec::new()),
            Some(HemisphereSampler::Strata { side }) => (side, Vec::new()),
            Some(HemisphereSampler::Sobol(points)) => (0, points),
        };
        if !open_share.is_empty() {
            images.open_share.set(device, "the table of open shares", open_share)?;
        }
        if !points.is_empty() {
            images.sobol.set(device, "the occlusion points", table(points))?;
        }
        let through: Vec<f32> = (0..THROUGH_GLASS_ENTRIES as i32).map(|count| THROUGH_GLASS.powi(count)).collect();
        images.through_glass.set(device, "the table of glass", through)?;
        images.shades.set(device, "the materials", shades(job))?;
        let of_lights = LightTable::of(job);
        if let Some(table) = &of_lights {
            images.lights.set(device, "the lights", lights(&table.lights))?;
            images.emissions.set(device, "what textures add to lights", emissions(job))?;
        }
        let disc = disc.filter(|_| of_lights.is_some());
        if let Some(disc) = &disc {
            images.disc.set(device, "the points of the lights' discs", disc.points().as_flattened().to_vec())?;
        }
        let has_bodies = job.dielectrics.iter().any(|dielectric| dielectric.shape == Shape::Solid);
        if !job.dielectrics.is_empty() {
            images.bodies.set(device, "the glass", bodies(job))?;
        }
        let falls_straight =
            !job.dielectrics.is_empty() && matches!(job.params.shadow, GlassShadow::Straight | GlassShadow::Caustic);
        let focuses = !focused.is_empty();
        match FocusedTables::of(job, focused) {
            Some(tables) => images.focused.set(device, tables, &focused.photons)?,
            None => images.focused = FocusedBuffers::default(),
        }
        let asks = if falls_straight { ASKS_STRAIGHT } else { 0 } | if focuses { ASKS_FOCUSED } else { 0 };
        if has_bodies {
            device.clear("what the camera is in", &mut images.around_eye, MEDIA_BYTES as usize / size_of::<u32>())?;
        }
        let follows_ways = Variant::of(job) == Variant::Ways;
        if follows_ways {
            images.set_ways(device, WayTables::of(job, sampling), sampling.list())?;
        }
        let cone = if job.texture_lod() == TextureLod::Cones { job.cone } else { PixelCone::default() };
        device.clear("the ray counts", &mut images.counts, EXCEPTION_SLOT as usize + 1)?;
        Ok(Params {
            position,
            normal,
            color,
            triangle,
            output: picture.unwrap_or_else(|| images.output.address(device)),
            positions: 0,
            normals: 0,
            texcoords: 0,
            colors: 0,
            tangents: 0,
            triangles: 0,
            materials: 0,
            shades: images.shades.address(device),
            textures: 0,
            texels: 0,
            decoded: 0,
            sobol: images.sobol.address(device),
            open_share: images.open_share.address(device),
            through_glass: images.through_glass.address(device),
            ray_counts: images.counts.address(device),
            nodes: 0,
            leaves: 0,
            surfaces: 0,
            first_surface: 0,
            progress: 0,
            settled: 0,
            capacity: 0,
            handle: 0,
            bodies: if job.dielectrics.is_empty() { 0 } else { images.bodies.address(device) },
            around_eye: if has_bodies { images.around_eye.address(device) } else { 0 },
            node_count: 0,
            width: job.width,
            height: job.height,
            first_row: 0,
            rows: job.height,
            stripe: BLOCK_HEIGHT,
            skipped: 0,
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
            beyond: job.beyond.to_array(),
            asks,
            fresnel: job.params.fresnel as u32,
            listed: [0; REACHES as usize - 1],
            cone_width: cone.width,
            cone_spread: cone.spread,
            segments: if follows_ways { images.ways.address(device) } else { 0 },
            own: 0,
            blocked: 0,
            segment_count: 0,
            lights: if of_lights.is_some() { images.lights.address(device) } else { 0 },
            emissions: if of_lights.is_some() { images.emissions.address(device) } else { 0 },
            light_count: of_lights.as_ref().map_or(0, |table| table.lights.len() as u32),
            in_shadow: of_lights.as_ref().map_or(0.0, |table| table.hidden),
            disc: if disc.is_some() { images.disc.address(device) } else { 0 },
            disc_samples: disc.as_ref().map_or(0, ConeSampler::samples),
            disc_height: disc.as_ref().map_or(0.0, ConeSampler::height),
            sky: 0,
            sky_handle: 0,
            spheres: 0,
            focused: if focuses { images.focused.described.address(device) } else { 0 },
        })
    }

    /// Runs a pass over the rows of `stripes`, with several launches in flight, and returns the device time of these launches.
    fn launch_all(
        &mut self,
        job: &RayJob<'_>,
        params: &mut Params,
        stripes: &[Stripe<'_>],
        progress: &Progress,
    ) -> Result<Duration, BackendError> {
        let (device, mut total) = (&self.device, 0.0);
        let failed = |error| device.fault(&format!("running `{}`", job.program.info().stem), &error);
        let event = || device.stream().record_event(Some(CUevent_flags::CU_EVENT_DEFAULT)).map_err(failed);
        let mut ahead: VecDeque<[CudaEvent; 2]> = VecDeque::with_capacity(LAUNCHES_AHEAD);
        let wait = |[start, end]: [CudaEvent; 2]| -> Result<f64, BackendError> {
            let milliseconds = start.elapsed_ms(&end).map_err(failed)?;
            progress.advance(1);
            Ok(f64::from(milliseconds))
        };
        if params.around_eye != 0 {
            let mut once = Params { width: 1, rows: 1, asks: params.asks | ASKS_EYE, ..*params };
            self.tracer.launch(device, job, &mut once)?;
        }
        for Launch { first_row, rows, stripe, skipped } in launches(stripes, job.width, pixels_of_launch(job)) {
            if ahead.len() == LAUNCHES_AHEAD
                && let Some(first) = ahead.pop_front()
            {
                total += wait(first)?;
            }
            (params.first_row, params.rows) = (first_row, rows);
            (params.stripe, params.skipped) = (stripe, skipped);
            let start = event()?;
            self.tracer.launch(device, job, params)?;
            ahead.push_back([start, event()?]);
        }
        for launched in ahead {
            total += wait(launched)?;
        }
        Ok(Duration::from_secs_f64(total.max(0.0) * 1e-3))
    }

    fn read_counts(&self, job: &RayJob<'_>) -> Result<RayCounts, BackendError> {
        let mut sums = vec![0_u64; EXCEPTION_SLOT as usize + 1];
        if let Some(counts) = &self.images.counts.0 {
            let copied = self.device.stream().memcpy_dtoh(counts, &mut sums);
            copied.map_err(|error| self.device.fault("reading the ray counts", &error))?;
        }
        self.synchronise("reading the ray counts")?;
        if let Some(code) = sums.pop().filter(|code| *code != 0) {
            return Err(BackendError::Device { backend: T::NAME, message: stopped(job.program, code.cast_signed()) });
        }
        let mut kinds = [0_u64; RAY_COUNT_KINDS as usize];
        for slot in sums.chunks_exact(kinds.len()) {
            kinds.iter_mut().zip(slot).for_each(|(kind, count)| *kind += count);
        }
        let [shadow, occlusion, reflected, refracted, certain, lost] = kinds;
        Ok(RayCounts { shadow, occlusion, reflected, refracted, certain, lost, ..RayCounts::default() })
    }

    fn synchronise(&self, doing: &str) -> Result<(), BackendError> {
        self.device.stream().synchronize().map_err(|error| self.device.fault(doing, &error))
    }

    /// Copies a scene to the device and builds its structure. The caller has released the previous scene and structure with [`Self::clear`].
    pub fn build(
        &mut self,
        scene: &Arc<RenderScene>,
        filtered: &[bool],
        prepared: &T::Prepared,
    ) -> Result<BuildStats, BackendError> {
        self.device.bind()?;
        let buffers = SceneBuffers::new(&self.device, scene, Some(filtered))?;
        let mut stats = self.tracer.build(&self.device, scene, filtered, prepared, &buffers)?;
        stats.bytes += buffers.bytes();
        stats.nodes += buffers.sphere_nodes();
        self.synchronise("building")?;
        self.built = Some((Arc::clone(scene), buffers));
        Ok(stats)
    }

    /// Releases scene and structure, before others are built: the device's memory may not hold both.
    pub fn clear(&mut self) {
        self.built = None;
        self.images.focused = FocusedBuffers::default();
        self.tracer.clear();
    }

    /// Runs a pass, which must have been checked, over some of its rows; `focused` is the light that glass focuses in it. A shared G-buffer is in
    /// this GPU's memory, or `lent` by another GPU. After an error, no pixel is valid.
    pub fn run(
        &mut self,
        work: Work<'_>,
        stripes: &mut [Stripe<'_>],
        lent: Option<&Lent>,
        progress: &Progress,
    ) -> Result<RayStats, BackendError> {
        let job = work.job;
        let stats = self.launched(work, stripes, lent, None, progress)?;
        let start = Instant::now();
        if let Some(picture) = &self.images.output.0 {
            let parts = stripes.iter_mut().map(|stripe| {
                let first = 4 * stripe.range(job.width).start;
                (first, stripe.pixels.as_flattened_mut())
            });
            self.staging.read(&self.device, picture, parts.collect())?;
        }
        let read_back = Some(start.elapsed());
        Ok(RayStats { read_back, ..self.counted(job, stats)? })
    }

    /// As [`Self::run`], on a shared G-buffer, for all rows. The picture is written to its place in the shared memory, and the semaphore is
    /// then signalled.
    pub fn run_in_place(
        &mut self,
        work: Work<'_>,
        stripes: &mut [Stripe<'_>],
        progress: &Progress,
    ) -> Result<RayStats, BackendError> {
        let job = work.job;
        let room = self.shared(job)?.and_then(|(joined, _)| joined.picture(&self.device));
        let Some(picture) = room else {
            return Err(check::missing(T::NAME, job, "the shared memory has no room for its picture"));
        };
        let stats = self.launched(work, stripes, None, Some(picture), progress)?;
        if let Some((joined, value)) = self.shared(job)? {
            joined.signal(&self.device, after_picture(value))?;
        }
        self.counted(job, stats)
    }

    /// Starts the launches of a pass and waits for them. The result does not contain the ray counts yet.
    fn launched(
        &mut self,
        work: Work<'_>,
        stripes: &[Stripe<'_>],
        lent: Option<&Lent>,
        picture: Option<Address>,
        progress: &Progress,
    ) -> Result<RayStats, BackendError> {
        let job = work.job;
        self.device.bind()?;
        self.tracer.load(&self.device, job)?;
        let mut upload = if job.shared.is_none() { Some(self.copy(job, stripes)?) } else { None };
        let borrowed = lent.map(|lent| self.borrow(job, lent, stripes)).transpose()?;
        let copied = upload.is_some() || borrowed.is_some();
        let mut params = self.describe(work, copied, picture)?;
        let is_built = |scene: &Arc<RenderScene>| std::ptr::eq(&raw const **scene, job.scene);
        if job.texture_lod() == TextureLod::Cones
            && let Some((_, buffers)) = self.built.as_mut().filter(|(scene, _)| is_built(scene))
            && let Err(error) = buffers.require_levels(&self.device, job.scene)
        {
            self.clear();
            return Err(error);
        }
        // The scene's buffers if no structure was built: declared here so that they live until the kernels are done.
        let unbuilt;
        match &self.built {
            _ if job.program == RayProgram::Dummy => {}
            Some((scene, buffers)) if std::ptr::eq(&raw const **scene, job.scene) => {
                buffers.fill(&self.device, &mut params);
            }
            _ if !may_trace(job) => {
                // The structure of another scene is kept: later passes over that scene trace in it.
                unbuilt = SceneBuffers::new(&self.device, job.scene, None)?;
                unbuilt.fill(&self.device, &mut params);
                // Only the search for the bodies around the camera would trace in that structure. Without it, the camera is in no body.
                params.around_eye = 0;
            }
            _ => return Err(check::missing(T::NAME, job, "its scene's acceleration structure was not built")),
        }
        if !copied && let Some((joined, value)) = self.shared(job)? {
            joined.wait(&self.device, value)?;
        }
        let device_time = self.launch_all(job, &mut params, stripes, progress)?;
        if let Some(copies) = &borrowed {
            upload = Some(copies.time(&self.device)?);
        }
        Ok(RayStats { upload, device_time: Some(device_time), ..RayStats::default() })
    }

    /// Completes the statistics of a launched pass with its ray counts and the memory held.
    fn counted(&self, job: &RayJob<'_>, stats: RayStats) -> Result<RayStats, BackendError> {
        let rays = self.read_counts(job)?;
        let held_bytes = self.images.bytes() + self.tracer.held_bytes();
        Ok(RayStats { rays, held_bytes, ..stats })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exception_is_told_with_the_program_and_its_meaning() {
        let message = stopped(RayProgram::Final, -1);
        assert!(message.contains("`final`") && message.contains("exception -1: the stack was full"), "{message}");
        assert!(stopped(RayProgram::Ssao, 7).contains("exception 7: see"));
    }
}
