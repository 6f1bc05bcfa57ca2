//! Choice and construction of the rasteriser and the ray backend.

use crate::passes::cpu::CpuRays;
use crate::passes::raster::cpu::CpuRasteriser;
use crate::passes::raster::gpu::{AdapterChoice, AdapterKind, AdapterSummary, SharedDevice, WgpuRasteriser, adapters};
use crate::passes::wgpu_rays::WgpuRays;
use crate::pipeline::backend::{BackendError, Rasteriser, RayBackend};
use crate::pipeline::executor::{Engines, Spare};
use crate::pipeline::plan::Plan;
use std::sync::OnceLock;

/// The user's choice of rasteriser.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum RasterChoice {
    /// wgpu on a real GPU if there is one, otherwise the processor.
    #[default]
    Auto,
    /// The processor's rasteriser, on all cores.
    Cpu,
    /// wgpu on any adapter, software drivers included.
    Wgpu,
}

/// The user's choice of ray backend.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum BackendChoice {
    /// `cuda` in builds with the feature `cuda` on machines with an NVIDIA GPU; otherwise `wgpu` on a real GPU; otherwise the
    /// processor.
    #[default]
    Auto,
    /// The processor's tracer, on all cores.
    Cpu,
    /// Our own tracer in compute shaders, on any GPU that wgpu opens, software drivers included.
    Wgpu,
    /// Our own tracer, on an NVIDIA GPU; in builds with the feature `cuda`.
    Cuda,
    /// NVIDIA's OptiX; in builds with the feature `cuda`.
    Optix,
}

impl RasterChoice {
    /// All choices, with the names that users write.
    pub const NAMES: [(&str, Self); 3] = [("auto", Self::Auto), ("cpu", Self::Cpu), ("wgpu", Self::Wgpu)];

    /// The name that users write.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, choice)| *choice == self).map_or("", |(name, _)| name)
    }
}

impl BackendChoice {
    /// All choices, with the names that users write.
    pub const NAMES: [(&str, Self); 5] =
        [("auto", Self::Auto), ("cpu", Self::Cpu), ("wgpu", Self::Wgpu), ("cuda", Self::Cuda), ("optix", Self::Optix)];

    /// All choices that name a backend, that is all but `Auto`.
    pub const ALL: [Self; 4] = [Self::Cpu, Self::Wgpu, Self::Cuda, Self::Optix];

    /// The name that users write.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, choice)| *choice == self).map_or("", |(name, _)| name)
    }
}

/// Number of GPUs that share the rays of `cuda` and `optix`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gpus {
    /// This number, at least 1.
    Count(u8),
    /// All GPUs.
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

/// The user's choice of engines.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Choice {
    /// Rasteriser.
    pub raster: RasterChoice,
    /// Ray backend.
    pub backend: BackendChoice,
    /// Number of GPUs for `cuda` and `optix`.
    pub gpus: Gpus,
    /// The device of `wgpu`, for rasteriser and rays, as an index into [`adapters`]. If it is given, `auto` takes it even if it is a software
    /// device; for rays, only if CUDA is not available.
    pub adapter: Option<u8>,
    /// Fallbacks: ray backends that may take over, in this order, if the one before fails; none unless the user allowed them.
    pub fallback: [Option<BackendChoice>; 4],
}

impl Choice {
    /// Rasteriser and rays on the processor.
    pub const CPU: Self = Self {
        raster: RasterChoice::Cpu,
        backend: BackendChoice::Cpu,
        gpus: Gpus::Count(1),
        adapter: None,
        fallback: [None; 4],
    };

    /// The device of `wgpu`: the chosen one, or else `otherwise`.
    pub(crate) fn device(self, otherwise: AdapterChoice) -> AdapterChoice {
        self.adapter.map_or(otherwise, AdapterChoice::Nth)
    }

