//! Pipelines, and the common parts of passes of every class: scenes, camera, lights, viewport, render target, material maps.

use super::dom::{Element, Value};
use super::libraries::{Binding, Injected, LibraryMaterial};
use super::loader::Loader;
use super::order::Facts;
use super::report::{Found, Names, Span, shown, suggest};
use super::run_state::Running;
use super::running::RUNNING;
use super::{ChannelRef, Clears, ColorMap, MaterialPattern, Pass, PassKind, PhongMap, Pipeline, TextureMap};
use crate::glsl;
use crate::paths::nearest_help;
use crate::programs::PARAMS;
use crate::raster_effects::EFFECT_PARAMS;
use crate::scene::texture::Magnification;
use std::rc::Rc;

/// Classes of passes.
const CLASSES: [&str; 11] = [
    "default",
    "optix",
    "rt",
    "effect",
    "quad",
    "depthmap",
    "depthmap2",
    "optixPrime",
    "embree",
    "compute",
    "geometryPI",
];

/// Greatest number of instances of its scenes that a pass draws.
const MAX_INSTANCES: f32 = 16_777_216.0;

fn is_class(name: &str) -> bool {
    CLASSES.iter().any(|class| name.eq_ignore_ascii_case(class))
}

/// An entry of `<materialMaps>`.
pub(super) struct MaterialMap {
    /// The materials that are replaced.
    pub to: MaterialPattern,
    /// Index of the replacement's library.
    pub library: usize,
    /// The replacement.
    pub material: Rc<LibraryMaterial>,
    /// Place in the file.
    pub at: Span,
}

/// A shader that `<injectionMaps>` assigns to materials.
pub(super) struct InjectedShader {
    /// The materials that it draws.
    pub to: MaterialPattern,
    /// Index of its library.
    pub library: usize,
    /// The library material that provides the shader and its values.
    pub material: Rc<LibraryMaterial>,
    /// What is bound in addition to the texture of the scene's material.
    pub bound: Injected,
    /// Place in the file.
    pub at: Span,
}

/// The pass being read.
pub(super) struct PassContext<'e> {
    pub element: &'e Element,
    /// Name of the pass.
    pub name: String,
    /// The pipeline's default camera; outer `None` if it could not be resolved.
    pub default_camera: Option<Option<usize>>,
    /// Its reads and writes.
    pub facts: Facts,
}

impl Loader {
    /// Reads a pipeline and checks the order of its passes.
    pub fn pipeline(&mut self, element: &Element) -> Pipeline {
        self.expect(element, &["pass", "preScript", "postScript"], &["name", "default", "defaultCamera", "mode"]);
        self.warn_of_scripts(element, "the pipeline");
        let default_camera = match element.attribute("defaultCamera") {
            Some(name) => self.cameras.names.resolve(&mut self.report, &name.text, name.span).map(Some),
            None => Some(None),
        };
        let (mut names, mut passes, mut facts) = (Names::new("pass of this pipeline"), Vec::new(), Vec::new());
        let declared = self.attributes.clone();
        self.pipeline_name = element.attribute("name").map_or_else(String::new, |name| name.text.clone());
        for pass in element.children_named(&["pass"]) {
            let shows_nothing = self.shows_nothing(pass);
            if !self.runs(pass) {
                continue;
            }
            let name = self.required(pass, "name").filter(|_| !shows_nothing);
            if let Some(name) = name {
                names.declare(&mut self.report, &name.text, name.span);
            }
            let name = name.map_or_else(String::new, |name| name.text.clone());
            self.runs_scripts(pass, "preScript");
            let mut runs = 0;
            while self.runs_again(pass, runs) {
                runs += 1;
                if shows_nothing {
                    continue;
                }
                let (name, facts_of) = (name.clone(), Facts::new(&name, pass.span));
                let mut context = PassContext { element: pass, facts: facts_of, name, default_camera };
                let read = self.pass(&mut context);
                facts.push(context.facts);
                let Some(mut read) = read else { break };
                read.scripted = self.told_of_run(pass, runs);
                passes.push(read);
            }
            // A test script that ends the runs may have set values; these belong to no run.
            self.attributes.set.clear();
            self.runs_scripts(pass, "postScript");
        }
        (self.attributes, self.running) = (declared, Running::default());
        if facts.is_empty() {
            self.report.error(element.span, "the pipeline has no <pass>");
        }
        self.check_linear(&mut passes, &facts);
        self.check_order(&facts);
        debug_assert!(
            self.report.has_errors() || passes.len() == facts.len(),
            "a pass that could not be read has an error"
        );
        let name = element.attribute("name").map_or_else(String::new, |name| name.text.clone());
        Pipeline { name, camera: default_camera.flatten(), passes, broken: None }
    }

