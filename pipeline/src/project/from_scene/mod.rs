//! Projects made from scene files: camera, sun, targets and passes for a scene without a project of its own.
//!
//! | part | choice |
//! |---|---|
//! | camera | `Camera`: described by options, or placed to see the whole focus; unless options describe it, the file's cameras come first |
//! | lights | the options' sun, or the file's lights, or a sun behind the viewer's left shoulder |
//! | sky | a dome or box around everything else that is a sky by its name, is round, or is a sky box; its materials are a `<sky>` |
//! | effects | shadows (unless a closed room keeps the sun from everything) and occlusion; glass if a drawn material transmits at least a tenth of the light |
//! | glass | by each material (`glass=auto`), in front of the background, with coloured shadows (`shadow=straight`) |
//! | focus | box of all triangles, or of most if few far ones (a sky) make it over three times as large; without a shell around all else |
//! | occlusion radius | a twentieth of the diagonal of the focus |
//! | window | 1024 x 1024 |
//! | colours | linear (`color=linear`) |

mod contents;
mod extent;
mod lights;
mod options;
mod passes;
mod shell;
mod view;

pub use options::{Effects, SceneOptions, Up};

use super::{Camera, MaterialPattern, Project, SceneDecl, SceneFile, Viewport};
use crate::color::ColorSpace;
use crate::diagnostic::{Problem, Problems, Severity};
use crate::glass::TRANSPARENT;
use crate::programs::RayProgram;
use crate::raster_effects::EffectProgram;
use crate::scene::{self, LoadOptions, Needs, Placement, Scene, SceneError};
use contents::Contents;
use glam::Vec3;
use passes::{Common, Step};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use view::two_digits;

/// Default size of the window, pixels.
const WINDOW: [u32; 2] = [1024, 1024];
/// Colour of the background, display values.
const BACKGROUND: Vec3 = Vec3::new(0.6, 0.7, 0.8);
/// Occlusion radius as a share of the diagonal of the focus.
const RADIUS: f64 = 0.05;

/// Why no project could be made from scene files.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum FromSceneError {
    /// A scene file could not be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// An option does not fit the scene.
    #[error("{0}")]
    Option(String),
}

/// The common parts of all projects that are made from one scene.
#[derive(Debug, Clone)]
pub struct SceneProjects {
    base: Project,
    glass: Vec<String>,
    radius: f32,
    effects: Effects,
}

impl SceneProjects {
    /// Reads scene files (without normals and textures) and examines their contents. `window` is the size of window and targets in
    /// pixels; `None` stands for 1024 x 1024. `max_bytes` limits the memory as [`LoadOptions::max_bytes`] does.
    ///
    /// # Errors
    /// If a file cannot be read, the scene has no triangles, or options do not fit it.
    pub fn new(
        files: &[PathBuf],
        options: &SceneOptions,
        window: Option<[u32; 2]>,
        max_bytes: u64,
    ) -> Result<Self, FromSceneError> {
        let needs = Needs::NOTHING;
        let mut scene = scene::load(files, &LoadOptions { needs, max_bytes }, &|_| {})?;
        turn(&mut scene, options.up);
        Self::of(&scene, files, options, window)
    }

    /// [`Self::new`] for a scene made in memory. Its project can be neither written nor read again.
    ///
    /// # Errors
    /// If the scene has no triangles, an index is out of range, a mesh has a different number of normals or texture coordinates
    /// than positions, or options do not fit it.
    pub fn in_memory(
        mut scene: Scene,
        options: &SceneOptions,
        window: Option<[u32; 2]>,
    ) -> Result<Self, FromSceneError> {
        check(&scene).map_err(FromSceneError::Option)?;
        // The scene is rotated to y upwards only while `of` examines it. The project stores it as it was given, and rotates it when it is built.
        let standing = (scene.objects.clone(), scene.cameras.clone(), scene.lights.clone(), scene.origin);
        turn(&mut scene, options.up);
        let mut projects = Self::of(&scene, &[], options, window)?;
        (scene.objects, scene.cameras, scene.lights, scene.origin) = standing;
        projects.base.scenes[0].memory = Some(Arc::new(scene));
        Ok(projects)
    }

