//! Parts of pictures: `--crop` and `--bands` render the pixels of the whole picture, bit for bit.

use curitiba::passes::cpu::CpuRays;
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::passes::raster::gpu::{AdapterChoice, WgpuRasteriser};
use curitiba::pipeline::backend::{Rasteriser, Rect};
use curitiba::pipeline::executor::{Engines, Renderer, Silent};
use curitiba::pipeline::image::{Image, read_image};
use curitiba::pipeline::plan::{Plan, PlanError, Settings};
use curitiba::pipeline::programs::Fidelity;
use curitiba::pipeline::project;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Sides that are no multiple of a tile's side.
const SIZE: [u32; 2] = [275, 211];

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects").join(format!("{name}.xml"))
}

fn plan(name: &str, fidelity: Fidelity, crop: Option<[u32; 4]>, bands: Option<u32>) -> Result<Plan, PlanError> {
    let set = match name {
        "SceneSSAO" | "SceneFinal" => vec!["pass2.samples=4".to_owned()],
        _ => Vec::new(),
    };
    let crop = crop.map(|[x, y, width, height]| Rect { x, y, width, height });
    let settings = Settings { size: Some(SIZE), fidelity, set, crop, bands, ..Settings::default() };
    Plan::new(project::load(&file(name)).expect("the project loads"), settings)
}

fn render(plan: Plan, raster: Box<dyn Rasteriser>) -> Image {
    let engines = Engines::new(raster, Box::new(CpuRays::new()));
    let mut renderer = Renderer::new(plan, engines, &mut Silent).expect("the scene loads");
    renderer.frame(&mut Silent).expect("the frame renders")
}

fn on_cpu(plan: Plan) -> Image {
    render(plan, Box::new(CpuRasteriser::new()))
}

/// The bits of the pixels in a rectangle of a picture.
fn bits(image: &Image, [x, y, width, height]: [u32; 4]) -> Vec<[u32; 4]> {
    let rows = image.pixels.chunks_exact(image.width as usize).skip(y as usize).take(height as usize);
    rows.flat_map(|row| &row[x as usize..(x + width) as usize]).map(|pixel| pixel.map(f32::to_bits)).collect()
}

fn all(image: &Image) -> Vec<[u32; 4]> {
    bits(image, [0, 0, image.width, image.height])
}

/// Rectangles inside a tile, over several tiles, of one pixel at the far corner, of one row, of one column, and from a tile's
/// corner.
const CROPS: [[u32; 4]; 6] =
    [[70, 81, 31, 17], [13, 40, 200, 101], [274, 210, 1, 1], [0, 133, 275, 1], [128, 0, 1, 211], [64, 128, 64, 64]];

fn parts_are_those_of_the_whole(name: &str) {
    for fidelity in [Fidelity::Corrected, Fidelity::Thesis] {
        let whole = on_cpu(plan(name, fidelity, None, None).expect("a plan"));
        assert_eq!([whole.width, whole.height], SIZE);
        // Not all pixels are alike, so the comparison is meaningful.
        let pixels = all(&whole);
        assert!(pixels.iter().filter(|pixel| **pixel != pixels[0]).count() > pixels.len() / 4, "{name} is a picture");
        for crop in CROPS {
            let part = plan(name, fidelity, Some(crop), None).expect("a plan");
            assert!(part.in_parts() || crop[2] * crop[3] > 10_000, "{name} renders a part of the picture");
            let part = on_cpu(part);
            assert_eq!([part.width, part.height], [crop[2], crop[3]]);
            assert!(all(&part) == bits(&whole, crop), "{name}, {fidelity:?}: {crop:?} differs from the whole");
        }
        // Control: a neighbouring rectangle has other bits.
        let beside = bits(&whole, [14, 40, 200, 101]);
        assert!(bits(&whole, CROPS[1]) != beside, "{name}: the comparison notices a shift");
        // The picture has four rows of tiles, so three bands cannot have equal heights.
        for (bands, made) in [(2, 2), (3, 2), (4, 4), (50, 4)] {
            let banded = plan(name, fidelity, None, Some(bands)).expect("a plan");
            assert_eq!(banded.parts.list.len(), made);
            assert!(all(&on_cpu(banded)) == pixels, "{name}, {fidelity:?}: {bands} bands differ from the whole");
        }
        let both = plan(name, fidelity, Some(CROPS[1]), Some(3)).expect("a plan");
        assert!(all(&on_cpu(both)) == bits(&whole, CROPS[1]), "{name}, {fidelity:?}: bands of a crop differ");
    }
}

macro_rules! programs {
    ($($test:ident: $name:literal;)*) => {
        $(#[test]
        fn $test() {
            parts_are_those_of_the_whole($name);
        })*
    };
}

programs! {
    parts_without_effects: "SceneNoEffects";
    parts_of_dummy: "SceneDummy";
    parts_of_shadows: "SceneShadows";
    parts_of_reflection: "SceneReflect";
    parts_of_refraction: "SceneRefract";
    parts_of_ambient_occlusion: "SceneSSAO";
    parts_of_all_effects: "SceneFinal";
}

