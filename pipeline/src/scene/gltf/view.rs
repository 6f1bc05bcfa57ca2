//! Cameras and lights (`KHR_lights_punctual`) of an asset, placed by their nodes.

use super::super::{SceneCamera, SceneLight};
use crate::color::in_range;
use crate::diagnostic::Warnings;
use ::gltf::json::{self, camera::Type, validation::Checked};
use glam::{Mat4, Vec3};
use std::f32::consts::{FRAC_PI_4, PI};
use std::path::Path;

const LIGHTS: &str = "KHR_lights_punctual";

/// Greatest angle between the axis of a spot light and the edge of its cone, radians: 90 degrees, rounded up as in files.
const WIDEST: f32 = 1.571;

/// The perspective camera of a node (glTF 2.0, section 3.10). It looks along the node's -z with +y up; scales affect only its
/// position.
pub(super) fn camera(
    root: &json::Root,
    node: &json::Node,
    transform: &Mat4,
    file: &Path,
    warnings: &mut Warnings,
) -> Option<SceneCamera> {
    let index = node.camera?.value();
    let name = || node.name.clone().unwrap_or_else(|| format!("camera {index}"));
    let mut ignored = |why: &str| {
        warnings.add(file, "cameras that cannot be used", "ignored", || format!("`{}` {why}", name()));
        None
    };
    let Some(camera) = root.cameras.get(index) else { return ignored("does not exist") };
    let Some(lens) = camera.perspective.as_ref().filter(|_| camera.type_ == Checked::Valid(Type::Perspective)) else {
        return ignored("is not a perspective camera");
    };
    let position = transform.transform_point3(Vec3::ZERO);
    let (direction, up) = (direction(transform, Vec3::NEG_Z), direction(transform, Vec3::Y));
    let valid_lens = lens.yfov > 0.0 && lens.yfov < PI && lens.znear > 0.0 && lens.znear.is_finite();
    let far = lens.zfar.filter(|far| *far > lens.znear && far.is_finite());
    let aspect = lens.aspect_ratio.filter(|aspect| *aspect > 0.0 && aspect.is_finite());
    match (direction, up) {
        (Some(direction), Some(up)) if valid_lens && position.is_finite() => {
            if aspect != lens.aspect_ratio {
                let what = "aspect ratios of cameras that are no number above 0";
                warnings.add(file, what, "not read", || format!("`{}`", name()));
            }
            Some(SceneCamera { name: name(), position, direction, up, fov_y: lens.yfov, aspect, near: lens.znear, far })
        }
        _ => ignored("has no view, or numbers out of range"),
    }
}

/// The light of a node: it shines along the node's -z. Scales affect only its position.
pub(super) fn light(
    root: &json::Root,
    node: &json::Node,
    transform: &Mat4,
    file: &Path,
    warnings: &mut Warnings,
) -> Option<SceneLight> {
    let index = node.extensions.as_ref()?.others.get(LIGHTS)?.get("light")?.as_u64()?;
    let mut ignored = |why: &str| {
        warnings.add(file, "lights that no program reads", "ignored", || format!("light {index} {why}"));
        None
    };
    let lights = root.extensions.as_ref().and_then(|extensions| extensions.others.get(LIGHTS)?.get("lights"));
    let Some(light) = lights.and_then(|lights| lights.get(usize::try_from(index).ok()?)) else {
        return ignored("does not exist");
    };
    let (has_place, is_spot) = match light.get("type").and_then(|kind| kind.as_str()) {
        Some("directional") => (false, false),
        Some("point") => (true, false),
        Some("spot") => (true, true),
        _ => return ignored("is of no known type"),
    };
    let number = |value: Option<&serde_json::Value>, default: f64| value.and_then(|v| v.as_f64()).unwrap_or(default);
    let intensity = number(light.get("intensity"), 1.0).max(0.0);
    let color = light.get("color");
    let color = Vec3::from(
        [0, 1, 2].map(|axis| (number(color.and_then(|color| color.get(axis)), 1.0).max(0.0) * intensity) as f32),
    );
    let direction = match has_place && !is_spot {
        true => Some(Vec3::ZERO),
        false => direction(transform, Vec3::NEG_Z),
    };
    let position = transform.transform_point3(Vec3::ZERO);
    let Some(direction) = direction.filter(|_| in_range(color) && position.is_finite()) else {
        return ignored("has no direction, or numbers out of range");
    };
    let range = number(light.get("range"), f64::INFINITY) as f32;
    let spot = light.get("spot");
    let angle = |name: &str, usual: f32| number(spot.and_then(|spot| spot.get(name)), usual.into()) as f32;
    let cone = [angle("innerConeAngle", 0.0), angle("outerConeAngle", FRAC_PI_4)];
    let [inner, outer] = cone;
    // KHR_lights_punctual: the inner angle is below the outer one, and the outer one is at most 90 degrees. Equal angles are accepted too.
    if range.is_nan() || range <= 0.0 || is_spot && !(0.0 <= inner && inner <= outer && 0.0 < outer && outer <= WIDEST)
    {
        return ignored("has a range or a cone that is not valid");
    }
    let name = light.get("name").and_then(|name| name.as_str()).or(node.name.as_deref());
    Some(SceneLight {
        name: name.map_or_else(|| format!("light {index}"), str::to_owned),
        direction,
        color,
        position: has_place.then_some(position),
        range: if has_place { range } else { f32::INFINITY },
        cone: is_spot.then_some(cone),
    })
}

/// Transforms a direction of the node to a unit direction in the world; `None` if it has length 0.
fn direction(transform: &Mat4, own: Vec3) -> Option<Vec3> {
    transform.transform_vector3(own).as_dvec3().try_normalize().map(|unit| unit.as_vec3())
}
