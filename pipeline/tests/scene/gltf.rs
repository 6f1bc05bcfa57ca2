//! glTF and GLB assets that are written by hand.

use crate::scene_support::{Folder, assert_references_are_valid, count, load_capped, load_one, mutations, triangles};
use curitiba_pipeline::color::ColorSpace;
use curitiba_pipeline::glass::Reflectance;
use curitiba_pipeline::scene::texture::{Magnification, Sampling, Wrap};
use curitiba_pipeline::scene::{
    BuildOptions, Layout, LoadOptions, Needs, RenderScene, Scene, TextureSource, load, write_cbo,
};
use glam::{DVec3, Mat4, Vec2, Vec3, Vec4};
use serde_json::{Value, json};
use std::sync::Arc;

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn shorts(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn glb(json: &Value, binary: &[u8]) -> Vec<u8> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF".to_vec();
    for word in [2, 28 + text.len() as u32 + binary.len() as u32, text.len() as u32] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend(b"JSON");
    bytes.extend(&text);
    bytes.extend((binary.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(binary);
    bytes
}

/// A unit square of four vertices (0,0) (1,0) (0,1) (1,1) with equal texture coordinates and six 16-bit indices.
fn square() -> (Value, Vec<u8>) {
    let mut binary = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]);
    binary.extend(floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0]));
    binary.extend(shorts(&[0, 1, 2, 2, 1, 3]));
    let json = json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "square"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "materials": [{"name": "paint"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"}
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 32},
            {"buffer": 0, "byteOffset": 80, "byteLength": 12}
        ],
        "buffers": [{"byteLength": 92}]
    });
    (json, binary)
}

fn read(json: &Value, binary: &[u8]) -> Result<Scene, String> {
    let folder = Folder::new();
    load_one(&folder.write("a.glb", glb(json, binary))).map_err(|error| error.to_string())
}

fn corners(scene: &Scene) -> Vec<[Vec3; 3]> {
    let (built, _) = RenderScene::build(scene.clone(), &BuildOptions::default()).unwrap();
    (0..built.geometry.triangles.len() as u32).map(|id| built.geometry.corners(id)).collect()
}

#[test]
fn glb_gltf_with_a_file_and_gltf_with_a_data_uri_are_the_same() {
    let (mut json, binary) = square();
    let expected = read(&json, &binary).unwrap();
    assert_eq!(expected.meshes[0].groups[0].triangles, [[0, 1, 2], [2, 1, 3]]);
    assert_eq!(expected.meshes[0].texcoords[0], Vec2::new(0.0, 1.0), "v = 0 is the bottom row");
    let folder = Folder::new();
    folder.write("my data.bin", &binary);
    json["buffers"][0]["uri"] = "my%20data.bin".into();
    let external = load_one(&folder.write("a.gltf", json.to_string())).unwrap();
    let alphabet = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let base64: String = binary
        .chunks(3)
        .flat_map(|three| {
            let bits = three.iter().fold(0_u32, |bits, byte| bits << 8 | u32::from(*byte)) << (8 * (3 - three.len()));
            (0..=three.len()).map(move |i| char::from(alphabet[(bits >> (18 - 6 * i) & 63) as usize]))
        })
        .collect();
    json["buffers"][0]["uri"] = format!("data:application/octet-stream;base64,{base64}").into();
    let embedded = load_one(&folder.write("b.gltf", json.to_string())).unwrap();
    for scene in [external, embedded] {
        assert_eq!(scene.meshes[0].positions, expected.meshes[0].positions);
        assert_eq!(scene.meshes[0].texcoords, expected.meshes[0].texcoords);
    }
}

#[test]
fn node_transforms_multiply_and_meshes_are_shared() {
    let (mut json, binary) = square();
    json["scenes"] = json!([{"nodes": [2, 1]}]);
    json["nodes"] = json!([
        {"mesh": 0, "scale": [-2.0, 1.0, 1.0], "rotation": [0.0, 0.0, 1.0, 1.0]},
        {"mesh": 0, "matrix": [1.0,0.0,0.0,0.0, 0.0,1.0,0.0,0.0, 0.0,0.0,1.0,0.0, 7.0,8.0,9.0,1.0]},
        {"translation": [0.0, 0.0, 5.0], "children": [0]}
    ]);
    let scene = read(&json, &binary).unwrap();
    assert_eq!((scene.meshes.len(), scene.objects.len()), (1, 2));
    // Scaled by -2 along x, rotated by 90° about z (the quaternion is normalised), translated along z.
    let point = scene.objects[0].transform.transform_point3(Vec3::X);
    assert!(point.distance(Vec3::new(0.0, -2.0, 5.0)) < 1e-5, "{point}");
    assert_eq!(scene.objects[1].transform, Mat4::from_translation(Vec3::new(7.0, 8.0, 9.0)));
}

#[test]
fn strips_and_fans_keep_their_orientation_and_missing_indices_count_up() {
    let (mut json, binary) = square();
    let primitive = |json: &mut Value| json["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("indices");
    primitive(&mut json);
    json["meshes"][0]["primitives"][0]["mode"] = 5.into();
    let strip = corners(&read(&json, &binary).unwrap());
    assert_eq!(strip.len(), 2);
    for [a, b, c] in &strip {
        assert_eq!((*b - *a).cross(*c - *a).z, 1.0, "counter-clockwise");
    }
    json["meshes"][0]["primitives"][0]["mode"] = 6.into();
    let scene = read(&json, &binary).unwrap();
    assert_eq!(scene.meshes[0].groups[0].triangles, [[1, 2, 0], [2, 3, 0]]);
    json["meshes"][0]["primitives"][0]["mode"] = 1.into();
    let scene = read(&json, &binary).unwrap();
    assert_eq!(count(&scene.warnings, "primitives that are not triangles"), 1);
    json["meshes"][0]["primitives"][0]["mode"] = 4.into();
    let scene = read(&json, &binary).unwrap();
    assert_eq!(scene.meshes[0].groups[0].triangles, [[0, 1, 2]]);
    assert_eq!(count(&scene.warnings, "index counts that are no multiple of 3"), 1);
}

#[test]
fn sparse_accessors_strides_and_normalised_integers_are_read() {
    let (mut json, mut binary) = square();
    // A sparse accessor replaces two vertices; the first keeps the view's value.
    let sparse_at = binary.len();
    binary.extend([1, 3, 0, 0]);
    binary.extend(floats(&[9.0, 0.0, 0.0, 9.0, 9.0, 0.0]));
    json["bufferViews"].as_array_mut().unwrap().extend([
        json!({"buffer": 0, "byteOffset": sparse_at, "byteLength": 4}),
        json!({"buffer": 0, "byteOffset": sparse_at + 4, "byteLength": 24}),
    ]);
    json["accessors"][0]["sparse"] = json!({
        "count": 2, "indices": {"bufferView": 3, "componentType": 5121}, "values": {"bufferView": 4}
    });
    // Texture coordinates: normalised bytes, four bytes apart.
    let strided_at = binary.len();
    binary.extend([0, 255, 7, 7, 255, 255, 7, 7, 0, 0, 7, 7, 51, 0]);
    json["bufferViews"]
        .as_array_mut()
        .unwrap()
        .push(json!({"buffer": 0, "byteOffset": strided_at, "byteLength": 14, "byteStride": 4}));
    json["accessors"][1] =
        json!({"bufferView": 5, "componentType": 5121, "normalized": true, "count": 4, "type": "VEC2"});
    json["buffers"][0]["byteLength"] = binary.len().into();
    let scene = read(&json, &binary).unwrap();
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.positions, [Vec3::ZERO, Vec3::X * 9.0, Vec3::Y, Vec3::new(9.0, 9.0, 0.0)]);
    assert_eq!(mesh.texcoords, [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::new(0.2, 1.0)]);
    // Without a view, the base of a sparse accessor is zero.
    json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    let scene = read(&json, &binary).unwrap();
    assert_eq!(scene.meshes[0].positions, [Vec3::ZERO, Vec3::X * 9.0, Vec3::ZERO, Vec3::new(9.0, 9.0, 0.0)]);
    json["accessors"][0]["count"] = 3.into();
    json["accessors"][1]["count"] = 3.into();
    let error = read(&json, &binary).unwrap_err();
    assert!(error.contains("sparse index 3 is not below 3"), "{error}");
}

#[test]
fn materials_and_their_extensions_are_read() {
    let (mut json, binary) = square();
    json["materials"] = json!([
        {
            "name": "glass", "alphaMode": "MASK", "alphaCutoff": 0.25, "emissiveFactor": [0.5, 0.25, 0.0],
            "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.5], "roughnessFactor": 0.4},
            "occlusionTexture": {"index": 0}, "extras": {"priority": 7, "of": "no one else's business"},
            "extensions": {
                "KHR_materials_transmission": {"transmissionFactor": 0.9},
                "KHR_materials_ior": {"ior": 1.33},
                "KHR_materials_volume": {
                    "thicknessFactor": 2.0, "attenuationDistance": 3.0, "attenuationColor": [0.1, 0.5, 0.9]
                },
                "KHR_materials_emissive_strength": {"emissiveStrength": 4.0},
                "KHR_materials_dispersion": {"dispersion": 0.31}
            }
        },
        {"name": "glass", "alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1.0, 1.0, 1.0, 0.75]}},
        {"extensions": {"KHR_materials_ior": {"ior": 0.0}}, "extras": {"priority": 256}}
    ]);
    json["extensionsUsed"] = json!(["KHR_materials_volume"]);
    json["extensionsRequired"] = json!(["KHR_materials_volume", "KHR_materials_sheen"]);
    json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}]);
    let scene = read(&json, &binary).unwrap();
    let glass = &scene.materials[0];
    // The linear factors 0.1, 0.2, 0.3 encoded in sRGB.
    assert!(glass.diffuse.distance(Vec4::new(0.34919, 0.48453, 0.58383, 1.0)) < 1e-4, "{}", glass.diffuse);
    assert_eq!(glass.alpha_cutoff, Some(0.5), "0.25 of the product of factor and texture");
    assert!(glass.emission.distance(Vec4::new(1.35326, 1.0, 0.0, 1.0)) < 1e-4, "{}", glass.emission);
    assert_eq!((glass.transmission, glass.ior, glass.thickness), (0.9, 1.33, 2.0));
    assert_eq!((glass.attenuation_distance, glass.attenuation_color), (3.0, Vec3::new(0.1, 0.5, 0.9)));
    let filter = glass.filter.distance(Vec3::new(0.1, 0.2, 0.3)) < 1e-6;
    assert!(glass.volume && filter && glass.filter_textured && (glass.veil - 0.1).abs() < 1e-6, "{glass:?}");
    assert_eq!((glass.priority, scene.materials[2].priority), (7, 0));
    assert_eq!((glass.dispersion, scene.materials[2].dispersion), (0.31, 0.0));
    assert_eq!((glass.roughness, scene.materials[2].roughness), (0.4, 0.0), "of glass alone");
    assert_eq!(scene.materials[1].name, "glass#1");
    assert!(glass.single_sided, "unless the material says otherwise");
    let veil = &scene.materials[1];
    assert_eq!((veil.diffuse.w, veil.veil, veil.transmission, veil.ior), (0.75, 0.75, 0.25, 1.0), "blended evenly");
    assert_eq!((veil.volume, veil.filter, count(&scene.warnings, "materials that are blended")), (false, Vec3::ONE, 0));
    assert_eq!(scene.materials[2].ior, f32::INFINITY);
    for what in [
        "materials with the name of another one",
        "texture maps that no program reads",
        "required extensions that are not read",
        "materials whose `extras.priority` is no whole number from 0 to 255",
    ] {
        assert_eq!(count(&scene.warnings, what), 1, "{what}");
    }
    json["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("material");
    let scene = read(&json, &binary).unwrap();
    let default = &scene.materials[scene.meshes[0].groups[0].material as usize];
    assert_eq!((default.name.as_str(), default.diffuse), ("default", Vec4::ONE));
}

