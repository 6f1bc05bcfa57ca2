use super::*;
use crate::project::{Light, MaterialPattern, PassKind, QuadSource, RayPass};
use glam::{DVec3, Mat4};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Writes a scene to a folder: a square of two materials, paint and pane; the pane is glass if `d` is below 1.
fn scene(folder: &Path, glass_opacity: f32, uses_glass: bool) -> PathBuf {
    let library = format!("newmtl paint\nKd 1 1 1\nnewmtl pane\nKd 1 1 1\nd {glass_opacity}\n");
    std::fs::write(folder.join("m.mtl"), library).expect("a file");
    let last = if uses_glass { "usemtl pane\nf 1 3 4\n" } else { "" };
    let path = folder.join("s.obj");
    let text = format!("mtllib m.mtl\nv 0 0 0\nv 4 0 0\nv 4 3 0\nv 0 3 0\nv 1e9 0 0\nusemtl paint\nf 1 2 3\n{last}");
    std::fs::write(&path, text).expect("a file");
    path
}

fn programs(project: &Project) -> Vec<&'static str> {
    let passes = &project.pipelines[project.default_pipeline].passes;
    passes
        .iter()
        .map(|pass| match &pass.kind {
            PassKind::Raster(_) => "raster",
            PassKind::Ray(ray) => ray.program.info().stem,
            PassKind::Effect(effect) => effect.program.info().name,
            PassKind::Quad(quad) if matches!(quad.source, QuadSource::Combine { .. }) => "combine",
            PassKind::Quad(_) => "show",
            PassKind::Intersection(_) => "intersections",
            PassKind::Compute(_) => "compute",
        })
        .collect()
}

fn open(path: &Path, options: &SceneOptions) -> Project {
    SceneProjects::new(&[path.to_owned()], options, None, 1 << 30).expect("a scene").project()
}

#[test]
fn effects_are_those_asked_for_or_those_that_the_scene_calls_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let glass_of = |project: &Project| match &project.pipelines[0].passes[1].kind {
        PassKind::Ray(ray) => (ray.glass.len(), ray.params.samples),
        _ => (0, 0),
    };
    for (opacity, uses, expected) in [(0.3, true, (1, 100)), (0.3, false, (0, 100)), (0.95, true, (0, 100))] {
        let project = open(&scene(folder.path(), opacity, uses), &SceneOptions::default());
        assert_eq!(programs(&project), ["raster", "final", "show"]);
        assert_eq!(glass_of(&project), expected, "{opacity} {uses}");
    }
    let path = scene(folder.path(), 0.3, true);
    for (effects, expected) in [
        ("none", &["raster", "show"][..]),
        ("shadows", &["raster", "deferredShadows", "combine"]),
        ("ao", &["raster", "ssao", "combine"]),
        ("glass", &["raster", "refraction", "show"]),
        ("ao,glass", &["raster", "refraction", "ssao", "combine"]),
        ("shadows,glass", &["raster", "final", "show"]),
        ("shadows,ao", &["raster", "final", "show"]),
    ] {
        let project = open(&path, &SceneOptions { effects: effects.parse().ok(), ..SceneOptions::default() });
        assert_eq!(programs(&project), expected, "{effects}");
        match effects {
            "shadows,glass" => assert_eq!(glass_of(&project), (1, 0)),
            "shadows,ao" => assert_eq!(glass_of(&project), (0, 100)),
            _ => {}
        }
    }
}

#[test]
fn textures_at_hits_are_filtered() {
    let folder = tempfile::tempdir().expect("a folder");
    let asked = |opacity: f32, effects: &str| {
        let options = SceneOptions { effects: effects.parse().ok(), ..SceneOptions::default() };
        let project = open(&scene(folder.path(), opacity, true), &options);
        let passes = project.pipelines[0].passes.iter();
        let rays = passes.filter_map(|pass| if let PassKind::Ray(ray) = &pass.kind { Some(ray) } else { None });
        let cones = |ray: &RayPass| ray.program.asks_of_cones(&ray.params).is_some();
        rays.map(|ray| (ray.program.info().stem, cones(ray))).collect::<Vec<_>>()
    };
    assert_eq!(asked(0.3, "ao,glass"), [("refraction", true), ("ssao", false)]);
    assert_eq!(asked(1.0, "shadows,glass"), [("final", true)]);
}

