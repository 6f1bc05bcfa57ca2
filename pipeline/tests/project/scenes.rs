//! Scenes and cameras as present-day files declare them: folders, primitives, placements, projections.

use super::support::{Files, RASTER, bad, good, one_error, project, with};
use curitiba_pipeline::diagnostic::Severity;
use curitiba_pipeline::plan::{Plan, Settings};
use curitiba_pipeline::programs::Fidelity;
use curitiba_pipeline::project::{Orthographic, PassKind, declared_scenes};
use curitiba_pipeline::scene::{BuildOptions, LoadOptions, RenderScene, ShapeKind};
use glam::{Mat4, Vec3};

const FILE: &str = "<file>box.obj</file>";
const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

#[test]
fn a_folder_stands_for_its_scene_files() {
    let files = Files::new(with(&project(RASTER), FILE, "<folder name=\"models\\ntg\"/>"));
    for name in ["b.obj", "a.nbo", "a.obj", "notes.txt"] {
        files.write(&format!("models/ntg/{name}"), TRIANGLE);
    }
    let loaded = files.load().expect("it loads");
    let names: Vec<_> = loaded.scenes[0].files.iter().map(|file| file.path.file_name().expect("a name")).collect();
    assert_eq!(names, ["a.nbo", "b.obj"], "of each model the best format");

    let missing = with(&project(RASTER), FILE, "<folder>modles</folder>");
    let files = Files::new(missing);
    files.write("models/a.obj", TRIANGLE);
    let problems = files.load().expect_err("there is no such folder").to_string();
    assert!(problems.contains("there is no folder") && problems.contains("models`; did you mean that?"), "{problems}");
}

#[test]
fn primitives_and_placements_of_both_dialects_are_read() {
    let today = r#"<SCALE x = 1.0 y=0.5 z = 1.0 />
        <geometry name = "Ball" type = "SPHERE" material="earth" SLICES=30 STACKS=20 >
            <TRANSLATE x =-2.5 y=0 z =0  /> <SCALE x=1 y=2 z=2 /> </geometry>
        <geometry name = "Crate" type = "BOX"><TRANSLATE x =2.5 y=0 z =0 /><ROTATE x=0 y=1 z=0 w=90 /></geometry>
        <geometry name = "axis" type = "AXIS" />"#;
    let scene = good(&with(&project(RASTER), FILE, today)).scenes.swap_remove(0);
    assert_eq!(scene.shapes.len(), 3);
    assert_eq!(scene.shapes[2].kind, ShapeKind::Axis);
    let unit =
        with(&with(&project(RASTER), FILE, today), "<scene name=\"Main\">", "<scene name=\"Main\" param=\"UNITIZE\">");
    let unit = good(&unit);
    assert!(
        unit.problems.to_string().contains("axes of a scene that is made unit size are not drawn"),
        "{}",
        unit.problems
    );
    assert_eq!(unit.scenes[0].shapes.len(), 2);
    assert_eq!(scene.shapes[0].kind, ShapeKind::Sphere { slices: 30, stacks: 20 });
    assert_eq!((scene.shapes[0].material.as_str(), scene.shapes[1].material.as_str()), ("earth", "__Light Grey"));
    let turned = scene.shapes[1].place.matrix().transform_point3(Vec3::Z);
    assert!(turned.distance(Vec3::new(3.5, 0.0, 0.0)) < 1e-6, "{turned}");

    let loaded = scene.load(&LoadOptions::default(), &|_| {}).expect("it needs no file");
    let options = scene.build_options(BuildOptions::default());
    let (built, _) = RenderScene::build(loaded, &options).expect("it is small");
    let corner =
        |measure: fn(Vec3, Vec3) -> Vec3, start: Vec3| built.geometry.positions.iter().copied().fold(start, measure);
    let (low, high) = (corner(Vec3::min, Vec3::INFINITY), corner(Vec3::max, Vec3::NEG_INFINITY));
    // The ball spans -3.5 to -1.5 along x. It has twice the height and depth, and the scene then halves the height. The box has half
    // the height of 2.
    assert!(low.distance(Vec3::new(-3.5, -1.0, -2.0)) < 0.02 && high.distance(Vec3::new(3.5, 1.0, 2.0)) < 0.02);
    assert!(built.geometry.normals.iter().all(|normal| (normal.length() - 1.0).abs() < 1e-5));

    let of_2014 = with(
        &project(RASTER),
        "<scene name=\"Main\">",
        "<scene name=\"Main\" scaleY = 0.5 scaleX=2.0 scaleZ=1.0 transX=7>",
    );
    let scene = good(&of_2014).scenes.swap_remove(0);
    let expected = Mat4::from_translation(Vec3::new(7.0, 0.0, 0.0)) * Mat4::from_scale(Vec3::new(2.0, 0.5, 1.0));
    assert_eq!(scene.place.matrix(), expected);
}

