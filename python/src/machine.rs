//! The devices and backends of the machine, and the files that the process may touch.

use crate::invalid;
use curitiba::engines::ray_backend;
use curitiba::passes::raster::gpu::abilities;
use curitiba::pipeline::files;
use curitiba::{BackendChoice, Choice};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::path::PathBuf;

/// The devices that wgpu finds by Vulkan, Metal or DX12, the preferred one first, each as a dict. `open(adapter=…)` takes a position in this list
/// or a part of a name. Empty where there is no driver.
///
/// "name" and "driver" come from the driver. "kind" is "discrete GPU", "integrated GPU", "virtual GPU", "unknown kind" or "software", which is no
/// GPU. "interface" is "vulkan", "metal" or "dx12". "abilities" says how large pictures (pixels) and scenes (MiB for each part) may be, and what
/// the device lacks.
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

/// The ray backends by name, each as a dict: "device" is its device, or None if it is not available; "missing" then says why.
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

/// From now on this package reads and writes no file outside the folder, wherever symbolic links lead. Use it for projects from strangers.
///
/// This holds for the whole process and cannot be undone; Python's own files are not affected. Call it before `open`.
#[pyfunction]
pub fn confine(folder: PathBuf) -> PyResult<()> {
    files::confine(&folder).map_err(|error| invalid(format!("confine: {}: {error}", folder.display())))
}
