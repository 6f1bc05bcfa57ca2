//! Builds the page, a single HTML file, from [`ReportData`] and finished plots. Nothing is rendered or read here.

mod effect;
mod table;

use super::model::{Against, Effect, ReportData};
use super::number::{date, duration, error, grouped, milliseconds, significant};
use super::plan::{OUT_OF_TIME, ROUNDS};
use super::plots::{self, Plot};
use super::summary;
use super::verdict::{self, Advice, FRAME_60_MS, Fit, Verdict};
use crate::bench::interval::LEAST_ORDERED;
use crate::bench::model::{BenchRow, Technique};
use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// Marks a page as a report of this program, in its `meta name="generator"`.
pub const GENERATOR: &str = "curitiba report";

/// The page, and its plots as separate files.
#[derive(Debug, Clone)]
pub struct Page {
    /// `index.html`.
    pub html: String,
    /// Name inside `plots/`, and contents, of each SVG file.
    pub plots: Vec<(String, String)>,
}

/// Collects the plots while the page is built.
#[derive(Default)]
struct Plots(Vec<(String, String)>);

impl Plots {
    /// The plot as a figure with its caption, or a sentence that says why there is none.
    fn figure(&mut self, name: &str, plot: Option<Plot>, caption: &Markup, missing: &str) -> Markup {
        let Some(plot) = plot else { return html! { p.note { (missing) } } };
        let file = format!("{name}.svg");
        let path = format!("plots/{file}");
        self.0.push((file, plot.file));
        html! {
            figure.plot {
                div.scroll tabindex="0" role="group" aria-label="Plot; scrolls sideways where the window is narrow" {
                    (PreEscaped(plot.inline))
                }
                figcaption { (caption) " " a href=(path) { "SVG" } }
            }
        }
    }
}

/// Builds the page.
#[must_use]
pub fn build(data: &ReportData) -> Page {
    let mut plots = Plots::default();
    let scene = data.scene.file.clone();
    let body = html! {
        a.skip href="#in-short" { "Skip to the result" }
        (top(data))
        main {
            (in_short(data))
            (contents(data))
            (missing(data))
            (effects(data, &mut plots))
            @for section in &data.sections { (effect::section(data, section, &mut plots)) }
            (pixel_samples(data))
            (scaling(data, &mut plots))
            (method(data))
            (machine(data))
        }
        footer {
            p { "Made by " (GENERATOR) " " (data.bench.environment.version) " on " (date(data.bench.started_unix_s)) "." }
        }
        script { (PreEscaped(SCRIPT)) }
    };
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="generator" content=(GENERATOR);
                meta name="color-scheme" content="light dark";
                link rel="icon" href="data:,";
                title { "Raster or rays: " (scene) }
                style { (PreEscaped(STYLE)) }
            }
            body { (body) }
        }
    };
    Page { html: page.into_string(), plots: plots.0 }
}

/// The top of the page, only a title, so that the result is visible without scrolling.
fn top(data: &ReportData) -> Markup {
    html! {
        header.top {
            p.kicker { "Benchmark report" @if data.quick { " · quick" } }
            h1 { "Raster or rays: " (data.scene.file) }
        }
    }
}

fn contents(data: &ReportData) -> Markup {
    html! {
        nav aria-label="Contents" {
            ul {
                @if !data.bench.unavailable.is_empty() { li { a href="#missing" { "What is missing" } } }
                li { a href="#effects" { "All rows" } }
                @for section in &data.sections {
                    li { a href={ "#" (section.effect.id()) } { (section.effect.title()) } }
                }
                @if !data.pixel_samples.is_empty() { li { a href="#pixel-samples" { "Samples a pixel" } } }
                li { a href="#scaling" { "Scaling" } }
                li { a href="#method" { "How it was measured" } }
                li { a href="#machine" { "The machine" } }
            }
        }
    }
}

fn machine(data: &ReportData) -> Markup {
    let [width, height] = data.size;
    html! {
        section aria-labelledby="machine" {
            h2 id="machine" { "The machine" }
            dl.facts {
                div { dt { "Scene" } dd { (data.scene.file) ", " (grouped(data.scene.triangles)) " triangles" } }
                div { dt { "Window" } dd { (width) " × " (height) " pixels" } }
                @for (name, value) in facts(data) { div { dt { (name) } dd { (value) } } }
                @for (what, engine) in engines(data) { div { dt { (what) } dd { (engine) } } }
                div { dt { "Date" } dd { (date(data.bench.started_unix_s)) ", took " (duration(data.took_s)) } }
                div { dt { "Command" } dd { code { (data.bench.command) } } }
            }
        }
    }
}

