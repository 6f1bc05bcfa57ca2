//! A scene in device memory: vertices, materials and textures.

use crate::device::{Address, Buffer, Device};
use crate::layout::{
    Body, LIGHT_CONE, LIGHT_PLACE, Light, NO_TEXTURE, Params, SHADE_CUT, SHADE_GLASS, SHADE_GLOW, SHADE_NORMAL_MAP,
    SHADE_SHADOW_GLASS, SHADE_SKY, SHADE_VERTEX_COLORS, SHAPE_OPAQUE, SHAPE_PANE, SHAPE_SOLID, SHAPE_THIN, Shade,
    TextureInfo, VERTEX_COLORS_DISPLAY, VERTEX_COLORS_LINEAR, VERTEX_COLORS_NONE, WRAP_CLAMP, WRAP_MIRROR, WRAP_REPEAT,
};
use crate::spheres::SphereBuffers;
use curitiba_pipeline::backend::{self, BackendError, RayJob};
use curitiba_pipeline::color::{ColorSpace, DECODED};
use curitiba_pipeline::glass::{Dielectric, Shape};
use curitiba_pipeline::programs::Fidelity;
use curitiba_pipeline::scene::texture::Wrap;
use curitiba_pipeline::scene::{Geometry, RenderScene};

/// The scene data that all programs read, whichever tracer runs them.
#[derive(Debug, Default)]
pub struct SceneBuffers {
    positions: Buffer<f32>,
    normals: Buffer<f32>,
    texcoords: Buffer<f32>,
    /// Empty where no mesh has vertex colours.
    colors: Buffer<f32>,
    /// Empty in a scene without tangents, which only normal maps read.
    tangents: Buffer<f32>,
    triangles: Buffer<u32>,
    materials: Buffer<u32>,
    spheres: SphereBuffers,
    textures: Buffer<TextureInfo>,
    texels: Buffer<u8>,
    /// Whether the textures have all of their mip levels, and not only level 0.
    has_levels: bool,
    /// Linear values of the sRGB codes; empty where texels are read as stored.
    decoded: Buffer<f32>,
}

impl SceneBuffers {
    /// Copies a scene to the device. `transparent` says by material whether the device program decides if a hit on an exact sphere counts; `None`
    /// if rays hit no exact sphere.
    pub fn new(device: &Device, scene: &RenderScene, transparent: Option<&[bool]>) -> Result<Self, BackendError> {
        let geometry = &scene.geometry;
        let (textures, texels) = textures(scene, false);
        Ok(Self {
            has_levels: false,
            positions: device.upload("vertex positions", bytemuck::cast_slice(&geometry.positions))?,
            normals: device.upload("vertex normals", bytemuck::cast_slice(&geometry.normals))?,
            texcoords: device.upload("texture coordinates", bytemuck::cast_slice(&geometry.texcoords))?,
            colors: device.upload("vertex colours", bytemuck::cast_slice(&geometry.colors))?,
            tangents: device.upload("vertex tangents", bytemuck::cast_slice(&geometry.tangents))?,
            triangles: device.upload("triangles", bytemuck::cast_slice(&geometry.triangles))?,
            materials: device.upload("the materials of triangles", &materials(geometry))?,
            spheres: SphereBuffers::new(device, scene, transparent)?,
            textures: device.upload("texture sizes", &textures)?,
            texels: device.upload("textures", &texels)?,
            decoded: device.upload("the codes of sRGB", if scene.decodes_texels() { &DECODED[..] } else { &[] })?,
        })
    }

    /// Replaces level 0 of the scene's textures by all mip levels, unless this was done before. After an error the buffers cannot be used.
    pub fn require_levels(&mut self, device: &Device, scene: &RenderScene) -> Result<(), BackendError> {
        if self.has_levels {
            return Ok(());
        }
        let (textures, texels) = textures(scene, true);
        device.replace("texture sizes", &mut self.textures, &textures)?;
        device.replace("textures", &mut self.texels, &texels)?;
        self.has_levels = true;
        Ok(())
    }

