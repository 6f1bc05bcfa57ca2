//! The cafe whose pane is in view of the camera `Vidro`: a wide pane, a door, and the room behind them.

use super::detail::Detail;
use super::facade::{self, Opening};
use super::mesh::{Builder, Frame, Sides};
use super::opening;
use super::surface::Surface;
use glam::{Vec2, Vec3};

/// Width of the house, metres: the openings below are laid out for it.
pub(super) const WIDTH: f32 = 9.6;
/// Local z of the large pane, metres: behind the wall's face at 0.
pub(super) const PANE: f32 = -0.06;
const DEPTH: f32 = 6.0;
const HEIGHT: f32 = 3.35;

/// The large pane.
pub(super) fn pane() -> Opening {
    Opening::new(6.05, 5.9, 0.42, 3.2)
}

fn entrance() -> Opening {
    Opening::new(1.6, 1.3, 0.12, 2.95)
}

/// The holes in the facade.
pub(super) fn openings() -> [Opening; 2] {
    [entrance(), pane()]
}

/// Builds the pane with its frame, the door, and the room.
pub(super) fn build(builder: &mut Builder, frame: &Frame, detail: Detail) {
    let pane = pane();
    facade::surround(builder, frame, &pane, [0.22, 0.04], !detail.at_least(1), 4);
    facade::reveal(builder, Surface::Granite, frame, &pane, [0.04, -0.3], true, 4);
    let (low, high) = (Vec3::new(pane.min.x - 0.22, 0.0, 0.0), Vec3::new(pane.max.x + 0.22, pane.min.y, 0.04));
    builder.cuboid(Surface::Granite, frame, low, high, Sides::FRONT.and(Sides::TOP).and(Sides::LEFT).and(Sides::RIGHT));
    builder.rectangle(Surface::Glass, frame, pane.min, pane.max, PANE);
    // A slim green frame around the pane.
    let bar = 0.055;
    let mut strip = |min: Vec2, max: Vec2| {
        let (low, high) = (min.extend(PANE - 0.03), max.extend(PANE + 0.025));
        builder.cuboid(Surface::PaintGreen, frame, low, high, Sides::ALL);
    };
    strip(pane.min, Vec2::new(pane.min.x + bar, pane.max.y));
    strip(Vec2::new(pane.max.x - bar, pane.min.y), pane.max);
    strip(Vec2::new(pane.min.x + bar, pane.min.y), Vec2::new(pane.max.x - bar, pane.min.y + bar));
    strip(Vec2::new(pane.min.x + bar, pane.max.y - bar), Vec2::new(pane.max.x - bar, pane.max.y));
    opening::door(builder, frame, &entrance(), Surface::PaintGreen, detail);
    room(builder, frame, detail);
}

fn room(builder: &mut Builder, frame: &Frame, detail: Detail) {
    let at = Vec3::new;
    let (low, high) = (at(0.3, 0.1, -DEPTH), at(WIDTH - 0.3, HEIGHT, -0.3));
    let walls = Sides::LEFT.and(Sides::RIGHT).and(Sides::BACK).and(Sides::TOP);
    builder.hollow(Surface::ShopWall, frame, low, high, walls);
    builder.hollow(Surface::ShopFloor, frame, low, high, Sides::BOTTOM);
    // Wainscot, counter, shelves.
    builder.cuboid(
        Surface::Timber,
        frame,
        at(0.3, 0.1, -DEPTH),
        at(WIDTH - 0.3, 1.15, -DEPTH + 0.04),
        Sides::FRONT.and(Sides::TOP),
    );
    builder.cuboid(Surface::Timber, frame, at(2.4, 0.1, -4.6), at(7.9, 1.10, -4.0), Sides::ALL);
    builder.cuboid(Surface::Granite, frame, at(2.35, 1.10, -4.65), at(7.95, 1.15, -3.92), Sides::ALL);
    builder.rectangle(Surface::ShopShelf, frame, Vec2::new(2.7, 1.35), Vec2::new(7.5, 2.55), -DEPTH + 0.02);
    for shelf in 0..4 {
        let y = 1.33 + 0.4 * shelf as f32;
        builder.cuboid(
            Surface::Timber,
            frame,
            at(2.6, y, -DEPTH),
            at(7.6, y + 0.03, -DEPTH + 0.22),
            Sides::ALL.without(Sides::BACK),
        );
    }
    if !detail.at_least(1) {
        return;
    }
    let round = detail.round(12);
    let small = detail.round(8);
    for (x, z) in [(3.3, -1.4), (5.2, -1.15), (7.2, -1.5), (8.3, -2.9), (4.3, -2.7), (6.3, -2.8)] {
        table(builder, &frame.moved(x, 0.1, z), round);
        for (dx, dz, side) in [(0.62, 0.1, 1.0), (-0.62, -0.05, -1.0)] {
            chair(builder, &frame.moved(x + dx, 0.1, z + dz), side);
        }
    }
    for (x, z) in [(3.3, -1.5), (5.2, -1.5), (7.2, -1.5), (4.0, -4.3), (6.4, -4.3)] {
        let lamp = frame.moved(x, 0.0, z);
        builder.tube(Surface::Iron, &lamp, 4, &[(at(0.0, 2.4, 0.0), 0.01), (at(0.0, HEIGHT, 0.0), 0.01)]);
        builder.lathe(Surface::Brass, &lamp, small, &[(0.20, 2.22), (0.17, 2.32), (0.05, 2.42), (0.0, 2.44)]);
        builder.lathe(Surface::Lantern, &lamp, small, &[(0.0, 2.19), (0.14, 2.22), (0.15, 2.25), (0.0, 2.30)]);
    }
}

fn table(builder: &mut Builder, frame: &Frame, round: u32) {
    builder.turned(
        Surface::Iron,
        frame,
        round,
        &[&[(0.22, 0.0), (0.20, 0.03), (0.03, 0.07)], &[(0.03, 0.07), (0.03, 0.71)]],
    );
    builder.turned(
        Surface::PaintWhite,
        frame,
        round,
        &[&[(0.0, 0.71), (0.36, 0.71)], &[(0.36, 0.71), (0.36, 0.74)], &[(0.36, 0.74), (0.0, 0.74)]],
    );
}

/// A chair; `side` is the direction of its back along the local x axis.
fn chair(builder: &mut Builder, frame: &Frame, side: f32) {
    let at = Vec3::new;
    builder.cuboid(Surface::PaintRed, frame, at(-0.2, 0.43, -0.2), at(0.2, 0.47, 0.2), Sides::ALL);
    for (x, z) in [(-0.18, -0.18), (0.18, -0.18), (-0.18, 0.18), (0.18, 0.18)] {
        let tall = if x * side > 0.0 { 0.88 } else { 0.43 };
        builder.tube(Surface::Timber, frame, 4, &[(at(x, 0.0, z), 0.018), (at(x, tall, z), 0.016)]);
    }
    let (from, to) = if side > 0.0 { (0.165, 0.195) } else { (-0.195, -0.165) };
    builder.cuboid(Surface::PaintRed, frame, at(from, 0.62, -0.19), at(to, 0.86, 0.19), Sides::ALL);
}
