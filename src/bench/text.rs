//! Benchmarks as CSV and as Markdown.

use super::interval::Interval;
use super::model::{BenchFile, BenchRow, RowError, Stats, ThesisFigure};
use crate::pipeline::backend::{Answers, RayCounts};
use crate::pipeline::executor::StepKind;
use std::fmt::Write as _;

/// First line of a Markdown page.
const MARKDOWN_TITLE: &str = "# Benchmark";
/// Columns of a CSV file.
const CSV_HEADER: [&str; 47] = [
    "label",
    "effect",
    "technique",
    "view",
    "project",
    "set",
    "width",
    "height",
    "fidelity",
    "seed",
    "triangles",
    "raster",
    "rays",
    "n",
    "median_ms",
    "mean_ms",
    "sd_ms",
    "min_ms",
    "max_ms",
    "device_median_ms",
    "ray_device_ms",
    "ray_share",
    "rays_per_frame",
    "mrays_per_second",
    "held_bytes",
    "peak_memory_bytes",
    "rmse",
    "flip",
    "ssim",
    "reference_error",
    "reference",
    "thesis_ms",
    "thesis_machine",
    "ratio",
    "picture_error",
    "picture_flip",
    "picture_reference_error",
    "picture_reference",
    "glass_pixels",
    "glass_by_screen",
    "glass_by_cube",
    "glass_by_rays",
    "glass_by_nothing",
    "mild_outliers",
    "severe_outliers",
    "median_low_ms",
    "median_high_ms",
];

/// Whether a text begins like the output of [`csv`] or [`markdown`], so that it may be overwritten by such output.
#[must_use]
pub fn is_ours(text: &[u8]) -> bool {
    let columns: Vec<&[u8]> = text.split(|byte| *byte == b',').take(3).collect();
    let page = format!("{MARKDOWN_TITLE}\n\n`");
    text.starts_with(page.as_bytes()) || columns == CSV_HEADER.map(str::as_bytes)[..3]
}

/// Number of rays of one frame; `None` if the row has no ray pass.
#[must_use]
pub fn rays(row: &BenchRow) -> Option<u64> {
    let counts = row.steps.iter().filter_map(|step| step.rays).map(RayCounts::total);
    row.rays.as_ref().map(|_| counts.sum())
}

/// Millions of rays per second of the time in ray passes; `None` if no rays were traced.
#[must_use]
pub fn mrays_per_second(row: &BenchRow) -> Option<f64> {
    let traced: Vec<_> = row.steps.iter().filter(|step| step.mrays_per_second.is_some()).collect();
    let ms: f64 = traced.iter().map(|step| step.host.median).sum();
    let rays: u64 = traced.iter().filter_map(|step| step.rays).map(RayCounts::total).sum();
    (rays > 0).then(|| rays as f64 / 1e3 / ms.max(1e-6))
}

/// Time of the ray passes on the device's own clock, milliseconds; `None` if there are none, or one of them has no device time.
#[must_use]
pub fn ray_device_ms(row: &BenchRow) -> Option<f64> {
    let mut steps = row.steps.iter().filter(|step| step.kind == StepKind::Rays).peekable();
    steps.peek()?;
    steps.map(|step| step.device.as_ref().map(|device| device.median)).sum()
}

/// Numbers of glass pixels of one frame by the source of their colour, summed over all effects; `None` if no effect marches rays through screen
/// space.
#[must_use]
pub fn answers(row: &BenchRow) -> Option<Answers> {
    row.steps.iter().filter_map(|step| step.answers).reduce(|a, b| Answers {
        screen: a.screen + b.screen,
        cube: a.cube + b.cube,
        rays: a.rays + b.rays,
        kept: a.kept + b.kept,
    })
}

/// Shares of the glass pixels that got their colour from screen space, from a cube map and from rays, and of those that got none. `None` without
/// [`answers`], or if no glass is visible.
#[must_use]
pub fn answered_shares(row: &BenchRow) -> Option<[f64; 4]> {
    let found = answers(row).filter(|answers| answers.glass() > 0)?;
    Some([found.screen, found.cube, found.rays, found.kept].map(|pixels| pixels as f64 / found.glass() as f64))
}

