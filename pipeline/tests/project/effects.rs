//! Passes of class `effect`: raster effects in place of ray programs.

use crate::support::{Files, LIBRARY, RASTER, SHOW, good, one_error, project, ssao, with};
use curitiba_pipeline::backend::Attachments;
use curitiba_pipeline::image::PixelFormat;
use curitiba_pipeline::plan::{Plan, Settings, Work};
use curitiba_pipeline::project::{PassKind, Project};
use curitiba_pipeline::raster_effects::{EFFECT_PROGRAMS, EffectParams, EffectProgram};

const MAP: &str = r#"<pass class="effect" name="map" mapSize="512"><scenes><scene>Main</scene></scenes>
<rendertarget name="rays" fromLibrary="Lib" /><lights><light>Sun</light></lights>
<program name="shadowMap"/>
<input><buffer var="pos_buffer" texture="Lib::pos" /><buffer var="norm_buffer" texture="Lib::norm" /></input></pass>
"#;

const CUBE: &str = r#"<pass class="effect" name="cube"><scenes><scene>Main</scene></scenes>
<rendertarget name="rays" fromLibrary="Lib" /><lights><light>Sun</light></lights>
<program name="cubeRefraction"/><glass><material name="Vidro"/><material name="Window"/></glass>
<input><buffer var="pos_buffer" texture="Lib::pos" /><buffer var="norm_buffer" texture="Lib::norm" />
<buffer var="color_buffer" texture="Lib::color" /></input></pass>
"#;

fn plan(project: Project, settings: Settings) -> Plan {
    Plan::new(project, settings).expect("the plan stands")
}

/// The library with all channels in 32-bit floats.
fn wide() -> String {
    with(LIBRARY, "RGBA16F", "RGBA32F")
}

fn load_with(library: &str, passes: &str) -> Project {
    let files = Files::new(project(passes));
    files.write("lib.mlib", library);
    files.load().expect("it loads")
}

fn work<'p>(plan: &'p Plan, name: &str) -> &'p Work {
    &plan.passes.iter().find(|planned| plan.pass(planned).name == name).expect("it runs").work
}

#[test]
fn effect_passes_load_with_their_parameters_and_glass() {
    let loaded = good(&project(&[RASTER, MAP, SHOW].concat()));
    let PassKind::Effect(effect) = &loaded.pipelines[0].passes[1].kind else { panic!("an effect pass") };
    assert_eq!(effect.program, EffectProgram::ShadowMap);
    assert_eq!(effect.params, EffectParams { map_size: 512, ..EffectParams::default() });
    assert!(effect.position.is_some() && effect.normal.is_some() && effect.color.is_none() && effect.lights.len() == 1);
    let loaded = good(&project(&[RASTER, CUBE, SHOW].concat()));
    let PassKind::Effect(effect) = &loaded.pipelines[0].passes[1].kind else { panic!("an effect pass") };
    assert_eq!(effect.params, EffectParams::default());
    assert_eq!(effect.glass.len(), 2);
    assert!(effect.glass[1].matches("Window") && !effect.glass[1].matches("window"));
}

#[test]
fn every_program_of_the_table_can_be_named() {
    for info in EFFECT_PROGRAMS {
        let named = with(CUBE, "cubeRefraction", info.name);
        let loaded = good(&project(&[RASTER, &named, SHOW].concat()));
        let PassKind::Effect(effect) = &loaded.pipelines[0].passes[1].kind else { panic!("an effect pass") };
        assert_eq!(effect.program, info.program);
        assert_eq!(effect.color.is_some(), info.buffers.contains(&"color_buffer"));
    }
}

#[track_caller]
fn wrong(pass: &str, old: &str, new: &str, message: &str, help: &str) {
    one_error(&project(&[RASTER, &with(pass, old, new)].concat()), message, help);
}

