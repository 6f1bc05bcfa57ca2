//! 3DS files, written by hand.

use crate::scene_support::{Folder, assert_references_are_valid, count, load_capped, load_one, mutations};
use curitiba_pipeline::scene::{BuildOptions, RenderScene};
use glam::{Mat4, Vec2, Vec3};

fn chunk(id: u16, parts: &[&[u8]]) -> Vec<u8> {
    let contents = parts.concat();
    let length = (contents.len() + 6) as u32;
    [&id.to_le_bytes()[..], &length.to_le_bytes(), &contents].concat()
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn shorts(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// A square of two triangles, one red and half transparent, one textured; a third face names no material.
fn square() -> Vec<u8> {
    let red = chunk(
        0xAFFF,
        &[
            &chunk(0xA000, &[b"red\0"]),
            &chunk(0xA020, &[&chunk(0x0011, &[&[255, 51, 0]])]),
            &chunk(0xA050, &[&chunk(0x0030, &[&shorts(&[50])])]),
        ],
    );
    let place =
        [chunk(0xA300, &[b"WALL.PNG\0"]), chunk(0xA356, &[&floats(&[2.0])]), chunk(0xA35A, &[&floats(&[0.25])])];
    let wall = chunk(0xAFFF, &[&chunk(0xA000, &[b"wall\0"]), &chunk(0xA200, &[&place.concat()])]);
    let positions = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 9.0, 9.0, 9.0]);
    let texcoords = floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0]);
    let faces = chunk(
        0x4120,
        &[
            &shorts(&[3]),
            &shorts(&[0, 1, 2, 7, 2, 1, 3, 7, 0, 1, 4, 7]),
            &chunk(0x4130, &[b"red\0", &shorts(&[1, 0])]),
            &chunk(0x4130, &[b"wall\0", &shorts(&[1, 1])]),
        ],
    );
    let mesh = chunk(
        0x4100,
        &[&chunk(0x4110, &[&shorts(&[5]), &positions]), &faces, &chunk(0x4140, &[&shorts(&[5]), &texcoords])],
    );
    let object = chunk(0x4000, &[b"box\0", &mesh]);
    // Unknown chunks are skipped; the materials follow the object.
    chunk(0x4D4D, &[&chunk(0x0002, &[&[3, 0, 0, 0]]), &chunk(0x3D3D, &[&object, &red, &wall]), &chunk(0xB000, &[])])
}

#[test]
fn meshes_materials_and_textures_are_read() {
    let folder = Folder::new();
    folder.png("wall.png", 2, 2, [1, 2, 3, 255]);
    let scene = load_one(&folder.write("a.3DS", square())).unwrap();
    assert_references_are_valid(&scene);
    let names: Vec<_> = scene.materials.iter().map(|material| material.name.as_str()).collect();
    assert_eq!(names, ["red", "wall", "default"]);
    let red = &scene.materials[0];
    assert!(red.diffuse.truncate().distance(Vec3::new(1.0, 0.2, 0.0)) < 1e-6);
    assert_eq!((red.diffuse.w, red.transmission, red.veil), (0.5, 0.5, 0.5));
    let groups: Vec<_> = scene.meshes[0].groups.iter().map(|group| (group.material, group.triangles[0])).collect();
    assert_eq!(groups, [(0, [0, 1, 2]), (1, [2, 1, 3]), (2, [0, 1, 4])]);
    // Only the texture coordinates of the textured face are transformed by its material.
    let moved = |u: f32, v: f32| Vec2::new(2.0 * u, v + 0.25);
    assert_eq!(scene.meshes[0].texcoords, [Vec2::ZERO, moved(1.0, 0.0), moved(0.0, 1.0), moved(1.0, 1.0), Vec2::ZERO]);
    let (built, warnings) = RenderScene::build(scene, &BuildOptions::default()).unwrap();
    assert_eq!(warnings.groups().len(), 0, "{:?}", warnings.groups());
    assert_eq!((built.geometry.triangles.len(), built.textures.len()), (3, 1));
    assert!(built.geometry.normals.iter().take(2).all(|normal| normal.z > 0.5));
}

/// A node of the key-framer: its id, its parent's id, its mesh, and its placement in the first frame.
fn node(id: u16, parent: u16, mesh: &[u8], [position, pivot, scale]: [[f32; 3]; 3], rotation: [f32; 4]) -> Vec<u8> {
    let track = |id: u16, values: &[f32]| {
        // Two keys; the first has two numbers, its tension and its bias.
        let key = |which: u16, numbers: &[f32], values: &[f32]| {
            [&[0; 4][..], &shorts(&[which]), &floats(numbers), &floats(values)].concat()
        };
        let other: Vec<f32> = values.iter().map(|value| value + 7.0).collect();
        let keys = [key(0b101, &[0.5, 0.5], values), key(0, &[], &other)].concat();
        chunk(id, &[&[0; 10], &2_u32.to_le_bytes(), &keys])
    };
    chunk(
        0xB002,
        &[
            &chunk(0xB030, &[&shorts(&[id])]),
            &chunk(0xB010, &[mesh, b"\0", &shorts(&[0, 0, parent])]),
            &chunk(0xB013, &[&floats(&pivot)]),
            &track(0xB020, &position),
            &track(0xB021, &rotation),
            &track(0xB022, &scale),
        ],
    )
}