#[test]
fn the_box_is_that_of_triangles_and_the_radius_follows_it() {
    let folder = tempfile::tempdir().expect("a folder");
    // The fifth vertex of the file is far away and belongs to no triangle.
    let project = open(&scene(folder.path(), 1.0, false), &SceneOptions::default());
    let PassKind::Ray(ray) = &project.pipelines[0].passes[1].kind else { panic!("a ray pass") };
    assert!(!project.problems.to_string().contains("far triangles"), "few triangles are no reason to leave some out");
    assert_eq!(ray.params.radius, 0.25, "a twentieth of the diagonal of 4 x 3");
    assert!(project.cameras[0].position.length() < 30.0, "{:?}", project.cameras[0]);
}

#[test]
fn a_few_triangles_far_off_are_not_looked_at() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("sky.obj");
    let mut text = "v -500 0 -500\nv 500 0 -500\nv 0 900 500\nf 1 2 3\n".to_owned();
    for index in 0..40 {
        let (x, z) = (index % 8, index / 8);
        text += &format!("v {x} 0 {z}\nv {x} 1 {z}\nv {x}.9 0 {z}\nf -3 -2 -1\n");
    }
    std::fs::write(&path, text).expect("a file");
    let project = open(&path, &SceneOptions::default());
    let camera = &project.cameras[0];
    assert!(camera.position.length() < 40.0 && camera.far > 1000.0, "{camera:?}");
    assert!(project.problems.to_string().contains("but for a few far triangles"), "{}", project.problems);
}

#[test]
fn a_room_around_a_fine_mesh_is_looked_at_as_a_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("room.obj");
    let mut text = "v -1 0 -1\nv 1 0 -1\nv 1 2 1\nf 1 2 3\n".to_owned();
    for index in 0..400 {
        let (x, z) = (f64::from(index % 20) * 0.04, f64::from(index / 20) * 0.04);
        text += &format!("v {x} 0 {z}\nv {x} 0.8 {z}\nv {} 0 {z}\nf -3 -2 -1\n", x + 0.02);
    }
    std::fs::write(&path, text).expect("a file");
    let project = open(&path, &SceneOptions::default());
    assert!(!project.problems.to_string().contains("far triangles"), "{}", project.problems);
}

/// A terrain of 40 by 40 units, and above its middle a dome with a radius of 30 that is open below, as an OBJ file. `inwards`: whether the
/// dome's faces look at the terrain.
fn under_a_dome(folder: &Path, inwards: bool, open: bool) -> PathBuf {
    let mut text = "o terrain\n".to_owned();
    for corner in 0..121 {
        let (x, z) = (f64::from(corner % 11) * 4.0 - 20.0, f64::from(corner / 11) * 4.0 - 20.0);
        text += &format!("v {x} {} {z}\n", (0.4 * x).sin() * (0.3 * z).cos());
    }
    for corner in (0..109).filter(|corner| corner % 11 != 10) {
        text += &format!("f {} {} {} {}\n", corner + 1, corner + 12, corner + 13, corner + 2);
    }
    let (rings, sides) = (6, 16);
    text += "o sky dome\n";
    for corner in 0..=rings * sides {
        let (up, around) = (f64::from(corner / sides) / f64::from(rings), f64::from(corner % sides) / f64::from(sides));
        let ((height, level), (z, x)) = ((FRAC_PI_2 * up).sin_cos(), (TAU * around).sin_cos());
        text += &format!("v {} {} {}\n", 30.0 * level * x, 30.0 * height, 30.0 * level * z);
    }
    let at = |ring: i32, side: i32| 122 + (ring * sides + side % sides).min(rings * sides);
    for (ring, side) in (0..rings * sides).map(|face| (face / sides, face % sides)) {
        let [a, b, c, d] = [at(ring, side), at(ring, side + 1), at(ring + 1, side + 1), at(ring + 1, side)];
        if !(open && side < 4) {
            text += &if inwards { format!("f {a} {b} {c} {d}\n") } else { format!("f {d} {c} {b} {a}\n") };
        }
    }
    let path = folder.join("dome.obj");
    std::fs::write(&path, text).expect("a file");
    path
}

