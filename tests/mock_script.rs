//! The mock does what it is told: states, losses, poses, tracking, frames to skip, codes to return.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "positive codes need the raw functions")]

mod mock_support;

use std::{ptr, time::Duration};

use ash::vk;
use fathomless::mock::{
    Calls, Clock, Fov, Mock, MockConfig, MockError, Pose, PoseTrack, Tracking, TrackingSpan, function_names,
    registry,
};
use glam::{Quat, Vec3};
use mock_support::{App, Chain, STEREO, application, begin, empty_frame, extensions, focus, stepped};
use openxr as xr;
use xr::{
    SessionState as S,
    sys::{self, Result as R},
};

fn code<T>(result: Result<T, R>) -> R {
    result.err().unwrap_or(R::SUCCESS)
}

#[test]
fn focus_is_lost_and_regained() {
    let app = App::new(stepped());
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    focus(&app, &mut waiter, &mut stream);
    app.mock.lose_focus();
    assert_eq!(app.poll(), [S::VISIBLE]);
    assert!(empty_frame(&mut waiter, &mut stream).should_render);
    app.mock.hide();
    assert_eq!(app.poll(), [S::SYNCHRONIZED]);
    assert!(!empty_frame(&mut waiter, &mut stream).should_render);
    app.mock.gain_focus();
    for _ in 0..3 {
        empty_frame(&mut waiter, &mut stream);
    }
    assert_eq!(app.poll(), [S::VISIBLE, S::FOCUSED]);
    assert_eq!(app.mock.session_state(), Some(S::FOCUSED));
    assert_eq!(app.mock.violations(), []);
}

#[test]
fn a_stopped_session_starts_again() {
    let app = App::new(stepped());
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    focus(&app, &mut waiter, &mut stream);
    let before = empty_frame(&mut waiter, &mut stream);
    app.mock.stop_session();
    assert_eq!(app.poll(), [S::VISIBLE, S::SYNCHRONIZED, S::STOPPING]);
    // A frame is waited for and begun, never ended: the next run starts afresh.
    waiter.wait().unwrap();
    stream.begin().unwrap();
    session.end().unwrap();
    assert_eq!(app.poll(), [S::IDLE]);
    app.mock.gain_focus();
    begin(&app, &session);
    assert_eq!(code(stream.begin()), R::ERROR_CALL_ORDER_INVALID);
    let after = empty_frame(&mut waiter, &mut stream);
    assert!(
        after.predicted_display_time.as_nanos() > before.predicted_display_time.as_nanos(),
        "display times increase over runs"
    );
    assert_eq!(app.poll(), [S::SYNCHRONIZED]);
}

#[test]
fn a_session_stopped_before_its_first_frame() {
    let app = App::new(stepped());
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    app.mock.stop_session();
    empty_frame(&mut waiter, &mut stream);
    assert_eq!(app.poll(), [S::SYNCHRONIZED, S::STOPPING]);
    session.end().unwrap();
    assert_eq!(app.poll(), [S::IDLE]);
}

#[test]
fn losses() {
    let app = App::new(stepped());
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    focus(&app, &mut waiter, &mut stream);
    let (fp, raw) = (app.instance.fp(), session.as_raw());
    let mut state = sys::FrameState::out(ptr::null_mut());
    app.mock.lose_session();
    assert_eq!(app.poll(), [S::LOSS_PENDING]);
    // SAFETY: the runtime verifies what it is given.
    let got = unsafe { (fp.wait_frame)(raw, ptr::null(), state.as_mut_ptr()) };
    assert_eq!(got, R::SESSION_LOSS_PENDING);
    app.mock.kill_session();
    assert_eq!(code(stream.begin()), R::ERROR_SESSION_LOST);
    assert_eq!(code(session.enumerate_swapchain_formats()), R::ERROR_SESSION_LOST);
    drop((session, waiter, stream));

    // A new session is as good as the first.
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    focus(&app, &mut waiter, &mut stream);

    app.mock.lose_instance(Duration::from_millis(25));
    let mut buffer = xr::EventDataBuffer::new();
    let event = app.instance.poll_event(&mut buffer).unwrap();
    assert!(matches!(event, Some(xr::Event::InstanceLossPending(_))));
    // 10 ms per frame: the third wait ends after the loss.
    for _ in 0..2 {
        empty_frame(&mut waiter, &mut stream);
    }
    assert_eq!(code(waiter.wait()), R::ERROR_INSTANCE_LOST);
    assert_eq!(code(app.instance.poll_event(&mut buffer)), R::ERROR_INSTANCE_LOST);
    drop((session, waiter, stream));
    let mock = app.mock.clone();
    drop(app);
    assert_eq!(mock.leaks(), []);
    assert_eq!(mock.violations(), []);
}

