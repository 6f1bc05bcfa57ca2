//! Decoding of pictures within the memory of the result, without a second copy.
//!
//! The decoder writes the file's pixels into the end of the result's memory. From there they are converted, front to back, into the
//! beginning. A converted pixel never overwrites a pixel that is yet to be converted.

use crate::guard;
use crate::memory::{self, Refused};
use bytemuck::Zeroable;
use image::{ColorType, DynamicImage, ImageBuffer, ImageDecoder, Pixel};
use std::fmt;
use std::io::{BufRead, Seek};

/// Number of pixels that are converted at once.
const PIECE: usize = 4096;

/// Why a picture could not be decoded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Fault {
    /// The file is broken; the message says how.
    Broken(String),
    /// There is not enough memory.
    Refused(Refused),
}

impl From<String> for Fault {
    fn from(why: String) -> Self {
        Self::Broken(why)
    }
}

impl From<Refused> for Fault {
    fn from(refused: Refused) -> Self {
        Self::Refused(refused)
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Broken(why) => f.write_str(why),
            Self::Refused(refused) => refused.fmt(f),
        }
    }
}

/// A buffered reader that can seek.
pub(crate) trait BufReadSeek: BufRead + Seek {}
impl<T: BufRead + Seek> BufReadSeek for T {}

/// An encoded picture, in a file or in memory. One type, so that every decoder is compiled once.
pub(crate) type Encoded<'a> = Box<dyn BufReadSeek + 'a>;

/// Decodes all pixels as 8-bit RGBA, top row first; channels of 16 bits or floats are reduced. Takes 4 bytes a pixel, or the bytes
/// of the file's pixel format if they are more, plus the decoder's own memory.
pub(crate) fn rgba8(decoder: impl ImageDecoder) -> Result<Vec<[u8; 4]>, Fault> {
    let pixels = count(&decoder)?;
    let stored = usize::from(decoder.color_type().bytes_per_pixel());
    if stored <= 4 {
        let mut texels: Vec<[u8; 4]> = memory::zeroed(pixels)?;
        convert(decoder, texels.as_flattened_mut(), 4, reduce)?;
        return Ok(texels);
    }
    let mut bytes: Vec<u8> = memory::zeroed(pixels * stored)?;
    convert(decoder, &mut bytes, 4, reduce)?;
    bytes.truncate(4 * pixels);
    bytes.shrink_to_fit();
    // Both lists have four bytes a texel. The copy is made only if the list could not release its unused end.
    Ok(bytemuck::try_cast_vec(bytes).unwrap_or_else(|(_, bytes)| bytes.as_chunks().0.to_vec()))
}

fn reduce(piece: DynamicImage, result: &mut [u8]) {
    result.copy_from_slice(&piece.into_rgba8());
}

/// Decodes a picture of 8 or 16 bits a channel to floats from 0 to 1: stored value divided by the largest. Takes 16 bytes a pixel,
/// plus the decoder's own memory.
pub(super) fn floats(decoder: impl ImageDecoder) -> Result<Vec<[f32; 4]>, Fault> {
    let mut pixels: Vec<[f32; 4]> = memory::zeroed(count(&decoder)?)?;
    let color = decoder.color_type();
    let eight_bits = color.bytes_per_pixel() == color.channel_count();
    convert(decoder, bytemuck::cast_slice_mut(&mut pixels), 16, |piece, result| {
        // Divided, not multiplied by the inverse: what was written as n / 255 is read as the same float.
        let (floats, _) = result.as_chunks_mut();
        if eight_bits {
            let values = piece.into_rgba8();
            floats.iter_mut().zip(values.iter()).for_each(|(f, value)| *f = (f32::from(*value) / 255.0).to_ne_bytes());
        } else {
            let values = piece.into_rgba16();
            floats
                .iter_mut()
                .zip(values.iter())
                .for_each(|(f, value)| *f = (f32::from(*value) / 65_535.0).to_ne_bytes());
        }
    })?;
    Ok(pixels)
}

fn count(decoder: &impl ImageDecoder) -> Result<usize, String> {
    let (width, height) = decoder.dimensions();
    usize::try_from(u64::from(width) * u64::from(height)).map_err(|_| "the picture is too large".to_owned())
}

/// Decodes into the end of `memory`, then converts the pixels in pieces and writes `wide` bytes a pixel from its beginning.
fn convert(
    decoder: impl ImageDecoder,
    memory: &mut [u8],
    wide: usize,
    result: impl Fn(DynamicImage, &mut [u8]),
) -> Result<(), String> {
    let (color, total) = (decoder.color_type(), decoder.total_bytes());
    let stored = usize::from(color.bytes_per_pixel());
    let start = usize::try_from(total).ok().and_then(|total| memory.len().checked_sub(total));
    let start = start.ok_or("the decoder announces more pixels than the picture has")?;
    let read = guard::call("image", || decoder.read_image(&mut memory[start..]))?;
    read.map_err(|error| error.to_string())?;
    let pixels = (memory.len() - start) / stored.max(1);
    for first in (0..pixels).step_by(PIECE) {
        let count = PIECE.min(pixels - first);
        let from = start + first * stored;
        let piece = piece(color, &memory[from..from + count * stored])?;
        result(piece, &mut memory[first * wide..(first + count) * wide]);
    }
    Ok(())
}

