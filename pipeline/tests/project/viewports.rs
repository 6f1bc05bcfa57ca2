//! Viewports of passes, and their clear colours.

use crate::support::{ASSETS, Files, LIBRARY, RASTER, SHADOWS, SHOW, with};
use curitiba_pipeline::backend::Rect;
use curitiba_pipeline::plan::{Plan, Settings, Work};
use glam::{Vec3, Vec4};

/// A viewport: the left half of the target, with a green clear colour.
const HALF: &str =
    r#"<viewport name="Half"><geometry x="0" y="0" width="0.5" height="1"/><bgcolor r="0" g="0.5" b="0"/></viewport>"#;

/// Plans a project whose camera has that viewport.
fn plan(library: &str, passes: &str) -> Plan {
    let assets = with(ASSETS, "<viewports>", &format!("<viewports>{HALF}"));
    let assets = with(&assets, "<camera name=\"Eye\">", "<camera name=\"Eye\"><viewport>Half</viewport>");
    let files = Files::new(format!(
        "<project name=\"p\" width=\"100\" height=\"80\">\n{assets}<pipelines><pipeline name=\"main\" \
         defaultCamera=\"Eye\">\n{passes}</pipeline></pipelines></project>\n"
    ));
    files.write("lib.mlib", library);
    Plan::new(files.load().expect("it loads"), Settings::default()).expect("the plan stands")
}

/// Viewport and clear colour of the first pass.
fn drawn(plan: &Plan) -> (Rect, Vec4) {
    match plan.passes[0].work {
        Work::Raster { viewport, clear_color, .. } => (viewport, clear_color),
        ref other => panic!("{other:?}"),
    }
}

const WHOLE: Rect = Rect { x: 0, y: 0, width: 64, height: 32 };

/// The library with a clear colour for its G-buffer.
fn cleared(clear: &str) -> String {
    let target = "<rendertarget name=\"gbuffer\">";
    with(LIBRARY, target, &format!("{target}{clear}"))
}

#[test]
fn a_render_target_is_filled_and_has_its_own_clear_colour() {
    let passes = [RASTER, SHADOWS, SHOW].concat();
    assert_eq!(drawn(&plan(LIBRARY, &passes)), (WHOLE, Vec4::W));
    let blue = Vec4::new(0.1, 0.2, 0.9, 1.0);
    for spelling in ["<clear r=\"0.1\" g=\"0.2\" b=\"0.9\"/>", "<CLEAR_VALUES r=0.1 g=0.2 b=0.9 a=1 />"] {
        assert_eq!(drawn(&plan(&cleared(spelling), &passes)), (WHOLE, blue), "{spelling}");
    }
    assert_eq!(drawn(&plan(&cleared("<clear/>"), &passes)), (WHOLE, Vec4::W));
}

#[test]
fn a_viewport_that_the_pass_names_is_where_it_draws() {
    let raster = with(RASTER, "<lights>", "<viewport>Half</viewport><lights>");
    let (viewport, color) =
        drawn(&plan(&cleared("<clear r=\"1\" g=\"0\" b=\"0\"/>"), &[raster.as_str(), SHADOWS, SHOW].concat()));
    assert_eq!((viewport, color), (Rect { width: 32, ..WHOLE }, Vec4::new(1.0, 0.0, 0.0, 1.0)));
}

#[test]
fn the_window_has_the_viewport_of_the_camera_and_its_colour() {
    let raster = with(RASTER, "<rendertarget name=\"gbuffer\" fromLibrary=\"Lib\" />", "");
    let (viewport, color) = drawn(&plan(LIBRARY, &raster));
    assert_eq!((viewport, color), (Rect { x: 0, y: 0, width: 50, height: 80 }, Vec4::new(0.0, 0.5, 0.0, 1.0)));
}

#[test]
fn rays_that_leave_the_scene_show_what_the_g_buffer_was_cleared_to() {
    let seen = |attributes: &str| {
        let rays = with(crate::support::FINAL, "name=\"final\"", &format!("name=\"final\" {attributes}"));
        let plan = plan(&cleared("<clear r=\"0.1\" g=\"0.2\" b=\"0.9\"/>"), &[RASTER, rays.as_str(), SHOW].concat());
        plan.passes.iter().find_map(|planned| match planned.work {
            Work::Rays { beyond, .. } => Some(beyond),
            _ => None,
        })
    };
    assert_eq!(seen(""), Some(Vec3::new(0.1, 0.2, 0.9)));
    assert_eq!(seen("background=\"black\""), Some(Vec3::ZERO));
}

#[test]
fn a_clear_colour_is_whole() {
    let files = Files::new(crate::support::project(&[RASTER, SHOW].concat()));
    files.write("lib.mlib", cleared("<clear r=\"1\" g=\"1\"/>"));
    let problems = files.load().expect_err("blue is missing");
    assert!(problems.to_string().contains("<clear> lacks `b`"), "{problems}");
}
