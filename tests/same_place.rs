//! Down and up again, the same places have the same heights and look the same: a thousand octaves down and back, and in
//! frames that keep to their budget just as in complete ones.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};

use fathomless::course::Course;
use fathomless::flight::FlightPose;
use fathomless::terrain::morph::Detail;
use fathomless::terrain::pool::Slot;
use fathomless::terrain::select::{Selection, Tiles, View};
use fathomless::terrain::surface::Corner;
use fathomless::terrain::tile::Cells;
use fathomless::terrain::{Patch, Tile};
use fathomless::viewer::{Step, Viewer, ViewerConfig};
use fathomless::world::World;

const SIZE: u32 = 128;

/// A viewer with a course of its own.
struct Seat {
    viewer: Viewer,
    course: Course,
}

impl Seat {
    fn new(complete: bool) -> Seat {
        let world = World::load("canyonlands").unwrap();
        let config = ViewerConfig {
            validate: true,
            eye_size: Some([SIZE, SIZE]),
            complete,
            ..ViewerConfig::default()
        };
        let mut viewer = Viewer::open(&world, &config).unwrap();
        viewer.keep_pictures().unwrap();
        Seat { viewer, course: Course::new(world.surface, 0, 1024.0, |_| ()) }
    }

    fn draw(&mut self, pose: &FlightPose) {
        while self.viewer.frame(&self.course.at(pose), false).unwrap() != Step::Drew {}
    }

    fn picture(&mut self, pose: &FlightPose) -> Vec<u8> {
        self.draw(pose);
        self.viewer.picture(0).unwrap()
    }

    fn close(self) {
        let remarks = self.viewer.close().unwrap();
        assert_eq!(remarks.validation + remarks.violations, 0, "{remarks:?}");
    }
}

fn pose(depth: f64) -> FlightPose {
    FlightPose { depth, yaw: 0.3, pitch: -0.3, height: 2.0, ..FlightPose::default() }
}

/// Mean difference of two pictures, in 1/255, and the share of pixels that differ by more than 24.
fn difference(a: &[u8], b: &[u8]) -> (f64, f64) {
    let sum: u64 = a.iter().zip(b).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    let pixels = a.chunks_exact(3).zip(b.chunks_exact(3));
    let far = pixels.filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 24)).count();
    (sum as f64 / a.len() as f64, far as f64 / (a.len() / 3) as f64)
}

/// Every tile is there.
struct All;

impl Tiles for All {
    fn ready(&mut self, _: Corner) -> Option<Slot> {
        Some(0)
    }

    fn make(&mut self, _: &Patch, _: bool) -> Option<Slot> {
        Some(0)
    }
}

/// A patch decides every height of its tile: the patches of all tiles that are drawn on each of a thousand levels are the
/// same on the way in and on the way out, and so are the heights of some, one by one.
#[test]
fn every_height_is_met_again() {
    let surface = World::load("canyonlands").unwrap().surface;
    let mut course = Course::new(surface, 0, 1_000.0, |_| ());
    let mut selection = Selection::default();
    let mut met = |depth: f64| {
        let here = course.at(&pose(depth));
        let (root, head) = here.place.seen_from_above(here.position, 11);
        let detail = Detail::new(2.6);
        let view = View {
            root: &root.block,
            head,
            levels: 14,
            live_from: 0,
            prefetch_from: 0,
            detail,
            frusta: None,
        };
        selection.select(&surface, &view, &mut All);
        let mut sum = DefaultHasher::new();
        for drawn in &selection.drawn {
            let Patch { corner, plane, r } = selection.patch(drawn);
            (corner, plane.c, plane.gx, plane.gz, r).hash(&mut sum);
        }
        for drawn in selection.drawn.iter().step_by(97) {
            let tile = Tile::of(&surface, selection.patch(drawn), Cells::of_steps(5));
            (tile.fine, tile.coarse).hash(&mut sum);
        }
        (selection.drawn.len(), sum.finish())
    };
    let depths = || (0..1_001).map(|level| f64::from(level) - 0.3);
    let down: Vec<_> = depths().map(&mut met).collect();
    for (depth, there) in depths().zip(&down).rev() {
        assert_eq!(met(depth), *there, "{depth} octaves down");
    }
    let different: HashSet<u64> = down.iter().map(|(_, heights)| *heights).collect();
    assert_eq!(different.len(), down.len(), "no two levels have the same heights");
}

#[test]
fn a_thousand_octaves_and_back() {
    let mut seat = Seat::new(true);
    let depths: Vec<f64> = (0..=8).map(|i| 125.0 * f64::from(i) + 0.4).collect();
    let down: Vec<Vec<u8>> = depths.iter().map(|&depth| seat.picture(&pose(depth))).collect();
    for (depth, there) in depths.iter().zip(&down).rev() {
        let back = seat.picture(&pose(*depth));
        assert!(back == *there, "{depth} octaves down: {:?}", difference(&back, there));
    }
    for pair in down.windows(2) {
        assert!(difference(&pair[0], &pair[1]).0 > 2.0, "every depth has a picture of its own");
    }
    seat.close();
}

/// The way of a viewer who dives, turns round, rises beyond where he was, and goes aside: the pose of a second.
fn way(second: f64) -> FlightPose {
    match second {
        s if s < 3.0 => pose(20.3 + 0.9 * s),
        s if s < 6.5 => pose(23.0 - 0.9 * (s - 3.0)),
        s => FlightPose { offset: [2.0 * (s - 6.5), 1.0 * (s - 6.5)], ..pose(19.85) },
    }
}

#[test]
fn a_budget_is_not_seen() {
    let (mut paced, mut complete) = (Seat::new(false), Seat::new(true));
    let (mut second, mut frame, mut shown) = (0.0, 0, Vec::new());
    while second < 9.0 {
        let pose = way(second);
        paced.draw(&pose);
        let (headroom, parallax) = (paced.viewer.headroom(), paced.viewer.stats().parallax);
        assert!(parallax <= 1.25, "{parallax} of the bound at {second}");
        if frame % 37 == 36 {
            let ours = paced.viewer.picture(0).unwrap();
            let (mean, far) = difference(&ours, &complete.picture(&pose));
            println!("{second:.2} s, {:.2} octaves: {mean:.2}/255, {far:.4} of the pixels", pose.depth);
            shown.push((second, mean, far));
        }
        frame += 1;
        second += headroom / 60.0;
        assert!(frame < 3000, "the viewer stands still at {second}");
    }
    for (second, mean, far) in shown {
        assert!(mean < 2.0 && far < 0.03, "at {second}: {mean}/255, {far} of the pixels");
    }
    paced.close();
    complete.close();
}
