//! Setters of a renderer: after a setter the renderer shows the same as one that was opened with the new value, and
//! only the passes that depend on the value run.

use super::{bits, file, frame, opened, ran, settings, update};
use curitiba::Choice;
use curitiba::pipeline::executor::{ChangeError, RenderError, Renderer, Silent, StepKind};
use curitiba::pipeline::kept_scenes::KeptScenes;
use curitiba::pipeline::plan::{Preview, Settings};
use curitiba::pipeline::programs::Fidelity;
use curitiba::pipeline::project::Pose;
use glam::Vec3;
use std::path::{Path, PathBuf};

/// Sets a value on a renderer that has already rendered, and compares the picture with that of a renderer opened with the
/// value. Returns the passes that ran.
fn same_as_fresh(
    name: &str,
    set: impl FnOnce(&mut Renderer) -> Result<(), ChangeError>,
    fresh: impl FnOnce(Settings) -> Renderer,
) -> Vec<String> {
    let mut renderer = opened(name, settings(name));
    let before = frame(&mut renderer);
    set(&mut renderer).expect("it can be set");
    let after = update(&mut renderer);
    let passes = ran(&renderer).into_iter().map(str::to_owned).collect();
    let mut fresh = fresh(settings(name));
    let expected = frame(&mut fresh);
    assert!(bits(&after) == bits(&expected), "{name}: not the picture of a renderer that was opened so");
    // The comparison is meaningful: the new value changes the picture.
    assert!(bits(&before) != bits(&after), "{name}: nothing changed");
    assert_eq!(renderer.decisions(), fresh.decisions(), "{name}: the same is decided");
    // Nothing has been set since the last update, so no pass runs, and a whole frame is the same.
    assert!(bits(&update(&mut renderer)) == bits(&expected) && ran(&renderer).is_empty());
    assert!(bits(&frame(&mut renderer)) == bits(&expected), "{name}: a whole frame differs");
    passes
}

const ALL: [&str; 3] = ["pass1", "pass2", "pass5"];
pub const RAYS: [&str; 2] = ["pass2", "pass5"];

#[test]
fn the_camera_of_all_passes() {
    for name in ["SceneFinal", "SceneSSAO", "raster/SceneShadowMap"] {
        let passes = same_as_fresh(
            name,
            |renderer| renderer.set_camera(Some("Vidro")),
            |settings| opened(name, Settings { camera: Some("Vidro".to_owned()), ..settings }),
        );
        assert_eq!(passes, ALL, "{name}");
    }
}

#[test]
fn where_a_camera_stands_is_as_if_the_project_said_so() {
    let pose = Pose {
        position: Vec3::new(2.5, 12.0, -30.25),
        direction: Vec3::new(0.25, -0.5, 1.0),
        up: Vec3::new(0.0, 2.0, 0.25),
        fov_y: 50.0_f32.to_radians(),
    };
    let folder = Project::copied();
    let text = std::fs::read_to_string(file("SceneFinal")).expect("the project is there");
    let moved = text
        .replacen("fov=\"60.0\"", "fov=\"50.0\"", 1)
        .replacen("x=\"7.42\" y=\"18.61\" z=\"-38.62\"", "x=\"2.5\" y=\"12\" z=\"-30.25\"", 1)
        .replacen("x=\"0.31\" y=\"-0.36\" z=\"0.87\"", "x=\"0.25\" y=\"-0.5\" z=\"1\"", 1)
        .replacen("<up x=\"0.0\" y=\"1.0\" z=\"0.0\"/>", "<up x=\"0\" y=\"2\" z=\"0.25\"/>", 1);
    assert_eq!(moved.lines().zip(text.lines()).filter(|(a, b)| a != b).count(), 4);
    let path = folder.write("moved.xml", &moved);
    let passes = same_as_fresh(
        "SceneFinal",
        |renderer| renderer.set_pose("MainCamera", pose),
        |settings| curitiba::open(&path, settings, Choice::CPU, &mut Silent).expect("the project opens"),
    );
    assert_eq!(passes, ALL);
}

