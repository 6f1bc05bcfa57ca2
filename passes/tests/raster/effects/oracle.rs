//! Screen-space occlusion in `f64`, pixel by pixel and step by step as the formulas are written: the reference for the
//! processor's vector code.

use curitiba_passes::raster::effects::occlusion::{JITTERS, most_pixels};
use curitiba_passes::sampling::hash::{fraction, occlusion_bits, unit};
use curitiba_pipeline::backend::EffectJob;
use curitiba_pipeline::raster_effects::EffectProgram;
use glam::{DMat4, DVec2, DVec3, DVec4, Vec4};
use std::f64::consts::PI;

/// The open share of a pixel.
#[derive(Debug, Clone, Copy)]
pub struct Open {
    pub share: f64,
    /// False if a step is so close to another pixel, or to another limit, that rounding to `f32` may decide about it.
    pub decided: bool,
}

/// The job, and values that all its pixels share.
pub struct Oracle<'a> {
    job: EffectJob<'a>,
    clip_from_world: DMat4,
    eye: DVec3,
    /// Distance from a pixel's edge in pixels, and relative distance from other limits, below which a step is
    /// undecided.
    margin: f64,
}

/// The line of the picture on which a slice is seen, in pixels.
struct Line {
    from: DVec2,
    along: DVec2,
    /// Length along the slice that covers one pixel.
    pixel: f64,
    /// Pixels to the end of the radius on both sides.
    ends: [f64; 2],
}

impl Line {
    /// The place in the picture of a step, from its share of the way to the line's end.
    fn step(&self, side: usize, share: f64) -> [f64; 2] {
        let pixels = 1.0 + (self.ends[side] - 1.0) * share * share;
        (self.from + self.along * [1.0, -1.0][side] * pixels).to_array()
    }
}

/// The pixel that a step along a slice reads.
enum Step {
    Outside,
    Itself,
    At(usize),
}

impl<'a> Oracle<'a> {
    pub fn new(job: &EffectJob<'a>, margin: f64) -> Self {
        Self { job: *job, clip_from_world: job.view.clip_from_world.as_dmat4(), eye: job.view.eye.as_dvec3(), margin }
    }

    pub fn open(&self, x: u32, y: u32) -> Open {
        let index = (y * self.job.width + x) as usize;
        let position = vector(self.job.position[index]);
        let (Some(to_eye), Some(normal)) =
            ((self.eye - position).try_normalize(), vector(self.job.normal[index]).try_normalize())
        else {
            return Open { share: 1.0, decided: true };
        };
        let normal = if normal.dot(to_eye) < 0.0 { -normal } else { normal };
        let mut open = match self.job.program {
            EffectProgram::HorizonOcclusion if self.job.params.bitmask => {
                self.by_sectors([x, y], position, to_eye, normal)
            }
            EffectProgram::HorizonOcclusion => self.by_horizons([x, y], position, to_eye, normal),
            EffectProgram::DepthOcclusion => self.by_depths([x, y], position, to_eye, normal),
            other => panic!("{other:?} is no occlusion"),
        };
        open.share = open.share.clamp(0.0, 1.0).powf(self.job.params.intensity.into());
        open
    }

    /// The unit vector `T` of a slice, perpendicular to the direction to the eye (see `raster::effects::occlusion`), and the jitters of the
    /// slice's two sides.
    fn slice(&self, [x, y]: [u32; 2], index: u32, to_eye: DVec3) -> (DVec3, [f64; 2]) {
        let bits = occlusion_bits(x, y, self.job.seed);
        let offset = f64::from(unit(bits[0]));
        let (sin, cos) = (PI * (f64::from(index) + offset) / f64::from(self.job.params.slices)).sin_cos();
        // The tangents of Duff and others 2017, listing 3: the choice of tangents is a part of the method.
        let DVec3 { x, y, z } = to_eye;
        let sign = 1f64.copysign(z);
        let (a, b) = (-1.0 / (sign + z), -x * y / (sign + z));
        let tangent = DVec3::new(1.0 + sign * x * x * a, sign * b, -sign * x);
        let bitangent = DVec3::new(b, sign + y * y * a, -y);
        let jitter = |side: usize| fraction(bits[2 + side].wrapping_add(JITTERS[side].wrapping_mul(index))).into();
        (tangent * cos + bitangent * sin, [jitter(0), jitter(1)])
    }

    fn place(&self, position: DVec3) -> Option<[f64; 2]> {
        let DVec4 { x, y, w, .. } = self.clip_from_world * position.extend(1.0);
        let (width, height) = (f64::from(self.job.width), f64::from(self.job.height));
        (w > 0.0).then(|| [(0.5 + 0.5 * x / w) * width, (0.5 - 0.5 * y / w) * height])
    }

