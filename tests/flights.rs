//! Flights: the shipped ones load, a frame depends on its number alone, motion is smooth, keyframes are hit, and a
//! bad file gets its line, what is wrong and what would be right.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

use std::f64::consts::TAU;
use std::path::Path;

use fathomless::course::Course;
use fathomless::flight::{Flight, FlightPose, Footing, Gaze, LoadError, MAX_DEPTH, Motion, Ramp};
use fathomless::terrain::Block;
use fathomless::terrain::morph::Detail;
use fathomless::terrain::patch::Patch;
use fathomless::terrain::place::{Dive, START_LEVEL};
use fathomless::terrain::pool::Slot;
use fathomless::terrain::select::{Counts, Selection, Tiles, View};
use fathomless::terrain::surface::Corner;
use fathomless::world::World;
use glam::Vec3;
use proptest::prelude::*;

#[test]
fn every_file_in_config_is_a_built_in_flight() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/flights");
    let mut files: Vec<String> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().path().file_stem().unwrap().to_string_lossy().into_owned())
        .collect();
    files.sort();
    let mut names: Vec<&str> = Flight::names().collect();
    assert_eq!(names[0], "dive", "the default comes first");
    names.sort_unstable();
    assert_eq!(files, names);
    for name in names {
        let path = folder.join(format!("{name}.toml"));
        assert_eq!(Flight::load(name).unwrap(), Flight::load(path.to_str().unwrap()).unwrap());
    }
}

#[test]
fn the_shipped_flights_do_what_their_names_say() {
    let dive = Flight::load("dive").unwrap();
    assert_eq!((dive.fps, dive.duration_s, dive.frames()), (60, 3.0, 181));
    let depths: Vec<f64> = (0..dive.frames()).map(|frame| dive.pose(frame).depth).collect();
    assert!(depths.windows(2).all(|pair| pair[0] < pair[1]), "a dive never stops falling");
    assert_eq!((depths[0], depths[180]), (0.0, 6.0));

    let around = Flight::load("look-around").unwrap();
    let turned = around.pose(around.frames() - 1).yaw - around.pose(0).yaw;
    assert!((turned - TAU).abs() < 1e-9, "once around, not {turned}");

    let over = Flight::load("over").unwrap();
    assert!(over.frames() >= 300);
    let straight_down = (0..over.frames()).filter(|&frame| over.pose(frame).pitch < -1.57).count();
    assert!(straight_down >= 181, "looks straight down in {straight_down} frames");
    assert!((0..over.frames()).all(|frame| over.pose(frame).pitch.to_degrees() < -79.0));

    let still = Flight::load("still").unwrap();
    assert_eq!(still.frames(), 181);
    assert!((0..still.frames()).all(|frame| still.pose(frame) == still.pose(0)));
}

/// Keyframes as the tests make them up: time step, depth, height, yaw, pitch, roll (degrees), offset.
type Key = (f64, f64, f64, [f64; 3], [f64; 2]);

fn key() -> impl Strategy<Value = Key> {
    let angles = [-400.0..=400.0, -90.0..=90.0, -400.0..=400.0];
    (1u32..300, 0.0..2000.0, 0.01..100.0, angles, [-50.0..50.0, -50.0..50.0]).prop_map(
        |(frames, depth, height, angles, offset)| (f64::from(frames) / 60.0, depth, height, angles, offset),
    )
}

fn flight() -> impl Strategy<Value = Flight> {
    proptest::collection::vec(key(), 1..8).prop_map(|keys| {
        let mut text = String::from("title = 'made up'\nfps = 60\n");
        let mut time_s = 0.0;
        for (step, depth, height, [yaw, pitch, roll], [x, z]) in keys {
            text += &format!(
                "[[keyframe]]\ntime_s = {time_s:?}\ndepth = {depth:?}\nheight = {height:?}\nyaw_deg = {yaw:?}\n\
                 pitch_deg = {pitch:?}\nroll_deg = {roll:?}\noffset = [{x:?}, {z:?}]\n"
            );
            time_s += step;
        }
        Flight::parse("made-up.toml", &text).unwrap()
    })
}

