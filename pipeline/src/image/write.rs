//! Writing images whole or not at all: into a temporary file beside the target, renamed when complete.

use super::Image;
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image as ExrImage, ImageAttributes, LayerAttributes, WritableImage,
};
use image::ImageEncoder as _;
use image::codecs::png::PngEncoder;
use rayon::prelude::*;
use std::io::{self, Write as _};
use std::path::Path;

/// Writes a file whole or not at all: into a temporary file in the same folder, renamed to `path` when all of it is on
/// disk. An existing file is replaced only then.
///
/// # Errors
/// Whatever the file system reports; nothing is left behind.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".curitiba-");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        // As `File::create` would: temporary files are private otherwise. The umask still applies.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.tempfile_in(folder).map_err(|error| io::Error::new(error.kind(), strip_path(&error)))?;
    file.write_all(bytes)?;
    file.persist(path).map_err(|error| error.error)?;
    Ok(())
}

/// The name of a temporary file means nothing to anybody.
fn strip_path(error: &io::Error) -> String {
    let text = error.to_string();
    text.split_once(" at path ").map_or(text.clone(), |(reason, _)| reason.to_owned())
}

/// Writes an 8-bit RGB PNG: values are clamped to 0..=1 and stored as they are, without a transfer function, as the
/// report's engine showed its frame buffer. NaN is stored as 0.
///
/// # Errors
/// Whatever the file system reports.
pub fn write_png(path: &Path, image: &Image) -> io::Result<()> {
    let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
    let bytes: Vec<u8> = image.pixels.par_iter().flat_map_iter(|pixel| [0, 1, 2].map(|i| byte(pixel[i]))).collect();
    let mut encoded = Vec::new();
    PngEncoder::new(&mut encoded)
        .write_image(&bytes, image.width, image.height, image::ExtendedColorType::Rgb8)
        .map_err(io::Error::other)?;
    write_atomically(path, &encoded)
}

/// One named layer of an EXR file.
#[derive(Debug, Clone, Copy)]
pub struct Layer<'a> {
    /// Its name, such as `Deferred Render Targets::pos`.
    pub name: &'a str,
    /// Names of its four channels, such as `R G B A` or `X Y Z cosine`.
    pub channels: [&'a str; 4],
    /// Its pixels.
    pub image: &'a Image,
}

/// Writes one layer as an EXR file of 32-bit floats.
///
/// # Errors
/// Whatever the encoder or the file system report.
pub fn write_exr(path: &Path, layer: Layer<'_>) -> io::Result<()> {
    write_exr_layers(path, &[layer])
}

/// Writes layers as one EXR file of 32-bit floats. [`read_image`](super::read_image) takes a layer named
/// [`VARIANCE_LAYER`](crate::metrics::VARIANCE_LAYER), with `:N` behind it if it was estimated from N samples, for the
/// variance of the mean that another layer is.
///
/// # Errors
/// Without a layer, or whatever the encoder or the file system report.
pub fn write_exr_layers(path: &Path, layers: &[Layer<'_>]) -> io::Result<()> {
    let Some(first) = layers.first() else {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "an EXR file needs a layer"));
    };
    let size = (first.image.width as usize, first.image.height as usize);
    let encoded = |layer: &Layer<'_>| {
        let image = layer.image;
        let channel = |index: usize| {
            let samples = image.pixels.par_iter().map(|pixel| pixel[index]).collect();
            AnyChannel::new(layer.channels[index], FlatSamples::F32(samples))
        };
        let channels = AnyChannels::sort((0..4).map(channel).collect());
        let size = (image.width as usize, image.height as usize);
        let attributes = LayerAttributes::named(layer.name);
        exr::prelude::Layer::new(size, attributes, Encoding::default(), channels)
    };
    let encoded: Vec<_> = layers.iter().map(encoded).collect();
    let file = ExrImage::from_layers(ImageAttributes::with_size(size), encoded);
    // Encoded in memory first: a run that is interrupted while encoding leaves no temporary file behind.
    let mut bytes = io::Cursor::new(Vec::new());
    file.write().to_buffered(&mut bytes).map_err(io::Error::other)?;
    write_atomically(path, bytes.get_ref())
}
