//! Reading material libraries.

use super::dom::{Element, Value};
use super::libraries::{Binding, Library, LibraryMaterial, ROOT, Shader, State, Texture, ValueOf};
use super::loader::Loader;
use super::report::{Found, shown, suggest};
use super::{Channel, ChannelRef, RenderTarget, file};
use crate::glsl::{self, Blend, BlendFactor, Drawn, Side};
use crate::image::PixelFormat;
use crate::scene::texture::Magnification;
use glam::Vec4;
use std::rc::Rc;

/// Greatest number of libraries of a project.
const MAX_LIBRARIES: usize = 64;

/// Greatest number of colour channels of a render target.
const MAX_CHANNELS: usize = 32;

/// `<COMPARE_FUNC value="…"/>` of a bound texture.
fn compare(texture: &Element) -> Option<Value> {
    texture.child_value("compare_func").cloned()
}

/// `<MAG_FILTER value="…"/>` of a bound texture.
fn magnification(texture: &Element) -> Magnification {
    let nearest = |value: &Value| value.text.eq_ignore_ascii_case("NEAREST");
    if texture.child_value("mag_filter").is_some_and(nearest) { Magnification::Nearest } else { Magnification::Linear }
}

impl Loader {
    /// Reads the library that `<mlib filename="…"/>` names.
    pub fn library(&mut self, element: &Element) {
        self.expect(element, &[], &["filename", "name"]);
        let read = self.read_library(element);
        self.libraries.incomplete |= read.is_none();
    }

    fn read_library(&mut self, element: &Element) -> Option<()> {
        let value = self.required(element, "filename")?;
        let path = self.folder.resolve(&mut self.report, value)?;
        let same = std::fs::canonicalize(&path).unwrap_or_else(|_| path.clone());
        if self.libraries.files.contains(&same) {
            self.report.warning(value.span, format!("{} is listed twice: it is read once", path.display()), || None);
            return Some(());
        }
        if self.libraries.files.len() == MAX_LIBRARIES {
            self.report.error(value.span, format!("more than {MAX_LIBRARIES} material libraries"));
            return None;
        }
        self.libraries.files.push(same);
        let root = self.document(&path, Some(value.span))?;
        if !root.is(ROOT) {
            let message = format!("a material library does not start with <{}>", root.name);
            self.report.error_help(root.span, message, || "valid: <materialLib>".to_owned());
            return None;
        }
        const PARTS: &[&str] = &[
            "renderTargets",
            "shaders",
            "materials",
            "textures",
            "states",
            "samplers",
            "buffers",
            "arraysOfTextures",
            "imageTextures",
        ];
        self.expect(&root, PARTS, &["name"]);
        let name = self.required(&root, "name")?;
        // As in the engine, a second file of the same library name extends the first library. Both files must be in the same
        // folder, because their paths are relative to the folder of the library.
        let same = match self.libraries.names.find(&name.text) {
            Found::Exact(index) if self.libraries.list[index].path.parent() == path.parent() => Some(index),
            _ => None,
        };
        let mut library = match same {
            Some(index) => {
                let first = self.libraries.list[index].path.display().to_string();
                self.report.note(name.span, format!("this adds to the library `{}` of {first}", name.shown()));
                std::mem::replace(&mut self.libraries.list[index], Library::new(&name.text, path))
            }
            None => {
                self.libraries.names.declare(&mut self.report, &name.text, name.span);
                Library::new(&name.text, path)
            }
        };
        for list in root.children_named(&["renderTargets"]) {
            self.expect(list, &["renderTarget"], &[]);
            list.children_named(&["renderTarget"]).for_each(|target| self.render_target(&mut library, target));
        }
        for list in root.children_named(&["textures"]) {
            self.expect(list, &["texture", "cubeMap"], &[]);
            for texture in list.children_named(&["texture", "cubeMap"]) {
                if let Some(name) = self.required(texture, "name") {
                    library.texture_names.declare(&mut self.report, &name.text, name.span);
                    let file = texture.attribute("filename").filter(|_| texture.is(&["texture"]));
                    let found = match file {
                        Some(file) => Texture::File(file.clone()),
                        None if texture.is(&["cubeMap"]) => Texture::Cube(Rc::new(texture.tag())),
                        None => self.image_texture(&library.name, texture, &name.text),
                    };
                    library.textures.push(found);
                }
            }
        }
        self.texture_arrays(&mut library, &root);
        self.buffers(&mut library, &root);
        for list in root.children_named(&["states"]) {
            list.children_named(&["state"]).for_each(|state| self.state(&mut library, state));
        }
        for list in root.children_named(&["shaders"]) {
            self.expect(list, &["shader"], &[]);
            list.children_named(&["shader"]).for_each(|shader| self.shader(&mut library, shader));
        }
        for list in root.children_named(&["materials"]) {
            self.expect(list, &["material"], &[]);
            list.children_named(&["material"]).for_each(|material| self.library_material(&mut library, material));
        }
        match same {
            Some(index) => self.libraries.list[index] = library,
            None => self.libraries.list.push(library),
        }
        Some(())
    }

