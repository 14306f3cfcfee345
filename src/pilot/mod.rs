//! PURE: moving by hand: what a person wants in a frame, and where that takes the viewer. Knows no clock, no device and
//! no picture, and cannot fail; the same inputs end on the same bits.
//!
//! Everything follows the distance to the nearest ground, found exactly ([`Probe`]). It is the unit of speed: at a
//! speed of s octaves per second the viewer covers `s · ln 2 · distance` in a second, so straight at the ground the
//! distance halves s times a second, and sideways the ground goes by at `s · ln 2` radians per second, at every depth.
//! And it is the unit of scale: the ground is kept at a set distance in metres, on a spring whose rate never jumps.
//! The anchor follows that scale, so positions stay within a few tiles.
//!
//! The ground is never reached: no step is longer than half the way to it, and most are a tenth at most. In a second
//! at speed s the distance falls by 1.3 · s octaves at most along a course of one's own, and by 1.8 · s in a dive,
//! whatever is wanted and however long the frames are.
//!
//! | file | noun |
//! |---|---|
//! | `settings` | [`MotionSettings`]: what a person may set |
//! | `upright` | which way the viewer faces, and which way the ground does |
//! | `dive` | the way down to a target, and back |
//! | `aim` | rays: what they meet, and the look in a dive |
//! | `hold` | the land in the user's hands |
//! | `leap` | a step through the air |
//! | `trail` | where the viewer came from |
//! | `smooth` | values that follow others smoothly |

mod aim;
mod dive;
mod hold;
mod leap;
mod settings;
mod smooth;
mod trail;
mod upright;

pub use settings::{MotionSettings, SPEEDS};

use crate::course::{Stand, Standpoint};
use crate::input::Input;
use crate::rig::COMFORT_M;
use crate::terrain::nearest::{Nearest, Probe};
use crate::terrain::place::{self, Place, START_LEVEL};
use dive::Dive;
use glam::{DQuat, DVec2, DVec3, Quat, Vec3};
use hold::Hold;
use leap::Throw;
use smooth::Spring;
use std::f64::consts::LN_2;
use trail::{Dives, Trail};
use upright::Facing;

/// Height in cells of a depth: what depth is shown at a height. The built-in dive's.
const HEIGHT_CELLS: f64 = 2.0;

/// Octaves by which the viewer may be deeper than the anchor's level, and less deep, before the anchor follows: hovering
/// at a whole octave does not make it flip. Heights are then within 0.87..=2.07 anchor tiles, as those of flights are.
const DEEPER_BY: f64 = 1.2;
const LESS_DEEP_BY: f64 = 0.05;

/// What the nearest ground is found to. `most`, with a guess from the frame before, is then about 1/100 more than the
/// distance.
const TOLERANCE: f64 = 1.0 / 8.0;

/// A dive of less than so many octaves is none to come back along.
const LEFT_FROM: f64 = 0.25;

/// The longest step, in octaves; and the most steps in a frame, of which 1 second at full speed takes half.
const STEP_OCTAVES: f64 = 1.0 / 8.0;
const MOST_STEPS: f64 = 192.0;

/// No step is longer than this share of the way to the ground.
const LONGEST_STEP: f64 = 0.5;

/// Steps in which a drag comes up to the ground.
const SHIFT_STEPS: usize = 16;

/// The longest frame in seconds: after a longer pause the viewer goes on as if it had been so long.
pub const LONGEST_FRAME_S: f64 = 1.0;

/// The level of the tiles the viewer is in when rising ends. The haze closes the world 32 octaves away: from here on
/// the root of the world would be seen.
pub const HIGHEST_LEVEL: usize = 48;

/// The same for falling: addresses go down to level 2 100 000.
pub const DEEPEST_LEVEL: usize = 2_000_000;

/// Octaves before both ends in which the viewer slows down.
const END_OCTAVES: f64 = 2.0;

/// In a dive, and on the way out, the ground may go by so much faster than the speed says.
const MOST_FLOW: f64 = 1.4;

/// Octaves per second below which a viewer who wants nothing is at rest.
const RESTS_AT: f64 = 1e-4;

