//! What a person may set about hands.

use serde::{Deserialize, Serialize};

use crate::wrist::PanelPlace;

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
    /// Strength with which a hand feels that it takes hold of the land, and half of that as it lets go, 0 to 1; 0.3.
    pub grab_pulse: f32,
    /// Metres that a step through the air goes over level ground, thrown half-way up, 1 to 100; 12.
    pub leap_m: f32,
    /// Degrees of the steepest ground that it lands on, 0 to 90; 40.
    pub leap_slope: f32,
    /// The wearer stands, and on the ground: it is kept as far below the eyes as the floor is, where that is known.
    pub standing: bool,
    /// Hands are drawn, with what they hold.
    pub models: bool,
    /// Rays are drawn from the hands to the land.
    pub rays: bool,
    /// Where the panel is.
    pub panel: PanelPlace,
}

impl Default for ControllerSettings {
    fn default() -> ControllerSettings {
        ControllerSettings {
            left_handed: false,
            fly_by_head: false,
            snap_turn: 30.0,
            dead_zone: 0.15,
            tick: 0.4,
            grab_pulse: 0.3,
            leap_m: 12.0,
            leap_slope: 40.0,
            standing: false,
            models: true,
            rays: true,
            panel: PanelPlace::Wrist,
        }
    }
}
