//! The layout of the crates: imports run down the floors listed here, no files import each other in a circle, and one
//! module opens files.

mod imports;

use imports::{Imports, Source};
use std::collections::BTreeMap;
use std::path::Path;

/// The rooms of a folder by floor, from the ground up. A room is a file or a folder, and imports only from rooms on lower
/// floors.
type Floors = [&'static [&'static str]];

/// The sources of each crate, and the least number of files expected there.
const CRATES: [(&str, usize); 6] =
    [("src", 60), ("pipeline/src", 130), ("passes/src", 150), ("cuda/src", 15), ("view/src", 25), ("python/src", 3)];

const OF_PIPELINE: &Floors = &[
    &["named", "paths", "diagnostic", "files", "guard", "memory", "progress", "pixel_samples"],
    &["color", "gbuffer", "glsl", "script"],
    &["image", "shared"],
    &["scene", "metrics", "device_quad"],
    &["square", "glass", "camera_programs"],
    &["programs"],
    &["raster_effects"],
    &["backend", "project"],
    &["kept_scenes"],
    &["plan"],
    &["executor"],
];
const OF_PASSES: &Floors = &[
    &["trace"],
    &["sampling", "reference"],
    &["effects"],
    &["raster", "adaptive"],
    &["cpu"],
    &["own"],
    &["wgpu_rays"],
    &["explain"],
    &["visibility"],
];
const OF_TRACE: &Floors = &[
    &["simd"],
    &["rounding"],
    &["ray"],
    &["tree"],
    &["origin", "build", "single", "spheres"],
    &["packet", "fan"],
    &["parallel"],
    &["tracer", "segments"],
    &["bvh", "reference", "recorder", "with_spheres", "erased"],
];

/// The floor (from the ground, 0) and the room of a module below `folder`; `None` for the folder itself.
fn floor(floors: &Floors, folder: &str, module: &str) -> Option<(usize, String)> {
    let rest = module.strip_prefix(folder)?.strip_prefix("::")?;
    let room = rest.split("::").next().unwrap_or(rest);
    let floor = floors.iter().position(|rooms| rooms.contains(&room));
    Some((
        floor.unwrap_or_else(|| panic!("`{room}` of `{folder}` is on no floor: add it to the list")),
        room.to_owned(),
    ))
}

/// The imports that do not run downwards, as `from -> to`.
fn upward(imports: &Imports, floors: &Floors, folder: &str) -> Vec<String> {
    let mut found = Vec::new();
    for (from, targets) in &imports.of {
        let Some((own_floor, own)) = floor(floors, folder, from) else { continue };
        for to in targets {
            let Some((other_floor, other)) = floor(floors, folder, to) else { continue };
            if own != other && other_floor >= own_floor {
                found.push(format!("{from} -> {to}"));
            }
        }
    }
    found
}

/// A cycle of files that import each other, if there is one.
fn circle(imports: &Imports) -> Option<Vec<String>> {
    fn visit(imports: &Imports, module: &str, path: &mut Vec<String>, done: &mut BTreeMap<String, bool>) -> bool {
        if let Some(finished) = done.get(module) {
            if !finished {
                path.push(module.to_owned());
            }
            return !finished;
        }
        done.insert(module.to_owned(), false);
        path.push(module.to_owned());
        for target in imports.of.get(module).into_iter().flatten() {
            if visit(imports, target, path, done) {
                return true;
            }
        }
        path.pop();
        done.insert(module.to_owned(), true);
        false
    }
    let mut done = BTreeMap::new();
    for module in imports.of.keys() {
        let mut path = Vec::new();
        if visit(imports, module, &mut path, &mut done) {
            let first = path.iter().position(|other| Some(other) == path.last()).unwrap_or(0);
            return Some(path[first..].to_vec());
        }
    }
    None
}

fn imports_of(folder: &str) -> Imports {
    let imports = Imports::of(&imports::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join(folder)));
    let files = imports.of.len();
    let arrows: usize = imports.of.values().map(|targets| targets.len()).sum();
    let (_, least) = CRATES.into_iter().find(|(name, _)| *name == folder).expect("a crate of the list");
    assert!(files >= least && arrows >= files, "{folder}: {files} files with {arrows} imports were read");
    imports
}

