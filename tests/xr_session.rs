//! The session against the mock runtime, on the software GPU under the validation layers: start to exit, and the odd
//! things on the way, without one violation of OpenXR's rules or one message about Vulkan's.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests stop at the first surprise")]
#![allow(
    unsafe_code,
    reason = "one test puts itself between the session and the mock, through the C interface"
)]

use std::collections::BTreeSet;
use std::sync::{Arc, mpsc};
use std::time::Duration;

use ash::vk;
use fathomless::gpu::{
    Access, Attachment, Commands, Gpu, GpuConfig, Load, Target, Transition, ValidationLog,
};
use fathomless::mock::{self, Calls, Clock, Mock, MockConfig, TrackingSpan};
use fathomless::xr::{
    Error, EyeImages, Lost, Origin, Outcome, Phase, Runtime, Session, SessionConfig, SessionInfo, Shown,
    Surface, Tracking, Views, outcome,
};
use glam::{Quat, Vec3};
use openxr::sys;

const NEAR_M: f32 = 0.05;
const SIZE: [u32; 2] = [48, 32];
/// Left and right, linear.
const COLOURS: [[f32; 4]; 2] = [[1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]];
const DEPTH: f32 = 0.25;
/// Iterations within which every state is reached.
const SOON: usize = 40;

/// A small headset in stepped time whose frames are read back.
fn headset() -> MockConfig {
    MockConfig {
        clock: Clock::Stepped { hz: 90.0 },
        eye_size: SIZE,
        read_back: true,
        keep_frames: 256,
        ..MockConfig::default()
    }
}

fn wishes() -> SessionConfig {
    SessionConfig { near_m: NEAR_M, ..SessionConfig::default() }
}

/// A session with everything it needs, in drop order.
struct Rig {
    session: Session,
    gpu: Arc<Gpu>,
    runtime: Runtime,
    mock: Mock,
    log: Arc<ValidationLog>,
}

impl Rig {
    fn new(config: MockConfig) -> Self {
        Self::with(config, wishes())
    }

    fn with(config: MockConfig, wishes: SessionConfig) -> Self {
        let mock = Mock::new(config);
        let entry = mock.entry().expect("the mock gives its entry points");
        Self::on(mock, entry, wishes)
    }

    fn on(mock: Mock, entry: openxr::Entry, wishes: SessionConfig) -> Self {
        let runtime = Runtime::open(entry, "xr_session").expect("the mock opens");
        let gpu = Gpu::new(&runtime, &GpuConfig { validate: true }).expect("a Vulkan device: see setup.sh");
        let session = Session::new(&runtime, &gpu, wishes).expect("a session");
        let log = gpu.validation_log();
        Self { session, gpu, runtime, mock, log }
    }

    /// One turn of an application's loop; the views drawn with, if anything was drawn.
    fn turn(&mut self) -> Result<(Phase, Option<Views>), Error> {
        let phase = self.session.poll()?;
        let Some(tick) = self.session.wait_frame()? else { return Ok((phase, None)) };
        let info = *self.session.info();
        let mut frame = self.session.begin_frame(tick)?;
        let drawn = match frame.acquire()? {
            Some(images) => {
                let views = frame.locate_views()?;
                self.gpu.run(|commands| clear(commands, &info, &images)).expect("the GPU works");
                Some(views)
            }
            None => None,
        };
        frame.end(drawn.as_ref())?;
        Ok((phase, drawn))
    }

    /// Turns until the session is in `wanted`.
    fn reach(&mut self, wanted: Phase) {
        for _ in 0..SOON {
            if self.turn().expect("a turn").0 == wanted {
                return;
            }
        }
        panic!("{wanted:?} is not reached, it stays {:?}", self.session.phase());
    }

    /// Turns this often and gives the views drawn with.
    fn views(&mut self, turns: usize) -> Vec<Views> {
        (0..turns).filter_map(|_| self.turn().expect("a turn").1).collect()
    }

    /// The next call of this function answers this.
    fn answer(&self, function: &str, code: sys::Result) {
        let next = self.mock.calls(function) + 1;
        self.mock.on_call(function, Calls::Nth(next), code).unwrap();
    }

    /// The error that ends the turns.
    fn fails(&mut self) -> Error {
        (0..SOON).find_map(|_| self.turn().err()).expect("an error")
    }

