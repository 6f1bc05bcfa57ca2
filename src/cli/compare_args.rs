//! The arguments of `compare`.

use clap::{Args, ValueHint};
use curitiba::args::parse_bytes;
use curitiba::pipeline::diagnostic::valid_names;
use curitiba::pipeline::metrics::METRICS;
use curitiba::spec::SETTINGS;
use std::path::PathBuf;

/// Name of the z-test among the metrics.
pub const Z_TEST: &str = "z";

/// Arguments of `compare`.
#[derive(Debug, Args)]
pub struct CompareArgs {
    /// What is judged: FILE.png, FILE.exr, or PROJECT.xml@SETTING,SETTING
    #[arg(value_name = "A", value_hint = ValueHint::FilePath)]
    pub test: String,
    /// The reference: as A
    #[arg(value_name = "B", value_hint = ValueHint::FilePath)]
    pub reference: String,
    #[command(flatten)]
    pub limits: LimitArgs,
    /// Print only these metrics (rmse, relmse, max, psnr, ssim, flip, energy, outliers, z); JSON holds all
    #[arg(long, value_name = "NAME", value_delimiter = ',', value_parser = parse_metric)]
    pub metric: Vec<String>,
    /// Render each project with N seeds, compare the means, and tell noise from error with a z-test
    #[arg(long, value_name = "N", default_value_t = 1,
          value_parser = clap::value_parser!(u32).range(1..=i64::from(curitiba::compare::MAX_SEEDS)))]
    pub seeds: u32,
    /// Write the FLIP error as a heat map: black is none, cream is 1
    #[arg(long, value_name = "FILE.png", value_hint = ValueHint::FilePath)]
    pub heat: Option<PathBuf>,
    /// Write A, B and the heat map side by side
    #[arg(long, value_name = "FILE.png", value_hint = ValueHint::FilePath)]
    pub strip: Option<PathBuf>,
    /// A pixel is an outlier if one of its values differs by more [default: 2.5 / 255]
    #[arg(long, value_name = "X", value_parser = parse_limit)]
    pub outlier_threshold: Option<f64>,
    /// Pixels in a degree of visual angle, 1 to 1000, for FLIP
    #[arg(long, value_name = "X", default_value_t = 67.0)]
    pub pixels_per_degree: f64,
    /// Print the result as JSON
    #[arg(long)]
    pub json: bool,
    /// Threads of the cpu engines [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Most memory that the program may take, in bytes or with a unit: 512MiB, 8GiB
    #[arg(long, value_name = "BYTES", default_value = "8GiB", value_parser = parse_bytes)]
    pub max_memory: u64,
}

/// Limits of `compare`; beyond one the exit code is 1.
#[derive(Debug, Args)]
#[command(next_help_heading = "Limits (exit code 1 beyond one)")]
pub struct LimitArgs {
    /// Largest root mean square error
    #[arg(long, value_name = "X", value_parser = parse_limit)]
    pub max_rmse: Option<f64>,
    /// Largest relative mean square error
    #[arg(long, value_name = "X", value_parser = parse_limit)]
    pub max_relmse: Option<f64>,
    /// Largest difference of any value
    #[arg(long, value_name = "X", value_parser = parse_limit)]
    pub max_difference: Option<f64>,
    /// Least peak signal-to-noise ratio, decibels
    #[arg(long, value_name = "X", value_parser = parse_limit)]
    pub min_psnr: Option<f64>,
    /// Least structural similarity
    #[arg(long, value_name = "X", value_parser = parse_limit)]
    pub min_ssim: Option<f64>,
    /// Largest mean FLIP error
    #[arg(long, value_name = "X", value_parser = parse_limit)]
    pub max_flip: Option<f64>,
    /// Largest distance of the energy ratio from 1
    #[arg(long, value_name = "X", value_parser = parse_limit)]
    pub max_energy: Option<f64>,
    /// Largest share of outlier pixels, 0 to 1
    #[arg(long, value_name = "X", value_parser = parse_limit)]
    pub max_outliers: Option<f64>,
    /// Largest sigma of the z-test; 4 asks for no more than noise
    #[arg(long, value_name = "X", value_parser = parse_limit)]
    pub max_z: Option<f64>,
}

/// Parses a name for `--metric`.
fn parse_metric(text: &str) -> Result<String, String> {
    let names = METRICS.iter().map(|metric| metric.name).chain([Z_TEST]);
    if names.clone().any(|name| name == text) { Ok(text.to_owned()) } else { Err(valid_names(text, names)) }
}

/// Parses a limit: a number of 0 or more. (SSIM may be negative, but not its limit.)
fn parse_limit(text: &str) -> Result<f64, String> {
    let value: Option<f64> = text.trim().parse().ok().filter(|value: &f64| value.is_finite() && *value >= 0.0);
    value.ok_or_else(|| format!("`{text}` is no number of 0 or more"))
}

/// The text of `--help` below the options: settings, formulas, examples and exit codes.
pub fn long_help() -> String {
    let settings: String = SETTINGS.iter().map(|(name, value)| format!("  {name:10} {value}\n")).collect();
    let formulas: String = METRICS.iter().map(|metric| format!("  {:10} {}\n", metric.name, metric.formula)).collect();
    format!(
        "\
Settings of a project, PROJECT.xml@NAME=VALUE,NAME=VALUE (all may be left out):
{settings}
Metrics, of A (t) against B (r), over the colours of all pixels; alpha is not compared:
{formulas}  {Z_TEST:10} (c - 1) sqrt(n / 2), c = mean over n tiles of 8 x 8 pixels of z^2, z = sum(t - r) / sqrt(sum(vt + vr)), vt \
and vr the variances of the means; z of estimated variances is mapped from Student's t (Welch) to the normal value \
of the same probability. Above 4 the difference is more than noise.
  Values are compared as stored where no side is linear radiance (a project or scene with color=linear, and its .exr). Where one is, the \
other's are decoded from sRGB if they are display values (.png; color=report), and the result says so.
  SSIM and FLIP are of displayed values: values cut to 0 to 1, and of linear radiance encoded in sRGB, as the .png of `render` holds \
them without exposure or tone curve.
  Positions and normals (.exr of --show) are compared as if they were colours.

Examples:
  curitiba compare a.exr b.exr --max-rmse 0.01 --max-flip 0.05
  curitiba compare final.png old/final.png --strip strip.png
  curitiba compare p.xml@fidelity=thesis p.xml@fidelity=corrected --heat heat.png
  curitiba compare p.xml@raster=wgpu p.xml@raster=cpu --metric rmse,flip
  curitiba compare SceneSSAO.xml@pass2.samples=4 SceneSSAO.xml@pass2.samples=100 --seeds 8 --max-z 4

Exit codes: 0 within all limits, or none given; 1 beyond a limit (`beyond:` is printed), or the work failed (`error:`); \
2 the command line is wrong; 3 a file is wrong: a picture cannot be read, holds NaN, or has another size or other channels \
than the other."
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn help_names_every_metric_and_setting() {
        let help = long_help();
        for name in METRICS.iter().map(|metric| metric.name).chain(SETTINGS.iter().map(|(name, _)| *name)) {
            assert!(help.contains(&format!("\n  {name:10} ")), "{name}");
        }
        assert!(parse_metric("flpi").expect_err("a typing error").contains("did you mean `flip`?"));
        assert!(parse_limit("-1").is_err() && parse_limit("NaN").is_err() && parse_limit("0.5") == Ok(0.5));
    }
}