/// Wraps decoded bytes as a picture of one row.
fn piece(color: ColorType, bytes: &[u8]) -> Result<DynamicImage, String> {
    fn row<P: Pixel>(bytes: &[u8]) -> Option<ImageBuffer<P, Vec<P::Subpixel>>>
    where
        P::Subpixel: Zeroable + bytemuck::Pod,
    {
        let mut values = vec![P::Subpixel::zeroed(); bytes.len() / size_of::<P::Subpixel>()];
        bytemuck::cast_slice_mut(&mut values).copy_from_slice(bytes);
        let pixels = values.len() / usize::from(P::CHANNEL_COUNT);
        ImageBuffer::from_raw(pixels as u32, 1, values)
    }
    let piece = match color {
        ColorType::L8 => row(bytes).map(DynamicImage::ImageLuma8),
        ColorType::La8 => row(bytes).map(DynamicImage::ImageLumaA8),
        ColorType::Rgb8 => row(bytes).map(DynamicImage::ImageRgb8),
        ColorType::Rgba8 => row(bytes).map(DynamicImage::ImageRgba8),
        ColorType::L16 => row(bytes).map(DynamicImage::ImageLuma16),
        ColorType::La16 => row(bytes).map(DynamicImage::ImageLumaA16),
        ColorType::Rgb16 => row(bytes).map(DynamicImage::ImageRgb16),
        ColorType::Rgba16 => row(bytes).map(DynamicImage::ImageRgba16),
        ColorType::Rgb32F => row(bytes).map(DynamicImage::ImageRgb32F),
        ColorType::Rgba32F => row(bytes).map(DynamicImage::ImageRgba32F),
        _ => None,
    };
    piece.ok_or_else(|| format!("pixels of the form {color:?} are not read"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::codecs::png::PngDecoder;
    use image::codecs::tiff::TiffDecoder;
    use image::{ImageFormat, Luma, LumaA, Rgb, Rgba};
    use std::io::Cursor;

    /// Pictures of every pixel format, 131 x 67: more than one piece, and not a multiple of the piece size.
    fn pictures() -> Vec<DynamicImage> {
        let value = |x: u32, y: u32, channel: u32| (x * 7919 + y * 104_729 + channel * 31_337) as u16;
        let byte = |x, y, channel| (value(x, y, channel) >> 5) as u8;
        let float = |x, y, channel| f32::from(value(x, y, channel)) / 60_000.0 - 0.02;
        fn made<P: Pixel>(pixel: impl Fn(u32, u32) -> P) -> ImageBuffer<P, Vec<P::Subpixel>> {
            ImageBuffer::from_fn(131, 67, pixel)
        }
        vec![
            made(|x, y| Luma([byte(x, y, 0)])).into(),
            made(|x, y| LumaA([0, 1].map(|c| byte(x, y, c)))).into(),
            made(|x, y| Rgb([0, 1, 2].map(|c| byte(x, y, c)))).into(),
            made(|x, y| Rgba([0, 1, 2, 3].map(|c| byte(x, y, c)))).into(),
            made(|x, y| Luma([value(x, y, 0)])).into(),
            made(|x, y| LumaA([0, 1].map(|c| value(x, y, c)))).into(),
            made(|x, y| Rgb([0, 1, 2].map(|c| value(x, y, c)))).into(),
            made(|x, y| Rgba([0, 1, 2, 3].map(|c| value(x, y, c)))).into(),
            made(|x, y| Rgb([0, 1, 2].map(|c| float(x, y, c)))).into(),
            made(|x, y| Rgba([0, 1, 2, 3].map(|c| float(x, y, c)))).into(),
        ]
    }

    #[test]
    fn every_form_is_converted_in_place_as_a_copy_would_be() {
        for picture in pictures() {
            let color = picture.color();
            let whole = picture.to_rgba8();
            let expected: &[[u8; 4]] = whole.as_chunks().0;
            let mut file = Cursor::new(Vec::new());
            let is_float = matches!(color, ColorType::Rgb32F | ColorType::Rgba32F);
            let format = if is_float { ImageFormat::Tiff } else { ImageFormat::Png };
            picture.write_to(&mut file, format).expect("written");
            let bytes = file.into_inner();
            if is_float {
                let decoder = TiffDecoder::new(Cursor::new(&bytes)).expect("a TIFF file");
                assert!(rgba8(decoder).expect("decoded") == expected, "{color:?}");
                continue;
            }
            let decoder = || PngDecoder::new(Cursor::new(&bytes)).expect("a PNG file");
            assert!(rgba8(decoder()).expect("decoded") == expected, "{color:?}");
            let found = floats(decoder()).expect("decoded");
            let expected: Vec<f32> = if color.bytes_per_pixel() == color.channel_count() {
                whole.iter().map(|value| f32::from(*value) / 255.0).collect()
            } else {
                picture.to_rgba16().iter().map(|value| f32::from(*value) / 65_535.0).collect()
            };
            assert!(found.as_flattened() == expected, "{color:?}");
        }
    }
}
