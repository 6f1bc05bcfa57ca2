//! Building meshes: flat polygons with their own normals, smooth grids with shared vertices.

use super::math::on_circle;
use super::surface::Surface;
use crate::scene::{Group, Mesh};
use glam::{Vec2, Vec3};

/// A local coordinate frame. Along a facade: `x` to the right as seen from outside, `y` up, `z` outwards.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    pub origin: Vec3,
    pub x: Vec3,
    pub y: Vec3,
    pub z: Vec3,
}

impl Frame {
    /// The world's axes with the origin moved to `origin`.
    pub(super) fn upright(origin: Vec3) -> Self {
        Self { origin, x: Vec3::X, y: Vec3::Y, z: Vec3::Z }
    }

    /// Upright, with `z` along the horizontal `outward`.
    pub(super) fn facing(origin: Vec3, outward: Vec3) -> Self {
        let z = outward.normalize();
        Self { origin, x: Vec3::Y.cross(z), y: Vec3::Y, z }
    }

    /// A local point in the world.
    pub(super) fn point(&self, local: Vec3) -> Vec3 {
        self.origin + self.direction(local)
    }

    /// A local direction in the world.
    pub(super) fn direction(&self, local: Vec3) -> Vec3 {
        self.x * local.x + self.y * local.y + self.z * local.z
    }

    /// The same axes with the origin at the local point (x, y, z).
    pub(super) fn moved(&self, x: f32, y: f32, z: f32) -> Self {
        Self { origin: self.point(Vec3::new(x, y, z)), ..*self }
    }

    /// The same origin, with the axes rotated about `y` so that the new `z` is the local horizontal direction `(x, z)`.
    pub(super) fn turned(&self, x: f32, z: f32) -> Self {
        Self::facing(self.origin, self.direction(Vec3::new(x, 0.0, z)))
    }
}

/// Which sides of a cuboid are built; hidden sides are left out.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sides(u8);

impl Sides {
    pub(super) const LEFT: Self = Self(1);
    pub(super) const RIGHT: Self = Self(2);
    pub(super) const BOTTOM: Self = Self(4);
    pub(super) const TOP: Self = Self(8);
    pub(super) const BACK: Self = Self(16);
    pub(super) const FRONT: Self = Self(32);
    pub(super) const ALL: Self = Self(63);

    pub(super) const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    pub(super) const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    fn has(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }
}

/// A mesh under construction.
#[derive(Debug, Clone, Default)]
pub(super) struct Builder {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    texcoords: Vec<Vec2>,
    groups: Vec<Vec<[u32; 3]>>,
}

impl Builder {
    /// Number of triangles so far.
    pub(super) fn triangles(&self) -> usize {
        self.groups.iter().map(Vec::len).sum()
    }

    /// Reserves memory for more vertices and triangles.
    pub(super) fn reserve(&mut self, surface: Surface, vertices: usize, triangles: usize) {
        self.positions.reserve(vertices);
        self.normals.reserve(vertices);
        self.texcoords.reserve(vertices);
        self.group(surface).reserve(triangles);
    }

    fn group(&mut self, surface: Surface) -> &mut Vec<[u32; 3]> {
        let index = surface as usize;
        if self.groups.len() <= index {
            self.groups.resize_with(index + 1, Vec::new);
        }
        &mut self.groups[index]
    }

    /// Adds a vertex in world space. The normal is a unit vector, the texture coordinates are in metres.
    pub(super) fn vertex(&mut self, position: Vec3, normal: Vec3, metres: Vec2, surface: Surface) -> u32 {
        self.positions.push(position);
        self.normals.push(normal);
        self.texcoords.push(metres / surface.metres());
        (self.positions.len() - 1) as u32
    }

    /// Adds a triangle, anticlockwise seen from its front. A triangle without area is skipped.
    pub(super) fn triangle(&mut self, surface: Surface, corners: [u32; 3]) {
        let [a, b, c] = corners.map(|corner| self.positions[corner as usize]);
        if (b - a).cross(c - a).length_squared() > 1e-13 {
            self.group(surface).push(corners);
        }
    }

    /// Adds a quadrilateral of existing vertices, anticlockwise seen from its front.
    pub(super) fn quad(&mut self, surface: Surface, corners: [u32; 4]) {
        let [a, b, c, d] = corners;
        self.triangle(surface, [a, b, c]);
        self.triangle(surface, [a, c, d]);
    }

