//! The thread that owns the renderer.
//!
//! Engines belong to the thread that made them, and a frame may take seconds. So the window never calls a renderer: it sends [`Command`]s and
//! shows the latest [`State`].

mod compare;
mod engines;
mod facts;
mod far;
mod history;
mod inspect;
mod pace;
mod picture;
mod reopen;
mod save;
mod session;
mod side;
mod sides;
mod step;
mod watch;

pub use compare::Compared;
pub use engines::Available;
pub use facts::{Facts, Parameter, PassFacts, PassOutput, PassState, PassTimes};
pub use history::{FRAMES, History};
pub use inspect::{PixelRays, Segment};
pub use picture::Picture;
pub use side::{Obtained, On, Side, Times, What};

use crate::texture::Device;
use curitiba::Choice;
use curitiba::pipeline::executor::{Cancellation, Progress};
use curitiba::pipeline::plan::Settings;
use curitiba::pipeline::project::Pose;
use session::Session;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Value of [`State::not_refined`] if no pass takes samples.
pub const NO_SAMPLES: &str = "no pass takes samples";

/// A frame that has taken longer than this is cancelled when a parameter changes or a pass is switched on or off. A shorter one is finished
/// and shown, so that dragging a slider always shows something.
const PATIENCE: Duration = Duration::from_millis(250);

/// The project to show, with its settings, as the command line names them.
#[derive(Debug, Clone)]
pub struct Source {
    /// The project, scene file or folder.
    pub path: PathBuf,
    /// Settings of the plan.
    pub settings: Settings,
    /// The choice of engines.
    pub choice: Choice,
    /// Whether files that change are read again.
    pub watch: bool,
}

/// A request to the renderer's thread.
#[derive(Debug, Clone)]
pub enum Command {
    /// Selects the camera of every pass; `None` gives each pass its own.
    Camera(Option<String>),
    /// Moves the camera in use.
    Move(Pose),
    /// Sets a parameter of a pass.
    Parameter {
        /// The pass.
        pass: String,
        /// The parameter.
        name: String,
        /// Its value, as written in projects.
        value: String,
    },
    /// Switches a pass on or off.
    Enable {
        /// The pass.
        pass: String,
        /// Whether the pass is on.
        on: bool,
    },
    /// Changes the engines.
    Engines(Choice),
    /// Shows the output with this full name; `None` shows the result.
    Show(Option<String>),
    /// Shows the values and rays of a pixel of the shown picture, column and row from the top left; `None` shows them no longer.
    Pixel(Option<[u32; 2]>),
    /// Compares the left picture with the right one, its reference; `None` ends the comparison.
    Compare(Option<Box<[Side; 2]>>),
    /// Sets whether more samples are accumulated while nothing changes.
    Refine(bool),
    /// Pauses or continues rendering.
    Pause(bool),
    /// Reads all files again.
    Reload,
    /// Writes the picture and a record that reproduces it: PNG, EXR and JSON beside this path.
    Save(PathBuf),
    /// Ends the thread.
    Quit,
}

impl Command {
    /// Whether a later command of the same kind makes this one pointless.
    fn replaced_by(&self, later: &Self) -> bool {
        match (self, later) {
            (Self::Parameter { pass, name, .. }, Self::Parameter { pass: other, name: named, .. }) => {
                (pass, name) == (other, named)
            }
            (Self::Move(_), Self::Move(_))
            | (Self::Show(_), Self::Show(_))
            | (Self::Pixel(_), Self::Pixel(_))
            | (Self::Compare(_), Self::Compare(_)) => true,
            _ => false,
        }
    }

    /// How long a frame must have taken for this command to cancel it; `None` if the command leaves the frame valid.
    fn outdates(&self) -> Option<Duration> {
        match self {
            Self::Move(_) | Self::Engines(_) | Self::Camera(_) | Self::Reload | Self::Pause(true) | Self::Quit => {
                Some(Duration::ZERO)
            }
            Self::Parameter { .. } | Self::Enable { .. } => Some(PATIENCE),
            _ => None,
        }
    }
}

