//! Both dialects of the format, and deviations from it that the reader tolerates.

use crate::support::{FINAL, Files, LIBRARY, RASTER, SHADOWS, SHOW, good, line, place, project, ssao, with};
use curitiba_pipeline::diagnostic::Severity;
use curitiba_pipeline::image::PixelFormat;
use curitiba_pipeline::programs::{RasterProgram, RayProgram};
use curitiba_pipeline::project::{ChannelRef, MaterialPattern, PassKind, Project, QuadSource, TextureMap};
use glam::{DVec3, Vec3, Vec4};

const OLD: &str = r#"<?xml version="1.0" ?>
<project name="old" width=640 height=480>
	<assets>
		<scenes><scene name="Main" param="SWAP_YZ | UNITIZE">
			<!--file>..\models\other.cbo</file-->
			<file>models\a.cbo</file>--
			<file>models\\b.obj</file>
		</scene></scenes>
		<viewports>
			<viewport name="Left" fixed="true">
				<geometry x="0.0" y="0.25" width=".5" height="1.0e0" /><bgcolor r="0.1" g="0.2" b="0.3" />
			</viewport>
			<viewport name="Wide" ratio="0.5"><geometry x="0" y="0" width="400" /></viewport>
		</viewports>
		<cameras>
			<camera name="Eye" type="perspective">
				<viewport>Left</viewport>
				<perspective fov=60.0 near="0.3"far="1000.0"/>
				<position x="7.5" y=-18.5 z='+38' /><view x="0" y="0" z="-2" /><up x="0" y="2" z="1" />
			</camera>
			<camera name="Other"><position x="0" y="0" z="0"/><view x="1" y="0" z="0"/></camera>
		</cameras>
		<lights><light name="Sun" type="directional">
			<position x="-52" y="77.0" z="-27.0" /><direction x="0" y="-4" z="0" />
			<color r="0.9" g="0.8" b="0.7" /><ambient r="0.5" g="0.5" b="0.5" />
		</light></lights>
		<materialLibs><mlib filename="lib.mlib"/></materialLibs>
	</assets>
	<pipelines>
		<pipeline name="first"><pass class="default" name="only">
			<scenes><scene>Main</scene></scenes><camera>Other</camera><viewport>Wide</viewport>
		</pass></pipeline>
		<pipeline name="second" default="true" defaultCamera="Eye">PASSES</pipeline>
	</pipelines>
</project>"#;

const TODAY: &str = r#"<?xml version="1.0" ?>
<project name="old" width="640" height="480">
	<assets>
		<scenes><scene name="Main" param="UNITIZE SWAP_YZ" type="OctreeByMat" filename="models/a.cbo">
			<file name="models/b.obj"/>
		</scene></scenes>
		<viewports>
			<viewport name="Left"><CLEAR_COLOR r="0.1" g="0.2" b="0.3" /><ORIGIN x=0.0 y=0.25 /><SIZE width=0.5 height=1 /></viewport>
			<viewport name="Wide"><SIZE width="400" height="200" /></viewport>
		</viewports>
		<cameras>
			<camera name="Eye">
				<viewport name="Left" />
				<TYPE value="PERSPECTIVE"/><FOV value = "60"/><NEAR value= ".3"/><FAR value= "1000"/>
				<POSITION x="7.5" y="-18.5" z="38" w="1" />
				<LOOK_AT_POINT x = 7.5 y = -18.5 z=0 /><UP x="0" y="2" z="1" />
			</camera>
			<camera name="Other"><POSITION x="0" y="0" z="0"/><VIEW x="1" y="0" z="0"/></camera>
		</cameras>
		<lights><light name="Sun">
			<POSITION x="-52" y="77.0" z="-27.0" /><DIRECTION x="0" y="-4" z="0" /><COLOR r="0.9" g="0.8" b="0.7" />
		</light></lights>
		<materialLibs><materialLib filename = "lib.mlib"/></materialLibs>
	</assets>
	<pipelines>
		<pipeline name="first"><pass class="default" name="only">
			<scenes><scene name="Main" /></scenes><camera name="Other" /><viewport name="Wide" />
		</pass></pipeline>
		<pipeline name="second" default="true" defaultCamera="Eye">PASSES</pipeline>
	</pipelines>
</project>"#;

