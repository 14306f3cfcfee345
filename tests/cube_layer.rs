//! Sky and backdrop as a layer of the runtime's own show what the eyes would have drawn: composed by a compositor's
//! rules, pixel by pixel, the picture is the same.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use ash::vk;
use fathomless::course::Course;
use fathomless::flight::FlightPose;
use fathomless::mock::{
    Calls, Clock, Mock, MockConfig, Pose, PoseTrack, SubmittedCube, SubmittedFrame, SubmittedView,
};
use fathomless::render::Shading;
use fathomless::settings::QualitySettings;
use fathomless::viewer::{Step, Viewer, ViewerConfig};
use fathomless::world::{World, linear_from_srgb};
use glam::{EulerRot, Quat, Vec2, Vec3};
use openxr::sys;

const SIZE: u32 = 192;
const EXTENSION: &str = "XR_KHR_composition_layer_cube";

/// Turned about all axes: the rig by the flight, and the head in it.
fn pose(depth: f64) -> FlightPose {
    FlightPose {
        depth,
        yaw: 0.7,
        pitch: 0.15,
        roll: 0.1,
        height: 2.0,
        offset: [0.0; 2],
        ..FlightPose::default()
    }
}

fn headset() -> MockConfig {
    let head = Quat::from_euler(EulerRot::YXZ, 0.5, -0.25, -0.2);
    MockConfig {
        clock: Clock::Stepped { hz: 90.0 },
        eye_size: [SIZE; 2],
        head: PoseTrack::fixed(Pose::new(Vec3::new(0.3, 1.7, -0.2), head)),
        read_back: true,
        ..MockConfig::default()
    }
}

fn with_layer() -> ViewerConfig {
    ViewerConfig { validate: true, backdrop_layer: true, ..ViewerConfig::default() }
}

struct Seat {
    viewer: Viewer,
    course: Course,
    mock: Mock,
}

impl Seat {
    fn new(headset: MockConfig, config: &ViewerConfig) -> Seat {
        Seat::on(Mock::new(headset), config)
    }

    fn on(mock: Mock, config: &ViewerConfig) -> Seat {
        let world = World::load("canyonlands").unwrap();
        let viewer = Viewer::on_mock(&world, config, mock.clone()).unwrap();
        let course = Course::new(world.surface, 0, 64.0, |_| ());
        Seat { viewer, course, mock }
    }

    /// The next frame with a picture, drawn from `pose`.
    fn draw(&mut self, pose: &FlightPose) -> SubmittedFrame {
        while self.viewer.frame(&self.course.at(pose), false).unwrap() != Step::Drew {}
        self.mock.take_last_frame().unwrap()
    }

    fn close(self) {
        let remarks = self.viewer.close().unwrap();
        assert_eq!(remarks.validation + remarks.violations, 0, "{remarks:?}");
        assert_eq!(self.mock.leaks(), []);
    }
}

/// A cubemap as Vulkan samples it ("Cube Map Face Selection" and "Cube Map Coordinate Transformation"), linear
/// filter, without crossing the faces' edges; linear light.
fn sample(cube: &SubmittedCube, direction: Vec3) -> Vec3 {
    let Vec3 { x, y, z } = direction;
    let size = direction.abs();
    let (face, s, t, major) = if size.z >= size.x && size.z >= size.y {
        if z > 0.0 { (4, x, -y, z) } else { (5, -x, -y, -z) }
    } else if size.y >= size.x {
        if y > 0.0 { (2, x, z, y) } else { (3, x, -z, -y) }
    } else if x > 0.0 {
        (0, -z, -y, x)
    } else {
        (1, z, -y, -x)
    };
    let side = cube.face as usize;
    let at = (Vec2::new(s, t) / major * 0.5 + 0.5) * side as f32 - 0.5;
    let low = at.floor();
    let f = at - low;
    let texel = |dx: f32, dy: f32| {
        let clamp = |v: f32| v.clamp(0.0, side as f32 - 1.0) as usize;
        let start = 4 * ((face * side + clamp(low.y + dy)) * side + clamp(low.x + dx));
        linear(&cube.rgba[start..start + 3])
    };
    let row = |dy| texel(0.0, dy).lerp(texel(1.0, dy), f.x);
    row(0.0).lerp(row(1.0), f.y)
}

fn linear(rgb: &[u8]) -> Vec3 {
    Vec3::from_array([0, 1, 2].map(|i| linear_from_srgb(rgb[i])))
}

