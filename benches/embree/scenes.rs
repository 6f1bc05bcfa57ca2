//! The scenes, their cameras and lights, and the jobs of their ray passes.

use crate::rng::Numbers;
use crate::shapes;
use curitiba::engines;
use curitiba::passes::trace::{Bvh, Quality, Ray, Tracer};
use curitiba::pipeline::backend::{
    BackendError, BuildStats, NO_TRIANGLE, PixelCone, RayBackend, RayJob, RayStats, Shade, Sun,
};
use curitiba::pipeline::executor::{Engines, Progress, Renderer, Silent};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::{Fidelity, RayParams, RayProgram};
use curitiba::pipeline::scene::{BuildOptions, Geometry, LoadOptions, Needs, RenderScene, Scene, load};
use curitiba::pipeline::square;
use glam::Vec3;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// A pinhole camera and the light.
#[derive(Debug, Clone, Copy)]
pub struct View {
    pub eye: Vec3,
    pub forward: Vec3,
    /// Vertical field of view in degrees.
    pub fov: f32,
    /// Unit vector towards the light.
    pub to_light: Vec3,
    /// Greatest length of short occlusion rays.
    pub radius: f32,
}

/// The view `Fonte` of the projects, with their sun.
fn fonte() -> View {
    View {
        eye: Vec3::new(7.42, 18.61, -38.62),
        forward: Vec3::new(0.31, -0.36, 0.87),
        fov: 60.0,
        to_light: Vec3::new(-0.597, 0.390, -0.700).normalize(),
        radius: 0.5,
    }
}

/// The scenes of the user's folder for which the bench has a view, as file and view.
fn known(name: &str) -> Option<(&'static str, View)> {
    let view = |eye: [f32; 3], target: [f32; 3], fov, light: [f32; 3], radius| {
        let eye = Vec3::from(eye);
        View { eye, forward: Vec3::from(target) - eye, fov, to_light: Vec3::from(light).normalize(), radius }
    };
    match name {
        "sponza" => Some((
            "crytek_sponza/sponza.obj",
            view([-1100.0, 250.0, -40.0], [0.0, 300.0, -20.0], 70.0, [0.15, 1.0, 0.1], 50.0),
        )),
        "dragon" => Some((
            "meshes/stanford_dragon_348k.glb",
            view([0.6, 1.9, -3.6], [0.08, 1.0, 0.0], 38.0, [0.4, 0.8, -0.5], 0.5),
        )),
        _ => None,
    }
}

/// A scene, with the jobs of its ray passes.
pub struct Subject {
    pub name: String,
    pub view: View,
    pub scene: Arc<RenderScene>,
    /// Jobs of ray passes, by name.
    pub jobs: Vec<(&'static str, OwnedJob)>,
}

/// A [`RayJob`] that owns its images.
pub struct OwnedJob {
    program: RayProgram,
    params: RayParams,
    eye: Vec3,
    sun: Option<Sun>,
    width: u32,
    height: u32,
    position: Vec<[f32; 4]>,
    normal: Vec<[f32; 4]>,
    color: Vec<[f32; 4]>,
    triangle: Vec<u32>,
    shades: Vec<Shade>,
    glass: Vec<bool>,
    shadow_glass: Vec<bool>,
}

impl OwnedJob {
    fn of(job: &RayJob<'_>) -> Self {
        Self {
            program: job.program,
            params: job.params,
            eye: job.eye,
            sun: job.sun,
            width: job.width,
            height: job.height,
            position: job.position.to_vec(),
            normal: job.normal.to_vec(),
            color: job.color.to_vec(),
            triangle: job.triangle.to_vec(),
            shades: job.shades.to_vec(),
            glass: job.glass.to_vec(),
            shadow_glass: job.shadow_glass.to_vec(),
        }
    }

