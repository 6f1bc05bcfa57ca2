//! The time of passes on the device's own clock.

use super::device::Gpu;
use curitiba_pipeline::backend::BackendError;
use std::time::Duration;

const BYTES: u64 = 2 * size_of::<u64>() as u64;

/// Two timestamps, and the buffers that bring them to the host.
#[derive(Debug)]
pub(super) struct Timer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readable: wgpu::Buffer,
    /// Nanoseconds a tick.
    period: f32,
}

impl Timer {
    /// `None` where the device has no timestamps.
    pub fn new(gpu: &Gpu) -> Result<Option<Self>, BackendError> {
        if !gpu.has(wgpu::Features::TIMESTAMP_QUERY) {
            return Ok(None);
        }
        let queries = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("timer"),
            ty: wgpu::QueryType::Timestamp,
            count: 2,
        });
        let doing = "creation of the timer";
        let resolve = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
        let resolved = gpu.buffer(doing, resolve, BYTES)?;
        let read = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let readable = gpu.buffer(doing, read, BYTES)?;
        Ok(Some(Self { queries, resolved, readable, period: gpu.queue.get_timestamp_period() }))
    }

    /// Lets a render pass write its begin and end.
    pub fn writes(&self) -> wgpu::RenderPassTimestampWrites<'_> {
        wgpu::RenderPassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: Some(1),
        }
    }

    /// For one of several render passes that are timed together: the first writes its begin and the last its end.
    pub fn render_span(&self, first: bool, last: bool) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        (first || last).then_some(wgpu::RenderPassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: first.then_some(0),
            end_of_pass_write_index: last.then_some(1),
        })
    }

    /// The same for compute passes.
    pub fn compute_span(&self, first: bool, last: bool) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        (first || last).then_some(wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: first.then_some(0),
            end_of_pass_write_index: last.then_some(1),
        })
    }

    /// Submits `encoder`, whose pass wrote the timestamps, waits, and gives the time between them.
    pub fn submit_and_wait(
        &self,
        gpu: &Gpu,
        mut encoder: wgpu::CommandEncoder,
        doing: &str,
    ) -> Result<Duration, BackendError> {
        self.resolve(&mut encoder);
        self.read(gpu, Some(encoder.finish()), doing)
    }

    /// Lets `encoder` bring the timestamps to where [`Self::read`] finds them.
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.resolve_query_set(&self.queries, 0..2, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.readable, 0, BYTES);
    }

    /// Submits what resolves the timestamps if that was not done before, waits, and gives the time between them.
    pub fn read(
        &self,
        gpu: &Gpu,
        commands: Option<wgpu::CommandBuffer>,
        doing: &str,
    ) -> Result<Duration, BackendError> {
        let mut ticks = [0_u64; 2];
        gpu.read_mapped(&self.readable, BYTES, commands, doing, |bytes| {
            bytemuck::cast_slice_mut(&mut ticks).copy_from_slice(bytes);
        })?;
        let nanoseconds = ticks[1].saturating_sub(ticks[0]) as f64 * f64::from(self.period);
        Ok(Duration::from_nanos(nanoseconds as u64))
    }
}
