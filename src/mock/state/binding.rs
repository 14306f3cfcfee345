//! Which component of a device an action's suggested binding means, and how its value becomes the action's.

use openxr::sys::{self, ActionType};

use super::device::Devices;
use crate::mock::registry::{Component, Kind, Profile};

/// A number at or above the first presses a button, one below the second lets go of it.
const PRESS: f32 = 0.6;
const RELEASE: f32 = 0.4;

/// The profile that any hand's device can stand in for.
pub const SIMPLE: &str = "/interaction_profiles/khr/simple_controller";

/// What stands in for the two buttons of the simple controller, best first.
const STAND_INS: [(&str, &[&str]); 2] = [
    (
        "/input/select/click",
        &[
            "/input/select/click",
            "/input/select/value",
            "/input/trigger/value",
            "/input/trigger/click",
            "/input/pinch_ext/value",
            "/input/primary/click",
            "/input/a/click",
            "/input/trackpad/click",
        ],
    ),
    (
        "/input/menu/click",
        &[
            "/input/menu/click",
            "/input/secondary/click",
            "/input/b/click",
            "/input/back/click",
            "/input/grasp_ext/value",
            "/input/squeeze/value",
        ],
    ),
];

/// A suggested binding: an action, and a component or the part it belongs to.
#[derive(Clone)]
pub struct Suggestion {
    pub action: sys::Action,
    pub user_path: &'static str,
    pub subpath: String,
}

/// A component that an action is bound to.
#[derive(Clone, Debug)]
pub struct Source {
    pub user_path: &'static str,
    /// In the profile that the application suggested the binding for.
    pub component: &'static Component,
    /// In the device's own profile.
    pub read_from: &'static Component,
    /// The last sync let it through.
    pub live: bool,
    /// What it measured at the last sync, if that let it through: the value converted for the action, and since when.
    pub reading: Option<([f32; 2], i64)>,
    /// A number that presses a button was last above the threshold.
    pressed: bool,
}

impl Source {
    /// What a suggestion for `profile` means for an action of a type on a device that has its own profile; `None` when
    /// the types cannot be converted, or the device has nothing of the kind.
    pub fn resolve(
        suggestion: &Suggestion,
        kind: ActionType,
        profile: &'static Profile,
        own: &'static Profile,
        offered: impl Fn(&Component) -> bool,
    ) -> Option<Self> {
        let user_path = suggestion.user_path;
        let at = |subpath: &str| profile.component(user_path, subpath).filter(|it| offered(it));
        let below = |name: &str| at(&format!("{}/{name}", suggestion.subpath));
        let direct = at(&suggestion.subpath);
        let is = |wanted: Kind| direct.filter(|component| component.kind == wanted);
        let component = match kind {
            ActionType::BOOLEAN_INPUT => is(Kind::Boolean)
                .or(is(Kind::Float))
                .or_else(|| below("click"))
                .or_else(|| below("value"))
                .filter(|it| matches!(it.kind, Kind::Boolean | Kind::Float)),
            ActionType::FLOAT_INPUT => is(Kind::Float)
                .or(is(Kind::Boolean))
                .or_else(|| below("value"))
                .or_else(|| below("click"))
                .filter(|it| matches!(it.kind, Kind::Boolean | Kind::Float)),
            ActionType::VECTOR2F_INPUT => is(Kind::Vector),
            ActionType::POSE_INPUT => {
                is(Kind::Pose).or_else(|| below("pose")).filter(|it| it.kind == Kind::Pose)
            }
            _ => is(Kind::Haptic),
        }?;
        let read_from =
            if own.path == profile.path { component } else { stand_in(own, user_path, component)? };
        Some(Self { user_path, component, read_from, live: false, reading: None, pressed: false })
    }

    /// The full path, as the application knows it.
    pub fn path(&self) -> String {
        format!("{}{}", self.user_path, self.component.subpath)
    }

    /// The part of the device that it belongs to. Two actions with the same one compete for it.
    pub fn input(&self) -> (&'static str, &'static str) {
        (self.user_path, self.component.identifier())
    }

    /// Reads the device for an action of a type; nothing without the device, or if it is not let through.
    pub fn update(&mut self, kind: ActionType, devices: &Devices) {
        let reading = devices.read(self.user_path, self.read_from.subpath).filter(|_| self.live);
        let Some(reading) = reading else {
            self.reading = None;
            return;
        };
        let mut value = reading.value.as_vector();
        let is_button = kind == ActionType::BOOLEAN_INPUT || self.component.kind == Kind::Boolean;
        if is_button && self.read_from.kind == Kind::Float {
            self.pressed = value[0] >= if self.pressed { RELEASE } else { PRESS };
            value[0] = if self.pressed { 1.0 } else { 0.0 };
        }
        self.reading = Some((value, reading.changed_ns));
    }
}

/// What a device has for a component of the simple controller.
fn stand_in(own: &'static Profile, user_path: &str, component: &Component) -> Option<&'static Component> {
    let buttons = STAND_INS.iter().find(|(button, _)| *button == component.subpath);
    let same = [component.subpath];
    let candidates = buttons.map_or(&same[..], |(_, candidates)| candidates);
    candidates.iter().find_map(|subpath| own.component(user_path, subpath))
}
