use crate::diagnostic::WarningGroup;
use crate::scene::{BuildOptions, LoadOptions, Needs, RenderScene, Scene, load};
use glam::{DVec3, Vec2, Vec3, Vec4};
use std::path::Path;

/// A house of a quad and a triangle, in centimetres with z up, placed twice, and a wall drawn through a skin.
const HOUSE: &str = r##"<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="cm" meter="0.01"/><up_axis>Z_UP</up_axis></asset>
<library_images><image id="im"><init_from>file://./my%20wall.png</init_from></image></library_images>
<library_materials>
 <material id="m0" name="wall"><instance_effect url="#e0"/></material>
 <material id="m1" name="glass"><instance_effect url="#e1"/></material>
</library_materials>
<library_effects>
 <effect id="e0"><profile_COMMON>
  <newparam sid="su"><surface type="2D"><init_from>im</init_from></surface></newparam>
  <newparam sid="sa"><sampler2D><source>su</source></sampler2D></newparam>
  <technique sid="t"><phong><emission><color>0 0 0 1</color></emission><diffuse><texture texture="sa" texcoord="UV"/></diffuse>
   <specular><color>.5 .4 .3 1</color></specular><shininess><float>20</float></shininess></phong></technique>
 </profile_COMMON></effect>
 <effect id="e1"><profile_COMMON><technique sid="t"><lambert><diffuse><color>0.1 0.2 0.3 1</color></diffuse>
  <transparent opaque="RGB_ZERO"><color>1 1 1 1</color></transparent><transparency><float>0.25</float></transparency>
  <index_of_refraction><float>1.4</float></index_of_refraction></lambert></technique></profile_COMMON></effect>
</library_effects>
<library_geometries>
 <geometry id="g" name="house"><mesh>
  <source id="p"><float_array id="pa" count="15">0 0 0  100 0 0  100 0 200  0 0 200  50 0 300</float_array><technique_common>
   <accessor source="#pa" count="5" stride="3"><param name="X" type="float"/></accessor></technique_common></source>
  <source id="n"><float_array id="na" count="3">0 -1 0</float_array><technique_common><accessor source="#na" count="1" stride="3"/>
  </technique_common></source>
  <source id="t"><float_array id="ta" count="8">0 0 1 0 1 1 0 1</float_array><technique_common><accessor source="#ta" count="4" stride="2"/>
  </technique_common></source>
  <source id="c"><float_array id="ca" count="7">9 1 0 0 0 0 1</float_array><technique_common><accessor source="#ca" count="2" stride="3" offset="1"/>
  </technique_common></source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  <polylist material="WALL" count="2"><input semantic="VERTEX" source="#v" offset="0"/><input semantic="NORMAL" source="#n" offset="1"/>
   <input semantic="TEXCOORD" source="#t" offset="2" set="3"/><input semantic="COLOR" source="#c" offset="3"/>
   <vcount>4 3</vcount><p>0 0 0 0 1 0 1 0 2 0 2 0 3 0 3 1  3 0 3 1 2 0 2 0 4 0 0 0</p></polylist>
  <triangles material="GLASS" count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2 0 1 9</p></triangles>
  <lines material="WALL" count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1</p></lines>
 </mesh></geometry>
</library_geometries>
<library_controllers><controller id="k"><skin source="#g"><bind_shape_matrix>1 0 0 0 0 1 0 7 0 0 1 0 0 0 0 1</bind_shape_matrix></skin>
</controller></library_controllers>
<library_nodes><node id="shared"><instance_geometry url="#g"><bind_material><technique_common>
 <instance_material symbol="WALL" target="#m0"/><instance_material symbol="GLASS" target="#m1"/>
</technique_common></bind_material></instance_geometry></node></library_nodes>
<library_visual_scenes><visual_scene id="s">
 <node id="a" name="first"><translate>100 0 0</translate><rotate>0 0 1 90</rotate><scale>1 1 2</scale><instance_node url="#shared"/></node>
 <node id="b"><matrix>1 0 0 500 0 1 0 0 0 0 1 0 0 0 0 1</matrix><node><instance_node url="#shared"/></node></node>
 <node id="l"><instance_light url="#sun"/></node>
 <node id="c"><instance_controller url="#k"/></node>
