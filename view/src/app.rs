//! What is shown and asked for between two drawings of the window.

use crate::camera;
use crate::canvas::Canvas;
use crate::texture::Slot;
use crate::theme::style;
use crate::worker::{Activity, Available, Command, Facts, Picture, Side, State, Worker};
use curitiba::pipeline::project::Pose;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// How long a notice stays.
const NOTICE: Duration = Duration::from_secs(3);

/// How two pictures are shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// The first left of a line, the other right of it.
    #[default]
    Wipe,
    /// One after the other.
    Flicker,
    /// Where they differ.
    Difference,
}

/// An output that a row of the table stands for; `None` for the result.
pub(crate) type Output = Option<String>;

/// The whole window.
pub struct App {
    /// The renderer's thread.
    pub worker: Worker,
    /// What it told last.
    pub state: State,
    /// Where the picture lies.
    pub canvas: Canvas,
    /// The output that was clicked.
    pub pinned: Option<Output>,
    /// The output whose row the pointer is over.
    pub hovered: Option<Output>,
    /// What the thread was asked to show last.
    pub(crate) asked: Output,
    /// The pass whose times are marked, by index.
    pub(crate) marked: Option<usize>,
    /// The same of the drawing before: rows and graph mark each other.
    pub(crate) was_marked: Option<usize>,
    /// How two pictures are shown.
    pub mode: Mode,
    /// Where the line of [`Mode::Wipe`] is, as a share of the picture's width.
    pub wipe: f32,
    /// Whether that line is dragged.
    pub(crate) holds_line: bool,
    /// The left side of a comparison.
    pub left: Side,
    /// The right side, the reference; nothing is compared without.
    pub right: Option<Side>,
    /// A file to compare with, as it is typed.
    pub(crate) reference: String,
    /// A picture that was kept.
    pub(crate) kept: Option<Arc<Picture>>,
    /// Whether more samples are taken at rest.
    pub refine: bool,
    /// Whether nothing is rendered.
    pub paused: bool,
    /// Where the camera stands while it is moved.
    pub(crate) pose: Option<Pose>,
    /// How fast it flies, a second, as a share of the scene's radius.
    pub speed: f32,
    /// The pixel under the pointer.
    pub(crate) pointed: Option<[u32; 2]>,
    /// The pixel whose rays are shown.
    pub picked: Option<[u32; 2]>,
    /// Whether keys are explained.
    pub help: bool,
    /// Whether warnings are listed.
    pub list_warnings: bool,
    pub(crate) shown: Slot,
    pub(crate) against: Slot,
    pub(crate) heat: Slot,
    available: Option<Arc<OnceLock<Available>>>,
    /// What was just done, and until when that is said, seconds of the window's clock.
    pub(crate) notice: Option<(String, f64)>,
    /// Drawings with a picture in them.
    pub drawn: u32,
    /// What laying out the window took last, milliseconds: no pass is rendered there.
    pub drawing_ms: f32,
}

impl App {
    /// A window on what a thread renders, which may have begun before there was a window.
    pub fn new(context: &egui::Context, worker: Worker, reference: Option<PathBuf>) -> Self {
        style(context);
        let mut app = Self {
            worker,
            state: State::default(),
            canvas: Canvas::default(),
            pinned: None,
            hovered: None,
            asked: None,
            marked: None,
            was_marked: None,
            mode: Mode::default(),
            wipe: 0.5,
            holds_line: false,
            left: Side::SHOWN,
            right: None,
            reference: reference.as_ref().map_or(String::new(), |path| path.display().to_string()),
            kept: None,
            refine: true,
            paused: false,
            pose: None,
            speed: 0.5,
            pointed: None,
            picked: None,
            help: false,
            list_warnings: true,
            shown: Slot::default(),
            against: Slot::default(),
            heat: Slot::default(),
            available: None,
            notice: None,
            drawn: 0,
            drawing_ms: 0.0,
        };
        if let Some(path) = reference {
            app.compare_with(Some(Side::File(path)));
        }
        app
    }

    /// Lets the thread show what is hovered or pinned.
    pub(crate) fn ask_for_output(&mut self) {
        let wanted = self.hovered.clone().or_else(|| self.pinned.clone()).flatten();
        if wanted != self.asked {
            self.asked.clone_from(&wanted);
            self.worker.send(Command::Show(wanted));
        }
    }

