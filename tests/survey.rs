//! What the example `survey` says of projects: those of a folder made here, and those of others, where they can be had.

use std::path::{Path, PathBuf};
use std::process::Command;

fn root(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// File, outcome and reason of each row of the table.
fn survey(folder: &Path, arguments: &[&str]) -> Vec<[String; 3]> {
    // Examples lie beside the folder of the test programs.
    let test = std::env::current_exe().expect("the test knows its path");
    let program = test.parent().and_then(Path::parent).expect("target/PROFILE/deps").join("examples/survey");
    let output = Command::new(&program)
        .arg(folder)
        .args(arguments)
        .output()
        .expect("`cargo test` without names of targets, or `cargo build --examples`, builds it");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let printed = String::from_utf8(output.stdout).expect("UTF-8");
    let rows = printed.lines().filter_map(|line| line.strip_prefix("| ")?.strip_suffix(" |")).skip(1);
    rows.map(|row| {
        let mut cells = row.splitn(3, " | ").map(|cell| cell.trim().to_owned());
        [(); 3].map(|()| cells.next().expect("three columns"))
    })
    .collect()
}

/// `xml_projects/SceneShadows.xml` with other text in a place, and its libraries, below a folder.
fn project(folder: &Path, name: &str, from: &str, to: &str) {
    let text = std::fs::read_to_string(root("xml_projects/SceneShadows.xml")).expect("it is there");
    assert!(text.contains(from), "{from}");
    std::fs::create_dir_all(folder.join("mlibs")).expect("a folder");
    for library in ["DeferredRenderTargets.mlib", "optixTest.mlib"] {
        std::fs::copy(root("xml_projects/mlibs").join(library), folder.join("mlibs").join(library)).expect("copied");
    }
    std::fs::write(folder.join(name), text.replace(from, to)).expect("written");
}

#[test]
fn a_scene_that_is_not_there_has_a_stand_in_if_one_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    project(folder.path(), "lacks.xml", r"3dsmodels\largoCamoes.cbo", "models/none.obj");
    project(folder.path(), "wrong.xml", "<camera>MainCamera</camera>", "<camera>MineCamera</camera>");
    let scene = root("xml_projects/3dsmodels/largoCamoes.cbo");
    let alone = survey(folder.path(), &[]);
    let with = survey(folder.path(), &["--stand-in", scene.to_str().expect("UTF-8")]);
    assert_eq!([alone.len(), with.len()], [2, 2], "{alone:?} {with:?}");
    assert_eq!([&alone[0][0], &alone[0][1]], ["lacks.xml", "refused"], "{alone:?}");
    assert!(alone[0][2].starts_with("lacks.xml:") && alone[0][2].contains("models/none.obj"), "{alone:?}");
    assert_eq!(with[0], ["lacks.xml", "renders", "scene files that are not there: 1"]);
    for [name, outcome, reason] in [&alone[1], &with[1]] {
        assert_eq!([name, outcome], ["wrong.xml", "refused"]);
        let (place, message) = reason.split_once(": ").expect("a place");
        let place: Vec<&str> = place.split(':').collect();
        assert!(matches!(place[..], ["wrong.xml", line, column] if line != "0" && column != "0"), "{reason}");
        assert!(message.contains("MineCamera"), "{reason}");
    }
}

/// `CURITIBA_PROJECTS` names the projects of 2014.
#[test]
fn the_projects_of_2014_are_as_the_documents_say() {
    let Some(folder) = std::env::var_os("CURITIBA_PROJECTS").map(PathBuf::from) else {
        println!("skipped: CURITIBA_PROJECTS names no folder");
        return;
    };
    let scene = root("xml_projects/3dsmodels/largoCamoes.cbo");
    let found = survey(&folder, &["--projects", "--stand-in", scene.to_str().expect("UTF-8")]);
    let text = std::fs::read_to_string(root("docs/projects.md")).expect("the document");
    let table = text.split("| project | outcome | why |\n|---|---|---|\n").nth(1).expect("the table");
    let documented: Vec<[&str; 3]> = table
        .lines()
        .map_while(|line| line.strip_prefix("| ")?.strip_suffix('|'))
        .map(|row| {
            let mut cells = row.splitn(3, '|').map(str::trim);
            [(); 3].map(|()| cells.next().expect("three columns"))
        })
        .collect();
    assert_eq!(found.len(), documented.len());
    for ([file, outcome, reason], [documented, as_documented, why]) in found.iter().zip(documented) {
        assert_eq!([file, outcome], [documented, as_documented]);
        // The name that the document quotes is what the error is about.
        let about = why.split('`').nth(1).unwrap_or_default();
        assert!(reason.contains(about) && (outcome == "renders") == about.is_empty(), "{file}: {reason}");
    }
}
