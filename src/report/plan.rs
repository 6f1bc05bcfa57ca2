//! Plans what a report measures, in which order, and what is left out if the time does not suffice.

use super::model::{Against, Effect, WITHIN};
use crate::BackendChoice;
use crate::bench::model::Technique;
use crate::pipeline::pixel_samples::PixelSamples;
use crate::pipeline::raster_effects::{EffectParams, EffectProgram};

/// The requested report.
#[derive(Debug, Clone, PartialEq)]
pub struct Wanted {
    /// Window size in pixels.
    pub size: [u32; 2],
    /// The short report.
    pub quick: bool,
    /// Time allowed, seconds.
    pub budget_s: f64,
    /// Root mean square error within which the cheapest setting of an effect is advised.
    pub within: f64,
    /// Numbers of triangles of the generated square for the scaling plot; an empty list switches it off.
    pub triangles: Vec<u32>,
}

impl Wanted {
    /// The default report: ten minutes, or one if `quick`.
    #[must_use]
    pub fn new(quick: bool, size: Option<[u32; 2]>) -> Self {
        let (side, budget_s) = if quick { (256, 60.0) } else { (512, 600.0) };
        let triangles =
            if quick { vec![10_000, 30_000, 100_000, 1_000_000] } else { vec![10_000, 100_000, 1_000_000, 10_000_000] };
        Self { size: size.unwrap_or([side, side]), quick, budget_s, within: WITHIN, triangles }
    }

    /// Greatest number of frames of a row, and the time for all of its frames, milliseconds.
    #[must_use]
    pub fn frames(&self) -> (u32, f64) {
        if self.quick { (5, 300.0) } else { (15, 2000.0) }
    }

    /// Time that refining one reference may take, seconds.
    #[must_use]
    pub fn reference_allowance_s(&self) -> f64 {
        self.budget_s * 0.12
    }
}

/// Parts of a report, in the order in which they are measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// No effect, and each effect at its default setting, with references.
    Effects,
    /// All other settings of each effect.
    Settings,
    /// Rows that verdicts compare, in paired rounds.
    Paired,
    /// Several samples a pixel.
    PixelSamples,
    /// Further rounds of all rows of [`Self::Effects`] and [`Self::Settings`].
    Rounds,
    /// Other window sizes.
    Pixels,
    /// Other numbers of lights.
    Lights,
    /// Thread pools of different sizes.
    Threads,
    /// Generated squares with other numbers of triangles.
    Triangles,
    /// Effects without glass in the view of the panes.
    OtherView,
}

impl Stage {
    /// The greatest share of the whole time that may be used up when this stage ends. It leaves some time for later stages.
    #[must_use]
    pub fn until(self) -> f64 {
        match self {
            Self::Effects => 0.48,
            Self::Settings => 0.54,
            Self::Paired => 0.77,
            Self::PixelSamples => 0.81,
            Self::Rounds => 0.83,
            Self::Pixels => 0.85,
            Self::Lights => 0.87,
            Self::Threads => 0.89,
            Self::Triangles => 0.96,
            Self::OtherView => 0.98,
        }
    }
}

/// A row to measure.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// The stage in which it is measured.
    pub stage: Stage,
    /// Project file inside the projects folder, with `/`.
    pub file: &'static str,
    /// Its effect, as in [`BenchRow::effect`](crate::bench::model::BenchRow::effect).
    pub effect: &'static str,
    /// By rays or by raster.
    pub technique: Technique,
    /// Whether it is rendered in the view of the panes, if the project has that camera.
    pub panes: bool,
    /// Parameters, as `PASS.NAME=VALUE`.
    pub set: Vec<String>,
    /// Name for readers.
    pub label: String,
    /// Series and value in the effect's plot; `None` for rows that only the table has.
    pub setting: Option<(String, String)>,
    /// Role and label of its picture, if it is shown.
    pub picture: Option<(&'static str, String)>,
    /// Whether it is a row of the effect table.
    pub in_table: bool,
    /// Whether it is measured on the cpu's rasteriser although the report uses another one.
    pub on_cpu: bool,
    /// The ray backend, if it is not the report's.
    pub beside: Option<BackendChoice>,
    /// Samples of every pixel.
    pub aa: PixelSamples,
    /// Cost of its effect, in a unit that all entries of a project share.
    pub weight: f64,
}

