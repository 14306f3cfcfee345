//! The headset can be any: eyes of two sizes, canted, with fields of view that change; images in any number and order;
//! frames late, at half rate, jittering, predicted wrongly; and the compositor's layers are what was submitted.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "layers the crate has no names for, and raw codes")]

mod mock_support;

use std::{collections::HashSet, ptr};

use ash::vk;
use fathomless::mock::{
    Act, Clock, Fov, Mock, MockConfig, Pose, SubmittedFrame, Timing, TimingSpan, Tracking, TrackingSpan,
};
use glam::{Quat, Vec3};
use mock_support::{App, Chain, STEREO, assert_documented, begin, empty_frame, extensions, focus, stepped};
use openxr as xr;
use xr::sys::{self, Handle as _, Result as R};

fn code<T>(result: Result<T, R>) -> R {
    result.err().unwrap_or(R::SUCCESS)
}

fn pose_of(pose: xr::Posef) -> Pose {
    let (p, q) = (pose.position, pose.orientation);
    Pose::new(Vec3::new(p.x, p.y, p.z), Quat::from_xyzw(q.x, q.y, q.z, q.w))
}

fn sizes(app: &App) -> Vec<[u32; 2]> {
    let views = app.instance.enumerate_view_configuration_views(app.system, STEREO).unwrap();
    views.iter().map(|it| [it.recommended_image_rect_width, it.recommended_image_rect_height]).collect()
}

#[test]
fn eyes_of_two_sizes() {
    let config = MockConfig { right_eye_size: Some([80, 96]), fov_mutable: false, ..stepped() };
    let app = App::new(config);
    assert_eq!(sizes(&app), [[64, 48], [80, 96]]);
    assert!(!app.instance.view_configuration_properties(app.system, STEREO).unwrap().fov_mutable);
    app.mock.perform(Act::EyeSizes([[32, 32], [16, 64]]));
    assert_eq!(sizes(&app), [[32, 32], [16, 64]]);
}

#[test]
fn canted_displays() {
    let turn = [Quat::from_rotation_y(0.1), Quat::from_rotation_y(-0.1)];
    let head = Pose::new(Vec3::new(1.0, 2.0, 3.0), Quat::from_rotation_x(0.4));
    let app = App::new(MockConfig { eye_turn: turn, ipd_m: 0.06, ..stepped() });
    let (session, ..) = app.session();
    begin(&app, &session);
    app.mock.hold_head(head);
    let stage = session.create_reference_space(xr::ReferenceSpaceType::STAGE, xr::Posef::IDENTITY).unwrap();
    let eyes = || session.locate_views(STEREO, xr::Time::from_nanos(1), &stage).unwrap().1;
    for (i, (view, x)) in eyes().iter().zip([-0.03, 0.03]).enumerate() {
        let (pose, wanted) = (pose_of(view.pose), head.then(Pose::new(Vec3::new(x, 0.0, 0.0), turn[i])));
        assert!(pose.position.distance(wanted.position) < 1e-6);
        assert!(pose.orientation.angle_between(wanted.orientation) < 1e-3);
    }
    app.mock.perform(Act::EyeTurn([Quat::IDENTITY; 2]));
    app.mock.set_ipd(0.1);
    let [left, right] = [0, 1].map(|i| pose_of(eyes()[i].pose));
    assert!(left.orientation.angle_between(head.orientation) < 1e-3);
    assert!((left.position.distance(right.position) - 0.1).abs() < 1e-6);
    let narrow = Fov { left: -0.3, right: 0.4, up: 0.2, down: -0.1 };
    app.mock.set_fov([narrow, narrow.mirrored()]);
    assert_eq!((eyes()[0].fov.angle_left, eyes()[1].fov.angle_right), (-0.3, 0.3));
}

