//! Translates the passes of a plan into one expression for the reference renderer, from the window back to what the camera sees.

use crate::args::quoted;
use crate::bench::Case;
use crate::passes::reference::{Camera, Job, Look, Seen, Traced, Value};
use crate::pipeline::backend::{Rect, Shade};
use crate::pipeline::color::ColorSpace;
use crate::pipeline::executor::{PassMaterials, Renderer};
use crate::pipeline::glass::{Dielectric, GlassShadow};
use crate::pipeline::plan::{Instead, Plan, PlannedPass, Shining, Work};
use crate::pipeline::programs::RayProgram;
use crate::pipeline::project::{ChannelRef, PassKind, QuadSource};
use crate::pipeline::scene::{Sphere, fnv1a};
use glam::{DVec3, DVec4, Vec4};
use std::ops::Range;

/// Must change whenever the reference renderer gives different pictures.
pub(super) const FORMAT: u32 = 1;

/// Description of a reference of the picture.
pub(super) fn words(samples: u32) -> String {
    format!("the picture from the camera in f64, {samples} samples a pixel")
}

/// The command that makes the reference of a case's picture.
pub(super) fn command(case: &Case) -> String {
    let settings = &case.settings;
    let mut words = vec!["curitiba".to_owned(), "reference".to_owned(), case.project.display().to_string()];
    let mut option = |name: &str, value: String| words.extend([format!("--{name}"), value]);
    if let Some(camera) = &settings.camera {
        option("camera", camera.clone());
    }
    if let Some([width, height]) = settings.size {
        option("size", format!("{width}x{height}"));
    }
    if let Some(pipeline) = &settings.pipeline {
        option("pipeline", pipeline.clone());
    }
    if let Some(color) = settings.color {
        option("color", color.to_string());
    }
    for set in &settings.set {
        option("set", set.clone());
    }
    for (name, value) in settings.scene.given() {
        option(name, value);
    }
    words.splice(3..3, settings.scene.more.iter().map(|path| path.display().to_string()));
    words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
}

/// Everything that determines the reference of a picture, except the number of samples: the scene, the camera, and what is
/// computed. How the project computes it is not included, so raster effects share the reference of their ray counterparts.
pub(super) fn material(job: &Job<'_>, space: ColorSpace) -> String {
    let Job { seen, value, size, .. } = job;
    let scene = seen.scene;
    [
        format!("curitiba {}, picture from the camera, format {FORMAT}", env!("CARGO_PKG_VERSION")),
        format!("window {size:?}, color {space}, scene {:032x}", scene.fingerprint()),
        format!("{:?} {:?} {}", seen.camera, seen.clear_color, marked(seen.culled)),
        format!("{:?} {}", seen.look.sun, hashed(&shown(seen.look.shades, value))),
        described(value),
    ]
    .into_iter()
    .chain((!seen.look.lights.is_empty()).then(|| format!("{:?}", seen.look.lights)))
    .collect::<Vec<_>>()
    .join("\n")
}

/// The materials without the colours that the camera never sees because a glass pass overwrites them: some projects mark glass by
/// such colours, others do not.
fn shown(shades: &[Shade], value: &Value<'_>) -> Vec<Shade> {
    let glass = match value {
        Value::Held(_, value) => return shown(shades, value),
        Value::Traced(pass, _) if bounces(pass.program) => pass.look.glass,
        _ => &[],
    };
    let hidden = |index: usize| glass.get(index).is_some_and(|glass| *glass);
    let shades = shades.iter().enumerate();
    shades
        .map(|(index, shade)| match hidden(index) {
            true => Shade { diffuse: Vec4::ONE, emission: Vec4::ZERO, glow: None, ..*shade },
            false => *shade,
        })
        .collect()
}

/// Whether rays of a program bounce on glass and show what they hit.
fn bounces(program: RayProgram) -> bool {
    matches!(program, RayProgram::Reflection | RayProgram::Refraction | RayProgram::Final)
}

