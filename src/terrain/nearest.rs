//! The ground nearest to a point, and the ground that a ray meets: exact searches of the quadtree.
//!
//! Both are branch and bound, best first: a tile's box, and the slab between two planes that its ground stays in, say how
//! near that ground can be at best, so tiles are opened in that order until nothing nearer can come. Tiles are
//! recomputed from the path as the search descends, as the selection does: nothing is cached, nothing is allocated once
//! the buffers have grown, and depth does not matter.
//!
//! The ground is the limit of all levels to come, not the mesh of any one of them.

use super::block::Block;
use super::patch::{Patch, Range};
use super::place::Place;
use super::surface::{Scheme, Surface};
use glam::DVec3;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// How near to the ground, in distances from its origin, a ray has met it.
pub const RAY_TOLERANCE: f64 = 1.0 / 1024.0;

/// Levels above the anchor at which a search begins: its nine tiles reach 3 anchor tiles to every side, as a rule.
const FIRST_UP: usize = 2;

/// Levels that a search which has not come to an end goes further up.
const MORE_UP: usize = 3;

/// Levels below its first tiles at which a search ends: there a point is on the ground as far as `f64` can tell.
const MOST_DOWN: u32 = 60;

/// A guess is followed to tiles of this share of its length; from there on the best way is taken.
const GUESS_TO: f64 = 1.0 / 16.0;

/// The best way is followed down once in so many levels, ...
const POLISH_EVERY: u32 = 2;

/// ... to tiles of this share of its length.
const POLISH_TO: f64 = 1.0 / 1024.0;

/// Most tiles that one search keeps. Only fine tolerances over the roughest worlds need so many, and a point on the ground
/// itself: then `least` is still no greater than the distance, but less by more than the tolerance.
const MOST_NODES: usize = 1 << 16;

/// The ground nearest to a point. Lengths in anchor tiles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// No ground is nearer.
    pub least: f64,
    /// Some ground is as near, or nearer: `least` is less by at most the tolerance's share (near the root of the world,
    /// by more: there the ground beyond the nine tiles around the root counts, as near as it could be).
    pub most: f64,
    /// The end of a way of that length, which the ground cuts or comes as near as.
    pub point: DVec3,
}

/// The buffers of a search, kept from one to the next.
#[derive(Debug, Default)]
pub struct Probe {
    nodes: Vec<Node>,
    /// Nodes yet to be opened, the nearest first: the bits of a distance of 0 or more sort as it does.
    queue: BinaryHeap<Reverse<(u64, u32)>>,
    /// Nodes that the last search looked at.
    looked_at: usize,
}

/// A tile that may hold what is looked for.
#[derive(Clone, Copy, Debug)]
struct Node {
    patch: Patch,
    /// Where the search is from, counted from the corner of the tile's plane, in tiles of its size.
    from: DVec3,
    /// Levels below the first tiles.
    level: u32,
}

impl Probe {
    /// Tiles that the last search looked at.
    pub fn looked_at(&self) -> usize {
        self.looked_at
    }

    /// The ground nearest to a position (in anchor tiles, within a few of the anchor), to a `tolerance` of its
    /// distance, above 0 and below 1. The cost grows as the tolerance shrinks.
    pub fn nearest(&mut self, place: &Place, position: DVec3, tolerance: f64) -> Nearest {
        self.nearest_near(place, position, tolerance, DVec3::NEG_Y)
    }

    /// The same with a guess of where that is, from the position. A good one, as a frame has from the one before, makes
    /// [`Nearest::most`] better than the tolerance, and steady from frame to frame.
    pub fn nearest_near(&mut self, place: &Place, position: DVec3, tolerance: f64, guess: DVec3) -> Nearest {
        let surface = place.spine.surface();
        self.looked_at = 0;
        let mut up = FIRST_UP.min(place.level());
        loop {
            let (step, from) = place.seen_from_above(position, up);
            let unit = (up as f64).exp2();
            let reach = reach(from);
            let wanted = Wanted { reach, tolerance, guess: guess / unit };
            let (least, best) = self.nearest_of_nine(surface, (&step.block, from), &wanted);
            if least <= reach || up == place.level() {
                return Nearest {
                    least: least.min(beyond(surface, from, reach)) * unit,
                    most: best.most * unit,
                    point: position + best.way * unit,
                };
            }
            up = (up + MORE_UP).min(place.level());
        }
    }

