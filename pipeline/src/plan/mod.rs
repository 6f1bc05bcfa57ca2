//! The plan: which passes run, what each writes, and what is left out. It is decided once, from the project's declarations.
//!
//! A channel is written only if a later pass reads it or it is shown, and a pass runs only if something it writes is needed.
//! [`Plan::decisions`] holds every decision with its reason; `curitiba plan` prints them.

mod access;
mod adaptive;
mod cones;
mod device_quad;
mod effect;
mod filter;
mod kept;
mod lights;
mod lines;
mod liveness;
mod off;
mod parts;
mod photons;
mod preview;
mod samples;
mod settings;
mod shaders;
mod spheres;
mod sun;

pub use access::{Access, DEPTH, Slot, TRIANGLES};
pub use device_quad::{QuadInput, RayPictures, ShowingQuad};
pub use effect::Traced;
pub use lights::Shining;
pub use off::Instead;
pub use parts::{BLOCK, Part, Parts};
pub use preview::Preview;
pub use settings::{OWN_BACKEND, PlanError, Settings, may_trace};

use crate::backend::{Attachments, LoadStore, Rect, View};
use crate::color::{ColorSpace, Display, Tone};
use crate::diagnostic::{Decision, Warnings};
use crate::glass::{GlassRule, TRANSPARENT};
use crate::image::{MAX_SIDE, PixelFormat};
use crate::memory::mebibytes;
use crate::programs::{Fidelity, RayParams};
use crate::project::{Camera, ChannelRef, Orthographic, Pass, PassKind, Project, RasterPass, RayPass, Viewport};
use crate::raster_effects::EffectParams;
use crate::scene::{Material, Needs};
use glam::camera::rh;
use glam::{DVec3, Mat4, Vec3, Vec4};
use settings::{check_preview, check_size, constants, display, set_formats, shown_channels, widen_colors};

/// All work of a frame, in order.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The project.
    pub project: Project,
    /// Index of the pipeline that runs, in [`Project::pipelines`].
    pub pipeline: usize,
    /// Window size.
    pub window: [u32; 2],
    /// The part of the window that is written, and its division for rendering.
    pub parts: Parts,
    /// Side in pixels of the blocks in which a target that exceeds the rasteriser's limits is drawn, one block after the other; `None`
    /// if no target exceeds the limits.
    pub block: Option<u32>,
    /// The user's settings.
    pub settings: Settings,
    /// Colour space of the window's pixels, and their conversion to display values.
    pub display: Display,
    /// Passes that run.
    pub passes: Vec<PlannedPass>,
    /// Size and attachments of each target, by index of [`Project::targets`].
    pub targets: Vec<PlannedTarget>,
    /// Sets of scenes that are loaded together, as indices into [`Project::scenes`].
    pub scene_sets: Vec<Vec<usize>>,
    /// The contents of scene files that are read.
    pub needs: Needs,
    /// World position that the positions of scenes and cameras are relative to, set by [`Self::move_origin`]. 0 until the scenes are
    /// loaded, and for scenes near the world's origin.
    pub origin: DVec3,
    /// Channels kept for inspection, in addition to the window.
    pub shown: Vec<ChannelRef>,
    /// Every decision with its reason.
    pub decisions: Vec<Decision>,
    /// Warnings about settings that are carried out but may be mistakes.
    pub warnings: Warnings,
    /// The project as given to [`Self::new`], without the changes that this plan makes to its copy, such as formats. Further plans
    /// are made from it.
    pub declared: Project,
}

/// A render target as it is allocated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PlannedTarget {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Which of the channels 0 to 2 and the triangle ids are allocated.
    pub stored: Attachments,
}

/// A pass that runs.
#[derive(Debug, Clone)]
pub struct PlannedPass {
    /// Index of the pass in the pipeline.
    pub pass: usize,
    /// The work of the pass in a frame.
    pub work: Work,
}

