//! How many tiles a frame makes: not all that are missing at once, and about as many in one frame as in the next.

/// Frames over which waiting tiles are spread.
const SPREAD: f64 = 8.0;

/// Frames over which the pace changes: a steady dive wants its tiles in bursts.
const STEADY: f64 = 32.0;

/// Shares out the making of tiles over frames.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pace {
    /// Tiles granted and refused in this frame.
    granted: usize,
    refused: usize,
    /// What this frame grants; None: everything.
    allowed: Option<usize>,
    /// Tiles per frame, smoothed.
    pace: f64,
    /// What is left of it from the frames before.
    credit: f64,
}

impl Pace {
    /// Begins a frame that may make at most so many tiles; None: all.
    pub fn begin_frame(&mut self, most: Option<f64>) {
        let waiting = (self.granted + self.refused) as f64;
        let used = self.allowed.map_or(0, |allowed| self.granted.min(allowed)) as f64;
        (self.granted, self.refused) = (0, 0);
        self.allowed = most.map(|most| {
            let wanted = waiting / SPREAD;
            self.pace += (wanted - self.pace) / STEADY;
            // A jump or a turn wants more than a smooth pace gives.
            let pace = if wanted > 2.0 * self.pace { wanted } else { 0.8 * self.pace + 0.2 * wanted };
            self.credit = ((self.credit - used).clamp(0.0, 1.0) + pace.min(most)).max(1.0);
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
