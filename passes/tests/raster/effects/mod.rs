//! The raster effects on the processor, against closed forms and against ray programs that compute the same.

mod cubes;
mod jobs;
mod mirrors;
mod occlusion;
mod oracle;
mod planes;
mod screen;
mod shadows;
mod soft;
mod square;
pub mod world;
