//! The imports of each file, read from its text: `use` declarations, and paths that start with `crate` or `super`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// A source file, with the path of its module.
#[derive(Clone)]
pub struct Source {
    pub module: String,
    pub text: String,
}

/// The files that each file imports. A folder's `mod.rs` re-exports names: an import of such a name is an import of the
/// file that defines it.
pub struct Imports {
    pub of: BTreeMap<String, BTreeSet<String>>,
}

/// All source files below a folder, except tests.
pub fn read(folder: &Path) -> Vec<Source> {
    let mut files = Vec::new();
    below(folder, "crate", &mut files);
    let tests: Vec<String> = files.iter().flat_map(|file| test_modules(&file.module, &file.text)).collect();
    files
        .retain(|file| !tests.iter().any(|test| file.module == *test || file.module.starts_with(&format!("{test}::"))));
    files
}

fn below(folder: &Path, module: &str, files: &mut Vec<Source>) {
    let mut entries: Vec<_> =
        std::fs::read_dir(folder).expect("a folder").map(|e| e.expect("readable").path()).collect();
    entries.sort();
    for path in entries {
        let stem = path.file_stem().and_then(|stem| stem.to_str()).expect("a name").to_owned();
        if path.is_dir() {
            below(&path, &format!("{module}::{stem}"), files);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let own = if stem == "mod" || stem == "lib" { module.to_owned() } else { format!("{module}::{stem}") };
            files.push(Source { module: own, text: std::fs::read_to_string(&path).expect("text") });
        }
    }
}

/// The modules that a file declares only for tests.
fn test_modules(module: &str, text: &str) -> Vec<String> {
    let after =
        |line: &str| Some(line.trim_start_matches("pub(crate) ").strip_prefix("mod ")?.strip_suffix(';')?.to_owned());
    let lines: Vec<&str> = text.lines().collect();
    let pairs = lines.windows(2).filter(|pair| pair[0] == "#[cfg(test)]");
    pairs.filter_map(|pair| after(pair[1])).map(|name| format!("{module}::{name}")).collect()
}

/// The code of a file, without comments and without what follows the first `#[cfg(test)]` before a module's body.
pub fn code(text: &str) -> String {
    let lines: Vec<&str> = text.lines().map(|line| line.split("//").next().unwrap_or(line)).collect();
    let is_test = |index: usize| {
        lines[index] == "#[cfg(test)]"
            && lines.get(index + 1).is_some_and(|next| next.starts_with("mod ") && !next.ends_with(';'))
    };
    let end = (0..lines.len()).find(|&index| is_test(index)).unwrap_or(lines.len());
    lines[..end].join("\n")
}

/// The `use` declarations of a source: whether the name is re-exported, and the text between `use` and `;`.
fn uses(code: &str) -> Vec<(bool, String)> {
    let mut found = Vec::new();
    let mut rest = code;
    while let Some(at) = rest.find("use ") {
        let before = rest[..at].rsplit('\n').next().unwrap_or("").trim();
        let is_use = before.is_empty() || before.starts_with("pub");
        let end = rest[at..].find(';').map_or(rest.len(), |end| at + end);
        if is_use {
            found.push((before.starts_with("pub"), rest[at + 4..end].split_whitespace().collect::<Vec<_>>().join(" ")));
            rest = &rest[end..];
        } else {
            rest = &rest[at + 4..];
        }
    }
    found
}

/// The paths in a `use` tree, each with the name that it introduces.
fn expand(prefix: &str, tree: &str, paths: &mut Vec<(String, String)>) {
    let tree = tree.trim();
    if let Some(open) = tree.find('{') {
        let head = format!("{prefix}{}", &tree[..open]);
        let inner = &tree[open + 1..tree.rfind('}').unwrap_or(tree.len())];
        let (mut depth, mut from) = (0, 0);
        for (at, letter) in inner.char_indices().chain([(inner.len(), ',')]) {
            match letter {
                '{' => depth += 1,
                '}' => depth -= 1,
                ',' if depth == 0 => {
                    if !inner[from..at].trim().is_empty() {
                        expand(&head, &inner[from..at], paths);
                    }
                    from = at + 1;
                }
                _ => {}
            }
        }
        return;
    }
    let (path, name) = tree.split_once(" as ").unwrap_or((tree, tree.rsplit("::").next().unwrap_or(tree)));
    let path = format!("{prefix}{path}");
    paths.push((path.strip_suffix("::self").unwrap_or(&path).to_owned(), name.to_owned()));
}

/// The paths in a source that start with `crate` or `super`, outside `use` declarations.
fn inline(code: &str) -> Vec<String> {
    let is_name = |letter: char| letter.is_alphanumeric() || letter == '_' || letter == ':';
    let words = code.split(|letter: char| !is_name(letter));
    words.filter(|word| word.starts_with("crate::") || word.starts_with("super::")).map(str::to_owned).collect()
}

impl Imports {
    pub fn of(files: &[Source]) -> Self {
        let modules: BTreeSet<&str> = files.iter().map(|file| file.module.as_str()).collect();
        let handed_on: BTreeMap<(String, String), String> = files
            .iter()
            .flat_map(|file| {
                let mut paths = Vec::new();
                for (public, tree) in uses(&code(&file.text)) {
                    if public {
                        expand("", &tree, &mut paths);
                    }
                }
                let module = file.module.clone();
                paths.into_iter().map(move |(path, name)| ((module.clone(), name), absolute(&module, &path)))
            })
            .collect();
        let resolve = |path: &str| resolve(&modules, &handed_on, path, 0);
        let mut of = BTreeMap::new();
        for file in files {
            let text = code(&file.text);
            let mut paths = Vec::new();
            for (public, tree) in uses(&text) {
                if !public {
                    expand("", &tree, &mut paths);
                }
            }
            let paths = paths.into_iter().map(|(path, _)| path).chain(inline(&text));
            let targets = paths.map(|path| absolute(&file.module, &path)).filter_map(|path| resolve(&path));
            let own = &file.module;
            // A file may import from its own folder's module and from the items directly in that folder.
            let targets = targets.filter(|target| target != own && !own.starts_with(&format!("{target}::")));
            of.insert(own.clone(), targets.collect());
        }
        Self { of }
    }
}

/// The path from the crate's root, for a path relative to a module. Other paths are of another crate or of a child
/// module.
fn absolute(module: &str, path: &str) -> String {
    let mut base = module.to_owned();
    let mut rest = path;
    if rest.starts_with("crate::") {
        return rest.to_owned();
    }
    let mut up = false;
    while let Some(after) = rest.strip_prefix("super::") {
        base = base.rsplit_once("::").map_or_else(|| base.clone(), |(parent, _)| parent.to_owned());
        rest = after;
        up = true;
    }
    let rest = if up { rest } else { rest.strip_prefix("self::").unwrap_or(rest) };
    format!("{base}::{rest}")
}

/// The file that defines the item of a path.
fn resolve(
    modules: &BTreeSet<&str>,
    handed_on: &BTreeMap<(String, String), String>,
    path: &str,
    depth: usize,
) -> Option<String> {
    let mut module = path;
    while !modules.contains(module) {
        module = module.rsplit_once("::")?.0;
    }
    let name = path[module.len()..].strip_prefix("::").and_then(|rest| rest.split("::").next());
    let further = name.and_then(|name| handed_on.get(&(module.to_owned(), name.to_owned())));
    match further {
        Some(further) if depth < 8 => resolve(modules, handed_on, further, depth + 1),
        _ => Some(module.to_owned()),
    }
}
