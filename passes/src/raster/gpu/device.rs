//! The device, and the conversion of its failures to errors.
//!
//! wgpu reports most failures to a callback, which by default ends the program. Here the callbacks only record the
//! first failure, and every operation ends with a call of [`Gpu::check`], which returns it.

use super::adapter::{
    AdapterChoice, AdapterKind, AdapterSummary, MAX_BUFFER_BYTES, RAY_BUFFERS, draws_spheres, has_plane_depth, select,
};
use super::faults::{failure, unsupported};
use curitiba_pipeline::backend::BackendError;
use curitiba_pipeline::memory;
use std::borrow::Cow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError};

/// Bytes of an upload that are handed over at once; bounds the driver's staging memory.
const UPLOAD_PIECE: usize = 32 << 20;
/// Greatest upload, in bytes, that is not waited for: it is handed over with the next submission.
const SMALL_UPLOAD: usize = 1 << 20;

/// Number of storage buffers and textures of a program that shades each pixel once.
const SHADING_BUFFERS: u32 = 6;
const SHADING_TEXTURES: u32 = 4;

/// How ray programs read their parameters, which differ from launch to launch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Parameters {
    /// In a uniform buffer.
    Uniform,
    /// In a storage buffer. Mesa's driver for processors treats the numbers in a uniform buffer as constants of the program, and recompiles
    /// the program whenever they change. For small programs that takes 20 ms a launch, for large ones seconds (Mesa 22.3).
    Storage,
}

impl Parameters {
    fn of(adapter: &AdapterSummary, limits: &wgpu::Limits) -> Self {
        let has_room = limits.max_storage_buffers_per_shader_stage > RAY_BUFFERS;
        if adapter.kind == AdapterKind::Software && has_room { Self::Storage } else { Self::Uniform }
    }

    /// The type of the parameters' binding.
    pub fn binding(self) -> wgpu::BufferBindingType {
        match self {
            Self::Uniform => wgpu::BufferBindingType::Uniform,
            Self::Storage => wgpu::BufferBindingType::Storage { read_only: true },
        }
    }

    /// The usage of the parameters' buffer.
    pub fn usage(self) -> wgpu::BufferUsages {
        match self {
            Self::Uniform => wgpu::BufferUsages::UNIFORM,
            Self::Storage => wgpu::BufferUsages::STORAGE,
        }
    }

    /// The number of storage buffers that the parameters take: 0 in a uniform buffer, else 1.
    pub fn storage_buffers(self) -> u32 {
        u32::from(self == Self::Storage)
    }

    /// Adapts the declarations of the parameters to their binding, in a WGSL source with the entry `main` that declares them as uniform. From
    /// a storage buffer each thread copies them once: Mesa's driver does not see that repeated reads of such a buffer give the same numbers,
    /// and large programs read the parameters at ten thousand places.
    pub fn declared(self, source: &str) -> Cow<'_, str> {
        if self == Self::Uniform {
            return source.into();
        }
        let (mut text, mut copies) = (String::with_capacity(source.len() + 256), String::new());
        for line in source.lines() {
            match line.split_once("var<uniform> ").and_then(|(binding, rest)| Some((binding, rest.split_once(':')?))) {
                Some((binding, (name, ty))) => {
                    text += &format!("{binding}var<storage, read> stored_{name}:{ty}\nvar<private> {name}:{ty}\n");
                    copies += &format!(" {name} = stored_{name};");
                }
                None => text.extend([line, "\n"]),
            }
        }
        if let Some(body) = text.find("fn main(").and_then(|main| Some(main + text[main..].find('{')? + 1)) {
            text.insert_str(body, &copies);
        }
        text.into()
    }
}

/// A device and its queue.
#[derive(Debug)]
pub(crate) struct Gpu {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub limits: wgpu::Limits,
    pub adapter: AdapterSummary,
    pub parameters: Parameters,
    /// Greatest buffer, in bytes, for data whose size depends on the scene or the frame.
    pub max_buffer_bytes: u64,
    /// Least and greatest number of threads of a subgroup.
    pub subgroup: [u32; 2],
    faults: Arc<Faults>,
    /// Bytes of the device's buffers and textures that are counted as memory of the process; 0 unless the driver is a software driver.
    counted: Mutex<i64>,
}