const EXACT: &str = "<SCALE x=2 y=-2 z=2/>
    <geometry name=a type=SPHERE exact=true material=earth><SCALE x=0.5 y=0.5 z=0.5/><TRANSLATE x=1 y=2 z=3/></geometry>
    <geometry name=b type=sphere exact=TRUE material=earth><ROTATE x=1 y=1 z=0 w=33/></geometry>";

fn built(text: &str) -> RenderScene {
    let scene = good(text).scenes.swap_remove(0);
    let loaded = scene.load(&LoadOptions::default(), &|_| {}).expect("it needs no file");
    let (built, warnings) = RenderScene::build(loaded, &scene.build_options(BuildOptions::default())).expect("small");
    assert!(!format!("{warnings:?}").contains("exact"), "{warnings:?}");
    built
}

#[test]
fn exact_spheres_are_placed_as_meshes_are() {
    let text = with(&project(RASTER), FILE, EXACT);
    let declared = good(&text).scenes.swap_remove(0);
    let place = declared.exact_sphere().expect("it has some").to_owned();
    assert!(place.contains("project.xml:"), "{place}");
    let spheres = built(&text).geometry.spheres;
    assert_eq!((spheres.len(), spheres[0].center, spheres[0].radius), (2, Vec3::new(2.0, -4.0, 6.0), 1.0));
    assert!(spheres[1].center == Vec3::ZERO && (spheres[1].radius - 2.0).abs() < 1e-6, "{:?}", spheres[1]);
    // The exact sphere must agree with a mesh at the same place.
    for param in ["NO_SWAP", "SWAP_YZ", "UNITIZE", "SWAP_YZ UNITIZE"] {
        let with_param = with(&text, "<scene name=\"Main\">", &format!("<scene name=\"Main\" param=\"{param}\">"));
        let spheres = built(&with_param).geometry.spheres;
        let mesh = built(&with_param.replace("exact=true", "").replace("exact=TRUE", "")).geometry;
        for vertex in &mesh.positions {
            let off = spheres.iter().map(|sphere| (vertex.distance(sphere.center) - sphere.radius).abs());
            // A mesh with ten slices is smaller than its sphere, and UNITIZE scales by the size of the mesh.
            let allowed = if param.contains("UNITIZE") { 0.04 } else { 1e-5 };
            let off = off.fold(f32::INFINITY, f32::min);
            assert!(off < allowed, "{param}: {spheres:?} {vertex} {off}");
        }
    }
}

#[test]
fn materials_of_a_scene_may_be_its_sky() {
    let boxes = "<geometry name=a type=BOX material=blue/><geometry name=b type=BOX material=earth/>
        <sky material=\"blue\"/>";
    let scene = built(&with(&project(RASTER), FILE, boxes));
    let named = |name: &str| scene.materials.iter().find(|material| material.name == name).expect("it is there").sky;
    assert_eq!((named("blue"), named("earth")), (true, false));
    let ids: Vec<bool> = (0..24).map(|id| scene.geometry.sky.contains(id)).collect();
    let of_material = |id: u32| scene.materials[scene.geometry.material_of(id) as usize].sky;
    assert_eq!(ids, (0..24).map(of_material).collect::<Vec<_>>());
    assert_eq!(ids.iter().filter(|sky| **sky).count(), 12);
    let mut both = scene.clone();
    both.append(scene.clone());
    assert!((0..48).all(|id| both.geometry.sky.contains(id) == ids[id as usize % 24]), "of scenes together");
    let all = built(&with(&project(RASTER), FILE, &boxes.replace("\"blue\"/>", "\"*\"/>")));
    assert_eq!(all.geometry.sky.as_slice(), [[0, 24]]);
    one_error(
        &with(&project(RASTER), FILE, "<sky material=\"@b*\"/>"),
        "`b*` is not a material's name",
        "one whole name",
    );
    one_error(&with(&project(RASTER), FILE, "@<sky/>"), "<sky> lacks `material`", "material=");
    let other = good(&with(&project(RASTER), FILE, &boxes.replace("\"blue\"/>", "\"Blue\"/>"))).scenes.swap_remove(0);
    let warnings = other.load(&LoadOptions::default(), &|_| {}).expect("it needs no file").warnings;
    assert!(format!("{warnings:?}").contains("skies of a material that the scene does not have"), "{warnings:?}");
}

