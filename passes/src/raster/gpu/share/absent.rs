//! Stand-ins for builds that cannot share memory.

use crate::raster::gpu::device::Gpu;
use crate::raster::gpu::faults::unsupported;
use crate::raster::gpu::quads::Source;
use crate::raster::gpu::targets::Targets;
use crate::raster::gpu::timer::Timer;
use curitiba_pipeline::backend::{Attachments, BackendError, HandOver, RasterJob};
use curitiba_pipeline::device_quad::{DeviceQuad, DeviceSource};
use curitiba_pipeline::shared::{DeviceUuid, SharedGBuffer};

/// Never constructed.
#[derive(Debug)]
pub enum Sharing {}

impl Sharing {
    pub fn new(
        _: &Gpu,
        _: DeviceUuid,
        _: [u32; 2],
        _: Attachments,
        _: bool,
    ) -> Result<(Self, SharedGBuffer), BackendError> {
        Err(unsupported("sharing memory", "this build has no means to;"))
    }
}

pub fn quad_source(
    sharing: &Sharing,
    _: Option<&Targets>,
    _: &DeviceQuad,
    _: DeviceSource,
) -> Result<Source, BackendError> {
    match *sharing {}
}

pub fn wait_for_picture(sharing: &Sharing, _: &Gpu, _: &DeviceQuad) -> Result<(), BackendError> {
    match *sharing {}
}

pub fn open(_: &wgpu::Adapter, _: &wgpu::DeviceDescriptor<'_>) -> Option<Result<(wgpu::Device, wgpu::Queue), String>> {
    None
}

pub fn uuid(_: &wgpu::Device) -> Option<DeviceUuid> {
    None
}

pub fn hand_over(
    _: &Gpu,
    _: Option<&mut Sharing>,
    _: Option<&Timer>,
    _: &Targets,
    job: &RasterJob<'_>,
    _: &mut wgpu::CommandEncoder,
) -> Result<Option<HandOver>, BackendError> {
    if job.shared == Attachments::default() {
        return Ok(None);
    }
    Err(unsupported("sharing memory", "this build has no means to;"))
}
