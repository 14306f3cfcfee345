//! Scripted flights: keyframes from a TOML file, and the pose of any frame by itself.
//!
//! A pose is relative to a *target*, a point of the ground, and to a scale: lengths are in cells of the pose's own
//! depth, 2^-depth of the start's cells. So a flight means the same at every depth and in every world.
//! Frame `i` depends on `i` alone: frames can be drawn in any order, on any number of machines.

use std::f64::consts::{PI, TAU};

use serde::Deserialize;
use toml::Spanned;

use crate::world::source::{Embedded, Kind, Source};
pub use crate::world::source::{FileError, LoadError};

/// The deepest keyframe, in octaves below the start.
pub const MAX_DEPTH: f64 = 1_000_000.0;

/// A flight, checked: at least one keyframe, each a millisecond or more after the one before.
#[derive(Clone, Debug, PartialEq)]
pub struct Flight {
    /// What it is called: the built-in name, or the file's name without `.toml`.
    pub name: String,
    /// One line for people.
    pub title: String,
    /// Frames per second, 1 to 1000.
    pub fps: u32,
    /// Length in seconds; the last keyframe's time or later.
    pub duration_s: f64,
    /// Where the viewer is, when; times rise strictly, yaw and roll take the short way from one to the next.
    pub keyframes: Vec<Keyframe>,
}

/// The pose at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Keyframe {
    /// Seconds since the flight began, 0 or more.
    pub time_s: f64,
    /// The pose.
    pub pose: FlightPose,
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
    /// Altitude above the ground at the target, above 0.
    pub height: f64,
    /// Horizontal distance (x, z) from the target.
    pub offset: [f64; 2],
}

impl Flight {
    /// The flight of a built-in name, or of the TOML file at a path.
    ///
    /// # Errors
    /// [`LoadError`], a sentence that says what to do: an unknown name, an unreadable file, or a file with
    /// something wrong in it (then with its line).
    pub fn load(name_or_path: &str) -> Result<Flight, LoadError> {
        Ok(check(&KIND.find(name_or_path)?)?)
    }

    /// The flight a text describes, as if it had been read from `file`; named after it.
    ///
    /// # Errors
    /// The first thing wrong in the text.
    pub fn parse(file: &str, text: &str) -> Result<Flight, FileError> {
        let name = std::path::Path::new(file).file_stem().unwrap_or_default().to_string_lossy();
        check(&KIND.source(name, file, text))
    }

    /// The names of the built-in flights, the default first.
    pub fn names() -> impl Iterator<Item = &'static str> {
        KIND.embedded.iter().map(|flight| flight.name)
    }

    /// How many frames the flight has, its first and its last instant included: 181 for three seconds at 60 per second.
    pub fn frames(&self) -> u64 {
        // A duration of so many frames' time may come out a rounding error short of them.
        (self.duration_s * f64::from(self.fps) + 1e-6).floor() as u64 + 1
    }

    /// The pose of a frame, counted from 0; beyond the last frame it stays at the last keyframe.
    pub fn pose(&self, frame: u64) -> FlightPose {
        self.pose_at(frame as f64 / f64::from(self.fps))
    }

    /// The pose at a time in seconds: before the first keyframe the first one's, after the last the last one's,
    /// between two of them a monotone cubic, which has no corner and never overshoots.
    pub fn pose_at(&self, time_s: f64) -> FlightPose {
        let keys = &self.keyframes;
        let after = keys.partition_point(|key| key.time_s <= time_s);
        if after == 0 || after == keys.len() {
            return keys[after.saturating_sub(1)].pose;
        }
        let from = after - 1;
        let span = Span {
            before: from.checked_sub(1).map(|i| &keys[i]),
            from: &keys[from],
            to: &keys[after],
            after: keys.get(after + 1),
        };
        span.pose((time_s - keys[from].time_s) / (keys[after].time_s - keys[from].time_s))
    }
}

/// Two neighbouring keyframes and the ones outside them, which decide the slopes at both ends.
struct Span<'a> {
    before: Option<&'a Keyframe>,
    from: &'a Keyframe,
    to: &'a Keyframe,
    after: Option<&'a Keyframe>,
}

