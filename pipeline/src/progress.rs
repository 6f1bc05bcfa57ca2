//! Progress of long steps, and their cancellation.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// A request to stop, shared between the renderer and the code that may cancel it: all clones are the same request.
///
/// The request is checked between passes and between parts of a picture. On the processor it is also checked between the tiles of raster
/// and effect passes, the pixels of ray passes, the rows of quads, and the steps of building a structure. The `wgpu` rasteriser checks it
/// between the maps and the bands of rows of an effect. A frame that is given up ends in
/// [`RenderError::Cancelled`](crate::executor::RenderError::Cancelled). The request stays set until [`Self::reset`], so that a request
/// between two frames is not lost.
#[derive(Debug, Clone, Default)]
pub struct Cancellation(Arc<AtomicBool>);

impl Cancellation {
    /// A request that is not set.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the request. May be called from any thread, and from a signal handler.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Clears the request: frames that begin from now on are rendered.
    pub fn reset(&self) {
        self.0.store(false, Ordering::Relaxed);
    }

    /// Whether the request is set.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Progress of a long step, written by its threads and read by displays.
#[derive(Debug, Default)]
pub struct Progress {
    done: AtomicU64,
    total: AtomicU64,
    cancellation: Cancellation,
    given_up: Arc<AtomicBool>,
    followed: Mutex<Option<Followed>>,
}

/// A step that another [`Progress`] follows. `shares` are the shares of the follower's total at the start and at the end of `step`.
#[derive(Debug)]
struct Followed {
    step: Arc<Progress>,
    shares: [f64; 2],
}

impl Progress {
    /// Progress of a step that can be cancelled: engines check [`Self::is_cancelled`] between tiles or pixels.
    #[must_use]
    pub fn until(cancellation: &Cancellation) -> Self {
        Self { cancellation: cancellation.clone(), ..Self::default() }
    }

    /// Whether the step is to be given up: its further output is thrown away. Once true, this stays true, even if the request is
    /// withdrawn while the step runs.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        if self.cancellation.is_cancelled() {
            self.given_up.store(true, Ordering::Relaxed);
        }
        self.is_given_up()
    }

    /// Progress of a part of the step. It has its own count, and shares the request and the given-up state with the step.
    #[must_use]
    pub fn part(&self) -> Self {
        Self { cancellation: self.cancellation.clone(), given_up: Arc::clone(&self.given_up), ..Self::default() }
    }

    /// Whether a call of [`Self::is_cancelled`] for the step or one of its parts has returned `true`: the output is then not whole.
    #[must_use]
    pub fn is_given_up(&self) -> bool {
        self.given_up.load(Ordering::Relaxed)
    }

    /// From now on this count follows the progress of `step`: while `step` runs, the count moves from the first to the second share of
    /// this count's own total. Shares are from 0 to 1.
    pub(crate) fn follow(&self, step: &Arc<Self>, shares: [f64; 2]) {
        *self.followed.lock().unwrap_or_else(PoisonError::into_inner) =
            Some(Followed { step: Arc::clone(step), shares });
    }

    /// Starts counting to `total`.
    pub fn start(&self, total: u64) {
        self.done.store(0, Ordering::Relaxed);
        self.total.store(total, Ordering::Relaxed);
    }

    /// Adds `amount` to the count.
    pub fn advance(&self, amount: u64) {
        self.done.fetch_add(amount, Ordering::Relaxed);
    }

    /// Count and total; the total is 0 if it is not known.
    #[must_use]
    pub fn get(&self) -> (u64, u64) {
        let (done, total) = (self.done.load(Ordering::Relaxed), self.total.load(Ordering::Relaxed));
        let followed = self.followed.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(Followed { step, shares: [from, to] }) = &*followed else { return (done, total) };
        let (part, whole) = step.get();
        let share = from + (to - from) * part as f64 / whole.max(1) as f64;
        ((share * total as f64) as u64, total)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_that_was_given_up_stays_so_when_the_request_is_taken_back() {
        let stop = Cancellation::new();
        let (step, unaware) = (Progress::until(&stop), Progress::until(&stop));
        assert!(!step.is_cancelled() && !step.is_given_up());
        stop.cancel();
        // No call of `is_cancelled` has seen the request yet.
        assert!(!step.is_given_up());
        assert!(step.is_cancelled() && step.is_given_up());
        stop.reset();
        assert!(step.is_cancelled() && step.is_given_up());
        assert!(!unaware.is_cancelled() && !unaware.is_given_up());
    }

    #[test]
    fn a_step_that_follows_others_goes_from_share_to_share() {
        let whole = Progress::default();
        whole.start(1000);
        let mut last = 0;
        for shares in [[0.0, 0.25], [0.25, 0.5], [0.5, 1.0]] {
            let step = Arc::new(Progress::default());
            whole.follow(&step, shares);
            assert_eq!(whole.get(), ((shares[0] * 1000.0) as u64, 1000), "before it has counted anything");
            step.start(4);
            for _ in 0..4 {
                step.advance(1);
                assert!(whole.get().0 > last);
                last = whole.get().0;
            }
            assert_eq!(last, (shares[1] * 1000.0) as u64);
        }
    }

    #[test]
    fn a_part_counts_for_itself_and_is_given_up_with_its_step() {
        let stop = Cancellation::new();
        let step = Progress::until(&stop);
        step.start(3);
        let part = step.part();
        part.start(7);
        part.advance(2);
        assert_eq!((step.get(), part.get()), ((0, 3), (2, 7)));
        stop.cancel();
        assert!(part.is_cancelled() && step.is_given_up());
    }
}
