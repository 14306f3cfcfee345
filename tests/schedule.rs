//! However the viewer moves, what is seen of the backdrop stays within its parallax bound and live tiles within their
//! pool, and no frame bakes much more than another: where that cannot be, the viewer is slowed down.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use fathomless::terrain::Place;
use fathomless::terrain::backdrop::{Ladder, ROOT_UP};
use fathomless::terrain::place::{Dive, START_LEVEL};
use fathomless::terrain::schedule::{MOST_EXTRA, SUDDEN, Schedule, Want};
use fathomless::world::World;
use glam::DVec3;
use proptest::collection;
use proptest::prelude::*;

const LAG: usize = 8;
const LAYERS: usize = 24;
/// Tiles of its key that a viewer may be from where a layer was baked: the least that there is.
const BOUND: f64 = 4.0;
/// Texels of a layer, and the most that a frame may bake: in the ratio of the viewer's.
const LAYER_TEXELS: f64 = 2.4;
const MOST_TEXELS: f64 = 1.0;
const FPS: f64 = 90.0;
/// Frames until tiles asked for ahead are there.
const FETCHED: usize = 10;

/// A viewer two cells from the ground, at any depth and on the move.
struct Walker {
    place: Place,
    depth: f64,
}

impl Walker {
    fn new(depth: usize) -> Walker {
        let surface = World::load("canyonlands").unwrap().surface;
        let mut walker = Walker {
            place: Dive::new(surface, START_LEVEL + depth, |_| ()).place(START_LEVEL + depth),
            depth: depth as f64,
        };
        walker.place.position.y = walker.stand();
        walker
    }

    /// A move of a frame, or a part of it: octaves, and cells of the depth.
    fn go(&mut self, fall: f64, aside: [f64; 2], frames: f64) {
        let unit = self.unit();
        self.place.walk(DVec3::new(aside[0], 0.0, aside[1]) * unit);
        self.depth += fall;
        let level = START_LEVEL + self.depth.floor() as usize;
        while self.place.level() < level {
            self.place.deeper();
        }
        while self.place.level() > level {
            self.place.shallower();
        }
        // Not down a cliff at once.
        self.place.position.y += (self.stand() - self.place.position.y) * (0.1 * frames);
    }

    fn unit(&self) -> f64 {
        (-self.depth.rem_euclid(1.0)).exp2()
    }

    /// The height to be at.
    fn stand(&self) -> f64 {
        let DVec3 { x, z, .. } = self.place.position;
        // Not where a steep slope is nearer sideways than downwards.
        let around = [[0.0, 0.0], [0.8, 0.0], [-0.8, 0.0], [0.0, 0.8], [0.0, -0.8]];
        let unit = self.unit();
        let highest = around.map(|[i, k]| self.place.ground(x + i * unit, z + k * unit));
        highest.into_iter().fold(f64::MIN, f64::max) + 2.0 * unit
    }
}

/// The backdrop without pixels: its layers, and what is left of the one being baked.
#[derive(Default)]
struct Baker {
    schedule: Schedule,
    ladder: Ladder,
    left: f64,
}

/// The worst that was seen of a flight.
#[derive(Debug, Default)]
struct Seen {
    /// Share of the bound used up.
    parallax: f64,
    /// Levels of live tiles beyond the usual.
    extra: usize,
    /// Texels of each frame.
    baked: Vec<f64>,
    /// The mean share of its speed that the viewer had.
    speed: f64,
}

impl Baker {
    fn begin(&mut self, walker: &Walker, exact: bool) {
        let nearest = walker.place.level().saturating_sub(LAG);
        let farthest = (nearest + 1).saturating_sub(LAYERS).max(ROOT_UP);
        let want =
            Want { nearest, farthest, least: ROOT_UP, lag: LAG, bound: BOUND, exact, depth: walker.depth };
        self.ladder.climb(&walker.place, walker.place.position, LAYERS + LAG + 2 * MOST_EXTRA);
        self.schedule.begin_frame(&self.ladder, &want);
    }

    /// Bakes what is due; how much that was. None: nothing is left.
    fn bake(&mut self, most: f64) -> Option<f64> {
        let (_, new) = self.schedule.next(&self.ladder)?;
        if new {
            self.left = LAYER_TEXELS;
        }
        let baked = self.schedule.quota(self.left, most).min(self.left);
        self.left -= baked;
        if self.left <= 1e-9 {
            self.left = 0.0;
            self.schedule.finish(LAYER_TEXELS, &self.ladder);
        }
        Some(baked)
    }