/// Every field of the environment, under its name for readers.
fn facts(data: &ReportData) -> Vec<(String, String)> {
    const ORDER: [&str; 10] =
        ["cpu", "threads", "gpu", "driver", "platform", "version", "commit", "profile", "flags", "load_average"];
    let Ok(serde_json::Value::Object(fields)) = serde_json::to_value(&data.bench.environment) else {
        return Vec::new();
    };
    let mut fields: Vec<_> = fields.into_iter().collect();
    fields.sort_by_key(|(name, _)| ORDER.iter().position(|known| known == name).unwrap_or(ORDER.len()));
    let title = |field: &str| match field {
        "cpu" => "Processor".to_owned(),
        "gpu" | "gpus" => "Graphics processor".to_owned(),
        "threads" => "Threads".to_owned(),
        "profile" => "Build".to_owned(),
        "platform" => "System".to_owned(),
        other => {
            let spaced = other.replace('_', " ");
            let mut letters = spaced.chars();
            letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
        }
    };
    fields.iter().map(|(name, value)| (title(name), words(value))).collect()
}

/// A JSON value as text for readers.
fn words(value: &serde_json::Value) -> String {
    match value {
        serde_json::Value::Null => "not known".to_owned(),
        serde_json::Value::String(text) if text.is_empty() => "none".to_owned(),
        serde_json::Value::String(text) => text.clone(),
        serde_json::Value::Bool(yes) => if *yes { "yes" } else { "no" }.to_owned(),
        serde_json::Value::Array(parts) if parts.is_empty() => "none".to_owned(),
        serde_json::Value::Array(parts) => parts.iter().map(words).collect::<Vec<_>>().join("; "),
        serde_json::Value::Object(fields) => {
            fields.iter().map(|(name, value)| format!("{name} {}", words(value))).collect::<Vec<_>>().join(", ")
        }
        number @ serde_json::Value::Number(_) => number.to_string(),
    }
}

/// A warning if other programs were running when the report began.
fn busy(data: &ReportData) -> Markup {
    let environment = &data.bench.environment;
    html! {
        @if let Some(load) = environment.busy() {
            p.note {
                strong { "Other programs were at work: " }
                "the load average was " (significant(load)) " on " (environment.threads)
                " threads when the report began. An idle machine is faster, and its times vary less."
            }
        }
    }
}

