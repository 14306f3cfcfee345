//! Land in the hands: what is between them stays between them at any depth, and what they did is undone to the bit by the
//! way back. Steps through the air land on ground. Dives lead back one after the other.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

use fathomless::course::{Course, Stand};
use fathomless::flight::FlightPose;
use fathomless::input::{Input, Leap, Ray};
use fathomless::pilot::{MotionSettings, Pilot};
use fathomless::rig::COMFORT_M;
use fathomless::terrain::hash::mix;
use fathomless::terrain::nearest::Probe;
use fathomless::terrain::surface::Corner;
use fathomless::terrain::{Place, Scheme, Surface, Terrace};
use glam::{DVec3, Quat, Vec3};
use proptest::prelude::*;
use std::f64::consts::LN_2;

const DT: f64 = 1.0 / 90.0;

/// The grain of a hand's reach, in tiles of the anchor's level or the one below.
const REACH_GRAIN: f64 = 1.0 / (1u64 << 38) as f64;

type Hands = [Option<Vec3>; 2];

fn canyonlands(seed: u64) -> Surface {
    Surface { seed, scheme: Scheme::Cubic, amplitude: 29_491, terrace: Terrace::new(4, 0.6, 0.2), only: None }
}

fn hills(seed: u64) -> Surface {
    Surface { seed, scheme: Scheme::Cubic, amplitude: 9_000, terrace: None, only: None }
}

fn over(surface: Surface, depth: usize) -> Pilot {
    let pose = FlightPose { height: 2.0, ..FlightPose::default() };
    let stand: Stand = Course::new(surface, depth, 0.0, |_| ()).at(&pose).stand();
    let mut pilot = Pilot::at(&stand, &MotionSettings::default());
    // The scale settles: in a headset it would wait for its wearer to move.
    for _ in 0..200 {
        pilot.advance(DT, &Input::default(), 1.0);
    }
    pilot
}

fn hold(pilot: &mut Pilot, grab: Hands) {
    pilot.advance(DT, &Input { worn: true, grab, ..Input::default() }, 1.0);
}

fn open(pilot: &mut Pilot, frames: usize) {
    (0..frames).for_each(|_| hold(pilot, [None; 2]));
}

/// Metres from the viewer to the nearest ground.
fn nearest_m(pilot: &Pilot) -> f64 {
    pilot.distance() * COMFORT_M / pilot.standpoint().height
}

/// What is between the hands, or in the one: where, in tiles of the place's anchor.
fn between(pilot: &Pilot, hands: Hands) -> (Place, DVec3) {
    let [left, right] = hands.map(|hand| hand.map(Vec3::as_dvec3));
    let middle = match (left, right) {
        (Some(left), Some(right)) => (left + right) * 0.5,
        (one, other) => one.or(other).unwrap(),
    };
    (pilot.standpoint().place.clone(), pilot.tiles_at(middle, true))
}

/// How far two points are from each other, in tiles of the shallower one's anchor.
fn apart(a: &(Place, DVec3), b: &(Place, DVec3)) -> f64 {
    a.0.way_from(a.1, (&b.0, b.1)).unwrap().0.length()
}

/// Level, tile and place in it as bits, seen from a level; with scale and heading.
fn state(pilot: &Pilot, level: usize) -> (Corner, [u64; 3], u64, [u32; 4]) {
    let here = pilot.standpoint();
    let (_, position) = here.place.lift(here.position, here.place.level(), level);
    let mut place = here.place.clone();
    while place.level() > level {
        place.shallower();
    }
    place.position = position;
    let (dx, dz) = (position.x.floor() as i32, position.z.floor() as i32);
    let before = place.spine.bottom().block;
    place.spine.walk(dx, dz);
    let block = place.spine.bottom().block;
    let rise = before.rise_to(&block, [dx, dz]) as f64 / 65_536.0;
    let position = position - DVec3::new(f64::from(dx), rise, f64::from(dz));
    let bits = position.to_array().map(f64::to_bits);
    (block.corner, bits, here.depth.to_bits(), here.heading.to_array().map(f32::to_bits))
}

fn number(salt: u32, i: u32) -> f32 {
    mix(salt ^ mix(i)) as f32 / u32::MAX as f32
}

