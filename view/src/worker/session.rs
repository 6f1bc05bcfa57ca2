//! State of the renderer's thread: the requests in force, and the pending work.

use super::facts::{Facts, PassTimes, camera_in_use};
use super::far::Job;
use super::history::History;
use super::pace::Pace;
use super::picture::Picture;
use super::save::{self, Taken};
use super::side::Side;
use super::watch::{PERIOD, Watch};
use super::{Activity, Command, Message, Shared, Source, lock};
use crate::camera::Bounds;
use curitiba::Choice;
use curitiba::pipeline::executor::{Accumulation, ChangeError, Renderer};
use curitiba::pipeline::project::Pose;
use std::sync::Arc;
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

/// The camera rests after this time without a move.
const REST: Duration = Duration::from_millis(150);

/// State of the renderer's thread.
pub(super) struct Session {
    pub source: Source,
    pub shared: Arc<Shared>,
    /// Sends messages to the renderer's thread; the threads that it starts get clones.
    pub messages: Sender<Message>,
    pub renderer: Option<Renderer>,
    pub choice: Choice,
    /// Names and poses of the cameras that were moved.
    pub poses: Vec<(String, Pose)>,
    pub bounds: Option<Bounds>,
    /// Addresses of the scenes around which `bounds` was computed.
    pub scenes: Vec<usize>,
    pub watch: Watch,
    /// Times of the passes, in the order of the pipeline.
    pub times: Vec<PassTimes>,
    /// Whether `times` are of a frame with all samples and pixels.
    pub times_are_whole: bool,
    pub history: History,
    /// The window's picture.
    pub result: Option<Arc<Picture>>,
    /// Samples per point of `result`: the number that the passes were set to, or that were accumulated.
    pub samples: u64,
    pub accumulated: bool,
    pub accumulation: Option<Accumulation>,
    /// When the camera last moved; `None` once it rests.
    pub moved: Option<Instant>,
    pub pace: Pace,
    /// The output that is shown; `None` for the result.
    pub shown: Option<String>,
    pub pixel: Option<[u32; 2]>,
    /// The sides of the comparison.
    pub sides: Option<[Side; 2]>,
    /// Which of the sides must be obtained.
    pub sides_due: [bool; 2],
    /// The thread that makes sides with another renderer.
    pub job: Option<Job>,
    pub refine: bool,
    pub paused: bool,
    // Pending work.
    pub opening: bool,
    pub pose: Option<Pose>,
    pub frame_due: bool,
    pub show_due: bool,
    pub pixel_due: bool,
    pub compare_due: bool,
    pub refine_due: bool,
}

impl Session {
    pub fn new(source: Source, shared: Arc<Shared>, messages: Sender<Message>) -> Self {
        let choice = source.choice;
        Self {
            source,
            shared,
            messages,
            renderer: None,
            choice,
            poses: Vec::new(),
            bounds: None,
            scenes: Vec::new(),
            watch: Watch::default(),
            times: Vec::new(),
            times_are_whole: false,
            history: History::default(),
            result: None,
            samples: 0,
            accumulated: false,
            accumulation: None,
            moved: None,
            pace: Pace::default(),
            shown: None,
            pixel: None,
            sides: None,
            sides_due: [false; 2],
            job: None,
            refine: true,
            paused: false,
            opening: true,
            pose: None,
            frame_due: false,
            show_due: false,
            pixel_due: false,
            compare_due: false,
            refine_due: false,
        }
    }

    /// Begins a step: clears an earlier cancellation.
    pub fn begin(&mut self) {
        let mut busy = lock(&self.shared.busy);
        busy.since = None;
        busy.cancellation.reset();
        if let Some(given_up) = busy.given_up.take() {
            drop(busy);
            lock(&self.shared.state).gave_up_after = Some(given_up.elapsed());
        }
    }

