//! The cube layer of the mock runtime: right uses are recorded and read back, wrong ones get the code that the
//! specification demands.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "wrong uses need the raw functions")]

mod mock_support;

use std::ptr;

use ash::vk::{self, Handle as _};
use fathomless::mock::{Mock, MockConfig};
use mock_support::{App, Chain, application, begin, extensions, stepped};
use openxr as xr;
use xr::{
    sys,
    sys::{Handle as _, Result as R},
};

const FACE: u32 = 8;
const EYE: [u32; 2] = [16, 16];
const NAME: &str = "XR_KHR_composition_layer_cube";

fn with_cubes() -> xr::ExtensionSet {
    let mut set = extensions();
    set.khr_composition_layer_cube = true;
    set
}

/// A swapchain of two cubemaps per image, and what it holds.
struct Cubes {
    swapchain: xr::Swapchain<xr::Vulkan>,
    images: Vec<vk::Image>,
}

impl Cubes {
    fn new(session: &xr::Session<xr::Vulkan>) -> Self {
        let swapchain = session
            .create_swapchain(&xr::SwapchainCreateInfo {
                create_flags: xr::SwapchainCreateFlags::EMPTY,
                usage_flags: xr::SwapchainUsageFlags::COLOR_ATTACHMENT
                    | xr::SwapchainUsageFlags::TRANSFER_DST,
                format: vk::Format::R8G8B8A8_UNORM.as_raw() as u32,
                sample_count: 1,
                width: FACE,
                height: FACE,
                face_count: 6,
                array_size: 2,
                mip_count: 1,
            })
            .unwrap();
        let images = swapchain.enumerate_images().unwrap().into_iter().map(vk::Image::from_raw).collect();
        Self { swapchain, images }
    }

    /// Layer i of all faces of all cubemaps is as red as i.
    fn fill(&mut self, app: &App) {
        let index = self.swapchain.acquire_image().unwrap();
        self.swapchain.wait_image(xr::Duration::INFINITE).unwrap();
        let colours: Vec<[f32; 4]> = (0..12).map(|i| [i as f32 / 255.0, 0.5, 1.0, 1.0]).collect();
        app.clear(self.images[index as usize], false, &colours);
        self.swapchain.release_image().unwrap();
    }

    fn layer(&self, space: &xr::Space) -> sys::CompositionLayerCubeKHR {
        sys::CompositionLayerCubeKHR {
            ty: sys::CompositionLayerCubeKHR::TYPE,
            next: ptr::null(),
            layer_flags: sys::CompositionLayerFlags::EMPTY,
            space: space.as_raw(),
            eye_visibility: sys::EyeVisibility::BOTH,
            swapchain: self.swapchain.as_raw(),
            image_array_index: 0,
            orientation: sys::Quaternionf::IDENTITY,
        }
    }
}

fn end(app: &App, session: &xr::Session<xr::Vulkan>, layers: &[*const sys::CompositionLayerBaseHeader]) -> R {
    let info = sys::FrameEndInfo {
        ty: sys::FrameEndInfo::TYPE,
        next: ptr::null(),
        display_time: sys::Time::from_nanos(1),
        environment_blend_mode: sys::EnvironmentBlendMode::OPAQUE,
        layer_count: layers.len() as u32,
        layers: layers.as_ptr(),
    };
    // SAFETY: the runtime verifies what it is given.
    unsafe { (app.instance.fp().end_frame)(session.as_raw(), &info) }
}

fn local(session: &xr::Session<xr::Vulkan>) -> xr::Space {
    session.create_reference_space(xr::ReferenceSpaceType::LOCAL, xr::Posef::IDENTITY).unwrap()
}

