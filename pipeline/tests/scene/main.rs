//! Scene files of every format: contents that are read, files that are refused and why, and the scenes that are built from them.

mod build;
mod cbo;
#[cfg(feature = "gltf")]
mod gltf;
#[cfg(feature = "gltf")]
mod normal_maps;
mod obj;
#[cfg(feature = "gltf")]
mod real;
#[path = "../scene_support/mod.rs"]
mod scene_support;
mod texture;
mod three_ds;
mod xml_text;
