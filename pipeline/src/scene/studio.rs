//! 3DS files of Autodesk's 3D Studio for DOS: nested chunks, little endian.
//!
//! ```text
//! chunk     := u16 id, u32 length (of all of it, with these six bytes), contents
//! 4D4D file := chunks: 3D3D scene := chunks: AFFF material, 4000 object; B000 key-framer := chunks: B002 node
//! AFFF      := chunks: A000 name (to a NUL), A020 diffuse, A010 ambient, A030 specular, A050 transparency, A081 two-sided, A200 texture
//! colour    := chunk 0010 f32[3] | 0011 u8[3]        share := chunk 0030 u16, percent | 0031 f32
//! A200      := chunks: A300 file name (to a NUL), A356 f32 scale of u, A354 of v, A358 f32 offset of u, A35A of v
//! 4000      := name (to a NUL), chunks: 4100 mesh := chunks:
//!              4110 u16 n, f32[3n] positions, 4140 u16 n, f32[2n] texture coordinates, v upwards,
//!              4120 u16 n, (u16 corners[3], u16 flags)[n], chunks: 4130 := material name (to a NUL), u16 n, u16 faces[n],
//!              4160 f32[12] matrix: three axes and the origin
//! B002      := chunks: B030 u16 id, B010 mesh's name (to a NUL), u16[2] flags, u16 parent's id, B013 f32[3] pivot,
//!              B020 track of positions f32[3], B021 of rotations f32 angle, f32[3] axis, B022 of scales f32[3]
//! track     := u16 flags, u32[2], u32 n, (u32 frame, u16 which, f32 for each of its bits, value)[n]
//! ```
//!
//! Positions are in scene coordinates; a mesh that a single node names is drawn at these positions. Several nodes that name the same
//! mesh are its instances. Each instance is placed as its node is in the first frame, by the matrix
//! `parent * translation * rotation * scale * -pivot * inverse matrix`. Positive angles are clockwise rotations about their axis. The
//! file contains no normals.

use super::bytes::{Reader, f32_at};
use super::context::{Context, MaterialTable, add_texture, texture_file_or_suffix};
use super::error::SceneError;
use super::{Group, Material, Mesh, Object, Scene, TextureSource};
use crate::diagnostic::Warnings;
use glam::{Mat4, Quat, Vec2, Vec3};
use std::collections::HashMap;

const FILE: u16 = 0x4D4D;
const SCENE: u16 = 0x3D3D;
const MATERIAL: u16 = 0xAFFF;
const OBJECT: u16 = 0x4000;
const MESH: u16 = 0x4100;
const KEY_FRAMER: u16 = 0xB000;
const NODE: u16 = 0xB002;
/// Size of a chunk's header, bytes.
const HEAD: usize = 6;
/// Longest name, bytes.
const LONGEST_NAME: usize = 4096;
/// Name of the material of faces that name none.
const PLAIN: &str = "default";

/// Scale and offset of texture coordinates.
#[derive(Clone, Copy, PartialEq)]
struct Mapping {
    scale: Vec2,
    offset: Vec2,
}

const PLAIN_MAPPING: Mapping = Mapping { scale: Vec2::ONE, offset: Vec2::ZERO };

/// A node of the key-framer.
struct Node {
    /// Name of the node's mesh. Nodes with names of no mesh only place their children.
    mesh: String,
    pivot: Vec3,
    /// From the node to the world, in the first frame.
    transform: Mat4,
}

struct Loader<'a, 'b> {
    context: &'a mut Context<'b>,
    scene: Scene,
    table: MaterialTable,
    /// Transforms of texture coordinates, by name of the material; materials without one are missing.
    mappings: HashMap<String, Mapping>,
    /// Matrices of the meshes, in their order.
    matrices: Vec<Mat4>,
    nodes: Vec<Node>,
    /// Transforms of nodes to the world, by a node's id. A parent comes before its children.
    frames: HashMap<u16, Mat4>,
    warnings: Warnings,
}

