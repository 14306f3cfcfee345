//! The extensions of the mock do what the specification says, for those instances that enabled them and no others.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "raw functions and callbacks")]

mod mock_support;

use std::{
    ffi::{CStr, CString, c_long, c_void},
    ptr,
    sync::Mutex,
};

use fathomless::mock::{Clock, Fov, Mask, Mock, MockConfig};
use mock_support::{App, STEREO, application, assert_documented, begin, empty_frame, extensions, stepped};
use openxr as xr;
use xr::{
    SessionState as S,
    sys::{self, Handle as _, Result as R},
};

const VISIBILITY_MASK: &CStr = c"XR_KHR_visibility_mask";

/// A function by its name, with the type the caller says; or why there is none.
///
/// # Safety
/// `F` is the function's type.
unsafe fn try_function<F>(mock: &Mock, instance: sys::Instance, name: &CStr) -> Result<F, R> {
    let mut function = None;
    let get = mock.get_instance_proc_addr().unwrap();
    // SAFETY: the runtime verifies what it is given.
    match unsafe { get(instance, name.as_ptr(), &mut function) } {
        // SAFETY: the caller's promise; both are function pointers.
        R::SUCCESS => Ok(unsafe { std::mem::transmute_copy(&function.unwrap()) }),
        code => {
            assert!(function.is_none());
            Err(code)
        }
    }
}

unsafe fn function<F>(app: &App, name: &CStr) -> F {
    // SAFETY: the caller's promise.
    unsafe { try_function(&app.mock, app.instance.as_raw(), name) }.unwrap()
}

fn app_with(config: MockConfig, enable: impl FnOnce(&mut xr::ExtensionSet)) -> App {
    let mut wanted = extensions();
    enable(&mut wanted);
    App::with_extensions(Mock::new(config), &wanted)
}

#[test]
fn functions_need_their_extension() {
    let app = App::new(stepped());
    for name in [
        c"xrGetVisibilityMaskKHR",
        c"xrEnumerateDisplayRefreshRatesFB",
        c"xrPerfSettingsSetPerformanceLevelEXT",
        c"xrConvertTimeToTimespecTimeKHR",
        c"xrLocateSpacesKHR",
        c"xrCreateDebugUtilsMessengerEXT",
    ] {
        // SAFETY: never called.
        let got = unsafe { try_function::<sys::pfn::VoidFunction>(&app.mock, app.instance.as_raw(), name) };
        assert_eq!(got.err(), Some(R::ERROR_FUNCTION_UNSUPPORTED), "{name:?}");
        // SAFETY: never called.
        let got = unsafe { try_function::<sys::pfn::VoidFunction>(&app.mock, sys::Instance::NULL, name) };
        assert_eq!(got.err(), Some(R::ERROR_HANDLE_INVALID), "{name:?}");
    }
    let gone = Mock::new(MockConfig {
        absent_extensions: vec![VISIBILITY_MASK.to_str().unwrap().into()],
        ..stepped()
    });
    assert!(!gone.entry().unwrap().enumerate_extensions().unwrap().khr_visibility_mask);
}

#[test]
fn refresh_rates_are_asked_for() {
    let config = MockConfig { refresh_rates_hz: vec![120.0, 72.0], ..stepped() };
    let app = app_with(config, |it| it.fb_display_refresh_rate = true);
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    assert_eq!(session.enumerate_display_refresh_rates().unwrap(), [72.0, 100.0, 120.0]);
    assert_eq!(session.get_display_refresh_rate().unwrap(), 100.0);
    assert_eq!(
        session.request_display_refresh_rate(90.0).err(),
        Some(R::ERROR_DISPLAY_REFRESH_RATE_UNSUPPORTED_FB)
    );
    session.request_display_refresh_rate(72.0).unwrap();
    assert_eq!(session.get_display_refresh_rate().unwrap(), 72.0);
    let period = empty_frame(&mut waiter, &mut stream).predicted_display_period.as_nanos();
    assert_eq!(period, 13_888_889);
    session.request_display_refresh_rate(0.0).unwrap();
    assert_eq!(session.get_display_refresh_rate().unwrap(), 100.0, "the runtime's own choice");
    let mut buffer = xr::EventDataBuffer::new();
    let mut changes = Vec::new();
    while let Some(event) = app.instance.poll_event(&mut buffer).unwrap() {
        if let xr::Event::DisplayRefreshRateChangedFB(change) = event {
            changes.push((change.from_display_refresh_rate(), change.to_display_refresh_rate()));
        }
    }
    assert_eq!(changes, [(100.0, 72.0), (72.0, 100.0)]);
    assert_documented(&app.mock);
}

