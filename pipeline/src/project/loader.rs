//! Reads a project file and its material libraries; keeps unresolved contents until all references are resolved.

use super::attributes::Attributes;
use super::dom::{self, Element, Value};
use super::libraries::{Libraries, LightExtra, ROOT};
use super::report::{Names, Report, Span, shown};
use super::run_state::Running;
use super::{Camera, Light, LightCamera, Pipeline, Project, SceneDecl, Viewport, file};
use crate::color::ColorSpace;
use crate::diagnostic::{Problems, Source};
use crate::glsl;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Key of a compiled shader: files of the vertex and the fragment shader, and the output location of the depth. For a compute shader: its
/// file and an empty path, and `None`.
pub(super) type ShaderKey = ([PathBuf; 2], Option<usize>);

/// State while a project is read.
pub(super) struct Loader {
    pub report: Report,
    pub folder: file::Folder,
    /// Named constants.
    pub constants: HashMap<String, f32>,
    /// Named numbers of passes and of the whole project.
    pub attributes: Attributes,
    /// The scripts of the pipeline that is being read.
    pub running: Running,
    /// Properties of each light that only own shaders read.
    pub light_extras: Vec<LightExtra>,
    /// Cameras of lights.
    pub light_cameras: Vec<LightCamera>,
    /// Name of the pipeline that is being read.
    pub pipeline_name: String,
    /// Compiled shaders by their files; `None` for one that failed to compile.
    pub compiled: HashMap<ShaderKey, Option<Arc<glsl::Program>>>,
    /// Index in the report of each shader or script file that was read, by path.
    pub texts: HashMap<PathBuf, u32>,
    /// The project's name; empty before it is read.
    pub title: String,
    pub libraries: Libraries,
    pub scenes: Declared<SceneDecl>,
    pub viewports: Declared<Viewport>,
    pub cameras: Declared<Camera>,
    pub lights: Declared<Light>,
}

/// Named items of one kind. For an item that could not be read, an error was reported; its name is kept with the item `None`, so
/// that references to it cause no further messages.
pub(super) struct Declared<T> {
    pub names: Names,
    pub items: Vec<Option<T>>,
}

impl<T> Declared<T> {
    pub fn new(what: &'static str) -> Self {
        Self { names: Names::new(what), items: Vec::new() }
    }

    /// Adds an item with the name `name`; `None` if the item could not be read.
    pub fn add(&mut self, report: &mut Report, name: &Value, item: Option<T>) {
        self.names.declare(report, &name.text, name.span);
        self.items.push(item);
    }

    /// All items; must only be called if there was no error.
    fn finish(self) -> Vec<T> {
        debug_assert!(self.items.iter().all(Option::is_some), "what could not be read has an error");
        self.items.into_iter().flatten().collect()
    }
}

/// Default size of the window, pixels.
const DEFAULT_WINDOW: [u32; 2] = [1024, 1024];

/// Loads a project; see [`super::load`].
pub(super) fn load(path: &Path) -> Result<Project, Problems> {
    let (loader, read) = read(path);
    match read {
        Some(mut project) if !loader.report.has_errors() => {
            project.scenes = loader.scenes.finish();
            project.viewports = loader.viewports.finish();
            project.cameras = loader.cameras.finish();
            project.lights = loader.lights.finish();
            project.light_cameras = loader.light_cameras;
            project.targets = loader.libraries.targets;
            project.problems = loader.report.finish();
            Ok(project)
        }
        _ => Err(loader.report.finish()),
    }
}

/// The scenes that could be read, despite other errors; see [`super::declared_scenes`].
pub(super) fn scenes(path: &Path) -> Vec<SceneDecl> {
    read(path).0.scenes.items.into_iter().flatten().collect()
}

fn read(path: &Path) -> (Loader, Option<Project>) {
    let mut loader = Loader {
        report: Report::default(),
        folder: file::Folder::of(path),
        constants: HashMap::new(),
        attributes: Attributes::default(),
        running: Running::default(),
        light_extras: Vec::new(),
        light_cameras: Vec::new(),
        pipeline_name: String::new(),
        compiled: HashMap::new(),
        texts: HashMap::new(),
        title: String::new(),
        libraries: Libraries::new(),
        scenes: Declared::new("scene"),
        viewports: Declared::new("viewport"),
        cameras: Declared::new("camera"),
        lights: Declared::new("light"),
    };
    let read = loader.project(path);
    (loader, read)
}

impl Loader {
    /// `pipeline#pass` of a pass of the pipeline that is being read.
    pub fn pass_key(&self, pass: &str) -> String {
        format!("{}#{pass}", self.pipeline_name)
    }

