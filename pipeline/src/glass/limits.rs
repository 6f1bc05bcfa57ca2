//! Where a pass stops following light in glass.

/// Most reflections, or refractions, on a path: what is the limit where a pass names none.
pub const MOST_BOUNCES: u32 = 128;

/// What stands for ways in glass that are not followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum CutoffColor {
    /// No light.
    #[default]
    Black,
    /// What rays show that leave the scene.
    Background,
}

/// Whether ways in glass of little weight are followed by chance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Roulette {
    /// No: none is followed whose weight is below the cut-off.
    #[default]
    Off,
    /// Each with a probability of its weight over the cut-off, and counted by so much more: the mean is that of all.
    On,
}

named!(CutoffColor, "black" => Black, "background" => Background);
named!(Roulette, "off" => Off, "on" => On);

/// Where light in glass (`glass=auto`) is no longer followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathLimits {
    /// Ways of which less than this share of a pixel's colour depends are cut off: 0 (none) to 1.
    pub cutoff: f32,
    /// What stands for a way that is cut off, or beyond [`Self::reflections`] or [`Self::refractions`].
    pub cutoff_color: CutoffColor,
    /// Whether ways below the cut-off are followed by chance.
    pub roulette: Roulette,
    /// Most reflections on a path, up to [`MOST_BOUNCES`].
    pub reflections: u32,
    /// The same of refractions.
    pub refractions: u32,
}

impl Default for PathLimits {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl PathLimits {
    /// All ways are followed.
    pub const DEFAULT: Self = Self {
        cutoff: 0.0,
        cutoff_color: CutoffColor::Black,
        roulette: Roulette::Off,
        reflections: MOST_BOUNCES,
        refractions: MOST_BOUNCES,
    };

    /// Whether any way may not be followed.
    #[must_use]
    pub fn cut(&self) -> bool {
        self.cutoff > 0.0 || self.reflections < MOST_BOUNCES || self.refractions < MOST_BOUNCES
    }

    /// Sets a parameter by its name; false if the name or the value is none.
    pub(crate) fn set(&mut self, name: &str, value: &str) -> bool {
        let bounces = || value.parse().ok().filter(|count: &u32| *count <= MOST_BOUNCES);
        fn put<T>(place: &mut T, value: Option<T>) -> bool {
            value.map(|value| *place = value).is_some()
        }
        match name {
            "cutoff" => put(&mut self.cutoff, value.parse().ok().filter(|share| (0.0..=1.0).contains(share))),
            "cutoffcolor" => put(&mut self.cutoff_color, CutoffColor::named(value)),
            "roulette" => put(&mut self.roulette, Roulette::named(value)),
            "reflections" => put(&mut self.reflections, bounces()),
            "refractions" => put(&mut self.refractions, bounces()),
            _ => false,
        }
    }

    /// The value of a parameter as it is written; `None` if the name is none.
    pub(crate) fn get(&self, name: &str) -> Option<String> {
        Some(match name {
            "cutoff" => self.cutoff.to_string(),
            "cutoffcolor" => self.cutoff_color.name().to_owned(),
            "roulette" => self.roulette.name().to_owned(),
            "reflections" => self.reflections.to_string(),
            "refractions" => self.refractions.to_string(),
            _ => return None,
        })
    }
}
