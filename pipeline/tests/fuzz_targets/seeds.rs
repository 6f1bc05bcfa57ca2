//! Tiny inputs of every format, all made here, as seeds of mutations.

use super::fuzz_targets::{Folder, LIBRARY, PROJECT, tga};
use curitiba_pipeline::image::{Image, Layer, write_exr_layers};
use curitiba_pipeline::scene::{Group, Layout, Material, Mesh, Object, Scene, TextureSource, write_cbo};
use exr::prelude::{Compression, Encoding, LayerAttributes, SpecificChannels, WritableImage as _, f16};
use glam::{Mat4, Vec2, Vec3};
use image::{DynamicImage, ImageFormat, Rgba, RgbaImage};
use std::io::Cursor;

/// The seeds of a target, with names; each is an input that loads.
///
/// # Panics
/// If there is no such target.
#[must_use]
pub fn of(target: &str) -> Vec<(&'static str, Vec<u8>)> {
    match target {
        "project_xml" => vec![("everything.xml", PROJECT.into()), ("smallest.xml", SMALLEST_PROJECT.into())],
        "mlib" => vec![("everything.mlib", LIBRARY.into())],
        "cbo" => vec![
            ("list.cbo", written(Layout::Cbo2014)),
            ("list.nbo", written(Layout::NboToday)),
            ("octree.cbo", octree(Layout::Cbo2014)),
            ("octree.nbo", octree(Layout::NboToday)),
        ],
        "obj" => vec![("plain.obj", PLAIN_OBJ.into()), ("materials.obj", MATERIALS_OBJ.into())],
        "gltf" => vec![
            ("data.gltf", data_gltf()),
            ("file.gltf", [gltf_json("\"scene.bin\"").as_bytes(), b"\0", &gltf_binary()].concat()),
            ("binary.glb", glb()),
            ("sparse.gltf", SPARSE_GLTF.into()),
            ("posed.gltf", POSED_GLTF.into()),
            // Made by the encoders of the decoding crates; a test in `scene/gltf.rs` writes them.
            ("draco.glb", include_bytes!("draco.glb").to_vec()),
            ("meshopt.glb", include_bytes!("meshopt.glb").to_vec()),
        ],
        "studio" => vec![("square.3ds", studio())],
        "collada" => vec![("square.dae", COLLADA.into())],
        "ogre" => vec![("square.mesh.xml", OGRE.into())],
        "texture" => vec![
            ("rgba.png", encoded(ImageFormat::Png, true)),
            ("rgb.jpg", encoded(ImageFormat::Jpeg, false)),
            ("rgba.tif", encoded(ImageFormat::Tiff, true)),
            ("rgba.bmp", encoded(ImageFormat::Bmp, true)),
            ("rgba.tga", encoded(ImageFormat::Tga, true)),
            ("plain.tga", tga(&[[1, 2, 3, 4], [5, 6, 7, 255]])),
            ("dxt1.dds", dds()),
        ],
        "picture" => pictures(),
        "shader" => vec![
            ("bands.glsl", [BANDS_VERTEX, "\0", BANDS_FRAGMENT].concat().into()),
            ("quad.glsl", QUAD_SHADER.into()),
            ("words.glsl", WORDS_SHADER.into()),
            ("depth.glsl", DEPTH_SHADER.into()),
            ("shadowed.glsl", [SHADOWED_VERTEX, "\0", SHADOWED_FRAGMENT].concat().into()),
        ],
        "script" => vec![("levels.lua", LEVELS_SCRIPT.into()), ("words.lua", WORDS_SCRIPT.into())],
        other => panic!("there is no target {other}"),
    }
}

const BANDS_VERTEX: &str = include_str!("../../../xml_projects/shaders/glsl/bands.vert");
const BANDS_FRAGMENT: &str = include_str!("../../../xml_projects/shaders/glsl/bands.frag");

const SHADOWED_VERTEX: &str = include_str!("../../../xml_projects/shaders/glsl/shadowed.vert");
const SHADOWED_FRAGMENT: &str = include_str!("../../../xml_projects/shaders/glsl/shadowed.frag");

