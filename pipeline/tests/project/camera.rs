//! Choice of the program for passes whose rays start at the camera.

use crate::support::{Files, SHOW, bad, errors, good, one_error, place, project, with};
use curitiba_pipeline::camera_programs::SurfaceKind;
use curitiba_pipeline::diagnostic::{Problem, Severity};
use curitiba_pipeline::glass::Background;
use curitiba_pipeline::plan::{Plan, Settings};
use curitiba_pipeline::programs::RayProgram;
use curitiba_pipeline::project::{MaterialPattern, PassKind, Project, RayPass, ShaderTexture};

/// A pass that names its program.
const NAMED: &str = r#"<pass class="rt" name="rays" program="whitted" samples="4" gloss="64">
<scenes><scene name="Main"/></scenes><renderTarget name="rays" fromLibrary="Lib"/><lights><light name="Sun"/></lights>
<glass><material name="Vidro"/></glass><metal><material name="steel*"/></metal></pass>
"#;

/// A pass in the style of the tutorials of the engine's descendant. Its program names are the same whatever the pass computes.
fn tutorial(shadow: bool, attributes: &[&str], light: &str, handed: &str, maps: &str) -> String {
    let program = |ray: &str, names: &str| {
        let of = |kind: &str, prefix: &str| {
            format!(r#"<rtProgram type="{kind}" file="optix.ptx" proc="__{prefix}__{names}"/>"#)
        };
        let (hit, any, miss) = (of("CLOSEST_HIT", "closesthit"), of("ANY_HIT", "anyhit"), of("MISS", "miss"));
        format!(r#"<rayType name="{ray}">{any}{hit}{miss}</rayType>"#)
    };
    let attributes: String = attributes.iter().map(|name| format!(r#"<attribute name="{name}"/>"#)).collect();
    let shadows = if shadow { program("Shadow", "shadow") } else { String::new() };
    let radiance = program("Phong", "phong");
    format!(
        r#"<pass class="rt" name="rays"><scenes><scene name="Main"/></scenes>
<renderTarget name="rays" fromLibrary="Lib"/><lights><light name="{light}"/></lights>
<rtRayTypes><rayType name="Phong"/></rtRayTypes>
<rtVertexAttributes>{attributes}</rtVertexAttributes>
<rtEntryPoint><rayGen file="optix.ptx" proc="__raygen__renderFrame"/></rtEntryPoint>
<rtDefaultMaterial>{radiance}{shadows}</rtDefaultMaterial>
<rtMaterialMap>{maps}</rtMaterialMap>
<rtGlobalParams>{handed}</rtGlobalParams></pass>
"#
    )
}

fn map(to: &str, proc: &str) -> String {
    format!(
        r#"<rtMap to="{to}"><rayType name="Phong"><rtProgram type="CLOSEST_HIT" file="optix.ptx" proc="{proc}"/></rayType></rtMap>"#
    )
}

fn of_light(component: &str) -> String {
    format!(r#"<param name="light" type="LIGHT" context="CURRENT" id=0 component="{component}"/>"#)
}

fn of_pass(component: &str) -> String {
    format!(r#"<param name="p" type="PASS" context="CURRENT" component="{component}"/>"#)
}

/// A project with a pass, and with numbers that it declares for passes.
fn with_values(pass: &str, values: &[(&str, &str)]) -> String {
    let declared: String = values
        .iter()
        .map(|(name, value)| format!(r#"<attribute type="PASS" name="{name}" data="FLOAT" value="{value}"/>"#))
        .collect();
    with(&project(&[pass, SHOW].concat()), "<assets>", &format!("<assets><attributes>{declared}</attributes>"))
}

fn ray(project: &Project) -> &RayPass {
    match &project.pipelines[0].passes[0].kind {
        PassKind::Ray(ray) => ray,
        other => panic!("no ray pass: {other:?}"),
    }
}

const ALL: [&str; 3] = ["position", "normal", "texCoord0"];

#[test]
fn what_a_pass_is_handed_says_what_it_computes() {
    let (direction, place) = (of_light("DIRECTION"), of_light("POSITION"));
    let scaled = [place.clone(), of_pass("LIGHT_SCALE"), of_pass("GAMMA")].concat();
    let cases = [
        (tutorial(false, &["position"], "Sun", "", ""), RayProgram::Albedo, "alone, and no light"),
        (tutorial(false, &["position", "texCoord0"], "Sun", "", ""), RayProgram::Albedo, "texture coordinates alone"),
        (tutorial(false, &ALL, "Sun", &direction, ""), RayProgram::Lambert, "no program for shadow rays"),
        (tutorial(true, &ALL, "Sun", &direction, ""), RayProgram::Whitted, "programs for shadow rays"),
        (tutorial(true, &ALL, "Lamp", &place, ""), RayProgram::Whitted, "programs for shadow rays"),
        (
            tutorial(true, &ALL, "Lamp", &[place.as_str(), &of_pass("AO_RAYS")].concat(), ""),
            RayProgram::CameraOcclusion,
            "AO_RAYS",
        ),
        (tutorial(true, &ALL, "Lamp", &scaled, ""), RayProgram::PathTracing, "LIGHT_SCALE"),
    ];
    for (pass, program, why) in cases {
        let project = good(&project(&[pass.as_str(), SHOW].concat()));
        let found = ray(&project);
        let start = found.from_camera.as_ref().expect("it starts at the camera");
        assert_eq!(found.program, program);
        assert!(start.why.contains(why), "{}", start.why);
        assert_eq!(start.lamp, pass.contains("POSITION"), "{program:?}");
        // The plan contains the decision, and has no G-buffer pass.
        let plan = Plan::new(project, Settings::default()).expect("a plan");
        let what = format!("ray program `{}` for pass `rays`", program.info().stem);
        assert!(plan.decisions.iter().any(|decision| decision.what == what && decision.why.contains(why)));
        assert_eq!(plan.passes.len(), 2);
    }
}

#[test]
fn what_cannot_be_decided_is_an_error_that_lists_the_programs() {
    let texture = r#"<param name="tex" type="TEXTURE" context="Lib::crate" component="ID"/>"#;
    let no_light_for_shadows = tutorial(true, &ALL, "Sun", "", "");
    for pass in [tutorial(false, &["position"], "Sun", texture, ""), no_light_for_shadows] {
        let text = project(&[&with(&pass, "rayGen file=\"optix", "rayGen file=\"@optix"), SHOW].concat());
        let message =
            "pass `rays`: there is no ray program `optix`, and what the pass hands it does not say what it computes";
        one_error(
            &text,
            message,
            r#"program="albedo", program="lambert", program="whitted", program="cameraOcclusion""#,
        );
        // Naming the program on the pass resolves the ambiguity.
        let said = with(&text.replacen('@', "", 1), "name=\"rays\">", "name=\"rays\" program=\"albedo\">");
        assert_eq!(ray(&good(&said)).program, RayProgram::Albedo);
    }
    one_error(
        &project(&[&with(NAMED, "whitted", "@whited"), SHOW].concat()),
        "pass `rays`: no program whose rays start at the camera is `whited`",
        "did you mean `whitted`?",
    );
}

#[test]
fn names_of_programs_say_what_rays_do_at_materials() {
    let maps = [
        map("lamp", "__closesthit__light"),
        map("ball", "__closesthit__phong_glass"),
        map("steel", "__closesthit__phong_metal"),
        map("Grade*", "__closesthit__phong_alphaTrans"),
        map("plain", "__closesthit__phong"),
    ]
    .concat();
    let pass = tutorial(true, &ALL, "Lamp", &of_light("POSITION"), &maps);
    let text = project(&[pass.as_str(), SHOW].concat());
    let read = |text: &str| {
        let project = good(text);
        let start = ray(&project).from_camera.clone().expect("it starts at the camera");
        (start.surfaces, start.why)
    };
    let named = |name: &str| MaterialPattern::Named(name.to_owned());
    let expected = |glass| {
        vec![
            (named("lamp"), SurfaceKind::Light),
            (named("ball"), glass),
            (named("steel"), SurfaceKind::Metal),
            (MaterialPattern::Beginning("Grade".to_owned()), SurfaceKind::CutOut),
        ]
    };
    let (surfaces, why) = read(&text);
    assert_eq!(surfaces, expected(SurfaceKind::Glass));
    assert!(!why.contains("straight"), "{why}");
    // Two tutorials name glass in the same way. One refracts; the other, named after transparency, does not.
    let (surfaces, why) = read(&with(&text, "name=\"p\"", "name=\"Test - Transparency\""));
    assert_eq!(surfaces, expected(SurfaceKind::Clear));
    assert!(why.contains("straight through, for the project is named `Test - Transparency`"), "{why}");
    let (surfaces, _) = read(&with(&text, "name=\"p\"", "name=\"Transparency and refraction\""));
    assert_eq!(surfaces, expected(SurfaceKind::Glass));
    let unknown = with(&text, "__closesthit__phong_metal", "@__closesthit__velvet");
    one_error(&unknown, "no meaning is known of the program `__closesthit__velvet` of a material", "<metal><material");
    // A pattern matches the beginning of names.
    assert!(MaterialPattern::Beginning("Grade".to_owned()).matches("Grade_08"));
    assert!(!MaterialPattern::Beginning("Grade".to_owned()).matches("BarraGrades"));
}

#[test]
fn numbers_of_the_project_become_parameters() {
    let soft = [of_light("POSITION"), of_pass("SHADOW_RAYS"), of_pass("GLOSSINESS"), of_pass("GLOSSY_RAYS")].concat();
    let pass = tutorial(true, &ALL, "Lamp", &soft, "");
    let values = [("SHADOW_RAYS", "3"), ("GLOSSINESS", "128"), ("GLOSSY_RAYS", "2"), ("AO_RADIUS", "7")];
    let project_of = |pass: &str| good(&with_values(pass, &values));
    let project = project_of(&pass);
    let params = ray(&project).params;
    // Each of our rays samples one point of the light, so the number of camera rays is RAYS_PER_PIXEL² max(SHADOW_RAYS², GLOSSY_RAYS).
    assert_eq!((params.samples, params.camera.gloss, params.camera.ambient), (9, 128.0, 0.0));
    assert_eq!((params.camera.light_width, params.background), (0.4, Background::Blue));
    let several = with(&pass, "<scenes>", "<RAYS_PER_PIXEL value=\"2\"/><SHADOW_RAYS value=\"1\"/><scenes>");
    assert_eq!(ray(&project_of(&several)).params.samples, 8);
    // Numbers that the pass does not hand to its programs are ignored, and attributes of the pass take precedence.
    let named = with(&pass, "name=\"rays\">", "name=\"rays\" samples=\"5\" background=\"clear\">");
    let project = project_of(&named);
    assert_eq!((ray(&project).params.samples, ray(&project).params.background), (5, Background::Clear));
    assert_eq!(ray(&project).params.radius, 0.5);
    let one = with_values(&pass, &[("SHADOW_RAYS", "1")]);
    assert_eq!(ray(&good(&one)).params.samples, 0, "one ray, through the pixel's centre");
    let scaled = [of_light("POSITION"), of_pass("LIGHT_SCALE"), of_pass("GAMMA"), of_pass("MAX_DEPTH")].concat();
    let path = tutorial(true, &ALL, "Lamp", &scaled, "");
    let path = with_values(&path, &[("LIGHT_SCALE", "10"), ("GAMMA", "2.2"), ("MAX_DEPTH", "4")]);
    let project = good(&path);
    let params = ray(&project).params;
    assert!((params.camera.radiance - 50.0 * std::f32::consts::PI).abs() < 1e-4);
    assert_eq!((params.camera.gamma, params.depth, params.background), (2.2, 3, Background::Black));
}

#[test]
fn a_pass_that_names_its_program_is_read_and_what_it_lacks_is_said() {
    let project_of = good(&project(&[NAMED, SHOW].concat()));
    let found = ray(&project_of);
    let start = found.from_camera.as_ref().expect("it starts at the camera");
    assert_eq!((found.program, found.params.samples, found.params.camera.gloss), (RayProgram::Whitted, 4, 64.0));
    assert_eq!((found.params.index, found.params.background), (1.5, Background::Clear));
    assert_eq!((start.lamp, start.why.as_str(), start.surfaces.len()), (false, "", 2));
    let lamp = good(&project(&[&with(NAMED, "\"Sun\"", "\"Lamp\""), SHOW].concat()));
    assert!(ray(&lamp).from_camera.as_ref().is_some_and(|start| start.lamp));
    let dark = project(&[&with(NAMED, "<lights><light name=\"Sun\"/></lights>", ""), SHOW].concat());
    let problems = bad(&dark);
    let at = place(&dark, "<pass class=\"rt\"");
    assert_eq!(
        errors(&problems),
        [format!("project.xml:{at}: program `whitted` reads a light, and pass `rays` names none")]
    );
    one_error(
        &project(&[&with(NAMED, "gloss=", "@radius="), SHOW].concat()),
        "program `whitted` reads no parameter `radius`",
        "it reads samples, aperture, focus",
    );
    let handed = tutorial(true, &ALL, "@Lamp", &of_light("DIRECTION"), "");
    one_error(
        &project(&[handed.as_str(), SHOW].concat()),
        "program `whitted` needs a direction, which light `Lamp` lacks",
        "<direction>",
    );
    let ortho = with(
        &project(&[NAMED, SHOW].concat()),
        "<camera name=\"Eye\">",
        "<camera name=\"Eye\" type=\"ortho\"><ortho left=\"-1\" right=\"1\" bottom=\"-1\" top=\"1\" near=\"0.1\" far=\"9\"/>",
    );
    let error = Plan::new(good(&ortho), Settings::default()).expect_err("no perspective").to_string();
    assert!(error.contains("rays of pass `rays` start at camera `Eye`, which has no perspective"), "{error}");
}

#[test]
fn a_pass_without_a_camera_is_a_pattern_by_what_it_is_handed() {
    let pattern = |handed: &str| {
        tutorial(false, &["position"], "Sun", handed, "").replace("<lights><light name=\"Sun\"/></lights>", "")
    };
    let no_camera = |passes: &str| with(&project(passes), " defaultCamera=\"Eye\"", "");
    let texture = r#"<param name="tex" type="TEXTURE" context="Lib::crate" component="ID"/>"#;
    let color = r#"<param name="color" type="RENDERER" context="CURRENT" component="color"/>"#;
    let what = "pass `rays` has no camera: `optix.ptx` makes its picture by itself, and device code is not run";
    let refused = |handed: &str, help: &str| {
        let marked = with(&pattern(handed), "<rayGen file=\"", "<rayGen file=\"@");
        one_error(&no_camera(&[&marked, SHOW].concat()), what, help);
    };
    for handed in [&of_pass("LEVEL"), color, &[texture, texture].concat(), &of_light("DIRECTION")] {
        refused(handed, "a <camera>");
    }
    for (handed, said, textures) in [
        ("", "it shows stripes, since it is handed nothing", Vec::new()),
        (&[texture, color].concat(), "it shows the texture `Lib::crate`, which it is handed", vec!["crate.jpg"]),
    ] {
        if !curitiba_pipeline::glsl::AVAILABLE {
            refused(handed, "cargo build --features glsl");
            continue;
        }
        let files = Files::new(no_camera(&[&pattern(handed), SHOW].concat()));
        files.write("crate.jpg", "read when it is drawn");
        let project = files.load().expect("it loads");
        let warned = |problem: &Problem| problem.severity == Severity::Warning && problem.message.ends_with(said);
        assert!(project.problems.0.iter().any(warned), "{}", project.problems);
        let PassKind::Quad(quad) = &project.pipelines[0].passes[0].kind else { panic!("no quad") };
        let shader = quad.shader.as_ref().expect("a shader of ours");
        assert!(shader.is_pattern());
        let expected = textures.into_iter().map(|name| ShaderTexture::File(files.path(name)));
        assert_eq!(shader.textures, expected.collect::<Vec<_>>());
    }
    let own = with(&pattern(""), "<renderTarget", "<camera name=\"Eye\"/><renderTarget");
    assert!(matches!(good(&no_camera(&[&own, SHOW].concat())).pipelines[0].passes[0].kind, PassKind::Ray(_)));
    let named = with(
        &pattern(""),
        "<pass class=\"rt\" name=\"rays\">",
        "@<pass class=\"rt\" name=\"rays\" program=\"albedo\">",
    );
    one_error(&no_camera(&[&named, SHOW].concat()), "pass `rays` has no camera, nor has its pipeline", "Eye");
}

#[test]
fn a_light_that_is_a_line_sends_out_nothing_and_the_plan_says_so() {
    let says_so = |light: &str, sides: &str| {
        let attributes = format!("program=\"{}\" {sides}", RayProgram::PathTracing.info().stem);
        let pass = with(NAMED, "program=\"whitted\" samples=\"4\" gloss=\"64\"", &attributes);
        let pass = with(&pass, "\"Sun\"", light);
        let plan = Plan::new(good(&project(&[pass.as_str(), SHOW].concat())), Settings::default()).expect("a plan");
        plan.decisions.iter().any(|decision| decision.what == "light of pass `rays`" && decision.why.contains("a line"))
    };
    for sides in ["lightwidth=\"2\"", "lightdepth=\"0.5\""] {
        assert!(says_so("\"Lamp\"", sides) && !says_so("\"Sun\"", sides), "{sides}");
    }
    for sides in ["", "lightwidth=\"2\" lightdepth=\"0.5\""] {
        assert!(!says_so("\"Lamp\"", sides), "{sides}");
    }
}