/// Lines about the sources of the colours of glass pixels, one for each row that has [`answers`].
#[must_use]
pub fn of_answers(rows: &[BenchRow]) -> Vec<String> {
    let line = |row: &BenchRow| Some(format!("{}, {}: {}", row.label, row.view, answers(row)?));
    rows.iter().filter_map(line).collect()
}

/// Number of frames of each row: `5 frames a row after 1 of warm-up`.
#[must_use]
pub fn frames(file: &BenchFile) -> String {
    let rounds =
        if file.rounds == 1 { String::new() } else { format!(", in each of {} rounds over all rows", file.rounds) };
    format!("{} frames a row after {} of warm-up{rounds}", file.frames, file.warmup)
}

/// The median of a time and its 95 % confidence interval, as tables print them: `12.34 (12.01 to 12.80)` in milliseconds.
#[must_use]
pub fn median_and_interval(stats: &Stats) -> String {
    match stats.interval() {
        Some(Interval { low, high }) => format!("{} ({} to {})", ms(stats.median), ms(low), ms(high)),
        None => ms(stats.median),
    }
}

/// Milliseconds with two decimals; with one from 100 on, and with none from 1000 on.
fn ms(value: f64) -> String {
    let decimals = match value {
        value if value < 99.995 => 2,
        value if value < 999.95 => 1,
        _ => 0,
    };
    format!("{value:.decimals$}")
}

/// A sentence about the frames whose times are severe [outliers](super::Outliers), with the row that has the largest share of such frames; `None`
/// if there are none.
#[must_use]
pub fn of_outliers<'r>(rows: impl IntoIterator<Item = &'r BenchRow>) -> Option<String> {
    let (mut severe, mut frames) = (0, 0);
    let mut worst: Option<(&BenchRow, usize)> = None;
    for row in rows {
        let of_row = row.frame.outliers().severe;
        (severe, frames) = (severe + of_row, frames + row.frame.n());
        // Shares are compared by cross-multiplication.
        if worst.is_none_or(|(worst, most)| of_row * worst.frame.n() > most * row.frame.n()) {
            worst = Some((row, of_row));
        }
    }
    let (row, most) = worst.filter(|(_, most)| *most > 0)?;
    let n = row.frame.n();
    Some(format!("severe outliers: {severe} of {frames} frames; most in {}, {}: {most} of {n}", row.label, row.view))
}

/// A CSV file with one line per row. Unknown values are empty fields; times are in milliseconds.
#[must_use]
pub fn csv(file: &BenchFile) -> String {
    let mut text = CSV_HEADER.join(",") + "\n";
    for row in &file.rows {
        let fields: Vec<String> = fields(row).iter().map(|field| quoted(field)).collect();
        debug_assert_eq!(fields.len(), CSV_HEADER.len());
        text += &(fields.join(",") + "\n");
    }
    text
}