    /// Compares the left side with something else from now on; nothing any more, if `None`.
    pub fn compare_with(&mut self, right: Option<Side>) {
        self.compare(self.left.clone(), right);
    }

    /// Compares these from now on.
    pub fn compare(&mut self, left: Side, right: Option<Side>) {
        (self.left, self.right) = (left, right);
        let sides = self.right.clone().map(|right| Box::new([self.left.clone(), right]));
        self.worker.send(Command::Compare(sides));
    }

    /// Both pictures of a comparison, once they are there and of one size.
    #[must_use]
    pub fn compared(&self) -> Option<[Arc<Picture>; 2]> {
        self.right.as_ref()?;
        let [left, right] = self.state.sides.each_ref().map(|side| side.picture.clone());
        let (left, right) = (left?, right?);
        (left.whole == right.whole).then_some([left, right])
    }

    /// The picture whose pixels lie under the pointer: the left one of a comparison.
    #[must_use]
    pub fn seen(&self) -> Option<Arc<Picture>> {
        match self.compared() {
            Some([left, _]) => Some(left),
            None => self.state.picture.clone(),
        }
    }

    /// Looks into a pixel of what is rendered here from now on.
    pub fn pick(&mut self, pixel: Option<[u32; 2]>) {
        let sizes = [self.seen(), self.state.picture.clone()].map(|picture| picture.map(|picture| picture.whole));
        if pixel.is_some() && sizes[0] != sizes[1] {
            self.state.error =
                Some("a picture of another size is shown: rays are of the pixels that are rendered".to_owned());
            return;
        }
        self.picked = pixel;
        self.worker.send(Command::Pixel(pixel));
    }

    /// Moves the camera by a function of where it stands.
    pub fn move_camera(&mut self, facts: Option<&Facts>, to: impl FnOnce(&Pose, &camera::Bounds) -> Pose) {
        let Some((pose, bounds)) = facts.and_then(|facts| Some((facts.pose?, facts.bounds?))) else { return };
        let pose = to(&self.pose.unwrap_or(pose), &bounds);
        self.pose = Some(pose);
        self.worker.send(Command::Move(pose));
    }

    /// Which engines are there, once that is known.
    pub(crate) fn available(&self) -> Option<Available> {
        self.available.as_ref()?.get().cloned()
    }

    /// Whether it is known which engines are there.
    #[must_use]
    pub fn knows_engines(&self) -> bool {
        self.available.as_ref().is_some_and(|available| available.get().is_some())
    }

    /// Looks for engines, once: not before the first picture, which needs the processor's time.
    pub(crate) fn look_for_engines(&mut self, context: &egui::Context) {
        if self.available.is_some() || (self.state.picture.is_none() && self.state.activity != Activity::Failed) {
            return;
        }
        let (found, told) = (Arc::new(OnceLock::new()), context.clone());
        self.available = Some(Arc::clone(&found));
        let look = move || {
            // Nobody else sets it.
            let _ = found.set(Available::look());
            told.request_repaint();
        };
        if let Err(error) = std::thread::Builder::new().name("devices".to_owned()).spawn(look) {
            self.notify(context, format!("engines are not looked for: no thread can be started ({error})"));
        }
    }

    /// Says something for a moment.
    pub(crate) fn notify(&mut self, context: &egui::Context, text: String) {
        self.notice = Some((text, context.input(|input| input.time) + NOTICE.as_secs_f64()));
        context.request_repaint_after(NOTICE);
    }

    /// Keeps what is shown and compares with it; not while the camera moves, where it may have fewer pixels.
    pub(crate) fn keep(&mut self, context: &egui::Context) {
        let Some(picture) = self.state.picture.clone() else { return };
        if picture.is_reduced() {
            return self.notify(context, "the picture is not whole: keep it when the camera rests".to_owned());
        }
        self.kept = Some(Arc::clone(&picture));
        self.compare_with(Some(Side::Kept(picture)));
    }

    /// Where a picture is saved: a name that is not taken yet.
    pub(crate) fn new_file(facts: &Facts) -> PathBuf {
        let stem = facts.source.file_stem().map_or_else(|| "picture".into(), |stem| stem.to_owned());
        let name = |number: u32| PathBuf::from(format!("{}-{number}", stem.display()));
        let free = |path: &PathBuf| ["png", "exr", "json"].iter().all(|end| !path.with_extension(end).exists());
        (1..10_000).map(name).find(free).unwrap_or_else(|| name(10_000))
    }
}
