//! A session goes over to another world, quality or light, or on after a frame that failed, and what it shows is what one
//! opened there would show.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

#[path = "support/studio.rs"]
mod studio;

use fathomless::course::Course;
use fathomless::mock::Calls;
use fathomless::quality::Fineness;
use fathomless::settings::QualitySettings;
use fathomless::viewer::ViewerConfig;
use fathomless::world::{Sun, World};
use openxr::sys;
use studio::{Setup, Studio, pose};

fn colours(studio: &mut Studio) -> [Vec<u8>; 2] {
    let mut frame = studio.shoot(&pose(0.3, 2.2, -12.0, 40.0));
    [0, 1].map(|eye| std::mem::take(&mut frame.views[eye].rgba))
}

fn course(world: &World) -> Course {
    Course::new(world.surface, 0, 1.0, |_| ())
}

#[test]
fn another_world_and_quality_look_as_if_they_had_always_been_there() {
    let setup = |world| Setup { world, size: [96, 96], deepest: 1.0, ..Setup::default() };
    let mut hills = Studio::open(&setup("hills"));
    let usual = *hills.viewer.quality();
    let fineness = Fineness { split: 3.4, down: 2, ..usual.fineness() };
    let tuned = usual.tuned(&fineness, hills.viewer.pixels_per_tangent());
    let expected = colours(&mut hills);

    let mut studio = Studio::open(&setup("canyonlands"));
    let before = colours(&mut studio);
    assert_ne!(before, expected);
    let (canyonlands, world) = (World::load("canyonlands").unwrap(), World::load("hills").unwrap());
    studio.viewer.redraw(&world, usual).unwrap();
    studio.course = course(&world);
    assert_eq!(colours(&mut studio), expected);
    let drawn = studio.viewer.counts().drawn;

    // Finer, and back where it began.
    studio.viewer.redraw(&world, tuned).unwrap();
    let finer = colours(&mut studio);
    assert!(finer != expected && studio.viewer.counts().drawn != drawn);
    studio.viewer.redraw(&canyonlands, usual).unwrap();
    studio.course = course(&canyonlands);
    assert_eq!(colours(&mut studio), before);
    hills.close();
    studio.close();
}

#[test]
fn light_from_elsewhere_reaches_the_backdrop_too() {
    let mut studio = Studio::open(&Setup { size: [96, 96], deepest: 1.0, ..Setup::default() });
    let usual = colours(&mut studio);
    let sun = Sun { azimuth_deg: 310.0, elevation_deg: 12.0 };
    studio.viewer.set_sun(sun.direction(), true);
    let moved = colours(&mut studio);
    assert_ne!(moved, usual);

    let mut world = World::load("canyonlands").unwrap();
    world.look.sun_direction = sun.direction();
    let quality = *studio.viewer.quality();
    studio.viewer.redraw(&world, quality).unwrap();
    assert_eq!(colours(&mut studio), moved, "as in a world that has this light");
    studio.close();
}

/// What is seen after a way of many frames, each of which is refused halfway or none: its second question for the eyes, when
/// tiles and backdrop have been recorded.
fn after_a_dive(refused: bool) -> [Vec<u8>; 2] {
    // Budgets that bind on no machine.
    let wish = QualitySettings { tile_ms: 1000.0, bake_ms: Some(1000.0), ..QualitySettings::default() };
    let viewer = ViewerConfig { complete: false, wish, ..Setup::default().viewer };
    let mut studio = Studio::open(&Setup { size: [96, 96], deepest: 8.0, viewer, ..Setup::default() });
    let at = |i: i32| pose(7.0 * f64::from(i) / 60.0, 2.2, -12.0, 40.0);
    studio.shoot(&at(0));
    for i in 1..60 {
        if refused {
            let next = Calls::Nth(studio.mock.calls("xrLocateViews") + 2);
            studio.mock.on_call("xrLocateViews", next, sys::Result::ERROR_TIME_INVALID).unwrap();
        }
        let drawn = studio.viewer.frame(&studio.course.at(&at(i)), false);
        assert_eq!(drawn.is_err(), refused);
    }
    let mut frame = studio.shoot(&at(60));
    studio.close();
    [0, 1].map(|eye| std::mem::take(&mut frame.views[eye].rgba))
}

#[test]
fn a_frame_that_fails_halfway_leaves_nothing_undrawn() {
    assert!(after_a_dive(true) == after_a_dive(false), "something is missing");
}
