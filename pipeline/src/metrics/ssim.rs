//! Structural similarity (Wang, Bovik, Sheikh, Simoncelli: Image quality assessment, from error visibility to structural
//! similarity, IEEE Transactions on Image Processing 13(4), 2004), with the paper's window and constants.

use super::displayed;
use super::filter::{Kernel, Plane, bands};
use crate::image::Image;

/// Taps on each side of the centre of the 11 x 11 window.
const RADIUS: usize = 5;
/// Standard deviation of the window, pixels.
const SIGMA: f64 = 1.5;
/// `(K1 L)^2` and `(K2 L)^2` for a dynamic range L of 1.
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// Luminance of displayed values, with the weights of Rec. 709.
fn luminance(pixel: &[f32; 4]) -> f64 {
    0.2126 * displayed(pixel[0]) + 0.7152 * displayed(pixel[1]) + 0.0722 * displayed(pixel[2])
}

/// Largest window radius, up to [`RADIUS`], that fits into a side.
fn radius(side: usize) -> usize {
    RADIUS.min((side - 1) / 2)
}

/// Mean similarity over the windows that lie inside the picture; with a mask, only windows whose centre is in it. Along a side
/// below 11 pixels the window shrinks to the largest odd size that fits. If no pixel of the mask is the centre of a window, since
/// all lie near the edge, each pixel takes the nearest window.
///
/// The pictures are known to be comparable.
pub(super) fn mean(test: &Image, reference: &Image, mask: Option<&[bool]>) -> f64 {
    let (width, height) = (test.width as usize, test.height as usize);
    let (rx, ry) = (radius(width), radius(height));
    let inside = |x: usize, y: usize| (rx..width - rx).contains(&x) && (ry..height - ry).contains(&y);
    let values = map(test, reference);
    let sum = |chosen: &dyn Fn(usize, usize) -> Option<usize>| {
        let (mut sum, mut count) = (0.0, 0_u64);
        for y in 0..height {
            for index in (0..width).filter_map(|x| chosen(x, y)) {
                sum += values[index];
                count += 1;
            }
        }
        (sum, count)
    };
    let masked = |x: usize, y: usize| mask.is_none_or(|mask| mask[y * width + x]);
    let (mut total, mut count) = sum(&|x, y| (inside(x, y) && masked(x, y)).then_some(y * width + x));
    if count == 0 {
        let nearest = |x: usize, y: usize| y.clamp(ry, height - 1 - ry) * width + x.clamp(rx, width - 1 - rx);
        (total, count) = sum(&|x, y| masked(x, y).then(|| nearest(x, y)));
    }
    total / count as f64
}

/// The similarity of the window around every pixel. Windows over the edge repeat the outermost pixels; [`mean`] does not use them.
fn map(test: &Image, reference: &Image) -> Vec<f64> {
    let (width, height) = (test.width as usize, test.height as usize);
    let gauss = |x: f64| (-x * x / (2.0 * SIGMA * SIGMA)).exp();
    let across = Kernel::new(radius(width), gauss).normalised();
    let down = Kernel::new(radius(height), gauss).normalised();
    let parts = bands(height, |rows| {
        let moments = Plane::stack(width, height, &rows, down.radius(), |index| {
            let (t, r) = (luminance(&test.pixels[index]), luminance(&reference.pixels[index]));
            [t, r, t * t, r * r, t * r]
        });
        let moments = moments.map(|moment| moment.along_rows(&across));
        let mut out = Vec::with_capacity(rows.len() * width);
        let mut lines = moments.each_ref().map(|_| vec![0.0; width]);
        for y in rows.clone() {
            for (moment, line) in moments.iter().zip(&mut lines) {
                line.fill(0.0);
                moment.down_columns(y, &down, line);
            }
            let [t, r, tt, rr, tr] = &lines;
            out.extend((0..width).map(|x| similarity(t[x], r[x], tt[x], rr[x], tr[x])));
        }
        out
    });
    parts.concat()
}

/// SSIM of one window, from the means, the means of the squares and the mean of the product.
fn similarity(t: f64, r: f64, tt: f64, rr: f64, tr: f64) -> f64 {
    // Rounding can leave a variance slightly below 0.
    let (vt, vr, covariance) = ((tt - t * t).max(0.0), (rr - r * r).max(0.0), tr - t * r);
    (2.0 * t * r + C1) * (2.0 * covariance + C2) / ((t * t + r * r + C1) * (vt + vr + C2))
}
