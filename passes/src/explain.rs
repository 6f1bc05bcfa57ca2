//! Records every ray of one pixel, to explain the pixel's colour.

use crate::cpu;
use crate::trace::{
    Bvh, Event, Hit, Outcome, Purpose, Quality, RecordedRay, Recorder, SphereTree, SurfacePoint, Tracer, WithSpheres,
};
use curitiba_pipeline::backend::{Arriving, BackendError, NO_TRIANGLE, RayJob, Shade};
use curitiba_pipeline::programs::RayProgram;
use glam::{Vec3, Vec4};
use std::fmt;

/// The rays and the value of a ray pass at one pixel.
#[derive(Debug, Clone)]
pub struct PixelRays<'a> {
    job: RayJob<'a>,
    /// Column and row from the top.
    pub pixel: [u32; 2],
    /// The value that the program wrote. With a filter, the value before it.
    pub value: [f32; 4],
    /// The program's calls of the tracer, in order.
    pub events: Vec<Event>,
}

/// Runs the program of a job for one of its pixels, on a tree built for the purpose, and records every ray.
///
/// The value is bit for bit that of the whole pass at this pixel. With a filter, it is the value before the filter.
///
/// # Errors
/// If the job lacks a buffer that its program reads. Also if it samples glass to an error or shoots photons: both need the whole picture.
///
/// # Panics
/// If the pixel is outside the job's images.
pub fn pixel<'a>(job: &RayJob<'a>, x: u32, y: u32) -> Result<PixelRays<'a>, BackendError> {
    let is_transparent =
        |(index, shade): (usize, &Shade)| shade.alpha_cutoff.is_some() || job.shadow_glass.get(index) == Some(&true);
    let transparent: Vec<bool> = job.shades.iter().enumerate().map(is_transparent).collect();
    let triangles = Bvh::build(&job.scene.geometry, &transparent, Quality::default());
    if job.scene.geometry.spheres.is_empty() {
        return pixel_on(&triangles, job, x, y);
    }
    let spheres = SphereTree::build(&job.scene.geometry, &transparent);
    pixel_on(&WithSpheres { triangles: &triangles, spheres: &spheres }, job, x, y)
}

/// As [`pixel`], on any tracer of the job's scene.
///
/// # Errors
/// As [`pixel`].
///
/// # Panics
/// As [`pixel`].
pub fn pixel_on<'a>(tracer: &impl Tracer, job: &RayJob<'a>, x: u32, y: u32) -> Result<PixelRays<'a>, BackendError> {
    assert!(x < job.width && y < job.height, "pixel {x},{y} of {} x {}", job.width, job.height);
    let index = y as usize * job.width as usize + x as usize;
    let shown = job.triangle.get(index).copied().filter(|triangle| *triangle != NO_TRIANGLE);
    let recorder = Recorder::new(tracer, &job.scene.geometry, shown);
    let value = if job.program == RayProgram::Dummy {
        job.color.get(index).copied().unwrap_or_default()
    } else {
        cpu::trace_pixel(&recorder, job, x, y)?
    };
    let mut events = recorder.events();
    // Before its pixels, a pass looks for the bodies that the camera and spheres are in, by rays that nobody announces. They ask for the
    // closest hit, which no shadow ray does.
    events.retain(|event| {
        let Event::Ray(RecordedRay { purpose, outcome, .. }) = event else { return true };
        *purpose != Purpose::Shadow || !matches!(outcome, Outcome::Hit(_) | Outcome::Miss)
    });
    Ok(PixelRays { job: *job, pixel: [x, y], value, events })
}

