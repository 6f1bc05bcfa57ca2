//! The arguments of `reference`.

use clap::{Args, ValueEnum, ValueHint};
use curitiba::args::{SceneFlags, parse_bytes, parse_size};
use curitiba::pipeline::color::ColorSpace;
use curitiba::pipeline::plan::Settings;
use curitiba::reference::{Of, PICTURE_SAMPLES};
use curitiba::shard::Request;
use std::path::PathBuf;

/// What `--of` may say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum OfArg {
    /// The picture, from the camera
    Picture,
    /// The effect, from the cpu rasteriser's G-buffer
    Effect,
}

impl From<OfArg> for Of {
    fn from(of: OfArg) -> Self {
        match of {
            OfArg::Picture => Self::Picture,
            OfArg::Effect => Self::Effect,
        }
    }
}

/// Arguments of `reference`.
#[derive(Debug, Args)]
pub struct ReferenceArgs {
    /// The project file; or a scene file, or a folder of them, of which a project is made
    #[arg(value_name = "PROJECT.xml|SCENE", value_hint = ValueHint::AnyPath)]
    pub path: PathBuf,
    /// Scene files that are joined with the first
    #[arg(value_name = "SCENE", value_hint = ValueHint::FilePath)]
    pub more: Vec<PathBuf>,
    #[command(flatten)]
    pub scene: SceneFlags,
    /// Window size [default: the project's]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<[u32; 2]>,
    /// Camera of every pass [default: each pass's own]
    #[arg(long, value_name = "NAME")]
    pub camera: Option<String>,
    /// Pipeline to run [default: the project's]
    #[arg(long, value_name = "NAME")]
    pub pipeline: Option<String>,
    /// What colours are: used as stored (report), or decoded from sRGB and shaded as linear radiance (linear) [default: the project's]
    #[arg(long, value_name = "report|linear")]
    pub color: Option<ColorSpace>,
    /// Set a parameter of a ray or effect pass
    #[arg(long, value_name = "PASS.NAME=VALUE")]
    pub set: Vec<String>,
    /// What it is the reference of
    #[arg(long, value_name = "WHAT", default_value = "picture")]
    pub of: OfArg,
    /// Samples of every pixel, a power of two from 64 to 65536; of the effect those of each of its two renders
    #[arg(long, value_name = "N", default_value_t = PICTURE_SAMPLES.0, value_parser = parse_samples)]
    pub samples: u32,
    /// Render a share of its blocks of samples alone: K/N, or auto or auto/N inside a scheduler. The same command without --shard joins them
    #[arg(long, value_name = "K/N|auto", conflicts_with = "output")]
    pub shard: Option<Request>,
    /// Also write the picture here, .png or .exr
    #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub output: Option<PathBuf>,
    /// Folder in which references are kept [default: CURITIBA_CACHE, or curitiba/references in the user's cache folder]
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub references: Option<PathBuf>,
    /// Threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Most memory that the program may take, in bytes or with a unit: 512MiB, 8GiB
    #[arg(long, value_name = "BYTES", default_value = "8GiB", value_parser = parse_bytes)]
    pub max_memory: u64,
}

impl ReferenceArgs {
    /// The settings of the project.
    pub fn settings(&self) -> Settings {
        Settings {
            pipeline: self.pipeline.clone(),
            camera: self.camera.clone(),
            size: self.size,
            color: self.color,
            set: self.set.clone(),
            max_memory: self.max_memory,
            scene: self.scene.options(&self.more),
            ..Settings::default()
        }
    }
}

fn parse_samples(text: &str) -> Result<u32, String> {
    let (least, most) = PICTURE_SAMPLES;
    let valid = |samples: &u32| samples.is_power_of_two() && (least..=most).contains(samples);
    let samples = text.parse().ok().filter(valid);
    samples.ok_or_else(|| format!("`{text}` is no number of samples; valid: powers of two from {least} to {most}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_powers_of_two() {
        assert_eq!(parse_samples("64"), Ok(64));
        assert_eq!(parse_samples("65536"), Ok(65_536));
        for wrong in ["63", "32", "96", "131072", "", "-64", "4294967296"] {
            assert!(parse_samples(wrong).is_err_and(|error| error.contains("64 to 65536")), "{wrong}");
        }
    }
}
