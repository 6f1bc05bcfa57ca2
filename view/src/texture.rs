//! Pictures as textures of the window's device.

use eframe::egui_wgpu::{RenderState, Renderer};
use egui::mutex::RwLock;
use egui::{ColorImage, TextureId};
use std::borrow::Cow;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use wgpu::{ErrorFilter, FilterMode, SamplerDescriptor, TextureUsages, TextureView};

/// The window's device. Every thread can upload pictures to it. Cheap to clone.
#[derive(Clone)]
pub(crate) struct Device {
    device: wgpu::Device,
    queue: wgpu::Queue,
    /// Draws the window's triangles.
    renderer: Arc<RwLock<Renderer>>,
    /// All textures in use, and those that no picture has used since the last call of [`Self::put`].
    textures: Arc<Mutex<Vec<Arc<Texture>>>>,
}

/// A texture of the device.
pub(crate) struct Texture {
    texture: wgpu::Texture,
    view: TextureView,
    renderer: Arc<RwLock<Renderer>>,
    /// Names under which egui draws it, with its pixels blended and as squares; made at the first use.
    ids: [OnceLock<TextureId>; 2],
}

impl Texture {
    /// The name under which egui draws it, with magnified pixels as squares or blended.
    pub fn id(&self, device: &Device, squares: bool) -> TextureId {
        *self.ids[usize::from(squares)].get_or_init(|| {
            // The filters of egui's own textures.
            let sampler = SamplerDescriptor {
                mag_filter: if squares { FilterMode::Nearest } else { FilterMode::Linear },
                min_filter: FilterMode::Linear,
                ..SamplerDescriptor::default()
            };
            let mut renderer = self.renderer.write();
            renderer.register_native_texture_with_sampler_options(&device.device, &self.view, sampler)
        })
    }
}

impl Drop for Texture {
    fn drop(&mut self) {
        for id in self.ids.iter().filter_map(OnceLock::get) {
            self.renderer.write().free_texture(id);
        }
    }
}

impl Device {
    pub fn new(state: &RenderState) -> Self {
        let (device, queue, renderer) = (state.device.clone(), state.queue.clone(), Arc::clone(&state.renderer));
        Self { device, queue, renderer, textures: Arc::default() }
    }

    /// Writes a picture into a texture of its size: into an unused one if there is one, else into a new one.
    ///
    /// # Errors
    /// If the device has no memory for it. A device that was lost is no error: nothing is drawn then.
    fn put(&self, image: &ColorImage) -> Result<Arc<Texture>, String> {
        let image = fitting(image, self.device.limits().max_texture_dimension_2d as usize);
        let [width, height] = image.size.map(|side| side as u32);
        let size = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
        let filters = [ErrorFilter::OutOfMemory, ErrorFilter::Validation, ErrorFilter::Internal];
        let scopes = filters.map(|filter| self.device.push_error_scope(filter));
        let texture = self.unused(size).unwrap_or_else(|| Arc::new(self.create(size)));
        let layout =
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * width), rows_per_image: Some(height) };
        self.queue.write_texture(texture.texture.as_image_copy(), image.as_raw(), layout, size);
        // The copy begins now. Otherwise the window's next frame would begin it, and without frames pending copies would accumulate.
        self.queue.submit([]);
        let errors = scopes.into_iter().rev().filter_map(|scope| pollster::block_on(scope.pop()));
        if let Some(error) = errors.last() {
            return Err(format!("the device cannot hold a picture of {width} x {height} pixels: {error}"));
        }
        self.textures.lock().unwrap_or_else(PoisonError::into_inner).push(Arc::clone(&texture));
        Ok(texture)
    }

    /// Takes an unused texture of this size, if there is one, and frees all other unused textures.
    fn unused(&self, size: wgpu::Extent3d) -> Option<Arc<Texture>> {
        let mut textures = self.textures.lock().unwrap_or_else(PoisonError::into_inner);
        let is_unused = |texture: &Arc<Texture>| Arc::strong_count(texture) == 1;
        let found = textures.iter().position(|texture| is_unused(texture) && texture.texture.size() == size);
        let found = found.map(|index| textures.swap_remove(index));
        textures.retain(|texture| !is_unused(texture));
        found
    }

    /// A new texture in the format of egui's own textures: egui's shader expects sRGB-encoded colours that the sampler does not decode.
    fn create(&self, size: wgpu::Extent3d) -> Texture {
        let texture = self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("picture"),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8Unorm,
            usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        Texture { texture, view, renderer: Arc::clone(&self.renderer), ids: Default::default() }
    }
}

/// The picture, or only every n-th pixel if it is larger than the device's largest texture.
fn fitting(image: &ColorImage, most: usize) -> Cow<'_, ColorImage> {
    let [width, height] = image.size;
    let step = width.max(height).div_ceil(most.max(1)).max(1);
    if step == 1 {
        return Cow::Borrowed(image);
    }
    let rows = image.pixels.chunks_exact(width).step_by(step);
    let pixels = rows.flat_map(|row| row.iter().step_by(step).copied()).collect();
    Cow::Owned(ColorImage::new([width.div_ceil(step), height.div_ceil(step)], pixels))
}

/// The texture of a picture, or the reason why there is none, once an upload to the device was tried. Two values are always equal, so that the
/// comparison of pictures ignores uploads.
#[derive(Clone, Default)]
pub(crate) struct OnDevice(OnceLock<Result<Arc<Texture>, String>>);

impl OnDevice {
    /// Uploads the picture to the device, unless an upload was tried before.
    pub fn get(&self, device: &Device, image: &ColorImage) -> Result<&Texture, &str> {
        self.0.get_or_init(|| device.put(image)).as_deref().map_err(String::as_str)
    }
}

impl PartialEq for OnDevice {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl std::fmt::Debug for OnDevice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(if self.0.get().is_some() { "OnDevice" } else { "NotOnDevice" })
    }
}