#[test]
fn the_newest_version_refused() {
    let mock = Mock::new(MockConfig {
        max_api_version: (1, 0),
        absent_extensions: vec!["XR_EXT_local_floor".into()],
        unavailable_calls: 2,
        ..stepped()
    });
    let entry = mock.entry().unwrap();
    let offered = entry.enumerate_extensions().unwrap();
    assert!(offered.khr_vulkan_enable2 && offered.khr_composition_layer_depth);
    assert!(!offered.ext_local_floor);
    let mut wanted = extensions();
    let create =
        |minor, wanted: &xr::ExtensionSet| entry.create_instance(&application(minor), wanted, &[], &());
    assert_eq!(code(create(1, &wanted)), R::ERROR_API_VERSION_UNSUPPORTED);
    assert_eq!(code(create(0, &wanted)), R::ERROR_EXTENSION_NOT_PRESENT);
    wanted.ext_local_floor = false;
    let instance = create(0, &wanted).unwrap();
    let head = xr::FormFactor::HEAD_MOUNTED_DISPLAY;
    for _ in 0..2 {
        assert_eq!(code(instance.system(head)), R::ERROR_FORM_FACTOR_UNAVAILABLE);
    }
    assert!(instance.system(head).is_ok());
    mock.disconnect_for(1);
    assert_eq!(code(instance.system(head)), R::ERROR_FORM_FACTOR_UNAVAILABLE);
    assert_eq!(mock.violations(), [], "asking is not a crime");
}

#[test]
fn calls_return_what_they_are_told() {
    let app = App::new(stepped());
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    let (mock, fp) = (&app.mock, app.instance.fp());
    mock.on_call("xrBeginFrame", Calls::Nth(2), R::ERROR_RUNTIME_FAILURE).unwrap();
    mock.on_call("xrEndFrame", Calls::Nth(3), R::SESSION_LOSS_PENDING).unwrap();
    empty_frame(&mut waiter, &mut stream);
    waiter.wait().unwrap();
    assert_eq!(code(stream.begin()), R::ERROR_RUNTIME_FAILURE);
    // The call did nothing, so the frame can still begin.
    stream.begin().unwrap();
    let end = sys::FrameEndInfo {
        ty: sys::FrameEndInfo::TYPE,
        next: ptr::null(),
        display_time: sys::Time::from_nanos(1),
        environment_blend_mode: sys::EnvironmentBlendMode::OPAQUE,
        layer_count: 0,
        layers: ptr::null(),
    };
    // SAFETY: the runtime verifies what it is given.
    unsafe {
        assert_eq!((fp.end_frame)(session.as_raw(), &end), R::SUCCESS);
        waiter.wait().unwrap();
        stream.begin().unwrap();
        // The call works and says something else.
        assert_eq!((fp.end_frame)(session.as_raw(), &end), R::SESSION_LOSS_PENDING);
    }
    assert_eq!(mock.calls("xrEndFrame"), 3);
    let mut chain = Chain::new(&session, vk::Format::R8G8B8A8_SRGB, [8, 8]);
    mock.on_call("xrWaitSwapchainImage", Calls::From(1), R::TIMEOUT_EXPIRED).unwrap();
    chain.swapchain.acquire_image().unwrap();
    // The crate takes the timeout for success; the image is not waited for all the same.
    chain.swapchain.wait_image(xr::Duration::NONE).unwrap();
    assert_eq!(code(chain.swapchain.release_image()), R::ERROR_CALL_ORDER_INVALID);
    mock.clear_hooks();
    let unknown = mock.on_call("xrNothing", Calls::All, R::SUCCESS);
    assert_eq!(unknown, Err(MockError::UnknownFunction("xrNothing".into())));
    let core = registry::COMMANDS.iter().filter(|it| registry::is_offered(it.needs, (1, 1), |_| false));
    assert_eq!(core.clone().count(), 55 + 1);
    for command in core {
        assert!(function_names().any(|name| name == command.name), "{}", command.name);
    }
    assert!(mock.log().iter().any(|call| call.code == R::TIMEOUT_EXPIRED));
}

