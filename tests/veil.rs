//! What darkens the eyes' pictures: a circle around where the head looks, the same for both eyes in angles, black outside
//! and untouched inside; black altogether where a jump is hidden; the layer behind with it, the mirror without it; and
//! nothing at all where there is nothing to darken. Pictures are left in `target/tmp/veil/`.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

#[path = "support/studio.rs"]
mod studio;

use ash::vk;
use fathomless::aids::{Aids, Vignette};
use fathomless::course::Course;
use fathomless::flight::FlightPose;
use fathomless::governor::Dials;
use fathomless::mock::{
    Clock, Fov, Mask, Mock, MockConfig, Pose, PoseTrack, SubmittedFrame, SubmittedView, Tracking,
};
use fathomless::picture::{self, Pixels};
use fathomless::render::BackdropConfig;
use fathomless::render::layout::SlotLayout;
use fathomless::terrain::morph::Detail;
use fathomless::terrain::tile::Cells;
use fathomless::viewer::{Quality, Remarks, Step, Viewer, ViewerConfig};
use fathomless::world::World;
use glam::{EulerRot, Quat, Vec3};
use studio::pose;

const SIZE: [u32; 2] = [128, 112];

const VIGNETTE: Vignette = Vignette { inner: 0.4, outer: 0.7, strength: 1.0 };

/// A head turned about all axes, and eyes whose pictures lie aslant around the middle of their view.
fn headset() -> MockConfig {
    let left = Fov { left: -0.9, right: 0.7, up: 0.7, down: -0.8 };
    let head = Quat::from_euler(EulerRot::YXZ, 0.4, -0.2, 0.1);
    MockConfig {
        clock: Clock::Stepped { hz: 90.0 },
        eye_size: SIZE,
        fov: [left, left.mirrored()],
        mask: Mask::Empty,
        head: PoseTrack::fixed(Pose::new(Vec3::new(0.3, 1.6, -0.1), head)),
        read_back: true,
        ..MockConfig::default()
    }
}

struct Seat {
    viewer: Viewer,
    course: Course,
    mock: Mock,
}

impl Seat {
    fn new(headset: MockConfig, config: ViewerConfig) -> Seat {
        let mock = Mock::new(headset);
        let world = World::load("canyonlands").unwrap();
        let config = ViewerConfig { validate: true, quality: Some(small()), ..config };
        let viewer = Viewer::on_mock(&world, &config, mock.clone()).unwrap();
        Seat { viewer, course: Course::new(world.surface, 0, 4.0, |_| ()), mock }
    }

    /// The next frame with a picture.
    fn draw(&mut self) -> SubmittedFrame {
        let here = here();
        while self.viewer.frame(&self.course.at(&here), true).unwrap() != Step::Drew {}
        self.mock.take_last_frame().unwrap()
    }

    fn with(&mut self, vignette: Option<Vignette>, fade: f32) -> SubmittedFrame {
        self.viewer.set_aids(&Aids { vignette, fade, ..Aids::default() });
        self.draw()
    }

    fn draws(&self) -> u64 {
        self.viewer.stats().work.draws
    }

    fn close(self) {
        assert_eq!(self.viewer.close().unwrap(), Remarks::default());
        assert_eq!(self.mock.leaks(), []);
    }
}

/// Enough for a picture with land and sky.
fn small() -> Quality {
    Quality {
        samples: 1,
        layout: SlotLayout { cells: Cells::new(16).unwrap(), mesh: 8 },
        detail: Detail::new(2.6),
        down: 0,
        backdrop: BackdropConfig { face: 64, lag: 4, bound: 3.0, layers: 2, detail: Detail::new(2.6) },
    }
}

fn here() -> FlightPose {
    pose(2.0, 2.2, 0.0, 20.0)
}

/// Where the head looks: the mean of where its eyes do.
fn ahead(frame: &SubmittedFrame) -> Vec3 {
    let [left, right] = [0, 1].map(|eye| frame.views[eye].pose.orientation * Vec3::NEG_Z);
    (left + right).normalize()
}

/// Radians from there to each pixel of a view.
fn angles(view: &SubmittedView, ahead: Vec3) -> Vec<f32> {
    let [left, right, up, down] = [view.fov.left, view.fov.right, view.fov.up, view.fov.down].map(f32::tan);
    let [width, height] = view.size;
    let at = |i: u32| {
        let (x, y) = ((i % width) as f32 + 0.5, (i / width) as f32 + 0.5);
        let across = left + (right - left) * x / width as f32;
        let upwards = up + (down - up) * y / height as f32;
        (view.pose.orientation * Vec3::new(across, upwards, -1.0)).angle_between(ahead)
    };
    (0..width * height).map(at).collect()
}

