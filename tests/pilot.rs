//! Moving by hand: the ground is never reached, speed and scale follow the distance to it at every depth, and what was
//! left is come back to.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

use fathomless::address::Address;
use fathomless::course::{Course, Stand};
use fathomless::flight::FlightPose;
use fathomless::heap;
use fathomless::input::{Input, Ray};
use fathomless::pilot::{HIGHEST_LEVEL, MotionSettings, Pilot};
use fathomless::rig::COMFORT_M;
use fathomless::terrain::hash::mix;
use fathomless::terrain::nearest::Probe;
use fathomless::terrain::place::START_LEVEL;
use fathomless::terrain::surface::Corner;
use fathomless::terrain::{Block, Place, Scheme, Spine, Surface, Terrace};
use fathomless::world::World;
use glam::{DVec3, Quat, Vec2, Vec3};
use proptest::prelude::*;
use std::collections::HashMap;
use std::f64::consts::LN_2;

#[global_allocator]
static ALLOCATOR: heap::Counting = heap::Counting;

const DT: f64 = 1.0 / 90.0;

fn canyonlands(seed: u64) -> Surface {
    Surface { seed, scheme: Scheme::Cubic, amplitude: 29_491, terrace: Terrace::new(4, 0.6, 0.2), only: None }
}

/// A plain: every distance is known.
fn plain() -> Surface {
    Surface { seed: 1, scheme: Scheme::Cubic, amplitude: 0, terrace: None, only: None }
}

/// Two cells over the steered dive's target, so many octaves below the start.
fn over(surface: Surface, depth: usize) -> Stand {
    let pose = FlightPose { height: 2.0, pitch: -0.6, ..FlightPose::default() };
    Course::new(surface, depth, 0.0, |_| ()).at(&pose).stand()
}

/// The end of a path of any digits: slopes of dozens.
fn wild(surface: Surface, levels: usize, height: f64) -> Stand {
    let mut spine = Spine::new(surface, 5, 6);
    for i in 0..levels {
        let bits = mix(i as u32 ^ surface.seed as u32);
        spine.push([(bits & 3) as i8 - 1, (bits >> 2 & 3) as i8 - 1]);
    }
    let mut place = Place { spine, position: DVec3::new(0.5, 0.0, 0.5) };
    place.position.y = place.ground(0.5, 0.5) + height;
    let distance = Probe::default().nearest(&place, place.position, 0.01).least;
    Stand { place, height: distance, depth: 0.0, orientation: Quat::IDENTITY }
}

fn at(stand: &Stand) -> Pilot {
    Pilot::at(stand, &MotionSettings::default())
}

/// log2 of the distance to the nearest ground, in tiles of level 0: what an octave is counted in.
fn octave(pilot: &Pilot) -> f64 {
    let here = pilot.standpoint();
    let nearest = Probe::default().nearest(here.place, here.position, 0.002);
    nearest.most.log2() - here.place.level() as f64
}

/// Straight down, whichever way the viewer faces.
fn down() -> Input {
    Input { worn: true, travel: Vec3::NEG_Y, ..Input::default() }
}

fn dive(direction: Vec3) -> Input {
    Input { dive: Some(Ray { origin_m: Vec3::ZERO, direction }), ..Input::default() }
}

fn rise() -> Input {
    Input { rise: 1.0, ..Input::default() }
}

/// So many frames of the same input.
fn fly(pilot: &mut Pilot, frames: usize, input: &Input) {
    for _ in 0..frames {
        pilot.advance(DT, input, 1.0);
    }
}

#[test]
fn straight_at_the_ground_speed_is_octaves_per_second() {
    let settings = MotionSettings { speed: 2.0, inertia_s: 0.0, ..MotionSettings::default() };
    for dt in [0.002, DT, 0.1, 1.0] {
        let mut pilot = Pilot::at(&over(plain(), 10), &settings);
        let before = octave(&pilot);
        for _ in 0..(4.0 / dt) as usize {
            pilot.advance(dt, &down(), 1.0);
        }
        let seconds = (4.0 / dt).floor() * dt;
        let fallen = before - octave(&pilot);
        assert!((fallen - 2.0 * seconds).abs() < 1e-3, "{fallen} octaves in {seconds} s, frames of {dt} s");
    }
}

