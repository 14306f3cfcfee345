//! What a person may set about moving.

use serde::{Deserialize, Serialize};

/// How moving feels. Each number is brought into its range when a [`Pilot`](super::Pilot) takes the settings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionSettings {
    /// Speed at full stick, in octaves per second, 1/16 to 8; 1.5. Straight at the ground the distance to it halves so
    /// many times a second, sideways the ground goes by at `speed · ln 2` radians per second, at every depth.
    /// [`Input::faster`](crate::input::Input::faster) changes it in flight.
    pub speed: f64,
    /// Distance in metres that the nearest ground is kept at for the user, 0.25 to 50; 2. Nearer shows more depth and
    /// strains the eyes, farther looks flat.
    pub comfort_m: f64,
    /// Seconds in which the scale settles when that distance has changed, 0.1 to 10; 0.8.
    pub scale_s: f64,
    /// Most octaves per second by which the scale changes, 1 to 24; 12. Speeds are held below 2/3 of it.
    pub scale_rate: f64,
    /// Seconds of glide: the time in which about 2/3 of a change of speed has happened, 0 to 2; 0.2. 0 starts and stops
    /// at once.
    pub inertia_s: f64,
    /// Degrees per second at which a stick turns the view, 0 to 360; 90.
    pub turn_rate: f64,
    /// Degrees per second at which the view rolls, 0 to 360; 60.
    pub roll_rate: f64,
    /// Seconds of glide when turning by a stick, 0 to 2; 0.1.
    pub turn_inertia_s: f64,
    /// "Up" follows the ground: on. Where the land lies steep, its horizon is level then. Only a viewer who travels is
    /// turned, the more slowly the slower he travels.
    pub levelling: bool,
    /// Most degrees per second by which levelling turns a viewer at full speed, 0 to 180; 12.
    pub levelling_rate: f64,
    /// Octaves by which the tiles whose slope counts as level are larger than those the viewer is in, 0 to 16; 4. More
    /// is steadier, less follows every hill.
    pub levelling_octaves: f64,
    /// Degrees per second by which [`Input::level_up`](crate::input::Input::level_up) turns, 1 to 360; 60.
    pub level_up_rate: f64,
    /// Degrees from straight along the ground up to which a course towards the ground slides along it, 0 to 40; 20. From
    /// twice the angle on it goes where it points: down, and in. 0 never slides: a course that touches any hill ends
    /// as a dive into it.
    pub slide: f64,
}

impl Default for MotionSettings {
    fn default() -> MotionSettings {
        MotionSettings {
            speed: 1.5,
            comfort_m: 2.0,
            scale_s: 0.8,
            scale_rate: 12.0,
            inertia_s: 0.2,
            turn_rate: 90.0,
            roll_rate: 60.0,
            turn_inertia_s: 0.1,
            levelling: true,
            levelling_rate: 12.0,
            levelling_octaves: 4.0,
            level_up_rate: 60.0,
            slide: 20.0,
        }
    }
}

/// The range of [`MotionSettings::speed`].
pub const SPEEDS: (f64, f64) = (1.0 / 16.0, 8.0);

impl MotionSettings {
    /// The same with every number in its range; one that is none becomes the default.
    pub fn checked(&self) -> MotionSettings {
        let usual = MotionSettings::default();
        let within = |v: f64, (low, high): (f64, f64), usual: f64| {
            if v.is_nan() { usual } else { v.clamp(low, high) }
        };
        let scale_rate = within(self.scale_rate, (1.0, 24.0), usual.scale_rate);
        MotionSettings {
            speed: within(self.speed, SPEEDS, usual.speed).min(scale_rate / 1.5),
            comfort_m: within(self.comfort_m, (0.25, 50.0), usual.comfort_m),
            scale_s: within(self.scale_s, (0.1, 10.0), usual.scale_s),
            scale_rate,
            inertia_s: within(self.inertia_s, (0.0, 2.0), usual.inertia_s),
            turn_rate: within(self.turn_rate, (0.0, 360.0), usual.turn_rate),
            roll_rate: within(self.roll_rate, (0.0, 360.0), usual.roll_rate),
            turn_inertia_s: within(self.turn_inertia_s, (0.0, 2.0), usual.turn_inertia_s),
            levelling: self.levelling,
            levelling_rate: within(self.levelling_rate, (0.0, 180.0), usual.levelling_rate),
            levelling_octaves: within(self.levelling_octaves, (0.0, 16.0), usual.levelling_octaves),
            level_up_rate: within(self.level_up_rate, (1.0, 360.0), usual.level_up_rate),
            slide: within(self.slide, (0.0, 40.0), usual.slide),
        }
    }
}