    /// Drops everything in order, and finds nothing to complain about.
    fn finish(self) -> Mock {
        let Self { session, gpu, runtime, mock, log, .. } = self;
        drop(session);
        drop(gpu);
        drop(runtime);
        assert_eq!(mock.violations(), []);
        assert_eq!(mock.leaks(), []);
        let said = log.report();
        assert_eq!(said.count, 0, "{:#?}", said.texts);
        mock
    }
}

/// Clears each eye to its colour, and depth to one value.
fn clear(commands: Commands<'_>, info: &SessionInfo, images: &EyeImages) {
    let draws_to = |surface: &Surface, aspect, layout| Transition {
        image: surface.image,
        aspect,
        from: (Access::ALL, surface.layout),
        to: (Access::ALL, layout),
    };
    let (colour, depth) =
        (vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL, vk::ImageLayout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL);
    commands.transition(&[
        draws_to(&images.color, vk::ImageAspectFlags::COLOR, colour),
        draws_to(&images.depth, vk::ImageAspectFlags::DEPTH, depth),
    ]);
    if info.multiview {
        // Both layers at once, to see that the views for it serve; overwritten below.
        commands.render(
            &Target {
                extent: images.extent,
                view_mask: 0b11,
                colour: &[Attachment::new(images.color.both, colour, Load::Colour([0.5; 4]))],
                depth: Some(Attachment::new(images.depth.both, depth, Load::Depth(0.5))),
            },
            |_| {},
        );
        commands.barrier(Access::ALL, Access::ALL);
    }
    for (eye, linear) in COLOURS.into_iter().enumerate() {
        let view = images.color.per_eye[eye];
        commands.render(
            &Target {
                extent: images.extent,
                view_mask: 0,
                colour: &[Attachment::new(view, colour, Load::Colour(linear))],
                depth: Some(Attachment::new(images.depth.per_eye[eye], depth, Load::Depth(DEPTH))),
            },
            |_| {},
        );
    }
}

fn pose_is(found: &mock::Pose, sent: &fathomless::xr::Pose) {
    assert_eq!(found.position, sent.position);
    assert_eq!(found.orientation, sent.orientation);
}

#[test]
fn a_whole_life_shows_both_eyes_with_their_depth() {
    let mut rig = Rig::new(headset());
    assert!(rig.session.info().depth_submitted);
    assert_eq!(rig.session.info().multiview, rig.gpu.info.multiview, "in one pass where the device can");
    assert_eq!(rig.session.origin(), Origin::Floor);
    rig.reach(Phase::Running(Shown::Focused));
    let drawn = rig.views(5);
    assert_eq!(drawn.len(), 5);
    rig.session.request_exit().unwrap();
    rig.reach(Phase::Exited);
    assert_eq!(rig.turn().unwrap().1, None, "no frames after the exit");
    let mock = rig.finish();

    let frames = mock.take_frames();
    let shown: Vec<_> = frames.iter().filter(|f| f.layer_count > 0).collect();
    assert!(shown.len() >= 5);
    for frame in &frames {
        assert_eq!(frame.layer_count, u32::from(frame.should_render), "frame {}", frame.index);
        assert_eq!(frame.display_time_ns, frame.predicted_display_time_ns);
    }
    for frame in shown {
        for (eye, bytes) in [[255, 0, 0, 255], [0, 0, 255, 255]].into_iter().enumerate() {
            let view = &frame.views[eye];
            assert_eq!(view.size, SIZE);
            assert!(view.rgba.chunks_exact(4).all(|pixel| pixel == bytes), "eye {eye}");
            let depth = view.depth.as_ref().expect("depth");
            assert_eq!((depth.min_depth, depth.max_depth), (0.0, 1.0));
            assert_eq!((depth.near_z, depth.far_z), (f32::INFINITY, NEAR_M));
            assert!(depth.values.iter().all(|&d| d == DEPTH));
        }
    }
    let last = frames.iter().rfind(|f| f.layer_count > 0).unwrap();
    for eye in 0..2 {
        pose_is(&last.views[eye].pose, &drawn[4].eyes[eye].pose);
    }
}

#[test]
fn frames_that_nobody_would_see_are_ended_empty() {
    let mut rig = Rig::new(MockConfig { skip_rendering: vec![8..10, 11..13], ..headset() });
    rig.views(16);
    let mock = rig.finish();
    let frames = mock.take_frames();
    let skipped: Vec<_> = frames.iter().filter(|f| [8, 9, 11, 12].contains(&f.index)).collect();
    assert_eq!(skipped.len(), 4);
    assert!(skipped.iter().all(|f| !f.should_render && f.layer_count == 0));
    assert!(frames.iter().filter(|f| f.index == 10 || f.index > 12).all(|f| f.layer_count == 1));
}

