//! Flight files: raw values that remember their place in the text, checked into a [`Flight`].

use std::f64::consts::{PI, TAU};
use std::ops::RangeInclusive;

use serde::Deserialize;
use toml::Spanned;

use super::{Dive, Flight, FlightPose, Keyframe, MAX_DEPTH, MAX_SMOOTHING, Motion, Orbit};
use super::{Ramp, Skim, Way};
use crate::world::source::{Embedded, FileError, Kind, Source};

macro_rules! embed {
    ($name:literal) => {
        Embedded {
            name: $name,
            file: concat!("config/flights/", $name, ".toml"),
            text: include_str!(concat!("../../config/flights/", $name, ".toml")),
        }
    };
}

/// Flight files. The first built-in one is the default.
pub(super) static KIND: Kind = Kind {
    name: "flight",
    embedded: &[
        embed!("dive"),
        embed!("dive-and-return"),
        embed!("look-around"),
        embed!("orbit"),
        embed!("over"),
        embed!("return"),
        embed!("skim"),
        embed!("still"),
    ],
    keys: &[
        ("title", "one line of text for people, such as title = \"Once around the mesa\""),
        ("fps", "a whole number of frames per second from 1 to 1000"),
        ("duration_s", "a number of seconds from the last keyframe's time to 1000000, with keyframes only"),
        ("keyframe", "one or more tables [[keyframe]], each with time_s, depth and height"),
        ("dive", "a table [dive], whose keys config/flights/dive.toml shows"),
        ("skim", "a table [skim], whose keys config/flights/skim.toml shows"),
        ("orbit", "a table [orbit], whose keys config/flights/orbit.toml shows"),
        ("time_s", "a number of seconds from 0 to 1000000, at least 0.001 later than in the keyframe before"),
        ("depth", "a number of octaves below the start, from 0 to 1000000"),
        (
            "height",
            "a number above 0, up to 128, in cells of the depth: higher up the ground would be far away, and flat",
        ),
        ("yaw_deg", "a number of degrees from -3600 to 3600"),
        ("pitch_deg", "a number of degrees from -90 (straight down) to 90 (straight up)"),
        ("rest_pitch_deg", "a number of degrees from -90 (straight down) to 90 (straight up)"),
        ("roll_deg", "a number of degrees from -3600 to 3600"),
        ("offset", "two numbers [x, z] from -1000000 to 1000000, in cells of the keyframe's depth"),
        ("way", "\"in\", \"out\" or \"in-and-out\""),
        ("octaves", "a number above 0; with depth it comes to 1000000 at most"),
        ("octaves_per_second", "a number from 0.001 to 1000"),
        ("ease_s", "a number of seconds from 0 to 1000"),
        ("rest_s", "a number of seconds from 0 to 1000, where way is \"in-and-out\""),
        ("turn_deg_per_octave", "a number of degrees from -360 to 360"),
        ("distance", "a number of cells above 0, up to 1000000"),
        ("speed", "a number of cells per second from 0.001 to 1000000"),
        ("heading_deg", "a number of degrees from -3600 to 3600"),
        (
            "smoothing",
            "a whole number from 0 to 8: the ground is smoothed over two to the power of so many cells",
        ),
        ("radius", "a number of cells above 0, up to 1000000"),
        ("turns", "a number above 0, up to 1000"),
        ("deg_per_second", "a number of degrees from 0.001 to 3600"),
        ("from_deg", "a number of degrees from -3600 to 3600"),
    ],
};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFlight {
    title: Spanned<String>,
    fps: Spanned<u32>,
    duration_s: Option<Spanned<f64>>,
    keyframe: Option<Spanned<Vec<RawKeyframe>>>,
    dive: Option<Spanned<RawDive>>,
    skim: Option<Spanned<RawSkim>>,
    orbit: Option<Spanned<RawOrbit>>,
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

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawDive {
    way: Option<Spanned<String>>,
    depth: Option<Spanned<f64>>,
    octaves: Option<Spanned<f64>>,
    octaves_per_second: Option<Spanned<f64>>,
    ease_s: Option<Spanned<f64>>,
    rest_s: Option<Spanned<f64>>,
    height: Option<Spanned<f64>>,
    yaw_deg: Option<Spanned<f64>>,
    turn_deg_per_octave: Option<Spanned<f64>>,
    pitch_deg: Option<Spanned<f64>>,
    rest_pitch_deg: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSkim {
    depth: Option<Spanned<f64>>,
    distance: Option<Spanned<f64>>,
    speed: Option<Spanned<f64>>,
    ease_s: Option<Spanned<f64>>,
    heading_deg: Option<Spanned<f64>>,
    height: Option<Spanned<f64>>,
    smoothing: Option<Spanned<u8>>,
    yaw_deg: Option<Spanned<f64>>,
    pitch_deg: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawOrbit {
    depth: Option<Spanned<f64>>,
    radius: Option<Spanned<f64>>,
    height: Option<Spanned<f64>>,
    turns: Option<Spanned<f64>>,
    deg_per_second: Option<Spanned<f64>>,
    ease_s: Option<Spanned<f64>>,
    from_deg: Option<Spanned<f64>>,
    smoothing: Option<Spanned<u8>>,
    yaw_deg: Option<Spanned<f64>>,
    pitch_deg: Option<Spanned<f64>>,
}

/// Longest time, furthest offset: large enough for anything, small enough to stay exact.
const FAR: f64 = 1_000_000.0;

/// Highest height, in cells. The ground is [`COMFORT_M`](crate::rig::COMFORT_M) below whoever is as high as that, and so his
/// eyes are 2 cells from the middle of his head: half of what the coarsest backdrop allows. Twice as high, small pictures
/// have the ground itself in the backdrop, where it has no depth. A wider view is one of less depth.
const HIGHEST: f64 = 128.0;

/// Shortest time between keyframes, in seconds: no frame rate needs less, and slopes stay finite.
const LEAST_STEP_S: f64 = 0.001;

/// Slowest motion, per second.
const SLOWEST: f64 = 0.001;

/// The longest start or rest of a motion, in seconds.
const LONGEST_S: f64 = 1000.0;

/// Reads and checks a flight file.
pub(super) fn check(source: &Source<'_>) -> Result<Flight, FileError> {
    let raw: RawFlight = source.parse()?;
    let title = raw.title.get_ref().trim();
    if title.is_empty() || title.chars().any(char::is_control) {
        return Err(source.refuse("title", &raw.title));
    }
    if !(1..=1000).contains(raw.fps.get_ref()) {
        return Err(source.refuse("fps", &raw.fps));
    }
    let motion = motion(source, &raw)?;
    let duration_s = match (&motion, &raw.duration_s) {
        (Motion::Keyframes(keys), given) => {
            let last_s = keys.last().map_or(0.0, |key| key.time_s);
            given.as_ref().map_or(Ok(last_s), |given| source.number("duration_s", given, last_s..=FAR))?
        }
        (_, Some(given)) => return Err(source.refuse("duration_s", given)),
        (_, None) => 0.0,
    };
    let flight = Flight {
        name: source.name.to_string(),
        title: title.to_owned(),
        fps: *raw.fps.get_ref(),
        duration_s,
        motion: Motion::Keyframes(Vec::new()),
    };
    Ok(match motion {
        Motion::Keyframes(_) => Flight { motion, ..flight },
        computed => flight.with_motion(computed),
    })
}

/// The one motion that the file gives.
fn motion(source: &Source<'_>, raw: &RawFlight) -> Result<Motion, FileError> {
    let given = [
        raw.keyframe.as_ref().map(|raw| ("keyframe", raw.span())),
        raw.dive.as_ref().map(|raw| ("dive", raw.span())),
        raw.skim.as_ref().map(|raw| ("skim", raw.span())),
        raw.orbit.as_ref().map(|raw| ("orbit", raw.span())),
    ];
    let one =
        "it should be one motion: one or more tables [[keyframe]], or one table [dive], [skim] or [orbit]";
    if let Some((key, span)) = given.into_iter().flatten().nth(1) {
        return Err(source.error(span, format!("`{key}` is a second motion"), one));
    }
    if let Some(raw) = &raw.dive {
        return dive(source, raw.get_ref()).map(Motion::Dive);
    }
    if let Some(raw) = &raw.skim {
        return skim(source, raw.get_ref()).map(Motion::Skim);
    }
    if let Some(raw) = &raw.orbit {
        return orbit(source, raw.get_ref()).map(Motion::Orbit);
    }
    match &raw.keyframe {
        Some(raw) => keyframes(source, raw).map(Motion::Keyframes),
        None => Err(source.error(0..0, "`keyframe` is missing", one)),
    }
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
    let height = source.number("height", &raw.height, f64::MIN_POSITIVE..=HIGHEST)?;
    let pose = FlightPose {
        depth: source.number("depth", &raw.depth, 0.0..=MAX_DEPTH)?,
        yaw: angle_or(source, ("yaw_deg", &raw.yaw_deg), 3600.0, 0.0)?,
        pitch: angle_or(source, ("pitch_deg", &raw.pitch_deg), 90.0, 0.0)?,
        roll: angle_or(source, ("roll_deg", &raw.roll_deg), 3600.0, 0.0)?,
        height,
        offset: raw.offset.as_ref().map_or(Ok([0.0; 2]), |offset| self::offset(source, offset))?,
        ..FlightPose::default()
    };
    Ok(Keyframe { time_s: source.number("time_s", &raw.time_s, 0.0..=FAR)?, pose })
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

/// A number of a key that may be left out.
fn optional(
    source: &Source<'_>,
    (key, raw): (&str, &Option<Spanned<f64>>),
    range: RangeInclusive<f64>,
    default: f64,
) -> Result<f64, FileError> {
    raw.as_ref().map_or(Ok(default), |raw| source.number(key, raw, range))
}

/// Radians of an angle within ±`most_deg` degrees that may be left out.
fn angle_or(
    source: &Source<'_>,
    (key, raw): (&str, &Option<Spanned<f64>>),
    most_deg: f64,
    default_deg: f64,
) -> Result<f64, FileError> {
    optional(source, (key, raw), -most_deg..=most_deg, default_deg).map(f64::to_radians)
}

fn smoothing(source: &Source<'_>, raw: &Option<Spanned<u8>>, default: u8) -> Result<u8, FileError> {
    match raw {
        Some(raw) if *raw.get_ref() > MAX_SMOOTHING => Err(source.refuse("smoothing", raw)),
        Some(raw) => Ok(*raw.get_ref()),
        None => Ok(default),
    }
}

fn dive(source: &Source<'_>, raw: &RawDive) -> Result<Dive, FileError> {
    let above_0 = f64::MIN_POSITIVE;
    let depth = optional(source, ("depth", &raw.depth), 0.0..=MAX_DEPTH, 0.0)?;
    let speed = ("octaves_per_second", &raw.octaves_per_second);
    let fall = Ramp {
        length: optional(source, ("octaves", &raw.octaves), above_0..=MAX_DEPTH - depth, 6.0)?,
        speed: optional(source, speed, SLOWEST..=1000.0, 2.5)?,
        ease_s: optional(source, ("ease_s", &raw.ease_s), 0.0..=LONGEST_S, 0.6)?,
    };
    Ok(Dive {
        way: way(source, raw)?,
        depth,
        fall,
        height: optional(source, ("height", &raw.height), above_0..=HIGHEST, 2.0)?,
        yaw: angle_or(source, ("yaw_deg", &raw.yaw_deg), 3600.0, 0.0)?,
        turn: angle_or(source, ("turn_deg_per_octave", &raw.turn_deg_per_octave), 360.0, 5.0)?,
        pitch: angle_or(source, ("pitch_deg", &raw.pitch_deg), 90.0, -26.0)?,
        rest_pitch: angle_or(source, ("rest_pitch_deg", &raw.rest_pitch_deg), 90.0, -14.0)?,
    })
}

fn way(source: &Source<'_>, raw: &RawDive) -> Result<Way, FileError> {
    let rest_s = optional(source, ("rest_s", &raw.rest_s), 0.0..=LONGEST_S, 1.0)?;
    let way = match &raw.way {
        None => Way::In,
        Some(way) => match way.get_ref().as_str() {
            "in" => Way::In,
            "out" => Way::Out,
            "in-and-out" => Way::InAndOut { rest_ms: (1000.0 * rest_s).round() as u32 },
            _ => return Err(source.refuse("way", way)),
        },
    };
    match (&raw.rest_s, way) {
        (Some(rest), Way::In | Way::Out) => Err(source.refuse("rest_s", rest)),
        _ => Ok(way),
    }
}

fn skim(source: &Source<'_>, raw: &RawSkim) -> Result<Skim, FileError> {
    let above_0 = f64::MIN_POSITIVE;
    Ok(Skim {
        depth: optional(source, ("depth", &raw.depth), 0.0..=MAX_DEPTH, 0.0)?,
        travel: Ramp {
            length: optional(source, ("distance", &raw.distance), above_0..=FAR, 300.0)?,
            speed: optional(source, ("speed", &raw.speed), SLOWEST..=FAR, 4.0)?,
            ease_s: optional(source, ("ease_s", &raw.ease_s), 0.0..=LONGEST_S, 1.0)?,
        },
        heading: angle_or(source, ("heading_deg", &raw.heading_deg), 3600.0, 30.0)?,
        height: optional(source, ("height", &raw.height), above_0..=HIGHEST, 1.5)?,
        smoothing: smoothing(source, &raw.smoothing, 2)?,
        yaw: angle_or(source, ("yaw_deg", &raw.yaw_deg), 3600.0, 0.0)?,
        pitch: angle_or(source, ("pitch_deg", &raw.pitch_deg), 90.0, -14.0)?,
    })
}

fn orbit(source: &Source<'_>, raw: &RawOrbit) -> Result<Orbit, FileError> {
    let above_0 = f64::MIN_POSITIVE;
    Ok(Orbit {
        depth: optional(source, ("depth", &raw.depth), 0.0..=MAX_DEPTH, 0.0)?,
        radius: optional(source, ("radius", &raw.radius), above_0..=FAR, 6.0)?,
        height: optional(source, ("height", &raw.height), above_0..=HIGHEST, 3.0)?,
        turn: Ramp {
            length: TAU * optional(source, ("turns", &raw.turns), above_0..=1000.0, 1.0)?,
            speed: optional(source, ("deg_per_second", &raw.deg_per_second), SLOWEST..=3600.0, 30.0)?
                .to_radians(),
            ease_s: optional(source, ("ease_s", &raw.ease_s), 0.0..=LONGEST_S, 1.0)?,
        },
        from: angle_or(source, ("from_deg", &raw.from_deg), 3600.0, 0.0)?,
        smoothing: smoothing(source, &raw.smoothing, 2)?,
        yaw: angle_or(source, ("yaw_deg", &raw.yaw_deg), 3600.0, 0.0)?,
        pitch: angle_or(source, ("pitch_deg", &raw.pitch_deg), 90.0, 0.0)?,
    })
}