#[test]
fn the_light() {
    let (direction, color) = (Vec3::new(-0.5, -1.0, 0.25), Vec3::new(0.5, 0.75, 0.25));
    let folder = Project::copied();
    for (name, expected) in [("SceneFinal", &ALL), ("SceneShadows", &ALL)] {
        let text = std::fs::read_to_string(file(name)).expect("the project is there");
        let lit = text
            .replacen(
                "<direction x=\"0.597\" y=\"-0.390\" z=\"0.700\"/>",
                "<direction x=\"-0.5\" y=\"-1\" z=\"0.25\"/>",
                1,
            )
            .replacen("<color r=\"0.9\" g=\"0.9\" b=\"0.9\"/>", "<color r=\"0.5\" g=\"0.75\" b=\"0.25\"/>", 1);
        let path = folder.write("lit.xml", &lit);
        let passes = same_as_fresh(
            name,
            |renderer| renderer.set_light("sun", direction, color),
            |settings| curitiba::open(&path, settings, Choice::CPU, &mut Silent).expect("the project opens"),
        );
        assert_eq!(passes, *expected, "{name}");
    }
}

#[test]
fn the_size_larger_and_smaller_and_back() {
    for name in ["SceneFinal", "raster/SceneGTAO"] {
        for size in [[61, 97], [208, 130]] {
            let passes = same_as_fresh(
                name,
                |renderer| renderer.set_size(size),
                |settings| opened(name, Settings { size: Some(size), ..settings }),
            );
            assert_eq!(passes, ALL);
        }
        let mut renderer = opened(name, settings(name));
        let first = bits(&frame(&mut renderer));
        renderer.set_size([64, 64]).expect("a size");
        update(&mut renderer);
        renderer.set_size([112, 80]).expect("a size");
        assert!(bits(&update(&mut renderer)) == first, "{name}");
    }
}

#[test]
fn a_preview_is_a_smaller_picture_of_fewer_samples_and_leaves_nothing_behind() {
    for (name, set) in [("SceneFinal", "pass2.samples=4"), ("SceneShadows", ""), ("raster/SceneGTAO", "")] {
        let set: Vec<String> = [set].into_iter().filter(|set| !set.is_empty()).map(str::to_owned).collect();
        // Sides of 112 and 80 pixels, divided by 3 and rounded up.
        let passes = same_as_fresh(
            name,
            |renderer| renderer.set_preview(Some(Preview { divisor: 3, samples: 4 })),
            |settings| opened(name, Settings { size: Some([38, 27]), set, ..settings }),
        );
        assert_eq!(passes, ALL);
        let mut renderer = opened(name, settings(name));
        let first = bits(&frame(&mut renderer));
        renderer.set_preview(Some(Preview { divisor: 2, samples: 1 })).expect("a preview");
        let small = update(&mut renderer);
        assert_eq!([small.width, small.height], [56, 40]);
        assert_eq!((renderer.plan().whole_size(None), renderer.settings().size), ([112, 80], Some([112, 80])));
        renderer.set_preview(None).expect("no preview");
        assert!(bits(&update(&mut renderer)) == first, "{name}");
    }
}

#[test]
fn parameters_of_ray_passes_leave_the_g_buffer() {
    for (name, parameter, value) in [
        ("SceneSSAO", "radius", "2.5"),
        ("SceneFinal", "samples", "9"),
        ("SceneRefract", "index", "1.5"),
        ("SceneFinal", "sampler", "strata"),
    ] {
        let passes = same_as_fresh(
            name,
            |renderer| {
                renderer.set_camera(Some("Vidro"))?;
                renderer.set_parameter("pass2", parameter, value)
            },
            |mut settings| {
                settings.set.push(format!("pass2.{parameter}={value}"));
                opened(name, Settings { camera: Some("Vidro".to_owned()), ..settings })
            },
        );
        assert_eq!(passes, ALL, "the camera, too, was set");
        let mut renderer = opened(name, Settings { camera: Some("Vidro".to_owned()), ..settings(name) });
        frame(&mut renderer);
        renderer.set_parameter("pass2", parameter, value).expect("it can be set");
        update(&mut renderer);
        assert_eq!(ran(&renderer), RAYS, "{name} {parameter}");
    }
    let passes = same_as_fresh(
        "raster/SceneShadowMap",
        |renderer| renderer.set_parameter("pass2", "pcf", "3"),
        |settings| opened("raster/SceneShadowMap", Settings { set: vec!["pass2.pcf=3".to_owned()], ..settings }),
    );
    assert_eq!(passes, RAYS);
}

#[test]
fn a_format_is_of_what_writes_it() {
    let passes = same_as_fresh(
        "SceneFinal",
        |renderer| renderer.set_parameter("norm", "format", "RGBA8"),
        |mut settings| {
            settings.set.push("norm.format=RGBA8".to_owned());
            opened("SceneFinal", settings)
        },
    );
    assert_eq!(passes, ALL);
}

