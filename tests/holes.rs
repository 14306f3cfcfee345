//! No holes: on a magenta background, with the sky off and the whole picture below the horizon, nothing is magenta.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

#[path = "support/easel.rs"]
mod easel;
#[path = "support/studio.rs"]
mod studio;

use std::f64::consts::TAU;
use std::ops::Range;

use easel::{Easel, MAGENTA, Shot};
use fathomless::mock::{Fov, SubmittedView};
use fathomless::render::Shading;
use fathomless::viewer::ViewerConfig;
use studio::{Setup, Studio};

/// Half the angle of view, radians: with the pitches below, even a corner of the picture looks well downwards.
const FOV: f32 = 0.6;

/// Frames of the flight.
const FRAMES: u32 = 330;

/// A flight made to show holes: dives, climbs, slides across borders, turns and rolls, near and far from the ground.
fn shot(t: f64) -> Shot {
    let wave = |period: f64| (t / period * TAU).sin();
    let way = |from: f64, to: f64, a: u32, b: u32| from + (to - from) * (t - f64::from(a)) / f64::from(b - a);
    let still = Shot { fov: FOV, pitch_deg: -90.0, ..Shot::default() };
    match t as u32 {
        // Falls an octave every five frames, turning fast.
        0..150 => Shot {
            depth: way(0.0, 30.0, 0, 150),
            height: 2.0 + 0.8 * wave(31.0),
            pitch_deg: -82.0 + 6.0 * wave(17.0),
            yaw_deg: 11.0 * t,
            ..still
        },
        // Climbs faster.
        150..165 => Shot {
            depth: way(30.0, 20.5, 150, 165),
            height: 2.5,
            pitch_deg: -84.0,
            yaw_deg: -23.0 * t,
            roll_deg: 3.0 * t,
            ..still
        },
        // Slides over the country, a tile at a time, low above it.
        165..175 => Shot {
            depth: 20.5,
            height: 1.1,
            offset: [way(0.0, 11.0, 165, 175), way(0.0, -7.0, 165, 175)],
            pitch_deg: -85.0,
            yaw_deg: 2.0 * t,
            ..still
        },
        // Slides while it falls and rises.
        175..185 => Shot {
            depth: 21.0 + 1.4 * wave(9.0),
            height: 1.5 + 0.5 * wave(7.0),
            offset: [2.5 * wave(13.0), 2.5 * wave(17.0)],
            pitch_deg: -80.0,
            yaw_deg: 31.0 * t,
            ..still
        },
        // Far down, from very near to high above.
        _ => Shot {
            depth: 60.0,
            height: 0.6 + way(0.0, 12.0, 185, FRAMES),
            pitch_deg: -88.0,
            yaw_deg: 5.0 * t,
            ..still
        },
    }
}

/// Frames of the flight, a moment apart: 1 is the pace that it is written in.
fn frames(range: Range<u32>, moment: f64) -> impl Iterator<Item = f64> {
    let count = f64::from(range.end - range.start) / moment;
    (0..count as u32).map(move |i| f64::from(range.start) + f64::from(i) * moment)
}

fn magenta(view: &SubmittedView) -> usize {
    view.rgba.chunks_exact(4).filter(|p| p[0] > 200 && p[1] < 50 && p[2] > 200).count()
}

/// Flies on the viewer itself: session, runtime and all.
fn fly(world: &'static str, frames: impl Iterator<Item = f64>, size: u32, complete: bool) -> usize {
    let fov = Fov { left: -FOV, right: FOV, up: FOV, down: -FOV };
    let viewer = ViewerConfig { validate: true, complete, ..ViewerConfig::default() };
    let setup = Setup { world, size: [size; 2], fov: [fov; 2], deepest: 64.0, viewer, ..Setup::default() };
    let mut studio = Studio::open(&setup);
    studio.viewer.set_shading(Shading::Holes(MAGENTA));
    let mut waited = 0;
    for t in frames {
        let shot = shot(t);
        let submitted = studio.shoot(&shot.pose());
        for (eye, view) in submitted.views.iter().enumerate() {
            assert_eq!(view.rgba.len(), (4 * size * size) as usize);
            let holes = magenta(view);
            assert_eq!(holes, 0, "{world}, moment {t}, eye {eye}: {:?}", studio.viewer.counts());
        }
        waited += usize::from(studio.viewer.counts().waiting > 0);
    }
    studio.close();
    waited
}

