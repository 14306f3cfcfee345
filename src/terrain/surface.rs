//! One step of the recursion that is the surface: `H[ℓ+1] = S(H[ℓ]) + O[ℓ+1]`.
//!
//! Heights at level ℓ count that level's spacing in fixed point (65 536 = one spacing). The unit halves with
//! every level, so subdivision doubles the numbers and an octave has the same amplitude at every level, for ever.

use super::hash;
use super::plane::Plane;

/// How heights between the old lattice points are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheme {
    /// Masks (2) and (1, 1): the thesis's surface; shows creases along the axes.
    Bilinear,
    /// Masks (1, 6, 1) and (4, 4): the uniform cubic B-spline (C²), natural.
    Cubic,
}

/// Treads and risers: before the noise, a height falls by a periodic function of the total height.
///
/// With f = height mod period, the fall is `(1−τ)·f` on the tread, and on the riser it goes back to 0
/// linearly; the lesser of the two lines is both at once, and continuous.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Terrace {
    /// Period in 1/65 536 spacing: a power of two, 2¹⁶..=2²⁰.
    pub period: u32,
    /// Fall per height on the tread, in 1/4 096: (1−τ), 0..=4 096.
    pub tread_fall: u32,
    /// Fall per height below the riser's top, in 1/4 096: (1−τ)(1−w)/w. `period × riser_fall < 2³²`.
    pub riser_fall: u32,
}

impl Terrace {
    /// A terrace from its description.
    ///
    /// `period_cells`: 1, 2, 4, 8 or 16; `tread_slope` τ in [0, 1]; `riser_width` w in (0, 1), a share of the period.
    /// None if the numbers leave those ranges or overflow 32 bits (the riser is too narrow for the period).
    pub fn new(period_cells: u32, tread_slope: f64, riser_width: f64) -> Option<Terrace> {
        if !period_cells.is_power_of_two() || period_cells > 16 {
            return None;
        }
        let ranges = (0.0..=1.0).contains(&tread_slope) && riser_width > 0.0 && riser_width < 1.0;
        if !ranges {
            return None;
        }
        let period = period_cells << 16;
        let tread_fall = ((1.0 - tread_slope) * 4096.0).round() as u32;
        let riser = (1.0 - tread_slope) * (1.0 - riser_width) / riser_width * 4096.0;
        if riser * f64::from(period) >= 4_294_967_295.0 {
            return None;
        }
        Some(Terrace { period, tread_fall, riser_fall: riser.round() as u32 })
    }

    /// The fall at a total height (mod 2³²), in 1/65 536 spacing, 0..=[`Terrace::bound`].
    #[inline(always)]
    pub fn fall(&self, height: u32) -> i32 {
        let f = height & (self.period - 1);
        let g = self.period - f;
        ((f * self.tread_fall).min(g.wrapping_mul(self.riser_fall)) >> 12) as i32
    }

    /// The greatest fall, where tread meets riser: `period · a·b / (a + b)`.
    pub fn bound(&self) -> i32 {
        let (a, b) = (u64::from(self.tread_fall), u64::from(self.riser_fall));
        if a + b == 0 {
            return 0;
        }
        ((u64::from(self.period) * a * b / (a + b)) >> 12) as i32 + 1
    }
}

/// Everything that determines the heights of a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Surface {
    /// Any 64 bits.
    pub seed: u64,
    /// How heights between the old lattice points are made.
    pub scheme: Scheme,
    /// Greatest value of the noise, in 1/65 536 spacing, 0..=65 535.
    pub amplitude: u16,
    /// Treads and risers, or none.
    pub terrace: Option<Terrace>,
    /// The noise of this level alone (mod 2³², not 0); None: of every level, as worlds have it.
    pub only: Option<u32>,
}

/// A square grid of residuals: `size`² values, the first at lattice point (`origin`, `origin`) counted from
/// the corner of the patch, rows of equal z.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    /// Points per side.
    pub size: usize,
    /// Coordinates of the first point, counted from the corner.
    pub origin: [i32; 2],
}

