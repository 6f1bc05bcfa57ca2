//! Accumulated samples use the same rays as all samples at once.

use super::{bits, file, frame, opened, update};
use curitiba::Choice;
use curitiba::pipeline::backend::RayJob;
use curitiba::pipeline::executor::{Goal, Observer, Progress, Renderer, Silent, StepKind};
use curitiba::pipeline::image::{Image, read_image};
use curitiba::pipeline::plan::Settings;
use curitiba::pipeline::programs::Fidelity;
use std::process::Command;
use std::sync::Arc;
use std::time::Duration;

fn settings(name: &str, samples: u32) -> Settings {
    let mut set = vec![format!("pass2.samples={samples}")];
    if name == "SceneFinal" {
        set.push("pass2.intensity=1".to_owned());
    }
    Settings { size: Some([112, 80]), camera: Some("Vidro".to_owned()), set, ..Settings::default() }
}

fn renderer(name: &str, samples: u32) -> Renderer {
    opened(name, settings(name, samples))
}

fn rms(a: &Image, b: &Image) -> f64 {
    let squares = a.pixels.iter().zip(&b.pixels).flat_map(|(a, b)| (0..3).map(|i| f64::from(a[i] - b[i]).powi(2)));
    (squares.sum::<f64>() / (3 * a.pixels.len()) as f64).sqrt()
}

fn largest(a: &Image, b: &Image) -> f32 {
    let differences = a.pixels.iter().zip(&b.pixels).flat_map(|(a, b)| (0..4).map(|i| (a[i] - b[i]).abs()));
    differences.fold(0.0, f32::max)
}

#[test]
fn sixteen_times_four_samples_are_sixty_four() {
    let mut accumulated = renderer("SceneSSAO", 100);
    let mut accumulation = accumulated.accumulation(&mut Silent).expect("it takes samples");
    for _ in 0..16 {
        accumulation.add(&mut accumulated, 4, &mut Silent).expect("a batch");
    }
    accumulation.show(&mut accumulated, &mut Silent).expect("the frame");
    assert_eq!((accumulation.samples(), accumulation.passes()[0].estimate().batches()), (64, 16));
    let at_once = frame(&mut renderer("SceneSSAO", 64));
    let shown = accumulated.window_image();
    assert!(bits(&shown) == bits(&at_once), "bit for bit, off by {}", largest(&shown, &at_once));
    // Controls: the first batch alone, and the same batches with another seed, give other pictures.
    assert!(rms(&frame(&mut renderer("SceneSSAO", 4)), &at_once) > 1e-3);
    assert!(
        bits(&frame(&mut opened("SceneSSAO", Settings { seed: 1, ..settings("SceneSSAO", 64) }))) != bits(&at_once)
    );
    // A single call chooses the same batches.
    let mut one = renderer("SceneSSAO", 100);
    let accumulation = one.accumulate(Goal::Samples(64), &mut Silent).expect("it takes samples");
    assert_eq!((accumulation.samples(), accumulation.passes()[0].estimate().batches()), (64, 16));
    assert!(bits(&one.window_image()) == bits(&at_once));
    let row = one.timeline().rows.iter().find(|row| row.kind.name() == "rays").expect("rays were traced");
    assert_eq!(row.host_ms.len(), 1, "one time for all batches");
    let rays = row.rays.expect("counted");
    let single = frame_rays(&mut renderer("SceneSSAO", 64));
    assert_eq!(rays.occlusion + rays.certain, single, "as many rays as at once");
}

fn frame_rays(renderer: &mut Renderer) -> u64 {
    frame(renderer);
    let rays = renderer.timeline().rows.iter().find_map(|row| row.rays).expect("rays were traced");
    rays.occlusion + rays.certain
}

