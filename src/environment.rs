//! What machine a timing was taken on.

use crate::engines::{ray_backend, why_not_cuda, why_not_wgpu};
use crate::passes::raster::gpu::{AdapterChoice, AdapterKind, WgpuRasteriser, adapters};
use crate::pipeline::backend::RayBackend;
use crate::pipeline::executor::Engines;
use crate::{BackendChoice, Choice, RasterChoice};
use serde::{Deserialize, Serialize};

/// The machine and the build.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Environment {
    /// Version of this program.
    pub version: String,
    /// Commit that it was built from, with `-dirty` where files differed from it; `unknown` where there was no git.
    #[serde(default)]
    pub commit: String,
    /// `release` or `debug`.
    pub profile: String,
    /// Level of optimisation, compiler flags and instruction sets of the build.
    #[serde(default)]
    pub flags: String,
    /// Operating system and architecture.
    pub platform: String,
    /// Processor, as the system names it.
    pub cpu: String,
    /// Threads that the cpu engines use.
    pub threads: usize,
    /// Graphics devices, as their drivers name them; empty where there is none, or none was looked for.
    #[serde(default)]
    pub gpu: Vec<String>,
    /// Drivers of the devices, in the same order.
    #[serde(default)]
    pub driver: Vec<String>,
    /// Mean number of processes that wanted to run in the last minute; `None` where the system does not tell. On an idle
    /// machine it is near 0.
    #[serde(default)]
    pub load_average: Option<f64>,
    /// Where something other than the first choice did the work, and why.
    #[serde(default)]
    pub fallbacks: Vec<String>,
    /// A name for the machine, where the user gave one: two of equal parts are told apart by it. Names of hosts are not looked up.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub host: Option<String>,
}

