//! The ray backends: one GPU, or several that share the rows of each pass.
//!
//! A picture is divided into stripes of rows, which are assigned to the GPUs in turn, so that expensive and cheap parts are spread. A GPU
//! computes all pixels of its stripes from its own copy of the scene. Pixels are independent, so pictures and ray counts are those of one
//! GPU.

use crate::device::Device;
use crate::layout::BLOCK_HEIGHT;
use crate::one_gpu::{DeviceTracer, OneGpu, Work};
use crate::programs::Key;
use crate::stripes::{Stripe, launches, pixels_of_launch};
use crate::{peers, programs, shared_gbuffer};
use curitiba_passes::adaptive::{Sampling, asked, sample_on_device};
use curitiba_passes::cpu::{FindsFocused, check};
use curitiba_passes::effects::Lighting;
use curitiba_passes::effects::dielectric::{Focused, Variant};
use curitiba_pipeline::backend::{BackendError, BuildStats, Gpu, Limits, RayBackend, RayJob, RayStats};
use curitiba_pipeline::executor::Progress;
use curitiba_pipeline::glass::Dielectric;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::memory::Refused;
use curitiba_pipeline::programs::{Fidelity, RayParams, RayProgram};
use curitiba_pipeline::scene::RenderScene;
use curitiba_pipeline::shared::{DeviceUuid, SharedGBuffer};
use std::sync::Arc;

/// The ray backend `cuda`: kernels with our own traversal.
pub type CudaRays = DeviceRays<crate::bvh::BvhTracer>;

/// The ray backend `optix`: NVIDIA's OptiX, from the driver.
pub type OptixRays = DeviceRays<crate::optix::OptixTracer>;

/// Greatest number of stripes of a picture for each of several GPUs: enough that no GPU gets all expensive rows, but few, since each stripe
/// is copied separately.
const STRIPES: u32 = 16;

/// A ray backend on one GPU or several.
#[derive(Debug)]
pub struct DeviceRays<T> {
    /// The GPUs, at least one.
    gpus: Vec<OneGpu<T>>,
    /// Index of the GPU that has the shared G-buffer, if there is one.
    owner: usize,
    /// Finds the light that glass focuses in the scene.
    focused: FindsFocused,
}

impl<T: DeviceTracer> DeviceRays<T> {
    /// A backend on the first GPU, without a structure.
    ///
    /// # Errors
    /// If driver, GPU or OptiX (for [`OptixRays`]) is missing, or driver or GPU is too old; the message says which, and what to do.
    pub fn new() -> Result<Self, BackendError> {
        Self::on(&[0])
    }

    /// A backend on the GPUs of these numbers; on the first GPU for an empty list. A GPU that is named twice is used as if it were two.
    ///
    /// # Errors
    /// As [`Self::new`], and if one of the GPUs is missing.
    pub fn on(ordinals: &[usize]) -> Result<Self, BackendError> {
        let ordinals = if ordinals.is_empty() { &[0] } else { ordinals };
        let several = ordinals.len() > 1;
        let open = |ordinal: &usize| OneGpu::new(Device::on(T::NAME, *ordinal, several)?);
        let gpus = ordinals.iter().map(open).collect::<Result<_, _>>()?;
        Ok(Self { gpus, owner: 0, focused: FindsFocused::default() })
    }

    /// Index of the first GPU with that UUID, on which the rasteriser draws; `None` if no GPU here has it.
    fn drawn_on(&self, device: DeviceUuid) -> Option<usize> {
        self.gpus.iter().position(|gpu| shared_gbuffer::is_on(&gpu.device, device))
    }

    /// Runs `work` on every GPU with its own share, and returns the results, or the first error. Several GPUs run on a thread each.
    fn on_each<S: Send, R: Send>(
        &mut self,
        shares: Vec<S>,
        work: impl Fn(&mut OneGpu<T>, S) -> Result<R, BackendError> + Sync,
    ) -> Result<Vec<R>, BackendError> {
        if let [gpu] = self.gpus.as_mut_slice() {
            return shares.into_iter().map(|share| work(gpu, share)).collect();
        }
        std::thread::scope(|scope| {
            let work = &work;
            let threads: Vec<_> =
                self.gpus.iter_mut().zip(shares).map(|(gpu, share)| scope.spawn(move || work(gpu, share))).collect();
            let results: Vec<_> = threads
                .into_iter()
                .map(|thread| thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
                .collect();
            results.into_iter().collect()
        })
    }
}

/// Divides the rows of a picture into stripes and assigns them to the GPUs in turn. A single GPU gets all rows as one stripe.
fn deal(pixels: &mut [[f32; 4]], [width, height]: [u32; 2], gpus: usize) -> Vec<Vec<Stripe<'_>>> {
    let rows = match u32::try_from(gpus) {
        Ok(1) | Err(_) => height.max(1),
        Ok(gpus) => height.div_ceil(gpus.saturating_mul(STRIPES)).max(1).next_multiple_of(BLOCK_HEIGHT),
    };
    let mut shares: Vec<Vec<Stripe<'_>>> = (0..gpus).map(|_| Vec::new()).collect();
    for (index, pixels) in pixels.chunks_mut((rows as usize * width as usize).max(1)).enumerate() {
        let first_row = index as u32 * rows;
        shares[index % gpus].push(Stripe { first_row, rows: rows.min(height - first_row), pixels });
    }
    shares
}