/// What is left of a stored colour at so many radians from the middle.
fn left_at(angle: f32, vignette: &Vignette) -> f32 {
    let u = ((angle - vignette.inner) / (vignette.outer - vignette.inner)).clamp(0.0, 1.0);
    1.0 - vignette.strength * u * u * (3.0 - 2.0 * u)
}

/// Compares the pixels of both eyes with those of a picture that nothing darkens: each channel, and alpha's transparency,
/// is so much of what it was as `left` says of its angle, to [`MOST`] of 255.
fn check(plain: &SubmittedFrame, dark: &SubmittedFrame, blends: Blends, left: impl Fn(f32) -> f32) {
    let ahead = ahead(dark);
    let (mut black, mut whole) = (0, 0);
    for (plain, dark) in plain.views.iter().zip(&dark.views) {
        assert_eq!((plain.pose, plain.size), (dark.pose, dark.size));
        let pixels = plain.rgba.chunks_exact(4).zip(dark.rgba.chunks_exact(4));
        for ((was, is), angle) in pixels.zip(angles(dark, ahead)) {
            let left = left(angle);
            for channel in 0..3 {
                let wanted = blends.darken(was[channel], left);
                let off = (f32::from(is[channel]) - wanted).abs();
                assert!(off <= MOST, "at {angle} {was:?} becomes {is:?}, not {wanted}");
            }
            if left == 1.0 {
                assert_eq!(was, is, "untouched at {angle}");
                whole += 1;
            }
            if left == 0.0 {
                assert_eq!(is, [0, 0, 0, 255], "black at {angle}, over whatever is behind");
                black += 1;
            }
        }
    }
    let all = plain.views.iter().map(|view| view.rgba.len() / 4).sum::<usize>();
    assert!(whole + black > all / 4, "{whole} untouched and {black} black of {all} pixels");
}

/// How far stored colours may be off: the dither, and rounding.
const MOST: f32 = 2.5;

/// Brightness as light, and back: the curve of sRGB.
fn as_light(share: f32) -> f32 {
    if share <= 0.04045 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
}

fn as_stored(light: f32) -> f32 {
    if light <= 0.003_130_8 { light * 12.92 } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
}

/// How a target blends.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Blends {
    /// It encodes sRGB by itself.
    Light,
    /// It does not.
    Stored,
}

impl Blends {
    /// A stored colour of which so much is left.
    fn darken(self, was: u8, left: f32) -> f32 {
        let was = f32::from(was) / 255.0;
        255.0
            * match self {
                Blends::Light => as_stored(as_light(was) * as_light(left)),
                Blends::Stored => was * left,
            }
    }
}

#[test]
fn the_circle_is_the_same_for_both_eyes_in_angles_for_every_way_to_draw_them() {
    let srgb = vec![vk::Format::R8G8B8A8_SRGB, vk::Format::D32_SFLOAT];
    let unorm = vec![vk::Format::B8G8R8A8_UNORM, vk::Format::D32_SFLOAT];
    let canted = [Quat::from_rotation_y(0.17), Quat::from_rotation_y(-0.17)];
    for (formats, multiview, eye_turn, blends) in [
        (&srgb, true, [Quat::IDENTITY; 2], Blends::Light),
        (&unorm, false, [Quat::IDENTITY; 2], Blends::Stored),
        (&unorm, true, canted, Blends::Stored),
        (&srgb, false, canted, Blends::Light),
    ] {
        let headset = MockConfig { formats: formats.clone(), eye_turn, ..headset() };
        let mut seat = Seat::new(headset, ViewerConfig { multiview, ..ViewerConfig::default() });
        // The first one bakes, too.
        seat.draw();
        let plain = seat.draw();
        let draws = seat.draws();
        let passes = if seat.viewer.session_info().multiview { 1 } else { 2 };

        let dark = seat.with(Some(VIGNETTE), 0.0);
        assert_eq!(seat.draws(), draws + passes);
        check(&plain, &dark, blends, |angle| left_at(angle, &VIGNETTE));
        // Half as dark, and faded besides.
        let half = Vignette { strength: 0.5, ..VIGNETTE };
        let dark = seat.with(Some(half), 0.25);
        check_shares(&plain, &dark, blends, |angle| 0.75 * left_at(angle, &half));
        let dark = seat.with(None, 1.0);
        check(&plain, &dark, blends, |_| 0.0);

        // What darkens nothing costs nothing, and changes nothing.
        let dark = seat.with(Some(Vignette { strength: 0.0, ..VIGNETTE }), 0.0);
        assert_eq!(seat.draws(), draws);
        check(&plain, &dark, blends, |_| 1.0);
        seat.close();
    }
}