fn channels(pose: &FlightPose) -> [f64; 7] {
    let [x, z] = pose.offset;
    [pose.depth, pose.yaw, pose.pitch, pose.roll, pose.height.log2(), x, z]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn keyframes_are_hit_exactly(flight in flight()) {
        for key in flight.keyframes() {
            prop_assert_eq!(flight.pose_at(key.time_s), key.pose);
        }
        prop_assert_eq!(flight.pose(0), flight.keyframes()[0].pose);
        prop_assert_eq!(flight.pose(flight.frames() - 1 + 1000), flight.keyframes().last().unwrap().pose);
    }

    #[test]
    fn a_frame_depends_on_its_number_alone(flight in flight(), picks in proptest::collection::vec(any::<u64>(), 1..20)) {
        let fresh = flight.clone();
        for pick in picks {
            let frame = pick % flight.frames();
            let pose = flight.pose(frame);
            prop_assert_eq!(pose, fresh.pose(frame));
            prop_assert_eq!(pose, flight.pose_at(frame as f64 / 60.0));
        }
    }

    /// No channel leaves the values of the two keyframes around it, and none moves faster than three times the
    /// steepest straight line between keyframes: no jump anywhere.
    #[test]
    fn motion_is_continuous_and_does_not_overshoot(flight in flight(), u in 0.0..1.0f64) {
        let keys = flight.keyframes();
        for pair in keys.windows(2) {
            let (from, to) = (channels(&pair[0].pose), channels(&pair[1].pose));
            let at = channels(&flight.pose_at(pair[0].time_s + u * (pair[1].time_s - pair[0].time_s)));
            for i in 0..7 {
                let slack = 1e-9 * (1.0 + from[i].abs() + to[i].abs());
                let (low, high) = (from[i].min(to[i]) - slack, from[i].max(to[i]) + slack);
                prop_assert!((low..=high).contains(&at[i]), "channel {}: {} not within {}..{}", i, at[i], low, high);
            }
        }
        let steepest = |i: usize| {
            let slope = |pair: &[_]| {
                let [from, to]: &[fathomless::flight::Keyframe; 2] = pair.try_into().unwrap();
                ((channels(&to.pose)[i] - channels(&from.pose)[i]) / (to.time_s - from.time_s)).abs()
            };
            keys.windows(2).map(slope).fold(0.0, f64::max)
        };
        let most: Vec<f64> = (0..7).map(|i| 3.0 * steepest(i) / 60.0).collect();
        for frame in 1..flight.frames() {
            let (before, now) = (channels(&flight.pose(frame - 1)), channels(&flight.pose(frame)));
            for i in 0..7 {
                let step = (now[i] - before[i]).abs();
                prop_assert!(step <= most[i] * (1.0 + 1e-9) + 1e-9, "channel {}: {} in frame {}", i, step, frame);
            }
        }
    }

    /// Turning takes the short way: never more than half a turn from one keyframe to the next, and each keyframe
    /// looks where its file says.
    #[test]
    fn turns_take_the_short_way(yaws in proptest::collection::vec(-720.0..720.0f64, 2..6)) {
        let mut text = String::from("title = 'turns'\nfps = 60\n");
        for (i, yaw) in yaws.iter().enumerate() {
            text += &format!("[[keyframe]]\ntime_s = {i}\ndepth = 0\nheight = 1\nyaw_deg = {yaw:?}\n");
        }
        let flight = Flight::parse("turns.toml", &text).unwrap();
        for (key, yaw) in flight.keyframes().iter().zip(&yaws) {
            let turns = (key.pose.yaw - yaw.to_radians()) / TAU;
            prop_assert!((turns - turns.round()).abs() < 1e-9);
        }
        for pair in flight.keyframes().windows(2) {
            prop_assert!((pair[1].pose.yaw - pair[0].pose.yaw).abs() <= TAU / 2.0 + 1e-6);
        }
    }
}

