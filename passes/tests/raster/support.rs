//! The wgpu rasteriser where this machine has a device.

use curitiba_passes::raster::gpu::{AdapterChoice, WgpuRasteriser};

/// A rasteriser that shades as on a GPU, or `None` with a printed reason where this machine has no device.
///
/// # Panics
/// If there is none although the environment variable `CURITIBA_REQUIRE_GPU_TESTS` is `1`.
pub fn rasteriser() -> Option<WgpuRasteriser> {
    match WgpuRasteriser::new(AdapterChoice::Any) {
        Ok(mut rasteriser) => {
            rasteriser.set_shades_pixels(true);
            Some(rasteriser)
        }
        Err(error) => {
            assert!(std::env::var_os("CURITIBA_REQUIRE_GPU_TESTS").is_none_or(|value| value != "1"), "{error}");
            eprintln!("skipped: {error}");
            None
        }
    }
}
