//! Chooses the passes that run and their attachments, by a walk from the last pass to the first that tracks which channels are
//! still needed.

use super::off::instead;
use super::settings::Constants;
use super::{Instead, Plan, PlanError, PlannedPass, Work, rectangle, view};
use crate::backend::{Attachments, LoadStore, Rect};
use crate::camera_programs::BLUE;
use crate::diagnostic::Decision;
use crate::glass::{Background, GlassRule, GlassShadow};
use crate::image::PixelFormat;
use crate::programs::{Fidelity, RayParams, RayProgram, TextureLod, Traces};
use crate::project::{ChannelRef, ComputePass, Pass, PassKind, QuadPass, QuadSource, RasterPass, RayPass, Viewport};
use glam::{Vec3, Vec4};
use std::collections::BTreeSet;

/// The channels that later passes need, at a point of the backward walk.
#[derive(Debug, Default)]
pub(super) struct Wanted {
    /// Channels that are read by later passes or shown.
    pub channels: BTreeSet<ChannelRef>,
    /// Those of [`Self::channels`] that are read in host memory.
    pub host: BTreeSet<ChannelRef>,
    /// Targets whose triangle ids are read.
    pub triangles: BTreeSet<usize>,
    /// Those of [`Self::triangles`] whose ids are read in host memory.
    pub host_triangles: BTreeSet<usize>,
    /// Channels that ray passes may read in place.
    pub traced: BTreeSet<ChannelRef>,
    /// Targets whose triangle ids ray passes may read in place.
    pub traced_triangles: BTreeSet<usize>,
    /// Targets (`None` for the window) whose depth a later pass loads instead of clearing it.
    pub depth: BTreeSet<Option<usize>>,
    /// Whether a later pass fills the whole window.
    window_filled: bool,
}

