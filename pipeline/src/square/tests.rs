//! The square: counts, soundness, what the cameras see, and the shipped files.

use super::*;
use crate::scene::Mesh;
use glam::DVec3;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

fn placed_triangles(scene: &Scene) -> usize {
    let count = |mesh: &Mesh| mesh.groups.iter().map(|group| group.triangles.len()).sum::<usize>();
    scene.objects.iter().map(|object| count(&scene.meshes[object.mesh as usize])).sum()
}

/// The projects folder of the repository. `None` in the packaged crate, which does not contain it: tests are then skipped.
fn projects() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../xml_projects");
    if !folder.is_dir() {
        println!("skipped: the repository's projects are not here");
        return None;
    }
    Some(folder)
}

/// A triangle in world space, with its material and object.
struct Facet {
    corners: [DVec3; 3],
    material: usize,
    object: usize,
}

fn facets(scene: &Scene) -> Vec<Facet> {
    let mut facets = Vec::new();
    for (index, object) in scene.objects.iter().enumerate() {
        let mesh = &scene.meshes[object.mesh as usize];
        for group in &mesh.groups {
            for triangle in &group.triangles {
                let corners =
                    triangle.map(|v| object.transform.transform_point3(mesh.positions[v as usize]).as_dvec3());
                facets.push(Facet { corners, material: group.material as usize, object: index });
            }
        }
    }
    facets
}

/// Distance to a triangle along a ray (Möller and Trumbore 1997), in double precision.
fn meet(origin: DVec3, direction: DVec3, [a, b, c]: [DVec3; 3]) -> Option<f64> {
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant.abs() < 1e-14 {
        return None;
    }
    let from = origin - a;
    let u = from.dot(p) / determinant;
    let q = from.cross(ab);
    let v = direction.dot(q) / determinant;
    let t = ac.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 1e-6).then_some(t)
}

fn nearest(facets: &[Facet], origin: DVec3, direction: DVec3) -> Option<(f64, &Facet)> {
    facets
        .iter()
        .filter_map(|facet| Some((meet(origin, direction, facet.corners)?, facet)))
        .min_by(|a, b| a.0.total_cmp(&b.0))
}

/// Position, direction and vertical field of view in degrees of a camera of a project file.
fn camera(projects: &Path, file: &str, name: &str) -> (DVec3, DVec3, f64) {
    let text = std::fs::read_to_string(projects.join(file)).unwrap();
    let start = text.find(&format!("<camera name=\"{name}\"")).unwrap_or_else(|| panic!("{file} has no {name}"));
    let block = &text[start..start + text[start..].find("</camera>").unwrap()];
    let number = |element: &str, attribute: &str| -> f64 {
        let element = &block[block.find(&format!("<{element} ")).unwrap()..];
        let value = &element[element.find(&format!(" {attribute}=\"")).unwrap() + attribute.len() + 3..];
        value[..value.find('"').unwrap()].parse().unwrap()
    };
    let vector = |element: &str| DVec3::new(number(element, "x"), number(element, "y"), number(element, "z"));
    (vector("position"), vector("view").normalize(), number("perspective", "fov"))
}

/// Rays through the centres of `side` x `side` pixels, with each pixel's position in -1..1.
fn view(camera: (DVec3, DVec3, f64), side: u32) -> Vec<(f64, f64, DVec3)> {
    let (_, forward, fov) = camera;
    let right = forward.cross(DVec3::Y).normalize();
    let up = right.cross(forward);
    let half = (fov.to_radians() / 2.0).tan();
    let at = |index: u32| (f64::from(index) + 0.5) / f64::from(side) * 2.0 - 1.0;
    (0..side * side)
        .map(|index| {
            let (x, y) = (at(index % side), -at(index / side));
            (x, y, (forward + right * (x * half) + up * (y * half)).normalize())
        })
        .collect()
}

fn to_sun() -> DVec3 {
    -SUN.as_dvec3().normalize()
}

