//! Segments between triangles on one GPU: the processor makes the segments, the device finds which are blocked.

use crate::bvh::BvhTracer;
use crate::device::{Buffer, Device};
use crate::layout::{EXCEPTION_SLOT, Params, SEGMENT_THREADS};
use crate::one_gpu::DeviceTracer as _;
use crate::optix::{OptixTracer, SegmentPipeline};
use crate::programs;
use crate::scene::SceneBuffers;
use cudarc::driver::{CudaFunction, LaunchConfig, PushKernelArg as _};
use cudarc::nvrtc::Ptx;
use curitiba_passes::trace::gpu_tree::DeviceTree;
use curitiba_passes::trace::{Quality, SegmentTracer, Segments};
use curitiba_pipeline::backend::BackendError;
use curitiba_pipeline::scene::{Geometry, Material, RenderScene};

/// Greatest number of segments of a launch, so that no kernel exceeds a display driver's time limit.
const LAUNCHED: usize = 1 << 22;

/// Device buffers that a launch reads and writes.
#[derive(Debug, Default)]
struct Room {
    segments: Buffer<u32>,
    own: Buffer<u32>,
    blocked: Buffer<u32>,
}

impl Room {
    /// Copies segments to the device, and fills in the launch parameters.
    fn fill(&mut self, device: &Device, segments: &Segments) -> Result<Params, BackendError> {
        device.replace("the segments", &mut self.segments, bytemuck::cast_slice(&segments.all))?;
        device.replace("the pairs of the segments", &mut self.own, segments.own.as_flattened())?;
        device.clear("the answers", &mut self.blocked, segments.all.len().div_ceil(32))?;
        Ok(Params {
            segments: self.segments.address(device),
            own: self.own.address(device),
            blocked: self.blocked.address(device),
            segment_count: segments.all.len() as u64,
            ..Params::default()
        })
    }

    /// Waits for the results, and copies the bits of `count` segments to the host.
    fn read(&self, device: &Device, count: usize, bits: &mut [u32]) -> Result<(), BackendError> {
        let failed = |error| device.fault("tracing segments", &error);
        if let Some(blocked) = &self.blocked.0 {
            device.stream().memcpy_dtoh(&blocked.slice(..count.div_ceil(32)), bits).map_err(failed)?;
        }
        device.stream().synchronize().map_err(failed)
    }
}

/// Splits segments into launches of at most [`LAUNCHED`].
fn in_launches(
    segments: &Segments,
    bits: &mut Vec<u32>,
    mut launch: impl FnMut(&Segments, &mut [u32]) -> Result<(), BackendError>,
) -> Result<(), BackendError> {
    bits.clear();
    bits.resize(segments.all.len().div_ceil(32), 0);
    if segments.all.len() <= LAUNCHED {
        return if segments.all.is_empty() { Ok(()) } else { launch(segments, bits) };
    }
    let mut part = Segments { all: Vec::new(), own: segments.own.clone() };
    for (all, bits) in segments.all.chunks(LAUNCHED).zip(bits.chunks_mut(LAUNCHED / 32)) {
        part.all.clear();
        part.all.extend_from_slice(all);
        launch(&part, bits)?;
    }
    Ok(())
}

/// Segments on our own traversal: the results are exactly those of the processor.
#[derive(Debug)]
pub struct CudaSegments {
    device: Device,
    tracer: BvhTracer,
    kernel: CudaFunction,
    room: Room,
}

impl CudaSegments {
    /// A tracer for the triangles of a scene; those of materials that `see_through` marks block nothing.
    ///
    /// # Errors
    /// If there is no driver, there is no GPU, driver or GPU is too old, or the scene does not fit into the GPU's memory.
    pub fn new(geometry: &Geometry, see_through: &[bool]) -> Result<Self, BackendError> {
        let device = Device::first(BvhTracer::NAME)?;
        device.bind()?;
        let mut tracer = BvhTracer::new(&device)?;
        tracer.upload(&device, &DeviceTree::build(geometry, see_through, Quality::default()))?;
        let loaded = device.context().load_module(Ptx::from_src(programs::segments_on_bvh()));
        let kernel = loaded.and_then(|module| module.load_function("segments"));
        let kernel = kernel.map_err(|error| device.fault("loading the kernel of segments", &error))?;
        Ok(Self { device, tracer, kernel, room: Room::default() })
    }
}