    /// Adds a flat convex polygon given in local coordinates, anticlockwise seen from its front. Texture coordinates
    /// are the two local coordinates along which the polygon extends most.
    pub(super) fn polygon(&mut self, surface: Surface, frame: &Frame, corners: &[Vec3]) {
        let mut normal = Vec3::ZERO;
        for index in 2..corners.len() {
            normal += (corners[index - 1] - corners[0]).cross(corners[index] - corners[0]);
        }
        let Some(normal) = normal.try_normalize() else { return };
        let world = frame.direction(normal).normalize();
        let size = normal.abs();
        let first = self.positions.len() as u32;
        for &corner in corners {
            let metres = if size.z >= size.x && size.z >= size.y {
                Vec2::new(corner.x, corner.y)
            } else if size.x >= size.y {
                Vec2::new(corner.z, corner.y)
            } else {
                Vec2::new(corner.x, corner.z)
            };
            self.vertex(frame.point(corner), world, metres, surface);
        }
        for index in 2..corners.len() as u32 {
            self.triangle(surface, [first, first + index - 1, first + index]);
        }
    }

    /// Adds a rectangle in the local plane `z`, facing along `z`.
    pub(super) fn rectangle(&mut self, surface: Surface, frame: &Frame, min: Vec2, max: Vec2, z: f32) {
        let at = |x: f32, y: f32| Vec3::new(x, y, z);
        self.polygon(surface, frame, &[at(min.x, min.y), at(max.x, min.y), at(max.x, max.y), at(min.x, max.y)]);
    }

    /// Adds a level rectangle, (x, z) from `min` to `max` at height `y`, facing up.
    pub(super) fn rectangle_up(&mut self, surface: Surface, frame: &Frame, min: Vec2, max: Vec2, y: f32) {
        let at = |x: f32, z: f32| Vec3::new(x, y, z);
        self.polygon(surface, frame, &[at(min.x, max.y), at(max.x, max.y), at(max.x, min.y), at(min.x, min.y)]);
    }

    /// Adds sides of an axis-aligned box, facing outwards.
    pub(super) fn cuboid(&mut self, surface: Surface, frame: &Frame, min: Vec3, max: Vec3, sides: Sides) {
        self.box_sides(surface, frame, min, max, sides, false);
    }

    /// Adds sides of an axis-aligned box, facing inwards: a room, a niche.
    pub(super) fn hollow(&mut self, surface: Surface, frame: &Frame, min: Vec3, max: Vec3, sides: Sides) {
        self.box_sides(surface, frame, min, max, sides, true);
    }

    fn box_sides(&mut self, surface: Surface, frame: &Frame, min: Vec3, max: Vec3, sides: Sides, inward: bool) {
        let at = |x: usize, y: usize, z: usize| {
            let pick = |axis: usize, high: usize| if high == 1 { max[axis] } else { min[axis] };
            Vec3::new(pick(0, x), pick(1, y), pick(2, z))
        };
        let faces = [
            (Sides::LEFT, [at(0, 0, 0), at(0, 0, 1), at(0, 1, 1), at(0, 1, 0)]),
            (Sides::RIGHT, [at(1, 0, 1), at(1, 0, 0), at(1, 1, 0), at(1, 1, 1)]),
            (Sides::BOTTOM, [at(0, 0, 0), at(1, 0, 0), at(1, 0, 1), at(0, 0, 1)]),
            (Sides::TOP, [at(0, 1, 1), at(1, 1, 1), at(1, 1, 0), at(0, 1, 0)]),
            (Sides::BACK, [at(1, 0, 0), at(0, 0, 0), at(0, 1, 0), at(1, 1, 0)]),
            (Sides::FRONT, [at(0, 0, 1), at(1, 0, 1), at(1, 1, 1), at(0, 1, 1)]),
        ];
        for (side, mut corners) in faces {
            if sides.has(side) {
                if inward {
                    corners.reverse();
                }
                self.polygon(surface, frame, &corners);
            }
        }
    }

    /// Adds a grid of `columns` by `rows` cells with shared vertices. `vertex` gives world position, unit normal and
    /// texture coordinates in metres; the front is where `column x row` points by the right-hand rule.
    pub(super) fn grid(
        &mut self,
        surface: Surface,
        columns: u32,
        rows: u32,
        mut vertex: impl FnMut(u32, u32) -> (Vec3, Vec3, Vec2),
    ) {
        let first = self.positions.len() as u32;
        for row in 0..=rows {
            for column in 0..=columns {
                let (position, normal, metres) = vertex(column, row);
                self.vertex(position, normal, metres, surface);
            }
        }
        let stride = columns + 1;
        for row in 0..rows {
            for column in 0..columns {
                let corner = first + row * stride + column;
                self.quad(surface, [corner, corner + 1, corner + stride + 1, corner + stride]);
            }
        }
    }