#[test]
fn the_head_follows_its_track() {
    let turned = Quat::from_rotation_y(1.0);
    let app = App::new(MockConfig {
        head: PoseTrack::new([
            (0.0, Pose::at(0.0, 1.7, 0.0)),
            (0.1, Pose::new(Vec3::new(1.0, 1.7, 0.0), turned)),
        ]),
        ipd_m: 0.07,
        ..stepped()
    });
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    let space = |kind| session.create_reference_space(kind, xr::Posef::IDENTITY).unwrap();
    let stage = space(xr::ReferenceSpaceType::STAGE);
    let local = space(xr::ReferenceSpaceType::LOCAL);
    let floor = space(xr::ReferenceSpaceType::LOCAL_FLOOR);
    let view = space(xr::ReferenceSpaceType::VIEW);
    for frame in 0..15 {
        let state = empty_frame(&mut waiter, &mut stream);
        let time = state.predicted_display_time;
        assert_eq!(state.predicted_display_period.as_nanos(), 10_000_000);
        let s = (frame as f32 / 10.0).min(1.0);
        let wanted = Pose::new(Vec3::new(s, 1.7, 0.0), Quat::from_rotation_y(s));
        let near = |pose: xr::Posef, wanted: Pose| {
            let (p, q) = (pose.position, pose.orientation);
            let moved = Vec3::new(p.x, p.y, p.z).distance(wanted.position);
            let turned = Quat::from_xyzw(q.x, q.y, q.z, q.w).angle_between(wanted.orientation);
            assert!(moved < 1e-4 && turned < 2e-3, "{frame}: {pose:?} {wanted:?}");
        };
        near(view.locate(&stage, time).unwrap().pose, wanted);
        near(view.locate(&floor, time).unwrap().pose, wanted);
        let below = Pose::at(0.0, -1.6, 0.0);
        near(view.locate(&local, time).unwrap().pose, below.then(wanted));
        near(stage.locate(&view, time).unwrap().pose, wanted.inverse());
        let (flags, views) = session.locate_views(STEREO, time, &stage).unwrap();
        assert_eq!(flags.into_raw(), 0xF);
        for (view, x) in views.iter().zip([-0.035, 0.035]) {
            near(view.pose, wanted.then(Pose::at(x, 0.0, 0.0)));
        }
        assert_eq!(views[0].fov.angle_left, -views[1].fov.angle_right);
        assert_ne!(views[0].fov.angle_left, -views[0].fov.angle_right);
    }
    // 1 m and 1 radian in 0.1 s.
    let time = empty_frame(&mut waiter, &mut stream).predicted_display_time;
    let earlier = xr::Time::from_nanos(time.as_nanos() - 100_000_000);
    let (_, velocity) = view.relate(&stage, earlier).unwrap();
    assert_eq!(velocity.velocity_flags.into_raw(), 3);
    assert!((velocity.linear_velocity.x - 10.0).abs() < 0.1);
    assert!((velocity.angular_velocity.y - 10.0).abs() < 0.1);

    app.mock.hold_head(Pose::at(5.0, 1.0, 0.0));
    app.mock.set_ipd(0.0);
    let fov = Fov { left: -0.5, right: 0.4, up: 0.3, down: -0.2 };
    app.mock.set_fov([fov; 2]);
    let (_, views) = session.locate_views(STEREO, time, &stage).unwrap();
    assert_eq!(views[0].pose, views[1].pose);
    assert_eq!(views[1].pose.position.x, 5.0);
    assert_eq!(views[1].fov.angle_down, -0.2);
    let bounds = session.reference_space_bounds_rect(xr::ReferenceSpaceType::STAGE).unwrap();
    assert_eq!(bounds.map(|it| it.width), Some(3.0));
    assert_eq!(app.mock.violations(), []);
}

#[test]
fn many_spaces_at_once() {
    let app = App::new(stepped());
    let (session, ..) = app.session();
    let space = |kind| session.create_reference_space(kind, xr::Posef::IDENTITY).unwrap();
    let (stage, view) = (space(xr::ReferenceSpaceType::STAGE), space(xr::ReferenceSpaceType::VIEW));
    let mut function = None;
    let blank =
        sys::SpaceLocationData { location_flags: sys::SpaceLocationFlags::EMPTY, pose: xr::Posef::IDENTITY };
    let mut located = [blank; 2];
    let spaces = [view.as_raw(), stage.as_raw()];
    let mut info = sys::SpacesLocateInfo {
        ty: sys::SpacesLocateInfo::TYPE,
        next: ptr::null(),
        base_space: stage.as_raw(),
        time: sys::Time::from_nanos(1),
        space_count: 2,
        spaces: spaces.as_ptr(),
    };
    let mut locations = sys::SpaceLocations {
        ty: sys::SpaceLocations::TYPE,
        next: ptr::null_mut(),
        location_count: 2,
        locations: located.as_mut_ptr(),
    };
    // SAFETY: the runtime verifies what it is given, and the name says which function it is.
    unsafe {
        let gipa = app.instance.fp().get_instance_proc_addr;
        let got = gipa(app.instance.as_raw(), c"xrLocateSpaces".as_ptr(), &mut function);
        assert_eq!(got, R::SUCCESS);
        let locate: sys::pfn::LocateSpaces = std::mem::transmute(function.unwrap());
        assert_eq!(locate(session.as_raw(), &info, &mut locations), R::SUCCESS);
        info.space_count = 1;
        let got = locate(session.as_raw(), &info, &mut locations);
        assert_eq!(got, R::ERROR_VALIDATION_FAILURE);
    }
    assert_eq!(located[0].pose.position.y, 1.6);
    assert_eq!(located[1].pose, xr::Posef::IDENTITY);
    assert_eq!(located[1].location_flags.into_raw(), 0xF);
}

