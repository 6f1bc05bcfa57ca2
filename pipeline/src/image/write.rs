//! Writing images. A file is written whole or not at all.
//!
//! Encoders request rows and write as they go. They hold a few rows, and neither a copy of the picture nor the whole file.

use super::Image;
use super::rows::{ImageRows, Rows};
use crate::color::ColorSpace;
use crate::files::Replacement;
use crate::memory;
use exr::block::writer::ChunksWriter as _;
use exr::block::{BlockIndex, UncompressedBlock};
use exr::compression::Compression;
use exr::math::{RoundingMode, Vec2};
use exr::meta::BlockDescription;
use exr::meta::attribute::{AttributeValue, ChannelDescription, LevelMode, LineOrder, SampleType, TileDescription};
use exr::meta::header::{Header, ImageAttributes};
use exr::prelude::Text;
use rayon::prelude::*;
use std::io::{self, BufWriter, Seek, Write};
use std::path::Path;

/// Attribute of an EXR layer that names the colour space of its pixels: `linear` or `report`.
pub const COLOR_ATTRIBUTE: &str = "curitiba.color";

/// Number of rows that an encoder requests at once: the height of a tile of an EXR file.
const ROWS: u32 = 64;

/// Size of the write buffer, bytes.
const BUFFER: usize = 256 << 10;

/// Writes a file whole or not at all; see [`Replacement`].
fn write_whole(path: &Path, write: impl FnOnce(&mut BufWriter<&mut Replacement>) -> io::Result<()>) -> io::Result<()> {
    let mut file = Replacement::begin(path)?;
    let mut buffered = BufWriter::with_capacity(BUFFER, &mut file);
    write(&mut buffered)?;
    buffered.flush()?;
    drop(buffered);
    file.commit()
}

/// Writes an 8-bit RGB PNG. Values are clamped to 0..=1 and stored without a transfer function, as the report's engine showed its
/// frame buffer; NaN is stored as 0. [`write_displayed`](super::write_displayed) writes linear radiance.
///
/// # Errors
/// Whatever the file system reports.
pub fn write_png(path: &Path, image: &Image) -> io::Result<()> {
    write_png_rows(path, &mut ImageRows::from(image))
}

/// [`write_png`] for a picture whose rows are made while it is written.
///
/// # Errors
/// Whatever the rows or the file system report.
pub fn write_png_rows(path: &Path, rows: &mut dyn Rows) -> io::Result<()> {
    write_whole(path, |file| encode_png(file, rows))
}

/// Writes codes as an 8-bit RGB PNG: `width * height` pixels, top row first. The fourth byte of each pixel is not written.
///
/// # Errors
/// If there are too few pixels, or whatever the file system reports.
pub fn write_png_codes(path: &Path, width: u32, height: u32, pixels: &[[u8; 4]]) -> io::Result<()> {
    let mut left = pixels;
    write_whole(path, |file| {
        encode_png_bytes(file, width, height, |count, bytes| {
            let (rows, rest) = left.split_at((width as usize * count as usize).min(left.len()));
            left = rest;
            bytes.clear();
            bytes.extend(complete(rows, width, count)?.iter().map(|[r, g, b, _]| [*r, *g, *b]));
            Ok(())
        })
    })
}

/// Encodes an 8-bit RGB PNG as [`write_png`] writes it.
///
/// # Errors
/// Whatever the rows or the writer report.
pub fn encode_png(file: impl Write, rows: &mut dyn Rows) -> io::Result<()> {
    let [width, height] = rows.size();
    encode_png_bytes(file, width, height, |count, bytes| {
        let pixels = complete(rows.next(count)?, width, count)?;
        pixels.par_iter().with_min_len(4096).map(|pixel| [0, 1, 2].map(|i| byte(pixel[i]))).collect_into_vec(bytes);
        Ok(())
    })
}