    pub fn job<'a>(&'a self, scene: &'a RenderScene) -> RayJob<'a> {
        RayJob {
            from_camera: None,
            origin: [0; 2],
            scene,
            program: self.program,
            params: self.params,
            fidelity: Fidelity::Corrected,
            seed: 0,
            eye: self.eye,
            cone: PixelCone::default(),
            lights: &[],
            sun: self.sun,
            width: self.width,
            height: self.height,
            position: &self.position,
            normal: &self.normal,
            color: &self.color,
            triangle: &self.triangle,
            shared: None,
            shades: &self.shades,
            glass: &self.glass,
            shadow_glass: &self.shadow_glass,
            beyond: Vec3::ZERO,
            dielectrics: &[],
        }
    }

    /// By material: whether its hits are passed to the program.
    pub fn filtered(&self) -> Vec<bool> {
        let cut = self.shades.iter().map(|shade| shade.alpha_cutoff.is_some());
        cut.zip(&self.shadow_glass).map(|(cut, glass)| cut || *glass).collect()
    }
}

/// Prepares a scene. `name` is `square:TRIANGLES`, one of [`shapes::KINDS`] with `:TRIANGLES`, a name that [`known`] has, or a
/// file in `folder`; `@SEED` may follow. The seed chooses the view. Without a seed, the square and the known scenes have the
/// views that are written in this file, and other scenes have the view of seed 1.
///
/// # Errors
/// The reason why it cannot be prepared.
pub fn open(name: &str, folder: Option<&Path>, size: u32) -> Result<Subject, String> {
    let (plain, seed) = match name.rsplit_once('@') {
        Some((plain, seed)) => {
            let seed = seed.parse().map_err(|_| format!("{name}: a number follows the @"))?;
            (plain, Some(seed))
        }
        None => (name, None),
    };
    let made = plain.split_once(':').map(|(kind, triangles)| {
        let triangles = triangles.parse().map_err(|_| format!("{name}: a number of triangles follows the colon"))?;
        Ok::<(&str, u32), String>((kind, triangles))
    });
    let (scene, view) = match (made.transpose()?, seed) {
        (Some(("square", triangles)), None) => return open_square(name, triangles, size),
        (Some(("square", triangles)), Some(_)) => {
            let folder = tempfile::tempdir().map_err(|error| format!("{name}: {error}"))?;
            square::generate(triangles).write(folder.path()).map_err(|error| format!("{name}: {error}"))?;
            let entries = std::fs::read_dir(folder.path()).map_err(|error| format!("{name}: {error}"))?;
            let mut files: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
            files.retain(|file| file.extension().is_some_and(|extension| extension == "cbo"));
            files.sort();
            (read(name, &files)?, None)
        }
        (Some((kind, triangles)), _) => (build(name, shapes::scene(kind, triangles)?)?, None),
        (None, _) => {
            let (file, view) = known(plain).map_or((plain, None), |(file, view)| (file, Some(view)));
            let folder = folder.ok_or("CURITIBA_SCENES names no folder")?;
            (read(name, &[folder.join(file)])?, view.filter(|_| seed.is_none()))
        }
    };
    let bvh = Bvh::build(&scene.geometry, &[], Quality::Balanced);
    let view = match view {
        Some(view) => view,
        None => View::chosen(&scene.geometry, &bvh, seed.unwrap_or(1))
            .ok_or_else(|| format!("{name}: no view of this seed sees enough of the scene"))?,
    };
    Ok(white(name, &Arc::new(scene), &bvh, view, size))
}

/// The generated square, with the jobs of the projects' ray passes.
fn open_square(name: &str, triangles: u32, size: u32) -> Result<Subject, String> {
    let text = |error: &dyn std::fmt::Display| format!("{name}: {error}");
    let copy = tempfile::tempdir().map_err(|error| text(&error))?;
    square::generate(triangles).write(&copy.path().join("3dsmodels")).map_err(|error| text(&error))?;
    let projects = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects");
    std::fs::create_dir(copy.path().join("mlibs")).map_err(|error| text(&error))?;
    let mut files: Vec<PathBuf> = Vec::new();
    for folder in [projects.clone(), projects.join("mlibs")] {
        let entries = std::fs::read_dir(folder).map_err(|error| text(&error))?;
        files.extend(entries.filter_map(|entry| Some(entry.ok()?.path())).filter(|path| path.is_file()));
    }
    for file in files {
        let relative = file.strip_prefix(&projects).expect("a file of the folder");
        std::fs::copy(&file, copy.path().join(relative)).map_err(|error| text(&error))?;
    }
    let mut scene = None;
    let mut jobs = Vec::new();
    for (job_name, project) in
        [("shadows", "SceneShadows.xml"), ("occlusion", "SceneSSAO.xml"), ("final", "SceneFinal.xml")]
    {
        let project = curitiba::pipeline::project::load(&copy.path().join(project)).map_err(|error| text(&error))?;
        let settings = Settings { size: Some([size; 2]), ..Settings::default() };
        let plan = Plan::new(project, settings).map_err(|error| text(&error))?;
        let seen = Arc::default();
        let choice = curitiba::Choice::CPU;
        let raster = engines::choose(choice).map_err(|error| text(&error))?.raster;
        let engines = Engines::new(raster, Box::new(Listener(Arc::clone(&seen))));
        let mut renderer = Renderer::new(plan, engines, &mut Silent).map_err(|error| text(&error))?;
        renderer.frame(&mut Silent).map_err(|error| text(&error))?;
        let (seen_scene, job) = std::mem::take(&mut *seen.lock().expect("one thread"));
        scene = scene.or(seen_scene);
        jobs.push((job_name, job.ok_or("the project traced no rays")?));
    }
    let scene = scene.ok_or("the project built no scene")?;
    Ok(Subject { name: name.to_owned(), view: fonte(), scene, jobs })
}

type Seen = Arc<Mutex<(Option<Arc<RenderScene>>, Option<OwnedJob>)>>;

/// A ray backend that keeps its inputs and traces nothing.
struct Listener(Seen);

impl RayBackend for Listener {
    fn name(&self) -> &'static str {
        "listener"
    }

