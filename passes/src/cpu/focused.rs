//! Finds the light that glass focuses, for device programs.

use super::{BYTES_PER_TRIANGLE, Structure, check, new_pass};
use crate::effects::AlphaTested;
use crate::effects::dielectric::{Focused, Lenses, Variant, asks_for_focus, shoots_photons};
use crate::trace::{Erased, WithSpheres};
use curitiba_pipeline::backend::{BackendError, RayJob};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::glass::{Dielectric, Shape};
use curitiba_pipeline::memory;
use curitiba_pipeline::scene::Geometry;

/// Finds the spheres that focus light in a scene, and shoots photons at its glass meshes, on the processor. Photons are traced in the
/// processor's tree. Tracing there also finds the spheres that lie in a body of triangles; such spheres do not focus light. The tree is
/// built for the first job that needs it.
#[derive(Default)]
pub struct FindsFocused {
    filtered: Vec<bool>,
    structure: Option<Structure>,
}

impl std::fmt::Debug for FindsFocused {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FindsFocused").field("has_structure", &self.structure.is_some()).finish()
    }
}

impl FindsFocused {
    /// The search in a scene. `filtered` is the argument of [`RayBackend::build`](curitiba_pipeline::backend::RayBackend::build).
    #[must_use]
    pub fn new(filtered: &[bool]) -> Self {
        Self { filtered: filtered.to_vec(), structure: None }
    }

    /// The light that glass focuses in a job, whose scene must be the same in all calls. If `progress` is cancelled, light is missing.
    ///
    /// # Errors
    /// [`BackendError::Unsupported`] of `backend` if the scene has too many spheres of glass, or if there is too little memory for the tree or the
    /// photons.
    pub fn of(
        &mut self,
        backend: &'static str,
        job: &RayJob<'_>,
        progress: &Progress,
    ) -> Result<Focused, BackendError> {
        let (geometry, dielectrics) = (&job.scene.geometry, job.dielectrics);
        if !asks_for_focus(job) || !Variant::of(job).knows_bodies() {
            return Ok(Focused::default());
        }
        let has_spheres = !geometry.spheres.is_empty();
        if shoots_photons(job) || (has_spheres && has_bodies(geometry, dielectrics)) {
            if self.structure.is_none() {
                // The builder allocates without checks.
                let probed = memory::probe(BYTES_PER_TRIANGLE * geometry.triangles.len() as u64);
                probed.map_err(|refused| check::missing(backend, job, &refused.to_string()))?;
                self.structure = Structure::build_until(job.scene, &self.filtered, &progress.part());
            }
            let Some(structure) = &self.structure else { return Ok(Focused::default()) };
            return focused(backend, structure, job, progress);
        }
        // Without bodies of triangles no tree is needed: [`Lenses::of`] itself leaves out spheres that touch other spheres of glass.
        let lenses = Lenses::of(geometry, dielectrics, |_| false).map_err(|why| check::missing(backend, job, &why))?;
        Ok(Focused { lenses, ..Focused::default() })
    }
}

/// Whether any triangles are surfaces of bodies of glass.
fn has_bodies(geometry: &Geometry, dielectrics: &[Dielectric]) -> bool {
    let is_body = |material: u32| dielectrics.get(material as usize).is_some_and(|glass| glass.shape == Shape::Solid);
    geometry.batches.iter().any(|batch| batch.count > 0 && is_body(batch.material))
}

/// The light that glass focuses in a job, found by tracing in the structure of the job's scene.
fn focused(
    backend: &'static str,
    Structure { triangles, spheres }: &Structure,
    job: &RayJob<'_>,
    progress: &Progress,
) -> Result<Focused, BackendError> {
    let coverage = AlphaTested { scene: job.scene, shades: job.shades };
    let tracer = WithSpheres { triangles, spheres };
    match new_pass(job, &Erased::<true>::new(&tracer), coverage, Some(progress)) {
        Ok(pass) => Ok(pass.focused),
        Err(BackendError::Unsupported { what, why, .. }) => Err(BackendError::Unsupported { backend, what, why }),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::world::{Shot, World};
    use curitiba_pipeline::executor::Cancellation;
    use curitiba_pipeline::glass::{GlassRule, GlassShadow};
    use curitiba_pipeline::programs::{Fidelity, RayParams, RayProgram};
    use glam::Vec3;

    #[test]
    fn a_search_that_is_given_up_finds_nothing_and_a_later_one_finds_all() {
        let mut world = World::lit_along(Vec3::NEG_Y);
        let glass = world.dielectric(Dielectric { shape: Shape::Solid, index: 1.5, ..Dielectric::default() });
        world.quad(glass, Vec3::Y, Vec3::Z, Vec3::X);
        let params = RayParams {
            glass: GlassRule::Auto,
            shadow: GlassShadow::Caustic,
            photons: 64,
            samples: 0,
            ..RayParams::default()
        };
        let shot = Shot::of(&world, Vec3::Y * 9.0, [Vec3::ZERO]);
        let job = shot.job(RayProgram::Final, Fidelity::Corrected, params);
        let (mut search, stop) = (FindsFocused::new(&[true]), Cancellation::default());
        stop.cancel();
        let given_up = search.of("a device", &job, &Progress::until(&stop)).expect("no error");
        assert!(given_up.is_empty() && search.structure.is_none());
        let found = search.of("a device", &job, &Progress::default()).expect("no error");
        assert_eq!((found.photons.counts.shot, found.photons.clouds().len()), (64, 1));
    }

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
            let refused =
                FindsFocused::new(&[true]).of("a device", &job, &Progress::default()).expect_err("there are too many");
            let BackendError::Unsupported { backend, why, .. } = refused else { panic!("{refused}") };
            assert!(backend == "a device" && why.contains("spheres"), "{backend}: {why}");
        }
    }
}
