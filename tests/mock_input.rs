//! Scripted devices reach an application as the specification says: through its bindings, when it syncs, and only then.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "some calls are not in the crate")]

mod mock_support;

use std::ptr;

use fathomless::mock::{InputError, Mock, Pose, PoseTrack, Tracking};
use glam::{Quat, Vec3};
use mock_support::{Desk, assert_documented, begin, extensions, focus};
use openxr as xr;
use proptest::prelude::*;
use xr::sys::{self, Handle as _, Result as R};

const LEFT: &str = "/user/hand/left";
const RIGHT: &str = "/user/hand/right";
const SIMPLE: &str = "/interaction_profiles/khr/simple_controller";
const TOUCH: &str = "/interaction_profiles/oculus/touch_controller";
const INDEX: &str = "/interaction_profiles/valve/index_controller";
const XBOX: &str = "/interaction_profiles/microsoft/xbox_controller";

impl Desk {
    fn mock(&self) -> &Mock {
        &self.app.mock
    }

    fn path(&self, text: &str) -> xr::Path {
        if text.is_empty() { xr::Path::NULL } else { self.app.instance.string_to_path(text).unwrap() }
    }

    fn text(&self, path: xr::Path) -> String {
        if path == xr::Path::NULL {
            return String::new();
        }
        self.app.instance.path_to_string(path).unwrap()
    }

    fn hands(&self) -> [xr::Path; 2] {
        [self.path(LEFT), self.path(RIGHT)]
    }

    fn set(&self, name: &str, priority: u32) -> xr::ActionSet {
        self.app.instance.create_action_set(name, name, priority).unwrap()
    }

    fn suggest(&self, profile: &str, bindings: &[(sys::Action, &str)]) {
        let bindings: Vec<_> = bindings
            .iter()
            .map(|(action, path)| sys::ActionSuggestedBinding { action: *action, binding: self.path(path) })
            .collect();
        let info = sys::InteractionProfileSuggestedBinding {
            ty: sys::InteractionProfileSuggestedBinding::TYPE,
            next: ptr::null(),
            interaction_profile: self.path(profile),
            count_suggested_bindings: bindings.len() as u32,
            suggested_bindings: bindings.as_ptr(),
        };
        let instance = &self.app.instance;
        // SAFETY: whole structures of a living instance.
        let got = unsafe { (instance.fp().suggest_interaction_profile_bindings)(instance.as_raw(), &info) };
        assert_eq!(got, R::SUCCESS, "{profile}");
    }

    fn try_sync(&self, sets: &[(&xr::ActionSet, &str)]) -> R {
        let active: Vec<_> = sets
            .iter()
            .map(|(set, path)| sys::ActiveActionSet {
                action_set: set.as_raw(),
                subaction_path: self.path(path),
            })
            .collect();
        let info = sys::ActionsSyncInfo {
            ty: sys::ActionsSyncInfo::TYPE,
            next: ptr::null(),
            count_active_action_sets: active.len() as u32,
            active_action_sets: active.as_ptr(),
        };
        // SAFETY: whole structures of a living session.
        unsafe { (self.app.instance.fp().sync_actions)(self.session.as_raw(), &info) }
    }

    fn sync(&self, set: &xr::ActionSet) {
        assert_eq!(self.try_sync(&[(set, "")]), R::SUCCESS);
    }

    /// How often the session was told since the last call that profiles have changed.
    fn profile_changes(&self) -> usize {
        let mut buffer = xr::EventDataBuffer::new();
        let mut count = 0;
        while let Some(event) = self.app.instance.poll_event(&mut buffer).unwrap() {
            if let xr::Event::InteractionProfileChanged(change) = event {
                assert_eq!(change.session(), self.session.as_raw());
                count += 1;
            }
        }
        count
    }

    fn profile(&self, user_path: &str) -> String {
        self.text(self.session.current_interaction_profile(self.path(user_path)).unwrap())
    }

    fn boolean(&self, action: &xr::Action<bool>, user_path: &str) -> xr::ActionState<bool> {
        action.state(&self.session, self.path(user_path)).unwrap()
    }

    fn float(&self, action: &xr::Action<f32>, user_path: &str) -> xr::ActionState<f32> {
        action.state(&self.session, self.path(user_path)).unwrap()
    }

    fn vector(&self, action: &xr::Action<xr::Vector2f>, user_path: &str) -> xr::ActionState<xr::Vector2f> {
        action.state(&self.session, self.path(user_path)).unwrap()
    }

    fn assert_blameless(&self) {
        assert_documented(self.mock());
        assert_eq!(self.mock().violations(), []);
    }
}

