//! Every controller flies: its bindings are inputs that it has, and what a hand does on a headset takes the viewer there.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests stop at the first surprise")]

mod life;
mod wearer;

use fathomless::bindings::{self, Action, HANDS, ProfileBindings};
use fathomless::controllers::{Controllers, Hand, Hands};
use fathomless::course::Course;
use fathomless::flight::FlightPose;
use fathomless::input::Input;
use fathomless::mock::{Calls, Mock, Tracking};
use fathomless::rig::Pose;
use fathomless::viewer::{Step, Viewer, ViewerConfig};
use fathomless::world::World;
use glam::{Quat, Vec2, Vec3};
use life::{documented, headset, least};
use wearer::{FRAME, SETTLED, Wearer, built_in, paths};

/// A head on the seat that looks ahead.
const AHEAD: Pose = Pose { position: Vec3::ZERO, orientation: Quat::IDENTITY };

#[test]
fn every_profile_flies_and_every_path_of_it_does_what_the_file_says() {
    // The other way round, one profile whose hands differ will do.
    let mirrored = built_in(true).into_iter().filter(|it| it.profile.ends_with("/touch_controller"));
    let all = built_in(false).into_iter().map(|it| (it, false)).chain(mirrored.map(|it| (it, true)));
    for (profile, left_handed) in all {
        let (name, profile) = (profile.profile, &profile);
        let mut wearer = Wearer::new(headset(), left_handed);
        wearer.takes(name);
        wearer.fly(SETTLED);
        assert_eq!(wearer.viewer.interaction_profiles(), [Some(name); 2], "{name}");
        assert!(wearer.viewer.hands().hands.iter().all(|hand| hand.aim.is_some()), "{name}");
        assert_eq!(wearer.fly(1), Input { worn: true, aim: wearer.fly(1).aim, ..Input::default() });

        let start = wearer.pilot.standpoint().depth;
        let [(dive, dives_by), (rise, rises_by)] =
            [Action::Dive, Action::Rise].map(|action| paths(profile, action));
        for path in &dive {
            let before = wearer.pilot.standpoint().depth;
            wearer.set(&[path], dives_by, 1.0);
            assert!(wearer.fly(60).dive.is_some(), "{path} does not dive");
            wearer.set(&[path], dives_by, 0.0);
            assert!(wearer.fly(3).dive.is_none(), "{path} dives when it is let go");
            assert!(wearer.pilot.standpoint().depth > before + 0.3, "{path} leads nowhere");
        }
        assert!(!dive.is_empty() && !rise.is_empty(), "{name}");
        let deep = wearer.pilot.standpoint().depth;
        assert!(deep > start + 1.0, "{name}");
        for path in &rise {
            let before = wearer.pilot.standpoint().depth;
            wearer.set(&[path], rises_by, 1.0);
            assert_eq!(wearer.fly(40).rise, 1.0, "{path} does not lead back");
            wearer.set(&[path], rises_by, 0.0);
            assert_eq!(wearer.fly(3).rise, 0.0, "{path}");
            assert!(wearer.pilot.standpoint().depth < before - 0.3, "{path} leads nowhere");
        }
        let (travel, kind) = paths(profile, Action::Travel);
        for path in travel {
            let before = wearer.pilot.standpoint();
            let before = (before.place.level(), before.position);
            wearer.set(&[path], kind, 1.0);
            assert_eq!(wearer.fly(10).travel, Vec3::NEG_Z, "{path}");
            wearer.set(&[path], kind, 0.0);
            wearer.fly(2);
            let after = wearer.pilot.standpoint();
            assert_ne!((after.place.level(), after.position), before, "{path} leads nowhere");
        }
        // A stick turns the view once by a step, each time.
        for path in paths(profile, Action::Turn).0 {
            let step = wearer.controllers.settings.snap_turn.to_radians();
            let (before, mut turned) = (wearer.pilot.standpoint().heading, 0.0);
            for (x, frames) in [(1.0, 6), (0.0, 4), (1.0, 6), (0.0, 4)] {
                wearer.mock.set_input(path, [x, 0.0]).unwrap();
                turned += (0..frames).map(|_| wearer.fly(1).look.x).sum::<f32>();
            }
            assert!(step > 0.2 && (turned - 2.0 * step).abs() < 1e-5, "{path} turns by {turned}");
            let off = wearer.pilot.standpoint().heading.angle_between(before);
            assert!((off - 2.0 * step).abs() < 1e-3, "{path}: the view has turned by {off}");
        }
        // Each octave on the way was felt, where there is something to feel it with.
        let (pulse, _) = paths(profile, Action::Pulse);
        let felt = wearer.mock.haptics().iter().any(|haptic| !haptic.outputs.is_empty());
        assert_eq!(felt, !pulse.is_empty(), "{name}");
        wearer.ends();
    }
}

