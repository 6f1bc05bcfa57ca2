//! Every error of passes, each with its place.

use crate::support::{FINAL, Files, RASTER, SHADOWS, SHOW, errors, good, line, one_error, project, ssao, with};
use curitiba_pipeline::diagnostic::Severity;

/// Asserts an error in a project of the G-buffer pass and `second`; `@` marks the place of the error.
#[track_caller]
fn wrong(second: &str, old: &str, new: &str, message: &str, help: &str) {
    one_error(&project(&[RASTER, &with(second, old, new)].concat()), message, help);
}

/// Asserts an error in a project with only the G-buffer pass.
#[track_caller]
fn wrong_raster(old: &str, new: &str, message: &str, help: &str) {
    one_error(&project(&with(RASTER, old, new)), message, help);
}

#[test]
fn classes_must_be_known() {
    wrong_raster(
        "class=\"default\"",
        "class=\"@mesh\"",
        "pass `gbuffer` is of class `mesh`",
        "compute, default, depthmap, depthmap2, effect, embree, geometryPI, optix, optixPrime, quad, rt",
    );
    wrong_raster(
        "class=\"default\"",
        "class=\"@defualt\"",
        "pass `gbuffer` is of class `defualt`",
        "did you mean `default`?",
    );
    wrong_raster("<pass class=\"default\"", "@<pass", "<pass> lacks `class`", "given: name");
    let text = project(&with(&with(RASTER, " name=\"gbuffer\">", ">"), "<pass", "@<pass"));
    one_error(&text, "<pass> lacks `name`", "given: class");
}

#[test]
fn references_must_resolve() {
    wrong_raster("<scene>Main", "<scene>@Man", "there is no scene `Man`", "did you mean `Main`?");
    wrong_raster("<light>Sun", "<light>@Son", "there is no light `Son`", "did you mean `Sun`?");
    wrong_raster("<lights>", "<camera>@Ey</camera><lights>", "there is no camera `Ey`", "did you mean `Eye`?");
    wrong_raster("<lights>", "<viewport name=\"@Vieww\"/><lights>", "there is no viewport `Vieww`", "`View`");
    wrong_raster(
        "name=\"gbuffer\" fromLibrary",
        "name=\"@gbufer\" fromLibrary",
        "there is no render target `gbufer`",
        "`gbuffer`",
    );
    wrong_raster(
        "fromLibrary=\"Lib\"",
        "fromLibrary=\"@Lob\"",
        "there is no material library `Lob`",
        "curitiba_material_lib",
    );
    wrong_raster(
        "fromMaterial=\"deferred\"",
        "fromMaterial=\"@defered\"",
        "there is no material `defered`",
        "`deferred`",
    );
    let text = project(&with(&with(RASTER, "<scene>Main</scene>", ""), "<pass", "@<pass"));
    one_error(&text, "pass `gbuffer` names no scene", "Main");
}

#[test]
fn a_pass_needs_a_camera() {
    let text = with(&project(RASTER), " defaultCamera=\"Eye\"", "").replace("<pass ", "@<pass ");
    one_error(&text, "pass `gbuffer` has no camera, nor has its pipeline", "Eye");
    let text = with(&project(RASTER), "defaultCamera=\"Eye\"", "defaultCamera=\"@Eyes\"");
    one_error(&text, "there is no camera `Eyes`", "did you mean `Eye`?");
}

#[test]
fn shaders_must_be_raster_programs() {
    if curitiba_pipeline::glsl::AVAILABLE {
        println!("skipped: with the feature `glsl` other shaders are the project's own");
        return;
    }
    let message = "pass `gbuffer`: shader `flat` is not a raster program";
    wrong_raster("fromMaterial=\"deferred\"", "fromMaterial=\"@flat\"", message, "deferredShading");
    wrong_raster(
        "fromMaterial=\"deferred\"",
        "fromMaterial=\"@plain\"",
        "pass `gbuffer`: material `plain` has no shader",
        "",
    );
    let map =
        "</injectionMaps><materialMaps><map fromMaterial=\"*\" toLibrary=\"Lib\" toMaterial=\"@flat\"/></materialMaps>";
    wrong_raster("</injectionMaps>", map, message, "deferredShading");
    let pattern = "toMaterial=\"@Gr*\"";
    wrong_raster("toMaterial=\"*\"", pattern, "`Gr*` is not a material's name", "*, or one whole name");
}

