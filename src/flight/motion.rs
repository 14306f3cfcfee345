//! Flights that are computed: a dive, a skim, an orbit.

use super::{FlightPose, Footing, Gaze};

/// A length travelled at a steady speed, with a smooth start and a smooth stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ramp {
    /// How far, above 0.
    pub length: f64,
    /// Per second between start and stop, above 0.
    pub speed: f64,
    /// Seconds that the start takes, and the stop; 0 or more. A short way has shorter ones.
    pub ease_s: f64,
}

impl Ramp {
    /// Seconds from standstill to standstill.
    pub fn duration_s(&self) -> f64 {
        self.length / self.speed + self.ease()
    }

    /// How far it has come after so many seconds: exactly 0 at first, exactly the length at last.
    pub fn travelled(&self, time_s: f64) -> f64 {
        let (ease, total) = (self.ease(), self.duration_s());
        // The integral of the smooth step 3u² − 2u³.
        let eased = |u: f64| self.speed * ease * u * u * u * (1.0 - 0.5 * u);
        match time_s {
            t if t <= 0.0 => 0.0,
            t if t >= total => self.length,
            t if t < ease => eased(t / ease),
            t if t > total - ease => self.length - eased((total - t) / ease),
            t => self.speed * (t - 0.5 * ease),
        }
    }

    /// Speed at a time, as a share of the full one: 0 at both ends, 1 between start and stop.
    pub fn pace(&self, time_s: f64) -> f64 {
        let from_an_end = time_s.min(self.duration_s() - time_s).max(0.0);
        let u = if from_an_end < self.ease() { from_an_end / self.ease() } else { 1.0 };
        u * u * (3.0 - 2.0 * u)
    }

    /// Start and stop must not overlap.
    fn ease(&self) -> f64 {
        self.ease_s.min(self.length / self.speed)
    }
}

/// Which way a dive goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Down.
    In,
    /// Up: the dive backwards.
    Out,
    /// Down, a rest, and up again.
    InAndOut {
        /// The rest in milliseconds.
        rest_ms: u32,
    },
}

/// Straight at the target, which the course steers to gentle ground, or away from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dive {
    /// Which way.
    pub way: Way,
    /// Octaves below the start at the upper end.
    pub depth: f64,
    /// Octaves, and octaves per second.
    pub fall: Ramp,
    /// Above the ground at the target.
    pub height: f64,
    /// Radians to the right at the upper end.
    pub yaw: f64,
    /// Radians to the right per octave down.
    pub turn: f64,
    /// Radians upwards while falling.
    pub pitch: f64,
    /// Radians upwards while standing still.
    pub rest_pitch: f64,
}

impl Dive {
    /// Seconds from beginning to end.
    pub fn duration_s(&self) -> f64 {
        match self.way {
            Way::In | Way::Out => self.fall.duration_s(),
            Way::InAndOut { rest_ms } => 2.0 * self.fall.duration_s() + f64::from(rest_ms) / 1000.0,
        }
    }

    pub(super) fn pose(&self, since_s: f64, left_s: f64) -> FlightPose {
        let time_s = match self.way {
            Way::In => since_s,
            Way::Out => left_s,
            Way::InAndOut { .. } => since_s.min(left_s),
        };
        let octaves = self.fall.travelled(time_s);
        let pace = self.fall.pace(time_s);
        FlightPose {
            depth: self.depth + octaves,
            yaw: self.yaw + self.turn * octaves,
            pitch: self.rest_pitch + pace * (self.pitch - self.rest_pitch),
            roll: 0.0,
            height: self.height,
            offset: [0.0; 2],
            footing: Footing::Target,
            gaze: Gaze::Pose,
        }
    }
}

/// Sideways from the target in a straight line, at a constant height over the smoothed ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Skim {
    /// Octaves below the start.
    pub depth: f64,
    /// Cells, and cells per second.
    pub travel: Ramp,
    /// Radians to the right of -z: where to.
    pub heading: f64,
    /// Above the smoothed ground.
    pub height: f64,
    /// The ground is smoothed over 2^this cells.
    pub smoothing: u8,
    /// Radians to the right of the heading: where the viewer looks.
    pub yaw: f64,
    /// Radians upwards.
    pub pitch: f64,
}

impl Skim {
    pub(super) fn pose(&self, time_s: f64) -> FlightPose {
        let way = self.travel.travelled(time_s);
        let (sin, cos) = self.heading.sin_cos();
        FlightPose {
            depth: self.depth,
            yaw: self.heading + self.yaw,
            pitch: self.pitch,
            roll: 0.0,
            height: self.height,
            offset: [way * sin, -way * cos],
            footing: Footing::Ground { smoothing: self.smoothing },
            gaze: Gaze::Pose,
        }
    }
}

/// Round the target, looking at it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// Octaves below the start.
    pub depth: f64,
    /// Cells from the target, above 0.
    pub radius: f64,
    /// Above the ground at the target.
    pub height: f64,
    /// Radians round the target, and radians per second.
    pub turn: Ramp,
    /// Where it begins: radians anticlockwise, seen from above, from behind the target (+z).
    pub from: f64,
    /// The ground to stay clear of is smoothed over 2^this cells.
    pub smoothing: u8,
    /// Radians to the right of the target.
    pub yaw: f64,
    /// Radians above the target.
    pub pitch: f64,
}

impl Orbit {
    pub(super) fn pose(&self, time_s: f64) -> FlightPose {
        let (sin, cos) = (self.from + self.turn.travelled(time_s)).sin_cos();
        FlightPose {
            depth: self.depth,
            yaw: self.yaw,
            pitch: self.pitch,
            roll: 0.0,
            height: self.height,
            offset: [self.radius * sin, self.radius * cos],
            footing: Footing::Clear { smoothing: self.smoothing },
            gaze: Gaze::Target,
        }
    }
}
