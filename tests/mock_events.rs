//! Whatever happens to the headset is told by the right events, to those who asked for them, once; and the faults of
//! event queues can be had: events that repeat, are lost, unknown, or somebody else's.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "raw events")]

mod mock_support;

use std::{ptr, time::Duration};

use fathomless::mock::{Act, Fov, Mask, Mock, MockConfig, PerformanceNotice, Pose, PoseTrack};
use glam::{Quat, Vec3};
use mock_support::{App, Chain, STEREO, assert_documented, begin, empty_frame, extensions, focus, stepped};
use openxr as xr;
use xr::{
    SessionState as S,
    sys::{self, Result as R},
};

/// An application with every extension that has events.
fn attentive(config: MockConfig) -> App {
    let mut wanted = extensions();
    wanted.khr_visibility_mask = true;
    wanted.fb_display_refresh_rate = true;
    wanted.ext_user_presence = true;
    wanted.ext_performance_settings = true;
    App::with_extensions(Mock::new(config), &wanted)
}

/// The next event, whatever it is.
fn next(app: &App) -> Option<sys::EventDataBuffer> {
    let mut buffer =
        sys::EventDataBuffer { ty: sys::EventDataBuffer::TYPE, next: ptr::null(), varying: [0; 4000] };
    // SAFETY: the runtime verifies what it is given.
    let code = unsafe { (app.instance.fp().poll_event)(app.instance.as_raw(), &mut buffer) };
    (code == R::SUCCESS).then_some(buffer)
}

/// The events that wait, of one type; any other is a failure.
fn all<E: Copy>(app: &App, ty: sys::StructureType) -> Vec<E> {
    std::iter::from_fn(|| next(app))
        .map(|event| {
            assert_eq!(event.ty, ty);
            // SAFETY: the type says what it is, and the buffer is larger.
            unsafe { *(&raw const event).cast::<E>() }
        })
        .collect()
}

fn pose_of(pose: xr::Posef) -> Pose {
    let (p, q) = (pose.position, pose.orientation);
    Pose::new(Vec3::new(p.x, p.y, p.z), Quat::from_xyzw(q.x, q.y, q.z, q.w))
}

fn near(a: Pose, b: Pose) {
    let (moved, turned) = (a.position.distance(b.position), a.orientation.angle_between(b.orientation));
    assert!(moved < 1e-5 && turned < 2e-3, "{a:?} {b:?}");
}

#[test]
fn recentring_moves_local_and_its_floor_when_it_says() {
    let app = attentive(stepped());
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    focus(&app, &mut waiter, &mut stream);
    let space = |kind| session.create_reference_space(kind, xr::Posef::IDENTITY).unwrap();
    let [stage, local, floor] =
        [xr::ReferenceSpaceType::STAGE, xr::ReferenceSpaceType::LOCAL, xr::ReferenceSpaceType::LOCAL_FLOOR]
            .map(space);
    while next(&app).is_some() {}
    let moved = Pose::new(Vec3::new(1.0, 0.5, -2.0), Quat::from_rotation_y(0.7));
    app.mock.perform(Act::Recentre { new_in_previous: moved, delay: Duration::from_millis(25) });
    let events: Vec<sys::EventDataReferenceSpaceChangePending> =
        all(&app, sys::EventDataReferenceSpaceChangePending::TYPE);
    let kinds: Vec<_> = events.iter().map(|event| event.reference_space_type).collect();
    assert_eq!(kinds, [xr::ReferenceSpaceType::LOCAL, xr::ReferenceSpaceType::LOCAL_FLOOR]);
    assert!(events.iter().all(|it| it.session == session.as_raw() && it.pose_valid == sys::TRUE));
    near(pose_of(events[0].pose_in_previous_space), moved);
    // Before and after the change, LOCAL in STAGE; the announcement is the difference.
    let change = events[0].change_time.as_nanos();
    for (event, space) in events.iter().zip([&local, &floor]) {
        let at = |time_ns| pose_of(space.locate(&stage, xr::Time::from_nanos(time_ns)).unwrap().pose);
        let (before, after) = (at(change - 1), at(change));
        near(before.then(pose_of(event.pose_in_previous_space)), after);
        let velocity = space.relate(&stage, xr::Time::from_nanos(change)).unwrap().1;
        assert_eq!(velocity.linear_velocity.x, 0.0, "moving an origin is no velocity");
    }
    let floor_at = pose_of(floor.locate(&stage, xr::Time::from_nanos(change)).unwrap().pose);
    assert_eq!(floor_at.position.y, 0.0, "the floor stays on the floor");
    near(pose_of(local.locate(&stage, xr::Time::from_nanos(1)).unwrap().pose), Pose::at(0.0, 1.6, 0.0));
    assert_eq!(app.mock.violations(), []);
}