#[test]
fn straight_keyframes_make_a_straight_flight() {
    let key = |t: f64| format!("[[keyframe]]\ntime_s = {t}\ndepth = {}\nheight = 2\n", 4.0 * t);
    let text = format!("title = 'x'\nfps = 24\n{}{}{}", key(0.0), key(0.7), key(2.0));
    let flight = Flight::parse("x.toml", &text).unwrap();
    for frame in 0..flight.frames() {
        let expected = 4.0 * frame as f64 / 24.0;
        assert!((flight.pose(frame).depth - expected).abs() < 1e-12);
    }
}

#[test]
fn frames_count_both_ends() {
    let frames = |fps: u32, duration: &str| {
        let text = format!(
            "title = 'x'\nfps = {fps}\nduration_s = {duration}\n[[keyframe]]\ntime_s = 0\ndepth = 0\nheight = 1\n"
        );
        Flight::parse("x.toml", &text).unwrap().frames()
    };
    assert_eq!(frames(60, "0"), 1);
    assert_eq!(frames(60, "1"), 61);
    // 0.29 * 100 is 28.999... in binary.
    assert_eq!(frames(100, "0.29"), 30);
    assert_eq!(frames(90, "0.999"), 90);
    assert_eq!(frames(1000, "1000000"), 1_000_000_001);
}

const GOOD: &str = "\
title = 'good'
fps = 60
duration_s = 9

[[keyframe]]
time_s = 0
depth = 1
height = 2

[[keyframe]]
time_s = 2
depth = 3
height = 4
yaw_deg = 5
pitch_deg = 6
roll_deg = 7
offset = [8, 9]
";

/// The good file with one piece exchanged is refused at that piece's line, with all these words.
fn refused(from: &str, to: &str, words: &[&str]) {
    assert!(GOOD.contains(from));
    let text = GOOD.replacen(from, to, 1);
    let line = 1 + GOOD[..GOOD.find(from).unwrap()].matches('\n').count();
    let sentence = Flight::parse("my.toml", &text).expect_err(to).to_string();
    assert!(sentence.starts_with(&format!("my.toml:{line}: ")), "line {line} expected: {sentence}");
    assert!(sentence.contains("; ") && !sentence.contains('\n'), "{sentence}");
    for word in words {
        assert!(sentence.contains(word), "{word:?} expected: {sentence}");
    }
}

#[test]
fn impossible_keyframes_are_refused_with_their_line() {
    Flight::parse("good.toml", GOOD).unwrap();
    let cases: &[(&str, &str, &[&str])] = &[
        ("time_s = 2", "time_s = 0", &["`time_s` is 0", "later than in the keyframe before"]),
        ("time_s = 2", "time_s = 0.0001", &["`time_s` is 0.0001", "0.001"]),
        ("time_s = 0", "time_s = -1", &["`time_s` is -1"]),
        ("time_s = 2", "time_s = nan", &["`time_s` is nan"]),
        ("time_s = 2", "time_s = inf", &["`time_s` is inf"]),
        ("height = 2", "height = 0", &["`height` is 0", "above 0"]),
        ("height = 2", "height = -1", &["`height` is -1"]),
        ("height = 2", "height = 128.1", &["`height` is 128.1", "up to 128", "the ground would be"]),
        ("height = 2", "height = nan", &["`height` is nan"]),
        ("height = 2", "height = 'high'", &["`height` is 'high'"]),
        ("depth = 3", "depth = 1000001", &["`depth` is 1000001", "1000000"]),
        ("depth = 3", "depth = -0.5", &["`depth` is -0.5"]),
        ("pitch_deg = 6", "pitch_deg = -91", &["`pitch_deg` is -91", "straight down"]),
        ("yaw_deg = 5", "yaw_deg = 1e9", &["`yaw_deg` is 1e9"]),
        ("roll_deg = 7", "roll_deg = inf", &["`roll_deg` is inf"]),
        ("roll_deg = 7", "rol_deg = 7", &["unknown key `rol_deg`", "did you mean `roll_deg`?"]),
        ("offset = [8, 9]", "offset = [8]", &["`offset` is [8]", "two numbers"]),
        ("offset = [8, 9]", "offset = [8, 9, 10]", &["two numbers"]),
        ("offset = [8, 9]", "offset = [8, nan]", &["`offset` is nan"]),
        ("offset = [8, 9]", "offset = 8", &["`offset` is 8", "two numbers"]),
        ("offset = [8, 9]", "offset = [8, 'x']", &["`offset` is 'x'", "two numbers"]),
        ("fps = 60", "fps = 0", &["`fps` is 0", "1 to 1000"]),
        ("fps = 60", "fps = 59.94", &["`fps` is 59.94", "whole number"]),
        ("duration_s = 9", "duration_s = 1", &["`duration_s` is 1", "last keyframe's time"]),
        ("title = 'good'", "title = ' '", &["`title` is ' '"]),
    ];
    for (from, to, words) in cases {
        refused(from, to, words);
    }
}