impl CudaRays {
    /// On each GPU, limits the list of surfaces of `final`: see [`BvhTracer::limit_surfaces`](crate::bvh::BvhTracer::limit_surfaces).
    pub fn limit_surfaces(&mut self, room: u64) {
        self.gpus.iter_mut().for_each(|gpu| gpu.tracer.limit_surfaces(room));
    }
}

/// The statistics of all GPUs: sums of rays and memory, and maxima of times.
fn together(parts: &[RayStats]) -> RayStats {
    let mut whole = RayStats::default();
    for part in parts {
        whole.rays += part.rays;
        whole.device_time = whole.device_time.max(part.device_time);
        whole.upload = whole.upload.max(part.upload);
        whole.read_back = whole.read_back.max(part.read_back);
        whole.held_bytes += part.held_bytes;
    }
    whole
}

/// Adds the counts of the photons that the processor has shot.
fn with_photons(mut stats: RayStats, focused: &Focused) -> RayStats {
    stats.rays.photons += focused.photons.counts;
    stats
}

impl<T: DeviceTracer> RayBackend for DeviceRays<T> {
    fn name(&self) -> &'static str {
        T::NAME
    }

    fn device(&self) -> String {
        let gpus = self.gpus();
        let first = &self.gpus[0];
        let names: Vec<&str> = gpus.iter().map(|gpu| gpu.name.as_str()).collect();
        let names =
            if names.len() > 1 { format!("{} GPUs: {}", names.len(), names.join(" + ")) } else { names.concat() };
        let more = first.tracer.description();
        let separator = if more.is_empty() { "" } else { ", " };
        format!("{names}; {}{separator}{more}", gpus[0].driver)
    }

    fn gpus(&self) -> Vec<Gpu> {
        self.gpus.iter().map(|gpu| gpu.device.gpu().clone()).collect()
    }

    fn limits(&self) -> Limits {
        // The device programs use a pixel's place in the launch as its place in the picture, so they cannot compute parts.
        Limits { parts: false, ..Limits::NONE }
    }

    fn supports(&self, program: RayProgram, fidelity: Fidelity) -> Result<(), BackendError> {
        let key = Key { program, variant: Variant::Panes(fidelity), lighting: Lighting::Sun, spheres: false };
        match T::program(key) {
            Some(_) => Ok(()),
            None => Err(programs::not_written(T::NAME, program)),
        }
    }

    fn supports_glass(&self, _: RayProgram, _: &RayParams, _: &[Dielectric]) -> Result<(), BackendError> {
        Ok(())
    }

    fn traces_cones(&self) -> bool {
        true
    }

    fn traces_sun_discs(&self) -> bool {
        true
    }

    fn knows_lights(&self) -> bool {
        true
    }

    fn sees_skies(&self) -> bool {
        true
    }

    fn traces_spheres(&self) -> bool {
        true
    }

    fn shoots_photons(&self) -> bool {
        true
    }

    fn samples_adaptively(&self) -> bool {
        true
    }

    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError> {
        self.gpus.iter_mut().for_each(OneGpu::clear);
        self.focused = FindsFocused::new(filtered);
        let prepared = T::prepare(scene, filtered);
        let shares = vec![(); self.gpus.len()];
        let built = self.on_each(shares, |gpu, ()| gpu.build(scene, filtered, &prepared))?;
        Ok(BuildStats { bytes: built.iter().map(|stats| stats.bytes).sum(), nodes: built[0].nodes })
    }

    fn bytes_per_triangle(&self) -> u64 {
        T::BYTES_PER_TRIANGLE
    }

    fn joins(&self, device: DeviceUuid) -> bool {
        self.drawn_on(device)
            .is_some_and(|owner| self.gpus.iter().all(|gpu| peers::reaches(&gpu.device, &self.gpus[owner].device)))
    }

    fn shares_pictures(&self) -> bool {
        // With several GPUs, the rows of the picture are spread over their memories.
        self.gpus.len() == 1
    }

    fn join(&mut self, shared: SharedGBuffer) -> Result<(), BackendError> {
        let owner = self.drawn_on(shared.device).unwrap_or(0);
        for gpu in &self.gpus {
            peers::connect(&gpu.device, &self.gpus[owner].device)?;
        }
        self.owner = owner;
        self.gpus[owner].join(shared)
    }

    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        check::images(T::NAME, job, output)?;
        check_job::<T>(job)?;
        if output.pixels.is_empty() {
            return Ok(RayStats::default());
        }
        let focused = self.focused.of(T::NAME, job, progress)?;
        if progress.is_given_up() {
            return Ok(RayStats::default());
        }
        let stats = match asked(job) {
            None => self.trace(Work { job, focused: &focused, sampling: Sampling::All }, output, progress)?,
            Some(_) if job.shared.is_some() => {
                return Err(check::missing(
                    T::NAME,
                    job,
                    "it samples adaptively, and its G-buffer is not in host memory",
                ));
            }
            Some(error) => {
                let rounds = progress.part();
                let mut run = |job: &RayJob<'_>, sampling: Sampling<'_>, output: &mut Image| {
                    self.trace(Work { job, focused: &focused, sampling }, output, &rounds)
                };
                let refused = |refused: Refused| check::missing(T::NAME, job, &refused.to_string());
                sample_on_device(job, error, (output, progress), &mut run, &refused)?
            }
        };
        Ok(with_photons(stats, &focused))
    }

    fn run_in_place(&mut self, job: &RayJob<'_>, _: usize, progress: &Progress) -> Result<RayStats, BackendError> {
        check::buffers(T::NAME, job)?;
        check_job::<T>(job)?;
        check::adaptive(T::NAME, job)?;
        let focused = self.focused.of(T::NAME, job, progress)?;
        let [gpu] = self.gpus.as_mut_slice() else {
            return Err(check::missing(T::NAME, job, "the picture of several GPUs does not lie on one of them"));
        };
        let mut whole = [Stripe { first_row: 0, rows: job.height, pixels: &mut [] }];
        progress.start(launches(&whole, job.width, pixels_of_launch(job)).len() as u64);
        let work = Work { job, focused: &focused, sampling: Sampling::All };
        Ok(with_photons(gpu.run_in_place(work, &mut whole, progress)?, &focused))
    }
}

