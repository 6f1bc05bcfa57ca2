//! Textures as OpenGL has them: the bottom row first.

use super::super::device::Gpu;
use super::super::faults::failure;
use super::super::pipelines::trilinear;
use super::pipelines::Groups;
use curitiba_pipeline::backend::{BackendError, OwnMaterial, OwnTexture};
use curitiba_pipeline::scene::RenderScene;
use curitiba_pipeline::scene::texture::{Level, Texture, Wrap};

/// A texture that shaders sample.
#[derive(Debug)]
pub(super) struct Sampled {
    pub view: wgpu::TextureView,
    pub sampler: wgpu::Sampler,
}

/// The textures of a scene that own shaders have read so far, by their index there.
#[derive(Debug)]
pub(super) struct Textures {
    sampled: Vec<Option<Sampled>>,
    /// What is read where nothing is bound: black and opaque.
    nothing: Sampled,
    /// What reads textures unfiltered.
    pub nearest: wgpu::Sampler,
    /// Bytes of device memory.
    pub bytes: u64,
}

impl Textures {
    pub fn new(gpu: &Gpu) -> Result<Self, BackendError> {
        let level = Level { width: 1, height: 1, texels: vec![[0, 0, 0, 255]] };
        let nothing = upload(gpu, "nothing", &[level], [Wrap::Repeat; 2])?;
        let nearest = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("unfiltered"),
            address_mode_u: wgpu::AddressMode::Repeat,
            address_mode_v: wgpu::AddressMode::Repeat,
            ..Default::default()
        });
        gpu.check("creation of a sampler")?;
        Ok(Self { sampled: Vec::new(), nothing, nearest, bytes: 0 })
    }

    /// What is read where nothing is bound.
    pub fn nothing(&self) -> &Sampled {
        &self.nothing
    }

    /// Forgets the textures of a scene.
    pub fn forget(&mut self) {
        self.sampled.clear();
        self.bytes = 0;
    }

    /// Binds what a material's shader samples.
    pub fn bind(
        &mut self,
        gpu: &Gpu,
        groups: &Groups,
        (material, exact): (&OwnMaterial, &[bool]),
        scene: &RenderScene,
        channels: &[Sampled],
    ) -> Result<wgpu::BindGroup, BackendError> {
        for texture in &material.textures {
            if let OwnTexture::Scene(index) = texture {
                self.require(gpu, scene, *index)?;
            }
        }
        let bound = |texture: &OwnTexture| match *texture {
            OwnTexture::Nothing => None,
            OwnTexture::Scene(index) => self.sampled[index as usize].as_ref(),
            OwnTexture::Channel(index) => channels.get(index),
        };
        let entries: Vec<wgpu::BindGroupEntry<'_>> = (0..)
            .zip(material.textures.iter().zip(exact))
            .flat_map(|(sampler, (texture, exact)): (u32, _)| {
                let Sampled { view, sampler: own } = bound(texture).unwrap_or(&self.nothing);
                let (own, first) = (if *exact { &self.nearest } else { own }, 2 * sampler);
                let view = wgpu::BindingResource::TextureView(view);
                let own = wgpu::BindingResource::Sampler(own);
                [(first, view), (first + 1, own)].map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
            })
            .collect();
        let descriptor =
            wgpu::BindGroupDescriptor { label: Some("own textures"), layout: &groups.textures, entries: &entries };
        let group = gpu.device.create_bind_group(&descriptor);
        gpu.check("binding of the textures of an own shader")?;
        Ok(group)
    }

    fn require(&mut self, gpu: &Gpu, scene: &RenderScene, index: u32) -> Result<(), BackendError> {
        let Some(texture) = scene.textures.get(index as usize) else {
            return Err(failure(&format!("the scene has no texture {index}")));
        };
        if self.sampled.len() < scene.textures.len() {
            self.sampled.resize_with(scene.textures.len(), || None);
        }
        if self.sampled[index as usize].is_none() {
            let Texture { name, levels, wrap, .. } = texture;
            self.sampled[index as usize] = Some(upload(gpu, name, levels, *wrap)?);
            self.bytes += levels.iter().map(|level| 4 * level.texels.len() as u64).sum::<u64>();
        }
        Ok(())
    }
}

pub(super) fn upload(gpu: &Gpu, name: &str, levels: &[Level], wrap: [Wrap; 2]) -> Result<Sampled, BackendError> {
    let (width, height) = levels.first().map_or((1, 1), |level| (level.width, level.height));
    let largest = gpu.limits.max_texture_dimension_2d;
    if width.max(height) > largest {
        return Err(failure(&format!(
            "texture {name} has {width} x {height} texels, {} takes {largest} x {largest} at most",
            gpu.adapter
        )));
    }
    let doing = format!("upload of texture {name}");
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(name),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: levels.len() as u32,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8Unorm,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    gpu.check(&doing)?;
    for (mip_level, level) in (0..).zip(levels) {
        let rows: Vec<[u8; 4]> = level.texels.chunks_exact(level.width as usize).rev().flatten().copied().collect();
        gpu.queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                texture: &texture,
                mip_level,
                origin: wgpu::Origin3d::ZERO,
                aspect: wgpu::TextureAspect::All,
            },
            bytemuck::cast_slice(&rows),
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * level.width), rows_per_image: None },
            wgpu::Extent3d { width: level.width, height: level.height, depth_or_array_layers: 1 },
        );
    }
    gpu.submit_and_wait(None, &doing)?;
    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
    let sampler = trilinear(&gpu.device, wrap);
    gpu.check(&doing)?;
    Ok(Sampled { view, sampler })
}