fn srgb(linear: f32) -> f32 {
    let x = linear.clamp(0.0, 1.0);
    255.0 * if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

/// What the wearer sees of a view over a cube turned by `orientation`: sRGB, 0 to 255, RGB.
fn composed(view: &SubmittedView, cube: &SubmittedCube, orientation: Quat) -> Vec<f32> {
    let [width, height] = view.size;
    let tangents = [view.fov.left, view.fov.right, view.fov.up, view.fov.down].map(f32::tan);
    let [left, right, up, down] = tangents;
    let cube_from_view = orientation.conjugate() * view.pose.orientation;
    let mut seen = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let across = left + (right - left) * (x as f32 + 0.5) / width as f32;
            let upwards = up + (down - up) * (y as f32 + 0.5) / height as f32;
            let [r, g, b, a] = view.pixel(x, y).unwrap();
            let behind = sample(cube, cube_from_view * Vec3::new(across, upwards, -1.0));
            let light = linear(&[r, g, b]) + behind * (1.0 - f32::from(a) / 255.0);
            seen.extend(light.to_array().map(srgb));
        }
    }
    seen
}

/// Mean difference of a picture from a view's own pixels, in 1/255.
fn difference(picture: &[f32], view: &SubmittedView) -> f64 {
    let own = view.rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]);
    let sum: f64 = picture.iter().zip(own).map(|(a, b)| f64::from((a - f32::from(b)).abs())).sum();
    sum / picture.len() as f64
}

/// Composes the frame with the layer and compares it with the frame without.
fn compare(headset: &MockConfig, config: &ViewerConfig) {
    let mut with = Seat::new(headset.clone(), config);
    let mut without = Seat::new(headset.clone(), &ViewerConfig { backdrop_layer: false, ..*config });
    assert!(with.viewer.backdrop_layer().is_some() && without.viewer.backdrop_layer().is_none());
    let at = pose(25.6);
    let (layered, whole) = (with.draw(&at), without.draw(&at));
    assert_eq!((layered.layer_count, whole.layer_count), (2, 1));
    let cube = layered.cube.unwrap();
    assert_eq!((cube.layer, cube.eyes), (0, sys::EyeVisibility::BOTH), "behind, for both eyes");
    assert_eq!(cube.flags, sys::CompositionLayerFlags::EMPTY);
    assert_eq!(layered.projection_flags, sys::CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA);
    assert_eq!(whole.projection_flags, sys::CompositionLayerFlags::EMPTY);
    for (eye, (view, reference)) in layered.views.iter().zip(&whole.views).enumerate() {
        assert_eq!((view.pose, view.fov), (reference.pose, reference.fov));
        check_alpha(view, config.wish.samples.unwrap_or(1));
        let mean = difference(&composed(view, &cube, cube.orientation), reference);
        println!("eye {eye}: {mean:.3}/255");
        assert!(mean < 2.0, "eye {eye}: {mean}");
        // The comparison can tell: turned otherwise, or not at all, it is another picture.
        for wrong in [Quat::IDENTITY, cube.orientation.conjugate()] {
            let off = difference(&composed(view, &cube, wrong), reference);
            assert!(off > 4.0 * mean.max(0.5), "eye {eye}: {off} with {wrong}");
        }
    }
    with.close();
    without.close();
}

/// Tiles are opaque; where there is none, colour, alpha and depth are 0. There is much of both. Where a pixel has several
/// samples, some have a tile in a part of them: alpha is that part, and colours are multiplied by it.
fn check_alpha(view: &SubmittedView, samples: u32) {
    let depth = view.depth.as_ref().unwrap();
    let (mut open, mut parts) = (0, 0);
    for (i, pixel) in view.rgba.chunks_exact(4).enumerate() {
        match pixel {
            [_, _, _, 255] => assert!(depth.values[i] > 0.0, "pixel {i}"),
            [r, g, b, part @ 1..=254] if samples > 1 => {
                let covered = f32::from(*part) / 255.0 * samples as f32;
                assert!((covered - covered.round()).abs() < 0.05, "pixel {i}: {part}");
                assert!(linear(&[*r, *g, *b]).max_element() <= f32::from(*part) / 255.0 + 0.01, "pixel {i}");
                parts += 1;
            }
            _ => {
                assert_eq!((pixel, depth.values[i]), (&[0; 4][..], 0.0), "pixel {i}");
                open += 1;
            }
        }
    }
    let pixels = view.rgba.len() / 4;
    assert!(open > pixels / 20 && open < pixels * 19 / 20, "{open} of {pixels} pixels are open");
    assert_eq!(parts > 50, samples > 1, "{parts} pixels are open in part");
}

#[test]
fn the_layer_shows_what_the_eyes_would_have_drawn() {
    compare(&headset(), &with_layer());
}

#[test]
fn a_pass_per_eye_and_a_format_that_does_not_encode() {
    let formats = vec![vk::Format::B8G8R8A8_UNORM, vk::Format::D32_SFLOAT];
    compare(&MockConfig { formats, ..headset() }, &ViewerConfig { multiview: false, ..with_layer() });
}

#[test]
fn pixels_that_a_tile_covers_in_part_show_the_layer_in_the_rest() {
    let wish = QualitySettings { samples: Some(4), ..QualitySettings::default() };
    compare(&headset(), &ViewerConfig { wish, ..with_layer() });
}