#[test]
fn the_seed_is_of_passes_that_draw_random_numbers() {
    let passes = same_as_fresh(
        "SceneSSAO",
        |renderer| {
            renderer.set_seed(7);
            Ok(())
        },
        |settings| opened("SceneSSAO", Settings { seed: 7, ..settings }),
    );
    assert_eq!(passes, RAYS);
    let mut renderer = opened("SceneShadows", settings("SceneShadows"));
    frame(&mut renderer);
    renderer.set_seed(7);
    update(&mut renderer);
    assert!(ran(&renderer).is_empty(), "hard shadows have no noise");
    // The light's disc, and facets of rough glass.
    let soft = ["pass2.sun=4", "pass2.sunsamples=4"];
    for (name, set) in [("SceneShadows", &soft[..]), ("glass/Frosted", &[])] {
        let mut settings = settings(name);
        settings.set = set.iter().map(|set| (*set).to_owned()).collect();
        let mut renderer = opened(name, settings);
        let before = bits(&frame(&mut renderer));
        renderer.set_seed(7);
        let after = bits(&update(&mut renderer));
        assert!(after != before, "{name}: the seed changes the picture");
        assert!(after == bits(&frame(&mut renderer)), "{name}");
    }
}

#[test]
fn a_pass_switched_off_lets_its_input_through() {
    for name in ["SceneShadows", "SceneSSAO", "SceneReflect", "SceneRefract", "SceneFinal", "raster/SceneGTAO"] {
        let mut renderer = opened(name, Settings { camera: Some("Vidro".to_owned()), ..settings(name) });
        let on = bits(&frame(&mut renderer));
        renderer.set_enabled("pass2", false).expect("it can be switched off");
        let off = bits(&update(&mut renderer));
        assert_eq!(ran(&renderer), RAYS, "{name}: the G-buffer stays");
        let fresh = Settings { camera: Some("Vidro".to_owned()), off: vec!["pass2".to_owned()], ..settings(name) };
        assert!(off == bits(&frame(&mut opened(name, fresh))), "{name}: not the picture of a renderer opened so");
        assert!(on != off, "{name}: the pass does something");
        // Without the pass its contribution is missing: light shares are 1, and glass has its own colour.
        if let "SceneShadows" | "SceneSSAO" | "raster/SceneGTAO" = name {
            let plain = Settings { camera: Some("Vidro".to_owned()), ..settings("SceneNoEffects") };
            assert!(off == bits(&frame(&mut opened("SceneNoEffects", plain))), "{name}: without it there is no effect");
        }
        renderer.set_enabled("pass2", true).expect("it can be switched on");
        assert!(bits(&update(&mut renderer)) == on, "{name}: not the picture from before");
        assert_eq!(ran(&renderer), RAYS, "{name}: the G-buffer is still there");
        // A G-buffer drawn in the meantime lacks the attachments that only this pass reads.
        renderer.set_enabled("pass2", false).expect("it can be switched off");
        renderer.set_camera(Some("MainCamera")).expect("a camera");
        update(&mut renderer);
        renderer.set_enabled("pass2", true).expect("it can be switched on");
        let expected = frame(&mut opened(name, Settings { camera: Some("MainCamera".to_owned()), ..settings(name) }));
        assert!(bits(&update(&mut renderer)) == bits(&expected), "{name}: after another camera");
    }
}

#[test]
fn the_last_pass_switched_off_leaves_the_window_black_and_what_is_read_cannot_be_switched_off() {
    let mut renderer = opened("SceneShadows", settings("SceneShadows"));
    frame(&mut renderer);
    renderer.set_enabled("pass5", false).expect("it can be switched off");
    let black = update(&mut renderer);
    assert!(black.pixels.iter().all(|pixel| *pixel == [0.0, 0.0, 0.0, 1.0]));
    renderer.set_enabled("pass5", true).expect("it can be switched on");
    let error = renderer.set_enabled("pass1", false).expect_err("the ray pass reads it").to_string();
    assert!(
        error.contains("`pass2` reads `Deferred Render Targets::pos`") && error.contains("switch `pass2` off"),
        "{error}"
    );
    let error = renderer.set_enabled("pass3", false).expect_err("there is none").to_string();
    assert!(error.contains("no pass `pass3`") && error.contains("pass2"), "{error}");
    // The renderer keeps its previous settings.
    assert!(bits(&update(&mut renderer)) == bits(&frame(&mut opened("SceneShadows", settings("SceneShadows")))));
}

