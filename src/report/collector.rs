//! Carries out the plan: measures rows, compares them with references, and writes their pictures into the folder.

use super::Told;
use super::folder::{Folder, FolderError};
use super::graph;
use super::model::{Against, Effect, FlipMap, Picture, ReportData, Scaling, SceneFacts, Section, Setting, Without};
use super::plan::{self, Entry, Stage, TimePlan, Wanted};
use crate::bench::measure::measure_with;
use crate::bench::model::{BenchFile, BenchRow, FORMAT, RowError, Technique, ThesisFigure, Unavailable};
use crate::bench::table2::{self, TableRow};
use crate::bench::{Case, MeasureOptions};
use crate::engines::{ray_backend, why_not_wgpu};
use crate::environment::Environment;
use crate::passes::raster::gpu::{AdapterChoice, WgpuRasteriser};
use crate::pipeline::backend::BackendError;
use crate::pipeline::color::Display;
use crate::pipeline::executor::{Observer, Silent};
use crate::pipeline::image::{Image, write_displayed};
use crate::pipeline::kept_scenes::KeptScenes;
use crate::pipeline::metrics::{self, flip_map, heat_map};
use crate::pipeline::plan::Settings;
use crate::pipeline::project;
use crate::reference::{self, ReferenceError, References};
use crate::{BackendChoice, Choice, RasterChoice};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Why no report can be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// The folder cannot be used.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The ray backend that was asked for by name is not available.
    #[error(transparent)]
    Engine(#[from] BackendError),
    /// No row could be measured.
    #[error("nothing could be measured in {path}:\n{reasons}", path = path.display())]
    Nothing {
        /// The projects folder.
        path: PathBuf,
        /// One line for each row that was tried.
        reasons: String,
    },
}

/// Inputs of a report.
#[derive(Debug, Clone)]
pub struct Request {
    /// Folder of the projects.
    pub projects: PathBuf,
    /// The command that writes the projects, if they were made for this report. The folder of such projects is temporary, so readers cannot use its
    /// path.
    pub made: Option<String>,
    /// Sizes and time.
    pub wanted: Wanted,
    /// Rasteriser, ray backend and GPUs. There are no fallbacks: if an engine fails, the row is missing, with the reason.
    pub choice: Choice,
    /// Folder of the stored references.
    pub references: PathBuf,
    /// The command line, as the page shows it.
    pub command: String,
    /// Limit of a scene's memory, bytes.
    pub max_memory: u64,
}

/// The folder that [`Request::made`] writes.
pub const PROJECTS: &str = "projects";

/// The state of a collection.
pub(super) struct Collector<'a> {
    pub request: &'a Request,
    pub file: BenchFile,
    /// Scene of the first row.
    scene: SceneFacts,
    pub gpu: bool,
    /// The report's ray backend; `beside` are the others that are available.
    backend: BackendChoice,
    pub beside: Vec<BackendChoice>,
    /// Whether the report's ray backend can filter the share that a program writes. If not, filtered rows are measured on the cpu, which can.
    filters: bool,
    start: Instant,
    pub references: References,
    table: Vec<String>,
    /// Keys of the rows of several samples a pixel, in the page's order.
    pub pixel_samples: Vec<String>,
    pub sections: HashMap<Effect, Section>,
    /// By view: key of the row without effects, and its picture.
    plain: HashMap<String, (String, Image)>,
    /// By effect, view and number of samples a pixel: the case whose reference all such rows are compared with.
    judges: HashMap<Judge, Case>,
    /// By project, view and ray backend (if not the report's): weight, pixels, triangles and frame time of the last row.
    known: HashMap<(String, bool, Option<BackendChoice>), Known>,
    /// Time to open the project of the last row, milliseconds per triangle: of a row without rays, and of one by rays.
    setup_ms: [f64; 2],
    /// Scenes of the rows so far, kept for later rows.
    scenes: KeptScenes,
    /// The entries measured on the user's scene, with the keys of their rows.
    pub measured: Vec<(Entry, String)>,
    pub done: usize,
    pub to_do: usize,
}

/// Effect, view and number of samples a pixel.
type Judge = (String, String, u32);

/// The key of the reference with which a row is compared; rows with equal effect, view and samples share one reference.
fn judge_of(entry: &Entry, row: &BenchRow) -> Judge {
    (entry.effect.to_owned(), row.view.clone(), entry.aa.count())
}

