//! Times of the last frames.

use std::collections::VecDeque;

/// Number of frames that are kept.
pub const FRAMES: usize = 512;

/// Times of the last [`FRAMES`] frames by pass.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct History {
    frames: VecDeque<Vec<f32>>,
}

impl History {
    /// Adds a frame: milliseconds of each pass of the pipeline, 0 for passes that did not run. If the number of passes changed, earlier frames
    /// are removed.
    pub fn push(&mut self, times: Vec<f32>) {
        if self.frames.back().is_some_and(|last| last.len() != times.len()) {
            self.frames.clear();
        }
        if self.frames.len() == FRAMES {
            self.frames.pop_front();
        }
        self.frames.push_back(times);
    }

    /// The frames, oldest first.
    pub fn frames(&self) -> impl ExactSizeIterator<Item = &[f32]> + DoubleEndedIterator {
        self.frames.iter().map(Vec::as_slice)
    }

    /// The longest frame, milliseconds; 0 without one.
    #[must_use]
    pub fn longest(&self) -> f32 {
        self.frames().map(|frame| frame.iter().sum()).fold(0.0, f32::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn old_frames_and_those_of_other_passes_are_forgotten() {
        let mut history = History::default();
        for frame in 0..FRAMES + 3 {
            history.push(vec![frame as f32, 1.0]);
        }
        assert_eq!((history.frames().len(), history.frames().next()), (FRAMES, Some(&[3.0, 1.0][..])));
        assert_eq!(history.longest(), (FRAMES + 3) as f32);
        history.push(vec![5.0]);
        assert_eq!((history.frames().len(), history.longest()), (1, 5.0));
    }
}