impl Drop for Gpu {
    fn drop(&mut self) {
        let counted = self.counted.get_mut().unwrap_or_else(PoisonError::into_inner);
        _ = memory::outside(-*counted);
    }
}

/// The first failure since the last check. A lost device stays lost.
#[derive(Debug, Default)]
struct Faults(Mutex<FaultLog>);

#[derive(Debug, Default)]
struct FaultLog {
    first: Option<String>,
    lost: Option<String>,
}

impl Faults {
    fn with<R>(&self, access: impl FnOnce(&mut FaultLog) -> R) -> R {
        access(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn note(&self, message: String) {
        self.with(|log| _ = log.first.get_or_insert(message));
    }

    fn note_lost(&self, message: String) {
        self.with(|log| _ = log.lost.get_or_insert(message));
    }
}

impl Gpu {
    /// Opens the device for `choice`, with all of its limits.
    pub fn open(choice: AdapterChoice) -> Result<Self, BackendError> {
        let (summary, adapter) = select(choice)?;
        let wanted = wgpu::Features::TIMESTAMP_QUERY
            | wgpu::Features::PRIMITIVE_INDEX
            | wgpu::Features::SUBGROUP
            | wgpu::Features::FLOAT32_FILTERABLE
            | wgpu::Features::FLOAT32_BLENDABLE
            | wgpu::Features::DEPTH_CLIP_CONTROL
            | wgpu::Features::SHADER_EARLY_DEPTH_TEST;
        let limits = adapter.limits();
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("curitiba"),
            required_features: adapter.features() & wanted,
            required_limits: limits.clone(),
            ..Default::default()
        };
        let opened = super::share::open(&adapter, &descriptor).unwrap_or_else(|| {
            pollster::block_on(adapter.request_device(&descriptor)).map_err(|error| error.to_string())
        });
        let (device, queue) = opened
            .map_err(|error| unsupported(&format!("on {summary}"), &format!("the device does not open ({error}):")))?;
        let faults = Arc::new(Faults::default());
        let noted = Arc::clone(&faults);
        device.on_uncaptured_error(Arc::new(move |error| noted.note(describe(&error))));
        let noted = Arc::clone(&faults);
        device.set_device_lost_callback(move |reason, message| {
            noted.note_lost(format!("the device was lost ({reason:?}) {message}"));
        });
        let max_buffer_bytes = limits.max_buffer_size.min(MAX_BUFFER_BYTES);
        let info = adapter.get_info();
        let subgroup = [info.subgroup_min_size, info.subgroup_max_size];
        let counted = Mutex::new(0);
        let parameters = Parameters::of(&summary, &limits);
        Ok(Self { device, queue, limits, adapter: summary, parameters, max_buffer_bytes, subgroup, faults, counted })
    }

    /// Whether the device has `feature`.
    pub fn has(&self, feature: wgpu::Features) -> bool {
        self.device.features().contains(feature)
    }

    /// Whether fragments can compute depth on the plane of their triangle, which they read from a buffer.
    pub fn has_plane_depth(&self) -> bool {
        has_plane_depth(self.device.features(), &self.limits)
    }

    /// Whether exact spheres can be drawn: vertex and fragment shaders read their records.
    pub fn draws_spheres(&self) -> bool {
        draws_spheres(&self.limits)
    }

    /// Whether compute programs can shade each pixel once.
    pub fn shades_pixels(&self) -> bool {
        let Self { limits, .. } = self;
        self.has_plane_depth()
            && limits.max_storage_buffers_per_shader_stage >= SHADING_BUFFERS
            && limits.max_storage_textures_per_shader_stage >= SHADING_TEXTURES
    }

    /// Returns the first failure since the last call as an error. It is also an error if the buffers and textures of a software driver exceed
    /// the memory that the process may take.
    pub fn check(&self, doing: &str) -> Result<(), BackendError> {
        let message = self.faults.with(|log| log.first.take().or_else(|| log.lost.clone()));
        match message.or_else(|| self.count_memory().err().map(|refused| refused.to_string())) {
            Some(message) => Err(failure(&format!("{doing} on {}: {message}", self.adapter))),
            None => Ok(()),
        }
    }

    /// Counts the buffers and textures of a software driver as memory of the process, because that is where they lie. They are allocated
    /// before they are counted, but a driver's pages take memory only once they are written.
    fn count_memory(&self) -> Result<(), memory::Refused> {
        if self.adapter.kind != AdapterKind::Software {
            return Ok(());
        }
        // Locked while the device's counters are read, so that no other thread stores a newer count in between.
        let mut counted = self.counted.lock().unwrap_or_else(PoisonError::into_inner);
        let counters = self.device.get_internal_counters().hal;
        let held = (counters.buffer_memory.read() + counters.texture_memory.read()) as i64;
        memory::outside(held - *counted)?;
        *counted = held;
        Ok(())
    }

    /// Makes the next operation fail with an error, for tests.
    #[cfg(test)]
    pub fn fail_next(&self, error: &wgpu::Error) {
        self.faults.note(describe(error));
    }

    /// Submits `commands` and waits until the device has finished all its work.
    pub fn submit_and_wait(&self, commands: Option<wgpu::CommandBuffer>, doing: &str) -> Result<(), BackendError> {
        self.queue.submit(commands);
        self.check(doing)?;
        self.wait(doing)
    }

    /// Builds a compute program from the WGSL source `text` with the entry point `entry`. The program's bind group layouts are derived from
    /// the source.
    pub fn compute_program(
        &self,
        label: &str,
        text: Cow<'_, str>,
        entry: &str,
    ) -> Result<wgpu::ComputePipeline, BackendError> {
        let (label, doing) = (Some(label), format!("building the program `{label}`"));
        let module = self
            .device
            .create_shader_module(wgpu::ShaderModuleDescriptor { label, source: wgpu::ShaderSource::Wgsl(text) });
        self.check(&doing)?;
        let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: None,
            module: &module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        self.check_made(&doing)?;
        Ok(pipeline)
    }

    /// As [`Self::check`], after a program is built whose layout is derived from its source. On a lost device the program has no layout, and
    /// wgpu 30 panics when the layout is requested. A device reports its loss when it is polled, so this function polls it.
    pub fn check_made(&self, doing: &str) -> Result<(), BackendError> {
        self.poll(wgpu::PollType::Poll, doing)
    }

    /// Waits until the device has finished all submitted work.
    fn wait(&self, doing: &str) -> Result<(), BackendError> {
        self.poll(wgpu::PollType::wait_indefinitely(), doing)
    }

    fn poll(&self, how: wgpu::PollType, doing: &str) -> Result<(), BackendError> {
        // wgpu 30 panics if the driver reports a lost device during the poll (`Device::poll` calls
        // `handle_error_fatal`). After such a panic every check returns the loss of the device.
        let polled = catch_unwind(AssertUnwindSafe(|| self.device.poll(how)));
        match polled {
            Ok(Ok(_)) => {}
            Ok(Err(error)) => self.faults.note(error.to_string()),
            Err(_) => self.faults.note_lost("the device was lost while it was waited for".to_owned()),
        }
        self.check(doing)
    }

    /// Submits `commands`, maps the first `bytes` bytes of `buffer`, waits, and passes them to `read`.
    pub fn read_mapped(
        &self,
        buffer: &wgpu::Buffer,
        bytes: u64,
        commands: Option<wgpu::CommandBuffer>,
        doing: &str,
        read: impl FnOnce(&[u8]),
    ) -> Result<(), BackendError> {
        if commands.is_some() {
            self.queue.submit(commands);
            self.check(doing)?;
        }
        let slice = buffer.slice(..bytes);
        let noted = Arc::clone(&self.faults);
        slice.map_async(wgpu::MapMode::Read, move |result| {
            if let Err(error) = result {
                noted.note(format!("a buffer does not map: {error}"));
            }
        });
        let waited = self.wait(doing);
        let result = waited.and_then(|()| match slice.get_mapped_range() {
            Ok(view) => {
                read(&view);
                Ok(())
            }
            Err(error) => Err(failure(&format!("{doing} on {}: {error}", self.adapter))),
        });
        buffer.unmap();
        // Unmapping a buffer that was never mapped is another error; the first error is the one to report.
        let after = self.check(doing);
        result.and(after)
    }

    /// A new buffer with the contents `bytes`.
    pub fn upload_buffer(
        &self,
        label: &str,
        usage: wgpu::BufferUsages,
        bytes: &[u8],
    ) -> Result<wgpu::Buffer, BackendError> {
        let buffer = self.buffer(label, usage | wgpu::BufferUsages::COPY_DST, bytes.len() as u64)?;
        for (index, piece) in bytes.chunks(UPLOAD_PIECE).enumerate() {
            self.queue.write_buffer(&buffer, (index * UPLOAD_PIECE) as u64, piece);
            if bytes.len() > SMALL_UPLOAD {
                self.submit_and_wait(None, label)?;
            }
        }
        self.check(label)?;
        Ok(buffer)
    }

    /// An uninitialised buffer.
    pub fn buffer(&self, label: &str, usage: wgpu::BufferUsages, size: u64) -> Result<wgpu::Buffer, BackendError> {
        let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        let buffer = self.device.create_buffer(&descriptor);
        self.check(label)?;
        Ok(buffer)
    }

    /// Copies texels to the whole of a texture with one level, and waits. The rows of `data` have no gaps between them.
    pub fn fill_texture(&self, texture: &wgpu::Texture, data: &[u8], doing: &str) -> Result<(), BackendError> {
        let mut upload = TextureUpload::new(self, texture, doing);
        upload.level(0, 0, data)?;
        upload.end()
    }
}

/// The message to the user about a failure.
fn describe(error: &wgpu::Error) -> String {
    match error {
        wgpu::Error::OutOfMemory { .. } => "the device is out of memory".to_owned(),
        wgpu::Error::Validation { description, .. } | wgpu::Error::Internal { description, .. } => {
            description.trim_end().to_owned()
        }
    }
}

/// Copies texels to a texture, level by level. Waits before more than `UPLOAD_PIECE` bytes are pending, because the driver holds a copy of
/// pending texels.
pub(crate) struct TextureUpload<'a> {
    gpu: &'a Gpu,
    texture: &'a wgpu::Texture,
    doing: &'a str,
    /// Bytes that were handed over to the queue and not waited for.
    waiting: usize,
}