#[derive(Clone, Copy)]
struct Known {
    weight: f64,
    pixels: f64,
    triangles: f64,
    frame_ms: f64,
}

/// Projects, size, lights and threads with which a row is measured.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place<'a> {
    pub projects: &'a Path,
    pub size: [u32; 2],
    pub triangles: Option<u64>,
    /// Number of lights, if the projects are copies with other lights.
    pub lights: Option<u32>,
    /// Number of threads of the processor; `None` for all.
    pub threads: Option<usize>,
    pub stage: Stage,
}

impl<'a> Collector<'a> {
    pub fn new(request: &'a Request) -> Self {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let wanted = &request.wanted;
        Self {
            request,
            file: BenchFile {
                format: FORMAT,
                command: request.command.clone(),
                started_unix_s: now.as_secs(),
                environment: Environment::probe(request.choice),
                frames: wanted.frames().0,
                warmup: 1,
                rounds: plan::ROUNDS,
                complete: false,
                rows: Vec::new(),
                unavailable: Vec::new(),
                paired: Vec::new(),
                machines: Vec::new(),
                part: None,
            },
            scene: SceneFacts { file: String::new(), triangles: 0 },
            gpu: false,
            backend: request.choice.backend,
            beside: Vec::new(),
            filters: false,
            start: Instant::now(),
            references: References::new(
                request.references.clone(),
                Duration::from_secs_f64(wanted.reference_allowance_s()),
            ),
            table: Vec::new(),
            pixel_samples: Vec::new(),
            sections: HashMap::new(),
            plain: HashMap::new(),
            judges: HashMap::new(),
            known: HashMap::new(),
            setup_ms: [0.0; 2],
            scenes: KeptScenes::shared(),
            measured: Vec::new(),
            done: 0,
            to_do: 0,
        }
    }

    pub fn look_for_engines(&mut self) -> Result<(), BackendError> {
        if self.request.choice.raster == RasterChoice::Cpu {
            self.miss("wgpu", "left out: --raster cpu was asked for".to_owned());
        } else if self.request.choice.raster == RasterChoice::Wgpu {
            self.gpu = true;
        } else {
            match WgpuRasteriser::new(self.request.choice.device(AdapterChoice::RealGpu)) {
                Ok(_) => self.gpu = true,
                Err(error) => self.miss("wgpu", error.to_string()),
            }
        }
        let choice = self.request.choice;
        if choice.backend == BackendChoice::Auto {
            let on_gpu = ray_backend(choice.traced_by(BackendChoice::Cuda)).is_ok();
            self.backend = match why_not_wgpu(choice) {
                _ if on_gpu => BackendChoice::Cuda,
                None => BackendChoice::Wgpu,
                Some(_) => BackendChoice::Cpu,
            };
        }
        for backend in BackendChoice::ALL {
            // A software driver is measured only if it is asked for.
            if backend == BackendChoice::Wgpu
                && backend != self.backend
                && let Some(error) = why_not_wgpu(choice)
            {
                self.miss("rays on wgpu", error.reason());
                continue;
            }
            match ray_backend(choice.traced_by(backend)) {
                Ok(rays) => {
                    self.file.environment.add_gpus(rays.as_ref());
                    match backend == self.backend {
                        true => self.filters = rays.filters_shares(),
                        false => self.beside.push(backend),
                    }
                }
                Err(error) if backend == self.backend => return Err(error),
                Err(error) => self.miss(&format!("rays on {}", backend.name()), error.reason()),
            }
        }
        Ok(())
    }

    pub fn miss(&mut self, what: &str, why: String) {
        self.file.unavailable.push(Unavailable { what: what.to_owned(), why });
    }

    pub fn time(&self) -> TimePlan {
        TimePlan { total_s: self.request.wanted.budget_s, spent_s: self.start.elapsed().as_secs_f64() }
    }

