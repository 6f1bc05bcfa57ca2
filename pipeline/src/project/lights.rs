//! Reading lights, and the references to lights in passes.

use super::dom::Element;
use super::loader::Loader;
use super::passes::PassContext;
use super::report::{Span, shown};
use super::{Falloff, Light, Spot};
use glam::{Vec3, Vec4};

/// Greatest number of lights of a pass: every pixel may trace a shadow ray to each.
const MOST_LIGHTS: usize = 256;

/// Cutoff angle, in degrees, of a spot light that shines in all directions.
const EVERYWHERE: f32 = 180.0;

impl Loader {
    /// Reads a `<light>`.
    pub fn light(&mut self, element: &Element) {
        const CHILDREN: &[&str] = &[
            "position",
            "direction",
            "color",
            "diffuse",
            "ambient",
            "specular",
            "attenuation",
            "constant_att",
            "linear_att",
            "quad_att",
            "quadratic_att",
            "range",
            "spot_direction",
            "spot_exponent",
            "spot_cutoff",
            "spot_inner",
        ];
        self.expect(element, CHILDREN, &["name", "type", "class"]);
        let Some(name) = self.required(element, "name") else { return };
        let position = self.single(element, &["position"]);
        let place = position.map_or(Some(None), |position| self.point(position).map(Some));
        let direction = match self.single(element, &["direction"]) {
            Some(direction) => self.direction(direction).map(Some),
            None => Some(None),
        };
        let color = match self.single(element, &["color", "diffuse"]) {
            Some(color) => self.color(color).map(Vec4::truncate),
            None => Some(Vec3::ONE),
        };
        for unused in ["ambient", "specular"] {
            if let Some(color) = self.single(element, &[unused]) {
                self.color(color);
            }
        }
        if position.is_none() && direction == Some(None) {
            let message = format!("light `{}` has neither a direction nor a position", name.shown());
            self.report.error_help(element.span, message, || {
                "valid: <direction x y z/>, or for a point or spot light <position x y z/>".to_owned()
            });
        }
        let is = |kind: &str| element.attribute("type").is_some_and(|given| given.text.eq_ignore_ascii_case(kind));
        // A light of these types with a position is positional, not directional: a direction is only the axis of a spot light.
        let has_place = position.is_some() && (is("spot") || is("point"));
        if let Some(kind) = element.attribute("type")
            && !is("directional")
            && !has_place
            && direction.is_some_and(|direction| direction.is_some())
        {
            let message = format!("light `{}` shines as a directional one", name.shown());
            self.report.warning(kind.span, message, || {
                Some("valid: directional; or point and spot, with a <position>".to_owned())
            });
        }
        let (along, direction) = if has_place { (direction, Some(None)) } else { (None, direction) };
        let falloff = match direction {
            Some(None) => self.falloff(element, along.flatten().filter(|_| is("spot")), is("point")),
            _ => Some(Falloff::default()),
        };
        let item = (|| {
            let (name, falloff) = (name.text.clone(), falloff?);
            Some(Light { name, direction: direction?, position: place?, color: color?, falloff })
        })();
        let extra = self.light_extra(element);
        self.light_extras.push(extra);
        self.lights.add(&mut self.report, name, item);
    }

