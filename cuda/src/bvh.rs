//! Our own wide tree, built by the processor and traversed by kernels.

use crate::device::{Buffer, Device};
use crate::layout::{BLOCK_HEIGHT, BLOCK_WIDTH, Params, SETTLED_BYTES, SURFACE_BYTES};
use crate::nodes::WideNode;
use crate::programs;
use crate::rays::DeviceTracer;
use crate::scene::SceneBuffers;
use cudarc::driver::{CudaFunction, DriverError, LaunchConfig, PushKernelArg as _};
use cudarc::nvrtc::Ptx;
use curitiba_passes::trace::Quality;
use curitiba_passes::trace::device::DeviceTree;
use curitiba_pipeline::backend::{BackendError, BuildStats, RayJob};
use curitiba_pipeline::programs::{Fidelity, RayProgram};
use curitiba_pipeline::scene::RenderScene;

/// How the threads of a kernel are dealt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Dealt {
    /// One a pixel.
    ToPixels,
    /// As many as the device runs at once take surfaces from the list until none is left.
    ToSurfaces,
}

/// A kernel that runs before the one that writes the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Stage {
    entry: &'static str,
    dealt: Dealt,
    /// Asks what is near the points of occlusion rays: left out where they are few.
    settles: bool,
}

/// The stages of `ssao` in corrected fidelity.
const OF_OCCLUSION: [Stage; 1] = [Stage { entry: "settle_occlusion", dealt: Dealt::ToPixels, settles: true }];

/// Those of `final`: glass is followed to the surfaces that are seen through it, which are then lit.
const OF_FINAL: [Stage; 4] = [
    Stage { entry: "list_surfaces", dealt: Dealt::ToPixels, settles: false },
    Stage { entry: "light_surfaces", dealt: Dealt::ToSurfaces, settles: false },
    Stage { entry: "settle_surfaces", dealt: Dealt::ToSurfaces, settles: true },
    Stage { entry: "occlude_surfaces", dealt: Dealt::ToSurfaces, settles: false },
];

fn stages(program: RayProgram, fidelity: Fidelity) -> &'static [Stage] {
    match (program, fidelity) {
        (RayProgram::Ssao, Fidelity::Corrected) => &OF_OCCLUSION,
        (RayProgram::Final, Fidelity::Corrected) => &OF_FINAL,
        _ => &[],
    }
}

/// Below so many rays a point, asking what is near costs more than the rays.
const FEW_SAMPLES: u32 = 6;

/// Places of the list of surfaces for each pixel of a launch on average; 256 bytes. A pixel whose surfaces find no place is computed
/// from begin to end by one thread.
const SURFACES_PER_PIXEL: u64 = 4;

/// Places are taken by whole warps.
const WARP: u64 = 32;

/// Counters of the kernels: `Progress` in `programs/surfaces.cuh`.
const PROGRESS: usize = 4;

/// Blocks of a kernel that takes surfaces from the list, for each multiprocessor: as many as one can hold.
const BLOCKS: u32 = 32;

/// The kernels of a program in one fidelity.
#[derive(Debug)]
struct Kernel {
    program: RayProgram,
    fidelity: Fidelity,
    /// What runs before.
    stages: Vec<(Stage, CudaFunction)>,
    /// Writes the picture.
    function: CudaFunction,
}

/// The tree on the device, and the kernels that were loaded so far.
#[derive(Debug, Default)]
pub struct BvhTracer {
    kernels: Vec<Kernel>,
    nodes: Buffer<u32>,
    leaves: Buffer<f32>,
    node_count: u32,
    bounds: [[f32; 3]; 2],
    surfaces: Buffer<f32>,
    first_surface: Buffer<u32>,
    progress: Buffer<u32>,
    settled: Buffer<u32>,
    /// Room in the list, where it is not to be [`SURFACES_PER_PIXEL`].
    room: Option<u64>,
}

impl BvhTracer {
    /// Gives the list of surfaces of `final` room for so many, whatever the picture. Pictures do not depend on it: what finds no
    /// room is computed without.
    pub fn limit_surfaces(&mut self, room: u64) {
        self.room = Some(room);
    }

    /// Makes room for what the kernels of a program tell each other, which is kept for the next launch.
    fn make_room(&mut self, device: &Device, program: RayProgram, params: &mut Params) -> Result<(), BackendError> {
        let pixels = params.width as usize * params.height as usize;
        let mut points = pixels;
        if program == RayProgram::Final {
            self.make_room_for_surfaces(device, params)?;
            points = params.capacity as usize;
        }
        if params.samples >= FEW_SAMPLES {
            let words = points * SETTLED_BYTES as usize / size_of::<u32>();
            device.reserve("what is near the points of occlusion rays", &mut self.settled, words)?;
            params.settled = self.settled.address(device);
        }
        Ok(())
    }

    /// Makes room for the surfaces of a launch, and sets the kernels' counters to 0.
    fn make_room_for_surfaces(&mut self, device: &Device, params: &mut Params) -> Result<(), BackendError> {
        let launched = u64::from(params.width) * u64::from(params.rows);
        let room = self.room.unwrap_or(SURFACES_PER_PIXEL * launched).min(u64::from(u32::MAX / 2));
        let room = room.next_multiple_of(WARP);
        let words = room * u64::from(SURFACE_BYTES) / size_of::<f32>() as u64;
        device.reserve("the surfaces of `final`", &mut self.surfaces, words as usize)?;
        let pixels = params.width as usize * params.height as usize;
        device.reserve("the first surface of each pixel", &mut self.first_surface, pixels)?;
        device.clear("the progress of the kernels", &mut self.progress, PROGRESS)?;
        params.surfaces = self.surfaces.address(device);
        params.first_surface = self.first_surface.address(device);
        params.progress = self.progress.address(device);
        params.capacity = room;
        Ok(())
    }
}

