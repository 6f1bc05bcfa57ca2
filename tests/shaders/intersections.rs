//! Rays from storage buffers: a picture compared with that of a ray program, and errors with their places in the file.
//!
//! Pictures need a Vulkan, Metal or DirectX 12 driver (a software driver will do). Without a driver, the tests print
//! `skipped`, or fail with `CURITIBA_REQUIRE_GPU_TESTS=1`.

use crate::own_shaders::has_driver;
use curitiba::pipeline::executor::{Renderer, Silent};
use curitiba::pipeline::image::Image;
use curitiba::pipeline::plan::{Plan, Settings, Work};
use curitiba::{Choice, OpenError, RasterChoice};
use std::path::{Path, PathBuf};

const CHOICE: Choice = Choice { raster: RasterChoice::Wgpu, ..Choice::CPU };

fn shipped() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects/shaders/Rays.xml")
}

fn open(path: &Path, pipeline: &str) -> Result<Renderer, OpenError> {
    let settings = Settings { pipeline: Some(pipeline.to_owned()), ..Settings::default() };
    curitiba::open(path, settings, CHOICE, &mut Silent)
}

fn picture(pipeline: &str) -> (Image, u64) {
    let mut renderer = open(&shipped(), pipeline).unwrap_or_else(|error| panic!("{}", error.joined()));
    let picture = renderer.frame(&mut Silent).expect("it renders");
    let rays = renderer.timeline().rows.iter().filter_map(|row| row.rays);
    (picture, rays.map(|rays| rays.total()).sum())
}

/// Rays that a shader writes give the same shading as rays that the ray program starts itself, except where rays graze an edge: the shader
/// offsets its points from the surface by another length.
#[test]
fn the_picture_is_that_of_the_ray_program() {
    if !has_driver() {
        return;
    }
    let ((ours, traced), (theirs, by_program)) = (picture("buffer"), picture("program"));
    // The program does not trace points whose triangle faces away from the light.
    assert!(traced.abs_diff(by_program) * 1000 < traced, "{traced} rays, {by_program} by the program");
    let pixels = || ours.pixels.iter().zip(&theirs.pixels);
    let far = |(a, b): &(&[f32; 4], &[f32; 4])| a.iter().zip(*b).any(|(a, b)| (a - b).abs() > 1e-6);
    let (differ, all) = (pixels().filter(far).count(), ours.pixels.len());
    println!("{differ} of {all} pixels differ, {traced} rays");
    assert!(differ * 1000 < all, "{differ} of {all} pixels differ");
    // Control: without shadows, more than a twentieth of the pixels differ.
    let (unshadowed, _) = picture_of(&Edited::new("hit.triangle < 0 ? 1.0 : 0.5", "1.0").path());
    let shadowed = unshadowed.pixels.iter().zip(&theirs.pixels).filter(far).count();
    assert!(shadowed * 20 > all, "{shadowed} of {all} pixels are in the shadow");
}

fn picture_of(path: &Path) -> (Image, Renderer) {
    let mut renderer = open(path, "buffer").unwrap_or_else(|error| panic!("{}", error.joined()));
    (renderer.frame(&mut Silent).expect("it renders"), renderer)
}

/// The shipped project with a text of one of its files replaced.
struct Edited {
    folder: tempfile::TempDir,
}

impl Edited {
    fn new(text: &str, by: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let from = shipped().parent().expect("a folder").to_owned();
        std::fs::create_dir(folder.path().join("glsl")).expect("made");
        let scene = from.join("../3dsmodels/largoCamoes.cbo").canonicalize().expect("it is there");
        let mut replaced = 0;
        for name in ["Rays.xml", "Rays.mlib", "glsl/quad.vert", "glsl/fillRays.frag", "glsl/readHits.frag"] {
            let read = std::fs::read_to_string(from.join(name)).expect("read");
            replaced += read.matches(text).count();
            let read = read.replace(text, by).replace("../3dsmodels/largoCamoes.cbo", &scene.display().to_string());
            std::fs::write(folder.path().join(name), read).expect("written");
        }
        assert!(replaced > 0, "`{text}` is in the project");
        Self { folder }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("Rays.xml")
    }

    fn refused(&self) -> Option<String> {
        open(&self.path(), "buffer").err().map(|error| error.joined())
    }
}

