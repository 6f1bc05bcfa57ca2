//! Frames with several samples per pixel: parts, threads, engines, changes, times, and what is refused.

use super::{bits, file, frame, mean, opened, rms, samples, settings};
use curitiba::pipeline::backend::Rect;
use curitiba::pipeline::executor::{Cancellation, Goal, Observer, Output, Progress, Renderer, Silent, StepKind};
use curitiba::pipeline::image::{Image, read_image};
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::Fidelity;
use curitiba::pipeline::project;
use curitiba::{BackendChoice, Choice, RasterChoice};
use std::process::Command;
use std::sync::Arc;

const PROJECTS: [&str; 7] =
    ["SceneNoEffects", "SceneDummy", "SceneShadows", "SceneReflect", "SceneRefract", "SceneSSAO", "SceneFinal"];

fn all_samples(renderer: &mut Renderer, count: u32) -> Vec<Image> {
    (0..count).map(|sample| renderer.sample(sample, &mut Silent).expect("a sample")).collect()
}

#[test]
fn a_frame_is_the_mean_of_its_samples() {
    for name in PROJECTS {
        for fidelity in [Fidelity::Corrected, Fidelity::Thesis] {
            let of = |count: u32| Settings { fidelity, ..settings(name, count) };
            let mut renderer = opened(name, of(8));
            let pictures = all_samples(&mut renderer, 8);
            let found = frame(&mut renderer);
            assert!(bits(&found) == bits(&mean(&pictures)), "{name}, {fidelity:?}");
            assert!(pictures.iter().skip(1).all(|picture| bits(picture) != bits(&pictures[0])), "{name}: all differ");
            let one = frame(&mut opened(name, of(1)));
            assert!(bits(&found) != bits(&one) && rms(&found, &one) < 0.2, "{name}: another picture of the same");
            assert!(found.pixels.iter().flatten().all(|value| value.is_finite()));
        }
    }
}

#[test]
fn one_sample_is_the_picture_without() {
    for name in PROJECTS {
        let without = Settings { aa: Default::default(), ..settings(name, 2) };
        let mut one = opened(name, settings(name, 1));
        let found = frame(&mut one);
        assert!(bits(&found) == bits(&frame(&mut opened(name, without.clone()))), "{name}");
        assert!(bits(&one.sample(0, &mut Silent).expect("the only one")) == bits(&found), "{name}");
        let plan = |settings| Plan::new(project::load(&file(name)).expect("it loads"), settings).expect("a plan");
        let (with, without) = (plan(settings(name, 4)), plan(without));
        // Four sums in f64 for each pixel of the window are the only additional memory.
        assert_eq!(with.target_bytes() - without.target_bytes(), 32 * 112 * 80, "{name}");
        assert!(with.decisions.iter().any(|decision| decision.what == "4 samples a pixel"));
        assert!(without.decisions.iter().all(|decision| !decision.what.contains("a pixel")));
    }
}

#[test]
fn parts_are_those_of_the_whole() {
    for name in ["SceneNoEffects", "SceneShadows", "SceneFinal"] {
        let of = |crop: Option<Rect>, bands| Settings { size: Some([210, 150]), crop, bands, ..settings(name, 4) };
        let whole = frame(&mut opened(name, of(None, None)));
        let crop = Rect { x: 70, y: 81, width: 93, height: 60 };
        let rows = whole.pixels.chunks_exact(210).skip(81).take(60).flat_map(|row| &row[70..163]);
        let expected: Vec<[u32; 4]> = rows.map(|pixel| pixel.map(f32::to_bits)).collect();
        let mut part = opened(name, of(Some(crop), None));
        assert!(part.plan().in_parts() && bits(&frame(&mut part)).2 == expected, "{name}: the crop differs");
        let mut banded = opened(name, of(None, Some(3)));
        assert!(
            banded.plan().parts.list.len() > 1 && bits(&frame(&mut banded)) == bits(&whole),
            "{name}: bands differ"
        );
        // The picture written band by band is the same.
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("bands.exr");
        banded.render_and_save(&path, &mut Silent).expect("written");
        assert!(bits(&read_image(&path).expect("a picture").image) == bits(&whole), "{name}: written bands differ");
        let refused = banded.sample(0, &mut Silent).expect_err("a sample is a whole picture").to_string();
        assert!(refused.contains("--bands"), "{refused}");
    }
}

