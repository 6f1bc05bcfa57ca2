//! Progress bars for steps that take longer than a second, on terminals only.

use super::failure;
use curitiba::pipeline::executor::{Fallback, Observer, Progress, StepKind};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal as _;
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Time after which a running step is shown.
const PATIENCE: Duration = Duration::from_secs(1);
const TICK: Duration = Duration::from_millis(100);

/// Shows a progress bar for a long step on the error stream, if that is a terminal.
#[derive(Debug, Default)]
pub struct Bars {
    running: Option<(Sender<()>, JoinHandle<()>)>,
}

impl Observer for Bars {
    fn begin(&mut self, kind: StepKind, name: &str, progress: &Arc<Progress>) {
        self.end();
        if !std::io::stderr().is_terminal() {
            return;
        }
        let (stop, stopped) = channel::<()>();
        let (label, progress) = (format!("{} {name}", kind.name()), Arc::clone(progress));
        let watch = move || {
            let start = Instant::now();
            let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden());
            while stopped.recv_timeout(TICK) == Err(RecvTimeoutError::Timeout) {
                if start.elapsed() >= PATIENCE && bar.is_hidden() {
                    bar.set_draw_target(ProgressDrawTarget::stderr());
                }
                show(&bar, &label, &progress);
            }
            bar.finish_and_clear();
        };
        // If no thread can be started, there is no bar.
        self.running = std::thread::Builder::new().spawn(watch).ok().map(|watcher| (stop, watcher));
    }

    fn end(&mut self) {
        if let Some((stop, watcher)) = self.running.take() {
            drop(stop);
            // The thread only draws: a panic in it does not affect the picture.
            let _ = watcher.join();
        }
    }

    fn fell_back(&mut self, fallback: &Fallback) {
        self.end();
        failure::print_warning(&fallback.to_string());
    }
}

impl Drop for Bars {
    fn drop(&mut self) {
        self.end();
    }
}

fn show(bar: &ProgressBar, label: &str, progress: &Progress) {
    let (done, total) = progress.get();
    let template =
        if total > 0 { "{msg:30} [{bar:30}] {percent}% {elapsed}, {eta} left" } else { "{spinner} {msg} {elapsed}" };
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar.set_message(label.to_owned());
    if total > 0 {
        bar.set_length(total);
        bar.set_position(done.min(total));
    }
    bar.tick();
}