/// Seconds in which speed follows a renderer that wishes it less, and one that wishes it more.
const BRAKE_S: f64 = 0.08;
const RELEASE_S: f64 = 0.5;

/// Below this share of full speed the scale of a wearer follows the ground the more slowly the slower he travels.
const RESTING: f64 = 0.1;

/// So many octaves off its goal the scale has come to it.
const SETTLED: f64 = 0.005;

/// Seconds in which 2/3 of a small tilt is gone, by itself and when asked for.
const LEVELLING_S: f64 = 0.7;
const LEVEL_UP_S: f64 = 0.15;

/// A viewer and his motion. [`Pilot::advance`] takes him on by a frame.
#[derive(Debug)]
pub struct Pilot {
    settings: MotionSettings,
    start: Stand,
    place: Place,
    probe: Probe,
    ground: Ground,
    /// log2 of the scale, as the level of tiles as large as the comfortable distance.
    scale: Spring,
    facing: Facing,
    /// Octaves per second along the terrain's axes.
    velocity: DVec3,
    /// Radians per second to the right and up, and towards the right shoulder.
    turning: DVec3,
    /// Speed over the ground as a share of full speed, 0 to 1: levelling turns so much.
    travelling: f64,
    headroom: f64,
    /// Turning upright, as asked for, until that is done.
    levelling_up: bool,
    dive: Option<Dive>,
    /// The dives before it, that lead on back.
    left: Dives,
    trail: Trail,
    /// What the dive's button does as it stays held.
    button: Button,
    hold: Option<Hold>,
    /// Octaves by which hands have made the scale other than the comfortable one.
    off_comfort: f64,
    /// The scale goes where it is comfortable although the viewer rests: he has done something to it himself.
    settles: bool,
    /// How high over the ground the viewer's eyes are, in metres, where that is the comfortable distance.
    eye_height_m: Option<f64>,
    throw: Throw,
    jumps: u32,
}

/// The nearest ground, from the viewer.
#[derive(Clone, Copy, Debug)]
struct Ground {
    /// No ground is nearer, anchor tiles.
    least: f64,
    /// Nearly the distance, anchor tiles.
    most: f64,
    /// Straight away from it, a unit vector.
    away: DVec3,
}