/// Hands in a frame of a random gesture: wandering, both or one of them.
fn wandering(salt: u32, gesture: u32, s: f32) -> Hands {
    let one = |k: u32| 2.0 * number(salt, 64 * gesture + k) - 1.0;
    let vector = |k: u32| Vec3::new(one(k), one(k + 1), one(k + 2));
    let middle = |k: u32| 0.3 * vector(k) - Vec3::new(0.0, 0.4, 0.4);
    // From a third as far apart to three times as far, and turned.
    let towards = |k: u32| Vec3::new(one(k), 0.4 * one(k + 1), one(k + 2)).normalize_or(Vec3::X);
    let turn = Quat::IDENTITY.slerp(Quat::from_rotation_arc(towards(8), towards(12)), s);
    let apart = 0.35 * (1.1 * (one(16) + s * (one(17) - one(16)))).exp();
    let (middle, across) = (middle(0).lerp(middle(4), s), turn * towards(8) * apart);
    let hands = [middle - 0.5 * across, middle + 0.5 * across];
    match mix(salt ^ gesture) % 5 {
        0 => [Some(hands[0]), None],
        1 => [None, Some(hands[1])],
        _ => hands.map(Some),
    }
}

/// Frames of a gesture.
const FRAMES: u32 = 12;

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_is_between_the_hands_stays_there(
        seed in any::<u64>(), salt in any::<u32>(), depth in prop::sample::select(vec![0usize, 40, 3_000]),
    ) {
        check_gestures(over(canyonlands(seed), depth), salt, 60)?;
    }

    #[test]
    fn the_way_back_undoes_a_gesture_to_the_bit(seed in any::<u64>(), salt in any::<u32>()) {
        let mut pilot = over(hills(seed), 12);
        let mut undone = 0;
        for gesture in 0..20 {
            // Within what is comfortable the scale stays as it was left.
            open(&mut pilot, 150);
            hold(&mut pilot, [Some(Vec3::NEG_Y), None]);
            open(&mut pilot, 1);
            let (before, level) = (state(&pilot, pilot.standpoint().place.level()), pilot.standpoint().place.level());
            // Inwards: what is left behind on the way out is not known any more.
            let hands = |s: f32| {
                let hands = wandering(salt, gesture, s);
                let [Some(left), Some(right)] = hands else { return hands };
                let (middle, across) = (left.midpoint(right), (right - left).normalize() * (0.2 + 0.25 * s));
                [middle - 0.5 * across, middle + 0.5 * across].map(Some)
            };
            let mut slipped = false;
            let (there, back) = ((0..=FRAMES).collect::<Vec<_>>(), (0..=FRAMES).rev().collect::<Vec<_>>());
            for way in [there, back] {
                for frame in way {
                    hold(&mut pilot, hands(frame as f32 / FRAMES as f32));
                    slipped |= !(1.05..3.9).contains(&nearest_m(&pilot));
                }
                open(&mut pilot, 1);
            }
            if !slipped {
                prop_assert_eq!(state(&pilot, level), before, "gesture {}", gesture);
                undone += 1;
            }
        }
        prop_assert!(undone > 3, "{} gestures undone", undone);
    }
}

/// Goes through gestures, and measures at each frame what is between the hands.
fn check_gestures(mut pilot: Pilot, salt: u32, gestures: u32) -> Result<(), TestCaseError> {
    let (mut frames, mut held) = (0, 0);
    for gesture in 0..gestures {
        let mut before: Option<(Place, DVec3)> = None;
        for frame in 0..=FRAMES {
            let hands = wandering(salt, gesture, frame as f32 / FRAMES as f32);
            let was_m = nearest_m(&pilot);
            hold(&mut pilot, hands);
            prop_assert_eq!(pilot.holds(), hands.map(|hand| hand.is_some()));
            let here = pilot.standpoint();
            let ground = here.place.ground(here.position.x, here.position.z);
            prop_assert!(here.position.y > ground, "under ground");
            let is = between(&pilot, hands);
            // Near the ground the land slips through the hands, and far off as well.
            let free = |m: f64| (0.6..30.0).contains(&m);
            if let Some(before) = before.filter(|_| free(was_m) && free(nearest_m(&pilot))) {
                let off = apart(&is, &before);
                prop_assert!(off <= 2.0 * REACH_GRAIN, "gesture {gesture}, frame {frame}: {off} tiles off");
                held += 1;
            }
            before = Some(is);
            frames += 1;
        }
        open(&mut pilot, 30);
    }
    prop_assert!(held * 3 > frames, "held in {held} of {frames} frames");
    Ok(())
}

#[test]
fn a_hundred_thousand_levels_down_it_is_the_same() {
    check_gestures(over(hills(5), 96_000), 17, 400).unwrap();
}

