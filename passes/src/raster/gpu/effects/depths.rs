//! The depths of a picture on the device, from which occlusions compute positions.
//!
//! A step of an occlusion reads one texel of another pixel. A depth takes 4 bytes, a position 16. The position is computed from the depth
//! as the point of that depth on the line of sight through the pixel's centre. Rasterisers draw positions on that line, up to the
//! rounding of vertices to a part of a pixel; 16-bit positions are farther off the line.

use super::bindings::{bind, layout, uniform};
use super::inputs::Inputs;
use super::programs::compute_pipeline;
use super::shader::{self, LARGE_GROUP};
use super::uniforms::DepthsUniform;
use crate::raster::effects::screen::camera::ScreenCamera;
use crate::raster::gpu::cache::Kept;
use crate::raster::gpu::device::Gpu;
use crate::raster::gpu::resources::texture;
use curitiba_pipeline::backend::BackendError;

/// The format of depths.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R32Float;

/// Resources kept from picture to picture.
#[derive(Debug)]
pub struct Depths {
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    uniform: wgpu::Buffer,
    pictures: Kept<(u32, u32), Picture>,
}

/// The texture of depths for pictures of one size, and its bindings.
#[derive(Debug)]
struct Picture {
    size: (u32, u32),
    view: wgpu::TextureView,
    group: wgpu::BindGroup,
}

impl Depths {
    pub fn new(gpu: &Gpu, inputs: &Inputs) -> Result<Self, BackendError> {
        let doing = "building the program of depths";
        let output = wgpu::BindingType::StorageTexture {
            access: wgpu::StorageTextureAccess::WriteOnly,
            format: FORMAT,
            view_dimension: wgpu::TextureViewDimension::D2,
        };
        let layout = layout(&gpu.device, "depths", [uniform(size_of::<DepthsUniform>()), output]);
        let pipeline = compute_pipeline(gpu, Some("depths"), shader::depths_source(), &[&inputs.layout, &layout]);
        gpu.check(doing)?;
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let uniform = gpu.buffer(doing, usage, size_of::<DepthsUniform>() as u64)?;
        Ok(Self { pipeline, layout, uniform, pictures: Kept::default() })
    }

    /// Bytes of device memory of all pictures.
    pub fn bytes(&self) -> u64 {
        self.pictures.values().map(|picture| 4 * u64::from(picture.size.0) * u64::from(picture.size.1)).sum()
    }

    /// Makes the depths of a picture of this size available. `release` is as in [`Kept::require`].
    pub fn require(&mut self, gpu: &Gpu, size: (u32, u32), release: impl FnOnce()) -> Result<(), BackendError> {
        let (layout, uniform) = (&self.layout, &self.uniform);
        self.pictures.require(gpu, size, release, |(width, height)| {
            let usage = wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING;
            let texture = texture(gpu, "depths", FORMAT, [*width, *height], usage);
            gpu.check("creation of the depths of an occlusion")?;
            let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
            let resources = [uniform.as_entire_binding(), wgpu::BindingResource::TextureView(&view)];
            let group = bind(&gpu.device, "depths", layout, resources);
            gpu.check("binding of the depths of an occlusion")?;
            Ok(Picture { size: (*width, *height), view, group })
        })?;
        Ok(())
    }

    /// The depths that were [required](Self::require) last; `None` before that.
    pub fn view(&self) -> Option<&wgpu::TextureView> {
        self.pictures.last().map(|picture| &picture.view)
    }

    /// Sets the camera for which depths are computed.
    pub fn look(&self, gpu: &Gpu, camera: ScreenCamera) {
        gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&DepthsUniform { camera }));
    }

    /// Records the computation of the depths that were [required](Self::require) last, from a G-buffer of the same size.
    pub fn record(&self, pass: &mut wgpu::ComputePass<'_>, gbuffer: &wgpu::BindGroup) {
        let Some(picture) = self.pictures.last() else { return };
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, gbuffer, &[]);
        pass.set_bind_group(1, &picture.group, &[]);
        let (width, height) = picture.size;
        pass.dispatch_workgroups(width.div_ceil(LARGE_GROUP), height.div_ceil(LARGE_GROUP), 1);
    }
}
