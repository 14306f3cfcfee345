//! PURE but for `disk`: what a person may set: how things are shown, how moving feels, which keys do what.
//!
//! `config/default.toml` is the manual: it names every setting with its unit, its range and its effect, and it is the
//! lowest layer itself. The layers above it are read by [`Sources::load`], which says where everything came from.
//!
//! | file | noun |
//! |---|---|
//! | `names` | actions, keys, buttons, sticks |
//! | `schema` | every setting's name, and what values it takes |
//! | `layers` | settings from several texts, the later over the earlier; what is wrong with one |
//! | `save` | changes in the text of a file that keeps its comments |
//! | `disk` | where the texts come from, and when they change |

mod disk;
mod layers;
mod names;
mod save;
mod schema;

pub use disk::{Sources, Surroundings, VARIABLES_OF_OTHERS, Watch, save, save_to};
pub use layers::{InForce, Leaf, Place, Problem};
pub use names::{Action, Axis, Bindings, Button, Key, Named, Stick};
pub use save::edit;
pub use schema::{Entry, Rule, entries, needs_restart};

use std::fmt;
use std::str::FromStr;
use std::sync::LazyLock;

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use crate::comfort::ComfortSettings;
use crate::controllers::ControllerSettings;
use crate::pilot::MotionSettings;
use crate::sound::SoundSettings;

/// The manual: every setting with its comment. It is the lowest layer.
pub const MANUAL: &str = include_str!("../../config/default.toml");

/// Everything that can be set. [`Settings::default`] is what the manual says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// The session.
    pub view: ViewSettings,
    /// How moving feels.
    pub motion: MotionSettings,
    /// What spares the stomach in the headset.
    pub comfort: ComfortSettings,
    /// How much is drawn.
    pub quality: QualitySettings,
    /// The window.
    pub mirror: MirrorSettings,
    /// Mouse.
    pub mouse: MouseSettings,
    /// What is kept.
    pub desk: DeskSettings,
    /// Which keys do what.
    pub keys: Bindings<Key>,
    /// Hands in the headset.
    pub controllers: ControllerSettings,
    /// What is heard.
    pub sound: SoundSettings,
    /// Gamepads.
    pub gamepad: GamepadSettings,
}

/// The session.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ViewSettings {
    /// Which OpenXR runtime.
    pub runtime: RuntimeChoice,
    /// Wait for a headset where none answers.
    pub wait_for_headset: bool,
    /// Display rate to ask the headset for, in Hz.
    #[serde(with = "auto")]
    pub refresh_rate: Option<f32>,
    /// Pixels of each eye; None: what the headset recommends.
    #[serde(with = "auto")]
    pub size: Option<Size>,
    /// Sky and backdrop as a layer of the runtime's own, where it has such.
    pub backdrop_layer: bool,
    /// What the headset's lenses hide is not drawn.
    pub mask: bool,
    /// Validation layers on.
    pub validate: bool,
}

/// How much is drawn; None: what suits the device and the size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct QualitySettings {
    /// A tile is split when it is nearer than this many of its own sizes, 2 to 4.
    #[serde(with = "auto")]
    pub split: Option<f64>,
    /// Data cells a side of a tile: 16, 32, 64 or 128.
    #[serde(with = "auto")]
    pub cells: Option<u32>,
    /// Mesh cells a side of a tile: 8, 16, 32 or 64.
    #[serde(with = "auto")]
    pub mesh: Option<u32>,
    /// Samples of a pixel: 1, 2, 4 or 8.
    #[serde(with = "auto")]
    pub samples: Option<u32>,
    /// Levels below the anchor that are drawn, 0 to 5.
    pub levels_below: usize,
    /// Texels a side of the backdrop's faces, 128 to 4096.
    #[serde(with = "auto")]
    pub backdrop_face: Option<u32>,
    /// Levels between the anchor and the backdrop, 4 to 14.
    #[serde(with = "auto")]
    pub backdrop_lag: Option<usize>,
    /// Milliseconds of GPU time in a frame that making tiles may take, 0.1 to 1000.
    pub tile_ms: f64,
    /// The same for baking.
    #[serde(with = "auto")]
    pub bake_ms: Option<f64>,
}

impl Default for QualitySettings {
    fn default() -> QualitySettings {
        BUILT_IN.quality
    }
}

/// The window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MirrorSettings {
    /// Whose pictures it shows at first.
    pub side: Side,
    /// It shows what narrows and fades the wearer's view.
    pub vignette: bool,
    /// It fills the screen at first.
    pub full_screen: bool,
    /// Its size at first, in logical pixels.
    pub size: Size,
}

/// The mouse.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MouseSettings {
    /// Milliradians by which the look turns per count, over 2; 0.05 to 20.
    pub sensitivity: f32,
    /// Away from the person looks down.
    pub invert: bool,
    /// Milliseconds between the clicks of a double-click, 0 to 2000; 0: there is none.
    pub double_click_ms: u64,
    /// Pixels between them, 0 to 100.
    pub double_click_pixels: u32,
    /// Octaves after which its dive has arrived, 0.5 to 1000.
    pub double_click_octaves: f64,
}

/// What is kept.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeskSettings {
    /// The folder for screenshots.
    pub screenshots: String,
}

