//! Writes a project without own shaders as XML that [`super::load`] reads back with the same numbers, bit for bit.
//!
//! Render targets and materials are written to a file in the same folder: `view.mlib` for `view.xml`.

mod library;
mod numbers;
mod passes;
mod xml;

use super::{Camera, Falloff, Light, Orthographic, Project, SceneDecl, Viewport};
use crate::color::ColorSpace;
use crate::files::write_atomically;
use crate::scene::{Placement, Shape, ShapeKind};
use glam::Vec3;
use library::Library;
use numbers::degrees;
use std::path::{Component, Path, PathBuf};
use xml::Xml;

/// Why a project could not be written.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The format cannot hold a name or a path.
    #[error(
        "`{0}` cannot stand in a project file\n       \
         valid: names and paths without `*`, `\\`, control characters, and white space at an end or doubled; rename it"
    )]
    Text(String),
    /// The file exists already. It is not overwritten, since a person may have edited it.
    #[error("{} is there already; name another file, or delete this one", .0.display())]
    Exists(PathBuf),
    /// An error of the file system.
    #[error("{}: {why}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The reason.
        why: String,
    },
}

impl WriteError {
    fn io(path: &Path, error: &std::io::Error) -> Self {
        Self::Io { path: path.to_owned(), why: error.to_string() }
    }
}

impl Project {
    /// Writes the project and its libraries. Existing files are not overwritten. Returns the paths written, the project first.
    ///
    /// # Errors
    /// If one of the files exists or cannot be written, or the format cannot hold a name or a path of the project.
    pub fn write(&self, path: &Path) -> Result<Vec<PathBuf>, WriteError> {
        let libraries = library::of(self, path);
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let folder = std::fs::canonicalize(folder).map_err(|error| WriteError::io(folder, &error))?;
        let mut files = vec![(path.to_owned(), self.document(&folder, &libraries)?)];
        for library in &libraries {
            files.push((library.path.clone(), library.document(self, &folder)?));
        }
        if let Some((path, _)) = files.iter().find(|(path, _)| path.exists()) {
            return Err(WriteError::Exists(path.clone()));
        }
        // The project is written last: the libraries are of no use without it.
        for (path, text) in files.iter().rev() {
            write_atomically(path, text.as_bytes()).map_err(|error| WriteError::io(path, &error))?;
        }
        Ok(files.into_iter().map(|(path, _)| path).collect())
    }

    /// The XML element of a camera, to be pasted into the `<cameras>` of a project; its numbers are read back bit for bit.
    ///
    /// # Errors
    /// If there is no such camera, or the format cannot hold its name.
    pub fn camera_xml(&self, camera: &str) -> Result<String, String> {
        let camera = &self.cameras[self.camera(camera)?];
        let mut xml = Xml::fragment();
        self.write_camera(&mut xml, camera);
        xml.finish().map_err(|error| error.to_string())
    }

    fn document(&self, folder: &Path, libraries: &[Library]) -> Result<String, WriteError> {
        let mut xml = Xml::new("Written by curitiba. docs/projects.md says what each element means.");
        let [width, height] = self.window.map(|side| side.to_string());
        let mut attributes = vec![("name", self.name.as_str()), ("width", &width), ("height", &height)];
        if self.color != ColorSpace::default() {
            attributes.push(("color", self.color.name()));
        }
        xml.begin("project", &attributes);
        xml.begin("assets", &[]);
        xml.begin("scenes", &[]);
        for scene in &self.scenes {
            write_scene(&mut xml, scene, folder)?;
        }
        xml.end();
        xml.begin("viewports", &[]);
        self.viewports.iter().for_each(|viewport| write_viewport(&mut xml, viewport));
        xml.end();
        xml.begin("cameras", &[]);
        self.cameras.iter().for_each(|camera| self.write_camera(&mut xml, camera));
        xml.end();
        xml.begin("lights", &[]);
        self.lights.iter().for_each(|light| write_light(&mut xml, light));
        xml.end();
        xml.begin("materialLibs", &[]);
        for library in libraries {
            let name = library.path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            xml.empty("mlib", &[("filename", name)]);
        }
        xml.end();
        xml.end();
        passes::write(&mut xml, self, libraries);
        xml.finish()
    }