/// Every possible mistake in a file is an error with its place and the valid values.
#[test]
fn what_is_wrong_is_said_with_its_place() {
    let (rays, hits) = (r#"<rays buffer="Rays::rays" queryType="ANY"/>"#, r#"<hits buffer="Rays::hits"/>"#);
    let two = "<field value=\"VEC4\"/><field value=\"VEC4\"/>";
    for (text, by, place, said) in [
        (rays, "", "Rays.xml:43:13", "pass `trace` names no buffer of rays"),
        (hits, "", "Rays.xml:43:13", "pass `trace` names no buffer of hits"),
        ("\"ANY\"", "\"SOME\"", "Rays.xml:45:", "queryType `SOME` is not known"),
        (" queryType=\"ANY\"", "", "Rays.xml:45:", "<rays> lacks `queryType`"),
        ("Rays::rays", "rays", "Rays.xml:45:", "valid: Library::rays"),
        ("Rays::rays", "Rays::ray", "Rays.xml:45:", "there is no buffer `Rays::ray`"),
        ("Rays::rays", "Rags::rays", "Rays.xml:45:", "Rags"),
        ("Rays::hits", "Rays::rays", "Rays.xml:45:", "a channel of the target that it writes"),
        (
            "<DIM x=\"SIDE\" y=\"SIDE\" z=\"1\"/>",
            "<SIZE value=\"8388616\"/>",
            "Rays.xml:45:",
            "is not full of rays of 32 bytes",
        ),
        (two, "<field value=\"VEC4\"/>", "Rays.xml:45:", "holds 131072 rays, and `hits` has room for 262144 hits"),
        (hits, &format!("{hits}<rayCount value=\"262145\"/>"), "Rays.xml:46:", "up to 262144"),
        (hits, &format!("{hits}<rayCount value=\"1.5\"/>"), "Rays.xml:46:", "`1.5` is out of range"),
        (hits, &format!("{hits}<rayCount buffer=\"Rays::rays\" offset=\"2\"/>"), "Rays.xml:46:", "a multiple of 4"),
        (hits, &format!("{hits}<rayCount/>"), "Rays.xml:46:", "<rayCount> lacks `buffer`"),
        (
            "<scene name=\"MainScene\"/>\n                <rays",
            "<rays",
            "Rays.xml:43:13",
            "pass `trace` names no scene",
        ),
        (
            "<material name=\"fillRays\" fromLibrary=\"Rays\"/>",
            "<texture name=\"color\" fromLibrary=\"Rays\"/>",
            "Rays.xml:45:",
            "reads `Rays::rays`, which no pass writes",
        ),
        (
            "<pass class=\"embree\" name=\"trace\">",
            "<pass class=\"embree\" name=\"trace\" samples=\"4\">",
            "Rays.xml:43:",
            "reads no parameter `samples`",
        ),
    ] {
        let refused = Edited::new(text, by).refused().unwrap_or_else(|| panic!("{text} by {by} is not refused"));
        assert!(refused.contains(said) && refused.contains(place), "{text} by {by}: {refused}");
    }
}

/// The number of rays is given in the file or in a buffer; further rays are not traced, and their hits stay 0.
#[test]
fn as_many_rays_are_traced_as_the_file_says() {
    if !has_driver() {
        return;
    }
    let hits = r#"<hits buffer="Rays::hits"/>"#;
    let rays = |by: &str| {
        let (picture, renderer) = picture_of(&Edited::new(hits, &format!("{hits}{by}")).path());
        let rows = &renderer.timeline().rows;
        (picture, rows.iter().filter_map(|row| row.rays).map(|rays| rays.buffer).sum::<u64>())
    };
    let ((_, all), (whole, none)) = (rays("<rayCount value=\"-1\"/>"), rays("<rayCount value=\"0\"/>"));
    assert!(all > 50_000 && none == 0, "{all}");
    // The upper half of the picture is the second half of the buffer.
    let (half, some) = rays("<rayCount value=\"131072\"/>");
    assert!(some > 0 && some < all);
    assert_eq!(half.pixels[..512 * 256], whole.pixels[..512 * 256]);
    assert_ne!(half.pixels[512 * 256..], whole.pixels[512 * 256..]);
    // The first number in the buffer of rays is a coordinate. Its bits as an integer are large or negative, so all rays are traced.
    let (_, counted) = rays("<rayCount buffer=\"Rays::rays\" offset=\"0\"/>");
    assert_eq!(counted, all);
}

#[test]
fn the_plan_says_what_is_traced_and_leaves_out_what_nothing_reads() {
    let plan = |path: &Path| {
        let project = curitiba::pipeline::project::load(path).unwrap_or_else(|problems| panic!("{problems:?}"));
        Plan::new(project, Settings::default()).unwrap_or_else(|error| panic!("{error}"))
    };
    let works = |plan: &Plan| -> Vec<bool> {
        plan.passes.iter().map(|planned| matches!(planned.work, Work::Intersection { .. })).collect()
    };
    let whole = plan(&shipped());
    assert_eq!(works(&whole), [false, false, true, false]);
    assert!(whole.target_bytes() > 512 * 512 * (32 + 16), "the buffers are in the estimate of the memory");
    // A quad that shows only the colour needs no hits, and so no rays.
    let unread = Edited::new(
        "<material name=\"readHits\" fromLibrary=\"Rays\"/>",
        "<texture name=\"color\" fromLibrary=\"Rays\"/>",
    );
    let unread = plan(&unread.path());
    assert_eq!(works(&unread), [false, false]);
    let said = unread.decisions.iter().find(|decision| decision.what == "pass `trace`").expect("it is said");
    assert!(!said.built && said.why == "nothing reads what it writes");
}

/// If the pass with the rays is switched off, the pass that reads their hits is refused.
#[test]
fn a_pass_that_is_switched_off_is_missed() {
    let settings = Settings { off: vec!["trace".to_owned()], ..Settings::default() };
    let project = curitiba::pipeline::project::load(&shipped()).unwrap_or_else(|problems| panic!("{problems:?}"));
    let refused = Plan::new(project, settings).expect_err("it is refused").to_string();
    assert!(refused.contains("pass `shade` reads `Rays::hits`"), "{refused}");
}

/// A ray with a number that is not finite hits nothing, and the frame goes on.
#[test]
fn rays_that_are_none_are_in_the_light() {
    if !has_driver() {
        return;
    }
    let (_, renderer) = picture_of(
        &Edited::new("ray.along = vec4(-light,", "ray.along = vec4(vec3(0.0) / (light.x - light.x),").path(),
    );
    let rays: u64 = renderer.timeline().rows.iter().filter_map(|row| row.rays).map(|rays| rays.buffer).sum();
    assert_eq!(rays, 0);
}

/// Older files give the kind of an attribute's owner as `context`, and the attribute's type as `type`.
#[test]
fn older_files_declare_attributes_by_context() {
    let older = Edited::new(r#"type="RENDERER" data="INT" value"#, r#"context="RENDERER" type="INT" value"#);
    assert!(curitiba::pipeline::project::load(&older.path()).is_ok());
    let unknown = Edited::new(r#"type="RENDERER" data="INT" value"#, r#"context="CAMERA" type="INT" value"#);
    assert!(
        unknown
            .refused()
            .is_some_and(|why| why.contains("the uniform `side` is the `side` of RENDERER, which is not known"))
    );
}

/// The program's output, without colours.
fn printed(arguments: &[&str]) -> String {
    let ran = std::process::Command::new(env!("CARGO_BIN_EXE_curitiba"))
        .args(arguments)
        .arg(shipped())
        .output()
        .expect("the program runs");
    [ran.stdout, ran.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat()
}

#[test]
fn check_and_plan_say_what_is_traced_and_what_traces_it() {
    if !has_driver() {
        return;
    }
    let common = ["--raster", "wgpu", "--backend"];
    let with = |command, rest: &[&str]| printed(&[&[command], &common[..], rest].concat());
    let plan = with("plan", &["cpu"]);
    assert!(
        plan.contains(
            "trace: traces up to 262144 rays of `Rays::rays`, which every surface stops, and writes the nearest hits into `Rays::hits`"
        ),
        "{plan}"
    );
    assert!(plan.contains("acceleration structure for pass `trace`: it traces the rays of a buffer"), "{plan}");
    let check = with("check", &["cpu"]);
    assert!(check.contains("ok, passes that run: 4"), "{check}");
    for command in ["check", "plan"] {
        let refused = with(command, &["wgpu"]);
        assert!(refused.contains("pass `trace`: wgpu cannot run the rays of a storage buffer"), "{refused}");
        let allowed = with(command, &["wgpu", "--fallback", "cpu"]);
        assert!(!allowed.contains("cannot run"), "the cpu takes over: {allowed}");
    }
}

/// Buffers start with zeros in every frame, so all frames are the same.
#[test]
fn frames_are_alike() {
    if !has_driver() {
        return;
    }
    let mut renderer = open(&shipped(), "buffer").unwrap_or_else(|error| panic!("{}", error.joined()));
    let first = renderer.frame(&mut Silent).expect("it renders");
    assert_eq!(renderer.frame(&mut Silent).expect("it renders").pixels, first.pixels);
    assert_eq!(renderer.update(&mut Silent).expect("it renders").pixels, first.pixels);
}