impl Ground {
    fn new(place: &Place, nearest: Nearest) -> Ground {
        let away = (place.position - nearest.point).try_normalize().unwrap_or(DVec3::Y);
        // On the ground itself there is no speed, and yet there must be a way off it.
        let least = nearest.least.max(1e-9);
        Ground { least, most: nearest.most.max(least), away }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Button {
    Released,
    /// Falls, and the look turns to the target, unless the viewer has looked elsewhere.
    Diving {
        gazing: bool,
    },
    /// There was nothing to dive to.
    Idle,
}

impl Pilot {
    /// A viewer who stands still. One who is under the ground, or on it, is lifted off it.
    pub fn at(stand: &Stand, settings: &MotionSettings) -> Pilot {
        let settings = settings.checked();
        let mut place = stand.place.clone();
        to_grain(&mut place);
        let height = if stand.height.is_finite() { stand.height.clamp(1e-6, 1e6) } else { HEIGHT_CELLS };
        let lowest = place.ground(place.position.x, place.position.z) + 0.05 * height;
        place.position.y = place.position.y.max(lowest);
        to_grain(&mut place);
        let mut probe = Probe::default();
        let ground = Ground::new(&place, probe.nearest(&place, place.position, TOLERANCE));
        let scale = Spring::at(place.level() as f64 - height.log2());
        let mut pilot = Pilot {
            settings,
            start: stand.clone(),
            place,
            probe,
            ground,
            scale,
            facing: Facing::new(DQuat::IDENTITY, DVec3::Y),
            velocity: DVec3::ZERO,
            turning: DVec3::ZERO,
            travelling: 0.0,
            headroom: 1.0,
            levelling_up: false,
            dive: None,
            left: Dives::default(),
            trail: Trail::default(),
            button: Button::Released,
            hold: None,
            off_comfort: 0.0,
            settles: false,
            eye_height_m: None,
            throw: Throw::default(),
            jumps: 0,
        };
        pilot.follow();
        let up = if pilot.settings.levelling { pilot.ground_up() } else { DVec3::Y };
        let orientation = stand.orientation.as_dquat().normalize();
        let orientation = if orientation.is_finite() { orientation } else { DQuat::IDENTITY };
        pilot.facing = Facing::new(orientation, up);
        pilot
    }

    /// Another place to start from, and there. What is set stays.
    pub fn go_to(&mut self, stand: &Stand) {
        let Pilot { settings, eye_height_m, .. } = *self;
        let (probe, jumps) = (std::mem::take(&mut self.probe), self.jumps.wrapping_add(1));
        *self = Pilot { probe, eye_height_m, jumps, ..Pilot::at(stand, &settings) };
    }

    /// How often the viewer came to be elsewhere at once, or turned at once: nothing of the picture before was where it
    /// had been.
    pub fn jumps(&self) -> u32 {
        self.jumps
    }

    /// The nearest ground is kept as far away as the floor is below a wearer's eyes, in metres: it is what he stands on.
    /// None: at the set distance.
    pub fn stand_on_ground(&mut self, eye_height_m: Option<f64>) {
        let eye_height_m = eye_height_m.filter(|m| m.is_finite()).map(|m| m.clamp(0.25, 50.0));
        self.settles |= self.eye_height_m.is_some() != eye_height_m.is_some();
        self.eye_height_m = eye_height_m;
    }

    /// Turns the play space so that what is straight ahead in it comes to be ahead of `gaze`, which turns the head's axes
    /// to the play space's.
    pub fn turn_to(&mut self, gaze: Quat) {
        let ahead = gaze * Vec3::NEG_Z;
        if ahead.x.hypot(ahead.z) > 0.1 {
            // The gaze is so much to the right of ahead; the land is to follow it there.
            self.facing.turn(-f64::from(ahead.x.atan2(-ahead.z)));
            self.jumps = self.jumps.wrapping_add(1);
        }
    }

    /// What is set, with the speed as it is now.
    pub fn settings(&self) -> &MotionSettings {
        &self.settings
    }

    /// The input of the last frame dives, and there is something to dive to.
    pub fn dives(&self) -> bool {
        matches!(self.button, Button::Diving { .. })
    }

    /// Other settings, from now on.
    pub fn set(&mut self, settings: &MotionSettings) {
        self.settings = settings.checked();
    }

    /// Distance to the nearest ground in anchor tiles: never less than it is, and seldom more than 1/100 more.
    pub fn distance(&self) -> f64 {
        self.ground.most
    }

    /// Optic flow: radians per second at which the nearest ground would go by, were the viewer's motion along it. At
    /// full speed [`MotionSettings::speed`] · ln 2.
    pub fn flow(&self) -> f64 {
        self.velocity.length() * LN_2
    }

    /// Octaves per second, over the ground.
    pub fn speed(&self) -> f64 {
        self.velocity.length()
    }

    /// Where the viewer is.
    pub fn standpoint(&self) -> Standpoint<'_> {
        Standpoint {
            place: &self.place,
            position: self.place.position,
            height: self.height(),
            depth: self.scale.value + HEIGHT_CELLS.log2() - START_LEVEL as f64,
            orientation: self.facing.orientation().as_quat().normalize(),
            heading: self.facing.upright.as_quat().normalize(),
        }
    }

    /// Moves by anchor tiles, to the nearest 2⁻⁴⁰: a drag by hand. It stops half-way to the ground. Returns how far it
    /// went: as much back again ends on the bits it began with.
    pub fn shift(&mut self, tiles: DVec3) -> DVec3 {
        let nearest_allowed = LONGEST_STEP * self.ground.least;
        let mut gone = DVec3::ZERO;
        let mut left = if tiles.is_finite() { place::on_grain(tiles) } else { DVec3::ZERO };
        // Where the ground falls back as one comes, more steps get further; a few get nearly as far.
        for _ in 0..SHIFT_STEPS {
            let clear = self.ground.least - nearest_allowed;
            if left == DVec3::ZERO || clear <= 0.0 {
                break;
            }
            let step = self.walk(left.clamp_length_max(clear));
            gone += step;
            left -= step;
        }
        gone
    }

    /// Takes the viewer on by `dt_s` seconds. `headroom` is the renderer's wish, from 1 (go on) to 0 (stop): it slows
    /// all travel.
    pub fn advance(&mut self, dt_s: f64, input: &Input, headroom: f64) -> Standpoint<'_> {
        let input = input.checked();
        let dt_s = if dt_s.is_nan() { 0.0 } else { dt_s.clamp(0.0, LONGEST_FRAME_S) };
        if input.restart {
            let start = self.start.clone();
            self.go_to(&start);
        }
        if self.hold(&input.grab, input.worn) {
            self.leap(None, input.worn);
            self.note_trail();
            return self.standpoint();
        }
        let speed = self.settings.speed * (f64::from(input.faster) / 4.0).exp2();
        self.settings.speed = speed.clamp(SPEEDS.0, SPEEDS.1.min(self.settings.scale_rate / 1.5));
        self.turn(&input, dt_s);
        self.press(&input);
        let steps = dt_s * self.settings.speed.max(self.velocity.length()) * MOST_FLOW / STEP_OCTAVES;
        let steps = steps.ceil().clamp(1.0, MOST_STEPS);
        let headroom = if headroom.is_nan() { 1.0 } else { headroom.clamp(0.0, 1.0) };
        for _ in 0..steps as u32 {
            self.step(&input, headroom, dt_s / steps);
        }
        self.leap(input.leap.as_ref(), input.worn);
        self.note_trail();
        self.standpoint()
    }