#[test]
fn numbers_that_are_no_powers_of_two_are_off_by_rounding() {
    let mut accumulated = renderer("SceneSSAO", 4);
    let mut accumulation = accumulated.accumulation(&mut Silent).expect("it takes samples");
    for samples in [7, 30, 1, 11] {
        accumulation.add(&mut accumulated, samples, &mut Silent).expect("a batch");
    }
    accumulation.show(&mut accumulated, &mut Silent).expect("the frame");
    let off = largest(&accumulated.window_image(), &frame(&mut renderer("SceneSSAO", 49)));
    assert!(off <= 4.0 * f32::EPSILON, "{off}");
}

#[test]
fn colours_that_are_linear_in_shares_are_accumulated() {
    let mut accumulated = renderer("SceneFinal", 100);
    let accumulation = accumulated.accumulate(Goal::Samples(64), &mut Silent).expect("it takes samples");
    assert_eq!(accumulation.passes()[0].estimate().batches(), 16);
    let (shown, at_once) = (accumulated.window_image(), frame(&mut renderer("SceneFinal", 64)));
    let off = largest(&shown, &at_once);
    assert!(off <= 16.0 * f32::EPSILON, "{off}");
    assert!(rms(&frame(&mut renderer("SceneFinal", 4)), &at_once) > 1e-3);
}

/// Rays to the light's disc are samples of a sequence, and their mean has no exponent.
#[test]
fn soft_shadows_are_accumulated() {
    let of = |name: &str, samples: u32| {
        let mut set = vec!["pass2.sun=8".to_owned(), format!("pass2.sunsamples={samples}")];
        if name == "SceneFinal" {
            set.push("pass2.samples=0".to_owned());
        }
        opened(name, Settings { size: Some([112, 80]), camera: Some("Vidro".to_owned()), set, ..Settings::default() })
    };
    // `final` also adds up the colours of reflections, and in another order.
    for (name, most) in [("SceneShadows", 0.0), ("SceneFinal", 16.0 * f32::EPSILON)] {
        let mut accumulated = of(name, 16);
        let accumulation = accumulated.accumulate(Goal::Samples(64), &mut Silent).expect("it takes samples");
        assert_eq!((accumulation.samples(), accumulation.passes()[0].estimate().batches()), (64, 16));
        let (shown, at_once) = (accumulated.window_image(), frame(&mut of(name, 64)));
        assert!(largest(&shown, &at_once) <= most, "{name}: {}", largest(&shown, &at_once));
        let few = rms(&frame(&mut of(name, 4)), &at_once);
        assert!(few > 1e-3 && accumulation.error() > 0.0 && accumulation.error() < few, "{name}: {few}");
        let shadow =
            |renderer: &Renderer| renderer.timeline().rows.iter().find_map(|row| row.rays).map(|rays| rays.shadow);
        let mut at_once = of(name, 64);
        frame(&mut at_once);
        // Every batch repeats the rays that test whether points lifted onto round surfaces are cut off.
        let (all, once) = (shadow(&accumulated).expect("traced"), shadow(&at_once).expect("traced"));
        assert!((once..once + once / 100).contains(&all), "{name}: {all} and {once}");
    }
}

#[test]
fn the_standard_error_is_an_upper_estimate_and_falls() {
    let reference = frame(&mut renderer("SceneSSAO", 4096));
    let mut before = f64::INFINITY;
    for samples in [16, 64, 256] {
        let mut accumulated = renderer("SceneSSAO", 4);
        let accumulation = accumulated.accumulate(Goal::Samples(samples), &mut Silent).expect("it takes samples");
        let (told, real) = (accumulation.error(), rms(&accumulated.window_image(), &reference));
        // The pass writes a share. The window shows the share at most doubled, so the pass's own picture is compared.
        let pass = &accumulation.passes()[0];
        let of_pass = rms(&pass.picture(), &share(4096));
        assert!(of_pass <= 1.25 * told, "{samples} samples: {of_pass} and told {told}");
        assert!(told < 6.0 * of_pass, "{samples} samples: {of_pass} and told {told}: not an estimate");
        assert!(told < 0.6 * before && real.is_finite(), "{samples} samples: {told} after {before}");
        let errors = pass.standard_error();
        assert!(errors.pixels.iter().flatten().all(|error| error.is_finite() && *error >= 0.0));
        before = told;
    }
}