fn described(value: &Value<'_>) -> String {
    match value {
        Value::Constant(value) => format!("{value:?}"),
        Value::Drawn => "what is drawn".to_owned(),
        Value::Product(color, factor) => format!("({}) times ({})", described(color), described(factor)),
        Value::Held(format, value) => format!("{format:?} ({})", described(value)),
        Value::Traced(pass, color) => {
            let (info, look) = (pass.program.info(), &pass.look);
            let mut words = vec![info.stem.to_owned()];
            let constants = ["index", "depth", "radius", "intensity"].into_iter().filter(|name| info.reads(name));
            words.extend(constants.map(|name| format!("{name} {}", pass.params.get(name))));
            if info.reads("samples") {
                words.push(format!("occlusion {}", pass.params.samples > 0));
            }
            words.extend((info.sun_samples(&pass.params) > 0).then(|| format!("sun {}", pass.params.sun)));
            let shades = bounces(pass.program);
            if shades || pass.program == RayProgram::DeferredShadows {
                words.push(format!("{:?}", look.sun));
                words.extend((!look.lights.is_empty()).then(|| format!("{:?}", look.lights)));
            }
            if shades {
                words.push(format!("{} glass {} {:?}", hashed(look.shades), marked(look.glass), pass.beyond));
            } else {
                let cut = look.shades.iter().enumerate().filter(|(_, shade)| shade.is_cut());
                let cut = cut.map(|(index, shade)| (index, shade.alpha_cutoff, shade.texture, shade.vertex_colors));
                words.push(format!("cut out {:?}", cut.collect::<Vec<_>>()));
            }
            if pass.program == RayProgram::Final {
                words.push(format!("light passes {}", marked(look.shadow_glass)));
            }
            if info.reads("glass") && look.glass.contains(&true) && !look.dielectrics.is_empty() {
                words.extend(of_materials(pass));
            }
            format!("{} of ({})", words.join(", "), described(color))
        }
    }
}

/// Description of glass that is defined by the scene's materials.
fn of_materials(pass: &Traced<'_>) -> Vec<String> {
    let (params, table) = (&pass.params, pass.look.dielectrics);
    let mut words = vec![format!("glass by its materials {:032x}", fnv1a(format!("{table:?}").as_bytes()))];
    // In both modes, light that no sphere focuses passes glass in a straight line.
    let straight = matches!(params.shadow, GlassShadow::Straight | GlassShadow::Caustic);
    if straight && pass.program == RayProgram::Final && pass.look.shadow_glass.contains(&true) {
        words.push("light goes straight on".to_owned());
    }
    let spreads = |dielectric: &Dielectric| dielectric.spread > 0.0;
    words.extend(table.iter().any(spreads).then(|| format!("colours are bent apart {}", params.wavelengths > 1)));
    // Stored references without this line applied no absorption to what a camera inside a body sees directly. The line gives correct references
    // other names.
    words.extend(pass.look.absorbs().then(|| "the body around the camera absorbs all that is seen".to_owned()));
    words
}

fn hashed(shades: &[Shade]) -> String {
    format!("shades {:032x}", fnv1a(format!("{shades:?}").as_bytes()))
}

fn marked(materials: &[bool]) -> String {
    let marked = materials.iter().enumerate().filter_map(|(index, marked)| marked.then_some(index));
    format!("{:?}", marked.collect::<Vec<_>>())
}

/// Why the picture of a plan has no reference; `None` if it may have one, as far as the plan alone determines it.
pub(super) fn unsupported(plan: &Plan) -> Option<String> {
    let nothing =
        |_: usize| Look { shades: &[], glass: &[], shadow_glass: &[], dielectrics: &[], sun: None, lights: Vec::new() };
    Expression { plan, look: &nothing, spheres: &|_| &[], drawn: None }.window().err()
}

