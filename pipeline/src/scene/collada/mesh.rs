//! Primitives as triangles, with one vertex for each distinct tuple of indices.

use super::xml::{Document, Element};
use crate::diagnostic::Warnings;
use crate::scene::context::Context;
use crate::scene::error::{Place, SceneError};
use crate::scene::origin::{bounds, origin_for};
use crate::scene::{Group, Mesh};
use glam::{DVec3, Vec2, Vec3};
use std::collections::HashMap;
use std::rc::Rc;

/// Marks a missing index.
const NONE: u32 = u32::MAX;

/// Whether an element is a primitive that is drawn.
pub(super) fn is_drawn(name: &str) -> bool {
    matches!(name, "triangles" | "polylist" | "polygons" | "tristrips" | "trifans")
}

/// Whether an element is a primitive that is not drawn.
pub(super) fn is_not_drawn(name: &str) -> bool {
    matches!(name, "lines" | "linestrips")
}

/// The meshes read so far, by (primitive, material): their indices, and the origins of their positions.
#[derive(Debug, Default)]
pub(super) struct Meshes(HashMap<(u32, u32), (u32, DVec3)>);

impl Meshes {
    pub(super) fn known(&self, primitive: (u32, u32)) -> Option<(u32, DVec3)> {
        self.0.get(&primitive).copied()
    }

    pub(super) fn add(
        &mut self,
        primitive: (u32, u32),
        (mesh, origin): (Mesh, DVec3),
        meshes: &mut Vec<Mesh>,
    ) -> (u32, DVec3) {
        let added = (meshes.len() as u32, origin);
        meshes.push(mesh);
        self.0.insert(primitive, added);
        added
    }
}

/// The sources that the primitives of a mesh have read so far.
#[derive(Default)]
pub(super) struct Sources {
    /// By the index of the source, and whether it holds positions.
    known: HashMap<(u32, bool), Rc<Source>>,
    /// Bytes that are booked for them.
    booked: u64,
}

impl Sources {
    /// The source with an index. It is read at its first use.
    fn of(
        &mut self,
        document: &Document<'_>,
        key: (u32, bool),
        context: &mut Context<'_>,
    ) -> Result<Rc<Source>, SceneError> {
        if let Some(known) = self.known.get(&key) {
            return Ok(Rc::clone(known));
        }
        let left = context.budget.left();
        let read = Rc::new(Source::read(document, key, context)?);
        self.booked += left - context.budget.left();
        self.known.insert(key, Rc::clone(&read));
        Ok(read)
    }

    /// Drops the sources and gives their memory back.
    pub(super) fn give_back(self, context: &mut Context<'_>) {
        context.budget.give_back(self.booked);
    }
}

/// The numbers of a source.
struct Source {
    numbers: Vec<f32>,
    /// Origin to which positions are relative.
    origin: DVec3,
    first: usize,
    stride: usize,
    count: usize,
}

/// An attribute: its source, and the offset of its index within a corner's indices.
struct Attribute {
    offset: usize,
    source: Rc<Source>,
}

impl Source {
    /// The value at an index below `count`, or zeros for [`NONE`]. Components beyond the stride are 0.
    fn at<const N: usize>(&self, index: u32) -> [f32; N] {
        if index == NONE {
            return [0.0; N];
        }
        let first = self.first + index as usize * self.stride;
        std::array::from_fn(|i| if i < self.stride { self.numbers[first + i] } else { 0.0 })
    }
}

/// The attributes of a corner: position, normal, texture coordinates, colour.
type Attributes = [Option<Attribute>; 4];