/// As [`check`], of pictures that are neither black nor untouched anywhere.
fn check_shares(plain: &SubmittedFrame, dark: &SubmittedFrame, blends: Blends, left: impl Fn(f32) -> f32) {
    let ahead = ahead(dark);
    for (plain, dark) in plain.views.iter().zip(&dark.views) {
        let pixels = plain.rgba.chunks_exact(4).zip(dark.rgba.chunks_exact(4));
        for ((was, is), angle) in pixels.zip(angles(dark, ahead)) {
            for channel in 0..3 {
                let wanted = blends.darken(was[channel], left(angle));
                let off = (f32::from(is[channel]) - wanted).abs();
                assert!(off <= MOST, "at {angle} {was:?} becomes {is:?}, not {wanted}");
            }
        }
    }
}

/// A format, and what light is as a number there, 0..=1 both.
type Encoding = (vk::Format, fn(f32) -> f32);

/// What is seen of a layer behind the eyes' pictures is as dark as they are.
#[test]
fn the_layer_behind_darkens_with_the_pictures() {
    let as_it_is = |share: f32| share;
    let formats: [Encoding; 2] =
        [(vk::Format::R8G8B8A8_SRGB, as_light), (vk::Format::R8G8B8A8_UNORM, as_it_is)];
    for (format, blended) in formats {
        let headset = MockConfig { formats: vec![format, vk::Format::D32_SFLOAT], ..headset() };
        let mut seat = Seat::new(headset, ViewerConfig { backdrop_layer: true, ..ViewerConfig::default() });
        let plain = seat.draw();
        assert_eq!(plain.layer_count, 2);
        let dark = seat.with(Some(VIGNETTE), 0.0);
        assert_eq!(dark.layer_count, 2);
        let ahead = ahead(&dark);
        let mut open = 0;
        for (plain, dark) in plain.views.iter().zip(&dark.views) {
            let pixels = plain.rgba.chunks_exact(4).zip(dark.rgba.chunks_exact(4));
            for ((was, is), angle) in pixels.zip(angles(dark, ahead)) {
                let through = |alpha: u8| 1.0 - f32::from(alpha) / 255.0;
                // Alpha is no colour: it is blended as light is.
                let wanted = through(was[3]) * blended(left_at(angle, &VIGNETTE));
                assert!((through(is[3]) - wanted).abs() < 0.012, "at {angle}: {was:?} becomes {is:?}");
                open += usize::from(was[3] == 0 && (VIGNETTE.inner..VIGNETTE.outer).contains(&angle));
            }
        }
        assert!(open > 100, "{open} pixels of the edge are over the layer behind");
        let black = seat.with(None, 1.0);
        assert!(black.views.iter().all(|view| view.rgba.chunks_exact(4).all(|p| p == [0, 0, 0, 255])));
        seat.close();
    }
}

#[test]
fn at_a_lower_resolution_the_circle_is_as_wide() {
    let mut seat = Seat::new(headset(), ViewerConfig::default());
    let dials = seat.viewer.dials();
    seat.viewer.set_dials(Dials { scale: 0.5, ..dials });
    let plain = seat.draw();
    assert_eq!(plain.views[0].size, SIZE.map(|side| side / 2));
    let dark = seat.with(Some(VIGNETTE), 0.0);
    check(&plain, &dark, Blends::Light, |angle| left_at(angle, &VIGNETTE));
    seat.close();
}

#[test]
fn what_the_lenses_hide_stays_black() {
    let headset = MockConfig { mask: Mask::Octagon { cut: 0.3 }, ..headset() };
    let mut seat = Seat::new(headset, ViewerConfig { mask: true, ..ViewerConfig::default() });
    let plain = seat.draw();
    assert_eq!(plain.views[0].pixel(0, 0), Some([0, 0, 0, 255]));
    let dark = seat.with(Some(VIGNETTE), 0.0);
    check(&plain, &dark, Blends::Light, |angle| left_at(angle, &VIGNETTE));
    seat.close();
}

/// Whoever watches sees the picture whole, unless he wants the wearer's very own.
#[test]
fn the_mirror_shows_the_picture_without_it_unless_told_to() {
    let mut seat = Seat::new(headset(), ViewerConfig::default());
    seat.viewer.keep_mirror().unwrap();
    let plain = seat.draw();
    let rgb = |view: &SubmittedView| -> Vec<u8> {
        view.rgba.chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect()
    };
    assert_eq!(seat.viewer.read_mirror(0).unwrap(), rgb(&plain.views[0]));
    for fade in [0.0, 1.0] {
        let dark = seat.with(Some(VIGNETTE), fade);
        for eye in 0..2 {
            assert_ne!(rgb(&dark.views[eye]), rgb(&plain.views[eye]));
            assert!(seat.viewer.read_mirror(eye).unwrap() == rgb(&plain.views[eye]), "eye {eye}");
        }
    }
    seat.viewer.show_veil_in_mirror(true);
    let dark = seat.with(Some(VIGNETTE), 0.0);
    assert!(seat.viewer.read_mirror(1).unwrap() == rgb(&dark.views[1]));
    seat.close();
}

