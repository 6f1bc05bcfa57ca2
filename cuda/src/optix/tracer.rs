//! The device programs on OptiX.

use super::abi::{GEOMETRY_FLAG_DISABLE_ANYHIT, GEOMETRY_FLAG_NONE};
use super::api::{Api, BuildSizes, Mesh, Pipeline};
use super::entries;
use crate::device::{Address, Buffer, Device};
use crate::images::Table;
use crate::layout::Params;
use crate::one_gpu::DeviceTracer;
use crate::programs::{self, Key};
use crate::scene::SceneBuffers;
use curitiba_pipeline::backend::{BackendError, BuildStats, RayJob};
use curitiba_pipeline::scene::{Geometry, RenderScene, TriangleRanges};
use std::ops::Range;

/// OptiX's structure of a scene, and the programs loaded so far.
#[derive(Debug)]
pub struct OptixTracer {
    api: Api,
    rt_cores: u32,
    programs: Vec<Loaded>,
    /// The structure of all but the sky.
    ground: Structure,
    /// The structure of the sky, which rays from mirrors and glass can hit; empty without a sky.
    sky: Structure,
    /// Number of materials in the structure.
    materials: usize,
    params: Buffer<u8>,
}

/// A structure on the device; the handle of an empty one, which nothing hits, is 0.
#[derive(Debug, Default)]
struct Structure {
    memory: Buffer<u8>,
    handle: u64,
}

/// A program, with the shader binding table of its last pass.
#[derive(Debug)]
struct Loaded {
    key: Key,
    pipeline: Pipeline,
    records: Table<u8>,
}

fn wrong(message: String) -> BackendError {
    BackendError::Device { backend: OptixTracer::NAME, message }
}

/// The error for a refused call of OptiX. If the device itself failed, CUDA's error is closer to the cause, and is returned.
fn refused(device: &Device, doing: &str, why: String) -> BackendError {
    match device.stream().synchronize() {
        Ok(()) => wrong(format!("{doing}: {why}")),
        Err(error) => device.fault(doing, &error),
    }
}

/// For each material (at least one): whether any-hit programs are called on its triangles.
fn flags(materials: usize, filtered: &[bool]) -> Vec<u32> {
    let flag = |material| match filtered.get(material) {
        Some(true) => GEOMETRY_FLAG_NONE,
        _ => GEOMETRY_FLAG_DISABLE_ANYHIT,
    };
    (0..materials.max(1)).map(flag).collect()
}

/// The triangles `ids`. With `of_sky`, triangles outside the sky get three equal corners, so that no ray hits them; otherwise the triangles of the
/// sky do.
fn masked(geometry: &Geometry, ids: Range<u32>, of_sky: bool) -> Vec<[u32; 3]> {
    let corners = |id| if geometry.sky.contains(id) == of_sky { geometry.triangles[id as usize] } else { [0; 3] };
    ids.map(corners).collect()
}

/// Ids from the first triangle of a sky to its last; `None` without a sky.
fn span(sky: &TriangleRanges) -> Option<Range<u32>> {
    let (first, last) = (sky.as_slice().first()?, sky.as_slice().last()?);
    Some(first[0]..last[1])
}

/// Copies the launch parameters to the device; returns their address and length in bytes.
#[allow(unsafe_code, reason = "shows the parameters as bytes")]
fn describe(device: &Device, buffer: &mut Buffer<u8>, params: &Params) -> Result<(Address, usize), BackendError> {
    // SAFETY: plain numbers without padding, as the unit test of this module checks.
    let bytes = unsafe { std::slice::from_raw_parts((&raw const *params).cast::<u8>(), size_of::<Params>()) };
    device.replace("the launch parameters", buffer, bytes)?;
    Ok((buffer.address(device), bytes.len()))
}

fn room(device: &Device, what: &str, bytes: usize) -> Result<Buffer<u8>, BackendError> {
    let made = device.stream().alloc_zeros(bytes.max(1));
    Ok(Buffer(Some(made.map_err(|error| device.fault(&format!("making room for {what}"), &error))?)))
}