pub(crate) fn read(bytes: &[u8], context: &mut Context<'_>) -> Result<Scene, SceneError> {
    let id = Reader::new(context.file, bytes).u16("a chunk's id")?;
    if id != FILE {
        return Err(SceneError::file(context.file, format!("this is no 3DS file: it starts with chunk {id:04X}"))
            .help("valid: 4D4D"));
    }
    let (_, mut contents) = chunk(&mut Reader::new(context.file, bytes))?;
    let mut loader = Loader {
        context,
        scene: Scene::default(),
        table: MaterialTable::default(),
        mappings: HashMap::new(),
        matrices: Vec::new(),
        nodes: Vec::new(),
        frames: HashMap::new(),
        warnings: Warnings::default(),
    };
    let mut objects = Vec::new();
    while contents.left() >= HEAD {
        let (outer, mut parts) = chunk(&mut contents)?;
        while matches!(outer, SCENE | KEY_FRAMER) && parts.left() >= HEAD {
            match (outer, chunk(&mut parts)?) {
                (SCENE, (MATERIAL, part)) => loader.material(part)?,
                (SCENE, (OBJECT, part)) => objects.push(part),
                (KEY_FRAMER, (NODE, part)) => loader.node(part)?,
                _ => {}
            }
        }
    }
    // Materials may follow the objects that name them.
    objects.into_iter().try_for_each(|object| loader.object(object))?;
    loader.place()?;
    let Loader { mut scene, table, warnings, .. } = loader;
    (scene.materials, scene.warnings) = (table.materials, warnings);
    Ok(scene)
}

/// Reads the next chunk: its id and its contents.
fn chunk<'a>(reader: &mut Reader<'a>) -> Result<(u16, Reader<'a>), SceneError> {
    let id = reader.u16("a chunk's id")?;
    let length = reader.count("a chunk's length")?;
    let contents = length.checked_sub(HEAD);
    let contents = contents.ok_or_else(|| reader.error(format!("chunk {id:04X} has a length of {length} bytes")))?;
    Ok((id, reader.part(contents, "a chunk")?))
}

/// Reads Latin-1 text up to a NUL.
fn name(reader: &mut Reader<'_>) -> Result<String, SceneError> {
    let mut name = String::new();
    loop {
        match reader.block(1, 1, "a name")? {
            [0] => return Ok(name),
            [byte, ..] if name.len() < LONGEST_NAME => name.push(char::from(*byte)),
            _ => return Err(reader.error(format!("a name is longer than {LONGEST_NAME} bytes"))),
        }
    }
}

/// Reads the first colour in a chunk. Linear colours (version 3) follow the display colours.
fn color(mut reader: Reader<'_>) -> Result<Option<Vec3>, SceneError> {
    while reader.left() >= HEAD {
        match chunk(&mut reader)? {
            (0x0010 | 0x0013, mut part) => return Ok(Some(Vec3::from(part.floats::<3>("a colour")?))),
            (0x0011 | 0x0012, mut part) => {
                let bytes = part.block(3, 1, "a colour")?;
                return Ok(Some(Vec3::new(bytes[0].into(), bytes[1].into(), bytes[2].into()) / 255.0));
            }
            _ => {}
        }
    }
    Ok(None)
}

/// Reads the first percentage in a chunk, as 0 to 1.
fn share(mut reader: Reader<'_>) -> Result<Option<f32>, SceneError> {
    while reader.left() >= HEAD {
        match chunk(&mut reader)? {
            (0x0030, mut part) => return Ok(Some(f32::from(part.u16("a percentage")?) / 100.0)),
            (0x0031, mut part) => return Ok(Some(part.floats::<1>("a share")?[0])),
            _ => {}
        }
    }
    Ok(None)
}

