//! The rays of a pixel.

use curitiba::passes::explain;
use curitiba::passes::trace::{Event, Outcome};
use curitiba::pipeline::backend::RayJob;
use curitiba::pipeline::executor::{Observer, Output, Progress, StepKind};
use curitiba::pipeline::image::Image;
use glam::Vec3;
use std::sync::Arc;

/// Rays that hit nothing are drawn at most this long, as a share of the scene's radius.
const OPEN: f32 = 0.25;

/// The values and rays of the passes at a pixel.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PixelRays {
    /// Column and row from the top left.
    pub pixel: [u32; 2],
    /// The value of each output at this pixel: pass, output, value.
    pub values: Vec<(String, String, [f32; 4])>,
    /// The lines of `curitiba render --pixel` about rays.
    pub lines: Vec<String>,
    /// The rays, to be drawn over the picture.
    pub segments: Vec<Segment>,
}

/// A ray from its origin to its hit. A ray that hits nothing ends at its `t_max`, or at a quarter of the scene's radius if that is nearer.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// `shadow`, `occlusion`, `reflected` or `refracted`.
    pub purpose: &'static str,
    /// Its origin, in world space.
    pub from: Vec3,
    /// Its end, in world space.
    pub to: Vec3,
    /// Whether it hits something.
    pub meets: bool,
}

/// Collects the values and rays of a pixel from a frame.
pub(super) struct Inspector {
    pub found: PixelRays,
    /// Radius of the scene.
    pub radius: f32,
    pub failed: Option<String>,
}

impl Observer for Inspector {
    fn begin(&mut self, _: StepKind, _: &str, _: &Arc<Progress>) {}

    fn end(&mut self) {}

    fn wrote(&mut self, output: &Output<'_>) {
        let [x, y] = self.found.pixel;
        if x < output.width && y < output.height {
            let value = output.pixels[y as usize * output.width as usize + x as usize];
            self.found.values.push((output.pass.to_owned(), output.channel.clone(), value));
        }
    }

    fn traced(&mut self, pass: &str, job: &RayJob<'_>, _: &Image) {
        let [x, y] = self.found.pixel;
        if x >= job.width || y >= job.height {
            return;
        }
        match explain::pixel(job, x, y) {
            Ok(rays) => {
                self.found.lines.push(format!("pass `{pass}` {}", job.program.info().stem));
                self.found.lines.extend(rays.to_string().lines().map(str::to_owned));
                self.found.segments.extend(rays.events.iter().filter_map(|event| segment(event, self.radius)));
            }
            Err(error) => self.failed = Some(format!("pass `{pass}`, pixel {x},{y}: {error}")),
        }
    }
}

fn segment(event: &Event, radius: f32) -> Option<Segment> {
    let Event::Ray(recorded) = event else { return None };
    let (length, meets) = match &recorded.outcome {
        Outcome::Hit(hit) | Outcome::Blocked(hit) => (hit.t, true),
        Outcome::Miss | Outcome::Open => (recorded.ray.t_max.min(OPEN * radius), false),
    };
    let (from, direction) = (recorded.ray.origin, recorded.ray.direction);
    Some(Segment { purpose: recorded.purpose.name(), from, to: from + direction * length, meets })
}
