//! Our own wide tree, built by the processor and traversed by kernels.

use crate::device::{Buffer, Device};
use crate::layout::{
    ASKS_EYE, BLOCK_HEIGHT, BLOCK_WIDTH, LISTED, Params, REACHES, SETTLED_BYTES, SURFACE_BYTES, TRACING_WARPS,
};
use crate::nodes::WideNode;
use crate::one_gpu::DeviceTracer;
use crate::programs::{self, Key};
use crate::scene::SceneBuffers;
use cudarc::driver::{CudaFunction, DriverError, LaunchConfig, PushKernelArg as _};
use cudarc::nvrtc::Ptx;
use curitiba_passes::effects::Lighting;
use curitiba_passes::effects::dielectric::{Variant, ways_of_path};
use curitiba_passes::trace::Quality;
use curitiba_passes::trace::gpu_tree::DeviceTree;
use curitiba_pipeline::backend::{BackendError, BuildStats, RayJob};
use curitiba_pipeline::programs::{Fidelity, RayProgram};
use curitiba_pipeline::scene::RenderScene;
use glam::Vec3;
use rayon::prelude::*;

/// Least number of nodes that a thread of the host converts at a time.
const GRAIN: usize = 4096;

/// How work is assigned to the threads of a kernel. A warp is 8 x 4 threads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Dealt {
    /// One thread a pixel, in blocks of 8 x 8 threads.
    Pixels,
    /// One thread a pixel, in blocks of one warp.
    Tiles,
    /// Work from a list: blocks of `warps` warps, as many as the device can run at once, take items until none is left.
    List { warps: u32 },
    /// A single thread.
    Once,
}

/// A kernel that runs before the one that writes the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Stage {
    entry: &'static str,
    dealt: Dealt,
    /// True for a stage that decides occlusion rays from the triangles near the ray origins, and for the stage that traces the undecided rays.
    /// Stages with `settles` are skipped where points have fewer than [`FEW_SAMPLES`] rays.
    settles: bool,
}

/// The stages of `ssao` in corrected fidelity.
const OF_OCCLUSION: [Stage; 2] = [
    Stage { entry: "settle_occlusion", dealt: Dealt::Tiles, settles: true },
    Stage { entry: "trace_occlusion", dealt: Dealt::List { warps: TRACING_WARPS }, settles: true },
];

/// The stages of `final` in corrected fidelity: paths through glass are followed to the surfaces seen through it, which are then lit.
const OF_FINAL: [Stage; 4] = [
    LISTS_SURFACES,
    Stage { entry: "light_surfaces", dealt: Dealt::List { warps: 2 }, settles: false },
    SETTLES_SURFACES,
    TRACES_SURFACES,
];
/// The stages of `final` with several lights or a disc light: surfaces are lit when they are listed.
const OF_FINAL_IN_LIGHTS: [Stage; 3] = [LISTS_SURFACES, SETTLES_SURFACES, TRACES_SURFACES];

const LISTS_SURFACES: Stage = Stage { entry: "list_surfaces", dealt: Dealt::Pixels, settles: false };
const SETTLES_SURFACES: Stage = Stage { entry: "settle_surfaces", dealt: Dealt::List { warps: 1 }, settles: true };
const TRACES_SURFACES: Stage =
    Stage { entry: "trace_surfaces", dealt: Dealt::List { warps: TRACING_WARPS }, settles: true };

fn stages(Key { program, variant, lighting, .. }: Key) -> &'static [Stage] {
    match (program, variant) {
        (_, Variant::Panes(Fidelity::Thesis)) => &[],
        (RayProgram::Ssao, _) => &OF_OCCLUSION,
        (RayProgram::Final, _) if lighting == Lighting::Lights => &OF_FINAL_IN_LIGHTS,
        (RayProgram::Final, _) => &OF_FINAL,
        _ => &[],
    }
}

/// With fewer occlusion rays per point than this, settling costs more than tracing the rays.
const FEW_SAMPLES: u32 = 6;

/// Average number of entries in the list of surfaces for each pixel of a launch, and for each way into which its path splits: 256 bytes. A
/// pixel whose surfaces find no room is computed by one thread from beginning to end.
const SURFACES_PER_PIXEL: u64 = 4;

