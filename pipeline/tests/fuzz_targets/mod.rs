//! The bodies of the fuzz targets in `fuzz/`. They check guarantees that every loader must keep for any bytes at all. The ordinary
//! tests run them too (`fuzz_brief.rs`).
//!
//! A body writes its input to a folder of its own, since loaders read files and the files beside them; the folder is in memory if
//! the system has one there. It loads the input with a cap of [`MAX_BYTES`] and panics if a successful load breaks a guarantee, or
//! if a refusal has no message.

pub mod check;
pub mod picture;

use check::{LoadedScene, Outcome};
use curitiba_pipeline::scene::{
    BuildOptions, Group, LoadOptions, Material, Mesh, Needs, Object, RenderScene, Scene, SceneError, TextureSource,
    load,
};
use glam::{Mat4, Vec2, Vec3};
use std::path::{Path, PathBuf};

/// Memory cap of a load, and of building the scene after it.
pub const MAX_BYTES: u64 = 16 << 20;

/// Separates the files in an input that stands for several files. It does not occur in text of these formats.
pub const SEPARATOR: u8 = 0;

/// A project that uses everything in [`LIBRARY`], and every class of pass.
pub const PROJECT: &str = include_str!("everything.xml");

/// The material library that [`PROJECT`] names.
pub const LIBRARY: &str = include_str!("everything.mlib");

/// A fuzz target.
pub struct Target {
    /// Name of the format and of the target.
    pub name: &'static str,
    /// Loads an input and checks the result.
    pub run: fn(&[u8]) -> Outcome,
}

/// All targets except `shader` and `script`, which need a feature that not every crate with these bodies has.
pub const TARGETS: &[Target] = &[
    Target { name: "project_xml", run: project_xml },
    Target { name: "mlib", run: mlib },
    Target { name: "cbo", run: cbo },
    Target { name: "obj", run: obj },
    Target { name: "gltf", run: gltf },
    Target { name: "studio", run: studio },
    Target { name: "collada", run: collada },
    Target { name: "ogre", run: ogre },
    Target { name: "texture", run: texture },
    Target { name: "picture", run: picture::picture },
];

/// Loads a project file, with [`LIBRARY`] beside it.
pub fn project_xml(input: &[u8]) -> Outcome {
    let folder = Folder::new();
    folder.write("everything.mlib", LIBRARY.as_bytes());
    check::project(&folder.write("project.xml", input))
}

/// Loads a material library that [`PROJECT`] names.
pub fn mlib(input: &[u8]) -> Outcome {
    let folder = Folder::new();
    folder.write("everything.mlib", input);
    check::project(&folder.write("project.xml", PROJECT.as_bytes()))
}

/// Loads a CBO file. Its extension only decides which layout is tried first, never whether it is read.
pub fn cbo(input: &[u8]) -> Outcome {
    let folder = Folder::with_textures();
    let loaded = scene(&folder, &folder.write("scene.cbo", input));
    let other = scene(&folder, &folder.write("scene.nbo", input));
    assert_eq!(loaded, other, "the extension decides whether the file is read");
    loaded
}

/// Loads an OBJ file and, after a [`SEPARATOR`], the material library `scene.mtl`.
pub fn obj(input: &[u8]) -> Outcome {
    let folder = Folder::with_textures();
    let mut files = input.splitn(2, |byte| *byte == SEPARATOR);
    let [obj, mtl] = [files.next(), files.next()].map(Option::unwrap_or_default);
    folder.write("scene.mtl", mtl);
    scene(&folder, &folder.write("scene.obj", obj))
}

/// Loads a glTF file, as JSON or GLB depending on its first bytes; after a [`SEPARATOR`] in JSON comes the buffer `scene.bin`.
pub fn gltf(input: &[u8]) -> Outcome {
    let folder = Folder::with_textures();
    if input.starts_with(b"glTF") {
        return scene(&folder, &folder.write("scene.glb", input));
    }
    let mut files = input.splitn(2, |byte| *byte == SEPARATOR);
    let [json, binary] = [files.next(), files.next()].map(Option::unwrap_or_default);
    folder.write("scene.bin", binary);
    scene(&folder, &folder.write("scene.gltf", json))
}

/// Loads a 3DS file.
pub fn studio(input: &[u8]) -> Outcome {
    let folder = Folder::with_textures();
    scene(&folder, &folder.write("scene.3ds", input))
}

/// Loads a COLLADA document.
pub fn collada(input: &[u8]) -> Outcome {
    let folder = Folder::with_textures();
    scene(&folder, &folder.write("scene.dae", input))
}

