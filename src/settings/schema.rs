//! Every setting's name, and what values it takes.

use std::fmt;
use std::str::FromStr;
use std::sync::LazyLock;

use toml::Value;

use super::names::{Action, Axis, Button, Key, Named};
use super::{MAX_SIDE, Size};
use crate::world::source::hint;

/// A setting.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Its name with its section's, such as `motion.speed`.
    pub path: String,
    /// What values it takes.
    pub rule: Rule,
}

/// What values a setting takes; as text, the end of "it should be ...".
#[derive(Clone, Copy, Debug)]
pub enum Rule {
    /// On or off.
    Switch,
    /// From the first to the second, both included.
    Number(f64, f64),
    /// A whole one from the first to the second, both included.
    Whole(i64, i64),
    /// One of these numbers.
    OneOf(&'static [i64]),
    /// One of these words.
    Word(&'static [&'static str]),
    /// [`Size`].
    Size,
    /// Any text but none.
    Text,
    /// [`Key`]s.
    Keys,
    /// [`Button`]s.
    Buttons,
    /// An [`Axis`].
    Axis,
    /// "auto", or what another rule says.
    Auto(&'static Rule),
}

impl Rule {
    /// The value is one that the setting takes.
    pub fn allows(&self, value: &Value) -> bool {
        match (self, value) {
            (Rule::Switch, Value::Boolean(_)) => true,
            (Rule::Number(least, most), Value::Float(number)) => (*least..=*most).contains(number),
            (Rule::Number(least, most), Value::Integer(number)) => {
                (*least..=*most).contains(&(*number as f64))
            }
            (Rule::Whole(least, most), Value::Integer(number)) => (*least..=*most).contains(number),
            (Rule::OneOf(numbers), Value::Integer(number)) => numbers.contains(number),
            (Rule::Word(words), Value::String(word)) => words.contains(&word.as_str()),
            (Rule::Size, Value::String(text)) => Size::from_str(text).is_ok(),
            (Rule::Text, Value::String(text)) => !text.is_empty(),
            (Rule::Keys, value) => {
                names(value).is_some_and(|names| names.into_iter().all(|n| Key::find(n).is_some()))
            }
            (Rule::Buttons, value) => {
                names(value).is_some_and(|names| names.into_iter().all(|n| Button::find(n).is_some()))
            }
            (Rule::Axis, Value::String(text)) => Axis::find(text).is_some(),
            (Rule::Auto(_), Value::String(word)) if word == "auto" => true,
            (Rule::Auto(rule), value) => rule.allows(value),
            _ => false,
        }
    }

    /// ` (did you mean ...?)` for a value that is not allowed, or nothing.
    pub(super) fn hint(&self, value: &Value) -> String {
        let known: Vec<&str> = match self {
            Rule::Word(words) => words.to_vec(),
            Rule::Keys => Key::all().iter().map(|(name, _)| *name).collect(),
            Rule::Buttons => Button::all().iter().map(|(name, _)| *name).collect(),
            Rule::Auto(rule) => return rule.hint(value),
            _ => return String::new(),
        };
        let wrong = names(value).into_iter().flatten().find(|name| !known.contains(name));
        // Names of keys begin with a capital letter.
        wrong.map_or_else(String::new, |wrong| {
            let same = known.iter().find(|known| known.eq_ignore_ascii_case(wrong));
            same.map_or_else(|| hint(wrong, &known), |same| format!(" (did you mean `{same}`?)"))
        })
    }
}

/// A text, or a list of texts.
fn names(value: &Value) -> Option<Vec<&str>> {
    match value {
        Value::String(name) => Some(vec![name]),
        Value::Array(list) => list.iter().map(Value::as_str).collect(),
        _ => None,
    }
}

/// `a, b or c`.
fn either(all: &[String]) -> String {
    match all {
        [before @ .., last] if !before.is_empty() => format!("{} or {last}", before.join(", ")),
        _ => all.concat(),
    }
}

impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Rule::Switch => f.write_str("true or false"),
            Rule::Number(least, most) => write!(f, "a number from {least} to {most}"),
            Rule::Whole(least, most) => write!(f, "a whole number from {least} to {most}"),
            Rule::OneOf(numbers) => {
                f.write_str(&either(&numbers.iter().map(ToString::to_string).collect::<Vec<_>>()))
            }
            Rule::Word(words) => {
                f.write_str(&either(&words.iter().map(|word| format!("\"{word}\"")).collect::<Vec<_>>()))
            }
            Rule::Size => write!(f, "\"WIDTHxHEIGHT\" in pixels, each side from 1 to {MAX_SIDE}"),
            Rule::Text => f.write_str("text"),
            Rule::Keys => f.write_str("a key, or a list of keys, such as \"W\" or [\"Up\", \"Numpad8\"]"),
            Rule::Buttons => {
                f.write_str("a button, or a list of buttons, such as \"south\" or [\"start\", \"guide\"]")
            }
            Rule::Axis => f.write_str(
                "\"left_x\", \"left_y\", \"right_x\", \"right_y\", one of these after a \"-\", or \"none\"",
            ),
            Rule::Auto(rule @ Rule::OneOf(_)) => write!(f, "\"auto\", {rule}"),
            Rule::Auto(rule) => write!(f, "\"auto\" or {rule}"),
        }
    }
}

