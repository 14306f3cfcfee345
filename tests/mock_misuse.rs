//! Every wrong use gets the result code that the specification demands, and leaves a sentence behind.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "wrong uses need the raw functions")]

mod mock_support;

use std::{ffi::c_char, ptr};

use ash::vk;
use fathomless::mock::{Mock, MockConfig};
use mock_support::{App, Chain, STEREO, assert_documented, begin, focus, stepped};
use openxr as xr;
use xr::{
    sys,
    sys::{Handle as _, Result as R},
};

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

fn name<const N: usize>(text: &str) -> [c_char; N] {
    let mut chars = [0; N];
    for (to, from) in chars.iter_mut().zip(text.bytes()) {
        *to = from as c_char;
    }
    chars
}

const POSE: sys::Posef = sys::Posef {
    orientation: sys::Quaternionf::IDENTITY,
    position: sys::Vector3f { x: 0.0, y: 0.0, z: 0.0 },
};
const BAD_POSE: sys::Posef =
    sys::Posef { orientation: sys::Quaternionf { x: 0.1, y: 0.1, z: 0.1, w: 0.1 }, ..POSE };

/// Every recorded violation says something, about a function of the API.
fn assert_recorded(mock: &Mock, functions: &[&str]) {
    assert_documented(mock);
    let violations = mock.violations();
    for violation in &violations {
        assert!(violation.text.len() > 8, "{violation:?}");
        assert!(violation.code.into_raw() < 0, "{violation:?}");
    }
    for function in functions {
        let known = violations.iter().any(|it| it.function == *function);
        assert!(known, "no violation of {function}");
    }
}

fn instance_info() -> sys::InstanceCreateInfo {
    sys::InstanceCreateInfo {
        ty: sys::InstanceCreateInfo::TYPE,
        next: ptr::null(),
        create_flags: sys::InstanceCreateFlags::EMPTY,
        application_info: sys::ApplicationInfo {
            application_name: name("test"),
            application_version: 0,
            engine_name: name(""),
            engine_version: 0,
            api_version: sys::Version::new(1, 0, 0),
        },
        enabled_api_layer_count: 0,
        enabled_api_layer_names: ptr::null(),
        enabled_extension_count: 0,
        enabled_extension_names: ptr::null(),
    }
}

