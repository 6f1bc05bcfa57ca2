//! The trait of ray tracers.

use super::device::{Gpu, Limits};
use super::error::{BackendError, not_in_place};
use super::ray_job::{IntersectionJob, RayJob};
use super::ray_stats::{BuildStats, RayStats};
use crate::glass::Dielectric;
use crate::image::Image;
use crate::programs::{Fidelity, RayParams, RayProgram};
use crate::progress::Progress;
use crate::scene::RenderScene;
use crate::shared::{DeviceUuid, InPlace, SharedGBuffer};
use std::sync::Arc;

/// Runs ray programs.
pub trait RayBackend {
    /// Short name, such as `cpu`, `wgpu`, `cuda` or `optix`.
    fn name(&self) -> &'static str;
    /// The largest job that it runs.
    fn limits(&self) -> Limits {
        Limits::NONE
    }
    /// Whether the backend can continue sample sequences where another job ended: [`RayParams::first`], [`RayParams::first_path`] and
    /// [`RayParams::first_sun`] above 0. Otherwise samples are not accumulated, and each of several samples of a pixel has its own seed.
    fn continues_sequences(&self) -> bool {
        true
    }
    /// Description of the device and its driver.
    fn device(&self) -> String;
    /// The graphics devices that the backend uses; empty for the processor.
    fn gpus(&self) -> Vec<Gpu> {
        Vec::new()
    }
    /// Whether the backend can run a program.
    ///
    /// # Errors
    /// [`BackendError::Unsupported`] with the reason.
    fn supports(&self, program: RayProgram, fidelity: Fidelity) -> Result<(), BackendError>;
    /// Whether the backend can run a program with the glass features that these parameters and materials ([`RayJob::dielectrics`])
    /// ask for. Applies to corrected fidelity and scenes with glass. By default a backend supports only the thin panes of the
    /// report.
    ///
    /// # Errors
    /// [`BackendError::Unsupported`] with the reason and a remedy.
    fn supports_glass(
        &self,
        program: RayProgram,
        params: &RayParams,
        _dielectrics: &[Dielectric],
    ) -> Result<(), BackendError> {
        let Some(asked) = program.asks_of_glass(params) else { return Ok(()) };
        let why = "its programs know the report's panes only; use --backend cpu, or allow it with --fallback cpu, or set \
                   glass=pane and shadow=report on the pass";
        let what = format!("{} with {asked}", program.info().stem);
        Err(BackendError::Unsupported { backend: self.name(), what, why: why.to_owned() })
    }
    /// Whether the backend traces exact spheres ([`Geometry::spheres`](crate::scene::Geometry::spheres)), in corrected fidelity.
    fn traces_spheres(&self) -> bool {
        false
    }
    /// Whether reflected and refracted rays hit a sky ([`Geometry::sky`](crate::scene::Geometry::sky)), in corrected fidelity. A sky
    /// occludes neither shadow rays nor occlusion rays.
    fn sees_skies(&self) -> bool {
        false
    }
    /// Whether the backend traces the rays of a storage buffer.
    ///
    /// # Errors
    /// [`BackendError::Unsupported`] with a remedy.
    fn supports_intersections(&self) -> Result<(), BackendError> {
        let why = "its programs start their rays themselves; use --backend cpu, or allow it with --fallback cpu";
        let what = "the rays of a storage buffer".to_owned();
        Err(BackendError::Unsupported { backend: self.name(), what, why: why.to_owned() })
    }
    /// Whether the backend traces soft shadows: lights with a disc ([`RayParams::sun`] above 0).
    fn traces_sun_discs(&self) -> bool {
        false
    }
    /// Whether its programs support several lights, and lights with a position ([`RayJob::lights`]).
    fn knows_lights(&self) -> bool {
        false
    }
    /// Whether it filters the share that a program writes ([`RayParams::filter`] above 0).
    fn filters_shares(&self) -> bool {
        false
    }
    /// Whether it samples stochastic glass until an error is reached ([`RayParams::error`]).
    fn samples_adaptively(&self) -> bool {
        false
    }
    /// Whether it filters texture lookups at hits by ray cones ([`RayParams::texture_lod`]).
    fn traces_cones(&self) -> bool {
        false
    }
    /// Whether its pictures show the light of photons at glass meshes ([`RayParams::photons`] above 0), with the shadow rules that it supports. The
    /// processor may shoot the photons for it.
    fn shoots_photons(&self) -> bool {
        false
    }
    /// Builds the acceleration structure; the executor times this step. `filtered` says by material index whether rays of any pass may
    /// pass through the material (alpha-cut textures, glass that shadow rays pass), so that hits need an any-hit test. Shadow and
    /// occlusion rays do not hit the triangles of a sky ([`Geometry::sky`](crate::scene::Geometry::sky)).
    ///
    /// # Errors
    /// If the device cannot hold it.
    fn build(&mut self, scene: &Arc<RenderScene>, filtered: &[bool]) -> Result<BuildStats, BackendError>;
    /// [`RayBackend::build`] that checks [`Progress::is_cancelled`] between parts of the work; if that is set, it returns early and
    /// nothing is built. A backend whose work has no parts builds to the end.
    ///
    /// # Errors
    /// As [`RayBackend::build`].
    fn build_until(
        &mut self,
        scene: &Arc<RenderScene>,
        filtered: &[bool],
        _progress: &Progress,
    ) -> Result<BuildStats, BackendError> {
        self.build(scene, filtered)
    }
    /// About how many bytes a triangle takes in the structure and while it is built.
    fn bytes_per_triangle(&self) -> u64;
    /// Accepts a rasteriser's handle to attachments in place. Returns whether the backend can read them; if so, later jobs with
    /// [`RayJob::shared`] read the attachments through this handle.
    fn reads(&mut self, _lent: &InPlace) -> bool {
        false
    }
    /// Whether the backend can read G-buffers in shared memory of that device.
    fn joins(&self, _device: DeviceUuid) -> bool {
        false
    }
    /// Whether it can write a picture into the shared memory of a G-buffer, for [`RayBackend::run_in_place`].
    fn shares_pictures(&self) -> bool {
        false
    }
    /// Opens a shared G-buffer and closes the previous one. Jobs with [`RayJob::shared`] read it.
    ///
    /// # Errors
    /// If the device refuses it.
    fn join(&mut self, _shared: SharedGBuffer) -> Result<(), BackendError> {
        let (what, why) = ("a shared G-buffer".to_owned(), "it reads host memory".to_owned());
        Err(BackendError::Unsupported { backend: self.name(), what, why })
    }
    /// Runs one pass into `output`, which has the job's size. Advances `progress` meanwhile.
    ///
    /// # Errors
    /// If the device fails or the job lacks what the program reads.
    fn run(&mut self, job: &RayJob<'_>, output: &mut Image, progress: &Progress) -> Result<RayStats, BackendError>;
    /// Traces rays of a storage buffer and writes one entry of `hits` for each: the distance, the triangle's id as the bits of an
    /// integer, and the barycentric coordinates of corners 1 and 2, or [`NO_HIT`](super::NO_HIT). Advances `progress` meanwhile.
    ///
    /// # Errors
    /// If [`RayBackend::supports_intersections`] fails, or the structure was not built.
    fn intersect(
        &mut self,
        _: &IntersectionJob<'_>,
        _hits: &mut [[f32; 4]],
        _: &Progress,
    ) -> Result<RayStats, BackendError> {
        self.supports_intersections().map(|()| RayStats::default())
    }
    /// Runs one pass and keeps its picture on the rasteriser's device. If [`RayBackend::reads`] accepted the rasteriser's handle, the
    /// number identifies the picture ([`OnDevice::Made`](crate::device_quad::OnDevice::Made)). Otherwise the picture is in the shared
    /// memory of the job's G-buffer, which has room for it.
    ///
    /// # Errors
    /// As [`RayBackend::run`], or if there is neither a handle nor such memory.
    fn run_in_place(&mut self, _: &RayJob<'_>, _: usize, _: &Progress) -> Result<RayStats, BackendError> {
        Err(not_in_place(self.name()))
    }
}