    /// The case of an entry at a place.
    pub fn case(&self, entry: &Entry, place: &Place<'_>) -> Result<Case, String> {
        let path = place.projects.join(entry.file);
        if !path.exists() {
            return Err(format!("there is no {}", path.display()));
        }
        let camera = entry.panes.then(|| panes(&path)).flatten();
        let settings = Settings {
            size: Some(place.size),
            camera,
            set: entry.set.clone(),
            aa: entry.aa,
            max_memory: self.request.max_memory,
            // Copies of the projects with a generated square have scenes of their own.
            scenes: if place.triangles.is_none() { self.scenes.clone() } else { KeptScenes::default() },
            ..Settings::default()
        };
        let backend = if entry.is_filtered() && !self.filters { BackendChoice::Cpu } else { self.backend };
        let mut choice = self.request.choice.traced_by(entry.beside.unwrap_or(backend));
        if entry.on_cpu {
            choice.raster = RasterChoice::Cpu;
        }
        let mut case = Case::new(&path, settings, choice).map_err(|error| error.joined())?;
        case.label.clone_from(&entry.label);
        if backend != self.backend {
            case.label += ", cpu";
        }
        case.effect = entry.effect.to_owned();
        case.technique = entry.technique;
        if let Some(triangles) = place.triangles {
            // The path of a temporary folder would be meaningless in a key.
            case.key = format!("square of {triangles} triangles | {} | {:?} | {:?}", entry.file, place.size, entry.set);
        }
        if let Some(lights) = place.lights {
            let lights = plan::scaling_name(Against::Lights, lights.into());
            case.key = format!("{lights} | {} | {:?} | {:?}", entry.file, place.size, entry.set);
        }
        if let Some(threads) = place.threads {
            case.key += &format!(" | {threads} threads");
        }
        Ok(case)
    }

    /// Expected time of a frame, milliseconds: that of an earlier row of the same project, scaled with the work; else a guess.
    fn expected_ms(&self, entry: &Entry, place: &Place<'_>) -> f64 {
        let pixels = pixels(place.size);
        let triangles = place.triangles.map_or(self.scene.triangles as f64, |triangles| triangles as f64);
        let of = |file: &str, panes| self.known.get(&(file.to_owned(), panes, entry.beside));
        let grow = |known: &Known, weight: f64| {
            let by_triangles = if known.triangles > 0.0 { (triangles / known.triangles).max(1.0) } else { 1.0 };
            known.frame_ms * (weight / known.weight).max(0.3) * (pixels / known.pixels).max(0.3) * by_triangles
        };
        if let Some(known) = of(entry.file, entry.panes).or_else(|| of(entry.file, !entry.panes)) {
            return grow(known, entry.weight);
        }
        let factor = match entry.technique {
            Technique::None => 1.0,
            Technique::Raster => 4.0,
            Technique::Rays => 10.0,
        };
        let plain = |panes| self.known.get(&("SceneNoEffects.xml".to_owned(), panes, None));
        let base = plain(entry.panes).or_else(|| plain(false));
        factor * base.map_or(pixels * 3e-4, |known| grow(known, 1.0))
    }

