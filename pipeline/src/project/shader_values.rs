//! Values that `<valueof>` assigns to uniforms of own shaders.

use super::dom::{Element, Value};
use super::libraries::{LightExtra, ValueOf};
use super::loader::Loader;
use super::report::{Span, suggest};
use crate::glsl::{self, CameraValue, ColorValue, LightValue, Matrix};

/// Default properties of a light, as in the engine.
const LIGHT_DEFAULTS: [(&str, [f32; 4]); 7] = [
    ("AMBIENT", [0.2, 0.2, 0.2, 1.0]),
    ("SPOT_DIRECTION", [0.0, 0.0, -1.0, 0.0]),
    ("SPOT_EXPONENT", [0.0; 4]),
    ("SPOT_CUTOFF", [180.0, 0.0, 0.0, 0.0]),
    ("CONSTANT_ATT", [1.0, 0.0, 0.0, 0.0]),
    ("LINEAR_ATT", [0.0; 4]),
    ("QUADRATIC_ATT", [0.0; 4]),
];

const MATRICES: [(&str, glsl::Value); 9] = [
    ("PROJECTION", glsl::Value::Matrix(Matrix::Projection)),
    ("MODEL", glsl::Value::Matrix(Matrix::Model)),
    ("VIEW", glsl::Value::Matrix(Matrix::View)),
    ("VIEW_MODEL", glsl::Value::Matrix(Matrix::ViewModel)),
    ("PROJECTION_VIEW_MODEL", glsl::Value::Matrix(Matrix::ProjectionViewModel)),
    ("PROJECTION_VIEW", glsl::Value::Matrix(Matrix::ProjectionView)),
    ("NORMAL", glsl::Value::NormalMatrix),
    ("TEXTURE_COUNT", glsl::Value::TextureCount),
    // The only frame of a picture counts as the engine's second, whose number is 1. Passes that run only in the first frame, and passes
    // that skip the first frame, both run in it.
    ("FRAME_COUNT", glsl::Value::Constant([1.0, 0.0, 0.0, 0.0])),
];

const OF_CAMERA: [(&str, CameraValue); 12] = [
    ("POSITION", CameraValue::Position),
    ("VIEW", CameraValue::View),
    ("NORMALIZED_VIEW", CameraValue::View),
    ("UP", CameraValue::Up),
    ("NORMALIZED_UP", CameraValue::Up),
    ("VIEW_MATRIX", CameraValue::ViewMatrix),
    ("PROJECTION_MATRIX", CameraValue::ProjectionMatrix),
    ("PROJECTION_VIEW_MATRIX", CameraValue::ProjectionViewMatrix),
    ("TS05_PVM_MATRIX", CameraValue::TextureMatrix),
    ("FOV", CameraValue::Fov),
    ("NEAR", CameraValue::Near),
    ("FAR", CameraValue::Far),
];

const COLORS: [(&str, ColorValue); 5] = [
    ("DIFFUSE", ColorValue::Diffuse),
    ("AMBIENT", ColorValue::Ambient),
    ("SPECULAR", ColorValue::Specular),
    ("EMISSION", ColorValue::Emission),
    ("SHININESS", ColorValue::Shininess),
];

/// Kinds of objects whose values uniforms can have.
const KINDS: [&str; 7] = ["RENDERER", "CAMERA", "LIGHT", "COLOR", "TEXTURE_BINDING", "IMAGE_TEXTURE", "PASS"];

fn find<T: Copy>(table: &[(&str, T)], name: &str) -> Option<T> {
    table.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|(_, value)| *value)
}

/// The numbers `x` to `w`, `r` to `a`, or `value` of an element; `None` if they are missing or not finite.
fn numbers(element: &Element) -> Option<[f32; 4]> {
    let number = |name: &str| element.attribute(name)?.text.parse::<f32>().ok().filter(|number| number.is_finite());
    let three = |names: [&str; 3]| Some(names.map(number)).filter(|found| found.iter().all(Option::is_some));
    if let Some(value) = number("value") {
        return Some([value, 0.0, 0.0, 0.0]);
    }
    let vector = three(["x", "y", "z"]).map(|found| (found, number("w").unwrap_or(0.0)));
    let color = || three(["r", "g", "b"]).map(|found| (found, number("a").unwrap_or(1.0)));
    let ([x, y, z], w) = vector.or_else(color)?;
    Some([x?, y?, z?, w])
}

