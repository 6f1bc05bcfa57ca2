//! The trait of rasterisers.

use super::device::Limits;
use super::effect_job::{EffectJob, EffectStats};
use super::error::{BackendError, not_in_place};
use super::own_shaders::{ComputeJob, OwnShaders, QuadJob};
use super::raster_job::{DrawStats, RasterJob};
use crate::device_quad::{DeviceQuad, DeviceQuadStats, QuadPlace, Shown};
use crate::gbuffer::{Attachments, GBuffer};
use crate::image::Image;
use crate::progress::Progress;
use crate::scene::RenderScene;
use crate::shared::{DeviceUuid, InPlace, SharedGBuffer};
use std::sync::Arc;

/// Draws triangles into G-buffers.
pub trait Rasteriser {
    /// Short name: `cpu` or `wgpu`.
    fn name(&self) -> &'static str;
    /// The largest viewport that it draws.
    fn limits(&self) -> Limits;
    /// Description of the device and its driver.
    fn device(&self) -> String;
    /// Uploads the scene; the executor times this step.
    ///
    /// # Errors
    /// If the device cannot hold it.
    fn upload(&mut self, scene: &Arc<RenderScene>) -> Result<(), BackendError>;
    /// Draws, and waits until it is done. The attachments of the job are allocated in `target`. A rasteriser in host memory writes
    /// them directly; others keep their own until [`Rasteriser::read_back`]. Pixels outside the viewport keep their values.
    ///
    /// # Errors
    /// If the device fails.
    fn draw(&mut self, job: &RasterJob<'_>, target: &mut GBuffer) -> Result<DrawStats, BackendError>;
    /// [`Rasteriser::draw`] that reports to `progress`. Between parts of the work it checks [`Progress::is_cancelled`]; if that is set,
    /// it returns early and the contents of `target` are undefined. A rasteriser whose work has no parts draws to the end.
    ///
    /// # Errors
    /// As [`Rasteriser::draw`].
    fn draw_until(
        &mut self,
        job: &RasterJob<'_>,
        target: &mut GBuffer,
        _progress: &Progress,
    ) -> Result<DrawStats, BackendError> {
        self.draw(job, target)
    }
    /// Whether it draws with own shaders of the project.
    fn draws_shaders(&self) -> bool {
        false
    }
    /// [`Rasteriser::draw`], with own shaders for some materials. Their fragments write no triangle ids. `buffers` are the storage
    /// buffers and images of the pass, 16 bytes an element; afterwards they hold what the shaders stored. Every fragment of every
    /// triangle stores, hidden or not.
    ///
    /// # Errors
    /// If the device fails, or the rasteriser cannot draw with own shaders.
    fn draw_with(
        &mut self,
        job: &RasterJob<'_>,
        shaders: &OwnShaders<'_>,
        target: &mut GBuffer,
        _buffers: &mut [Vec<[f32; 4]>],
    ) -> Result<DrawStats, BackendError> {
        if shaders.materials.iter().all(Option::is_none) {
            return self.draw(job, target);
        }
        Err(BackendError::no_shaders(self.name(), "a pass"))
    }
    /// Fills a quad with an own shader of the project. `pixels` are the pixels of the job, top row first. Pixels that the shader discards
    /// keep their values. `buffers` are bound to the program's storage buffers, 16 bytes an element; afterwards they hold what the shader
    /// stored.
    ///
    /// # Errors
    /// If the device fails, or the rasteriser runs no own shaders.
    fn fill(
        &mut self,
        _job: &QuadJob<'_>,
        _pixels: &mut [[f32; 4]],
        _buffers: &mut [Vec<[f32; 4]>],
    ) -> Result<(), BackendError> {
        Err(BackendError::no_shaders(self.name(), "a quad"))
    }
    /// Runs a compute shader of the project. `buffers` are bound to the program's storage buffers, 16 bytes an element; afterwards they
    /// hold what the shader stored.
    ///
    /// # Errors
    /// If the device fails, or the rasteriser runs no own shaders.
    fn compute(&mut self, _job: &ComputeJob<'_>, _buffers: &mut [Vec<[f32; 4]>]) -> Result<(), BackendError> {
        Err(BackendError::no_shaders(self.name(), "a compute pass"))
    }
    /// Whether attachments reach host memory only through [`Rasteriser::read_back`].
    fn needs_read_back(&self) -> bool;
    /// Copies the `wanted` attachments of the last draw into `target`. Other attachments of `target` keep their values.
    ///
    /// # Errors
    /// If the device fails.
    fn read_back(&mut self, job: &RasterJob<'_>, wanted: Attachments, target: &mut GBuffer)
    -> Result<(), BackendError>;
    /// Whether the rasteriser draws exact spheres ([`Geometry::spheres`](crate::scene::Geometry::spheres)). No rasteriser draws them into
    /// the maps of effects or with own shaders.
    fn draws_spheres(&self) -> bool {
        false
    }
    /// A handle through which a ray backend on the same device reads attachments without a copy; `None` if the rasteriser lends none.
    /// The handle refers to the last job that named attachments in [`RasterJob::shared`].
    fn lends(&mut self) -> Option<InPlace> {
        None
    }
    /// The device, if other interfaces (CUDA, OptiX) can read its attachments in place; otherwise `None`.
    fn shares(&self) -> Option<DeviceUuid> {
        None
    }
    /// Allocates shared memory for G-buffers of this size and replaces the previous allocation. With `picture` there is also room for the
    /// picture of a ray pass, which [`Rasteriser::fill_on_device`] reads. Jobs name the attachments to store there in
    /// [`RasterJob::shared`].
    ///
    /// # Errors
    /// If the device has too little memory, or shares none at all.
    fn share(
        &mut self,
        width: u32,
        height: u32,
        attachments: Attachments,
        picture: bool,
    ) -> Result<SharedGBuffer, BackendError> {
        let and = if picture { " and a picture" } else { "" };
        let what = format!("a shared G-buffer of {width} x {height} pixels with {attachments:?}{and}");
        Err(BackendError::Unsupported { backend: self.name(), what, why: "it shares no memory".to_owned() })
    }
    /// Runs a raster effect: draws the maps that it needs, then computes every pixel of `output`, which has the job's size.
    ///
    /// # Errors
    /// If the device fails, or the job lacks what the program reads.
    fn effect(
        &mut self,
        job: &EffectJob<'_>,
        output: &mut Image,
        progress: &Progress,
    ) -> Result<EffectStats, BackendError>;
    /// Where the rasteriser fills quads. Only [`QuadPlace::Device`] allows [`Rasteriser::effect_in_place`] and
    /// [`Rasteriser::fill_on_device`].
    fn fills_quads(&self) -> QuadPlace {
        QuadPlace::Host
    }
    /// Runs a raster effect and keeps its picture on the device, for [`Rasteriser::fill_on_device`]. The number identifies the picture
    /// ([`OnDevice::Made`](crate::device_quad::OnDevice::Made)).
    ///
    /// # Errors
    /// As [`Rasteriser::effect`], or if the rasteriser keeps no pictures on a device.
    fn effect_in_place(&mut self, _: &EffectJob<'_>, _: usize, _: &Progress) -> Result<EffectStats, BackendError> {
        Err(not_in_place(self.name()))
    }
    /// Fills a quad from pictures on the device (drawn, computed or traced), waits, and copies the quad's pixels into host memory in the
    /// form of the last argument.
    ///
    /// # Errors
    /// If the device fails, or a picture that the quad reads is missing.
    fn fill_on_device(&mut self, _: &DeviceQuad, _: Shown<'_>) -> Result<DeviceQuadStats, BackendError> {
        Err(not_in_place(self.name()))
    }
}