#[test]
fn focus_comes_and_goes() {
    let mut rig = Rig::new(headset());
    rig.reach(Phase::Running(Shown::Focused));
    rig.mock.lose_focus();
    rig.reach(Phase::Running(Shown::Visible));
    assert!(!rig.views(2).is_empty(), "what is seen without focus is drawn");
    rig.mock.hide();
    rig.reach(Phase::Running(Shown::Hidden));
    assert!(rig.views(2).is_empty(), "what is not seen is not drawn");
    rig.mock.gain_focus();
    rig.reach(Phase::Running(Shown::Focused));
    rig.finish();
}

#[test]
fn a_headset_put_down_and_taken_up_again_goes_on_with_the_same_session() {
    let mut rig = Rig::new(headset());
    rig.reach(Phase::Running(Shown::Focused));
    rig.mock.stop_session();
    rig.reach(Phase::Idle);
    assert_eq!(rig.turn().unwrap(), (Phase::Idle, None));
    rig.mock.gain_focus();
    rig.reach(Phase::Running(Shown::Focused));
    assert!(!rig.views(2).is_empty());
    rig.finish();
}

#[test]
fn an_exit_asked_for_before_the_session_runs_is_an_exit() {
    let mut rig = Rig::new(headset());
    rig.session.request_exit().unwrap();
    assert_eq!(rig.turn().unwrap().0, Phase::Exited);
    rig.finish();
}

#[test]
fn a_session_dropped_in_the_middle_of_a_frame_ends_it() {
    let mut rig = Rig::new(headset());
    rig.reach(Phase::Running(Shown::Focused));
    let tick = rig.session.wait_frame().unwrap().unwrap();
    let mut frame = rig.session.begin_frame(tick).unwrap();
    frame.acquire().unwrap().unwrap();
    drop(frame);
    let _unused = rig.session.wait_frame().unwrap().unwrap();
    assert_eq!(rig.views(1).len(), 1, "frames go on after abandoned ones");
    let _unused = rig.session.wait_frame().unwrap().unwrap();
    assert_eq!(rig.session.oddities(), Default::default());
    let mock = rig.finish();
    let frames = mock.take_frames();
    let layers: Vec<_> = frames.iter().rev().take(4).map(|f| f.layer_count).collect();
    assert_eq!(layers, [0, 1, 0, 0]);
}

#[test]
fn a_tick_serves_only_the_frame_it_was_waited_for() {
    let mut rig = Rig::new(headset());
    rig.reach(Phase::Running(Shown::Focused));
    let old = rig.session.wait_frame().unwrap().unwrap();
    let new = rig.session.wait_frame().unwrap().unwrap();
    assert!(new.display_time_ns > old.display_time_ns);
    assert!(rig.session.begin_frame(old).is_err());
    rig.session.begin_frame(new).unwrap().end(None).unwrap();
    rig.finish();
}

#[test]
fn waiting_for_a_frame_leaves_the_queue_to_others() {
    let mut rig = Rig::new(headset());
    rig.reach(Phase::Running(Shown::Focused));
    let (held, is_held) = mpsc::channel();
    let (done, is_done) = mpsc::channel();
    let gpu = Arc::clone(&rig.gpu);
    let holder = std::thread::spawn(move || {
        gpu.with_queue(|_| {
            held.send(()).unwrap();
            // Gives up after a while, so that a failure is a failure and not a hang.
            is_done.recv_timeout(Duration::from_secs(60))
        })
    });
    is_held.recv().unwrap();
    let tick = rig.session.wait_frame().unwrap().unwrap();
    done.send(()).ok();
    assert_eq!(holder.join().unwrap(), Ok(()), "xrWaitFrame was called with the queue held");
    rig.session.begin_frame(tick).unwrap().end(None).unwrap();
    rig.finish();
}

#[test]
fn a_session_may_move_to_another_thread() {
    fn moves<T: Send>() {}
    moves::<Session>();
    moves::<Runtime>();
}

