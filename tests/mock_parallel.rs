//! Mocks live side by side, in threads too; their slots come back; and one thread may wait for frames while another
//! draws them.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "waiting in another thread needs the raw functions")]

mod mock_support;

use std::{
    ptr,
    sync::{Mutex, MutexGuard, mpsc},
    thread,
    time::Duration,
};

use ash::vk;
use fathomless::mock::{Clock, Mock, MockConfig, MockError};
use mock_support::{App, Chain, STEREO, application, begin, empty_frame, extensions, focus, stepped};
use openxr as xr;
use xr::sys::{self, Result as R};

/// The slots are shared by the process, and one test uses them all up.
fn alone() -> MutexGuard<'static, ()> {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    ONE_AT_A_TIME.lock().unwrap_or_else(|it| it.into_inner())
}

/// Draws frames of one shade and sees that they are its own.
fn fly(shade: u8) -> Mock {
    const SIZE: [u32; 2] = [32, 32];
    let app = App::new(stepped());
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    focus(&app, &mut waiter, &mut stream);
    let space = session.create_reference_space(xr::ReferenceSpaceType::LOCAL, xr::Posef::IDENTITY).unwrap();
    let mut colour = Chain::new(&session, vk::Format::R8G8B8A8_UNORM, SIZE);
    let value = f32::from(shade) / 255.0;
    for _ in 0..20 {
        let state = waiter.wait().unwrap();
        stream.begin().unwrap();
        colour.fill(&app, [[value, 0.0, 0.0, 1.0], [0.0, value, 0.0, 1.0]]);
        let time = state.predicted_display_time;
        let (_, views) = session.locate_views(STEREO, time, &space).unwrap();
        let views = [0, 1].map(|i| {
            // SAFETY: nothing is chained.
            unsafe {
                xr::CompositionLayerProjectionView::from_raw(sys::CompositionLayerProjectionView {
                    ty: sys::CompositionLayerProjectionView::TYPE,
                    next: ptr::null(),
                    pose: views[i].pose,
                    fov: views[i].fov,
                    sub_image: colour.part(i as u32, SIZE),
                })
            }
        });
        let layer = xr::CompositionLayerProjection::new().space(&space).views(&views);
        stream.end(time, xr::EnvironmentBlendMode::OPAQUE, &[&layer]).unwrap();
        let frame = app.mock.take_last_frame().unwrap();
        assert_eq!(frame.views[0].pixel(5, 6), Some([shade, 0, 0, 255]));
        assert_eq!(frame.views[1].pixel(31, 31), Some([0, shade, 0, 255]));
        assert_eq!(frame.views[1].pixel(32, 0), None);
        assert!(frame.views[0].depth.is_none());
    }
    assert_eq!(*app.messages(), Vec::<String>::new());
    app.mock.clone()
}

#[test]
fn mocks_in_parallel_threads() {
    let _alone = alone();
    let threads: Vec<_> =
        [40, 80, 120, 160].map(|shade| thread::spawn(move || fly(shade))).into_iter().collect();
    for thread in threads {
        let mock = thread.join().unwrap();
        assert_eq!(mock.violations(), []);
        assert_eq!(mock.leaks(), []);
        assert_eq!(mock.calls("xrEndFrame"), 23);
    }
}

#[test]
fn slots_run_out_and_come_back() {
    let _alone = alone();
    let entry_of_the_dead = {
        let mocks: Vec<Mock> = (0..32).map(|_| Mock::new(stepped())).collect();
        let entries: Vec<_> = mocks.iter().map(|mock| mock.entry().unwrap()).collect();
        let one_more = Mock::new(stepped());
        assert_eq!(one_more.entry().err(), Some(MockError::NoSlot));
        entries.into_iter().next().unwrap()
    };
    let dead = entry_of_the_dead.enumerate_extensions().err();
    assert_eq!(dead, Some(R::ERROR_RUNTIME_UNAVAILABLE));
    for _ in 0..100 {
        assert!(Mock::new(stepped()).entry().is_ok());
    }
}

#[test]
fn an_instance_keeps_its_mock_alive() {
    let _alone = alone();
    let instance = {
        let mock = Mock::new(stepped());
        let entry = mock.entry().unwrap();
        entry.create_instance(&application(1), &extensions(), &[], &()).unwrap()
    };
    assert!(instance.properties().is_ok());
    let entry = instance.entry().clone();
    drop(instance);
    assert!(entry.enumerate_extensions().is_err(), "the slot is free again");
}

#[test]
fn waiting_blocks_until_the_frame_begins() {
    let _alone = alone();
    let app = App::new(MockConfig { clock: Clock::Real { hz: 500.0 }, ..stepped() });
    let (session, ..) = app.session();
    begin(&app, &session);
    let (raw, fp) = (session.as_raw(), app.instance.fp());
    let (wait, begin_frame) = (fp.wait_frame, fp.begin_frame);
    let (sender, receiver) = mpsc::channel();
    let waiter = thread::spawn(move || {
        for _ in 0..3 {
            let mut state = sys::FrameState::out(ptr::null_mut());
            // SAFETY: the function may be called from any thread.
            let code = unsafe { wait(raw, ptr::null(), state.as_mut_ptr()) };
            sender.send(code).unwrap();
        }
    });
    let soon = Duration::from_secs(60);
    assert_eq!(receiver.recv_timeout(soon), Ok(R::SUCCESS));
    let nothing = receiver.recv_timeout(Duration::from_millis(60));
    assert!(nothing.is_err(), "the second wait blocks");
    // Other calls go on meanwhile.
    app.poll();
    // SAFETY: the runtime verifies the handle.
    assert_eq!(unsafe { begin_frame(raw, ptr::null()) }, R::SUCCESS);
    assert_eq!(receiver.recv_timeout(soon), Ok(R::SUCCESS));
    // The third waits for a begin that never comes; a lost session sets it free.
    assert!(receiver.recv_timeout(Duration::from_millis(30)).is_err());
    app.mock.kill_session();
    assert_eq!(receiver.recv_timeout(soon), Ok(R::ERROR_SESSION_LOST));
    waiter.join().unwrap();
}

#[test]
fn two_sessions_of_one_instance() {
    let _alone = alone();
    let app = App::new(stepped());
    let (one, mut waiter, mut stream) = app.session();
    let (two, mut second_waiter, mut second_stream) = app.session();
    app.poll();
    one.begin(STEREO).unwrap();
    two.begin(STEREO).unwrap();
    for _ in 0..4 {
        empty_frame(&mut waiter, &mut stream);
        empty_frame(&mut second_waiter, &mut second_stream);
    }
    drop((two, second_waiter, second_stream));
    empty_frame(&mut waiter, &mut stream);
    assert_eq!(app.mock.violations(), []);
}