/// The job for the reference renderer, with the given samples for each of its two estimates.
///
/// # Errors
/// A feature that the reference renderer does not support, with the pass.
pub(super) fn job(renderer: &Renderer, samples: Range<u32>) -> Result<Job<'_>, String> {
    let plan = renderer.plan();
    let look = |index: usize| {
        let materials = renderer.materials(index);
        let Shining { sun, lights } = match &plan.pass(&plan.passes[index]).kind {
            kind @ (PassKind::Raster(_) | PassKind::Ray(_)) => plan.shining(kind.lights()),
            PassKind::Effect(_) | PassKind::Quad(_) | PassKind::Intersection(_) | PassKind::Compute(_) => {
                Shining::default()
            }
        };
        let PassMaterials { shades, glass, shadow_glass, dielectrics, .. } = materials;
        Look { shades, glass, shadow_glass, dielectrics, sun, lights }
    };
    let spheres = |set: usize| renderer.scenes().nth(set).map_or(&[][..], |scene| &scene.geometry.spheres);
    let mut expression = Expression { plan, look: &look, spheres: &spheres, drawn: None };
    let value = expression.window()?;
    let Some(drawn) = expression.drawn else {
        return Err("no pass that is shown draws anything".to_owned());
    };
    let planned = &plan.passes[drawn];
    let (Work::Raster { scene_set, clear_color, .. }, PassKind::Raster(raster)) =
        (&planned.work, &plan.pass(planned).kind)
    else {
        unreachable!("a raster pass was drawn");
    };
    let chosen = plan.settings.camera.as_deref().and_then(|name| plan.project.camera(name).ok());
    let camera = &plan.project.cameras[chosen.unwrap_or(raster.camera)];
    let aspect = f64::from(plan.window[0]) / f64::from(plan.window[1]);
    let Some(scene) = renderer.scenes().nth(*scene_set) else { unreachable!("the scenes of a plan are loaded") };
    let seen = Seen {
        scene,
        camera: Camera::new(camera, plan.origin, aspect),
        look: look(drawn),
        culled: &renderer.materials(drawn).culled,
        clear_color: clear_color.as_dvec4(),
    };
    Ok(Job { seen, value, size: plan.window, samples })
}

/// Translates a plan, starting at the window.
struct Expression<'p, 'a> {
    plan: &'p Plan,
    /// Materials and light as the pass at an index sees them.
    look: &'p dyn Fn(usize) -> Look<'a>,
    /// The exact spheres of a set of scenes.
    spheres: &'p dyn Fn(usize) -> &'a [Sphere],
    /// Index in the plan of the raster pass that the picture starts from; `None` until one was found.
    drawn: Option<usize>,
}