impl Entry {
    /// Whether the results of its rays are filtered. Not every backend supports the filter.
    #[must_use]
    pub fn is_filtered(&self) -> bool {
        self.technique == Technique::Rays && self.set.iter().any(|set| set.starts_with("pass2.filter="))
    }
}

/// Number of rounds over all rows of the effects and settings, if the time suffices. Every round measures all rows, so that a temporary
/// slowdown of the machine does not affect a single row only.
pub const ROUNDS: u32 = 3;

/// Project files of an effect: the one by rays, and those by raster.
#[must_use]
pub fn files(effect: Effect) -> (&'static str, &'static [&'static str]) {
    match effect {
        Effect::Shadows | Effect::SoftShadows => ("SceneShadows.xml", &["raster/SceneShadowMap.xml"]),
        Effect::Reflection => (
            "SceneReflect.xml",
            &["raster/SceneCubeReflect.xml", "raster/ScenePlanarReflect.xml", "raster/SceneScreenReflect.xml"],
        ),
        Effect::Refraction => ("SceneRefract.xml", &["raster/SceneCubeRefract.xml", "raster/SceneScreenRefract.xml"]),
        Effect::Occlusion => ("SceneSSAO.xml", &["raster/SceneGTAO.xml", "raster/SceneDepthOcclusion.xml"]),
    }
}

/// Whether a project uses planar mirrors.
fn is_planar(file: &str) -> bool {
    file.contains("Planar")
}

/// Whether a project marches rays through screen space.
fn is_screen(file: &str) -> bool {
    file.contains("Screen")
}

/// Values of the parameter `missing`: the source of colour for rays that find no hit in screen space.
const MISSING: [&str; 3] = ["cube", "none", "rays"];

/// Rays a pixel of the default rows of ambient occlusion and soft shadows.
pub const USUAL_SAMPLES: u32 = 16;

/// The diameter of the light's disc for soft shadows: that of the sun, degrees.
pub const SUN: &str = "pass2.sun=0.53";

/// All entries for the user's scene at the report's size. If `gpu` is true, the report's rasteriser is not the cpu's, and raster rows are measured
/// on the cpu too. Default rows by rays are also measured on the ray backends `beside`.
#[must_use]
pub fn entries(wanted: &Wanted, gpu: bool, beside: &[BackendChoice]) -> Vec<Entry> {
    let mut entries = whole();
    // The dummy row comes later, since no verdict needs it.
    let dummy = entries.pop();
    for effect in IN_TURN {
        entries.push(rays(effect, None));
        entries.extend(files(effect).1.iter().map(|file| raster(effect, file, None, wanted.size)));
    }
    if gpu {
        let usual: Vec<Entry> = entries.iter().filter(|e| e.technique == Technique::Raster).cloned().collect();
        entries.extend(usual.into_iter().map(|entry| Entry {
            on_cpu: true,
            label: format!("{}, cpu", entry.label),
            setting: entry.setting.map(|(series, value)| (format!("{series}, cpu"), value)),
            picture: None,
            ..entry
        }));
    }
    entries.extend(dummy);
    entries.extend(elsewhere());
    let traced: Vec<Entry> = entries.iter().filter(|e| e.technique == Technique::Rays).cloned().collect();
    for backend in beside {
        entries.extend(traced.iter().filter(|entry| !entry.is_filtered()).cloned().map(|entry| Entry {
            beside: Some(*backend),
            label: format!("{}, {}", entry.label, backend.name()),
            setting: entry.setting.map(|(series, value)| (format!("{series}, {}", backend.name()), value)),
            picture: None,
            ..entry
        }));
    }
    if !wanted.quick {
        entries.extend(in_the_other_view(&entries));
    }
    for effect in IN_TURN {
        entries.extend(sweep(effect, wanted));
    }
    entries.sort_by_key(|entry| entry.stage);
    entries
}

/// The effects in the order of measurement. Ambient occlusion comes before effects that many scenes do not have. Soft shadows come last, since
/// their reference takes longest.
pub(super) const IN_TURN: [Effect; 5] =
    [Effect::Shadows, Effect::Occlusion, Effect::Reflection, Effect::Refraction, Effect::SoftShadows];

fn entry(file: &'static str, effect: &'static str, technique: Technique, label: &str) -> Entry {
    Entry {
        stage: Stage::Effects,
        file,
        effect,
        technique,
        panes: false,
        set: Vec::new(),
        label: label.to_owned(),
        setting: None,
        picture: None,
        in_table: true,
        on_cpu: false,
        beside: None,
        aa: PixelSamples::ONE,
        weight: 1.0,
    }
}

/// Rows without an effect.
fn whole() -> Vec<Entry> {
    let none = entry("SceneNoEffects.xml", "none", Technique::None, "No effects");
    let panes = Entry { panes: true, label: "No effects, panes".to_owned(), ..none.clone() };
    let dummy = entry("SceneDummy.xml", "dummy", Technique::Rays, "No effects, through the ray pass");
    vec![none, panes, dummy]
}

/// Rows of the table that no plot shows: glass from a distance, and all effects together.
fn elsewhere() -> Vec<Entry> {
    let afar = |effect: Effect| {
        let (by_rays, by_raster) = files(effect);
        let name = effect.title();
        let rays = entry(by_rays, effect.id(), Technique::Rays, &format!("{name} by rays"));
        let raster = by_raster.iter().map(move |file| {
            let maps = match file {
                _ if is_planar(file) => "mirrors",
                _ if is_screen(file) => "the screen",
                _ => "cube maps",
            };
            entry(file, effect.id(), Technique::Raster, &format!("{name} by {maps}"))
        });
        std::iter::once(rays).chain(raster)
    };
    let mut rows: Vec<Entry> = [Effect::Reflection, Effect::Refraction].into_iter().flat_map(afar).collect();
    for (samples, effect, label) in [(0, "all-but-ao", "All but AO, by rays"), (USUAL_SAMPLES, "all", "All, by rays")] {
        rows.push(Entry {
            set: vec![format!("pass2.samples={samples}")],
            weight: f64::from(samples + 1),
            ..entry("SceneFinal.xml", effect, Technique::Rays, label)
        });
    }
    rows
}

/// The default rows of effects without glass, and of all effects together, in the view of the panes.
fn in_the_other_view(entries: &[Entry]) -> Vec<Entry> {
    let is_of_glass = |entry: &Entry| ["reflection", "refraction"].contains(&entry.effect);
    let usual = |entry: &&Entry| {
        let plain = matches!(entry.effect, "none" | "dummy");
        entry.in_table && !entry.panes && !entry.on_cpu && entry.beside.is_none() && !plain && !is_of_glass(entry)
    };
    let seen = |entry: &Entry| Entry {
        stage: Stage::OtherView,
        panes: true,
        label: format!("{}, panes", entry.label),
        setting: None,
        picture: None,
        ..entry.clone()
    };
    entries.iter().filter(usual).map(seen).collect()
}

/// An effect by rays. `other` holds samples and sampler; `None` for the default row.
fn rays(effect: Effect, other: Option<(u32, &'static str)>) -> Entry {
    let base = entry(files(effect).0, effect.id(), Technique::Rays, "");
    let panes = matches!(effect, Effect::Reflection | Effect::Refraction);
    let (samples, sampler) = other.unwrap_or((USUAL_SAMPLES, "sobol"));
    let (stage, in_table) = if other.is_some() { (Stage::Settings, false) } else { (Stage::Effects, true) };
    let (set, value, series, weight) = if effect == Effect::Occlusion {
        let set = vec![format!("pass2.samples={samples}"), format!("pass2.sampler={sampler}")];
        let value = if samples == 1 { "1 ray".to_owned() } else { format!("{samples} rays") };
        let name = if sampler == "sobol" { "rays, Sobol" } else { "rays, strata" };
        (set, value, name, f64::from(samples))
    } else if effect == Effect::SoftShadows {
        let set = vec![SUN.to_owned(), format!("pass2.sunsamples={samples}")];
        let value = if samples == 1 { "1 ray".to_owned() } else { format!("{samples} rays") };
        (set, value, "rays, Sobol", f64::from(samples))
    } else {
        (Vec::new(), "rays".to_owned(), "rays", 1.0)
    };
    let label = match (effect, sampler) {
        (Effect::Occlusion | Effect::SoftShadows, "sobol") => format!("{} by {value} a pixel", effect.title()),
        (Effect::Occlusion, _) => format!("{} by {value} a pixel, {sampler}", effect.title()),
        _ => format!("{} by rays", effect.title()),
    };
    let sampled = matches!(effect, Effect::Occlusion | Effect::SoftShadows);
    let shown = if sampled { format!("Rays: {value} a pixel") } else { "Rays".to_owned() };
    Entry {
        stage,
        panes,
        set,
        label,
        setting: Some((series.to_owned(), value)),
        picture: other.is_none().then_some(("rays", shown)),
        in_table,
        weight,
        ..base
    }
}

/// An effect by raster. `other` holds two parameters, depending on the effect; `None` for the default row. For shadow maps, these are the side of
/// the map, in quarters of the side that fits a picture of this size, and the number of cascades; for cube maps, the side alone; for planar
/// mirrors, the number of planes; for screen space, an index into [`MISSING`]; for occlusion, slices and steps.
fn raster(effect: Effect, file: &'static str, other: Option<(u32, u32)>, size: [u32; 2]) -> Entry {
    let fitted = |program| EffectParams::fitted_map_size(program, size);
    let base = entry(file, effect.id(), Technique::Raster, "");
    let (stage, in_table) = if other.is_some() { (Stage::Settings, false) } else { (Stage::Effects, true) };
    let panes = matches!(effect, Effect::Reflection | Effect::Refraction);
    let (set, series, value, weight) = match effect {
        Effect::Shadows | Effect::SoftShadows => {
            let (quarters, cascades) = other.unwrap_or((4, 4));
            let side = fitted(EffectProgram::ShadowMap) * quarters / 4;
            let mut set = vec![format!("pass2.mapsize={side}"), format!("pass2.cascades={cascades}")];
            set.extend((effect == Effect::SoftShadows).then(|| SUN.to_owned()));
            let series = if cascades == 1 { "one shadow map".to_owned() } else { format!("{cascades} shadow maps") };
            (set, series, side.to_string(), f64::from(cascades) * (f64::from(side * side) + 2e6))
        }
        Effect::Reflection | Effect::Refraction if is_planar(file) => {
            let (planes, _) = other.unwrap_or((16, 0));
            (vec![format!("pass2.planes={planes}")], "mirrors".to_owned(), planes.to_string(), f64::from(planes) * 2e6)
        }
        Effect::Reflection | Effect::Refraction if is_screen(file) => {
            let missing = MISSING[other.map_or(0, |(index, _)| index as usize)];
            (vec![format!("pass2.missing={missing}")], "the screen".to_owned(), missing.to_owned(), 2e6)
        }
        Effect::Reflection | Effect::Refraction => {
            let (quarters, _) = other.unwrap_or((4, 0));
            let side = fitted(EffectProgram::CubeReflection) * quarters / 4;
            let set = vec![format!("pass2.mapsize={side}")];
            (set, "cube maps".to_owned(), side.to_string(), f64::from(side * side) * 6.0 + 1e6)
        }
        Effect::Occlusion => {
            let (slices, steps) = other.unwrap_or((4, 8));
            let set = vec![format!("pass2.slices={slices}"), format!("pass2.steps={steps}")];
            let series = if file.contains("GTAO") { "GTAO" } else { "depth difference" };
            (set, series.to_owned(), format!("{slices} × {steps}"), f64::from(slices * steps))
        }
    };
    let (wide, unit) = match effect {
        Effect::Occlusion => ("", "slices × steps"),
        _ if is_planar(file) => (" planes", "planes"),
        _ if is_screen(file) => (" for the rest", "for the rest"),
        _ => (" wide", "texels"),
    };
    let role = match file {
        _ if file.contains("DepthOcclusion") => "raster-depth",
        _ if is_planar(file) => "raster-planar",
        _ if is_screen(file) => "raster-screen",
        _ => "raster",
    };
    Entry {
        stage,
        panes,
        set,
        label: format!("{} by {series}, {value}{wide}", effect.title()),
        picture: other.is_none().then(|| (role, format!("Raster: {series}, {value} {unit}"))),
        setting: Some((series, value)),
        in_table,
        weight,
        ..base
    }
}

/// The entries of an effect with other than default settings.
fn sweep(effect: Effect, wanted: &Wanted) -> Vec<Entry> {
    let (quick, size) = (wanted.quick, wanted.size);
    let (_, by_raster) = files(effect);
    let every = |file: &'static str, pairs: &[(u32, u32)]| -> Vec<Entry> {
        pairs.iter().map(|pair| raster(effect, file, Some(*pair), size)).collect()
    };
    match effect {
        Effect::Shadows if quick => {
            let mut entries = every(by_raster[0], &[(2, 1), (8, 1), (1, 4), (2, 4), (8, 4)]);
            entries.push(optioned(raster(effect, by_raster[0], Some((4, 4)), size), "border", "rays"));
            entries
        }
        Effect::Shadows => {
            let sides = [1, 2, 4, 8, 16];
            let pairs: Vec<_> = [1, 2, 4].iter().flat_map(|cascades| sides.map(|side| (side, *cascades))).collect();
            let others: Vec<_> = pairs.into_iter().filter(|pair| *pair != (4, 4)).collect();
            let mut entries = every(by_raster[0], &others);
            let bordered = [2, 4].map(|side| raster(effect, by_raster[0], Some((side, 4)), size));
            entries.extend(bordered.map(|entry| optioned(entry, "border", "rays")));
            entries
        }
        Effect::SoftShadows => {
            let sides: &[(u32, u32)] = if quick { &[(8, 4)] } else { &[(2, 4), (8, 4), (16, 4)] };
            let mut entries = every(by_raster[0], sides);
            let counts: &[u32] = if quick { &[1, 4, 64] } else { &[1, 2, 4, 8, 32, 64] };
            entries.extend(counts.iter().map(|count| rays(effect, Some((*count, "sobol")))));
            let filtered = |count: &u32| optioned(rays(effect, Some((*count, "sobol"))), "filter", "1");
            entries.extend([1, 4].iter().map(filtered));
            entries.sort_by(|a, b| a.weight.total_cmp(&b.weight));
            entries
        }
        Effect::Reflection | Effect::Refraction => {
            let sides: &[(u32, u32)] = if quick { &[(1, 0), (2, 0)] } else { &[(1, 0), (2, 0), (8, 0), (16, 0)] };
            let planes: &[(u32, u32)] = if quick { &[(4, 0)] } else { &[(1, 0), (4, 0), (64, 0)] };
            let ways: &[(u32, u32)] = &[(1, 0), (2, 0)];
            let settings = |file: &&'static str| {
                every(
                    file,
                    if is_planar(file) {
                        planes
                    } else if is_screen(file) {
                        ways
                    } else {
                        sides
                    },
                )
            };
            let mut entries: Vec<Entry> = by_raster.iter().flat_map(settings).collect();
            entries.push(optioned(raster(effect, by_raster[0], Some((4, 0)), size), "parallax", "box"));
            entries
        }
        Effect::Occlusion => {
            let pairs: &[(u32, u32)] =
                if quick { &[(1, 4), (8, 8)] } else { &[(1, 4), (2, 4), (2, 8), (8, 8), (8, 16), (16, 16)] };
            let mut entries: Vec<Entry> = by_raster.iter().flat_map(|file| every(file, pairs)).collect();
            let usual = || raster(effect, by_raster[0], Some((4, 8)), size);
            let mut sectors = optioned(usual(), "bitmask", "true");
            sectors.set.push("pass2.thickness=1".to_owned());
            entries.push(sectors);
            let few = if quick { (1, 4) } else { (2, 4) };
            entries.push(optioned(raster(effect, by_raster[0], Some(few), size), "filter", "2"));
            let counts: &[u32] = if quick { &[1, 4, 49] } else { &[1, 4, 9, 25, 36, 49, 64, 81, 100] };
            entries.extend(counts.iter().map(|count| rays(effect, Some((*count, "sobol")))));
            let filtered = |count: &u32| optioned(rays(effect, Some((*count, "sobol"))), "filter", "2");
            entries.extend([1, 4].iter().map(filtered));
            let strata: &[u32] = if quick { &[1, 4, 16] } else { &[1, 4, 9, 16, 25, 49, 100] };
            entries.extend(strata.iter().map(|count| rays(effect, Some((*count, "strata")))));
            // From cheap to expensive, so that the most expensive ones are left out for lack of time.
            entries.sort_by(|a, b| a.weight.total_cmp(&b.weight));
            entries
        }
    }
}

