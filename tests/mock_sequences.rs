//! Whatever the order of calls, the answer is the one a small model of the specification gives; the session only ever
//! moves along the arrows of its life cycle.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "random orders need the raw functions")]

mod mock_support;

use std::ptr;

use ash::vk;
use mock_support::{App, Chain, STEREO, stepped};
use openxr as xr;
use proptest::prelude::*;
use xr::{
    SessionState as S,
    sys::{self, Result as R},
};

#[derive(Clone, Copy, Debug)]
enum Step {
    Poll,
    BeginSession,
    EndSession,
    RequestExit,
    WaitFrame,
    BeginFrame,
    EndFrame,
    EndFrameBadly,
    Acquire,
    WaitImage,
    Release,
    LoseFocus,
    Hide,
    Stop,
    GainFocus,
}

fn step() -> impl Strategy<Value = Step> {
    use Step::*;
    prop_oneof![
        6 => Just(Poll),
        3 => Just(BeginSession),
        2 => Just(EndSession),
        1 => Just(RequestExit),
        6 => Just(WaitFrame),
        6 => Just(BeginFrame),
        6 => Just(EndFrame),
        1 => Just(EndFrameBadly),
        3 => Just(Acquire),
        3 => Just(WaitImage),
        3 => Just(Release),
        1 => Just(LoseFocus),
        1 => Just(Hide),
        1 => Just(Stop),
        3 => Just(GainFocus),
    ]
}

fn is_arrow(from: S, to: S) -> bool {
    matches!(
        (from, to),
        (S::UNKNOWN, S::IDLE)
            | (S::IDLE, S::READY | S::EXITING)
            | (S::READY, S::SYNCHRONIZED | S::IDLE)
            | (S::SYNCHRONIZED, S::VISIBLE | S::STOPPING)
            | (S::VISIBLE, S::FOCUSED | S::SYNCHRONIZED)
            | (S::FOCUSED, S::VISIBLE)
            | (S::STOPPING, S::IDLE)
    )
}

/// What the specification says of the calls so far.
struct Model {
    seen: S,
    /// READY was taken back since the last poll, so that a READY seen before is not the one that may hold again.
    outdated: bool,
    running: bool,
    waited: bool,
    begun: bool,
    acquired: usize,
    image_waited: bool,
    last_time: i64,
}

