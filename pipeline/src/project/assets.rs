//! Scenes, viewports, cameras, lights and constants.

use super::Viewport;
use super::dom::{Element, Value};
use super::loader::Loader;
use crate::image::MAX_SIDE;
use glam::Vec4;

/// Elements of the engine that are accepted without a warning. Of these only `<attributes>` affect rendering here.
const OTHER_ASSETS: &[&str] = &[
    "attributes",
    "events",
    "sensors",
    "interpolators",
    "moveableObjects",
    "atomics",
    "physicsLibs",
    "activeEffects",
    "preProcess",
];

impl Loader {
    /// Reads `<assets>`: constants first, since the other lists use them, and viewports before cameras, which name viewports.
    pub fn assets(&mut self, root: &Element) {
        const LISTS: &[&str] = &["constants", "aliases", "scenes", "viewports", "cameras", "lights", "materialLibs"];
        if root.children_named(&["assets"]).next().is_none() {
            self.report.error(root.span, "the project has no <assets>");
        }
        for assets in root.children_named(&["assets"]) {
            self.expect(assets, &[LISTS, OTHER_ASSETS].concat(), &[]);
        }
        self.list(root, "constants", &["constant"], Self::constant);
        self.list(root, "aliases", &["alias"], Self::constant);
        self.pass_attributes(root);
        self.list(root, "materialLibs", &["mlib", "materialLib"], Self::library);
        self.list(root, "viewports", &["viewport"], Self::viewport);
        self.list(root, "scenes", &["scene"], Self::scene);
        self.list(root, "cameras", &["camera"], Self::camera);
        self.list(root, "lights", &["light"], Self::light);
    }

    /// Reads the values that `<attributes>` declare for passes and for shaders; other declarations there are skipped.
    fn pass_attributes(&mut self, root: &Element) {
        let lists = root.children_named(&["assets"]).flat_map(|assets| assets.children_named(&["attributes"]));
        for item in lists.flat_map(|list| list.children_named(&["attribute"])) {
            let of_pass = Self::declared_for(item, "PASS");
            let (Some(name), Some(value)) = (item.attribute("name"), item.attribute("value")) else { continue };
            let is_read = of_pass || Self::declared_for(item, "RENDERER");
            let number = if is_read { self.optional_number(value) } else { None };
            self.renderer_value(item, name, number);
            self.attributes.declare(item, &name.text, of_pass);
            if let Some(number) = number.filter(|_| of_pass) {
                self.attributes.pass_values.insert(name.text.clone(), number);
            }
        }
    }

    /// Whether an `<attribute>` is declared for a kind of object. Older files name the kind as `context`, and the type of its data as
    /// `type`.
    pub fn declared_for(item: &Element, kind: &str) -> bool {
        let named = item.attribute("context").or(item.attribute("type"));
        named.is_some_and(|named| named.text.eq_ignore_ascii_case(kind))
    }

    fn list(&mut self, root: &Element, name: &str, items: &[&str], mut read: impl FnMut(&mut Self, &Element)) {
        let lists = root.children_named(&["assets"]).flat_map(|assets| &assets.children);
        for list in lists.filter(|list| list.is(&[name])) {
            self.expect(list, items, &[]);
            for item in list.children_named(items) {
                read(self, item);
            }
        }
    }

    fn constant(&mut self, element: &Element) {
        self.expect(element, &[], &["name", "type", "value"]);
        let (name, value) = (self.required(element, "name"), self.number_of(element, "value"));
        if let (Some(name), Some(value)) = (name, value)
            && self.constants.insert(name.text.clone(), value).is_some()
        {
            self.report.error(name.span, format!("a second constant is named `{}`", name.shown()));
        }
    }

