//! A steady dive makes about as many tiles in one frame as in the next, those to be baked among them, and is never far
//! behind with them.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::HashSet;

use fathomless::course::Course;
use fathomless::flight::FlightPose;
use fathomless::terrain::Patch;
use fathomless::terrain::morph::Detail;
use fathomless::terrain::pace::Pace;
use fathomless::terrain::pool::Slot;
use fathomless::terrain::select::{Selection, Tiles, View};
use fathomless::terrain::surface::Corner;
use fathomless::world::World;
use glam::DVec3;

const LAG: usize = 9;
const DOWN: usize = 3;

/// Tiles that are never forgotten, made at a pace.
#[derive(Default)]
struct Store {
    tiles: HashSet<Corner>,
    pace: Pace,
    made: usize,
}

impl Tiles for Store {
    fn ready(&mut self, tile: Corner) -> Option<Slot> {
        self.tiles.contains(&tile).then_some(0)
    }

    fn make(&mut self, patch: &Patch, needed: bool) -> Option<Slot> {
        self.pace.ask(needed).then(|| {
            self.made += 1;
            self.tiles.insert(patch.corner);
            0
        })
    }

    fn foresee(&mut self, tile: Corner) -> bool {
        !self.tiles.contains(&tile) && self.pace.ask_ahead()
    }

    fn make_ahead(&mut self, patch: &Patch) {
        self.made += 1;
        self.tiles.insert(patch.corner);
    }
}

/// The heights of which a dive foresees the ground, as the viewer does.
const FORESEEN: f64 = 0.4;

#[test]
fn a_steady_dive_makes_its_tiles_evenly() {
    let world = World::load("canyonlands").unwrap();
    for speed in [0.5, 1.0, 2.5, 3.75] {
        let mut course = Course::new(world.surface, 0, 100.0, |_| ());
        let mut store = Store::default();
        let mut selection = Selection::default();
        let frames = (24.0 / speed * 90.0_f64).max(1800.0) as usize;
        let (mut made, mut waiting) = (Vec::new(), Vec::new());
        for frame in 0..frames {
            let depth = 20.0 + speed * frame as f64 / 90.0;
            let standpoint = course.at(&FlightPose { depth, height: 2.0, ..FlightPose::default() });
            let level = standpoint.place.level();
            let (root, head) = standpoint.place.lift(standpoint.position, level, level - LAG - 2);
            store.pace.begin_frame((frame > 0).then_some(f64::INFINITY));
            store.made = 0;
            let view = View {
                root: &root.block,
                head,
                levels: LAG + 2 + DOWN,
                live_from: 3,
                prefetch_from: 3,
                detail: Detail::new(2.6),
                frusta: None,
            };
            selection.select(&world.surface, &view, &mut store);
            if frame > 0 {
                // Straight down.
                store.pace.set_foreseen(FORESEEN / (std::f64::consts::LN_2 * speed / 90.0));
                let by = DVec3::NEG_Y * (FORESEEN * standpoint.height / f64::from(1 << (LAG + 2)));
                selection.foresee(&world.surface, &view, by, &mut store);
            }
            made.push(store.made);
            waiting.push(selection.counts.waiting);
        }
        let mut steady = made[2 * frames / 3..].to_vec();
        steady.sort_unstable();
        let (median, most) = (steady[steady.len() / 2], steady[steady.len() - 1]);
        let mut waits = waiting[2 * frames / 3..].to_vec();
        waits.sort_unstable();
        let (wait, longest) = (waits[waits.len() / 2], waits[waits.len() - 1]);
        println!("{speed} octaves/s: {median} tiles a frame, {most} at most; {wait} wait, {longest} at most");
        assert!(
            most as f64 <= (1.25 * median as f64).max(median as f64 + 1.0),
            "{median} a frame, {most} in one"
        );
        assert!(longest < 100, "{longest} tiles are waited for");
    }
}

/// Tiles per frame over many frames in which `new` are wanted and `baked` are baked: all that are made, and those that
/// wait for it.
fn paced(frames: usize, new: impl Fn(usize) -> usize, baked: impl Fn(usize) -> usize) -> Vec<[usize; 2]> {
    let (mut pace, mut waiting) = (Pace::default(), 0);
    let frame = |frame| {
        pace.begin_frame(Some(f64::INFINITY));
        let baked = baked(frame);
        (0..baked).for_each(|_| pace.bake());
        let missing = waiting + new(frame);
        let made = (0..missing).filter(|_| pace.ask(false)).count();
        waiting = missing - made;
        [made + baked, waiting]
    };
    (0..frames).map(frame).collect()
}

#[test]
fn what_is_baked_is_made_instead_of_others_not_besides() {
    // Bursts of 24 new tiles every four frames, and bakes that pause as often as they go on.
    let made = paced(3000, |frame| if frame % 4 == 0 { 24 } else { 0 }, |frame| 2 * (frame / 20 % 2));
    let mut made: Vec<usize> = made[1500..].iter().map(|[made, _]| *made).collect();
    made.sort_unstable();
    assert_eq!(made[made.len() / 2], 7);
    assert!(*made.last().unwrap() <= 8, "{} in the busiest frame", made.last().unwrap());
}

#[test]
fn many_bakes_starve_nothing() {
    // A climb bakes much: it begins at frame 1000, all at once.
    let made = paced(1600, |_| 5, |frame| if frame < 1000 { 0 } else { 20 });
    let longest = |frames: &[[usize; 2]]| frames.iter().map(|[_, waiting]| *waiting).max().unwrap();
    let [before, after] = [longest(&made[950..1000]), longest(&made[1000..])];
    assert!(after < before + 60, "{before} wait, and {after} where much is baked");
    let [_, left] = made[1599];
    assert!(left < 60, "{left} wait in the end");
}
