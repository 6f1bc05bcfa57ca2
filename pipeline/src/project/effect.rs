//! Reading effect passes: raster effects in place of ray programs.

use super::dom::Element;
use super::loader::Loader;
use super::parameters::Reads;
use super::passes::PassContext;
use super::report::{shown, suggest};
use super::running::RUNNING;
use super::{EffectPass, MaterialPattern};
use crate::raster_effects::{EFFECT_PARAMS, EFFECT_PROGRAMS, EffectParams, EffectProgramInfo};

impl Loader {
    /// Reads a pass of class `effect`.
    pub fn effect_pass(&mut self, context: &mut PassContext<'_>) -> Option<EffectPass> {
        const CHILDREN: &[&str] = &[
            "scenes",
            "camera",
            "viewport",
            "renderTarget",
            "lights",
            "materialMaps",
            "injectionMaps",
            "program",
            "glass",
            "input",
        ];
        let element = context.element;
        self.expect_children(element, &[CHILDREN, &RUNNING].concat());
        context.facts.writes_first(1);
        context.facts.one_size = true;
        if element.children_named(&["renderTarget"]).next().is_none() {
            let message = format!("effect pass `{}` has no render target to write into", shown(&context.name));
            self.report
                .error_help(element.span, message, || "valid: <rendertarget name=\"…\" fromLibrary=\"…\"/>".to_owned());
        }
        let info = self.effect_program(context);
        let reads = info.map(|info| Reads { name: info.name, buffers: info.buffers, params: info.params });
        let mut params = EffectParams::default();
        let valid = self.parameters(context, reads, EFFECT_PARAMS, |name, value| params.set(name, value));
        let (scenes, camera, lights) =
            (self.pass_scenes(context), self.pass_camera(context), self.pass_lights(context));
        let mut colors = Vec::new();
        let maps = self.material_maps(element);
        self.mapped_colors(maps.as_deref().unwrap_or_default(), &mut colors);
        let injected = self.injection_maps(element, &mut colors);
        let inputs = self.inputs(context, &["input"], reads);
        let glass = self.effect_glass(element, info);
        let (info, lights) = (info?, lights?);
        if info.lit && lights.is_empty() {
            let message =
                format!("program `{}` reads a light, and pass `{}` names none", info.name, shown(&context.name));
            self.report.error_help(element.span, message, || suggest("", self.lights.names.iter()));
            return None;
        }
        let (_, _, [position, normal, color]) = (maps?, injected?, inputs?);
        valid.then_some(EffectPass {
            scenes: scenes?,
            camera: camera?,
            lights: lights.into_iter().map(|(index, _)| index).collect(),
            program: info.program,
            params,
            position,
            normal,
            color,
            colors,
            glass: glass?,
        })
    }

    fn effect_program(&mut self, context: &PassContext<'_>) -> Option<&'static EffectProgramInfo> {
        let pass = shown(&context.name);
        let names = || EFFECT_PROGRAMS.iter().map(|info| info.name);
        let Some(program) = self.single(context.element, &["program"]) else {
            self.report.error_help(
                context.element.span,
                format!("effect pass `{pass}` names no <program name=\"…\"/>"),
                || suggest("", names()),
            );
            return None;
        };
        self.expect(program, &[], &["name"]);
        let name = self.required(program, "name")?;
        let found = EFFECT_PROGRAMS.iter().find(|info| info.name.eq_ignore_ascii_case(&name.text));
        match found {
            None => {
                let message = format!("pass `{pass}`: there is no raster effect `{}`", name.shown());
                self.report.error_help(name.span, message, || suggest(&name.text, names()));
            }
            Some(info) if info.name != name.text => {
                self.report.note(name.span, format!("`{}` stands for the raster effect `{}`", name.shown(), info.name));
            }
            Some(_) => {}
        }
        found
    }

    /// The glass materials in `<glass><material name="…"/></glass>`.
    fn effect_glass(&mut self, element: &Element, info: Option<&EffectProgramInfo>) -> Option<Vec<MaterialPattern>> {
        let list = self.single(element, &["glass"]);
        let mut patterns = Some(Vec::new());
        if let Some(list) = list {
            self.expect(list, &["material"], &[]);
            for material in list.children_named(&["material"]) {
                self.expect(material, &[], &["name"]);
                let pattern = self.required(material, "name").and_then(|name| self.material_pattern(name));
                patterns = patterns.zip(pattern).map(|(mut patterns, pattern)| {
                    patterns.push(pattern);
                    patterns
                });
            }
        }
        let info = info?;
        if let Some(list) = list.filter(|_| !info.glass) {
            self.report.note(list.span, format!("program `{}` looks for no glass", info.name));
        }
        if list.is_none() && info.glass {
            let message =
                format!("program `{}` looks for glass, and the pass says of no material that it is", info.name);
            self.report.error_help(element.span, message, || "valid: <glass><material name=\"…\"/></glass>".to_owned());
            return None;
        }
        patterns
    }
}