#[test]
fn states_change_at_syncs_only() {
    let mut desk = Desk::new(&extensions());
    let set = desk.set("play", 0);
    let fire = set.create_action::<bool>("fire", "Fire", &desk.hands()).unwrap();
    let pull = set.create_action::<f32>("pull", "Pull", &[]).unwrap();
    let walk = set.create_action::<xr::Vector2f>("walk", "Walk", &[]).unwrap();
    desk.suggest(
        TOUCH,
        &[
            (fire.as_raw(), "/user/hand/left/input/x/click"),
            (fire.as_raw(), "/user/hand/right/input/a/click"),
            (pull.as_raw(), "/user/hand/left/input/trigger/value"),
            (walk.as_raw(), "/user/hand/left/input/thumbstick"),
        ],
    );
    desk.session.attach_action_sets(&[&set]).unwrap();
    assert_eq!(desk.profile(LEFT), "");
    desk.mock().connect(LEFT, TOUCH).unwrap();
    desk.mock().connect(RIGHT, TOUCH).unwrap();
    assert_eq!((desk.profile(LEFT), desk.profile_changes()), (String::new(), 0), "before the sync");
    assert!(!desk.boolean(&fire, "").is_active);

    desk.sync(&set);
    assert_eq!(desk.profile_changes(), 1);
    assert_eq!((desk.profile(LEFT), desk.profile(RIGHT)), (TOUCH.to_owned(), TOUCH.to_owned()));
    assert_eq!(desk.profile("/user/head"), "");
    let rest = desk.boolean(&fire, "");
    assert!(rest.is_active && !rest.current_state && !rest.changed_since_last_sync);

    desk.frame();
    desk.mock().set_input("/user/hand/left/input/x/click", true).unwrap();
    desk.mock().set_input("/user/hand/left/input/trigger/value", 0.25).unwrap();
    desk.mock().set_input("/user/hand/left/input/thumbstick", [0.5, -0.75]).unwrap();
    let pressed_at = desk.frame();
    assert!(!desk.boolean(&fire, "").current_state, "not yet synced");
    desk.sync(&set);
    for user_path in ["", LEFT] {
        let state = desk.boolean(&fire, user_path);
        assert!(state.is_active && state.current_state && state.changed_since_last_sync);
        let changed_ns = state.last_change_time.as_nanos();
        assert!(rest.last_change_time.as_nanos() < changed_ns && changed_ns < pressed_at.as_nanos());
    }
    let other = desk.boolean(&fire, RIGHT);
    assert!(other.is_active && !other.current_state && !other.changed_since_last_sync);
    assert_eq!(desk.float(&pull, "").current_state, 0.25);
    assert_eq!(desk.vector(&walk, "").current_state, xr::Vector2f { x: 0.5, y: -0.75 });

    let pressed = desk.boolean(&fire, "");
    desk.frame();
    desk.sync(&set);
    let held = desk.boolean(&fire, "");
    assert!(held.current_state && !held.changed_since_last_sync);
    assert_eq!(held.last_change_time, pressed.last_change_time);

    // A set that is not synced is inactive; coming back is no change.
    assert_eq!(desk.try_sync(&[]), R::SUCCESS);
    let inactive = desk.boolean(&fire, "");
    assert!(!inactive.is_active && !inactive.current_state && !inactive.changed_since_last_sync);
    assert_eq!(inactive.last_change_time, xr::Time::from_nanos(0));
    desk.sync(&set);
    assert!(desk.boolean(&fire, "").current_state && !desk.boolean(&fire, "").changed_since_last_sync);

    // A device that goes is gone at the next sync, and forgets what was pressed.
    desk.mock().disconnect(LEFT).unwrap();
    assert!(desk.boolean(&fire, LEFT).current_state);
    desk.sync(&set);
    assert!(!desk.boolean(&fire, LEFT).is_active && desk.boolean(&fire, "").is_active);
    assert_eq!((desk.profile(LEFT), desk.profile_changes()), (String::new(), 1));
    desk.mock().connect(LEFT, TOUCH).unwrap();
    desk.sync(&set);
    assert!(desk.boolean(&fire, LEFT).is_active && !desk.boolean(&fire, LEFT).current_state);
    assert_eq!(desk.profile_changes(), 1);
    desk.assert_blameless();
}

#[test]
fn without_the_focus_everything_is_inactive() {
    let mut desk = Desk::new(&extensions());
    let set = desk.set("play", 0);
    let fire = set.create_action::<bool>("fire", "Fire", &[]).unwrap();
    let aim = set.create_action::<xr::Posef>("aim", "Aim", &[]).unwrap();
    desk.suggest(
        SIMPLE,
        &[
            (fire.as_raw(), "/user/hand/left/input/select/click"),
            (aim.as_raw(), "/user/hand/left/input/aim/pose"),
        ],
    );
    desk.session.attach_action_sets(&[&set]).unwrap();
    desk.mock().connect(LEFT, SIMPLE).unwrap();
    desk.mock().set_input("/user/hand/left/input/select/click", true).unwrap();
    desk.sync(&set);
    let space = aim.create_space(&desk.session, xr::Path::NULL, xr::Posef::IDENTITY).unwrap();
    let base =
        desk.session.create_reference_space(xr::ReferenceSpaceType::STAGE, xr::Posef::IDENTITY).unwrap();
    let time = desk.frame();
    assert!(!space.locate(&base, time).unwrap().location_flags.is_empty());
    assert!(desk.boolean(&fire, "").current_state);

    desk.mock().lose_focus();
    assert!(desk.boolean(&fire, "").current_state, "states wait for a sync");
    assert!(space.locate(&base, time).unwrap().location_flags.is_empty(), "places do not");
    assert_eq!(desk.try_sync(&[(&set, "")]), R::SESSION_NOT_FOCUSED);
    assert!(!desk.boolean(&fire, "").is_active && !aim.is_active(&desk.session, xr::Path::NULL).unwrap());
    desk.mock().gain_focus();
    desk.frame();
    assert!(!desk.boolean(&fire, "").is_active);
    desk.sync(&set);
    assert!(desk.boolean(&fire, "").current_state);
    assert_eq!(desk.profile(LEFT), SIMPLE);
    desk.assert_blameless();
}

