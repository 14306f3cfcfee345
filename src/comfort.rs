//! PURE: what spares the stomach of a person in a headset: how far the view is narrowed while he is moved, what stands
//! still around him, when the picture goes black, and how gently his flight begins and ends.
//!
//! What moves him and is none of his own movements is what makes sick. The ground that goes by and the turning of the
//! play space are measured each frame; the faster they are, the narrower the view gets, and it opens again once they
//! end. Jumps happen in the dark: whoever wants one asks [`Comfort::may_jump`] frame by frame until it may happen.

use std::f32::consts::FRAC_PI_2;
use std::time::Duration;

use glam::Quat;
use serde::{Deserialize, Serialize};

use crate::aids::{Aids, Vignette};
use crate::input::{Input, Leap};
use crate::pilot::MotionSettings;

/// What a person may set. Each number is brought into its range when it is used. `config/default.toml` says where the
/// built-in values come from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ComfortSettings {
    /// The view is narrowed while the wearer is moved.
    pub vignette: bool,
    /// Degrees from the middle of the view at which the narrowed view begins to darken, 5 to 80; 30.
    pub vignette_inner: f32,
    /// Degrees at which it is as dark as it gets, 10 to 90, beyond the other; 45.
    pub vignette_outer: f32,
    /// How dark that is, 0 to 1; 1 is black.
    pub vignette_strength: f32,
    /// Degrees per second of the nearest ground going by, from which on the view is narrowed, and from which on it is
    /// narrow; 0 to 360; 10 and 45.
    pub flow_from: f32,
    /// See [`ComfortSettings::flow_from`].
    pub flow_full: f32,
    /// The same of being turned; 0 to 360; 5 and 30.
    pub turn_from: f32,
    /// See [`ComfortSettings::turn_from`].
    pub turn_full: f32,
    /// How much motion counts that the wearer's own hands make, holding the land, 0 to 1; 0.3.
    pub by_hand: f32,
    /// Seconds in which the view narrows all the way, 0 to 10; 0.4.
    pub close_s: f32,
    /// Seconds in which it opens again, 0 to 10; 1.
    pub open_s: f32,
    /// When the grid is seen that stands still.
    pub grid: GridWhen,
    /// How clearly it is seen, 0 to 1; 0.5.
    pub grid_strength: f32,
    /// Jumps happen in the dark.
    pub fades: bool,
    /// Seconds in which the picture goes black, 0 to 2; 0.15.
    pub fade_out_s: f32,
    /// Seconds in which it comes back, 0 to 2; 0.4.
    pub fade_in_s: f32,
    /// Most seconds of glide, in place of [`MotionSettings::inertia_s`] and [`MotionSettings::turn_inertia_s`] where
    /// those are longer, 0 to 2; 0.05.
    pub inertia_s: f64,
    /// Most degrees per second by which "up" follows the ground, in place of [`MotionSettings::levelling_rate`] where
    /// that is more, 0 to 180; 3.
    pub levelling_rate: f64,
}

/// When the grid is seen that stands still around the wearer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum GridWhen {
    /// Never.
    Off,
    /// As far as the view is narrowed, or would be.
    Moving,
    /// Always.
    Always,
}

impl Default for ComfortSettings {
    fn default() -> ComfortSettings {
        ComfortSettings {
            vignette: true,
            vignette_inner: 30.0,
            vignette_outer: 45.0,
            vignette_strength: 1.0,
            flow_from: 10.0,
            flow_full: 45.0,
            turn_from: 5.0,
            turn_full: 30.0,
            by_hand: 0.3,
            close_s: 0.4,
            open_s: 1.0,
            grid: GridWhen::Off,
            grid_strength: 0.5,
            fades: true,
            fade_out_s: 0.15,
            fade_in_s: 0.4,
            inertia_s: 0.05,
            levelling_rate: 3.0,
        }
    }
}

impl ComfortSettings {
    /// How moving feels to a wearer for whom it is set like this without a headset: every change of speed that he does
    /// not feel is short, and he is tilted slowly.
    pub fn motion(&self, motion: &MotionSettings) -> MotionSettings {
        let usual = ComfortSettings::default();
        let most = |v: f64, usual: f64| if v.is_nan() { usual } else { v.max(0.0) };
        let inertia_s = most(self.inertia_s, usual.inertia_s);
        MotionSettings {
            inertia_s: motion.inertia_s.min(inertia_s),
            turn_inertia_s: motion.turn_inertia_s.min(inertia_s),
            levelling_rate: motion.levelling_rate.min(most(self.levelling_rate, usual.levelling_rate)),
            // What the wearer is turned by in the dark is done before he sees again.
            level_up_rate: 360.0,
            ..*motion
        }
    }
}