impl PixelRays<'_> {
    fn index(&self) -> usize {
        let [x, y] = self.pixel;
        y as usize * self.job.width as usize + x as usize
    }

    fn triangle(&self, triangle: u32) -> String {
        let geometry = &self.job.scene.geometry;
        let (what, material) = match geometry.sphere(triangle) {
            Some(sphere) => ("sphere", sphere.material),
            None => ("triangle", geometry.material_of(triangle)),
        };
        let material = material as usize;
        let name = self.job.scene.materials.get(material).map_or("", |material| material.name.as_str());
        let glass = if self.job.glass.get(material) == Some(&true) { ", glass" } else { "" };
        format!("{what} {triangle} `{name}`{glass}")
    }

    fn hit(&self, hit: &Hit) -> String {
        let surface = self.triangle(hit.triangle);
        match self.job.scene.geometry.sphere(hit.triangle) {
            Some(_) => format!("{surface} at t {}", hit.t),
            None => format!("{surface} at t {}, u {}, v {}", hit.t, hit.u, hit.v),
        }
    }

    fn write_ray(&self, f: &mut fmt::Formatter<'_>, number: usize, recorded: &RecordedRay) -> fmt::Result {
        let RecordedRay { purpose, bounce, weight, ray, leaves, offset, outcome, asked } = recorded;
        let bounce = if *bounce > 0 { format!(" after {bounce} bounces") } else { String::new() };
        writeln!(f, "  {number:4} {} ray{bounce}, weight {weight}", purpose.name())?;
        let leaves = match leaves {
            Some(id) if self.job.scene.geometry.sphere(*id).is_some() => format!(", {offset:.3e} off sphere {id}"),
            Some(triangle) => format!(", {offset:.3e} off triangle {triangle}"),
            None => String::new(),
        };
        writeln!(f, "       from   {}{leaves}", vector(ray.origin))?;
        writeln!(f, "       along  {}, t above {} and below {}", vector(ray.direction), ray.t_min, ray.t_max)?;
        for (hit, accepted) in asked {
            let what = if *accepted { "stops at" } else { "passes" };
            writeln!(f, "       {what} {}", self.hit(hit))?;
        }
        match outcome {
            Outcome::Hit(hit) => writeln!(f, "       hits   {}", self.hit(hit)),
            Outcome::Blocked(hit) => writeln!(f, "       blocked by {}", self.hit(hit)),
            Outcome::Miss => writeln!(f, "       misses"),
            Outcome::Open => writeln!(f, "       open"),
        }
    }
}

fn vector(v: Vec3) -> String {
    format!("({}, {}, {})", v.x, v.y, v.z)
}

fn channels([x, y, z, w]: [f32; 4]) -> String {
    format!("({x}, {y}, {z}, {w})")
}

impl fmt::Display for PixelRays<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (job, index) = (&self.job, self.index());
        let geometry = &job.scene.geometry;
        for (name, buffer) in [("colour", job.color), ("position", job.position), ("normal", job.normal)] {
            if let Some(stored) = buffer.get(index) {
                writeln!(f, "  {name:9} {}", channels(*stored))?;
            }
        }
        match job.triangle.get(index) {
            Some(&NO_TRIANGLE) => writeln!(f, "  shows no triangle")?,
            Some(&triangle) => {
                writeln!(f, "  shows     {}", self.triangle(triangle))?;
                if let Some(stored) = job.position.get(index) {
                    let stored = Vec4::from_array(*stored).truncate();
                    let (point, off, what) = match geometry.sphere(triangle) {
                        Some(sphere) => {
                            let from = stored.as_dvec3().distance(sphere.center.as_dvec3());
                            (SurfacePoint::on_sphere(sphere, stored), from - f64::from(sphere.radius), "sphere")
                        }
                        None => {
                            let point = SurfacePoint::snap(geometry, triangle, stored);
                            let from = stored.as_dvec3() - geometry.corners(triangle)[0].as_dvec3();
                            (point, from.dot(point.normal.as_dvec3()), "triangle's plane")
                        }
                    };
                    writeln!(f, "  snapped   {}", vector(point.position))?;
                    writeln!(
                        f,
                        "  the stored position is {off:.3e} off the {what}, a snapped one at most {:.3e}",
                        point.error
                    )?;
                }
            }
            None => {}
        }
        if let Some(stored) = job.position.get(index).filter(|_| job.triangle.get(index) != Some(&NO_TRIANGLE)) {
            let point = Vec4::from_array(*stored).truncate();
            for (number, light) in job.lights.iter().enumerate() {
                let Arriving { towards, factor } = light.at(point);
                let color = vector(light.color * factor);
                writeln!(
                    f,
                    "  light {number:<3} arrives as {color} from {}, before cosine and shadow",
                    vector(towards)
                )?;
            }
        }
        let rays = self.events.iter().filter(|event| matches!(event, Event::Ray(_))).count();
        writeln!(f, "  wrote     {} after {rays} rays", channels(self.value))?;
        if let Some(asked) = job.program.asks_of_filter(&job.params) {
            writeln!(f, "  {asked}: the picture has an average of this share and its neighbours'")?;
        }
        let mut number = 0;
        for event in &self.events {
            match event {
                Event::Ray(ray) => {
                    number += 1;
                    self.write_ray(f, number, ray)?;
                }
                Event::Certain { origin, normal, t_max } => writeln!(
                    f,
                    "       certain without a ray: nothing within {t_max} of {} on the side of {}",
                    vector(*origin),
                    vector(*normal)
                )?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
