//! Splits a pass into launches short enough for every driver's watchdog, and measures them.

use super::layout::{COUNT_BYTES, Params, TILE};
use super::programs::Stage;
use crate::effects::dielectric::{Cloud, PhotonMap};
use crate::raster::gpu::AdapterKind;
use crate::raster::gpu::device::Gpu;
use crate::raster::gpu::resources::rectangle;
use curitiba_pipeline::backend::BackendError;
use curitiba_pipeline::executor::Progress;
use std::time::{Duration, Instant};

/// Wanted duration of a launch: systems reset devices that do not respond for 2 s, and a desktop stutters long before.
const WANTED: Duration = Duration::from_millis(20);
/// Wanted duration for drivers that compute on the processor, which no watchdog resets.
const WANTED_OF_SOFTWARE: Duration = Duration::from_millis(500);
/// Tiles of the first launch, when the speed of the program on the device is unknown.
const FIRST_TILES: u32 = 64;
/// Greatest number of rays of a point for which the first launch has [`FIRST_TILES`] tiles.
const FEW_RAYS: u32 = 64;
/// Number of photons that are looked up in the time of a ray, roughly.
const PHOTONS_A_RAY: u64 = 32;
/// Greatest factor between the sizes of successive launches.
const GROWTH: u32 = 8;
/// Greatest number of kernels whose timestamps are read together.
const SLOTS: u32 = 64;
/// Distance in bytes between the timestamps of two kernels: timestamps must be written at multiples of this.
const SLOT_BYTES: u64 = wgpu::QUERY_RESOLVE_BUFFER_ALIGNMENT;

/// Measures launches by the device's own clock.
#[derive(Debug)]
pub struct Clock {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readable: wgpu::Buffer,
    /// Nanoseconds a tick.
    period: f64,
}

impl Clock {
    /// `None` if the device has no timestamps.
    pub fn new(gpu: &Gpu) -> Result<Option<Self>, BackendError> {
        if !gpu.has(wgpu::Features::TIMESTAMP_QUERY) {
            return Ok(None);
        }
        let queries = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("clock of rays"),
            ty: wgpu::QueryType::Timestamp,
            count: 2 * SLOTS,
        });
        let bytes = u64::from(SLOTS) * SLOT_BYTES;
        let (resolve, read) = (wgpu::BufferUsages::QUERY_RESOLVE, wgpu::BufferUsages::MAP_READ);
        let resolved = gpu.buffer("clock of rays", resolve | wgpu::BufferUsages::COPY_SRC, bytes)?;
        let readable = gpu.buffer("clock of rays", read | wgpu::BufferUsages::COPY_DST, bytes)?;
        Ok(Some(Self { queries, resolved, readable, period: f64::from(gpu.queue.get_timestamp_period()) }))
    }

    fn writes(&self, slot: u32) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(2 * slot),
            end_of_pass_write_index: Some(2 * slot + 1),
        }
    }

    fn resolve(&self, encoder: &mut wgpu::CommandEncoder, slot: u32) {
        encoder.resolve_query_set(&self.queries, 2 * slot..2 * slot + 2, &self.resolved, u64::from(slot) * SLOT_BYTES);
    }

    /// Records the copy of the timestamps of the first `slots` kernels, for [`Self::read`].
    fn copy(&self, encoder: &mut wgpu::CommandEncoder, slots: u32) {
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.readable, 0, u64::from(slots) * SLOT_BYTES);
    }

    /// The sum of the durations of the first `slots` kernels, whose timestamps were [copied](Self::copy).
    fn read(&self, gpu: &Gpu, slots: u32) -> Result<Duration, BackendError> {
        let mut ticks = 0_u64;
        gpu.read_mapped(&self.readable, u64::from(slots) * SLOT_BYTES, None, "reading the clock", |bytes| {
            for slot in bytes.chunks_exact(SLOT_BYTES as usize) {
                let stamp = |place: usize| slot[8 * place..8 * place + 8].try_into().map_or(0, u64::from_ne_bytes);
                ticks += stamp(1).saturating_sub(stamp(0));
            }
        })?;
        Ok(Duration::from_nanos((ticks as f64 * self.period) as u64))
    }
}

