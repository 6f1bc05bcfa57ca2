//! The segments of a pair that is not decided exactly, and the estimate from them: the same on every engine.

use super::points::{REPLICATES, Table};
use super::segments::{BATCH, Batch};
use super::shaft::{Pair, Side};
use super::sphere::Spherical;
use super::{Class, Effort, Facing, Options, Row, Sampler};
use crate::trace::Segment;
use glam::DVec3;
use std::f64::consts::PI;

/// Number of segments with which an estimate to a given error begins.
const FIRST: u32 = 64;
/// Pairs nearer than this, in radii of the larger triangle, have their form factors sampled by solid angle: sampled by area, their variance
/// is unbounded where triangles touch.
const NEAR: f64 = 2.0;
/// The rule of three: where n samples all agree, the share that differs from them is below 3 / n with 95 % confidence.
const THREE: f64 = 3.0;

/// Sums of a pair's segments, by replicate: valid segments, open ones, and the weights of open ones; and the total weight of all valid ones.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    valid: [f64; REPLICATES],
    open: [f64; REPLICATES],
    carried: [f64; REPLICATES],
    offered: f64,
}

/// What a step's segments estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    /// Segments between uniform points: the visibility, and the form factor of pairs that are not near.
    Seen,
    /// Segments in directions uniform in solid angle: the form factor of near pairs.
    Carried,
}

/// A batch of a pair's segments: eight points of each replicate, from point `first` on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Step {
    part: Part,
    first: u32,
}

/// A pair while it is sampled, in rounds of steps; after each round the estimate may be good enough.
#[derive(Debug, Clone)]
pub(super) struct Sampling {
    pub(super) pair: Pair,
    key: [u32; 2],
    near: bool,
    /// A power of two that is not shorter than any segment.
    reach: f32,
    /// Number of segments at the end of the round.
    samples: u32,
    /// Number of points of a replicate that earlier rounds used.
    done: u32,
    seen: Tally,
    carried: Tally,
}

impl Sampling {
    pub(super) fn new(pair: Pair, key: [u32; 2], options: &Options) -> Self {
        let samples = match options.effort {
            Effort::Samples(samples) => samples,
            Effort::Error(_) => FIRST,
        };
        let near = options.form_factors && is_near(&pair);
        let (seen, carried) = (Tally::default(), Tally::default());
        let reach = reach(&pair);
        Self { pair, key, near, reach, samples, done: 0, seen, carried }
    }

    /// Number of points of a replicate at the end of the round.
    fn points(&self) -> u32 {
        self.samples / REPLICATES as u32
    }

    /// The first step of the round.
    pub(super) fn first(&self) -> Step {
        Step { part: Part::Seen, first: self.done }
    }

    /// The step after `step`; `None` at the end of the round.
    pub(super) fn after(&self, step: Step) -> Option<Step> {
        let first = step.first + 8;
        if first < self.points() {
            return Some(Step { first, ..step });
        }
        let turns = step.part == Part::Seen && self.near;
        turns.then_some(Step { part: Part::Carried, first: self.done })
    }

    /// Fills a batch with the segments of a step.
    pub(super) fn fill(&self, table: &Table, seed: u32, step: Step, batch: &mut Batch) {
        match step.part {
            Part::Seen => batch.fill(table, &self.pair, (self.key, seed), step.first, self.points()),
            Part::Carried => self.towards(table, seed, step.first, batch),
        }
    }

    /// Adds the segments of a step, once it is known which are blocked.
    pub(super) fn add(&mut self, step: Step, batch: &Batch) {
        let tally = match step.part {
            Part::Seen => &mut self.seen,
            Part::Carried => &mut self.carried,
        };
        tally.add(batch);
    }

