//! A scene in device memory: the tree, vertices, materials of triangles and textures.

use super::NAME;
use super::layout::{LARGEST_COORDINATE, NONE, Params};
use super::spheres::DeviceSpheres;
use super::split::Split;
use crate::raster::gpu::device::Gpu;
use crate::trace::Quality;
use crate::trace::gpu_binary::{BinaryTree, MOST_TRIANGLES};
use curitiba_pipeline::backend::BackendError;
use curitiba_pipeline::scene::texture::Texture;
use curitiba_pipeline::scene::{Geometry, RenderScene, Sphere};
use glam::Vec3;
use std::borrow::Cow;

/// The buffers of group 1, in the order of their bindings.
#[derive(Debug)]
pub struct SceneBuffers {
    buffers: Vec<wgpu::Buffer>,
    /// Which of the buffers hold parts of the same array.
    pub split: Split,
    /// Sizes of the arrays in bytes.
    sizes: [u64; 5],
    /// Whether the textures have all of their mip levels, and not only level 0.
    pub has_levels: bool,
    /// Parameters that describe the buffers.
    params: Params,
    /// Size in bytes of device memory.
    pub bytes: u64,
    /// Number of nodes of the tree.
    pub nodes: u64,
}

/// The error for a scene that does not fit a device's limits.
pub fn too_large(gpu: &Gpu, what: &str, bytes: u64, most: u64) -> BackendError {
    let why = format!(
        "{what} of the scene take {bytes} bytes, and {} reads {most} at once at most; `--backend cpu` traces it",
        gpu.adapter
    );
    BackendError::Unsupported { backend: NAME, what: "the scene".to_owned(), why }
}

/// Storage buffers that programs bind in addition to the scene: counts, points and tables. The parameters may take one more.
const OTHER_BUFFERS: u32 = 3;

/// The arrays of a scene, in the order of their bindings, as in [`Split`].
const ARRAYS: [&str; 5] =
    ["the nodes", "the triangles and spheres of the tree", "the vertices", "the triangles", "the textures"];
/// Index of the textures in [`ARRAYS`]; they are last.
const TEXELS: usize = 4;

/// The texels of a scene's textures, texture by texture, of level 0 or of all levels.
fn texels(scene: &RenderScene, has_levels: bool) -> Vec<[u8; 4]> {
    let levels = |texture: &'_ Texture| if has_levels { texture.levels.len() } else { 1 };
    let levels = scene.textures.iter().flat_map(|texture| &texture.levels[..levels(texture)]);
    levels.flat_map(|level| &level.texels).copied().collect()
}

/// How arrays of these sizes in bytes are spread over the bindings of a device.
fn split_of(gpu: &Gpu, sizes: [u64; 5]) -> Result<Split, BackendError> {
    let most = gpu.limits.max_storage_buffer_binding_size.min(gpu.max_buffer_bytes);
    let split = Split::new(sizes, most);
    let others = OTHER_BUFFERS + gpu.parameters.storage_buffers();
    let bindings = gpu.limits.max_storage_buffers_per_shader_stage.saturating_sub(others);
    if split.count() > bindings {
        return Err(too_many(gpu, std::array::from_fn(|array| (ARRAYS[array], sizes[array])), most, bindings));
    }
    Ok(split)
}

/// The error for a scene whose arrays need more bindings than a device has.
fn too_many(gpu: &Gpu, parts: [(&str, u64); 5], most: u64, bindings: u32) -> BackendError {
    let (what, bytes) = parts.into_iter().max_by_key(|(_, bytes)| *bytes).unwrap_or(("the arrays", 0));
    let all: u64 = parts.iter().map(|(_, bytes)| bytes).sum();
    let why = format!(
        "its arrays take {all} bytes, of which {what} take {bytes}, and {} binds {bindings} buffers of {most} bytes for them; \
         `--backend cpu` traces it",
        gpu.adapter
    );
    BackendError::Unsupported { backend: NAME, what: "the scene".to_owned(), why }
}

