//! Objects on the paving: lamps, benches, parasols with tables, bollards.

use super::FOUNTAIN;
use super::detail::Detail;
use super::math::on_circle;
use super::mesh::{Builder, Frame, Sides};
use super::surface::Surface;
use glam::{Vec2, Vec3};

/// A mesh that is stored once, and the places of its copies.
pub(super) struct Placed {
    pub name: &'static str,
    pub builder: Builder,
    pub places: Vec<Vec3>,
}

/// Builds all objects on the paving except the trees.
pub(super) fn build(detail: Detail) -> Vec<Placed> {
    let around = |radius: f32, count: u32, shift: u32| -> Vec<Vec3> {
        (0..count)
            .map(|index| {
                let at = FOUNTAIN + on_circle(2 * index + shift, 2 * count) * radius;
                Vec3::new(at.x, 0.0, at.y)
            })
            .collect()
    };
    let mut lamps = around(14.6, if detail.at_least(1) { 8 } else { 4 }, 1);
    if detail.at_least(1) {
        lamps.extend([(47.0, 5.0), (30.0, 29.0), (2.5, 26.0), (28.0, -18.0)].map(ground));
    }
    let bollards = around(12.8, if detail.at_least(1) { 16 } else { 8 }, 1);
    let along = [(8.4, 5.0), (8.8, 0.0), (36.6, 8.0), (36.9, 2.0), (36.2, -4.5)].map(ground).to_vec();
    let across = [(18.0, 17.2), (26.0, 17.2)].map(ground).to_vec();
    let parasols = [
        (12.0, 24.0),
        (16.4, 25.6),
        (20.6, 24.4),
        (13.6, 28.2),
        (33.2, 24.6),
        (37.2, 25.8),
        (7.0, -18.0),
        (11.2, -19.6),
        (10.6, -15.4),
    ]
    .map(ground)
    .to_vec();
    vec![
        Placed { name: "lamps", builder: lamp(detail), places: lamps },
        Placed { name: "bollards", builder: bollard(detail), places: bollards },
        Placed { name: "benches", builder: bench(false), places: along },
        Placed { name: "benches-across", builder: bench(true), places: across },
        Placed { name: "pillory", builder: super::pillory::build(detail), places: vec![ground((18.4, -17.8))] },
        Placed { name: "parasols", builder: parasol(detail), places: parasols },
    ]
}

fn ground((x, z): (f32, f32)) -> Vec3 {
    Vec3::new(x, 0.0, z)
}

fn lamp(detail: Detail) -> Builder {
    let mut builder = Builder::default();
    let frame = Frame::upright(Vec3::ZERO);
    let round = detail.curve(6);
    builder.prism(
        Surface::Granite,
        &frame,
        if detail.at_least(1) { 8 } else { 4 },
        &[(0.30, -0.03), (0.30, 0.22), (0.26, 0.26), (0.1, 0.26)],
    );
    builder.turned(
        Surface::Iron,
        &frame,
        round,
        &[
            &[(0.16, 0.26), (0.17, 0.34), (0.11, 0.46), (0.12, 0.80), (0.08, 0.92)],
            &[(0.07, 0.92), (0.05, 2.0), (0.045, 3.1)],
            &[(0.09, 3.1), (0.10, 3.15), (0.05, 3.22)],
        ],
    );
    builder.prism(Surface::Iron, &frame, 4, &[(0.06, 3.2), (0.17, 3.30), (0.19, 3.32), (0.19, 3.36)]);
    builder.prism(Surface::Lantern, &frame, 4, &[(0.17, 3.36), (0.27, 3.86)]);
    builder.prism(
        Surface::Iron,
        &frame,
        4,
        &[(0.25, 3.85), (0.31, 3.86), (0.31, 3.90), (0.16, 4.06), (0.05, 4.12), (0.04, 4.26), (0.0, 4.32)],
    );
    for edge in 0..if detail.at_least(1) { 4 } else { 0 } {
        let out = on_circle(2 * edge + 1, 8);
        let at = |radius: f32, height: f32| Vec3::new(out.x * radius, height, out.y * radius);
        builder.tube(Surface::Iron, &frame, 3, &[(at(0.175, 3.34), 0.018), (at(0.275, 3.88), 0.018)]);
    }
    builder
}

fn bollard(detail: Detail) -> Builder {
    let mut builder = Builder::default();
    let frame = Frame::upright(Vec3::ZERO);
    builder.turned(
        Surface::Granite,
        &frame,
        detail.curve(8),
        &[
            &[(0.20, -0.03), (0.20, 0.10)],
            &[(0.15, 0.10), (0.13, 0.52)],
            &[(0.16, 0.52), (0.17, 0.58), (0.13, 0.68), (0.0, 0.73)],
        ],
    );
    builder
}

/// A granite bench, its length along x if `across`, otherwise along z.
fn bench(across: bool) -> Builder {
    let mut builder = Builder::default();
    let frame = Frame::facing(Vec3::ZERO, if across { Vec3::Z } else { Vec3::X });
    let at = Vec3::new;
    builder.cuboid(Surface::Granite, &frame, at(-1.0, 0.42, -0.25), at(1.0, 0.52, 0.25), Sides::ALL);
    for x in [-0.78, 0.56] {
        let sides = Sides::ALL.without(Sides::TOP).without(Sides::BOTTOM);
        builder.cuboid(Surface::Granite, &frame, at(x, -0.03, -0.19), at(x + 0.22, 0.42, 0.19), sides);
    }
    builder
}

/// A square parasol over a table and four chairs.
fn parasol(detail: Detail) -> Builder {
    let mut builder = Builder::default();
    let frame = Frame::upright(Vec3::ZERO);
    let at = Vec3::new;
    builder.tube(Surface::Timber, &frame, 6, &[(at(0.0, 0.0, 0.0), 0.03), (at(0.0, 2.75, 0.0), 0.025)]);
    // Canvas, seen from above and from below, with a valance.
    let half = 2.05;
    builder.prism(Surface::Canvas, &frame, 4, &[(half, 2.02), (half, 2.20), (0.0, 2.82)]);
    for side in 0..4 {
        let (a, b) = (on_circle(2 * side + 1, 8) * half, on_circle(2 * side + 3, 8) * half);
        let corner = |turn: Vec2, height: f32| at(turn.y, height, turn.x);
        builder.polygon(Surface::Canvas, &frame, &[corner(b, 2.18), corner(a, 2.18), at(0.0, 2.80, 0.0)]);
    }
    let round = detail.round(10);
    builder.turned(
        Surface::PaintWhite,
        &frame,
        round,
        &[&[(0.0, 0.70), (0.48, 0.70)], &[(0.48, 0.70), (0.48, 0.74)], &[(0.48, 0.74), (0.03, 0.74)]],
    );
    for index in 0..if detail.at_least(1) { 4 } else { 0 } {
        let out = on_circle(index, 4);
        let chair = frame.moved(out.x * 0.8, 0.0, out.y * 0.8).turned(out.x, out.y);
        builder.cuboid(Surface::PaintGreen, &chair, at(-0.21, 0.42, -0.2), at(0.21, 0.46, 0.2), Sides::ALL);
        builder.cuboid(Surface::PaintGreen, &chair, at(-0.21, 0.50, 0.18), at(0.21, 0.86, 0.21), Sides::ALL);
        for (x, z) in [(-0.18, -0.17), (0.18, -0.17), (-0.18, 0.19), (0.18, 0.19)] {
            let leg = [(at(x, 0.0, z), 0.016), (at(x, 0.44, z), 0.016)];
            builder.tube(Surface::Iron, &chair, 3, &leg);
        }
    }
    builder
}