    /// Whether a pass has no effect here: it only writes the engine's times over the picture, or runs scripts. A warning says so.
    fn shows_nothing(&mut self, pass: &Element) -> bool {
        let Some(class) = pass.attribute("class") else { return false };
        let what = if class.text.eq_ignore_ascii_case("profiler") {
            "it writes the engine's times over the picture"
        } else if class.text.eq_ignore_ascii_case("default")
            && !pass.children.is_empty()
            && pass.children.iter().all(|child| child.is(&RUNNING))
        {
            "it only runs scripts"
        } else {
            return false;
        };
        let name = pass.attribute("name").map_or("", |name| &name.text);
        self.report.warning(pass.span, format!("pass `{}` is left out: {what}", shown(name)), || None);
        true
    }

    fn pass(&mut self, context: &mut PassContext<'_>) -> Option<Pass> {
        let element = context.element;
        self.stray_text(element);
        let target = self.target(context);
        let class = self.required(element, "class")?;
        let kind = match class.text.to_ascii_lowercase().as_str() {
            "default" => self.raster_pass(context).map(PassKind::Raster),
            "geometrypi" => self.square_pass(context).map(PassKind::Raster),
            "depthmap" | "depthmap2" => self.depth_map_pass(context).map(PassKind::Raster),
            "optix" | "rt" => self.ray_pass(context),
            "effect" => self.effect_pass(context).map(PassKind::Effect),
            "quad" => self.quad_pass(context).map(PassKind::Quad),
            "optixprime" | "embree" => self.intersection_pass(context).map(PassKind::Intersection),
            "compute" => self.compute_pass(context).map(PassKind::Compute),
            _ => {
                let message = format!("pass `{}` is of class `{}`", shown(&context.name), class.shown());
                self.report.error_help(class.span, message, || suggest(&class.text, CLASSES));
                // The pass is unknown, so assume that it writes everything: later passes may read its target.
                context.facts.writes_all();
                None
            }
        };
        let mut kind = kind;
        // Phong colours are kept only if own shaders read them.
        let unread = match &mut kind {
            Some(PassKind::Raster(raster)) if raster.shaders.is_empty() => &mut raster.colors[..],
            Some(PassKind::Ray(ray)) => &mut ray.colors[..],
            Some(PassKind::Effect(effect)) => &mut effect.colors[..],
            _ => &mut [],
        };
        unread.iter_mut().for_each(|map| map.phong = PhongMap::default());
        let viewport = match self.single(element, &["viewport"]) {
            Some(viewport) => self
                .reference(viewport)
                .and_then(|name| self.viewports.names.resolve(&mut self.report, &name.text, name.span))
                .map(Some),
            None => Some(None),
        };
        let place = self.place(element);
        let target = match &kind {
            Some(PassKind::Intersection(intersection)) => Some(Some(intersection.hits)),
            Some(PassKind::Compute(compute)) => Some(Some(compute.stored)),
            _ => target,
        };
        let clears = match kind {
            Some(PassKind::Raster(_) | PassKind::Quad(_)) => self.clears(element)?,
            _ => Clears::default(),
        };
        let name = context.name.clone();
        Some(Pass { name, place, viewport: viewport?, target: target?, clears, scripted: None, kind: kind? })
    }