#[test]
fn exact_spheres_stay_spheres_or_are_refused_with_their_place() {
    let wrong =
        |old: &str, new: &str, message: &str, help: &str| one_error(&with(&project(RASTER), old, new), message, help);
    let scaled = |by: &str| format!("an exact sphere is scaled by {by} along the axes");
    let shape = |inside: &str| format!("@<geometry name=\"g\" type=\"SPHERE\" exact=\"true\">{inside}</geometry>");
    wrong(FILE, &shape("<SCALE x=1 y=2 z=1/>"), &scaled("1, 2 and 1"), "without exact=\"true\"");
    wrong(FILE, &shape("<SCALE x=0 y=0 z=0/>"), &scaled("0, 0 and 0"), "above 0");
    let inside = format!("@<scene name=\"Main\"><SCALE x=1 y=1 z=3/>{}", shape("").replace('@', ""));
    wrong("<scene name=\"Main\"><file>box.obj</file>", &inside, &scaled("1, 1 and 3"), "along all three");
    wrong(FILE, "<geometry type=\"BOX\" exact=\"@true\"/>", "a BOX is no exact sphere", "SPHERE");
    wrong(FILE, "<geometry type=SPHERE exact=\"@maybe\"/>", "`maybe` is neither true nor false", "true");
    let parts = good(&with(&project(RASTER), FILE, "<geometry type=SPHERE exact=true slices=9/>"));
    assert!(parts.problems.to_string().contains("an exact sphere has no parts"), "{}", parts.problems);
    let not = good(&with(&project(RASTER), FILE, "<geometry type=SPHERE exact=false slices=9/>"));
    assert_eq!(
        (not.scenes[0].shapes[0].kind, not.scenes[0].exact_sphere()),
        (ShapeKind::Sphere { slices: 9, stacks: 10 }, None)
    );
}

#[test]
fn thesis_fidelity_refuses_exact_spheres_by_their_place() {
    let plan = |text: &str, fidelity| {
        let files = Files::new(text);
        files.write("box.obj", TRIANGLE);
        let settings = Settings { fidelity, show: vec!["color".to_owned()], ..Settings::default() };
        Plan::new(files.load().expect("it loads"), settings)
    };
    let text = with(&project(RASTER), FILE, EXACT);
    let refused = plan(&text, Fidelity::Thesis).expect_err("triangles only");
    assert!(refused.message.contains("project.xml:") && refused.message.contains("thesis fidelity"), "{refused:?}");
    assert!(refused.help.is_some_and(|help| help.contains("corrected") && help.contains("exact=")));
    assert!(plan(&text, Fidelity::Corrected).is_ok());
    assert!(plan(&project(RASTER), Fidelity::Thesis).is_ok(), "control");
}

#[test]
fn words_that_the_engine_overlooks_do_not_stop_a_scene() {
    let scene = |param: &str| good(&with(&project(RASTER), "<scene name=\"Main\">", param));
    let quiet = scene("<scene name=\"Main\" param=\"NO_SWAP\">");
    assert!(!quiet.scenes[0].swap_yz && quiet.problems.0.iter().all(|problem| problem.severity == Severity::Note));
    let warned = scene("<scene name=\"Main\" param=\"SCALE SWAP_YZ\">");
    assert!(warned.scenes[0].swap_yz);
    assert!(warned.problems.to_string().contains("`SCALE` is not a parameter of scenes"), "{}", warned.problems);
}