#[test]
fn instances() {
    let mock = Mock::new(stepped());
    let entry = mock.entry().unwrap();
    let create = entry.fp().create_instance;
    let mut out = sys::Instance::NULL;
    let good = instance_info();
    let typed = |ty| sys::InstanceCreateInfo { ty, ..good };
    let flagged = sys::InstanceCreateInfo { create_flags: sys::InstanceCreateFlags::from_raw(1), ..good };
    let mut nameless = good;
    nameless.application_info.application_name = name("");
    let mut endless = good;
    endless.application_info.application_name = [b'a' as c_char; 128];
    let mut endless_engine = good;
    endless_engine.application_info.engine_name = [b'e' as c_char; 128];
    let versioned = |major, minor| {
        let mut info = good;
        info.application_info.api_version = sys::Version::new(major, minor, 0);
        info
    };
    let strange = [c"XR_EXT_strange".as_ptr()];
    let extended = sys::InstanceCreateInfo {
        enabled_extension_count: 1,
        enabled_extension_names: strange.as_ptr(),
        ..good
    };
    let dangling = sys::InstanceCreateInfo { enabled_extension_count: 1, ..good };
    let layered = sys::InstanceCreateInfo {
        enabled_api_layer_count: 1,
        enabled_api_layer_names: strange.as_ptr(),
        ..good
    };
    // A chain that bites its own tail.
    let mut ring = [sys::BaseInStructure { ty: sys::StructureType::UNKNOWN, next: ptr::null() }; 2];
    ring[0].next = &raw const ring[1];
    ring[1].next = &raw const ring[0];
    let cyclic = sys::InstanceCreateInfo { next: (&raw const ring[0]).cast(), ..good };
    let stranger = sys::BaseInStructure { ty: sys::StructureType::UNKNOWN, next: ptr::null() };
    let unknown = sys::InstanceCreateInfo { next: (&raw const stranger).cast(), ..good };
    check! {
        create(ptr::null(), &mut out) => ERROR_VALIDATION_FAILURE;
        create(&good, ptr::null_mut()) => ERROR_VALIDATION_FAILURE;
        create(&typed(sys::StructureType::UNKNOWN), &mut out) => ERROR_VALIDATION_FAILURE;
        create(&flagged, &mut out) => ERROR_VALIDATION_FAILURE;
        create(&endless, &mut out) => ERROR_NAME_INVALID;
        create(&endless_engine, &mut out) => ERROR_NAME_INVALID;
        create(&dangling, &mut out) => ERROR_VALIDATION_FAILURE;
        create(&cyclic, &mut out) => ERROR_VALIDATION_FAILURE;
        create(&nameless, &mut out) => ERROR_NAME_INVALID;
        create(&versioned(0, 0), &mut out) => ERROR_API_VERSION_UNSUPPORTED;
        create(&versioned(1, 2), &mut out) => ERROR_API_VERSION_UNSUPPORTED;
        create(&versioned(2, 0), &mut out) => ERROR_API_VERSION_UNSUPPORTED;
        create(&extended, &mut out) => ERROR_EXTENSION_NOT_PRESENT;
        create(&layered, &mut out) => ERROR_API_LAYER_NOT_PRESENT;
    }
    assert_eq!(out, sys::Instance::NULL);
    check! { create(&unknown, &mut out) => SUCCESS; }

    let gipa = entry.fp().get_instance_proc_addr;
    let mut function = None;
    check! {
        gipa(sys::Instance::NULL, c"xrCreateInstance".as_ptr(), &mut function) => SUCCESS;
    }
    assert!(function.is_some());
    check! {
        gipa(sys::Instance::NULL, c"xrDestroyInstance".as_ptr(), &mut function) => ERROR_HANDLE_INVALID;
    }
    assert!(function.is_none());
    check! {
        gipa(out, c"xrDestroyInstance".as_ptr(), &mut function) => SUCCESS;
        gipa(out, c"xrGetInstanceProcAddr".as_ptr(), &mut function) => SUCCESS;
        gipa(out, c"xrNothing".as_ptr(), &mut function) => ERROR_FUNCTION_UNSUPPORTED;
    }
    assert!(function.is_none());
    check! {
        // The extension is not enabled, and the instance is of version 1.0.
        gipa(out, c"xrCreateVulkanDeviceKHR".as_ptr(), &mut function) => ERROR_FUNCTION_UNSUPPORTED;
        gipa(out, c"xrLocateSpaces".as_ptr(), &mut function) => ERROR_FUNCTION_UNSUPPORTED;
        gipa(out, ptr::null(), &mut function) => ERROR_VALIDATION_FAILURE;
        gipa(out, c"xrDestroyInstance".as_ptr(), ptr::null_mut()) => ERROR_VALIDATION_FAILURE;
        gipa(sys::Instance::from_raw(1), c"xrDestroyInstance".as_ptr(), &mut function) => ERROR_HANDLE_INVALID;
    }
    let enumerate = entry.fp().enumerate_instance_extension_properties;
    let mut count = 0;
    let blank = sys::ExtensionProperties {
        ty: sys::ExtensionProperties::TYPE,
        next: ptr::null_mut(),
        extension_name: name(""),
        extension_version: 0,
    };
    check! {
        enumerate(ptr::null(), 0, ptr::null_mut(), ptr::null_mut()) => ERROR_VALIDATION_FAILURE;
        enumerate(ptr::null(), 0, &mut count, ptr::null_mut()) => SUCCESS;
    }
    let all = count;
    assert!(all > 3);
    let mut rooms = vec![blank; all as usize];
    check! {
        enumerate(ptr::null(), all - 1, &mut count, rooms.as_mut_ptr()) => ERROR_SIZE_INSUFFICIENT;
    }
    assert_eq!((count, rooms[0].extension_version), (all, 0));
    check! {
        enumerate(ptr::null(), all, &mut count, ptr::null_mut()) => ERROR_VALIDATION_FAILURE;
        enumerate(ptr::null(), all, &mut count, rooms.as_mut_ptr()) => SUCCESS;
        enumerate(c"a layer".as_ptr(), 0, &mut count, ptr::null_mut()) => ERROR_API_LAYER_NOT_PRESENT;
    }
    assert!(rooms.iter().all(|room| room.extension_version > 0));
    rooms[2].ty = sys::StructureType::UNKNOWN;
    check! { enumerate(ptr::null(), all, &mut count, rooms.as_mut_ptr()) => ERROR_VALIDATION_FAILURE; }
    assert_recorded(&mock, &["xrCreateInstance", "xrGetInstanceProcAddr"]);
}