/// A file with these nodes, and a triangle that its mesh matrix moves by two along x.
fn with_nodes(nodes: &[Vec<u8>]) -> Vec<u8> {
    let positions = floats(&[2.0, 0.0, 0.0, 3.0, 0.0, 0.0, 2.0, 1.0, 0.0]);
    let matrix = floats(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 2.0, 0.0, 0.0]);
    let mesh = chunk(
        0x4100,
        &[
            &chunk(0x4110, &[&shorts(&[3]), &positions]),
            &chunk(0x4160, &[&matrix]),
            &chunk(0x4120, &[&shorts(&[1, 0, 1, 2, 7])]),
        ],
    );
    let object = chunk(0x4000, &[b"leaf\0", &mesh]);
    chunk(0x4D4D, &[&chunk(0x3D3D, &[&object]), &chunk(0xB000, &[&nodes.concat()])])
}

const AT_REST: [f32; 3] = [0.0; 3];
const WHOLE: [f32; 3] = [1.0; 3];
const ROOT: u16 = u16::MAX;

#[test]
fn instances_stand_where_their_nodes_are_in_the_first_frame() {
    let folder = Folder::new();
    let quarter = std::f32::consts::FRAC_PI_2;
    let up = [0.0, 0.0, 10.0];
    let file = with_nodes(&[
        node(4, ROOT, b"$$$DUMMY", [up, AT_REST, [2.0; 3]], [0.0; 4]),
        node(5, 4, b"leaf", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], WHOLE], [0.0; 4]),
        // About z, clockwise: x becomes -y.
        node(6, 4, b"leaf", [AT_REST, AT_REST, WHOLE], [quarter, 0.0, 0.0, 3.0]),
        // A node whose parent does not exist.
        node(7, 99, b"leaf", [AT_REST, AT_REST, WHOLE], [0.0; 4]),
    ]);
    let scene = load_one(&folder.write("leaves.3ds", &file)).unwrap();
    assert_eq!((scene.meshes.len(), scene.objects.len()), (1, 3));
    assert_eq!(scene.warnings.groups().len(), 0, "{:?}", scene.warnings.groups());
    // The second corner is at (1, 0, 0) in the mesh's own axes.
    let corner = scene.meshes[0].positions[1];
    let places: Vec<_> = scene.objects.iter().map(|object| object.transform.transform_point3(corner)).collect();
    for (place, expected) in places.into_iter().zip([[4.0, -2.0, 10.0], [0.0, -2.0, 10.0], [1.0, 0.0, 0.0]]) {
        assert!(place.distance(expected.into()) < 1e-5, "{place} {expected:?}");
    }
    let whole = file.len();
    for damaged in mutations(&file, 500) {
        if let Ok(scene) = load_capped(&folder.write("damaged.3ds", &damaged)) {
            assert!(scene.objects.len() < whole / 40);
            assert_references_are_valid(&scene);
        }
    }
}

#[test]
fn the_only_instance_of_a_mesh_stands_where_its_positions_are() {
    let folder = Folder::new();
    let load = |node| load_one(&folder.write("leaf.3ds", with_nodes(&[node]))).unwrap();
    let at = |x: f32| node(0, ROOT, b"leaf", [[x, 0.0, 0.0], AT_REST, WHOLE], [0.0; 4]);
    let [still, moved, nowhere] = [2.0, 5.0, f32::NAN].map(|x| load(at(x)));
    for (scene, warnings) in [(still, 0), (moved, 1), (nowhere, 1)] {
        assert_eq!(scene.warnings.groups().len(), warnings, "{:?}", scene.warnings.groups());
        assert_eq!(scene.objects.len(), 1);
        assert_eq!(scene.objects[0].transform, Mat4::IDENTITY);
    }
}

#[test]
fn damaged_files_are_errors_with_their_place_or_load_with_valid_references() {
    let folder = Folder::new();
    let whole = square();
    let error = load_one(&folder.write("b.3ds", b"PK\x03\x04\x0a\0\0\0\0\0")).unwrap_err().to_string();
    assert!(error.contains("b.3ds"), "{error}");
    let mut wrong = whole.clone();
    wrong[0] = 0x3D;
    let error = load_one(&folder.write("c.3ds", &wrong)).unwrap_err().to_string();
    assert!(error.contains("no 3DS file") && error.contains("valid: 4D4D"), "{error}");
    let short = whole[..whole.len() - 20].to_vec();
    let error = load_one(&folder.write("d.3ds", &short)).unwrap_err().to_string();
    assert!(error.contains("at byte") && error.contains("a chunk announces"), "{error}");
    let (mut refused, mut loaded) = (0, 0);
    for damaged in mutations(&whole, 2000) {
        match load_capped(&folder.write("e.3ds", damaged)) {
            Ok(scene) => {
                assert_references_are_valid(&scene);
                loaded += 1;
            }
            Err(_) => refused += 1,
        }
    }
    assert!(refused > 200 && loaded > 200, "{refused} refused, {loaded} loaded");
    // A list of faces for an undeclared material.
    let unknown = whole.windows(3).position(|window| window == b"red").expect("the list of faces names it");
    let mut renamed = whole;
    renamed[unknown] = b'b';
    let scene = load_one(&folder.write("f.3ds", renamed)).unwrap();
    assert_eq!(count(&scene.warnings, "materials that are used but not declared"), 1);
}
