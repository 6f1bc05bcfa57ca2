//! Limits at which a pass stops following light in glass.

/// Greatest number of reflections, and of refractions, on a path; the default of both limits.
pub const MOST_BOUNCES: u32 = 128;

/// Colour of paths in glass that are cut off.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum CutoffColor {
    /// No light.
    #[default]
    Black,
    /// The background: the colour of rays that miss the scene.
    Background,
}

/// Whether paths of little weight in glass are ended by Russian roulette.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Roulette {
    /// No roulette: a path ends where its weight falls below the cut-off.
    #[default]
    Off,
    /// A path whose weight is below the cut-off survives with a probability of its weight divided by the cut-off, and its weight is divided
    /// by that probability. The expected value is that of following all paths.
    On,
}

named!(CutoffColor, "black" => Black, "background" => Background);
named!(Roulette, "off" => Off, "on" => On);

/// Limits for following light in glass (`glass=auto`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathLimits {
    /// Least weight of a path, as a share of its pixel's colour: 0 (no cut-off) to 1.
    pub cutoff: f32,
    /// Colour of a path that is cut off, or that exceeds [`Self::reflections`] or [`Self::refractions`].
    pub cutoff_color: CutoffColor,
    /// Whether paths below the cut-off are continued by Russian roulette.
    pub roulette: Roulette,
    /// Greatest number of reflections on a path, up to [`MOST_BOUNCES`].
    pub reflections: u32,
    /// Greatest number of refractions on a path, up to [`MOST_BOUNCES`].
    pub refractions: u32,
}

impl Default for PathLimits {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl PathLimits {
    /// No limits below the maximum: all paths are followed.
    pub const DEFAULT: Self = Self {
        cutoff: 0.0,
        cutoff_color: CutoffColor::Black,
        roulette: Roulette::Off,
        reflections: MOST_BOUNCES,
        refractions: MOST_BOUNCES,
    };

    /// Whether some path may be cut off.
    #[must_use]
    pub fn cut(&self) -> bool {
        self.cutoff > 0.0 || self.reflections < MOST_BOUNCES || self.refractions < MOST_BOUNCES
    }

    /// Sets a parameter by its name. Returns `false` if the name or the value is invalid.
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

    /// The value of a parameter as text; `None` for an unknown name.
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
