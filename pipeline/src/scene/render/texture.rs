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
    // A decoder may need its own buffer, of at most 16 bytes a texel, besides.
    let decoded: Vec<Option<Result<Texture, String>>> = sources
        .par_iter()
        .zip(sizes)
        .map(|(source, size)| size.map(|size| size.and_then(|_| decode(source))))
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

fn decode(source: &TextureSource) -> Result<Texture, String> {
    let image = pixels(source)?;
    let (width, height) = image.dimensions();
    let texels = image.pixels().map(|pixel| pixel.0).collect();
    Ok(Texture::new(source.name(), width, height, texels))
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

/// Puts the mask's red channel in the image's alpha; masks of another size are read at the nearest texel.
fn mask_alpha(image: &mut RgbaImage, mask: &RgbaImage) {
    let (width, height) = image.dimensions();
    let nearest = |at: u32, side: u32, mask_side: u32| {
        let texel = (2 * u64::from(at) + 1) * u64::from(mask_side) / (2 * u64::from(side));
        texel.min(u64::from(mask_side) - 1) as u32
    };
    for (x, y, pixel) in image.enumerate_pixels_mut() {
        let [red, ..] = mask.get_pixel(nearest(x, width, mask.width()), nearest(y, height, mask.height())).0;
        pixel.0[3] = red;
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
    let mut limits = image::Limits::no_limits();
    // The side is checked by `size`, which can say so better; this bounds what a decoder allocates by itself.
    limits.max_alloc = Some(u64::from(MAX_SIDE) * u64::from(MAX_SIDE) * 16);
    reader.limits(limits);
    reader.into_decoder().map_err(|error| error.to_string())
}

/// All pixels as 8-bit RGBA; 16-bit and floating-point channels are reduced.
fn read<'a, R: BufRead + Seek + 'a>(bytes: R, path: Option<&Path>) -> Result<RgbaImage, String> {
    let decoder = decoder(bytes, path)?;
    let image = image::DynamicImage::from_decoder(decoder).map_err(|error| error.to_string())?;
    let image = image.into_rgba8();
    if image.width() == 0 || image.height() == 0 { Err("the image is empty".to_owned()) } else { Ok(image) }
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
