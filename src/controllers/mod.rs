//! PURE: what hands do with controllers, or bare, as what a person wants in a frame.
//!
//! | file | noun |
//! |---|---|
//! | `closed` | which hands are closed, and what on |
//! | `pinch` | what a bare hand does, from its joints |
//! | `settings` | [`ControllerSettings`]: what a person may set |

mod closed;
pub mod pinch;
mod settings;

use std::time::Duration;

use glam::{Vec2, Vec3};

use crate::input::{Input, Leap, Ray};
use crate::rig::Pose;
use closed::Closed;
pub use settings::ControllerSettings;

/// One hand, with what it holds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hand {
    /// Where it points along −z; None: that is not known, or it is not there.
    pub aim: Option<Pose>,
    /// Where it is, turned as OpenXR says of grip poses; None: that is not known, or it is not there.
    pub grip: Option<Pose>,
    /// How far the dive's trigger is pulled, 0 to 1.
    pub dive: f32,
    /// How far the hand is closed that takes hold of the land, 0 to 1.
    pub grab: f32,
    /// Something of what it holds is for that. A hand without takes hold by its dive's trigger, together with the other.
    pub has_grab: bool,
    /// It holds nothing: all that is known of it are its joints.
    pub is_bare: bool,
}

/// What hands do in a frame. [`Hands::default`] does nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hands {
    /// Left, right.
    pub hands: [Hand; 2],
    /// The stick that flies: right and ahead, −1 to 1.
    pub travel: Vec2,
    /// The stick that turns: right and up, −1 to 1.
    pub turn: Vec2,
    /// 0 to 1.
    pub rise: f32,
    /// The button that shows where a step through the air leads is down.
    pub teleport: bool,
    /// The button that turns upright is down.
    pub level: bool,
    /// The button that leads back to the start is down.
    pub restart: bool,
    /// The panel's button is down.
    pub panel: bool,
}

/// A trigger counts as pulled from the first share of its way on, until it is back at the second.
pub(crate) const PULLED: [f32; 2] = [0.6, 0.4];

/// A stick turns the view by a step from the first share of its way on, and again once it is back at the second.
const SNAPS: [f32; 2] = [0.7, 0.3];

/// The stick that turns rises and sinks from this share of its way on: steps to the side go by without.
const RISES_FROM: f32 = 0.5;

/// How long the button is held that leads back to the start: nobody is to lose his place by brushing it.
const RESTART_AFTER: Duration = Duration::from_secs(1);

/// A tick comes with the next whole octave, and not with the same one again before so much of another has gone by.
const TICK_SLACK: f64 = 0.25;

/// Hands from frame to frame.
#[derive(Clone, Debug, Default)]
pub struct Controllers {
    /// How they feel.
    pub settings: ControllerSettings,
    /// Hands that point at something of their own, such as the panel: what they pull now is for that, until they let go.
    pub occupied: [bool; 2],
    closed: Closed,
    /// The hand that dives, and the ray it began with.
    dive: Option<(usize, Ray)>,
    /// The button of the step through the air is down.
    leaping: bool,
    snapped: bool,
    /// For how long the restart button has been down; it works once.
    restarting: Duration,
    octave: Option<f64>,
    /// What each hand is to feel of taking hold and letting go.
    pulses: [f32; 2],
}

impl Controllers {
    /// Hands that feel like this.
    pub fn new(settings: ControllerSettings) -> Controllers {
        Controllers { settings, ..Controllers::default() }
    }

    /// What a person wants whose hands do this for `dt`, with poses in metres from the seat; `head` is one of those.
    pub fn input(&mut self, hands: &Hands, head: &Pose, dt: Duration) -> Input {
        let off = if self.settings.left_handed { 1 } else { 0 };
        let aim = hands.hands[off].aim.filter(|_| !self.settings.fly_by_head);
        let travel = self.beyond_rest(hands.travel, self.settings.dead_zone);
        let rise = self.beyond_rest(Vec2::new(0.0, hands.turn.y), RISES_FROM).y;
        let (look, turn) = self.turn(hands.turn.x);
        let grab = self.grab(hands);
        Input {
            worn: true,
            aim: aim.map_or(head.orientation, |aim| aim.orientation),
            travel: Vec3::new(travel.x, rise, -travel.y),
            look: Vec2::new(look, 0.0),
            turn: Vec2::new(turn, 0.0),
            dive: self.dive(hands),
            rise: self.beyond_rest(Vec2::new(hands.rise, 0.0), self.settings.dead_zone).x,
            grab,
            leap: self.leap(hands, head),
            level_up: hands.level,
            restart: self.restart(hands.restart, dt),
            ..Input::default()
        }
    }

