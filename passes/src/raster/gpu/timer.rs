//! Times of passes, measured by the device's own clock.

use super::device::Gpu;
use curitiba_pipeline::backend::BackendError;
use std::time::Duration;

/// Number of timestamps: begin and end of two spans.
const STAMPS: u32 = 4;
const STAMP_BYTES: u64 = size_of::<u64>() as u64;
const BYTES: u64 = STAMPS as u64 * STAMP_BYTES;

/// Timestamp queries, and the buffers that copy them to the host.
#[derive(Debug)]
pub(super) struct Timer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readable: wgpu::Buffer,
    /// Nanoseconds per tick.
    period: f32,
}

impl Timer {
    /// A timer; `None` if the device has no timestamps.
    pub fn new(gpu: &Gpu) -> Result<Option<Self>, BackendError> {
        if !gpu.has(wgpu::Features::TIMESTAMP_QUERY) {
            return Ok(None);
        }
        let queries = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("timer"),
            ty: wgpu::QueryType::Timestamp,
            count: STAMPS,
        });
        let doing = "creation of the timer";
        let resolve = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
        let resolved = gpu.buffer(doing, resolve, BYTES)?;
        let read = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let readable = gpu.buffer(doing, read, BYTES)?;
        Ok(Some(Self { queries, resolved, readable, period: gpu.queue.get_timestamp_period() }))
    }

    /// Timestamps for one of several render passes that are timed together: the first pass writes the begin, the last pass
    /// the end, and passes in between none (`None`).
    pub fn render_span(&self, first: bool, last: bool) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        (first || last).then_some(wgpu::RenderPassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: first.then_some(0),
            end_of_pass_write_index: last.then_some(1),
        })
    }

    /// As [`Self::render_span`], for compute passes.
    pub fn compute_span(&self, first: bool, last: bool) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        (first || last).then_some(wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: first.then_some(0),
            end_of_pass_write_index: last.then_some(1),
        })
    }

    /// Timestamps of a compute pass that follows in the same submission and is timed separately.
    #[cfg(all(feature = "share", unix))]
    pub fn second_span(&self) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(2),
            end_of_pass_write_index: Some(3),
        }
    }

    /// Submits `encoder`, whose pass wrote the timestamps, waits, and returns the time between them.
    pub fn submit_and_wait(
        &self,
        gpu: &Gpu,
        encoder: wgpu::CommandEncoder,
        doing: &str,
    ) -> Result<Duration, BackendError> {
        Ok(self.submit_spans(gpu, encoder, false, doing)?[0])
    }

    /// As [`Self::submit_and_wait`], for two spans; the second is [`Self::second_span`]. Without a second span, the second
    /// time is 0.
    pub fn submit_spans(
        &self,
        gpu: &Gpu,
        mut encoder: wgpu::CommandEncoder,
        second: bool,
        doing: &str,
    ) -> Result<[Duration; 2], BackendError> {
        self.resolve(&mut encoder, second);
        self.read(gpu, Some(encoder.finish()), second, doing)
    }

    /// Records, after the passes, the copy of their timestamps for [`Self::read`].
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder, second: bool) {
        let stamps = if second { STAMPS } else { 2 };
        encoder.resolve_query_set(&self.queries, 0..stamps, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.readable, 0, u64::from(stamps) * STAMP_BYTES);
    }

    /// Submits `commands`, waits, and returns the times of the spans whose timestamps were [resolved](Self::resolve) last.
    pub fn read(
        &self,
        gpu: &Gpu,
        commands: Option<wgpu::CommandBuffer>,
        second: bool,
        doing: &str,
    ) -> Result<[Duration; 2], BackendError> {
        let stamps = if second { STAMPS } else { 2 };
        let bytes = u64::from(stamps) * STAMP_BYTES;
        let mut ticks = [0_u64; STAMPS as usize];
        gpu.read_mapped(&self.readable, bytes, commands, doing, |bytes| {
            bytemuck::cast_slice_mut(&mut ticks[..stamps as usize]).copy_from_slice(bytes);
        })?;
        let span = |first: usize| {
            let nanoseconds = ticks[first + 1].saturating_sub(ticks[first]) as f64 * f64::from(self.period);
            Duration::from_nanos(nanoseconds as u64)
        };
        Ok([span(0), span(2)])
    }
}