#[test]
fn sideways_the_ground_goes_by_at_its_rate() {
    let settings = MotionSettings { speed: 1.0, inertia_s: 0.0, ..MotionSettings::default() };
    let mut pilot = Pilot::at(&over(plain(), 10), &settings);
    let aside = Input { worn: true, travel: Vec3::X, ..Input::default() };
    let height = pilot.distance();
    let before = pilot.standpoint().place.clone();
    pilot.advance(0.01, &aside, 1.0);
    let here = pilot.standpoint();
    // The anchor may have followed, by whole tiles.
    let across = here.position.x - before.position.x;
    let moved = (across - across.round()).abs();
    assert!((moved / height - LN_2 * 0.01).abs() < 1e-4, "{moved} tiles at {height}");
    assert!((pilot.flow() - LN_2).abs() < 1e-9);
}

/// Inputs as a child gives them, decided by `salt` and the frame.
fn anything(salt: u32, frame: u32) -> Input {
    let held = frame / 7;
    let one = |k: u32| (mix(salt ^ mix(held * 16 + k)) as f32 / u32::MAX as f32) * 2.0 - 1.0;
    let vector = |k: u32| Vec3::new(one(k), one(k + 1), one(k + 2));
    let kind = mix(salt ^ mix(held * 16 + 15)) % 8;
    Input {
        worn: kind & 1 == 1,
        travel: if kind < 5 { (2.0 * vector(0)).clamp_length_max(1.0) } else { Vec3::ZERO },
        look: 0.2 * Vec2::new(one(3), one(4)),
        turn: Vec2::new(one(5), one(6)),
        roll: if kind == 2 { one(7) } else { 0.0 },
        faster: one(8),
        dive: (kind >= 6).then(|| Ray { origin_m: 0.5 * vector(9), direction: vector(11) }),
        rise: if kind == 5 { one(12).abs() } else { 0.0 },
        level_up: kind == 3,
        ..Input::default()
    }
}

/// The ground is below, and the distance fell by no more than promised.
fn check_clear(pilot: &Pilot, before: f64, speed: f64, dt: f64, what: &str) -> f64 {
    let here = pilot.standpoint();
    assert!(here.position.is_finite(), "{what}");
    let [x, z] = [here.position.x, here.position.z];
    assert!(
        (-0.26..=1.26).contains(&x) && (-0.26..=1.26).contains(&z),
        "{what}: left the anchor: {}",
        here.position
    );
    let ground = here.place.ground(x, z);
    assert!(here.position.y > ground, "{what}: {} under ground", ground - here.position.y);
    let nearest = Probe::default().nearest(here.place, here.position, 0.05);
    let octave = nearest.most.log2() - here.place.level() as f64;
    assert!(nearest.least > 0.0, "{what}: at the ground");
    let allowed = 1.8 * speed * dt + 0.08;
    assert!(
        before - octave <= allowed,
        "{what}: {} octaves nearer in {dt} s at speed {speed}",
        before - octave
    );
    octave
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, ..ProptestConfig::default() })]

    #[test]
    fn nothing_goes_through_the_ground(
        seed in any::<u64>(), salt in any::<u32>(), steep in any::<bool>(), slide in 0.0f64..40.0, inertia_s in 0.0f64..1.0,
    ) {
        let stand = if steep { wild(canyonlands(seed), 150, 1.0) } else { over(canyonlands(seed), 0) };
        let settings = MotionSettings { slide, inertia_s, speed: 4.0, ..MotionSettings::default() };
        let mut pilot = Pilot::at(&stand, &settings);
        let mut before = octave(&pilot);
        for frame in 0..70 {
            let dt = f64::from(mix(salt ^ frame)) / f64::from(u32::MAX);
            let dt = if frame % 3 == 0 { dt } else { 0.05 * dt };
            let was = pilot.settings().speed.max(pilot.speed());
            pilot.advance(dt, &anything(salt, frame), 1.0);
            let speed = was.max(pilot.settings().speed).max(pilot.speed());
            before = check_clear(&pilot, before, speed, dt, &format!("frame {frame}"));
        }
    }

    #[test]
    fn a_drag_stops_before_the_ground_and_a_loop_is_exact(
        seed in any::<u64>(), moves in prop::collection::vec((-0.6f64..0.6, -0.6f64..0.6, -0.6f64..0.6), 1..20),
    ) {
        let mut pilot = at(&over(canyonlands(seed), 3));
        let before = whole(&pilot);
        let mut gone = Vec::new();
        for (x, y, z) in moves {
            let distance = pilot.distance();
            gone.push(pilot.shift(DVec3::new(x, y, z)));
            prop_assert!(pilot.distance() >= 0.43 * distance);
        }
        // Back the same way there is room everywhere, as one was there: but a step may be cut in two.
        for mut back in gone.into_iter().rev().map(|way| -way) {
            for _ in 0..200 {
                back -= pilot.shift(back);
            }
            prop_assert_eq!(back, DVec3::ZERO);
        }
        prop_assert_eq!(whole(&pilot), before);
    }
}

