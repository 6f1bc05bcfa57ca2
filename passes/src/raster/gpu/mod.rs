//! The rasteriser for GPUs, through wgpu: Vulkan, Metal and DirectX 12, without a window.
//!
//! Limits: one sample per pixel, and opaque or alpha-tested surfaces, unless a project's own shaders blend. There is one directional
//! light, or at most 256 lights. A frame is at most as large as the device's largest texture. Triangle ids need a device
//! whose shaders have primitive indices.
//!
//! Drivers may write to standard error. One known case: Mesa's device-selection layer for Vulkan prints
//! `XDG_RUNTIME_DIR is invalid or not set` whenever devices are listed without a desktop session. This is harmless;
//! `NODEVICE_SELECT=1` in the environment disables the layer.

mod adapter;
mod cache;
mod covered;
pub(crate) mod device;
mod draws;
mod effects;
pub(crate) mod faults;
mod geometry;
mod job;
mod kept;
pub(crate) mod lend;
mod pipelines;
mod plane_depth;
mod planes;
mod quads;
pub(crate) mod resources;
mod shader;
mod shaders;
mod share;
mod spheres;
pub(crate) mod targets;
#[cfg(test)]
mod tests;
mod textures;
mod timer;

pub(crate) use adapter::RAY_BUFFERS;
pub use adapter::{AdapterChoice, AdapterKind, AdapterSummary, abilities, adapters, named};
pub(crate) use effects::filter::RayFilter;

use crate::raster::effects::SceneCache;
use curitiba_pipeline::backend::{
    Attachments, BackendError, ComputeJob, DrawStats, EffectJob, EffectStats, GBuffer, HandOver, Limits, LoadStore,
    OwnShaders, QuadJob, RasterJob, Rasteriser, Rect, drawn_part,
};
use curitiba_pipeline::device_quad::{DeviceQuad, DeviceQuadStats, QuadPlace, Shown};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::scene::RenderScene;
use curitiba_pipeline::shared::{DeviceUuid, InPlace, SharedGBuffer};
use device::Gpu;
use draws::DrawList;
use effects::{Context, Effects};
use faults::{NAME, failure, unsupported};
use geometry::DeviceGeometry;
use lend::Lending;
use pipelines::{Layouts, Pipelines};
use quads::Quads;
use shaders::Shaders;
use spheres::Spheres;
use std::sync::Arc;
use targets::{Staging, Stored, TargetCache};
use textures::DeviceTextures;
use timer::Timer;

/// The rasteriser on a GPU, or on a software driver that acts as one.
#[derive(Debug)]
pub struct WgpuRasteriser {
    gpu: Arc<Gpu>,
    layouts: Layouts,
    pipelines: Pipelines,
    timer: Option<Timer>,
    draws: DrawList,
    /// Whether each pixel of a G-buffer is shaded once, from a visibility buffer: the ids of the triangles that are seen.
    shades_pixels: bool,
    /// The draws that write the visibility buffer.
    seen: DrawList,
    /// Set when the first scene with exact spheres is drawn.
    spheres: Option<Spheres>,
    /// Set when the first own shader is used.
    shaders: Option<Shaders>,
    scene: Option<Uploaded>,
    targets: TargetCache,
    staging: Staging,
    /// Set when the first pass starts from a depth.
    depth_loader: Option<kept::DepthLoader>,
    /// Viewport and formats of the last draw, whose pixels the attachments hold; `None` before the first draw.
    drawn: Option<(Rect, Stored)>,
    /// Set when the first effect runs.
    effects: Option<Effects>,
    /// The device's UUID; `None` if the device cannot share memory.
    uuid: Option<DeviceUuid>,
    /// Set when memory is shared.
    sharing: Option<share::Sharing>,
    /// Set when attachments are lent to ray passes.
    lending: Option<Arc<Lending>>,
    /// Whether quads are filled on the device.
    fills_quads: bool,
    /// Set when the first quad is filled.
    quads: Option<Quads>,
}

