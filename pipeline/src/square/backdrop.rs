//! Hills all around, a far ridge, and the part of the sky that the sun lights frontally.
//!
//! There is no sky on the sun's side: it would hide the sun. Rays that go there meet nothing.

use super::detail::Detail;
use super::math::{cos_sin, fractal, noise, smoothstep};
use super::mesh::Builder;
use super::surface::Surface;
use super::{FOUNTAIN, SUN};
use glam::{Vec2, Vec3};

/// Builds the backdrop.
pub(super) fn build(detail: Detail) -> Builder {
    let mut builder = Builder::default();
    hills(&mut builder, detail);
    sky(&mut builder, detail);
    builder
}

fn around(turn: f64) -> Vec2 {
    let (cos, sin) = cos_sin(turn);
    Vec2::new(cos as f32, sin as f32)
}

/// Height of the land at a place in polar coordinates around the fountain.
fn land(way: Vec2, radius: f32) -> f32 {
    let rolling = fractal(way * 6.0 + Vec2::splat(32.0), 64, 3, 201);
    let bumps = fractal(way * radius / 30.0 + Vec2::splat(64.0), 256, 3, 207) - 0.5;
    let rise = smoothstep(125.0, 250.0, radius);
    // Low towards the sun, so that its light passes.
    let sunward = smoothstep(-0.4, 0.5, way.dot(Vec2::new(SUN.x, SUN.z).normalize()));
    -0.03 + rise * (8.0 + (12.0 + 34.0 * rolling) * (0.35 + 0.65 * sunward)) + 7.0 * rise.min(0.7) * bumps
}

fn hills(builder: &mut Builder, detail: Detail) {
    let (columns, rows) = (detail.round(96), detail.curve(8));
    let (near, far) = (125.0, 300.0);
    builder.grid(Surface::Forest, columns, rows, |column, row| {
        let way = around(f64::from(column) / f64::from(columns));
        let radius = near + (far - near) * row as f32 / rows as f32;
        let at = |way: Vec2, radius: f32| {
            let plan = FOUNTAIN + way * radius;
            Vec3::new(plan.x, land(way, radius), plan.y)
        };
        let beside = around((f64::from(column) + 0.25) / f64::from(columns));
        let (here, right, behind) = (at(way, radius), at(beside, radius), at(way, radius + 4.0));
        let normal = (right - here).cross(behind - here).normalize();
        (here, normal, Vec2::new(here.x, here.z))
    });
    // The far ridge stands behind the hills, hazy: it has no texture.
    builder.grid(Surface::Ridge, columns, 1, |column, row| {
        let way = around(f64::from(column) / f64::from(columns));
        let sunward = smoothstep(-0.5, 0.4, way.dot(Vec2::new(SUN.x, SUN.z).normalize()));
        let height = 22.0
            + 22.0 * sunward
            + 34.0 * sunward * fractal(way * 9.0 + Vec2::splat(32.0), 64, 4, 221)
            + 3.0 * noise(way * 60.0 + Vec2::splat(128.0), 256, 225);
        let (radius, height) = if row == 0 { (301.0, -1.0) } else { (345.0, height) };
        let plan = FOUNTAIN + way * radius;
        let normal = Vec3::new(-way.x, 0.25, -way.y).normalize();
        (Vec3::new(plan.x, height, plan.y), normal, Vec2::ZERO)
    });
}

/// A part of a cylinder, opposite the sun. Its normals all point to the sun: the picture alone gives its brightness.
fn sky(builder: &mut Builder, detail: Detail) {
    let (columns, rows) = (detail.round(32), detail.curve(4));
    let (radius, bottom, top) = (420.0, -2.0, 400.0);
    // Just under half a turn: beyond, the sun would shine on the sky's back.
    let half = 0.238;
    let facing = {
        let way = Vec2::new(SUN.x, SUN.z).normalize();
        (way, Vec2::new(-way.y, way.x))
    };
    builder.grid(Surface::Sky, columns, rows, |column, row| {
        let share = column as f32 / columns as f32;
        let local = around(f64::from(half * (2.0 * share - 1.0)));
        let way = facing.0 * local.x + facing.1 * local.y;
        let plan = FOUNTAIN + way * radius;
        let height = row as f32 / rows as f32;
        let position = Vec3::new(plan.x, bottom + (top - bottom) * height, plan.y);
        // The picture is stretched over the sky once and a half.
        (position, -SUN.normalize(), Vec2::new(share * 1.5, 0.004 + 0.992 * height))
    });
}