#[test]
fn a_flight_needs_a_keyframe() {
    let sentence = Flight::parse("my.toml", "title = 'x'\nfps = 60\n").unwrap_err().to_string();
    assert!(sentence.contains("`keyframe` is missing") && sentence.contains("one or more"), "{sentence}");
    let sentence =
        Flight::parse("my.toml", "title = 'x'\nfps = 60\nkeyframe = []\n").unwrap_err().to_string();
    assert!(
        sentence.starts_with("my.toml:3: `keyframe` is []") && sentence.contains("one or more"),
        "{sentence}"
    );
}

#[test]
fn an_unknown_flight_lists_the_known() {
    let error = Flight::load("diev").unwrap_err();
    assert!(matches!(error, LoadError::Unknown { .. }));
    assert!(error.to_string().contains("dive, dive-and-return, look-around, orbit"), "{error}");
}

#[test]
fn a_file_has_one_motion_whose_values_make_sense() {
    let text = |motion: &str| format!("title = 'x'\nfps = 60\n{motion}\n");
    for motion in ["[dive]", "[skim]", "[orbit]", "[dive]\nway = 'in-and-out'\nrest_s = 0"] {
        let flight = Flight::parse("x.toml", &text(motion)).unwrap();
        assert!(flight.frames() > 60 && flight.keyframes().is_empty(), "{motion}");
    }
    let cases: &[(&str, usize, &[&str])] = &[
        ("[dive]\n[skim]", 4, &["`skim` is a second motion", "one motion"]),
        ("[dive]\n[[keyframe]]\ntime_s = 0\ndepth = 0\nheight = 1", 3, &["`dive` is a second motion"]),
        ("duration_s = 5\n[dive]", 3, &["`duration_s` is 5", "with keyframes only"]),
        ("dive = 3", 3, &["`dive` is 3", "a table [dive]"]),
        ("[dive]\nway = 'down'", 4, &["`way` is 'down'", "\"in-and-out\""]),
        ("[dive]\nrest_s = 1", 4, &["`rest_s` is 1", "in-and-out"]),
        ("[dive]\noctaves = 0", 4, &["`octaves` is 0", "above 0"]),
        ("[dive]\noctaves = inf", 4, &["`octaves` is inf"]),
        ("[dive]\ndepth = 999999\noctaves = 2", 5, &["`octaves` is 2", "1000000 at most"]),
        ("[dive]\noctaves_per_second = 0", 4, &["`octaves_per_second` is 0"]),
        ("[dive]\nspeed = 1", 4, &["unknown key `speed`"]),
        ("[skim]\ndistance = -1", 4, &["`distance` is -1"]),
        ("[skim]\nspeed = nan", 4, &["`speed` is nan"]),
        ("[skim]\nsmoothing = 9", 4, &["`smoothing` is 9", "0 to 8"]),
        ("[skim]\nsmoothing = -1", 4, &["`smoothing` is -1", "0 to 8"]),
        ("[skim]\nheight = 0", 4, &["`height` is 0"]),
        ("[skim]\nheight = 1000", 4, &["`height` is 1000", "up to 128"]),
        ("[dive]\nheight = 1e6", 4, &["`height` is 1e6", "up to 128"]),
        ("[orbit]\nheight = 129", 4, &["`height` is 129", "up to 128"]),
        ("[orbit]\nradius = 0", 4, &["`radius` is 0"]),
        ("[orbit]\nturns = 1001", 4, &["`turns` is 1001"]),
        ("[orbit]\ndeg_per_second = -30", 4, &["`deg_per_second` is -30"]),
    ];
    for (motion, line, words) in cases {
        let sentence = Flight::parse("my.toml", &text(motion)).expect_err(motion).to_string();
        assert!(sentence.starts_with(&format!("my.toml:{line}: ")), "{motion}: line {line}: {sentence}");
        for word in *words {
            assert!(sentence.contains(word), "{motion}: {word:?} expected: {sentence}");
        }
    }
}

