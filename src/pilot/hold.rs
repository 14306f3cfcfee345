//! Hands that hold the land: it goes where they go, turns with them, and grows as they part.
//!
//! What is between the hands stays between the hands. With tiles per metre t, orientation R and the hands' middle s, it is
//! at P + R·s·t of the viewer's place P; from frame to frame P goes by what R·s·t changes. Nothing adds up to an error:
//! P and R·s·t are whole multiples of a grain, the turn counts in 2⁻⁶⁴ of a whole one, the scale in 2⁻³⁰ octaves, and each
//! of the three follows the hands' poses alone. So hands that go back the way they came undo all that they did, to the bit,
//! at any depth.
//!
//! Only the heading turns: a horizon that hands tilt makes people ill, and levelling would have to take it back.

use super::upright::part_of_turn;
use super::{DEEPEST_LEVEL, HIGHEST_LEVEL, LONGEST_STEP, Pilot, SHIFT_STEPS};
use crate::rig::COMFORT_M;
use crate::terrain::place;
use glam::{DVec3, Vec3};

/// The scale counts in these parts of an octave while land is held: what `f64` keeps of the deepest.
const SCALE_GRAIN: f64 = 1.0 / (1u64 << 30) as f64;

/// Positions of hands count in these parts of a tile of the scale's level, which the grain of positions divides: the same
/// whether the anchor has followed the scale already or not.
const REACH_GRAIN: f64 = 1.0 / (1u64 << 40) as f64;

/// Metres between the hands below which their distance counts as this, and their direction as none.
const NEAREST_HANDS_M: f32 = 0.04;

/// Hands one above the other point nowhere: the share of their distance that must be level.
const LEAST_LEVEL: f32 = 0.2;

/// Hands farther than this from the seat are nobody's, in metres.
const ARMS_LENGTH_M: f32 = 8.0;

/// Metres from the seat to the ground at which the land slips from the hands that pull it in; from nearer it goes no nearer.
pub(super) const NEAREST_M: f64 = 0.25;

/// Nearer than that, the land slides by in steps of this share of the way to it.
const SLIDING_STEP: f64 = 0.25;

/// Octaves off the comfortable scale that hands may take the land at once; and for how long as they like.
const MOST_OFF: f64 = 5.0;
const COMFORTABLE_OFF: f64 = 1.0;

/// Land that is held.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hold {
    /// Which hands hold it: left, right.
    by: [bool; 2],
    /// From the viewer to what is between the hands, in anchor tiles. Exact.
    way: DVec3,
    grasp: Grasp,
}

/// How hands are.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Grasp {
    /// Between them, in metres from the seat.
    middle: DVec3,
    /// log2 of the distance between them in metres, a multiple of [`SCALE_GRAIN`]; 0 of one hand.
    span: f64,
    /// Which way the right one is from the left one about the upright axis, in 2⁻⁶⁴ of a whole turn.
    bearing: Option<i64>,
}

impl Grasp {
    /// None: no hand holds anything.
    fn of(hands: &[Option<Vec3>; 2]) -> Option<Grasp> {
        let [left, right] = hands.map(|hand| hand.map(|at| at.clamp_length_max(ARMS_LENGTH_M)));
        let (Some(left), Some(right)) = (left, right) else {
            let middle = left.or(right)?.as_dvec3();
            return Some(Grasp { middle, span: 0.0, bearing: None });
        };
        let across = right - left;
        let apart = across.length();
        let level = across.x.hypot(across.z);
        let points = apart >= NEAREST_HANDS_M && level >= LEAST_LEVEL * apart;
        Some(Grasp {
            middle: (left.as_dvec3() + right.as_dvec3()) * 0.5,
            span: on_scale_grain(f64::from(apart.max(NEAREST_HANDS_M)).log2()),
            bearing: points.then(|| part_of_turn(f64::from(across.x).atan2(f64::from(across.z)))),
        })
    }
}

impl Hold {
    /// The viewer has moved.
    pub(super) fn moved(&mut self, shift: DVec3) {
        self.way -= shift;
    }

    /// The anchor is one level deeper (1) or shallower (−1), and then the viewer was moved by `rounded`.
    pub(super) fn anchor_moved(&mut self, levels: i32, rounded: DVec3) {
        self.way = self.way * f64::from(levels).exp2() - rounded;
    }
}

