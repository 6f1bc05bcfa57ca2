use super::*;
use crate::camera_programs::CameraParams;
use crate::glass::{Background, CutoffColor, Dielectric, GlassRule, GlassShadow, PathLimits, Roulette};
use crate::raster_effects::{EFFECT_PROGRAMS, EffectParams};

#[test]
fn what_a_program_calls_is_in_its_file() {
    for info in RAY_PROGRAMS.iter().filter(|info| !info.starts_at_camera()) {
        assert!(procs_of_kind("rayGEN").is_some_and(|names| names.contains(&info.entry)), "{}", info.stem);
        for proc in info.procs {
            assert!(procs_of_kind(proc.kind).is_some_and(|names| names.contains(&proc.proc)), "{proc:?}");
        }
    }
    assert_eq!(procs_of_kind("Any_Hat"), None);
}

#[test]
fn every_parameter_is_settable_by_its_name() {
    let mut params = RayParams::default();
    for (name, value) in [
        ("samples", "49"),
        ("radius", "2"),
        ("intensity", "1"),
        ("index", "1.5"),
        ("depth", "3"),
        ("sampler", "strata"),
        ("fresnel", "schlick"),
        ("glass", "auto"),
        ("background", "blue"),
        ("shadow", "straight"),
        ("wavelengths", "24"),
        ("paths", "48"),
        ("error", "0.02"),
        ("photons", "1000"),
        ("photonradius", "0.5"),
        ("cutoff", "0.01"),
        ("cutoffcolor", "background"),
        ("roulette", "on"),
        ("reflections", "3"),
        ("refractions", "12"),
        ("sun", "0.53"),
        ("sunsamples", "32"),
        ("filter", "2"),
        ("texturelod", "zero"),
        ("lightwidth", "0.4"),
        ("lightdepth", "0.3"),
        ("radiance", "5"),
        ("ambient", "0.25"),
        ("gloss", "128"),
        ("aperture", "0.1"),
        ("focus", "3"),
        ("gamma", "2.2"),
    ] {
        params.set(name, value).expect("valid");
        assert_eq!(params.get(name), value);
    }
    let expected = RayParams {
        samples: 49,
        radius: 2.0,
        intensity: 1.0,
        index: 1.5,
        depth: 3,
        sampler: Sampler::Strata,
        fresnel: Fresnel::Schlick,
        glass: GlassRule::Auto,
        background: Background::Blue,
        shadow: GlassShadow::Straight,
        wavelengths: 24,
        paths: 48,
        error: 0.02,
        photons: 1000,
        photon_radius: 0.5,
        limits: PathLimits {
            cutoff: 0.01,
            cutoff_color: CutoffColor::Background,
            roulette: Roulette::On,
            reflections: 3,
            refractions: 12,
        },
        sun: 0.53,
        sun_samples: 32,
        filter: 2,
        texture_lod: TextureLod::Zero,
        first: 0,
        first_path: 0,
        first_sun: 0,
        photon_batch: 0,
        camera: CameraParams {
            light_width: 0.4,
            light_depth: 0.3,
            radiance: 5.0,
            ambient: 0.25,
            gloss: 128.0,
            aperture: 0.1,
            focus: 3.0,
            gamma: 2.2,
        },
    };
    assert_eq!(params, expected);
    assert_eq!(PARAMS.len(), 32, "this test sets every parameter");
}

#[test]
fn cones_are_asked_of_programs_that_read_textures_at_hits() {
    let zero = RayParams { texture_lod: TextureLod::Zero, ..RayParams::default() };
    for info in RAY_PROGRAMS {
        let reads = info.material_attributes.contains(&"texCount");
        let asked = info.program.asks_of_cones(&info.defaults());
        assert_eq!(asked, reads.then(|| "texturelod=cones".to_owned()), "{}", info.stem);
        assert_eq!(info.program.asks_of_cones(&zero), None);
    }
    // A raster effect has the parameter if its counterpart reads it.
    for info in EFFECT_PROGRAMS {
        assert_eq!(info.params.contains(&"texturelod"), info.counterpart.info().reads("texturelod"), "{}", info.name);
        let asked = |params: EffectParams| info.counterpart.asks_of_cones(&params.by_rays());
        assert_eq!(asked(EffectParams::default()).is_some(), info.params.contains(&"texturelod"), "{}", info.name);
        assert_eq!(asked(EffectParams { texture_lod: TextureLod::Zero, ..EffectParams::default() }), None);
    }
}