/// Triangle counts from the fewest to a million, on both sides of each change of level.
const COUNTS: [u32; 14] = [
    10_000,
    12_000,
    20_000,
    30_000,
    45_999,
    46_000,
    SHIPPED_TRIANGLES,
    80_000,
    100_000,
    119_999,
    120_000,
    300_000,
    800_000,
    1_000_000,
];

#[test]
fn the_count_is_within_the_stated_band() {
    for wanted in COUNTS {
        let made = placed_triangles(&generate(wanted).scene) as f64;
        let ratio = made / f64::from(wanted);
        assert!((0.85..=1.15).contains(&ratio), "{wanted} wanted, {made} made");
    }
}

#[test]
#[ignore = "takes some seconds and a gigabyte"]
fn ten_million_triangles_are_within_the_stated_band() {
    let made = placed_triangles(&generate(10_000_000).scene);
    assert!((8_500_000..=11_500_000).contains(&made), "{made} made");
}

#[test]
fn numbers_outside_the_range_are_brought_into_it() {
    assert_eq!(placed_triangles(&generate(0).scene), placed_triangles(&generate(*TRIANGLES.start()).scene));
}

#[test]
fn the_same_count_gives_the_same_square() {
    let (a, b) = (generate(20_000), generate(20_000));
    for (a, b) in a.scene.meshes.iter().zip(&b.scene.meshes) {
        assert_eq!((&a.positions, &a.normals, &a.texcoords), (&b.positions, &b.normals, &b.texcoords));
    }
    assert_eq!(a.paintings, b.paintings);
    assert_ne!(placed_triangles(&a.scene), placed_triangles(&generate(40_000).scene), "the count matters");
}

#[test]
fn no_triangle_is_degenerate_and_every_index_and_normal_is_sound() {
    for wanted in [10_000, SHIPPED_TRIANGLES, 400_000, 2_500_000] {
        let square = generate(wanted);
        for mesh in &square.scene.meshes {
            let name = &mesh.name;
            assert_eq!(mesh.positions.len(), mesh.normals.len(), "{name}");
            assert_eq!(mesh.positions.len(), mesh.texcoords.len(), "{name}");
            assert!(mesh.positions.iter().all(|position| position.is_finite()), "{name}");
            assert!(mesh.texcoords.iter().all(|texcoord| texcoord.is_finite()), "{name}");
            for normal in &mesh.normals {
                assert!((normal.length() - 1.0).abs() < 1e-3, "{wanted}: {name} has the normal {normal}");
            }
            for group in &mesh.groups {
                for triangle in &group.triangles {
                    let [a, b, c] = triangle.map(|vertex| mesh.positions[vertex as usize].as_dvec3());
                    let area = (b - a).cross(c - a).length() / 2.0;
                    assert!(area > 1e-7, "{wanted}: {name} has a triangle of {area} m2 at {a}");
                }
            }
        }
    }
}

/// Where a piece ended along another's edge, rounding would open a crack.
#[test]
fn flat_pieces_of_the_paving_share_all_vertices_on_their_edges() {
    let mut pieces = 0;
    for wanted in [10_000, 20_000, SHIPPED_TRIANGLES, 400_000] {
        let square = generate(wanted);
        let paving = square.scene.meshes.iter().find(|mesh| mesh.name == "paving").unwrap();
        let flat: Vec<[Vec2; 3]> = (paving.groups.iter().flat_map(|group| &group.triangles))
            .map(|triangle| triangle.map(|vertex| paving.positions[vertex as usize]))
            .filter(|triangle| triangle.iter().all(|corner| corner.y == 0.0))
            .map(|triangle| triangle.map(|corner| Vec2::new(corner.x, corner.z)))
            .collect();
        let mut vertices = flat.as_flattened().to_vec();
        vertices.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
        vertices.dedup();
        for [a, b] in flat.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]) {
            let (low, high) = (a.min(b) - 1e-3, a.max(b) + 1e-3);
            let first = vertices.partition_point(|vertex| vertex.x < low.x);
            for &vertex in vertices[first..].iter().take_while(|vertex| vertex.x <= high.x) {
                if vertex == a || vertex == b || vertex.y < low.y || vertex.y > high.y {
                    continue;
                }
                let along = (b - a).as_dvec2().normalize();
                let off = along.perp_dot((vertex - a).as_dvec2()).abs();
                assert!(off > 1e-3, "{wanted}: {vertex} is {off} off the edge from {a} to {b}");
            }
        }
        pieces += flat.len();
    }
    assert!(pieces > 4_000, "{pieces}");
}

