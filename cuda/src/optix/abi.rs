//! The structs and constants of the OptiX interface that are used here, for the interface versions 87 (OptiX 8.0) and
//! 93 (8.1), in which they are the same.
//!
//! Names follow OptiX's own, so that its programming guide explains them.

use std::ffi::{c_char, c_int, c_uint, c_void};

/// Interface versions that are requested, newest first, with the number of functions in their tables.
pub const VERSIONS: [(c_int, usize); 2] = [(93, 50), (87, 48)];
/// Number of functions in the largest table.
pub const FUNCTIONS: usize = 50;

/// Indices of the functions in the table.
pub mod place {
    pub const GET_ERROR_NAME: usize = 0;
    pub const DEVICE_CONTEXT_CREATE: usize = 2;
    pub const DEVICE_CONTEXT_DESTROY: usize = 3;
    pub const DEVICE_CONTEXT_GET_PROPERTY: usize = 4;
    pub const MODULE_CREATE: usize = 12;
    pub const MODULE_DESTROY: usize = 15;
    pub const PROGRAM_GROUP_CREATE: usize = 18;
    pub const PROGRAM_GROUP_DESTROY: usize = 19;
    pub const PROGRAM_GROUP_GET_STACK_SIZE: usize = 20;
    pub const PIPELINE_CREATE: usize = 21;
    pub const PIPELINE_DESTROY: usize = 22;
    pub const PIPELINE_SET_STACK_SIZE: usize = 23;
    pub const ACCEL_COMPUTE_MEMORY_USAGE: usize = 24;
    pub const ACCEL_BUILD: usize = 25;
    pub const ACCEL_COMPACT: usize = 29;
    pub const SBT_RECORD_PACK_HEADER: usize = 38;
    pub const LAUNCH: usize = 39;
}

/// Result code of every function; 0 is success.
pub type OptixResult = c_int;
/// Pointer to an opaque object of OptiX.
pub type Handle = *mut c_void;
/// An address in device memory.
pub type DevicePointer = u64;
/// Handle of an acceleration structure; 0 is empty.
pub type Traversable = u64;

pub const BUILD_INPUT_TYPE_TRIANGLES: c_int = 0x2141;
pub const VERTEX_FORMAT_FLOAT3: c_int = 0x2121;
pub const INDICES_FORMAT_UNSIGNED_INT3: c_int = 0x2103;
pub const GEOMETRY_FLAG_NONE: c_uint = 0;
pub const GEOMETRY_FLAG_DISABLE_ANYHIT: c_uint = 1;
pub const BUILD_FLAG_ALLOW_COMPACTION: c_uint = 1 << 1;
pub const BUILD_FLAG_PREFER_FAST_TRACE: c_uint = 1 << 2;
pub const BUILD_OPERATION_BUILD: c_int = 0x2161;
pub const PROPERTY_TYPE_COMPACTED_SIZE: c_int = 0x2181;
pub const COMPILE_DEBUG_LEVEL_NONE: c_int = 0x2350;
pub const PROGRAM_GROUP_KIND_RAYGEN: c_int = 0x2421;
pub const PROGRAM_GROUP_KIND_MISS: c_int = 0x2422;
pub const PROGRAM_GROUP_KIND_EXCEPTION: c_int = 0x2423;
pub const PROGRAM_GROUP_KIND_HITGROUP: c_int = 0x2424;
pub const EXCEPTION_FLAG_STACK_OVERFLOW: c_uint = 1;
pub const EXCEPTION_FLAG_TRACE_DEPTH: c_uint = 1 << 1;
pub const TRAVERSABLE_GRAPH_FLAG_ALLOW_SINGLE_GAS: c_uint = 1;
pub const PRIMITIVE_TYPE_FLAGS_TRIANGLE: c_uint = 1 << 31;
pub const DEVICE_PROPERTY_RTCORE_VERSION: c_int = 0x2005;
/// Size in bytes of a record's header in the shader binding table; records have no other data here.
pub const SBT_RECORD_HEADER: usize = 32;