/// An entry with another value of an option.
fn optioned(mut entry: Entry, name: &str, value: &str) -> Entry {
    entry.set.push(format!("pass2.{name}={value}"));
    entry.label += &format!(", {name}={value}");
    entry.setting = entry.setting.map(|(series, setting)| (format!("{series}, {name}={value}"), setting));
    entry
}

/// Rows with several samples a pixel, each with its row with one sample: no effects, each effect by rays and by raster (with `--quick` shadows
/// only), and all effects together. All rows with few samples come before those with many.
#[must_use]
pub fn pixel_samples(wanted: &Wanted) -> Vec<(Entry, Entry)> {
    let effects: &[Effect] = if wanted.quick { &IN_TURN[..1] } else { &IN_TURN };
    let both = |effect: &Effect| [rays(*effect, None), raster(*effect, files(*effect).1[0], None, wanted.size)];
    let mut lines = vec![whole().swap_remove(0)];
    lines.extend(effects.iter().flat_map(both));
    lines.extend(elsewhere().pop());
    let row = |line: &Entry, aa: PixelSamples| Entry {
        stage: Stage::PixelSamples,
        label: format!("{}, {aa} samples a pixel", line.label),
        setting: None,
        picture: None,
        in_table: false,
        aa,
        weight: line.weight * f64::from(aa.count()),
        ..line.clone()
    };
    let several = [4, 16].into_iter().filter_map(PixelSamples::new);
    // Adaptive sampling: where the first samples of a pixel agree, no rays are traced for the others.
    let adaptive = PixelSamples::new(16).and_then(|samples| samples.within(TOLERANCE));
    let of = |aa: PixelSamples| {
        let lines = lines.iter().filter(move |line| aa.tolerance().is_none() || line.technique == Technique::Rays);
        lines.map(move |line| (line.clone(), row(line, aa))).collect::<Vec<_>>()
    };
    several.chain(adaptive).flat_map(of).collect()
}

