//! A script plays: the file says what the headset is like and what happens when; what is wrong in it is named with its
//! line and what would be right.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "raw enumeration")]

mod mock_support;

use std::time::Duration;

use ash::vk;
use fathomless::mock::{
    Act, CallFault, Calls, Clock, Cue, Mask, Mock, MockConfig, Pose, Script, Timing, When, function_names,
};
use mock_support::{App, Chain, STEREO, begin, empty_frame, stepped};
use openxr as xr;
use xr::{SessionState as S, sys::Result as R};

const TOUR: &str = include_str!("../config/mock/tour.toml");

fn script(cues: &str) -> Script {
    let headset = "[headset]\nclock = \"stepped\"\nhz = 100\neye_size = [64, 48]\n";
    Script::from_toml(&format!("{headset}{cues}"), "test.toml").unwrap()
}

fn code<T>(result: Result<T, R>) -> R {
    result.err().unwrap_or(R::SUCCESS)
}

#[test]
fn a_user_quits_after_some_frames() {
    let app = App::with_mock(Mock::with_script(script("[[cue]]\nframe = 5\nsession = \"exit\"\n")));
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    let mut frames = 0;
    let mut seen = Vec::new();
    while !seen.contains(&S::STOPPING) {
        empty_frame(&mut waiter, &mut stream);
        frames += 1;
        seen.extend(app.poll());
    }
    assert_eq!(frames, 6, "frame 5 is the sixth");
    session.end().unwrap();
    assert_eq!(app.poll(), [S::IDLE, S::EXITING]);
    assert_eq!(app.mock.violations(), []);
}

#[test]
fn focus_comes_and_goes_and_the_session_is_lost() {
    let text = r#"
        [[cue]]
        frame = 4
        session = "visible"
        [[cue]]
        time_s = 0.06
        session = "focused"
        [[cue]]
        frame = 9
        session = "loss_pending"
        [[cue]]
        call = "xrWaitFrame"
        nth = 11
        session = "lost"
    "#;
    let app = App::with_mock(Mock::with_script(script(text)));
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    let mut states = Vec::new();
    for frame in 0..10 {
        empty_frame(&mut waiter, &mut stream);
        states.extend(app.poll().into_iter().map(|state| (frame, state)));
    }
    let wanted = [
        (0, S::SYNCHRONIZED),
        (1, S::VISIBLE),
        (2, S::FOCUSED),
        (4, S::VISIBLE),
        (6, S::FOCUSED),
        (9, S::LOSS_PENDING),
    ];
    assert_eq!(states, wanted);
    waiter.wait().unwrap();
    assert_eq!(code(stream.begin()), R::ERROR_SESSION_LOST);
    drop((session, waiter, stream));
    // The next session is as good as the first.
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    empty_frame(&mut waiter, &mut stream);
}

#[test]
fn calls_return_what_the_file_says() {
    let text = r#"
        [[fault]]
        call = "xrEnumerateReferenceSpaces"
        nth = 2
        returns = "XR_ERROR_OUT_OF_MEMORY"
        [[fault]]
        call = "xrEnumerateSwapchainFormats"
        from = 3
        returns = "XR_ERROR_LIMIT_REACHED"
        [[fault]]
        call = "xrRequestExitSession"
        returns = "XR_SESSION_LOSS_PENDING"
    "#;
    let parsed = script(text);
    assert_eq!(
        parsed.faults[2],
        CallFault { function: "xrRequestExitSession", calls: Calls::All, code: R::SESSION_LOSS_PENDING }
    );
    let app = App::with_mock(Mock::with_script(parsed));
    let (session, ..) = app.session();
    // Each enumeration is two calls.
    assert_eq!(code(session.enumerate_reference_spaces()), R::ERROR_OUT_OF_MEMORY);
    assert_eq!(code(session.enumerate_reference_spaces()), R::SUCCESS);
    assert_eq!(code(session.enumerate_swapchain_formats()), R::SUCCESS);
    assert_eq!(code(session.enumerate_swapchain_formats()), R::ERROR_LIMIT_REACHED);
    assert_eq!(code(session.enumerate_swapchain_formats()), R::ERROR_LIMIT_REACHED);
}

#[test]
fn a_list_that_grows_between_two_calls() {
    let text = r#"
        formats = ["R8G8B8A8_SRGB"]
        [[cue]]
        call = "xrEnumerateSwapchainFormats"
        formats = ["R8G8B8A8_SRGB", "D32_SFLOAT", "D16_UNORM"]
    "#;
    let app = App::with_mock(Mock::with_script(script(text)));
    let (session, ..) = app.session();
    let ask = |room: &mut [i64]| {
        let mut count = 0;
        // SAFETY: the capacity is true.
        let code = unsafe {
            let enumerate = app.instance.fp().enumerate_swapchain_formats;
            enumerate(session.as_raw(), room.len() as u32, &mut count, room.as_mut_ptr())
        };
        (code, count)
    };
    assert_eq!(ask(&mut []), (R::SUCCESS, 1));
    let mut room = [-1; 3];
    assert_eq!(ask(&mut room[..1]), (R::ERROR_SIZE_INSUFFICIENT, 3));
    assert_eq!(room, [-1; 3], "nothing is written when there is no room");
    assert_eq!(ask(&mut room), (R::SUCCESS, 3));
    assert_eq!(room, [43, 126, 124]);
}

