//! Decisions about the glass that focuses light in a pass with `shadow=caustic`.

use super::{Dielectric, Shape};
use crate::diagnostic::Decision;
use crate::scene::{RenderScene, Sphere};

/// Decisions for a pass with `shadow=caustic` and this number of photons: whether exact spheres of the scene focus light and, if there are
/// photons, whether the meshes of each glass material focus light.
#[must_use]
pub fn caustics(pass: &str, scene: &RenderScene, dielectrics: &[Dielectric], photons: u32) -> Vec<Decision> {
    let mut decisions = vec![of_spheres(pass, &scene.geometry.spheres, dielectrics)];
    if photons > 0 {
        decisions.extend(of_meshes(pass, scene, dielectrics, photons));
    }
    decisions
}

/// Name of the first material whose meshes photons are shot at: solid glass with an index of refraction above 1. `None` if there is none.
#[must_use]
pub fn first_target<'s>(scene: &'s RenderScene, dielectrics: &[Dielectric]) -> Option<&'s str> {
    let bends = |material: usize| dielectrics.get(material).is_some_and(Dielectric::bends_light);
    let mut batches = scene.geometry.batches.iter();
    let batch = batches.find(|batch| batch.count > 0 && bends(batch.material as usize))?;
    Some(scene.materials.get(batch.material as usize).map_or("", |material| material.name.as_str()))
}

fn of_spheres(pass: &str, spheres: &[Sphere], dielectrics: &[Dielectric]) -> Decision {
    let bends = |sphere: &&Sphere| dielectrics.get(sphere.material as usize).is_some_and(Dielectric::bends_light);
    let count = spheres.iter().filter(bends).count();
    let why = match count {
        0 => "no exact sphere is a body of glass that bends light: it goes straight on".to_owned(),
        _ => format!("{count} exact spheres of glass bend light: those that stand alone focus it"),
    };
    Decision { what: format!("caustics for pass `{pass}`"), built: count > 0, why }
}

/// One decision for each glass material that has triangles.
fn of_meshes(pass: &str, scene: &RenderScene, dielectrics: &[Dielectric], photons: u32) -> Vec<Decision> {
    let mut decisions = Vec::new();
    for ((index, material), dielectric) in scene.materials.iter().enumerate().zip(dielectrics) {
        let batches = scene.geometry.batches.iter().filter(|batch| batch.material as usize == index);
        let triangles: u64 = batches.map(|batch| u64::from(batch.count)).sum();
        let (built, why) = match dielectric.shape {
            _ if triangles == 0 => continue,
            Shape::Opaque => continue,
            Shape::Solid if dielectric.bends_light() => {
                let why = format!(
                    "its {triangles} triangles are bodies that throw a shadow; the pass shoots {photons} photons at all bodies"
                );
                (true, why)
            }
            Shape::Solid => (false, "its index is 1: light goes straight on".to_owned()),
            Shape::Thin | Shape::Pane => (false, "it is thin: light goes straight on".to_owned()),
        };
        decisions.push(Decision {
            what: format!("caustics of material `{}` in pass `{pass}`", material.name),
            built,
            why,
        });
    }
    decisions
}
