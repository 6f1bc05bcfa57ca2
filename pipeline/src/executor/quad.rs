//! Quad passes: fill a rectangle from one texture, or from the product of two.

use crate::backend::Rect;
use crate::image::Image;
use crate::progress::Progress;
use crate::project::{ChannelRef, QuadSource};
use glam::Vec4;
use rayon::prelude::*;

/// Width, height and pixels of a channel.
type Source<'a> = (u32, u32, &'a [[f32; 4]]);

/// Fills `viewport` of `pixels`. A source of the viewport's size is copied texel by texel; any other source is filtered bilinearly. All
/// components are multiplied by the `x` of the factor or, with `by_color`, each component by the same component of the factor. The work may
/// be given up between rows.
pub(super) fn fill<'a>(
    pixels: &mut [[f32; 4]],
    width: u32,
    viewport: Rect,
    (source, by_color): (QuadSource, bool),
    progress: &Progress,
    channel: impl Fn(ChannelRef) -> Source<'a>,
) {
    match source {
        QuadSource::Show(shown) => {
            let read = reader(channel(shown), viewport);
            rows(pixels, width, viewport, progress, read);
        }
        QuadSource::Combine { color, factor } => {
            let (color, factor) = (reader(channel(color), viewport), reader(channel(factor), viewport));
            if by_color {
                let product = |x, y| (Vec4::from_array(color(x, y)) * Vec4::from_array(factor(x, y))).to_array();
                return rows(pixels, width, viewport, progress, product);
            }
            rows(pixels, width, viewport, progress, |x, y| {
                let factor = factor(x, y)[0];
                color(x, y).map(|value| value * factor)
            });
        }
        // Own shaders are run by the rasteriser instead.
        QuadSource::Own => {}
    }
}

fn rows(
    pixels: &mut [[f32; 4]],
    width: u32,
    viewport: Rect,
    progress: &Progress,
    pixel: impl Fn(u32, u32) -> [f32; 4] + Sync,
) {
    if viewport.width == 0 || viewport.height == 0 {
        return;
    }
    let width = width as usize;
    let rows = viewport.y as usize * width..(viewport.y + viewport.height) as usize * width;
    progress.start(u64::from(viewport.height));
    pixels[rows].par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        // Rows written after a cancellation would be thrown away.
        if progress.is_cancelled() {
            return;
        }
        let covered = &mut row[viewport.x as usize..(viewport.x + viewport.width) as usize];
        for (x, out) in covered.iter_mut().enumerate() {
            *out = pixel(x as u32, y as u32);
        }
        progress.advance(1);
    });
}

/// A function that samples a source at a pixel of the viewport.
fn reader<'a>((width, height, texels): Source<'a>, viewport: Rect) -> impl Fn(u32, u32) -> [f32; 4] + Sync + 'a {
    let exact = width == viewport.width && height == viewport.height;
    move |x, y| {
        if exact {
            texels[y as usize * width as usize + x as usize]
        } else {
            let (u, v) = ((x as f32 + 0.5) / viewport.width as f32, (y as f32 + 0.5) / viewport.height as f32);
            Image::bilinear(width, height, texels, u, v)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Cancellation;
    use std::sync::atomic::{AtomicU64, Ordering, fence};

    const A: ChannelRef = ChannelRef { target: 0, channel: 0 };
    const B: ChannelRef = ChannelRef { target: 1, channel: 0 };

    #[test]
    fn combine_multiplies_by_the_x_of_the_factor_or_by_its_colours_inside_the_viewport_only() {
        let color = vec![[0.2, 0.4, 0.6, 1.0]; 4];
        let factor = vec![[0.5, 2.5, 5.0, 2.0]; 4];
        let mut out = vec![[7.0; 4]; 16];
        let viewport = Rect { x: 1, y: 2, width: 2, height: 2 };
        let source = QuadSource::Combine { color: A, factor: B };
        for (by_color, product) in [(false, [0.1, 0.2, 0.3, 0.5]), (true, [0.1, 1.0, 3.0, 2.0])] {
            fill(&mut out, 4, viewport, (source, by_color), &Progress::default(), |channel| {
                (2, 2, if channel == A { color.as_slice() } else { factor.as_slice() })
            });
            for (index, pixel) in out.iter().enumerate() {
                let (x, y) = (index % 4, index / 4);
                let inside = (1..3).contains(&x) && (2..4).contains(&y);
                assert_eq!(*pixel, if inside { product } else { [7.0; 4] }, "at {x}, {y}");
            }
        }
    }

    #[test]
    fn threads_end_the_rows_that_they_are_at_when_it_is_given_up() {
        let stop = Cancellation::new();
        let progress = Progress::until(&stop);
        let asked = AtomicU64::new(u64::MAX);
        let mut out = vec![[0.0; 4]; 4 * 512];
        rows(&mut out, 4, Rect { x: 0, y: 0, width: 4, height: 512 }, &progress, |_, _| {
            if progress.get().0 >= 100 && asked.load(Ordering::SeqCst) == u64::MAX {
                stop.cancel();
                fence(Ordering::SeqCst);
                asked.store(progress.get().0, Ordering::SeqCst);
            }
            [1.0; 4]
        });
        let (asked, (end, total)) = (asked.into_inner(), progress.get());
        assert!(progress.is_given_up() && total == 512 && (100..400).contains(&asked), "{asked} of {total}");
        let threads = rayon::current_num_threads() as u64;
        assert!(end.saturating_sub(asked) <= threads, "{} rows more, by {threads} threads", end - asked);
        assert_eq!(out.iter().filter(|pixel| **pixel == [1.0; 4]).count() as u64, 4 * end);
    }

    #[test]
    fn a_source_of_the_same_size_is_copied_exactly_and_another_is_filtered() {
        let source: Vec<[f32; 4]> = (0..16).map(|i| [i as f32 * 0.1, 0.0, 0.0, 1.0]).collect();
        let mut out = vec![[0.0; 4]; 16];
        let whole = Rect { x: 0, y: 0, width: 4, height: 4 };
        fill(&mut out, 4, whole, (QuadSource::Show(A), false), &Progress::default(), |_| (4, 4, source.as_slice()));
        assert_eq!(out, source);
        let mut half = vec![[0.0; 4]; 4];
        let smaller = Rect { x: 0, y: 0, width: 2, height: 2 };
        fill(&mut half, 2, smaller, (QuadSource::Show(A), false), &Progress::default(), |_| (4, 4, source.as_slice()));
        assert!((half[0][0] - 0.25).abs() < 1e-6, "the mean of texels 0, 1, 4 and 5");
    }
}