</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene>
</COLLADA>"##;

fn load_text(text: &str, needs: Needs, max_bytes: u64) -> Result<Scene, String> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("house.dae");
    std::fs::write(&path, text).expect("written");
    write_png(&folder.path().join("my wall.png"));
    load(&[path], &LoadOptions { needs, max_bytes }, &|_| {}).map_err(|error| error.to_string())
}

fn write_png(path: &Path) {
    image::RgbaImage::from_pixel(1, 1, image::Rgba([1, 2, 3, 255])).save(path).expect("written");
}

fn warnings(scene: &Scene) -> String {
    scene.warnings.groups().iter().map(WarningGroup::to_string).collect::<Vec<_>>().join("\n")
}

#[test]
fn geometry_stands_in_metres_with_y_up_where_its_nodes_place_it() {
    let scene = load_text(HOUSE, Needs::ALL, 1 << 24).expect("it loads");
    // The house's two primitives, and both again where the instance binds no materials.
    assert_eq!((scene.meshes.len(), scene.objects.len()), (4, 6), "{}", warnings(&scene));
    let names: Vec<_> = scene.objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!(names, ["shared", "shared", "shared", "shared", "c", "c"]);
    let at = |object: usize, vertex: usize| {
        let object = &scene.objects[object];
        object.transform.transform_point3(scene.meshes[object.mesh as usize].positions[vertex])
    };
    let near = |found: Vec3, expected: [f32; 3]| assert!(found.distance(expected.into()) < 1e-5, "{found}");
    // (100, 0, 200) cm: scaled to twice the height, rotated about z to (0, 100, 400), moved to (100, 100, 400); z up is y, y is -z.
    near(at(0, 2), [1.0, 4.0, -1.0]);
    near(at(2, 2), [6.0, 2.0, 0.0]);
    near(at(4, 0), [0.0, 0.0, -0.07]);
    let mesh = &scene.meshes[0];
    // Quad and triangle share the vertices of corner 3 and of corner 2; the top belongs to the triangle alone.
    assert_eq!((mesh.positions.len(), mesh.normals[4], mesh.texcoords[2]), (5, Vec3::NEG_Y, Vec2::ONE));
    assert_eq!(mesh.groups[0].triangles, [[0, 1, 2], [0, 2, 3], [3, 2, 4]]);
    assert_eq!(mesh.colors[0], Vec4::new(1.0, 0.0, 0.0, 1.0), "the accessor skips a number");
    assert_eq!(mesh.colors[3], Vec4::new(0.0, 0.0, 1.0, 1.0));
    assert_eq!(scene.meshes[1].groups[0].triangles, [[0, 1, 2]], "an index of 9 is out of range");
    let said = warnings(&scene);
    for words in [
        "indices of positions out of range",
        "lines of COLLADA",
        "cameras and lights",
        "drawn as they were modelled",
        "not described",
    ] {
        assert!(said.contains(words), "{words} in\n{said}");
    }
    let (built, _) = RenderScene::build(scene, &BuildOptions::default()).expect("it is built");
    assert_eq!(built.geometry.triangles.len(), 3 * 4);
    let bare = load_text(HOUSE, Needs::NOTHING, 1 << 24).expect("it loads");
    let mesh = &bare.meshes[0];
    assert!(mesh.normals.is_empty() && mesh.texcoords.is_empty() && mesh.colors.is_empty() && bare.textures.is_empty());
}

