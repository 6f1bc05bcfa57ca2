//! From a pair to its row.

use super::contour::{apart, exchange};
use super::cover::Walls;
use super::points::{REPLICATES, Table};
use super::segments::{BATCH, Batch};
use super::shaft::{Gathered, Pair, Polygon, Shaft, Side};
use super::sphere::Spherical;
use super::{Class, Effort, Facing, Options, Row, Sampler, Surfaces};
use crate::trace::{Ray, Tracer};
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Segments that an estimate with a wanted error begins with.
const FIRST: u32 = 64;
/// Nearer than so many radii of the larger, form factors are sampled by solid angles: their variance under uniform areas is unbounded
/// where triangles touch.
const NEAR: f64 = 2.0;
/// The rule of three: where none of n samples differs, the share of those that would is below 3 / n with 95 % certainty.
const THREE: f64 = 3.0;
/// Pairs that a thread takes at a time.
const GRAIN: usize = 256;

/// Finds rows.
///
/// The tracer, of which [`Surfaces::geometry`] and [`Surfaces::marks`] say what to build it on, is asked only where more than
/// 128 triangles are between a pair.
#[derive(Debug)]
pub struct Estimator<'a, T> {
    surfaces: &'a Surfaces,
    tracer: &'a T,
    options: Options,
    table: Table,
}

/// Room that a thread uses again for every pair.
#[derive(Debug, Default)]
pub struct Room {
    gathered: Gathered,
    walls: Walls,
    batch: Batch,
}

/// Sums by replicate.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    valid: [f64; REPLICATES],
    open: [f64; REPLICATES],
    carried: [f64; REPLICATES],
    offered: f64,
}

/// What stands in the way of a pair.
struct Way<'r> {
    pair: Pair,
    gathered: &'r Gathered,
    /// There are more than were gathered.
    many: bool,
    key: [u32; 2],
}

impl<'a, T: Tracer> Estimator<'a, T> {
    /// # Errors
    /// What would be valid, if the options are not.
    pub fn new(surfaces: &'a Surfaces, tracer: &'a T, options: Options) -> Result<Self, String> {
        options.check()?;
        let points = options.most() / REPLICATES as u32;
        let table = Table::new(options.sampler, points);
        Ok(Self { surfaces, tracer, options, table })
    }

    /// What it was made with.
    #[must_use]
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// The rows of some pairs, in their order, over rayon's global pool.
    ///
    /// # Panics
    /// If there is no triangle with such an id.
    pub fn rows(&self, pairs: &[[u32; 2]], rows: &mut Vec<Row>) {
        pairs
            .par_iter()
            .with_min_len(GRAIN)
            .map_init(Room::default, |room, pair| self.row(*pair, room))
            .collect_into_vec(rows);
    }

    /// The row of a pair.
    ///
    /// # Panics
    /// If there is no triangle with such an id.
    #[must_use]
    pub fn row(&self, pair: [u32; 2], room: &mut Room) -> Row {
        let surfaces = self.surfaces;
        let [first, second] = pair.map(|id| surfaces.all[id as usize].key);
        let bits = |id: u32| surfaces.corners(id).map(|corner| corner.to_array().map(f64::to_bits));
        // One order for both questions. Where even the corners are the same, so is the result.
        let in_order = first < second || first == second && bits(pair[0]) <= bits(pair[1]);
        if in_order { self.ordered(pair, room) } else { self.ordered([pair[1], pair[0]], room).swapped() }
    }