fn fields(row: &BenchRow) -> Vec<String> {
    fn known<T: ToString>(value: Option<T>) -> String {
        value.map(|value| value.to_string()).unwrap_or_default()
    }
    let (comparison, own, reference) = match &row.error {
        RowError::Against { reference, own_error, comparison, .. } => {
            (Some(comparison), Some(own_error), reference.clone())
        }
        RowError::Missing(why) => (None, None, format!("missing: {why}")),
    };
    let picture = row.picture_error.as_ref().and_then(RowError::found);
    let technique = serde_json::to_value(row.technique).ok().and_then(|name| name.as_str().map(str::to_owned));
    let thesis = row.thesis.as_ref();
    let interval = row.frame.interval();
    let glass = answered_shares(row).map_or(Default::default(), |shares| shares.map(|share| share.to_string()));
    let [by_screen, by_cube, by_rays, by_nothing]: [String; 4] = glass;
    vec![
        row.label.clone(),
        row.effect.clone(),
        known(technique),
        row.view.clone(),
        row.project.display().to_string(),
        row.set.join(" "),
        row.size[0].to_string(),
        row.size[1].to_string(),
        row.fidelity.clone(),
        row.seed.to_string(),
        row.triangles.to_string(),
        format!("{}: {}", row.raster.name, row.raster.device),
        known(row.rays.as_ref().map(|rays| format!("{}: {}", rays.name, rays.device))),
        row.frame.n().to_string(),
        row.frame.median.to_string(),
        row.frame.mean.to_string(),
        row.frame.sd.to_string(),
        row.frame.min.to_string(),
        row.frame.max.to_string(),
        known(row.frame_device.as_ref().map(|device| device.median)),
        known(ray_device_ms(row)),
        known(row.ray_share),
        known(rays(row)),
        known(mrays_per_second(row)),
        row.held_bytes.to_string(),
        known(row.peak_memory_bytes),
        known(comparison.map(|comparison| comparison.rmse)),
        known(comparison.map(|comparison| comparison.flip)),
        known(comparison.map(|comparison| comparison.ssim)),
        known(own),
        reference,
        known(thesis.map(|thesis| thesis.frame_ms)),
        known(thesis.map(|thesis| thesis.machine.clone())),
        known(thesis.and_then(|thesis| thesis.ratio)),
        known(picture.map(|(comparison, _)| comparison.rmse)),
        known(picture.map(|(comparison, _)| comparison.flip)),
        known(picture.map(|(_, own_error)| own_error)),
        match &row.picture_error {
            Some(RowError::Against { reference, .. }) => reference.clone(),
            Some(RowError::Missing(why)) => format!("missing: {why}"),
            None => String::new(),
        },
        known(answers(row).map(Answers::glass)),
        by_screen,
        by_cube,
        by_rays,
        by_nothing,
        row.frame.outliers().mild.to_string(),
        row.frame.outliers().severe.to_string(),
        known(interval.map(|interval| interval.low)),
        known(interval.map(|interval| interval.high)),
    ]
}

/// Quotes a field as in RFC 4180.
fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field.to_owned()
    }
}

/// The texts that [`reference()`] returns for the rows, each once, in order of first use, for numbering in a table.
#[must_use]
pub fn references(rows: &[BenchRow]) -> Vec<&str> {
    let mut found: Vec<&str> = Vec::new();
    for row in rows {
        let name = reference(row);
        if !found.contains(&name) {
            found.push(name);
        }
    }
    found
}

/// The reference of a row's error, or why it has no error.
#[must_use]
pub fn reference(row: &BenchRow) -> &str {
    match &row.error {
        RowError::Against { reference, .. } => reference,
        RowError::Missing(why) => why,
    }
}

/// The error of a row's picture and its FLIP error, as table cells: a dash if there is none, and a `≤` in front if the error is
/// only an upper bound because of the reference's own error.
#[must_use]
pub fn picture_cells(row: &BenchRow) -> [String; 2] {
    let Some(error) = &row.picture_error else { return ["-", "-"].map(str::to_owned) };
    let at_most = if error.is_at_most() { "≤" } else { "" };
    error.found().map_or(["-", "-"].map(str::to_owned), |(comparison, _)| {
        [format!("{at_most}{:.4}", comparison.rmse), format!("{:.4}", comparison.flip)]
    })
}

/// Sentences about the references of the rows' pictures, with the range of the references' own errors, and about the reasons why
/// rows have no such error.
#[must_use]
pub fn of_pictures<'r>(rows: impl IntoIterator<Item = &'r BenchRow>) -> Vec<String> {
    let mut found: Vec<(&str, [f64; 2])> = Vec::new();
    let mut missing: Vec<String> = Vec::new();
    for error in rows.into_iter().filter_map(|row| row.picture_error.as_ref()) {
        match error {
            RowError::Against { reference, own_error, .. } => {
                match found.iter_mut().find(|(known, _)| known == reference) {
                    Some((_, [least, most])) => (*least, *most) = (least.min(*own_error), most.max(*own_error)),
                    None => found.push((reference, [*own_error; 2])),
                }
            }
            RowError::Missing(why) if !missing.contains(why) => missing.push(why.clone()),
            RowError::Missing(_) => {}
        }
    }
    let against = found.iter().map(|(reference, [least, most])| match least == most {
        true => format!("against {reference}, whose own standard error is {least:.4}"),
        false => format!("against {reference}, whose own standard errors are {least:.4} to {most:.4}"),
    });
    against.chain(missing).collect()
}