#[test]
fn the_visibility_mask_has_three_shapes() {
    let app = app_with(stepped(), |it| it.khr_visibility_mask = true);
    let (session, ..) = app.session();
    // SAFETY: the name says which function it is.
    let get: sys::pfn::GetVisibilityMaskKHR = unsafe { function(&app, c"xrGetVisibilityMaskKHR") };
    let ask = |view, kind, vertices: &mut [sys::Vector2f], indices: &mut [u32]| {
        let mut mask = sys::VisibilityMaskKHR {
            ty: sys::VisibilityMaskKHR::TYPE,
            next: ptr::null_mut(),
            vertex_capacity_input: vertices.len() as u32,
            vertex_count_output: 0,
            vertices: vertices.as_mut_ptr(),
            index_capacity_input: indices.len() as u32,
            index_count_output: 0,
            indices: indices.as_mut_ptr(),
        };
        // SAFETY: the capacities are true.
        let code = unsafe { get(session.as_raw(), STEREO, view, kind, &mut mask) };
        (code, mask.vertex_count_output as usize, mask.index_count_output as usize)
    };
    let MockConfig { fov, .. } = stepped();
    for (kind, counts) in [
        (sys::VisibilityMaskTypeKHR::HIDDEN_TRIANGLE_MESH, (12, 12)),
        (sys::VisibilityMaskTypeKHR::VISIBLE_TRIANGLE_MESH, (8, 18)),
        (sys::VisibilityMaskTypeKHR::LINE_LOOP, (8, 8)),
    ] {
        for view in [0, 1] {
            let (code, vertex_count, index_count) = ask(view, kind, &mut [], &mut []);
            assert_eq!((code, vertex_count, index_count), (R::SUCCESS, counts.0, counts.1));
            let mut vertices = vec![sys::Vector2f { x: f32::NAN, y: f32::NAN }; vertex_count];
            let mut indices = vec![u32::MAX; index_count];
            let short = ask(view, kind, &mut vertices[1..], &mut indices);
            assert_eq!(short, (R::ERROR_SIZE_INSUFFICIENT, vertex_count, index_count));
            let short = ask(view, kind, &mut vertices, &mut indices[1..]);
            assert_eq!(short, (R::ERROR_SIZE_INSUFFICIENT, vertex_count, index_count));
            assert!(vertices.iter().all(|it| it.x.is_nan()), "nothing is written when there is no room");
            assert_eq!(ask(view, kind, &mut vertices, &mut indices).0, R::SUCCESS);
            assert!(indices.iter().all(|index| (*index as usize) < vertex_count));
            let Fov { left, right, up, down } = fov[view as usize];
            for vertex in &vertices {
                let inside = |x: f32, low: f32, high: f32| x >= low.tan() - 1e-5 && x <= high.tan() + 1e-5;
                assert!(inside(vertex.x, left, right) && inside(vertex.y, down, up), "{vertex:?}");
            }
        }
    }
    let hidden = sys::VisibilityMaskTypeKHR::HIDDEN_TRIANGLE_MESH;
    assert_eq!(ask(2, hidden, &mut [], &mut []).0, R::ERROR_VALIDATION_FAILURE);
    let unknown = sys::VisibilityMaskTypeKHR::from_raw(9);
    assert_eq!(ask(0, unknown, &mut [], &mut []).0, R::ERROR_VALIDATION_FAILURE);
    app.mock.perform(fathomless::mock::Act::Mask(Mask::Empty));
    assert_eq!(ask(0, hidden, &mut [], &mut []), (R::SUCCESS, 0, 0));
    assert_documented(&app.mock);
}

type ToTimespec = unsafe extern "system" fn(sys::Instance, sys::Time, *mut [c_long; 2]) -> R;
type FromTimespec = unsafe extern "system" fn(sys::Instance, *const [c_long; 2], *mut sys::Time) -> R;