#[test]
fn types_are_converted() {
    let mut desk = Desk::new(&extensions());
    let set = desk.set("play", 0);
    let mut count = 0;
    let mut name = || {
        count += 1;
        format!("action{count}")
    };
    let mut bindings: Vec<(sys::Action, String)> = Vec::new();
    macro_rules! action {
        ($kind:ty, $path:literal) => {{
            let name = name();
            let action = set.create_action::<$kind>(&name, &name, &[]).unwrap();
            bindings.push((action.as_raw(), format!("{LEFT}/input/{}", $path)));
            action
        }};
    }
    // The part that components belong to stands for its click, or value, or pose.
    let trigger_part = action!(bool, "trigger");
    let squeeze_part = action!(bool, "squeeze");
    let stick_part = action!(bool, "thumbstick");
    let trigger_value = action!(f32, "trigger");
    let a_part = action!(f32, "a");
    let grip_part = action!(xr::Posef, "grip");
    // Directly.
    let threshold = action!(bool, "trigger/value");
    let zero_or_one = action!(f32, "a/click");
    let x_axis = action!(f32, "thumbstick/x");
    let stick = action!(xr::Vector2f, "thumbstick");
    // Never.
    let vector_of_button = action!(xr::Vector2f, "a/click");
    let vector_of_number = action!(xr::Vector2f, "trigger/value");
    let button_of_pose = action!(bool, "grip/pose");
    let number_of_pose = action!(f32, "aim/pose");
    let pose_of_button = action!(xr::Posef, "a/click");
    let pose_of_stick = action!(xr::Posef, "thumbstick");
    let borrowed: Vec<_> = bindings.iter().map(|(action, path)| (*action, path.as_str())).collect();
    desk.suggest(INDEX, &borrowed);
    desk.session.attach_action_sets(&[&set]).unwrap();
    desk.mock().connect(LEFT, INDEX).unwrap();
    desk.sync(&set);

    let input = |name: &str| format!("{LEFT}/input/{name}");
    let mock = desk.mock().clone();
    mock.set_input(&input("trigger/click"), true).unwrap();
    mock.set_input(&input("a/click"), true).unwrap();
    mock.set_input(&input("thumbstick/click"), true).unwrap();
    mock.set_input(&input("squeeze/value"), 0.9).unwrap();
    mock.set_input(&input("thumbstick/x"), -0.5).unwrap();
    mock.set_input(&input("thumbstick/y"), 0.25).unwrap();
    desk.sync(&set);
    let on = |action: &xr::Action<bool>| desk.boolean(action, "").current_state;
    assert!(on(&trigger_part) && on(&squeeze_part) && on(&stick_part));
    assert!(!on(&threshold));
    assert_eq!(desk.float(&trigger_value, "").current_state, 0.0);
    assert_eq!(desk.float(&a_part, "").current_state, 1.0);
    assert_eq!(desk.float(&zero_or_one, "").current_state, 1.0);
    assert_eq!(desk.float(&x_axis, "").current_state, -0.5);
    assert_eq!(desk.vector(&stick, "").current_state, xr::Vector2f { x: -0.5, y: 0.25 });
    assert!(grip_part.is_active(&desk.session, xr::Path::NULL).unwrap());
    assert!(!desk.vector(&vector_of_button, "").is_active && !desk.vector(&vector_of_number, "").is_active);
    assert!(!desk.boolean(&button_of_pose, "").is_active && !desk.float(&number_of_pose, "").is_active);
    assert!(!pose_of_button.is_active(&desk.session, xr::Path::NULL).unwrap());
    assert!(!pose_of_stick.is_active(&desk.session, xr::Path::NULL).unwrap());

    // Between the thresholds a number keeps the button as it is.
    for (value, pressed) in [(0.5, false), (0.7, true), (0.5, true), (0.3, false), (0.5, false), (1.0, true)]
    {
        mock.set_input(&input("trigger/value"), value).unwrap();
        desk.sync(&set);
        assert_eq!(on(&threshold), pressed, "{value}");
        assert_eq!(desk.float(&trigger_value, "").current_state, value);
    }
    // A button's time is when it was pressed, though the number behind it moves on.
    let pressed_at = desk.boolean(&threshold, "").last_change_time;
    desk.frame();
    desk.mock().set_input(&input("trigger/value"), 0.9).unwrap();
    desk.sync(&set);
    assert_eq!(desk.boolean(&threshold, "").last_change_time, pressed_at);
    assert!(desk.float(&trigger_value, "").last_change_time.as_nanos() > pressed_at.as_nanos());
    let sources = |action: &xr::Action<bool>| -> Vec<String> {
        action.bound_sources(&desk.session).unwrap().into_iter().map(|path| desk.text(path)).collect()
    };
    assert_eq!(sources(&trigger_part), [input("trigger/click")]);
    assert_eq!(sources(&squeeze_part), [input("squeeze/value")]);
    assert!(sources(&button_of_pose).is_empty());
    desk.assert_blameless();
}