#[test]
fn wrong_values_are_refused_and_change_nothing() {
    let mut renderer = opened("SceneSSAO", settings("SceneSSAO"));
    let before = bits(&frame(&mut renderer));
    let pose = renderer.project().pose("MainCamera").expect("the camera is there");
    let refused = [
        (renderer.set_camera(Some("Vidra")), "did you mean `Vidro`"),
        (renderer.set_pose("MainCamera", Pose { up: pose.direction, ..pose }), "parallel"),
        (renderer.set_pose("MainCamera", Pose { direction: Vec3::ZERO, ..pose }), "no direction"),
        (renderer.set_pose("MainCamera", Pose { fov_y: 4.0, ..pose }), "below π"),
        (renderer.set_pose("MainCamera", Pose { position: Vec3::NAN, ..pose }), "not finite"),
        (renderer.set_light("Moon", Vec3::X, Vec3::ONE), "no light `Moon`"),
        (renderer.set_light("Sun", Vec3::ZERO, Vec3::ONE), "no direction"),
        (renderer.set_light("Sun", Vec3::X, Vec3::INFINITY), "no colour"),
        (renderer.set_light("Sun", Vec3::X, Vec3::splat(2e9)), "-1e9 to 1e9"),
        (renderer.set_size([0, 5]), "1 to 65536"),
        (renderer.set_preview(Some(Preview { divisor: 0, samples: 1 })), "at least 1"),
        (renderer.set_preview(Some(Preview { divisor: 1, samples: 3 })), "a square number"),
        (renderer.set_parameter("pass2", "sample", "4"), "did you mean `samples`"),
        (renderer.set_parameter("pass2", "radius", "-1"), "above 0"),
        (renderer.set_parameter("pass9", "radius", "1"), "no pass `pass9`"),
    ];
    for (result, expected) in refused {
        let error = result.expect_err(expected).to_string();
        assert!(error.contains(expected), "{error}");
    }
    assert!(bits(&update(&mut renderer)) == before && ran(&renderer).is_empty());
}

/// A copy of the projects' folder with files that tests may change; the scene is that of the repository.
struct Project(tempfile::TempDir);

impl Project {
    fn copied() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let from = file("x").parent().expect("a folder").to_owned();
        for below in ["3dsmodels", "mlibs"] {
            copy(&from.join(below), &folder.path().join(below));
        }
        Self(folder)
    }

    fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, text).expect("a file");
        path
    }
}

#[test]
fn files_are_read_again_and_what_was_set_stays() {
    let folder = Project::copied();
    let text = std::fs::read_to_string(file("SceneShadows")).expect("the project is there");
    let path = folder.write("project.xml", &text);
    let open = |settings| curitiba::open(&path, settings, Choice::CPU, &mut Silent).expect("the project opens");
    let mut renderer = open(settings("SceneShadows"));
    renderer.set_light("Sun", Vec3::new(-0.5, -1.0, 0.25), Vec3::ONE).expect("a light");
    let before = bits(&update(&mut renderer));
    // Without changes, everything is read and rendered again, with the same result.
    renderer.reload().expect("the project is there");
    assert!(bits(&update(&mut renderer)) == before);
    assert_eq!(ran(&renderer), ALL);
    // The file has another camera; the light that was set is kept.
    folder.write("project.xml", &text.replacen("fov=\"60.0\"", "fov=\"40.0\"", 1));
    assert!(bits(&update(&mut renderer)) == before, "nobody asked to read files again");
    renderer.reload().expect("the project is there");
    let after = bits(&update(&mut renderer));
    let mut fresh = open(settings("SceneShadows"));
    fresh.set_light("Sun", Vec3::new(-0.5, -1.0, 0.25), Vec3::ONE).expect("a light");
    assert!(after == bits(&update(&mut fresh)) && after != before);
    // A broken project is refused; a broken scene makes one frame fail.
    folder.write("project.xml", "<project");
    assert!(matches!(renderer.reload(), Err(ChangeError::Source(_))));
    folder.write("project.xml", &text);
    let scene = folder.0.path().join("3dsmodels/largoCamoes.cbo");
    let whole = std::fs::read(&scene).expect("the scene is there");
    std::fs::write(&scene, &whole[..100]).expect("a file");
    renderer.reload().expect("the project is there");
    assert!(matches!(renderer.update(&mut Silent), Err(RenderError::Scene { .. })));
    assert!(bits(&frame(&mut renderer)) == after, "what was there is shown on");
    std::fs::write(&scene, &whole).expect("a file");
    renderer.reload().expect("the project is there");
    assert!(bits(&update(&mut renderer)) == before);
}