/// Greatest number of entries in the list of surfaces where paths split into ways: 512 MiB. Only a launch of more than 2^21 pixels has more.
const SURFACES_OF_WAYS: u64 = 1 << 23;

/// Device memory of a triangle in the tree, in bytes: three vectors of four numbers.
const BYTES_OF_TRIANGLE: u64 = 48;

/// Lists of nearby triangles are kept shorter if more triangles than this lie within the occlusion radius of a point. The number of triangles
/// within the radius is estimated as if all triangles lay on one surface across the whole scene.
const TOO_MANY_WITHIN: f32 = 2000.0;

/// Number of threads in a warp. Whole warps take entries of the list of surfaces.
const WARP: u32 = 32;

/// Number of progress counters: `Progress` in `programs/count_open.cuh`.
const PROGRESS: usize = 5;

/// Number of blocks per multiprocessor for a kernel that takes work from a list: the most that a multiprocessor can hold.
const BLOCKS: u32 = 32;

/// The kernels of a program in one variant.
#[derive(Debug)]
struct Kernel {
    key: Key,
    /// Kernel that finds the bodies that contain the camera; `None` in variants without bodies.
    find_eye: Option<CudaFunction>,
    /// Kernels that run before the one that writes the picture.
    stages: Vec<(Stage, CudaFunction)>,
    /// The kernel that writes the picture.
    function: CudaFunction,
}

/// A tree on the device.
#[derive(Debug, Default)]
struct Tree {
    nodes: Buffer<u32>,
    leaves: Buffer<f32>,
    node_count: u32,
    bounds: [[f32; 3]; 2],
}

impl Tree {
    fn upload(device: &Device, tree: &DeviceTree) -> Result<Self, BackendError> {
        let nodes: Vec<WideNode> = tree.nodes.par_iter().with_min_len(GRAIN).map(WideNode::from).collect();
        Ok(Self {
            nodes: device.upload("the nodes of the tree", bytemuck::cast_slice(&nodes))?,
            leaves: device.upload("the triangles of the tree", tree.triangles.as_flattened().as_flattened())?,
            node_count: tree.nodes.len() as u32,
            bounds: tree.bounds,
        })
    }

    /// Writes the addresses and bounds of the tree into the parameters of a launch.
    fn fill(&self, device: &Device, params: &mut Params) {
        params.nodes = self.nodes.address(device);
        params.leaves = self.leaves.address(device);
        params.node_count = self.node_count;
        [params.scene_low, params.scene_high] = self.bounds;
    }

    /// Size in bytes of device memory.
    fn bytes(&self) -> u64 {
        self.nodes.bytes() + self.leaves.bytes()
    }
}

/// The trees that the processor builds over a scene.
#[derive(Debug)]
pub struct Trees {
    /// The tree of all but the sky.
    ground: DeviceTree,
    sky: Option<DeviceTree>,
}

/// The trees on the device, and the kernels loaded so far.
#[derive(Debug, Default)]
pub struct BvhTracer {
    kernels: Vec<Kernel>,
    /// The tree of all but the sky.
    ground: Tree,
    /// The tree of the sky, which rays from mirrors and glass can hit.
    sky: Option<Tree>,
    /// The parameters of the last launch, with the tree of the sky in place of `ground`.
    params_of_sky: Buffer<Params>,
    surfaces: Buffer<f32>,
    first_surface: Buffer<u32>,
    progress: Buffer<u32>,
    settled: Buffer<u32>,
    /// Number of entries in the list of surfaces; `None` for the number that follows from the size of the launch ([`SURFACES_PER_PIXEL`]).
    room: Option<u64>,
}

impl BvhTracer {
    /// Limits the list of surfaces of `final` to `room` entries, rounded up to whole warps, whatever the size of the picture. Pictures do not
    /// depend on the limit: pixels whose surfaces find no room are computed without the list.
    pub fn limit_surfaces(&mut self, room: u64) {
        self.room = Some(room);
    }

    /// Copies a tree to the device.
    ///
    /// # Errors
    /// If the device cannot hold it.
    pub(crate) fn upload(&mut self, device: &Device, tree: &DeviceTree) -> Result<(), BackendError> {
        self.ground = Tree::upload(device, tree)?;
        Ok(())
    }

    /// Writes the addresses and bounds of the tree of all but the sky into the parameters of a launch.
    pub(crate) fn fill(&self, device: &Device, params: &mut Params) {
        self.ground.fill(device, params);
    }

