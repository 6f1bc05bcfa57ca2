//! What raster passes start from: passes that do not clear their target draw over what earlier passes left there.

use super::liveness::Wanted;
use super::{Plan, PlanError, PlannedPass, Work};
use crate::backend::{Attachments, LoadStore, Rect};
use crate::project::{ChannelRef, Pass, PassKind};

/// The contents that earlier passes left in the rectangle that a later pass draws.
enum Left {
    /// No earlier pass of the frame wrote into the rectangle.
    Nothing,
    /// The pass at this index of the plan wrote all of the rectangle.
    By(usize),
    /// The pass at this index of the plan wrote a part of the rectangle.
    PartBy(usize),
}

impl Plan {
    /// Decides for each raster pass that does not clear its target whether an earlier pass of the frame wrote the contents that the raster
    /// pass keeps. Contents that no pass wrote are cleared.
    pub(super) fn choose_kept(&mut self) -> Result<(), PlanError> {
        for index in 0..self.passes.len() {
            let planned = &self.passes[index];
            let (Work::Raster { load_store, attachments, .. }, pass) = (&planned.work, self.pass(planned)) else {
                continue;
            };
            let (asked, triangle, mut kept) = (*load_store, attachments.triangle, *load_store);
            let mut decisions = Vec::new();
            if asked.load_color {
                let left = self
                    .left_before(index, |pass| !matches!(pass.kind, PassKind::Intersection(_) | PassKind::Compute(_)));
                let from = self.whole(pass, "COLOR_CLEAR", &left)?;
                if triangle && from.is_some() {
                    self.check_triangles(pass, index)?;
                }
                kept.load_color = from.is_some();
                decisions.push((format!("colours under pass `{}`", pass.name), "COLOR_CLEAR", from));
            }
            if asked.load_depth {
                let clears = |pass: &Pass| match pass.kind {
                    PassKind::Raster(_) => true,
                    PassKind::Quad(_) => pass.clears.depth,
                    _ => false,
                };
                let left = self.left_before(index, clears);
                let from = self.whole(pass, "DEPTH_CLEAR", &left)?;
                // A quad that clears the depth leaves the far plane, as does clearing in this pass, so nothing need be loaded.
                let from = from.filter(|from| matches!(self.passes[*from].work, Work::Raster { .. }));
                kept.load_depth = from.is_some();
                decisions.push((format!("depth before pass `{}`", pass.name), "DEPTH_CLEAR", from));
            }
            for (what, name, from) in decisions {
                let why = match from {
                    Some(from) => format!("{name} is false: pass `{}` left it", self.pass(&self.passes[from]).name),
                    None => format!("{name} is false, and no earlier pass of the frame left anything: it is cleared"),
                };
                self.decide(what, from.is_some(), why);
            }
            if let Work::Raster { load_store, .. } = &mut self.passes[index].work {
                *load_store = LoadStore { store_depth: asked.store_depth, ..kept };
            }
        }
        Ok(())
    }

    /// Requires earlier passes to write the channel with the target's depth if `pass` keeps their depth and that channel is live.
    pub(super) fn want_depth_channel(&self, pass: &Pass, live: Attachments, wanted: &mut Wanted) {
        let (PassKind::Raster(_), Some(target), false) = (&pass.kind, pass.target, pass.clears.depth) else { return };
        let Some(channel) = self.project.targets[target].depth() else { return };
        let lives = [live.color, live.position, live.normal].get(channel).copied().unwrap_or_default();
        if lives {
            wanted.read_in_host(vec![ChannelRef { target, channel }]);
        }
    }

    /// Finds the last pass before `index` that writes where the pass at `index` draws. Only passes for which `counts` is true are
    /// considered.
    fn left_before(&self, index: usize, counts: impl Fn(&Pass) -> bool) -> Left {
        let own = self.pass(&self.passes[index]);
        let Rect { x, y, width, height } = self.drawn_by(&self.passes[index]);
        for (earlier, planned) in self.passes[..index].iter().enumerate().rev() {
            let pass = self.pass(planned);
            if pass.target != own.target || !counts(pass) {
                continue;
            }
            let other = self.drawn_by(planned);
            let apart = other.x + other.width <= x
                || x + width <= other.x
                || other.y + other.height <= y
                || y + height <= other.y;
            if apart {
                continue;
            }
            let whole = other.x <= x
                && other.y <= y
                && x + width <= other.x + other.width
                && y + height <= other.y + other.height;
            return if whole { Left::By(earlier) } else { Left::PartBy(earlier) };
        }
        Left::Nothing
    }