/// The work of a planned pass.
#[derive(Debug, Clone, PartialEq)]
pub enum Work {
    /// Draws triangles.
    Raster {
        /// Index into [`Plan::scene_sets`].
        scene_set: usize,
        /// The camera.
        view: View,
        /// Rectangle of the target into which the pass draws.
        viewport: Rect,
        /// Clear value of the colour.
        clear_color: Vec4,
        /// The attachments that are written.
        attachments: Attachments,
        /// The attachments that are read in host memory: by quad passes, by other passes that cannot read them in place, and for
        /// inspection.
        host: Attachments,
        /// The attachments that ray passes may read in place ([`Work::Rays`]'s `resident`). If the ray passes cannot, these attachments are
        /// read in host memory too.
        traced: Attachments,
        /// The earlier contents of the target that the pass keeps instead of clearing, and whether it stores its depth for a later pass.
        load_store: LoadStore,
    },
    /// Traces rays.
    Rays {
        /// Index into [`Plan::scene_sets`].
        scene_set: usize,
        /// The camera. Rays that start at the camera use all of it. Rays from a G-buffer use its position, and ray cones its projection.
        view: View,
        /// Rectangle of the target that the camera fills.
        viewport: Rect,
        /// Constants of the program, after `--set`.
        params: RayParams,
        /// Colour of rays that miss the scene.
        beyond: Vec3,
        /// Whether triangle ids are read.
        reads_triangle: bool,
        /// The target whose G-buffer the pass reads, if that is the unchanged result of the last draw and may be read in place.
        resident: Option<usize>,
    },
    /// Computes by rasterisation an effect that a ray pass would compute by tracing.
    Effect {
        /// Index into [`Plan::scene_sets`].
        scene_set: usize,
        /// The camera of the G-buffer.
        view: View,
        /// Constants of the program, after `--set`.
        params: EffectParams,
        /// Whether triangle ids are read.
        reads_triangle: bool,
        /// Whether the G-buffer is that of the last draw, so that a rasteriser may read its own copy.
        resident: bool,
    },
    /// The pass is switched off and writes a substitute.
    Off {
        /// What is written instead.
        instead: Instead,
    },
    /// Fills a rectangle.
    Quad {
        /// Rectangle of the target that the quad fills.
        viewport: Rect,
    },
    /// Traces the rays of a storage buffer.
    Intersection {
        /// Index into [`Plan::scene_sets`].
        scene_set: usize,
    },
    /// Runs a compute shader.
    Compute,
}

impl Plan {
    /// Makes a plan.
    ///
    /// # Errors
    /// If the settings name something that the project lacks, combine what no engine supports, or ask for a picture that is too large.
    pub fn new(mut project: Project, settings: Settings) -> Result<Self, PlanError> {
        let name_error = |message: String| PlanError { message, help: None };
        let declared = project.clone();
        let pipeline = project.pipeline(settings.pipeline.as_deref()).map_err(name_error)?;
        let camera = settings.camera.as_deref().map(|name| project.camera(name)).transpose().map_err(name_error)?;
        let whole = settings.size.unwrap_or(project.window);
        check_size("the window", whole)?;
        check_preview(&settings)?;
        let window = settings.preview.map_or(whole, |preview| preview.divide(whole));
        project.place_light_cameras(camera, window, rectangle);
        let mut targets = Vec::new();
        for (index, target) in project.targets.iter().enumerate() {
            let [width, height] = target_size(&project, pipeline, index, window);
            check_size(&format!("render target `{}`", target.name), [width, height])?;
            targets.push(PlannedTarget { width, height, stored: Attachments::default() });
        }
        off::check_names(&project, pipeline, &settings.off)?;
        set_formats(&mut project, pipeline, &settings)?;
        let display = display(&project, &settings)?;
        let widened = match display.space {
            ColorSpace::Report => Vec::new(),
            ColorSpace::Linear => widen_colors(&mut project, pipeline, &settings),
        };
        let shown = shown_channels(&project, pipeline, &settings.show)?;
        let constants = constants(&project, pipeline, &settings)?;
        let mut plan = Self {
            project,
            pipeline,
            window,
            parts: Parts::whole(window),
            block: None,
            settings,
            display,
            passes: Vec::new(),
            targets,
            scene_sets: Vec::new(),
            needs: Needs::NOTHING,
            origin: DVec3::ZERO,
            shown,
            decisions: Vec::new(),
            warnings: Warnings::default(),
            declared,
        };
        plan.choose_passes(camera, &constants)?;
        plan.check_sizes_read()?;
        if !plan.settings.off.is_empty() {
            plan.check_switched_off()?;
        }
        plan.check_spheres()?;
        plan.decide_needs();
        plan.explain_color(&widened);
        plan.choose_parts()?;
        plan.explain_samples()?;
        plan.explain_filters();
        plan.explain_adaptive_sampling();
        plan.explain_photons();
        plan.explain_cones();
        plan.explain_lights()?;
        plan.warn_of_rounded_positions();
        plan.check_memory()?;
        Ok(plan)
    }

