//! Reading ray passes: their program, and checks that the pass hands over all inputs of the program.

use super::dom::{Element, Value};
use super::file;
use super::handed::Program;
use super::loader::Loader;
use super::parameters::Reads;
use super::passes::PassContext;
use super::report::{Span, shown, suggest};
use super::running::RUNNING;
use super::{MaterialPattern, PassKind, RayPass};
use crate::programs::{PARAMS, PROCS, RAY_PROGRAMS, RayParams, RayProgramInfo, Sampler, procs_of_kind};

/// Device programs that make a material glass, for radiance and for shadow rays.
const GLASS: &str = "closest_hit_glass";
const SHADOW_GLASS: &str = "any_hit_shadow_glass";

/// Kinds of device programs that a material may have.
const KINDS: [&str; 3] = ["Closest_Hit", "Any_Hit", "Miss"];

/// Kinds of device programs that have no meaning in a material.
const OTHER_KINDS: [&str; 4] = ["RayGen", "Exception", "Geometry_Intersection", "Bounding_Box"];

pub(super) const ENTRY_POINT: &[&str] = &["optixEntryPoint", "rtEntryPoint"];
pub(super) const DEFAULT_MATERIAL: &[&str] = &["optixDefaultMaterial", "rtDefaultMaterial"];
pub(super) const MATERIAL_MAP: &[&str] = &["optixMaterialMap", "rtMaterialMap"];
pub(super) const MAP: &[&str] = &["optixMap", "rtMap"];
pub(super) const GEOMETRY: &[&str] = &["optixGeometryProgram", "rtGeometryProgram"];
pub(super) const PROGRAM: &[&str] = &["optixProgram", "rtProgram"];
pub(super) const INPUT: &[&str] = &["optixInput", "rtInput"];

/// A device program that a material names.
struct Proc<'e> {
    kind: &'e Value,
    ray: &'e Value,
    proc: &'e Value,
}

impl Loader {
    /// Reads a pass of class `optix` or `rt`.
    pub fn ray_pass(&mut self, context: &mut PassContext<'_>) -> Option<PassKind> {
        let element = context.element;
        let from_camera = self.starts_at_camera(element);
        if !from_camera {
            self.expect_ray_children(element);
        }
        context.facts.writes_first(1);
        context.facts.one_size = true;
        if element.children_named(&["renderTarget"]).next().is_none() {
            let message = format!("ray pass `{}` has no render target to write into", shown(&context.name));
            self.report
                .error_help(element.span, message, || "valid: <rendertarget name=\"…\" fromLibrary=\"…\"/>".to_owned());
        }
        if from_camera {
            return self.generated_pass(context);
        }
        self.buffer_pass(context).map(PassKind::Ray)
    }

    /// Reads a pass whose rays start from a G-buffer.
    fn buffer_pass(&mut self, context: &mut PassContext<'_>) -> Option<RayPass> {
        let element = context.element;
        let info = self.ray_program(context);
        let params = self.ray_params(context, info);
        let (camera, lights) = (self.pass_camera(context), self.pass_lights(context));
        let traces = info.is_none_or(|info| !info.procs.is_empty());
        let scenes = if traces || element.children_named(&["scenes"]).next().is_some() {
            self.pass_scenes(context)
        } else {
            Some(Vec::new())
        };
        let mut colors = Vec::new();
        let maps = self.material_maps(element);
        self.mapped_colors(maps.as_deref().unwrap_or_default(), &mut colors);
        let injected = self.injection_maps(element, &mut colors);
        let inputs = self.inputs(context, INPUT, info.map(reads));
        let info = info?;
        let first = lights.as_ref().map(|lights| lights.first().copied());
        let whole = self.attributes_handed(element, Program { info, light: first });
        let lights = lights?;
        if lights.is_empty() && !info.globals.is_empty() {
            let message =
                format!("program `{}` reads a light, and pass `{}` names none", info.stem, shown(&context.name));
            self.report.error_help(element.span, message, || suggest("", self.lights.names.iter()));
            return None;
        }
        let default = self.default_material(context, info);
        let others = self.other_procs(element, info);
        let (glass, shadow_glass) = self.glass(element, info)?;
        let (_, _, inputs) = (maps?, injected?, inputs?);
        if !(whole && default && others) {
            return None;
        }
        let [position, normal, color] = inputs;
        Some(RayPass {
            scenes: scenes?,
            camera: camera?,
            lights: lights.into_iter().map(|(index, _)| index).collect(),
            program: info.program,
            params: params?,
            position,
            normal,
            color,
            colors,
            glass,
            shadow_glass,
            from_camera: None,
        })
    }

