//! PURE: what hands do with controllers, or bare, as what a person wants in a frame.

use std::time::Duration;

use glam::{Quat, Vec2, Vec3};
use serde::{Deserialize, Serialize};

use crate::input::{Input, Ray};
use crate::rig::Pose;

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

/// How controllers feel. Each number is brought into its range when it is used.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ControllerSettings {
    /// The left hand is the main one: it turns, and the right one flies.
    pub left_handed: bool,
    /// Travel goes where the head looks, not where the hand points.
    pub fly_by_head: bool,
    /// Degrees of a step that the view turns by, 0 to 90; 30. 0 turns smoothly, at
    /// [`MotionSettings::turn_rate`](crate::pilot::MotionSettings::turn_rate). Steps are easier on the stomach.
    pub snap_turn: f32,
    /// Share of a stick's way that counts as rest, 0 to 0.9; 0.15.
    pub dead_zone: f32,
    /// Strength of the tick at each octave, 0 to 1; 0.4. 0: none.
    pub tick: f32,
    /// Hands are drawn, with what they hold.
    pub models: bool,
    /// Rays are drawn from the hands to the land.
    pub rays: bool,
}

impl Default for ControllerSettings {
    fn default() -> ControllerSettings {
        ControllerSettings {
            left_handed: false,
            fly_by_head: false,
            snap_turn: 30.0,
            dead_zone: 0.15,
            tick: 0.4,
            models: true,
            rays: true,
        }
    }
}

/// A trigger counts as pulled from the first share of its way on, until it is back at the second.
const PULLED: [f32; 2] = [0.6, 0.4];

/// The same of a stick that turns the view by a step.
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
    pulled: [bool; 2],
    /// The hand that dives, and the ray it began with.
    dive: Option<(usize, Ray)>,
    snapped: bool,
    /// For how long the restart button has been down; it works once.
    restarting: Duration,
    octave: Option<f64>,
}

impl Controllers {
    /// Hands that feel like this.
    pub fn new(settings: ControllerSettings) -> Controllers {
        Controllers { settings, ..Controllers::default() }
    }

    /// What a person wants whose hands do this for `dt`, with poses in metres from the seat and `head` turning the
    /// head's axes to the play space's.
    pub fn input(&mut self, hands: &Hands, head: Quat, dt: Duration) -> Input {
        let off = if self.settings.left_handed { 1 } else { 0 };
        let aim = hands.hands[off].aim.filter(|_| !self.settings.fly_by_head);
        let travel = self.beyond_rest(hands.travel, self.settings.dead_zone);
        let rise = self.beyond_rest(Vec2::new(0.0, hands.turn.y), RISES_FROM).y;
        let (look, turn) = self.turn(hands.turn.x);
        Input {
            worn: true,
            aim: aim.map_or(head, |aim| aim.orientation),
            travel: Vec3::new(travel.x, rise, -travel.y),
            look: Vec2::new(look, 0.0),
            turn: Vec2::new(turn, 0.0),
            dive: self.dive(hands),
            rise: self.beyond_rest(Vec2::new(hands.rise, 0.0), self.settings.dead_zone).x,
            level_up: hands.level,
            restart: self.restart(hands.restart, dt),
            ..Input::default()
        }
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

    fn dive(&mut self, hands: &Hands) -> Option<Ray> {
        for (i, hand) in hands.hands.iter().enumerate() {
            let was = self.pulled[i];
            self.pulled[i] = is_held(was, hand.dive, PULLED);
            let begins = self.pulled[i] && !was && self.dive.is_none();
            if let Some(aim) = hand.aim.filter(|_| begins) {
                let direction = aim.orientation * Vec3::NEG_Z;
                self.dive = Some((i, Ray { origin_m: aim.position, direction }));
            }
        }
        self.dive = self.dive.filter(|(hand, _)| self.pulled[*hand]);
        self.dive.map(|(_, ray)| ray)
    }

    fn restart(&mut self, down: bool, dt: Duration) -> bool {
        let before = self.restarting;
        self.restarting = if down { before + dt } else { Duration::ZERO };
        before < RESTART_AFTER && self.restarting >= RESTART_AFTER
    }
}

/// Whether something counts as held, with a gap between its beginning and its end.
fn is_held(was: bool, value: f32, [begins, ends]: [f32; 2]) -> bool {
    value >= if was { ends } else { begins }
}
