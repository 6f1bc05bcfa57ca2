//! Reading raster and quad passes.

use super::dom::Element;
use super::libraries::{Injected, LibraryMaterial};
use super::loader::Loader;
use super::passes::{InjectedShader, MaterialMap, PassContext};
use super::report::{Found, Span, shown, suggest};
use super::running::RUNNING;
use super::shaders::{ShaderUse, UsedBy};
use super::{Clears, MaterialPattern, QuadPass, QuadSource, RasterPass, SceneDecl, ShaderMap};
use crate::programs::{QUAD_PROGRAMS, QuadProgram, RASTER_PROGRAMS, RasterProgram, ShaderInfo};
use crate::scene::{Placement, Shape, ShapeKind};
use std::rc::Rc;

/// Number of channels that a raster pass writes: colour, position, normal.
const RASTER_CHANNELS: usize = 3;

/// Name of the material that a quad pass draws with.
const QUAD_MATERIAL: &str = "__Quad";

impl Loader {
    /// Reads a pass of class `default`.
    pub fn raster_pass(&mut self, context: &mut PassContext<'_>) -> Option<RasterPass> {
        self.draw_pass(context, None, &[])
    }

    /// Reads a pass of class `geometryPI`, which a plugin of the engine's descendant adds: it draws a square from -1 to 1 in addition to
    /// the scenes that it names, if any.
    pub fn square_pass(&mut self, context: &mut PassContext<'_>) -> Option<RasterPass> {
        let square = self.own_square();
        let names_scenes = context.element.children_named(&["scenes"]).any(|list| !list.children.is_empty());
        let scenes = if names_scenes { self.scenes_of(context)? } else { Vec::new() };
        self.draw_scenes(context, (Some([scenes, vec![square]].concat()), None), &[])
    }

    /// Index of the scene that contains the square of [`Self::square_pass`]. The first call adds this scene.
    fn own_square(&mut self) -> usize {
        const NAME: &str = "geometryPI::my_scene";
        if let Found::Exact(index) = self.scenes.names.find(NAME) {
            return index;
        }
        let shape = Shape {
            name: "my_plane".to_owned(),
            material: super::scenes::SHAPE_MATERIAL.to_owned(),
            kind: ShapeKind::Square,
            place: Placement::default(),
        };
        self.scenes.names.declare_built_in(NAME);
        self.scenes.items.push(Some(SceneDecl { shapes: vec![shape], ..SceneDecl::empty(NAME.to_owned()) }));
        self.scenes.items.len() - 1
    }

    /// Reads a pass that draws triangles. The camera is the given one, or else the pass's own. `others` are further elements that a
    /// pass of its class may contain.
    pub fn draw_pass(
        &mut self,
        context: &mut PassContext<'_>,
        camera: Option<usize>,
        others: &[&str],
    ) -> Option<RasterPass> {
        let scenes = self.scenes_of(context);
        self.draw_scenes(context, (scenes, camera), others)
    }

    /// Reads a pass that draws `scenes`, except for its list of scenes. `camera` and `others` are as in [`Self::draw_pass`].
    fn draw_scenes(
        &mut self,
        context: &mut PassContext<'_>,
        (scenes, camera): (Option<Vec<usize>>, Option<usize>),
        others: &[&str],
    ) -> Option<RasterPass> {
        const CHILDREN: &[&str] = &[
            "scenes",
            "camera",
            "viewport",
            "renderTarget",
            "lights",
            "materialMaps",
            "injectionMaps",
            "depth",
            "color_clear",
            "depth_clear",
        ];
        let element = context.element;
        self.expect_children(element, &[CHILDREN, others, &RUNNING].concat());
        self.no_parameters(context, "default");
        context.facts.writes_first(RASTER_CHANNELS);
        let instances = self.instances(context);
        // A given camera belongs to a light and draws a depth map. Frusta of cameras are lines, which a depth map leaves out.
        let frusta = self.cameras_among_scenes(context, camera.is_none());
        let camera = camera.or_else(|| self.pass_camera(context));
        let lights = self.pass_lights(context);
        if let Some(depth) = self.single(element, &["depth"]) {
            self.depth_state(depth);
        }
        let (mut colors, mut programs) = (Vec::new(), Vec::new());
        let maps = self.material_maps(element);
        self.mapped_colors(maps.as_deref().unwrap_or_default(), &mut colors);
        let injected = self.injection_maps(element, &mut colors);
        let nothing = Injected::NONE;
        let replaced = maps.iter().flatten().filter(|map| map.material.shader.is_some()).map(|map| {
            let MaterialMap { to, library, material, at } = map;
            let by = UsedBy::Scenes;
            ShaderUse { to, library: *library, material, at: *at, replaces: true, injected: &nothing, by }
        });
        let injected_shaders = injected.iter().flatten().map(|shader| {
            let InjectedShader { to, library, material, bound, at } = shader;
            let by = UsedBy::Scenes;
            ShaderUse { to, library: *library, material, at: *at, replaces: false, injected: bound, by }
        });
        let named: Vec<usize> = lights.iter().flatten().map(|(index, _)| *index).collect();
        let mut shaders = Some(Vec::new());
        let uses: Vec<ShaderUse<'_>> = replaced.chain(injected_shaders).collect();
        let all_own =
            uses.iter().any(|used| *used.to == MaterialPattern::All && self.is_own_shader(used.library, used.material));
        context.facts.draws(all_own);
        self.check_colors(context, all_own);
        for used in uses {
            if self.is_own_shader(used.library, used.material) {
                let own = self.own_shader(context, &used, &named);
                Self::takes_down(context, own.as_deref(), used.at);
                shaders = shaders.zip(own).map(|(mut shaders, own)| {
                    shaders.push(ShaderMap { to: used.to.clone(), shader: own });
                    shaders
                });
            } else {
                let ShaderUse { library, material, at, .. } = used;
                programs.push(self.shader_program(context, library, material, at, RASTER_PROGRAMS, "raster"));
            }
        }
        let programs: Option<Vec<RasterProgram>> = programs.into_iter().collect();
        let programs = programs?;
        let program = programs.first().copied().unwrap_or(RASTER_PROGRAMS[0].program);
        if programs.iter().any(|other| *other != program) {
            self.report.error(element.span, format!("pass `{}` mixes raster programs", shown(&context.name)));
        }
        let (_, _, _) = (lights?, maps?, injected?);
        let shaders = shaders?;
        let (scenes, frusta, instances, camera, lights) = (scenes?, frusta?, instances?, camera?, named);
        Some(RasterPass { scenes, frusta, instances, camera, lights, program, colors, shaders })
    }