#[test]
fn errors_of_effect_passes_say_where_and_what_would_be_valid() {
    let message = "pass `map`: there is no raster effect `shadowmop`";
    wrong(MAP, "name=\"shadowMap\"", "name=\"@shadowmop\"", message, "did you mean `shadowMap`?");
    wrong(MAP, "mapSize=", "@mapSiz=", "pass `map` has an unknown attribute `mapsiz`", "did you mean `mapsize`?");
    wrong(MAP, "\"512\"", "\"@5\"", "`5` is not a value of `mapsize`", "16..=16384");
    wrong(
        MAP,
        "mapSize=",
        "@radius=",
        "program `shadowMap` reads no parameter `radius`",
        "mapsize, cascades, pcf, bias",
    );
    let bare = with(MAP, "<program name=\"shadowMap\"/>\n", "");
    wrong(&bare, "<pass", "@<pass", "effect pass `map` names no <program name=\"…\"/>", "gtao");
    let dark = with(MAP, "<lights><light>Sun</light></lights>", "");
    wrong(&dark, "<pass", "@<pass", "program `shadowMap` reads a light, and pass `map` names none", "Sun");
    let blind = with(MAP, "<buffer var=\"norm_buffer\" texture=\"Lib::norm\" />", "");
    let message = "program `shadowMap` reads `norm_buffer`, which the pass does not hand it";
    wrong(&blind, "<input>", "@<input>", message, "in <input>");
    let walls = with(CUBE, "<glass><material name=\"Vidro\"/><material name=\"Window\"/></glass>", "");
    let message = "program `cubeRefraction` looks for glass, and the pass says of no material that it is";
    wrong(&walls, "<pass", "@<pass", message, "<glass>");
    let nowhere = with(MAP, "<rendertarget name=\"rays\" fromLibrary=\"Lib\" />", "");
    wrong(&nowhere, "<pass", "@<pass", "effect pass `map` has no render target to write into", "<rendertarget");
}

#[test]
fn what_only_an_effect_reads_stays_where_it_was_drawn() {
    let plan = plan(load_with(&wide(), &[RASTER, CUBE, SHOW].concat()), Settings::default());
    let Work::Raster { attachments, host, .. } = work(&plan, "gbuffer") else { panic!("a raster pass") };
    assert_eq!(*attachments, Attachments { color: true, position: true, normal: true, triangle: true });
    assert_eq!(*host, Attachments::default());
    assert!(matches!(work(&plan, "cube"), Work::Effect { resident: true, reads_triangle: true, .. }));
}

#[test]
fn narrow_formats_rays_and_inspection_need_the_g_buffer_in_host_memory() {
    // Rasterisers themselves can store normals as 16-bit floats, so the effect reads them in place.
    let half = plan(load_with(LIBRARY, &[RASTER, MAP, SHOW].concat()), Settings::default());
    assert!(matches!(work(&half, "map"), Work::Effect { resident: true, .. }));
    // Rasterisers cannot store normals as bytes, so the effect must read the rounded values.
    let bytes = LIBRARY.replace("name=\"norm\" internalFormat=\"RGBA16F\"", "name=\"norm\" internalFormat=\"RGBA8\"");
    assert_ne!(bytes, LIBRARY);
    let narrow = plan(load_with(&bytes, &[RASTER, MAP, SHOW].concat()), Settings::default());
    let Work::Raster { attachments, host, .. } = work(&narrow, "gbuffer") else { panic!("a raster pass") };
    assert_eq!(*attachments, Attachments { position: true, normal: true, ..Attachments::default() });
    assert_eq!(host, attachments);
    assert!(matches!(work(&narrow, "map"), Work::Effect { resident: false, reads_triangle: false, .. }));
    let shown = Settings { show: vec!["pos".to_owned()], ..Settings::default() };
    let shown = plan(load_with(&wide(), &[RASTER, MAP, SHOW].concat()), shown);
    let Work::Raster { host, .. } = work(&shown, "gbuffer") else { panic!("a raster pass") };
    assert_eq!(*host, Attachments { position: true, ..Attachments::default() });
    // Another raster pass in between, which runs because its target is shown.
    let other =
        with(&with(RASTER, "name=\"gbuffer\">", "name=\"other\">"), "name=\"gbuffer\" from", "name=\"small\" from");
    let settings = Settings { show: vec!["tiny".to_owned()], ..Settings::default() };
    let disturbed = plan(load_with(&wide(), &[RASTER, &other, MAP, SHOW].concat()), settings);
    assert!(matches!(work(&disturbed, "map"), Work::Effect { resident: false, .. }));
}

