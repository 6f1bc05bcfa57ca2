//! The reader for both layouts.

use super::super::bytes::{Reader, f32_at};
use super::super::context::{Context, MASK_CUTOFF, MaterialTable, add_texture, texture_file_or_suffix};
use super::super::error::SceneError;
use super::super::render::texture;
use super::super::{Group, Material, Mesh, Object, Scene, TextureSource};
use super::{Layout, NO_TEXTURE, NULL_OBJECT, OCTREE_SCENE, alpha_test};
use glam::{Mat4, Vec2, Vec3, Vec4};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Deepest octree accepted: its smallest node would already be 2^-64 of the scene.
const MAX_OCTREE_DEPTH: u32 = 64;

/// An error, and the byte offset up to which the file could be read in the layout.
pub(super) struct Failure {
    pub(super) error: SceneError,
    pub(super) reached: u64,
}

pub(super) fn read(bytes: &[u8], layout: Layout, context: &mut Context<'_>) -> Result<Scene, Failure> {
    let file = context.file;
    let mut parser = Parser {
        reader: Reader::new(file, bytes),
        layout,
        context,
        scene: Scene::default(),
        table: MaterialTable::default(),
        by_renderable: HashMap::new(),
        cutoffs: HashMap::new(),
    };
    match parser.file() {
        Ok(()) => {
            let Parser { mut scene, table, .. } = parser;
            scene.materials = table.materials;
            Ok(scene)
        }
        Err(error) => Err(Failure { reached: parser.reader.position(), error }),
    }
}

struct Parser<'b, 'c, 'f> {
    reader: Reader<'b>,
    layout: Layout,
    context: &'c mut Context<'f>,
    scene: Scene,
    table: MaterialTable,
    by_renderable: HashMap<String, u32>,
    /// Alpha cutoff by texture file; only for today's layout. `None` for a texture without holes, or one that cannot be searched for them.
    cutoffs: HashMap<PathBuf, Option<f32>>,
}

