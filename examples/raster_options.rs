//! Measures what the options of raster effects and of the filter after rays save and cost in the shipped square: the tables of
//! `docs/projects.md`. Writes them as JSON.
//!
//! ```text
//! cargo run --release --example raster_options -- docs/measurements/vm_options.json
//! ```
//!
//! Everything runs on the processor. The rows are rendered in turns, in [`ROUNDS`] rounds, so that a slow phase of the machine does not fall on one
//! row alone. Times are medians of whole frames; errors are root mean square differences from the reference that `curitiba bench` uses.

use curitiba::Choice;
use curitiba::bench::model::RowError;
use curitiba::bench::{Case, MeasureOptions, measure};
use curitiba::environment::Environment;
use curitiba::pipeline::executor::{Silent, median};
use curitiba::pipeline::plan::Settings;
use curitiba::reference::References;
use serde_json::{Map, Value, json};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

const SIZE: [u32; 2] = [512, 512];
const ROUNDS: usize = 3;
const FRAMES: u32 = 3;
const VIEWS: [&str; 2] = ["MainCamera", "Vidro"];

/// The measurement behind two cells of a table: a project with parameters of its pass `pass2`, in a view.
struct Cell {
    case: Case,
    frames_ms: Vec<f64>,
    error: Option<f64>,
    /// Number of glass pixels whose colour comes from screen space, and number of all glass pixels.
    answers: Option<[u64; 2]>,
}

/// A name, a project or view, and parameters of its pass `pass2`.
type Setting = (String, &'static str, String);

fn setting(name: &str, of: &'static str, set: &str) -> Setting {
    (name.to_owned(), of, set.to_owned())
}

/// A table in the making: the name of each row, and the place of its pairs of cells in the list of all cells.
struct Table {
    name: &'static str,
    columns: Vec<String>,
    rows: Vec<(String, Vec<usize>)>,
}

#[derive(Default)]
struct Plan {
    cells: Vec<Cell>,
    tables: Vec<Table>,
}

impl Plan {
    fn cell(&mut self, project: &str, view: &str, set: &str) -> Result<usize, Box<dyn Error>> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects").join(project);
        let set = set.split_whitespace().map(|assignment| format!("pass2.{assignment}")).collect();
        let settings = Settings { size: Some(SIZE), camera: Some(view.to_owned()), set, ..Settings::default() };
        let case = Case::new(&path, settings, Choice::CPU)?;
        self.cells.push(Cell { case, frames_ms: Vec::new(), error: None, answers: None });
        Ok(self.cells.len() - 1)
    }

    /// A row for each setting, and two columns for each of `across`: a view, or a parameter.
    fn table(
        &mut self,
        name: &'static str,
        first: &str,
        settings: &[Setting],
        across: &[Setting],
    ) -> Result<(), Box<dyn Error>> {
        let titles = across.iter().flat_map(|(title, ..)| [format!("{title}: error"), "ms".to_owned()]);
        let columns = std::iter::once(first.to_owned()).chain(titles).collect();
        let mut rows = Vec::new();
        for (label, project, set) in settings {
            let cells = across.iter().map(|(_, view, more)| self.cell(project, view, &format!("{set} {more}")));
            rows.push((label.clone(), cells.collect::<Result<Vec<_>, _>>()?));
        }
        self.tables.push(Table { name, columns, rows });
        Ok(())
    }

    fn measure(&mut self, references: &mut References) -> Result<(), Box<dyn Error>> {
        let of = self.cells.len() * ROUNDS;
        for round in 0..ROUNDS {
            for index in 0..self.cells.len() {
                let count = self.cells.len();
                let cell = &mut self.cells[index];
                let options = MeasureOptions { frames: FRAMES, warmup: 1 };
                let measured = measure(&cell.case, &options, &mut Silent)?;
                cell.frames_ms.extend(&measured.row.frame.samples);
                let answers = measured.row.steps.iter().find_map(|step| step.answers);
                cell.answers = answers.map(|a| [a.screen, a.glass()]);
                if cell.error.is_none() {
                    cell.error = match references.compare(&cell.case, &measured.picture, &mut Silent)? {
                        RowError::Against { comparison, .. } => Some(comparison.rmse),
                        RowError::Missing(why) => return Err(why.into()),
                    };
                }
                let (done, error) = (round * count + index + 1, cell.error.unwrap_or(f64::NAN));
                eprintln!("{done} of {of}: {} {:.4} {:.1} ms", cell.case.key, error, median(&cell.frames_ms));
            }
        }
        Ok(())
    }

    fn json(&self) -> Map<String, Value> {
        let table = |table: &Table| {
            let row = |(name, cells): &(String, Vec<usize>)| {
                let pair = |index: &usize| {
                    let cell = &self.cells[*index];
                    [json!(cell.error), json!(median(&cell.frames_ms))]
                };
                Value::Array(std::iter::once(json!(name)).chain(cells.iter().flat_map(pair)).collect())
            };
            let rows: Vec<Value> = table.rows.iter().map(row).collect();
            (table.name.to_owned(), json!({ "columns": table.columns, "rows": rows }))
        };
        self.tables.iter().map(table).collect()
    }

    /// For each cell with `missing=rays`, the share of glass pixels whose colour comes from screen space. Rays answer the others.
    fn answers(&self) -> Value {
        let of = |cell: &Cell| {
            let [screen, all] = cell.answers.filter(|[_, all]| *all > 0)?;
            let hybrid = cell.case.settings.set.iter().any(|set| set.ends_with("missing=rays"));
            let file = cell.case.project.file_stem()?.to_string_lossy().into_owned();
            let share = format!("{:.0} %", 100.0 * screen as f64 / all as f64);
            hybrid.then(|| json!([file.trim_start_matches("Scene"), cell.case.view, all, share]))
        };
        let rows: Vec<Value> = self.cells.iter().filter_map(of).collect();
        json!({ "columns": ["project", "view", "pixels of glass", "answered by the screen"], "rows": rows })
    }
}