    /// Measures a row.
    ///
    /// # Errors
    /// Why it is not measured.
    pub fn row(
        &mut self,
        entry: &Entry,
        place: &Place<'_>,
        told: &mut dyn FnMut(Told<'_>),
        observer: &mut dyn Observer,
    ) -> Result<(Case, BenchRow, Image), String> {
        let case = self.case(entry, place);
        self.row_of(entry, case, place, told, observer)
    }

    /// [`Self::row`] of a case.
    fn row_of(
        &mut self,
        entry: &Entry,
        case: Result<Case, String>,
        place: &Place<'_>,
        told: &mut dyn FnMut(Told<'_>),
        observer: &mut dyn Observer,
    ) -> Result<(Case, BenchRow, Image), String> {
        self.done += 1;
        let case = case?;
        let expected_ms = self.expected_ms(entry, place);
        let triangles = place.triangles.map_or(self.scene.triangles as f64, |triangles| triangles as f64);
        let (most, slot_ms) = self.request.wanted.frames();
        let frames = plan::frames(expected_ms, slot_ms, most);
        let warmup = self.file.warmup;
        let traces = usize::from(entry.technique == Technique::Rays);
        let setup_s = self.setup_ms[traces] * triangles / 1e3;
        self.time().admit(place.stage, f64::from(frames + warmup) * expected_ms / 1e3 + setup_s)?;
        told(Told { label: &entry.label, done: self.done - 1, of: self.to_do, time: self.time() });
        let options = MeasureOptions { frames, warmup };
        let Ran { row, picture, opened_ms, names } = match place.threads {
            None => run(&case, &options, observer),
            // On a separate pool no progress of single steps is shown.
            Some(threads) => rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .map_err(|error| format!("{threads} threads cannot be started: {error}"))?
                .install(|| run(&case, &options, &mut Silent)),
        }?;
        if entry.beside.is_none() {
            self.setup_ms[traces] = opened_ms / (row.triangles.max(1) as f64);
        }
        if self.scene.triangles == 0 && place.triangles.is_none() {
            self.scene = SceneFacts { file: names.join(", "), triangles: row.triangles };
        }
        let known = Known {
            weight: entry.weight,
            pixels: pixels(row.size),
            triangles: row.triangles as f64,
            frame_ms: row.frame.median,
        };
        // Times with many lights would mislead the estimates of later rows.
        if !entry.on_cpu && place.threads.is_none() && place.lights.is_none_or(|lights| lights == 1) {
            self.known.insert((entry.file.to_owned(), entry.panes, entry.beside), known);
        }
        Ok((case, row, picture))
    }

    pub fn entry(
        &mut self,
        entry: &Entry,
        folder: &Folder,
        told: &mut dyn FnMut(Told<'_>),
        observer: &mut dyn Observer,
    ) -> Result<(), ReportError> {
        let projects = &self.request.projects;
        let place = Place {
            projects,
            size: self.request.wanted.size,
            triangles: None,
            lights: None,
            threads: None,
            stage: entry.stage,
        };
        let case = self.case(entry, &place);
        if case.as_ref().is_ok_and(|case| self.file.rows.iter().any(|row| row.key == case.key)) {
            // If the project has no camera near the panes, an entry in their view would repeat an earlier row.
            self.done += 1;
            return Ok(());
        }
        let (case, mut row, picture) = match self.row_of(entry, case, &place, told, observer) {
            Ok(measured) => measured,
            Err(why) => {
                self.miss(&entry.label, why);
                return Ok(());
            }
        };
        self.finish_row(entry, &case, &mut row, &picture, observer);
        if entry.in_table {
            self.table.push(row.key.clone());
        }
        self.show(entry, &case, &row, &picture, folder, observer)?;
        if entry.effect == "none" {
            self.plain.insert(row.view.clone(), (row.key.clone(), picture));
        }
        self.measured.push((entry.clone(), row.key.clone()));
        self.file.rows.push(row);
        Ok(())
    }

    /// Completes a row with what is not measured: the name of its project, the figure of the report of 2014, and the row's errors.
    pub fn finish_row(
        &mut self,
        entry: &Entry,
        case: &Case,
        row: &mut BenchRow,
        picture: &Image,
        observer: &mut dyn Observer,
    ) {
        if self.request.made.is_some() {
            row.project = entry.file.into();
        } else {
            row.thesis = figure_of_2014(entry, row);
        }
        row.error = self.judge(entry, case, row, picture, observer);
        row.picture_error = Some(self.judge_picture(entry, case, row, picture, observer));
    }

    /// Measures every row again, in rounds over all rows. If the time does not suffice for a row, the row keeps the samples that it has.
    pub fn rounds(&mut self, told: &mut dyn FnMut(Told<'_>), observer: &mut dyn Observer) {
        let measured = std::mem::take(&mut self.measured);
        let projects = &self.request.projects;
        let place = Place {
            projects,
            size: self.request.wanted.size,
            triangles: None,
            lights: None,
            threads: None,
            stage: Stage::Rounds,
        };
        for _ in 1..plan::ROUNDS {
            for (entry, key) in &measured {
                match self.row(entry, &place, told, observer) {
                    Ok((_, more, _)) => {
                        if let Some(row) = self.file.rows.iter_mut().find(|row| row.key == *key) {
                            row.add(&more);
                        }
                    }
                    Err(why) if why.starts_with(plan::OUT_OF_TIME) => {}
                    Err(why) => self.miss(&format!("{}, another round", entry.label), why),
                }
            }
        }
    }

    /// The error of a row against the reference of its effect by rays. All rows with the same effect, view and number of samples a pixel share this
    /// reference.
    fn judge(
        &mut self,
        entry: &Entry,
        case: &Case,
        row: &BenchRow,
        picture: &Image,
        observer: &mut dyn Observer,
    ) -> RowError {
        if matches!(entry.effect, "none" | "dummy") {
            return RowError::Missing("no effect is computed: there is nothing to compare".to_owned());
        }
        let judge = judge_of(entry, row);
        let first = !self.judges.contains_key(&judge);
        if first {
            if entry.technique == Technique::Raster {
                return RowError::Missing(format!(
                    "the reference is that of {} by rays, and was not made",
                    entry.effect
                ));
            }
            // Estimates: exact references trace in `f64`; converged ones render two pictures of 256 samples. The G-buffer is drawn once.
            let in_rays = row.frame.median * row.ray_share.unwrap_or(1.0);
            let noisy = matches!(entry.effect, "ao" | "all" | "soft-shadows");
            let rays = entry.weight / f64::from(entry.aa.count());
            let times = if noisy { 512.0 / rays.max(1.0) } else { 12.0 };
            let expected_s = (row.frame.median + in_rays * times) / 1e3;
            // Without this reference no setting of the effect can be judged, so the reference may also use the time of the stage `Settings`.
            if let Err(why) = self.time().admit(entry.stage.max(Stage::Settings), expected_s) {
                return RowError::Missing(format!("the reference is {why}; a larger --time makes room for it"));
            }
            self.judges.insert(judge.clone(), case.clone());
        }
        let error = self.against(&judge, picture, observer);
        if first && matches!(error, RowError::Missing(_)) {
            self.judges.remove(&judge);
        }
        error
    }

    /// The error of a row's whole picture, if its reference is stored. A report has no time to make one.
    fn judge_picture(
        &mut self,
        entry: &Entry,
        case: &Case,
        row: &BenchRow,
        picture: &Image,
        observer: &mut dyn Observer,
    ) -> RowError {
        let case = self.judges.get(&judge_of(entry, row)).unwrap_or(case).clone();
        let compared = match (&self.request.made, self.references.picture(&case, observer)) {
            (Some(writes), Err(ReferenceError::NoPicture(_))) => {
                // The projects' folder is temporary, so the command names the folder that `writes` makes.
                let file = case.project.strip_prefix(&self.request.projects).unwrap_or(Path::new(entry.file));
                let lasting = Case { project: Path::new(PROJECTS).join(file), ..case };
                let makes = reference::command_of_picture(&lasting);
                let why = format!("the reference of the picture is not made; this makes it: {writes}; {makes}");
                Ok(RowError::Missing(why))
            }
            _ => self.references.compare_picture(&case, picture, observer),
        };
        for warning in self.references.take_warnings() {
            self.miss("kept references", warning);
        }
        compared.unwrap_or_else(|error| RowError::Missing(error.to_string()))
    }

    /// The error of a picture against the reference of the case of `judge`, which [`Self::judges`] must contain.
    fn against(&mut self, judge: &Judge, picture: &Image, observer: &mut dyn Observer) -> RowError {
        let compared = self.references.compare(&self.judges[judge], picture, observer);
        for warning in self.references.take_warnings() {
            self.miss("kept references", warning);
        }
        compared.unwrap_or_else(|error| RowError::Missing(error.to_string()))
    }

    /// Error of a frame without an effect, against the effect's reference in a view; `None` if there is no such frame or reference.
    fn without(&mut self, effect: Effect, view: &str, observer: &mut dyn Observer) -> Option<Without> {
        let judge = (effect.id().to_owned(), view.to_owned(), 1);
        let (row, picture) = self.plain.get(view).filter(|_| self.judges.contains_key(&judge))?.clone();
        Some(Without { row, error: self.against(&judge, &picture, observer) })
    }

    /// Adds the row to the section of its effect, with its picture and its FLIP map.
    fn show(
        &mut self,
        entry: &Entry,
        case: &Case,
        row: &BenchRow,
        picture: &Image,
        folder: &Folder,
        observer: &mut dyn Observer,
    ) -> Result<(), FolderError> {
        let Some((series, value)) = entry.setting.clone() else { return Ok(()) };
        let Some(effect) = Effect::ALL.into_iter().find(|effect| effect.id() == entry.effect) else { return Ok(()) };
        if !self.sections.contains_key(&effect) {
            let without = self.without(effect, &row.view, observer);
            let (pictures, flip_maps, settings) = (Vec::new(), Vec::new(), Vec::new());
            let (view, graphs) = (row.view.clone(), Vec::new());
            let section = Section { effect, view, pictures, flip_maps, graphs, without, settings };
            self.sections.insert(effect, section);
        }
        let Some(section) = self.sections.get_mut(&effect) else { return Ok(()) };
        section.settings.push(Setting { row: row.key.clone(), series, value });
        let Some((role, label)) = &entry.picture else { return Ok(()) };
        section.graphs.extend(graph::of(case, &row.key, label));
        let display = case.display;
        let save = |name: &str, image: &Image, display: Display| -> Result<String, FolderError> {
            let file = format!("pictures/{}-{name}.png", effect.id());
            let path = folder.path().join(&file);
            write_displayed(&path, image, display).map_err(|error| FolderError::Io { path, error })?;
            Ok(file)
        };
        let shown = Picture {
            role: (*role).to_owned(),
            label: label.clone(),
            file: save(role, picture, display)?,
            size: row.size,
            row: Some(row.key.clone()),
        };
        let judged = self.judges.get(&judge_of(entry, row));
        let reference = judged.and_then(|judge| self.references.get(judge, observer).ok());
        section.pictures.retain(|picture| picture.role != "reference");
        section.pictures.push(shown);
        // The page shows pictures by raster first, then those by rays, and the reference last.
        section.pictures.sort_by_key(|picture| picture.role == "rays");
        let Some(reference) = reference else { return Ok(()) };
        section.pictures.push(Picture {
            role: "reference".to_owned(),
            label: "Reference".to_owned(),
            file: save("reference", &reference.picture, display)?,
            size: row.size,
            row: None,
        });
        let options = metrics::Options { display, ..metrics::Options::default() };
        if let Ok(map) = flip_map(picture, &reference.picture, &options) {
            let mean = map.values.iter().sum::<f64>() / (map.values.len().max(1) as f64);
            let file = save(&format!("{role}-flip"), &heat_map(&map), Display::default())?;
            section.flip_maps.push(FlipMap { label: label.clone(), file, size: row.size, mean });
            section.flip_maps.sort_by_key(|map| map.file.contains("-rays-"));
        }
        Ok(())
    }

    /// The settings of an effect, with their rows.
    pub fn settings(&self, effect: Effect) -> impl Iterator<Item = (&Setting, &BenchRow)> {
        let settings = self.sections.get(&effect).into_iter().flat_map(|section| &section.settings);
        settings.filter_map(|setting| Some((setting, self.file.rows.iter().find(|row| row.key == setting.row)?)))
    }

    pub fn finish(mut self, scalings: Vec<Scaling>) -> ReportData {
        let took_s = self.start.elapsed().as_secs_f64();
        self.file.complete = self.file.unavailable.iter().all(|missing| !missing.why.starts_with(plan::OUT_OF_TIME));
        ReportData {
            scene: self.scene,
            size: self.request.wanted.size,
            quick: self.request.wanted.quick,
            budget_s: self.request.wanted.budget_s,
            took_s,
            within: self.request.wanted.within,
            bench: self.file,
            table: self.table,
            pixel_samples: self.pixel_samples,
            sections: Effect::ALL.into_iter().filter_map(|effect| self.sections.remove(&effect)).collect(),
            scalings,
        }
    }
}

/// A row that was measured.
struct Ran {
    row: BenchRow,
    picture: Image,
    /// Time to open the project, milliseconds. It includes loading the scene only if no earlier row has kept it.
    opened_ms: f64,
    /// Names of the scene's files.
    names: Vec<String>,
}

fn run(case: &Case, options: &MeasureOptions, observer: &mut dyn Observer) -> Result<Ran, String> {
    let begun = Instant::now();
    let renderer = case.open(observer).map_err(|error| error.to_string())?;
    let opened_ms = begun.elapsed().as_secs_f64() * 1e3;
    let measured = measure_with(renderer, case, options, observer).map_err(|error| error.to_string())?;
    let files = measured.renderer.plan().project.scenes.iter().flat_map(|scene| &scene.files);
    let names = files.filter_map(|file| Some(file.path.file_name()?.to_string_lossy().into_owned())).collect();
    Ok(Ran { row: measured.row, picture: measured.picture, opened_ms, names })
}

/// The figure of the report of 2014 for the same row, if that report has one. It has hard shadows only.
fn figure_of_2014(entry: &Entry, row: &BenchRow) -> Option<ThesisFigure> {
    if entry.effect == "soft-shadows" {
        return None;
    }
    let samples = row.set.iter().find_map(|set| set.strip_prefix("pass2.samples=")?.parse::<u32>().ok());
    let same = |known: &&TableRow| known.project == entry.file && known.view == row.view && known.samples == samples;
    let figure = table2::ROWS.iter().find(same).map(|known| known.figure(row));
    figure.filter(|_| entry.in_table)
}

fn pixels([width, height]: [u32; 2]) -> f64 {
    f64::from(width) * f64::from(height)
}

/// The name of the camera near a pane, if the project has it.
fn panes(path: &Path) -> Option<String> {
    let project = project::load(path).ok()?;
    project.cameras.iter().find(|camera| camera.name == "Vidro").map(|camera| camera.name.clone())
}
