//! Reading pictures, written by this program or by others.

use super::Image;
use super::decode::{self, Encoded, Fault};
use super::write::COLOR_ATTRIBUTE;
use super::{MAX_SIDE, VARIANCE_LAYER};
use crate::color::ColorSpace;
use crate::files;
use crate::guard;
use crate::memory;
use exr::block::{BlockIndex, UncompressedBlock};
use exr::math::Vec2;
use exr::meta::attribute::{AttributeValue, SampleType};
use exr::meta::header::Header;
use exr::meta::{BlockDescription, MetaData};
use exr::prelude::Text;
use half::f16;
use image::{ImageDecoder as _, ImageFormat, ImageReader, Limits};
use rayon::prelude::*;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// Greatest number of pixels of a picture that is read: 16384 x 16384.
const MAX_PIXELS: u64 = 1 << 28;
/// Greatest number of values of all layers of an EXR file: sixteen channels of the largest picture.
const MAX_SAMPLES: u64 = 16 * MAX_PIXELS;

/// Upper bound of the compression ratio: a file of N bytes holds at most this many times N bytes of pixels. Deflate reaches at most
/// 1032 bytes per byte, a run of PIZ 408.
const MOST_RATIO: u64 = 2048;

/// Number of blocks of an EXR file that are decompressed at once.
const BATCH: usize = 64;

/// Why a picture could not be read.
#[derive(Debug, thiserror::Error)]
#[error("{}: {message}", path.display())]
pub struct ReadImageError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong, and what would be valid.
    pub message: String,
}

/// A picture as a file holds it.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// The pixels. Those of a PNG are display values, 0 to 1; those of an EXR are the stored values, whose meaning [`Self::space`]
    /// gives. Grey pictures have three equal colours; alpha is 1 where the file has none.
    pub image: Image,
    /// Names of the four channels: `R G B A` or `R G B W`, or `X Y Z cosine` for world positions with light cosine.
    pub channels: [String; 4],
    /// The largest stored integer, 255 or 65535, if values were clamped to 0 to 1 and rounded to steps of its inverse; `None` for
    /// floats.
    pub steps: Option<u32>,
    /// Colour space of the pixels: display values for a PNG; what [`COLOR_ATTRIBUTE`](super::COLOR_ATTRIBUTE) says for an EXR.
    /// `None` for an EXR without that attribute: a file of another program, or a layer that holds no colour.
    pub space: Option<ColorSpace>,
    /// Variance of `image`, where the file has such a layer; `image` is then a mean of samples.
    pub variance: Option<Variance>,
}

/// Variance of a picture, pixel by pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct Variance {
    /// The variance of the mean.
    pub of_mean: Image,
    /// Number of independent samples that the variance was estimated from; `None` if the file does not say.
    pub samples: Option<u32>,
}

/// Reads a PNG or EXR file. A `.png` has 8 or 16 bits a channel; stored values are divided by the largest, the inverse of
/// [`write_png`](super::write_png). Of an `.exr` it reads the first layer that holds no variance, and the layer `variance` or
/// `variance:N`, as [`write_exr_layers`](super::write_exr_layers) writes it.
///
/// # Errors
/// If the file cannot be read, is no picture of these kinds, has other channels than three colours, grey or the four that
/// this program writes, or is larger than 16384 x 16384 pixels.
pub fn read_image(path: &Path) -> Result<Picture, ReadImageError> {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_lowercase();
    let picture = match extension.as_str() {
        "png" => read_png(path),
        "exr" => read_exr(path),
        _ => Err("a picture is read from .png or .exr; convert it to one of them".to_owned()),
    };
    picture.map_err(|message| ReadImageError { path: path.to_owned(), message })
}

fn open(path: &Path) -> Result<BufReader<files::Input>, String> {
    if path.is_dir() {
        return Err("this is a folder; name a picture in it".to_owned());
    }
    files::open(path).map(BufReader::new).map_err(|error| format!("the file cannot be opened: {error}"))
}

fn check_size(width: u64, height: u64) -> Result<(), String> {
    let side = u64::from(MAX_SIDE);
    if width == 0 || height == 0 || width > side || height > side || width * height > MAX_PIXELS {
        return Err(format!("{width} x {height} pixels; valid: 1 to {MAX_PIXELS} pixels, at most {MAX_SIDE} a side"));
    }
    Ok(())
}

/// Refuses a pixel count that a file of this size cannot hold, before memory is allocated.
fn check_held(pixels: &str, bytes: u64, file: u64) -> Result<(), String> {
    if bytes > file.saturating_mul(MOST_RATIO) {
        return Err(format!("the file claims {pixels}, {bytes} bytes, but has only {file}; write it again, whole"));
    }
    Ok(())
}