impl<'a> Expression<'_, 'a> {
    fn window(&mut self) -> Result<Value<'a>, String> {
        self.written(None, 0, self.plan.passes.len())
    }

    fn channel(&mut self, channel: ChannelRef, before: usize) -> Result<Value<'a>, String> {
        let value = self.written(Some(channel.target), channel.channel, before)?;
        let format = self.plan.project.targets[channel.target].channels[channel.channel].format;
        Ok(Value::Held(format, Box::new(value)))
    }

    /// The value in a channel of a target, or of the window, after the passes before index `before`.
    fn written(&mut self, target: Option<usize>, channel: usize, before: usize) -> Result<Value<'a>, String> {
        let plan = self.plan;
        let writes = |(_, planned): &(usize, &PlannedPass)| plan.pass(planned).target == target;
        let mut writers = plan.passes[..before].iter().enumerate().filter(writes);
        let name = || {
            target.map_or("the window".to_owned(), |target| format!("target `{}`", plan.project.targets[target].name))
        };
        let Some((index, planned)) = writers.next() else { return Err(format!("no pass writes {}", name())) };
        if let Some((_, other)) = writers.next() {
            let [first, second] = [planned, other].map(|planned| &plan.pass(planned).name);
            return Err(format!(
                "passes `{first}` and `{second}` both write {}: such a picture has no reference",
                name()
            ));
        }
        let pass = plan.pass(planned);
        let at = |why: String| format!("{}: pass `{}`: {why}", pass.place, pass.name);
        let refuse = |why: String| Err(at(why));
        let whole = |rect: Rect| rect == Rect { x: 0, y: 0, width: plan.window[0], height: plan.window[1] };
        if plan.target_size(target) != plan.window {
            return refuse("a target of another size than the window has no reference of the picture".to_owned());
        }
        match (&planned.work, &pass.kind) {
            (Work::Raster { viewport, .. }, PassKind::Raster(raster)) => {
                if !raster.shaders.is_empty() {
                    return refuse("what a project's own shaders draw has no reference of the picture".to_owned());
                }
                if !whole(*viewport) {
                    return refuse(
                        "a viewport that is a part of the target has no reference of the picture".to_owned(),
                    );
                }
                if channel != 0 {
                    return refuse("positions and normals that are shown have no reference".to_owned());
                }
                self.starts_from(index).map_err(at)?;
                Ok(Value::Drawn)
            }
            (Work::Rays { scene_set, params, beyond, .. }, PassKind::Ray(ray)) => {
                let look = (self.look)(index);
                if let Some(why) = Traced::unsupported(ray.program, params, &look, (self.spheres)(*scene_set)) {
                    return refuse(why);
                }
                // All G-buffer channels must come from the one raster pass that the picture starts from.
                let buffers = [(ray.position, 1), (ray.normal, 2)];
                for (read, expected) in buffers.into_iter().filter_map(|(read, expected)| Some((read?, expected))) {
                    let draws = |(_, planned): &(usize, &PlannedPass)| plan.pass(planned).target == Some(read.target);
                    let drawn = plan.passes[..index].iter().enumerate().find(draws);
                    let set = drawn.and_then(|(_, planned)| match planned.work {
                        Work::Raster { scene_set, .. } => Some(scene_set),
                        _ => None,
                    });
                    let (Some((drawn, _)), true, true) = (drawn, set == Some(*scene_set), read.channel == expected)
                    else {
                        return refuse("its G-buffer is not that of one raster pass of the same scenes".to_owned());
                    };
                    self.starts_from(drawn).map_err(at)?;
                }
                let color = match ray.color {
                    Some(color) => self.channel(color, index)?,
                    None => Value::Constant(DVec4::W),
                };
                let beyond: DVec3 = beyond.as_dvec3();
                let traced = Traced { program: ray.program, params: *params, look, beyond };
                Ok(Value::Traced(Box::new(traced), Box::new(color)))
            }
            (Work::Off { instead: Instead::Fill(value) }, _) => {
                Ok(Value::Constant(DVec4::from_array(value.map(f64::from))))
            }
            (Work::Off { instead: Instead::Copy(read) }, _) => self.channel(*read, index),
            (Work::Quad { viewport }, PassKind::Quad(quad)) => {
                if !whole(*viewport) {
                    return refuse(
                        "a viewport that is a part of the window has no reference of the picture".to_owned(),
                    );
                }
                match quad.source {
                    QuadSource::Show(shown) => self.channel(shown, index),
                    QuadSource::Combine { color, factor } => {
                        let (color, factor) = (self.channel(color, index)?, self.channel(factor, index)?);
                        Ok(Value::Product(Box::new(color), Box::new(factor)))
                    }
                    QuadSource::Own => {
                        refuse("what a project's own shaders show has no reference of the picture".to_owned())
                    }
                }
            }
            _ => refuse("what it computes has no reference of the picture".to_owned()),
        }
    }

    /// Records the raster pass that the picture starts from; it is an error if there is more than one.
    fn starts_from(&mut self, index: usize) -> Result<(), String> {
        if self.drawn.is_some_and(|drawn| drawn != index) {
            return Err("a picture of several raster passes has no reference".to_owned());
        }
        self.drawn = Some(index);
        Ok(())
    }
}
