//! Real scenes from the folder that `CURITIBA_SCENES` names; the expected triangle counts come from other parsers.

use crate::scene_support::assert_references_are_valid;
use curitiba_pipeline::scene::{BuildOptions, LoadOptions, RenderScene, Scene, load};
use std::path::{Path, PathBuf};
use std::time::Instant;

fn scenes() -> Option<PathBuf> {
    let folder = std::env::var_os("CURITIBA_SCENES").map(PathBuf::from);
    if folder.is_none() {
        println!("skipped: CURITIBA_SCENES does not name a folder of real scenes");
    }
    folder
}

/// Loads and builds a scene, and prints the time taken.
fn check(files: &[PathBuf], expected: u64) -> (Scene, RenderScene) {
    let start = Instant::now();
    let scene = load(files, &LoadOptions::default(), &|_| {}).unwrap_or_else(|error| panic!("{error}"));
    let loaded = start.elapsed();
    assert_references_are_valid(&scene);
    let placed = crate::scene_support::triangles(&scene);
    let name = files[0].file_name().unwrap_or_default().to_string_lossy().into_owned();
    assert_eq!(placed, expected, "{name}");
    for group in scene.warnings.groups() {
        println!("  {group}");
    }
    let start = Instant::now();
    let (built, warnings) = RenderScene::build(scene.clone(), &BuildOptions::default()).unwrap();
    let left_out: u64 =
        warnings.groups().iter().filter(|group| group.remedy == "left out").map(|group| group.count).sum();
    assert_eq!(built.geometry.triangles.len() as u64 + left_out, expected, "{name}");
    for group in warnings.groups() {
        println!("  {group}");
    }
    let built_in = start.elapsed();
    println!("{name}: {expected} triangles, loaded in {loaded:.1?}, built in {built_in:.1?}");
    (scene, built)
}

fn folder_files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let mut files: Vec<_> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    files.retain(|file| file.extension().is_some_and(|found| found == extension));
    files.sort();
    files
}

#[test]
fn object_files_have_their_known_triangles() {
    let Some(scenes) = scenes() else { return };
    let expected = [
        ("cornell_box/CornellBox-Original.obj", 36),
        ("cornell_box/CornellBox-Mirror.obj", 36),
        ("cornell_box/CornellBox-Glossy.obj", 1_112),
        ("cornell_box/CornellBox-Sphere.obj", 2_188),
        ("cornell_box/CornellBox-Water.obj", 7_088),
        ("largo_de_camoes/mercado.obj", 22_419),
        ("largo_de_camoes/towers_bridge.obj", 5_280),
        ("largo_de_camoes/terrain_water_sky.obj", 12_967),
        ("meshes/stanford-bunny.obj", 69_451),
        ("meshes/armadillo.obj", 345_944),
    ];
    for (file, triangles) in expected {
        check(&[scenes.join(file)], triangles);
    }
    let (_, sponza) = check(&[scenes.join("crytek_sponza/sponza.obj")], 279_163);
    assert_eq!(sponza.materials.iter().filter(|material| material.alpha_cutoff.is_some()).count(), 3);
    let (largo, built) = check(&[scenes.join("largo_de_camoes/largo_camoes.obj")], 49_601);
    let glass = largo.materials.iter().find(|material| material.name == "Vidro").expect("the glass");
    assert!((glass.transmission - 0.41322).abs() < 1e-6);
    assert_eq!(scene_triangles(&largo, "Vidro"), 1_134);
    assert!(built.materials.iter().any(|material| material.alpha_cutoff == Some(0.5)), "railings are cut out");
}

fn scene_triangles(scene: &Scene, material: &str) -> u64 {
    let counted = curitiba_pipeline::scene::statistics(scene).materials;
    counted.iter().find(|found| found.name == material).map_or(0, |found| found.triangles)
}

#[test]
fn the_whole_square_loads_as_one_scene_with_shared_materials() {
    let Some(scenes) = scenes() else { return };
    let files = ["largo_camoes", "mercado", "towers_bridge", "terrain_water_sky"]
        .map(|name| scenes.join("largo_de_camoes").join(name).with_extension("obj"));
    let (scene, _) = check(&files, 49_601 + 22_419 + 5_280 + 12_967);
    assert_eq!(scene_triangles(&scene, "Vidro"), 1_134 + 80 + 288);
    assert_eq!(scene.materials.len(), 51);
}

#[test]
fn assets_have_their_known_triangles() {
    let Some(scenes) = scenes() else { return };
    for (file, triangles) in [
        ("meshes/stanford_dragon_348k.glb", 348_503),
        ("gltf/MetalRoughSpheresNoTextures/MetalRoughSpheresNoTextures.glb", 1_040_409),
        ("gltf/Box/Box.glb", 12),
        ("gltf/Box/Box.gltf", 12),
        ("gltf/BoxInterleaved/BoxInterleaved.glb", 12),
        ("gltf/BoxTextured/BoxTextured.gltf", 12),
        ("gltf/BoxVertexColors/BoxVertexColors.glb", 12),
        ("gltf/TriangleWithoutIndices/TriangleWithoutIndices.gltf", 1),
    ] {
        check(&[scenes.join(file)], triangles);
    }
    let mut seen = 0;
    for folder in std::fs::read_dir(scenes.join("gltf")).expect("the folder gltf").filter_map(Result::ok) {
        for extension in ["glb", "gltf"] {
            for file in folder_files(&folder.path(), extension) {
                let scene = load(std::slice::from_ref(&file), &LoadOptions::default(), &|_| {}).unwrap();
                let triangles = crate::scene_support::triangles(&scene);
                assert!(triangles > 0, "{}", file.display());
                check(&[file], triangles);
                seen += 1;
            }
        }
    }
    assert!(seen >= 18, "only {seen} assets were found");
}

#[test]
fn engine_files_parse_to_their_last_byte() {
    let Some(scenes) = scenes() else { return };
    let folder = scenes.join("engine_files");
    if !folder.is_dir() {
        println!("skipped: there is no folder engine_files");
        return;
    }
    let (old, _) = check(&[folder.join("terrainwithoutsky.cbo")], 4_718);
    assert_eq!((old.objects.len(), old.materials.len()), (4, 4));
    let (new, _) = check(&[folder.join("terrainwithsky.nbo")], 3_118);
    assert_eq!((new.objects.len(), new.materials.len(), new.meshes[0].positions.len()), (1, 3, 2_967));
}