    /// Where the hands are that hold the land. They feel it begin and end.
    fn grab(&mut self, hands: &Hands) -> [Option<Vec3>; 2] {
        let held = self.closed.holds;
        self.closed.close(&hands.hands, self.occupied);
        for (i, pulse) in self.pulses.iter_mut().enumerate() {
            let strength = self.settings.grab_pulse.clamp(0.0, 1.0);
            match (held[i], self.closed.holds[i]) {
                (false, true) => *pulse = strength,
                (true, false) => *pulse = 0.5 * strength,
                _ => {}
            }
        }
        std::array::from_fn(|i| closed::place(&hands.hands[i]).filter(|_| self.closed.holds[i]))
    }

    /// How strongly each hand is to feel that it has taken hold, or let go, since this was asked for last; 0: not at all.
    pub fn take_pulses(&mut self) -> [f32; 2] {
        std::mem::take(&mut self.pulses)
    }

    /// How strong a tick is felt at a depth, in octaves; None: none. Both hands may feel it.
    pub fn tick(&mut self, depth: f64) -> Option<f32> {
        let last = *self.octave.get_or_insert(depth.floor());
        // Between whole octaves `last` and the next one nothing is felt, and a little beyond on either side.
        if depth >= last - TICK_SLACK && depth < last + 1.0 {
            return None;
        }
        self.octave = Some(depth.floor());
        let strength = self.settings.tick.clamp(0.0, 1.0);
        (strength > 0.0).then_some(strength)
    }

    /// A stick without its rest, and from there on from 0 to 1 again.
    fn beyond_rest(&self, stick: Vec2, rest: f32) -> Vec2 {
        let rest = if rest.is_finite() { rest.clamp(0.0, 0.9) } else { 0.0 };
        let way = stick.length().min(1.0);
        if !stick.is_finite() || way <= rest {
            Vec2::ZERO
        } else {
            stick.normalize() * ((way - rest) / (1.0 - rest))
        }
    }

    /// Radians at once, and the share of the smooth rate.
    fn turn(&mut self, x: f32) -> (f32, f32) {
        let step = self.settings.snap_turn.clamp(0.0, 90.0).to_radians();
        if step.is_nan() || step == 0.0 {
            return (0.0, self.beyond_rest(Vec2::new(x, 0.0), self.settings.dead_zone).x);
        }
        let was = self.snapped;
        self.snapped = is_held(was, x.abs(), SNAPS);
        (if self.snapped && !was { step.copysign(x) } else { 0.0 }, 0.0)
    }

    /// A hand that begins to pull dives, unless hands hold the land: from then on it has to pull anew.
    fn dive(&mut self, hands: &Hands) -> Option<Ray> {
        let Closed { pulls, begins, holds, .. } = self.closed;
        if holds != [false; 2] {
            self.dive = None;
            return None;
        }
        for (i, hand) in hands.hands.iter().enumerate() {
            let free = begins[i] && self.dive.is_none();
            if let Some(aim) = hand.aim.filter(|_| free) {
                self.dive = Some((i, along(&aim)));
            }
        }
        self.dive = self.dive.filter(|(hand, _)| pulls[*hand]);
        self.dive.map(|(_, ray)| ray)
    }

    /// While the button is down, the hand throws that turns, or the other one, where it is not seen.
    fn leap(&mut self, hands: &Hands, head: &Pose) -> Option<Leap> {
        let was = std::mem::replace(&mut self.leaping, hands.teleport);
        let main = if self.settings.left_handed { 0 } else { 1 };
        let aim = hands.hands[main].aim.or(hands.hands[1 - main].aim)?;
        (was || hands.teleport).then_some(Leap {
            from: along(&aim),
            reach_m: self.settings.leap_m.clamp(1.0, 100.0),
            steepest: self.settings.leap_slope.clamp(0.0, 90.0).to_radians(),
            head_m: head.position,
            go: was && !hands.teleport,
        })
    }

    fn restart(&mut self, down: bool, dt: Duration) -> bool {
        let before = self.restarting;
        self.restarting = if down { before + dt } else { Duration::ZERO };
        before < RESTART_AFTER && self.restarting >= RESTART_AFTER
    }
}

/// Where a hand points.
fn along(aim: &Pose) -> Ray {
    Ray { origin_m: aim.position, direction: aim.orientation * Vec3::NEG_Z }
}

/// Whether something counts as held, with a gap between its beginning and its end.
pub(crate) fn is_held(was: bool, value: f32, [begins, ends]: [f32; 2]) -> bool {
    value >= if was { ends } else { begins }
}