    fn write_camera(&self, xml: &mut Xml, camera: &Camera) {
        let kind = if camera.orthographic.is_some() { "ortho" } else { "perspective" };
        xml.begin("camera", &[("name", &camera.name), ("type", kind)]);
        if let Some(viewport) = camera.viewport {
            xml.text("viewport", &self.viewports[viewport].name);
        }
        let [fov, near, far] = [degrees(camera.fov_y), camera.near.to_string(), camera.far.to_string()];
        match camera.orthographic {
            None => xml.empty("perspective", &[("fov", &fov), ("near", &near), ("far", &far)]),
            Some(Orthographic { left, right, bottom, top }) => {
                let sides = [left, right, bottom, top].map(|side| side.to_string());
                let named = ["left", "right", "bottom", "top"].into_iter().zip(sides.iter().map(String::as_str));
                let mut attributes: Vec<(&str, &str)> = named.collect();
                attributes.extend([("near", near.as_str()), ("far", far.as_str())]);
                xml.empty("ortho", &attributes);
            }
        }
        let [x, y, z] = camera.position.to_array().map(|component| component.to_string());
        xml.empty("position", &[("x", &x), ("y", &y), ("z", &z)]);
        vector(xml, "view", camera.direction);
        vector(xml, "up", camera.up);
        xml.end();
    }
}

/// Writes a vector; Rust formats each number with the fewest digits that are read back as the same number.
fn vector(xml: &mut Xml, name: &'static str, vector: Vec3) {
    let [x, y, z] = vector.to_array().map(|component| component.to_string());
    xml.empty(name, &[("x", &x), ("y", &y), ("z", &z)]);
}

fn color(xml: &mut Xml, name: &'static str, components: &[f32]) {
    let texts: Vec<String> = components.iter().map(f32::to_string).collect();
    let named = ["r", "g", "b", "a"].into_iter().zip(texts.iter().map(String::as_str));
    xml.empty(name, &named.collect::<Vec<_>>());
}

fn write_scene(xml: &mut Xml, scene: &SceneDecl, folder: &Path) -> Result<(), WriteError> {
    let words = [(scene.swap_yz, "SWAP_YZ"), (scene.unitize, "UNITIZE")];
    let param: Vec<&str> = words.into_iter().filter(|(on, _)| *on).map(|(_, word)| word).collect();
    let param = param.join(" ");
    let mut attributes = vec![("name", scene.name.as_str())];
    if !param.is_empty() {
        attributes.push(("param", &param));
    }
    xml.begin("scene", &attributes);
    for file in &scene.files {
        xml.text("file", &relative(&file.path, folder)?);
    }
    scene.shapes.iter().for_each(|shape| write_shape(xml, shape));
    for pattern in &scene.sky {
        let material = passes::pattern(xml, pattern);
        xml.empty("sky", &[("material", &material)]);
    }
    write_place(xml, &scene.place);
    xml.end();
    Ok(())
}

fn write_shape(xml: &mut Xml, shape: &Shape) {
    let mut attributes = vec![("name", shape.name.clone()), ("material", shape.material.clone())];
    match shape.kind {
        ShapeKind::Box => attributes.push(("type", "BOX".to_owned())),
        ShapeKind::Square => attributes.push(("type", "SQUARE".to_owned())),
        ShapeKind::Sphere { slices, stacks } => attributes.extend([
            ("type", "SPHERE".to_owned()),
            ("slices", slices.to_string()),
            ("stacks", stacks.to_string()),
        ]),
        ShapeKind::Axis => attributes.push(("type", "AXIS".to_owned())),
        ShapeKind::ExactSphere => attributes.extend([("type", "SPHERE".to_owned()), ("exact", "true".to_owned())]),
        ShapeKind::Grid { divisions, length } => attributes.extend([
            ("type", "GRID".to_owned()),
            ("divisions", divisions.to_string()),
            ("length", length.to_string()),
        ]),
    }
    let attributes: Vec<(&str, &str)> = attributes.iter().map(|(name, value)| (*name, value.as_str())).collect();
    xml.begin("geometry", &attributes);
    write_place(xml, &shape.place);
    xml.end();
}