#[test]
fn depth_state_and_targets_without_colour_are_refused() {
    wrong_raster(
        "<lights>",
        "<depth test=@false /><lights>",
        "a raster pass without depth test is not supported",
        "true",
    );
    let message = "the render target `shadowMap` has no colour channel";
    wrong_raster("name=\"gbuffer\" fromLibrary", "name=\"@shadowMap\" fromLibrary", message, "");
}

#[test]
fn attributes_of_passes_must_be_known() {
    let message = "a pass of class `default` reads no parameter `samples`";
    wrong_raster("name=\"gbuffer\"", "name=\"gbuffer\" @samples=4", message, "ray and effect passes");
    wrong_raster(
        "name=\"gbuffer\"",
        "name=\"gbuffer\" @clas=4",
        "pass `gbuffer` has an unknown attribute `clas`",
        "`class`",
    );
    let axis = good(&project(&with(RASTER, "name=\"gbuffer\"", "name=\"gbuffer\" axis=5")));
    assert_eq!(line(&axis.problems.0[0]), "project.xml:13:38: coordinate axes are not drawn");
}

#[test]
fn ray_programs_must_exist() {
    let message = "pass `shadows`: there is no ray program `deferedShadow`";
    wrong(
        SHADOWS,
        "optix/deferredShadows.ptx\" proc=\"buffer",
        "@C:\\x\\deferedShadow.ptx\" proc=\"buffer",
        message,
        "did you mean `deferredShadows`?",
    );
    let message = "pass `shadows`: `deferredShadows` has no entry point `pinhole_camera`";
    wrong(SHADOWS, "proc=\"buffer_camera", "proc=\"@pinhole_camera", message, "buffer_camera");
    let entry = "<optixEntryPoint><optixProgram type=\"RayGen\" file=\"optix/deferredShadows.ptx\" proc=\"buffer_camera\"/></optixEntryPoint>";
    wrong(
        SHADOWS,
        entry,
        "@<optixEntryPoint></optixEntryPoint>",
        "ray pass `shadows` names no ray-generation program",
        "RayGen",
    );
}

#[test]
fn ray_passes_must_write_into_a_target() {
    let old = "<rendertarget name=\"rays\" fromLibrary=\"Lib\" />";
    let text = with(&with(SHADOWS, old, ""), "<pass", "@<pass");
    one_error(
        &project(&[RASTER, &text].concat()),
        "ray pass `shadows` has no render target to write into",
        "<rendertarget",
    );
}

#[test]
fn programs_of_the_default_material_must_be_those_that_are_called() {
    let message = "program `deferredShadows` has no Any_Hit `any_hit` for rays `Shadow`";
    wrong(SHADOWS, "proc=\"any_hit_shadow\"", "proc=\"@any_hit\"", message, "any_hit_shadow");
    let message = "program `deferredShadows` calls `any_hit_shadow`, which the default material lacks";
    let line =
        "<optixProgram type=\"Any_Hit\" ray=\"Shadow\" file=\"optix/deferredShadows.ptx\" proc=\"any_hit_shadow\"/>\n";
    let text = with(&with(SHADOWS, line, ""), "<optixDefaultMaterial>", "@<optixDefaultMaterial>");
    one_error(&project(&[RASTER, &text].concat()), message, "ray=\"Shadow\"");
    let message = "`optix/final.ptx` is not of the pass's program, `deferredShadows`";
    wrong(
        SHADOWS,
        "ray=\"Shadow\" file=\"optix/deferredShadows.ptx\"",
        "ray=\"Shadow\" file=\"@optix/final.ptx\"",
        message,
        "one file",
    );
    wrong(SHADOWS, "type=\"Any_Hit\"", "type=\"@Any_Hat\"", "`Any_Hat` is not a type of program", "`Any_Hit`");
    let text =
        with(SHADOWS, "<optixDefaultMaterial>", "@<optixDefaultMaterial>").replace("ray=\"Shadow\"", "ray=\"Phong\"");
    let message = "program `deferredShadows` calls `any_hit_shadow`, which the default material lacks";
    one_error(&project(&[RASTER, &text].concat()), message, "ray=\"Shadow\"");
}

