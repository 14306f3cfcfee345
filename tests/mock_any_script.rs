//! Whatever a script does to headset, session and instance, an application that keeps the rules breaks none: states come
//! in legal order, display times increase, and nothing it is told is untrue.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "a session is made again and again")]

mod mock_support;

use std::time::Duration;

use ash::vk;
use fathomless::mock::{
    Act, Cue, Fov, Mask, Mock, PerformanceNotice, Pose, Script, Timing, When, function_names,
};
use glam::{Quat, Vec3};
use mock_support::{App, Chain, STEREO, assert_documented, extensions, stepped};
use openxr as xr;
use proptest::prelude::*;
use xr::{
    SessionState as S,
    sys::{self, Result as R},
};

fn act() -> impl Strategy<Value = Act> {
    let notice = PerformanceNotice {
        domain: sys::PerfSettingsDomainEXT::CPU,
        sub_domain: sys::PerfSettingsSubDomainEXT::RENDERING,
        from: sys::PerfSettingsNotificationLevelEXT::NORMAL,
        to: sys::PerfSettingsNotificationLevelEXT::WARNING,
    };
    let narrow = Fov { left: -0.5, right: 0.5, up: 0.4, down: -0.4 };
    prop_oneof![
        6 => Just(Act::GainFocus),
        2 => Just(Act::LoseFocus),
        2 => Just(Act::Hide),
        3 => Just(Act::Stop),
        1 => Just(Act::Exit),
        1 => Just(Act::LoseSession),
        1 => Just(Act::KillSession),
        1 => (0u64..60).prop_map(|ms| Act::LoseInstance(Duration::from_millis(ms))),
        2 => (-1.0f32..1.0, 0u64..50).prop_map(|(x, ms)| Act::Recentre {
            new_in_previous: Pose::new(Vec3::new(x, 0.0, -x), Quat::from_rotation_y(x)),
            delay: Duration::from_millis(ms),
        }),
        1 => Just(Act::RecentreOnHead),
        1 => Just(Act::Bounds(None)),
        1 => Just(Act::Fov([narrow; 2])),
        1 => Just(Act::EyeSizes([[8, 16], [16, 8]])),
        1 => Just(Act::Mask(Mask::Empty)),
        2 => prop_oneof![Just(72.0), Just(144.0)].prop_map(Act::RefreshRate),
        2 => any::<bool>().prop_map(Act::UserPresent),
        2 => (1u32..4).prop_map(|periods| Act::Timing(Some(Timing::Late { periods }))),
        1 => Just(Act::Timing(Some(Timing::Jitter { most_ns: 3_000_000 }))),
        1 => Just(Act::Timing(None)),
        1 => any::<bool>().prop_map(Act::ShuffleImages),
        1 => any::<bool>().prop_map(|render| Act::ShouldRender(Some(render))),
        1 => Just(Act::Performance(notice)),
        1 => Just(Act::ClaimLostEvents(2)),
        1 => Just(Act::ForeignEvent),
        1 => Just(Act::UnknownEvent),
    ]
}

fn when() -> impl Strategy<Value = When> {
    let names: Vec<&'static str> = [
        "xrPollEvent",
        "xrBeginSession",
        "xrEndFrame",
        "xrEndSession",
        "xrAcquireSwapchainImage",
        "xrLocateViews",
    ]
    .map(|wanted| function_names().find(|name| *name == wanted).unwrap())
    .into();
    prop_oneof![
        3 => (0u64..25).prop_map(When::Frame),
        2 => (0.0..0.3).prop_map(When::Seconds),
        2 => (prop::sample::select(names), 1u64..25).prop_map(|(function, nth)| When::Call { function, nth }),
    ]
}

/// Why a session ended.
#[derive(Debug, PartialEq)]
enum End {
    /// The session was lost or the user quit: another may be made.
    Session,
    /// Nothing more happens.
    Quiet,
}

