//! Writes pipelines and their passes.

use super::library::{DRAWS, Library, colored, joining, texture};
use super::xml::Xml;
use crate::programs::{ProcInfo, Query};
use crate::project::handed::origin;
use crate::project::{
    ChannelRef, Clears, ComputePass, EffectPass, IntersectionPass, MaterialPattern, Pass, PassKind, Project, QuadPass,
    QuadSource, RasterPass, RayPass, RaysTraced, TextureMap,
};
use std::borrow::Cow;

/// A pass and the names that it refers to.
struct Context<'a> {
    project: &'a Project,
    /// Name of the library with the materials.
    library: &'a str,
    /// Number of the pass in the project, which is part of its materials' names.
    number: usize,
    pass: &'a Pass,
}

pub(super) fn write(xml: &mut Xml, project: &Project, libraries: &[Library]) {
    let library = libraries.first().map_or("", |library| library.name.as_str());
    let mut number = 0;
    xml.begin("pipelines", &[]);
    for (index, pipeline) in project.pipelines.iter().enumerate() {
        let mut attributes = Vec::new();
        if !pipeline.name.is_empty() {
            attributes.push(("name", pipeline.name.as_str()));
        }
        if index == project.default_pipeline {
            attributes.push(("default", "true"));
        }
        if let Some(camera) = pipeline.camera {
            attributes.push(("defaultCamera", &project.cameras[camera].name));
        }
        xml.begin("pipeline", &attributes);
        for pass in &pipeline.passes {
            Context { project, library, number, pass }.write(xml);
            number += 1;
        }
        xml.end();
    }
    xml.end();
}