#[test]
fn a_headset_that_sleeps_at_first() {
    let text = "asleep = true\n[[cue]]\ncall = \"xrPollEvent\"\nnth = 6\nsession = \"focused\"\n";
    let app = App::with_mock(Mock::with_script(script(text)));
    let (session, mut waiter, mut stream) = app.session();
    assert_eq!(app.poll(), [S::IDLE]);
    // An empty queue is two more calls each.
    let mut polls = 0;
    while app.poll().is_empty() {
        polls += 1;
        assert!(polls < 10);
    }
    assert_eq!(polls, 4);
    session.begin(STEREO).unwrap();
    empty_frame(&mut waiter, &mut stream);
}

#[test]
fn devices_come_and_go_and_are_pressed() {
    let text = r#"
        [start]
        connect = { "/user/hand/right" = "/interaction_profiles/oculus/touch_controller" }
        [[cue]]
        frame = 3
        input = { "/user/hand/right/input/trigger/value" = 0.5, "/user/hand/right/input/a/click" = true }
        [[cue]]
        frame = 4
        input = { "/user/hand/right/input/thumbstick" = [0.25, -1] }
        [[cue]]
        frame = 5
        connect = { "/user/hand/right" = "/interaction_profiles/khr/simple_controller" }
        [[cue]]
        frame = 6
        disconnect = ["/user/hand/right"]
        input = { "/user/hand/right/input/select/click" = true }
    "#;
    let app = App::with_mock(Mock::with_script(script(text)));
    let (session, mut waiter, mut stream) = app.session();
    let set = app.instance.create_action_set("all", "All", 0).unwrap();
    let trigger = set.create_action::<f32>("trigger", "Trigger", &[]).unwrap();
    let stick = set.create_action::<xr::Vector2f>("stick", "Stick", &[]).unwrap();
    let path = |text| app.instance.string_to_path(text).unwrap();
    let touch = path("/interaction_profiles/oculus/touch_controller");
    let bindings = [
        xr::Binding::new(&trigger, path("/user/hand/right/input/trigger/value")),
        xr::Binding::new(&stick, path("/user/hand/right/input/thumbstick")),
    ];
    app.instance.suggest_interaction_profile_bindings(touch, &bindings).unwrap();
    session.attach_action_sets(&[&set]).unwrap();
    begin(&app, &session);
    let mut seen = Vec::new();
    for _ in 0..7 {
        empty_frame(&mut waiter, &mut stream);
        app.poll();
        session.sync_actions(&[xr::ActiveActionSet::new(&set)]).unwrap();
        let (pulled, moved) = (
            trigger.state(&session, xr::Path::NULL).unwrap(),
            stick.state(&session, xr::Path::NULL).unwrap(),
        );
        seen.push((pulled.is_active, pulled.current_state, moved.current_state.y));
    }
    // The application has nothing for the simple controller, and nothing at all when that is gone.
    let (rest, gone) = ((true, 0.0, 0.0), (false, 0.0, 0.0));
    assert_eq!(seen[2..], [rest, (true, 0.5, 0.0), (true, 0.5, -1.0), gone, gone]);
    assert_eq!(app.mock.script_errors(), ["no device is connected at /user/hand/right"]);
}

#[test]
fn a_script_begins_when_it_is_played() {
    let app = App::new(stepped());
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    (0..5).for_each(|_| _ = empty_frame(&mut waiter, &mut stream));
    app.poll();
    let cue = |when, act| Cue { when, acts: vec![act] };
    let cues = vec![cue(When::Frame(2), Act::LoseFocus), cue(When::Seconds(0.04), Act::Hide)];
    app.mock.play(Script { cues, ..Script::default() });
    let told: Vec<_> = (0..5)
        .map(|_| {
            empty_frame(&mut waiter, &mut stream);
            app.poll()
        })
        .collect();
    assert_eq!(told, [vec![], vec![], vec![S::VISIBLE], vec![], vec![S::SYNCHRONIZED]]);
}

#[test]
fn the_instance_is_lost_on_time() {
    let text = "[[cue]]\nframe = 3\ninstance_loss_s = 0.015\n";
    let app = App::with_mock(Mock::with_script(script(text)));
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    (0..4).for_each(|_| _ = empty_frame(&mut waiter, &mut stream));
    assert_eq!(code(waiter.wait()), R::ERROR_INSTANCE_LOST);
}

