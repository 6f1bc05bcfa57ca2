//! Decoding of textures, in parallel and within limits.

use super::super::error::{Budget, SceneError};
use super::super::texture::Texture;
use super::super::{Material, TextureSource};
use crate::diagnostic::Warnings;
use image::{ImageDecoder, ImageFormat, ImageReader, RgbaImage};
use rayon::prelude::*;
use std::io::{BufRead, BufReader, Cursor, Seek};
use std::path::Path;

/// The longest side of a texture, texels.
const MAX_SIDE: u32 = 16_384;

/// Decodes the textures that materials refer to, and makes the references count the decoded ones. A texture that
/// cannot be decoded is counted as a warning and dropped from its materials.
pub(super) fn decode_used(
    materials: &mut [Material],
    sources: &[TextureSource],
    file: &Path,
    budget: &mut Budget,
    warnings: &mut Warnings,
) -> Result<Vec<Texture>, SceneError> {
    let mut used = vec![false; sources.len()];
    for texture in materials.iter().filter_map(|material| material.texture) {
        used[texture as usize] = true;
    }
    let cutoffs = cutoffs(materials, sources.len());
    // The headers first: what all of them need is known before anything is decoded.
    let sizes: Vec<Option<Result<(u32, u32), String>>> =
        sources.par_iter().zip(used).map(|(source, used)| used.then(|| size(source))).collect();
    for (source, size) in sources.iter().zip(&sizes) {
        if let Some(Ok((width, height))) = size {
            // The mip chain adds a third.
            let bytes = u64::from(*width) * u64::from(*height) * 4 * 4 / 3;
            budget.take(file, &format!("the texels of {}", source.name()), bytes)?;
        }
    }
    // What decoders need besides, while they run, is bounded by `limits`.
    let decoded: Vec<Option<Result<Texture, String>>> = sources
        .par_iter()
        .zip(sizes)
        .zip(cutoffs)
        .map(|((source, size), cutoff)| size.map(|size| size.and_then(|_| decode(source, cutoff))))
        .collect();

    let mut textures = Vec::new();
    let mut new_index = vec![None; sources.len()];
    for ((source, decoded), new_index) in sources.iter().zip(decoded).zip(&mut new_index) {
        match decoded {
            Some(Ok(texture)) => {
                *new_index = Some(textures.len() as u32);
                textures.push(texture);
            }
            Some(Err(why)) => {
                warnings.add(file, "textures that cannot be decoded", "the diffuse colour serves", || {
                    format!("{}: {why}", source.name())
                })
            }
            None => {}
        }
    }
    for material in materials {
        material.texture = material.texture.and_then(|texture| new_index[texture as usize]);
        if material.texture.is_none() {
            // Without a texture there is nothing to cut by.
            material.alpha_cutoff = None;
        }
    }
    Ok(textures)
}

fn size(source: &TextureSource) -> Result<(u32, u32), String> {
    match source {
        TextureSource::File(path) => within_limits(decoder(open(path)?, Some(path))?.dimensions()),
        TextureSource::Embedded { bytes, .. } => within_limits(decoder(Cursor::new(&bytes[..]), None)?.dimensions()),
        TextureSource::Masked { color, mask } => {
            within_limits(decoder(open(mask)?, Some(mask))?.dimensions())?;
            within_limits(decoder(open(color)?, Some(color))?.dimensions())
        }
    }
}

fn within_limits((width, height): (u32, u32)) -> Result<(u32, u32), String> {
    if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE {
        return Err(format!("{width} x {height} texels; valid: 1 to {MAX_SIDE} a side"));
    }
    Ok((width, height))
}

/// By texture: the cutoff that its mip levels keep the coverage of. Of several materials' the lowest serves.
fn cutoffs(materials: &[Material], textures: usize) -> Vec<Option<f32>> {
    let mut cutoffs: Vec<Option<f32>> = vec![None; textures];
    for material in materials {
        if let (Some(texture), Some(cutoff)) = (material.texture, material.texture_cutoff()) {
            let known = &mut cutoffs[texture as usize];
            *known = Some(known.map_or(cutoff, |known| known.min(cutoff)));
        }
    }
    cutoffs
}

fn decode(source: &TextureSource, cutoff: Option<f32>) -> Result<Texture, String> {
    let image = pixels(source)?;
    let (width, height) = image.dimensions();
    // Four bytes a texel either way; the copy is only made where the decoder's list has room left over.
    let texels = bytemuck::try_cast_vec(image.into_raw()).unwrap_or_else(|(_, bytes)| bytes.as_chunks().0.to_vec());
    Ok(match cutoff {
        Some(cutoff) => Texture::cut_out(source.name(), width, height, texels, cutoff),
        None => Texture::new(source.name(), width, height, texels),
    })
}

fn pixels(source: &TextureSource) -> Result<RgbaImage, String> {
    match source {
        TextureSource::File(path) => read(open(path)?, Some(path)),
        TextureSource::Embedded { bytes, .. } => read(Cursor::new(&bytes[..]), None),
        TextureSource::Masked { color, mask } => {
            let mut image = read(open(color)?, Some(color))?;
            let mask = read(open(mask)?, Some(mask)).map_err(|why| format!("{}: {why}", mask.display()))?;
            mask_alpha(&mut image, &mask);
            Ok(image)
        }
    }
}