fn is_black(frame: &SubmittedFrame) -> bool {
    frame.views.iter().all(|view| view.rgba.chunks_exact(4).all(|pixel| pixel == [0, 0, 0, 255]))
}

/// Whatever moves the wearer by nobody's wish is hidden in the very picture that first shows it, and only there: what
/// comes after is up to whoever fades it in.
#[test]
fn pictures_that_jump_by_themselves_are_black() {
    let mut seat = Seat::new(headset(), ViewerConfig::default());
    seat.viewer.set_aids(&Aids { blinks: true, ..Aids::default() });
    let mut draw = |why: &str, black: bool| {
        let frame = seat.draw();
        assert_eq!(is_black(&frame), black, "{why}");
        assert_eq!(seat.viewer.has_jolted(), black, "{why}");
    };
    draw("the session's first picture", true);
    draw("the next", false);
    let mock = seat.mock.clone();
    mock.recentre(Pose::at(0.4, 0.0, -0.3));
    let jumped = (0..4).filter(|_| is_black(&seat.draw())).count();
    assert_eq!(jumped, 1, "recentred");

    let mut draw = |why: &str, black: bool| assert_eq!(is_black(&seat.draw()), black, "{why}");
    mock.set_tracking(Some(Tracking::LOST));
    draw("not tracked: the last that is known", false);
    mock.set_tracking(None);
    draw("tracked again where he was", false);
    mock.set_tracking(Some(Tracking::LOST));
    draw("not tracked", false);
    mock.hold_head(Pose::new(Vec3::new(0.3, 1.6, -0.1), Quat::from_rotation_y(2.0)));
    mock.set_tracking(None);
    draw("tracked again, turned", true);
    draw("and then", false);
    let here = here();
    // At 90 Hz.
    for (frames, black) in [(1, false), (20, false), (30, true)] {
        mock.set_should_render(Some(false));
        for _ in 0..frames {
            assert_eq!(seat.viewer.frame(&seat.course.at(&here), true).unwrap(), Step::Skipped);
        }
        mock.set_should_render(None);
        assert_eq!(is_black(&seat.draw()), black, "seen again after {frames} frames without");
        assert!(!is_black(&seat.draw()));
    }
    // Captures want every picture.
    seat.viewer.set_aids(&Aids::default());
    mock.recentre(Pose::at(-0.4, 0.0, 0.3));
    assert!((0..4).all(|_| !is_black(&seat.draw())));
    seat.close();
}

/// For a person to look at: rows of strengths and of fades, without a layer behind and with one, which is composed here.
#[test]
fn pictures_to_look_at() {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("veil");
    std::fs::create_dir_all(&folder).unwrap();
    for backdrop_layer in [false, true] {
        let size = [320, 280];
        let config = ViewerConfig { backdrop_layer, ..ViewerConfig::default() };
        let mut seat = Seat::new(MockConfig { eye_size: size, ..headset() }, config);
        let shots = [
            (None, 0.0),
            (Some(Vignette { strength: 0.4, ..VIGNETTE }), 0.0),
            (Some(Vignette { inner: 0.6, outer: 0.86, ..VIGNETTE }), 0.0),
            (Some(Vignette { inner: 30f32.to_radians(), outer: 45f32.to_radians(), strength: 1.0 }), 0.0),
            (Some(VIGNETTE), 0.5),
            (None, 0.8),
        ];
        let mut sheet = Vec::new();
        for (vignette, fade) in shots {
            let frame = seat.with(vignette, fade);
            for y in 0..size[1] {
                for (view, x) in frame.views.iter().flat_map(|view| (0..size[0]).map(move |x| (view, x))) {
                    let [r, g, b, a] = view.pixel(x, y).unwrap();
                    // Where a layer is behind, a plain one of this grey stands for it.
                    let behind = 130.0 * (1.0 - f32::from(a) / 255.0).powf(1.0 / 2.2);
                    sheet.extend([r, g, b].map(|c| (f32::from(c) + behind).min(255.0) as u8));
                }
            }
        }
        let name = if backdrop_layer { "over_a_layer.png" } else { "veil.png" };
        let size = [2 * size[0], size[1] * shots.len() as u32];
        picture::write(&folder.join(name), size, Pixels::Rgb8(&sheet), &[]).unwrap();
        seat.close();
    }
}
