//! A renderer on a thread of its own: engines belong to the thread that made them.

use crate::work::{Watch, wait};
use crate::{arrays, failed, invalid};
use curitiba::passes::raster::gpu;
use curitiba::pipeline::backend::{RayCounts, Rect};
use curitiba::pipeline::diagnostic::valid_names;
use curitiba::pipeline::executor::{self, Cancellation, ChangeError, Goal, RenderError, Row};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::pixel_samples::PixelSamples;
use curitiba::pipeline::plan::{Settings, Work};
use curitiba::pipeline::programs::Fidelity;
use curitiba::pipeline::project::{PassKind, Pose, SceneOptions, Up};
use curitiba::{BackendChoice, Choice, Gpus, RasterChoice};
use glam::Vec3;
use numpy::PyArray3;
use pyo3::exceptions::PyModuleNotFoundError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::path::PathBuf;
use std::sync::mpsc::{Sender, channel};

type Job = Box<dyn FnOnce(&mut executor::Renderer) + Send>;

/// A project or scene, ready to be rendered; made by `open`.
///
/// Setters are checked at once and take effect with the next picture. `render` then runs only the passes that depend on them; its
/// picture equals, bit for bit, that of a renderer that was opened with these settings.
#[pyclass(frozen, module = "curitiba")]
pub struct Renderer {
    jobs: Sender<Job>,
    stop: Cancellation,
    watch: Watch,
}

/// The choice with the name `value`, or an error that lists the valid names.
fn named<T: Copy>(what: &str, value: &str, valid: &[(&str, T)]) -> PyResult<T> {
    valid.iter().find(|(name, _)| *name == value).map(|(_, choice)| *choice).ok_or_else(|| {
        invalid(format!("`{what}` is `{value}`; {}", valid_names(value, valid.iter().map(|(name, _)| *name))))
    })
}

/// A parameter's value as text: given as text, a number or a truth value.
fn text(value: &Bound<'_, PyAny>) -> PyResult<String> {
    Ok(value.str()?.to_cow()?.into_owned())
}

/// Numbers in the notation of the command line.
fn written<T: ToString>(values: &[T]) -> String {
    values.iter().map(ToString::to_string).collect::<Vec<_>>().join(",")
}

/// Libraries for tables, the preferred one first.
const LIBRARIES: [&str; 2] = ["pandas", "polars"];

/// Whether a table is wanted, and from which library.
#[derive(FromPyObject)]
enum Table {
    Yes(bool),
    Of(String),
}

impl Table {
    /// The libraries to try; none where no table is wanted.
    fn libraries(&self) -> PyResult<&'static [&'static str]> {
        match self {
            Self::Yes(false) => Ok(&[]),
            Self::Yes(true) => Ok(&LIBRARIES),
            Self::Of(name) => {
                let index = named("as_frame", name, &[("pandas", 0), ("polars", 1)])?;
                Ok(&LIBRARIES[index..=index])
            }
        }
    }
}

/// Engine arguments as Python passes them.
struct EngineArguments<'a> {
    raster: &'a str,
    backend: &'a str,
    fallback: &'a [String],
    adapter: Option<&'a Bound<'a, PyAny>>,
    gpus: Option<&'a Bound<'a, PyAny>>,
}

impl EngineArguments<'_> {
    fn choice(&self) -> PyResult<Choice> {
        let names = BackendChoice::ALL.map(|backend| (backend.name(), backend));
        let mut fallback = Vec::new();
        for name in self.fallback {
            let backend = named("fallback", name, &names)?;
            // A backend that is named twice is tried once.
            if !fallback.contains(&Some(backend)) {
                fallback.push(Some(backend));
            }
        }
        fallback.resize(4, None);
        let adapter = match self.adapter {
            Some(adapter) => Some(gpu::named(&text(adapter)?).map_err(|why| invalid(format!("adapter: {why}")))?),
            None => None,
        };
        let gpus: Gpus = match self.gpus {
            Some(gpus) => text(gpus)?.parse().map_err(|why| invalid(format!("gpus: {why}")))?,
            None => Gpus::default(),
        };
        Ok(Choice {
            raster: named("raster", self.raster, &RasterChoice::NAMES)?,
            backend: named("backend", self.backend, &BackendChoice::NAMES)?,
            gpus,
            adapter,
            fallback: [fallback[0], fallback[1], fallback[2], fallback[3]],
        })
    }
}

