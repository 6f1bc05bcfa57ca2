//! Obtaining the two sides of a comparison, and comparing them.

use super::compare;
use super::far::{Job, Made, Source, Task};
use super::lock;
use super::picture::Picture;
use super::session::Session;
use super::side::{Obtained, On, Side, Times, What};
use std::sync::Arc;

impl Session {
    /// Changes the sides. A side that stays the same is not obtained again. Sides that are only swapped while no job runs are not obtained again
    /// either.
    pub fn set_sides(&mut self, sides: Option<[Side; 2]>) {
        if let (Some([left, right]), Some([now_left, now_right]), None) = (&self.sides, &sides, &self.job)
            && (left, right) == (now_right, now_left)
        {
            self.sides = sides;
            self.sides_due.swap(0, 1);
            self.compare_due = true;
            return self.shared.change(|state| {
                state.sides.swap(0, 1);
                (state.compared, state.incomparable) = (None, None);
            });
        }
        let same = |index: usize| match (&self.sides, &sides) {
            (Some(before), Some(now)) => before[index] == now[index],
            _ => false,
        };
        let same = [same(0), same(1)];
        if let Some(job) = self.job.as_ref().filter(|job| job.sides.iter().any(|side| !same[*side])) {
            job.give_up();
        }
        let some = sides.is_some();
        self.sides = sides;
        for (index, same) in same.into_iter().enumerate() {
            self.sides_due[index] = some && (self.sides_due[index] || !same);
        }
        self.compare_due = some;
        self.shared.change(|state| {
            for (side, _) in state.sides.iter_mut().zip(same).filter(|(_, same)| !same) {
                *side = Obtained::default();
            }
            (state.compared, state.incomparable) = (None, None);
        });
    }

    /// After a change of settings: rendered sides must be made again, and a thread that makes one is cancelled.
    pub fn sides_changed(&mut self) {
        self.renew_sides(|side| matches!(side, Side::Rendered { .. } | Side::Reference));
    }

    /// After a change of the shown output: sides that show it must be made again, and a thread that makes one is cancelled.
    pub fn looked_elsewhere(&mut self) {
        self.renew_sides(|side| matches!(side, Side::Rendered { what: What::Shown, .. }));
    }

    fn renew_sides(&mut self, which: impl Fn(&Side) -> bool) {
        let Some(sides) = &self.sides else { return };
        let renewed = [which(&sides[0]), which(&sides[1])];
        for (due, renewed) in self.sides_due.iter_mut().zip(renewed) {
            *due |= renewed;
        }
        self.compare_due = true;
        // Another renderer may take long to make its picture. Until the picture exists, the present metrics would belong to other settings.
        if sides.iter().zip(renewed).any(|(side, renewed)| renewed && side.is_far()) {
            self.shared.change(|state| (state.compared, state.incomparable) = (None, None));
        }
        if let Some(job) = self.job.as_ref().filter(|job| job.sides.iter().any(|side| renewed[*side])) {
            job.give_up();
        }
    }

    fn due(&self, far: bool) -> impl Iterator<Item = (usize, &Side)> {
        let sides = self.sides.iter().flatten().enumerate();
        sides.filter(move |(index, side)| self.sides_due[*index] && side.is_far() == far)
    }

    /// Whether a side is due that needs no other renderer.
    pub fn near_due(&self) -> bool {
        self.due(false).next().is_some()
    }

    /// Whether a thread should be started for a side that is due.
    pub fn far_due(&self) -> bool {
        self.job.is_none() && self.due(true).next().is_some()
    }

    /// Whether the time of a frame is compared with that of another renderer.
    pub fn compares_times(&self) -> bool {
        self.sides.iter().flatten().any(Side::is_far)
    }

    /// Outputs that must be in host memory: those named by the command line, the shown one, and those of sides by the window's engines.
    pub fn looked_at(&self) -> Vec<String> {
        let mut names = self.source.settings.show.clone();
        let of_sides = self.sides.iter().flatten().filter_map(|side| match side {
            Side::Rendered { what: What::Output(name), on: On::Here } => Some(name),
            _ => None,
        });
        for name in self.shown.iter().chain(of_sides) {
            if !names.contains(name) {
                names.push(name.clone());
            }
        }
        names
    }

    /// The result or an output by the window's engines. If a frame must write it first, makes that frame due and returns `None`.
    pub fn rendered(&mut self, what: &What) -> Result<Option<Arc<Picture>>, String> {
        let name = match what {
            What::Result => None,
            What::Shown => self.shown.clone(),
            What::Output(name) => Some(name.clone()),
        };
        let Some(name) = name else { return Ok(self.result.clone()) };
        let wanted = self.looked_at();
        let Some(renderer) = &mut self.renderer else { return Ok(None) };
        let channel = renderer.plan().channel_named(&name).map_err(|error| error.to_string())?;
        if renderer.holds(channel) {
            return Ok(Some(Arc::new(Picture::of_channel(name, renderer, channel))));
        }
        if renderer.settings().show == wanted {
            return Err(format!("`{name}` cannot be shown: nothing that runs writes it"));
        }
        renderer.set_shown(&wanted).map_err(|error| format!("`{name}` cannot be shown: {error}"))?;
        self.changed();
        Ok(None)
    }

