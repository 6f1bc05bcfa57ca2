//! Which rasteriser and which ray backend do the work.

use crate::passes::cpu::CpuRays;
use crate::passes::raster::cpu::CpuRasteriser;
use crate::passes::raster::gpu::{AdapterChoice, WgpuRasteriser};
use crate::pipeline::backend::{BackendError, Rasteriser, RayBackend};
use crate::pipeline::executor::{Engines, Spare};
use crate::pipeline::plan::Plan;

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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
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

    /// Those that are no choice between others.
    pub const ALL: [Self; 3] = [Self::Cpu, Self::Cuda, Self::Optix];

    /// As users write it.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, choice)| *choice == self).map_or("", |(name, _)| name)
    }
}

/// How many GPUs share the rays of `cuda` and `optix`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gpus {
    /// This many, at least 1.
    Count(u8),
    /// Every one.
    All,
}

impl Default for Gpus {
    fn default() -> Self {
        Self::Count(1)
    }
}

impl std::fmt::Display for Gpus {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Count(count) => write!(f, "{count}"),
            Self::All => write!(f, "all"),
        }
    }
}

impl std::str::FromStr for Gpus {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse() {
            _ if text == "all" => Ok(Self::All),
            Ok(count) if count > 0 => Ok(Self::Count(count)),
            _ => Err(format!("`{text}` is no number of GPUs; valid: 1 to 255, or all")),
        }
    }
}

/// What the user asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Choice {
    /// Rasteriser.
    pub raster: RasterChoice,
    /// Ray backend.
    pub backend: BackendChoice,
    /// GPUs of `cuda` and `optix`.
    pub gpus: Gpus,
    /// Ray backends that may take over where the one before them fails, in this order; none unless the user allowed it.
    pub fallback: [Option<BackendChoice>; 3],
}

impl Choice {
    /// Both on the processor.
    pub const CPU: Self =
        Self { raster: RasterChoice::Cpu, backend: BackendChoice::Cpu, gpus: Gpus::Count(1), fallback: [None; 3] };

    /// The same rasteriser with another ray backend.
    #[must_use]
    pub fn traced_by(self, backend: BackendChoice) -> Self {
        Self { backend, ..self }
    }

    /// The ray backend, as keys of rows and messages have it: `cuda`, `cuda on 2 GPUs`.
    #[must_use]
    pub fn rays_in_words(self) -> String {
        let name = self.backend.name();
        match self.gpus {
            _ if self.backend == BackendChoice::Cpu => name.to_owned(),
            Gpus::Count(1) => name.to_owned(),
            Gpus::Count(count) => format!("{name} on {count} GPUs"),
            Gpus::All => format!("{name} on all GPUs"),
        }
    }

    /// The same choice for a plan: where `auto` chooses the ray backend and a pass asks for more of glass than the report's panes, the
    /// cpu may take over, which is told when it does.
    #[must_use]
    pub fn for_plan(self, plan: &Plan) -> Self {
        let asks = || plan.passes.iter().any(|planned| plan.asks_of_glass(planned).is_some());
        match (self.backend, self.fallback) {
            (BackendChoice::Auto, [None, None, None]) if asks() => {
                Self { fallback: [Some(BackendChoice::Cpu), None, None], ..self }
            }
            _ => self,
        }
    }

    /// What makes the ray backend, and those that may take over.
    pub fn ray_backends(self) -> impl Iterator<Item = Spare> {
        let all = std::iter::once(self.backend).chain(self.fallback.into_iter().flatten());
        all.map(move |backend| Spare::new(backend.name(), move || ray_backend(self.traced_by(backend))))
    }
}

/// Makes the engines. What `auto` chose can be read from [`Engines::raster`].
///
/// # Errors
/// If one that was asked for by name cannot be had, and nothing may take over.
pub fn choose(choice: Choice) -> Result<Engines, BackendError> {
    Engines::first_of(rasteriser(choice.raster)?, choice.ray_backends())
}

/// Makes a rasteriser.
///
/// # Errors
/// If it was asked for by name and cannot be had.
pub fn rasteriser(choice: RasterChoice) -> Result<Box<dyn Rasteriser>, BackendError> {
    Ok(match choice {
        RasterChoice::Cpu => Box::new(CpuRasteriser::new()),
        RasterChoice::Wgpu => Box::new(WgpuRasteriser::new(AdapterChoice::Any)?),
        RasterChoice::Auto => match WgpuRasteriser::new(AdapterChoice::RealGpu) {
            Ok(gpu) => Box::new(gpu),
            Err(_) => Box::new(CpuRasteriser::new()),
        },
    })
}

/// Makes a ray backend.
///
/// # Errors
/// If it cannot be had: says what is missing, and what to do.
pub fn ray_backend(choice: Choice) -> Result<Box<dyn RayBackend>, BackendError> {
    match choice.backend {
        BackendChoice::Auto => match cuda(choice) {
            // Who asks for several GPUs does not mean the processor.
            Err(error) if choice.gpus != Gpus::default() => Err(error),
            made => Ok(made.unwrap_or_else(|_| Box::new(CpuRays::new()))),
        },
        BackendChoice::Cpu => Ok(Box::new(CpuRays::new())),
        BackendChoice::Cuda => cuda(choice),
        BackendChoice::Optix => optix(choice),
    }
}

/// What `auto` takes, and why it is not `cuda`; nothing where it is.
#[must_use]
pub fn why_not_cuda() -> Option<BackendError> {
    cuda(Choice::default()).err()
}

#[cfg(feature = "cuda")]
fn ordinals(choice: Choice, backend: &'static str) -> Result<Vec<usize>, BackendError> {
    let wanted = match choice.gpus {
        Gpus::Count(count) => Some(count.into()),
        Gpus::All => None,
    };
    curitiba_cuda::device::ordinals(backend, wanted)
}

#[cfg(feature = "cuda")]
fn cuda(choice: Choice) -> Result<Box<dyn RayBackend>, BackendError> {
    Ok(Box::new(curitiba_cuda::CudaRays::on(&ordinals(choice, "cuda")?)?))
}

#[cfg(feature = "cuda")]
fn optix(choice: Choice) -> Result<Box<dyn RayBackend>, BackendError> {
    Ok(Box::new(curitiba_cuda::OptixRays::on(&ordinals(choice, "optix")?)?))
}

#[cfg(not(feature = "cuda"))]
fn cuda(_: Choice) -> Result<Box<dyn RayBackend>, BackendError> {
    Err(not_built("cuda"))
}

#[cfg(not(feature = "cuda"))]
fn optix(_: Choice) -> Result<Box<dyn RayBackend>, BackendError> {
    Err(not_built("optix"))
}

#[cfg(not(feature = "cuda"))]
fn not_built(backend: &'static str) -> BackendError {
    let message = "this program was built without it; build it with `cargo build --release --features cuda` (no CUDA \
                   toolkit is needed), or use --backend cpu";
    BackendError::Device { backend, message: message.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_gpus_are_read_as_they_are_written() {
        for text in ["1", "8", "all"] {
            assert_eq!(text.parse::<Gpus>().expect(text).to_string(), text);
        }
        for text in ["0", "-1", "256", "", "some"] {
            assert!(text.parse::<Gpus>().is_err(), "{text}");
        }
        let two = Choice { gpus: Gpus::Count(2), backend: BackendChoice::Optix, ..Choice::CPU };
        assert_eq!((two.rays_in_words().as_str(), Choice::CPU.rays_in_words().as_str()), ("optix on 2 GPUs", "cpu"));
        assert_eq!(two.traced_by(BackendChoice::Cpu).rays_in_words(), "cpu");
    }
}
