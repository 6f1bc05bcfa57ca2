//! Checks that a job has everything that its program reads, so that no pixel needs to check.

use crate::adaptive::asked;
use crate::effects::dielectric::shoots_photons;
use crate::trace::{Detected, Kernel, Simd};
use curitiba_pipeline::backend::{BackendError, NO_TRIANGLE, RayJob};
use curitiba_pipeline::glass::GlassShadow;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::programs::{Fidelity, RayProgram, TextureLod, Traces};
use rayon::prelude::*;

/// Pixels whose triangle ids a thread checks at a time.
const PART: usize = 1 << 15;

/// The error for a job that lacks something.
#[must_use]
pub fn missing(backend: &'static str, job: &RayJob<'_>, why: &str) -> BackendError {
    BackendError::Unsupported { backend, what: job.program.info().stem.to_owned(), why: why.to_owned() }
}

/// In thesis fidelity, refuses programs that the report does not have.
///
/// # Errors
/// [`BackendError::Unsupported`] that names `backend`.
pub fn fidelity(backend: &'static str, program: RayProgram, fidelity: Fidelity) -> Result<(), BackendError> {
    if fidelity == Fidelity::Corrected || !program.info().starts_at_camera() {
        return Ok(());
    }
    let why = "the report has no program whose rays start at the camera; use --fidelity corrected".to_owned();
    Err(BackendError::Unsupported { backend, what: program.info().stem.to_owned(), why })
}

/// Refuses several lights, and positional lights, in combinations that no program supports.
fn many_lights(backend: &'static str, job: &RayJob<'_>) -> Result<(), BackendError> {
    let info = job.program.info();
    let what = match () {
        () if job.lights.is_empty() => return Ok(()),
        () if job.fidelity == Fidelity::Thesis => "thesis fidelity",
        () if info.starts_at_camera() => "a program whose rays start at the camera",
        () if job.program.asks_of_filter(&job.params).is_some() => "a filter (filter above 0)",
        () if info.reads("shadow") && job.params.shadow == GlassShadow::Caustic => "shadow=caustic",
        () => return Ok(()),
    };
    Err(missing(
        backend,
        job,
        &format!("the pass has several lights, or a point or spot light, and {what} knows one light"),
    ))
}

/// Refuses a filter over the program's output, for a backend that has none.
///
/// # Errors
/// [`BackendError::Unsupported`] that names `backend`.
pub fn filter(backend: &'static str, job: &RayJob<'_>) -> Result<(), BackendError> {
    match job.program.asks_of_filter(&job.params).filter(|_| job.fidelity == Fidelity::Corrected) {
        None => Ok(()),
        Some(asked) => {
            Err(missing(backend, job, &format!("what it writes is to be filtered ({asked}); the cpu filters it")))
        }
    }
}

/// Refuses adaptive sampling of stochastic glass, for a backend that has none.
///
/// # Errors
/// [`BackendError::Unsupported`] that names `backend`.
pub fn adaptive(backend: &'static str, job: &RayJob<'_>) -> Result<(), BackendError> {
    match asked(job) {
        None => Ok(()),
        Some(error) => {
            let why = format!(
                "error={error} asks for as many paths as each pixel needs, and it gives all the same number: set error=0"
            );
            Err(missing(backend, job, &why))
        }
    }
}

/// Refuses photons where a single pixel is computed.
///
/// # Errors
/// [`BackendError::Unsupported`] that names `backend`.
pub fn photons(backend: &'static str, job: &RayJob<'_>) -> Result<(), BackendError> {
    if !shoots_photons(job) {
        return Ok(());
    }
    let photons = job.params.photons;
    let why = format!("photons={photons} are shot for all of the picture, and one pixel is asked for: set photons=0");
    Err(missing(backend, job, &why))
}

/// Refuses texture lookups that are filtered by ray cones, for a backend that has none.
///
/// # Errors
/// [`BackendError::Unsupported`] that names `backend`.
pub fn cones(backend: &'static str, job: &RayJob<'_>) -> Result<(), BackendError> {
    match job.program.asks_of_cones(&job.params).filter(|_| job.texture_lod() != TextureLod::Zero) {
        None => Ok(()),
        Some(asked) => Err(missing(
            backend,
            job,
            &format!("{asked} asks for mip levels at hits, and it reads level 0: set texturelod=zero"),
        )),
    }
}

/// Checks the sizes of the images that the program reads and of the one that it writes.
///
/// # Errors
/// [`BackendError::Unsupported`] that names `backend` and what is missing.
pub fn images(backend: &'static str, job: &RayJob<'_>, output: &Image) -> Result<(), BackendError> {
    let size = format!("{} x {}", job.width, job.height);
    let pixels = job.width as usize * job.height as usize;
    if (output.width, output.height, output.pixels.len()) != (job.width, job.height, pixels) {
        let found = format!("{} x {} ({} pixels)", output.width, output.height, output.pixels.len());
        return Err(missing(backend, job, &format!("the output is {found}, not {size}")));
    }
    buffers(backend, job)
}

/// Checks the sizes of the images that the program reads, unless they are in shared memory.
///
/// # Errors
/// [`BackendError::Unsupported`] that names `backend` and what is missing.
pub fn buffers(backend: &'static str, job: &RayJob<'_>) -> Result<(), BackendError> {
    if job.shared.is_some() {
        return Ok(());
    }
    let size = format!("{} x {}", job.width, job.height);
    let pixels = job.width as usize * job.height as usize;
    let reads = |name: &str| job.program.info().buffers.contains(&name);
    let starts_from_buffers = !matches!(job.program.info().traces, Traces::Nothing | Traces::FromCamera);
    let triangles = starts_from_buffers && job.fidelity == Fidelity::Corrected;
    let buffers = [
        ("pos_buffer", reads("pos_buffer"), job.position.len()),
        ("norm_buffer", reads("norm_buffer"), job.normal.len()),
        ("color_buffer", reads("color_buffer"), job.color.len()),
        ("the triangle ids (corrected fidelity)", triangles, job.triangle.len()),
    ];
    for (name, needed, found) in buffers {
        if needed && found != pixels {
            let found = if found == 0 { "absent".to_owned() } else { format!("{found} pixels") };
            return Err(missing(backend, job, &format!("it reads {name}, which is {found}; it needs {size} pixels")));
        }
    }
    Ok(())
}

