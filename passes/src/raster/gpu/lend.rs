//! Attachments and pictures on the device that ray passes read in place.

use super::device::Gpu;
use super::resources::texture;
use super::targets::Targets;
use curitiba_pipeline::backend::BackendError;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Usage of pictures that stay on the device: they are written by programs or copies, and read by programs or
/// copies.
pub(crate) const PICTURE_USAGE: wgpu::TextureUsages = wgpu::TextureUsages::STORAGE_BINDING
    .union(wgpu::TextureUsages::TEXTURE_BINDING)
    .union(wgpu::TextureUsages::COPY_SRC)
    .union(wgpu::TextureUsages::COPY_DST);

/// Shared by the rasteriser and the ray backend: the device, the last draw for rays, and the pictures that stay on the
/// device.
#[derive(Debug)]
pub(crate) struct Lending {
    pub gpu: Arc<Gpu>,
    last: Mutex<Lent>,
    pictures: Mutex<BTreeMap<usize, wgpu::Texture>>,
}

/// The attachments of one pass.
#[derive(Debug, Clone, Default)]
pub(crate) struct Lent {
    /// Number of the pass, counted from 1; 0 if no pass was lent yet.
    pub value: u64,
    /// Pixels in a row, and number of rows.
    pub size: (u32, u32),
    /// Colour, position, normal and triangle id; ids are stored plus 1.
    pub channels: [Option<wgpu::TextureView>; 4],
}

impl Lending {
    pub fn new(gpu: Arc<Gpu>) -> Self {
        Self { gpu, last: Mutex::default(), pictures: Mutex::default() }
    }

    /// Removes and returns the picture with this number, if there is one. A caller that writes the picture again stores it
    /// by [`Self::keep`].
    pub fn take(&self, number: usize) -> Option<wgpu::Texture> {
        self.pictures.lock().unwrap_or_else(PoisonError::into_inner).remove(&number)
    }

    /// Stores a picture of 32-bit floats under a number.
    pub fn keep(&self, number: usize, picture: wgpu::Texture) {
        self.pictures.lock().unwrap_or_else(PoisonError::into_inner).insert(number, picture);
    }

    /// Stores a copy of a picture of 32-bit floats under a number.
    pub(in crate::raster::gpu) fn keep_copy(&self, number: usize, made: &wgpu::Texture) -> Result<(), BackendError> {
        let (gpu, size) = (&self.gpu, made.size());
        let doing = "keeping the picture of an effect";
        let make = || texture(gpu, doing, made.format(), [made.width(), made.height()], PICTURE_USAGE);
        let picture = self.take(number).filter(|picture| picture.size() == size).unwrap_or_else(make);
        gpu.check(doing)?;
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some(doing) });
        encoder.copy_texture_to_texture(made.as_image_copy(), picture.as_image_copy(), size);
        gpu.submit_and_wait(Some(encoder.finish()), doing)?;
        self.keep(number, picture);
        Ok(())
    }

    /// The picture with this number, if there is one.
    pub fn picture(&self, number: usize) -> Option<wgpu::Texture> {
        self.pictures.lock().unwrap_or_else(PoisonError::into_inner).get(&number).cloned()
    }

    /// Bytes of device memory of all pictures.
    pub fn picture_bytes(&self) -> u64 {
        let pictures = self.pictures.lock().unwrap_or_else(PoisonError::into_inner);
        pictures.values().map(|picture| 16 * u64::from(picture.width()) * u64::from(picture.height())).sum()
    }

    /// The attachments of the last draw that was lent.
    pub fn last(&self) -> Lent {
        self.last.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Lends the draw that was just made, and returns its number.
    pub(in crate::raster::gpu) fn lend(&self, targets: &Targets) -> u64 {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let value = last.value + 1;
        *last =
            Lent { value, size: targets.size(), channels: targets.views().map(Option::<&wgpu::TextureView>::cloned) };
        value
    }
}
