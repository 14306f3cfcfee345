//! Where a vertex of a drawn tile is: the reference of `shaders/terrain.wgsl`.
//!
//! A vertex has a fine height (its tile's mesh) and a coarse one (the parent tile's mesh at that point: the
//! parent's vertices, linear along its edges). Its weight goes from 0 (fine) to 1 (coarse) with its distance, so
//! that a tile that splits shows what it showed before. Where tiles of two levels touch, the weight is pinned.

use super::tile::Tile;

/// When tiles split and how they morph; distances in tiles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detail {
    /// A tile is split when it is nearer than this many of its own sizes: 2..=4.
    pub split: f64,
    /// The weight is 0 up to this distance: `split` plus a tile's diagonal and an allowance for its height.
    pub morph_start: f64,
    /// The weight is 1 from this distance on: 2·`split`, where the parent is about to be drawn instead.
    pub morph_end: f64,
}

/// A tile's diagonal with the height that tiles of moderate slope have, in tiles.
const DIAGONAL: f64 = 1.7;

impl Detail {
    /// Splitting at `split` tile sizes, 2..=4.
    ///
    /// # Panics
    /// Below 2 the morph range is empty, beyond 4 the layers of the backdrop outgrow their roots.
    pub const fn new(split: f64) -> Detail {
        assert!(split >= DIAGONAL + 0.3 && split <= 4.0, "a tile is split at 2 to 4 of its sizes");
        Detail { split, morph_start: split + DIAGONAL, morph_end: 2.0 * split }
    }

    /// The weight of the coarse height at a distance in tiles, 0..=1.
    pub fn weight(&self, distance: f64) -> f64 {
        ((distance - self.morph_start) / (self.morph_end - self.morph_start)).clamp(0.0, 1.0)
    }
}

/// What one corner of a drawn tile touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Touch {
    /// Only tiles of the tile's own level: the distance decides.
    Same,
    /// A tile of the next finer level too: the weight is 0 here.
    Finer,
    /// A tile of the next coarser level too: the weight is 1 here.
    Coarser,
}

/// The corners (0,0), (1,0), (0,1), (1,1) of a drawn tile, packed for the GPU: two bits each, the lower one
/// set where tiles of two levels touch, the upper one the pinned weight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Corners(pub u32);

impl Corners {
    /// The weight is 0 everywhere: neither distance nor neighbours matter.
    pub const FINE: Corners = Corners(0b0101_0101);

    /// Packs four corners.
    pub fn pack(touches: [Touch; 4]) -> Corners {
        let bits = |touch| match touch {
            Touch::Same => 0b00,
            Touch::Finer => 0b01,
            Touch::Coarser => 0b11,
        };
        Corners((0..4).fold(0, |all, i| all | bits(touches[i]) << (2 * i)))
    }

    /// The weight at (u, v) in [0, 1]² of the tile: the distance's weight, blended with the pins.
    pub fn weight(self, [u, v]: [f64; 2], distance_weight: f64) -> f64 {
        let blend = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
        let (mut mixed, mut pinned) = (0.0, 0.0);
        for (i, b) in blend.into_iter().enumerate() {
            let bits = self.0 >> (2 * i);
            mixed += b * f64::from(bits & 1);
            pinned += b * f64::from((bits >> 1) & 1);
        }
        (1.0 - mixed) * distance_weight + pinned
    }
}

/// The fine and the coarse residual of the mesh vertex (i, j) of a tile, both in 1/65 536 of the data spacing.
///
/// A mesh of N/`stride` cells lies over the N cells of data; i and j count mesh vertices, 0..=N/stride. The
/// parent's mesh has twice the stride: a vertex between its vertices lies on its edge, and one in the middle
/// of its quad on the diagonal from (1, 0) to (0, 1).
pub fn vertex(tile: &Tile, stride: usize, i: usize, j: usize) -> (i32, i32) {
    let s = stride as i32;
    let (i, j) = (i as i32, j as i32);
    let fine = tile.fine_at(i * s, j * s);
    // The coarse grid has twice the data spacing, so the parent's mesh has a vertex every `stride` points of it.
    let at = |x: i32, z: i32| tile.coarse_at(x * s, z * s);
    let (x, z) = (i >> 1, j >> 1);
    // Doubled, because the coarse grid's unit is twice the fine one's; the mean of two halves it again.
    let coarse = match (i & 1, j & 1) {
        (0, 0) => 2 * at(x, z),
        (1, 0) => at(x, z) + at(x + 1, z),
        (0, 1) => at(x, z) + at(x, z + 1),
        _ => at(x + 1, z) + at(x, z + 1),
    };
    (fine, coarse)
}
