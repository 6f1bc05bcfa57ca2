//! COLLADA 1.4 and 1.5 (`.dae`): geometry, materials and textures of a visual scene. Positions are converted to metres with y up,
//! whatever unit and axes the file uses. If a file's contents are far from its origin, positions are read relative to an origin near them
//! ([`super::origin`]). Skinned and morphed meshes are drawn in the pose in which they were modelled; animations,
//! cameras, lights and physics are skipped.

mod material;
mod mesh;
mod xml;

use super::context::Context;
use super::error::{Place, SceneError};
use super::origin::move_near;
use super::xml_text::with_text;
use super::{Object, Scene};
use crate::diagnostic::Warnings;
use glam::{DMat4, DVec3};
use material::Materials;
use mesh::{Meshes, Sources};
use std::collections::HashMap;
use std::path::Path;
use xml::{Document, Element, plain};

/// Deepest nesting of nodes. Real scenes are shallower, and a node that instantiates itself would recurse without end.
const MAX_DEPTH: usize = 1024;

pub(crate) fn read(bytes: &[u8], context: &mut Context<'_>) -> Result<Scene, SceneError> {
    with_text(bytes, context, read_document)
}

/// [`read`] for decoded text; positions in errors count the bytes of this text.
fn read_document(text: &str, context: &mut Context<'_>) -> Result<Scene, SceneError> {
    let file = context.file;
    let document = Document::read(text, context)?;
    let Some(root) = document.root().filter(|root| root.name() == "COLLADA") else {
        return Err(SceneError::file(file, "this XML file is no COLLADA document").help("valid: <COLLADA>"));
    };
    let mut walk = Walk {
        document: &document,
        scene: Scene::default(),
        materials: Materials::default(),
        meshes: Meshes::default(),
        places: Vec::new(),
        warnings: Warnings::default(),
    };
    let upright = upright(&document, root, file, &mut walk.warnings);
    let named = document.descend(root, &["scene", "instance_visual_scene"]);
    let named = named.and_then(|instance| document.find(instance.attribute("url")?));
    match named.or_else(|| document.first("visual_scene")) {
        Some(scene) => walk.nodes(scene, upright, context)?,
        None => {
            for geometry in document.all("geometry") {
                walk.place(geometry, None, upright, "", context)?;
            }
        }
    }
    let Walk { mut scene, materials, places, warnings, .. } = walk;
    move_near(&mut scene, &places);
    (scene.materials, scene.textures, scene.warnings) = (materials.table.materials, materials.textures, warnings);
    Ok(scene)
}

/// The transform from the file's axes and unit to metres with y up.
fn upright(document: &Document<'_>, root: &Element<'_>, file: &Path, warnings: &mut Warnings) -> DMat4 {
    let asset = |name: &str| document.descend(root, &["asset", name]);
    let written = asset("unit").and_then(|unit| unit.attribute("meter"));
    let meter = written.map_or(Some(1.0), |meter| meter.trim().parse::<f64>().ok());
    let meter = meter.filter(|meter| *meter > 0.0 && meter.is_finite()).unwrap_or_else(|| {
        let what = "units that are no length above 0";
        warnings.add(file, what, "1 metre serves", || written.unwrap_or_default().chars().take(20).collect());
        1.0
    });
    let axes = match asset("up_axis").map(|axis| axis.text()) {
        Some("Z_UP") => [DVec3::X, DVec3::NEG_Z, DVec3::Y],
        Some("X_UP") => [DVec3::Y, DVec3::NEG_X, DVec3::Z],
        _ => [DVec3::X, DVec3::Y, DVec3::Z],
    };
    let [x, y, z] = axes.map(|axis| (axis * meter).extend(0.0));
    DMat4::from_cols(x, y, z, glam::DVec4::W)
}

struct Walk<'d, 'a> {
    document: &'d Document<'a>,
    scene: Scene,
    materials: Materials,
    meshes: Meshes,
    /// The transforms of the scene's objects in `f64`, before they are rounded.
    places: Vec<DMat4>,
    warnings: Warnings,
}