#[derive(FromPyObject)]
struct SceneArguments {
    effects: Option<String>,
    look_from: Option<[f64; 3]>,
    look_at: Option<[f64; 3]>,
    fov: Option<f32>,
    sun: Option<[f32; 3]>,
    up: Option<String>,
    background: Option<[f32; 3]>,
}

impl SceneArguments {
    fn options(&self) -> PyResult<SceneOptions> {
        let vector = |value: &Option<[f32; 3]>, parse: fn(&str) -> Result<Vec3, String>| {
            value.as_ref().map(|value| parse(&written(value)).map_err(invalid)).transpose()
        };
        let point = |value: &Option<[f64; 3]>| {
            value.as_ref().map(|value| SceneOptions::parse_point(&written(value)).map_err(invalid)).transpose()
        };
        Ok(SceneOptions {
            effects: self.effects.as_ref().map(|effects| effects.parse().map_err(invalid)).transpose()?,
            look_from: point(&self.look_from)?,
            look_at: point(&self.look_at)?,
            fov: self.fov.map(|fov| SceneOptions::parse_fov(&fov.to_string()).map_err(invalid)).transpose()?,
            sun: vector(&self.sun, SceneOptions::parse_direction)?,
            up: self.up.as_ref().map_or(Ok(Up::Y), |up| up.parse().map_err(invalid))?,
            background: vector(&self.background, SceneOptions::parse_color)?,
            ..SceneOptions::default()
        })
    }
}

/// A number of samples of every pixel, or a text such as "16:0.02".
#[derive(FromPyObject)]
pub enum SamplesArgument {
    Count(u32),
    Text(String),
}

impl SamplesArgument {
    fn samples(&self, argument: &str) -> PyResult<PixelSamples> {
        let samples = match self {
            Self::Count(count) => count.to_string().parse(),
            Self::Text(text) => text.parse(),
        };
        samples.map_err(|why: String| invalid(format!("{argument}: {why}")))
    }
}

/// Opens a project file, a scene file (.glb, .gltf, .obj, .cbo, .nbo, .3ds, .mesh.xml) or a folder of scenes.
///
/// `size` is (width, height) in pixels; `parameters` are those of passes, such as {"pass2.samples": 16}; `off` names passes that are
/// switched off; `max_memory` is in bytes; `color` is the colour space: if None, the project's own, or "linear" for scene files. `aa` is the
/// number of samples per pixel, 1, 2, 4, 8, 16, 32 or 64, whose mean is the picture. "16:0.02" traces rays for four of them, and for the others
/// only where shadows, occlusion or glass differ by more than 0.02. `crop` is (column, row, width, height) in pixels from the top left: pictures
/// then are (height, width, 4) of that part, equal to the same part of the whole. `bands`, 1 to 1024, renders the same picture in at most this
/// many bands of rows, one after the other, in less memory; None takes as few as `max_memory` allows. `fallback` names ray backends that take
/// over, in this order, if the one before fails; `Renderer.warnings` then says so. `adapter` is the device of wgpu, by its place in `gpus()` or
/// a part of its name; `gpus` is the number of GPUs for cuda and optix, or "all". For scene files alone: `effects` such as "shadows+ao",
/// `look_from` and `look_at` in scene units, `fov` in degrees, `sun` the direction in which it stands, `up` the axis that points up,
/// `background` display values from 0 to 1.
#[pyfunction]
#[pyo3(signature = (
    path, *, size = None, camera = None, pipeline = None, backend = "auto", raster = "auto", fidelity = "corrected", seed = 0,
    parameters = None, off = vec![], max_memory = 8 << 30, effects = None, look_from = None, look_at = None, fov = None,
    sun = None, up = None, background = None, color = None, aa = SamplesArgument::Count(1), crop = None, bands = None, fallback = vec![], adapter = None,
    gpus = None
))]
#[expect(clippy::too_many_arguments, reason = "they have names in Python")]
pub fn open(
    py: Python<'_>,
    path: PathBuf,
    size: Option<[u32; 2]>,
    camera: Option<String>,
    pipeline: Option<String>,
    backend: &str,
    raster: &str,
    fidelity: &str,
    seed: u32,
    parameters: Option<&Bound<'_, PyDict>>,
    off: Vec<String>,
    max_memory: u64,
    effects: Option<String>,
    look_from: Option<[f64; 3]>,
    look_at: Option<[f64; 3]>,
    fov: Option<f32>,
    sun: Option<[f32; 3]>,
    up: Option<String>,
    background: Option<[f32; 3]>,
    color: Option<&str>,
    aa: SamplesArgument,
    crop: Option<[u32; 4]>,
    bands: Option<u32>,
    fallback: Vec<String>,
    adapter: Option<&Bound<'_, PyAny>>,
    gpus: Option<&Bound<'_, PyAny>>,
) -> PyResult<Renderer> {
    let mut set = Vec::new();
    for (key, value) in parameters.into_iter().flat_map(|parameters| parameters.iter()) {
        set.push(format!("{}={}", text(&key)?, text(&value)?));
    }
    let fidelity = named("fidelity", fidelity, &[("corrected", Fidelity::Corrected), ("thesis", Fidelity::Thesis)])?;
    let scene = SceneArguments { effects, look_from, look_at, fov, sun, up, background }.options()?;
    let color = color.map(|color| color.parse().map_err(invalid)).transpose()?;
    let aa = aa.samples("aa")?;
    if let Some(bands) = bands.filter(|bands| !(1..=1024).contains(bands)) {
        return Err(invalid(format!("bands is {bands}; valid: 1 to 1024")));
    }
    let crop = crop.map(|[x, y, width, height]| Rect { x, y, width, height });
    let settings = Settings {
        pipeline,
        camera,
        size,
        fidelity,
        color,
        seed,
        set,
        off,
        max_memory,
        scene,
        crop,
        bands,
        aa,
        ..Settings::default()
    };
    let choice = EngineArguments { raster, backend, fallback: &fallback, adapter, gpus }.choice()?;
    let (jobs, work) = channel::<Job>();
    let (send, opened) = channel();
    let watch = Watch::default();
    let mut observer = watch.clone();
    let thread = std::thread::Builder::new().name("curitiba".to_owned());
    thread
        .spawn(move || {
            let mut renderer = match curitiba::open(&path, settings, choice, &mut observer) {
                Ok(renderer) => renderer,
                Err(error) => {
                    let _ = send.send(Err(error.to_string()));
                    return;
                }
            };
            let told = send.send(Ok(renderer.cancellation()));
            drop(send);
            if told.is_ok() {
                work.into_iter().for_each(|job| job(&mut renderer));
            }
        })
        .map_err(failed)?;
    let opened = wait(py, &Cancellation::new(), &watch, opened)?.ok_or_else(fault)?;
    Ok(Renderer { jobs, stop: opened.map_err(failed)?, watch })
}

