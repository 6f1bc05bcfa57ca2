//! The ray backends of NVIDIA GPUs, for tests that are skipped without one.

use curitiba::Choice;
use curitiba::engines::ray_backend;
use curitiba::pipeline::backend::RayBackend;

/// The backend, or `None` if it is missing; the reason is printed.
///
/// # Panics
/// If there is none, and `CURITIBA_REQUIRE_CUDA_TESTS` is 1.
pub fn there(choice: Choice) -> Option<Box<dyn RayBackend>> {
    match ray_backend(choice) {
        Ok(rays) => Some(rays),
        Err(error) => {
            let required = std::env::var_os("CURITIBA_REQUIRE_CUDA_TESTS").is_some_and(|value| value == "1");
            assert!(!required, "{error}");
            println!("skipped: {error}");
            None
        }
    }
}
