//! glTF 2.0 assets, as JSON or GLB. The crate `gltf` parses the JSON. Every index and range is checked here, because the crate's
//! own readers panic on invalid ones.
//!
//! A primitive becomes a mesh. A node with a mesh becomes one object for each of the mesh's primitives.

mod accessor;
mod container;
mod draco;
mod material;
mod meshopt;
mod places;
mod pose;
mod vectors;
mod view;

use super::context::Context;
use super::error::SceneError;
use super::{Group, Mesh, Object, Scene};
use crate::diagnostic::Warnings;
use ::gltf::json::{
    self, Index,
    accessor::Accessor,
    mesh::{Mode, Primitive, Semantic},
    validation::Checked,
};
use accessor::Data;
use glam::{DMat4, Mat4, Quat, Vec2, Vec3, Vec4};
use material::{Materials, Surface};
use places::Places;
use pose::{Pose, Skins};
use std::collections::{HashMap, HashSet};
use std::path::Path;
use vectors::Vectors;

/// Extensions that are read, or that can be ignored without a visible difference.
const READ_EXTENSIONS: [&str; 13] = [
    meshopt::EXTENSION,
    "EXT_texture_webp",
    draco::EXTENSION,
    "KHR_lights_punctual",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_materials_variants",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "MSFT_texture_dds",
];

pub(crate) fn read(bytes: &[u8], context: &mut Context<'_>) -> Result<Scene, SceneError> {
    let mut scene = Scene::default();
    // Gives the file's name and its bytes the same lifetime.
    let mut context = Context { file: context.file, needs: context.needs, budget: &mut *context.budget };
    let (text, binary) = container::split(bytes, &context)?;
    let root = container::parse(text, &mut context)?;
    check_extensions(&root, context.file, &mut scene.warnings)?;
    count_unread(&root, context.file, &mut scene.warnings);
    let buffers = container::buffers(&root, binary, &mut context)?;
    let decoded = meshopt::views(&root, &buffers, &mut context)?;
    let data = Data { root: &root, buffers: &buffers, decoded: &decoded };
    let mut materials = Materials::read(&data, &mut context, &mut scene.warnings)?;
    let places = Places::new(&root, text, &mut context)?;
    let (skins, placed) = (Skins::default(), HashMap::new());
    let mut assembler = Assembler { data: &data, materials: &mut materials, scene: &mut scene, skins, places, placed };
    assembler.nodes(&mut context)?;
    assembler.places.move_origin(assembler.scene);
    scene.materials = materials.table.materials;
    scene.textures = materials.textures;
    Ok(scene)
}

/// Refuses assets that require an extension which is not read. Extensions that only change the shading (`KHR_materials_` and a name) are a
/// warning instead, except `KHR_materials_pbrSpecularGlossiness`.
fn check_extensions(root: &json::Root, file: &Path, warnings: &mut Warnings) -> Result<(), SceneError> {
    for name in &root.extensions_required {
        if READ_EXTENSIONS.contains(&name.as_str()) {
            continue;
        }
        let only_shading = name.starts_with("KHR_materials_") && name != "KHR_materials_pbrSpecularGlossiness";
        if !only_shading {
            let remedy = match name.as_str() {
                "KHR_texture_basisu" => "export the asset with PNG, JPEG or WebP textures",
                _ => "export the asset without it",
            };
            return Err(SceneError::file(file, format!("the asset requires the extension {name}, which is not read"))
                .help(format!("{remedy}; valid: {}", READ_EXTENSIONS.join(", "))));
        }
        warnings.add(file, "required extensions that are not read", "the asset is drawn without them", || name.clone());
    }
    Ok(())
}

/// Counts warnings for contents of an asset that are not drawn.
fn count_unread(root: &json::Root, file: &Path, warnings: &mut Warnings) {
    let required: HashSet<&str> = root.extensions_required.iter().map(String::as_str).collect();
    for name in &root.extensions_used {
        // Required extensions were counted already, or refused.
        if !READ_EXTENSIONS.contains(&name.as_str()) && !required.contains(name.as_str()) {
            warnings.add(file, "extensions that are not read", "the asset is drawn without them", || name.clone());
        }
    }
    for index in 0..root.animations.len() {
        warnings.add(file, "animations", "what they move is drawn in its rest pose", || format!("animation {index}"));
    }
}

