//! What the last frames took.

use std::collections::VecDeque;

/// Frames that are kept.
pub const FRAMES: usize = 512;

/// Times of the last [`FRAMES`] frames by pass.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct History {
    frames: VecDeque<Vec<f32>>,
}

impl History {
    /// Adds a frame: by pass of the pipeline, milliseconds; 0 for what did not run. Frames of another number of passes are forgotten.
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