/// A script that runs its pass once for each level.
const LEVELS_SCRIPT: &str = r#"function before()
    setAttr("PASS", "main#show", "Share", 0, { 0.25 })
end
function again()
    local level, count = {}, {}
    getAttr("PASS", "CURRENT", "Level", 0, level)
    getAttr("RENDERER", "CURRENT", "COUNT", 0, count)
    if level[1] >= count[1] then return false end
    setAttr("PASS", "CURRENT", "Level", 0, { level[1] + 1 })
    return true
end
function after()
    saveTexture("result", "a.png")
end
"#;

/// A script with most keywords of Lua.
const WORDS_SCRIPT: &str = r##"local runs, parts = 0, { 1, 2.5, [4] = "four", name = { 0x1p4, 7 // 2, 7 % -3, 1 << 3, ~5 } }
local held = setmetatable and nil
function before()
    for at, part in ipairs(parts) do assert(type(part) == "number", at .. "") end
    for key, part in pairs(parts) do if key == "name" then part[#part + 1] = select("#", nil, nil) end end
    repeat runs = runs - 1 until runs < -3 or not held
    goto done
    ::done::
    setAttr("RENDERER", "CURRENT", "COUNT", 0, { math.floor(math.max(2, tonumber("3"))) })
end
function again()
    runs = runs + 1
    while runs > 100 do break end
    return runs <= 1 and tostring(runs) ~= [[2]]
end
function after() local function deep(n) return n > 0 and deep(n - 1) or error({ n }) end if runs > 9 then deep(3) end end
"##;

/// Shaders for a target with one colour whose depth is kept.
const DEPTH_SHADER: &str = "1#version 440\nuniform mat4 m[2];\nuniform bool on = true;\nin vec4 position;\nin vec3 tangent;\nout vec4 p[2];\nout mat3 n;
void main() { p[0] = m[1] * position; p[1] = on ? p[0] : position; n = mat3(m[0]); n[1] = tangent; gl_Position = position; }
\0#version 440\nuniform sampler2DShadow a;\nuniform bvec2 two;\nuniform float w[3] = { 1., 2., 3. };\nin vec4 p[2];\nin mat3 n;\nout float depth;
void main() { depth = texture(a, p[0].xyz) + textureProj(a, p[1]) * w[w.length() - 1]; if (two.y) gl_FragDepth = n[2].x; }\n";

/// Shaders in the style of files from before OpenGL 3.
const QUAD_SHADER: &str = "#version 120\nattribute vec4 position;\nattribute vec4 texCoord0;\nvarying vec2 uv;
void main() { uv = vec2(texCoord0); gl_Position = position; }\n\0uniform sampler2D a;\nvarying vec2 uv;
void main() { gl_FragColor = texture2D(a, uv) + vec4(gl_FragCoord.xy, 0, 1.); if (uv.x < .5) discard; }\n";

/// Shaders that use most of the syntax that the compiler translates.
const WORDS_SHADER: &str = "#version 430 core\n#define N 3\n#if N > 2 && defined(N)\nstruct L { vec4 w[N]; vec3 d; float one; };\n#endif
layout(std140) uniform M { mat4 pvm; mat3 n; L light; };\nuniform int count = 2;\nuniform int on;
in vec4 position;\nflat out int id;\nout vec4 c;\nout vec4 e;\nsmooth out float f;
float g(in vec3 a, inout float b) { b += a.x; return b; }
void main() { float s = 0.; for (int i = 0; i < count; i++) { s += light.w[i].x * light.one; if (i == 1) continue; }
switch (count) { case 1: s = 1.; break; default: s++; } do { s -= 1.0; } while (s > 3.);
id = on > 0 ? 1 : 0; c = vec4(n * light.d, g(vec3(1), s)); e = c.wzyx; f = mod(s, 2.); gl_Position = pvm * position; }
\0#version 330\nuniform M { mat4 pvm; mat3 n; };\nuniform sampler2D t;\nflat in int id;\nin vec4 c;\nin vec4 e;\nin float f;
layout(location = 0) out vec4 one;\nlayout(location = 1) out vec4 two;\nconst vec2 k[2] = vec2[](vec2(0), vec2(1, 2));
void main() { vec4 p = textureLod(t, k[id & 1], 0.); p.rgb *= float(textureSize(t, 0).x) / 2;
one = p + e * pow(f, 2.) + texelFetch(t, ivec2(gl_FragCoord.xy), 0); two = mix(one, gl_FrontFacing ? e : p, dFdx(f)); }\n";

const SMALLEST_PROJECT: &str = "<project name=\"p\"><assets>
<scenes><scene name=\"S\"><file name=\"b.obj\"/></scene></scenes><cameras><camera name=\"C\"/></cameras></assets>
<pipelines><pipeline name=\"m\"><pass class=\"default\" name=\"a\"><scenes><scene name=\"S\"/></scenes><camera name=\"C\"/></pass></pipeline></pipelines>
</project>";

const PLAIN_OBJ: &str = "# two triangles\no box\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0.5\nf 1 2 3\nf -1 -2 \\\n -3\n";

const MATERIALS_OBJ: &str = "mtllib scene.mtl\no a\nv 0 0 0\nv 1 0 0 1\nv 1 1 0\nv 0 1 0\nv 0.4 0.4 0
vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nvn 1e-3 0 -1\nusemtl wall\ns 1\nf 1/1/1 2/2/1 3/3/2\nf 1//1 3//2 4//1\nusemtl pane
g b c\nf 1/1 2/2 3/3\nf 1 2 3 4 5\nusemtl gone\nl 1 2\nf 3 4 5\n\0newmtl wall\nKd 0.5\nKa 0.1 0.2 0.3\nKs 1 1 1\nKe 0 0 0
Ns 20\nd 0.9\nillum 2\nmap_Kd -s 2 2 1 -o 0.5 0 0 t.tga\nmap_d m.tga\nnewmtl pane\nKd 1 1 1\nTf 0.9 0.9 0.8\nNi 1.52
Tr 0.7\nd -halo 0.5\nillum 7\nmap_Kd t.tga\nmap_d t.tga\nmap_bump -bm 0.2 m.tga\n";

const COLLADA: &str = r##"<COLLADA><asset><unit meter="0.1"/><up_axis>Z_UP</up_axis></asset>
<library_images><image id="i"><init_from>t.tga</init_from></image></library_images>
<library_effects><effect id="e"><profile_COMMON><newparam sid="s"><surface><init_from>i</init_from></surface></newparam>
<newparam sid="t"><sampler2D><source>s</source></sampler2D></newparam><technique><phong><diffuse><texture texture="t"/></diffuse>
<transparent opaque="A_ONE"><color>1 1 1 0.5</color></transparent><shininess><float>3</float></shininess></phong></technique>
</profile_COMMON></effect></library_effects><library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a">0 0 0 1 0 0 0 1 0 1 1 .5</float_array><technique_common>
<accessor source="#a" count="4" stride="3"/></technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/>
</vertices><polylist material="w"><input semantic="VERTEX" source="#v" offset="0"/><input semantic="TEXCOORD" source="#p" offset="1"/>
<vcount>3 3</vcount><p>0 0 1 1 2 2 2 2 1 1 3 3</p></polylist></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="n"><node><rotate>0 0 1 30</rotate><translate>1 2 3</translate><instance_geometry url="#g">
<bind_material><technique_common><instance_material symbol="w" target="#m"/></technique_common></bind_material></instance_geometry>
</node></visual_scene></library_visual_scenes><scene><instance_visual_scene url="#n"/></scene></COLLADA>"##;
const OGRE: &str = r#"<?xml version="1.0"?><mesh><sharedgeometry vertexcount="4"><vertexbuffer positions="true" normals="true">
<vertex><position x="0" y="0" z="0"/><normal x="0" y="0" z="1"/><texcoord u="0" v="1"/></vertex>
<vertex><position x="1" y="0" z="0"/><normal x="0" y="0" z="1"/><texcoord u="1" v="1"/></vertex>
<vertex><position x="0" y="1" z="0"/><normal x="0" y="0" z="1"/><texcoord u="0" v="0"/></vertex>
<vertex><position x="1" y="1" z="-2e-1"/><normal x="0" y="0" z="1"/><texcoord u="1" v="0"/></vertex></vertexbuffer></sharedgeometry>
<submeshes><submesh material="a/b" usesharedvertices="true"><faces count="1"><face v1="0" v2="1" v3="2"/></faces></submesh>
<submesh material="c"><faces><face v1="0" v2="1" v3="2"/></faces><geometry vertexcount="3"><vertexbuffer>
<vertex><position x="5" y="0" z="0"/></vertex><vertex><position x="6" y="0" z="0"/></vertex><vertex><position x="5" y="1" z="0"/></vertex>
</vertexbuffer></geometry></submesh></submeshes></mesh>"#;

/// A chunk of a 3DS file: id, length, contents.
fn chunk(id: u16, parts: &[&[u8]]) -> Vec<u8> {
    let contents = parts.concat();
    [&id.to_le_bytes()[..], &(contents.len() as u32 + 6).to_le_bytes(), &contents].concat()
}

/// A square of two triangles: one plain and half transparent, one textured.
fn studio() -> Vec<u8> {
    let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let shorts = |values: &[u16]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let half = chunk(0xA050, &[&chunk(0x0030, &[&shorts(&[50])])]);
    let red = chunk(0xA020, &[&chunk(0x0011, &[&[255, 51, 0]])]);
    let plain = chunk(0xAFFF, &[&chunk(0xA000, &[b"red\0"]), &red, &half]);
    let picture = chunk(0xA200, &[&chunk(0xA300, &[b"T.TGA\0"]), &chunk(0xA356, &[&floats(&[2.0])])]);
    let wall = chunk(0xAFFF, &[&chunk(0xA000, &[b"wall\0"]), &picture]);
    let positions = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]);
    let texcoords = floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
    let uses = [chunk(0x4130, &[b"red\0", &shorts(&[1, 0])]), chunk(0x4130, &[b"wall\0", &shorts(&[1, 1])])].concat();
    let faces = chunk(0x4120, &[&shorts(&[2]), &shorts(&[0, 1, 2, 7, 2, 1, 3, 7]), &uses]);
    let positions = chunk(0x4110, &[&shorts(&[4]), &positions]);
    let texcoords = chunk(0x4140, &[&shorts(&[4]), &texcoords]);
    let object = chunk(0x4000, &[b"box\0", &chunk(0x4100, &[&positions, &faces, &texcoords])]);
    chunk(0x4D4D, &[&chunk(0x0002, &[&[3, 0, 0, 0]]), &chunk(0x3D3D, &[&object, &plain, &wall])])
}

