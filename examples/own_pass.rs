//! A custom ray pass in a project's graph: how far a person can walk from each point before something is in the way.
//!
//! ```sh
//! cargo run --release --example own_pass
//! ```

use curitiba::passes::own::{At, OwnProgram};
use curitiba::passes::raster::cpu::CpuRasteriser;
use curitiba::passes::trace::{Ray, Tracer as _};
use curitiba::pipeline::backend::NO_TRIANGLE;
use curitiba::pipeline::executor::{Engines, Renderer, Silent};
use curitiba::pipeline::image::write_png;
use curitiba::pipeline::plan::{Plan, Settings};
use curitiba::pipeline::programs::RayProgram;
use curitiba::pipeline::project;
use glam::Vec3;

/// Number of horizontal directions.
const WAYS: u32 = 16;
/// Distance in metres that is white.
const FAR: f32 = 15.0;

/// The mean free distance over all ways at the height of the chest, as a share of [`FAR`].
fn free(at: At<'_>) -> [f32; 4] {
    if at.job.triangle[at.pixel.index] == NO_TRIANGLE {
        return [0.5, 0.6, 0.7, 1.0];
    }
    let [x, y, z, _] = at.job.position[at.pixel.index];
    let origin = Vec3::new(x, y + 1.4, z);
    let mut sum = 0.0;
    for way in 0..WAYS {
        let (z, x) = (std::f32::consts::TAU * way as f32 / WAYS as f32).sin_cos();
        let ray = Ray { origin, direction: Vec3::new(x, 0.0, z), t_min: 0.0, t_max: FAR };
        sum += at.tracer.closest(&ray, |_| true).map_or(FAR, |hit| hit.t);
    }
    at.rays.occlusion += u64::from(WAYS);
    let share = sum / (FAR * WAYS as f32);
    [share, share, share, 1.0]
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "xml_projects/SceneFinal.xml".to_owned());
    let plan = Plan::new(project::load(path.as_ref())?, Settings { size: Some([512, 512]), ..Settings::default() })?;
    // This program's output is shown as it is; its inputs are positions, normals, colours and triangle ids.
    let rays = OwnProgram::new(RayProgram::Final, free);
    let engines = Engines::new(Box::new(CpuRasteriser::new()), Box::new(rays));
    let mut renderer = Renderer::new(plan, engines, &mut Silent)?;
    write_png("own_pass.png".as_ref(), &renderer.frame(&mut Silent)?)?;
    for row in &renderer.timeline().rows {
        println!("{:9} {:20} {:8.2} ms  {}", row.kind.name(), row.name, row.median_ms(), row.note);
    }
    println!("own_pass.png");
    Ok(())
}
