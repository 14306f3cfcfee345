//! Gamepads: what sticks and buttons ask for, and listening to those that are plugged in.

use std::sync::{Arc, Mutex, PoisonError};

use glam::{Vec2, Vec3};

use crate::settings::{Action, Axis, Button, GamepadSettings, Named, Stick};

/// What sticks and buttons are at. All gamepads count as one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PadState {
    /// Each stick's ways, −1 to 1: right, and away from the person.
    pub sticks: [f32; Stick::COUNT],
    /// How far each button is down, 0 to 1.
    pub buttons: [f32; Button::COUNT],
}

/// What that asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PadWish {
    /// As in [`Input`](crate::input::Input): right, up and back.
    pub travel: Vec3,
    /// To the right and up.
    pub turn: Vec2,
    /// To the right.
    pub roll: f32,
    /// How much of each action its buttons ask for, 0 to 1.
    amounts: [f32; Action::COUNT],
}

/// From here on a button that does something once counts as down.
const DOWN: f32 = 0.5;

impl PadWish {
    /// What a gamepad asks for in this state.
    pub fn new(state: &PadState, settings: &GamepadSettings) -> PadWish {
        let sticks = live(state, settings);
        let axes = &settings.axes;
        let at = |axis: Axis| {
            let sign = if axis.reversed { -1.0 } else { 1.0 };
            axis.stick.map_or(0.0, |stick| sign * sticks[stick as usize])
        };
        let mut amounts = [0.0; Action::COUNT];
        for (_, action) in Action::all() {
            let buttons = settings.buttons.of(*action).iter().map(|button| state.buttons[*button as usize]);
            amounts[*action as usize] = buttons.map(|v| beyond(v, settings.dead_zone)).fold(0.0, f32::max);
        }
        PadWish {
            travel: Vec3::new(at(axes.right), at(axes.up), -at(axes.ahead)),
            turn: Vec2::new(at(axes.turn_right), at(axes.turn_up)),
            roll: at(axes.roll_right),
            amounts,
        }
    }

    /// How much of an action is asked for, 0 to 1.
    pub fn amount(&self, action: Action) -> f32 {
        self.amounts[action as usize]
    }

    /// The actions whose buttons went down.
    pub fn pressed_since(&self, before: &PadWish) -> impl Iterator<Item = Action> + Clone + use<> {
        let (now, before) = (self.amounts, before.amounts);
        let all = Action::all().iter().map(|(_, action)| *action);
        all.filter(move |action| now[*action as usize] >= DOWN && before[*action as usize] < DOWN)
    }
}

/// The share of the way beyond the dead zone, 0 to 1; numbers that are none count as 0.
fn beyond(value: f32, dead_zone: f32) -> f32 {
    if value.is_finite() { ((value - dead_zone) / (1.0 - dead_zone)).clamp(0.0, 1.0) } else { 0.0 }
}

/// The sticks without their dead zones, which are round, and along the curve.
fn live(state: &PadState, settings: &GamepadSettings) -> [f32; Stick::COUNT] {
    let mut live = [0.0; Stick::COUNT];
    for (x, y) in [(Stick::LeftX, Stick::LeftY), (Stick::RightX, Stick::RightY)] {
        let way = Vec2::new(state.sticks[x as usize], state.sticks[y as usize]);
        let length = way.length();
        let wanted = beyond(length, settings.dead_zone).powf(settings.curve);
        if wanted > 0.0 {
            let way = way * (wanted / length);
            (live[x as usize], live[y as usize]) = (way.x, way.y);
        }
    }
    live
}

/// All gamepads there are, now and later. A thread of its own looks for them and listens: both may take a moment.
pub struct Pads(Arc<Mutex<PadState>>);

impl Pads {
    /// Begins to listen, until this goes.
    pub fn open() -> Pads {
        let state: Arc<Mutex<PadState>> = Arc::default();
        let told = Arc::downgrade(&state);
        std::thread::spawn(move || {
            system::listen(|now| match told.upgrade() {
                Some(state) => {
                    *state.lock().unwrap_or_else(PoisonError::into_inner) = now;
                    true
                }
                None => false,
            });
        });
        Pads(state)
    }

    /// What they are at.
    pub fn state(&self) -> PadState {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(feature = "gamepad")]
mod system {
    use std::time::Duration;

    use gilrs::{Axis, Button as Pressed, Gilrs};

    use super::{Button, Named, PadState, Stick};

    /// Longest time after which somebody who has gone is missed.
    const LISTENING: Duration = Duration::from_millis(200);

    /// Tells what they are at whenever that may have changed, as long as anybody hears it.
    pub(super) fn listen(mut hears: impl FnMut(PadState) -> bool) {
        let mut pads = match Gilrs::new() {
            Ok(pads) => pads,
            Err(error) => return tracing::info!("no gamepads: {error}"),
        };
        while hears(state(&pads)) {
            // Comings, goings and changes: what they come to is asked for above.
            pads.next_event_blocking(Some(LISTENING));
            while pads.next_event().is_some() {}
        }
    }