#[test]
fn recentring_on_the_head() {
    let head = Pose::new(Vec3::new(0.5, 1.8, 1.0), Quat::from_euler(glam::EulerRot::YXZ, 1.0, 0.4, 0.2));
    let app = attentive(MockConfig { head: PoseTrack::fixed(head), ..stepped() });
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    let time = empty_frame(&mut waiter, &mut stream).predicted_display_time;
    app.mock.perform(Act::RecentreOnHead);
    let space = |kind| session.create_reference_space(kind, xr::Posef::IDENTITY).unwrap();
    let (view, local) = (space(xr::ReferenceSpaceType::VIEW), space(xr::ReferenceSpaceType::LOCAL));
    let pose = pose_of(view.locate(&local, time).unwrap().pose);
    assert!(pose.position.length() < 1e-5);
    let (yaw, pitch, _) = pose.orientation.to_euler(glam::EulerRot::YXZ);
    assert!(yaw.abs() < 1e-4 && (pitch - 0.4).abs() < 1e-3, "upright, looking where the head looked");
}

#[test]
fn bounds_change_and_go() {
    let app = App::new(stepped());
    let (session, ..) = app.session();
    let bounds = || session.reference_space_bounds_rect(xr::ReferenceSpaceType::STAGE).unwrap();
    while next(&app).is_some() {}
    app.mock.perform(Act::Bounds(Some([2.0, 4.0])));
    let events: Vec<sys::EventDataReferenceSpaceChangePending> =
        all(&app, sys::EventDataReferenceSpaceChangePending::TYPE);
    assert_eq!(events.len(), 1);
    assert_eq!(events[0].reference_space_type, xr::ReferenceSpaceType::STAGE);
    assert_eq!(bounds().map(|it| (it.width, it.height)), Some((2.0, 4.0)));
    app.mock.perform(Act::Bounds(None));
    assert!(bounds().is_none());
}

#[test]
fn presence_is_told_at_the_beginning_and_when_it_changes() {
    let app = attentive(MockConfig { user_present: false, ..stepped() });
    let (session, mut waiter, mut stream) = app.session();
    app.mock.perform(Act::UserPresent(true));
    assert_eq!(app.poll(), [S::IDLE, S::READY], "not before the session runs");
    session.begin(STEREO).unwrap();
    let told = || -> Vec<bool> {
        all::<sys::EventDataUserPresenceChangedEXT>(&app, sys::EventDataUserPresenceChangedEXT::TYPE)
            .iter()
            .map(|event| {
                assert_eq!(event.session, session.as_raw());
                event.is_user_present.into()
            })
            .collect()
    };
    assert_eq!(told(), [true]);
    app.mock.perform(Act::UserPresent(true));
    assert!(told().is_empty());
    app.mock.perform(Act::UserPresent(false));
    assert_eq!(told(), [false]);
    focus(&app, &mut waiter, &mut stream);

    // A headset that cannot tell never tells.
    let app = attentive(MockConfig { user_presence: false, ..stepped() });
    let (session, ..) = app.session();
    begin(&app, &session);
    app.mock.perform(Act::UserPresent(false));
    assert!(next(&app).is_none());
}

