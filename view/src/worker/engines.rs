//! The available engines.

use curitiba::passes::raster::gpu::adapters;
use curitiba::{BackendChoice, Choice, RasterChoice, engines};

/// Engines, each with the reason why it is not available, or `None` if it is.
#[derive(Debug, Clone, Default)]
pub struct Available {
    /// Rasterisers.
    pub raster: Vec<(RasterChoice, Option<String>)>,
    /// Ray backends.
    pub rays: Vec<(BackendChoice, Option<String>)>,
}

impl Available {
    /// Looks for devices. This takes a while if there are any.
    #[must_use]
    pub fn look() -> Self {
        let no_adapter = adapters().is_empty().then(|| "no device was found by wgpu".to_owned());
        let raster = RasterChoice::NAMES
            .map(|(_, choice)| (choice, if choice == RasterChoice::Wgpu { no_adapter.clone() } else { None }));
        let rays = BackendChoice::NAMES.map(|(_, backend)| {
            let missing = match backend {
                BackendChoice::Auto | BackendChoice::Cpu => None,
                BackendChoice::Wgpu => no_adapter.clone(),
                _ => engines::ray_backend(Choice::CPU.traced_by(backend)).err().map(|error| error.to_string()),
            };
            (backend, missing)
        });
        Self { raster: raster.to_vec(), rays: rays.to_vec() }
    }
}
