//! Semantic paths: strings with a grammar, interned per instance.

use std::collections::HashMap;

use openxr::sys;

use super::{State, instance::Instance};
use crate::mock::{
    fault::{Outcome, misuse, refusal},
    registry::{self, Needs, Profile},
};

/// A user path of the specification that no device of the registry uses.
const RESERVED: &str = "/user/treadmill";

/// The paths of one instance.
pub struct Paths {
    /// Added to the index, so that a path of one instance means nothing to another.
    base: u64,
    by_text: HashMap<String, u64>,
    texts: Vec<String>,
}

impl Paths {
    pub fn new(instance_number: u64) -> Self {
        Self { base: (instance_number << 32) + 1, by_text: HashMap::new(), texts: Vec::new() }
    }

    pub fn intern(&mut self, text: &str) -> sys::Path {
        if let Some(path) = self.by_text.get(text) {
            return sys::Path::from_raw(*path);
        }
        let path = self.base + self.texts.len() as u64;
        self.texts.push(text.to_owned());
        self.by_text.insert(text.to_owned(), path);
        sys::Path::from_raw(path)
    }

    pub fn text(&self, path: sys::Path) -> Outcome<&str> {
        path.into_raw()
            .checked_sub(self.base)
            .and_then(|index| self.texts.get(usize::try_from(index).ok()?))
            .map(String::as_str)
            .ok_or_else(|| {
                misuse(
                    sys::Result::ERROR_PATH_INVALID,
                    format!("XrPath {:#x} was not made by xrStringToPath", path.into_raw()),
                )
            })
    }
}

/// Whether a string can stand between two slashes: lower-case letters, digits, `-`, `_`, `.`, and not only dots.
pub fn is_component(text: &str) -> bool {
    let allowed = |byte: u8| matches!(byte, b'a'..=b'z' | b'0'..=b'9' | b'-' | b'_' | b'.');
    !text.is_empty() && text.bytes().all(allowed) && text.bytes().any(|byte| byte != b'.')
}

/// Whether a string is a well-formed path: components, each after a slash.
pub fn is_path(text: &str) -> bool {
    text.strip_prefix('/').is_some_and(|rest| rest.split('/').all(is_component))
}

/// An identifier in words, for people: `dpad_up` is "Dpad Up".
pub fn title(identifier: &str) -> String {
    let word = |word: &str| {
        let mut letters = word.chars();
        letters.next().map(|first| first.to_ascii_uppercase().to_string() + letters.as_str())
    };
    identifier.split('_').filter_map(word).collect::<Vec<_>>().join(" ")
}

impl Instance {
    /// Whether the instance's version and extensions offer something.
    pub fn offers(&self, needs: Needs) -> bool {
        registry::is_offered(needs, self.version, |extension| self.has(extension))
    }

    /// A user path that a device of some offered profile can have, or XR_ERROR_PATH_UNSUPPORTED.
    pub fn user_path(&self, path: sys::Path) -> Outcome<&'static str> {
        let text = self.paths.text(path)?;
        registry::PROFILES
            .iter()
            .filter(|profile| self.offers(profile.needs))
            .flat_map(|profile| profile.user_paths)
            .find(|known| **known == text)
            .copied()
            .ok_or_else(|| {
                misuse(sys::Result::ERROR_PATH_UNSUPPORTED, format!("{text} is no top-level user path"))
            })
    }

    /// As `user_path`, and the one that never has a device.
    pub fn user_path_or_reserved(&self, path: sys::Path) -> Outcome<&'static str> {
        if self.paths.text(path)? == RESERVED {
            return Ok(RESERVED);
        }
        self.user_path(path)
    }

    /// An offered interaction profile, or XR_ERROR_PATH_UNSUPPORTED.
    pub fn profile(&self, path: sys::Path) -> Outcome<&'static Profile> {
        let text = self.paths.text(path)?;
        registry::profile(text).filter(|profile| self.offers(profile.needs)).ok_or_else(|| {
            misuse(
                sys::Result::ERROR_PATH_UNSUPPORTED,
                format!("{text} is no interaction profile of this instance's version and extensions"),
            )
        })
    }

    /// The user path and subpath of a path that an action may be bound to in a profile: that of an offered component,
    /// or of the part that components belong to (`.../input/trigger`).
    pub fn bindable<'a>(&self, profile: &'static Profile, path: &'a str) -> Option<(&'static str, &'a str)> {
        let (user_path, subpath) = profile.split(path)?;
        profile
            .components
            .iter()
            .any(|component| {
                component.is_at(user_path)
                    && (component.subpath == subpath || component.identifier() == subpath)
                    && self.offers(component.needs)
            })
            .then_some((user_path, subpath))
    }
}

impl State {
    pub fn string_to_path(&mut self, handle: sys::Instance, text: &str) -> Outcome<sys::Path> {
        let instance = self.instance_mut(handle)?;
        if text.len() >= sys::MAX_PATH_LENGTH || !is_path(text) {
            return Err(misuse(
                sys::Result::ERROR_PATH_FORMAT_INVALID,
                format!("{text:?} is no well-formed path"),
            ));
        }
        if instance.paths.texts.len() >= 1 << 20 {
            return Err(refusal(sys::Result::ERROR_PATH_COUNT_EXCEEDED, "too many paths"));
        }
        Ok(instance.paths.intern(text))
    }

    pub fn path_to_string(&self, handle: sys::Instance, path: sys::Path) -> Outcome<&str> {
        self.instance(handle)?.paths.text(path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_grammar_of_paths() {
        for good in ["/user", "/user/hand/left/input/a-b_c.1/click", "/a..b"] {
            assert!(is_path(good), "{good}");
        }
        for bad in ["", "/", "user", "/user/", "//user", "/User", "/a b", "/..", "/a/./b", "/ä"] {
            assert!(!is_path(bad), "{bad}");
        }
        assert_eq!(title("dpad_up"), "Dpad Up");
    }
}
