//! Walls with holes, and the granite around the holes.

use super::math::on_circle;
use super::mesh::{Builder, Frame, Sides};
use super::surface::Surface;
use glam::{Vec2, Vec3};

/// A hole in a wall, in the wall's local coordinates, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Opening {
    pub min: Vec2,
    pub max: Vec2,
    /// Whether the top is a half circle; the hole is then at least half as high as wide.
    pub round: bool,
}

impl Opening {
    pub(super) fn new(center: f32, width: f32, bottom: f32, top: f32) -> Self {
        let half = width / 2.0;
        Self { min: Vec2::new(center - half, bottom), max: Vec2::new(center + half, top), round: false }
    }

    pub(super) fn arch(center: f32, width: f32, bottom: f32, top: f32) -> Self {
        Self { round: true, ..Self::new(center, width, bottom, top) }
    }

    pub(super) fn size(&self) -> Vec2 {
        self.max - self.min
    }

    fn contains(&self, at: Vec2) -> bool {
        at.cmpgt(self.min).all() && at.cmplt(self.max).all()
    }

    /// Radius and height of the centre of the arch.
    fn circle(&self) -> (f32, Vec2) {
        let radius = self.size().x / 2.0;
        (radius, Vec2::new(self.min.x + radius, self.max.y - radius))
    }

    /// Points of the arch from right to left.
    fn arc(&self, segments: u32) -> Vec<Vec2> {
        let (radius, center) = self.circle();
        (0..=segments).map(|step| center + on_circle(step, 2 * segments) * radius).collect()
    }
}

/// A wall in the plane `z = 0` from the origin to `size`, without its openings. The sides of all openings cut it into a grid of quads, which
/// share their vertices and have no T-junctions. The pieces between an arch and the corners above it have vertices of their own.
pub(super) fn wall(
    builder: &mut Builder,
    surface: Surface,
    frame: &Frame,
    size: Vec2,
    openings: &[Opening],
    segments: u32,
) {
    let cuts = |axis: usize| {
        let mut cuts = vec![0.0, size[axis]];
        for opening in openings {
            cuts.extend([opening.min[axis], opening.max[axis]]);
        }
        cuts.sort_by(f32::total_cmp);
        cuts.dedup_by(|next, cut| *next - *cut < 1e-3);
        cuts
    };
    let (xs, ys) = (cuts(0), cuts(1));
    let normal = frame.direction(Vec3::Z);
    let mut vertices = vec![None; xs.len() * ys.len()];
    for row in 0..ys.len() - 1 {
        for column in 0..xs.len() - 1 {
            let center = Vec2::new(xs[column] + xs[column + 1], ys[row] + ys[row + 1]) / 2.0;
            if openings.iter().any(|opening| opening.contains(center)) {
                continue;
            }
            let mut corner = |right: usize, up: usize| {
                let (x, y) = (xs[column + right], ys[row + up]);
                *vertices[(row + up) * xs.len() + column + right].get_or_insert_with(|| {
                    builder.vertex(frame.point(Vec3::new(x, y, 0.0)), normal, Vec2::new(x, y), surface)
                })
            };
            let quad = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
            builder.quad(surface, quad);
        }
    }
    for opening in openings.iter().filter(|opening| opening.round) {
        let arc = opening.arc(segments);
        let middle = arc.len() / 2;
        let flat = |at: Vec2| Vec3::new(at.x, at.y, 0.0);
        for (half, corner) in
            [(&arc[..=middle], opening.max), (&arc[middle..], Vec2::new(opening.min.x, opening.max.y))]
        {
            spandrel(builder, surface, frame, flat(corner), half);
        }
    }
}

/// The piece of wall between a corner and an arc that runs anticlockwise around the arch's centre.
fn spandrel(builder: &mut Builder, surface: Surface, frame: &Frame, corner: Vec3, arc: &[Vec2]) {
    let normal = frame.direction(Vec3::Z);
    let hub = builder.vertex(frame.point(corner), normal, Vec2::new(corner.x, corner.y), surface);
    let rim: Vec<u32> =
        arc.iter().map(|at| builder.vertex(frame.point(Vec3::new(at.x, at.y, 0.0)), normal, *at, surface)).collect();
    for pair in rim.windows(2) {
        builder.triangle(surface, [hub, pair[1], pair[0]]);
    }
}

