//! The program for one light that is a disc (`effects::sun`) instead of a point.

use super::light::{is_lit, side};
use crate::effects::light::SHADOWED;
use crate::effects::sun::LitSide;
use crate::effects::{Coverage, Pass, Pixel, Workspace, opaque};
use crate::trace::Tracer;
use glam::Vec3;

/// The light's share, alpha 1: [`SHADOWED`] where all of the disc is hidden, 1 where all of it is seen. As
/// [`corrected::pixel`](super::corrected::pixel) where the disc is a point.
///
/// # Panics
/// If the pass has no disc.
pub fn pixel<T: Tracer, C: Coverage>(pass: &Pass<'_, T, C>, pixel: Pixel, work: &mut Workspace) -> [f32; 4] {
    let Some(triangle) = pass.triangle(pixel).filter(|_| is_lit(pass, pixel)) else { return [1.0; 4] };
    let point = &pass.point_at(pixel, triangle);
    let side = LitSide { point, facing: point.normal * side(pass, triangle, point), triangle };
    let disc = pass.disc_of_sun(pass.key(pixel), side).expect("the program of passes with a disc");
    let buffers = (&mut work.disc, &mut work.rays.shadow);
    let share = pass.disc_share((&disc, SHADOWED), buffers, |hit| pass.covers(hit), |_, hit, _| pass.covers(hit));
    opaque(Vec3::splat(share))
}
