//! Sides of a comparison that a second renderer makes on a thread of its own, while the window continues.

use super::picture::Picture;
use super::side::{Obtained, On, Times, What};
use super::{Doing, Message, Shared};
use curitiba::Choice;
use curitiba::pipeline::executor::{Cancellation, Goal, Observer, Progress, RenderError, Renderer, StepKind};
use curitiba::pipeline::plan::{OWN_BACKEND, Settings};
use curitiba::pipeline::project::Project;
use curitiba::reference::{PICTURE_SAMPLES, ReferenceError, References};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// The first frame of a renderer compiles shaders and fills caches. If it takes less than this, a second frame is timed.
const TIMED_AGAIN: Duration = Duration::from_millis(500);

/// The pictures to make, and everything that they depend on.
pub(super) struct Task {
    /// The project in its present state, including cameras that were moved.
    pub project: Project,
    pub settings: Settings,
    /// The window's choice of engines.
    pub choice: Choice,
    /// Samples per point that the window's picture has accumulated; `None` if it has not accumulated any.
    pub samples: Option<u32>,
    pub source: Source,
}

/// Which pictures to make, each with the index of its side.
pub(super) enum Source {
    /// Pictures by other engines.
    Engines(On, Vec<(usize, What)>),
    /// The reference of the result, for the side of this index.
    Reference(usize),
}

impl Source {
    /// The sides that the pictures are for.
    pub fn sides(&self) -> Vec<usize> {
        match self {
            Self::Engines(_, wanted) => wanted.iter().map(|(side, _)| *side).collect(),
            Self::Reference(side) => vec![*side],
        }
    }
}

/// The result of a thread: what was obtained for each side, with the side's index; `None` if the job was given up.
pub(super) type Made = Option<Vec<(usize, Obtained)>>;

/// A thread that makes pictures for sides of a comparison.
pub(super) struct Job {
    pub sides: Vec<usize>,
    stop: Stop,
    thread: Option<JoinHandle<()>>,
}

/// A request to stop, and the cancellation of the renderer that the thread uses.
#[derive(Clone, Default)]
struct Stop {
    asked: Cancellation,
    renderer: Arc<Mutex<Option<Cancellation>>>,
}

impl Stop {
    fn renderer(&self) -> MutexGuard<'_, Option<Cancellation>> {
        self.renderer.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn stop(&self) {
        self.asked.cancel();
        if let Some(renderer) = self.renderer().as_ref() {
            renderer.cancel();
        }
    }

    /// From now on, a request to stop cancels this renderer, in place of any before. If a request was already made, cancels it at once.
    fn adopt(&self, renderer: &Renderer) {
        *self.renderer() = Some(renderer.cancellation());
        if self.asked.is_cancelled() {
            renderer.cancellation().cancel();
        }
    }
}

/// Sends the result when this value is dropped, also after a panic, whose message was printed before.
struct Report {
    to: Sender<Message>,
    made: Made,
}

impl Drop for Report {
    fn drop(&mut self) {
        // The window may be closed, so that nothing receives the message.
        let _ = self.to.send(Message::Made(self.made.take()));
    }
}

impl Job {
    /// Starts a thread for a task.
    ///
    /// # Errors
    /// If no thread can be started.
    pub fn start(task: Task, shared: Arc<Shared>, to: Sender<Message>) -> std::io::Result<Self> {
        let (sides, stop) = (task.source.sides(), Stop::default());
        let theirs = stop.clone();
        let fault = "the renderer of this side ended by a fault of the program; please report it";
        let failed = sides.iter().map(|side| (*side, Obtained::missing(fault))).collect();
        let thread = std::thread::Builder::new().name("comparison".to_owned()).stack_size(8 << 20);
        let thread = thread.spawn(move || {
            let mut report = Report { to, made: Some(failed) };
            let made = make(task, &theirs, &mut Teller(&shared));
            report.made = made;
            shared.change(|state| state.doing = None);
        })?;
        Ok(Self { sides, stop, thread: Some(thread) })
    }

    /// Asks the thread to end.
    pub fn give_up(&self) {
        self.stop.stop();
    }

    pub fn is_given_up(&self) -> bool {
        self.stop.asked.is_cancelled()
    }
}

impl Drop for Job {
    fn drop(&mut self) {
        self.stop.stop();
        if let Some(thread) = self.thread.take() {
            // A panic has printed its message.
            let _ = thread.join();
        }
    }
}

