//! `curitiba tune`: chooses rasterisation or rays for each effect, and their settings, by measuring on this machine.

use super::progress::Bars;
use super::tune_args::TuneArgs;
use super::{Failure, check_references, failure, load, set_threads, tell_fastest};
use curitiba::bench::MeasureOptions;
use curitiba::bench::model::Stats;
use curitiba::bench::text::median_and_interval;
use curitiba::environment::Environment;
use curitiba::pipeline::files::{OutputError, TemporaryFolder};
use curitiba::reference::References;
use curitiba::tune::{self, Bench, Found, Goal, Slot, Trial, label, machine::Request};
use std::path::Path;
use std::time::Duration;

/// Number of next best candidates that are named with the chosen one.
const NEXT_BEST: usize = 2;

/// Measures candidates, chooses one, writes its project and measures the written project.
pub fn run(args: &TuneArgs) -> Result<(), Failure> {
    set_threads(args.project.threads)?;
    tell_fastest(args.project.choice());
    whole_frames(args)?;
    check_output(&args.output)?;
    let references = References::default_folder();
    check_references(&references, "the variable CURITIBA_CACHE names another folder")?;
    load::tell(&Environment::here());
    let references = References::new(references, Duration::from_secs(args.reference_seconds.into()));
    // The temporary folder lies beside the output, and so in the folder of --confine.
    let folder = TemporaryFolder::new(args.output.parent().unwrap_or(Path::new(""))).map_err(Failure::work)?;
    let mut bars = Bars::default();
    let request = Request {
        path: &args.project.path,
        settings: args.project.settings(),
        choice: args.project.choice(),
        options: MeasureOptions { frames: args.frames, warmup: 1 },
        metric: args.metric,
        of: args.of.into(),
    };
    let mut bench = Bench::open(request, references, folder.path(), &mut bars)?;
    let counts: Vec<usize> = bench.slots().iter().map(|slot| slot.candidates.len()).collect();
    if counts.is_empty() {
        return Err(Failure::Usage(format!(
            "{}: no pass that runs has anything in its place\n       valid: a ray pass with shadows, occlusion or glass, or an effect pass",
            args.project.path.display()
        )));
    }
    let own_error = bench.check_reference().map_err(|error| Failure::Usage(format!("--of picture: {error}")))?;
    if let Some(own_error) = own_error {
        crate::tell!("errors are of the picture, against a reference whose own standard error is {own_error:.4}");
    }
    let slots = bench.slots().to_vec();
    let first = 1 + counts.iter().map(|count| count - 1).sum::<usize>();
    let mut done = 0;
    let mut told = |variant: &[usize]| {
        done += 1;
        let of = if done <= first { format!(" of {first}") } else { ", again or combined".to_owned() };
        crate::tell!("{done}{of}: {}", label(&slots, variant));
    };
    let found = tune::search(&counts, args.goal(), &mut bench, &mut told);
    bench.take_warnings().iter().for_each(|warning| failure::print_warning(warning));
    print(&found, args, &slots);
    let Some(chosen) = found.ranked.first() else {
        return Err(Failure::Beyond(nothing_fits(&found, args, &slots)));
    };
    let written = bench.project(&found.trials[*chosen].variant).write(&args.output)?;
    written.iter().for_each(|file| crate::say!("wrote {}", file.display()));
    confirm(&mut bench, args)
}

/// Measures the written project, and fails if it misses the goal; a time is judged by its median alone.
fn confirm(bench: &mut Bench<'_>, args: &TuneArgs) -> Result<(), Failure> {
    let run = bench.run_file(&args.output).map_err(Failure::Work)?;
    let trial = Trial::new(Vec::new(), run);
    let (time, error) = (times(&trial), trial.error);
    crate::say!("rendered again: {time} ms, {} {error:.4}", args.metric.title);
    let kept = match args.goal() {
        Goal::Time(most) => trial.median() <= most,
        Goal::Error(most) => error <= most,
    };
    if kept {
        return Ok(());
    }
    Err(Failure::Beyond(format!(
        "rendered again it does not keep the goal: the machine is busier than it was; run this again, or with more --frames (now {})",
        args.frames
    )))
}

