//! What spares the stomach: the view narrows with motion and opens without it, jumps happen in the dark and nowhere else,
//! a wearer who wants nothing comes to rest and stays so, and one who has the headset off moves nothing.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

mod life;

use std::f32::consts::TAU;
use std::time::{Duration, Instant};

use fathomless::aids::{Aids, Vignette};
use fathomless::comfort::{Comfort, ComfortSettings, GridWhen, Senses};
use fathomless::course::{Course, Stand};
use fathomless::flight::{Flight, FlightPose};
use fathomless::flying::{Flying, Headset};
use fathomless::input::{Input, Leap, Ray};
use fathomless::mock::{Act, Calls, Fov, Mask, Mock, MockConfig, SubmittedFrame, SubmittedView};
use fathomless::pilot::{MotionSettings, Pilot};
use fathomless::settings::Settings;
use fathomless::supervisor::{Stage, Venue, outcome_of};
use fathomless::viewer::{Step, Viewer, ViewerConfig};
use fathomless::world::World;
use fathomless::xr::Outcome;
use glam::{Quat, Vec2, Vec3};
use life::{assert_clean, headset, least};
use openxr::sys;
use proptest::prelude::*;

/// Radians to the corner of the picture.
const WIDEST: f32 = 0.9;

fn senses(flow: f64) -> Senses {
    Senses { flow: Some(flow), widest: Some(WIDEST), ..Senses::default() }
}

fn aids(comfort: &Comfort) -> Aids {
    let mut aids = Aids::default();
    comfort.fill(&mut aids);
    aids
}

/// A view that darkens nowhere.
const OPEN: f32 = f32::INFINITY;

/// How far it is from the middle of the view to where it darkens.
fn aperture(comfort: &Comfort) -> f32 {
    aids(comfort).vignette.map_or(OPEN, |vignette| vignette.inner)
}

fn seconds(s: f32) -> Duration {
    Duration::from_secs_f32(s)
}

/// Frames of any length, with any motion in them.
fn frames() -> impl Strategy<Value = Vec<(f32, f64)>> {
    prop::collection::vec((0.0f32..0.3, prop_oneof![Just(0.0), 0.0f64..3.0, Just(f64::NAN)]), 1..200)
}