/// Tolerance of adaptive sampling: where four samples of a pixel differ by at most this, rays are traced for these four only.
const TOLERANCE: f32 = 0.02;

/// The lines of the scaling plots: without effects, and shadows and ambient occlusion by each technique.
#[must_use]
pub fn scaling_lines(wanted: &Wanted) -> Vec<Entry> {
    let by_raster = |effect: Effect| raster(effect, files(effect).1[0], None, wanted.size);
    let mut lines = vec![whole().swap_remove(0), rays(Effect::Shadows, None)];
    lines.push(by_raster(Effect::Shadows));
    lines.push(rays(Effect::Occlusion, Some((4, "sobol"))));
    lines.push(by_raster(Effect::Occlusion));
    lines
        .into_iter()
        .map(|line| Entry { setting: None, picture: None, in_table: false, stage: Stage::Pixels, ..line })
        .collect()
}

/// Window sizes of the scaling by pixels: the report's size, and others with the same shape. Numbers of pixels differ by factors of four.
#[must_use]
pub fn pixel_sizes(wanted: &Wanted) -> Vec<[u32; 2]> {
    let scaled = |halvings: i32| wanted.size.map(|side| (f64::from(side) * 2_f64.powi(-halvings)).round() as u32);
    let range = if wanted.quick { -1..=2 } else { -2..=2 };
    range.rev().map(scaled).filter(|size| size.iter().all(|side| (16..=16_384).contains(side))).collect()
}

