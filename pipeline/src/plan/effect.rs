//! Effect passes in the plan: which G-buffer they read, and where it lies.

use super::liveness::Wanted;
use super::{Plan, PlanError, PlannedPass, Work, rectangle, view};
use crate::backend::Rect;
use crate::image::PixelFormat;
use crate::programs::{Fidelity, RayParams, RayProgram};
use crate::project::{ChannelRef, EffectPass, MaterialPattern, Pass, PassKind, RasterPass};
use crate::raster_effects::EffectParams;

/// The raster pass that drew a G-buffer.
struct Source<'a> {
    index: usize,
    pass: &'a Pass,
    raster: &'a RasterPass,
}

impl Plan {
    /// Plans the effect pass at `passes[index]`.
    pub(super) fn effect_work(
        &mut self,
        passes: &[Pass],
        index: usize,
        params: EffectParams,
        camera: Option<usize>,
        wanted: &mut Wanted,
    ) -> Result<Work, PlanError> {
        let pass = &passes[index];
        let PassKind::Effect(effect) = &pass.kind else { unreachable!("the caller looked") };
        let source = self.source(&passes[..index], pass, effect)?;
        let own = camera.unwrap_or(effect.camera);
        if own != camera.unwrap_or(source.raster.camera) {
            return Err(PlanError::new(
                format!("{}: pass `{}` has another camera than pass `{}`", pass.place, pass.name, source.pass.name),
                "an effect pass sees what its G-buffer shows: give both the same <camera>",
            ));
        }
        let info = effect.program.info();
        if info.glass && source.raster.scenes != effect.scenes {
            return Err(PlanError::new(
                format!(
                    "{}: pass `{}` draws other scenes than pass `{}` drew",
                    pass.place, pass.name, source.pass.name
                ),
                "give both passes the same <scenes>",
            ));
        }
        let has_disc = info.params.contains(&"sun") && params.sun > 0.0;
        let params = if has_disc && self.settings.fidelity == Fidelity::Thesis {
            let (what, why) =
                (format!("sun={} of pass `{}`", params.sun, pass.name), "in thesis fidelity the light is a point");
            self.decide(what, false, why.to_owned());
            EffectParams { sun: 0.0, ..params }
        } else {
            params
        };
        let size = self.target_size(source.pass.target);
        let map_size = match params.map_size {
            0 => EffectParams::fitted_map_size(info.program, size),
            texels => texels,
        };
        let params = EffectParams { map_size, ..params };
        let whole = Rect { x: 0, y: 0, width: size[0], height: size[1] };
        if rectangle(self.viewport_of(source.pass, camera), size) != whole {
            return Err(PlanError::new(
                format!("{}: pass `{}` reads a G-buffer that is only drawn in a part", pass.place, pass.name),
                format!("let pass `{}` draw into the whole of its target", source.pass.name),
            ));
        }
        let traces = params.leaves_to_rays(info.program);
        if traces && self.settings.fidelity == Fidelity::Thesis {
            let instead = if info.program.marches() { "missing=cube or missing=none" } else { "border=map" };
            return Err(PlanError::new(
                format!("{}: pass `{}` leaves pixels to rays by their triangles", pass.place, pass.name),
                format!("thesis fidelity has none: set {instead}, or use --fidelity corrected"),
            ));
        }
        if traces && !info.program.marches() && params.sun > 0.0 {
            return Err(PlanError::new(
                format!("{}: pass `{}` has border=rays and sun={}", pass.place, pass.name, params.sun),
                "border=rays is for hard shadows, whose borders are narrow: set sun=0, border=map, or use rays for all pixels",
            ));
        }
        let inputs: Vec<ChannelRef> = inputs(effect).collect();
        let resident = self.is_resident(passes, index, &inputs, source.index);
        wanted.channels.extend(inputs.iter().copied());
        // Pixels left to the ray backend are traced from host memory.
        let in_host = !resident || traces;
        if in_host {
            wanted.host.extend(inputs);
        }
        if (info.glass || traces)
            && let Some(position) = effect.position
        {
            wanted.triangles.insert(position.target);
            if in_host {
                wanted.host_triangles.insert(position.target);
            }
        }
        Ok(Work::Effect {
            scene_set: self.scene_set(&effect.scenes),
            view: view(&self.project.cameras[own], whole, self.origin),
            params,
            reads_triangle: info.glass,
            resident,
        })
    }

