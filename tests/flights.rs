//! Flights: the shipped ones load, a frame depends on its number alone, motion is smooth, keyframes are hit, and a
//! bad file gets its line, what is wrong and what would be right.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

use std::f64::consts::TAU;
use std::path::Path;

use fathomless::flight::{Flight, FlightPose, LoadError};
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
        for key in &flight.keyframes {
            prop_assert_eq!(flight.pose_at(key.time_s), key.pose);
        }
        prop_assert_eq!(flight.pose(0), flight.keyframes[0].pose);
        prop_assert_eq!(flight.pose(flight.frames() - 1 + 1000), flight.keyframes.last().unwrap().pose);
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
        let keys = &flight.keyframes;
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
        for (key, yaw) in flight.keyframes.iter().zip(&yaws) {
            let turns = (key.pose.yaw - yaw.to_radians()) / TAU;
            prop_assert!((turns - turns.round()).abs() < 1e-9);
        }
        for pair in flight.keyframes.windows(2) {
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
    assert!(error.to_string().contains("dive, look-around, over, still"), "{error}");
}