#[test]
fn times_become_timespecs_and_back() {
    for clock in [Clock::Real { hz: 90.0 }, Clock::Stepped { hz: 90.0 }] {
        let app = app_with(MockConfig { clock, ..stepped() }, |it| it.khr_convert_timespec_time = true);
        let (session, mut waiter, mut stream) = app.session();
        begin(&app, &session);
        // SAFETY: the names say which functions they are; a timespec is two longs.
        let (to, from): (ToTimespec, FromTimespec) = unsafe {
            (
                function(&app, c"xrConvertTimeToTimespecTimeKHR"),
                function(&app, c"xrConvertTimespecTimeToTimeKHR"),
            )
        };
        let to = |nanos| {
            let mut timespec = [-7; 2];
            // SAFETY: the runtime verifies what it is given.
            let code = unsafe { to(app.instance.as_raw(), sys::Time::from_nanos(nanos), &mut timespec) };
            (code, timespec)
        };
        let from = |timespec: [c_long; 2]| {
            let mut time = sys::Time::from_nanos(-7);
            // SAFETY: as above.
            let code = unsafe { from(app.instance.as_raw(), &timespec, &mut time) };
            (code, time.as_nanos())
        };
        for nanos in [1, 999_999_999, 1_000_000_000, 123_456_789_012_345, i64::MAX] {
            let (code, timespec) = to(nanos);
            assert_eq!((code, timespec[0] * 1_000_000_000 + timespec[1]), (R::SUCCESS, nanos));
            assert_eq!(from(timespec), (R::SUCCESS, nanos));
        }
        for nanos in [0, -1, i64::MIN] {
            assert_eq!(to(nanos), (R::ERROR_TIME_INVALID, [-7; 2]));
        }
        for wrong in [[1, -1], [1, 1_000_000_000], [-1, 5], [i64::MAX, 0], [0, 0]] {
            assert_eq!(from(wrong), (R::ERROR_TIME_INVALID, -7), "{wrong:?}");
        }
        assert_documented(&app.mock);
        let now = app.instance.now().unwrap().as_nanos();
        assert!(now > 0);
        if matches!(clock, Clock::Real { .. }) {
            // The crate reads the system's monotonic clock; that is the runtime's too.
            let shown = empty_frame(&mut waiter, &mut stream).predicted_display_time.as_nanos();
            assert!((0..60_000_000_000).contains(&(shown - now)), "{shown} {now}");
        }
    }
}

#[test]
fn spaces_are_located_together_in_old_versions_too() {
    let mut wanted = extensions();
    wanted.khr_locate_spaces = true;
    let mock = Mock::new(MockConfig { max_api_version: (1, 0), ..stepped() });
    let entry = mock.entry().unwrap();
    let instance = entry.create_instance(&application(0), &wanted, &[], &()).unwrap();
    // SAFETY: the name says which function it is; it is called with handles that mean nothing.
    unsafe {
        let locate: sys::pfn::LocateSpaces =
            try_function(&mock, instance.as_raw(), c"xrLocateSpacesKHR").unwrap();
        assert_eq!(locate(sys::Session::NULL, ptr::null(), ptr::null_mut()), R::ERROR_HANDLE_INVALID);
        let core = try_function::<sys::pfn::LocateSpaces>(&mock, instance.as_raw(), c"xrLocateSpaces");
        assert_eq!(core.err(), Some(R::ERROR_FUNCTION_UNSUPPORTED));
    }
}

#[test]
fn performance_levels_are_recorded() {
    let app = app_with(stepped(), |it| it.ext_performance_settings = true);
    let (session, ..) = app.session();
    // SAFETY: the name says which function it is.
    let set: sys::pfn::PerfSettingsSetPerformanceLevelEXT =
        unsafe { function(&app, c"xrPerfSettingsSetPerformanceLevelEXT") };
    use sys::{PerfSettingsDomainEXT as Domain, PerfSettingsLevelEXT as Level};
    // SAFETY: the runtime verifies what it is given.
    let set = |domain, level| unsafe { set(session.as_raw(), domain, level) };
    assert_eq!(app.mock.performance_levels(), [None; 2]);
    assert_eq!(set(Domain::GPU, Level::BOOST), R::SUCCESS);
    assert_eq!(set(Domain::CPU, Level::POWER_SAVINGS), R::SUCCESS);
    assert_eq!(set(Domain::from_raw(3), Level::BOOST), R::ERROR_VALIDATION_FAILURE);
    assert_eq!(set(Domain::CPU, Level::from_raw(30)), R::ERROR_VALIDATION_FAILURE);
    assert_eq!(app.mock.performance_levels(), [Some(Level::POWER_SAVINGS), Some(Level::BOOST)]);
    assert_documented(&app.mock);
}

