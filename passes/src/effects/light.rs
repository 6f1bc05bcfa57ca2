//! Light: the rays that ask only whether it arrives.

use super::coverage::Coverage;
use super::pass::Pass;
use crate::trace::{Announcement, Hit, PACKET, Purpose, Ray, Tracer};
use glam::Vec3;

/// What light keeps behind an opaque surface.
pub const SHADOWED: f32 = 0.5;
/// What light keeps at each glass surface that it crosses.
pub const THROUGH_GLASS: f32 = 0.9;

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    /// Whether nothing lies between an origin off its surface and the light.
    pub(super) fn sees_light(&self, origin: Vec3, stops: impl FnMut(&Hit) -> bool) -> bool {
        self.announce_visibility(Purpose::Shadow, 1.0);
        !self.tracer.occluded(&self.light_ray(origin), stops)
    }

    pub(super) fn announce_visibility(&self, purpose: Purpose, weight: f32) {
        self.tracer.announce(Announcement { purpose, bounce: 0, weight });
    }

    /// Whether a hit stops light; `crosses` is called where it passes glass instead.
    pub(super) fn blocks_light(&self, hit: &Hit, crosses: impl FnOnce()) -> bool {
        if !self.covers(hit) {
            return false;
        }
        let glass = self.passes_light(hit);
        if glass {
            crosses();
        }
        !glass
    }

    pub(super) fn light_ray(&self, origin: Vec3) -> Ray {
        Ray { origin, direction: self.to_light, t_min: 0.0, t_max: f32::INFINITY }
    }
}

/// What is left of light that is blocked, or else crosses glass at these distances, in any order.
pub(super) fn share_of_light(blocked: bool, crossings: &mut [f32]) -> f32 {
    if blocked {
        SHADOWED
    } else if crossings.is_empty() {
        1.0
    } else {
        THROUGH_GLASS.powi(distinct(crossings) as i32)
    }
}

/// What is left of the light of `rays` rays, one bit each in `blocked`, that cross glass at distances of `crossings`, each with its ray; `each` is
/// told the ray and its share. `distances` is room.
pub(super) fn shares_of_light(
    rays: usize,
    blocked: &[u16],
    crossings: &mut [(u32, f32)],
    distances: &mut Vec<f32>,
    mut each: impl FnMut(usize, f32),
) {
    crossings.sort_unstable_by_key(|(ray, _)| *ray);
    let mut crossings = crossings.iter().peekable();
    for ray in 0..rays {
        distances.clear();
        while let Some((_, t)) = crossings.next_if(|crossing| crossing.0 as usize == ray) {
            distances.push(*t);
        }
        let stopped = blocked[ray / PACKET] >> (ray % PACKET) & 1 == 1;
        each(ray, share_of_light(stopped, distances));
    }
}

/// How many surfaces these hit distances belong to. A tracer may show a hit twice, and a ray through the edge between two
/// triangles meets both: distances no farther apart than the rounding of their computation are one surface.
pub(super) fn distinct(distances: &mut [f32]) -> usize {
    const ROUNDING: f32 = 8.0 * f32::EPSILON;
    distances.sort_unstable_by(f32::total_cmp);
    let steps = distances.windows(2).filter(|pair| pair[1] - pair[0] > ROUNDING * pair[1]).count();
    steps + usize::from(!distances.is_empty())
}

#[cfg(test)]
mod tests {
    use super::distinct;

    #[test]
    fn surfaces_are_counted_once() {
        assert_eq!(distinct(&mut []), 0);
        assert_eq!(distinct(&mut [2.0]), 1);
        assert_eq!(distinct(&mut [2.0, 2.0, 2.000_000_2]), 1);
        assert_eq!(distinct(&mut [3.0, 2.0, 3.0, 2.001]), 3);
    }
}
