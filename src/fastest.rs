//! The fastest ray backend of this machine, found by a short measurement whose result is stored.

use crate::engines::{ray_backend, why_not_wgpu};
use crate::environment::Environment;
use crate::pipeline::executor::Silent;
use crate::pipeline::files;
use crate::pipeline::plan::Settings;
use crate::pipeline::project::{SceneOptions, SceneProjects};
use crate::pipeline::square;
use crate::reference::References;
use crate::{BackendChoice, Choice, OpenError};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// The measured scene: a generated square with this many triangles, with shadows and ambient occlusion, in a square window of
/// `SIDE` pixels.
const TRIANGLES: u32 = 30_000;
const SIDE: u32 = 384;
/// Least time and least number of frames: first for the warm-up, since drivers compile and clock rates rise in the first frames,
/// then for the measurement, whose median is used.
const WARM_UP: (Duration, usize) = (Duration::from_millis(400), 3);
const MEASURED: (Duration, usize) = (Duration::from_millis(400), 5);
/// Largest record that is read, bytes.
const MOST_BYTES: u64 = 1 << 20;

/// The fastest backend, with the measurement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Fastest {
    /// Name of the backend, as in [`BackendChoice::NAMES`].
    pub backend: String,
    /// Milliseconds per frame of each available backend, the fastest first.
    pub frames_ms: Vec<(String, f64)>,
    /// Backends that are not available, with the reasons.
    pub missing: Vec<(String, String)>,
    /// Conditions of the measurement: program, processor, threads, graphics devices with their drivers, and further options of the
    /// engines.
    pub holds_for: Vec<String>,
    /// The file that the measurement was read from; `None` if it was made now.
    #[serde(skip)]
    pub read_from: Option<PathBuf>,
    /// Why the measurement could not be stored; `None` if it is.
    #[serde(skip)]
    pub not_kept: Option<String>,
}

impl Fastest {
    /// Evaluates measured times. The processor is always available, and wins ties because it comes first.
    fn of(measured: Vec<(BackendChoice, Result<f64, String>)>, holds_for: Vec<String>) -> Self {
        let (mut frames_ms, mut missing) = (Vec::new(), Vec::new());
        for (backend, result) in measured {
            match result {
                Ok(ms) => frames_ms.push((backend.name().to_owned(), ms)),
                Err(why) => missing.push((backend.name().to_owned(), why)),
            }
        }
        frames_ms.sort_by(|a, b| a.1.total_cmp(&b.1));
        let backend = frames_ms.first().map_or_else(|| BackendChoice::Cpu.name().to_owned(), |(name, _)| name.clone());
        Self { backend, frames_ms, missing, holds_for, read_from: None, not_kept: None }
    }

    /// The fastest backend.
    #[must_use]
    pub fn choice(&self) -> BackendChoice {
        let named = BackendChoice::NAMES.iter().find(|(name, _)| *name == self.backend);
        named.map_or(BackendChoice::Cpu, |(_, choice)| *choice)
    }
}

impl fmt::Display for Fastest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let times: Vec<String> = self.frames_ms.iter().map(|(name, ms)| format!("{name} {ms:.1} ms")).collect();
        write!(f, "backend fastest: {} ({} a frame of {SIDE}x{SIDE} pixels", self.backend, times.join(", "))?;
        match (&self.read_from, &self.not_kept) {
            (Some(path), _) => write!(f, "; measured before: {}", path.display())?,
            (None, Some(why)) => write!(f, "; measured now, and not kept: {why}")?,
            (None, None) => write!(f, "; measured now, and kept")?,
        }
        write!(f, ")")?;
        for (name, why) in &self.missing {
            write!(f, "\n       not {name}: {why}")?;
        }
        Ok(())
    }
}

static TAKEN: OnceLock<Fastest> = OnceLock::new();

/// The result of [`choose`] in this process; `None` if it was not called.
pub fn taken() -> Option<&'static Fastest> {
    TAKEN.get()
}

/// The choice with the fastest ray backend, on the threads of rayon's global pool. The first call measures all available backends,
/// which takes some seconds, or reads an earlier measurement of the same program on the same machine; later calls return the same
/// result.
#[must_use]
pub fn choose(choice: Choice) -> Choice {
    let found = TAKEN.get_or_init(|| look_up(choice, &record()));
    choice.traced_by(found.choice())
}

/// Path of the stored measurement, in the default folder of the references.
fn record() -> PathBuf {
    References::default_folder().join("fastest.json")
}

fn look_up(choice: Choice, record: &Path) -> Fastest {
    let holds_for = holds_for(choice);
    if let Some(kept) = read(record, &holds_for) {
        return kept;
    }
    let mut found = Fastest::of(measure(choice), holds_for);
    found.not_kept = keep(record, &found).err();
    found
}

/// The stored measurement; `None` if there is none that can be read, or it was made under other conditions than `holds_for`.
fn read(path: &Path, holds_for: &[String]) -> Option<Fastest> {
    let bytes = files::read_if_there(path, MOST_BYTES).ok()??;
    let kept: Fastest = serde_json::from_slice(&bytes).ok()?;
    let known = BackendChoice::ALL.iter().any(|backend| backend.name() == kept.backend);
    (known && kept.holds_for == holds_for).then(|| Fastest { read_from: Some(path.to_owned()), ..kept })
}

