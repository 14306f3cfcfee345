//! The heights around a place as files for other programs: exact integers as CSV, a 16-bit PNG, a Wavefront OBJ mesh.
//!
//! The grid's points are lattice points of one level, N cells a side around the cell under the place: for an even N
//! that cell's corner is the middle, for an odd N the cell itself is. The point (0, 0) is the cell's corner, x to the
//! right and z towards a viewer who looks along −z. Heights count from the point (0, 0), in 1/65 536 of the spacing.
//!
//! The level is the one at which the grid is 8 to 16 times as wide as the place's height: about what the viewer has
//! before him. More cells make it finer, not wider; `level_offset` makes it finer (and narrower) or coarser.

use std::io::{self, Write};
use std::path::Path;

use crate::course::Stand;
use crate::picture::{self, Note, Pixels};
use crate::terrain::patch::Patch;
use crate::terrain::surface::Corner;
use crate::terrain::tile::{Cells, Tile};
use crate::terrain::{Place, Surface};

/// The most cells a side.
pub const MAX_CELLS: u32 = 4096;

/// The width of the grid is at least this many times the place's height.
const REACH: f64 = 8.0;

/// Levels that a tile is made of: 64 cells a side.
const TILE_STEPS: u32 = 6;

/// A square grid of heights.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Cells a side, 1 to [`MAX_CELLS`]; the points are one more.
    pub cells: u32,
    /// Level of the lattice, counted from the root.
    pub level: usize,
    /// The lattice point (0, 0), mod 2³².
    pub corner: Corner,
    /// Total height of the point (0, 0), mod 2³²: the same whatever the grid.
    pub ground: u32,
    /// x and z of the first point: −N/2, rounded towards zero.
    pub first: i32,
    /// Heights above the point (0, 0) in 1/65 536 spacing, rows of equal z.
    pub heights: Vec<i64>,
}

impl Grid {
    /// The grid around a place. `progress` hears how many points of [`Grid::points`] are done, now and then.
    pub fn around(stand: &Stand, cells: u32, level_offset: i32, mut progress: impl FnMut(u64)) -> Grid {
        let cells = cells.clamp(1, MAX_CELLS);
        // 3×3 tiles of 2ⁿ cells hold the grid, wherever in the middle one the place is.
        let steps = cells.div_ceil(2).next_power_of_two().trailing_zeros().max(2);
        let octaves = (f64::from(cells) / (REACH * stand.height)).log2().floor();
        let level = stand.place.level() as f64 + octaves + f64::from(level_offset);
        let above = at_level(&stand.place, (level - f64::from(steps)).max(0.0) as usize);
        let block = above.spine.bottom().block;

        let size = 1i64 << steps;
        let inside = |v: f64| ((v * size as f64) as i64).clamp(0, size - 1);
        let middle = [inside(above.position.x), inside(above.position.z)];
        let first = -((cells / 2) as i32);
        let side = cells as usize + 1;
        let mut filler = Filler {
            surface: above.spine.surface(),
            tile: Tile::new(Cells::of_steps(steps.min(TILE_STEPS))),
            origin: middle.map(|m| m + i64::from(first)),
            side: side as i64,
            heights: vec![0; side * side],
        };
        let mut done = 0;
        for (j, i) in (-1..=1).flat_map(|j| (-1..=1).map(move |i| (j, i))) {
            let (patch, rise) = block.patch(i, j);
            let corner = [i64::from(i) * size, i64::from(j) * size];
            filler.fill(&patch, rise, steps, corner, &mut |points| {
                done += points;
                progress(done);
            });
        }
        let Filler { mut heights, .. } = filler;
        let zero = heights[(-first) as usize * (side + 1)];
        heights.iter_mut().for_each(|height| *height -= zero);
        let corner = (0..steps).fold(block.corner, |corner, _| corner.child(0, 0));
        Grid {
            cells,
            level: above.level() + steps as usize,
            corner: corner.moved(middle[0] as i32, middle[1] as i32),
            ground: (block.plane.c << steps).wrapping_add(zero as u32),
            first,
            heights,
        }
    }

    /// Points a side.
    pub fn side(&self) -> usize {
        self.cells as usize + 1
    }

    /// How many points a grid of so many cells has.
    pub fn points(cells: u32) -> u64 {
        (u64::from(cells) + 1).pow(2)
    }

    /// x, z and height of each point, row by row.
    pub fn iter(&self) -> impl Iterator<Item = (i32, i32, i64)> + '_ {
        let side = self.side();
        let at = move |i: usize| (self.first + (i % side) as i32, self.first + (i / side) as i32);
        self.heights.iter().enumerate().map(move |(i, &height)| (at(i).0, at(i).1, height))
    }

    /// The least and the greatest height.
    pub fn range(&self) -> (i64, i64) {
        let all = || self.heights.iter().copied();
        (all().min().unwrap_or(0), all().max().unwrap_or(0))
    }
}

/// The same place, seen from the tile under it at a level; x and z within 0..1.
fn at_level(place: &Place, level: usize) -> Place {
    let mut place = place.clone();
    loop {
        let [dx, _, dz] = place.position.to_array().map(|v| v.floor().clamp(-1.0, 1.0));
        place.spine.walk(dx as i32, dz as i32);
        place.position.x -= dx;
        place.position.z -= dz;
        // Heights count from the ground: how high the viewer is does not matter here, and grows with every level.
        place.position.y = 0.0;
        match place.level() {
            here if here > level => _ = place.shallower(),
            here if here < level => place.deeper(),
            _ => return place,
        }
    }
}