    /// The render target of a pass; inner `None` for the window, outer `None` after an error.
    fn target(&mut self, context: &mut PassContext<'_>) -> Option<Option<usize>> {
        let Some(element) = self.single(context.element, &["renderTarget"]) else { return Some(None) };
        let target = self.find_target(element);
        let at = Self::span_or(element.attribute("name"), element);
        // A pass of an unsupported class may write only depth.
        let runs = context.element.attribute("class").is_some_and(|class| is_class(&class.text));
        let colors = target.map_or(0, |target| {
            self.libraries.targets[target].channels.iter().filter(|channel| !channel.depth).count()
        });
        // For these classes, the check for colour channels follows once the shaders are read.
        let draws = ["default", "depthmap", "depthmap2", "geometryPI"];
        let class = context.element.attribute("class");
        let draws = class.is_some_and(|class| draws.iter().any(|name| class.text.eq_ignore_ascii_case(name)));
        if let Some(target) = target.filter(|_| runs && !draws)
            && colors == 0
        {
            let message = format!("the render target `{}` has no colour channel", self.libraries.targets[target].name);
            self.report.error(at, message);
        }
        context.facts.set_target(target, colors, at);
        target.map(Some)
    }

    /// Reports attributes of a pass class that has no parameters.
    pub fn no_parameters(&mut self, context: &PassContext<'_>, class: &str) {
        for attribute in &context.element.attributes {
            let name = attribute.name.to_ascii_lowercase();
            if PARAMS.iter().chain(EFFECT_PARAMS).any(|param| param.name == name) {
                let message = format!("a pass of class `{class}` reads no parameter `{name}`");
                let help = || "only ray and effect passes have parameters".to_owned();
                self.report.error_help(attribute.name_span, message, help);
            } else if name == "axis" {
                let message = "coordinate axes are not drawn";
                self.report.warning(attribute.name_span, message, || None);
            } else if !["name", "class"].contains(&name.as_str()) {
                let message = format!("pass `{}` has an unknown attribute `{name}`", shown(&context.name));
                self.report.error_help(attribute.name_span, message, || suggest(&name, ["name", "class"]));
            }
        }
    }

    /// The scenes of a pass whose class cannot draw several instances of them. `None` after an error: [`Self::scenes_of`] fails, or
    /// the pass requests several instances.
    pub fn pass_scenes(&mut self, context: &PassContext<'_>) -> Option<Vec<usize>> {
        let scenes = self.scenes_of(context);
        self.cameras_among_scenes(context, false)?;
        if self.instances(context)? == 1 {
            return scenes;
        }
        let name = shown(&context.name);
        let message = format!("pass `{name}` has its scenes many times, as only passes that draw triangles can");
        self.report.error_help(context.element.span, message, || "valid: <scenes instances=\"1\">".to_owned());
        None
    }

    /// How often a pass draws its scenes: `<scenes instances="…">`.
    pub fn instances(&mut self, context: &PassContext<'_>) -> Option<u32> {
        let (mut found, mut whole) = (None, true);
        for value in context.element.children_named(&["scenes"]).filter_map(|list| list.attribute("instances")) {
            let Some(number) = self.number(value) else {
                whole = false;
                continue;
            };
            let is_count = number.fract() == 0.0 && (1.0..=MAX_INSTANCES).contains(&number);
            if !is_count || found.is_some_and(|before| before != number) {
                let message = format!("pass `{}` draws its scenes {} times", shown(&context.name), value.shown());
                let help =
                    format!("valid: a whole number from 1 to {MAX_INSTANCES}, the same for all <scenes> of the pass");
                self.report.error_help(value.span, message, || help);
                whole = false;
            }
            found = Some(number);
        }
        whole.then(|| found.unwrap_or(1.0) as u32)
    }

