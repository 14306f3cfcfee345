//! How many tiles a frame makes: not all that are missing at once, and about as many in one frame as in the next.

/// Frames for which a tile waits, on average, where nothing is foreseen.
const WAIT: f64 = 8.0;

/// Share of the time for which it is foreseen that a tile waits, on average: it is there before it is wanted.
const FORESEEN_WAIT: f64 = 0.85;

/// Frames over which the pace changes: even a steady dive wants its tiles in bursts, some in each octave.
const STEADY: f64 = 200.0;

/// The same where nothing waits.
const EMPTY: f64 = 24.0;

/// Frames over which the pace grows where more is baked: nothing that is drawn is to wait for it long.
const GROW: f64 = 16.0;

/// Frames in which a queue that is too long, or too short, is made good.
const CATCH_UP: f64 = 480.0;

/// The same for tiles that are wanted already.
const HURRY: f64 = 280.0;

/// Share of its pace that a frame keeps for tiles that are drawn, however many are made to be baked.
const DRAWN_SHARE: f64 = 0.8;

/// Shares out the making of tiles over frames.
///
/// What will be wanted soon is asked for ahead: so a burst of tiles that are wanted at once was made in the frames before.
///
/// What is baked is made in its frame, whatever the pace: then fewer of the others are, and more where less is baked, so
/// that it is the sum that is even.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pace {
    /// Tiles granted and refused in this frame, and those refused that are not wanted yet.
    granted: usize,
    refused: usize,
    refused_ahead: usize,
    /// Tiles made to be baked in this frame.
    baked: usize,
    /// Tiles that were refused in the frame before.
    left: usize,
    /// Frames from when a tile is foreseen until it is wanted; 0: nothing is foreseen.
    foreseen: f64,
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
        let refused = self.refused + self.refused_ahead;
        let new = ((self.granted + refused) as f64 - self.left as f64).max(0.0);
        let made = self.allowed.map_or(0, |allowed| (self.granted + self.baked).min(allowed.all)) as f64;
        let baked = self.baked as f64;
        let wanted = self.refused as f64;
        self.left = refused;
        (self.granted, self.refused, self.refused_ahead, self.baked) = (0, 0, 0, 0);
        // What a frame makes all of at once says nothing of the frames to come.
        if self.allowed.is_some() {
            // Where nothing is left to wait for, the pace has been too fast.
            let over = if self.left == 0 { EMPTY } else { STEADY };
            self.rate += (new - self.rate) / over;
        }
        self.allowed = most.map(|most| {
            self.baked_rate +=
                (baked - self.baked_rate) / if baked > self.baked_rate { GROW } else { STEADY };
            let wait = if self.foreseen > 0.0 { FORESEEN_WAIT * self.foreseen } else { WAIT };
            let behind = self.left as f64 - wait * self.rate;
            let steady = self.rate + (behind / CATCH_UP).max(-0.25 * self.rate) + wanted / HURRY;
            // A jump or a turn wants more than a smooth pace gives.
            let pace = steady.max(wanted / (2.0 * WAIT)).min(most);
            self.credit = (self.credit - made).clamp(0.0, 1.0) + pace + self.baked_rate;
            Allowed { all: self.credit as usize, drawn: (DRAWN_SHARE * pace) as usize }
        });
    }

    /// Says for how many frames ahead tiles are foreseen; 0: none are.
    pub fn set_foreseen(&mut self, frames: f64) {
        self.foreseen = frames;
    }

    /// Another tile is made in this frame, to be baked.
    pub fn bake(&mut self) {
        self.baked += 1;
    }

    /// Whether another tile may be made in this frame, to be drawn.
    pub fn ask(&mut self, needed: bool) -> bool {
        let granted = needed || self.is_allowed();
        *if granted { &mut self.granted } else { &mut self.refused } += 1;
        granted
    }

    /// The same for a tile that will be wanted soon, after all those that are wanted.
    pub fn ask_ahead(&mut self) -> bool {
        let granted = self.is_allowed();
        *if granted { &mut self.granted } else { &mut self.refused_ahead } += 1;
        granted
    }

    fn is_allowed(&self) -> bool {
        self.allowed
            .is_none_or(|allowed| self.granted + self.baked < allowed.all || self.granted < allowed.drawn)
    }
}
