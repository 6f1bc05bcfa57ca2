//! Helpers of the tests of scene files.
#![allow(dead_code, reason = "each test program uses its own part of this")]

use curitiba_pipeline::diagnostic::Warnings;
use curitiba_pipeline::scene::{LoadOptions, Scene, SceneError, load};
use std::path::{Path, PathBuf};

/// A folder with files that is removed after the test.
pub struct Folder(tempfile::TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn write(&self, name: &str, contents: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        std::fs::write(&path, contents).expect("a file");
        path
    }

    /// Writes a PNG of one colour.
    pub fn png(&self, name: &str, width: u32, height: u32, texel: [u8; 4]) -> PathBuf {
        let image = image::RgbaImage::from_pixel(width, height, image::Rgba(texel));
        let path = self.write(name, []);
        image.save_with_format(&path, image::ImageFormat::Png).expect("a PNG");
        path
    }
}

pub fn load_one(path: &Path) -> Result<Scene, SceneError> {
    load(&[path.to_owned()], &LoadOptions::default(), &|_| {})
}

/// Loads with a small memory cap, for damaged files.
pub fn load_capped(path: &Path) -> Result<Scene, SceneError> {
    load(&[path.to_owned()], &LoadOptions { max_bytes: 16 << 20, ..LoadOptions::default() }, &|_| {})
}

/// Number of warnings of a kind.
pub fn count(warnings: &Warnings, what: &str) -> u64 {
    warnings.groups().iter().filter(|group| group.what == what).map(|group| group.count).sum()
}

/// Number of triangles of all placed meshes.
pub fn triangles(scene: &Scene) -> u64 {
    curitiba_pipeline::scene::statistics(scene).triangles
}

/// Asserts that every index of a loaded scene is in range; later stages rely on this.
pub fn assert_references_are_valid(scene: &Scene) {
    for object in &scene.objects {
        assert!((object.mesh as usize) < scene.meshes.len(), "object {} has no mesh", object.name);
    }
    for mesh in &scene.meshes {
        for group in &mesh.groups {
            assert!((group.material as usize) < scene.materials.len(), "mesh {} has no material", mesh.name);
        }
        for list in [mesh.normals.len(), mesh.texcoords.len()] {
            assert!(list == 0 || list == mesh.positions.len(), "mesh {}: {list} values", mesh.name);
        }
    }
    for material in &scene.materials {
        assert!(material.texture.is_none_or(|texture| (texture as usize) < scene.textures.len()));
    }
}

/// Deterministic mutations of a file: truncations at regular steps, and byte changes at pseudo-random places.
pub fn mutations(bytes: &[u8], changes: usize) -> impl Iterator<Item = Vec<u8>> + '_ {
    let step = (bytes.len() / 200).max(1);
    let truncated = (0..bytes.len()).step_by(step).map(|length| bytes[..length].to_vec());
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut random = move || {
        // xorshift64* (Vigna, "An experimental exploration of Marsaglia's xorshift generators, scrambled", 2016).
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        state.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 32
    };
    let changed = (0..changes).map(move |number| {
        let mut bytes = bytes.to_vec();
        for _ in 0..1 + number % 3 {
            let at = random() as usize % bytes.len();
            bytes[at] = match random() % 4 {
                0 => 0,
                1 => 255,
                2 => bytes[at] ^ (1 << (random() % 8)),
                _ => random() as u8,
            };
        }
        bytes
    });
    truncated.chain(changed)
}
