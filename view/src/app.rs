//! State of the window between two frames: what it shows, and what it has requested from the renderer's thread.

use crate::camera;
use crate::canvas::Canvas;
use crate::texture::Device;
use crate::theme::style;
use crate::worker::{Activity, Available, Command, Facts, Picture, Side, State, Worker};
use curitiba::pipeline::project::Pose;
use eframe::egui_wgpu::RenderState;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// How long a message about the last action stays.
const NOTICE: Duration = Duration::from_secs(3);

/// How two pictures are shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// The first picture is left of a line, the second right of it.
    #[default]
    Wipe,
    /// The two pictures alternate.
    Flicker,
    /// A map of the differences of the two pictures.
    Difference,
}

/// The output that a row of the table shows; `None` for the result.
pub(crate) type Output = Option<String>;

/// The whole window.
pub struct App {
    /// The renderer's thread.
    pub worker: Worker,
    /// The thread's last state. It keeps its pictures alive while the window is drawn, so that their textures are not reused for other pictures.
    pub state: State,
    /// Zoom and position of the picture.
    pub canvas: Canvas,
    /// The output that a click or a key pinned; `None` if none is pinned.
    pub pinned: Option<Output>,
    /// The output whose row the pointer is over; `None` if it is over no row.
    pub hovered: Option<Output>,
    /// The output that the thread was last asked to show.
    pub(crate) asked: Output,
    /// Index of the pass whose times are highlighted.
    pub(crate) marked: Option<usize>,
    /// [`Self::marked`] of the frame before: the table and the graph highlight each other's pass.
    pub(crate) was_marked: Option<usize>,
    /// How two pictures are shown.
    pub mode: Mode,
    /// Where the line of [`Mode::Wipe`] is, as a share of the picture's width.
    pub wipe: f32,
    /// Whether the line of [`Mode::Wipe`] is dragged.
    pub(crate) holds_line: bool,
    /// The left side of a comparison.
    pub left: Side,
    /// The right side, the reference; `None` if nothing is compared.
    pub right: Option<Side>,
    /// The text field with the path of a picture to compare with.
    pub(crate) reference: String,
    /// The picture that was kept for comparison.
    pub(crate) kept: Option<Arc<Picture>>,
    /// Whether more samples are accumulated while nothing changes.
    pub refine: bool,
    /// Whether rendering is paused.
    pub paused: bool,
    /// The camera's pose while it is moved; `None` at rest, when [`Facts::pose`] is in force.
    pub(crate) pose: Option<Pose>,
    /// Distance flown per second, as a share of the scene's radius.
    pub speed: f32,
    /// The pixel under the pointer.
    pub(crate) pointed: Option<[u32; 2]>,
    /// The pixel whose rays are shown.
    pub picked: Option<[u32; 2]>,
    /// Whether the list of keys is open.
    pub help: bool,
    /// Whether warnings are listed.
    pub list_warnings: bool,
    /// The device that draws the window; `None` if the window is only laid out.
    pub(crate) device: Option<Device>,
    available: Option<Arc<OnceLock<Available>>>,
    /// The message about the last action, and when it disappears, in seconds of the window's clock.
    pub(crate) notice: Option<(String, f64)>,
    /// Number of frames of the window that showed a picture.
    pub drawn: u32,
    /// Time to lay out the last frame of the window, milliseconds. Passes are not rendered on this thread.
    pub drawing_ms: f32,
}

