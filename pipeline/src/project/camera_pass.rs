//! Ray passes whose rays start at the camera: their program, its parameters, and the behaviour of materials.
//!
//! A pass of this kind either names a built-in program, as in `program="whitted"`, or hands inputs to device programs of its
//! own. The tutorials of the engine's descendant all name the same file and the same programs, so the intended program is
//! inferred from the inputs. The rules in `Handed::program` are tried in order; `curitiba plan` prints the rule that decided. If
//! no rule fits, the pass is in error, and the message lists the programs.

use super::dom::{Element, Value};
use super::file;
use super::loader::Loader;
use super::order::Facts;
use super::parameters::Reads;
use super::passes::PassContext;
use super::ray::{DEFAULT_MATERIAL, ENTRY_POINT, GEOMETRY, MAP, MATERIAL_MAP, PROGRAM};
use super::report::{Span, shown, suggest};
use super::running::RUNNING;
use super::{CameraStart, ChannelRef, MaterialPattern, Pass, PassKind, RayPass, handed};
use crate::camera_programs::SurfaceKind;
use crate::glass::Background;
use crate::programs::{MOST_SAMPLES, PARAMS, RAY_PROGRAMS, RayParams, RayProgram, RayProgramInfo};
use std::collections::HashSet;
use std::f32::consts::PI;

/// `PATH_RADIANCE`: radiance of the light in the tutorials' path tracer, before multiplication by `LIGHT_SCALE`. `PATH_LIGHT`:
/// width and depth of this light. The factor π compensates for the BRDF, which is the albedo in the tutorials and albedo / π
/// here.
const PATH_RADIANCE: f32 = 5.0 * PI;
const PATH_LIGHT: [f32; 2] = [0.47, 0.38];
/// Width and depth of the light in the tutorials with soft shadows.
const SOFT_LIGHT: f32 = 0.4;

/// The inputs that a pass hands to its device programs.
#[derive(Debug, Default)]
struct Handed {
    normal: bool,
    texcoord: bool,
    position: bool,
    /// Whether the default material has programs for shadow rays.
    shadow: bool,
    lit_from: Option<From>,
    /// Names of the pass's own attributes that are handed over, such as `AO_RADIUS`.
    of_pass: Vec<String>,
    /// Kinds of the inputs that no other field describes.
    others: Vec<String>,
}

/// The behaviour of rays at materials, and explanations for `plan` where more than names of device programs determined it.
type Surfaces = (Vec<(MaterialPattern, SurfaceKind)>, Vec<String>);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum From {
    Direction,
    Place,
}

impl Handed {
    fn has(&self, component: &str) -> bool {
        self.of_pass.iter().any(|given| given.eq_ignore_ascii_case(component))
    }

    /// The intended program and the reason; `None` if no rule decides.
    fn program(&self, stem: &str) -> Option<(RayProgram, String)> {
        let chosen = |program, why: &str| Some((program, why.to_owned()));
        if stem.to_ascii_lowercase().contains("pathtrac") {
            return chosen(RayProgram::PathTracing, "its file has the name of a path tracer");
        }
        if self.has("AO_RADIUS") || self.has("AO_RAYS") {
            return chosen(RayProgram::CameraOcclusion, "it is handed AO_RADIUS or AO_RAYS");
        }
        if self.has("LIGHT_SCALE") && self.lit_from == Some(From::Place) {
            return chosen(RayProgram::PathTracing, "it is handed LIGHT_SCALE and a light's place");
        }
        if !self.others.is_empty() {
            return None;
        }
        match (self.shadow, self.lit_from) {
            (true, Some(_)) if self.normal => {
                chosen(RayProgram::Whitted, "it has programs for shadow rays and is handed a light and normals")
            }
            (false, Some(_)) if self.normal => {
                chosen(RayProgram::Lambert, "it is handed a light and normals, and has no program for shadow rays")
            }
            (false, None) if self.position && self.of_pass.is_empty() => {
                let what = if self.texcoord { "positions and texture coordinates" } else { "positions" };
                Some((RayProgram::Albedo, format!("it is handed {what} alone, and no light")))
            }
            _ => None,
        }
    }
}