    fn viewport(&mut self, element: &Element) {
        self.expect(
            element,
            &["geometry", "origin", "size", "ratio", "bgcolor", "clear_color"],
            &["name", "fixed", "ratio", "type"],
        );
        let rectangle = self.rectangle(element);
        let clear_color = match self.single(element, &["bgcolor", "clear_color"]) {
            Some(color) => self.color(color),
            None => Some(Vec4::new(0.0, 0.0, 0.0, 1.0)),
        };
        if let Some(name) = self.required(element, "name") {
            let item = rectangle.zip(clear_color).map(|((origin, size), clear_color)| Viewport {
                name: name.text.clone(),
                origin,
                size,
                clear_color,
            });
            self.viewports.add(&mut self.report, name, item);
        }
    }

    /// Origin and size of a viewport. Missing values mean the whole window; a missing height follows from `ratio`.
    fn rectangle(&mut self, element: &Element) -> Option<([f32; 2], [f32; 2])> {
        let geometry = self.single(element, &["geometry", "origin"]);
        let sizes = match geometry.filter(|geometry| geometry.is(&["geometry"])) {
            Some(geometry) => {
                for size in element.children_named(&["size"]) {
                    let message = format!("<{}> contradicts <{}> of line {}", size.name, geometry.name, geometry.line);
                    self.report.error(size.span, message);
                }
                Some(geometry)
            }
            None => self.single(element, &["size"]),
        };
        for part in geometry.into_iter().chain(sizes.filter(|size| size.is(&["size"]))) {
            let valid: &[&str] = if part.is(&["geometry"]) {
                &["x", "y", "width", "height"]
            } else if part.is(&["origin"]) {
                &["x", "y"]
            } else {
                &["width", "height"]
            };
            self.expect(part, &[], valid);
        }
        let has_ratio =
            element.attribute("ratio").is_some() || element.children.iter().any(|child| child.is(&["ratio"]));
        let mut component =
            |part: Option<&Element>, name: &str, default: f32| match part.and_then(|part| part.attribute(name)) {
                // Where there is a `ratio`, it replaces a height of 0.
                Some(value) if has_ratio && name == "height" && value.text.parse::<f32>() == Ok(0.0) => Some(0.0),
                Some(value) => self.number(value).filter(|number| self.in_rectangle(*number, name, value)),
                None => Some(default),
            };
        let (x, y) = (component(geometry, "x", 0.0), component(geometry, "y", 0.0));
        let (width, height) = (component(sizes, "width", 1.0), component(sizes, "height", f32::NAN));
        let (origin, width, mut height) = ([x?, y?], width?, height?);
        let ratio = self.single(element, &["ratio"]).and_then(|ratio| ratio.attribute("value"));
        let ratio = element.attribute("ratio").or(ratio);
        if height.is_nan() || height == 0.0 && ratio.is_some() {
            // The engine defines `ratio` as height divided by width.
            height = match ratio {
                Some(ratio) => {
                    let height = self.number(ratio)? * width;
                    self.in_rectangle(height, "height", ratio).then_some(height)?
                }
                None => 1.0,
            };
        }
        let size = [width, height];
        for axis in 0..2 {
            // A sum slightly above 1 is rounding: 0.66 + 0.34.
            if origin[axis] <= 1.0 && size[axis] <= 1.0 && origin[axis] + size[axis] > 1.001 {
                let at = sizes.or(geometry).map_or(element.span, |part| part.span);
                self.report.warning(at, "the viewport reaches past its target and is cut off there", || None);
                break;
            }
        }
        Some((origin, size))
    }

    fn in_rectangle(&mut self, number: f32, name: &str, value: &Value) -> bool {
        let is_size = matches!(name, "width" | "height");
        let valid = if is_size { number > 0.0 } else { number >= 0.0 } && number <= MAX_SIDE as f32;
        if !valid {
            let message = format!("{name} {} is out of range", value.shown());
            self.report.error_help(value.span, message, || {
                format!("valid: {} 0 up to {MAX_SIDE}", if is_size { "above" } else { "from" })
            });
        }
        valid
    }
}