impl Walk<'_, '_> {
    /// Places the contents of all nodes of a visual scene, depth first, in order.
    fn nodes(&mut self, scene: u32, upright: DMat4, context: &mut Context<'_>) -> Result<(), SceneError> {
        let document = self.document;
        let file = context.file;
        // The children of a scene are nodes; those of a node are nodes and instances, after its transforms.
        let mut stack = vec![(scene, upright, 0)];
        while let Some((index, parent, depth)) = stack.pop() {
            let node = document.get(index);
            let fail = |(at, what): (u64, String)| SceneError::new(file, Place::Byte(at), what);
            // Nested instances may expand to far more nodes than the file has bytes.
            // Every visit looks at all children, and reads the numbers of their transforms again.
            let read = |(_, child): (u32, &Element<'_>)| 1 + child.size_of_numbers::<f64>() / 64;
            let work: u64 = document.all_children(node).map(read).sum();
            context.take("the nodes", 8 + work as usize, 8)?;
            if depth > MAX_DEPTH {
                let what = format!("more than {MAX_DEPTH} nodes lie within each other, or one places itself");
                return Err(fail(node.wrong(what)));
            }
            let transform = parent * self.transform(node, context)?;
            let name = node.attribute("name").or(node.attribute("id")).unwrap_or_default();
            let mut below = Vec::new();
            for (child, element) in document.all_children(node) {
                let target = || element.attribute("url").and_then(|url| document.find(url));
                match element.name() {
                    "node" => below.push((child, transform, depth + 1)),
                    "instance_node" => {
                        let found = target().filter(|found| document.get(*found).name() == "node");
                        let found = found.ok_or_else(|| fail(element.wrong("it names no node".to_owned())))?;
                        below.push((found, transform, depth + 1));
                    }
                    "instance_geometry" | "instance_controller" => {
                        let found =
                            target().ok_or_else(|| fail(element.wrong("its `url` leads nowhere".to_owned())))?;
                        let (geometry, bind) = self.geometry_of(found, context)?;
                        self.place(geometry, Some(element), transform * bind, name, context)?;
                    }
                    "instance_camera" | "instance_light" => {
                        let what = "cameras and lights of COLLADA files";
                        self.warnings.add(file, what, "ignored", || format!("`{}`", plain(name)));
                    }
                    _ => {}
                }
            }
            stack.extend(below.into_iter().rev());
        }
        Ok(())
    }

    /// The geometry behind a controller, with its bind transform. For a geometry it returns the geometry itself and the identity.
    fn geometry_of(&mut self, mut index: u32, context: &mut Context<'_>) -> Result<(u32, DMat4), SceneError> {
        let document = self.document;
        let mut bind = DMat4::IDENTITY;
        // The longest valid chain is a skin of a morph of a mesh; a longer one would be a cycle.
        for _ in 0..4 {
            let element = document.get(index);
            let moved = ["skin", "morph"].iter().find_map(|kind| document.descend(element, &[kind]));
            let Some(moved) = moved.filter(|_| element.name() == "controller") else { break };
            let id = element.attribute("id").unwrap_or_default();
            let what = "skinned and morphed meshes of COLLADA files";
            self.warnings.add(context.file, what, "drawn as they were modelled", || format!("`{}`", plain(id)));
            if let Some(shape) = document.descend(moved, &["bind_shape_matrix"]) {
                bind *= matrix(shape, context)?;
            }
            let source = moved.attribute("source").and_then(|source| document.find(source));
            index = source.ok_or_else(|| {
                let (at, what) = moved.wrong("its `source` leads nowhere".to_owned());
                SceneError::new(context.file, Place::Byte(at), what)
            })?;
        }
        Ok((index, bind))
    }

    /// Places the meshes of a geometry.
    fn place(
        &mut self,
        geometry: u32,
        instance: Option<&Element<'_>>,
        transform: DMat4,
        name: &str,
        context: &mut Context<'_>,
    ) -> Result<(), SceneError> {
        let document = self.document;
        let element = document.get(geometry);
        let Some(written) = document.descend(element, &["mesh"]).filter(|_| element.name() == "geometry") else {
            let what = "geometries that are no meshes";
            self.warnings.add(context.file, what, "left out", || format!("<{}>", element.name()));
            return Ok(());
        };
        let technique = instance.and_then(|i| document.descend(i, &["bind_material", "technique_common"]));
        let pairs = technique
            .iter()
            .flat_map(|technique| document.children(technique, "instance_material"))
            .filter_map(|bound| Some((bound.attribute("symbol")?, bound.attribute("target")?)));
        let (mut bound, mut looked_at) = (HashMap::new(), document.all_children(written).count());
        for (symbol, target) in pairs {
            bound.entry(symbol).or_insert(target);
            looked_at += 1;
        }
        // Nested instances may place a geometry far more often than the file has bytes.
        context.take("the objects", looked_at, 8)?;
        let mut materials = Vec::new();
        for (primitive, element) in document.all_children(written) {
            if mesh::is_drawn(element.name()) {
                let symbol = element.attribute("material");
                let target = symbol.map(|symbol| {
                    // Without a material binding the symbol may be the id of a material.
                    bound.get(symbol).copied().unwrap_or(symbol)
                });
                materials.push((primitive, self.materials.of(target, document, context, &mut self.warnings)));
            } else if mesh::is_not_drawn(element.name()) {
                let what = "lines of COLLADA files";
                self.warnings.add(context.file, what, "left out", || format!("<{}>", element.name()));
            }
        }
        let id = element.attribute("name").or(element.attribute("id")).unwrap_or_default();
        let name = plain(if name.is_empty() { id } else { name }).into_owned();
        let mut sources = Sources::default();
        for primitive in materials {
            let known = self.meshes.known(primitive);
            let (mesh, origin) = match known {
                Some(known) => known,
                None => {
                    let name = plain(id).into_owned();
                    let read = mesh::read(document, primitive, name, &mut sources, context, &mut self.warnings)?;
                    self.meshes.add(primitive, read, &mut self.scene.meshes)
                }
            };
            context.take("the objects", 1, size_of::<Object>() + size_of::<DMat4>() + name.len())?;
            let exact = transform * DMat4::from_translation(origin);
            self.scene.objects.push(Object { name: name.clone(), mesh, transform: exact.as_mat4() });
            self.places.push(exact);
        }
        sources.give_back(context);
        Ok(())
    }

    /// The combined transform of a node. Its transforms are applied from the last to the first.
    fn transform(&mut self, node: &Element<'_>, context: &mut Context<'_>) -> Result<DMat4, SceneError> {
        let document = self.document;
        let mut whole = DMat4::IDENTITY;
        for (_, element) in document.all_children(node) {
            let kind = element.name();
            let count = match kind {
                "matrix" => 16,
                "translate" | "scale" => 3,
                "rotate" => 4,
                "lookat" => 9,
                "skew" => {
                    let what = "skewed nodes of COLLADA files";
                    self.warnings
                        .add(context.file, what, "drawn without", || element.text().chars().take(60).collect());
                    continue;
                }
                _ => continue,
            };
            let n = exactly(element, count, context)?;
            let vector = |first: usize| DVec3::new(n[first], n[first + 1], n[first + 2]);
            whole *= match kind {
                "matrix" => rows(&n),
                "translate" => DMat4::from_translation(vector(0)),
                "scale" => DMat4::from_scale(vector(0)),
                "rotate" => match vector(0).try_normalize() {
                    Some(axis) => DMat4::from_axis_angle(axis, n[3].to_radians()),
                    None => DMat4::IDENTITY,
                },
                _ => {
                    let (eye, target) = (vector(0), vector(3));
                    let back = (eye - target).normalize_or(DVec3::Z);
                    let right = vector(6).cross(back).normalize_or(DVec3::X);
                    let [x, y, z] = [right, back.cross(right), back].map(|axis| axis.extend(0.0));
                    DMat4::from_cols(x, y, z, eye.extend(1.0))
                }
            };
        }
        Ok(whole)
    }
}

fn matrix(element: &Element<'_>, context: &mut Context<'_>) -> Result<DMat4, SceneError> {
    exactly(element, 16, context).map(|numbers| rows(&numbers))
}

/// A matrix from 16 numbers in row order.
fn rows(numbers: &[f64]) -> DMat4 {
    DMat4::from_cols_slice(numbers).transpose()
}

fn exactly(element: &Element<'_>, count: usize, context: &mut Context<'_>) -> Result<Vec<f64>, SceneError> {
    let numbers = element.numbers::<f64>(context)?;
    // The few numbers that a transform has are not counted while they are used.
    context.budget.give_back(element.size_of_numbers::<f64>());
    if numbers.len() != count {
        let (at, what) = element.wrong(format!("{} numbers; valid: {count}", numbers.len()));
        return Err(SceneError::new(context.file, Place::Byte(at), what));
    }
    Ok(numbers)
}

#[cfg(test)]
mod tests;