/// The pass's own picture, with this number of samples.
fn share(samples: u32) -> Image {
    let mut renderer = renderer("SceneSSAO", 4);
    let mut accumulation = renderer.accumulation(&mut Silent).expect("it takes samples");
    accumulation.add(&mut renderer, samples, &mut Silent).expect("a batch");
    accumulation.passes()[0].picture()
}

#[test]
fn goals_are_reached() {
    let mut by_error = renderer("SceneSSAO", 4);
    let accumulation = by_error.accumulate(Goal::Error(0.02), &mut Silent).expect("it takes samples");
    assert!(accumulation.error() <= 0.02 && accumulation.samples() >= 64);
    assert!(bits(&by_error.window_image()) == bits(&frame(&mut renderer("SceneSSAO", accumulation.samples() as u32))));
    let mut by_time = renderer("SceneSSAO", 4);
    let accumulation = by_time.accumulate(Goal::Time(Duration::from_nanos(1)), &mut Silent).expect("it takes samples");
    assert_eq!(accumulation.samples(), 32, "two batches, so that there is an error");
    assert!(accumulation.error().is_finite());
}

#[test]
fn what_was_set_is_accumulated_and_frames_go_on_as_before() {
    let mut changed = renderer("SceneSSAO", 4);
    let before = bits(&frame(&mut changed));
    changed.accumulate(Goal::Samples(16), &mut Silent).expect("it takes samples");
    assert!(bits(&changed.window_image()) != before);
    assert!(bits(&update(&mut changed)) == before, "a frame has the samples that the project says");
    changed.set_camera(Some("MainCamera")).expect("a camera");
    changed.set_parameter("pass2", "radius", "2").expect("a parameter");
    changed.accumulate(Goal::Samples(16), &mut Silent).expect("it takes samples");
    let mut settings = Settings { camera: None, ..settings("SceneSSAO", 16) };
    settings.set.push("pass2.radius=2".to_owned());
    assert!(bits(&changed.window_image()) == bits(&frame(&mut opened("SceneSSAO", settings))));
}

#[test]
fn passes_without_samples_are_rendered_once() {
    for name in ["SceneShadows", "SceneRefract", "SceneNoEffects"] {
        let settings = Settings { size: Some([64, 64]), ..Settings::default() };
        let mut accumulated = opened(name, settings.clone());
        let accumulation = accumulated.accumulate(Goal::Samples(64), &mut Silent).expect("a frame");
        assert!(accumulation.passes().is_empty() && accumulation.samples() == 0 && accumulation.error() == 0.0);
        assert!(bits(&accumulated.window_image()) == bits(&frame(&mut opened(name, settings))), "{name}");
    }
}

#[test]
fn what_cannot_be_accumulated_is_refused_with_what_can() {
    let refused = |name: &str, settings: Settings| {
        let mut renderer = opened(name, Settings { size: Some([64, 160]), ..settings });
        renderer.accumulate(Goal::Samples(4), &mut Silent).map(|_| ()).expect_err("refused").to_string()
    };
    let set = |text: &str| Settings { set: vec![text.to_owned()], ..Settings::default() };
    let error = refused("SceneSSAO", set("pass2.sampler=strata"));
    assert!(error.contains("no sequence") && error.contains("pass2.sampler=sobol"), "{error}");
    let error = refused("SceneSSAO", Settings { fidelity: Fidelity::Thesis, ..Settings::default() });
    assert!(error.contains("--fidelity corrected"), "{error}");
    let error = refused("SceneFinal", Settings::default());
    assert!(error.contains("intensity=1.6") && error.contains("--set pass2.intensity=1"), "{error}");
    let error = refused("SceneSSAO", Settings { bands: Some(2), ..Settings::default() });
    assert!(error.contains("bands") && error.contains("--max-memory"), "{error}");
}