#[test]
fn an_update_is_a_frame_and_runs_nothing_twice() {
    let mut renderer = opened("SceneFinal", settings("SceneFinal", 4));
    let first = frame(&mut renderer);
    let again = renderer.update(&mut Silent).expect("a frame");
    assert!(bits(&again) == bits(&first) && renderer.passes_run().next().is_none());
    renderer.set_parameter("pass2", "radius", "2").expect("a parameter");
    let changed = renderer.update(&mut Silent).expect("a frame");
    let mut set = settings("SceneFinal", 4);
    set.set.push("pass2.radius=2".to_owned());
    let expected = frame(&mut opened("SceneFinal", set));
    assert!(bits(&changed) == bits(&expected) && bits(&changed) != bits(&first));
    // The same holds for a changed number of samples, and for a channel that was not averaged before.
    renderer.set_pixel_samples(samples(1)).expect("a number");
    let one = renderer.update(&mut Silent).expect("a frame");
    let mut set = settings("SceneFinal", 1);
    set.set.push("pass2.radius=2".to_owned());
    assert!(bits(&one) == bits(&frame(&mut opened("SceneFinal", set))));
    renderer.set_pixel_samples(samples(4)).expect("a number");
    assert!(bits(&renderer.update(&mut Silent).expect("a frame")) == bits(&expected));
    let channel = renderer.plan().channel_named("color").expect("a channel");
    let last = renderer.channel(channel).to_vec();
    renderer.set_shown(&["color".to_owned()]).expect("a channel");
    assert!(bits(&renderer.update(&mut Silent).expect("a frame")) == bits(&expected));
    assert!(renderer.channel(channel) != last, "the mean, and not the last sample");
    renderer.set_shown(&["pos".to_owned()]).expect_err("positions have no mean");
    // A single sample does not change the mean that is shown, nor does a cancelled frame.
    renderer.sample(1, &mut Silent).expect("a sample");
    assert!(bits(&renderer.update(&mut Silent).expect("a frame")) == bits(&expected));
    let stop = renderer.cancellation();
    stop.cancel();
    renderer.frame(&mut Silent).expect_err("it is cancelled");
    stop.reset();
    assert!(bits(&renderer.update(&mut Silent).expect("a frame")) == bits(&expected));
}

#[test]
fn a_frame_that_is_given_up_between_samples_is_rendered_again() {
    let mut renderer = opened("SceneShadows", settings("SceneShadows", 4));
    let expected = frame(&mut renderer);
    // Cancels when the last pass of a sample has ended, before the next sample begins.
    struct StopAfter(u32, Cancellation);
    impl Observer for StopAfter {
        fn begin(&mut self, _: StepKind, _: &str, _: &Arc<Progress>) {}
        fn end(&mut self) {}
        fn wrote(&mut self, output: &Output<'_>) {
            self.0 -= u32::from(output.channel == "window");
            if self.0 == 0 {
                self.1.cancel();
            }
        }
    }
    for done in [1, 2, 3] {
        let stop = renderer.cancellation();
        let given_up = renderer.frame(&mut StopAfter(done, stop.clone()));
        stop.reset();
        assert!(given_up.is_err() && bits(&renderer.window_image()) != bits(&expected), "{done} samples");
        assert!(bits(&renderer.update(&mut Silent).expect("a frame")) == bits(&expected), "{done} samples");
    }
}

#[test]
fn a_step_has_one_time_a_frame_and_the_rays_of_all_samples() {
    let mut renderer = opened("SceneShadows", settings("SceneShadows", 4));
    let rays = |renderer: &Renderer| renderer.timeline().rows.iter().find_map(|row| row.rays).expect("traced").total();
    let mut sum = 0;
    for sample in 0..4 {
        renderer.sample(sample, &mut Silent).expect("a sample");
        sum += rays(&renderer);
    }
    renderer.forget_frames();
    frame(&mut renderer);
    assert_eq!(rays(&renderer), sum, "the rays of the four samples");
    frame(&mut renderer);
    let rows = &renderer.timeline().rows;
    assert!(rows.iter().filter(|row| row.kind.per_frame()).all(|row| row.host_ms.len() == 2), "two frames");
}

#[test]
fn shown_colours_are_averaged_and_positions_are_refused() {
    let show = |channel: &str| Settings { show: vec![channel.to_owned()], ..settings("SceneShadows", 4) };
    let mut renderer = opened("SceneShadows", show("color"));
    let channel = renderer.plan().channel_named("color").expect("a channel");
    let own = |renderer: &Renderer| Image { width: 112, height: 80, pixels: renderer.channel(channel).to_vec() };
    let mut pictures = Vec::new();
    for sample in 0..4 {
        renderer.sample(sample, &mut Silent).expect("a sample");
        pictures.push(own(&renderer));
    }
    frame(&mut renderer);
    assert!(bits(&own(&renderer)) == bits(&mean(&pictures)));
    for (channel, what) in [("pos", "positions"), ("norm", "normals"), ("all", "positions")] {
        let error = curitiba::open(file("SceneShadows"), show(channel), Choice::CPU, &mut Silent);
        let error = error.map(|_| ()).expect_err("refused").to_string();
        assert!(error.contains(what) && error.contains("4 samples a pixel") && error.contains("--aa"), "{error}");
        let one = Settings { aa: samples(1), ..show(channel) };
        curitiba::open(file("SceneShadows"), one, Choice::CPU, &mut Silent).expect("with one sample it is shown");
    }
}

