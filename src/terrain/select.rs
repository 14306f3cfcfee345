//! Which tiles to draw from here: one selection per frame, for both eyes.
//!
//! Three trees, each a part of the one before:
//! 1. *wanted*: from the nine tiles of a block, every tile nearer than `split` tile sizes is split; then more are
//!    split until tiles that touch (corners included) differ by at most one level;
//! 2. *resident*: missing tiles are asked for, those most missed on screen first, as far as the budget goes;
//! 3. *drawn*: from the top, a tile is split if that is wanted, its four children are ready, and its eight
//!    neighbours of the same level are drawn or split. So the drawn tiles cover everything exactly once and
//!    touching tiles differ by at most one level, whatever was ready.
//!
//! Nodes are recomputed as the selection walks: nothing is cached, nothing is allocated once the buffers have
//! grown, and the cost does not depend on depth.

use super::block::Block;
use super::morph::{Corners, Detail, Touch};
use super::patch::Patch;
use super::pool::Slot;
use super::surface::{Corner, Surface};
use glam::{DVec3, Vec3};
use std::cmp::Ordering;

/// Most levels that a window can have.
pub const MOST_LEVELS: usize = 24;

/// Where one selection looks from.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The nine tiles to begin with.
    pub root: &'a Block,
    /// Middle of the head, from the corner of the block's plane, in the block's tiles; y is up.
    pub head: DVec3,
    /// Levels finer than the block's that may be drawn, 1..=[`MOST_LEVELS`].
    pub levels: usize,
    /// Levels below the block's from which tiles are drawn; coarser ones are left to the backdrop, and their
    /// places stay empty. 0: everything is drawn.
    pub live_from: usize,
    /// Levels below the block's from which tiles are asked for, at most `live_from`: those above it are not drawn yet.
    pub prefetch_from: usize,
    /// When tiles split.
    pub detail: Detail,
    /// What the eyes see; a tile outside all of them is not drawn. None: everything is drawn.
    pub frusta: Option<[Frustum; 2]>,
}

/// What an eye sees: four planes through the eye.
#[derive(Clone, Copy, Debug)]
pub struct Frustum {
    /// The eye, from the middle of the head, in tiles of the view's block.
    pub eye: Vec3,
    /// Normals of the planes, pointing inwards.
    pub normals: [Vec3; 4],
}

/// Where the tiles are: answers for slots, and makes missing tiles as far as it will.
pub trait Tiles {
    /// The slot of a tile that can be drawn. The tile counts as wanted.
    fn ready(&mut self, tile: Corner) -> Option<Slot>;
    /// Asks for a missing tile; its slot if it can be drawn in this very frame. `needed`: nothing could stand in for
    /// it, so it is to be made whatever it takes.
    fn make(&mut self, patch: &Patch, needed: bool) -> Option<Slot>;
    /// Whether a tile that will be wanted soon is to be made in this frame already, by [`Tiles::make_ahead`].
    fn foresee(&mut self, _tile: Corner) -> bool {
        false
    }
    /// Makes such a tile.
    fn make_ahead(&mut self, _patch: &Patch) {}
}

/// A tile to draw.
#[derive(Clone, Copy, Debug)]
pub struct Drawn {
    /// The tile.
    pub corner: Corner,
    /// Levels below the view's block.
    pub level: usize,
    /// Where its contents are.
    pub slot: Slot,
    /// What its corners touch.
    pub corners: Corners,
    /// The head, from the corner of the tile's plane, in tiles of its size.
    pub head: DVec3,
    /// Rise over run of the tile's plane along x and z.
    pub slope: [f32; 2],
    /// Height of the plane's corner mod 2³², in 1/65 536 tile.
    pub c: u32,
    /// Number of its node, for [`Selection::patch`] and [`Selection::heights`].
    pub node: u32,
}

