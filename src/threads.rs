//! Starting the threads of the cpu engines.

/// Memory of a thread in addition to its stack, bytes: guard pages, the stack of its signal handler, its allocator's arena.
const BESIDE_STACK: usize = 256 << 10;

/// Starts the threads of the cpu engines, once per process: all cores, unless a number is given.
///
/// # Errors
/// If there is no memory for them, they cannot be started, or they were started already; the message gives a remedy.
pub fn start(threads: Option<u16>) -> Result<(), String> {
    let count = threads.map_or_else(|| std::thread::available_parallelism().map_or(1, usize::from), usize::from);
    let stack = std::env::var("RUST_MIN_STACK").ok().and_then(|bytes| bytes.parse().ok()).unwrap_or(2 << 20);
    let refused = |why: &dyn std::fmt::Display| {
        let plural = if count == 1 { " thread" } else { " threads" };
        format!("{count}{plural} cannot be started: {why}\n       --threads takes fewer")
    };
    // A thread with a stack but no memory for anything else could not report the problem.
    let room = count.saturating_mul(BESIDE_STACK.saturating_add(stack));
    crate::pipeline::memory::probe(room as u64).map_err(|error| refused(&error))?;
    rayon::ThreadPoolBuilder::new().num_threads(count).stack_size(stack).build_global().map_err(|error| refused(&error))
}
