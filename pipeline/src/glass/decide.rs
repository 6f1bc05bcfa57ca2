//! Decides the glass shape of each material of a scene: pane, thin wall or solid body.

use super::{Closedness, Dielectric, Reflectance, Shape, closedness};
use crate::diagnostic::Decision;
use crate::diagnostic::Warnings;
use crate::scene::{Geometry, Material, RenderScene};
use glam::Vec3;
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// A material is glass if its transmission is at least this share of light.
pub const TRANSPARENT: f32 = 0.1;

/// The glass properties of materials, and the reasons.
#[derive(Debug, Clone, Default)]
pub struct Decided {
    /// Properties by material.
    pub dielectrics: Vec<Dielectric>,
    /// A decision for each material that is glass and has triangles or exact spheres.
    pub decisions: Vec<Decision>,
    /// Materials treated otherwise than their file says, and bodies that were flipped.
    pub warnings: Warnings,
}

/// Decides for every material of a scene whether it is glass, and of which shape. Bodies that face inwards are flipped in the scene, so
/// that the geometric normal of every triangle of a solid points out of it. Warnings name `file`.
///
/// | material | is |
/// |---|---|
/// | lets less than [`TRANSPARENT`] of the light through, or has neither triangles nor exact spheres | opaque |
/// | belongs to exact spheres, and to no triangle | solid |
/// | has a volume (glTF `thicknessFactor` above 0; MTL `illum` 6 and 7), and its triangles are closed | solid |
/// | has a volume, and is open | thin, with a warning |
/// | any other | thin |
///
/// Exact spheres are closed, so a material of exact spheres has a volume whether or not its file says so. If the material has triangles
/// too, the triangles must be closed.
#[must_use]
pub fn decide(scene: &mut Arc<RenderScene>, file: &Path) -> Decided {
    let mut decided = Decided::default();
    let mut transparent = transparent_surfaces(scene);
    for index in 0..scene.materials.len() {
        let material = &scene.materials[index];
        let mut dielectric = Dielectric { shape: Shape::Opaque, ..properties(material) };
        if let Some((triangles, spheres)) = transparent.remove(&(index as u32)) {
            let surfaces = (&triangles[..], spheres);
            let (shape, why) = shape(material, &scene.geometry, surfaces, file, &mut decided.warnings);
            dielectric.shape = shape.0;
            let name = &material.name;
            let what = format!("material `{name}` as glass");
            decided.decisions.push(Decision { what, built: true, why: format!("{}: {why}", shape.0.name()) });
            turn(scene, &shape.1, index, file, &mut decided.warnings);
        }
        if dielectric.shape != Shape::Thin {
            dielectric.thickness = 0.0;
        }
        if dielectric.shape != Shape::Solid {
            dielectric.spread = 0.0;
        }
        decided.dielectrics.push(dielectric);
    }
    decided
}

/// By material that lets light through and has triangles or exact spheres: the ids of the triangles, and the number of the spheres.
fn transparent_surfaces(scene: &RenderScene) -> HashMap<u32, (Vec<u32>, usize)> {
    let is_transparent = |material: u32| {
        scene.materials.get(material as usize).is_some_and(|material| material.transmission >= TRANSPARENT)
    };
    let mut surfaces = HashMap::<u32, (Vec<u32>, usize)>::new();
    for batch in scene.geometry.batches.iter().filter(|batch| batch.count > 0 && is_transparent(batch.material)) {
        surfaces.entry(batch.material).or_default().0.extend(batch.first..batch.first + batch.count);
    }
    for sphere in scene.geometry.spheres.iter().filter(|sphere| is_transparent(sphere.material)) {
        surfaces.entry(sphere.material).or_default().1 += 1;
    }
    surfaces
}