    /// The last earlier pass that wrote the target of an effect's positions. Fails if that is not a raster pass, or if the positions
    /// are not the target's second channel.
    fn source<'a>(&self, earlier: &'a [Pass], pass: &Pass, effect: &EffectPass) -> Result<Source<'a>, PlanError> {
        let target = effect.position.map(|position| position.target);
        let mut writers = earlier.iter().enumerate().rev().filter(|(_, earlier)| !self.is_off(earlier));
        let writer = writers.find(|(_, earlier)| earlier.target == target);
        match (writer, effect.position) {
            (
                Some((index, pass @ Pass { kind: PassKind::Raster(raster), .. })),
                Some(ChannelRef { channel: 1, .. }),
            ) => Ok(Source { index, pass, raster }),
            _ => Err(PlanError::new(
                format!("{}: pass `{}` reads no positions that a raster pass drew", pass.place, pass.name),
                "bind pos_buffer to the second texture of the target that a pass of class=\"default\" drew",
            )),
        }
    }

    /// Whether the channels that a pass reads are exactly as the raster pass `source` drew them: as floats, and with nothing drawn,
    /// written or stored since.
    fn is_resident(&self, passes: &[Pass], index: usize, channels: &[ChannelRef], source: usize) -> bool {
        // If raster passes are switched off, it is unclear which one drew last.
        if passes.iter().any(|pass| matches!(pass.kind, PassKind::Raster(_)) && self.is_off(pass)) {
            return false;
        }
        let (between, source) = (&passes[source + 1..index], &passes[source]);
        let undisturbed = between.iter().all(|pass| {
            let stores = pass.kind.buffers_stored().any(|channel| Some(channel.target) == source.target);
            !matches!(pass.kind, PassKind::Raster(_)) && pass.target != source.target && !stores
        });
        undisturbed
            && channels.iter().all(|channel| {
                let format = self.project.targets[channel.target].channels[channel.channel].format;
                let floats = matches!(format, PixelFormat::Rgba32Float | PixelFormat::Rgba16Float);
                Some(channel.target) == source.target && floats
            })
    }

    /// The target whose G-buffer the ray pass at `passes[index]` may read in place. `channels` are the channels that the pass
    /// reads.
    pub(super) fn resident_target(
        &self,
        passes: &[Pass],
        index: usize,
        channels: &[ChannelRef],
        camera: Option<usize>,
    ) -> Option<usize> {
        let PassKind::Ray(ray) = &passes[index].kind else { return None };
        let target = channels.first()?.target;
        let (source, pass) = passes[..index].iter().enumerate().rfind(|(_, pass)| pass.target == Some(target))?;
        let size = self.target_size(pass.target);
        let whole = Rect { x: 0, y: 0, width: size[0], height: size[1] };
        let in_place = |channel: Option<ChannelRef>, place| channel.is_none_or(|channel| channel.channel == place);
        // With an adaptive number of samples, the triangle ids of skipped pixels are removed from the G-buffer in host memory.
        let fits = matches!(pass.kind, PassKind::Raster(_))
            && self.settings.aa.tolerance().is_none()
            && passes[index].target != pass.target
            && self.target_size(passes[index].target) == size
            && rectangle(self.viewport_of(pass, camera), size) == whole
            && in_place(ray.color, 0)
            && in_place(ray.position, 1)
            && in_place(ray.normal, 2)
            && self.is_resident(passes, index, channels, source);
        fits.then_some(target)
    }
}

/// What the ray backend traces for a pass.
#[derive(Debug, Clone, Copy)]
pub struct Traced<'a> {
    /// The program and its constants; `None` for an intersection pass, whose rays are in a buffer.
    pub program: Option<(RayProgram, RayParams)>,
    /// Index of the traced scenes, into [`Plan::scene_sets`].
    pub scene_set: usize,
    /// The materials that are glass, as name patterns.
    pub glass: &'a [MaterialPattern],
}

impl Plan {
    /// What the ray backend traces for a pass: the program of a ray pass, the counterpart of an effect that leaves pixels to rays, or
    /// the rays in the buffer of an intersection pass. `None` if the pass traces no rays.
    #[must_use]
    pub fn traced(&self, planned: &PlannedPass) -> Option<Traced<'_>> {
        match (&planned.work, &self.pass(planned).kind) {
            (Work::Rays { scene_set, params, .. }, PassKind::Ray(ray)) => {
                Some(Traced { program: Some((ray.program, *params)), scene_set: *scene_set, glass: &ray.glass })
            }
            (Work::Effect { scene_set, params, .. }, PassKind::Effect(effect))
                if params.leaves_to_rays(effect.program) =>
            {
                Some(Traced {
                    program: Some((effect.program.info().counterpart, params.by_rays())),
                    scene_set: *scene_set,
                    glass: &effect.glass,
                })
            }
            (Work::Intersection { scene_set }, _) => Some(Traced { program: None, scene_set: *scene_set, glass: &[] }),
            _ => None,
        }
    }
}

/// The channels that an effect pass reads.
pub(super) fn inputs(effect: &EffectPass) -> impl Iterator<Item = ChannelRef> {
    let buffers = [("pos_buffer", effect.position), ("norm_buffer", effect.normal), ("color_buffer", effect.color)];
    let info = effect.program.info();
    buffers.into_iter().filter(|(name, _)| info.buffers.contains(name)).filter_map(|(_, channel)| channel)
}