struct Assembler<'a> {
    data: &'a Data<'a>,
    materials: &'a mut Materials,
    scene: &'a mut Scene,
    skins: Skins,
    /// The transforms of objects, cameras and lights, with all digits of the file.
    places: Places,
    /// By mesh of the asset and pose, once read: index of its first primitive in the scene, and for each primitive whether skinning
    /// moved it into world space.
    placed: HashMap<(usize, Pose), (u32, Vec<bool>)>,
}

impl Assembler<'_> {
    /// Walks the nodes of the default scene, depth first, in order. If the asset names no default scene, walks its first scene;
    /// without scenes, all root nodes.
    fn nodes(&mut self, context: &mut Context<'_>) -> Result<(), SceneError> {
        let root = self.data.root;
        let fail = |what: String| SceneError::file(context.file, what);
        let chosen = root.scene.map_or(0, |scene| scene.value());
        let roots: Vec<usize> = match root.scenes.get(chosen) {
            Some(scene) => scene.nodes.iter().map(|node| node.value()).collect(),
            None if root.scene.is_some() => return Err(fail(format!("scene {chosen} does not exist"))),
            None => root_nodes(root),
        };
        let mut visited = vec![false; root.nodes.len()];
        let whole = (Mat4::IDENTITY, DMat4::IDENTITY);
        let mut stack: Vec<(usize, (Mat4, DMat4))> = roots.iter().rev().map(|node| (*node, whole)).collect();
        while let Some((index, (parent, exact_parent))) = stack.pop() {
            let node = root.nodes.get(index).ok_or_else(|| fail(format!("node {index} does not exist")))?;
            if std::mem::replace(&mut visited[index], true) {
                return Err(fail(format!("node {index} has two parents or is its own ancestor"))
                    .help("valid: nodes form trees"));
            }
            let transform = parent * local_transform(node);
            let exact = exact_parent * self.places.local(index, node);
            if let Some(mesh) = node.mesh {
                let name = node.name.clone().unwrap_or_else(|| format!("node {index}"));
                self.place(mesh.value(), node, name, (transform, exact), context)?;
            }
            let Scene { cameras, lights, warnings, .. } = &mut *self.scene;
            let camera = view::camera(root, node, &transform, context.file, warnings);
            self.places.cameras.extend(camera.as_ref().map(|_| exact.w_axis.truncate()));
            cameras.extend(camera);
            let light = view::light(root, node, &transform, context.file, warnings);
            self.places.lights.extend(light.as_ref().map(|_| exact.w_axis.truncate()));
            lights.extend(light);
            let children = node.children.iter().flatten().rev();
            stack.extend(children.map(|child| (child.value(), (transform, exact))));
        }
        Ok(())
    }

    /// Places a mesh of the asset. The mesh is read the first time it is placed.
    fn place(
        &mut self,
        index: usize,
        node: &json::Node,
        name: String,
        (transform, exact): (Mat4, DMat4),
        context: &mut Context<'_>,
    ) -> Result<(), SceneError> {
        let file = context.file;
        let Some(mesh) = self.data.root.meshes.get(index) else {
            return Err(SceneError::file(file, format!("mesh {index} does not exist")));
        };
        let key = (index, Pose::of(node, mesh));
        if !self.placed.contains_key(&key) {
            let read = self.mesh(index, mesh, &key.1, context)?;
            self.placed.insert(key.clone(), read);
        }
        let (first, moved) = &self.placed[&key];
        // Every node may place every primitive: that can be far more objects than the file has bytes.
        context.take("the objects", moved.len(), size_of::<Object>() + size_of::<DMat4>() + name.len())?;
        for (mesh, moved) in (*first..).zip(moved) {
            let (transform, exact) = if *moved { (Mat4::IDENTITY, DMat4::IDENTITY) } else { (transform, exact) };
            self.scene.objects.push(Object { name: name.clone(), mesh, transform });
            self.places.objects.push(exact);
        }
        Ok(())
    }

    /// Reads a mesh. Returns the index of its first primitive in the scene, and for each primitive whether it was moved into world
    /// space.
    fn mesh(
        &mut self,
        index: usize,
        mesh: &json::Mesh,
        pose: &Pose,
        context: &mut Context<'_>,
    ) -> Result<(u32, Vec<bool>), SceneError> {
        let first = self.scene.meshes.len() as u32;
        let mut moved = Vec::new();
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            let name = mesh.name.clone().unwrap_or_else(|| format!("mesh {index}"));
            let name = if mesh.primitives.len() > 1 { format!("{name}[{number}]") } else { name };
            if let Some((mesh, by_skin)) = self.primitive(primitive, name, pose, context)? {
                self.scene.meshes.push(mesh);
                moved.push(by_skin);
            }
        }
        Ok((first, moved))
    }

    fn primitive(
        &mut self,
        primitive: &Primitive,
        name: String,
        pose: &Pose,
        context: &mut Context<'_>,
    ) -> Result<Option<(Mesh, bool)>, SceneError> {
        let file = context.file;
        let mode = match primitive.mode {
            Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
            _ => {
                self.scene.warnings.add(file, "primitives that are not triangles", "left out", || format!("`{name}`"));
                return Ok(None);
            }
        };
        let attribute = |semantic: Semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let Some(positions) = attribute(Semantic::Positions) else {
            self.scene.warnings.add(file, "primitives without positions", "left out", || format!("`{name}`"));
            return Ok(None);
        };
        let surface = self.materials.of(primitive.material, file)?;
        let (material, coordinates) = (surface.material, surface.coordinates);
        let packed = draco::decode(primitive, self.data, context)?;
        let vectors = Vectors { data: self.data, packed: packed.as_ref() };
        let positions = vectors.read::<3>(positions, "POSITION", context)?.into_iter().map(Vec3::from).collect();
        let mut mesh = Mesh { name, positions, ..Mesh::default() };
        if let Some(normals) = attribute(Semantic::Normals).filter(|_| context.needs.normals) {
            mesh.normals = vectors.read::<3>(normals, "NORMAL", context)?.into_iter().map(Vec3::from).collect();
        }
        let texcoords = attribute(Semantic::TexCoords(coordinates.set));
        if let Some(texcoords) =
            texcoords.filter(|_| context.needs.textures || (surface.mapped && context.needs.normals))
        {
            let semantic = format!("TEXCOORD_{}", coordinates.set);
            let texcoords = vectors.read::<2>(texcoords, &semantic, context)?.into_iter();
            mesh.texcoords = texcoords.map(|texcoord| coordinates.apply(Vec2::from(texcoord))).collect();
        }
        if let Some(colors) = attribute(Semantic::Colors(0)).filter(|_| context.needs.colors) {
            mesh.colors = self.colors(surface, &vectors, colors, context)?;
        }
        // Tangents without normals mean nothing (glTF 2.0, section 3.7.2.1).
        if let Some(tangents) = attribute(Semantic::Tangents).filter(|_| surface.mapped && !mesh.normals.is_empty()) {
            mesh.tangents = vectors.read::<4>(tangents, "TANGENT", context)?.into_iter().map(Vec4::from).collect();
        }
        let vertices = mesh.positions.len();
        let counts = [
            ("normals", mesh.normals.len()),
            ("texture coordinates", mesh.texcoords.len()),
            ("colours", mesh.colors.len()),
            ("tangents", mesh.tangents.len()),
        ];
        for (what, count) in counts {
            if count != 0 && count != vertices {
                return Err(SceneError::file(
                    file,
                    format!("`{}` has {vertices} positions but {count} {what}", mesh.name),
                ));
            }
        }
        let triangles = match &packed {
            Some(packed) => packed.triangles(context)?,
            None => self.triangles(primitive, mode, &mesh, context)?,
        };
        mesh.groups.push(Group { material, triangles });
        let warnings = &mut self.scene.warnings;
        pose.morph(&mut mesh, primitive, &vectors, context, warnings)?;
        let Some(skin) = pose.skin else { return Ok(Some((mesh, false))) };
        self.skins.meet(skin, &vectors, context)?;
        let moved = self.skins.apply(skin, &mut mesh, primitive, &vectors, context, warnings)?;
        Ok(Some((mesh, moved)))
    }

    /// The triangles of an uncompressed primitive.
    fn triangles(
        &mut self,
        primitive: &Primitive,
        mode: Mode,
        mesh: &Mesh,
        context: &mut Context<'_>,
    ) -> Result<Vec<[u32; 3]>, SceneError> {
        let vertices = mesh.positions.len();
        let indices = match primitive.indices {
            Some(indices) => self.data.indices(indices, context)?,
            None => {
                context.take("the indices", vertices, 4)?;
                (0..vertices as u32).collect()
            }
        };
        context.take("the triangles", indices.len(), if mode == Mode::Triangles { 4 } else { 12 })?;
        if mode == Mode::Triangles && indices.len() % 3 != 0 {
            self.scene.warnings.add(
                context.file,
                "index counts that are no multiple of 3",
                "the incomplete triangle is left out",
                || format!("{} in `{}`", indices.len(), mesh.name),
            );
        }
        Ok(assemble(mode, &indices))
    }
}

