//! PURE: what is drawn over the land, as solids and points of lines.

use std::f32::consts::TAU;

use glam::{Quat, Vec3};

use crate::aids::{Aids, HandAid};
use crate::render::layout::{AidPoint, AidSolid};

/// Most solids of a frame, ...
pub(super) const MOST_SOLIDS: usize = 32;

/// ... and most points of lines: `a_frame_with_everything_fits` knows.
pub(super) const MOST_POINTS: usize = 2048;

/// The left and the right hand's: blue and orange, which nearly everybody can tell apart (Okabe and Ito 2008).
const SIDES: [[u8; 3]; 2] = [[86, 180, 233], [230, 159, 0]];
const HANDLE: [u8; 3] = [58, 62, 70];
const HEAD: [u8; 3] = [205, 209, 214];
/// A grab point at rest, and one that holds.
const RESTS: [u8; 3] = [150, 156, 165];
const HOLDS: [u8; 3] = [255, 236, 150];
const RAY: [u8; 3] = [150, 225, 255];
/// Of the same palette: bluish green and vermilion.
const LANDS: [u8; 3] = [0, 200, 150];
const FALLS: [u8; 3] = [240, 100, 20];
const THREAD: [u8; 3] = [255, 205, 95];
const GRID: [u8; 3] = [205, 230, 250];

/// Metres: half the widths of lines.
const RAY_M: f32 = 0.0022;
const ARC_M: f32 = 0.006;
const THREAD_M: f32 = 0.006;
const GRID_M: f32 = 0.003;
const BETWEEN_M: f32 = 0.002;

/// Radians by which a ray's end is seen: its dot's radius.
const DOT: f32 = 0.011;

/// Metres from the seat up to which the floor's grid is clear, and from which on it is gone.
const CLEAR_M: f32 = 3.0;
const FLOOR_M: f32 = 6.0;

/// Metres to the ring at the horizon, and its points.
const HORIZON_M: f32 = 4.0;
const HORIZON_POINTS: usize = 96;

/// Radius in metres of the ring where a step lands, and its points.
const LANDING_M: f32 = 0.3;
const LANDING_POINTS: usize = 32;

/// Parts that a segment of a curve is drawn in.
const PARTS: usize = 4;

/// Metres from the seat at which the thread begins, and is clear: nobody has it in his eyes.
const THREAD_BEGINS_M: [f32; 2] = [0.4, 1.5];

/// Solids and lines, kept from frame to frame for their room.
#[derive(Debug)]
pub(super) struct Draft {
    solids: Vec<AidSolid>,
    points: Vec<AidPoint>,
}

impl Default for Draft {
    fn default() -> Draft {
        Draft { solids: Vec::with_capacity(MOST_SOLIDS), points: Vec::with_capacity(MOST_POINTS) }
    }
}

impl Draft {
    pub(super) fn solids(&self) -> &[AidSolid] {
        &self.solids
    }

    pub(super) fn points(&self) -> &[AidPoint] {
        &self.points
    }

    /// Everything anew.
    pub(super) fn draw(&mut self, aids: &Aids) {
        self.solids.clear();
        self.points.clear();
        self.grid(aids);
        self.thread(aids.thread.as_slice());
        self.arc(aids.arc.as_slice(), aids.arc_lands);
        for (hand, colour) in aids.hands.iter().zip(SIDES) {
            if let Some(hand) = hand {
                if !aids.no_models {
                    self.hand(hand, colour);
                }
                self.ray(hand);
            }
        }
        if let [Some(left), Some(right)] = aids.hands
            && left.holds
            && right.holds
        {
            self.between(left.grip.position, right.grip.position);
        }
    }

    // --- hands -----------------------------------------------------------------------------------------------------

    /// A handle through the closed hand, a head before it with a ring around, and the grab point at its tip.
    fn hand(&mut self, hand: &HandAid, side: [u8; 3]) {
        let grip = hand.grip;
        let at = |x: f32, y: f32, z: f32| grip.position + grip.orientation * Vec3::new(x, y, z);
        self.capsule([at(0.0, 0.0, 0.055), at(0.0, 0.0, -0.015)], [0.0135, 0.0165], HANDLE, 0.0);
        let (head, glow) = if hand.holds { (HOLDS, 0.75) } else { (HEAD, 0.0) };
        self.capsule([at(0.0, 0.0, -0.03), at(0.0, 0.004, -0.046)], [0.0205, 0.0235], head, glow);
        let tilted = grip.orientation * Quat::from_rotation_x(-0.5) * Vec3::NEG_Z;
        self.ring(at(0.0, 0.012, -0.058), tilted, [0.043, 0.0048], side, if hand.holds { 0.8 } else { 0.25 });
        let ahead = hand.ray().map_or(grip.orientation * Vec3::NEG_Z, |(_, direction)| direction);
        let tip = at(0.0, 0.006, -0.045) + 0.05 * ahead;
        let (radius, colour, glow) = if hand.holds { (0.013, HOLDS, 1.0) } else { (0.0085, RESTS, 0.0) };
        self.capsule([tip; 2], [radius; 2], colour, glow);
    }