    /// The pixel that shows a position.
    fn look(&self, [x, y]: [u32; 2], position: DVec3, decided: &mut bool) -> Step {
        self.place(position).map_or(Step::Outside, |place| self.look_at([x, y], place, decided))
    }

    /// The pixel at a column and row.
    fn look_at(&self, [x, y]: [u32; 2], [column, row]: [f64; 2], decided: &mut bool) -> Step {
        *decided &= [column, row].iter().all(|at| (at - at.round()).abs() > self.margin);
        let [width, height] = [self.job.width, self.job.height];
        if !(column >= 0.0 && row >= 0.0 && column < width.into() && row < height.into()) {
            return Step::Outside;
        }
        let at = [column as u32, row as u32];
        if at == [x, y] { Step::Itself } else { Step::At((at[1] * width + at[0]) as usize) }
    }

    /// The difference from `position` to the position that a pixel shows; `None` if it shows nothing.
    fn difference(&self, index: usize, position: DVec3) -> Option<DVec3> {
        let stored = self.job.position[index];
        (stored != [0.0; 4]).then(|| vector(stored) - position).filter(|delta| delta.is_finite())
    }

    /// The line of the picture on which a slice is seen.
    fn line(&self, position: DVec3, across: DVec3) -> Line {
        // The direction of the line comes from a small difference of positions.
        let small = 1e-6 * (self.eye - position).length();
        let near = [1.0, -1.0].map(|side| self.place(position + across * small * side));
        let from = self.place(position).map_or(DVec2::NAN, DVec2::from_array);
        let moved = near[0].zip(near[1]).map_or(DVec2::ZERO, |(a, b)| DVec2::from_array(a) - DVec2::from_array(b));
        let most = f64::from(most_pixels(self.job.width, self.job.height));
        let ends = [1.0, -1.0].map(|side| {
            let end = self.place(position + across * side * f64::from(self.job.params.radius));
            end.map_or(most, |end| (DVec2::from_array(end) - from).length().min(most))
        });
        Line { from, along: moved.normalize_or_zero(), pixel: 2.0 * small / moved.length(), ends }
    }

    fn by_horizons(&self, pixel: [u32; 2], position: DVec3, to_eye: DVec3, normal: DVec3) -> Open {
        let radius = f64::from(self.job.params.radius);
        let (mut visible, mut whole, mut decided) = (0.0, 0.0, true);
        for index in 0..self.job.params.slices {
            let (across, jitter) = self.slice(pixel, index, to_eye);
            let aside = to_eye.cross(across);
            let off = normal.dot(aside);
            let projected = normal - aside * off;
            let weight = projected.length();
            if weight * weight < 1e-6 {
                continue;
            }
            let (sin, cos) = (projected.dot(across) / weight, projected.dot(to_eye) / weight);
            let shear = (aside - normal * off) / (weight * weight);
            let line = self.line(position, across);
            decided &= (line.pixel / radius - 1.0).abs() > self.margin;
            for (number, (side, jitter)) in [1.0, -1.0].into_iter().zip(jitter).enumerate() {
                let open = -side * sin;
                let mut horizon = open;
                let steps = if line.pixel < radius { self.job.params.steps } else { 0 };
                for step in 0..steps {
                    let share = (f64::from(step) + jitter) / f64::from(self.job.params.steps);
                    let Step::At(seen) = self.look_at(pixel, line.step(number, share), &mut decided) else {
                        continue;
                    };
                    let Some(delta) = self.difference(seen, position) else { continue };
                    let moved = delta - shear * delta.dot(aside);
                    let (x, y) = (side * moved.dot(across), moved.dot(to_eye));
                    decided &= (x.hypot(y) / radius - 1.0).abs() > self.margin;
                    decided &= x.abs() > self.margin * delta.length();
                    if x.hypot(y) <= radius && x > 0.0 {
                        horizon = f64::max(horizon, y / x.hypot(y));
                    }
                }
                let (gamma, sign) = (sin.atan2(cos), side);
                let arc = |cosine: f64| {
                    let h = sign * cosine.clamp(-1.0, 1.0).acos();
                    0.25 * (-(2.0 * h - gamma).cos() + gamma.cos() + 2.0 * h * gamma.sin())
                };
                whole += weight * arc(open);
                visible += weight * arc(horizon);
            }
        }
        Open { share: if whole > 0.0 { visible / whole } else { 1.0 }, decided }
    }