impl OptixTracer {
    /// Builds the structure of a mesh, and compacts it if that saves memory.
    #[allow(unsafe_code, reason = "hands device memory to OptiX")]
    fn structure(&self, device: &Device, mesh: &Mesh<'_>) -> Result<Structure, BackendError> {
        let refused = |why| refused(device, "building OptiX's structure", why);
        let sizes: BuildSizes = self.api.build_sizes(mesh).map_err(refused)?;
        let output = room(device, "OptiX's structure", sizes.output)?;
        let temporary = room(device, "OptiX's build", sizes.temporary)?;
        let compacted = device.upload("a number", &[0_u64])?;
        let stream = device.stream().cu_stream().cast();
        let addresses = (output.address(device), temporary.address(device), compacted.address(device));
        // SAFETY: the buffers have the sizes that OptiX asked for, and live until the stream is synchronised below. The buffers of
        // the mesh live as long; the caller holds them.
        let handle = unsafe { self.api.build(stream, mesh, sizes, addresses) }.map_err(refused)?;
        let fault = |error| device.fault("building OptiX's structure", &error);
        let mut needed = [0_u64];
        if let Some(compacted) = &compacted.0 {
            device.stream().memcpy_dtoh(compacted, &mut needed).map_err(fault)?;
        }
        device.stream().synchronize().map_err(fault)?;
        let needed = needed[0] as usize;
        if needed == 0 || needed >= sizes.output {
            return Ok(Structure { memory: output, handle });
        }
        let smaller = room(device, "OptiX's structure", needed)?;
        // SAFETY: as above; `output` and `smaller` live until the stream is synchronised.
        let moved = unsafe { self.api.compact(stream, handle, smaller.address(device), needed) };
        let handle = moved.map_err(refused)?;
        device.stream().synchronize().map_err(fault)?;
        Ok(Structure { memory: smaller, handle })
    }
}

impl DeviceTracer for OptixTracer {
    const NAME: &'static str = "optix";
    /// An upper estimate of the device memory that OptiX takes while it builds. The sky's structure is built after the structure of all other
    /// triangles was compacted. Both builds stay within the estimate if the triangles from the sky's first to its last are at most half of the
    /// scene: calculated, not measured.
    const BYTES_PER_TRIANGLE: u64 = 250;

    /// Nothing: OptiX builds on the GPU.
    type Prepared = ();

    fn prepare(_: &RenderScene, _: &[bool]) {}

    fn new(device: &Device) -> Result<Self, BackendError> {
        let api = Api::new(device.context()).map_err(wrong)?;
        let rt_cores = api.rt_core_version().map_err(wrong)?;
        Ok(Self {
            api,
            rt_cores,
            programs: Vec::new(),
            ground: Structure::default(),
            sky: Structure::default(),
            materials: 0,
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
        self.materials = scene.materials.len();
        let flags = flags(self.materials, filtered);
        let [positions, triangles, materials] = buffers.mesh(device);
        let count = geometry.triangles.len() as u32;
        let vertices = geometry.positions.len() as u32;
        let whole = Mesh { positions, vertices, triangles, count, first: 0, materials, flags: &flags };
        if let Some(ids) = span(&geometry.sky) {
            let ground =
                device.upload("the triangles without the sky", masked(geometry, 0..count, false).as_flattened())?;
            self.ground = self.structure(device, &Mesh { triangles: ground.address(device), ..whole })?;
            drop(ground);
            let sky = device.upload("the triangles of the sky", masked(geometry, ids.clone(), true).as_flattened())?;
            let sky_mesh = Mesh {
                triangles: sky.address(device),
                count: ids.len() as u32,
                first: ids.start,
                materials: materials + u64::from(ids.start) * size_of::<u32>() as u64,
                ..whole
            };
            self.sky = self.structure(device, &sky_mesh)?;
        } else {
            self.ground = self.structure(device, &whole)?;
        }
        // OptiX does not report its number of nodes.
        Ok(BuildStats { bytes: self.ground.memory.bytes() + self.sky.memory.bytes(), nodes: 0 })
    }

    fn program(key: Key) -> Option<&'static str> {
        programs::on_optix(key)
    }

    fn clear(&mut self) {
        (self.ground, self.sky) = (Structure::default(), Structure::default());
        self.materials = 0;
    }

    fn held_bytes(&self) -> u64 {
        0
    }

    fn load(&mut self, device: &Device, job: &RayJob<'_>) -> Result<(), BackendError> {
        let (key, info) = (Key::of(job), job.program.info());
        if !self.programs.iter().any(|loaded| loaded.key == key) {
            let text = Self::program(key).ok_or_else(|| programs::not_written(Self::NAME, job.program))?;
            let compiled = self.api.pipeline(&entries::groups(info), text);
            let pipeline = compiled.map_err(|why| refused(device, &format!("loading `{}`", info.stem), why))?;
            self.programs.push(Loaded { key, pipeline, records: Table::default() });
        }
        let materials = self.materials;
        let Some(loaded) = self.programs.iter_mut().find(|loaded| loaded.key == key) else { return Ok(()) };
        let records = entries::records(&loaded.pipeline.headers, job, materials);
        loaded.records.set(device, "the records of the programs", records)
    }

    #[allow(unsafe_code, reason = "launches a pipeline")]
    fn launch(&mut self, device: &Device, job: &RayJob<'_>, params: &mut Params) -> Result<(), BackendError> {
        (params.handle, params.sky_handle) = (self.ground.handle, self.sky.handle);
        let parameters = describe(device, &mut self.params, params)?;
        let key = Key::of(job);
        let loaded = self.programs.iter().find(|loaded| loaded.key == key);
        let Loaded { pipeline, records, .. } = loaded.expect("loaded before");
        let stream = device.stream().cu_stream().cast();
        let records = (records.address(device), records.len());
        // SAFETY: the parameters are laid out as the programs' compiler checked; what they point to are buffers of this
        // backend that live until the stream was synchronised.
        let launched = unsafe { self.api.launch(stream, pipeline, parameters, records, [params.width, params.rows]) };
        launched.map_err(|why| refused(device, &format!("running `{}`", job.program.info().stem), why))
    }
}

/// The programs that trace segments between triangles, with their acceleration structure.
#[derive(Debug)]
pub struct SegmentPipeline {
    tracer: OptixTracer,
    pipeline: Pipeline,
    records: Table<u8>,
}

impl SegmentPipeline {
    /// A pipeline on a tracer whose structure was built. `see_through` says for each material whether its triangles block nothing.
    ///
    /// # Errors
    /// If the driver refuses the programs.
    pub fn new(device: &Device, tracer: OptixTracer, see_through: &[bool]) -> Result<Self, BackendError> {
        let compiled = tracer.api.pipeline(&entries::segment_groups(), programs::segments_on_optix());
        let pipeline = compiled.map_err(|why| refused(device, "loading the programs of segments", why))?;
        let mut made = Self { tracer, pipeline, records: Table::default() };
        let records = entries::segment_records(&made.pipeline.headers, see_through, made.tracer.materials);
        made.records.set(device, "the records of the programs", records)?;
        Ok(made)
    }