#[test]
fn tracking_is_lost_and_found() {
    let span = |frames, tracking| TrackingSpan { frames, tracking };
    let app = App::new(MockConfig {
        tracking: vec![
            span(2..4, Tracking::GUESSED),
            span(4..5, Tracking::LOST),
            span(5..6, Tracking::ORIENTATION_ONLY),
        ],
        ..stepped()
    });
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    let space = |kind| session.create_reference_space(kind, xr::Posef::IDENTITY).unwrap();
    let (stage, view) = (space(xr::ReferenceSpaceType::STAGE), space(xr::ReferenceSpaceType::VIEW));
    let flags = |time| {
        let (flags, _) = session.locate_views(STEREO, time, &stage).unwrap();
        let location = view.locate(&stage, time).unwrap();
        assert_eq!(location.location_flags.into_raw(), flags.into_raw());
        flags.into_raw()
    };
    for wanted in [0xF, 0xF, 0x3, 0x3, 0x0, 0x5, 0xF] {
        let time = empty_frame(&mut waiter, &mut stream).predicted_display_time;
        assert_eq!(flags(time), wanted);
        // The eyes keep their place in the head.
        let (own, _) = session.locate_views(STEREO, time, &view).unwrap();
        assert_eq!(own.into_raw(), 0xF);
    }
    app.mock.set_tracking(Some(Tracking::LOST));
    assert_eq!(flags(xr::Time::from_nanos(1)), 0);
    app.mock.set_tracking(None);
    assert_eq!(flags(xr::Time::from_nanos(1)), 0xF);
}

#[test]
fn frames_that_need_no_picture() {
    let app = App::new(MockConfig { skip_rendering: vec![4..6, 8..9], keep_frames: 3, ..stepped() });
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    let asked: Vec<bool> = (0..10).map(|_| empty_frame(&mut waiter, &mut stream).should_render).collect();
    let wanted: Vec<bool> = (0..10).map(|i| !matches!(i, 0 | 1 | 4 | 5 | 8)).collect();
    assert_eq!(asked, wanted);
    let frames = app.mock.take_frames();
    assert_eq!(frames.iter().map(|it| it.index).collect::<Vec<_>>(), [7, 8, 9]);
    assert!((frames[2].script_time_s - 0.09).abs() < 1e-9);
    assert!(frames[2].views.is_empty() && frames[2].layer_count == 0);
    app.mock.set_should_render(Some(false));
    assert!(!empty_frame(&mut waiter, &mut stream).should_render);
    assert_eq!(app.mock.take_last_frame().map(|it| it.index), Some(10));
    assert!(app.mock.take_last_frame().is_none());
}

#[test]
fn formats_and_image_counts() {
    let app = App::new(MockConfig {
        formats: vec![vk::Format::B8G8R8A8_UNORM, vk::Format::D16_UNORM],
        image_count: 5,
        eye_size: [100, 200],
        ..stepped()
    });
    let (session, ..) = app.session();
    let offered = session.enumerate_swapchain_formats().unwrap();
    let wanted = [vk::Format::B8G8R8A8_UNORM, vk::Format::D16_UNORM];
    assert_eq!(offered, wanted.map(|format| format.as_raw() as u32));
    let chain = Chain::new(&session, vk::Format::D16_UNORM, [8, 8]);
    assert_eq!(chain.images.len(), 5);
    let views = app.instance.enumerate_view_configuration_views(app.system, STEREO).unwrap();
    assert_eq!(views[1].recommended_image_rect_height, 200);
}

#[test]
fn real_time_is_paced() {
    let app = App::new(MockConfig { clock: Clock::Real { hz: 250.0 }, ..stepped() });
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    let start = std::time::Instant::now();
    let times: Vec<i64> = (0..26)
        .map(|_| empty_frame(&mut waiter, &mut stream))
        .map(|state| state.predicted_display_time.as_nanos())
        .collect();
    assert!(start.elapsed() >= Duration::from_millis(95), "{:?}", start.elapsed());
    for pair in times.windows(2) {
        let step = pair[1] - pair[0];
        assert!(step > 0 && step % 4_000_000 == 0, "whole periods");
    }
    // A slow frame skips refreshes instead of piling up.
    std::thread::sleep(Duration::from_millis(50));
    let late = empty_frame(&mut waiter, &mut stream).predicted_display_time;
    assert!(late.as_nanos() - times[25] >= 40_000_000);
}
