//! What a conformant runtime lets every application do: swapchains of every kind, as many layers as every runtime must
//! take, sessions and instances one after the other, frames waited for in one thread and drawn in another.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "swapchains of every kind need the raw functions")]

mod mock_support;

use std::{ptr, sync::mpsc, thread, time::Duration};

use ash::vk;
use fathomless::mock::{Clock, Mock, MockConfig};
use mock_support::{
    App, Chain, Desk, application, assert_documented, begin, empty_frame, extensions, stepped,
};
use openxr as xr;
use xr::sys::{self, Handle as _, Result as R};

/// Every runtime takes so many layers.
const LAYERS: usize = 16;

fn plain(format: i64) -> sys::SwapchainCreateInfo {
    let depth = [vk::Format::D32_SFLOAT, vk::Format::D24_UNORM_S8_UINT, vk::Format::D16_UNORM];
    let is_depth = depth.iter().any(|it| i64::from(it.as_raw()) == format);
    sys::SwapchainCreateInfo {
        ty: sys::SwapchainCreateInfo::TYPE,
        next: ptr::null(),
        create_flags: sys::SwapchainCreateFlags::EMPTY,
        usage_flags: if is_depth {
            sys::SwapchainUsageFlags::DEPTH_STENCIL_ATTACHMENT
        } else {
            sys::SwapchainUsageFlags::COLOR_ATTACHMENT
        },
        format,
        sample_count: 1,
        width: 64,
        height: 64,
        face_count: 1,
        array_size: 1,
        mip_count: 1,
    }
}

/// Everything an application may want of a format, one wish at a time.
fn wishes(format: i64) -> Vec<sys::SwapchainCreateInfo> {
    use sys::{SwapchainCreateFlags as Create, SwapchainUsageFlags as Usage};
    let plain = plain(format);
    let mut all = vec![
        plain,
        sys::SwapchainCreateInfo { width: 8, height: 8, ..plain },
        sys::SwapchainCreateInfo { width: 1, height: 3, ..plain },
        sys::SwapchainCreateInfo { face_count: 6, ..plain },
        sys::SwapchainCreateInfo { create_flags: Create::STATIC_IMAGE, ..plain },
        sys::SwapchainCreateInfo { create_flags: Create::PROTECTED_CONTENT, ..plain },
    ];
    for usage in [
        Usage::COLOR_ATTACHMENT,
        Usage::DEPTH_STENCIL_ATTACHMENT,
        Usage::UNORDERED_ACCESS,
        Usage::TRANSFER_SRC,
        Usage::TRANSFER_DST,
        Usage::SAMPLED,
        Usage::MUTABLE_FORMAT,
        Usage::EMPTY,
    ] {
        all.push(sys::SwapchainCreateInfo { usage_flags: usage, ..plain });
        all.push(sys::SwapchainCreateInfo { usage_flags: usage | plain.usage_flags, ..plain });
    }
    all.extend([2, 4].map(|sample_count| sys::SwapchainCreateInfo { sample_count, ..plain }));
    all.extend([2, 3, 6].map(|array_size| sys::SwapchainCreateInfo { array_size, ..plain }));
    all.extend([2, 7].map(|mip_count| sys::SwapchainCreateInfo { mip_count, ..plain }));
    // More than a chain of this size can have.
    all.push(sys::SwapchainCreateInfo { mip_count: 8, ..plain });
    all
}