impl Pilot {
    /// Whether hands hold the land: left, right.
    pub fn holds(&self) -> [bool; 2] {
        self.hold.map_or([false; 2], |hold| hold.by)
    }

    /// Hands hold the land, in metres from the seat: it follows them. True while one does.
    pub(super) fn hold(&mut self, hands: &[Option<Vec3>; 2], worn: bool) -> bool {
        let Some(grasp) = Grasp::of(hands) else {
            self.let_go();
            return false;
        };
        self.stop();
        let by = hands.map(|hand| hand.is_some());
        match self.hold {
            Some(hold) if hold.by == by => self.drag(&hold, grasp, worn),
            _ => {
                self.scale.value = on_scale_grain(self.scale.value);
                self.hold = Some(Hold { by, way: self.reach(&grasp, worn), grasp });
            }
        }
        true
    }

    /// The scale that the wearer has chosen stays where that is comfortable, and else comes back to where it is, as
    /// gently as ever.
    fn let_go(&mut self) {
        if self.hold.take().is_some() {
            let off = self.scale.value - self.comfortable();
            self.off_comfort = off.clamp(-COMFORTABLE_OFF, COMFORTABLE_OFF);
        }
    }

    fn drag(&mut self, before: &Hold, grasp: Grasp, worn: bool) {
        if let (Some(was), Some(is)) = (before.grasp.bearing, grasp.bearing) {
            self.facing.turn_by(was.wrapping_sub(is));
        }
        self.grow(grasp.span - before.grasp.span);
        let reach = self.reach(&grasp, worn);
        // The anchor may have moved.
        let way = self.hold.map_or(reach, |hold| hold.way);
        self.drag_clear(self.below_the_sky(way - reach));
        let way = self.hold.map_or(reach, |hold| hold.way);
        // What cannot follow slips through the hands: nothing is dragged along later.
        let slips = (way - reach).abs().max_element() > self.reach_grain();
        self.hold = Some(Hold { way: if slips { reach } else { way }, grasp, ..*before });
    }

    /// The land grows by octaves, as far as that may be.
    fn grow(&mut self, octaves: f64) {
        let (was, comfortable) = (self.scale.value, self.comfortable());
        let least = (comfortable - MOST_OFF).max(HIGHEST_LEVEL as f64).min(was);
        let most = (comfortable + MOST_OFF).min(DEEPEST_LEVEL as f64).max(was);
        self.scale.value = on_scale_grain((was + octaves).clamp(least, most));
        self.follow();
    }

    /// From the viewer to what is between the hands, in anchor tiles.
    fn reach(&self, grasp: &Grasp, worn: bool) -> DVec3 {
        let way = self.play_space(worn) * grasp.middle * (self.height() / COMFORT_M);
        let grain = self.reach_grain();
        (way / grain).round() * grain
    }

    fn reach_grain(&self) -> f64 {
        REACH_GRAIN * (self.place.level() as f64 - self.scale.value.floor()).exp2()
    }

    /// A move without what leads up where rising ends.
    fn below_the_sky(&self, tiles: DVec3) -> DVec3 {
        let out = tiles.dot(self.ground.away);
        let ends = self.comfortable() <= HIGHEST_LEVEL as f64;
        if ends && out > 0.0 { tiles - self.ground.away * out } else { tiles }
    }

    /// Moves by anchor tiles, as far as the ground is no nearer than hands may pull it.
    fn drag_clear(&mut self, tiles: DVec3) {
        let nearest_m = NEAREST_M * self.height() / COMFORT_M;
        let least = self.ground.least;
        let allowed = nearest_m.min(least).max(LONGEST_STEP * least);
        let mut left = tiles;
        for _ in 0..SHIFT_STEPS {
            let (was, clear) = (self.ground, self.ground.least - allowed);
            let slides = clear <= 0.01 * allowed;
            let step = if slides {
                let towards = left.dot(was.away).min(0.0);
                (left - was.away * towards).clamp_length_max(SLIDING_STEP * was.least)
            } else {
                left.clamp_length_max(clear)
            };
            let step = place::on_grain(step);
            if step == DVec3::ZERO {
                break;
            }
            left -= self.walk(step);
            if slides && self.ground.most < allowed.min(was.most) {
                // Along ground that comes nearer there is no way.
                self.walk(-step);
                break;
            }
        }
    }
}

fn on_scale_grain(octaves: f64) -> f64 {
    (octaves / SCALE_GRAIN).round() * SCALE_GRAIN
}