#[test]
fn the_camera_of_a_scene_under_a_dome_stands_in_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let opened = |path: &Path, options: &SceneOptions| {
        let project = open(path, options);
        (project.cameras[0].position, project.problems.to_string(), programs(&project))
    };
    let path = under_a_dome(folder.path(), true, false);
    let (eye, notes, passes) = opened(&path, &SceneOptions::default());
    assert!(eye.length() < 29.0 && eye.y > 1.0, "{eye}");
    assert!(notes.contains("inside `sky dome`, which is around all else") && notes.contains("no shadows"), "{notes}");
    assert_eq!(passes, ["raster", "ssao", "combine"]);
    let (_, notes, passes) =
        opened(&path, &SceneOptions { effects: "shadows".parse().ok(), ..SceneOptions::default() });
    assert_eq!(passes, ["raster", "deferredShadows", "combine"]);
    assert!(!notes.contains("no shadows"), "{notes}");
    // A `look_from` is kept. With `look_at` alone the camera stands inside the dome.
    let from = DVec3::new(0.0, 50.0, 100.0);
    assert_eq!(opened(&path, &SceneOptions { look_from: Some(from), ..SceneOptions::default() }).0, from);
    let at = opened(&path, &SceneOptions { look_at: Some(DVec3::new(5.0, 0.0, 0.0)), ..SceneOptions::default() }).0;
    assert!(at.length() < 29.5, "{at}");
    // A single-sided dome is not visible from outside.
    let scene = scene::load(&[path], &LoadOptions::default(), &|_| {}).expect("a scene");
    let material = |single_sided: bool| scene::Material { single_sided, ..scene.materials[0].clone() };
    let seen = |single_sided: bool| {
        let scene = Scene { materials: vec![material(single_sided)], ..scene.clone() };
        let project = SceneProjects::in_memory(scene, &SceneOptions::default(), None).expect("a scene").project();
        (project.cameras[0].position.length(), project.problems.to_string())
    };
    let [(near, _), (far, notes)] = [false, true].map(seen);
    assert!(near < 29.0 && far > 40.0 && notes.contains("clear from outside"), "{near} {far} {notes}");
    // If the dome's faces look outwards, or a quarter of them is missing, the camera sees the whole scene from outside.
    for (inwards, part) in [(false, false), (true, true)] {
        let path = under_a_dome(folder.path(), inwards, part);
        let (eye, notes, passes) = opened(&path, &SceneOptions::default());
        assert!(eye.length() > 60.0 && notes.contains("all of the scene"), "{eye} {notes}");
        assert_eq!(passes, ["raster", "final", "show"]);
    }
}

/// The materials of the skies of a project, its passes and its notes.
fn sky_of(path: &Path) -> (Vec<MaterialPattern>, Vec<&'static str>, String) {
    let project = open(path, &SceneOptions::default());
    (project.scenes[0].sky.clone(), programs(&project), project.problems.to_string())
}

fn named(names: &[&str]) -> Vec<MaterialPattern> {
    names.iter().map(|name| MaterialPattern::Named((*name).to_owned())).collect()
}

/// The scene of [`under_a_dome`] with a material for the terrain, and these names for the dome's object and material.
fn of_materials(folder: &Path, inwards: bool, [object, material]: [&str; 2]) -> PathBuf {
    let path = under_a_dome(folder, inwards, false);
    let text = std::fs::read_to_string(&path).expect("a file");
    let text = text.replace("o terrain\n", "mtllib dome.mtl\no terrain\nusemtl grass\n");
    let text = text.replace("o sky dome\n", &format!("o {object}\nusemtl {material}\n"));
    std::fs::write(&path, text).expect("a file");
    std::fs::write(folder.join("dome.mtl"), format!("newmtl grass\nnewmtl {material}\n")).expect("a file");
    path
}

#[test]
fn a_dome_with_a_material_of_its_own_is_a_sky_that_leaves_the_scene_its_shadows() {
    let folder = tempfile::tempdir().expect("a folder");
    let all = ["raster", "final", "show"];
    for (inwards, names) in
        [(true, ["Sphere 3", "blue"]), (false, ["Sphere 3", "Sky_Material"]), (false, ["SkyDome", "blue"])]
    {
        let (sky, passes, notes) = sky_of(&of_materials(folder.path(), inwards, names));
        assert_eq!((sky, passes), (named(&names[1..]), all.to_vec()), "{names:?}: {notes}");
        let note = format!("sky: `{}` shows as it is", names[1]);
        assert!(notes.contains(&note) && notes.contains("which is around all else"), "{notes}");
    }
    // A dome whose faces look outwards and whose name is not that of a sky is a ball; `skylight` does not name a sky.
    for material in ["blue", "skylight"] {
        let (sky, passes, _) = sky_of(&of_materials(folder.path(), false, ["Sphere 3", material]));
        assert_eq!((sky, passes), (Vec::new(), all.to_vec()), "{material}");
    }
    // A dome without a material of its own is a shell like the walls of a room.
    let (sky, passes, _) = sky_of(&under_a_dome(folder.path(), true, false));
    assert_eq!((sky, passes), (Vec::new(), vec!["raster", "ssao", "combine"]));
}

