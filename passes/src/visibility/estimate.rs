//! Computes the row of a pair on the processor.

use super::contour::exchange;
use super::cover::Walls;
use super::points::{REPLICATES, Table};
use super::rules::apart;
use super::sampling::Sampling;
use super::segments::{BATCH, Batch};
use super::shaft::{Gathered, Pair, Polygon, Shaft};
use super::{Class, Facing, Options, Row, RowFinder, Surfaces};
use crate::trace::{Ray, Recent, Tracer};
use curitiba_pipeline::backend::BackendError;
use glam::Vec3;
use rayon::prelude::*;

/// Pairs that a thread takes at a time.
pub(super) const GRAIN: usize = 256;

/// What decides pairs: the triangles, the options, and the sample points.
#[derive(Debug)]
pub(super) struct Method<'a> {
    pub(super) surfaces: &'a Surfaces,
    pub(super) options: Options,
    pub(super) table: Table,
}

/// Buffers that a thread reuses for every pair.
#[derive(Debug, Default)]
pub struct Room {
    pub(super) gathered: Gathered,
    walls: Walls,
    pub(super) batch: Batch,
    recent: Recent,
}

/// What is known of a pair before any segment is sampled.
#[allow(clippy::large_enum_variant, reason = "one at a time, on the stack")]
pub(super) enum Found {
    /// The row is exact.
    Exact(Row),
    /// The pair must be sampled; the triangles in the shaft were gathered.
    Gathered(Sampling),
    /// The pair must be sampled; the shaft holds too many triangles to gather.
    Many(Sampling),
}

impl<'a> Method<'a> {
    /// # Errors
    /// If the options are not valid; the message says what would be valid.
    pub(super) fn new(surfaces: &'a Surfaces, options: Options) -> Result<Self, String> {
        options.check()?;
        let points = options.most() / REPLICATES as u32;
        let table = Table::new(options.sampler, points);
        Ok(Self { surfaces, options, table })
    }

    /// Whether a pair is given in the order in which it is estimated: `(a, b)` and `(b, a)` are one pair with one result. If the corners of
    /// both are equal, the order does not matter.
    pub(super) fn is_in_order(&self, pair: [u32; 2]) -> bool {
        let surfaces = self.surfaces;
        let [first, second] = pair.map(|id| surfaces.all[id as usize].key);
        let bits = |id: u32| surfaces.corners(id).map(|corner| corner.to_array().map(f64::to_bits));
        first < second || first == second && bits(pair[0]) <= bits(pair[1])
    }

    /// Decides a pair as far as that is possible without sampling; the pair must be in order.
    pub(super) fn find(&self, ids: [u32; 2], room: &mut Room) -> Found {
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
            return Found::Exact(exact(Class::Never, visibility));
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
            return Found::Exact(Row { form_factors, ..open });
        }
        let Room { gathered, walls, batch, .. } = room;
        if !many && ends_are_blocked(&pair, gathered, batch) && walls.cover(&gathered.blockers, &pair, &shaft) {
            return Found::Exact(exact(Class::Closed, Some(0.0)));
        }
        let [a, b] = ids.map(|id| self.surfaces.all[id as usize].key);
        let key = [a[0] ^ b[0].rotate_left(16), a[1] ^ b[1].rotate_left(16)];
        let sampling = Sampling::new(pair, key, &self.options);
        if many { Found::Many(sampling) } else { Found::Gathered(sampling) }
    }

    /// The exchange (see `contour`) of a pair with nothing between. It uses the triangles themselves, without the offsets of ray origins.
    fn unblocked(&self, pair: &Pair) -> f64 {
        let [p, q] = pair.sides.map(|side| self.surfaces.corners(side.id).map(|corner| corner - pair.origin));
        let [n, m] = pair.sides.map(|side| side.normal);
        let front = Polygon::above(p, |point| m.dot(point - q[0]));
        let other = Polygon::above(q, |point| n.dot(point - p[0]));
        if front.corners().len() < 3 || other.corners().len() < 3 {
            return 0.0;
        }
        let parts = front.fan().flat_map(|p| other.fan().map(move |q| (p, q)));
        let far: Option<f64> = parts.map(|(p, q)| apart(&p, &q)).sum();
        far.unwrap_or_else(|| exchange(&front, &other))
    }

    /// Samples a pair until its row is good enough. `block` computes which segments of a batch are blocked.
    pub(super) fn sample(
        &self,
        mut sampling: Sampling,
        batch: &mut Batch,
        mut block: impl FnMut(&Sampling, &mut Batch),
    ) -> Row {
        loop {
            let mut next = Some(sampling.first());
            while let Some(step) = next {
                sampling.fill(&self.table, self.options.seed, step, batch);
                block(&sampling, batch);
                sampling.add(step, batch);
                next = sampling.after(step);
            }
            if let Some(row) = sampling.end_round(&self.options) {
                return row;
            }
        }
    }
}

