//! Opening a path: a project file, scene files, or a folder of scene files.

use super::from_scene::{FromSceneError, SceneOptions, SceneProjects};
use super::{Project, loader};
use crate::diagnostic::Problems;
use crate::files;
use crate::scene::SceneError;
use std::io::Read as _;
use std::path::{Path, PathBuf};

/// Extensions of scene files, best first: if a folder holds one model in several formats, the first of these is used.
pub const SCENE_EXTENSIONS: [&str; 8] = ["glb", "gltf", "nbo", "cbo", "obj", "3ds", "dae", "mesh.xml"];

/// Extensions of related files that cannot be opened, each with advice.
const OTHER_FILES: &[(&str, &str)] = &[
    ("mlib", "this is a material library; name a project that lists it in <materialLibs>"),
    ("mtl", "this holds the materials of an .obj file; name that"),
    ("bin", "this holds the numbers of a .gltf file; name that"),
    ("fbx", "export it as .glb, for example with Blender"),
    ("blend", "export it as .glb with Blender"),
    ("ply", "export it as .glb or .obj, for example with Blender or MeshLab"),
    ("stl", "export it as .glb or .obj, for example with Blender or MeshLab"),
    ("mesh", "export it as .glb, for example with Blender"),
    ("usd", "export it as .glb, for example with Blender"),
    ("usdz", "export it as .glb, for example with Blender"),
];

/// Why a path could not be opened.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum SourceError {
    /// The project file or a material library is in error; contains all their problems.
    #[error(transparent)]
    Project(#[from] Problems),
    /// A scene file is in error, or the file is neither a scene nor a project.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Options do not fit what is opened.
    #[error("{0}")]
    Option(String),
}

impl From<FromSceneError> for SourceError {
    fn from(error: FromSceneError) -> Self {
        match error {
            FromSceneError::Scene(error) => Self::Scene(error),
            FromSceneError::Option(message) => Self::Option(message),
        }
    }
}

/// Opens a path. A project file is read; from a scene file, or a folder of them, a project is made by `options`. `window` is the
/// size of such a project's window and targets in pixels; `None` stands for 1024 x 1024. `max_bytes` limits the memory for scene
/// files.
///
/// # Errors
/// All problems of a project's files together; the first error of scene files; or options that apply only to scene files.
pub fn open(
    path: &Path,
    options: &SceneOptions,
    window: Option<[u32; 2]>,
    max_bytes: u64,
) -> Result<Project, SourceError> {
    match scene_files(path)? {
        None => {
            let given: Vec<String> = options.given().iter().map(|(name, _)| format!("--{name}")).collect();
            if !given.is_empty() {
                let (path, options) = (path.display(), given.join(", "));
                let what = "a project file has its own cameras, lights and passes";
                return Err(SourceError::Option(format!("{path}: {what}; leave out {options}, or name scene files")));
            }
            if let Some(second) = options.more.first() {
                return Err(SourceError::Option(format!(
                    "{}: a project is rendered by itself; leave out {}, or name scene files alone",
                    path.display(),
                    second.display()
                )));
            }
            Ok(loader::load(path)?)
        }
        Some(files) => {
            let project = scene_projects(path, files, options, window, max_bytes)?.project();
            Ok(Project { source: path.to_owned(), ..project })
        }
    }
}

/// The projects of a path to scenes; `None` for a project file.
///
/// # Errors
/// As [`open`].
pub fn open_scenes(
    path: &Path,
    options: &SceneOptions,
    window: Option<[u32; 2]>,
    max_bytes: u64,
) -> Result<Option<SceneProjects>, SourceError> {
    let files = scene_files(path)?;
    files.map(|files| scene_projects(path, files, options, window, max_bytes)).transpose()
}

fn scene_projects(
    path: &Path,
    mut files: Vec<PathBuf>,
    options: &SceneOptions,
    window: Option<[u32; 2]>,
    max_bytes: u64,
) -> Result<SceneProjects, SourceError> {
    for more in &options.more {
        let Some(found) = scene_files(more)? else {
            return Err(SourceError::Option(format!(
                "{}: a project is rendered by itself; leave out {}, or name scene files alone",
                more.display(),
                path.display()
            )));
        };
        files.extend(found);
    }
    Ok(SceneProjects::new(&files, options, window, max_bytes)?)
}

/// Whether a path may name scenes: by its extension, or because it is a folder.
#[must_use]
pub fn names_scenes(path: &Path) -> bool {
    SCENE_EXTENSIONS.contains(&extension(path).as_str()) || path.is_dir()
}

fn extension(path: &Path) -> String {
    // `mesh.xml` is the only extension that contains a dot.
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    if name.ends_with(".mesh.xml") {
        return "mesh.xml".to_owned();
    }
    path.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_lowercase()
}

/// The scene files at a path: the file itself, or those of a folder. `None` for a project file. Also `None` for a file that cannot be
/// read, unless its extension is that of a scene.
///
/// # Errors
/// If the file is neither a scene nor a project, or the folder contains no scene.
pub fn scene_files(path: &Path) -> Result<Option<Vec<PathBuf>>, SourceError> {
    if path.is_dir() {
        return scenes_in(path).map(Some);
    }
    let extension = extension(path);
    if SCENE_EXTENSIONS.contains(&extension.as_str()) {
        return Ok(Some(vec![path.to_owned()]));
    }
    let start = start_of(path);
    if start.as_ref().is_some_and(|start| start.starts_with(b"glTF")) {
        return Ok(Some(vec![path.to_owned()]));
    }
    let text = start.as_deref().map(|start| start.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(start).trim_ascii_start());
    let is_xml = extension == "xml" || text.is_some_and(|text| text.is_empty() || text.starts_with(b"<"));
    let other = OTHER_FILES.iter().find(|(known, _)| *known == extension).map(|(_, remedy)| *remedy);
    let valid = "valid: a project (.xml), scene files (.glb, .gltf, .obj, .cbo, .nbo, .3ds, .dae, .mesh.xml), or a folder of scene files";
    match (start.is_some(), is_xml, other) {
        (true, _, Some(remedy)) => {
            Err(SceneError::file(path, "this is neither a project nor a scene that can be read")
                .help(format!("{remedy}\n       {valid}"))
                .into())
        }
        (true, false, None) => Err(SceneError::file(path, "this is neither a project nor a scene").help(valid).into()),
        // The project loader gives the best message for whatever is wrong with the file.
        _ => Ok(None),
    }
}

