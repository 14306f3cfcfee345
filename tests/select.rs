//! The drawn tiles: they cover the window exactly once, touching tiles differ by at most one level, and both
//! sides of every edge compute the same positions, whatever was ready.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

#[path = "support/terrain.rs"]
mod support;

use fathomless::terrain::morph::{self, Detail};
use fathomless::terrain::pool::{Pool, Slot};
use fathomless::terrain::select::{Drawn, Selection, Tiles, View, slots_needed};
use fathomless::terrain::surface::Corner;
use fathomless::terrain::tile::{Cells, Tile};
use fathomless::terrain::{Patch, Surface, hash};
use glam::DVec3;
use proptest::prelude::*;
use std::collections::{HashMap, HashSet};
use support::{path, place, surface};

/// Tiles of which a random share is there; what was asked for comes up to a budget. Keeps the patches.
struct PartlyReady {
    share: f64,
    salt: u32,
    budget: usize,
    root_level: u32,
}

impl Tiles for PartlyReady {
    fn ready(&mut self, tile: Corner) -> Option<Slot> {
        let h = hash::noise(u64::from(self.salt), tile.level, tile.x, tile.z) + 32_768;
        (tile.level == self.root_level || f64::from(h) < self.share * 65_536.0).then_some(0)
    }

    fn make(&mut self, _: &Patch, needed: bool) -> Option<Slot> {
        let granted = needed || self.budget > 0;
        self.budget = self.budget.saturating_sub(1);
        granted.then_some(1)
    }
}

#[derive(Clone, Debug)]
struct Viewer {
    surface: Surface,
    path: support::Path,
    position: [f64; 3],
    up: usize,
    more: usize,
    split: f64,
    share: f64,
    budget: usize,
}

fn viewer() -> impl Strategy<Value = Viewer> {
    let share = prop_oneof![2 => Just(1.0), 2 => 0.3f64..1.0];
    let position = (-0.2f64..1.2, prop_oneof![3 => 0.02f64..3.0, 1 => 3.0f64..60.0], -0.2f64..1.2);
    (surface(), path(4), position, 1usize..5, 0usize..4, 2.0f64..3.5, share, 0usize..200).prop_map(
        |(surface, path, (x, y, z), up, more, split, share, budget)| Viewer {
            surface,
            path,
            position: [x, y, z],
            up,
            more,
            split,
            share,
            budget,
        },
    )
}

impl Viewer {
    fn select(&self) -> (Selection, Corner, Detail) {
        let place = place(self.surface, &self.path, self.position);
        let (step, head) = place.seen_from_above(place.position, self.up);
        let detail = Detail::new(self.split);
        let view = View {
            root: &step.block,
            head,
            levels: self.up + self.more,
            live_from: 0,
            prefetch_from: 0,
            detail,
            frusta: None,
        };
        let root = step.block.corner;
        let mut tiles = PartlyReady {
            share: self.share,
            salt: self.path.root[0],
            budget: self.budget,
            root_level: root.level,
        };
        let mut selection = Selection::default();
        selection.select(&self.surface, &view, &mut tiles);
        (selection, root, detail)
    }
}

/// The tile's place in the nine: coordinates in its own size from the corner of the first of the nine.
fn coordinates(root: Corner, tile: &Drawn) -> (i64, i64) {
    let one =
        |v: u32, r: u32| i64::from(v.wrapping_sub(r.wrapping_sub(1).wrapping_shl(tile.level as u32)) as i32);
    (one(tile.corner.x, root.x), one(tile.corner.z, root.z))
}