impl Plan {
    /// Chooses the passes that run, and the work of each.
    pub(super) fn choose_passes(
        &mut self,
        camera: Option<usize>,
        constants: &[Option<Constants>],
    ) -> Result<(), PlanError> {
        let shown: BTreeSet<ChannelRef> = self.shown.iter().copied().collect();
        let mut wanted = Wanted { channels: shown.clone(), host: shown, ..Wanted::default() };
        let passes = self.project.pipelines[self.pipeline].passes.clone();
        for (index, pass) in passes.iter().enumerate().rev() {
            let off = self.is_off(pass);
            let leaves = matches!(
                pass.kind,
                PassKind::Raster(_) | PassKind::Quad(_) | PassKind::Intersection(_) | PassKind::Compute(_)
            );
            if off && leaves {
                let why = "it is switched off, and leaves its target as it is";
                self.decide(format!("pass `{}`", pass.name), false, why.into());
                continue;
            }
            let written = self.channels_written(pass);
            let mut live = attachments(pass, written, &wanted.channels, &wanted.triangles);
            let stores = pass.kind.buffers_stored().any(|channel| wanted.channels.contains(&channel));
            // A pass that stores its depth for a later pass draws at least the first channel.
            let store_depth = matches!(pass.kind, PassKind::Raster(_)) && wanted.depth.contains(&pass.target);
            live.color |= stores || store_depth;
            let host = attachments(pass, written, &wanted.host, &wanted.host_triangles);
            let traced = attachments(pass, written, &wanted.traced, &wanted.traced_triangles);
            let colorless = matches!(&pass.kind, PassKind::Quad(quad) if !quad.writes_color);
            let unread = colorless.then_some("nothing reads what it stores");
            if let Some(reason) = unread.or_else(|| dead(pass, live, &wanted)).filter(|_| !stores) {
                self.decide(format!("pass `{}`", pass.name), false, reason.into());
                continue;
            }
            if let Some(scripted) = &pass.scripted {
                self.decide(format!("pass `{}`", pass.name), true, scripted.told.clone());
            }
            let viewport = self.viewport_of(pass, camera).cloned();
            let size = self.target_size(pass.target);
            let rect = rectangle(viewport.as_ref(), size);
            let fills = match &pass.kind {
                PassKind::Intersection(intersection) => intersection.fills(&self.project.targets[intersection.hits]),
                // A compute pass may store to a part of its target only.
                PassKind::Compute(_) => false,
                PassKind::Quad(quad) if !quad.writes_color => false,
                _ => rect == Rect { x: 0, y: 0, width: size[0], height: size[1] },
            };
            if Wanted::starts_over(pass) && (fills || matches!(pass.kind, PassKind::Ray(_) | PassKind::Effect(_))) {
                wanted.satisfied_by(pass, written);
            } else if !Wanted::starts_over(pass) {
                wanted.kept_by(pass, written);
            }
            wanted.depth_before(pass, fills);
            self.want_depth_channel(pass, live, &mut wanted);
            let work = match &pass.kind {
                PassKind::Ray(_) | PassKind::Effect(_) if off => self.off_work(pass, &mut wanted),
                PassKind::Raster(raster) => {
                    self.explain_attachments(pass, live);
                    self.check_shaders(pass, raster, live)?;
                    wanted.read_in_host(sampled(raster).chain(pass.kind.buffers_read()).collect());
                    // A buffer that the shader fills only in part keeps its other contents, so these are read too.
                    wanted.read_in_host(pass.kind.buffers_stored().collect());
                    self.hold_buffers(pass);
                    let camera = self.seen_from(camera, raster.camera);
                    let scenes = self.with_lines(pass, raster, camera, rect);
                    Work::Raster {
                        scene_set: self.scene_set(&scenes),
                        view: view(&self.project.cameras[camera], rect, self.origin),
                        viewport: rect,
                        clear_color: self.clear_color(pass, viewport.as_ref()),
                        attachments: live,
                        host,
                        traced: if pass.target.is_some() { traced } else { Attachments::default() },
                        load_store: LoadStore {
                            load_color: !pass.clears.color,
                            load_depth: !pass.clears.depth,
                            store_depth,
                        },
                    }
                }
                PassKind::Ray(ray) => {
                    let Some(Constants::Ray(params)) = constants[index] else {
                        unreachable!("every ray pass has its parameters")
                    };
                    let params = self.of_fidelity(pass, ray, params);
                    self.explain_camera_start(pass, (ray, &params), camera)?;
                    self.hold_buffers(pass);
                    let work = self.ray_work(&passes, index, params, camera, &mut wanted);
                    self.check_same_scenes(&passes[..index], pass, ray, &work)?;
                    work
                }
                PassKind::Effect(_) => {
                    let Some(Constants::Effect(params)) = constants[index] else {
                        unreachable!("every effect pass has its parameters")
                    };
                    self.effect_work(&passes, index, params, camera, &mut wanted)?
                }
                PassKind::Quad(quad) => {
                    wanted.read_in_host(sources(quad));
                    // A buffer that the shader fills only in part keeps its other contents, so these are read too.
                    wanted.read_in_host(pass.kind.buffers_stored().collect());
                    self.hold_buffers(pass);
                    if let Some(shader) = &quad.shader {
                        self.explain_shader(pass, shader);
                    }
                    Work::Quad { viewport: rect }
                }
                PassKind::Compute(ComputePass { shader, .. }) => {
                    wanted.read_in_host(shader.sampled().chain(shader.buffers_read()).collect());
                    wanted.read_in_host(shader.buffers_stored().collect());
                    self.hold_buffers(pass);
                    self.explain_shader(pass, shader);
                    Work::Compute
                }
                PassKind::Intersection(intersection) => {
                    let read: Vec<ChannelRef> = intersection.reads().collect();
                    read.iter().for_each(|channel| self.targets[channel.target].stored.color = true);
                    wanted.read_in_host(read);
                    Work::Intersection { scene_set: self.scene_set(&intersection.scenes) }
                }
            };
            if let Some(target) = pass.target {
                let stored = &mut self.targets[target].stored;
                *stored = stored.union(live);
            }
            self.passes.push(PlannedPass { pass: index, work });
        }
        self.hold_filled();
        self.passes.reverse();
        self.decisions.reverse();
        self.choose_kept()
    }

    /// Allocates the textures of random numbers that passes read. No pass need write them.
    fn hold_filled(&mut self) {
        let read = self.passes.iter().flat_map(|planned| self.access(planned).reads);
        let read: Vec<usize> = read.filter_map(|(target, _)| target).collect();
        for target in read.into_iter().filter(|target| self.project.targets[*target].contents.is_some()) {
            self.targets[target].stored.color = true;
        }
    }

    /// Allocates the buffers and images that a pass reads and stores to.
    fn hold_buffers(&mut self, pass: &Pass) {
        for channel in pass.kind.buffers_read().chain(pass.kind.buffers_stored()) {
            self.targets[channel.target].stored.color = true;
        }
    }