/// All properties but the shape.
fn properties(material: &Material) -> Dielectric {
    Dielectric {
        shape: Shape::Opaque,
        index: material.ior.clamp(1.0, Dielectric::MIRROR),
        spread: spread(material),
        alpha: alpha(material),
        roughness_texture: material.roughness_texture.filter(|_| alpha(material) > 0.0),
        extinction: Dielectric::extinction_of(material.attenuation_color, material.attenuation_distance),
        reflectance: material.reflectance,
        reflection: Some(material.reflection).filter(|color| *color != Vec3::ONE),
        filter: material.filter,
        filter_texture: material.texture.filter(|_| material.filter_textured),
        filter_vertex_colors: material.vertex_colors && material.filter_textured,
        veil: material.veil,
        transmission_texture: material.transmission_texture,
        thickness: material.thickness,
        priority: material.priority,
    }
}

/// Width of the microfacet distribution: the roughness squared, as in glTF; 0 below [`Dielectric::SMOOTH`].
fn alpha(material: &Material) -> f32 {
    let alpha = material.roughness * material.roughness;
    if alpha < Dielectric::SMOOTH { 0.0 } else { alpha.min(1.0) }
}

/// Description of a surface's scattering; empty if it is smooth.
fn roughness(material: &Material) -> String {
    match alpha(material) {
        0.0 => String::new(),
        alpha => {
            let texture = if material.roughness_texture.is_some() { ", times its texture" } else { "" };
            format!("; rough: alpha {alpha:.4}, the square of its roughness {}{texture}", material.roughness)
        }
    }
}

/// Description of a surface's reflectance; empty if it is Fresnel's.
fn reflectance(material: &Material) -> String {
    material.reflectance.map_or(String::new(), |Reflectance { minimum, maximum, exponent }| {
        format!("; reflects {minimum} to {maximum}, by exponent {exponent}")
    })
}

/// [`Dielectric::spread`] from the Abbe number, which is 20 divided by the dispersion. A material that reflects all light has none.
fn spread(material: &Material) -> f32 {
    if material.ior < Dielectric::MIRROR { (material.ior - 1.0).max(0.0) * (material.dispersion / 20.0) } else { 0.0 }
}

/// Description of a body's dispersion; empty without dispersion.
fn dispersion(material: &Material) -> String {
    if spread(material) <= 0.0 {
        return String::new();
    }
    let body = properties(material);
    let [red, blue] = [656.27, 486.13].map(|line| body.index_at(line));
    format!("; disperses: index {red:.4} for red, {blue:.4} for blue (Abbe number {:.1})", 20.0 / material.dispersion)
}

/// The shape of a material that is glass, the triangles to flip, and the reason.
fn shape(
    material: &Material,
    geometry: &Geometry,
    (triangles, spheres): (&[u32], usize),
    file: &Path,
    warnings: &mut Warnings,
) -> ((Shape, Vec<u32>), String) {
    let (index, rough) = (material.ior, roughness(material) + &reflectance(material));
    if !material.volume && spheres == 0 {
        return ((Shape::Thin, Vec::new()), format!("it has no volume; index {index}{rough}"));
    }
    match closedness(geometry, triangles) {
        Closedness::Closed { inside_out } => {
            let absorbs = material.attenuation_distance.is_finite() && material.attenuation_color != Vec3::ONE;
            let absorption = if absorbs { "it absorbs" } else { "clear" };
            let colors = dispersion(material);
            let bodies = match (triangles.len(), spheres) {
                (count, 0) => format!("its {count} triangles are closed"),
                (0, spheres) => format!("it is that of {spheres} exact spheres"),
                (count, spheres) => format!("its {count} triangles are closed, as its {spheres} exact spheres are"),
            };
            let why = format!("{bodies}; index {index}, {absorption}{colors}{rough}");
            ((Shape::Solid, inside_out), why)
        }
        Closedness::Open { edges, first } => {
            let at = format!("{edges} open edges, the first at ({:.4}, {:.4}, {:.4})", first.x, first.y, first.z);
            warnings.add(file, "glass with a volume whose surface is not closed", "rendered thin", || {
                format!("`{}` has {at}", material.name)
            });
            ((Shape::Thin, Vec::new()), format!("it has a volume, but its surface is not closed: {at}{rough}"))
        }
    }
}