/// A square with a texture file beside it, and a glass triangle that is placed twice.
fn scene(folder: &Folder) -> Scene {
    let texture = folder.write("t.tga", &tga(&[[1, 2, 3, 4]]));
    let square = Mesh {
        name: "square".to_owned(),
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::X + Vec3::Y],
        normals: vec![Vec3::Z; 4],
        texcoords: vec![Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE],
        groups: vec![Group { material: 0, triangles: vec![[0, 1, 2], [2, 1, 3]] }],
        ..Mesh::default()
    };
    let pane = Mesh {
        name: "pane".to_owned(),
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Z],
        groups: vec![Group { material: 1, triangles: vec![[0, 1, 2]] }],
        ..Mesh::default()
    };
    let object = |name: &str, mesh, transform| Object { name: name.to_owned(), mesh, transform };
    Scene {
        meshes: vec![square, pane],
        objects: vec![
            object("a", 0, Mat4::IDENTITY),
            object("b", 1, Mat4::from_translation(Vec3::new(0.0, 2.0, 0.0))),
            object("c", 1, Mat4::from_scale(Vec3::new(-1.0, 2.0, 3.0))),
        ],
        materials: vec![
            Material { name: "wall".to_owned(), texture: Some(0), alpha_cutoff: Some(0.5), ..Material::default() },
            Material { name: "Vidro".to_owned(), ..Material::default() },
        ],
        textures: vec![TextureSource::File(texture)],
        ..Scene::default()
    }
}

