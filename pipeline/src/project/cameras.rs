//! Reading cameras.

use super::dom::{Element, Value};
use super::loader::Loader;
use super::report::Span;
use super::{Camera, Orthographic};
use glam::{DVec3, Vec3};
use std::f32::consts::PI;

/// The projection of a camera.
struct Lens {
    /// Vertical field of view, radians.
    fov_y: f32,
    near: f32,
    far: f32,
    orthographic: Option<Orthographic>,
}

impl Loader {
    /// Reads a `<camera>`.
    pub fn camera(&mut self, element: &Element) {
        const CHILDREN: &[&str] = &[
            "viewport",
            "perspective",
            "ortho",
            "projection",
            "type",
            "projection_type",
            "fov",
            "near",
            "far",
            "left",
            "right",
            "bottom",
            "top",
            "position",
            "view",
            "look_at_point",
            "zx_angle",
            "elevation_angle",
            "up",
        ];
        self.expect(element, CHILDREN, &["name", "type"]);
        let Some(name) = self.required(element, "name") else { return };
        let viewport = match self.single(element, &["viewport"]) {
            Some(reference) => self
                .reference(reference)
                .and_then(|name| self.viewports.names.resolve(&mut self.report, &name.text, name.span))
                .map(Some),
            None => Some(None),
        };
        let lens = self.lens(element);
        let pose = self.pose(element, name);
        let item = (|| {
            let (lens, (position, direction, up)) = (lens?, pose?);
            let Lens { fov_y, near, far, orthographic } = lens;
            let (name, viewport) = (name.text.clone(), viewport?);
            Some(Camera { name, position, direction, up, fov_y, near, far, orthographic, viewport })
        })();
        self.cameras.add(&mut self.report, name, item);
    }

    /// Reads the projection. Defaults are the engine's: 60 degrees, near 1, far 10,000; an orthographic projection spans -1 to 1.
    fn lens(&mut self, element: &Element) -> Option<Lens> {
        let lens = self.single(element, &["perspective", "ortho", "projection"]);
        if let Some(lens) = lens {
            self.expect(lens, &[], &["type", "fov", "near", "far", "left", "right", "bottom", "top"]);
        }
        // In 2014 files the type is an attribute of the camera; today it is an attribute of the projection or an element.
        let mut value_of = |name: &str| -> Result<Option<Value>, ()> {
            let own = self.single(element, &[name]);
            let inside = lens.and_then(|lens| lens.attribute(name));
            match (inside, own) {
                (Some(_), Some(own)) => {
                    self.report.error(own.span, format!("<{}> is given twice", own.name));
                    Err(())
                }
                (Some(value), None) => Ok(Some(value.clone())),
                (None, Some(own)) => self.required(own, "value").map(|value| Some(value.clone())).ok_or(()),
                (None, None) => Ok(None),
            }
        };
        let (kind, fov, near, far) = (value_of("type"), value_of("fov"), value_of("near"), value_of("far"));
        let sides = ["left", "right", "bottom", "top"].map(&mut value_of);
        let kinds = kind.ok()?.into_iter().chain(element.attribute("type").cloned());
        let (mut valid, mut orthographic) = (true, lens.is_some_and(|lens| lens.is(&["ortho"])));
        for kind in kinds {
            match kind.text.to_ascii_lowercase().as_str() {
                "perspective" => {}
                "ortho" => orthographic = true,
                _ => {
                    let message = format!("`{}` is not a projection", kind.shown());
                    self.report.error_help(kind.span, message, || "valid: perspective, ortho".to_owned());
                    valid = false;
                }
            }
        }
        let place = |value: &Result<Option<Value>, ()>| value.as_ref().ok()?.as_ref().map(|value| value.span);
        let (fov_span, near_span, far_span) = (place(&fov), place(&near), place(&far));
        let mut number = |value: Result<Option<Value>, ()>, default: f32| match value {
            Ok(Some(value)) => self.number(&value),
            Ok(None) => Some(default),
            Err(()) => None,
        };
        let (fov, near, far) = (number(fov, 60.0), number(near, 1.0), number(far, 10_000.0));
        let [left, right, bottom, top] = sides;
        let sides = [number(left, -1.0), number(right, 1.0), number(bottom, -1.0), number(top, 1.0)];
        let at = |span: Option<Span>| span.unwrap_or(lens.map_or(element.span, |lens| lens.span));
        if let Some(fov) = fov.filter(|fov| !(orthographic || *fov > 0.0 && *fov < 180.0)) {
            self.report.error_help(at(fov_span), format!("a field of view of {fov} degrees"), || {
                "valid: above 0 and below 180 degrees, vertical".to_owned()
            });
            valid = false;
        }
        let [left, right, bottom, top] = sides;
        let (fov, near, far, sides) = (fov?, near?, far?, [left?, right?, bottom?, top?]);
        if near <= 0.0 && !orthographic {
            self.report.error_help(at(near_span), format!("a near distance of {near}"), || "valid: above 0".to_owned());
            valid = false;
        } else if far <= near {
            self.report.error_help(
                at(far_span),
                format!("the far distance {far} is not beyond the near one, {near}"),
                || format!("valid: above {near}"),
            );
            valid = false;
        }
        let [left, right, bottom, top] = sides;
        if orthographic && !(left < right && bottom < top) {
            let message =
                format!("an orthographic view from {left} to {right} and from {bottom} to {top} shows nothing");
            self.report.error_help(at(None), message, || "valid: LEFT below RIGHT, BOTTOM below TOP".to_owned());
            valid = false;
        }
        let orthographic = orthographic.then_some(Orthographic { left, right, bottom, top });
        valid.then_some(Lens { fov_y: fov.to_radians(), near, far, orthographic })
    }