#[test]
fn a_ramp_starts_and_stops_smoothly_and_arrives() {
    for ramp in [
        Ramp { length: 200.0, speed: 2.5, ease_s: 0.6 },
        Ramp { length: 1.0, speed: 2.0, ease_s: 10.0 },
        Ramp { length: 3.0, speed: 1.0, ease_s: 0.0 },
        Ramp { length: 100_000.0, speed: 1000.0, ease_s: 5.0 },
    ] {
        let total = ramp.duration_s();
        assert_eq!((ramp.travelled(0.0), ramp.travelled(total)), (0.0, ramp.length), "{ramp:?}");
        assert_eq!((ramp.travelled(-1.0), ramp.travelled(total + 1.0)), (0.0, ramp.length));
        let steps = 10_000;
        let at = |i: u32| ramp.travelled(total * f64::from(i) / f64::from(steps));
        let step = total / f64::from(steps);
        for i in 0..steps {
            let speed = (at(i + 1) - at(i)) / step;
            let pace = ramp.pace(total * (f64::from(i) + 0.5) / f64::from(steps));
            let slack =
                2.0 * ramp.speed * step / ramp.ease_s.max(1e-3).min(total / 2.0) + 1e-6 * ramp.length / total;
            if ramp.ease_s > 0.0 {
                assert!((speed - pace * ramp.speed).abs() <= slack, "{ramp:?} at {i}: {speed} and {pace}");
            }
            assert!((-1e-9..=ramp.speed * 1.000_001).contains(&speed), "{ramp:?} at {i}: {speed}");
        }
    }
}

#[test]
fn a_dive_can_be_made_longer_and_nothing_else() {
    let dive = Flight::load("dive").unwrap();
    let long = dive.with_octaves(200.0).unwrap();
    assert_eq!((long.deepest(), long.pose(long.frames() - 1).depth), (200.0, 200.0));
    assert!((long.duration_s - 80.6).abs() < 1e-9, "{}", long.duration_s);
    // The beginning is the same, to the bit.
    for frame in 0..140 {
        assert_eq!(long.pose(frame), dive.pose(frame), "frame {frame}");
    }
    assert_eq!(dive.with_octaves(MAX_DEPTH).unwrap().deepest(), MAX_DEPTH);
    for octaves in [0.0, -1.0, f64::NAN, f64::INFINITY, MAX_DEPTH + 1.0] {
        assert_eq!(dive.with_octaves(octaves), None, "{octaves}");
    }
    for name in ["skim", "orbit", "over", "still"] {
        assert_eq!(Flight::load(name).unwrap().with_octaves(7.0), None, "{name}");
    }
}

