//! Camera and sun of a project made from scene files.

use super::SceneOptions;
use super::contents::Contents;
use super::extent::Extent;
use super::shell::Shell;
use crate::project::{Camera, Falloff, Light};
use crate::scene::{SceneCamera, SceneLight};
use glam::{DVec3, Vec3};

/// Default vertical field of view, degrees.
const FOV: f32 = 45.0;
/// Strength of the sun: with the ambient light of 0.3, a surface that faces the sun has brightness 1.
pub(super) const SUN: f32 = 0.7;
/// Margin around the scene's box in the picture, as a share of half the picture's size.
const MARGIN: f64 = 0.04;
/// Elevation of a default camera: the y component of the direction from the scene to the camera before normalisation. The x and z
/// components are 0.5 and 1, or 1 and 0.5.
const RISE: f64 = 0.45;
/// [`RISE`] for scenes as flat as a terrain.
const RISE_OF_FLAT: f64 = 0.8;
/// Elevations that are tried in order for a camera inside a shell: tangents of the angle above the horizon. With the first one the horizon
/// is in the picture.
const RISES_INSIDE: [f64; 4] = [0.27, 0.5, 1.0, 2.0];
/// Distance of a camera inside a shell from its target, as a share of the distance from the target to the shell.
const BEFORE_SHELL: f64 = 0.9;

/// The unit vector, computed as the loader does, so that writing and reading it again changes nothing.
pub(super) fn unit(vector: DVec3) -> Option<Vec3> {
    // The loader reads f32.
    vector.as_vec3().as_dvec3().try_normalize().map(|unit| unit.as_vec3())
}

/// Rounds to few digits, with an error below a thousandth of `size`.
fn rounded(value: DVec3, size: f64) -> DVec3 {
    let step = 10.0_f64.powf(size.log10().floor() - 3.0);
    // Dividing by a whole number gives the nearest decimal fraction.
    if step < 1.0 {
        (value * step.recip().round()).round() / step.recip().round()
    } else {
        (value / step).round() * step
    }
}

/// The camera of the options, or one that sees all of the focus in a window of this shape. If a shell hides the focus from
/// outside, this camera stands inside the shell. Its near and far planes enclose everything.
///
/// # Errors
/// If the camera would look at its own position.
pub(super) fn camera(options: &SceneOptions, contents: &Contents, window: [u32; 2]) -> Result<Camera, String> {
    let Contents { whole, focus, ref shell, .. } = *contents;
    let fov = options.fov.unwrap_or(FOV);
    let size = focus.diagonal().max(f64::from(f32::MIN_POSITIVE));
    let target = options.look_at.unwrap_or_else(|| rounded(focus.center(), size));
    let away = away(focus);
    let (mut eye, mut view) = match (options.look_from, options.look_at) {
        (Some(eye), _) => (eye, target - eye),
        (None, Some(_)) => (rounded(target + away * distance(focus, target, away, fov, window), size), -away),
        (None, None) => (rounded(place(focus, target, away, fov, window), size), -rounded(away, 1.0)),
    };
    let placed = shell.as_ref().filter(|shell| shell.hides && options.look_from.is_none());
    if let Some(nearer) = placed.and_then(|shell| inside(shell, focus, target, eye)) {
        eye = rounded(nearer, size);
        view = target - eye;
    }
    let direction = unit(view).ok_or_else(|| format!("the camera would stand at {eye} and look at the same point"))?;
    let corners = whole.corners().into_iter().chain(focus.corners());
    let farthest = corners.map(|corner| corner.distance(eye)).fold(size, f64::max);
    Ok(Camera {
        name: "Camera".to_owned(),
        position: eye,
        direction,
        up: up_for(direction),
        fov_y: fov.to_radians(),
        near: two_digits(farthest * 1e-4),
        far: two_digits(farthest * 4.0),
        orthographic: None,
        viewport: Some(0),
    })
}

/// Unit direction from the box towards the camera: from the front (+z), a little from the right (+x) and from above. If the box
/// is more than twice as long along z as along x, from the side (+x) and a little from +z. From higher above if the box is
/// flat.
fn away(extent: Extent) -> DVec3 {
    let size = extent.high - extent.low;
    let rise = if size.y < 0.2 * size.x.max(size.z) { RISE_OF_FLAT } else { RISE };
    let broad_side = size.z > 2.0 * size.x;
    DVec3::new(if broad_side { 1.0 } else { 0.5 }, rise, if broad_side { 0.5 } else { 1.0 }).normalize()
}

