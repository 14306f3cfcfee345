//! How many tiles a frame makes: not all that are missing at once, and about as many in one frame as in the next.

/// Frames for which a tile waits, on average.
const WAIT: f64 = 8.0;

/// Frames over which the pace changes: even a steady dive wants its tiles in bursts, some in each octave.
const STEADY: f64 = 96.0;

/// Frames in which a queue that is too long, or too short, is made good.
const CATCH_UP: f64 = 120.0;

/// Shares out the making of tiles over frames.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pace {
    /// Tiles granted and refused in this frame.
    granted: usize,
    refused: usize,
    /// Tiles that were refused in the frame before.
    left: usize,
    /// What this frame grants; None: everything.
    allowed: Option<usize>,
    /// Tiles per frame that are new among those missing, smoothed.
    rate: f64,
    /// What is left of the pace from the frames before.
    credit: f64,
}

impl Pace {
    /// Begins a frame that may make at most so many tiles; None: all.
    pub fn begin_frame(&mut self, most: Option<f64>) {
        let missing = (self.granted + self.refused) as f64;
        let used = self.allowed.map_or(0, |allowed| self.granted.min(allowed)) as f64;
        let new = (missing - self.left as f64).max(0.0);
        self.left = self.refused;
        (self.granted, self.refused) = (0, 0);
        self.allowed = most.map(|most| {
            self.rate += (new - self.rate) / STEADY;
            let waiting = self.left as f64;
            let steady = self.rate + (waiting - WAIT * self.rate) / CATCH_UP;
            // A jump or a turn wants more than a smooth pace gives.
            let pace = steady.max(waiting / (3.0 * WAIT));
            self.credit = (self.credit - used).clamp(0.0, 1.0) + pace.min(most);
            self.credit as usize
        });
    }

    /// Whether another tile may be made in this frame.
    pub fn ask(&mut self, needed: bool) -> bool {
        let granted = needed || self.allowed.is_none_or(|allowed| self.granted < allowed);
        if granted {
            self.granted += 1;
        } else {
            self.refused += 1;
        }
        granted
    }
}