/// The tile the viewer is over and the place in it, to the bit, whichever way he came.
fn whole(pilot: &Pilot) -> (Corner, [u64; 3]) {
    let mut place = pilot.standpoint().place.clone();
    let (dx, dz) = (place.position.x.floor() as i32, place.position.z.floor() as i32);
    let before = place.spine.bottom().block;
    place.spine.walk(dx, dz);
    let block = place.spine.bottom().block;
    let rise = before.rise_to(&block, [dx, dz]) as f64 / 65_536.0;
    let position = place.position - DVec3::new(f64::from(dx), rise, f64::from(dz));
    (block.corner, position.to_array().map(f64::to_bits))
}

#[test]
fn two_thousand_octaves_in_and_out_hit_nothing() {
    let settings = MotionSettings { speed: 5.0, ..MotionSettings::default() };
    let mut pilot = Pilot::at(&over(canyonlands(7), 0), &settings);
    let mut before = octave(&pilot);
    let start = before;
    let mut frames = 0;
    for (sign, input) in [(-1.0, down()), (1.0, rise())] {
        let from = before;
        while sign * (before - from) < 2_000.0 {
            frames += 1;
            assert!(frames < 20_000, "stuck {} octaves from the start", before - start);
            let dt = [0.011, 0.3, 0.05, 1.0][frames % 4];
            // Now and then astray.
            let input =
                if frames % 10 < 2 { Input { faster: 0.0, ..anything(3, frames as u32) } } else { input };
            let speed = pilot.speed().max(5.0);
            pilot.advance(dt, &input, 1.0);
            before = check_clear(&pilot, before, speed, dt, &format!("frame {frames}"));
        }
    }
    let levels = pilot.standpoint().place.level();
    assert!(levels.abs_diff(START_LEVEL) < 20, "{levels}");
}

#[test]
fn the_scale_follows_the_ground_without_steps() {
    // Over the edges of mesas, up and down.
    for seed in 0..4 {
        let settings = MotionSettings { speed: 3.0, ..MotionSettings::default() };
        let mut pilot = Pilot::at(&over(canyonlands(seed), 20), &settings);
        let scale = |pilot: &Pilot| {
            let here = pilot.standpoint();
            here.place.level() as f64 - here.height.log2()
        };
        let (mut last, mut last_rate) = (scale(&pilot), 0.0);
        for frame in 0..1_500u32 {
            let travel = match frame / 150 % 4 {
                0 | 2 => Vec3::new(0.0, 0.0, -1.0),
                1 => Vec3::new(0.6, 0.3, -0.7),
                _ => Vec3::new(0.3, -0.9, -0.3),
            };
            pilot.advance(DT, &Input { worn: true, travel, ..Input::default() }, 1.0);
            let rate = (scale(&pilot) - last) / DT;
            assert!(rate.abs() <= settings.scale_rate, "{rate} octaves per second");
            // 40 octaves per second, per second: from rest to full speed in a tenth of a second.
            assert!(
                (rate - last_rate).abs() / DT < 60.0,
                "frame {frame}: from {last_rate} to {rate} octaves/s"
            );
            (last, last_rate) = (scale(&pilot), rate);
            let here = pilot.standpoint();
            let metres =
                Probe::default().nearest(here.place, here.position, 0.02).most * COMFORT_M / here.height;
            assert!((0.9..4.5).contains(&metres), "frame {frame}: the ground is {metres} m away");
            assert!((0.85..=2.08).contains(&here.height), "{} tiles high", here.height);
            assert!(
                (here.height / here.unit() - 2.0).abs() < 1e-6,
                "{} cells high",
                here.height / here.unit()
            );
        }
        for _ in 0..180 {
            pilot.advance(DT, &Input::default(), 1.0);
        }
        let here = pilot.standpoint();
        let metres = pilot.distance() * COMFORT_M / here.height;
        assert!((1.8..2.05).contains(&metres), "settles at {metres} m");
    }
}

