//! Texture lookups by ray cones, compared with the processor's.

use super::pictures::differing;
use super::{bits, picture, rays, rays_in_turn};
use crate::cpu::CpuRays;
use crate::effects::tests::cones::{at_court, court, solid};
use crate::effects::tests::world::World;
use curitiba_pipeline::backend::{RayBackend, RayJob};
use curitiba_pipeline::glass::{Dielectric, GlassRule, Shape};
use curitiba_pipeline::programs::{Fidelity, RayParams, RayProgram, TextureLod};
use curitiba_pipeline::scene::RenderScene;
use std::sync::Arc;

/// Number of pixels of 64 x 64 that may differ by more than a hundredth, where the last bit of a direction decides what a ray hits.
const FEW: usize = 20;

fn params(texture_lod: TextureLod) -> RayParams {
    RayParams { texture_lod, depth: 2, samples: 0, glass: GlassRule::Auto, ..RayParams::default() }
}

/// Compares the pictures of a world, and checks that they differ from those at level 0.
fn agrees(world: &World, program: RayProgram, cones: RayParams) {
    let Some(mut rays) = rays_in_turn() else { return };
    let scene: Arc<RenderScene> = Arc::new(world.scene.clone());
    let shot = at_court(world);
    let mut cpu = CpuRays::new();
    let filtered = vec![true; scene.materials.len()];
    rays.build(&scene, &filtered).expect("built");
    cpu.build(&scene, &filtered).expect("built");
    let job = |params| RayJob { scene: &scene, ..shot.job(program, Fidelity::Corrected, params) };
    let (found, mine) = picture(&mut *rays, &job(cones));
    let (expected, theirs) = picture(&mut cpu, &job(cones));
    let (zero, _) = picture(&mut cpu, &job(RayParams { texture_lod: TextureLod::Zero, ..cones }));
    let [off, changed] = [&found, &zero].map(|pictures| differing(pictures, &expected, 0.01));
    println!("{program:?}: {off} pixels are off, {changed} are others at level 0");
    assert!(off <= FEW, "{program:?}: {off} pixels are off");
    assert!(changed > 300, "{program:?}: {changed} pixels have another level");
    let counts = |rays: curitiba_pipeline::backend::RayCounts| [rays.reflected, rays.refracted];
    for (mine, theirs) in counts(mine.rays).into_iter().zip(counts(theirs.rays)) {
        assert!(mine.abs_diff(theirs) <= theirs / 100 + 2, "{mine} rays, and {theirs} on the processor");
    }
}

fn thin() -> Dielectric {
    Dielectric { shape: Shape::Thin, filter_texture: Some(1), ..solid(1.5) }
}

#[test]
fn mirrors_and_panes_read_the_levels_that_the_processor_reads() {
    let world = court([solid(1.5), thin()], false);
    agrees(&world, RayProgram::Reflection, params(TextureLod::Cones));
    agrees(&world, RayProgram::Refraction, params(TextureLod::Cones));
    // The last kernel of `final` contains everything that a single kernel would.
    agrees(&world, RayProgram::Final, RayParams { samples: 2, ..params(TextureLod::Cones) });
}

#[test]
fn bodies_and_walls_read_the_levels_that_the_processor_reads() {
    let world = court([solid(1.5), thin()], true);
    agrees(&world, RayProgram::Refraction, params(TextureLod::Cones));
    agrees(&world, RayProgram::Final, RayParams { samples: 2, ..params(TextureLod::Cones) });
}

#[test]
fn rough_and_dispersing_glass_reads_the_levels_that_the_processor_reads() {
    let rough = Dielectric { alpha: 0.2, roughness_texture: Some(0), ..thin() };
    let world = court([Dielectric { spread: 0.03, ..solid(1.5) }, rough], true);
    agrees(
        &world,
        RayProgram::Refraction,
        RayParams { paths: 2, wavelengths: 3, depth: 1, ..params(TextureLod::Cones) },
    );
}

#[test]
fn mip_levels_are_on_the_device_only_once_a_job_has_asked_for_them() {
    let Some(mut rays) = rays() else { return };
    let world = court([solid(1.5), thin()], false);
    let scene: Arc<RenderScene> = Arc::new(world.scene.clone());
    let shot = at_court(&world);
    let job = |lod| RayJob { scene: &scene, ..shot.job(RayProgram::Reflection, Fidelity::Corrected, params(lod)) };
    let built = rays.build(&scene, &vec![true; scene.materials.len()]).expect("built").bytes;
    let held = |rays: &crate::wgpu_rays::WgpuRays| rays.built.as_ref().expect("built").1.bytes;
    let before = picture(&mut rays, &job(TextureLod::Zero)).0;
    assert_eq!(held(&rays), built);
    let cones = picture(&mut rays, &job(TextureLod::Cones)).0;
    let smaller = scene.textures.iter().flat_map(|texture| &texture.levels[1..]).map(|level| level.texels.len() as u64);
    assert_eq!(held(&rays), built + 4 * smaller.sum::<u64>());
    let after = picture(&mut rays, &job(TextureLod::Zero)).0;
    assert!(bits(&before) == bits(&after), "level 0 is where it was looked for");
    assert!(differing(&before, &cones, 0.01) > 300);
    assert!(bits(&picture(&mut rays, &job(TextureLod::Cones)).0) == bits(&cones));
}