impl Context<'_> {
    fn write(&self, xml: &mut Xml) {
        match &self.pass.kind {
            PassKind::Raster(raster) => self.raster(xml, raster),
            PassKind::Ray(ray) => self.rays(xml, ray),
            PassKind::Effect(effect) => self.effect(xml, effect),
            PassKind::Quad(quad) => self.quad(xml, quad),
            PassKind::Intersection(intersection) => self.intersection(xml, intersection),
            PassKind::Compute(compute) => self.compute(xml, compute),
        }
        if matches!(self.pass.kind, PassKind::Raster(_) | PassKind::Quad(_)) {
            let Clears { color, depth } = self.pass.clears;
            let kept = [("COLOR_CLEAR", color), ("DEPTH_CLEAR", depth)].into_iter().filter(|(_, cleared)| !cleared);
            kept.for_each(|(name, _)| xml.empty(name, &[("value", "false")]));
        }
        xml.end();
    }

    /// Writes the start tag of a pass, with its parameters.
    fn begin(&self, xml: &mut Xml, class: &str, values: &[(&'static str, String)]) {
        let mut attributes = vec![("class", class), ("name", self.pass.name.as_str())];
        attributes.extend(values.iter().map(|(name, value)| (*name, value.as_str())));
        xml.begin("pass", &attributes);
    }

    fn intersection(&self, xml: &mut Xml, pass: &IntersectionPass) {
        self.begin(xml, "embree", &[]);
        let buffer = |target: usize| {
            let target = &self.project.targets[target];
            format!("{}::{}", target.library, target.name)
        };
        pass.scenes.iter().for_each(|scene| xml.empty("scene", &[("name", &self.project.scenes[*scene].name)]));
        let query = match pass.query {
            Query::Closest => "CLOSEST",
            Query::Any => "ANY",
        };
        xml.empty("rays", &[("buffer", &buffer(pass.rays)), ("queryType", query)]);
        xml.empty("hits", &[("buffer", &buffer(pass.hits))]);
        match pass.count {
            RaysTraced::Fixed(count) => xml.empty("rayCount", &[("value", &count.to_string())]),
            RaysTraced::Counted { buffer: counts, offset, .. } => {
                xml.empty("rayCount", &[("buffer", &buffer(counts)), ("offset", &offset.to_string())]);
            }
        }
    }

    /// Writes a compute pass. The library of its material is not written.
    fn compute(&self, xml: &mut Xml, pass: &ComputePass) {
        self.begin(xml, "compute", &[]);
        let groups = pass.groups.map(|count| count.to_string());
        let [x, y, z] = groups.each_ref().map(String::as_str);
        let (library, name) = pass.shader.name.split_once("::").unwrap_or(("", &pass.shader.name));
        xml.empty("material", &[("name", name), ("fromLibrary", library), ("dimX", x), ("dimY", y), ("dimZ", z)]);
    }

    fn target_and_viewport(&self, xml: &mut Xml) {
        if let Some(viewport) = self.pass.viewport {
            xml.text("viewport", &self.project.viewports[viewport].name);
        }
        if let Some(target) = self.pass.target {
            let target = &self.project.targets[target];
            xml.empty("renderTarget", &[("name", &target.name), ("fromLibrary", &target.library)]);
        }
    }

    /// Writes the inputs that passes with a camera have in common: scenes and cameras among them, the camera, viewport and target, and
    /// lights.
    fn seen(&self, xml: &mut Xml, (scenes, frusta): (&[usize], &[usize]), camera: usize, lights: &[usize]) {
        if !scenes.is_empty() || !frusta.is_empty() {
            xml.begin("scenes", &[]);
            scenes.iter().for_each(|scene| xml.text("scene", &self.project.scenes[*scene].name));
            frusta.iter().for_each(|camera| xml.text("scene", &self.project.cameras[*camera].name));
            xml.end();
        }
        xml.text("camera", &self.project.cameras[camera].name);
        self.target_and_viewport(xml);
        if !lights.is_empty() {
            xml.begin("lights", &[]);
            lights.iter().for_each(|light| xml.text("light", &self.project.lights[*light].name));
            xml.end();
        }
    }

    /// Writes `<materialMaps>` for colour maps that replace whole materials, then `<injectionMaps>` for the others.
    fn colors(&self, xml: &mut Xml, draws: bool) {
        let maps = || self.pass.kind.colors().iter().enumerate();
        let material = |map: usize| colored((self.number, self.pass), map);
        if maps().any(|(_, map)| map.texture != TextureMap::Kept) {
            xml.begin("materialMaps", &[]);
            for (index, map) in maps().filter(|(_, map)| map.texture != TextureMap::Kept) {
                let from = pattern(xml, &map.to);
                let to = material(index);
                xml.empty("map", &[("fromMaterial", &from), ("toLibrary", self.library), ("toMaterial", &to)]);
            }
            xml.end();
        }
        let rest = || maps().filter(|(_, map)| map.texture == TextureMap::Kept);
        if !draws && rest().next().is_none() {
            return;
        }
        xml.begin("injectionMaps", &[]);
        if draws {
            xml.begin("map", &[("toMaterial", "*")]);
            xml.empty("shader", &[("fromMaterial", DRAWS), ("fromLibrary", self.library)]);
            xml.end();
        }
        for (index, map) in rest() {
            let to = pattern(xml, &map.to);
            xml.begin("map", &[("toMaterial", &to)]);
            let mut attributes = vec![("fromMaterial", material(index)), ("fromLibrary", self.library.to_owned())];
            for (name, replaced) in [("diffuse", map.diffuse), ("emission", map.emission)] {
                attributes.push((name, replaced.is_some().to_string()));
            }
            let attributes: Vec<(&str, &str)> =
                attributes.iter().map(|(name, value)| (*name, value.as_str())).collect();
            xml.empty("color", &attributes);
            xml.end();
        }
        xml.end();
    }

    fn raster(&self, xml: &mut Xml, raster: &RasterPass) {
        self.begin(xml, "default", &[]);
        self.seen(xml, (&raster.scenes, &raster.frusta), raster.camera, &raster.lights);
        self.colors(xml, true);
    }

    fn rays(&self, xml: &mut Xml, ray: &RayPass) {
        let info = ray.program.info();
        let mut values: Vec<_> = info.params.iter().map(|name| (*name, ray.params.get(name))).collect();
        if let Some(start) = &ray.from_camera {
            values.insert(0, ("program", info.stem.to_owned()));
            self.begin(xml, "rt", &values);
            self.seen(xml, (&ray.scenes, &[]), ray.camera, &ray.lights);
            self.colors(xml, false);
            for (to, kind) in &start.surfaces {
                xml.begin(kind.name(), &[]);
                let name = pattern(xml, to);
                xml.empty("material", &[("name", &name)]);
                xml.end();
            }
            return;
        }
        self.begin(xml, "optix", &values);
        self.seen(xml, (&ray.scenes, &[]), ray.camera, &ray.lights);
        self.colors(xml, false);
        let file = format!("optix/{}.ptx", info.stem);
        xml.begin("optixEntryPoint", &[]);
        xml.empty("optixProgram", &[("type", "RayGen"), ("file", &file), ("proc", info.entry)]);
        xml.end();
        if info.procs.iter().any(|proc| proc.required) {
            xml.begin("optixDefaultMaterial", &[]);
            info.procs.iter().filter(|proc| proc.required).for_each(|proc| program(xml, &file, proc));
            xml.end();
        }
        let mut glass: Vec<&MaterialPattern> = Vec::new();
        for to in ray.glass.iter().chain(&ray.shadow_glass) {
            if !glass.contains(&to) {
                glass.push(to);
            }
        }
        if !glass.is_empty() {
            xml.begin("optixMaterialMap", &[]);
            for to in glass {
                // The library is written too, so that a colon in the material's name is not taken for the separator.
                let name = format!("curitiba_material_lib:{}", pattern(xml, to));
                xml.begin("optixMap", &[("to", &name)]);
                for proc in info.procs.iter().filter(|proc| proc.proc.ends_with("_glass")) {
                    let list = if proc.kind == "Any_Hit" { &ray.shadow_glass } else { &ray.glass };
                    if list.contains(to) {
                        program(xml, &file, proc);
                    }
                }
                xml.end();
            }
            xml.end();
        }
        if !info.vertex_attributes.is_empty() {
            xml.begin("optixVertexAttributes", &[]);
            info.vertex_attributes.iter().for_each(|name| xml.empty("attribute", &[("name", name)]));
            xml.end();
        }
        for (list, names) in
            [("optixMaterialAttributes", info.material_attributes), ("optixGlobalAttributes", info.globals)]
        {
            if !names.is_empty() {
                xml.begin(list, &[]);
                for name in names {
                    let (kind, component) = origin(name);
                    let current = [("optixVar", *name), ("type", "CURRENT"), ("context", kind)];
                    xml.empty("valueof", &[&current[..], &[("component", component)]].concat());
                }
                xml.end();
            }
        }
        self.inputs(xml, "optixInput", [ray.position, ray.normal, ray.color]);
    }

    fn effect(&self, xml: &mut Xml, effect: &EffectPass) {
        let info = effect.program.info();
        let values: Vec<_> = info.params.iter().map(|name| (*name, effect.params.get(name))).collect();
        self.begin(xml, "effect", &values);
        self.seen(xml, (&effect.scenes, &[]), effect.camera, &effect.lights);
        self.colors(xml, false);
        xml.empty("program", &[("name", info.name)]);
        if info.glass {
            xml.begin("glass", &[]);
            for to in &effect.glass {
                let name = pattern(xml, to);
                xml.empty("material", &[("name", &name)]);
            }
            xml.end();
        }
        self.inputs(xml, "input", [effect.position, effect.normal, effect.color]);
    }

    fn inputs(&self, xml: &mut Xml, list: &'static str, channels: [Option<ChannelRef>; 3]) {
        xml.begin(list, &[]);
        for (name, channel) in ["pos_buffer", "norm_buffer", "color_buffer"].into_iter().zip(channels) {
            if let Some(channel) = channel {
                xml.empty("buffer", &[("var", name), ("texture", &texture(self.project, channel))]);
            }
        }
        xml.end();
    }

    fn quad(&self, xml: &mut Xml, quad: &QuadPass) {
        self.begin(xml, "quad", &[]);
        self.target_and_viewport(xml);
        match quad.source {
            QuadSource::Show(channel) => {
                let target = &self.project.targets[channel.target];
                let name = &target.channels[channel.channel].name;
                xml.empty("texture", &[("name", name), ("fromLibrary", &target.library)]);
            }
            QuadSource::Combine { .. } => {
                let name = joining((self.number, self.pass));
                xml.empty("material", &[("name", &name), ("fromLibrary", self.library)]);
            }
            // Written projects are made from scenes and have no own shaders.
            QuadSource::Own => {}
        }
    }
}

fn program(xml: &mut Xml, file: &str, proc: &ProcInfo) {
    xml.empty("optixProgram", &[("type", proc.kind), ("ray", proc.ray), ("file", file), ("proc", proc.proc)]);
}

/// A pattern as text; a name that contains an asterisk cannot be written.
pub(super) fn pattern<'p>(xml: &mut Xml, pattern: &'p MaterialPattern) -> Cow<'p, str> {
    match pattern {
        MaterialPattern::All => Cow::Borrowed("*"),
        MaterialPattern::Named(name) => {
            if name.contains('*') {
                xml.refuse(name);
            }
            Cow::Borrowed(name)
        }
        MaterialPattern::Beginning(name) => Cow::Owned(format!("{name}*")),
    }
}