    /// Ends the round. Returns the row if it is good enough or the number of segments is at its limit; else doubles that number and begins
    /// the next round.
    pub(super) fn end_round(&mut self, options: &Options) -> Option<Row> {
        let row = self.summary(options);
        let error =
            if options.form_factors { row.form_factor_errors[0].max(row.form_factor_errors[1]) } else { row.error };
        let wanted = match options.effort {
            Effort::Samples(_) => return Some(row),
            Effort::Error(wanted) => wanted,
        };
        if error <= wanted || self.samples >= Options::MOST {
            return Some(row);
        }
        self.done = self.points();
        self.samples *= 2;
        if options.sampler == Sampler::Hammersley {
            // Hammersley sets of different sizes share no points, so the estimate starts anew.
            (self.seen, self.carried, self.done) = (Tally::default(), Tally::default(), 0);
        }
        None
    }

    /// A segment as a ray in `f32`. Dividing by a power of two instead of the length keeps its direction as exact as its ends.
    pub(super) fn ray(&self, batch: &Batch, lane: usize, pair: u32) -> Segment {
        let [from, to] = batch.get(lane).map(|end| (end + self.pair.origin).as_vec3());
        let along = (to.as_dvec3() - from.as_dvec3()) / f64::from(self.reach);
        Segment { from: from.to_array(), end: self.reach, along: along.as_vec3().to_array(), pair }
    }

    fn summary(&self, options: &Options) -> Row {
        let Self { pair, samples, seen, .. } = self;
        let (samples, carried) = (*samples, self.near.then_some(&self.carried));
        let valid: f64 = seen.valid.iter().sum();
        let open: f64 = seen.open.iter().sum();
        let each = [f64::from(samples) / REPLICATES as f64; REPLICATES];
        let (share, of) = match options.facing {
            Facing::Skip => (ratio(&seen.open, &seen.valid), valid),
            Facing::Zero => (ratio(&seen.open, &each), f64::from(samples)),
        };
        let agree = open == 0.0 || open == of;
        let (visibility, error) = match share {
            Some((_, _)) if agree => (Some(open / of), (THREE / of).min(1.0)),
            Some((share, error)) => (Some(share.clamp(0.0, 1.0)), error),
            None => (None, 0.0),
        };
        let [a, b] = pair.sides.map(|side| side.area);
        let form_factors = options.form_factors.then(|| {
            let (tally, scale) = carried.map_or((seen, a * b), |carried| (carried, a));
            let (mean, error) = ratio(&tally.carried, &each).unwrap_or_default();
            // Where no segment or every segment is blocked: the rule of three, times what all segments would carry if none were blocked.
            let valid: f64 = tally.valid.iter().sum();
            let open: f64 = tally.open.iter().sum();
            let offered = tally.offered / f64::from(samples);
            let bound = if open == 0.0 || open == valid { offered * (THREE / valid.max(1.0)).min(1.0) } else { 0.0 };
            (mean * scale, error.max(bound) * scale)
        });
        Row {
            pair: pair.sides.map(|side| side.id),
            class: Class::Sampled,
            visibility,
            error,
            form_factors: form_factors.map(|(mean, _)| [mean / a, mean / b]),
            form_factor_errors: form_factors.map_or([0.0; 2], |(_, error)| [error / a, error / b]),
            samples,
            valid: valid as u32,
        }
    }

    /// Segments from uniform points of the first triangle, in directions uniform in the solid angle of the part of the second triangle that
    /// is in front of the first.
    fn towards(&self, table: &Table, seed: u32, first: u32, batch: &mut Batch) {
        let ([a, b], points) = (&self.pair.sides, self.points());
        // The changed key and seed give points independent of those for the visibility. The first point is the origin, the second selects a
        // direction.
        batch.fill(table, &self.pair, ([self.key[1], self.key[0]], seed ^ 1 << 31), first, points);
        for lane in 0..BATCH {
            let [from, to] = batch.get(lane);
            batch.valid[lane] = 0;
            batch.weight[lane] = 0.0;
            if first + (lane as u32 & 7) >= points || b.height(from) <= 0.0 {
                continue;
            }
            let [u, v] = unmapped(b, to);
            let parts: [Option<Spherical>; 2] = {
                let mut parts = b.front.fan().map(|corners| Spherical::new(from, corners));
                [parts.next().flatten(), parts.next().flatten()]
            };
            let whole: f64 = parts.iter().flatten().map(|part| part.area).sum();
            if whole == 0.0 {
                self.by_area(batch, lane);
                continue;
            }
            let share = parts[0].map_or(0.0, |part| part.area / whole);
            let (part, u) = if u < share { (parts[0], u / share) } else { (parts[1], (u - share) / (1.0 - share)) };
            let Some(part) = part else { continue };
            let direction = part.direction(u.clamp(0.0, 1.0), v);
            let distance = -b.height(from) / b.normal.dot(direction);
            let cosine = a.normal.dot(direction);
            if distance.is_finite() && distance > 0.0 && cosine > 0.0 {
                batch.set(lane, from, from + distance * direction);
                batch.weight[lane] = cosine * whole / PI;
            }
        }
    }

