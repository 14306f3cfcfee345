//! A session on the mock runtime lives its whole life by the book: IDLE to EXITING, frames in between, pictures and
//! depth read back as drawn, not a word from the validation layers, nothing recorded as wrong.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "depth layers need raw structures")]

mod mock_support;

use ash::vk;
use fathomless::mock::MockConfig;
use mock_support::{App, Chain, begin, empty_frame, stepped};
use openxr as xr;
use xr::SessionState as S;

const SIZE: [u32; 2] = [64, 48];
const NEAR: f32 = 0.1;

/// Submits both eyes with depth, reversed and infinite.
fn submit(
    stream: &mut xr::FrameStream<xr::Vulkan>,
    time: xr::Time,
    space: &xr::Space,
    views: &[xr::View],
    colour: &Chain,
    depth: &Chain,
) {
    let infos = [0, 1].map(|i| xr::sys::CompositionLayerDepthInfoKHR {
        ty: xr::sys::CompositionLayerDepthInfoKHR::TYPE,
        next: std::ptr::null(),
        sub_image: depth.part(i, SIZE),
        min_depth: 0.0,
        max_depth: 1.0,
        near_z: f32::INFINITY,
        far_z: NEAR,
    });
    // SAFETY: the depth infos outlive the call.
    let views = [0, 1].map(|i| unsafe {
        xr::CompositionLayerProjectionView::from_raw(xr::sys::CompositionLayerProjectionView {
            ty: xr::sys::CompositionLayerProjectionView::TYPE,
            next: (&raw const infos[i]).cast(),
            pose: views[i].pose,
            fov: views[i].fov,
            sub_image: colour.part(i as u32, SIZE),
        })
    });
    let layer = xr::CompositionLayerProjection::new().space(space).views(&views);
    stream.end(time, xr::EnvironmentBlendMode::OPAQUE, &[&layer]).unwrap();
}

fn live(config: MockConfig, colour_format: vk::Format, depth_format: vk::Format) {
    let app = App::new(config);
    let (session, mut waiter, mut stream) = app.session();
    assert!(session.enumerate_swapchain_formats().unwrap().contains(&(colour_format.as_raw() as u32)));
    assert_eq!(app.poll(), [S::IDLE, S::READY]);
    session.begin(mock_support::STEREO).unwrap();
    let space =
        session.create_reference_space(xr::ReferenceSpaceType::LOCAL_FLOOR, xr::Posef::IDENTITY).unwrap();
    let mut colour = Chain::new(&session, colour_format, SIZE);
    let mut depth = Chain::new(&session, depth_format, SIZE);

    let mut told = Vec::new();
    let mut last_time = 0;
    let mut rendered = 0;
    for frame in 0..12 {
        let state = waiter.wait().unwrap();
        let time = state.predicted_display_time.as_nanos();
        assert!(time > last_time, "display times increase");
        last_time = time;
        stream.begin().unwrap();
        // READY, SYNCHRONIZED and then visible.
        assert_eq!(state.should_render, frame >= 2, "frame {frame}");
        if state.should_render {
            let shade = frame as f32 / 12.0;
            colour.fill(&app, [[1.0, 0.0, 0.0, 1.0], [0.0, shade, 1.0, 1.0]]);
            depth.fill(&app, [[0.25; 4], [0.75; 4]]);
            let (flags, views) =
                session.locate_views(mock_support::STEREO, state.predicted_display_time, &space).unwrap();
            assert!(
                flags
                    .contains(xr::ViewStateFlags::POSITION_TRACKED | xr::ViewStateFlags::ORIENTATION_TRACKED)
            );
            submit(&mut stream, state.predicted_display_time, &space, &views, &colour, &depth);
            rendered += 1;
        } else {
            stream.end(state.predicted_display_time, xr::EnvironmentBlendMode::OPAQUE, &[]).unwrap();
        }
        told.extend(app.poll());
    }
    assert_eq!(told, [S::SYNCHRONIZED, S::VISIBLE, S::FOCUSED]);

    let frames = app.mock.take_frames();
    assert_eq!(frames.len(), 8, "the last eight are kept");
    let frame = frames.last().unwrap();
    assert_eq!(frame.index, 11);
    assert_eq!(frame.display_time_ns, frame.predicted_display_time_ns);
    assert_eq!(frame.views.len(), 2);
    let srgb = matches!(
        colour_format,
        vk::Format::R8G8B8A8_SRGB | vk::Format::B8G8R8A8_SRGB | vk::Format::R16G16B16A16_SFLOAT
    );
    // 11/12 as a byte, linear or sRGB-encoded.
    let green = if srgb { 245 } else { 234 };
    for (i, view) in frame.views.iter().enumerate() {
        let wanted = [[255, 0, 0, 255], [0, green, 255, 255]][i];
        assert_eq!(view.rgba.len(), 4 * 64 * 48);
        for pixel in view.rgba.chunks_exact(4) {
            let near = pixel.iter().zip(wanted).all(|(a, b)| a.abs_diff(b) <= 1);
            assert!(near, "{colour_format:?}: {pixel:?} is not {wanted:?}");
        }
        let depth = view.depth.as_ref().unwrap();
        assert_eq!(depth.values.len(), 64 * 48);
        let wanted = [0.25, 0.75][i];
        assert!(depth.values.iter().all(|d| (d - wanted).abs() < 1e-4));
        assert_eq!((depth.min_depth, depth.max_depth), (0.0, 1.0));
        assert_eq!((depth.near_z, depth.far_z), (f32::INFINITY, NEAR));
    }

    session.request_exit().unwrap();
    assert_eq!(app.poll(), [S::VISIBLE, S::SYNCHRONIZED, S::STOPPING]);
    assert!(!empty_frame(&mut waiter, &mut stream).should_render);
    session.end().unwrap();
    assert_eq!(app.poll(), [S::IDLE, S::EXITING]);
    assert_eq!(app.mock.calls("xrEndFrame"), 13);
    assert_eq!(app.mock.calls("xrAcquireSwapchainImage"), 2 * rendered);

    drop((colour, depth, space, session, waiter, stream));
    assert_eq!(*app.messages(), Vec::<String>::new());
    let mock = app.mock.clone();
    drop(app);
    assert_eq!(mock.violations(), []);
    assert_eq!(mock.leaks(), []);
}