#[test]
fn clouds_in_a_dome_are_a_sky_as_well_and_the_camera_stands_below_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = of_materials(folder.path(), true, ["SkyDome", "blue"]);
    let text = std::fs::read_to_string(&path).expect("a file");
    // The same dome, somewhat smaller: its vertices follow those of the terrain and the dome.
    let (dome, clouds) = (text.split("o SkyDome\nusemtl blue\n").nth(1).expect("a dome"), "o Clouds\nusemtl grey\n");
    let vertices = dome.lines().filter(|line| line.starts_with("v ")).count();
    let mut text = format!("{text}{clouds}");
    for line in dome.lines() {
        let mut words = line.split(' ');
        let kind = words.next().expect("a word");
        text += kind;
        for word in words {
            text += &match kind {
                "v" => format!(" {}", word.parse::<f64>().expect("a number") * 0.96),
                _ => format!(" {}", word.parse::<usize>().expect("a number") + vertices),
            };
        }
        text += "\n";
    }
    std::fs::write(&path, text).expect("a file");
    std::fs::write(folder.path().join("dome.mtl"), "newmtl grass\nnewmtl blue\nnewmtl grey\n").expect("a file");
    let (sky, passes, notes) = sky_of(&path);
    assert_eq!((sky, passes), (named(&["blue", "grey"]), vec!["raster", "final", "show"]), "{notes}");
    let eye = open(&path, &SceneOptions::default()).cameras[0].position;
    assert!(eye.length() < 0.96 * 30.0, "{eye}");
}

/// Six sides around a small block, a material each; `bottom` is the lower end of the block.
fn in_a_box(folder: &Path, names: [&str; 6], bottom: f64) -> PathBuf {
    let (mut text, mut library) = ("mtllib box.mtl\n".to_owned(), "newmtl stone\n".to_owned());
    for (side, name) in names.iter().enumerate() {
        let (axis, sign) = (side / 2, if side % 2 == 0 { -1.0 } else { 1.0 });
        text += &format!("o side {side}\nusemtl {name}\n");
        library += &format!("newmtl {name}\n");
        for (u, v) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            let mut at = [0.0; 3];
            (at[axis], at[(axis + 1) % 3], at[(axis + 2) % 3]) = (10.0 * sign, -10.0 * sign * u, 10.0 * v);
            text += &format!("v {} {} {}\n", at[0], at[1], at[2]);
        }
        text += "f -4 -3 -2 -1\n";
    }
    text += "o block\nusemtl stone\n";
    for (x, y, z) in [(-1.0, 0.0, -1.0), (1.0, 0.0, -1.0), (0.0, 0.0, 1.0), (0.0, 2.0, 0.0)] {
        text += &format!("v {x} {} {z}\n", y + bottom);
    }
    text += "f -4 -3 -2\nf -4 -1 -3\nf -3 -1 -2\nf -2 -1 -4\n";
    let path = folder.join("box.obj");
    std::fs::write(&path, text).expect("a file");
    std::fs::write(folder.join("box.mtl"), library).expect("a file");
    path
}

#[test]
fn a_box_of_six_materials_is_a_sky_if_it_is_named_so_or_far_around_what_floats_in_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let plain = ["px", "nx", "py", "ny", "pz", "nz"];
    let skies = ["sky_l", "sky_r", "sky_d", "sky_u", "sky_b", "sky_f"];
    let of = |names: [&str; 6], bottom: f64| sky_of(&in_a_box(folder.path(), names, bottom)).0;
    assert_eq!(of(plain, -1.0), named(&plain));
    assert_eq!(of(skies, -10.0), named(&skies));
    // A box is not a sky box if the block stands on its bottom, or if several of its sides have the same material.
    assert_eq!(of(plain, -10.0), []);
    assert_eq!(of(["wall", "wall", "floor", "ceiling", "wall", "wall"], -1.0), []);
}

