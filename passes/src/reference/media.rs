//! The bodies of glass that a point of a path lies in.

use super::job::Look;
use super::world::World;
use curitiba_pipeline::glass::{Dielectric, Shape};
use glam::DVec3;

/// Greatest number of surfaces on the line that finds the bodies around a point.
const MOST_ON_LINE: u32 = 100_000;

/// The materials of the bodies that a point lies in, in the order in which a path entered them. There may be any number.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Bodies(Vec<usize>);

/// What lies on both sides of the surface of a body.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Border {
    /// The bodies that a point just behind the surface lies in.
    pub after: Bodies,
    /// The materials that fill the space in front of the surface and behind it; `None` for air.
    pub sides: [Option<usize>; 2],
    /// Whether the surface is visible; it is not where another body fills the place on both sides.
    pub is_seen: bool,
}

impl Bodies {
    /// Place in the list of the body that fills the point: of the bodies with the highest priority, the one entered last.
    fn place(&self, table: &[Dielectric]) -> Option<usize> {
        // Of several greatest values, `max_by_key` returns the last.
        (0..self.0.len()).max_by_key(|place| table[self.0[*place]].priority)
    }

    /// The material that fills the point; `None` for air.
    pub fn fills(&self, table: &[Dielectric]) -> Option<usize> {
        self.place(table).map(|place| self.0[place])
    }

    /// The border that a path crosses when it enters or leaves a body. If a path leaves a body that it is not known to have entered, it was
    /// inside that body before.
    pub fn cross(&self, table: &[Dielectric], material: usize, enters: bool) -> Border {
        let with = |list: &Self| Self([&list.0[..], &[material]].concat());
        let known = self.0.iter().rposition(|body| *body == material);
        let (before, after, place) = match (enters, known) {
            (true, _) => (self.clone(), with(self), self.0.len()),
            (false, None) => (with(self), self.clone(), self.0.len()),
            (false, Some(place)) => {
                let mut after = self.clone();
                after.0.remove(place);
                (self.clone(), after, place)
            }
        };
        let larger = if enters { &after } else { &before };
        let is_seen = larger.place(table) == Some(place);
        Border { sides: [before.fills(table), after.fills(table)], after, is_seen }
    }

    /// The bodies at the start of a line, from all its crossings in order: the material, and whether the line enters there.
    pub fn at_start(crossings: impl IntoIterator<Item = (usize, bool)>) -> Self {
        let (mut entered, mut left) = (Vec::new(), Vec::new());
        for (material, enters) in crossings {
            if enters {
                entered.push(material);
            } else if let Some(place) = entered.iter().rposition(|body| *body == material) {
                entered.remove(place);
            } else {
                left.push(material);
            }
        }
        // The body that is left first is the innermost.
        left.reverse();
        Self(left)
    }

    /// The bodies around a point.
    pub fn around(world: &World<'_>, look: &Look<'_>, point: DVec3) -> Self {
        let is_solid = |material: usize| look.dielectrics[material].shape == Shape::Solid;
        if !look.dielectrics.iter().any(|dielectric| dielectric.shape == Shape::Solid) {
            return Self::default();
        }
        // Along no axis and no diagonal.
        let direction = DVec3::new(-0.418_273, 0.590_117, 0.271_309).normalize();
        let (mut origin, mut crossings) = (point, Vec::new());
        for _ in 0..MOST_ON_LINE {
            let Some(hit) = world.closest(look.shades, origin, direction) else { break };
            let surface = world.surface(look.shades, &hit, (origin, direction));
            if is_solid(surface.material) {
                crossings.push((surface.material, surface.is_front()));
            }
            origin = world.leaving(&surface, direction);
        }
        Self::at_start(crossings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether each surface is seen and what lies behind it, by a list of crossings.
    fn passed(priorities: [u8; 2], start: &Bodies, crossings: &[(usize, bool)]) -> Vec<(bool, Option<usize>)> {
        let table = priorities.map(|priority| Dielectric { priority, ..Dielectric::default() });
        let mut bodies = start.clone();
        let pass = |(material, enters): &(usize, bool)| {
            let border = bodies.cross(&table, *material, *enters);
            bodies = border.after;
            (border.is_seen, border.sides[1])
        };
        crossings.iter().map(pass).collect()
    }

    #[test]
    fn the_highest_priority_fills_a_place_and_of_equal_ones_the_last() {
        let overlap = [(0, true), (1, true), (0, false), (1, false)];
        let none = Bodies::default();
        let last = [(true, Some(0)), (true, Some(1)), (false, Some(1)), (true, None)];
        assert_eq!(passed([0, 0], &none, &overlap), last);
        let ranked = [(true, Some(0)), (false, Some(0)), (true, Some(1)), (true, None)];
        assert_eq!(passed([2, 1], &none, &overlap), ranked);
        // The same line from the other end.
        let back = [(1, true), (0, true), (1, false), (0, false)];
        let expected = [(true, Some(1)), (true, Some(0)), (false, Some(0)), (true, None)];
        assert_eq!(passed([2, 1], &none, &back), expected);
        // A body of the same material in the first one has a surface of its own.
        assert_eq!(passed([0, 0], &none, &[(0, true), (0, true), (0, false)]), [(true, Some(0)); 3]);
    }

    #[test]
    fn who_leaves_a_body_was_in_it() {
        let start = Bodies::at_start([(0, true), (0, false), (1, false), (0, false)]);
        assert_eq!(start, Bodies(vec![0, 1]), "the water in the glass, behind another glass");
        assert_eq!(passed([0, 0], &start, &[(1, false), (0, false)]), [(true, Some(0)), (true, None)]);
        assert_eq!(passed([0, 0], &Bodies::default(), &[(1, false)]), [(true, None)], "though nothing told");
    }

    #[test]
    fn any_number_of_bodies_is_known() {
        let many: Vec<_> = [[(0, true); 20], [(0, false); 20]].concat();
        let found = passed([0, 0], &Bodies::default(), &many);
        assert!(found[..39].iter().all(|passed| *passed == (true, Some(0))) && found[39] == (true, None), "{found:?}");
    }
}