#[test]
fn images_in_any_number_and_order() {
    for (colour, depth) in [(1, 5), (2, 1), (5, 2)] {
        let app = App::new(MockConfig {
            image_count: colour,
            depth_image_count: Some(depth),
            shuffle_images: true,
            ..stepped()
        });
        let (session, mut waiter, mut stream) = app.session();
        begin(&app, &session);
        empty_frame(&mut waiter, &mut stream);
        let mut chain = Chain::new(&session, vk::Format::R8G8B8A8_SRGB, [8, 8]);
        assert_eq!(chain.images.len(), colour as usize);
        assert_eq!(Chain::new(&session, vk::Format::D32_SFLOAT, [8, 8]).images.len(), depth as usize);
        // All at once: each image once.
        let all: HashSet<u32> = (0..colour).map(|_| chain.swapchain.acquire_image().unwrap()).collect();
        assert_eq!(all, (0..colour).collect());
        assert_eq!(code(chain.swapchain.acquire_image()), R::ERROR_CALL_ORDER_INVALID);
        for _ in 0..colour {
            chain.swapchain.wait_image(xr::Duration::INFINITE).unwrap();
            chain.swapchain.release_image().unwrap();
        }
        // One by one: not in turn.
        let order: Vec<u32> = (0..40)
            .map(|_| {
                let index = chain.swapchain.acquire_image().unwrap();
                chain.swapchain.wait_image(xr::Duration::INFINITE).unwrap();
                chain.swapchain.release_image().unwrap();
                index
            })
            .collect();
        assert_eq!(order.iter().copied().collect::<HashSet<_>>().len(), colour as usize);
        if colour > 1 {
            assert!(order.windows(2).any(|pair| pair[1] != (pair[0] + 1) % colour), "{order:?}");
        }
        assert_documented(&app.mock);
        app.mock.perform(Act::ShuffleImages(false));
        let first = chain.swapchain.acquire_image().unwrap();
        chain.swapchain.wait_image(xr::Duration::INFINITE).unwrap();
        chain.swapchain.release_image().unwrap();
        assert_eq!(chain.swapchain.acquire_image().unwrap(), (first + 1) % colour);
    }
}

#[test]
fn a_wait_for_an_image_times_out_and_then_succeeds() {
    for clock in [Clock::Stepped { hz: 100.0 }, Clock::Real { hz: 100.0 }] {
        let app = App::new(MockConfig { image_timeouts: 2, clock, ..stepped() });
        let (session, ..) = app.session();
        let mut chain = Chain::new(&session, vk::Format::R8G8B8A8_SRGB, [8, 8]);
        chain.swapchain.acquire_image().unwrap();
        let wait = |timeout| {
            let info = sys::SwapchainImageWaitInfo {
                ty: sys::SwapchainImageWaitInfo::TYPE,
                next: ptr::null(),
                timeout: sys::Duration::from_nanos(timeout),
            };
            // SAFETY: the runtime verifies what it is given.
            unsafe { (app.instance.fp().wait_swapchain_image)(chain.swapchain.as_raw(), &info) }
        };
        let start = std::time::Instant::now();
        assert_eq!(wait(130_000_000), R::TIMEOUT_EXPIRED);
        assert_eq!(wait(0), R::TIMEOUT_EXPIRED);
        if matches!(clock, Clock::Real { .. }) {
            assert!(start.elapsed().as_millis() >= 130, "a timeout takes its time");
        }
        assert_eq!(wait(0), R::SUCCESS);
        assert_eq!(wait(0), R::ERROR_CALL_ORDER_INVALID);
    }
}

/// Predicted times of the first frames, in periods after the first one, and the periods that go with them.
fn predictions(timing: Vec<TimingSpan>, frames: usize) -> (Vec<f64>, Vec<i64>) {
    let app = App::new(MockConfig { timing, ..stepped() });
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    let states: Vec<_> = (0..frames).map(|_| empty_frame(&mut waiter, &mut stream)).collect();
    let first = states[0].predicted_display_time.as_nanos();
    let periods = |state: &xr::FrameState| (state.predicted_display_time.as_nanos() - first) as f64 / 1e7;
    let lengths = states.iter().map(|state| state.predicted_display_period.as_nanos());
    (states.iter().map(periods).collect(), lengths.collect())
}