impl<T: DeviceTracer> DeviceRays<T> {
    /// Runs a job, which must have been checked, on all GPUs.
    fn trace(&mut self, work: Work<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError> {
        let job = work.job;
        let shares = deal(&mut output.pixels, [job.width, job.height], self.gpus.len());
        let pixels = pixels_of_launch(job);
        progress.start(shares.iter().map(|share| launches(share, job.width, pixels).len() as u64).sum());
        let several = self.gpus.len() > 1;
        let lent = if several && job.shared.is_some() { Some(self.gpus[self.owner].lend(job)?) } else { None };
        let owner = self.owner;
        let shares = shares.into_iter().enumerate().collect();
        let parts = self.on_each(shares, |gpu, (index, mut share)| {
            // In a small picture some GPUs may have no stripe.
            if share.is_empty() {
                return Ok(RayStats::default());
            }
            gpu.run(work, &mut share, lent.as_ref().filter(|_| index != owner), progress)
        })?;
        Ok(together(&parts))
    }
}

/// Refuses jobs that the device programs cannot run.
fn check_job<T: DeviceTracer>(job: &RayJob<'_>) -> Result<(), BackendError> {
    if job.origin != [0; 2] {
        return Err(check::missing(T::NAME, job, "it traces whole pictures, and this is a part; use --backend cpu"));
    }
    if job.program != RayProgram::Dummy {
        check::scene(T::NAME, job, true)?;
        check::filter(T::NAME, job)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::BvhTracer;
    use crate::optix::OptixTracer;
    use curitiba_pipeline::backend::{PixelCone, RayCounts, Shade, Sun};
    use curitiba_pipeline::glass::{GlassRule, GlassShadow, Shape};
    use curitiba_pipeline::scene::{Batch, Geometry, Material, Sphere};
    use glam::Vec3;
    use std::time::Duration;

    /// A job of one pixel in a scene of one exact sphere, handed to `check`.
    fn of_a_sphere(program: RayProgram, fidelity: Fidelity, check: impl Fn(&RayJob<'_>)) {
        let sphere = Sphere { center: Vec3::ZERO, radius: 1.0, material: 0 };
        let geometry = Geometry { spheres: vec![sphere], ..Geometry::default() };
        let scene = RenderScene { geometry, materials: vec![Material::default()], ..RenderScene::default() };
        check(&RayJob {
            from_camera: None,
            origin: [0; 2],
            scene: &scene,
            program,
            params: RayParams::default(),
            fidelity,
            seed: 0,
            eye: Vec3::Z,
            cone: PixelCone::default(),
            lights: &[],
            sun: Some(Sun { direction: Vec3::NEG_Z, color: Vec3::ONE }),
            width: 1,
            height: 1,
            position: &[[0.0, 0.0, 1.0, 1.0]],
            normal: &[[0.0, 0.0, 1.0, 0.0]],
            color: &[[1.0; 4]],
            triangle: &[0],
            shared: None,
            shades: &[Shade::default()],
            glass: &[false],
            shadow_glass: &[false],
            beyond: Vec3::ZERO,
            dielectrics: &[],
        });
    }

    #[test]
    fn both_tracers_know_exact_spheres_in_corrected_fidelity() {
        for program in [RayProgram::DeferredShadows, RayProgram::Reflection, RayProgram::Ssao, RayProgram::Final] {
            of_a_sphere(program, Fidelity::Corrected, |job| {
                check_job::<BvhTracer>(job).expect("cuda knows them");
                check_job::<OptixTracer>(job).expect("optix knows them");
            });
            of_a_sphere(program, Fidelity::Thesis, |job| {
                for (name, checked) in [("cuda", check_job::<BvhTracer>(job)), ("optix", check_job::<OptixTracer>(job))]
                {
                    let refused = checked.expect_err("the report has triangles").to_string();
                    assert!(
                        ["exact spheres", "corrected", name].iter().all(|word| refused.contains(word)),
                        "{refused}"
                    );
                }
            });
        }
    }

    #[test]
    fn a_pass_that_shoots_photons_runs_the_programs_with_spheres() {
        of_a_sphere(RayProgram::Final, Fidelity::Corrected, |job| {
            let params =
                RayParams { glass: GlassRule::Auto, shadow: GlassShadow::Caustic, photons: 5000, ..job.params };
            let glass = [Dielectric { shape: Shape::Solid, index: 1.5, ..Dielectric::default() }];
            let mut scene = job.scene.clone();
            scene.geometry.spheres.clear();
            scene.geometry.batches.push(Batch { material: 0, first: 0, count: 1 });
            scene.geometry.triangles.push([0; 3]);
            let meshes = RayJob { params, scene: &scene, dielectrics: &glass, ..*job };
            assert!(Key::of(&meshes).spheres);
            for none in [
                RayJob { params: RayParams { photons: 0, ..params }, ..meshes },
                RayJob { params: RayParams { shadow: GlassShadow::Straight, ..params }, ..meshes },
                RayJob { fidelity: Fidelity::Thesis, ..meshes },
                RayJob { dielectrics: &[], ..meshes },
            ] {
                assert!(!Key::of(&none).spheres, "{:?} {:?}", none.params, none.fidelity);
            }
        });
    }

    #[test]
    fn every_row_is_dealt_once_whatever_the_size_and_the_number_of_gpus() {
        for size in [[1, 1], [5, 7], [16, 64], [3, 1000], [64, 1024]] {
            for gpus in [1, 2, 3, 8] {
                let mut pixels = vec![[0.0; 4]; (size[0] * size[1]) as usize];
                for share in deal(&mut pixels, size, gpus) {
                    for stripe in share {
                        let first = (stripe.first_row * size[0]) as f32;
                        for (index, pixel) in stripe.pixels.iter_mut().enumerate() {
                            pixel[0] += 1.0;
                            pixel[1] = first + index as f32;
                        }
                    }
                }
                let dealt = pixels.iter().enumerate().all(|(index, pixel)| pixel[0] == 1.0 && pixel[1] == index as f32);
                assert!(dealt, "{size:?} on {gpus}");
            }
        }
    }

    #[test]
    fn each_of_several_gpus_gets_as_many_rows_spread_over_the_picture() {
        let mut pixels = vec![[0.0; 4]; 1024];
        let shares = deal(&mut pixels, [1, 1024], 2);
        assert!(shares.iter().all(|share| share.len() == STRIPES as usize));
        assert_eq!(
            shares.iter().map(|share| share.iter().map(|s| s.pixels.len()).sum()).collect::<Vec<usize>>(),
            [512, 512]
        );
        let mut pixels = vec![[0.0; 4]; 1024];
        assert_eq!(deal(&mut pixels, [1, 1024], 1)[0].len(), 1, "one GPU gets one piece");
    }

    #[test]
    fn gpus_add_their_rays_and_the_slowest_tells_the_time() {
        let part = |shadow, ms| RayStats {
            rays: RayCounts { shadow, ..RayCounts::default() },
            device_time: Some(Duration::from_millis(ms)),
            held_bytes: 100 * shadow,
            ..RayStats::default()
        };
        let whole = together(&[part(3, 7), part(4, 9), RayStats::default()]);
        assert_eq!((whole.rays.shadow, whole.held_bytes), (7, 700));
        assert_eq!(whole.device_time, Some(Duration::from_millis(9)));
    }
}