#[test]
fn cameras_of_the_file_come_first_unless_one_is_described() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("c.gltf");
    let data = "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0,1,2,3]}}],
        "extensionsUsed":["KHR_lights_punctual"],
        "extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"point"}},{{"type":"directional","color":[1,0.5,0],"intensity":2}}]}}}},
        "nodes":[{{"mesh":0}},{{"camera":0,"name":"Door","translation":[0,0,5]}},
        {{"camera":1,"name":"camera"}},
        {{"rotation":[-0.70710678,0,0,0.70710678],"extensions":{{"KHR_lights_punctual":{{"light":1}}}}}}],
        "cameras":[{{"type":"perspective","perspective":{{"yfov":0.8,"znear":0.1}}}},
        {{"type":"perspective","perspective":{{"yfov":0.7,"znear":0.1,"zfar":9}}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],
        "buffers":[{{"byteLength":36,"uri":"{data}"}}]}}"#
    );
    std::fs::write(&path, text).expect("a file");
    let project = open(&path, &SceneOptions::default());
    let names = |project: &Project| project.cameras.iter().map(|camera| camera.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&project), ["Door", "camera 2", "Camera"]);
    let door = &project.cameras[0];
    assert_eq!((door.position, door.direction, door.up), (DVec3::new(0.0, 0.0, 5.0), Vec3::NEG_Z, Vec3::Y));
    assert!((door.fov_y - 0.8).abs() < 1e-6 && door.near == 0.1 && door.far > 10.0);
    assert_eq!(project.cameras[1].far, 9.0);
    let sun = &project.lights[0];
    let down = sun.direction.expect("a direction");
    assert!(down.distance(Vec3::NEG_Y) < 1e-6, "{down}");
    assert_eq!(sun.color, Vec3::new(0.7, 0.35, 0.0));
    let described = SceneOptions { fov: Some(20.0), ..SceneOptions::default() };
    assert_eq!(names(&open(&path, &described)), ["Camera", "Door", "camera 2"]);
}

/// A triangle of one material, placed by each of these transforms.
fn placed(transforms: impl IntoIterator<Item = Mat4>) -> Scene {
    let group = scene::Group { material: 0, triangles: vec![[0, 1, 2]] };
    let mesh = scene::Mesh { positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y], groups: vec![group], ..Default::default() };
    let object = |transform| scene::Object { name: String::new(), mesh: 0, transform };
    let objects = transforms.into_iter().map(object).collect();
    Scene { meshes: vec![mesh], objects, materials: vec![scene::Material::default()], ..Scene::default() }
}

#[test]
fn many_cameras_with_one_name_get_numbers_without_a_search_through_all() {
    const COUNT: usize = 5000;
    let camera = |name: &str| scene::SceneCamera {
        name: name.to_owned(),
        position: Vec3::Z,
        direction: Vec3::NEG_Z,
        up: Vec3::Y,
        fov_y: 1.0,
        aspect: None,
        near: 0.1,
        far: None,
    };
    let mut scene = placed([Mat4::IDENTITY]);
    scene.cameras = ["Eye 3", "Eye", "eye", "EYE", "eye 3"].map(camera).to_vec();
    scene.cameras.extend((0..COUNT).map(|_| camera("")));
    let project = SceneProjects::in_memory(scene, &SceneOptions::default(), None).expect("a scene").project();
    let names: Vec<&str> = project.cameras.iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!(names[..5], ["Eye 3", "Eye", "eye 2", "EYE 4", "eye 3 2"]);
    // The camera that is made for the scene has the name `Camera`.
    assert_eq!(names[5..7], ["camera 2", "camera 3"]);
    assert_eq!(names[4 + COUNT], format!("camera {}", COUNT + 1));
}