/// Acquires all images, then waits for and releases them in turn; between, calls out of order.
fn cycle(fp: &xr::raw::Instance, swapchain: sys::Swapchain, count: u32) {
    let wait = sys::SwapchainImageWaitInfo {
        ty: sys::SwapchainImageWaitInfo::TYPE,
        next: ptr::null(),
        timeout: sys::Duration::from_nanos(500_000_000),
    };
    let acquire =
        sys::SwapchainImageAcquireInfo { ty: sys::SwapchainImageAcquireInfo::TYPE, next: ptr::null() };
    let release =
        sys::SwapchainImageReleaseInfo { ty: sys::SwapchainImageReleaseInfo::TYPE, next: ptr::null() };
    let mut index = u32::MAX;
    let order = R::ERROR_CALL_ORDER_INVALID;
    // SAFETY: whole structures; the runtime verifies the order of calls.
    unsafe {
        assert_eq!((fp.wait_swapchain_image)(swapchain, &wait), order);
        assert_eq!((fp.release_swapchain_image)(swapchain, &release), order);
        let mut indices = Vec::new();
        for i in 0..count {
            let info = if i % 2 == 0 { ptr::null() } else { &raw const acquire };
            assert_eq!((fp.acquire_swapchain_image)(swapchain, info, &mut index), R::SUCCESS);
            assert!(index < count && !indices.contains(&index), "{index} of {count}");
            indices.push(index);
            assert_eq!((fp.release_swapchain_image)(swapchain, &release), order);
        }
        assert_eq!((fp.acquire_swapchain_image)(swapchain, &acquire, &mut index), order);
        for i in 0..count {
            assert_eq!((fp.wait_swapchain_image)(swapchain, &wait), R::SUCCESS);
            assert_eq!((fp.wait_swapchain_image)(swapchain, &wait), order);
            let info = if i % 2 == 0 { ptr::null() } else { &raw const release };
            assert_eq!((fp.release_swapchain_image)(swapchain, info), R::SUCCESS);
        }
    }
}

#[test]
fn swapchains_of_every_kind() {
    let app = App::new(stepped());
    let (session, ..) = app.session();
    let fp = app.instance.fp();
    let formats = session.enumerate_swapchain_formats().unwrap();
    assert!(formats.len() > 5);
    let (mut made, mut refused) = (0, 0);
    for format in formats {
        for info in wishes(i64::from(format)) {
            let mut swapchain = sys::Swapchain::NULL;
            // SAFETY: a whole structure of a living session.
            let code = unsafe { (fp.create_swapchain)(session.as_raw(), &info, &mut swapchain) };
            if code == R::ERROR_FEATURE_UNSUPPORTED {
                refused += 1;
                continue;
            }
            let case = format!("format {format}, {:?} {:?}", info.create_flags, info.usage_flags);
            assert_eq!(code, R::SUCCESS, "{case}");
            made += 1;
            let is_static = info.create_flags == sys::SwapchainCreateFlags::STATIC_IMAGE;
            let mut count = 0;
            // SAFETY: the count alone is asked for.
            let code = unsafe { (fp.enumerate_swapchain_images)(swapchain, 0, &mut count, ptr::null_mut()) };
            assert_eq!((code, count == 1), (R::SUCCESS, is_static), "{case}");
            cycle(fp, swapchain, count);
            if is_static {
                let mut index = 0;
                // SAFETY: as above.
                let code = unsafe { (fp.acquire_swapchain_image)(swapchain, ptr::null(), &mut index) };
                assert_eq!(code, R::ERROR_CALL_ORDER_INVALID, "{case}: only once");
            } else {
                cycle(fp, swapchain, count);
            }
            // SAFETY: no image of it is in use.
            assert_eq!(unsafe { (fp.destroy_swapchain)(swapchain) }, R::SUCCESS);
        }
    }
    assert!(made > 100 && refused > 20, "{made} made, {refused} refused");
    assert_documented(&app.mock);
    assert_eq!(*app.messages(), Vec::<String>::new());
}