/// Loads an Ogre mesh in XML.
pub fn ogre(input: &[u8]) -> Outcome {
    let folder = Folder::with_textures();
    scene(&folder, &folder.write("scene.mesh.xml", input))
}

/// Loads an image as a texture: embedded, as a file, and as its own mask. The file is named `.tga`, because only the name
/// identifies a TGA file.
pub fn texture(input: &[u8]) -> Outcome {
    let folder = Folder::new();
    let file = folder.write("image.tga", input);
    let sources = [
        TextureSource::Embedded { name: "embedded".to_owned(), bytes: input.into() },
        TextureSource::File(file.clone()),
        TextureSource::Masked { color: file.clone(), mask: file },
    ];
    let mut decoded = 0;
    for source in sources {
        let options = BuildOptions { max_bytes: MAX_BYTES, ..BuildOptions::default() };
        match RenderScene::build(triangle(source), &options) {
            Ok((built, warnings)) => {
                check::render_scene(&built, &options);
                assert!(
                    built.textures.len() == 1 || !warnings.is_empty(),
                    "a texture that cannot be decoded is counted"
                );
                decoded += built.textures.len();
            }
            Err(error) => check::scene_error(&error),
        }
    }
    if decoded > 0 { Outcome::Loaded } else { Outcome::Refused }
}

/// A triangle cut out by a texture.
fn triangle(source: TextureSource) -> Scene {
    Scene {
        meshes: vec![Mesh {
            name: "triangle".to_owned(),
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            normals: Vec::new(),
            texcoords: vec![Vec2::ZERO, Vec2::X, Vec2::Y],
            groups: vec![Group { material: 0, triangles: vec![[0, 1, 2]] }],
            ..Mesh::default()
        }],
        objects: vec![Object { name: "triangle".to_owned(), mesh: 0, transform: Mat4::IDENTITY }],
        materials: vec![Material { texture: Some(0), alpha_cutoff: Some(0.5), ..Material::default() }],
        textures: vec![source],
        ..Scene::default()
    }
}

/// Loads a scene file completely, and again with positions only.
fn scene(folder: &Folder, path: &Path) -> Outcome {
    let load = |needs: Needs| -> Result<Scene, SceneError> {
        load(&[path.to_owned()], &LoadOptions { needs, max_bytes: MAX_BYTES }, &|_| {})
    };
    let loaded = match load(Needs::ALL) {
        Ok(scene) => LoadedScene { scene, folder: folder.path() },
        Err(error) => {
            check::scene_error(&error);
            return Outcome::Refused;
        }
    };
    loaded.check();
    match load(Needs::NOTHING) {
        Ok(bare) => loaded.check_positions_only(&bare),
        Err(error) => panic!("what loads whole loads without normals and textures: {error}"),
    }
    Outcome::Loaded
}

/// A folder that is removed at the end of the body.
pub struct Folder(tempfile::TempDir);

impl Folder {
    /// An empty folder, in memory if the system has a folder there.
    pub fn new() -> Self {
        let memory = Path::new("/dev/shm");
        let parent = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
        let folder = tempfile::Builder::new().prefix("curitiba-fuzz-").tempdir_in(parent);
        Self(folder.expect("a folder for temporary files can be made"))
    }

    /// A folder with the textures that inputs may name: `t.tga` has an alpha channel with holes, `m.tga` has no alpha channel.
    fn with_textures() -> Self {
        let folder = Self::new();
        folder.write("t.tga", &tga(&[[200, 10, 20, 255], [10, 200, 20, 0], [10, 20, 200, 90], [9, 9, 9, 255]]));
        folder.write("m.tga", &tga(&[[255; 3], [0; 3]]));
        folder
    }

    /// Writes a file.
    pub fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).expect("a temporary file can be written");
        path
    }

    /// Path of the folder.
    pub fn path(&self) -> &Path {
        self.0.path()
    }
}

/// A row of uncompressed texels as a TGA file: 3 or 4 channels, red first.
pub fn tga<const CHANNELS: usize>(texels: &[[u8; CHANNELS]]) -> Vec<u8> {
    let mut bytes = vec![0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, texels.len() as u8, 0, 1, 0, 8 * CHANNELS as u8];
    // The number of alpha bits, and the top row first.
    bytes.push(if CHANNELS == 4 { 8 } else { 0 } | 0x20);
    for texel in texels {
        // The file has blue first.
        bytes.extend([texel[2], texel[1], texel[0]]);
        bytes.extend(&texel[3..]);
    }
    bytes
}