/// What a selection came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Nodes of the wanted tree.
    pub nodes: usize,
    /// Drawn tiles in all directions.
    pub covering: usize,
    /// Drawn tiles in view.
    pub drawn: usize,
    /// Tiles asked for and granted.
    pub made: usize,
    /// Tiles asked for and not granted yet.
    pub waiting: usize,
    /// Those of them that are not to be drawn yet, apart.
    pub soon: usize,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    patch: Patch,
    head: DVec3,
    /// Distance to the bounding box, in tiles of this size.
    distance: f32,
    low: f32,
    high: f32,
    parent: u32,
    /// First of four children; 0 if not split in the wanted tree.
    children: u32,
    slot: Slot,
    quadrant: u8,
    level: u8,
    drawn_split: bool,
}

const NO_SLOT: Slot = Slot::MAX;
/// The slot of a tile that the backdrop shows.
const ELSEWHERE: Slot = Slot::MAX - 1;

/// What lies beside a node.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Beside {
    /// A node of the same level.
    Node(u32),
    /// Part of a coarser leaf.
    Coarser,
    /// Beyond the nine tiles.
    Outside,
}

/// The eight directions.
const AROUND: [[i32; 2]; 8] = [[-1, -1], [0, -1], [1, -1], [-1, 0], [1, 0], [-1, 1], [0, 1], [1, 1]];

/// The three of [`AROUND`] at each corner (0,0), (1,0), (0,1), (1,1).
const AT_CORNER: [[usize; 3]; 4] = [[0, 1, 3], [1, 2, 4], [3, 5, 6], [4, 6, 7]];

/// The buffers of a selection, kept from frame to frame.
#[derive(Debug, Default)]
pub struct Selection {
    nodes: Vec<Node>,
    by_level: Vec<Vec<u32>>,
    missing: Vec<(f32, u32)>,
    /// Leaves that will be split soon, and how near they are.
    foreseen: Vec<(f32, u32)>,
    /// The tiles to draw, nearest levels first.
    pub drawn: Vec<Drawn>,
    /// What the last selection came to.
    pub counts: Counts,
}

impl Selection {
    /// Selects the tiles to draw; they are in [`Selection::drawn`] then.
    pub fn select(&mut self, surface: &Surface, view: &View<'_>, tiles: &mut impl Tiles) {
        self.counts = Counts::default();
        self.want(surface, view);
        self.balance(surface);
        self.reside(view, tiles);
        self.draw(view);
        self.counts.nodes = self.nodes.len();
    }