/// Adds the exact spheres of a scene to the tree of its triangles; an error if programs cannot trace them. If `traced` is false, no ray can
/// hit them.
fn spheres_of(
    scene: &RenderScene,
    filtered: &[bool],
    tree: &mut BinaryTree,
    traced: bool,
) -> Result<DeviceSpheres, BackendError> {
    let geometry = &scene.geometry;
    let surfaces = geometry.surfaces();
    let reach = |sphere: &Sphere| sphere.center.abs().max_element() + sphere.radius;
    let far = |sphere: &Sphere| reach(sphere).is_nan() || reach(sphere) > LARGEST_COORDINATE;
    let why = match () {
        () if surfaces >= MOST_TRIANGLES => {
            format!("it has {surfaces} triangles and exact spheres, and programs know fewer than {MOST_TRIANGLES}")
        }
        () if geometry.spheres.iter().any(far) => {
            format!("it has exact spheres with coordinates beyond {LARGEST_COORDINATE:e}, which overflow in 32 bits")
        }
        () => return Ok(DeviceSpheres::new(geometry, filtered, tree, traced)),
    };
    Err(refused(&why))
}

/// The error for a scene that programs cannot trace.
fn refused(why: &str) -> BackendError {
    let why = format!("{why}; `--backend cpu` traces it");
    BackendError::Unsupported { backend: NAME, what: "the scene".to_owned(), why }
}

/// Builds the scene's tree; an error if programs cannot trace it.
fn tree_of(geometry: &Geometry, filtered: &[bool]) -> Result<BinaryTree, BackendError> {
    let triangles = geometry.triangles.len();
    if triangles >= MOST_TRIANGLES {
        return Err(refused(&format!("it has {triangles} triangles, and the tree holds fewer than {MOST_TRIANGLES}")));
    }
    let tree = BinaryTree::build(geometry, filtered, Quality::default());
    let largest = tree.bounds.map(|point| Vec3::from(point).abs().max_element());
    if largest.into_iter().any(|coordinate| coordinate > LARGEST_COORDINATE) {
        return Err(refused(&format!("it has coordinates beyond {LARGEST_COORDINATE:e}, which overflow in 32 bits")));
    }
    Ok(tree)
}

/// A tree without the rest of the scene.
#[derive(Debug)]
pub struct TreeBuffers {
    pub nodes: wgpu::Buffer,
    pub triangles: wgpu::Buffer,
    /// Parameters that describe the tree.
    pub params: Params,
}

impl TreeBuffers {
    /// Builds the tree and copies it to the device.
    pub fn new(gpu: &Gpu, geometry: &Geometry, filtered: &[bool]) -> Result<Self, BackendError> {
        let tree = tree_of(geometry, filtered)?;
        let most = gpu.limits.max_storage_buffer_binding_size.min(gpu.max_buffer_bytes);
        let buffer = |what: &str, part: &[u8]| {
            if part.len() as u64 > most {
                return Err(too_large(gpu, what, part.len() as u64, most));
            }
            super::buffers::upload(gpu, what, part)
        };
        Ok(Self {
            nodes: buffer("the nodes", bytemuck::cast_slice(&tree.nodes))?,
            triangles: buffer("the triangles of the tree", bytemuck::cast_slice(&tree.triangles))?,
            params: params_of(&tree),
        })
    }
}

/// Parameters that describe a tree.
fn params_of(tree: &BinaryTree) -> Params {
    let [low, high] = tree.bounds;
    let [root, whole] = [tree.root, tree.whole].map(|root| root.unwrap_or(NONE));
    Params { root, whole, scene_low: low, scene_high: high, ..Params::default() }
}