/// A Markdown page: machine, table, steps, references, and missing rows.
#[must_use]
pub fn markdown(file: &BenchFile) -> String {
    let mut text = String::new();
    let machine = &file.environment;
    let _ = writeln!(text, "{MARKDOWN_TITLE}\n\n`{}`\n", file.command);
    let _ = writeln!(
        text,
        "{}, {} threads, {}; curitiba {} ({}), {} build, {}. {}.",
        machine.cpu,
        machine.threads,
        machine.platform,
        machine.version,
        machine.commit,
        machine.profile,
        machine.flags,
        frames(file)
    );
    for (gpu, driver) in machine.gpu.iter().zip(&machine.driver) {
        let _ = writeln!(text, "Graphics device: {gpu}, {driver}.");
    }
    for fallback in &machine.fallbacks {
        let _ = writeln!(text, "Fallback: {fallback}.");
    }
    if !file.complete {
        let _ = writeln!(text, "\n**Not complete.**");
    }
    let references = references(&file.rows);
    let has_answers = file.rows.iter().any(|row| answers(row).is_some());
    let [title, line] = if has_answers { [" glass answered by |", "---|"] } else { ["", ""] };
    let _ = writeln!(
        text,
        "\n| effect | view | engines | ms (median, 95 % of it) | min … max | n | outliers (mild + severe) | % in rays | rays on device, ms | Mrays/s | MiB held | RMSE | FLIP | against | \
         picture RMSE | picture FLIP | report | ratio |{title}\n|---|---|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|{line}"
    );
    for row in &file.rows {
        let against = references.iter().position(|name| *name == reference(row)).map_or(0, |index| index + 1);
        let (cells, picture) = (cells(row).join(" | "), picture_cells(row).join(" | "));
        let _ = write!(text, "| {cells} | [{against}] | {picture} | {} |", thesis_cells(row.thesis.as_ref()));
        if has_answers {
            let _ = write!(text, " {} |", answers(row).map_or("-".to_owned(), |answers| answers.to_string()));
        }
        text.push('\n');
    }
    text += "\nErrors are of the window's picture, in linear values, against:\n\n";
    for (index, name) in references.iter().enumerate() {
        let _ = writeln!(text, "{}. {name}", index + 1);
    }
    let pictures = of_pictures(&file.rows);
    if !pictures.is_empty() {
        text += "\nErrors of the picture are of all that is wrong in it, edges and textures as well:\n\n";
    }
    pictures.iter().for_each(|line| text.extend(["- ", line, "\n"]));
    if let Some(thesis) = file.rows.iter().find_map(|row| row.thesis.as_ref()) {
        let _ = writeln!(
            text,
            "\nThe report's times are of {}; ratios are its time divided by ours, for frames of the same size only.",
            thesis.machine
        );
    }
    steps(&mut text, &file.rows);
    for missing in &file.unavailable {
        let _ = writeln!(text, "\nNot measured: {}: {}", missing.what, missing.why);
    }
    text
}

/// A name in a cell of a table, which a bar or a line break would end.
pub(super) fn in_cell(name: &str) -> String {
    name.replace('|', "\\|").replace(['\n', '\r'], " ")
}

fn cells(row: &BenchRow) -> Vec<String> {
    let engines =
        row.rays.as_ref().map_or(row.raster.name.clone(), |rays| format!("{} + {}", row.raster.name, rays.name));
    let (rmse, flip) = match &row.error {
        RowError::Against { comparison, .. } => (format!("{:.2e}", comparison.rmse), format!("{:.4}", comparison.flip)),
        RowError::Missing(_) => ("-".to_owned(), "-".to_owned()),
    };
    vec![
        in_cell(&row.label),
        in_cell(&row.view),
        engines,
        median_and_interval(&row.frame),
        format!("{:.2} … {:.2}", row.frame.min, row.frame.max),
        row.frame.n().to_string(),
        format!("{} + {}", row.frame.outliers().mild, row.frame.outliers().severe),
        row.ray_share.map_or("-".to_owned(), |share| format!("{:.1}", share * 100.0)),
        ray_device_ms(row).map_or("-".to_owned(), |ms| format!("{ms:.2}")),
        mrays_per_second(row).map_or("-".to_owned(), |speed| format!("{speed:.1}")),
        format!("{:.1}", row.held_bytes as f64 / f64::from(1 << 20)),
        rmse,
        flip,
    ]
}

