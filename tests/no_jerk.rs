//! A steady dive through a session does about as much in one frame as in the next: tiles made, texels baked, draws. Counters
//! only: times are the machine's.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use fathomless::course::Course;
use fathomless::flight::FlightPose;
use fathomless::settings::QualitySettings;
use fathomless::telemetry::Work;
use fathomless::viewer::{Step, Viewer, ViewerConfig};
use fathomless::world::World;

/// Octaves per second, and frames in one.
const SPEED: f64 = 2.5;
const FPS: f64 = 60.0;

/// Octaves until the dive is steady, and octaves in which it is.
const BEGINNING: f64 = 14.0;
const STEADY: f64 = 14.0;

/// A dive's counters, frame by frame, from where it is steady.
fn dive(world: &str) -> Vec<Work> {
    let world = World::load(world).unwrap();
    let config = ViewerConfig {
        validate: true,
        eye_size: Some([64, 64]),
        complete: false,
        // Budgets that bind on no machine; what is drawn of a tile is counted nowhere.
        wish: QualitySettings {
            mesh: Some(4),
            tile_ms: 1000.0,
            bake_ms: Some(1000.0),
            ..QualitySettings::default()
        },
        ..ViewerConfig::default()
    };
    let mut viewer = Viewer::open(&world, &config).unwrap();
    let mut course = Course::new(world.surface, 0, BEGINNING + STEADY, |_| ());
    let frames = |octaves: f64| (octaves / SPEED * FPS) as usize;
    let mut work = Vec::new();
    for frame in 0..frames(BEGINNING + STEADY) {
        let depth = frame as f64 * SPEED / FPS;
        let pose = FlightPose { depth, pitch: -0.45, height: 2.0, ..FlightPose::default() };
        while viewer.frame(&course.at(&pose), false).unwrap() != Step::Drew {}
        assert!(viewer.headroom() == 1.0, "nothing holds a dive up");
        work.push(viewer.stats().work);
    }
    let remarks = viewer.close().unwrap();
    assert_eq!(remarks.validation + remarks.violations, 0, "{remarks:?}");
    work.split_off(frames(BEGINNING))
}

/// What is counted of a frame's work, with its name.
type Counter = (&'static str, fn(&Work) -> u64);

#[test]
fn a_steady_dive_does_as_much_in_every_frame() {
    for world in ["canyonlands", "hills", "tunkovic"] {
        let work = dive(world);
        let counters: [Counter; 4] = [
            ("tiles made", |work| work.tiles_made),
            ("texels baked", |work| work.texels_baked),
            ("tiles drawn", |work| work.tiles_drawn),
            ("draws", |work| work.draws),
        ];
        let mut uneven = Vec::new();
        for (name, counter) in counters {
            let mut counts: Vec<u64> = work.iter().map(counter).collect();
            counts.sort_unstable();
            let (median, most) = (counts[counts.len() / 2], counts[counts.len() - 1]);
            println!("{world}: {name}: {median} in a frame, {most} at most");
            if median == 0 || most as f64 > 1.25 * median as f64 {
                uneven.push(name);
            }
        }
        assert!(uneven.is_empty(), "{world}: {uneven:?}");
        // What is wanted is there already: it was foreseen.
        let waiting: u64 = work.iter().map(|work| work.tiles_waiting).sum();
        let in_a_frame = waiting as f64 / work.len() as f64;
        println!("{world}: {in_a_frame:.1} tiles wait");
        assert!(in_a_frame < 20.0, "{world}: {in_a_frame} tiles wait, on average");
    }
}