#[test]
fn the_system_says_whether_it_senses_presence() {
    for sensed in [true, false] {
        let app = app_with(MockConfig { user_presence: sensed, ..stepped() }, |it| {
            it.ext_user_presence = true;
        });
        let mut presence = sys::SystemUserPresencePropertiesEXT {
            ty: sys::SystemUserPresencePropertiesEXT::TYPE,
            next: ptr::null_mut(),
            supports_user_presence: sys::Bool32::from_raw(7),
        };
        let mut properties = sys::SystemProperties::out((&raw mut presence).cast());
        // SAFETY: the runtime verifies what it is given.
        let code = unsafe {
            let get = app.instance.fp().get_system_properties;
            get(app.instance.as_raw(), app.system, properties.as_mut_ptr())
        };
        assert_eq!(code, R::SUCCESS);
        assert_eq!(bool::from(presence.supports_user_presence), sensed);
    }
}

#[test]
fn a_session_without_graphics() {
    let mock = Mock::new(stepped());
    let entry = mock.entry().unwrap();
    let mut wanted = xr::ExtensionSet::default();
    wanted.mnd_headless = true;
    let instance = entry.create_instance(&application(1), &wanted, &[], &()).unwrap();
    let system = instance.system(xr::FormFactor::HEAD_MOUNTED_DISPLAY).unwrap();
    // SAFETY: there is no graphics binding that could be wrong.
    let (session, mut waiter, mut stream) =
        unsafe { instance.create_session::<xr::Headless>(system, &xr::headless::SessionCreateInfo {}) }
            .unwrap();
    let states = || {
        let mut buffer = xr::EventDataBuffer::new();
        let mut states = Vec::new();
        while let Some(event) = instance.poll_event(&mut buffer).unwrap() {
            if let xr::Event::SessionStateChanged(change) = event {
                states.push(change.state());
            }
        }
        states
    };
    assert_eq!(states(), [S::IDLE, S::READY]);
    assert!(session.enumerate_swapchain_formats().unwrap().is_empty());
    // The view configuration does not matter, and no frame is needed.
    session.begin(xr::ViewConfigurationType::from_raw(0)).unwrap();
    assert_eq!(states(), [S::SYNCHRONIZED, S::VISIBLE, S::FOCUSED]);
    let view = session.create_reference_space(xr::ReferenceSpaceType::VIEW, xr::Posef::IDENTITY).unwrap();
    let stage = session.create_reference_space(xr::ReferenceSpaceType::STAGE, xr::Posef::IDENTITY).unwrap();
    assert_eq!(view.locate(&stage, xr::Time::from_nanos(1)).unwrap().pose.position.y, 1.6);
    mock.lose_focus();
    mock.gain_focus();
    assert_eq!(states(), [S::VISIBLE, S::FOCUSED]);
    // Frames may be waited for, and are not to be drawn.
    let state = waiter.wait().unwrap();
    assert!(!state.should_render);
    stream.begin().unwrap();
    stream.end(state.predicted_display_time, xr::EnvironmentBlendMode::OPAQUE, &[]).unwrap();
    let chain = sys::SwapchainCreateInfo {
        ty: sys::SwapchainCreateInfo::TYPE,
        next: ptr::null(),
        create_flags: sys::SwapchainCreateFlags::EMPTY,
        usage_flags: sys::SwapchainUsageFlags::COLOR_ATTACHMENT,
        format: 43,
        sample_count: 1,
        width: 8,
        height: 8,
        face_count: 1,
        array_size: 1,
        mip_count: 1,
    };
    let mut none = sys::Swapchain::NULL;
    // SAFETY: the runtime verifies what it is given.
    let refused = unsafe { (instance.fp().create_swapchain)(session.as_raw(), &chain, &mut none) };
    assert_eq!(refused, R::ERROR_SWAPCHAIN_FORMAT_UNSUPPORTED);
    assert_documented(&mock);
    session.request_exit().unwrap();
    assert_eq!(states(), [S::VISIBLE, S::SYNCHRONIZED, S::STOPPING]);
    session.end().unwrap();
    assert_eq!(states(), [S::IDLE, S::EXITING]);
}

