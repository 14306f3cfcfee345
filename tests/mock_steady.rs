//! A steady frame on the mock runtime, with input or without, allocates nothing, so that an application's own allocations can be counted on it.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "an allocator that counts, and raw calls")]

mod mock_support;

use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
    ptr,
};

use ash::vk;
use fathomless::mock::{Mock, MockConfig};
use mock_support::{App, Chain, STEREO, begin, extensions, focus, stepped};
use openxr as xr;
use xr::sys::{self, Result as R};

struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: passes everything on to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(place, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn no_allocation_in_a_steady_frame() {
    const SIZE: [u32; 2] = [16, 16];
    let app = App::new(MockConfig { read_back: false, ..stepped() });
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    focus(&app, &mut waiter, &mut stream);
    let space = session.create_reference_space(xr::ReferenceSpaceType::LOCAL, xr::Posef::IDENTITY).unwrap();
    let colour = Chain::new(&session, vk::Format::R8G8B8A8_SRGB, SIZE);
    let depth = Chain::new(&session, vk::Format::D32_SFLOAT, SIZE);
    let (fp, raw) = (app.instance.fp(), session.as_raw());
    let locate = |time| sys::ViewLocateInfo {
        ty: sys::ViewLocateInfo::TYPE,
        next: ptr::null(),
        view_configuration_type: STEREO,
        display_time: time,
        space: space.as_raw(),
    };
    let forever = sys::SwapchainImageWaitInfo {
        ty: sys::SwapchainImageWaitInfo::TYPE,
        next: ptr::null(),
        timeout: sys::Duration::INFINITE,
    };
    let infos = [0, 1].map(|i| sys::CompositionLayerDepthInfoKHR {
        ty: sys::CompositionLayerDepthInfoKHR::TYPE,
        next: ptr::null(),
        sub_image: depth.part(i, SIZE),
        min_depth: 0.0,
        max_depth: 1.0,
        near_z: f32::INFINITY,
        far_z: 0.1,
    });
    let frame = || {
        let mut state = sys::FrameState::out(ptr::null_mut());
        let mut view_state = sys::ViewState::out(ptr::null_mut());
        let mut views = [sys::View::out(ptr::null_mut()); 2];
        let mut event =
            sys::EventDataBuffer { ty: sys::EventDataBuffer::TYPE, next: ptr::null(), varying: [0; 4000] };
        let (mut count, mut index) = (0, 0);
        // SAFETY: ordinary calls with everything set.
        unsafe {
            (fp.poll_event)(app.instance.as_raw(), &mut event);
            assert_eq!((fp.wait_frame)(raw, ptr::null(), state.as_mut_ptr()), R::SUCCESS);
            let state = state.assume_init();
            assert_eq!((fp.begin_frame)(raw, ptr::null()), R::SUCCESS);
            for chain in [&colour, &depth] {
                let chain = chain.swapchain.as_raw();
                (fp.acquire_swapchain_image)(chain, ptr::null(), &mut index);
                (fp.wait_swapchain_image)(chain, &forever);
            }
            let located = (fp.locate_views)(
                raw,
                &locate(state.predicted_display_time),
                view_state.as_mut_ptr(),
                2,
                &mut count,
                views.as_mut_ptr().cast(),
            );
            assert_eq!(located, R::SUCCESS);
            let projections = [0, 1].map(|i| sys::CompositionLayerProjectionView {
                ty: sys::CompositionLayerProjectionView::TYPE,
                next: (&raw const infos[i]).cast(),
                pose: views[i].assume_init().pose,
                fov: views[i].assume_init().fov,
                sub_image: colour.part(i as u32, SIZE),
            });
            for chain in [&colour, &depth] {
                (fp.release_swapchain_image)(chain.swapchain.as_raw(), ptr::null());
            }
            let layer = sys::CompositionLayerProjection {
                ty: sys::CompositionLayerProjection::TYPE,
                next: ptr::null(),
                layer_flags: sys::CompositionLayerFlags::EMPTY,
                space: space.as_raw(),
                view_count: 2,
                views: projections.as_ptr(),
            };
            let layers = [(&raw const layer).cast()];
            let end = sys::FrameEndInfo {
                ty: sys::FrameEndInfo::TYPE,
                next: ptr::null(),
                display_time: state.predicted_display_time,
                environment_blend_mode: sys::EnvironmentBlendMode::OPAQUE,
                layer_count: 1,
                layers: layers.as_ptr(),
            };
            assert_eq!((fp.end_frame)(raw, &end), R::SUCCESS);
        }
    };
    // The first frames bring images into their layouts and fill the record.
    (0..12).for_each(|_| frame());
    let before = ALLOCATIONS.get();
    (0..100).for_each(|_| frame());
    assert_eq!(ALLOCATIONS.get() - before, 0);
    assert_eq!(app.mock.take_last_frame().unwrap().views.len(), 2);
    assert_eq!(app.mock.violations(), []);
}

#[test]
fn no_allocation_in_steady_input() {
    const TOUCH: &str = "/interaction_profiles/oculus/touch_controller";
    let mut more = extensions();
    more.ext_hand_tracking = true;
    let app = App::with_extensions(Mock::new(stepped()), &more);
    let instance = &*app.instance;
    let (session, mut waiter, mut stream) = app.session();
    let path = |text: &str| instance.string_to_path(text).unwrap();
    let hands = [path("/user/hand/left"), path("/user/hand/right")];
    let set = instance.create_action_set("play", "Play", 0).unwrap();
    let fire = set.create_action::<bool>("fire", "Fire", &hands).unwrap();
    let pull = set.create_action::<f32>("pull", "Pull", &hands).unwrap();
    let walk = set.create_action::<xr::Vector2f>("walk", "Walk", &hands).unwrap();
    let aim = set.create_action::<xr::Posef>("aim", "Aim", &hands).unwrap();
    let touch = path(TOUCH);
    let place = |rest: &str| path(&format!("/user/hand/left/input/{rest}"));
    let bindings = [
        xr::Binding::new(&fire, place("x/click")),
        xr::Binding::new(&fire, place("trigger")),
        xr::Binding::new(&pull, place("trigger")),
        xr::Binding::new(&walk, place("thumbstick")),
        xr::Binding::new(&aim, place("aim")),
    ];
    instance.suggest_interaction_profile_bindings(touch, &bindings).unwrap();
    session.attach_action_sets(&[&set]).unwrap();
    app.mock.connect("/user/hand/left", TOUCH).unwrap();
    begin(&app, &session);
    focus(&app, &mut waiter, &mut stream);
    let tracker = session.create_hand_tracker(xr::Hand::LEFT).unwrap();
    let space = aim.create_space(&session, hands[0], xr::Posef::IDENTITY).unwrap();
    let base = session.create_reference_space(xr::ReferenceSpaceType::LOCAL, xr::Posef::IDENTITY).unwrap();
    let time = xr::Time::from_nanos(1_000_000_000);
    let mut seen = 0;
    let mut frame = |value: f32| {
        app.mock.set_input("/user/hand/left/input/trigger/value", value).unwrap();
        app.mock.set_input("/user/hand/left/input/thumbstick", [value, -value]).unwrap();
        session.sync_actions(&[xr::ActiveActionSet::new(&set)]).unwrap();
        seen += u32::from(fire.state(&session, hands[0]).unwrap().current_state);
        seen += u32::from(pull.state(&session, xr::Path::NULL).unwrap().changed_since_last_sync);
        seen += u32::from(walk.state(&session, xr::Path::NULL).unwrap().changed_since_last_sync);
        seen += u32::from(space.relate(&base, time).unwrap().0.location_flags.into_raw() == 15);
        seen += u32::from(base.relate_hand_joints(&tracker, time).unwrap().is_some());
        assert_eq!(session.current_interaction_profile(hands[0]).unwrap(), touch);
    };
    (0..12).for_each(|i| frame(if i % 2 == 0 { 0.0 } else { 1.0 }));
    // The log of calls has room for 4096 of them from the beginning.
    let before = ALLOCATIONS.get();
    (0..100).for_each(|i| frame(if i % 2 == 0 { 0.0 } else { 1.0 }));
    assert_eq!(ALLOCATIONS.get() - before, 0);
    assert!(seen > 400, "{seen}");
    assert_eq!(app.mock.violations(), []);
}
