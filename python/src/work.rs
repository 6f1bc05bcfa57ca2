//! Long work on a thread other than the interpreter's: other Python threads go on, Ctrl-C is handled, and a line shows the progress.

use curitiba::pipeline::executor::{Cancellation, Observer, Progress, StepKind};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

/// Time between two checks for Ctrl-C.
const ASKED: Duration = Duration::from_millis(20);
/// Time after which the progress line is shown, and time between two drawings of it.
const PATIENCE: Duration = Duration::from_secs(1);
const DRAWN: Duration = Duration::from_millis(100);

/// A step's name, and its progress.
type Step = (String, Arc<Progress>);

/// The step that runs: written by the working thread, read by the waiting one.
#[derive(Clone, Default)]
pub struct Watch(Arc<Mutex<Option<Step>>>);

impl Watch {
    fn step(&self) -> MutexGuard<'_, Option<Step>> {
        self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

impl Observer for Watch {
    fn begin(&mut self, kind: StepKind, name: &str, progress: &Arc<Progress>) {
        *self.step() = Some((format!("{} {name}", kind.name()), Arc::clone(progress)));
    }

    fn end(&mut self) {
        *self.step() = None;
    }
}

/// The line of progress; `curitiba/_progress.py` draws it.
struct Line<'a> {
    watch: &'a Watch,
    began: Instant,
    drawn: Option<Instant>,
    broken: bool,
}

impl Line<'_> {
    /// Draws the line if it is due. A stream that cannot be written to ends the drawing, but not the work.
    fn draw(&mut self, py: Python<'_>) -> PyResult<()> {
        let last = self.drawn.map_or(self.began + PATIENCE, |drawn| drawn + DRAWN);
        if self.broken || Instant::now() < last {
            return Ok(());
        }
        let Some((step, (done, total))) =
            self.watch.step().as_ref().map(|(step, progress)| (step.clone(), progress.get()))
        else {
            return Ok(());
        };
        let seconds = self.began.elapsed().as_secs_f64();
        let shown = py
            .import("curitiba._progress")
            .and_then(|module| module.call_method1("show", (step, done, total, seconds)));
        self.drawn = Some(Instant::now());
        self.told(py, shown)
    }

    fn clear(&mut self, py: Python<'_>) -> PyResult<()> {
        if self.broken || self.drawn.is_none() {
            return Ok(());
        }
        let cleared = py.import("curitiba._progress").and_then(|module| module.call_method0("clear"));
        self.told(py, cleared)
    }

    /// Passes Ctrl-C on, which Python may receive while it draws; other failures end the drawing.
    fn told(&mut self, py: Python<'_>, drawn: PyResult<Bound<'_, PyAny>>) -> PyResult<()> {
        match drawn {
            Err(interrupt) if interrupt.is_instance_of::<PyKeyboardInterrupt>(py) => Err(interrupt),
            drawn => {
                self.broken = drawn.is_err();
                Ok(())
            }
        }
    }
}

/// Waits for a result with the interpreter released. After Ctrl-C, `stop` is cancelled, and the exception is raised once the work has ended.
///
/// `None` if the worker ended without a result.
pub fn wait<T: Send>(py: Python<'_>, stop: &Cancellation, watch: &Watch, result: Receiver<T>) -> PyResult<Option<T>> {
    let result = Mutex::new(result);
    let next = || result.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).recv_timeout(ASKED);
    let mut line = Line { watch, began: Instant::now(), drawn: None, broken: false };
    loop {
        let answer = match py.detach(next) {
            Ok(value) => Some(Some(value)),
            Err(RecvTimeoutError::Disconnected) => Some(None),
            Err(RecvTimeoutError::Timeout) => None,
        };
        let heard = py.check_signals().and_then(|()| if answer.is_some() { line.clear(py) } else { line.draw(py) });
        match (heard, answer) {
            (Ok(()), Some(value)) => return Ok(value),
            (Ok(()), None) => {}
            (Err(interrupt), answer) => {
                stop.cancel();
                while answer.is_none() && matches!(py.detach(next), Err(RecvTimeoutError::Timeout)) {}
                stop.reset();
                line.clear(py)?;
                return Err(interrupt);
            }
        }
    }
}

/// Runs `work`, which may borrow its inputs, on a thread of its own, and waits for its end. `step` is the name of the work in the progress line.
///
/// # Errors
/// `KeyboardInterrupt` after Ctrl-C. It is raised once the work ends, so long work must check its progress for cancellation.
pub fn run<T: Send>(py: Python<'_>, step: &str, work: impl FnOnce(&Progress) -> T + Send) -> PyResult<T> {
    let stop = Cancellation::new();
    let progress = Arc::new(Progress::until(&stop));
    let watch = Watch::default();
    *watch.step() = Some((step.to_owned(), Arc::clone(&progress)));
    std::thread::scope(|scope| {
        let (send, receive) = channel();
        scope.spawn(move || {
            // After an interrupt there is no receiver.
            let _ = send.send(work(&progress));
        });
        wait(py, &stop, &watch, receive)?
            .ok_or_else(|| crate::failed("the work ended by a fault of the program; please report it"))
    })
}