/// Puts the mask in the image's alpha: its own alpha where it is transparent anywhere, its red channel otherwise. Masks
/// of another size are read at the nearest texel.
fn mask_alpha(image: &mut RgbaImage, mask: &RgbaImage) {
    let channel = if mask.pixels().any(|pixel| pixel.0[3] < u8::MAX) { 3 } else { 0 };
    let (width, height) = image.dimensions();
    let nearest = |at: u32, side: u32, mask_side: u32| {
        let texel = (2 * u64::from(at) + 1) * u64::from(mask_side) / (2 * u64::from(side));
        texel.min(u64::from(mask_side) - 1) as u32
    };
    for (x, y, pixel) in image.enumerate_pixels_mut() {
        let texel = mask.get_pixel(nearest(x, width, mask.width()), nearest(y, height, mask.height()));
        pixel.0[3] = texel.0[channel];
    }
}

fn open(path: &Path) -> Result<BufReader<std::fs::File>, String> {
    std::fs::File::open(path).map(BufReader::new).map_err(|error| error.to_string())
}

/// A decoder with limits, for the format that the first bytes tell, or else (TGA has no signature) the extension.
fn decoder<'a, R: BufRead + Seek + 'a>(
    bytes: R,
    path: Option<&Path>,
) -> Result<impl ImageDecoder + use<'a, R>, String> {
    let reader = ImageReader::new(bytes).with_guessed_format().map_err(|error| error.to_string())?;
    let by_name = || path.and_then(|path| ImageFormat::from_path(path).ok());
    let format = reader
        .format()
        .or_else(by_name)
        .ok_or("the image format is not known; valid: PNG, JPEG, TGA, TIFF, BMP, DDS")?;
    let mut reader = ImageReader::with_format(reader.into_inner(), format);
    reader.limits(limits(0));
    reader.into_decoder().map_err(|error| error.to_string())
}

/// What a decoder may allocate by itself: 16 bytes a texel (the widest format), and some for its tables. The sides are
/// checked by [`within_limits`], which can say so better.
fn limits(texels: u64) -> image::Limits {
    let mut limits = image::Limits::no_limits();
    limits.max_alloc = Some((64 << 20) + 16 * texels);
    limits
}

/// All pixels as 8-bit RGBA; 16-bit and floating-point channels are reduced.
fn read<'a, R: BufRead + Seek + 'a>(bytes: R, path: Option<&Path>) -> Result<RgbaImage, String> {
    let mut decoder = decoder(bytes, path)?;
    let (width, height) = within_limits(decoder.dimensions())?;
    decoder.set_limits(limits(u64::from(width) * u64::from(height))).map_err(|error| error.to_string())?;
    let image = image::DynamicImage::from_decoder(decoder).map_err(|error| error.to_string())?;
    Ok(image.into_rgba8())
}

/// The bytes and the extension of a file that holds the texture: an embedded image as it is, two files put together
/// as a PNG.
pub(in crate::scene) fn encoded(source: &TextureSource) -> Result<(Vec<u8>, &'static str), String> {
    if let TextureSource::Embedded { bytes, .. } = source {
        let format = image::guess_format(bytes).map_err(|error| error.to_string())?;
        let extension = format.extensions_str().first().copied().unwrap_or("png");
        return Ok((bytes.clone(), extension));
    }
    size(source)?;
    let mut png = Cursor::new(Vec::new());
    pixels(source)?.write_to(&mut png, ImageFormat::Png).map_err(|error| error.to_string())?;
    Ok((png.into_inner(), "png"))
}

/// Whether an image file has an alpha channel, from its header alone; `false` where it cannot be read.
pub(in crate::scene) fn image_has_alpha(path: &Path) -> bool {
    open(path).and_then(|bytes| decoder(bytes, Some(path))).is_ok_and(|decoder| decoder.color_type().has_alpha())
}

/// Whether an image file has an alpha channel and a texel below that alpha; `false` where it cannot be read.
pub(in crate::scene) fn is_cut_out(path: &Path, cutoff: f32, budget: &mut Budget) -> Result<bool, SceneError> {
    let header = open(path).and_then(|bytes| decoder(bytes, Some(path)));
    let Ok((width, height)) = header.and_then(|decoder| match decoder.color_type().has_alpha() {
        true => within_limits(decoder.dimensions()),
        false => Err(String::new()),
    }) else {
        return Ok(false);
    };
    let bytes = u64::from(width) * u64::from(height) * 4;
    budget.take(path, "the texels", bytes)?;
    let image = open(path).and_then(|bytes| read(bytes, Some(path)));
    let found = image.is_ok_and(|image| image.pixels().any(|pixel| f32::from(pixel.0[3]) < cutoff * 255.0));
    budget.give_back(bytes);
    Ok(found)
}