/// What the thread is doing.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Activity {
    /// It reads files and builds structures.
    #[default]
    Opening,
    /// It renders.
    Rendering,
    /// It renders with few samples, because the camera moves.
    Moving,
    /// It accumulates more samples.
    Refining,
    /// A side of a comparison is made by another renderer.
    Comparing,
    /// Nothing remains to be done.
    Resting,
    /// Rendering is paused by the user.
    Paused,
    /// The project could not be opened, or the thread has ended by a fault; [`State::error`] says why.
    Failed,
}

/// Accumulation of samples of the shown picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Refinement {
    /// Number of samples per point so far.
    pub samples: u64,
    /// Number of samples per point at which accumulation ends.
    pub goal: u64,
    /// Largest standard error of a pass, as root mean square over its pixels: `docs/library.md`. NaN before the second batch.
    pub error: f64,
}

/// The thread's state, as the window shows it. Cheap to clone.
#[derive(Debug, Clone, Default)]
pub struct State {
    /// The project and its passes; `None` until it is open.
    pub facts: Option<Arc<Facts>>,
    /// The shown picture: the result, or an output.
    pub picture: Option<Arc<Picture>>,
    /// The two sides of a comparison.
    pub sides: [Obtained; 2],
    /// Metrics of the two sides, once they are computed.
    pub compared: Option<Arc<Compared>>,
    /// Why the two sides cannot be compared although both exist.
    pub incomparable: Option<String>,
    /// The current step of the renderer that makes a side.
    pub doing: Option<Doing>,
    /// Values and rays of the chosen pixel, as last collected; `None` if no pixel is chosen or nothing was collected yet.
    pub pixel: Option<Arc<PixelRays>>,
    /// Times of the last frames.
    pub history: Arc<History>,
    /// Progress of accumulating samples; `None` if no accumulation was begun for the present settings and camera.
    pub refinement: Option<Refinement>,
    /// Why no more samples are accumulated than the project asks for.
    pub not_refined: Option<String>,
    /// What the thread is doing.
    pub activity: Activity,
    /// Why the last command or step failed; `None` if it did not.
    pub error: Option<String>,
    /// The last message: files that were written or read again.
    pub told: Option<String>,
    /// Number of frames so far.
    pub frames: u64,
    /// Number of commands that were taken, including replaced ones. A command is counted after the step that follows it.
    pub taken: u64,
    /// Duration of the last cancellation of a step: from the command that caused the cancellation until the thread read commands again.
    pub gave_up_after: Option<Duration>,
}

/// A step and its progress.
#[derive(Debug, Clone)]
pub struct Doing {
    /// Kind and name of the step.
    pub what: String,
    /// Its progress.
    pub progress: Arc<Progress>,
}

/// A message to the renderer's thread.
enum Message {
    /// From the window.
    Command(Command),
    /// From a thread that makes sides of a comparison.
    Made(far::Made),
}

type Wake = Arc<dyn Fn() + Send + Sync>;

/// Data that the window and the renderer's thread share.
struct Shared {
    state: Mutex<State>,
    busy: Mutex<Busy>,
    /// The window's device, once there is a window.
    device: OnceLock<Device>,
    wake: Wake,
}

/// The cancellation of the current step.
#[derive(Default)]
struct Busy {
    cancellation: Cancellation,
    /// When the step became cancellable; `None` if it may not be cancelled.
    since: Option<Instant>,
    /// When the step was cancelled; `None` if it was not.
    given_up: Option<Instant>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    /// Changes the state that the window shows, and wakes the window.
    fn change(&self, change: impl FnOnce(&mut State)) {
        change(&mut lock(&self.state));
        (self.wake)();
    }