#[test]
fn a_return_is_the_dive_backwards() {
    for octaves in [0.7, 6.0, 61.3] {
        let long = |name| Flight::load(name).unwrap().with_octaves(octaves).unwrap();
        let (dive, back, both) = (long("dive"), long("return"), long("dive-and-return"));
        let last = dive.frames() - 1;
        assert_eq!(back.frames() - 1, last);
        for frame in 0..=last {
            assert_eq!(back.pose(frame), dive.pose(last - frame), "{octaves} octaves, frame {frame}");
            assert_eq!(both.pose(frame), dive.pose(frame), "{octaves} octaves, frame {frame}");
        }
        let end = both.frames() - 1;
        assert!(end >= 2 * last + 58, "the rest is missing: {end} and {last}");
        for frame in 0..=end {
            assert_eq!(both.pose(end - frame), both.pose(frame), "{octaves} octaves, frame {frame}");
        }
        assert_eq!(both.pose(end / 2).depth, octaves);
    }
}

#[test]
fn a_skim_goes_straight_and_an_orbit_round() {
    let skim = Flight::load("skim").unwrap();
    let Motion::Skim(motion) = &skim.motion else { panic!("not a skim") };
    assert!(motion.travel.length >= 200.0, "hundreds of tiles");
    let length = |pose: &FlightPose| pose.offset[0].hypot(pose.offset[1]);
    let mut before = skim.pose(0);
    for frame in 1..skim.frames() {
        let pose = skim.pose(frame);
        assert!(length(&pose) > length(&before) && length(&pose) - length(&before) < 0.067);
        assert_eq!((pose.height, pose.depth, pose.yaw), (before.height, before.depth, before.yaw));
        before = pose;
    }
    assert!((length(&before) - motion.travel.length).abs() < 1e-9);

    let orbit = Flight::load("orbit").unwrap();
    let mut turned = 0.0;
    for frame in 1..orbit.frames() {
        let (a, b) = (orbit.pose(frame - 1).offset, orbit.pose(frame).offset);
        assert!((b[0].hypot(b[1]) - 6.0).abs() < 1e-9);
        turned += (a[1] * b[0] - a[0] * b[1]).atan2(a[0] * b[0] + a[1] * b[1]);
    }
    assert!((turned - TAU).abs() < 1e-6, "once round, not {turned}");
}

/// What a standpoint comes to, to the bit.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stand {
    level: usize,
    block: Block,
    position: [u64; 3],
    orientation: [u32; 4],
    height: u64,
}

fn stand(course: &mut Course, pose: &FlightPose) -> Stand {
    let here = course.at(pose);
    Stand {
        level: here.place.level(),
        block: here.place.spine.bottom().block,
        position: here.position.to_array().map(f64::to_bits),
        orientation: here.orientation.to_array().map(f32::to_bits),
        height: here.height.to_bits(),
    }
}

fn worlds() -> impl Iterator<Item = World> {
    World::names().map(|name| World::load(name).unwrap())
}

#[test]
fn a_standpoint_depends_on_its_pose_alone() {
    for world in worlds() {
        for name in Flight::names() {
            let flight = Flight::load(name).unwrap();
            let fresh = || Course::new(world.surface, 3, flight.deepest(), |_| ());
            let mut in_order = fresh();
            let every = flight.frames().div_ceil(97);
            let frames: Vec<u64> = (0..flight.frames()).step_by(every as usize).collect();
            let expected: Vec<Stand> =
                frames.iter().map(|&f| stand(&mut in_order, &flight.pose(f))).collect();
            // Backwards, in leaps, and each by itself in a course that went deeper.
            let mut leaping = fresh();
            for i in 0..frames.len() {
                let k = (i * 61) % frames.len();
                assert_eq!(
                    stand(&mut leaping, &flight.pose(frames[k])),
                    expected[k],
                    "{name}, frame {}",
                    frames[k]
                );
            }
            for k in (0..frames.len()).rev().step_by(19) {
                let mut alone = Course::new(world.surface, 3, flight.deepest() + 7.0, |_| ());
                assert_eq!(
                    stand(&mut alone, &flight.pose(frames[k])),
                    expected[k],
                    "{name}, frame {}",
                    frames[k]
                );
            }
        }
    }
}

