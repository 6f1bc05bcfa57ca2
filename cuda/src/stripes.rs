//! The rows of a picture that a GPU computes, and the launches that they are divided into.

use crate::layout::BLOCK_HEIGHT;
use curitiba_passes::effects::dielectric::ways_of_path;
use curitiba_passes::effects::disc_rays;
use curitiba_pipeline::backend::RayJob;
use std::ops::Range;

/// Greatest number of pixels of a launch, unless a single stripe has more. Long passes are split, so that no kernel exceeds a display
/// driver's time limit unless a pixel is very expensive, and so that progress is visible.
const PIXELS_OF_LAUNCH: u32 = 1 << 20;

/// Greatest number of rays from the visible points of a launch to disc lights, for the same reason as [`PIXELS_OF_LAUNCH`].
const DISC_RAYS_OF_LAUNCH: u32 = 1 << 26;

/// Greatest number of ways into which the paths of a launch split at glass, for the same reason as [`PIXELS_OF_LAUNCH`].
const WAYS_OF_LAUNCH: u32 = 1 << 21;

/// Consecutive rows of a picture that one GPU computes.
#[derive(Debug)]
pub(crate) struct Stripe<'a> {
    /// The first row.
    pub first_row: u32,
    /// Number of rows.
    pub rows: u32,
    /// The pixels of these rows in the picture; empty if the picture stays on the device.
    pub pixels: &'a mut [[f32; 4]],
}

impl Stripe<'_> {
    /// Indices of the stripe's pixels in a picture of `width` columns, row by row.
    pub fn range(&self, width: u32) -> Range<usize> {
        let first = self.first_row as usize * width as usize;
        first..first + self.rows as usize * width as usize
    }
}

/// Rows of a picture that one launch computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Launch {
    /// The first row.
    pub first_row: u32,
    /// Number of rows.
    pub rows: u32,
    /// Number of consecutive rows in a stripe.
    pub stripe: u32,
    /// Number of rows of other GPUs between two stripes.
    pub skipped: u32,
}

/// The launches for a share of a picture. All stripes have the same number of rows, except perhaps the last, and are equally far apart. Each
/// launch takes at least one stripe, and as many as `pixels` pixels allow, since part of the GPU idles at the end of a launch.
pub(crate) fn launches(stripes: &[Stripe<'_>], width: u32, pixels: u32) -> Vec<Launch> {
    let Some(first) = stripes.first() else { return Vec::new() };
    let (stripe, skipped) = match stripes.get(1) {
        Some(second) => (first.rows, second.first_row - first.first_row - first.rows),
        None => (BLOCK_HEIGHT, 0),
    };
    let all: u32 = stripes.iter().map(|stripe| stripe.rows).sum();
    let most = (pixels / width.max(1) / stripe).max(1) * stripe;
    let launch = |done: u32| Launch {
        first_row: first.first_row + done + done / stripe * skipped,
        rows: most.min(all - done),
        stripe,
        skipped,
    };
    (0..all).step_by(most as usize).map(launch).collect()
}

/// Greatest number of pixels of a launch of this job, unless a single stripe has more.
pub(crate) fn pixels_of_launch(job: &RayJob<'_>) -> u32 {
    let of_ways = match ways_of_path(job) {
        1 => PIXELS_OF_LAUNCH,
        ways => WAYS_OF_LAUNCH / ways,
    };
    PIXELS_OF_LAUNCH.min(DISC_RAYS_OF_LAUNCH / disc_rays(job).max(1)).min(of_ways)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn launches_cover_the_rows_of_a_share_once_and_in_order() {
        // Width, rows of a stripe, number of GPUs, rows of the picture.
        for (width, stripe, gpus, height) in
            [(1024, 1024, 1, 1024), (2048, 64, 3, 1500), (3, 8, 2, 1), (70_000, 16, 2, 99), (16_384, 40, 1, 333)]
        {
            let stripe = if gpus == 1 { height } else { stripe };
            for gpu in 0..gpus {
                let starts: Vec<u32> = (0..height).step_by(stripe as usize).skip(gpu).step_by(gpus).collect();
                let rows_from = |first_row: u32| stripe.min(height - first_row);
                let mut pixels: Vec<Vec<[f32; 4]>> =
                    starts.iter().map(|start| vec![[0.0; 4]; (rows_from(*start) * width) as usize]).collect();
                let stripes: Vec<Stripe<'_>> = starts
                    .iter()
                    .zip(&mut pixels)
                    .map(|(first_row, pixels)| Stripe { first_row: *first_row, rows: rows_from(*first_row), pixels })
                    .collect();
                let expected: Vec<u32> = starts.iter().flat_map(|start| *start..*start + rows_from(*start)).collect();
                assert!(launches(&stripes, width, 1).iter().all(|launch| launch.rows <= launch.stripe));
                let launches = launches(&stripes, width, PIXELS_OF_LAUNCH);
                let row = |launch: &Launch, row: u32| launch.first_row + row + row / launch.stripe * launch.skipped;
                let found: Vec<u32> =
                    launches.iter().flat_map(|launch| (0..launch.rows).map(move |index| row(launch, index))).collect();
                assert_eq!(found, expected, "{width} {stripe} {gpus} {height}");
                for launch in launches {
                    assert!(
                        launch.rows * width <= PIXELS_OF_LAUNCH.max(launch.stripe * width)
                            && launch.stripe % BLOCK_HEIGHT == 0
                    );
                }
            }
        }
    }
}