#[test]
fn effects_are_materials() {
    let scene = load_text(HOUSE, Needs::ALL, 1 << 24).expect("it loads");
    let names: Vec<_> = scene.materials.iter().map(|material| material.name.as_str()).collect();
    assert_eq!(names, ["wall", "glass", "WALL", "GLASS"]);
    let [wall, glass, ..] = &scene.materials[..] else { panic!("four materials") };
    assert!(scene.textures[0].name().ends_with("my wall.png"), "{:?}", scene.textures);
    assert_eq!((wall.texture, wall.shininess, wall.specular), (Some(0), 20.0, Vec4::new(0.5, 0.4, 0.3, 1.0)));
    assert!(glass.diffuse.distance(Vec4::new(0.1, 0.2, 0.3, 0.75)) < 1e-6, "{}", glass.diffuse);
    assert_eq!((glass.texture, glass.ior), (None, 1.4));
    assert!((glass.transmission - 0.25).abs() < 1e-6 && (glass.veil - 0.75).abs() < 1e-6, "{glass:?}");
    assert_eq!((wall.diffuse.w, wall.transmission), (1.0, 0.0));
    // A transparency of 1 is taken for an opacity.
    let whole = HOUSE.replace("<transparency><float>0.25", "<transparency><float>1");
    let scene = load_text(&whole, Needs::ALL, 1 << 24).expect("it loads");
    let glass = &scene.materials[1];
    assert_eq!((glass.diffuse.w, glass.transmission, glass.veil), (1.0, 0.0, 1.0));
    assert!(warnings(&scene).contains("transparency would make invisible"), "{}", warnings(&scene));
    // COLLADA 1.5 names the image in the sampler, and its file in an element of its own.
    let newer = HOUSE
        .replace("<source>su</source>", "<instance_image url=\"#im\"/>")
        .replace("<init_from>file://./my%20wall.png</init_from>", "<init_from><ref>my wall.png</ref></init_from>");
    let scene = load_text(&newer, Needs::ALL, 1 << 24).expect("it loads");
    assert_eq!(scene.materials[0].texture, Some(0), "{}", warnings(&scene));
    // The sampler's <magfilter> gives the magnification mode.
    let asked = |filter: &str| {
        let source = format!("<source>su</source>{filter}");
        let scene = load_text(&HOUSE.replace("<source>su</source>", &source), Needs::ALL, 1 << 24).expect("it loads");
        scene.textures[0].texels().1.is_nearest()
    };
    let found =
        ["", "<magfilter>LINEAR</magfilter>", "<minfilter>NEAREST</minfilter>", "<magfilter>NEAREST</magfilter>"];
    assert_eq!(found.map(asked), [false, false, false, true]);
    let gone = load_text(&HOUSE.replace("my%20wall", "none"), Needs::ALL, 1 << 24).expect("it loads");
    assert!(gone.materials[0].texture.is_none() && warnings(&gone).contains("missing textures"));
}

