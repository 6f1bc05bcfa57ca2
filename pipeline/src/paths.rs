//! Paths as project and scene files of 2014 write them: with `\`, and with inconsistent case.

use std::borrow::Cow;
use std::ffi::{OsStr, OsString};
use std::path::{Component, Path, PathBuf};

/// Longest path that is resolved, bytes: no system opens a longer one, and a damaged file may contain one of gigabytes.
pub const MAX_WRITTEN: usize = 4096;

/// A path that was found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Resolved {
    /// The existing file or folder.
    pub path: PathBuf,
    /// Whether the existing path differs from the written one in case; worth a note.
    pub case_differs: bool,
}

/// `written` as a path of this system: trimmed, and with every `\` replaced by `/`.
#[must_use]
pub fn portable(written: &str) -> PathBuf {
    PathBuf::from(written.trim().replace('\\', "/"))
}

/// Finds the file that `written` names, relative to `folder` unless absolute.
///
/// `\` separates like `/`. If the exact path does not exist, components are compared without case. Among several matches a name in the
/// written case is preferred, then the first in byte order, so that the result does not depend on the file system. A name on disk that
/// is not UTF-8 is read as Latin-1, as older systems wrote names. Of each folder at most 65,536 entries are compared. `None` if nothing
/// matches, or `written` is longer than [`MAX_WRITTEN`].
#[must_use]
pub fn resolve_path(folder: &Path, written: &str) -> Option<Resolved> {
    if written.len() > MAX_WRITTEN {
        return None;
    }
    let exact = folder.join(portable(written));
    if exact.exists() {
        return Some(Resolved { path: exact, case_differs: false });
    }
    let (mut found, mut case_differs) = (PathBuf::new(), false);
    for component in exact.components() {
        let Component::Normal(name) = component else {
            found.push(component);
            continue;
        };
        let next = found.join(name);
        if next.exists() {
            found = next;
            continue;
        }
        let name = name.to_str()?;
        let entry = entry_in_any_case(&found, name)?;
        case_differs |= spelled(&entry).as_deref() != Some(name);
        found.push(entry);
    }
    Some(Resolved { path: found, case_differs })
}

/// The name on disk of the entry of a folder that `name` means, compared as by [`resolve_path`].
pub(crate) fn entry_in_any_case(folder: &Path, name: &str) -> Option<OsString> {
    /// Greatest number of entries of a folder that are examined.
    const MOST: usize = 1 << 16;
    let wanted = name.to_lowercase();
    std::fs::read_dir(here(folder))
        .ok()?
        .take(MOST)
        .filter_map(|entry| entry.ok().map(|entry| entry.file_name()))
        .filter(|entry| spelled(entry).is_some_and(|entry| entry.to_lowercase() == wanted))
        .min_by_key(|entry| (spelled(entry).as_deref() != Some(name), entry.clone()))
}

/// A name on disk as text: UTF-8, or else Latin-1 where names are bytes.
fn spelled(name: &OsStr) -> Option<Cow<'_, str>> {
    name.to_str().map(Cow::Borrowed).or_else(|| latin_1(name).map(Cow::Owned))
}

#[cfg(unix)]
fn latin_1(name: &OsStr) -> Option<String> {
    Some(std::os::unix::ffi::OsStrExt::as_bytes(name).iter().map(|byte| char::from(*byte)).collect())
}

#[cfg(not(unix))]
fn latin_1(_: &OsStr) -> Option<String> {
    None
}

/// A hint for a missing path: the name most similar to the path's first missing component, among the entries of the last existing folder.
/// Without a similar name: the number of entries of that folder, if only the path's last component is missing, otherwise the missing
/// folder.
#[must_use]
pub fn nearest_help(missing: &Path) -> String {
    /// Greatest number of entries of a folder that are examined.
    const MOST: usize = 10_000;
    let lacking = missing.ancestors().find(|part| part.parent().is_some_and(|folder| here(folder).is_dir()));
    let Some((lacking, folder)) = lacking.and_then(|part| Some((part, part.parent()?))) else {
        return "valid: a path relative to this file".to_owned();
    };
    let entries = std::fs::read_dir(here(folder)).into_iter().flatten().take(MOST);
    let names: Vec<String> = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok()).collect();
    let wanted = lacking.file_name().unwrap_or_default().to_string_lossy();
    let alike = |name: &String| strsim::normalized_damerau_levenshtein(&name.to_lowercase(), &wanted.to_lowercase());
    let nearest = names.iter().map(|name| (alike(name), name)).filter(|(similarity, _)| *similarity >= 0.6);
    let nearest = nearest.max_by(|a, b| a.0.total_cmp(&b.0).then_with(|| b.1.cmp(a.1)));
    match nearest {
        Some((_, name)) => format!("there is `{}`; did you mean that?", folder.join(name).display()),
        None if lacking == missing => format!("its folder {} has {} entries", here(folder).display(), names.len()),
        None => format!("the folder {} is not there", lacking.display()),
    }
}