    fn ordered(&self, ids: [u32; 2], room: &mut Room) -> Row {
        let form_factors = self.options.form_factors;
        let exact = |class, visibility| Row {
            pair: ids,
            class,
            visibility,
            error: 0.0,
            form_factors: form_factors.then_some([0.0; 2]),
            form_factor_errors: [0.0; 2],
            samples: 0,
            valid: 0,
        };
        let Some(pair) = Pair::new(self.surfaces, ids) else {
            let visibility = match self.options.facing {
                Facing::Skip => None,
                Facing::Zero => Some(0.0),
            };
            return exact(Class::Never, visibility);
        };
        let shaft = Shaft::new(&pair);
        let many = !shaft.gather(self.surfaces, &pair, &mut room.gathered);
        if !many && room.gathered.blockers.is_empty() {
            let visibility = match self.options.facing {
                Facing::Skip => 1.0,
                Facing::Zero => pair.valid_share(),
            };
            let open = exact(Class::Open, Some(visibility));
            let areas = pair.sides.map(|side| side.area);
            let form_factors = form_factors.then(|| areas.map(|area| self.unblocked(&pair) / area));
            return Row { form_factors, ..open };
        }
        let Room { gathered, walls, batch } = room;
        if !many && ends_are_blocked(&pair, gathered, batch) && walls.cover(&gathered.blockers, &pair, &shaft) {
            return exact(Class::Closed, Some(0.0));
        }
        let [a, b] = ids.map(|id| self.surfaces.all[id as usize].key);
        let key = [a[0] ^ b[0].rotate_left(16), a[1] ^ b[1].rotate_left(16)];
        self.sampled(&Way { pair, gathered, many, key }, batch)
    }

    /// The exchange with nothing in the way, of the triangles themselves: offsets do not enter it.
    fn unblocked(&self, pair: &Pair) -> f64 {
        let [p, q] = pair.sides.map(|side| self.surfaces.corners(side.id).map(|corner| corner - pair.origin));
        let far = if pair.is_whole() { apart(&p, &q) } else { None };
        far.unwrap_or_else(|| {
            let [n, m] = pair.sides.map(|side| side.normal);
            let front = Polygon::above(p, |point| m.dot(point - q[0]));
            let other = Polygon::above(q, |point| n.dot(point - p[0]));
            if front.corners().len() < 3 || other.corners().len() < 3 { 0.0 } else { exchange(&front, &other) }
        })
    }

    fn sampled(&self, way: &Way<'_>, batch: &mut Batch) -> Row {
        let pair = &way.pair;
        let replicates = REPLICATES as u32;
        let (mut samples, wanted) = match self.options.effort {
            Effort::Samples(samples) => (samples, None),
            Effort::Error(error) => (FIRST, Some(error)),
        };
        let near = self.options.form_factors && is_near(pair);
        let (mut seen, mut carried) = (Tally::default(), Tally::default());
        let mut done = 0;
        loop {
            if self.options.sampler == Sampler::Hammersley {
                // Sets of different sizes have nothing in common.
                (seen, carried, done) = (Tally::default(), Tally::default(), 0);
            }
            let points = samples / replicates;
            for first in (done..points).step_by(8) {
                batch.fill(&self.table, pair, (way.key, self.options.seed), first, points);
                self.block(way, batch);
                seen.add(batch);
            }
            if near {
                for first in (done..points).step_by(8) {
                    self.towards(way, batch, first, points);
                    self.block(way, batch);
                    carried.add(batch);
                }
            }
            done = points;
            let row = self.summary(way, samples, &seen, near.then_some(&carried));
            let error = if self.options.form_factors {
                row.form_factor_errors[0].max(row.form_factor_errors[1])
            } else {
                row.error
            };
            if wanted.is_none_or(|wanted| error <= wanted) || samples >= Options::MOST {
                return row;
            }
            samples *= 2;
        }
    }

