//! Depth maps: passes of the classes `depthmap` and `depthmap2`, and the cameras from which lights draw them.
//!
//! As in the engine, each such pass has a camera named `pipeline#pass-LightCam`. This camera looks in the direction of the pass's
//! light and covers the view frustum of the pass's camera between its near and far plane, or between the distances `<FROM>` and
//! `<TO>` of the pass.

use super::dom::{Element, Value};
use super::loader::Loader;
use super::passes::PassContext;
use super::report::{Span, shown};
use super::{Camera, LightCamera, Orthographic, Project, RasterPass, Viewport};
use crate::gbuffer::Rect;
use glam::{DVec3, Vec3};

/// End of the name of a light's camera, after the name of its pass.
const OF_LIGHT: &str = "-LightCam";

impl Loader {
    /// Records the numbers that the passes of a pipeline declare, and the cameras of their lights, before the passes are read:
    /// uniforms may refer to later passes.
    pub fn announce_passes(&mut self, pipeline: &Element) {
        let Some(name) = pipeline.attribute("name") else { return };
        for pass in pipeline.children_named(&["pass"]) {
            let Some(own) = pass.attribute("name") else { continue };
            let key = format!("{}#{}", name.text, own.text);
            self.attributes.pass_keys.push(key.clone());
            self.announce_groups(&key, pass);
            for child in &pass.children {
                let Some(value) = child.attribute("value") else { continue };
                let Some((known, _)) = self.attributes.declared(&child.name) else { continue };
                let known = known.to_owned();
                if let Some(number) = self.optional_number(value) {
                    self.attributes.given_values.insert((key.clone(), known), number);
                }
            }
            let draws =
                |class: &Value| ["depthmap", "depthmap2"].iter().any(|name| class.text.eq_ignore_ascii_case(name));
            if pass.attribute("class").is_some_and(draws) {
                let name = Value { text: format!("{key}{OF_LIGHT}"), joined: None, span: own.span };
                let camera = unplaced(&name.text);
                self.cameras.add(&mut self.report, &name, Some(camera));
            }
        }
    }

    /// Reads a pass of class `depthmap` or `depthmap2`, which draws the depth as seen from the pass's light.
    pub fn depth_map_pass(&mut self, context: &mut PassContext<'_>) -> Option<RasterPass> {
        let key = self.pass_key(&context.name);
        let covers = self.pass_camera(context);
        let light = self.first_light(context);
        let index = match self.cameras.names.find(&format!("{key}{OF_LIGHT}")) {
            super::report::Found::Exact(index) => index,
            _ => {
                let message = format!("pass `{}` of a pipeline without a name has no camera", shown(&context.name));
                self.report.error(context.element.span, message);
                return None;
            }
        };
        let Some((light, at)) = light? else {
            let message = format!("pass `{}` draws the depth that a light sees, and has none", shown(&context.name));
            self.report
                .error_help(context.element.span, message, || "valid: <lights><light name=\"…\"/></lights>".to_owned());
            return None;
        };
        self.check_light(light, at)?;
        let covers = covers?;
        let covered = self.cameras.items[covers].as_ref()?.name.strip_suffix(OF_LIGHT).map(str::to_owned);
        if covered.is_some_and(|pass| self.attributes.pass_keys.contains(&pass)) {
            let message = format!("pass `{}` covers the view of another depth map's camera", shown(&context.name));
            let help = || "valid: a <camera> of the project".to_owned();
            self.report.error_help(context.element.span, message, help);
            return None;
        }
        let distance = |loader: &Self, name: &str| loader.attributes.of_pass(&key, name);
        let (from, to) = (distance(self, "FROM"), distance(self, "TO"));
        if let (Some(from), Some(to)) = (from, to)
            && from >= to
        {
            let message = format!("pass `{}` covers distances FROM {from} TO {to}", shown(&context.name));
            self.report.error_help(context.element.span, message, || "valid: FROM below TO".to_owned());
            return None;
        }
        self.light_cameras.push(LightCamera { camera: index, light, covers, from, to });
        let pass = self.draw_pass(context, Some(index), &["from", "to"])?;
        if !pass.is_all_own() {
            let message = format!("pass `{}` draws a depth map by other shaders than own ones", shown(&context.name));
            let help = "valid: <map fromMaterial=\"*\" …/> to a material with a shader of the project, in builds with the feature `glsl`";
            self.report.error_help(context.element.span, message, || help.to_owned());
            return None;
        }
        Some(pass)
    }

    fn check_light(&mut self, light: usize, at: Span) -> Option<()> {
        // A light that could not be read was reported already.
        let light = self.lights.items[light].as_ref()?;
        if light.direction.is_none() {
            let message = format!("a depth map needs a direction; light `{}` has only a position", light.name);
            self.report.error_help(at, message, || "give the light a <direction>".to_owned());
            return None;
        }
        Some(())
    }
}