#[test]
fn a_course_leads_to_the_target_of_the_dive() {
    let surface = World::load("canyonlands").unwrap().surface;
    let dive = Dive::new(surface, START_LEVEL + 300, |_| ());
    let flight = Flight::load("dive").unwrap().with_octaves(300.0).unwrap();
    let mut course = Course::new(surface, 0, 300.0, |_| ());
    for frame in (0..flight.frames()).step_by(37) {
        let pose = flight.pose(frame);
        let here = course.at(&pose);
        let place = dive.place(START_LEVEL + pose.depth as usize);
        assert_eq!(here.place.spine.bottom(), place.spine.bottom());
        assert_eq!((here.position.x, here.position.z), (place.position.x, place.position.z));
        assert_eq!(here.position.y, place.position.y + here.height);
    }
}

#[test]
fn every_flight_stays_above_the_ground() {
    for world in worlds() {
        for name in Flight::names() {
            let flight = Flight::load(name).unwrap();
            for offset in [0, 500] {
                let mut course = Course::new(world.surface, offset, flight.deepest(), |_| ());
                for frame in (0..flight.frames()).step_by(3) {
                    let here = course.at(&flight.pose(frame));
                    let ground = here.place.ground(here.position.x, here.position.z);
                    let clear = (here.position.y - ground) / here.height;
                    assert!(clear >= 0.349, "{}, {name}, frame {frame}: {clear}", world.name);
                }
            }
        }
    }
}

#[test]
fn a_skim_follows_the_ground_smoothly_over_every_border() {
    for world in worlds() {
        let flight = Flight::load("skim").unwrap();
        let mut course = Course::new(world.surface, 40, flight.deepest(), |_| ());
        let (mut borders, mut worst, mut clear) = (0, 0.0f64, Vec::new());
        let mut rises: Vec<f64> = Vec::new();
        let mut before: Option<(Block, f64)> = None;
        for frame in 0..flight.frames() {
            let here = course.at(&flight.pose(frame));
            let block = here.place.spine.bottom().block;
            clear.push((here.position.y - here.place.ground(here.position.x, here.position.z)) / here.height);
            if let Some((old, y)) = before {
                let step = |to: u32, from: u32| to.wrapping_sub(from) as i32;
                let moved = [step(block.corner.x, old.corner.x), step(block.corner.z, old.corner.z)];
                borders += usize::from(moved != [0, 0]);
                rises.push(here.position.y + old.rise_to(&block, moved) as f64 / 65_536.0 - y);
            }
            before = Some((block, here.position.y));
        }
        for pair in rises.windows(2) {
            worst = worst.max((pair[1] - pair[0]).abs());
        }
        clear.sort_by(f64::total_cmp);
        let median = clear[clear.len() / 2];
        assert!(borders > 300, "{}: {borders} borders", world.name);
        // Cells per frame, per frame: it speeds up by less than a fourteenth of its own speed.
        assert!(
            worst < 0.005,
            "{}: the speed changes by {worst} cells per frame from one frame to the next",
            world.name
        );
        assert!((0.8..4.0).contains(&median), "{}: {median} heights above the ground", world.name);
    }
}