#[test]
fn only_those_who_asked_are_told() {
    let app = App::new(stepped());
    let (session, ..) = app.session();
    begin(&app, &session);
    let fov = Fov { left: -0.3, right: 0.3, up: 0.3, down: -0.3 };
    app.mock.set_fov([fov; 2]);
    app.mock.perform(Act::RefreshRate(72.0));
    app.mock.perform(Act::UserPresent(false));
    app.mock.perform(Act::Performance(notice()));
    assert!(next(&app).is_none());
}

fn notice() -> PerformanceNotice {
    PerformanceNotice {
        domain: sys::PerfSettingsDomainEXT::GPU,
        sub_domain: sys::PerfSettingsSubDomainEXT::THERMAL,
        from: sys::PerfSettingsNotificationLevelEXT::NORMAL,
        to: sys::PerfSettingsNotificationLevelEXT::IMPAIRED,
    }
}

#[test]
fn a_performance_notice() {
    let app = attentive(stepped());
    app.mock.perform(Act::Performance(notice()));
    let events: Vec<sys::EventDataPerfSettingsEXT> = all(&app, sys::EventDataPerfSettingsEXT::TYPE);
    let [event] = events[..] else { panic!("{events:?}") };
    let got = (event.domain, event.sub_domain, event.from_level, event.to_level);
    assert_eq!(got, (notice().domain, notice().sub_domain, notice().from, notice().to));
}

#[test]
fn the_mask_changes_with_the_field_of_view() {
    let app = attentive(stepped());
    let (session, ..) = app.session();
    while next(&app).is_some() {}
    let views = || -> Vec<u32> {
        all::<sys::EventDataVisibilityMaskChangedKHR>(&app, sys::EventDataVisibilityMaskChangedKHR::TYPE)
            .iter()
            .map(|event| {
                assert_eq!((event.session, event.view_configuration_type), (session.as_raw(), STEREO));
                event.view_index
            })
            .collect()
    };
    let MockConfig { fov: [left, right], .. } = stepped();
    app.mock.set_fov([left, Fov { up: 0.5, ..right }]);
    assert_eq!(views(), [1], "only the eye that changed");
    app.mock.perform(Act::Mask(Mask::Empty));
    assert_eq!(views(), [0, 1]);
    app.mock.set_fov([left, right]);
    assert!(views().is_empty(), "an empty mask stays empty");
}

#[test]
fn the_refresh_rate_changes() {
    let app = attentive(stepped());
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    focus(&app, &mut waiter, &mut stream);
    let before = empty_frame(&mut waiter, &mut stream);
    app.mock.perform(Act::RefreshRate(50.0));
    app.mock.perform(Act::RefreshRate(50.0));
    let after = empty_frame(&mut waiter, &mut stream);
    assert_eq!(after.predicted_display_period.as_nanos(), 20_000_000);
    let step = after.predicted_display_time.as_nanos() - before.predicted_display_time.as_nanos();
    assert_eq!(step, 20_000_000);
    let events: Vec<sys::EventDataDisplayRefreshRateChangedFB> =
        all(&app, sys::EventDataDisplayRefreshRateChangedFB::TYPE);
    let [event] = events[..] else { panic!("{events:?}") };
    assert_eq!((event.from_display_refresh_rate, event.to_display_refresh_rate), (100.0, 50.0));
}

#[test]
fn events_repeat_are_lost_unknown_or_foreign() {
    let app = App::new(stepped());
    let (session, ..) = app.session();
    assert_eq!(app.poll(), [S::IDLE, S::READY]);
    app.mock.perform(Act::RepeatEvent);
    assert_eq!(app.poll(), [S::READY]);
    app.mock.perform(Act::ClaimLostEvents(7));
    let lost: Vec<sys::EventDataEventsLost> = all(&app, sys::EventDataEventsLost::TYPE);
    assert_eq!(lost.iter().map(|event| event.lost_event_count).collect::<Vec<_>>(), [7]);
    app.mock.perform(Act::ForeignEvent);
    let foreign: Vec<sys::EventDataSessionStateChanged> = all(&app, sys::EventDataSessionStateChanged::TYPE);
    assert_eq!(foreign.len(), 1);
    assert_ne!(foreign[0].session, session.as_raw());
    app.mock.perform(Act::UnknownEvent);
    let unknown = next(&app).unwrap();
    assert!(unknown.ty.into_raw() > 1_999_000_000);
    // The crate skips what it does not know.
    app.mock.perform(Act::UnknownEvent);
    app.mock.perform(Act::RepeatEvent);
    assert!(app.poll().is_empty());
    session.begin(STEREO).unwrap();
}