    /// Reads the file of a shader or a script, of at most `most` bytes, into the report, unless the report has it already.
    /// Returns the file's index in the report. Invalid UTF-8 is tolerated, since it may be in comments. `None` after an error,
    /// which is reported at `named`.
    pub fn text_file(&mut self, path: &Path, named: &Value, most: u64) -> Option<u32> {
        if let Some(known) = self.texts.get(path) {
            return Some(*known);
        }
        match crate::files::read(path, most) {
            Ok(bytes) => {
                let body = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&bytes);
                let text = String::from_utf8_lossy(body).into_owned();
                let index = self.report.add_source(Source { path: path.to_owned(), text: text.into() });
                self.texts.insert(path.to_owned(), index);
                Some(index)
            }
            Err(why) => {
                let message = format!("cannot read {}: {why}", path.display());
                if path.exists() {
                    self.report.error(named.span, message);
                } else {
                    self.report.error_help(named.span, message, || crate::paths::nearest_help(path));
                }
                None
            }
        }
    }

    /// Parses a file.
    pub fn document(&mut self, path: &Path, named_at: Option<Span>) -> Option<Element> {
        let file = file::read(&mut self.report, path, named_at)?;
        dom::parse(&mut self.report, file)
    }

    fn project(&mut self, path: &Path) -> Option<Project> {
        let root = self.document(path, None)?;
        if !root.is(&["project"]) {
            let help = if root.is(ROOT) {
                "this is a material library; a project names it in <materialLibs>".to_owned()
            } else {
                "valid: <project>".to_owned()
            };
            self.report.error_help(root.span, format!("a project does not start with <{}>", root.name), || help);
            return None;
        }
        self.expect(&root, &["assets", "pipelines", "interface"], &["name", "width", "height", "color"]);
        let name = self.required(&root, "name").map(|name| name.text.clone());
        self.title = name.clone().unwrap_or_default();
        let window = self.window(&root);
        let color = root.attribute("color").map_or(Some(ColorSpace::Report), |value| self.color_space(value));
        self.assets(&root);
        let (pipelines, default_pipeline) = self.pipelines(&root);
        Some(Project {
            path: path.to_owned(),
            source: path.to_owned(),
            name: name?,
            window: window?,
            color: color?,
            scenes: Vec::new(),
            viewports: Vec::new(),
            cameras: Vec::new(),
            lights: Vec::new(),
            light_cameras: Vec::new(),
            targets: Vec::new(),
            pipelines,
            default_pipeline,
            problems: Problems::default(),
        })
    }

    /// Parses `report` or `linear`.
    fn color_space(&mut self, value: &Value) -> Option<ColorSpace> {
        match value.text.parse() {
            Ok(space) => Some(space),
            Err(help) => {
                self.report.error_help(value.span, format!("`{}` is no `color`", value.shown()), || help);
                None
            }
        }
    }

    fn window(&mut self, root: &Element) -> Option<[u32; 2]> {
        let mut side = |name: &str| root.attribute(name).map(|value| self.side(value));
        match (side("width"), side("height")) {
            (None, None) => Some(DEFAULT_WINDOW),
            (Some(width), Some(height)) => Some([width?, height?]),
            (Some(_), None) | (None, Some(_)) => {
                self.report.error_help(root.span, "the window has only one of `width` and `height`", || {
                    "valid: both, or none for 1024 x 1024".to_owned()
                });
                None
            }
        }
    }

    fn pipelines(&mut self, root: &Element) -> (Vec<Pipeline>, usize) {
        let mut names = Names::new("pipeline");
        let mut pipelines = Vec::new();
        let mut default: Option<(usize, Span)> = None;
        let mut any = false;
        let runs = default_pipeline(root);
        // Uniforms may refer to later passes.
        for list in root.children_named(&["pipelines"]) {
            list.children_named(&["pipeline"]).for_each(|pipeline| self.announce_passes(pipeline));
        }
        for list in root.children_named(&["pipelines"]) {
            self.expect(list, &["pipeline"], &["default", "mode"]);
            for element in list.children_named(&["pipeline"]) {
                any = true;
                if let Some(name) = self.required(element, "name") {
                    names.declare(&mut self.report, &name.text, name.span);
                }
                if let Some(value) = element.attribute("default")
                    && self.boolean(value) == Some(true)
                {
                    match default {
                        None => default = Some((pipelines.len(), value.span)),
                        Some((_, first)) => {
                            let source = self.report.source(first.file).clone();
                            self.report.error_help(value.span, "a second pipeline is the default one", || {
                                let (line, column) = source.line_column(first.start as usize);
                                format!("the first is at {}:{line}:{column}", source.path.display())
                            });
                        }
                    }
                }
                let mark = self.report.mark();
                let mut pipeline = self.pipeline(element);
                if pipelines.len() != runs {
                    // A pipeline other than the default one need not run: its errors become warnings.
                    let what = format!("pipeline `{}` cannot run", shown(&pipeline.name));
                    pipeline.broken = self.report.excuse(mark, &what);
                    // A shader that failed here is compiled again for other pipelines, so that its errors can be reported there.
                    self.compiled.retain(|_, program| program.is_some());
                }
                pipelines.push(pipeline);
            }
        }
        if !any {
            self.report.error(root.span, "the project has no <pipeline>");
        }
        (pipelines, runs)
    }
}

/// The index of the default pipeline: the one with `default="true"`, or the one that `<pipelines default="…">` names, or the first.
fn default_pipeline(root: &Element) -> usize {
    let lists = || root.children_named(&["pipelines"]);
    let pipelines: Vec<&Element> = lists().flat_map(|list| list.children_named(&["pipeline"])).collect();
    let is_true = |element: &&Element| element.attribute("default").is_some_and(Value::is_true);
    let named = || lists().find_map(|list| list.attribute("default"));
    let by_name = |name: &Value| {
        pipelines.iter().position(|pipeline| pipeline.attribute("name").is_some_and(|own| own.text == name.text))
    };
    pipelines.iter().position(is_true).or_else(|| named().and_then(by_name)).unwrap_or(0)
}