    /// All motion of the viewer's own ends here.
    fn stop(&mut self) {
        (self.velocity, self.turning) = (DVec3::ZERO, DVec3::ZERO);
        (self.travelling, self.scale.rate) = (0.0, 0.0);
        (self.levelling_up, self.button) = (false, Button::Released);
    }

    fn note_trail(&mut self) {
        self.trail.note(self.comfortable(), self.ground.most);
    }

    /// A part of a frame: a way short against the distance.
    fn step(&mut self, input: &Input, headroom: f64, dt_s: f64) {
        let brake = if headroom < self.headroom { BRAKE_S } else { RELEASE_S };
        self.headroom += (headroom - self.headroom) * smooth::share(dt_s, brake);
        let up = self.ground_up();
        let wanted = self.wanted(input, up) * self.headroom;
        self.velocity += (wanted - self.velocity) * smooth::share(dt_s, self.settings.inertia_s);
        if wanted == DVec3::ZERO && self.velocity.length() < RESTS_AT {
            (self.velocity, self.travelling) = (DVec3::ZERO, 0.0);
        }
        self.velocity = self.held_off(self.velocity);
        let deeper = self.travel(dt_s);
        // A wearer who rests sees every change of scale as motion, wherever his head is not at the seat.
        let moving = self.velocity.length() / (RESTING * self.settings.speed);
        self.settles &= (self.goal() - self.scale.value).abs() > SETTLED;
        let freely = if input.worn && !self.settles { moving.min(1.0) } else { 1.0 };
        self.scale.follow(
            self.goal(),
            deeper / dt_s.max(1e-9),
            dt_s,
            self.settings.scale_s,
            self.settings.scale_rate * freely,
        );
        self.follow();
        self.level(up, dt_s);
        self.gaze(input, dt_s);
    }