    /// The part of its target that a pass writes.
    pub(crate) fn drawn_by(&self, planned: &PlannedPass) -> Rect {
        match planned.work {
            Work::Raster { viewport, .. } | Work::Quad { viewport } => viewport,
            _ => {
                let [width, height] = self.target_size(self.pass(planned).target);
                Rect { x: 0, y: 0, width, height }
            }
        }
    }

    /// The pass that wrote everything that `pass` draws over; `None` if no pass wrote any of it. Fails if only a part was written.
    fn whole(&self, pass: &Pass, what: &str, left: &Left) -> Result<Option<usize>, PlanError> {
        match left {
            Left::Nothing => Ok(None),
            Left::By(index) => Ok(Some(*index)),
            Left::PartBy(index) => Err(PlanError::new(
                format!(
                    "{}: pass `{}` has {what} false, and pass `{}` wrote only a part of what it draws over",
                    pass.place,
                    pass.name,
                    self.pass(&self.passes[*index]).name
                ),
                format!("give both passes the same viewport, or {what} true"),
            )),
        }
    }

    /// Fails if a pass would keep triangle ids that an earlier pass wrote for triangles of other scenes.
    fn check_triangles(&self, pass: &Pass, index: usize) -> Result<(), PlanError> {
        let PassKind::Raster(raster) = &pass.kind else { return Ok(()) };
        for planned in self.passes[..index].iter().rev() {
            let under = self.pass(planned);
            let (Work::Raster { load_store, .. }, PassKind::Raster(other)) = (&planned.work, &under.kind) else {
                continue;
            };
            if under.target != pass.target {
                continue;
            }
            if other.scenes != raster.scenes {
                return Err(PlanError::new(
                    format!(
                        "{}: pass `{}` draws over what pass `{}` drew of other scenes, and a ray pass reads its triangle ids, which \
                         count the triangles of one list of scenes",
                        pass.place, pass.name, under.name
                    ),
                    "give both passes the same <scenes>, or use --fidelity thesis",
                ));
            }
            if !load_store.load_color {
                break;
            }
        }
        Ok(())
    }
}

impl Wanted {
    /// Requires earlier passes to write, in host memory, those wanted channels that `pass` keeps instead of clearing.
    pub(super) fn kept_by(&mut self, pass: &Pass, written: usize) {
        let Some(target) = pass.target else { return };
        let kept = |channel: &&ChannelRef| channel.target == target && channel.channel < written;
        self.host.extend(self.channels.iter().filter(kept));
        self.traced.retain(|channel| !kept(&channel));
        if self.triangles.contains(&target) {
            self.host_triangles.insert(target);
            self.traced_triangles.remove(&target);
        }
    }

    /// Updates the targets whose depth earlier passes must store. `fills` tells whether `pass` fills its target.
    pub(super) fn depth_before(&mut self, pass: &Pass, fills: bool) {
        if !matches!(pass.kind, PassKind::Raster(_) | PassKind::Quad(_)) {
            return;
        }
        if !pass.clears.depth && matches!(pass.kind, PassKind::Raster(_)) {
            self.depth.insert(pass.target);
        } else if pass.clears.depth && fills {
            self.depth.remove(&pass.target);
        }
    }

    /// Whether a pass replaces all earlier contents of its target where it writes. A quad's own shader may leave pixels unchanged.
    pub(super) fn starts_over(pass: &Pass) -> bool {
        match &pass.kind {
            PassKind::Raster(_) => pass.clears.color,
            PassKind::Quad(quad) => pass.clears.color || quad.shader.is_none(),
            _ => true,
        }
    }
}