#[test]
fn the_command_line_accumulates() {
    let folder = tempfile::tempdir().expect("a folder");
    let render = |arguments: &[&str], output: &str| {
        let output = folder.path().join(output);
        let result = Command::new(env!("CARGO_BIN_EXE_curitiba"))
            .arg("render")
            .arg(file("SceneSSAO"))
            .args(["--size", "96x64", "--raster", "cpu", "--backend", "cpu", "-o"])
            .arg(&output)
            .args(arguments)
            .output()
            .expect("it runs");
        (result, output)
    };
    let picture = |arguments: &[&str], output: &str| {
        let (result, output) = render(arguments, output);
        assert!(result.status.success(), "{}", String::from_utf8_lossy(&result.stderr));
        (String::from_utf8_lossy(&result.stdout).into_owned(), read_image(&output).expect("a picture").image)
    };
    let (text, accumulated) = picture(&["--accumulate", "64"], "a.exr");
    assert!(text.contains("pass2: 64 samples in 16 batches, standard error 0.0"), "{text}");
    let (_, at_once) = picture(&["--set", "pass2.samples=64"], "b.exr");
    assert!(bits(&accumulated) == bits(&at_once));
    let (json, _) = picture(&["--accumulate", "0.05", "--json"], "c.exr");
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    let pass = &json["accumulated"][0];
    assert!(pass["pass"] == "pass2" && pass["error"].as_f64().is_some_and(|error| error <= 0.05), "{pass}");
    let (wrong, _) = render(&["--accumulate", "many"], "d.exr");
    assert!(wrong.status.code() == Some(2) && String::from_utf8_lossy(&wrong.stderr).contains("500ms"));
}

#[test]
fn an_accumulation_of_the_cpu_equals_that_of_another_number_of_threads() {
    let once = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let settings = settings("SceneFinal", 4);
            let mut renderer =
                curitiba::open(file("SceneFinal"), settings, Choice::CPU, &mut Silent).expect("it opens");
            renderer.accumulate(Goal::Samples(32), &mut Silent).expect("it takes samples");
            bits(&renderer.window_image())
        })
    };
    assert!(once(1) == once(3));
}

/// Records the steps that begin, and after each batch the share of the whole that is done.
#[derive(Default)]
struct Follows {
    begun: Vec<String>,
    progress: Option<Arc<Progress>>,
    shares: Vec<f64>,
}

impl Observer for Follows {
    fn begin(&mut self, kind: StepKind, name: &str, progress: &Arc<Progress>) {
        self.begun.push(format!("{} {name}", kind.name()));
        self.progress = Some(Arc::clone(progress));
    }
    fn end(&mut self) {}
    fn traced(&mut self, _: &str, _: &RayJob<'_>, _: &Image) {
        let (done, total) = self.progress.as_ref().expect("a step").get();
        self.shares.push(done as f64 / total as f64);
    }
}

#[test]
fn progress_is_the_share_of_the_whole_goal() {
    let mut renderer = renderer("SceneSSAO", 4);
    let mut follows = Follows::default();
    renderer.accumulate(Goal::Samples(64), &mut follows).expect("it takes samples");
    let rays: Vec<&String> = follows.begun.iter().filter(|step| step.contains("pass2")).collect();
    assert_eq!(rays, ["rays pass2"], "one step for all batches: {:?}", follows.begun);
    assert_eq!(follows.shares.len(), 16);
    for (batch, share) in follows.shares.iter().enumerate() {
        assert!((share - (batch + 1) as f64 / 16.0).abs() < 1e-3, "{:?}", follows.shares);
    }
    // For a time or an error as the goal, the remaining work is unknown, but the share never decreases and never exceeds 1.
    for goal in [Goal::Time(Duration::from_millis(20)), Goal::Error(0.02)] {
        let mut follows = Follows::default();
        renderer.accumulate(goal, &mut follows).expect("it takes samples");
        let shares = follows.shares;
        assert!(
            shares.len() >= 2 && shares.is_sorted() && shares.iter().all(|share| (0.0..=1.0).contains(share)),
            "{shares:?}"
        );
    }
}