impl<'a> TextureUpload<'a> {
    pub fn new(gpu: &'a Gpu, texture: &'a wgpu::Texture, doing: &'a str) -> Self {
        Self { gpu, texture, doing, waiting: 0 }
    }

    /// Copies the texels of a whole level of a layer. The rows of `data` have no gaps between them.
    pub fn level(&mut self, layer: u32, mip_level: u32, data: &[u8]) -> Result<(), BackendError> {
        let [width, height] = [self.texture.width(), self.texture.height()].map(|side| (side >> mip_level).max(1));
        let row = (data.len() / height as usize).max(1);
        let rows = (UPLOAD_PIECE / row).max(1);
        for (index, piece) in data.chunks(rows * row).enumerate() {
            if self.waiting > 0 && self.waiting + piece.len() > UPLOAD_PIECE {
                self.gpu.submit_and_wait(None, self.doing)?;
                self.waiting = 0;
            }
            self.gpu.queue.write_texture(
                wgpu::TexelCopyTextureInfo {
                    texture: self.texture,
                    mip_level,
                    origin: wgpu::Origin3d { x: 0, y: (index * rows) as u32, z: layer },
                    aspect: wgpu::TextureAspect::All,
                },
                piece,
                wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row as u32), rows_per_image: None },
                wgpu::Extent3d { width, height: (piece.len() / row) as u32, depth_or_array_layers: 1 },
            );
            self.waiting += piece.len();
        }
        Ok(())
    }

    /// Waits until all texels are copied.
    pub fn end(self) -> Result<(), BackendError> {
        self.gpu.submit_and_wait(None, self.doing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_fault_is_kept_and_a_lost_device_stays_lost() {
        let faults = Faults::default();
        faults.note("first".to_owned());
        faults.note("second".to_owned());
        faults.note_lost("lost".to_owned());
        let take = || faults.with(|log| log.first.take().or_else(|| log.lost.clone()));
        assert_eq!(take().as_deref(), Some("first"));
        assert_eq!(take().as_deref(), Some("lost"));
        assert_eq!(take().as_deref(), Some("lost"));
    }
}