#[test]
fn curly_quotes_are_read_with_a_warning() {
    let text =
        with(&project(RASTER), "<scene name=\"Main\">", "<scene name=\u{201c}Main\u{201d} type=\u{2018}Scene\u{2019}>");
    let loaded = good(&text);
    assert_eq!(loaded.scenes[0].name, "Main");
    let said = loaded.problems.to_string();
    assert!(said.matches("are curly").count() == 2 && said.contains("valid: straight quotes"), "{said}");
    let open = with(&project(RASTER), "<scene name=\"Main\">", "<scene name=\u{201c}Main>");
    assert!(bad(&open).to_string().contains("never closed"));
}

#[test]
fn orthographic_cameras_and_angles_are_read_and_written() {
    let camera = r#"<projection TYPE="ORTHO" LEFT=-8 RIGHT=8 BOTTOM=-2 TOP="4" NEAR=-1 FAR=10 /></camera>"#;
    let loaded = good(&with(&project(RASTER), "</camera>", camera));
    let seen = Orthographic { left: -8.0, right: 8.0, bottom: -2.0, top: 4.0 };
    assert_eq!((loaded.cameras[0].orthographic, loaded.cameras[0].near), (Some(seen), -1.0));
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("written.xml");
    loaded.write(&path).expect("it can be written");
    let again = curitiba_pipeline::project::load(&path).expect("it loads");
    assert_eq!((again.cameras[0].orthographic, again.cameras[0].far), (Some(seen), 10.0));

    let view = "<view x=\"0\" y=\"0\" z=\"-2\" />";
    let angles = |angles: &str| good(&with(&project(RASTER), view, angles)).cameras[0].direction;
    let near = |found: Vec3, expected: [f32; 3]| assert!(found.distance(Vec3::from(expected)) < 1e-6, "{found}");
    near(angles(""), [0.0, 0.0, -1.0]);
    near(angles("<ZX_ANGLE value=\"1.5707963\" />"), [1.0, 0.0, 0.0]);
    near(angles("<ELEVATION_ANGLE value=\"0.5235988\" />"), [0.0, 0.5, -0.866_025_4]);
}

#[test]
fn scenes_with_primitives_and_placements_are_written_to_the_bit() {
    let place = "<TRANSLATE x=0.1 y=-3 z=1e-7 /><ROTATE x=1 y=2 z=3 w=33.3 /><SCALE x=0.3 y=7 z=-1 /><TRANSFORM_ORDER value=\"S_R_T\" />";
    let shapes = format!(
        "{place}<geometry name=\"a\" type=GRID divisions=3 length=2.7>{place}</geometry><geometry type=BOX material=m />\
         <geometry name=\"s\" type=SQUARE /><geometry name=\"b\" type=SPHERE slices=5 stacks=4 /><geometry name=\"x\" type=AXIS>{place}</geometry>"
    );
    let raster = with(RASTER, "<scene>Main</scene>", "<scene>Main</scene><scene>Eye</scene>");
    let loaded = good(&with(&project(&raster), FILE, &shapes));
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("written.xml");
    loaded.write(&path).expect("it can be written");
    let again = curitiba_pipeline::project::load(&path).expect("it loads");
    assert_eq!(again.scenes[0].shapes, loaded.scenes[0].shapes);
    assert_eq!(again.scenes[0].place, loaded.scenes[0].place);
    assert_eq!(again.scenes[0].shapes.len(), 5);
    let PassKind::Raster(drawn) = &again.pipelines[0].passes[0].kind else { panic!("it draws") };
    assert_eq!(drawn.frusta, [0]);
}

#[test]
fn scenes_of_a_project_with_errors_are_known_and_missing_files_name_the_nearest() {
    let broken = with(&project(RASTER), "<view x=\"0\"", "<view x=\"zero\"");
    let files = Files::new(broken);
    files.write("bax.obj", TRIANGLE);
    files.load().expect_err("the view is wrong");
    let scenes = declared_scenes(&files.path("project.xml"));
    let main = scenes.iter().find(|scene| scene.name == "Main").expect("it is declared");
    let error = main.load(&LoadOptions::default(), &|_| {}).expect_err("the file is missing").to_string();
    assert!(error.contains("box.obj: there is no such file") && error.contains("bax.obj`; did you mean"), "{error}");
}