    /// Falloff of a positional light. `along` is the axis of a spot light that names no `SPOT_DIRECTION`.
    fn falloff(&mut self, element: &Element, along: Option<Vec3>, is_point: bool) -> Option<Falloff> {
        let usual = Falloff::default();
        let parts = [
            self.part_of(element, &["constant_att"], usual.attenuation[0], (0.0, f32::MAX)),
            self.part_of(element, &["linear_att"], usual.attenuation[1], (0.0, f32::MAX)),
            self.part_of(element, &["quadratic_att", "quad_att"], usual.attenuation[2], (0.0, f32::MAX)),
        ];
        let range = self.part_of(element, &["range"], usual.range, (f32::MIN_POSITIVE, f32::MAX));
        let cutoff = self.part_of(element, &["spot_cutoff"], EVERYWHERE, (f32::MIN_POSITIVE, EVERYWHERE));
        let exponent = self.part_of(element, &["spot_exponent"], 0.0, (0.0, f32::MAX));
        let inner = self.part_of(element, &["spot_inner"], EVERYWHERE, (0.0, EVERYWHERE));
        let axis = match self.single(element, &["spot_direction"]) {
            Some(axis) => self.direction(axis),
            None => Some(along.unwrap_or(Vec3::NEG_Z)),
        };
        let [constant, linear, quadratic] = parts;
        let attenuation = [constant?, linear?, quadratic?];
        if attenuation == [0.0; 3] {
            let message = format!("<{}> divides its light by 0 at every distance", element.name);
            self.report.error_help(element.span, message, || {
                "valid: a <CONSTANT_ATT>, <LINEAR_ATT> or <QUADRATIC_ATT> above 0".to_owned()
            });
            return None;
        }
        let (cutoff, exponent, axis) = (cutoff?, exponent?, axis?);
        // As in OpenGL, a cutoff of 180 degrees means no cone, but an exponent still applies.
        let is_spot = !is_point && (cutoff < EVERYWHERE || exponent > 0.0);
        if let Some(kind) = element.attribute("type").filter(|kind| kind.text.eq_ignore_ascii_case("spot") && !is_spot)
        {
            let message = "a spot light without <SPOT_CUTOFF> shines in all directions";
            self.report.warning(kind.span, message, || Some("valid: <SPOT_CUTOFF value=\"30\"/>, degrees".to_owned()));
        }
        if let Some(other) = self.single(element, &["attenuation"]) {
            let message = format!("<{}> of a light is not read", other.name);
            self.report.warning(other.span, message, || {
                Some("valid: <CONSTANT_ATT value/>, <LINEAR_ATT value/>, <QUADRATIC_ATT value/>".to_owned())
            });
        }
        let spot = is_spot.then_some(Spot { axis, cutoff, inner: inner?.min(cutoff), exponent });
        Some(Falloff { attenuation, range: range?, spot })
    }

    /// The number in the attribute `value` or `x` of the only child with one of these names, from `least` to `most`; `usual`
    /// without such a child.
    fn part_of(&mut self, element: &Element, names: &[&str], usual: f32, (least, most): (f32, f32)) -> Option<f32> {
        let Some(child) = self.single(element, names) else { return Some(usual) };
        self.expect(child, &[], &["value", "x"]);
        let value = match child.attribute("x") {
            Some(value) => value,
            None => self.required(child, "value")?,
        };
        let number = self.number(value)?;
        if (least..=most).contains(&number) {
            return Some(number);
        }
        let message = format!("<{}> is {}", child.name, value.shown());
        self.report.error_help(value.span, message, || {
            let from = if least == 0.0 { "from" } else { "above" };
            let to = if most == f32::MAX { String::new() } else { format!(" to {most}") };
            format!("valid: numbers {from} 0{to}")
        });
        None
    }

    /// The lights of a pass, each with the place of its name. `None` if one could not be resolved.
    pub fn pass_lights(&mut self, context: &PassContext<'_>) -> Option<Vec<(usize, Span)>> {
        let mut lights: Vec<(usize, Span)> = Vec::new();
        let mut whole = true;
        for list in context.element.children_named(&["lights"]) {
            self.expect(list, &["light"], &[]);
            for reference in list.children_named(&["light"]) {
                let name = self.reference(reference);
                let found = name.and_then(|name| {
                    let index = self.lights.names.resolve(&mut self.report, &name.text, name.span)?;
                    Some((index, name.span))
                });
                let Some((index, at)) = found else {
                    whole = false;
                    continue;
                };
                if lights.iter().any(|(named, _)| *named == index) {
                    let message = format!("pass `{}` names a light twice: it shines once", shown(&context.name));
                    self.report.warning(at, message, || None);
                } else if lights.len() == MOST_LIGHTS {
                    let message = format!("pass `{}` has more than {MOST_LIGHTS} lights", shown(&context.name));
                    self.report.error_help(at, message, || format!("valid: up to {MOST_LIGHTS} lights of a pass"));
                    return None;
                } else {
                    lights.push((index, at));
                }
            }
        }
        whole.then_some(lights)
    }

    /// The first light of a pass whose program supports a single light, with the place of its name. Outer `None` if a light could
    /// not be resolved.
    pub fn first_light(&mut self, context: &PassContext<'_>) -> Option<Option<(usize, Span)>> {
        let lights = self.pass_lights(context)?;
        if let Some((_, at)) = lights.get(1) {
            let message = format!("pass `{}` has several lights: the first one shines", shown(&context.name));
            self.report.warning(*at, message, || None);
        }
        Some(lights.first().copied())
    }
}