#[test]
fn the_comfortable_distance_is_the_users() {
    let settings = MotionSettings { comfort_m: 5.0, ..MotionSettings::default() };
    let mut pilot = Pilot::at(&over(canyonlands(1), 5), &settings);
    for _ in 0..300 {
        pilot.advance(DT, &Input::default(), 1.0);
    }
    let metres = pilot.distance() * COMFORT_M / pilot.standpoint().height;
    assert!((4.6..5.05).contains(&metres), "{metres}");
}

#[test]
fn in_a_dive_the_ground_goes_by_at_its_rate() {
    let settings = MotionSettings::default();
    let mut pilot = Pilot::at(&over(canyonlands(2), 0), &settings);
    let ahead = dive(Vec3::new(0.1, -0.2, -1.0));
    let set = settings.speed * LN_2;
    let from = pilot.standpoint().depth;
    let mut probe = Probe::default();
    let (mut flows, mut frames) = (Vec::new(), 0);
    while pilot.standpoint().depth - from < 100.0 {
        frames += 1;
        let before = pilot.standpoint().stand();
        let distance = probe.nearest(&before.place, before.place.position, 0.02).most;
        pilot.advance(DT, &ahead, 1.0);
        // How far, seen from the anchor before.
        let here = pilot.standpoint();
        let level = before.place.level().min(here.place.level());
        let (step, now) = here.place.lift(here.position, here.place.level(), level);
        if frames > 90 && step.block.corner == before.place.spine.bottom().block.corner {
            flows.push((now - before.place.position).length() / distance / DT);
        }
        assert!(frames < 12_000, "stuck at depth {}", pilot.standpoint().depth);
    }
    let (least, most) = flows.iter().fold((f64::MAX, 0.0f64), |(l, m), &f| (l.min(f), m.max(f)));
    assert!(flows.len() > 5_000, "{}", flows.len());
    assert!(most / set < 1.5 && least / set > 1.0 / 1.5, "{least} to {most} radians per second, set {set}");
    let seconds = f64::from(frames) * DT;
    assert!((0.85..1.15).contains(&(100.0 / seconds / settings.speed)), "100 octaves took {seconds} s");
}

#[test]
fn a_dive_and_the_way_back_meet_the_same_heights_and_end_where_they_began() {
    let stand = over(canyonlands(3), 0);
    let settings = MotionSettings { speed: 4.0, ..MotionSettings::default() };
    let mut pilot = Pilot::at(&stand, &settings);
    let start = pilot.standpoint().stand();
    let ahead = dive(Vec3::new(0.2, 0.0, -1.0));
    let mut met: HashMap<Corner, Block> = HashMap::new();
    let mut frames = 0;
    while pilot.standpoint().depth < 1_000.0 {
        pilot.advance(1.0 / 30.0, &ahead, 1.0);
        let block = pilot.standpoint().place.spine.bottom().block;
        met.insert(block.corner, block);
        frames += 1;
        assert!(frames < 12_000, "stuck at depth {}", pilot.standpoint().depth);
    }
    let bytes = pilot.standpoint().place.spine.path_bytes();
    assert!(bytes <= 4 * (START_LEVEL + 1_000) + 4_096, "{bytes} bytes");
    let mut again = 0;
    while pilot.standpoint().depth > start.depth {
        pilot.advance(1.0 / 30.0, &rise(), 1.0);
        let block = pilot.standpoint().place.spine.bottom().block;
        if let Some(before) = met.get(&block.corner) {
            assert_eq!(&block, before);
            again += 1;
        }
        frames += 1;
        assert!(frames < 24_000, "stuck at depth {}", pilot.standpoint().depth);
    }
    assert!(again > 3_000, "met only {again} tiles again");
    // In tiles of the level some octaves above both.
    let level = START_LEVEL - 8;
    let [a, b] = [start.standpoint(), pilot.standpoint()].map(|here| {
        let (step, at) = here.place.lift(here.position, here.place.level(), level);
        (step.block.corner, at)
    });
    assert_eq!((a.0.level, b.0.level), (level as u32, level as u32));
    let apart = |a: u32, b: u32| f64::from(b.wrapping_sub(a) as i32);
    let away =
        DVec3::new(apart(a.0.x, b.0.x), 0.0, apart(a.0.z, b.0.z)) + (b.1 - a.1) * DVec3::new(1.0, 0.0, 1.0);
    let away = away.length() * 256.0;
    assert!(away < 3.0 * start.height, "{away} tiles from the start, which was {} high", start.height);
}