/// Fails if `--show`, `--crop` or `--bands` is given: `tune` measures whole frames of the window.
fn whole_frames(args: &TuneArgs) -> Result<(), Failure> {
    let project = &args.project;
    let given = [
        ("--show", !project.show.is_empty()),
        ("--crop", project.crop.is_some()),
        ("--bands", project.bands.is_some()),
    ];
    match given.iter().find(|(_, given)| *given) {
        None => Ok(()),
        Some((name, _)) => Err(Failure::Usage(format!("{name}: whole frames are measured; leave it out"))),
    }
}

/// Fails if the output exists already or is not a project file, before anything is measured.
fn check_output(path: &Path) -> Result<(), Failure> {
    let wrong = |why: &str| Err(Failure::Usage(format!("-o {}: {why}", path.display())));
    if path.extension().is_none_or(|extension| extension != "xml") {
        return wrong("a project is written as .xml");
    }
    if path.exists() {
        return wrong("this file is there already; name another, or remove it");
    }
    curitiba::pipeline::files::check_outputs([(path, "-o")])
        .map_err(|error: OutputError| Failure::Usage(error.to_string()))
}

fn times(trial: &Trial) -> String {
    Stats::new(trial.frames_ms.clone()).map_or_else(|| "-".to_owned(), |stats| median_and_interval(&stats))
}

/// Description of the goal.
fn goal(args: &TuneArgs) -> String {
    match args.goal() {
        Goal::Time(most) => format!("the least {} within {most} ms", args.metric.title),
        Goal::Error(most) => format!("the least time with a {} of at most {most}", args.metric.title),
    }
}

/// Prints the measured candidates, the fastest first.
fn print(found: &Found, args: &TuneArgs, slots: &[Slot]) {
    let title = args.metric.title;
    crate::say!("  {:>26}  {title:>8}  {:>6}  ", "ms a frame (95 % of median)", "frames");
    let mut order: Vec<usize> = (0..found.trials.len()).collect();
    order.sort_by(|a, b| found.trials[*a].median().total_cmp(&found.trials[*b].median()));
    for index in order {
        let trial = &found.trials[index];
        let mark = match found.ranked.iter().position(|ranked| *ranked == index) {
            Some(0) => '*',
            Some(place) if place <= NEXT_BEST => '+',
            _ => ' ',
        };
        let declared = if trial.variant.iter().all(|candidate| *candidate == 0) { " (as declared)" } else { "" };
        crate::say!(
            "{mark} {:>26}  {:>8.4}  {:>6}  {}{declared}",
            times(trial),
            trial.error,
            trial.frames_ms.len(),
            label(slots, &trial.variant)
        );
    }
    for (variant, why) in &found.missing {
        failure::print_warning(&format!("not measured: {}: {why}", label(slots, variant)));
    }
    if let Some(chosen) = found.ranked.first() {
        crate::say!("* {}: {}", goal(args), label(slots, &found.trials[*chosen].variant));
    }
}

/// Message about the candidate nearest to a goal that none reaches.
fn nothing_fits(found: &Found, args: &TuneArgs, slots: &[Slot]) -> String {
    let key = |trial: &&Trial| match args.goal() {
        Goal::Time(_) => trial.median(),
        Goal::Error(_) => trial.error,
    };
    let nearest = found.trials.iter().min_by(|a, b| key(a).total_cmp(&key(b)));
    let nearest = nearest.map_or_else(String::new, |trial| {
        format!("; nearest: {} ms, {:.4}: {}", times(trial), trial.error, label(slots, &trial.variant))
    });
    format!("nothing measured gives {}{nearest}", goal(args))
}
