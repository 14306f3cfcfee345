//! Paths, action sets, actions and suggested bindings keep the rules of the specification, and without controllers every
//! input is inactive.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "wrong uses need the raw functions")]

mod mock_support;

use std::{ffi::c_char, ptr};

use fathomless::mock::{
    Mock,
    registry::{self, PROFILES},
};
use mock_support::{App, application, assert_documented, begin, focus, stepped};
use openxr as xr;
use xr::sys::{self, Handle as _, Result as R};

/// `check!(call => CODE)`: the raw call answers with the code.
macro_rules! check {
    ($($call:expr => $code:ident;)*) => {
        $(
            // SAFETY: the runtime verifies what it is given.
            let got = unsafe { $call };
            assert_eq!(got, R::$code, "{}", stringify!($call));
        )*
    };
}

fn error<T>(result: Result<T, R>) -> R {
    match result {
        Ok(_) => R::SUCCESS,
        Err(code) => code,
    }
}

const HANDS: [&str; 2] = ["/user/hand/left", "/user/hand/right"];

#[test]
fn paths() {
    let app = App::new(stepped());
    let path = |text: &str| app.instance.string_to_path(text);
    let left = path(HANDS[0]).unwrap();
    assert_eq!(path(HANDS[0]).unwrap(), left);
    assert_ne!(path(HANDS[1]).unwrap(), left);
    assert_eq!(app.instance.path_to_string(left).unwrap(), HANDS[0]);
    let long = format!("/{}", "a".repeat(255));
    for bad in ["", "/", "user", "/user/", "//a", "/A", "/a b", "/a/..", &long] {
        assert_eq!(error(path(bad)), R::ERROR_PATH_FORMAT_INVALID, "{bad}");
    }
    assert!(path(&long[..255]).is_ok());
    for invented in [0, 1, u64::MAX] {
        let got = app.instance.path_to_string(sys::Path::from_raw(invented));
        assert_eq!(error(got), R::ERROR_PATH_INVALID);
    }
    let (fp, raw) = (app.instance.fp(), app.instance.as_raw());
    let mut count = 0;
    let mut room = [1 as c_char; 16];
    check! {
        (fp.path_to_string)(raw, left, 0, &mut count, ptr::null_mut()) => SUCCESS;
        (fp.path_to_string)(raw, left, 15, &mut count, room.as_mut_ptr()) => ERROR_SIZE_INSUFFICIENT;
        (fp.path_to_string)(raw, left, 16, &mut count, room.as_mut_ptr()) => SUCCESS;
        (fp.path_to_string)(raw, left, 16, ptr::null_mut(), room.as_mut_ptr()) => ERROR_VALIDATION_FAILURE;
        (fp.string_to_path)(raw, ptr::null(), &mut sys::Path::NULL.clone()) => ERROR_VALIDATION_FAILURE;
    }
    assert_eq!((count, room[15]), (16, 0));
}

