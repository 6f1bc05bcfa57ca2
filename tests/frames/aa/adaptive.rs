//! Adaptive numbers of samples: rays are traced for four samples of a pixel where those are alike.

use super::{bits, file, frame, opened, rms, samples, settings};
use curitiba::pipeline::backend::Rect;
use curitiba::pipeline::executor::{Renderer, Row, Silent};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::pixel_samples::PixelSamples;
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::Fidelity;
use curitiba::pipeline::project;
use curitiba::{BackendChoice, Choice, OpenError, RasterChoice};

fn within(count: u32, tolerance: f32) -> PixelSamples {
    samples(count).within(tolerance).expect("more than four samples")
}

/// The picture, the number of rays in the frame, and the share of pixels with all samples, if it is known.
fn rendered(name: &str, aa: PixelSamples, choice: Choice) -> Result<(Image, u64, Option<f64>), OpenError> {
    let settings = Settings { aa, size: Some([160, 120]), ..settings(name, 1) };
    let mut renderer = curitiba::open(file(name), settings, choice, &mut Silent)?;
    let picture = frame(&mut renderer);
    let found = traced(&renderer);
    // A second frame is the same.
    assert!(bits(&frame(&mut renderer)) == bits(&picture) && traced(&renderer) == found, "{name}");
    Ok((picture, found.0, found.1))
}

fn traced(renderer: &Renderer) -> (u64, Option<f64>) {
    let row: &Row = renderer.timeline().rows.iter().find(|row| row.rays.is_some()).expect("it traces");
    assert_eq!(row.note.contains("all samples in"), row.all_samples.is_some(), "{}", row.note);
    (row.rays.expect("just found").total(), row.all_samples)
}

/// The adaptive number traces at most the share `most` of the rays, and its error against 64 samples on the processor is nearly as small as with
/// all rays.
fn check(name: &str, most: f64, choice: Choice) -> Result<(), OpenError> {
    let (truth, ..) = rendered(name, samples(64), Choice::CPU)?;
    let (four, ..) = rendered(name, samples(4), choice)?;
    let (all, rays_of_all, none) = rendered(name, samples(16), choice)?;
    let (found, rays, share) = rendered(name, within(16, 0.02), choice)?;
    assert_eq!(none, None);
    let (share, saved) = (share.expect("the number is adaptive"), rays as f64 / rays_of_all as f64);
    let [error, of_four, of_all] = [&found, &four, &all].map(|image| rms(image, &truth));
    println!(
        "{name}: {share:.3} of the pixels, {saved:.3} of the rays, error {error:.5}, of 4 {of_four:.5}, of 16 {of_all:.5}"
    );
    assert!((0.001..0.5).contains(&share) && saved < most, "{name}: {share} of the pixels, {saved} of the rays");
    assert!(error < 1.4 * of_all && error < 0.7 * of_four, "{name}: {error}; {of_four} with 4, {of_all} with 16");
    Ok(())
}

#[test]
fn where_samples_are_alike_four_are_traced() {
    // What glass shows is rarely alike within a pixel, and outside of glass this program traces nothing.
    for (name, most) in [("SceneShadows", 0.5), ("SceneReflect", 1.0)] {
        check(name, most, Choice::CPU).expect("it opens");
    }
}

#[test]
fn devices_skip_pixels_too() {
    let drawn = Choice { raster: RasterChoice::Wgpu, ..Choice::CPU };
    for choice in [drawn, Choice { backend: BackendChoice::Wgpu, ..drawn }] {
        if let Err(error) = check("SceneShadows", 0.5, choice) {
            assert!(std::env::var_os("CURITIBA_REQUIRE_GPU_TESTS").is_none(), "{error}");
            println!("skipped: {error}");
            return;
        }
    }
}

/// The smaller the tolerance, the more pixels have all samples, and the smaller is the error. Pixels with all their samples, or with equal
/// shares, are the same as without a tolerance.
#[test]
fn the_tolerance_decides() {
    let name = "SceneShadows";
    let (all, ..) = rendered(name, samples(16), Choice::CPU).expect("it opens");
    let of = |tolerance: f32| {
        let (found, _, share) = rendered(name, within(16, tolerance), Choice::CPU).expect("it opens");
        (rms(&found, &all), share.expect("adaptive"), found)
    };
    let (of_four, share, _) = of(1.0);
    assert_eq!(share, 0.0);
    let mut before = (of_four, share);
    for tolerance in [0.1, 0.02, 0.0] {
        let (error, share, _) = of(tolerance);
        assert!(error <= before.0 && share >= before.1, "{tolerance}: {error}, {share}, and before {before:?}");
        before = (error, share);
    }
    let (error, share, exact) = of(0.0);
    let equal = exact.pixels.iter().zip(&all.pixels).filter(|(a, b)| a == b).count();
    println!("{share} of the pixels, error {error}, {equal} equal");
    assert!(share < 0.6 && error < 0.7 * of_four && equal as f64 > share * all.pixels.len() as f64);
}

#[test]
fn what_could_not_skip_pixels_is_refused() {
    let whole = Settings { aa: within(16, 0.02), ..settings("SceneFinal", 16) };
    let crop = Some(Rect { x: 0, y: 0, width: 16, height: 16 });
    let filter = [whole.set.clone(), vec!["pass2.filter=1".to_owned()]].concat();
    let plain = Settings { set: Vec::new(), ..whole.clone() };
    for (name, settings, why) in [
        ("SceneFinal", Settings { fidelity: Fidelity::Thesis, ..whole.clone() }, "the report's programs"),
        ("SceneFinal", Settings { crop, ..whole.clone() }, "neighbours decide"),
        ("SceneFinal", Settings { bands: Some(2), size: Some([112, 200]), ..whole.clone() }, "neighbours decide"),
        ("SceneSSAO", Settings { set: filter, ..whole.clone() }, "pass `pass2` filters"),
        ("SceneNoEffects", plain.clone(), "no pass traces rays"),
        ("raster/SceneGTAO", plain, "no pass traces rays"),
    ] {
        let error = Plan::new(project::load(&file(name)).expect("it loads"), settings).expect_err(why).to_string();
        assert!(
            error.contains("--aa 16:0.02") && error.contains(why) && error.contains("use --aa 16,"),
            "{name}: {error}"
        );
    }
    // A filter over shares without noise does nothing.
    let idle =
        Settings { set: vec!["pass2.filter=1".to_owned()], aa: within(16, 0.02), ..settings("SceneShadows", 16) };
    Plan::new(project::load(&file("SceneShadows")).expect("it loads"), idle).expect("a plan");
    let planned =
        |aa| Plan::new(project::load(&file("SceneFinal")).expect("it loads"), Settings { aa, ..whole.clone() });
    let [with, without] = [whole.aa, samples(16)].map(|aa| planned(aa).expect("a plan"));
    assert_eq!(with.target_bytes() - without.target_bytes(), 69 * 112 * 80, "four sums, a flag and a triangle a pixel");
    let decision =
        with.decisions.iter().find(|decision| decision.what == "16:0.02 samples a pixel").expect("it is said");
    assert!(decision.why.contains("runs 16 times, of which ray passes trace 4 where"), "{}", decision.why);
    let error = opened("SceneFinal", whole).sample(0, &mut Silent).expect_err("it is no picture").to_string();
    assert!(error.contains("16:0.02") && error.contains("use --aa 16,"), "{error}");
}
