//! Renders a scene that is made in memory: a floor and a pyramid, with shadows and ambient occlusion.
//!
//! ```sh
//! cargo run --release --example own_scene
//! ```

use curitiba::Choice;
use curitiba::pipeline::executor::Silent;
use curitiba::pipeline::image::write_png;
use curitiba::pipeline::plan::Settings;
use curitiba::pipeline::project::{SceneOptions, SceneProjects};
use curitiba::pipeline::scene::{Group, Material, Mesh, Object, Scene};
use glam::{DVec3, Mat4, Vec3, Vec4};

/// A mesh whose triangles do not share positions, so that faces are flat.
fn mesh(name: &str, material: u32, corners: &[[Vec3; 3]]) -> Mesh {
    let triangles = (0..corners.len() as u32).map(|triangle| [0, 1, 2].map(|corner| 3 * triangle + corner)).collect();
    Mesh {
        name: name.to_owned(),
        positions: corners.concat(),
        groups: vec![Group { material, triangles }],
        ..Mesh::default()
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let [a, b, c, d] = [(-1, -1), (-1, 1), (1, 1), (1, -1)].map(|(x, z)| Vec3::new(x as f32, 0.0, z as f32));
    let top = Vec3::Y * 1.5;
    let floor = mesh("floor", 0, &[[a, b, c].map(|p| 5.0 * p), [a, c, d].map(|p| 5.0 * p)]);
    let pyramid = mesh("pyramid", 1, &[[a, b, top], [b, c, top], [c, d, top], [d, a, top]]);
    let painted =
        |name: &str, color: Vec3| Material { name: name.to_owned(), diffuse: color.extend(1.0), ..Material::default() };
    let placed =
        |mesh: u32, at: Vec3| Object { name: format!("object {mesh}"), mesh, transform: Mat4::from_translation(at) };
    let scene = Scene {
        meshes: vec![floor, pyramid],
        objects: vec![placed(0, Vec3::ZERO), placed(1, Vec3::ZERO), placed(1, Vec3::new(2.5, 0.0, 1.0))],
        materials: vec![painted("stone", Vec4::splat(0.7).truncate()), painted("clay", Vec3::new(0.8, 0.4, 0.3))],
        ..Scene::default()
    };
    let options = SceneOptions { look_from: Some(DVec3::new(-3.0, 4.0, 7.0)), ..SceneOptions::default() };
    let project = SceneProjects::in_memory(scene, &options, Some([512, 384]))?.project();
    let mut renderer = curitiba::open_project(project, Settings::default(), Choice::default(), &mut Silent)?;
    write_png("own_scene.png".as_ref(), &renderer.frame(&mut Silent)?)?;
    println!("own_scene.png");
    Ok(())
}
