//! Writing the square's files to the place where the projects look for them.

use super::{Painting, Square};
use crate::files::{create_folder, write_atomically};
use crate::scene::{Layout, SceneError, TextureSource, write_cbo};
use image::ImageEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use std::path::{Path, PathBuf};

/// Name of the scene's file.
pub const SCENE_FILE: &str = "largoCamoes.cbo";
/// Folder of the scene's textures, in the folder of the scene's file.
pub const TEXTURE_FOLDER: &str = "Texturas";

impl Painting {
    /// The picture as a PNG file without alpha.
    ///
    /// # Errors
    /// If the texels do not match the size.
    pub fn png(&self) -> Result<Vec<u8>, image::ImageError> {
        let rgb: Vec<u8> = self.texels.iter().flat_map(|&[red, green, blue, _]| [red, green, blue]).collect();
        let mut bytes = Vec::new();
        // Texels have few distinct values: that compresses better without a filter.
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::NoFilter).write_image(
            &rgb,
            self.width,
            self.height,
            image::ExtendedColorType::Rgb8,
        )?;
        Ok(bytes)
    }
}

impl Square {
    /// Writes [`SCENE_FILE`] (2014 layout) and its textures into `folder`, which is made if missing, and returns the path of the
    /// scene file. Each file is written whole or not at all, and the scene is written last.
    ///
    /// # Errors
    /// If a folder or file cannot be written.
    pub fn write(self, folder: &Path) -> Result<PathBuf, SceneError> {
        let textures = folder.join(TEXTURE_FOLDER);
        create_folder(&textures).map_err(|error| SceneError::file(&textures, format!("cannot be made: {error}")))?;
        let mut scene = self.scene;
        scene.textures.clear();
        for painting in &self.paintings {
            let path = textures.join(painting.name);
            let bytes =
                painting.png().map_err(|error| SceneError::file(&path, format!("cannot be encoded: {error}")))?;
            write_atomically(&path, &bytes)
                .map_err(|error| SceneError::file(&path, format!("cannot be written: {error}")))?;
            scene.textures.push(TextureSource::File(path));
        }
        let path = folder.join(SCENE_FILE);
        write_cbo(&scene, &path, Layout::Cbo2014)?;
        Ok(path)
    }
}
