//! What settings call actions, keys, buttons and sticks.

use std::fmt;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use winit::keyboard::KeyCode;

/// Something that settings call by a name.
pub trait Named: Copy + Sized + 'static {
    /// What one of them is called: `key`, `button`, ...
    const KIND: &'static str;

    /// All of them with their names.
    fn all() -> &'static [(&'static str, Self)];

    /// The one of this name.
    fn find(name: &str) -> Option<Self> {
        Self::all().iter().find(|(known, _)| *known == name).map(|(_, one)| *one)
    }
}

macro_rules! named {
    ($(#[$doc:meta])* $kind:ident, $word:literal, { $($(#[$about:meta])* $variant:ident = $name:literal),* $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum $kind { $($(#[$about])* $variant),* }

        impl $kind {
            /// How many there are.
            pub const COUNT: usize = [$($name),*].len();
        }

        impl Named for $kind {
            const KIND: &'static str = $word;

            fn all() -> &'static [(&'static str, $kind)] {
                &[$(($name, $kind::$variant)),*]
            }
        }
    };
}

named!(
    /// What a key or a button may do.
    Action, "action", {
        /// Fly ahead.
        Ahead = "ahead",
        /// Fly back.
        Back = "back",
        /// Fly left.
        Left = "left",
        /// Fly right.
        Right = "right",
        /// Fly up.
        Up = "up",
        /// Fly down.
        Down = "down",
        /// Roll left.
        RollLeft = "roll_left",
        /// Roll right.
        RollRight = "roll_right",
        /// A notch faster.
        Faster = "faster",
        /// A notch slower.
        Slower = "slower",
        /// Held: dive.
        Dive = "dive",
        /// Held: back out.
        BackOut = "back_out",
        /// Turn upright.
        LevelUp = "level_up",
        /// Back to the start.
        Restart = "restart",
        /// The wearer's seat is where his head is.
        Recentre = "recentre",
        /// Take the mouse, or let it go.
        TakeMouse = "take_mouse",
        /// Another eye in the window.
        NextEye = "next_eye",
        /// Keep the picture.
        Screenshot = "screenshot",
        /// Keep the place.
        Bookmark = "bookmark",
        /// Show the panels, or hide them.
        Panels = "panels",
        /// Full screen, and back.
        FullScreen = "full_screen",
        /// Let the mouse go; when it is free, end.
        End = "end",
    }
);

impl Action {
    /// Its name in settings.
    pub fn name(self) -> &'static str {
        Action::all()[self as usize].0
    }

    /// What it does, for people.
    pub fn does(self) -> &'static str {
        match self {
            Action::Ahead => "fly ahead",
            Action::Back => "fly back",
            Action::Left => "fly left",
            Action::Right => "fly right",
            Action::Up => "fly up",
            Action::Down => "fly down",
            Action::RollLeft => "roll left",
            Action::RollRight => "roll right",
            Action::Faster => "faster by a quarter of an octave",
            Action::Slower => "slower by a quarter of an octave",
            Action::Dive => "held: dive to the point under the cursor, or ahead",
            Action::BackOut => "held: back out",
            Action::LevelUp => "level up",
            Action::Restart => "back to the start",
            Action::Recentre => "in the headset: sit here, and look ahead",
            Action::TakeMouse => "take the mouse and look around with it, or let it go",
            Action::NextEye => "show the left eye, the right eye, both, a spectator's picture",
            Action::Screenshot => "keep the picture",
            Action::Bookmark => "keep the place as a bookmark",
            Action::Panels => "show the panels, or hide them",
            Action::FullScreen => "full screen, and back",
            Action::End => "let the mouse go; when it is free, end",
        }
    }
}

named!(
    /// A button of a gamepad, by its place.
    Button, "button", {
        /// The lowest of four: A on many.
        South = "south",
        /// The right one of four: B on many.
        East = "east",
        /// The highest of four: Y on many.
        North = "north",
        /// The left one of four: X on many.
        West = "west",
        /// Above the left trigger.
        LeftBumper = "left_bumper",
        /// Above the right trigger.
        RightBumper = "right_bumper",
        /// Pulled with the left forefinger.
        LeftTrigger = "left_trigger",
        /// Pulled with the right forefinger.
        RightTrigger = "right_trigger",
        /// In the middle, to the left.
        Select = "select",
        /// In the middle, to the right.
        Start = "start",
        /// In the middle, with the maker's mark.
        Guide = "guide",
        /// The left stick, pressed.
        LeftStick = "left_stick",
        /// The right stick, pressed.
        RightStick = "right_stick",
        /// The cross, up.
        DpadUp = "dpad_up",
        /// The cross, down.
        DpadDown = "dpad_down",
        /// The cross, left.
        DpadLeft = "dpad_left",
        /// The cross, right.
        DpadRight = "dpad_right",
    }
);

named!(
    /// A way that a gamepad's stick moves: to the right, or away from the person.
    Stick, "stick", {
        /// The left one, to the right.
        LeftX = "left_x",
        /// The left one, away.
        LeftY = "left_y",
        /// The right one, to the right.
        RightX = "right_x",
        /// The right one, away.
        RightY = "right_y",
    }
);

/// A stick's way in one of its senses, or nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Axis {
    /// Which; None: nothing moves it.
    pub stick: Option<Stick>,
    /// The other way round.
    pub reversed: bool,
}

impl Axis {
    /// The axis that is written like this: `left_x`, `-left_x` or `none`.
    pub fn find(text: &str) -> Option<Axis> {
        if text == "none" {
            return Some(Axis::default());
        }
        let name = text.strip_prefix('-');
        let stick = Stick::find(name.unwrap_or(text))?;
        Some(Axis { stick: Some(stick), reversed: name.is_some() })
    }
}

impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.stick.map_or("none", |stick| Stick::all()[stick as usize].0);
        write!(f, "{}{name}", if self.reversed { "-" } else { "" })
    }
}

impl Serialize for Axis {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Axis {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Axis, D::Error> {
        let text = String::deserialize(from)?;
        Axis::find(&text).ok_or_else(|| D::Error::custom(format!("no stick is called {text}")))
    }
}

/// A key of the keyboard, by its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Key(pub KeyCode);

impl Named for Key {
    const KIND: &'static str = "key";

    fn all() -> &'static [(&'static str, Key)] {
        KEYS
    }
}

macro_rules! keys {
    ($($name:literal $code:ident),* $(,)?) => { &[$(($name, Key(KeyCode::$code))),*] };
}

const KEYS: &[(&str, Key)] = keys!(
    "A" KeyA, "B" KeyB, "C" KeyC, "D" KeyD, "E" KeyE, "F" KeyF, "G" KeyG, "H" KeyH, "I" KeyI, "J" KeyJ, "K" KeyK,
    "L" KeyL, "M" KeyM, "N" KeyN, "O" KeyO, "P" KeyP, "Q" KeyQ, "R" KeyR, "S" KeyS, "T" KeyT, "U" KeyU, "V" KeyV,
    "W" KeyW, "X" KeyX, "Y" KeyY, "Z" KeyZ,
    "0" Digit0, "1" Digit1, "2" Digit2, "3" Digit3, "4" Digit4, "5" Digit5, "6" Digit6, "7" Digit7, "8" Digit8,
    "9" Digit9,
    "F1" F1, "F2" F2, "F3" F3, "F4" F4, "F5" F5, "F6" F6, "F7" F7, "F8" F8, "F9" F9, "F10" F10, "F11" F11, "F12" F12,
    "Space" Space, "Esc" Escape, "Enter" Enter, "Tab" Tab, "Backspace" Backspace, "Insert" Insert, "Delete" Delete,
    "Home" Home, "End" End, "PageUp" PageUp, "PageDown" PageDown,
    "Up" ArrowUp, "Down" ArrowDown, "Left" ArrowLeft, "Right" ArrowRight,
    "Minus" Minus, "Equal" Equal, "Comma" Comma, "Period" Period, "Slash" Slash, "Semicolon" Semicolon, "Quote" Quote,
    "Backquote" Backquote, "Backslash" Backslash, "BracketLeft" BracketLeft, "BracketRight" BracketRight,
    "ShiftLeft" ShiftLeft, "ShiftRight" ShiftRight, "ControlLeft" ControlLeft, "ControlRight" ControlRight,
    "AltLeft" AltLeft, "AltRight" AltRight,
    "Numpad0" Numpad0, "Numpad1" Numpad1, "Numpad2" Numpad2, "Numpad3" Numpad3, "Numpad4" Numpad4, "Numpad5" Numpad5,
    "Numpad6" Numpad6, "Numpad7" Numpad7, "Numpad8" Numpad8, "Numpad9" Numpad9,
    "NumpadAdd" NumpadAdd, "NumpadSubtract" NumpadSubtract, "NumpadMultiply" NumpadMultiply,
    "NumpadDivide" NumpadDivide, "NumpadDecimal" NumpadDecimal, "NumpadEnter" NumpadEnter,
);

/// The keys, or the buttons, of each action.
#[derive(Clone, Debug, PartialEq)]
pub struct Bindings<T>(Vec<Vec<T>>);

impl<T: Named + PartialEq> Bindings<T> {
    /// What an action is bound to.
    pub fn of(&self, action: Action) -> &[T] {
        &self.0[action as usize]
    }

    /// The actions of a key or a button.
    pub fn actions(&self, one: T) -> impl Iterator<Item = Action> {
        Action::all().iter().map(|(_, action)| *action).filter(move |action| self.of(*action).contains(&one))
    }

    /// The names of what an action is bound to.
    pub fn names(&self, action: Action) -> impl Iterator<Item = &'static str> {
        self.of(action)
            .iter()
            .filter_map(|one| T::all().iter().find(|(_, other)| other == one))
            .map(|(name, _)| *name)
    }

    /// What is bound to several actions, with their names.
    pub fn shared(&self) -> impl Iterator<Item = (&'static str, Vec<&'static str>)> {
        T::all().iter().filter_map(|(name, one)| {
            let actions: Vec<_> = self.actions(*one).map(Action::name).collect();
            (actions.len() > 1).then_some((*name, actions))
        })
    }
}

impl<T> Default for Bindings<T> {
    fn default() -> Bindings<T> {
        Bindings((0..Action::COUNT).map(|_| Vec::new()).collect())
    }
}

impl<T: Named + PartialEq> Serialize for Bindings<T> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_map(
            Action::all().iter().map(|(name, action)| (name, self.names(*action).collect::<Vec<_>>())),
        )
    }
}

#[derive(Deserialize)]
#[serde(untagged)]
enum OneOrMore {
    One(String),
    More(Vec<String>),
}

impl<'de, T: Named> Deserialize<'de> for Bindings<T> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Bindings<T>, D::Error> {
        let raw = std::collections::BTreeMap::<String, OneOrMore>::deserialize(from)?;
        let mut bindings = Bindings::default();
        for (name, names) in raw {
            let action =
                Action::find(&name).ok_or_else(|| D::Error::custom(format!("no action is called {name}")))?;
            let names = match names {
                OneOrMore::One(name) => vec![name],
                OneOrMore::More(names) => names,
            };
            for name in names {
                let one = T::find(&name)
                    .ok_or_else(|| D::Error::custom(format!("no {} is called {name}", T::KIND)))?;
                bindings.0[action as usize].push(one);
            }
        }
        Ok(bindings)
    }
}
