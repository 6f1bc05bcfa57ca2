//! Hills all around, a far ridge, and the part of the sky opposite the sun.
//!
//! There is no sky on the sun's side: it would block the sun's light. Rays in that direction miss.

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

/// Height of the land in the unit direction `way` from the fountain, at distance `radius`.
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
        let normal = Vec3::new(-way.x, 0.7, -way.y).normalize();
        (Vec3::new(plan.x, height, plan.y), normal, Vec2::ZERO)
    });
}

/// A flat screen perpendicular to the sun's horizontal direction, with an angled wing at each end. Since the screen is flat, only its
/// texture varies its brightness. Shading and geometric normals agree, so occlusion rays that start on it never hit it.
fn sky(builder: &mut Builder, detail: Detail) {
    const AWAY: f32 = 380.0;
    const HALF: f32 = 610.0;
    const BOTTOM: f32 = -2.0;
    const TOP: f32 = 520.0;
    const WING: f32 = 300.0;
    let ahead = Vec2::new(SUN.x, SUN.z).normalize();
    // To the right as seen from the square.
    let right = Vec2::new(-ahead.y, ahead.x);
    let (cos, sin) = cos_sin(0.11);
    let (along, back) = (WING * cos as f32, WING * sin as f32);
    let corners = [(-HALF - along, AWAY - back), (-HALF, AWAY), (HALF, AWAY), (HALF + along, AWAY - back)];
    let corners = corners.map(|(side, away)| FOUNTAIN + right * side + ahead * away);
    let (columns, rows) = (detail.curve(6), detail.curve(3));
    let mut start = -HALF - WING;
    for pair in corners.windows(2) {
        let span = pair[1] - pair[0];
        let length = span.length();
        let normal = Vec3::new(span.x, 0.0, span.y).cross(Vec3::Y).normalize();
        builder.grid(Surface::Sky, columns, rows, |column, row| {
            let share = column as f32 / columns as f32;
            let height = row as f32 / rows as f32;
            let plan = pair[0] + span * share;
            let position = Vec3::new(plan.x, BOTTOM + (TOP - BOTTOM) * height, plan.y);
            // Clamped by half a texel: the zenith must not bleed into the horizon.
            (position, normal, Vec2::new((start + length * share) / 900.0, 0.004 + 0.992 * height))
        });
        start += length;
    }
}