    fn expect_ray_children(&mut self, element: &Element) {
        const COMMON: &[&str] =
            &["scenes", "camera", "viewport", "renderTarget", "lights", "materialMaps", "injectionMaps"];
        const READ_OVER: &[&str] = &["optixRayTypes", "rtRayTypes"];
        const PROGRAMS: [&[&str]; 4] = [ENTRY_POINT, DEFAULT_MATERIAL, MATERIAL_MAP, GEOMETRY];
        let valid = [COMMON, &RUNNING, &PROGRAMS.concat(), INPUT, READ_OVER, super::handed::ELEMENTS].concat();
        self.expect_children(element, &valid);
    }

    /// The program that is selected by file stem and `proc` of the ray-generation program.
    fn ray_program(&mut self, context: &PassContext<'_>) -> Option<&'static RayProgramInfo> {
        let element = context.element;
        let pass = shown(&context.name);
        let entry = self.single(element, ENTRY_POINT);
        if let Some(entry) = entry {
            self.expect(entry, &[PROGRAM, &["rayGen", "exception"]].concat(), &[]);
        }
        let mut generators = entry.into_iter().flat_map(|entry| &entry.children).filter(|child| {
            let of_kind = |kind: &Value| kind.text.eq_ignore_ascii_case("RayGen");
            child.is(&["rayGen"]) || child.is(PROGRAM) && child.attribute("type").is_some_and(of_kind)
        });
        let Some(generator) = generators.next() else {
            let at = entry.unwrap_or(element).span;
            self.report.error_help(at, format!("ray pass `{pass}` names no ray-generation program"), || {
                "valid: <optixEntryPoint><optixProgram type=\"RayGen\" file=\"…\" proc=\"…\"/></optixEntryPoint>"
                    .to_owned()
            });
            return None;
        };
        if let Some(second) = generators.next() {
            self.report.error(second.span, format!("ray pass `{pass}` names a second ray-generation program"));
        }
        let (path, proc) = (self.required(generator, "file"), self.required(generator, "proc"));
        let (path, proc) = (path?, proc?);
        let stem = file::stem(path);
        let known = || RAY_PROGRAMS.iter().filter(|info| !info.starts_at_camera());
        let stems = || known().map(|info| info.stem);
        let Some(info) = known().find(|info| info.stem.eq_ignore_ascii_case(stem)) else {
            let message = format!("pass `{pass}`: there is no ray program `{}`", shown(stem));
            self.report.error_help(path.span, message, || suggest(stem, stems()));
            return None;
        };
        if info.stem != stem {
            self.report.note(path.span, format!("`{}` stands for the ray program `{}`", shown(stem), info.stem));
        }
        let entries: Vec<&str> =
            RAY_PROGRAMS.iter().filter(|other| other.stem == info.stem).map(|info| info.entry).collect();
        let found = RAY_PROGRAMS.iter().find(|other| other.stem == info.stem && other.entry == proc.text);
        if found.is_none() {
            let message = format!("pass `{pass}`: `{}` has no entry point `{}`", info.stem, proc.shown());
            self.report.error_help(proc.span, message, || suggest(&proc.text, entries));
        }
        found
    }

    /// The program's parameters, from attributes of the pass element.
    fn ray_params(&mut self, context: &PassContext<'_>, info: Option<&RayProgramInfo>) -> Option<RayParams> {
        let mut params = RayParams::default();
        let whole = self.parameters(context, info.map(reads), PARAMS, |name, value| params.set(name, value));
        let square = params.samples.isqrt().pow(2) == params.samples;
        let at = ["samples", "sampler"].into_iter().find_map(|name| context.element.attribute(name));
        if let Some(at) = at.filter(|_| params.sampler == Sampler::Strata && !square) {
            let message = format!("{} strata are not N x N", params.samples);
            let side = params.samples.isqrt();
            self.report.error_help(at.span, message, || {
                format!("with sampler=strata valid: a square number, such as {} or {}", side * side, (side + 1).pow(2))
            });
            return None;
        }
        whole.then_some(params)
    }

    /// Checks the remaining device programs, for exceptions and triangle intersection.
    fn other_procs(&mut self, element: &Element, info: &RayProgramInfo) -> bool {
        let containers = element.children.iter().filter(|child| child.is(ENTRY_POINT) || child.is(GEOMETRY));
        let mut whole = true;
        for program in containers.flat_map(|container| &container.children) {
            let kind = match program.attribute("type") {
                Some(kind) if program.is(PROGRAM) => kind.text.as_str(),
                _ if program.is(&["exception"]) => "Exception",
                _ => continue,
            };
            // The ray-generation program was read before.
            if kind.eq_ignore_ascii_case("RayGen") {
                continue;
            }
            if let Some(path) = program.attribute("file") {
                whole &= self.is_of_program(path, info);
            }
            if let Some(proc) = program.attribute("proc") {
                whole &= self.has_proc(kind, proc, info);
            }
        }
        whole
    }

    /// Whether a file is that of the pass's program; otherwise it is an error.
    fn is_of_program(&mut self, path: &Value, info: &RayProgramInfo) -> bool {
        let same = file::stem(path).eq_ignore_ascii_case(info.stem);
        if !same {
            let message = format!("`{}` is not of the pass's program, `{}`", path.shown(), info.stem);
            self.report.error_help(path.span, message, || {
                format!("all programs of a pass come from one file: valid: {}", info.stem)
            });
        }
        same
    }

    /// Whether the program's file contains a device program of this type and name, called or not.
    fn has_proc(&mut self, kind: &str, proc: &Value, info: &RayProgramInfo) -> bool {
        let names = procs_of_kind(kind);
        let known = names.is_some_and(|names| names.contains(&proc.text.as_str()));
        if !known {
            let message = format!("program `{}` has no {} `{}`", info.stem, shown(kind), proc.shown());
            self.report.error_help(proc.span, message, || match names {
                Some(names) => suggest(&proc.text, names.iter().copied()),
                None => format!("types of programs: {}", suggest(kind, PROCS.iter().map(|(kind, _)| *kind))),
            });
        }
        known
    }

    /// The device programs in a material, which have one common ray type or each their own.
    fn procs<'e>(&mut self, container: &'e Element, info: &RayProgramInfo) -> Option<Vec<Proc<'e>>> {
        self.stray_text(container);
        self.expect_children(container, &[PROGRAM, &["rayType"]].concat());
        let mut procs = Some(Vec::new());
        let mut add = |loader: &mut Self, element: &'e Element, ray: Option<&'e Value>| {
            let found = loader.proc(element, ray, info);
            procs = procs.take().zip(found).map(|(mut procs, found)| {
                procs.extend(found);
                procs
            });
        };
        for child in &container.children {
            if child.is(PROGRAM) {
                add(self, child, None);
            } else if child.is(&["rayType"]) {
                self.expect(child, PROGRAM, &["name"]);
                let ray = self.required(child, "name");
                for inner in child.children_named(PROGRAM) {
                    add(self, inner, ray);
                }
            }
        }
        procs
    }

    /// A device program of a material; `Some(None)` for one without a meaning there.
    fn proc<'e>(
        &mut self,
        element: &'e Element,
        ray: Option<&'e Value>,
        info: &RayProgramInfo,
    ) -> Option<Option<Proc<'e>>> {
        self.expect(element, &[], &["type", "ray", "file", "proc"]);
        let kind = self.required(element, "type")?;
        if OTHER_KINDS.iter().any(|other| kind.text.eq_ignore_ascii_case(other)) {
            self.report.note(kind.span, format!("`{}` means nothing in a material", kind.shown()));
            let known = element.attribute("proc").is_none_or(|proc| self.has_proc(&kind.text, proc, info));
            return known.then_some(None);
        }
        if !KINDS.iter().any(|other| kind.text.eq_ignore_ascii_case(other)) {
            let message = format!("`{}` is not a type of program", kind.shown());
            self.report.error_help(kind.span, message, || suggest(&kind.text, KINDS));
            return None;
        }
        let ray = match ray {
            Some(ray) => Some(ray),
            None => self.required(element, "ray"),
        };
        let (path, proc) = (self.required(element, "file"), self.required(element, "proc"));
        let (ray, path, proc) = (ray?, path?, proc?);
        if !self.is_of_program(path, info) {
            return None;
        }
        let alike: Vec<&str> = info
            .procs
            .iter()
            .filter(|known| kind.text.eq_ignore_ascii_case(known.kind) && ray.text.eq_ignore_ascii_case(known.ray))
            .map(|known| known.proc)
            .collect();
        if alike.is_empty() {
            if !self.has_proc(&kind.text, proc, info) {
                return None;
            }
            let message = format!("program `{}` never calls {} for rays `{}`", info.stem, kind.shown(), ray.shown());
            self.report.note(proc.span, message);
            return Some(None);
        }
        if !alike.contains(&proc.text.as_str()) {
            let message = format!(
                "program `{}` has no {} `{}` for rays `{}`",
                info.stem,
                kind.shown(),
                proc.shown(),
                ray.shown()
            );
            self.report.error_help(proc.span, message, || suggest(&proc.text, alike));
            return None;
        }
        Some(Some(Proc { kind, ray, proc }))
    }

    /// Whether the default material names all device programs that the program calls.
    fn default_material(&mut self, context: &PassContext<'_>, info: &RayProgramInfo) -> bool {
        let container = self.single(context.element, DEFAULT_MATERIAL);
        let procs = match container {
            Some(container) => match self.procs(container, info) {
                Some(procs) => procs,
                // Invalid entries were reported already; messages about missing ones would repeat that.
                None => return false,
            },
            None => Vec::new(),
        };
        let mut whole = true;
        let mut slots: Vec<(String, String)> = Vec::new();
        for Proc { kind, ray, proc } in &procs {
            let slot = (kind.text.to_ascii_lowercase(), ray.text.to_ascii_lowercase());
            if slots.contains(&slot) {
                let message = format!("a second {} for rays `{}`", kind.shown(), ray.shown());
                self.report.error(proc.span, message);
                whole = false;
            } else {
                slots.push(slot);
            }
        }
        for required in info.procs.iter().filter(|proc| proc.required) {
            if !procs.iter().any(|given| given.proc.text == required.proc && is(given, required.kind, required.ray)) {
                let at: Span = container.unwrap_or(context.element).span;
                let (kind, ray, proc) = (required.kind, required.ray, required.proc);
                let message = format!("program `{}` calls `{proc}`, which the default material lacks", info.stem);
                self.report.error_help(at, message, || {
                    let stem = info.stem;
                    format!(
                        "valid: <optixProgram type=\"{kind}\" ray=\"{ray}\" file=\"optix/{stem}.ptx\" proc=\"{proc}\"/> \
                         in <optixDefaultMaterial>"
                    )
                });
                whole = false;
            }
        }
        whole
    }

    /// A material's name without its library: the part after the name of a known library, or else after the last colon.
    pub(super) fn without_library<'t>(&self, text: &'t str) -> &'t str {
        let known = text.split_once(':').filter(|(library, _)| self.libraries.declares(library.trim()));
        known.map_or_else(|| text.rsplit(':').next().unwrap_or_default(), |(_, name)| name)
    }

    /// The materials that are glass for radiance rays, and those for shadow rays.
    fn glass(
        &mut self,
        element: &Element,
        info: &RayProgramInfo,
    ) -> Option<(Vec<MaterialPattern>, Vec<MaterialPattern>)> {
        let (mut glass, mut shadow_glass) = (Vec::new(), Vec::new());
        let mut whole = true;
        for list in element.children_named(MATERIAL_MAP) {
            self.expect(list, MAP, &[]);
            for map in list.children_named(MAP) {
                self.expect_attributes(map, &["to"]);
                let pattern = self.required(map, "to").and_then(|to| {
                    // `library:material` or `material`; the materials are those of the scene.
                    let name = self.without_library(&to.text).trim().to_owned();
                    self.material_pattern(&Value { text: name, joined: None, span: to.span })
                });
                let procs = self.procs(map, info);
                let (Some(pattern), Some(procs)) = (pattern, procs) else {
                    whole = false;
                    continue;
                };
                for Proc { kind, proc, .. } in procs {
                    let any_hit = kind.text.eq_ignore_ascii_case("Any_Hit");
                    let list = if any_hit { &mut shadow_glass } else { &mut glass };
                    if [GLASS, SHADOW_GLASS].contains(&proc.text.as_str()) {
                        list.push(pattern.clone());
                    } else if !kind.text.eq_ignore_ascii_case("Miss")
                        && list.iter().any(|earlier| *earlier == MaterialPattern::All || *earlier == pattern)
                    {
                        // A list of glass materials cannot express exceptions.
                        let message = format!("an earlier map gives this material glass, not `{}`", proc.shown());
                        self.report
                            .error_help(proc.span, message, || "name each glass material instead of *".to_owned());
                        whole = false;
                    }
                }
            }
        }
        whole.then_some((glass, shadow_glass))
    }
}

fn is(given: &Proc<'_>, kind: &str, ray: &str) -> bool {
    given.kind.text.eq_ignore_ascii_case(kind) && given.ray.text.eq_ignore_ascii_case(ray)
}

fn reads(info: &RayProgramInfo) -> Reads<'_> {
    Reads { name: info.stem, buffers: info.buffers, params: info.params }
}