    /// Asks for what will be wanted when the head has moved on by `by` (in the block's tiles): the children of leaves that
    /// are to be split then, the nearest first. Call it after [`Selection::select`]: what is wanted now comes first.
    pub fn foresee(&mut self, surface: &Surface, view: &View<'_>, by: DVec3, tiles: &mut impl Tiles) {
        let split = view.detail.split as f32;
        self.foreseen.clear();
        for (index, node) in self.nodes.iter().enumerate() {
            let level = usize::from(node.level);
            let is_leaf = node.children == 0 && (view.prefetch_from..view.levels).contains(&level);
            let moved = node.head + by * (1u64 << level) as f64;
            if is_leaf && distance(moved, node.low.into(), node.high.into()) < split {
                self.foreseen.push((node.distance, index as u32));
            }
        }
        self.foreseen.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for &(_, index) in &self.foreseen {
            let patch = &self.nodes[index as usize].patch;
            let is_due =
                [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, z)| tiles.foresee(patch.corner.child(x, z)));
            if is_due.contains(&true) {
                let children = patch.children(surface);
                let due = children.iter().zip(is_due).filter(|(_, is_due)| *is_due);
                due.for_each(|((child, _), _)| tiles.make_ahead(child));
            }
        }
    }

    /// The patch of a tile of [`Selection::drawn`].
    pub fn patch(&self, drawn: &Drawn) -> &Patch {
        &self.nodes[drawn.node as usize].patch
    }

    /// Bottom and top of the bounding box of a tile of [`Selection::drawn`], over its plane's corner, in tiles of its
    /// size.
    pub fn heights(&self, drawn: &Drawn) -> [f32; 2] {
        let node = &self.nodes[drawn.node as usize];
        [node.low, node.high]
    }

    /// From the head to the bounding box of a tile of [`Selection::drawn`], in tiles of its size.
    pub fn distance(&self, drawn: &Drawn) -> f32 {
        self.nodes[drawn.node as usize].distance
    }

    /// True if one of the tiles of the same level that touch a tile of [`Selection::drawn`] is nearer than so many of their
    /// sizes.
    pub fn touches_nearer(&self, drawn: &Drawn, distance: f32) -> bool {
        AROUND.iter().any(|&direction| match self.beside::<true>(drawn.node, direction) {
            Beside::Node(node) => self.nodes[node as usize].distance < distance,
            Beside::Coarser | Beside::Outside => false,
        })
    }

    /// Tree 1, by distance alone.
    fn want(&mut self, surface: &Surface, view: &View<'_>) {
        self.nodes.clear();
        self.by_level.resize_with(MOST_LEVELS + 1, Vec::new);
        self.by_level.iter_mut().for_each(Vec::clear);
        let bounds = surface.bounds();
        for j in -1..=1 {
            for i in -1..=1 {
                let (patch, rise) = view.root.patch(i, j);
                let corner = DVec3::new(f64::from(i), rise as f64 / 65_536.0, f64::from(j));
                self.add(patch, view.head - corner, bounds, 0, 0, 0);
            }
        }
        let split = view.detail.split as f32;
        let mut next = 0;
        while next < self.nodes.len() {
            let node = &self.nodes[next];
            if node.distance < split && usize::from(node.level) < view.levels {
                self.split(surface, bounds, next as u32);
            }
            next += 1;
        }
    }

    fn add(&mut self, patch: Patch, head: DVec3, bounds: (f64, f64), parent: u32, quadrant: u8, level: u8) {
        let range = patch.range(bounds);
        self.by_level[usize::from(level)].push(self.nodes.len() as u32);
        self.nodes.push(Node {
            patch,
            head,
            distance: distance(head, range.low, range.high),
            low: range.low as f32,
            high: range.high as f32,
            parent,
            children: 0,
            slot: NO_SLOT,
            quadrant,
            level,
            drawn_split: false,
        });
    }

    fn split(&mut self, surface: &Surface, bounds: (f64, f64), index: u32) {
        let node = self.nodes[index as usize];
        self.nodes[index as usize].children = self.nodes.len() as u32;
        for (q, (patch, rise)) in node.patch.children(surface).into_iter().enumerate() {
            let (qx, qz) = ((q & 1) as i64, (q >> 1) as i64);
            let climb = (node.patch.plane.rise(qx, qz) + rise) as f64 / 65_536.0;
            let head = 2.0 * node.head - DVec3::new(qx as f64, climb, qz as f64);
            self.add(patch, head, bounds, index, q as u8, node.level + 1);
        }
    }

    /// What lies beside a node in the wanted tree, or in the drawn one.
    fn beside<const DRAWN: bool>(&self, index: u32, [dx, dz]: [i32; 2]) -> Beside {
        let node = &self.nodes[index as usize];
        if node.level == 0 {
            let (x, z) = (index as i32 % 3 + dx, index as i32 / 3 + dz);
            let inside = (0..3).contains(&x) && (0..3).contains(&z);
            return if inside { Beside::Node((z * 3 + x) as u32) } else { Beside::Outside };
        }
        let x = i32::from(node.quadrant & 1) + dx;
        let z = i32::from(node.quadrant >> 1) + dz;
        let quadrant = ((z & 1) * 2 + (x & 1)) as u32;
        let up = [x >> 1, z >> 1];
        let above =
            if up == [0, 0] { Beside::Node(node.parent) } else { self.beside::<DRAWN>(node.parent, up) };
        let Beside::Node(parent) = above else {
            return above;
        };
        let parent = &self.nodes[parent as usize];
        let split = if DRAWN { parent.drawn_split } else { parent.children != 0 };
        if split { Beside::Node(parent.children + quadrant) } else { Beside::Coarser }
    }

    /// Splits more nodes until nodes that touch differ by at most one level.
    ///
    /// From the finest level up: each split node needs its eight neighbours to exist. A node made here is of a
    /// coarser level, whose turn is still to come.
    fn balance(&mut self, surface: &Surface) {
        let bounds = surface.bounds();
        for level in (1..=MOST_LEVELS).rev() {
            for i in 0..self.by_level[level].len() {
                let index = self.by_level[level][i];
                if self.nodes[index as usize].children == 0 {
                    continue;
                }
                for direction in AROUND {
                    if self.beside::<false>(index, direction) == Beside::Coarser {
                        self.bring_about(surface, bounds, index, direction);
                    }
                }
            }
        }
    }

    /// Splits until the node beside `index` exists, and returns it.
    fn bring_about(
        &mut self,
        surface: &Surface,
        bounds: (f64, f64),
        index: u32,
        [dx, dz]: [i32; 2],
    ) -> Beside {
        let node = &self.nodes[index as usize];
        if node.level == 0 {
            return self.beside::<false>(index, [dx, dz]);
        }
        let x = i32::from(node.quadrant & 1) + dx;
        let z = i32::from(node.quadrant >> 1) + dz;
        let quadrant = ((z & 1) * 2 + (x & 1)) as u32;
        let parent = node.parent;
        let above = match [x >> 1, z >> 1] {
            [0, 0] => Beside::Node(parent),
            up => self.bring_about(surface, bounds, parent, up),
        };
        let Beside::Node(parent) = above else {
            return above;
        };
        if self.nodes[parent as usize].children == 0 {
            self.split(surface, bounds, parent);
        }
        Beside::Node(self.nodes[parent as usize].children + quadrant)
    }

    /// Tree 2: finds the wanted tiles' slots, and asks for those that have none.
    fn reside(&mut self, view: &View<'_>, tiles: &mut impl Tiles) {
        self.missing.clear();
        for index in 0..self.nodes.len() {
            let level = usize::from(self.nodes[index].level);
            if level < view.live_from {
                self.nodes[index].slot = ELSEWHERE;
            }
            if level < view.prefetch_from {
                continue;
            }
            match tiles.ready(self.nodes[index].patch.corner) {
                Some(slot) if level >= view.live_from => self.nodes[index].slot = slot,
                Some(_) => {}
                None => {
                    let node = &self.nodes[index];
                    // A tile's error on the screen is as its size over its distance; behind the back it counts less.
                    let behind = if visible(node, view) { 1.0 } else { 4.0 };
                    let missed = match level.cmp(&view.live_from) {
                        // Nothing would be there.
                        Ordering::Equal => 0.0,
                        Ordering::Greater => (node.distance + 0.01) * behind,
                        // For later, the outermost first.
                        Ordering::Less => f32::MAX * (0.5 + level as f32 / (2 * MOST_LEVELS) as f32),
                    };
                    self.missing.push((missed, index as u32));
                }
            }
        }
        self.missing.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for &(missed, index) in &self.missing {
            let node = &mut self.nodes[index as usize];
            match tiles.make(&node.patch, missed == 0.0) {
                Some(slot) => {
                    if node.slot == NO_SLOT {
                        node.slot = slot;
                    }
                    self.counts.made += 1;
                }
                None if node.slot == NO_SLOT => self.counts.waiting += 1,
                None => self.counts.soon += 1,
            }
        }
    }

    /// Tree 3, and its leaves as tiles to draw.
    fn draw(&mut self, view: &View<'_>) {
        self.drawn.clear();
        for level in 0..MOST_LEVELS {
            for i in 0..self.by_level[level].len() {
                let index = self.by_level[level][i];
                self.nodes[index as usize].drawn_split = self.may_split(index);
            }
        }
        for level in (0..=view.levels).rev() {
            for i in 0..self.by_level[level].len() {
                let index = self.by_level[level][i];
                let node = &self.nodes[index as usize];
                let to_draw = node.slot != NO_SLOT && node.slot != ELSEWHERE;
                if node.drawn_split || !self.in_drawn_tree(node) || !to_draw {
                    continue;
                }
                self.counts.covering += 1;
                if !visible(node, view) {
                    continue;
                }
                let corners = self.corners(index);
                let node = &self.nodes[index as usize];
                self.drawn.push(Drawn {
                    corner: node.patch.corner,
                    level,
                    slot: node.slot,
                    corners,
                    head: node.head,
                    slope: node.patch.plane.slope().map(|s| s as f32),
                    c: node.patch.plane.c,
                    node: index,
                });
            }
        }
        self.counts.drawn = self.drawn.len();
    }

    fn in_drawn_tree(&self, node: &Node) -> bool {
        node.level == 0 || self.nodes[node.parent as usize].drawn_split
    }

    fn may_split(&self, index: u32) -> bool {
        let node = &self.nodes[index as usize];
        if node.children == 0 || !self.in_drawn_tree(node) {
            return false;
        }
        let children = &self.nodes[node.children as usize..node.children as usize + 4];
        children.iter().all(|child| child.slot != NO_SLOT)
            && AROUND.iter().all(|&d| self.beside::<true>(index, d) != Beside::Coarser)
    }

    fn corners(&self, index: u32) -> Corners {
        let around = AROUND.map(|d| match self.beside::<true>(index, d) {
            Beside::Outside => Touch::Same,
            Beside::Coarser => Touch::Coarser,
            Beside::Node(n) if self.nodes[n as usize].drawn_split => Touch::Finer,
            Beside::Node(_) => Touch::Same,
        });
        Corners::pack(AT_CORNER.map(|three| {
            three.into_iter().map(|d| around[d]).find(|&touch| touch != Touch::Same).unwrap_or(Touch::Same)
        }))
    }
}