fn written(layout: Layout) -> Vec<u8> {
    let folder = Folder::new();
    let path = folder.path().join("seed");
    write_cbo(&scene(&folder), &path, layout).expect("the scene can be written");
    std::fs::read(path).expect("it was written")
}

/// A scene whose objects are in an octree, built by hand because the writer only writes lists.
fn octree(layout: Layout) -> Vec<u8> {
    let is_2014 = layout == Layout::Cbo2014;
    let word = |value: u32| value.to_le_bytes().to_vec();
    let text = |text: &str| [&word(text.len() as u32)[..], text.as_bytes(), &[0]].concat();
    let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let object = |key: &str| {
        let class = if is_2014 { text("SimpleTransform") } else { Vec::new() };
        [
            [text(key), text("o"), floats(&[0.0; 6]), class, floats(&Mat4::IDENTITY.to_cols_array())].concat(),
            [text("r"), word(1), text("position"), word(3)].concat(),
            floats(&[0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0]),
            // The word after the vertices; then a group without indices, which uses the vertices in order.
            [word(0), text("m"), word(0), word(0)].concat(),
        ]
        .concat()
    };
    let node = |objects: Vec<u8>, count: u32, children: u32| {
        [floats(&[0.0; 12]), word(count), objects, word(children), word(0), word(0)].concat()
    };
    [
        [word(0), text("OctreeByMatScene"), floats(&[0.0; 6]), text("tree")].concat(),
        node(object("k"), 1, 1),
        node([object("k"), object("l")].concat(), 2, 0),
    ]
    .concat()
}