/// Reads the value of a track's first key; `None` if the track has no key.
fn first_key<const N: usize>(mut reader: Reader<'_>) -> Result<Option<[f32; N]>, SceneError> {
    reader.block(10, 1, "the head of a track")?;
    if reader.count("the number of keys")? == 0 {
        return Ok(None);
    }
    reader.block(4, 1, "a key's frame")?;
    let given = reader.u16("what a key gives")?;
    reader.block(given.count_ones() as usize, 4, "a key's numbers")?;
    Ok(Some(reader.floats("a key's value")?))
}

impl Loader<'_, '_> {
    fn node(&mut self, mut reader: Reader<'_>) -> Result<(), SceneError> {
        /// Parent of a node without a parent.
        const NONE: u16 = u16::MAX;
        let mut node = Node { mesh: String::new(), pivot: Vec3::ZERO, transform: Mat4::IDENTITY };
        let (mut id, mut parent) = (u16::try_from(self.nodes.len()).unwrap_or(NONE), NONE);
        let (mut position, mut rotation, mut scale) = ([0.0; 3], [0.0; 4], [1.0; 3]);
        while reader.left() >= HEAD {
            match chunk(&mut reader)? {
                (0xB030, mut part) => id = part.u16("a node's id")?,
                (0xB010, mut part) => {
                    node.mesh = name(&mut part)?;
                    part.block(4, 1, "a node's flags")?;
                    parent = part.u16("a node's parent")?;
                }
                (0xB013, mut part) => node.pivot = Vec3::from(part.floats::<3>("a pivot")?),
                (0xB020, part) => position = first_key(part)?.unwrap_or(position),
                (0xB021, part) => rotation = first_key(part)?.unwrap_or(rotation),
                (0xB022, part) => scale = first_key(part)?.unwrap_or(scale),
                _ => {}
            }
        }
        let [angle, axis @ ..] = rotation;
        let turn = Vec3::from(axis).try_normalize().map_or(Quat::IDENTITY, |axis| Quat::from_axis_angle(axis, -angle));
        let to_parent = Mat4::from_scale_rotation_translation(scale.into(), turn, position.into());
        node.transform = self.frames.get(&parent).map_or(to_parent, |frame| *frame * to_parent);
        self.frames.insert(id, node.transform);
        self.context.take("the nodes", 1, size_of::<Node>() + node.mesh.len())?;
        self.nodes.push(node);
        Ok(())
    }

    /// Places the meshes that several nodes name.
    fn place(&mut self) -> Result<(), SceneError> {
        let mut by_mesh: HashMap<&str, Vec<&Node>> = HashMap::new();
        for node in &self.nodes {
            by_mesh.entry(&node.mesh).or_default().push(node);
        }
        let mut instances = Vec::new();
        for (object, matrix) in self.scene.objects.iter_mut().zip(&self.matrices) {
            let Some(nodes) = by_mesh.remove(object.name.as_str()) else { continue };
            let to_axes = matrix.inverse();
            let place = |node: &&Node| node.transform * Mat4::from_translation(-node.pivot) * to_axes;
            let places: Vec<Mat4> = nodes.iter().map(place).collect();
            let what = if !places.iter().all(|place| place.is_finite()) {
                "nodes whose place is no number"
            } else if let [only] = places[..] {
                if only.abs_diff_eq(Mat4::IDENTITY, 1e-3) {
                    continue;
                }
                "nodes that move the only instance of a mesh"
            } else {
                object.transform = places[0];
                for place in &places[1..] {
                    self.context.take("the objects", 1, size_of::<Object>() + 2 * object.name.len())?;
                    instances.push(Object { transform: *place, ..object.clone() });
                }
                continue;
            };
            let name = &object.name;
            self.warnings.add(self.context.file, what, "drawn where the positions are", || format!("`{name}`"));
        }
        self.scene.objects.append(&mut instances);
        Ok(())
    }