#[test]
fn a_session_without_graphics_needs_no_events() {
    let mock = Mock::new(stepped());
    let mut wanted = xr::ExtensionSet::default();
    wanted.mnd_headless = true;
    let instance = mock.entry().unwrap().create_instance(&application(1), &wanted, &[], &()).unwrap();
    let system = instance.system(xr::FormFactor::HEAD_MOUNTED_DISPLAY).unwrap();
    for _ in 0..2 {
        // SAFETY: there is no graphics binding that could be wrong.
        let (session, ..) =
            unsafe { instance.create_session::<xr::Headless>(system, &xr::headless::SessionCreateInfo {}) }
                .unwrap();
        assert_eq!(session.begin(STEREO), Ok(R::SUCCESS));
        assert_eq!(session.begin(STEREO).err(), Some(R::ERROR_SESSION_RUNNING));
        assert_eq!(session.end().err(), Some(R::ERROR_SESSION_NOT_STOPPING));
        session.request_exit().unwrap();
        assert_eq!(session.end(), Ok(R::SUCCESS));
        // It is on its way out.
        assert_eq!(session.begin(STEREO).err(), Some(R::ERROR_SESSION_NOT_READY));
    }
    assert_eq!(mock.violations().len(), 2 * 3);
}

#[test]
fn structures_of_extensions_that_are_not_enabled_stay_as_they_are() {
    let app = app_with(stepped(), |_| ());
    let mut presence = sys::SystemUserPresencePropertiesEXT {
        ty: sys::SystemUserPresencePropertiesEXT::TYPE,
        next: ptr::null_mut(),
        supports_user_presence: sys::Bool32::from_raw(77),
    };
    let mut hands = sys::SystemHandTrackingPropertiesEXT {
        ty: sys::SystemHandTrackingPropertiesEXT::TYPE,
        next: (&raw mut presence).cast(),
        supports_hand_tracking: sys::Bool32::from_raw(77),
    };
    let mut properties = sys::SystemProperties::out((&raw mut hands).cast());
    // SAFETY: a living instance and room for what it says.
    let code = unsafe {
        let get = app.instance.fp().get_system_properties;
        get(app.instance.as_raw(), app.system, properties.as_mut_ptr())
    };
    assert_eq!(code, R::SUCCESS);
    let untouched = [presence.supports_user_presence, hands.supports_hand_tracking];
    assert_eq!(untouched.map(sys::Bool32::into_raw), [77, 77]);
}

#[test]
fn no_graphics_needs_the_extension() {
    let mock = Mock::new(stepped());
    let entry = mock.entry().unwrap();
    let instance = entry.create_instance(&application(1), &extensions(), &[], &()).unwrap();
    let system = instance.system(xr::FormFactor::HEAD_MOUNTED_DISPLAY).unwrap();
    // SAFETY: there is no graphics binding that could be wrong.
    let got = unsafe { instance.create_session::<xr::Headless>(system, &xr::headless::SessionCreateInfo {}) };
    assert_eq!(got.err(), Some(R::ERROR_GRAPHICS_DEVICE_INVALID));
}

/// What a messenger heard: function, text, objects' names, labels.
type Heard = Mutex<Vec<(String, String, Vec<String>, Vec<String>)>>;

unsafe extern "system" fn hear(
    _: sys::DebugUtilsMessageSeverityFlagsEXT,
    _: sys::DebugUtilsMessageTypeFlagsEXT,
    data: *const sys::DebugUtilsMessengerCallbackDataEXT,
    user_data: *mut c_void,
) -> sys::Bool32 {
    // SAFETY: the runtime's promise; the user data is a `Heard` that outlives the instance.
    unsafe {
        let data = &*data;
        let text = |text: *const std::ffi::c_char| match text.is_null() {
            true => String::new(),
            false => CStr::from_ptr(text).to_str().unwrap().to_owned(),
        };
        let objects = std::slice::from_raw_parts(data.objects, data.object_count as usize);
        let labels = std::slice::from_raw_parts(data.session_labels, data.session_label_count as usize);
        (*user_data.cast::<Heard>()).lock().unwrap().push((
            text(data.function_name),
            text(data.message),
            objects.iter().map(|it| text(it.object_name)).collect(),
            labels.iter().map(|it| text(it.label_name)).collect(),
        ));
    }
    sys::FALSE
}