    /// Writes the addresses into the parameters of a launch.
    pub fn fill(&self, device: &Device, params: &mut Params) {
        params.positions = self.positions.address(device);
        params.normals = self.normals.address(device);
        params.texcoords = self.texcoords.address(device);
        params.colors = self.colors.address(device);
        params.tangents = self.tangents.address(device);
        params.triangles = self.triangles.address(device);
        params.materials = self.materials.address(device);
        params.spheres = self.spheres.address(device);
        params.textures = self.textures.address(device);
        params.texels = self.texels.address(device);
        params.decoded = self.decoded.address(device);
    }

    /// Addresses of vertex positions, triangles and their materials, for a structure that is built on the device.
    pub fn mesh(&self, device: &Device) -> [Address; 3] {
        [self.positions.address(device), self.triangles.address(device), self.materials.address(device)]
    }

    /// Number of nodes of the tree of exact spheres.
    pub fn sphere_nodes(&self) -> u64 {
        self.spheres.node_count()
    }

    /// Size in bytes of device memory.
    pub fn bytes(&self) -> u64 {
        self.positions.bytes()
            + self.normals.bytes()
            + self.texcoords.bytes()
            + self.colors.bytes()
            + self.tangents.bytes()
            + self.triangles.bytes()
            + self.materials.bytes()
            + self.spheres.bytes()
            + self.textures.bytes()
            + self.texels.bytes()
            + self.decoded.bytes()
    }
}

/// The material of each triangle, then of each exact sphere.
fn materials(geometry: &Geometry) -> Vec<u32> {
    geometry.materials().chain(geometry.spheres.iter().map(|sphere| sphere.material)).collect()
}

/// Description of every texture, and the texels of all textures: of level 0 or, with `has_levels`, of all levels in order.
fn textures(scene: &RenderScene, has_levels: bool) -> (Vec<TextureInfo>, Vec<u8>) {
    let (mut infos, mut texels) = (Vec::with_capacity(scene.textures.len()), Vec::new());
    for texture in &scene.textures {
        let level = &texture.levels[0];
        let [wrap_u, wrap_v] = texture.sampling.wrap.map(|wrap| match wrap {
            Wrap::Repeat => WRAP_REPEAT,
            Wrap::Mirror => WRAP_MIRROR,
            Wrap::Clamp => WRAP_CLAMP,
        });
        let (width, height) = (level.width, level.height);
        let nearest = u32::from(texture.sampling.is_nearest());
        infos.push(TextureInfo { first: texels.len() as u64 / 4, width, height, wrap_u, wrap_v, nearest, unused: 0 });
        let levels = if has_levels { &texture.levels[..] } else { &texture.levels[..1] };
        levels.iter().for_each(|level| texels.extend_from_slice(level.texels.as_flattened()));
    }
    (infos, texels)
}

/// The job's shading data, by material.
pub fn shades(job: &RayJob<'_>) -> Vec<Shade> {
    let set = |flags: &[bool], material: usize, flag: u32| {
        if flags.get(material).copied().unwrap_or(false) { flag } else { 0 }
    };
    let shade = |(material, shade): (usize, &backend::Shade)| {
        let cutoff = shade.alpha_cutoff.filter(|_| job.fidelity == Fidelity::Corrected);
        Shade {
            diffuse: shade.diffuse.truncate().to_array(),
            flags: set(job.glass, material, SHADE_GLASS)
                | set(job.shadow_glass, material, SHADE_SHADOW_GLASS)
                | if cutoff.is_some() { SHADE_CUT } else { 0 }
                | if shade.glow.is_some() { SHADE_GLOW } else { 0 }
                | if shade.vertex_colors { SHADE_VERTEX_COLORS } else { 0 }
                | if shade.normal_map.is_some() { SHADE_NORMAL_MAP } else { 0 }
                | if job.scene.materials.get(material).is_some_and(|material| material.sky) { SHADE_SKY } else { 0 },
            texture: shade.texture.unwrap_or(NO_TEXTURE),
            cutoff: cutoff.unwrap_or(0.0),
            glow: shade.glow.map_or([0.0; 3], |glow| glow.color.to_array()),
            glow_texture: shade.glow.and_then(|glow| glow.texture).unwrap_or(NO_TEXTURE),
            normal_texture: shade.normal_map.map_or(NO_TEXTURE, |map| map.texture),
            normal_scale: shade.normal_map.map_or(0.0, |map| map.scale),
        }
    };
    job.shades.iter().enumerate().map(shade).collect()
}

