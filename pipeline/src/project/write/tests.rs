use super::*;
use crate::project;
use glam::DVec3;

/// The projects folder of the repository; `None` in the packaged crate, which does not contain it.
fn shipped() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../xml_projects");
    folder.is_dir().then_some(folder)
}

/// A text of a project's contents, without the paths of its files, which differ between copies.
fn contents(project: &Project) -> String {
    let mut project = project.clone();
    (project.path, project.source) = (PathBuf::new(), PathBuf::new());
    project.problems = crate::diagnostic::Problems::default();
    project.scenes.iter_mut().for_each(|scene| scene.exact = None);
    for file in project.scenes.iter_mut().flat_map(|scene| &mut scene.files) {
        file.path = std::fs::canonicalize(&file.path).unwrap_or_else(|_| file.path.clone());
        file.place.clear();
    }
    for pass in project.pipelines.iter_mut().flat_map(|pipeline| &mut pipeline.passes) {
        pass.place.clear();
    }
    // A project does not list libraries without targets, and the order of targets may differ if there are several libraries.
    let mut targets: Vec<_> = project.targets.iter().map(|target| format!("{target:?}")).collect();
    targets.sort();
    format!("{project:#?}\n{targets:#?}")
}

#[track_caller]
fn comes_back(project: &Project) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("written.xml");
    let files = project.write(&path).expect("it can be written");
    assert_eq!(files.first(), Some(&path));
    let read = project::load(&path).unwrap_or_else(|problems| panic!("{}:\n{problems}", project.path.display()));
    let remarks: Vec<_> = read.problems.0.iter().filter(|p| !p.message.contains("stands at the origin")).collect();
    assert!(remarks.is_empty(), "{}: {remarks:?}", project.path.display());
    assert_eq!(contents(&read), contents(project), "{}", project.path.display());
}

#[test]
fn the_shipped_projects_are_read_as_they_were_written() {
    let Some(projects) = shipped() else {
        println!("skipped: the repository's projects are not here");
        return;
    };
    let mut count = 0;
    for folder in ["", "raster", "glass", "camera"] {
        for entry in std::fs::read_dir(projects.join(folder)).expect("the folder") {
            let path = entry.expect("an entry").path();
            if path.extension().is_some_and(|extension| extension == "xml") {
                comes_back(&project::load(&path).expect("a valid project"));
                count += 1;
            }
        }
    }
    assert_eq!(count, 33);
}

fn triangle(folder: &Path, name: &str, material: &str) -> PathBuf {
    let library = format!("newmtl {material}\nillum 4\nKd 0.5 0.5 0.5\n");
    std::fs::write(folder.join("m.mtl"), library).expect("a file");
    let path = folder.join(name);
    let text = format!("mtllib m.mtl\nv 0 0 0\nv 3 0.5 0\nv 0 1.7 1\nusemtl {material}\nf 1 2 3\n");
    std::fs::write(&path, text).expect("a file");
    path
}

#[test]
fn projects_made_of_scenes_are_read_as_they_were_written() {
    let folder = tempfile::tempdir().expect("a folder");
    // Characters with a meaning in XML, and a colon, which separates a library's name in a glass map.
    let file = triangle(folder.path(), "a & b <c>.obj", "glass:\"pane\" & co");
    let options = project::SceneOptions {
        look_from: Some(DVec3::new(0.1, 2.7, -9.3)),
        fov: Some(33.3),
        sun: Some(Vec3::new(0.3, 0.9, 0.1)),
        ..project::SceneOptions::default()
    };
    for options in [project::SceneOptions::default(), options] {
        let made = project::SceneProjects::new(std::slice::from_ref(&file), &options, Some([640, 480]), 1 << 30)
            .expect("a scene");
        comes_back(&made.project());
        for (_, project) in made.by_technique() {
            comes_back(&project);
        }
        for effects in ["none", "shadows", "ao", "glass", "shadows+ao", "shadows+glass", "ao+glass"] {
            let options = project::SceneOptions { effects: effects.parse().ok(), ..options.clone() };
            let made =
                project::SceneProjects::new(std::slice::from_ref(&file), &options, None, 1 << 30).expect("a scene");
            comes_back(&made.project());
        }
    }
}

#[test]
fn lights_of_scenes_are_read_as_they_were_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("lamps.gltf");
    std::fs::write(&path, project::from_scene::tests::LAMPS).expect("a file");
    let made = project::SceneProjects::new(&[path], &project::SceneOptions::default(), None, 1 << 30).expect("a scene");
    assert_eq!(made.project().lights.len(), 3);
    comes_back(&made.project());
}

#[test]
fn nothing_is_overwritten_and_what_the_format_cannot_hold_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let made = |material: &str, name: &str| {
        let file = triangle(folder.path(), name, material);
        project::open(&file, &project::SceneOptions::default(), None, 1 << 30).expect("a scene")
    };
    let path = folder.path().join("p.xml");
    std::fs::write(folder.path().join("p.mlib"), "mine").expect("a file");
    let error = made("a", "a.obj").write(&path).expect_err("the library's file is there").to_string();
    assert!(error.contains("p.mlib is there already"), "{error}");
    assert!(!path.exists(), "nothing was begun");
    std::fs::remove_file(folder.path().join("p.mlib")).expect("it was there");
    for (material, name) in [("two*stars", "a.obj"), ("a", "two  blanks.obj")] {
        let error = made(material, name).write(&path).expect_err(material).to_string();
        assert!(error.contains("cannot stand in a project file"), "{error}");
    }
    assert!(!path.exists() && !path.with_extension("mlib").exists());
    made("a", "a.obj").write(&path).expect("now it can");
}