    fn render_target(&mut self, library: &mut Library, element: &Element) {
        const CHILDREN: &[&str] =
            &["size", "clear", "clear_values", "colors", "depth", "stencil", "depthStencil", "multisampling", "levels"];
        self.expect(element, CHILDREN, &["name"]);
        if let Some(multisampling) = self.single(element, &["multisampling"]) {
            let help = || Some("ask for a larger size instead".to_owned());
            self.report.warning(multisampling.span, "multisampling is not supported: it is ignored", help);
        }
        let size = match self.single(element, &["size"]) {
            Some(size) => {
                self.expect(size, &[], &["width", "height"]);
                let sides =
                    ["width", "height"].map(|name| self.required(size, name).and_then(|value| self.side(value)));
                sides[0].zip(sides[1])
            }
            None => {
                self.report.error_help(element.span, "the render target has no size", || {
                    "valid: <size width=\"1024\" height=\"1024\"/>".to_owned()
                });
                None
            }
        };
        let clear_color = match self.single(element, &["clear", "clear_values"]) {
            Some(color) if ["r", "g", "b", "a"].iter().any(|part| color.attribute(part).is_some()) => self.color(color),
            _ => Some(Vec4::W),
        };
        let index = self.libraries.targets.len();
        let mut channels = Vec::new();
        let mut declared: Vec<&Value> = Vec::new();
        let mut whole = true;
        for list in element.children_named(&["colors"]) {
            self.expect(list, &["color"], &[]);
            for color in list.children_named(&["color"]) {
                self.expect(color, &[], &["name", "format", "internalFormat", "type", "mipmap", "layers"]);
                let (name, format) = (self.required(color, "name"), self.format(color));
                declared.extend(name);
                match (name, format) {
                    (Some(name), Some(format)) => {
                        channels.push(Channel { name: name.text.clone(), format, depth: false });
                    }
                    _ => whole = false,
                }
            }
        }
        if let Some(beyond) = declared.get(MAX_CHANNELS) {
            self.report.error(beyond.span, format!("more than {MAX_CHANNELS} colour channels"));
            declared.truncate(MAX_CHANNELS);
            whole = false;
        }
        // A pass writes at most three channels, so the depth is kept only after at most two colours.
        let depth = element.children_named(&["depth"]).find_map(|depth| depth.attribute("name"));
        let depth = depth.filter(|_| glsl::AVAILABLE && whole && channels.len() < glsl::MAX_OUTPUTS);
        let depth = depth.map(|name| {
            channels.push(Channel { name: name.text.clone(), format: PixelFormat::Rgba32Float, depth: true });
            channels.len() - 1
        });
        let target_name = self.required(element, "name");
        let target = match (size, clear_color, target_name) {
            (Some((width, height)), Some(clear_color), Some(name)) if whole => Some(RenderTarget {
                library: library.name.clone(),
                name: name.text.clone(),
                size: [width, height],
                clear_color,
                buffer: None,
                contents: None,
                channels,
            }),
            _ => None,
        };
        for (channel, name) in declared.into_iter().enumerate() {
            library.texture_names.declare(&mut self.report, &name.text, name.span);
            library.textures.push(Texture::Channel(target.is_some().then_some(ChannelRef { target: index, channel })));
        }
        for parent in element.children_named(&["depth", "stencil", "depthStencil"]) {
            if let Some(name) = parent.attribute("name") {
                library.texture_names.declare(&mut self.report, &name.text, name.span);
                let channel = depth.filter(|_| target.is_some() && parent.is(&["depth"]));
                library.textures.push(match channel {
                    Some(channel) => Texture::Channel(Some(ChannelRef { target: index, channel })),
                    None => Texture::Depth,
                });
            }
        }
        let mipmap = element.children_named(&["colors"]).flat_map(|list| list.children_named(&["color"]));
        let mipmap = mipmap.filter_map(|color| color.attribute("mipmap")).next();
        let levels = self.levels(element, mipmap, target.as_ref().map_or([1; 2], |target| target.size));
        if levels > 0 && target.is_some() {
            let colors = target.iter().flat_map(|target| &target.channels).filter(|channel| !channel.depth);
            let channels = (0..colors.count()).map(|channel| (ChannelRef { target: index, channel }, levels));
            self.libraries.levels.extend(channels);
        }
        if let Some(name) = target_name {
            library.target_names.declare(&mut self.report, &name.text, name.span);
            library.target_indices.push(target.is_some().then_some(index));
        }
        self.libraries.targets.extend(target);
    }

