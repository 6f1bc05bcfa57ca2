//! Normal maps: the data that loaders read, and the tangents of scenes compared with the directions of growing u and v.

use crate::scene_support::{Folder, count};
use curitiba_pipeline::color::ColorSpace;
use curitiba_pipeline::scene::normal_map::bent;
use curitiba_pipeline::scene::{BuildOptions, LoadOptions, Needs, RenderScene, Scene, load};
use glam::{DMat2, DVec2, DVec3, Mat4, Vec2, Vec3, Vec4};
use serde_json::{Value, json};
use std::path::PathBuf;

/// A texel whose vector leans along u and along v by different amounts.
const TEXEL: [u8; 3] = [214, 86, 230];

fn vector() -> DVec3 {
    DVec3::from(TEXEL.map(f64::from)) / 255.0 * 2.0 - 1.0
}

/// Two adjacent squares in the plane z = 0, with glTF texture coordinates (v downwards). With six vertices they share the two at x
/// = 1.
struct Asset {
    positions: Vec<[f32; 3]>,
    texcoords: Vec<[f32; 2]>,
    indices: Vec<u16>,
    normals: bool,
    tangents: Option<Vec<[f32; 4]>>,
    node: Value,
    map: Value,
}

impl Asset {
    /// A single square; `uv` gives its texture coordinates from x and y.
    fn square(uv: impl Fn(f32, f32) -> [f32; 2]) -> Self {
        let places = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        Self {
            positions: places.map(|[x, y]| [x, y, 0.0]).to_vec(),
            texcoords: places.map(|[x, y]| uv(x, y)).to_vec(),
            indices: vec![0, 1, 2, 0, 2, 3],
            normals: true,
            tangents: None,
            node: json!({"mesh": 0}),
            map: json!({"index": 0}),
        }
    }

    /// Two squares with texture coordinates mirrored at x = 1, where they share vertices.
    fn mirrored() -> Self {
        let places = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 1.0]];
        Self {
            positions: places.map(|[x, y]| [x, y, 0.0]).to_vec(),
            texcoords: places.map(|[x, y]: [f32; 2]| [1.0 - (x - 1.0).abs(), 1.0 - y]).to_vec(),
            indices: vec![0, 1, 4, 0, 4, 3, 1, 2, 5, 1, 5, 4],
            ..Self::square(|x, y| [x, y])
        }
    }

    fn write(&self, folder: &Folder) -> PathBuf {
        let [r, g, b] = TEXEL;
        folder.png("map.png", 1, 1, [r, g, b, 255]);
        let mut binary: Vec<u8> = Vec::new();
        let (mut views, mut accessors) = (Vec::new(), Vec::new());
        let mut add = |bytes: Vec<u8>, component: u32, count: usize, kind: &str| {
            binary.resize(binary.len().next_multiple_of(4), 0);
            views.push(json!({"buffer": 0, "byteOffset": binary.len(), "byteLength": bytes.len()}));
            accessors
                .push(json!({"bufferView": views.len() - 1, "componentType": component, "count": count, "type": kind}));
            binary.extend(bytes);
            accessors.len() - 1
        };
        let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
        let vertices = self.positions.len();
        let mut attributes = json!({
            "POSITION": add(floats(self.positions.as_flattened()), 5126, vertices, "VEC3"),
            "TEXCOORD_0": add(floats(self.texcoords.as_flattened()), 5126, vertices, "VEC2"),
        });
        if self.normals {
            let normals = vec![[0.0, 0.0, 1.0]; vertices];
            attributes["NORMAL"] = add(floats(normals.as_flattened()), 5126, vertices, "VEC3").into();
        }
        if let Some(tangents) = &self.tangents {
            attributes["TANGENT"] = add(floats(tangents.as_flattened()), 5126, tangents.len(), "VEC4").into();
        }
        let indices = self.indices.iter().flat_map(|index| index.to_le_bytes()).collect();
        let indices = add(indices, 5123, self.indices.len(), "SCALAR");
        let json = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [self.node],
            "meshes": [{"primitives": [{"attributes": attributes, "indices": indices, "material": 0}]}],
            "materials": [{"name": "bumps", "doubleSided": true, "normalTexture": self.map}],
            "textures": [{"source": 0}], "images": [{"uri": "map.png"}],
            "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": binary.len(), "uri": "a.bin"}]
        });
        folder.write("a.bin", &binary);
        folder.write("a.gltf", json.to_string())
    }

    fn build(&self, options: &BuildOptions) -> RenderScene {
        let folder = Folder::new();
        let scene = load(&[self.write(&folder)], &LoadOptions::default(), &|_| {}).expect("it loads");
        assert_eq!(scene.warnings.groups().len(), 0, "{:?}", scene.warnings.groups());
        RenderScene::build(scene, options).expect("it is built").0
    }
}