/// A scene in device memory.
#[derive(Debug)]
struct Uploaded {
    scene: Arc<RenderScene>,
    geometry: DeviceGeometry,
    textures: DeviceTextures,
    cache: SceneCache,
}

/// An open device, which a rasteriser and a ray backend may share.
#[derive(Debug, Clone)]
pub struct SharedDevice(pub(crate) Arc<Gpu>);

impl SharedDevice {
    /// Opens the best device that `choice` allows.
    ///
    /// # Errors
    /// If there is no such device, or it does not open; the message says why, and what to do.
    pub fn open(choice: AdapterChoice) -> Result<Self, BackendError> {
        Ok(Self(Arc::new(Gpu::open(choice)?)))
    }

    /// The adapter of the device.
    #[must_use]
    pub fn adapter(&self) -> &AdapterSummary {
        &self.0.adapter
    }
}

/// Device memory in use, in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DeviceMemory {
    /// Vertices, indices and exact spheres.
    pub geometry: u64,
    /// Textures with their mip levels.
    pub textures: u64,
    /// Attachments and depth buffers, including those kept for other passes.
    pub attachments: u64,
    /// Maps, outputs, pyramids, depths and uploaded G-buffers of raster effects.
    pub effects: u64,
    /// Pictures of passes that stay on the device, and the quads that are filled from them.
    pub pictures: u64,
}

impl WgpuRasteriser {
    /// Opens the best device that `choice` allows.
    ///
    /// # Errors
    /// If there is no such device, or it does not open; the message says why, and what to do.
    pub fn new(choice: AdapterChoice) -> Result<Self, BackendError> {
        Self::on(&SharedDevice::open(choice)?)
    }

    /// A rasteriser on a device that other rasterisers and ray backends may use, too.
    ///
    /// # Errors
    /// If the device fails.
    pub fn on(device: &SharedDevice) -> Result<Self, BackendError> {
        let gpu = Arc::clone(&device.0);
        let layouts = Layouts::new(&gpu)?;
        let timer = Timer::new(&gpu)?;
        let (draws, seen) = (DrawList::new(&gpu)?, DrawList::new(&gpu)?.with_sky_ids());
        Ok(Self {
            uuid: share::uuid(&gpu.device),
            sharing: None,
            lending: None,
            fills_quads: gpu.adapter.kind != AdapterKind::Software,
            shades_pixels: gpu.adapter.kind != AdapterKind::Software,
            quads: None,
            gpu,
            layouts,
            pipelines: Pipelines::default(),
            timer,
            draws,
            seen,
            spheres: None,
            shaders: None,
            scene: None,
            targets: TargetCache::default(),
            staging: Staging::default(),
            depth_loader: None,
            drawn: None,
            effects: None,
        })
    }

    /// Sets whether quads are filled on the device. By default they are, except on software drivers, which are slower
    /// than the host.
    pub fn set_fills_quads(&mut self, fills: bool) {
        self.fills_quads = fills;
    }

    /// Sets whether the G-buffer is shaded from a visibility buffer (the ids of the triangles that are seen). This also needs depth on the
    /// planes of triangles, and enough bindings of the device. It is on by default, except on software drivers, which are faster without.
    pub fn set_shades_pixels(&mut self, shades: bool) {
        self.shades_pixels = shades;
    }

    /// The device, for a ray backend that reads attachments in place.
    #[must_use]
    pub fn shared_device(&self) -> SharedDevice {
        SharedDevice(Arc::clone(&self.gpu))
    }

    /// The adapter of the device that draws.
    #[must_use]
    pub fn adapter(&self) -> &AdapterSummary {
        &self.gpu.adapter
    }

