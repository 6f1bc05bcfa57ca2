//! Code that the raster effects of both rasterisers share: the cameras of maps, and lookups in maps.
//!
//! Everything here is a pure function of the job, so that the rasterisers agree up to rounding:
//!
//! - [`cascades`], [`shadow`]: the number of depth maps, the map that serves a pixel, the maps' cameras, and the shadow
//!   test.
//! - [`panes`], [`cube`]: the panes that get a cube map, the cameras of the map, and the lookup of a direction.
//! - [`proxy`]: boxes that approximate a cube map's surroundings, for lookups from places other than the map's centre
//!   (parallax correction).
//! - [`planes`], [`mirrors`]: the planes that flat glass lies in, the choice of planes that mirror, and the cameras
//!   mirrored at them.
//! - [`screen`]: the surfaces of the picture that rays from glass hit.
//! - [`filter`]: averages the noise of ambient occlusion, and of ray passes, over surfaces.
//! - [`occlusion`]: the screen-space ambient occlusion of a pixel.
//!
//! # Pixels that an effect leaves alone
//! The rules are those of the ray programs in corrected fidelity. `shadowMap` writes 1 where the position's `w` is not above 0
//! (background, and surfaces facing away from the light). The occlusions write 1 where the normal is 0 (background).
//! Cube maps, mirrors and screen-space rays keep the colour of pixels that are not glass; mirrors also keep the colour of
//! glass without a mirror. Alpha is 1 except for kept colours, and for pixels that are left to rays (`Answers::LEFT`).
//!
//! # Differences from the ray programs
//! - The geometric normal is unknown: sides and slopes are those of the shading normal.
//! - Cube maps show the world from the centre of a pane, shaded as in the G-buffer (stored normals, filtered textures,
//!   emission), and without glass.
//! - Mirrors show the hits of rays that are mirrored once, shaded as in the G-buffer, and without glass.
//! - Occlusions know only the surfaces that the camera sees.

pub mod bounds;
pub mod cascades;
pub mod cube;
pub mod filter;
pub mod mirrors;
pub mod occlusion;
pub mod panes;
pub mod planes;
pub mod proxy;
pub mod screen;
pub mod shadow;
pub mod soft;

use bounds::Bounds;
use curitiba_pipeline::backend::EffectJob;
use curitiba_pipeline::image::Image;
use curitiba_pipeline::memory::Refused;
use curitiba_pipeline::raster_effects::{EFFECT_PARAMS, EffectParams, EffectProgram};
use curitiba_pipeline::scene::RenderScene;
use glam::Vec3;
use panes::Pane;
use planes::Glazing;
use proxy::Proxy;
use std::sync::{Arc, Weak};

/// Greatest number of bytes that the maps of one effect may take.
pub const MAX_MAP_BYTES: u64 = 4 << 30;

/// Data that effects derive from a scene, computed on first use and kept until another scene is uploaded. What depends on glass is also dropped when
/// other materials are glass.
#[derive(Debug, Default)]
pub struct SceneCache {
    /// A weak reference: it keeps the scene's address from being reused, but not the scene alive.
    scene: Weak<RenderScene>,
    bounds: Option<Bounds>,
    glass: Vec<bool>,
    panes: Option<Vec<Pane>>,
    glazing: Option<Glazing>,
    /// The proxies computed so far, by index of the pane.
    proxies: std::collections::BTreeMap<u32, Proxy>,
}

impl SceneCache {
    /// An empty cache for an uploaded scene.
    #[must_use]
    pub fn new(scene: &Arc<RenderScene>) -> Self {
        Self { scene: Arc::downgrade(scene), ..Self::default() }
    }

    /// Whether the cache belongs to this scene.
    #[must_use]
    pub fn is_of(&self, scene: &RenderScene) -> bool {
        std::ptr::eq(self.scene.as_ptr(), scene)
    }

    /// The box around the scene's triangles; [`Bounds::EMPTY`] if there are none. The cache must belong to `scene`.
    pub fn bounds(&mut self, scene: &RenderScene) -> Bounds {
        *self.bounds.get_or_insert_with(|| Bounds::of_scene(&scene.geometry))
    }

    /// The panes of the glass materials; computed again only if `glass` differs from the last call's.
    pub fn panes(&mut self, scene: &RenderScene, glass: &[bool]) -> &[Pane] {
        self.look_for(glass);
        self.panes.get_or_insert_with(|| panes::find(&scene.geometry, glass))
    }