/// What a set of higher priority leaves of the actions of another, for each way to sync the two.
#[test]
fn priorities_take_inputs_away() {
    let desk = Desk::new(&extensions());
    let (high, low) = (desk.set("high", 3), desk.set("low", 2));
    let hands = desk.hands();
    let select = high.create_action::<bool>("select", "Select", &hands).unwrap();
    let part = low.create_action::<bool>("part", "Part", &hands).unwrap();
    let menu = low.create_action::<bool>("menu", "Menu", &hands).unwrap();
    let both = low.create_action::<bool>("both", "Both", &hands).unwrap();
    let buzz = low.create_action::<xr::Haptic>("buzz", "Buzz", &hands).unwrap();
    let hum = high.create_action::<xr::Haptic>("hum", "Hum", &hands).unwrap();
    let mut bindings = Vec::new();
    let full = |hand: &str, rest: &str| format!("{hand}/{rest}");
    for hand in [LEFT, RIGHT] {
        bindings.push((select.as_raw(), full(hand, "input/select/click")));
        // Bound to the part, which is the same input.
        bindings.push((part.as_raw(), full(hand, "input/select")));
        bindings.push((menu.as_raw(), full(hand, "input/menu/click")));
        bindings.push((both.as_raw(), full(hand, "input/select/click")));
        bindings.push((both.as_raw(), full(hand, "input/menu/click")));
        bindings.push((buzz.as_raw(), full(hand, "output/haptic")));
    }
    bindings.push((hum.as_raw(), full(LEFT, "output/haptic")));
    let borrowed: Vec<_> = bindings.iter().map(|(action, path)| (*action, path.as_str())).collect();
    desk.suggest(SIMPLE, &borrowed);
    desk.session.attach_action_sets(&[&high, &low]).unwrap();
    desk.mock().connect(LEFT, SIMPLE).unwrap();
    desk.mock().connect(RIGHT, SIMPLE).unwrap();
    // For each way to sync: whether any, left, right are active, of the four actions.
    type Row = [bool; 3];
    const NO: Row = [false; 3];
    const ALL: Row = [true; 3];
    const L: Row = [true, true, false];
    const R_: Row = [true, false, true];
    type Sync<'a> = &'a [(&'a xr::ActionSet, &'a str)];
    let cases: [(Sync<'_>, [Row; 4]); 7] = [
        (&[(&low, "")], [NO, ALL, ALL, ALL]),
        (&[(&low, ""), (&high, "")], [ALL, NO, ALL, ALL]),
        (&[(&low, LEFT), (&low, RIGHT), (&high, LEFT), (&high, RIGHT)], [ALL, NO, ALL, ALL]),
        (&[(&high, RIGHT), (&low, RIGHT)], [R_, NO, R_, R_]),
        (&[(&high, RIGHT), (&low, LEFT)], [R_, L, L, L]),
        (&[(&high, LEFT), (&low, RIGHT)], [L, R_, R_, R_]),
        (&[(&high, RIGHT), (&low, LEFT), (&low, RIGHT)], [R_, L, ALL, ALL]),
    ];
    for (i, (sets, rows)) in cases.iter().enumerate() {
        assert_eq!(desk.try_sync(sets), R::SUCCESS);
        for (action, row) in [&select, &part, &menu, &both].into_iter().zip(rows) {
            let got = ["", LEFT, RIGHT].map(|user_path| desk.boolean(action, user_path).is_active);
            assert_eq!(got, *row, "case {i}");
        }
    }
    // Outputs go the same way.
    assert_eq!(desk.try_sync(&[(&high, ""), (&low, "")]), R::SUCCESS);
    let vibration = xr::HapticVibration::new().duration(xr::Duration::MIN_HAPTIC).amplitude(0.5);
    buzz.apply_feedback(&desk.session, xr::Path::NULL, &vibration).unwrap();
    buzz.apply_feedback(&desk.session, hands[0], &vibration).unwrap();
    hum.apply_feedback(&desk.session, xr::Path::NULL, &vibration).unwrap();
    let outputs: Vec<_> = desk.mock().haptics().into_iter().map(|haptic| haptic.outputs).collect();
    let (left, right) = (full(LEFT, "output/haptic"), full(RIGHT, "output/haptic"));
    assert_eq!(outputs, [vec![right], vec![], vec![left]]);
    desk.assert_blameless();
}

#[test]
fn poses_follow_their_tracks() {
    let mut desk = Desk::new(&extensions());
    let set = desk.set("play", 0);
    let grip = set.create_action::<xr::Posef>("grip", "Grip", &desk.hands()).unwrap();
    let aim = set.create_action::<xr::Posef>("aim", "Aim", &[]).unwrap();
    desk.suggest(
        TOUCH,
        &[
            (grip.as_raw(), "/user/hand/right/input/grip/pose"),
            (grip.as_raw(), "/user/hand/left/input/grip/pose"),
            (aim.as_raw(), "/user/hand/right/input/aim/pose"),
            (aim.as_raw(), "/user/hand/left/input/aim/pose"),
        ],
    );
    desk.session.attach_action_sets(&[&set]).unwrap();
    let offset = xr::Posef { position: xr::Vector3f { x: 0.0, y: 0.1, z: 0.0 }, ..xr::Posef::IDENTITY };
    let spaces = [xr::Path::NULL, desk.hands()[0], desk.hands()[1]]
        .map(|path| grip.create_space(&desk.session, path, offset).unwrap());
    let pointer = aim.create_space(&desk.session, xr::Path::NULL, xr::Posef::IDENTITY).unwrap();
    let reference = |kind| desk.session.create_reference_space(kind, xr::Posef::IDENTITY).unwrap();
    let (stage, view) = (reference(xr::ReferenceSpaceType::STAGE), reference(xr::ReferenceSpaceType::VIEW));
    // The left hand moves along x at 2 m/s and turns about y at 1 rad/s; the right one stands still.
    let moving = PoseTrack::new((0..=100).map(|i| {
        let t = f64::from(i) * 0.1;
        let turn = Quat::from_rotation_y(t as f32);
        (t, Pose::new(Vec3::new(2.0 * t as f32, 1.0, -0.5), turn))
    }));
    desk.mock().set_pose_track("/user/hand/left/input/grip/pose", moving).unwrap();
    let still = Pose::new(Vec3::new(0.3, 1.1, -0.4), Quat::from_rotation_z(1.0));
    desk.mock().set_pose_track("/user/hand/right/input/grip/pose", PoseTrack::fixed(still)).unwrap();
    let time = desk.frame();
    let is_lost = |space: &xr::Space| space.locate(&stage, time).unwrap().location_flags.is_empty();
    assert!(spaces.iter().all(&is_lost));
    desk.mock().connect(LEFT, TOUCH).unwrap();
    desk.mock().connect(RIGHT, TOUCH).unwrap();
    assert!(spaces.iter().all(&is_lost), "before the sync");
    desk.sync(&set);
    assert!(spaces.iter().all(|space| !is_lost(space)));

    // Four frames at 100 Hz have gone by: this one is displayed at 0.03 s on the script's clock.
    let full = xr::SpaceLocationFlags::from_raw(15);
    let (location, velocity) = spaces[1].relate(&stage, time).unwrap();
    let seconds = 0.03;
    assert_eq!(location.location_flags, full);
    let at = location.pose.position;
    assert!(
        (at.x - 2.0 * seconds).abs() < 1e-4 && (at.y - 1.1).abs() < 1e-5 && (at.z + 0.5).abs() < 1e-5,
        "{at:?}"
    );
    let (linear, angular) = (velocity.linear_velocity, velocity.angular_velocity);
    assert!((linear.x - 2.0).abs() < 1e-2 && linear.y.abs() < 1e-2, "{linear:?}");
    assert!((angular.y - 1.0).abs() < 1e-2 && angular.x.abs() < 1e-2, "{angular:?}");

    // Without a sub-action path the first of them is followed, not the first suggested.
    let any = spaces[0].locate(&stage, time).unwrap();
    assert_eq!(any.pose, location.pose);
    let right = spaces[2].locate(&stage, time).unwrap();
    assert!((right.pose.position.x - (0.3 - 0.1 * 1f32.sin())).abs() < 1e-5);
    // Without any, the first suggested; its aim, which has no track, is fixed to the grip.
    let aimed = pointer.locate(&spaces[2], time).unwrap();
    let later = pointer.locate(&spaces[2], xr::Time::from_nanos(time.as_nanos() + 500_000_000)).unwrap();
    assert_eq!(aimed.location_flags, full);
    assert_eq!(aimed.pose, later.pose);
    desk.mock()
        .set_pose_track("/user/hand/right/input/aim/pose", PoseTrack::fixed(Pose::at(0.0, 2.0, 0.0)))
        .unwrap();
    assert_eq!(pointer.locate(&stage, time).unwrap().pose.position, xr::Vector3f { x: 0.0, y: 2.0, z: 0.0 });

    // Tracking: of the device, and of the head where the base is on it.
    desk.mock().set_device_tracking(LEFT, Tracking::GUESSED).unwrap();
    let flags =
        |space: &xr::Space, base: &xr::Space| space.locate(base, time).unwrap().location_flags.into_raw();
    assert_eq!((flags(&spaces[1], &stage), flags(&spaces[2], &stage)), (3, 15));
    assert!(spaces[1].relate(&stage, time).unwrap().1.velocity_flags.is_empty());
    assert_eq!(flags(&spaces[1], &spaces[1]), 15);
    desk.mock().set_tracking(Some(Tracking::ORIENTATION_ONLY));
    assert_eq!((flags(&spaces[1], &view), flags(&spaces[2], &view), flags(&spaces[2], &stage)), (1, 5, 15));
    desk.mock().set_tracking(None);
    desk.mock().set_device_tracking(LEFT, Tracking::FULL).unwrap();

    // What was chosen stays chosen; what is away is nowhere, at once.
    desk.mock().disconnect(LEFT).unwrap();
    assert!(is_lost(&spaces[0]) && is_lost(&spaces[1]) && !is_lost(&spaces[2]));
    desk.sync(&set);
    assert!(is_lost(&spaces[0]) && !grip.is_active(&desk.session, xr::Path::NULL).unwrap());
    assert!(grip.is_active(&desk.session, desk.hands()[1]).unwrap());
    desk.mock().connect(LEFT, TOUCH).unwrap();
    assert!(is_lost(&spaces[0]), "it waits for a sync");
    desk.sync(&set);
    assert!(!is_lost(&spaces[0]));

    // A space outlives the handle of its action.
    let raw = grip.as_raw();
    // SAFETY: the crate's action is not used any more; its own destroy at the end finds the handle gone.
    assert_eq!(unsafe { (desk.app.instance.fp().destroy_action)(raw) }, R::SUCCESS);
    desk.sync(&set);
    assert!(spaces.iter().all(|space| !is_lost(space)));
    desk.assert_blameless();
}

#[test]
fn an_unknown_device_stands_in_for_the_simple_controller() {
    let desk = Desk::new(&extensions());
    let set = desk.set("play", 0);
    let select = set.create_action::<bool>("select", "Select", &desk.hands()).unwrap();
    let menu = set.create_action::<bool>("menu", "Menu", &desk.hands()).unwrap();
    let grip = set.create_action::<xr::Posef>("grip", "Grip", &desk.hands()).unwrap();
    let jump = set.create_action::<bool>("jump", "Jump", &[]).unwrap();
    let mut bindings = Vec::new();
    for hand in [LEFT, RIGHT] {
        bindings.push((select.as_raw(), format!("{hand}/input/select/click")));
        bindings.push((menu.as_raw(), format!("{hand}/input/menu/click")));
        bindings.push((grip.as_raw(), format!("{hand}/input/grip/pose")));
    }
    let borrowed: Vec<_> = bindings.iter().map(|(action, path)| (*action, path.as_str())).collect();
    desk.suggest(SIMPLE, &borrowed);
    desk.suggest(INDEX, &[(jump.as_raw(), "/user/hand/left/input/a/click")]);
    desk.session.attach_action_sets(&[&set]).unwrap();
    desk.mock().connect(RIGHT, TOUCH).unwrap();
    desk.mock().connect(LEFT, INDEX).unwrap();
    desk.mock().connect("/user/gamepad", XBOX).unwrap();
    desk.mock().set_input("/user/hand/right/input/trigger/value", 1.0).unwrap();
    desk.mock().set_input("/user/hand/right/input/b/click", true).unwrap();
    desk.sync(&set);
    assert_eq!((desk.profile(RIGHT), desk.profile(LEFT)), (SIMPLE.to_owned(), INDEX.to_owned()));
    assert_eq!(desk.profile("/user/gamepad"), "");
    assert!(desk.boolean(&select, RIGHT).current_state && desk.boolean(&menu, RIGHT).current_state);
    assert!(!desk.boolean(&select, LEFT).is_active && desk.boolean(&jump, "").is_active);
    assert!(grip.is_active(&desk.session, desk.hands()[1]).unwrap());
    assert_eq!(desk.profile_changes(), 1);

    // Another device of the same use is bound anew, though the application sees the same profile.
    desk.mock().connect(RIGHT, SIMPLE).unwrap();
    desk.sync(&set);
    assert_eq!((desk.profile(RIGHT), desk.profile_changes()), (SIMPLE.to_owned(), 0));
    assert!(desk.boolean(&select, RIGHT).is_active && !desk.boolean(&select, RIGHT).current_state);
    desk.mock().set_input("/user/hand/right/input/select/click", true).unwrap();
    desk.sync(&set);
    assert!(desk.boolean(&select, RIGHT).current_state);
    desk.assert_blameless();
}

#[test]
fn sessions_have_input_of_their_own() {
    let desk = Desk::new(&extensions());
    let set = desk.set("play", 0);
    let fire = set.create_action::<bool>("fire", "Fire", &[]).unwrap();
    desk.suggest(SIMPLE, &[(fire.as_raw(), "/user/hand/left/input/select/click")]);
    desk.session.attach_action_sets(&[&set]).unwrap();
    desk.mock().connect(LEFT, SIMPLE).unwrap();
    desk.mock().set_input("/user/hand/left/input/select/click", true).unwrap();
    desk.sync(&set);
    {
        let (other, mut waiter, mut stream) = desk.app.session();
        assert_eq!(fire.state(&other, xr::Path::NULL).err(), Some(R::ERROR_ACTIONSET_NOT_ATTACHED));
        other.attach_action_sets(&[&set, &set]).unwrap();
        begin(&desk.app, &other);
        focus(&desk.app, &mut waiter, &mut stream);
        assert!(!fire.state(&other, xr::Path::NULL).unwrap().is_active);
        assert_eq!(other.current_interaction_profile(desk.path(LEFT)).unwrap(), xr::Path::NULL);
        other.sync_actions(&[xr::ActiveActionSet::new(&set)]).unwrap();
        assert!(fire.state(&other, xr::Path::NULL).unwrap().current_state);
    }
    // What is suggested now comes too late for the session that has its sets.
    let late = desk.set("late", 0);
    let jump = late.create_action::<bool>("jump", "Jump", &[]).unwrap();
    desk.suggest(SIMPLE, &[(jump.as_raw(), "/user/hand/left/input/select/click")]);
    desk.mock().disconnect(LEFT).unwrap();
    desk.sync(&set);
    desk.mock().connect(LEFT, SIMPLE).unwrap();
    desk.sync(&set);
    assert!(desk.boolean(&fire, "").is_active);
    assert_eq!(fire.bound_sources(&desk.session).unwrap().len(), 1);
    assert_eq!(desk.try_sync(&[(&late, "")]), R::ERROR_ACTIONSET_NOT_ATTACHED);
    assert_documented(desk.mock());
}

#[test]
fn sources_have_names() {
    let desk = Desk::new(&extensions());
    let set = desk.set("play", 0);
    let fire = set.create_action::<bool>("fire", "Fire", &[]).unwrap();
    let bindings =
        ["left/input/x/click", "right/input/trigger/value", "right/input/trigger", "right/input/a/click"];
    let bindings = bindings.map(|rest| (fire.as_raw(), format!("/user/hand/{rest}")));
    let borrowed: Vec<_> = bindings.iter().map(|(action, path)| (*action, path.as_str())).collect();
    desk.suggest(TOUCH, &borrowed);
    desk.session.attach_action_sets(&[&set]).unwrap();
    assert!(fire.bound_sources(&desk.session).unwrap().is_empty());
    desk.mock().connect(RIGHT, TOUCH).unwrap();
    assert!(fire.bound_sources(&desk.session).unwrap().is_empty(), "before the sync");
    desk.sync(&set);
    let sources = fire.bound_sources(&desk.session).unwrap();
    let texts: Vec<_> = sources.iter().map(|path| desk.text(*path)).collect();
    assert_eq!(texts, ["/user/hand/right/input/trigger/value", "/user/hand/right/input/a/click"]);
    let name = |which: u64| {
        let which = xr::InputSourceLocalizedNameFlags::from_raw(which);
        desk.session.input_source_localized_name(sources[0], which).unwrap()
    };
    assert_eq!(name(1), "Right Hand");
    assert_eq!(name(2), "Oculus Touch Controller");
    assert_eq!(name(4), "Trigger Value");
    assert_eq!(name(7), "Right Hand Oculus Touch Controller Trigger Value");
    assert_eq!(name(5), "Right Hand Trigger Value");
    let all = xr::InputSourceLocalizedNameFlags::from_raw(7);
    let head = desk.path("/user/head/input/volume_up/click");
    let got = desk.session.input_source_localized_name(head, all).unwrap();
    assert_eq!(got, "Head HTC Vive Pro Volume Up");
    for (path, code) in [
        (desk.path("/user/hand/left"), R::ERROR_PATH_UNSUPPORTED),
        (desk.path("/user/hand/left/input/nothing"), R::ERROR_PATH_UNSUPPORTED),
        (xr::Path::NULL, R::ERROR_PATH_INVALID),
    ] {
        assert_eq!(desk.session.input_source_localized_name(path, all).err(), Some(code));
    }
}

#[test]
fn scripts_that_cannot_be_are_refused() {
    let mock = Mock::default();
    let trigger = "/user/hand/left/input/trigger/value";
    let grip = "/user/hand/left/input/grip/pose";
    use InputError as E;
    assert!(matches!(mock.connect(LEFT, "/interaction_profiles/a/b"), Err(E::UnknownProfile(_))));
    assert!(matches!(mock.connect("/user/foot", TOUCH), Err(E::UnknownUserPath(_))));
    assert!(matches!(mock.connect(LEFT, XBOX), Err(E::NotThere { .. })));
    assert!(matches!(mock.set_input(trigger, 1.0), Err(E::NotConnected(LEFT))));
    assert_eq!(mock.connected_profile(LEFT), None);
    mock.connect(LEFT, TOUCH).unwrap();
    assert_eq!(mock.connected_profile(LEFT), Some(TOUCH));
    assert!(matches!(mock.set_input(trigger, true), Err(E::WrongKind { .. })));
    assert!(matches!(mock.set_input(trigger, 1.5), Err(E::OutOfRange { .. })));
    assert!(matches!(mock.set_input(trigger, f32::NAN), Err(E::OutOfRange { .. })));
    assert!(matches!(mock.set_input("/user/hand/left/input/a/click", true), Err(E::NoSuchComponent { .. })));
    assert!(matches!(mock.set_input("/user/hand/left/input/a", true), Err(E::UnknownComponent(_))));
    assert!(matches!(mock.set_input(grip, true), Err(E::WrongKind { .. })));
    assert!(matches!(mock.set_pose_track(trigger, PoseTrack::default()), Err(E::WrongKind { .. })));
    assert!(matches!(mock.show_hand("/user/head", true), Err(E::UnknownUserPath(_))));
    for done in [
        mock.set_input(trigger, 1.0),
        mock.set_pose_track(grip, PoseTrack::default()),
        mock.set_device_tracking(RIGHT, Tracking::LOST),
        mock.disconnect(LEFT),
        mock.disconnect(LEFT),
    ] {
        assert_eq!(done, Ok(()));
    }
}

#[test]
fn an_application_can_move_the_devices_itself() {
    let mut more = extensions();
    more.ext_conformance_automation = true;
    let mut desk = Desk::new(&more);
    let set = desk.set("play", 0);
    let fire = set.create_action::<bool>("fire", "Fire", &[]).unwrap();
    let pull = set.create_action::<f32>("pull", "Pull", &[]).unwrap();
    let walk = set.create_action::<xr::Vector2f>("walk", "Walk", &[]).unwrap();
    let grip = set.create_action::<xr::Posef>("grip", "Grip", &[]).unwrap();
    let (x, trigger, stick, pose) = (
        "/user/hand/left/input/x/click",
        "/user/hand/left/input/trigger/value",
        "/user/hand/left/input/thumbstick",
        "/user/hand/left/input/grip/pose",
    );
    let bindings =
        [(fire.as_raw(), x), (pull.as_raw(), trigger), (walk.as_raw(), stick), (grip.as_raw(), pose)];
    desk.suggest(TOUCH, &bindings);
    desk.session.attach_action_sets(&[&set]).unwrap();
    let [x, trigger, stick, pose, left, touch, head, other, pad] = [
        x,
        trigger,
        stick,
        pose,
        LEFT,
        TOUCH,
        "/user/head",
        "/interaction_profiles/htc/vive_tracker_htcx",
        "/user/gamepad/input/menu/click",
    ]
    .map(|text| desk.path(text));
    let fp = *desk.app.instance.exts().ext_conformance_automation.as_ref().unwrap();
    let raw = desk.session.as_raw();
    let local =
        desk.session.create_reference_space(xr::ReferenceSpaceType::LOCAL, xr::Posef::IDENTITY).unwrap();
    let space = local.as_raw();
    let to = sys::Vector2f { x: 0.5, y: 0.5 };
    let place = sys::Posef { position: sys::Vector3f { x: 0.1, y: 0.2, z: 0.3 }, ..sys::Posef::IDENTITY };
    let bad_place = sys::Posef { orientation: sys::Quaternionf { x: 0.0, y: 0.0, z: 0.0, w: 0.0 }, ..place };
    macro_rules! check {
        ($($call:expr => $code:ident;)*) => {
            $(
                // SAFETY: the runtime verifies what it is given.
                let got = unsafe { $call };
                assert_eq!(got, R::$code, "{}", stringify!($call));
            )*
        };
    }
    check! {
        // A device that is not there keeps nothing.
        (fp.set_input_device_state_bool)(raw, left, x, sys::TRUE) => SUCCESS;
        (fp.set_input_device_active)(raw, touch, left, sys::TRUE) => SUCCESS;
    }
    desk.sync(&set);
    assert_eq!((desk.profile(LEFT), desk.profile_changes()), (TOUCH.to_owned(), 1));
    assert!(desk.boolean(&fire, "").is_active && !desk.boolean(&fire, "").current_state);
    check! {
        (fp.set_input_device_state_bool)(raw, left, x, sys::TRUE) => SUCCESS;
        (fp.set_input_device_state_float)(raw, left, trigger, 0.75) => SUCCESS;
        (fp.set_input_device_state_vector2f)(raw, left, stick, to) => SUCCESS;
        (fp.set_input_device_location)(raw, left, pose, space, place) => SUCCESS;
        (fp.set_input_device_active)(raw, touch, left, sys::TRUE) => SUCCESS;
    }
    desk.sync(&set);
    assert!(desk.boolean(&fire, "").changed_since_last_sync && desk.boolean(&fire, "").current_state);
    assert_eq!(desk.float(&pull, "").current_state, 0.75);
    assert_eq!(desk.vector(&walk, "").current_state, to);
    let time = desk.frame();
    let own = grip.create_space(&desk.session, xr::Path::NULL, xr::Posef::IDENTITY).unwrap();
    let found = own.locate(&local, time).unwrap().pose.position;
    assert!((found.x - 0.1).abs() + (found.y - 0.2).abs() + (found.z - 0.3).abs() < 1e-5, "{found:?}");
    desk.assert_blameless();

    let null = xr::Path::NULL;
    check! {
        (fp.set_input_device_active)(raw, null, left, sys::TRUE) => ERROR_PATH_INVALID;
        (fp.set_input_device_active)(raw, left, left, sys::TRUE) => ERROR_PATH_UNSUPPORTED;
        (fp.set_input_device_active)(raw, touch, touch, sys::TRUE) => ERROR_PATH_UNSUPPORTED;
        (fp.set_input_device_active)(raw, touch, head, sys::TRUE) => ERROR_PATH_UNSUPPORTED;
        (fp.set_input_device_active)(raw, other, left, sys::TRUE) => ERROR_PATH_UNSUPPORTED;
        (fp.set_input_device_active)(sys::Session::NULL, touch, left, sys::TRUE) => ERROR_HANDLE_INVALID;
        (fp.set_input_device_state_bool)(raw, left, pad, sys::TRUE) => ERROR_PATH_UNSUPPORTED;
        (fp.set_input_device_state_bool)(raw, left, trigger, sys::TRUE) => ERROR_PATH_UNSUPPORTED;
        (fp.set_input_device_state_float)(raw, left, trigger, f32::NAN) => ERROR_VALIDATION_FAILURE;
        (fp.set_input_device_state_bool)(raw, left, x, sys::Bool32::from_raw(2)) => ERROR_VALIDATION_FAILURE;
        (fp.set_input_device_active)(raw, touch, left, sys::Bool32::from_raw(2)) => ERROR_VALIDATION_FAILURE;
        (fp.set_input_device_state_float)(raw, left, null, 0.5) => ERROR_PATH_INVALID;
        (fp.set_input_device_location)(raw, left, pose, space, bad_place) => ERROR_POSE_INVALID;
        (fp.set_input_device_location)(raw, left, pose, sys::Space::NULL, place) => ERROR_HANDLE_INVALID;
        (fp.set_input_device_location)(raw, left, trigger, space, place) => ERROR_PATH_UNSUPPORTED;
        (fp.set_input_device_active)(raw, touch, left, sys::FALSE) => SUCCESS;
    }
    desk.sync(&set);
    assert!(!desk.boolean(&fire, "").is_active);
    assert_eq!(desk.profile(LEFT), "");
    assert_documented(desk.mock());
}

/// The specification's rules for one action with several inputs, applied to one kind of value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Model {
    value: f32,
    active: bool,
    changed: bool,
}