    /// Flies so many frames with what `motion` says of each: octaves and cells per second. Where he is slowed down, the
    /// motion takes so much longer.
    fn fly(&mut self, walker: &mut Walker, frames: usize, motion: impl Fn(f64) -> (f64, [f64; 2])) -> Seen {
        for exact in [true, false] {
            self.begin(walker, exact);
            while self.bake(f64::INFINITY).is_some() {}
        }
        let (mut at, mut room, mut waited, mut at_hand) = (0.0, 1.0, 0, None);
        let mut seen = Seen::default();
        while at < frames as f64 {
            let (fall, aside) = motion(at / FPS);
            walker.go(fall * room / FPS, aside.map(|v| v * room / FPS), room);
            self.begin(walker, false);
            assert!(!self.schedule.is_lost(), "lost at {}", walker.depth);
            let nearest = self.schedule.nearest().expect("a backdrop");
            seen.parallax = seen.parallax.max(self.schedule.used().expect("one that can be shown"));
            seen.extra = seen.extra.max((walker.place.level() - LAG).saturating_sub(nearest));
            // Tiles that are to be at hand are so some frames later; those within them are already.
            let asked = self.schedule.prefetch_from();
            let there =
                |have: Option<usize>| asked.is_some_and(|asked| have.is_some_and(|have| have <= asked));
            waited = if asked.is_none() || there(at_hand) { 0 } else { waited + 1 };
            if asked.is_none() || waited >= FETCHED {
                at_hand = asked;
            }
            self.schedule.set_at_hand(at_hand.filter(|_| there(at_hand)));
            let baked = self.bake(MOST_TEXELS).unwrap_or(0.0);
            assert!(baked <= MOST_TEXELS);
            seen.baked.push(baked);
            room = self.schedule.headroom(self.left, MOST_TEXELS);
            at += room;
            assert!(seen.baked.len() < 20 * frames, "he stands still at {}", walker.depth);
        }
        seen.speed = frames as f64 / seen.baked.len() as f64;
        seen
    }
}

/// 0 to 1 and back to 0 in `seconds`, with a second's rise and fall.
fn ramp(t: f64, seconds: f64) -> f64 {
    let smooth = |u: f64| u * u * (3.0 - 2.0 * u);
    smooth(t.clamp(0.0, 1.0)) * smooth((seconds - t).clamp(0.0, 1.0))
}

#[test]
fn a_dive_bakes_evenly_and_a_climb_in_time() {
    for speed in [0.5, 1.5, 2.5] {
        let mut walker = Walker::new(30);
        let mut baker = Baker::default();
        let frames = (60.0 / speed * FPS) as usize;
        let dive = baker.fly(&mut walker, frames, |t| (speed * ramp(t, 60.0 / speed), [0.0; 2]));
        let climb = baker.fly(&mut walker, frames, |t| (-speed * ramp(t, 60.0 / speed), [0.0; 2]));
        for (name, seen) in [("dive", &dive), ("climb", &climb)] {
            let Seen { parallax, extra, speed: share, .. } = seen;
            println!(
                "{name} at {speed} octaves/s: {parallax:.3} of the bound, {extra} levels more, {share:.3} of the speed"
            );
            assert!(*parallax <= 1.0 && *extra <= MOST_EXTRA);
        }
        assert!(dive.speed > 0.999, "nothing holds a dive up");
        assert!(climb.speed > 0.6, "a climb has {} of its speed", climb.speed);
        let mut steady: Vec<f64> = dive.baked[frames / 4..3 * frames / 4].to_vec();
        steady.retain(|&texels| texels > 0.0);
        steady.sort_by(f64::total_cmp);
        let (median, most) = (steady[steady.len() / 2], steady[steady.len() - 1]);
        assert!(most <= 1.25 * median, "at {speed} octaves/s a frame bakes {median} texels, and one {most}");
    }
}

#[test]
fn sideways_at_leisure_is_never_held_up() {
    let mut walker = Walker::new(30);
    for speed in [0.3, 1.0, 2.0, 4.0] {
        let seen = Baker::default().fly(&mut walker, 3600, |_| (0.0, [0.8 * speed, 0.6 * speed]));
        let Seen { parallax, extra, speed: share, .. } = &seen;
        println!("{speed} cells/s: {parallax:.3} of the bound, {extra} levels more, {share:.3} of the speed");
        assert!(*parallax <= 1.0 && *extra <= MOST_EXTRA);
        assert!(*share > if speed > 2.0 { 0.3 } else { 0.9 });
    }
}

#[test]
fn sideways_too_fast_is_slowed_down_and_not_seen() {
    for speed in [8.0, 16.0] {
        let mut walker = Walker::new(30);
        let seen = Baker::default().fly(&mut walker, 900, |t| (0.0, [speed * ramp(t, 10.0), 0.0]));
        let Seen { parallax, extra, speed: share, .. } = &seen;
        println!("{speed} cells/s: {parallax:.3} of the bound, {extra} levels more, {share:.3} of the speed");
        assert!(*parallax <= 1.0 / SUDDEN && *extra <= MOST_EXTRA);
        assert!((0.02..0.7).contains(share), "he has {share} of his speed");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(32) })]

    #[test]
    fn wherever_he_goes(legs in collection::vec((-3.0..3.0f64, [-4.0..4.0f64, -4.0..4.0f64], 2.0..6.0f64), 3..9)) {
        let mut walker = Walker::new(40);
        let seconds: f64 = legs.iter().map(|leg| leg.2).sum();
        let seen = Baker::default().fly(&mut walker, (seconds * FPS) as usize, |t| {
            let mut begun = 0.0;
            for &(fall, aside, lasts) in &legs {
                if t < begun + lasts {
                    let share = ramp(t - begun, lasts);
                    return (fall * share, aside.map(|v| v * share));
                }
                begun += lasts;
            }
            (0.0, [0.0; 2])
        });
        let Seen { parallax, extra, speed, .. } = &seen;
        println!("{parallax:.3} of the bound, {extra} levels more, {speed:.3} of the speed");
        // Sudden turns next to a cliff: what `Quality` leaves between this bound and the pixels it stands for.
        prop_assert!(*parallax <= 1.0 / SUDDEN, "{parallax} of the bound");
        prop_assert!(*extra <= MOST_EXTRA);
    }
}