fn listener(
    heard: &Heard,
    severities: sys::DebugUtilsMessageSeverityFlagsEXT,
) -> sys::DebugUtilsMessengerCreateInfoEXT {
    sys::DebugUtilsMessengerCreateInfoEXT {
        ty: sys::DebugUtilsMessengerCreateInfoEXT::TYPE,
        next: ptr::null(),
        message_severities: severities,
        message_types: sys::DebugUtilsMessageTypeFlagsEXT::VALIDATION
            | sys::DebugUtilsMessageTypeFlagsEXT::GENERAL,
        user_callback: Some(hear),
        user_data: ptr::from_ref(heard).cast_mut().cast(),
    }
}

const ERROR: sys::DebugUtilsMessageSeverityFlagsEXT = sys::DebugUtilsMessageSeverityFlagsEXT::ERROR;
const INFO: sys::DebugUtilsMessageSeverityFlagsEXT = sys::DebugUtilsMessageSeverityFlagsEXT::INFO;

#[test]
fn messengers_hear_of_violations() {
    let heard: Heard = Mutex::default();
    let deaf: Heard = Mutex::default();
    let app = app_with(stepped(), |it| it.ext_debug_utils = true);
    let (session, ..) = app.session();
    let raw = app.instance.as_raw();
    // SAFETY: names say which functions they are; what is given lives until the messengers are gone.
    unsafe {
        let create: sys::pfn::CreateDebugUtilsMessengerEXT =
            function(&app, c"xrCreateDebugUtilsMessengerEXT");
        let destroy: sys::pfn::DestroyDebugUtilsMessengerEXT =
            function(&app, c"xrDestroyDebugUtilsMessengerEXT");
        let begin: sys::pfn::SessionBeginDebugUtilsLabelRegionEXT =
            function(&app, c"xrSessionBeginDebugUtilsLabelRegionEXT");
        let end: sys::pfn::SessionEndDebugUtilsLabelRegionEXT =
            function(&app, c"xrSessionEndDebugUtilsLabelRegionEXT");
        let insert: sys::pfn::SessionInsertDebugUtilsLabelEXT =
            function(&app, c"xrSessionInsertDebugUtilsLabelEXT");
        let label = |name: &CStr| sys::DebugUtilsLabelEXT {
            ty: sys::DebugUtilsLabelEXT::TYPE,
            next: ptr::null(),
            label_name: name.as_ptr(),
        };
        let mut messengers = [sys::DebugUtilsMessengerEXT::NULL; 2];
        assert_eq!(create(raw, &listener(&heard, ERROR), &mut messengers[0]), R::SUCCESS);
        assert_eq!(create(raw, &listener(&deaf, INFO), &mut messengers[1]), R::SUCCESS);
        let nothing = listener(&heard, sys::DebugUtilsMessageSeverityFlagsEXT::EMPTY);
        let mut none = sys::DebugUtilsMessengerEXT::NULL;
        assert_eq!(create(raw, &nothing, &mut none), R::ERROR_VALIDATION_FAILURE);

        assert_eq!(begin(session.as_raw(), &label(c"frame")), R::SUCCESS);
        assert_eq!(begin(session.as_raw(), &label(c"terrain")), R::SUCCESS);
        assert_eq!(insert(session.as_raw(), &label(c"tile")), R::SUCCESS);
        assert_eq!(
            (app.instance.fp().begin_frame)(session.as_raw(), ptr::null()),
            R::ERROR_SESSION_NOT_RUNNING
        );
        assert_eq!(end(session.as_raw()), R::SUCCESS);
        assert_eq!((app.instance.fp().destroy_space)(sys::Space::from_raw(5)), R::ERROR_HANDLE_INVALID);
        assert_eq!(destroy(messengers[0]), R::SUCCESS);
        assert_eq!(destroy(messengers[0]), R::ERROR_HANDLE_INVALID);
        assert_eq!(destroy(messengers[1]), R::SUCCESS);
    }
    assert_documented(&app.mock);
    let heard = heard.into_inner().unwrap();
    let functions: Vec<_> = heard.iter().map(|it| it.0.as_str()).collect();
    assert_eq!(functions, ["xrCreateDebugUtilsMessengerEXT", "xrBeginFrame", "xrDestroySpace"]);
    assert_eq!(heard[1].1, app.mock.violations()[1].text);
    assert_eq!(heard[1].3, ["tile", "terrain", "frame"], "the newest first");
    assert_eq!(heard[2].3, ["frame"]);
    assert!(deaf.into_inner().unwrap().is_empty());
}