/// Any settings that can be written, and some that cannot.
fn settings() -> impl Strategy<Value = ComfortSettings> {
    let numbers = prop::array::uniform8(prop_oneof![4 => -10.0f32..400.0, 1 => Just(f32::NAN)]);
    (numbers, 0.0f32..1.0, 0.0f32..3.0, 0.0f32..3.0).prop_map(|(n, strength, close_s, open_s)| {
        ComfortSettings {
            vignette_inner: n[0],
            vignette_outer: n[1],
            flow_from: n[2],
            flow_full: n[3],
            turn_from: n[4],
            turn_full: n[5],
            vignette_strength: strength,
            close_s,
            open_s,
            grid: GridWhen::Moving,
            ..ComfortSettings::default()
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Whatever is set and however one is moved, the circle lies between the narrow and the open view, and darkens
    /// outwards; and once the motion ends it is open in the time that is set.
    #[test]
    fn the_view_narrows_in_its_bounds_and_opens_in_its_time(settings in settings(), frames in frames()) {
        let mut comfort = Comfort::new(settings);
        let inner = if settings.vignette_inner.is_nan() { 5.0 } else { settings.vignette_inner.clamp(5.0, 80.0) };
        let inner = inner.to_radians();
        for (dt, flow) in frames {
            comfort.advance(seconds(dt), &senses(flow));
            let Aids { vignette, grid, fade, .. } = aids(&comfort);
            if let Some(Vignette { inner: now, outer, strength }) = vignette {
                prop_assert!(now >= inner - 1e-5 && now <= WIDEST.max(inner) + 1e-5, "{} of {}", now, inner);
                prop_assert!(outer > now && (0.0..=1.0).contains(&strength));
            }
            prop_assert!((0.0..=1.0).contains(&grid) && (0.0..=1.0).contains(&fade));
        }
        let dt = 1.0 / 72.0;
        for _ in 0..(settings.open_s / dt).ceil() as usize + 1 {
            let before = aperture(&comfort);
            comfort.advance(seconds(dt), &senses(0.0));
            prop_assert!(aperture(&comfort) >= before - 1e-6, "it only opens");
        }
        prop_assert_eq!(aids(&comfort).vignette, None);
        prop_assert_eq!(aids(&comfort).grid, 0.0);
    }

    /// Who is moved faster sees no more, frame for frame.
    #[test]
    fn the_faster_the_narrower(settings in settings(), frames in frames(), factor in 1.0f64..4.0) {
        let [mut slow, mut fast] = [Comfort::new(settings), Comfort::new(settings)];
        for (dt, flow) in frames {
            slow.advance(seconds(dt), &senses(flow));
            fast.advance(seconds(dt), &senses(flow * factor));
            prop_assert!(aperture(&fast) <= aperture(&slow) + 1e-5);
        }
    }

    /// A jump happens when it is black, the picture is black that first shows what is there then, and afterwards it
    /// comes back; at any frame rate, with any times.
    #[test]
    fn jumps_happen_in_the_dark(
        [out_s, in_s] in prop::array::uniform2(0.0f32..2.0),
        dts in prop::collection::vec(0.001f32..0.3, 1..400),
        wanted_at in 0usize..20,
    ) {
        let mut comfort = Comfort::new(ComfortSettings {
            fade_out_s: out_s,
            fade_in_s: in_s,
            ..ComfortSettings::default()
        });
        let mut wants = false;
        let mut jumped_after = None;
        let all = dts.iter().copied().chain(std::iter::repeat_n(0.02, 300));
        for (frame, dt) in all.enumerate() {
            wants |= frame == wanted_at;
            let jumps = wants && comfort.may_jump();
            if jumps {
                wants = false;
                jumped_after = Some(frame - wanted_at);
            }
            comfort.advance(seconds(dt), &senses(0.0));
            let fade = aids(&comfort).fade;
            prop_assert!(!jumps || frame == 0 || fade == 1.0, "frame {}: {}", frame, fade);
        }
        prop_assert!(jumped_after.is_some(), "it is never dark");
        prop_assert_eq!(aids(&comfort).fade, 0.0);
    }
}

#[test]
fn the_built_in_settings_are_the_manuals() {
    assert_eq!(Settings::default().comfort, ComfortSettings::default());
    assert!(!Settings::default().mirror.vignette);
}

/// After so many seconds of a motion.
fn after(settings: ComfortSettings, s: f32, senses: impl Fn(usize) -> Senses) -> Comfort {
    let mut comfort = Comfort::new(settings);
    for frame in 0..(90.0 * s) as usize {
        comfort.advance(seconds(1.0 / 90.0), &senses(frame));
    }
    comfort
}

#[test]
fn what_counts_is_being_moved_by_something_else_than_oneself() {
    let usual = ComfortSettings::default();
    let narrow = usual.vignette_inner.to_radians();
    let turned = |degrees_per_s: f32| {
        move |frame: usize| Senses {
            heading: Quat::from_rotation_y((degrees_per_s * frame as f32 / 90.0).to_radians()),
            ..senses(0.0)
        }
    };
    let of = |senses: &dyn Fn(usize) -> Senses| aperture(&after(usual, 2.0, senses));
    assert_eq!(of(&|_| senses(0.0)), OPEN, "nothing moves");
    assert_eq!(of(&|_| senses(9f64.to_radians())), OPEN, "slower than is seen to matter");
    assert!((of(&|_| senses(60f64.to_radians())) - narrow).abs() < 1e-5, "full speed");
    assert!((of(&turned(90.0)) - narrow).abs() < 1e-5, "a smooth turn");
    // A fall that nobody steers: half an octave a second is 20 degrees a second.
    let falls = |octaves: f64| {
        move |frame: usize| Senses { flow: None, depth: octaves * frame as f64 / 90.0, ..senses(0.0) }
    };
    let fall = of(&falls(0.5));
    assert!(fall < WIDEST - 0.05 && fall > narrow + 0.05, "{fall}");
    assert_eq!(fall, of(&falls(-0.5)));

    // A step of a turn, now and then, is over before it is seen.
    let steps = |frame: usize| Senses {
        heading: Quat::from_rotation_y((30 * (frame / 30)) as f32 / 360.0 * TAU),
        ..senses(0.0)
    };
    assert_eq!(of(&steps), OPEN);
    // One's own hands know what they do.
    let by_hand = |frame: usize| Senses { by_hand: true, ..turned(90.0)(frame) };
    let held = of(&by_hand);
    assert!(held > narrow + 0.1 && held < WIDEST, "{held}");
    let never = ComfortSettings { by_hand: 0.0, ..usual };
    assert_eq!(aperture(&after(never, 2.0, by_hand)), OPEN);
}

/// A heading that is no round number, at rates at which small errors of angles count.
#[test]
fn rest_is_rest_at_any_frame_rate() {
    let heading = Quat::from_euler(glam::EulerRot::YXZ, 1.234, 0.345, -0.456);
    let rests = Senses { heading, ..senses(0.0) };
    for hz in [60.0, 144.0, 1000.0] {
        let mut comfort = Comfort::new(ComfortSettings { turn_from: 0.1, ..ComfortSettings::default() });
        for _ in 0..100 {
            comfort.advance(seconds(1.0 / hz), &rests);
            assert_eq!(aids(&comfort).vignette, None, "{hz} Hz");
        }
    }
}

#[test]
fn what_is_off_is_off_in_one_step_and_nobody_at_a_window_sees_any_of_it() {
    let fast = |_| senses(2.0);
    let mut comfort = after(ComfortSettings::default(), 2.0, fast);
    assert!(aids(&comfort).vignette.is_some());
    comfort.settings.vignette = false;
    assert_eq!(aids(&comfort).vignette, None);
    for (grid, moving, still) in
        [(GridWhen::Off, 0.0, 0.0), (GridWhen::Moving, 0.5, 0.0), (GridWhen::Always, 0.5, 0.5)]
    {
        let settings = ComfortSettings { grid, ..ComfortSettings::default() };
        assert_eq!(aids(&after(settings, 2.0, fast)).grid, moving, "{grid:?}");
        assert_eq!(aids(&after(settings, 2.0, |_| senses(0.0))).grid, still, "{grid:?}");
    }
    let floor = |floor_m| {
        aids(&after(ComfortSettings::default(), 0.1, |_| Senses { floor_m, ..senses(0.0) })).floor_m
    };
    assert_eq!((floor(Some(1.7)), floor(None)), (1.7, 1.2));

    comfort.settings = ComfortSettings { grid: GridWhen::Always, ..ComfortSettings::default() };
    comfort.rest();
    let nothing = Aids { floor_m: aids(&comfort).floor_m, ..Aids::default() };
    assert_eq!(aids(&comfort), nothing);
    assert!(comfort.may_jump());
}

#[test]
fn the_picture_is_black_while_nothing_is_known_of_the_wearer() {
    let lost = Senses { tracked: false, ..senses(0.0) };
    let frame = seconds(1.0 / 90.0);
    let mut comfort = after(ComfortSettings::default(), 1.0, |_| senses(0.0));
    // A flicker is nothing.
    for _ in 0..8 {
        comfort.advance(frame, &lost);
        assert_eq!(aids(&comfort).fade, 0.0);
    }
    comfort.advance(frame, &senses(0.0));
    let dark_after = |comfort: &mut Comfort, senses: &Senses| {
        (0..90)
            .take_while(|_| {
                comfort.advance(frame, senses);
                aids(comfort).fade < 1.0
            })
            .count()
    };
    assert!((20..30).contains(&dark_after(&mut comfort, &lost)), "a tenth of a second, and the fade");
    let light_after = |comfort: &mut Comfort| {
        (0..90)
            .take_while(|_| {
                comfort.advance(frame, &senses(0.0));
                aids(comfort).fade > 0.0
            })
            .count()
    };
    assert!((30..40).contains(&light_after(&mut comfort)));
    // The headset is taken off, and put on.
    let off = Senses { seen: false, ..senses(0.0) };
    assert!((12..16).contains(&dark_after(&mut comfort, &off)));
    assert!((30..40).contains(&light_after(&mut comfort)));
    // A jump of nobody's wish, hidden by the picture itself.
    comfort.advance(frame, &Senses { jolted: true, ..senses(0.0) });
    let fade = aids(&comfort).fade;
    assert!(fade > 0.9, "{fade}");
    assert!((30..40).contains(&light_after(&mut comfort)));
    // None of it where it is not wanted.
    comfort.settings.fades = false;
    comfort.advance(frame, &Senses { jolted: true, seen: false, ..lost });
    let Aids { fade, blinks, .. } = aids(&comfort);
    assert_eq!((fade, blinks), (0.0, false));
    assert!(comfort.may_jump());
}

fn leap(go: bool) -> Leap {
    let from = Ray { origin_m: Vec3::ZERO, direction: Vec3::NEG_Z };
    Leap { from, reach_m: 5.0, steepest: 1.0, head_m: Vec3::ZERO, go }
}

#[test]
fn a_wish_to_be_elsewhere_waits_for_the_dark_and_comes_once() {
    let frame = seconds(1.0 / 90.0);
    for wish in [
        Input { worn: true, restart: true, ..Input::default() },
        Input { worn: true, level_up: true, ..Input::default() },
        Input { worn: true, recentre: true, ..Input::default() },
        Input { worn: true, leap: Some(leap(true)), ..Input::default() },
    ] {
        let mut comfort = after(ComfortSettings::default(), 1.0, |_| senses(0.0));
        let flies = Input { worn: true, travel: Vec3::NEG_Z, ..Input::default() };
        let mut came = Vec::new();
        for i in 0..200 {
            let asked = if i == 3 { flies.with(&wish) } else { flies };
            let dark = aids(&comfort).fade == 1.0;
            let held = comfort.hold(&asked, true);
            if held == (Input { travel: flies.travel, ..wish }) {
                assert!(dark);
                came.push(i);
            } else {
                assert_eq!(held, flies, "all else goes on");
            }
            comfort.advance(frame, &senses(0.0));
        }
        assert_eq!(came.len(), 1, "{came:?}");
        assert!((12..24).contains(&came[0]), "{came:?}");
        assert_eq!(aids(&comfort).fade, 0.0);
    }
    // Where a step would lead is shown meanwhile.
    let mut comfort = after(ComfortSettings::default(), 1.0, |_| senses(0.0));
    let shows = Input { worn: true, leap: Some(leap(false)), ..Input::default() };
    assert_eq!(comfort.hold(&shows, true), shows);
    assert_eq!(aids(&comfort).fade, 0.0);

    // Who has the headset off moves nothing, but may well be somewhere else when he is back.
    let mut comfort = after(ComfortSettings::default(), 1.0, |_| Senses { seen: false, ..senses(0.0) });
    let all = Input {
        worn: true,
        travel: Vec3::ONE,
        rise: 1.0,
        restart: true,
        look: Vec2::ONE,
        ..Input::default()
    };
    let held = comfort.hold(&all, false);
    assert_eq!(held, Input { worn: true, restart: true, ..Input::default() });
}

fn over_hills() -> Stand {
    let world = World::load("hills").unwrap();
    let pose = FlightPose { height: 2.0, pitch: -0.6, ..FlightPose::default() };
    Course::new(world.surface, 8, 0.0, |_| ()).at(&pose).stand()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// However a wearer has flown, once he wants nothing every rate only falls: no speed, no turn, no scale grows; and
    /// within a second all is at rest and stays so.
    #[test]
    fn a_wearer_who_wants_nothing_comes_to_rest_and_stays_so(
        wishes in prop::collection::vec(
            (prop::array::uniform3(-1.0f32..1.0), prop::array::uniform2(-1.0f32..1.0), 0.0f32..1.0, 1usize..60),
            1..6,
        ),
        hz in prop_oneof![Just(36.0), Just(72.0), Just(120.0)],
    ) {
        let dt = 1.0 / hz;
        let motion = ComfortSettings::default().motion(&MotionSettings::default());
        let mut pilot = Pilot::at(&over_hills(), &motion);
        for (travel, turn, rise, frames) in wishes {
            let input = Input {
                worn: true,
                travel: Vec3::from_array(travel),
                turn: Vec2::from_array(turn),
                rise: if rise > 0.7 { rise } else { 0.0 },
                ..Input::default()
            };
            for _ in 0..frames {
                pilot.advance(dt, &input, 1.0);
            }
        }
        let nothing = Input { worn: true, ..Input::default() };
        let mut speed = pilot.speed();
        let mut before = (pilot.standpoint().heading, pilot.standpoint().depth);
        let mut turning = f32::INFINITY;
        for frame in 0..(2.0 * hz) as usize {
            pilot.advance(dt, &nothing, 1.0);
            let here = pilot.standpoint();
            let (now, turned) = (pilot.speed(), here.heading.angle_between(before.0));
            prop_assert!(now <= speed * (1.0 + 1e-9), "frame {}: {} after {}", frame, now, speed);
            // f32 knows angles to 1/2000 only.
            prop_assert!(turned <= turning + 1e-3, "frame {}: {} after {}", frame, turned, turning);
            if frame as f64 > hz {
                prop_assert!(now < 1e-6 && turned < 1e-3, "frame {}: {} octaves/s, {}", frame, now, turned);
                let scaled = (here.depth - before.1).abs() * hz;
                prop_assert!(scaled < 1e-4, "frame {}: {} octaves/s of scale", frame, scaled);
            }
            (speed, turning, before) = (now, turned, (here.heading, here.depth));
        }
    }
}

/// The command's own flight on a headset of its own, with somebody in it.
struct Ride {
    flying: Flying<'static>,
    viewer: Viewer,
    mock: Mock,
    /// A stick, held.
    input: Input,
}

const SIZE: [u32; 2] = [40, 40];

/// As many frames as there are in a time within which everything comes that is waited for.
fn soon() -> impl Iterator<Item = ()> {
    let until = Instant::now() + Duration::from_secs(120);
    std::iter::repeat(()).take_while(move |()| Instant::now() < until)
}

impl Ride {
    fn new(change: impl FnOnce(&mut Flying<'static>)) -> Ride {
        let fov = Fov { left: -0.9, right: 0.7, up: 0.8, down: -0.8 };
        let mock = Mock::new(MockConfig {
            eye_size: SIZE,
            fov: [fov, fov.mirrored()],
            mask: Mask::Empty,
            read_back: true,
            ..headset()
        });
        let world = World::load("hills").unwrap();
        let flight: &'static Flight = Box::leak(Box::new(Flight::load("still").unwrap()));
        let course = Course::new(world.surface, 3, 1.0, |_| ());
        let config = ViewerConfig { validate: true, ..least() };
        let mut flying = Flying::new(&world, flight, course, config, Headset::Mock(mock.clone()));
        flying.helm.motion = flying.comfort.settings.motion(&MotionSettings::default());
        change(&mut flying);
        let viewer = flying.open(Venue::Headset).unwrap();
        Ride { flying, viewer, mock, input: Input { worn: true, ..Input::default() } }
    }

    /// A frame, and what was submitted where it has a picture.
    fn frame(&mut self, once: Input) -> Option<SubmittedFrame> {
        let dt = self.flying.helm.begin_frame();
        let input = self.input.with(&once);
        self.flying.steer(&mut self.viewer, &input, Duration::ZERO, dt);
        let step = self.viewer.frame(&self.flying.standpoint(Duration::ZERO), true).unwrap();
        self.mock.take_last_frame().filter(|_| step == Step::Drew)
    }

    /// A frame without a picture, for whatever reason.
    fn miss(&mut self) {
        let dt = self.flying.helm.begin_frame();
        self.flying.steer(&mut self.viewer, &self.input, Duration::ZERO, dt);
        match self.viewer.frame(&self.flying.standpoint(Duration::ZERO), true) {
            Ok(step) => assert_eq!(step, Step::Skipped),
            Err(error) => assert_eq!(outcome_of(&error), Outcome::SkipFrame),
        }
    }

    /// Frames until one is as it should be.
    fn until(&mut self, what: &str, so: impl Fn(&SubmittedFrame) -> bool) -> SubmittedFrame {
        for () in soon() {
            if let Some(frame) = self.frame(Input::default()).filter(|frame| so(frame)) {
                return frame;
            }
        }
        panic!("{what}: it never comes");
    }

    fn place(&mut self) -> (usize, glam::DVec3) {
        let here = self.flying.standpoint(Duration::ZERO);
        (here.place.level(), here.position)
    }

    fn close(self) {
        let Ride { flying, viewer, mock, .. } = self;
        assert_eq!(viewer.close().unwrap(), fathomless::viewer::Remarks::default());
        drop(flying);
        assert_clean(&mock, "at the end");
    }
}

/// The brightest of a view's pixels so many radians around straight ahead.
fn brightest(view: &SubmittedView, angles: std::ops::Range<f32>) -> u8 {
    let [left, right, up, down] = [view.fov.left, view.fov.right, view.fov.up, view.fov.down].map(f32::tan);
    let [width, height] = view.size;
    let all = (0..width * height).filter_map(|i| {
        let (x, y) = (i % width, i / width);
        let across = left + (right - left) * (x as f32 + 0.5) / width as f32;
        let upwards = up + (down - up) * (y as f32 + 0.5) / height as f32;
        let angle = across.hypot(upwards).atan();
        angles.contains(&angle).then(|| view.pixel(x, y).unwrap()[..3].iter().copied().max().unwrap())
    });
    all.max().expect("there are such pixels")
}

fn is_black(frame: &SubmittedFrame) -> bool {
    frame.views.iter().all(|view| brightest(view, 0.0..2.0) == 0)
}

fn is_open(frame: &SubmittedFrame) -> bool {
    frame.views.iter().all(|view| brightest(view, 0.8..2.0) > 20 && brightest(view, 0.0..0.3) > 20)
}

/// Dark from where the settings say, for both eyes alike, and bright in the middle.
fn is_narrow(frame: &SubmittedFrame) -> bool {
    let usual = ComfortSettings::default();
    let [inner, outer] = [usual.vignette_inner, usual.vignette_outer].map(f32::to_radians);
    let narrow =
        |view: &SubmittedView| brightest(view, outer + 0.01..2.0) == 0 && brightest(view, 0.0..inner) > 20;
    frame.views.iter().all(narrow)
}

#[test]
fn a_flight_begins_in_the_dark_is_narrow_while_it_lasts_and_opens_after_it() {
    let mut flight = Ride::new(|_| ());
    let first = flight.until("the first picture", |_| true);
    assert!(is_black(&first));
    flight.until("fading in", |frame| !is_black(frame) && !is_open(frame));
    flight.until("open", is_open);
    flight.input.rise = 1.0;
    flight.until("narrow while backing out", is_narrow);
    flight.input.rise = 0.0;
    flight.until("open again", is_open);
    flight.input.turn.x = 1.0;
    flight.until("narrow while turning", is_narrow);
    // Off in one step.
    flight.flying.comfort.settings.vignette = false;
    assert!(is_open(&flight.until("off", |_| true)));
    flight.input.turn.x = 0.0;
    flight.close();
}

#[test]
fn the_start_is_come_back_to_in_the_dark() {
    let mut flight = Ride::new(|flying| flying.comfort.settings.vignette = false);
    flight.until("open", is_open);
    let depth = |flight: &mut Ride| flight.flying.standpoint(Duration::ZERO).depth;
    let start = depth(&mut flight);
    flight.input.rise = 1.0;
    flight.until("on the way", |_| true);
    for () in soon() {
        flight.frame(Input::default());
        if depth(&mut flight) < start - 0.5 {
            break;
        }
    }
    flight.input.rise = 0.0;
    for () in soon() {
        flight.frame(Input::default());
        if flight.flying.helm.pilot().unwrap().speed() == 0.0 {
            break;
        }
    }
    // From here on nothing moves but the jump.
    let away = flight.place();
    let mut once = Input { restart: true, ..Input::default() };
    let mut jumps = 0;
    for () in soon() {
        let before = flight.place();
        let frame = flight.frame(std::mem::take(&mut once)).expect("every frame is drawn");
        if flight.place() != before {
            assert!(is_black(&frame), "the picture that first shows the start");
            jumps += 1;
        } else if jumps > 0 && is_open(&frame) {
            break;
        }
    }
    assert_eq!(jumps, 1, "from {away:?} to the start at once");
    // A person's depth is that of the ground at the comfortable distance; a flight has its own height.
    assert!((depth(&mut flight) - start).abs() < 0.2, "{} for {start}", depth(&mut flight));
    flight.close();
}

#[test]
fn recentring_and_a_head_that_is_lost_are_seen_in_the_dark() {
    let mut flight = Ride::new(|_| ());
    flight.until("open", is_open);
    let mock = flight.mock.clone();
    mock.recentre(fathomless::mock::Pose::at(0.3, 0.0, 0.2));
    flight.until("black for the other origin", is_black);
    flight.until("open again", is_open);
    mock.set_tracking(Some(fathomless::mock::Tracking::LOST));
    flight.until("black while lost", is_black);
    for _ in 0..5 {
        assert!(is_black(&flight.frame(Input::default()).unwrap()), "for as long as that");
    }
    mock.set_tracking(None);
    flight.until("found", is_open);
    flight.close();
}

#[test]
fn a_picture_that_is_missing_is_no_reason_for_the_dark_but_a_quarter_of_a_second_without_is() {
    let mut flight = Ride::new(|_| ());
    flight.until("open", is_open);
    let mock = flight.mock.clone();
    let answers = |function: &str, calls, code| mock.on_call(function, calls, code).unwrap();
    let next = || Calls::Nth(mock.calls("xrEndFrame") + 1);
    let misses: [(&str, &dyn Fn()); 3] = [
        ("none is wanted", &|| mock.set_should_render(Some(false))),
        ("the images are late", &|| {
            answers("xrWaitSwapchainImage", Calls::All, sys::Result::TIMEOUT_EXPIRED)
        }),
        ("the frame is refused", &|| answers("xrEndFrame", next(), sys::Result::ERROR_LAYER_INVALID)),
    ];
    for (why, begins) in misses {
        begins();
        flight.miss();
        mock.clear_hooks();
        mock.set_should_render(None);
        for _ in 0..5 {
            assert!(is_open(&flight.frame(Input::default()).unwrap()), "{why}");
        }
    }
    // At 90 Hz.
    for (frames, is_long) in [(20, false), (24, true)] {
        mock.set_should_render(Some(false));
        (0..frames).for_each(|_| flight.miss());
        mock.set_should_render(None);
        let first = flight.frame(Input::default()).unwrap();
        assert_eq!(
            (is_black(&first), is_open(&first)),
            (is_long, !is_long),
            "{frames} frames without a picture"
        );
    }
    flight.until("open again", is_open);
    // What has become of his place meanwhile is not forgotten.
    mock.set_should_render(Some(false));
    mock.recentre(fathomless::mock::Pose::at(0.3, 0.0, 0.2));
    (0..3).for_each(|_| flight.miss());
    mock.set_should_render(None);
    assert!(is_black(&flight.frame(Input::default()).unwrap()), "the origin has moved");
    flight.until("open at last", is_open);
    flight.close();
}

/// Why nobody sees the pictures, how that begins, and how it ends.
type Off = (&'static str, fn(&Mock), fn(&Mock));

#[test]
fn a_headset_that_is_off_stops_everything_until_it_is_on() {
    let mut flight = Ride::new(|_| ());
    flight.until("open", is_open);
    flight.input.rise = 1.0;
    flight.until("flying", is_narrow);
    let mock = flight.mock.clone();
    let offs: [Off; 2] = [
        ("off", |mock| mock.perform(Act::UserPresent(false)), |mock| mock.perform(Act::UserPresent(true))),
        ("hidden", |mock| mock.hide(), |mock| mock.gain_focus()),
    ];
    for (why, off, on) in offs {
        off(&mock);
        for () in soon() {
            flight.frame(Input::default());
            if flight.flying.helm.pilot().unwrap().speed() < 1e-9 {
                break;
            }
        }
        assert!(!flight.viewer.is_seen(), "{why}");
        assert_eq!(flight.flying.speed(&flight.viewer), 0.0, "{why}: the flight's clock stands still");
        let resting = flight.flying.helm.pilot().unwrap().speed();
        assert!(resting < 1e-9, "{why}: {resting} octaves a second, with the stick held");
        on(&mock);
        let first = flight.until("a picture", |_| true);
        assert!(is_black(&first), "{why}: it comes back from the dark");
        flight.until("narrow again, with the stick held", is_narrow);
        assert!(flight.viewer.is_seen() && flight.flying.speed(&flight.viewer) > 0.0);
    }
    flight.close();
}
