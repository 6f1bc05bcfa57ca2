//! What traces the segments of pairs with much in between.

use crate::engines::BackendChoice;
use crate::passes::raster::gpu::AdapterChoice;
use crate::passes::trace::SegmentTracer;
use crate::passes::visibility::Surfaces;
use crate::passes::wgpu_rays::WgpuSegments;
use crate::pipeline::backend::BackendError;

/// The device of a choice, made for the triangles of a scene; none where the processor traces.
///
/// `auto` takes `cuda` where that can be had, since its rows have the bits of the processor's, and else the processor.
///
/// # Errors
/// If it cannot be had: says what is missing, and what to do.
pub fn segment_tracer(
    choice: BackendChoice,
    surfaces: &Surfaces,
) -> Result<Option<Box<dyn SegmentTracer>>, BackendError> {
    let (geometry, see_through) = (surfaces.geometry(), surfaces.see_through_materials());
    Ok(match choice {
        BackendChoice::Cpu => None,
        BackendChoice::Auto => cuda(surfaces).ok(),
        BackendChoice::Cuda => Some(cuda(surfaces)?),
        BackendChoice::Optix => Some(optix(surfaces)?),
        BackendChoice::Wgpu => Some(Box::new(WgpuSegments::new(AdapterChoice::Any, geometry, see_through)?)),
    })
}

#[cfg(feature = "cuda")]
fn cuda(surfaces: &Surfaces) -> Result<Box<dyn SegmentTracer>, BackendError> {
    let (geometry, see_through) = (surfaces.geometry(), surfaces.see_through_materials());
    Ok(Box::new(curitiba_cuda::CudaSegments::new(geometry, see_through)?))
}

#[cfg(feature = "cuda")]
fn optix(surfaces: &Surfaces) -> Result<Box<dyn SegmentTracer>, BackendError> {
    let (geometry, see_through) = (surfaces.geometry(), surfaces.see_through_materials());
    Ok(Box::new(curitiba_cuda::OptixSegments::new(geometry, see_through)?))
}

#[cfg(not(feature = "cuda"))]
fn cuda(_: &Surfaces) -> Result<Box<dyn SegmentTracer>, BackendError> {
    Err(crate::engines::not_built("cuda"))
}

#[cfg(not(feature = "cuda"))]
fn optix(_: &Surfaces) -> Result<Box<dyn SegmentTracer>, BackendError> {
    Err(crate::engines::not_built("optix"))
}