#[test]
fn a_runtime_of_1_0_is_spoken_to_in_1_0() {
    let mut rig = Rig::new(MockConfig { max_api_version: (1, 0), ..headset() });
    let about = rig.runtime.info();
    assert_eq!((about.api_version.major(), about.api_version.minor()), (1, 0));
    assert!(about.local_floor, "the floor comes by extension");
    assert_eq!(rig.session.origin(), Origin::Floor);
    rig.reach(Phase::Running(Shown::Focused));
    rig.finish();
}

#[test]
fn without_the_depth_extension_depth_is_kept_and_the_picture_shown() {
    let mut rig = Rig::new(MockConfig {
        absent_extensions: vec!["XR_KHR_composition_layer_depth".into()],
        ..headset()
    });
    assert!(!rig.session.info().depth_submitted);
    rig.reach(Phase::Running(Shown::Focused));
    rig.views(2);
    let mock = rig.finish();
    let frame = mock.take_last_frame().unwrap();
    assert_eq!(frame.layer_count, 1);
    assert!(frame.views.iter().all(|view| view.depth.is_none()));
    assert_eq!(frame.views[1].pixel(3, 5), Some([0, 0, 255, 255]));
}

#[test]
fn without_a_depth_format_depth_is_kept() {
    let formats = vec![vk::Format::B8G8R8A8_UNORM, vk::Format::D16_UNORM];
    let mut rig = Rig::new(MockConfig { formats, ..headset() });
    let info = *rig.session.info();
    assert!(!info.depth_submitted && info.encode_srgb);
    assert_eq!(info.color_format, vk::Format::B8G8R8A8_UNORM);
    rig.reach(Phase::Running(Shown::Focused));
    assert!(!rig.views(2).is_empty());
    let mock = rig.finish();
    let frame = mock.take_last_frame().unwrap();
    assert_eq!(frame.views[0].pixel(0, 0), Some([255, 0, 0, 255]));
}

/// An old runtime without `LOCAL_FLOOR`.
fn floorless() -> MockConfig {
    MockConfig { max_api_version: (1, 0), absent_extensions: vec!["XR_EXT_local_floor".into()], ..headset() }
}

#[test]
fn without_a_local_floor_the_stage_tells_its_height() {
    let mut floor = Rig::new(headset());
    floor.reach(Phase::Running(Shown::Focused));
    let expected = floor.views(1)[0].head;
    floor.finish();

    let mut rig = Rig::new(floorless());
    rig.reach(Phase::Running(Shown::Focused));
    assert_eq!(rig.session.origin(), Origin::FloorFromStage);
    let head = rig.views(1)[0].head;
    assert!(head.position.distance(expected.position) < 1e-4, "{head:?} is not {expected:?}");
    rig.finish();
}

#[test]
fn without_a_stage_the_origin_is_at_the_eyes() {
    let mut rig = Rig::new(MockConfig { stage: false, ..floorless() });
    rig.reach(Phase::Running(Shown::Focused));
    assert_eq!(rig.session.origin(), Origin::Eyes);
    let views = rig.views(1);
    assert!(views[0].head.position.y.abs() < 0.5);
    rig.finish();
}

#[test]
fn lost_tracking_keeps_the_last_pose() {
    let keys = [0.0, 1.0].map(|s: f64| {
        let turned = Quat::from_rotation_y(s as f32);
        (s, mock::Pose::new(Vec3::new(s as f32, 1.7, 0.0), turned))
    });
    let mut rig = Rig::new(MockConfig {
        head: mock::PoseTrack::new(keys),
        tracking: vec![
            TrackingSpan { frames: 10..15, tracking: mock::Tracking::LOST },
            TrackingSpan { frames: 15..20, tracking: mock::Tracking::ORIENTATION_ONLY },
        ],
        ..headset()
    });
    let views = rig.views(25);
    let lost: Vec<_> = views.iter().filter(|v| v.tracking == Tracking::Lost).collect();
    let turning: Vec<_> = views.iter().filter(|v| v.tracking == Tracking::OrientationOnly).collect();
    let before = views.iter().take_while(|v| v.tracking == Tracking::Full).last().unwrap();
    assert_eq!((lost.len(), turning.len()), (5, 5));
    for view in lost {
        assert!(view.head.position.distance(before.head.position) < 1e-6);
        assert!(view.head.orientation.angle_between(before.head.orientation) < 1e-3);
        assert!(view.eyes[1].pose.position.distance(before.eyes[1].pose.position) < 1e-5);
    }
    for view in turning {
        assert!(view.head.position.distance(before.head.position) < 1e-6, "the place is kept");
        assert!(view.head.orientation.angle_between(before.head.orientation) > 0.04, "the direction is not");
    }
    assert_eq!(views.last().unwrap().tracking, Tracking::Full);
    rig.finish();
}