/// Checks that the materials, vertex attributes, light and camera that the program reads are present, and that the triangle ids are valid. Also
/// refuses combinations of program, fidelity, lights and exact spheres that are not supported. `spheres` says whether the backend supports exact
/// spheres.
///
/// # Errors
/// [`BackendError::Unsupported`] that names `backend` and what is missing.
pub fn scene(backend: &'static str, job: &RayJob<'_>, spheres: bool) -> Result<(), BackendError> {
    fidelity(backend, job.program, job.fidelity)?;
    let info = job.program.info();
    let (scene, geometry) = (job.scene, &job.scene.geometry);
    many_lights(backend, job)?;
    if job.sun.is_none() && job.lights.is_empty() && info.globals.contains(&"lightDir") {
        return Err(missing(backend, job, "it reads lightDir, and the pass has no light"));
    }
    let start = job.from_camera.filter(|_| info.starts_at_camera());
    if start.is_none() && info.starts_at_camera() {
        return Err(missing(backend, job, "its rays start at the camera, and the job has none"));
    }
    let hits_are_shaded = !info.material_attributes.is_empty();
    let cuts = job.fidelity == Fidelity::Corrected;
    let materials = scene.materials.len();
    let tables = [
        ("shades", hits_are_shaded || cuts, job.shades.len()),
        ("glass", hits_are_shaded, job.glass.len()),
        ("shadow_glass", job.program.info().names("any_hit_shadow_glass"), job.shadow_glass.len()),
        ("surfaces", start.is_some(), start.map_or(0, |start| start.surfaces.len())),
        ("dielectrics", !job.dielectrics.is_empty(), job.dielectrics.len()),
    ];
    for (name, needed, found) in tables {
        if needed && found != materials {
            return Err(missing(backend, job, &format!("`{name}` has {found} entries for {materials} materials")));
        }
    }
    if hits_are_shaded && geometry.normals.len() != geometry.positions.len() {
        return Err(missing(backend, job, "it reads vertex normals, and the scene was prepared without"));
    }
    let sampled = |(_, shade): &(usize, &curitiba_pipeline::backend::Shade)| {
        shade.texture.is_some() && (hits_are_shaded || cuts && shade.alpha_cutoff.is_some())
    };
    for (material, shade) in job.shades.iter().enumerate().filter(sampled) {
        let name = &scene.materials[material].name;
        if shade.texture.is_some_and(|texture| texture as usize >= scene.textures.len()) {
            return Err(missing(backend, job, &format!("material `{name}` has a texture that was not loaded")));
        }
        if geometry.texcoords.len() != geometry.positions.len() {
            let why =
                format!("material `{name}` has a texture, and the scene was prepared without texture coordinates");
            return Err(missing(backend, job, &why));
        }
    }
    let tinted = |(_, shade): &(usize, &curitiba_pipeline::backend::Shade)| {
        shade.vertex_colors && (hits_are_shaded || cuts && shade.alpha_cutoff.is_some())
    };
    if let Some((material, _)) = job.shades.iter().enumerate().find(tinted)
        && geometry.colors.len() != geometry.positions.len()
    {
        let name = &scene.materials[material].name;
        let why = format!("material `{name}` has vertex colours, and the scene was prepared without");
        return Err(missing(backend, job, &why));
    }
    let mapped = job.shades.iter().enumerate().filter_map(|(material, shade)| Some((material, shade.normal_map?)));
    for (material, map) in mapped.filter(|_| hits_are_shaded) {
        let vertices = geometry.positions.len();
        let what = match () {
            () if map.texture as usize >= scene.textures.len() => "that texture",
            () if geometry.tangents.len() != vertices => "tangents",
            () if geometry.texcoords.len() != vertices => "texture coordinates",
            () => continue,
        };
        let name = &scene.materials[material].name;
        let why = format!("material `{name}` has a normal map, and the scene was prepared without {what}");
        return Err(missing(backend, job, &why));
    }
    let knows_all = geometry.spheres.is_empty() || spheres && job.fidelity == Fidelity::Corrected;
    if !knows_all {
        let why = "the scene has exact spheres, and it knows triangles only; in corrected fidelity the cpu, wgpu, cuda and optix know both";
        return Err(missing(backend, job, why));
    }
    let known = geometry.surfaces();
    if job.fidelity == Fidelity::Corrected && most_triangles(job.triangle) > known {
        return Err(missing(backend, job, &format!("the triangle ids name more than the scene's {known} triangles")));
    }
    Ok(())
}

/// Least number of triangles and exact spheres that a scene must have for these ids to be valid. Computed as a maximum, without an early exit, so
/// that it is vectorised.
fn most_triangles(shown: &[u32]) -> usize {
    const { assert!(NO_TRIANGLE.wrapping_add(1) == 0) }
    let most = shown.par_chunks(PART).map(|part| Detected::cached().run(Most(part))).max();
    most.unwrap_or(0) as usize
}

struct Most<'a>(&'a [u32]);

impl Kernel<u32> for Most<'_> {
    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> u32 {
        self.0.iter().fold(0, |most, id| most.max(id.wrapping_add(1)))
    }
}