    /// What a pass clears: `COLOR_CLEAR`, `DEPTH_CLEAR`, and the `clear` of `<depth>`.
    pub fn clears(&mut self, element: &Element) -> Option<Clears> {
        let mut clears = Some(Clears::default());
        for child in element.children.iter().filter(|child| child.is(&["color_clear", "depth_clear", "depth"])) {
            let value = match (child.is(&["depth"]), child.attribute("clear")) {
                (true, None) => continue,
                (true, Some(value)) => Some(value),
                (false, _) => self.required(child, "value"),
            };
            let on = value.and_then(|value| self.boolean(value));
            clears = clears.zip(on).map(|(clears, on)| match child.is(&["color_clear"]) {
                true => Clears { color: clears.color && on, ..clears },
                false => Clears { depth: clears.depth && on, ..clears },
            });
        }
        clears
    }

    /// Reports a target without colour channels. Such a target is valid only if it has a depth channel and the project's own shaders draw
    /// all materials, because these shaders write the depth.
    fn check_colors(&mut self, context: &PassContext<'_>, all_own: bool) {
        let Some((target, at)) = context.facts.colorless() else { return };
        let target = &self.libraries.targets[target];
        if !(all_own && target.depth().is_some()) {
            let message = format!("the render target `{}` has no colour channel", target.name);
            self.report.error_help(at, message, || {
                "own shaders that draw all materials (*) leave a depth that has a name: <depth name=\"…\"/>".to_owned()
            });
        }
    }

    /// Checks `<depth test=true write=true/>`, the only depth state that is supported.
    fn depth_state(&mut self, depth: &Element) {
        self.expect(depth, &[], &["test", "write", "clear", "value", "func"]);
        for name in ["test", "write"] {
            if let Some(value) = depth.attribute(name)
                && self.boolean(value) == Some(false)
            {
                let message = format!("a raster pass without depth {name} is not supported");
                self.report.error_help(value.span, message, || "valid: true".to_owned());
            }
        }
    }

    /// The program of a material's shader, selected by the stem of its pixel-shader file.
    fn shader_program<P: Copy>(
        &mut self,
        context: &PassContext<'_>,
        library: usize,
        material: &LibraryMaterial,
        at: Span,
        table: &[ShaderInfo<P>],
        kind: &str,
    ) -> Option<P> {
        let pass = shown(&context.name);
        let Some((name, stem)) = self.shader_of(library, material) else {
            let message = format!("pass `{pass}`: material `{}` has no shader", shown(&material.name));
            self.report.error(at, message);
            return None;
        };
        let found = table.iter().find(|info| info.stem == stem);
        if found.is_none() {
            let message = if name == stem {
                format!("pass `{pass}`: shader `{}` is not a {kind} program", shown(&name))
            } else {
                format!("pass `{pass}`: shader `{}` is `{}`, which is not a {kind} program", shown(&name), shown(&stem))
            };
            self.report.error_help(at, message, || {
                let known = suggest(&stem, table.iter().map(|info| info.stem));
                if crate::glsl::AVAILABLE { known } else { format!("{}; {known}", crate::glsl::MISSING) }
            });
        }
        found.map(|info| info.program)
    }