    /// Copies the launch parameters to the device with the sky's tree in place of `ground`, and puts the address of that copy into `params`.
    fn fill_sky(&mut self, device: &Device, params: &mut Params) -> Result<(), BackendError> {
        let Some(sky) = &self.sky else { return Ok(()) };
        // No exact sphere is part of a sky, so the address of the spheres is 0.
        let mut own = Params { sky: 0, spheres: 0, ..*params };
        sky.fill(device, &mut own);
        device.replace("the parameters of the sky", &mut self.params_of_sky, &[own])?;
        params.sky = self.params_of_sky.address(device);
        Ok(())
    }

    /// Greatest lengths of lists of nearby triangles, for each part of the occlusion radius. Measured on an H100: long lists pay, except where far
    /// more triangles lie within the radius than any list can hold.
    fn listed(&self, radius: f32) -> [u32; REACHES as usize - 1] {
        let [low, high] = self.ground.bounds.map(Vec3::from_array);
        let triangles = (self.ground.leaves.bytes() / BYTES_OF_TRIANGLE) as f32;
        let within = triangles * (radius / (high - low).length()).powi(2);
        if within > TOO_MANY_WITHIN { [192, 512] } else { [LISTED, 512] }
    }

    /// Reserves the buffers through which the kernels of a program communicate, and sets the progress counters to 0. The buffers are kept for
    /// the next launch.
    fn make_room(&mut self, device: &Device, job: &RayJob<'_>, params: &mut Params) -> Result<(), BackendError> {
        let pixels = params.width as usize * params.height as usize;
        let mut points = pixels;
        if job.program == RayProgram::Final {
            self.make_room_for_surfaces(device, ways_of_path(job), params)?;
            points = params.capacity as usize;
        }
        device.clear("the progress of the kernels", &mut self.progress, PROGRESS)?;
        params.progress = self.progress.address(device);
        if params.samples >= FEW_SAMPLES {
            let words = points * SETTLED_BYTES as usize / size_of::<u32>();
            device.reserve("what is near the points of occlusion rays", &mut self.settled, words)?;
            params.settled = self.settled.address(device);
        }
        Ok(())
    }

    /// Reserves the list of surfaces for a launch whose paths split into up to `ways` ways.
    fn make_room_for_surfaces(&mut self, device: &Device, ways: u32, params: &mut Params) -> Result<(), BackendError> {
        let whole = SURFACES_PER_PIXEL * u64::from(params.width) * u64::from(params.rows);
        let divided = whole.max((whole * u64::from(ways)).min(SURFACES_OF_WAYS));
        let room = self.room.unwrap_or(divided).min(u64::from(u32::MAX / 2));
        let room = room.next_multiple_of(u64::from(WARP));
        let words = room * u64::from(SURFACE_BYTES) / size_of::<f32>() as u64;
        device.reserve("the surfaces of `final`", &mut self.surfaces, words as usize)?;
        let pixels = params.width as usize * params.height as usize;
        device.reserve("the first surface of each pixel", &mut self.first_surface, pixels)?;
        params.surfaces = self.surfaces.address(device);
        params.first_surface = self.first_surface.address(device);
        params.capacity = room;
        Ok(())
    }
}

/// Starts a kernel that takes one [`Params`].
#[allow(unsafe_code, reason = "launches a kernel")]
fn start(device: &Device, kernel: &CudaFunction, dealt: Dealt, params: &Params) -> Result<(), DriverError> {
    let tile = (BLOCK_WIDTH, WARP / BLOCK_WIDTH);
    let pixels = |(width, height)| (params.width.div_ceil(width), params.rows.div_ceil(height), 1);
    let (grid_dim, block_dim) = match dealt {
        Dealt::Pixels => (pixels((BLOCK_WIDTH, BLOCK_HEIGHT)), (BLOCK_WIDTH, BLOCK_HEIGHT, 1)),
        Dealt::Tiles => (pixels(tile), (tile.0, tile.1, 1)),
        Dealt::Once => ((1, 1, 1), (1, 1, 1)),
        Dealt::List { warps } => ((device.multiprocessors()? * BLOCKS, 1, 1), (tile.0, tile.1, warps)),
    };
    let mut launch = device.stream().launch_builder(kernel);
    launch.arg(params);
    // SAFETY: the kernel takes one `Params` by value, whose layout its compiler checked. Its addresses are those of buffers of
    // this backend, which live until the stream is synchronised. The job was checked to have images, tables and meshes of the
    // lengths that the kernel reads. Indices in them were checked when the scene was built.
    unsafe { launch.launch(LaunchConfig { grid_dim, block_dim, shared_mem_bytes: 0 }) }.map(|_| ())
}