const MILLISECONDS: Rule = Rule::Number(0.1, 1000.0);

/// Those that are not an action's.
const PLAIN: &[(&str, Rule)] = &[
    ("view.runtime", Rule::Word(&["auto", "system", "mock"])),
    ("view.wait_for_headset", Rule::Switch),
    ("view.refresh_rate", Rule::Auto(&Rule::Number(1.0, 1000.0))),
    ("view.size", Rule::Auto(&Rule::Size)),
    ("view.backdrop_layer", Rule::Switch),
    ("view.mask", Rule::Switch),
    ("view.validate", Rule::Switch),
    ("motion.speed", Rule::Number(0.0625, 8.0)),
    ("motion.comfort_m", Rule::Number(0.25, 50.0)),
    ("motion.scale_s", Rule::Number(0.1, 10.0)),
    ("motion.scale_rate", Rule::Number(1.0, 24.0)),
    ("motion.inertia_s", Rule::Number(0.0, 2.0)),
    ("motion.turn_rate", Rule::Number(0.0, 360.0)),
    ("motion.roll_rate", Rule::Number(0.0, 360.0)),
    ("motion.turn_inertia_s", Rule::Number(0.0, 2.0)),
    ("motion.levelling", Rule::Switch),
    ("motion.levelling_rate", Rule::Number(0.0, 180.0)),
    ("motion.levelling_octaves", Rule::Number(0.0, 16.0)),
    ("motion.level_up_rate", Rule::Number(1.0, 360.0)),
    ("motion.slide", Rule::Number(0.0, 40.0)),
    ("comfort.vignette", Rule::Switch),
    ("comfort.vignette_inner", Rule::Number(5.0, 80.0)),
    ("comfort.vignette_outer", Rule::Number(10.0, 90.0)),
    ("comfort.vignette_strength", Rule::Number(0.0, 1.0)),
    ("comfort.flow_from", Rule::Number(0.0, 360.0)),
    ("comfort.flow_full", Rule::Number(0.0, 360.0)),
    ("comfort.turn_from", Rule::Number(0.0, 360.0)),
    ("comfort.turn_full", Rule::Number(0.0, 360.0)),
    ("comfort.by_hand", Rule::Number(0.0, 1.0)),
    ("comfort.close_s", Rule::Number(0.0, 10.0)),
    ("comfort.open_s", Rule::Number(0.0, 10.0)),
    ("comfort.grid", Rule::Word(&["off", "moving", "always"])),
    ("comfort.grid_strength", Rule::Number(0.0, 1.0)),
    ("comfort.fades", Rule::Switch),
    ("comfort.fade_out_s", Rule::Number(0.0, 2.0)),
    ("comfort.fade_in_s", Rule::Number(0.0, 2.0)),
    ("comfort.inertia_s", Rule::Number(0.0, 2.0)),
    ("comfort.levelling_rate", Rule::Number(0.0, 180.0)),
    ("quality.split", Rule::Auto(&Rule::Number(2.0, 4.0))),
    ("quality.cells", Rule::Auto(&Rule::OneOf(&[16, 32, 64, 128]))),
    ("quality.mesh", Rule::Auto(&Rule::OneOf(&[8, 16, 32, 64]))),
    ("quality.samples", Rule::Auto(&Rule::OneOf(&[1, 2, 4, 8]))),
    ("quality.levels_below", Rule::Whole(0, 5)),
    ("quality.backdrop_face", Rule::Auto(&Rule::Whole(128, 4096))),
    ("quality.backdrop_lag", Rule::Auto(&Rule::Whole(4, 14))),
    ("quality.tile_ms", MILLISECONDS),
    ("quality.bake_ms", Rule::Auto(&MILLISECONDS)),
    ("mirror.side", Rule::Word(&["left", "right", "both", "spectator"])),
    ("mirror.vignette", Rule::Switch),
    ("mirror.full_screen", Rule::Switch),
    ("mirror.size", Rule::Size),
    ("mouse.sensitivity", Rule::Number(0.05, 20.0)),
    ("mouse.invert", Rule::Switch),
    ("mouse.double_click_ms", Rule::Whole(0, 2000)),
    ("mouse.double_click_pixels", Rule::Whole(0, 100)),
    ("mouse.double_click_octaves", Rule::Number(0.5, 1000.0)),
    ("desk.screenshots", Rule::Text),
    ("controllers.left_handed", Rule::Switch),
    ("controllers.fly_by_head", Rule::Switch),
    ("controllers.snap_turn", Rule::Number(0.0, 90.0)),
    ("controllers.dead_zone", Rule::Number(0.0, 0.9)),
    ("controllers.tick", Rule::Number(0.0, 1.0)),
    ("controllers.models", Rule::Switch),
    ("controllers.rays", Rule::Switch),
    ("controllers.grab_pulse", Rule::Number(0.0, 1.0)),
    ("controllers.leap_m", Rule::Number(1.0, 100.0)),
    ("controllers.leap_slope", Rule::Number(0.0, 90.0)),
    ("controllers.standing", Rule::Switch),
    ("controllers.panel", Rule::Word(&["wrist", "floating"])),
    ("sound.volume", Rule::Number(0.0, 1.0)),
    ("gamepad.enabled", Rule::Switch),
    ("gamepad.dead_zone", Rule::Number(0.0, 0.9)),
    ("gamepad.curve", Rule::Number(1.0, 4.0)),
    ("gamepad.axes.right", Rule::Axis),
    ("gamepad.axes.ahead", Rule::Axis),
    ("gamepad.axes.up", Rule::Axis),
    ("gamepad.axes.turn_right", Rule::Axis),
    ("gamepad.axes.turn_up", Rule::Axis),
    ("gamepad.axes.roll_right", Rule::Axis),
];