macro_rules! structs {
    ($( $(#[$about:meta])* $name:ident ($size:literal) { $( $field:ident: $type:ty, )* } )*) => {
        $(
            $(#[$about])*
            #[derive(Debug, Clone, Copy)]
            #[repr(C)]
            pub struct $name { $( pub $field: $type, )* }
        )*

        #[cfg(test)]
        #[test]
        fn structs_have_the_sizes_of_the_interface() {
            $( assert_eq!(size_of::<$name>(), $size, stringify!($name)); )*
        }
    };
}

structs! {
    OptixBuildInputOpacityMicromap(48) {
        indexing_mode: c_int,
        array: DevicePointer,
        index_buffer: DevicePointer,
        index_size: c_uint,
        index_stride: c_uint,
        index_offset: c_uint,
        usage_count: c_uint,
        usage: *const c_void,
    }
    OptixBuildInputDisplacementMicromap(96) {
        indexing_mode: c_int,
        buffers: [DevicePointer; 5],
        layout: [c_uint; 9],
        usage: *const c_void,
    }
    OptixBuildInputTriangleArray(240) {
        vertex_buffers: *const DevicePointer,
        num_vertices: c_uint,
        vertex_format: c_int,
        vertex_stride: c_uint,
        index_buffer: DevicePointer,
        num_index_triplets: c_uint,
        index_format: c_int,
        index_stride: c_uint,
        pre_transform: DevicePointer,
        flags: *const c_uint,
        num_sbt_records: c_uint,
        sbt_index_offset_buffer: DevicePointer,
        sbt_index_offset_size: c_uint,
        sbt_index_offset_stride: c_uint,
        primitive_index_offset: c_uint,
        transform_format: c_int,
        opacity_micromap: OptixBuildInputOpacityMicromap,
        displacement_micromap: OptixBuildInputDisplacementMicromap,
    }
    /// OptiX's union, of which only triangles are used.
    OptixBuildInput(1032) {
        kind: c_int,
        triangle_array: OptixBuildInputTriangleArray,
        rest_of_union: [u64; 98],
    }
    OptixMotionOptions(12) {
        num_keys: u16,
        flags: u16,
        time_begin: f32,
        time_end: f32,
    }
    OptixAccelBuildOptions(20) {
        build_flags: c_uint,
        operation: c_int,
        motion_options: OptixMotionOptions,
    }
    OptixAccelBufferSizes(24) {
        output: usize,
        temp: usize,
        temp_update: usize,
    }
    OptixAccelEmitDesc(16) {
        result: DevicePointer,
        kind: c_int,
    }
    OptixDeviceContextOptions(24) {
        log_callback: *const c_void,
        log_callback_data: *mut c_void,
        log_callback_level: c_int,
        validation_mode: c_int,
    }
    OptixModuleCompileOptions(40) {
        max_register_count: c_int,
        opt_level: c_int,
        debug_level: c_int,
        bound_values: *const c_void,
        num_bound_values: c_uint,
        num_payload_types: c_uint,
        payload_types: *const c_void,
    }
    OptixPipelineCompileOptions(40) {
        uses_motion_blur: c_int,
        traversable_graph_flags: c_uint,
        num_payload_values: c_int,
        num_attribute_values: c_int,
        exception_flags: c_uint,
        launch_params_variable_name: *const c_char,
        uses_primitive_type_flags: c_uint,
        allow_opacity_micromaps: c_int,
    }
    OptixPipelineLinkOptions(4) {
        max_trace_depth: c_uint,
    }
    /// OptiX's union after `flags`: a ray-generation, miss or exception program uses only `module` and `entry`.
    OptixProgramGroupDesc(56) {
        kind: c_int,
        flags: c_uint,
        module: Handle,
        entry: *const c_char,
        module_any_hit: Handle,
        entry_any_hit: *const c_char,
        module_intersection: Handle,
        entry_intersection: *const c_char,
    }
    OptixProgramGroupOptions(8) {
        payload_type: *const c_void,
    }
    OptixStackSizes(28) {
        ray_generation: c_uint,
        miss: c_uint,
        closest_hit: c_uint,
        any_hit: c_uint,
        intersection: c_uint,
        continuation_callable: c_uint,
        direct_callable: c_uint,
    }
    OptixShaderBindingTable(64) {
        raygen_record: DevicePointer,
        exception_record: DevicePointer,
        miss_record_base: DevicePointer,
        miss_record_stride: c_uint,
        miss_record_count: c_uint,
        hitgroup_record_base: DevicePointer,
        hitgroup_record_stride: c_uint,
        hitgroup_record_count: c_uint,
        callables_record_base: DevicePointer,
        callables_record_stride: c_uint,
        callables_record_count: c_uint,
    }
}

pub type QueryFunctionTable =
    unsafe extern "C" fn(c_int, c_uint, *mut c_void, *const *const c_void, *mut *const c_void, usize) -> OptixResult;
pub type GetErrorName = unsafe extern "C" fn(OptixResult) -> *const c_char;
pub type DeviceContextCreate =
    unsafe extern "C" fn(*mut c_void, *const OptixDeviceContextOptions, *mut Handle) -> OptixResult;
pub type Destroy = unsafe extern "C" fn(Handle) -> OptixResult;
pub type DeviceContextGetProperty = unsafe extern "C" fn(Handle, c_int, *mut c_void, usize) -> OptixResult;
pub type ModuleCreate = unsafe extern "C" fn(
    Handle,
    *const OptixModuleCompileOptions,
    *const OptixPipelineCompileOptions,
    *const c_char,
    usize,
    *mut c_char,
    *mut usize,
    *mut Handle,
) -> OptixResult;
pub type ProgramGroupCreate = unsafe extern "C" fn(
    Handle,
    *const OptixProgramGroupDesc,
    c_uint,
    *const OptixProgramGroupOptions,
    *mut c_char,
    *mut usize,
    *mut Handle,
) -> OptixResult;
pub type ProgramGroupGetStackSize = unsafe extern "C" fn(Handle, *mut OptixStackSizes, Handle) -> OptixResult;
pub type PipelineCreate = unsafe extern "C" fn(
    Handle,
    *const OptixPipelineCompileOptions,
    *const OptixPipelineLinkOptions,
    *const Handle,
    c_uint,
    *mut c_char,
    *mut usize,
    *mut Handle,
) -> OptixResult;
pub type PipelineSetStackSize = unsafe extern "C" fn(Handle, c_uint, c_uint, c_uint, c_uint) -> OptixResult;
pub type AccelComputeMemoryUsage = unsafe extern "C" fn(
    Handle,
    *const OptixAccelBuildOptions,
    *const OptixBuildInput,
    c_uint,
    *mut OptixAccelBufferSizes,
) -> OptixResult;
pub type AccelBuild = unsafe extern "C" fn(
    Handle,
    *mut c_void,
    *const OptixAccelBuildOptions,
    *const OptixBuildInput,
    c_uint,
    DevicePointer,
    usize,
    DevicePointer,
    usize,
    *mut Traversable,
    *const OptixAccelEmitDesc,
    c_uint,
) -> OptixResult;
pub type AccelCompact =
    unsafe extern "C" fn(Handle, *mut c_void, Traversable, DevicePointer, usize, *mut Traversable) -> OptixResult;
pub type SbtRecordPackHeader = unsafe extern "C" fn(Handle, *mut c_void) -> OptixResult;
pub type Launch = unsafe extern "C" fn(
    Handle,
    *mut c_void,
    DevicePointer,
    usize,
    *const OptixShaderBindingTable,
    c_uint,
    c_uint,
    c_uint,
) -> OptixResult;