fn thesis_cells(thesis: Option<&ThesisFigure>) -> String {
    let Some(thesis) = thesis else { return "- | -".to_owned() };
    let ratio = thesis.ratio.map_or("-".to_owned(), |ratio| format!("{ratio:.2}"));
    let share = thesis.ray_percent.map(|share| format!(" ({share} %)")).unwrap_or_default();
    format!("{}{share} | {ratio}", thesis.frame_ms)
}

fn steps(text: &mut String, rows: &[BenchRow]) {
    *text += "\n| effect | view | step | pass | host ms | device ms | rays | Mrays/s |\n|---|---|---|---|---:|---:|---:|---:|\n";
    for row in rows {
        for step in row.setup.iter().chain(&row.steps) {
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {:.2} | {} | {} | {} |",
                in_cell(&row.label),
                in_cell(&row.view),
                step.kind.name(),
                in_cell(&step.name),
                step.host.median,
                step.device.as_ref().map_or("-".to_owned(), |device| format!("{:.2}", device.median)),
                step.rays.map_or("-".to_owned(), |rays| rays.total().to_string()),
                step.mrays_per_second.map_or("-".to_owned(), |speed| format!("{speed:.1}")),
            );
        }
    }
    let spent: Vec<_> = rows.iter().flat_map(spent).collect();
    if !spent.is_empty() {
        let _ = write!(
            text,
            "\nAdaptive sampling:\n\n{}",
            spent.iter().map(|line| format!("- {line}\n")).collect::<String>()
        );
    }
}

/// Lines about the paths of adaptive sampling of glass, one for each pass of the row that samples adaptively.
pub(crate) fn spent(row: &BenchRow) -> impl Iterator<Item = String> {
    let steps = row.steps.iter().filter_map(|step| Some((&step.name, step.adaptive?)));
    steps.map(|(pass, spent)| format!("{}, {}, pass `{pass}`: {spent}", row.label, row.view))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_of_others_are_told_from_ours_and_names_keep_to_their_cells() {
        let file = BenchFile::begin("a".to_owned(), crate::environment::Environment::here(), 1, 0);
        assert!(is_ours(markdown(&file).as_bytes()) && is_ours(csv(&file).as_bytes()));
        assert!(!is_ours(b"# Benchmarks\n\nMine.\n") && !is_ours(b"# Benchmark\n\nMine.\n"));
        assert_eq!(in_cell("a|b\nc"), "a\\|b c");
    }

    #[test]
    fn times_have_fewer_decimals_as_they_grow_so_that_they_fit_their_column() {
        let written = [0.004, 9.999, 99.99, 99.996, 999.94, 999.96, 123_456.7].map(ms);
        assert_eq!(written, ["0.00", "10.00", "99.99", "100.0", "999.9", "1000", "123457"]);
        let stats = |samples: &[f64]| Stats::new(samples.to_vec()).expect("samples");
        assert_eq!(median_and_interval(&stats(&[2.0; 5])), "2.00 (2.00 to 2.00)");
        assert_eq!(median_and_interval(&stats(&[2.0, f64::INFINITY, 3.0])), "3.00", "no interval");
        assert!(median_and_interval(&stats(&[98_000.0, 99_999.0])).chars().count() <= 22);
    }

    #[test]
    fn fields_with_commas_and_quotes_are_quoted() {
        assert_eq!(quoted("AO"), "AO");
        assert_eq!(quoted("AO, 4 samples"), "\"AO, 4 samples\"");
        assert_eq!(quoted("a \"b\""), "\"a \"\"b\"\"\"");
    }
}
