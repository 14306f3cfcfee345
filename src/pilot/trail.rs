//! Where the viewer came from: crumbs on the way, for the eye, and the dives that lead back.

use super::dive::Dive;
use crate::terrain::Place;
use glam::DVec3;

/// Most crumbs that are kept; the oldest go first.
const MOST: usize = 64;

/// A crumb is dropped at each of these parts of an octave deeper, ...
const EVERY: f64 = 0.5;

/// ... and so many distances to the ground sideways.
const ASIDE: f64 = 6.0;

/// Beyond so many tiles a crumb is out of sight.
const FARTHEST: f64 = (1u64 << 40) as f64;

/// The way that a viewer came, from where it is nearest on: each crumb is less deep than the one before. On the way out
/// they are taken up again.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trail {
    /// The oldest first.
    crumbs: [Crumb; MOST],
    count: usize,
}

#[derive(Clone, Copy, Debug, Default)]
struct Crumb {
    /// From the viewer, in anchor tiles.
    way: DVec3,
    octave: f64,
}

impl Default for Trail {
    fn default() -> Trail {
        Trail { crumbs: [Crumb::default(); MOST], count: 0 }
    }
}

impl Trail {
    /// From the viewer to the crumbs, in anchor tiles: the last one first.
    pub(super) fn ways(&self) -> impl Iterator<Item = DVec3> {
        self.crumbs[..self.count].iter().rev().map(|crumb| crumb.way)
    }

    /// The viewer is so deep here, with the ground so many tiles away.
    pub(super) fn note(&mut self, octave: f64, nearest: f64) {
        while self.count > 0 && self.crumbs[self.count - 1].octave > octave {
            self.count -= 1;
        }
        let last = self.crumbs[..self.count].last();
        let due =
            last.is_none_or(|last| octave - last.octave >= EVERY || last.way.length() > ASIDE * nearest);
        if !due {
            return;
        }
        if self.count == MOST {
            self.crumbs.copy_within(1.., 0);
            self.count -= 1;
        }
        self.crumbs[self.count] = Crumb { way: DVec3::ZERO, octave };
        self.count += 1;
    }

    /// The viewer has moved.
    pub(super) fn moved(&mut self, shift: DVec3) {
        for crumb in &mut self.crumbs[..self.count] {
            crumb.way -= shift;
        }
    }

    /// The anchor is one level deeper (1) or shallower (−1).
    pub(super) fn anchor_moved(&mut self, levels: i32) {
        let scale = f64::from(levels).exp2();
        for crumb in &mut self.crumbs[..self.count] {
            crumb.way *= scale;
        }
        let gone = self.crumbs[..self.count].iter().take_while(|crumb| crumb.way.length() > FARTHEST).count();
        self.crumbs.copy_within(gone..self.count, 0);
        self.count -= gone;
    }
}

/// Most dives that are kept to lead back.
const MOST_DIVES: usize = 32;

/// A dive is found again while its target is nearer than so many octaves of tiles.
const FOUND_WITHIN: i32 = 36;

/// Dives one after the other, each from where the one before was left. However deep the last one leads, their targets are
/// known as far as `f64` keeps them: to 2⁻⁵² of the way there.
#[derive(Debug)]
pub(super) struct Dives {
    all: Vec<Left>,
}

/// A dive that was left.
#[derive(Clone, Copy, Debug)]
struct Left {
    dive: Dive,
    /// Its way counts in tiles of so many levels above the anchor.
    above: i32,
}

impl Default for Dives {
    fn default() -> Dives {
        Dives { all: Vec::with_capacity(MOST_DIVES) }
    }
}

impl Dives {
    /// Another one begins here.
    pub(super) fn leave(&mut self, dive: Dive) {
        if self.all.len() == MOST_DIVES {
            self.all.remove(0);
        }
        self.all.push(Left { dive, above: 0 });
    }

    /// The last one that was left, to go back along, where it can be found from here.
    pub(super) fn take_up(&mut self, place: &Place) -> Option<Dive> {
        while let Some(left) = self.all.last().copied() {
            if left.above > FOUND_WITHIN {
                return None;
            }
            let dive = left.dive.seen_from(left.above);
            let found = dive.is_near();
            if found && dive.left(place) <= 0.0 {
                // Farther out than it began.
                self.all.pop();
                continue;
            }
            return found.then(|| {
                self.all.pop();
                dive
            });
        }
        None
    }

    /// The viewer has moved.
    pub(super) fn moved(&mut self, shift: DVec3) {
        for left in &mut self.all {
            left.dive.moved(shift * f64::from(-left.above).exp2());
        }
    }

    /// The anchor is one level deeper (1) or shallower (−1).
    pub(super) fn anchor_moved(&mut self, levels: i32) {
        for left in &mut self.all {
            left.above += levels;
        }
    }
}
