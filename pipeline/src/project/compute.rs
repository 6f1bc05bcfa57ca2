//! Reading compute passes.

use super::ComputePass;
use super::attributes::MAX_GROUPS;
use super::dom::Value;
use super::loader::Loader;
use super::passes::PassContext;
use super::report::shown;
use super::running::RUNNING;
use super::shaders::UsedBy;
use crate::glsl;

/// Greatest number of invocations of a pass.
const MAX_INVOCATIONS: u64 = 1 << 28;

impl Loader {
    /// Reads `<pass class="compute"><material name fromLibrary dimX dimY dimZ/></pass>`.
    pub fn compute_pass(&mut self, context: &mut PassContext<'_>) -> Option<ComputePass> {
        let element = context.element;
        if !glsl::AVAILABLE {
            let message = format!("pass `{}` runs a compute shader", shown(&context.name));
            self.report.error_help(element.span, message, || glsl::MISSING.to_owned());
            context.facts.writes_all();
            return None;
        }
        self.expect_children(element, &[&["material", "lights"][..], &RUNNING].concat());
        self.no_parameters(context, "compute");
        let Some(found) = self.single(element, &["material"]) else {
            let message = format!("pass `{}` names no material with a compute shader", shown(&context.name));
            let help = "valid: <material name=\"…\" fromLibrary=\"…\" dimX=\"64\" dimY=\"64\" dimZ=\"1\"/>";
            self.report.error_help(element.span, message, || help.to_owned());
            return None;
        };
        const DIMENSIONS: [(&str, &str, &str); 3] =
            [("dimX", "bufferX", "offsetX"), ("dimY", "bufferY", "offsetY"), ("dimZ", "bufferZ", "offsetZ")];
        let known = DIMENSIONS.iter().flat_map(|(groups, buffer, offset)| [*groups, *buffer, *offset]);
        self.expect(found, &[], &["name", "fromLibrary"].into_iter().chain(known).collect::<Vec<_>>());
        let mut groups = Some([1; 3]);
        for (axis, (name, buffer, _)) in DIMENSIONS.into_iter().enumerate() {
            if let Some(buffer) = found.attribute(buffer) {
                let message = format!("pass `{}` has its work groups counted in a buffer", shown(&context.name));
                self.report.error_help(buffer.span, message, || format!("valid: {name}=\"64\""));
                groups = None;
                continue;
            }
            let given = found.attribute(name).map_or(Some(1), |value| self.work_groups(value));
            groups = groups.zip(given).map(|(mut groups, count)| {
                groups[axis] = count;
                groups
            });
        }
        let (name, from) = (self.required(found, "name"), self.required(found, "fromLibrary"));
        let (library, material) = self.find_material(from?, name?)?;
        let at = name?.span;
        let shader = self.pass_shader(context, (library, &material, at), UsedBy::Compute)?;
        let Some(first) = shader.buffers_stored().next() else {
            let message = format!("the shader of pass `{}` stores to no image and no buffer", shown(&context.name));
            self.report.error_help(at, message, || "imageStore(…) into a `uniform image2D`".to_owned());
            return None;
        };
        let key = self.pass_key(&context.name);
        let groups = self.attributes.set_groups.get(&key).copied().or(groups)?;
        let group = shader.program.compute.as_ref().map_or([1; 3], |compute| compute.group);
        let invocations: u64 = groups.iter().chain(&group).map(|side| u64::from(*side)).product();
        if invocations > MAX_INVOCATIONS {
            let message = format!("pass `{}` has {invocations} invocations", shown(&context.name));
            let help =
                format!("valid: {MAX_INVOCATIONS} at most: dimX times dimY times dimZ, times those of a work group");
            self.report.error_help(found.span, message, || help);
            return None;
        }
        Some(ComputePass { shader, groups, stored: first.target })
    }

    fn work_groups(&mut self, value: &Value) -> Option<u32> {
        // Some files have a comma between attributes.
        let text = value.text.trim_end_matches(',').to_owned();
        let count = self.number(&Value { text, joined: None, span: value.span })?;
        if count.fract() == 0.0 && (1.0..=MAX_GROUPS as f32).contains(&count) {
            return Some(count as u32);
        }
        let message = format!("`{}` is no number of work groups", value.shown());
        self.report.error_help(value.span, message, || format!("valid: 1 to {MAX_GROUPS}"));
        None
    }
}