fn check_assets(project: &Project) {
    assert_eq!((project.name.as_str(), project.window), ("old", [640, 480]));
    let scene = &project.scenes[0];
    let folder = project.path.parent().expect("a folder");
    let files: Vec<_> = scene.files.iter().map(|file| file.path.strip_prefix(folder).expect("inside")).collect();
    assert_eq!(files, ["models/a.cbo".as_ref(), "models/b.obj".as_ref() as &std::path::Path]);
    assert!(scene.swap_yz && scene.unitize);
    let [left, wide] = &project.viewports[..] else { panic!("two viewports") };
    assert_eq!((left.origin, left.size), ([0.0, 0.25], [0.5, 1.0]));
    assert_eq!(left.clear_color, Vec4::new(0.1, 0.2, 0.3, 1.0));
    assert_eq!((wide.origin, wide.size), ([0.0, 0.0], [400.0, 200.0]));
    assert_eq!(wide.clear_color, Vec4::new(0.0, 0.0, 0.0, 1.0));
    let eye = &project.cameras[0];
    assert_eq!(eye.position, DVec3::new(7.5, -18.5, 38.0));
    assert_eq!(eye.direction, Vec3::NEG_Z);
    assert!((eye.fov_y - std::f32::consts::FRAC_PI_3).abs() < 1e-6);
    assert_eq!((eye.near, eye.far, eye.viewport), (0.3, 1000.0, Some(0)));
    let other = &project.cameras[1];
    assert_eq!((other.near, other.far, other.up, other.viewport), (1.0, 10_000.0, Vec3::Y, None));
    assert_eq!(project.lights[0].direction, Some(Vec3::NEG_Y));
    assert_eq!(project.lights[0].color, Vec3::new(0.9, 0.8, 0.7));
    assert_eq!(project.default_pipeline, 1);
    assert_eq!(project.pipelines[1].camera, Some(0));
    let only = &project.pipelines[0].passes[0];
    assert_eq!((only.viewport, only.target), (Some(1), None));
    let PassKind::Raster(raster) = &only.kind else { panic!("a raster pass") };
    assert_eq!((raster.camera, &raster.lights[..], raster.program), (1, &[][..], RasterProgram::Deferred));
}

#[test]
fn the_dialect_of_2014_loads() {
    check_assets(&good(&with(OLD, "PASSES", RASTER)));
}

#[test]
fn todays_dialect_gives_the_same() {
    check_assets(&good(&with(TODAY, "PASSES", RASTER)));
}

#[test]
fn both_dialects_of_passes_are_resolved() {
    let text = with(OLD, "PASSES", &[RASTER, FINAL, SHOW].concat());
    let project = good(&text);
    let [raster, rays, quad] = &project.pipelines[1].passes[..] else { panic!("three passes") };
    assert_eq!((raster.target, rays.target, quad.target), (Some(0), Some(1), None));
    let PassKind::Ray(ray) = &rays.kind else { panic!("a ray pass") };
    assert_eq!((ray.program, &ray.lights[..], ray.camera), (RayProgram::Final, &[0][..], 0));
    let channel = |channel| Some(ChannelRef { target: 0, channel });
    assert_eq!((ray.color, ray.position, ray.normal), (channel(0), channel(1), channel(2)));
    let named = |name: &str| MaterialPattern::Named(name.to_owned());
    assert_eq!(ray.glass, [named("Vidro"), named("Window")]);
    assert_eq!(ray.shadow_glass, [named("Vidro")]);
    let PassKind::Quad(shown) = &quad.kind else { panic!("a quad pass") };
    assert_eq!(shown.source, QuadSource::Show(ChannelRef { target: 1, channel: 0 }));
    assert_eq!(project.targets[0].size, [64, 32]);
    let formats: Vec<_> = project.targets[0].channels.iter().map(|channel| channel.format).collect();
    assert_eq!(formats, [PixelFormat::Rgba32Float, PixelFormat::Rgba32Float, PixelFormat::Rgba16Float]);
    let at = place(&text, "<pass class=\"default\" name=\"gbuffer\"");
    assert!(raster.place.ends_with(&format!("project.xml:{at}")), "{}", raster.place);
}

#[test]
fn shadows_are_combined_by_a_material() {
    let combine = r#"<pass class="quad" name="show"><materialMaps>
        <map fromMaterial="__Quad" toLibrary="Lib" toMaterial="combine"/></materialMaps></pass>"#;
    let by_name = r#"<pass class="quad" name="show"><material name="combine" fromLibrary="Lib"/></pass>"#;
    for quad in [combine, by_name] {
        let project = good(&project(&[RASTER, SHADOWS, quad].concat()));
        let PassKind::Quad(shown) = &project.pipelines[0].passes[2].kind else { panic!("a quad pass") };
        let [color, factor] = [0, 1].map(|target| ChannelRef { target, channel: 0 });
        assert_eq!(shown.source, QuadSource::Combine { color, factor });
    }
}