    /// The ground of nine tiles, in their size: how near it is at the least, and the best way there. The search is
    /// given up once that is known to be out of reach.
    fn nearest_of_nine(
        &mut self,
        surface: &Surface,
        (block, from): (&Block, DVec3),
        &Wanted { reach, tolerance, guess }: &Wanted,
    ) -> (f64, Way) {
        let mut best = Way { most: f64::INFINITY, way: DVec3::ZERO };
        self.begin();
        follow(surface, (block, from), guess, &mut best);
        for (patch, from) in nine(block, from) {
            self.add_near(surface, Node { patch, from, level: 0 }, &mut best);
        }
        let mut unsettled_level = 1;
        while let Some(Reverse((least, index))) = self.queue.pop() {
            let least = f64::from_bits(least);
            let node = self.nodes[index as usize];
            let settled = least >= best.most * (1.0 - tolerance) || least > reach;
            if settled || node.level >= MOST_DOWN || self.nodes.len() > MOST_NODES {
                return (least, best);
            }
            if node.level == unsettled_level {
                // A way that is known well settles the rest sooner.
                unsettled_level += POLISH_EVERY;
                polish(surface, node, &mut best);
            }
            for (patch, from) in four(surface, &node.patch, node.from) {
                self.add_near(surface, Node { patch, from, level: node.level + 1 }, &mut best);
            }
        }
        // Some child of a tile that holds the nearest ground is as near as the best way; but for rounding.
        (best.most * (1.0 - tolerance), best)
    }

    fn add_near(&mut self, surface: &Surface, node: Node, best: &mut Way) {
        self.looked_at += 1;
        let bracket = node.bracket(surface);
        best.improve(&bracket);
        if bracket.least <= best.most {
            self.push(bracket.least, node);
        }
    }

    /// How far along a ray from `origin` (in anchor tiles, within a few of the anchor) the ground is met first: no
    /// farther than it is, and there the ground is within [`RAY_TOLERANCE`] of that distance above or below the ray. So
    /// a ray that only just misses a summit meets it. `direction` is a unit vector.
    ///
    /// None if the ground is not met within `range` anchor tiles, or beyond the nine tiles around the root. The cost
    /// grows with the range's logarithm, and with how closely the ray follows the ground.
    pub fn ray(&mut self, place: &Place, origin: DVec3, direction: DVec3, range: f64) -> Option<f64> {
        let surface = place.spine.surface();
        self.looked_at = 0;
        let mut up = FIRST_UP.min(place.level());
        let mut clear = 0.0;
        loop {
            let (step, from) = place.seen_from_above(origin, up);
            let unit = (up as f64).exp2();
            // So far it stays over the nine tiles; what is beyond them is for the next search.
            let inside = leaves(from.x, direction.x).min(leaves(from.z, direction.z)).min(range / unit);
            let ray = Ray { direction, from: clear / unit, to: inside };
            if let Some(distance) = self.first_of_nine(surface, &step.block, from, &ray) {
                return Some(distance * unit);
            }
            clear = inside * unit;
            if clear >= range || up == place.level() {
                return None;
            }
            up = (up + MORE_UP).min(place.level());
        }
    }

    fn first_of_nine(&mut self, surface: &Surface, block: &Block, from: DVec3, ray: &Ray) -> Option<f64> {
        self.begin();
        for (patch, from) in nine(block, from) {
            self.add_met(surface, Node { patch, from, level: 0 }, ray);
        }
        while let Some(Reverse((met, index))) = self.queue.pop() {
            let met = f64::from_bits(met);
            let node = self.nodes[index as usize];
            let slab = slab(surface, &node.patch);
            let thin = (slab.high - slab.low) * node.unit() <= RAY_TOLERANCE * met;
            if thin || node.level >= MOST_DOWN || self.nodes.len() > MOST_NODES {
                return Some(met);
            }
            for (patch, from) in four(surface, &node.patch, node.from) {
                self.add_met(surface, Node { patch, from, level: node.level + 1 }, ray);
            }
        }
        None
    }

    fn add_met(&mut self, surface: &Surface, node: Node, ray: &Ray) {
        self.looked_at += 1;
        if let Some(met) = ray.meets(surface, &node) {
            self.push(met, node);
        }
    }

    fn begin(&mut self) {
        self.nodes.clear();
        self.queue.clear();
    }

    fn push(&mut self, distance: f64, node: Node) {
        self.queue.push(Reverse((distance.to_bits(), self.nodes.len() as u32)));
        self.nodes.push(node);
    }
}

impl Node {
    /// Its size in first tiles.
    fn unit(&self) -> f64 {
        (-f64::from(self.level)).exp2()
    }
}

/// What a search for the nearest ground is to come to, in first tiles.
struct Wanted {
    reach: f64,
    tolerance: f64,
    guess: DVec3,
}

