//! What the machine has, and what the process may touch.

use crate::invalid;
use curitiba::engines::ray_backend;
use curitiba::passes::raster::gpu::abilities;
use curitiba::pipeline::files;
use curitiba::{BackendChoice, Choice};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::path::PathBuf;

/// The devices that wgpu finds by Vulkan, Metal or DX12, the preferred one first, a dict each: `open(adapter=…)` takes their places, or parts
/// of their names. Empty where there is no driver.
///
/// "name" and "driver" as the driver says; "kind" is "discrete GPU", "integrated GPU", "virtual GPU", "unknown kind" or "software", which is no
/// GPU; "interface" is "vulkan", "metal" or "dx12"; "abilities" says how large pictures (pixels) and scenes (MiB a part) may be, and what is
/// lacking.
#[pyfunction]
pub fn gpus(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    let list = PyList::empty(py);
    for (adapter, abilities) in py.detach(abilities) {
        let gpu = PyDict::new(py);
        gpu.set_item("name", adapter.name)?;
        gpu.set_item("kind", adapter.kind.to_string())?;
        gpu.set_item("interface", adapter.interface)?;
        gpu.set_item("driver", adapter.driver)?;
        gpu.set_item("abilities", abilities)?;
        list.append(gpu)?;
    }
    Ok(list)
}

/// The ray backends by name, a dict each: "device" is what it runs on, or None where it is not there, and "missing" then says why.
///
/// Names are those that `open(backend=…)` and `open(fallback=…)` take: "cpu", "wgpu", "cuda", "optix".
#[pyfunction]
pub fn backends(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let look = || {
        BackendChoice::ALL.map(|backend| {
            let made = ray_backend(Choice::CPU.traced_by(backend));
            (backend.name(), made.map(|rays| rays.device()).map_err(|error| error.reason()))
        })
    };
    let all = PyDict::new(py);
    for (name, found) in py.detach(look) {
        let (device, missing) = match found {
            Ok(device) => (Some(device), None),
            Err(why) => (None, Some(why)),
        };
        let facts = PyDict::new(py);
        facts.set_item("device", device)?;
        facts.set_item("missing", missing)?;
        all.set_item(name, facts)?;
    }
    Ok(all)
}

/// From now on this package reads and writes no file outside the folder, wherever symbolic links lead: for projects of strangers.
///
/// It holds for the whole process and cannot be undone; Python's own files are not concerned. Call it before `open`.
#[pyfunction]
pub fn confine(folder: PathBuf) -> PyResult<()> {
    files::confine(&folder).map_err(|error| invalid(format!("confine: {}: {error}", folder.display())))
}