#[test]
fn a_project_that_is_read_again_may_have_more_targets_and_fewer() {
    let folder = Project::copied();
    let project = std::fs::read_to_string(file("SceneShadows")).expect("the project is there");
    let path = folder.write("project.xml", &project);
    let library = folder.0.path().join("mlibs/DeferredRenderTargets.mlib");
    let few = std::fs::read_to_string(&library).expect("the library is there");
    let target = |name: &str| {
        let channel = format!(r#"<color name="{name}" internalFormat="RGBA8"/>"#);
        format!(r#"<rendertarget name="{name}"><size width="8" height="8"/><colors>{channel}</colors></rendertarget>"#)
    };
    let many = few.replacen("<rendertargets>", &format!("<rendertargets>{}", target("first")), 1);
    let many = many.replacen("</rendertargets>", &format!("{}</rendertargets>", target("last")), 1);
    let mut renderer =
        curitiba::open(&path, settings("SceneShadows"), Choice::CPU, &mut Silent).expect("the project opens");
    let before = bits(&frame(&mut renderer));
    let count = renderer.plan().targets.len();
    for (text, targets) in [(&many, count + 2), (&few, count)] {
        std::fs::write(&library, text).expect("a file");
        renderer.reload().expect("the project is there");
        assert!(bits(&update(&mut renderer)) == before);
        assert_eq!(renderer.plan().targets.len(), targets);
    }
}

#[test]
fn scenes_that_are_kept_are_read_once_for_all_that_need_the_same_of_them() {
    let folder = Project::copied();
    let path =
        |name: &str| folder.write(&format!("{name}.xml"), &std::fs::read_to_string(file(name)).expect("it is there"));
    let [shadows, refraction] = ["SceneShadows", "SceneRefract"].map(path);
    let open = |path: &Path, settings| curitiba::open(path, settings, Choice::CPU, &mut Silent);
    let small = || Settings { size: Some([112, 80]), ..Settings::default() };
    let kept = Settings { scenes: KeptScenes::shared(), ..small() };
    let loads = |renderer: &Renderer| {
        let rows = renderer.timeline().rows.iter().filter(|row| row.kind == StepKind::Load);
        rows.map(|row| row.note.contains("kept by an earlier renderer")).collect::<Vec<_>>()
    };
    let mut first = open(&shadows, kept.clone()).expect("the project opens");
    assert_eq!(loads(&first), [false]);
    let [of_shadows, of_refraction] =
        [&shadows, &refraction].map(|path| bits(&frame(&mut open(path, small()).expect("the project opens"))));
    let warned = first.warnings().groups().len();
    // The scene file is missing from here on.
    let scene = folder.0.path().join("3dsmodels/largoCamoes.cbo");
    let whole = std::fs::read(&scene).expect("the scene is there");
    std::fs::remove_file(&scene).expect("a file");
    let mut second = open(&shadows, kept.clone()).expect("the scene is kept");
    assert!(bits(&frame(&mut first)) == of_shadows && bits(&frame(&mut second)) == of_shadows);
    assert_eq!((loads(&second), second.warnings().groups().len()), (vec![true], warned));
    let mut other = open(&refraction, kept.clone()).expect("another project of the scene");
    assert!(bits(&frame(&mut other)) == of_refraction);
    // Opening reads the file if the settings do not keep scenes, or if they need other parts of the scene.
    assert!(open(&shadows, small()).is_err());
    assert!(open(&shadows, Settings { fidelity: Fidelity::Thesis, ..kept.clone() }).is_err());
    // An explicit reload reads the file as well.
    second.reload().expect("the project is there");
    assert!(matches!(second.update(&mut Silent), Err(RenderError::Scene { .. })));
    assert!(open(&shadows, kept).is_err());
    std::fs::write(&scene, &whole).expect("a file");
    second.reload().expect("the project is there");
    assert!(bits(&update(&mut second)) == of_shadows);
}

#[test]
fn a_project_made_from_a_scene_is_made_again_for_another_size() {
    let scene = file("x").with_file_name("3dsmodels").join("largoCamoes.cbo");
    let settings = |size| Settings { size: Some(size), set: vec!["pass2.samples=4".to_owned()], ..Settings::default() };
    let open = |size| curitiba::open(&scene, settings(size), Choice::CPU, &mut Silent);
    let mut renderer = open([96, 64]).expect("the scene opens");
    frame(&mut renderer);
    renderer.set_size([40, 90]).expect("a size");
    let expected = frame(&mut open([40, 90]).expect("the scene opens"));
    assert!(bits(&update(&mut renderer)) == bits(&expected));
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir(to).expect("a folder");
    for entry in std::fs::read_dir(from).expect("a folder").flatten() {
        let to = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &to);
        } else {
            std::fs::copy(entry.path(), to).expect("a file");
        }
    }
}