    fn format(&mut self, color: &Element) -> Option<PixelFormat> {
        let value = self.required(color, "internalFormat")?;
        self.format_named(value)
    }

    /// The pixel format that `value` names; `None` after an error.
    pub fn format_named(&mut self, value: &Value) -> Option<PixelFormat> {
        let found = PixelFormat::named(&value.text);
        if found.is_none() {
            self.report.error_help(value.span, format!("`{}` is not a format", value.shown()), || {
                suggest(&value.text, PixelFormat::NAMED.iter().map(|(name, _)| *name))
            });
        }
        found
    }

    fn shader(&mut self, library: &mut Library, element: &Element) {
        let Some(name) = self.required(element, "name") else { return };
        library.shader_names.declare(&mut self.report, &name.text, name.span);
        // A compute shader has no pixel shader.
        let stem = element.attribute("ps").map_or("", file::stem).to_owned();
        const OTHERS: [(&str, &str); 4] = [
            ("gs", "a geometry shader"),
            ("tc", "a tessellation shader"),
            ("te", "a tessellation shader"),
            ("ms", "a mesh shader"),
        ];
        let others = OTHERS.iter().filter_map(|(name, what)| Some((*what, element.attribute(name)?.span)));
        library.shaders.push(Shader {
            name: name.text.clone(),
            stem,
            vertex: element.attribute("vs").cloned(),
            pixel: element.attribute("ps").cloned(),
            compute: element.attribute("cs").cloned(),
            others: others.collect(),
        });
    }

    fn library_material(&mut self, library: &mut Library, element: &Element) {
        const CHILDREN: &[&str] = &[
            "color",
            "shader",
            "textures",
            "state",
            "imageTextures",
            "buffers",
            "arrayOfTextures",
            "arraysOfTextures",
            "arraysOfImageTexture",
        ];
        self.expect(element, CHILDREN, &["name"]);
        let Some(name) = self.required(element, "name") else { return };
        library.material_names.declare(&mut self.report, &name.text, name.span);
        let shader = match self.single(element, &["shader"]) {
            Some(shader) => self.material_shader(library, shader).map(Some),
            None => Some(None),
        };
        let lists = element.children_named(&["shader"]).flat_map(|shader| shader.children_named(&["values"]));
        let values = lists.flat_map(|list| list.children_named(&["valueof"])).filter_map(ValueOf::new).collect();
        // Defaults of the engine.
        let (mut diffuse, mut emission) = (Some(Vec4::new(0.8, 0.8, 0.8, 1.0)), Some(Vec4::new(0.0, 0.0, 0.0, 1.0)));
        let defaults = crate::scene::Material::default();
        let (mut ambient, mut specular) = (Some(defaults.ambient), Some(defaults.specular));
        let mut shininess = Some(defaults.shininess);
        if let Some(colors) = self.single(element, &["color"]) {
            self.expect(colors, &["ambient", "diffuse", "specular", "emission", "shininess"], &[]);
            for part in &colors.children {
                if part.is(&["shininess"]) {
                    shininess = self.number_of(part, "value");
                } else if part.is(&["ambient", "diffuse", "specular", "emission"]) {
                    let color = self.color(part);
                    if part.is(&["diffuse"]) {
                        diffuse = color;
                    } else if part.is(&["emission"]) {
                        emission = color;
                    } else if part.is(&["ambient"]) {
                        ambient = color;
                    } else {
                        specular = color;
                    }
                }
            }
        }
        let state = element.children_named(&["state"]).find_map(|state| state.attribute("name"));
        let state = state.and_then(|state| library.states.get(&state.text).copied()).unwrap_or_default();
        let mut textures = Some(Vec::new());
        for texture in element
            .children_named(&["textures"])
            .flat_map(|list| &list.children)
            .filter(|texture| texture.is(&["texture"]))
        {
            let binding = self.binding(texture);
            textures = textures.zip(binding).map(|(mut textures, binding)| {
                textures.push(binding);
                textures
            });
        }
        let buffers = self.bound_buffers(element);
        let mut images = self.bound_images(element);
        let arrays = self.bound_arrays(library, element, (&mut textures, &mut images));
        let material = (|| {
            Some(LibraryMaterial {
                name: name.text.clone(),
                diffuse: diffuse?,
                emission: emission?,
                ambient: ambient?,
                specular: specular?,
                shininess: shininess?,
                shader: shader?,
                values,
                textures: textures?,
                buffers,
                images: images?,
                arrays: arrays?,
                state,
            })
        })();
        library.materials.push(material.map(Rc::new));
    }

