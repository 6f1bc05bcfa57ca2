//! Arguments that name a project or scene files, with their options.

use super::scene::SceneFlags;
use crate::pipeline::backend::Rect;
use crate::pipeline::color::{ColorSpace, Display, Tone};
use crate::pipeline::kept_scenes::KeptScenes;
use crate::pipeline::pixel_samples::PixelSamples;
use crate::pipeline::plan::Settings;
use crate::pipeline::programs::Fidelity;
use crate::{BackendChoice, Choice, Gpus, RasterChoice, fastest};
use clap::{Args, ValueEnum, ValueHint};
use std::path::PathBuf;

/// A project and what is asked of it.
#[derive(Debug, Args)]
pub struct ProjectArgs {
    /// The project file; or a scene file (.glb, .gltf, .obj, .cbo, .nbo, .3ds, .dae, .mesh.xml), or a folder of them, of which a project is made
    #[arg(value_name = "PROJECT.xml|SCENE", value_hint = ValueHint::AnyPath)]
    pub path: PathBuf,
    /// Scene files that are joined with the first
    #[arg(value_name = "SCENE", value_hint = ValueHint::FilePath)]
    pub more: Vec<PathBuf>,
    /// How a project is made of scene files.
    #[command(flatten)]
    pub scene: SceneFlags,
    /// Window size; render targets scale with it [default: the project's]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<[u32; 2]>,
    /// Camera of every pass [default: each pass's own]
    #[arg(long, value_name = "NAME")]
    pub camera: Option<String>,
    /// Pipeline to run [default: the project's]
    #[arg(long, value_name = "NAME")]
    pub pipeline: Option<String>,
    /// Rasteriser; auto takes a real GPU if there is one, else the cpu
    #[arg(long, value_enum, default_value_t = Raster::Auto)]
    pub raster: Raster,
    /// Ray backend; cuda and optix need an NVIDIA GPU and a build with the feature `cuda`, wgpu runs on any GPU; auto takes cuda if it is there, else
    /// wgpu on a real GPU, else the cpu; fastest measures all that are there, once on each machine, and takes the fastest
    #[arg(long, value_enum, default_value_t = Backend::Auto)]
    pub backend: Backend,
    /// Device of wgpu, for rasteriser and rays: a part of its name, or its place in `curitiba list`, from 0
    #[arg(long, value_name = "NAME", value_parser = crate::passes::raster::gpu::named)]
    pub adapter: Option<u8>,
    /// GPUs that share the rays of cuda and optix: a number, or all
    #[arg(long, value_name = "N", default_value_t = Gpus::default())]
    pub gpus: Gpus,
    /// The report's programs with their defects mended, or as they were written
    #[arg(long, value_enum, default_value_t = FidelityArg::Corrected)]
    pub fidelity: FidelityArg,
    /// What colours are: used as stored (report), or decoded from sRGB and shaded as linear radiance (linear)
    /// [default: the project's; linear where scene files are named]
    #[arg(long, value_name = "report|linear")]
    pub color: Option<ColorSpace>,
    /// With linear colours: stops that .png pictures are exposed by; 1 makes them twice as bright
    #[arg(long, value_name = "EV", default_value_t = 0.0, allow_hyphen_values = true, value_parser = Display::parse_exposure)]
    pub exposure: f32,
    /// With linear colours: the tone curve of .png pictures, none or reinhard
    #[arg(long, value_name = "NAME", default_value = Tone::None.name())]
    pub tone: Tone,
    /// Seed of the random numbers
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u32,
    /// Also write a texture of a render target, as .exr and made visible as .png; `all` writes every one
    #[arg(long, value_name = "TARGET")]
    pub show: Vec<String>,
    /// Set a parameter of a ray pass; `curitiba list` names them
    #[arg(long, value_name = "PASS.NAME=VALUE")]
    pub set: Vec<String>,
    /// Switch a pass off. A ray or effect pass then hands on the colour that it reads, or full light where it writes a share of light;
    /// a raster or quad pass draws nothing
    #[arg(long, value_name = "PASS")]
    pub off: Vec<String>,
    /// Render only these pixels of the window, the same as in the whole picture: column and row from the top left, and size
    #[arg(long, value_name = "X,Y,WxH", value_parser = parse_crop)]
    pub crop: Option<Rect>,
    /// Render in at most so many bands of rows, one after the other, the same picture in less memory [default: as many as
    /// --max-memory asks for]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub bands: Option<u32>,
    /// Samples of every pixel, 1, 2, 4, 8, 16, 32 or 64: every pass runs for each of them, and the picture is their mean, without stairs at
    /// edges. Of 16:0.02 rays are traced for four samples, and for the others where shadows, occlusion or glass differ by more than 0.02. The mean is of linear radiance with linear colours, before exposure and tone curve, else of display values as they are.
    /// Of --show, colours are averaged too; positions and normals are refused
    #[arg(long, value_name = "N[:TOLERANCE]", default_value_t = PixelSamples::ONE)]
    pub aa: PixelSamples,
    /// Threads of the cpu engines [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Most memory that the program may take, in bytes or with a unit: 512MiB, 8GiB
    #[arg(long, value_name = "BYTES", default_value = "8GiB", value_parser = parse_bytes)]
    pub max_memory: u64,
}

/// `--raster`.
#[expect(missing_docs, reason = "clap would print it as help of every value")]
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum Raster {
    Auto,
    Cpu,
    Wgpu,
}

impl Raster {
    /// The library's value for this argument.
    #[must_use]
    pub fn choice(self) -> RasterChoice {
        match self {
            Self::Auto => RasterChoice::Auto,
            Self::Cpu => RasterChoice::Cpu,
            Self::Wgpu => RasterChoice::Wgpu,
        }
    }
}

