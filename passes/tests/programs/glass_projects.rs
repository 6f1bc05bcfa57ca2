//! The projects of `xml_projects/glass`, end to end at small size.

use curitiba_passes::cpu::CpuRays;
use curitiba_passes::raster::cpu::CpuRasteriser;
use curitiba_pipeline::backend::{PhotonCounts, RayCounts};
use curitiba_pipeline::executor::{Engines, Renderer, Silent};
use curitiba_pipeline::image::Image;
use curitiba_pipeline::plan::{Plan, Settings};
use curitiba_pipeline::programs::Fidelity;
use curitiba_pipeline::project;
use std::path::Path;

struct Rendered {
    image: Image,
    glass: Vec<(String, String)>,
    rays: RayCounts,
}

fn render(name: &str, fidelity: Fidelity, set: &[&str]) -> Rendered {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../xml_projects/glass/{name}.xml"));
    let project = project::load(&path).expect("the project loads");
    let set = set.iter().map(|value| (*value).to_owned()).collect();
    let settings = Settings { size: Some([64, 64]), fidelity, set, ..Settings::default() };
    let plan = Plan::new(project, settings).expect("a plan");
    let engines = Engines::new(Box::new(CpuRasteriser::new()), Box::new(CpuRays::new()));
    let mut renderer = Renderer::new(plan, engines, &mut Silent).expect("engines");
    let image = renderer.frame(&mut Silent).expect("a frame");
    assert!(renderer.warnings().is_empty(), "{:?}", renderer.warnings());
    let glass = renderer.decisions().iter().filter(|decision| decision.what.ends_with("as glass"));
    let glass = glass.map(|decision| (decision.what.clone(), decision.why.clone())).collect();
    let rays =
        renderer.timeline().rows.iter().filter_map(|row| row.rays).fold(RayCounts::default(), |mut sum, rays| {
            sum += rays;
            sum
        });
    Rendered { image, glass, rays }
}

/// Number of pixels that look black.
fn black(image: &Image) -> usize {
    image.pixels.iter().filter(|[r, g, b, _]| r.max(*g).max(*b) < 0.02).count()
}

#[test]
fn glass_is_what_its_materials_say_and_no_pixel_is_black() {
    for (name, expected) in [
        ("balls", &[("water", "solid"), ("green glass", "solid"), ("clear glass", "solid"), ("diamond", "solid")][..]),
        ("filled", &[("tumbler", "solid"), ("water", "solid")]),
        ("panes", &[("red pane", "thin"), ("clear pane", "thin"), ("blue pane", "thin")]),
        ("Prism", &[("flint", "solid"), ("crown", "solid"), ("diamond", "solid")]),
        (
            "Spheres",
            &[
                ("nothing", "solid"),
                ("water", "solid"),
                ("crown glass", "solid"),
                ("diamond", "solid"),
                ("dye", "solid"),
                ("blue water", "solid"),
                ("green glass", "solid"),
                ("red diamond", "solid"),
            ],
        ),
        (
            "Shells",
            &[
                ("nothing", "solid"),
                ("water", "solid"),
                ("crown glass", "solid"),
                ("blue water", "solid"),
                ("green glass", "solid"),
                ("red diamond", "solid"),
            ],
        ),
        (
            "Caustics",
            &[
                ("water", "solid"),
                ("crown glass", "solid"),
                ("diamond", "solid"),
                ("blue water", "solid"),
                ("green glass", "solid"),
            ],
        ),
        (
            "MeshCaustics",
            &[
                ("amber glass", "solid"),
                ("flint", "solid"),
                ("pool water", "solid"),
                ("crown", "solid"),
                ("bottle glass", "solid"),
            ],
        ),
        (
            "Frosted",
            &[
                ("glass of roughness 0", "solid"),
                ("glass of roughness 0.15", "solid"),
                ("glass of roughness 0.3", "solid"),
                ("glass of roughness 0.5", "solid"),
                ("frosted pane", "thin"),
                ("frosted block", "solid"),
            ],
        ),
    ] {
        let Rendered { image, glass, rays } = render(name, Fidelity::Corrected, &[]);
        assert_eq!(glass.len(), expected.len(), "{glass:?}");
        for ((what, why), (material, shape)) in glass.iter().zip(expected) {
            assert!(what.contains(&format!("`{material}`")) && why.starts_with(shape), "{name}: {what}: {why}");
        }
        assert!(rays.refracted > 300 && rays.reflected > 100, "{name}: {rays:?}");
        // Lost rays are reflected endlessly between facets; most have a weight below a hundredth. The floor is dark
        // below the prism, which nearly touches it.
        let dark = if name == "Prism" { 4 } else { 0 };
        assert!(rays.lost * 100 < rays.refracted && black(&image) <= dark, "{name}: {} {rays:?}", black(&image));
        // Spectral colours are outside the gamut of sRGB, so components may be negative.
        let least = if matches!(name, "Prism" | "MeshCaustics") { -0.5 } else { 0.0 };
        assert!(image.pixels.iter().flatten().all(|value| value.is_finite() && *value >= least), "{name}");
    }
}

