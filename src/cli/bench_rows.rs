//! Measuring the rows of `bench` one after another.

use super::bench_args::BenchArgs;
use super::bench_jobs::Job;
use super::progress::Bars;
use super::{Failure, failure};
use curitiba::OpenError;
use curitiba::bench::inputs::picture_hash;
use curitiba::bench::model::{BenchRow, Inputs, RowError, Unavailable};
use curitiba::bench::{MeasureOptions, Measured, measure};
use curitiba::pipeline::backend::BackendError;
use curitiba::pipeline::diagnostic::WarningGroup;
use curitiba::pipeline::executor::RenderError;
use curitiba::reference::References;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Measures rows, and compares their pictures with references.
pub(super) struct Rows {
    options: MeasureOptions,
    rounds: u32,
    /// `None` if no errors are wanted.
    references: Option<References>,
    warned: BTreeSet<String>,
    start: Instant,
}

/// A row that could not be measured.
pub(super) struct Missing {
    /// The row and the reason.
    pub what: Unavailable,
    /// The failure that the command reports after the last row; `None` if an engine does not support the row at all, which is a valid
    /// result.
    pub failure: Option<Failure>,
}

impl Rows {
    /// `folder` is the folder of references.
    pub fn new(args: &BenchArgs, folder: PathBuf) -> Self {
        let references = References::new(folder, Duration::from_secs(args.reference_seconds.into()));
        Self {
            options: MeasureOptions { frames: args.frames, warmup: args.warmup },
            rounds: args.rounds(),
            references: (!args.no_error).then(|| references.with_samples(args.reference_samples)),
            warned: BTreeSet::new(),
            start: Instant::now(),
        }
    }

    /// Measures a row and its errors; `place` is the row's index and the number of all rows. Reports progress on the error stream.
    pub fn measure(&mut self, job: &Job, place: (usize, usize)) -> Result<BenchRow, Missing> {
        let case = &job.case;
        let measured = self.times(job, place, 1)?;
        let mut bars = Bars::default();
        for text in measured.renderer.warnings().groups().iter().map(WarningGroup::to_string) {
            if self.warned.insert(text.clone()) {
                failure::print_warning(&text);
            }
        }
        let (mut row, picture) = (measured.row, measured.picture);
        row.inputs = Some(Inputs::of(&measured.renderer));
        row.picture = Some(picture_hash(&picture));
        // Frees the row's scene before the reference's scene is loaded.
        drop(measured.renderer);
        row.thesis = job.row.map(|of_table| of_table.figure(&row));
        row.error = match &mut self.references {
            None => RowError::Missing("--no-error".to_owned()),
            Some(references) => references.compare(case, &picture, &mut bars).unwrap_or_else(|error| {
                failure::print_warning(&error.to_string());
                RowError::Missing(error.to_string())
            }),
        };
        row.picture_error = Some(match &mut self.references {
            None => RowError::Missing("--no-error".to_owned()),
            Some(references) => references.compare_picture(case, &picture, &mut bars).unwrap_or_else(|error| {
                failure::print_warning(&error.to_string());
                RowError::Missing(error.to_string())
            }),
        });
        drop(bars);
        let warnings = self.references.as_mut().map(References::take_warnings).unwrap_or_default();
        warnings.iter().for_each(|warning| failure::print_warning(warning));
        Ok(row)
    }

    /// Measures the times of a row in a later round.
    pub fn again(&mut self, job: &Job, place: (usize, usize), round: u32) -> Result<BenchRow, Missing> {
        self.times(job, place, round).map(|measured| measured.row).map_err(|mut missing| {
            missing.what.what += &format!(", round {round}");
            missing
        })
    }

    fn times(&self, job: &Job, (index, of): (usize, usize), round: u32) -> Result<Measured, Missing> {
        let case = &job.case;
        let spent = self.start.elapsed().as_secs_f64();
        let round = if self.rounds > 1 { format!("round {round} of {}, ", self.rounds) } else { String::new() };
        crate::tell!("{round}row {} of {of}: {}, {} ({spent:.0} s so far)", index + 1, case.label, case.view);
        let mut bars = Bars::default();
        let measured = measure(case, &self.options, &mut bars);
        drop(bars);
        measured.map_err(|error| missing(job, error))
    }
}

fn missing(job: &Job, error: OpenError) -> Missing {
    let (case, choice) = (&job.case, job.case.choice);
    let engines = format!("{} and {}", choice.raster.name(), choice.rays_in_words());
    let what = Unavailable { what: format!("{}, {} on {engines}", case.label, case.view), why: error.joined() };
    failure::print_warning(&format!("{}: {}", what.what, what.why));
    Missing { what, failure: (!is_unsupported(&error)).then(|| Failure::from(error)) }
}

/// Whether an engine does not support a case at all, which is a valid result and not a failure.
fn is_unsupported(error: &OpenError) -> bool {
    matches!(
        error,
        OpenError::Engine(BackendError::Unsupported { .. })
            | OpenError::Render(RenderError::Pass { error: BackendError::Unsupported { .. }, .. })
    )
}
