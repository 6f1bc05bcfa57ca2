//! Reading numbers, vectors, colours and references from elements. Methods that parse a value return `None` after they have reported an
//! error.

use super::dom::{Element, Value};
use super::loader::Loader;
use super::report::{Span, suggest};
use crate::color::BRIGHTEST;
use crate::image::MAX_SIDE;
use glam::{DVec3, Vec3, Vec4};

/// Names of an element's attributes.
fn attribute_names(element: &Element) -> impl Iterator<Item = &str> {
    element.attributes.iter().map(|attribute| attribute.name.as_str())
}

/// The normalised vector; `None` if it has no direction. A vector whose length is 1 up to the rounding of its components is
/// returned unchanged, so that directions survive writing and reading bit for bit.
pub(super) fn unit(vector: Vec3) -> Option<Vec3> {
    // In f64, because the length of a large finite vector overflows f32.
    let precise = vector.as_dvec3();
    // Each component of a unit vector is rounded by at most 2^-25, so the length by at most sqrt(3) 2^-25.
    let rounded = (precise.length() - 1.0).abs() <= 2.0_f64.powi(-24);
    if rounded { Some(vector) } else { precise.try_normalize().map(|unit| unit.as_vec3()) }
}

impl Loader {
    /// Warns of unknown children and attributes, and notes stray text.
    pub fn expect(&mut self, element: &Element, children: &[&str], attributes: &[&str]) {
        self.stray_text(element);
        self.expect_children(element, children);
        self.expect_attributes(element, attributes);
    }

    /// Notes text between an element's children.
    pub fn stray_text(&mut self, element: &Element) {
        if let Some(text) = &element.text {
            self.report.note(text.span, format!("stray text `{}` is ignored", text.shown()));
        }
    }

    /// Warns of unknown children.
    pub fn expect_children(&mut self, element: &Element, valid: &[&str]) {
        for child in element.children.iter().filter(|child| !child.is(valid)) {
            let message = format!("<{}> in <{}> is not known: it is ignored", child.name, element.name);
            self.report.warning(child.span, message, || Some(suggest(&child.name, valid.iter().copied())));
        }
    }

    /// Warns of unknown attributes.
    pub fn expect_attributes(&mut self, element: &Element, valid: &[&str]) {
        for attribute in &element.attributes {
            if !valid.iter().any(|name| attribute.name.eq_ignore_ascii_case(name)) {
                let message =
                    format!("attribute `{}` of <{}> is not known: it is ignored", attribute.name, element.name);
                self.report
                    .warning(attribute.name_span, message, || Some(suggest(&attribute.name, valid.iter().copied())));
            }
        }
    }

