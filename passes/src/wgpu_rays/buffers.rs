//! Buffers that are never empty, since wgpu cannot bind an empty buffer.

use crate::raster::gpu::device::Gpu;
use curitiba_pipeline::backend::BackendError;

/// Size of the smallest buffer in bytes: the size of the largest element of any binding.
const LEAST: usize = 16;

/// A storage buffer with these bytes, padded with zeros to a valid size.
pub fn upload(gpu: &Gpu, label: &str, bytes: &[u8]) -> Result<wgpu::Buffer, BackendError> {
    if bytes.len() >= LEAST && bytes.len().is_multiple_of(4) {
        return gpu.upload_buffer(label, wgpu::BufferUsages::STORAGE, bytes);
    }
    let mut padded = bytes.to_vec();
    padded.resize(LEAST.max(bytes.len().next_multiple_of(4)), 0);
    gpu.upload_buffer(label, wgpu::BufferUsages::STORAGE, &padded)
}
