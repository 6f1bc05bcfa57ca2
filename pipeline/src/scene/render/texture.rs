//! Decoding of textures, in parallel and within limits.

use super::super::context::no_file_refused;
use super::super::error::{Budget, SceneError};
use super::super::texture::{Level, Texture};
use super::super::{Material, TextureSource};
use crate::color::ColorSpace;
use crate::diagnostic::Warnings;
use crate::files;
use crate::guard;
use crate::image::decode::{Encoded, Fault, rgba8};
use image::{ImageDecoder, ImageFormat, ImageReader, RgbaImage};
use rayon::prelude::*;
use std::collections::HashSet;
use std::io::{BufReader, Cursor};
use std::path::Path;

/// Longest side of a texture, texels.
const MAX_SIDE: u32 = 16_384;

/// Remedy in warnings about a missing normal map.
pub(in crate::scene) const NO_NORMAL_MAP: &str = "the normals of the vertices serve";
/// Remedy in warnings about a missing texture of glass: of its roughness or its transmission.
pub(in crate::scene) const NO_GLASS_MAP: &str = "the factor alone serves";

/// Decodes the textures that materials use, and renumbers the references to them. A texture that cannot be decoded is counted as a
/// warning and removed from its materials.
pub(super) fn decode_used(
    materials: &mut [Material],
    sources: &[TextureSource],
    space: ColorSpace,
    file: &Path,
    budget: &mut Budget,
    warnings: &mut Warnings,
) -> Result<Vec<Texture>, SceneError> {
    drop(files::refused());
    let mut used = vec![false; sources.len()];
    for texture in materials.iter().flat_map(Material::textures) {
        used[texture as usize] = true;
    }
    let cut_out = cut_out(materials, sources.len());
    // A decoder of JPEG reads a whole file even for its header. Each thread reads one file at a time.
    let mut encoded: Vec<u64> =
        sources.iter().zip(&used).filter(|(_, used)| **used).map(|(source, _)| encoded_bytes(source)).collect();
    encoded.sort_unstable_by_key(|bytes| std::cmp::Reverse(*bytes));
    let read = encoded.iter().take(rayon::current_num_threads()).sum();
    budget.take(file, "the files of the textures", read)?;
    budget.give_back(read);
    // Headers are read first, so that the memory for all textures is known before any is decoded.
    let costs: Vec<Option<Result<Cost, String>>> =
        sources.par_iter().zip(used).map(|(source, used)| used.then(|| cost(source))).collect();
    let mut working = Vec::new();
    for (source, cost) in sources.iter().zip(&costs) {
        if let Some(Ok(cost)) = cost {
            // The mip chain adds a third.
            budget.take(file, &format!("the texels of {}", source.name()), cost.texels * 4 * 4 / 3)?;
            working.push((cost.working, source));
        }
    }
    // One texture per thread is decoded at a time; in the worst case these are the largest textures.
    working.sort_by_key(|(bytes, _)| std::cmp::Reverse(*bytes));
    working.truncate(rayon::current_num_threads());
    let mut booked = 0;
    for (bytes, source) in working {
        budget.take(file, &format!("the decoder of {}", source.name()), bytes)?;
        booked += bytes;
    }
    budget.give_back(booked);
    let decoded: Vec<Option<Result<Level, Fault>>> = sources
        .par_iter()
        .zip(costs)
        .with_max_len(1)
        .map(|(source, cost)| cost.map(|cost| cost.map_err(Fault::Broken).and_then(|_| decode(source))))
        .collect();
    // Mip levels are built for one texture at a time, each by all threads, so that no thread is left with a large texture at the end.
    let named = sources.iter().map(TextureSource::name);
    let decoded = decoded.into_iter().zip(named).zip(cut_out).zip(sources).map(|(((base, name), cut_out), source)| {
        let space = if source.is_data() { ColorSpace::Report } else { space };
        let sampling = source.texels().1;
        base.map(|base| base.map(|base| Texture { sampling, ..Texture::build(name, base, cut_out, space) }))
    });

    no_file_refused()?;

    let mut textures = Vec::new();
    let mut new_index = vec![None; sources.len()];
    let of = |map: fn(&Material) -> Option<u32>| -> HashSet<u32> { materials.iter().filter_map(map).collect() };
    let [colors, normal_maps, glows] = [
        of(|material| material.texture),
        of(|material| material.normal_texture),
        of(|material| material.emission_texture),
    ];
    for (((index, source), decoded), new_index) in (0_u32..).zip(sources).zip(decoded).zip(&mut new_index) {
        match decoded {
            Some(Ok(texture)) => {
                *new_index = Some(textures.len() as u32);
                textures.push(texture);
            }
            Some(Err(Fault::Refused(refused))) => {
                return Err(SceneError::file(file, format!("the texels of {}: {refused}", source.name())));
            }
            Some(Err(Fault::Broken(why))) => {
                let remedy = if glows.contains(&index) && !colors.contains(&index) {
                    "the surfaces do not emit"
                } else if !source.is_data() {
                    "the diffuse colour serves"
                } else if source.is_clear() {
                    "their materials are opaque"
                } else if normal_maps.contains(&index) {
                    NO_NORMAL_MAP
                } else {
                    NO_GLASS_MAP
                };
                warnings.add(file, "textures that cannot be decoded", remedy, || format!("{}: {why}", source.name()))
            }
            None => {}
        }
    }
    for material in materials {
        let lost = material.emission_texture.is_some_and(|texture| new_index[texture as usize].is_none());
        if lost {
            // Without its texture the factor alone would make the whole surface emit.
            material.emission = Material::default().emission;
        }
        let blended = material.transmission_texture.is_some_and(|texture| sources[texture as usize].is_clear());
        for texture in material.textures_mut() {
            *texture = texture.and_then(|texture| new_index[texture as usize]);
        }
        if blended && material.transmission_texture.is_none() {
            // Without the texture's alpha the whole surface would be clear.
            material.transmission = 0.0;
        }
        if material.texture.is_none() && !material.vertex_colors {
            // Without the texture's alpha nothing can be cut.
            material.alpha_cutoff = None;
        }
    }
    Ok(textures)
}

