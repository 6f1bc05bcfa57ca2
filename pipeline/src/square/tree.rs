//! Trees: a trunk with boughs, dense crowns, and leaves all over the crowns.

use super::detail::Detail;
use super::math::{Random, cos_sin, noise, on_circle};
use super::mesh::{Builder, Frame};
use super::surface::Surface;
use glam::{Vec2, Vec3};

/// A rounded clump of leaves: centre and radii, metres.
#[derive(Debug, Clone, Copy)]
struct Clump {
    center: Vec3,
    radius: Vec3,
}

/// A tree standing at the origin, about `height` metres tall.
#[derive(Debug, Clone)]
pub(super) struct Tree {
    height: f32,
    seed: u32,
    clumps: Vec<Clump>,
}

impl Tree {
    pub(super) fn new(height: f32, seed: u32) -> Self {
        let mut random = Random::new(seed);
        let mut clumps =
            vec![Clump { center: Vec3::new(0.0, height * 0.70, 0.0), radius: Vec3::new(0.27, 0.26, 0.27) * height }];
        let around = 6;
        for index in 0..around {
            let (cos, sin) = cos_sin(f64::from(index as f32 + 0.6 * random.unit()) / f64::from(around));
            let reach = height * random.between(0.17, 0.27);
            let center = Vec3::new(cos as f32 * reach, height * random.between(0.50, 0.78), sin as f32 * reach);
            let size = height * random.between(0.13, 0.19);
            clumps.push(Clump { center, radius: Vec3::new(size, size * 0.82, size) });
        }
        Self { height, seed, clumps }
    }

    /// Builds trunk, boughs and crowns.
    pub(super) fn build(&self, builder: &mut Builder, detail: Detail) {
        let frame = Frame::upright(Vec3::ZERO);
        let round = detail.round(6);
        let thick = self.height * 0.028;
        let trunk = [
            (Vec3::new(0.0, -0.03, 0.0), thick * 1.7),
            (Vec3::new(0.0, 0.25, 0.0), thick * 1.15),
            (Vec3::new(0.05, self.height * 0.25, 0.02), thick),
            (Vec3::new(0.0, self.height * 0.55, 0.0), thick * 0.6),
        ];
        builder.tube(Surface::Bark, &frame, round, &trunk);
        for clump in &self.clumps[if detail.at_least(1) { 1 } else { self.clumps.len() }..] {
            let fork = Vec3::new(0.03, self.height * 0.33, 0.01);
            let path =
                [(fork, thick * 0.55), (fork.lerp(clump.center, 0.55), thick * 0.35), (clump.center, thick * 0.12)];
            builder.tube(Surface::Bark, &frame, (round / 2).max(4), &path);
        }
        for (index, clump) in self.clumps.iter().enumerate() {
            crown(builder, &frame, clump, detail, self.seed.wrapping_add(index as u32));
        }
    }

    /// Adds `count` leaves of two triangles each, on and just under the clumps' surfaces.
    pub(super) fn leaves(&self, builder: &mut Builder, count: usize) {
        builder.reserve(Surface::Foliage, count * 4, count * 2);
        let mut random = Random::new(self.seed ^ 0x1eaf);
        let areas: Vec<f32> = self.clumps.iter().map(|clump| clump.radius.x * clump.radius.x).collect();
        let total: f32 = areas.iter().sum();
        // Leaf size for a given number of leaves, so that a few of them cover each point of the surface.
        let side = (total * 4.0 * std::f32::consts::PI * 1.5 / count.max(1) as f32).sqrt().clamp(0.05, 0.34);
        for index in 0..count {
            let mut pick = (index as f32 + 0.5) / count as f32 * total;
            let mut chosen = 0;
            while chosen + 1 < areas.len() && pick > areas[chosen] {
                pick -= areas[chosen];
                chosen += 1;
            }
            self.leaf(builder, &self.clumps[chosen], side, &mut random);
        }
    }

    fn leaf(&self, builder: &mut Builder, clump: &Clump, side: f32, random: &mut Random) {
        let out = on_sphere(random);
        let depth = random.between(0.86, 1.08);
        let center = clump.center + clump.radius * out * depth;
        // Leaves lean at random from the crown's surface.
        let lean = (out + on_sphere(random) * 0.75 + Vec3::Y * 0.35).normalize_or(Vec3::Y);
        let tangent = lean.cross(on_sphere(random)).normalize_or(Vec3::X);
        let other = lean.cross(tangent);
        let size = side * random.between(0.7, 1.25);
        let (a, b) = (tangent * size * 0.5, other * size * 0.36);
        let normal = (out * 0.65 + lean * 0.55 + Vec3::Y * 0.1).normalize();
        // The shading normal is on the side of `lean`.
        let (a, normal) = if normal.dot(lean) > 0.0 { (a, normal) } else { (-a, lean) };
        let shift = Vec2::new(random.unit(), random.unit()) * 1.6;
        let corners = [(-a, Vec2::ZERO), (-b, Vec2::new(0.5, 0.3)), (a, Vec2::new(1.0, 0.5)), (b, Vec2::new(0.5, 0.8))];
        let quad = corners.map(|(offset, at)| {
            builder.vertex(center + offset, normal, shift + at * size.max(0.1) * 0.5, Surface::Foliage)
        });
        builder.quad(Surface::Foliage, quad);
    }
}

/// A direction, uniformly distributed over the sphere: the height and the longitude of its point are each uniform (Archimedes).
fn on_sphere(random: &mut Random) -> Vec3 {
    let y = random.between(-1.0, 1.0);
    let (cos, sin) = cos_sin(f64::from(random.unit()));
    let radius = (1.0 - y * y).max(0.0).sqrt();
    Vec3::new(radius * cos as f32, y, radius * sin as f32)
}

/// The dark inside of a clump: a lumpy ellipsoid.
fn crown(builder: &mut Builder, frame: &Frame, clump: &Clump, detail: Detail, seed: u32) {
    let (columns, rows) = (detail.round(8), detail.curve(4));
    builder.grid(Surface::FoliageDark, columns, rows, |column, row| {
        let turn = on_circle(column, columns);
        let (height, radius) = cos_sin(0.5 - 0.5 * f64::from(row) / f64::from(rows));
        let (height, radius) = (height as f32, if row == 0 || row == rows { 0.0 } else { radius as f32 });
        let out = Vec3::new(radius * turn.y, height, radius * turn.x);
        let at = Vec2::new(out.x + 2.0 * out.y, out.z - out.y) * 2.0 + Vec2::splat(16.0);
        let lump = 0.84 + 0.22 * noise(at, 64, seed);
        let normal = (out / clump.radius).normalize_or(Vec3::Y);
        let metres = Vec2::new(column as f32 / columns as f32 * 4.8, row as f32 / rows as f32 * 3.2);
        (frame.point(clump.center + clump.radius * out * lump), normal, metres)
    });
}
