//! The devices of this machine, and the choice of one.

use super::faults::unsupported;
use curitiba_pipeline::backend::BackendError;
use std::fmt;
use std::sync::OnceLock;

/// Greatest size of a buffer, whatever the device allows: Vulkan guarantees allocations of 1 GiB only.
pub(super) const MAX_BUFFER_BYTES: u64 = 1 << 30;
/// Number of storage buffers that a ray program binds, without its parameters.
pub(crate) const RAY_BUFFERS: u32 = 8;

/// Number of storage buffers of the program that computes the planes of triangles.
const PLANE_BUFFERS: u32 = 3;
/// Storage buffers of the program that draws exact spheres.
const SPHERE_BUFFERS: u32 = 1;

/// The adapters that may be chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AdapterChoice {
    /// Only hardware. A driver that computes on the processor is slower than this crate's own rasteriser on the
    /// processor.
    RealGpu,
    /// Hardware if there is any, else a software driver.
    Any,
    /// The adapter at this index of [`adapters`], from 0: see [`named`].
    Nth(u8),
}

/// The kind of an adapter, in order of preference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum AdapterKind {
    /// A GPU with its own memory.
    Discrete,
    /// A GPU that shares the processor's memory.
    Integrated,
    /// A GPU lent to a virtual machine.
    Virtual,
    /// The driver does not say.
    Unknown,
    /// No GPU: the driver computes on the processor.
    Software,
}

impl fmt::Display for AdapterKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Discrete => "discrete GPU",
            Self::Integrated => "integrated GPU",
            Self::Virtual => "virtual GPU",
            Self::Unknown => "unknown kind",
            Self::Software => "software",
        })
    }
}

/// An adapter of this machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AdapterSummary {
    /// The device, as its driver names it.
    pub name: String,
    /// The driver and its version; may be empty.
    pub driver: String,
    /// `vulkan`, `metal` or `dx12`.
    pub interface: &'static str,
    /// The kind of adapter.
    pub kind: AdapterKind,
}

impl AdapterSummary {
    fn of(adapter: &wgpu::Adapter) -> Self {
        let info = adapter.get_info();
        let driver = [info.driver.as_str(), info.driver_info.as_str()];
        Self {
            name: info.name,
            driver: driver.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" "),
            interface: match info.backend {
                wgpu::Backend::Vulkan => "vulkan",
                wgpu::Backend::Metal => "metal",
                wgpu::Backend::Dx12 => "dx12",
                _ => "other",
            },
            kind: match info.device_type {
                wgpu::DeviceType::DiscreteGpu => AdapterKind::Discrete,
                wgpu::DeviceType::IntegratedGpu => AdapterKind::Integrated,
                wgpu::DeviceType::VirtualGpu => AdapterKind::Virtual,
                wgpu::DeviceType::Cpu => AdapterKind::Software,
                wgpu::DeviceType::Other => AdapterKind::Unknown,
            },
        }
    }
}

impl fmt::Display for AdapterSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({}, {}", self.name, self.kind, self.interface)?;
        if !self.driver.is_empty() {
            write!(f, ", {}", self.driver)?;
        }
        f.write_str(")")
    }
}

/// All adapters, the preferred one first. Empty where there is no driver.
#[must_use]
pub fn adapters() -> Vec<AdapterSummary> {
    enumerate().into_iter().map(|(summary, _)| summary).collect()
}

/// For each adapter, a text that says what the rasteriser and the ray backend can do on it, and what it lacks for them.
#[must_use]
pub fn abilities() -> Vec<(AdapterSummary, String)> {
    enumerate()
        .into_iter()
        .map(|(summary, adapter)| (summary, describe(adapter.features(), &adapter.limits())))
        .collect()
}

/// The text that says what an adapter with these features and limits can do, and what it lacks.
fn describe(features: wgpu::Features, limits: &wgpu::Limits) -> String {
    let bound = limits.max_storage_buffer_binding_size.min(MAX_BUFFER_BYTES) >> 20;
    let side = limits.max_texture_dimension_2d;
    let mut words = format!("pictures of {side} x {side} pixels; rays: scenes of {bound} MiB a part");
    if limits.max_storage_buffers_per_shader_stage < RAY_BUFFERS {
        words.push_str("; lacks storage buffers: no rays");
    }
    let lacks = [
        (wgpu::Features::PRIMITIVE_INDEX, "primitive indices: no triangle ids, which rays in corrected fidelity read"),
        (wgpu::Features::TIMESTAMP_QUERY, "timestamps: no device times"),
    ];
    for (_, what) in lacks.iter().filter(|(feature, _)| !features.contains(*feature)) {
        words.push_str("; lacks ");
        words.push_str(what);
    }
    if !draws_spheres(limits) {
        words.push_str("; no exact spheres");
    }
    if !has_plane_depth(features, limits) {
        words.push_str("; depth as the device interpolates it: of layers close together the farther one may be seen");
    }
    words
}