/// Decodes an image file as a texture that repeats and whose colours are read as stored. Decoding may take at most `most` bytes of memory.
pub(crate) fn image_file(path: &Path, most: u64) -> Result<Texture, SceneError> {
    let source = TextureSource::File(path.to_owned());
    let broken = |why: String| SceneError::file(path, why);
    let cost = cost(&source).map_err(broken)?;
    Budget::new(most).take(path, "the texels", cost.texels * 4 * 4 / 3 + cost.working)?;
    let base = decode(&source).map_err(|fault| SceneError::file(path, fault.to_string()))?;
    Ok(Texture::build(source.name(), base, false, ColorSpace::Report))
}

/// Decodes textures of colours, whose texels take at most `most` bytes. Returns the textures, and for each source the index of its texture.
/// A source that cannot be decoded has no index; it is counted as a warning about `by`, the file that names it.
pub(crate) fn image_files(
    sources: &[TextureSource],
    space: ColorSpace,
    (by, most): (&Path, u64),
    warnings: &mut Warnings,
) -> Result<(Vec<Texture>, Vec<Option<u32>>), SceneError> {
    let of = |index| Material { texture: Some(index), ..Material::default() };
    let mut materials: Vec<Material> = (0..sources.len() as u32).map(of).collect();
    let textures = decode_used(&mut materials, sources, space, by, &mut Budget::new(most), warnings)?;
    Ok((textures, materials.iter().map(|material| material.texture).collect()))
}

/// Memory for a texture.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Cost {
    /// Number of texels of level 0.
    pub(super) texels: u64,
    /// Further bytes that are needed while it is decoded.
    pub(super) working: u64,
}

/// Determines the cost from the image headers alone; the error says why the image cannot be decoded.
pub(super) fn cost(source: &TextureSource) -> Result<Cost, String> {
    match source {
        TextureSource::File(path) => cost_of_file(path),
        TextureSource::Embedded { bytes, .. } => {
            cost_of(decoder_and_format(Box::new(Cursor::new(&bytes[..])), None)?, bytes.len() as u64)
        }
        TextureSource::Masked { color, mask } => {
            let (color, mask) = (cost_of_file(color), cost_of_file(mask)?);
            let color = color?;
            Ok(Cost { texels: color.texels, working: color.working.max(4 * mask.texels + mask.working) })
        }
        TextureSource::Sampled { source, .. }
        | TextureSource::Data { source }
        | TextureSource::Clear { source, .. } => cost(source),
    }
}

fn cost_of_file(path: &Path) -> Result<Cost, String> {
    cost_of(decoder_and_format(open(path)?, Some(path))?, length(path))
}

/// Bytes of a source's largest encoded image.
pub(super) fn encoded_bytes(source: &TextureSource) -> u64 {
    match source.texels().0 {
        TextureSource::File(path) => length(path),
        TextureSource::Masked { color, mask } => length(color).max(length(mask)),
        TextureSource::Embedded { bytes, .. } => bytes.len() as u64,
        _ => 0,
    }
}