    /// Thinner and fainter with its length, and a dot where it ends.
    fn ray(&mut self, hand: &HandAid) {
        let (Some((from, direction)), Some(length)) = (hand.ray(), hand.ray_m) else { return };
        if !(length.is_finite() && length > 0.0) {
            return;
        }
        const STEPS: usize = 12;
        for i in 0..=STEPS {
            let share = i as f32 / STEPS as f32;
            let along = length * share * share;
            let alpha = (0.95 / (1.0 + along / 3.0)).max(0.16);
            let width = RAY_M * (1.0 - 0.5 * (along / (along + 2.0)));
            self.point(from + along * direction, width, direction, RAY, alpha);
        }
        self.end_line();
        let end = from + length * direction;
        self.capsule([end; 2], [DOT * length.max(0.5); 2], RAY, 1.0);
    }

    /// What is held between two hands, and its middle, which stays where it is.
    fn between(&mut self, left: Vec3, right: Vec3) {
        let Some(way) = (right - left).try_normalize() else { return };
        for end in [left, right] {
            self.point(end, BETWEEN_M, way, HOLDS, 0.9);
        }
        self.end_line();
        let middle = (left + right) / 2.0;
        self.capsule([middle; 2], [0.007; 2], HOLDS, 1.0);
        // It faces the seat.
        let towards = middle.try_normalize().unwrap_or(Vec3::Z);
        self.ring(middle, towards, [0.022, 0.0022], HOLDS, 1.0);
    }

    // --- ways ------------------------------------------------------------------------------------------------------

    /// A whole line to a ring with an upright where one can stand, a broken line to a cross where one cannot.
    fn arc(&mut self, way: &[Vec3], lands: bool) {
        let [.., end] = way else { return };
        let colour = if lands { LANDS } else { FALLS };
        let mut curve = Curve::new(way);
        let whole = |part: usize| lands || (part / PARTS).is_multiple_of(2);
        let mut part = 0;
        while let Some((at, tangent)) = curve.next() {
            self.point(at, ARC_M, tangent, colour, 0.9);
            if !whole(part) {
                self.end_line();
            }
            part += 1;
        }
        self.end_line();
        // A little above the ground, which is never quite level.
        let end = *end + 0.03 * Vec3::Y;
        if lands {
            self.circle(end, LANDING_M, LANDING_POINTS, (2.0 * ARC_M, LANDS, 0.95));
            self.circle(end, 0.45 * LANDING_M, LANDING_POINTS / 2, (0.8 * ARC_M, LANDS, 0.8));
            for (height, alpha) in [(0.0, 0.9), (0.6, 0.0)] {
                self.point(end + height * Vec3::Y, ARC_M, Vec3::Y, LANDS, alpha);
            }
            self.end_line();
        } else {
            for way in [Vec3::new(1.0, 0.0, 1.0), Vec3::new(1.0, 0.0, -1.0)].map(Vec3::normalize) {
                for side in [-1.0, 1.0] {
                    self.point(end + side * 0.7 * LANDING_M * way, 2.4 * ARC_M, way, FALLS, 0.95);
                }
                self.end_line();
            }
        }
    }

    /// Bright beside the wearer, fainter with every point of the way.
    fn thread(&mut self, way: &[Vec3]) {
        let n_parts = (way.len().saturating_sub(1) * PARTS).max(1) as f32;
        let [begins, clear] = THREAD_BEGINS_M;
        let mut curve = Curve::new(way);
        let mut part = 0;
        while let Some((at, tangent)) = curve.next() {
            let near = ((at.length() - begins) / (clear - begins)).clamp(0.0, 1.0);
            let alpha = near * (0.9 - 0.65 * part as f32 / n_parts);
            self.point(at, THREAD_M, tangent, THREAD, alpha);
            part += 1;
        }
        self.end_line();
    }

    // --- the grid --------------------------------------------------------------------------------------------------