static ENTRIES: LazyLock<Vec<Entry>> = LazyLock::new(|| {
    let plain = PLAIN.iter().map(|(path, rule)| Entry { path: (*path).to_owned(), rule: *rule });
    let bound = |section: &'static str, rule: Rule| {
        let names = Action::all().iter().map(|(name, _)| name);
        names.map(move |name| Entry { path: format!("{section}.{name}"), rule })
    };
    plain.chain(bound("keys", Rule::Keys)).chain(bound("gamepad.buttons", Rule::Buttons)).collect()
});

/// Every setting.
pub fn entries() -> &'static [Entry] {
    &ENTRIES
}

pub(super) fn entry(path: &str) -> Option<&'static Entry> {
    entries().iter().find(|entry| entry.path == path)
}

/// Settings begin with this name and a dot.
pub(super) fn is_section(path: &str) -> bool {
    entries().iter().any(|entry| entry.path.strip_prefix(path).is_some_and(|rest| rest.starts_with('.')))
}

/// The names directly under a section; under none, the sections.
pub(super) fn names_in(section: &str) -> Vec<&'static str> {
    let under = |path: &'static str| match section {
        "" => Some(path),
        _ => path.strip_prefix(section)?.strip_prefix('.'),
    };
    let mut names: Vec<&str> = Vec::new();
    for name in entries().iter().filter_map(|entry| under(&entry.path)?.split('.').next()) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

/// A change of this setting is taken up at the next start, not at once.
pub fn needs_restart(path: &str) -> bool {
    path.starts_with("view.") || ["mirror.size", "controllers.left_handed"].contains(&path)
}

/// The environment variable of a setting.
pub(super) fn variable(path: &str) -> String {
    format!("FATHOMLESS_{}", path.to_ascii_uppercase().replace('.', "_"))
}