#[test]
fn systems_and_views() {
    let mock = Mock::new(stepped());
    let instance = mock
        .entry()
        .unwrap()
        .create_instance(&mock_support::application(1), &mock_support::extensions(), &[], &())
        .unwrap();
    let (fp, raw) = (instance.fp(), instance.as_raw());
    let info =
        |form_factor| sys::SystemGetInfo { ty: sys::SystemGetInfo::TYPE, next: ptr::null(), form_factor };
    let mut system = sys::SystemId::NULL;
    let head = info(sys::FormFactor::HEAD_MOUNTED_DISPLAY);
    let invented = sys::SystemId::from_raw(77);
    let mut properties = sys::ViewConfigurationProperties {
        ty: sys::ViewConfigurationProperties::TYPE,
        next: ptr::null_mut(),
        view_configuration_type: STEREO,
        fov_mutable: sys::FALSE,
    };
    let blank = sys::ViewConfigurationView {
        ty: sys::ViewConfigurationView::TYPE,
        next: ptr::null_mut(),
        recommended_image_rect_width: 0,
        max_image_rect_width: 0,
        recommended_image_rect_height: 0,
        max_image_rect_height: 0,
        recommended_swapchain_sample_count: 0,
        max_swapchain_sample_count: 0,
    };
    let mut views = [blank; 2];
    let mut count = 0;
    let mono = sys::ViewConfigurationType::PRIMARY_MONO;
    check! {
        (fp.get_system)(raw, &info(sys::FormFactor::HANDHELD_DISPLAY), &mut system) => ERROR_FORM_FACTOR_UNSUPPORTED;
        (fp.get_system)(raw, &info(sys::FormFactor::from_raw(9)), &mut system) => ERROR_FORM_FACTOR_UNSUPPORTED;
        (fp.get_system)(raw, ptr::null(), &mut system) => ERROR_VALIDATION_FAILURE;
        // Not yet given by xrGetSystem.
        (fp.get_view_configuration_properties)(raw, sys::SystemId::from_raw(0x5EED_0001), STEREO, &mut properties) => ERROR_SYSTEM_INVALID;
        (fp.get_system)(raw, &head, &mut system) => SUCCESS;
        (fp.get_view_configuration_properties)(raw, system, STEREO, &mut properties) => SUCCESS;
        (fp.get_view_configuration_properties)(raw, invented, STEREO, &mut properties) => ERROR_SYSTEM_INVALID;
        (fp.get_view_configuration_properties)(raw, system, mono, &mut properties) => ERROR_VIEW_CONFIGURATION_TYPE_UNSUPPORTED;
        (fp.enumerate_view_configuration_views)(raw, system, STEREO, 1, &mut count, views.as_mut_ptr()) => ERROR_SIZE_INSUFFICIENT;
        (fp.enumerate_view_configuration_views)(raw, system, STEREO, 2, &mut count, views.as_mut_ptr()) => SUCCESS;
        (fp.enumerate_environment_blend_modes)(raw, system, mono, 0, &mut count, ptr::null_mut()) => ERROR_VIEW_CONFIGURATION_TYPE_UNSUPPORTED;
    }
    assert_eq!(views[1].recommended_image_rect_height, 48);
    let mut text = [0; sys::MAX_RESULT_STRING_SIZE];
    check! {
        (fp.result_to_string)(raw, R::ERROR_LAYER_INVALID, text.as_mut_ptr()) => SUCCESS;
        (fp.result_to_string)(raw, R::ERROR_LAYER_INVALID, ptr::null_mut()) => ERROR_VALIDATION_FAILURE;
    }
    for (code, text) in [
        (R::ERROR_LAYER_INVALID, "XR_ERROR_LAYER_INVALID"),
        (R::from_raw(-77_777), "XR_UNKNOWN_FAILURE_-77777"),
        (R::from_raw(77_777), "XR_UNKNOWN_SUCCESS_77777"),
    ] {
        assert_eq!(instance.result_to_string(code).unwrap(), text);
    }
    for (ty, text) in [
        (sys::FrameState::TYPE, "XR_TYPE_FRAME_STATE"),
        (sys::StructureType::from_raw(-5), "XR_UNKNOWN_STRUCTURE_TYPE_-5"),
    ] {
        assert_eq!(instance.structure_type_to_string(ty).unwrap(), text);
    }
    assert_recorded(&mock, &["xrGetSystem", "xrGetViewConfigurationProperties"]);
}

#[test]
fn creating_sessions() {
    let app = App::new(stepped());
    let (fp, raw) = (app.instance.fp(), app.instance.as_raw());
    let other = app
        .mock
        .entry()
        .unwrap()
        .create_instance(&mock_support::application(0), &mock_support::extensions(), &[], &())
        .unwrap();
    let system = other.system(xr::FormFactor::HEAD_MOUNTED_DISPLAY).unwrap();
    let good = app.binding();
    let binding = sys::GraphicsBindingVulkanKHR {
        ty: sys::GraphicsBindingVulkanKHR::TYPE,
        next: ptr::null(),
        instance: good.instance,
        physical_device: good.physical_device,
        device: good.device,
        queue_family_index: good.queue_family_index,
        queue_index: good.queue_index,
    };
    let info = |next: *const sys::GraphicsBindingVulkanKHR| sys::SessionCreateInfo {
        ty: sys::SessionCreateInfo::TYPE,
        next: next.cast(),
        create_flags: sys::SessionCreateFlags::EMPTY,
        system_id: system,
    };
    let foreign_device = sys::GraphicsBindingVulkanKHR { device: ptr::without_provenance(0x1000), ..binding };
    let no_instance = sys::GraphicsBindingVulkanKHR { instance: ptr::null(), ..binding };
    let no_queue = sys::GraphicsBindingVulkanKHR { queue_index: 40, ..binding };
    let mut stranger = info(&binding);
    stranger.system_id = sys::SystemId::from_raw(3);
    let mut flagged = info(&binding);
    flagged.create_flags = sys::SessionCreateFlags::from_raw(1);
    let mut session = sys::Session::NULL;
    check! {
        (fp.create_session)(other.as_raw(), &info(&binding), &mut session) => ERROR_GRAPHICS_REQUIREMENTS_CALL_MISSING;
        (fp.create_session)(raw, &info(ptr::null()), &mut session) => ERROR_GRAPHICS_DEVICE_INVALID;
        (fp.create_session)(raw, &info(&foreign_device), &mut session) => ERROR_GRAPHICS_DEVICE_INVALID;
        (fp.create_session)(raw, &info(&no_instance), &mut session) => ERROR_GRAPHICS_DEVICE_INVALID;
        (fp.create_session)(raw, &info(&no_queue), &mut session) => ERROR_GRAPHICS_DEVICE_INVALID;
        (fp.create_session)(raw, &stranger, &mut session) => ERROR_SYSTEM_INVALID;
        (fp.create_session)(raw, &flagged, &mut session) => ERROR_VALIDATION_FAILURE;
        (fp.create_session)(raw, ptr::null(), &mut session) => ERROR_VALIDATION_FAILURE;
        (fp.create_session)(raw, &info(&binding), &mut session) => SUCCESS;
        (fp.destroy_session)(session) => SUCCESS;
    }
    assert_recorded(&app.mock, &["xrCreateSession"]);
    assert_eq!(*app.messages(), Vec::<String>::new());
}