/// From the head to a tile's box from `low` to `high`, in tiles.
fn distance(head: DVec3, low: f64, high: f64) -> f32 {
    let beyond = |v: f64, low: f64, high: f64| (low - v).max(v - high).max(0.0);
    let (x, y, z) = (beyond(head.x, 0.0, 1.0), beyond(head.y, low, high), beyond(head.z, 0.0, 1.0));
    (x * x + y * y + z * z).sqrt() as f32
}

/// False if the tile's box lies outside a plane of each eye.
fn visible(node: &Node, view: &View<'_>) -> bool {
    let Some(frusta) = &view.frusta else {
        return true;
    };
    let unit = (1u64 << node.level) as f32;
    let low = Vec3::new(-node.head.x as f32, node.low - node.head.y as f32, -node.head.z as f32);
    let high = Vec3::new(low.x + 1.0, node.high - node.head.y as f32, low.z + 1.0);
    // A morphing vertex lies on the parent's mesh, and skirts hang below: both within a tile's height or so.
    let (low, high) = (low - Vec3::Y * 0.25, high + Vec3::Y * 0.25);
    frusta.iter().any(|frustum| {
        let eye = frustum.eye * unit;
        frustum.normals.iter().all(|&n| {
            let farthest = Vec3::select(n.cmpge(Vec3::ZERO), high, low);
            n.dot(farthest - eye) >= 0.0
        })
    })
}

/// Slots that a selection can want at once, with the tiles that frames in flight still hold.
///
/// A disc of radius k (in tiles) meets πk² + 4k + 1 tiles on average; those are split, so four times as many
/// are wanted at the next level. A fifth more for the balance and the worst alignment, a quarter more for
/// tiles of the frames before. `tests/select.rs` checks it over random flights.
pub fn slots_needed(detail: &Detail, levels: usize) -> u32 {
    let k = detail.split;
    let split = 1.2 * (std::f64::consts::PI * k * k + 4.0 * k + 1.0);
    let per_level = (4.0 * split).ceil() as u32;
    // The first levels are only so large: 9, 36, 144, ...
    let nodes: u32 =
        (0..=levels as u32).map(|l| per_level.min(9u32.saturating_mul(4u32.saturating_pow(l)))).sum();
    nodes + nodes / 4
}