#[test]
fn every_key_of_the_headset_arrives() {
    let Script { config, start, cues, faults } = Script::from_toml(TOUR, "config/mock/tour.toml").unwrap();
    let default = MockConfig::default();
    assert_eq!(config.clock, Clock::Stepped { hz: 90.0 });
    assert_eq!((config.eye_size, config.right_eye_size), ([64, 48], Some([48, 64])));
    assert_eq!(config.max_image_size, [4096; 2]);
    assert!((config.fov[0].left + 49f32.to_radians()).abs() < 1e-6);
    assert_eq!(config.fov[1], config.fov[0].mirrored());
    assert!((config.eye_turn[0].to_euler(glam::EulerRot::YXZ).0 - 5f32.to_radians()).abs() < 1e-6);
    assert_eq!(config.mask, Mask::Octagon { cut: 0.25 });
    assert_eq!(config.refresh_rates_hz, [72.0, 90.0, 120.0]);
    assert_eq!(config.local_origin, Pose::at(0.0, 1.6, 0.0));
    assert_eq!(config.bounds_m, Some([3.0, 3.0]));
    assert_eq!(config.tracking[0].frames, 12..14);
    assert!(config.skip_rendering.len() == 1 && config.skip_rendering[0] == (14..16));
    assert_eq!(config.timing[2].timing, Timing::Jitter { most_ns: 1_000_000 });
    assert_eq!(config.absent_extensions, ["XR_KHR_composition_layer_cube"]);
    assert_eq!(config.formats.len(), 3);
    assert_eq!((config.image_count, config.depth_image_count), (3, Some(2)));
    assert!(config.shuffle_images && config.image_timeouts == 1);
    assert_ne!(config.head, default.head);
    let recentre = Duration::from_millis(50);
    assert!(cues.iter().flat_map(|cue| &cue.acts).any(
        |act| matches!(act, Act::Recentre { new_in_previous, delay } if *delay == recentre && new_in_previous.position.x == 1.0)
    ));
    assert_eq!(start.len(), 4, "{start:?}");
    assert_eq!(faults[1].calls, Calls::Nth(9));
}

#[test]
fn the_tour_shows_every_key() {
    // What the reader itself says the keys are, table by table.
    let tables = [
        "zzz = 1",
        "[headset]\nzzz = 1",
        "[headset]\ntracking = [{ zzz = 1 }]",
        "[headset]\ntiming = [{ zzz = 1 }]",
        "[[cue]]\ntiming = { zzz = 1 }",
        "[[cue]]\nrecentre = { zzz = 1 }",
        "[headset]\nlocal_origin = { zzz = 1 }",
        "[[head]]\nzzz = 1",
        "[[cue]]\nzzz = 1",
        "[[cue]]\nperformance = { zzz = 1 }",
        "[[fault]]\nzzz = 1",
    ];
    for table in tables {
        let error = Script::from_toml(table, "x").unwrap_err();
        assert_eq!(error.problem, "unknown key `zzz`");
        let keys: Vec<&str> = error.remedy.split('`').skip(1).step_by(2).collect();
        assert!(!keys.is_empty(), "{error}");
        for key in keys {
            assert!(TOUR.contains(key), "the tour does not show {key}");
        }
    }
}

#[test]
fn the_tour_is_played_to_its_end() {
    let mock = Mock::with_script(Script::from_toml(TOUR, "config/mock/tour.toml").unwrap());
    let app = App::with_mock(mock);
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    let mut chain = Chain::new(&session, vk::Format::R8G8B8A8_SRGB, [64, 48]);
    // The first wait times out; the crate takes that for success.
    chain.swapchain.acquire_image().unwrap();
    chain.swapchain.wait_image(xr::Duration::NONE).unwrap();
    assert_eq!(code(chain.swapchain.release_image()), R::ERROR_CALL_ORDER_INVALID);
    let mut buffer = xr::EventDataBuffer::new();
    let (mut rendered, mut times, mut recentred, mut unknown) = (Vec::new(), Vec::new(), 0, 0);
    let mut exiting = false;
    while !exiting {
        let state = empty_frame(&mut waiter, &mut stream);
        rendered.push(state.should_render);
        times.push(state.predicted_display_time.as_nanos());
        assert!(times.len() < 60);
        while let Some(event) = app.instance.poll_event(&mut buffer).unwrap() {
            match event {
                xr::Event::SessionStateChanged(change) => exiting |= change.state() == S::STOPPING,
                xr::Event::ReferenceSpaceChangePending(_) => recentred += 1,
                xr::Event::EventsLost(lost) => unknown += lost.lost_event_count(),
                _ => {}
            }
        }
    }
    session.end().unwrap();
    assert_eq!(app.mock.script_errors(), [""; 0]);
    assert_eq!(app.mock.connected_profile("/user/hand/left"), None, "it went at frame 7");
    assert_eq!(times.len(), 41, "it says exit at frame 40");
    assert_eq!(recentred, 2 * 2 + 1, "LOCAL and LOCAL_FLOOR twice, the bounds of STAGE once");
    assert_eq!(unknown, 3);
    assert!(!rendered[1] && rendered[3] && !rendered[9] && !rendered[14], "{rendered:?}");
    let period = 1e9 / 120.0;
    let step = |frame: usize| (times[frame] - times[frame - 1]) as f64 / period;
    assert!((step(12) - 1.0).abs() < 0.01 && (step(16) - 2.0).abs() < 0.01 && (step(18) - 2.0).abs() < 0.01);
    assert!(step(22) > 6.0 && step(24) < 0.0, "a jump ahead and back");
    let views = app.instance.enumerate_view_configuration_views(app.system, STEREO).unwrap();
    let sizes = views.iter().map(|it| [it.recommended_image_rect_width, it.recommended_image_rect_height]);
    assert_eq!(sizes.collect::<Vec<_>>(), [[80, 60], [60, 80]]);
}

