//! Whatever a function is given first, a null, stale, invented or wrong handle, it says so and does nothing; and what a
//! good handle comes with may be missing. No function falls over, none is left out.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "functions called as no application should")]

mod mock_support;

use std::ffi::CString;

use fathomless::mock::{Mock, MockConfig, function_names};
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

/// All functions of an instance except `xrGetInstanceProcAddr`.
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
    function_names().filter(|name| *name != "xrGetInstanceProcAddr").map(find).collect()
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
            // These have no handle: their first argument is a pointer or a capacity.
            if name.starts_with("xrCreateInstance")
                || name.starts_with("xrEnumerateInstance")
                || name.contains("ApiLayer")
            {
                continue;
            }
            // SAFETY: nothing but the first argument is looked at before that is found out.
            let code = unsafe { function(handle, 0, 0, 0, 0, 0, 0, 0) };
            assert_eq!(code, R::ERROR_HANDLE_INVALID, "{name}({handle:#x})");
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
        if whole.iter().any(|part| name.contains(part))
            || name.contains("InstanceExt")
            || name.contains("ApiLayer")
        {
            continue;
        }
        let before = app.mock.violations().len();
        let codes = handles.map(|(_, handle)| {
            // SAFETY: null pointers are found out, capacities of 0 need no room.
            unsafe { function(handle, 0, 0, 0, 0, 0, 0, 0) }
        });
        assert!(codes.iter().all(|code| code.into_raw() < 0), "{name}: {codes:?}");
        assert!(codes.iter().all(|code| *code != R::ERROR_RUNTIME_FAILURE), "{name}: {codes:?}");
        assert!(app.mock.violations().len() > before, "{name}");
    }
    // Nothing of it did anything.
    empty_frame(&mut waiter, &mut stream);
}