    /// The project's declaration of a planned pass.
    #[must_use]
    pub fn pass(&self, planned: &PlannedPass) -> &Pass {
        &self.project.pipelines[self.pipeline].passes[planned.pass]
    }

    /// Makes the cameras relative to `origin`, the origin of the scenes' positions.
    pub fn move_origin(&mut self, origin: DVec3) {
        self.origin = origin;
        let chosen = self.settings.camera.as_deref().and_then(|name| self.project.camera(name).ok());
        for index in 0..self.passes.len() {
            let pass = self.pass(&self.passes[index]);
            let (own, rect) = match &pass.kind {
                PassKind::Ray(ray) if ray.from_camera.is_some() => {
                    let [width, height] = self.target_size(pass.target);
                    (ray.camera, Rect { x: 0, y: 0, width, height })
                }
                PassKind::Raster(RasterPass { camera, .. }) | PassKind::Ray(RayPass { camera, .. }) => {
                    (*camera, rectangle(self.viewport_of(pass, chosen), self.target_size(pass.target)))
                }
                // The whole G-buffer.
                PassKind::Effect(effect) => {
                    let size = self.target_size(effect.position.map(|position| position.target));
                    (effect.camera, Rect { x: 0, y: 0, width: size[0], height: size[1] })
                }
                PassKind::Quad(_) | PassKind::Intersection(_) | PassKind::Compute(_) => continue,
            };
            let moved = view(&self.project.cameras[self.seen_from(chosen, own)], rect, origin);
            match &mut self.passes[index].work {
                Work::Raster { view, .. } | Work::Rays { view, .. } | Work::Effect { view, .. } => *view = moved,
                Work::Off { .. } | Work::Quad { .. } | Work::Intersection { .. } | Work::Compute => {}
            }
        }
    }

    /// Size of the target with this index; `None` is the window.
    #[must_use]
    pub fn target_size(&self, target: Option<usize>) -> [u32; 2] {
        target.map_or(self.window, |target| [self.targets[target].width, self.targets[target].height])
    }

    /// Size that the target with this index (`None`: the window) has without a [`Preview`].
    #[must_use]
    pub fn whole_size(&self, target: Option<usize>) -> [u32; 2] {
        let window = self.settings.size.unwrap_or(self.project.window);
        target.map_or(window, |target| target_size(&self.project, self.pipeline, target, window))
    }

    /// Adds the decision about the colour space.
    fn explain_color(&mut self, widened: &[String]) {
        let Display { space, exposure, tone } = self.display;
        let by = match self.settings.color {
            Some(_) => "the user asks for it",
            None => "of the project",
        };
        let linear = space == ColorSpace::Linear;
        let mut why = match space {
            ColorSpace::Report => format!("color=report, {by}: colours are shaded and written as files store them"),
            ColorSpace::Linear => format!(
                "color=linear, {by}: colours are decoded from sRGB; the picture is exposed by {exposure} stops and encoded in sRGB"
            ),
        };
        if tone != Tone::None {
            why += &format!(" after the tone curve `{}`", tone.name());
        }
        self.decide("linear light".into(), linear, why);
        for name in widened {
            let why = "it is declared in bytes, whose steps are too coarse for linear light".to_owned();
            self.decide(format!("RGBA16F for `{name}`"), true, why);
        }
    }

    /// Warns of positions stored in less than 32-bit floats. In 16-bit floats, coordinates of a few hundred metres are off by up to an
    /// eighth of a metre.
    fn warn_of_rounded_positions(&mut self) {
        let mut warnings = Warnings::default();
        for planned in &self.passes {
            let pass = self.pass(planned);
            let (Work::Raster { attachments: Attachments { position: true, .. }, .. }, Some(target)) =
                (&planned.work, pass.target)
            else {
                continue;
            };
            let target = &self.project.targets[target];
            let Some(channel) = target.channels.get(1).filter(|c| c.format != PixelFormat::Rgba32Float) else {
                continue;
            };
            warnings.add(
                &self.project.path,
                "positions stored in less than 32-bit floats",
                "shadows and occlusion are those of the rounded positions; docs/numerics.md says how far off",
                || {
                    let (library, name, format) = (&target.library, &channel.name, channel.format.name());
                    format!("pass `{}` writes `{library}::{name}` as {format}", pass.name)
                },
            );
        }
        self.warnings = warnings;
    }

