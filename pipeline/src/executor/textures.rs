//! Textures of own shaders: image files, and channels.

use super::{RenderError, Renderer, StepKind, channel_of};
use crate::backend::{BackendError, GBuffer, MipLevel, QuadTexture};
use crate::plan::{Plan, PlannedPass, Work};
use crate::project::{ChannelRef, MaterialPattern, OwnShader, PassKind, ShaderTexture};
use crate::scene::texture::Texture;
use crate::scene::{RenderScene, SceneError, TextureSource, image_file, image_files};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Textures of the samplers of a quad's or compute pass's shader.
pub(super) fn sampled<'a>(
    shader: &OwnShader,
    targets: &'a [GBuffer],
    images: &'a [(PathBuf, Texture)],
) -> Vec<QuadTexture<'a>> {
    let read = |texture: &ShaderTexture| match texture {
        ShaderTexture::Channel(channel) => {
            let MipLevel { width, height, texels } = level(targets, *channel);
            QuadTexture::Channel { width, height, texels }
        }
        ShaderTexture::Levels(levels) => {
            QuadTexture::Levels(levels.iter().map(|channel| level(targets, *channel)).collect())
        }
        ShaderTexture::File(path) => image_of(images, path).map_or(QuadTexture::Nothing, QuadTexture::Image),
        ShaderTexture::Cube(paths) => match paths.each_ref().map(|path| image_of(images, path)) {
            [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f)] => QuadTexture::Cube([a, b, c, d, e, f]),
            _ => QuadTexture::Nothing,
        },
        ShaderTexture::Material | ShaderTexture::Nothing => QuadTexture::Nothing,
    };
    shader.textures.iter().map(read).collect()
}

fn level(targets: &[GBuffer], channel: ChannelRef) -> MipLevel<'_> {
    let read = &targets[channel.target];
    MipLevel { width: read.width, height: read.height, texels: channel_of(read, channel.channel) }
}

/// The loaded image of a file; `None` if the file is not loaded.
fn image_of<'a>(images: &'a [(PathBuf, Texture)], path: &Path) -> Option<&'a Texture> {
    images.iter().find(|(file, _)| file == path).map(|(_, image)| image)
}

/// Bytes of the texels of an image, of all its mip levels.
fn bytes_of(image: &Texture) -> u64 {
    image.levels.iter().map(|level| 4 * level.texels.len() as u64).sum()
}

/// The textures that a scene set's passes map to materials, each with the pattern of the materials' names.
pub(super) fn mapped_textures(plan: &Plan, set: usize) -> impl Iterator<Item = (&MaterialPattern, TextureSource)> {
    let of_set = move |planned: &&PlannedPass| match planned.work {
        Work::Raster { scene_set, .. } | Work::Rays { scene_set, .. } | Work::Effect { scene_set, .. } => {
            scene_set == set
        }
        Work::Off { .. } | Work::Quad { .. } | Work::Intersection { .. } | Work::Compute => false,
    };
    let maps = plan.passes.iter().filter(of_set).flat_map(|planned| plan.pass(planned).kind.colors());
    maps.filter_map(|map| Some((&map.to, map.texture.source()?)))
}

/// Fails unless the images of every cube map of a shader are square and of one size.
fn check_cubes<'a>(shader: &OwnShader, image: impl Fn(&PathBuf) -> Option<&'a Texture>) -> Result<(), SceneError> {
    let size =
        |path: &PathBuf| image(path).and_then(|image| image.levels.first()).map(|level| [level.width, level.height]);
    for texture in &shader.textures {
        let ShaderTexture::Cube(paths) = texture else { continue };
        let Some([side, _]) = size(&paths[0]) else { continue };
        for path in paths {
            if let Some([width, height]) = size(path).filter(|size| *size != [side; 2]) {
                let what = format!("an image of a cube map has {width} x {height} texels");
                return Err(SceneError::file(path, what).help(format!("valid: {side} x {side}, as its first, square")));
            }
        }
    }
    Ok(())
}

