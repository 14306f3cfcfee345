//! PURE: which inputs of which controllers do what: `config/bindings.toml`, checked against the OpenXR registry.

use std::collections::BTreeMap;
use std::fmt;

use serde::Deserialize;
use serde::de::{Error as _, IntoDeserializer, MapAccess, Visitor};
use toml::Spanned;

use crate::mock::registry::{self, Kind, Profile};

/// The bindings that are built in.
pub const BUILT_IN: &str = include_str!("../config/bindings.toml");

/// The user paths of the left hand and the right.
pub const HANDS: [&str; 2] = ["/user/hand/left", "/user/hand/right"];

/// Something that a person does with controllers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Action {
    /// Where each hand points.
    Aim,
    /// Where each hand is.
    Grip,
    /// Flies along that.
    Travel,
    /// Turns the view; rises and sinks.
    Turn,
    /// Falls towards where each hand points.
    Dive,
    /// Each hand takes hold of the land.
    Grab,
    /// Backs out.
    Rise,
    /// A step through the air.
    Teleport,
    /// Turns upright.
    Level,
    /// Back to the start.
    Restart,
    /// The panel on the wrist.
    Panel,
    /// Each hand feels something.
    Pulse,
}

impl Action {
    /// All of them, in the order of their numbers.
    pub const ALL: [Action; 12] = [
        Action::Aim,
        Action::Grip,
        Action::Travel,
        Action::Turn,
        Action::Dive,
        Action::Grab,
        Action::Rise,
        Action::Teleport,
        Action::Level,
        Action::Restart,
        Action::Panel,
        Action::Pulse,
    ];

    /// Its name in files and for the runtime: lower-case letters.
    pub fn name(self) -> &'static str {
        match self {
            Action::Aim => "aim",
            Action::Grip => "grip",
            Action::Travel => "travel",
            Action::Turn => "turn",
            Action::Dive => "dive",
            Action::Grab => "grab",
            Action::Rise => "rise",
            Action::Teleport => "teleport",
            Action::Level => "level",
            Action::Restart => "restart",
            Action::Panel => "panel",
            Action::Pulse => "pulse",
        }
    }

    /// Its name for people, as the runtime's menus show it.
    pub fn title(self) -> &'static str {
        match self {
            Action::Aim => "Where a hand points",
            Action::Grip => "Where a hand is",
            Action::Travel => "Fly",
            Action::Turn => "Turn, rise and sink",
            Action::Dive => "Dive to where the hand points",
            Action::Grab => "Take hold of the land",
            Action::Rise => "Back out",
            Action::Teleport => "Step through the air",
            Action::Level => "Upright over the ground",
            Action::Restart => "Back to the start (hold)",
            Action::Panel => "Show or hide the panel",
            Action::Pulse => "Tick of each octave",
        }
    }

    /// What it is made of.
    pub fn kind(self) -> Kind {
        match self {
            Action::Aim | Action::Grip => Kind::Pose,
            Action::Travel | Action::Turn => Kind::Vector,
            Action::Dive | Action::Grab | Action::Rise => Kind::Float,
            Action::Teleport | Action::Level | Action::Restart | Action::Panel => Kind::Boolean,
            Action::Pulse => Kind::Haptic,
        }
    }

    /// Each hand has its own.
    pub fn is_of_each_hand(self) -> bool {
        matches!(self, Action::Aim | Action::Grip | Action::Dive | Action::Grab | Action::Pulse)
    }

    /// Whether a person presses, pulls or pushes something for it.
    pub fn is_pressed(self) -> bool {
        !matches!(self.kind(), Kind::Pose | Kind::Haptic)
    }

    /// Whether an input of a kind can do it: the runtime makes numbers of buttons and buttons of numbers.
    fn takes(self, kind: Kind) -> bool {
        let scalar = |kind| matches!(kind, Kind::Boolean | Kind::Float);
        self.kind() == kind || (scalar(self.kind()) && scalar(kind))
    }
}

/// What an interaction profile's inputs do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProfileBindings {
    /// Such as `/interaction_profiles/khr/simple_controller`.
    pub profile: &'static str,
    /// Actions, and full paths such as `/user/hand/left/input/aim/pose`.
    pub paths: Vec<(Action, String)>,
}

impl ProfileBindings {
    /// Whether a runtime of this version (major, minor) knows the profile, and all that is bound of it.
    pub fn is_offered(&self, version: (u16, u16), has_extension: impl Fn(&str) -> bool) -> bool {
        let offered = |needs| registry::is_offered(needs, version, &has_extension);
        let Some(profile) = registry::profile(self.profile) else { return false };
        let component = |path: &str| {
            let (hand, subpath) = profile.split(path)?;
            profile.component(hand, subpath)
        };
        offered(profile.needs)
            && self.paths.iter().all(|(_, path)| component(path).is_some_and(|it| offered(it.needs)))
    }
}

/// What a person presses for an action, as the runtime names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bound {
    /// What it does.
    pub action: Action,
    /// The inputs, in words of the runtime's own language: "Left Hand Trigger".
    pub inputs: Vec<String>,
}

/// A file of bindings that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct Errors(pub Vec<String>);

impl fmt::Display for Errors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.join("\n"))
    }
}

type File = BTreeMap<Spanned<String>, Table>;

/// What a file says of a profile.
#[derive(Default)]
struct Table {
    /// The profile whose table says all that this one does not.
    like: Option<Spanned<String>>,
    actions: BTreeMap<Action, Vec<Spanned<String>>>,
}

