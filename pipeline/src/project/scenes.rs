//! Reading scenes: their files, folders, primitives, and placement.

use super::dom::{Element, Value};
use super::loader::Loader;
use super::report::{shown, suggest};
use super::{SceneDecl, SceneFile, source};
use crate::scene::{Placement, Shape, ShapeKind};
use glam::Vec3;

/// Elements for the placement of a scene or a primitive, today.
const PLACES: &[&str] = &["translate", "rotate", "scale", "transform_order"];
/// Attributes for the placement, in 2014 files.
const PLACE_ATTRIBUTES: &[&str] = &["transX", "transY", "transZ", "scaleX", "scaleY", "scaleZ", "scale"];
/// Types of primitives.
const SHAPES: [&str; 5] = ["BOX", "SQUARE", "SPHERE", "GRID", "AXIS"];
/// The material of primitives that name none.
pub(super) const SHAPE_MATERIAL: &str = "__Light Grey";

impl Loader {
    /// Reads a `<scene>`.
    pub fn scene(&mut self, element: &Element) {
        self.stray_text(element);
        self.expect_children(element, &[&["file", "folder", "geometry", "buffers", "sky"], PLACES].concat());
        self.expect_attributes(element, &[&["name", "type", "param", "filename"], PLACE_ATTRIBUTES].concat());
        let (mut files, mut shapes, mut exact, mut sky) = (Vec::new(), Vec::new(), None, Vec::new());
        let mut whole = true;
        if let Some(path) = element.attribute("filename") {
            whole &= self.scene_file(element, path, &mut files).is_some();
        }
        for child in &element.children {
            if child.is(&["file", "folder"]) {
                self.expect_children(child, &[]);
                self.expect_attributes(child, &["name"]);
                let read = match self.reference(child) {
                    Some(path) if child.is(&["file"]) => self.scene_file(child, path, &mut files),
                    Some(path) => self.scene_folder(child, path, &mut files),
                    None => None,
                };
                whole &= read.is_some();
            } else if child.is(&["geometry"]) {
                match self.shape(child) {
                    Some(shape) => {
                        if shape.kind == ShapeKind::ExactSphere {
                            exact.get_or_insert_with(|| self.place(child));
                        }
                        shapes.push(shape);
                    }
                    None => whole = false,
                }
            } else if child.is(&["sky"]) {
                self.expect(child, &[], &["material"]);
                let material = self.required(child, "material");
                match material.and_then(|material| self.material_pattern(material)) {
                    Some(pattern) => sky.push(pattern),
                    None => whole = false,
                }
            }
        }
        let place = self.place_of(element);
        if let (Some(place), true) = (&place, exact.is_some()) {
            whole &= self.scales_alike(element, place);
        }
        let (swap_yz, unitize) = self.scene_parameters(element);
        if unitize && shapes.iter().any(|shape| shape.kind == ShapeKind::Axis) {
            shapes.retain(|shape| shape.kind != ShapeKind::Axis);
            let message = "coordinate axes of a scene that is made unit size are not drawn";
            self.report.warning(element.span, message, || None);
        }
        // Lines and points are not drawn.
        let lines = element.children.iter().filter(|child| child.is(&["buffers"])).find(|child| {
            let kind = child.attribute("primitive").map(|kind| kind.text.to_ascii_uppercase());
            kind.is_some_and(|kind| kind.starts_with("LINE") || kind.starts_with("POINT"))
        });
        if let Some(lines) = lines {
            self.report.warning(lines.span, "lines and points are not drawn", || None);
        }
        let names_nothing =
            lines.is_none() && !element.children.iter().any(|child| child.is(&["file", "folder", "geometry"]));
        if files.is_empty() && whole && names_nothing {
            self.report.error_help(element.span, "the scene names no file", || {
                "valid: <file>path</file>, <file name=\"path\"/>, <folder name=\"path\"/>, <geometry type=\"BOX\" …/>".to_owned()
            });
        }
        if let Some(name) = self.required(element, "name") {
            let item = place.filter(|_| whole).map(|place| {
                let name = name.text.clone();
                SceneDecl { name, files, memory: None, shapes, exact, place, swap_yz, unitize, sky }
            });
            self.scenes.add(&mut self.report, name, item);
        }
    }