/// Reads a primitive element of a mesh, with its material. The mesh's positions are relative to the returned origin.
pub(super) fn read(
    document: &Document<'_>,
    (primitive, material): (u32, u32),
    name: String,
    sources: &mut Sources,
    context: &mut Context<'_>,
    warnings: &mut Warnings,
) -> Result<(Mesh, DVec3), SceneError> {
    let element = document.get(primitive);
    let file = context.file;
    let fail = |(at, what): (u64, String)| SceneError::new(file, Place::Byte(at), what);
    let mut attributes: Attributes = [None, None, None, None];
    let mut stride = 0;
    let wanted = [true, context.needs.normals, context.needs.textures, context.needs.colors];
    let mut sets = [usize::MAX; 4];
    for input in document.children(element, "input") {
        let offset = input.count("offset", 0).map_err(fail)?;
        stride = stride.max(offset.saturating_add(1));
        let set = input.count("set", 0).map_err(fail)?;
        let source = || {
            let found = input.attribute("source").and_then(|source| document.find(source));
            found.ok_or_else(|| fail(input.wrong("its `source` leads nowhere".to_owned())))
        };
        let mut add = |semantic: &str, source: u32, context: &mut Context<'_>| {
            let slot = ["POSITION", "NORMAL", "TEXCOORD", "COLOR"].iter().position(|own| *own == semantic);
            // Of several sets of an attribute the one with the lowest number is used.
            let Some(slot) = slot.filter(|slot| wanted[*slot] && set < sets[*slot]) else { return Ok(()) };
            sets[slot] = set;
            let source = sources.of(document, (source, slot == 0), context)?;
            attributes[slot] = Some(Attribute { offset, source });
            Ok::<(), SceneError>(())
        };
        match input.attribute("semantic") {
            Some("VERTEX") => {
                let vertices = source()?;
                for inner in document.children(document.get(vertices), "input") {
                    let source = inner.attribute("source").and_then(|source| document.find(source));
                    let source = source.ok_or_else(|| fail(inner.wrong("its `source` leads nowhere".to_owned())))?;
                    add(inner.attribute("semantic").unwrap_or_default(), source, context)?;
                }
            }
            Some(semantic) => {
                let source = source()?;
                add(semantic, source, context)?;
            }
            None => {}
        }
    }
    let mut builder = Builder::new(attributes, Mesh { name, ..Mesh::default() });
    if builder.attributes[0].is_none() {
        let what = "primitives of COLLADA files without positions";
        warnings.add(file, what, "left out", || format!("`{}`", builder.mesh.name));
        return Ok((builder.mesh, DVec3::ZERO));
    }
    let kind = element.name();
    let written = document.children(element, "vcount").next().filter(|_| kind == "polylist");
    let counts = written.map(|counts| counts.numbers::<u32>(context)).transpose()?;
    let mut polygons: Vec<&Element<'_>> = document.children(element, "p").collect();
    let holed: Vec<&Element<'_>> = document.children(element, "ph").collect();
    if !holed.is_empty() {
        let what = "polygons with holes";
        warnings.add(file, what, "drawn without holes", || format!("{} in `{}`", holed.len(), builder.mesh.name));
        polygons.extend(holed.iter().filter_map(|holed| document.descend(holed, &["p"])));
    }
    let mut bad = 0_u64;
    for list in polygons {
        let indices = list.numbers::<u32>(context)?;
        let corners: Vec<&[u32]> = indices.chunks_exact(stride).collect();
        context.take("the corners of a mesh", corners.len(), 96)?;
        let mut draw = |triangle: [&[u32]; 3]| bad += u64::from(!builder.triangle(triangle));
        match (kind, &counts) {
            ("triangles", _) => corners.as_chunks::<3>().0.iter().for_each(|corners| draw(*corners)),
            ("polylist", Some(counts)) => {
                let mut rest = &corners[..];
                for count in counts {
                    let Some((polygon, after)) = rest.split_at_checked(*count as usize) else {
                        let (at, what) = list.wrong(format!("{} corners are fewer than <vcount> says", corners.len()));
                        return Err(SceneError::new(file, Place::Byte(at), what));
                    };
                    fan(polygon).for_each(&mut draw);
                    rest = after;
                }
            }
            ("tristrips", _) => corners.windows(3).enumerate().for_each(|(number, corners)| {
                // In a strip every second triangle has the opposite winding.
                let [a, b, c] = [corners[0], corners[1], corners[2]];
                draw(if number % 2 == 0 { [a, b, c] } else { [a, c, b] });
            }),
            _ => fan(&corners).for_each(&mut draw),
        }
        context.budget.give_back(list.size_of_numbers::<u32>());
    }
    drop(counts);
    context.budget.give_back(written.map_or(0, Element::size_of_numbers::<u32>));
    let Builder { attributes, mut mesh, triangles, lacking, .. } = builder;
    let [positions, ..] = &attributes;
    let origin = positions.as_ref().map_or(DVec3::ZERO, |positions| positions.source.origin);
    if bad > 0 {
        let what = "triangles with indices of positions out of range";
        warnings.add(file, what, "left out", || format!("{bad} in `{}`", mesh.name));
    }
    if lacking > 0 {
        let what = "indices of normals, texture coordinates and colours out of range";
        warnings.add(file, what, "read as zeros", || format!("{lacking} in `{}`", mesh.name));
    }
    mesh.groups.push(Group { material, triangles });
    Ok((mesh, origin))
}