impl SceneBuffers {
    /// Builds the tree and copies it to the device together with the scene. With `traced` false, the tree is empty and nothing can be hit.
    pub fn new(gpu: &Gpu, scene: &RenderScene, filtered: &[bool], traced: bool) -> Result<Self, BackendError> {
        let mut tree = if traced { tree_of(&scene.geometry, filtered)? } else { BinaryTree::default() };
        let geometry = &scene.geometry;
        let spheres = spheres_of(scene, filtered, &mut tree, traced)?;
        let mut params = params_of(&tree);
        params.sphere_root = spheres.root.unwrap_or(NONE);
        params.first_sphere = geometry.triangles.len() as u32;
        params.spheres_at = 3 * tree.triangles.len() as u32;
        let mut vertices: Vec<u32> = Vec::new();
        let mut part = |numbers: &[f32]| {
            let place = vertices.len() as u32;
            vertices.extend_from_slice(bytemuck::cast_slice(numbers));
            place
        };
        let numbers = geometry.positions.len() as u64 * 3 + geometry.normals.len() as u64 * 3;
        let wide = geometry.colors.len() + geometry.tangents.len();
        let numbers = numbers + geometry.texcoords.len() as u64 * 2 + wide as u64 * 4;
        // Offsets are 32-bit numbers.
        if numbers > u64::from(u32::MAX) {
            return Err(too_large(gpu, "the vertices", 4 * numbers, 4 * u64::from(u32::MAX)));
        }
        part(bytemuck::cast_slice(&geometry.positions));
        params.normals_at = part(bytemuck::cast_slice(&geometry.normals));
        params.texcoords_at = part(bytemuck::cast_slice(&geometry.texcoords));
        params.colors_at = part(bytemuck::cast_slice(&geometry.colors));
        // Tangents never begin at 0, where the positions are, so 0 can mean that there are none.
        if !geometry.tangents.is_empty() {
            params.tangents_at = part(bytemuck::cast_slice(&geometry.tangents));
        }
        params.has_normals = u32::from(!geometry.normals.is_empty());
        let mut mesh: Vec<u32> = geometry.triangles.as_flattened().to_vec();
        params.materials_at = mesh.len() as u32;
        mesh.extend(geometry.materials());
        mesh.extend(geometry.spheres.iter().map(|sphere| sphere.material));
        let texels = texels(scene, false);
        let mut leaves: Cow<'_, [u8]> = Cow::Borrowed(bytemuck::cast_slice(&tree.triangles));
        if !spheres.list.is_empty() {
            leaves.to_mut().extend_from_slice(bytemuck::cast_slice(&spheres.list));
        }
        let parts: [&[u8]; 5] = [
            bytemuck::cast_slice(&tree.nodes),
            &leaves,
            bytemuck::cast_slice(&vertices),
            bytemuck::cast_slice(&mesh),
            texels.as_flattened(),
        ];
        let sizes = parts.map(|part| part.len() as u64);
        let split = split_of(gpu, sizes)?;
        let mut buffers = Vec::with_capacity(split.count() as usize);
        for (array, part) in parts.into_iter().enumerate() {
            for part in split.parts(array, part) {
                buffers.push(super::buffers::upload(gpu, ARRAYS[array], part)?);
            }
        }
        let bytes = buffers.iter().map(wgpu::Buffer::size).sum();
        Ok(Self { buffers, split, sizes, has_levels: false, params, bytes, nodes: tree.nodes.len() as u64 })
    }

    /// Whether all arrays are on the device. They are not after [`Self::require_levels`] has failed halfway.
    pub fn is_whole(&self) -> bool {
        self.buffers.len() == self.split.count() as usize
    }

    /// Copies all mip levels of the scene's textures to the device, in place of level 0 alone, unless they are there. After an error the
    /// buffers can be used only if [they are whole](Self::is_whole).
    pub fn require_levels(&mut self, gpu: &Gpu, scene: &RenderScene) -> Result<(), BackendError> {
        if self.has_levels {
            return Ok(());
        }
        let texels = texels(scene, true);
        let bytes = texels.as_flattened();
        let mut sizes = self.sizes;
        sizes[TEXELS] = bytes.len() as u64;
        let split = split_of(gpu, sizes)?;
        // Level 0 is released first: memory may not hold both.
        self.buffers.truncate((self.split.count() - self.split.bindings[TEXELS]) as usize);
        let parts = split.parts(TEXELS, bytes).map(|part| super::buffers::upload(gpu, ARRAYS[TEXELS], part));
        self.buffers.extend(parts.collect::<Result<Vec<_>, _>>()?);
        (self.split, self.sizes, self.has_levels) = (split, sizes, true);
        self.bytes = self.buffers.iter().map(wgpu::Buffer::size).sum();
        Ok(())
    }

    /// Writes the parameters that describe the buffers into those of a launch.
    pub fn fill(&self, params: &mut Params) {
        let Params { root, whole, scene_low, scene_high, materials_at, .. } = self.params;
        let Params { normals_at, texcoords_at, colors_at, tangents_at, has_normals, .. } = self.params;
        *params = Params { root, whole, scene_low, scene_high, materials_at, ..*params };
        *params = Params { normals_at, texcoords_at, colors_at, tangents_at, has_normals, ..*params };
        let Params { sphere_root, spheres_at, first_sphere, .. } = self.params;
        *params = Params { sphere_root, spheres_at, first_sphere, ..*params };
    }

    /// The entries of bind group 1.
    pub fn entries(&self) -> Vec<wgpu::BindGroupEntry<'_>> {
        let entry = |(binding, buffer): (u32, _)| wgpu::BindGroupEntry {
            binding,
            resource: wgpu::Buffer::as_entire_binding(buffer),
        };
        (0..).zip(&self.buffers).map(entry).collect()
    }
}