impl Loader {
    /// Properties of a light that only own shaders read.
    pub fn light_extra(&self, element: &Element) -> LightExtra {
        let child = |name: &str| element.children.iter().find(|child| child.is(&[name]));
        let direction = child("direction").and_then(numbers);
        let length = direction.map_or(1.0, |[x, y, z, _]| glam::Vec3::new(x, y, z).length());
        let given = |name: &str| child(name).and_then(numbers);
        let values = LIGHT_DEFAULTS.iter().map(|(name, default)| {
            let short = (*name == "QUADRATIC_ATT").then(|| given("QUAD_ATT")).flatten();
            (*name, given(name).or(short).unwrap_or(*default))
        });
        LightExtra { length, values: values.collect() }
    }

    /// Records a number or vector that `<attributes>` declare for shaders.
    pub fn renderer_value(&mut self, item: &Element, name: &Value, number: Option<f32>) {
        if Self::declared_for(item, "RENDERER")
            && let Some(value) = number.map(|number| [number, 0.0, 0.0, 0.0]).or_else(|| numbers(item))
        {
            self.attributes.renderer_values.insert(name.text.clone(), value);
        }
    }

    /// The value of a uniform, or the source from which it is computed. `pass` is `pipeline#pass`; `lights` are the indices
    /// of the pass's lights. `None` after an error, if there is no such value.
    pub fn uniform_value(&mut self, given: &ValueOf, pass: &str, lights: &[usize]) -> Option<glsl::Value> {
        let uniform = given.uniform.shown();
        let mut part = |value: &Option<Value>, name: &str| {
            if value.is_none() {
                let message = format!("the value of the uniform `{uniform}` lacks `{name}`");
                self.report.error_help(given.span, message, || {
                    "valid: <valueof uniform=\"…\" type=\"…\" context=\"…\" component=\"…\"/>".to_owned()
                });
            }
            value.clone()
        };
        let kind = part(&given.kind, "type");
        // As in the engine, a missing context means `CURRENT`.
        let own = |kind: &Value| Value { text: "CURRENT".to_owned(), joined: None, span: kind.span };
        let context = given.context.clone().or_else(|| kind.as_ref().map(own));
        let component = part(&given.component, "component");
        let (kind, context, component) = (kind?, context?, component?);
        let current = context.text.eq_ignore_ascii_case("CURRENT");
        let name = component.text.as_str();
        let id = match &given.id {
            Some(id) => self.number(id)?,
            None => 0.0,
        };
        match kind.text.to_ascii_uppercase().as_str() {
            "RENDERER" if current => {
                let own = self.attributes.renderer_values.get(name).copied().map(glsl::Value::Constant);
                let found = own.or_else(|| find(&MATRICES, name));
                let declared: Vec<String> = self.attributes.renderer_values.keys().cloned().collect();
                let valid = MATRICES.iter().map(|(name, _)| *name).chain(declared.iter().map(String::as_str));
                self.found(found, &uniform, "RENDERER", &component, valid.collect())
            }
            "CAMERA" => {
                let camera = match current {
                    true => None,
                    false => Some(self.cameras.names.resolve(&mut self.report, &context.text, context.span)?),
                };
                let found = find(&OF_CAMERA, name).map(|value| glsl::Value::Camera(camera, value));
                self.found(found, &uniform, "CAMERA", &component, OF_CAMERA.map(|(name, _)| name).into())
            }
            "LIGHT" => {
                let numbered = lights.iter().enumerate().find(|(number, _)| *number as f32 == id);
                let light = match (current, numbered) {
                    (true, Some((_, light))) => *light,
                    (true, None) => {
                        let message =
                            format!("the uniform `{uniform}` is of light {id} of the pass, which has none such");
                        let help = match lights.len() {
                            0 => "valid: id=\"0\" in a pass with a <light>, or the light's name as context".to_owned(),
                            1 => "valid: id=\"0\", or the light's name as context".to_owned(),
                            count => format!("valid: id=\"0\" to id=\"{}\", or the light's name as context", count - 1),
                        };
                        self.report.error_help(context.span, message, || help);
                        return None;
                    }
                    (false, _) => self.lights.names.resolve(&mut self.report, &context.text, context.span)?,
                };
                let found = self.light_value(light, name);
                let names = ["POSITION", "DIRECTION", "NORMALIZED_DIRECTION", "COLOR"];
                let valid = names.into_iter().chain(LIGHT_DEFAULTS.iter().map(|(name, _)| *name)).collect();
                self.found(found, &uniform, "LIGHT", &component, valid)
            }
            "COLOR" if current => {
                let found = find(&COLORS, name).map(glsl::Value::Color);
                self.found(found, &uniform, "COLOR", &component, COLORS.map(|(name, _)| name).into())
            }
            kind @ ("TEXTURE_BINDING" | "IMAGE_TEXTURE") if current => {
                let unit = name.eq_ignore_ascii_case("UNIT") && id.fract() == 0.0 && (0.0..256.0).contains(&id);
                let found = unit.then_some(glsl::Value::Unit(id as u32));
                self.found(found, &uniform, kind, &component, vec!["UNIT"])
            }
            "PASS" => {
                let pass = if current { pass.to_owned() } else { context.text.clone() };
                if !current && !self.attributes.pass_keys.contains(&pass) {
                    let message =
                        format!("the uniform `{uniform}` is of the pass `{}`, which is not there", context.shown());
                    self.report.error_help(context.span, message, || {
                        suggest(&pass, self.attributes.pass_keys.iter().map(String::as_str))
                    });
                    return None;
                }
                let found =
                    self.attributes.of_pass(&pass, name).map(|value| glsl::Value::Constant([value, 0.0, 0.0, 0.0]));
                let declared: Vec<String> = self.attributes.pass_values.keys().cloned().collect();
                self.found(found, &uniform, "PASS", &component, declared.iter().map(String::as_str).collect())
            }
            known if KINDS.contains(&known) => {
                let message = format!("the uniform `{uniform}` is the {name} of {known} `{}`", context.shown());
                self.report.error_help(context.span, message, || "valid: context=\"CURRENT\"".to_owned());
                None
            }
            _ => {
                let message = format!("the uniform `{uniform}` is a value of {}, which is not known", kind.shown());
                self.report.error_help(kind.span, message, || suggest(&kind.text, KINDS));
                None
            }
        }
    }

