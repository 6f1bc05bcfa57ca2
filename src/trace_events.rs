//! The steps of a timeline as trace events, in JSON for Perfetto (<https://ui.perfetto.dev>) and `chrome://tracing`.
//!
//! The format is Google's "Trace Event Format": complete events (`"ph": "X"`) and thread names (`"ph": "M"`). Times are
//! microseconds after the first step. One row shows the steps of the host; another shows the same steps on the device's clock, if
//! it has one. That clock gives durations but no start times, so each device step is shown at the start of its host step.

use crate::pipeline::executor::{Engines, Row, Timeline};
use crate::pipeline::files;
use serde_json::{Value, json};
use std::io;
use std::path::Path;

const PROCESS: u32 = 1;
const HOST: u32 = 1;
const DEVICE: u32 = 2;

/// The events of all steps, with the names of the engines.
#[must_use]
pub fn trace_events(timeline: &Timeline, engines: &Engines) -> Value {
    let mut events = vec![named("process_name", HOST, "curitiba"), named("thread_name", HOST, "host")];
    if timeline.rows.iter().any(|row| !row.device_ms.is_empty()) {
        events.push(named("thread_name", DEVICE, "device"));
    }
    for row in &timeline.rows {
        events.extend(row.spans.iter().map(|span| complete(row, HOST, span.start_ms, span.ms)));
        // Device times are shown only if each run has one; otherwise it is not known which run a time belongs to.
        if row.device_ms.len() == row.spans.len() {
            let runs = row.spans.iter().zip(&row.device_ms);
            events.extend(runs.map(|(span, device)| complete(row, DEVICE, span.start_ms, *device)));
        }
    }
    json!({
        "displayTimeUnit": "ms",
        "otherData": { "raster": engines.raster.device(), "rays": engines.rays.device() },
        "traceEvents": events,
    })
}

/// Writes the events to a file.
///
/// # Errors
/// If the file cannot be written.
pub fn write(path: &Path, timeline: &Timeline, engines: &Engines) -> io::Result<()> {
    let text = serde_json::to_vec(&trace_events(timeline, engines))?;
    files::write_atomically(path, &text)
        .map_err(|error| io::Error::new(error.kind(), format!("{}: {error}", path.display())))
}

fn named(what: &str, thread: u32, name: &str) -> Value {
    json!({ "ph": "M", "name": what, "pid": PROCESS, "tid": thread, "args": { "name": name } })
}

fn complete(row: &Row, thread: u32, start_ms: f64, length_ms: f64) -> Value {
    let mut about = json!({ "note": row.note });
    if let Some(rays) = row.rays {
        about["rays"] = rays.total().into();
    }
    json!({
        "ph": "X", "name": format!("{} {}", row.kind.name(), row.name), "cat": row.kind.name(), "pid": PROCESS, "tid": thread,
        "ts": start_ms * 1e3, "dur": length_ms * 1e3, "args": about,
    })
}