#[test]
fn a_cube_behind_the_eyes_is_recorded_and_read_back() {
    let app = App::with_extensions(Mock::new(stepped()), &with_cubes());
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    let space = local(&session);
    let mut cubes = Cubes::new(&session);
    let mut eyes = Chain::new(&session, vk::Format::R8G8B8A8_SRGB, EYE);
    cubes.fill(&app);
    eyes.fill(&app, [[0.0; 4]; 2]);
    let turn = sys::Quaternionf { x: 0.0, y: 0.6, z: 0.0, w: 0.8 };
    let views = [0, 1].map(|i| sys::CompositionLayerProjectionView {
        ty: sys::CompositionLayerProjectionView::TYPE,
        next: ptr::null(),
        pose: sys::Posef { orientation: sys::Quaternionf::IDENTITY, position: sys::Vector3f::default() },
        fov: sys::Fovf { angle_left: -0.8, angle_right: 0.8, angle_up: 0.8, angle_down: -0.8 },
        sub_image: eyes.part(i, EYE),
    });
    let blended = sys::CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA;
    let projection = sys::CompositionLayerProjection {
        ty: sys::CompositionLayerProjection::TYPE,
        next: ptr::null(),
        layer_flags: blended,
        space: space.as_raw(),
        view_count: 2,
        views: views.as_ptr(),
    };
    // The last released image stays to be shown: a second frame needs no other.
    for element in [0, 1] {
        waiter.wait().unwrap();
        stream.begin().unwrap();
        let cube = sys::CompositionLayerCubeKHR {
            image_array_index: element,
            orientation: turn,
            ..cubes.layer(&space)
        };
        let layers = [(&raw const cube).cast(), (&raw const projection).cast()];
        assert_eq!(end(&app, &session, &layers), R::SUCCESS);
        let frame = app.mock.take_last_frame().unwrap();
        assert_eq!((frame.layer_count, frame.views.len(), frame.projection_flags), (2, 2, blended));
        let shown = frame.cube.unwrap();
        assert_eq!((shown.layer, shown.face), (0, FACE));
        assert_eq!(shown.eyes, sys::EyeVisibility::BOTH);
        assert_eq!(shown.orientation.to_array(), [0.0, 0.6, 0.0, 0.8]);
        let texels = (FACE * FACE) as usize;
        assert_eq!(shown.rgba.len(), 6 * 4 * texels);
        for (i, pixel) in shown.rgba.chunks_exact(4).enumerate() {
            let layer = 6 * element as usize + i / texels;
            assert_eq!(pixel, [layer as u8, 128, 255, 255], "texel {i} of cubemap {element}");
        }
    }
    // Alone, and without being read back.
    app.mock.set_read_back(false);
    waiter.wait().unwrap();
    stream.begin().unwrap();
    assert_eq!(end(&app, &session, &[ptr::from_ref(&cubes.layer(&space)).cast()]), R::SUCCESS);
    let frame = app.mock.take_last_frame().unwrap();
    assert!(frame.views.is_empty() && frame.cube.unwrap().rgba.is_empty());
    assert_eq!(app.mock.violations(), []);
    assert_eq!(*app.messages(), Vec::<String>::new());
}

