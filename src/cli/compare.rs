//! `curitiba compare`: the difference between two pictures, or between two ways to render a project.

use super::compare_args::{CompareArgs, Z_TEST};
use super::progress::Bars;
use super::{Failure, failure, set_threads};
use anstyle::{AnsiColor, Style};
use curitiba::OpenError;
use curitiba::compare::{CompareError, Compared, Operand, Rendered, Side};
use curitiba::environment::Environment;
use curitiba::pipeline::color::{ColorSpace, Display};
use curitiba::pipeline::files::{self, check_outputs, record_files_read};
use curitiba::pipeline::image::{Image, displayed, write_png};
use curitiba::pipeline::metrics::{
    Better, Comparison, EXPECTED_BEYOND_2, EXPECTED_BEYOND_3, METRICS, Options, Verdict, ZTest, heat_map, strip,
};
use curitiba::spec::SpecError;
use serde::Serialize;
use std::path::{Path, PathBuf};

const HEADER: Style = Style::new().bold();
const WITHIN: Style = AnsiColor::Green.on_default();
const BEYOND: Style = AnsiColor::Red.on_default().bold();

/// Compares, prints the table or the JSON, and fails beyond a limit.
pub fn run(args: &CompareArgs) -> Result<(), Failure> {
    set_threads(args.threads)?;
    for path in [&args.heat, &args.strip].into_iter().flatten() {
        if !path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png")) {
            return Err(Failure::Usage(format!("{}: this picture is written as .png", path.display())));
        }
    }
    let mut operands = [&args.test, &args.reference].map(|text| Operand::parse(text).map_err(Failure::from));
    for operand in operands.iter_mut().flatten() {
        if let Operand::Project(spec) = operand {
            spec.settings.max_memory = args.max_memory;
        }
    }
    let [test, reference] = operands;
    let (test, reference) = (test?, reference?);
    record_files_read();
    for operand in [&test, &reference] {
        if let Operand::Picture(path) = operand {
            // Opening the file records it as an input, which no output may replace. Errors are reported when it is read.
            let _ = files::open(path);
        }
    }
    let heat = args.heat.as_deref().map(|path| (path, "--heat"));
    let outputs = || heat.into_iter().chain(args.strip.as_deref().map(|path| (path, "--strip")));
    check_outputs(outputs())?;
    let options = Options {
        outlier_threshold: args.outlier_threshold.unwrap_or(Options::default().outlier_threshold),
        pixels_per_degree: args.pixels_per_degree,
        ..Options::default()
    };
    let mut bars = Bars::default();
    let sides = [(args.test.as_str(), &test), (args.reference.as_str(), &reference)];
    let compared = curitiba::compare::compare(sides, args.seeds, &options, &mut bars)?;
    drop(bars);
    // Only now is it known which files the projects consist of.
    check_outputs(outputs())?;
    for side in [&compared.test, &compared.reference] {
        print_warnings(side);
    }
    let checked = check(args, &compared)?;
    let files = write_pictures(args, &compared)?;
    if args.json {
        print_json(&compared, &checked, &files, &options)?;
    } else {
        print(args, &compared, &checked, &files);
    }
    let beyond: Vec<&str> = checked.iter().filter(|limit| !limit.within).map(|limit| limit.metric).collect();
    if beyond.is_empty() { Ok(()) } else { Err(Failure::Beyond(beyond.join(", "))) }
}

impl From<SpecError> for Failure {
    fn from(error: SpecError) -> Self {
        Self::Usage(error.to_string())
    }
}

impl From<CompareError> for Failure {
    fn from(error: CompareError) -> Self {
        match error {
            CompareError::Open(error) => error.into(),
            CompareError::Render(error) => OpenError::Render(error).into(),
            CompareError::Usage(message) => Self::Usage(message),
            error => Self::Input(error.to_string()),
        }
    }
}

/// A limit of the command line, and whether it holds.
#[derive(Debug, Clone, Serialize)]
struct Limit {
    metric: &'static str,
    /// Name of the option, such as `--max-rmse`.
    option: &'static str,
    limit: f64,
    within: bool,
}

