//! Short lists that pixel programs read from device buffers.

use crate::raster::gpu::device::Gpu;
use curitiba_pipeline::backend::BackendError;

/// A list in a device buffer, and a copy of its contents.
#[derive(Debug)]
pub struct Table {
    pub buffer: wgpu::Buffer,
    /// Contents of the device buffer.
    written: Vec<u8>,
}

impl Table {
    pub fn new(gpu: &Gpu) -> Result<Self, BackendError> {
        Ok(Self { buffer: Self::buffer(gpu, 1024)?, written: Vec::new() })
    }

    /// Number of elements of type `T` in the list.
    pub fn count<T>(&self) -> u32 {
        (self.written.len() / size_of::<T>()) as u32
    }

    fn buffer(gpu: &Gpu, bytes: u64) -> Result<wgpu::Buffer, BackendError> {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        gpu.buffer("creation of a table", usage, bytes)
    }

    /// Uploads the list if it has changed; returns whether the buffer is a new one.
    pub fn write(&mut self, gpu: &Gpu, bytes: &[u8]) -> Result<bool, BackendError> {
        if self.written == bytes {
            return Ok(false);
        }
        self.written.clear();
        let grows = bytes.len() as u64 > self.buffer.size();
        if grows {
            self.buffer = Self::buffer(gpu, (bytes.len() as u64).next_power_of_two())?;
        }
        gpu.queue.write_buffer(&self.buffer, 0, bytes);
        gpu.check("upload of a table")?;
        self.written.extend_from_slice(bytes);
        Ok(grows)
    }
}