    /// Uploads a picture that the window will show to the window's device, if the device is known.
    fn put(&self, picture: &Picture) {
        if let Some(device) = self.device.get() {
            // The window uploads the picture again, and shows the error.
            let _ = picture.on(device);
        }
    }
}

/// The window's handle of the renderer's thread. Dropping it ends the thread.
pub struct Worker {
    messages: Sender<Message>,
    sent: AtomicU64,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Worker {
    /// Opens a source on a new thread. `wake` is called whenever the state has changed.
    ///
    /// # Errors
    /// If no thread can be started.
    pub fn start(source: Source, wake: impl Fn() + Send + Sync + 'static) -> std::io::Result<Self> {
        let state = Mutex::new(State::default());
        let shared = Arc::new(Shared { state, busy: Mutex::default(), device: OnceLock::new(), wake: Arc::new(wake) });
        let (messages, inbox) = channel();
        let (theirs, to_itself) = (Arc::clone(&shared), messages.clone());
        let thread = std::thread::Builder::new().name("renderer".to_owned()).stack_size(8 << 20);
        let thread = thread.spawn(move || work(Session::new(source, theirs, to_itself), &inbox))?;
        Ok(Self { messages, sent: AtomicU64::new(0), shared, thread: Some(thread) })
    }

    /// From now on the thread uploads its pictures to this device before the window gets them. The window itself uploads earlier pictures.
    pub(crate) fn draw_on(&self, device: Device) {
        // A worker has one window.
        let _ = self.shared.device.set(device);
    }

    /// Sends a command. Cancels the current step if the command makes the step's picture obsolete.
    pub fn send(&self, command: Command) {
        let outdates = command.outdates();
        self.sent.fetch_add(1, Ordering::Relaxed);
        // The thread ends by itself only after a panic, which `state` reports.
        let _ = self.messages.send(Message::Command(command));
        let mut busy = lock(&self.shared.busy);
        if let (Some(patience), Some(since)) = (outdates, busy.since)
            && since.elapsed() >= patience
        {
            busy.given_up.get_or_insert_with(Instant::now);
            busy.cancellation.cancel();
        }
    }

    /// Number of commands sent. All of them are done once [`State::taken`] has reached this number.
    #[must_use]
    pub fn sent(&self) -> u64 {
        self.sent.load(Ordering::Relaxed)
    }

    /// The present state.
    #[must_use]
    pub fn state(&self) -> State {
        let mut state = lock(&self.shared.state).clone();
        if self.thread.as_ref().is_some_and(JoinHandle::is_finished) {
            state.activity = Activity::Failed;
            state.error = Some("the renderer ended by a fault of the program; please report it".to_owned());
        }
        state
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.send(Command::Quit);
        if let Some(thread) = self.thread.take() {
            // A panic has printed its message.
            let _ = thread.join();
        }
    }
}

/// The main loop of the thread: takes the commands, does one step, and repeats.
fn work(mut session: Session, inbox: &Receiver<Message>) {
    loop {
        // `begin` comes first: commands sent after it may cancel the step below, which is then repeated.
        session.begin();
        let mut messages: Vec<Message> = Vec::new();
        let first = match session.patience() {
            Some(Duration::ZERO) => Err(RecvTimeoutError::Timeout),
            Some(time) => inbox.recv_timeout(time),
            None => inbox.recv().map_err(|_| RecvTimeoutError::Disconnected),
        };
        match first {
            Ok(message) => messages.push(message),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
        messages.extend(inbox.try_iter());
        let mut count = 0;
        let mut kept: Vec<Command> = Vec::new();
        for message in messages {
            match message {
                Message::Command(command) => {
                    count += 1;
                    kept.retain(|earlier| !earlier.replaced_by(&command));
                    kept.push(command);
                }
                Message::Made(made) => session.take_made(made),
            }
        }
        for command in kept {
            if matches!(command, Command::Quit) {
                return;
            }
            session.take(command);
        }
        session.step();
        session.tell_taken(count);
    }
}