/// Looks where the guess is.
fn follow(surface: &Surface, (block, from): (&Block, DVec3), guess: DVec3, best: &mut Way) {
    let target = from + guess;
    let (i, k) = (target.x.floor(), target.z.floor());
    if i.abs() > 1.0 || k.abs() > 1.0 {
        return;
    }
    let (patch, rise) = block.patch(i as i32, k as i32);
    let from = from - DVec3::new(i, rise as f64 / 65_536.0, k);
    let mut node = Node { patch, from, level: 0 };
    let size = GUESS_TO * guess.length();
    while node.unit() > size && node.level < MOST_DOWN {
        let in_tile = node.from + guess / node.unit();
        let quadrant = usize::from(in_tile.x >= 0.5) + 2 * usize::from(in_tile.z >= 0.5);
        let (patch, from) = four(surface, &node.patch, node.from)[quadrant];
        node = Node { patch, from, level: node.level + 1 };
    }
    best.improve(&node.bracket(surface));
    polish(surface, node, best);
}

/// Follows the best way down from a tile.
fn polish(surface: &Surface, mut node: Node, best: &mut Way) {
    while node.unit() > POLISH_TO * best.most && node.level < MOST_DOWN {
        let level = node.level + 1;
        let mut nearest = f64::INFINITY;
        for (patch, from) in four(surface, &node.patch.clone(), node.from) {
            let child = Node { patch, from, level };
            let bracket = child.bracket(surface);
            best.improve(&bracket);
            if bracket.most < nearest {
                (node, nearest) = (child, bracket.most);
            }
        }
    }
}

/// What a tile's ground lies in, counted from its plane point by point, in spacings: on a slope a much thinner body
/// than the tile's box, and thinner than what the vertices of its mesh lie in.
///
/// Without the levels to come the ground would be the limit of the subdivision: within the tile a bilinear patch over
/// its corners, or a bicubic one, which lies in the convex hull of its Bézier points.
fn slab(surface: &Surface, patch: &Patch) -> Range {
    let (down, up) = surface.bounds();
    let (least, most, unit) = match surface.scheme {
        Scheme::Bilinear => {
            let corners = [5, 6, 9, 10].map(|i| patch.r[i]);
            let (least, most) = corners.iter().fold((i32::MAX, i32::MIN), |(l, m), &r| (l.min(r), m.max(r)));
            (least, most, 65_536.0)
        }
        Scheme::Cubic => {
            // Six times the Bézier points of a cubic B-spline, along x and then along z.
            let bezier =
                |a: i32, b: i32, c: i32, d: i32| [a + 4 * b + c, 4 * b + 2 * c, 2 * b + 4 * c, b + 4 * c + d];
            let rows: [[i32; 4]; 4] = std::array::from_fn(|z| {
                let r = &patch.r[4 * z..4 * z + 4];
                bezier(r[0], r[1], r[2], r[3])
            });
            let [a, b, c, d] = rows;
            let (mut least, mut most) = (i32::MAX, i32::MIN);
            for (((a, b), c), d) in a.into_iter().zip(b).zip(c).zip(d) {
                for point in bezier(a, b, c, d) {
                    (least, most) = (least.min(point), most.max(point));
                }
            }
            (least, most, 36.0 * 65_536.0)
        }
    };
    Range { low: f64::from(least) / unit - down, high: f64::from(most) / unit + up }
}

/// The nine tiles of a block, with where `from` is for each.
fn nine(block: &Block, from: DVec3) -> impl Iterator<Item = (Patch, DVec3)> {
    (-1..=1).flat_map(move |j| (-1..=1).map(move |i| (i, j))).map(move |(i, j)| {
        let (patch, rise) = block.patch(i, j);
        (patch, from - DVec3::new(f64::from(i), rise as f64 / 65_536.0, f64::from(j)))
    })
}

/// The four children of a tile, with where `from` is for each.
fn four(surface: &Surface, patch: &Patch, from: DVec3) -> [(Patch, DVec3); 4] {
    let mut quadrant = 0;
    patch.children(surface).map(|(child, rise)| {
        let (qx, qz) = (quadrant & 1, quadrant >> 1);
        quadrant += 1;
        let climb = (patch.plane.rise(qx, qz) + rise) as f64 / 65_536.0;
        (child, 2.0 * from - DVec3::new(qx as f64, climb, qz as f64))
    })
}

/// How far a point is from what lies beyond the nine tiles; negative if it is there itself.
fn reach(from: DVec3) -> f64 {
    let to_edge = |v: f64| (v + 1.0).min(2.0 - v);
    to_edge(from.x).min(to_edge(from.z))
}