#[test]
fn session_states() {
    let app = App::new(stepped());
    let (session, mut waiter, mut stream) = app.session();
    let (fp, raw) = (app.instance.fp(), session.as_raw());
    let info = |kind| sys::SessionBeginInfo {
        ty: sys::SessionBeginInfo::TYPE,
        next: ptr::null(),
        primary_view_configuration_type: kind,
    };
    let mut state = sys::FrameState::out(ptr::null_mut());
    let mono = sys::ViewConfigurationType::PRIMARY_MONO;
    check! {
        // READY, but the application has not polled the event.
        (fp.begin_session)(raw, &info(STEREO)) => ERROR_SESSION_NOT_READY;
        (fp.end_session)(raw) => ERROR_SESSION_NOT_RUNNING;
        (fp.request_exit_session)(raw) => ERROR_SESSION_NOT_RUNNING;
        (fp.wait_frame)(raw, ptr::null(), state.as_mut_ptr()) => ERROR_SESSION_NOT_RUNNING;
        (fp.begin_frame)(raw, ptr::null()) => ERROR_SESSION_NOT_RUNNING;
    }
    app.poll();
    check! {
        (fp.begin_session)(raw, &info(mono)) => ERROR_VIEW_CONFIGURATION_TYPE_UNSUPPORTED;
        (fp.begin_session)(raw, ptr::null()) => ERROR_VALIDATION_FAILURE;
        (fp.begin_session)(raw, &info(STEREO)) => SUCCESS;
        (fp.begin_session)(raw, &info(STEREO)) => ERROR_SESSION_RUNNING;
        (fp.end_session)(raw) => ERROR_SESSION_NOT_STOPPING;
    }
    focus(&app, &mut waiter, &mut stream);
    session.request_exit().unwrap();
    // STOPPING, but the application does not know it yet.
    check! { (fp.end_session)(raw) => ERROR_SESSION_NOT_STOPPING; }
    app.poll();
    check! {
        (fp.end_session)(raw) => SUCCESS;
        (fp.wait_frame)(raw, ptr::null(), state.as_mut_ptr()) => ERROR_SESSION_NOT_RUNNING;
    }
    assert_recorded(&app.mock, &["xrBeginSession", "xrEndSession", "xrWaitFrame"]);
}