#[test]
fn an_orbit_looks_at_its_target() {
    for world in worlds() {
        let flight = Flight::load("orbit").unwrap();
        let mut course = Course::new(world.surface, 9, flight.deepest(), |_| ());
        for frame in (0..flight.frames()).step_by(7) {
            let pose = flight.pose(frame);
            assert_eq!((pose.gaze, pose.footing), (Gaze::Target, Footing::Clear { smoothing: 2 }));
            let here = course.at(&pose);
            let ahead = here.orientation * Vec3::NEG_Z;
            let offset = Vec3::new(pose.offset[0] as f32, 0.0, pose.offset[1] as f32);
            // Where the line of sight comes over the target, it comes to the target's ground.
            let sideways = ahead.with_y(0.0).normalize().dot(-offset.normalize());
            assert!(sideways > 0.999_999, "frame {frame}: {sideways}");
            assert!(ahead.y < 0.0 && ahead.y > -0.9, "frame {frame}: {ahead}");
        }
    }
}

/// Every tile is there.
struct All;

impl Tiles for All {
    fn ready(&mut self, _: Corner) -> Option<Slot> {
        Some(0)
    }

    fn make(&mut self, _: &Patch, _: bool) -> Option<Slot> {
        Some(0)
    }
}

/// The selection at a standpoint, as the viewer makes it: its counts, and a sum over all that is drawn.
fn selected(course: &mut Course, pose: &FlightPose, selection: &mut Selection) -> (Counts, u64) {
    let surface = *course.surface();
    let here = course.at(pose);
    let (root, head) = here.place.seen_from_above(here.position, 11);
    let detail = Detail::new(2.6);
    selection.select(
        &surface,
        &View { root: &root.block, head, levels: 14, live_from: 0, prefetch_from: 0, detail, frusta: None },
        &mut All,
    );
    let sum = selection.drawn.iter().fold(0u64, |sum, tile| {
        let words = [
            tile.corner.x,
            tile.corner.z,
            tile.corner.level,
            tile.c,
            tile.slope[0].to_bits(),
            tile.corners.0,
        ];
        let head = tile.head.to_array().map(f64::to_bits).into_iter().fold(0, u64::wrapping_add);
        words.iter().fold(sum ^ head, |sum, &word| {
            sum.rotate_left(5).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ u64::from(word)
        })
    });
    (selection.counts, sum)
}

/// The promise: a hundred thousand octaves down and back, bit-equal, at 4 bytes per level and no more work.
#[test]
fn a_hundred_thousand_levels_and_back() {
    let octaves = 100_000;
    let surface = World::load("canyonlands").unwrap().surface;
    let dive = Flight::load("dive-and-return").unwrap().with_octaves(f64::from(octaves)).unwrap();
    let mut course = Course::new(surface, 0, dive.deepest(), |_| ());
    let bytes = course.path_bytes();
    let levels = octaves as usize + START_LEVEL;
    assert!(bytes <= 4 * levels, "{bytes} bytes for {levels} levels");
    let end = dive.frames() - 1;
    let mut selection = Selection::default();
    // Every level is met on the way down and on the way up; tiles are chosen at some.
    let stops: Vec<u64> = (0..=end / 2).step_by(24).collect();
    let mut down = Vec::with_capacity(stops.len());
    for (i, &frame) in stops.iter().enumerate() {
        let pose = dive.pose(frame);
        let chosen = (i % 500 == 0).then(|| selected(&mut course, &pose, &mut selection));
        down.push((stand(&mut course, &pose), chosen));
    }
    assert!(down.last().unwrap().0.level > START_LEVEL + octaves as usize - 50);
    for (i, &frame) in stops.iter().enumerate().rev() {
        let pose = dive.pose(end - frame);
        let chosen = (i % 500 == 0).then(|| selected(&mut course, &pose, &mut selection));
        assert_eq!((stand(&mut course, &pose), chosen), down[i], "frame {frame}");
    }
    assert_eq!(course.path_bytes(), bytes, "the path grew on the way");
    let nodes: Vec<usize> =
        down.iter().filter_map(|(_, chosen)| chosen.map(|(counts, _)| counts.nodes)).collect();
    let (least, most) = (nodes.iter().min().unwrap(), nodes.iter().max().unwrap());
    assert!(nodes.len() > 100 && *most as f64 <= 1.25 * *least as f64, "{least} to {most} nodes");
}