/// Level of the drawn tile that covers a cell, if that is not split further.
fn cover(drawn: &HashSet<(usize, i64, i64)>, mut level: usize, mut x: i64, mut z: i64) -> Option<usize> {
    loop {
        if drawn.contains(&(level, x, z)) {
            return Some(level);
        }
        if level == 0 {
            return None;
        }
        (level, x, z) = (level - 1, x >> 1, z >> 1);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, ..ProptestConfig::default() })]

    #[test]
    fn drawn_tiles_cover_the_window_once_and_touch_within_a_level(viewer in viewer()) {
        let (selection, root, _) = viewer.select();
        let set: HashSet<_> = selection.drawn.iter().map(|t| {
            let (x, z) = coordinates(root, t);
            (t.level, x, z)
        }).collect();
        prop_assert_eq!(set.len(), selection.drawn.len(), "a tile is drawn twice");
        let mut area = 0u128;
        for &(level, x, z) in &set {
            prop_assert!((0..3i64 << level).contains(&x) && (0..3i64 << level).contains(&z));
            area += 1u128 << (2 * (24 - level));
            prop_assert!(level == 0 || cover(&set, level - 1, x >> 1, z >> 1).is_none(), "tiles overlap");
            for dz in -1..=1 {
                for dx in -1..=1 {
                    if let Some(l) = cover(&set, level, x + dx, z + dz) {
                        prop_assert!(level - l <= 1, "levels {} and {} touch", level, l);
                    }
                }
            }
        }
        prop_assert_eq!(area, 9u128 << 48, "a gap");
    }

    #[test]
    fn watertight(viewer in viewer(), coarse_mesh in any::<bool>()) {
        let (selection, root, detail) = viewer.select();
        let cells = Cells::new(8).expect("a power of two");
        let stride = if coarse_mesh { 2 } else { 1 };
        let mesh = 8 / stride;
        let finest = viewer.up + viewer.more;
        let place = place(viewer.surface, &viewer.path, viewer.position);
        let (step, head) = place.seen_from_above(place.position, viewer.up);
        let view = View { root: &step.block, head, levels: finest, live_from: 0, prefetch_from: 0, detail, frusta: None };
        // Patches of the drawn tiles: the selection does not keep them, so walk down to each.
        let patches = patches(&viewer.surface, &view, root, &selection.drawn);
        let set: HashSet<_> = patches.keys().copied().collect();
        let mut seen: HashMap<(i64, i64), f64> = HashMap::new();
        for t in &selection.drawn {
            let (tx, tz) = coordinates(root, t);
            let patch = &patches[&(t.level, tx, tz)];
            let tile = Tile::of(&viewer.surface, patch, cells);
            let size = 1.0 / f64::from(1u32 << t.level);
            // Height over the head, in the nine's tiles.
            let y = |i: usize, j: usize| {
                let (fine, coarse) = morph::vertex(&tile, stride, i, j);
                let rise = patch.plane.rise((i * stride) as i64, (j * stride) as i64) as f64;
                let height = |r: f64| (rise + r) / 65_536.0 / 8.0;
                let (u, v) = (i as f64 / mesh as f64, j as f64 / mesh as f64);
                let d = (DVec3::new(u, height(f64::from(fine)), v) - t.head).length();
                let weight = t.corners.weight([u, v], detail.weight(d));
                let r = f64::from(fine) + weight * (f64::from(coarse) - f64::from(fine));
                (height(r) - t.head.y) * size
            };
            let unit = 1i64 << (finest - t.level);
            let steep = 1.0 + patch.plane.slope()[0].abs() + patch.plane.slope()[1].abs();
            let tolerance = 1e-10 * steep;
            for k in 0..=mesh {
                for (i, j) in [(k, 0), (k, mesh), (0, k), (mesh, k)] {
                    let key = ((tx * mesh as i64 + i as i64) * unit, (tz * mesh as i64 + j as i64) * unit);
                    let here = y(i, j);
                    let there = *seen.entry(key).or_insert(here);
                    prop_assert!((here - there).abs() <= tolerance, "{here} and {there} at {key:?} of level {}", t.level);
                }
            }
            // Beside a coarser tile, the odd vertices lie on its segments.
            for (dx, dz) in [(-1, 0), (1, 0), (0, -1), (0, 1)] {
                let coarser = cover(&set, t.level, tx + dx, tz + dz).is_some_and(|l| l < t.level);
                if !coarser {
                    continue;
                }
                for k in (1..mesh).step_by(2) {
                    let at = |k: usize| match (dx, dz) {
                        (-1, 0) => y(0, k),
                        (1, 0) => y(mesh, k),
                        (0, -1) => y(k, 0),
                        _ => y(k, mesh),
                    };
                    let mean = 0.5 * (at(k - 1) + at(k + 1));
                    prop_assert!((at(k) - mean).abs() <= tolerance, "a crack of {}", at(k) - mean);
                }
            }
        }
    }

    #[test]
    fn a_tile_that_splits_shows_what_it_showed(split in 2.0f64..4.0, distance in 0.0f64..20.0) {
        let detail = Detail::new(split);
        // A tile about to split has its farthest point a diagonal beyond the splitting distance.
        prop_assert!(detail.weight(split + std::f64::consts::SQRT_2) == 0.0);
        // Its children begin at twice the distance in their own sizes.
        prop_assert!(detail.weight(2.0 * split) == 1.0);
        prop_assert!(detail.weight(distance) <= detail.weight(distance + 0.1));
    }
}