#[test]
fn sets_and_actions() {
    let app = App::new(stepped());
    let instance = &*app.instance;
    let set = instance.create_action_set("play", "Play", 0).unwrap();
    let names = [
        ("", "x", R::ERROR_NAME_INVALID),
        ("x", "", R::ERROR_LOCALIZED_NAME_INVALID),
        ("Big", "x", R::ERROR_PATH_FORMAT_INVALID),
        ("play", "x", R::ERROR_NAME_DUPLICATED),
        ("x", "Play", R::ERROR_LOCALIZED_NAME_DUPLICATED),
    ];
    for (name, localized, code) in names {
        let got = error(instance.create_action_set(name, localized, 0));
        assert_eq!(got, code, "{name:?} {localized:?}");
    }
    let hands = HANDS.map(|hand| instance.string_to_path(hand).unwrap());
    let odd = instance.string_to_path("/user/foot").unwrap();
    let treadmill = instance.string_to_path("/user/treadmill").unwrap();
    let fire = set.create_action::<bool>("fire", "Fire", &hands).unwrap();
    for (name, localized, subactions, code) in [
        ("fire", "x", &hands[..], R::ERROR_NAME_DUPLICATED),
        ("x", "Fire", &hands, R::ERROR_LOCALIZED_NAME_DUPLICATED),
        ("a/b", "x", &hands, R::ERROR_PATH_FORMAT_INVALID),
        ("x", "x", &[odd], R::ERROR_PATH_UNSUPPORTED),
        ("x", "x", &[hands[0]; 2], R::ERROR_PATH_UNSUPPORTED),
        ("x", "x", &[sys::Path::NULL], R::ERROR_PATH_INVALID),
        ("x", "x", &[treadmill], R::ERROR_PATH_UNSUPPORTED),
    ] {
        let got = error(set.create_action::<bool>(name, localized, subactions));
        assert_eq!(got, code, "{name:?} {localized:?}");
    }
    let path = |text| instance.string_to_path(text).unwrap();
    let simple = path("/interaction_profiles/khr/simple_controller");
    let select = path("/user/hand/left/input/select/click");
    let suggest = |profile, bindings: &[xr::Binding<'_>]| {
        error(instance.suggest_interaction_profile_bindings(profile, bindings))
    };
    assert_eq!(suggest(simple, &[]), R::ERROR_VALIDATION_FAILURE);
    let good = [xr::Binding::new(&fire, select)];
    assert_eq!(suggest(select, &good), R::ERROR_PATH_UNSUPPORTED);
    assert_eq!(suggest(sys::Path::NULL, &good), R::ERROR_PATH_INVALID);
    for bad in [
        "/user/hand/left",
        "/user/hand/left/input",
        "/user/hand/left/input/trigger/click",
        "/user/hand/left/input/select/click/more",
        "/user/hand/left/input/sel",
        "/user/hand/left/input_bad/select/click",
        "/user/hand/left/output",
        "/user/gamepad/input/select/click",
        "/user/hand/middle/input/select/click",
        "/user/hand/left/input/palm_ext/pose",
    ] {
        let bad = [xr::Binding::new(&fire, select), xr::Binding::new(&fire, path(bad))];
        assert_eq!(suggest(simple, &bad), R::ERROR_PATH_UNSUPPORTED);
    }
    for bad in [
        "/interaction_profiles/khr",
        "/interaction_profiles/khr/other",
        "/interaction_profiles/khr/simple_controller/x",
    ] {
        assert_eq!(suggest(path(bad), &good), R::ERROR_PATH_UNSUPPORTED);
    }
    let part = path("/user/hand/left/input/select");
    assert_eq!(suggest(simple, &[xr::Binding::new(&fire, part), xr::Binding::new(&fire, part)]), R::SUCCESS);
    assert_eq!(suggest(simple, &good), R::SUCCESS);

    let (session, ..) = app.session();
    assert_eq!(error(session.attach_action_sets(&[])), R::ERROR_VALIDATION_FAILURE);
    assert_eq!(error(session.current_interaction_profile(hands[0])), R::ERROR_ACTIONSET_NOT_ATTACHED);
    session.attach_action_sets(&[&set]).unwrap();
    assert_eq!(error(session.attach_action_sets(&[&set])), R::ERROR_ACTIONSETS_ALREADY_ATTACHED);
    assert_eq!(session.current_interaction_profile(hands[0]).unwrap(), sys::Path::NULL);
    assert_eq!(error(session.current_interaction_profile(odd)), R::ERROR_PATH_UNSUPPORTED);
    assert_eq!(error(session.current_interaction_profile(sys::Path::NULL)), R::ERROR_PATH_INVALID);
    assert_eq!(session.current_interaction_profile(path("/user/treadmill")).unwrap(), sys::Path::NULL);
    assert_eq!(suggest(simple, &good), R::ERROR_ACTIONSETS_ALREADY_ATTACHED);
    assert_eq!(error(set.create_action::<bool>("late", "Late", &[])), R::ERROR_ACTIONSETS_ALREADY_ATTACHED);
    assert_documented(&app.mock);
}