    /// How long to wait for commands; `None` for no limit.
    pub fn patience(&self) -> Option<Duration> {
        let idle = self.source.watch.then_some(PERIOD);
        if self.opening {
            return Some(Duration::ZERO);
        }
        if self.paused || self.renderer.is_none() {
            return idle;
        }
        let sides_due = self.near_due() || self.far_due();
        let due = [self.frame_due, self.show_due, self.pixel_due, sides_due, self.compare_due, self.refine_due];
        if self.pose.is_some() || (self.moved.is_none() && due.contains(&true)) {
            return Some(Duration::ZERO);
        }
        self.moved.map(|moved| REST.saturating_sub(moved.elapsed())).or(idle)
    }

    /// Whether the camera moved and has rested for [`REST`] since; false once the move has been ended.
    pub fn rested(&self) -> bool {
        self.moved.is_some_and(|moved| moved.elapsed() >= REST)
    }

    /// Handles a command.
    pub fn take(&mut self, command: Command) {
        let result = match command {
            Command::Camera(name) => self.set(|renderer| renderer.set_camera(name.as_deref())),
            Command::Parameter { pass, name, value } => {
                self.set(|renderer| renderer.set_parameter(&pass, &name, &value))
            }
            Command::Enable { pass, on } => self.set(|renderer| renderer.set_enabled(&pass, on)),
            Command::Move(pose) => {
                self.pose = Some(pose);
                Ok(())
            }
            Command::Engines(choice) => {
                self.stop_moving();
                self.change_engines(choice)
            }
            Command::Reload => self.reload(),
            Command::Save(path) => self.save(&path),
            Command::Show(name) => {
                (self.shown, self.show_due) = (name, true);
                return self.looked_elsewhere();
            }
            Command::Pixel(pixel) => return self.set_pixel(pixel),
            Command::Compare(sides) => return self.set_sides(sides.map(|sides| *sides)),
            Command::Refine(refine) => {
                self.refine = refine;
                self.refine_due = refine;
                // Without refinement, the picture is the one that `render` writes.
                if !refine && self.accumulated {
                    self.changed();
                }
                return;
            }
            Command::Pause(paused) => {
                self.paused = paused;
                return;
            }
            Command::Quit => return,
        };
        self.shared.change(|state| state.error = result.err());
    }

    /// Changes a setting of the renderer, which then has to render again.
    fn set(&mut self, set: impl FnOnce(&mut Renderer) -> Result<(), ChangeError>) -> Result<(), String> {
        self.stop_moving();
        self.look_away();
        let Some(renderer) = &mut self.renderer else { return Ok(()) };
        set(renderer).map_err(|error| error.to_string())?;
        self.changed();
        Ok(())
    }

    /// If the result is shown: stops writing outputs that were written only because they were shown before.
    pub fn look_away(&mut self) {
        let wanted = self.looked_at();
        let Some(renderer) = self.renderer.as_mut().filter(|_| self.shown.is_none()) else { return };
        if renderer.settings().show == wanted {
            return;
        }
        match renderer.set_shown(&wanted) {
            // The renderer has a new setting, whether or not the command that follows is refused.
            Ok(()) => self.changed(),
            Err(error) => self.shared.change(|state| state.error = Some(error.to_string())),
        }
    }

    /// Marks the picture as outdated: the settings have changed.
    pub fn changed(&mut self) {
        (self.frame_due, self.refine_due) = (true, self.refine);
        self.pixel_due = self.pixel.is_some();
        self.accumulation = None;
        self.sides_changed();
    }

    fn reload(&mut self) -> Result<(), String> {
        self.stop_moving();
        self.watch.remember(&self.source.path);
        let Some(renderer) = &mut self.renderer else {
            self.opening = true;
            return Ok(());
        };
        renderer.reload().map_err(|error| error.to_string())?;
        self.shared.change(|state| state.told = Some("the files were read again".to_owned()));
        self.times.clear();
        self.times_are_whole = false;
        self.changed();
        Ok(())
    }

    fn save(&mut self, path: &std::path::Path) -> Result<(), String> {
        let Some(renderer) = &mut self.renderer else { return Err("there is no picture yet".to_owned()) };
        if self.frame_due || self.moved.is_some() || self.result.as_ref().is_some_and(|result| result.is_reduced()) {
            return Err("the picture is not finished: save it when the camera rests".to_owned());
        }
        let camera = camera_in_use(renderer);
        let moved = self.poses.iter().any(|(name, _)| *name == camera);
        let taken = Taken::new(camera, moved, self.accumulated.then_some(self.samples), self.choice);
        let files = save::save(renderer, path, &taken)?;
        let names: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
        self.shared.change(|state| state.told = Some(format!("wrote {}", names.join(", "))));
        Ok(())
    }

