//! Textures in the row order of OpenGL: the bottom row first.

use super::super::device::{Gpu, TextureUpload};
use super::super::faults::failure;
use super::super::pipelines::trilinear;
use super::pipelines::Groups;
use curitiba_pipeline::backend::{BackendError, OwnMaterial, OwnTexture};
use curitiba_pipeline::glsl::{Program, SamplerKind};
use curitiba_pipeline::scene::RenderScene;
use curitiba_pipeline::scene::texture::{Level, Magnification, Sampling, Texture, Wrap};

/// A texture that shaders sample.
#[derive(Debug)]
pub(super) struct Sampled {
    pub view: wgpu::TextureView,
    pub sampler: wgpu::Sampler,
}

/// The textures of a scene that own shaders have read so far, by their index in the scene.
#[derive(Debug)]
pub(super) struct Textures {
    sampled: Vec<Option<Sampled>>,
    /// The scene's cube maps, by the indices of their images.
    cubes: Vec<([u32; 6], Sampled)>,
    /// Stand-ins for samplers to which nothing is bound: opaque black, as an image and as a cube map.
    nothing: [Sampled; 2],
    /// Sampler that does not filter.
    pub nearest: wgpu::Sampler,
    /// Bytes of device memory of all textures.
    pub bytes: u64,
}

impl Textures {
    pub fn new(gpu: &Gpu) -> Result<Self, BackendError> {
        let level = Level { width: 1, height: 1, texels: vec![[0, 0, 0, 255]] };
        let levels = &[level][..];
        let nothing = [
            upload(gpu, "nothing", &[levels], Sampling::default())?,
            upload(gpu, "nothing", &[levels; 6], CUBE_SAMPLING)?,
        ];
        let nearest = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("unfiltered"),
            address_mode_u: wgpu::AddressMode::Repeat,
            address_mode_v: wgpu::AddressMode::Repeat,
            ..Default::default()
        });
        gpu.check("creation of a sampler")?;
        Ok(Self { sampled: Vec::new(), cubes: Vec::new(), nothing, nearest, bytes: 0 })
    }

    /// The stand-in for a sampler to which nothing is bound.
    pub fn nothing(&self, kind: SamplerKind) -> &Sampled {
        &self.nothing[usize::from(kind == SamplerKind::Cube)]
    }

    /// Forgets the textures of a scene.
    pub fn forget(&mut self) {
        self.sampled.clear();
        self.cubes.clear();
        self.bytes = 0;
    }

    /// Binds the textures that a material's shader samples.
    pub fn bind(
        &mut self,
        gpu: &Gpu,
        groups: &Groups,
        (program, material, exact): (&Program, &OwnMaterial, &[bool]),
        scene: &RenderScene,
        channels: &[Sampled],
    ) -> Result<wgpu::BindGroup, BackendError> {
        for texture in &material.textures {
            match texture {
                OwnTexture::Scene(index) => self.require(gpu, scene, *index)?,
                OwnTexture::Cube(faces) => self.require_cube(gpu, scene, *faces)?,
                OwnTexture::Nothing | OwnTexture::Channel(_) => {}
            }
        }
        let bound = |texture: &OwnTexture| match *texture {
            OwnTexture::Nothing => None,
            OwnTexture::Scene(index) => self.sampled[index as usize].as_ref(),
            OwnTexture::Cube(faces) => self.cubes.iter().find(|(of, _)| *of == faces).map(|(_, cube)| cube),
            OwnTexture::Channel(index) => channels.get(index),
        };
        let entries: Vec<wgpu::BindGroupEntry<'_>> = (0..)
            .zip(material.textures.iter().zip(exact).zip(&program.samplers))
            .flat_map(|(sampler, ((texture, exact), declared)): (u32, _)| {
                let Sampled { view, sampler: own } = bound(texture).unwrap_or(self.nothing(declared.kind));
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
            let Texture { name, levels, sampling, .. } = texture;
            self.sampled[index as usize] = Some(upload(gpu, name, &[levels], *sampling)?);
            self.bytes += bytes_of(levels);
        }
        Ok(())
    }

    fn require_cube(&mut self, gpu: &Gpu, scene: &RenderScene, faces: [u32; 6]) -> Result<(), BackendError> {
        if self.cubes.iter().any(|(of, _)| *of == faces) {
            return Ok(());
        }
        let Some(images) = texture_of(faces, |index| scene.textures.get(index as usize)) else {
            return Err(failure(&format!("the scene has no textures {faces:?}")));
        };
        self.cubes.push((faces, upload_cube(gpu, images)?));
        self.bytes += images.iter().map(|image| bytes_of(&image.levels)).sum::<u64>();
        Ok(())
    }
}

/// Sampling of cube maps. At the edge of an image, filtering continues in the adjacent image, whatever the wrap mode.
const CUBE_SAMPLING: Sampling = Sampling { wrap: [Wrap::Clamp; 2], magnification: Magnification::Linear };

fn bytes_of(levels: &[Level]) -> u64 {
    levels.iter().map(|level| 4 * level.texels.len() as u64).sum()
}

/// The six images of a cube map; `None` if `image` lacks one.
fn texture_of<'a>(faces: [u32; 6], image: impl Fn(u32) -> Option<&'a Texture>) -> Option<[&'a Texture; 6]> {
    match faces.map(image) {
        [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f)] => Some([a, b, c, d, e, f]),
        _ => None,
    }
}

/// Uploads the images of a cube map: +x, -x, +y, -y, +z, -z, square and of one size.
pub(super) fn upload_cube(gpu: &Gpu, images: [&Texture; 6]) -> Result<Sampled, BackendError> {
    upload(gpu, &images[0].name, &images.map(|image| &image.levels[..]), CUBE_SAMPLING)
}

/// Uploads an image, or the six of a cube map, with their mip levels.
pub(super) fn upload(gpu: &Gpu, name: &str, layers: &[&[Level]], sampling: Sampling) -> Result<Sampled, BackendError> {
    let levels = layers.first().copied().unwrap_or_default();
    let (width, height) = levels.first().map_or((1, 1), |level| (level.width, level.height));
    let sizes = |levels: &[Level]| levels.iter().map(|level| [level.width, level.height]).collect::<Vec<_>>();
    if layers.iter().any(|other| sizes(other) != sizes(levels)) {
        return Err(failure(&format!("the images of the cube map {name} differ in size")));
    }
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
        size: wgpu::Extent3d { width, height, depth_or_array_layers: layers.len() as u32 },
        mip_level_count: levels.len() as u32,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8Unorm,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    gpu.check(&doing)?;
    let all =
        (0..).zip(layers).flat_map(|(layer, levels)| (0..).zip(*levels).map(move |(mip, level)| (layer, mip, level)));
    let mut upload = TextureUpload::new(gpu, &texture, &doing);
    for (layer, mip_level, level) in all {
        let rows: Vec<[u8; 4]> = level.texels.chunks_exact(level.width as usize).rev().flatten().copied().collect();
        upload.level(layer, mip_level, bytemuck::cast_slice(&rows))?;
    }
    upload.end()?;
    let dimension = if layers.len() == 6 { wgpu::TextureViewDimension::Cube } else { wgpu::TextureViewDimension::D2 };
    let view = texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(dimension),
        ..wgpu::TextureViewDescriptor::default()
    });
    let sampler = trilinear(&gpu.device, sampling);
    gpu.check(&doing)?;
    Ok(Sampled { view, sampler })
}