    /// Name of the chosen device of `wgpu`; `None` if none is chosen, it does not exist, or no engine of this choice can use it.
    #[must_use]
    pub fn adapter_name(self) -> Option<&'static str> {
        static ADAPTERS: OnceLock<Vec<AdapterSummary>> = OnceLock::new();
        let takes =
            self.raster != RasterChoice::Cpu || matches!(self.backend, BackendChoice::Auto | BackendChoice::Wgpu);
        let place = usize::from(self.adapter.filter(|_| takes)?);
        ADAPTERS.get_or_init(adapters).get(place).map(|adapter| adapter.name.as_str())
    }

    /// The choice with another ray backend.
    #[must_use]
    pub fn traced_by(self, backend: BackendChoice) -> Self {
        Self { backend, ..self }
    }

    /// Name of the ray backend for keys and messages: `cuda`, `cuda on 2 GPUs`.
    #[must_use]
    pub fn rays_in_words(self) -> String {
        let name = self.backend.name();
        match self.gpus {
            _ if matches!(self.backend, BackendChoice::Cpu | BackendChoice::Wgpu) => name.to_owned(),
            Gpus::Count(1) => name.to_owned(),
            Gpus::Count(count) => format!("{name} on {count} GPUs"),
            Gpus::All => format!("{name} on all GPUs"),
        }
    }

    /// The choice for a plan. The processor becomes a fallback if `auto` chooses the ray backend, the user named no fallbacks, and a pass asks for
    /// a filter, or for features of glass beyond the report's panes. A message is printed when the processor takes over.
    ///
    /// If `auto` chooses the rasteriser, and a pass draws with shaders of the project, the rasteriser is wgpu on any adapter.
    #[must_use]
    pub fn for_plan(self, plan: &Plan) -> Self {
        let own = self.raster == RasterChoice::Auto && plan.passes.iter().any(|planned| plan.draws_own(planned));
        let this = if own { Self { raster: RasterChoice::Wgpu, ..self } } else { self };
        this.rays_for_plan(plan)
    }

    fn rays_for_plan(self, plan: &Plan) -> Self {
        let more = |planned| plan.asks_of_glass(planned).or_else(|| plan.asks_of_filter(planned)).is_some();
        match (self.backend, self.fallback) {
            (BackendChoice::Auto, [None, None, None, None]) if plan.passes.iter().any(more) => {
                Self { fallback: [Some(BackendChoice::Cpu), None, None, None], ..self }
            }
            _ => self,
        }
    }

    /// Constructors of the ray backend and of its fallbacks.
    pub fn ray_backends(self) -> impl Iterator<Item = Spare> {
        self.ray_backends_on(None)
    }

    /// [`Self::ray_backends`], given the rasteriser's device, on which `wgpu` can trace too.
    fn ray_backends_on(self, device: Option<SharedDevice>) -> impl Iterator<Item = Spare> {
        let all = std::iter::once(self.backend).chain(self.fallback.into_iter().flatten());
        all.map(move |backend| {
            let device = device.clone();
            Spare::new(backend.name(), move || ray_backend_on(self.traced_by(backend), device.as_ref()))
        })
    }
}

/// Makes the engines. [`Engines::raster`] tells what `auto` chose.
///
/// # Errors
/// If the rasteriser that the user named, or its device, is not available; or the ray backend, and no fallback is.
pub fn choose(choice: Choice) -> Result<Engines, BackendError> {
    let (raster, rays, own) = parts(choice)?;
    Ok(Engines::first_of(raster, rays)?.with_own(own))
}

/// The rasteriser, and constructors of the ray backend, of its fallbacks, and of the backends of single passes; all on one device
/// if possible.
///
/// # Errors
/// If a rasteriser named by the user is not available.
pub(crate) fn parts(
    choice: Choice,
) -> Result<(Box<dyn Rasteriser>, impl Iterator<Item = Spare>, MakeOwn), BackendError> {
    let (raster, device) = rasteriser_and_device(choice)?;
    Ok((raster, choice.ray_backends_on(device.clone()), Box::new(own_rays(choice, device))))
}

/// The engines of a choice for a plan, with the ray backends of single passes, without fallbacks.
///
/// # Errors
/// If an engine is not available; the message gives a remedy.
pub fn exactly(choice: Choice, plan: &Plan) -> Result<Engines, BackendError> {
    let (raster, device) = rasteriser_and_device(choice)?;
    let rays = ray_backend_on(choice, device.as_ref())?;
    let mut engines = Engines::new(raster, rays).with_own(own_rays(choice, device));
    engines.serve(plan).map_err(|(_, error)| error)?;
    Ok(engines)
}