#[test]
fn a_program_that_the_file_does_not_have_is_an_error_whether_it_is_called_or_not() {
    let entry = "proc=\"buffer_camera\"/></optixEntryPoint>";
    let exception = |proc: &str, file: &str| {
        format!("proc=\"buffer_camera\"/><optixProgram type=\"Exception\" {file} {proc}/></optixEntryPoint>")
    };
    let (file, proc) = ("file=\"optix/deferredShadows.ptx\"", "proc=\"exception\"");
    good(&project(&[RASTER, &with(SHADOWS, entry, &exception(proc, file))].concat()));
    let message = "program `deferredShadows` has no Exception `exeption`";
    wrong(SHADOWS, entry, &exception("proc=\"@exeption\"", file), message, "`exception`");
    let message = "`optix/final.ptx` is not of the pass's program, `deferredShadows`";
    wrong(SHADOWS, entry, &exception(proc, "file=\"@optix/final.ptx\""), message, "one file");

    let geometry = |kind: &str, proc: &str| {
        format!(
            "<optixGeometryProgram><optixProgram type=\"{kind}\" {file} proc=\"{proc}\"/></optixGeometryProgram><optixInput>"
        )
    };
    good(&project(&[RASTER, &with(SHADOWS, "<optixInput>", &geometry("Bounding_Box", "boundingbox"))].concat()));
    let message = "program `deferredShadows` has no Geometry_Intersection `spheres`";
    wrong(SHADOWS, "<optixInput>", &geometry("Geometry_Intersection", "@spheres"), message, "geometryintersection");
    let message = "program `deferredShadows` has no Geometry `geometryintersection`";
    wrong(SHADOWS, "<optixInput>", &geometry("Geometry", "@geometryintersection"), message, "Geometry_Intersection");

    let never = |proc: &str| {
        format!("<optixDefaultMaterial><optixProgram type=\"Closest_Hit\" ray=\"Phong\" {file} proc=\"{proc}\"/>")
    };
    let called = good(&project(&[RASTER, &with(SHADOWS, "<optixDefaultMaterial>", &never("closest_hit"))].concat()));
    let notes: Vec<String> = called.problems.0.iter().map(|problem| problem.message.clone()).collect();
    assert!(notes.iter().any(|note| note.contains("never calls Closest_Hit for rays `Phong`")), "{notes:?}");
    let message = "program `deferredShadows` has no Closest_Hit `closest_hut`";
    wrong(SHADOWS, "<optixDefaultMaterial>", &never("@closest_hut"), message, "did you mean `closest_hit`?");
}

#[test]
fn materials_that_rays_meet_run_programs_of_the_pass() {
    let message = "program `final` has no CLOSEST_HIT `closest_hit_metal` for rays `Phong`";
    wrong(
        FINAL,
        "proc=\"closest_hit_glass\"",
        "proc=\"@closest_hit_metal\"",
        message,
        "closest_hit, closest_hit_glass",
    );
    wrong(FINAL, "to=\"Window\"", "to=\"@lib:Win*\"", "`Win*` is not a material's name", "*, or one whole name");
    let text = with(FINAL, "<rtMap to=\"Window\">", "@<rtMap>");
    one_error(&project(&[RASTER, &text].concat()), "<rtMap> lacks `to`", "to=");
}

