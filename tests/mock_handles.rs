//! No handle, however wrong, crashes the runtime: stale, foreign, of another kind or invented, it is
//! XR_ERROR_HANDLE_INVALID.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "wrong handles need the raw functions")]

mod mock_support;

use std::{
    mem::MaybeUninit,
    ptr::{self, null_mut},
};

use fathomless::mock::Mock;
use mock_support::{App, begin, stepped};
use openxr as xr;
use proptest::prelude::*;
use xr::sys::{self, Handle, Result as R};

/// Calls every function that takes a handle first, with this number; the codes that came back.
fn call_all(fp: &xr::raw::Instance, number: u64) -> Vec<(&'static str, R)> {
    let (instance, session) = (sys::Instance::from_raw(number), sys::Session::from_raw(number));
    let (space, swapchain) = (sys::Space::from_raw(number), sys::Swapchain::from_raw(number));
    let (set, action) = (sys::ActionSet::from_raw(number), sys::Action::from_raw(number));
    let system = sys::SystemId::from_raw(1);
    let mut count = 0u32;
    let mut path = sys::Path::NULL;
    let mut buffer = MaybeUninit::<sys::EventDataBuffer>::zeroed();
    let (stereo, time) = (mock_support::STEREO, sys::Time::from_nanos(1));
    let mut text = [0; 64];
    macro_rules! calls {
        ($($name:ident($($arg:expr),*);)*) => {
            // SAFETY: the runtime looks at the handle first.
            vec![$((stringify!($name), unsafe { (fp.$name)($($arg),*) }),)*]
        };
    }
    calls! {
        destroy_instance(instance);
        get_instance_properties(instance, null_mut());
        poll_event(instance, buffer.as_mut_ptr());
        get_system(instance, ptr::null(), null_mut());
        get_system_properties(instance, system, null_mut());
        enumerate_view_configurations(instance, system, 0, &mut count, null_mut());
        enumerate_environment_blend_modes(instance, system, stereo, 0, &mut count, null_mut());
        get_view_configuration_properties(instance, system, stereo, null_mut());
        enumerate_view_configuration_views(instance, system, stereo, 0, &mut count, null_mut());
        result_to_string(instance, R::SUCCESS, text.as_mut_ptr());
        structure_type_to_string(instance, sys::View::TYPE, text.as_mut_ptr());
        string_to_path(instance, c"/user".as_ptr(), &mut path);
        path_to_string(instance, path, 0, &mut count, null_mut());
        create_session(instance, ptr::null(), null_mut());
        create_action_set(instance, ptr::null(), null_mut());
        suggest_interaction_profile_bindings(instance, ptr::null());
        destroy_session(session);
        begin_session(session, ptr::null());
        end_session(session);
        request_exit_session(session);
        enumerate_reference_spaces(session, 0, &mut count, null_mut());
        create_reference_space(session, ptr::null(), null_mut());
        get_reference_space_bounds_rect(session, sys::ReferenceSpaceType::STAGE, null_mut());
        create_action_space(session, ptr::null(), null_mut());
        locate_views(session, ptr::null(), null_mut(), 0, &mut count, null_mut());
        enumerate_swapchain_formats(session, 0, &mut count, null_mut());
        create_swapchain(session, ptr::null(), null_mut());
        wait_frame(session, ptr::null(), null_mut());
        begin_frame(session, ptr::null());
        end_frame(session, ptr::null());
        attach_session_action_sets(session, ptr::null());
        get_current_interaction_profile(session, path, null_mut());
        get_action_state_boolean(session, ptr::null(), null_mut());
        get_action_state_float(session, ptr::null(), null_mut());
        get_action_state_vector2f(session, ptr::null(), null_mut());
        get_action_state_pose(session, ptr::null(), null_mut());
        sync_actions(session, ptr::null());
        enumerate_bound_sources_for_action(session, ptr::null(), 0, &mut count, null_mut());
        get_input_source_localized_name(session, ptr::null(), 0, &mut count, null_mut());
        apply_haptic_feedback(session, ptr::null(), ptr::null());
        stop_haptic_feedback(session, ptr::null());
        locate_space(space, space, time, null_mut());
        destroy_space(space);
        destroy_swapchain(swapchain);
        enumerate_swapchain_images(swapchain, 0, &mut count, null_mut());
        acquire_swapchain_image(swapchain, ptr::null(), null_mut());
        wait_swapchain_image(swapchain, ptr::null());
        release_swapchain_image(swapchain, ptr::null());
        destroy_action_set(set);
        create_action(set, ptr::null(), null_mut());
        destroy_action(action);
    }
}

