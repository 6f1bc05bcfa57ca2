//! Scenes, viewports, cameras, lights and constants.

use super::dom::{Element, Value};
use super::loader::Loader;
use super::report::{Span, suggest};
use super::values::MAX_SIDE;
use super::{Camera, Light, SceneDecl, SceneFile, Viewport};
use glam::{Vec3, Vec4};

/// Engine elements and attributes that change nothing that is rendered here: they are read over.
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
    /// Reads `<assets>`: constants first, for the others use them, and viewports before cameras.
    pub fn assets(&mut self, root: &Element) {
        const LISTS: &[&str] = &["constants", "scenes", "viewports", "cameras", "lights", "materialLibs"];
        if root.children_named(&["assets"]).next().is_none() {
            self.report.error(root.span, "the project has no <assets>");
        }
        for assets in root.children_named(&["assets"]) {
            self.expect(assets, &[LISTS, OTHER_ASSETS].concat(), &[]);
        }
        self.list(root, "constants", &["constant"], Self::constant);
        self.list(root, "materialLibs", &["mlib", "materialLib"], Self::library);
        self.list(root, "viewports", &["viewport"], Self::viewport);
        self.list(root, "scenes", &["scene"], Self::scene);
        self.list(root, "cameras", &["camera"], Self::camera);
        self.list(root, "lights", &["light"], Self::light);
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

    fn scene(&mut self, element: &Element) {
        const KNOWN: [&str; 4] = ["name", "type", "param", "filename"];
        self.stray_text(element);
        self.expect_children(element, &["file", "folder", "geometry", "translate", "rotate", "scale"]);
        let mut files = Vec::new();
        let mut whole = true;
        for attribute in &element.attributes {
            let (written, name) = (&attribute.name, attribute.name.to_ascii_lowercase());
            if ["scale", "trans", "rot"].iter().any(|start| name.starts_with(start)) {
                let message = format!("`{written}` of a scene is not supported");
                self.report.error_help(attribute.name_span, message, || "place objects in the scene file".to_owned());
                whole = false;
            } else if !KNOWN.contains(&name.as_str()) {
                let message = format!("attribute `{written}` of <{}> is not known: it is ignored", element.name);
                self.report.warning(attribute.name_span, message, || Some(suggest(written, KNOWN)));
            }
        }
        if let Some(path) = element.attribute("filename") {
            whole &= self.scene_file(element, path, &mut files).is_some();
        }
        for child in &element.children {
            if child.is(&["file"]) {
                self.expect_children(child, &[]);
                self.expect_attributes(child, &["name"]);
                match self.reference(child) {
                    Some(path) => whole &= self.scene_file(child, path, &mut files).is_some(),
                    None => whole = false,
                }
            } else if child.is(&["folder", "geometry", "translate", "rotate", "scale"]) {
                let message = format!("<{}> in a scene is not supported", child.name);
                self.report.error_help(child.span, message, || "valid: <file>".to_owned());
                whole = false;
            }
        }
        let (swap_yz, unitize) = self.scene_parameters(element);
        if files.is_empty() && whole {
            self.report.error_help(element.span, "the scene names no file", || {
                "valid: <file>path</file>, <file name=\"path\"/>".to_owned()
            });
        }
        if let Some(name) = self.required(element, "name") {
            let item = whole.then(|| SceneDecl { name: name.text.clone(), files, swap_yz, unitize });
            self.scenes.add(&mut self.report, name, item);
        }
    }

    fn scene_file(&mut self, element: &Element, path: &Value, files: &mut Vec<SceneFile>) -> Option<()> {
        let path = self.folder.resolve(&mut self.report, path)?;
        files.push(SceneFile { path, place: self.place(element) });
        Some(())
    }

    fn scene_parameters(&mut self, element: &Element) -> (bool, bool) {
        let (mut swap_yz, mut unitize) = (false, false);
        let Some(value) = element.attribute("param") else { return (false, false) };
        for word in value.text.split([' ', ',', '|', ';']).filter(|word| !word.is_empty()) {
            match word.to_ascii_uppercase().as_str() {
                "SWAP_YZ" => swap_yz = true,
                "UNITIZE" => unitize = true,
                _ => {
                    let message = format!("`{}` is not a parameter of scenes", super::report::shown(word));
                    self.report.error_help(value.span, message, || suggest(word, ["SWAP_YZ", "UNITIZE"]));
                }
            }
        }
        (swap_yz, unitize)
    }

    fn viewport(&mut self, element: &Element) {
        self.expect(
            element,
            &["geometry", "origin", "size", "bgcolor", "clear_color"],
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

    /// Origin and size. What is missing is the whole window; a missing height follows from `ratio`.
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
        let mut component =
            |part: Option<&Element>, name: &str, default: f32| match part.and_then(|part| part.attribute(name)) {
                Some(value) => self.number(value).filter(|number| self.in_rectangle(*number, name, value)),
                None => Some(default),
            };
        let (x, y) = (component(geometry, "x", 0.0), component(geometry, "y", 0.0));
        let (width, height) = (component(sizes, "width", 1.0), component(sizes, "height", f32::NAN));
        let (origin, width, mut height) = ([x?, y?], width?, height?);
        if height.is_nan() {
            // The engine's `ratio` is height over width.
            height = match element.attribute("ratio") {
                Some(ratio) => {
                    let height = self.number(ratio)? * width;
                    self.in_rectangle(height, "height", ratio).then_some(height)?
                }
                None => 1.0,
            };
        }
        let size = [width, height];
        for axis in 0..2 {
            // A little over 1 is rounding: 0.66 + 0.34.
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

    fn camera(&mut self, element: &Element) {
        const CHILDREN: &[&str] = &[
            "viewport",
            "perspective",
            "projection",
            "type",
            "projection_type",
            "fov",
            "near",
            "far",
            "position",
            "view",
            "look_at_point",
            "up",
        ];
        self.expect(element, CHILDREN, &["name", "type"]);
        let Some(name) = self.required(element, "name") else { return };
        let viewport = match self.single(element, &["viewport"]) {
            Some(reference) => self
                .reference(reference)
                .and_then(|name| self.viewports.names.resolve(&mut self.report, &name.text, name.span))
                .map(Some),
            None => Some(None),
        };
        let lens = self.lens(element);
        let pose = self.pose(element, name);
        let item = (|| {
            let ((fov_y, near, far), (position, direction, up)) = (lens?, pose?);
            Some(Camera { name: name.text.clone(), position, direction, up, fov_y, near, far, viewport: viewport? })
        })();
        self.cameras.add(&mut self.report, name, item);
    }

    /// Vertical angle in radians, near and far distance. What is missing is as in the engine: 60 degrees, 1, 10,000.
    fn lens(&mut self, element: &Element) -> Option<(f32, f32, f32)> {
        let lens = self.single(element, &["perspective", "projection"]);
        if let Some(lens) = lens {
            self.expect(lens, &[], &["type", "fov", "near", "far"]);
        }
        // In 2014 the type is an attribute of the camera, today of the projection or an element of its own.
        let mut value_of = |name: &str| -> Result<Option<Value>, ()> {
            let own = self.single(element, &[name]);
            let inside = lens.and_then(|lens| lens.attribute(name));
            match (inside, own) {
                (Some(_), Some(own)) => {
                    self.report.error(own.span, format!("<{}> is given twice", own.name));
                    Err(())
                }
                (Some(value), None) => Ok(Some(value.clone())),
                (None, Some(own)) => self.required(own, "value").map(|value| Some(value.clone())).ok_or(()),
                (None, None) => Ok(None),
            }
        };
        let (kind, fov, near, far) = (value_of("type"), value_of("fov"), value_of("near"), value_of("far"));
        let kinds = kind.ok()?.into_iter().chain(element.attribute("type").cloned());
        let mut valid = true;
        for kind in kinds.filter(|kind| !kind.text.eq_ignore_ascii_case("perspective")) {
            let message = format!("`{}` is not a projection", kind.shown());
            self.report.error_help(kind.span, message, || "valid: perspective".to_owned());
            valid = false;
        }
        let fov_span = fov.as_ref().ok().and_then(|fov| fov.as_ref().map(|fov| fov.span));
        let far_span = far.as_ref().ok().and_then(|far| far.as_ref().map(|far| far.span));
        let near_span = near.as_ref().ok().and_then(|near| near.as_ref().map(|near| near.span));
        let mut number = |value: Result<Option<Value>, ()>, default: f32| match value {
            Ok(Some(value)) => self.number(&value),
            Ok(None) => Some(default),
            Err(()) => None,
        };
        let (fov, near, far) = (number(fov, 60.0), number(near, 1.0), number(far, 10_000.0));
        let at = |span: Option<Span>| span.unwrap_or(lens.map_or(element.span, |lens| lens.span));
        if let Some(fov) = fov.filter(|fov| !(*fov > 0.0 && *fov < 180.0)) {
            self.report.error_help(at(fov_span), format!("a field of view of {fov} degrees"), || {
                "valid: above 0 and below 180 degrees, vertical".to_owned()
            });
            valid = false;
        }
        let (fov, near, far) = (fov?, near?, far?);
        if near <= 0.0 {
            self.report.error_help(at(near_span), format!("a near distance of {near}"), || "valid: above 0".to_owned());
            valid = false;
        } else if far <= near {
            self.report.error_help(
                at(far_span),
                format!("the far distance {far} is not beyond the near one, {near}"),
                || format!("valid: above {near}"),
            );
            valid = false;
        }
        valid.then_some((fov.to_radians(), near, far))
    }

    /// Position, unit direction and up. What is missing is as in the engine: the origin, -z and y; notes say so.
    fn pose(&mut self, element: &Element, name: &Value) -> Option<(Vec3, Vec3, Vec3)> {
        let position = match self.single(element, &["position"]) {
            Some(position) => self.vector(position),
            None => {
                self.report.note(element.span, format!("camera `{}` stands at the origin", name.shown()));
                Some(Vec3::ZERO)
            }
        };
        let target = self.single(element, &["view", "look_at_point"]);
        let direction = match target {
            Some(view) if view.is(&["view"]) => self.direction(view),
            Some(point) => self.vector(point).and_then(|target| {
                // In f64: the difference of large finite vectors overflows f32.
                let unit = (target.as_dvec3() - position?.as_dvec3()).try_normalize().map(|unit| unit.as_vec3());
                if unit.is_none() {
                    self.report.error(point.span, "the camera looks at the point where it stands");
                }
                unit
            }),
            None => {
                self.report.note(element.span, format!("camera `{}` looks along -z", name.shown()));
                Some(Vec3::NEG_Z)
            }
        };
        let up_element = self.single(element, &["up"]);
        let up = up_element.map_or(Some(Vec3::Y), |up| self.direction(up));
        let (position, direction, up) = (position?, direction?, up?);
        // Below this sine the image's horizontal axis is rounding noise.
        if direction.cross(up).length() < 1e-4 {
            let at = up_element.or(target).map_or(element.span, |part| part.span);
            self.report.error(at, "the camera's up vector is parallel to its view");
            return None;
        }
        Some((position, direction, up))
    }

    fn light(&mut self, element: &Element) {
        const CHILDREN: &[&str] = &[
            "position",
            "direction",
            "color",
            "diffuse",
            "ambient",
            "specular",
            "attenuation",
            "constant_att",
            "linear_att",
            "quad_att",
        ];
        self.expect(element, CHILDREN, &["name", "type", "class"]);
        let Some(name) = self.required(element, "name") else { return };
        let position = self.single(element, &["position"]);
        let position_valid = position.is_none_or(|position| self.vector(position).is_some());
        let direction = match self.single(element, &["direction"]) {
            Some(direction) => self.direction(direction).map(Some),
            None => Some(None),
        };
        let color = match self.single(element, &["color", "diffuse"]) {
            Some(color) => self.color(color).map(Vec4::truncate),
            None => Some(Vec3::ONE),
        };
        for unused in ["ambient", "specular"] {
            if let Some(color) = self.single(element, &[unused]) {
                self.color(color);
            }
        }
        if position.is_none() && direction == Some(None) {
            let message = format!("light `{}` has neither a direction nor a position", name.shown());
            self.report.error_help(element.span, message, || "valid: <direction x y z/>".to_owned());
        }
        if let Some(kind) = element.attribute("type")
            && !kind.text.eq_ignore_ascii_case("directional")
            && direction.is_some_and(|direction| direction.is_some())
        {
            let message = format!("light `{}` shines as a directional one", name.shown());
            self.report.warning(kind.span, message, || Some("valid: directional".to_owned()));
        }
        let item = (|| Some(Light { name: name.text.clone(), direction: direction?, color: color? }))();
        self.lights.add(&mut self.report, name, item.filter(|_| position_valid));
    }
}