    /// Reads `<texture unit="0" name="…"/>`.
    fn binding(&mut self, element: &Element) -> Option<Binding> {
        let (unit, name) = (self.unit_of(element, "unit"), self.required(element, "name"));
        let (compare, magnification) = (compare(element), magnification(element));
        Some(Binding { unit: unit?, library: None, name: name?.clone(), compare, magnification })
    }

    /// Reads `<texture name="…" fromLibrary="…" toUnit="1"/>`.
    pub fn injected_texture(&mut self, element: &Element) -> Option<Binding> {
        let (unit, name) = (self.unit_of(element, "toUnit"), self.required(element, "name"));
        let library = self.required(element, "fromLibrary").and_then(|library| self.find_library(library));
        let (compare, magnification) = (compare(element), magnification(element));
        Some(Binding { unit: unit?, library: Some(library?), name: name?.clone(), compare, magnification })
    }

    pub fn unit_of(&mut self, element: &Element, attribute: &str) -> Option<u32> {
        const UNITS: f32 = 256.0;
        let unit_value = self.required(element, attribute)?;
        let unit = self.number(unit_value)?;
        if unit.fract() != 0.0 || !(0.0..UNITS).contains(&unit) {
            let message = format!("`{}` is not a texture unit", unit_value.shown());
            self.report.error_help(unit_value.span, message, || "valid: 0..=255".to_owned());
            return None;
        }
        Some(unit as u32)
    }

    /// Reads a render state: `CULL_TYPE` applies unless `CULL_FACE` is off.
    fn state(&mut self, library: &mut Library, element: &Element) {
        let Some(name) = self.required(element, "name") else { return };
        let value = |name: &str| element.child_value(name);
        let on = value("cull_face").is_none_or(|value| self.boolean(value) != Some(false));
        let side = match value("cull_type").map(|value| value.text.to_ascii_uppercase()).as_deref() {
            Some("FRONT") => Some(Side::Front),
            Some("BACK") => Some(Side::Back),
            _ => None,
        };
        let is = |name: &str, wanted: bool| {
            let names: [&str; 2] = if wanted { ["true", "1"] } else { ["false", "0"] };
            value(name).is_some_and(|value| names.iter().any(|name| value.text.eq_ignore_ascii_case(name)))
        };
        let (tests_depth, writes_depth) = (!is("DEPTH_TEST", false), !is("DEPTH_MASK", false));
        let mut drawn = Drawn { culled: side.filter(|_| on), tests_depth, writes_depth, ..Drawn::default() };
        let mut other = None;
        if is("BLEND", true) {
            // The engine's defaults for factors that the state does not give.
            let factor = |name: &str, own| value(name).map_or(Some(own), |value| BlendFactor::named(&value.text));
            let source = factor("BLEND_SRC", BlendFactor::One);
            let destination = factor("BLEND_DST", BlendFactor::Zero);
            let adds = value("BLEND_EQUATION").is_none_or(|value| value.text.eq_ignore_ascii_case("ADD"));
            match source.zip(destination).filter(|_| adds) {
                Some((source, destination)) => drawn.blend = Some(Blend { source, destination }),
                None => other = Some("a BLEND of another kind"),
            }
        }
        library.states.insert(name.text.clone(), State { drawn, other });
    }

