//! The thread that owns the renderer.
//!
//! Engines belong to the thread that made them, and a frame may take seconds: so the window never calls a renderer. It sends [`Command`]s and
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

use curitiba::Choice;
use curitiba::pipeline::executor::{Cancellation, Progress};
use curitiba::pipeline::plan::Settings;
use curitiba::pipeline::project::Pose;
use session::Session;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Of [`State::not_refined`], where there is nothing to refine.
pub const NO_SAMPLES: &str = "no pass takes samples";

/// A frame that takes longer is given up for a change of its settings; a shorter one is shown first, so that a slider that is dragged
/// always shows something.
const PATIENCE: Duration = Duration::from_millis(250);

/// What is shown, as the command line asks for it.
#[derive(Debug, Clone)]
pub struct Source {
    /// The project, scene file or folder.
    pub path: PathBuf,
    /// What the plan is made from.
    pub settings: Settings,
    /// Which engines.
    pub choice: Choice,
    /// Whether files that change are read again.
    pub watch: bool,
}

/// What the renderer is asked to do.
#[derive(Debug, Clone)]
pub enum Command {
    /// The camera of every pass; each its own, if `None`.
    Camera(Option<String>),
    /// Moves the camera in use.
    Move(Pose),
    /// A parameter of a pass.
    Parameter {
        /// The pass.
        pass: String,
        /// The parameter.
        name: String,
        /// Its value, as projects have it.
        value: String,
    },
    /// Switches a pass on or off.
    Enable {
        /// The pass.
        pass: String,
        /// On.
        on: bool,
    },
    /// Other engines.
    Engines(Choice),
    /// Shows an output by its full name; the result, if `None`.
    Show(Option<String>),
    /// Looks into a pixel of what is shown, column and row from the top left; no more, if `None`.
    Pixel(Option<[u32; 2]>),
    /// Compares the left picture with the right one, its reference; no more, if `None`.
    Compare(Option<Box<[Side; 2]>>),
    /// Whether more samples are taken while nothing changes.
    Refine(bool),
    /// Whether nothing is rendered.
    Pause(bool),
    /// Reads all files again.
    Reload,
    /// Writes the picture with what reproduces it: PNG, EXR and JSON beside this path.
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

    /// Whether the picture that is being rendered will not be wanted: at once, or once it takes long.
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

/// What the thread does.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Activity {
    /// Reads and builds.
    #[default]
    Opening,
    /// Renders.
    Rendering,
    /// Renders with few samples, because the camera moves.
    Moving,
    /// Takes more samples.
    Refining,
    /// A side of a comparison is made by another renderer.
    Comparing,
    /// Nothing is left to do.
    Resting,
    /// Nothing is rendered, because the user says so.
    Paused,
    /// There is nothing to render: [`State::error`] says why.
    Failed,
}

/// Samples of the picture that is shown.
#[derive(Debug, Clone, PartialEq)]
pub struct Refinement {
    /// Samples a point.
    pub samples: u64,
    /// Where it stops.
    pub goal: u64,
    /// Standard error, root mean square over the pixels: `docs/library.md`. NaN before the second batch.
    pub error: f64,
}

/// What the window shows. Cheap to copy.
#[derive(Debug, Clone, Default)]
pub struct State {
    /// The project and its passes; `None` until it is open.
    pub facts: Option<Arc<Facts>>,
    /// What is shown: the result, or an output.
    pub picture: Option<Arc<Picture>>,
    /// The two sides of a comparison.
    pub sides: [Obtained; 2],
    /// Their difference, where it has been computed.
    pub compared: Option<Arc<Compared>>,
    /// Why there is none although both are there.
    pub incomparable: Option<String>,
    /// The step of the renderer that makes a side.
    pub doing: Option<Doing>,
    /// The rays of a pixel.
    pub pixel: Option<Arc<PixelRays>>,
    /// Times of the last frames.
    pub history: Arc<History>,
    /// More samples than the project asks for.
    pub refinement: Option<Refinement>,
    /// Why no more samples are taken than the project asks for.
    pub not_refined: Option<String>,
    /// What goes on.
    pub activity: Activity,
    /// Why the last thing that was asked for could not be done.
    pub error: Option<String>,
    /// What was done last: files that were written or read again.
    pub told: Option<String>,
    /// Frames so far.
    pub frames: u64,
    /// Commands that were taken, and the step behind them done.
    pub taken: u64,
    /// From the last command that gave a frame up until the thread took it: what cancelling took.
    pub gave_up_after: Option<Duration>,
}

/// A step, and how far it is.
#[derive(Debug, Clone)]
pub struct Doing {
    /// What it is.
    pub what: String,
    /// How far it is.
    pub progress: Arc<Progress>,
}

/// What the thread is told.
enum Message {
    /// By the window.
    Command(Command),
    /// By a thread that makes sides of a comparison.
    Made(far::Made),
}

type Wake = Arc<dyn Fn() + Send + Sync>;

/// What the two threads share.
struct Shared {
    state: Mutex<State>,
    busy: Mutex<Busy>,
    wake: Wake,
}

/// What is being rendered.
#[derive(Default)]
struct Busy {
    cancellation: Cancellation,
    /// Since when, of a frame that may be given up.
    since: Option<Instant>,
    /// When it was.
    given_up: Option<Instant>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    /// Changes what the window shows, and lets it draw.
    fn change(&self, change: impl FnOnce(&mut State)) {
        change(&mut lock(&self.state));
        (self.wake)();
    }
}

/// The window's end of the thread; the thread ends with it.
pub struct Worker {
    messages: Sender<Message>,
    sent: AtomicU64,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Worker {
    /// Opens something on a thread of its own. `wake` is called whenever there is something new to show.
    ///
    /// # Errors
    /// If no thread can be started.
    pub fn start(source: Source, wake: impl Fn() + Send + Sync + 'static) -> std::io::Result<Self> {
        let state = Mutex::new(State::default());
        let shared = Arc::new(Shared { state, busy: Mutex::default(), wake: Arc::new(wake) });
        let (messages, inbox) = channel();
        let (theirs, to_itself) = (Arc::clone(&shared), messages.clone());
        let thread = std::thread::Builder::new().name("renderer".to_owned()).stack_size(8 << 20);
        let thread = thread.spawn(move || work(Session::new(source, theirs, to_itself), &inbox))?;
        Ok(Self { messages, sent: AtomicU64::new(0), shared, thread: Some(thread) })
    }

    /// Asks for something. What is being rendered is given up if it will not be wanted.
    pub fn send(&self, command: Command) {
        let outdates = command.outdates();
        self.sent.fetch_add(1, Ordering::Relaxed);
        // The thread ends by itself only with a fault, which `state` tells.
        let _ = self.messages.send(Message::Command(command));
        let mut busy = lock(&self.shared.busy);
        if let (Some(patience), Some(since)) = (outdates, busy.since)
            && since.elapsed() >= patience
        {
            busy.given_up.get_or_insert_with(Instant::now);
            busy.cancellation.cancel();
        }
    }

    /// Commands that were sent: all are done where [`State::taken`] is as large.
    #[must_use]
    pub fn sent(&self) -> u64 {
        self.sent.load(Ordering::Relaxed)
    }

    /// What there is to show.
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

/// The thread: takes what was asked for, does one step, and begins again.
fn work(mut session: Session, inbox: &Receiver<Message>) {
    loop {
        // First: what is asked for from here on may give up the step below, which is then done again.
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
