//! How much of a picture is rendered while the camera moves.

use curitiba::pipeline::plan::Preview;
use std::time::Duration;

/// Greatest duration of a frame while the camera moves.
const SMOOTH: Duration = Duration::from_millis(50);

/// From full quality to fewer samples and pixels. Each level takes about a quarter of the time of the one before, if samples or pixels dominate.
const LEVELS: [Preview; 4] = [
    Preview { divisor: 1, samples: 4 },
    Preview { divisor: 1, samples: 1 },
    Preview { divisor: 2, samples: 1 },
    Preview { divisor: 4, samples: 1 },
];

/// What may be reduced in the pictures of a project.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lets {
    /// Whether passes take more than one sample.
    pub samples: bool,
    /// Whether pictures can be smaller.
    pub size: bool,
}

/// Chooses the quality of frames while the camera moves, from the durations of the last frames. The quality is kept from one move to the next.
#[derive(Debug, Default)]
pub(super) struct Pace {
    level: usize,
    /// Shortest duration and number of the latest consecutive frames that were too slow; `None` if the last frame was not too slow.
    slow: Option<(Duration, u32)>,
    /// Number of the latest consecutive frames that were fast enough for the next better level.
    quick: u32,
}

impl Pace {
    /// The quality of the next frame.
    pub fn preview(&self) -> Preview {
        LEVELS[self.level]
    }

    /// Records the duration of a frame. As a single frame may have been delayed by something else, quality falls after two slow frames and rises
    /// after three quick ones.
    pub fn note(&mut self, took: Duration, lets: Lets) {
        if took > SMOOTH {
            let (best, count) = self.slow.map_or((took, 1), |(best, count)| (best.min(took), count + 1));
            (self.slow, self.quick) = (Some((best, count)), 0);
            if count == 2 {
                self.lower(lets);
                if best > 4 * SMOOTH {
                    self.lower(lets);
                }
                self.slow = None;
            }
            return;
        }
        self.slow = None;
        // The next better level takes about four times as long, and must stay below the limit `SMOOTH`, too.
        self.quick = if 5 * took < SMOOTH { self.quick + 1 } else { 0 };
        if self.quick == 3 {
            self.quick = 0;
            self.level = self.level.saturating_sub(if self.level == 2 && !lets.samples { 2 } else { 1 });
        }
    }

    fn lower(&mut self, lets: Lets) {
        let next = if self.level == 0 && !lets.samples { 2 } else { self.level + 1 };
        let allowed = next < LEVELS.len() && (lets.size || LEVELS[next].divisor == 1);
        self.level = if allowed { next } else { self.level };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: Lets = Lets { samples: true, size: true };

    fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    /// The quality at which frames settle that take `full` milliseconds at full quality, and a quarter of it at each further level.
    fn settled(full: u64, lets: Lets, pace: &mut Pace) -> Preview {
        for _ in 0..40 {
            let level = LEVELS.iter().position(|level| *level == pace.preview()).expect("a level");
            let halves = if lets.samples { level } else { level.saturating_sub(1) };
            pace.note(ms(full) / 4_u32.pow(halves as u32), lets);
        }
        pace.preview()
    }

    #[test]
    fn a_quick_scene_is_never_lowered_and_a_slow_one_as_far_as_needed() {
        let preview = |divisor, samples| Preview { divisor, samples };
        for (full, expected) in [(1, preview(1, 4)), (50, preview(1, 4)), (90, preview(1, 1)), (400, preview(2, 1))] {
            assert_eq!(settled(full, ALL, &mut Pace::default()), expected, "{full} ms");
        }
        assert_eq!(settled(100_000, ALL, &mut Pace::default()), preview(4, 1));
        // Single frames that were delayed.
        let mut pace = Pace::default();
        for _ in 0..20 {
            pace.note(ms(500), ALL);
            pace.note(ms(20), ALL);
        }
        assert_eq!(pace.preview(), preview(1, 4));
    }

    #[test]
    fn what_brings_nothing_is_not_tried() {
        let none = Lets { samples: false, size: true };
        assert_eq!(settled(90, none, &mut Pace::default()), Preview { divisor: 2, samples: 1 });
        let fixed = Lets { samples: true, size: false };
        assert_eq!(settled(100_000, fixed, &mut Pace::default()), Preview { divisor: 1, samples: 1 });
        let neither = Lets { samples: false, size: false };
        assert_eq!(settled(100_000, neither, &mut Pace::default()), LEVELS[0]);
    }

    #[test]
    fn a_scene_that_became_quick_is_whole_again_and_none_goes_back_and_forth() {
        for lets in [ALL, Lets { samples: false, size: true }] {
            let mut pace = Pace::default();
            settled(100_000, lets, &mut pace);
            assert_eq!(settled(2, lets, &mut pace), LEVELS[0]);
        }
        for full in [60, 100, 190, 210, 390, 500, 900, 3000] {
            let mut pace = Pace::default();
            let at = settled(full, ALL, &mut pace);
            assert!((0..3).all(|_| settled(full, ALL, &mut pace) == at), "{full} ms");
        }
    }
}