#[test]
fn as_many_layers_as_every_runtime_takes() {
    let mut desk = Desk::new(&extensions());
    let session = desk.session.clone();
    let mut chain = Chain::new(&session, vk::Format::R8G8B8A8_SRGB, [8, 8]);
    chain.fill(&desk.app, [[0.5; 4]; 2]);
    let end = desk.app.instance.fp().end_frame;
    for kind in session.enumerate_reference_spaces().unwrap() {
        let space = session.create_reference_space(kind, xr::Posef::IDENTITY).unwrap();
        for flags in 0..8 {
            let eyes = [xr::EyeVisibility::BOTH, xr::EyeVisibility::LEFT, xr::EyeVisibility::RIGHT];
            let quads: Vec<_> = (0..LAYERS)
                .map(|i| sys::CompositionLayerQuad {
                    ty: sys::CompositionLayerQuad::TYPE,
                    next: ptr::null(),
                    layer_flags: sys::CompositionLayerFlags::from_raw(flags),
                    space: space.as_raw(),
                    eye_visibility: eyes[i % 3],
                    sub_image: chain.part(i as u32 % 2, [8, 8]),
                    pose: xr::Posef::IDENTITY,
                    size: sys::Extent2Df { width: 1.0, height: 1.0 },
                })
                .collect();
            let layers: Vec<*const sys::CompositionLayerBaseHeader> =
                quads.iter().map(|quad| ptr::from_ref(quad).cast()).collect();
            let state = desk.waiter.wait().unwrap();
            desk.stream.begin().unwrap();
            let info = sys::FrameEndInfo {
                ty: sys::FrameEndInfo::TYPE,
                next: ptr::null(),
                display_time: state.predicted_display_time,
                environment_blend_mode: xr::EnvironmentBlendMode::OPAQUE,
                layer_count: LAYERS as u32,
                layers: layers.as_ptr(),
            };
            // SAFETY: whole layers of a living session.
            assert_eq!(unsafe { end(session.as_raw(), &info) }, R::SUCCESS, "{kind:?} {flags:#x}");
            assert_eq!(desk.app.mock.take_last_frame().unwrap().quads.len(), LAYERS);
        }
    }
    assert_eq!(desk.app.mock.violations(), []);
    assert_eq!(*desk.app.messages(), Vec::<String>::new());
}

#[test]
fn one_after_the_other() {
    let mock = Mock::new(stepped());
    for round in 0..20 {
        let instance =
            mock.entry().unwrap().create_instance(&application(round % 2), &extensions(), &[], &()).unwrap();
        if round % 4 < 2 {
            instance.system(xr::FormFactor::HEAD_MOUNTED_DISPLAY).unwrap();
        }
        let raw = instance.as_raw();
        let destroy = instance.fp().destroy_instance;
        // In another thread; the crate's own end comes too late then.
        // SAFETY: nothing uses the instance any more.
        let code = thread::spawn(move || unsafe { destroy(raw) }).join().unwrap();
        assert_eq!(code, R::SUCCESS);
    }
    let app = App::new(stepped());
    for round in 0..20 {
        let (session, mut waiter, mut stream) = app.session();
        if round % 4 < 2 {
            begin(&app, &session);
            empty_frame(&mut waiter, &mut stream);
        }
        app.poll();
    }
    assert_eq!(app.mock.violations(), []);
}

/// One thread waits for frames, another begins and ends them; each frame is ended only when the next has been waited for.
/// A runtime that waits for a frame's end before it lets the next one begin would never come to an end here.
#[test]
fn frames_of_two_threads_overlap() {
    const FRAMES: usize = 30;
    const SOON: Duration = Duration::from_secs(30);
    for clock in [Clock::Stepped { hz: 90.0 }, Clock::Real { hz: 250.0 }] {
        let app = App::new(MockConfig { clock, read_back: false, ..stepped() });
        let (session, mut waiter, mut stream) = app.session();
        begin(&app, &session);
        let (sender, frames) = mpsc::channel();
        let simulation = thread::spawn(move || {
            for _ in 0..FRAMES {
                sender.send(waiter.wait().unwrap().predicted_display_time).unwrap();
            }
        });
        let mut shown = Vec::new();
        let mut next = frames.recv_timeout(SOON).ok();
        while let Some(time) = next {
            stream.begin().unwrap();
            next = match frames.recv_timeout(SOON) {
                Ok(time) => Some(time),
                Err(mpsc::RecvTimeoutError::Disconnected) => None,
                Err(error) => panic!("after {} frames: {error}", shown.len()),
            };
            stream.end(time, xr::EnvironmentBlendMode::OPAQUE, &[]).unwrap();
            shown.push(time.as_nanos());
        }
        simulation.join().unwrap();
        assert_eq!(shown.len(), FRAMES);
        assert!(shown.is_sorted_by(|a, b| a < b), "{shown:?}");
        assert_eq!(app.mock.violations(), []);
    }
}