    /// Position, unit direction and up vector. Defaults are the engine's: the origin, -z and y. A note mentions a missing position or
    /// direction, not a missing up vector.
    fn pose(&mut self, element: &Element, name: &Value) -> Option<(DVec3, Vec3, Vec3)> {
        let position = match self.single(element, &["position"]) {
            Some(position) => self.point(position),
            None => {
                self.report.note(element.span, format!("camera `{}` stands at the origin", name.shown()));
                Some(DVec3::ZERO)
            }
        };
        let mut targets = element.children.iter().filter(|child| child.is(&["view", "look_at_point"]));
        let target = match (targets.next(), targets.next(), targets.next()) {
            // Files that the engine wrote contain both a view and a target; they must agree.
            (Some(one), Some(other), None) if one.is(&["view"]) != other.is(&["view"]) => {
                self.agree([one, other], position)
            }
            _ => self.single(element, &["view", "look_at_point"]),
        };
        let direction = match target {
            Some(view) if view.is(&["view"]) => self.direction(view),
            Some(point) => self.point(point).and_then(|target| {
                // In f64: the difference of large finite vectors overflows f32.
                let unit = (target - position?).try_normalize().map(|unit| unit.as_vec3());
                if unit.is_none() {
                    self.report.error(point.span, "the camera looks at the point where it stands");
                }
                unit
            }),
            None => self.angles(element, name),
        };
        let up_element = self.single(element, &["up"]);
        let up = up_element.map_or(Some(Vec3::Y), |up| self.direction(up));
        let (position, direction, up) = (position?, direction?, up?);
        // Below this sine the picture's horizontal axis would be rounding noise.
        if direction.cross(up).length() < 1e-4 {
            let at = up_element.or(target).map_or(element.span, |part| part.span);
            self.report.error(at, "the camera's up vector is parallel to its view");
            return None;
        }
        Some((position, direction, up))
    }

    /// Takes the elements of a view direction and a target, in either order, and returns the element of the view direction.
    /// Reports an error if the direction and the target disagree.
    fn agree<'e>(&mut self, both: [&'e Element; 2], position: Option<DVec3>) -> Option<&'e Element> {
        let [first, second] = both;
        let (view, point) = if first.is(&["view"]) { (first, second) } else { (second, first) };
        let looks = self.point(point).zip(position).and_then(|(point, from)| (point - from).try_normalize());
        let same = looks.zip(self.direction(view)).is_some_and(|(looks, view)| looks.dot(view.as_dvec3()) > 0.999);
        if !same {
            let message = format!("<{}> contradicts <{}> of line {}", second.name, first.name, first.line);
            self.report.error(second.span, message);
        }
        Some(view)
    }

    /// The direction given by `<ZX_ANGLE>` (from z towards x) and `<ELEVATION_ANGLE>` (upwards), in radians. If both angles are
    /// missing, the direction is -z, as in the engine, and a note says so.
    fn angles(&mut self, element: &Element, name: &Value) -> Option<Vec3> {
        let mut angle = |names: &[&str], default: f32| match self.single(element, names) {
            Some(angle) => self.number_of(angle, "value").map(|angle| (true, angle)),
            None => Some((false, default)),
        };
        let (around, above) = (angle(&["zx_angle"], PI), angle(&["elevation_angle"], 0.0));
        let ((has_around, around), (has_above, above)) = (around?, above?);
        if !has_around && !has_above {
            self.report.note(element.span, format!("camera `{}` looks along -z", name.shown()));
            return Some(Vec3::NEG_Z);
        }
        let ((sin_a, cos_a), (sin_b, cos_b)) = (f64::from(around).sin_cos(), f64::from(above).sin_cos());
        Some(DVec3::new(cos_b * sin_a, sin_b, cos_b * cos_a).as_vec3())
    }
}
