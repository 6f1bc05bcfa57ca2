//! The interface between the executor and its engines: rasterisers ([`Rasteriser`]) and ray tracers ([`RayBackend`]).
//!
//! Each trait has a file. The other files hold the arguments and results: jobs (`*_job`, `own_shaders`) with their cameras, lights and
//! materials (`view`, `light`, `shade`), statistics (`ray_stats`, or in the file of the job), devices and errors. Engines implement the
//! traits, and the executor calls them. This module may use scenes, images, G-buffers and tables of programs, but no projects, plans or
//! engines.

mod device;
mod effect_job;
mod error;
mod light;
mod own_shaders;
mod raster_job;
mod rasteriser;
mod ray_backend;
mod ray_job;
mod ray_stats;
mod shade;
mod view;

pub use crate::gbuffer::{Attachments, GBuffer, NO_TRIANGLE, Rect, drawn_part};
pub use crate::programs::Query;
pub use device::{Gpu, Limits};
pub use effect_job::{Answers, EffectJob, EffectStats, Part};
pub use error::BackendError;
pub use light::{Arriving, Cone, LEAST_DIVISOR, Light};
pub use own_shaders::{ComputeJob, MipLevel, OwnMaterial, OwnShaders, OwnTexture, QuadJob, QuadTexture};
pub use raster_job::{DrawStats, HandOver, LoadStore, RasterJob};
pub use rasteriser::Rasteriser;
pub use ray_backend::RayBackend;
pub use ray_job::{FromCamera, IntersectionJob, NO_HIT, RayJob};
pub use ray_stats::{BuildStats, PathsSpent, PhotonCounts, RayCounts, RayStats};
pub use shade::{Glow, NormalMap, Shade};
pub use view::{Lamp, PixelCone, Sun, View};