/// Every engine that rows ran on, in the order of the rows.
fn engines(data: &ReportData) -> Vec<(&'static str, String)> {
    let mut found: Vec<(&'static str, String)> = Vec::new();
    for row in &data.bench.rows {
        let rays = row.rays.iter().map(|engine| ("Rays", engine));
        for (what, engine) in std::iter::once(("Rasteriser", &row.raster)).chain(rays) {
            let entry = (what, format!("{}: {}", engine.name, engine.device));
            if !found.contains(&entry) {
                found.push(entry);
            }
        }
    }
    found.sort_by_key(|(what, _)| *what == "Rays");
    found
}

fn in_short(data: &ReportData) -> Markup {
    let verdicts = verdict::verdicts(data, data.within);
    let sentences = summary::in_short(data);
    html! {
        section.short aria-labelledby="in-short" {
            h2 id="in-short" { "In short" }
            @if let Some(first) = sentences.first() {
                p { strong { (first) } }
            }
            div.scroll tabindex="0" role="group" aria-label="Table of advice" {
                // Narrow windows lay the table out as lines, which removes the elements' own roles; hence the explicit roles.
                table.advice role="table" {
                    thead role="rowgroup" {
                        tr role="row" {
                            @for (index, name) in ADVICE.iter().enumerate() {
                                th.text[matches!(index, 0 | 1 | 2 | 5)] scope="col" role="columnheader" { (name) }
                            }
                        }
                    }
                    tbody role="rowgroup" { @for verdict in &verdicts { (advice(data, verdict)) } }
                }
            }
            @if sentences.len() > 1 { p { (sentences[1..].join(" ")) } }
            (busy(data))
        }
    }
}

fn advice(data: &ReportData, verdict: &Verdict) -> Markup {
    let candidate = verdict.setting();
    let prefix = match &verdict.advice {
        Advice::NoneWithin { .. } => "nearest: ",
        Advice::UnknownError(_) => "fastest: ",
        _ => "",
    };
    let quality = candidate.and_then(|candidate| candidate.error.as_ref().ok());
    let without = data.section(verdict.effect).and_then(|section| verdict::without(data, section));
    let without = without.as_ref().and_then(|candidate| candidate.error.as_ref().ok());
    let interval = candidate.and_then(|candidate| candidate.interval);
    let fit = candidate.map(|candidate| match candidate.fit(FRAME_60_MS) {
        Fit::Yes => "yes",
        Fit::AtTheLimit => "at the limit",
        Fit::No => "no",
    });
    let cells = [
        candidate.map(|candidate| significant(candidate.frame_ms)),
        interval.map(|of| format!("{} – {}", significant(of.low), significant(of.high))),
        fit.map(str::to_owned),
        quality.map(|quality| error(quality.rmse)),
        quality.map(|quality| error(quality.flip)),
        without.map(|quality| error(quality.rmse)),
    ];
    html! {
        tr role="row" {
            th scope="row" role="rowheader" { (verdict.effect.title()) }
            td.text.verdict role="cell" { strong { (verdict::verb(&verdict.advice)) } }
            td.text.wrap.setting role="cell" {
                @match candidate {
                    Some(candidate) => { (prefix) (candidate.label) },
                    None => span.none { "–" },
                }
            }
            @for (cell, name) in cells.iter().zip(&ADVICE[3..]) {
                td.text[*name == "60 Hz"] role="cell" data-label=(name) { (cell.as_deref().unwrap_or("–")) }
            }
        }
    }
}

/// Columns of the table of advice.
const ADVICE: [&str; 9] =
    ["Effect", "Verdict", "Setting", "Frame, ms", "95 %", "60 Hz", "RMSE", "FLIP", "RMSE without it"];

fn missing(data: &ReportData) -> Markup {
    let (late, other): (Vec<_>, Vec<_>) =
        data.bench.unavailable.iter().partition(|entry| entry.why.starts_with(OUT_OF_TIME));
    html! {
        @if !data.bench.unavailable.is_empty() {
            section aria-labelledby="missing" {
                h2 id="missing" { "What is missing" }
                p { "Nothing below was replaced by something else; it is absent from the tables and plots." }
                ul.missing {
                    @for entry in &other { li { strong { (entry.what) } ": " (entry.why) } }
                }
                @if !late.is_empty() {
                    p {
                        "For lack of time (" (duration(data.budget_s)) " were allowed), each with what it was expected to take:"
                    }
                    ul.missing.late.note {
                        @for entry in &late {
                            li { strong { (entry.what) } ": " (entry.why.trim_start_matches(OUT_OF_TIME).trim_start()) }
                        }
                    }
                }
            }
        }
    }
}

fn effects(data: &ReportData, plots: &mut Plots) -> Markup {
    let rows: Vec<&BenchRow> = data.table.iter().filter_map(|key| data.row(key)).collect();
    let whole: Vec<&BenchRow> =
        rows.iter().copied().filter(|row| !Effect::ALL.iter().any(|effect| effect.id() == row.effect)).collect();
    html! {
        section aria-labelledby="effects" {
            h2 id="effects" { "All rows" }
            p {
                "One row for each effect, technique and view, at its usual setting. A frame at 60 frames a second may take "
                (milliseconds(FRAME_60_MS)) "."
            }
            (table::rows(data, &rows, "Frame times, rays and errors"))
            (figures_of_2014(&rows))
            h3 { "Where a frame’s time goes: no effect, and all together" }
            (plots.figure(
                "frames",
                plots::frame_bars("Median time of each step of a frame", &whole, ""),
                &html! {
                    "Median host time of each step. The figure at the end of a bar is the median of the whole frame, the whisker its 95 % interval."
                },
                "No such row was measured.",
            ))
        }
    }
}

/// Costs of several samples a pixel, and their effect on the picture.
fn pixel_samples(data: &ReportData) -> Markup {
    let rows: Vec<&BenchRow> = data.pixel_samples.iter().filter_map(|key| data.row(key)).collect();
    html! {
        @if !rows.is_empty() {
            section aria-labelledby="pixel-samples" {
                h2 id="pixel-samples" { "Samples a pixel" }
                p {
                    "With " code { "--aa N" } " rasteriser and rays take N samples of every pixel; with " code { "--aa N:TOLERANCE" }
                    " rays are traced for four of them, and for the others where these differ by more. An effect without noise hardly gains by its own error: "
                    "what becomes better is the picture, its edges and textures."
                }
                (table::rows(data, &rows, "Several samples a pixel, beside one"))
            }
        }
    }
}

/// Names the machine of the report of 2014, if the table has figures of that report.
fn figures_of_2014(rows: &[&BenchRow]) -> Markup {
    let thesis = rows.iter().find_map(|row| row.thesis.as_ref());
    html! {
        @if let Some(thesis) = thesis {
            p.note {
                "The column “2014” has the figures of the report that the projects come from, measured on "
                (thesis.machine) "; the ratio is its time divided by ours, and is given where the sizes are the same."
            }
        }
    }
}

fn scaling(data: &ReportData, plots: &mut Plots) -> Markup {
    html! {
        section aria-labelledby="scaling" {
            h2 id="scaling" { "Scaling" }
            p {
                "Both axes are logarithmic: a line of slope 1 means that twice as much takes twice as long. The exponent in the "
                "legend is the slope of the dashed line, fitted by least squares where there are at least three points."
            }
            @for scaling in &data.scalings {
                @let (id, title, missing) = match scaling.against {
                    Against::Triangles => ("triangles", "Against triangles", "No scene of another size was measured."),
                    Against::Pixels => ("pixels", "Against pixels", "No other window size was measured."),
                    Against::Lights => ("lights", "Against lights", "No number of lights was measured."),
                    Against::Samples => ("samples", "Against samples", "No other number of samples was measured."),
                    Against::Threads => ("threads", "Against threads", "No other number of threads was measured."),
                };
                h3 { (title) }
                (plots.figure(
                    &format!("scaling-{id}"),
                    plots::scaling_plot(data, scaling),
                    &scaling_caption(data, scaling),
                    missing,
                ))
                (table::scaling(data, scaling))
            }
        }
    }
}

fn scaling_caption(data: &ReportData, scaling: &super::model::Scaling) -> Markup {
    let [width, height] = data.size;
    html! {
        @match scaling.against {
            Against::Triangles => { "The generated square at other densities, " (width) " × " (height) " pixels." },
            Against::Pixels => { (data.scene.file) " in windows of other sizes." },
            Against::Lights => {
                "Copies of the projects with so many lights: their own, and copies of it that are turned about the vertical. "
                "Rays are traced to each light that arrives at a point. Raster effects know one light, and have no line."
            },
            Against::Samples => {
                "The settings of the sections above that differ in their samples alone: rays of a point, and depths that a raster effect reads for it."
            },
            Against::Threads => {
                "On pools of so many threads, rasteriser and rays of the processor. The table has processor time as well, of all threads together."
            },
        }
    }
}

fn method(data: &ReportData) -> Markup {
    let bench = &data.bench;
    html! {
        section aria-labelledby="method" {
            h2 id="method" { "How it was measured" }
            p {
                "Up to " (bench.frames) " frames of each row after " (bench.warmup)
                " that are not counted, in each of up to " (ROUNDS) " rounds over all rows, so that a while in which the machine is "
                "slow does not fall on one row alone; rows that take long get fewer, n says how many. Times are host times of whole "
                "frames with synchronisation; loading, uploading and building are done once a round and are not in them. Processor "
                "times are of all threads together. Device times are on the device’s own clock, where it has one."
            }
            p {
                "Intervals hold a median with 95 % probability (bootstrap of the rounds of a row and of the frames of each; those of "
                "fewer than ten frames, or of one round, are too narrow). "
                "The advice is the cheapest setting whose error is at most " (error(data.within)) ", and at most half of that of a "
                "frame without the effect; " code { "--within" } " allows another."
            }
            p {
                "Which technique is the cheaper is told by rounds in which the cheapest settings of both were measured alternately, one "
                "right after the other and every other round in reversed order: what slows the machine down for a while slows down both. "
                "Of each round the ratio of the two medians is taken. The interval of the median of these ratios lies between two of "
                "them, from the smallest to the largest of 6 (96.9 %), from the third to the third last of 12 (order statistics, "
                "whatever the distribution). One is the cheaper where the whole interval is beyond 1.1; if it is not, there is no "
                "difference here. With fewer than " (LEAST_ORDERED) " such rounds nothing is certain, and the reason is given. Times "
                "in the table of advice are of these rounds where there are any."
            }
            p {
                "Outlying frames are counted by Tukey’s fences: severe ones are more than 3 interquartile ranges beyond the quartiles of "
                "their row, mild ones more than 1.5. Other programs at work make them; medians and intervals hardly notice them."
            }
            p {
                "Errors compare the picture of a row with a reference of its own effect, view and size. RMSE, relative MSE and the "
                "energy ratio are of linear values; SSIM and FLIP are of what is displayed. A reference has an error of its own, "
                "estimated from its samples: differences below it mean nothing."
            }
            p {
                "The time allowed was " (duration(data.budget_s)) ". Before each stage its expected cost was compared with what was "
                "left; what no longer fitted was left out and is listed above."
            }
            p {
                "All samples: " a href="data.json" { "data.json" } " · as tables: " a href="data.csv" { "data.csv" } " · "
                a href="data.md" { "data.md" }
            }
            p {
                "When each step of a frame runs: " code { "curitiba render PROJECT.xml --trace trace.json" }
                " writes what Perfetto opens."
            }
            p { "To make it again: " code { (bench.command) } }
        }
    }
}

/// A coloured tag for a technique.
fn tag(technique: Technique) -> Markup {
    html! {
        @match technique {
            Technique::Rays => span.tag.rays { "rays" },
            Technique::Raster => span.tag.raster { "raster" },
            Technique::None => span.tag { "none" },
        }
    }
}