/// Alpha blending transmits a share of the incident light unchanged; the glass acts on the rest.
#[test]
fn a_blended_pane_lets_through_what_its_alpha_and_its_glass_leave() {
    let (mut json, binary) = square();
    let pane = |alpha: f32, mode: &str, extensions: Value| {
        json!({"alphaMode": mode, "extensions": extensions,
            "pbrMetallicRoughness": {"baseColorFactor": [0.0, 0.5, 1.0, alpha]}})
    };
    let thin = json!({"KHR_materials_transmission": {"transmissionFactor": 0.5}});
    let solid = json!({"KHR_materials_transmission": {"transmissionFactor": 0.5}, "KHR_materials_volume": {"thicknessFactor": 1.0}});
    json["materials"] = json!([
        pane(0.25, "BLEND", thin.clone()),
        pane(0.25, "OPAQUE", thin.clone()),
        pane(1.0, "BLEND", thin),
        pane(0.25, "BLEND", solid)
    ]);
    let scene = read(&json, &binary).unwrap();
    let through = |index: usize| {
        let material = &scene.materials[index];
        assert!((material.veil + material.transmission - 1.0).abs() < 1e-6, "{material:?}");
        material.transmission * material.filter
    };
    // Three quarters of the light are unchanged; of the rest, half passes in the colour of the glass.
    assert!(through(0).distance(Vec3::new(0.75, 0.8125, 0.875)) < 1e-6, "{}", through(0));
    for glass in 1..4 {
        assert!(through(glass).distance(Vec3::new(0.0, 0.25, 0.5)) < 1e-6, "{}", through(glass));
    }
    assert_eq!(count(&scene.warnings, "materials that are blended"), 2, "those with all of their alpha, and of a body");
}

#[test]
fn dispersion_is_that_of_the_extension_or_cauchys_equation() {
    let (mut json, binary) = square();
    let glass = |dispersion: Value, extras: Value, thickness: f64| {
        json!({"extras": extras, "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 1.0}, "KHR_materials_ior": {"ior": 1.6},
            "KHR_materials_volume": {"thicknessFactor": thickness},
            "KHR_materials_dispersion": dispersion
        }})
    };
    json["materials"] = json!([
        glass(json!({"dispersion": 0.5}), json!({}), 1.0),
        // A dense flint: n(587.6 nm) = 1.5 + 0.01 / 0.5876².
        glass(json!({}), json!({"cauchy": [1.5, 0.01]}), 1.0),
        glass(json!({"dispersion": 0.5}), json!({}), 0.0),
        glass(json!({"dispersion": -1.0}), json!({"cauchy": [1.5, -0.01]}), 1.0),
        glass(json!({"dispersion": "much"}), json!({"cauchy": [0.5, 0.01]}), 1.0),
        glass(json!({"dispersion": 1e300}), json!({"cauchy": 3}), 1.0),
    ]);
    json["extensionsUsed"] = json!(["KHR_materials_dispersion"]);
    let scene = read(&json, &binary).unwrap();
    let found: Vec<(f32, f32)> = scene.materials.iter().map(|material| (material.ior, material.dispersion)).collect();
    assert_eq!([found[0], found[3], found[4], found[5]], [(1.6, 0.5), (1.6, 0.0), (1.6, 0.0), (1.6, 0.0)]);
    let (index, dispersion) = found[1];
    assert!((index - 1.528_966).abs() < 1e-5 && (20.0 / dispersion - 27.70).abs() < 0.01, "{index} {dispersion}");
    for (what, expected) in [
        ("materials that disperse and have no volume", 1),
        ("materials whose dispersion is no number from 0 on", 3),
        ("materials whose `extras.cauchy` is not [A, B], B in µm² and 0 or more, with an index above 1", 3),
        ("extensions that are not read", 0),
    ] {
        assert_eq!(count(&scene.warnings, what), expected, "{what}");
    }
}

#[test]
fn glass_may_have_a_reflectance_and_colours_of_its_own() {
    let (mut json, binary) = square();
    let glass = |extras: Value| {
        json!({"extras": extras, "pbrMetallicRoughness": {"baseColorFactor": [0.5, 1.0, 1.0, 1.0]}, "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 1.0}, "KHR_materials_ior": {"ior": 3.0}
        }})
    };
    json["materials"] = json!([
        glass(json!({})),
        glass(json!({"schlick": {"minimum": 0.1, "maximum": 0.9, "exponent": 3}, "reflectionColor": [1, 0.5, 0]})),
        glass(json!({"schlick": {}, "refractionColor": [0.5, 0.25, 0]})),
        // The index follows from Cauchy's equation, and the default minimum from the index.
        glass(json!({"schlick": {"exponent": 4}, "cauchy": [2.0, 0.0]})),
        glass(json!({"schlick": {"minimum": 0.8, "maximum": 0.2}, "reflectionColor": [1, 2, 0]})),
        glass(json!({"schlick": {"power": 5}, "refractionColor": "red"})),
        glass(json!({"schlick": 5, "reflectionColor": [1, 1]})),
    ]);
    let scene = read(&json, &binary).unwrap();
    let curve = |minimum, maximum, exponent| Some(Reflectance { minimum, maximum, exponent });
    let curves: Vec<_> = scene.materials.iter().map(|material| material.reflectance).collect();
    assert_eq!(curves[..3], [None, curve(0.1, 0.9, 3.0), curve(0.25, 1.0, 5.0)]);
    let cauchy = curves[3].unwrap();
    assert!((cauchy.minimum - 1.0 / 9.0).abs() < 1e-6 && cauchy.exponent == 4.0, "{cauchy:?}");
    assert_eq!(curves[4..], [None; 3]);
    let colors: Vec<_> = scene.materials.iter().map(|material| (material.reflection, material.filter)).collect();
    assert_eq!(colors[0], (Vec3::ONE, Vec3::new(0.5, 1.0, 1.0)));
    assert_eq!((colors[1].0, colors[2].1), (Vec3::new(1.0, 0.5, 0.0), Vec3::new(0.25, 0.25, 0.0)));
    assert_eq!(colors[4..], [colors[0]; 3]);
    let warned: usize = scene.warnings.groups().iter().map(|group| group.count as usize).sum();
    assert_eq!(warned, 6, "{:?}", scene.warnings.groups());
}

#[test]
fn contents_that_are_not_drawn_are_counted_each_by_its_kind() {
    let (mut json, binary) = square();
    json["extensionsUsed"] = json!(["KHR_materials_volume", "KHR_materials_clearcoat"]);
    json["materials"][0] = json!({"emissiveTexture": {"index": 0}, "emissiveFactor": [1.0, 1.0, 1.0]});
    json["textures"] = json!([{"source": 0}]);
    json["images"] = json!([{"uri": "none.png"}]);
    let scene = read(&json, &binary).unwrap();
    for what in ["extensions that are not read", "missing textures"] {
        assert_eq!(count(&scene.warnings, what), 1, "{what}");
    }
    assert_eq!(scene.warnings.groups().len(), 2, "{:?}", scene.warnings.groups());
    assert_eq!(scene.materials[0].emission, Vec4::W, "the factor alone would make all of it shine");
}