    /// The open share by sectors as in the paper, with a list of 32 sectors that are each tested at one angle.
    fn by_sectors(&self, pixel: [u32; 2], position: DVec3, to_eye: DVec3, normal: DVec3) -> Open {
        let (radius, thickness) = (f64::from(self.job.params.radius), f64::from(self.job.params.thickness));
        let slices = self.job.params.slices;
        let jitter_of_sectors = f64::from(unit(occlusion_bits(pixel[0], pixel[1], self.job.seed)[1]));
        let (mut visible, mut whole, mut decided) = (0.0, 0.0, true);
        for index in 0..slices {
            let (across, jitter) = self.slice(pixel, index, to_eye);
            let aside = to_eye.cross(across);
            let off = normal.dot(aside);
            let projected = normal - aside * off;
            let weight = projected.length();
            if weight * weight < 1e-6 {
                continue;
            }
            let gamma = projected.dot(across).atan2(projected.dot(to_eye));
            let shear = (aside - normal * off) / (weight * weight);
            let line = self.line(position, across);
            decided &= (line.pixel / radius - 1.0).abs() > self.margin;
            // The integral of `cos(h - γ) |sin h|` from the eye's direction to a signed angle, clamped at the tangent
            // plane.
            let contribution = |angle: f64| {
                let h = angle.clamp(gamma - 0.5 * PI, gamma + 0.5 * PI);
                h.signum() * 0.25 * (-(2.0 * h - gamma).cos() + gamma.cos() + 2.0 * h * gamma.sin())
            };
            let (first, last) = (contribution(-PI), contribution(PI));
            let turned = (jitter_of_sectors + f64::from(index as f32 / slices as f32)).fract();
            let mut shut = [false; 32];
            for (number, (side, jitter)) in [1.0, -1.0].into_iter().zip(jitter).enumerate() {
                let steps = if line.pixel < radius { self.job.params.steps } else { 0 };
                for step in 0..steps {
                    let share = (f64::from(step) + jitter) / f64::from(self.job.params.steps);
                    let Step::At(seen) = self.look_at(pixel, line.step(number, share), &mut decided) else {
                        continue;
                    };
                    let Some(delta) = self.difference(seen, position) else { continue };
                    let moved = delta - shear * delta.dot(aside);
                    let front = DVec2::new(moved.dot(across), moved.dot(to_eye));
                    decided &= front.x.abs() > self.margin * delta.length();
                    if side * front.x <= 0.0 {
                        continue;
                    }
                    // Both ends of the part within the radius: the roots of `|front + s away| = radius`.
                    let away = (front - DVec2::new(0.0, (self.eye - position).length())).normalize();
                    let (half_b, c) = (front.dot(away), front.length_squared() - radius * radius);
                    let discriminant = half_b * half_b - c;
                    decided &= discriminant.abs() > self.margin * radius * radius;
                    if discriminant <= 0.0 {
                        continue;
                    }
                    let ends =
                        [(-half_b - discriminant.sqrt()).max(0.0), (-half_b + discriminant.sqrt()).min(thickness)];
                    decided &= (ends[1] - ends[0]).abs() > self.margin * radius;
                    if ends[1] <= ends[0] {
                        continue;
                    }
                    let [a, b] = ends.map(|end| {
                        let DVec2 { x, y } = front + away * end;
                        (contribution(x.atan2(y)) - first) / (last - first)
                    });
                    for (sector, shut) in (0u32..).zip(&mut shut) {
                        let tested = (f64::from(sector) + turned) / 32.0;
                        decided &= [a, b].iter().all(|end| (end - tested).abs() > self.margin / 32.0);
                        *shut |= a.min(b) < tested && tested <= a.max(b);
                    }
                }
            }
            let open = shut.iter().filter(|shut| !**shut).count() as f64 / 32.0;
            whole += weight * (last - first);
            visible += weight * (last - first) * open;
        }
        Open { share: if whole > 0.0 { visible / whole } else { 1.0 }, decided }
    }

    fn by_depths(&self, pixel: [u32; 2], position: DVec3, to_eye: DVec3, normal: DVec3) -> Open {
        let radius = f64::from(self.job.params.radius);
        let tolerance = f64::from(curitiba_passes::raster::effects::occlusion::DEPTH_TOLERANCE) * radius;
        let (mut occluded, mut samples, mut decided) = (0u32, 0u32, true);
        for index in 0..self.job.params.slices {
            let (across, jitter) = self.slice(pixel, index, to_eye);
            for (side, jitter) in [1.0, -1.0].into_iter().zip(jitter) {
                for step in 0..self.job.params.steps {
                    let share = (f64::from(step) + jitter) / f64::from(self.job.params.steps);
                    let at = position + across * side * radius * share.sqrt();
                    let Step::At(seen) = self.look(pixel, at, &mut decided) else { continue };
                    samples += 1;
                    let height = self.difference(seen, position).map_or(0.0, |delta| delta.dot(normal));
                    decided &= (height / tolerance - 1.0).abs() > self.margin;
                    occluded += u32::from(height > tolerance);
                }
            }
        }
        Open { share: 1.0 - f64::from(occluded) / f64::from(samples.max(1)), decided }
    }
}

fn vector(stored: [f32; 4]) -> DVec3 {
    Vec4::from_array(stored).truncate().as_dvec3()
}