#[test]
fn who_asks_for_one_wavelength_sees_no_colours_in_a_prism() {
    let colorful = |set: &[&str]| {
        let Rendered { image, glass, rays } = render("Prism", Fidelity::Corrected, set);
        let apart = |[r, g, b, _]: &&[f32; 4]| (r - g).abs().max((g - b).abs()) > 0.2;
        assert!(glass.iter().all(|(_, why)| why.contains("disperses: index ")), "{glass:?}");
        (image.pixels.iter().filter(apart).count(), rays.refracted)
    };
    let ((many, split), (few, together)) = (colorful(&[]), colorful(&["pass2.wavelengths=1"]));
    assert!(many > few + 20 && split > 3 * together, "{many} {few} {split} {together}");
}

#[test]
fn thesis_fidelity_and_panes_know_nothing_of_bodies() {
    let Rendered { glass, rays, .. } = render("balls", Fidelity::Thesis, &[]);
    assert_eq!((glass.len(), rays.refracted), (0, 0), "the project names no pane");
    let named = ["pass2.glass=pane", "pass2.background=black", "pass2.shadow=report"];
    let Rendered { glass, rays, .. } = render("balls", Fidelity::Corrected, &named);
    assert_eq!((glass.len(), rays.refracted), (0, 0));
}

/// By the rule `opaque` shadows of glass are black, by `straight` they have the colour of the glass, and by `report` each surface lets 0.9
/// of the light pass.
#[test]
fn the_three_rules_of_shadows_differ_where_glass_is_in_the_way() {
    let image = |rule: &str| {
        let set = format!("pass2.shadow={rule}");
        render("balls", Fidelity::Corrected, &[&set]).image.pixels
    };
    let [opaque, straight, report] = ["opaque", "straight", "report"].map(image);
    let sum = |pixels: &[[f32; 4]]| -> f64 { pixels.iter().map(|pixel| f64::from(pixel[0])).sum() };
    assert!(sum(&opaque) + 10.0 < sum(&straight), "{} {}", sum(&opaque), sum(&straight));
    let differs = |(a, b): &(&[f32; 4], &[f32; 4])| a.iter().zip(*b).any(|(a, b)| (a - b).abs() > 0.02);
    let differing = straight.iter().zip(&report).filter(differs).count();
    assert!(differing > 20, "{differing} pixels tell the colour of a shadow");
}

/// Below spheres the floor is brighter than light without refraction can make it. The rest of the picture does not change.
#[test]
fn spheres_focus_light_where_the_project_asks_for_it() {
    let [caustic, straight] = ["caustic", "straight"].map(|rule| {
        let set = format!("pass2.shadow={rule}");
        render("Caustics", Fidelity::Corrected, &[&set, "pass2.samples=0", "pass2.sun=0"])
    });
    let brightest = |Rendered { image, .. }: &Rendered| image.pixels.iter().map(|[r, ..]| *r).fold(0.0, f32::max);
    assert!(brightest(&caustic) > 1.5 * brightest(&straight), "{} {}", brightest(&caustic), brightest(&straight));
    assert!(caustic.rays.shadow > straight.rays.shadow && caustic.rays.refracted == straight.rays.refracted);
    let same = caustic.image.pixels.iter().zip(&straight.image.pixels).filter(|(a, b)| (a[0] - b[0]).abs() < 0.05);
    let share = same.count() as f64 / caustic.image.pixels.len() as f64;
    assert!(share > 0.5 && share < 0.99, "{share}");
}

/// With photons, meshes cast a shadow and focus light. The timing row counts the photons, and the rest of the picture does not change.
#[test]
fn meshes_focus_light_where_the_project_asks_for_photons() {
    let few = ["pass2.samples=0", "pass2.sun=0", "pass2.wavelengths=4"];
    let [photons, straight] = ["200000", "0"].map(|count| {
        let set = format!("pass2.photons={count}");
        render("MeshCaustics", Fidelity::Corrected, &[&[set.as_str()], &few[..]].concat())
    });
    let brightest = |Rendered { image, .. }: &Rendered| image.pixels.iter().map(|[r, ..]| *r).fold(0.0, f32::max);
    assert!(brightest(&photons) > 1.2 * brightest(&straight), "{} {}", brightest(&photons), brightest(&straight));
    let counts = photons.rays.photons;
    assert!(counts.shot == 200_000 && counts.landed > 50_000 && counts.lost * 1000 < counts.shot, "{counts:?}");
    assert_eq!(straight.rays.photons, PhotonCounts::default());
    let same = photons.image.pixels.iter().zip(&straight.image.pixels).filter(|(a, b)| (a[0] - b[0]).abs() < 0.05);
    let share = same.count() as f64 / photons.image.pixels.len() as f64;
    assert!(share > 0.4 && share < 0.99, "{share}");
}