/// Pulls the land up and apart, two octaves at once, and says by which frames.
fn pull(pilot: &mut Pilot, salt: u32) -> Vec<Hands> {
    let turn = Quat::from_rotation_y(0.6 * (number(salt, 1) - 0.5));
    let low = 0.5 - nearest_m(pilot) as f32;
    let frames = 24;
    let gesture: Vec<Hands> = (0..=frames)
        .map(|frame| {
            let s = frame as f32 / frames as f32;
            let middle = Vec3::new(0.1 * number(salt, 2), low * (1.0 - s), -0.3 - 0.1 * s);
            let across = Quat::IDENTITY.slerp(turn, s) * Vec3::X * (0.1 * (s * 4f32.ln()).exp());
            [middle - across, middle + across].map(Some)
        })
        .collect();
    gesture.iter().for_each(|hands| hold(pilot, *hands));
    open(pilot, 1);
    gesture
}

#[test]
fn fifty_levels_in_by_pulls_and_out_the_same_way_end_on_the_bits_they_began_with() {
    for (seed, depth) in [(1, 5), (2, 700), (3, 96_000)] {
        let mut pilot = over(hills(seed), depth);
        // The first hold puts the scale on its grain.
        hold(&mut pilot, [Some(Vec3::NEG_Y), None]);
        open(&mut pilot, 2);
        let level = pilot.standpoint().place.level();
        let (before, start) = (state(&pilot, level), pilot.standpoint().depth);
        let mut pulls = Vec::new();
        let mut states = Vec::new();
        while pilot.standpoint().depth - start < 50.0 {
            assert!(pulls.len() < 40, "came only {} octaves deep", pilot.standpoint().depth - start);
            states.push((pilot.standpoint().place.level(), state(&pilot, pilot.standpoint().place.level())));
            pulls.push(pull(&mut pilot, 100 * seed as u32 + pulls.len() as u32));
            let m = nearest_m(&pilot);
            assert!((1.05..3.9).contains(&m), "pull {}: the ground is {m} m away", pulls.len());
        }
        let deepest = pilot.standpoint().depth;
        for (gesture, (level, before)) in pulls.iter().zip(&states).rev() {
            gesture.iter().rev().for_each(|hands| hold(&mut pilot, *hands));
            open(&mut pilot, 1);
            assert_eq!(&state(&pilot, *level), before);
        }
        assert_eq!(state(&pilot, level), before, "from level {level}");
        println!("{} pulls, {:.1} octaves in and out, from level {level}", pulls.len(), deepest - start);
    }
}

#[test]
fn the_scale_that_hands_leave_is_kept_where_it_is_comfortable_and_else_comes_back_gently() {
    // Drawn apart in mid-air, where nothing else changes.
    let apart = |pilot: &mut Pilot, factor: f32| {
        for frame in 0..=30 {
            let half = 0.1 * factor.powf(frame as f32 / 30.0);
            hold(pilot, [-half, half].map(|x| Some(Vec3::new(x, 0.0, 0.0))));
        }
    };
    for (factor, kept) in [(1.6f32, true), (0.7, true), (6.0, false), (0.2, false)] {
        let mut pilot = over(hills(4), 10);
        let usual = nearest_m(&pilot);
        apart(&mut pilot, factor);
        let left = nearest_m(&pilot);
        assert!((left / usual / f64::from(factor) - 1.0).abs() < 0.01, "{usual} m, then {left} m");
        let (mut last, mut rate) = (left.log2(), 0.0f64);
        for _ in 0..300 {
            open(&mut pilot, 1);
            let now = (nearest_m(&pilot).log2() - last) / DT;
            assert!((now - rate).abs() / DT < 100.0, "a step from {rate} to {now} octaves/s");
            (last, rate) = (nearest_m(&pilot).log2(), now);
        }
        let settled = nearest_m(&pilot);
        if kept {
            assert!((settled / left - 1.0).abs() < 1e-6, "{left} m became {settled} m");
        } else {
            let edge = 2.0 * 2f64.powf(f64::from(factor).log2().signum());
            assert!((settled / edge - 1.0).abs() < 0.02, "{left} m became {settled} m");
        }
        // Back to the start, it is as ever.
        pilot.advance(DT, &Input { restart: true, ..Input::default() }, 1.0);
        for _ in 0..200 {
            pilot.advance(DT, &Input::default(), 1.0);
        }
        assert!((nearest_m(&pilot) / usual - 1.0).abs() < 0.02, "{} m", nearest_m(&pilot));
    }
}