impl Model {
    fn next(self, values: &[f32]) -> Self {
        let best = values.iter().copied().reduce(|a, b| if b.abs() > a.abs() { b } else { a });
        let Some(value) = best else {
            return Self::default();
        };
        Self { value, active: true, changed: self.active && self.value != value }
    }
}

#[derive(Clone, Debug)]
enum Step {
    Axis(usize, i8),
    Button(usize, bool),
    Plug(usize, bool),
    Sync(bool),
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        4 => (0..4usize, -4..=4i8).prop_map(|(axis, value)| Step::Axis(axis, value)),
        3 => (0..4usize, any::<bool>()).prop_map(|(button, on)| Step::Button(button, on)),
        1 => (0..2usize, any::<bool>()).prop_map(|(hand, on)| Step::Plug(hand, on)),
        5 => prop::bool::weighted(0.9).prop_map(Step::Sync),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn many_inputs_make_one_state(steps in prop::collection::vec(step(), 1..60)) {
        let desk = Desk::new(&extensions());
        let set = desk.set("play", 0);
        let axis = set.create_action::<f32>("axis", "Axis", &desk.hands()).unwrap();
        let button = set.create_action::<bool>("button", "Button", &desk.hands()).unwrap();
        let hands = [LEFT, RIGHT];
        let axes: Vec<_> = hands
            .iter()
            .flat_map(|hand| ["x", "y"].map(|name| format!("{hand}/input/thumbstick/{name}")))
            .collect();
        let buttons: Vec<_> = hands
            .iter()
            .flat_map(|hand| ["a", "b"].map(|name| format!("{hand}/input/{name}/click")))
            .collect();
        let bindings: Vec<_> = axes
            .iter()
            .map(|path| (axis.as_raw(), path.as_str()))
            .chain(buttons.iter().map(|path| (button.as_raw(), path.as_str())))
            .collect();
        desk.suggest(INDEX, &bindings);
        desk.session.attach_action_sets(&[&set]).unwrap();
        let (mut axis_values, mut button_values, mut plugged) = ([0f32; 4], [false; 4], [false; 2]);
        let (mut axis_models, mut button_models) = ([Model::default(); 3], [Model::default(); 3]);
        for step in steps {
            match step {
                Step::Axis(i, value) => {
                    let value = f32::from(value) / 4.0;
                    let done = desk.mock().set_input(&axes[i], value);
                    prop_assert_eq!(done.is_ok(), plugged[i / 2]);
                    if done.is_ok() {
                        axis_values[i] = value;
                    }
                }
                Step::Button(i, on) => {
                    let done = desk.mock().set_input(&buttons[i], on);
                    prop_assert_eq!(done.is_ok(), plugged[i / 2]);
                    if done.is_ok() {
                        button_values[i] = on;
                    }
                }
                Step::Plug(i, on) => {
                    if on {
                        desk.mock().connect(hands[i], INDEX).unwrap();
                    } else {
                        desk.mock().disconnect(hands[i]).unwrap();
                    }
                    if !on {
                        axis_values[2 * i..2 * i + 2].fill(0.0);
                        button_values[2 * i..2 * i + 2].fill(false);
                    }
                    plugged[i] = on;
                }
                Step::Sync(with_set) => {
                    if with_set {
                        desk.sync(&set);
                    } else {
                        prop_assert_eq!(desk.try_sync(&[]), R::SUCCESS);
                    }
                    let seen = |hand: usize, slot: usize| {
                        with_set && plugged[hand] && (slot == 0 || slot == hand + 1)
                    };
                    for slot in 0..3 {
                        let of = |i: &usize| seen(i / 2, slot);
                        let values: Vec<_> = (0..4).filter(of).map(|i| axis_values[i]).collect();
                        axis_models[slot] = axis_models[slot].next(&values);
                        let values: Vec<_> =
                            (0..4).filter(of).map(|i| f32::from(u8::from(button_values[i]))).collect();
                        button_models[slot] = button_models[slot].next(&values);
                    }
                }
            }
            for (slot, user_path) in ["", LEFT, RIGHT].into_iter().enumerate() {
                let got = desk.float(&axis, user_path);
                let model = axis_models[slot];
                // Two inputs equally far from 0 are equally good.
                prop_assert_eq!(got.current_state.abs(), model.value.abs());
                prop_assert_eq!((got.is_active, got.changed_since_last_sync), (model.active, model.changed));
                prop_assert_eq!(got.last_change_time.as_nanos() > 0, model.active);
                let got = desk.boolean(&button, user_path);
                let model = button_models[slot];
                prop_assert_eq!(
                    (got.current_state, got.is_active, got.changed_since_last_sync),
                    (model.value != 0.0, model.active, model.changed)
                );
            }
        }
        desk.assert_blameless();
    }
}