#[test]
fn glass_is_sampled_to_an_error_only_where_materials_say_what_glass_is() {
    let asked = RayParams { error: 0.01, ..RayParams::default() };
    let auto = RayParams { glass: GlassRule::Auto, ..asked };
    assert_eq!(RayProgram::Final.sampled_to(&auto), Some(0.01));
    assert_eq!([RayProgram::Final.sampled_to(&asked), RayProgram::Reflection.sampled_to(&auto)], [None, None]);
    assert_eq!([RayParams::default().get("error"), auto.get("error")], ["0", "0.01"]);
    assert_eq!(RayProgram::Final.sampled_to(&RayParams { error: 0.0, ..auto }), None);
    let clear = Dielectric::default();
    let stochastic = |params: &RayParams, glass| RayProgram::Refraction.has_stochastic_glass(params, &[clear, glass]);
    let flint = Dielectric { spread: 0.02, ..clear };
    assert!(!stochastic(&auto, clear) && stochastic(&auto, Dielectric { alpha: 0.1, ..clear }));
    assert!(stochastic(&auto, flint) && !stochastic(&RayParams { wavelengths: 1, ..auto }, flint));
    let limits = PathLimits { cutoff: 0.1, ..PathLimits::DEFAULT };
    assert!(!stochastic(&RayParams { limits, ..auto }, clear));
    assert!(stochastic(&RayParams { limits: PathLimits { roulette: Roulette::On, ..limits }, ..auto }, clear));
}

#[test]
fn photons_are_shot_only_where_materials_say_what_glass_is_and_shadows_ask_for_them() {
    let asked = RayParams { photons: 9, ..RayParams::default() };
    let caustic = RayParams { glass: GlassRule::Auto, shadow: GlassShadow::Caustic, ..asked };
    let of = |program: RayProgram, params: &RayParams| program.photons(params);
    assert_eq!([of(RayProgram::Final, &caustic), of(RayProgram::Refraction, &caustic)], [9, 0]);
    assert_eq!(of(RayProgram::Final, &RayParams { shadow: GlassShadow::Straight, ..caustic }), 0);
    assert_eq!(of(RayProgram::Final, &RayParams { glass: GlassRule::Pane, ..caustic }), 0);
    assert_eq!(RayParams::default().photons, 0);
    // The window offers photon parameters only where they have an effect.
    for (params, heeds) in [(asked, false), (RayParams { photons: 0, ..caustic }, true)] {
        let heeded = ["photons", "photonradius"].map(|name| RayProgram::Final.heeds(name, &params));
        assert_eq!(heeded, [heeds; 2]);
    }
    assert!(RayProgram::Final.heeds("samples", &asked) && !RayProgram::Refraction.heeds("samples", &asked));
}

#[test]
fn every_value_that_is_offered_is_taken_and_none_beyond() {
    for info in PARAMS {
        offers(info.values, |value| RayParams::default().set(info.name, value).is_ok());
    }
}

/// Checks that a parameter accepts the values in [`Values`] and rejects values just outside.
pub(crate) fn offers(values: Values, takes: impl Fn(&str) -> bool) {
    let both = |inside: [String; 2], outside: [String; 2]| {
        assert!(inside.iter().all(|value| takes(value)), "{inside:?}");
        assert!(outside.iter().all(|value| !takes(value)), "{outside:?}");
    };
    match values {
        Values::Integer(low, high) => both(
            [low, high].map(|value| value.to_string()),
            [i64::from(low) - 1, i64::from(high) + 1].map(|value| value.to_string()),
        ),
        Values::Number(low, high) => {
            both([low, high].map(|value| value.to_string()), [low - 0.01, high + 0.01].map(|value| value.to_string()))
        }
        Values::Positive => {
            both([f32::MIN_POSITIVE, f32::MAX].map(|value| value.to_string()), ["0".to_owned(), "inf".to_owned()]);
        }
        Values::Names(names) => assert!(names.iter().all(|name| takes(name)) && !takes("other"), "{names:?}"),
    }
}

#[test]
fn wrong_parameters_say_what_is_valid() {
    let mut params = RayParams::default();
    assert!(params.set("sampels", "4").unwrap_err().contains("did you mean `samples`?"));
    assert!(params.set("radius", "NaN").unwrap_err().contains("above 0"));
    assert!(params.set("fresnel", "Schlick").unwrap_err().contains("exact, schlick"));
    assert!(params.set("texturelod", "2").unwrap_err().contains("zero, cones"));
    assert!(params.set("depth", "17").unwrap_err().contains("0..=16"));
    assert!(["0", "257", "-1", "16.0"].iter().all(|count| params.set("wavelengths", count).is_err()));
    assert!(["0", "4097", "-1"].iter().all(|count| params.set("paths", count).is_err()));
    for error in ["1.1", "-0.1", "NaN", "inf", "off", ""] {
        assert!(params.set("error", error).is_err_and(|help| help.contains("0..=1")), "{error}");
    }
    assert!(["-0.1", "1.1", "NaN"].iter().all(|share| params.set("cutoff", share).is_err()));
    assert!(["129", "-1"].iter().all(|count| params.set("reflections", count).is_err()));
    assert!(["-0.1", "90.1", "NaN", "inf"].iter().all(|angle| params.set("sun", angle).is_err()));
    assert!(["0", "65537"].iter().all(|count| params.set("sunsamples", count).is_err()));
    assert!(["4", "-1", "1.5"].iter().all(|levels| params.set("filter", levels).is_err()));
    assert_eq!(params, RayParams::default());
}