    /// Weights a segment between uniform points, without changing it.
    fn by_area(&self, batch: &mut Batch, lane: usize) {
        let [a, b] = &self.pair.sides;
        let [from, to] = batch.get(lane);
        let along = to - from;
        let (leaving, arriving) = (a.normal.dot(along), -b.normal.dot(along));
        if leaving > 0.0 && arriving > 0.0 {
            batch.valid[lane] = 1;
            let square = along.length_squared();
            batch.weight[lane] = b.area * leaving * arriving / (PI * square * square);
        }
    }
}

impl Tally {
    fn add(&mut self, batch: &Batch) {
        for lane in 0..BATCH {
            let valid = batch.valid[lane];
            let open = valid & (1 - (batch.blocked[lane] & 1));
            let replicate = lane / 8;
            self.valid[replicate] += valid as f64;
            self.open[replicate] += open as f64;
            self.carried[replicate] += open as f64 * batch.weight[lane];
            self.offered += valid as f64 * batch.weight[lane];
        }
    }
}

/// The ratio of two sums over replicates, and its standard error; `None` if the second sum is 0.
fn ratio(above: &[f64; REPLICATES], below: &[f64; REPLICATES]) -> Option<(f64, f64)> {
    let (sum, whole) = (above.iter().sum::<f64>(), below.iter().sum::<f64>());
    if whole == 0.0 {
        return None;
    }
    let count = REPLICATES as f64;
    let ratio = sum / whole;
    let squares: f64 = above.iter().zip(below).map(|(a, b)| (a - ratio * b).powi(2)).sum();
    Some((ratio, (squares * count / (count - 1.0)).sqrt() / whole))
}

/// Whether two triangles are near each other, relative to their size.
fn is_near(pair: &Pair) -> bool {
    let [(m, r), (n, s)] = pair.sides.map(|side| {
        let middle = side.start.iter().sum::<DVec3>() / 3.0;
        (middle, side.start.iter().fold(0.0_f64, |radius, corner| radius.max(corner.distance(middle))))
    });
    m.distance(n) - r - s < NEAR * r.max(s)
}

/// The least power of two that is not shorter than any segment of a pair, clamped to 2^-120 to 2^120, which `f32` can hold.
fn reach(pair: &Pair) -> f32 {
    let [a, b] = pair.sides.map(|side| side.start);
    let longest = a.iter().flat_map(|from| b.iter().map(|to| from.distance(*to))).fold(0.0, f64::max);
    // The factor covers the rounding of the ends.
    let exponent = (longest * (1.0 + 1e-6)).log2().ceil();
    exponent.clamp(-120.0, 120.0).exp2() as f32
}

/// The point of the unit square that the uniform map takes to a point of a side.
fn unmapped(side: &Side, point: DVec3) -> [f64; 2] {
    let [a, b, c] = side.start;
    let (e, f, to) = (b - a, c - a, point - a);
    let (ee, ef, ff) = (e.dot(e), e.dot(f), f.dot(f));
    let determinant = ee * ff - ef * ef;
    let u = (ff * to.dot(e) - ef * to.dot(f)) / determinant;
    let v = (ee * to.dot(f) - ef * to.dot(e)) / determinant;
    let root = u + v;
    [(root * root).clamp(0.0, 1.0), if root > 0.0 { (v / root).clamp(0.0, 1.0) } else { 0.5 }]
}