fn span(frames: std::ops::Range<u64>, timing: Timing) -> Vec<TimingSpan> {
    vec![TimingSpan { frames, timing }]
}

#[test]
fn frames_are_late_or_at_half_rate() {
    let (times, periods) = predictions(span(2..3, Timing::Late { periods: 4 }), 5);
    assert_eq!(times, [0.0, 1.0, 5.0, 6.0, 7.0]);
    assert_eq!(periods, [10_000_000; 5]);
    let (times, periods) = predictions(span(2..4, Timing::Every { periods: 2 }), 5);
    assert_eq!(times, [0.0, 1.0, 3.0, 5.0, 6.0]);
    assert_eq!(periods, [10_000_000, 10_000_000, 20_000_000, 20_000_000, 10_000_000]);
}

#[test]
fn jitter_keeps_the_order_of_frames() {
    let (times, _) = predictions(span(1..60, Timing::Jitter { most_ns: 100_000_000 }), 60);
    assert!(times.windows(2).all(|pair| pair[0] < pair[1]), "{times:?}");
    let off: Vec<f64> = times.iter().enumerate().map(|(i, time)| time - i as f64).collect();
    assert!(off.iter().all(|off| off.abs() < 0.5) && off.iter().any(|off| off.abs() > 0.2), "{off:?}");
}

#[test]
fn predictions_jump_ahead_or_freeze() {
    let (times, _) = predictions(span(2..4, Timing::Ahead { ns: 1_000_000_000 }), 5);
    assert_eq!(times, [0.0, 1.0, 102.0, 103.0, 4.0]);
    let (times, _) = predictions(span(2..4, Timing::Frozen), 5);
    assert_eq!(times, [0.0, 1.0, 1.0, 1.0, 4.0]);
}

#[test]
fn half_rate_in_real_time_is_paced() {
    let timing = span(0..1000, Timing::Every { periods: 3 });
    let app = App::new(MockConfig { clock: Clock::Real { hz: 300.0 }, timing, ..stepped() });
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    let start = std::time::Instant::now();
    let times: Vec<i64> =
        (0..11).map(|_| empty_frame(&mut waiter, &mut stream).predicted_display_time.as_nanos()).collect();
    assert!(start.elapsed().as_millis() >= 95, "ten steps of 10 ms");
    assert!(times.windows(2).all(|pair| pair[1] - pair[0] >= 9_999_000), "{times:?}");
}

#[test]
fn tracking_follows_frames_through_late_ones() {
    let app = App::new(MockConfig {
        timing: span(2..3, Timing::Late { periods: 4 }),
        tracking: vec![TrackingSpan { frames: 3..4, tracking: Tracking::LOST }],
        ..stepped()
    });
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    let stage = session.create_reference_space(xr::ReferenceSpaceType::STAGE, xr::Posef::IDENTITY).unwrap();
    let flags: Vec<u64> = (0..5)
        .map(|_| empty_frame(&mut waiter, &mut stream).predicted_display_time)
        .map(|time| session.locate_views(STEREO, time, &stage).unwrap().0.into_raw())
        .collect();
    assert_eq!(flags, [0xF, 0xF, 0xF, 0, 0xF]);
}

/// A session that may submit layers of every kind, with one image of one colour released.
struct Layers {
    session: xr::Session<xr::Vulkan>,
    waiter: xr::FrameWaiter,
    stream: xr::FrameStream<xr::Vulkan>,
    space: xr::Space,
    chain: Chain,
    /// Dropped last: the Vulkan device is its.
    app: App,
}

impl Layers {
    fn new() -> Self {
        let mut wanted = extensions();
        wanted.khr_composition_layer_cylinder = true;
        let app = App::with_extensions(Mock::new(stepped()), &wanted);
        let (session, mut waiter, mut stream) = app.session();
        begin(&app, &session);
        focus(&app, &mut waiter, &mut stream);
        let space =
            session.create_reference_space(xr::ReferenceSpaceType::LOCAL, xr::Posef::IDENTITY).unwrap();
        let mut chain = Chain::new(&session, vk::Format::R8G8B8A8_UNORM, [8, 4]);
        chain.fill(&app, [[1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]]);
        Self { app, session, waiter, stream, space, chain }
    }