/// The work of a pass.
pub struct Work<'a> {
    /// The kernels, in the order in which they run.
    pub kernels: Vec<(Stage, &'a wgpu::ComputePipeline)>,
    pub groups: [&'a wgpu::BindGroup; 3],
    /// Number of tiles of the first launch.
    pub first_tiles: u32,
    /// Greatest number of tiles of a launch.
    pub most_tiles: u32,
    /// Buffer with the ray counts, and behind them the number of listed points.
    pub counts: &'a wgpu::Buffer,
    /// Buffer for the parameters.
    pub parameters: &'a wgpu::Buffer,
    /// The current activity, for messages.
    pub doing: &'a str,
}

/// Number of workgroups of a kernel for that many tiles. Kernels that settle or trace occlusion rays have 32 threads a group; each group
/// takes 32 points at a time, until none is left.
fn groups_of(stage: Stage, tiles: u32) -> u32 {
    match stage {
        Stage::Settle | Stage::Trace | Stage::TraceAll => tiles * (TILE * TILE / 32),
        Stage::Eye => 1,
        Stage::Whole | Stage::List | Stage::Light | Stage::Focus | Stage::Sum | Stage::Surfaces => tiles,
    }
}

/// Wanted duration of a launch on a device.
pub(super) fn wanted(gpu: &Gpu) -> Duration {
    if gpu.adapter.kind == AdapterKind::Software { WANTED_OF_SOFTWARE } else { WANTED }
}

/// Number of tiles of the first launch, where each point takes as long as this number of rays.
pub(super) fn first_tiles(rays: u32) -> u32 {
    (FIRST_TILES * FEW_RAYS / rays.max(FEW_RAYS)).max(1)
}

/// Number of rays whose time covers the lookup of the photons near any point: a power of two, or 0 without photons.
pub(super) fn rays_of_photons(photons: &PhotonMap) -> u32 {
    let most = photons.clouds().iter().map(Cloud::most_near).sum::<u64>() / PHOTONS_A_RAY;
    if most == 0 { 0 } else { u32::try_from(most.next_power_of_two()).unwrap_or(u32::MAX) }
}

/// Number of tiles of the next launch, after a launch of `tiles` tiles took the time `took`.
pub(super) fn next_size(tiles: u32, took: Duration, wanted: Duration) -> u32 {
    let ratio = wanted.as_secs_f64() / took.as_secs_f64().max(1e-6);
    // Grows by at most GROWTH: the next tiles may be more expensive.
    let wanted = (f64::from(tiles) * ratio).min(f64::from(tiles) * f64::from(GROWTH)).max(1.0);
    wanted.min(f64::from(u32::MAX / 2)) as u32
}

/// Runs a pass over all tiles of its picture, and waits for the end. `size` is the number of tiles of the next launch, kept from pass to
/// pass; `None` before the first launch. Returns the duration by the device's clock; `None` without a clock.
pub fn run(
    gpu: &Gpu,
    clock: Option<&Clock>,
    work: &Work<'_>,
    mut params: Params,
    size: &mut Option<u32>,
    progress: &Progress,
) -> Result<Option<Duration>, BackendError> {
    params.tiles_across = params.width.div_ceil(TILE);
    let tiles = params.tiles_across * params.height.div_ceil(TILE);
    progress.start(u64::from(tiles));
    let most = gpu.limits.max_compute_workgroups_per_dimension;
    let wanted = wanted(gpu);
    let (mut first, mut slot, mut total, mut least) = (0, 0, Duration::ZERO, u32::MAX);
    while first < tiles {
        let taken = size.unwrap_or(work.first_tiles).min(tiles - first).min(work.most_tiles).max(1);
        (params.first_tile, params.end_tile) = (first, first + taken);
        gpu.queue.write_buffer(work.parameters, 0, bytemuck::bytes_of(&params));
        // The points of pixels have fixed places; points seen through glass are counted from here on.
        gpu.queue.write_buffer(work.counts, COUNT_BYTES, bytemuck::bytes_of(&(taken * TILE * TILE)));
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("rays") });
        for (stage, pipeline) in &work.kernels {
            let [across, down] = rectangle(groups_of(*stage, taken), most);
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(work.doing),
                timestamp_writes: clock.map(|clock| clock.writes(slot)),
            });
            pass.set_pipeline(pipeline);
            for (index, group) in (0..).zip(work.groups) {
                pass.set_bind_group(index, group, &[]);
            }
            pass.dispatch_workgroups(across, down, 1);
            drop(pass);
            if let Some(clock) = clock {
                clock.resolve(&mut encoder, slot);
            }
            slot += 1;
        }
        let reads_clock = slot + work.kernels.len() as u32 > SLOTS || first + taken == tiles;
        let clock = clock.filter(|_| slot > 0);
        if let Some(clock) = clock.filter(|_| reads_clock) {
            clock.copy(&mut encoder, slot);
        }
        let start = Instant::now();
        gpu.submit_and_wait(Some(encoder.finish()), work.doing)?;
        let took = start.elapsed();
        // The first launch may include compilation by the driver.
        let next = next_size(taken, took, wanted);
        if size.is_some() && took > wanted / 4 {
            least = least.min(next);
        }
        *size = Some(if size.is_none() { taken } else { next });
        first += taken;
        if reads_clock {
            total += clock.map_or(Ok(Duration::ZERO), |clock| clock.read(gpu, slot))?;
            slot = 0;
        }
        progress.advance(u64::from(taken));
    }
    // The next pass begins with the launch size that suits the most expensive part of this one.
    *size = size.map(|last| last.min(least));
    Ok(clock.map(|_| total))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn launches_grow_to_the_wanted_time_and_no_dimension_is_too_long() {
        let ms = Duration::from_millis;
        assert_eq!(next_size(64, ms(20), WANTED), 64);
        assert_eq!(next_size(64, ms(80), WANTED), 16);
        assert_eq!(next_size(64, ms(250), WANTED_OF_SOFTWARE), 128);
        assert_eq!(next_size(1, ms(900), WANTED), 1, "there is no shorter launch");
        assert_eq!(next_size(64, Duration::ZERO, WANTED), 64 * GROWTH);
        assert_eq!([0, 16, 64, 128, 65_536].map(first_tiles), [64, 64, 64, 32, 1], "many rays, few tiles");
    }
}
