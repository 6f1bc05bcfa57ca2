//! Calls into OptiX's function table, each wrapped for its only use here.
#![allow(unsafe_code, reason = "foreign functions found at run time")]

use super::abi::*;
use super::entries::{EXCEPTION_RECORD, GROUPS, Group, HIT_RECORDS, Headers, MISS_RECORDS};
use crate::layout::{PAYLOADS, RAY_TYPES};
use cudarc::driver::CudaContext;
use libloading::Library;
use std::ffi::{CStr, CString, c_char, c_uint, c_void};
use std::ptr::{null, null_mut};
use std::sync::Arc;

#[cfg(windows)]
const LIBRARY: &str = "nvoptix.dll";
#[cfg(not(windows))]
const LIBRARY: &str = "libnvoptix.so.1";

/// The functions of one interface version, and the OptiX context on a device.
///
/// Invariants: the library stays loaded as long as this lives, so each pointer of the table is a function of the type that the interface gives to
/// its index; `context` was created by these functions and is destroyed when this value is dropped.
pub struct Api {
    table: [*const c_void; FUNCTIONS],
    version: i32,
    context: Handle,
    cuda: Arc<CudaContext>,
    _library: Library,
}

impl std::fmt::Debug for Api {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Api").field("version", &self.version).finish_non_exhaustive()
    }
}

/// The compiled programs of one effect. Must be released with [`Api::destroy`].
#[derive(Debug)]
pub struct Pipeline {
    module: Handle,
    groups: Vec<Handle>,
    pipeline: Handle,
    /// Headers of the records of the shader binding table.
    pub headers: Headers,
}

// SAFETY: the pointers are handles and functions of OptiX, which may be used by any thread; each `Api` and `Pipeline` is used
// by one thread at a time, as neither is `Sync`.
unsafe impl Send for Api {}
// SAFETY: as above.
unsafe impl Send for Pipeline {}

/// A mesh on the device.
#[derive(Debug, Clone, Copy)]
pub struct Mesh<'a> {
    /// Vertex positions, three floats each.
    pub positions: DevicePointer,
    /// Number of vertices.
    pub vertices: u32,
    /// Vertices of the triangles, three indices each.
    pub triangles: DevicePointer,
    /// Number of triangles.
    pub count: u32,
    /// Id of the first triangle; those of the others follow.
    pub first: u32,
    /// For each triangle, its material as 32 bits.
    pub materials: DevicePointer,
    /// For each material (at least one): [`GEOMETRY_FLAG_NONE`] where any-hit programs are called, else [`GEOMETRY_FLAG_DISABLE_ANYHIT`].
    pub flags: &'a [c_uint],
}

/// Memory that a build needs, in bytes.
#[derive(Debug, Clone, Copy)]
pub struct BuildSizes {
    /// Memory of the structure.
    pub output: usize,
    /// Temporary memory during the build.
    pub temporary: usize,
}

impl Api {
    /// Loads OptiX and opens it on a device.
    ///
    /// # Errors
    /// A message that says what is missing, and what to do.
    pub fn new(cuda: &Arc<CudaContext>) -> Result<Self, String> {
        cuda.bind_to_thread().map_err(|error| format!("the GPU cannot be used: {error:?}"))?;
        // SAFETY: the driver's own library; its initialisers are NVIDIA's.
        let library = unsafe { Library::new(LIBRARY) }.map_err(|_| {
            format!(
                "the driver's OptiX, {LIBRARY}, was not found: install the complete driver (the package that has it is often \
                 apart from the compute part, as libnvidia-gl or libnvoptix), or use --backend cuda"
            )
        })?;
        // SAFETY: the symbol has this type in every release.
        let query = unsafe { library.get::<QueryFunctionTable>(b"optixQueryFunctionTable\0") };
        let query =
            *query.map_err(|_| format!("{LIBRARY} has no `optixQueryFunctionTable`: it is not OptiX 7 or newer"))?;
        let mut refused = Vec::new();
        for (version, functions) in VERSIONS {
            let mut table = [null(); FUNCTIONS];
            let bytes = functions * size_of::<*const c_void>();
            // SAFETY: writes `bytes` bytes, which the table has.
            let result = unsafe { query(version, 0, null_mut(), null(), table.as_mut_ptr(), bytes) };
            if result != 0 {
                refused.push(format!("{version} (code {result})"));
                continue;
            }
            let mut api = Self { table, version, context: null_mut(), cuda: Arc::clone(cuda), _library: library };
            let options = OptixDeviceContextOptions {
                log_callback: null(),
                log_callback_data: null_mut(),
                log_callback_level: 0,
                validation_mode: 0,
            };
            // SAFETY: by the invariants of `Api`; the CUDA context is alive as long as `api.cuda`.
            let result = unsafe {
                let create: DeviceContextCreate = api.function(place::DEVICE_CONTEXT_CREATE);
                create(cuda.cu_ctx().cast(), &raw const options, &raw mut api.context)
            };
            api.check("opening OptiX on the GPU", result, "")?;
            return Ok(api);
        }
        Err(format!(
            "the driver's OptiX offers none of the interfaces that this program knows; it refused {}: install driver 580 or newer",
            refused.join(", ")
        ))
    }

