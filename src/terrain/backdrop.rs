//! What is too far away to show parallax: which tiles a backdrop holds, and where each of its layers is baked from.
//!
//! A *layer* is the ring of all tiles of one level, as the selection would draw them. The layer of level j is baked
//! from a point that the place alone decides: in the middle of the storey that the viewer is in over the path's
//! canonical tile `lag` levels below j. A viewer whose anchor is at that level or deeper is within a few of that tile's
//! sizes of the point, and the layer's nearest content is `split · 2^lag` of them away: so small is the angle by which it
//! would shift ([`parallax`]; the bound of Jeschke and Wimmer, "Textured depth meshes for real-time rendering", 2002).

use super::block::Block;
use super::patch::Patch;
use super::place::Place;
use super::spine::Step;
use super::surface::Corner;
use glam::DVec3;

/// Levels from a layer's tiles up to the nine tiles that its selection begins with: their reach, 8 of the layer's
/// tiles, is the ring's outer edge at the greatest `split`.
pub const ROOT_UP: usize = 3;

/// Height of a storey, in tiles. The lowest is baked from one tile above the ground's plane, about where viewers are.
const STOREY: i32 = 4;

/// A layer's name and the point it is baked from: layers of the same name are the same texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayerId {
    /// Level of its tiles, counted from the root of the world.
    pub level: usize,
    /// The canonical tile over whose middle the point lies.
    pub key: Corner,
    /// Height of the point mod 2³², in 1/65 536 of that tile.
    pub height: u32,
}

/// What a layer is baked from.
#[derive(Clone, Copy, Debug)]
pub struct Layer {
    /// Its name.
    pub id: LayerId,
    /// The nine tiles that its selection begins with.
    pub root: Block,
    /// The point it is baked from, in tiles of the root.
    pub eye: DVec3,
}

/// A viewer seen from every level of the path above his anchor.
#[derive(Clone, Debug, Default)]
pub struct Ladder {
    /// The anchor's level.
    level: usize,
    /// The anchor first: each level's step, and the viewer in its tiles.
    rungs: Vec<(Step, DVec3)>,
}

/// Where a point lies among the tiles and storeys of a level.
struct Cell {
    patch: Patch,
    /// The tile, counted from the path's.
    tile: [i32; 2],
    /// Height of the baking point over the corner of the path's plane, in tiles.
    height: f64,
    /// The same over the root of the world mod 2³², in 1/65 536 tile.
    total: u32,
}

impl Ladder {
    /// Looks from `position` (in tiles of the place's anchor) at the path's tiles, the anchor's and those of `levels`
    /// levels above it, as far as there are.
    pub fn climb(&mut self, place: &Place, position: DVec3, levels: usize) {
        self.level = place.level();
        self.rungs.clear();
        let mut at = (*place.spine.bottom(), position);
        self.rungs.push(at);
        for level in (self.level.saturating_sub(levels)..self.level).rev() {
            at = place.lift(at.1, level + 1, level);
            self.rungs.push(at);
        }
    }

    /// Level of the anchor.
    pub fn level(&self) -> usize {
        self.level
    }

    fn rung(&self, level: usize) -> &(Step, DVec3) {
        &self.rungs[self.level - level]
    }

    /// The name of the layer of `level` around the viewer. `level + lag` is at most the anchor's level, and on the ladder.
    pub fn id(&self, level: usize, lag: usize) -> LayerId {
        let (step, p) = self.rung(level + lag);
        let cell = cell(step, *p);
        LayerId { level, key: cell.patch.corner, height: cell.total }
    }

    /// The layer of `level`, at least [`ROOT_UP`], around the viewer.
    pub fn layer(&self, place: &Place, level: usize, lag: usize) -> Layer {
        let (step, p) = self.rung(level + lag);
        let Cell { patch, tile: [i, k], height, total } = cell(step, *p);
        let eye = DVec3::new(f64::from(i) + 0.5, height, f64::from(k) + 0.5);
        let (root, eye) = place.lift(eye, level + lag, level - ROOT_UP);
        Layer { id: LayerId { level, key: patch.corner, height: total }, root: root.block, eye }
    }

    /// How far the viewer is from the point that a layer was baked from, in tiles of its key; infinite where that is
    /// farther up than the ladder goes.
    pub fn moved(&self, id: &LayerId, lag: usize) -> f64 {
        self.way(id, lag).map_or(f64::INFINITY, DVec3::length)
    }

    /// The way to the viewer from the point that a layer was baked from, in tiles of its key; None where that is farther
    /// up than the ladder goes.
    pub fn way(&self, id: &LayerId, lag: usize) -> Option<DVec3> {
        let key = id.level + lag;
        if key + self.rungs.len() <= self.level {
            return None;
        }
        let (step, p) = self.rung(key.min(self.level));
        // A key deeper than the anchor: all lengths double with each level.
        let deeper = key.saturating_sub(self.level) as u32;
        let scale = f64::from(1u32 << deeper.min(31));
        let turns = |to: u32, from: u32| {
            f64::from(to.wrapping_shl(deeper).wrapping_mul(u32::from(deeper < 32)).wrapping_sub(from) as i32)
        };
        let block = &step.block;
        Some(DVec3::new(
            scale * p.x - 0.5 + turns(block.corner.x, id.key.x),
            scale * p.y + turns(block.plane.c, id.height) / 65_536.0,
            scale * p.z - 0.5 + turns(block.corner.z, id.key.z),
        ))
    }
}

fn cell(step: &Step, p: DVec3) -> Cell {
    let tile = [p.x, p.z].map(|v| v.floor().clamp(-1.0, 1.0) as i32);
    let (patch, rise) = step.block.patch(tile[0], tile[1]);
    let middle = rise + ((patch.plane.gx + patch.plane.gz) >> 1);
    // Within ±2 storeys of 16 bits, as no viewer is that high.
    let storey =
        ((p.y - middle as f64 / 65_536.0 + 1.0) / f64::from(STOREY)).floor().clamp(0.0, 4096.0) as i64;
    let above = middle + ((i64::from(STOREY) * storey + 1) << 16);
    let total = step.block.plane.c.wrapping_add(above as u32);
    Cell { patch, tile, height: above as f64 / 65_536.0, total }
}

/// The angle in radians by which the nearest content of a layer shifts for a viewer who is `moved` away from the
/// point it was baked from: `moved` in tiles `lag` levels below the layer's.
pub fn parallax(moved: f64, split: f64, lag: usize) -> f64 {
    moved / (split * (1u64 << lag) as f64)
}

/// How far, in key tiles, a viewer may be from where a layer is baked if he is to see no more than `pixels` of parallax.
pub fn bound_for(lag: usize, split: f64, pixels_per_tangent: f64, pixels: f64) -> f64 {
    pixels / pixels_per_tangent * split * (1u64 << lag) as f64
}

/// The least lag for which a viewer `moved` key tiles away sees no more than `pixels` of parallax.
pub fn lag_for(moved: f64, split: f64, pixels_per_tangent: f64, pixels: f64) -> usize {
    (moved * pixels_per_tangent / (split * pixels)).log2().ceil().max(1.0) as usize
}