/// `--backend`.
#[expect(missing_docs, reason = "clap would print it as help of every value")]
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum Backend {
    Auto,
    Fastest,
    Cpu,
    Wgpu,
    Cuda,
    Optix,
}

impl Backend {
    /// The library's value for this argument; `None` for `fastest`, which must be measured.
    #[must_use]
    pub fn choice(self) -> Option<BackendChoice> {
        Some(match self {
            Self::Fastest => return None,
            Self::Auto => BackendChoice::Auto,
            Self::Cpu => BackendChoice::Cpu,
            Self::Wgpu => BackendChoice::Wgpu,
            Self::Cuda => BackendChoice::Cuda,
            Self::Optix => BackendChoice::Optix,
        })
    }

    /// `choice` with this ray backend. For `fastest` it calls [`fastest::choose`], which measures on the threads that exist at that
    /// moment.
    #[must_use]
    pub fn chosen(self, choice: Choice) -> Choice {
        self.choice().map_or_else(|| fastest::choose(choice), |backend| choice.traced_by(backend))
    }
}

/// `--fidelity`.
#[expect(missing_docs, reason = "clap would print it as help of every value")]
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum FidelityArg {
    Corrected,
    Thesis,
}

impl ProjectArgs {
    /// The settings of the plan.
    #[must_use]
    pub fn settings(&self) -> Settings {
        Settings {
            pipeline: self.pipeline.clone(),
            camera: self.camera.clone(),
            size: self.size,
            fidelity: match self.fidelity {
                FidelityArg::Corrected => Fidelity::Corrected,
                FidelityArg::Thesis => Fidelity::Thesis,
            },
            color: self.color,
            exposure: self.exposure,
            tone: self.tone,
            seed: self.seed,
            show: self.show.clone(),
            set: self.set.clone(),
            off: self.off.clone(),
            max_memory: self.max_memory,
            scene: self.scene.options(&self.more),
            crop: self.crop,
            bands: self.bands,
            aa: self.aa,
            preview: None,
            scenes: KeptScenes::default(),
        }
    }

    /// The choice of engines.
    #[must_use]
    pub fn choice(&self) -> Choice {
        let raster = self.raster.choice();
        self.backend.chosen(Choice { raster, gpus: self.gpus, adapter: self.adapter, ..Choice::default() })
    }
}

/// Parses `WIDTHxHEIGHT`.
///
/// # Errors
/// A message that says what would be valid.
pub fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let wrong = || format!("`{text}` is not WIDTHxHEIGHT, such as 1024x1024");
    let (width, height) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
    Ok([width.trim().parse().map_err(|_| wrong())?, height.trim().parse().map_err(|_| wrong())?])
}

fn parse_crop(text: &str) -> Result<Rect, String> {
    let wrong = || format!("`{text}` is not COLUMN,ROW,WIDTHxHEIGHT, such as 512,256,128x64");
    let (corner, size) = text.rsplit_once(',').ok_or_else(wrong)?;
    let ([x, y], [width, height]) = (parse_pixel(corner).map_err(|_| wrong())?, parse_size(size).map_err(|_| wrong())?);
    Ok(Rect { x, y, width, height })
}

/// Parses `COLUMN,ROW`.
///
/// # Errors
/// A message that says what would be valid.
pub fn parse_pixel(text: &str) -> Result<[u32; 2], String> {
    let wrong = || format!("`{text}` is not COLUMN,ROW, such as 512,300");
    let (x, y) = text.split_once(',').ok_or_else(wrong)?;
    Ok([x.trim().parse().map_err(|_| wrong())?, y.trim().parse().map_err(|_| wrong())?])
}

/// Parses a number of bytes, with or without a unit: `512MiB`.
///
/// # Errors
/// A message that says what would be valid.
pub fn parse_bytes(text: &str) -> Result<u64, String> {
    let wrong = || format!("`{text}` is not a number of bytes, such as 512MiB or 8GiB");
    let digits = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let shift = match unit.trim().to_ascii_lowercase().as_str() {
        "" | "b" => 0,
        "k" | "kib" => 10,
        "m" | "mib" => 20,
        "g" | "gib" => 30,
        _ => return Err(wrong()),
    };
    let number: u64 = number.parse().map_err(|_| wrong())?;
    number.checked_mul(1 << shift).ok_or_else(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_a_column_and_a_row() {
        assert_eq!(parse_pixel("3, 40"), Ok([3, 40]));
        assert!(parse_pixel("3").is_err() && parse_pixel("3x4").is_err() && parse_pixel("-1,2").is_err());
    }

    #[test]
    fn crops_are_a_corner_and_a_size() {
        assert_eq!(parse_crop("3, 40,5x6"), Ok(Rect { x: 3, y: 40, width: 5, height: 6 }));
        assert!(parse_crop("3,4").is_err() && parse_crop("3,4,5").is_err() && parse_crop("-3,4,5x6").is_err());
    }

    #[test]
    fn sizes_and_bytes_are_read_with_their_units() {
        assert_eq!(parse_size("640x480"), Ok([640, 480]));
        assert!(parse_size("640").is_err() && parse_size("axb").is_err() && parse_size("-1x2").is_err());
        assert_eq!(parse_bytes("512MiB"), Ok(512 << 20));
        assert_eq!(parse_bytes("1000"), Ok(1000));
        assert!(parse_bytes("8 parsecs").is_err() && parse_bytes("99999999999GiB").is_err());
    }
}
