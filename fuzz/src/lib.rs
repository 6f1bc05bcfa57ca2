//! The shared part of the fuzz targets: the start of a process, and the bodies, which the ordinary tests run too
//! (`pipeline/tests/fuzz_brief.rs`, `passes/tests/fuzz_render`).

#[path = "../../passes/tests/fuzz_render/body.rs"]
pub mod body;
#[path = "../../pipeline/tests/fuzz_targets/mod.rs"]
pub mod fuzz_targets;
#[path = "../../passes/tests/fuzz_render/input.rs"]
pub mod input;
#[path = "../../pipeline/tests/fuzz_targets/script.rs"]
pub mod script;
#[path = "../../pipeline/tests/fuzz_targets/shader.rs"]
pub mod shader;

/// Makes the calling thread the only worker: an input then takes the same path in every run, and no time goes into waking
/// other threads.
///
/// # Panics
/// If the thread pool exists already.
pub fn start() {
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .use_current_thread()
        .build_global()
        .expect("no thread pool exists before the first input");
}