    fn decide_needs(&mut self) {
        let mut colored = Vec::new();
        let mut hits = Vec::new();
        let mut lit = false;
        let own = self.needs_of_shaders();
        for planned in &self.passes {
            match &planned.work {
                Work::Raster { .. } if self.draws_own_alone(planned) => {}
                Work::Raster { attachments, .. } => {
                    lit |= attachments.color || attachments.position || attachments.normal;
                    if attachments.color {
                        colored.push(self.pass(planned).name.clone());
                    }
                }
                Work::Rays { .. } | Work::Effect { .. } => {
                    let shades = match &self.pass(planned).kind {
                        PassKind::Ray(ray) => ray.program.info().material_attributes.contains(&"diffuse"),
                        PassKind::Effect(effect) => effect.program.shades_maps(),
                        PassKind::Raster(_) | PassKind::Quad(_) | PassKind::Intersection(_) | PassKind::Compute(_) => {
                            false
                        }
                    };
                    if shades {
                        hits.push(self.pass(planned).name.clone());
                    }
                }
                Work::Off { .. } | Work::Quad { .. } | Work::Intersection { .. } | Work::Compute => {}
            }
        }
        let textures = !colored.is_empty() || !hits.is_empty();
        // The report's programs have no vertex colours.
        let colors = textures && self.settings.fidelity == Fidelity::Corrected;
        let normals = lit || !hits.is_empty();
        let normal_maps = normals && self.settings.fidelity == Fidelity::Corrected;
        let glass_maps = self.settings.fidelity == Fidelity::Corrected
            && self.passes.iter().any(|planned| self.asks_materials(planned));
        self.needs = Needs {
            normals: normals || own.normals,
            textures: textures || own.textures,
            colors,
            normal_maps,
            glass_maps,
            tangents: own.tangents,
        };
        let why = match (normals, own.normals) {
            (true, _) => "the light's cosine needs them",
            (false, true) => "own shaders read them",
            (false, false) => "no pass shades",
        };
        self.decide("vertex attribute `normal`".into(), self.needs.normals, why.into());
        let why = if own.textures && !textures {
            "own shaders read them".into()
        } else if self.needs.textures {
            let mut readers = colored;
            readers.extend(hits);
            readers.dedup();
            format!("pass `{}` writes a textured colour", readers.join("`, `"))
        } else {
            "no pass writes a textured colour".into()
        };
        self.decide("vertex attribute `texCoord0` and textures".into(), self.needs.textures, why);
        if self.needs.tangents {
            self.decide("vertex attribute `tangent`".into(), true, "own shaders read them".into());
        }
        if self.needs.colors {
            self.decide("vertex colours".into(), true, "where files have them, they are part of these colours".into());
        }
        if self.needs.glass_maps {
            let why = "where glass has them, it is rough or clear by them";
            self.decide("textures of roughness and transmission".into(), true, why.into());
        }
        if self.needs.normal_maps {
            let what = "normal maps, and the tangents and texture coordinates that they take";
            self.decide(what.into(), true, "where materials have them, they bend the shading normals".into());
        }
    }

    /// Whether the properties of materials determine what is glass in a pass (`glass=auto`), in addition to the materials that the project
    /// names.
    #[must_use]
    pub fn asks_materials(&self, planned: &PlannedPass) -> bool {
        let (Work::Rays { params, .. }, PassKind::Ray(ray)) = (&planned.work, &self.pass(planned).kind) else {
            return false;
        };
        params.glass == GlassRule::Auto && ray.program.info().reads("glass")
    }

    /// The glass features that a pass asks for beyond the report's panes, for messages; `None` if there are none.
    #[must_use]
    pub fn asks_of_glass(&self, planned: &PlannedPass) -> Option<String> {
        match (&planned.work, &self.pass(planned).kind) {
            (Work::Rays { params, .. }, PassKind::Ray(ray)) => ray.program.asks_of_glass(params),
            _ => None,
        }
    }

    /// Whether a pass needs an acceleration structure for a scene with these materials, and why.
    #[must_use]
    pub fn needs_structure(&self, planned: &PlannedPass, materials: &[Material]) -> (bool, String) {
        let Some(Traced { program, glass, .. }) = self.traced(planned) else {
            return (false, "it traces no ray".into());
        };
        let Some((program, params)) = program else {
            return (true, "it traces the rays of a buffer".into());
        };
        let by_itself = |material: &Material| self.asks_materials(planned) && material.transmission >= TRANSPARENT;
        let named = |material: &Material| glass.iter().any(|pattern| pattern.matches(&material.name));
        let finds_glass = materials.iter().any(|material| named(material) || by_itself(material));
        // In thesis fidelity a pixel counts as glass by its colour, whatever its material.
        program.info().needs_structure(&params, finds_glass || self.settings.fidelity == Fidelity::Thesis)
    }