fn is_arrow(from: S, to: S) -> bool {
    to == S::LOSS_PENDING
        || matches!(
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

/// One session from its making to its end, by the rules.
fn live(app: &App, turns: &mut u32) -> Result<End, R> {
    // SAFETY: the binding's Vulkan objects outlive the session.
    let made = unsafe { app.instance.create_session::<xr::Vulkan>(app.system, &app.binding()) };
    let (session, mut waiter, mut stream) = made?;
    let space = session.create_reference_space(xr::ReferenceSpaceType::LOCAL, xr::Posef::IDENTITY)?;
    let mut chain = Chain::new(&session, vk::Format::R8G8B8A8_SRGB, [8, 8]);
    let mut buffer = xr::EventDataBuffer::new();
    let (mut state, mut running, mut last) = (S::UNKNOWN, false, i64::MIN);
    while *turns > 0 {
        *turns -= 1;
        while let Some(event) = app.instance.poll_event(&mut buffer)? {
            let xr::Event::SessionStateChanged(change) = event else { continue };
            if change.session() != session.as_raw() {
                continue;
            }
            assert!(is_arrow(state, change.state()), "{state:?} to {:?}", change.state());
            state = change.state();
            match state {
                S::READY => match session.begin(STEREO) {
                    Ok(_) => running = true,
                    // The user has changed their mind since.
                    Err(R::ERROR_SESSION_NOT_READY) => {}
                    Err(code) => return Err(code),
                },
                S::STOPPING => {
                    session.end()?;
                    running = false;
                }
                S::EXITING | S::LOSS_PENDING => return Ok(End::Session),
                _ => {}
            }
        }
        if !running {
            continue;
        }
        let frame = waiter.wait()?;
        let time = frame.predicted_display_time;
        assert!(time.as_nanos() > last && frame.predicted_display_period.as_nanos() > 0);
        last = time.as_nanos();
        stream.begin()?;
        let (_, views) = session.locate_views(STEREO, time, &space)?;
        chain.swapchain.acquire_image()?;
        chain.swapchain.wait_image(xr::Duration::INFINITE)?;
        chain.swapchain.release_image()?;
        let parts = [0, 1].map(|i| {
            xr::CompositionLayerProjectionView::new().pose(views[i].pose).fov(views[i].fov).sub_image(
                xr::SwapchainSubImage::new()
                    .swapchain(&chain.swapchain)
                    .image_array_index(i as u32)
                    .image_rect(chain.part(0, [8, 8]).image_rect),
            )
        });
        let layer = xr::CompositionLayerProjection::new().space(&space).views(&parts);
        let layers: &[&xr::CompositionLayerBase<xr::Vulkan>] =
            if frame.should_render { &[&layer] } else { &[] };
        stream.end(time, xr::EnvironmentBlendMode::OPAQUE, layers)?;
    }
    Ok(End::Quiet)
}

fn play(cues: Vec<Cue>) {
    let mut config = stepped();
    config.read_back = false;
    config.user_present = false;
    let mut wanted = extensions();
    wanted.khr_visibility_mask = true;
    wanted.fb_display_refresh_rate = true;
    wanted.ext_user_presence = true;
    wanted.ext_performance_settings = true;
    let mock = Mock::with_script(Script { config, cues, ..Script::default() });
    let app = App::with_extensions(mock, &wanted);
    let mut turns = 60;
    while turns > 0 {
        match live(&app, &mut turns) {
            Ok(End::Session) | Err(R::ERROR_SESSION_LOST) => {}
            Ok(End::Quiet) | Err(R::ERROR_INSTANCE_LOST) => break,
            Err(code) => panic!("{code:?}"),
        }
        turns = turns.saturating_sub(1);
    }
    assert_eq!(app.mock.violations(), []);
    assert_eq!(app.mock.script_errors(), [""; 0]);
    assert_documented(&app.mock);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn an_application_by_the_rules_breaks_none(
        cues in prop::collection::vec((when(), prop::collection::vec(act(), 1..3)), 0..14)
    ) {
        play(cues.into_iter().map(|(when, acts)| Cue { when, acts }).collect());
    }
}
