//! The ray backend for any GPU: our own traversal in compute shaders of wgpu, on Vulkan, Metal and DirectX 12.
//!
//! `programs/` has a WGSL file for each effect, and their common parts. The programs need neither 64-bit numbers nor subgroups nor ray-tracing
//! cores, and do not assume how a driver rounds products: a ray through an edge or a corner hits what it hits on the processor
//! (`programs/wide.wgsl` explains how).
//!
//! The device may be shared with the rasteriser ([`WgpuRays::on`]).

mod buffers;
mod images;
mod kernels;
mod launches;
mod layout;
mod lenses;
mod photons;
mod programs;
mod scene;
mod segments;
mod selftest;
mod spheres;
mod split;
mod tables;
#[cfg(test)]
mod tests;

pub use programs::Rounding;
pub use segments::WgpuSegments;

use crate::adaptive::{Sampling, asked, sample_on_device};
use crate::cpu::{FindsFocused, check, may_trace};
use crate::effects::dielectric::{Focused, Variant, disperses, is_rough, ways_of_path};
use crate::effects::disc_rays;
use crate::raster::gpu::device::Gpu;
use crate::raster::gpu::faults::of_rays;
use crate::raster::gpu::lend::Lending;
use crate::raster::gpu::targets::{CHANNELS, Staging};
use crate::raster::gpu::{AdapterChoice, RAY_BUFFERS, RayFilter, SharedDevice};
use curitiba_pipeline::backend::{
    BackendError, BuildStats, Gpu as Device, Limits, RayBackend, RayCounts, RayJob, RayStats,
};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::glass::{Dielectric, Shape};
use curitiba_pipeline::image::Image;
use curitiba_pipeline::memory::{Refused, mebibytes};
use curitiba_pipeline::programs::{Fidelity, RayParams, RayProgram, TextureLod, Traces};
use curitiba_pipeline::scene::RenderScene;
use curitiba_pipeline::shared::InPlace;
use images::{Images, Views};
use kernels::Kernels;
use launches::{Clock, Work};
use layout::{
    COUNTS_BUFFER_BYTES, CUT_LOOPS, POINT_BYTES, Params, RAY_COUNT_KINDS, RAY_COUNT_SLOTS, START_BYTES, TILE,
};
use programs::{Arithmetic, Kind, Stage};
use scene::SceneBuffers;
use split::Split;
use std::collections::HashMap;
use std::sync::Arc;
use std::time::Instant;
use tables::Tables;

const NAME: &str = "wgpu";

/// Approximate memory a triangle takes, in bytes: 150 on the device, and about 400 on the host while the tree is built.
const BYTES_PER_TRIANGLE: u64 = 550;
/// Greatest size of the list of points in bytes: three points a pixel for a picture of 1024 x 1024.
const LIST_BYTES: u64 = 3 * 1024 * 1024 * POINT_BYTES;
/// Why a picture is discarded where the driver has left a loop.
const CUT: &str = "its driver leaves loops that have not ended after some ten thousand steps, and the occlusion rays, or the rays to the discs of \
                   lights, take more at a pixel; set samples or sunsamples lower on the pass, use --backend cpu, or allow it with --fallback cpu";
/// As [`CUT`], where glass focuses light.
const CUT_FOCUS: &str = "its driver leaves loops that have not ended after some ten thousand steps, and the light of so many spheres that focus it, \
                         so many photons, the occlusion rays, or the rays to the light's disc, take more at a point; set shadow=straight on the \
                         pass, or photons, photonradius, samples or sunsamples lower, use --backend cpu, or allow it with --fallback cpu";
/// The reason for refusing a job whose glass is sampled to an error, but whose images are in device memory.
const NOT_IN_HOST: &str = "its glass is sampled to an error, and its G-buffer or its picture is not in host memory";
/// Greatest depth of paths through bodies of glass on drivers that cut loops: with it, `xml_projects/glass` is complete there; at depth 4
/// light is missing.
const CUT_DEPTH: u32 = 2;