#[test]
fn colours_are_injected_and_mapped_in_order() {
    let injection = r#"<injectionMaps><map toMaterial="Vidro">
        <color fromMaterial="glass" fromLibrary="Lib" ambient=true diffuse=true emission=false shininess=false /></map>"#;
    let maps = r#"<materialMaps><map fromMaterial="*" toLibrary="curitiba_material_lib" toMaterial="__Black" />
        <map fromMaterial="Wall" toLibrary="Lib" toMaterial="plain" /></materialMaps></pass>"#;
    let raster = with(&with(RASTER, "<injectionMaps>", injection), "</pass>", maps);
    let project = good(&project(&raster));
    let PassKind::Raster(raster) = &project.pipelines[0].passes[0].kind else { panic!("a raster pass") };
    let [black, plain, glass] = &raster.colors[..] else { panic!("three maps") };
    assert_eq!(
        (&black.to, black.diffuse, &black.texture),
        (&MaterialPattern::All, Some(Vec4::W), &TextureMap::Removed)
    );
    assert_eq!(plain.emission, Some(Vec4::new(0.0, 1.0, 0.0, 0.5)));
    assert_eq!(glass.to, MaterialPattern::Named("Vidro".to_owned()));
    assert_eq!((glass.diffuse, glass.emission), (Some(Vec4::new(1.0, 0.0, 1.0, 0.0)), None));
    assert_eq!(glass.texture, TextureMap::Kept);
}

#[test]
fn parameters_are_attributes_of_the_pass() {
    let project = good(&project(&[RASTER, &ssao("samples=49 radius='1.5' sampler=strata")].concat()));
    let PassKind::Ray(ray) = &project.pipelines[0].passes[1].kind else { panic!("a ray pass") };
    assert_eq!((ray.params.samples, ray.params.radius, ray.params.intensity), (49, 1.5, 1.6));
}

#[test]
fn white_space_inside_values_folds_and_wrapped_paths_join() {
    let files = Files::new(
        with(
            &with(&project(RASTER), "box.obj", "..\\3dsmodels\\\n    largo Camoes-\n   octree.cbo"),
            "filename=\"lib.mlib\"",
            "filename=\"mlibs\\\n      li\n   b.mlib\"",
        )
        .replace("fromMaterial=\"deferred\"", "fromMaterial=\" deferred\n\"")
        .replace("<scene>Main</scene>", "<scene>\n  Main\t</scene>"),
    );
    files.write("mlibs/lib.mlib", LIBRARY);
    let project = files.load().unwrap_or_else(|problems| panic!("{problems}"));
    let path = &project.scenes[0].files[0].path;
    assert!(path.ends_with("../3dsmodels/largo Camoes-octree.cbo"), "{}", path.display());
}

#[test]
fn another_case_of_a_name_or_file_is_found_with_a_note() {
    let files = Files::new(
        with(&project(RASTER), "defaultCamera=\"Eye\"", "defaultCamera=\"eYe\"")
            .replace("filename=\"lib.mlib\"", "filename=\"MLIBS/Lib.MLIB\""),
    );
    files.write("mlibs/lib.mlib", LIBRARY);
    let project = files.load().unwrap_or_else(|problems| panic!("{problems}"));
    let notes: Vec<String> = project.problems.0.iter().map(line).collect();
    assert_eq!(notes.len(), 2, "{notes:?}");
    assert!(notes[0].starts_with("project.xml:10:31: `MLIBS/Lib.MLIB` stands for "), "{}", notes[0]);
    assert_eq!(notes[1], "project.xml:12:49: `eYe` stands for the camera `Eye`");
    assert!(project.problems.0.iter().all(|problem| problem.severity == Severity::Note));
}

#[test]
fn stray_text_is_noted_and_entities_mean_their_characters() {
    let text = with(&project(RASTER), "<scene name=\"Main\">", "<scene name=\"Main\"> -- ")
        .replace("Main", "A &lt;&amp;&#x41;&#66; & <![CDATA[]]>")
        .replace("<![CDATA[]]>", "C");
    let project = good(&text);
    assert_eq!(project.scenes[0].name, "A <&AB & C");
    let notes: Vec<String> = project.problems.0.iter().map(line).collect();
    assert_eq!(notes, ["project.xml:3:51: stray text `--` is ignored"]);
}

#[test]
fn a_byte_order_mark_and_constants_are_read() {
    let text = with(&project(RASTER), "<assets>", "<assets><constants><constant name=\"D\" value=5 /></constants>");
    let text = format!("\u{feff}{}", with(&text, "z=\"5\"", "z=D"));
    assert_eq!(good(&text).cameras[0].position.z, 5.0);
}

#[test]
fn pipelines_and_cameras_are_found_by_name() {
    let project = good(&with(OLD, "PASSES", RASTER));
    assert_eq!(project.pipeline(None), Ok(1));
    assert_eq!(project.pipeline(Some("FIRST")), Ok(0));
    assert_eq!(project.camera("Other"), Ok(1));
    assert_eq!(
        project.camera("Othr"),
        Err("there is no camera `Othr`; valid: Eye, Other; did you mean `Other`?".to_owned())
    );
    assert!(project.pipeline(Some("secnd")).expect_err("unknown").contains("did you mean `second`?"));
}
