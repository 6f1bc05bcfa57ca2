//! Fillings of the holes of a facade: windows, doors and balconies.

use super::detail::Detail;
use super::facade::{self, Opening};
use super::math::Random;
use super::mesh::{Builder, Frame, Sides};
use super::surface::Surface;
use glam::{Vec2, Vec3};

/// Local z of the panes, metres: behind the wall's face at 0.
pub(super) const PANE: f32 = -0.17;
/// Local z of the back end of the reveals, metres.
pub(super) const REVEAL: f32 = -0.22;

/// A window with a granite surround: casements, one pane, and behind it a dark room with curtains. `sill` is false where the
/// window opens onto a balcony.
pub(super) fn window(
    builder: &mut Builder,
    frame: &Frame,
    opening: &Opening,
    paint: Surface,
    sill: bool,
    detail: Detail,
    random: &mut Random,
) {
    if !detail.at_least(1) {
        pasted(builder, frame, opening, Surface::Glass);
        return;
    }
    let (min, max) = (opening.min, opening.max);
    let arc = detail.curve(8);
    facade::surround(builder, frame, opening, [0.17, 0.05], false, arc);
    facade::reveal(builder, Surface::Granite, frame, opening, [0.05, REVEAL], true, arc);
    if sill {
        let (low, high) = (Vec3::new(min.x - 0.22, min.y - 0.13, 0.0), Vec3::new(max.x + 0.22, min.y, 0.13));
        builder.cuboid(Surface::Granite, frame, low, high, Sides::ALL.without(Sides::BACK));
    }
    glazing(builder, frame, opening, paint, detail);
    room(builder, frame, opening, detail, random);
}

/// The cheapest opening: a stone frame, a dark ground and `front`, laid onto an unbroken wall.
fn pasted(builder: &mut Builder, frame: &Frame, opening: &Opening, front: Surface) {
    let rim = Vec2::splat(0.16);
    builder.rectangle(Surface::Granite, frame, opening.min - rim, opening.max + rim, 0.03);
    builder.rectangle(Surface::Room, frame, opening.min, opening.max, 0.05);
    builder.rectangle(front, frame, opening.min, opening.max, 0.08);
}

/// Casements and their pane.
fn glazing(builder: &mut Builder, frame: &Frame, opening: &Opening, paint: Surface, detail: Detail) {
    let (min, max) = (opening.min, opening.max);
    builder.rectangle(Surface::Glass, frame, min, max, PANE);
    let size = opening.size();
    let mut bar = |low: Vec2, high: Vec2, out: f32, solid: Sides| {
        let sides = if detail.at_least(2) { Sides::FRONT.and(solid) } else { Sides::FRONT };
        builder.cuboid(paint, frame, low.extend(PANE), high.extend(PANE + out), sides);
    };
    let (edge, upright, level) = (0.07, Sides::LEFT.and(Sides::RIGHT), Sides::TOP.and(Sides::BOTTOM));
    let middle = (min.x + max.x) / 2.0;
    let transom = min.y + size.y * 0.70;
    bar(min, Vec2::new(min.x + edge, max.y), 0.035, upright);
    bar(Vec2::new(max.x - edge, min.y), max, 0.035, upright);
    bar(Vec2::new(min.x + edge, min.y), Vec2::new(max.x - edge, min.y + edge), 0.035, level);
    bar(Vec2::new(min.x + edge, max.y - edge), Vec2::new(max.x - edge, max.y), 0.035, level);
    bar(Vec2::new(middle - 0.045, min.y + edge), Vec2::new(middle + 0.045, max.y - edge), 0.045, upright);
    bar(Vec2::new(min.x + edge, transom), Vec2::new(max.x - edge, transom + 0.07), 0.05, level);
    if detail.at_least(2) {
        for step in 1..3 {
            let y = min.y + (transom - min.y) * step as f32 / 3.0;
            for (from, to) in [(min.x + edge, middle - 0.045), (middle + 0.045, max.x - edge)] {
                bar(Vec2::new(from, y), Vec2::new(to, y + 0.03), 0.03, level);
            }
        }
    }
}

/// A dark box with curtains or a blind.
fn room(builder: &mut Builder, frame: &Frame, opening: &Opening, detail: Detail, random: &mut Random) {
    let (min, max) = (opening.min, opening.max);
    let size = opening.size();
    let sides = Sides::ALL.without(Sides::FRONT);
    builder.hollow(Surface::Room, frame, min.extend(REVEAL - 1.6), max.extend(REVEAL), sides);
    let z = REVEAL - 0.04;
    if random.chance(0.25) {
        let low = min.y + size.y * random.between(0.35, 0.75);
        builder.rectangle(Surface::Curtain, frame, Vec2::new(min.x, low), max, z);
    } else if random.chance(0.85) {
        let share = random.between(0.16, 0.38);
        let folds = detail.curve(2);
        for (from, to) in [(min.x, min.x + size.x * share), (max.x - size.x * share, max.x)] {
            folded(builder, frame, [from, to], [min.y + 0.02, max.y], z, folds);
        }
    }
}