impl Assembler<'_> {
    /// Reads `COLOR_0` of a primitive: linear, with or without alpha (glTF 2.0, section 3.7.2.1).
    fn colors(
        &mut self,
        surface: Surface,
        vectors: &Vectors<'_>,
        accessor: Index<Accessor>,
        context: &mut Context<'_>,
    ) -> Result<Vec<Vec4>, SceneError> {
        const SEMANTIC: &str = "COLOR_0";
        if self.data.components(accessor) == 3 {
            let colors = vectors.read::<3>(accessor, SEMANTIC, context)?;
            context.take("the vertex colours", colors.len(), size_of::<Vec4>())?;
            return Ok(self.materials.colored(surface, colors.into_iter().map(|color| Vec3::from(color).extend(1.0))));
        }
        let colors = vectors.read::<4>(accessor, SEMANTIC, context)?;
        if surface.is_soft() && colors.iter().any(|color| color[3] < 1.0) {
            let what = "vertex colours with alpha of what is blended texel by texel";
            let name = &self.materials.table.materials[surface.material as usize].name;
            self.scene.warnings.add(context.file, what, "their alpha is ignored", || format!("`{name}`"));
        }
        Ok(self.materials.colored(surface, colors.into_iter().map(Vec4::from)))
    }
}

/// Triangles of a list, strip or fan (glTF 2.0, section 3.7.2.1).
fn assemble(mode: Mode, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => indices
            .windows(3)
            .enumerate()
            // In a strip every second triangle has the opposite winding.
            .map(|(number, i)| if number % 2 == 0 { [i[0], i[1], i[2]] } else { [i[0], i[2], i[1]] })
            .collect(),
        Mode::TriangleFan => {
            indices.get(1..).unwrap_or_default().windows(2).map(|i| [i[0], i[1], indices[0]]).collect()
        }
        _ => indices.chunks_exact(3).map(|i| [i[0], i[1], i[2]]).collect(),
    }
}

fn local_transform(node: &json::Node) -> Mat4 {
    if let Some(matrix) = node.matrix {
        return Mat4::from_cols_array(&matrix);
    }
    let scale = node.scale.map_or(Vec3::ONE, Vec3::from);
    let translation = node.translation.map_or(Vec3::ZERO, Vec3::from);
    Mat4::from_scale_rotation_translation(scale, rotation(node), translation)
}

/// The unit quaternion of a node's rotation: files round quaternions, and one of length 0 means no rotation.
fn rotation(node: &json::Node) -> Quat {
    let rotation = node.rotation.and_then(|rotation| Vec4::from(rotation.0).try_normalize());
    rotation.map_or(Quat::IDENTITY, Quat::from_vec4)
}

/// The nodes that are no child of another node.
fn root_nodes(root: &json::Root) -> Vec<usize> {
    let mut is_child = vec![false; root.nodes.len()];
    for child in root.nodes.iter().flat_map(|node| node.children.iter().flatten()) {
        if let Some(is_child) = is_child.get_mut(child.value()) {
            *is_child = true;
        }
    }
    (0..root.nodes.len()).filter(|node| !is_child[*node]).collect()
}
