//! The engine that traces the segments of pairs with many occluders.

use crate::engines::BackendChoice;
use crate::passes::raster::gpu::AdapterChoice;
use crate::passes::trace::SegmentTracer;
use crate::passes::visibility::Surfaces;
use crate::passes::wgpu_rays::WgpuSegments;
use crate::pipeline::backend::BackendError;

/// A tracer on the chosen device, with the triangles of a scene; `None` if the processor traces.
///
/// `auto` takes `cuda` if it is available, since its rows equal the processor's bit for bit; otherwise the processor.
///
/// # Errors
/// If the device is not available; the message gives a remedy.
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