#[test]
fn a_dive_goes_where_the_ray_meets_the_ground() {
    for seed in 0..6 {
        let stand = over(canyonlands(seed), 30);
        let mut pilot = at(&stand);
        let ray = Ray { origin_m: Vec3::new(0.2, -0.1, 0.0), direction: Vec3::new(0.3, -0.1, -1.0) };
        let metres = pilot.point_at(&ray, false).expect("there is ground ahead");
        let here = pilot.standpoint();
        let tiles = here.height / COMFORT_M;
        let origin = here.position + (here.orientation * ray.origin_m).as_dvec3() * tiles;
        let target = origin + (here.orientation * ray.direction.normalize()).as_dvec3() * (metres * tiles);
        let ([level, from], corner) = ([here.place.level(), 0], here.place.spine.bottom().block.corner);
        assert_eq!(from, 0);
        let input = Input { dive: Some(ray), ..Input::default() };
        let mut last = here.orientation;
        for frame in 0..900 {
            pilot.advance(DT, &input, 1.0);
            let turned = last.angle_between(pilot.standpoint().orientation);
            assert!(turned < 0.025, "frame {frame}: the view turned by {turned} at once");
            last = pilot.standpoint().orientation;
        }
        // Ten octaves on, it is 1/1000 of the way.
        let here = pilot.standpoint();
        assert!(here.place.level() > level + 5, "only {} levels", here.place.level() - level);
        let (step, at) = here.place.lift(here.position, here.place.level(), level);
        let apart = |a: u32, b: u32| f64::from(b.wrapping_sub(a) as i32);
        let across = [
            at.x + apart(corner.x, step.block.corner.x) - target.x,
            at.z + apart(corner.z, step.block.corner.z) - target.z,
        ];
        let left = across[0].hypot(across[1]);
        let gone = (here.place.level() - level) as f64;
        assert!(
            left < 8.0 * (-gone).exp2() + 0.004 * metres * tiles,
            "{left} tiles off after {gone} octaves"
        );
        // It is what the viewer looks at.
        let off = (here.orientation.inverse() * Vec3::NEG_Y).angle_between(Vec3::NEG_Z);
        assert!(off < 1.2, "looks {off} rad off straight down");
    }
}

#[test]
fn every_dive_arrives() {
    // Grazing rays and steep ones, over gentle ground and among cliffs.
    let (mut tried, mut slowest) = (0, f64::MAX);
    for i in 0..24 {
        let surface = canyonlands(u64::from(i));
        let stand = if i % 3 == 0 { wild(surface, 200, 1.0) } else { over(surface, 15) };
        let mut pilot = at(&stand);
        let one = |k: u32| mix(i * 4 + k) as f32 / u32::MAX as f32;
        let level = pilot.standpoint().orientation.inverse();
        let way =
            Quat::from_rotation_y(6.3 * one(0)) * Quat::from_rotation_x(-1.5 * one(1) * one(2)) * Vec3::NEG_Z;
        let ray = Ray { origin_m: Vec3::ZERO, direction: level * way };
        let Some(metres) = pilot.point_at(&ray, false) else { continue };
        tried += 1;
        let octaves_away = (metres / (pilot.distance() * COMFORT_M / pilot.standpoint().height)).log2();
        let before = octave(&pilot);
        let mut last = [pilot.standpoint().orientation; 2];
        for frame in 0..900 {
            pilot.advance(1.0 / 60.0, &Input { dive: Some(ray), ..Input::default() }, 1.0);
            let here = pilot.standpoint().orientation;
            // Radians per second, and per second of that.
            let turn = |a: Quat, b: Quat| (a * b.inverse()).normalize().to_scaled_axis() * 60.0;
            let (now, then) = (turn(here, last[1]), turn(last[1], last[0]));
            assert!(now.length() < 1.6, "{i}, frame {frame}: the view turns at {} rad/s", now.length());
            let jerk = now.distance(then) * 60.0;
            assert!(jerk < 12.0, "{i}, frame {frame}: from {then} to {now} rad/s");
            last = [last[1], here];
        }
        // A target far away is gone to first: up, and over.
        let fallen = before - octave(&pilot);
        slowest = slowest.min(fallen + 2.0 * octaves_away);
    }
    assert!(tried > 12, "{tried} rays met ground");
    // 22 octaves, straight down.
    assert!(slowest > 15.0, "one came only {slowest} octaves far");
}