/// A square of four vertices with texture coordinates and 16-bit indices.
fn gltf_binary() -> Vec<u8> {
    let floats = [
        [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0].as_slice(),
        [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0].as_slice(),
    ];
    let mut bytes: Vec<u8> = floats.concat().iter().flat_map(|value| value.to_le_bytes()).collect();
    bytes.extend([0_u16, 1, 2, 2, 1, 3].iter().flat_map(|index| index.to_le_bytes()));
    bytes
}

/// JSON for the buffer of [`gltf_binary`]; `uri` is a JSON string or `null`.
fn gltf_json(uri: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0,2]}}],
"nodes":[{{"mesh":0,"name":"n","rotation":[0,0,0,1],"scale":[1,2,1],"children":[1]}},{{"mesh":0,"translation":[0,0,1]}},
{{"mesh":0,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,3,0,0,1]}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"TEXCOORD_0":1}},"indices":2,"material":0}},
{{"attributes":{{"POSITION":0,"TEXCOORD_0":1}},"mode":5,"material":1}},{{"attributes":{{"POSITION":0}},"mode":6}}]}}],
"materials":[{{"name":"cut","alphaMode":"MASK","alphaCutoff":0.4,"doubleSided":true,
"pbrMetallicRoughness":{{"baseColorFactor":[1,1,1,0.5],"baseColorTexture":{{"index":0,
"extensions":{{"KHR_texture_transform":{{"offset":[0,1],"rotation":1.5,"scale":[2,2]}}}}}}}}}},
{{"name":"pane","alphaMode":"BLEND","emissiveFactor":[0,0,1],"pbrMetallicRoughness":{{"baseColorTexture":{{"index":1}}}},
"extensions":{{"KHR_materials_transmission":{{"transmissionFactor":0.9}},"KHR_materials_ior":{{"ior":1.4}},"KHR_materials_dispersion":{{"dispersion":0.4}},
"KHR_materials_volume":{{"thicknessFactor":0.1,"attenuationDistance":2,"attenuationColor":[0.5,1,1]}},
"KHR_materials_emissive_strength":{{"emissiveStrength":3}}}}}}],
"textures":[{{"source":0}},{{"source":1,"sampler":0}}],"samplers":[{{"wrapS":33071,"magFilter":9728}}],
"images":[{{"uri":"t.tga"}},{{"bufferView":2,"mimeType":"image/png"}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},
{{"bufferView":0,"byteOffset":48,"componentType":5126,"count":4,"type":"VEC2"}},
{{"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}}],
"bufferViews":[{{"buffer":0,"byteLength":80}},{{"buffer":0,"byteOffset":80,"byteLength":12}},
{{"buffer":0,"byteOffset":0,"byteLength":92}}],
"buffers":[{{"byteLength":92,"uri":{uri}}}]}}"#
    )
}