#[test]
fn emission_is_the_factor_times_its_texture() {
    let (mut json, binary) = square();
    let folder = Folder::new();
    folder.png("base.png", 1, 1, [255; 4]);
    folder.png("lamp.png", 2, 1, [9; 4]);
    folder.write("a.bin", &binary);
    json["buffers"][0]["uri"] = "a.bin".into();
    json["textures"] = json!([{"source": 0}, {"source": 1}]);
    json["images"] = json!([{"uri": "base.png"}, {"uri": "lamp.png"}]);
    let turned = json!({"index": 1, "extensions": {"KHR_texture_transform": {"offset": [0.5, 0.0]}}});
    json["materials"] = json!([
        {"name": "both", "emissiveFactor": [0.214, 0.0, 1.0], "emissiveTexture": {"index": 1},
         "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
        {"name": "lamp", "emissiveFactor": [1.0, 1.0, 1.0], "emissiveTexture": turned},
        {"name": "off", "emissiveTexture": {"index": 1}},
        {"name": "moved", "emissiveFactor": [1.0, 1.0, 1.0], "emissiveTexture": turned,
         "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
    ]);
    json["meshes"][0]["primitives"][0]["material"] = 1.into();
    let scene = load_one(&folder.write("a.gltf", json.to_string())).unwrap();
    let textures: Vec<_> = scene.materials.iter().map(|m| (m.texture, m.emission_texture)).collect();
    assert_eq!(textures, [(Some(0), Some(1)), (None, Some(1)), (None, None), (Some(0), Some(1))]);
    let both = scene.materials[0].emission;
    assert!(both.distance(Vec4::new(0.5, 0.0, 1.0, 1.0)) < 1e-3 && scene.materials[0].emission_added, "{both}");
    assert_eq!(scene.materials[2].emission, Vec4::W);
    assert_eq!(count(&scene.warnings, "emissive textures with coordinates of their own"), 1);
    assert_eq!(scene.meshes[0].texcoords[0], Vec2::new(0.5, 1.0), "without a base texture its own coordinates serve");
    let (built, _) = RenderScene::build(scene, &BuildOptions::default()).unwrap();
    assert_eq!((built.textures.len(), built.materials[1].emission_texture), (1, Some(0)));
}

/// Adds an accessor with its own bytes.
fn add_accessor(json: &mut Value, binary: &mut Vec<u8>, bytes: &[u8], mut accessor: Value) -> usize {
    binary.resize(binary.len().next_multiple_of(4), 0);
    let view = json!({"buffer": 0, "byteOffset": binary.len(), "byteLength": bytes.len()});
    binary.extend(bytes);
    let views = json["bufferViews"].as_array_mut().unwrap();
    views.push(view);
    accessor["bufferView"] = (views.len() - 1).into();
    json["buffers"][0]["byteLength"] = binary.len().into();
    let accessors = json["accessors"].as_array_mut().unwrap();
    accessors.push(accessor);
    accessors.len() - 1
}

/// sRGB encoding by the standard's formula.
fn encoded(linear: f64) -> f32 {
    (if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }) as f32
}

#[test]
fn vertex_colours_of_every_component_type_are_linear_and_have_alpha_where_the_material_asks() {
    let linear = [[0.0, 0.2, 1.0, 1.0], [0.4, 0.6, 0.8, 0.2], [1.0, 1.0, 1.0, 0.0], [0.2, 0.0, 0.4, 0.6]];
    let bytes = |components: usize, largest: f64, size: usize| -> Vec<u8> {
        let numbers = linear.iter().flat_map(|color| &color[..components]);
        numbers.flat_map(|c| ((c * largest).round() as u32).to_le_bytes().into_iter().take(size)).collect()
    };
    let float =
        |components: usize| floats(&linear.map(|c| c.map(|c| c as f32)).map(|c| c[..components].to_vec()).concat());
    for (components, kind) in [(3, "VEC3"), (4, "VEC4")] {
        for (component, data) in
            [(5126, float(components)), (5121, bytes(components, 255.0, 1)), (5123, bytes(components, 65535.0, 2))]
        {
            for mode in ["OPAQUE", "MASK", "BLEND"] {
                let (mut json, mut binary) = square();
                let accessor =
                    json!({"componentType": component, "normalized": component != 5126, "count": 4, "type": kind});
                let index = add_accessor(&mut json, &mut binary, &data, accessor);
                json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = index.into();
                json["materials"][0] = json!({"alphaMode": mode, "alphaCutoff": 0.25});
                if mode != "MASK" {
                    json["materials"][0].as_object_mut().unwrap().remove("alphaCutoff");
                }
                let scene = read(&json, &binary).unwrap();
                let alpha = |written: f64| if components == 4 && mode != "OPAQUE" { written as f32 } else { 1.0 };
                for (found, [r, g, b, a]) in scene.meshes[0].colors.iter().zip(linear) {
                    let expected = Vec4::new(encoded(r), encoded(g), encoded(b), alpha(a));
                    assert!(found.distance(expected) < 1e-6, "{kind} of {component}, {mode}: {found}, not {expected}");
                }
                assert_eq!(scene.meshes[0].colors.len(), 4);
                let cutoff = match mode {
                    "MASK" => Some(0.25),
                    // Vertices of less than half opacity make holes, as with a texture.
                    "BLEND" if components == 4 => Some(0.5),
                    _ => None,
                };
                assert_eq!(scene.materials[0].alpha_cutoff, cutoff, "{kind} {mode}");
                // In linear light the colours have the file's values.
                let options = BuildOptions { color: ColorSpace::Linear, ..BuildOptions::default() };
                let (built, _) = RenderScene::build(scene, &options).unwrap();
                for (found, [r, g, b, _]) in built.geometry.colors.iter().zip(linear) {
                    let expected = Vec3::new(r as f32, g as f32, b as f32);
                    assert!(found.truncate().distance(expected) < 1e-6, "{found}");
                }
                assert!(built.materials[0].vertex_colors);
                assert_eq!(built.materials[0].alpha_cutoff, cutoff, "it is cut without a texture");
            }
        }
    }
}

#[test]
fn vertex_colours_cost_nothing_where_nobody_asks_and_wrong_ones_are_errors_or_mended() {
    let (mut json, mut binary) = square();
    let colors = floats(&[0.5, f32::NAN, -1.0, 7.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, f32::INFINITY, 1.0]);
    let index =
        add_accessor(&mut json, &mut binary, &colors, json!({"componentType": 5126, "count": 4, "type": "VEC3"}));
    json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = index.into();
    let scene = read(&json, &binary).unwrap();
    let (built, warnings) = RenderScene::build(scene, &BuildOptions::default()).unwrap();
    assert_eq!(count(&warnings, "meshes with vertex colours that are not from 0 to 1"), 1);
    let found: Vec<Vec3> = built.geometry.colors.iter().map(|color| color.truncate()).collect();
    assert!(found[0].distance(Vec3::new(encoded(0.5), 1.0, 0.0)) < 1e-6, "{}", found[0]);
    assert_eq!(found[1..], [Vec3::ONE, Vec3::ONE, Vec3::new(0.0, 1.0, 1.0)]);

    let folder = Folder::new();
    let path = folder.write("a.glb", glb(&json, &binary));
    let needs = Needs { colors: false, ..Needs::ALL };
    let scene = load(&[path], &LoadOptions { needs, ..LoadOptions::default() }, &|_| {}).unwrap();
    assert!(scene.meshes[0].colors.is_empty());
    let (built, _) = RenderScene::build(scene, &BuildOptions::default()).unwrap();
    assert!(built.geometry.colors.is_empty() && !built.materials[0].vertex_colors);

    json["accessors"][index]["count"] = 3.into();
    let error = read(&json, &binary).unwrap_err();
    assert!(error.contains("4 positions but 3 colours"), "{error}");
    json["accessors"][index]["count"] = 5.into();
    let error = read(&json, &binary).unwrap_err();
    assert!(error.contains("reach beyond its 48 bytes"), "{error}");
    json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = 2.into();
    let error = read(&json, &binary).unwrap_err();
    assert!(error.contains("accessor 2: it is not of type VEC4"), "{error}");
}

#[test]
fn textures_of_roughness_are_read_of_glass_where_a_pass_asks() {
    let folder = Folder::new();
    folder.png("r.png", 1, 1, [7, 128, 9, 255]);
    let (mut json, binary) = square();
    json["textures"] = json!([{"source": 0}]);
    json["images"] = json!([{"uri": "r.png"}]);
    let glass = |map: Value, factor: f64| {
        json!({
            "pbrMetallicRoughness": {"metallicRoughnessTexture": map, "roughnessFactor": factor, "metallicFactor": 0.0},
            "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0}}
        })
    };
    let turned = json!({"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2.0, 2.0]}}});
    let mut elsewhere = glass(turned, 0.5);
    elsewhere["normalTexture"] = json!({"index": 0});
    let opaque = json!({"pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}}});
    json["materials"] = json!([glass(json!({"index": 0}), 0.5), glass(json!({"index": 0}), 0.0), elsewhere, opaque]);
    let path = folder.write("a.glb", glb(&json, &binary));
    let read = |needs: Needs| {
        let scene =
            load(std::slice::from_ref(&path), &LoadOptions { needs, ..LoadOptions::default() }, &|_| {}).unwrap();
        let maps: Vec<bool> = scene.materials.iter().map(|material| material.roughness_texture.is_some()).collect();
        (scene, maps)
    };
    let (scene, maps) = read(Needs::ALL);
    assert_eq!(maps, [true, false, false, false], "of glass that is rough; with the coordinates of its other textures");
    assert_eq!(count(&scene.warnings, "roughness textures with coordinates of their own"), 1);
    assert_eq!(count(&scene.warnings, "texture maps that no program reads"), 1, "that of the opaque material");
    let texture = scene.materials[0].roughness_texture.unwrap() as usize;
    assert!(scene.textures[texture].is_data(), "numbers are not decoded from sRGB");
    let options = BuildOptions { color: ColorSpace::Linear, ..BuildOptions::default() };
    let (built, _) = RenderScene::build(scene, &options).unwrap();
    let texture = built.materials[0].roughness_texture.unwrap() as usize;
    assert!((built.textures[texture].sample(Vec2::splat(0.5), 0.0).y - 128.0 / 255.0).abs() < 1e-6);

    let (scene, maps) = read(Needs { glass_maps: false, ..Needs::ALL });
    assert_eq!(maps, [false; 4]);
    assert_eq!(count(&scene.warnings, "texture maps that no program reads"), 4);
}

#[test]
fn textures_of_transmission_are_read_of_glass_where_a_pass_asks() {
    let folder = Folder::new();
    folder.png("t.png", 1, 1, [128, 7, 9, 255]);
    let (mut json, binary) = square();
    json["textures"] = json!([{"source": 0}]);
    json["images"] = json!([{"uri": "t.png"}]);
    let glass = |map: Value, factor: f64| {
        let transmission = json!({"transmissionFactor": factor, "transmissionTexture": map});
        json!({"extensions": {"KHR_materials_transmission": transmission}})
    };
    let turned = json!({"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2.0, 2.0]}}});
    let mut elsewhere = glass(turned, 0.5);
    elsewhere["normalTexture"] = json!({"index": 0});
    let mut blended = glass(json!({"index": 0}), 1.0);
    blended["alphaMode"] = "BLEND".into();
    blended["pbrMetallicRoughness"] = json!({"baseColorFactor": [1.0, 1.0, 1.0, 0.5]});
    json["materials"] = json!([glass(json!({"index": 0}), 0.5), glass(json!({"index": 0}), 0.0), elsewhere, blended]);
    let path = folder.write("a.glb", glb(&json, &binary));
    let read = |needs: Needs| {
        let scene =
            load(std::slice::from_ref(&path), &LoadOptions { needs, ..LoadOptions::default() }, &|_| {}).unwrap();
        let maps: Vec<bool> = scene.materials.iter().map(|material| material.transmission_texture.is_some()).collect();
        (scene, maps)
    };
    let (scene, maps) = read(Needs::ALL);
    assert_eq!(maps, [true, false, false, false], "of glass; with the coordinates of its other textures; not blended");
    assert_eq!(count(&scene.warnings, "transmission textures with coordinates of their own"), 1);
    assert_eq!(
        count(&scene.warnings, "texture maps that no program reads"),
        2,
        "of what is opaque, and of what is blended"
    );
    assert_eq!((scene.materials[0].transmission, scene.materials[0].veil), (0.5, 0.5), "the factor");
    let texture = scene.materials[0].transmission_texture.unwrap() as usize;
    assert!(scene.textures[texture].is_data(), "numbers are not decoded from sRGB");
    let mut built = Arc::new(RenderScene::build(scene, &BuildOptions::default()).unwrap().0);
    let decided = curitiba_pipeline::glass::decide(&mut built, &path);
    let texture = decided.dielectrics[0].transmission_texture.expect("the glass has it") as usize;
    assert!((built.textures[texture].sample(Vec2::splat(0.5), 0.0).x - 128.0 / 255.0).abs() < 1e-6);

    let (scene, maps) = read(Needs { glass_maps: false, ..Needs::ALL });
    assert_eq!(maps, [false; 4]);
    assert_eq!(count(&scene.warnings, "texture maps that no program reads"), 4);
}

#[test]
fn texture_transforms_are_baked_into_the_coordinates() {
    let (mut json, binary) = square();
    json["textures"] = json!([{"source": 0}]);
    json["images"] = json!([{"uri": "none.png"}]);
    json["materials"][0] = json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions": {
        "KHR_texture_transform": {"offset": [0.5, 0.25], "rotation": std::f32::consts::FRAC_PI_2, "scale": [2.0, 3.0]}
    }}}});
    let scene = read(&json, &binary).unwrap();
    // The formula of the extension: u' = cos u + sin v, v' = -sin u + cos v after the scale, then the offset; finally v is
    // flipped.
    let expected = |u: f32, v: f32| Vec2::new(3.0 * v + 0.5, 1.0 - (-2.0 * u + 0.25));
    for (texcoord, (u, v)) in scene.meshes[0].texcoords.iter().zip([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]) {
        assert!(texcoord.distance(expected(u, v)) < 1e-5, "{texcoord} at {u} {v}");
    }
    assert_eq!(count(&scene.warnings, "missing textures"), 1);
}

#[test]
fn images_in_views_data_and_files_are_found_and_urls_are_warnings() {
    let folder = Folder::new();
    let png = std::fs::read(folder.png("maps/a b.png", 1, 1, [5, 6, 7, 255])).unwrap();
    let (mut json, mut binary) = square();
    json["bufferViews"]
        .as_array_mut()
        .unwrap()
        .push(json!({"buffer": 0, "byteOffset": binary.len(), "byteLength": png.len()}));
    binary.extend(&png);
    json["buffers"][0]["byteLength"] = binary.len().into();
    json["samplers"] = json!([{"wrapS": 33071}]);
    json["textures"] = json!([
        {"source": 0, "sampler": 0}, {"source": 1}, {"source": 2}, {"extensions": {"KHR_texture_basisu": {"source": 0}}}, {"source": 0}
    ]);
    json["images"] = json!([
        {"bufferView": 3, "mimeType": "image/png"}, {"uri": "maps/A%20b.png"}, {"uri": "https://example.org/a.png"}
    ]);
    let material = |texture: usize| json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": texture}}});
    json["materials"] = (0..5).map(material).collect();
    let path = folder.write("scene/../a.glb", glb(&json, &binary));
    let scene = load_one(&path).unwrap();
    let textures: Vec<_> = scene.materials.iter().map(|material| material.texture).collect();
    assert_eq!(textures, [Some(0), Some(1), None, None, Some(2)]);
    assert!(
        matches!(scene.textures[0].texels().0, TextureSource::Embedded { bytes, name } if **bytes == *png && name.ends_with("a.glb#image0"))
    );
    assert!(matches!(&scene.textures[1], TextureSource::File(path) if path.ends_with("maps/a b.png")));
    assert_eq!(count(&scene.warnings, "missing textures"), 2);
    assert_eq!(scene.textures[0].texels().1.wrap, [Wrap::Clamp, Wrap::Repeat]);
    assert_eq!(scene.textures[2].texels(), (scene.textures[0].texels().0, Sampling::default()));
    let bytes = |index: usize| match scene.textures[index].texels().0 {
        TextureSource::Embedded { bytes, .. } => Arc::clone(bytes),
        other => panic!("{other:?}"),
    };
    assert!(Arc::ptr_eq(&bytes(0), &bytes(2)), "the image is stored once");
    let (built, _) = RenderScene::build(scene, &BuildOptions::default()).unwrap();
    assert_eq!(built.textures[0].levels[0].texels, [[5, 6, 7, 255]]);

    // A conversion writes the embedded image to a file beside the scene.
    let scene = load_one(&path).unwrap();
    let layout = Layout::Cbo2014;
    let warnings = write_cbo(&scene, &folder.path("b.cbo"), layout).unwrap();
    assert_eq!(count(&warnings, "textures written beside the file"), 2, "clamped and repeated");
    let converted = load_one(&folder.path("b.cbo")).unwrap();
    assert_eq!(std::fs::read(converted.textures[0].name()).unwrap(), png);

    let nothing = LoadOptions { needs: Needs::NOTHING, ..LoadOptions::default() };
    let scene = load(&[path], &nothing, &|_| {}).unwrap();
    assert!(scene.textures.is_empty() && scene.meshes[0].texcoords.is_empty());
}

#[test]
fn an_image_that_blends_many_materials_is_read_once_where_textures_are_not() {
    let folder = Folder::new();
    let mut png = std::fs::read(folder.png("a.png", 4, 4, [5, 6, 7, 100])).unwrap();
    // Decoders ignore what follows the image.
    png.resize(1 << 20, 0);
    let (mut json, mut binary) = square();
    let view = json!({"buffer": 0, "byteOffset": binary.len(), "byteLength": png.len()});
    json["bufferViews"].as_array_mut().unwrap().push(view);
    binary.extend(&png);
    json["buffers"][0]["byteLength"] = binary.len().into();
    json["textures"] = json!([{"source": 0}]);
    json["images"] = json!([{"bufferView": 3, "mimeType": "image/png"}]);
    // The opacities of three factors are distinct keys; the memory of each is given back.
    let material = |index: usize| {
        let color = [1.0, 1.0, 1.0, [1.0, 0.9, 0.8][index % 3]];
        json!({"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "baseColorFactor": color}})
    };
    json["materials"] = (0..60).map(material).collect();
    let path = folder.write("a.glb", glb(&json, &binary));
    let options = LoadOptions { needs: Needs::NOTHING, max_bytes: 4 << 20 };
    let scene = load(&[path], &options, &|_| {}).unwrap();
    for (index, material) in scene.materials.iter().enumerate() {
        let clear = 1.0 - [1.0, 0.9, 0.8][index % 3] * 100.0 / 255.0;
        assert!((material.transmission - clear).abs() < 2e-3, "{index}: {}", material.transmission);
    }
    assert!(scene.textures.is_empty());
}

#[test]
fn extensions_that_cannot_be_done_without_are_errors_that_name_them() {
    for name in ["KHR_texture_basisu", "EXT_mesh_gpu_instancing"] {
        let (mut json, binary) = square();
        json["extensionsRequired"] = json!([name]);
        let error = read(&json, &binary).unwrap_err();
        assert!(error.contains(name) && error.contains("valid:"), "{error}");
    }
    let (mut json, binary) = square();
    json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    assert!(read(&json, &binary).is_ok());
}

#[test]
fn references_and_ranges_that_lead_nowhere_are_errors_that_say_which() {
    type Damage = fn(&mut Value);
    let damages: [(Damage, &str); 20] = [
        (|json| json["scene"] = 5.into(), "scene 5 does not exist"),
        (|json| json["scenes"][0]["nodes"] = json!([7]), "node 7 does not exist"),
        (|json| json["nodes"][0]["children"] = json!([0]), "its own ancestor"),
        (|json| json["scenes"][0]["nodes"] = json!([0, 0]), "two parents"),
        (|json| json["nodes"][0]["mesh"] = 3.into(), "mesh 3 does not exist"),
        (|json| json["meshes"][0]["primitives"][0]["material"] = 9.into(), "material 9 does not exist"),
        (|json| json["meshes"][0]["primitives"][0]["indices"] = 9.into(), "accessor 9: it does not exist"),
        (|json| json["meshes"][0]["primitives"][0]["indices"] = 0.into(), "accessor 0: indices are unsigned"),
        (
            |json| json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = 1.into(),
            "accessor 1: it is not of type VEC3",
        ),
        (|json| json["accessors"][0]["count"] = 5.into(), "accessor 0: buffer view 0: 5 elements"),
        (|json| json["accessors"][0]["count"] = u64::MAX.into(), "reach beyond"),
        (|json| json["accessors"][0]["byteOffset"] = u64::MAX.into(), "reach beyond"),
        (|json| json["accessors"][1]["count"] = 3.into(), "4 positions but 3 texture coordinates"),
        (|json| json["accessors"][0]["componentType"] = 77.into(), "component type"),
        (|json| json["accessors"][0]["bufferView"] = 9.into(), "buffer view 9 does not exist"),
        (|json| json["bufferViews"][0]["buffer"] = 9.into(), "buffer 9 does not exist"),
        (|json| json["bufferViews"][0]["byteLength"] = 1000.into(), "reaches beyond the 92 bytes"),
        (|json| json["bufferViews"][0]["byteStride"] = 4.into(), "a stride of 4 for elements of 12"),
        (|json| json["buffers"][0]["byteLength"] = 1000.into(), "says it has 1000 bytes but has 92"),
        (|json| json["buffers"][0]["uri"] = "http://a/b.bin".into(), "is not a relative path"),
    ];
    for (damage, expected) in damages {
        let (mut json, binary) = square();
        damage(&mut json);
        let error = read(&json, &binary).unwrap_err();
        assert!(error.contains(expected), "{error}\nexpected: {expected}");
    }
    let (json, binary) = square();
    assert_eq!(triangles(&read(&json, &binary).unwrap()), 2, "undamaged, it loads");
}

#[test]
fn containers_that_are_damaged_are_errors() {
    let folder = Folder::new();
    for (bytes, expected) in [
        (b"glTF\x01\0\0\0".to_vec(), "GLB version 1"),
        (b"glTF\x02\0\0\0\0\0\0\0".to_vec(), "no JSON chunk"),
        (b"glTF\x02\0\0\0\0\0\0\0\xFF\xFF\xFF\xFFJSON".to_vec(), "4294967295"),
        (glb(&json!({"no": "asset"}), &[]), "not a glTF asset"),
        (
            json!({"asset": {"version": "1.0"}, "meshes": {}, "nodes": {}}).to_string().into(),
            "this is glTF version 1.0",
        ),
        // Exporters of version 1.0 left `asset` out.
        (json!({"meshes": {"a": {}}, "nodes": {"b": {}}}).to_string().into(), "this is glTF version 1.0"),
        (vec![0x1F, 0x8B, 8, 0, 0, 0, 0, 0], "compressed by gzip"),
    ] {
        let error = load_one(&folder.write("a.glb", bytes)).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    assert!(load_one(&folder.write("a.gltf", "[".repeat(100_000))).is_err());
}

#[test]
fn a_byte_order_mark_is_ignored() {
    let (mut json, binary) = square();
    json["buffers"] = json!([{"byteLength": binary.len(), "uri": "a.bin"}]);
    let folder = Folder::new();
    folder.write("a.bin", &binary);
    let marked = [b"\xEF\xBB\xBF", json.to_string().as_bytes()].concat();
    assert_eq!(triangles(&load_one(&folder.write("a.gltf", marked)).unwrap()), 2);
}

#[test]
fn an_accessor_without_bytes_cannot_claim_more_memory_than_allowed() {
    let (mut json, binary) = square();
    json["accessors"][0] = json!({"componentType": 5126, "count": 4_000_000_000_u32, "type": "VEC3"});
    let error = read(&json, &binary).unwrap_err();
    assert!(error.contains("--max-memory"), "{error}");
}

#[test]
fn changed_and_cut_files_never_panic_and_never_break_a_reference() {
    let folder = Folder::new();
    let (json, binary) = square();
    let (mut loaded, mut refused) = (0, 0);
    for bytes in mutations(&glb(&json, &binary), 2500) {
        match load_capped(&folder.write("m.glb", bytes)) {
            Ok(scene) => {
                assert_references_are_valid(&scene);
                RenderScene::build(scene, &BuildOptions::default()).unwrap();
                loaded += 1;
            }
            Err(_) => refused += 1,
        }
    }
    assert!(loaded > 100 && refused > 100, "the changes reach both: {loaded} loaded, {refused} refused");
}

#[test]
fn objects_count_against_the_memory_cap() {
    let (mut json, binary) = square();
    // Four million objects from a few kilobytes.
    json["meshes"][0]["primitives"] = vec![json!({"attributes": {"POSITION": 0}, "mode": 4}); 2000].into();
    json["nodes"] = vec![json!({"mesh": 0}); 2000].into();
    json.as_object_mut().expect("an object").remove("scenes");
    json.as_object_mut().expect("an object").remove("scene");
    let folder = Folder::new();
    let error = load_capped(&folder.write("a.glb", glb(&json, &binary))).unwrap_err();
    assert!(error.what.starts_with("the objects need"), "{error}");
    // An object takes its transform twice, once in f64: 40,000 take more than 8 MiB.
    json["nodes"] = vec![json!({"mesh": 0}); 20].into();
    let options = LoadOptions { max_bytes: 8 << 20, ..LoadOptions::default() };
    let error = load(&[folder.write("b.glb", glb(&json, &binary))], &options, &|_| {}).unwrap_err();
    assert!(error.what.starts_with("the objects need"), "{error}");
}

#[test]
fn numbers_beyond_f32_are_refused_with_their_place() {
    let (mut json, binary) = square();
    json["materials"][0] = json!({"alphaMode": "MASK", "alphaCutoff": 1e39,
        "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1e39]}});
    let error = read(&json, &binary).unwrap_err();
    assert!(error.contains("number out of range at line 1 column"), "{error}");
    // A cutoff near the largest finite number.
    json["materials"][0]["alphaCutoff"] = 3.4e38.into();
    json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([1, 1, 1, 1e-3]);
    assert_eq!(read(&json, &binary).unwrap().materials[0].alpha_cutoff, Some(f32::INFINITY));
}

/// A wavy grid of `side * side` vertices, compressed with Draco's own encoder: positions (id 0), normals (1), texture coordinates
/// (2).
fn draco_grid(side: usize, speed: i32) -> (Vec<u8>, Vec<Vec3>) {
    use draco_core::{
        DataType, EncoderBuffer, EncoderOptions, FaceIndex, GeometryAttributeType, Mesh, MeshEncoder, PointAttribute,
    };
    let place = |index: usize| {
        let (x, y) = ((index % side) as f32, (index / side) as f32);
        Vec3::new(x, y, (x * 0.7).sin() * (y * 0.5).cos())
    };
    let positions: Vec<Vec3> = (0..side * side).map(place).collect();
    let mut mesh = Mesh::new();
    let mut add = |kind, components: u8, values: &[f32]| {
        let mut attribute = PointAttribute::new();
        attribute.init(kind, components, DataType::Float32, false, values.len() / usize::from(components));
        attribute.buffer_mut().write(0, &floats(values));
        mesh.add_attribute(attribute);
    };
    let flat = |vectors: &[Vec3]| vectors.iter().flat_map(|vector| vector.to_array()).collect::<Vec<f32>>();
    add(GeometryAttributeType::Position, 3, &flat(&positions));
    add(GeometryAttributeType::Normal, 3, &flat(&vec![Vec3::Z; positions.len()]));
    let texcoords: Vec<f32> = positions.iter().flat_map(|p| [p.x / side as f32, p.y / side as f32]).collect();
    add(GeometryAttributeType::TexCoord, 2, &texcoords);
    let quads = (side - 1) * (side - 1);
    mesh.set_num_faces(2 * quads);
    for quad in 0..quads {
        let corner = (quad / (side - 1) * side + quad % (side - 1)) as u32;
        let (right, up) = (corner + 1, corner + side as u32);
        mesh.set_face(FaceIndex(2 * quad as u32), [corner.into(), right.into(), up.into()]);
        mesh.set_face(FaceIndex(2 * quad as u32 + 1), [up.into(), right.into(), (up + 1).into()]);
    }
    let mut options = EncoderOptions::new();
    options.set_global_int("encoding_speed", speed);
    options.set_global_int("decoding_speed", speed);
    for (attribute, bits) in [(0, 14), (1, 10), (2, 12)] {
        options.set_attribute_int(attribute, "quantization_bits", bits);
    }
    let mut encoder = MeshEncoder::new();
    encoder.set_mesh(mesh);
    let mut buffer = EncoderBuffer::new();
    encoder.encode(&options, &mut buffer).expect("it can be encoded");
    (buffer.data().to_vec(), positions)
}

fn draco_asset(side: usize, packed: &[u8]) -> Value {
    let (vertices, corners) = (side * side, 6 * (side - 1) * (side - 1));
    json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_draco_mesh_compression"],
        "extensionsRequired": ["KHR_draco_mesh_compression"],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{
            "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "indices": 3,
            "extensions": {"KHR_draco_mesh_compression": {
                "bufferView": 0, "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}
            }}
        }]}],
        "accessors": [
            {"componentType": 5126, "count": vertices, "type": "VEC3"},
            {"componentType": 5126, "count": vertices, "type": "VEC3"},
            {"componentType": 5126, "count": vertices, "type": "VEC2"},
            {"componentType": 5123, "count": corners, "type": "SCALAR"}
        ],
        "bufferViews": [{"buffer": 0, "byteLength": packed.len()}],
        "buffers": [{"byteLength": packed.len()}]
    })
}

#[test]
fn draco_meshes_have_their_triangles_and_attributes_within_the_quantisation() {
    const SIDE: usize = 20;
    // The speeds select the different encodings of connectivity: valence and standard edgebreaker, and sequential.
    for speed in [0, 5, 10] {
        let (packed, positions) = draco_grid(SIDE, speed);
        let scene = read(&draco_asset(SIDE, &packed), &packed).unwrap();
        let mesh = &scene.meshes[0];
        assert_eq!((mesh.positions.len(), mesh.groups[0].triangles.len()), (SIDE * SIDE, 2 * 19 * 19), "{speed}");
        // Positions are quantised to 14 bits over 19 units; the decoder may reorder vertices.
        let step = 19.0 / 16383.0;
        for (at, (normal, texcoord)) in mesh.positions.iter().zip(mesh.normals.iter().zip(&mesh.texcoords)) {
            let nearest = positions.iter().map(|p| p.distance(*at)).fold(f32::INFINITY, f32::min);
            assert!(nearest <= 0.87 * step, "speed {speed}: {at} is {nearest} off");
            assert!(normal.distance(Vec3::Z) < 0.01, "{normal}");
            let expected = Vec2::new(at.x / SIDE as f32, 1.0 - at.y / SIDE as f32);
            assert!(texcoord.distance(expected) < 2e-3, "{texcoord} at {at}");
        }
        let area = |positions: &[Vec3], triangle: [u32; 3]| {
            let [a, b, c] = triangle.map(|corner| positions[corner as usize]);
            let normal = (b - a).cross(c - a);
            assert!(normal.z > 0.0, "the triangles keep their orientation");
            normal.z / 2.0
        };
        let sum: f32 = mesh.groups[0].triangles.iter().map(|triangle| area(&mesh.positions, *triangle)).sum();
        assert!((sum - 19.0 * 19.0).abs() < 0.05, "the grid is covered once: {sum}");
    }
}

#[test]
fn draco_streams_that_are_damaged_or_too_large_are_errors_of_the_file() {
    let (packed, _) = draco_grid(24, 5);
    let json = draco_asset(24, &packed);
    let asset = glb(&json, &packed);
    let folder = Folder::new();
    let small = LoadOptions { max_bytes: 40_000, ..LoadOptions::default() };
    let path = folder.write("small.glb", &asset);
    let error = load(&[path], &small, &|_| {}).unwrap_err().to_string();
    assert!(error.contains("small.glb") && error.contains("--max-memory"), "{error}");

    let mut missing = json.clone();
    missing["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["attributes"]["NORMAL"] =
        9.into();
    let error = read(&missing, &packed).unwrap_err();
    assert!(error.contains("attribute NORMAL is not in the stream"), "{error}");
    missing["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["attributes"]["NORMAL"] =
        2.into();
    let error = read(&missing, &packed).unwrap_err();
    assert!(error.contains("has 2 components; valid: 3"), "{error}");

    let start = asset.len() - packed.len();
    let (mut refused, mut loaded) = (0, 0);
    for damaged in mutations(&packed, 400) {
        let mut bytes = asset[..start].to_vec();
        bytes.extend(&damaged);
        bytes.resize(asset.len(), 0);
        match load_capped(&folder.write("damaged.glb", bytes)) {
            Ok(scene) => {
                assert_references_are_valid(&scene);
                loaded += 1;
            }
            Err(error) => {
                assert!(error.to_string().contains("damaged.glb"), "{error}");
                refused += 1;
            }
        }
    }
    assert!(refused > 100 && loaded > 10, "{refused} refused, {loaded} loaded");
}

/// The square with compressed buffer views in a separate buffer; the first buffer is a fallback without bytes.
fn meshopt_square() -> (Value, Vec<u8>) {
    use meshoptimizer_rs::Workspace;
    use meshoptimizer_rs::codec::{IndexEncoding, VertexEncoding, encode_index_buffer, encode_vertex_buffer};
    let (mut json, plain) = square();
    let mut work = Workspace::default();
    let vertices = VertexEncoding::new(0, 2).expect("the extension has version 0");
    let positions = encode_vertex_buffer(&plain[..48], 4, 12, vertices, &mut work).expect("encoded");
    let texcoords = encode_vertex_buffer(&plain[48..80], 4, 8, vertices, &mut work).expect("encoded");
    let triangles = [0, 1, 2, 2, 1, 3];
    let indices = encode_index_buffer(&triangles, IndexEncoding::DEFAULT, &mut work).expect("encoded");
    let mut packed = Vec::new();
    let views = [(positions, "ATTRIBUTES", 4, 12), (texcoords, "ATTRIBUTES", 4, 8), (indices, "TRIANGLES", 6, 2)];
    for (index, (bytes, mode, count, stride)) in views.into_iter().enumerate() {
        json["bufferViews"][index]["extensions"] = json!({"EXT_meshopt_compression": {
            "buffer": 1, "byteOffset": packed.len(), "byteLength": bytes.len(),
            "byteStride": stride, "count": count, "mode": mode
        }});
        packed.extend(bytes);
    }
    json["extensionsRequired"] = json!(["EXT_meshopt_compression"]);
    let fallback = json!({"byteLength": 92, "extensions": {"EXT_meshopt_compression": {"fallback": true}}});
    json["buffers"] = json!([fallback, {"byteLength": packed.len(), "uri": "packed.bin"}]);
    (json, packed)
}

#[test]
fn buffer_views_compressed_by_meshopt_hold_what_the_plain_ones_held() {
    let (plain, binary) = square();
    let expected = read(&plain, &binary).unwrap();
    let (json, packed) = meshopt_square();
    let folder = Folder::new();
    folder.write("packed.bin", &packed);
    let scene = load_one(&folder.write("a.gltf", json.to_string())).unwrap();
    assert_eq!(scene.meshes[0].positions, expected.meshes[0].positions);
    assert_eq!(scene.meshes[0].texcoords, expected.meshes[0].texcoords);
    let sorted = |scene: &Scene| {
        // The codec may rotate the corners of a triangle.
        let first = |[a, b, c]: [u32; 3]| {
            if a < b && a < c {
                [a, b, c]
            } else if b < c {
                [b, c, a]
            } else {
                [c, a, b]
            }
        };
        scene.meshes[0].groups[0].triangles.iter().map(|triangle| first(*triangle)).collect::<Vec<_>>()
    };
    assert_eq!(sorted(&scene), sorted(&expected));

    // A fallback buffer need not be marked as one if all of its views are compressed.
    let mut silent = json.clone();
    silent["buffers"][0] = json!({"byteLength": 92});
    let scene = load_one(&folder.write("silent.gltf", silent.to_string())).unwrap();
    assert_eq!(scene.meshes[0].positions, expected.meshes[0].positions);
    silent["bufferViews"][1].as_object_mut().expect("a view").remove("extensions");
    let error = load_one(&folder.write("silent.gltf", silent.to_string())).unwrap_err().to_string();
    assert!(error.contains("buffer 0 has no data\n       valid: a `uri`"), "{error}");

    for (field, value, words) in [
        ("mode", json!("TRIANGLE"), "valid: ATTRIBUTES"),
        ("filter", json!("ZIP"), "valid: NONE, OCTAHEDRAL"),
        ("byteStride", json!(10), "4 elements of 10 bytes"),
        ("byteLength", json!(1_u32 << 30), "reaches beyond"),
        ("count", json!(1_u64 << 40), "need"),
        ("buffer", json!(7), "buffer 7 does not exist"),
        ("count", json!(4.5), "no whole number"),
    ] {
        let mut broken = json.clone();
        broken["bufferViews"][0]["extensions"]["EXT_meshopt_compression"][field] = value;
        let error = load_one(&folder.write("broken.gltf", broken.to_string())).unwrap_err().to_string();
        assert!(error.contains("broken.gltf") && error.contains(words), "{field}: {error}");
    }
    for damaged in mutations(&packed, 300) {
        folder.write("packed.bin", damaged);
        if let Ok(scene) = load_capped(&folder.path("a.gltf")) {
            assert_references_are_valid(&scene);
        }
    }
}

/// Checks the compressed seeds of the fuzz targets. With `CURITIBA_WRITE_SEEDS=1` they are written again, if an encoder has
/// changed.
#[test]
fn the_seeds_of_the_fuzzer_are_what_the_encoders_make() {
    let (packed, _) = draco_grid(6, 5);
    let draco = glb(&draco_asset(6, &packed), &packed);
    // In a GLB the embedded bytes belong to the first buffer.
    let (mut json, packed) = meshopt_square();
    let buffers = json["buffers"].as_array_mut().expect("two buffers");
    buffers.swap(0, 1);
    buffers[0] = json!({"byteLength": packed.len()});
    for view in json["bufferViews"].as_array_mut().expect("a list") {
        view["buffer"] = 1.into();
        view["extensions"]["EXT_meshopt_compression"]["buffer"] = 0.into();
    }
    let mut padded = packed;
    padded.resize(padded.len().next_multiple_of(4), 0);
    let meshopt = glb(&json, &padded);
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz_targets");
    for (name, bytes) in [("draco.glb", draco), ("meshopt.glb", meshopt)] {
        let path = folder.join(name);
        if std::env::var_os("CURITIBA_WRITE_SEEDS").is_some() {
            std::fs::write(&path, &bytes).expect("written");
        }
        assert!(load_one(&path).is_ok_and(|scene| triangles(&scene) > 0), "{name}");
        assert_eq!(std::fs::read(&path).expect("a seed"), bytes, "{name}");
    }
}

#[test]
fn images_of_other_formats_are_taken_from_their_extensions() {
    let (mut json, binary) = square();
    let folder = Folder::new();
    let texel = image::RgbaImage::from_pixel(3, 2, image::Rgba([200, 100, 50, 255]));
    let path = folder.write("t.webp", []);
    texel.save_with_format(&path, image::ImageFormat::WebP).expect("a WebP");
    folder.write("a.bin", &binary);
    json["buffers"][0]["uri"] = "a.bin".into();
    json["images"] = json!([{"uri": "t.webp", "mimeType": "image/webp"}]);
    json["textures"] = json!([{"extensions": {"EXT_texture_webp": {"source": 0}}}]);
    json["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    json["extensionsRequired"] = json!(["EXT_texture_webp"]);
    let scene = load_one(&folder.write("a.gltf", json.to_string())).unwrap();
    let (built, warnings) = RenderScene::build(scene, &BuildOptions::default()).unwrap();
    assert_eq!(warnings.groups().len(), 0, "{:?}", warnings.groups());
    // Our own WebP encoding is lossless.
    assert_eq!(built.textures[0].levels[0].texels, [[200, 100, 50, 255]; 6]);

    json["textures"] = json!([{"extensions": {"KHR_texture_basisu": {"source": 0}}}]);
    json["extensionsRequired"] = json!([]);
    let scene = load_one(&folder.write("b.gltf", json.to_string())).unwrap();
    assert_eq!(count(&scene.warnings, "missing textures"), 1);
    json["extensionsRequired"] = json!(["KHR_texture_basisu"]);
    let error = load_one(&folder.write("b.gltf", json.to_string())).unwrap_err().to_string();
    assert!(error.contains("KHR_texture_basisu") && error.contains("PNG, JPEG or WebP"), "{error}");
}

/// The square in a skin of two joints: A translates by 5, and its child B rotates by 90 degrees about (1, 0). The mesh's node translates
/// by 100, which a skin ignores. `weights` are the weights of A and B for each vertex.
fn skinned(weights: [[f32; 2]; 4]) -> (Value, Vec<u8>) {
    let (mut json, mut binary) = square();
    let half = std::f32::consts::FRAC_1_SQRT_2;
    json["nodes"] = json!([
        {"mesh": 0, "name": "square", "skin": 0, "translation": [100.0, 0.0, 0.0]},
        {"translation": [0.0, 0.0, 5.0], "children": [2]},
        {"translation": [1.0, 0.0, 0.0], "rotation": [0.0, 0.0, half, half]}
    ]);
    json["scenes"] = json!([{"nodes": [0, 1]}]);
    let joints: Vec<u8> = (0..4).flat_map(|_| [0, 1, 0, 0]).collect();
    let joints =
        add_accessor(&mut json, &mut binary, &joints, json!({"componentType": 5121, "count": 4, "type": "VEC4"}));
    let weights: Vec<f32> = weights.iter().flat_map(|[a, b]| [*a, *b, 0.0, 0.0]).collect();
    let weights = add_accessor(
        &mut json,
        &mut binary,
        &floats(&weights),
        json!({"componentType": 5126, "count": 4, "type": "VEC4"}),
    );
    let inverse = [Mat4::IDENTITY, Mat4::from_translation(Vec3::NEG_X)].map(|m| m.to_cols_array()).concat();
    let inverse = add_accessor(
        &mut json,
        &mut binary,
        &floats(&inverse),
        json!({"componentType": 5126, "count": 2, "type": "MAT4"}),
    );
    let normals = floats(&[1.0, 0.0, 0.0].repeat(4));
    let normals =
        add_accessor(&mut json, &mut binary, &normals, json!({"componentType": 5126, "count": 4, "type": "VEC3"}));
    json["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": inverse}]);
    let attributes = &mut json["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = joints.into();
    attributes["WEIGHTS_0"] = weights.into();
    attributes["NORMAL"] = normals.into();
    (json, binary)
}

/// Weights of A only, of B only, of both equally, and of B with 0.5: the sum is normalised to 1.
const WEIGHTS: [[f32; 2]; 4] = [[1.0, 0.0], [0.0, 1.0], [0.25, 0.25], [0.0, 0.5]];

#[test]
fn skinned_meshes_are_where_their_joints_are() {
    let (json, binary) = skinned(WEIGHTS);
    let scene = read(&json, &binary).unwrap();
    // B rotates about (1, 0): (0, 1) goes to (0, -1), whose mean with A's (0, 1) is (0, 0); (1, 1) goes to (0, 0).
    let expected = [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 0.0, 5.0], [0.0, 0.0, 5.0]].map(Vec3::from);
    let mesh = &scene.meshes[0];
    for (found, expected) in mesh.positions.iter().zip(expected) {
        assert!(found.distance(expected) < 1e-6, "{found}, not {expected}");
    }
    let turned = [Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.0).normalize(), Vec3::Y];
    for (found, expected) in mesh.normals.iter().zip(turned) {
        assert!(found.normalize().distance(expected) < 1e-6, "{found}, not {expected}");
    }
    assert_eq!(scene.objects[0].transform, Mat4::IDENTITY, "the node of a skinned mesh does not move it");
    assert!(scene.warnings.groups().is_empty(), "{:?}", scene.warnings.groups());
    assert_eq!(mesh.groups[0].triangles, [[0, 1, 2], [2, 1, 3]]);

    // A mirroring joint reverses the winding of the triangles.
    let mut mirrored = json.clone();
    mirrored["nodes"][1]["scale"] = json!([1.0, 1.0, -1.0]);
    let scene = read(&mirrored, &binary).unwrap();
    assert_eq!(scene.meshes[0].groups[0].triangles, [[0, 2, 1], [2, 3, 1]]);
    // The same mesh on a node without a skin is placed by that node.
    let mut both = json.clone();
    both["nodes"].as_array_mut().unwrap().push(json!({"mesh": 0, "translation": [7.0, 0.0, 0.0]}));
    both["scenes"][0]["nodes"] = json!([0, 1, 3]);
    let scene = read(&both, &binary).unwrap();
    assert_eq!((scene.meshes.len(), scene.objects[1].transform), (2, Mat4::from_translation(Vec3::X * 7.0)));
    assert_eq!(scene.meshes[1].positions[3], Vec3::new(1.0, 1.0, 0.0));
}

#[test]
fn joints_far_from_the_origin_move_vertices_without_loss() {
    let (mut json, mut binary) = skinned([[0.0, 1.0]; 4]);
    // In 32-bit floats both positions would be rounded to half a unit.
    let far = Vec3::new(6_000_001.0, -3_000_002.0, 9_000_003.0);
    json["nodes"][1] = json!({"children": [2]});
    json["nodes"][2]["translation"] = json!(far.to_array());
    let inverse = Mat4 { w_axis: (-far).extend(1.0), ..Mat4::IDENTITY };
    let matrices = [Mat4::IDENTITY, inverse].map(|m| m.to_cols_array()).concat();
    let index = add_accessor(
        &mut json,
        &mut binary,
        &floats(&matrices),
        json!({"componentType": 5126, "count": 2, "type": "MAT4"}),
    );
    json["skins"][0]["inverseBindMatrices"] = index.into();
    let scene = read(&json, &binary).unwrap();
    let half = f64::from(std::f32::consts::FRAC_1_SQRT_2);
    let turn = glam::DMat3::from_quat(glam::DQuat::from_xyzw(0.0, 0.0, half, half).normalize());
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]].map(DVec3::from);
    for (found, corner) in scene.meshes[0].positions.iter().zip(corners) {
        let expected = turn * (corner - far.as_dvec3()) + far.as_dvec3();
        let error = (found.as_dvec3() - expected).length();
        assert!(error < 0.75, "{found}, not {expected}: off by {error}, where 32 bits alone store it to half a unit");
    }
    // A joint in its bind pose moves nothing, however far away it is.
    json["nodes"][2].as_object_mut().unwrap().remove("rotation");
    let scene = read(&json, &binary).unwrap();
    assert_eq!(scene.meshes[0].positions, corners.map(|corner| corner.as_vec3()));
}