    fn device(&self) -> String {
        String::new()
    }

    fn supports(&self, _: RayProgram, _: Fidelity) -> Result<(), BackendError> {
        Ok(())
    }

    fn build(&mut self, scene: &Arc<RenderScene>, _: &[bool]) -> Result<BuildStats, BackendError> {
        self.0.lock().expect("one thread").0 = Some(Arc::clone(scene));
        Ok(BuildStats { bytes: 0, nodes: 0 })
    }

    fn bytes_per_triangle(&self) -> u64 {
        0
    }

    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, _: &Progress) -> Result<RayStats, BackendError> {
        self.0.lock().expect("one thread").1 = Some(OwnedJob::of(job));
        output.pixels.fill([0.0; 4]);
        Ok(RayStats::default())
    }
}

fn read(name: &str, files: &[PathBuf]) -> Result<RenderScene, String> {
    let options = LoadOptions { needs: NEEDS, max_bytes: LoadOptions::DEFAULT_MAX_BYTES };
    let loaded = load(files, &options, &|_| {}).map_err(|error| format!("{name}: {error}"))?;
    build(name, loaded)
}

const NEEDS: Needs = Needs { normals: true, ..Needs::NOTHING };

fn build(name: &str, scene: Scene) -> Result<RenderScene, String> {
    let options = BuildOptions { needs: NEEDS, ..BuildOptions::default() };
    RenderScene::build(scene, &options).map(|(scene, _)| scene).map_err(|error| format!("{name}: {error}"))
}