/// The first bytes of a regular file; `None` if it cannot be read.
fn start_of(path: &Path) -> Option<Vec<u8>> {
    const START: u64 = 256;
    let mut bytes = Vec::new();
    files::open(path).ok()?.take(START).read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

/// The scene files of a folder, sorted by name; if several have the same stem, only the best format. Subfolders are not searched.
pub(super) fn scenes_in(folder: &Path) -> Result<Vec<PathBuf>, SourceError> {
    let failed = |error: std::io::Error| SceneError::file(folder, error.to_string());
    let mut found: Vec<(String, usize, PathBuf)> = Vec::new();
    let mut projects: Vec<String> = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let extension = extension(&path);
        if !path.is_file() {
            continue;
        }
        if let Some(rank) = SCENE_EXTENSIONS.iter().position(|known| *known == extension) {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let stem = name[..name.len() - extension.len() - 1].to_owned();
            found.push((stem, rank, path));
        } else if extension == "xml" {
            projects.push(path.file_name().unwrap_or_default().to_string_lossy().into_owned());
        }
    }
    found.sort();
    found.dedup_by(|next, first| next.0 == first.0);
    if found.is_empty() {
        projects.sort();
        let help = match &projects[..] {
            [] => "valid: a folder with .glb, .gltf, .obj, .cbo, .nbo, .3ds, .dae or .mesh.xml files; folders in it are not searched"
                .to_owned(),
            _ => format!(
                "it has projects; name one: {}",
                projects.iter().take(8).cloned().collect::<Vec<_>>().join(", ")
            ),
        };
        return Err(SceneError::file(folder, "this folder has no scene file").help(help).into());
    }
    Ok(found.into_iter().map(|(_, _, path)| path).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(folder: &Path, names: &[&str]) -> Vec<PathBuf> {
        names.iter().map(|name| folder.join(name)).collect()
    }

    #[test]
    fn a_path_is_known_by_its_extension_and_its_content() {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).expect("a file");
            path
        };
        let scene = |path: &Path| scene_files(path).map_err(|error| error.to_string());
        for (name, bytes) in [("a.OBJ", &b""[..]), ("b.glb", b"x"), ("c.xml", b"glTF\x02"), ("d", b"glTF")] {
            let path = write(name, bytes);
            assert_eq!(scene(&path), Ok(Some(vec![path])), "{name}");
        }
        for (name, bytes) in [("e.xml", &b"\xFF"[..]), ("f", b"\xEF\xBB\xBF \n<project/>"), ("g.txt", b"")] {
            assert_eq!(scene(&write(name, bytes)), Ok(None), "{name}");
        }
        assert_eq!(scene(Path::new("there/is/no.xml")), Ok(None));
        assert_eq!(scene(Path::new("no.glb")), Ok(Some(vec!["no.glb".into()])));
        for (name, bytes, words) in [
            ("h.png", &b"\x89PNG"[..], ".glb"),
            ("i.fbx", b"; FBX 7.7.0", "Blender"),
            ("j.mtl", b"newmtl a", ".obj file; name that"),
        ] {
            let error = scene(&write(name, bytes)).expect_err(name);
            assert!(error.contains(words) && error.contains(name), "{error}");
        }
    }

    #[test]
    fn a_folder_gives_its_scenes_by_name_and_each_model_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path();
        let empty = scene_files(path).expect_err("nothing is in it").to_string();
        assert!(empty.contains("no scene file"), "{empty}");
        std::fs::write(path.join("p.xml"), "<project/>").expect("a file");
        let projects = scene_files(path).expect_err("only a project is in it").to_string();
        assert!(projects.contains("name one: p.xml"), "{projects}");
        for name in ["b.obj", "a.gltf", "a.glb", "b.mtl", "c.cbo", "c.mesh.xml"] {
            std::fs::write(path.join(name), "").expect("a file");
        }
        std::fs::create_dir(path.join("d.obj")).expect("a folder");
        let files = scene_files(path).expect("three models are in it");
        assert_eq!(files, Some(named(path, &["a.glb", "b.obj", "c.cbo"])));
    }

    #[test]
    fn options_of_scenes_are_refused_for_projects() {
        let project = Path::new("p.xml");
        let fov = SceneOptions { fov: Some(30.0), ..SceneOptions::default() };
        let error = open(project, &fov, None, 1 << 30).expect_err("a project has its own camera").to_string();
        assert!(error.contains("--fov"), "{error}");
        let more = SceneOptions { more: vec!["a.obj".into()], ..SceneOptions::default() };
        assert!(open(project, &more, None, 1 << 30).expect_err("one project").to_string().contains("a.obj"));
        let second = SceneOptions { more: vec!["p.xml".into()], ..SceneOptions::default() };
        let error = open(Path::new("a.obj"), &second, None, 1 << 30).expect_err("a project among scenes");
        assert!(error.to_string().contains("p.xml"), "{error}");
    }
}