#[test]
fn states_are_inactive_and_haptics_recorded() {
    let app = App::new(stepped());
    let instance = &*app.instance;
    let hands = HANDS.map(|hand| instance.string_to_path(hand).unwrap());
    let set = instance.create_action_set("play", "Play", 0).unwrap();
    let loose = instance.create_action_set("loose", "Loose", 0).unwrap();
    let fire = set.create_action::<bool>("fire", "Fire", &hands).unwrap();
    let grip = set.create_action::<f32>("grip", "Grip", &[]).unwrap();
    let walk = set.create_action::<xr::Vector2f>("walk", "Walk", &[]).unwrap();
    let aim = set.create_action::<xr::Posef>("aim", "Aim", &hands).unwrap();
    let buzz = set.create_action::<xr::Haptic>("buzz", "Buzz", &hands[..1]).unwrap();
    let stray = loose.create_action::<bool>("stray", "Stray", &[]).unwrap();
    let (session, mut waiter, mut stream) = app.session();
    session.attach_action_sets(&[&set]).unwrap();
    begin(&app, &session);
    let null = sys::Path::NULL;

    let state = fire.state(&session, hands[0]).unwrap();
    assert!(!state.is_active && !state.current_state && !state.changed_since_last_sync);
    assert!(!grip.state(&session, null).unwrap().is_active);
    assert!(!walk.state(&session, null).unwrap().is_active);
    assert!(!aim.is_active(&session, hands[1]).unwrap());
    assert_eq!(error(stray.state(&session, null)), R::ERROR_ACTIONSET_NOT_ATTACHED);
    assert_eq!(error(grip.state(&session, hands[0])), R::ERROR_PATH_UNSUPPORTED);
    let query = |action: sys::Action, path| sys::ActionStateGetInfo {
        ty: sys::ActionStateGetInfo::TYPE,
        next: ptr::null(),
        action,
        subaction_path: path,
    };
    let (fp, raw) = (instance.fp(), session.as_raw());
    let mut float = sys::ActionStateFloat::out(ptr::null_mut());
    let bogus = sys::Path::from_raw(12);
    check! {
        (fp.get_action_state_float)(raw, &query(fire.as_raw(), null), float.as_mut_ptr()) => ERROR_ACTION_TYPE_MISMATCH;
        (fp.get_action_state_float)(raw, &query(sys::Action::NULL, null), float.as_mut_ptr()) => ERROR_HANDLE_INVALID;
        (fp.get_action_state_float)(raw, &query(grip.as_raw(), bogus), float.as_mut_ptr()) => ERROR_PATH_INVALID;
        (fp.get_action_state_float)(raw, &query(grip.as_raw(), null), ptr::null_mut()) => ERROR_VALIDATION_FAILURE;
    }

    // Nothing is synced or felt before the session has the focus.
    let active = [sys::ActiveActionSet { action_set: set.as_raw(), subaction_path: null }];
    let sync = |sets: &[sys::ActiveActionSet]| sys::ActionsSyncInfo {
        ty: sys::ActionsSyncInfo::TYPE,
        next: ptr::null(),
        count_active_action_sets: sets.len() as u32,
        active_action_sets: sets.as_ptr(),
    };
    let stray_set = [sys::ActiveActionSet { action_set: loose.as_raw(), ..active[0] }];
    let head = instance.string_to_path("/user/head").unwrap();
    let headed = [sys::ActiveActionSet { subaction_path: head, ..active[0] }];
    let haptic = sys::HapticActionInfo {
        ty: sys::HapticActionInfo::TYPE,
        next: ptr::null(),
        action: buzz.as_raw(),
        subaction_path: hands[0],
    };
    let wrong_kind = sys::HapticActionInfo { action: fire.as_raw(), ..haptic };
    let vibration = sys::HapticVibration {
        ty: sys::HapticVibration::TYPE,
        next: ptr::null(),
        duration: sys::Duration::MIN_HAPTIC,
        frequency: 0.0,
        amplitude: 0.5,
    };
    let loud = sys::HapticVibration { amplitude: 1.5, ..vibration };
    let header = (&raw const vibration).cast();
    let too_loud = (&raw const loud).cast();
    check! {
        (fp.sync_actions)(raw, &sync(&active)) => SESSION_NOT_FOCUSED;
        (fp.apply_haptic_feedback)(raw, &haptic, header) => SESSION_NOT_FOCUSED;
    }
    assert_eq!(app.mock.haptics(), []);
    focus(&app, &mut waiter, &mut stream);
    check! {
        (fp.sync_actions)(raw, &sync(&active)) => SUCCESS;
        (fp.sync_actions)(raw, &sync(&[])) => SUCCESS;
        (fp.sync_actions)(raw, &sync(&stray_set)) => ERROR_ACTIONSET_NOT_ATTACHED;
        (fp.sync_actions)(raw, &sync(&headed)) => ERROR_PATH_UNSUPPORTED;
        (fp.apply_haptic_feedback)(raw, &haptic, header) => SUCCESS;
        (fp.apply_haptic_feedback)(raw, &haptic, too_loud) => ERROR_VALIDATION_FAILURE;
        (fp.apply_haptic_feedback)(raw, &wrong_kind, header) => ERROR_ACTION_TYPE_MISMATCH;
        (fp.stop_haptic_feedback)(raw, &haptic) => SUCCESS;
    }
    let felt = app.mock.haptics();
    assert_eq!(felt.len(), 2);
    assert_eq!(felt[0].action, "buzz");
    assert_eq!(felt[0].subaction.as_deref(), Some(HANDS[0]));
    assert_eq!((felt[0].duration_ns, felt[0].amplitude), (Some(-1), 0.5));
    assert_eq!(felt[1].duration_ns, None);
    assert!(felt[0].outputs.is_empty(), "no device is there to feel it");

    // The device of a pose action is nowhere.
    let space = aim.create_space(&session, hands[0], xr::Posef::IDENTITY).unwrap();
    let base = session.create_reference_space(xr::ReferenceSpaceType::LOCAL, xr::Posef::IDENTITY).unwrap();
    let location = space.locate(&base, xr::Time::from_nanos(1)).unwrap();
    assert!(location.location_flags.is_empty());
    let pose = |action: sys::Action| sys::ActionSpaceCreateInfo {
        ty: sys::ActionSpaceCreateInfo::TYPE,
        next: ptr::null(),
        action,
        subaction_path: null,
        pose_in_action_space: xr::Posef::IDENTITY,
    };
    let mut out = sys::Space::NULL;
    check! {
        (fp.create_action_space)(raw, &pose(fire.as_raw()), &mut out) => ERROR_ACTION_TYPE_MISMATCH;
        (fp.create_action_space)(raw, &pose(sys::Action::NULL), &mut out) => ERROR_HANDLE_INVALID;
        (fp.create_action_space)(raw, &pose(stray.as_raw()), &mut out) => ERROR_ACTION_TYPE_MISMATCH;
    }

    let click = instance.string_to_path("/user/hand/left/input/select/click").unwrap();
    assert_eq!(
        session.input_source_localized_name(click, xr::InputSourceLocalizedNameFlags::COMPONENT).unwrap(),
        "Select"
    );
    assert_eq!(
        error(session.input_source_localized_name(hands[0], xr::InputSourceLocalizedNameFlags::COMPONENT)),
        R::ERROR_PATH_UNSUPPORTED
    );
    assert_eq!(
        error(session.input_source_localized_name(click, xr::InputSourceLocalizedNameFlags::EMPTY)),
        R::ERROR_VALIDATION_FAILURE
    );
    let enumerate = sys::BoundSourcesForActionEnumerateInfo {
        ty: sys::BoundSourcesForActionEnumerateInfo::TYPE,
        next: ptr::null(),
        action: fire.as_raw(),
    };
    let mut count = 7;
    check! {
        (fp.enumerate_bound_sources_for_action)(raw, &enumerate, 0, &mut count, ptr::null_mut()) => SUCCESS;
    }
    assert_eq!(count, 0);
    assert_documented(&app.mock);
}