/// The directions of growing u and v on a triangle and its normal, computed only from its positions and texture coordinates.
fn frame(scene: &RenderScene, triangle: [u32; 3]) -> [DVec3; 3] {
    let [a, b, c] = triangle.map(|corner| scene.geometry.positions[corner as usize].as_dvec3());
    let [ta, tb, tc] = triangle.map(|corner| scene.geometry.texcoords[corner as usize].as_dvec2());
    let (e1, e2) = (b - a, c - a);
    let inverse = DMat2::from_cols(tb - ta, tc - ta).inverse();
    let along = |row: DVec2| (e1 * row.x + e2 * row.y).normalize();
    [along(inverse.x_axis), along(inverse.y_axis), e1.cross(e2).normalize()]
}

/// The largest distance, over all corners, of bent normals from those in the exact frame of u and v. `flip` inverts the texels'
/// green, `side` multiplies the tangents' sign.
fn error(scene: &RenderScene, scale: f64, flip: bool, side: f32) -> f64 {
    let geometry = &scene.geometry;
    let map = scene.materials[0].normal_texture.expect("the material has a normal map");
    let mut largest = 0.0_f64;
    for triangle in &geometry.triangles {
        let [u, v, flat] = frame(scene, *triangle);
        for corner in triangle.map(|corner| corner as usize) {
            let normal = geometry.normals[corner];
            let mut texel = scene.textures[map as usize].sample(geometry.texcoords[corner], 0.0).truncate();
            if flip {
                texel.y = 1.0 - texel.y;
            }
            let tangent = geometry.tangents[corner] * Vec4::new(1.0, 1.0, 1.0, side);
            let found = bent(texel, scene.materials[0].normal_scale, normal, tangent, flat.as_vec3());
            let [x, y, z] = (vector() * DVec3::new(scale, scale, 1.0)).to_array();
            let exact = (u * x + v * y + normal.as_dvec3() * z).normalize();
            largest = largest.max(found.as_dvec3().distance(exact));
        }
    }
    largest
}

#[test]
fn computed_tangents_tilt_the_normal_towards_growing_u_and_v_in_every_layout() {
    // Plain (v downwards, as in images), rotated by 30 degrees, upside down, mirrored in u, and with axes exchanged and
    // scaled by 7.
    let layouts: [fn(f32, f32) -> [f32; 2]; 5] = [
        |x, y| [x, 1.0 - y],
        |x, y| [0.866 * x - 0.5 * y, -0.5 * x - 0.866 * y],
        |x, y| [x, y],
        |x, y| [-x, 1.0 - y],
        |x, y| [7.0 * y, 7.0 * x],
    ];
    for (number, layout) in layouts.into_iter().enumerate() {
        let built = Asset::square(layout).build(&BuildOptions::default());
        assert_eq!(built.geometry.tangents.len(), 4);
        let found = error(&built, 1.0, false, 1.0);
        assert!(found < 1e-6, "layout {number}: {found}");
        assert!(error(&built, 1.0, true, 1.0) > 0.3, "control: green the other way round");
        assert!(error(&built, 1.0, false, -1.0) > 0.3, "control: the other handedness");
    }
}

#[test]
fn vertices_are_split_where_texture_coordinates_are_mirrored() {
    let built = Asset::mirrored().build(&BuildOptions::default());
    // Both vertices of the seam are duplicated, one for each tangent.
    assert_eq!((built.geometry.positions.len(), built.geometry.triangles.len()), (8, 4));
    assert!(error(&built, 1.0, false, 1.0) < 1e-6);
    assert!(built.geometry.tangents.iter().any(|tangent| tangent.w > 0.0));
    assert!(built.geometry.tangents.iter().any(|tangent| tangent.w < 0.0));
    // Control: with the sign ignored one half is wrong.
    let mut unsigned = built.clone();
    unsigned.geometry.tangents.iter_mut().for_each(|tangent| tangent.w = 1.0);
    assert!(error(&unsigned, 1.0, false, 1.0) > 0.3);
}