fn length(path: &Path) -> u64 {
    std::fs::metadata(path).map_or(0, |metadata| metadata.len())
}

/// The memory that decoding takes. Pixels of more than four bytes are decoded as they are and then narrowed in place. A JPEG decoder also
/// keeps the file's bytes and, if the file is progressive, a coefficient of 2 bytes for each value. A WebP decoder also keeps the file's
/// bytes and up to 8 bytes a texel. A TIFF decoder may keep a whole picture (in a file of one strip). For the rows and tables of every
/// decoder 1 MiB is counted.
fn cost_of((decoder, format): (impl ImageDecoder, ImageFormat), file: u64) -> Result<Cost, String> {
    let (width, height) = within_limits(decoder.dimensions())?;
    let (texels, stored) = (u64::from(width) * u64::from(height), decoder.total_bytes());
    let own = match format {
        ImageFormat::Jpeg => file + 2 * stored,
        ImageFormat::Tiff => stored,
        ImageFormat::WebP => file + 8 * texels,
        _ => 0,
    };
    Ok(Cost { texels, working: stored.saturating_sub(4 * texels) + own + (1 << 20) })
}

fn within_limits((width, height): (u32, u32)) -> Result<(u32, u32), String> {
    if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE {
        return Err(format!("{width} x {height} texels; valid: 1 to {MAX_SIDE} a side"));
    }
    Ok((width, height))
}

/// By texture: whether some material cuts it out by its alpha.
fn cut_out(materials: &[Material], textures: usize) -> Vec<bool> {
    let mut cut_out = vec![false; textures];
    for material in materials {
        if let (Some(texture), Some(_)) = (material.texture, material.cutoff()) {
            cut_out[texture as usize] = true;
        }
    }
    cut_out
}

/// Decodes on the calling thread. If a decoder waited for other threads, the calling thread could start further decoders meanwhile.
fn decode(source: &TextureSource) -> Result<Level, Fault> {
    let image = pixels(source)?;
    let (width, height) = image.dimensions();
    // Both types have four bytes a texel; the copy is made only if the decoder's list has spare capacity.
    let texels = bytemuck::try_cast_vec(image.into_raw()).unwrap_or_else(|(_, bytes)| bytes.as_chunks().0.to_vec());
    Ok(Level { width, height, texels })
}

pub(super) fn pixels(source: &TextureSource) -> Result<RgbaImage, Fault> {
    match source {
        TextureSource::File(path) => read(open(path)?, Some(path)),
        TextureSource::Embedded { bytes, .. } => read(Box::new(Cursor::new(&bytes[..])), None),
        TextureSource::Masked { color, mask } => {
            let mut image = read(open(color)?, Some(color))?;
            let mask = read(open(mask)?, Some(mask)).map_err(|fault| match fault {
                Fault::Broken(why) => Fault::Broken(format!("{}: {why}", mask.display())),
                refused => refused,
            })?;
            mask_alpha(&mut image, &mask);
            Ok(image)
        }
        TextureSource::Sampled { source, .. } | TextureSource::Data { source } => pixels(source),
        TextureSource::Clear { source, opacity } => {
            let mut image = pixels(source)?;
            for pixel in image.pixels_mut() {
                pixel.0 = [u8::MAX - times(pixel.0[3], *opacity); 4];
            }
            Ok(image)
        }
    }
}

/// Stores a mask in the image's alpha: the mask's alpha channel if it is transparent anywhere, otherwise its red channel. Masks of
/// another size are read at the nearest texel.
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

fn open(path: &Path) -> Result<Encoded<'static>, String> {
    match files::open(path) {
        Ok(file) => Ok(Box::new(BufReader::new(file))),
        Err(error) => Err(error.to_string()),
    }
}

/// A decoder with limits. The first bytes determine the format, or else (TGA has no signature) the extension.
fn decoder<'a>(bytes: Encoded<'a>, path: Option<&Path>) -> Result<impl ImageDecoder + use<'a>, String> {
    decoder_and_format(bytes, path).map(|(decoder, _)| decoder)
}

/// Like [`decoder`], and also returns the format.
fn decoder_and_format<'a>(
    bytes: Encoded<'a>,
    path: Option<&Path>,
) -> Result<(impl ImageDecoder + use<'a>, ImageFormat), String> {
    let reader = guard::call("image", || ImageReader::new(bytes).with_guessed_format())?;
    let reader = reader.map_err(|error| error.to_string())?;
    let by_name = || path.and_then(|path| ImageFormat::from_path(path).ok());
    let format = reader
        .format()
        .or_else(by_name)
        .ok_or("the image format is not known; valid: PNG, JPEG, WebP, TGA, TIFF, BMP, DDS")?;
    let mut reader = ImageReader::with_format(reader.into_inner(), format);
    reader.limits(limits(0));
    Ok((guard::call("image", || reader.into_decoder())?.map_err(|error| error.to_string())?, format))
}