impl App {
    /// A window for the pictures of `worker`, whose thread may have started before the window existed. From now on this thread uploads its pictures
    /// to the device of `drawing`. Without a device the window can be laid out, but shows no pictures.
    pub fn new(
        context: &egui::Context,
        drawing: Option<&RenderState>,
        worker: Worker,
        reference: Option<PathBuf>,
    ) -> Self {
        style(context);
        let device = drawing.map(Device::new);
        if let Some(device) = &device {
            worker.draw_on(device.clone());
        }
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
            device,
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

    /// Requests from the thread the output that is hovered or pinned.
    pub(crate) fn ask_for_output(&mut self) {
        let wanted = self.hovered.clone().or_else(|| self.pinned.clone()).flatten();
        if wanted != self.asked {
            self.asked.clone_from(&wanted);
            self.worker.send(Command::Show(wanted));
        }
    }

    /// Compares the left side with `right` from now on; `None` ends the comparison.
    pub fn compare_with(&mut self, right: Option<Side>) {
        self.compare(self.left.clone(), right);
    }

    /// Compares these two sides from now on; `None` ends the comparison.
    pub fn compare(&mut self, left: Side, right: Option<Side>) {
        (self.left, self.right) = (left, right);
        let sides = self.right.clone().map(|right| Box::new([self.left.clone(), right]));
        self.worker.send(Command::Compare(sides));
    }

    /// Both pictures of a comparison, once both exist and if they have the same size.
    #[must_use]
    pub fn compared(&self) -> Option<[Arc<Picture>; 2]> {
        self.right.as_ref()?;
        let [left, right] = self.state.sides.each_ref().map(|side| side.picture.clone());
        let (left, right) = (left?, right?);
        (left.whole == right.whole).then_some([left, right])
    }

    /// The picture whose pixels lie under the pointer: the left one of a comparison, otherwise the rendered one.
    #[must_use]
    pub fn seen(&self) -> Option<Arc<Picture>> {
        match self.compared() {
            Some([left, _]) => Some(left),
            None => self.state.picture.clone(),
        }
    }

    /// Requests the rays of a pixel of the rendered picture from the renderer's thread; with `None`, rays are no longer shown.
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

    /// Moves the camera to the pose that a function returns for its present pose.
    pub fn move_camera(&mut self, facts: Option<&Facts>, to: impl FnOnce(&Pose, &camera::Bounds) -> Pose) {
        let Some((pose, bounds)) = facts.and_then(|facts| Some((facts.pose?, facts.bounds?))) else { return };
        let pose = to(&self.pose.unwrap_or(pose), &bounds);
        self.pose = Some(pose);
        self.worker.send(Command::Move(pose));
    }

    /// The available engines, once they are known.
    pub(crate) fn available(&self) -> Option<Available> {
        self.available.as_ref()?.get().cloned()
    }

    /// Whether the available engines are known.
    #[must_use]
    pub fn knows_engines(&self) -> bool {
        self.available.as_ref().is_some_and(|available| available.get().is_some())
    }

    /// Looks for engines, once. The search waits for the first picture or a failure, so that it takes no processor time from rendering.
    pub(crate) fn look_for_engines(&mut self, context: &egui::Context) {
        if self.available.is_some() || (self.state.picture.is_none() && self.state.activity != Activity::Failed) {
            return;
        }
        let (found, told) = (Arc::new(OnceLock::new()), context.clone());
        self.available = Some(Arc::clone(&found));
        let look = move || {
            // Only this thread sets it, so setting it cannot fail.
            let _ = found.set(Available::look());
            told.request_repaint();
        };
        if let Err(error) = std::thread::Builder::new().name("devices".to_owned()).spawn(look) {
            self.notify(context, format!("engines are not looked for: no thread can be started ({error})"));
        }
    }

    /// Shows a message for a moment.
    pub(crate) fn notify(&mut self, context: &egui::Context, text: String) {
        self.notice = Some((text, context.input(|input| input.time) + NOTICE.as_secs_f64()));
        context.request_repaint_after(NOTICE);
    }

    /// Keeps the shown picture and compares with it. Refused if the picture has fewer pixels, as it may while the camera moves.
    pub(crate) fn keep(&mut self, context: &egui::Context) {
        let Some(picture) = self.state.picture.clone() else { return };
        if picture.is_reduced() {
            return self.notify(context, "the picture is not whole: keep it when the camera rests".to_owned());
        }
        self.kept = Some(Arc::clone(&picture));
        self.compare_with(Some(Side::Kept(picture)));
    }

    /// Path for saving a picture: the first numbered name that no PNG, EXR or JSON file has yet; number 10 000 if all are taken.
    pub(crate) fn new_file(facts: &Facts) -> PathBuf {
        let stem = facts.source.file_stem().map_or_else(|| "picture".into(), |stem| stem.to_owned());
        let name = |number: u32| PathBuf::from(format!("{}-{number}", stem.display()));
        let free = |path: &PathBuf| ["png", "exr", "json"].iter().all(|end| !path.with_extension(end).exists());
        (1..10_000).map(name).find(free).unwrap_or_else(|| name(10_000))
    }
}