#[test]
fn tangents_turn_and_mirror_with_the_objects_and_the_scene() {
    // Transforms that keep the texture axes perpendicular; under others an orthogonal frame cannot be exact.
    let nodes = [
        json!({"mesh": 0, "rotation": [0.5, 0.5, 0.5, 0.5]}),
        json!({"mesh": 0, "scale": [-1.0, 1.0, 1.0]}),
        json!({"mesh": 0, "scale": [3.0, 0.5, -2.0]}),
        json!({"mesh": 0, "scale": [1e-3, 5e-3, 1.0], "rotation": [0.0, 0.6, 0.0, 0.8]}),
    ];
    let turn = Mat4::from_rotation_y(0.7) * Mat4::from_scale(Vec3::new(-2.0, 2.0, 2.0));
    for node in nodes {
        for swap_yz in [false, true] {
            for transform in [Mat4::IDENTITY, turn] {
                let asset = Asset { node: node.clone(), ..Asset::mirrored() };
                let built = asset.build(&BuildOptions { swap_yz, transform, ..BuildOptions::default() });
                let found = error(&built, 1.0, false, 1.0);
                assert!(found < 1e-5, "{node} {swap_yz}: {found}");
                let unit = |tangent: &Vec4| (tangent.truncate().length() - 1.0).abs() < 1e-5 && tangent.w.abs() == 1.0;
                assert!(built.geometry.tangents.iter().all(unit));
            }
        }
    }
}

#[test]
fn scales_multiply_what_is_not_the_height() {
    for scale in [0.5, -1.5, 0.0] {
        let asset = Asset { map: json!({"index": 0, "scale": scale}), ..Asset::mirrored() };
        let built = asset.build(&BuildOptions::default());
        assert!(error(&built, scale, false, 1.0) < 1e-6, "{scale}");
        assert!(error(&built, 1.0, false, 1.0) > 0.1, "control");
    }
    let folder = Folder::new();
    let path = Asset { map: json!({"index": 0, "scale": 1e30}), ..Asset::mirrored() }.write(&folder);
    let scene = load(&[path], &LoadOptions::default(), &|_| {}).expect("it loads");
    assert_eq!(count(&scene.warnings, "normal maps with a scale that is not from -1e6 to 1e6"), 1);
    assert_eq!(scene.materials[0].normal_scale, 1e6);
}

#[test]
fn tangents_of_the_file_are_taken_as_they_are() {
    // These tangents deliberately differ from the direction of growing u; the third has no direction.
    let tangents = vec![[0.0, 2.0, 0.0, 1.0], [0.6, 0.8, 0.0, -1.0], [0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, -0.99]];
    let asset = Asset { tangents: Some(tangents), ..Asset::square(|x, y| [x, 1.0 - y]) };
    let folder = Folder::new();
    let scene = load(&[asset.write(&folder)], &LoadOptions::default(), &|_| {}).expect("it loads");
    let (built, warnings) = RenderScene::build(scene, &BuildOptions::default()).expect("it is built");
    let expected =
        [Vec4::new(0.0, 1.0, 0.0, 1.0), Vec4::new(0.6, 0.8, 0.0, -1.0), Vec4::ZERO, Vec4::new(1.0, 0.0, 0.0, -1.0)];
    assert_eq!(built.geometry.tangents, expected);
    assert_eq!(count(&warnings, "meshes with tangents that have no direction"), 1);
    // Tangents without normals are ignored (glTF 2.0, section 3.7.2.1).
    let bare = Asset { normals: false, ..asset }.build(&BuildOptions::default());
    assert!(error(&bare, 1.0, false, 1.0) < 1e-6);
    let short = Asset { tangents: Some(vec![[1.0, 0.0, 0.0, 1.0]; 3]), ..Asset::square(|x, y| [x, y]) };
    let error = load(&[short.write(&folder)], &LoadOptions::default(), &|_| {}).expect_err("one is missing");
    assert!(error.to_string().contains("4 positions but 3 tangents"), "{error}");
}

#[test]
fn maps_are_numbers_in_every_colour_space() {
    let built = Asset::mirrored().build(&BuildOptions { color: ColorSpace::Linear, ..BuildOptions::default() });
    assert!(error(&built, 1.0, false, 1.0) < 1e-6, "decoded from sRGB it would lean otherwise");
    assert!(!built.decodes_texels());
}