#[test]
fn effects_that_look_at_the_picture_are_computed_for_all_of_it_and_refused_in_bands() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects/raster");
    let mut seen = 0;
    for entry in std::fs::read_dir(folder).expect("the folder").map(|entry| entry.expect("an entry").path()) {
        let Some(stem) = entry.file_stem().and_then(|stem| stem.to_str()).filter(|stem| stem.starts_with("Scene"))
        else {
            continue;
        };
        let name = format!("raster/{stem}");
        let whole = on_cpu(plan(&name, Fidelity::Corrected, None, None).expect("a plan"));
        let cut = plan(&name, Fidelity::Corrected, Some(CROPS[1]), None).expect("a plan");
        assert!(!cut.in_parts() && cut.decisions.iter().any(|decision| decision.why.contains("a part written")));
        assert!(all(&on_cpu(cut)) == bits(&whole, CROPS[1]), "{name}: the crop differs from the whole");
        let error = plan(&name, Fidelity::Corrected, None, Some(2)).expect_err("refused").to_string();
        assert!(error.contains("--bands is not possible") && error.contains("computes `"), "{error}");
        seen += 1;
    }
    assert!(seen >= 4, "{seen} projects of raster effects");
}

#[test]
fn pictures_that_are_drawn_in_blocks_are_the_same_whatever_part_is_rendered() {
    let blocked = |crop, bands| {
        let mut plan = plan("SceneFinal", Fidelity::Corrected, crop, bands).expect("a plan");
        plan.block = Some(128);
        on_cpu(plan)
    };
    let whole = blocked(None, None);
    for crop in CROPS {
        assert!(all(&blocked(Some(crop), None)) == bits(&whole, crop), "{crop:?} differs from the whole");
    }
    assert!(all(&blocked(None, Some(4))) == all(&whole), "bands differ from the whole");
    // A separate projection for each block rounds differently from a single one, so at edges another triangle may be visible.
    let at_once = on_cpu(plan("SceneFinal", Fidelity::Corrected, None, None).expect("a plan"));
    let far = |(a, b): (&[f32; 4], &[f32; 4])| a.iter().zip(b).any(|(a, b)| (a - b).abs() > 0.02);
    let differ = whole.pixels.iter().zip(&at_once.pixels).filter(|pair| far(*pair)).count();
    println!("{differ} of {} pixels differ from those drawn at once", whole.pixels.len());
    assert!(differ * 50 < whole.pixels.len(), "{differ} pixels differ");
}

#[test]
fn parts_drawn_by_wgpu_are_those_of_the_whole() {
    let make = || WgpuRasteriser::new(AdapterChoice::Any).map(|gpu| Box::new(gpu) as Box<dyn Rasteriser>);
    if let Err(error) = make() {
        assert!(std::env::var_os("CURITIBA_REQUIRE_GPU_TESTS").is_none(), "{error}");
        println!("skipped: {error}");
        return;
    }
    for name in ["SceneNoEffects", "SceneFinal"] {
        let drawn = |crop, bands| {
            render(plan(name, Fidelity::Corrected, crop, bands).expect("a plan"), make().expect("it was there"))
        };
        let whole = drawn(None, None);
        for crop in CROPS {
            assert!(all(&drawn(Some(crop), None)) == bits(&whole, crop), "{name}: {crop:?} differs from the whole");
        }
        assert!(all(&drawn(None, Some(3))) == all(&whole), "{name}: bands differ from the whole");
    }
}

fn curitiba(folder: &Path, arguments: &str) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_curitiba"));
    let output = command.current_dir(folder).args(arguments.split(' ')).output().expect("the program starts");
    let [printed, errors] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
    assert!(output.status.success(), "{arguments}:\n{errors}");
    printed
}

#[test]
fn the_command_line_writes_parts_as_png_and_exr() {
    let folder = tempfile::tempdir().expect("a folder");
    let project = file("SceneShadows").display().to_string();
    let sized =
        |more: &str| curitiba(folder.path(), &format!("render {project} --raster cpu --backend cpu --size {more}"));
    let run = |more: &str| sized(&format!("300x200 {more}"));
    let read = |name: &str| read_image(&folder.path().join(name)).expect("a picture").image;
    for extension in ["png", "exr"] {
        run(&format!("-o whole.{extension}"));
        let whole = read(&format!("whole.{extension}"));
        run(&format!("--crop 37,71,101x99 -o crop.{extension}"));
        assert!(all(&read(&format!("crop.{extension}"))) == bits(&whole, [37, 71, 101, 99]), "the crop's .{extension}");
        let printed = run(&format!("--bands 3 --frames 2 -o bands.{extension}"));
        assert!(printed.contains("2 bands of 300 x 128 pixels") && printed.contains("median of 2 frames"), "{printed}");
        assert!(all(&read(&format!("bands.{extension}"))) == all(&whole), "the .{extension} in bands");
        // Targets of 1100 x 1000 pixels take 70 MiB.
        sized(&format!("1100x1000 -o large.{extension}"));
        let printed = sized(&format!("1100x1000 --max-memory 64MiB -o small.{extension}"));
        assert!(printed.contains("more than half of --max-memory"), "{printed}");
        assert!(
            all(&read(&format!("small.{extension}"))) == all(&read(&format!("large.{extension}"))),
            "bands by memory"
        );
    }
    run("--crop 37,71,101x99 --show pos -o shown.exr");
    run("--show pos -o all.exr");
    assert!(all(&read("shown.pos.exr")) == bits(&read("all.pos.exr"), [37, 71, 101, 99]), "the shown channel");
    // The size is larger than the rasteriser's greatest viewport.
    let printed = curitiba(folder.path(), &format!("plan {project} --raster cpu --backend cpu --size 65536x1"));
    assert!(printed.contains("blocks of 4096 x 4096 pixels") && printed.contains("at most 16384"), "{printed}");
    sized("20000x70 -o wide.png");
    let wide = read("wide.png");
    assert_eq!([wide.width, wide.height], [20_000, 70]);
    sized("20000x70 --crop 16000,3,800x60 -o middle.png");
    assert!(all(&read("middle.png")) == bits(&wide, [16_000, 3, 800, 60]), "a crop of what is drawn in blocks");
}