    /// The kinds of data that the memory check counts besides render targets, as the end of a sentence, such as `, filters and photons`.
    fn beside_targets(&self) -> String {
        let kinds = [
            (self.filter_bytes(), "filters"),
            (self.adaptive_bytes(), "adaptive sampling"),
            (self.photon_bytes(), "photons"),
        ];
        let names: Vec<&str> = kinds.iter().filter(|(bytes, _)| *bytes > 0).map(|(_, name)| *name).collect();
        match names.split_last() {
            None => String::new(),
            Some((last, before)) => before.iter().map(|name| format!(", {name}")).collect::<String>() + " and " + last,
        }
    }

    fn check_memory(&self) -> Result<(), PlanError> {
        let (needed, allowed) = (self.target_bytes(), self.settings.max_memory);
        if needed > allowed {
            return Err(PlanError::new(
                format!(
                    "the render targets{} take {}, and {} is allowed",
                    self.beside_targets(),
                    mebibytes(needed),
                    mebibytes(allowed)
                ),
                match self.needs_whole() {
                    None => "render a smaller --size, or raise --max-memory".to_owned(),
                    Some(why) => {
                        format!("render a smaller --size, or raise --max-memory; it cannot be cut into bands: {why}")
                    }
                },
            ));
        }
        Ok(())
    }
}

/// Size of the target with the index `target` in a window of size `window`: the project's size, scaled with the window where that
/// is possible. A side above [`MAX_SIDE`] is returned as [`MAX_SIDE`] + 1.
fn target_size(project: &Project, pipeline: usize, target: usize, window: [u32; 2]) -> [u32; 2] {
    let target = &project.targets[target];
    // Shaders that bind buffers or images rely on the sizes that the project declares.
    let binds = |pass: &Pass| pass.kind.buffers_read().chain(pass.kind.buffers_stored()).next().is_some();
    let fixed = project.pipelines[pipeline].passes.iter().any(binds);
    // Depth maps of lights do not scale with the window.
    let alone = target.channels.iter().all(|channel| channel.depth);
    [0, 1].map(|axis| {
        if alone || fixed || target.buffer.is_some() || target.contents.is_some() {
            return target.size[axis].min(MAX_SIDE + 1);
        }
        let scale = f64::from(window[axis]) / f64::from(project.window[axis]);
        let side = (f64::from(target.size[axis]) * scale).round().max(1.0);
        if side > f64::from(MAX_SIDE) { MAX_SIDE + 1 } else { side as u32 }
    })
}

/// Sets a project's window size, and scales its targets as for that window. The project then gives, without [`Settings::size`], the
/// picture that it gave before with this size.
pub fn resize(project: &mut Project, pipeline: usize, window: [u32; 2]) {
    let sizes: Vec<_> =
        (0..project.targets.len()).map(|target| target_size(project, pipeline, target, window)).collect();
    project.targets.iter_mut().zip(sizes).for_each(|(target, size)| target.size = size);
    project.window = window;
}

/// A viewport in pixels of a target. Its edges are rounded, so that neighbouring viewports leave no gap and do not overlap.
fn rectangle(viewport: Option<&Viewport>, size: [u32; 2]) -> Rect {
    let Some(viewport) = viewport else { return Rect { x: 0, y: 0, width: size[0], height: size[1] } };
    let edges = |axis: usize| {
        let side = size[axis] as f32;
        let pixels = |value: f32| if value <= 1.0 { value * side } else { value };
        let low = pixels(viewport.origin[axis]);
        let high = low + pixels(viewport.size[axis]);
        (low.round().clamp(0.0, side) as u32, high.round().clamp(0.0, side) as u32)
    };
    let ((left, right), (bottom, top)) = (edges(0), edges(1));
    Rect { x: left, y: size[1] - top, width: right - left, height: top - bottom }
}

/// A camera is far from the origin if its distance from the origin exceeds this many times its near plane distance. At this distance,
/// products with a matrix that translates by the position are off by up to two pixels in a picture 1000 pixels wide, for points at the near
/// plane.
const FAR_EYE: f32 = 16_384.0;