fn data_gltf() -> Vec<u8> {
    gltf_json(&format!("\"data:application/octet-stream;base64,{}\"", base64(&gltf_binary()))).into_bytes()
}

fn glb() -> Vec<u8> {
    let mut text = gltf_json("null").into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let binary = gltf_binary();
    let word = |value: usize| (value as u32).to_le_bytes().to_vec();
    let length = 28 + text.len() + binary.len();
    let header = [b"glTF".to_vec(), word(2), word(length), word(text.len()), b"JSON".to_vec()].concat();
    [header, text, word(binary.len()), b"BIN\0".to_vec(), binary].concat()
}

/// Positions that are zero except for those that a sparse accessor sets, beside normalised integers.
const SPARSE_GLTF: &str = r#"{"asset":{"version":"2.0"},"nodes":[{"mesh":0}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"NORMAL":1}}]}],
"accessors":[{"componentType":5126,"count":3,"type":"VEC3","sparse":{"count":2,
"indices":{"bufferView":0,"componentType":5121},"values":{"bufferView":0,"byteOffset":4}}},
{"bufferView":1,"componentType":5120,"normalized":true,"count":3,"type":"VEC3"}],
"bufferViews":[{"buffer":0,"byteLength":28},{"buffer":0,"byteLength":28,"byteStride":4}],
"buffers":[{"byteLength":28,"uri":"data:;base64,AQIAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAA=="}]}"#;

/// The same positions with a skin, a morph target and vertex colours.
const POSED_GLTF: &str = r#"{"asset":{"version":"2.0"},
"nodes":[{"mesh":0,"skin":0,"weights":[0.5]},{"translation":[0,0,1],"children":[2]},{"rotation":[0,0,1,1]}],
"meshes":[{"weights":[1],"primitives":[{"attributes":{"POSITION":0,"COLOR_0":1,"JOINTS_0":2,"WEIGHTS_0":3},"targets":[{"POSITION":0}]}]}],
"skins":[{"joints":[1,2]}],
"accessors":[{"componentType":5126,"count":3,"type":"VEC3","sparse":{"count":2,
"indices":{"bufferView":0,"componentType":5121},"values":{"bufferView":0,"byteOffset":4}}},
{"bufferView":1,"componentType":5121,"normalized":true,"count":3,"type":"VEC4"},{"componentType":5121,"count":3,"type":"VEC4"},
{"bufferView":1,"byteOffset":4,"componentType":5121,"normalized":true,"count":3,"type":"VEC4"}],
"bufferViews":[{"buffer":0,"byteLength":28},{"buffer":0,"byteLength":28,"byteStride":4}],
"buffers":[{"byteLength":28,"uri":"data:;base64,AQIAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAA=="}]}"#;

/// Base64 with padding (RFC 4648, section 4).
fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for three in bytes.chunks(3) {
        let at = |index: usize| u32::from(three.get(index).copied().unwrap_or(0));
        let bits = at(0) << 16 | at(1) << 8 | at(2);
        text.extend((0..4).map(|letter| match letter <= three.len() {
            true => char::from(LETTERS[(bits >> (18 - 6 * letter) & 63) as usize]),
            false => '=',
        }));
    }
    text
}

