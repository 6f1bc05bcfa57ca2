//! Every error of assets, libraries and pipelines, each with its place.

use crate::support::{Files, LIBRARY, RASTER, bad, errors, good, line, one_error, place, project, with};
use curitiba_pipeline::diagnostic::Severity;

/// Asserts an error in the shared project with one text replaced; `@` in `new` marks the place of the error.
#[track_caller]
fn wrong(old: &str, new: &str, message: &str, help: &str) {
    one_error(&with(&project(RASTER), old, new), message, help);
}

/// [`wrong`] for the library; `@` in `new` marks the place too.
#[track_caller]
fn wrong_library(old: &str, new: &str, message: &str) {
    let files = Files::new(project(RASTER));
    let marked = with(LIBRARY, old, new);
    files.write("lib.mlib", marked.replacen('@', "", 1));
    let problems = files.load().expect_err("it must not load");
    assert_eq!(errors(&problems), [format!("lib.mlib:{}: {message}", place(&marked, "@"))], "\n{problems}");
}

#[test]
fn numbers_must_be_numbers() {
    wrong("y=\"0\" z=\"5\"", "y=\"@102.55.0\" z=\"5\"", "`102.55.0` is not a number", "102.55");
    wrong("z=\"5\"", "z=\"@NaN\"", "`NaN` is not a finite number", "");
    wrong("z=\"5\"", "z=\"@inf\"", "`inf` is not a finite number", "");
    wrong("z=\"5\"", "z=\"@1e39\"", "`1e39` is not a finite number", "");
    wrong("z=\"5\"", "z=\"@\"", "`z` of <position> is empty", "");
    wrong("<position x=\"0\" y=\"0\" z=\"5\" />", "@<position x=\"0\" y=\"0\" />", "<position> lacks `z`", "x, y");
}

#[test]
fn components_of_colours_are_bounded() {
    let (name, old) = ("lib.mlib", "<diffuse r=\"1\" g=\"0\"");
    let files = Files::new(project(RASTER));
    let marked = with(LIBRARY, old, "<diffuse r=\"1\" g=\"@1.1e9\"");
    files.write(name, marked.replacen('@', "", 1));
    let problems = files.load().expect_err("it must not load");
    let message = "`1.1e9` is beyond what a component of a colour may be";
    assert_eq!(errors(&problems), [format!("{name}:{}: {message}", place(&marked, "@"))], "\n{problems}");
    assert!(problems.to_string().contains("valid: -1e9 to 1e9"), "\n{problems}");
    files.write(name, with(LIBRARY, old, "<diffuse r=\"1\" g=\"-1e9\""));
    assert!(files.load().is_ok());
}

#[test]
fn windows_must_have_both_sides_within_the_cap() {
    wrong(
        "<project name=\"p\">",
        "@<project name=\"p\" width=3>",
        "the window has only one of `width` and `height`",
        "both",
    );
    let message = "`65537` is not a number of pixels";
    wrong("<project name=\"p\">", "<project name=\"p\" width=@65537 height=1>", message, "1..=65536");
    let message = "`0.5` is not a number of pixels";
    wrong("<project name=\"p\">", "<project name=\"p\" width=@0.5 height=1>", message, "1..=65536");
    assert_eq!(good(&project(RASTER)).window, [1024, 1024]);
}

#[test]
fn viewports_must_have_a_size() {
    wrong("width=\"1\" height=\"1\"", "width=\"@0\" height=\"1\"", "width 0 is out of range", "above 0");
    wrong("width=\"1\" height=\"1\"", "width=\"1\" height=\"@-1\"", "height -1 is out of range", "above 0");
    wrong("width=\"1\" height=\"1\"", "width=\"1\" height=\"@65537\"", "height 65537 is out of range", "65536");
    wrong("<geometry x=\"0\"", "<geometry x=\"@-1\"", "x -1 is out of range", "from 0");
    let twice = "<geometry x=\"0\" y=\"0\" width=\"1\" height=\"1\" /><geometry/>";
    let old = "<geometry x=\"0\" y=\"0\" width=\"1\" height=\"1\" />";
    let text = with(&project(RASTER), old, twice);
    let problems = bad(&text);
    let at = place(&text, "<geometry/>");
    assert_eq!(errors(&problems), [format!("project.xml:{at}: <geometry> contradicts <geometry> of line 4")]);
}