#[test]
fn depth_makes_no_difference() {
    let end = |depth: usize| {
        let mut pilot = at(&over(plain(), depth));
        for frame in 0..200 {
            let input = anything(41, frame);
            pilot.advance(DT, &Input { dive: None, ..input }, 1.0);
        }
        let here = pilot.standpoint();
        let depth = here.place.level() - START_LEVEL - depth;
        (depth, here.position.to_array().map(f64::to_bits), here.height.to_bits())
    };
    let [a, b] = [50, 100_000].map(end);
    assert_eq!(a.0, b.0);
}

#[test]
fn let_go_a_dive_stops() {
    let mut pilot = at(&over(canyonlands(5), 12));
    let ahead = dive(Vec3::new(0.0, -0.3, -1.0));
    fly(&mut pilot, 200, &ahead);
    assert!(pilot.speed() > 1.0);
    fly(&mut pilot, 200, &Input::default());
    assert!(pilot.speed() < 1e-3, "{}", pilot.speed());
    // A ray to the sky leads nowhere.
    let depth = pilot.standpoint().depth;
    let up = dive(pilot.standpoint().orientation.inverse() * Vec3::Y);
    fly(&mut pilot, 100, &up);
    assert!((pilot.standpoint().depth - depth).abs() < 0.1);
}

#[test]
fn rising_ends_gently_below_the_root_and_falling_goes_on_from_there() {
    let settings = MotionSettings { speed: 8.0, ..MotionSettings::default() };
    let mut pilot = Pilot::at(&wild(canyonlands(4), 150, 1.0), &settings);
    let mut last = pilot.speed();
    for _ in 0..4_000 {
        pilot.advance(DT, &rise(), 1.0);
        assert!(pilot.speed() > last - 0.6, "from {last} to {} octaves/s", pilot.speed());
        last = pilot.speed();
    }
    let level = pilot.standpoint().place.level();
    assert!((HIGHEST_LEVEL - 1..=HIGHEST_LEVEL + 1).contains(&level), "ended at level {level}");
    assert!(last < 0.2, "still at {last} octaves/s");
    // Down a cliff, at first.
    fly(&mut pilot, 540, &down());
    assert!(pilot.standpoint().place.level() > level + 8);
}

#[test]
fn a_level_course_slides_along_hills() {
    for seed in 0..4 {
        let mut pilot = at(&over(canyonlands(seed), 8));
        let from = octave(&pilot);
        let ahead = Input { worn: true, travel: Vec3::NEG_Z, ..Input::default() };
        let mut way = 0.0;
        for _ in 0..900 {
            let distance = pilot.distance();
            let before = (pilot.standpoint().position, pilot.standpoint().place.spine.bottom().block.corner);
            pilot.advance(DT, &ahead, 1.0);
            let here = pilot.standpoint();
            if here.place.spine.bottom().block.corner == before.1 {
                way += (here.position - before.0).length() / distance;
            }
        }
        // Ten seconds at 1.5 octaves per second are 10 distances.
        assert!(way > 8.0, "came only {way} distances far");
        let sunk = from - octave(&pilot);
        assert!(sunk < 3.0, "sank {sunk} octaves into a hill");
    }
}

