//! Ambient occlusion of a tile's pixels: neighbouring pixels share the triangles gathered around them.

use super::coverage::Coverage;
use super::pass::{Pass, Pixel};
use super::tile::{Area, TILE};
use super::tile_surfaces::Known;
use super::workspace::Workspace;
use crate::trace::{Hit, Tracer};
use curitiba_pipeline::executor::Progress;
use glam::Vec3;

/// Pixels along a side of the smallest square for which triangles are gathered.
const LEAST: usize = 2;
/// Pixels along a side of the squares for which a subset of the gathered triangles is picked.
const PART: usize = 4;
/// Extent of a square's ray origins, in units of the occlusion radius, above which the square is split in four: triangles near one origin are then
/// far from the others.
const EXTENT: f32 = 4.0;
/// Extent below which a square with too many triangles near it is not split, because its quarters have hardly fewer.
const CUT: f32 = 0.5;
/// A square part of a tile: its left column, its top row, and its side, in pixels.
type Square = [usize; 3];

/// Computes the occlusion of those pixels of a tile whose surfaces are known: from the triangles near them, or, where
/// these are too many, by rays through the tree.
pub(super) fn prepare<T: Tracer, C: Coverage>(
    pass: &Pass<'_, T, C>,
    area: Area,
    work: &mut Workspace,
    stops: impl Fn(&Hit) -> bool,
) {
    let Some(sampler) = &pass.occlusion else { return };
    // A square that is split adds three to the pending ones.
    let mut squares = [[0; 3]; 3 * TILE.ilog2() as usize + 1];
    squares[0] = [0, 0, TILE];
    let mut pending = 1;
    while pending > 0 {
        pending -= 1;
        let square = squares[pending];
        let Some(whole) = part(work, square) else { continue };
        let [left, top, side] = square;
        let extent = (whole.high - whole.low).max_element() / pass.job.params.radius;
        let rays = whole.pixels * sampler.samples() as usize;
        let around = pass.around([whole.low, whole.high], whole.above, 0.0, rays);
        if (extent <= EXTENT || side <= LEAST) && pass.tracer.gather(&around, &mut work.candidates) {
            let step = side.min(PART);
            for row in (top..top + side).step_by(step) {
                for column in (left..left + side).step_by(step) {
                    let square = [column, row, step];
                    if side > PART {
                        let Some(part) = part(work, square) else { continue };
                        work.candidates.narrow([part.low, part.high], part.above);
                    }
                    each(pass, area, square, true, work, &stops);
                }
            }
        } else if side > LEAST && extent > CUT {
            let half = side / 2;
            for quarter in [[0, 0], [half, 0], [0, half], [half, half]] {
                squares[pending] = [left + quarter[0], top + quarter[1], half];
                pending += 1;
            }
        } else {
            each(pass, area, square, false, work, &stops);
        }
    }
}

/// Computes the pixels of a square; `gathered` says whether the triangles near them were gathered.
fn each<T: Tracer, C: Coverage>(
    pass: &Pass<'_, T, C>,
    area: Area,
    square: Square,
    gathered: bool,
    work: &mut Workspace,
    stops: impl Fn(&Hit) -> bool,
) {
    for place in places(square) {
        // Checked at each pixel: with thousands of samples a pixel takes a tenth of a millisecond, and a tile 256 times as long.
        if pass.progress.is_some_and(Progress::is_cancelled) {
            return;
        }
        let Known { surface: Some((surface, _)), origin, .. } = *work.surfaces.at(place) else { continue };
        let (x, y) = (area.x + place % TILE, area.y + place / TILE);
        let key = pass.key(Pixel { x: x as u32, y: y as u32, index: y * area.stride + x });
        let open = pass.hemisphere(gathered, origin, &surface, key, work, &stops);
        work.surfaces.at_mut(place).occlusion = Some(open);
    }
}

/// What the occlusion rays of a square's pixels share: the bounds of their origins, and the geometric normal if it is the same for all pixels.
struct Part {
    pixels: usize,
    low: Vec3,
    high: Vec3,
    above: Option<Vec3>,
}

fn part(work: &Workspace, square: Square) -> Option<Part> {
    let mut part = Part { pixels: 0, low: Vec3::INFINITY, high: Vec3::NEG_INFINITY, above: None };
    for place in places(square) {
        let Known { surface: Some((surface, _)), origin, .. } = *work.surfaces.at(place) else { continue };
        (part.low, part.high) = (part.low.min(origin), part.high.max(origin));
        part.above = if part.pixels == 0 { Some(surface.facing) } else { part.above.filter(|n| *n == surface.facing) };
        part.pixels += 1;
    }
    (part.pixels > 0).then_some(part)
}

fn places([left, top, side]: Square) -> impl Iterator<Item = usize> {
    (0..side * side).map(move |index| (top + index / side) * TILE + left + index % side)
}