    fn quad(&self) -> sys::CompositionLayerQuad {
        sys::CompositionLayerQuad {
            ty: sys::CompositionLayerQuad::TYPE,
            next: ptr::null(),
            layer_flags: sys::CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA,
            space: self.space.as_raw(),
            eye_visibility: xr::EyeVisibility::LEFT,
            sub_image: self.chain.part(1, [8, 4]),
            pose: xr::Posef { position: xr::Vector3f { x: 0.0, y: 0.0, z: -2.0 }, ..xr::Posef::IDENTITY },
            size: sys::Extent2Df { width: 2.0, height: 1.0 },
        }
    }

    fn cylinder(&self) -> sys::CompositionLayerCylinderKHR {
        sys::CompositionLayerCylinderKHR {
            ty: sys::CompositionLayerCylinderKHR::TYPE,
            next: ptr::null(),
            layer_flags: sys::CompositionLayerFlags::EMPTY,
            space: self.space.as_raw(),
            eye_visibility: xr::EyeVisibility::BOTH,
            sub_image: self.chain.part(0, [4, 4]),
            pose: xr::Posef::IDENTITY,
            radius: 3.0,
            central_angle: 1.5,
            aspect_ratio: 2.0,
        }
    }

    /// Ends a frame with these layers; when that fails, once more without any.
    fn submit(&mut self, layers: &[*const sys::CompositionLayerBaseHeader]) -> (R, SubmittedFrame) {
        let state = self.waiter.wait().unwrap();
        self.stream.begin().unwrap();
        let end = |layers: &[*const sys::CompositionLayerBaseHeader]| {
            let info = sys::FrameEndInfo {
                ty: sys::FrameEndInfo::TYPE,
                next: ptr::null(),
                display_time: state.predicted_display_time,
                environment_blend_mode: xr::EnvironmentBlendMode::OPAQUE,
                layer_count: layers.len() as u32,
                layers: layers.as_ptr(),
            };
            // SAFETY: the layers are whole and alive; the runtime verifies the rest.
            unsafe { (self.app.instance.fp().end_frame)(self.session.as_raw(), &info) }
        };
        let got = end(layers);
        if got != R::SUCCESS {
            assert_eq!(end(&[]), R::SUCCESS, "a refused frame is still begun");
        }
        (got, self.app.mock.take_last_frame().unwrap())
    }
}

#[test]
fn quads_and_cylinders_are_recorded_and_read_back() {
    let mut layers = Layers::new();
    let (quad, cylinder) = (layers.quad(), layers.cylinder());
    let (got, frame) = layers.submit(&[(&raw const cylinder).cast(), (&raw const quad).cast()]);
    assert_eq!(got, R::SUCCESS);
    assert_eq!((frame.layer_count, frame.views.len()), (2, 0));
    let (quad, cylinder) = (&frame.quads[0], &frame.cylinders[0]);
    assert_eq!((cylinder.layer, quad.layer), (0, 1));
    assert_eq!((quad.size_m, quad.pixels), ([2.0, 1.0], [8, 4]));
    assert_eq!(quad.pose.position, Vec3::new(0.0, 0.0, -2.0));
    assert_eq!((quad.eyes, quad.rgba.len()), (xr::EyeVisibility::LEFT, 8 * 4 * 4));
    assert!(quad.rgba.chunks_exact(4).all(|pixel| pixel == [0, 0, 255, 255]));
    assert_eq!((cylinder.radius_m, cylinder.central_angle, cylinder.aspect_ratio), (3.0, 1.5, 2.0));
    assert_eq!(cylinder.pixels, [4, 4]);
    assert!(cylinder.rgba.chunks_exact(4).all(|pixel| pixel == [255, 0, 0, 255]));
    assert_eq!(layers.app.mock.violations(), []);
    assert_eq!(*layers.app.messages(), [""; 0]);
}