    /// The scenes of a pass; empty if it names cameras alone. `None` if a scene could not be resolved, or the pass names nothing.
    pub fn scenes_of(&mut self, context: &PassContext<'_>) -> Option<Vec<usize>> {
        let mut scenes = Vec::new();
        let mut any = false;
        for list in context.element.children_named(&["scenes"]) {
            self.expect(list, &["scene"], &["instances"]);
            for reference in list.children_named(&["scene"]) {
                any = true;
                if !self.is_camera(reference) {
                    scenes.push(self.scene_named(reference));
                }
            }
        }
        if !any {
            let message = format!("pass `{}` names no scene", shown(&context.name));
            self.report.error_help(context.element.span, message, || suggest("", self.scenes.names.iter()));
            return None;
        }
        scenes.into_iter().collect()
    }

    /// The scene that a `<scene name="…"/>` of a pass names.
    pub fn scene_named(&mut self, reference: &Element) -> Option<usize> {
        let name = self.reference(reference)?;
        self.scenes.names.resolve(&mut self.report, &name.text, name.span)
    }

    /// Whether an entry of a pass's scenes names a camera and no scene.
    fn is_camera(&self, reference: &Element) -> bool {
        let Some(name) = reference.attribute("name").or(reference.text.as_ref()) else { return false };
        let misses = |names: &Names| matches!(names.find(&name.text), Found::Missing);
        misses(&self.scenes.names) && !misses(&self.cameras.names)
    }

    /// The cameras among the scenes of a pass: the engine draws the edges of their view frusta. If `drawn` is false, warns of each camera.
    /// `None` after an error.
    pub fn cameras_among_scenes(&mut self, context: &PassContext<'_>, drawn: bool) -> Option<Vec<usize>> {
        let lists = context.element.children_named(&["scenes"]);
        let mut cameras = Vec::new();
        for reference in lists.flat_map(|list| list.children_named(&["scene"])) {
            if !self.is_camera(reference) {
                continue;
            }
            let name = self.reference(reference)?;
            if !drawn {
                let message = format!("the lines of the camera `{}` are not drawn", name.shown());
                self.report.warning(name.span, message, || Some("passes of class `default` draw them".to_owned()));
            }
            cameras.push(self.cameras.names.resolve(&mut self.report, &name.text, name.span)?);
        }
        Some(cameras)
    }

    /// The camera of a pass, or else the default camera of its pipeline. `None` after an error.
    pub fn pass_camera(&mut self, context: &PassContext<'_>) -> Option<usize> {
        if let Some(reference) = self.single(context.element, &["camera"]) {
            let name = self.reference(reference)?;
            return self.cameras.names.resolve(&mut self.report, &name.text, name.span);
        }
        let default = context.default_camera?;
        if default.is_none() {
            let message = format!("pass `{}` has no camera, nor has its pipeline", shown(&context.name));
            self.report.error_help(context.element.span, message, || suggest("", self.cameras.names.iter()));
        }
        default
    }

    /// Parses a material pattern: `*` or a name.
    pub fn material_pattern(&mut self, value: &Value) -> Option<MaterialPattern> {
        match value.text.as_str() {
            "*" => Some(MaterialPattern::All),
            name if name.contains('*') => {
                self.report.error_help(value.span, format!("`{}` is not a material's name", value.shown()), || {
                    "valid: *, or one whole name".to_owned()
                });
                None
            }
            name => Some(MaterialPattern::Named(name.to_owned())),
        }
    }

