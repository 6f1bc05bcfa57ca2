//! Inputs that a ray pass hands to its program besides buffers: vertex, material and global attributes.

use super::dom::{Element, Value};
use super::loader::Loader;
use super::report::{Span, suggest};
use crate::programs::RayProgramInfo;

pub(super) const VERTEX: &[&str] = &["optixVertexAttributes", "rtVertexAttributes"];
const MATERIAL: &[&str] = &["optixMaterialAttributes", "rtMaterialAttributes"];
pub(super) const GLOBAL: &[&str] =
    &["optixGlobalAttributes", "rtGlobalAttributes", "optixGlobalParams", "rtGlobalParams"];

/// Elements of a pass that are read in this module.
pub(super) const ELEMENTS: &[&str] = &[
    "optixVertexAttributes",
    "rtVertexAttributes",
    "optixMaterialAttributes",
    "rtMaterialAttributes",
    "optixGlobalAttributes",
    "rtGlobalAttributes",
    "optixGlobalParams",
    "rtGlobalParams",
];

/// Valid origins of a variable's value: pairs of kind and component, all equivalent.
struct Origin {
    variable: &'static str,
    valid: &'static [(&'static str, &'static str)],
}

const ORIGINS: &[Origin] = &[
    Origin { variable: "lightDir", valid: &[("LIGHT", "DIRECTION")] },
    Origin { variable: "lightColor", valid: &[("LIGHT", "COLOR"), ("LIGHT", "DIFFUSE")] },
    Origin { variable: "diffuse", valid: &[("COLOR", "DIFFUSE")] },
    Origin { variable: "texCount", valid: &[("TEXTURE", "COUNT"), ("RENDERER", "TEXTURE_COUNT")] },
];

/// The usual kind and component for a variable's value.
pub(super) fn origin(variable: &str) -> (&'static str, &'static str) {
    ORIGINS.iter().find(|origin| origin.variable == variable).map_or(("…", "…"), |origin| origin.valid[0])
}

/// The program of the pass, and its first light. Outer `None`: the light is unknown; inner `None`: the pass has no light.
pub(super) struct Program {
    pub info: &'static RayProgramInfo,
    pub light: Option<Option<(usize, Span)>>,
}

/// A category of inputs (vertex, material, global).
struct Kind {
    /// Name in messages.
    what: &'static str,
    elements: &'static [&'static str],
    needed: &'static [&'static str],
    /// Formats an example of such an input with a given name.
    written: fn(&str) -> String,
}

impl Loader {
    /// Checks that the pass hands over all attributes that the program reads, each from a valid origin; returns whether it does. Adds a
    /// note for each attribute that the program does not read.
    pub fn attributes_handed(&mut self, pass: &Element, program: Program) -> bool {
        let info = program.info;
        let value_of = |name: &str| {
            let (kind, component) = origin(name);
            format!("<valueof optixVar=\"{name}\" type=\"CURRENT\" context=\"{kind}\" component=\"{component}\"/>")
        };
        let kinds = [
            Kind {
                what: "vertex attribute",
                elements: VERTEX,
                needed: info.vertex_attributes,
                written: |name| format!("<attribute name=\"{name}\"/>"),
            },
            Kind {
                what: "material attribute",
                elements: MATERIAL,
                needed: info.material_attributes,
                written: value_of,
            },
            Kind { what: "global attribute", elements: GLOBAL, needed: info.globals, written: value_of },
        ];
        let mut whole = true;
        for kind in kinds {
            whole &= self.kind_handed(pass, &program, &kind);
        }
        whole
    }