    /// Obtains the sides that need no other renderer: those that are due and, if `again` is true, all that are rendered here.
    pub fn obtain_near(&mut self, again: bool) {
        let Some(sides) = self.sides.clone() else { return };
        for (index, side) in sides.iter().enumerate().filter(|(_, side)| !side.is_far()) {
            let is_rendered = matches!(side, Side::Rendered { .. });
            let due = std::mem::replace(&mut self.sides_due[index], false);
            if !due && (!again || !is_rendered) {
                continue;
            }
            let obtained = match side {
                Side::Rendered { what, .. } => self.rendered(what),
                Side::File(path) => match &self.renderer {
                    Some(renderer) => compare::read(path, renderer.plan().display).map(|read| Some(Arc::new(read))),
                    None => Ok(None),
                },
                Side::Kept(picture) => Ok(Some(Arc::clone(picture))),
                Side::Reference => continue,
            };
            let times = if is_rendered { self.times_of_frame() } else { None };
            match obtained {
                Ok(Some(picture)) => self.tell_side(index, Obtained { picture: Some(picture), times, missing: None }),
                // The frame that writes the output is due.
                Ok(None) => {}
                Err(why) => self.tell_side(index, Obtained::missing(why)),
            }
        }
    }

    /// Times of the last frame, if it had all samples and pixels.
    fn times_of_frame(&self) -> Option<Times> {
        let renderer = self.renderer.as_ref().filter(|_| self.times_are_whole)?;
        let plan = renderer.plan();
        let mut times = Times::default();
        for planned in &plan.passes {
            let steps = self.times.get(planned.pass).map(|times| &times.steps);
            steps.into_iter().flatten().for_each(|(kind, ms, _)| times.add(*kind, *ms));
        }
        Some(times)
    }

    /// Starts a thread for a side that another renderer makes; for both sides if they use the same engines.
    pub fn start_far(&mut self) {
        let Some(renderer) = &self.renderer else { return };
        let shown = || self.shown.clone().map_or(What::Result, What::Output);
        let due: Vec<(usize, Side)> = self.due(true).map(|(index, side)| (index, side.clone())).collect();
        let source = match &due[..] {
            [(index, Side::Reference), ..] => Source::Reference(*index),
            [(_, Side::Rendered { on: first, .. }), ..] => {
                let wanted = due.iter().filter_map(|(index, side)| match side {
                    Side::Rendered { what, on } if on == first => {
                        Some((*index, if *what == What::Shown { shown() } else { what.clone() }))
                    }
                    _ => None,
                });
                Source::Engines(*first, wanted.collect())
            }
            _ => return,
        };
        let task = Task {
            project: renderer.project().clone(),
            settings: renderer.settings().clone(),
            choice: self.choice,
            samples: self.accumulated.then(|| u32::try_from(self.samples).unwrap_or(u32::MAX)),
            source,
        };
        let sides = task.source.sides();
        match Job::start(task, Arc::clone(&self.shared), self.messages.clone()) {
            Ok(job) => self.job = Some(job),
            Err(error) => sides.into_iter().for_each(|side| {
                self.sides_due[side] = false;
                self.tell_side(side, Obtained::missing(format!("no thread can be started: {error}")));
            }),
        }
    }

    /// Takes the result of a thread that has ended.
    pub fn take_made(&mut self, made: Made) {
        // The results of a cancelled thread are dropped. Sides that are still due are made again.
        let Some(job) = self.job.take().filter(|job| !job.is_given_up()) else { return };
        for (side, obtained) in made.unwrap_or_default() {
            self.sides_due[side] = false;
            self.tell_side(side, obtained);
        }
        drop(job);
    }

    fn tell_side(&mut self, index: usize, obtained: Obtained) {
        self.compare_due = true;
        obtained.picture.iter().for_each(|picture| self.shared.put(picture));
        self.shared.change(|state| state.sides[index] = obtained);
    }

    /// Compares the two sides, once both exist at full resolution.
    pub fn compare(&mut self) {
        self.compare_due = false;
        let Some(renderer) = self.renderer.as_ref().filter(|_| self.sides_due == [false; 2]) else { return };
        let [left, right] = lock(&self.shared.state).sides.each_ref().map(|side| side.picture.clone());
        let (Some(left), Some(right)) = (left, right) else {
            return self.shared.change(|state| (state.compared, state.incomparable) = (None, None));
        };
        if left.is_reduced() || right.is_reduced() {
            return;
        }
        let compared = compare::compare(&left, &right, renderer.plan().display);
        compared.iter().for_each(|compared| self.shared.put(&compared.heat));
        self.shared.change(|state| match compared {
            Ok(compared) => (state.compared, state.incomparable) = (Some(Arc::new(compared)), None),
            Err(why) => (state.compared, state.incomparable) = (None, Some(why)),
        });
    }
}