    fn of(
        scene: &Scene,
        files: &[PathBuf],
        options: &SceneOptions,
        window: Option<[u32; 2]>,
    ) -> Result<Self, FromSceneError> {
        let name = name_of(files);
        let contents = Contents::of(scene).ok_or_else(|| {
            let first = files.first().map_or(Path::new(""), PathBuf::as_path);
            let error = SceneError::file(first, "the scene has no triangle: there is nothing to look at");
            let said: Vec<String> = scene
                .warnings
                .groups()
                .iter()
                .map(|group| format!("{} {}: {}", group.count, group.what, group.remedy))
                .collect();
            if said.is_empty() { error } else { error.help(format!("the file has {}", said.join(", "))) }
        })?;
        let window = window.unwrap_or(WINDOW);
        let mut notes = Notes::default();
        notes.add(format!("a project made from {}; `curitiba scene … --project FILE.xml` writes it", listed(files)));
        let focus = contents.focus;
        let cameras = cameras(scene, options, &contents, window, &mut notes)?;
        let lights = lights::of(scene, options, focus, &cameras[0], &mut notes);
        let glass = glass(scene);
        let shade = contents.shell.as_ref().filter(|shell| !shell.is_sky);
        let shade = shade.filter(|_| lights.iter().all(|light| light.position.is_none()));
        let usual = Effects { shadows: shade.is_none(), occlusion: true, glass: !glass.is_empty() };
        let effects = options.effects.unwrap_or(usual);
        notes.add(effects_in_words(effects, &glass, options));
        for sky in &contents.skies {
            let name = &scene.materials[*sky as usize].name;
            notes.add(format!("sky: `{name}` shows as it is, and is in the way of neither light nor occlusion"));
        }
        if let (Some(shell), None) = (shade, options.effects) {
            notes.add(format!("no shadows: all of the scene lies in that of `{}`; `--effects` takes them", shell.name));
        }
        let radius = two_digits(focus.diagonal() * RADIUS);
        if effects.occlusion {
            notes.add(format!(
                "occlusion radius: {radius}, a twentieth of the diagonal of what is looked at; `--set pass2.radius=…`"
            ));
        }
        let base = Project {
            path: files.first().cloned().unwrap_or_default(),
            source: files.first().cloned().unwrap_or_default(),
            name: name.clone(),
            window,
            color: ColorSpace::Linear,
            scenes: vec![SceneDecl {
                name: "MainScene".to_owned(),
                files: files.iter().map(|path| SceneFile { path: path.clone(), place: place(path) }).collect(),
                memory: None,
                shapes: Vec::new(),
                exact: None,
                place: Placement::default(),
                swap_yz: options.up == Up::Z,
                unitize: false,
                sky: sky(scene, &contents),
            }],
            viewports: vec![Viewport {
                name: "Window".to_owned(),
                origin: [0.0; 2],
                size: [1.0; 2],
                clear_color: options.background.unwrap_or(BACKGROUND).extend(1.0),
            }],
            cameras,
            lights,
            light_cameras: Vec::new(),
            targets: Vec::new(),
            pipelines: Vec::new(),
            default_pipeline: 0,
            problems: notes.0,
        };
        Ok(Self { base, glass, radius, effects })
    }

    /// The project with the requested effects, or else with those that suit the scene.
    #[must_use]
    pub fn project(&self) -> Project {
        // Without the glass effect, glass is drawn as an opaque surface.
        let glass: &[String] = if self.effects.glass { &self.glass } else { &[] };
        self.with(&passes::steps(self.effects), glass, (self.effects.occlusion, true))
    }