#[test]
fn a_material_among_glass_cannot_be_made_opaque_again() {
    let opaque = FINAL.replace("<rtMap to=\"Window\"><rtProgram type=\"Closest_Hit\" ray=\"Phong\" file=\"final.ptx\" proc=\"closest_hit_glass\"/>", "<rtMap to=\"Wall\"><rtProgram type=\"Closest_Hit\" ray=\"Phong\" file=\"final.ptx\" proc=\"@closest_hit\"/>");
    let all = with(&opaque, "curitiba_material_lib:Vidro", "*");
    let message = "an earlier map gives this material glass, not `closest_hit`";
    one_error(&project(&[RASTER, &all].concat()), message, "instead of *");
    good(&project(&[RASTER, &opaque.replace('@', "")].concat()));
}

#[test]
fn built_in_materials_are_listed() {
    let maps = "</injectionMaps><materialMaps><map fromMaterial=\"*\" toLibrary=\"__nau_material_lib\" toMaterial=\"@__Blck\"/></materialMaps>";
    wrong_raster("</injectionMaps>", maps, "there is no material `__Blck`", "did you mean `__Black`?");
}

#[test]
fn a_program_that_reads_what_the_project_does_not_hand_it_is_an_error() {
    let lacks = |what: &str| format!("program `final` reads {what}, which the pass does not hand it");
    let drop = |element: &str, container: &str| {
        let container = format!("<{container}>");
        project(&[RASTER, &with(&with(FINAL, element, ""), &container, &format!("@{container}"))].concat())
    };
    one_error(
        &drop("<attribute name=\"normal\"/>", "rtVertexAttributes"),
        &lacks("the vertex attribute `normal`"),
        "<attribute name=\"normal\"/>",
    );
    let count = "<valueof rtVar=\"texCount\" type=\"RENDERER\" context=\"CURRENT\" component=\"TEXTURE_COUNT\" />";
    one_error(&drop(count, "rtMaterialAttributes"), &lacks("the material attribute `texCount`"), "component=\"COUNT\"");
    let color = "<param name=\"lightColor\" type=\"LIGHT\" context=\"Sun\" component=\"COLOR\" />";
    one_error(&drop(color, "rtGlobalParams"), &lacks("the global attribute `lightColor`"), "context=\"LIGHT\"");
    let normal = "<buffer var=\"norm_buffer\" texture=\"Lib::norm\" />";
    one_error(&drop(normal, "rtInput"), &lacks("`norm_buffer`"), "var=\"norm_buffer\"");
}

#[test]
fn attributes_must_come_from_the_right_place() {
    wrong(
        FINAL,
        "component=\"DIRECTION\"",
        "component=\"@POSITION\"",
        "`lightDir` cannot be the POSITION of LIGHT",
        "the DIRECTION of LIGHT",
    );
    wrong(
        FINAL,
        "type=\"COLOR\" context=\"CURRENT\" component=\"DIFFUSE\"",
        "type=\"COLOR\" context=\"CURRENT\" component=\"@AMBIENT\"",
        "`diffuse` cannot be the AMBIENT of COLOR",
        "the DIFFUSE of COLOR",
    );
    wrong(FINAL, "id=0", "id=@1", "`lightDir` reads light or texture 1: only the first can be read", "id=\"0\"");
    wrong(FINAL, "context=\"Sun\"", "context=\"@Lamp\"", "`Lamp` is not the first light of the pass", "Sun");
    wrong(FINAL, "context=\"Sun\"", "context=\"@Sn\"", "there is no light `Sn`", "did you mean `Sun`?");
    let twice = "<attribute name=\"position\"/><attribute name=\"@position\"/>";
    wrong(FINAL, "<attribute name=\"position\"/>", twice, "`position` is handed over twice", "");
}