#[test]
fn a_life_in_srgb_and_d32() {
    live(stepped(), vk::Format::R8G8B8A8_SRGB, vk::Format::D32_SFLOAT);
}

#[test]
fn a_life_in_bgra_and_d16() {
    live(stepped(), vk::Format::B8G8R8A8_UNORM, vk::Format::D16_UNORM);
}

#[test]
fn a_life_in_half_floats_and_one_image() {
    let config = MockConfig { image_count: 1, ..stepped() };
    live(config, vk::Format::R16G16B16A16_SFLOAT, vk::Format::D32_SFLOAT);
}

#[test]
fn children_die_with_their_parents() {
    let app = App::new(stepped());
    let (session, waiter, stream) = app.session();
    begin(&app, &session);
    let space = session.create_reference_space(xr::ReferenceSpaceType::VIEW, xr::Posef::IDENTITY).unwrap();
    let chain = Chain::new(&session, vk::Format::R8G8B8A8_SRGB, SIZE);
    let (raw_session, raw_space) = (session.as_raw(), space.as_raw());
    let raw_chain = chain.swapchain.as_raw();
    let fp = app.instance.fp();
    // The crate's wrappers would destroy them again.
    std::mem::forget((chain.swapchain, space, session, waiter, stream));
    // SAFETY: the runtime verifies every handle.
    unsafe {
        assert_eq!((fp.destroy_session)(raw_session), xr::sys::Result::SUCCESS);
        for gone in [
            (fp.destroy_session)(raw_session),
            (fp.destroy_space)(raw_space),
            (fp.destroy_swapchain)(raw_chain),
            (fp.release_swapchain_image)(raw_chain, std::ptr::null()),
        ] {
            assert_eq!(gone, xr::sys::Result::ERROR_HANDLE_INVALID);
        }
    }
    assert_eq!(*app.messages(), Vec::<String>::new());
    assert_eq!(app.mock.violations().len(), 4);
}

#[test]
fn the_validation_layers_listen() {
    let app = App::new(stepped());
    if !app.validated {
        println!("the validation layers are not installed: nothing to hear");
        return;
    }
    // A buffer that is made for no use at all.
    let buffer = vk::BufferCreateInfo::default().size(16);
    // SAFETY: the layers speak, the driver shrugs, and the buffer is destroyed.
    unsafe {
        let buffer = app.device.create_buffer(&buffer, None).unwrap();
        app.device.destroy_buffer(buffer, None);
    }
    assert!(!app.messages().is_empty());
}

#[test]
fn views_are_compared_with_those_that_were_located() {
    let app = App::new(stepped());
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    let spaces = [xr::ReferenceSpaceType::LOCAL, xr::ReferenceSpaceType::STAGE]
        .map(|kind| session.create_reference_space(kind, xr::Posef::IDENTITY).unwrap());
    let mut colour = Chain::new(&session, vk::Format::R8G8B8A8_SRGB, SIZE);
    let mut depth = Chain::new(&session, vk::Format::D32_SFLOAT, SIZE);
    colour.fill(&app, [[1.0; 4]; 2]);
    depth.fill(&app, [[0.5; 4]; 2]);
    let mut frame = |located: &[i64], change: &dyn Fn(&mut [xr::View]), space: usize| {
        let time = waiter.wait().unwrap().predicted_display_time;
        stream.begin().unwrap();
        let mut views = Vec::new();
        for later in located {
            let time = xr::Time::from_nanos(time.as_nanos() + later);
            views = session.locate_views(mock_support::STEREO, time, &spaces[0]).unwrap().1;
        }
        change(&mut views);
        submit(&mut stream, time, &spaces[space], &views, &colour, &depth);
        app.mock.take_last_frame().unwrap().as_located
    };
    let unchanged = |_: &mut [xr::View]| ();
    assert_eq!(frame(&[0], &unchanged, 0), Some(true));
    assert_eq!(frame(&[1_000_000, 0], &unchanged, 0), Some(true));
    // The head rests: what was located for another time is the same, and was located for this time too.
    assert_eq!(frame(&[0, 1_000_000], &unchanged, 0), Some(true));
    assert_eq!(frame(&[1_000_000], &unchanged, 0), Some(false), "located for another time only");
    assert_eq!(frame(&[0], &unchanged, 1), Some(false), "located in another space");
    assert_eq!(frame(&[0], &|views| views[1].pose.position.x += 1e-6, 0), Some(false));
    assert_eq!(frame(&[0], &|views| views[0].pose.orientation.x += 1e-6, 0), Some(false));
    assert_eq!(frame(&[0], &|views| views[0].fov.angle_left -= 1e-6, 0), Some(false));
    assert_eq!(frame(&[0], &|views| views.swap(0, 1), 0), Some(false));
    empty_frame(&mut waiter, &mut stream);
    assert_eq!(app.mock.take_last_frame().unwrap().as_located, None);
    assert_eq!(app.mock.violations(), []);
}