#[test]
fn skins_that_lead_nowhere_are_errors_that_say_where() {
    type Damage = fn(&mut Value);
    let damages: [(Damage, &str); 7] = [
        (|json| json["nodes"][0]["skin"] = 4.into(), "skin 4 does not exist"),
        (|json| json["skins"][0]["joints"] = json!([]), "skin 0 has no joint"),
        (|json| json["skins"][0]["joints"] = json!([1, 9]), "skin 0 has node 9 as a joint, which does not exist"),
        (|json| json["skins"][0]["joints"] = json!([1]), "joint 1 is none of the skin's 1; valid: 0 to 0"),
        (|json| json["skins"][0]["joints"] = json!([1, 2, 1]), "skin 0 has 3 joints and 2 inverse bind matrices"),
        (
            |json| {
                let nodes = json["nodes"].as_array_mut().unwrap();
                nodes.push(json!({"children": [3]}));
                json["skins"][0]["joints"] = json!([1, 3]);
            },
            "skin 0 has node 3 as a joint, which is its own ancestor",
        ),
        (|json| json["skins"][0]["inverseBindMatrices"] = 0.into(), "accessor 0: it is not of type MAT4"),
    ];
    for (damage, words) in damages {
        let (mut json, binary) = skinned(WEIGHTS);
        damage(&mut json);
        let error = read(&json, &binary).unwrap_err();
        assert!(error.contains(words) && error.contains("a.glb"), "{error}, without {words}");
    }
    for bad in [-0.5, f32::NAN, f32::INFINITY] {
        let (json, binary) = skinned([[1.0, 0.0], [0.0, 1.0], [1.0, bad], [1.0, 0.0]]);
        let error = read(&json, &binary).unwrap_err();
        assert!(error.contains("`mesh 0`, vertex 2: the weight") && error.contains("no number from 0 on"), "{error}");
    }
    let (mut json, binary) = skinned(WEIGHTS);
    let weights = json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"].as_u64().unwrap() as usize;
    json["accessors"][weights]["count"] = 3.into();
    let error = read(&json, &binary).unwrap_err();
    assert!(error.contains("4 positions but 3 of WEIGHTS_0"), "{error}");

    let (json, binary) = skinned([[0.0; 2]; 4]);
    let scene = read(&json, &binary).unwrap();
    assert_eq!(count(&scene.warnings, "meshes with vertices whose weights are all 0"), 1);
    assert_eq!(scene.meshes[0].positions[3], Vec3::new(1.0, 1.0, 5.0), "the first joint's");
    let (mut json, binary) = skinned(WEIGHTS);
    json["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("JOINTS_0");
    let scene = read(&json, &binary).unwrap();
    assert_eq!(count(&scene.warnings, "primitives without joints in skinned meshes"), 1);
    let place = scene.origin + scene.objects[0].transform.w_axis.truncate().as_dvec3();
    assert_eq!(place, DVec3::X * 100.0, "its node's");
}

#[test]
fn morph_targets_move_vertices_by_the_default_weights() {
    let (mut json, mut binary) = square();
    let accessor = |count: usize| json!({"componentType": 5126, "count": count, "type": "VEC3"});
    let up = floats(&[0.0, 0.0, 1.0].repeat(4));
    let up = add_accessor(&mut json, &mut binary, &up, accessor(4));
    let side = floats(&[0.0, 2.0, 0.0].repeat(4));
    let side = add_accessor(&mut json, &mut binary, &side, accessor(4));
    let normals = floats(&[0.0, 0.0, 1.0].repeat(4));
    let normals = add_accessor(&mut json, &mut binary, &normals, accessor(4));
    let bent = floats(&[1.0, 0.0, 0.0].repeat(4));
    let bent = add_accessor(&mut json, &mut binary, &bent, accessor(4));
    let primitive = &mut json["meshes"][0]["primitives"][0];
    primitive["attributes"]["NORMAL"] = normals.into();
    primitive["targets"] = json!([{"POSITION": up, "NORMAL": bent}, {"POSITION": side}]);
    let moved = |json: &Value| {
        let scene = read(json, &binary).unwrap();
        (scene.meshes[0].positions[3], scene.meshes[0].normals[3])
    };
    let corner = Vec3::new(1.0, 1.0, 0.0);
    assert_eq!(moved(&json), (corner, Vec3::Z), "without weights all are 0");
    json["meshes"][0]["weights"] = json!([0.5, 0.25]);
    assert_eq!(moved(&json), (corner + Vec3::new(0.0, 0.5, 0.5), Vec3::new(0.5, 0.0, 1.0)));
    json["nodes"][0]["weights"] = json!([0.0, -1.0]);
    assert_eq!(moved(&json), (corner - Vec3::Y * 2.0, Vec3::Z), "those of the node count");
    // Targets with a weight of 0 are not read.
    json["meshes"][0]["primitives"][0]["targets"][0]["POSITION"] = 99.into();
    assert_eq!(moved(&json).0, corner - Vec3::Y * 2.0);
    json["nodes"][0]["weights"] = json!([1.0, -1.0]);
    let error = read(&json, &binary).unwrap_err();
    assert!(error.contains("accessor 99"), "{error}");

    json["meshes"][0]["primitives"][0]["targets"][0]["POSITION"] = up.into();
    json["accessors"][up]["count"] = 3.into();
    let error = read(&json, &binary).unwrap_err();
    assert!(error.contains("morph target 0 of `mesh 0` has 3 displacements for 4 positions"), "{error}");
    json["nodes"][0]["weights"] = json!([0.0, 1.0, 3.0]);
    let scene = read(&json, &binary).unwrap();
    assert_eq!(count(&scene.warnings, "primitives with another number of morph targets than weights"), 1);
    // Sparse targets without a view displace only some vertices.
    let (mut json, mut binary) = square();
    let at = binary.len();
    binary.extend([2, 0, 0, 0]);
    binary.extend(floats(&[0.0, 0.0, 4.0]));
    json["bufferViews"].as_array_mut().unwrap().extend([
        json!({"buffer": 0, "byteOffset": at, "byteLength": 4}),
        json!({"buffer": 0, "byteOffset": at + 4, "byteLength": 12}),
    ]);
    json["accessors"].as_array_mut().unwrap().push(
        json!({"componentType": 5126, "count": 4, "type": "VEC3", "sparse": {
            "count": 1, "indices": {"bufferView": 3, "componentType": 5121}, "values": {"bufferView": 4}
        }}),
    );
    json["buffers"][0]["byteLength"] = binary.len().into();
    json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": 3}]);
    json["meshes"][0]["weights"] = json!([0.5]);
    let scene = read(&json, &binary).unwrap();
    let expected = [Vec3::ZERO, Vec3::X, Vec3::new(0.0, 1.0, 2.0), Vec3::new(1.0, 1.0, 0.0)];
    assert_eq!(scene.meshes[0].positions, expected);
}

#[test]
fn translations_have_all_digits_of_the_file() {
    let (mut json, binary) = square();
    let place = DVec3::new(554_321.123_456, 12.75, 5_812_345.678_912);
    json["scenes"] = json!([{"nodes": [0]}]);
    json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}]);
    json["nodes"] = json!([
        {"translation": [554_000.003, 0.0, 5_812_000.0], "children": [1, 2]},
        {"mesh": 0, "translation": [321.120_456, 12.75, 345.678_912]},
        {"camera": 0, "translation": [321.120_456, 12.75, 349.678_912]}
    ]);
    let scene = read(&json, &binary).unwrap();
    assert!(scene.origin.distance(place) < 4.0, "{}", scene.origin);
    let corner = scene.to_world(&scene.objects[0]).transform_point3(DVec3::ZERO);
    assert!(corner.distance(place) < 1e-6, "{corner}: f32 alone has steps of half a unit");
    let eye = scene.origin + scene.cameras[0].position.as_dvec3();
    assert!(eye.distance(place + DVec3::Z * 4.0) < 1e-6, "{eye}");
    let (built, _) = RenderScene::build(scene, &BuildOptions { origin: None, ..BuildOptions::default() }).unwrap();
    let found = built.geometry.positions[0].as_dvec3() + built.origin;
    assert!(found.distance(place) < 1e-6, "{found}");
    // A matrix in place of the translation.
    json["nodes"][0] = json!({"children": [1, 2], "matrix": [
        1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 554_000.003, 0.0, 5_812_000.0, 1.0
    ]});
    let scene = read(&json, &binary).unwrap();
    let corner = scene.to_world(&scene.objects[0]).transform_point3(DVec3::ZERO);
    assert!(corner.distance(place) < 1e-6, "{corner}");
}