    fn state(pads: &Gilrs) -> PadState {
        let mut state = PadState::default();
        for (_, pad) in pads.gamepads() {
            for (_, stick) in Stick::all() {
                let value = pad.value(axis(*stick));
                let held = &mut state.sticks[*stick as usize];
                *held = if value.abs() > held.abs() { value } else { *held };
            }
            for (_, button) in Button::all() {
                let value = pad.button_data(pressed(*button)).map_or(0.0, |data| data.value());
                let held = &mut state.buttons[*button as usize];
                *held = held.max(value);
            }
        }
        state
    }

    fn axis(stick: Stick) -> Axis {
        match stick {
            Stick::LeftX => Axis::LeftStickX,
            Stick::LeftY => Axis::LeftStickY,
            Stick::RightX => Axis::RightStickX,
            Stick::RightY => Axis::RightStickY,
        }
    }

    fn pressed(button: Button) -> Pressed {
        match button {
            Button::South => Pressed::South,
            Button::East => Pressed::East,
            Button::North => Pressed::North,
            Button::West => Pressed::West,
            Button::LeftBumper => Pressed::LeftTrigger,
            Button::RightBumper => Pressed::RightTrigger,
            Button::LeftTrigger => Pressed::LeftTrigger2,
            Button::RightTrigger => Pressed::RightTrigger2,
            Button::Select => Pressed::Select,
            Button::Start => Pressed::Start,
            Button::Guide => Pressed::Mode,
            Button::LeftStick => Pressed::LeftThumb,
            Button::RightStick => Pressed::RightThumb,
            Button::DpadUp => Pressed::DPadUp,
            Button::DpadDown => Pressed::DPadDown,
            Button::DpadLeft => Pressed::DPadLeft,
            Button::DpadRight => Pressed::DPadRight,
        }
    }
}

/// Built without gamepads.
#[cfg(not(feature = "gamepad"))]
mod system {
    use super::PadState;

    pub(super) fn listen(_: impl FnMut(PadState) -> bool) {}
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Settings;

    fn gamepad() -> GamepadSettings {
        Settings::default().gamepad
    }

    fn sticks(sticks: [f32; Stick::COUNT]) -> PadState {
        PadState { sticks, ..PadState::default() }
    }

    #[test]
    fn a_pad_at_rest_or_nearly_so_asks_for_nothing() {
        let drifting = PadState { sticks: [0.08; 4], buttons: [0.1; Button::COUNT] };
        for state in [PadState::default(), drifting, PadState { sticks: [f32::NAN; 4], ..drifting }] {
            assert_eq!(PadWish::new(&state, &gamepad()), PadWish::default());
        }
    }

    #[test]
    fn a_stick_goes_from_nothing_to_all_without_a_jump_and_as_far_aslant() {
        let along = |way| PadWish::new(&sticks([0.0, way, 0.0, 0.0]), &gamepad()).travel.z;
        let mut before = 0.0;
        for i in 0..=100 {
            let now = -along(i as f32 / 100.0);
            assert!(now >= before && now - before < 0.03, "{i}: {before} {now}");
            before = now;
        }
        assert_eq!(before, 1.0);
        assert_eq!(along(-1.0), 1.0, "back");
        let aslant = PadWish::new(&sticks([0.71, 0.71, 0.0, 0.0]), &gamepad()).travel;
        assert!((aslant.length() - 1.0).abs() < 0.02 && aslant.x > 0.69 && aslant.z < -0.69, "{aslant}");
        // A stick in the corner of a square gate asks for no more than all.
        assert!(PadWish::new(&sticks([1.0, 1.0, 0.0, 0.0]), &gamepad()).travel.length() <= 1.001);
    }

    #[test]
    fn sticks_do_what_the_settings_say() {
        let mut settings = gamepad();
        settings.axes = toml::from_str(
            "right = 'none'\nahead = '-right_y'\nup = 'left_y'\nturn_right = 'left_x'\nturn_up = 'none'\nroll_right = 'right_x'",
        )
        .unwrap_or_else(|error| panic!("{error}"));
        let wish = PadWish::new(&sticks([0.0, 1.0, 1.0, 0.0]), &settings);
        assert_eq!((wish.travel, wish.turn, wish.roll), (Vec3::Y, Vec2::ZERO, 1.0));
        let wish = PadWish::new(&sticks([-1.0, 0.0, 0.0, 1.0]), &settings);
        assert_eq!((wish.travel, wish.turn, wish.roll), (Vec3::Z, Vec2::NEG_X, 0.0));
    }

    #[test]
    fn buttons_do_what_the_settings_say() {
        let mut settings = gamepad();
        settings.buttons =
            toml::from_str("dive = ['south', 'right_stick']").unwrap_or_else(|error| panic!("{error}"));
        for (_, button) in Button::all() {
            let mut state = PadState::default();
            state.buttons[*button as usize] = 1.0;
            let wish = PadWish::new(&state, &settings);
            let dives = matches!(button, Button::South | Button::RightStick);
            assert_eq!(wish.amount(Action::Dive), if dives { 1.0 } else { 0.0 }, "{button:?}");
            assert_eq!(wish.pressed_since(&PadWish::default()).count(), usize::from(dives), "{button:?}");
        }
    }
}