    /// Adds a surface of revolution about the local `y`. The profile of (radius, height) starts at the bottom; the outside is to
    /// the right of its direction, and normals are smooth along it. Sharp creases need separate profiles.
    pub(super) fn lathe(&mut self, surface: Surface, frame: &Frame, segments: u32, profile: &[(f32, f32)]) {
        let points: Vec<Vec2> = profile.iter().map(|&(radius, height)| Vec2::new(radius, height)).collect();
        let normal_of = |from: Vec2, to: Vec2| Vec2::new(to.y - from.y, from.x - to.x).normalize_or_zero();
        let normals: Vec<Vec2> = (0..points.len())
            .map(|index| {
                let before = if index > 0 { normal_of(points[index - 1], points[index]) } else { Vec2::ZERO };
                let after =
                    if index + 1 < points.len() { normal_of(points[index], points[index + 1]) } else { Vec2::ZERO };
                (before + after).normalize_or(Vec2::X)
            })
            .collect();
        let mut length = vec![0.0];
        for pair in points.windows(2) {
            length.push(length[length.len() - 1] + pair[0].distance(pair[1]));
        }
        let widest = points.iter().fold(0.0f32, |widest, point| widest.max(point.x));
        let around = (widest * std::f32::consts::TAU / segments as f32).max(1e-3);
        self.grid(surface, segments, points.len() as u32 - 1, |column, row| {
            // Turning from z towards x makes `column x row` point outwards.
            let turn = on_circle(column, segments);
            let (point, normal) = (points[row as usize], normals[row as usize]);
            let position = Vec3::new(point.x * turn.y, point.y, point.x * turn.x);
            let normal = Vec3::new(normal.x * turn.y, normal.y, normal.x * turn.x);
            let metres = Vec2::new(column as f32 * around, length[row as usize]);
            (frame.point(position), frame.direction(normal), metres)
        });
    }

    /// [`Self::lathe`] for each profile: the edge between two profiles stays sharp.
    pub(super) fn turned(&mut self, surface: Surface, frame: &Frame, segments: u32, profiles: &[&[(f32, f32)]]) {
        for profile in profiles {
            self.lathe(surface, frame, segments, profile);
        }
    }

    /// Adds a prism about the local `y` with flat sides: `outline` is (radius, height) from the bottom up.
    pub(super) fn prism(&mut self, surface: Surface, frame: &Frame, sides: u32, outline: &[(f32, f32)]) {
        for side in 0..sides {
            // Flat sides face the axes where `sides` is a multiple of four.
            let (a, b) = (on_circle(2 * side + 1, 2 * sides), on_circle(2 * side + 3, 2 * sides));
            for pair in outline.windows(2) {
                let at = |turn: Vec2, (radius, height): (f32, f32)| Vec3::new(radius * turn.y, height, radius * turn.x);
                let corners = [at(a, pair[0]), at(b, pair[0]), at(b, pair[1]), at(a, pair[1])];
                if pair[1].0 == 0.0 {
                    self.polygon(surface, frame, &corners[..3]);
                } else {
                    self.polygon(surface, frame, &corners);
                }
            }
        }
    }

    /// Adds a tapering tube along a path of (point, radius), open at both ends, with smooth sides.
    pub(super) fn tube(&mut self, surface: Surface, frame: &Frame, segments: u32, path: &[(Vec3, f32)]) {
        let last = path.len() - 1;
        let axes: Vec<(Vec3, Vec3)> = (0..path.len())
            .map(|index| {
                let along = (path[(index + 1).min(last)].0 - path[index.saturating_sub(1)].0).normalize_or(Vec3::Y);
                let helper = if along.y.abs() < 0.9 { Vec3::Y } else { Vec3::X };
                let side = along.cross(helper).normalize();
                (side, side.cross(along))
            })
            .collect();
        let mut length = 0.0;
        let lengths: Vec<f32> = (0..path.len())
            .map(|index| {
                length += path[index].0.distance(path[index.saturating_sub(1)].0);
                length
            })
            .collect();
        self.grid(surface, segments, last as u32, |column, row| {
            let turn = on_circle(segments - column, segments);
            let (side, other) = axes[row as usize];
            let (center, radius) = path[row as usize];
            let normal = side * turn.x + other * turn.y;
            let metres = Vec2::new(column as f32 / segments as f32 * radius * 6.0, lengths[row as usize]);
            (frame.point(center + normal * radius), frame.direction(normal).normalize(), metres)
        });
    }

    /// The mesh, with `materials[surface]` as the index of each surface's material.
    pub(super) fn finish(self, name: &str, materials: &[Option<u32>]) -> Mesh {
        let groups = self
            .groups
            .into_iter()
            .enumerate()
            .filter(|(_, triangles)| !triangles.is_empty())
            .filter_map(|(surface, triangles)| Some(Group { material: materials[surface]?, triangles }))
            .collect();
        Mesh {
            name: name.to_owned(),
            positions: self.positions,
            normals: self.normals,
            texcoords: self.texcoords,
            groups,
            ..Mesh::default()
        }
    }

    /// Marks the surfaces that have triangles.
    pub(super) fn mark_used(&self, used: &mut [bool]) {
        for (surface, triangles) in self.groups.iter().enumerate() {
            used[surface] |= !triangles.is_empty();
        }
    }
}