#[test]
fn no_hole_in_a_flight_where_every_tile_is_there() {
    fly("canyonlands", frames(0..FRAMES, 1.0), 112, true);
}

#[test]
fn no_hole_in_the_other_worlds() {
    fly("hills", frames(0..FRAMES, 11.0), 128, true);
    fly("tunkovic", frames(3..FRAMES, 11.0), 128, true);
}

/// Tiles come as the budget allows, so parents stand in for them.
#[test]
fn no_hole_where_the_viewer_keeps_to_its_budget() {
    let mut waited = 0;
    for (range, moment) in [(0..30, 0.5), (150..165, 0.2), (165..175, 0.1)] {
        waited += fly("canyonlands", frames(range, moment), 96, false);
    }
    println!("tiles were waited for in {waited} frames");
    assert!(waited > 0, "the budget was never short: nothing was tested");
}

/// The same with a fixed ration of tiles per frame, so that every run waits for the same ones.
#[test]
fn no_hole_while_tiles_are_waited_for() {
    let flights = [(8, 0..90, 0.5), (4, 150..165, 0.2), (4, 165..175, 0.1), (8, 175..185, 0.1)];
    let mut waits = 0;
    for (ration, range, moment) in flights {
        let mut easel = Easel::new("canyonlands", [112, 112], false);
        let (mut drawn, mut waited, mut most) = (0, 0, 0);
        for t in frames(range.clone(), moment) {
            // Nothing can stand in for the tiles of the first frame.
            let ration = if drawn == 0 { usize::MAX } else { ration };
            let counts = easel.draw(&shot(t), ration, |_, _| {});
            assert_eq!(easel.holes(), 0, "ration {ration}, moment {t}: {counts:?}");
            drawn += 1;
            waited += u32::from(counts.waiting > 0);
            most = most.max(counts.waiting);
        }
        println!("ration {ration}: {waited} of {drawn} frames waited, for {most} tiles at most");
        waits += waited;
        easel.close();
    }
    assert!(waits > 150, "the rations are small enough to be felt: {waits} frames waited");
}

/// What the tests above look for can be seen: a tile left out, no tiles at all, a tile moved.
#[test]
fn a_hole_would_be_seen() {
    let mut easel = Easel::new("canyonlands", [128, 128], false);
    let shot = shot(40.0);
    let whole = easel.draw(&shot, usize::MAX, |_, _| {});
    assert_eq!(easel.holes(), 0);

    easel.draw(&shot, usize::MAX, |drawn, _| drawn.clear());
    assert_eq!(easel.holes(), 2 * 128 * 128, "nothing is drawn over the background");

    // Most tiles in view show when they are missing (some are behind a ridge or just outside the picture).
    let mut seen = 0;
    let tried = 0..whole.drawn.min(40);
    for left_out in tried.clone() {
        easel.draw(&shot, usize::MAX, |drawn, _| {
            drawn.remove(left_out);
        });
        seen += usize::from(easel.holes() > 0);
    }
    println!("{seen} of {} missing tiles are seen", tried.len());
    assert!(seen * 3 > tried.len(), "{seen} of {} missing tiles are seen", tried.len());

    // One tile too low by a tenth of its side: gaps along its edges that no skirt covers.
    let mut gaps = 0;
    for narrowed in tried {
        easel.draw(&shot, usize::MAX, |drawn, _| {
            let tile = &mut drawn[narrowed];
            tile.head.y += 0.1;
        });
        gaps = gaps.max(easel.holes());
    }
    println!("{gaps} pixels of gap at most");
    assert!(gaps > 0, "a tile that hangs too low leaves a gap");
    easel.close();
}