    /// Gives probes the proxies of their panes; `look` computes a proxy that is not cached. The cache is by pane index, so
    /// the probes must be of the panes that [`Self::panes`] returned last.
    ///
    /// # Errors
    /// The errors of `look`.
    pub fn add_proxies<E>(
        &mut self,
        probes: &mut [panes::Probe],
        mut look: impl FnMut(&panes::Probe) -> Result<Proxy, E>,
    ) -> Result<(), E> {
        for probe in probes {
            let proxy = match self.proxies.get(&probe.pane) {
                Some(proxy) => *proxy,
                None => look(probe)?,
            };
            self.proxies.insert(probe.pane, proxy);
            probe.proxy = Some(proxy);
        }
        Ok(())
    }

    /// The planes of the glass materials; computed again only if `glass` differs from the last call's.
    ///
    /// # Errors
    /// If there is not enough memory.
    pub fn glazing(&mut self, scene: &RenderScene, glass: &[bool]) -> Result<&Glazing, Refused> {
        self.look_for(glass);
        match &mut self.glazing {
            Some(glazing) => Ok(glazing),
            none => Ok(none.insert(Glazing::find(&scene.geometry, glass)?)),
        }
    }

    /// Clears the results that depend on glass, if `glass` has changed.
    fn look_for(&mut self, glass: &[bool]) {
        if self.glass != glass {
            (self.panes, self.glazing) = (None, None);
            self.proxies.clear();
            self.glass.clear();
            self.glass.extend_from_slice(glass);
        }
    }
}

/// Refuses jobs whose parts do not fit together, or whose parameters are invalid. With `own_copy` the rasteriser reads
/// its own G-buffer, so the job's slices may be empty.
///
/// # Errors
/// The message says what is wrong, and what would be valid.
pub fn check(job: &EffectJob<'_>, output: Option<&Image>, own_copy: bool) -> Result<(), String> {
    let pixels = job.width as usize * job.height as usize;
    if let Some(output) = output
        && ((output.width, output.height) != (job.width, job.height) || output.pixels.len() != pixels)
    {
        let (width, height) = (output.width, output.height);
        return Err(format!("the output has {width} x {height} pixels, the job {} x {}", job.width, job.height));
    }
    let info = job.program.info();
    if info.params.contains(&"mapsize") && job.params.map_size == 0 {
        return Err(
            "`mapsize` is 0, which a plan replaces by what fits the picture; valid for a job: 16..=16384".to_owned()
        );
    }
    for name in info.params {
        let mut params = EffectParams::default();
        params.set(name, &job.params.get(name)).map_err(|why| format!("{why}, not {}", job.params.get(name)))?;
    }
    if job.params.leaves_to_rays(job.program) && !job.program.marches() && job.params.sun > 0.0 {
        return Err(format!("border=rays is for hard shadows; valid: `sun` 0, not {}", job.params.sun));
    }
    debug_assert!(info.params.iter().all(|name| EFFECT_PARAMS.iter().any(|param| param.name == *name)));
    if own_copy {
        return Ok(());
    }
    let reads = |name: &str| info.buffers.contains(&name);
    let sizes = [
        ("pos_buffer", reads("pos_buffer"), job.position.len()),
        ("norm_buffer", reads("norm_buffer"), job.normal.len()),
        ("color_buffer", reads("color_buffer"), job.color.len()),
        ("the triangle ids", info.glass && job.glass.contains(&true), job.triangle.len()),
    ];
    match sizes.into_iter().find(|(_, read, len)| *read && *len != pixels) {
        Some((name, _, len)) => Err(format!("{name} has {len} pixels; the job has {pixels}")),
        None => Ok(()),
    }
}

/// Refuses a program's maps if they would take too much memory.
///
/// # Errors
/// The message says how much memory the maps would take, and which parameters to lower.
pub fn check_map_bytes(program: EffectProgram, bytes: u64) -> Result<(), String> {
    if bytes <= MAX_MAP_BYTES {
        return Ok(());
    }
    let gib = |bytes: u64| bytes as f64 / f64::from(1 << 30);
    let limit = gib(MAX_MAP_BYTES);
    let lower = match program {
        EffectProgram::ShadowMap => "`mapsize` or `cascades`",
        EffectProgram::PlanarReflection => "`planes`, or render fewer pixels",
        _ => "`mapsize` or `probes`",
    };
    Err(format!("its maps would take {:.1} GiB, the limit is {limit} GiB; lower {lower}", gib(bytes)))
}

/// The unit direction from the eye to a position, and the unit normal, negated if it points away from the eye. `None` where the normal is 0,
/// or the position is the eye's or NaN.
#[must_use]
pub fn facing(eye: Vec3, position: Vec3, normal: Vec3) -> Option<(Vec3, Vec3)> {
    let view = (position - eye).try_normalize()?;
    let normal = normal.try_normalize()?;
    Some((view, if normal.dot(view) > 0.0 { -normal } else { normal }))
}

#[cfg(test)]
mod tests;