#[test]
fn swapchains() {
    let app = App::new(stepped());
    let (session, ..) = app.session();
    let (fp, raw) = (app.instance.fp(), session.as_raw());
    let good = sys::SwapchainCreateInfo {
        ty: sys::SwapchainCreateInfo::TYPE,
        next: ptr::null(),
        create_flags: sys::SwapchainCreateFlags::EMPTY,
        usage_flags: sys::SwapchainUsageFlags::COLOR_ATTACHMENT,
        format: i64::from(vk::Format::R8G8B8A8_SRGB.as_raw()),
        sample_count: 1,
        width: 16,
        height: 16,
        face_count: 1,
        array_size: 2,
        mip_count: 1,
    };
    let mut out = sys::Swapchain::NULL;
    let create = fp.create_swapchain;
    type Change = fn(&mut sys::SwapchainCreateInfo);
    let wrong: [(Change, R); 14] = [
        (|it| it.ty = sys::StructureType::UNKNOWN, R::ERROR_VALIDATION_FAILURE),
        (|it| it.format = 99_999, R::ERROR_SWAPCHAIN_FORMAT_UNSUPPORTED),
        (|it| it.format = i64::MAX, R::ERROR_SWAPCHAIN_FORMAT_UNSUPPORTED),
        (|it| it.width = 0, R::ERROR_VALIDATION_FAILURE),
        (|it| it.height = 8193, R::ERROR_VALIDATION_FAILURE),
        (|it| it.face_count = 0, R::ERROR_VALIDATION_FAILURE),
        (|it| it.face_count = 3, R::ERROR_VALIDATION_FAILURE),
        (|it| it.array_size = 0, R::ERROR_VALIDATION_FAILURE),
        (|it| it.mip_count = 0, R::ERROR_VALIDATION_FAILURE),
        (|it| it.sample_count = 0, R::ERROR_VALIDATION_FAILURE),
        (|it| it.sample_count = 4, R::ERROR_FEATURE_UNSUPPORTED),
        (|it| it.array_size = u32::MAX, R::ERROR_FEATURE_UNSUPPORTED),
        (|it| it.create_flags = sys::SwapchainCreateFlags::PROTECTED_CONTENT, R::ERROR_FEATURE_UNSUPPORTED),
        (
            |it| it.usage_flags = sys::SwapchainUsageFlags::DEPTH_STENCIL_ATTACHMENT,
            R::ERROR_FEATURE_UNSUPPORTED,
        ),
    ];
    for (i, (change, code)) in wrong.into_iter().enumerate() {
        let mut info = good;
        change(&mut info);
        // SAFETY: the runtime verifies what it is given.
        assert_eq!(unsafe { create(raw, &info, &mut out) }, code, "case {i}");
    }
    let once = sys::SwapchainCreateInfo { create_flags: sys::SwapchainCreateFlags::STATIC_IMAGE, ..good };
    let mut fixed = sys::Swapchain::NULL;
    check! {
        create(raw, &good, ptr::null_mut()) => ERROR_VALIDATION_FAILURE;
        create(raw, &good, &mut out) => SUCCESS;
        create(raw, &once, &mut fixed) => SUCCESS;
    }

    let blank = sys::SwapchainImageVulkanKHR {
        ty: sys::SwapchainImageVulkanKHR::TYPE,
        next: ptr::null_mut(),
        image: 0,
    };
    let mut images = [blank; 3];
    let mut count = 0;
    let enumerate = fp.enumerate_swapchain_images;
    let wait = sys::SwapchainImageWaitInfo {
        ty: sys::SwapchainImageWaitInfo::TYPE,
        next: ptr::null(),
        timeout: sys::Duration::INFINITE,
    };
    let untyped = sys::SwapchainImageWaitInfo { ty: sys::StructureType::UNKNOWN, ..wait };
    let mut index = 9;
    check! {
        enumerate(out, 2, &mut count, images.as_mut_ptr().cast()) => ERROR_SIZE_INSUFFICIENT;
        enumerate(out, 3, &mut count, images.as_mut_ptr().cast()) => SUCCESS;
        enumerate(fixed, 3, &mut count, images.as_mut_ptr().cast()) => SUCCESS;
        (fp.wait_swapchain_image)(out, &wait) => ERROR_CALL_ORDER_INVALID;
        (fp.release_swapchain_image)(out, ptr::null()) => ERROR_CALL_ORDER_INVALID;
        (fp.acquire_swapchain_image)(out, ptr::null(), ptr::null_mut()) => ERROR_VALIDATION_FAILURE;
        (fp.acquire_swapchain_image)(out, ptr::null(), &mut index) => SUCCESS;
        (fp.release_swapchain_image)(out, ptr::null()) => ERROR_CALL_ORDER_INVALID;
        (fp.wait_swapchain_image)(out, ptr::null()) => ERROR_VALIDATION_FAILURE;
        (fp.wait_swapchain_image)(out, &untyped) => ERROR_VALIDATION_FAILURE;
        (fp.wait_swapchain_image)(out, &wait) => SUCCESS;
        (fp.wait_swapchain_image)(out, &wait) => ERROR_CALL_ORDER_INVALID;
        (fp.acquire_swapchain_image)(out, ptr::null(), &mut index) => SUCCESS;
        (fp.acquire_swapchain_image)(out, ptr::null(), &mut index) => SUCCESS;
        (fp.acquire_swapchain_image)(out, ptr::null(), &mut index) => ERROR_CALL_ORDER_INVALID;
        (fp.release_swapchain_image)(out, ptr::null()) => SUCCESS;
        (fp.release_swapchain_image)(out, ptr::null()) => ERROR_CALL_ORDER_INVALID;
        (fp.acquire_swapchain_image)(fixed, ptr::null(), &mut index) => SUCCESS;
        (fp.wait_swapchain_image)(fixed, &wait) => SUCCESS;
        (fp.release_swapchain_image)(fixed, ptr::null()) => SUCCESS;
        (fp.acquire_swapchain_image)(fixed, ptr::null(), &mut index) => ERROR_CALL_ORDER_INVALID;
        (fp.destroy_swapchain)(out) => SUCCESS;
        (fp.destroy_swapchain)(out) => ERROR_HANDLE_INVALID;
    }
    assert_eq!(*app.messages(), Vec::<String>::new());
    assert_recorded(&app.mock, &["xrCreateSwapchain", "xrAcquireSwapchainImage"]);
}