    /// The floor's lines, a metre apart, and a ring at the height of the eyes with marks: long ones ahead, to the
    /// sides and behind, and an arrow's head ahead.
    fn grid(&mut self, aids: &Aids) {
        let strength = aids.grid.clamp(0.0, 1.0);
        if strength.is_nan() || strength == 0.0 {
            return;
        }
        let reach = FLOOR_M as i32;
        for line in -reach..=reach {
            for way in [Vec3::X, Vec3::Z] {
                let beside = Vec3::new(way.z, 0.0, way.x) * line as f32 - aids.floor_m * Vec3::Y;
                for along in -reach..=reach {
                    let at = beside + way * along as f32;
                    let out = Vec3::new(at.x, 0.0, at.z).length();
                    let alpha = ((FLOOR_M - out) / (FLOOR_M - CLEAR_M)).clamp(0.0, 1.0);
                    self.point(at, GRID_M, way, GRID, 0.7 * strength * alpha);
                }
                self.end_line();
            }
        }
        self.circle(Vec3::ZERO, HORIZON_M, HORIZON_POINTS, (GRID_M, GRID, 0.8 * strength));
        const MARKS: usize = 36;
        for mark in 0..MARKS {
            let out = around(mark, MARKS) * HORIZON_M;
            let height = match mark {
                _ if mark.is_multiple_of(9) => 0.16,
                _ if mark.is_multiple_of(3) => 0.08,
                _ => 0.04,
            };
            for side in [-1.0, 1.0] {
                self.point(out + side * height * Vec3::Y, GRID_M, Vec3::Y, GRID, 0.8 * strength);
            }
            self.end_line();
        }
        let ahead = |x: f32, y: f32| Vec3::new(x, y, -HORIZON_M);
        for side in [-1.0, 1.0] {
            let [low, high] = [ahead(side * 0.08, 0.2), ahead(0.0, 0.34)];
            let way = (high - low).normalize();
            for at in [low, high] {
                self.point(at, GRID_M, way, GRID, strength);
            }
            self.end_line();
        }
    }

    // --- parts -----------------------------------------------------------------------------------------------------

    /// A level ring of lines: half their width, colour and alpha.
    fn circle(
        &mut self,
        middle: Vec3,
        radius: f32,
        n_points: usize,
        (width, colour, alpha): (f32, [u8; 3], f32),
    ) {
        for i in 0..=n_points {
            let out = around(i, n_points);
            self.point(middle + radius * out, width, out.cross(Vec3::Y), colour, alpha);
        }
        self.end_line();
    }

    fn point(&mut self, at: Vec3, half_width: f32, tangent: Vec3, [r, g, b]: [u8; 3], alpha: f32) {
        if self.points.len() < MOST_POINTS {
            let alpha = (alpha.clamp(0.0, 1.0) * 255.0).round() as u8;
            let colour = u32::from_le_bytes([r, g, b, alpha]);
            let (at, tangent) = (at.to_array(), tangent.to_array());
            self.points.push(AidPoint { at, half_width, tangent, colour });
        }
    }

    /// The next point begins another line.
    fn end_line(&mut self) {
        if let Some(last) = self.points.last_mut() {
            last.half_width = -last.half_width.abs();
        }
    }

    fn capsule(&mut self, [a, b]: [Vec3; 2], [radius_a, radius_b]: [f32; 2], colour: [u8; 3], glow: f32) {
        let (a, b) = (a.to_array(), b.to_array());
        self.solid(AidSolid { a, radius_a, b, radius_b, ring: 0, glow, ..AidSolid::default() }, colour);
    }

    fn ring(&mut self, middle: Vec3, axis: Vec3, [radius, tube]: [f32; 2], colour: [u8; 3], glow: f32) {
        let (a, b) = (middle.to_array(), axis.to_array());
        let (radius_a, radius_b) = (radius, tube);
        self.solid(AidSolid { a, radius_a, b, radius_b, ring: 1, glow, ..AidSolid::default() }, colour);
    }

    fn solid(&mut self, solid: AidSolid, [r, g, b]: [u8; 3]) {
        if self.solids.len() < MOST_SOLIDS {
            self.solids.push(AidSolid { colour: u32::from_le_bytes([r, g, b, 255]), ..solid });
        }
    }
}

/// A level unit vector: the first of `n` is ahead, the others follow clockwise.
fn around(i: usize, n: usize) -> Vec3 {
    let (sin, cos) = (i as f32 / n as f32 * TAU).sin_cos();
    Vec3::new(sin, 0.0, -cos)
}

/// A smooth curve through points: cubic Hermite segments, whose tangents are as long as the segment, so that it does not
/// swing out where far points follow near ones.
struct Curve<'a> {
    way: &'a [Vec3],
    part: usize,
}