#[test]
fn tracking_lost_from_the_start_shows_something_all_the_same() {
    let all = TrackingSpan { frames: 0..1000, tracking: mock::Tracking::LOST };
    let mut rig = Rig::new(MockConfig { tracking: vec![all], ..headset() });
    rig.reach(Phase::Running(Shown::Focused));
    let views = rig.views(1);
    assert!(views[0].head.position.y > 1.0, "eyes are above the floor");
    rig.finish();
}

#[test]
fn a_lost_session_is_said_to_be_lost() {
    for function in ["xrWaitFrame", "xrBeginFrame", "xrAcquireSwapchainImage", "xrLocateViews", "xrEndFrame"]
    {
        let mut rig = Rig::new(headset());
        rig.reach(Phase::Running(Shown::Focused));
        rig.mock.on_call(function, Calls::All, sys::Result::ERROR_SESSION_LOST).unwrap();
        assert_eq!(rig.fails().lost(), Some(Lost::Session), "{function}");
        let log = rig.log.report();
        assert_eq!(log.count, 0, "{function}: {:?}", log.texts);
    }
}

/// A life of a few frames from the opening of the runtime to its end, everything dropped, or the first error.
fn life(mock: &Mock, log: &mut Option<Arc<ValidationLog>>) -> anyhow::Result<()> {
    let runtime = Runtime::open(mock.entry().unwrap(), "xr_session")?;
    let gpu = Gpu::new(&runtime, &GpuConfig { validate: true })?;
    *log = Some(gpu.validation_log());
    let session = Session::new(&runtime, &gpu, wishes())?;
    let log = gpu.validation_log();
    let mut rig = Rig { session, gpu, runtime, mock: mock.clone(), log };
    for turn in 0..SOON {
        match rig.turn()? {
            (Phase::Exited, _) => return Ok(()),
            (Phase::Running(Shown::Focused), Some(_)) if turn >= 6 => {
                rig.session.request_exit()?;
            }
            _ => {}
        }
    }
    panic!("the life does not end, it stays {:?}", rig.session.phase());
}

#[test]
fn whatever_call_fails_the_error_is_typed_and_everything_is_cleaned_up() {
    let clean = Mock::new(floorless());
    life(&clean, &mut None).unwrap();
    let used: Vec<_> = mock::function_names()
        .map(|name| (name, clean.calls(name)))
        .filter(|(name, calls)| {
            *calls > 0 && !name.starts_with("xrDestroy") && *name != "xrGetInstanceProcAddr"
        })
        .collect();
    assert!(used.len() >= 29, "{used:?}");
    for (name, calls) in used {
        for nth in BTreeSet::from([1, calls.div_ceil(2), calls]) {
            for code in [
                sys::Result::ERROR_SESSION_LOST,
                sys::Result::ERROR_INSTANCE_LOST,
                sys::Result::ERROR_RUNTIME_FAILURE,
            ] {
                let case = format!("{name}, call {nth} of {calls}, {code:?}");
                let mock = Mock::new(floorless());
                mock.on_call(name, Calls::Nth(nth), code).unwrap();
                let mut log = None;
                let lived = life(&mock, &mut log);
                if outcome(name, code) == Outcome::GoOn {
                    lived.unwrap_or_else(|error| panic!("{case}: {error:#}"));
                    continue;
                }
                let error = lived.expect_err(&case);
                let typed = error.downcast_ref::<Error>().unwrap_or_else(|| panic!("{case}: {error:#}"));
                match (code, typed) {
                    (sys::Result::ERROR_SESSION_LOST, Error::Lost(Lost::Session)) => {}
                    (sys::Result::ERROR_INSTANCE_LOST, Error::Lost(Lost::Instance)) => {}
                    (sys::Result::ERROR_RUNTIME_FAILURE, Error::Call { call, .. }) => {
                        assert_eq!(*call, name, "{case}")
                    }
                    _ => panic!("{case}: {error:#}"),
                }
                assert_eq!(mock.violations(), [], "{case}");
                assert_eq!(mock.leaks(), [], "{case}");
                let said = log.map_or_else(Vec::new, |log| log.report().texts);
                assert!(said.is_empty(), "{case}: {said:#?}");
            }
        }
    }
}