    fn summary(&self, way: &Way<'_>, samples: u32, seen: &Tally, carried: Option<&Tally>) -> Row {
        let pair = &way.pair;
        let valid: f64 = seen.valid.iter().sum();
        let open: f64 = seen.open.iter().sum();
        let each = [f64::from(samples) / REPLICATES as f64; REPLICATES];
        let (share, of) = match self.options.facing {
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
        let form_factors = self.options.form_factors.then(|| {
            let (tally, scale) = carried.map_or((seen, a * b), |carried| (carried, a));
            let (mean, error) = ratio(&tally.carried, &each).unwrap_or_default();
            // Where none or all of the segments are blocked, the rule of three of what they would carry.
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

    /// Segments from uniform points of the first towards uniform directions of what is seen of the second from there.
    fn towards(&self, way: &Way<'_>, batch: &mut Batch, first: u32, points: u32) {
        let [a, b] = &way.pair.sides;
        // Other points than those of the visibility, by the seed: the first is the origin, the second turns into a direction.
        batch.fill(&self.table, &way.pair, ([way.key[1], way.key[0]], self.options.seed ^ 1 << 31), first, points);
        let corners = b.front.corners();
        for lane in 0..BATCH {
            let [from, to] = batch.get(lane);
            batch.valid[lane] = 0;
            batch.weight[lane] = 0.0;
            if first + (lane as u32 & 7) >= points || b.height(from) <= 0.0 {
                continue;
            }
            let [u, v] = unmapped(b, to);
            let fan = corners.windows(2).skip(1).map(|pair| [corners[0], pair[0], pair[1]]);
            let parts: [Option<Spherical>; 2] = {
                let mut parts = fan.map(|corners| Spherical::new(from, corners));
                [parts.next().flatten(), parts.next().flatten()]
            };
            let whole: f64 = parts.iter().flatten().map(|part| part.area).sum();
            if whole == 0.0 {
                self.by_area(way, batch, lane);
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

    /// The weight of a segment that stays as it is.
    fn by_area(&self, way: &Way<'_>, batch: &mut Batch, lane: usize) {
        let [a, b] = &way.pair.sides;
        let [from, to] = batch.get(lane);
        let along = to - from;
        let (leaving, arriving) = (a.normal.dot(along), -b.normal.dot(along));
        if leaving > 0.0 && arriving > 0.0 {
            batch.valid[lane] = 1;
            let square = along.length_squared();
            batch.weight[lane] = b.area * leaving * arriving / (PI * square * square);
        }
    }

    fn block(&self, way: &Way<'_>, batch: &mut Batch) {
        if !way.many {
            batch.block(&way.gathered.blockers);
            return;
        }
        let own = way.pair.sides.map(|side| side.id);
        let accept = |triangle: u32| !own.contains(&triangle) && self.surfaces.is_opaque(triangle);
        batch.blocked = [0; BATCH];
        for lane in (0..BATCH).filter(|lane| batch.valid[*lane] == 1).collect::<Vec<_>>() {
            let [from, to] = batch.get(lane).map(|end| (end + way.pair.origin).as_vec3());
            let along = to.as_dvec3() - from.as_dvec3();
            let length = along.length();
            let ray = Ray { origin: from, direction: (along / length).as_vec3(), t_min: 0.0, t_max: length as f32 };
            batch.blocked[lane] = u64::from(self.tracer.occluded(&ray, |hit| accept(hit.triangle)));
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

/// The ratio of two sums over replicates and its standard error; nothing if the second is 0.
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

/// Whether all segments between the corners of both fronts are blocked: only then can all be.
fn ends_are_blocked(pair: &Pair, gathered: &Gathered, batch: &mut Batch) -> bool {
    let [a, b] = &pair.sides;
    batch.valid = [0; BATCH];
    let mut lane = 0;
    for from in a.front.corners() {
        for to in b.front.corners() {
            batch.set(lane, *from, *to);
            lane += 1;
        }
    }
    batch.block(&gathered.blockers);
    batch.blocked[..lane].iter().all(|blocked| *blocked == 1)
}

/// Whether two triangles are near each other for their size.
fn is_near(pair: &Pair) -> bool {
    let [(m, r), (n, s)] = pair.sides.map(|side| {
        let middle = side.start.iter().sum::<DVec3>() / 3.0;
        (middle, side.start.iter().fold(0.0_f64, |radius, corner| radius.max(corner.distance(middle))))
    });
    m.distance(n) - r - s < NEAR * r.max(s)
}

/// The point of the unit square that a point of a side comes from: the inverse of the uniform map.
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