    /// Reads the `<map>` elements of `<materialMaps>`.
    pub fn material_maps(&mut self, pass: &Element) -> Option<Vec<MaterialMap>> {
        let mut maps = Some(Vec::new());
        for list in pass.children_named(&["materialMaps"]) {
            self.expect(list, &["map"], &[]);
            for map in list.children_named(&["map"]) {
                self.expect(map, &[], &["fromMaterial", "toLibrary", "toMaterial"]);
                let pattern = self.required(map, "fromMaterial").and_then(|value| self.material_pattern(value));
                let (library, name) = (self.required(map, "toLibrary"), self.required(map, "toMaterial"));
                let material = library.zip(name).and_then(|(library, name)| self.find_material(library, name));
                let at = Self::span_or(name, map);
                maps = maps.zip(pattern.zip(material)).map(|(mut maps, (pattern, (library, material)))| {
                    maps.push(MaterialMap { to: pattern, library, material, at });
                    maps
                });
            }
        }
        maps
    }

    /// Adds the colours of `<materialMaps>`, whose entries replace whole materials.
    pub fn mapped_colors(&mut self, maps: &[MaterialMap], colors: &mut Vec<ColorMap>) {
        for &MaterialMap { ref to, library, ref material, at } in maps {
            let texture = match self.is_own_shader(library, material) {
                true => TextureMap::Removed,
                false => self.mapped_texture(library, material, at),
            };
            colors.push(ColorMap {
                to: to.clone(),
                diffuse: Some(material.diffuse),
                emission: Some(material.emission),
                phong: PhongMap {
                    ambient: Some(material.ambient),
                    specular: Some(material.specular),
                    shininess: Some(material.shininess),
                },
                texture,
            });
        }
    }

    /// The texture that a material without an own shader is drawn with: the image file of its unit 0. Reports the textures that are not read.
    fn mapped_texture(&mut self, library: usize, material: &LibraryMaterial, at: Span) -> TextureMap {
        let bound = material.textures.iter().rev().find(|binding| binding.unit == 0);
        let file = bound.and_then(|binding| self.image_file_of(library, binding));
        let name = shown(&material.name);
        let all_read = match file {
            Some(_) => material.textures.iter().all(|binding| binding.unit == 0),
            None => material.textures.is_empty(),
        };
        if !all_read {
            let how =
                if file.is_some() { "the texture of unit 0 alone" } else { "its diffuse colour, without its textures" };
            self.report.warning(at, format!("material `{name}` is drawn with {how}"), || {
                Some("without an own shader, materials have the image file that is bound to unit 0".to_owned())
            });
        }
        match file {
            Some(Ok(file)) => TextureMap::File(file, bound.map_or(Magnification::Linear, |bound| bound.magnification)),
            Some(Err((file, span))) => {
                let message = format!("cannot read {}: there is no such file", file.display());
                self.report.warning(span, message, || {
                    Some(format!("material `{name}` is drawn with its diffuse colour; {}", nearest_help(&file)))
                });
                TextureMap::Removed
            }
            None => TextureMap::Removed,
        }
    }

    /// Reads the `<map>` elements of `<injectionMaps>`: colours, and injected shaders.
    pub fn injection_maps(&mut self, pass: &Element, colors: &mut Vec<ColorMap>) -> Option<Vec<InjectedShader>> {
        const UNREAD: &[&str] = &["textures", "imageTextures", "buffers", "state"];
        let mut shaders = Some(Vec::new());
        for list in pass.children_named(&["injectionMaps"]) {
            self.expect(list, &["map"], &[]);
            for map in list.children_named(&["map"]) {
                self.expect(map, &[&["shader", "color"], UNREAD].concat(), &["toMaterial"]);
                let pattern = self.required(map, "toMaterial").and_then(|value| self.material_pattern(value));
                let has_shader = glsl::AVAILABLE && map.children.iter().any(|child| child.is(&["shader"]));
                let (read, bound): (&[&str], _) = match has_shader {
                    true => (&["textures", "imageTextures", "buffers"], self.injected_bindings(map)),
                    false => (&[], Some(Injected::NONE)),
                };
                if let Some(unread) = map.children.iter().find(|child| child.is(UNREAD) && !child.is(read)) {
                    let message = format!("no program reads what <{}> injects", unread.name);
                    self.report.note(unread.span, message);
                }
                if let Some(shader) = self.single(map, &["shader"]) {
                    self.expect(shader, &["values"], &["fromMaterial", "fromLibrary"]);
                    let at = Self::span_or(shader.attribute("fromMaterial"), shader);
                    let found = self.source_material(shader);
                    let found = found.zip(pattern.clone()).zip(bound);
                    shaders = shaders.zip(found).map(|(mut shaders, (((library, material), to), bound))| {
                        shaders.push(InjectedShader { to, library, material, bound, at });
                        shaders
                    });
                }
                if let Some(color) = self.single(map, &["color"]) {
                    match (pattern, self.injected_color(color)) {
                        (Some(to), Some((diffuse, emission, phong))) => {
                            colors.push(ColorMap { to, diffuse, emission, phong, texture: TextureMap::Kept });
                        }
                        _ => shaders = None,
                    }
                } else if pattern.is_none() {
                    shaders = None;
                }
            }
        }
        shaders
    }