impl Span<'_> {
    /// The pose at `u` from 0 (`from`, exactly) to 1 (`to`).
    fn pose(&self, u: f64) -> FlightPose {
        let start = &self.from.pose;
        let gain = |channel: fn(&FlightPose) -> f64| self.gain(channel, u);
        FlightPose {
            depth: start.depth + gain(|pose| pose.depth),
            yaw: start.yaw + gain(|pose| pose.yaw),
            pitch: start.pitch + gain(|pose| pose.pitch),
            roll: start.roll + gain(|pose| pose.roll),
            // By ratios, as the depth is: halving the height looks like one octave of falling.
            height: start.height * gain(|pose| pose.height.log2()).exp2(),
            offset: [
                start.offset[0] + gain(|pose| pose.offset[0]),
                start.offset[1] + gain(|pose| pose.offset[1]),
            ],
        }
    }

    /// What one channel has gained at `u` over its value in `from`: a cubic Hermite with the slopes of
    /// Fritsch and Butland (1984), so exactly 0 at u = 0 and a straight line where the keyframes lie on one.
    fn gain(&self, channel: fn(&FlightPose) -> f64, u: f64) -> f64 {
        let time = self.to.time_s - self.from.time_s;
        let chord = chord(self.from, self.to, channel);
        let start = self.before.map_or(chord, |before| {
            tangent(chord_of(before, self.from, channel), Chord { slope: chord, time })
        });
        let end = self
            .after
            .map_or(chord, |after| tangent(Chord { slope: chord, time }, chord_of(self.to, after, channel)));
        let (u2, u3) = (u * u, u * u * u);
        time * ((3.0 * u2 - 2.0 * u3) * chord + (u3 - 2.0 * u2 + u) * start + (u3 - u2) * end)
    }
}

/// The straight line between two keyframes: its slope per second, and how long it is.
#[derive(Clone, Copy)]
struct Chord {
    slope: f64,
    time: f64,
}

fn chord(from: &Keyframe, to: &Keyframe, channel: fn(&FlightPose) -> f64) -> f64 {
    chord_of(from, to, channel).slope
}

fn chord_of(from: &Keyframe, to: &Keyframe, channel: fn(&FlightPose) -> f64) -> Chord {
    let time = to.time_s - from.time_s;
    Chord { slope: (channel(&to.pose) - channel(&from.pose)) / time, time }
}

/// The slope at a keyframe between two chords: 0 at a turning point, else their weighted harmonic mean, which is
/// at most three times the gentler one: the condition for not overshooting.
fn tangent(left: Chord, right: Chord) -> f64 {
    if left.slope * right.slope <= 0.0 {
        return 0.0;
    }
    let (left_weight, right_weight) = (left.time + 2.0 * right.time, 2.0 * left.time + right.time);
    (left_weight + right_weight) / (left_weight / left.slope + right_weight / right.slope)
}

macro_rules! embed {
    ($name:literal) => {
        Embedded {
            name: $name,
            file: concat!("config/flights/", $name, ".toml"),
            text: include_str!(concat!("../config/flights/", $name, ".toml")),
        }
    };
}