#[test]
fn frames() {
    let app = App::new(stepped());
    let (session, ..) = app.session();
    begin(&app, &session);
    let (fp, raw) = (app.instance.fp(), session.as_raw());
    let mut state = sys::FrameState::out(ptr::null_mut());
    let mut untyped = state;
    untyped.write(sys::FrameState {
        ty: sys::StructureType::UNKNOWN,
        next: ptr::null_mut(),
        predicted_display_time: sys::Time::from_nanos(0),
        predicted_display_period: sys::Duration::NONE,
        should_render: sys::FALSE,
    });
    let end = |time: i64, blend, count| sys::FrameEndInfo {
        ty: sys::FrameEndInfo::TYPE,
        next: ptr::null(),
        display_time: sys::Time::from_nanos(time),
        environment_blend_mode: blend,
        layer_count: count,
        layers: ptr::null(),
    };
    let opaque = sys::EnvironmentBlendMode::OPAQUE;
    let additive = sys::EnvironmentBlendMode::ADDITIVE;
    check! {
        (fp.begin_frame)(raw, ptr::null()) => ERROR_CALL_ORDER_INVALID;
        (fp.end_frame)(raw, &end(1, opaque, 0)) => ERROR_CALL_ORDER_INVALID;
        (fp.wait_frame)(raw, ptr::null(), ptr::null_mut()) => ERROR_VALIDATION_FAILURE;
        (fp.wait_frame)(raw, ptr::null(), untyped.as_mut_ptr()) => ERROR_VALIDATION_FAILURE;
        (fp.wait_frame)(raw, ptr::null(), state.as_mut_ptr()) => SUCCESS;
        (fp.begin_frame)(raw, ptr::null()) => SUCCESS;
        // A begin without its wait does not discard the frame.
        (fp.begin_frame)(raw, ptr::null()) => ERROR_CALL_ORDER_INVALID;
        (fp.wait_frame)(raw, ptr::null(), state.as_mut_ptr()) => SUCCESS;
        (fp.begin_frame)(raw, ptr::null()) => FRAME_DISCARDED;
        (fp.end_frame)(raw, ptr::null()) => ERROR_VALIDATION_FAILURE;
        (fp.end_frame)(raw, &end(0, opaque, 0)) => ERROR_TIME_INVALID;
        (fp.end_frame)(raw, &end(-5, opaque, 0)) => ERROR_TIME_INVALID;
        (fp.end_frame)(raw, &end(1, additive, 0)) => ERROR_ENVIRONMENT_BLEND_MODE_UNSUPPORTED;
        (fp.end_frame)(raw, &end(1, opaque, 17)) => ERROR_LAYER_LIMIT_EXCEEDED;
        (fp.end_frame)(raw, &end(1, opaque, 2)) => ERROR_VALIDATION_FAILURE;
        // A frame whose end failed is still open, and the next one discards it.
        (fp.wait_frame)(raw, ptr::null(), state.as_mut_ptr()) => SUCCESS;
        (fp.begin_frame)(raw, ptr::null()) => FRAME_DISCARDED;
        (fp.end_frame)(raw, &end(1, opaque, 0)) => SUCCESS;
        (fp.end_frame)(raw, &end(1, opaque, 0)) => ERROR_CALL_ORDER_INVALID;
    }
    assert_recorded(&app.mock, &["xrBeginFrame", "xrEndFrame", "xrWaitFrame"]);
}

/// A projection layer with depth that the test bends out of shape.
struct Picture {
    space: sys::Space,
    views: [sys::CompositionLayerProjectionView; 2],
    depth: [sys::CompositionLayerDepthInfoKHR; 2],
    with_depth: [bool; 2],
    view_count: u32,
    ty: sys::StructureType,
    flags: u64,
}