/// Numbers of threads, doubled from one up to all.
#[must_use]
pub fn thread_counts(all: usize) -> Vec<usize> {
    let doubled = std::iter::successors(Some(1), |count| Some(2 * count)).take_while(|count| *count < all);
    doubled.chain(Some(all.max(1))).collect()
}

/// Numbers of lights of the scaling by lights, doubled each time, since costs are expected to grow in proportion.
pub const LIGHT_COUNTS: [u32; 4] = [1, 2, 4, 8];

/// Rays to each light's disc in the scaling by lights.
const LIGHT_SAMPLES: u32 = 4;

/// The lines of the scaling by lights: without effects, hard shadows and, except in the short report, soft shadows. Shadows are traced, since raster
/// effects support one light only. Occlusion does not depend on lights.
#[must_use]
pub fn light_lines(wanted: &Wanted) -> Vec<Entry> {
    let soft = (!wanted.quick).then(|| rays(Effect::SoftShadows, Some((LIGHT_SAMPLES, "sobol"))));
    let lines = [whole().swap_remove(0), rays(Effect::Shadows, None)].into_iter().chain(soft);
    lines.map(|line| Entry { setting: None, picture: None, in_table: false, stage: Stage::Lights, ..line }).collect()
}

/// A line of the scaling with `count` lights; each light adds rays.
#[must_use]
pub fn lit_by(line: &Entry, count: u32) -> Entry {
    let times = if line.technique == Technique::Rays { f64::from(count) } else { 1.0 };
    Entry { weight: times * line.weight, ..line.clone() }
}