impl<'de> Deserialize<'de> for Table {
    fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Table, D::Error> {
        struct Keys;
        impl<'de> Visitor<'de> for Keys {
            type Value = Table;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table of actions")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Table, A::Error> {
                let mut table = Table::default();
                while let Some(key) = map.next_key::<String>()? {
                    if key == LIKE {
                        table.like = Some(map.next_value()?);
                        continue;
                    }
                    let action = Action::deserialize(key.as_str().into_deserializer())
                        .map_err(|wrong: serde::de::value::Error| A::Error::custom(wrong))?;
                    table.actions.insert(action, map.next_value()?);
                }
                Ok(table)
            }
        }
        from.deserialize_map(Keys)
    }
}

/// The key that names another profile's table.
const LIKE: &str = "like";

/// Tables that are like others, one after the other, at most: longer chains go round.
const LONGEST_CHAIN: usize = 16;

/// A table and those that it is like, in turn; and what is wrong with that: where, and a sentence.
fn likes<'f>(file: &'f File, path: &str) -> Result<Vec<&'f Table>, (usize, String)> {
    let mut chain: Vec<&Table> = file.get(path).into_iter().collect();
    while let Some(like) = chain.last().and_then(|table| table.like.as_ref()) {
        let wrong = |what| Err((like.span().start, what));
        let Some(next) = file.get(like.get_ref().as_str()) else {
            let known: Vec<&str> = file.keys().map(|path| path.get_ref().as_str()).collect();
            let near = nearest(like.get_ref(), &known);
            return wrong(format!("there is no table of {} here to be like{near}", like.get_ref()));
        };
        if chain.len() > LONGEST_CHAIN {
            return wrong(format!("{path} is like itself, by way of {}", like.get_ref()));
        }
        chain.push(next);
    }
    Ok(chain)
}

/// Reads bindings. A table that is `like` another one has all that stands there, but for the actions that it names itself.
/// `name` is the file's, for the errors; `left_handed` gives the left hand what `main/` says.
///
/// # Errors
/// A sentence, with its line, for each thing that is wrong: not TOML, an unknown profile, an unknown action, a path that no
/// hand of the profile has, or whose kind the action cannot take; a table like one that is not there, or like itself.
pub fn parse(name: &str, text: &str, left_handed: bool) -> Result<Vec<ProfileBindings>, Errors> {
    let file: File = toml::from_str(text)
        .map_err(|error| Errors(vec![format!("{name}: {}", error.to_string().trim_end())]))?;
    let (mut all, mut wrong) = (Vec::new(), Vec::new());
    let mut say = |at: usize, what: String| {
        let line = 1 + text[..at].matches('\n').count();
        wrong.push(format!("{name}, line {line}: {what}"));
    };
    for path in file.keys() {
        let Some(profile) = registry::profile(path.get_ref()) else {
            let known: Vec<&str> = registry::PROFILES.iter().map(|profile| profile.path).collect();
            let near = nearest(path.get_ref(), &known);
            say(path.span().start, format!("no interaction profile is called {}{near}", path.get_ref()));
            continue;
        };
        let chain = match likes(&file, path.get_ref()) {
            Ok(chain) => chain,
            Err((at, what)) => {
                say(at, what);
                continue;
            }
        };
        let mut bindings = ProfileBindings { profile: profile.path, paths: Vec::new() };
        for action in Action::ALL {
            let Some((depth, inputs)) =
                chain.iter().enumerate().find_map(|(i, table)| Some((i, table.actions.get(&action)?)))
            else {
                continue;
            };
            for input in inputs {
                match resolve(profile, action, input.get_ref(), left_handed) {
                    Ok(paths) => bindings.paths.extend(paths.into_iter().map(|path| (action, path))),
                    // What is wrong for this profile alone is so where it says that it is like the other one.
                    Err(what) => {
                        let like = chain[0].like.as_ref().filter(|_| depth > 0);
                        say(like.unwrap_or(input).span().start, what);
                    }
                }
            }
        }
        all.push(bindings);
    }
    if wrong.is_empty() { Ok(all) } else { Err(Errors(wrong)) }
}

/// The full paths that a path of the file stands for.
fn resolve(profile: &Profile, action: Action, input: &str, left_handed: bool) -> Result<Vec<String>, String> {
    let (hand, rest) = input.split_once('/').unwrap_or((input, ""));
    let [main, off] = if left_handed { [0, 1] } else { [1, 0] };
    let hands: &[usize] = match hand {
        "main" => &[main],
        "off" => &[off],
        "both" => &[0, 1],
        _ => return Err(format!("{input} begins with none of main/, off/ and both/")),
    };
    let subpath = format!("/{rest}");
    let at = |hand: usize| profile.component(HANDS[hand], &subpath);
    let Some(component) = at(0).or(at(1)) else {
        let known: Vec<&str> = profile.components.iter().map(|component| component.subpath).collect();
        return Err(format!("{} has no {subpath}{}", profile.path, nearest(&subpath, &known)));
    };
    if !action.takes(component.kind) {
        let (name, wanted, kind) = (action.name(), action.kind(), component.kind);
        return Err(format!("{name} is {wanted:?}, and {subpath} of {} is {kind:?}", profile.path));
    }
    let has = hands.iter().filter(|hand| at(**hand).is_some());
    Ok(has.map(|hand| format!("{}{subpath}", HANDS[*hand])).collect())
}

/// "; did you mean …?", where one of the names is near enough.
fn nearest(wanted: &str, known: &[&str]) -> String {
    let distance = |name: &str| strsim::levenshtein(wanted, name);
    let best = known.iter().map(|name| (distance(name), name)).min();
    match best {
        Some((far, name)) if far <= wanted.len() / 3 => format!("; did you mean {name}?"),
        _ => String::new(),
    }
}