#[test]
fn all_materials_are_used_and_named_once_and_all_textures_are_there() {
    for wanted in [10_000, SHIPPED_TRIANGLES, 1_000_000] {
        let square = generate(wanted);
        let scene = &square.scene;
        let mut material_uses = vec![0; scene.materials.len()];
        for group in scene.meshes.iter().flat_map(|mesh| &mesh.groups) {
            material_uses[group.material as usize] += group.triangles.len();
        }
        let mut texture_uses = vec![0; scene.textures.len()];
        let mut names = HashMap::new();
        for (material, uses) in scene.materials.iter().zip(&material_uses) {
            assert!(*uses > 0, "{} is not used", material.name);
            assert!(names.insert(&material.name, ()).is_none(), "{} is there twice", material.name);
            if let Some(texture) = material.texture {
                texture_uses[texture as usize] += 1;
            }
        }
        assert!(texture_uses.iter().all(|&uses| uses > 0));
        assert_eq!(square.paintings.len(), scene.textures.len());
        let glass = scene.materials.iter().find(|material| material.name == "Vidro").unwrap();
        assert_eq!(glass.texture, None);
    }
}

#[test]
fn an_embedded_texture_decodes_to_its_texels() {
    let square = generate(10_000);
    for (source, painting) in square.scene.textures.iter().zip(&square.paintings) {
        let TextureSource::Embedded { name, bytes } = source else { panic!("not embedded") };
        let decoded = image::load_from_memory(bytes).unwrap().into_rgba8();
        assert_eq!(
            (name.as_str(), decoded.width(), decoded.height()),
            (painting.name, painting.width, painting.height)
        );
        assert!(decoded.pixels().map(|pixel| pixel.0).eq(painting.texels.iter().copied()), "{name}");
    }
}

#[test]
fn the_projects_share_their_cameras() {
    let Some(projects) = projects() else { return };
    let files = ["NoEffects", "Dummy", "Shadows", "Reflect", "Refract", "SSAO", "Final"];
    let raster = [
        "ShadowMap",
        "CubeReflect",
        "CubeRefract",
        "PlanarReflect",
        "ScreenReflect",
        "ScreenRefract",
        "DepthOcclusion",
        "GTAO",
    ];
    for name in ["MainCamera", "Vidro"] {
        let first = camera(&projects, "SceneFinal.xml", name);
        for file in files {
            assert_eq!(camera(&projects, &format!("Scene{file}.xml"), name), first, "{file} {name}");
        }
        for file in raster {
            assert_eq!(camera(&projects, &format!("raster/Scene{file}.xml"), name), first, "{file} {name}");
        }
    }
}

#[test]
fn the_main_camera_looks_at_a_sunlit_fountain() {
    let Some(projects) = projects() else { return };
    let square = generate(SHIPPED_TRIANGLES);
    let facets = facets(&square.scene);
    let camera = camera(&projects, "SceneFinal.xml", "MainCamera");
    let name = |facet: &Facet| square.scene.objects[facet.object].name.as_str();
    let (_, center) = nearest(&facets, camera.0, camera.1).expect("the centre of the picture is not empty");
    assert_eq!(name(center), "fountain");
    // Points of the ground around the fountain are sunlit, except those in the fountain's shadow.
    let mut lit = 0;
    for index in 0..12 {
        let way = math::on_circle(index, 12) * 7.5;
        let ground = DVec3::new(f64::from(FOUNTAIN.x + way.x), 0.02, f64::from(FOUNTAIN.y + way.y));
        lit += usize::from(!facets.iter().any(|facet| meet(ground, to_sun(), facet.corners).is_some()));
    }
    assert!((8..12).contains(&lit), "{lit} of 12 points are lit; the fountain itself must shade one");
    // No pixel is empty: sky and hills close the view.
    assert!(view(camera, 12).iter().all(|&(.., ray)| nearest(&facets, camera.0, ray).is_some()));
}

