//! Real projects, if available: the environment variable `CURITIBA_PROJECTS` names a folder with `OptixProjects/*.xml` and the
//! libraries that they use.

use curitiba_pipeline::camera_programs::SurfaceKind;
use curitiba_pipeline::programs::RayProgram;
use curitiba_pipeline::project::{PassKind, load};
use std::path::PathBuf;

#[test]
fn the_seven_projects_of_2014_load_unchanged() {
    let Some(folder) = std::env::var_os("CURITIBA_PROJECTS").map(PathBuf::from) else {
        println!("skipped: CURITIBA_PROJECTS names no folder");
        return;
    };
    for name in ["NoEffects", "Dummy", "Shadows", "Reflect", "Refract", "SSAO", "Final"] {
        let path = folder.join(format!("OptixProjects/Scene{name}.xml"));
        let project = load(&path).unwrap_or_else(|problems| panic!("{name} does not load:\n{problems}"));
        let passes = project.pipelines[0].passes.len();
        assert_eq!(passes, if name == "NoEffects" { 1 } else { 3 }, "{name}");
    }
}

/// `CURITIBA_TUTORIALS` names a checkout of the engine's current descendant.
#[test]
fn the_ray_tutorials_mean_what_they_hand_over() {
    let Some(folder) = std::env::var_os("CURITIBA_TUTORIALS").map(PathBuf::from) else {
        println!("skipped: CURITIBA_TUTORIALS names no checkout");
        return;
    };
    let expected = [
        ("optix01-SceneRendering-Color", RayProgram::Albedo),
        ("optix02-Texturing", RayProgram::Albedo),
        ("optix03-Normals", RayProgram::Lambert),
        ("optix04-Shadows", RayProgram::Whitted),
        ("optix05-AlphaBasedTransparency", RayProgram::Whitted),
        ("optix06-Transparency", RayProgram::Whitted),
        ("optix07-ReflectionRefraction", RayProgram::Whitted),
        ("optix08-Aliasing Primary Rays", RayProgram::Whitted),
        ("optix09-SoftShadows", RayProgram::Whitted),
        ("optix10-GlossyReflections", RayProgram::Whitted),
        ("optix11-AmbientOcclusion", RayProgram::CameraOcclusion),
        ("optix12-DepthOfField", RayProgram::Whitted),
        ("optix13-PathTracingIterative", RayProgram::PathTracing),
    ];
    for (name, program) in expected {
        let path = folder.join(format!("projects/optix test/{name}/optix.xml"));
        let project = load(&path).unwrap_or_else(|problems| panic!("{name} does not load:\n{problems}"));
        let PassKind::Ray(ray) = &project.pipelines[0].passes[0].kind else { panic!("{name}: no ray pass") };
        assert_eq!(ray.program, program, "{name}");
        let start = ray.from_camera.as_ref().expect("it starts at the camera");
        let kinds = |kind| start.surfaces.iter().filter(|(_, of)| *of == kind).count();
        let of_light = |name: &str| name.contains("optix0") && ["7", "8", "9"].iter().any(|n| name.contains(n));
        if of_light(name) {
            let found = [SurfaceKind::Light, SurfaceKind::Glass, SurfaceKind::Metal].map(kinds);
            assert_eq!((found, start.lamp), ([1; 3], true), "{name}");
        }
        assert_eq!(kinds(SurfaceKind::Clear), usize::from(name.starts_with("optix06")), "{name}");
    }
    for (name, textures) in [("optix00-HelloWorld", 0), ("optix00.1-HelloWorld - TextureParam", 1)] {
        let loaded = load(&folder.join(format!("projects/optix test/{name}/optix.xml")));
        if !curitiba_pipeline::glsl::AVAILABLE {
            assert!(loaded.is_err(), "{name}");
            continue;
        }
        let project = loaded.unwrap_or_else(|problems| panic!("{name} does not load:\n{problems}"));
        let PassKind::Quad(quad) = &project.pipelines[0].passes[0].kind else { panic!("{name}: no pattern") };
        assert_eq!(quad.shader.as_ref().map(|shader| shader.textures.len()), Some(textures), "{name}");
    }
}