/// Writes the parts of a placement that differ from the identity.
fn write_place(xml: &mut Xml, place: &Placement) {
    let usual = Placement::default();
    if place.translation != usual.translation {
        vector(xml, "TRANSLATE", place.translation);
    }
    if place.degrees != usual.degrees {
        let [x, y, z] = place.axis.to_array().map(|component| component.to_string());
        xml.empty("ROTATE", &[("x", &x), ("y", &y), ("z", &z), ("w", &place.degrees.to_string())]);
    }
    if place.scale != usual.scale {
        vector(xml, "SCALE", place.scale);
    }
    if place.order != usual.order {
        xml.empty("TRANSFORM_ORDER", &[("value", place.order)]);
    }
}

fn write_viewport(xml: &mut Xml, viewport: &Viewport) {
    xml.begin("viewport", &[("name", &viewport.name)]);
    let [x, y] = viewport.origin.map(|edge| edge.to_string());
    let [width, height] = viewport.size.map(|side| side.to_string());
    xml.empty("geometry", &[("x", &x), ("y", &y), ("width", &width), ("height", &height)]);
    color(xml, "bgcolor", &viewport.clear_color.to_array());
    xml.end();
}

fn write_light(xml: &mut Xml, light: &Light) {
    match light.direction {
        Some(travels) => {
            xml.begin("light", &[("name", &light.name), ("type", "directional")]);
            vector(xml, "direction", travels);
        }
        None => {
            xml.begin("light", &[("name", &light.name), ("type", light.kind())]);
            write_falloff(xml, &light.falloff);
        }
    }
    if let Some(place) = light.position {
        let [x, y, z] = place.to_array().map(|number| number.to_string());
        xml.empty("position", &[("x", &x), ("y", &y), ("z", &z)]);
    }
    color(xml, "color", &light.color.to_array());
    xml.end();
}

/// Writes the parts of a falloff that differ from the default.
fn write_falloff(xml: &mut Xml, Falloff { attenuation, range, spot }: &Falloff) {
    let usual = Falloff::default();
    let mut number = |name: &'static str, value: f32, usual: f32| {
        if value != usual {
            xml.empty(name, &[("value", &value.to_string())]);
        }
    };
    for (name, (value, usual)) in
        ["CONSTANT_ATT", "LINEAR_ATT", "QUADRATIC_ATT"].into_iter().zip(attenuation.iter().zip(usual.attenuation))
    {
        number(name, *value, usual);
    }
    number("RANGE", *range, usual.range);
    if let Some(spot) = spot {
        number("SPOT_CUTOFF", spot.cutoff, 180.0);
        number("SPOT_INNER", spot.inner, spot.cutoff);
        number("SPOT_EXPONENT", spot.exponent, 0.0);
        vector(xml, "SPOT_DIRECTION", spot.axis);
    }
}

/// A path as the project file names it: relative to the project's folder, or absolute if the path and the folder have only the root in
/// common.
fn relative(path: &Path, folder: &Path) -> Result<String, WriteError> {
    let whole = std::fs::canonicalize(path).or_else(|_| std::path::absolute(path));
    let whole = whole.map_err(|error| WriteError::io(path, &error))?;
    let common = whole.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    let shares = whole.components().take(common).any(|part| matches!(part, Component::Normal(_)));
    let wanted = if shares {
        let up = folder.components().skip(common).map(|_| Component::ParentDir);
        up.chain(whole.components().skip(common)).collect::<PathBuf>()
    } else {
        whole
    };
    let unusable = || WriteError::Text(path.display().to_string());
    let text = wanted.to_str().ok_or_else(unusable)?;
    if std::path::MAIN_SEPARATOR == '\\' {
        // Paths with slashes work on every system; a path with a drive works on this machine only.
        return if text.contains(':') { Err(unusable()) } else { Ok(text.replace('\\', "/")) };
    }
    // The reader would convert a backslash to a slash.
    if text.contains('\\') { Err(unusable()) } else { Ok(text.to_owned()) }
}

#[cfg(test)]
mod tests;