/// Traces rays on a GPU, or on a software driver that acts as one.
#[derive(Debug)]
pub struct WgpuRays {
    gpu: Arc<Gpu>,
    arithmetic: Arithmetic,
    kernels: Kernels,
    clock: Option<Clock>,
    images: Images,
    filter: Option<RayFilter>,
    staging: Staging,
    parameters: wgpu::Buffer,
    counts: wgpu::Buffer,
    counts_staging: wgpu::Buffer,
    /// Points of surfaces whose light and occlusion are found by successive kernels.
    points: wgpu::Buffer,
    built: Option<(Arc<RenderScene>, SceneBuffers)>,
    /// The search for the light that glass focuses.
    focused: FindsFocused,
    /// Greatest number of points in the list that a test sets; `None` where no test sets it.
    #[cfg(test)]
    room: Option<u32>,
    /// The attachments of a rasteriser on the same device; `None` where they are not read in place.
    lending: Option<Arc<Lending>>,
    /// Number of tiles of the next launch, by kind of kernel and [`rays_a_point`] with photons; `None` before the first launch.
    sizes: HashMap<(Kind, u32), Option<u32>>,
}

impl WgpuRays {
    /// A backend on the best device that `choice` allows.
    ///
    /// # Errors
    /// If there is no device, or it lacks something; the message says what, and what to do.
    pub fn new(choice: AdapterChoice) -> Result<Self, BackendError> {
        Self::on(&SharedDevice::open(choice).map_err(of_rays)?)
    }

    /// A backend on a device that a rasteriser and other backends may use, too.
    ///
    /// # Errors
    /// If the device lacks something; the message says what, and what to do.
    pub fn on(device: &SharedDevice) -> Result<Self, BackendError> {
        let gpu = Arc::clone(&device.0);
        let found = gpu.limits.max_storage_buffers_per_shader_stage;
        if found < RAY_BUFFERS || gpu.limits.max_compute_invocations_per_workgroup < TILE * TILE {
            let why = format!(
                "it binds {found} storage buffers, and programs need {RAY_BUFFERS} in groups of 64 threads; \
                 `--backend cpu` traces without a GPU"
            );
            return Err(BackendError::Unsupported { backend: NAME, what: format!("on {}", gpu.adapter), why });
        }
        Self::prepare(gpu).map_err(of_rays)
    }

    fn prepare(gpu: Arc<Gpu>) -> Result<Self, BackendError> {
        let (copy_to, storage) = (wgpu::BufferUsages::COPY_DST, wgpu::BufferUsages::STORAGE);
        let parameters = gpu.buffer("parameters", gpu.parameters.usage() | copy_to, size_of::<Params>() as u64)?;
        let counts = gpu.buffer("ray counts", storage | copy_to | wgpu::BufferUsages::COPY_SRC, COUNTS_BUFFER_BYTES)?;
        let counts_staging = gpu.buffer("ray counts", wgpu::BufferUsages::MAP_READ | copy_to, COUNTS_BUFFER_BYTES)?;
        Ok(Self {
            kernels: Kernels::new(&gpu, Split::default())?,
            clock: Clock::new(&gpu)?,
            images: Images::new(&gpu)?,
            filter: None,
            points: gpu.buffer("points", storage, POINT_BYTES)?,
            arithmetic: selftest::arithmetic(&gpu)?,
            gpu,
            staging: Staging::default(),
            parameters,
            counts,
            counts_staging,
            built: None,
            focused: FindsFocused::default(),
            #[cfg(test)]
            room: None,
            lending: None,
            sizes: HashMap::new(),
        })
    }

    /// Changes how products are rounded: for tests that no ray passes between adjacent triangles, however a driver rounds.
    pub fn set_rounding(&mut self, rounding: Rounding) {
        self.arithmetic.rounding = rounding;
    }