#[test]
fn layers() {
    const SIZE: [u32; 2] = [16, 16];
    let app = App::new(stepped());
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    let space = session.create_reference_space(xr::ReferenceSpaceType::LOCAL, xr::Posef::IDENTITY).unwrap();
    let mut colour = Chain::new(&session, vk::Format::R8G8B8A8_SRGB, SIZE);
    let mut depth = Chain::new(&session, vk::Format::D32_SFLOAT, SIZE);
    let untouched = Chain::new(&session, vk::Format::R8G8B8A8_SRGB, SIZE);
    colour.fill(&app, [[0.0; 4]; 2]);
    depth.fill(&app, [[0.0; 4]; 2]);
    let fov = sys::Fovf { angle_left: -0.8, angle_right: 0.8, angle_up: 0.8, angle_down: -0.8 };
    let picture = || Picture {
        space: space.as_raw(),
        views: [0, 1].map(|i| sys::CompositionLayerProjectionView {
            ty: sys::CompositionLayerProjectionView::TYPE,
            next: ptr::null(),
            pose: POSE,
            fov,
            sub_image: colour.part(i, SIZE),
        }),
        depth: [0, 1].map(|i| sys::CompositionLayerDepthInfoKHR {
            ty: sys::CompositionLayerDepthInfoKHR::TYPE,
            next: ptr::null(),
            sub_image: depth.part(i, SIZE),
            min_depth: 0.0,
            max_depth: 1.0,
            near_z: f32::INFINITY,
            far_z: 0.1,
        }),
        with_depth: [true; 2],
        view_count: 2,
        ty: sys::CompositionLayerProjection::TYPE,
        flags: 0,
    };
    let end = app.instance.fp().end_frame;
    let submit = |picture: &mut Picture| {
        for i in 0..2 {
            if picture.with_depth[i] {
                picture.views[i].next = (&raw const picture.depth[i]).cast();
            }
        }
        let layer = sys::CompositionLayerProjection {
            ty: picture.ty,
            next: ptr::null(),
            layer_flags: sys::CompositionLayerFlags::from_raw(picture.flags),
            space: picture.space,
            view_count: picture.view_count,
            views: picture.views.as_ptr(),
        };
        let layers = [(&raw const layer).cast()];
        let info = sys::FrameEndInfo {
            ty: sys::FrameEndInfo::TYPE,
            next: ptr::null(),
            display_time: sys::Time::from_nanos(1),
            environment_blend_mode: sys::EnvironmentBlendMode::OPAQUE,
            layer_count: 1,
            layers: layers.as_ptr(),
        };
        // SAFETY: the runtime verifies what it is given.
        unsafe { end(session.as_raw(), &info) }
    };
    type Change<'a> = &'a dyn Fn(&mut Picture);
    let (bare, flat) = (untouched.part(0, SIZE), colour.part(0, SIZE));
    let deep = depth.part(0, SIZE);
    let invented = sys::Swapchain::from_raw(5);
    let nan = f32::NAN;
    let cases: &[(R, Change<'_>)] = &[
        (R::SUCCESS, &|_| {}),
        (R::SUCCESS, &|it| it.with_depth = [false; 2]),
        (R::SUCCESS, &|it| it.flags = 0x7),
        (R::SUCCESS, &|it| it.depth[0].near_z = 0.05),
        // Inverted alpha is of an extension.
        (R::ERROR_VALIDATION_FAILURE, &|it| it.flags = 0x8),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.flags = 0x10),
        (R::ERROR_HANDLE_INVALID, &|it| it.space = sys::Space::NULL),
        (R::ERROR_LAYER_INVALID, &|it| {
            it.ty = sys::CompositionLayerCubeKHR::TYPE;
        }),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.view_count = 1),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.view_count = 0),
        (R::ERROR_VALIDATION_FAILURE, &|it| {
            it.views[1].ty = sys::StructureType::UNKNOWN;
        }),
        (R::ERROR_POSE_INVALID, &|it| it.views[0].pose = BAD_POSE),
        (R::ERROR_POSE_INVALID, &|it| it.views[1].pose.position.x = nan),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.views[1].fov.angle_up = 1.6),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.views[1].fov.angle_up = nan),
        (R::ERROR_LAYER_INVALID, &|it| it.views[0].sub_image = bare),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.views[0].sub_image = deep),
        (R::ERROR_HANDLE_INVALID, &|it| {
            it.views[0].sub_image.swapchain = invented;
        }),
        (R::ERROR_VALIDATION_FAILURE, &|it| {
            it.views[1].sub_image.image_array_index = 2;
        }),
        (R::ERROR_SWAPCHAIN_RECT_INVALID, &|it| {
            it.views[1].sub_image.image_rect.offset.x = -1;
        }),
        (R::ERROR_SWAPCHAIN_RECT_INVALID, &|it| {
            it.views[1].sub_image.image_rect.offset.y = 1;
        }),
        (R::ERROR_SWAPCHAIN_RECT_INVALID, &|it| {
            it.views[0].sub_image.image_rect.extent.width = 0;
        }),
        (R::ERROR_SWAPCHAIN_RECT_INVALID, &|it| {
            it.views[0].sub_image.image_rect.extent.width = i32::MAX;
        }),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.with_depth[1] = false),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.depth[0].sub_image = flat),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.depth[0].min_depth = 1.0),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.depth[0].min_depth = -0.1),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.depth[1].max_depth = 1.1),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.depth[1].max_depth = nan),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.depth[0].near_z = 0.1),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.depth[0].near_z = -1.0),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.depth[0].far_z = 0.0),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.depth[0].far_z = nan),
    ];
    for (i, (code, change)) in cases.iter().enumerate() {
        waiter.wait().unwrap();
        stream.begin().unwrap();
        let mut it = picture();
        change(&mut it);
        assert_eq!(submit(&mut it), *code, "case {i}");
    }
    let broken = cases.iter().filter(|(code, _)| *code != R::SUCCESS).count();
    assert_eq!(app.mock.violations().len(), broken);
    assert_recorded(&app.mock, &["xrEndFrame"]);
    assert_eq!(*app.messages(), Vec::<String>::new());

    // A null pointer among the layers.
    waiter.wait().unwrap();
    stream.begin().unwrap();
    let layers = [ptr::null()];
    let info = sys::FrameEndInfo {
        ty: sys::FrameEndInfo::TYPE,
        next: ptr::null(),
        display_time: sys::Time::from_nanos(1),
        environment_blend_mode: sys::EnvironmentBlendMode::OPAQUE,
        layer_count: 1,
        layers: layers.as_ptr(),
    };
    check! { end(session.as_raw(), &info) => ERROR_LAYER_INVALID; }
}