/// A picture of 64 x 64 texels whose alpha depends on the column.
fn columns(folder: &Folder, name: &str, alpha: impl Fn(u32) -> u8) {
    let picture = image::RgbaImage::from_fn(64, 64, |x, _| image::Rgba([200, 100, 50, alpha(x)]));
    picture.save(folder.path(name)).expect("a PNG");
}

#[test]
fn what_is_blended_by_a_texture_is_clear_by_each_texel_or_cut_out() {
    let folder = Folder::new();
    // `smoke`: alpha grows by 51 every 8 columns, up to 255. `leaf`: a clear half, one half-clear column, and an opaque half.
    columns(&folder, "smoke.png", |x| (x / 8 * 51).min(255) as u8);
    columns(&folder, "leaf.png", |x| [0, 128, 255][usize::from(x > 31) + usize::from(x > 32)]);
    let (mut json, binary) = square();
    json["textures"] = json!([{"source": 0}, {"source": 1}]);
    json["images"] = json!([{"uri": "smoke.png"}, {"uri": "leaf.png"}]);
    let of = |texture: u32, opacity: f32, mode: &str| {
        json!({"alphaMode": mode, "pbrMetallicRoughness":
            {"baseColorTexture": {"index": texture}, "baseColorFactor": [1.0, 1.0, 1.0, opacity]}})
    };
    json["materials"] = json!([
        of(0, 1.0, "BLEND"),
        of(1, 1.0, "BLEND"),
        of(1, 0.5, "BLEND"),
        of(0, 1.0, "MASK"),
        of(0, 1.0, "OPAQUE")
    ]);
    let path = folder.write("a.glb", glb(&json, &binary));
    let read = |needs: Needs| {
        load(std::slice::from_ref(&path), &LoadOptions { needs, ..LoadOptions::default() }, &|_| {}).unwrap()
    };
    const CUT: &str = "materials that are blended, with hardly a texel that is half clear";
    const UNASKED: &str = "materials that are blended texel by texel";
    let scene = read(Needs::ALL);
    let [smoke, leaf, faint, mask, opaque] = &scene.materials[..] else { panic!("five materials") };
    for soft in [smoke, faint] {
        assert_eq!((soft.transmission, soft.veil, soft.ior, soft.volume), (1.0, 0.0, 1.0, false), "{soft:?}");
        assert!(scene.textures[soft.transmission_texture.expect("its alpha") as usize].is_clear());
        assert!(soft.alpha_cutoff.is_some_and(|cutoff| cutoff < 1.0 / 255.0), "{soft:?}");
    }
    for cut in [leaf, mask] {
        assert_eq!((cut.transmission, cut.transmission_texture, cut.alpha_cutoff), (0.0, None, Some(0.5)), "{cut:?}");
    }
    assert_eq!((opaque.transmission, opaque.transmission_texture, opaque.alpha_cutoff), (0.0, None, None));
    assert_eq!((count(&scene.warnings, CUT), count(&scene.warnings, UNASKED)), (1, 0));

    // The texels of the transmission texture are 1 minus the material's alpha, also in linear colour space.
    for (material, opacity) in [(0, 1.0), (2, 0.5)] {
        let mut scene = scene.clone();
        scene.meshes[0].groups[0].material = material;
        let options = BuildOptions { color: ColorSpace::Linear, ..BuildOptions::default() };
        let mut built = Arc::new(RenderScene::build(scene, &options).unwrap().0);
        let decided = curitiba_pipeline::glass::decide(&mut built, &path);
        let texture = decided.dielectrics[material as usize].transmission_texture.expect("its alpha") as usize;
        let base = &built.textures[built.materials[material as usize].texture.expect("its colours") as usize];
        for column in 0..64 {
            let at = Vec2::new((column as f32 + 0.5) / 64.0, 0.5);
            let clear = built.textures[texture].sample(at, 0.0).x;
            let expected = 1.0 - opacity * base.sample(at, 0.0).w;
            assert!((clear - expected).abs() <= 0.5 / 255.0 + 1e-6, "{column}: {clear}, not {expected}");
        }
    }

    // If no pass asks for the glass materials, the blended ones are cut out at a texture alpha of one half, with a warning.
    let scene = read(Needs { glass_maps: false, ..Needs::ALL });
    let cutoffs: Vec<Option<f32>> = scene.materials.iter().map(|material| material.alpha_cutoff).collect();
    assert_eq!(cutoffs, [Some(0.5), Some(0.5), Some(0.25), Some(0.5), None]);
    assert!(scene.materials.iter().all(|material| material.transmission_texture.is_none()));
    assert_eq!((count(&scene.warnings, CUT), count(&scene.warnings, UNASKED)), (1, 2));
    // A load of nothing but shapes finds the same materials to be glass, and warns of no missing texture.
    let scene = read(Needs::NOTHING);
    let glass = scene.materials.iter().map(|material| material.transmission >= curitiba_pipeline::glass::TRANSPARENT);
    assert_eq!(glass.collect::<Vec<_>>(), [true, false, true, false, false]);
    assert!(scene.textures.is_empty() && count(&scene.warnings, "missing textures") == 0);
}