    /// Octaves per second that the input asks for, along the terrain's axes.
    fn wanted(&mut self, input: &Input, up: DVec3) -> DVec3 {
        let speed = self.settings.speed;
        let nearest = self.ground.most;
        if let (Button::Diving { .. }, Some(dive)) = (self.button, &self.dive) {
            let (course, longer) = dive.course_in(up);
            return course * (speed * (longer * dive.way.length() / nearest).min(MOST_FLOW));
        }
        let travel = self.play_space(input.worn) * input.aim.as_dquat() * input.travel.as_dvec3();
        let rise = f64::from(input.rise);
        if rise == 0.0 {
            return travel * speed;
        }
        let back = self.way_back().filter(|dive| dive.leads_back(&self.place, nearest));
        let (course, faster) = match &back {
            Some(dive) => {
                let (course, longer) = dive.course_out(&self.place, up);
                (course, longer * dive.way.length() / nearest)
            }
            // Away from the nearest ground; and upwards, which leads out of any canyon, as nothing hangs over. Their
            // middle is at most 45° off straight away.
            None => {
                let course = (self.ground.away + DVec3::Y).try_normalize().unwrap_or(DVec3::Y);
                (course, 1.0 / course.dot(self.ground.away).max(0.7))
            }
        };
        travel * speed * (1.0 - rise) + course * (rise * speed * faster.min(MOST_FLOW))
    }

    /// The dive that leads back from here: the last one, and farther out than it began the one before.
    fn way_back(&mut self) -> Option<Dive> {
        if self.dive.is_none_or(|dive| dive.left(&self.place) <= 0.0)
            && let Some(before) = self.left.take_up(&self.place)
        {
            self.dive = Some(before);
        }
        self.dive
    }

    /// A dive begins. The one before leads on, where this one leads back to.
    fn begin_dive(&mut self, way: DVec3) {
        let next = Dive::new(&self.place, way);
        if let Some(before) = self.dive.replace(next).filter(|dive| dive.left(&self.place) > LEFT_FROM) {
            self.left.leave(before);
        }
    }

    /// A velocity without what leads where the viewer must not: flat courses along the ground do not end in it, and
    /// both ends of the world are come to slowly.
    fn held_off(&self, velocity: DVec3) -> DVec3 {
        let away = self.ground.away;
        let out = velocity.dot(away);
        let speed = velocity.length();
        if speed == 0.0 {
            return velocity;
        }
        let octave = self.comfortable() + HEIGHT_CELLS.log2();
        let kept = if out < 0.0 {
            let slide = self.settings.slide.to_radians();
            let free = if self.button == Button::Released {
                smooth::step(-out / speed, slide.sin(), (2.0 * slide).sin())
            } else {
                1.0
            };
            free * smooth::step(DEEPEST_LEVEL as f64 - octave, 0.0, END_OCTAVES)
        } else {
            smooth::step(octave - HIGHEST_LEVEL as f64, 0.0, END_OCTAVES)
        };
        velocity - away * (out * (1.0 - kept))
    }

    /// Moves by the velocity. Returns by how many octaves that should have taken the viewer deeper.
    fn travel(&mut self, dt_s: f64) -> f64 {
        let speed = self.velocity.length();
        let way = speed * dt_s * LN_2;
        let mut deeper = 0.0;
        if way > 0.0 {
            let direction = self.velocity / speed;
            let out = direction.dot(self.ground.away);
            // The distance grows by `out` of the way, and the way with the distance: exponentially.
            let share = if (out * way).abs() > 1e-9 { (out * way).exp_m1() / out } else { way };
            let length = (share * self.ground.most).min(LONGEST_STEP * self.ground.least);
            deeper = -(out * length / self.ground.most).ln_1p() / LN_2;
            self.walk(direction * length);
        }
        let full = (speed / self.settings.speed).min(1.0);
        self.travelling += (full - self.travelling) * smooth::share(dt_s, 0.3);
        if let Some(dive) = &mut self.dive {
            dive.flown += if matches!(self.button, Button::Diving { .. }) { speed * dt_s } else { 0.0 };
            if !dive.settle(&self.place) {
                self.left.leave(*dive);
                self.dive = None;
            }
        }
        deeper
    }

    /// Moves by tiles, rounded as the place rounds them, and finds the nearest ground anew. Returns how far.
    fn walk(&mut self, tiles: DVec3) -> DVec3 {
        let shift = place::on_grain(tiles);
        self.place.walk(shift);
        if let Some(dive) = &mut self.dive {
            dive.moved(shift);
        }
        if let Some(hold) = &mut self.hold {
            hold.moved(shift);
        }
        self.left.moved(shift);
        self.trail.moved(shift);
        self.ground =
            Ground::new(&self.place, self.probe.nearest(&self.place, self.place.position, TOLERANCE));
        shift
    }

