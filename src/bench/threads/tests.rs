use super::file::speed_up;
use super::*;
use crate::Choice;
use crate::pipeline::executor::{Progress, Silent};
use crate::pipeline::plan::Settings;
use crate::report::plots::threads_plot;
use std::path::Path;
use std::sync::Arc;

fn case() -> Case {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects/SceneSSAO.xml");
    let settings = Settings { size: Some([24, 24]), set: vec!["pass2.samples=4".to_owned()], ..Settings::default() };
    Case::new(&path, settings, Choice::CPU).expect("the project is valid")
}

#[test]
fn every_step_has_a_point_for_each_number_of_threads_with_both_times() {
    let frames = MeasureOptions { frames: 3, warmup: 1 };
    let options = SweepOptions { threads: vec![1, 3], rounds: 2, frames };
    let mut openings = Vec::new();
    let measured = sweep(&case(), &options, || Box::new(Silent), |round, threads| openings.push((round, threads)));
    let measured = measured.expect("measured");
    assert_eq!(openings, [(1, 1), (1, 3), (2, 1), (2, 3)], "the numbers of threads take turns");
    assert_eq!((measured.size, measured.triangles > 50_000, measured.textures), ([24, 24], true, 21));
    let kinds: Vec<StepKind> = measured.steps.iter().map(|step| step.kind).collect();
    let expected =
        [StepKind::Load, StepKind::Upload, StepKind::Build, StepKind::Raster, StepKind::Rays, StepKind::Quad];
    assert_eq!(kinds, expected);
    for step in &measured.steps {
        let samples = if step.kind.per_frame() { 6 } else { 2 };
        let threads: Vec<usize> = step.points.iter().map(|point| point.threads).collect();
        assert_eq!(threads, [1, 3], "{}", step.name);
        for point in &step.points {
            assert_eq!(point.wall.n(), samples, "{}", step.name);
            assert_eq!(point.processor.as_ref().map(Stats::n), cfg!(unix).then_some(samples), "{}", step.name);
        }
    }
    assert!(measured.frame.iter().all(|point| point.wall.n() == 6));
    let plot = threads_plot(&measured).expect("a plot");
    assert!(plot.file.contains("threads") && plot.file.contains("build"), "{}", plot.file);
}

#[test]
fn processor_time_is_that_of_all_threads_and_not_of_those_that_sleep() {
    let busy = std::time::Duration::from_millis(60);
    let spin = || {
        let begun = std::time::Instant::now();
        while begun.elapsed() < busy {
            std::hint::black_box(0);
        }
    };
    let begun = Clocked::now();
    std::thread::sleep(busy);
    let slept = Clocked::since(begun);
    let begun = Clocked::now();
    std::thread::scope(|scope| {
        scope.spawn(spin);
        spin();
    });
    let worked = Clocked::since(begun);
    assert!(slept.wall_ms >= 59.0 && worked.wall_ms >= 59.0, "{slept:?} {worked:?}");
    let Some((slept, worked)) = slept.processor_ms.zip(worked.processor_ms) else {
        println!("skipped: this system does not tell processor times");
        return;
    };
    // Other tests of this process use processor time meanwhile, so only the lower bound is certain. On a loaded machine a thread
    // may get half a core.
    assert!(slept >= 0.0 && worked >= 15.0, "{slept} {worked}");
}

#[test]
fn a_clock_counts_what_begins_while_it_runs() {
    let mut silent = Silent;
    let mut clock = Clock::new(&mut silent);
    let step = |clock: &mut Clock<'_>, name: &str| {
        clock.begin(StepKind::Raster, name, &Arc::new(Progress::default()));
        clock.end();
    };
    step(&mut clock, "a");
    clock.pause();
    step(&mut clock, "warm-up");
    clock.go_on();
    step(&mut clock, "b");
    step(&mut clock, "a");
    // An end without a beginning is ignored.
    clock.end();
    let found: Vec<_> = clock.samples().steps.into_iter().map(|(_, name, samples)| (name, samples.len())).collect();
    assert_eq!(found, [("a".to_owned(), 2), ("b".to_owned(), 1)]);
}

#[test]
fn speed_ups_are_against_the_fewest_threads() {
    let point = |threads, ms| ThreadsPoint { threads, wall: Stats::new(vec![ms]).expect("one"), processor: None };
    let points = [point(4, 30.0), point(2, 60.0), point(8, 20.0)];
    let found: Vec<_> = points.iter().map(|point| speed_up(&points, point)).collect();
    assert_eq!(found, [Some(2.0), None, Some(3.0)]);
    assert_eq!(text::cell(&points, &points[2]), "20.00 (3.0)");
}

#[test]
fn other_files_are_not_taken_for_a_sweep() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("threads.json");
    assert!(ThreadsFile::read(&path).expect("no file").is_none());
    let file = ThreadsFile::begin("a".to_owned(), crate::environment::Environment::here(), 1, 2, 3);
    file.write(&path).expect("written");
    assert_eq!(ThreadsFile::read(&path).expect("whole").map(|file| file.warmup), Some(3));
    crate::bench::model::BenchFile::begin("a".to_owned(), crate::environment::Environment::here(), 1, 1)
        .write(&path)
        .expect("written");
    assert!(ThreadsFile::read(&path).is_err(), "this is another benchmark");
    let other = ThreadsFile { kind: "notes".to_owned(), ..file };
    other.write(&path).expect("written");
    assert!(ThreadsFile::read(&path).expect_err("another kind").to_string().contains("notes"));
}