/// Checks the results against the limits of the command line.
fn check(args: &CompareArgs, compared: &Compared) -> Result<Vec<Limit>, Failure> {
    let limits = &args.limits;
    let given = [
        ("rmse", "--max-rmse", limits.max_rmse),
        ("relmse", "--max-relmse", limits.max_relmse),
        ("max", "--max-difference", limits.max_difference),
        ("psnr", "--min-psnr", limits.min_psnr),
        ("ssim", "--min-ssim", limits.min_ssim),
        ("flip", "--max-flip", limits.max_flip),
        ("energy", "--max-energy", limits.max_energy),
        ("outliers", "--max-outliers", limits.max_outliers),
    ];
    let mut checked = Vec::new();
    for (name, option, limit) in given {
        let (Some(limit), Some(metric)) = (limit, METRICS.iter().find(|metric| metric.name == name)) else { continue };
        let value = (metric.value)(&compared.comparison);
        let within = match metric.better {
            Better::Lower => value <= limit,
            Better::Higher => value >= limit,
            Better::NearOne => (value - 1.0).abs() <= limit,
        };
        checked.push(Limit { metric: metric.name, option, limit, within });
    }
    if let Some(limit) = limits.max_z {
        let Some(found) = &compared.z_test else {
            return Err(Failure::Usage(
                "--max-z needs a variance of both: add --seeds N, or compare .exr files with a layer `variance`".into(),
            ));
        };
        let within = found.sigma <= limit && found.tiles_different_without_noise == 0;
        checked.push(Limit { metric: Z_TEST, option: "--max-z", limit, within });
    }
    Ok(checked)
}

fn write_pictures(args: &CompareArgs, compared: &Compared) -> Result<Vec<PathBuf>, Failure> {
    let heat = heat_map(&compared.flip);
    let mut files = Vec::new();
    let mut write = |path: &Path, image: &Image| {
        write_png(path, image).map_err(|error| Failure::Work(format!("{}: {error}", path.display())))?;
        files.push(path.to_owned());
        Ok::<(), Failure>(())
    };
    if let Some(path) = &args.heat {
        write(path, &heat)?;
    }
    if let Some(path) = &args.strip {
        // The heat map holds display values, whatever the pictures hold.
        let shown = |side: &Side| displayed(&side.image, Display::of(compared.space)).map_err(Failure::work);
        write(path, &strip(&[&shown(&compared.test)?, &shown(&compared.reference)?, &heat]))?;
    }
    Ok(files)
}

fn print_warnings(side: &Side) {
    let Some(rendered) = &side.rendered else { return };
    failure::print_warnings_of(&rendered.problems);
    for warning in &rendered.warnings {
        failure::print_warning(warning);
    }
}

fn print(args: &CompareArgs, compared: &Compared, checked: &[Limit], files: &[PathBuf]) {
    print_side("A", &compared.test);
    print_side("B", &compared.reference);
    let shown = |name: &str| args.metric.is_empty() || args.metric.iter().any(|chosen| chosen == name);
    crate::say!("{HEADER}{:18}  {:>14}  limit{HEADER:#}", "metric", "value");
    for metric in METRICS.iter().filter(|metric| shown(metric.name)) {
        let value = number((metric.value)(&compared.comparison));
        print_line(metric.title, &value, checked.iter().find(|limit| limit.metric == metric.name));
    }
    if let Some(found) = compared.z_test.as_ref().filter(|_| shown(Z_TEST)) {
        let limit = checked.iter().find(|limit| limit.metric == Z_TEST);
        print_line("z-test, sigma", &number(found.sigma), limit);
        crate::say!("  {}", in_words(found));
    }
    crate::say!("{} pixels compared, {}", compared.comparison.pixels, in_words_of(compared.space));
    for note in &compared.notes {
        crate::say!("note: {note}");
    }
    for file in files {
        crate::say!("wrote {}", file.display());
    }
    if !checked.is_empty() && checked.iter().all(|limit| limit.within) {
        crate::say!("{WITHIN}within{WITHIN:#} all limits");
    }
}

fn in_words_of(space: ColorSpace) -> &'static str {
    match space {
        ColorSpace::Report => "values as stored",
        ColorSpace::Linear => "linear radiance",
    }
}

fn print_side(letter: &str, side: &Side) {
    let size = format!("{} x {}", side.image.width, side.image.height);
    let how = side.rendered.as_ref().map_or(String::new(), |rendered| {
        let frames = if rendered.frames > 1 {
            format!("median of {} frames, one for each seed", rendered.frames)
        } else {
            "one frame, without a warm-up".to_owned()
        };
        format!(", frame {:.2} ms ({frames}; raster {}, rays {})", rendered.frame_ms, rendered.raster, rendered.rays)
    });
    crate::say!("{HEADER}{letter}{HEADER:#}  {}: {size}{how}", side.name);
}