    fn material(&mut self, mut reader: Reader<'_>) -> Result<(), SceneError> {
        let mut material = Material { name: PLAIN.to_owned(), ..Material::default() };
        let (mut texture, mut mapping) = (None, PLAIN_MAPPING);
        while reader.left() >= HEAD {
            match chunk(&mut reader)? {
                (0xA000, mut part) => material.name = name(&mut part)?,
                (0xA010, part) => material.ambient = color(part)?.map_or(material.ambient, |c| c.extend(1.0)),
                (0xA020, part) => {
                    material.diffuse = color(part)?.map_or(material.diffuse, |c| c.extend(material.diffuse.w));
                }
                (0xA030, part) => material.specular = color(part)?.map_or(material.specular, |c| c.extend(1.0)),
                (0xA050, part) => {
                    let clear = share(part)?.filter(|share| share.is_finite()).unwrap_or(0.0).clamp(0.0, 1.0);
                    material.diffuse.w = 1.0 - clear;
                    // As in MTL, the rest of the light is scattered back.
                    (material.transmission, material.veil) = (clear, 1.0 - clear);
                }
                (0xA200, part) => texture = self.texture(part, &mut mapping)?,
                _ => {}
            }
        }
        if let Some(file) = texture.filter(|_| self.context.needs.textures) {
            let found = texture_file_or_suffix(self.context, &file, &mut self.warnings, &material.name);
            material.texture = found.map(|path| add_texture(&mut self.scene.textures, TextureSource::File(path)));
        }
        let name = material.name.clone();
        if !self.table.declare(material) {
            let what = "materials declared twice";
            self.warnings.add(self.context.file, what, "the first declaration serves", || format!("`{name}`"));
        } else if mapping != PLAIN_MAPPING {
            self.mappings.insert(name, mapping);
        }
        Ok(())
    }

    /// Reads the file name and the mapping of a texture.
    fn texture(&mut self, mut reader: Reader<'_>, mapping: &mut Mapping) -> Result<Option<String>, SceneError> {
        let mut file = None;
        while reader.left() >= HEAD {
            let (id, mut part) = chunk(&mut reader)?;
            let target = match id {
                0xA300 => {
                    file = Some(name(&mut part)?);
                    continue;
                }
                0xA356 => &mut mapping.scale.x,
                0xA354 => &mut mapping.scale.y,
                0xA358 => &mut mapping.offset.x,
                0xA35A => &mut mapping.offset.y,
                _ => continue,
            };
            let [value] = part.floats::<1>("a number of a texture's place")?;
            if value.is_finite() {
                *target = value;
            }
        }
        Ok(file)
    }

    fn object(&mut self, mut reader: Reader<'_>) -> Result<(), SceneError> {
        let name = name(&mut reader)?;
        while reader.left() >= HEAD {
            let (id, part) = chunk(&mut reader)?;
            if id == MESH {
                self.mesh(&name, part)?;
            }
        }
        Ok(())
    }