/// Tangents of half the horizontal and vertical field of view without the margin, and the directions to the right and up. A
/// window wider than high is treated as a square one.
fn frame(away: DVec3, fov: f32, [width, height]: [u32; 2]) -> ([f64; 2], [DVec3; 2]) {
    let tan_y = (f64::from(fov).to_radians() * 0.5).tan() * (1.0 - MARGIN);
    let tan_x = tan_y * (f64::from(width) / f64::from(height.max(1))).min(1.0);
    let right = DVec3::Y.cross(away).normalize();
    ([tan_x, tan_y], [right, away.cross(right)])
}

/// The nearest camera position that shows all corners of the box, with equal margins on opposite sides.
fn place(extent: Extent, target: DVec3, away: DVec3, fov: f32, window: [u32; 2]) -> DVec3 {
    let (tangents, axes) = frame(away, fov, window);
    let offsets = extent.corners().map(|corner| corner - target);
    let most = |value: &dyn Fn(DVec3) -> f64| offsets.iter().map(|offset| value(*offset)).fold(f64::MIN, f64::max);
    let mut eye = target;
    let mut farthest = 0.0_f64;
    for (tangent, axis) in tangents.into_iter().zip(axes) {
        // A corner at x to the right and z towards the viewer is visible from a camera at s to the right and distance d if
        // |x - s| <= tangent (d - z).
        let right = most(&|offset| offset.dot(axis) + tangent * offset.dot(away));
        let left = most(&|offset| -offset.dot(axis) + tangent * offset.dot(away));
        eye += axis * ((right - left) * 0.5);
        farthest = farthest.max((right + left) * 0.5 / tangent);
    }
    // For a scene of a single point any distance works.
    eye + away * if farthest > 0.0 { farthest } else { 1.0 }
}

/// The least distance from `target` at which a camera that looks at `target` sees all corners of the box.
fn distance(extent: Extent, target: DVec3, away: DVec3, fov: f32, window: [u32; 2]) -> f64 {
    let ([tan_x, tan_y], [right, up]) = frame(away, fov, window);
    let needed = |corner: DVec3| {
        let offset = corner - target;
        let sideways = (offset.dot(right).abs() / tan_x).max(offset.dot(up).abs() / tan_y);
        sideways + offset.dot(away)
    };
    let farthest = extent.corners().into_iter().map(needed).fold(0.0, f64::max);
    // For a scene of a single point any distance works.
    if farthest > 0.0 { farthest } else { 1.0 }
}

/// A position inside the shell for a camera whose `eye` is outside of the shell or close to it: the first of [`RISES_INSIDE`] that is
/// above the focus, or else one in the direction of `eye`, nearer to the target. `None` if `eye` is well inside.
fn inside(shell: &Shell, focus: Extent, target: DVec3, eye: DVec3) -> Option<DVec3> {
    let (away, distance) = ((eye - target).try_normalize()?, eye.distance(target));
    let reach = |direction: DVec3| shell.distance(target, direction).map(|distance| distance * BEFORE_SHELL);
    let most = reach(away).filter(|most| *most < distance)?;
    let level = DVec3::new(away.x, 0.0, away.z).normalize_or(DVec3::Z);
    let stand = |rise: f64| {
        let direction = (level + DVec3::Y * rise).normalize();
        reach(direction).map(|distance| target + direction * distance)
    };
    let above = RISES_INSIDE.into_iter().filter_map(stand).find(|eye| eye.y > focus.high.y);
    Some(above.unwrap_or(target + away * most))
}

/// The value rounded to two digits, above 0.
pub(super) fn two_digits(value: f64) -> f32 {
    let text = format!("{value:.1e}");
    text.parse().ok().filter(|value: &f32| value.is_normal()).unwrap_or(1.0)
}

/// Up vector: +y, or -z for cameras that look straight up or down.
fn up_for(direction: Vec3) -> Vec3 {
    if direction.cross(Vec3::Y).length() < 1e-3 { Vec3::NEG_Z } else { Vec3::Y }
}