#[test]
fn wrong_cubes_are_refused() {
    let app = App::with_extensions(Mock::new(stepped()), &with_cubes());
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    let (another, ..) = app.session();
    let (space, elsewhere) = (local(&session), local(&another));
    let mut cubes = Cubes::new(&session);
    let untouched = Cubes::new(&session);
    let mut strange = Cubes::new(&another);
    let mut flat = Chain::new(&session, vk::Format::R8G8B8A8_SRGB, EYE);
    let mut deep = Chain::new(&session, vk::Format::D32_SFLOAT, EYE);
    cubes.fill(&app);
    strange.fill(&app);
    flat.fill(&app, [[0.0; 4]; 2]);
    deep.fill(&app, [[0.0; 4]; 2]);
    let handles = [&flat, &deep].map(|chain| chain.swapchain.as_raw());
    let (bare, foreign) = (untouched.swapchain.as_raw(), strange.swapchain.as_raw());
    let far = elsewhere.as_raw();
    let nan = f32::NAN;
    type Change<'a> = &'a dyn Fn(&mut sys::CompositionLayerCubeKHR);
    let cases: &[(R, Change<'_>)] = &[
        (R::SUCCESS, &|_| {}),
        (R::SUCCESS, &|it| it.image_array_index = 1),
        (R::SUCCESS, &|it| it.eye_visibility = sys::EyeVisibility::LEFT),
        (R::SUCCESS, &|it| it.layer_flags = sys::CompositionLayerFlags::from_raw(0x7)),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.layer_flags = sys::CompositionLayerFlags::from_raw(0x8)),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.eye_visibility = sys::EyeVisibility::from_raw(3)),
        (R::ERROR_HANDLE_INVALID, &|it| it.space = sys::Space::NULL),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.space = far),
        (R::ERROR_HANDLE_INVALID, &|it| it.swapchain = sys::Swapchain::NULL),
        (R::ERROR_HANDLE_INVALID, &|it| it.swapchain = sys::Swapchain::from_raw(5)),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.swapchain = foreign),
        (R::ERROR_LAYER_INVALID, &|it| it.swapchain = bare),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.swapchain = handles[0]),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.swapchain = handles[1]),
        (R::ERROR_VALIDATION_FAILURE, &|it| it.image_array_index = 2),
        (R::ERROR_POSE_INVALID, &|it| it.orientation.w = 0.5),
        (R::ERROR_POSE_INVALID, &|it| it.orientation.w = 0.0),
        (R::ERROR_POSE_INVALID, &|it| it.orientation.x = nan),
    ];
    for (i, (code, change)) in cases.iter().enumerate() {
        waiter.wait().unwrap();
        stream.begin().unwrap();
        let mut cube = cubes.layer(&space);
        change(&mut cube);
        assert_eq!(end(&app, &session, &[(&raw const cube).cast()]), *code, "case {i}");
    }
    let broken = cases.iter().filter(|(code, _)| *code != R::SUCCESS).count();
    assert_eq!(app.mock.violations().len(), broken);
    assert!(app.mock.violations().iter().all(|it| it.function == "xrEndFrame" && it.text.len() > 8));

    // A swapchain that is gone; and a cubemap is no picture for an eye.
    let gone = cubes.layer(&space);
    let mut square = flat.part(0, [FACE, FACE]);
    square.swapchain = gone.swapchain;
    let quad = sys::CompositionLayerQuad {
        ty: sys::CompositionLayerQuad::TYPE,
        next: ptr::null(),
        layer_flags: sys::CompositionLayerFlags::EMPTY,
        space: space.as_raw(),
        eye_visibility: sys::EyeVisibility::BOTH,
        sub_image: square,
        pose: sys::Posef { orientation: sys::Quaternionf::IDENTITY, position: sys::Vector3f::default() },
        size: sys::Extent2Df { width: 1.0, height: 1.0 },
    };
    waiter.wait().unwrap();
    stream.begin().unwrap();
    assert_eq!(end(&app, &session, &[(&raw const quad).cast()]), R::ERROR_VALIDATION_FAILURE);
    drop(cubes);
    assert_eq!(end(&app, &session, &[(&raw const gone).cast()]), R::ERROR_HANDLE_INVALID);
    assert_eq!(*app.messages(), Vec::<String>::new());
}

#[test]
fn a_cube_needs_its_extension() {
    // Offered and not enabled.
    let app = App::new(stepped());
    let (session, mut waiter, mut stream) = app.session();
    begin(&app, &session);
    let space = local(&session);
    let mut cubes = Cubes::new(&session);
    cubes.fill(&app);
    waiter.wait().unwrap();
    stream.begin().unwrap();
    assert_eq!(end(&app, &session, &[ptr::from_ref(&cubes.layer(&space)).cast()]), R::ERROR_LAYER_INVALID);
    assert_eq!(app.mock.violations().len(), 1);

    // Not offered.
    assert!(app.mock.entry().unwrap().enumerate_extensions().unwrap().khr_composition_layer_cube);
    let mock = Mock::new(MockConfig { absent_extensions: vec![NAME.into()], ..stepped() });
    let entry = mock.entry().unwrap();
    assert!(!entry.enumerate_extensions().unwrap().khr_composition_layer_cube);
    let made = entry.create_instance(&application(1), &with_cubes(), &[], &());
    assert_eq!(made.err(), Some(R::ERROR_EXTENSION_NOT_PRESENT));
}
