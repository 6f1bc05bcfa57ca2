//! Finds the exact spheres that focus light, for device programs.

use super::{Structure, check, new_pass};
use crate::effects::AlphaTested;
use crate::effects::dielectric::{Lenses, Variant, asks_for_lenses};
use crate::trace::{Erased, WithSpheres};
use curitiba_pipeline::backend::{BackendError, RayJob};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::glass::{Dielectric, Shape};
use curitiba_pipeline::programs::RayParams;
use curitiba_pipeline::scene::Geometry;

/// Finds the spheres that focus light in a scene. A sphere inside another body does not focus light. Whether a sphere lies in a body of triangles
/// is found by tracing in the processor's tree. The tree is built for the first job that needs it.
#[derive(Default)]
pub struct FindsLenses {
    filtered: Vec<bool>,
    structure: Option<Structure>,
}

impl std::fmt::Debug for FindsLenses {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FindsLenses").field("has_structure", &self.structure.is_some()).finish()
    }
}

impl FindsLenses {
    /// The search in a scene. `filtered` is the argument of [`RayBackend::build`](curitiba_pipeline::backend::RayBackend::build).
    #[must_use]
    pub fn new(filtered: &[bool]) -> Self {
        Self { filtered: filtered.to_vec(), structure: None }
    }

    /// The spheres that focus the light of a job, whose scene must be the same in all calls.
    ///
    /// # Errors
    /// [`BackendError::Unsupported`] of `backend` if the scene has too many spheres of glass.
    pub fn of(&mut self, backend: &'static str, job: &RayJob<'_>) -> Result<Lenses, BackendError> {
        if job.scene.geometry.spheres.is_empty() || !asks_for_lenses(job) || !Variant::of(job).knows_bodies() {
            return Ok(Lenses::default());
        }
        if has_bodies(&job.scene.geometry, job.dielectrics) {
            let Self { filtered, structure } = self;
            let build =
                || Structure::build_until(job.scene, filtered, &Progress::default()).expect("nobody gives it up");
            return lenses(backend, structure.get_or_insert_with(build), job);
        }
        // Without bodies of triangles no tree is needed: [`Lenses::of`] itself leaves out spheres that touch other spheres of glass.
        Lenses::of(&job.scene.geometry, job.dielectrics, |_| false).map_err(|why| check::missing(backend, job, &why))
    }
}

/// Whether any triangles are surfaces of bodies of glass.
fn has_bodies(geometry: &Geometry, dielectrics: &[Dielectric]) -> bool {
    let is_body = |material: u32| dielectrics.get(material as usize).is_some_and(|glass| glass.shape == Shape::Solid);
    geometry.batches.iter().any(|batch| batch.count > 0 && is_body(batch.material))
}

/// The spheres that focus the light of a job. Whether a sphere lies in another body is found by tracing in the structure of the job's scene.
fn lenses(
    backend: &'static str,
    Structure { triangles, spheres }: &Structure,
    job: &RayJob<'_>,
) -> Result<Lenses, BackendError> {
    let job = RayJob { params: RayParams { photons: 0, ..job.params }, ..*job };
    let coverage = AlphaTested { scene: job.scene, shades: job.shades };
    let tracer = WithSpheres { triangles, spheres };
    match new_pass(&job, &Erased::<true>::new(&tracer), coverage, None) {
        Ok(pass) => Ok(pass.lenses),
        Err(BackendError::Unsupported { what, why, .. }) => Err(BackendError::Unsupported { backend, what, why }),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::world::{Shot, World};
    use curitiba_pipeline::glass::{GlassRule, GlassShadow};
    use curitiba_pipeline::programs::{Fidelity, RayProgram};
    use glam::Vec3;

    #[test]
    fn too_many_spheres_are_refused_in_the_name_of_the_backend_with_meshes_and_without() {
        for with_mesh in [false, true] {
            let mut world = World::lit_along(Vec3::NEG_Y);
            let glass = world.dielectric(Dielectric { shape: Shape::Solid, index: 1.5, ..Dielectric::default() });
            for place in 0..=1024 {
                world.sphere(glass, Vec3::X * (3.0 * place as f32), 1.0);
            }
            if with_mesh {
                world.quad(glass, Vec3::NEG_Y * 9.0, Vec3::X, Vec3::Z);
            }
            let params =
                RayParams { glass: GlassRule::Auto, shadow: GlassShadow::Caustic, samples: 0, ..RayParams::default() };
            let eye = Vec3::Z * 9.0;
            let shot = Shot::of(&world, eye, [Vec3::ZERO]);
            let job = shot.job(RayProgram::Final, Fidelity::Corrected, params);
            assert_eq!(has_bodies(&job.scene.geometry, job.dielectrics), with_mesh);
            let refused = FindsLenses::new(&[true]).of("a device", &job).expect_err("there are too many");
            let BackendError::Unsupported { backend, why, .. } = refused else { panic!("{refused}") };
            assert!(backend == "a device" && why.contains("spheres"), "{backend}: {why}");
        }
    }
}
