//! Computes the rows of many pairs, with segments that a device traces.

use super::estimate::{Found, GRAIN, Method, Room};
use super::sampling::{Sampling, Step};
use super::segments::{BATCH, Batch};
use super::{Options, Row, RowFinder, Surfaces};
use crate::trace::{Segment, SegmentTracer, Segments};
use curitiba_pipeline::backend::BackendError;
use rayon::prelude::*;

/// Number of pairs that are decided at a time, before the device traces segments of those that need it.
const TOGETHER: usize = 1 << 14;
/// Approximate number of segments in a launch: 32 MiB.
const LAUNCH: usize = 1 << 20;

/// Finds rows with a device.
///
/// The processor decides pairs, and samples those with few triangles in the shaft, as [`Estimator`](super::Estimator) does. For the other
/// pairs it makes the same segments as [`Estimator`](super::Estimator), and the device traces them.
pub struct DeviceEstimator<'a> {
    method: Method<'a>,
    tracer: Box<dyn SegmentTracer + 'a>,
    segments: Segments,
    bits: Vec<u32>,
}

/// A pair that waits for the device.
struct Waiting {
    /// Index of the pair in its chunk.
    place: usize,
    in_order: bool,
    sampling: Sampling,
    /// The first step that was not traced yet.
    next: Step,
    /// The steps that are traced in this launch.
    asked: Vec<Asked>,
    segments: Vec<Segment>,
}

/// A step of a pair's segments that the device traces in this launch.
struct Asked {
    step: Step,
    /// Valid lanes, one bit a lane.
    valid: u64,
    /// Weights of the valid lanes; empty unless form factors are computed.
    weights: Vec<f64>,
}

impl std::fmt::Debug for DeviceEstimator<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DeviceEstimator").field("tracer", &self.tracer.name()).finish_non_exhaustive()
    }
}

impl<'a> DeviceEstimator<'a> {
    /// An estimator with a tracer that was made for these triangles.
    ///
    /// # Errors
    /// If the options are not valid; the message says what would be valid.
    pub fn new(surfaces: &'a Surfaces, tracer: Box<dyn SegmentTracer + 'a>, options: Options) -> Result<Self, String> {
        let method = Method::new(surfaces, options)?;
        Ok(Self { method, tracer, segments: Segments::default(), bits: Vec::new() })
    }

    /// The implementation of [`RowFinder::rows`].
    fn find(&mut self, pairs: &[[u32; 2]], rows: &mut Vec<Row>) -> Result<(), BackendError> {
        rows.clear();
        for pairs in pairs.chunks(TOGETHER) {
            let first = rows.len();
            let mut waiting = self.decide(pairs, rows);
            while !waiting.is_empty() {
                self.launch(&mut waiting)?;
                let options = &self.method.options;
                let ended: Vec<(usize, Row)> =
                    waiting.par_iter_mut().filter_map(|waiting| waiting.end(options)).collect();
                let mut ends = ended.iter().peekable();
                waiting.retain(|waiting| ends.next_if(|(place, _)| *place == waiting.place).is_none());
                for (place, row) in ended {
                    rows[first + place] = row;
                }
            }
        }
        Ok(())
    }

    /// Appends the rows of some pairs, and returns the pairs that wait for the device; the rows of those are placeholders.
    fn decide(&self, pairs: &[[u32; 2]], rows: &mut Vec<Row>) -> Vec<Waiting> {
        let method = &self.method;
        let decide = |room: &mut Room, (place, pair): (usize, &[u32; 2])| {
            let in_order = method.is_in_order(*pair);
            let ids = if in_order { *pair } else { [pair[1], pair[0]] };
            let row = match method.find(ids, room) {
                Found::Exact(row) => row,
                Found::Gathered(sampling) => {
                    let Room { gathered, batch, .. } = room;
                    method.sample(sampling, batch, |_, batch| batch.block(&gathered.blockers))
                }
                Found::Many(sampling) => {
                    let next = sampling.first();
                    let (asked, segments) = (Vec::new(), Vec::new());
                    return Err(Box::new(Waiting { place, in_order, sampling, next, asked, segments }));
                }
            };
            Ok(if in_order { row } else { row.swapped() })
        };
        let found: Vec<_> = pairs.par_iter().enumerate().with_min_len(GRAIN).map_init(Room::default, decide).collect();
        let mut waiting = Vec::new();
        for found in found {
            rows.push(match found {
                Ok(row) => row,
                Err(pair) => {
                    waiting.push(*pair);
                    Row::NONE
                }
            });
        }
        waiting
    }