/// Constructor of a ray backend by name.
pub(crate) type MakeOwn = Box<dyn FnMut(&str) -> Result<Box<dyn RayBackend>, BackendError>>;

/// A constructor of ray backends by name, for single passes.
fn own_rays(
    choice: Choice,
    device: Option<SharedDevice>,
) -> impl FnMut(&str) -> Result<Box<dyn RayBackend>, BackendError> + 'static {
    move |name| {
        let known = BackendChoice::NAMES.into_iter().find(|(known, _)| *known == name);
        let backend = known.map_or(BackendChoice::Auto, |(_, backend)| backend);
        ray_backend_on(choice.traced_by(backend), device.as_ref())
    }
}

/// Makes a rasteriser.
///
/// # Errors
/// If a rasteriser named by the user is not available.
pub fn rasteriser(choice: Choice) -> Result<Box<dyn Rasteriser>, BackendError> {
    Ok(rasteriser_and_device(choice)?.0)
}

/// Makes a rasteriser; also returns its device, if it has one.
fn rasteriser_and_device(choice: Choice) -> Result<(Box<dyn Rasteriser>, Option<SharedDevice>), BackendError> {
    let on_gpu = |gpu: WgpuRasteriser| {
        let device = gpu.shared_device();
        (Box::new(gpu) as Box<dyn Rasteriser>, Some(device))
    };
    Ok(match choice.raster {
        RasterChoice::Cpu => (Box::new(CpuRasteriser::new()), None),
        RasterChoice::Wgpu => on_gpu(WgpuRasteriser::new(choice.device(AdapterChoice::Any))?),
        RasterChoice::Auto => match WgpuRasteriser::new(choice.device(AdapterChoice::RealGpu)) {
            Ok(gpu) => on_gpu(gpu),
            Err(error) if choice.adapter.is_some() => return Err(error),
            Err(_) => (Box::new(CpuRasteriser::new()), None),
        },
    })
}

/// Makes a ray backend.
///
/// # Errors
/// If it is not available; the message gives a remedy.
pub fn ray_backend(choice: Choice) -> Result<Box<dyn RayBackend>, BackendError> {
    ray_backend_on(choice, None)
}

/// [`ray_backend`], given the rasteriser's device, on which `wgpu` can trace too.
fn ray_backend_on(choice: Choice, device: Option<&SharedDevice>) -> Result<Box<dyn RayBackend>, BackendError> {
    match choice.backend {
        BackendChoice::Auto => match cuda(choice) {
            // A user who asks for several GPUs wants neither wgpu nor the processor.
            Err(error) if choice.gpus != Gpus::default() => Err(error),
            Err(_) => Ok(match wgpu(choice.device(AdapterChoice::RealGpu), device) {
                Err(error) if choice.adapter.is_some() => return Err(error),
                Ok(rays) => rays,
                Err(_) => Box::new(CpuRays::new()),
            }),
            made => made,
        },
        BackendChoice::Wgpu => wgpu(choice.device(AdapterChoice::Any), device),
        BackendChoice::Cpu => Ok(Box::new(CpuRays::new())),
        BackendChoice::Cuda => cuda(choice),
        BackendChoice::Optix => optix(choice),
    }
}

/// Makes the ray backend `wgpu`, on the rasteriser's device if the choice allows it, otherwise on a device of its own.
fn wgpu(choice: AdapterChoice, device: Option<&SharedDevice>) -> Result<Box<dyn RayBackend>, BackendError> {
    let fits =
        |device: &&SharedDevice| choice != AdapterChoice::RealGpu || device.adapter().kind != AdapterKind::Software;
    Ok(Box::new(match device.filter(fits) {
        Some(device) => WgpuRays::on(device)?,
        None => WgpuRays::new(choice)?,
    }))
}

/// Why `auto` does not take `wgpu` in the absence of `cuda`; `None` if it does.
#[must_use]
pub fn why_not_wgpu(choice: Choice) -> Option<BackendError> {
    wgpu(choice.device(AdapterChoice::RealGpu), None).err()
}

/// Why `auto` does not take `cuda`; `None` if it does.
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
pub(crate) fn not_built(backend: &'static str) -> BackendError {
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