#[test]
fn errors_say_where_and_what_would_be_right() {
    let check = |text: &str, wanted: &str| {
        assert_eq!(Script::from_toml(text, "my.toml").unwrap_err().to_string(), wanted);
    };
    check(
        "[headset]\n\nipd_m = 2.5",
        "my.toml:3: `ipd_m` is 2.5; it should be a number of metres from 0 to 1",
    );
    check(
        "[headset]\nclock = \"slow\"",
        "my.toml:2: `clock` is \"slow\"; it should be one of \"real\", \"stepped\"",
    );
    check(
        "[[fault]]\ncall = \"xrNothing\"\nreturns = \"XR_SUCCESS\"",
        "my.toml:2: `call` is \"xrNothing\"; it should be the name of a function of the runtime, such as \"xrEndFrame\"",
    );
    check(
        "[[fault]]\ncall = \"xrEndFrame\"\nreturns = \"XR_ERROR_BAD\"",
        "my.toml:3: `returns` is \"XR_ERROR_BAD\"; it should be the name of an XrResult, such as \
         \"XR_ERROR_SESSION_LOST\" or \"XR_TIMEOUT_EXPIRED\"",
    );
    check(
        "[[cue]]\nframe = 1\ntime_s = 2\nsession = \"exit\"",
        "my.toml:1: this cue is not due at one moment; it should have one of `frame`, `time_s` and `call`, and `nth` \
         only with `call`",
    );
    check(
        "[[cue]]\nframe = 1",
        "my.toml:1: nothing happens in this cue; it should have a key such as `session`; config/mock/tour.toml shows \
         all of them",
    );
    check(
        "[[cue]]\nframe = \"soon\"\nsession = \"exit\"",
        "my.toml:2: `frame` is \"soon\"; it should be a frame number, from 0",
    );
    check(
        "[[fault]]\ncall = \"xrEndFrame\"",
        "my.toml:1: `returns` is missing; it should be the name of an XrResult, such as \"XR_ERROR_SESSION_LOST\" or \
         \"XR_TIMEOUT_EXPIRED\"",
    );
    check(
        "[headset]\neye_size = [0, 10]",
        "my.toml:2: `eye_size` is [0, 10]; it should be [width, height] in pixels, each from 1 to 65536",
    );
    check(
        "[[cue]]\nframe = 1\nrecentre = \"head\"",
        "my.toml:3: `recentre` is \"head\"; it should be a table such as { position = [1.0, 0.0, 0.0], \
         yaw_deg = 90, delay_s = 0.5 }",
    );
    check(
        "[start]\nconnect = { \"/user/hand/left\" = \"/interaction_profiles/a/b\" }",
        "my.toml:2: /interaction_profiles/a/b is no interaction profile of the OpenXR registry; paths, profiles and types \
         of values are those of the OpenXR registry",
    );
    check(
        "[start]\nframe = 1\nipd_m = 0.1",
        "my.toml:2: [start] has a moment; what is in [start] happens before anything else",
    );
    let error = Script::from_toml("[[cue]]\nframe = 1\nsesion = \"exit\"", "my.toml").unwrap_err();
    assert!(error.line == 3 && error.remedy.contains("`session`"), "{error}");
    assert!(Script::from_toml("", "empty.toml").unwrap().cues.is_empty());
}

#[test]
fn every_function_can_be_told_what_to_return() {
    for function in function_names() {
        let text = format!("[[fault]]\ncall = \"{function}\"\nreturns = \"XR_ERROR_INSTANCE_LOST\"");
        let script = Script::from_toml(&text, "x").unwrap();
        assert_eq!(script.faults[0].function, function);
    }
}
