//! Which rasteriser and which ray backend do the work.

use crate::passes::cpu::CpuRays;
use crate::passes::raster::cpu::CpuRasteriser;
use crate::passes::raster::gpu::{AdapterChoice, WgpuRasteriser};
use crate::pipeline::backend::{BackendError, Rasteriser};
use crate::pipeline::executor::Engines;

/// Which rasteriser.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RasterChoice {
    /// wgpu on a real GPU if there is one, else the cpu.
    #[default]
    Auto,
    /// Our own, on all cores.
    Cpu,
    /// wgpu on any adapter, software drivers included.
    Wgpu,
}

/// Which ray backend.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BackendChoice {
    /// The best there is in this build: the cpu.
    #[default]
    Auto,
    /// Our own tracer, on all cores.
    Cpu,
}

/// What the user asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Choice {
    /// Rasteriser.
    pub raster: RasterChoice,
    /// Ray backend.
    pub backend: BackendChoice,
}

/// Makes the engines. What `auto` chose can be read from [`Engines::raster`].
///
/// # Errors
/// If one that was asked for by name cannot be had.
pub fn choose(choice: Choice) -> Result<Engines, BackendError> {
    let raster: Box<dyn Rasteriser> = match choice.raster {
        RasterChoice::Cpu => Box::new(CpuRasteriser::new()),
        RasterChoice::Wgpu => Box::new(WgpuRasteriser::new(AdapterChoice::Any)?),
        RasterChoice::Auto => match WgpuRasteriser::new(AdapterChoice::RealGpu) {
            Ok(gpu) => Box::new(gpu),
            Err(_) => Box::new(CpuRasteriser::new()),
        },
    };
    let rays = match choice.backend {
        BackendChoice::Auto | BackendChoice::Cpu => Box::new(CpuRays::new()),
    };
    Ok(Engines { raster, rays })
}