#[test]
fn messages_of_the_application_carry_names_and_labels() {
    let heard: Heard = Mutex::default();
    let app = app_with(stepped(), |it| it.ext_debug_utils = true);
    let (session, ..) = app.session();
    let raw = app.instance.as_raw();
    let object = |name: Option<&CStr>| sys::DebugUtilsObjectNameInfoEXT {
        ty: sys::DebugUtilsObjectNameInfoEXT::TYPE,
        next: ptr::null(),
        object_type: sys::ObjectType::SESSION,
        object_handle: session.as_raw().into_raw(),
        object_name: name.map_or(ptr::null(), CStr::as_ptr),
    };
    // SAFETY: names say which functions they are; what is given lives until the messenger is gone.
    unsafe {
        let create: sys::pfn::CreateDebugUtilsMessengerEXT =
            function(&app, c"xrCreateDebugUtilsMessengerEXT");
        let submit: sys::pfn::SubmitDebugUtilsMessageEXT = function(&app, c"xrSubmitDebugUtilsMessageEXT");
        let name: sys::pfn::SetDebugUtilsObjectNameEXT = function(&app, c"xrSetDebugUtilsObjectNameEXT");
        let mut messenger = sys::DebugUtilsMessengerEXT::NULL;
        assert_eq!(create(raw, &listener(&heard, INFO), &mut messenger), R::SUCCESS);
        assert_eq!(name(raw, &object(Some(c"the session"))), R::SUCCESS);
        let mut wrong = object(Some(c"nobody"));
        wrong.object_handle = 77;
        assert_eq!(name(raw, &wrong), R::ERROR_HANDLE_INVALID);
        wrong.object_type = sys::ObjectType::UNKNOWN;
        assert_eq!(name(raw, &wrong), R::ERROR_VALIDATION_FAILURE);
        let mut objects = [object(None)];
        let text = CString::new("hello").unwrap();
        let data = sys::DebugUtilsMessengerCallbackDataEXT {
            ty: sys::DebugUtilsMessengerCallbackDataEXT::TYPE,
            next: ptr::null(),
            message_id: c"id".as_ptr(),
            function_name: c"main".as_ptr(),
            message: text.as_ptr(),
            object_count: 1,
            objects: objects.as_mut_ptr(),
            session_label_count: 0,
            session_labels: ptr::null_mut(),
        };
        let general = sys::DebugUtilsMessageTypeFlagsEXT::GENERAL;
        assert_eq!(submit(raw, INFO, general, &data), R::SUCCESS);
        assert_eq!(submit(raw, ERROR, general, &data), R::SUCCESS, "nobody listens to errors");
        let nothing = sys::DebugUtilsMessageTypeFlagsEXT::EMPTY;
        assert_eq!(submit(raw, INFO, nothing, &data), R::ERROR_VALIDATION_FAILURE);
        assert_eq!(name(raw, &object(Some(c""))), R::SUCCESS);
        assert_eq!(submit(raw, INFO, general, &data), R::SUCCESS);
    }
    drop(session);
    drop(app);
    let heard = heard.into_inner().unwrap();
    assert_eq!(heard.len(), 2);
    assert_eq!((heard[0].0.as_str(), heard[0].1.as_str()), ("main", "hello"));
    assert_eq!((&heard[0].2[..], &heard[1].2[..]), (&["the session".to_owned()][..], &[String::new()][..]));
}