    fn group(&self, index: usize, label: &str, entries: &[wgpu::BindGroupEntry<'_>]) -> wgpu::BindGroup {
        let layout = &self.kernels.groups[index];
        self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries })
    }

    /// Bind group 0: the G-buffer, the picture that is written, and the parameters.
    fn bind_images(&self, views: &Views, picture: &wgpu::Texture) -> Result<wgpu::BindGroup, BackendError> {
        let channels = self.images.views(views, picture);
        let mut entries = vec![wgpu::BindGroupEntry { binding: 0, resource: self.parameters.as_entire_binding() }];
        entries.extend((1..).zip(&channels).map(|(binding, view)| wgpu::BindGroupEntry {
            binding,
            resource: wgpu::BindingResource::TextureView(view),
        }));
        entries.push(wgpu::BindGroupEntry { binding: 6, resource: self.counts.as_entire_binding() });
        entries.push(wgpu::BindGroupEntry { binding: 7, resource: self.points.as_entire_binding() });
        let group = self.group(0, "rays: images", &entries);
        self.gpu.check("binding of the images of rays")?;
        Ok(group)
    }

    /// Runs a job whose glass is sampled to the error `asked`. The light that glass focuses is found once.
    fn sample(
        &mut self,
        job: &RayJob<'_>,
        asked: f32,
        output: &mut Image,
        progress: &Progress,
    ) -> Result<RayStats, BackendError> {
        let focused = self.focused.of(NAME, job, progress)?;
        if progress.is_given_up() {
            return Ok(RayStats::default());
        }
        let part = progress.part();
        let mut run = |job: &RayJob<'_>, sampling: Sampling<'_>, output: &mut Image| {
            let progress = if matches!(sampling, Sampling::Listed(_)) { &part } else { progress };
            self.trace(job, (sampling, Some(&focused)), Some(output), progress)
        };
        let refused = |refused: Refused| check::missing(NAME, job, &refused.to_string());
        let stats = sample_on_device(job, asked, (output, progress), &mut run, &refused)?;
        Ok(RayStats { rays: RayCounts { photons: focused.photons.counts, ..stats.rays }, ..stats })
    }

    /// Runs a job; reads its picture back if `output` is given. `focused` is the light that glass focuses in the job; if `None`, it is found.
    fn trace(
        &mut self,
        job: &RayJob<'_>,
        (sampling, focused): (Sampling<'_>, Option<&Focused>),
        output: Option<&mut Image>,
        progress: &Progress,
    ) -> Result<RayStats, BackendError> {
        let gpu = Arc::clone(&self.gpu);
        let start = Instant::now();
        let (levels, exponent) = filter(job);
        // Filtering comes before the power: the mean of powers is not the power of the mean.
        let plain = RayJob { params: RayParams { intensity: 1.0, ..job.params }, ..*job };
        let job = if levels > 0 { &plain } else { job };
        let (views, upload) = match job.shared {
            Some(value) => (self.in_place(job, value)?, None),
            None => (self.images.upload(&gpu, job)?, Some(start.elapsed())),
        };
        let has_levels = self.require_levels(job)?;
        let found = match focused {
            Some(_) => Focused::default(),
            None => self.focused.of(NAME, job, progress)?,
        };
        if progress.is_given_up() {
            return Ok(RayStats::default());
        }
        let focused = focused.unwrap_or(&found);
        let tables = Tables::of(job, sampling, focused, has_levels).map_err(|why| check::missing(NAME, job, &why))?;
        self.check_tables(job, &tables)?;
        let kind = Kind { sampled: sampling.is_sampled(), ..Kind::of(job, !focused.is_empty()) };
        let steps = rays_a_point(job, kind).saturating_add(launches::rays_of_photons(&focused.photons));
        let photons = found.photons.counts;
        // The tables hold the photons now.
        drop(found);
        let mut stages = programs::stages(kind, tables.params.samples).to_vec();
        if kind.variant.knows_bodies() && job.dielectrics.iter().any(|dielectric| dielectric.shape == Shape::Solid) {
            stages.insert(0, Stage::Eye);
        }
        let most_tiles = self.require_points(job, &stages)?;
        let capacity = (self.points.size() / POINT_BYTES) as u32;
        #[cfg(test)]
        let capacity = self.room.unwrap_or(capacity).min(capacity);
        let mut params = Params { id_base: views.id_base, capacity, ..tables.params };
        // Kept alive until the launches are done.
        let unbuilt;
        let scene = match &self.built {
            Some((scene, buffers)) if std::ptr::eq(&raw const **scene, job.scene) => buffers,
            _ if !may_trace(job) => {
                // `dummy` reads nothing of the scene.
                let nothing = RenderScene::default();
                let scene = if job.program == RayProgram::Dummy { &nothing } else { job.scene };
                unbuilt = SceneBuffers::new(&gpu, scene, &[], false)?;
                &unbuilt
            }
            _ => return Err(check::missing(NAME, job, "its scene's acceleration structure was not built")),
        };
        scene.fill(&mut params);
        if self.kernels.split != scene.split {
            self.kernels = Kernels::new(&gpu, scene.split)?;
        }
        let picture = self.images.output(&gpu, job)?.clone();
        let words = buffers::upload(&gpu, "the tables of the pass", bytemuck::cast_slice(&tables.words))?;
        drop(tables);
        let table = wgpu::BindGroupEntry { binding: 0, resource: words.as_entire_binding() };
        let groups = [
            self.bind_images(&views, &picture)?,
            self.group(1, "rays: scene", &scene.entries()),
            self.group(2, "rays: tables", &[table]),
        ];
        gpu.check("binding of the scene")?;
        self.clear_counts()?;
        let doing = format!("running `{}`", job.program.info().stem);
        let work = Work {
            kernels: self.kernels.require(&gpu, job, (kind, &stages), self.arithmetic)?,
            groups: groups.each_ref(),
            first_tiles: launches::first_tiles(steps),
            most_tiles,
            counts: &self.counts,
            parameters: &self.parameters,
            doing: &doing,
        };
        let size = self.sizes.entry((kind, steps)).or_default();
        let mut device_time = launches::run(&gpu, self.clock.as_ref(), &work, params, size, progress)?;
        if levels > 0 {
            let [normals, other] = self.images.for_filter(&gpu, job)?.map(wgpu::Texture::clone);
            let group = self.bind_images(&views, &normals)?;
            let work = Work {
                kernels: self.kernels.require(&gpu, job, (kind, &[Stage::Surfaces]), self.arithmetic)?,
                groups: [&group, &groups[1], &groups[2]],
                first_tiles: u32::MAX,
                most_tiles: u32::MAX,
                counts: &self.counts,
                parameters: &self.parameters,
                doing: &doing,
            };
            let clock = self.clock.as_ref();
            let found = launches::run(&gpu, clock, &work, params, &mut None, &Progress::default())?;
            let filter = match &mut self.filter {
                Some(filter) => filter,
                none => none.insert(RayFilter::new(&gpu)?),
            };
            let normals = normals.create_view(&wgpu::TextureViewDescriptor::default());
            let surfaces = [self.images.positions(&views), &normals];
            let averaged = filter.run(&gpu, surfaces, [&picture, &other], (levels, exponent))?;
            if levels % 2 == 1 {
                self.images.swap_filtered();
            }
            let times = [device_time, found, averaged];
            device_time = times.into_iter().sum();
        }
        let start = Instant::now();
        let picture = self.images.output(&gpu, job)?;
        let read_back = match output {
            Some(output) => {
                self.staging.read(&gpu, picture, &mut output.pixels)?;
                Some(start.elapsed())
            }
            None => None,
        };
        let held_bytes = self.images.bytes() + words.size() + self.points.size() + COUNTS_BUFFER_BYTES;
        let rays = self.read_counts(job, if kind.focuses { CUT_FOCUS } else { CUT })?;
        Ok(RayStats { rays: RayCounts { photons, ..rays }, adaptive: None, upload, read_back, device_time, held_bytes })
    }

    /// Refuses tables that the device cannot bind. Only photons make them so large.
    fn check_tables(&self, job: &RayJob<'_>, tables: &Tables) -> Result<(), BackendError> {
        let bytes = size_of_val(&tables.words[..]) as u64;
        let most = self.gpu.limits.max_storage_buffer_binding_size.min(self.gpu.max_buffer_bytes);
        if bytes <= most {
            return Ok(());
        }
        let why = format!(
            "its tables, with the photons, take {}, and {} reads {} at once at most; set photons lower on the pass, use \
             --backend cpu, or allow it with --fallback cpu",
            mebibytes(bytes),
            self.gpu.adapter,
            mebibytes(most)
        );
        Err(check::missing(NAME, job, &why))
    }

    /// Copies the mip levels of the scene's textures to the device, for the first job that reads textures by ray cones. Returns whether the
    /// levels are on the device.
    fn require_levels(&mut self, job: &RayJob<'_>) -> Result<bool, BackendError> {
        let Some((_, buffers)) = self.built.as_mut().filter(|(scene, _)| std::ptr::eq(&raw const **scene, job.scene))
        else {
            return Ok(false);
        };
        if job.texture_lod() == TextureLod::Cones
            && let Err(error) = buffers.require_levels(&self.gpu, job.scene)
        {
            if !buffers.is_whole() {
                self.built = None;
            }
            return Err(error);
        }
        Ok(self.built.as_ref().is_some_and(|(_, buffers)| buffers.has_levels))
    }

    /// The attachments that the rasteriser lent last; an error if they are not those of the job.
    fn in_place(&self, job: &RayJob<'_>, value: u64) -> Result<Views, BackendError> {
        let info = job.program.info();
        let reads = |buffer| info.buffers.contains(&buffer);
        let triangles = info.traces != Traces::Nothing && job.fidelity == Fidelity::Corrected;
        let wanted = [reads("color_buffer"), reads("pos_buffer"), reads("norm_buffer"), triangles];
        if !wanted.contains(&true) {
            return Ok(Views { channels: [const { None }; 4], id_base: 0 });
        }
        let lent = self.lending.as_ref().map(|lending| lending.last());
        let Some(lent) = lent.filter(|lent| lent.value == value && lent.size == (job.width, job.height)) else {
            return Err(check::missing(NAME, job, "its G-buffer is neither in host memory nor what was lent last"));
        };
        if let Some(missing) = (0..4).find(|channel| wanted[*channel] && lent.channels[*channel].is_none()) {
            let why = format!("what was drawn has no `{}`, which it reads", CHANNELS[missing]);
            return Err(check::missing(NAME, job, &why));
        }
        // The rasteriser clears the attachment of triangle ids to 0, so ids are stored plus 1.
        Ok(Views { channels: lent.channels, id_base: 1 })
    }

    /// Reserves the list of points for the kernels of a job. Returns the number of tiles whose points fit; `u32::MAX` if no points are listed.
    fn require_points(&mut self, job: &RayJob<'_>, stages: &[Stage]) -> Result<u32, BackendError> {
        if stages.last() == Some(&Stage::Whole) {
            return Ok(u32::MAX);
        }
        // One point a pixel; in `final`, room for two more, seen through glass.
        let pixel_bytes = match job.program {
            RayProgram::Final => 3 * POINT_BYTES,
            RayProgram::DeferredShadows => START_BYTES,
            _ => POINT_BYTES,
        };
        let tile_bytes = u64::from(TILE * TILE) * pixel_bytes;
        let most = self.gpu.limits.max_storage_buffer_binding_size.min(self.gpu.max_buffer_bytes).min(LIST_BYTES);
        let tiles = u64::from(job.width.div_ceil(TILE)) * u64::from(job.height.div_ceil(TILE));
        let tiles = tiles.min(most / tile_bytes).max(1);
        if self.points.size() < tiles * tile_bytes {
            // The old buffer is released first: memory may not hold both.
            self.points = self.gpu.buffer("points", wgpu::BufferUsages::STORAGE, POINT_BYTES)?;
            self.points = self.gpu.buffer("points", wgpu::BufferUsages::STORAGE, tiles * tile_bytes)?;
        }
        Ok(tiles as u32)
    }

    /// Refuses jobs that the backend cannot run.
    fn check(&self, job: &RayJob<'_>) -> Result<(), BackendError> {
        self.supports(job.program, job.fidelity)?;
        check::scene(NAME, job, true)?;
        Images::check_size(&self.gpu, job)
    }

    fn clear_counts(&self) -> Result<(), BackendError> {
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("ray counts") };
        let mut encoder = self.gpu.device.create_command_encoder(&descriptor);
        encoder.clear_buffer(&self.counts, 0, None);
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu.check("clearing the ray counts")
    }

    fn read_counts(&self, job: &RayJob<'_>, cut: &str) -> Result<RayCounts, BackendError> {
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("ray counts") };
        let mut encoder = self.gpu.device.create_command_encoder(&descriptor);
        encoder.copy_buffer_to_buffer(&self.counts, 0, &self.counts_staging, 0, COUNTS_BUFFER_BYTES);
        let (mut kinds, mut are_cut) = ([0_u64; RAY_COUNT_KINDS as usize], false);
        let doing = "reading the ray counts";
        self.gpu.read_mapped(&self.counts_staging, COUNTS_BUFFER_BYTES, Some(encoder.finish()), doing, |bytes| {
            let words: &[u32] = bytemuck::cast_slice(bytes);
            are_cut = words[CUT_LOOPS as usize] != 0;
            // Two words a sum, the lower one first.
            let sums = words[..(2 * RAY_COUNT_SLOTS * RAY_COUNT_KINDS) as usize].as_chunks::<2>().0;
            for slot in sums.chunks_exact(kinds.len()) {
                let sums = slot.iter().map(|[low, high]| u64::from(*high) << 32 | u64::from(*low));
                kinds.iter_mut().zip(sums).for_each(|(kind, count)| *kind += count);
            }
        })?;
        if are_cut {
            return Err(check::missing(NAME, job, cut));
        }
        let [shadow, occlusion, reflected, refracted, certain, lost] = kinds;
        Ok(RayCounts { shadow, occlusion, reflected, refracted, certain, lost, ..RayCounts::default() })
    }
}