    /// Makes the context's device current for this thread, on which another device may be current. The first call may report an earlier failure
    /// instead, hence the second; objects that cannot be released are released with the device.
    fn bind_for_release(&self) {
        let _ = self.cuda.bind_to_thread().or_else(|_| self.cuda.bind_to_thread());
    }

    /// The interface version in use.
    pub fn version(&self) -> i32 {
        self.version
    }

    /// The function at an index of the table.
    ///
    /// # Safety
    /// `F` must be the type that the interface gives to the function at `place`.
    unsafe fn function<F: Copy>(&self, place: usize) -> F {
        const { assert!(size_of::<F>() == size_of::<*const c_void>()) };
        // SAFETY: by the contract of this function, the pointer is a function of type F; the query filled all places that are used.
        unsafe { std::mem::transmute_copy(&self.table[place]) }
    }

    fn check(&self, doing: &str, result: OptixResult, log: &str) -> Result<(), String> {
        if result == 0 {
            return Ok(());
        }
        // SAFETY: by the invariants of `Api`; the function returns a string that is never freed.
        let name = unsafe {
            let name: GetErrorName = self.function(place::GET_ERROR_NAME);
            CStr::from_ptr(name(result)).to_string_lossy().into_owned()
        };
        let separator = if log.is_empty() { "" } else { ": " };
        Err(format!("{doing}: {name} ({result}){separator}{log}"))
    }

    /// Version of the GPU's ray-tracing cores; 0 if it has none.
    pub fn rt_core_version(&self) -> Result<u32, String> {
        let mut version = 0_u32;
        // SAFETY: by the invariants of `Api`; the property is one unsigned integer.
        let result = unsafe {
            let get: DeviceContextGetProperty = self.function(place::DEVICE_CONTEXT_GET_PROPERTY);
            get(self.context, DEVICE_PROPERTY_RTCORE_VERSION, (&raw mut version).cast(), size_of::<u32>())
        };
        self.check("asking for ray-tracing cores", result, "").map(|()| version)
    }

    /// Compiles the programs of a module, and links those that are called into a pipeline.
    pub fn pipeline(&self, called: &[Option<Group>; GROUPS], ptx: &str) -> Result<Pipeline, String> {
        let mut pipeline = Pipeline {
            module: null_mut(),
            groups: Vec::new(),
            pipeline: null_mut(),
            headers: [[0; SBT_RECORD_HEADER]; GROUPS],
        };
        match self.compile(called, ptx, &mut pipeline) {
            Ok(()) => Ok(pipeline),
            Err(error) => {
                self.destroy(&pipeline);
                Err(error)
            }
        }
    }

