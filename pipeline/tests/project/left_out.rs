//! Parts of the engine's projects that have no effect here or cannot run. They are left out with a warning, and the rest renders.

use crate::support::{RASTER, SHADOWS, bad, errors, good, project, with};
use curitiba_pipeline::project::{MaterialPattern, PassKind, Project};

const MESH: &str = r#"<pass class="mesh" name="sums"></pass>"#;

/// The project with a second pipeline that has these attributes and passes.
fn two(attributes: &str, passes: &str) -> String {
    let second = format!("<pipeline name=\"other\" defaultCamera=\"Eye\" {attributes}>{passes}</pipeline></pipelines>");
    with(&project(RASTER), "</pipelines>", &second)
}

#[track_caller]
fn warns(project: &Project, what: &str) {
    let said = project.problems.to_string();
    assert!(said.contains("warning: ") && said.contains(what), "`{what}` is not in:\n{said}");
}

#[test]
fn a_pipeline_that_does_not_run_may_hold_what_is_refused() {
    let loaded = good(&two("", &[MESH, RASTER].concat()));
    warns(&loaded, "pipeline `other` cannot run: pass `sums` is of class `mesh`");
    assert_eq!(loaded.pipeline(None), Ok(0));
    let said = loaded.pipeline(Some("other")).expect_err("it cannot run");
    assert!(said.contains("pipeline `other` cannot run: ") && said.contains("project.xml:"), "{said}");
    assert_eq!(good(&two("", RASTER)).pipeline(Some("other")), Ok(1), "a whole one can be asked for");
    // A default pipeline that cannot run is an error.
    for text in [two("default=\"true\"", MESH), with(&two("", MESH), "<pipelines>", "<pipelines default=\"other\">")] {
        let found = errors(&bad(&text));
        assert!(found.len() == 1 && found[0].ends_with("pass `sums` is of class `mesh`"), "{found:?}");
    }
    let named = good(&with(&two("", RASTER), "<pipelines>", "<pipelines default=\"other\">"));
    assert_eq!(named.pipeline(None), Ok(1));
}

/// A fault outside the pipelines is an error, whichever pipeline runs.
#[test]
fn what_pipelines_share_is_not_excused() {
    let lens = "<perspective fov=\"200\" near=\"1\" far=\"2\" /><view x=";
    let text = with(&two("", MESH), "<view x=", lens);
    assert!(errors(&bad(&text)).iter().any(|error| error.contains("200 degrees")));
}

#[test]
fn passes_that_draw_nothing_are_left_out() {
    let profiler = r#"<pass class="profiler" name="times"><viewport name="View"/></pass>"#;
    let scripts = r#"<pass class="default" name="moves"><mode value="RUN_ONCE"/></pass>"#;
    let loaded = good(&project(&[profiler, RASTER, scripts].concat()));
    assert_eq!(loaded.pipelines[0].passes.len(), 1);
    warns(&loaded, "pass `times` is left out");
    warns(&loaded, "pass `moves` is left out: it only runs scripts");
    // A pass without any contents is a mistake.
    let empty = r#"<pass class="default" name="nothing"></pass>"#;
    assert!(errors(&bad(project(&[RASTER, empty].concat()))).iter().any(|error| error.contains("names no scene")));
}

/// A picture corresponds to the engine's second frame: the passes of the first two frames have run, in the order of the file.
#[test]
fn passes_of_every_mode_but_one_run() {
    let raster = |mode: &str| RASTER.replacen('>', &format!("><mode value=\"{mode}\"/>"), 1);
    for mode in ["RUN_ALWAYS", "RUN_ONCE", "SKIP_FIRST_FRAME", "RUN_EVEN", "run_odd"] {
        let loaded = good(&project(&raster(mode)));
        assert_eq!((loaded.pipelines[0].passes.len(), loaded.problems.0.len()), (1, 0), "{mode}: {}", loaded.problems);
    }
    let never = raster("DONT_RUN").replacen("name=\"", "name=\"never", 1);
    let loaded = good(&project(&[&never, RASTER].concat()));
    assert_eq!(loaded.pipelines[0].passes.len(), 1);
    warns(&loaded, "is left out: its mode is `DONT_RUN`");
    let said = bad(project(&raster("RUN_TWICE"))).to_string();
    assert!(said.contains("project.xml:") && said.contains("`RUN_TWICE`") && said.contains("RUN_ONCE"), "{said}");
}

