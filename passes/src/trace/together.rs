//! Rays of many fans down the tree together: sorted by direction, so that those of neighbouring origins which run alike
//! share beams.
//!
//! A direction has one of 24 classes: an octant, and the axis along which it is longest. Within a class, the two other
//! components lie in a square, which is cut into cells in Z-order. A counting sort by class and cell keeps the order of the
//! fans, so that callers who put neighbours side by side get beams that are narrow at their origins too. The sixteen rays
//! of a beam may be of several cells, but are of one class, and the beams of a walk of one octant, as [`walk`] asks.

use super::beam::{Beam, Class};
use super::bundle::{BEAMS, FEW, walk};
use super::bvh::{Bvh, occluded};
use super::dispatch::Work;
use super::lanes::{Mask, Simd};
use super::node::Child;
use super::query::Query;
use super::{Fan, Hit, PACKET, Packet, Ray};
use glam::Vec3;

/// Rays sorted together at most. They are kept on the stack, at ten bytes a ray.
const RAYS: usize = 4096;
/// Cells a side of a class, as a power of two.
const CELL_BITS: u32 = 3;
/// Cells of a class.
const CELLS: usize = 1 << (2 * CELL_BITS);
/// Octants and main axes.
const CLASSES: usize = 24;
/// Classes of an octant: its main axes.
const AXES: usize = 3;
/// The square of a class has this side: where `|z|` is greatest, `|x|` is at most `sqrt(1/2)`.
const SIDE: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// What stands for the class of rays that are traced by themselves: with a component that is zero, or not finite.
const IRREGULAR: usize = CLASSES;

/// See [`Tracer::count_open_together`](super::Tracer::count_open_together). Compiled once, for whatever `accept` is.
pub(super) fn count_open_together(
    bvh: &Bvh,
    fans: &[Fan<'_>],
    open: &mut [u32],
    accept: &mut dyn FnMut(usize, &Hit) -> bool,
) {
    for (open, fan) in open.iter_mut().zip(fans) {
        *open = fan.directions.len() as u32;
    }
    if bvh.root == Child::NONE {
        return;
    }
    let mut batch = Batch { interval: (0.0, 0.0), len: 0, places: [(0, 0); RAYS], buckets: [0; RAYS] };
    let mut next = (0, 0);
    while batch.fill(fans, &mut next) {
        let (places, ends) = batch.sorted();
        let (fans, open) = (fans, &mut *open);
        bvh.lanes.run(Count { bvh, fans, open, accept, interval: batch.interval, places: &places, ends: &ends });
    }
}

/// A ray of the call: its fan, and which of the fan's.
type Place = (u32, u32);

/// Rays with one interval.
struct Batch {
    interval: (f32, f32),
    len: usize,
    /// In the order of the fans.
    places: [Place; RAYS],
    /// Of each: its class, and its cell.
    buckets: [u16; RAYS],
}

/// A bucket for each cell of each class, and one for the irregular rays.
const BUCKETS: usize = CLASSES * CELLS + 1;

impl Batch {
    /// Takes rays from the next on that have one interval. Returns whether there are any.
    fn fill(&mut self, fans: &[Fan<'_>], (next, first): &mut (usize, usize)) -> bool {
        self.len = 0;
        while let Some(fan) = fans.get(*next) {
            let interval = (fan.t_min, fan.t_max);
            if self.len == 0 {
                self.interval = interval;
            } else if self.interval != interval {
                break;
            }
            let regular = fan.t_min < fan.t_max && fan.t_max > 0.0 && (fan.origin * 0.0).element_sum() == 0.0;
            let taken = (fan.directions.len() - *first).min(RAYS - self.len);
            let slots = self.places[self.len..].iter_mut().zip(&mut self.buckets[self.len..]);
            let directions = fan.directions[*first..].iter().zip(*first..);
            for ((place, bucket), (&direction, number)) in slots.zip(directions).take(taken) {
                *place = (*next as u32, number as u32);
                *bucket = if regular { bucket_of(direction) } else { BUCKETS as u16 - 1 };
            }
            self.len += taken;
            *first += taken;
            if *first < fan.directions.len() {
                break;
            }
            (*next, *first) = (*next + 1, 0);
        }
        self.len > 0
    }

    /// The rays by buckets, those of each in the order of the fans, and where each bucket ends.
    fn sorted(&self) -> ([Place; RAYS], [u16; BUCKETS]) {
        let mut ends = [0_u16; BUCKETS];
        let (places, buckets) = (&self.places[..self.len], &self.buckets[..self.len]);
        for &bucket in buckets {
            ends[usize::from(bucket)] += 1;
        }
        let mut sum = 0;
        for end in &mut ends {
            let count = *end;
            *end = sum;
            sum += count;
        }
        let mut sorted = [(0, 0); RAYS];
        for (&bucket, &place) in buckets.iter().zip(places) {
            let end = &mut ends[usize::from(bucket)];
            sorted[usize::from(*end) & (RAYS - 1)] = place;
            *end += 1;
        }
        (sorted, ends)
    }
}

/// Takes sorted rays down the tree.
struct Count<'a> {
    bvh: &'a Bvh,
    fans: &'a [Fan<'a>],
    open: &'a mut [u32],
    accept: &'a mut dyn FnMut(usize, &Hit) -> bool,
    interval: (f32, f32),
    places: &'a [Place; RAYS],
    ends: &'a [u16; BUCKETS],
}