#[test]
fn lights_must_suit_the_program() {
    let message = "program `deferredShadows` reads a light, and pass `shadows` names none";
    let text = with(&with(SHADOWS, "<lights><light>Sun</light></lights>", ""), "<pass", "@<pass");
    one_error(&project(&[RASTER, &text].concat()), message, "Lamp, Sun");
}

#[test]
fn all_lights_of_a_pass_shine_and_one_that_is_named_twice_once() {
    let lit = |lights: &str| with(SHADOWS, "<light>Sun</light>", lights);
    let of = |project: &curitiba_pipeline::project::Project| {
        project.pipelines[0].passes.iter().map(|pass| pass.kind.lights().len()).collect::<Vec<_>>()
    };
    let two = good(&project(&[RASTER, &lit("<light>Sun</light><light>Lamp</light>")].concat()));
    assert_eq!((of(&two), two.problems.0.len()), (vec![1, 2], 0), "{}", two.problems);
    let twice = good(&project(&[RASTER, &lit("<light>Sun</light><light>Sun</light>")].concat()));
    assert_eq!(of(&twice), [1, 1]);
    assert_eq!(line(&twice.problems.0[0]), "project.xml:17:80: pass `shadows` names a light twice: it shines once");
    assert_eq!(twice.problems.0[0].severity, Severity::Warning);
}

#[test]
fn what_is_handed_over_and_never_read_is_noted() {
    let text = with(SHADOWS, "<optixInput>", "<optixInput><buffer var=\"color_buffer\" texture=\"Lib::color\" />")
        .replace("</optixVertexAttributes>", "<attribute name=\"normal\"/></optixVertexAttributes>");
    let problems = good(&project(&[RASTER, &text].concat())).problems;
    let said: Vec<String> = problems.0.iter().map(line).collect();
    assert_eq!(
        said,
        [
            "project.xml:22:69: program `deferredShadows` does not read the vertex attribute `normal`",
            "project.xml:26:26: program `deferredShadows` does not read `color_buffer`",
        ]
    );
}

#[test]
fn buffers_must_be_channels() {
    wrong(SHADOWS, "Lib::pos", "@Lib::poss", "there is no texture `poss`", "did you mean `pos`?");
    wrong(SHADOWS, "Lib::pos", "@poss", "there is no texture `poss`", "Lib::pos");
    wrong(SHADOWS, "Lib::pos", "@Lub::pos", "there is no material library `Lub`", "`Lib`");
    wrong(SHADOWS, "Lib::pos", "@Lib::far", "`far` is a depth buffer: only colour channels can be read", "color");
    wrong(
        SHADOWS,
        "Lib::pos",
        "@Lib::crate",
        "`crate` is not a channel of a render target: only those can be read",
        "",
    );
    let extra = "<optixInput><buffer var=\"@pos_bufer\" texture=\"Lib::pos\" />";
    wrong(SHADOWS, "<optixInput>", extra, "`pos_bufer` is not a buffer that a program reads", "`pos_buffer`");
    good(&project(&[RASTER, &with(SHADOWS, "Lib::pos", "pos")].concat()));
}

#[test]
fn parameters_must_be_read_and_valid() {
    let wrong = |attributes: &str, message: &str, help: &str| {
        one_error(&project(&[RASTER, &ssao(attributes)].concat()), message, help);
    };
    wrong("samples=@many", "`many` is not a value of `samples`", "0..=65536");
    wrong("@depth=3", "program `ssao` reads no parameter `depth`", "it reads samples, radius, intensity, sampler");
    wrong("@sampels=3", "pass `ao` has an unknown attribute `sampels`", "did you mean `samples`?");
    wrong("sampler=strata samples=@50", "50 strata are not N x N", "49 or 64");
}

