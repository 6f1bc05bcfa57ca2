//! Long work beside the interpreter: other Python threads go on, and Ctrl-C is heard.

use curitiba::pipeline::executor::Cancellation;
use pyo3::prelude::*;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

/// How often it is asked whether Ctrl-C was pressed.
const ASKED: Duration = Duration::from_millis(20);

/// Waits for a result with the interpreter released. After Ctrl-C, `stop` asks the work to end; the exception is raised when it has.
///
/// `None` if the worker is gone without a result.
pub fn wait<T: Send>(py: Python<'_>, stop: &Cancellation, result: Receiver<T>) -> PyResult<Option<T>> {
    let result = Mutex::new(result);
    let next = || result.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).recv_timeout(ASKED);
    loop {
        match py.detach(next) {
            Ok(value) => return Ok(Some(value)),
            Err(RecvTimeoutError::Disconnected) => return Ok(None),
            Err(RecvTimeoutError::Timeout) => {}
        }
        if let Err(interrupt) = py.check_signals() {
            stop.cancel();
            while matches!(py.detach(next), Err(RecvTimeoutError::Timeout)) {}
            stop.reset();
            return Err(interrupt);
        }
    }
}

/// Runs work that borrows: on a thread of its own, whose end is waited for.
///
/// # Errors
/// `KeyboardInterrupt` after Ctrl-C; the work has to ask `stop` to end early.
pub fn run<T: Send>(py: Python<'_>, stop: &Cancellation, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    std::thread::scope(|scope| {
        let (send, receive) = channel();
        scope.spawn(move || {
            // Nobody listens after an interrupt.
            let _ = send.send(work());
        });
        wait(py, stop, receive)?
            .ok_or_else(|| crate::failed("the work ended by a fault of the program; please report it"))
    })
}