/// Fills a grid from tiles.
struct Filler<'a> {
    surface: &'a Surface,
    tile: Tile,
    /// The grid's first point, counted in its spacing from the corner of the block's middle tile.
    origin: [i64; 2],
    /// Points a side.
    side: i64,
    heights: Vec<i64>,
}

impl Filler<'_> {
    /// Writes the heights that lie in a patch `steps` levels above the grid's, its plane's corner `base` (in 1/65 536
    /// of its spacing) above the block's, its corner at `at` in the grid's spacing.
    fn fill(&mut self, patch: &Patch, base: i64, steps: u32, at: [i64; 2], progress: &mut impl FnMut(u64)) {
        let size = 1i64 << steps;
        let apart = |a: usize| at[a] > self.origin[a] + self.side - 1 || at[a] + size < self.origin[a];
        if apart(0) || apart(1) {
            return;
        }
        if steps > TILE_STEPS {
            for (i, (child, rise)) in patch.children(self.surface).into_iter().enumerate() {
                let q = [i as i64 & 1, i as i64 >> 1];
                let base = 2 * base + patch.plane.rise(q[0], q[1]) + rise;
                self.fill(&child, base, steps - 1, [0, 1].map(|a| at[a] + q[a] * size / 2), progress);
            }
            return;
        }
        self.tile.make(self.surface, patch);
        let reach =
            |a: usize| (self.origin[a] - at[a]).max(0)..=(self.origin[a] + self.side - 1 - at[a]).min(size);
        for z in reach(1) {
            let row = (at[1] + z - self.origin[1]) * self.side;
            for x in reach(0) {
                let residual = i64::from(self.tile.fine_at(x as i32, z as i32));
                let height = (base << steps) + patch.plane.rise(x, z) + residual;
                self.heights[(row + at[0] + x - self.origin[0]) as usize] = height;
            }
        }
        progress((reach(0).count() * reach(1).count()) as u64);
    }
}

/// What the files say about themselves.
#[derive(Clone, Copy, Debug)]
pub struct About<'a> {
    /// The place's address.
    pub address: &'a str,
    /// The world's name.
    pub world: &'a str,
}

/// The lines at the head of a text file, without comment signs.
fn head(grid: &Grid, about: &About<'_>) -> Vec<String> {
    let Corner { x, z, .. } = grid.corner;
    vec![
        format!("Heights of {} around a place, by {}", about.world, picture::SOFTWARE),
        format!("address: {}", about.address),
        format!("level: {} (spacing: 2^-{} of a tile of the root)", grid.level, grid.level),
        format!(
            "cells: {} a side, x to the right, z towards a viewer of yaw 0, in spacings from the point 0,0",
            grid.cells
        ),
        format!("point 0,0: lattice point {x},{z} (mod 2^32), total height {} (mod 2^32)", grid.ground),
    ]
}

/// Exact integers: a line `x,z,height` per point, after comment lines that begin with `#`.
///
/// # Errors
/// What the system says.
pub fn write_csv(grid: &Grid, about: &About<'_>, to: &mut (impl Write + ?Sized)) -> io::Result<()> {
    for line in head(grid, about) {
        writeln!(to, "# {line}")?;
    }
    writeln!(to, "# height: whole number, in 1/65536 spacing, above the point 0,0")?;
    writeln!(to, "x,z,height")?;
    grid.iter().try_for_each(|(x, z, height)| writeln!(to, "{x},{z},{height}"))
}

/// A mesh in spacings, y up, two triangles per cell, seen from above anticlockwise. Vertices are exact: 16 binary
/// digits behind the point.
///
/// # Errors
/// What the system says.
pub fn write_obj(grid: &Grid, about: &About<'_>, to: &mut (impl Write + ?Sized)) -> io::Result<()> {
    for line in head(grid, about) {
        writeln!(to, "# {line}")?;
    }
    writeln!(to, "# vertices: x, y (height above the point 0,0), z in spacings")?;
    writeln!(to, "o heights")?;
    for (x, z, height) in grid.iter() {
        writeln!(to, "v {x} {} {z}", height as f64 / 65_536.0)?;
    }
    let side = grid.side();
    for row in 0..side - 1 {
        for column in 0..side - 1 {
            // Vertices count from 1.
            let a = row * side + column + 1;
            let (b, c, d) = (a + side, a + side + 1, a + 1);
            writeln!(to, "f {a} {b} {c}\nf {a} {c} {d}")?;
        }
    }
    Ok(())
}

/// A greyscale picture: 0 is the least height, 65 535 the greatest, straight between. A text chunk gives both.
///
/// # Errors
/// What the system says.
pub fn write_png16(grid: &Grid, about: &About<'_>, path: &Path) -> io::Result<()> {
    let (least, greatest) = grid.range();
    let span = (i128::from(greatest) - i128::from(least)).max(1);
    let grey = |height: i64| ((i128::from(height) - i128::from(least)) * 65_535 + span / 2) / span;
    let bytes: Vec<u8> =
        grid.heights.iter().flat_map(|&height| (grey(height) as u16).to_be_bytes()).collect();
    let map = format!(
        "height above the point 0,0 in 1/65536 spacing = {least} + value / 65535 * {}; x and z from {} in spacings; {}",
        span,
        grid.first,
        head(grid, about)[2..].join("; "),
    );
    let description = format!("Heights of {} around a place", about.world);
    let notes = [
        Note { keyword: "Software", text: picture::SOFTWARE },
        Note { keyword: "Description", text: &description },
        Note { keyword: picture::ADDRESS, text: about.address },
        Note { keyword: "Fathomless-Heights", text: &map },
    ];
    let side = grid.cells + 1;
    picture::write(path, [side, side], Pixels::Grey16(&bytes), &notes)
}