/// How the wearer is moved in a frame, and what he has of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Senses {
    /// Radians per second at which the nearest ground goes by ([`Pilot::flow`](crate::pilot::Pilot::flow)); None: nobody
    /// steers, and it is taken from how fast the depth changes.
    pub flow: Option<f64>,
    /// Octaves below the start.
    pub depth: f64,
    /// Turns the play space's axes to the terrain's.
    pub heading: Quat,
    /// His own hands move him, holding the land.
    pub by_hand: bool,
    /// The headset is on, and he sees its pictures.
    pub seen: bool,
    /// It is known where he looks.
    pub tracked: bool,
    /// The last picture showed him elsewhere of a sudden, and was black for that ([`Aids::blinks`]).
    pub jolted: bool,
    /// Radians from the middle of the view to the farthest corner of an eye's picture, once there was one.
    pub widest: Option<f32>,
    /// Metres from the seat down to the floor, where that is known.
    pub floor_m: Option<f32>,
}

impl Default for Senses {
    /// He sees, and nothing moves.
    fn default() -> Senses {
        Senses {
            flow: Some(0.0),
            depth: 0.0,
            heading: Quat::IDENTITY,
            by_hand: false,
            seen: true,
            tracked: true,
            jolted: false,
            widest: None,
            floor_m: None,
        }
    }
}

/// A turn of more than this in a frame (radians) is a step: there is nothing in between that could be seen to move. The
/// least step of the controllers is wider, and a smooth turn that fast is one that nobody sets.
const STEP: f32 = 0.175;

/// Frames may take long where a place is drawn for the first time. None takes the fades further on than this (seconds),
/// so that they are seen.
const LONGEST_FRAME_S: f32 = 0.05;

/// Tracking may be lost for so long (seconds) without anything being made of it.
const LOST_FOR_S: f32 = 0.1;

/// How long it stays dark for turning upright, in seconds.
const LEVELLING_S: f32 = 0.5;

/// Radians to the corners of the picture before anything is known of it: those of a headset as wide as it is high, 45
/// degrees to each side.
const WIDEST: f32 = 0.955;

/// The floor under a person who sits, in metres below the eyes, where nothing knows it.
const SEATED_M: f32 = 1.2;

/// What waits for the dark.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Due {
    restart: bool,
    level_up: bool,
    recentre: bool,
    leap: Option<Leap>,
}

/// The wearer's comfort from frame to frame. For somebody at a window ([`Comfort::rest`]) there is nothing to spare.
#[derive(Clone, Debug)]
pub struct Comfort {
    /// What is set.
    pub settings: ComfortSettings,
    worn: bool,
    /// How far the view is narrowed, 0 to 1.
    narrowed: f32,
    /// How far the picture is faded, 0 to 1.
    faded: f32,
    /// Somebody wants to jump.
    asked: bool,
    /// Jumps of the wearer's own that wait for the dark.
    due: Due,
    /// Seconds that it stays dark for what has been begun.
    busy_s: f32,
    /// Seconds since it was last known where the wearer looks.
    lost_s: f32,
    /// Heading and depth of the frame before.
    last: Option<(Quat, f64)>,
    widest: f32,
    floor_m: f32,
}

impl Default for Comfort {
    fn default() -> Comfort {
        Comfort::new(ComfortSettings::default())
    }
}

impl Comfort {
    /// Nobody wears a headset yet.
    pub fn new(settings: ComfortSettings) -> Comfort {
        Comfort {
            settings,
            worn: false,
            narrowed: 0.0,
            faded: 0.0,
            asked: false,
            due: Due::default(),
            busy_s: 0.0,
            lost_s: 0.0,
            last: None,
            widest: WIDEST,
            floor_m: SEATED_M,
        }
    }

    /// Nobody wears the headset that is drawn for: all is open, and jumps happen at once.
    pub fn rest(&mut self) {
        *self = Comfort::new(self.settings);
    }

    /// Whether a jump may happen now: then do it, before the next frame is drawn. Else the picture goes black for it; ask
    /// again each frame until it may. Once nobody asks any more, the picture comes back.
    #[must_use]
    pub fn may_jump(&mut self) -> bool {
        self.asked = true;
        !self.worn || !self.settings.fades || self.faded >= 1.0
    }

    /// What a person wants in a frame, but for what takes him elsewhere at once: that waits until it is dark. Nothing else is
    /// wanted of a wearer who does not see.
    pub fn hold(&mut self, input: &Input, seen: bool) -> Input {
        self.due.restart |= input.restart;
        self.due.level_up |= input.level_up;
        self.due.recentre |= input.recentre;
        let goes = input.leap.filter(|leap| leap.go && seen);
        self.due.leap = goes.or(self.due.leap);
        let dark = self.due != Due::default() && self.may_jump();
        let now = if dark { std::mem::take(&mut self.due) } else { Due::default() };
        if now.level_up {
            self.busy_s = LEVELLING_S;
        }
        let still = Input { worn: input.worn, aim: input.aim, ..Input::default() };
        let input = if seen { *input } else { still };
        Input {
            restart: now.restart,
            level_up: now.level_up,
            recentre: now.recentre,
            leap: now.leap.or(input.leap.filter(|leap| !leap.go)),
            ..input
        }
    }