#[test]
fn wrong_quads_and_cylinders_are_refused() {
    let mut layers = Layers::new();
    let bad =
        xr::Posef { orientation: xr::Quaternionf { x: 0.0, y: 0.0, z: 0.0, w: 0.5 }, ..Default::default() };
    let outside = layers.chain.part(0, [9, 4]);
    let beyond = layers.chain.part(2, [8, 4]);
    let unknown_flags = sys::CompositionLayerFlags::from_raw(1 << 20);
    let sized = |width, height| sys::Extent2Df { width, height };
    let (quad, cylinder) = (layers.quad(), layers.cylinder());
    for (wrong, wanted) in [
        (sys::CompositionLayerQuad { pose: bad, ..quad }, R::ERROR_POSE_INVALID),
        (sys::CompositionLayerQuad { sub_image: outside, ..quad }, R::ERROR_SWAPCHAIN_RECT_INVALID),
        (sys::CompositionLayerQuad { sub_image: beyond, ..quad }, R::ERROR_VALIDATION_FAILURE),
        (sys::CompositionLayerQuad { space: sys::Space::from_raw(7), ..quad }, R::ERROR_HANDLE_INVALID),
        (sys::CompositionLayerQuad { layer_flags: unknown_flags, ..quad }, R::ERROR_VALIDATION_FAILURE),
        (sys::CompositionLayerQuad { size: sized(-1.0, 1.0), ..quad }, R::ERROR_VALIDATION_FAILURE),
        (sys::CompositionLayerQuad { size: sized(1.0, f32::NAN), ..quad }, R::ERROR_VALIDATION_FAILURE),
        (
            sys::CompositionLayerQuad { eye_visibility: xr::EyeVisibility::from_raw(3), ..quad },
            R::ERROR_VALIDATION_FAILURE,
        ),
    ] {
        assert_eq!(layers.submit(&[(&raw const wrong).cast()]).0, wanted);
    }
    for wrong in [
        sys::CompositionLayerCylinderKHR { radius: -1.0, ..cylinder },
        sys::CompositionLayerCylinderKHR { radius: f32::NAN, ..cylinder },
        sys::CompositionLayerCylinderKHR { central_angle: 6.3, ..cylinder },
        sys::CompositionLayerCylinderKHR { central_angle: -0.1, ..cylinder },
        sys::CompositionLayerCylinderKHR { aspect_ratio: 0.0, ..cylinder },
    ] {
        assert_eq!(layers.submit(&[(&raw const wrong).cast()]).0, R::ERROR_VALIDATION_FAILURE);
    }
    assert_documented(&layers.app.mock);
    // Nothing to see, and nothing wrong.
    let point = sys::CompositionLayerQuad { size: sized(0.0, 0.0), ..quad };
    assert_eq!(layers.submit(&[(&raw const point).cast()]).0, R::SUCCESS);
    // These are as good as infinitely far.
    for radius in [0.0, f32::INFINITY] {
        let far = sys::CompositionLayerCylinderKHR { radius, ..cylinder };
        assert_eq!(layers.submit(&[(&raw const far).cast()]).0, R::SUCCESS);
    }
}

#[test]
fn a_cylinder_needs_its_extension() {
    let app = App::new(stepped());
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    let layer = sys::CompositionLayerBaseHeader {
        ty: sys::CompositionLayerCylinderKHR::TYPE,
        next: ptr::null(),
        layer_flags: sys::CompositionLayerFlags::EMPTY,
        space: sys::Space::NULL,
    };
    let layers = [&raw const layer];
    let state = waiter.wait().unwrap();
    stream.begin().unwrap();
    let info = sys::FrameEndInfo {
        ty: sys::FrameEndInfo::TYPE,
        next: ptr::null(),
        display_time: state.predicted_display_time,
        environment_blend_mode: xr::EnvironmentBlendMode::OPAQUE,
        layer_count: 1,
        layers: layers.as_ptr(),
    };
    // SAFETY: the runtime looks at the type and no further.
    let got = unsafe { (app.instance.fp().end_frame)(session.as_raw(), &info) };
    assert_eq!(got, R::ERROR_LAYER_INVALID);
}