/// A lattice: level and the corner's coordinates, all mod 2³².
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Corner {
    /// Level of detail, mod 2³².
    pub level: u32,
    /// Lattice coordinate along x, mod 2³².
    pub x: u32,
    /// Lattice coordinate along z, mod 2³².
    pub z: u32,
}

impl Corner {
    /// The corner of child (qx, qz), one level finer.
    #[inline(always)]
    pub fn child(&self, qx: i32, qz: i32) -> Corner {
        Corner {
            level: self.level.wrapping_add(1),
            x: self.x.wrapping_mul(2).wrapping_add(qx as u32),
            z: self.z.wrapping_mul(2).wrapping_add(qz as u32),
        }
    }

    /// The corner moved along its own lattice.
    #[inline(always)]
    pub fn moved(&self, x: i32, z: i32) -> Corner {
        Corner { level: self.level, x: self.x.wrapping_add(x as u32), z: self.z.wrapping_add(z as u32) }
    }
}

impl Surface {
    /// A plain with the noise of one level, as this surface has it there, and nothing else.
    pub fn alone(&self, level: u32) -> Surface {
        Surface { terrace: None, only: Some(level), ..*self }
    }

    /// How far all octaves still to come can lower and raise a height: `(down, up)` in spacings of the level at hand.
    ///
    /// Each level's octave is bounded by the same number of its own spacings, which halve: the sum is one level's
    /// bound. Two units are allowed for rounding.
    pub fn bounds(&self) -> (f64, f64) {
        let amplitude = f64::from(self.amplitude) + 2.0;
        let fall = f64::from(self.terrace.map_or(0, |t| t.bound()));
        ((amplitude + fall) / 65_536.0, amplitude / 65_536.0)
    }

    /// Adds the octave to a row of subdivided residuals, in place.
    ///
    /// `height` is the plane's total height at the first point, `gx` its rise per point, `x` the first point's
    /// lattice coordinate; all mod 2³².
    #[inline(always)]
    fn add_octave(&self, row: &mut [i32], keys: [u32; 2], x: u32, height: u32, gx: u32) {
        let amplitude = i32::from(self.amplitude);
        match self.terrace {
            None => {
                for (i, r) in row.iter_mut().enumerate() {
                    let n = hash::sample(keys, x.wrapping_add(i as u32));
                    *r += (n * amplitude) >> 15;
                }
            }
            Some(terrace) => {
                for (i, r) in row.iter_mut().enumerate() {
                    let n = hash::sample(keys, x.wrapping_add(i as u32));
                    let total = height.wrapping_add((i as u32).wrapping_mul(gx)).wrapping_add(*r as u32);
                    *r += ((n * amplitude) >> 15) - terrace.fall(total);
                }
            }
        }
    }

    /// One step: makes `fine` (of the child level, residuals over the same plane) from `coarse`.
    ///
    /// `plane` and `corner` are the child's: the plane at the fine grid's level counted from `corner`.
    /// The fine grid's origin counts from that corner; `shift` is the corner's offset in fine spacings from
    /// twice the coarse corner. Coarse must reach one point beyond (`Cubic`) the points that fine lies between.
    pub fn subdivide(
        &self,
        (coarse, from): (Grid, &[i32]),
        (fine, to): (Grid, &mut [i32]),
        shift: [i32; 2],
        plane: &Plane,
        corner: Corner,
    ) {
        match self.scheme {
            Scheme::Bilinear => interpolate::<Bilinear>(coarse, from, fine, to, shift),
            Scheme::Cubic => interpolate::<Cubic>(coarse, from, fine, to, shift),
        }
        if self.only.is_some_and(|only| only != corner.level) {
            return;
        }
        let key = hash::level_key(self.seed, corner.level);
        let x = corner.x.wrapping_add(fine.origin[0] as u32);
        for (j, row) in to[..fine.size * fine.size].chunks_exact_mut(fine.size).enumerate() {
            let dz = fine.origin[1] + j as i32;
            let keys = hash::row_keys(key, corner.z.wrapping_add(dz as u32));
            let height = plane.at(i64::from(fine.origin[0]), i64::from(dz));
            self.add_octave(row, keys, x, height, plane.gx as u32);
        }
    }
}