fn plan() -> Result<Plan, Box<dyn Error>> {
    let mut plan = Plan::default();
    let views = VIEWS.map(|view| setting(shown(view), view, ""));
    let maps = |count: u32, side: u32| {
        let name = format!("{count} map{} of {side} texels a side", if count == 1 { "" } else { "s" });
        (name, "raster/SceneShadowMap.xml", format!("cascades={count} mapsize={side}"))
    };
    let mut shadows = vec![setting("rays", "SceneShadows.xml", "")];
    shadows.extend(
        [(1, 1024), (1, 2048), (2, 1024), (4, 512), (4, 1024), (4, 2048), (8, 1024)].map(|(n, side)| maps(n, side)),
    );
    plan.table("shadows", "shadows by", &shadows, &views)?;
    plan.table(
        "glass",
        "program",
        &[
            setting("`reflection`, rays", "SceneReflect.xml", ""),
            setting("`cubeReflection`", "raster/SceneCubeReflect.xml", ""),
            setting("`cubeReflection`, `parallax=box`", "raster/SceneCubeReflect.xml", "parallax=box"),
            setting("`planarReflection`", "raster/ScenePlanarReflect.xml", ""),
            setting("`screenReflection`, `missing=none`", "raster/SceneScreenReflect.xml", "missing=none"),
            setting("`screenReflection`, `missing=cube`", "raster/SceneScreenReflect.xml", "missing=cube"),
            setting(
                "`screenReflection`, `missing=cube`, `parallax=box`",
                "raster/SceneScreenReflect.xml",
                "missing=cube parallax=box",
            ),
            setting("`screenReflection`, `missing=rays`", "raster/SceneScreenReflect.xml", "missing=rays"),
            setting("`refraction`, rays", "SceneRefract.xml", ""),
            setting("`cubeRefraction`", "raster/SceneCubeRefract.xml", ""),
            setting("`cubeRefraction`, `parallax=box`", "raster/SceneCubeRefract.xml", "parallax=box"),
            setting("`screenRefraction`, `missing=none`", "raster/SceneScreenRefract.xml", "missing=none"),
            setting("`screenRefraction`, `missing=cube`", "raster/SceneScreenRefract.xml", "missing=cube"),
            setting("`screenRefraction`, `missing=rays`", "raster/SceneScreenRefract.xml", "missing=rays"),
        ],
        &views,
    )?;
    let occlusion = [
        setting("`gtao`", "raster/SceneGTAO.xml", ""),
        setting("`bitmask`, `thickness=0.3`", "raster/SceneGTAO.xml", "bitmask=true thickness=0.3"),
        setting("`bitmask`, `thickness=1`", "raster/SceneGTAO.xml", "bitmask=true thickness=1"),
        setting("`bitmask`, `thickness=3`", "raster/SceneGTAO.xml", "bitmask=true thickness=3"),
        setting("`filter=1`", "raster/SceneGTAO.xml", "filter=1"),
        setting("few: `slices=1`, `steps=4`", "raster/SceneGTAO.xml", "slices=1 steps=4"),
        setting("few, `filter=1`", "raster/SceneGTAO.xml", "slices=1 steps=4 filter=1"),
        setting("few, `filter=2`", "raster/SceneGTAO.xml", "slices=1 steps=4 filter=2"),
        setting("`depthOcclusion`", "raster/SceneDepthOcclusion.xml", ""),
    ];
    let radii = [("radius 0.5", "radius=0.5"), ("2", "radius=2"), ("8", "radius=8")];
    for (name, view) in [("occlusion", VIEWS[0]), ("occlusion_near", VIEWS[1])] {
        let across = radii.map(|(title, set)| setting(title, view, set));
        plan.table(name, "setting", &occlusion, &across)?;
    }
    let filtered = |program: &'static str, count: &str| -> Vec<Setting> {
        let row = |samples: u32, levels: u32| {
            let filter = if levels > 0 { format!(", `filter={levels}`") } else { String::new() };
            (format!("{samples}{filter}"), program, format!("{count}={samples} filter={levels}"))
        };
        [1, 4, 16, 64].into_iter().flat_map(|samples| [0, 1, 2].map(|levels| row(samples, levels))).collect()
    };
    let radii = [("radius 0.5", "radius=0.5"), ("2", "radius=2"), ("20", "radius=20")];
    let rays = filtered("SceneSSAO.xml", "samples");
    for (name, view) in [("rays", VIEWS[0]), ("rays_near", VIEWS[1])] {
        plan.table(name, "rays a point", &rays, &radii.map(|(title, set)| setting(title, view, set)))?;
    }
    let discs = [("0.53", "sun=0.53"), ("4", "sun=4")];
    let across = VIEWS.into_iter().flat_map(|view| {
        discs.map(|(degrees, set)| setting(&format!("{}, {degrees} degrees", shown(view)), view, set))
    });
    let mut sun = filtered("SceneShadows.xml", "sunsamples");
    sun.push(setting("`shadowMap`", "raster/SceneShadowMap.xml", ""));
    sun.push(setting("`shadowMap`, `mapsize=2048`", "raster/SceneShadowMap.xml", "mapsize=2048"));
    plan.table("sun", "rays a point", &sun, &across.collect::<Vec<_>>())?;
    Ok(plan)
}

/// The report's name of a view.
fn shown(view: &str) -> &str {
    if view == "MainCamera" { "Fonte" } else { view }
}

fn main() -> Result<(), Box<dyn Error>> {
    let output: PathBuf = std::env::args_os().nth(1).ok_or("name the JSON file that is written")?.into();
    let started = SystemTime::now().duration_since(UNIX_EPOCH)?.as_secs();
    let environment = Environment::here();
    let mut references = References::new(References::default_folder(), Duration::from_secs(30));
    let mut plan = plan()?;
    plan.measure(&mut references)?;
    let mut tables = plan.json();
    tables.insert("answers".to_owned(), plan.answers());
    let [width, height] = SIZE;
    let name = output.file_name().unwrap_or_default().to_string_lossy();
    let file = json!({
        "command": format!("cargo run --release --example raster_options -- {name}"),
        "started_unix_s": started,
        "environment": environment,
        "size": [width, height],
        "frames": FRAMES,
        "rounds": ROUNDS,
        "tables": tables,
    });
    std::fs::write(&output, serde_json::to_string_pretty(&file)? + "\n")?;
    Ok(())
}