    fn scene_file(&mut self, element: &Element, path: &Value, files: &mut Vec<SceneFile>) -> Option<()> {
        let path = self.folder.resolve(&mut self.report, path)?;
        files.push(SceneFile { path, place: self.place(element) });
        Some(())
    }

    /// All scene files of a folder; if several files have the same stem, only the best format.
    fn scene_folder(&mut self, element: &Element, written: &Value, files: &mut Vec<SceneFile>) -> Option<()> {
        let folder = self.folder.resolve(&mut self.report, written)?;
        if !folder.is_dir() {
            let message = format!("there is no folder {}", folder.display());
            self.report.error_help(written.span, message, || crate::paths::nearest_help(&folder));
            return None;
        }
        match source::scenes_in(&folder) {
            Ok(found) => {
                let place = self.place(element);
                files.extend(found.into_iter().map(|path| SceneFile { path, place: place.clone() }));
                Some(())
            }
            Err(error) => {
                self.report.error(written.span, error.to_string());
                None
            }
        }
    }

    fn scene_parameters(&mut self, element: &Element) -> (bool, bool) {
        const WORDS: [&str; 3] = ["SWAP_YZ", "NO_SWAP", "UNITIZE"];
        let (mut swap_yz, mut unitize) = (false, false);
        let Some(value) = element.attribute("param") else { return (false, false) };
        for word in value.text.split([' ', ',', '|', ';']).filter(|word| !word.is_empty()) {
            match word.to_ascii_uppercase().as_str() {
                "SWAP_YZ" => swap_yz = true,
                "NO_SWAP" => {}
                "UNITIZE" => unitize = true,
                _ => {
                    // As in the engine, unknown words are ignored.
                    let message = format!("`{}` is not a parameter of scenes: it is ignored", shown(word));
                    self.report.warning(value.span, message, || Some(suggest(word, WORDS)));
                }
            }
        }
        (swap_yz, unitize)
    }

    /// Reads a `<geometry>`; `None` after an error.
    fn shape(&mut self, element: &Element) -> Option<Shape> {
        self.stray_text(element);
        self.expect_children(element, PLACES);
        let known = ["name", "type", "material", "slices", "stacks", "divisions", "length", "exact"];
        self.expect_attributes(element, &[&known[..], PLACE_ATTRIBUTES].concat());
        let place = self.place_of(element);
        let (name, kind) = (element.attribute("name"), self.required(element, "type")?);
        let material = element.attribute("material").map_or(SHAPE_MATERIAL, |value| &value.text).to_owned();
        let exact = match element.attribute("exact") {
            Some(value) => self.boolean(value)?,
            None => false,
        };
        if let Some(value) = element.attribute("exact").filter(|_| exact && !kind.text.eq_ignore_ascii_case("SPHERE")) {
            let message = format!("a {} is no exact sphere", kind.shown());
            self.report.error_help(value.span, message, || "valid: exact=\"true\" with type=\"SPHERE\"".to_owned());
            return None;
        }
        let kind = match kind.text.to_ascii_uppercase().as_str() {
            "BOX" => ShapeKind::Box,
            "SQUARE" => ShapeKind::Square,
            "SPHERE" if exact => {
                for value in ["slices", "stacks"].into_iter().filter_map(|name| element.attribute(name)) {
                    self.report.warning(value.span, "an exact sphere has no parts: it is ignored", || None);
                }
                if !self.scales_alike(element, place.as_ref()?) {
                    return None;
                }
                ShapeKind::ExactSphere
            }
            "SPHERE" => {
                let (slices, stacks) = (self.count(element, "slices", 3, 10), self.count(element, "stacks", 2, 10));
                ShapeKind::Sphere { slices: slices?, stacks: stacks? }
            }
            "GRID" => {
                let divisions = self.count(element, "divisions", 1, 10);
                let length = element.attribute("length").map_or(Some(1.0), |value| self.number(value));
                ShapeKind::Grid { divisions: divisions?, length: length? }
            }
            "AXIS" => ShapeKind::Axis,
            _ => {
                let message = format!("`{}` is not a primitive", kind.shown());
                self.report.error_help(kind.span, message, || suggest(&kind.text, SHAPES));
                return None;
            }
        };
        let name = name.map_or_else(|| "geometry".to_owned(), |name| name.text.clone());
        Some(Shape { name, material, kind, place: place? })
    }