    /// Device memory in use.
    #[must_use]
    pub fn memory(&self) -> DeviceMemory {
        DeviceMemory {
            geometry: self.scene.as_ref().map_or(0, |scene| scene.geometry.bytes())
                + self.spheres.as_ref().map_or(0, Spheres::bytes),
            textures: self.scene.as_ref().map_or(0, |scene| scene.textures.bytes)
                + self.shaders.as_ref().map_or(0, Shaders::texture_bytes),
            attachments: self.targets.bytes(),
            effects: self.effects.as_ref().map_or(0, Effects::bytes),
            pictures: self.lending.as_ref().map_or(0, |lending| lending.picture_bytes())
                + self.quads.as_ref().map_or(0, Quads::bytes),
        }
    }
}

impl Rasteriser for WgpuRasteriser {
    fn name(&self) -> &'static str {
        NAME
    }

    fn limits(&self) -> Limits {
        Limits { side: self.gpu.limits.max_texture_dimension_2d, parts: true }
    }

    fn device(&self) -> String {
        self.gpu.adapter.to_string()
    }

    fn upload(&mut self, scene: &Arc<RenderScene>) -> Result<(), BackendError> {
        // The old scene is freed first, so that both need not fit in memory at once.
        self.scene = None;
        if let Some(shaders) = &mut self.shaders {
            shaders.forget_scene();
        }
        let geometry = DeviceGeometry::upload(&self.gpu, &scene.geometry)?;
        let textures = DeviceTextures::upload(&self.gpu, &self.layouts, scene)?;
        self.scene = Some(Uploaded { scene: Arc::clone(scene), geometry, textures, cache: SceneCache::new(scene) });
        Ok(())
    }

    fn draw(&mut self, job: &RasterJob<'_>, target: &mut GBuffer) -> Result<DrawStats, BackendError> {
        self.draw_with(job, &OwnShaders::NONE, target, &mut [])
    }

    fn draws_shaders(&self) -> bool {
        true
    }

    fn draws_spheres(&self) -> bool {
        self.gpu.draws_spheres()
    }

    fn draw_with(
        &mut self,
        job: &RasterJob<'_>,
        own: &OwnShaders<'_>,
        target: &mut GBuffer,
        buffers: &mut [Vec<[f32; 4]>],
    ) -> Result<DrawStats, BackendError> {
        self.drawn = None;
        job::check_target(job, target)?;
        job::check_scene(job)?;
        let uploaded = self.scene.as_mut().filter(|uploaded| std::ptr::eq(&*uploaded.scene, job.scene));
        let Some(Uploaded { geometry, textures, .. }) = uploaded else {
            return Err(failure("the job's scene was not uploaded"));
        };
        if job::is_empty(job) {
            self.drawn = Some((job.viewport, Stored::of(job)));
            return Ok(DrawStats::default());
        }
        if job.attachments.triangle && !self.gpu.has(wgpu::Features::PRIMITIVE_INDEX) {
            let why = format!("{} has no primitive index in fragment shaders;", self.gpu.adapter);
            return Err(unsupported("the triangle attachment", &why));
        }
        let targets = self.targets.require(&self.gpu, job.viewport, Stored::of(job))?;
        let owned: Vec<bool> = own.materials.iter().map(Option::is_some).collect();
        let LoadStore { load_color, load_depth, store_depth } = job.load_store;
        let part = drawn_part(job.viewport, target.held());
        let Attachments { color, position, normal, .. } = job.attachments;
        // Triangles are drawn without a visibility buffer in these cases, among others: with own shaders, which draw over the attachments,
        // and with loaded attachments, which keep their contents where no triangle is seen.
        let shades_pixels = self.shades_pixels
            && self.gpu.shades_pixels()
            && (color || position || normal)
            && !(job.snapped_depth || load_color || load_depth || owned.contains(&true));
        let shaded = part.filter(|_| shades_pixels);
        self.draws.leave_out(&owned);
        self.draws.shade(shaded);
        let prepared = self.draws.prepare(&self.gpu, &self.layouts, &mut self.pipelines, geometry, textures, job);
        self.draws.leave_out(&[]);
        prepared?;
        if shades_pixels {
            let ids = Attachments { triangle: true, ..Attachments::default() };
            let ids = RasterJob { attachments: ids, shared: Attachments::default(), lights: &[], ..*job };
            self.seen.prepare(&self.gpu, &self.layouts, &mut self.pipelines, geometry, textures, &ids)?;
        }
        let spheres = match job.scene.geometry.spheres.is_empty() {
            true => None,
            false => {
                let spheres = self.spheres.get_or_insert_default();
                spheres.prepare(&self.gpu, self.draws.shared_uniforms(), job, part, &owned)?;
                Some(&*spheres).filter(|spheres| !spheres.is_empty())
            }
        };
        let shaders = match owned.contains(&true) {
            true => {
                let shaders = match &mut self.shaders {
                    Some(shaders) => shaders,
                    none => none.insert(Shaders::new(&self.gpu)?),
                };
                shaders.prepare(&self.gpu, geometry, job, own, buffers)?;
                Some(&*shaders)
            }
            false => None,
        };
        // The attachment that receives depth is loaded if the depth buffer is.
        let loaded = std::array::from_fn(|channel| if own.depth == Some(channel) { load_depth } else { load_color });
        if let Some(part) = part {
            let rects = (job.viewport, part);
            kept::load_colors(&self.gpu, targets, rects, target, loaded)?;
            if load_depth {
                let loader = match &mut self.depth_loader {
                    Some(loader) => loader,
                    none => none.insert(kept::DepthLoader::new(&self.gpu)?),
                };
                loader.load(&self.gpu, targets, rects, target)?;
            }
        }
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("draw") };
        let mut encoder = self.gpu.device.create_command_encoder(&descriptor);
        let timer = self.timer.as_ref();
        let drawn = if shaded.is_some() { &self.seen } else { &self.draws };
        let begin = timer.and_then(|timer| timer.compute_span(true, false));
        drawn.record_planes(&self.gpu, &mut encoder, &self.layouts, geometry, begin);
        let attachments = targets.color_attachments(job.clear_color, own.depth, loaded);
        {
            let visible = shaded.map(|_| targets.visible_attachment(&self.gpu)).transpose()?;
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("gbuffer"),
                color_attachments: visible.as_ref().unwrap_or(&attachments),
                // Depth is also stored for spheres, which are drawn in a pass after the shading and tested against this depth.
                depth_stencil_attachment: Some(
                    targets.depth_attachment(load_depth, store_depth || shaded.is_some() && spheres.is_some()),
                ),
                timestamp_writes: timer.and_then(|timer| timer.render_span(!drawn.has_planes(), shaded.is_none())),
                occlusion_query_set: None,
                multiview_mask: None,
            });
            // A part of a picture is drawn into attachments of the whole viewport's size, with a scissor rectangle, so
            // that its pixels are the same as in the whole picture.
            if let Some(Rect { x, y, width, height }) = part {
                pass.set_scissor_rect(x, y, width, height);
            }
            drawn.record(&mut pass, &self.pipelines, geometry, textures);
            if let Some(shaders) = shaders {
                shaders.record(&mut pass, geometry);
            }
            if let Some(spheres) = spheres.filter(|_| shaded.is_none()) {
                spheres.record(&mut pass);
            }
        }
        if shaded.is_some() {
            // Submitted now, so that the device draws the ids while the host records the shading, which takes the host longer.
            self.gpu.queue.submit([encoder.finish()]);
            self.gpu.check("draw")?;
            encoder = self.gpu.device.create_command_encoder(&descriptor);
            let cleared = wgpu::RenderPassDescriptor { color_attachments: &attachments, ..Default::default() };
            // The first draw also writes the pixels of the part that show nothing. Pixels outside the part, or all if there is no draw, are
            // cleared here.
            if part != Some(Rect { x: 0, y: 0, ..job.viewport }) || self.draws.is_empty() {
                drop(encoder.begin_render_pass(&cleared));
            }
            let timestamp_writes = timer.and_then(|timer| timer.compute_span(false, spheres.is_none()));
            let descriptor = wgpu::ComputePassDescriptor { label: Some("shading"), timestamp_writes };
            let mut pass = encoder.begin_compute_pass(&descriptor);
            self.draws.record_shading(&self.gpu, &mut pass, &self.pipelines, (geometry, textures), targets)?;
        }
        if let (Some(part), Some(spheres)) = (shaded, spheres) {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("spheres"),
                color_attachments: &targets.color_attachments(job.clear_color, None, [true; 4]),
                depth_stencil_attachment: Some(targets.depth_attachment(true, store_depth)),
                timestamp_writes: timer.and_then(|timer| timer.render_span(false, true)),
                occlusion_query_set: None,
                multiview_mask: None,
            });
            pass.set_scissor_rect(part.x, part.y, part.width, part.height);
            spheres.record(&mut pass);
        }
        let triangles = self.draws.triangles() + shaders.map_or(0, Shaders::triangles);
        let lent = self.lending.as_ref().filter(|_| job.shared != Attachments::default());
        let mut shared = match lent {
            Some(_) => None,
            None => {
                share::hand_over(&self.gpu, self.sharing.as_mut(), self.timer.as_ref(), targets, job, &mut encoder)?
            }
        };
        let device_time = match &self.timer {
            Some(timer) => {
                let [drawn, handed] = timer.submit_spans(&self.gpu, encoder, shared.is_some(), "draw")?;
                if let Some(shared) = &mut shared {
                    // The host waits for the draw and the hand-over together, so the hand-over's device time also counts as its host time.
                    (shared.device, shared.host) = (Some(handed), shared.host + handed);
                }
                Some(drawn)
            }
            None => {
                self.gpu.submit_and_wait(Some(encoder.finish()), "draw")?;
                None
            }
        };
        if let Some(shaders) = shaders {
            shaders.read_stored(&self.gpu, buffers)?;
        }
        if let Some(lending) = lent {
            shared = Some(HandOver { value: lending.lend(targets), ..HandOver::default() });
        }
        self.drawn = Some((job.viewport, Stored::of(job)));
        Ok(DrawStats { device_time, shared, triangles })
    }

    fn fill(
        &mut self,
        job: &QuadJob<'_>,
        pixels: &mut [[f32; 4]],
        buffers: &mut [Vec<[f32; 4]>],
    ) -> Result<(), BackendError> {
        let shaders = match &mut self.shaders {
            Some(shaders) => shaders,
            none => none.insert(Shaders::new(&self.gpu)?),
        };
        shaders.fill(&self.gpu, &mut self.staging, job, (pixels, buffers))
    }

    fn compute(&mut self, job: &ComputeJob<'_>, buffers: &mut [Vec<[f32; 4]>]) -> Result<(), BackendError> {
        let shaders = match &mut self.shaders {
            Some(shaders) => shaders,
            none => none.insert(Shaders::new(&self.gpu)?),
        };
        shaders.compute(&self.gpu, job, buffers)
    }

    fn needs_read_back(&self) -> bool {
        true
    }

    fn read_back(
        &mut self,
        job: &RasterJob<'_>,
        wanted: Attachments,
        target: &mut GBuffer,
    ) -> Result<(), BackendError> {
        job::check_target(job, target)?;
        if self.drawn != Some((job.viewport, Stored::of(job))) {
            return Err(failure("this job is not what was drawn last"));
        }
        match (self.targets.last(), drawn_part(job.viewport, target.held())) {
            (Some(targets), Some(part)) if !job::is_empty(job) => {
                targets.read_back(&self.gpu, &mut self.staging, (job.viewport, part), wanted, target)?;
                match job.load_store.store_depth {
                    true => kept::read_depth(&self.gpu, targets, (job.viewport, part), target),
                    false => Ok(()),
                }
            }
            _ => Ok(()),
        }
    }

    fn lends(&mut self) -> Option<InPlace> {
        let gpu = &self.gpu;
        let lending = self.lending.get_or_insert_with(|| Arc::new(Lending::new(Arc::clone(gpu))));
        Some(Arc::clone(lending) as InPlace)
    }

    fn shares(&self) -> Option<DeviceUuid> {
        self.uuid
    }

    fn share(
        &mut self,
        width: u32,
        height: u32,
        attachments: Attachments,
        picture: bool,
    ) -> Result<SharedGBuffer, BackendError> {
        // The old memory is freed first, so that both need not fit at once.
        self.sharing = None;
        self.lending = None;
        let device = self.uuid.ok_or_else(|| unsupported("sharing memory", "the device does not export any;"))?;
        let (sharing, shared) = share::Sharing::new(&self.gpu, device, [width, height], attachments, picture)?;
        self.sharing = Some(sharing);
        Ok(shared)
    }

    fn effect(
        &mut self,
        job: &EffectJob<'_>,
        output: &mut Image,
        progress: &Progress,
    ) -> Result<EffectStats, BackendError> {
        self.run_effect(job, Some(output), progress)
    }

    fn fills_quads(&self) -> QuadPlace {
        if self.fills_quads { QuadPlace::Device } else { QuadPlace::Software }
    }

    fn effect_in_place(
        &mut self,
        job: &EffectJob<'_>,
        picture: usize,
        progress: &Progress,
    ) -> Result<EffectStats, BackendError> {
        let stats = self.run_effect(job, None, progress)?;
        let made = self.effects.as_ref().and_then(Effects::picture).filter(|_| !progress.is_given_up());
        if let (Some(lending), Some(made)) = (&self.lending, made) {
            lending.keep_copy(picture, made)?;
        }
        Ok(stats)
    }

    fn fill_on_device(&mut self, quad: &DeviceQuad, shown: Shown<'_>) -> Result<DeviceQuadStats, BackendError> {
        let source = |source| match (&self.lending, &self.sharing) {
            (Some(lending), _) => quads::lent(lending, quad, source),
            (None, Some(sharing)) => share::quad_source(sharing, self.targets.last(), quad, source),
            (None, None) => Err(failure("nothing is lent or shared that a quad could read")),
        };
        let (color, factor) = (source(quad.color)?, quad.factor.map(source).transpose()?);
        if let (None, Some(sharing)) = (&self.lending, &self.sharing) {
            share::wait_for_picture(sharing, &self.gpu, quad)?;
        }
        let quads = match &mut self.quads {
            Some(quads) => quads,
            none => none.insert(Quads::new(&self.gpu)?),
        };
        quads.fill(&self.gpu, self.timer.as_ref(), (&color, factor.as_ref()), quad, shown)
    }
}

impl WgpuRasteriser {
    fn run_effect(
        &mut self,
        job: &EffectJob<'_>,
        output: Option<&mut Image>,
        progress: &Progress,
    ) -> Result<EffectStats, BackendError> {
        let uploaded = self.scene.as_mut().filter(|uploaded| std::ptr::eq(&*uploaded.scene, job.scene));
        let Some(Uploaded { geometry, textures, cache, .. }) = uploaded else {
            return Err(failure("the job's scene was not uploaded"));
        };
        let effects = match &mut self.effects {
            Some(effects) => effects,
            none => none.insert(Effects::new(&self.gpu)?),
        };
        // The attachments can be read in place only if they hold the whole picture.
        let whole = Rect { x: 0, y: 0, width: job.width, height: job.height };
        let last = self.drawn.filter(|(viewport, _)| *viewport == whole);
        let drawn = last.and_then(|(_, stored)| self.targets.last().filter(|t| t.stored() == stored));
        let mut context = Context {
            gpu: &self.gpu,
            layouts: &self.layouts,
            pipelines: &mut self.pipelines,
            timer: self.timer.as_ref(),
            geometry,
            textures,
            staging: &mut self.staging,
            cache,
        };
        effects.run(&mut context, drawn, job, output, progress)
    }
}
