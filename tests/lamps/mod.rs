//! Lamps for projects that have one directional light.

use curitiba::pipeline::project::{Falloff, Light, PassKind, Project, Spot};
use glam::Vec3;

/// Adds lamps to every pass that has a light: a point light with a finite range and two spot lights, around what a camera sees.
///
/// # Panics
/// If there is no such camera.
pub fn add_lamps(project: &mut Project, camera: &str) {
    let seen = project.cameras.iter().find(|known| known.name == camera).expect("the project has the camera");
    let (eye, forward) = (seen.position, seen.direction);
    let right = forward.cross(seen.up).normalize();
    let lamp = |name: &str, [ahead, aside, above]: [f32; 3], color: Vec3, falloff: Falloff| Light {
        name: name.to_owned(),
        direction: None,
        position: Some(eye + (forward * ahead + right * aside + Vec3::Y * above).as_dvec3()),
        color,
        falloff,
    };
    let spot = |axis: Vec3, inner: f32, exponent: f32| Falloff {
        attenuation: [1.0, 0.02, 0.0],
        spot: Some(Spot { axis: axis.normalize(), cutoff: 30.0, inner, exponent }),
        ..Falloff::default()
    };
    let bulb = Falloff { attenuation: [0.5, 0.0, 0.02], range: 30.0, spot: None };
    let first = project.lights.len();
    project.lights.extend([
        lamp("Bulb", [4.0, 1.0, 0.5], Vec3::new(0.9, 0.4, 0.1), bulb),
        lamp("Spot", [0.5, -1.0, 1.0], Vec3::new(0.1, 0.4, 0.9), spot(forward, 20.0, 0.0)),
        lamp("Beam", [1.0, 2.0, 2.0], Vec3::new(0.3, 0.8, 0.3), spot(forward - Vec3::Y * 0.2, 30.0, 6.5)),
    ]);
    let more = first..project.lights.len();
    for pass in project.pipelines.iter_mut().flat_map(|pipeline| &mut pipeline.passes) {
        match &mut pass.kind {
            PassKind::Raster(raster) if !raster.lights.is_empty() => raster.lights.extend(more.clone()),
            PassKind::Ray(ray) if !ray.lights.is_empty() => ray.lights.extend(more.clone()),
            _ => {}
        }
    }
}
