//! The arguments of `tune`.

use super::reference_args::OfArg;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{ArgGroup, Args, ValueHint};
use curitiba::args::{ProjectArgs, parse_error_bound};
use curitiba::pipeline::metrics::{Better, METRICS, MetricInfo};
use curitiba::tune::Goal;
use std::path::PathBuf;

/// Arguments of `tune`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("goal").required(true).args(["time", "error"]))]
pub struct TuneArgs {
    #[command(flatten)]
    pub project: ProjectArgs,
    /// The least error of frames that take at most so long: 16.6ms, 0.5s
    #[arg(long, value_name = "TIME", value_parser = parse_time)]
    time: Option<f64>,
    /// The least time of frames whose error is at most this
    #[arg(long, value_name = "ERROR", value_parser = parse_error_bound)]
    error: Option<f64>,
    /// What the error is: a metric of `curitiba compare` of which less is better
    #[arg(long, value_name = "NAME", default_value = "rmse", value_parser = metric_parser())]
    pub metric: &'static MetricInfo,
    /// What the error is of: the effect, from the same G-buffer; or the picture as a whole, where `curitiba reference` has made its reference
    #[arg(long, value_name = "WHAT", default_value = "effect")]
    pub of: OfArg,
    /// The project that is written; its library gets the same name
    #[arg(short, long, value_name = "FILE.xml", default_value = "tuned.xml", value_hint = ValueHint::FilePath)]
    pub output: PathBuf,
    /// Frames of each measurement
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub frames: u32,
    /// Seconds that refining a reference may take
    #[arg(long, value_name = "N", default_value_t = 60)]
    pub reference_seconds: u32,
}

impl TuneArgs {
    /// The goal: time or error; the argument group guarantees that exactly one is given.
    pub fn goal(&self) -> Goal {
        match (self.time, self.error) {
            (Some(ms), _) => Goal::Time(ms),
            (None, error) => Goal::Error(error.unwrap_or(0.0)),
        }
    }
}

fn metric_parser() -> impl TypedValueParser<Value = &'static MetricInfo> {
    let errors = || METRICS.iter().filter(|metric| metric.better == Better::Lower);
    PossibleValuesParser::new(errors().map(|metric| metric.name))
        .try_map(move |name| errors().find(|metric| metric.name == name).ok_or("no metric"))
}

/// Parses `16.6ms` or `0.5s` as milliseconds.
fn parse_time(text: &str) -> Result<f64, String> {
    let wrong = || format!("`{text}` is no time; valid: a number above 0 with its unit, such as 16.6ms or 0.5s");
    let (number, scale) = match (text.strip_suffix("ms"), text.strip_suffix('s')) {
        (Some(number), _) => (number, 1.0),
        (None, Some(number)) => (number, 1000.0),
        (None, None) => return Err(wrong()),
    };
    let ms = number.trim().parse::<f64>().map_err(|_| wrong())? * scale;
    if ms.is_finite() && ms > 0.0 { Ok(ms) } else { Err(wrong()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_units() {
        assert_eq!(parse_time("16.6ms"), Ok(16.6));
        assert_eq!(parse_time("0.5s"), Ok(500.0));
        for wrong in ["16", "ms", "-1ms", "0s", "nan ms", "infs", "1e400ms"] {
            assert!(parse_time(wrong).is_err_and(|error| error.contains("16.6ms")), "{wrong}");
        }
    }
}