    /// What an injection binds in addition to the scene's texture: `<textures>`, `<imageTextures>`, `<buffers>`.
    fn injected_bindings(&mut self, map: &Element) -> Option<Injected> {
        let (textures, images) = (self.injected_textures(map), self.bound_images(map));
        Some(Injected { textures: textures?, buffers: self.bound_buffers(map), images: images? })
    }

    /// The textures that the `<textures>` of an injection bind in addition to the scene's texture.
    fn injected_textures(&mut self, map: &Element) -> Option<Vec<Binding>> {
        let mut found = Some(Vec::new());
        for list in map.children_named(&["textures"]) {
            for texture in list.children_named(&["texture"]) {
                let binding = self.injected_texture(texture);
                found = found.zip(binding).map(|(mut found, binding)| {
                    found.push(binding);
                    found
                });
            }
        }
        found
    }

    /// The library material that `fromMaterial` and `fromLibrary` name.
    pub fn source_material(&mut self, element: &Element) -> Option<(usize, Rc<LibraryMaterial>)> {
        let (name, library) = (self.required(element, "fromMaterial"), self.required(element, "fromLibrary"));
        self.find_material(library?, name?)
    }

    fn injected_color(&mut self, element: &Element) -> Option<(Option<glam::Vec4>, Option<glam::Vec4>, PhongMap)> {
        const PARTS: [&str; 5] = ["ambient", "diffuse", "specular", "emission", "shininess"];
        self.expect(element, &[], &[&["fromMaterial", "fromLibrary"], &PARTS[..]].concat());
        let flags = PARTS.map(|part| element.attribute(part).map_or(Some(false), |value| self.boolean(value)));
        let (_, material) = self.source_material(element)?;
        let [ambient, diffuse, specular, emission, shininess] = flags;
        if flags.iter().all(|flag| *flag == Some(false)) {
            let message = "this injects no colour".to_owned();
            self.report
                .warning(element.span, message, || Some("valid: diffuse=\"true\", emission=\"true\"".to_owned()));
        }
        let phong = PhongMap {
            ambient: ambient?.then_some(material.ambient),
            specular: specular?.then_some(material.specular),
            shininess: shininess?.then_some(material.shininess),
        };
        Some((diffuse?.then_some(material.diffuse), emission?.then_some(material.emission), phong))
    }

    /// Name and stem of a material's shader.
    pub fn shader_of(&self, library: usize, material: &LibraryMaterial) -> Option<(String, String)> {
        let shader = &self.libraries.get(library).shaders[material.shader?];
        Some((shader.name.clone(), shader.stem.clone()))
    }

    /// Records that a pass reads a channel.
    pub fn reads(context: &mut PassContext<'_>, channel: Option<ChannelRef>, at: Span) {
        context.facts.reads.extend(channel.map(|channel| (channel, at)));
    }
}