impl Loader {
    /// Whether the rays of a ray pass start at the camera: the pass names its program by `program`, or it binds no buffers and the
    /// file of its ray-generation program is none of the known ones.
    pub(super) fn starts_at_camera(&self, pass: &Element) -> bool {
        let binds = pass.children_named(super::ray::INPUT).next().is_some();
        let unknown = |path: &Value| {
            let stem = file::stem(path);
            !RAY_PROGRAMS.iter().any(|info| !info.entry.is_empty() && info.stem.eq_ignore_ascii_case(stem))
        };
        pass.attribute("program").is_some() || !binds && self.generator(pass).is_some_and(unknown)
    }

    /// The file of the ray-generation program.
    fn generator<'e>(&self, pass: &'e Element) -> Option<&'e Value> {
        let of_kind = |kind: &Value| kind.text.eq_ignore_ascii_case("RayGen");
        pass.children_named(ENTRY_POINT).flat_map(|entry| &entry.children).find_map(|child| {
            let generates = child.is(&["rayGen"]) || child.attribute("type").is_some_and(of_kind);
            child.attribute("file").filter(|_| generates)
        })
    }

    /// Reads a pass whose rays start at the camera, or a pass that has no camera and traces no rays.
    pub(super) fn generated_pass(&mut self, context: &mut PassContext<'_>) -> Option<PassKind> {
        self.expect_camera_children(context.element);
        match self.generator(context.element).filter(|_| Self::is_pattern(context)) {
            Some(generator) => self.pattern_pass(context, generator).map(PassKind::Quad),
            None => self.camera_pass(context).map(PassKind::Ray),
        }
    }

    fn camera_pass(&mut self, context: &mut PassContext<'_>) -> Option<RayPass> {
        let element = context.element;
        let (scenes, camera, light) = (self.pass_scenes(context), self.pass_camera(context), self.first_light(context));
        let mut colors = Vec::new();
        let maps = self.material_maps(element);
        self.mapped_colors(maps.as_deref().unwrap_or_default(), &mut colors);
        let injected = self.injection_maps(element, &mut colors);
        let handed = self.handed_to_device(element);
        let chosen = self.camera_program(context, &handed);
        let surfaces = self.surfaces(element);
        let (info, why) = chosen?;
        let light = light?;
        let named = why.is_none();
        let mut params = if named { info.defaults() } else { self.tutorial_params(element, info, &handed, camera) };
        let reads = Reads { name: info.stem, buffers: &[], params: info.params };
        let valid = self.parameters(context, Some(reads), PARAMS, |name, value| params.set(name, value));
        let lamp = self.is_lamp(info, light, handed.lit_from.filter(|_| !named))?;
        let needs_light = matches!(info.program, RayProgram::Lambert | RayProgram::Whitted);
        if light.is_none() && needs_light {
            let message =
                format!("program `{}` reads a light, and pass `{}` names none", info.stem, shown(&context.name));
            self.report.error_help(element.span, message, || suggest("", self.lights.names.iter()));
            return None;
        }
        let (_, _, (surfaces, mut said)) = (maps?, injected?, surfaces?);
        let linear = self.handed_buffer(element);
        context.facts.stores(linear.map(|target| ChannelRef { target, channel: 0 }).into_iter());
        said.splice(0..0, why);
        valid.then_some(())?;
        Some(RayPass {
            scenes: scenes?,
            camera: camera?,
            lights: light.map(|(index, _)| index).into_iter().collect(),
            program: info.program,
            params,
            position: None,
            normal: None,
            color: None,
            colors,
            glass: Vec::new(),
            shadow_glass: Vec::new(),
            from_camera: Some(CameraStart { surfaces, lamp, why: said.join("; "), linear }),
        })
    }

    /// The buffer that the pass hands to its device programs; in it the programs accumulate colours before they apply gamma.
    fn handed_buffer(&self, pass: &Element) -> Option<usize> {
        let handed = pass.children_named(handed::GLOBAL).flat_map(|list| &list.children);
        let is_buffer =
            |item: &&Element| item.attribute("type").is_some_and(|kind| kind.text.eq_ignore_ascii_case("BUFFER"));
        handed.filter(is_buffer).find_map(|item| self.libraries.buffer_named(&item.attribute("context")?.text))
    }

    /// Drops the colour buffers ([`CameraStart::linear`]) that no pass of the pipeline reads. Reports a remaining buffer if its size
    /// differs from that of its pass's target.
    pub(super) fn check_linear(&mut self, passes: &mut [Pass], facts: &[Facts]) {
        let read: HashSet<usize> =
            passes.iter().flat_map(|pass| pass.kind.buffers_read()).map(|channel| channel.target).collect();
        for (pass, facts) in passes.iter_mut().zip(facts) {
            let PassKind::Ray(RayPass { from_camera: Some(start), .. }) = &mut pass.kind else { continue };
            start.linear = start.linear.filter(|buffer| read.contains(buffer));
            let (Some(buffer), Some(target)) = (start.linear, pass.target) else { continue };
            let ([width, height], held) = (self.libraries.targets[target].size, &self.libraries.targets[buffer]);
            let (needed, bytes) = (u64::from(width) * u64::from(height) * 16, held.buffer.unwrap_or_default());
            if needed != bytes {
                let message = format!(
                    "pass `{}` writes {width} x {height} colours of 16 bytes into `{}::{}` of {bytes} bytes",
                    shown(&pass.name),
                    held.library,
                    held.name
                );
                self.report.error_help(facts.span, message, || {
                    format!("valid: {needed} bytes, a vec4 for each pixel of its target")
                });
            }
        }
    }

    fn expect_camera_children(&mut self, element: &Element) {
        const COMMON: &[&str] =
            &["scenes", "camera", "viewport", "renderTarget", "lights", "materialMaps", "injectionMaps"];
        const READ_OVER: &[&str] = &["optixRayTypes", "rtRayTypes"];
        let kinds: Vec<&str> = SurfaceKind::NAMED.iter().map(|(name, _)| *name).collect();
        let values: Vec<&str> =
            self.attributes.pass_values.keys().map(String::as_str).chain(["RAYS_PER_PIXEL", "MAX_DEPTH"]).collect();
        let programs = [ENTRY_POINT, DEFAULT_MATERIAL, MATERIAL_MAP, GEOMETRY].concat();
        let valid: Vec<String> = [COMMON, &RUNNING, READ_OVER, handed::ELEMENTS, &programs, &kinds, &values]
            .concat()
            .into_iter()
            .map(str::to_owned)
            .collect();
        let valid: Vec<&str> = valid.iter().map(String::as_str).collect();
        self.expect_children(element, &valid);
    }

    /// Collects the inputs that the pass hands to its device programs, of whatever type.
    fn handed_to_device(&mut self, pass: &Element) -> Handed {
        let mut handed = Handed::default();
        for item in pass.children_named(handed::VERTEX).flat_map(|list| &list.children) {
            match item.attribute("name").map_or("", |name| name.text.as_str()) {
                name if name.eq_ignore_ascii_case("position") => handed.position = true,
                name if name.eq_ignore_ascii_case("normal") => handed.normal = true,
                name if name.eq_ignore_ascii_case("texCoord0") => handed.texcoord = true,
                _ => {}
            }
        }
        for item in pass.children_named(handed::GLOBAL).flat_map(|list| &list.children) {
            let text = |name: &str| item.attribute(name).map_or("", |value| value.text.as_str());
            let (kind, context, component) = (text("type"), text("context"), text("component"));
            // In 2014 files the kind is in the context attribute and the type is CURRENT.
            let kind = if kind.eq_ignore_ascii_case("CURRENT") { context } else { kind };
            match kind.to_ascii_uppercase().as_str() {
                "LIGHT" if component.eq_ignore_ascii_case("DIRECTION") => {
                    handed.lit_from.get_or_insert(From::Direction);
                }
                // A position takes precedence: projects that use the position hand over both.
                "LIGHT" if component.eq_ignore_ascii_case("POSITION") => handed.lit_from = Some(From::Place),
                "PASS" => handed.of_pass.push(component.to_owned()),
                // An accumulation buffer and the frame number are used for accumulation only.
                "BUFFER" | "LIGHT" => {}
                "RENDERER" if component.eq_ignore_ascii_case("FRAME_COUNT") => {}
                other => handed.others.push(other.to_owned()),
            }
        }
        let programs = pass.children_named(DEFAULT_MATERIAL).flat_map(programs_of);
        handed.shadow = programs.into_iter().any(|given| given.of_shadow());
        handed
    }

    /// The program of the pass, and the reason for it if the pass does not name it.
    fn camera_program(
        &mut self,
        context: &PassContext<'_>,
        handed: &Handed,
    ) -> Option<(&'static RayProgramInfo, Option<String>)> {
        let pass = shown(&context.name);
        let programs = || RAY_PROGRAMS.iter().filter(|info| info.starts_at_camera());
        if let Some(name) = context.element.attribute("program") {
            let found = programs().find(|info| info.stem == name.text);
            if found.is_none() {
                let message = format!("pass `{pass}`: no program whose rays start at the camera is `{}`", name.shown());
                self.report.error_help(name.span, message, || suggest(&name.text, programs().map(|info| info.stem)));
            }
            return found.map(|info| (info, None));
        }
        let path = self.generator(context.element)?;
        let stem = file::stem(path);
        if let Some((program, why)) = handed.program(stem) {
            return Some((program.info(), Some(why)));
        }
        let message = format!(
            "pass `{pass}`: there is no ray program `{}`, and what the pass hands it does not say what it computes",
            shown(stem)
        );
        self.report.error_help(path.span, message, || {
            let names: Vec<String> = programs().map(|info| format!("program=\"{}\"", info.stem)).collect();
            format!(
                "say on the pass which program of ours means the same: {}; `curitiba list` describes them. Programs that read a G-buffer: {}",
                names.join(", "),
                suggest(stem, RAY_PROGRAMS.iter().filter(|info| !info.starts_at_camera()).map(|info| info.stem))
            )
        });
        None
    }

    /// Whether the light is treated as a point light, and not as a directional light. `from` decides if it is given; otherwise a
    /// light without a direction is a point light. `None` after an error, if the light lacks the position or the direction that its
    /// treatment needs.
    fn is_lamp(&mut self, info: &RayProgramInfo, light: Option<(usize, Span)>, from: Option<From>) -> Option<bool> {
        let Some((index, at)) = light else { return Some(false) };
        let Some(light) = &self.lights.items[index] else { return Some(false) };
        let lamp = from.map_or(light.direction.is_none(), |from| from == From::Place);
        let (missing, tag) =
            if lamp { (light.position.is_none(), "position") } else { (light.direction.is_none(), "direction") };
        if missing {
            let message = format!("program `{}` needs a {tag}, which light `{}` lacks", info.stem, light.name);
            self.report.error_help(at, message, || format!("give the light a <{tag}>"));
            return None;
        }
        Some(lamp)
    }

    /// A named number of a pass: from the pass's child of that name, or else from the project's declarations.
    fn pass_value(&mut self, pass: &Element, name: &str) -> Option<f32> {
        if let Some(child) = pass.children_named(&[name]).next() {
            return self.number_of(child, "value");
        }
        self.attributes.declared(name).map(|(_, value)| value)
    }

    /// The parameters of a pass that hands inputs to device programs, as the tutorials' passes do.
    fn tutorial_params(
        &mut self,
        pass: &Element,
        info: &RayProgramInfo,
        handed: &Handed,
        camera: Option<usize>,
    ) -> RayParams {
        let mut params = info.defaults();
        let path = info.program == RayProgram::PathTracing;
        params.background = if path { Background::Black } else { Background::Blue };
        let mut value = |name: &str| -> Option<f32> {
            let engines = ["RAYS_PER_PIXEL", "MAX_DEPTH"].contains(&name);
            (engines || handed.has(name)).then(|| self.pass_value(pass, name)).flatten().filter(|v| v.is_finite())
        };
        let mut rays = value("RAYS_PER_PIXEL").unwrap_or(1.0).max(1.0).powi(2);
        // Each camera ray here takes one sample of the light or of the directions, so the tutorials' sample counts multiply the number of
        // camera rays.
        let ways = match info.program {
            RayProgram::CameraOcclusion => value("AO_RAYS").unwrap_or(1.0),
            RayProgram::Whitted => {
                value("SHADOW_RAYS").unwrap_or(1.0).max(1.0).powi(2).max(value("GLOSSY_RAYS").unwrap_or(1.0))
            }
            _ => 1.0,
        };
        rays *= ways.max(1.0);
        params.samples = if rays > 1.0 { rays.min(MOST_SAMPLES as f32) as u32 } else { 0 };
        if let Some(radius) = value("AO_RADIUS").filter(|radius| *radius > 0.0) {
            params.radius = radius;
        }
        if handed.lit_from == Some(From::Place) {
            params.camera.ambient = 0.0;
        }
        if info.program == RayProgram::Whitted && handed.has("SHADOW_RAYS") {
            (params.camera.light_width, params.camera.light_depth) = (SOFT_LIGHT, SOFT_LIGHT);
        }
        if let Some(exponent) = value("GLOSSINESS") {
            params.camera.gloss = exponent.clamp(0.0, crate::camera_programs::MOST_GLOSS);
        }
        let (aperture, focus) = (value("APERTURE"), value("FOCAL_DISTANCE"));
        let (scale, gamma, depth) = (value("LIGHT_SCALE"), value("GAMMA"), value("MAX_DEPTH"));
        if let Some(aperture) = aperture.filter(|aperture| *aperture > 0.0) {
            // `APERTURE` is the square of the lens radius. The unit of the radius is half the picture's height at distance 1.
            let fov = camera.and_then(|camera| self.cameras.items[camera].as_ref()).map_or(1.0, |camera| camera.fov_y);
            params.camera.aperture = aperture.sqrt() * (0.5 * fov).tan();
        }
        if let Some(focus) = focus.filter(|focus| *focus > 0.0) {
            params.camera.focus = focus;
        }
        if path {
            [params.camera.light_width, params.camera.light_depth] = PATH_LIGHT;
            params.camera.radiance = (PATH_RADIANCE * scale.unwrap_or(1.0)).clamp(f32::MIN_POSITIVE, f32::MAX);
            params.camera.gamma = gamma.unwrap_or(1.0).clamp(0.1, 10.0);
            params.depth = (depth.unwrap_or(1.0).clamp(1.0, 17.0) - 1.0) as u32;
        }
        params
    }

    /// The behaviour of rays at the materials, from the pass's own lists and from the names of device programs. `None` after an error.
    fn surfaces(&mut self, pass: &Element) -> Option<Surfaces> {
        let (mut surfaces, mut said) = (Vec::new(), Vec::new());
        let mut whole = true;
        for (name, kind) in SurfaceKind::NAMED {
            for list in pass.children_named(&[name]) {
                self.expect(list, &["material"], &[]);
                for material in list.children_named(&["material"]) {
                    self.expect(material, &[], &["name"]);
                    let pattern = self.required(material, "name").and_then(|name| self.pattern_by_beginning(name));
                    whole &= pattern.is_some();
                    surfaces.extend(pattern.map(|pattern| (pattern, kind)));
                }
            }
        }
        let default = pass.children_named(DEFAULT_MATERIAL).flat_map(programs_of);
        let default: Vec<String> = default.into_iter().map(|given| given.proc.text.to_ascii_lowercase()).collect();
        for map in pass.children_named(MATERIAL_MAP).flat_map(|list| list.children_named(MAP)) {
            let pattern = self.required(map, "to").and_then(|to| {
                let name = self.without_library(&to.text).trim().to_owned();
                self.pattern_by_beginning(&Value { text: name, joined: None, span: to.span })
            });
            let kind = self.kind_of_map(map, &default, &mut said);
            whole &= pattern.is_some() && kind.is_some();
            surfaces.extend(pattern.zip(kind).filter(|(_, kind)| *kind != SurfaceKind::Painted));
        }
        whole.then_some((surfaces, said))
    }

    /// The behaviour of the materials of a material map, from the names of the map's radiance programs. `None` after an error.
    fn kind_of_map(&mut self, map: &Element, default: &[String], said: &mut Vec<String>) -> Option<SurfaceKind> {
        let mut kind = SurfaceKind::Painted;
        for given in programs_of(map).into_iter().filter(|given| !given.of_shadow() && !given.of_kind("MISS")) {
            let proc = given.proc.text.to_ascii_lowercase();
            kind = match () {
                () if proc.contains("alpha") => SurfaceKind::CutOut,
                // The closest-hit program decides. Other programs, and those of the default material, only cut out or do nothing.
                () if default.contains(&proc) || !given.of_kind("CLOSEST_HIT") => kind,
                () if proc.contains("light") => SurfaceKind::Light,
                () if proc.contains("metal") => SurfaceKind::Metal,
                () if proc.contains("glass") && self.is_of_transparency() => {
                    said.push(format!(
                        "glass is seen straight through, for the project is named `{}`",
                        shown(&self.title)
                    ));
                    SurfaceKind::Clear
                }
                () if proc.contains("glass") => SurfaceKind::Glass,
                () => {
                    let message = format!("no meaning is known of the program `{}` of a material", given.proc.shown());
                    self.report.error_help(given.proc.span, message, || {
                        let lists: Vec<String> =
                            SurfaceKind::NAMED.iter().map(|(name, _)| format!("<{name}><material name=\"…\"/></{name}>")).collect();
                        format!(
                            "known are names with alpha, light, metal and glass, and those of the default material; or leave the map out, \
                             and list the material in one of {}",
                            lists.join(", ")
                        )
                    });
                    return None;
                }
            };
        }
        Some(kind)
    }

    /// Whether the project's title mentions transparency but not refraction: glass of such a project does not refract.
    fn is_of_transparency(&self) -> bool {
        let title = self.title.to_ascii_lowercase();
        title.contains("transparency") && !title.contains("refraction")
    }

    /// Parses a pattern: `*`, a name, or the beginning of names followed by an asterisk.
    fn pattern_by_beginning(&mut self, name: &Value) -> Option<MaterialPattern> {
        match name.text.strip_suffix('*') {
            Some(beginning) if !beginning.is_empty() && !beginning.contains('*') => {
                Some(MaterialPattern::Beginning(beginning.to_owned()))
            }
            _ => self.material_pattern(name),
        }
    }
}

/// A device program that a material names.
struct Given<'e> {
    kind: &'e str,
    ray: &'e str,
    proc: &'e Value,
}

impl Given<'_> {
    fn of_kind(&self, kind: &str) -> bool {
        self.kind.eq_ignore_ascii_case(kind)
    }

    fn of_shadow(&self) -> bool {
        self.ray.eq_ignore_ascii_case("Shadow")
    }
}

/// The device programs of a material, each with its ray type.
fn programs_of(container: &Element) -> Vec<Given<'_>> {
    let mut given = Vec::new();
    for child in &container.children {
        let (ray, programs) = if child.is(&["rayType"]) {
            (child.attribute("name"), child.children.iter().collect::<Vec<_>>())
        } else {
            (child.attribute("ray"), vec![child])
        };
        for program in programs.into_iter().filter(|program| program.is(PROGRAM)) {
            let (kind, proc) = (program.attribute("type"), program.attribute("proc"));
            if let (Some(kind), Some(proc)) = (kind, proc) {
                given.push(Given { kind: &kind.text, ray: ray.map_or("", |ray| &ray.text), proc });
            }
        }
    }
    given
}
