//! N×N cells of heights, from the tile's patch alone: the reference of `shaders/tile.wgsl`.
//!
//! A tile is n further subdivisions of its patch (N = 2ⁿ). Both the finest grid and the one before it are kept,
//! each with one ring: the finer is drawn near, the coarser is exactly the parent tile's samples, which far
//! vertices morph to.

use super::patch::{self, Patch};
use super::surface::{Corner, Grid, Surface};

/// Subdivisions in a tile: N = 2ⁿ cells per side. 2..=7.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cells(u32);

impl Cells {
    /// 32 cells per side.
    pub const N32: Cells = Cells(5);
    /// 64 cells per side.
    pub const N64: Cells = Cells(6);

    /// N cells per side: 4, 8, 16, 32, 64 or 128; None otherwise.
    pub fn new(n: u32) -> Option<Cells> {
        (n.is_power_of_two() && (4..=128).contains(&n)).then(|| Cells(n.trailing_zeros()))
    }

    /// 2ⁿ cells per side, n brought within 2..=7.
    pub fn of_steps(n: u32) -> Cells {
        Cells(n.clamp(2, 7))
    }

    /// N, cells per side.
    pub fn n(self) -> usize {
        1 << self.0
    }

    /// n, how often the patch is subdivided.
    pub fn steps(self) -> u32 {
        self.0
    }

    /// Points per side of the fine grid with its ring: N + 3.
    pub fn fine_side(self) -> usize {
        self.n() + 3
    }

    /// Points per side of the coarse grid with its ring: N/2 + 3.
    pub fn coarse_side(self) -> usize {
        self.n() / 2 + 3
    }
}

/// The heights of a tile.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tile {
    /// N.
    pub cells: Cells,
    /// (N+3)² residuals from point (−1, −1), in 1/65 536 of the fine spacing, over the patch's plane.
    pub fine: Vec<i32>,
    /// (N/2+3)² residuals from point (−1, −1), in 1/65 536 of the coarse spacing: the parent tile's samples.
    pub coarse: Vec<i32>,
}

impl Tile {
    /// Room for a tile; all zero.
    pub fn new(cells: Cells) -> Tile {
        let zeros = |side: usize| vec![0; side * side];
        Tile { cells, fine: zeros(cells.fine_side()), coarse: zeros(cells.coarse_side()) }
    }

    /// Makes the tile of a patch.
    pub fn of(surface: &Surface, patch: &Patch, cells: Cells) -> Tile {
        let mut tile = Tile::new(cells);
        tile.make(surface, patch);
        tile
    }

    /// Makes the tile of a patch in place. Allocates nothing.
    pub fn make(&mut self, surface: &Surface, patch: &Patch) {
        let mut grid = patch::GRID;
        self.coarse[..16].copy_from_slice(&patch.r);
        let (mut corner, mut plane) = (patch.corner, patch.plane);
        for step in 1..=self.cells.steps() {
            let next = Grid { size: (1 << step) + 3, origin: [-1, -1] };
            corner = corner.child(0, 0);
            plane = plane.child(0, 0);
            let (from, to) = (&mut self.coarse, &mut self.fine);
            surface.subdivide((grid, from), (next, to), [0, 0], &plane, corner);
            if step < self.cells.steps() {
                let count = next.size * next.size;
                from[..count].copy_from_slice(&to[..count]);
            }
            grid = next;
        }
    }

    /// Fine residual of a point, each axis −1..=N+1.
    pub fn fine_at(&self, x: i32, z: i32) -> i32 {
        self.fine[(z + 1) as usize * self.cells.fine_side() + (x + 1) as usize]
    }

    /// Coarse residual of a point, each axis −1..=N/2+1.
    pub fn coarse_at(&self, x: i32, z: i32) -> i32 {
        self.coarse[(z + 1) as usize * self.cells.coarse_side() + (x + 1) as usize]
    }
}

/// A gradient from the difference of residuals two spacings apart: 1/2 048 rise per run over the plane, ±16 at most.
pub fn gradient(difference: i32) -> i16 {
    (difference >> 6).clamp(-32_768, 32_767) as i16
}

/// The corner of the fine grid of a tile: its level and coordinates on its own lattice.
pub fn fine_corner(patch: &Patch, cells: Cells) -> Corner {
    (0..cells.steps()).fold(patch.corner, |corner, _| corner.child(0, 0))
}