#[test]
fn controllers_that_go_and_a_focus_that_goes_let_go_of_everything() {
    let mut wearer = Wearer::new(headset(), false);
    let touch = "/interaction_profiles/oculus/touch_controller";
    wearer.takes(touch);
    wearer.fly(SETTLED);
    let pull = |wearer: &Wearer, value: f32| {
        wearer.mock.set_input("/user/hand/right/input/trigger/value", value).unwrap();
        wearer.mock.set_input("/user/hand/left/input/thumbstick", [0.0, value]).unwrap();
    };
    let still = |wearer: &mut Wearer, why: &str| {
        let input = wearer.fly(4);
        assert_eq!(Input { aim: Quat::IDENTITY, worn: false, ..input }, Input::default(), "{why}");
    };
    pull(&wearer, 1.0);
    assert!(wearer.fly(4).dive.is_some());
    // Still pulled, and somebody else's.
    wearer.mock.lose_focus();
    still(&mut wearer, "without the focus");
    wearer.mock.gain_focus();
    assert!(wearer.fly(4).dive.is_some(), "pulled still");
    HANDS.iter().for_each(|hand| wearer.mock.disconnect(hand).unwrap());
    still(&mut wearer, "without controllers");
    assert_eq!(wearer.viewer.interaction_profiles(), [None; 2]);
    // Others are taken up, with nothing pressed.
    wearer.takes("/interaction_profiles/valve/index_controller");
    still(&mut wearer, "with other controllers");
    assert_eq!(
        wearer.viewer.interaction_profiles(),
        [Some("/interaction_profiles/valve/index_controller"); 2]
    );
    pull(&wearer, 1.0);
    let dive = wearer.fly(4).dive.unwrap();
    // One that is not seen for a moment dives on to where it began to.
    let unseen = Tracking { orientation_valid: false, position_valid: false, ..Tracking::FULL };
    let unseen = Tracking { orientation_tracked: false, position_tracked: false, ..unseen };
    wearer.mock.set_device_tracking(HANDS[1], unseen).unwrap();
    assert_eq!(wearer.fly(10).dive, Some(dive));
    wearer.ends();
}

