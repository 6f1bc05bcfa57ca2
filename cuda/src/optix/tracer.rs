//! The device programs on OptiX.

use super::api::{Api, BuildSizes, Mesh, Pipeline};
use crate::device::{Buffer, Device};
use crate::layout::Params;
use crate::programs;
use crate::rays::DeviceTracer;
use crate::scene::SceneBuffers;
use curitiba_pipeline::backend::{BackendError, BuildStats};
use curitiba_pipeline::programs::{Fidelity, RayProgram};
use curitiba_pipeline::scene::{Geometry, RenderScene};

/// OptiX's structure of a scene, and the programs that were loaded so far.
#[derive(Debug)]
pub struct OptixTracer {
    api: Api,
    rt_cores: u32,
    programs: Vec<(RayProgram, Pipeline, Buffer<u8>)>,
    structure: Buffer<u8>,
    handle: u64,
    params: Buffer<u8>,
}

fn wrong(message: String) -> BackendError {
    BackendError::Device { backend: OptixTracer::NAME, message }
}

/// What OptiX refused. Where the device itself failed, what CUDA says of it is nearer to the cause.
fn refused(device: &Device, doing: &str, why: String) -> BackendError {
    match device.stream().synchronize() {
        Ok(()) => wrong(format!("{doing}: {why}")),
        Err(error) => device.fault(doing, &error),
    }
}

/// By triangle: 1 where its material lets some rays through.
fn asked(geometry: &Geometry, filtered: &[bool]) -> Vec<u32> {
    let is_filtered = |material: u32| filtered.get(material as usize).copied().unwrap_or(false);
    geometry.materials().map(|material| u32::from(is_filtered(material))).collect()
}

fn room(device: &Device, what: &str, bytes: usize) -> Result<Buffer<u8>, BackendError> {
    let made = device.stream().alloc_zeros(bytes.max(1));
    Ok(Buffer(Some(made.map_err(|error| device.fault(&format!("making room for {what}"), &error))?)))
}

impl DeviceTracer for OptixTracer {
    const NAME: &'static str = "optix";
    /// An upper estimate of what OptiX takes while it builds, on the device.
    const BYTES_PER_TRIANGLE: u64 = 250;

    /// OptiX builds on the GPU.
    type Prepared = ();

    fn prepare(_: &RenderScene, _: &[bool]) {}

    fn new(device: &Device) -> Result<Self, BackendError> {
        let api = Api::new(device.context()).map_err(wrong)?;
        let rt_cores = api.rt_core_version().map_err(wrong)?;
        Ok(Self {
            api,
            rt_cores,
            programs: Vec::new(),
            structure: Buffer::default(),
            handle: 0,
            params: Buffer::default(),
        })
    }

    fn description(&self) -> String {
        let cores = match self.rt_cores {
            0 => "no ray-tracing cores".to_owned(),
            version => format!("ray-tracing cores {}.{}", version / 10, version % 10),
        };
        format!("OptiX interface {}, {cores}", self.api.version())
    }