    fn compile(&self, called: &[Option<Group>; GROUPS], ptx: &str, into: &mut Pipeline) -> Result<(), String> {
        self.cuda.bind_to_thread().map_err(|error| format!("the GPU cannot be used: {error:?}"))?;
        let compile = OptixModuleCompileOptions {
            max_register_count: 0,
            opt_level: 0,
            debug_level: COMPILE_DEBUG_LEVEL_NONE,
            bound_values: null(),
            num_bound_values: 0,
            num_payload_types: 0,
            payload_types: null(),
        };
        let options = OptixPipelineCompileOptions {
            uses_motion_blur: 0,
            traversable_graph_flags: TRAVERSABLE_GRAPH_FLAG_ALLOW_SINGLE_GAS,
            num_payload_values: PAYLOADS as i32,
            num_attribute_values: 2,
            exception_flags: EXCEPTION_FLAG_STACK_OVERFLOW | EXCEPTION_FLAG_TRACE_DEPTH,
            launch_params_variable_name: c"params".as_ptr(),
            uses_primitive_type_flags: PRIMITIVE_TYPE_FLAGS_TRIANGLE,
            allow_opacity_micromaps: 0,
        };
        let mut log = Log::new();
        let text = CString::new(ptx).map_err(|_| "the programs contain a zero byte".to_owned())?;
        // SAFETY: by the invariants of `Api`; all pointers are valid during the call, and the length counts the PTX source with its terminating
        // zero.
        let result = unsafe {
            let create: ModuleCreate = self.function(place::MODULE_CREATE);
            let length = text.as_bytes_with_nul().len();
            let (compile, options, module) = (&raw const compile, &raw const options, &raw mut into.module);
            create(self.context, compile, options, text.as_ptr(), length, log.start(), log.length(), module)
        };
        self.check("compiling the programs", result, log.text())?;

        let module_of = |entry: &Option<CString>| if entry.is_some() { into.module } else { null_mut() };
        let name_of = |entry: &Option<CString>| entry.as_ref().map_or(null(), |entry| entry.as_ptr());
        let descriptions: Vec<_> = called
            .iter()
            .flatten()
            .map(|group| OptixProgramGroupDesc {
                kind: group.kind,
                flags: 0,
                module: module_of(&group.entry),
                entry: name_of(&group.entry),
                module_any_hit: module_of(&group.any_hit),
                entry_any_hit: name_of(&group.any_hit),
                module_intersection: null_mut(),
                entry_intersection: null(),
            })
            .collect();
        into.groups = vec![null_mut(); descriptions.len()];
        let group_options = OptixProgramGroupOptions { payload_type: null() };
        let mut log = Log::new();
        // SAFETY: by the invariants of `Api`; as many handles are written as groups are described.
        let result = unsafe {
            let create: ProgramGroupCreate = self.function(place::PROGRAM_GROUP_CREATE);
            let (descriptions, count) = (descriptions.as_ptr(), descriptions.len() as u32);
            let options = &raw const group_options;
            create(self.context, descriptions, count, options, log.start(), log.length(), into.groups.as_mut_ptr())
        };
        self.check("grouping the programs", result, log.text())?;

        let link = OptixPipelineLinkOptions { max_trace_depth: 1 };
        let mut log = Log::new();
        // SAFETY: by the invariants of `Api`; the groups were created above.
        let result = unsafe {
            let create: PipelineCreate = self.function(place::PIPELINE_CREATE);
            let (options, link, groups) = (&raw const options, &raw const link, into.groups.as_ptr());
            let pipeline = &raw mut into.pipeline;
            let count = into.groups.len() as u32;
            create(self.context, options, link, groups, count, log.start(), log.length(), pipeline)
        };
        self.check("linking the programs", result, log.text())?;
        self.set_stack_size(into)?;
        let headers = into.headers.iter_mut().zip(called).filter(|(_, group)| group.is_some());
        for ((header, _), group) in headers.zip(&into.groups) {
            // SAFETY: by the invariants of `Api`; a header has 32 bytes.
            let result = unsafe {
                let pack: SbtRecordPackHeader = self.function(place::SBT_RECORD_PACK_HEADER);
                pack(*group, header.as_mut_ptr().cast())
            };
            self.check("describing the programs", result, "")?;
        }
        Ok(())
    }

    /// Sets the stack size: room for the ray-generation program and one ray at a time.
    fn set_stack_size(&self, pipeline: &Pipeline) -> Result<(), String> {
        let (mut generation, mut traced) = (0, 0);
        for group in &pipeline.groups {
            let mut sizes = OptixStackSizes {
                ray_generation: 0,
                miss: 0,
                closest_hit: 0,
                any_hit: 0,
                intersection: 0,
                continuation_callable: 0,
                direct_callable: 0,
            };
            // SAFETY: by the invariants of `Api`; the group was created, and the pipeline linked before.
            let result = unsafe {
                let get: ProgramGroupGetStackSize = self.function(place::PROGRAM_GROUP_GET_STACK_SIZE);
                get(*group, &raw mut sizes, pipeline.pipeline)
            };
            self.check("asking for the stack", result, "")?;
            generation = generation.max(sizes.ray_generation);
            traced = traced.max(sizes.miss).max(sizes.closest_hit).max(sizes.intersection + sizes.any_hit);
        }
        // SAFETY: by the invariants of `Api`; the pipeline was linked before.
        let result = unsafe {
            let set: PipelineSetStackSize = self.function(place::PIPELINE_SET_STACK_SIZE);
            set(pipeline.pipeline, 0, 0, generation + traced, 1)
        };
        self.check("making room for the stack", result, "")
    }