/// Starts a kernel that takes one [`Params`].
#[allow(unsafe_code, reason = "launches a kernel")]
fn start(device: &Device, kernel: &CudaFunction, grid: (u32, u32), params: &Params) -> Result<(), DriverError> {
    let config =
        LaunchConfig { grid_dim: (grid.0, grid.1, 1), block_dim: (BLOCK_WIDTH, BLOCK_HEIGHT, 1), shared_mem_bytes: 0 };
    let mut launch = device.stream().launch_builder(kernel);
    launch.arg(params);
    // SAFETY: the kernel takes one `Params` by value, whose layout its compiler checked. Its addresses are of buffers
    // of this backend that live until the stream was synchronised, as long as the images, tables and meshes that the
    // job was checked to have; indices in them were checked when the scene was built.
    unsafe { launch.launch(config) }.map(|_| ())
}

impl DeviceTracer for BvhTracer {
    const NAME: &'static str = "cuda";
    /// About 115 on the device; while it is built, about 500 on the host for obvhs's tree, its collapse and the copy.
    const BYTES_PER_TRIANGLE: u64 = 610;

    type Prepared = DeviceTree;

    fn prepare(scene: &RenderScene, filtered: &[bool]) -> DeviceTree {
        DeviceTree::build(&scene.geometry, filtered, Quality::default())
    }

    fn new(_: &Device) -> Result<Self, BackendError> {
        Ok(Self::default())
    }

    fn description(&self) -> String {
        String::new()
    }

    fn build(
        &mut self,
        device: &Device,
        _: &RenderScene,
        _: &[bool],
        tree: &DeviceTree,
        _: &SceneBuffers,
    ) -> Result<BuildStats, BackendError> {
        let nodes: Vec<WideNode> = tree.nodes.iter().map(WideNode::from).collect();
        self.nodes = device.upload("the nodes of the tree", bytemuck::cast_slice(&nodes))?;
        self.leaves = device.upload("the triangles of the tree", tree.triangles.as_flattened().as_flattened())?;
        self.node_count = tree.nodes.len() as u32;
        self.bounds = tree.bounds;
        Ok(BuildStats { bytes: self.nodes.bytes() + self.leaves.bytes(), nodes: tree.nodes.len() as u64 })
    }

    fn clear(&mut self) {
        (self.nodes, self.leaves, self.node_count) = (Buffer::default(), Buffer::default(), 0);
        (self.surfaces, self.first_surface) = (Buffer::default(), Buffer::default());
        self.settled = Buffer::default();
    }

    fn held_bytes(&self) -> u64 {
        let lists = [&self.first_surface, &self.progress, &self.settled].map(Buffer::bytes);
        self.surfaces.bytes() + lists.iter().sum::<u64>()
    }

    fn load(&mut self, device: &Device, job: &RayJob<'_>) -> Result<(), BackendError> {
        let (program, fidelity, info) = (job.program, job.fidelity, job.program.info());
        if self.kernels.iter().any(|kernel| (kernel.program, kernel.fidelity) == (program, fidelity)) {
            return Ok(());
        }
        let loaded = device.context().load_module(Ptx::from_src(programs::on_bvh(program, fidelity)));
        let kernel = loaded.and_then(|module| {
            let load = |stage: &Stage| Ok((*stage, module.load_function(stage.entry)?));
            let stages = stages(program, fidelity).iter().map(load).collect::<Result<_, DriverError>>()?;
            Ok(Kernel { program, fidelity, stages, function: module.load_function(info.entry)? })
        });
        let failed = |error| device.fault(&format!("loading the kernels of `{}`", info.stem), &error);
        self.kernels.push(kernel.map_err(failed)?);
        Ok(())
    }

    fn launch(&mut self, device: &Device, job: &RayJob<'_>, params: &mut Params) -> Result<(), BackendError> {
        params.nodes = self.nodes.address(device);
        params.leaves = self.leaves.address(device);
        params.node_count = self.node_count;
        [params.scene_low, params.scene_high] = self.bounds;
        let is_this = |kernel: &Kernel| (kernel.program, kernel.fidelity) == (job.program, job.fidelity);
        let index = self.kernels.iter().position(is_this).expect("loaded before");
        if !self.kernels[index].stages.is_empty() {
            self.make_room(device, job.program, params)?;
        }
        let Kernel { stages, function, .. } = &self.kernels[index];
        let failed = |error| device.fault(&format!("running `{}`", job.program.info().stem), &error);
        let pixels = (params.width.div_ceil(BLOCK_WIDTH), params.rows.div_ceil(BLOCK_HEIGHT));
        for (stage, kernel) in stages.iter().filter(|(stage, _)| !stage.settles || params.settled != 0) {
            let grid = match stage.dealt {
                Dealt::ToPixels => pixels,
                Dealt::ToSurfaces => (device.multiprocessors().map_err(failed)? * BLOCKS, 1),
            };
            start(device, kernel, grid, params).map_err(failed)?;
        }
        start(device, function, pixels, params).map_err(failed)
    }
}
