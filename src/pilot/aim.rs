//! Rays of the user's, and what they lead to: dives, and where the look goes in them.

use super::{Button, Pilot, smooth};
use crate::input::{Input, Ray};
use crate::rig::COMFORT_M;
use glam::DVec3;

/// Most octaves beyond the nearest ground at which a target of a dive may be.
const RAY_OCTAVES: f64 = 14.0;

/// In an octave of a dive the look turns so much of the way to the target.
const GAZE_PER_OCTAVE: f64 = 0.8;

/// It begins to gently, over so many octaves, ...
const GAZE_BEGINS: f64 = 0.7;

/// ... and is no faster than this share of the rate that a stick turns it.
const GAZE_RATE: f64 = 0.5;

impl Pilot {
    /// How far along a ray of the play space the ground is met, in metres of the user's; None within 14 octaves of the
    /// nearest ground.
    pub fn point_at(&mut self, ray: &Ray, worn: bool) -> Option<f64> {
        self.meet(ray, worn).map(|(way, origin)| (way - origin).length() * COMFORT_M / self.height())
    }

    /// Where a point of the play space is, in metres from the seat: in anchor tiles.
    pub fn tiles_at(&self, point_m: DVec3, worn: bool) -> DVec3 {
        let tiles_per_metre = self.height() / COMFORT_M;
        self.place.position + self.play_space(worn) * point_m * tiles_per_metre
    }

    /// The dive's button.
    pub(super) fn press(&mut self, input: &Input) {
        let looks = input.look != glam::Vec2::ZERO || input.turn != glam::Vec2::ZERO;
        self.button = match (input.dive, self.button) {
            (None, _) => Button::Released,
            (Some(ray), Button::Released) => match self.meet(&ray, input.worn) {
                Some((way, _)) => {
                    self.begin_dive(way);
                    Button::Diving { gazing: !input.worn }
                }
                None => Button::Idle,
            },
            (Some(_), Button::Diving { gazing }) => Button::Diving { gazing: gazing && !looks },
            (Some(_), Button::Idle) => Button::Idle,
        };
    }

    /// Where a ray of the play space meets the ground and where it begins, from the viewer in anchor tiles.
    fn meet(&mut self, ray: &Ray, worn: bool) -> Option<(DVec3, DVec3)> {
        let play_space = self.play_space(worn);
        let tiles_per_metre = self.height() / COMFORT_M;
        let origin = play_space * ray.origin_m.as_dvec3() * tiles_per_metre;
        let direction = (play_space * ray.direction.as_dvec3()).try_normalize()?;
        let range = RAY_OCTAVES.exp2() * self.ground.most;
        // A hand may reach far, but not out of the neighbourhood.
        let origin = origin.clamp_length_max(8.0);
        let met = self.probe.ray(&self.place, self.place.position + origin, direction, range)?;
        let way = origin + met * direction;
        (way.length() > 1e-6).then_some((way, origin))
    }

    /// In a dive the look turns to the target, as fast as the viewer flies; and a target that other ground hides gives
    /// way to that.
    pub(super) fn gaze(&mut self, input: &Input, dt_s: f64) {
        let Button::Diving { gazing } = self.button else { return };
        let up = self.ground_up();
        let Some(dive) = self.dive else {
            self.button = Button::Idle;
            return;
        };
        if dive.is_blocked(up, self.ground.most) {
            self.begin_dive(-self.ground.away * self.ground.most);
        }
        let Some(dive) = self.dive.filter(|_| gazing && !input.worn) else { return };
        let target = self.facing.upright.inverse() * dive.way.normalize();
        let begun = smooth::step(dive.flown, 0.0, GAZE_BEGINS);
        let share = begun * (1.0 - (-GAZE_PER_OCTAVE * self.velocity.length() * dt_s).exp());
        let most = GAZE_RATE * self.settings.turn_rate.to_radians() * dt_s;
        let level = target.x.hypot(target.z);
        // Straight below there is no right or left.
        let right = target.x.atan2(-target.z) * share * level;
        let above = (target.y.atan2(level) - self.facing.pitch) * share;
        self.facing.turn(right.clamp(-most, most));
        self.facing.pitch += above.clamp(-most, most);
    }
}