/// The triangles of a convex polygon.
fn fan<'c, 'i>(corners: &'c [&'i [u32]]) -> impl Iterator<Item = [&'i [u32]; 3]> + 'c {
    (2..corners.len()).map(|last| [corners[0], corners[last - 1], corners[last]])
}

impl Source {
    /// Reads the numbers that a source's accessor describes, and checks that all of them exist. Positions far from 0 are read again,
    /// relative to an origin near them.
    fn read(
        document: &Document<'_>,
        (source, is_position): (u32, bool),
        context: &mut Context<'_>,
    ) -> Result<Self, SceneError> {
        let file = context.file;
        let fail = |(at, what): (u64, String)| SceneError::new(file, Place::Byte(at), what);
        let element = document.get(source);
        let accessor = document.descend(element, &["technique_common", "accessor"]);
        let accessor = accessor.ok_or_else(|| fail(element.wrong("the source has no accessor".to_owned())))?;
        let array = accessor.attribute("source").and_then(|array| document.find(array));
        let array = array.map(|array| document.get(array)).filter(|array| array.name() == "float_array");
        let array = array.ok_or_else(|| fail(accessor.wrong("its `source` is no array of numbers".to_owned())))?;
        let numbers = array.numbers::<f32>(context)?;
        let (first, stride) = (accessor.count("offset", 0).map_err(fail)?, accessor.count("stride", 1).map_err(fail)?);
        let count = accessor.count("count", 0).map_err(fail)?;
        let end = count.checked_mul(stride).and_then(|length| length.checked_add(first));
        if (stride == 0 && count > 0) || end.is_none_or(|end| end > numbers.len()) {
            let there = numbers.len();
            let what =
                format!("{count} times {stride} values from {first} on are more than the {there} that there are");
            return Err(fail(accessor.wrong(what)));
        }
        let mut read = Self { numbers, origin: DVec3::ZERO, first, stride, count };
        if is_position {
            context.take("the corners of a mesh", count, size_of::<Vec3>())?;
            let points: Vec<Vec3> = (0..count).map(|index| Vec3::from(read.at(index as u32))).collect();
            read.origin = bounds(&points).map_or(DVec3::ZERO, origin_for);
            context.budget.give_back(size_of_val(&points[..]) as u64);
        }
        if read.origin != DVec3::ZERO {
            let exact = array.numbers::<f64>(context)?;
            for (number, exact) in exact.into_iter().enumerate().skip(first).take(count * stride) {
                let axis = (number - first) % stride;
                if axis < 3 {
                    read.numbers[number] = (exact - read.origin[axis]) as f32;
                }
            }
            context.budget.give_back(array.size_of_numbers::<f64>());
        }
        Ok(read)
    }
}

struct Builder {
    attributes: Attributes,
    mesh: Mesh,
    triangles: Vec<[u32; 3]>,
    /// The vertex of each tuple of indices.
    vertices: HashMap<[u32; 4], u32>,
    /// Number of indices out of range, other than those of positions.
    lacking: u64,
}

impl Builder {
    fn new(attributes: Attributes, mesh: Mesh) -> Self {
        Self { attributes, mesh, triangles: Vec::new(), vertices: HashMap::new(), lacking: 0 }
    }

    /// Adds a triangle unless the index of a position is out of range; returns whether it did. Other attributes do not decide this, since
    /// they are not always read.
    fn triangle(&mut self, corners: [&[u32]; 3]) -> bool {
        let mut keys = [[NONE; 4]; 3];
        let mut lacking = 0;
        for (key, corner) in keys.iter_mut().zip(corners) {
            for (index, attribute) in key.iter_mut().zip(&self.attributes) {
                let Some(attribute) = attribute else { continue };
                *index = corner[attribute.offset];
                if *index as usize >= attribute.source.count {
                    *index = NONE;
                    lacking += 1;
                }
            }
            if key[0] == NONE {
                return false;
            }
        }
        self.lacking += lacking;
        let triangle = keys.map(|key| self.vertex(key));
        self.triangles.push(triangle);
        true
    }

    fn vertex(&mut self, key: [u32; 4]) -> u32 {
        let Self { attributes, mesh, vertices, .. } = self;
        let next = mesh.positions.len() as u32;
        let vertex = *vertices.entry(key).or_insert(next);
        if vertex == next {
            let [positions, normals, texcoords, colors] = attributes;
            let [position, normal, texcoord, color] = key;
            mesh.positions.extend(positions.iter().map(|list| Vec3::from(list.source.at(position))));
            mesh.normals.extend(normals.iter().map(|list| Vec3::from(list.source.at(normal))));
            mesh.texcoords.extend(texcoords.iter().map(|list| Vec2::from(list.source.at(texcoord))));
            mesh.colors.extend(colors.iter().map(|list| Vec3::from(list.source.at(color)).extend(1.0)));
        }
        vertex
    }
}
