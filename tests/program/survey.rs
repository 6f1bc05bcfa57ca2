//! The results of the example `survey` for projects and scenes: for a folder made here, and for projects of others where they are available.

use std::path::{Path, PathBuf};
use std::process::Command;

fn root(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// File, outcome and reason of each row of the table.
fn survey(folder: &Path, arguments: &[&str]) -> Vec<[String; 3]> {
    // Examples lie in a folder beside that of the test programs.
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

/// Writes `xml_projects/SceneShadows.xml` with one text replaced, and its libraries, below a folder.
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

#[test]
fn a_page_shows_every_scene_or_says_why_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = tempfile::tempdir().expect("a folder");
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    std::fs::create_dir(folder.path().join("more")).expect("a folder");
    std::fs::write(folder.path().join("a <b>.obj"), triangle).expect("written");
    std::fs::write(folder.path().join("broken.obj"), "v 0 0 0\nf 1 2 3\n").expect("written");
    std::fs::write(folder.path().join("more/last.obj"), triangle).expect("written");
    let to = page.path().join("new");
    let rows = survey(folder.path(), &["--scenes", "--side", "32", "--page", to.to_str().expect("UTF-8")]);
    let outcomes: Vec<[&str; 2]> = rows.iter().map(|[name, outcome, _]| [&**name, &**outcome]).collect();
    assert_eq!(outcomes, [["a <b>.obj", "renders"], ["broken.obj", "refused"], ["more/last.obj", "renders"]]);
    let reason = &rows[1][2];
    assert!(reason.starts_with("broken.obj"), "{reason}");

    let text = std::fs::read_to_string(to.join("index.html")).expect("the page");
    assert!(text.contains("Of 3 scenes 2 render.") && text.contains("a &lt;b&gt;.obj") && !text.contains("a <b>.obj"));
    assert_eq!(text.matches("<img ").count(), 2);
    assert_eq!(text.matches(" is refused").count(), 1);
    let list = std::fs::read(to.join("files.json")).expect("the list");
    let list: serde_json::Value = serde_json::from_slice(&list).expect("JSON");
    assert_eq!((&list[1]["file"], &list[1]["outcome"]), (&"broken.obj".into(), &"refused".into()));
    assert_eq!((&list[1]["reason"], &list[1]["picture"]), (&reason.as_str().into(), &serde_json::Value::Null));
    assert_eq!((&list[2]["bytes"], &list[2]["picture"]), (&triangle.len().into(), &"pictures/3.png".into()));
    assert!(list[2]["milliseconds"].is_u64());

    let picture = |name: &str| image::open(to.join(name)).expect(name).into_rgb8();
    let (sheet, first) = (picture("sheet.png"), picture("pictures/1.png"));
    assert_eq!(sheet.dimensions(), (3 * 36 + 4, 36 + 4));
    assert!(first.pixels().any(|pixel| pixel != first.get_pixel(0, 0)), "the triangle is not seen");
    assert!(first.enumerate_pixels().all(|(x, y, pixel)| pixel == sheet.get_pixel(4 + x, 4 + y)));
    assert!(sheet.get_pixel(40 + 16, 4 + 16).0[0] > 2 * sheet.get_pixel(40 + 16, 4 + 2).0[0], "no cross");
    assert!(!to.join("pictures/2.png").exists());
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
    let documented = table(&text, "| project | outcome | why |\n|---|---|---|\n");
    assert_eq!(found.len(), documented.len());
    for ([file, outcome, reason], [documented, as_documented, why]) in found.iter().zip(documented) {
        assert_eq!([file, outcome], [documented, as_documented]);
        // The error is about the name that the document quotes.
        let about = why.split('`').nth(1).unwrap_or_default();
        assert!(reason.contains(about) && (outcome == "renders") == about.is_empty(), "{file}: {reason}");
    }
}

/// The rows of three columns below a heading of a document.
fn table<'a>(text: &'a str, heading: &str) -> Vec<[&'a str; 3]> {
    let table = text.split(heading).nth(1).expect("the table");
    let rows = table.lines().map_while(|line| line.strip_prefix("| ")?.strip_suffix('|'));
    rows.map(|row| {
        let mut cells = row.splitn(3, '|').map(str::trim);
        [(); 3].map(|()| cells.next().expect("three columns"))
    })
    .collect()
}

/// Heading of the table of the descendant's projects.
const DESCENDANT: &str = "| project of the descendant | outcome | why, or how |\n|---|---|---|\n";

#[test]
fn the_table_of_the_descendants_projects_has_as_many_as_the_text_says() {
    let text = std::fs::read_to_string(root("docs/projects.md")).expect("the document");
    let rows = table(&text, DESCENDANT);
    let count = |outcome: &str, how: &str| rows.iter().filter(|row| row[1] == outcome && row[2].contains(how)).count();
    let [renders, own, refused] = [count("renders", ""), count("renders", "own shaders"), count("refused", "")];
    assert_eq!(renders + refused, rows.len());
    assert!(rows.iter().all(|row| row[1] == "renders" || !row[2].is_empty()), "a reason for each that is refused");
    let (all, of) = (rows.len(), "projects of the engine's descendant");
    let sentence = format!("Of {all} {of} {renders} render, {own} of them with own shaders");
    assert!(text.contains(&sentence), "{sentence}");
}

/// `CURITIBA_TUTORIALS` names a checkout of the engine's descendant.
#[test]
fn the_projects_of_the_descendant_are_as_the_documents_say() {
    let Some(folder) = std::env::var_os("CURITIBA_TUTORIALS").map(PathBuf::from) else {
        println!("skipped: CURITIBA_TUTORIALS names no checkout");
        return;
    };
    let text = std::fs::read_to_string(root("docs/projects.md")).expect("the document");
    let documented = table(&text, DESCENDANT);
    let scene = root("xml_projects/3dsmodels/largoCamoes.cbo");
    let found = survey(&folder, &["--projects", "--stand-in", scene.to_str().expect("UTF-8")]);
    assert_eq!(found.len(), documented.len());
    for ([file, outcome, reason], [documented, as_documented, why]) in found.iter().zip(documented) {
        assert_eq!([file.strip_prefix("projects/").unwrap_or(file), outcome], [documented, as_documented]);
        // Which scene files a checkout lacks depends on how it was made.
        assert_eq!(reason.contains("own shaders"), why == "own shaders", "{file}: {reason}");
        assert!(reason.contains(why), "{file}: {reason}, not {why}");
    }
}
