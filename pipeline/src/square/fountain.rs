//! The fountain: octagonal steps, a round basin, a baluster that carries two bowls, and a finial.

use super::FOUNTAIN;
use super::detail::Detail;
use super::math::{noise, on_circle};
use super::mesh::{Builder, Frame};
use super::surface::Surface;
use glam::{Vec2, Vec3};

/// Builds the fountain.
pub(super) fn build(detail: Detail) -> Builder {
    let mut builder = Builder::default();
    let frame = Frame::upright(Vec3::new(FOUNTAIN.x, 0.0, FOUNTAIN.y));
    let round = detail.round(48);
    steps(&mut builder, &frame);
    basin(&mut builder, &frame, round, detail);
    shaft(&mut builder, &frame, detail);
    bowls(&mut builder, &frame, detail);
    finial(&mut builder, &frame, detail);
    jets(&mut builder, &frame, detail);
    builder
}

/// Three octagonal steps with a projecting nosing, the lowest 11.8 m across the flats.
fn steps(builder: &mut Builder, frame: &Frame) {
    // Radii to the corners.
    let mut outline = vec![(6.38, -0.03)];
    for step in 0..3 {
        let (radius, height) = (6.38 - 0.55 * step as f32, 0.17 * (step + 1) as f32);
        let inner = if step == 2 { 0.6 } else { radius - 0.55 };
        outline.extend([(radius, height - 0.06), (radius + 0.03, height - 0.05), (radius + 0.03, height - 0.01)]);
        outline.extend([(radius + 0.01, height), (inner, height)]);
    }
    builder.prism(Surface::Granite, frame, 8, &outline);
}

fn basin(builder: &mut Builder, frame: &Frame, round: u32, detail: Detail) {
    const FLOOR: f32 = 0.51;
    // Plinth, bulging wall, moulded rim, inner wall down to below the water.
    builder.turned(
        Surface::Granite,
        frame,
        round,
        &[
            &[(4.25, FLOOR), (4.25, FLOOR + 0.14)],
            &[(4.25, FLOOR + 0.14), (4.12, FLOOR + 0.20)],
            &[(4.06, FLOOR + 0.20), (4.15, FLOOR + 0.36), (4.15, FLOOR + 0.54), (4.04, FLOOR + 0.70)],
            &[(4.04, FLOOR + 0.70), (4.10, FLOOR + 0.72)],
            &[(4.10, FLOOR + 0.72), (4.24, FLOOR + 0.76), (4.30, FLOOR + 0.83), (4.28, FLOOR + 0.90)],
            &[(4.28, FLOOR + 0.90), (3.78, FLOOR + 0.90)],
            &[(3.78, FLOOR + 0.90), (3.74, FLOOR + 0.86), (3.74, FLOOR + 0.60)],
        ],
    );
    // Pilasters that divide the wall.
    for side in 0..if detail.at_least(1) { 12 } else { 0 } {
        let out = on_circle(2 * side + 1, 24);
        let pilaster = frame.turned(out.x, out.y);
        let (min, max) = (Vec3::new(-0.16, FLOOR + 0.14, 3.95), Vec3::new(0.16, FLOOR + 0.72, 4.21));
        let sides = super::mesh::Sides::ALL.without(super::mesh::Sides::BACK).without(super::mesh::Sides::BOTTOM);
        builder.cuboid(Surface::Granite, &pilaster, min, max, sides);
    }
    water(builder, frame, FLOOR + 0.68, 0.5, 3.75, detail);
}

/// A disc of water with rings of waves.
fn water(builder: &mut Builder, frame: &Frame, height: f32, inner: f32, outer: f32, detail: Detail) {
    let (columns, rows) = (detail.round((outer * 6.0) as u32 + 8), detail.curve((outer * 1.5) as u32 + 1));
    let wave = |at: Vec2| {
        let radius = at.length();
        let ring = super::math::cos_sin(f64::from(radius * 1.9)).0 as f32;
        0.006 * ring + 0.012 * (noise(at * 2.5 + Vec2::splat(32.0), 64, 7) - 0.5)
    };
    builder.grid(Surface::Water, columns, rows, |column, row| {
        let turn = on_circle(column, columns);
        let radius = outer + (inner - outer) * row as f32 / rows as f32;
        let at = Vec2::new(turn.y, turn.x) * radius;
        let step = 0.05;
        let slope = Vec2::new(
            wave(at + Vec2::X * step) - wave(at - Vec2::X * step),
            wave(at + Vec2::Y * step) - wave(at - Vec2::Y * step),
        ) / (2.0 * step);
        let normal = Vec3::new(-slope.x, 1.0, -slope.y).normalize();
        (frame.point(Vec3::new(at.x, height + wave(at), at.y)), normal, at)
    });
}