/// Limit of a decoder's own allocations: 16 bytes a texel (the widest format) plus 64 MiB for its tables. [`within_limits`] checks
/// the sides, with a better message.
fn limits(texels: u64) -> image::Limits {
    let mut limits = image::Limits::no_limits();
    limits.max_alloc = Some((64 << 20) + 16 * texels);
    limits
}

/// Reads all pixels as 8-bit RGBA; 16-bit and floating-point channels are reduced.
fn read(bytes: Encoded<'_>, path: Option<&Path>) -> Result<RgbaImage, Fault> {
    let mut decoder = decoder(bytes, path)?;
    let (width, height) = within_limits(decoder.dimensions())?;
    let limited = guard::call("image", || decoder.set_limits(limits(u64::from(width) * u64::from(height))))?;
    limited.map_err(|error| error.to_string())?;
    let texels = bytemuck::cast_vec(rgba8(decoder)?);
    RgbaImage::from_raw(width, height, texels)
        .ok_or_else(|| Fault::Broken("the decoder made another number of texels".to_owned()))
}

/// The encoded bytes and the extension for a file that holds the texture: an embedded image unchanged, two combined files as a PNG.
pub(in crate::scene) fn encoded(source: &TextureSource) -> Result<(Vec<u8>, &'static str), String> {
    if let TextureSource::Embedded { bytes, .. } = source.texels().0 {
        let format = guard::call("image", || image::guess_format(bytes))?.map_err(|error| error.to_string())?;
        let extension = format.extensions_str().first().copied().unwrap_or("png");
        return Ok((bytes.to_vec(), extension));
    }
    cost(source)?;
    let mut png = Cursor::new(Vec::new());
    let pixels = pixels(source).map_err(|fault| fault.to_string())?;
    guard::call("image", || pixels.write_to(&mut png, ImageFormat::Png))?.map_err(|error| error.to_string())?;
    Ok((png.into_inner(), "png"))
}

/// Whether an image file has an alpha channel, by its header; `false` if it cannot be read.
pub(in crate::scene) fn image_has_alpha(path: &Path) -> bool {
    open(path).and_then(|bytes| decoder(bytes, Some(path))).is_ok_and(|decoder| decoder.color_type().has_alpha())
}

/// Number of channels of an image file, by its header.
///
/// # Errors
/// If it cannot be read.
#[cfg(feature = "glsl")]
pub(crate) fn image_channels(path: &Path) -> Result<u8, String> {
    Ok(decoder(open(path)?, Some(path))?.color_type().channel_count())
}

/// Whether an image file has a texel with alpha below `cutoff`; `None` if it cannot be read.
pub(in crate::scene) fn is_cut_out(path: &Path, cutoff: f32, budget: &mut Budget) -> Result<Option<bool>, SceneError> {
    let Ok(header) = open(path).and_then(|bytes| decoder(bytes, Some(path))) else { return Ok(None) };
    if !header.color_type().has_alpha() {
        return Ok(Some(false));
    }
    let Ok((width, height)) = within_limits(header.dimensions()) else { return Ok(None) };
    let bytes = u64::from(width) * u64::from(height) * 4;
    budget.take(path, "the texels", bytes)?;
    let image = open(path).map_err(Fault::from).and_then(|bytes| read(bytes, Some(path)));
    let found = image.map(|image| image.pixels().any(|pixel| f32::from(pixel.0[3]) < cutoff * 255.0));
    budget.give_back(bytes);
    Ok(found.ok())
}

/// An alpha times an opacity in 65,535ths, rounded to the nearest.
pub(super) fn times(alpha: u8, opacity: u16) -> u8 {
    ((u32::from(alpha) * u32::from(opacity) + 32_767) / 65_535) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn alphas_times_opacities_are_rounded_to_the_nearest() {
        for (alpha, opacity) in
            [(0, 65_535), (255, 0), (255, 65_535), (200, 32_768), (1, 32_767), (3, 21_845), (254, 65_534)]
        {
            let exact = f64::from(alpha) * f64::from(opacity) / 65_535.0;
            assert!((f64::from(times(alpha, opacity)) - exact).abs() <= 0.5, "{alpha} {opacity}");
        }
    }
}