#[test]
fn the_pane_fills_most_of_the_view_vidro_and_mirrors_the_fountain() {
    let Some(projects) = projects() else { return };
    let square = generate(SHIPPED_TRIANGLES);
    let facets = facets(&square.scene);
    let camera = camera(&projects, "SceneFinal.xml", "Vidro");
    let name = |facet: &Facet| square.scene.objects[facet.object].name.as_str();
    let (mut panes, mut mirrored, mut lit) = (0, 0, 0);
    let rays = view(camera, 24);
    for &(.., ray) in &rays {
        let (distance, facet) = nearest(&facets, camera.0, ray).expect("the view is closed");
        if square.scene.materials[facet.material].name != "Vidro" {
            continue;
        }
        panes += 1;
        let [a, b, c] = facet.corners;
        let normal = (b - a).cross(c - a).normalize();
        assert!(normal.dot(ray) < 0.0, "the pane faces the camera");
        let at = camera.0 + ray * distance + normal * 1e-5;
        let Some((far, seen)) = nearest(&facets, at, ray - 2.0 * ray.dot(normal) * normal) else { continue };
        if name(seen) == "fountain" {
            mirrored += 1;
            let point = at + (ray - 2.0 * ray.dot(normal) * normal) * (far - 1e-3);
            lit += usize::from(!facets.iter().any(|facet| meet(point, to_sun(), facet.corners).is_some()));
        }
    }
    assert!(panes * 10 > rays.len() * 6, "{panes} of {} pixels show the pane", rays.len());
    assert!(mirrored >= 6, "{mirrored} pixels mirror the fountain");
    assert!(lit * 2 > mirrored, "{lit} of the {mirrored} mirrored points are sunlit");
}

#[test]
fn the_shipped_files_are_what_the_generator_writes() {
    let Some(projects) = projects() else { return };
    let folder = tempfile::tempdir().unwrap();
    let square = generate(SHIPPED_TRIANGLES);
    let paintings = square.paintings.clone();
    let written = square.write(folder.path()).unwrap();
    let shipped = projects.join("3dsmodels");
    let (ours, theirs) = (std::fs::read(&written).unwrap(), std::fs::read(shipped.join(SCENE_FILE)).unwrap());
    assert!(ours.len() <= 4 << 20, "{} bytes", ours.len());
    assert!(ours == theirs, "{SCENE_FILE} differs: {} bytes here, {} there", ours.len(), theirs.len());
    let mut bytes = 0;
    for painting in &paintings {
        let file = shipped.join(TEXTURE_FOLDER).join(painting.name);
        bytes += std::fs::metadata(&file).unwrap().len();
        let texels = image::open(&file).unwrap().into_rgba8();
        assert!(texels.pixels().map(|pixel| pixel.0).eq(painting.texels.iter().copied()), "{} differs", painting.name);
    }
    assert!(bytes < 1_500_000, "{bytes} bytes of textures");
    let files = std::fs::read_dir(shipped.join(TEXTURE_FOLDER)).unwrap().count();
    assert_eq!(files, paintings.len(), "no other textures are shipped");
}

/// Writes the shipped files: `CURITIBA_WRITE_SQUARE=1 cargo test -p curitiba-pipeline writes_the_shipped -- --ignored`.
#[test]
#[ignore = "writes into the source tree"]
fn writes_the_shipped_files() {
    let Some(projects) = projects() else { return };
    if std::env::var_os("CURITIBA_WRITE_SQUARE").is_some() {
        generate(SHIPPED_TRIANGLES).write(&projects.join("3dsmodels")).unwrap();
    }
}