#[test]
fn transforms_of_coordinates_apply_and_foreign_ones_leave_the_map_out() {
    let transform = json!({"KHR_texture_transform": {"rotation": 1.0, "scale": [2.0, -3.0], "offset": [0.5, 0.5]}});
    let asset = Asset { map: json!({"index": 0, "extensions": transform}), ..Asset::square(|x, y| [x, 1.0 - y]) };
    let built = asset.build(&BuildOptions::default());
    assert!(error(&built, 1.0, false, 1.0) < 0.5, "the lines of u and v are askew");
    let u = frame(&built, built.geometry.triangles[0])[0];
    assert!(built.geometry.tangents[0].truncate().as_dvec3().distance(u) < 1e-5);
    let broken = json!({"KHR_texture_transform": {"rotation": "x"}});
    let folder = Folder::new();
    let path = Asset { map: json!({"index": 0, "extensions": broken}), ..Asset::mirrored() }.write(&folder);
    let error = load(std::slice::from_ref(&path), &LoadOptions::default(), &|_| {}).expect_err("no number");
    assert!(error.to_string().contains("`bumps`: KHR_texture_transform"), "{error}");

    let text = std::fs::read_to_string(asset.write(&folder)).expect("it was written");
    let mut json: Value = serde_json::from_str(&text).expect("JSON");
    json["materials"][0]["pbrMetallicRoughness"] = json!({"baseColorTexture": {"index": 0}});
    let path = folder.write("b.gltf", json.to_string());
    let scene = load(&[path], &LoadOptions::default(), &|_| {}).expect("it loads");
    assert_eq!(count(&scene.warnings, "normal textures with coordinates of their own"), 1);
    assert_eq!(scene.materials[0].normal_texture, None);
}

#[test]
fn what_nobody_asks_for_is_not_loaded() {
    let folder = Folder::new();
    let path = Asset { tangents: Some(vec![[1.0, 0.0, 0.0, 1.0]; 6]), ..Asset::mirrored() }.write(&folder);
    let build = |needs: Needs| {
        let scene = load(std::slice::from_ref(&path), &LoadOptions { needs, ..LoadOptions::default() }, &|_| {});
        let scene: Scene = scene.expect("it loads");
        let loaded = (scene.meshes[0].tangents.len(), scene.meshes[0].texcoords.len());
        let built =
            RenderScene::build(scene, &BuildOptions { needs, ..BuildOptions::default() }).expect("it is built").0;
        (loaded, built)
    };
    let (loaded, built) = build(Needs { normal_maps: false, ..Needs::ALL });
    assert_eq!((loaded, built.geometry.tangents.len(), built.textures.len()), ((0, 6), 0, 0));
    assert_eq!(built.materials[0].normal_texture, None);
    // If only normals are needed, texture coordinates and the normal map are loaded, but no other texture.
    let normals = Needs { normals: true, normal_maps: true, ..Needs::NOTHING };
    let (loaded, built) = build(normals);
    assert_eq!((loaded, built.geometry.texcoords.len(), built.textures.len()), ((6, 6), 6, 1));
    let (loaded, built) = build(Needs { normal_maps: true, ..Needs::NOTHING });
    assert_eq!((loaded, built.geometry.texcoords.len(), built.geometry.tangents.len()), ((0, 0), 0, 0));
    // Nothing is loaded if no material has a normal map.
    let text = std::fs::read_to_string(&path).expect("it was written").replace("normalTexture", "extras");
    let path = folder.write("plain.gltf", text);
    let scene = load(&[path], &LoadOptions { needs: normals, ..LoadOptions::default() }, &|_| {}).expect("it loads");
    assert!(scene.meshes[0].tangents.is_empty() && scene.meshes[0].texcoords.is_empty());
    let built =
        RenderScene::build(scene, &BuildOptions { needs: normals, ..BuildOptions::default() }).expect("built").0;
    assert!(built.geometry.tangents.is_empty() && built.geometry.texcoords.is_empty());
    assert_eq!(built.geometry.positions.len(), 6, "nothing is split");
}

#[test]
fn what_a_conversion_does_not_write_is_counted() {
    let folder = Folder::new();
    let path = Asset::mirrored().write(&folder);
    let scene = load(std::slice::from_ref(&path), &LoadOptions::default(), &|_| {}).expect("it loads");
    let layout = curitiba_pipeline::scene::Layout::Cbo2014;
    let cbo = path.with_extension("cbo");
    let warnings = curitiba_pipeline::scene::write_cbo(&scene, &cbo, layout).expect("it is written");
    assert_eq!((count(&warnings, "normal maps"), warnings.groups().len()), (1, 1), "{:?}", warnings.groups());
    let text = String::from_utf8_lossy(&std::fs::read(cbo).expect("it is there")).into_owned();
    assert!(!text.contains("map.png"));
}

const OBJ: &str = "mtllib a.mtl\nusemtl bumps\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
                   f 1/1/1 2/2/1 3/3/1 4/4/1\n";