    /// Reads a pass of class `quad`.
    pub fn quad_pass(&mut self, context: &mut PassContext<'_>) -> Option<QuadPass> {
        const CHILDREN: &[&str] = &[
            "viewport",
            "renderTarget",
            "texture",
            "material",
            "materialMaps",
            "camera",
            "scenes",
            "lights",
            "color_enable",
            "color_clear",
            "depth_clear",
        ];
        let element = context.element;
        self.expect_children(element, &[CHILDREN, &RUNNING].concat());
        self.no_parameters(context, "quad");
        let writes_color = match element.children_named(&["color_enable"]).find_map(|child| child.attribute("value")) {
            Some(value) => self.boolean(value)?,
            None => true,
        };
        context.facts.writes_first(usize::from(writes_color));
        let texture = self.single(element, &["texture"]);
        if !writes_color && texture.is_some() {
            let message = format!("quad pass `{}` shows a texture without writing colours", shown(&context.name));
            self.report.error_help(element.span, message, || "valid: COLOR_ENABLE true".to_owned());
            return None;
        }
        let material = self.single(element, &["material"]);
        let has_map = element.children_named(&["materialMaps"]).any(|list| !list.children.is_empty());
        let sources = usize::from(texture.is_some()) + usize::from(material.is_some()) + usize::from(has_map);
        if sources != 1 {
            let how = if sources == 0 { "shows nothing" } else { "shows several things" };
            self.report.error_help(element.span, format!("quad pass `{}` {how}", shown(&context.name)), || {
                "valid: one of <texture>, <material>, <materialMaps>".to_owned()
            });
            return None;
        }
        if let Some(texture) = texture {
            self.expect(texture, &[], &["name", "fromLibrary"]);
            let name = self.required(texture, "name")?;
            let whole = texture.attribute("fromLibrary").is_none() && name.text.contains("::");
            let channel = match whole {
                true => self.find_texture(name, None),
                false => {
                    let library = self.required(texture, "fromLibrary");
                    let library = self.find_library(library?)?;
                    self.find_channel(library, &name.text, name)
                }
            };
            Self::reads(context, channel, name.span);
            return Some(QuadPass::new(QuadSource::Show(channel?)));
        }
        let (library, material, at) = match material {
            Some(element) => {
                self.expect(element, &[], &["name", "fromLibrary"]);
                let (name, from) = (self.required(element, "name"), self.required(element, "fromLibrary"));
                let (library, material) = self.find_material(from?, name?)?;
                (library, material, name?.span)
            }
            None => self.quad_map(context)?,
        };
        let own = match self.is_own_shader(library, &material) {
            true => Some(self.pass_shader(context, (library, &material, at), UsedBy::Quad(None))?),
            false => None,
        };
        let stores = own.iter().any(|shader| shader.buffers_stored().next().is_some());
        if !writes_color && !stores {
            let message = format!("quad pass `{}` neither writes colours nor stores anything", shown(&context.name));
            self.report.error_help(element.span, message, || "valid: COLOR_ENABLE true".to_owned());
            return None;
        }
        if own.is_some() {
            return Some(QuadPass { source: QuadSource::Own, shader: own, writes_color });
        }
        match self.shader_program(context, library, &material, at, QUAD_PROGRAMS, "quad")? {
            QuadProgram::Combine => {
                let [color, factor] = [0, 1].map(|unit| self.unit(context, library, &material, unit, at));
                Some(QuadPass::new(QuadSource::Combine { color: color?, factor: factor? }))
            }
            QuadProgram::Show => {
                let shown = self.unit(context, library, &material, 0, at);
                Some(QuadPass::new(QuadSource::Show(shown?)))
            }
        }
    }

    /// The material that `<materialMaps>` assigns to the quad.
    fn quad_map(&mut self, context: &PassContext<'_>) -> Option<(usize, Rc<LibraryMaterial>, Span)> {
        let mut maps = self.material_maps(context.element)?;
        let Some(index) = maps.iter().position(|map| map.to.matches(QUAD_MATERIAL)) else {
            let message = format!("quad pass `{}` maps no material of `{QUAD_MATERIAL}`", shown(&context.name));
            let at = maps.first().map_or(context.element.span, |map| map.at);
            self.report.error_help(at, message, || format!("valid: fromMaterial=\"{QUAD_MATERIAL}\""));
            return None;
        };
        let map = maps.swap_remove(index);
        Some((map.library, map.material, map.at))
    }

    /// The channel that is bound to a texture unit of a material.
    fn unit(
        &mut self,
        context: &mut PassContext<'_>,
        library: usize,
        material: &LibraryMaterial,
        unit: u32,
        at: Span,
    ) -> Option<super::ChannelRef> {
        let Some(binding) = material.textures.iter().find(|binding| binding.unit == unit) else {
            let message = format!(
                "pass `{}`: material `{}` binds no texture to unit {unit}",
                shown(&context.name),
                shown(&material.name)
            );
            self.report.error_help(at, message, || format!("valid: <texture unit=\"{unit}\" name=\"…\"/>"));
            return None;
        };
        let channel = self.find_texture(&binding.name, Some(library));
        Self::reads(context, channel, at);
        channel
    }
}