fn keep(path: &Path, found: &Fastest) -> Result<(), String> {
    let bytes = serde_json::to_vec_pretty(found).map_err(|error| error.to_string())?;
    let written =
        path.parent().map_or(Ok(()), files::create_folder).and_then(|()| files::write_atomically(path, &bytes));
    written.map_err(|error| format!("{}: {error}", path.display()))
}

fn holds_for(choice: Choice) -> Vec<String> {
    let found = Environment::probe(choice.traced_by(BackendChoice::Auto));
    let mut words = vec![
        format!("curitiba {} {} {}", found.version, found.commit, found.profile),
        format!("{}, {} threads", found.cpu, found.threads),
        format!("raster {}, GPUs {}", choice.raster.name(), choice.gpus),
    ];
    words.extend(found.gpu.iter().zip(&found.driver).map(|(gpu, driver)| format!("{gpu}, {driver}")));
    words.extend(choice.adapter_name().map(|name| format!("adapter {name}")));
    words
}

fn measure(choice: Choice) -> Vec<(BackendChoice, Result<f64, String>)> {
    let scene = square::generate(TRIANGLES).scene;
    let frame = |backend: BackendChoice| {
        // A software driver is measured only if it was asked for.
        if backend == BackendChoice::Wgpu
            && let Some(error) = why_not_wgpu(choice)
        {
            return Err(error.reason());
        }
        let choice = choice.traced_by(backend);
        ray_backend(choice).map_err(|error| error.reason())?;
        frame_ms(scene.clone(), choice).map_err(|error| error.joined())
    };
    BackendChoice::ALL.into_iter().map(|backend| (backend, frame(backend))).collect()
}

/// The median time of a frame with a choice of engines, milliseconds.
fn frame_ms(scene: crate::pipeline::scene::Scene, choice: Choice) -> Result<f64, OpenError> {
    let effects = Some("shadows,ao".parse().expect("they are effects"));
    let options = SceneOptions { effects, ..SceneOptions::default() };
    let project = SceneProjects::in_memory(scene, &options, Some([SIDE; 2])).expect("the square is sound").project();
    let mut renderer =
        crate::open_project(project, Settings::default(), Choice { fallback: [None; 4], ..choice }, &mut Silent)?;
    let mut frames = |(time, least): (Duration, usize)| {
        let (begun, mut times) = (Instant::now(), Vec::new());
        while times.len() < least || begun.elapsed() < time {
            let start = Instant::now();
            renderer.draw_frame(&mut Silent)?;
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
        Ok::<_, OpenError>(times)
    };
    frames(WARM_UP)?;
    let mut times = frames(MEASURED)?;
    times.sort_by(f64::total_cmp);
    Ok(times[times.len() / 2])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(words: &[&str]) -> Vec<String> {
        words.iter().map(|&word| word.to_owned()).collect()
    }

    #[test]
    fn the_fastest_that_is_there_is_taken() {
        use BackendChoice::{Cpu, Cuda, Optix, Wgpu};
        let measured = vec![(Cpu, Ok(80.0)), (Wgpu, Ok(9.5)), (Cuda, Ok(7.25)), (Optix, Err("no driver".to_owned()))];
        let found = Fastest::of(measured, words(&["here"]));
        assert_eq!((found.choice(), found.frames_ms[0].1), (Cuda, 7.25));
        let text = found.to_string();
        assert!(text.starts_with("backend fastest: cuda (cuda 7.2 ms, wgpu 9.5 ms, cpu 80.0 ms a frame"), "{text}");
        assert!(text.ends_with("not optix: no driver"), "{text}");
        let even = vec![(Cpu, Ok(5.0)), (Wgpu, Ok(5.0))];
        assert_eq!(Fastest::of(even, Vec::new()).choice(), Cpu);
    }

    #[test]
    fn a_record_is_read_on_the_same_machine_only() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("new/fastest.json");
        let here = words(&["curitiba", "a processor, 4 threads"]);
        assert_eq!(read(&path, &here), None);
        let found = Fastest::of(vec![(BackendChoice::Cpu, Ok(3.5)), (BackendChoice::Wgpu, Ok(2.5))], here.clone());
        keep(&path, &found).expect("it is written");
        assert_eq!(read(&path, &here), Some(Fastest { read_from: Some(path.clone()), ..found.clone() }));
        assert_eq!(read(&path, &words(&["curitiba", "a processor, 8 threads"])), None);
        for damaged in [&b"{"[..], b"[]", b"\xff"] {
            std::fs::write(&path, damaged).expect("it is written");
            assert_eq!(read(&path, &here), None);
        }
        let unknown = Fastest { backend: "vulkan".to_owned(), ..found.clone() };
        keep(&path, &unknown).expect("it is written");
        assert_eq!(read(&path, &here), None);
        let blocked = folder.path().join("new/fastest.json/below");
        assert!(keep(&blocked, &found).is_err());
    }

    #[test]
    fn what_is_measured_renders_on_the_processor() {
        let measured = measure(Choice::CPU);
        let (backend, result) = &measured[0];
        assert_eq!(*backend, BackendChoice::Cpu);
        assert!(result.as_ref().is_ok_and(|ms| *ms > 0.0), "{result:?}");
        assert_eq!(measured.len(), BackendChoice::ALL.len());
    }
}