/// The patch of each drawn tile, by level and coordinates.
fn patches(
    surface: &Surface,
    view: &View<'_>,
    root: Corner,
    drawn: &[Drawn],
) -> HashMap<(usize, i64, i64), Patch> {
    let mut known: HashMap<(usize, i64, i64), Patch> = HashMap::new();
    for j in 0..3 {
        for i in 0..3 {
            known.insert((0, i, j), view.root.patch(i as i32 - 1, j as i32 - 1).0);
        }
    }
    let wanted: HashSet<_> = drawn
        .iter()
        .map(|t| {
            let (x, z) = coordinates(root, t);
            (t.level, x, z)
        })
        .collect();
    let mut ancestors = wanted.clone();
    for &(level, x, z) in &wanted {
        (0..level).for_each(|l| {
            ancestors.insert((l, x >> (level - l), z >> (level - l)));
        });
    }
    let mut order: Vec<_> = ancestors.iter().copied().collect();
    order.sort_unstable();
    for (level, x, z) in order {
        let patch = known[&(level, x, z)];
        if !wanted.contains(&(level, x, z)) {
            for (q, (child, _)) in patch.children(surface).into_iter().enumerate() {
                known.insert((level + 1, 2 * x + (q as i64 & 1), 2 * z + (q as i64 >> 1)), child);
            }
        }
    }
    known.retain(|key, _| wanted.contains(key));
    known
}

/// A pool with room for what the derivation says.
struct Pooled {
    pool: Pool,
    refused: usize,
}

impl Tiles for Pooled {
    fn ready(&mut self, tile: Corner) -> Option<Slot> {
        self.pool.want(tile)
    }

    fn make(&mut self, patch: &Patch, _: bool) -> Option<Slot> {
        let slot = self.pool.assign(patch.corner);
        self.refused += usize::from(slot.is_none());
        let slot = slot?;
        self.pool.mark_ready(slot);
        Some(slot)
    }
}

#[test]
fn the_pool_is_large_enough_for_any_flight() {
    let surface = canyonlands();
    for (split, levels) in [(2.0, 8), (2.6, 12), (3.2, 10)] {
        let detail = Detail::new(split);
        let mut tiles = Pooled { pool: Pool::new(slots_needed(&detail, levels)), refused: 0 };
        let mut selection = Selection::default();
        let mut place = support::place(surface, &steered(40), [0.5, 1.0, 0.5]);
        for frame in 0..400u32 {
            let noise = |k: u32| f64::from(hash::noise(u64::from(k), frame, 0, 0)) / 32_768.0;
            place.walk(DVec3::new(0.3 * noise(1), 0.1 * noise(2), 0.3 * noise(3)));
            place.position.y = place.position.y.clamp(0.2, 2.0);
            let (step, head) = place.seen_from_above(place.position, levels - 2);
            let view = View {
                root: &step.block,
                head,
                levels,
                live_from: 0,
                prefetch_from: 0,
                detail,
                frusta: None,
            };
            tiles.pool.begin_frame();
            selection.select(&surface, &view, &mut tiles);
            assert_eq!(selection.counts.waiting, 0, "split {split}, frame {frame}");
        }
        assert_eq!(tiles.refused, 0);
    }
}

#[test]
fn a_slot_that_the_frame_wants_is_never_given_away() {
    let mut pool = Pool::new(4);
    let corner = |x| Corner { level: 1, x, z: 0 };
    pool.begin_frame();
    let slots: Vec<_> = (0..4).map(|x| pool.assign(corner(x)).expect("free")).collect();
    slots.iter().for_each(|&slot| pool.mark_ready(slot));
    assert_eq!(pool.assign(corner(9)), None, "all four are wanted in this frame");
    pool.begin_frame();
    assert_eq!(pool.want(corner(2)), Some(slots[2]));
    assert_eq!(pool.want(corner(0)), Some(slots[0]));
    pool.begin_frame();
    assert_eq!(pool.want(corner(2)), Some(slots[2]));
    let taken = pool.assign(corner(9)).expect("three are not wanted");
    assert!(taken == slots[1] || taken == slots[3], "those were wanted least recently");
    assert_eq!(pool.want(corner(9)), None, "not ready yet");
    assert_eq!(pool.resident(), 4);
    pool.clear();
    assert_eq!((pool.resident(), pool.want(corner(2))), (0, None));
}

fn canyonlands() -> Surface {
    use fathomless::terrain::{Scheme, Terrace};
    Surface {
        seed: 1,
        scheme: Scheme::Cubic,
        amplitude: 29_491,
        terrace: Terrace::new(4, 0.6, 0.2),
        only: None,
    }
}

fn steered(levels: usize) -> support::Path {
    support::Path { root: [0, 0], steered: levels, wild: 0, digits: Vec::new() }
}