fn print_line(title: &str, value: &str, limit: Option<&Limit>) {
    let limit = limit.map_or(String::new(), |limit| {
        let (style, word) = if limit.within { (WITHIN, "within") } else { (BEYOND, "beyond") };
        format!("{style}{word}{style:#} {} {}", limit.option, limit.limit)
    });
    crate::say!("{}", format!("{title:18}  {value:>14}  {limit}").trim_end());
}

/// Formats a number with six significant digits.
fn number(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        magnitude if magnitude.is_infinite() => "infinite".to_owned(),
        magnitude if !(1e-4..1e6).contains(&magnitude) => format!("{value:.5e}"),
        magnitude => format!("{value:.*}", (5 - magnitude.log10().floor() as i32).max(0) as usize),
    }
}

fn in_words(found: &ZTest) -> String {
    let percent = |share: f64| format!("{:.2} %", share * 100.0);
    let verdict = match found.verdict {
        Verdict::Noise => "the difference is as large as the noise makes it",
        Verdict::Different => "the difference is larger than the noise explains",
        Verdict::Equal => return "neither has noise and both are equal: there is nothing to test".to_owned(),
    };
    let without = match found.tiles_different_without_noise {
        0 => String::new(),
        count => format!("; {count} colours of tiles without noise differ"),
    };
    let chi_square = number(found.chi_square);
    // Single pixels with few samples are far from normally distributed, so the shares beyond 2 and 3 standard deviations decide nothing.
    let few = if found.beyond_3 > 4.0 * EXPECTED_BEYOND_3 && found.verdict == Verdict::Noise {
        "; as single pixels have too few samples for a normal distribution, the tiles decide"
    } else {
        ""
    };
    format!(
        "{verdict}: chi-square {chi_square} per degree of freedom over {} tiles of 8 x 8 pixels (1 expected){without}\n  \
         of {} noisy values of pixels {} lie beyond 2 standard deviations ({} expected), {} beyond 3 ({} expected){few}",
        found.tiles,
        found.values,
        percent(found.beyond_2),
        percent(EXPECTED_BEYOND_2),
        percent(found.beyond_3),
        percent(EXPECTED_BEYOND_3),
    )
}

#[derive(Serialize)]
struct Report<'a> {
    test: ReportedSide<'a>,
    reference: ReportedSide<'a>,
    pixels: u64,
    /// Colour space of the comparison: `report` (values as stored) or `linear` (radiance).
    color: &'static str,
    metrics: &'a Comparison,
    z_test: &'a Option<ZTest>,
    outlier_threshold: f64,
    pixels_per_degree: f64,
    limits: &'a [Limit],
    within: bool,
    notes: &'a [String],
    files: &'a [PathBuf],
    environment: Environment,
}

#[derive(Serialize)]
struct ReportedSide<'a> {
    name: &'a str,
    size: [u32; 2],
    channels: &'a [String],
    variance: bool,
    rendered: &'a Option<Rendered>,
}

fn print_json(compared: &Compared, checked: &[Limit], files: &[PathBuf], options: &Options<'_>) -> Result<(), Failure> {
    fn side(side: &Side) -> ReportedSide<'_> {
        ReportedSide {
            name: &side.name,
            size: [side.image.width, side.image.height],
            channels: &side.channels,
            variance: side.variance.is_some(),
            rendered: &side.rendered,
        }
    }
    let report = Report {
        test: side(&compared.test),
        reference: side(&compared.reference),
        pixels: compared.comparison.pixels,
        color: compared.space.name(),
        metrics: &compared.comparison,
        z_test: &compared.z_test,
        outlier_threshold: options.outlier_threshold,
        pixels_per_degree: options.pixels_per_degree,
        limits: checked,
        within: checked.iter().all(|limit| limit.within),
        notes: &compared.notes,
        files,
        environment: Environment::here(),
    };
    crate::say!("{}", serde_json::to_string_pretty(&report).map_err(Failure::work)?);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_six_digits() {
        for (value, text) in [
            (0.0, "0"),
            (1.0, "1.00000"),
            (0.012_345_678, "0.0123457"),
            (-31.067_554_9, "-31.0676"),
            (1.5e-7, "1.50000e-7"),
            (3e30, "3.00000e30"),
            (123_456.7, "123457"),
            (f64::INFINITY, "infinite"),
        ] {
            assert_eq!(number(value), text);
        }
    }
}