#[test]
fn wrong_files_are_errors_with_their_place_and_never_more() {
    let said = |text: &str, words: &str| {
        let error = load_text(text, Needs::ALL, 1 << 24).expect_err(words);
        assert!(error.contains("house.dae") && error.contains(words), "{error}, without {words}");
    };
    said("<mesh/>", "no COLLADA document");
    said("", "no COLLADA document");
    said("<COLLADA/><COLLADA/>", "a second element");
    said(
        &HOUSE.replace("count=\"5\" stride=\"3\"", "count=\"6\" stride=\"3\""),
        "6 times 3 values from 0 on are more than the 15",
    );
    said(
        &HOUSE.replace("count=\"5\" stride=\"3\"", "count=\"18446744073709551615\" stride=\"3\""),
        "are more than the 15",
    );
    said(&HOUSE.replace("count=\"5\" stride=\"3\"", "count=\"5\" stride=\"0\""), "are more than the 15");
    said(&HOUSE.replace("100 0 200", "100 x 200"), "`x` is no number");
    said(&HOUSE.replace("<vcount>4 3</vcount>", "<vcount>4 4</vcount>"), "fewer than <vcount> says");
    said(&HOUSE.replace("<vcount>4 3</vcount>", "<vcount>4 -3</vcount>"), "`-3` is no number of its kind");
    said(&HOUSE.replace("source=\"#v\" offset=\"0\"", "source=\"#w\" offset=\"0\""), "its `source` leads nowhere");
    said(&HOUSE.replace("offset=\"2\" set", "offset=\"x\" set"), "`offset` is no whole number");
    said(&HOUSE.replace("<scale>1 1 2</scale>", "<scale>1 2</scale>"), "<scale>: 2 numbers; valid: 3");
    said(&HOUSE.replace("url=\"#shared\"", "url=\"#g\""), "it names no node");
    said(&HOUSE.replace("<instance_light url=\"#sun\"/>", "<instance_node url=\"#l\"/>"), "one places itself");
    // Exporters may leave empty sources; attributes that read them are missing.
    let empty = "count=\"0\" stride=\"0\"";
    let nothing = load_text(&HOUSE.replace("count=\"5\" stride=\"3\"", empty), Needs::ALL, 1 << 24).expect("it loads");
    assert!(nothing.meshes.iter().all(|mesh| mesh.positions.is_empty()), "{}", warnings(&nothing));
    // An index beyond the source.
    let far = HOUSE.replace("<p>0 1 2 0 1 9</p>", "<p>0 1 4294967295 0 1</p>");
    assert!(
        warnings(&load_text(&far, Needs::ALL, 1 << 24).expect("it loads"))
            .contains("indices of positions out of range")
    );
    // An index out of range in another attribute than the position removes no triangle: without that attribute it would be drawn too.
    let lacking = HOUSE.replace("2 0 4 0 0 0</p></polylist>", "2 0 4 7 4 4294967295</p></polylist>");
    let all = load_text(&lacking, Needs::ALL, 1 << 24).expect("it loads");
    let bare = load_text(&lacking, Needs::NOTHING, 1 << 24).expect("it loads");
    let triangles = |scene: &Scene| {
        scene
            .meshes
            .iter()
            .map(|mesh| mesh.groups.iter().map(|group| group.triangles.len()).sum())
            .collect::<Vec<usize>>()
    };
    assert_eq!(triangles(&all), triangles(&bare));
    assert!(warnings(&all).contains("3 in `house`"), "{}", warnings(&all));
    let wide = HOUSE.replace(
        "<input semantic=\"COLOR\" source=\"#c\" offset=\"3\"/>",
        "<input semantic=\"COLOR\" source=\"#c\" offset=\"18446744073709551615\"/>",
    );
    assert!(load_text(&wide, Needs::ALL, 1 << 24).is_err(), "no corner is so long");

    // Each node places the next one twice: 2^60 houses.
    let mut nodes = String::new();
    for level in 0..60 {
        let next = if level == 59 { "shared".to_owned() } else { format!("n{}", level + 1) };
        nodes +=
            &format!("<node id=\"n{level}\"><instance_node url=\"#{next}\"/><instance_node url=\"#{next}\"/></node>");
    }
    let many = HOUSE
        .replace("<library_nodes>", &format!("<library_nodes>{nodes}"))
        .replace("url=\"#sun\"", "")
        .replace("<node id=\"l\">", "<node id=\"l\"><instance_node url=\"#n0\"/>");
    said(&many, "--max-memory");
    let deep = format!("<COLLADA>{}</COLLADA>", "<a>".repeat(300_000));
    assert!(load_text(&deep, Needs::ALL, 1 << 20).expect_err("beyond the limit").contains("--max-memory"));
    // Truncated at any byte, it loads or returns an error.
    for end in (0..HOUSE.len()).step_by(7) {
        _ = load_text(&HOUSE[..end], Needs::ALL, 1 << 24);
    }
}

#[test]
fn the_numbers_of_a_source_are_held_once_for_all_primitives_of_a_mesh() {
    // The accessor does not count the further numbers.
    let long = HOUSE.replace("50 0 300<", &format!("50 0 300{}<", " 0".repeat(60_000)));
    let triangles = HOUSE.lines().find(|line| line.contains("<triangles")).expect("a line");
    let many = long.replace(triangles, &triangles.repeat(200));
    let scene = load_text(&many, Needs::ALL, 4 << 20).expect("it loads");
    // The polygons and 200 times the triangles, with two bindings of materials.
    assert_eq!((scene.meshes.len(), scene.objects.len()), (2 * 201, 3 * 201));
    let [wall, glass] = [0, 1].map(|mesh: usize| &scene.meshes[mesh].positions);
    assert_eq!((wall.len(), glass.len()), (5, 3));
}

