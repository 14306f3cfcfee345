//! The plane a patch of heights is counted from: `H = c + gx·x + gz·z + r`.
//!
//! Heights at depth 1 000 000 fit no machine word and need not: under subdivision a plane maps exactly
//! (`c' = 2c + gx·qx + gz·qz`, slopes unchanged), so only the residual r is ever stored.

/// x and z count lattice spacings from the patch's corner; everything in 1/65 536 spacing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Plane {
    /// Height at the corner, mod 2³².
    pub c: u32,
    /// Rise per spacing along x.
    pub gx: i64,
    /// Rise per spacing along z.
    pub gz: i64,
}

impl Plane {
    /// Height over the corner of the point (x, z), without c.
    #[inline(always)]
    pub fn rise(&self, x: i64, z: i64) -> i64 {
        self.gx * x + self.gz * z
    }

    /// Total height of the point (x, z) mod 2³², without the residual.
    #[inline(always)]
    pub fn at(&self, x: i64, z: i64) -> u32 {
        self.c.wrapping_add(self.rise(x, z) as u32)
    }

    /// The same plane counted from the corner (x, z), or, with child coordinates, of one level finer:
    /// there heights double and the slopes stay.
    #[inline(always)]
    pub fn moved(&self, x: i64, z: i64) -> Plane {
        Plane { c: self.at(x, z), ..*self }
    }

    /// The same plane at the next finer level, from the corner of child (qx, qz).
    #[inline(always)]
    pub fn child(&self, qx: i64, qz: i64) -> Plane {
        Plane { c: self.c.wrapping_mul(2).wrapping_add(self.rise(qx, qz) as u32), ..*self }
    }

    /// Fits a plane to the residuals of a cell's corners (00, 10, 01, 11), adds it to this one and
    /// returns it as `(height of the corner, slope x, slope z)` to be taken off the residuals.
    ///
    /// The sum is a function of the cell's heights alone, whatever plane they were counted from before:
    /// halving and quartering round the same way because an old slope enters them as an even number.
    #[inline(always)]
    pub fn absorb(&mut self, corners: [i32; 4]) -> [i64; 3] {
        let [r00, r10, r01, r11] = corners.map(i64::from);
        let gx = (r10 - r00 + r11 - r01) >> 1;
        let gz = (r01 - r00 + r11 - r10) >> 1;
        let c = (r00 + r10 + r01 + r11 - 2 * (gx + gz)) >> 2;
        self.c = self.c.wrapping_add(c as u32);
        self.gx += gx;
        self.gz += gz;
        [c, gx, gz]
    }

    /// Slope as rise over run: (x, z).
    pub fn slope(&self) -> [f64; 2] {
        [self.gx as f64 / 65_536.0, self.gz as f64 / 65_536.0]
    }
}