impl SegmentTracer for CudaSegments {
    fn name(&self) -> &'static str {
        BvhTracer::NAME
    }

    fn device(&self) -> String {
        self.device.gpu().name.clone()
    }

    #[allow(unsafe_code, reason = "launches a kernel")]
    fn blocked(&mut self, segments: &Segments, bits: &mut Vec<u32>) -> Result<(), BackendError> {
        let Self { device, tracer, kernel, room } = self;
        device.bind()?;
        in_launches(segments, bits, |segments, bits| {
            let mut params = room.fill(device, segments)?;
            tracer.fill(device, &mut params);
            let blocks = (segments.all.len() as u32).div_ceil(SEGMENT_THREADS);
            let config =
                LaunchConfig { grid_dim: (blocks, 1, 1), block_dim: (SEGMENT_THREADS, 1, 1), shared_mem_bytes: 0 };
            let mut launch = device.stream().launch_builder(kernel);
            launch.arg(&params);
            // SAFETY: the kernel takes one `Params` by value, whose layout its compiler checked. It reads the given number of segments and the
            // pairs that these refer to, which the caller made together, and writes one bit for each segment. The buffers and the tree live until
            // the results are read.
            unsafe { launch.launch(config) }.map_err(|error| device.fault("tracing segments", &error))?;
            room.read(device, segments.all.len(), bits)
        })
    }
}

/// Segments on NVIDIA's OptiX: for a segment that grazes an edge, the result may differ from the processor's.
#[derive(Debug)]
pub struct OptixSegments {
    // Declared before `device`, so that pipeline and buffers are dropped before the context that they belong to.
    pipeline: SegmentPipeline,
    room: Room,
    counts: Buffer<u64>,
    device: Device,
}

impl OptixSegments {
    /// As [`CudaSegments::new`].
    ///
    /// # Errors
    /// As for [`CudaSegments::new`], and if the driver has no OptiX.
    pub fn new(geometry: &Geometry, see_through: &[bool]) -> Result<Self, BackendError> {
        let device = Device::first(OptixTracer::NAME)?;
        device.bind()?;
        let mut tracer = OptixTracer::new(&device)?;
        let materials = geometry.batches.iter().map(|batch| batch.material as usize + 1).max().unwrap_or(0);
        let scene = RenderScene {
            geometry: geometry.clone(),
            materials: vec![Material::default(); materials],
            ..RenderScene::default()
        };
        // Every material has an any-hit program, which excludes the pair's triangles by their ids.
        let asks = vec![true; materials.max(1)];
        let buffers = SceneBuffers::new(&device, &scene, None)?;
        tracer.build(&device, &scene, &asks, &(), &buffers)?;
        let pipeline = SegmentPipeline::new(&device, tracer, see_through)?;
        Ok(Self { pipeline, room: Room::default(), counts: Buffer::default(), device })
    }
}

impl SegmentTracer for OptixSegments {
    fn name(&self) -> &'static str {
        OptixTracer::NAME
    }

    fn device(&self) -> String {
        format!("{}, {}", self.device.gpu().name, self.pipeline.description())
    }

    fn blocked(&mut self, segments: &Segments, bits: &mut Vec<u32>) -> Result<(), BackendError> {
        let Self { pipeline, room, counts, device } = self;
        device.bind()?;
        in_launches(segments, bits, |segments, bits| {
            let mut params = room.fill(device, segments)?;
            device.clear("the exception", counts, EXCEPTION_SLOT as usize + 1)?;
            params.ray_counts = counts.address(device);
            pipeline.launch(device, &mut params)?;
            room.read(device, segments.all.len(), bits)?;
            let mut code = [0_u64];
            if let Some(counts) = &counts.0 {
                let copied = device.stream().memcpy_dtoh(&counts.slice(EXCEPTION_SLOT as usize..), &mut code);
                copied.map_err(|error| device.fault("tracing segments", &error))?;
            }
            match code {
                [0] => Ok(()),
                [code] => {
                    let message = format!("tracing segments: OptiX stopped with exception {}", code.cast_signed());
                    Err(BackendError::Device { backend: OptixTracer::NAME, message })
                }
            }
        })
    }
}
