//! No pinholes: no lone pixel of background in the middle of the ground, live or baked, and no sky under a mountain's top.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use fathomless::course::Course;
use fathomless::flight::FlightPose;
use fathomless::quality::Quality;
use fathomless::render::Shading;
use fathomless::settings::QualitySettings;
use fathomless::viewer::{Step, Viewer, ViewerConfig};
use fathomless::world::World;

const MAGENTA: [u8; 3] = [255, 0, 255];

const SIZE: [usize; 2] = [384, 384];

/// A viewer by whose pictures one tells what is not land.
fn open(world: &World) -> Viewer {
    let size = SIZE.map(|n| n as u32);
    let config = ViewerConfig { validate: true, eye_size: Some(size), ..ViewerConfig::default() };
    let mut viewer = Viewer::open(world, &config).unwrap();
    viewer.set_shading(Shading::Holes([1.0, 0.0, 1.0, 1.0]));
    viewer.keep_pictures().unwrap();
    viewer
}

/// Whether the pixel (x, y) of an eye's picture is not land.
fn holes(viewer: &mut Viewer, eye: usize) -> impl Fn(usize, usize) -> bool + use<> {
    let picture = viewer.picture(eye).unwrap();
    move |x, y| picture[3 * (y * SIZE[0] + x)..][..3] == MAGENTA
}

fn close(viewer: Viewer) {
    let remarks = viewer.close().unwrap();
    assert_eq!(remarks.validation + remarks.violations, 0, "{remarks:?}");
}

/// Land has no overhangs: in a picture with an upright horizon ahead, it goes on below wherever it begins.
#[test]
fn no_sky_under_land() {
    for name in ["canyonlands", "hills", "tunkovic"] {
        let world = World::load(name).unwrap();
        let mut viewer = open(&world);
        let mut course = Course::new(world.surface, 300, 12.0, |_| ());
        for in_a_window in [false, true] {
            if in_a_window {
                let pixels = viewer.pixels_per_tangent();
                let quality = Quality::for_window(&viewer.gpu().info, pixels, &QualitySettings::default());
                viewer.redraw(&world, quality).unwrap();
            }
            let (mut sky, mut land, mut under) = (0, 0, 0);
            for i in 0..12 {
                let f = f64::from(i);
                let pose = FlightPose {
                    depth: 0.73 * f,
                    yaw: 2.4 * f,
                    height: 0.3 + 0.3 * (f % 8.0),
                    ..FlightPose::default()
                };
                while viewer.frame(&course.at(&pose), false).unwrap() != Step::Drew {}
                for eye in 0..2 {
                    let is_hole = holes(&mut viewer, eye);
                    for x in 0..SIZE[0] {
                        // A texel's corner may stand out of a ridge by a pixel.
                        let is_land = |&y: &usize| !is_hole(x, y) && !is_hole(x, y + 1);
                        let top = (0..SIZE[1] - 1).find(is_land).unwrap_or(SIZE[1]);
                        (sky, land) = (sky + top, land + SIZE[1] - top);
                        for y in (top..SIZE[1]).filter(|&y| is_hole(x, y)) {
                            under += 1;
                            println!(
                                "{name}, window {in_a_window}, frame {i}, eye {eye}: ({x}, {y}) under {top}"
                            );
                        }
                    }
                }
            }
            println!("{name}: {sky} pixels of sky, {land} of land, {under} of sky under it");
            assert!(sky > 100_000 && land > 100_000, "the pictures show nothing");
            assert_eq!(under, 0, "{name}, window: {in_a_window}");
        }
        close(viewer);
    }
}

#[test]
fn no_lone_pixel_of_background() {
    let world = World::load("canyonlands").unwrap();
    let mut viewer = open(&world);
    let mut course = Course::new(world.surface, 300, 12.0, |_| ());
    let (mut lone, mut pixels) = (0, 0);
    for i in 0..24 {
        let f = f64::from(i);
        let pose = FlightPose {
            depth: 0.37 * f,
            yaw: 1.3 * f,
            pitch: -0.1 - 0.05 * (f % 7.0),
            roll: 0.1 * f,
            height: 1.2 + 0.1 * f,
            offset: [0.0; 2],
            ..FlightPose::default()
        };
        while viewer.frame(&course.at(&pose), false).unwrap() != Step::Drew {}
        for eye in 0..2 {
            let at = holes(&mut viewer, eye);
            for y in 1..SIZE[1] - 1 {
                for x in 1..SIZE[0] - 1 {
                    let around = (0..9).filter(|&n| n != 4).any(|n| at(x + n % 3 - 1, y + n / 3 - 1));
                    pixels += 1;
                    if at(x, y) && !around {
                        lone += 1;
                        if lone < 20 {
                            println!("frame {i} eye {eye}: ({x}, {y})");
                        }
                    }
                }
            }
        }
    }
    assert_eq!(lone, 0, "lone pixels of {pixels}");
    close(viewer);
}