    /// Releases what [`Self::pipeline`] made.
    pub fn destroy(&self, pipeline: &Pipeline) {
        self.bind_for_release();
        // SAFETY: by the invariants of `Api`; objects that were not made are null and left out. Result codes are ignored, because a failed release
        // cannot be handled.
        unsafe {
            let end = |place: usize, handle: Handle| {
                let destroy: Destroy = self.function(place);
                if !handle.is_null() {
                    destroy(handle);
                }
            };
            end(place::PIPELINE_DESTROY, pipeline.pipeline);
            pipeline.groups.iter().for_each(|group| end(place::PROGRAM_GROUP_DESTROY, *group));
            end(place::MODULE_DESTROY, pipeline.module);
        }
    }

    /// Calls `use_input` with pointers to the description of a mesh and to the build options; both are valid during the call only.
    fn with_input<R>(
        mesh: &Mesh<'_>,
        use_input: impl FnOnce(*const OptixBuildInput, *const OptixAccelBuildOptions) -> R,
    ) -> R {
        let vertex_buffers = [mesh.positions];
        let input = OptixBuildInput {
            kind: BUILD_INPUT_TYPE_TRIANGLES,
            triangle_array: OptixBuildInputTriangleArray {
                vertex_buffers: vertex_buffers.as_ptr(),
                num_vertices: mesh.vertices,
                vertex_format: VERTEX_FORMAT_FLOAT3,
                vertex_stride: 12,
                index_buffer: mesh.triangles,
                num_index_triplets: mesh.count,
                index_format: INDICES_FORMAT_UNSIGNED_INT3,
                index_stride: 12,
                pre_transform: 0,
                flags: mesh.flags.as_ptr(),
                num_sbt_records: mesh.flags.len() as u32,
                sbt_index_offset_buffer: if mesh.flags.len() > 1 { mesh.materials } else { 0 },
                sbt_index_offset_size: 4,
                sbt_index_offset_stride: 4,
                primitive_index_offset: mesh.first,
                transform_format: 0,
                opacity_micromap: OptixBuildInputOpacityMicromap {
                    indexing_mode: 0,
                    array: 0,
                    index_buffer: 0,
                    index_size: 0,
                    index_stride: 0,
                    index_offset: 0,
                    usage_count: 0,
                    usage: null(),
                },
                displacement_micromap: OptixBuildInputDisplacementMicromap {
                    indexing_mode: 0,
                    buffers: [0; 5],
                    layout: [0; 9],
                    usage: null(),
                },
            },
            rest_of_union: [0; 98],
        };
        let options = OptixAccelBuildOptions {
            build_flags: BUILD_FLAG_ALLOW_COMPACTION | BUILD_FLAG_PREFER_FAST_TRACE,
            operation: BUILD_OPERATION_BUILD,
            motion_options: OptixMotionOptions { num_keys: 0, flags: 0, time_begin: 0.0, time_end: 0.0 },
        };
        use_input(&raw const input, &raw const options)
    }

    /// The memory that a build over a mesh takes.
    pub fn build_sizes(&self, mesh: &Mesh<'_>) -> Result<BuildSizes, String> {
        let mut sizes = OptixAccelBufferSizes { output: 0, temp: 0, temp_update: 0 };
        let result = Self::with_input(mesh, |input, options| {
            // SAFETY: by the invariants of `Api`; the call reads nothing on the device.
            unsafe {
                let compute: AccelComputeMemoryUsage = self.function(place::ACCEL_COMPUTE_MEMORY_USAGE);
                compute(self.context, options, input, 1, &raw mut sizes)
            }
        });
        self.check("asking for the structure's size", result, "")?;
        Ok(BuildSizes { output: sizes.output, temporary: sizes.temp })
    }