/// How far along a ray one of its coordinates leaves −1..=2.
fn leaves(at: f64, by: f64) -> f64 {
    let edge = if by > 0.0 { 2.0 } else { -1.0 };
    if by == 0.0 { f64::INFINITY } else { ((edge - at) / by).max(0.0) }
}

/// No more than the distance to any ground beyond the nine tiles; the root's level is a plain everywhere.
fn beyond(surface: &Surface, from: DVec3, reach: f64) -> f64 {
    let (down, up) = surface.bounds();
    (from.y - up).max(-down - from.y).max(reach).max(0.0)
}

/// A way to the ground, in first tiles.
#[derive(Clone, Copy, Debug)]
struct Way {
    most: f64,
    way: DVec3,
}

impl Way {
    fn improve(&mut self, bracket: &Bracket) {
        if bracket.most < self.most {
            *self = Way { most: bracket.most, way: bracket.way };
        }
    }
}

/// What is known of a tile's distance, in first tiles.
struct Bracket {
    /// No ground of the tile is nearer.
    least: f64,
    /// Some ground of the tile is as near.
    most: f64,
    /// The way there.
    way: DVec3,
}

impl Node {
    fn bracket(&self, surface: &Surface) -> Bracket {
        let (from, unit) = (self.from, self.unit());
        let slab = slab(surface, &self.patch);
        let [gx, gz] = self.patch.plane.slope();
        let over_plane = from.y - gx * from.x - gz * from.z;
        let (over, under) = (over_plane - slab.high, over_plane - slab.low);
        let beyond = |v: f64, low: f64, high: f64| (low - v).max(v - high).max(0.0);
        let (x, z) = (beyond(from.x, 0.0, 1.0), beyond(from.z, 0.0, 1.0));
        let range = on_slope([gx, gz], slab);
        let y = beyond(from.y, range.low, range.high);
        // Cosine of the slope, and its square.
        let square = 1.0 / (1.0 + gx * gx + gz * gz);
        let cosine = square.sqrt();
        let least = (x * x + y * y + z * z).sqrt().max(over.max(-under).max(0.0) * cosine) * unit;
        // The side of the slab that is farther: whoever goes there goes through the ground.
        let through = if over.abs() > under.abs() { over } else { under };
        let foot = |height: f64| [from.x + gx * height * square, from.z + gz * height * square];
        let is_inside = |[x, z]: [f64; 2]| (0.0..=1.0).contains(&x) && (0.0..=1.0).contains(&z);
        if is_inside(foot(over)) && is_inside(foot(under)) {
            let way = DVec3::new(gx, -1.0, gz) * (through * square * unit);
            return Bracket { least, most: through.abs() * cosine * unit, way };
        }
        let [u, v] = foot(over).map(|v| v.clamp(0.0, 1.0));
        let plane = gx * u + gz * v;
        let ends = [plane + slab.low - from.y, plane + slab.high - from.y];
        let y = if ends[0].abs() > ends[1].abs() { ends[0] } else { ends[1] };
        let way = DVec3::new(u - from.x, y, v - from.z) * unit;
        Bracket { least, most: way.length(), way }
    }
}

/// The box of a tile whose ground lies in a slab.
fn on_slope([gx, gz]: [f64; 2], slab: Range) -> Range {
    Range { low: slab.low + gx.min(0.0) + gz.min(0.0), high: slab.high + gx.max(0.0) + gz.max(0.0) }
}

/// A part of a ray, in first tiles.
struct Ray {
    direction: DVec3,
    from: f64,
    to: f64,
}

impl Ray {
    /// Where the ray enters what a tile's ground stays in, in first tiles.
    fn meets(&self, surface: &Surface, node: &Node) -> Option<f64> {
        let slab = slab(surface, &node.patch);
        let [gx, gz] = node.patch.plane.slope();
        let range = on_slope([gx, gz], slab);
        let (from, d, unit) = (node.from, self.direction, node.unit());
        let mut span = (self.from / unit, self.to / unit);
        let mut between = |at: f64, by: f64, low: f64, high: f64| {
            if by == 0.0 {
                if at < low || at > high {
                    span.1 = f64::NEG_INFINITY;
                }
                return;
            }
            let (a, b) = ((low - at) / by, (high - at) / by);
            span = (span.0.max(a.min(b)), span.1.min(a.max(b)));
        };
        between(from.x, d.x, 0.0, 1.0);
        between(from.z, d.z, 0.0, 1.0);
        between(from.y, d.y, range.low, range.high);
        between(from.y - gx * from.x - gz * from.z, d.y - gx * d.x - gz * d.z, slab.low, slab.high);
        (span.0 <= span.1).then_some(span.0 * unit)
    }
}