/// Name of a point of a scaling, for messages that it is left out.
#[must_use]
pub fn scaling_name(against: Against, amount: u64) -> String {
    let plural = if amount == 1 { "" } else { "s" };
    match against {
        Against::Triangles => format!("the square of {} triangles", super::number::grouped(amount)),
        Against::Pixels => format!("the window of {} pixels", super::number::grouped(amount)),
        Against::Lights => format!("{amount} light{plural}"),
        Against::Samples => format!("{} samples", super::number::grouped(amount)),
        Against::Threads => format!("{amount} thread{plural}"),
    }
}

/// The beginning of the reason that is given for whatever is left out for lack of time.
pub const OUT_OF_TIME: &str = "left out: it would take";

/// The allowed and the spent time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimePlan {
    /// Time allowed, seconds.
    pub total_s: f64,
    /// Time spent so far, seconds.
    pub spent_s: f64,
}

impl TimePlan {
    /// Time that a stage has left, seconds.
    #[must_use]
    pub fn left_s(&self, stage: Stage) -> f64 {
        (self.total_s * stage.until() - self.spent_s).max(0.0)
    }

    /// Checks that something with this expected time still fits into its stage.
    ///
    /// # Errors
    /// If it does not fit, with the reason.
    pub fn admit(&self, stage: Stage, expected_s: f64) -> Result<(), String> {
        let left = self.left_s(stage);
        if expected_s <= left {
            return Ok(());
        }
        let plural = |seconds: f64| format!("{} s", super::number::significant(seconds));
        Err(format!(
            "{OUT_OF_TIME} about {}, and {} were left for this part of the report",
            plural(expected_s),
            plural(left)
        ))
    }
}

/// The number of frames that fit into `slot_ms`: at least 3, at most `most`.
#[must_use]
pub fn frames(expected_ms: f64, slot_ms: f64, most: u32) -> u32 {
    let fitting = (slot_ms / expected_ms.max(1e-3)).floor();
    // A conversion from float saturates, and NaN gives 0.
    (fitting as u32).clamp(3.min(most), most)
}

/// Approximate peak memory of a generated scene in bytes: first the scene in memory beside its file, then the structure with
/// the memory for building it. Measured: 4.6 GiB for ten million triangles.
#[must_use]
pub fn peak_bytes(triangles: u32) -> u64 {
    u64::from(triangles) * 520
}

#[cfg(test)]
mod tests;