/// The sides of a hole from `front` back to `back` (both are values of `z`); the bottom only if `floor` is true.
pub(super) fn reveal(
    builder: &mut Builder,
    surface: Surface,
    frame: &Frame,
    opening: &Opening,
    [front, back]: [f32; 2],
    floor: bool,
    segments: u32,
) {
    let (min, max) = (opening.min, opening.max);
    if !opening.round {
        let sides = Sides::LEFT.and(Sides::RIGHT).and(Sides::TOP);
        let sides = if floor { sides.and(Sides::BOTTOM) } else { sides };
        builder.hollow(surface, frame, min.extend(back), max.extend(front), sides);
        return;
    }
    let (_, center) = opening.circle();
    let sides = Sides::LEFT.and(Sides::RIGHT);
    let sides = if floor { sides.and(Sides::BOTTOM) } else { sides };
    builder.hollow(surface, frame, min.extend(back), Vec3::new(max.x, center.y, front), sides);
    let arc = opening.arc(segments);
    let step = arc[0].distance(arc[1]);
    builder.grid(surface, arc.len() as u32 - 1, 1, |column, row| {
        let at = arc[column as usize];
        let inward = (center - at).normalize();
        let z = if row == 0 { front } else { back };
        let metres = Vec2::new(column as f32 * step, z);
        (frame.point(at.extend(z)), frame.direction(inward.extend(0.0)), metres)
    });
}

/// Granite around a hole: jambs, lintel or arch ring, `width` wide and standing `depth` out of the wall. With `bare`,
/// only the faces that face the front are built.
pub(super) fn surround(
    builder: &mut Builder,
    frame: &Frame,
    opening: &Opening,
    [width, depth]: [f32; 2],
    bare: bool,
    segments: u32,
) {
    let surface = Surface::Granite;
    let (min, max) = (opening.min, opening.max);
    let spring = if opening.round { opening.circle().1.y } else { max.y };
    let outer = |side: Sides| if bare { Sides::FRONT } else { Sides::FRONT.and(side) };
    builder.cuboid(
        surface,
        frame,
        Vec3::new(min.x - width, min.y, 0.0),
        Vec3::new(min.x, spring, depth),
        outer(Sides::LEFT),
    );
    builder.cuboid(
        surface,
        frame,
        Vec3::new(max.x, min.y, 0.0),
        Vec3::new(max.x + width, spring, depth),
        outer(Sides::RIGHT),
    );
    if !opening.round {
        let (low, high) = (Vec3::new(min.x - width, max.y, 0.0), Vec3::new(max.x + width, max.y + width, depth));
        builder.cuboid(surface, frame, low, high, outer(Sides::LEFT.and(Sides::RIGHT).and(Sides::TOP)));
        return;
    }
    let (radius, center) = opening.circle();
    let arc = |step: u32| on_circle(step, 2 * segments);
    let front = frame.direction(Vec3::Z);
    builder.grid(surface, segments, 1, |column, row| {
        let reach = if row == 0 { radius + width } else { radius };
        let at = center + arc(column) * reach;
        (frame.point(at.extend(depth)), front, at)
    });
    builder.grid(surface, segments, 1, |column, row| {
        let out = arc(column);
        let at = center + out * (radius + width);
        let z = if row == 0 { 0.0 } else { depth };
        let metres = Vec2::new(column as f32 * 0.2, z);
        (frame.point(at.extend(z)), frame.direction(out.extend(0.0)), metres)
    });
}

/// A moulding of the given (z, y) profile, drawn from the bottom up, along `x` from `from` to `to`, with closed ends.
pub(super) fn moulding(
    builder: &mut Builder,
    surface: Surface,
    frame: &Frame,
    [from, to]: [f32; 2],
    profile: &[(f32, f32)],
) {
    for pair in profile.windows(2) {
        let at = |x: f32, (z, y): (f32, f32)| Vec3::new(x, y, z);
        builder.polygon(surface, frame, &[at(from, pair[0]), at(to, pair[0]), at(to, pair[1]), at(from, pair[1])]);
    }
    // A fan from the point on the wall at the profile's top covers the whole end.
    let hub = (profile[0].0, profile[profile.len() - 1].1);
    for (x, forward) in [(from, true), (to, false)] {
        let mut cap = vec![Vec3::new(x, hub.1, hub.0)];
        cap.extend(profile.iter().map(|&(z, y)| Vec3::new(x, y, z)));
        if !forward {
            cap[1..].reverse();
        }
        builder.polygon(surface, frame, &cap);
    }
}