/// Every profile and component of the registry can be bound exactly when version and extensions offer it.
fn check_suggestions(minor: u16, extensions: &xr::ExtensionSet) -> usize {
    let mock = Mock::new(stepped());
    let instance = mock.entry().unwrap().create_instance(&application(minor), extensions, &[], &()).unwrap();
    let names: Vec<String> = extensions.names().iter().map(|name| text(name)).collect();
    let has = |name: &str| names.iter().any(|known| known == name);
    let is_offered = |needs| registry::is_offered(needs, (1, minor), has);
    let set = instance.create_action_set("all", "All", 0).unwrap();
    let press = set.create_action::<bool>("press", "Press", &[]).unwrap();
    let mut accepted = 0;
    for profile in PROFILES {
        let path = instance.string_to_path(profile.path).unwrap();
        for component in profile.components {
            for user_path in profile.user_paths.iter().filter(|user_path| component.is_at(user_path)) {
                let binding = instance.string_to_path(&format!("{user_path}{}", component.subpath)).unwrap();
                // The action's type does not matter: what cannot be converted stays unbound.
                let got = error(
                    instance.suggest_interaction_profile_bindings(path, &[xr::Binding::new(&press, binding)]),
                );
                let good = is_offered(profile.needs) && is_offered(component.needs);
                let wanted = if good { R::SUCCESS } else { R::ERROR_PATH_UNSUPPORTED };
                assert_eq!(got, wanted, "1.{minor} {} {}", profile.path, component.subpath);
                accepted += usize::from(good);
            }
        }
    }
    accepted
}

fn text(name: &[u8]) -> String {
    String::from_utf8(name.to_vec()).unwrap().trim_end_matches('\0').to_owned()
}

#[test]
fn bindings_are_those_that_version_and_extensions_offer() {
    let none = xr::ExtensionSet::default();
    let old = check_suggestions(0, &none);
    let new = check_suggestions(1, &none);
    let mut more = xr::ExtensionSet::default();
    more.ext_palm_pose = true;
    more.ext_hand_interaction = true;
    more.htc_vive_cosmos_controller_interaction = true;
    let old_with = check_suggestions(0, &more);
    let new_with = check_suggestions(1, &more);
    assert!(100 < old && old < old_with && old < new && new < new_with, "{old} {old_with} {new} {new_with}");
}