/// Whether fragments can compute depth on the planes of their triangles.
pub(super) fn has_plane_depth(features: wgpu::Features, limits: &wgpu::Limits) -> bool {
    features.contains(wgpu::Features::PRIMITIVE_INDEX) && limits.max_storage_buffers_per_shader_stage >= PLANE_BUFFERS
}

/// Whether vertex and fragment shaders can read the records of exact spheres.
pub(super) fn draws_spheres(limits: &wgpu::Limits) -> bool {
    limits.max_storage_buffers_per_shader_stage >= SPHERE_BUFFERS
}

/// The adapter that a user names: by its index in [`adapters`], from 0, or by a part of its name, ignoring case.
///
/// # Errors
/// If no adapter has that name, or several different adapters do; the message lists the adapters.
pub fn named(name: &str) -> Result<u8, String> {
    place_of(&adapters(), name)
}

fn place_of(adapters: &[AdapterSummary], name: &str) -> Result<u8, String> {
    let listed: Vec<String> =
        adapters.iter().enumerate().map(|(place, one)| format!("{place}: {}", one.name)).collect();
    let valid = if listed.is_empty() {
        "there is none on this machine".to_owned()
    } else {
        format!("valid: {}", listed.join(", "))
    };
    if let Ok(place) = name.parse::<u8>() {
        return if usize::from(place) < adapters.len() {
            Ok(place)
        } else {
            Err(format!("there is no adapter {place}; {valid}"))
        };
    }
    let wanted = name.to_lowercase();
    let fits = |one: &&(usize, &AdapterSummary)| one.1.name.to_lowercase().contains(&wanted);
    let all: Vec<(usize, &AdapterSummary)> = adapters.iter().enumerate().collect();
    let found: Vec<_> = all.iter().filter(fits).collect();
    match found.as_slice() {
        // Of several adapters with the same name, the first.
        [(place, first), rest @ ..] if rest.iter().all(|(_, other)| other.name == first.name) => {
            u8::try_from(*place).map_err(|_| format!("there are too many adapters; {valid}"))
        }
        [] => Err(format!("no adapter is called `{name}`; {valid}")),
        _ => Err(format!("several adapters are called `{name}`; {valid}")),
    }
}

/// The adapter that `choice` takes.
pub(super) fn select(choice: AdapterChoice) -> Result<(AdapterSummary, wgpu::Adapter), BackendError> {
    if choice == AdapterChoice::RealGpu && !may_have_gpu() {
        return Err(unsupported("on a GPU of this machine", "the system has no graphics device:"));
    }
    let mut all = enumerate();
    let summaries: Vec<AdapterSummary> = all.iter().map(|(summary, _)| summary.clone()).collect();
    let index = choose(&summaries, choice)?;
    Ok(all.swap_remove(index))
}

/// Whether the system has any device for a GPU driver. Listing the adapters instead loads a software driver, which takes a
/// tenth of a second and 45 MiB. Mesa's software driver also prints a complaint to standard error where there is no desktop.
fn may_have_gpu() -> bool {
    if !cfg!(target_os = "linux") {
        return true;
    }
    let devices = ["/dev/nvidia0", "/dev/nvidiactl", "/dev/dxg", "/dev/kfd", "/dev/mali0", "/dev/kgsl-3d0"];
    let render_node = |entry: std::fs::DirEntry| entry.file_name().to_string_lossy().starts_with("renderD");
    let direct = std::fs::read_dir("/dev/dri").is_ok_and(|entries| entries.flatten().any(render_node));
    direct || devices.iter().any(|device| std::path::Path::new(device).exists())
}

/// The index of the adapter for `choice` in `adapters`, which are in order of preference.
fn choose(adapters: &[AdapterSummary], choice: AdapterChoice) -> Result<usize, BackendError> {
    if let AdapterChoice::Nth(place) = choice
        && !adapters.is_empty()
    {
        let missing =
            || unsupported(&format!("on adapter {place}"), &format!("there are {} adapters;", adapters.len()));
        return adapters.get(usize::from(place)).map(|_| usize::from(place)).ok_or_else(missing);
    }
    match adapters.first() {
        None => Err(unsupported(
            "on this machine",
            "no Vulkan, Metal or DirectX 12 driver offers a device: install the graphics driver, or",
        )),
        Some(best) if choice == AdapterChoice::RealGpu && best.kind == AdapterKind::Software => Err(unsupported(
            "on a GPU of this machine",
            &format!("the only device is {best}: `--raster wgpu` takes it all the same, and"),
        )),
        Some(_) => Ok(0),
    }
}