impl Environment {
    /// Looks around, but for graphics devices: asking their drivers takes a while.
    #[must_use]
    pub fn here() -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: env!("CURITIBA_COMMIT").to_owned(),
            profile: if cfg!(debug_assertions) { "debug" } else { "release" }.to_owned(),
            flags: format!("opt-level {}, {}", crate::passes::OPT_LEVEL, env!("CURITIBA_FLAGS")),
            platform: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            cpu: cpu_name().unwrap_or_else(|| "unknown processor".to_owned()),
            threads: rayon::current_num_threads(),
            gpu: Vec::new(),
            driver: Vec::new(),
            load_average: load_average(),
            fallbacks: Vec::new(),
            host: None,
        }
    }

    /// [`Self::here`], with the graphics devices and what `auto` falls back to for this choice of engines.
    #[must_use]
    pub fn probe(choice: Choice) -> Self {
        let adapters = adapters();
        let real = adapters.iter().any(|adapter| adapter.kind != AdapterKind::Software);
        let mut fallbacks = Vec::new();
        if choice.raster == RasterChoice::Auto {
            if !real && choice.adapter.is_none() {
                fallbacks.push("raster `auto` takes the cpu: there is no real GPU".to_owned());
            } else if let Err(error) = WgpuRasteriser::new(choice.device(AdapterChoice::RealGpu)) {
                fallbacks.push(format!("raster `auto` takes the cpu: {error}"));
            }
        }
        let mut environment = Self {
            gpu: adapters.iter().map(|adapter| format!("{} ({})", adapter.name, adapter.kind)).collect(),
            driver: adapters.iter().map(|adapter| format!("{} {}", adapter.interface, adapter.driver)).collect(),
            fallbacks,
            ..Self::here()
        };
        match choice.backend {
            BackendChoice::Cpu => {}
            BackendChoice::Auto => match why_not_cuda() {
                Some(no_cuda) => match why_not_wgpu(choice) {
                    // In builds without `cuda` there is none to fall back from.
                    Some(_) if cfg!(not(feature = "cuda")) => {}
                    Some(_) => environment.fallbacks.push(format!("backend `auto` takes the cpu: {no_cuda}")),
                    None => environment.add_backend(choice.traced_by(BackendChoice::Wgpu)),
                },
                None => environment.add_backend(choice.traced_by(BackendChoice::Cuda)),
            },
            BackendChoice::Wgpu | BackendChoice::Cuda | BackendChoice::Optix => environment.add_backend(choice),
        }
        environment
    }

    /// Adds the graphics devices that trace, if they are there.
    fn add_backend(&mut self, choice: Choice) {
        if let Ok(rays) = ray_backend(choice) {
            self.add_gpus(rays.as_ref());
        }
    }

    /// Adds the graphics devices of a ray backend that are not named yet, with their drivers.
    pub fn add_gpus(&mut self, rays: &dyn RayBackend) {
        let known = self.gpu.clone();
        for (index, gpu) in rays.gpus().into_iter().enumerate() {
            // Equal ones have equal names, and each is named.
            let equal = rays.gpus()[..=index].iter().filter(|other| **other == gpu).count();
            if known.iter().filter(|name| **name == gpu.name).count() < equal {
                self.gpu.push(gpu.name);
                self.driver.push(gpu.driver);
            }
        }
    }

    /// With the graphics devices that the engines' rays use, and what these fell back to.
    #[must_use]
    pub fn with_engines(mut self, engines: &Engines) -> Self {
        self.add_gpus(engines.rays.as_ref());
        self.fallbacks.extend(engines.fallbacks.iter().map(ToString::to_string));
        self
    }

    /// Why timings taken in `other` cannot stand beside timings taken here; nothing if they can.
    #[must_use]
    pub fn differs_from(&self, other: &Self) -> Option<String> {
        let (what, a, b) = self.build_differs_from(other).or_else(|| self.machine_differs_from(other))?;
        Some(format!("{what}: `{a}` here, `{b}` there"))
    }

    /// In which of its fields the program differs from that of `other`, and what they are here and there.
    #[must_use]
    pub fn build_differs_from(&self, other: &Self) -> Option<(&'static str, String, String)> {
        first_difference([
            ("version", &self.version, &other.version),
            ("commit", &self.commit, &other.commit),
            ("profile", &self.profile, &other.profile),
            ("flags", &self.flags, &other.flags),
        ])
    }

    fn machine_differs_from(&self, other: &Self) -> Option<(&'static str, String, String)> {
        let threads = || {
            let differ = self.threads != other.threads;
            differ.then(|| ("number of threads", self.threads.to_string(), other.threads.to_string()))
        };
        let [here, there] = [self, other].map(|environment| environment.host.as_deref().unwrap_or_default());
        first_difference([("platform", &self.platform, &other.platform), ("cpu", &self.cpu, &other.cpu)])
            .or_else(threads)
            .or_else(|| first_difference([("host", here, there)]))
    }

    /// Whether both are one machine, as far as they say: the same processor, threads, graphics devices, drivers and name.
    #[must_use]
    pub fn same_machine(&self, other: &Self) -> bool {
        self.machine_differs_from(other).is_none() && (&self.gpu, &self.driver) == (&other.gpu, &other.driver)
    }

    /// The machine in words: name, processor, threads, graphics devices.
    #[must_use]
    pub fn machine(&self) -> String {
        let host = self.host.as_ref().map(|host| format!("{host}: ")).unwrap_or_default();
        let gpus: String = self.gpu.iter().map(|gpu| format!(", {gpu}")).collect();
        format!("{host}{}, {} threads{gpus}", self.cpu, self.threads)
    }
}

fn first_difference<const N: usize>(pairs: [(&'static str, &str, &str); N]) -> Option<(&'static str, String, String)> {
    let (what, a, b) = pairs.into_iter().find(|(_, a, b)| a != b)?;
    Some((what, a.to_owned(), b.to_owned()))
}

fn cpu_name() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

fn load_average() -> Option<f64> {
    std::fs::read_to_string("/proc/loadavg").ok()?.split_whitespace().next()?.parse().ok()
}

/// The most memory that this process has held so far, bytes; `None` where the system does not tell.
#[must_use]
pub fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().trim_end_matches("kB").trim().parse().ok()?;
    Some(kibibytes * 1024)
}
