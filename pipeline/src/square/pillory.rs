//! The pillory: a column on steps that stands before the town hall in old Portuguese towns.

use super::detail::Detail;
use super::mesh::{Builder, Frame};
use super::surface::Surface;
use glam::Vec3;

/// Builds the pillory at the origin.
pub(super) fn build(detail: Detail) -> Builder {
    let mut builder = Builder::default();
    let frame = Frame::upright(Vec3::ZERO);
    let mut outline = vec![(2.3, -0.03)];
    for step in 0..4 {
        let (radius, height) = (2.3 - 0.45 * step as f32, 0.2 * (step + 1) as f32);
        let inner = if step == 3 { 0.3 } else { radius - 0.45 };
        outline.extend([
            (radius, height - 0.05),
            (radius + 0.03, height - 0.04),
            (radius + 0.03, height),
            (inner, height),
        ]);
    }
    builder.prism(Surface::Granite, &frame, 8, &outline);
    builder.prism(Surface::Granite, &frame, 4, &[(0.62, 0.8), (0.62, 1.25), (0.52, 1.35), (0.3, 1.35)]);
    let round = detail.round(12);
    builder.turned(
        Surface::Granite,
        &frame,
        round,
        &[
            &[(0.38, 1.35), (0.42, 1.42), (0.38, 1.50)],
            &[(0.30, 1.50), (0.27, 1.62), (0.28, 3.0), (0.24, 4.4)],
            &[(0.32, 4.4), (0.34, 4.46), (0.30, 4.52)],
            &[(0.25, 4.52), (0.40, 4.74)],
        ],
    );
    builder.prism(Surface::Granite, &frame, 4, &[(0.60, 4.74), (0.60, 4.92), (0.5, 4.97), (0.2, 4.97)]);
    builder.turned(
        Surface::Granite,
        &frame,
        round,
        &[
            &[(0.30, 4.97), (0.24, 5.05)],
            &[(0.18, 5.05), (0.34, 5.24), (0.36, 5.40), (0.26, 5.60), (0.12, 5.68)],
            &[(0.14, 5.68), (0.16, 5.74), (0.05, 5.98), (0.0, 6.0)],
        ],
    );
    let at = Vec3::new;
    for (from, to) in [(at(-0.75, 4.62, 0.0), at(0.75, 4.62, 0.0)), (at(0.0, 4.62, -0.75), at(0.0, 4.62, 0.75))] {
        builder.tube(Surface::Iron, &frame, detail.curve(4), &[(from, 0.035), (to, 0.035)]);
    }
    builder
}
