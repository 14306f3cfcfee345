//! No pinholes: no lone pixel of background in the middle of the ground, live or baked.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use fathomless::course::Course;
use fathomless::flight::FlightPose;
use fathomless::render::Shading;
use fathomless::viewer::{Step, Viewer, ViewerConfig};
use fathomless::world::World;

const MAGENTA: [u8; 3] = [255, 0, 255];

#[test]
fn no_lone_pixel_of_background() {
    let world = World::load("canyonlands").unwrap();
    let size = [384, 384];
    let config = ViewerConfig { validate: true, eye_size: Some(size), ..ViewerConfig::default() };
    let mut viewer = Viewer::open(&world, &config).unwrap();
    viewer.set_shading(Shading::Holes([1.0, 0.0, 1.0, 1.0]));
    viewer.keep_pictures().unwrap();
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
            let picture = viewer.picture(eye).unwrap();
            let at = |x: usize, y: usize| {
                let i = 3 * (y * size[0] as usize + x);
                [picture[i], picture[i + 1], picture[i + 2]] == MAGENTA
            };
            for y in 1..size[1] as usize - 1 {
                for x in 1..size[0] as usize - 1 {
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
    let remarks = viewer.close().unwrap();
    assert_eq!(remarks.validation + remarks.violations, 0, "{remarks:?}");
}