    /// Traces the next steps of all waiting pairs on the device, and adds the results to their tallies.
    fn launch(&mut self, waiting: &mut [Waiting]) -> Result<(), BackendError> {
        let Self { method, tracer, segments, bits } = self;
        let steps = (LAUNCH / BATCH / waiting.len()).max(1);
        let fill = |batch: &mut Batch, (pair, waiting): (usize, &mut Waiting)| {
            waiting.ask(method, steps, pair as u32, batch);
        };
        waiting.par_iter_mut().enumerate().for_each_init(Batch::default, fill);
        segments.all.clear();
        segments.own.clear();
        for waiting in &*waiting {
            segments.all.extend_from_slice(&waiting.segments);
            segments.own.push(waiting.sampling.pair.sides.map(|side| side.id));
        }
        tracer.blocked(segments, bits)?;
        let mut first = 0;
        let starts: Vec<usize> = waiting
            .iter()
            .map(|waiting| {
                let start = first;
                first += waiting.segments.len();
                start
            })
            .collect();
        let bits = &*bits;
        let add = |batch: &mut Batch, (waiting, start): (&mut Waiting, usize)| waiting.add(bits, start, batch);
        waiting.par_iter_mut().zip(starts).for_each_init(Batch::default, add);
        Ok(())
    }
}

impl RowFinder for DeviceEstimator<'_> {
    fn options(&self) -> &Options {
        &self.method.options
    }

    fn rows(&mut self, pairs: &[[u32; 2]], rows: &mut Vec<Row>) -> Result<(), BackendError> {
        self.find(pairs, rows)
    }
}

impl Waiting {
    /// Makes the segments of the next steps of this round, at most `steps` of them.
    fn ask(&mut self, method: &Method<'_>, steps: usize, pair: u32, batch: &mut Batch) {
        let Self { sampling, asked, segments, next, .. } = self;
        asked.clear();
        segments.clear();
        let mut step = Some(*next);
        while let Some(now) = step.filter(|_| asked.len() < steps) {
            sampling.fill(&method.table, method.options.seed, now, batch);
            let (mut valid, mut weights) = (0, Vec::new());
            for lane in (0..BATCH).filter(|lane| batch.valid[*lane] == 1) {
                valid |= 1 << lane;
                segments.push(sampling.ray(batch, lane, pair));
                if method.options.form_factors {
                    weights.push(batch.weight[lane]);
                }
            }
            asked.push(Asked { step: now, valid, weights });
            step = sampling.after(now);
        }
    }

    /// Adds the device's results to the pair's tallies; the results for this pair start at bit `start`.
    fn add(&mut self, bits: &[u32], start: usize, batch: &mut Batch) {
        let mut place = start;
        for Asked { step, valid, weights } in &self.asked {
            let mut weights = weights.iter();
            for lane in 0..BATCH {
                let is_valid = valid >> lane & 1;
                batch.valid[lane] = is_valid;
                (batch.weight[lane], batch.blocked[lane]) = (0.0, 0);
                if is_valid == 1 {
                    batch.weight[lane] = weights.next().copied().unwrap_or(0.0);
                    batch.blocked[lane] = u64::from(bits[place / 32] >> (place % 32) & 1);
                    place += 1;
                }
            }
            self.sampling.add(*step, batch);
        }
    }

    /// Advances to the next step. After the last round, returns the pair's index in its chunk and its row; before that, `None`.
    fn end(&mut self, options: &Options) -> Option<(usize, Row)> {
        let last = self.asked.last()?.step;
        if let Some(next) = self.sampling.after(last) {
            self.next = next;
            return None;
        }
        let row = self.sampling.end_round(options);
        self.next = self.sampling.first();
        row.map(|row| (self.place, if self.in_order { row } else { row.swapped() }))
    }
}