/// A camera of a scene file whose positions are relative to `origin`. If the file gives no far plane, it is placed beyond the
/// scene. Its whole picture is seen in a window of this shape.
pub(super) fn of_file(camera: &SceneCamera, origin: DVec3, name: String, extent: Extent, window: [u32; 2]) -> Camera {
    let eye = origin + camera.position.as_dvec3();
    let farthest = extent.corners().iter().map(|corner| corner.distance(eye)).fold(0.0, f64::max) as f32;
    let far = camera.far.unwrap_or(farthest * 4.0);
    let direction = unit(camera.direction.as_dvec3()).unwrap_or(Vec3::NEG_Z);
    let up = unit(camera.up.as_dvec3()).filter(|up| direction.cross(*up).length() >= 1e-3);
    Camera {
        name,
        position: eye,
        direction,
        up: up.unwrap_or_else(|| up_for(direction)),
        // Converted through degrees, the unit in project files.
        fov_y: whole_fov(camera, window).to_degrees().to_radians(),
        near: camera.near,
        far: if far > camera.near { far } else { camera.near * 1e6 },
        orthographic: None,
        viewport: Some(0),
    }
}

/// The vertical field of view in which a window shows the whole picture of a file's camera (glTF 2.0, section 3.10.3: neither
/// cropped nor stretched). In a window narrower than that picture it is larger than the file's, so that the horizontal field of
/// view is kept.
fn whole_fov(camera: &SceneCamera, [width, height]: [u32; 2]) -> f32 {
    /// Largest field of view that results from a narrow window, degrees.
    const WIDEST: f32 = 179.0;
    let shape = f64::from(width.max(1)) / f64::from(height.max(1));
    match camera.aspect.map(|aspect| f64::from(aspect) / shape) {
        Some(more) if more > 1.0 => {
            let half = ((f64::from(camera.fov_y) * 0.5).tan() * more).atan();
            ((2.0 * half) as f32).min(WIDEST.to_radians()).max(camera.fov_y)
        }
        _ => camera.fov_y,
    }
}

/// The sun of the options, or one behind the viewer's left shoulder.
pub(super) fn sun(options: &SceneOptions, camera: &Camera) -> Light {
    let shoulder = || {
        let view = camera.direction.as_dvec3();
        let level = DVec3::new(view.x, 0.0, view.z).try_normalize().unwrap_or(DVec3::NEG_Z);
        let left = DVec3::Y.cross(level);
        // Steep enough for short shadows, and from the side so that they are visible.
        rounded(level * 0.5 - left * 0.6 - DVec3::Y * 0.9, 1.0)
    };
    let travels = options.sun.map_or_else(shoulder, |sun| -sun.as_dvec3());
    directional("Sun".to_owned(), travels, Vec3::splat(SUN))
}

/// The sun for a scene file whose only light is directional. The light's intensity is in lux, for an exposure that is not
/// modelled here, so only its direction and hue are used.
pub(super) fn sun_of_file(light: &SceneLight) -> Light {
    let strongest = light.color.max_element();
    let hue = if strongest > 0.0 && strongest.is_finite() { light.color / strongest } else { Vec3::ONE };
    directional("Sun".to_owned(), light.direction.as_dvec3(), hue.max(Vec3::ZERO) * SUN)
}