#[test]
fn what_is_bound_is_named_and_asked_for_only_when_controllers_change() {
    let mut wearer = Wearer::new(headset(), false);
    assert_eq!(wearer.viewer.bound().0, []);
    let asked = |wearer: &Wearer| {
        ["xrEnumerateBoundSourcesForAction", "xrGetInputSourceLocalizedName"].map(|f| wearer.mock.calls(f))
    };
    let inputs = |wearer: &Wearer, action: Action| {
        let bound = wearer.viewer.bound().0.iter().find(|bound| bound.action == action);
        bound.map(|bound| bound.inputs.join(", "))
    };
    wearer.takes("/interaction_profiles/oculus/touch_controller");
    wearer.fly(SETTLED);
    let (_, number) = wearer.viewer.bound();
    assert_eq!(
        inputs(&wearer, Action::Dive).as_deref(),
        Some("Left Hand Trigger Value, Right Hand Trigger Value")
    );
    assert!(inputs(&wearer, Action::Travel).is_some_and(|it| it.contains("Left Hand Thumbstick")));
    // Poses and ticks are nothing to press.
    assert!([Action::Aim, Action::Grip, Action::Pulse].iter().all(|it| inputs(&wearer, *it).is_none()));
    let lines = fathomless::panels::controller_lines(wearer.viewer.bound().0);
    assert!(
        lines
            .iter()
            .any(|it| it.action == Action::Dive.title() && it.inputs.ends_with("Right Hand Trigger Value"))
    );
    let before = asked(&wearer);
    wearer.fly(30);
    assert_eq!((asked(&wearer), wearer.viewer.bound().1), (before, number), "it is asked for frame by frame");

    wearer.takes("/interaction_profiles/khr/simple_controller");
    wearer.fly(SETTLED);
    assert!(wearer.viewer.bound().1 > number && asked(&wearer)[0] > before[0]);
    assert!(
        inputs(&wearer, Action::Dive).is_some_and(|it| it.contains("Select")),
        "{:?}",
        wearer.viewer.bound()
    );
    HANDS.iter().for_each(|hand| wearer.mock.disconnect(hand).unwrap());
    wearer.fly(SETTLED);
    assert_eq!(wearer.viewer.bound().0, []);

    // A runtime that has no words for it flies all the same.
    use openxr::sys::Result as Code;
    wearer.mock.on_call("xrGetInputSourceLocalizedName", Calls::All, Code::ERROR_RUNTIME_FAILURE).unwrap();
    wearer.takes("/interaction_profiles/oculus/touch_controller");
    wearer.fly(SETTLED);
    assert_eq!(wearer.viewer.bound().0, []);
    assert!(wearer.viewer.hands().hands[1].aim.is_some());
    wearer.ends();
}

#[test]
fn a_runtime_without_input_shows_the_flight_all_the_same() {
    use openxr::sys::Result as Code;
    for function in ["xrCreateActionSet", "xrCreateAction", "xrAttachSessionActionSets", "xrSyncActions"] {
        let config = headset();
        let world = World::load("hills").unwrap();
        let mock = Mock::new(config);
        mock.on_call(function, Calls::All, Code::ERROR_RUNTIME_FAILURE).unwrap();
        let bindings: &'static [ProfileBindings] = built_in(false).leak();
        let config = ViewerConfig { bindings: Some(bindings), ..least() };
        let mut viewer = Viewer::on_mock(&world, &config, mock.clone()).unwrap();
        let mut course = Course::new(world.surface, 20, 0.0, |_| ());
        let pose = FlightPose { height: 2.0, ..FlightPose::default() };
        let drew = (0..20).filter(|_| viewer.frame(&course.at(&pose), true).unwrap() == Step::Drew).count();
        assert!(drew > 10, "{function}: {drew} frames");
        assert_eq!(viewer.hands(), Hands::default());
    }
}

#[test]
fn a_tick_that_fails_comes_to_what_the_table_says() {
    use fathomless::xr::{Error, Lost, Outcome, outcome};
    let function = "xrApplyHapticFeedback";
    for &code in documented(function).iter().filter(|code| code.into_raw() < 0) {
        let mut wearer = Wearer::new(headset(), false);
        wearer.takes("/interaction_profiles/oculus/touch_controller");
        wearer.fly(SETTLED);
        wearer.mock.on_call(function, Calls::All, code).unwrap();
        let felt = wearer.viewer.pulse([0.5; 2]);
        match outcome(function, code) {
            Outcome::GoOn => assert!(felt.is_ok(), "{code:?}"),
            Outcome::ReopenSession => assert!(matches!(felt, Err(Error::Lost(Lost::Session))), "{code:?}"),
            Outcome::ReopenInstance => assert!(matches!(felt, Err(Error::Lost(Lost::Instance))), "{code:?}"),
            other => panic!("{code:?} comes to {other:?}"),
        }
    }
}