/// Finds rows on the processor.
///
/// The tracer must be built on [`Surfaces::geometry`] with [`Surfaces::marks`]. It is used only for pairs with more than 128 triangles in
/// the shaft.
#[derive(Debug)]
pub struct Estimator<'a, T> {
    method: Method<'a>,
    tracer: &'a T,
}

impl<'a, T: Tracer> Estimator<'a, T> {
    /// # Errors
    /// If the options are not valid; the message says what would be valid.
    pub fn new(surfaces: &'a Surfaces, tracer: &'a T, options: Options) -> Result<Self, String> {
        Ok(Self { method: Method::new(surfaces, options)?, tracer })
    }

    /// The options of the estimator.
    #[must_use]
    pub fn options(&self) -> &Options {
        &self.method.options
    }

    /// Replaces `rows` by the rows of the pairs, in their order, computed on rayon's global pool.
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
        let in_order = self.method.is_in_order(pair);
        let ids = if in_order { pair } else { [pair[1], pair[0]] };
        let row = match self.method.find(ids, room) {
            Found::Exact(row) => row,
            Found::Gathered(sampling) => {
                let Room { gathered, batch, .. } = room;
                self.method.sample(sampling, batch, |_, batch| batch.block(&gathered.blockers))
            }
            Found::Many(sampling) => {
                let Room { batch, recent, .. } = room;
                self.method.sample(sampling, batch, |sampling, batch| self.trace(sampling, batch, recent))
            }
        };
        if in_order { row } else { row.swapped() }
    }

    /// Traces the segments of a batch.
    fn trace(&self, sampling: &Sampling, batch: &mut Batch, recent: &mut Recent) {
        let surfaces = self.method.surfaces;
        let own = sampling.pair.sides.map(|side| side.id);
        let (mut rays, mut lanes, mut count) = ([Ray::NONE; BATCH], [0; BATCH], 0);
        for lane in (0..BATCH).filter(|lane| batch.valid[*lane] == 1) {
            let segment = sampling.ray(batch, lane, 0);
            let [origin, direction] = [segment.from, segment.along].map(Vec3::from_array);
            rays[count] = Ray { origin, direction, t_min: 0.0, t_max: segment.end };
            lanes[count] = lane;
            count += 1;
        }
        let blocks = |id: u32| !own.contains(&id) && surfaces.is_opaque(id);
        let blocked = self.tracer.blocked_by(&rays[..count], recent, blocks);
        batch.blocked = [0; BATCH];
        for (index, lane) in lanes[..count].iter().enumerate() {
            batch.blocked[*lane] = blocked >> index & 1;
        }
    }
}

impl<T: Tracer> RowFinder for Estimator<'_, T> {
    fn options(&self) -> &Options {
        Estimator::options(self)
    }

    fn rows(&mut self, pairs: &[[u32; 2]], rows: &mut Vec<Row>) -> Result<(), BackendError> {
        Estimator::rows(self, pairs, rows);
        Ok(())
    }
}

/// Whether all segments between corners of both fronts are blocked: a cheap necessary condition for all segments to be blocked.
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
    // Both fronts have at most four corners, so there are at most 16 segments.
    batch.block_first::<16>(&gathered.blockers);
    batch.blocked[..lane].iter().all(|blocked| *blocked == 1)
}