#[test]
fn spaces() {
    let config = MockConfig { stage: false, ..stepped() };
    let app = App::new(config);
    let (session, ..) = app.session();
    let (another, ..) = app.session();
    let (fp, raw) = (app.instance.fp(), session.as_raw());
    let info = |kind, pose| sys::ReferenceSpaceCreateInfo {
        ty: sys::ReferenceSpaceCreateInfo::TYPE,
        next: ptr::null(),
        reference_space_type: kind,
        pose_in_reference_space: pose,
    };
    let (local, stage) = (sys::ReferenceSpaceType::LOCAL, sys::ReferenceSpaceType::STAGE);
    let (mut here, mut there) = (sys::Space::NULL, sys::Space::NULL);
    let mut out = sys::SpaceLocation::out(ptr::null_mut());
    let mut bounds = sys::Extent2Df::default();
    let time = |ns| sys::Time::from_nanos(ns);
    check! {
        (fp.create_reference_space)(raw, &info(stage, POSE), &mut here) => ERROR_REFERENCE_SPACE_UNSUPPORTED;
        (fp.create_reference_space)(raw, &info(local, BAD_POSE), &mut here) => ERROR_POSE_INVALID;
        (fp.create_reference_space)(raw, &info(local, POSE), ptr::null_mut()) => ERROR_VALIDATION_FAILURE;
        (fp.create_reference_space)(raw, &info(local, POSE), &mut here) => SUCCESS;
        (fp.create_reference_space)(another.as_raw(), &info(local, POSE), &mut there) => SUCCESS;
        (fp.locate_space)(here, there, time(1), out.as_mut_ptr()) => ERROR_VALIDATION_FAILURE;
        (fp.locate_space)(here, here, time(0), out.as_mut_ptr()) => ERROR_TIME_INVALID;
        (fp.locate_space)(here, here, time(1), ptr::null_mut()) => ERROR_VALIDATION_FAILURE;
        (fp.locate_space)(here, here, time(1), out.as_mut_ptr()) => SUCCESS;
        (fp.get_reference_space_bounds_rect)(raw, local, &mut bounds) => SPACE_BOUNDS_UNAVAILABLE;
        (fp.get_reference_space_bounds_rect)(raw, stage, &mut bounds) => ERROR_REFERENCE_SPACE_UNSUPPORTED;
    }
    let locate = |kind, space, ns| sys::ViewLocateInfo {
        ty: sys::ViewLocateInfo::TYPE,
        next: ptr::null(),
        view_configuration_type: kind,
        display_time: time(ns),
        space,
    };
    let mut state = sys::ViewState::out(ptr::null_mut());
    let mut views = [sys::View::out(ptr::null_mut()); 2];
    let mut count = 0;
    let mono = sys::ViewConfigurationType::PRIMARY_MONO;
    let places = views.as_mut_ptr().cast::<sys::View>();
    let locate_views = fp.locate_views;
    check! {
        // A session that does not run has no views.
        locate_views(raw, &locate(STEREO, here, 1), state.as_mut_ptr(), 2, &mut count, places) => ERROR_VALIDATION_FAILURE;
    }
    begin(&app, &session);
    check! {
        locate_views(raw, &locate(mono, here, 1), state.as_mut_ptr(), 2, &mut count, places) => ERROR_VIEW_CONFIGURATION_TYPE_UNSUPPORTED;
        locate_views(raw, &locate(STEREO, there, 1), state.as_mut_ptr(), 2, &mut count, places) => ERROR_VALIDATION_FAILURE;
        locate_views(raw, &locate(STEREO, here, -1), state.as_mut_ptr(), 2, &mut count, places) => ERROR_TIME_INVALID;
        locate_views(raw, &locate(STEREO, here, 1), ptr::null_mut(), 2, &mut count, places) => ERROR_VALIDATION_FAILURE;
        locate_views(raw, &locate(STEREO, here, 1), state.as_mut_ptr(), 1, &mut count, places) => ERROR_SIZE_INSUFFICIENT;
        locate_views(raw, &locate(STEREO, here, 1), state.as_mut_ptr(), 0, &mut count, ptr::null_mut()) => SUCCESS;
        locate_views(raw, &locate(STEREO, here, 1), state.as_mut_ptr(), 2, &mut count, places) => SUCCESS;
        (fp.destroy_space)(here) => SUCCESS;
        (fp.destroy_space)(here) => ERROR_HANDLE_INVALID;
    }
    assert_eq!(count, 2);
    assert_recorded(&app.mock, &["xrCreateReferenceSpace", "xrLocateSpace", "xrLocateViews"]);
}