impl Curve<'_> {
    fn new(way: &[Vec3]) -> Curve<'_> {
        Curve { way, part: 0 }
    }

    /// The way the curve goes at a point: from the one before to the one after, the nearer one counting for more.
    fn tangent(&self, i: usize) -> Vec3 {
        let step = |from: usize, to: usize| (self.way[to] - self.way[from]).normalize_or_zero();
        let last = self.way.len() - 1;
        let both = match i {
            0 => step(0, 1),
            _ if i == last => step(last - 1, last),
            _ => step(i - 1, i) + step(i, i + 1),
        };
        both.try_normalize().unwrap_or(Vec3::NEG_Z)
    }

    /// The next point, with the way the curve goes there.
    fn next(&mut self) -> Option<(Vec3, Vec3)> {
        let last = self.way.len().checked_sub(1).filter(|last| *last > 0)?;
        let (i, t) = (self.part / PARTS, (self.part % PARTS) as f32 / PARTS as f32);
        self.part += 1;
        if i >= last {
            return (i == last && t == 0.0).then(|| (self.way[last], self.tangent(last)));
        }
        let [a, b] = [self.way[i], self.way[i + 1]];
        let length = (b - a).length();
        let [from, to] = [self.tangent(i) * length, self.tangent(i + 1) * length];
        let [t2, t3] = [t * t, t * t * t];
        let at = (2.0 * t3 - 3.0 * t2 + 1.0) * a
            + (t3 - 2.0 * t2 + t) * from
            + (3.0 * t2 - 2.0 * t3) * b
            + (t3 - t2) * to;
        let way =
            (6.0 * t2 - 6.0 * t) * (a - b) + (3.0 * t2 - 4.0 * t + 1.0) * from + (3.0 * t2 - 2.0 * t) * to;
        Some((at, way.try_normalize().unwrap_or_else(|| self.tangent(i))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::Pose;

    fn hand(x: f32) -> HandAid {
        let pose = Pose { position: Vec3::new(x, -0.4, -0.4), orientation: Quat::IDENTITY };
        HandAid { grip: pose, aim: Some(pose), ray_m: Some(3.0), holds: true }
    }

    fn everything() -> Aids {
        let mut aids = Aids { grid: 1.0, floor_m: 1.6, ..Aids::default() };
        aids.hands = [Some(hand(-0.2)), Some(hand(0.2))];
        for i in 0..crate::aids::MOST_POINTS {
            let i = i as f32;
            aids.arc.push(Vec3::new(i * 0.1, 1.0 - 0.01 * i * i, -i * 0.1));
            aids.thread.push(Vec3::new(i, i.exp2().min(1e6), 0.0));
        }
        aids
    }

    #[test]
    fn a_frame_with_everything_fits() {
        let mut draft = Draft::default();
        for lands in [false, true] {
            draft.draw(&Aids { arc_lands: lands, ..everything() });
            let (solids, points) = (draft.solids().len(), draft.points().len());
            assert!(solids < MOST_SOLIDS && points < MOST_POINTS, "{solids} solids, {points} points");
            assert!(draft.points().iter().all(|p| p.half_width.is_finite() && Vec3::from(p.at).is_finite()));
            let unit = |p: &AidPoint| (Vec3::from(p.tangent).length() - 1.0).abs() < 1e-4;
            assert!(draft.points().iter().all(unit));
            assert!(draft.points().last().is_some_and(|last| last.half_width < 0.0), "a line has no end");
        }
        draft.draw(&Aids::default());
        assert_eq!((draft.solids(), draft.points()), (&[][..], &[][..]));
    }

    #[test]
    fn a_curve_goes_through_its_points_and_stays_beside_them() {
        let way: Vec<Vec3> = (0..20).map(|i| Vec3::new((i as f32).exp2(), (i as f32).sin(), 3.0)).collect();
        let mut curve = Curve::new(&way);
        let drawn: Vec<Vec3> = std::iter::from_fn(|| curve.next().map(|(at, _)| at)).collect();
        assert_eq!(drawn.len(), 19 * PARTS + 1);
        for (i, point) in way.iter().enumerate() {
            assert!(drawn[i * PARTS].distance(*point) <= 1e-3 * point.length());
        }
        let ways_on = drawn.windows(2).all(|pair| pair[1].x > pair[0].x);
        assert!(ways_on, "a curve through points that go on goes back");
        for few in 0..2 {
            assert!(Curve::new(&way[..few]).next().is_none());
        }
    }
}