/// The job's glass data, by material.
pub fn bodies(job: &RayJob<'_>) -> Vec<Body> {
    let body = |dielectric: &Dielectric| Body {
        shape: match dielectric.shape {
            Shape::Opaque => SHAPE_OPAQUE,
            Shape::Pane => SHAPE_PANE,
            Shape::Thin => SHAPE_THIN,
            Shape::Solid => SHAPE_SOLID,
        },
        index: dielectric.index,
        extinction: dielectric.extinction.to_array(),
        filter: dielectric.filter.to_array(),
        filter_texture: dielectric.filter_texture.unwrap_or(NO_TEXTURE),
        filter_vertex_colors: match job.scene.geometry.color_space {
            _ if !dielectric.filter_vertex_colors || job.scene.geometry.colors.is_empty() => VERTEX_COLORS_NONE,
            ColorSpace::Report => VERTEX_COLORS_DISPLAY,
            ColorSpace::Linear => VERTEX_COLORS_LINEAR,
        },
        veil: dielectric.veil,
        thickness: dielectric.thickness,
        priority: dielectric.priority.into(),
        transmission_texture: dielectric.transmission_texture.unwrap_or(NO_TEXTURE),
    };
    job.dielectrics.iter().map(body).collect()
}

/// Lights in the device's layout.
#[must_use]
pub fn lights(lights: &[backend::Light]) -> Vec<Light> {
    let light = |light: &backend::Light| {
        let has_place = if light.place.is_some() { LIGHT_PLACE } else { 0 };
        let has_cone = if light.cone.is_some() { LIGHT_CONE } else { 0 };
        let none = backend::Cone { inner: 0.0, outer: 0.0, exponent: 0.0 };
        let backend::Cone { inner, outer, exponent } = light.cone.unwrap_or(none);
        Light {
            place: light.place.unwrap_or_default().to_array(),
            flags: has_place | has_cone,
            direction: light.direction.to_array(),
            range: light.range,
            color: light.color.to_array(),
            exponent,
            attenuation: light.attenuation,
            inner,
            outer,
        }
    };
    lights.iter().map(light).collect()
}

/// Emission of each material, three numbers each.
#[must_use]
pub fn emissions(job: &RayJob<'_>) -> Vec<f32> {
    job.shades.iter().flat_map(|shade| shade.emission.truncate().to_array()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use curitiba_pipeline::scene::texture::Texture;
    use curitiba_pipeline::scene::{Batch, Sphere};
    use glam::Vec3;

    #[test]
    fn triangles_know_their_material_and_textures_their_texels() {
        let geometry = Geometry {
            batches: vec![Batch { material: 3, first: 0, count: 2 }, Batch { material: 1, first: 2, count: 1 }],
            ..Geometry::default()
        };
        assert_eq!(materials(&geometry), [3, 3, 1]);
        let sphere = Sphere { center: Vec3::ZERO, radius: 1.0, material: 5 };
        assert_eq!(materials(&Geometry { spheres: vec![sphere; 2], ..geometry }), [3, 3, 1, 5, 5]);
        let texture = |width: u32, value: u8| Texture::new(String::new(), width, 1, vec![[value; 4]; width as usize]);
        let scene = RenderScene { textures: vec![texture(2, 7), texture(1, 9)], ..RenderScene::default() };
        let (infos, texels) = textures(&scene, false);
        assert_eq!((infos[1].first, infos[1].width, infos[1].height), (2, 1, 1));
        assert_eq!(texels, [7, 7, 7, 7, 7, 7, 7, 7, 9, 9, 9, 9]);
        let (infos, texels) = textures(&scene, true);
        assert_eq!((infos[0].first, infos[0].width, infos[1].first, infos[1].width), (0, 2, 3, 1));
        assert_eq!(texels, [7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 7, 9, 9, 9, 9]);
    }
}
