//! A sequential reader, built on `tobj`: the reference in tests. For files whose contents are not far from their origin [`super::read`]
//! must produce the same scene, bit for bit.

mod sanitise;

use super::super::context::Context;
use super::super::error::SceneError;
use super::super::{Group, Mesh, Object, Scene};
use super::mtl::{self, Library};
use glam::{Mat4, Vec2, Vec3, Vec4};
use sanitise::{Run, Sanitiser};
use std::collections::HashMap;

const OPTIONS: tobj::LoadOptions =
    tobj::LoadOptions { single_index: true, triangulate: true, ignore_points: true, ignore_lines: true };

pub(in crate::scene) fn read(bytes: &[u8], max_run: usize, context: &mut Context<'_>) -> Result<Scene, SceneError> {
    let file = context.file;
    let mut reader = Sanitiser::new(bytes, max_run, context);
    let models = tobj::load_obj_buf(&mut reader, &OPTIONS, |_| Ok(Default::default()));
    let Sanitiser { runs, objects, materials, libraries, mut warnings, failure, .. } = reader;
    if let Some(failure) = failure {
        return Err(failure);
    }
    let (models, _) = models.map_err(|error| SceneError::file(file, format!("tobj refused the file: {error}")))?;

    let mut library = Library::default();
    for (line, argument) in &libraries {
        mtl::read_libraries(argument, *line, &mut library, context, &mut warnings)?;
    }
    let mut scene = Scene::default();
    let mut joiner = Joiner { scene: &mut scene, pieces: HashMap::new() };
    let mut material_index = vec![None; materials.list.len()];
    for model in models {
        // The model before the first face is empty and has no number.
        let Some(run) = model.name.parse::<usize>().ok().and_then(|number| runs.get(number)) else { continue };
        let slot = &mut material_index[run.material as usize];
        let material = *slot.get_or_insert_with(|| {
            super::material_of(&mut library, &materials.list[run.material as usize], context, &mut warnings)
        });
        let coordinates = library.coordinates.get(material as usize).copied().flatten();
        joiner.add(*run, model.mesh, material, coordinates, &objects.list[run.object as usize]);
    }
    scene.materials = library.table.materials;
    scene.textures = library.textures;
    scene.warnings = warnings;
    Ok(scene)
}

/// All components of a vertex as bits, to find equal vertices.
type Key = [u32; 11];

/// The mesh that collects an object's faces with one set of attributes.
struct Piece {
    mesh: usize,
    /// Filled when a second run is added; most objects have only one.
    vertices: HashMap<Key, u32>,
    /// Index of the mesh's group for each material.
    groups: HashMap<u32, usize>,
}

struct Joiner<'a> {
    scene: &'a mut Scene,
    pieces: HashMap<(u32, bool, bool), Piece>,
}

impl Joiner<'_> {
    fn add(&mut self, run: Run, read: tobj::Mesh, material: u32, coordinates: Option<(Vec2, Vec2)>, name: &str) {
        let mut texcoords: Vec<Vec2> = read.texcoords.chunks_exact(2).map(Vec2::from_slice).collect();
        if let Some((scale, offset)) = coordinates {
            texcoords.iter_mut().for_each(|texcoord| *texcoord = *texcoord * scale + offset);
        }
        let mesh = Mesh {
            name: name.to_owned(),
            positions: read.positions.chunks_exact(3).map(Vec3::from_slice).collect(),
            normals: read.normals.chunks_exact(3).map(Vec3::from_slice).collect(),
            texcoords,
            colors: colors(&read),
            tangents: Vec::new(),
            groups: Vec::new(),
        };
        let mut triangles: Vec<[u32; 3]> = read.indices.chunks_exact(3).map(|i| [i[0], i[1], i[2]]).collect();
        drop(read.indices);
        let key = (run.object, run.texcoords, run.normals);
        match self.pieces.get_mut(&key) {
            None => {
                let index = self.scene.meshes.len();
                self.pieces.insert(
                    key,
                    Piece { mesh: index, vertices: HashMap::new(), groups: HashMap::from([(material, 0)]) },
                );
                self.scene.objects.push(Object {
                    name: name.to_owned(),
                    mesh: index as u32,
                    transform: Mat4::IDENTITY,
                });
                self.scene.meshes.push(Mesh { groups: vec![Group { material, triangles }], ..mesh });
            }
            Some(piece) => {
                let target = &mut self.scene.meshes[piece.mesh];
                let new_index = piece.share_vertices(target, mesh);
                for vertex in triangles.iter_mut().flatten() {
                    *vertex = new_index[*vertex as usize];
                }
                let group = *piece.groups.entry(material).or_insert(target.groups.len());
                match target.groups.get_mut(group) {
                    Some(group) => group.triangles.append(&mut triangles),
                    None => target.groups.push(Group { material, triangles }),
                }
            }
        }
    }
}

impl Piece {
    /// Appends the vertices that `target` does not yet hold from earlier runs, and returns the index of each vertex. Equal vertices
    /// of one run are not shared: where a file lists a vertex twice, the two are meant to be separate.
    fn share_vertices(&mut self, target: &mut Mesh, added: Mesh) -> Vec<u32> {
        if self.vertices.is_empty() {
            for vertex in 0..target.positions.len() {
                self.vertices.entry(key(target, vertex)).or_insert(vertex as u32);
            }
        }
        let first_new = target.positions.len();
        let new_index = (0..added.positions.len())
            .map(|vertex| {
                self.vertices.get(&key(&added, vertex)).copied().unwrap_or_else(|| {
                    target.positions.push(added.positions[vertex]);
                    target.normals.extend(added.normals.get(vertex));
                    target.texcoords.extend(added.texcoords.get(vertex));
                    target.colors.extend(added.colors.get(vertex));
                    target.positions.len() as u32 - 1
                })
            })
            .collect();
        for vertex in first_new..target.positions.len() {
            self.vertices.entry(key(target, vertex)).or_insert(vertex as u32);
        }
        new_index
    }
}

fn key(mesh: &Mesh, vertex: usize) -> Key {
    let [x, y, z] = mesh.positions[vertex].to_array();
    let [nx, ny, nz] = mesh.normals.get(vertex).copied().unwrap_or_default().to_array();
    let [u, v] = mesh.texcoords.get(vertex).copied().unwrap_or_default().to_array();
    let [red, green, blue, _] = mesh.colors.get(vertex).copied().unwrap_or_default().to_array();
    [x, y, z, nx, ny, nz, u, v, red, green, blue].map(f32::to_bits)
}

fn colors(read: &tobj::Mesh) -> Vec<Vec4> {
    read.vertex_color.chunks_exact(3).map(|color| Vec4::new(color[0], color[1], color[2], 1.0)).collect()
}
