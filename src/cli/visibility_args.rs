//! The arguments of `visibility`.

use clap::{Args, ValueEnum, ValueHint};
use curitiba::args::{Backend, parse_bytes};
use curitiba::passes::visibility::{Effort, Facing, Options, Sampler};
use std::path::PathBuf;

/// Arguments of `visibility`.
#[derive(Debug, Args)]
pub struct VisibilityArgs {
    /// Scene files (.cbo, .nbo, .obj, .gltf, .glb, .3ds, .dae, .mesh.xml), merged; or one project (.xml), of which all scenes are taken
    #[arg(value_name = "SCENE|PROJECT", value_hint = ValueHint::FilePath, required = true)]
    pub files: Vec<PathBuf>,
    /// Which pairs: near[:SHARE] (those that face each other and of which one may send the other at least this share of what
    /// leaves it, by a bound), all, row:ID (one triangle with every other), or a file with two ids a line
    #[arg(long, value_name = "near[:SHARE]|all|row:ID|FILE", default_value = "near:0.01", value_parser = parse_pairs)]
    pub pairs: Pairs,
    /// Segments of a pair that is not decided exactly: a multiple of 8, up to 65536
    #[arg(long, value_name = "N", default_value_t = 64, conflicts_with = "error")]
    pub samples: u32,
    /// Twice as many segments from 64 on until the standard error is at most this, or there are 65536
    #[arg(long, value_name = "E")]
    pub error: Option<f64>,
    /// Segments that do not leave the front of both: left out, or counted as blocked
    #[arg(long, value_enum, default_value_t = FacingArg::Skip)]
    pub facing: FacingArg,
    /// What is wanted; form-factor writes both
    #[arg(long, value_enum, default_value_t = Quantity::Visibility)]
    pub quantity: Quantity,
    /// Points of the segments
    #[arg(long, value_enum, default_value_t = SamplerArg::Sobol)]
    pub sampler: SamplerArg,
    /// Seed of the points
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u32,
    /// What traces the segments of pairs with much in between; auto is cuda where there is an NVIDIA GPU, else the processor. Rows of
    /// cpu and cuda are the same; those of optix and wgpu may differ where a segment grazes an edge
    #[arg(long, value_enum, default_value_t = Backend::Auto)]
    pub backend: Backend,
    /// The rows: .csv or .npy
    #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub output: PathBuf,
    /// Go on with a run that was interrupted; the file is the same as without the interruption
    #[arg(long)]
    pub resume: bool,
    /// Print the summary as JSON
    #[arg(long)]
    pub json: bool,
    /// Threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Most memory that the scene may take, in bytes or with a unit: 512MiB, 8GiB
    #[arg(long, value_name = "BYTES", default_value = "8GiB", value_parser = parse_bytes)]
    pub max_memory: u64,
}

/// `--pairs`.
#[derive(Debug, Clone, PartialEq)]
pub enum Pairs {
    Near(f64),
    All,
    Row(u32),
    File(PathBuf),
}

/// `--facing`.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum FacingArg {
    Skip,
    Zero,
}

/// `--quantity`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Quantity {
    Visibility,
    FormFactor,
}

/// `--sampler`.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum SamplerArg {
    /// Owen-scrambled Sobol points in four dimensions
    Sobol,
    /// Hammersley points with the rotation of Cranley and Patterson
    Hammersley,
}

impl VisibilityArgs {
    /// The library's options for these arguments.
    pub fn options(&self) -> Options {
        Options {
            effort: self.error.map_or(Effort::Samples(self.samples), Effort::Error),
            facing: match self.facing {
                FacingArg::Skip => Facing::Skip,
                FacingArg::Zero => Facing::Zero,
            },
            sampler: match self.sampler {
                SamplerArg::Sobol => Sampler::Sobol,
                SamplerArg::Hammersley => Sampler::Hammersley,
            },
            form_factors: self.quantity == Quantity::FormFactor,
            seed: self.seed,
        }
    }
}

fn parse_pairs(text: &str) -> Result<Pairs, String> {
    let share = |text: &str| match text.parse() {
        Ok(share) if share > 0.0 && share <= 1.0 => Ok(Pairs::Near(share)),
        _ => Err(format!("`{text}` is not a share above 0 and up to 1, such as near:0.01")),
    };
    match text.split_once(':') {
        _ if text == "all" => Ok(Pairs::All),
        _ if text == "near" => share("0.01"),
        Some(("near", least)) => share(least),
        Some(("row", id)) => {
            id.parse().map(Pairs::Row).map_err(|_| format!("`{id}` is not the id of a triangle, such as row:14"))
        }
        _ => Ok(Pairs::File(PathBuf::from(text))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_a_word_with_a_number_or_a_file() {
        assert_eq!(parse_pairs("near"), Ok(Pairs::Near(0.01)));
        assert_eq!(parse_pairs("near:0.5"), Ok(Pairs::Near(0.5)));
        assert_eq!(parse_pairs("row:7"), Ok(Pairs::Row(7)));
        assert_eq!(parse_pairs("all"), Ok(Pairs::All));
        assert_eq!(parse_pairs("C:\\list.csv"), Ok(Pairs::File("C:\\list.csv".into())));
        for wrong in ["near:0", "near:2", "near:NaN", "near:x", "row:-1", "row:"] {
            assert!(parse_pairs(wrong).is_err(), "{wrong}");
        }
    }
}