impl Project {
    /// Places the cameras of lights so that they cover the views of the passes' cameras in a window of this size. `chosen` is the
    /// camera that replaces all cameras of passes. `part` gives the rectangle of a viewport in a target of a size; without a
    /// viewport, the whole target.
    pub(crate) fn place_light_cameras(
        &mut self,
        chosen: Option<usize>,
        window: [u32; 2],
        part: impl Fn(Option<&Viewport>, [u32; 2]) -> Rect,
    ) {
        let of_lights: Vec<usize> = self.light_cameras.iter().map(|of| of.camera).collect();
        let chosen = chosen.filter(|chosen| !of_lights.contains(chosen));
        for of in self.light_cameras.clone() {
            let covered = &self.cameras[chosen.unwrap_or(of.covers)];
            let rect = part(covered.viewport.map(|viewport| &self.viewports[viewport]), window);
            let aspect = f64::from(rect.width.max(1)) / f64::from(rect.height.max(1));
            let distances = [of.from.unwrap_or(covered.near), of.to.unwrap_or(covered.far)];
            let corners = frustum_corners(covered, aspect, distances.map(f64::from));
            let light = &self.lights[of.light];
            let direction = light.direction.unwrap_or(Vec3::NEG_Z);
            // The engine's up vector, unless the light travels along it.
            let up = if direction.cross(Vec3::Y).length() > 1e-3 { Vec3::Y } else { Vec3::Z };
            let position = light.position.unwrap_or_default();
            // The camera's axes: right, up, and against the direction.
            let right = direction.cross(up).as_dvec3().normalize_or_zero();
            let axes = [right, right.cross(direction.as_dvec3()), -direction.as_dvec3()];
            let seen = corners.map(|corner| DVec3::from_array(axes.map(|axis| axis.dot(corner - position))));
            let (low, high) = seen.iter().fold((seen[0], seen[0]), |(low, high), at| (low.min(*at), high.max(*at)));
            let camera = &mut self.cameras[of.camera];
            (camera.position, camera.direction, camera.up) = (position, direction, up);
            (camera.near, camera.far) = (-high.z as f32, -low.z as f32);
            let (left, right, bottom, top) = (low.x as f32, high.x as f32, low.y as f32, high.y as f32);
            camera.orthographic = Some(Orthographic { left, right, bottom, top });
        }
    }

    /// Whether a camera belongs to a light.
    #[must_use]
    pub fn is_of_light(&self, camera: usize) -> bool {
        self.light_cameras.iter().any(|of| of.camera == camera)
    }
}

/// A light's camera before the plan places it.
fn unplaced(name: &str) -> Camera {
    Camera {
        name: name.to_owned(),
        position: DVec3::ZERO,
        direction: Vec3::NEG_Z,
        up: Vec3::Y,
        fov_y: 1.0,
        near: 0.0,
        far: 1.0,
        orthographic: Some(Orthographic { left: -1.0, right: 1.0, bottom: -1.0, top: 1.0 }),
        viewport: None,
    }
}

/// The corners of a camera's view frustum between two distances, in world space: bit 0 of an index is set at the right, bit 1 at the top,
/// bit 2 at the second distance. `aspect` is the width of the camera's viewport divided by its height.
pub(crate) fn frustum_corners(camera: &Camera, aspect: f64, distances: [f64; 2]) -> [DVec3; 8] {
    let view = camera.direction.as_dvec3();
    let right = view.cross(camera.up.as_dvec3()).normalize_or_zero();
    let up = right.cross(view);
    std::array::from_fn(|corner| {
        let distance = distances[corner >> 2];
        let (to_right, to_top) = (corner & 1 == 1, corner & 2 == 2);
        let (x, y) = match camera.orthographic {
            None => {
                let high = (f64::from(camera.fov_y) * 0.5).tan() * distance;
                let sign = |positive: bool| if positive { 1.0 } else { -1.0 };
                (sign(to_right) * high * aspect, sign(to_top) * high)
            }
            Some(Orthographic { left, right, bottom, top }) => {
                (f64::from(if to_right { right } else { left }), f64::from(if to_top { top } else { bottom }))
            }
        };
        camera.position + view * distance + right * x + up * y
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(orthographic: Option<Orthographic>) -> Camera {
        Camera {
            name: String::new(),
            position: DVec3::new(1.0, 2.0, 3.0),
            direction: Vec3::NEG_Z,
            up: Vec3::Y,
            fov_y: std::f32::consts::FRAC_PI_2,
            near: 1.0,
            far: 9.0,
            orthographic,
            viewport: None,
        }
    }

    /// With a field of view of 90 degrees half the height equals the distance.
    #[test]
    fn the_corners_of_a_view_are_where_its_angles_say() {
        let found = frustum_corners(&camera(None), 2.0, [1.0, 4.0]);
        for (corner, distance) in [(0, 1.0), (7, 4.0)] {
            let sign = if corner == 7 { 1.0 } else { -1.0 };
            let expected = DVec3::new(1.0 + sign * 2.0 * distance, 2.0 + sign * distance, 3.0 - distance);
            assert!(found[corner].distance(expected) < 1e-6, "{corner}: {} beside {expected}", found[corner]);
        }
        let sides = Orthographic { left: -3.0, right: 5.0, bottom: -1.0, top: 2.0 };
        let found = frustum_corners(&camera(Some(sides)), 2.0, [1.0, 4.0]);
        assert!(
            found[0].distance(DVec3::new(-2.0, 1.0, 2.0)) < 1e-6
                && found[7].distance(DVec3::new(6.0, 4.0, -1.0)) < 1e-6
        );
    }
}
