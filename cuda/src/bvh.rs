//! Our own wide tree, built by the processor and traversed by kernels.

use crate::device::{Buffer, Device};
use crate::layout::{BLOCK_HEIGHT, BLOCK_WIDTH, Params};
use crate::programs;
use crate::rays::DeviceTracer;
use crate::scene::SceneBuffers;
use cudarc::driver::{CudaFunction, LaunchConfig, PushKernelArg as _};
use cudarc::nvrtc::Ptx;
use curitiba_passes::trace::Quality;
use curitiba_passes::trace::device::DeviceTree;
use curitiba_pipeline::backend::{BackendError, BuildStats, RayJob};
use curitiba_pipeline::programs::{Fidelity, RayProgram};
use curitiba_pipeline::scene::RenderScene;

/// The kernel of a program in one fidelity.
#[derive(Debug)]
struct Kernel {
    program: RayProgram,
    fidelity: Fidelity,
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
}

impl DeviceTracer for BvhTracer {
    const NAME: &'static str = "cuda";
    /// About 110 on the device; while it is built, about 500 on the host for obvhs's tree, its collapse and the copy.
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
        self.nodes = device.upload("the nodes of the tree", bytemuck::cast_slice(&tree.nodes))?;
        self.leaves = device.upload("the triangles of the tree", tree.triangles.as_flattened().as_flattened())?;
        self.node_count = tree.nodes.len() as u32;
        self.bounds = tree.bounds;
        Ok(BuildStats { bytes: self.nodes.bytes() + self.leaves.bytes(), nodes: tree.nodes.len() as u64 })
    }

    fn clear(&mut self) {
        let kernels = std::mem::take(&mut self.kernels);
        *self = Self { kernels, ..Self::default() };
    }

    fn load(&mut self, device: &Device, job: &RayJob<'_>) -> Result<(), BackendError> {
        let (program, fidelity, info) = (job.program, job.fidelity, job.program.info());
        if self.kernels.iter().any(|kernel| (kernel.program, kernel.fidelity) == (program, fidelity)) {
            return Ok(());
        }
        let loaded = device.context().load_module(Ptx::from_src(programs::on_bvh(program, fidelity)));
        let function = loaded.and_then(|module| module.load_function(info.entry));
        let function =
            function.map_err(|error| device.fault(&format!("loading the kernel of `{}`", info.stem), &error))?;
        self.kernels.push(Kernel { program, fidelity, function });
        Ok(())
    }

    #[allow(unsafe_code, reason = "launches a kernel")]
    fn launch(&mut self, device: &Device, job: &RayJob<'_>, params: &mut Params) -> Result<(), BackendError> {
        params.nodes = self.nodes.address(device);
        params.leaves = self.leaves.address(device);
        params.node_count = self.node_count;
        [params.scene_low, params.scene_high] = self.bounds;
        let is_this = |kernel: &&Kernel| (kernel.program, kernel.fidelity) == (job.program, job.fidelity);
        let kernel = &self.kernels.iter().find(is_this).expect("loaded before").function;
        let config = LaunchConfig {
            grid_dim: (params.width.div_ceil(BLOCK_WIDTH), params.rows.div_ceil(BLOCK_HEIGHT), 1),
            block_dim: (BLOCK_WIDTH, BLOCK_HEIGHT, 1),
            shared_mem_bytes: 0,
        };
        let mut launch = device.stream().launch_builder(kernel);
        launch.arg(&*params);
        // SAFETY: the kernel takes one `Params` by value, whose layout its compiler checked. Its addresses are of buffers
        // of this backend that live until the stream was synchronised, as long as the images, tables and meshes that the
        // job was checked to have; indices in them were checked when the scene was built.
        let launched = unsafe { launch.launch(config) };
        launched.map_err(|error| device.fault(&format!("running `{}`", job.program.info().stem), &error))?;
        Ok(())
    }
}