#[test]
fn wrong_bindings_are_named_with_their_lines() {
    let text = r#"
["/interaction_profiles/oculus/touch_controler"]
aim = ["both/input/aim/pose"]

["/interaction_profiles/htc/vive_controller"]
travel = ["off/input/thumbstick"]
dive = ["both/input/triger/value", "right/input/trigger/value"]
rise = ["main/input/trackpad"]
"#;
    let errors = bindings::parse("mine.toml", text, false).unwrap_err().0;
    let has = |line: &str, words: &str| {
        assert!(errors.iter().any(|e| e.contains(line) && e.contains(words)), "{words} in {errors:#?}");
    };
    assert_eq!(errors.len(), 5, "{errors:#?}");
    has("mine.toml, line 2", "did you mean /interaction_profiles/oculus/touch_controller?");
    has("mine.toml, line 6", "has no /input/thumbstick");
    has("mine.toml, line 7", "did you mean /input/trigger/value?");
    has("mine.toml, line 7", "begins with none of main/, off/ and both/");
    has("mine.toml, line 8", "rise is Float");
    let unknown =
        bindings::parse("mine.toml", "[\"/interaction_profiles/khr/simple_controller\"]\ndiv = []", false);
    let words = unknown.unwrap_err().0.join("");
    assert!(words.contains("mine.toml") && words.contains("div") && words.contains("dive"), "{words}");
}

#[test]
fn a_profile_like_another_has_its_bindings_and_some_of_its_own() {
    let text = r#"
["/interaction_profiles/oculus/touch_controller"]
aim = ["both/input/aim/pose"]
dive = ["both/input/trigger/value"]
rise = ["main/input/a/click"]

["/interaction_profiles/valve/index_controller"]
like = "/interaction_profiles/meta/touch_pro_controller"
dive = []

["/interaction_profiles/meta/touch_pro_controller"]
like = "/interaction_profiles/oculus/touch_controller"
grab = ["main/input/squeeze/value"]
"#;
    let all = bindings::parse("mine.toml", text, false).unwrap();
    let of = |name: &str| {
        let found = all.iter().find(|it| it.profile.ends_with(name)).unwrap();
        found.paths.iter().map(|(action, path)| (action.name(), path.as_str())).collect::<Vec<_>>()
    };
    let rest = [("grab", "/user/hand/right/input/squeeze/value"), ("rise", "/user/hand/right/input/a/click")];
    let aims = HANDS.map(|hand| format!("{hand}/input/aim/pose"));
    let aims = aims.each_ref().map(|path| ("aim", path.as_str()));
    assert_eq!(of("index_controller"), [&aims[..], &rest].concat());
    assert_eq!(of("touch_pro_controller").len(), 6);

    let wrong = r#"
["/interaction_profiles/oculus/touch_controller"]
like = "/interaction_profiles/valve/index_controler"

["/interaction_profiles/valve/index_controller"]
aim = ["both/input/aim/pose"]
turn = ["main/input/trackpad"]

["/interaction_profiles/meta/touch_pro_controller"]
like = "/interaction_profiles/valve/index_controller"

["/interaction_profiles/htc/vive_controller"]
like = "/interaction_profiles/htc/vive_controller"

["/interaction_profiles/khr/simple_controller"]
like = "/interaction_profiles/valve/index_controller"
turn = []
"#;
    let errors = bindings::parse("mine.toml", wrong, false).unwrap_err().0;
    let has = |line: &str, words: &str| {
        assert!(errors.iter().any(|e| e.contains(line) && e.contains(words)), "{words} in {errors:#?}");
    };
    assert_eq!(errors.len(), 3, "{errors:#?}");
    has("mine.toml, line 3:", "did you mean /interaction_profiles/valve/index_controller?");
    has("mine.toml, line 10:", "touch_pro_controller has no /input/trackpad");
    has("mine.toml, line 13:", "vive_controller is like itself");
}