#[test]
fn imports_run_down_the_floors() {
    assert_eq!(upward(&imports_of("pipeline/src"), OF_PIPELINE, "crate"), [""; 0]);
    let passes = imports_of("passes/src");
    assert_eq!(upward(&passes, OF_PASSES, "crate"), [""; 0]);
    assert_eq!(upward(&passes, OF_TRACE, "crate::trace"), [""; 0]);
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    for (folder, _) in CRATES {
        assert_eq!(circle(&imports_of(folder)), None, "{folder}");
    }
}

/// Calls that open, create or rename a file.
const OPENING: [&str; 8] = [
    "File::open",
    "File::create",
    "OpenOptions",
    "fs::read(",
    "fs::read_to_string(",
    "fs::write(",
    "fs::rename(",
    "fs::copy(",
];

/// The lines of a file, except in tests, that open a file, as `module: line`. Files in `/proc` and `/sys` do not count, because the user
/// does not provide them.
fn opened(source: &Source) -> Vec<String> {
    let code = imports::code(&source.text);
    let opens = |line: &&str| OPENING.iter().any(|word| line.contains(word));
    let lines = code.lines().filter(opens).filter(|line| !line.contains("\"/proc/") && !line.contains("\"/sys/"));
    lines.map(|line| format!("{}: {}", source.module, line.trim())).collect()
}

/// One module opens all files, so that `--confine`, the check for regular files, and writing files whole apply to every file.
#[test]
fn one_module_opens_files() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (mut there, mut elsewhere) = (0, Vec::new());
    for (folder, _) in CRATES {
        for source in imports::read(&root.join(folder)) {
            let found = opened(&source);
            match folder == "pipeline/src" && source.module.starts_with("crate::files") {
                true => there += found.len(),
                false => elsewhere.extend(found),
            }
        }
    }
    assert_eq!(elsewhere, [""; 0]);
    // Control: the calls in that module are found.
    assert!(there >= 6, "{there}");
}

fn source(module: &str, text: &str) -> Source {
    Source { module: module.to_owned(), text: text.to_owned() }
}

/// Control: cases that the tests above would miss if names were not followed through re-exporting folders.
#[test]
fn upward_imports_and_circles_are_seen() {
    let files = [
        source("crate", "mod trace;"),
        source("crate::trace", "mod simd;\nmod tree;\npub(crate) use tree::{Leaf, Node as Inner};"),
        source("crate::trace::simd", "mod vector;\npub(crate) use vector::F8;"),
        source(
            "crate::trace::simd::vector",
            "use crate::trace::{Inner,\n    Leaf};\n/// See crate::trace::tree::leaf.\nstruct F8;",
        ),
        source("crate::trace::tree", "mod leaf;\nmod node;\npub use leaf::Leaf;\npub use node::Node;"),
        source("crate::trace::tree::leaf", "use super::node::Node;\nuse crate::trace::simd::F8;"),
        source(
            "crate::trace::tree::node",
            "fn f() { super::leaf::g() }\n#[cfg(test)]\nmod tests { use crate::trace::simd::F8; }",
        ),
    ];
    let imports = Imports::of(&files);
    let of = |module: &str| imports.of[module].iter().map(String::as_str).collect::<Vec<_>>();
    assert_eq!(of("crate::trace::simd::vector"), ["crate::trace::tree::leaf", "crate::trace::tree::node"]);
    assert_eq!(of("crate::trace::tree::leaf"), ["crate::trace::simd::vector", "crate::trace::tree::node"]);
    assert_eq!(of("crate::trace::tree::node"), ["crate::trace::tree::leaf"]);
    let floors: &Floors = &[&["simd"], &["tree"]];
    assert_eq!(
        upward(&imports, floors, "crate::trace"),
        [
            "crate::trace::simd::vector -> crate::trace::tree::leaf",
            "crate::trace::simd::vector -> crate::trace::tree::node",
        ]
    );
    assert!(circle(&imports).is_some_and(|circle| circle.len() == 3 || circle.len() == 4));
    let straight =
        Imports::of(&files[..5].iter().filter(|file| !file.module.ends_with("vector")).cloned().collect::<Vec<_>>());
    assert_eq!(circle(&straight), None);
}