#[test]
fn scripts_that_are_not_run_are_named() {
    let with_script = |script: &str| RASTER.replacen('>', &format!(">{script}"), 1);
    let cases = [
        (r#"<testScript file="a.lua" script="b"/>"#, "runs if the script `b` of `a.lua` says, which is not run"),
        (
            r#"<testScript file="a.lua" script="b" TEST_MODE="RUN_WHILE"/>"#,
            "runs as often as the script `b` of `a.lua` says, which is not run",
        ),
        (r#"<preScript file="a.lua" script="b"/>"#, "the script `b` of `a.lua` runs before pass `"),
        (r#"<postScript file="a.lua" script="b"/>"#, "the script `b` of `a.lua` runs after pass `"),
    ];
    for (script, what) in cases {
        let text = project(&with_script(script));
        // Builds that run scripts look for the file.
        if cfg!(feature = "glsl") {
            let said = bad(&text).to_string();
            assert!(said.contains("a.lua: ") && said.contains("project.xml:"), "{said}");
            continue;
        }
        let loaded = good(&text);
        warns(&loaded, what);
        assert_eq!((loaded.pipelines[0].passes.len(), loaded.problems.0.len()), (1, 1), "{}", loaded.problems);
        let [problem] = &loaded.problems.0[..] else { unreachable!() };
        let (source, range) = problem.place.as_ref().expect("a place");
        assert!(
            source.text[range.start..].starts_with(&script[..script.find(' ').expect("a space")]),
            "{}",
            loaded.problems
        );
    }
    let before = r#"<preScript file="a.lua" script="b"/>"#;
    warns(&good(&project(&[before, RASTER].concat())), "the script `b` of `a.lua` runs before the pipeline");
}

#[test]
fn a_camera_among_the_scenes_is_drawn_by_raster_passes_alone_and_another_name_is_an_error() {
    let loaded = good(&with(&project(RASTER), "<scene>Main</scene>", "<scene>Main</scene><scene>Eye</scene>"));
    assert!(loaded.problems.0.is_empty(), "{}", loaded.problems);
    let PassKind::Raster(raster) = &loaded.pipelines[0].passes[0].kind else { panic!("it draws") };
    assert_eq!((raster.scenes.len(), &raster.frusta[..]), (1, &[0][..]));
    let other_case = good(&with(&project(RASTER), "<scene>Main</scene>", "<scene>Main</scene><scene>eye</scene>"));
    assert!(other_case.problems.to_string().contains("`eye` stands for the camera `Eye`"), "{}", other_case.problems);
    let rays = SHADOWS.replacen("<scene>Main</scene>", "<scene>Main</scene><scene>Eye</scene>", 1);
    assert_ne!(rays, SHADOWS);
    warns(&good(&project(&[RASTER, &rays].concat())), "the lines of the camera `Eye` are not drawn");
    let text = with(&project(RASTER), "<scene>Main</scene>", "<scene>Main</scene><scene>Ear</scene>");
    assert!(errors(&bad(&text))[0].ends_with("there is no scene `Ear`"));
}

#[test]
fn scenes_of_lines_are_empty_and_those_of_triangles_need_a_file() {
    let scene = |primitive: &str| {
        let scene = format!("<scene name=\"Wires\"><buffers name=\"b\" primitive=\"{primitive}\"/></scene></scenes>");
        with(&project(RASTER), "</scenes>", &scene)
    };
    warns(&good(&scene("LINES")), "lines and points are not drawn");
    assert!(errors(&bad(scene("TRIANGLES"))).iter().any(|error| error.ends_with("the scene names no file")));
}

#[test]
fn the_engines_name_fits_triangles_without_a_material() {
    let named = |name: &str| MaterialPattern::Named(name.to_owned());
    assert!(
        named("DefaultOBJMaterial").matches("default") && named("DefaultOBJMaterial").matches("DefaultOBJMaterial")
    );
    assert!(!named("DefaultOBJMaterial").matches("brick") && !named("brick").matches("default"));
}

#[test]
fn scenes_are_drawn_a_whole_number_of_times() {
    // The last list of scenes in the file belongs to the pass.
    let times = |count: &str| {
        let text = project(RASTER);
        let at = text.rfind("<scenes>").expect("the pass's scenes");
        format!("{}<scenes instances=\"{count}\">{}", &text[..at], &text[at + "<scenes>".len()..])
    };
    let drawn = |count: &str| match &good(&times(count)).pipelines[0].passes[0].kind {
        PassKind::Raster(raster) => raster.instances,
        _ => panic!("a raster pass"),
    };
    assert_eq!((drawn("1"), drawn("30")), (1, 30));
    for wrong in ["0", "1.5", "-3", "16777218"] {
        assert!(errors(&bad(times(wrong)))[0].ends_with(&format!("draws its scenes {wrong} times")));
    }
    // Ray and effect passes cannot draw their scenes several times.
    let rays = [RASTER, &with(SHADOWS, "<scenes>", "<scenes instances=\"2\">")].concat();
    assert!(errors(&bad(project(&rays)))[0].contains("has its scenes many times"));
}

#[test]
fn a_ratio_says_how_high_a_viewport_is() {
    let view = |inside: &str| {
        let viewport = format!("<viewport name=\"Part\">{inside}</viewport></viewports>");
        with(&project(RASTER), "</viewports>", &viewport)
    };
    let loaded = good(&view("<SIZE width=\"0.25\" height=\"0\"/><RATIO value=\"2\"/>"));
    assert_eq!(loaded.viewports.last().expect("a viewport").size, [0.25, 0.5]);
    assert!(errors(&bad(view("<SIZE width=\"0.25\" height=\"0\"/>")))[0].contains("height 0 is out of range"));
}