#[test]
fn cameras_must_see_something() {
    let lens = |fov: &str, near: &str, far: &str| format!("<perspective fov={fov} near={near} far={far} /><view x");
    wrong("<view x", &lens("@180", "1", "2"), "a field of view of 180 degrees", "below 180");
    wrong("<view x", &lens("@0", "1", "2"), "a field of view of 0 degrees", "above 0");
    wrong("<view x", &lens("60", "@0", "2"), "a near distance of 0", "above 0");
    wrong("<view x", &lens("60", "2", "@2"), "the far distance 2 is not beyond the near one, 2", "above 2");
    wrong("<view x=\"0\" y=\"0\" z=\"-2\" />", "@<view x=0 y=0 z=0 />", "<view> has no direction: its length is 0", "");
    let up = "@<up x=0 y=0 z=3 /></camera>";
    wrong("</camera>", up, "the camera's up vector is parallel to its view", "");
    let here = "@<LOOK_AT_POINT x=0 y=0 z=5 />";
    wrong("<view x=\"0\" y=\"0\" z=\"-2\" />", here, "the camera looks at the point where it stands", "");
    wrong("</camera>", "@<LOOK_AT_POINT x=2 y=0 z=0 /></camera>", "<LOOK_AT_POINT> contradicts <view> of line 5", "");
    // Files that the engine writes contain both elements, and both agree.
    good(&with(&project(RASTER), "</camera>", "<LOOK_AT_POINT x=0 y=0 z=4 /></camera>"));
    let kind = "<projection TYPE=\"@ISO\" /></camera>";
    wrong("</camera>", kind, "`ISO` is not a projection", "perspective, ortho");
    let nothing = "@<projection TYPE=ORTHO LEFT=2 RIGHT=2 /></camera>";
    let message = "an orthographic view from 2 to 2 and from -1 to 1 shows nothing";
    wrong("</camera>", nothing, message, "LEFT below RIGHT");
    let fov = "<perspective fov=50 />@<FOV value=50 /></camera>";
    wrong("</camera>", fov, "<FOV> is given twice", "");
    wrong("</camera>", "<viewport>@Vew</viewport></camera>", "there is no viewport `Vew`", "did you mean `View`?");
}

#[test]
fn lights_must_be_somewhere() {
    wrong(
        "<direction x=\"0\" y=\"-3\" z=\"0\" />",
        "@<direction x=0 y=0 z=0 />",
        "<direction> has no direction: its length is 0",
        "",
    );
    let old = "<light name=\"Lamp\"><position x=\"0\" y=\"3\" z=\"0\" />";
    wrong(old, "@<light name=\"Lamp\">", "light `Lamp` has neither a direction nor a position", "<direction");
}

#[test]
fn scenes_must_name_files_that_other_machines_have() {
    let drive = "`C:\\models\\box.obj` is a path of one Windows machine";
    wrong("<file>box.obj</file>", "<file>@C:\\models\\box.obj</file>", drive, "relative");
    let share = "`\\\\server\\box.obj` is a path of one Windows machine";
    wrong("<file>box.obj</file>", "<file name=\"@\\\\server\\box.obj\"/>", share, "relative");
    wrong("<file>box.obj</file>", "@<file/>", "<file> names nothing", "<file>Name</file>");
    wrong("<scene name=\"Main\"><file>box.obj</file>", "@<scene name=\"Main\">", "the scene names no file", "<file");
    let shape = |inside: &str| format!("<geometry name=\"g\" {inside}/>");
    wrong("<file>box.obj</file>", &shape("type=\"@TEAPOD\""), "`TEAPOD` is not a primitive", "BOX");
    wrong("<file>box.obj</file>", "@<geometry name=\"g\"/>", "<geometry> lacks `type`", "name");
    let slices = "type=SPHERE slices=\"@2\"";
    wrong("<file>box.obj</file>", &shape(slices), "slices 2 is out of range", "3 to 4096");
    let order = "<TRANSFORM_ORDER value=\"@T_R\" /><file>box.obj</file>";
    wrong("<file>box.obj</file>", order, "`T_R` is not an order of transforms", "T_R_S");
    let far = "<TRANSLATE x=3e38 y=0 z=0 /><SCALE x=3e38 y=1 z=1 /><TRANSFORM_ORDER value=S_T_R /><file>box.obj</file>";
    wrong(
        "<scene name=\"Main\"><file>box.obj</file>",
        &format!("@<scene name=\"Main\">{far}"),
        "<scene> is placed beyond the range of numbers",
        "",
    );
    wrong("<file>box.obj</file>", "@<file name=\"a.obj\">b.obj</file>", "<file> names `a.obj` and `b.obj`", "");
}

#[test]
fn names_must_be_there_and_differ() {
    wrong("<light name=\"Lamp\">", "@<light>", "<light> lacks `name`", "name=");
    let twice = "<light name=\"@Sun\"><direction x=0 y=1 z=0 /></light></lights>";
    wrong("</lights>", twice, "a second light is named `Sun`", "project.xml:7:14");
    let second = "<pipeline name=\"@main\"><pass class=\"default\" name=\"a\"><scenes><scene>Main</scene></scenes><camera>Eye</camera></pass></pipeline></pipelines>";
    wrong("</pipelines>", second, "a second pipeline is named `main`", "project.xml:12:28");
    one_error(
        &project(&[RASTER, &with(RASTER, "name=\"gbuffer\"", "name=\"@gbuffer\"")].concat()),
        "a second pass of this pipeline is named `gbuffer`",
        "project.xml:13:29",
    );
}