    /// Whether a placement keeps an exact sphere a sphere: whether its scale is uniform.
    fn scales_alike(&mut self, element: &Element, place: &Placement) -> bool {
        let [x, y, z] = place.scale.abs().to_array();
        let alike = x == y && y == z && x > 0.0;
        if !alike {
            let message = format!("an exact sphere is scaled by {x}, {y} and {z} along the axes");
            self.report.error_help(element.span, message, || {
                "valid: the same scale, above 0, along all three; without exact=\"true\" the sphere is a mesh"
                    .to_owned()
            });
        }
        alike
    }

    /// A number of divisions, from `least` to [`ShapeKind::MOST`].
    fn count(&mut self, element: &Element, name: &str, least: u32, default: u32) -> Option<u32> {
        let Some(value) = element.attribute(name) else { return Some(default) };
        let number = self.number(value)?;
        if number.fract() == 0.0 && (least as f32..=ShapeKind::MOST as f32).contains(&number) {
            return Some(number as u32);
        }
        let message = format!("{name} {} is out of range", value.shown());
        self.report.error_help(value.span, message, || format!("valid: {least} to {}", ShapeKind::MOST));
        None
    }

    /// Placement of a scene or a primitive: attributes as in 2014, or elements as today. Without `TRANSFORM_ORDER` it scales first,
    /// then rotates, then translates.
    fn place_of(&mut self, element: &Element) -> Option<Placement> {
        let mut number =
            |name: &str, default: f32| element.attribute(name).map_or(Some(default), |value| self.number(value));
        let moved = [number("transX", 0.0), number("transY", 0.0), number("transZ", 0.0)];
        let scaled = [number("scaleX", 1.0), number("scaleY", 1.0), number("scaleZ", 1.0)];
        let both = number("scale", 1.0);
        let three = |[x, y, z]: [Option<f32>; 3]| Some(Vec3::new(x?, y?, z?));
        let (moved, scaled) = (three(moved), three(scaled).zip(both).map(|(scaled, both)| scaled * both));
        let mut vector = |name: &str, attributes: Option<Vec3>| match self.single(element, &[name]) {
            Some(part) => self.vector(part),
            None => attributes,
        };
        let (translation, scale) = (vector("translate", moved), vector("scale", scaled));
        let rotation = match self.single(element, &["rotate"]) {
            // Rotation axis, and angle in degrees.
            Some(rotate) => {
                let angle = rotate.attribute("w").map_or(Some(0.0), |value| self.number(value));
                self.vector(rotate).zip(angle)
            }
            None => Some((Vec3::Z, 0.0)),
        };
        let order = match self.single(element, &["transform_order"]) {
            Some(order) => self.transform_order(order),
            None => Some(Placement::ORDERS[0]),
        };
        let (translation, (axis, degrees), scale) = (translation?, rotation?, scale?);
        let place = Placement { translation, axis, degrees, scale, order: order? };
        if !place.matrix().is_finite() {
            self.report.error(element.span, format!("<{}> is placed beyond the range of numbers", element.name));
            return None;
        }
        Some(place)
    }

    /// Reads `<TRANSFORM_ORDER value="T_R_S"/>`.
    fn transform_order(&mut self, element: &Element) -> Option<&'static str> {
        let value = self.required(element, "value")?;
        let found = Placement::ORDERS.into_iter().find(|order| order.eq_ignore_ascii_case(&value.text));
        if found.is_none() {
            let message = format!("`{}` is not an order of transforms", value.shown());
            self.report.error_help(value.span, message, || suggest(&value.text, Placement::ORDERS));
        }
        found
    }
}