/// Cloth in folds.
fn folded(builder: &mut Builder, frame: &Frame, [from, to]: [f32; 2], [low, high]: [f32; 2], z: f32, folds: u32) {
    let step = (to - from) / folds as f32;
    let way = |column: u32| if column.is_multiple_of(2) { 1.0 } else { -1.0 };
    builder.grid(Surface::Curtain, folds, 1, |column, row| {
        let x = from + step * column as f32;
        let y = if row == 0 { low } else { high };
        let normal = Vec3::new(0.45 * way(column / 2), 0.0, 1.0).normalize();
        let position = Vec3::new(x, y, z + 0.03 * way(column));
        (frame.point(position), frame.direction(normal), Vec2::new(x, y))
    });
}

/// A door of two panelled leaves under a fanlight, with its granite surround and a step.
pub(super) fn door(builder: &mut Builder, frame: &Frame, opening: &Opening, paint: Surface, detail: Detail) {
    if !detail.at_least(1) {
        pasted(builder, frame, opening, paint);
        return;
    }
    let (min, max) = (opening.min, opening.max);
    let arc = detail.curve(8);
    facade::surround(builder, frame, opening, [0.20, 0.06], false, arc);
    facade::reveal(builder, Surface::Granite, frame, opening, [0.06, REVEAL], true, arc);
    let light = if opening.round { max.y - opening.size().x / 2.0 } else { max.y - 0.45 };
    let back = PANE - 0.03;
    builder.rectangle(paint, frame, min, Vec2::new(max.x, light), back);
    builder.rectangle(Surface::Glass, frame, Vec2::new(min.x, light + 0.06), max, PANE);
    builder.rectangle(Surface::Room, frame, Vec2::new(min.x, light + 0.06), max, REVEAL);
    let rail = Sides::FRONT.and(Sides::TOP).and(Sides::BOTTOM);
    builder.cuboid(paint, frame, Vec3::new(min.x, light, back), Vec3::new(max.x, light + 0.06, back + 0.09), rail);
    let middle = (min.x + max.x) / 2.0;
    let half = opening.size().x / 2.0;
    let panels = [(0.10, 0.38), (0.44, 0.66), (0.72, 0.94)];
    for left in [min.x, middle] {
        for (from, to) in panels {
            let height = light - min.y;
            let low = Vec3::new(left + half * 0.16, min.y + height * from, back);
            let high = Vec3::new(left + half * 0.84, min.y + height * to, back + 0.035);
            let solid = if detail.at_least(2) { Sides::ALL.without(Sides::BACK) } else { Sides::FRONT.and(Sides::TOP) };
            builder.cuboid(paint, frame, low, high, solid);
        }
    }
    builder.cuboid(
        paint,
        frame,
        Vec3::new(middle - 0.035, min.y, back),
        Vec3::new(middle + 0.035, light, back + 0.05),
        Sides::FRONT.and(Sides::LEFT).and(Sides::RIGHT),
    );
    let (low, high) = (Vec3::new(min.x - 0.28, -0.02, 0.0), Vec3::new(max.x + 0.28, min.y, 0.40));
    builder.cuboid(Surface::Granite, frame, low, high, Sides::ALL.without(Sides::BACK).without(Sides::BOTTOM));
}

/// A granite slab on corbels with an iron railing, its floor at `floor`, from `from` to `to`.
pub(super) fn balcony(builder: &mut Builder, frame: &Frame, [from, to]: [f32; 2], floor: f32, detail: Detail) {
    const DEPTH: f32 = 0.72;
    let under = floor - 0.14;
    let sides = Sides::ALL.without(Sides::BACK);
    builder.cuboid(Surface::Granite, frame, Vec3::new(from, under, 0.0), Vec3::new(to, floor, DEPTH), sides);
    if detail.at_least(1) {
        for x in [from + 0.2, to - 0.36] {
            let corbel = [(0.0, under - 0.34), (0.16, under - 0.30), (0.42, under - 0.10), (0.46, under)];
            facade::moulding(builder, Surface::Granite, frame, [x, x + 0.16], &corbel);
        }
    }
    let top = floor + 0.98;
    let corner = |x: f32, y: f32| Vec3::new(x, y, DEPTH - 0.06);
    let sides = detail.curve(3).clamp(3, 8);
    let (left, right) = (from + 0.05, to - 0.05);
    let wall = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    for (y, radius) in [(top, 0.028), (floor + 0.09, 0.016)] {
        let rails =
            [(corner(left, y), corner(right, y)), (wall(left, y), corner(left, y)), (corner(right, y), wall(right, y))];
        // Coarse balconies have only their front rails.
        for (a, b) in rails.into_iter().take(if detail.at_least(1) { 3 } else { 1 }) {
            builder.tube(Surface::Iron, frame, sides, &[(a, radius), (b, radius)]);
        }
    }
    if !detail.at_least(1) {
        return;
    }
    let spacing = if detail.at_least(2) { 0.11 } else { 0.15 };
    let mut bar = |x: f32, z: f32| {
        let path = [(Vec3::new(x, floor, z), 0.011), (Vec3::new(x, top, z), 0.011)];
        builder.tube(Surface::Iron, frame, sides, &path);
    };
    let count = ((right - left) / spacing).round() as u32;
    for step in 0..=count {
        bar(left + (right - left) * step as f32 / count as f32, DEPTH - 0.06);
    }
    let count = (DEPTH / spacing) as u32;
    for step in 1..count {
        let z = (DEPTH - 0.06) * step as f32 / count as f32;
        bar(left, z);
        bar(right, z);
    }
}