/// A scene in all white, with a G-buffer from primary rays.
fn white(name: &str, scene: &Arc<RenderScene>, bvh: &Bvh, view: View, size: u32) -> Subject {
    let materials = scene.materials.len();
    let pixels = (size * size) as usize;
    let shade = Shade::default();
    let mut base = OwnedJob {
        program: RayProgram::Ssao,
        params: RayParams { radius: view.radius, ..RayParams::default() },
        eye: view.eye,
        sun: Some(Sun { direction: -view.to_light, color: Vec3::ONE }),
        width: size,
        height: size,
        position: vec![[0.0; 4]; pixels],
        normal: vec![[0.0; 4]; pixels],
        color: vec![[1.0; 4]; pixels],
        triangle: vec![NO_TRIANGLE; pixels],
        shades: vec![shade; materials],
        glass: vec![false; materials],
        shadow_glass: vec![false; materials],
    };
    let geometry = &scene.geometry;
    for index in 0..pixels {
        let direction = view.direction(index as u32 % size, index as u32 / size, size);
        let ray = Ray { origin: view.eye, direction, t_min: 0.0, t_max: f32::INFINITY };
        let Some(hit) = bvh.closest(&ray, |_| true) else { continue };
        let [a, b, c] = geometry.triangles[hit.triangle as usize].map(|vertex| geometry.normals[vertex as usize]);
        let normal = (a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v).normalize_or_zero();
        let cosine = normal.dot(view.to_light).max(0.0);
        base.position[index] = (view.eye + direction * hit.t).extend(cosine).to_array();
        base.normal[index] = normal.extend(0.0).to_array();
        base.triangle[index] = hit.triangle;
    }
    let with = |program| OwnedJob { program, ..OwnedJob::of(&base.job(scene)) };
    let jobs = vec![("shadows", with(RayProgram::DeferredShadows)), ("occlusion", with(RayProgram::Ssao))];
    Subject { name: name.to_owned(), view, scene: Arc::clone(scene), jobs }
}

impl View {
    /// The first view of a seed's sequence that sees something in most directions, and not too near. The eye is a point
    /// of the scene's box; the target is a point of a triangle (chosen by area). The light comes from any direction
    /// above.
    fn chosen(geometry: &Geometry, bvh: &Bvh, seed: u32) -> Option<Self> {
        const PROBES: u32 = 16;
        let [low, high] = [Vec3::INFINITY, Vec3::NEG_INFINITY];
        let low = geometry.positions.iter().fold(low, |low, p| low.min(*p));
        let high = geometry.positions.iter().fold(high, |high, p| high.max(*p));
        let diagonal = (high - low).length();
        let mut sum = 0.0;
        let areas: Vec<f64> = (0..geometry.triangles.len())
            .map(|triangle| {
                let [a, b, c] = geometry.triangles[triangle].map(|vertex| geometry.positions[vertex as usize]);
                sum += f64::from((b - a).cross(c - a).length());
                sum
            })
            .collect();
        let mut numbers = Numbers::new(seed);
        (0..1024).find_map(|_| {
            let share = Vec3::new(numbers.unit(), numbers.unit(), numbers.unit());
            let eye = low + (high - low) * (share * 0.9 + 0.05);
            let place = f64::from(numbers.unit()) * sum;
            let triangle = areas.partition_point(|&area| area < place).min(areas.len() - 1);
            let corners = geometry.triangles[triangle].map(|vertex| geometry.positions[vertex as usize]);
            let forward = (corners[0] + corners[1] + corners[2]) / 3.0 - eye;
            let around = numbers.direction();
            let to_light = Vec3::new(around.x, around.y.abs() + 0.2, around.z).normalize();
            let view = Self { eye, forward, fov: 60.0, to_light, radius: diagonal / 100.0 };
            if forward.normalize_or_zero().y.abs() > 0.9 || forward.length() < 0.02 * diagonal {
                return None;
            }
            let probe = |index| {
                let direction = view.direction(index % PROBES, index / PROBES, PROBES);
                let ray = Ray { origin: eye, direction, t_min: 0.0, t_max: f32::INFINITY };
                bvh.closest(&ray, |_| true).map_or(f32::INFINITY, |hit| hit.t)
            };
            let mut distances: Vec<f32> = (0..PROBES * PROBES).map(probe).collect();
            distances.sort_unstable_by(f32::total_cmp);
            let is_open = distances[distances.len() / 8] > 0.01 * diagonal;
            let is_filled = distances[distances.len() * 7 / 10].is_finite();
            (is_open && is_filled).then_some(view)
        })
    }

    /// Direction of the primary ray through a pixel's centre.
    pub fn direction(&self, x: u32, y: u32, size: u32) -> Vec3 {
        let half = (self.fov.to_radians() / 2.0).tan();
        let forward = self.forward.normalize();
        let right = forward.cross(Vec3::Y).normalize();
        let up = right.cross(forward);
        let at = |k: u32| (k as f32 + 0.5) / size as f32 * 2.0 - 1.0;
        (forward + right * (at(x) * half) - up * (at(y) * half)).normalize()
    }
}