#[test]
fn too_many_events_are_counted() {
    let app = App::new(stepped());
    let (_session, ..) = app.session();
    for _ in 0..300 {
        app.mock.perform(Act::UnknownEvent);
    }
    let first = next(&app).unwrap();
    assert_eq!(first.ty, sys::EventDataEventsLost::TYPE);
    // SAFETY: the type says what it is.
    let lost = unsafe { *(&raw const first).cast::<sys::EventDataEventsLost>() }.lost_event_count;
    let kept = std::iter::from_fn(|| next(&app)).count() as u32;
    assert_eq!(lost + kept, 302, "IDLE and READY came before");
}

#[test]
fn a_state_out_of_order() {
    let app = App::new(stepped());
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    app.mock.perform(Act::ForceState(S::FOCUSED));
    assert_eq!(app.poll(), [S::FOCUSED]);
    assert!(empty_frame(&mut waiter, &mut stream).should_render);
    app.mock.perform(Act::ForceState(S::STOPPING));
    assert_eq!(app.poll(), [S::STOPPING]);
    session.end().unwrap();
}

#[test]
fn a_user_quits_in_any_state() {
    // Before the session has begun: out at once.
    let app = App::new(stepped());
    let (session, ..) = app.session();
    app.poll();
    app.mock.exit_session();
    assert_eq!(app.poll(), [S::IDLE, S::EXITING]);
    drop(session);
    // In mid-flight.
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    focus(&app, &mut waiter, &mut stream);
    app.mock.exit_session();
    assert_eq!(app.poll(), [S::VISIBLE, S::SYNCHRONIZED, S::STOPPING]);
    session.end().unwrap();
    assert_eq!(app.poll(), [S::IDLE, S::EXITING]);
}

#[test]
fn a_session_about_to_be_lost_works_on() {
    let app = attentive(stepped());
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    focus(&app, &mut waiter, &mut stream);
    app.mock.lose_session();
    let space = session.create_reference_space(xr::ReferenceSpaceType::STAGE, xr::Posef::IDENTITY).unwrap();
    let view = session.create_reference_space(xr::ReferenceSpaceType::VIEW, xr::Posef::IDENTITY).unwrap();
    let mut chain = Chain::new(&session, ash::vk::Format::R8G8B8A8_SRGB, [8, 8]);
    chain.fill(&app, [[0.0; 4]; 2]);
    let time = empty_frame(&mut waiter, &mut stream).predicted_display_time;
    session.locate_views(STEREO, time, &space).unwrap();
    view.relate(&space, time).unwrap();
    session.enumerate_reference_spaces().unwrap();
    session.reference_space_bounds_rect(xr::ReferenceSpaceType::STAGE).unwrap();
    session.enumerate_display_refresh_rates().unwrap();
    session.get_display_refresh_rate().unwrap();
    session.request_display_refresh_rate(72.0).unwrap();
    session.request_exit().unwrap();
    let set = app.instance.create_action_set("set", "Set", 0).unwrap();
    session.attach_action_sets(&[&set]).unwrap();
    session.sync_actions(&[]).unwrap();
    // Every call of these says that the session will be lost, where the registry lets it.
    let pending = app.mock.log().iter().filter(|call| call.code == R::SESSION_LOSS_PENDING).count();
    assert!(pending > 10, "{pending}");
    assert_documented(&app.mock);
    assert_eq!(app.mock.violations(), []);
}