#[test]
fn obj_materials_name_normal_maps_in_two_ways_and_height_maps_are_warnings() {
    for (statement, scale) in [("norm map.png", 1.0), ("map_Kn map.png", 1.0), ("norm -bm 0.5 map.png", 0.5)] {
        let folder = Folder::new();
        let [r, g, b] = TEXEL;
        folder.png("map.png", 1, 1, [r, g, b, 255]);
        folder.write("a.mtl", format!("newmtl bumps\n{statement}\nmap_Bump -bm 2 map.png\n"));
        let path = folder.write("a.obj", OBJ);
        for needs in [Needs::ALL, Needs { normals: true, normal_maps: true, ..Needs::NOTHING }] {
            let scene = load(std::slice::from_ref(&path), &LoadOptions { needs, ..LoadOptions::default() }, &|_| {});
            let scene = scene.expect("it loads");
            assert_eq!(count(&scene.warnings, "texture maps that no program reads"), 1, "the height map");
            let (built, _) =
                RenderScene::build(scene, &BuildOptions { needs, ..BuildOptions::default() }).expect("built");
            assert!(error(&built, scale, false, 1.0) < 1e-6, "{statement}");
        }
        let plain = Needs { normals: true, ..Needs::NOTHING };
        let scene = load(&[path], &LoadOptions { needs: plain, ..LoadOptions::default() }, &|_| {}).expect("it loads");
        assert!(scene.meshes[0].texcoords.is_empty());
    }
    let folder = Folder::new();
    folder.write("a.mtl", "newmtl bumps\nnorm none.png\n");
    let scene = load(&[folder.write("a.obj", OBJ)], &LoadOptions::default(), &|_| {}).expect("it loads");
    assert_eq!(count(&scene.warnings, "missing textures"), 1);
    assert_eq!(scene.materials[0].normal_texture, None);
}

#[test]
fn vertices_of_very_many_triangles_have_no_tangent_and_take_no_time() {
    // A fan of 100,000 triangles around one vertex: comparing all pairs would not end.
    let count_of = 100_000;
    let mut obj = "mtllib a.mtl\nusemtl bumps\nv 0 0 0\nvn 0 0 1\nvt 0 0\n".to_owned();
    for step in 0..=count_of {
        let (sin, cos) = (f64::from(step) / f64::from(count_of) * 6.0).sin_cos();
        obj += &format!("v {cos} {sin} 0\nvt {cos} {sin}\n");
    }
    for step in 0..count_of {
        obj += &format!("f 1/1/1 {0}/{0}/1 {1}/{1}/1\n", step + 2, step + 3);
    }
    obj += "v 5 0 0\nv 6 0 0\nv 6 1 0\nf -3/1/1 -2/2/1 -1/3/1\n";
    let folder = Folder::new();
    folder.png("map.png", 1, 1, [200, 100, 200, 255]);
    folder.write("a.mtl", "newmtl bumps\nnorm map.png\n");
    let scene = load(&[folder.write("a.obj", obj)], &LoadOptions::default(), &|_| {}).expect("it loads");
    let (built, warnings) = RenderScene::build(scene, &BuildOptions::default()).expect("it is built");
    assert_eq!(
        count(&warnings, "meshes with vertices of more than 1024 triangles, around which no tangent is computed"),
        1
    );
    let with = built.geometry.tangents.iter().filter(|tangent| **tangent != Vec4::ZERO).count();
    assert_eq!(with, 3, "the triangle beside it has them");
}

#[test]
fn tangents_of_scenes_that_are_joined_stay_with_their_vertices() {
    let mut whole = Asset::square(|x, y| [x, 1.0 - y]).build(&BuildOptions::default());
    let normals = Needs { normals: true, normal_maps: true, ..Needs::NOTHING };
    let folder = Folder::new();
    let text = std::fs::read_to_string(Asset::mirrored().write(&folder)).expect("it was written");
    let path = folder.write("plain.gltf", text.replace("normalTexture", "extras"));
    let scene = load(&[path], &LoadOptions { needs: normals, ..LoadOptions::default() }, &|_| {}).expect("it loads");
    let plain =
        RenderScene::build(scene, &BuildOptions { needs: normals, ..BuildOptions::default() }).expect("built").0;
    whole.append(plain.clone());
    assert_eq!((whole.geometry.tangents.len(), whole.geometry.texcoords.len()), (10, 10));
    assert_eq!(whole.geometry.tangents[4..], [Vec4::ZERO; 6]);
    let mut turned = plain;
    turned.append(Asset::square(|x, y| [x, 1.0 - y]).build(&BuildOptions::default()));
    assert_eq!(
        (turned.geometry.tangents[..6].to_vec(), turned.geometry.texcoords[0]),
        (vec![Vec4::ZERO; 6], Vec2::ZERO)
    );
    assert_eq!(turned.materials[1].normal_texture, Some(0));
}
