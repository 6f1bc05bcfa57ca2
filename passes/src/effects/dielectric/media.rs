//! The bodies that a point of a path lies in.

use curitiba_pipeline::glass::Dielectric;

/// Greatest number of bodies that are kept; a path that lies in more is counted as lost.
pub const MOST: usize = 8;

/// A surface of a body that a line crosses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Crossing {
    /// The body's material.
    pub material: u32,
    /// Whether the line enters it there.
    pub enters: bool,
}

/// The materials of the bodies that a point lies in. The last of them fills the place: its medium is the one at the point. It has the highest
/// priority, and among bodies of equal priority it was entered last (Schmidt and Budge, "Simple Nested Dielectrics in Ray Traced Images", Journal
/// of Graphics Tools 7(2), 2002, where only the priority decides).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Media {
    list: [u32; MOST],
    length: u8,
}

/// The media on both sides of a body's surface that a line crosses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Border {
    /// The media behind the surface.
    pub after: Media,
    /// Index of refraction behind the surface over the index before it, at the Fraunhofer line d. `None` where another body fills the place on
    /// both sides: there is no surface.
    pub ratio: Option<f32>,
    /// The materials that fill the place before and behind the surface; `None` for air.
    pub sides: [Option<u32>; 2],
    /// Whether there are more bodies than are kept, so that the media are incomplete.
    pub overflows: bool,
}

impl Media {
    /// No body.
    pub const NONE: Self = Self { list: [0; MOST], length: 0 };

    fn materials(&self) -> &[u32] {
        &self.list[..usize::from(self.length)]
    }

    /// The material that fills the place; `None` for air.
    #[inline]
    #[must_use]
    pub fn top(&self) -> Option<u32> {
        self.materials().last().copied()
    }

    /// Number of bodies.
    pub(super) fn count(&self) -> usize {
        self.materials().len()
    }

    /// Index of refraction of what fills the place, at the line d.
    #[must_use]
    pub fn index(&self, dielectrics: &[Dielectric]) -> f32 {
        index_of(self.top(), dielectrics, None)
    }

    /// The media at the start of a line, from all of its crossings in their order. A body that is left without having been entered contains
    /// the start; the one that is left first is the innermost.
    pub fn at_start_of(crossings: impl IntoIterator<Item = Crossing>, dielectrics: &[Dielectric]) -> Self {
        let (mut entered, mut left) = (Vec::new(), Vec::new());
        for Crossing { material, enters } in crossings {
            match entered.iter().rposition(|known| *known == material) {
                _ if enters => entered.push(material),
                Some(at) => {
                    entered.remove(at);
                }
                None => left.push(material),
            }
        }
        left.iter().rev().fold(Self::NONE, |media, material| media.with(*material, dielectrics).0)
    }

    /// The media with one more body, whether this body then fills the place, and whether there was no room for it.
    fn with(self, material: u32, dielectrics: &[Dielectric]) -> (Self, bool, bool) {
        let priority = |material: u32| dielectrics[material as usize].priority;
        let length = usize::from(self.length);
        let place = self.materials().partition_point(|other| priority(*other) <= priority(material));
        if length == MOST {
            return (self, place == length, true);
        }
        let mut more = self;
        more.list.copy_within(place..length, place + 1);
        more.list[place] = material;
        more.length += 1;
        (more, place == length, false)
    }

    /// The media without one body of this material, the one entered last, and whether it filled the place; `None` if there is none.
    fn without(self, material: u32) -> Option<(Self, bool)> {
        let length = usize::from(self.length);
        let place = self.materials().iter().rposition(|other| *other == material)?;
        let mut fewer = self;
        fewer.list.copy_within(place + 1..length, place);
        // Cleared, so that lists of the same bodies are equal.
        fewer.list[length - 1] = 0;
        fewer.length -= 1;
        Some((fewer, place + 1 == length))
    }

    /// The media on both sides of a crossing; `self` are the media before it. A line that leaves a body without being known to have entered it
    /// counts as having been in it.
    #[must_use]
    pub fn cross(self, Crossing { material, enters }: Crossing, dielectrics: &[Dielectric]) -> Border {
        let (after, before, real, overflows) = if enters {
            let (after, real, overflows) = self.with(material, dielectrics);
            (after, self, real, overflows)
        } else {
            match self.without(material) {
                Some((after, real)) => (after, self, real, false),
                None => {
                    let (before, real, overflows) = self.with(material, dielectrics);
                    (self, before, real, overflows)
                }
            }
        };
        let ratio = real.then(|| after.index(dielectrics) / before.index(dielectrics));
        Border { after, ratio, sides: [before.top(), after.top()], overflows }
    }

    /// Index of refraction of what fills the place, for light of a wavelength in nanometres; `None` for the index at the line d.
    #[must_use]
    pub fn index_at(&self, dielectrics: &[Dielectric], wavelength: Option<f32>) -> f32 {
        index_of(self.top(), dielectrics, wavelength)
    }
}