    /// The work of a pass that is switched off.
    fn off_work(&mut self, pass: &Pass, wanted: &mut Wanted) -> Work {
        let instead = instead(pass).expect("it writes something else");
        let why = match instead {
            Instead::Copy(channel) => {
                wanted.read_in_host(vec![channel]);
                "it is switched off: the colour that it reads is shown through"
            }
            Instead::Fill(_) => "it is switched off: nothing is in the way of the light",
        };
        self.decide(format!("pass `{}`", pass.name), false, why.into());
        Work::Off { instead }
    }

    /// A pass's parameters. In thesis fidelity they are reduced to what the report's programs support, such as panes and a light
    /// without a disc.
    fn of_fidelity(&mut self, pass: &Pass, ray: &RayPass, params: RayParams) -> RayParams {
        if self.settings.fidelity == Fidelity::Corrected {
            return params;
        }
        let mut leave_out = |asked: Option<String>, why: &str| {
            if let Some(asked) = asked {
                self.decide(format!("{asked} of pass `{}`", pass.name), false, why.to_owned());
            }
        };
        leave_out(ray.program.asks_of_glass(&params), "thesis fidelity has the report's panes");
        leave_out(ray.program.asks_of_sun(&params), "in thesis fidelity the light is a point");
        leave_out(ray.program.asks_of_filter(&params), "the report's programs filter nothing");
        let asked = ray.program.sampled_to(&params).map(|error| format!("error={error}"));
        leave_out(asked, "the report's panes leave nothing to chance");
        let asked = Some(ray.program.photons(&params)).filter(|photons| *photons > 0);
        leave_out(asked.map(|photons| format!("photons={photons}")), "the report's panes focus no light");
        let texture_lod = TextureLod::Zero;
        let (glass, background, shadow) = (GlassRule::Pane, Background::Black, GlassShadow::Report);
        RayParams { glass, background, shadow, error: 0.0, photons: 0, sun: 0.0, filter: 0, texture_lod, ..params }
    }

    /// Adds the decision which program runs for a pass whose rays start at the camera. Fails for an orthographic camera, which no program
    /// with rays from the camera supports.
    fn explain_camera_start(
        &mut self,
        pass: &Pass,
        (ray, params): (&RayPass, &RayParams),
        camera: Option<usize>,
    ) -> Result<(), PlanError> {
        let Some(start) = &ray.from_camera else { return Ok(()) };
        let camera = &self.project.cameras[camera.unwrap_or(ray.camera)];
        if camera.orthographic.is_some() {
            return Err(PlanError::new(
                format!(
                    "{}: rays of pass `{}` start at camera `{}`, which has no perspective",
                    pass.place, pass.name, camera.name
                ),
                "give the camera a perspective projection, or take another with --camera",
            ));
        }
        if !start.why.is_empty() {
            let what = format!("ray program `{}` for pass `{}`", ray.program.info().stem, pass.name);
            self.decide(what, true, start.why.clone());
        }
        let [width, depth] = [params.camera.light_width, params.camera.light_depth];
        if start.lamp && ray.program == RayProgram::PathTracing && (width == 0.0) != (depth == 0.0) {
            let why = format!(
                "lightwidth={width} with lightdepth={depth} is a line, which has no area and sends out no light"
            );
            self.decide(format!("light of pass `{}`", pass.name), false, why);
        }
        Ok(())
    }