fn fault() -> PyErr {
    failed("the renderer ended by a fault of the program; please report it")
}

impl Renderer {
    /// Runs work on the renderer's thread, and waits for the result.
    fn call<T: Send + 'static>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut executor::Renderer) -> T + Send + 'static,
    ) -> PyResult<T> {
        let (send, receive) = channel();
        let job: Job = Box::new(move |renderer| {
            // After an interrupt there is no receiver.
            let _ = send.send(work(renderer));
        });
        self.jobs.send(job).map_err(|_| fault())?;
        wait(py, &self.stop, &self.watch, receive)?.ok_or_else(fault)
    }

    fn set(
        &self,
        py: Python<'_>,
        set: impl FnOnce(&mut executor::Renderer) -> Result<(), ChangeError> + Send + 'static,
    ) -> PyResult<()> {
        self.call(py, |renderer| set(renderer).map_err(|error| error.to_string()))?.map_err(invalid)
    }

    fn picture<'py>(
        &self,
        py: Python<'py>,
        render: impl FnOnce(&mut executor::Renderer, &mut Watch) -> Result<Image, RenderError> + Send + 'static,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let mut watch = self.watch.clone();
        let rendered =
            self.call(py, move |renderer| render(renderer, &mut watch).map_err(|error| error.to_string()))?;
        arrays::picture(py, rendered.map_err(failed)?)
    }
}