fn turn(scene: &mut Arc<RenderScene>, triangles: &[u32], material: usize, file: &Path, warnings: &mut Warnings) {
    if triangles.is_empty() {
        return;
    }
    let geometry = &mut Arc::make_mut(scene).geometry;
    for triangle in triangles {
        geometry.triangles[*triangle as usize].swap(1, 2);
    }
    warnings.add(file, "bodies of glass that face inwards", "turned", || {
        format!("{} triangles of `{}`", triangles.len(), scene.materials[material].name)
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Batch, Sphere};

    /// A tetrahedron for each material; a `false` in `whole` leaves out one of its triangles.
    fn scene(materials: Vec<Material>, whole: &[bool]) -> Arc<RenderScene> {
        let mut scene = RenderScene { materials, ..RenderScene::default() };
        let geometry = &mut scene.geometry;
        for (index, whole) in whole.iter().enumerate() {
            let at = Vec3::X * index as f32;
            let base = geometry.positions.len() as u32;
            geometry.positions.extend([Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].map(|corner| corner * 0.5 + at));
            let first = geometry.triangles.len() as u32;
            let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]].map(|face| face.map(|corner| corner + base));
            geometry.triangles.extend(&faces[usize::from(!whole)..]);
            let count = geometry.triangles.len() as u32 - first;
            geometry.batches.push(Batch { material: index as u32, first, count });
        }
        Arc::new(scene)
    }

    fn glass(volume: bool) -> Material {
        Material { transmission: 1.0, volume, ior: 1.33, ..Material::default() }
    }

    #[test]
    fn each_material_is_what_its_properties_and_its_triangles_make_it() {
        let paint = Material::default();
        let faint = Material { transmission: 0.05, volume: true, ..Material::default() };
        let unused = glass(true);
        let materials = vec![glass(true), glass(true), glass(false), paint, faint, unused];
        let mut scene = scene(materials, &[true, false, true, true, true]);
        let decided = decide(&mut scene, Path::new("a.glb"));
        let shapes: Vec<Shape> = decided.dielectrics.iter().map(|glass| glass.shape).collect();
        let expected = [Shape::Solid, Shape::Thin, Shape::Thin, Shape::Opaque, Shape::Opaque, Shape::Opaque];
        assert_eq!(shapes, expected);
        assert_eq!((decided.decisions.len(), decided.warnings.groups().len()), (3, 1));
        assert!(decided.decisions[0].why.starts_with("solid: its 4 triangles are closed; index 1.33"));
        assert!(decided.decisions[1].why.contains("not closed: 3 open edges, the first at ("));
        let warning = decided.warnings.groups()[0].to_string();
        assert!(warning.contains("rendered thin") && warning.contains("3 open edges"), "{warning}");
    }

    #[test]
    fn a_material_has_the_triangles_of_all_its_batches() {
        let mut scene = scene(vec![glass(true), glass(true)], &[true, true]);
        let batches = &mut Arc::make_mut(&mut scene).geometry.batches;
        // The batches of the two materials take turns.
        *batches = [(0, 0, 2), (1, 4, 1), (0, 2, 2), (1, 5, 3), (1, 8, 0)]
            .map(|(material, first, count)| Batch { material, first, count })
            .to_vec();
        let decided = decide(&mut scene, Path::new("a"));
        assert!(decided.warnings.is_empty(), "{:?}", decided.warnings);
        let told = |index: usize| decided.decisions[index].why.contains("its 4 triangles are closed");
        assert!(decided.decisions.len() == 2 && told(0) && told(1), "{:?}", decided.decisions);
    }

    #[test]
    fn bodies_that_face_inwards_are_turned_and_counted() {
        let mut scene = scene(vec![glass(true)], &[true]);
        let outwards = scene.geometry.triangles.clone();
        assert!(decide(&mut scene, Path::new("a")).warnings.is_empty());
        assert_eq!(scene.geometry.triangles, outwards);
        let inwards = &mut Arc::make_mut(&mut scene).geometry.triangles;
        inwards.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        let kept = scene.clone();
        let warnings = decide(&mut scene, Path::new("a")).warnings;
        assert_eq!(scene.geometry.triangles, outwards);
        assert_ne!(kept.geometry.triangles, outwards, "a scene that others hold stays as it is");
        assert!(warnings.groups()[0].to_string().contains("4 triangles"), "{:?}", warnings.groups());
    }

    #[test]
    fn bodies_that_disperse_are_told_and_walls_do_not() {
        let flint = |volume| Material { ior: 1.6, dispersion: 0.5, ..glass(volume) };
        let mut scene = scene(vec![flint(true), flint(false), flint(true), glass(true)], &[true, true, false, true]);
        let Decided { dielectrics, decisions, .. } = decide(&mut scene, Path::new("a"));
        assert!((dielectrics[0].spread - 0.6 / 40.0).abs() < 1e-7, "{dielectrics:?}");
        assert_eq!([1, 2, 3].map(|index: usize| dielectrics[index].spread), [0.0; 3]);
        assert!(decisions[0].why.ends_with("disperses: index 1.5955 for red, 1.6105 for blue (Abbe number 40.0)"));
        assert!(decisions[1..].iter().all(|decision| !decision.why.contains("disperses")), "{decisions:?}");
    }

    #[test]
    fn rough_surfaces_are_told() {
        let of = |roughness, volume| Material { roughness, ..glass(volume) };
        let mut scene = scene(vec![of(0.5, true), of(0.3, false), of(0.009, true)], &[true, true, true]);
        let Decided { dielectrics, decisions, .. } = decide(&mut scene, Path::new("a"));
        assert_eq!([0, 2].map(|index: usize| dielectrics[index].alpha), [0.25, 0.0]);
        assert!((dielectrics[1].alpha - 0.09).abs() < 1e-7, "walls, too");
        assert!(decisions[0].why.ends_with("; rough: alpha 0.2500, the square of its roughness 0.5"), "{decisions:?}");
        assert!(decisions[1].why.contains("rough") && !decisions[2].why.contains("rough"), "{decisions:?}");
    }

    #[test]
    fn what_reflects_everything_has_a_finite_index() {
        let mirror = Material { ior: f32::INFINITY, dispersion: 1.0, ..glass(true) };
        let mut scene = scene(vec![mirror], &[true]);
        let found = decide(&mut scene, Path::new("a")).dielectrics[0];
        assert_eq!((found.index, found.spread), (Dielectric::MIRROR, 0.0));
    }

    #[test]
    fn exact_spheres_are_closed_whatever_their_file_says() {
        let materials = vec![glass(false), glass(true), glass(false), Material::default()];
        let mut scene = scene(materials, &[false, true]);
        let sphere = |material| Sphere { center: Vec3::ZERO, radius: 1.0, material };
        Arc::make_mut(&mut scene).geometry.spheres = [0, 1, 2, 2, 3].map(sphere).to_vec();
        let decided = decide(&mut scene, Path::new("a.xml"));
        let shapes: Vec<Shape> = decided.dielectrics.iter().map(|glass| glass.shape).collect();
        // The first material also belongs to an open tetrahedron.
        assert_eq!(shapes, [Shape::Thin, Shape::Solid, Shape::Solid, Shape::Opaque]);
        assert!(
            decided.decisions[2].why.starts_with("solid: it is that of 2 exact spheres"),
            "{:?}",
            decided.decisions
        );
    }
}