impl Work<()> for Count<'_> {
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        let mut packets = [Packet::NONE; BEAMS];
        let mut beams = [Beam::EMPTY; BEAMS];
        let mut owners = [[0; PACKET]; BEAMS];
        let (mut len, mut class, mut start) = (0, 0, 0);
        while class <= IRREGULAR {
            let end = usize::from(self.ends[((class + 1) * CELLS).min(BUCKETS) - 1]);
            let places = &self.places[start..end.min(start + PACKET)];
            start += places.len();
            if places.len() < FEW as usize || class == IRREGULAR {
                for &place in places {
                    self.ray(simd, place);
                }
            } else {
                let packet = &mut packets[len];
                (packet.t_min, packet.t_max, packet.active) = (self.interval.0, self.interval.1, 0);
                for (lane, &(fan, number)) in places.iter().enumerate() {
                    let of_ray = &self.fans[fan as usize];
                    packet.set(lane, of_ray.origin, of_ray.directions[number as usize]);
                    owners[len][lane] = fan;
                }
                let lanes = Mask::from(packet.active);
                let class = Class::of_regular(class % AXES, (class / AXES) as u32);
                beams[len].prepare(simd, packet, (len, lanes, class), &self.bvh.bounds);
                len += 1;
            }
            let before = class;
            class += usize::from(start == end);
            let ends = class / AXES != before / AXES;
            if len == BEAMS || ends && len > 0 {
                self.walk(simd, &packets, &mut beams[..len], &owners);
                len = 0;
            }
        }
    }
}

impl Count<'_> {
    #[inline(always)]
    fn walk<S: Simd>(
        &mut self,
        simd: S,
        packets: &[Packet; BEAMS],
        beams: &mut [Beam],
        owners: &[[u32; PACKET]; BEAMS],
    ) {
        let accept = &mut self.accept;
        let mut accept = |ray: usize, hit: &Hit| accept(owners[ray / PACKET][ray % PACKET] as usize, hit);
        walk::<S, false>(simd, self.bvh, packets, beams, &mut accept);
        for beam in beams {
            let mut blocked = Mask::from(packets[beam.packet].active) & !beam.open;
            while blocked != 0 {
                let lane = blocked.trailing_zeros() as usize;
                blocked &= blocked - 1;
                self.open[owners[beam.packet][lane] as usize] -= 1;
            }
        }
    }

    /// Traces a ray by itself.
    #[inline(always)]
    fn ray<S: Simd>(&mut self, simd: S, (index, number): Place) {
        let index = index as usize;
        let Fan { origin, t_min, t_max, directions, .. } = self.fans[index];
        let ray = Ray { origin, direction: directions[number as usize], t_min, t_max };
        let Some(query) = Query::new(&ray, &self.bvh.bounds) else { return };
        let accept = &mut self.accept;
        if occluded(simd, self.bvh, self.bvh.root, &query, &mut |hit: &Hit| accept(index, hit)) {
            self.open[index] -= 1;
        }
    }
}

/// The bucket of a direction.
#[inline(always)]
fn bucket_of(direction: Vec3) -> u16 {
    let size = direction.abs();
    let longest = size.max_element();
    if !(size.min_element() >= f32::MIN_POSITIVE && longest < f32::INFINITY) {
        return BUCKETS as u16 - 1;
    }
    let (axis, x, y) = if size.x == longest {
        (0, size.y, size.z)
    } else if size.y == longest {
        (1, size.z, size.x)
    } else {
        (2, size.x, size.y)
    };
    let octant = direction.to_array().iter().rev().fold(0, |octant, d| octant << 1 | d.to_bits() >> 31);
    // The last cells take what is beyond, from directions that are no unit vectors.
    let cell = |along: f32| (along * ((1 << CELL_BITS) as f32 / SIDE)).min((1 << CELL_BITS) as f32 - 1.0) as u32;
    let (x, y) = (cell(x), cell(y));
    (((octant * AXES as u32 + axis) << (2 * CELL_BITS)) | interleaved(x, y)) as u16
}

/// The place of a cell in Z-order.
#[inline(always)]
fn interleaved(x: u32, y: u32) -> u32 {
    (0..CELL_BITS).fold(0, |cell, bit| cell | (x >> bit & 1) << (2 * bit) | (y >> bit & 1) << (2 * bit + 1))
}