    /// Details of the tracer in addition to the device's name.
    #[must_use]
    pub fn description(&self) -> String {
        self.tracer.description()
    }

    /// Starts the programs on the segments that the parameters name.
    ///
    /// # Errors
    /// If the launch fails.
    #[allow(unsafe_code, reason = "launches a pipeline")]
    pub fn launch(&mut self, device: &Device, params: &mut Params) -> Result<(), BackendError> {
        let Self { tracer, pipeline, records } = self;
        params.handle = tracer.ground.handle;
        let parameters = describe(device, &mut tracer.params, params)?;
        let stream = device.stream().cu_stream().cast();
        let records = (records.address(device), records.len());
        let size = [params.segment_count as u32, 1];
        // SAFETY: the parameters are laid out as the programs' compiler checked; what they point to are buffers of the caller that live until the
        // results were read, with a pair of triangles for each segment and a bit for its result.
        let launched = unsafe { tracer.api.launch(stream, pipeline, parameters, records, size) };
        launched.map_err(|why| refused(device, "tracing segments", why))
    }
}

impl Drop for SegmentPipeline {
    fn drop(&mut self) {
        self.tracer.api.destroy(&self.pipeline);
    }
}

impl Drop for OptixTracer {
    fn drop(&mut self) {
        for loaded in &self.programs {
            self.api.destroy(&loaded.pipeline);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use curitiba_pipeline::scene::Batch;

    #[test]
    fn any_hit_programs_are_called_on_filtered_materials_alone() {
        let (called, never) = (GEOMETRY_FLAG_NONE, GEOMETRY_FLAG_DISABLE_ANYHIT);
        assert_eq!(flags(3, &[false, true]), [never, called, never]);
        assert_eq!(flags(0, &[]), [never]);
    }

    #[test]
    fn a_sky_and_all_else_are_each_without_area_in_the_structure_of_the_other() {
        let triangles: Vec<[u32; 3]> = (1..=6).map(|id| [id, id + 1, id + 2]).collect();
        let count = |material, first, count| Batch { material, first, count };
        let batches = vec![count(0, 0, 1), count(1, 1, 2), count(0, 3, 1), count(1, 4, 1), count(0, 5, 1)];
        let mut geometry = Geometry { triangles, batches, ..Geometry::default() };
        assert_eq!(span(&geometry.sky), None);
        geometry.sky = TriangleRanges::of_triangles(&geometry, &[false, true]);
        let whole = geometry.triangles.clone();
        let none = [0; 3];
        assert_eq!(masked(&geometry, 0..6, false), [whole[0], none, none, whole[3], none, whole[5]]);
        assert_eq!(span(&geometry.sky), Some(1..5));
        assert_eq!(masked(&geometry, 1..5, true), [whole[1], whole[2], none, whole[4]]);
    }

    #[test]
    fn launch_parameters_have_no_padding() {
        let (addresses, words) = (41 * 8, 12 * 4 + 2 * 4 + 6 * 12 + 4 * 4 + 2 * 4 + 4 * 4);
        assert_eq!(size_of::<Params>(), addresses + words);
    }
}