/// The 1-D masks of a scheme, un-normalised: both axes multiply, then the product is shifted once.
trait Mask {
    /// Shift after both axes; it also doubles, because the unit halves.
    const SHIFT: u32;
    /// On an old lattice point: `h[-1], h[0], h[1]`.
    fn even(before: i32, here: i32, after: i32) -> i32;
    /// Between two: `h[0], h[1]`.
    fn odd(here: i32, after: i32) -> i32;
}

struct Bilinear;
impl Mask for Bilinear {
    const SHIFT: u32 = 1;
    #[inline(always)]
    fn even(_: i32, here: i32, _: i32) -> i32 {
        2 * here
    }
    #[inline(always)]
    fn odd(here: i32, after: i32) -> i32 {
        here + after
    }
}

struct Cubic;
impl Mask for Cubic {
    const SHIFT: u32 = 5;
    #[inline(always)]
    fn even(before: i32, here: i32, after: i32) -> i32 {
        before + 6 * here + after
    }
    #[inline(always)]
    fn odd(here: i32, after: i32) -> i32 {
        4 * (here + after)
    }
}

/// The widest row that a subdivision step handles: 128 cells, their corners and the ring.
pub const WIDEST: usize = 131;

/// One row along x: `to[i]` lies at fine coordinate `first + i`, coarse point 0 at fine coordinate 0.
#[inline(always)]
fn widen<M: Mask>(from: &[i32], to: &mut [i32], first: i32) {
    let n = to.len();
    // Odd first point: handle it apart, so that the body runs over (even, odd) pairs.
    let mut start = 0;
    let mut i = (first >> 1) as usize;
    if first & 1 == 1 {
        to[0] = M::odd(from[i], from[i + 1]);
        start = 1;
        i += 1;
    }
    let pairs = (n - start) / 2;
    for (p, out) in to[start..start + 2 * pairs].chunks_exact_mut(2).enumerate() {
        let k = i + p;
        out[0] = M::even(from[k - 1], from[k], from[k + 1]);
        out[1] = M::odd(from[k], from[k + 1]);
    }
    if start + 2 * pairs < n {
        let k = i + pairs;
        to[n - 1] = M::even(from[k - 1], from[k], from[k + 1]);
    }
}

fn interpolate<M: Mask>(coarse: Grid, from: &[i32], fine: Grid, to: &mut [i32], shift: [i32; 2]) {
    let (m, n) = (coarse.size, fine.size);
    // Fine coordinate of the first fine point, counted from the first coarse point.
    let first = [0, 1].map(|a| fine.origin[a] + shift[a] - 2 * coarse.origin[a]);
    let mut rows = [[0i32; WIDEST]; 3];
    let row = |k: usize| &from[k * m..(k + 1) * m];
    // rows[k % 3] holds coarse row k, widened; `next` is the first row not widened yet.
    let mut next = ((first[1] - 1) >> 1) as usize;
    for (j, out) in to[..n * n].chunks_exact_mut(n).enumerate() {
        let z = first[1] + j as i32;
        let k = (z >> 1) as usize;
        while next <= k + 1 && next < m {
            widen::<M>(row(next), &mut rows[next % 3][..n], first[0]);
            next += 1;
        }
        if z & 1 == 1 {
            let (a, b) = (&rows[k % 3][..n], &rows[(k + 1) % 3][..n]);
            for i in 0..n {
                out[i] = M::odd(a[i], b[i]) >> M::SHIFT;
            }
        } else {
            let (a, b, c) = (&rows[(k + 2) % 3][..n], &rows[k % 3][..n], &rows[(k + 1) % 3][..n]);
            for i in 0..n {
                out[i] = M::even(a[i], b[i], c[i]) >> M::SHIFT;
            }
        }
    }
}