    /// Projects of the same scene, one for each effect by rays and by rasterisation, with the file names of the report's projects.
    /// Raster effects support one directional light: with other lights, the raster effects that read a light are left out.
    #[must_use]
    pub fn by_technique(&self) -> Vec<(&'static str, Project)> {
        let has_sun = matches!(&self.base.lights[..], [light] if light.direction.is_some());
        let rays = |program| vec![Step::Rays(program)];
        let raster = |program| vec![Step::Raster(program)];
        [
            ("SceneNoEffects.xml", Vec::new()),
            ("SceneDummy.xml", rays(RayProgram::Dummy)),
            ("SceneShadows.xml", rays(RayProgram::DeferredShadows)),
            ("SceneReflect.xml", rays(RayProgram::Reflection)),
            ("SceneRefract.xml", rays(RayProgram::Refraction)),
            ("SceneSSAO.xml", rays(RayProgram::Ssao)),
            ("SceneFinal.xml", rays(RayProgram::Final)),
            ("raster/SceneShadowMap.xml", raster(EffectProgram::ShadowMap)),
            ("raster/SceneCubeReflect.xml", raster(EffectProgram::CubeReflection)),
            ("raster/SceneCubeRefract.xml", raster(EffectProgram::CubeRefraction)),
            ("raster/ScenePlanarReflect.xml", raster(EffectProgram::PlanarReflection)),
            ("raster/SceneScreenReflect.xml", raster(EffectProgram::ScreenReflection)),
            ("raster/SceneScreenRefract.xml", raster(EffectProgram::ScreenRefraction)),
            ("raster/SceneGTAO.xml", raster(EffectProgram::HorizonOcclusion)),
            ("raster/SceneDepthOcclusion.xml", raster(EffectProgram::DepthOcclusion)),
        ]
        .into_iter()
        .filter(|(_, steps)| has_sun || !steps.iter().any(Step::is_lit_raster))
        // Raster effects only support the report's panes.
        .map(|(file, steps)| (file, self.with(&steps, &self.glass, (true, false))))
        .collect()
    }

    fn with(&self, steps: &[Step], glass: &[String], (occlusion, bodies): (bool, bool)) -> Project {
        let background = self.base.viewports[0].clear_color.truncate();
        let lights = (0..self.base.lights.len()).collect();
        let common =
            Common { window: self.base.window, background, lights, glass, radius: self.radius, occlusion, bodies };
        let (targets, pipeline) = common.pipeline(steps);
        Project { targets, pipelines: vec![pipeline], ..self.base.clone() }
    }
}

/// Checks a scene that no loader made.
fn check(scene: &Scene) -> Result<(), String> {
    for (index, object) in scene.objects.iter().enumerate() {
        if object.mesh as usize >= scene.meshes.len() {
            return Err(format!("object {index} names mesh {}; there are {}", object.mesh, scene.meshes.len()));
        }
    }
    for (index, mesh) in scene.meshes.iter().enumerate() {
        let count = mesh.positions.len();
        for (what, found) in [("normals", mesh.normals.len()), ("texture coordinates", mesh.texcoords.len())] {
            if found != 0 && found != count {
                return Err(format!("mesh {index} has {found} {what} for {count} positions; valid: as many, or none"));
            }
        }
        for group in &mesh.groups {
            if group.material as usize >= scene.materials.len() {
                let materials = scene.materials.len();
                return Err(format!("mesh {index} names material {}; there are {materials}", group.material));
            }
            if let Some(corner) = group.triangles.iter().flatten().find(|corner| **corner as usize >= count) {
                return Err(format!("mesh {index} has a triangle with corner {corner}; there are {count} positions"));
            }
        }
    }
    let lost =
        |material: &&scene::Material| material.textures().any(|texture| texture as usize >= scene.textures.len());
    match scene.materials.iter().find(lost) {
        Some(material) => Err(format!("material `{}` names a texture that is not there", material.name)),
        None => Ok(()),
    }
}

/// Notes, which have no place in a file.
#[derive(Default)]
struct Notes(Problems);

impl Notes {
    fn add(&mut self, message: String) {
        self.0.0.push(Problem { severity: Severity::Note, place: None, message, help: None });
    }
}

fn place(path: &Path) -> String {
    path.display().to_string()
}

fn listed(files: &[PathBuf]) -> String {
    match files {
        [only] => only.display().to_string(),
        [] => "a scene in memory".to_owned(),
        _ => format!("{} scene files, {} and others", files.len(), files.first().map_or(String::new(), |p| place(p))),
    }
}

/// The stem of the first file, cleaned for use as a project's name.
fn name_of(files: &[PathBuf]) -> String {
    let stem = files.first().and_then(|file| file.file_stem()).map(|stem| stem.to_string_lossy().into_owned());
    clean(&stem.unwrap_or_default()).unwrap_or_else(|| "scene".to_owned())
}

/// A name as a project file can hold it; `None` if nothing remains.
fn clean(name: &str) -> Option<String> {
    let visible: String = name.chars().map(|c| if c.is_control() { ' ' } else { c }).take(200).collect();
    let folded = visible.split_whitespace().collect::<Vec<_>>().join(" ");
    (!folded.is_empty()).then_some(folded)
}