#[test]
fn a_chained_messenger_hears_of_creation_and_destruction() {
    let heard: Heard = Mutex::default();
    let mock = Mock::new(stepped());
    let all = ERROR | sys::DebugUtilsMessageSeverityFlagsEXT::WARNING;
    let chained = listener(&heard, all);
    let names = [c"XR_EXT_debug_utils".as_ptr(), c"XR_MND_headless".as_ptr(), c"XR_NOBODY_has".as_ptr()];
    let mut info = sys::InstanceCreateInfo {
        ty: sys::InstanceCreateInfo::TYPE,
        next: (&raw const chained).cast(),
        create_flags: sys::InstanceCreateFlags::EMPTY,
        application_info: sys::ApplicationInfo {
            application_name: [0; sys::MAX_APPLICATION_NAME_SIZE],
            application_version: 0,
            engine_name: [0; sys::MAX_ENGINE_NAME_SIZE],
            engine_version: 0,
            api_version: xr::Version::new(1, 0, 0),
        },
        enabled_api_layer_count: 0,
        enabled_api_layer_names: ptr::null(),
        enabled_extension_count: 3,
        enabled_extension_names: names.as_ptr(),
    };
    info.application_info.application_name[0] = b'x' as _;
    // SAFETY: names say which functions they are; everything given is alive.
    unsafe {
        let create: sys::pfn::CreateInstance =
            try_function(&mock, sys::Instance::NULL, c"xrCreateInstance").unwrap();
        let mut instance = sys::Instance::NULL;
        assert_eq!(create(&info, &mut instance), R::ERROR_EXTENSION_NOT_PRESENT);
        info.enabled_extension_count = 2;
        assert_eq!(create(&info, &mut instance), R::SUCCESS);
        let make_set: sys::pfn::CreateActionSet =
            try_function(&mock, instance, c"xrCreateActionSet").unwrap();
        let mut set_info = sys::ActionSetCreateInfo {
            ty: sys::ActionSetCreateInfo::TYPE,
            next: ptr::null(),
            action_set_name: [0; sys::MAX_ACTION_SET_NAME_SIZE],
            localized_action_set_name: [0; sys::MAX_LOCALIZED_ACTION_SET_NAME_SIZE],
            priority: 0,
        };
        set_info.action_set_name[0] = b's' as _;
        set_info.localized_action_set_name[0] = b'S' as _;
        let mut set = sys::ActionSet::NULL;
        assert_eq!(make_set(instance, &set_info, &mut set), R::SUCCESS);
        let destroy: sys::pfn::DestroyInstance = try_function(&mock, instance, c"xrDestroyInstance").unwrap();
        assert_eq!(destroy(instance), R::SUCCESS);
    }
    let heard = heard.into_inner().unwrap();
    let functions: Vec<_> = heard.iter().map(|it| it.0.as_str()).collect();
    assert_eq!(functions, ["xrCreateInstance", "xrDestroyInstance"]);
    assert!(heard[1].1.contains("XrActionSet"), "{heard:?}");
}

#[test]
fn a_messenger_may_call_the_runtime() {
    static INSTANCE: Mutex<Option<(sys::pfn::PollEvent, sys::Instance)>> = Mutex::new(None);
    unsafe extern "system" fn poll(
        _: sys::DebugUtilsMessageSeverityFlagsEXT,
        _: sys::DebugUtilsMessageTypeFlagsEXT,
        _: *const sys::DebugUtilsMessengerCallbackDataEXT,
        count: *mut c_void,
    ) -> sys::Bool32 {
        let (poll, instance) = INSTANCE.lock().unwrap().unwrap();
        let mut buffer =
            sys::EventDataBuffer { ty: sys::EventDataBuffer::TYPE, next: ptr::null(), varying: [0; 4000] };
        // SAFETY: the instance is alive during the callback; the user data is a counter.
        unsafe {
            assert!(poll(instance, &mut buffer).into_raw() >= 0);
            *count.cast::<u32>() += 1;
        }
        sys::FALSE
    }
    let app = app_with(stepped(), |it| it.ext_debug_utils = true);
    *INSTANCE.lock().unwrap() = Some((app.instance.fp().poll_event, app.instance.as_raw()));
    let mut count = 0u32;
    let unused = Mutex::default();
    let info = sys::DebugUtilsMessengerCreateInfoEXT {
        user_callback: Some(poll),
        user_data: (&raw mut count).cast(),
        ..listener(&unused, ERROR)
    };
    // SAFETY: the name says which function it is; the counter outlives the instance.
    unsafe {
        let create: sys::pfn::CreateDebugUtilsMessengerEXT =
            function(&app, c"xrCreateDebugUtilsMessengerEXT");
        let mut messenger = sys::DebugUtilsMessengerEXT::NULL;
        assert_eq!(create(app.instance.as_raw(), &info, &mut messenger), R::SUCCESS);
        for _ in 0..3 {
            (app.instance.fp().destroy_space)(sys::Space::NULL);
        }
    }
    drop(app);
    assert_eq!(count, 3);
}