    /// Takes a wearer on by a frame of `dt`, once he was moved.
    pub fn advance(&mut self, dt: Duration, senses: &Senses) {
        let dt_s = dt.as_secs_f32();
        self.worn = true;
        let widest = senses.widest.filter(|widest| widest.is_finite());
        self.widest = widest.map_or(WIDEST, |widest| widest.clamp(0.1, FRAC_PI_2));
        self.floor_m = senses.floor_m.filter(|m| m.is_finite()).unwrap_or(SEATED_M);
        self.narrow(dt_s, senses);
        self.fade(dt_s, senses);
    }

    fn narrow(&mut self, dt_s: f32, senses: &Senses) {
        let before = self.last.replace((senses.heading, senses.depth));
        let Some((heading, depth)) = before.filter(|_| dt_s > 0.0) else { return };
        let falling = (senses.depth - depth).abs() * std::f64::consts::LN_2 / f64::from(dt_s);
        let flow = senses.flow.unwrap_or(falling) as f32;
        let turned = angle(heading, senses.heading);
        let turning = if turned < STEP { turned / dt_s } else { 0.0 };
        let s = &self.settings;
        let share = if senses.by_hand { between(s.by_hand, 0.0, 1.0) } else { 1.0 };
        let wanted =
            share * ramp(flow, s.flow_from, s.flow_full).max(ramp(turning, s.turn_from, s.turn_full));
        self.narrowed =
            towards(self.narrowed, wanted, dt_s, [s.close_s, s.open_s].map(|t| between(t, 0.0, 10.0)));
    }

    fn fade(&mut self, dt_s: f32, senses: &Senses) {
        let asked = std::mem::take(&mut self.asked);
        self.lost_s = if senses.tracked { 0.0 } else { self.lost_s + dt_s };
        let times = [self.settings.fade_out_s, self.settings.fade_in_s].map(|t| between(t, 0.0, 2.0));
        if !self.settings.fades {
            self.faded = 0.0;
            return;
        }
        if senses.jolted {
            self.faded = 1.0;
        }
        self.busy_s = (self.busy_s - dt_s).max(0.0);
        let dark = asked || self.busy_s > 0.0 || !senses.seen || self.lost_s > LOST_FOR_S;
        let wanted = if dark { 1.0 } else { 0.0 };
        self.faded = towards(self.faded, wanted, dt_s.min(LONGEST_FRAME_S), times);
    }

    /// Writes what is seen of it in the next frame.
    pub fn fill(&self, aids: &mut Aids) {
        let s = &self.settings;
        let narrowed = smooth(self.narrowed);
        aids.vignette = (self.worn && s.vignette && narrowed > 0.0).then(|| {
            let [inner, outer] =
                [between(s.vignette_inner, 5.0, 80.0), between(s.vignette_outer, 10.0, 90.0)];
            let outer = outer.max(inner + 1.0).to_radians();
            let inner = inner.to_radians();
            // It comes in from where nobody sees it: the circle closes, and its edge stays as soft.
            let open = self.widest.max(inner);
            let now = open + (inner - open) * narrowed;
            Vignette {
                inner: now,
                outer: now + (outer - inner),
                strength: between(s.vignette_strength, 0.0, 1.0),
            }
        });
        aids.grid = between(s.grid_strength, 0.0, 1.0)
            * match s.grid {
                _ if !self.worn => 0.0,
                GridWhen::Off => 0.0,
                GridWhen::Moving => narrowed,
                GridWhen::Always => 1.0,
            };
        aids.floor_m = self.floor_m;
        aids.fade = smooth(self.faded);
        aids.blinks = self.worn && s.fades;
    }
}

/// Radians from one to the other. The cosine would not know small ones: a wearer at rest would seem to turn.
fn angle(one: Quat, other: Quat) -> f32 {
    let turn = one.conjugate() * other;
    2.0 * turn.xyz().length().atan2(turn.w.abs())
}

/// In its range; what is no number is the least.
fn between(v: f32, least: f32, most: f32) -> f32 {
    if v.is_nan() { least } else { v.clamp(least, most) }
}

/// Which share of the way from one to the other (degrees per second) something is (radians per second), 0 to 1.
fn ramp(rate: f32, from_deg: f32, full_deg: f32) -> f32 {
    let [from, full] = [from_deg, full_deg].map(|v| between(v, 0.0, 360.0).to_radians());
    if rate.is_nan() {
        0.0
    } else if full > from {
        ((rate - from) / (full - from)).clamp(0.0, 1.0)
    } else {
        f32::from(u8::from(rate > from))
    }
}

/// A share on its way to another, at a rate that takes so many seconds for all of it: upwards, downwards.
fn towards(now: f32, wanted: f32, dt_s: f32, [up_s, down_s]: [f32; 2]) -> f32 {
    let step = |whole_s: f32| if whole_s > 0.0 { dt_s / whole_s } else { 1.0 };
    if wanted > now { (now + step(up_s)).min(wanted) } else { (now - step(down_s)).max(wanted) }
}

/// 0 to 1 as before, and begun and ended gently.
fn smooth(v: f32) -> f32 {
    v * v * (3.0 - 2.0 * v)
}