    /// Starts building over a mesh. The structure's compacted size in bytes is written to `compacted`, as 64 bits.
    ///
    /// # Safety
    /// All addresses must be of live device memory, of the sizes given by [`Self::build_sizes`] and the mesh, until the stream has completed the
    /// build. The memory of the structure must live as long as the structure is traced.
    pub unsafe fn build(
        &self,
        stream: *mut c_void,
        mesh: &Mesh<'_>,
        sizes: BuildSizes,
        (output, temporary, compacted): (DevicePointer, DevicePointer, DevicePointer),
    ) -> Result<Traversable, String> {
        let mut handle = 0;
        let emit = OptixAccelEmitDesc { result: compacted, kind: PROPERTY_TYPE_COMPACTED_SIZE };
        let result = Self::with_input(mesh, |input, options| {
            // SAFETY: by the invariants of `Api` and the contract of this function.
            unsafe {
                let build: AccelBuild = self.function(place::ACCEL_BUILD);
                let (structure, property) = (&raw mut handle, &raw const emit);
                let (room, scratch) = (sizes.output, sizes.temporary);
                build(self.context, stream, options, input, 1, temporary, scratch, output, room, structure, property, 1)
            }
        });
        self.check("building the structure", result, "").map(|()| handle)
    }

    /// Starts copying a structure to memory of its compacted size.
    ///
    /// # Safety
    /// As for [`Self::build`].
    pub unsafe fn compact(
        &self,
        stream: *mut c_void,
        structure: Traversable,
        output: DevicePointer,
        bytes: usize,
    ) -> Result<Traversable, String> {
        let mut handle = 0;
        // SAFETY: by the invariants of `Api` and the contract of this function.
        let result = unsafe {
            let compact: AccelCompact = self.function(place::ACCEL_COMPACT);
            compact(self.context, stream, structure, output, bytes, &raw mut handle)
        };
        self.check("compacting the structure", result, "").map(|()| handle)
    }

    /// Starts a pipeline with `width` x `height` threads.
    ///
    /// # Safety
    /// `params` and `records` must be live device memory: the launch parameters as the programs read them, with everything that they point
    /// to, and the [`records`](super::entries::records) of the pipeline and the pass, each of the given number of bytes.
    pub unsafe fn launch(
        &self,
        stream: *mut c_void,
        pipeline: &Pipeline,
        (params, bytes): (DevicePointer, usize),
        (records, table_bytes): (DevicePointer, usize),
        [width, height]: [u32; 2],
    ) -> Result<(), String> {
        let record = |index: usize| records + (index * SBT_RECORD_HEADER) as u64;
        let table = OptixShaderBindingTable {
            raygen_record: record(0),
            exception_record: record(EXCEPTION_RECORD),
            miss_record_base: record(MISS_RECORDS),
            miss_record_stride: SBT_RECORD_HEADER as u32,
            miss_record_count: RAY_TYPES,
            hitgroup_record_base: record(HIT_RECORDS),
            hitgroup_record_stride: SBT_RECORD_HEADER as u32,
            hitgroup_record_count: (table_bytes / SBT_RECORD_HEADER - HIT_RECORDS) as u32,
            callables_record_base: 0,
            callables_record_stride: 0,
            callables_record_count: 0,
        };
        // SAFETY: by the invariants of `Api` and the contract of this function.
        let result = unsafe {
            let launch: Launch = self.function(place::LAUNCH);
            launch(pipeline.pipeline, stream, params, bytes, &raw const table, width, height, 1)
        };
        self.check("launching", result, "")
    }
}

impl Drop for Api {
    fn drop(&mut self) {
        self.bind_for_release();
        // SAFETY: by the invariants of `Api`; the context is null if it was not made.
        unsafe {
            let destroy: Destroy = self.function(place::DEVICE_CONTEXT_DESTROY);
            if !self.context.is_null() {
                destroy(self.context);
            }
        }
    }
}

/// A buffer for OptiX's log messages.
struct Log {
    bytes: [u8; 2048],
    length: usize,
}

impl Log {
    fn new() -> Self {
        Self { bytes: [0; 2048], length: 2048 }
    }

    fn start(&mut self) -> *mut c_char {
        self.bytes.as_mut_ptr().cast()
    }

    fn length(&mut self) -> *mut usize {
        &raw mut self.length
    }

    fn text(&self) -> &str {
        let end = self.bytes.iter().position(|byte| *byte == 0).unwrap_or(self.bytes.len());
        std::str::from_utf8(&self.bytes[..end]).unwrap_or("").trim()
    }
}
