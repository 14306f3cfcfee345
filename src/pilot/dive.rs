//! The way down to a point of the ground, and back up: a straight fall, once it is steep enough.

use crate::terrain::block::Digit;
use crate::terrain::{Patch, Place, Surface};
use glam::{DQuat, DVec3};

/// The way ends this much off the ground's upright (radians): the ground is then as near as nine tenths of the way to
/// the target, and still ahead rather than below.
const REST: f64 = 0.5;

/// Radians by which the way turns towards that in an octave.
const TURN_PER_OCTAVE: f64 = 0.35;

/// How hard the viewer is turned back to the way: sideways speed over speed ahead, per radian off.
const HOLD: f64 = 2.0;

/// A viewer steeper over the target than this (radians off upright), and yet so many times as far from it as from the
/// ground, has come to other ground first.
const STEEP: f64 = 1.0;
const BLOCKED: f64 = 12.0;

/// Levels below the anchor from which on the target is steered: less than can be seen, and to which: as far as `f64`
/// keeps it.
const STEER_FROM: usize = 13;
const STEER_TO: usize = 44;

/// Beyond so many tiles a target is forgotten.
const FARTHEST: f64 = (1u64 << 36) as f64;

/// A target and how the viewer came to it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dive {
    /// From the viewer to the target, in anchor tiles.
    pub(super) way: DVec3,
    /// Levels below the anchor to which the target is steered.
    resolved: usize,
    /// The direction from the target to where the viewer was when the dive began, a unit vector.
    from: DVec3,
    /// The octave of his distance then: the level of tiles as large.
    began: f64,
    /// Octaves flown since.
    pub(super) flown: f64,
}

impl Dive {
    /// Towards a point of the ground, a `way` from the viewer.
    pub(super) fn new(place: &Place, way: DVec3) -> Dive {
        let from = -way.normalize();
        let mut dive = Dive { way, resolved: 0, from, began: 0.0, flown: 0.0 };
        dive.began = dive.octave(place);
        dive.settle(place);
        dive
    }

    /// How deep the viewer is over the target.
    fn octave(&self, place: &Place) -> f64 {
        place.level() as f64 - self.way.length().log2()
    }

    /// Octaves to where the dive began; below 0 beyond that.
    pub(super) fn left(&self, place: &Place) -> f64 {
        self.octave(place) - self.began
    }

    /// True on the way back of this dive.
    pub(super) fn leads_back(&self, place: &Place, nearest: f64) -> bool {
        self.left(place) > 0.0 && self.way.length() < BLOCKED * nearest
    }

    /// It can be told where the target is.
    pub(super) fn is_near(&self) -> bool {
        self.way.length() < FARTHEST
    }

    /// The same with the anchor so many levels deeper.
    pub(super) fn seen_from(mut self, deeper: i32) -> Dive {
        self.anchor_moved(deeper);
        self
    }

    /// The viewer has moved.
    pub(super) fn moved(&mut self, shift: DVec3) {
        self.way -= shift;
    }

    /// The anchor is levels deeper, or shallower below 0.
    pub(super) fn anchor_moved(&mut self, levels: i32) {
        self.way *= f64::from(levels).exp2();
        self.resolved = self.resolved.saturating_add_signed(-levels as isize);
    }

    /// Keeps the target on the ground, and steers it to gentle ground where nobody sees it. False if it is out of
    /// sight.
    pub(super) fn settle(&mut self, place: &Place) -> bool {
        if !self.is_near() {
            return false;
        }
        let target = place.position + self.way;
        let mut at = [target.x, target.z];
        if self.resolved <= STEER_FROM {
            at = steered(place, at);
            self.resolved = STEER_TO;
        }
        let [x, z] = at;
        let y = ground_at(place, at);
        self.way = DVec3::new(x, y, z) - place.position;
        true
    }

    /// The direction to fall in, and how much faster than straight at the target.
    pub(super) fn course_in(&self, up: DVec3) -> (DVec3, f64) {
        let turned = TURN_PER_OCTAVE * self.flown;
        self.course(self.towards_upright(up, turned), -1.0)
    }

    /// The same for the way back.
    pub(super) fn course_out(&self, place: &Place, up: DVec3) -> (DVec3, f64) {
        let turned = TURN_PER_OCTAVE * self.left(place).max(0.0);
        self.course(self.towards_upright(up, turned), 1.0)
    }

    fn course(&self, wanted: DVec3, out: f64) -> (DVec3, f64) {
        let here = -self.way.normalize();
        let off = here.angle_between(wanted);
        let aside = wanted.reject_from_normalized(here).try_normalize().unwrap_or_default();
        let course = here * out + aside * (HOLD * off).min(1.0);
        (course.normalize(), course.length())
    }

