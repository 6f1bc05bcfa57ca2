//! Lights: their kinds, their falloff, and the choice of lights that illuminate a pass.

use crate::support::{ASSETS, Files, LIBRARY, RASTER, SHADOWS, SHOW, good, one_error, project, with};
use curitiba_pipeline::backend::Sun;
use curitiba_pipeline::plan::{Plan, PlanError, Settings};
use curitiba_pipeline::programs::Fidelity;
use curitiba_pipeline::project::{Falloff, Light, Spot};
use glam::{DVec3, Vec3};

const LAMP: &str = r#"<light name="Lamp"><position x="0" y="3" z="0" /></light>"#;

/// The light `Lamp` of the shared project, with this declaration.
fn lamp(declared: &str) -> Light {
    good(&with(&project(RASTER), LAMP, &format!("<light name=\"Lamp\" {declared}</light>"))).lights[1].clone()
}

#[test]
fn a_light_with_a_place_is_a_point_or_a_spot_light() {
    const PLACE: &str = r#"<position x="0" y="3" z="0" />"#;
    let plain = lamp(&format!(">{PLACE}"));
    assert_eq!((plain.kind(), plain.position, plain.falloff), ("point", Some(DVec3::Y * 3.0), Falloff::default()));
    let falling = lamp(&format!(
        r#">{PLACE}<CONSTANT_ATT value="0"/><LINEAR_ATT value="0.5"/><QUADRATIC_ATT value="2"/><RANGE value="9"/>"#
    ));
    assert_eq!(falling.falloff, Falloff { attenuation: [0.0, 0.5, 2.0], range: 9.0, spot: None });
    let short = lamp(&format!(r#">{PLACE}<quad_att value="2"/>"#));
    assert_eq!(short.falloff.attenuation, [1.0, 0.0, 2.0]);
    let down = r#"<SPOT_DIRECTION x="0" y="-2" z="0"/>"#;
    let spot = lamp(&format!(r#">{PLACE}{down}<SPOT_CUTOFF value="30"/><SPOT_EXPONENT value="4"/>"#));
    let cone = Spot { axis: Vec3::NEG_Y, cutoff: 30.0, inner: 30.0, exponent: 4.0 };
    assert_eq!((spot.kind(), spot.falloff.spot), ("spot", Some(cone)));
    let soft = lamp(&format!(r#">{PLACE}{down}<SPOT_CUTOFF value="30"/><SPOT_INNER value="20"/>"#));
    assert_eq!(soft.falloff.spot, Some(Spot { inner: 20.0, exponent: 0.0, ..cone }));
    let everywhere = lamp(&format!(r#">{PLACE}{down}<SPOT_CUTOFF value="180"/>"#));
    assert_eq!(everywhere.kind(), "point");
    // If a light has a position and a direction, its type determines the meaning of the direction.
    let both = format!(r#"{PLACE}<direction x="0" y="-1" z="0"/><SPOT_CUTOFF value="30"/>"#);
    assert_eq!(lamp(&format!(">{both}")).kind(), "directional");
    let spot = lamp(&format!("type=\"spot\">{both}"));
    assert_eq!((spot.direction, spot.falloff.spot.map(|spot| spot.axis)), (None, Some(Vec3::NEG_Y)));
    assert_eq!(lamp(&format!("type=\"point\">{both}")).kind(), "point");
}

#[test]
fn numbers_of_a_light_have_limits() {
    let wrong = |parts: &str, message: &str, help: &str| {
        let light = format!(r#"<light name="Lamp"><position x="0" y="3" z="0" />{parts}</light>"#);
        one_error(&with(&project(RASTER), LAMP, &light), message, help);
    };
    wrong(r#"<CONSTANT_ATT value="@-1"/>"#, "<CONSTANT_ATT> is -1", "numbers from 0");
    wrong(r#"<RANGE value="@0"/>"#, "<RANGE> is 0", "numbers above 0");
    wrong(r#"<SPOT_CUTOFF value="@181"/>"#, "<SPOT_CUTOFF> is 181", "numbers above 0 to 180");
    let light = r#"@<light name="Lamp"><position x="0" y="3" z="0" /><CONSTANT_ATT value="0"/></light>"#;
    let message = "<light> divides its light by 0 at every distance";
    one_error(&with(&project(RASTER), LAMP, light), message, "QUADRATIC_ATT");
}

/// Plans a project in which both passes have these lights.
fn plan(lights: &str, passes: &str, settings: Settings) -> Result<Plan, PlanError> {
    let passes = passes.replace("<light>Sun</light>", lights);
    let files = Files::new(format!(
        "<project name=\"p\" width=\"64\" height=\"32\">\n{ASSETS}<pipelines><pipeline name=\"main\" \
         defaultCamera=\"Eye\">\n{passes}</pipeline></pipelines></project>\n"
    ));
    files.write("lib.mlib", LIBRARY);
    Plan::new(files.load().expect("it loads"), settings)
}

#[test]
fn several_lights_shine_in_corrected_fidelity_and_the_first_direction_in_thesis_fidelity() {
    let passes = [RASTER, SHADOWS, SHOW].concat();
    let settings = |fidelity| Settings { fidelity, ..Settings::default() };
    let said = |plan: &Plan, what: &str| {
        plan.decisions.iter().find(|decision| decision.what == what).map(|found| (found.built, found.why.clone()))
    };
    let sun = Sun { direction: Vec3::NEG_Y, color: Vec3::ONE };
    let one = plan("<light>Sun</light>", &passes, Settings::default()).expect("planned");
    let shining = one.shining(&[0]);
    assert_eq!((shining.sun, shining.lights.len()), (Some(sun), 0), "one directional light stays what it was");
    assert!(one.asks_of_lights(&one.passes[1]).is_none() && said(&one, "lights of pass `shadows`").is_none());

    let both = "<light>Lamp</light><light>Sun</light>";
    let corrected = plan(both, &passes, Settings::default()).expect("planned");
    let shining = corrected.shining(&[1, 0]);
    assert_eq!(shining.sun, None);
    let places: Vec<_> = shining.lights.iter().map(|light| (light.place, light.direction)).collect();
    assert_eq!(places, [(Some(Vec3::Y * 3.0), Vec3::ZERO), (None, Vec3::NEG_Y)]);
    let words = "2 lights (`Lamp`, point; `Sun`, directional)";
    let (built, why) = said(&corrected, "lights of pass `shadows`").expect("said");
    assert!(built && why.contains(words) && why.contains("a shadow ray for each"), "{why}");
    assert!(said(&corrected, "lights of pass `gbuffer`").expect("said").1.contains("is added"));
    assert_eq!(corrected.asks_of_lights(&corrected.passes[1]).as_deref(), Some(words));

    let thesis = plan(both, &passes, settings(Fidelity::Thesis)).expect("planned");
    assert_eq!(thesis.shining(&[1, 0]).sun, Some(sun));
    let (built, why) = said(&thesis, "lights of pass `gbuffer`").expect("said");
    assert!(!built && why.contains("`Sun`: thesis fidelity has one"), "{why}");
    let error = plan("<light>Lamp</light>", &passes, settings(Fidelity::Thesis)).expect_err("no direction").to_string();
    assert!(error.contains("the light `Lamp`, point") && error.contains("--fidelity corrected"), "{error}");
}

#[test]
fn what_knows_one_directional_light_says_so() {
    const MAP: &str = r#"<pass class="effect" name="map"><scenes><scene>Main</scene></scenes>
<rendertarget name="rays" fromLibrary="Lib" /><lights><light>Sun</light></lights><program name="shadowMap"/>
<input><buffer var="pos_buffer" texture="Lib::pos" /><buffer var="norm_buffer" texture="Lib::norm" /></input></pass>
"#;
    let passes = [RASTER, MAP, SHOW].concat();
    let error = plan("<light>Lamp</light>", &passes, Settings::default()).expect_err("no direction").to_string();
    assert!(
        error.contains("raster effects know one directional light") && error.contains("deferredShadows"),
        "{error}"
    );
    assert!(plan("<light>Sun</light>", &passes, Settings::default()).is_ok());
    let soft = Settings { set: vec!["shadows.sun=1".to_owned()], ..Settings::default() };
    let passes = [RASTER, SHADOWS, SHOW].concat();
    let both = "<light>Sun</light><light>Lamp</light>";
    let planned = plan(both, &passes, soft.clone()).expect("the sun is a disc, and the lamp a point");
    assert!(planned.decisions.iter().any(|decision| decision.why.contains("16 to the disc of each with a direction")));
    let filtered = Settings { set: [&soft.set[..], &["shadows.filter=1".to_owned()]].concat(), ..soft.clone() };
    let error = plan(both, &passes, filtered.clone()).expect_err("the shares have colours").to_string();
    assert!(error.contains("filter=1 is of one directional light"), "{error}");
    assert!([soft, filtered].into_iter().all(|settings| plan("<light>Sun</light>", &passes, settings).is_ok()));
}