/// The view of a camera, relative to `origin`.
fn view(camera: &Camera, viewport: Rect, origin: DVec3) -> View {
    /// Distance of an orthographic camera's eye, as a multiple of the size of its view volume. Lines from the eye to points of
    /// the volume are then parallel within the inverse of this number, in radians.
    const FAR_AWAY: f32 = 65_536.0;
    let position = (camera.position - origin).as_vec3();
    let to_view: Mat4 = rh::view::look_to_mat4(position, camera.direction, camera.up);
    // Near and far are exchanged: the depth is 1 at the near plane and 0 at the far plane, because floats are densest near 0.
    let (projection, eye) = match camera.orthographic {
        None => {
            let aspect = viewport.width.max(1) as f32 / viewport.height.max(1) as f32;
            (rh::proj::directx::perspective(camera.fov_y, aspect, camera.far, camera.near), position)
        }
        Some(Orthographic { left, right, bottom, top }) => {
            let size = (right - left).max(top - bottom).max(camera.far - camera.near);
            let projection = rh::proj::directx::orthographic(left, right, bottom, top, camera.far, camera.near);
            (projection, position - camera.direction * (size * FAR_AWAY))
        }
    };
    let far = camera.orthographic.is_none() && position.length() > FAR_EYE * camera.near;
    let clip_from_eye = far.then(|| projection * rh::view::look_to_mat4(Vec3::ZERO, camera.direction, camera.up));
    View { clip_from_eye, ..View::new(projection * to_view, eye) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat4;

    /// A camera in the corner of a terrain so large that no origin is near all of it.
    #[test]
    fn a_camera_far_from_the_origin_projects_as_in_double_precision() {
        let direction = Vec3::new(0.6, -0.2, 0.77).normalize();
        let camera = |position: DVec3| Camera {
            name: String::new(),
            position,
            direction,
            up: Vec3::Y,
            fov_y: 0.8,
            near: 0.5,
            far: 1e5,
            orthographic: None,
            viewport: None,
        };
        let whole = Rect { x: 0, y: 0, width: 1024, height: 1024 };
        let eye = Vec3::new(98_765.4, 321.7, -87_654.3);
        let seen = view(&camera(eye.into()), whole, DVec3::ZERO);
        assert!(seen.clip_from_eye.is_some());
        let perspective = rh::proj::directx::perspective(0.8, 1.0, 1e5, 0.5).as_dmat4();
        // The rotation in f32 is exact enough: the test is about digits lost in far positions.
        let turn = rh::view::look_to_mat4(Vec3::ZERO, direction, Vec3::Y).as_dmat4();
        let exact = perspective * turn * DMat4::from_translation(-eye.as_dvec3());
        let (ours, from) = seen.projection();
        let mut worst = [0.0_f64; 2];
        for step in 0..1000 {
            let (distance, across) = (3.0 + step as f32 * 0.5, (step % 37) as f32 / 37.0 - 0.5);
            let point = eye + direction * distance + Vec3::new(across, across * 0.7, -across) * distance * 0.3;
            let pixels = |clip: Vec4| (clip.truncate() / clip.w).truncate().as_dvec2() * 512.0;
            let clip = exact * point.as_dvec3().extend(1.0);
            let truth = (clip.truncate() / clip.w).truncate() * 512.0;
            let off = |found: glam::DVec2| (found - truth).abs().max_element();
            worst[0] = worst[0].max(off(pixels(seen.clip_from_world * point.extend(1.0))));
            worst[1] = worst[1].max(off(pixels(ours * (point - from).extend(1.0))));
        }
        println!("usual {} ours {}", worst[0], worst[1]);
        assert!(worst[0] > 1.0 && worst[1] < 1e-3, "{worst:?}");
        // A camera near the origin needs no second matrix, `clip_from_eye`.
        let near = view(&camera(DVec3::new(7.4, 18.6, -38.6)), whole, DVec3::ZERO);
        assert_eq!((near.clip_from_eye, near.projection().1), (None, Vec3::ZERO));
        // Relative to a nearby origin the same camera needs no second matrix either, and its eye is at the same place.
        let origin = DVec3::new(98_304.0, 0.0, -87_040.0);
        let moved = view(&camera(eye.into()), whole, origin);
        assert_eq!((moved.clip_from_eye, moved.eye.as_dvec3() + origin), (None, eye.as_dvec3()));
    }
}