fn hands(change: impl FnOnce(&mut Hands)) -> Hands {
    let aim = Some(Pose { position: Vec3::new(0.2, -0.3, -0.2), orientation: Quat::from_rotation_y(0.5) });
    let mut hands = Hands { hands: [Hand { aim, ..Hand::default() }; 2], ..Hands::default() };
    change(&mut hands);
    hands
}

#[test]
fn sticks_rest_in_the_middle_and_turn_by_steps() {
    let mut controllers = Controllers::default();
    let mut input = |hands: &Hands| controllers.input(hands, &AHEAD, FRAME);
    assert_eq!(input(&hands(|h| h.travel = Vec2::new(0.1, 0.1))).travel, Vec3::ZERO);
    let half = input(&hands(|h| h.travel = Vec2::new(0.0, 0.575)));
    assert!((half.travel - Vec3::new(0.0, 0.0, -0.5)).length() < 1e-5, "{half:?}");
    assert_eq!(half.aim, Quat::from_rotation_y(0.5));
    assert_eq!(input(&hands(|h| h.travel = Vec2::new(f32::NAN, 1.0))).travel, Vec3::ZERO);

    let step = 30f32.to_radians();
    let turns: Vec<f32> = [0.0, 0.8, 1.0, 0.5, 0.8, 0.1, -0.9, -0.9, 0.0]
        .map(|x| input(&hands(|h| h.turn = Vec2::new(x, 0.0))).look.x)
        .to_vec();
    assert_eq!(turns, [0.0, step, 0.0, 0.0, 0.0, 0.0, -step, 0.0, 0.0]);
    let aside = input(&hands(|h| h.turn = Vec2::new(0.95, 0.3)));
    assert_eq!(aside.travel.y, 0.0, "a step aside rises");
    assert_eq!(input(&hands(|h| h.turn = Vec2::new(0.0, 1.0))).travel.y, 1.0);
}

#[test]
fn a_trigger_dives_where_it_pointed_when_it_was_pulled() {
    let mut controllers = Controllers::default();
    let mut dive = |right: f32, turned: f32| {
        let hands = hands(|h| {
            h.hands[1].dive = right;
            let aim = h.hands[1].aim.as_mut().unwrap();
            aim.orientation = Quat::from_rotation_y(turned);
        });
        controllers.input(&hands, &AHEAD, FRAME).dive
    };
    assert_eq!(dive(0.5, 0.0), None, "half-way is not pulled");
    let ray = dive(0.7, 0.0).unwrap();
    assert_eq!((ray.origin_m, ray.direction), (Vec3::new(0.2, -0.3, -0.2), Vec3::NEG_Z));
    assert_eq!(dive(0.5, 1.0), Some(ray), "half-way back is still pulled");
    assert_eq!(dive(0.3, 1.0), None);
    assert_ne!(dive(1.0, 1.0).unwrap().direction, ray.direction);
}

#[test]
fn the_start_is_a_long_press_away() {
    let mut controllers = Controllers::default();
    let mut restarts = |down: bool, frames: usize| {
        let hands = hands(|h| h.restart = down);
        (0..frames).filter(|_| controllers.input(&hands, &AHEAD, FRAME).restart).count()
    };
    assert_eq!(restarts(true, 80), 0);
    assert_eq!(restarts(false, 1), 0);
    assert_eq!(restarts(true, 300), 1);
}

#[test]
fn each_octave_is_felt_once() {
    let mut controllers = Controllers::default();
    let mut ticks = |depths: &[f64]| depths.iter().filter(|d| controllers.tick(**d).is_some()).count();
    assert_eq!(ticks(&[3.2, 3.5, 3.99]), 0);
    assert_eq!(ticks(&[4.01, 3.99, 4.02, 3.9, 4.1]), 1, "hovering at an octave");
    assert_eq!(ticks(&[5.0, 6.0, 7.5]), 3);
    assert_eq!(ticks(&[6.9, 6.8, 6.7, 5.7, 4.7]), 3, "and back");
}
