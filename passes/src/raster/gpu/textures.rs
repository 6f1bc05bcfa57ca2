//! Textures in device memory.

use super::device::{Gpu, TextureUpload};
use super::faults::failure;
use super::pipelines::{Layouts, trilinear};
use curitiba_pipeline::backend::BackendError;
use curitiba_pipeline::color::ColorSpace;
use curitiba_pipeline::scene::RenderScene;
use curitiba_pipeline::scene::texture::{Sampling, Texture};

/// The textures of a scene that have been uploaded so far, by their index in the scene.
#[derive(Debug, Default)]
pub(super) struct DeviceTextures {
    bindings: Vec<Option<wgpu::BindGroup>>,
    /// Bytes of device memory of all textures.
    pub bytes: u64,
}

impl DeviceTextures {
    /// Uploads the textures of the materials that have triangles.
    pub fn upload(gpu: &Gpu, layouts: &Layouts, scene: &RenderScene) -> Result<Self, BackendError> {
        let mut this = Self { bindings: vec![None; scene.textures.len()], bytes: 0 };
        if !scene.geometry.texcoords.is_empty() {
            for batch in &scene.geometry.batches {
                let material = scene.materials.get(batch.material as usize);
                if let Some(texture) = material.and_then(|material| material.texture) {
                    this.require(gpu, layouts, scene, texture)?;
                }
            }
        }
        Ok(this)
    }

    /// Uploads a texture unless it is there already. The shades of a job may name textures that the scene's materials
    /// do not.
    pub fn require(
        &mut self,
        gpu: &Gpu,
        layouts: &Layouts,
        scene: &RenderScene,
        index: u32,
    ) -> Result<(), BackendError> {
        let (Some(texture), Some(binding)) =
            (scene.textures.get(index as usize), self.bindings.get_mut(index as usize))
        else {
            return Err(failure(&format!("the scene has no texture {index}")));
        };
        if binding.is_none() {
            *binding = Some(upload(gpu, layouts, texture)?);
            self.bytes += texture.levels.iter().map(|level| 4 * level.texels.len() as u64).sum::<u64>();
        }
        Ok(())
    }

    /// The bind group of a texture that was [required](Self::require) before.
    pub fn binding(&self, index: u32) -> Option<&wgpu::BindGroup> {
        self.bindings.get(index as usize)?.as_ref()
    }
}

fn upload(gpu: &Gpu, layouts: &Layouts, source: &Texture) -> Result<wgpu::BindGroup, BackendError> {
    let (width, height) = (source.levels[0].width, source.levels[0].height);
    let largest = gpu.limits.max_texture_dimension_2d;
    if width.max(height) > largest {
        let name = &source.name;
        return Err(failure(&format!(
            "texture {name} has {width} x {height} texels, {} takes {largest} x {largest} at most",
            gpu.adapter
        )));
    }
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(&source.name),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: source.levels.len() as u32,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        // Devices decode sRGB before they filter, as the processor does.
        format: match source.space {
            ColorSpace::Report => wgpu::TextureFormat::Rgba8Unorm,
            ColorSpace::Linear => wgpu::TextureFormat::Rgba8UnormSrgb,
        },
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let doing = format!("upload of texture {}", source.name);
    gpu.check(&doing)?;
    let mut upload = TextureUpload::new(gpu, &texture, &doing);
    for (mip_level, level) in (0..).zip(&source.levels) {
        upload.level(0, mip_level, bytemuck::cast_slice(&level.texels))?;
    }
    upload.end()?;
    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
    let own = (source.sampling != Sampling::default()).then(|| trilinear(&gpu.device, source.sampling));
    let sampler = own.as_ref().unwrap_or(&layouts.trilinear);
    let binding = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some(&source.name),
        layout: &layouts.texture,
        entries: &[
            wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) },
            wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(sampler) },
        ],
    });
    gpu.check(&doing)?;
    Ok(binding)
}