/// Reports the current step and its progress to the window.
struct Teller<'a>(&'a Shared);

impl Observer for Teller<'_> {
    fn begin(&mut self, kind: StepKind, name: &str, progress: &Arc<Progress>) {
        let doing = Doing { what: format!("{} {name}", kind.name()), progress: Arc::clone(progress) };
        self.0.change(|state| state.doing = Some(doing));
    }

    fn end(&mut self) {
        self.0.change(|state| state.doing = None);
    }
}

fn make(task: Task, stop: &Stop, teller: &mut Teller<'_>) -> Made {
    let sides = task.source.sides();
    let made = match &task.source {
        Source::Engines(on, wanted) => on_engines(&task, *on, wanted, stop, teller),
        Source::Reference(side) => reference(&task, stop, teller).map(|obtained| vec![(*side, obtained)]),
    };
    if stop.asked.is_cancelled() {
        return None;
    }
    Some(made.unwrap_or_else(|why| sides.into_iter().map(|side| (side, Obtained::missing(&why))).collect()))
}

/// Pictures by a renderer with other engines, with the times of a frame.
fn on_engines(
    task: &Task,
    on: On,
    wanted: &[(usize, What)],
    stop: &Stop,
    teller: &mut Teller<'_>,
) -> Result<Vec<(usize, Obtained)>, String> {
    let mut settings = task.settings.clone();
    if matches!(on, On::Rays(_)) {
        // The chosen ray backend also applies to passes with a backend of their own.
        let own = format!(".{}=", OWN_BACKEND.name);
        settings.set.retain(|assignment| !assignment.contains(&own));
    }
    let outputs = wanted.iter().filter_map(|(_, what)| match what {
        What::Output(name) => Some(name.clone()),
        What::Shown | What::Result => None,
    });
    settings.show = outputs.collect();
    let text = |error: RenderError| error.to_string();
    let project = task.project.clone();
    let mut renderer =
        curitiba::open_project(project, settings, on.choice(task.choice), teller).map_err(|error| error.to_string())?;
    stop.adopt(&renderer);
    let start = Instant::now();
    let mut image = renderer.frame(teller).map_err(text)?;
    if start.elapsed() < TIMED_AGAIN {
        renderer.forget_frames();
        image = renderer.frame(teller).map_err(text)?;
    }
    let mut times = Times::default();
    for row in renderer.timeline().rows.iter().filter(|row| row.kind.per_frame()) {
        times.add(row.kind, row.host_ms.iter().sum());
    }
    let samples = match task.samples {
        Some(samples) => {
            renderer.accumulate(Goal::Samples(samples), teller).map_err(text)?;
            image = renderer.window_image();
            format!(", {samples} samples")
        }
        None => String::new(),
    };
    let mut result = Some(image);
    let mut pictures = Vec::new();
    for (side, what) in wanted {
        let mut picture = match what {
            What::Output(name) => {
                let channel = renderer.plan().channel_named(name).map_err(|error| error.to_string())?;
                Picture::of_channel(name, &renderer, channel)
            }
            What::Shown | What::Result => {
                Picture::of_result(result.take().unwrap_or_else(|| renderer.window_image()), renderer.plan())
            }
        };
        picture.name = format!("{} on {}{samples}", picture.name, on.name());
        let times = Some(times.clone());
        pictures.push((*side, Obtained { picture: Some(Arc::new(picture)), times, missing: None }));
    }
    Ok(pictures)
}

/// The reference of the result: a stored one, or one rendered with the smallest valid number of samples.
fn reference(task: &Task, stop: &Stop, teller: &mut Teller<'_>) -> Result<Obtained, String> {
    if task.settings.crop.is_some() {
        return Err("references are of whole pictures; leave --crop out".to_owned());
    }
    let mut references = References::new(References::default_folder(), Duration::ZERO);
    let (project, least) = (task.project.clone(), PICTURE_SAMPLES.0);
    let found = references.picture_of(project, &task.settings, least, &stop.asked, teller).map_err(|error| {
        let ReferenceError::Picture(why) = error else { return error.to_string() };
        format!("there is no reference: {why}")
    })?;
    let name =
        format!("reference, {} samples, standard error {:.5}", found.reference.samples, found.reference.own_error);
    let picture = Picture::of_window(name, found.reference.picture, found.display);
    Ok(Obtained { picture: Some(Arc::new(picture)), ..Obtained::default() })
}