    fn kind_handed(&mut self, pass: &Element, program: &Program, kind: &Kind) -> bool {
        const ITEMS: &[&str] = &["attribute", "valueof", "param"];
        let stem = program.info.stem;
        let mut given: Vec<&str> = Vec::new();
        let mut whole = true;
        let mut container = None;
        for list in pass.children_named(kind.elements) {
            container = container.or(Some(list));
            self.expect(list, ITEMS, &[]);
            for item in list.children_named(ITEMS) {
                let variable = match self.any_attribute(item, &["optixVar", "rtVar", "var"]) {
                    Some(variable) => Some(variable),
                    None => self.required(item, "name"),
                };
                let Some(variable) = variable else {
                    whole = false;
                    continue;
                };
                let Some(name) = kind.needed.iter().find(|name| variable.text.eq_ignore_ascii_case(name)) else {
                    let message = format!("program `{stem}` does not read the {} `{}`", kind.what, variable.shown());
                    self.report.note(variable.span, message);
                    continue;
                };
                if *name != variable.text {
                    self.report.note(variable.span, format!("`{}` stands for `{name}`", variable.shown()));
                }
                if given.contains(name) {
                    self.report.error(variable.span, format!("`{name}` is handed over twice"));
                    whole = false;
                } else {
                    given.push(name);
                }
                whole &= item.is(&["attribute"]) || self.origin_valid(item, name, program);
            }
        }
        for name in kind.needed.iter().filter(|name| !given.contains(name)) {
            let message = format!("program `{stem}` reads the {} `{name}`, which the pass does not hand it", kind.what);
            self.report.error_help(container.unwrap_or(pass).span, message, || {
                format!("valid: {} in <{}>", (kind.written)(name), kind.elements[0])
            });
            whole = false;
        }
        whole
    }

    /// Whether `type`, `context` and `component` of an item are a valid origin for its variable.
    fn origin_valid(&mut self, item: &Element, variable: &str, program: &Program) -> bool {
        self.expect(item, &[], &["optixVar", "rtVar", "var", "name", "type", "context", "component", "id"]);
        let Some(origin) = ORIGINS.iter().find(|origin| origin.variable == variable) else { return true };
        let parts = ["type", "context", "component"].map(|name| self.required(item, name));
        let [Some(kind), Some(context), Some(component)] = parts else { return false };
        // In 2014 files the type is CURRENT and the context is the kind; today the type is the kind and the context is CURRENT.
        let current = |value: &Value| value.text.eq_ignore_ascii_case("CURRENT");
        let (kind, holder) = if current(kind) { (context, kind) } else { (kind, context) };
        let valid = |(valid_kind, valid_component): &(&str, &str)| {
            kind.text.eq_ignore_ascii_case(valid_kind) && component.text.eq_ignore_ascii_case(valid_component)
        };
        if !origin.valid.iter().any(valid) {
            let message = format!("`{variable}` cannot be the {} of {}", component.shown(), kind.shown());
            self.report.error_help(component.span, message, || {
                let ways: Vec<String> =
                    origin.valid.iter().map(|(kind, component)| format!("the {component} of {kind}")).collect();
                format!("valid: {}", ways.join(", "))
            });
            return false;
        }
        if let Some(id) = item.attribute("id")
            && self.number(id).is_some_and(|id| id != 0.0)
        {
            let message = format!("`{variable}` reads light or texture {}: only the first can be read", id.shown());
            self.report.error_help(id.span, message, || "valid: id=\"0\"".to_owned());
            return false;
        }
        if kind.text.eq_ignore_ascii_case("LIGHT") && !current(holder) {
            return self.is_first_light(holder, program);
        }
        true
    }

    /// Whether a light named explicitly is the first light of the pass.
    fn is_first_light(&mut self, name: &Value, program: &Program) -> bool {
        let index = self.lights.names.resolve(&mut self.report, &name.text, name.span);
        let (Some(index), Some(Some((first, _)))) = (index, program.light) else { return index.is_some() };
        if index != first {
            let message = format!("`{}` is not the first light of the pass", name.shown());
            let names: Vec<&str> = self.lights.names.iter().collect();
            self.report.error_help(name.span, message, || suggest("", ["CURRENT", names[first]]));
            return false;
        }
        true
    }
}