fn read_png(path: &Path) -> Result<Picture, String> {
    let broken = |error: image::ImageError| format!("this is no whole PNG file: {error}");
    let file = open(path)?;
    let size = file.get_ref().size();
    let mut reader = ImageReader::with_format(Box::new(file) as Encoded<'_>, ImageFormat::Png);
    let mut limits = Limits::default();
    // At most eight bytes a pixel, plus the decoder's own memory.
    limits.max_alloc = Some(10 * MAX_PIXELS);
    reader.limits(limits);
    let decoder = guard::call("image", || reader.into_decoder())?.map_err(broken)?;
    let (width, height) = decoder.dimensions();
    check_size(width.into(), height.into())?;
    // The least that the pixels can take in the file: one bit each.
    check_held(&format!("{width} x {height} pixels"), u64::from(width) * u64::from(height) / 8, size)?;
    let color = decoder.color_type();
    let steps = if color.bytes_per_pixel() == color.channel_count() { 255 } else { 65_535 };
    let pixels = decode::floats(decoder).map_err(|fault| match fault {
        Fault::Broken(why) => format!("this is no whole PNG file: {why}"),
        Fault::Refused(refused) => refused.to_string(),
    })?;
    let channels = ["R", "G", "B", "A"].map(str::to_owned);
    let (image, space) = (Image { width, height, pixels }, Some(ColorSpace::Report));
    Ok(Picture { image, channels, steps: Some(steps), space, variance: None })
}

fn read_exr(path: &Path) -> Result<Picture, String> {
    let broken = |error: exr::error::Error| format!("this is no whole EXR file: {error}");
    // Headers first: what they claim is checked before anything of that size is allocated.
    let file = open(path)?;
    let size = file.get_ref().size();
    let meta = guard::call("exr", || MetaData::read_from_buffered(file, false))?.map_err(broken)?;
    let (mut samples, mut bytes) = (0_u64, 0_u64);
    for header in &meta.headers {
        let (width, height) = (header.layer_size.0 as u64, header.layer_size.1 as u64);
        check_size(width, height)?;
        samples += width * height * header.channels.list.len() as u64;
        if samples > MAX_SAMPLES {
            return Err(format!("the file's layers hold more than {MAX_SAMPLES} values"));
        }
        bytes += width * height * header.channels.bytes_per_pixel as u64;
        if header.channels.list.iter().any(|channel| channel.sampling.0 != 1 || channel.sampling.1 != 1) {
            return Err("a channel has fewer samples than pixels (chroma subsampling); write it with all".to_owned());
        }
        // The crate allocates as much memory as a header claims, up to a whole tile.
        if let BlockDescription::Tiles(tiles) = header.blocks {
            let [width, height] = [tiles.tile_size.0, tiles.tile_size.1].map(|side| side as u64);
            let tile = width.saturating_mul(height).saturating_mul(header.channels.bytes_per_pixel as u64);
            check_held(&format!("tiles of {width} x {height} pixels"), tile, size)?;
        }
    }
    check_held(&format!("{samples} values"), bytes, size)?;
    let mut shown = None;
    let mut variance = None;
    // For each layer of the file: whether it is read, the picture for its pixels, and the component of each of its channels.
    let mut layers = Vec::new();
    for header in &meta.headers {
        let name = header.own_attributes.layer_name.as_ref().map(Text::to_string).unwrap_or_default();
        let samples = variance_samples(&name)?;
        if header.deep || (samples.is_none() && shown.is_some()) {
            layers.push(None);
            continue;
        }
        let (image, names, components) = prepare(&name, header)?;
        match samples {
            Some(samples) => variance = Some(Variance { of_mean: image, samples }),
            None => shown = Some((image, names, space_of(header))),
        }
        layers.push(Some((samples.is_some(), components)));
    }
    let file = open(path)?;
    let reader = guard::call("exr", || exr::block::read(file, false))?.map_err(broken)?;
    let wanted = |block: BlockIndex| block.level == Vec2(0, 0) && layers.get(block.layer).is_some_and(Option::is_some);
    let chunks = guard::call("exr", || reader.filter_chunks(false, |_, _, block| wanted(block)))?;
    let mut chunks = chunks.map_err(broken)?;
    loop {
        let batch = guard::call("exr", || chunks.by_ref().take(BATCH).collect::<Result<Vec<_>, _>>())?;
        let batch = batch.map_err(broken)?;
        if batch.is_empty() {
            break;
        }
        let blocks = batch.into_par_iter().map(|chunk| {
            guard::call("exr", || UncompressedBlock::decompress_chunk(chunk, &meta, false))?.map_err(broken)
        });
        for block in blocks.collect::<Result<Vec<_>, String>>()? {
            let (Some(Some((is_variance, components))), Some(header)) =
                (layers.get(block.index.layer), meta.headers.get(block.index.layer))
            else {
                continue;
            };
            let image = if *is_variance {
                variance.as_mut().map(|variance| &mut variance.of_mean)
            } else {
                shown.as_mut().map(|(image, ..)| image)
            };
            if let Some(image) = image.filter(|_| block.index.level == Vec2(0, 0)) {
                store(&block, header, components, image);
            }
        }
    }
    let Some((image, channels, space)) = shown else {
        return Err(format!("the file holds no layer but `{VARIANCE_LAYER}`"));
    };
    let other = variance.as_ref().filter(|v| [v.of_mean.width, v.of_mean.height] != [image.width, image.height]);
    if let Some(other) = other {
        let [width, height] = [other.of_mean.width, other.of_mean.height];
        return Err(format!("the layer `{VARIANCE_LAYER}` is {width} x {height} pixels, and the picture is not"));
    }
    Ok(Picture { image, channels, steps: None, space, variance })
}

/// The colour space that a layer's attribute names; `None` without the attribute, or if it names another one.
fn space_of(header: &Header) -> Option<ColorSpace> {
    match header.own_attributes.other.get(&Text::from(COLOR_ATTRIBUTE)) {
        Some(AttributeValue::Text(text)) => text.to_string().parse().ok(),
        _ => None,
    }
}

/// Parses a layer name: `variance` or `variance:N`, with the number of samples. The outer `Option` is `None` for other names.
fn variance_samples(name: &str) -> Result<Option<Option<u32>>, String> {
    match name.split_once(':') {
        None if name == VARIANCE_LAYER => Ok(Some(None)),
        Some((VARIANCE_LAYER, samples)) => match samples.parse() {
            Ok(samples) if samples >= 2 => Ok(Some(Some(samples))),
            _ => Err(format!("layer `{name}`: `{samples}` is no number of samples; valid: 2 or more")),
        },
        _ => Ok(None),
    }
}

/// The sets of channels that are read, in the order of a pixel's components; the last channel of each may be missing.
const CHANNELS: [[&str; 4]; 4] =
    [["R", "G", "B", "A"], ["R", "G", "B", "W"], ["X", "Y", "Z", "cosine"], ["X", "Y", "Z", "W"]];

/// A picture for a layer's pixels, black and opaque; the names of its components; and for each channel of the layer the components
/// that it fills.
type Prepared = (Image, [String; 4], Vec<[bool; 4]>);

fn prepare(layer: &str, header: &Header) -> Result<Prepared, String> {
    let list = &header.channels.list;
    // Other programs write `layer.R`, even where the layer has that name already.
    let short = |name: &Text| name.to_string().rsplit('.').next().unwrap_or_default().to_owned();
    let find = |wanted: &str| list.iter().position(|channel| short(&channel.name) == wanted);
    // Some sets begin with the same channels; the fourth channel decides.
    let has = |names: &[&str]| names.iter().all(|name| find(name).is_some());
    let whole = CHANNELS.iter().find(|names| has(&names[..]));
    let colored = whole.or_else(|| CHANNELS.iter().find(|names| has(&names[..3])));
    let names = match (colored, find("Y")) {
        (Some(names), _) => *names,
        (None, Some(_)) => ["Y", "Y", "Y", "A"],
        (None, None) => {
            let held: Vec<String> = list.iter().map(|channel| channel.name.to_string()).collect();
            let layer = if layer.is_empty() { "the first layer".to_owned() } else { format!("layer `{layer}`") };
            return Err(format!("{layer} has the channels {}; valid: R G B, X Y Z, or Y", held.join(", ")));
        }
    };
    let found = names.map(find);
    let components = (0..list.len()).map(|channel| found.map(|found| found == Some(channel))).collect();
    let Vec2(width, height) = header.layer_size;
    let pixels = memory::filled([0.0, 0.0, 0.0, 1.0], width * height).map_err(|error| error.to_string())?;
    let side = |side: usize| u32::try_from(side).map_err(|_| "the picture is too large".to_owned());
    Ok((Image { width: side(width)?, height: side(height)?, pixels }, names.map(str::to_owned), components))
}

/// Copies the samples of a block to their place in the picture.
fn store(block: &UncompressedBlock, header: &Header, components: &[[bool; 4]], image: &mut Image) {
    for line in block.lines(&header.channels) {
        let (Some(wanted), Some(channel)) =
            (components.get(line.location.channel), header.channels.list.get(line.location.channel))
        else {
            continue;
        };
        if !wanted.contains(&true) {
            continue;
        }
        let Vec2(left, row) = line.location.position;
        let first = row * image.width as usize + left;
        let Some(pixels) = image.pixels.get_mut(first..first + line.location.sample_count) else { continue };
        let mut put = |values: &mut dyn Iterator<Item = f32>| {
            for (pixel, value) in pixels.iter_mut().zip(values) {
                for (component, wanted) in pixel.iter_mut().zip(wanted) {
                    *component = if *wanted { value } else { *component };
                }
            }
        };
        match channel.sample_type {
            SampleType::F32 => put(&mut line.value.as_chunks().0.iter().map(|bytes| f32::from_ne_bytes(*bytes))),
            SampleType::F16 => {
                put(&mut line.value.as_chunks().0.iter().map(|bytes| f16::from_ne_bytes(*bytes).to_f32()))
            }
            SampleType::U32 => put(&mut line.value.as_chunks().0.iter().map(|bytes| u32::from_ne_bytes(*bytes) as f32)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Layer, write_exr, write_exr_layers, write_png};
    use super::*;

    fn numbered(width: u32, height: u32) -> Image {
        let pixels = (0..width * height).map(|i| [i as f32 / 255.0, (255 - i) as f32 / 255.0, 0.0, 1.0]).collect();
        Image { width, height, pixels }
    }

    fn rgba<'a>(name: &'a str, image: &'a Image) -> Layer<'a> {
        Layer { name, channels: ["R", "G", "B", "A"], image }
    }

    #[test]
    fn what_was_written_is_read_again() {
        let folder = tempfile::tempdir().expect("a folder");
        let image = numbered(16, 9);
        let (png, exr) = (folder.path().join("a.png"), folder.path().join("a.EXR"));
        write_png(&png, &image).expect("written");
        let found = read_image(&png).expect("read");
        assert!(found.image == image, "a PNG of 8 bits changed");
        assert_eq!((found.steps, found.variance), (Some(255), None));
        let mut bright = image;
        bright.pixels[5] = [-3.5, 1e6, f32::NAN, 0.25];
        write_exr(&exr, Layer { name: "pos", channels: ["X", "Y", "Z", "cosine"], image: &bright }).expect("written");
        let found = read_image(&exr).expect("read");
        assert_eq!(found.channels, ["X", "Y", "Z", "cosine"]);
        assert_eq!(found.steps, None);
        assert_eq!(found.image.pixels[4], bright.pixels[4]);
        assert_eq!(found.image.pixels[5][..2], bright.pixels[5][..2]);
        assert!(found.image.pixels[5][2].is_nan() && found.image.pixels[5][3] == 0.25);
    }

    #[test]
    fn a_fourth_number_that_is_no_alpha_is_read_again_and_an_alpha_comes_before_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.exr");
        let mut image = numbered(4, 3);
        image.pixels[5] = [0.5, 2.0, 0.25, 1.75];
        for channels in [["R", "G", "B", "W"], ["R", "G", "B", "A"], ["X", "Y", "Z", "W"]] {
            write_exr(&path, Layer { name: "window", channels, image: &image }).expect("written");
            let found = read_image(&path).expect("read");
            assert!(found.channels == channels && found.image == image, "{:?}", found.channels);
        }
        // Without a fourth channel of either name it is 1.
        write_exr(&path, Layer { name: "window", channels: ["R", "G", "B", "Z"], image: &image }).expect("written");
        let found = read_image(&path).expect("read");
        assert_eq!(
            (found.image.pixels[5], found.channels),
            ([0.5, 2.0, 0.25, 1.0], ["R", "G", "B", "A"].map(str::to_owned))
        );
    }

    #[test]
    fn sixteen_bits_and_grey_are_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.png");
        image::ImageBuffer::from_fn(3, 2, |x, y| image::Luma([(y * 3 + x) as u16 * 13_107]))
            .save(&path)
            .expect("written");
        let found = read_image(&path).expect("read");
        assert_eq!((found.image.width, found.image.height, found.steps), (3, 2, Some(65_535)));
        assert_eq!(found.image.pixels[2], [0.4, 0.4, 0.4, 1.0]);
        assert_eq!(found.image.pixels[5], [1.0; 4]);
    }

    #[test]
    fn a_variance_layer_is_read_with_its_number_of_samples() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.exr");
        let (image, variance) = (numbered(5, 4), Image::filled(5, 4, [0.5, 0.25, 0.125, 1.0]));
        for (name, samples) in [("variance", None), ("variance:8", Some(8))] {
            write_exr_layers(&path, &[rgba(name, &variance), rgba("window", &image)]).expect("written");
            let found = read_image(&path).expect("read");
            assert_eq!(found.image, image);
            assert_eq!(found.variance, Some(Variance { of_mean: variance.clone(), samples }));
        }
        for (name, word) in [("variance:1", "2 or more"), ("variance:x", "2 or more"), ("variance", "no layer but")] {
            write_exr_layers(&path, &[rgba(name, &variance)]).expect("written");
            let error = read_image(&path).expect_err("refused").to_string();
            assert!(error.contains(word), "{error}");
        }
        write_exr_layers(&path, &[rgba("window", &image), rgba("variance", &Image::filled(4, 5, [0.0; 4]))])
            .expect("written");
        assert!(read_image(&path).expect_err("refused").to_string().contains("4 x 5"));
    }

    #[test]
    fn files_that_are_no_pictures_are_refused_with_a_reason() {
        let folder = tempfile::tempdir().expect("a folder");
        let fails = |name: &str, bytes: Option<&[u8]>| {
            let path = folder.path().join(name);
            if let Some(bytes) = bytes {
                std::fs::write(&path, bytes).expect("written");
            }
            let error = read_image(&path).expect_err("refused").to_string();
            assert!(error.contains(name), "{error}");
            error
        };
        assert!(fails("missing.png", None).contains("cannot be opened"));
        assert!(fails("a.jpg", Some(b"x")).contains(".png or .exr"));
        assert!(fails("a.png", Some(b"not a picture")).contains("no whole PNG"));
        assert!(fails("a.exr", Some(b"not a picture")).contains("no whole EXR"));
        let (png, exr) = (folder.path().join("b.png"), folder.path().join("b.exr"));
        write_png(&png, &numbered(16, 15)).expect("written");
        write_exr(&exr, rgba("window", &numbered(16, 15))).expect("written");
        for (path, extension) in [(&png, "png"), (&exr, "exr")] {
            let bytes = std::fs::read(path).expect("there");
            for length in (0..bytes.len()).step_by(7) {
                fails(&format!("cut.{extension}"), Some(&bytes[..length]));
            }
        }
        // Headers that claim 16384 x 16384 pixels: a file of this size cannot hold them, and is refused before memory is
        // allocated.
        let mut bytes = std::fs::read(&png).expect("there");
        bytes[16..24].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x40, 0]);
        let crc = crc32(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&crc.to_be_bytes());
        assert!(fails("claims.png", Some(&bytes)).contains("the file claims 16384 x 16384 pixels"));
        let mut bytes = std::fs::read(&exr).expect("there");
        let window = b"dataWindow\0box2i\0";
        let start =
            bytes.windows(window.len()).position(|part| part == window).expect("a data window") + window.len() + 4;
        bytes[start + 8..start + 12].copy_from_slice(&16_383_i32.to_le_bytes());
        bytes[start + 12..start + 16].copy_from_slice(&16_383_i32.to_le_bytes());
        assert!(fails("claims.exr", Some(&bytes)).contains("the file claims"));
        // A small picture in one tile, whose claimed size exceeds any memory.
        {
            use exr::prelude::*;
            let layer = Layer::new(
                (8, 8),
                LayerAttributes::named("window"),
                Encoding {
                    compression: Compression::Uncompressed,
                    blocks: Blocks::Tiles(Vec2(1 << 20, 1 << 10)),
                    line_order: LineOrder::Increasing,
                },
                SpecificChannels::rgba(|_| (0.0_f32, 0.5_f32, 1.0_f32, 1.0_f32)),
            );
            Image::from_layer(layer).write().to_file(&exr).expect("written");
        }
        assert!(fails("b.exr", None).contains("the file claims tiles of 1048576 x 1024 pixels"));
        // A PNG that claims 65535 x 65535 pixels, with a valid checksum of its header.
        let mut bytes = std::fs::read(&png).expect("there");
        bytes[16..24].copy_from_slice(&[0, 0, 0xff, 0xff, 0, 0, 0xff, 0xff]);
        let crc = crc32(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&crc.to_be_bytes());
        assert!(fails("huge.png", Some(&bytes)).contains("65535 x 65535"));
        write_exr(&exr, Layer { name: "x", channels: ["U", "V", "P", "Q"], image: &numbered(2, 2) }).expect("written");
        assert!(fails("b.exr", None).contains("valid: R G B"));
    }

    /// CRC-32 of ISO 3309, which ends each PNG chunk.
    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(u32::MAX, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
        })
    }
}
