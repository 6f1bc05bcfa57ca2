//! Light visibility: rays that only test whether the light arrives.

use super::coverage::Coverage;
use super::pass::Pass;
use crate::trace::{Announcement, Hit, PACKET, Purpose, Ray, Tracer};
use glam::Vec3;

/// Share of the light behind an opaque surface.
pub const SHADOWED: f32 = 0.5;
/// Factor of the light for each glass surface that it crosses.
pub const THROUGH_GLASS: f32 = 0.9;

impl<T: Tracer, C: Coverage> Pass<'_, T, C> {
    /// Whether the light is visible from `origin`: there is no hit on the way to the light for which `stops` is true. `origin` must be
    /// offset from its surface.
    pub(super) fn sees_light(&self, origin: Vec3, stops: impl FnMut(&Hit) -> bool) -> bool {
        self.announce_visibility(Purpose::Shadow, 1.0);
        !self.tracer.occluded(&self.light_ray(origin), stops)
    }

    pub(super) fn announce_visibility(&self, purpose: Purpose, weight: f32) {
        self.tracer.announce(Announcement { purpose, bounce: 0, weight });
    }

    /// Whether a hit stops light. Where light passes glass instead, `crosses` is called.
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

/// The light's share along one ray: `hidden` if the ray is `blocked`, else 0.9 for each glass surface crossed. `crossings` are the distances
/// of the glass hits, in any order. `hidden` is the share behind an opaque surface.
pub(super) fn share_of_light(hidden: f32, blocked: bool, crossings: &mut [f32]) -> f32 {
    if blocked {
        hidden
    } else if crossings.is_empty() {
        1.0
    } else {
        THROUGH_GLASS.powi(distinct(crossings) as i32)
    }
}

/// Calls `each` with every ray's index and light share. `blocked` has one bit for each of `rays` rays; `crossings`
/// lists glass hits as ray and distance. `hidden` is the share of a blocked ray. `distances` is scratch space.
pub(super) fn shares_of_light(
    hidden: f32,
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
        each(ray, share_of_light(hidden, stopped, distances));
    }
}

/// The number of surfaces that these hit distances belong to. A tracer may report a hit twice, and a ray through the
/// edge between two triangles hits both: distances no farther apart than their rounding error are one surface.
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