fn run(app: &App, steps: &[Step]) {
    let (session, ..) = app.session();
    let chain = Chain::new(&session, vk::Format::R8G8B8A8_SRGB, [4, 4]);
    let (fp, raw) = (app.instance.fp(), session.as_raw());
    let swapchain = chain.swapchain.as_raw();
    let mut m = Model {
        seen: S::UNKNOWN,
        outdated: false,
        running: false,
        waited: false,
        begun: false,
        acquired: 0,
        image_waited: false,
        last_time: 0,
    };
    let begin = sys::SessionBeginInfo {
        ty: sys::SessionBeginInfo::TYPE,
        next: ptr::null(),
        primary_view_configuration_type: STEREO,
    };
    let forever = sys::SwapchainImageWaitInfo {
        ty: sys::SwapchainImageWaitInfo::TYPE,
        next: ptr::null(),
        timeout: sys::Duration::INFINITE,
    };
    let end = |time: i64| sys::FrameEndInfo {
        ty: sys::FrameEndInfo::TYPE,
        next: ptr::null(),
        display_time: sys::Time::from_nanos(time),
        environment_blend_mode: sys::EnvironmentBlendMode::OPAQUE,
        layer_count: 0,
        layers: ptr::null(),
    };
    let order = |good: bool| {
        if good { R::SUCCESS } else { R::ERROR_CALL_ORDER_INVALID }
    };
    let running = |m: &Model, code: R| {
        if m.running { code } else { R::ERROR_SESSION_NOT_RUNNING }
    };
    for (i, step) in steps.iter().enumerate() {
        let truth = app.mock.session_state().unwrap();
        // SAFETY: the runtime verifies what it is given.
        let (got, wanted) = unsafe {
            match step {
                Step::Poll => {
                    for state in app.poll() {
                        assert!(is_arrow(m.seen, state), "{:?} to {state:?}", m.seen);
                        m.seen = state;
                    }
                    assert_eq!(m.seen, truth);
                    m.outdated = false;
                    (R::SUCCESS, R::SUCCESS)
                }
                Step::BeginSession => {
                    let wanted = match m.running {
                        true => R::ERROR_SESSION_RUNNING,
                        false if truth == S::READY && m.seen == S::READY && !m.outdated => R::SUCCESS,
                        false => R::ERROR_SESSION_NOT_READY,
                    };
                    if wanted == R::SUCCESS {
                        (m.running, m.waited, m.begun) = (true, false, false);
                    }
                    ((fp.begin_session)(raw, &begin), wanted)
                }
                Step::EndSession => {
                    let stopping = truth == S::STOPPING && m.seen == S::STOPPING;
                    let wanted = match stopping {
                        true => running(&m, R::SUCCESS),
                        false => running(&m, R::ERROR_SESSION_NOT_STOPPING),
                    };
                    m.running &= wanted != R::SUCCESS;
                    ((fp.end_session)(raw), wanted)
                }
                Step::RequestExit => ((fp.request_exit_session)(raw), running(&m, R::SUCCESS)),
                // It would block until somebody begins the frame.
                Step::WaitFrame if m.running && m.waited => continue,
                Step::WaitFrame => {
                    let mut state = sys::FrameState::out(ptr::null_mut());
                    let got = (fp.wait_frame)(raw, ptr::null(), state.as_mut_ptr());
                    if got == R::SUCCESS {
                        let state = state.assume_init();
                        let time = state.predicted_display_time.as_nanos();
                        assert!(time > m.last_time);
                        let visible = matches!(truth, S::VISIBLE | S::FOCUSED);
                        assert_eq!(bool::from(state.should_render), visible);
                        (m.last_time, m.waited) = (time, true);
                    }
                    (got, running(&m, R::SUCCESS))
                }
                Step::BeginFrame => {
                    let wanted = match (m.waited, m.begun) {
                        (false, _) => R::ERROR_CALL_ORDER_INVALID,
                        (true, true) => R::FRAME_DISCARDED,
                        (true, false) => R::SUCCESS,
                    };
                    if m.running && m.waited {
                        (m.waited, m.begun) = (false, true);
                    }
                    ((fp.begin_frame)(raw, ptr::null()), running(&m, wanted))
                }
                Step::EndFrame => {
                    let wanted = running(&m, order(m.begun));
                    m.begun &= !m.running;
                    ((fp.end_frame)(raw, &end(m.last_time.max(1))), wanted)
                }
                Step::EndFrameBadly => {
                    let wanted = match m.begun {
                        true => R::ERROR_TIME_INVALID,
                        false => R::ERROR_CALL_ORDER_INVALID,
                    };
                    ((fp.end_frame)(raw, &end(0)), running(&m, wanted))
                }
                Step::Acquire => {
                    let good = m.acquired < chain.images.len();
                    m.acquired += usize::from(good);
                    let mut index = 0;
                    let got = (fp.acquire_swapchain_image)(swapchain, ptr::null(), &mut index);
                    (got, order(good))
                }
                Step::WaitImage => {
                    let good = m.acquired > 0 && !m.image_waited;
                    m.image_waited |= good;
                    ((fp.wait_swapchain_image)(swapchain, &forever), order(good))
                }
                Step::Release => {
                    let good = m.image_waited;
                    m.acquired -= usize::from(good);
                    m.image_waited = false;
                    ((fp.release_swapchain_image)(swapchain, ptr::null()), order(good))
                }
                Step::LoseFocus => {
                    app.mock.lose_focus();
                    continue;
                }
                Step::Hide => {
                    app.mock.hide();
                    continue;
                }
                Step::Stop => {
                    m.outdated |= truth == S::READY && !m.running;
                    app.mock.stop_session();
                    continue;
                }
                Step::GainFocus => {
                    app.mock.gain_focus();
                    continue;
                }
            }
        };
        assert_eq!(got, wanted, "step {i}: {step:?}");
    }
    app.mock.gain_focus();
}

#[test]
fn calls_in_any_order() {
    let app = App::new(stepped());
    let steps = proptest::collection::vec(step(), 1..120);
    proptest!(ProptestConfig::with_cases(1_000), |(steps in steps)| run(&app, &steps));
    assert_eq!(*app.messages(), Vec::<String>::new());
}