/// Rotates everything in a scene so that the axis `up` becomes y.
fn turn(scene: &mut Scene, up: Up) {
    let turn = up.turn();
    scene.origin = turn.as_dmat4().transform_point3(scene.origin);
    for object in &mut scene.objects {
        object.transform = turn * object.transform;
    }
    for camera in &mut scene.cameras {
        camera.position = turn.transform_point3(camera.position);
        camera.direction = turn.transform_vector3(camera.direction);
        camera.up = turn.transform_vector3(camera.up);
    }
    for light in &mut scene.lights {
        light.direction = turn.transform_vector3(light.direction);
        light.position = light.position.map(|position| turn.transform_point3(position));
    }
}

/// The cameras of the file, and one that is described or placed; the default camera comes first.
fn cameras(
    scene: &Scene,
    options: &SceneOptions,
    contents: &Contents,
    window: [u32; 2],
    notes: &mut Notes,
) -> Result<Vec<Camera>, FromSceneError> {
    let made = view::camera(options, contents, window).map_err(FromSceneError::Option)?;
    let mut cameras: Vec<Camera> = Vec::with_capacity(scene.cameras.len() + 1);
    let mut taken = HashSet::from([made.name.to_lowercase()]);
    // For each name of the file: the number that its next camera tries first, because those below are taken.
    let mut numbers: HashMap<String, usize> = HashMap::new();
    for camera in &scene.cameras {
        let base = clean(&camera.name).unwrap_or_else(|| "camera".to_owned());
        let number = numbers.entry(base.to_lowercase()).or_insert(2);
        let mut name = base.clone();
        while !taken.insert(name.to_lowercase()) {
            name = format!("{base} {number}");
            *number += 1;
        }
        cameras.push(view::of_file(camera, scene.origin, name, contents.whole, window));
    }
    let own = (!options.has_camera()).then(|| cameras.first().map(|camera| camera.name.clone())).flatten();
    match &own {
        Some(name) => notes.add(format!("camera: `{name}` of the scene; `--camera Camera` takes another")),
        None if options.has_camera() => {}
        None => {
            let sees = match &contents.shell {
                Some(shell) if shell.hides => format!("it stands inside `{}`, which is around all else", shell.name),
                Some(shell) => format!("it sees all but `{}`, which is around that and clear from outside", shell.name),
                None if contents.focus == contents.whole => "it sees all of the scene".to_owned(),
                None => "it sees the scene but for a few far triangles".to_owned(),
            };
            notes.add(format!("camera: {sees}; `--look-from X,Y,Z` puts it elsewhere"));
        }
    }
    let first = if own.is_some() { cameras.len() } else { 0 };
    cameras.insert(first, made);
    Ok(cameras)
}

/// Names of the drawn materials that transmit enough light to be glass.
fn glass(scene: &Scene) -> Vec<String> {
    let mut drawn = vec![false; scene.materials.len()];
    for object in &scene.objects {
        for group in &scene.meshes[object.mesh as usize].groups {
            drawn[group.material as usize] |= !group.triangles.is_empty();
        }
    }
    let materials = scene.materials.iter().zip(drawn);
    materials
        .filter(|(material, drawn)| *drawn && material.transmission >= TRANSPARENT)
        .map(|(m, _)| m.name.clone())
        .collect()
}

/// The materials of the skies.
fn sky(scene: &Scene, contents: &Contents) -> Vec<MaterialPattern> {
    let names = contents.skies.iter().map(|material| scene.materials[*material as usize].name.clone());
    names.map(MaterialPattern::Named).collect()
}

fn effects_in_words(effects: Effects, glass: &[String], options: &SceneOptions) -> String {
    const NAMED: usize = 3;
    let mut words = format!("effects: {effects}");
    if options.effects.is_none() {
        words.push_str(&match glass {
            [] => "; no material of the scene is glass".to_owned(),
            _ => {
                let names = glass.iter().take(NAMED).map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
                let more = glass.len().saturating_sub(NAMED);
                if more > 0 { format!("; glass: {names} and {more} more") } else { format!("; glass: {names}") }
            }
        });
    } else if effects.glass && glass.is_empty() {
        words.push_str("; no material of the scene is glass, so nothing mirrors");
    }
    words
}

#[cfg(test)]
pub(crate) mod tests;