/// A directional light.
pub(super) fn directional(name: String, travels: DVec3, color: Vec3) -> Light {
    let direction = unit(travels).or(Some(Vec3::NEG_Y));
    Light { name, direction, position: None, color, falloff: Falloff::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extent(low: [f64; 3], high: [f64; 3]) -> Extent {
        Extent { low: low.into(), high: high.into() }
    }

    fn alone(extent: Extent) -> Contents {
        Contents { whole: extent, focus: extent, shell: None, skies: Vec::new() }
    }

    /// Positions of the box's corners in the picture, from -1 to 1.
    fn corners_seen(extent: Extent, camera: &Camera, aspect: f32) -> Vec<[f64; 3]> {
        let forward = camera.direction.as_dvec3();
        let right = forward.cross(camera.up.as_dvec3()).normalize();
        let up = right.cross(forward);
        let tan = f64::from((camera.fov_y * 0.5).tan());
        extent
            .corners()
            .map(|corner| corner - camera.position)
            .map(|offset| {
                let depth = offset.dot(forward);
                [offset.dot(right) / (depth * tan * f64::from(aspect)), offset.dot(up) / (depth * tan), depth]
            })
            .to_vec()
    }

    #[test]
    fn the_camera_sees_the_whole_box_and_wastes_little() {
        let boxes = [
            extent([-1.0; 3], [1.0; 3]),
            extent([1e5, 0.0, 1e5], [1e5 + 40.0, 300.0, 1e5 + 20.0]),
            extent([-500.0, -3.0, -500.0], [500.0, 4.0, 500.0]),
            extent([0.0, 0.0, -9e-4], [1e-5, 2e-4, 9e-4]),
            extent([0.0; 3], [0.0, 1.0, 1.0]),
        ];
        for extent in boxes {
            for window in [[1024, 1024], [1920, 1080], [300, 600]] {
                let camera = camera(&SceneOptions::default(), &alone(extent), window).expect("it looks at the centre");
                // A window wider than high shows the same as a square one, and more on both sides.
                let aspect = (window[0] as f32 / window[1] as f32).min(1.0);
                let seen = corners_seen(extent, &camera, aspect);
                let widest = seen.iter().flat_map(|[x, y, _]| [x.abs(), y.abs()]).fold(0.0, f64::max);
                assert!((0.94..0.97).contains(&widest), "{extent:?} {window:?}: {widest}");
                for [_, _, depth] in seen {
                    assert!(depth > f64::from(camera.near) && depth < f64::from(camera.far), "{extent:?}");
                }
            }
        }
    }

    #[test]
    fn a_window_narrower_than_a_files_picture_shows_all_of_it() {
        let camera = |aspect: Option<f32>| SceneCamera {
            name: String::new(),
            position: Vec3::ZERO,
            direction: Vec3::NEG_Z,
            up: Vec3::Y,
            fov_y: 1.0,
            aspect,
            near: 0.1,
            far: None,
        };
        let across = |aspect: f64| (aspect * 0.5_f64.tan()).atan() as f32;
        for (aspect, window, half) in [
            (None, [100, 400], 0.5),
            (Some(2.0), [400, 100], 0.5),
            (Some(2.0), [200, 100], 0.5),
            (Some(2.0), [100, 100], across(2.0)),
            (Some(1.5), [100, 200], across(3.0)),
            (Some(0.5), [100, 400], across(2.0)),
        ] {
            let found = whole_fov(&camera(aspect), window);
            assert!((found - 2.0 * half).abs() < 1e-6, "{aspect:?} {window:?}: {found}");
        }
        let wide = whole_fov(&camera(Some(f32::MAX)), [1, 1]);
        assert!(wide.to_degrees() < 180.0, "{wide}");
    }

    #[test]
    fn a_described_camera_is_that_and_one_that_looks_nowhere_is_refused() {
        let extent = extent([-1.0; 3], [1.0; 3]);
        let from = |from: [f64; 3], at: Option<[f64; 3]>| SceneOptions {
            look_from: Some(from.into()),
            look_at: at.map(DVec3::from),
            fov: Some(30.0),
            ..SceneOptions::default()
        };
        let made = camera(&from([0.0, 0.0, 5.0], None), &alone(extent), [4, 4]).expect("it looks at the centre");
        assert_eq!((made.position, made.direction), (DVec3::new(0.0, 0.0, 5.0), Vec3::NEG_Z));
        assert_eq!(made.fov_y, 30.0_f32.to_radians());
        let down = camera(&from([0.0, 5.0, 0.0], None), &alone(extent), [4, 4]).expect("it looks down");
        assert!(down.direction.cross(down.up).length() > 0.9);
        let error = camera(&from([2.0; 3], Some([2.0; 3])), &alone(extent), [4, 4]).expect_err("it looks nowhere");
        assert!(error.contains("the same point"), "{error}");
    }

    #[test]
    fn the_sun_shines_from_the_viewers_left_unless_it_is_described() {
        let extent = extent([-1.0; 3], [1.0; 3]);
        let camera = camera(&SceneOptions::default(), &alone(extent), [4, 4]).expect("it looks at the centre");
        let direction = |options: &SceneOptions| sun(options, &camera).direction.expect("a direction");
        let travels = direction(&SceneOptions::default());
        let right = camera.direction.cross(Vec3::Y);
        assert!(travels.y < -0.5 && travels.dot(right) > 0.3 && travels.dot(camera.direction) > 0.3, "{travels}");
        let asked = SceneOptions { sun: Some(Vec3::new(0.0, 3.0, 0.0)), ..SceneOptions::default() };
        assert_eq!(direction(&asked), Vec3::NEG_Y);
    }
}