/// Encodes an 8-bit RGB PNG. `next` is called with a number of rows and returns the bytes of that many.
fn encode_png_bytes(
    file: impl Write,
    width: u32,
    height: u32,
    mut next: impl FnMut(u32, &mut Vec<[u8; 3]>) -> io::Result<()>,
) -> io::Result<()> {
    let mut encoder = png::Encoder::new(file, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_filter(png::Filter::Adaptive);
    let mut header = encoder.write_header()?;
    let mut writer = header.stream_writer_with_size(BUFFER)?;
    let mut bytes: Vec<[u8; 3]> = memory::with_capacity(width as usize * ROWS.min(height) as usize)?;
    for first in (0..height).step_by(ROWS as usize) {
        next(ROWS.min(height - first), &mut bytes)?;
        writer.write_all(bytes.as_flattened())?;
    }
    writer.finish()?;
    header.finish()?;
    Ok(())
}

/// The 8-bit code of a value, as PNG files store it: clamped to 0..=1, times 255, rounded; NaN gives 0.
#[must_use]
pub fn byte(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// Checks that `pixels` holds as many rows as requested; otherwise the file would end early.
fn complete<T>(pixels: &[T], width: u32, rows: u32) -> io::Result<&[T]> {
    if pixels.len() == width as usize * rows as usize {
        return Ok(pixels);
    }
    Err(io::Error::new(io::ErrorKind::InvalidInput, "the picture has fewer rows than it says"))
}

/// One named layer of an EXR file.
#[derive(Debug, Clone, Copy)]
pub struct Layer<'a> {
    /// Name of the layer, such as `Deferred Render Targets::pos`.
    pub name: &'a str,
    /// Names of the four channels, such as `R G B W` or `X Y Z cosine`.
    pub channels: [&'a str; 4],
    /// The pixels.
    pub image: &'a Image,
}

/// A layer whose rows are made while they are written.
pub struct RowLayer<'a> {
    /// Name of the layer, such as `Deferred Render Targets::pos`.
    pub name: &'a str,
    /// Names of the four channels, such as `R G B W` or `X Y Z cosine`.
    pub channels: [&'a str; 4],
    /// The rows of pixels.
    pub rows: &'a mut dyn Rows,
}

/// Writes one layer as an EXR file of 32-bit floats.
///
/// # Errors
/// Whatever the encoder or the file system report.
pub fn write_exr(path: &Path, layer: Layer<'_>) -> io::Result<()> {
    write_exr_layers(path, &[layer])
}

/// [`write_exr`] with the colour space in the attribute [`COLOR_ATTRIBUTE`], which [`read_image`](super::read_image) reads back.
/// Other programs take all EXR files for linear. `space` is `None` for layers that hold no colour.
///
/// # Errors
/// As [`write_exr`].
pub fn write_exr_of(path: &Path, layer: Layer<'_>, space: Option<ColorSpace>) -> io::Result<()> {
    let mut rows = ImageRows::from(layer.image);
    let layer = RowLayer { name: layer.name, channels: layer.channels, rows: &mut rows };
    write_exr_rows_of(path, &mut [layer], space)
}

/// Writes layers as one EXR file of 32-bit floats. A layer named [`VARIANCE_LAYER`](super::VARIANCE_LAYER), or `variance:N` if it
/// was estimated from N samples, is read by [`read_image`](super::read_image) as the variance of another layer, which is a mean.
///
/// # Errors
/// Without a layer, or whatever the encoder or the file system report.
pub fn write_exr_layers(path: &Path, layers: &[Layer<'_>]) -> io::Result<()> {
    let mut rows: Vec<ImageRows<'_>> = layers.iter().map(|layer| layer.image.into()).collect();
    let mut layers: Vec<RowLayer<'_>> = layers
        .iter()
        .zip(&mut rows)
        .map(|(layer, rows)| RowLayer { name: layer.name, channels: layer.channels, rows })
        .collect();
    write_exr_rows(path, &mut layers)
}

/// [`write_exr_layers`] for pictures whose rows are made while they are written, one layer after the other.
///
/// # Errors
/// As [`write_exr_layers`], or whatever the rows report.
pub fn write_exr_rows(path: &Path, layers: &mut [RowLayer<'_>]) -> io::Result<()> {
    write_exr_rows_of(path, layers, None)
}

/// [`write_exr_rows`] with the colour space, as in [`write_exr_of`].
///
/// # Errors
/// As [`write_exr_rows`].
pub fn write_exr_rows_of(path: &Path, layers: &mut [RowLayer<'_>], space: Option<ColorSpace>) -> io::Result<()> {
    write_whole(path, |file| encode(file, layers, space))
}

/// Encodes layers as [`write_exr_layers`] writes them: tiles of 64 x 64 pixels, compressed as ZIP.
///
/// # Errors
/// Without a layer, or whatever the rows, the encoder or the writer report.
pub fn encode_exr(file: impl Write + Seek, layers: &mut [RowLayer<'_>]) -> io::Result<()> {
    encode(file, layers, None)
}

fn encode(file: impl Write + Seek, layers: &mut [RowLayer<'_>], space: Option<ColorSpace>) -> io::Result<()> {
    let size = |layer: &RowLayer<'_>| layer.rows.size().map(|side| side as usize);
    let Some(first) = layers.first().map(size) else {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "an EXR file needs a layer"));
    };
    let blocks = BlockDescription::Tiles(TileDescription {
        tile_size: Vec2(ROWS as usize, ROWS as usize),
        level_mode: LevelMode::Singular,
        rounding_mode: RoundingMode::Down,
    });
    let shared = ImageAttributes::with_size((first[0], first[1]));
    let header = |layer: &RowLayer<'_>| {
        let mut names = layer.channels;
        names.sort_unstable();
        let channels = names.map(|name| ChannelDescription::named(name, SampleType::F32));
        let [width, height] = size(layer);
        let mut header = Header::new(Text::from(layer.name), (width, height), channels.into_iter().collect());
        if let Some(space) = space {
            let value = AttributeValue::Text(Text::from(space.name()));
            header.own_attributes.other.insert(Text::from(COLOR_ATTRIBUTE), value);
        }
        header.with_encoding(Compression::ZIP16, blocks, LineOrder::Unspecified).with_shared_attributes(shared.clone())
    };
    let headers = layers.iter().map(header).collect();
    // The encoder would turn an error of the rows into one of another kind, so it is kept here.
    let mut failed = None;
    let written = exr::block::write(file, headers, true, |meta, writer| {
        for (index, layer) in layers.iter_mut().enumerate() {
            let [width, height] = layer.rows.size();
            let order = sorted(layer.channels);
            for (row, top) in (0..height).step_by(ROWS as usize).enumerate() {
                let count = ROWS.min(height - top);
                let pixels = match layer.rows.next(count).and_then(|pixels| complete(pixels, width, count)) {
                    Ok(pixels) => pixels,
                    Err(error) => {
                        failed = Some(error);
                        return Err(exr::error::Error::Aborted);
                    }
                };
                let across = (width as usize).div_ceil(ROWS as usize);
                let tiles = (0..across).into_par_iter().map(|column| {
                    let left = column * ROWS as usize;
                    let place = BlockIndex {
                        layer: index,
                        pixel_position: Vec2(left, top as usize),
                        pixel_size: Vec2((width as usize - left).min(ROWS as usize), count as usize),
                        level: Vec2(0, 0),
                    };
                    let data = tile(pixels, width as usize, place, order);
                    UncompressedBlock { index: place, data }.compress_to_chunk(&meta.headers)
                });
                let chunks: Vec<_> = tiles.collect::<Result<_, _>>()?;
                for (column, chunk) in chunks.into_iter().enumerate() {
                    writer.write_chunk(row * across + column, chunk)?;
                }
            }
        }
        Ok(())
    });
    match (failed, written) {
        (Some(error), _) => Err(error),
        (None, Err(exr::error::Error::Io(error))) => Err(error),
        (None, written) => written.map_err(io::Error::other),
    }
}

/// Indices of the components, sorted by the names of their channels, as EXR files require.
fn sorted(names: [&str; 4]) -> [usize; 4] {
    let mut order = [0, 1, 2, 3];
    order.sort_by_key(|index| names[*index]);
    order
}

/// The bytes of a tile: row by row, and within a row one component after the other.
fn tile(pixels: &[[f32; 4]], width: usize, place: BlockIndex, order: [usize; 4]) -> Vec<u8> {
    let Vec2(columns, rows) = place.pixel_size;
    let left = place.pixel_position.0;
    let mut bytes = Vec::with_capacity(16 * columns * rows);
    for row in pixels.chunks_exact(width).take(rows) {
        for component in order {
            bytes.extend(row[left..left + columns].iter().flat_map(|pixel| pixel[component].to_ne_bytes()));
        }
    }
    bytes
}