    /// The scale with the nearest ground at the comfortable distance.
    fn comfortable(&self) -> f64 {
        let comfort_m = self.eye_height_m.unwrap_or(self.settings.comfort_m);
        self.place.level() as f64 - (self.ground.most * COMFORT_M / comfort_m).log2()
    }

    /// Where the scale is to go.
    fn goal(&self) -> f64 {
        self.comfortable() + self.off_comfort
    }

    /// The distance that is the comfortable one for the user, in anchor tiles. A level deeper it is twice as many, to the
    /// bit.
    fn height(&self) -> f64 {
        let octaves = self.place.level() as f64 - self.scale.value;
        (octaves - octaves.floor()).exp2() * octaves.floor().exp2()
    }

    /// The anchor follows the scale.
    fn follow(&mut self) {
        let octave = self.scale.value + HEIGHT_CELLS.log2();
        while octave >= self.place.level() as f64 + DEEPER_BY {
            self.place.deeper();
            self.anchor_moved(1);
        }
        while octave < self.place.level() as f64 - LESS_DEEP_BY && self.place.shallower() {
            self.anchor_moved(-1);
        }
    }

    fn anchor_moved(&mut self, levels: i32) {
        let scale = f64::from(levels).exp2();
        // Half of an odd multiple of the grain is none; and a viewer who was beside the tile is two tiles beside its child.
        let rounded = place::on_grain(self.place.position) - self.place.position;
        to_grain(&mut self.place);
        self.ground.least *= scale;
        self.ground.most *= scale;
        if let Some(dive) = &mut self.dive {
            dive.anchor_moved(levels);
        }
        if let Some(hold) = &mut self.hold {
            hold.anchor_moved(levels, rounded);
        }
        self.left.anchor_moved(levels);
        self.trail.anchor_moved(levels);
    }

    /// Which way the ground faces that counts as level here.
    fn ground_up(&self) -> DVec3 {
        let level = self.scale.value + HEIGHT_CELLS.log2() - self.settings.levelling_octaves;
        upright::ground_up(&self.place, level)
    }

    /// Turns the play space's axes, as the user has them, to the terrain's.
    fn play_space(&self, worn: bool) -> DQuat {
        if worn { self.facing.upright } else { self.facing.orientation() }
    }

    /// Mouse and sticks.
    fn turn(&mut self, input: &Input, dt_s: f64) {
        let settings = &self.settings;
        let turn = input.turn.as_dvec2() * settings.turn_rate.to_radians();
        let wanted = turn.extend(f64::from(input.roll) * settings.roll_rate.to_radians());
        self.turning += (wanted - self.turning) * smooth::share(dt_s, settings.turn_inertia_s);
        let look = input.look.as_dvec2() + DVec2::new(self.turning.x, self.turning.y) * dt_s;
        if input.worn {
            self.facing.turn(look.x);
        } else {
            self.facing.look(look.x, look.y);
            self.facing.tilt(self.turning.z * dt_s);
        }
        self.levelling_up = (self.levelling_up || input.level_up) && input.roll == 0.0;
    }

    /// "Up" follows the ground of a viewer who travels, and of one who asks for it.
    fn level(&mut self, up: DVec3, dt_s: f64) {
        if self.levelling_up {
            let most = self.settings.level_up_rate.to_radians() * dt_s;
            let share = smooth::share(dt_s, LEVEL_UP_S);
            let off = self.facing.level(up, most, share) + self.facing.unroll(most, share);
            self.levelling_up = off > 0.002;
        } else if self.settings.levelling {
            let most = self.settings.levelling_rate.to_radians() * dt_s * self.travelling;
            self.facing.level(up, most, smooth::share(dt_s, LEVELLING_S));
        }
    }
}

/// Puts a viewer where [`Place::walk`] is exact, and over his anchor.
fn to_grain(place: &mut Place) {
    place.position = place::on_grain(place.position);
    place.walk(DVec3::ZERO);
}