#[test]
fn hands_pull_nobody_through_the_ground() {
    for seed in 0..6 {
        let mut pilot = over(canyonlands(seed), 20);
        for gesture in 0..60u32 {
            // Up and up, and apart now and then.
            for frame in 0..10 {
                let s = frame as f32 / 10.0;
                let half = if gesture % 3 == 0 { 0.1 + 0.4 * s } else { 0.2 };
                let y = -1.0 + 1.4 * s;
                hold(&mut pilot, [-half, half].map(|x| Some(Vec3::new(x, y, -0.5))));
                let here = pilot.standpoint();
                assert!(here.position.y > here.place.ground(here.position.x, here.position.z));
                assert!(nearest_m(&pilot) > 0.15, "{} m", nearest_m(&pilot));
            }
            if gesture % 4 == 0 {
                open(&mut pilot, 20);
            }
        }
    }
}

#[test]
fn nonsense_in_the_hands_is_survived() {
    let mut pilot = over(hills(1), 10);
    for at in [Vec3::NAN, Vec3::splat(1e30), Vec3::ZERO, Vec3::splat(-1e30), Vec3::NEG_Y] {
        for grab in [[Some(at), None], [Some(at); 2], [Some(at), Some(Vec3::X)], [Some(-at), Some(at)]] {
            for _ in 0..10 {
                hold(&mut pilot, grab);
                let here = pilot.standpoint();
                assert!(here.position.is_finite() && here.height > 0.0 && here.heading.is_finite());
                assert!(here.position.y > here.place.ground(here.position.x, here.position.z));
            }
        }
    }
}

fn throw(go: bool, pitch: f32, steepest: f32) -> Input {
    let direction = Quat::from_rotation_x(pitch) * Vec3::NEG_Z;
    let from = Ray { origin_m: Vec3::new(0.2, -0.3, -0.3), direction };
    let head_m = Vec3::new(0.3, 0.0, 0.2);
    Input { worn: true, leap: Some(Leap { from, reach_m: 12.0, steepest, head_m, go }), ..Input::default() }
}

#[test]
fn a_step_through_the_air_lands_on_ground_that_one_can_stand_on_as_high_as_before() {
    let (mut landed, mut steep) = (0, 0);
    for seed in 0..12 {
        let mut pilot = over(canyonlands(seed), 8);
        for i in 0..6 {
            let pitch = -0.5 + 0.25 * i as f32;
            pilot.advance(DT, &throw(false, pitch, 0.6), 1.0);
            let (points, lands) = pilot.arc();
            let points = points.as_slice().to_vec();
            assert!(points.len() >= 2 && points[0] == Vec3::new(0.2, -0.3, -0.3));
            // A ball's way, and above the ground but for its end.
            for pair in points.windows(3) {
                let bend = (pair[2] - pair[1]).normalize().dot((pair[1] - pair[0]).normalize());
                assert!(bend > 0.8, "{pair:?}");
            }
            let here = pilot.standpoint();
            let distance = |at: Vec3| {
                let at = pilot.tiles_at(at.as_dvec3(), true);
                let nearest = Probe::default().nearest(here.place, at, 0.01);
                nearest.least * COMFORT_M / here.height
            };
            let end = *points.last().unwrap();
            if points.len() < 64 {
                assert!(distance(end) < 0.02, "ends {} m off the ground", distance(end));
            }
            let (jumps, height, before) =
                (pilot.jumps(), nearest_m(&pilot), between(&pilot, [Some(end), None]));
            let (scale, depth) = (here.height, here.depth);
            let stood = between(&pilot, [Some(Vec3::new(0.3, 0.0, 0.2)), None]);
            pilot.advance(0.0, &throw(true, pitch, 0.6), 1.0);
            assert_eq!(pilot.jumps() - jumps, u32::from(lands));
            assert_eq!(pilot.arc().0.as_slice(), [], "it is over");
            let head = between(&pilot, [Some(Vec3::new(0.3, 0.0, 0.2)), None]);
            if !lands {
                steep += 1;
                assert!(apart(&head, &stood) < 1e-6, "one goes nowhere");
                continue;
            }
            landed += 1;
            assert!((pilot.standpoint().depth - depth).abs() < 1e-9, "the scale stays: {scale}");
            // The head is over where it landed, as high as it was.
            let (way, level) = head.0.way_from(head.1, (&before.0, before.1)).unwrap();
            let way = way * (before.0.level() as f64 - level as f64).exp2() * COMFORT_M / scale;
            assert!(way.x.hypot(way.z) < 0.05, "{way} m off");
            assert!(way.y > 0.2 && way.y < 2.0 * height + 1.0, "{} m over it, {height} m before", way.y);
            let here = pilot.standpoint();
            assert!(here.position.y > here.place.ground(here.position.x, here.position.z));
            open(&mut pilot, 100);
        }
    }
    assert!(landed > 20 && steep > 5, "{landed} landed, {steep} were too steep or too far");
}

