//! How many tiles a frame makes: not all that are missing at once, and about as many in one frame as in the next.

/// Frames for which a tile waits, on average.
const WAIT: f64 = 8.0;

/// Frames over which the pace changes: even a steady dive wants its tiles in bursts, some in each octave.
const STEADY: f64 = 96.0;

/// Frames over which the pace grows where more is baked: nothing that is drawn is to wait for it long.
const GROW: f64 = 16.0;

/// Frames in which a queue that is too long, or too short, is made good.
const CATCH_UP: f64 = 120.0;

/// Share of its pace that a frame keeps for tiles that are drawn, however many are made to be baked.
const DRAWN_SHARE: f64 = 0.6;

/// Shares out the making of tiles over frames.
///
/// What is baked is made in its frame, whatever the pace: then fewer of the others are, and more where less is baked, so
/// that it is the sum that is even.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pace {
    /// Tiles granted and refused in this frame.
    granted: usize,
    refused: usize,
    /// Tiles made to be baked in this frame.
    baked: usize,
    /// Tiles that were refused in the frame before.
    left: usize,
    /// What this frame grants; None: everything.
    allowed: Option<Allowed>,
    /// Tiles per frame that are new among those missing, smoothed.
    rate: f64,
    /// Tiles per frame that are made to be baked, smoothed.
    baked_rate: f64,
    /// What is left of the pace from the frames before.
    credit: f64,
}

/// What a frame grants.
#[derive(Clone, Copy, Debug)]
struct Allowed {
    /// Tiles in all, those to be baked counted in.
    all: usize,
    /// Tiles to be drawn, at least.
    drawn: usize,
}

impl Pace {
    /// Begins a frame that may make at most so many tiles; None: all.
    pub fn begin_frame(&mut self, most: Option<f64>) {
        let missing = (self.granted + self.refused) as f64;
        let new = (missing - self.left as f64).max(0.0);
        let made = self.allowed.map_or(0, |allowed| (self.granted + self.baked).min(allowed.all)) as f64;
        let baked = self.baked as f64;
        self.left = self.refused;
        (self.granted, self.refused, self.baked) = (0, 0, 0);
        self.allowed = most.map(|most| {
            self.rate += (new - self.rate) / STEADY;
            self.baked_rate +=
                (baked - self.baked_rate) / if baked > self.baked_rate { GROW } else { STEADY };
            let waiting = self.left as f64;
            let steady = self.rate + (waiting - WAIT * self.rate) / CATCH_UP;
            // A jump or a turn wants more than a smooth pace gives.
            let pace = steady.max(waiting / (3.0 * WAIT)).min(most);
            self.credit = (self.credit - made).clamp(0.0, 1.0) + pace + self.baked_rate;
            Allowed { all: self.credit as usize, drawn: (DRAWN_SHARE * pace) as usize }
        });
    }

    /// Another tile is made in this frame, to be baked.
    pub fn bake(&mut self) {
        self.baked += 1;
    }

    /// Whether another tile may be made in this frame, to be drawn.
    pub fn ask(&mut self, needed: bool) -> bool {
        let is_allowed =
            |allowed: Allowed| self.granted + self.baked < allowed.all || self.granted < allowed.drawn;
        let granted = needed || self.allowed.is_none_or(is_allowed);
        if granted {
            self.granted += 1;
        } else {
            self.refused += 1;
        }
        granted
    }
}