#[test]
fn only_one_pipeline_is_the_default() {
    let text = project(RASTER).replace("defaultCamera", "default=\"true\" defaultCamera");
    let second = "<pipeline name=\"b\" default=\"@true\"><pass class=\"default\" name=\"a\"><scenes><scene>Main</scene></scenes><camera>Eye</camera></pass></pipeline></pipelines>";
    one_error(&with(&text, "</pipelines>", second), "a second pipeline is the default one", "project.xml:12:43");
    wrong("defaultCamera", "default=@maybe defaultCamera", "`maybe` is neither true nor false", "true, false");
}

#[test]
fn pipelines_must_have_passes() {
    one_error(&project("").replace("<pipeline ", "@<pipeline "), "the pipeline has no <pass>", "");
    let text = "@<project name=\"p\"><assets/></project>";
    one_error(text, "the project has no <pipeline>", "");
}

#[test]
fn libraries_must_be_there_once() {
    let missing = bad(with(&project(RASTER), "lib.mlib", "libs.mlib"));
    assert_eq!(errors(&missing).len(), 1, "names of a library that is missing are not reported: {missing}");
    assert!(errors(&missing)[0].starts_with("project.xml:10:31: cannot read "), "{missing}");

    let files = Files::new(with(&project(RASTER), "</materialLibs>", "<mlib filename=\"./lib.mlib\"/></materialLibs>"));
    let project_twice = files.load().unwrap_or_else(|problems| panic!("{problems}"));
    let warning = &project_twice.problems.0[0];
    assert_eq!(warning.severity, Severity::Warning);
    assert!(
        line(warning).starts_with("project.xml:10:59: ")
            && warning.message.ends_with("is listed twice: it is read once")
    );

    // As in the engine, a second file of the same name in the same folder extends the first library.
    let twice = |path: &str| {
        let named = format!("<mlib filename=\"{path}\"/></materialLibs>");
        files.write("project.xml", with(&project(RASTER), "</materialLibs>", &named));
        files.load()
    };
    files.write("other.mlib", "<mlib name=\"Lib\"><materials><material name=\"more\"/></materials></mlib>");
    let joined = twice("other.mlib").unwrap_or_else(|problems| panic!("{problems}"));
    assert!(joined.problems.to_string().contains("this adds to the library `Lib`"), "{}", joined.problems);
    files.write("there/other.mlib", "<mlib name=\"Lib\"/>");
    let problems = twice("there/other.mlib").expect_err("a name twice");
    assert_eq!(errors(&problems), ["other.mlib:1:13: a second material library is named `Lib`"]);
    assert!(problems.to_string().contains("the first is at "), "{problems}");
}

#[test]
fn render_targets_and_materials_must_be_sound() {
    let size = "<size width=\"64\" height=\"32\" />";
    wrong_library(size, "<size width=@65537 height=1 />", "`65537` is not a number of pixels");
    wrong_library(size, "<size width=1 height=@0 />", "`0` is not a number of pixels");
    wrong_library(
        "<rendertarget name=\"gbuffer\">\n\t\t\t<size width=\"64\" height=\"32\" />",
        "@<rendertarget name=\"gbuffer\">",
        "the render target has no size",
    );
    wrong_library("RGBA16F", "@RGB16F", "`RGB16F` is not a format");
    wrong_library("name=\"rays\"", "name=\"@gbuffer\"", "a second render target is named `gbuffer`");
    wrong_library("name=\"tiny\"", "name=\"@pos\"", "a second texture is named `pos`");
    wrong_library("<name>deferred</name>", "<name>@defered</name>", "there is no shader `defered`");
    wrong_library(
        "texture unit=\"0\" name=\"color\"",
        "texture unit=\"@-1\" name=\"color\"",
        "`-1` is not a texture unit",
    );
    wrong_library("<diffuse r=\"1\"", "<diffuse r=\"@x\"", "`x` is not a number");
    wrong_library("<material name=\"glass\">", "<material name=\"@plain\">", "a second material is named `plain`");
}

#[test]
fn a_library_may_hold_what_no_pass_uses_and_unknown_parts_are_warned_about() {
    let files = Files::new(project(RASTER));
    let states = "<states><state name=\"s\"><cull value=1 /></state></states><shadrs/>\n\t<shaders>";
    files.write("lib.mlib", with(LIBRARY, "<shaders>", states));
    let project = files.load().unwrap_or_else(|problems| panic!("{problems}"));
    let said: Vec<String> = project.problems.0.iter().map(line).collect();
    assert_eq!(said, ["lib.mlib:30:59: <shadrs> in <materiallib> is not known: it is ignored"]);
    let help = project.problems.0[0].help.as_deref().expect("help");
    assert!(help.ends_with("did you mean `shaders`?"), "{help}");
}

#[test]
fn unknown_elements_and_attributes_of_assets_are_warned_about() {
    let text = with(&project(RASTER), "<view ", "<vew/><view fast=1 ");
    let problems = good(&text).problems;
    let said: Vec<String> = problems.0.iter().map(line).collect();
    assert_eq!(
        said,
        [
            format!("project.xml:{}: <vew> in <camera> is not known: it is ignored", place(&text, "<vew")),
            format!("project.xml:{}: attribute `fast` of <view> is not known: it is ignored", place(&text, "fast")),
        ]
    );
}
