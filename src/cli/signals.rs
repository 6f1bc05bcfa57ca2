//! Signal handling: an interrupted program leaves no half-written files.

use curitiba::pipeline::files;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::iterator::Signals;
use std::ffi::c_int;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// From now on SIGINT, SIGTERM and SIGHUP end the program after its temporary files are removed. A write beyond the file size limit
/// returns an error, as on a full disk, instead of ending the program by SIGXFSZ.
///
/// A signal that was ignored when the program started, as `nohup` does with SIGHUP, stays ignored.
pub fn handle() -> std::io::Result<()> {
    // The flag is not read: the mere existence of a handler makes the write return an error.
    signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)))?;
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP].into_iter().filter(|signal| !ignored(*signal)))?;
    std::thread::Builder::new().name("signals".to_owned()).spawn(move || {
        for signal in signals.forever() {
            files::abandon();
            let _ = signal_hook::low_level::emulate_default_handler(signal);
        }
    })?;
    Ok(())
}

/// Whether a signal is ignored, by `/proc/self/status`; `false` on systems without it.
fn ignored(signal: c_int) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}
