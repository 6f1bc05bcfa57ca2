//! Comparing what is shown with something else.

use super::picture::Picture;
use curitiba::pipeline::color::{ColorSpace, Display, decode};
use curitiba::pipeline::executor::{Renderer, Silent};
use curitiba::pipeline::image::{Image, read_image};
use curitiba::pipeline::metrics::{Options, compare_with_map, heat_map};
use curitiba::pipeline::plan::OWN_BACKEND;
use curitiba::{BackendChoice, Choice};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What the picture is compared with.
#[derive(Debug, Clone, PartialEq)]
pub enum Other {
    /// A picture of a file.
    File(PathBuf),
    /// The picture as it was at a moment.
    Kept(Arc<Picture>),
    /// The result of the same settings on another ray backend.
    Backend(BackendChoice),
    /// The result, while an output is shown; or an output, by its full name.
    Output(Option<String>),
}

impl Other {
    /// What the window calls it.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::File(path) => {
                path.file_name().map_or_else(|| path.display().to_string(), |n| n.display().to_string())
            }
            Self::Kept(picture) => format!("{}, kept", picture.name),
            Self::Backend(backend) => format!("result on {}", backend.name()),
            Self::Output(name) => name.clone().unwrap_or_else(|| "result".to_owned()),
        }
    }
}

/// How far two pictures are apart: `docs/numerics.md`.
#[derive(Debug, Clone, PartialEq)]
pub struct Compared {
    /// Names of the two.
    pub names: [String; 2],
    /// Root mean square error of red, green and blue.
    pub rmse: f64,
    /// Largest difference of a value.
    pub max: f64,
    /// Mean FLIP error of what is displayed, 0 to 1.
    pub flip: f64,
    /// FLIP by pixel, from black for 0 to cream for 1.
    pub heat: Arc<Picture>,
}

/// Compares two pictures by the metrics of `curitiba compare`.
pub(super) fn compare(shown: &Picture, other: &Picture, display: Display) -> Result<Compared, String> {
    let options = Options { display, ..Options::default() };
    let (comparison, map) =
        compare_with_map(&shown.image, &other.image, &options).map_err(|error| error.to_string())?;
    Ok(Compared {
        names: [shown.name.clone(), other.name.clone()],
        rmse: comparison.rmse,
        max: comparison.max,
        flip: comparison.flip,
        heat: Arc::new(Picture::of_window("FLIP", heat_map(&map), Display::default())),
    })
}

/// A picture of a file in the colours of the project: display values are decoded for one of linear light.
pub(super) fn read(path: &Path, display: Display) -> Result<Picture, String> {
    let read = read_image(path).map_err(|error| error.to_string())?;
    let mut image: Image = read.image;
    if display.space == ColorSpace::Linear && read.space == Some(ColorSpace::Report) {
        for [r, g, b, _] in &mut image.pixels {
            [*r, *g, *b] = [*r, *g, *b].map(decode);
        }
    }
    Ok(Picture::of_window(Other::File(path.to_owned()).name(), image, display))
}

/// The result of the same settings on another ray backend, by a renderer of its own.
pub(super) fn on_backend(renderer: &Renderer, choice: Choice, backend: BackendChoice) -> Result<Picture, String> {
    let (project, mut settings) = (renderer.project().clone(), renderer.settings().clone());
    // Passes with a backend of their own have it, too.
    let own = format!(".{}=", OWN_BACKEND.name);
    settings.set.retain(|assignment| !assignment.contains(&own));
    let choice = choice.traced_by(backend);
    let mut other =
        curitiba::open_project(project, settings, choice, &mut Silent).map_err(|error| error.to_string())?;
    let image = other.frame(&mut Silent).map_err(|error| error.to_string())?;
    Ok(Picture::of_window(Other::Backend(backend).name(), image, other.plan().display))
}
