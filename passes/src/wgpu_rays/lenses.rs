//! The exact spheres that focus the light of a pass, as programs read them (`programs/light_focused.wgsl`, `lens.wgsl` and `ball.wgsl`).

use super::layout::{LENS_HEAD, LENS_WORDS, NODE_WORDS};
use crate::effects::dielectric::{Ball, Lenses, Turned, light_axis, light_blur};
use curitiba_pipeline::backend::RayJob;
use glam::{DVec3, Vec3};

/// A number in two parts, which have 48 bits together.
fn parts(number: f64) -> [f32; 2] {
    let high = number as f32;
    [high, (number - f64::from(high)) as f32]
}

/// The words of a job's lenses, which will lie at `place` in the tables: see [`LENS_HEAD`]. Without lenses, no points follow the head.
pub fn words(job: &RayJob<'_>, lenses: &Lenses, place: u32) -> Vec<u32> {
    let ball = lenses.balls().first();
    let points = ball.into_iter().flat_map(Ball::quadratures);
    let points: Vec<f32> = points.flat_map(|point| point.as_vec2().to_array()).collect();
    let flags_at = place + LENS_HEAD + points.len() as u32 + LENS_WORDS * lenses.iter().count() as u32;
    let nodes_at = flags_at + lenses.by_sphere().len() as u32;
    let node_words = NODE_WORDS * ball.map_or(0, |ball| ball.nodes().len() as u32);
    let axis = light_axis(job.sun.map_or(Vec3::ZERO, |sun| -sun.direction));
    let [axis, rest] = two_of(axis);
    let blur = (light_blur(job.params.sun) as f32).to_bits();
    let head = [lenses.iter().count() as u32, blur, flags_at].into_iter().chain(axis).chain(rest);
    let lens = lenses.iter().flat_map(|(lens, _)| {
        let [high, low] = parts(1.0 / lens.radius).map(f32::to_bits);
        let [x, y, z] = lens.center.as_vec3().to_array().map(f32::to_bits);
        let nodes = nodes_at + node_words * lenses.ball_of(lens) as u32;
        [x, y, z, (lens.radius as f32).to_bits(), high, low, lens.id, lens.material, nodes]
    });
    let flags = lenses.by_sphere().iter().map(|focuses| u32::from(*focuses));
    let nodes = lenses.balls().iter().flat_map(nodes);
    head.chain(points.into_iter().map(f32::to_bits)).chain(lens).chain(flags).chain(nodes).collect()
}

fn two_of(vector: DVec3) -> [[u32; 3]; 2] {
    let all = vector.to_array().map(parts);
    [0, 1].map(|part| all.map(|parts| parts[part].to_bits()))
}

/// The nodes for an index of refraction, `NODE_WORDS` words each, as `turned_at` of `programs/ball.wgsl` reads them.
pub fn nodes(ball: &Ball) -> Vec<u32> {
    let words = |ray: &Turned| -> [f32; NODE_WORDS as usize] {
        let [sin, sin_rest] = parts(ray.sin);
        let [turn_sin, turn_sin_rest] = parts(-ray.direction.x);
        let [turn_cos, turn_cos_rest] = parts(ray.direction.y);
        let inner_sin = ray.sin / ball.index();
        let (cos, inner, rate) = (ray.cos as f32, ray.inner as f32, ray.rate() as f32);
        [sin, sin_rest, cos, turn_sin, turn_sin_rest, turn_cos, turn_cos_rest, inner_sin as f32, inner, rate]
    };
    ball.nodes().iter().flat_map(words).map(f32::to_bits).collect()
}