/// A pass as Python sees it: name, kind, program, parameters.
type PassFacts = (String, &'static str, Option<&'static str>, Vec<(&'static str, String)>);

#[pymethods]
impl Renderer {
    /// The picture (height, width, 4) with all current settings. The array owns the renderer's memory: nothing is copied for Python.
    fn render<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        self.picture(py, |renderer, watch| renderer.update(watch))
    }

    /// The same picture as `render`, with every pass run again: for measurements.
    fn frame<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        self.picture(py, |renderer, watch| renderer.frame(watch))
    }

    /// A channel of a render target (height, width, 4), such as "pos" or "Deferred Render Targets::norm": a copy.
    ///
    /// Positions are in scene units with the light's cosine in the fourth channel; normals have unit length and 0 there. The first call for
    /// a channel that no pass reads draws the G-buffer again.
    fn target<'py>(&self, py: Python<'py>, name: String) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let mut watch = self.watch.clone();
        let read = self.call(py, move |renderer| -> Result<Image, String> {
            let mut shown = renderer.settings().show.clone();
            if !shown.contains(&name) {
                shown.push(name.clone());
                renderer.set_shown(&shown).map_err(|error| error.to_string())?;
            }
            renderer.refresh(&mut watch).map_err(|error| error.to_string())?;
            let channel = renderer.plan().channel_named(&name).map_err(|error| error.to_string())?;
            if !renderer.holds(channel) {
                return Err(format!(
                    "`{name}` cannot be read: no pass that runs writes it, or the picture is rendered in bands"
                ));
            }
            Ok(renderer.channel_image(channel))
        })?;
        arrays::picture(py, read.map_err(failed)?)
    }

    /// Takes more and more samples of the same sequence in the passes that sample.
    ///
    /// `goal`: an int for samples a point, "2s" or "500ms" for a time, a float below 1 for a standard error. In the result, "image" is the picture,
    /// "error" is the root mean square of the pixels' standard errors (an upper estimate: see docs/library.md), and "passes" has the error of each
    /// pass, with the standard error of each pixel.
    fn accumulate<'py>(&self, py: Python<'py>, goal: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
        // A float is written in exponent notation: without a fraction (1.0) it would otherwise be read as a number of samples.
        let goal = match goal.extract::<f64>() {
            Ok(error) if goal.is_instance_of::<pyo3::types::PyFloat>() => format!("{error:e}"),
            _ => text(goal)?,
        };
        let goal: Goal = goal.parse().map_err(invalid)?;
        let mut watch = self.watch.clone();
        let done = self.call(py, move |renderer| {
            let accumulation = renderer.accumulate(goal, &mut watch).map_err(|error| error.to_string())?;
            let passes: Vec<_> = accumulation
                .passes()
                .iter()
                .map(|pass| (pass.name.clone(), pass.estimate().batches(), pass.error(), pass.standard_error()))
                .collect();
            Ok::<_, String>((accumulation.samples(), accumulation.error(), passes, renderer.window_image()))
        })?;
        let (samples, error, passes, image) = done.map_err(failed)?;
        let found = PyDict::new(py);
        found.set_item("image", arrays::picture(py, image)?)?;
        found.set_item("samples", samples)?;
        found.set_item("error", error)?;
        let list = PyList::empty(py);
        for (name, batches, error, standard_error) in passes {
            let pass = PyDict::new(py);
            pass.set_item("pass", name)?;
            pass.set_item("batches", batches)?;
            pass.set_item("error", error)?;
            pass.set_item("standard_error", arrays::picture(py, standard_error)?)?;
            list.append(pass)?;
        }
        found.set_item("passes", list)?;
        Ok(found)
    }

    /// Lets every pass use this camera; if None, each uses its own.
    #[pyo3(signature = (name = None))]
    fn set_camera(&self, py: Python<'_>, name: Option<String>) -> PyResult<()> {
        self.set(py, move |renderer| renderer.set_camera(name.as_deref()))
    }

    /// Moves a camera; arguments that are not given stay unchanged. Scene units; `fov` is vertical, in degrees.
    #[pyo3(signature = (camera, *, position = None, direction = None, look_at = None, up = None, fov = None))]
    #[expect(clippy::too_many_arguments, reason = "they have names in Python")]
    fn set_pose(
        &self,
        py: Python<'_>,
        camera: String,
        position: Option<[f32; 3]>,
        direction: Option<[f32; 3]>,
        look_at: Option<[f32; 3]>,
        up: Option<[f32; 3]>,
        fov: Option<f32>,
    ) -> PyResult<()> {
        if direction.is_some() && look_at.is_some() {
            return Err(invalid("`direction` and `look_at` are both given; valid: one of them"));
        }
        let name = camera.clone();
        let now = self.call(py, move |renderer| renderer.project().pose(&name))?.map_err(invalid)?;
        let position = position.map_or(now.position, Vec3::from_array);
        let towards = look_at.map(|point| Vec3::from_array(point) - position);
        let pose = Pose {
            position,
            direction: towards.or(direction.map(Vec3::from_array)).unwrap_or(now.direction),
            up: up.map_or(now.up, Vec3::from_array),
            fov_y: fov.map_or(now.fov_y, f32::to_radians),
        };
        self.set(py, move |renderer| renderer.set_pose(&camera, pose))
    }

    /// Lets a light shine in the direction in which it travels, with a linear colour (red, green, blue).
    fn set_light(&self, py: Python<'_>, light: String, direction: [f32; 3], color: [f32; 3]) -> PyResult<()> {
        self.set(py, move |renderer| renderer.set_light(&light, direction.into(), color.into()))
    }

    /// Sets the size of the window, pixels; render targets scale with it.
    fn set_size(&self, py: Python<'_>, width: u32, height: u32) -> PyResult<()> {
        self.set(py, move |renderer| renderer.set_size([width, height]))
    }

    /// Sets a parameter of a ray or effect pass, as `--set PASS.NAME=VALUE`; `curitiba list` names them.
    fn set_parameter(&self, py: Python<'_>, pass_name: String, name: String, value: &Bound<'_, PyAny>) -> PyResult<()> {
        let value = text(value)?;
        self.set(py, move |renderer| renderer.set_parameter(&pass_name, &name, &value))
    }

    /// Switches a pass off or on. A ray or effect pass that is off passes on the colour that it reads, or writes a share of light of 1.
    fn set_enabled(&self, py: Python<'_>, pass_name: String, enabled: bool) -> PyResult<()> {
        self.set(py, move |renderer| renderer.set_enabled(&pass_name, enabled))
    }

    /// Sets the number of samples per pixel, as `aa` of `open` does. The picture is their mean.
    fn set_pixel_samples(&self, py: Python<'_>, samples: SamplesArgument) -> PyResult<()> {
        let samples = samples.samples("samples")?;
        self.set(py, move |renderer| renderer.set_pixel_samples(samples))
    }

    /// Sets the seed of the random numbers, 0 to 2^32 - 1.
    fn set_seed(&self, py: Python<'_>, seed: u32) -> PyResult<()> {
        self.call(py, move |renderer| renderer.set_seed(seed))
    }

    /// Reads the project and its scenes again with the next picture, and keeps the settings.
    fn reload(&self, py: Python<'_>) -> PyResult<()> {
        self.set(py, executor::Renderer::reload)
    }

    /// Every step so far, each as a dict: times in milliseconds, `rays` of one run, `bytes` of memory.
    ///
    /// With `as_frame=True` the result is a pandas.DataFrame, or a polars.DataFrame if pandas is not installed; "pandas" or
    /// "polars" asks for that library.
    #[pyo3(signature = (*, as_frame = None))]
    fn timings<'py>(&self, py: Python<'py>, as_frame: Option<Table>) -> PyResult<Bound<'py, PyAny>> {
        let libraries = as_frame.map_or(Ok(&[][..]), |table| table.libraries())?;
        let rows = self.call(py, |renderer| renderer.timeline().rows.clone())?;
        let list = PyList::empty(py);
        for row in &rows {
            list.append(timing(py, row)?)?;
        }
        if libraries.is_empty() {
            return Ok(list.into_any());
        }
        for library in libraries {
            match py.import(*library) {
                Ok(library) if library.name()? == "polars" => {
                    // The schema is inferred from all rows: the first ones may have no device time.
                    let options = PyDict::new(py);
                    options.set_item("infer_schema_length", py.None())?;
                    return library.call_method("DataFrame", (list,), Some(&options));
                }
                Ok(library) => return library.call_method1("DataFrame", (list,)),
                Err(missing) if missing.is_instance_of::<PyModuleNotFoundError>(py) => {}
                Err(broken) => return Err(broken),
            }
        }
        let wanted = libraries.join(" nor ");
        Err(PyModuleNotFoundError::new_err(format!(
            "a table needs {}, and {} installed; without `as_frame` the rows are a list of dicts",
            LIBRARIES.join(" or "),
            if libraries.len() == 1 { format!("{wanted} is not") } else { format!("neither {wanted} is") },
        )))
    }

    /// Forgets the times of all frames so far, so that frames after a warm-up are measured alone.
    fn forget_timings(&self, py: Python<'_>) -> PyResult<()> {
        self.call(py, executor::Renderer::forget_frames)
    }

    /// Width and height of the window in pixels; the next picture has this size, or that of `crop`.
    #[getter]
    fn size(&self, py: Python<'_>) -> PyResult<(u32, u32)> {
        self.call(py, |renderer| {
            let [width, height] = renderer.settings().size.unwrap_or(renderer.project().window);
            (width, height)
        })
    }

    /// The colour space of the pictures' numbers.
    #[getter]
    fn color(&self, py: Python<'_>) -> PyResult<&'static str> {
        self.call(py, |renderer| renderer.plan().display.space.name())
    }

    /// Names of the cameras, as `set_camera` and `set_pose` take them.
    #[getter]
    fn cameras(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.call(py, |renderer| renderer.project().cameras.iter().map(|camera| camera.name.clone()).collect())
    }

    /// Names of the lights, as `set_light` takes them.
    #[getter]
    fn lights(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.call(py, |renderer| renderer.project().lights.iter().map(|light| light.name.clone()).collect())
    }

    /// The passes of the last picture, in order, with their parameters.
    #[getter]
    fn passes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let facts = self.call(py, |renderer| {
            let plan = renderer.plan();
            let facts = |planned: &curitiba::pipeline::plan::PlannedPass| -> PassFacts {
                let pass = plan.pass(planned);
                let (kind, program, parameters) = match (&pass.kind, &planned.work) {
                    (PassKind::Ray(ray), Work::Rays { params, .. }) => {
                        let info = ray.program.info();
                        ("rays", Some(info.stem), info.params.iter().map(|name| (*name, params.get(name))).collect())
                    }
                    (PassKind::Effect(effect), Work::Effect { params, .. }) => {
                        let info = effect.program.info();
                        ("effect", Some(info.name), info.params.iter().map(|name| (*name, params.get(name))).collect())
                    }
                    (PassKind::Raster(_), _) => ("raster", None, Vec::new()),
                    (PassKind::Quad(_), _) => ("quad", None, Vec::new()),
                    (PassKind::Intersection(_), _) => ("intersections", None, Vec::new()),
                    (PassKind::Compute(_), _) => ("compute", None, Vec::new()),
                    _ => ("off", None, Vec::new()),
                };
                (pass.name.clone(), kind, program, parameters)
            };
            plan.passes.iter().map(facts).collect::<Vec<_>>()
        })?;
        let list = PyList::empty(py);
        for (name, kind, program, parameters) in facts {
            let pass = PyDict::new(py);
            pass.set_item("name", name)?;
            pass.set_item("kind", kind)?;
            pass.set_item("program", program)?;
            let values = PyDict::new(py);
            for (name, value) in parameters {
                values.set_item(name, value)?;
            }
            pass.set_item("parameters", values)?;
            list.append(pass)?;
        }
        Ok(list)
    }

    /// Names of the passes that ran for the last picture.
    #[getter]
    fn passes_run(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.call(py, |renderer| renderer.passes_run().map(str::to_owned).collect())
    }

    /// The raster engine and the ray backend, such as ("cpu", "cpu").
    #[getter]
    fn engines(&self, py: Python<'_>) -> PyResult<(String, String)> {
        self.call(py, |renderer| {
            let engines = renderer.engines();
            (engines.raster.name().to_owned(), engines.rays.name().to_owned())
        })
    }

    /// What was left out or replaced, and ray backends that failed.
    #[getter]
    fn warnings(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.call(py, |renderer| {
            let groups = renderer.warnings().groups().iter().map(ToString::to_string);
            groups.chain(renderer.fallbacks().iter().map(ToString::to_string)).collect()
        })
    }
}

/// A row of the table of times.
fn timing<'py>(py: Python<'py>, row: &Row) -> PyResult<Bound<'py, PyDict>> {
    let facts = PyDict::new(py);
    let device = (!row.device_ms.is_empty()).then(|| executor::median(&row.device_ms));
    facts.set_item("step", row.kind.name())?;
    facts.set_item("name", &row.name)?;
    facts.set_item("per_frame", row.kind.per_frame())?;
    facts.set_item("host_ms", row.median_ms())?;
    facts.set_item("device_ms", device)?;
    facts.set_item("runs", row.host_ms.len())?;
    facts.set_item("rays", row.rays.map(RayCounts::total))?;
    facts.set_item("mrays_per_second", row.mrays_per_second())?;
    facts.set_item("bytes", row.bytes)?;
    facts.set_item("note", &row.note)?;
    Ok(facts)
}