/// Greatest number of rays that a point or a pixel may need, roughly: to the discs of lights, for occlusion, and on paths through glass. The size of
/// the first launch depends on it.
fn rays_a_point(job: &RayJob<'_>, kind: Kind) -> u32 {
    let params = &job.params;
    let occlusion = job.program.info().samples(params);
    let glass = match job.dielectrics {
        [] => 0,
        _ if !kind.variant.knows_bodies() => 0,
        _ if kind.sampled => params.depth,
        // Down to the depth, each surface divides a path in two.
        _ => (1_u32 << params.depth.min(16)).saturating_mul(ways_of_path(job)),
    };
    disc_rays(job).saturating_add(occlusion).saturating_add(glass)
}

/// Number of filter levels of a job, 0 where nothing is filtered; and the exponent that is applied to the filtered values.
fn filter(job: &RayJob<'_>) -> (u32, f32) {
    let info = job.program.info();
    match job.fidelity {
        Fidelity::Corrected => {
            (info.filter_levels(&job.params), if info.reads("intensity") { job.params.intensity } else { 1.0 })
        }
        Fidelity::Thesis => (0, 1.0),
    }
}

impl RayBackend for WgpuRays {
    fn name(&self) -> &'static str {
        NAME
    }

    fn limits(&self) -> Limits {
        Limits { side: self.gpu.limits.max_texture_dimension_2d, parts: true }
    }

    fn device(&self) -> String {
        self.gpu.adapter.to_string()
    }

    fn gpus(&self) -> Vec<Device> {
        let adapter = &self.gpu.adapter;
        let driver = format!("{} {}", adapter.interface, adapter.driver);
        vec![Device { name: format!("{} ({})", adapter.name, adapter.kind), driver }]
    }

    fn supports(&self, program: RayProgram, _: Fidelity) -> Result<(), BackendError> {
        if programs::is_written(program) { Ok(()) } else { Err(programs::not_written(NAME, program)) }
    }

    fn supports_glass(
        &self,
        program: RayProgram,
        params: &RayParams,
        dielectrics: &[Dielectric],
    ) -> Result<(), BackendError> {
        let is_asked = !dielectrics.is_empty() && Variant::OF_BODIES.contains(&program);
        let (what, help) = match () {
            () if is_asked && (is_rough(dielectrics) || disperses(params, dielectrics)) => {
                ("glass that divides paths (rough, or of several wavelengths)".to_owned(), String::new())
            }
            () if is_asked && params.depth > CUT_DEPTH => {
                (format!("bodies of glass to depth {}", params.depth), format!("set depth={CUT_DEPTH} on the pass, "))
            }
            () => return Ok(()),
        };
        if selftest::cuts_loops(&self.gpu).map_err(of_rays)? {
            let why = format!(
                "its driver leaves loops that have not ended after some ten thousand steps, and paths would be missing without a word; \
                 {help}use --backend cpu, or allow it with --fallback cpu"
            );
            let what = format!("{what} on {}", self.gpu.adapter);
            return Err(BackendError::Unsupported { backend: NAME, what, why });
        }
        Ok(())
    }

    fn traces_sun_discs(&self) -> bool {
        true
    }

    fn sees_skies(&self) -> bool {
        true
    }

    fn filters_shares(&self) -> bool {
        true
    }

    fn samples_adaptively(&self) -> bool {
        true
    }

    fn traces_spheres(&self) -> bool {
        true
    }

    fn traces_cones(&self) -> bool {
        true
    }

    fn knows_lights(&self) -> bool {
        true
    }

    fn shoots_photons(&self) -> bool {
        true
    }

    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        // The old scene is released first: memory may not hold both.
        (self.built, self.focused) = (None, FindsFocused::new(filtered));
        let buffers = SceneBuffers::new(&self.gpu, scene, filtered, true).map_err(of_rays)?;
        let stats = BuildStats { bytes: buffers.bytes, nodes: buffers.nodes };
        self.built = Some((Arc::clone(scene), buffers));
        Ok(stats)
    }

    fn bytes_per_triangle(&self) -> u64 {
        BYTES_PER_TRIANGLE
    }

    fn reads(&mut self, lent: &InPlace) -> bool {
        let lending = Arc::clone(lent).downcast::<Lending>().ok();
        self.lending = lending.filter(|lending| Arc::ptr_eq(&lending.gpu, &self.gpu));
        self.lending.is_some()
    }

    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        self.check(job)?;
        check::images(NAME, job, output)?;
        let traced = match asked(job) {
            Some(_) if job.shared.is_some() => Err(check::missing(NAME, job, NOT_IN_HOST)),
            Some(error) => self.sample(job, error, output, progress),
            None => self.trace(job, (Sampling::All, None), Some(output), progress),
        };
        traced.map_err(of_rays)
    }

    fn run_in_place(
        &mut self,
        job: &RayJob<'_>,
        picture: usize,
        progress: &Progress,
    ) -> Result<RayStats, BackendError> {
        self.check(job)?;
        check::buffers(NAME, job)?;
        if asked(job).is_some() {
            return Err(check::missing(NAME, job, NOT_IN_HOST));
        }
        let Some(lending) = self.lending.clone() else {
            return Err(check::missing(NAME, job, "no rasteriser on its device takes its picture"));
        };
        let own = self.images.exchange_output(lending.take(picture));
        let traced = self.trace(job, (Sampling::All, None), None, progress).map_err(of_rays);
        if let Some(texture) = self.images.exchange_output(own) {
            lending.keep(picture, texture);
        }
        traced
    }
}