    fn light_value(&self, light: usize, name: &str) -> Option<glsl::Value> {
        let extra = self.light_extras.get(light)?;
        let of = |value| Some(glsl::Value::Light(light, value));
        match name.to_ascii_uppercase().as_str() {
            "POSITION" => of(LightValue::Position),
            "DIRECTION" => of(LightValue::Direction { length: extra.length }),
            "NORMALIZED_DIRECTION" => of(LightValue::Direction { length: 1.0 }),
            "COLOR" | "DIFFUSE" => of(LightValue::Color),
            name => extra.values.iter().find(|(known, _)| *known == name).map(|(_, v)| glsl::Value::Constant(*v)),
        }
    }

    /// Returns `value`. If it is `None`, reports an error that lists the valid components.
    fn found(
        &mut self,
        value: Option<glsl::Value>,
        uniform: &str,
        kind: &str,
        component: &Value,
        valid: Vec<&str>,
    ) -> Option<glsl::Value> {
        if value.is_none() {
            let message =
                format!("the uniform `{uniform}` is the `{}` of {kind}, which is not known", component.shown());
            self.report.error_help(component.span, message, || suggest(&component.text, valid));
        }
        value
    }

    /// A span in a file of the report.
    pub fn span_in(file: u32, [start, end]: [usize; 2]) -> Span {
        Span { file, start: start as u32, end: end.max(start) as u32 }
    }
}
