//! Where the viewer is: the spine's bottom tile (the anchor) and a position relative to it.

use super::block::{Block, Digit};
use super::spine::{Spine, Step};
use super::surface::Surface;
use glam::DVec3;

/// The level where a flight starts: so many levels can also be backed out of.
pub const START_LEVEL: usize = 4096;

/// How far beyond the anchor tile's edges the viewer may be before the anchor follows, in tiles.
///
/// More than 0, so that hovering on a border does not make the anchor flip; at most 1/2, or going deeper
/// would need a digit outside −1..=2.
const SLACK: f64 = 0.25;

/// Positions are whole multiples of this: adding and subtracting them is exact.
const GRAIN: f64 = 1.0 / (1u64 << 40) as f64;

/// A move as [`Place::walk`] makes it: to the nearest 2⁻⁴⁰ of a tile.
pub fn on_grain(delta: DVec3) -> DVec3 {
    (delta / GRAIN).round() * GRAIN
}

/// Levels below the anchor that a target of a dive is resolved to.
pub const TARGET_LEVELS: usize = 52;

/// Where the target is in the tile that it is resolved to.
const TARGET_IN_TILE: DVec3 = DVec3::new(0.5, 0.0, 0.5);

/// A point near the surface: the anchor and a position in anchor tiles.
#[derive(Clone, Debug)]
pub struct Place {
    /// The path to the anchor, its bottom tile.
    pub spine: Spine,
    /// Counted from the corner of the anchor's plane, in tiles of the anchor's size; y is up.
    /// x and z within −0.25..=1.25 after [`Place::walk`].
    pub position: DVec3,
}

/// A point seen from the tile above `step`, seen from `step`'s tile.
fn deeper(p: DVec3, step: &Step) -> DVec3 {
    let [dx, dz] = step.digit.map(f64::from);
    DVec3::new(2.0 * p.x - dx, 2.0 * p.y - climb(step), 2.0 * p.z - dz)
}

/// A point seen from `step`'s tile, seen from the tile above.
fn shallower(p: DVec3, step: &Step) -> DVec3 {
    let [dx, dz] = step.digit.map(f64::from);
    DVec3::new(p.x + dx, p.y + climb(step), p.z + dz) * 0.5
}

/// How much the corner of a step's plane lies above the corner of the plane above it, in the step's tiles.
fn climb(step: &Step) -> f64 {
    step.climb as f64 / 65_536.0
}

impl Place {
    /// The middle of the root tile at (x, z).
    pub fn root(surface: Surface, x: u32, z: u32) -> Place {
        Place { spine: Spine::new(surface, x, z), position: DVec3::new(0.5, 1.0, 0.5) }
    }

    /// Level of the anchor, counted from the root.
    pub fn level(&self) -> usize {
        self.spine.level()
    }

    /// The anchor becomes the child tile below the viewer. Exact.
    pub fn deeper(&mut self) {
        let digit = |v: f64| (2.0 * v).floor().clamp(-1.0, 2.0) as i8;
        self.spine.push([digit(self.position.x), digit(self.position.z)]);
        self.position = deeper(self.position, self.spine.bottom());
    }

    /// The anchor becomes the tile above. Exact until 2⁻⁵² of a tile; false at the root.
    pub fn shallower(&mut self) -> bool {
        let step = *self.spine.bottom();
        if !self.spine.pop() {
            return false;
        }
        self.position = shallower(self.position, &step);
        true
    }

    /// Moves by `delta` tiles, to the nearest 2⁻⁴⁰ of a tile; the anchor follows sideways.
    ///
    /// Sums of moves are exact: a loop ends on the bits it began with.
    pub fn walk(&mut self, delta: DVec3) {
        self.position += on_grain(delta);
        loop {
            let side = |v: f64| match v {
                v if v < -SLACK => -1,
                v if v > 1.0 + SLACK => 1,
                _ => 0,
            };
            let (dx, dz) = (side(self.position.x), side(self.position.z));
            if (dx, dz) == (0, 0) {
                return;
            }
            let before = self.spine.bottom().block;
            self.spine.walk(dx, dz);
            let rise = before.rise_to(&self.spine.bottom().block, [dx, dz]);
            self.position -= DVec3::new(f64::from(dx), rise as f64 / 65_536.0, f64::from(dz));
        }
    }

    /// A position (in anchor tiles) seen from the path's tile `levels` above the anchor, or from the root, if that
    /// is nearer; with that tile's step.
    pub fn seen_from_above(&self, position: DVec3, levels: usize) -> (Step, DVec3) {
        self.lift(position, self.level(), self.level().saturating_sub(levels))
    }

    /// A position in tiles of the path's tile at level `from`, seen from its tile at level `to`, at most `from`;
    /// with that tile's step.
    pub fn lift(&self, mut position: DVec3, from: usize, to: usize) -> (Step, DVec3) {
        for level in (to + 1..=from).rev() {
            position = shallower(position, &self.spine.step_at(level));
        }
        (self.spine.step_at(to), position)
    }

    /// The way from `there`, in tiles of another place's anchor, to `here`, in tiles of this one's: in tiles of the level
    /// that comes with it. None where nothing but the root is above both, and they are far from each other on that.
    pub fn way_from(&self, here: DVec3, (other, there): (&Place, DVec3)) -> Option<(DVec3, usize)> {
        let mut level = self.level().min(other.level());
        let (mut ours, mut here) = self.lift(here, self.level(), level);
        let (mut theirs, mut there) = other.lift(there, other.level(), level);
        loop {
            let (a, b) = (theirs.block.corner, ours.block.corner);
            let (dx, dz) = (b.x.wrapping_sub(a.x) as i32, b.z.wrapping_sub(a.z) as i32);
            // So near that the two blocks share a point.
            if dx.abs() <= 5 && dz.abs() <= 5 {
                let rise = theirs.block.rise_to(&ours.block, [dx, dz]) as f64 / 65_536.0;
                return Some((here + DVec3::new(f64::from(dx), rise, f64::from(dz)) - there, level));
            }
            let above = level.checked_sub(1)?;
            (ours, here) = self.lift(here, level, above);
            (theirs, there) = other.lift(there, level, above);
            level = above;
        }
    }