fn here(folder: &Path) -> &Path {
    if folder.as_os_str().is_empty() { Path::new(".") } else { folder }
}

/// The relative path from `folder` to `target`, with `/`, as files store it: `../textures/wall.png`. Both paths are made absolute
/// first. `None` if they have no common root (two Windows drives) or `target` is not valid Unicode.
#[must_use]
pub fn relative_to(folder: &Path, target: &Path) -> Option<String> {
    let folder = absolute(folder)?;
    let target = absolute(target)?;
    let common = folder.components().zip(target.components()).take_while(|(a, b)| a == b).count();
    if common == 0 {
        return None;
    }
    let up = folder.components().count() - common;
    let mut parts = vec![".."; up];
    for component in target.components().skip(common) {
        parts.push(component.as_os_str().to_str()?);
    }
    Some(parts.join("/"))
}

/// The canonical path of the longest existing prefix, followed by the rest as written.
fn absolute(path: &Path) -> Option<PathBuf> {
    let path = std::path::absolute(path).ok()?;
    for existing in path.ancestors() {
        if let Ok(canonical) = existing.canonicalize() {
            return Some(canonical.join(path.strip_prefix(existing).ok()?));
        }
    }
    Some(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_with_backslashes_and_other_letter_case_is_found_and_said_to_differ() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("Texturas")).unwrap();
        std::fs::write(folder.path().join("Texturas/Wall.PNG"), b"x").unwrap();

        let exact = resolve_path(folder.path(), "Texturas\\Wall.PNG").unwrap();
        assert!(!exact.case_differs);
        let mended = resolve_path(folder.path(), "texturas\\WALL.png").unwrap();
        assert!(mended.case_differs);
        assert_eq!(mended.path, folder.path().join("Texturas/Wall.PNG"));
        assert_eq!(resolve_path(folder.path(), "texturas\\roof.png"), None);
    }

    #[cfg(unix)]
    #[test]
    fn names_of_older_systems_are_found_by_their_letters() {
        use std::os::unix::ffi::OsStrExt;
        let folder = tempfile::tempdir().unwrap();
        let name = |bytes: &[u8]| folder.path().join(OsStr::from_bytes(bytes));
        std::fs::write(name(b"\xC1gua.mtl"), b"x").unwrap();
        let found = resolve_path(folder.path(), "Água.mtl").unwrap();
        assert_eq!((found.path, found.case_differs), (name(b"\xC1gua.mtl"), false));
        let found = resolve_path(folder.path(), "água.MTL").unwrap();
        assert_eq!((found.path, found.case_differs), (name(b"\xC1gua.mtl"), true));
        assert_eq!(resolve_path(folder.path(), "Agua.mtl"), None);
        // A name in UTF-8 comes first.
        std::fs::write(folder.path().join("Água.mtl"), b"y").unwrap();
        assert_eq!(resolve_path(folder.path(), "Água.mtl").unwrap().path, folder.path().join("Água.mtl"));
    }

    #[test]
    fn the_way_from_a_folder_to_a_file_leads_back_to_that_file() {
        let folder = tempfile::tempdir().unwrap();
        let (scenes, textures) = (folder.path().join("a/scenes"), folder.path().join("a/textures"));
        std::fs::create_dir_all(&scenes).unwrap();
        std::fs::create_dir_all(&textures).unwrap();
        std::fs::write(textures.join("wall.png"), b"x").unwrap();
        let way = relative_to(&scenes, &textures.join("wall.png")).unwrap();
        assert_eq!(way, "../textures/wall.png");
        assert!(scenes.join(&way).exists());
    }
}