/// The only instance of this process. NVIDIA's driver stops offering devices to a process that has loaded and released
/// it about thirty times.
static INSTANCE: OnceLock<wgpu::Instance> = OnceLock::new();

/// All adapters, the preferred one first. `WGPU_BACKEND` restricts the interfaces, as in every program that uses wgpu.
/// OpenGL is excluded, because its drivers often cannot render to 32-bit floats.
fn enumerate() -> Vec<(AdapterSummary, wgpu::Adapter)> {
    let supported = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
    let backends = wgpu::Backends::from_env().unwrap_or(supported) & supported;
    let instance = INSTANCE.get_or_init(|| {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = backends;
        descriptor.flags = wgpu::InstanceFlags::from_env_or_default();
        wgpu::Instance::new(descriptor)
    });
    let adapters = pollster::block_on(instance.enumerate_adapters(backends));
    let mut all: Vec<_> = adapters.into_iter().map(|adapter| (AdapterSummary::of(&adapter), adapter)).collect();
    // The sort is stable: among equals, the driver's order remains.
    all.sort_by_key(|(summary, _)| summary.kind);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adapters_are_named_by_a_part_of_their_name_or_by_their_place() {
        let one = |name: &str| AdapterSummary { name: name.to_owned(), ..adapter(AdapterKind::Discrete) };
        let all = [one("NVIDIA H100"), one("NVIDIA H100"), one("AMD Radeon"), one("llvmpipe")];
        let place = |name| place_of(&all, name);
        assert_eq!((place("h100"), place("radeon"), place("3")), (Ok(0), Ok(2), Ok(3)));
        assert!(place("4").expect_err("too many").contains("valid: 0: NVIDIA H100"));
        assert!(place("Arc").expect_err("none").contains("no adapter is called `Arc`"));
        assert!(place("a").expect_err("several").contains("several adapters"));
        assert!(place_of(&[], "x").expect_err("none").contains("there is none"));
        assert_eq!(choose(&all, AdapterChoice::Nth(2)).expect("there"), 2);
        assert!(choose(&all, AdapterChoice::Nth(9)).is_err() && choose(&[], AdapterChoice::Nth(0)).is_err());
    }

    fn adapter(kind: AdapterKind) -> AdapterSummary {
        AdapterSummary { name: "X".to_owned(), driver: "1.0".to_owned(), interface: "vulkan", kind }
    }

    #[test]
    fn an_adapter_says_that_it_lacks_the_depth_of_planes() {
        let limits = wgpu::Limits::default();
        let few = wgpu::Limits { max_storage_buffers_per_shader_stage: PLANE_BUFFERS - 1, ..limits.clone() };
        let index = wgpu::Features::PRIMITIVE_INDEX;
        for (features, limits, has) in
            [(index, &limits, true), (index, &few, false), (wgpu::Features::empty(), &limits, false)]
        {
            assert_eq!(has_plane_depth(features, limits), has);
            assert_eq!(describe(features, limits).contains("depth as the device interpolates it"), !has);
        }
    }

    #[test]
    fn an_adapter_says_that_it_draws_no_spheres() {
        for count in [0, 1, 8] {
            let limits = wgpu::Limits { max_storage_buffers_per_shader_stage: count, ..wgpu::Limits::default() };
            assert_eq!(draws_spheres(&limits), count > 0);
            let words = describe(wgpu::Features::empty(), &limits);
            assert_eq!(words.contains("no exact spheres"), count == 0, "{words}");
        }
    }

    #[test]
    fn a_software_adapter_is_taken_only_where_any_will_do() {
        let software = [adapter(AdapterKind::Software)];
        assert_eq!(choose(&software, AdapterChoice::Any).expect("taken"), 0);
        let message = choose(&software, AdapterChoice::RealGpu).expect_err("refused").to_string();
        assert!(message.contains("X (software, vulkan, 1.0)") && message.contains("--raster cpu"), "{message}");
        for kind in [AdapterKind::Discrete, AdapterKind::Integrated, AdapterKind::Virtual, AdapterKind::Unknown] {
            let both = [adapter(kind), adapter(AdapterKind::Software)];
            assert_eq!(choose(&both, AdapterChoice::RealGpu).expect("hardware"), 0);
        }
    }

    #[test]
    fn without_adapters_the_message_says_what_to_do() {
        for choice in [AdapterChoice::Any, AdapterChoice::RealGpu] {
            let message = choose(&[], choice).expect_err("none").to_string();
            assert!(message.contains("driver") && message.contains("`--raster cpu`"), "{message}");
        }
    }
}
