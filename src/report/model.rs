//! What the page is made from: plain data, so that the page can be built and tested without rendering anything.

use crate::bench::model::{BenchFile, BenchRow, RowError, Technique};
use serde::{Deserialize, Serialize};

/// Root mean square error within which the cheapest setting is advised, unless the user chooses another limit.
pub const WITHIN: f64 = 0.02;

/// Everything that a report shows.
///
/// Measurements are in [`ReportData::bench`] only; other fields refer to its rows by [`BenchRow::key`].
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ReportData {
    /// The scene that was rendered.
    pub scene: SceneFacts,
    /// Window of all rows, except those of the scaling by pixels.
    pub size: [u32; 2],
    /// Whether the short report was asked for.
    pub quick: bool,
    /// Time that the report was allowed, seconds.
    pub budget_s: f64,
    /// Time that it took, seconds.
    pub took_s: f64,
    /// Root mean square error within which the cheapest setting of an effect is advised.
    #[serde(default = "default_within")]
    pub within: f64,
    /// All rows with all samples, the machine, and the rows that could not be measured.
    pub bench: BenchFile,
    /// Keys of the rows of the effect table, in its order.
    pub table: Vec<String>,
    /// Keys of the rows with several samples a pixel, each group after its row with one sample.
    #[serde(default)]
    pub pixel_samples: Vec<String>,
    /// The sections, one for each effect.
    pub sections: Vec<Section>,
    /// Time against triangles, pixels, lights, samples and threads.
    pub scalings: Vec<Scaling>,
}

fn default_within() -> f64 {
    WITHIN
}

/// The scene that was measured.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneFacts {
    /// Name of its file.
    pub file: String,
    /// Triangles.
    pub triangles: u64,
}

/// The effects that both techniques compute.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Effect {
    /// Shadows of a directional light.
    Shadows,
    /// Shadows of a light with a disc, such as the sun.
    SoftShadows,
    /// Mirror reflection in glass.
    Reflection,
    /// Reflection and refraction in glass.
    Refraction,
    /// Ambient occlusion.
    Occlusion,
}

impl Effect {
    /// All, in the order of the page.
    pub const ALL: [Self; 5] = [Self::Shadows, Self::SoftShadows, Self::Reflection, Self::Refraction, Self::Occlusion];

    /// Its name in [`BenchRow::effect`] and in file names.
    #[must_use]
    pub fn id(self) -> &'static str {
        match self {
            Self::Shadows => "shadows",
            Self::SoftShadows => "soft-shadows",
            Self::Reflection => "reflection",
            Self::Refraction => "refraction",
            Self::Occlusion => "ao",
        }
    }

    /// Its name as a heading.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::Shadows => "Shadows",
            Self::SoftShadows => "Soft shadows",
            Self::Reflection => "Reflection",
            Self::Refraction => "Refraction",
            Self::Occlusion => "Ambient occlusion",
        }
    }

    /// Its name within a sentence.
    #[must_use]
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Shadows => "shadows",
            Self::SoftShadows => "soft shadows",
            Self::Reflection => "reflection",
            Self::Refraction => "refraction",
            Self::Occlusion => "ambient occlusion",
        }
    }
}

/// One effect: its pictures and every setting that was measured.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Section {
    /// The effect.
    pub effect: Effect,
    /// The view of its pictures and settings.
    pub view: String,
    /// Pictures that can be compared, the reference last; empty if none could be rendered.
    pub pictures: Vec<Picture>,
    /// FLIP maps against the reference.
    pub flip_maps: Vec<FlipMap>,
    /// Graphs of the passes of the rows that have pictures.
    #[serde(default)]
    pub graphs: Vec<PassGraph>,
    /// A frame without the effect; `None` if that was not measured.
    pub without: Option<Without>,
    /// Every setting, in the order of the table.
    pub settings: Vec<Setting>,
}

/// A frame without the effect, judged by the effect's reference. A setting is useful only if its error is at most half of this frame's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Without {
    /// Key of the frame's row.
    pub row: String,
    /// Its error, as for a row that computes the effect.
    pub error: RowError,
}

/// A rendered picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Picture {
    /// Distinguishes it within its section: `raster`, `rays`, `reference`, …
    pub role: String,
    /// Name for readers: `Raster: 4 shadow maps, 2048 texels`.
    pub label: String,
    /// Path of the PNG inside the report's folder, with `/`.
    pub file: String,
    /// Size in pixels.
    pub size: [u32; 2],
    /// Key of the row that rendered it; `None` for the reference.
    pub row: Option<String>,
}

