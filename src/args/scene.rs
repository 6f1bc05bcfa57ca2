//! Arguments for projects made from scene files.

use crate::pipeline::project::{Effects, SceneOptions, Up};
use clap::Args;
use glam::{DVec3, Vec3};
use std::path::PathBuf;

/// How a project is made where scene files are named instead of one.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Where scene files are named instead of a project")]
pub struct SceneFlags {
    /// Effects: shadows, ao, glass, or none [default: shadows,ao, and glass if a material is glass]
    #[arg(long, value_name = "NAMES")]
    pub effects: Option<Effects>,
    /// Where the camera stands [default: the file's camera, or where all of the scene is seen]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = SceneOptions::parse_point)]
    pub look_from: Option<DVec3>,
    /// What the camera looks at [default: the centre of the scene]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = SceneOptions::parse_point)]
    pub look_at: Option<DVec3>,
    /// Vertical field of view [default: 45]
    #[arg(long, value_name = "DEGREES", value_parser = SceneOptions::parse_fov)]
    pub fov: Option<f32>,
    /// Direction in which the sun stands [default: the file's light, or behind the viewer's left shoulder]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = SceneOptions::parse_direction)]
    pub sun: Option<Vec3>,
    /// Axis of the scene files that points up: y, or z as in many files of 3D Studio and of CAD programs [default: y]
    #[arg(long, value_name = "AXIS")]
    pub up: Option<Up>,
    /// What is behind the scene, #rrggbb or three numbers from 0 to 1 [default: 0.6,0.7,0.8]
    #[arg(long, value_name = "COLOR", value_parser = SceneOptions::parse_color)]
    pub background: Option<Vec3>,
}

impl SceneFlags {
    /// The library's options; `more` are scene files in addition to the first.
    #[must_use]
    pub fn options(&self, more: &[PathBuf]) -> SceneOptions {
        SceneOptions {
            more: more.to_vec(),
            effects: self.effects,
            look_from: self.look_from,
            look_at: self.look_at,
            fov: self.fov,
            sun: self.sun,
            up: self.up.unwrap_or_default(),
            background: self.background,
        }
    }
}