impl DeviceTracer for BvhTracer {
    const NAME: &'static str = "cuda";
    /// About 115 on the device, plus about 500 on the host during the build, for obvhs's tree, its collapse and the copy.
    const BYTES_PER_TRIANGLE: u64 = 610;

    type Prepared = Trees;

    fn prepare(scene: &RenderScene, filtered: &[bool]) -> Trees {
        Trees {
            ground: DeviceTree::build(&scene.geometry, filtered, Quality::default()),
            sky: DeviceTree::of_sky(&scene.geometry, filtered, Quality::default()),
        }
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
        trees: &Trees,
        _: &SceneBuffers,
    ) -> Result<BuildStats, BackendError> {
        self.upload(device, &trees.ground)?;
        self.sky = trees.sky.as_ref().map(|sky| Tree::upload(device, sky)).transpose()?;
        let held = || std::iter::once(&self.ground).chain(&self.sky);
        Ok(BuildStats {
            bytes: held().map(Tree::bytes).sum(),
            nodes: held().map(|tree| u64::from(tree.node_count)).sum(),
        })
    }

    fn program(key: Key) -> Option<&'static str> {
        programs::on_bvh(key)
    }

    fn clear(&mut self) {
        (self.ground, self.sky) = (Tree::default(), None);
        (self.surfaces, self.first_surface) = (Buffer::default(), Buffer::default());
        self.settled = Buffer::default();
    }

    fn held_bytes(&self) -> u64 {
        let lists = [&self.first_surface, &self.progress, &self.settled].map(Buffer::bytes);
        self.surfaces.bytes() + lists.iter().sum::<u64>() + self.params_of_sky.bytes()
    }

    fn load(&mut self, device: &Device, job: &RayJob<'_>) -> Result<(), BackendError> {
        let (key, info) = (Key::of(job), job.program.info());
        if self.kernels.iter().any(|kernel| kernel.key == key) {
            return Ok(());
        }
        let text = Self::program(key).ok_or_else(|| programs::not_written(Self::NAME, job.program))?;
        let loaded = device.context().load_module(Ptx::from_src(text));
        let kernel = loaded.and_then(|module| {
            let load = |stage: &Stage| Ok((*stage, module.load_function(stage.entry)?));
            let find_eye = key.variant.knows_bodies().then(|| module.load_function("find_eye")).transpose()?;
            let stages = stages(key).iter().map(load).collect::<Result<_, DriverError>>()?;
            let function = module.load_function(info.entry)?;
            Ok(Kernel { key, find_eye, stages, function })
        });
        let failed = |error| device.fault(&format!("loading the kernels of `{}`", info.stem), &error);
        self.kernels.push(kernel.map_err(failed)?);
        Ok(())
    }

    fn launch(&mut self, device: &Device, job: &RayJob<'_>, params: &mut Params) -> Result<(), BackendError> {
        self.fill(device, params);
        params.listed = self.listed(params.radius);
        self.fill_sky(device, params)?;
        let key = Key::of(job);
        let index = self.kernels.iter().position(|kernel| kernel.key == key).expect("loaded before");
        let failed = |error| device.fault(&format!("running `{}`", job.program.info().stem), &error);
        if let Some(find_eye) = self.kernels[index].find_eye.as_ref().filter(|_| params.asks & ASKS_EYE != 0) {
            return start(device, find_eye, Dealt::Once, params).map_err(failed);
        }
        if !self.kernels[index].stages.is_empty() {
            self.make_room(device, job, params)?;
        }
        let Kernel { stages, function, .. } = &self.kernels[index];
        for (stage, kernel) in stages.iter().filter(|(stage, _)| !stage.settles || params.settled != 0) {
            start(device, kernel, stage.dealt, params).map_err(failed)?;
        }
        start(device, function, Dealt::Pixels, params).map_err(failed)
    }
}