/// Programs on Windows write a byte order mark.
#[test]
fn a_byte_order_mark_moves_nothing() {
    let marked = format!("\u{feff}{HOUSE}");
    let [plain, scene] = [HOUSE, &marked].map(|text| load_text(text, Needs::ALL, 1 << 24).expect("it loads"));
    assert_eq!(format!("{:?}", scene.meshes), format!("{:?}", plain.meshes));
    let wrong =
        |text: &str| load_text(&text.replace("100 0 200", "100 x 200"), Needs::ALL, 1 << 24).expect_err("refused");
    let place = |message: String| message.split_once(".dae").expect("its file").1.to_owned();
    let at = HOUSE.find("<float_array").expect("an element");
    let before = &HOUSE[..at];
    let line = before.matches('\n').count() + 1;
    let column = before.chars().rev().take_while(|letter| *letter != '\n').count() + 1;
    assert!(line > 1 && column > 1);
    for text in [HOUSE, &marked] {
        let said = place(wrong(text));
        assert!(said.starts_with(&format!(":{line}:{column}: ")), "{said}, not {line}:{column}");
    }
    // Columns count letters, and a file of one line has line 1.
    let long = format!("<COLLADA><ä/><é x=1/>{}</COLLADA>", " ".repeat(10));
    let said = place(load_text(&long, Needs::ALL, 1 << 24).expect_err("an attribute without quotes"));
    assert!(said.starts_with(":1:14: "), "{said}");
    let broken = place(load_text("<COLLADA>\n\n  <a b='1/>", Needs::ALL, 1 << 24).expect_err("not closed"));
    assert!(broken.starts_with(":3:3: "), "{broken}");
}

#[test]
fn files_in_map_coordinates_keep_their_digits() {
    let place = DVec3::new(554_321.123_456, 5_812_345.678_912, 45.25);
    // The place is written in two ways: in the positions (in centimetres) of the first geometry, and in the nodes around it.
    let positions = "0 0 0  100 0 0  100 0 200  0 0 200  50 0 300";
    let numbers: Vec<f64> = positions.split_whitespace().map(|word| word.parse().expect("a number")).collect();
    let moved = |index: usize| (numbers[index] + 100.0 * place[index % 3]).to_string();
    let moved = (0..numbers.len()).map(moved).collect::<Vec<_>>().join(" ");
    let [whole, rest] = [DVec3::new(554_000.003, 5_812_000.0, 0.0), DVec3::new(321.120_456, 345.678_912, 45.25)];
    let words = |vector: DVec3| format!("{} {} {}", 100.0 * vector.x, 100.0 * vector.y, 100.0 * vector.z);
    let nested = format!(
        r##"<node id="c"><translate>{}</translate><node><translate>{}</translate><instance_geometry url="#g"/></node></node>"##,
        words(whole),
        words(rest)
    );
    let start = HOUSE.find(r#" <node id="a""#).expect("the nodes");
    let end = HOUSE.find("</visual_scene>").expect("their end");
    let with = |nodes: &str| [&HOUSE[..start], nodes, &HOUSE[end..]].concat();
    let plain = r##"<node id="c"><instance_geometry url="#g"/></node>"##;
    for text in [with(&nested), with(plain).replace(positions, &moved)] {
        let scene = load_text(&text, Needs::ALL, 1 << 24).expect("it loads");
        assert!(scene.origin.distance(DVec3::new(place.x, place.z, -place.y)) < 16.0, "{}", scene.origin);
        let object = &scene.objects[0];
        let corner = scene.meshes[object.mesh as usize].positions[2].as_dvec3();
        let found = scene.to_world(object).transform_point3(corner);
        // The point (100, 0, 200) cm from the place, in the file's axes with z up.
        let expected = DVec3::new(place.x + 1.0, place.z + 2.0, -place.y);
        assert!(found.distance(expected) < 1e-6, "{found}: f32 alone has steps of half a metre");
    }
}
