//! What is too far away to show parallax: which tiles a backdrop holds, and where each of its layers is baked from.
//!
//! A *layer* is the ring of all tiles of one level, as the selection would draw them. The layer of level j is baked
//! from a point that the place alone decides: above the middle of the path's canonical tile `lag` levels below j.
//! A viewer whose anchor is at that level or deeper is within a few of that tile's sizes of the point, and the
//! layer's nearest content is `split · 2^lag` of them away: so small is the angle by which it would shift
//! ([`parallax`]; the bound of Jeschke and Wimmer, "Textured depth meshes for real-time rendering", 2002).

use super::block::Block;
use super::place::Place;
use super::surface::Corner;
use glam::DVec3;

/// Levels from a layer's tiles up to the nine tiles that its selection begins with: their reach, 8 of the layer's
/// tiles, is the ring's outer edge at the greatest `split`.
pub const ROOT_UP: usize = 3;

/// Where a layer is baked from.
#[derive(Clone, Copy, Debug)]
pub struct Layer {
    /// Level of its tiles, counted from the root of the world.
    pub level: usize,
    /// The canonical tile above which it is baked. Two layers of one level and one key are the same texels.
    pub key: Corner,
    /// The nine tiles that its selection begins with.
    pub root: Block,
    /// The point it is baked from, in tiles of the root.
    pub eye: DVec3,
}

impl Layer {
    /// The layer of tiles of `level` around a position (in anchor tiles). `level + lag` is at most the anchor's
    /// level, and `level` at least [`ROOT_UP`].
    pub fn new(place: &Place, position: DVec3, level: usize, lag: usize) -> Layer {
        let below = level + lag;
        let (step, p) = place.lift(position, place.level(), below);
        let (i, k) = (p.x.floor().clamp(-1.0, 1.0), p.z.floor().clamp(-1.0, 1.0));
        let (patch, rise) = step.block.patch(i as i32, k as i32);
        let [gx, gz] = patch.plane.slope();
        // One tile above the plane's middle: about where viewers are.
        let height = rise as f64 / 65_536.0 + 0.5 * (gx + gz) + 1.0;
        let (root, eye) = place.lift(DVec3::new(i + 0.5, height, k + 0.5), below, level - ROOT_UP);
        Layer { level, key: patch.corner, root: root.block, eye }
    }
}

/// How far, in tiles of the key, a viewer at `position` (anchor tiles) is from the point that the layer of `level`
/// around it is baked from.
pub fn distance_from_eye(place: &Place, position: DVec3, layer: &Layer, lag: usize) -> f64 {
    let (_, p) = place.lift(position, place.level(), layer.level - ROOT_UP);
    (p - layer.eye).length() * (1u64 << (lag + ROOT_UP)) as f64
}

/// The angle in radians by which the nearest content of a layer shifts for a viewer who is `moved` away from the
/// point it was baked from: `moved` in tiles `lag` levels below the layer's.
pub fn parallax(moved: f64, split: f64, lag: usize) -> f64 {
    moved / (split * (1u64 << lag) as f64)
}

/// The least lag for which a viewer `moved` key tiles away sees no more than `pixels` of parallax.
pub fn lag_for(moved: f64, split: f64, pixels_per_tangent: f64, pixels: f64) -> usize {
    (moved * pixels_per_tangent / (split * pixels)).log2().ceil().max(1.0) as usize
}