#[test]
fn a_renderer_that_needs_time_is_given_it() {
    let mut pilot = at(&over(plain(), 40));
    fly(&mut pilot, 180, &down());
    let full = pilot.speed();
    assert!((full / 1.5 - 1.0).abs() < 0.01, "{full}");
    let mut last = full;
    for _ in 0..90 {
        pilot.advance(DT, &down(), 0.0);
        assert!(last - pilot.speed() < 0.2, "from {last} to {}", pilot.speed());
        last = pilot.speed();
    }
    assert!(last < 0.02, "still at {last}");
    for _ in 0..270 {
        pilot.advance(DT, &down(), 0.5);
    }
    assert!((pilot.speed() / full - 0.5).abs() < 0.02, "{}", pilot.speed());
}

#[test]
fn up_follows_the_ground_of_who_travels() {
    let steep = wild(canyonlands(11), 300, 1.0);
    let upright = MotionSettings { levelling: false, ..MotionSettings::default() };
    let mut pilot = Pilot::at(&steep, &upright);
    let up = |pilot: &Pilot| pilot.standpoint().heading * Vec3::Y;
    assert!(up(&pilot).distance(Vec3::Y) < 1e-3);
    fly(&mut pilot, 100, &rise());
    assert!(up(&pilot).distance(Vec3::Y) < 1e-3, "off is off");
    pilot.set(&MotionSettings::default());
    // He glides to a stop at first.
    fly(&mut pilot, 400, &Input::default());
    let standing = up(&pilot);
    fly(&mut pilot, 100, &Input::default());
    assert!(up(&pilot).distance(standing) < 1e-4, "a viewer who stands still is not turned");
    let rolled = Input { roll: 1.0, ..Input::default() };
    fly(&mut pilot, 20, &rolled);
    let mut last = pilot.standpoint().heading;
    let aside = Input { travel: Vec3::new(0.7, 0.7, 0.0), ..Input::default() };
    let most = 12f32.to_radians() * DT as f32;
    for _ in 0..1_500 {
        pilot.advance(DT, &aside, 1.0);
        let heading = pilot.standpoint().heading;
        assert!(heading.angle_between(last) < most + 2e-3, "{}", heading.angle_between(last));
        last = heading;
    }
    let here = pilot.standpoint();
    let slope = here.place.seen_from_above(here.position, 4).0.block.plane.slope();
    let ground = DVec3::new(-slope[0], 1.0, -slope[1]).normalize().as_vec3();
    assert!(up(&pilot).angle_between(ground) < 0.5, "{} off", up(&pilot).angle_between(ground));
    // The user's own roll is left alone, until he asks.
    let roll = |pilot: &Pilot| {
        let here = pilot.standpoint();
        (here.heading.inverse() * here.orientation * Vec3::X).y.abs()
    };
    assert!(roll(&pilot) > 0.15, "{}", roll(&pilot));
    fly(&mut pilot, 300, &Input { level_up: true, ..Input::default() });
    assert!(roll(&pilot) < 0.01);
    assert!(up(&pilot).angle_between(ground) < 0.5);
}

#[test]
fn the_same_inputs_end_on_the_same_bits() {
    let fly = || {
        let mut pilot = at(&over(canyonlands(9), 2));
        for frame in 0..400 {
            pilot.advance(DT, &anything(77, frame), 1.0);
        }
        let here = pilot.standpoint();
        let numbers = [here.position.x, here.position.y, here.position.z, here.height, here.depth];
        (
            numbers.map(f64::to_bits),
            here.orientation.to_array().map(f32::to_bits),
            here.place.spine.canonical(),
        )
    };
    assert_eq!(fly(), fly());
}

#[test]
fn the_frame_rate_hardly_matters() {
    let end = |hz: usize| {
        let mut pilot = at(&over(canyonlands(9), 2));
        for frame in 0..4 * hz {
            let travel = if frame < 2 * hz { Vec3::new(0.3, -0.3, -0.9) } else { Vec3::new(-0.5, 0.5, 0.0) };
            pilot.advance(1.0 / hz as f64, &Input { travel, ..Input::default() }, 1.0);
        }
        octave(&pilot)
    };
    let (slow, fast) = (end(20), end(200));
    assert!((slow - fast).abs() < 0.25, "{slow} at 20 Hz, {fast} at 200 Hz");
}