    /// Reads `<shader><name>X</name>…</shader>` or `<shader name="X">…</shader>`.
    fn material_shader(&mut self, library: &Library, element: &Element) -> Option<usize> {
        let inner = self.single(element, &["name"]);
        let name = match (element.attribute("name"), inner) {
            (None, Some(inner)) => match &inner.text {
                Some(name) => name,
                None => {
                    self.report.error(inner.span, "the shader's <name> is empty");
                    return None;
                }
            },
            _ => self.required(element, "name")?,
        };
        library.shader_names.resolve(&mut self.report, &name.text, name.span)
    }

    /// The index of a library that a file names.
    pub fn find_library(&mut self, name: &Value) -> Option<usize> {
        if self.libraries.incomplete && matches!(self.libraries.names.find(&name.text), Found::Missing) {
            // The library may be in the file that could not be read, for which there is an error already.
            return None;
        }
        self.libraries.names.resolve(&mut self.report, &name.text, name.span)
    }

    /// The material `name` of the library `from`.
    pub fn find_material(&mut self, from: &Value, name: &Value) -> Option<(usize, Rc<LibraryMaterial>)> {
        let library = self.find_library(from)?;
        let index = self.libraries.list[library].material_names.resolve(&mut self.report, &name.text, name.span)?;
        Some((library, self.libraries.list[library].materials[index].clone()?))
    }

    /// The render target that `<rendertarget name fromLibrary/>` names.
    pub fn find_target(&mut self, element: &Element) -> Option<usize> {
        self.expect(element, &[], &["name", "fromLibrary"]);
        let (name, from) = (self.required(element, "name"), self.required(element, "fromLibrary"));
        let library = self.find_library(from?)?;
        let library = &self.libraries.list[library];
        let index = library.target_names.resolve(&mut self.report, &name?.text, name?.span)?;
        library.target_indices[index]
    }

    /// The channel of the texture `name` of a library. `value` is the value that names the texture, for messages. `None` after an error.
    pub fn find_channel(&mut self, library: usize, name: &str, value: &Value) -> Option<ChannelRef> {
        let library = &self.libraries.list[library];
        let index = library.texture_names.resolve(&mut self.report, name, value.span)?;
        let why = match &library.textures[index] {
            Texture::Channel(channel) => return *channel,
            Texture::Depth => "is a depth buffer: only colour channels can be read",
            Texture::File(_) | Texture::Cube(_) | Texture::Other => {
                "is not a channel of a render target: only those can be read"
            }
        };
        self.report.error_help(value.span, format!("`{}` {why}", shown(name)), || {
            let channels = library.texture_names.iter().zip(&library.textures);
            suggest(name, channels.filter(|(_, kind)| matches!(kind, Texture::Channel(_))).map(|(name, _)| name))
        });
        None
    }

    /// The channel for `Library::name`, or for `name` alone. A `name` alone is looked up in the library `own` if there is one,
    /// otherwise in the only library that has it.
    pub fn find_texture(&mut self, value: &Value, own: Option<usize>) -> Option<ChannelRef> {
        if let Some((library, name)) = value.text.split_once("::") {
            let from = Value { text: library.trim().to_owned(), joined: None, span: value.span };
            let library = self.find_library(&from)?;
            return self.find_channel(library, name.trim(), value);
        }
        if let Some(own) = own {
            return self.find_channel(own, &value.text, value);
        }
        let has = |library: &Library| matches!(library.texture_names.find(&value.text), Found::Exact(_));
        let holders: Vec<usize> =
            (0..self.libraries.list.len()).filter(|index| has(&self.libraries.list[*index])).collect();
        match holders[..] {
            [only] => self.find_channel(only, &value.text, value),
            [] if self.libraries.incomplete => None,
            [] => {
                self.report.error_help(value.span, format!("there is no texture `{}`", value.shown()), || {
                    let channels = self.libraries.targets.iter().flat_map(|target| {
                        target.channels.iter().map(|channel| format!("{}::{}", target.library, channel.name))
                    });
                    let names: Vec<String> = channels.collect();
                    suggest(&value.text, names.iter().map(String::as_str))
                });
                None
            }
            _ => {
                self.report.error_help(value.span, format!("`{}` is in several libraries", value.shown()), || {
                    let names =
                        holders.iter().map(|index| format!("{}::{}", self.libraries.list[*index].name, value.shown()));
                    format!("valid: {}", names.collect::<Vec<_>>().join(", "))
                });
                None
            }
        }
    }
}
