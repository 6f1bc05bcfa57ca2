//! Metrics of two pictures, and reading pictures from files.

use super::picture::Picture;
use super::side::Side;
use curitiba::pipeline::color::{ColorSpace, Display, decode};
use curitiba::pipeline::image::{Image, read_image};
use curitiba::pipeline::metrics::{Options, compare_with_map, heat_map};
use std::path::Path;
use std::sync::Arc;

/// Metrics of two pictures: `docs/numerics.md`.
#[derive(Debug, Clone, PartialEq)]
pub struct Compared {
    /// Names of the two pictures.
    pub names: [String; 2],
    /// Root mean square error of red, green and blue.
    pub rmse: f64,
    /// Largest absolute difference of a red, green or blue value.
    pub max: f64,
    /// Mean FLIP error of the displayed colours, 0 to 1.
    pub flip: f64,
    /// FLIP by pixel, from black for 0 to cream for 1.
    pub heat: Arc<Picture>,
}

/// Compares the left picture with the right one, its reference, by the metrics of `curitiba compare`.
pub(super) fn compare(left: &Picture, right: &Picture, display: Display) -> Result<Compared, String> {
    let [left_size, right_size] = [left, right].map(|picture| [picture.image.width, picture.image.height]);
    if left_size != right_size {
        let [[width, height], [other, rows]] = [left_size, right_size];
        return Err(format!(
            "`{}` is {width} x {height} pixels and `{}` is {other} x {rows}: only pictures of one size can be compared; --size {other}x{rows} renders that size",
            left.name, right.name
        ));
    }
    let options = Options { display, ..Options::default() };
    let (comparison, map) = compare_with_map(&left.image, &right.image, &options)
        .map_err(|error| format!("`{}` and `{}`: {error}", left.name, right.name))?;
    Ok(Compared {
        names: [left.name.clone(), right.name.clone()],
        rmse: comparison.rmse,
        max: comparison.max,
        flip: comparison.flip,
        heat: Arc::new(Picture::of_window("FLIP", heat_map(&map), Display::default())),
    })
}

/// Reads a picture in the colours of the project: display values are decoded if the project has linear light.
pub(super) fn read(path: &Path, display: Display) -> Result<Picture, String> {
    let read = read_image(path).map_err(|error| error.to_string())?;
    let mut image: Image = read.image;
    if display.space == ColorSpace::Linear && read.space == Some(ColorSpace::Report) {
        for [r, g, b, _] in &mut image.pixels {
            [*r, *g, *b] = [*r, *g, *b].map(decode);
        }
    }
    Ok(Picture::of_window(Side::File(path.to_owned()).name(), image, display))
}
