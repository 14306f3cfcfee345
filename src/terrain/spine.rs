//! The path from the root of a world to the viewer, with the block of 3×3 tiles around it at each level.
//!
//! The digits are the only thing that grows with depth: one byte per level, and one block in every
//! [`CHECKPOINT_EVERY`] levels. Any other block is recomputed from the checkpoint above it.

use super::block::{Block, Digit};
use super::surface::Surface;

/// Levels between two checkpoints.
pub const CHECKPOINT_EVERY: usize = 128;

/// Levels near the bottom whose blocks are always at hand (unless the root is nearer).
const TAIL: usize = 40;

/// A block of the path, with how it lies to the one above.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// The block.
    pub block: Block,
    /// Which child of the block above it is; (0, 0) at the root.
    pub digit: Digit,
    /// How much the corner of its plane lies above the corner of the plane above (1/65 536 of this level's
    /// spacing).
    pub climb: i64,
}

/// The path, from level 0 to [`Spine::level`].
#[derive(Clone, Debug)]
pub struct Spine {
    surface: Surface,
    /// `digits[i]` leads from level i to level i + 1.
    digits: Vec<PackedDigit>,
    /// `checkpoints[k]` is of level k·[`CHECKPOINT_EVERY`].
    checkpoints: Vec<Step>,
    /// Steps of the levels from `tail_start`, a checkpoint, to the bottom.
    tail: Vec<Step>,
    tail_start: usize,
    /// Digits that a way sideways has taken off and not yet put on again; empty in between.
    changed: Vec<Digit>,
}

/// Both axes of a digit, two bits each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct PackedDigit(u8);

impl PackedDigit {
    fn pack([dx, dz]: Digit) -> PackedDigit {
        PackedDigit((dx + 1) as u8 | ((dz + 1) as u8) << 2)
    }

    fn unpack(self) -> Digit {
        [(self.0 & 3) as i8 - 1, (self.0 >> 2) as i8 - 1]
    }
}

impl Spine {
    /// The path of no digits: the root tile at (x, z).
    pub fn new(surface: Surface, x: u32, z: u32) -> Spine {
        let root = Step { block: Block::root(x, z), digit: [0, 0], climb: 0 };
        Spine {
            surface,
            digits: Vec::new(),
            checkpoints: vec![root],
            tail: vec![root],
            tail_start: 0,
            changed: Vec::new(),
        }
    }

    /// The surface that the path is on.
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    /// Level of the bottom block, counted from the root.
    pub fn level(&self) -> usize {
        self.digits.len()
    }

    /// The bottom block and how it lies to the one above.
    pub fn bottom(&self) -> &Step {
        // The tail always holds the bottom level.
        &self.tail[self.tail.len() - 1]
    }

    /// The step of a level, 0..=[`Spine::level`]. At most [`CHECKPOINT_EVERY`] blocks are recomputed.
    pub fn step_at(&self, level: usize) -> Step {
        if level >= self.tail_start {
            return self.tail[level - self.tail_start];
        }
        let checkpoint = level / CHECKPOINT_EVERY;
        (checkpoint * CHECKPOINT_EVERY..level)
            .fold(self.checkpoints[checkpoint], |step, i| self.descend(&step.block, self.digits[i].unpack()))
    }

    /// The digit that leads from `level` to `level + 1`.
    pub fn digit(&self, level: usize) -> Digit {
        self.digits[level].unpack()
    }

    /// One level deeper, into the child `digit` (each axis −1..=2) of the bottom tile.
    pub fn push(&mut self, digit: Digit) {
        let step = self.descend(&self.bottom().block, digit);
        self.digits.push(PackedDigit::pack(digit));
        self.tail.push(step);
        if self.level().is_multiple_of(CHECKPOINT_EVERY) {
            self.checkpoints.push(step);
            // Keep the tail short: begin it at the checkpoint before.
            let start = self.level() - CHECKPOINT_EVERY;
            self.tail.drain(..start - self.tail_start);
            self.tail_start = start;
        }
    }

    /// One level out. False at the root, where there is no further out.
    pub fn pop(&mut self) -> bool {
        if self.digits.pop().is_none() {
            return false;
        }
        self.tail.pop();
        self.checkpoints.truncate(self.level() / CHECKPOINT_EVERY + 1);
        if self.level() < self.tail_start + TAIL && self.tail_start > 0 {
            self.refill();
        }
        true
    }

    /// Puts the blocks of one more checkpoint interval before the tail.
    fn refill(&mut self) {
        let start = self.tail_start - CHECKPOINT_EVERY;
        let had = self.tail.len();
        let mut step = self.checkpoints[start / CHECKPOINT_EVERY];
        for level in start..self.tail_start {
            self.tail.push(step);
            step = self.descend(&step.block, self.digits[level].unpack());
        }
        self.tail.rotate_left(had);
        self.tail_start = start;
    }