    fn ray_work(
        &mut self,
        passes: &[Pass],
        index: usize,
        params: RayParams,
        camera: Option<usize>,
        wanted: &mut Wanted,
    ) -> Work {
        let PassKind::Ray(ray) = &passes[index].kind else { unreachable!("the caller looked") };
        let size = self.target_size(passes[index].target);
        let from_camera = ray.from_camera.is_some();
        let rect = match from_camera {
            // As in the report's engine, which launches over the whole target.
            true => Rect { x: 0, y: 0, width: size[0], height: size[1] },
            false => rectangle(self.viewport_of(&passes[index], camera), size),
        };
        let clear_of = match from_camera {
            true => passes[index].target,
            false => ray.position.map(|position| position.target),
        };
        let beyond = match params.background {
            Background::Black => Vec3::ZERO,
            Background::Clear => clear_of.map_or(Vec3::ZERO, |target| {
                self.display.space.of_display(self.project.targets[target].clear_color).truncate()
            }),
            Background::Blue => BLUE,
        };
        let reads_triangle =
            !from_camera && self.settings.fidelity == Fidelity::Corrected && ray.program.can_trace(&params);
        let channels = inputs(ray, &params);
        // Adaptive sampling hands the G-buffer to devices pixel by pixel.
        let resident = self.resident_target(passes, index, &channels, camera);
        let resident = resident.filter(|_| ray.program.sampled_to(&params).is_none());
        wanted.channels.extend(channels.iter().copied());
        let (read, triangles) = match resident {
            Some(_) => (&mut wanted.traced, &mut wanted.traced_triangles),
            None => (&mut wanted.host, &mut wanted.host_triangles),
        };
        read.extend(channels);
        if reads_triangle && let Some(position) = ray.position {
            wanted.triangles.insert(position.target);
            triangles.insert(position.target);
        }
        Work::Rays {
            scene_set: self.scene_set(&ray.scenes),
            view: view(&self.project.cameras[camera.unwrap_or(ray.camera)], rect, self.origin),
            viewport: rect,
            params,
            beyond,
            reads_triangle,
            resident,
        }
    }

    /// Fails if a ray pass reads triangle ids but traces other scenes than those drawn by the raster pass that wrote the ids.
    fn check_same_scenes(&self, earlier: &[Pass], pass: &Pass, ray: &RayPass, work: &Work) -> Result<(), PlanError> {
        let (Work::Rays { reads_triangle: true, .. }, Some(position)) = (work, ray.position) else { return Ok(()) };
        let mut drawing = earlier.iter().rev().filter(|earlier| !self.is_off(earlier));
        let drawn = drawing.find(|earlier| earlier.target == Some(position.target));
        match drawn {
            Some(Pass { kind: PassKind::Raster(raster), name, .. }) if raster.scenes != ray.scenes => {
                Err(PlanError::new(
                    format!("{}: pass `{}` traces other scenes than pass `{name}` drew", pass.place, pass.name),
                    "give both passes the same <scenes>, or use --fidelity thesis",
                ))
            }
            _ => Ok(()),
        }
    }

    fn explain_attachments(&mut self, pass: &Pass, written: Attachments) {
        let Some(target) = pass.target else { return };
        if written.triangle {
            self.decide(
                format!("triangle ids of pass `{}`", pass.name),
                true,
                "read later: they tell where rays start, and what is glass".into(),
            );
        }
        let flags = [written.color, written.position, written.normal];
        let target = &self.project.targets[target];
        let mut decisions = Vec::new();
        for (channel, built) in target.channels.iter().zip(flags).rev() {
            let what = format!("attachment `{}::{}` of pass `{}`", target.library, channel.name, pass.name);
            let why = match (built, channel.format) {
                (true, PixelFormat::Rgba16Float) => "read later, in 16-bit floats",
                (true, _) => "read later",
                (false, _) => "no pass reads it",
            };
            decisions.push(Decision { what, built, why: why.into() });
        }
        self.decisions.extend(decisions);
    }

    pub(super) fn decide(&mut self, what: String, built: bool, why: String) {
        self.decisions.push(Decision { what, built, why });
    }

    pub(super) fn scene_set(&mut self, scenes: &[usize]) -> usize {
        let found = self.scene_sets.iter().position(|set| set == scenes);
        found.unwrap_or_else(|| {
            self.scene_sets.push(scenes.to_vec());
            self.scene_sets.len() - 1
        })
    }

    /// The viewport into which a pass draws; `None` for all of its target. A pass with a render target fills the target, whatever
    /// viewport its camera has, unless the pass itself has a viewport: this is the rule of the report's engine.
    pub(super) fn viewport_of(&self, pass: &Pass, camera: Option<usize>) -> Option<&Viewport> {
        let camera = match (&pass.kind, pass.target) {
            (_, Some(_)) | (PassKind::Quad(_) | PassKind::Intersection(_) | PassKind::Compute(_), None) => None,
            (PassKind::Raster(raster), None) => Some(self.seen_from(camera, raster.camera)),
            (PassKind::Ray(ray), None) => Some(camera.unwrap_or(ray.camera)),
            (PassKind::Effect(effect), None) => Some(camera.unwrap_or(effect.camera)),
        };
        let from_camera = || camera.and_then(|camera| self.project.cameras[camera].viewport);
        pass.viewport.or_else(from_camera).map(|viewport| &self.project.viewports[viewport])
    }