#[test]
fn a_blend_whose_picture_is_lost_is_opaque_and_vertex_alpha_is_said_to_be_ignored() {
    let folder = Folder::new();
    columns(&folder, "smoke.png", |x| (x * 4) as u8);
    let (mut json, mut binary) = square();
    json["textures"] = json!([{"source": 0}]);
    json["images"] = json!([{"uri": "smoke.png"}]);
    json["materials"] = json!([{"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    let colors = floats(&[[1.0, 1.0, 1.0, 0.5]; 4].concat());
    let accessor = json!({"componentType": 5126, "count": 4, "type": "VEC4"});
    let index = add_accessor(&mut json, &mut binary, &colors, accessor);
    json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = index.into();
    let path = folder.write("a.glb", glb(&json, &binary));
    let scene = load_one(&path).unwrap();
    assert_eq!(count(&scene.warnings, "vertex colours with alpha of what is blended texel by texel"), 1);
    assert!(scene.meshes[0].colors.iter().all(|color| color.w == 1.0));
    // In the 2014 layout the material has an alpha test at one half, as in pictures without rays.
    let written = folder.path("a.cbo");
    write_cbo(&scene, &written, Layout::Cbo2014).unwrap();
    assert_eq!(load_one(&written).unwrap().materials[0].alpha_cutoff, Some(0.5));

    std::fs::write(folder.path("smoke.png"), b"no picture any more").unwrap();
    let (built, warnings) = RenderScene::build(scene, &BuildOptions::default()).unwrap();
    assert_eq!((built.materials[0].transmission, built.materials[0].transmission_texture), (0.0, None));
    assert_eq!(count(&warnings, "textures that cannot be decoded"), 2, "its colours, and its alpha");
    // A texture that is already missing when the scene is read causes one warning, and the material is opaque.
    std::fs::remove_file(folder.path("smoke.png")).unwrap();
    let scene = load_one(&path).unwrap();
    assert_eq!((count(&scene.warnings, "missing textures"), scene.materials[0].transmission), (1, 0.0));
}

#[test]
fn samplers_say_what_is_read_where_textures_are_magnified() {
    let folder = Folder::new();
    folder.png("t.png", 1, 1, [128, 7, 9, 255]);
    let (mut json, binary) = square();
    json["images"] = json!([{"uri": "t.png"}]);
    json["samplers"] = json!([{"magFilter": 9728, "wrapT": 33648}, {"magFilter": 9729, "minFilter": 9728}, {}]);
    json["textures"] = json!([{"source": 0, "sampler": 0}, {"source": 0, "sampler": 1}, {"source": 0, "sampler": 2}]);
    json["materials"] =
        (0..3).map(|index| json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": index}}})).collect();
    let scene = load_one(&folder.write("a.glb", glb(&json, &binary))).unwrap();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings.groups());
    let nearest = Sampling { wrap: [Wrap::Repeat, Wrap::Mirror], magnification: Magnification::Nearest };
    let read = scene.textures.iter().map(|texture| texture.texels().1);
    assert_eq!(read.collect::<Vec<_>>(), [nearest, Sampling::default()], "two of the three are alike");
    // The transmission texture made from the alpha has the same sampling.
    assert_eq!(scene.textures[0].clone().clear(65_535).texels().1, nearest);
}
