//! Whatever a function is given first, a null, stale, invented or wrong handle, it says so and does nothing; and what a
//! good handle comes with may be missing. No function falls over, none is left out.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "functions called as no application should")]

mod mock_support;

use std::ffi::CString;

use fathomless::mock::{Mock, MockConfig, function_names, registry};
use mock_support::{App, empty_frame, stepped};
use openxr as xr;
use xr::sys::{self, Handle as _, Result as R};

/// Every argument of every function fits into these registers and stack places.
type Any = unsafe extern "system" fn(u64, u64, u64, u64, u64, u64, u64, u64) -> R;

/// An application with everything the runtime offers.
fn greedy() -> App {
    let mock = Mock::new(MockConfig { read_back: false, ..stepped() });
    let offered = mock.entry().unwrap().enumerate_extensions().unwrap();
    App::with_extensions(mock, &offered)
}

/// These have no handle: their first argument is a pointer or a capacity.
const WITHOUT_HANDLE: [&str; 3] =
    ["xrCreateInstance", "xrEnumerateInstanceExtensionProperties", "xrEnumerateApiLayerProperties"];

/// All functions of an instance that take a handle, except `xrGetInstanceProcAddr`.
fn functions(app: &App) -> Vec<(&'static str, Any)> {
    let get = app.mock.get_instance_proc_addr().unwrap();
    let find = |name: &'static str| {
        let text = CString::new(name).unwrap();
        let mut function = None;
        // SAFETY: the runtime verifies what it is given.
        let code = unsafe { get(app.instance.as_raw(), text.as_ptr(), &mut function) };
        assert_eq!(code, R::SUCCESS, "{name}");
        // SAFETY: C functions take more arguments than they have names for.
        (name, unsafe { std::mem::transmute::<sys::pfn::VoidFunction, Any>(function.unwrap()) })
    };
    function_names()
        .filter(|name| *name != "xrGetInstanceProcAddr" && !WITHOUT_HANDLE.contains(name))
        .map(find)
        .collect()
}

/// The registry knows the function, and lists the error among those it can return.
fn assert_documented(name: &str, code: R) {
    let command = registry::command(name).unwrap();
    assert!(command.errors.contains(&code.into_raw()), "{name} may not return {code:?}");
}

#[test]
fn handles_that_mean_nothing() {
    let app = greedy();
    let (session, ..) = app.session();
    let space = session.create_reference_space(xr::ReferenceSpaceType::VIEW, xr::Posef::IDENTITY).unwrap();
    let stale = space.as_raw().into_raw();
    drop(space);
    let other = greedy();
    let foreign = other.instance.as_raw().into_raw();
    for (name, function) in functions(&app) {
        for handle in [0, 1, stale, foreign, 0x7FFF_FFFF_FFFF_FFFF, u64::MAX] {
            // SAFETY: nothing but the first argument is looked at before that is found out.
            let code = unsafe { function(handle, 0, 0, 0, 0, 0, 0, 0) };
            assert_eq!(code, R::ERROR_HANDLE_INVALID, "{name}({handle:#x})");
            assert_documented(name, code);
        }
    }
    assert_eq!(app.mock.session_state(), Some(xr::SessionState::READY));
}

#[test]
fn good_handles_with_nothing_else() {
    let app = greedy();
    let (session, mut waiter, mut stream) = app.session();
    mock_support::begin(&app, &session);
    empty_frame(&mut waiter, &mut stream);
    let space = session.create_reference_space(xr::ReferenceSpaceType::VIEW, xr::Posef::IDENTITY).unwrap();
    let handles = [
        ("XrInstance", app.instance.as_raw().into_raw()),
        ("XrSession", session.as_raw().into_raw()),
        ("XrSpace", space.as_raw().into_raw()),
    ];
    for (name, function) in functions(&app) {
        // What these do they do without a second argument, and rightly.
        let whole =
            ["xrDestroy", "xrEndSession", "xrRequestExit", "xrBeginFrame", "LabelRegionEXT", "RefreshRateFB"];
        if whole.iter().any(|part| name.contains(part)) {
            continue;
        }
        let before = app.mock.violations().len();
        let codes = handles.map(|(_, handle)| {
            // SAFETY: null pointers are found out, capacities of 0 need no room.
            unsafe { function(handle, 0, 0, 0, 0, 0, 0, 0) }
        });
        assert!(codes.iter().all(|code| code.into_raw() < 0), "{name}: {codes:?}");
        assert!(codes.iter().all(|code| *code != R::ERROR_RUNTIME_FAILURE), "{name}: {codes:?}");
        codes.iter().for_each(|code| assert_documented(name, *code));
        assert!(app.mock.violations().len() > before, "{name}");
    }
    // Nothing of it did anything.
    empty_frame(&mut waiter, &mut stream);
}

/// The functions that know a handle, that is, take it for what it is; without those that end something.
fn knowing(app: &App, handle: u64) -> Vec<(&'static str, Any)> {
    let ends = ["xrDestroy", "xrEndSession", "xrRequestExit", "xrBeginFrame", "LabelRegionEXT"];
    let mut all = functions(app);
    all.retain(|(name, function)| {
        let whole = ends.iter().any(|part| name.contains(part));
        // SAFETY: null pointers are found out, capacities of 0 need no room.
        let knows = || unsafe { function(handle, 0, 0, 0, 0, 0, 0, 0) } != R::ERROR_HANDLE_INVALID;
        !whole && knows()
    });
    all
}

#[test]
fn every_function_knows_a_lost_session() {
    let app = greedy();
    let (session, ..) = app.session();
    let raw = session.as_raw().into_raw();
    let functions = knowing(&app, raw);
    assert!(functions.len() > 30, "{}", functions.len());
    app.mock.kill_session();
    for (name, function) in functions {
        // SAFETY: as in `knowing`.
        let code = unsafe { function(raw, 0, 0, 0, 0, 0, 0, 0) };
        assert_eq!(code, R::ERROR_SESSION_LOST, "{name}");
        assert_documented(name, code);
    }
}

#[test]
fn every_function_knows_a_lost_instance() {
    let app = greedy();
    let (session, ..) = app.session();
    let handles = [app.instance.as_raw().into_raw(), session.as_raw().into_raw()];
    let functions = handles.map(|handle| (handle, knowing(&app, handle)));
    app.mock.lose_instance(std::time::Duration::ZERO);
    for (handle, functions) in functions {
        assert!(functions.len() > 20, "{}", functions.len());
        for (name, function) in functions {
            // SAFETY: as in `knowing`.
            let code = unsafe { function(handle, 0, 0, 0, 0, 0, 0, 0) };
            assert_eq!(code, R::ERROR_INSTANCE_LOST, "{name}");
            assert_documented(name, code);
        }
    }
}