/// Gamepads.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GamepadSettings {
    /// They are listened to.
    pub enabled: bool,
    /// The share of a stick's way that does nothing, 0 to 0.9.
    pub dead_zone: f32,
    /// The power of the rest of its way that becomes speed, 1 to 4.
    pub curve: f32,
    /// What the sticks do.
    pub axes: GamepadAxes,
    /// Which buttons do what.
    pub buttons: Bindings<Button>,
}

/// What a gamepad's sticks do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GamepadAxes {
    /// Fly right and left.
    pub right: Axis,
    /// Fly ahead and back.
    pub ahead: Axis,
    /// Fly up and down.
    pub up: Axis,
    /// Turn right and left.
    pub turn_right: Axis,
    /// Look up and down.
    pub turn_up: Axis,
    /// Roll right and left.
    pub roll_right: Axis,
}

static BUILT_IN: LazyLock<Settings> = LazyLock::new(|| match layers::built_in() {
    Ok(in_force) => in_force.settings,
    // The manual is a part of the program, and the tests read it.
    Err(problem) => panic!("{problem}"),
});

impl Default for Settings {
    fn default() -> Settings {
        BUILT_IN.clone()
    }
}

/// What one action is bound to, for people.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Binding {
    /// The action.
    pub action: Action,
    /// The names of its keys, joined by blanks; empty where it has none.
    pub keys: String,
    /// The names of its gamepad buttons, joined by blanks.
    pub buttons: String,
    /// What it does.
    pub does: &'static str,
}

impl Settings {
    /// Every action with what it is bound to, in the manual's order.
    pub fn bindings(&self) -> Vec<Binding> {
        let joined = |names: Vec<&str>| names.join(" ");
        let actions = Action::all().iter().map(|(_, action)| *action);
        actions
            .map(|action| Binding {
                action,
                keys: joined(self.keys.names(action).collect()),
                buttons: joined(self.gamepad.buttons.names(action).collect()),
                does: action.does(),
            })
            .collect()
    }

    /// The bindings as a table of text, a line each: keys, buttons, what they do.
    pub fn bindings_text(&self) -> String {
        let bindings = self.bindings();
        let width = |of: fn(&Binding) -> &String| bindings.iter().map(|b| of(b).len()).max().unwrap_or(0);
        let (keys, buttons) = (width(|b| &b.keys), width(|b| &b.buttons));
        let line = |b: &Binding| format!("  {:keys$}  {:buttons$}  {}\n", b.keys, b.buttons, b.does);
        bindings.iter().map(line).collect()
    }
}

/// Which OpenXR runtime runs the session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RuntimeChoice {
    /// The system's where it answers with a headset, else the built-in mock.
    Auto,
    /// The system's, or fail.
    System,
    /// The built-in mock runtime.
    Mock,
}

/// Whose pictures the window shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// The left eye's.
    #[default]
    Left,
    /// The right eye's.
    Right,
    /// Both, side by side.
    Both,
    /// A spectator's, who sees from the left eye and holds his head still.
    Spectator,
}

impl Side {
    /// The one after it, round and round.
    pub fn next(self) -> Side {
        match self {
            Side::Left => Side::Right,
            Side::Right => Side::Both,
            Side::Both => Side::Spectator,
            Side::Spectator => Side::Left,
        }
    }

    /// The only eye that is seen, where it is one.
    pub fn only_eye(self) -> Option<usize> {
        (self != Side::Both).then(|| self.eye())
    }

    /// The eye whose picture is taken when one is: 0 is the left one.
    pub fn eye(self) -> usize {
        usize::from(self == Side::Right)
    }
}

/// The longest side of a picture, in pixels: what Vulkan devices commonly allow.
pub const MAX_SIDE: u32 = 16_384;

/// Pixels of a picture, each side 1 to [`MAX_SIDE`]. Written `640x480`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct Size {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
}

impl Size {
    /// Across and down.
    pub fn pixels(self) -> [u32; 2] {
        [self.width, self.height]
    }
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Size, String> {
        let side = |text: &str| text.parse().ok().filter(|side| (1..=MAX_SIDE).contains(side));
        let size = text
            .split_once('x')
            .and_then(|(width, height)| Some(Size { width: side(width)?, height: side(height)? }));
        size.ok_or_else(|| {
            format!("it should be WxH in pixels, such as 512x512, each side from 1 to {MAX_SIDE}")
        })
    }
}

impl TryFrom<String> for Size {
    type Error = String;

    fn try_from(text: String) -> Result<Size, String> {
        text.parse()
    }
}

impl From<Size> for String {
    fn from(size: Size) -> String {
        size.to_string()
    }
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// None is written "auto".
mod auto {
    use serde::de::Error as _;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<T: Serialize, S: Serializer>(
        value: &Option<T>,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        match value {
            Some(value) => value.serialize(to),
            None => to.serialize_str("auto"),
        }
    }

    pub(super) fn deserialize<'de, T, D>(from: D) -> Result<Option<T>, D::Error>
    where
        T: serde::de::DeserializeOwned,
        D: Deserializer<'de>,
    {
        match toml::Value::deserialize(from)? {
            toml::Value::String(word) if word == "auto" => Ok(None),
            value => T::deserialize(value).map(Some).map_err(D::Error::custom),
        }
    }
}