    /// The only child with one of these names; `None` if there is none. More children with these names are reported as errors; the first is
    /// returned.
    pub fn single<'e>(&mut self, element: &'e Element, names: &[&str]) -> Option<&'e Element> {
        let mut found = element.children.iter().filter(|child| child.is(names));
        let first = found.next()?;
        for second in found {
            let message = format!("<{}> contradicts <{}> of line {}", second.name, first.name, first.line);
            self.report.error(second.span, message);
        }
        Some(first)
    }

    /// An attribute that must be present and not empty.
    pub fn required<'e>(&mut self, element: &'e Element, name: &str) -> Option<&'e Value> {
        let value = element.attribute(name);
        match value {
            Some(value) if !value.text.is_empty() => return Some(value),
            Some(value) => self.report.error(value.span, format!("`{name}` of <{}> is empty", element.name)),
            None => self.report.error_help(element.span, format!("<{}> lacks `{name}`", element.name), || {
                if element.attributes.is_empty() {
                    format!("valid: {name}=\"…\"")
                } else {
                    let given: Vec<&str> = attribute_names(element).take(16).collect();
                    format!("given: {}", given.join(", "))
                }
            }),
        }
        None
    }

    /// The name in a reference: `<camera>Name</camera>` or `<camera name="Name"/>`.
    pub fn reference<'e>(&mut self, element: &'e Element) -> Option<&'e Value> {
        match (element.attribute("name"), &element.text) {
            (Some(name), Some(text)) if name.text != text.text => {
                let message = format!("<{}> names `{}` and `{}`", element.name, name.shown(), text.shown());
                self.report.error(element.span, message);
                None
            }
            (_, Some(text)) => Some(text),
            (Some(_), None) => self.required(element, "name"),
            (None, None) => {
                let (name, message) = (&element.name, format!("<{}> names nothing", element.name));
                let help = format!("valid: <{name}>Name</{name}>, <{name} name=\"Name\"/>");
                self.report.error_help(element.span, message, || help);
                None
            }
        }
    }

    /// Parses a finite number, or the name of a constant.
    pub fn number(&mut self, value: &Value) -> Option<f32> {
        let text = value.text.as_str();
        let looks_numeric = text.starts_with(|c: char| c.is_ascii_digit() || matches!(c, '-' | '+' | '.'));
        match text.parse::<f32>() {
            Ok(number) if looks_numeric && number.is_finite() => return Some(number),
            Ok(_) => self.report.error(value.span, format!("`{}` is not a finite number", value.shown())),
            Err(_) => {
                if let Some(constant) = self.constants.get(text) {
                    return Some(*constant);
                }
                self.report.error_help(value.span, format!("`{}` is not a number", value.shown()), || {
                    if looks_numeric || self.constants.is_empty() {
                        "valid: a number such as 102.55, or the name of a constant".to_owned()
                    } else {
                        suggest(text, self.constants.keys().map(String::as_str))
                    }
                });
            }
        }
        None
    }

    /// A finite number, or that of a constant; `None` for a value that is neither. A number that is not finite is an error.
    pub fn optional_number(&mut self, value: &Value) -> Option<f32> {
        match value.text.parse::<f32>() {
            Ok(_) => self.number(value),
            Err(_) => self.constants.get(&value.text).copied(),
        }
    }

    /// A number in a required attribute.
    pub fn number_of(&mut self, element: &Element, name: &str) -> Option<f32> {
        let value = self.required(element, name)?;
        self.number(value)
    }

    /// Three numbers in required attributes. All are checked, even after an error.
    fn three(&mut self, element: &Element, names: [&str; 3]) -> Option<Vec3> {
        let [x, y, z] = names.map(|name| self.number_of(element, name));
        Some(Vec3::new(x?, y?, z?))
    }

    /// The vector `x`, `y`, `z`; a `w` is accepted and ignored.
    pub fn vector(&mut self, element: &Element) -> Option<Vec3> {
        self.expect(element, &[], &["x", "y", "z", "w"]);
        self.three(element, ["x", "y", "z"])
    }

    /// [`Self::vector`] in `f64`: positions in map coordinates have more digits than `f32` holds.
    pub fn point(&mut self, element: &Element) -> Option<DVec3> {
        let rounded = self.vector(element)?;
        let exact = |axis: usize| {
            let written = element.attribute(["x", "y", "z"][axis]).and_then(|value| value.text.parse::<f64>().ok());
            // The `f32` value is used for the name of a constant, and where the `f64` value, rounded to `f32`, differs from it.
            written.filter(|number| *number as f32 == rounded[axis]).unwrap_or_else(|| rounded[axis].into())
        };
        Some(DVec3::new(exact(0), exact(1), exact(2)))
    }

    /// A unit vector; a length of 0 is an error.
    pub fn direction(&mut self, element: &Element) -> Option<Vec3> {
        let vector = self.vector(element)?;
        let unit = unit(vector);
        if unit.is_none() {
            self.report.error(element.span, format!("<{}> has no direction: its length is 0", element.name));
        }
        unit
    }

    /// A colour: `r`, `g`, `b` of at most [`BRIGHTEST`] in absolute value, and `a` (1 if it is missing).
    pub fn color(&mut self, element: &Element) -> Option<Vec4> {
        self.expect(element, &[], &["r", "g", "b", "a"]);
        let alpha = element.attribute("a").map_or(Some(1.0), |value| self.number(value));
        let [r, g, b] = ["r", "g", "b"].map(|name| self.component(element, name));
        Some(Vec4::new(r?, g?, b?, alpha?))
    }

    /// A component of a colour, in a required attribute.
    fn component(&mut self, element: &Element, name: &str) -> Option<f32> {
        let value = self.required(element, name)?;
        let number = self.number(value)?;
        if number.abs() <= BRIGHTEST {
            return Some(number);
        }
        let message = format!("`{}` is beyond what a component of a colour may be", value.shown());
        self.report.error_help(value.span, message, || format!("valid: -{BRIGHTEST:e} to {BRIGHTEST:e}"));
        None
    }

    /// Parses a boolean.
    pub fn boolean(&mut self, value: &Value) -> Option<bool> {
        match value.text.to_ascii_lowercase().as_str() {
            _ if value.is_true() => Some(true),
            "false" | "0" | "no" => Some(false),
            _ => {
                let message = format!("`{}` is neither true nor false", value.shown());
                self.report.error_help(value.span, message, || "valid: true, false".to_owned());
                None
            }
        }
    }

    /// Parses a number of pixels, 1 to [`MAX_SIDE`].
    pub fn side(&mut self, value: &Value) -> Option<u32> {
        let number = self.number(value)?;
        if number.fract() == 0.0 && (1.0..=MAX_SIDE as f32).contains(&number) {
            return Some(number as u32);
        }
        let message = format!("`{}` is not a number of pixels", value.shown());
        self.report.error_help(value.span, message, || format!("valid: 1..={MAX_SIDE}"));
        None
    }

    /// The first of these attributes that an element has.
    pub fn any_attribute<'e>(&self, element: &'e Element, names: &[&str]) -> Option<&'e Value> {
        names.iter().find_map(|name| element.attribute(name))
    }

    /// Place of an element as `file:line:column`.
    pub fn place(&self, element: &Element) -> String {
        format!("{}:{}:{}", self.report.source(element.span.file).path.display(), element.line, element.column)
    }

    /// Span of the value if there is one, otherwise of the element.
    pub fn span_or(value: Option<&Value>, element: &Element) -> Span {
        value.map_or(element.span, |value| value.span)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        #[test]
        fn unit_vectors_keep_their_bits(x in -1.0_f32..1.0, y in -1.0_f32..1.0, z in -1.0_f32..1.0) {
            prop_assume!(Vec3::new(x, y, z).length() > 1e-3);
            let first = Vec3::new(x, y, z).as_dvec3().normalize().as_vec3();
            prop_assert_eq!(unit(first), Some(first));
        }

        #[test]
        fn others_get_length_1(x in -1e38_f32..1e38, y in -1.0_f32..1.0, z in -1e-3_f32..1e-3) {
            let vector = Vec3::new(x, y, z);
            let normalised = unit(vector).expect("a direction").as_dvec3();
            prop_assert!((normalised.length() - 1.0).abs() <= 2.0_f64.powi(-24));
            prop_assert!(normalised.cross(vector.as_dvec3()).length() <= 1e-7 * vector.as_dvec3().length());
        }
    }

    #[test]
    fn directions_that_a_person_rounded_get_length_1() {
        assert_eq!(
            unit(Vec3::new(0.6, 0.8, 1e-3)),
            Some(DVec3::new(0.6_f32.into(), 0.8_f32.into(), 1e-3_f32.into()).normalize().as_vec3())
        );
        assert_eq!(unit(Vec3::ZERO), None);
    }
}