#[test]
fn an_address_leads_to_where_the_pilot_is() {
    let world = World::load("canyonlands").unwrap();
    let mut pilot = at(&over(world.surface, 6));
    for frame in 0..300 {
        pilot.advance(DT, &anything(5, frame), 1.0);
    }
    let text = Address::of(&world, &pilot.standpoint()).to_string();
    let address: Address = text.parse().unwrap();
    let mut there = at(&address.stand(&world.surface));
    let (a, b) = (pilot.standpoint(), there.standpoint());
    assert_eq!(a.place.level(), b.place.level());
    assert!((a.height / b.height - 1.0).abs() < 1e-9 && (a.depth - b.depth).abs() < 1e-6);
    assert!(a.orientation.angle_between(b.orientation) < 2e-3);
    assert_eq!(whole(&pilot), whole(&there));
    // And back to it.
    let (start, depth) = (whole(&there), there.standpoint().depth);
    fly(&mut there, 100, &down());
    assert!(there.standpoint().depth > depth + 0.5);
    there.advance(DT, &Input { restart: true, ..Input::default() }, 1.0);
    assert_eq!(whole(&there), start);
}

#[test]
fn moving_allocates_nothing() {
    let mut pilot = at(&over(canyonlands(6), 300));
    let mut fly = |from: u32, to: u32| {
        let before = heap::allocations();
        for frame in from..to {
            // About as deep as before: a path that grows needs room.
            let input = if frame / 20 % 2 == 0 { anything(21, frame) } else { rise() };
            pilot.advance(DT, &Input { faster: 0.0, ..input }, 1.0);
        }
        heap::allocations() - before
    };
    assert!(fly(0, 2_000) > 0, "the buffers grow, and that is counted");
    assert_eq!(fly(2_000, 4_000), 0);
}

#[test]
fn nonsense_is_survived() {
    let mut pilot = at(&over(canyonlands(6), 30));
    let nan = f32::NAN;
    let nonsense = Input {
        aim: Quat::from_xyzw(nan, 0.0, 0.0, 0.0),
        travel: Vec3::splat(f32::INFINITY),
        look: Vec2::new(nan, 1e30),
        turn: Vec2::splat(1e30),
        roll: nan,
        faster: f32::INFINITY,
        dive: Some(Ray { origin_m: Vec3::splat(1e30), direction: Vec3::splat(1e-30) }),
        rise: -5.0,
        ..Input::default()
    };
    for (dt, headroom) in [(f64::NAN, f64::NAN), (-1.0, 5.0), (1e9, -3.0), (0.0, 1.0), (DT, 1.0)] {
        pilot.advance(dt, &nonsense, headroom);
        pilot.advance(
            dt,
            &Input { dive: Some(Ray { origin_m: Vec3::splat(1e30), direction: Vec3::NEG_Y }), ..nonsense },
            headroom,
        );
        let here = pilot.standpoint();
        assert!(
            here.position.is_finite()
                && here.orientation.is_finite()
                && here.height > 0.0
                && here.depth.is_finite()
        );
    }
    // Under the ground, and in the sky.
    for y in [-1e3, 0.0, 1e3, 1e7] {
        let mut stand = over(canyonlands(6), 30);
        stand.place.position.y += y;
        let mut pilot = at(&stand);
        for _ in 0..50 {
            pilot.advance(DT, &rise(), 1.0);
        }
        let here = pilot.standpoint();
        assert!(here.position.y > here.place.ground(here.position.x, here.position.z), "{y}");
    }
}

#[test]
fn a_viewer_at_the_root_can_fall_from_there() {
    for height in [0.3, 1.0, 2.5] {
        let place = Place { position: DVec3::new(0.5, height, 0.5), ..Place::root(canyonlands(8), 3, 4) };
        let mut pilot = at(&Stand { place, height, depth: 0.0, orientation: Quat::IDENTITY });
        fly(&mut pilot, 200, &rise());
        assert!(pilot.standpoint().place.level() < 8, "rose {} levels", pilot.standpoint().place.level());
        fly(&mut pilot, 900, &down());
        let here = pilot.standpoint();
        assert!(here.place.level() > 4, "fell only to level {}", here.place.level());
        assert!(here.position.y > here.place.ground(here.position.x, here.position.z));
    }
}