fn encoded(format: ImageFormat, alpha: bool) -> Vec<u8> {
    let image = RgbaImage::from_fn(5, 3, |x, y| Rgba([40 * x as u8, 80 * y as u8, 7, 40 * (x + y) as u8]));
    let image = DynamicImage::ImageRgba8(image);
    let image = if alpha { image } else { DynamicImage::ImageRgb8(image.into_rgb8()) };
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).expect("the format can be written");
    bytes.into_inner()
}

/// PNG files of several kinds, and EXR files with every lossless compression, with and without a variance layer.
fn pictures() -> Vec<(&'static str, Vec<u8>)> {
    let rgba = |x: u32, y: u32| Rgba([9_000 * x as u16, 20_000 * y as u16, 7, 65_535]);
    let deep = DynamicImage::ImageRgba16(image::ImageBuffer::from_fn(5, 3, rgba));
    let png = |image: DynamicImage| {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, ImageFormat::Png).expect("a PNG can be written");
        bytes.into_inner()
    };
    let folder = Folder::new();
    let shown = Image { width: 5, height: 3, pixels: (0..15).map(|i| [i as f32, 0.5, -1.0, 1.0]).collect() };
    let colors = ["R", "G", "B", "A"];
    let layered = |name: &str, layers: &[Layer<'_>]| {
        let path = folder.path().join(name);
        write_exr_layers(&path, layers).expect("an EXR can be written");
        std::fs::read(path).expect("it was written")
    };
    let exr = |compression: Compression| {
        let channels = SpecificChannels::rgb(|at: exr::math::Vec2<usize>| {
            (f16::from_f32(at.x() as f32), at.y() as u32, at.x() as f32 * 0.1)
        });
        let encoding = Encoding { compression, ..Encoding::FAST_LOSSLESS };
        let layer = exr::prelude::Layer::new((40, 9), LayerAttributes::named("l"), encoding, channels);
        let mut bytes = Cursor::new(Vec::new());
        exr::prelude::Image::from_layer(layer)
            .write()
            .non_parallel()
            .to_buffered(&mut bytes)
            .expect("an EXR can be written");
        bytes.into_inner()
    };
    vec![
        ("rgb.png", png(DynamicImage::ImageRgb8(deep.to_rgb8()))),
        ("grey.png", png(DynamicImage::ImageLuma8(deep.to_luma8()))),
        ("grey_alpha16.png", png(DynamicImage::ImageLumaA16(deep.to_luma_alpha16()))),
        ("rgba16.png", png(deep)),
        ("window.exr", layered("a.exr", &[Layer { name: "window", channels: colors, image: &shown }])),
        (
            "variance.exr",
            layered(
                "b.exr",
                &[
                    Layer { name: "variance:8", channels: colors, image: &shown },
                    Layer { name: "pos", channels: ["X", "Y", "Z", "cosine"], image: &shown },
                ],
            ),
        ),
        ("rle.exr", exr(Compression::RLE)),
        ("zip.exr", exr(Compression::ZIP16)),
        ("piz.exr", exr(Compression::PIZ)),
        ("raw.exr", exr(Compression::Uncompressed)),
    ]
}

/// One block of DXT1: 4 x 4 texels.
fn dds() -> Vec<u8> {
    let mut words = [0_u32; 32];
    words[0] = u32::from_le_bytes(*b"DDS ");
    // Sizes and flags of the header, then of its pixel format (Direct3D's `DDS_HEADER`).
    (words[1], words[2], words[3], words[4]) = (124, 0x1007, 4, 4);
    (words[19], words[20], words[21], words[27]) = (32, 4, u32::from_le_bytes(*b"DXT1"), 0x1000);
    words.iter().flat_map(|word| word.to_le_bytes()).chain([0, 0xF8, 0x1F, 0, 0x1B, 0x2D, 0xFF, 0x00]).collect()
}