    /// Where the dive came from, turned towards upright by so much, and not beyond [`REST`].
    fn towards_upright(&self, up: DVec3, turned: f64) -> DVec3 {
        let slant = self.from.angle_between(up);
        let turned = turned.min(slant - REST).max(0.0);
        match self.from.cross(up).try_normalize() {
            Some(axis) => DQuat::from_axis_angle(axis, turned) * self.from,
            None => self.from,
        }
    }

    /// True if other ground is in the way.
    pub(super) fn is_blocked(&self, up: DVec3, nearest: f64) -> bool {
        (-self.way).angle_between(up) < STEEP && self.way.length() > BLOCKED * nearest
    }
}

/// The tile that holds (x, z), so far below the block that is wide enough, with the point in it.
struct Cell {
    patch: Patch,
    at: [f64; 2],
    /// Height of the corner of the patch's plane, in anchor tiles from the anchor's.
    height: f64,
    /// Its size in anchor tiles.
    unit: f64,
}

impl Cell {
    fn over(place: &Place, [x, z]: [f64; 2]) -> Cell {
        let mut up = 0;
        loop {
            let (step, at) = place.seen_from_above(DVec3::new(x, 0.0, z), up);
            let covered = |v: f64| (-1.0..2.0).contains(&v);
            if (covered(at.x) && covered(at.z)) || up >= place.level() {
                let (i, k) = (at.x.floor().clamp(-1.0, 1.0), at.z.floor().clamp(-1.0, 1.0));
                let (patch, rise) = step.block.patch(i as i32, k as i32);
                let unit = (up as f64).exp2();
                let height = (rise as f64 / 65_536.0 - at.y) * unit;
                return Cell { patch, at: [at.x - i, at.z - k], height, unit };
            }
            up += 1;
        }
    }

    fn descend(&mut self, surface: &Surface, [qx, qz]: Digit) {
        let (child, rise) = self.patch.children(surface)[(2 * qz + qx) as usize];
        self.unit *= 0.5;
        self.height +=
            (self.patch.plane.rise(i64::from(qx), i64::from(qz)) + rise) as f64 / 65_536.0 * self.unit;
        self.at = [2.0 * self.at[0] - f64::from(qx), 2.0 * self.at[1] - f64::from(qz)];
        self.patch = child;
    }

    /// The child that the point is in.
    fn child(&self) -> Digit {
        self.at.map(|v| i8::from(v >= 0.5))
    }
}

/// [`Place::ground`] under any point, however far from the anchor.
pub(super) fn ground_at(place: &Place, at: [f64; 2]) -> f64 {
    let surface = place.spine.surface();
    let mut cell = Cell::over(place, at);
    while cell.unit > GROUND_UNIT {
        cell.descend(surface, cell.child());
    }
    let [gx, gz] = cell.patch.plane.slope();
    cell.height + (gx * cell.at[0] + gz * cell.at[1]) * cell.unit
}

/// The ground under a point is followed to tiles of this share of an anchor tile.
const GROUND_UNIT: f64 = 1.0 / (1u64 << 22) as f64;

/// A point within the tile [`STEER_FROM`] levels below the anchor that holds (x, z), of ground that is gentle at every
/// level below that: as a steered dive goes on from there.
fn steered(place: &Place, at: [f64; 2]) -> [f64; 2] {
    let surface = place.spine.surface();
    let mut cell = Cell::over(place, at);
    while cell.unit > (-(STEER_FROM as f64)).exp2() {
        cell.descend(surface, cell.child());
    }
    let corner = [at[0] - cell.at[0] * cell.unit, at[1] - cell.at[1] * cell.unit];
    // Where the middle of the last tile is in the first.
    let (mut inside, mut unit) = ([0.5, 0.5], 1.0);
    let whole = cell.unit;
    while cell.unit > (-(STEER_TO as f64)).exp2() {
        let digit = gentlest(surface, &cell.patch);
        cell.descend(surface, digit);
        unit *= 0.5;
        inside = [0, 1].map(|axis| inside[axis] + (f64::from(digit[axis]) - 0.5) * unit);
    }
    [corner[0] + inside[0] * whole, corner[1] + inside[1] * whole]
}

/// The gentlest child of a tile.
fn gentlest(surface: &Surface, patch: &Patch) -> Digit {
    let children = patch.children(surface);
    let steepness = |q: usize| {
        let plane = &children[q].0.plane;
        i128::from(plane.gx).pow(2) + i128::from(plane.gz).pow(2)
    };
    let best = (1..4).fold(0, |best, q| if steepness(q) < steepness(best) { q } else { best });
    [(best & 1) as i8, (best >> 1) as i8]
}
