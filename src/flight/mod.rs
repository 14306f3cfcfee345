//! PURE: scripted flights: what a TOML file says, and the pose of any frame by itself.
//!
//! A pose is relative to a *target*, a point of the ground, and to a scale: lengths are in cells of the pose's own
//! depth, 2^-depth of the start's cells. So a flight means the same at every depth and in every world.
//! Frame `i` depends on `i` alone: frames can be drawn in any order, on any number of machines.

mod file;
mod keyframes;
mod motion;

pub use crate::world::source::{FileError, LoadError};
pub use keyframes::Keyframe;
pub use motion::{Dive, Orbit, Ramp, Skim, Way};

/// The deepest pose, in octaves below the start.
pub const MAX_DEPTH: f64 = 1_000_000.0;

/// A flight, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Flight {
    /// What it is called: the built-in name, or the file's name without `.toml`.
    pub name: String,
    /// One line for people.
    pub title: String,
    /// Frames per second, 1 to 1000.
    pub fps: u32,
    /// Length in seconds: the last keyframe's time or later, or the time a motion takes, in whole frames.
    pub duration_s: f64,
    /// How it moves.
    pub motion: Motion,
}

/// How a flight moves.
#[derive(Clone, Debug, PartialEq)]
pub enum Motion {
    /// Through these poses: at least one, times rise by a millisecond or more, yaw and roll take the short way.
    Keyframes(Vec<Keyframe>),
    /// Straight at the target, or away from it.
    Dive(Dive),
    /// Sideways over the ground.
    Skim(Skim),
    /// Round the target.
    Orbit(Orbit),
}

/// Where the viewer is, relative to the flight's target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlightPose {
    /// Octaves below the start, 0 to [`MAX_DEPTH`], whole or not. The other lengths are in cells of this depth:
    /// 2^-depth of the start's.
    pub depth: f64,
    /// Radians to the right, from looking along -z; unbounded. With pitch and roll the orientation is, for column
    /// vectors, `rotate_y(-yaw) * rotate_x(pitch) * rotate_z(-roll)`.
    pub yaw: f64,
    /// Radians upwards, -π/2 (straight down) to π/2.
    pub pitch: f64,
    /// Radians of the head's tilt towards its right shoulder; unbounded.
    pub roll: f64,
    /// Altitude above what [`Footing`] says, above 0.
    pub height: f64,
    /// Horizontal distance (x, z) from the target.
    pub offset: [f64; 2],
    /// What the height is counted from.
    pub footing: Footing,
    /// What yaw and pitch are counted from.
    pub gaze: Gaze,
}

impl Default for FlightPose {
    /// A cell above the target at the start, looking along -z.
    fn default() -> FlightPose {
        FlightPose {
            depth: 0.0,
            yaw: 0.0,
            pitch: 0.0,
            roll: 0.0,
            height: 1.0,
            offset: [0.0; 2],
            footing: Footing::Target,
            gaze: Gaze::Pose,
        }
    }
}

/// What a pose's height is counted from. Whatever it is, the viewer stays above the ground below.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Footing {
    /// The ground at the target.
    Target,
    /// The ground at the target; raised smoothly where other ground comes near.
    Clear {
        /// The ground is smoothed over 2^this cells, 0 to [`MAX_SMOOTHING`].
        smoothing: u8,
    },
    /// The ground around the viewer without its details; raised smoothly where they come near.
    Ground {
        /// The ground is smoothed over 2^this cells, 0 to [`MAX_SMOOTHING`].
        smoothing: u8,
    },
}

/// The ground is smoothed over at most 2^this cells.
pub const MAX_SMOOTHING: u8 = 8;

/// What a pose's yaw and pitch are counted from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gaze {
    /// Looking along -z, level.
    Pose,
    /// The direction to the target.
    Target,
}

impl Flight {
    /// The flight of a built-in name, or of the TOML file at a path.
    ///
    /// # Errors
    /// [`LoadError`], a sentence that says what to do: an unknown name, an unreadable file, or a file with
    /// something wrong in it (then with its line).
    pub fn load(name_or_path: &str) -> Result<Flight, LoadError> {
        Ok(file::check(&file::KIND.find(name_or_path)?)?)
    }