#[test]
fn quads_must_show_one_thing() {
    let nothing = "@<pass class=\"quad\" name=\"show\"></pass>";
    one_error(&project(&[RASTER, SHADOWS, nothing].concat()), "quad pass `show` shows nothing", "<texture>");
    let both = "@<pass class=\"quad\" name=\"show\"><texture name=\"color\" fromLibrary=\"Lib\"/><material name=\"combine\" fromLibrary=\"Lib\"/></pass>";
    one_error(&project(&[RASTER, SHADOWS, both].concat()), "quad pass `show` shows several things", "one of");
    let quad = |material: &str| {
        let quad =
            format!("<pass class=\"quad\" name=\"show\"><material name=\"{material}\" fromLibrary=\"Lib\"/></pass>");
        project(&[RASTER, SHADOWS, &quad].concat())
    };
    if curitiba_pipeline::glsl::AVAILABLE {
        // The shader is taken for GLSL of the project, and its files are missing.
        let problems = Files::new(quad("flat")).load().expect_err("no files");
        let found = errors(&problems);
        assert!(found.len() == 1 && found[0].contains("flat.vert"), "{found:?}");
    } else {
        one_error(&quad("@flat"), "pass `show`: shader `flat` is not a quad program", "combine");
    }
    one_error(&quad("@plain"), "pass `show`: material `plain` has no shader", "");
    one_error(&quad("@half"), "pass `show`: material `half` binds no texture to unit 1", "unit=\"1\"");
    let other = "<pass class=\"quad\" name=\"show\"><materialMaps><map fromMaterial=\"Quad\" toLibrary=\"Lib\" toMaterial=\"@combine\"/></materialMaps></pass>";
    one_error(&project(&[RASTER, SHADOWS, other].concat()), "quad pass `show` maps no material of `__Quad`", "__Quad");
    let problems = Files::new(quad("pictures")).load().expect_err("not channels");
    assert_eq!(
        errors(&problems),
        [
            "lib.mlib:51:38: `crate` is not a channel of a render target: only those can be read",
            "lib.mlib:51:71: `far` is a depth buffer: only colour channels can be read",
        ]
    );
}

#[test]
fn passes_read_what_earlier_ones_wrote() {
    let swapped = with(SHADOWS, "Lib::pos", "@Lib::pos");
    let message = "pass `shadows` reads `Lib::pos`, which no earlier pass writes";
    one_error(&project(&[&swapped, RASTER].concat()), message, "the later pass `gbuffer` of 24:1 writes it");
    let never = SHOW.replace("\"result\"", "\"@tiny\"");
    one_error(
        &project(&[RASTER, &never].concat()),
        "pass `show` reads `Lib::tiny`, which no pass writes",
        "Lib::color",
    );
    let itself = with(
        &SHOW.replace("\"result\"", "\"@result\""),
        "<texture",
        "<renderTarget name=\"rays\" fromLibrary=\"Lib\"/><texture",
    );
    let message = "pass `show` reads `Lib::result`, a channel of the target that it writes";
    one_error(&project(&[RASTER, SHADOWS, &itself].concat()), message, "another render target");
}

#[test]
fn the_output_of_a_pass_that_is_not_run_is_not_missed() {
    let unknown = SHOW
        .replace("class=\"quad\"", "class=\"@mesh\"")
        .replace("<texture", "<renderTarget name=\"rays\" fromLibrary=\"Lib\"/><texture")
        .replace("\"show\"", "\"fill\"");
    one_error(&project(&[&unknown, SHOW].concat()), "pass `fill` is of class `mesh`", "quad");
}

#[test]
fn the_inputs_and_the_output_of_a_ray_pass_have_one_size() {
    let text = with(&with(SHADOWS, "name=\"rays\"", "name=\"small\""), "Lib::pos", "@Lib::pos");
    let message = "pass `shadows` reads `Lib::pos` of 64 x 32 and writes a target of 8 x 8";
    one_error(&project(&[RASTER, &text].concat()), message, "17:21");
}