    /// Number of channels of its target that a pass writes, counted from the first.
    fn channels_written(&self, pass: &Pass) -> usize {
        pass.target.map_or(0, |target| pass.kind.channels_of(&self.project.targets[target]))
    }

    /// The clear colour of a pass: that of its target, or in the window that of the viewport.
    fn clear_color(&self, pass: &Pass, viewport: Option<&Viewport>) -> Vec4 {
        let color = match pass.target {
            // A depth target is cleared to the far plane.
            Some(target) if self.project.targets[target].depth() == Some(0) => Vec4::ONE,
            Some(target) => self.project.targets[target].clear_color,
            None => viewport.map_or(Vec4::W, |viewport| viewport.clear_color),
        };
        self.display.space.of_display(color)
    }
}

impl Wanted {
    /// Adds channels that a pass reads in host memory.
    pub fn read_in_host(&mut self, channels: Vec<ChannelRef>) {
        self.channels.extend(channels.iter().copied());
        self.host.extend(channels);
    }

    /// Removes what a pass writes completely: earlier passes need not write it.
    fn satisfied_by(&mut self, pass: &Pass, written: usize) {
        match pass.target {
            None => self.window_filled = true,
            Some(target) => {
                for channels in [&mut self.channels, &mut self.host, &mut self.traced] {
                    channels.retain(|channel| channel.target != target || channel.channel >= written);
                }
                if matches!(pass.kind, PassKind::Raster(_)) {
                    self.triangles.remove(&target);
                    self.host_triangles.remove(&target);
                    self.traced_triangles.remove(&target);
                }
            }
        }
    }
}

/// The attachments of a pass's target that are in the given sets of channels and triangle ids. The window only has a colour.
fn attachments(
    pass: &Pass,
    written: usize,
    channels: &BTreeSet<ChannelRef>,
    triangles: &BTreeSet<usize>,
) -> Attachments {
    let Some(target) = pass.target else { return Attachments { color: true, ..Attachments::default() } };
    let raster = matches!(pass.kind, PassKind::Raster(_));
    let channel = |channel: usize| channel < written && channels.contains(&ChannelRef { target, channel });
    Attachments {
        color: channel(0),
        position: channel(1),
        normal: channel(2),
        triangle: raster && triangles.contains(&target),
    }
}

/// Why a pass need not run; `None` if it must run.
fn dead(pass: &Pass, live: Attachments, wanted: &Wanted) -> Option<&'static str> {
    if pass.target.is_none() {
        let leaves_depth = matches!(pass.kind, PassKind::Raster(_)) && wanted.depth.contains(&None);
        let unseen = wanted.window_filled && !leaves_depth;
        return unseen.then_some("a later pass fills the whole window");
    }
    (live == Attachments::default()).then_some("nothing reads what it writes")
}

/// The channels that a ray pass reads.
pub(super) fn inputs(ray: &RayPass, params: &RayParams) -> Vec<ChannelRef> {
    // With nothing to trace, a program of `Traces::Samples` writes a constant or the colour that it read.
    let idle = ray.program.info().traces == Traces::Samples && !ray.program.can_trace(params);
    let buffers = [("pos_buffer", ray.position), ("norm_buffer", ray.normal), ("color_buffer", ray.color)];
    let read = buffers.into_iter().filter(|(name, _)| ray.program.info().buffers.contains(name));
    read.filter(|(name, _)| !idle || *name == "color_buffer").filter_map(|(_, channel)| channel).collect()
}

/// The channels that the own shaders of a raster pass sample.
pub(super) fn sampled(raster: &RasterPass) -> impl Iterator<Item = ChannelRef> {
    raster.shaders.iter().flat_map(|map| map.shader.sampled())
}

/// The channels that a quad pass reads.
pub(super) fn sources(quad: &QuadPass) -> Vec<ChannelRef> {
    match quad.source {
        QuadSource::Show(channel) => vec![channel],
        QuadSource::Combine { color, factor } => vec![color, factor],
        QuadSource::Own => {
            quad.shader.iter().flat_map(|shader| shader.sampled().chain(shader.buffers_read())).collect()
        }
    }
}
