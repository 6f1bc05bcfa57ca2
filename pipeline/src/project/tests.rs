use super::*;

/// Loads a project that consists of its file and the library `p.mlib`.
fn loaded(project: &str, library: &str) -> Result<Project, Problems> {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("p.xml"), project).expect("written");
    std::fs::write(folder.path().join("p.mlib"), library).expect("written");
    load(&folder.path().join("p.xml"))
}

#[test]
fn named_numbers_that_are_not_finite_are_refused() {
    let project = r#"<project name="p" width="8" height="8"><assets><attributes>
<attribute name="GAIN" type="PASS" data="FLOAT" value="nan"/>
<attribute name="DEPTH" type="PASS" data="FLOAT" value="1"/>
<attribute name="TONE" type="RENDERER" data="FLOAT" value="1e99"/>
<attribute name="OTHER" type="LIGHT" data="FLOAT" value="inf"/>
</attributes><materialLibs><materialLib filename="p.mlib"/></materialLibs></assets>
<pipelines><pipeline name="p" default="true"><pass class="quad" name="q"><DEPTH value="-inf"/></pass></pipeline></pipelines></project>"#;
    let problems = loaded(project, r#"<materialLib name="L"></materialLib>"#).expect_err("it is refused");
    let messages: Vec<&str> = problems.0.iter().map(|problem| problem.message.as_str()).collect();
    for value in ["nan", "1e99", "-inf"] {
        assert!(messages.contains(&format!("`{value}` is not a finite number").as_str()), "{value}: {messages:?}");
    }
    assert!(!messages.contains(&"`inf` is not a finite number"), "what is not read is not checked: {messages:?}");
}

/// As in scene files, which name their textures and libraries.
#[cfg(unix)]
#[test]
fn paths_of_projects_find_names_of_older_systems() {
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().expect("a folder");
    let scene = folder.path().join(std::ffi::OsStr::from_bytes(b"\xC1gua.obj"));
    let project = folder.path().join("p.xml");
    std::fs::write(&scene, "").expect("written");
    let text = r#"<project name="p"><assets><scenes><scene name="S"><file>água.obj</file></scene></scenes></assets></project>"#;
    std::fs::write(&project, text).expect("written");
    let found: Vec<PathBuf> = declared_scenes(&project).remove(0).files.into_iter().map(|file| file.path).collect();
    assert_eq!(found, [scene]);
}

#[cfg(feature = "glsl")]
#[test]
fn sizes_of_buffers_are_exact() {
    let library = r#"<materialLib name="L">
<textures><texture name="noise"><WIDTH value="8"/><HEIGHT value="8"/><CONTENT value="RANDOM_UNIFORM"/></texture></textures>
<buffers><buffer name="whole"><SIZE value="400320048"/></buffer>
<buffer name="product"><DIM x="16777217" y="1" z="1"/><structure><field value="VEC4"/></structure></buffer></buffers></materialLib>"#;
    let project = r#"<project name="p" width="8" height="8"><assets>
<materialLibs><materialLib filename="p.mlib"/></materialLibs></assets><pipelines><pipeline name="p" default="true">
<pass class="quad" name="show"><texture name="noise" fromLibrary="L"/></pass></pipeline></pipelines></project>"#;
    let project = loaded(project, library).unwrap_or_else(|problems| panic!("{problems}"));
    let bytes = |name: &str| project.targets.iter().find(|target| target.name == name).and_then(|target| target.buffer);
    assert_eq!((bytes("whole"), bytes("product")), (Some(400_320_048), Some(16 * 16_777_217)));
}