/// A floor of 4 x 4 units at y = 0, with a point light 1 above its middle, a spot light that looks down from 2 above it, and a sun.
pub(in crate::project) const LAMPS: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1,2,3]}],
"extensionsUsed":["KHR_lights_punctual"],"extensions":{"KHR_lights_punctual":{"lights":[
{"type":"point","name":"Bulb","color":[1,0.5,0.25],"intensity":100,"range":20},
{"type":"spot","name":"Bulb","intensity":400,"spot":{"innerConeAngle":0.3,"outerConeAngle":0.6}},
{"type":"directional","intensity":30}]}},
"nodes":[{"mesh":0},{"translation":[0,1,0],"extensions":{"KHR_lights_punctual":{"light":0}}},
{"translation":[0,2,0],"rotation":[-0.70710678,0,0,0.70710678],"extensions":{"KHR_lights_punctual":{"light":1}}},
{"rotation":[-0.70710678,0,0,0.70710678],"extensions":{"KHR_lights_punctual":{"light":2}}}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0},"mode":5}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[-2,0,-2],"max":[2,0,2]}],
"bufferViews":[{"buffer":0,"byteLength":48}],
"buffers":[{"byteLength":48,"uri":"data:application/octet-stream;base64,AAAAwAAAAAAAAADAAAAAwAAAAAAAAABAAAAAQAAAAAAAAADAAAAAQAAAAAAAAABA"}]}"#;

#[test]
fn lights_of_the_file_keep_their_ratios_and_most_of_the_floor_is_below_white() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("lamps.gltf");
    std::fs::write(&path, LAMPS).expect("a file");
    let project = open(&path, &SceneOptions::default());
    let [bulb, spot, sun] = &project.lights[..] else { panic!("{:?}", project.lights) };
    assert_eq!([&bulb.name, &spot.name, &sun.name], ["Bulb", "Bulb 2", "light 2"]);
    assert_eq!([bulb, spot, sun].map(Light::kind), ["point", "spot", "directional"]);
    assert_eq!((bulb.position, bulb.falloff.range), (Some(DVec3::Y), 20.0));
    assert_eq!(bulb.falloff.attenuation, [0.0, 0.0, 1.0]);
    let cone = spot.falloff.spot.expect("a cone");
    assert!(cone.axis.distance(Vec3::NEG_Y) < 1e-6, "{cone:?}");
    assert!((cone.cutoff.to_radians() - 0.6).abs() < 1e-6 && (cone.inner.to_radians() - 0.3).abs() < 1e-6, "{cone:?}");
    let ratio = |a: f32, b: f32, expected: f32| assert!((a / b / expected - 1.0).abs() < 1e-5, "{a} {b}");
    ratio(bulb.color.x, sun.color.x, 100.0 / 30.0);
    ratio(spot.color.x, sun.color.x, 400.0 / 30.0);
    ratio(bulb.color.z, bulb.color.x, 0.25);
    // The light that arrives at points of the floor, in closed form, on a grid over the floor.
    let scale = f64::from(sun.color.x) / 30.0;
    let received = |x: f64, z: f64| {
        let from = |height: f64| (x * x + z * z + height * height, height / (x * x + z * z + height * height).sqrt());
        let ((near, cosine), (far, axis)) = (from(1.0), from(2.0));
        let edge = ((axis - 0.6_f64.cos()) / (0.3_f64.cos() - 0.6_f64.cos())).clamp(0.0, 1.0);
        let window = 1.0 - (near / 400.0).powi(2);
        30.0 + 100.0 * window * cosine / near + 400.0 * edge * edge * axis / far
    };
    let side = 200;
    let at = |step: i32| 4.0 * (f64::from(step) + 0.5) / f64::from(side) - 2.0;
    let all = (0..side * side).map(|i| received(at(i % side), at(i / side)) * scale).collect::<Vec<f64>>();
    let below = |most: f64| all.iter().filter(|light| **light <= most).count() as f64 / all.len() as f64;
    assert!(below(0.7 * 1.05) > 0.89 && below(0.7 / 1.05) < 0.91, "{} {}", below(0.7 * 1.05), below(0.7 / 1.05));
    let notes = project.problems.to_string();
    assert!(notes.contains("lights: `Bulb`, `Bulb`, `light 2` of the scene"), "{notes}");
    let passes = &project.pipelines[0].passes;
    assert!(passes.iter().take(2).all(|pass| pass.kind.lights() == [0, 1, 2]), "all shine");
    // Raster effects support one directional light.
    let made = SceneProjects::new(&[path], &SceneOptions::default(), None, 1 << 30).expect("a scene");
    let names: Vec<&str> = made.by_technique().iter().map(|(name, _)| *name).collect();
    assert!(names.contains(&"raster/SceneGTAO.xml") && !names.contains(&"raster/SceneShadowMap.xml"), "{names:?}");
    // The sun of the options replaces all lights of the file.
    let path = folder.path().join("lamps.gltf");
    let asked = open(&path, &SceneOptions { sun: Some(Vec3::Y), ..SceneOptions::default() });
    assert_eq!(asked.lights.iter().map(Light::kind).collect::<Vec<_>>(), ["directional"]);
}