    /// One tile sideways at the bottom level: each axis −1, 0 or 1.
    ///
    /// A digit that leaves −1..=2 is renormalised, which carries one level up: amortised constant work.
    pub fn walk(&mut self, dx: i32, dz: i32) {
        debug_assert!(dx.abs() <= 1 && dz.abs() <= 1);
        let mut carry = [dx as i8, dz as i8];
        let mut level = self.level();
        while carry != [0, 0] && level > 0 {
            level -= 1;
            let mut digit = self.digits[level].unpack();
            for axis in 0..2 {
                digit[axis] += carry[axis];
                // 2p + 3 = 2(p + 1) + 1 and 2p − 2 = 2(p − 1) + 0.
                (digit[axis], carry[axis]) = match digit[axis] {
                    3 => (1, 1),
                    -2 => (0, -1),
                    d => (d, 0),
                };
            }
            self.changed.push(digit);
        }
        let root = self.checkpoints[0].block.corner.moved(i32::from(carry[0]), i32::from(carry[1]));
        while self.level() > level {
            self.pop();
        }
        if carry != [0, 0] {
            let changed = std::mem::take(&mut self.changed);
            *self = Spine { changed, ..Spine::new(self.surface, root.x, root.z) };
        }
        while let Some(digit) = self.changed.pop() {
            self.push(digit);
        }
    }

    /// Any number of tiles sideways at the bottom level. Returns how much the corner of the new bottom's plane lies
    /// above that of the old one's (1/65 536 of the bottom's spacing).
    ///
    /// Digits that change become 0 or 1. So on a path of such digits the result is the same in one jump or in many,
    /// whatever lay between, and the work is a few levels: as many as the distance has bits, and the carry.
    pub fn jump(&mut self, tiles: [i64; 2]) -> i64 {
        let mut carry = tiles;
        // Heights are counted mod 2⁶⁴: the corners lie near each other, however far up their paths part.
        let (mut old, mut new) = (0i64, 0i64);
        let mut weight = 1i64;
        while carry != [0, 0] && self.level() > 0 {
            let Step { mut digit, climb, .. } = *self.bottom();
            for axis in 0..2 {
                let sum = i64::from(digit[axis]) + carry[axis];
                digit[axis] = sum.rem_euclid(2) as i8;
                carry[axis] = sum.div_euclid(2);
            }
            old = old.wrapping_add(climb.wrapping_mul(weight));
            weight = weight.wrapping_shl(1);
            self.changed.push(digit);
            self.pop();
        }
        if carry != [0, 0] {
            // The root's level is a plain: nothing rises on it.
            let root = self.bottom().block.corner.moved(carry[0] as i32, carry[1] as i32);
            let changed = std::mem::take(&mut self.changed);
            *self = Spine { changed, ..Spine::new(self.surface, root.x, root.z) };
        }
        while let Some(digit) = self.changed.pop() {
            self.push(digit);
            new = new.wrapping_mul(2).wrapping_add(self.bottom().climb);
        }
        new.wrapping_sub(old)
    }

    /// Gives back the memory that the path has no use for at its present length.
    pub fn shrink_to_fit(&mut self) {
        self.digits.shrink_to_fit();
        self.checkpoints.shrink_to_fit();
    }

    /// The path without redundancy: the root tile's coordinates and the quadrant (each axis 0 or 1) chosen at
    /// each level. Two spines at the same tile have the same canonical path.
    pub fn canonical(&self) -> ([u32; 2], Vec<[u8; 2]>) {
        let mut carry = [0i8; 2];
        let mut path: Vec<[u8; 2]> = Vec::with_capacity(self.level());
        for digit in self.digits.iter().rev() {
            let digit = digit.unpack();
            let mut quadrant = [0u8; 2];
            for axis in 0..2 {
                let d = digit[axis] + carry[axis];
                quadrant[axis] = d.rem_euclid(2) as u8;
                carry[axis] = d.div_euclid(2);
            }
            path.push(quadrant);
        }
        path.reverse();
        let root = self.checkpoints[0].block.corner.moved(i32::from(carry[0]), i32::from(carry[1]));
        ([root.x, root.z], path)
    }

    /// Bytes held for the path, not counting the constant part near the bottom.
    pub fn path_bytes(&self) -> usize {
        self.digits.capacity() * size_of::<PackedDigit>() + self.checkpoints.capacity() * size_of::<Step>()
    }

    /// The step that a digit leads to from a block.
    pub(super) fn descend(&self, block: &Block, digit: Digit) -> Step {
        let (child, rise) = block.child(&self.surface, digit);
        let [dx, dz] = digit.map(i64::from);
        Step { block: child, digit, climb: block.plane.rise(dx, dz) + rise }
    }
}