    fn mesh(&mut self, name: &str, mut reader: Reader<'_>) -> Result<(), SceneError> {
        let mut mesh = Mesh { name: name.to_owned(), ..Mesh::default() };
        let mut faces: Vec<[u32; 3]> = Vec::new();
        // By face: material index plus one, or 0 without a material.
        let mut materials: Vec<u32> = Vec::new();
        let mut matrix = Mat4::IDENTITY;
        while reader.left() >= HEAD {
            let (id, mut part) = chunk(&mut reader)?;
            match id {
                0x4160 => {
                    let [x, y, z, origin] = [
                        part.floats("an axis")?,
                        part.floats("an axis")?,
                        part.floats("an axis")?,
                        part.floats("an origin")?,
                    ]
                    .map(Vec3::from);
                    matrix = Mat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), origin.extend(1.0));
                }
                0x4110 => {
                    let count = usize::from(part.u16("the number of positions")?);
                    let block = part.block(count, 12, "the positions")?;
                    self.context.take("the positions", count, 12)?;
                    mesh.positions =
                        (0..count).map(|i| Vec3::from([0, 1, 2].map(|axis| f32_at(block, 3 * i + axis)))).collect();
                }
                0x4140 if self.context.needs.textures => {
                    let count = usize::from(part.u16("the number of texture coordinates")?);
                    let block = part.block(count, 8, "the texture coordinates")?;
                    self.context.take("the texture coordinates", count, 8)?;
                    mesh.texcoords =
                        (0..count).map(|i| Vec2::new(f32_at(block, 2 * i), f32_at(block, 2 * i + 1))).collect();
                }
                0x4120 => {
                    let count = usize::from(part.u16("the number of faces")?);
                    let block = part.block(count, 8, "the faces")?;
                    self.context.take("the faces", count, 16)?;
                    let corner = |at: usize| u32::from(u16::from_le_bytes([block[at], block[at + 1]]));
                    faces = (0..count).map(|i| [0, 2, 4].map(|offset| corner(8 * i + offset))).collect();
                    materials = vec![0; count];
                    self.face_materials(part, &mut materials)?;
                }
                _ => {}
            }
        }
        if mesh.texcoords.len() != mesh.positions.len() {
            if !mesh.texcoords.is_empty() {
                let what = "meshes with another number of texture coordinates than positions";
                self.warnings.add(self.context.file, what, "drawn without", || format!("`{name}`"));
            }
            mesh.texcoords.clear();
        }
        self.groups(&mut mesh, &faces, &materials);
        let number = self.scene.meshes.len() as u32;
        self.context.take("the objects", 1, size_of::<Mesh>() + size_of::<Object>() + 2 * name.len())?;
        self.scene.meshes.push(mesh);
        self.matrices.push(matrix);
        self.scene.objects.push(Object { name: name.to_owned(), mesh: number, transform: Mat4::IDENTITY });
        Ok(())
    }

    /// Reads the lists of faces by material, which follow the faces.
    fn face_materials(&mut self, mut reader: Reader<'_>, materials: &mut [u32]) -> Result<(), SceneError> {
        while reader.left() >= HEAD {
            let (id, mut part) = chunk(&mut reader)?;
            if id != 0x4130 {
                continue;
            }
            let named = name(&mut part)?;
            let material = self.table.get_or_default(&named, self.context.file, &mut self.warnings);
            let count = usize::from(part.u16("the number of faces of a material")?);
            let block = part.block(count, 2, "the faces of a material")?;
            for face in block.chunks_exact(2).map(|face| usize::from(u16::from_le_bytes([face[0], face[1]]))) {
                match materials.get_mut(face) {
                    Some(known) => *known = material + 1,
                    None => {
                        self.warnings.add(self.context.file, "faces of materials that do not exist", "ignored", || {
                            format!("face {face} of `{named}`")
                        })
                    }
                }
            }
        }
        Ok(())
    }

    /// Groups faces by material, and transforms the texture coordinates of faces whose texture has a mapping.
    fn groups(&mut self, mesh: &mut Mesh, faces: &[[u32; 3]], materials: &[u32]) {
        let mut by_material: HashMap<u32, usize> = HashMap::new();
        for (face, material) in faces.iter().zip(materials) {
            let index = *by_material.entry(*material).or_insert_with(|| {
                let material = match material.checked_sub(1) {
                    Some(material) => material,
                    None => {
                        let plain = Material { name: PLAIN.to_owned(), ..Material::default() };
                        self.table.declare(plain);
                        self.table.get(PLAIN).unwrap_or(0)
                    }
                };
                mesh.groups.push(Group { material, triangles: Vec::new() });
                mesh.groups.len() - 1
            });
            mesh.groups[index].triangles.push(*face);
        }
        let mut moved = vec![false; mesh.texcoords.len()];
        for group in &mesh.groups {
            let Some(mapping) = self.mappings.get(&self.table.materials[group.material as usize].name) else {
                continue;
            };
            for corner in group.triangles.iter().flatten() {
                let (Some(texcoord), Some(moved)) =
                    (mesh.texcoords.get_mut(*corner as usize), moved.get_mut(*corner as usize))
                else {
                    continue;
                };
                if !std::mem::replace(moved, true) {
                    *texcoord = *texcoord * mapping.scale + mapping.offset;
                }
            }
        }
    }
}