impl Border {
    /// Whether the surface disperses light.
    #[must_use]
    pub fn disperses(&self, dielectrics: &[Dielectric]) -> bool {
        self.sides.iter().flatten().any(|material| dielectrics[*material as usize].spread > 0.0)
    }

    /// Index of refraction behind the surface over the index before it, for light of a wavelength in nanometres.
    #[must_use]
    pub fn ratio_at(&self, dielectrics: &[Dielectric], wavelength: f32) -> f32 {
        let [before, after] = self.sides.map(|material| index_of(material, dielectrics, Some(wavelength)));
        after / before
    }
}

/// The index of a material, of air for `None`.
fn index_of(material: Option<u32>, dielectrics: &[Dielectric], wavelength: Option<f32>) -> f32 {
    let Some(material) = material else { return 1.0 };
    let dielectric = &dielectrics[material as usize];
    wavelength.map_or(dielectric.index, |wavelength| dielectric.index_at(wavelength))
}

#[cfg(test)]
mod tests {
    use super::*;

    const AIR: f32 = 1.0;

    /// Material 0 is glass of index 1.5, material 1 is water of index 1.33: first with equal priorities, then with priorities 2 and 1.
    fn tables() -> [Vec<Dielectric>; 2] {
        [[0, 0], [2, 1]].map(|priorities| {
            let body = |(index, priority)| Dielectric { index, priority, ..Dielectric::default() };
            [1.5, 1.33].into_iter().zip(priorities).map(body).collect()
        })
    }

    fn ratios(dielectrics: &[Dielectric], start: Media, crossings: &[(u32, bool)]) -> (Vec<Option<f32>>, Media) {
        let mut media = start;
        let found = crossings.iter().map(|(material, enters)| {
            let border = media.cross(Crossing { material: *material, enters: *enters }, dielectrics);
            assert!(!border.overflows);
            media = border.after;
            border.ratio
        });
        (found.collect(), media)
    }

    #[test]
    fn nested_bodies_bend_light_by_what_lies_on_both_sides() {
        let [plain, _] = tables();
        let crossings = [(0, true), (1, true), (1, false), (0, false)];
        let (found, end) = ratios(&plain, Media::NONE, &crossings);
        assert_eq!(found, [Some(1.5 / AIR), Some(1.33 / 1.5), Some(1.5 / 1.33), Some(AIR / 1.5)]);
        assert_eq!(end, Media::NONE);
    }

    #[test]
    fn where_bodies_overlap_the_priority_decides_and_else_the_order() {
        let [plain, ranked] = tables();
        // Water that begins before the glass around it ends.
        let overlap = [(0, true), (1, true), (0, false), (1, false)];
        let (found, _) = ratios(&plain, Media::NONE, &overlap);
        assert_eq!(found, [Some(1.5), Some(1.33 / 1.5), None, Some(AIR / 1.33)], "the water is the later one");
        let (found, _) = ratios(&ranked, Media::NONE, &overlap);
        assert_eq!(found, [Some(1.5), None, Some(1.33 / 1.5), Some(AIR / 1.33)], "glass comes first");
        // The same from the other side.
        let back = [(1, true), (0, true), (1, false), (0, false)];
        let (found, end) = ratios(&ranked, Media::NONE, &back);
        assert_eq!(found, [Some(1.33), Some(1.5 / 1.33), None, Some(AIR / 1.5)]);
        assert_eq!(end, Media::NONE);
    }

    #[test]
    fn a_body_that_was_not_entered_is_left_all_the_same() {
        let [plain, _] = tables();
        assert_eq!(ratios(&plain, Media::NONE, &[(0, false)]), (vec![Some(AIR / 1.5)], Media::NONE));
    }

    #[test]
    fn the_start_lies_in_what_is_left_and_was_not_entered() {
        let [plain, ranked] = tables();
        let line = |list: &[(u32, bool)]| {
            list.iter().map(|(material, enters)| Crossing { material: *material, enters: *enters }).collect::<Vec<_>>()
        };
        // From the water in the glass, through another glass on the way.
        let start = Media::at_start_of(line(&[(0, true), (0, false), (1, false), (0, false)]), &plain);
        assert_eq!(start.materials(), [0, 1]);
        assert_eq!(Media::at_start_of(line(&[(1, false), (0, false)]), &ranked).materials(), [1, 0]);
        assert_eq!(Media::at_start_of(line(&[(1, true), (1, false)]), &plain), Media::NONE);
    }

    #[test]
    fn more_bodies_than_are_kept_are_told() {
        let [plain, _] = tables();
        let mut media = Media::NONE;
        let enter = Crossing { material: 0, enters: true };
        for _ in 0..MOST {
            let border = media.cross(enter, &plain);
            assert!(!border.overflows);
            media = border.after;
        }
        let border = media.cross(enter, &plain);
        assert!(border.overflows);
        assert_eq!(border.after, media);
    }
}
