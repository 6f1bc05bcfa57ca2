//! The light of several lights, and of positional lights, on the pixels of a row.

use super::{ROW, Rows, TILE, Wanted};
use crate::raster::cpu::frame::Frame;
use curitiba_pipeline::backend::{Arriving, Light};
use curitiba_pipeline::scene::normal_map;
use glam::{Vec3, Vec4};

/// The light that arrives at a point: the sum of the lights' colours, each times its cosine. The last component is the greatest cosine of a
/// light that arrives.
pub(in crate::raster::cpu) fn sum_of_lights(lights: &[Light], point: Vec3, cosine: impl Fn(Vec3) -> f32) -> Vec4 {
    let mut sum = Vec4::ZERO;
    for light in lights {
        let Arriving { towards, factor } = light.at(point);
        let cosine = if factor > 0.0 { cosine(towards) } else { 0.0 };
        sum += (light.color * (factor * cosine)).extend(0.0);
        sum.w = sum.w.max(cosine);
    }
    sum
}

impl Rows {
    /// Computes the arriving light and the light cosines of a row from the positions and normals of its pixels.
    pub(super) fn light_by_many(&mut self, frame: &Frame<'_>, wanted: Wanted) {
        if !wanted.light {
            self.arriving = [[0.0; ROW]; 4];
            return;
        }
        let lights = frame.job.lights;
        for column in 0..TILE {
            let at = |rows: &[[f32; ROW]]| Vec3::new(rows[0][column], rows[1][column], rows[2][column]);
            let (point, vertex) = (at(&self.position[0]), at(&self.normal[0]));
            let sum = if wanted.bent && self.is_bent(column) {
                let bent = at(&self.bent);
                sum_of_lights(lights, point, |towards| normal_map::cosine(bent, vertex, towards))
            } else {
                sum_of_lights(lights, point, |towards| vertex.dot(towards).clamp(0.0, 1.0))
            };
            for component in 0..4 {
                self.arriving[component][column] = sum[component];
            }
            self.light[column] = sum.w;
            self.bent[3][column] = sum.w;
        }
    }
}