/// A map of FLIP errors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlipMap {
    /// Label of the picture that it belongs to.
    pub label: String,
    /// Path of the PNG inside the report's folder, with `/`.
    pub file: String,
    /// Size in pixels.
    pub size: [u32; 2],
    /// Mean FLIP error, 0 to 1.
    pub mean: f64,
}

/// The passes of a row, in the order in which they run, and the attachments between them.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PassGraph {
    /// Key of the row whose times are written on the edges.
    pub row: String,
    /// Name for readers: the picture's label.
    pub label: String,
    /// Names of the passes, with what each does.
    pub passes: Vec<[String; 2]>,
    /// Edges: index of the pass that writes, index of the pass that reads, and names of the attachments between them. No edge leads to the window.
    pub edges: Vec<(usize, usize, Vec<String>)>,
}

/// One measured setting of an effect.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Setting {
    /// Key of its row.
    pub row: String,
    /// Name of its series: `4 shadow maps`, `rays, Sobol`. Each series has its own mark and colour in the plot.
    pub series: String,
    /// Its value within the series: `2048`, `16 rays`.
    pub value: String,
}

/// The quantity on the horizontal axis of a scaling plot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Against {
    /// Triangles of the scene.
    Triangles,
    /// Pixels of the window.
    Pixels,
    /// Lights that shine.
    Lights,
    /// Rays, or depths read, for each point.
    Samples,
    /// Threads of the processor.
    Threads,
}

/// Frame time against one quantity.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Scaling {
    /// The quantity.
    pub against: Against,
    /// Lines of the plot.
    pub series: Vec<ScalingSeries>,
}

/// One line of a scaling plot.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ScalingSeries {
    /// Name for readers.
    pub label: String,
    /// By rays or by raster.
    pub technique: Technique,
    /// Keys of the rows, from few to many.
    pub rows: Vec<String>,
    /// The quantity of each row: lights, samples or threads. Empty for triangles and pixels, which the rows contain.
    #[serde(default)]
    pub amounts: Vec<f64>,
}

impl ReportData {
    /// The row with a key.
    #[must_use]
    pub fn row(&self, key: &str) -> Option<&BenchRow> {
        self.bench.rows.iter().find(|row| row.key == key)
    }

    /// The rows of a line of a scaling plot, each with its value of the quantity.
    pub fn points<'a>(
        &'a self,
        against: Against,
        series: &'a ScalingSeries,
    ) -> impl Iterator<Item = (&'a BenchRow, f64)> {
        series.rows.iter().enumerate().filter_map(move |(index, key)| {
            let row = self.row(key)?;
            let amount = match against {
                Against::Triangles => row.triangles as f64,
                Against::Pixels => f64::from(row.size[0]) * f64::from(row.size[1]),
                Against::Lights | Against::Samples | Against::Threads => *series.amounts.get(index)?,
            };
            Some((row, amount))
        })
    }

    /// The section of an effect.
    #[must_use]
    pub fn section(&self, effect: Effect) -> Option<&Section> {
        self.sections.iter().find(|section| section.effect == effect)
    }

    /// The measured settings of a section, with their rows; settings whose row is missing are left out.
    pub fn settings<'a>(&'a self, section: &'a Section) -> impl Iterator<Item = (&'a Setting, &'a BenchRow)> {
        section.settings.iter().filter_map(|setting| Some((setting, self.row(&setting.row)?)))
    }

    /// The row without any effect in a view, or else in the first view that has one: the cost of the G-buffer alone.
    #[must_use]
    pub fn base(&self, view: &str) -> Option<&BenchRow> {
        let plain = |row: &&BenchRow| row.technique == Technique::None && row.effect == "none" && row.size == self.size;
        let mut rows = self.table.iter().filter_map(|key| self.row(key)).filter(plain);
        let first = rows.clone().next();
        rows.find(|row| row.view == view).or(first)
    }
}

/// Root mean square error of a row, and that of its reference; `None` if it was not measured.
#[must_use]
pub fn rmse(row: &BenchRow) -> Option<(f64, f64)> {
    match &row.error {
        RowError::Against { own_error, comparison, .. } => Some((comparison.rmse, *own_error)),
        RowError::Missing(_) => None,
    }
}