    fn set_pixel(&mut self, pixel: Option<[u32; 2]>) {
        (self.pixel, self.pixel_due) = (pixel, pixel.is_some());
        if pixel.is_none() {
            self.shared.change(|state| state.pixel = None);
        }
    }

    /// Sends the facts to the window.
    pub fn tell_facts(&mut self) {
        let Some(renderer) = &self.renderer else { return };
        let facts = Arc::new(Facts::of(renderer, self.choice, &self.times, self.bounds));
        self.shared.change(|state| state.facts = Some(facts));
    }

    /// Adds to the number of commands that were taken.
    pub fn tell_taken(&self, count: u64) {
        if count > 0 {
            self.shared.change(|state| state.taken += count);
        }
    }

    /// Sends the activity to the window, if it changed.
    pub fn tell_activity(&self, activity: Activity) {
        if lock(&self.shared.state).activity != activity {
            self.shared.change(|state| state.activity = activity);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use curitiba::pipeline::plan::Settings;
    use std::path::Path;
    use std::sync::mpsc::channel;
    use std::sync::{Mutex, OnceLock};

    /// A session of a project in `xml_projects`. The test does its steps, and no thread.
    fn session(project: &str, set: &str) -> Session {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../xml_projects").join(project);
        let settings = Settings { size: Some([16, 16]), set: vec![set.to_owned()], ..Settings::default() };
        let source = Source { path, settings, choice: Choice::CPU, watch: false };
        let (state, busy) = (Mutex::default(), Mutex::default());
        let shared = Shared { state, busy, device: OnceLock::new(), wake: Arc::new(|| {}) };
        Session::new(source, Arc::new(shared), channel().0)
    }

    /// Does steps until a condition holds.
    #[track_caller]
    fn until(session: &mut Session, holds: impl Fn(&Session) -> bool) {
        for _ in 0..1000 {
            if holds(session) {
                return;
            }
            session.begin();
            session.step();
        }
        panic!("too many steps: {:?}", error(session));
    }

    /// Does steps until nothing is left to do.
    #[track_caller]
    fn rest(session: &mut Session) {
        until(session, |session| session.patience() != Some(Duration::ZERO));
    }

    fn error(session: &Session) -> Option<String> {
        lock(&session.shared.state).error.clone()
    }

    fn samples(session: &Session) -> Option<u64> {
        lock(&session.shared.state).refinement.as_ref().map(|refinement| refinement.samples)
    }

    #[test]
    fn a_refused_setting_is_told_and_samples_are_taken_further() {
        let mut session = session("SceneShadows.xml", "pass2.sun=2");
        let written = |session: &Session| session.renderer.as_ref().expect("it is open").settings().show.clone();
        session.take(Command::Show(Some("norm".to_owned())));
        until(&mut session, |session| session.accumulation.is_some());
        assert_eq!(written(&session), ["norm"], "control: no pass reads it");
        session.take(Command::Show(None));
        until(&mut session, |session| !session.show_due);
        assert!(session.refine_due && samples(&session) < Some(256), "control: samples are being taken");
        // The output is no longer written, and the setting is refused.
        let [pass, name, value] = ["pass2", "sun", "wide"].map(str::to_owned);
        session.take(Command::Parameter { pass, name, value });
        let refused = error(&session);
        assert!(refused.is_some() && written(&session).is_empty(), "{refused:?}");
        rest(&mut session);
        assert_eq!((error(&session), samples(&session)), (refused, Some(256)));
    }

    #[test]
    fn refinement_that_has_ended_is_asked_for_again() {
        let mut session = session("SceneSSAO.xml", "pass2.samples=256");
        rest(&mut session);
        assert_eq!(samples(&session), Some(256));
        for refine in [false, true] {
            session.take(Command::Refine(refine));
            rest(&mut session);
        }
        assert_eq!((error(&session), samples(&session)), (None, Some(256)));
    }
}