    /// The flight a text describes, as if it had been read from `file`; named after it.
    ///
    /// # Errors
    /// The first thing wrong in the text.
    pub fn parse(file: &str, text: &str) -> Result<Flight, FileError> {
        let name = std::path::Path::new(file).file_stem().unwrap_or_default().to_string_lossy();
        file::check(&file::KIND.source(name, file, text))
    }

    /// The names of the built-in flights, the default first.
    pub fn names() -> impl Iterator<Item = &'static str> {
        file::KIND.embedded.iter().map(|flight| flight.name)
    }

    /// The same flight over another number of octaves, above 0. None if it is no dive, or would end deeper than
    /// [`MAX_DEPTH`].
    pub fn with_octaves(&self, octaves: f64) -> Option<Flight> {
        let Motion::Dive(dive) = self.motion else { return None };
        let deep_enough = octaves > 0.0 && dive.depth + octaves <= MAX_DEPTH;
        let fall = Ramp { length: octaves, ..dive.fall };
        deep_enough.then(|| self.with_motion(Motion::Dive(Dive { fall, ..dive })))
    }

    /// The same with a motion that says itself how long it takes.
    fn with_motion(&self, motion: Motion) -> Flight {
        let seconds = match &motion {
            Motion::Keyframes(_) => self.duration_s,
            Motion::Dive(dive) => dive.duration_s(),
            Motion::Skim(skim) => skim.travel.duration_s(),
            Motion::Orbit(orbit) => orbit.turn.duration_s(),
        };
        let fps = f64::from(self.fps);
        // In whole frames, or the way back would not meet the frames of the way there.
        let duration_s = (seconds * fps - 1e-6).ceil() / fps;
        Flight { duration_s, motion, ..self.clone() }
    }

    /// The keyframes; none where the flight is a motion of another kind.
    pub fn keyframes(&self) -> &[Keyframe] {
        if let Motion::Keyframes(keys) = &self.motion { keys } else { &[] }
    }

    /// The deepest that it goes, in octaves below the start.
    pub fn deepest(&self) -> f64 {
        match &self.motion {
            Motion::Keyframes(keys) => keys.iter().map(|key| key.pose.depth).fold(0.0, f64::max),
            Motion::Dive(dive) => dive.depth + dive.fall.length,
            Motion::Skim(skim) => skim.depth,
            Motion::Orbit(orbit) => orbit.depth,
        }
    }

    /// How many frames the flight has, its first and its last instant included: 181 for three seconds at 60 per second.
    pub fn frames(&self) -> u64 {
        // A duration of so many frames' time may come out a rounding error short of them.
        (self.duration_s * f64::from(self.fps) + 1e-6).floor() as u64 + 1
    }

    /// The pose of a frame, counted from 0; beyond the last frame it stays as it is in the last.
    pub fn pose(&self, frame: u64) -> FlightPose {
        let seconds = |frames: u64| frames as f64 / f64::from(self.fps);
        // Counted in frames from both ends: frame i of a return is frame i from the end of the dive, to the bit.
        let left = (self.frames() - 1).saturating_sub(frame);
        self.pose_between(seconds(frame), seconds(left))
    }

    /// The pose at a time in seconds; before the flight and after it, as at its ends.
    pub fn pose_at(&self, time_s: f64) -> FlightPose {
        self.pose_between(time_s.max(0.0), (self.duration_s - time_s).max(0.0))
    }

    /// The pose so many seconds after the beginning and before the end.
    fn pose_between(&self, since_s: f64, left_s: f64) -> FlightPose {
        match &self.motion {
            Motion::Keyframes(keys) => keyframes::pose_at(keys, since_s),
            Motion::Dive(dive) => dive.pose(since_s, left_s),
            Motion::Skim(skim) => skim.pose(since_s),
            Motion::Orbit(orbit) => orbit.pose(since_s),
        }
    }
}
