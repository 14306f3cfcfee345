//! PURE: a tone that rises for ever as one falls, after R. Shepard (1964) and J.-C. Risset: partials an octave apart under
//! a bell that stands still. A partial that rises out of the bell at the top has come back in at the bottom before.

/// Partials, each an octave above the one before.
pub const PARTIALS: usize = 9;

/// Hertz of the lowest partial when it enters the bell. The middle of the bell is 4.5 octaves above: 453 Hz.
pub const LOWEST_HZ: f32 = 20.0;

/// Octaves that the tone rises by for each octave of depth. A dive of usual speed would be a siren with as many as that:
/// this way an octave of depth is a minor third.
pub const RISE: f64 = 0.25;

/// Octaves per second of depth at which the tone has half its loudness.
const HALF_LOUD: f32 = 0.75;

/// Seconds within which about 2/3 of a change happens: of pitch, and of loudness to more and to less.
const GLIDE_S: f64 = 0.06;
const SWELL_S: f32 = 0.15;
const FADE_S: f32 = 0.35;

/// What the tone is to become.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wanted {
    /// Octaves below the start of the world.
    pub depth: f64,
    /// 0 to 1.
    pub loudness: f32,
}

/// How loud the tone is for one who falls or rises so fast, in octaves per second: silent at rest, and never above 1.
pub fn loudness(speed: f64) -> f32 {
    let speed = speed.abs() as f32;
    if speed.is_finite() { speed / (speed + HALF_LOUD) } else { 0.0 }
}

/// The bell: amplitude of a partial so many octaves above [`LOWEST_HZ`]. 0 with no slope at both ends.
pub fn bell(octaves: f32) -> f32 {
    let from_middle = (2.0 * octaves / PARTIALS as f32 - 1.0).clamp(-1.0, 1.0);
    let inside = 1.0 - from_middle * from_middle;
    inside * inside * inside
}

/// The tone, sample by sample. The same wishes at the same samples give the same tone.
#[derive(Clone, Debug)]
pub struct Shepard {
    rate_hz: f32,
    /// Each partial's place in its round, 0 to 1.
    rounds: [f32; PARTIALS],
    /// Octaves of the lowest partial above [`LOWEST_HZ`], 0 to 1.
    pitch: f64,
    loudness: f32,
    /// Shares of a change that happen in a sample.
    glide: f64,
    swell: f32,
    fade: f32,
}

impl Shepard {
    /// Silent, for so many samples per second.
    pub fn new(rate_hz: f32) -> Shepard {
        let share = |seconds: f32| 1.0 - (-1.0 / (seconds * rate_hz)).exp();
        Shepard {
            rate_hz,
            rounds: [0.0; PARTIALS],
            pitch: 0.0,
            loudness: 0.0,
            glide: f64::from(share(GLIDE_S as f32)),
            swell: share(SWELL_S),
            fade: share(FADE_S),
        }
    }

    /// The next sample, −1 to 1.
    pub fn next(&mut self, wanted: &Wanted) -> f32 {
        let aim = if wanted.loudness.is_finite() { wanted.loudness.clamp(0.0, 1.0) } else { 0.0 };
        let share = if aim > self.loudness { self.swell } else { self.fade };
        self.loudness += (aim - self.loudness) * share;
        self.rise(wanted.depth);
        let octaves = self.pitch as f32;
        let mut step = LOWEST_HZ * octaves.exp2() / self.rate_hz;
        let mut sum = 0.0;
        for (i, round) in self.rounds.iter_mut().enumerate() {
            *round = (*round + step).fract();
            sum += bell(octaves + i as f32) * (*round * std::f32::consts::TAU).sin();
            step *= 2.0;
        }
        // However deep, all partials together are less than this.
        sum * self.loudness / MOST
    }

    /// Glides towards a depth, the shorter way round: a whole octave further is the same tone, so that a leap to elsewhere
    /// is none for the ear.
    fn rise(&mut self, depth: f64) {
        let wanted = if depth.is_finite() { depth * RISE } else { self.pitch };
        let way = wanted - self.pitch;
        self.pitch += (way - way.round()) * self.glide;
        if self.pitch >= 1.0 {
            self.pitch -= 1.0;
            // The highest one is silent there, and begins again as the lowest.
            self.rounds.rotate_right(1);
        } else if self.pitch < 0.0 {
            self.pitch += 1.0;
            self.rounds.rotate_left(1);
        }
    }
}

/// The bell summed over the partials, at most: they stand an octave apart, and so it hardly depends on the pitch.
const MOST: f32 = 4.2;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_partials_together_stay_within_bounds() {
        let sum = |octaves: f32| (0..PARTIALS).map(|i| bell(octaves + i as f32)).sum::<f32>();
        for i in 0..=100 {
            let sum = sum(i as f32 / 100.0);
            assert!(sum > 0.9 * MOST && sum <= MOST, "{sum}");
        }
    }
}
