//! Functions and files that documents name exist.

use std::collections::BTreeSet;
use std::path::Path;

/// Endings of the files whose words documents may name.
const SOURCES: [&str; 8] = ["rs", "cu", "cuh", "wgsl", "py", "sh", "toml", "html"];
/// Names that belong to other projects.
const FOREIGN: [&str; 1] = ["basisu_c_sys"];

/// The files of the checkout, as paths from its root. Build folders and hidden folders but `.ci` are left out.
fn files(folder: &Path, below: &str, found: &mut BTreeSet<String>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let entry = entry.expect("an entry");
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_left_out = name == "target" || (name.starts_with('.') && name != ".ci");
        if is_left_out || entry.file_type().expect("a type").is_symlink() {
            continue;
        }
        let path = format!("{below}{name}");
        if entry.path().is_dir() {
            files(&entry.path(), &format!("{path}/"), found);
        } else {
            found.insert(path);
        }
    }
}

/// The identifiers of a text.
fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|letter: char| !letter.is_ascii_alphanumeric() && letter != '_').filter(|word| !word.is_empty())
}

/// The code spans of a document outside blocks of code, each with its line.
fn spans(text: &str) -> Vec<(usize, &str)> {
    let mut is_block = false;
    let mut found = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        if line.trim_start().starts_with("```") {
            is_block = !is_block;
        } else if !is_block {
            found.extend(line.split('`').skip(1).step_by(2).map(|span| (number, span)));
        }
    }
    found
}

/// The identifier at the end of a path `module::name`, if it has three words or more: shorter ones may be attributes or plain words.
fn function(span: &str) -> Option<&str> {
    let name = span.rsplit("::").next().filter(|name| name.starts_with(|letter: char| letter.is_ascii_lowercase()))?;
    let is_name = span.chars().all(|letter| matches!(letter, 'a'..='z' | '0'..='9' | '_' | ':'));
    (is_name && name.split('_').filter(|word| !word.is_empty()).count() >= 3).then_some(name)
}

/// Whether a path has the ending of a source.
fn has_source_ending(path: &str) -> bool {
    path.rsplit_once('.').is_some_and(|(_, ending)| SOURCES.contains(&ending))
}

/// Whether a code span is the path of a source, from the root or from a folder of it.
fn is_source(span: &str) -> bool {
    let is_path = span.contains('/') && !span.starts_with('/') && !span.contains("..");
    let plain = span.chars().all(|letter| letter.is_ascii_alphanumeric() || matches!(letter, '/' | '_' | '-' | '.'));
    is_path && plain && has_source_ending(span)
}

#[test]
fn what_documents_name_exists() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut paths = BTreeSet::new();
    files(root, "", &mut paths);
    let read = |path: &String| String::from_utf8_lossy(&std::fs::read(root.join(path)).expect("readable")).into_owned();
    let texts: Vec<String> = paths.iter().filter(|path| has_source_ending(path)).map(read).collect();
    let known: BTreeSet<&str> = texts.iter().flat_map(|text| words(text)).chain(FOREIGN).collect();
    let has_name = |span: &str| function(span).is_none_or(|name| known.contains(name));
    let has_file =
        |span: &str| !is_source(span) || paths.iter().any(|path| path == span || path.ends_with(&format!("/{span}")));
    // Controls: names that no file has. They are composed here, since this file is a source too.
    assert!(!has_name(&["no", "function", "has", "this", "name"].join("_")) && !has_file("passes/src/no_such_file.rs"));

    // Lab notebooks describe the past, so they may name removed files.
    let is_page = |path: &str| path.starts_with("docs/") && !path.starts_with("docs/lab/") && path.ends_with(".md");
    let is_document = |path: &&String| *path == "README.md" || is_page(path);
    let (mut checked, mut wrong) = (0, Vec::new());
    for path in paths.iter().filter(is_document) {
        let text = read(path);
        for (line, span) in spans(&text) {
            checked += usize::from(function(span).is_some() || is_source(span));
            if !has_name(span) || !has_file(span) {
                wrong.push(format!("{path}:{line}: `{span}`"));
            }
        }
    }
    assert!(checked > 300, "{checked} names");
    assert!(wrong.is_empty(), "no file has these:\n{}", wrong.join("\n"));
}