/// Flight files. The first built-in one is the default.
static KIND: Kind = Kind {
    name: "flight",
    embedded: &[embed!("dive"), embed!("look-around"), embed!("over"), embed!("still")],
    keys: &[
        ("title", "one line of text for people, such as title = \"Once around the mesa\""),
        ("fps", "a whole number of frames per second from 1 to 1000"),
        ("duration_s", "a number of seconds from the last keyframe's time to 1000000"),
        ("keyframe", "one or more tables [[keyframe]], each with time_s, depth and height"),
        ("time_s", "a number of seconds from 0 to 1000000, at least 0.001 later than in the keyframe before"),
        ("depth", "a number of octaves below the start, from 0 to 1000000"),
        ("height", "a number above 0, up to 1000000, in cells of the keyframe's depth"),
        ("yaw_deg", "a number of degrees from -3600 to 3600"),
        ("pitch_deg", "a number of degrees from -90 (straight down) to 90 (straight up)"),
        ("roll_deg", "a number of degrees from -3600 to 3600"),
        ("offset", "two numbers [x, z] from -1000000 to 1000000, in cells of the keyframe's depth"),
    ],
};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFlight {
    title: Spanned<String>,
    fps: Spanned<u32>,
    duration_s: Option<Spanned<f64>>,
    keyframe: Spanned<Vec<RawKeyframe>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawKeyframe {
    time_s: Spanned<f64>,
    depth: Spanned<f64>,
    height: Spanned<f64>,
    yaw_deg: Option<Spanned<f64>>,
    pitch_deg: Option<Spanned<f64>>,
    roll_deg: Option<Spanned<f64>>,
    offset: Option<Spanned<Vec<Spanned<f64>>>>,
}

/// Longest time, highest height, furthest offset: large enough for anything, small enough to stay exact.
const FAR: f64 = 1_000_000.0;

/// Shortest time between keyframes, in seconds: no frame rate needs less, and slopes stay finite.
const LEAST_STEP_S: f64 = 0.001;

/// Reads and checks a flight file.
fn check(source: &Source<'_>) -> Result<Flight, FileError> {
    let raw: RawFlight = source.parse()?;
    let title = raw.title.get_ref().trim();
    if title.is_empty() || title.chars().any(char::is_control) {
        return Err(source.refuse("title", &raw.title));
    }
    if !(1..=1000).contains(raw.fps.get_ref()) {
        return Err(source.refuse("fps", &raw.fps));
    }
    let keyframes = keyframes(source, &raw.keyframe)?;
    let last_s = keyframes.last().map_or(0.0, |key| key.time_s);
    let duration_s = match &raw.duration_s {
        Some(duration) => source.number("duration_s", duration, last_s..=FAR)?,
        None => last_s,
    };
    Ok(Flight {
        name: source.name.to_string(),
        title: title.to_owned(),
        fps: *raw.fps.get_ref(),
        duration_s,
        keyframes,
    })
}

fn keyframes(source: &Source<'_>, raw: &Spanned<Vec<RawKeyframe>>) -> Result<Vec<Keyframe>, FileError> {
    let mut keys: Vec<Keyframe> = Vec::with_capacity(raw.get_ref().len());
    for raw in raw.get_ref() {
        let mut key = keyframe(source, raw)?;
        if let Some(last) = keys.last() {
            if key.time_s < last.time_s + LEAST_STEP_S {
                return Err(source.refuse("time_s", &raw.time_s));
            }
            key.pose.yaw = the_short_way(last.pose.yaw, key.pose.yaw);
            key.pose.roll = the_short_way(last.pose.roll, key.pose.roll);
        }
        keys.push(key);
    }
    if keys.is_empty() {
        return Err(source.refuse("keyframe", raw));
    }
    Ok(keys)
}

fn keyframe(source: &Source<'_>, raw: &RawKeyframe) -> Result<Keyframe, FileError> {
    let height = source.number("height", &raw.height, f64::MIN_POSITIVE..=FAR)?;
    let pose = FlightPose {
        depth: source.number("depth", &raw.depth, 0.0..=MAX_DEPTH)?,
        yaw: angle(source, "yaw_deg", raw.yaw_deg.as_ref(), 3600.0)?,
        pitch: angle(source, "pitch_deg", raw.pitch_deg.as_ref(), 90.0)?,
        roll: angle(source, "roll_deg", raw.roll_deg.as_ref(), 3600.0)?,
        height,
        offset: raw.offset.as_ref().map_or(Ok([0.0; 2]), |offset| self::offset(source, offset))?,
    };
    Ok(Keyframe { time_s: source.number("time_s", &raw.time_s, 0.0..=FAR)?, pose })
}

/// Radians of an angle within ±`most_deg` degrees; 0 where it is not given.
fn angle(
    source: &Source<'_>,
    key: &str,
    raw: Option<&Spanned<f64>>,
    most_deg: f64,
) -> Result<f64, FileError> {
    raw.map_or(Ok(0.0), |raw| source.number(key, raw, -most_deg..=most_deg).map(f64::to_radians))
}

fn offset(source: &Source<'_>, raw: &Spanned<Vec<Spanned<f64>>>) -> Result<[f64; 2], FileError> {
    match raw.get_ref().as_slice() {
        [x, z] => Ok([source.number("offset", x, -FAR..=FAR)?, source.number("offset", z, -FAR..=FAR)?]),
        _ => Err(source.refuse("offset", raw)),
    }
}

/// The angle equal to `angle` up to full turns that is within half a turn of `from`.
fn the_short_way(from: f64, angle: f64) -> f64 {
    // Exactly half a turn keeps the direction in which it was written; the margin is for degrees turned to radians.
    let turns = ((angle - from).abs() - PI - 1e-9) / TAU;
    angle - turns.ceil().max(0.0) * TAU * (angle - from).signum()
}