    /// The nine tiles around the viewer's path at `level`, as they are on the plain of [`Surface::alone`] with the noise
    /// of level `octave`, 1 or more.
    pub fn alone(&self, octave: usize, level: usize) -> Block {
        let plain = |level| Block::plain(self.spine.step_at(level).block.corner);
        // Long after its noise a surface is a plane, however that may slope.
        if level < octave || level - octave > ALONE_LEVELS {
            return plain(level);
        }
        let surface = self.spine.surface().alone(octave as u32);
        (octave - 1..level)
            .fold(plain(octave - 1), |block, above| block.child(&surface, self.spine.digit(above)).0)
    }

    /// Height of the ground under (x, z) of the anchor tile (within −1..=2, in tiles) above the plane's corner, in
    /// tiles: exact to the last level that changes it by more than 2⁻²⁰ of a tile.
    pub fn ground(&self, x: f64, z: f64) -> f64 {
        let (i, j) = (x.floor().clamp(-1.0, 1.0), z.floor().clamp(-1.0, 1.0));
        let (mut patch, rise) = self.spine.bottom().block.patch(i as i32, j as i32);
        let (mut u, mut v) = (x - i, z - j);
        let mut height = rise as f64 / 65_536.0;
        let mut unit = 1.0;
        for _ in 0..GROUND_LEVELS {
            let (qx, qz) = ((u >= 0.5) as usize, (v >= 0.5) as usize);
            let (child, rise) = patch.children(self.spine.surface())[2 * qz + qx];
            unit *= 0.5;
            height += (patch.plane.rise(qx as i64, qz as i64) + rise) as f64 / 65_536.0 * unit;
            (u, v) = (2.0 * u - qx as f64, 2.0 * v - qz as f64);
            patch = child;
        }
        let [gx, gz] = patch.plane.slope();
        height + (gx * u + gz * v) * unit
    }
}

/// Levels below an octave down to which what it makes of a plain is followed.
const ALONE_LEVELS: usize = 40;

/// Levels below the anchor to which the ground under a point is followed.
const GROUND_LEVELS: usize = 20;

/// The child (each axis 0 or 1) of the bottom tile that a steered dive falls into: the gentlest.
///
/// Slope is a random walk over levels; this keeps it under about 1 for ever.
pub fn gentlest(spine: &Spine) -> Digit {
    let block = &spine.bottom().block;
    let mut best = ([0, 0], i128::MAX);
    for digit in [[0, 0], [1, 0], [0, 1], [1, 1]] {
        let (child, _) = block.child(spine.surface(), digit);
        let (gx, gz) = (i128::from(child.plane.gx), i128::from(child.plane.gz));
        let steepness = gx * gx + gz * gz;
        if steepness < best.1 {
            best = (digit, steepness);
        }
    }
    best.0
}

/// A steered path to a point of the surface: a pure function of surface, beginning and depth.
#[derive(Clone, Debug)]
pub struct Dive {
    spine: Spine,
}

impl Dive {
    /// Steers from the root (0, 0) down to `level`, and 52 levels further. `progress` hears of every
    /// 4 096th level.
    pub fn new(surface: Surface, level: usize, progress: impl FnMut(usize)) -> Dive {
        Dive::below(Spine::new(surface, 0, 0), level, progress)
    }

    /// The same from a tile of one's own, the bottom of `spine`, on.
    pub fn below(mut spine: Spine, level: usize, mut progress: impl FnMut(usize)) -> Dive {
        while spine.level() < level + TARGET_LEVELS {
            if spine.level().is_multiple_of(4096) {
                progress(spine.level());
            }
            spine.push(gentlest(&spine));
        }
        Dive { spine }
    }

    /// The deepest level that [`Dive::place`] takes.
    pub fn deepest(&self) -> usize {
        self.spine.level() - TARGET_LEVELS
    }

    /// The path's step at a level.
    pub fn step(&self, level: usize) -> Step {
        self.spine.step_at(level)
    }

    /// The target of the dive, a point of the surface, seen from the path's tile at `level`
    /// (at most [`Dive::deepest`]).
    pub fn place(&self, level: usize) -> Place {
        let mut place = Place { spine: self.spine.clone(), position: TARGET_IN_TILE };
        while place.level() > level + TARGET_LEVELS {
            place.spine.pop();
        }
        while place.level() > level {
            place.shallower();
        }
        place
    }

    /// The path, [`TARGET_LEVELS`] deeper than [`Dive::deepest`].
    pub fn into_spine(self) -> Spine {
        self.spine
    }
}

/// The target of a dive that goes on from a path's bottom tile by these digits, seen from that tile: the bits of
/// [`Dive::place`].
pub fn target(spine: &Spine, digits: [Digit; TARGET_LEVELS]) -> DVec3 {
    let mut steps = [*spine.bottom(); TARGET_LEVELS];
    let mut above = *spine.bottom();
    for (step, digit) in steps.iter_mut().zip(digits) {
        above = spine.descend(&above.block, digit);
        *step = above;
    }
    steps.iter().rev().fold(TARGET_IN_TILE, shallower)
}
