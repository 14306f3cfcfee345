//! PURE: what a person wants in one frame, whatever device it came from: keys and mouse, a gamepad, hands.
//!
//! All directions are along the axes of the play space, in which head and hands move: x to the right, y up, −z ahead.
//! Nothing is held from frame to frame here: a key that stays down is in every frame's input.

use glam::{Quat, Vec2, Vec3};

/// What a person wants in one frame. [`Input::default`] wants nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input {
    /// A headset is worn: the head has its own pitch and roll, and [`Input::look`] turns the play space about its
    /// upright axis only. Without one, the whole play space is what looks up, down and aslant.
    pub worn: bool,
    /// What [`Input::travel`] is along: the head or the hand that points, in the play space. Identity: ahead is ahead.
    pub aim: Quat,
    /// Right, up and back (x, y, z), each −1 to 1, as shares of full speed; longer than 1 together is cut to 1.
    /// W S: ∓z, A D: ∓x, Space C: ±y.
    pub travel: Vec3,
    /// Radians by which the look turns in this frame, to the right (x) and up (y), at once: the mouse, a snap turn.
    pub look: Vec2,
    /// −1 to 1: turns to the right (x) and up (y) at the set rates, smoothly: a stick.
    pub turn: Vec2,
    /// −1 to 1: tilts the head towards its right shoulder, at the set rate. Q E.
    pub roll: f32,
    /// Notches by which the speed changes for good: each a quarter of an octave, faster above 0. The wheel.
    pub faster: f32,
    /// Held: falls towards the point of the ground that this ray meets when it is first held. Z, a trigger.
    pub dive: Option<Ray>,
    /// 0 to 1, held: backs out, as a share of full speed. X, the other button.
    pub rise: f32,
    /// Held: the land follows the hands that hold it, left and right; where those are, in metres from the seat. One
    /// drags it, two also turn it and pull it apart. Nothing else moves the viewer meanwhile.
    pub grab: [Option<Vec3>; 2],
    /// A step through the air is shown, or made.
    pub leap: Option<Leap>,
    /// Turns upright over the ground here, roll taken off. L.
    pub level_up: bool,
    /// Back to where the pilot started, at once. R.
    pub restart: bool,
    /// The seat of a wearer is where his head is now, and ahead is where he looks. Home.
    pub recentre: bool,
}

impl Default for Input {
    fn default() -> Input {
        Input {
            worn: false,
            aim: Quat::IDENTITY,
            travel: Vec3::ZERO,
            look: Vec2::ZERO,
            turn: Vec2::ZERO,
            roll: 0.0,
            faster: 0.0,
            dive: None,
            rise: 0.0,
            grab: [None; 2],
            leap: None,
            level_up: false,
            restart: false,
            recentre: false,
        }
    }
}

/// From the eye through the cursor, or along a hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Metres from the seat: where the head was when the session began.
    pub origin_m: Vec3,
    /// Where to; any length but 0.
    pub direction: Vec3,
}

/// A step through the air, along the arc of a ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leap {
    /// Where it is thrown from, and the direction at first.
    pub from: Ray,
    /// How far it would fly over level ground, thrown half-way up; metres above 0.
    pub reach_m: f32,
    /// Radians of the steepest ground that it lands on.
    pub steepest: f32,
    /// The head, which comes to be over where it lands, in metres from the seat.
    pub head_m: Vec3,
    /// It is let go of: the viewer goes there now, if one can stand there.
    pub go: bool,
}

impl Ray {
    /// None where it is from or to nowhere.
    fn checked(self) -> Option<Ray> {
        let Ray { origin_m, direction } = self;
        let is_one = origin_m.is_finite() && direction.is_finite() && direction.length_squared() > 1e-12;
        is_one.then_some(self)
    }
}

impl Leap {
    fn checked(self) -> Option<Leap> {
        let from = self.from.checked()?;
        let is_one = self.reach_m.is_finite() && self.steepest.is_finite() && self.head_m.is_finite();
        let leap = Leap {
            from,
            reach_m: self.reach_m.clamp(0.1, 1_000.0),
            head_m: self.head_m.clamp_length_max(8.0),
            ..self
        };
        is_one.then_some(leap)
    }
}

impl Input {
    /// Whether it takes the viewer anywhere, or turns him.
    pub fn steers(&self) -> bool {
        let Input { worn, aim, faster, recentre, .. } = *self;
        let still = Input { worn, aim, faster, recentre, ..Input::default() };
        *self != still
    }

    /// What two devices want together. Where both point, travel goes where `other` does if it is that which travels.
    pub fn with(&self, other: &Input) -> Input {
        Input {
            worn: self.worn || other.worn,
            aim: if other.travel == Vec3::ZERO { self.aim } else { other.aim },
            travel: self.travel + other.travel,
            look: self.look + other.look,
            turn: self.turn + other.turn,
            roll: self.roll + other.roll,
            faster: self.faster + other.faster,
            dive: self.dive.or(other.dive),
            rise: self.rise.max(other.rise),
            grab: if self.grab == [None; 2] { other.grab } else { self.grab },
            leap: self.leap.or(other.leap),
            level_up: self.level_up || other.level_up,
            restart: self.restart || other.restart,
            recentre: self.recentre || other.recentre,
        }
    }

    /// The same with every number finite and in its range.
    pub fn checked(&self) -> Input {
        let number = |v: f32| if v.is_finite() { v } else { 0.0 };
        let share = |v: f32| number(v).clamp(-1.0, 1.0);
        let all = |v: Vec3| if v.is_finite() { v } else { Vec3::ZERO };
        let aim = self.aim.normalize();
        Input {
            aim: if aim.is_finite() { aim } else { Quat::IDENTITY },
            travel: all(self.travel).clamp_length_max(1.0),
            look: Vec2::new(number(self.look.x), number(self.look.y)).clamp_length_max(std::f32::consts::PI),
            turn: Vec2::new(share(self.turn.x), share(self.turn.y)),
            roll: share(self.roll),
            faster: number(self.faster).clamp(-100.0, 100.0),
            dive: self.dive.and_then(Ray::checked),
            rise: share(self.rise).max(0.0),
            grab: self.grab.map(|hand| hand.filter(|at| at.is_finite())),
            leap: self.leap.and_then(Leap::checked),
            ..*self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_devices_add_up_and_neither_is_taken_for_steering_by_where_it_points() {
        let aim = Quat::from_rotation_y(1.0);
        let hand = Input { worn: true, aim, ..Input::default() };
        assert!(!hand.steers() && !Input { faster: 1.0, ..hand }.steers());
        let keys = Input { travel: Vec3::X, ..Input::default() };
        assert!(keys.steers());
        assert_eq!(keys.with(&hand), Input { worn: true, ..keys });
        let stick = Input { travel: Vec3::NEG_Z, rise: 0.5, ..hand };
        let both = keys.with(&stick);
        assert_eq!((both.travel, both.aim, both.rise), (Vec3::new(1.0, 0.0, -1.0), aim, 0.5));
        assert_eq!(stick.with(&Input::default()), stick);
    }
}