impl Parser<'_, '_, '_> {
    fn file(&mut self) -> Result<(), SceneError> {
        for _ in 0..self.reader.u32("the material count")? {
            self.material()?;
        }
        let scene_type = self.reader.string("the scene type")?;
        if scene_type.is_empty() {
            // If a 2014 file is read in today's layout, the empty shader name of a material ends up here.
            return Err(self.reader.error("the scene type is empty"));
        }
        if scene_type == OCTREE_SCENE {
            let _bounds: [f32; 6] = self.reader.floats("the octree's bounds")?;
            self.reader.string("the octree's name")?;
            self.node(0)?;
        } else {
            for _ in 0..self.reader.u32("the object count")? {
                self.object()?;
            }
        }
        match self.reader.left() {
            0 => Ok(()),
            left => Err(self.reader.error(format!("the scene ends here, but {left} bytes follow"))),
        }
    }

    fn material(&mut self) -> Result<(), SceneError> {
        let name = self.reader.string("a material's name")?;
        let mut color = |what| self.reader.floats::<4>(what).map(Vec4::from_array);
        let (ambient, specular) = (color("an ambient colour")?, color("a specular colour")?);
        let (diffuse, emission) = (color("a diffuse colour")?, color("an emission colour")?);
        let [shininess] = self.reader.floats("a shininess")?;
        let mut textures: [String; 8] = Default::default();
        for texture in &mut textures {
            *texture = self.reader.string("a texture's path")?;
        }
        let alpha_cutoff = if self.layout.is_2014() { self.state()? } else { None };
        let mut material = Material { name, ambient, specular, diffuse, emission, shininess, ..Material::default() };
        let [unit0, ..] = &textures;
        if self.context.needs.textures && !unit0.is_empty() && unit0 != NO_TEXTURE {
            let path = texture_file_or_suffix(self.context, unit0, &mut self.scene.warnings, &material.name);
            if let Some(path) = path {
                material.alpha_cutoff = if self.layout.is_2014() { alpha_cutoff } else { self.cutoff_of(&path)? };
                material.texture = Some(add_texture(&mut self.scene.textures, TextureSource::File(path)));
            }
        }
        let name = material.name.clone();
        if !self.table.declare(material) {
            self.scene.warnings.add(
                self.context.file,
                "materials declared twice",
                "the first declaration serves",
                || name,
            );
        }
        Ok(())
    }

    /// The cutoff for today's layout, which has no alpha test: 0.5 for textures with texels of less than half opacity, otherwise `None`.
    fn cutoff_of(&mut self, texture: &Path) -> Result<Option<f32>, SceneError> {
        if let Some(known) = self.cutoffs.get(texture) {
            return Ok(*known);
        }
        let is_cut_out = texture::is_cut_out(texture, MASK_CUTOFF, self.context.budget)?;
        if is_cut_out.is_none() {
            let what = "textures that cannot be searched for holes";
            self.scene.warnings.add(self.context.file, what, "taken for whole", || texture.display().to_string());
        }
        let cutoff = is_cut_out.unwrap_or(false).then_some(MASK_CUTOFF);
        self.cutoffs.insert(texture.to_owned(), cutoff);
        Ok(cutoff)
    }

    /// Reads shaders and render state of a 2014 material. Only the alpha test is used: its cutoff is returned, or `None` if the test is disabled or
    /// does not keep the greater alphas.
    fn state(&mut self) -> Result<Option<f32>, SceneError> {
        for what in
            ["a program's name", "a vertex shader's name", "a geometry shader's name", "a fragment shader's name"]
        {
            self.reader.string(what)?;
        }
        if self.reader.u32("the shader value count")? != 0 {
            return Err(self
                .reader
                .error("a material has shader values, whose form is not known")
                .help("valid: 0 shader values"));
        }
        self.reader.string("a state's name")?;
        let mut values = |size| {
            let count = self.reader.count("a state's value count")?;
            self.reader.block(count, size, "a state's values")
        };
        let (bools, enums, _ints, floats) = (values(1)?, values(4)?, values(4)?, values(4)?);
        let (_vectors, _bool4s) = (values(16)?, values(4)?);
        let word = |list: &[u8], index: usize| list.as_chunks().0.get(index).copied();
        let enabled = bools.get(alpha_test::ENABLED).is_some_and(|enabled| *enabled != 0);
        let function = word(enums, alpha_test::FUNCTION).map(i32::from_le_bytes);
        let keeps_opaque = matches!(function, Some(alpha_test::GREATER | alpha_test::GREATER_OR_EQUAL));
        let cutoff = word(floats, alpha_test::VALUE).map(f32::from_le_bytes);
        Ok(cutoff.filter(|cutoff| enabled && keeps_opaque && cutoff.is_finite()))
    }

    fn transform(&mut self) -> Result<Mat4, SceneError> {
        if self.layout.is_2014() {
            self.reader.string("a transform's class")?;
        }
        self.reader.floats("a transform").map(|columns| Mat4::from_cols_array(&columns))
    }

    fn object(&mut self) -> Result<(), SceneError> {
        self.reader.string("an object's class")?;
        let name = self.reader.string("an object's name")?;
        self.reader.string("a bounding volume's class")?;
        let points = self.reader.count("a bounding volume's point count")?;
        self.reader.block(points, 12, "a bounding volume")?;
        let transform = self.transform()?;
        let renderable = self.reader.string("a renderable's name")?;
        if renderable == NULL_OBJECT {
            return Ok(());
        }
        let mesh = match self.by_renderable.get(&renderable) {
            Some(mesh) => *mesh,
            None => {
                self.reader.string("a renderable's class")?;
                let mut mesh = self.vertices(&renderable)?;
                for _ in 0..self.reader.u32("a material group count")? {
                    let group = self.group(&mesh)?;
                    mesh.groups.push(group);
                }
                let index = self.add_mesh(mesh);
                self.by_renderable.insert(renderable, index);
                index
            }
        };
        self.scene.objects.push(Object { name, mesh, transform });
        Ok(())
    }

    fn add_mesh(&mut self, mesh: Mesh) -> u32 {
        self.scene.meshes.push(mesh);
        self.scene.meshes.len() as u32 - 1
    }

    fn node(&mut self, depth: u32) -> Result<(), SceneError> {
        if depth > MAX_OCTREE_DEPTH {
            return Err(self.reader.error(format!("the octree is more than {MAX_OCTREE_DEPTH} levels deep")));
        }
        let _bounds: [f32; 12] = self.reader.floats("a node's bounds")?;
        for _ in 0..self.reader.u32("a node's object count")? {
            self.reader.string("a node's key")?;
            let name = self.reader.string("an object's name")?;
            let _bounds: [f32; 6] = self.reader.floats("an object's bounds")?;
            let transform = self.transform()?;
            let renderable = self.reader.string("a renderable's name")?;
            let mut mesh = self.vertices(&renderable)?;
            let group = self.group(&mesh)?;
            mesh.groups.push(group);
            let mesh = self.add_mesh(mesh);
            self.scene.objects.push(Object { name, mesh, transform });
        }
        let children = self.reader.u32("a node's child count")?;
        self.reader.block(2, 4, "a node's id and depth")?;
        for _ in 0..children {
            self.node(depth + 1)?;
        }
        Ok(())
    }

    fn vertices(&mut self, renderable: &str) -> Result<Mesh, SceneError> {
        let needs = self.context.needs;
        let mut mesh = Mesh { name: renderable.to_owned(), ..Mesh::default() };
        for _ in 0..self.reader.u32("an attribute count")? {
            let attribute = self.reader.string("an attribute's name")?;
            let count = self.reader.count("an attribute's value count")?;
            let block = self.reader.block(count, 16, "an attribute's values")?;
            let wanted = match attribute.as_str() {
                "position" => true,
                "normal" => needs.normals,
                "texCoord0" => needs.textures,
                _ => false,
            };
            if !wanted {
                continue;
            }
            self.context.take("the vertices", count, if attribute == "texCoord0" { 8 } else { 12 })?;
            let vectors = |index: usize| {
                let value = &block[16 * index..];
                Vec3::new(f32_at(value, 0), f32_at(value, 1), f32_at(value, 2))
            };
            match attribute.as_str() {
                "position" => mesh.positions = (0..count).map(vectors).collect(),
                "normal" => mesh.normals = (0..count).map(vectors).collect(),
                _ => mesh.texcoords = (0..count).map(|i| vectors(i).truncate()).collect::<Vec<Vec2>>(),
            }
        }
        self.reader.u32("a word after the vertices")?;
        let vertices = mesh.positions.len();
        let mut mismatch = |attribute: &str, count: usize| {
            self.scene.warnings.add(
                self.context.file,
                "attributes with another number of values than there are positions",
                "left out",
                || format!("{attribute} of `{renderable}` has {count} for {vertices} positions"),
            );
        };
        if !mesh.normals.is_empty() && mesh.normals.len() != vertices {
            mismatch("normal", mesh.normals.len());
            mesh.normals = Vec::new();
        }
        if !mesh.texcoords.is_empty() && mesh.texcoords.len() != vertices {
            mismatch("texCoord0", mesh.texcoords.len());
            mesh.texcoords = Vec::new();
        }
        Ok(mesh)
    }

    fn group(&mut self, mesh: &Mesh) -> Result<Group, SceneError> {
        let material = self.reader.string("a group's material")?;
        let material = self.table.get_or_default(&material, self.context.file, &mut self.scene.warnings);
        self.reader.u32("a word before the indices")?;
        let count = self.reader.count("an index count")?;
        let block = self.reader.block(count, 4, "the indices")?;
        let triangles: Vec<[u32; 3]> = if count == 0 {
            self.context.take("the triangles", mesh.positions.len() / 3, 12)?;
            (0..mesh.positions.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect()
        } else {
            self.context.take("the triangles", count / 3, 12)?;
            let index = |triangle: &[u8], i: usize| {
                u32::from_le_bytes([triangle[4 * i], triangle[4 * i + 1], triangle[4 * i + 2], triangle[4 * i + 3]])
            };
            block.chunks_exact(12).map(|triangle| std::array::from_fn(|i| index(triangle, i))).collect()
        };
        let indices = if count == 0 { mesh.positions.len() } else { count };
        if indices % 3 != 0 {
            self.scene.warnings.add(
                self.context.file,
                "index counts that are no multiple of 3",
                "the incomplete triangle is left out",
                || format!("{indices} in `{}`", mesh.name),
            );
        }
        Ok(Group { material, triangles })
    }
}