#[test]
fn an_effect_that_nothing_reads_does_not_run() {
    let occlusion = with(&ssao(""), "name=\"ao\"", "name=\"ao\" samples=\"1\"");
    let plan = plan(good(&project(&[RASTER, MAP, &occlusion, SHOW].concat())), Settings::default());
    let names: Vec<&str> = plan.passes.iter().map(|planned| plan.pass(planned).name.as_str()).collect();
    assert_eq!(names, ["gbuffer", "ao", "show"]);
}

#[test]
fn parameters_are_set_from_outside_and_checked() {
    let set = |assignment: &str| {
        let settings = Settings { set: vec![assignment.to_owned()], ..Settings::default() };
        Plan::new(good(&project(&[RASTER, MAP, SHOW].concat())), settings)
    };
    let planned = set("map.pcf=3").expect("valid");
    assert!(matches!(work(&planned, "map"), Work::Effect { params: EffectParams { pcf: 3, .. }, .. }));
    let message = set("map.samples=4").expect_err("no such parameter").to_string();
    assert!(message.contains("pass `map` runs `shadowMap`, which reads no `samples`"), "{message}");
    let message = set("map.pcf=9").expect_err("too many").to_string();
    assert!(message.contains("0..=8"), "{message}");
}

#[test]
fn formats_are_set_from_outside_and_checked() {
    let set = |assignments: &[&str]| {
        let settings =
            Settings { set: assignments.iter().map(|text| (*text).to_owned()).collect(), ..Settings::default() };
        Plan::new(good(&project(&[RASTER, MAP, SHOW].concat())), settings)
    };
    let formats = |plan: &Plan| -> Vec<PixelFormat> {
        let target = plan.pass(&plan.passes[0]).target.expect("a target");
        plan.project.targets[target].channels.iter().map(|channel| channel.format).collect()
    };
    use PixelFormat::{Rgba8Unorm, Rgba16Float, Rgba32Float};
    let plain = set(&[]).expect("valid");
    assert_eq!(formats(&plain), [Rgba32Float, Rgba32Float, Rgba16Float]);
    assert!(plain.warnings.is_empty());
    let changed = set(&["norm.format=RGBA32F", "Lib::color.format=rgba8", "map.pcf=3"]).expect("valid");
    assert_eq!(formats(&changed), [Rgba8Unorm, Rgba32Float, Rgba32Float]);
    assert!(matches!(work(&changed, "map"), Work::Effect { params: EffectParams { pcf: 3, .. }, .. }));
    assert!(changed.warnings.is_empty(), "normals and colours need no warning");
    // The user may ask for rounded positions; a warning results.
    let rounded = set(&["pos.format=RGBA16F"]).expect("valid");
    let [group] = rounded.warnings.groups() else { panic!("one warning") };
    assert!(group.to_string().contains("pass `gbuffer` writes `Lib::pos` as RGBA16F"), "{group}");
    let why = |plan: &Plan, what: &str| {
        plan.decisions.iter().find(|decision| decision.what.contains(what)).expect("decided").why.clone()
    };
    assert_eq!(why(&rounded, "Lib::pos"), "read later, in 16-bit floats");
    assert_eq!(why(&plain, "Lib::pos"), "read later");
    for (wrong, words) in [
        ("nrom.format=RGBA16F", "did you mean `norm`?"),
        ("norm.format=RGBA16", "did you mean `RGBA16F`?"),
        ("crate.format=RGBA8", "no pass of this pipeline writes a texture `crate`"),
        ("norm=RGBA16F", "TEXTURE.format=FORMAT"),
    ] {
        let message = set(&[wrong]).expect_err(wrong).to_string();
        assert!(message.contains(words), "{wrong}: {message}");
    }
}

#[test]
fn an_effect_sees_what_its_g_buffer_shows() {
    let assets = "<camera name=\"Eye\">";
    let two = |text: &str| {
        with(text, assets, "<camera name=\"Other\"><view x=\"1\" y=\"0\" z=\"0\" /></camera><camera name=\"Eye\">")
    };
    let text = two(&project(&[RASTER, &with(MAP, "<lights>", "<camera>Other</camera><lights>"), SHOW].concat()));
    let message = Plan::new(good(&text), Settings::default()).expect_err("two cameras").to_string();
    assert!(message.contains("pass `map` has another camera than pass `gbuffer`"), "{message}");
    // A camera given for all passes makes the plan valid.
    let settings = Settings { camera: Some("Eye".to_owned()), ..Settings::default() };
    assert!(Plan::new(good(&text), settings).is_ok());
}