#[test]
fn accumulation_and_samples_that_are_not_there_are_refused() {
    let mut renderer = opened("SceneSSAO", settings("SceneSSAO", 4));
    let error = renderer.accumulate(Goal::Samples(16), &mut Silent).map(|_| ()).expect_err("refused").to_string();
    assert!(error.contains("one place of every pixel") && error.contains("PASS.samples=N"), "{error}");
    let error = renderer.sample(4, &mut Silent).expect_err("there are four").to_string();
    assert!(error.contains("valid: 0 to 3"), "{error}");
}

/// Rasteriser and rays on a graphics device: the same samples, with other rounding errors.
#[test]
fn devices_agree() {
    for name in ["SceneShadows", "SceneSSAO"] {
        let expected = frame(&mut opened(name, settings(name, 4)));
        let one = rms(&frame(&mut opened(name, settings(name, 1))), &expected);
        let drawn = Choice { raster: RasterChoice::Wgpu, ..Choice::CPU };
        for choice in [drawn, Choice { backend: BackendChoice::Wgpu, ..drawn }] {
            match curitiba::open(file(name), settings(name, 4), choice, &mut Silent) {
                Ok(mut renderer) => {
                    let off = rms(&frame(&mut renderer), &expected);
                    println!("{name}, {choice:?}: {off:.6}, one sample {one:.6}");
                    assert!(off < 0.06 * one, "{name}, {choice:?}: {off}, and one sample is off by {one}");
                }
                Err(error) => {
                    assert!(std::env::var_os("CURITIBA_REQUIRE_GPU_TESTS").is_none(), "{error}");
                    println!("skipped: {error}");
                    return;
                }
            }
        }
    }
}

/// Raster effects, with maps drawn anew for every sample and different noise.
#[test]
fn raster_effects_are_averaged() {
    // One small map for each, because the maps are drawn again for every sample.
    for (name, set) in [
        ("raster/SceneGTAO", &[][..]),
        ("raster/SceneShadowMap", &["pass2.mapsize=256", "pass2.cascades=1"]),
        ("raster/SceneCubeReflect", &["pass2.mapsize=64", "pass2.probes=1"]),
    ] {
        let set: Vec<String> = set.iter().map(|&value| value.to_owned()).collect();
        let of =
            |count| Settings { size: Some([112, 80]), aa: samples(count), set: set.clone(), ..Settings::default() };
        let mut renderer = opened(name, of(4));
        let pictures = all_samples(&mut renderer, 4);
        let found = frame(&mut renderer);
        assert!(bits(&found) == bits(&mean(&pictures)), "{name}");
        let reference = frame(&mut opened(name, of(64)));
        let errors = [1, 4, 16].map(|count| rms(&frame(&mut opened(name, of(count))), &reference));
        println!("{name}: {errors:.5?}");
        assert!(errors[1] < 0.65 * errors[0] && errors[2] < 0.65 * errors[1], "{name}: {errors:?}");
    }
}

#[test]
fn the_command_line_takes_samples_on_any_threads_and_says_what_they_cost() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let run = |words: &[&str]| {
        let project = file("SceneFinal");
        let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
        command.args([words[0]]).arg(project).args(&words[1..]);
        command.args(["--size", "96x64", "--set", "pass2.samples=4", "--raster", "cpu", "--backend", "cpu"]);
        let output = command.output().expect("it runs");
        (output.status.code(), String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
    };
    let rendered = |name: &str, words: &[&str]| {
        let path = path(name);
        let all = [&["render", "-o", path.to_str().expect("a name")], words].concat();
        let (code, text) = run(&all);
        assert_eq!(code, Some(0), "{text}");
        bits(&read_image(&path).expect("a picture").image)
    };
    let four = rendered("a.exr", &["--aa", "4", "--threads", "1"]);
    assert!(rendered("b.exr", &["--aa", "4", "--threads", "2"]) == four);
    assert!(rendered("c.exr", &["--aa", "4", "--threads", "7", "--frames", "2"]) == four);
    let one = rendered("d.exr", &["--aa", "1"]);
    assert!(rendered("e.exr", &[]) == one && one != four);
    let (code, text) = run(&["plan", "--aa", "16"]);
    assert_eq!(code, Some(0));
    assert!(text.contains("16 samples a pixel") && text.contains("every pass runs 16 times"), "{text}");
    for (words, says) in [
        (&["render", "--aa", "9"][..], "1, 2, 4, 8, 16, 32, 64"),
        (&["render", "--aa", "4", "--accumulate", "16"], "--accumulate with --aa 4"),
        (&["render", "--aa", "4", "--pixel", "3,4"], "--pixel with --aa 4"),
        (&["render", "--aa", "4", "--show", "norm"], "normals"),
        (&["check", "--aa", "4", "--show", "all"], "positions"),
    ] {
        let (code, text) = run(words);
        assert_eq!(code, Some(2), "{words:?}: {text}");
        assert!(text.contains(says), "{words:?}: {text}");
    }
    let (code, text) = run(&["check", "--aa", "64"]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("64 samples a pixel: every pass runs 64 times") && text.contains("MiB"), "{text}");
    let (code, text) = run(&["render", "--aa", "2", "--check-numerics", "-o", path("f.png").to_str().expect("a name")]);
    assert_eq!(code, Some(0), "{text}");
}
