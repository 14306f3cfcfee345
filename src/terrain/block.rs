//! The 3×3 tiles around the viewer at one level: 6×6 lattice points over one plane.
//!
//! Blocks map to blocks under subdivision just as patches do, so the viewer's neighbours are at hand across
//! every border, however high up the tree that border is. The centre tile of the next block is any of the
//! children −1..=2 (per axis) of this centre: redundant digits.

use super::patch::{self, Patch};
use super::plane::Plane;
use super::surface::{Corner, Grid, Surface};

/// The grid of a block: 6×6 points from (−2, −2), counted from the centre tile's corner.
pub const GRID: Grid = Grid { size: 6, origin: [-2, -2] };

/// Which child of a centre tile is the next centre tile: each axis in −1..=2.
pub type Digit = [i8; 2];

/// 3×3 tiles; the residuals are counted from the plane over the centre tile's corners.
///
/// The plane is a function of the centre tile's heights alone, so a block is the same bits whichever way
/// the viewer came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// The centre tile: level and corner.
    pub corner: Corner,
    /// The plane through the centre tile's corners; coordinates count from its corner.
    pub plane: Plane,
    /// Residuals of the points (−2..=3)², rows of equal z.
    pub r: [i32; 36],
}

impl Block {
    /// A block of the level where a world begins: an endless plain at height 0.
    pub fn root(x: u32, z: u32) -> Block {
        Block::plain(Corner { level: 0, x, z })
    }

    /// Nine tiles of a plain at height 0.
    pub fn plain(corner: Corner) -> Block {
        Block { corner, plane: Plane::default(), r: [0; 36] }
    }

    /// The block around one of the children (each axis −1..=2) of the centre tile, with how much its plane's
    /// corner lies above this plane mapped to its level (1/65 536 of its spacing).
    pub fn child(&self, surface: &Surface, [dx, dz]: Digit) -> (Block, i64) {
        debug_assert!((-1..=2).contains(&dx) && (-1..=2).contains(&dz));
        let corner = self.corner.child(i32::from(dx), i32::from(dz));
        let plane = self.plane.child(i64::from(dx), i64::from(dz));
        let mut block = Block { corner, plane, r: [0; 36] };
        let shift = [i32::from(dx), i32::from(dz)];
        surface.subdivide((GRID, &self.r), (GRID, &mut block.r), shift, &plane, corner);
        let rise = block.absorb();
        (block, rise)
    }

    fn absorb(&mut self) -> i64 {
        let at = |x: i32, z: i32| self.residual(x, z);
        let [c, gx, gz] = self.plane.absorb([at(0, 0), at(1, 0), at(0, 1), at(1, 1)]);
        let (c, gx, gz) = (c as i32, gx as i32, gz as i32);
        for z in 0..6 {
            for x in 0..6 {
                self.r[6 * z + x] -= c + gx * (x as i32 - 2) + gz * (z as i32 - 2);
            }
        }
        i64::from(c)
    }

    /// The residual of a point, x and z in −2..=3.
    pub fn residual(&self, x: i32, z: i32) -> i32 {
        self.r[((z + 2) * 6 + x + 2) as usize]
    }

    /// Total height of a point mod 2³², x and z in −2..=3.
    pub fn height(&self, x: i32, z: i32) -> u32 {
        self.plane.at(i64::from(x), i64::from(z)).wrapping_add(self.residual(x, z) as u32)
    }

    /// Height of a point above the plane's corner, in 1/65 536 spacing, x and z in −2..=3.
    pub fn rise(&self, x: i32, z: i32) -> i64 {
        self.plane.rise(i64::from(x), i64::from(z)) + i64::from(self.residual(x, z))
    }

    /// How much the plane's corner of `to`, another block of the same level that shares the point (x, z) of
    /// this one, lies above this one's (1/65 536 spacing). (dx, dz) is where `to`'s centre is from here.
    pub fn rise_to(&self, to: &Block, [dx, dz]: [i32; 2]) -> i64 {
        // Any shared point will do: its total height is the same number in both.
        let (x, z) = (dx.clamp(-2, 3), dz.clamp(-2, 3));
        self.rise(x, z) - to.rise(x - dx, z - dz)
    }

    /// The patch of one of the nine tiles (each axis −1..=1), over a plane of its own, with how much its
    /// plane's corner lies above this one's (1/65 536 spacing).
    pub fn patch(&self, i: i32, j: i32) -> (Patch, i64) {
        let mut r = [0; 16];
        for z in 0..4 {
            let start = ((z + j + 1) * 6 + i + 1) as usize;
            r[4 * z as usize..4 * z as usize + 4].copy_from_slice(&self.r[start..start + 4]);
        }
        let mut patch =
            Patch { corner: self.corner.moved(i, j), plane: self.plane.moved(i64::from(i), i64::from(j)), r };
        let rise = self.plane.rise(i64::from(i), i64::from(j)) + patch.absorb();
        (patch, rise)
    }
}

// The patch's ring must lie in the block's.
const _: () = assert!(patch::GRID.origin[0] - 1 == GRID.origin[0] && GRID.size == patch::GRID.size + 2);