#[test]
fn of_many_lights_those_that_light_most_shine() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("many.gltf");
    // A thousand lights above the floor, each lower than the one before, so that the last are the strongest.
    let nodes: Vec<String> = (0..1000)
        .map(|i| {
            let height = 1000 - i;
            format!(r#"{{"translation":[0,{height},0],"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}}"#)
        })
        .collect();
    let listed: Vec<String> = (0..=1000).map(|node| node.to_string()).collect();
    let start = LAMPS.find("\"nodes\":[{\"mesh\"").expect("there");
    let end = LAMPS.find("\"meshes\"").expect("there");
    let text = [&LAMPS[..start], "\"nodes\":[{\"mesh\":0},", &nodes.join(","), "],\n", &LAMPS[end..]].concat();
    let text = text.replace("\"nodes\":[0,1,2,3]", &format!("\"nodes\":[{}]", listed.join(",")));
    std::fs::write(&path, text.replace(",\"range\":20", "")).expect("a file");
    let project = open(&path, &SceneOptions::default());
    let heights: Vec<f64> = project.lights.iter().filter_map(|light| Some(light.position?.y)).collect();
    assert_eq!(heights, (1..=32).rev().map(f64::from).collect::<Vec<_>>());
    assert!(project.problems.to_string().contains("of 1000 lights 968 are left out"), "{}", project.problems);
}

#[test]
fn a_scene_without_a_triangle_says_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("points.obj");
    std::fs::write(&path, "v 0 0 0\nv 1 1 1\n").expect("a file");
    let error = SceneProjects::new(std::slice::from_ref(&path), &SceneOptions::default(), None, 1 << 30)
        .expect_err("no triangle");
    assert!(error.to_string().contains("no triangle"), "{error}");
    std::fs::write(&path, "v 0 0 0\nv 1 0 0\nl 1 2\np 1\n").expect("a file");
    let error = SceneProjects::new(&[path], &SceneOptions::default(), None, 1 << 30).expect_err("lines only");
    assert!(error.to_string().contains("the file has 2 lines and points: left out"), "{error}");
}

#[test]
fn a_scene_whose_z_points_up_is_seen_as_if_it_had_been_turned() {
    let folder = tempfile::tempdir().expect("a folder");
    let corners = [[0.5, 0.0, 0.0], [3.0, 1.0, 0.25], [1.0, 4.0, 7.0], [-2.0, 1.5, 3.0]];
    let written = |name: &str, turn: fn([f32; 3]) -> [f32; 3]| {
        let line = |corner: [f32; 3]| format!("v {} {} {}\n", corner[0], corner[1], corner[2]);
        let lines: String = corners.map(turn).map(line).concat();
        let path = folder.path().join(name);
        std::fs::write(&path, format!("{lines}f 1 2 3\nf 1 3 4\n")).expect("a file");
        path
    };
    let upright = open(&written("y.obj", |[x, y, z]| [x, z, -y]), &SceneOptions::default());
    let path = written("z.obj", |corner| corner);
    let turned = open(&path, &SceneOptions { up: Up::Z, ..SceneOptions::default() });
    let seen = |project: &Project| format!("{:?} {:?} {}", project.cameras, project.lights, project.scenes[0].unitize);
    assert_eq!(seen(&turned), seen(&upright));
    assert!(turned.scenes[0].swap_yz && !upright.scenes[0].swap_yz);
    assert_ne!(seen(&open(&path, &SceneOptions::default())), seen(&upright), "it is another view without the option");
    // The drawn scene is rotated in the same way.
    let drawn = |project: &Project, path: &Path| {
        let scene = scene::load(&[path.to_owned()], &LoadOptions::default(), &|_| {}).expect("a scene");
        let options = scene::BuildOptions { swap_yz: project.scenes[0].swap_yz, ..scene::BuildOptions::default() };
        scene::RenderScene::build(scene, &options).expect("it is built").0.geometry.positions
    };
    assert_eq!(drawn(&turned, &path), drawn(&upright, &folder.path().join("y.obj")));
}