    #[allow(unsafe_code, reason = "hands device memory to OptiX")]
    fn build(
        &mut self,
        device: &Device,
        scene: &RenderScene,
        filtered: &[bool],
        (): &(),
        buffers: &SceneBuffers,
    ) -> Result<BuildStats, BackendError> {
        let geometry = &scene.geometry;
        if geometry.triangles.is_empty() {
            return Ok(BuildStats::default());
        }
        let asked = device.upload("the flags of triangles", &asked(geometry, filtered))?;
        let (positions, triangles) = buffers.mesh(device);
        let mesh = Mesh {
            positions,
            vertices: geometry.positions.len() as u32,
            triangles,
            count: geometry.triangles.len() as u32,
            asked: asked.address(device),
        };
        let refused = |why| refused(device, "building OptiX's structure", why);
        let sizes: BuildSizes = self.api.build_sizes(&mesh).map_err(refused)?;
        let output = room(device, "OptiX's structure", sizes.output)?;
        let temporary = room(device, "OptiX's build", sizes.temporary)?;
        let compacted = device.upload("a number", &[0_u64])?;
        let stream = device.stream().cu_stream().cast();
        let addresses = (output.address(device), temporary.address(device), compacted.address(device));
        // SAFETY: the buffers have the sizes that were asked for, and live until the stream is synchronised below.
        let handle = unsafe { self.api.build(stream, &mesh, sizes, addresses) }.map_err(refused)?;
        let fault = |error| device.fault("building OptiX's structure", &error);
        let mut needed = [0_u64];
        if let Some(compacted) = &compacted.0 {
            device.stream().memcpy_dtoh(compacted, &mut needed).map_err(fault)?;
        }
        device.stream().synchronize().map_err(fault)?;
        let needed = needed[0] as usize;
        (self.structure, self.handle) = if needed > 0 && needed < sizes.output {
            let smaller = room(device, "OptiX's structure", needed)?;
            // SAFETY: as above; both live until the stream is synchronised.
            let moved = unsafe { self.api.compact(stream, handle, smaller.address(device), needed) };
            let moved = moved.map_err(refused)?;
            device.stream().synchronize().map_err(fault)?;
            (smaller, moved)
        } else {
            (output, handle)
        };
        // OptiX does not tell how many nodes it made.
        Ok(BuildStats { bytes: self.structure.bytes(), nodes: 0 })
    }

    fn clear(&mut self) {
        self.structure = Buffer::default();
        self.handle = 0;
    }

    fn load(&mut self, device: &Device, program: RayProgram) -> Result<(), BackendError> {
        if self.programs.iter().any(|(loaded, ..)| *loaded == program) {
            return Ok(());
        }
        let stem = program.info().stem;
        let compiled = self.api.pipeline(programs::on_optix(program));
        let pipeline = compiled.map_err(|why| refused(device, &format!("loading `{stem}`"), why))?;
        match device.upload("the records of the programs", &pipeline.records) {
            Ok(records) => {
                self.programs.push((program, pipeline, records));
                Ok(())
            }
            Err(error) => {
                self.api.destroy(&pipeline);
                Err(error)
            }
        }
    }

    #[allow(unsafe_code, reason = "launches a pipeline, and shows the parameters as bytes")]
    fn launch(
        &mut self,
        device: &Device,
        program: RayProgram,
        fidelity: Fidelity,
        params: &mut Params,
    ) -> Result<(), BackendError> {
        params.handle = self.handle;
        // SAFETY: plain numbers without padding, as the unit test of this module checks.
        let bytes = unsafe { std::slice::from_raw_parts((&raw const *params).cast::<u8>(), size_of::<Params>()) };
        device.replace("the launch parameters", &mut self.params, bytes)?;
        let (_, pipeline, records) =
            self.programs.iter().find(|(loaded, ..)| *loaded == program).expect("loaded before");
        let stream = device.stream().cu_stream().cast();
        let parameters = (self.params.address(device), size_of::<Params>());
        let records = (records.address(device), fidelity == Fidelity::Thesis);
        // SAFETY: the parameters are laid out as the programs' compiler checked; what they point to are buffers of this
        // backend that live until the stream was synchronised.
        let launched = unsafe { self.api.launch(stream, pipeline, parameters, records, [params.width, params.rows]) };
        launched.map_err(|why| refused(device, &format!("running `{}`", program.info().stem), why))
    }
}

impl Drop for OptixTracer {
    fn drop(&mut self) {
        for (_, pipeline, _) in &self.programs {
            self.api.destroy(pipeline);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use curitiba_pipeline::scene::Batch;

    #[test]
    fn triangles_of_filtered_materials_are_asked_about() {
        let geometry = Geometry {
            batches: vec![Batch { material: 1, first: 0, count: 2 }, Batch { material: 0, first: 2, count: 1 }],
            ..Geometry::default()
        };
        assert_eq!(asked(&geometry, &[false, true]), [1, 1, 0]);
        assert_eq!(asked(&geometry, &[]), [0, 0, 0]);
    }

    #[test]
    fn launch_parameters_have_no_padding() {
        let (addresses, words) = (20 * 8, 12 * 4 + 2 * 4 + 5 * 12 + 4);
        assert_eq!(size_of::<Params>(), addresses + words);
    }
}