#[test]
fn a_loss_that_is_announced_is_said_and_the_session_can_be_made_anew() {
    let mut rig = Rig::new(headset());
    rig.reach(Phase::Running(Shown::Focused));
    rig.mock.lose_session();
    assert_eq!(rig.fails().lost(), Some(Lost::Session));
    assert_eq!(rig.fails().lost(), Some(Lost::Session), "once lost, lost");

    let Rig { session, gpu, mut runtime, mock, log } = rig;
    drop(session);
    runtime.find_headset().unwrap();
    let session = Session::new(&runtime, &gpu, wishes()).unwrap();
    let mut rig = Rig { session, gpu, runtime, mock, log };
    rig.reach(Phase::Running(Shown::Focused));
    rig.finish();
}

#[test]
fn a_loss_announced_by_a_result_code_is_a_loss() {
    let mut rig = Rig::new(headset());
    rig.reach(Phase::Running(Shown::Focused));
    rig.answer("xrEndFrame", sys::Result::SESSION_LOSS_PENDING);
    assert_eq!(rig.fails().lost(), Some(Lost::Session));
    rig.finish();
}

#[test]
fn a_session_that_dies_without_a_word_is_lost() {
    let mut rig = Rig::new(headset());
    rig.reach(Phase::Running(Shown::Focused));
    rig.mock.kill_session();
    assert_eq!(rig.fails().lost(), Some(Lost::Session));
    rig.finish();
}

#[test]
fn a_discarded_frame_is_counted_and_the_next_one_shown() {
    let mut rig = Rig::new(headset());
    rig.reach(Phase::Running(Shown::Focused));
    rig.answer("xrBeginFrame", sys::Result::FRAME_DISCARDED);
    assert_eq!(rig.views(2).len(), 2);
    assert_eq!(rig.session.oddities().frames_discarded, 1);
    rig.finish();
}

#[test]
fn a_frame_whose_layers_are_refused_is_ended_all_the_same() {
    let mut rig = Rig::new(headset());
    rig.reach(Phase::Running(Shown::Focused));
    rig.answer("xrEndFrame", sys::Result::ERROR_LAYER_INVALID);
    let error = rig.turn().unwrap_err();
    assert!(error.to_string().contains("xrEndFrame"), "{error}");
    assert_eq!(rig.views(2).len(), 2);
    let mock = rig.finish();
    let layers: Vec<_> = mock.take_frames().iter().rev().take(3).map(|f| f.layer_count).collect();
    assert_eq!(layers, [1, 1, 0]);
}

#[test]
fn a_lost_instance_is_said_to_be_lost() {
    let mut rig = Rig::new(headset());
    rig.reach(Phase::Running(Shown::Focused));
    rig.mock.lose_instance(Duration::ZERO);
    assert_eq!(rig.fails().lost(), Some(Lost::Instance));
}

#[test]
fn an_image_that_is_not_free_in_time_is_not_drawn_to() {
    let mut rig = Rig::new(headset());
    rig.reach(Phase::Running(Shown::Focused));
    rig.answer("xrWaitSwapchainImage", sys::Result::TIMEOUT_EXPIRED);
    assert_eq!(rig.views(3).len(), 2, "one frame goes without a picture, the next ones have theirs");
    assert_eq!(rig.session.oddities().images_late, 1);
    rig.finish();
}

#[test]
fn no_headset_is_an_error_to_wait_on() {
    let mock = Mock::new(MockConfig { unavailable_calls: 1, ..headset() });
    let open = || Runtime::open(mock.entry().unwrap(), "xr_session");
    assert!(matches!(open(), Err(Error::Unavailable(_))));
    assert!(open().is_ok());
    assert_eq!(mock.violations(), []);
}

#[test]
fn a_runtime_without_vulkan_is_an_error_to_stop_on() {
    let mock = Mock::new(MockConfig { absent_extensions: vec!["XR_KHR_vulkan_enable2".into()], ..headset() });
    let error = Runtime::open(mock.entry().unwrap(), "xr_session").err().unwrap();
    assert!(matches!(&error, Error::Unsupported(text) if text.contains("Vulkan")), "{error}");
}

