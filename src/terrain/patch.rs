//! A quadtree node: the 4×4 lattice points (a cell's four corners and one ring) that determine everything in the cell.

use super::plane::Plane;
use super::surface::{Corner, Grid, Surface};

/// The grid of a patch: 4×4 points from (−1, −1).
pub const GRID: Grid = Grid { size: 4, origin: [-1, -1] };

/// The points that the four children of a patch lie in: 5×5 from (−1, −1), in the children's spacing.
const CHILDREN: Grid = Grid { size: 5, origin: [-1, -1] };

/// A cell of the lattice with everything that determines the surface in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Patch {
    /// The cell: level and corner.
    pub corner: Corner,
    /// The plane that the residuals are counted from; coordinates count from the corner.
    pub plane: Plane,
    /// Residuals of the points (−1..=2)², rows of equal z.
    pub r: [i32; 16],
}

/// Least and greatest height of a cell over its plane's corner, in spacings, for all levels to come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// No vertex of any descendant is lower.
    pub low: f64,
    /// No vertex of any descendant is higher.
    pub high: f64,
}

impl Patch {
    /// Takes the plane through the corners (as near as integers come) off the residuals.
    /// Returns how much the plane's corner rose, in 1/65 536 spacing.
    pub fn absorb(&mut self) -> i64 {
        let [c, gx, gz] = self.plane.absorb([self.r[5], self.r[6], self.r[9], self.r[10]]);
        let (c, gx, gz) = (c as i32, gx as i32, gz as i32);
        for z in 0..4 {
            for x in 0..4 {
                self.r[4 * z + x] -= c + gx * (x as i32 - 1) + gz * (z as i32 - 1);
            }
        }
        i64::from(c)
    }

    /// The four children, in the order (0,0), (1,0), (0,1), (1,1), each with how much its plane's corner lies
    /// above this plane mapped to the child's level (1/65 536 of the child's spacing).
    pub fn children(&self, surface: &Surface) -> [(Patch, i64); 4] {
        let mut points = [0i32; 25];
        let corner = self.corner.child(0, 0);
        let plane = self.plane.child(0, 0);
        surface.subdivide((GRID, &self.r), (CHILDREN, &mut points), [0, 0], &plane, corner);
        [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(qx, qz)| {
            let mut r = [0; 16];
            for z in 0..4 {
                let start = 5 * (z + qz) + qx;
                r[4 * z..4 * z + 4].copy_from_slice(&points[start..start + 4]);
            }
            let (x, z) = (qx as i32, qz as i32);
            let mut child =
                Patch { corner: corner.moved(x, z), plane: plane.moved(i64::from(x), i64::from(z)), r };
            let rise = child.absorb();
            (child, rise)
        })
    }

    /// The residual of a point, x and z in −1..=2.
    pub fn residual(&self, x: i32, z: i32) -> i32 {
        self.r[((z + 1) * 4 + x + 1) as usize]
    }

    /// Height of a point above the plane's corner, in 1/65 536 spacing, x and z in −1..=2.
    pub fn rise(&self, x: i32, z: i32) -> i64 {
        self.plane.rise(i64::from(x), i64::from(z)) + i64::from(self.residual(x, z))
    }

    /// Total height of a point of the patch mod 2³².
    pub fn height(&self, x: i32, z: i32) -> u32 {
        self.plane.at(i64::from(x), i64::from(z)).wrapping_add(self.residual(x, z) as u32)
    }

    /// What the whole cell's surface lies in, now and at every level to come.
    ///
    /// Both schemes reproduce planes and stay in the convex hull of the residuals; `bounds` is
    /// [`Surface::bounds`], the sum of all octaves still to come.
    #[inline(always)]
    pub fn range(&self, bounds: (f64, f64)) -> Range {
        let (mut least, mut most) = (self.r[0], self.r[0]);
        for &r in &self.r {
            least = least.min(r);
            most = most.max(r);
        }
        let (gx, gz) = (self.plane.gx, self.plane.gz);
        let low = gx.min(0) + gz.min(0) + i64::from(least);
        let high = gx.max(0) + gz.max(0) + i64::from(most);
        Range { low: low as f64 / 65_536.0 - bounds.0, high: high as f64 / 65_536.0 + bounds.1 }
    }
}
