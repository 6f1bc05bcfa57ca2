//! Which rasteriser and which ray backend do the work.

use crate::passes::cpu::CpuRays;
use crate::passes::raster::cpu::CpuRasteriser;
use crate::passes::raster::gpu::{AdapterChoice, WgpuRasteriser};
use crate::pipeline::backend::{BackendError, Rasteriser, RayBackend};
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
    /// In builds with the feature `cuda` and on machines with an NVIDIA GPU `cuda`, else the cpu.
    #[default]
    Auto,
    /// Our own tracer, on all cores.
    Cpu,
    /// Our own tracer, on an NVIDIA GPU; in builds with the feature `cuda`.
    Cuda,
    /// NVIDIA's OptiX; in builds with the feature `cuda`.
    Optix,
}

impl RasterChoice {
    /// All, by the names that users write.
    pub const NAMES: [(&str, Self); 3] = [("auto", Self::Auto), ("cpu", Self::Cpu), ("wgpu", Self::Wgpu)];

    /// As users write it.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, choice)| *choice == self).map_or("", |(name, _)| name)
    }
}

impl BackendChoice {
    /// All, by the names that users write.
    pub const NAMES: [(&str, Self); 4] =
        [("auto", Self::Auto), ("cpu", Self::Cpu), ("cuda", Self::Cuda), ("optix", Self::Optix)];

    /// As users write it.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, choice)| *choice == self).map_or("", |(name, _)| name)
    }
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
    Ok(Engines { raster, rays: ray_backend(choice.backend)? })
}

/// Makes a ray backend.
///
/// # Errors
/// If it cannot be had: says what is missing, and what to do.
pub fn ray_backend(choice: BackendChoice) -> Result<Box<dyn RayBackend>, BackendError> {
    match choice {
        #[cfg(feature = "cuda")]
        BackendChoice::Auto => match curitiba_cuda::CudaRays::new() {
            Ok(gpu) => Ok(Box::new(gpu)),
            Err(_) => Ok(Box::new(CpuRays::new())),
        },
        #[cfg(not(feature = "cuda"))]
        BackendChoice::Auto => Ok(Box::new(CpuRays::new())),
        BackendChoice::Cpu => Ok(Box::new(CpuRays::new())),
        #[cfg(feature = "cuda")]
        BackendChoice::Cuda => Ok(Box::new(curitiba_cuda::CudaRays::new()?)),
        #[cfg(feature = "cuda")]
        BackendChoice::Optix => Ok(Box::new(curitiba_cuda::OptixRays::new()?)),
        #[cfg(not(feature = "cuda"))]
        BackendChoice::Cuda | BackendChoice::Optix => Err(BackendError::Device {
            backend: choice.name(),
            message:
                "this program was built without it; build it with `cargo build --release --features cuda` (no CUDA \
                      toolkit is needed), or use --backend cpu"
                    .to_owned(),
        }),
    }
}
