//! The machine and the build that timings were taken with.

use crate::engines::{ray_backend, why_not_cuda, why_not_wgpu};
use crate::passes::raster::gpu::{AdapterChoice, AdapterKind, WgpuRasteriser, adapters};
use crate::pipeline::backend::RayBackend;
use crate::pipeline::executor::Engines;
use crate::{BackendChoice, Choice, RasterChoice};
use serde::{Deserialize, Serialize};

/// A machine and a build of the program.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Environment {
    /// Version of this program.
    pub version: String,
    /// Commit of the build, with `-dirty` if files differed from it; `unknown` without git.
    #[serde(default)]
    pub commit: String,
    /// `release` or `debug`.
    pub profile: String,
    /// Optimisation level, compiler flags and instruction sets of the build.
    #[serde(default)]
    pub flags: String,
    /// Operating system and architecture.
    pub platform: String,
    /// Name of the processor as the system gives it.
    pub cpu: String,
    /// Number of threads of the cpu engines.
    pub threads: usize,
    /// Names of graphics devices, as their drivers give them; empty if there are none, or they were not queried.
    #[serde(default)]
    pub gpu: Vec<String>,
    /// Drivers of these devices, in the same order.
    #[serde(default)]
    pub driver: Vec<String>,
    /// Load average: mean number of runnable processes in the last minute, near 0 on an idle machine. `None` if the system does not
    /// report it.
    #[serde(default)]
    pub load_average: Option<f64>,
    /// Fallbacks: where another engine than the first choice was used, and why.
    #[serde(default)]
    pub fallbacks: Vec<String>,
    /// Name of the machine, if the user gave one; it distinguishes machines with equal parts. Host names are not looked up.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub host: Option<String>,
}

impl Environment {
    /// The environment without graphics devices: querying their drivers takes a while.
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

    /// [`Self::here`], with the graphics devices, and with what `auto` falls back to for this choice of engines.
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
                    // In builds without `cuda` its absence is no fallback.
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

    /// The load average if it is above a quarter of the threads: other programs then disturb the timings. `None` if it is not.
    #[must_use]
    pub fn busy(&self) -> Option<f64> {
        self.load_average.filter(|load| *load > self.threads as f64 * 0.25)
    }

    /// Adds the graphics devices of a ray backend, if it is available.
    fn add_backend(&mut self, choice: Choice) {
        if let Ok(rays) = ray_backend(choice) {
            self.add_gpus(rays.as_ref());
        }
    }

    /// Adds the graphics devices of a ray backend that are not listed yet, with their drivers.
    pub fn add_gpus(&mut self, rays: &dyn RayBackend) {
        let known = self.gpu.clone();
        for (index, gpu) in rays.gpus().into_iter().enumerate() {
            // Several equal devices have equal names, and each is listed.
            let equal = rays.gpus()[..=index].iter().filter(|other| **other == gpu).count();
            if known.iter().filter(|name| **name == gpu.name).count() < equal {
                self.gpu.push(gpu.name);
                self.driver.push(gpu.driver);
            }
        }
    }

    /// Adds the graphics devices and the fallbacks of engines.
    #[must_use]
    pub fn with_engines(mut self, engines: &Engines) -> Self {
        self.add_gpus(engines.rays.as_ref());
        self.fallbacks.extend(engines.fallbacks.iter().map(ToString::to_string));
        self
    }

    /// Why timings taken in `other` are not comparable with timings taken here; `None` if they are.
    #[must_use]
    pub fn differs_from(&self, other: &Self) -> Option<String> {
        let (what, a, b) = self.build_differs_from(other).or_else(|| self.machine_differs_from(other))?;
        Some(format!("{what}: `{a}` here, `{b}` there"))
    }

    /// The first field in which the build of `other` differs: its name, the value here, and that in `other`; `None` for equal builds.
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

    /// Whether both are the same machine, by platform, processor, threads, graphics devices, drivers and name.
    #[must_use]
    pub fn same_machine(&self, other: &Self) -> bool {
        self.machine_differs_from(other).is_none() && (&self.gpu, &self.driver) == (&other.gpu, &other.driver)
    }

    /// Description of the machine: name, processor, threads, graphics devices.
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

/// Peak memory of this process so far, in bytes; `None` if the system does not report it.
#[must_use]
pub fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().trim_end_matches("kB").trim().parse().ok()?;
    Some(kibibytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_is_busy_above_a_quarter_of_its_threads() {
        let busy = |load_average, threads| Environment { load_average, threads, ..Environment::here() }.busy();
        assert_eq!(busy(Some(0.5), 2), None);
        assert_eq!(busy(Some(0.51), 2), Some(0.51));
        assert_eq!(busy(Some(0.51), 16), None);
        assert_eq!(busy(None, 2), None, "the system does not tell");
    }
}