/// The baluster from the steps through the water to the lower bowl.
fn shaft(builder: &mut Builder, frame: &Frame, detail: Detail) {
    let round = detail.round(20);
    builder.prism(
        Surface::Granite,
        frame,
        8,
        &[(0.95, 0.5), (0.95, 1.34), (1.00, 1.36), (1.00, 1.46), (0.88, 1.52), (0.5, 1.52)],
    );
    builder.turned(
        Surface::Granite,
        frame,
        round,
        &[
            &[(0.66, 1.52), (0.70, 1.58), (0.66, 1.66)],
            &[(0.56, 1.66), (0.50, 1.72)],
            &[
                (0.40, 1.72),
                (0.42, 1.80),
                (0.54, 1.96),
                (0.58, 2.12),
                (0.50, 2.34),
                (0.36, 2.62),
                (0.30, 2.90),
                (0.31, 3.02),
            ],
            &[(0.40, 3.02), (0.43, 3.07), (0.40, 3.12)],
            &[(0.34, 3.12), (0.46, 3.24)],
        ],
    );
}

fn bowls(builder: &mut Builder, frame: &Frame, detail: Detail) {
    let round = detail.round(32);
    builder.turned(
        Surface::Granite,
        frame,
        round,
        &[
            &[(0.46, 3.24), (0.95, 3.30), (1.42, 3.46), (1.74, 3.70)],
            &[(1.74, 3.70), (1.82, 3.72), (1.86, 3.78), (1.84, 3.84)],
            &[(1.84, 3.84), (1.66, 3.84)],
            &[(1.66, 3.84), (1.60, 3.78), (1.50, 3.70)],
        ],
    );
    water(builder, frame, 3.79, 0.2, 1.62, detail);
    let round = detail.round(20);
    builder.turned(
        Surface::Granite,
        frame,
        round,
        &[
            &[(0.42, 3.70), (0.42, 3.90), (0.36, 3.96)],
            &[(0.26, 3.96), (0.35, 4.12), (0.36, 4.24), (0.26, 4.46), (0.20, 4.70)],
            &[(0.27, 4.70), (0.29, 4.74), (0.27, 4.78)],
            &[(0.24, 4.78), (0.56, 4.86), (0.82, 5.04)],
            &[(0.82, 5.04), (0.88, 5.07), (0.88, 5.12)],
            &[(0.88, 5.12), (0.76, 5.12), (0.70, 5.06)],
        ],
    );
    water(builder, frame, 5.09, 0.1, 0.75, detail);
}

/// A pine cone on a small pedestal under an iron armillary sphere.
fn finial(builder: &mut Builder, frame: &Frame, detail: Detail) {
    let round = detail.round(20);
    builder.turned(
        Surface::Granite,
        frame,
        round,
        &[
            &[(0.24, 5.05), (0.24, 5.22), (0.20, 5.28)],
            &[(0.14, 5.28), (0.20, 5.40), (0.19, 5.52), (0.12, 5.72), (0.10, 5.78)],
            &[(0.16, 5.78), (0.17, 5.81), (0.16, 5.84)],
            &[(0.10, 5.84), (0.19, 5.94), (0.21, 6.06), (0.15, 6.26), (0.05, 6.40), (0.0, 6.42)],
        ],
    );
    // Meridians and the equator, then the mast with a cross.
    let center = Vec3::new(0.0, 6.72, 0.0);
    let pieces = detail.round(12);
    for ring in 0..if detail.at_least(1) { 4 } else { 0 } {
        let side = on_circle(ring, 6);
        let path: Vec<(Vec3, f32)> = (0..=pieces)
            .map(|step| {
                let turn = on_circle(step, pieces);
                let way = if ring == 3 {
                    Vec3::new(turn.x, 0.0, turn.y)
                } else {
                    Vec3::new(turn.x * side.x, turn.y, turn.x * side.y)
                };
                (center + way * 0.30, 0.018)
            })
            .collect();
        builder.tube(Surface::Iron, frame, 4, &path);
    }
    let bar = |from: Vec3, to: Vec3| [(from, 0.022), (to, 0.022)];
    builder.tube(Surface::Iron, frame, 6, &bar(Vec3::new(0.0, 6.38, 0.0), Vec3::new(0.0, 7.45, 0.0)));
    builder.tube(Surface::Iron, frame, 6, &bar(Vec3::new(-0.14, 7.28, 0.0), Vec3::new(0.14, 7.28, 0.0)));
}

/// Water that falls in arcs from both bowls.
fn jets(builder: &mut Builder, frame: &Frame, detail: Detail) {
    let arcs = [(8, 1.86, 3.80, 2.95, 1.20, 0.030), (6, 0.88, 5.09, 1.32, 3.80, 0.020)];
    let pieces = detail.curve(7);
    for (count, from, top, to, bottom, radius) in arcs {
        for jet in 0..count {
            let out = on_circle(2 * jet + 1, 2 * count);
            let path: Vec<(Vec3, f32)> = (0..=pieces)
                .map(|step| {
                    let along = step as f32 / pieces as f32;
                    let reach = from + (to - from) * along;
                    // A parabola that leaves the lip level.
                    let height = top + (bottom - top) * along * along;
                    (Vec3::new(out.x * reach, height, out.y * reach), radius * (1.0 - 0.35 * along))
                })
                .collect();
            builder.tube(Surface::Spray, frame, detail.curve(4).clamp(3, 10), &path);
        }
    }
}