impl Renderer {
    /// Loads image files that the own shaders of a scene set's passes read, and adds them to the scene's textures.
    pub(super) fn load_images(
        &self,
        set: usize,
        scene: &mut Arc<RenderScene>,
    ) -> Result<Vec<(PathBuf, u32)>, RenderError> {
        let mut images: Vec<(PathBuf, u32)> = Vec::new();
        let mut left = self.plan.settings.max_memory.saturating_sub(self.plan.target_bytes());
        for planned in &self.plan.passes {
            let PassKind::Raster(raster) = &self.plan.pass(planned).kind else { continue };
            if !matches!(planned.work, Work::Raster { scene_set, .. } if scene_set == set) {
                continue;
            }
            for map in &raster.shaders {
                let failed = |error| RenderError::Scene { place: map.shader.place.clone(), error };
                for path in map.shader.textures.iter().flat_map(ShaderTexture::files) {
                    if images.iter().any(|(loaded, _)| loaded == path) {
                        continue;
                    }
                    let image = image_file(path, left).map_err(failed)?;
                    left = left.saturating_sub(bytes_of(&image));
                    images.push((path.clone(), scene.textures.len() as u32));
                    Arc::make_mut(scene).textures.push(image);
                }
                let image = |path: &PathBuf| {
                    let found = images.iter().find(|(loaded, _)| loaded == path);
                    found.map(|(_, index)| &scene.textures[*index as usize])
                };
                check_cubes(&map.shader, image).map_err(failed)?;
            }
        }
        Ok(images)
    }

    /// Loads the textures that a scene set's passes map to its materials, and adds them to the scene's textures. A file that cannot be
    /// decoded causes a warning, and the diffuse colour is used instead.
    pub(super) fn load_mapped(
        &mut self,
        set: usize,
        scene: &mut Arc<RenderScene>,
    ) -> Result<Vec<(TextureSource, u32)>, RenderError> {
        let mut sources: Vec<TextureSource> = Vec::new();
        for (pattern, source) in mapped_textures(&self.plan, set) {
            let is_used = scene.materials.iter().any(|material| pattern.matches(&material.name));
            if is_used && !sources.contains(&source) {
                sources.push(source);
            }
        }
        if sources.is_empty() || scene.geometry.texcoords.is_empty() {
            return Ok(Vec::new());
        }
        let start = Instant::now();
        let (project, space) = (&self.plan.project.path, self.plan.display.space);
        let left = self.plan.settings.max_memory.saturating_sub(self.plan.target_bytes());
        let decoded = image_files(&sources, space, (project, left), &mut self.warnings);
        let (textures, indices) =
            decoded.map_err(|error| RenderError::Scene { place: project.display().to_string(), error })?;
        let row = self.timeline.record(StepKind::Load, "textures of materials", start.elapsed());
        row.note = format!("{} textures", textures.len());
        let first = scene.textures.len() as u32;
        Arc::make_mut(scene).textures.extend(textures);
        let loaded = sources.into_iter().zip(indices);
        Ok(loaded.filter_map(|(source, index)| Some((source, first + index?))).collect())
    }

    /// Loads the image files that the shader of a quad or compute pass samples, unless they are loaded already.
    pub(super) fn load_sampled(&mut self, shader: &OwnShader) -> Result<(), BackendError> {
        let backend = self.engines.raster.name();
        let failed =
            |error: SceneError| BackendError::Device { backend, message: format!("{}: {error}", shader.place) };
        for path in shader.textures.iter().flat_map(ShaderTexture::files) {
            if !self.quad_images.iter().any(|(loaded, _)| loaded == path) {
                let held: u64 = self.quad_images.iter().map(|(_, image)| bytes_of(image)).sum();
                let left = self.plan.settings.max_memory.saturating_sub(self.plan.target_bytes() + held);
                let image = image_file(path, left).map_err(failed)?;
                self.quad_images.push((path.clone(), image));
            }
        }
        check_cubes(shader, |path| image_of(&self.quad_images, path)).map_err(failed)
    }
}