fn dive(direction: Vec3) -> Input {
    Input { worn: true, dive: Some(Ray { origin_m: Vec3::ZERO, direction }), ..Input::default() }
}

#[test]
fn dives_lead_back_one_after_the_other() {
    let settings = MotionSettings { speed: 4.0, ..MotionSettings::default() };
    let mut pilot = over(canyonlands(3), 0);
    pilot.set(&settings);
    let place = |pilot: &Pilot| (pilot.standpoint().place.clone(), pilot.standpoint().position);
    let mut began = Vec::new();
    for octaves in [30.0, 25.0, 40.0] {
        let from = pilot.standpoint().depth;
        began.push((place(&pilot), pilot.standpoint().height, from));
        let ahead = dive(Vec3::new(0.3, -0.4, -1.0));
        for frame in 0.. {
            assert!(frame < 4_000, "stuck at {}", pilot.standpoint().depth);
            if pilot.standpoint().depth - from >= octaves {
                break;
            }
            pilot.advance(1.0 / 60.0, &ahead, 1.0);
        }
        open(&mut pilot, 60);
    }
    assert!(pilot.breadcrumbs(true).count() > 20);
    let nearest = pilot.breadcrumbs(true).next().unwrap().length();
    assert!(nearest < 20.0, "the thread begins {nearest} m away");
    let rise = Input { worn: true, rise: 1.0, ..Input::default() };
    for ((there, at), height, depth) in began.iter().rev() {
        for frame in 0.. {
            assert!(frame < 6_000, "stuck at {}", pilot.standpoint().depth);
            if pilot.standpoint().depth <= *depth {
                break;
            }
            pilot.advance(1.0 / 60.0, &rise, 1.0);
        }
        let (here, position) = place(&pilot);
        let (way, level) = here.way_from(position, (there, *at)).unwrap();
        let unit = (there.level() as f64 - level as f64).exp2();
        let off = way.x.hypot(way.z) * unit / height;
        println!("back at depth {depth:.1}, {off:.2} heights aside");
        assert!(off < 6.0, "{off} heights from where the dive began");
    }
    assert!(pilot.breadcrumbs(true).count() < 12, "taken up again");
}

#[test]
fn over_a_hundred_octaves_of_a_dive_the_ground_goes_by_at_its_rate() {
    let settings = MotionSettings::default();
    let set = settings.speed * LN_2;
    for seed in 0..4 {
        let mut pilot = over(canyonlands(seed), 0);
        let ahead = dive(Vec3::new(0.1, -0.2, -1.0));
        let from = pilot.standpoint().depth;
        let mut probe = Probe::default();
        let mut flows = Vec::new();
        for frame in 0.. {
            assert!(frame < 12_000, "stuck at depth {}", pilot.standpoint().depth);
            if pilot.standpoint().depth - from >= 100.0 {
                break;
            }
            // What the wearer sees of the nearest ground: which way it is, and how deep in the picture.
            let before = pilot.standpoint().stand();
            let nearest = probe.nearest(&before.place, before.place.position, 0.01);
            pilot.advance(DT, &ahead, 1.0);
            let here = pilot.standpoint();
            let (was, to) = ((&before.place, before.place.position), nearest.point - before.place.position);
            let (way, level) = here.place.way_from(here.position, was).unwrap();
            let way = way * (before.place.level() as f64 - level as f64).exp2();
            let now = to - way;
            if frame > 90 {
                flows.push(now.distance(to) / to.length() / DT);
            }
        }
        let (least, most) = flows.iter().fold((f64::MAX, 0.0f64), |(l, m), f| (l.min(*f), m.max(*f)));
        println!("seed {seed}: {:.3} to {:.3} of {set:.3} rad/s in {} frames", least, most, flows.len());
        assert!(most < 1.5 * set && least > set / 1.5, "{least} to {most} rad/s, set {set}");
    }
}