fn assert_invalid(fp: &xr::raw::Instance, number: u64) {
    for (function, code) in call_all(fp, number) {
        assert_eq!(code, R::ERROR_HANDLE_INVALID, "{function}({number:#x})");
    }
}

fn instance(mock: &Mock) -> xr::Instance {
    mock.entry()
        .unwrap()
        .create_instance(&mock_support::application(1), &mock_support::extensions(), &[], &())
        .unwrap()
}

#[test]
fn invented_handles() {
    let mock = Mock::new(stepped());
    let instance = instance(&mock);
    let alive = instance.as_raw().into_raw();
    for number in [0, 1, 2, u64::MAX, 0xDEAD_BEEF, alive ^ 1, alive + 1, !alive] {
        assert_invalid(instance.fp(), number);
    }
    proptest!(ProptestConfig::with_cases(2_000), |(number in any::<u64>(), bit in 0u32..64)| {
        prop_assume!(number != alive);
        assert_invalid(instance.fp(), number);
        assert_invalid(instance.fp(), alive ^ (1 << bit));
    });
    assert!(instance.properties().is_ok(), "the runtime still lives");
    let violations = mock.violations();
    assert!(violations.iter().any(|it| it.text.contains("XR_NULL_HANDLE")));
}

#[test]
fn foreign_and_stale_handles() {
    let (one, other) = (Mock::new(stepped()), Mock::new(stepped()));
    let (mine, theirs) = (instance(&one), instance(&other));
    assert_invalid(mine.fp(), theirs.as_raw().into_raw());
    assert_eq!(other.violations(), [], "the other runtime knows nothing of it");
    let second = instance(&one);
    let stale = second.as_raw().into_raw();
    drop(second);
    assert_invalid(mine.fp(), stale);
    // Its slot is taken again, by another generation.
    let third = instance(&one);
    assert_ne!(third.as_raw().into_raw(), stale);
    assert_invalid(mine.fp(), stale);
}

#[test]
fn handles_of_another_kind() {
    let app = App::new(stepped());
    let (session, ..) = app.session();
    begin(&app, &session);
    let space = session.create_reference_space(xr::ReferenceSpaceType::VIEW, xr::Posef::IDENTITY).unwrap();
    let number = space.as_raw().into_raw();
    for (function, code) in call_all(app.instance.fp(), number) {
        match function {
            // A null place, then a proper goodbye.
            "locate_space" => assert_eq!(code, R::ERROR_VALIDATION_FAILURE),
            "destroy_space" => assert_eq!(code, R::SUCCESS),
            _ => assert_eq!(code, R::ERROR_HANDLE_INVALID, "{function}"),
        }
    }
    let looks = app.mock.violations();
    assert!(looks.iter().any(|it| it.text.contains("looks like an XrSpace")));
}

#[test]
fn leaked_handles_are_counted() {
    let app = App::new(stepped());
    let (session, waiter, stream) = app.session();
    let space = session.create_reference_space(xr::ReferenceSpaceType::VIEW, xr::Posef::IDENTITY).unwrap();
    let set = app.instance.create_action_set("a", "A", 0).unwrap();
    let fp = app.instance.fp();
    let destroy = fp.destroy_instance;
    let number = app.instance.as_raw();
    std::mem::forget((space, session, waiter, stream, set));
    // SAFETY: the runtime verifies the handle.
    assert_eq!(unsafe { destroy(number) }, R::SUCCESS);
    let kinds: Vec<_> = app.mock.leaks().iter().map(|leak| leak.kind).collect();
    assert_eq!(kinds, ["XrSpace", "XrSession", "XrActionSet"]);
    assert_eq!(*app.messages(), Vec::<String>::new());
}