/// The images that a frame asks the runtime for.
fn acquired(seat: &mut Seat, pose: &FlightPose) -> u64 {
    let before = seat.mock.calls("xrAcquireSwapchainImage");
    seat.draw(pose);
    seat.mock.calls("xrAcquireSwapchainImage") - before
}

#[test]
fn the_faces_are_drawn_only_when_they_change() {
    let mut seat = Seat::new(headset(), &with_layer());
    let side = seat.viewer.quality().backdrop.face;
    assert_eq!(seat.viewer.backdrop_layer(), Some(side), "texel for texel the backdrop's");
    // Colour and depth of the eyes; and the cube.
    assert_eq!(acquired(&mut seat, &pose(25.3)), 3, "the first frame");
    for depth in [25.3, 25.3, 25.32, 25.34] {
        assert_eq!(acquired(&mut seat, &pose(depth)), 2, "depth {depth}");
    }
    let turned = FlightPose { yaw: -2.0, ..pose(25.3) };
    assert_eq!(acquired(&mut seat, &turned), 2, "the layer is turned, not drawn");
    assert_eq!(acquired(&mut seat, &pose(25.5)), 3, "the air has moved on");
    let stamp = seat.viewer.backdrop().stamp();
    assert_eq!(acquired(&mut seat, &pose(26.0)), 3, "a layer more is baked");
    assert_ne!(seat.viewer.backdrop().stamp(), stamp);
    assert_eq!(acquired(&mut seat, &pose(26.0)), 2);

    // Looking for holes, the eyes draw everything themselves.
    seat.viewer.set_shading(Shading::Holes([1.0, 0.0, 1.0, 1.0]));
    assert_eq!(seat.draw(&pose(26.0)).layer_count, 1);
    seat.viewer.set_shading(Shading::Full);
    let frame = seat.draw(&pose(26.0));
    assert_eq!((frame.layer_count, frame.views[0].size), (2, [SIZE; 2]));
    assert!(seat.viewer.keep_pictures().unwrap_err().to_string().contains("--backdrop-layer"));
    seat.close();
}

/// Whether every pixel of both eyes is opaque, in a frame of one layer.
fn is_whole(frame: &SubmittedFrame) -> bool {
    let opaque = |view: &SubmittedView| view.rgba.chunks_exact(4).all(|p| p[3] == 255);
    frame.layer_count == 1 && frame.cube.is_none() && frame.views.iter().all(opaque)
}

#[test]
fn without_the_layer_the_eyes_draw_everything() {
    let mut plain = Seat::new(headset(), &ViewerConfig { backdrop_layer: false, ..with_layer() });
    let wanted = plain.draw(&pose(25.6));
    assert!(is_whole(&wanted));
    plain.close();
    // A runtime without the extension; one that has it and makes no cubemaps.
    let absent = Mock::new(MockConfig { absent_extensions: vec![EXTENSION.into()], ..headset() });
    let refusing = Mock::new(headset());
    // The eyes' colour and depth come first.
    refusing.on_call("xrCreateSwapchain", Calls::Nth(3), sys::Result::ERROR_FEATURE_UNSUPPORTED).unwrap();
    for mock in [absent, refusing] {
        let mut seat = Seat::on(mock, &with_layer());
        assert_eq!(seat.viewer.backdrop_layer(), None);
        let frame = seat.draw(&pose(25.6));
        assert!(is_whole(&frame));
        assert_eq!(frame.views[1].rgba, wanted.views[1].rgba);
        seat.viewer.keep_pictures().unwrap();
        seat.close();
    }
}

#[test]
fn a_runtime_that_keeps_the_cube_gets_the_picture_whole() {
    let mut seat = Seat::new(headset(), &with_layer());
    assert_eq!(seat.draw(&pose(25.3)).layer_count, 2);
    // The air has moved on, and the cube cannot be drawn: colour and depth are waited for first.
    let waited = seat.mock.calls("xrWaitSwapchainImage");
    seat.mock.on_call("xrWaitSwapchainImage", Calls::Nth(waited + 3), sys::Result::TIMEOUT_EXPIRED).unwrap();
    assert!(is_whole(&seat.draw(&pose(25.5))));
    assert_eq!(seat.draw(&pose(25.5)).layer_count, 2);
    seat.close();
}

#[test]
fn a_paced_dive_keeps_the_layer_all_the_way() {
    let headset = MockConfig { read_back: false, ..headset() };
    let mut seat = Seat::new(headset, &ViewerConfig { complete: false, ..with_layer() });
    seat.draw(&pose(24.9));
    let first = seat.viewer.backdrop().stamp();
    for i in 0..150 {
        let frame = seat.draw(&pose(24.9 + 0.01 * f64::from(i)));
        assert_eq!(frame.layer_count, 2, "frame {i}");
        assert_eq!(frame.cube.unwrap().layer, 0, "frame {i}");
    }
    let baked = seat.viewer.backdrop().stamp() - first;
    assert!(baked >= 1, "no layer was baked on the way");
    seat.close();
}
