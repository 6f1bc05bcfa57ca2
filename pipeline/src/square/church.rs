//! A granite church with a bell tower, behind the houses.

use super::detail::Detail;
use super::facade::{self, Opening};
use super::mesh::{Builder, Frame, Sides};
use super::roof::{self, Slope};
use super::surface::Surface;
use glam::{Vec2, Vec3};

const TOWER: f32 = 6.0;

/// Builds the church with the left end of its front at `frame`; returns the slopes of the nave's roof.
pub(super) fn build(builder: &mut Builder, frame: &Frame, detail: Detail) -> Vec<Slope> {
    let at = Vec3::new;
    // Nave, its ridge along the depth: a house seen from its gable.
    let (width, depth, height) = (12.0, 26.0, 11.5);
    let walls = Sides::LEFT.and(Sides::RIGHT).and(Sides::BACK).and(Sides::FRONT);
    builder.cuboid(Surface::PlasterWhite, frame, at(0.0, 0.0, -depth), at(width, height, 0.0), walls);
    for x in [0.0, width - 0.7] {
        builder.cuboid(Surface::Granite, frame, at(x, 0.0, 0.0), at(x + 0.7, height, 0.12), Sides::ALL);
    }
    let rose = Opening::arch(width / 2.0, 2.6, 7.2, 10.6);
    facade::surround(builder, frame, &rose, [0.3, 0.1], false, detail.curve(8));
    builder.rectangle(Surface::Room, frame, rose.min, Vec2::new(rose.max.x, rose.max.y - 1.3), 0.03);
    let side = frame.moved(0.0, height, -depth).turned(-1.0, 0.0);
    facade::moulding(
        builder,
        Surface::Granite,
        &side,
        [0.0, depth],
        &[(0.0, -0.5), (0.15, -0.4), (0.35, -0.1), (0.35, 0.0)],
    );
    let wall = Surface::PlasterWhite;
    let roof = roof::Roof { size: [depth, width], rise: 0.5, kind: roof::Kind::Gable, wall, seed: 5 };
    let slopes = roof::build(builder, &side, &roof, detail);
    tower(builder, &frame.moved(width, 0.0, 0.6), detail);
    slopes
}

/// A square tower with arched belfry openings on all sides, a balustrade with pinnacles, and a spire.
fn tower(builder: &mut Builder, frame: &Frame, detail: Detail) {
    let at = Vec3::new;
    let (shaft, belfry) = (17.0, 23.0);
    let arc = detail.curve(8);
    for (x, z, out_x, out_z) in
        [(0.0, 0.0, 0.0, 1.0), (TOWER, -TOWER, 0.0, -1.0), (0.0, -TOWER, -1.0, 0.0), (TOWER, 0.0, 1.0, 0.0)]
    {
        let side = frame.moved(x, 0.0, z).turned(out_x, out_z);
        let clock = Opening::arch(TOWER / 2.0, 1.0, 12.6, 14.4);
        let bell = Opening::arch(TOWER / 2.0, 2.0, shaft + 0.9, belfry - 0.9);
        facade::wall(builder, Surface::Ashlar, &side, Vec2::new(TOWER, belfry), &[clock, bell], arc);
        for (opening, back) in [(clock, -0.5), (bell, -0.8)] {
            facade::surround(builder, &side, &opening, [0.28, 0.08], false, arc);
            facade::reveal(builder, Surface::Granite, &side, &opening, [0.08, back], true, arc);
        }
        builder.rectangle(Surface::Room, &side, clock.min, clock.max, -0.5);
        for (from, to) in [(0.0, 0.7), (TOWER - 0.7, TOWER)] {
            let faces = Sides::FRONT.and(Sides::LEFT).and(Sides::RIGHT);
            builder.cuboid(Surface::Granite, &side, at(from, 0.0, 0.0), at(to, belfry, 0.1), faces);
        }
        for y in [shaft, belfry] {
            let profile = [(0.08, -0.5), (0.2, -0.42), (0.45, -0.12), (0.5, -0.08), (0.5, 0.1), (0.1, 0.14)];
            facade::moulding(builder, Surface::Granite, &side.moved(0.0, y, 0.0), [-0.5, TOWER + 0.5], &profile);
        }
        // Balustrade.
        let rail = side.moved(0.0, belfry + 0.1, 0.1);
        builder.cuboid(Surface::Granite, &rail, at(0.0, 0.75, -0.2), at(TOWER, 0.95, 0.05), Sides::ALL);
        for index in 1..if detail.at_least(1) { 10 } else { 1 } {
            let x = TOWER * index as f32 / 10.0;
            builder.cuboid(
                Surface::Granite,
                &rail,
                at(x - 0.09, 0.0, -0.16),
                at(x + 0.09, 0.75, 0.0),
                Sides::ALL.without(Sides::TOP).without(Sides::BOTTOM),
            );
        }
    }
    let center = frame.moved(TOWER / 2.0, 0.0, -TOWER / 2.0);
    builder.rectangle_up(
        Surface::Granite,
        &center,
        Vec2::splat(-TOWER / 2.0 - 0.4),
        Vec2::splat(TOWER / 2.0 + 0.4),
        belfry + 0.12,
    );
    builder.rectangle_up(Surface::Granite, &center, Vec2::splat(-TOWER / 2.0), Vec2::splat(TOWER / 2.0), shaft + 0.3);
    // The bell.
    let round = detail.round(12);
    builder.lathe(
        Surface::Brass,
        &center,
        round,
        &[(0.72, 19.2), (0.60, 19.5), (0.45, 20.0), (0.38, 20.4), (0.2, 20.6), (0.0, 20.65)],
    );
    builder.cuboid(Surface::Timber, &center, at(-TOWER / 2.0, 20.6, -0.15), at(TOWER / 2.0, 20.85, 0.15), Sides::ALL);
    builder.prism(
        Surface::Ashlar,
        &center,
        8,
        &[(2.7, belfry + 0.1), (2.7, belfry + 1.3), (2.9, belfry + 1.4), (2.9, belfry + 1.6), (2.5, belfry + 1.7)],
    );
    builder.turned(
        Surface::Ashlar,
        &center,
        round,
        &[&[
            (2.5, belfry + 1.7),
            (2.35, belfry + 2.7),
            (1.9, belfry + 3.6),
            (1.1, belfry + 4.3),
            (0.45, belfry + 4.7),
            (0.40, belfry + 5.3),
        ]],
    );
    builder.turned(
        Surface::Granite,
        &center,
        round,
        &[&[
            (0.55, belfry + 5.3),
            (0.55, belfry + 5.45),
            (0.2, belfry + 5.8),
            (0.32, belfry + 6.1),
            (0.0, belfry + 6.4),
        ]],
    );
    builder.tube(Surface::Iron, &center, 4, &[(at(0.0, belfry + 6.3, 0.0), 0.06), (at(0.0, belfry + 7.9, 0.0), 0.05)]);
    builder.tube(
        Surface::Iron,
        &center,
        4,
        &[(at(-0.45, belfry + 7.4, 0.0), 0.05), (at(0.45, belfry + 7.4, 0.0), 0.05)],
    );
    for (x, z) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        let corner = center.moved(x * (TOWER / 2.0), belfry + 0.1, z * (TOWER / 2.0));
        builder.prism(
            Surface::Granite,
            &corner,
            4,
            &[(0.45, 0.0), (0.45, 1.1), (0.55, 1.15), (0.55, 1.25), (0.3, 1.4), (0.0, 2.6)],
        );
    }
}