#[test]
fn the_size_asked_for_is_the_size_drawn() {
    let mut rig =
        Rig::with(headset(), SessionConfig { eye_size: Some([40, 24]), multiview: false, ..wishes() });
    assert!(!rig.session.info().multiview);
    rig.reach(Phase::Running(Shown::Focused));
    rig.views(2);
    let mock = rig.finish();
    assert_eq!(mock.take_last_frame().unwrap().views[1].size, [40, 24]);
}

/// Stands between the session and the mock, and makes the right eye of the headset larger.
mod uneven {
    use super::*;
    use std::cell::Cell;
    use std::ffi::{CStr, c_char};

    thread_local! {
        static MOCK: Cell<Option<sys::pfn::GetInstanceProcAddr>> = const { Cell::new(None) };
        /// Eyes that the headset is said to have.
        pub static EYES: Cell<u32> = const { Cell::new(2) };
    }

    /// Entry points of the mock, with ours among them. For use by the thread that asks only.
    pub fn entry(mock: &Mock) -> openxr::Entry {
        MOCK.set(Some(mock.entry().unwrap().fp().get_instance_proc_addr));
        // SAFETY: ours forwards to the mock's, which keeps to the specification.
        unsafe { openxr::Entry::from_get_instance_proc_addr(get_proc, &()) }.unwrap()
    }

    unsafe extern "system" fn get_proc(
        instance: sys::Instance,
        name: *const c_char,
        function: *mut Option<sys::pfn::VoidFunction>,
    ) -> sys::Result {
        // SAFETY: the caller's arguments, passed on; one function is exchanged for another of its type.
        unsafe {
            let code = MOCK.get().unwrap()(instance, name, function);
            if CStr::from_ptr(name) == c"xrEnumerateViewConfigurationViews" {
                let ours: sys::pfn::EnumerateViewConfigurationViews = views;
                *function = Some(std::mem::transmute::<
                    sys::pfn::EnumerateViewConfigurationViews,
                    sys::pfn::VoidFunction,
                >(ours));
            }
            code
        }
    }

    unsafe extern "system" fn views(
        instance: sys::Instance,
        system: sys::SystemId,
        kind: sys::ViewConfigurationType,
        capacity: u32,
        count: *mut u32,
        views: *mut sys::ViewConfigurationView,
    ) -> sys::Result {
        let mut real = None;
        // SAFETY: the caller's arguments, passed on to the mock's own function.
        unsafe {
            let name = c"xrEnumerateViewConfigurationViews".as_ptr();
            MOCK.get().unwrap()(instance, name, &mut real);
            let real = std::mem::transmute::<
                Option<sys::pfn::VoidFunction>,
                Option<sys::pfn::EnumerateViewConfigurationViews>,
            >(real);
            if EYES.get() != 2 {
                *count = EYES.get();
                return sys::Result::SUCCESS;
            }
            let code = real.unwrap()(instance, system, kind, capacity, count, views);
            if capacity == 2 {
                (*views.add(1)).recommended_image_rect_width += 16;
                (*views.add(1)).recommended_image_rect_height -= 8;
            }
            code
        }
    }
}

#[test]
fn a_headset_of_other_than_two_eyes_is_an_error_to_stop_on() {
    for eyes in [0, 1, 4] {
        let mock = Mock::new(headset());
        let entry = uneven::entry(&mock);
        uneven::EYES.set(eyes);
        let error = Runtime::open(entry, "xr_session").err().unwrap();
        assert!(matches!(&error, Error::Unsupported(text) if text.contains("stereo")), "{eyes}: {error}");
        assert_eq!(mock.violations(), []);
    }
}

#[test]
fn eyes_of_different_sizes_get_the_larger_of_both() {
    let mock = Mock::new(headset());
    let entry = uneven::entry(&mock);
    let mut rig = Rig::on(mock, entry, wishes());
    let eyes = rig.runtime.info().eyes;
    assert_eq!([eyes[0].recommended, eyes[1].recommended], [SIZE, [SIZE[0] + 16, SIZE[1] - 8]]);
    rig.reach(Phase::Running(Shown::Focused));
    rig.views(2);
    let mock = rig.finish();
    let frame = mock.take_last_frame().unwrap();
    for view in &frame.views {
        assert_eq!(view.size, [SIZE[0] + 16, SIZE[1]]);
    }
    assert_ne!(frame.views[0].fov, frame.views[1].fov, "each eye keeps its own field of view");
}
