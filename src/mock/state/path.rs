//! Semantic paths: strings with a grammar, interned per instance.

use std::collections::HashMap;

use openxr::sys;

use super::State;
use crate::mock::fault::{Outcome, misuse, refusal};

/// The paths an input device can hang on.
const TOP_LEVEL: [&str; 5] =
    ["/user/hand/left", "/user/hand/right", "/user/head", "/user/gamepad", "/user/treadmill"];

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

    fn intern(&mut self, text: &str) -> sys::Path {
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

    /// A top-level user path, or a sentence and XR_ERROR_PATH_UNSUPPORTED.
    pub fn top_level(&self, path: sys::Path) -> Outcome<&str> {
        let text = self.text(path)?;
        if TOP_LEVEL.contains(&text) {
            return Ok(text);
        }
        Err(misuse(sys::Result::ERROR_PATH_UNSUPPORTED, format!("{text} is no top-level user path")))
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

/// Whether a path names a source or a sink on a user's device.
pub fn is_binding(text: &str) -> bool {
    TOP_LEVEL.iter().any(|top| {
        text.strip_prefix(top).is_some_and(|rest| {
            ["/input/", "/output/"].iter().any(|kind| rest.starts_with(kind) && rest.len() > kind.len())
        })
    })
}

/// Whether a path names an interaction profile: a vendor and a name.
pub fn is_profile(text: &str) -> bool {
    text.strip_prefix("/interaction_profiles/").is_some_and(|rest| rest.split('/').count() >= 2)
}

/// The path in words, for people.
pub fn localized(text: &str, which: u64) -> String {
    let top = TOP_LEVEL.into_iter().find(|top| text.starts_with(top)).unwrap_or_default();
    let words = |path: &str| path.replace(['/', '_'], " ").trim().to_owned();
    let component = text.strip_prefix(top).and_then(|rest| rest.split('/').nth(2)).unwrap_or_default();
    let parts = [
        (1, words(top.strip_prefix("/user").unwrap_or(top))),
        (2, "mock controller".to_owned()),
        (4, words(component)),
    ];
    let chosen: Vec<_> = parts
        .into_iter()
        .filter(|(bit, part)| which & bit != 0 && !part.is_empty())
        .map(|(_, part)| part)
        .collect();
    chosen.join(" ")
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
        assert!(is_binding("/user/hand/left/input/select/click"));
        assert!(!is_binding("/user/hand/left/input/"));
        assert!(!is_binding("/user/hand/middle/input/select"));
        assert!(is_profile("/interaction_profiles/khr/simple_controller"));
        assert!(!is_profile("/interaction_profiles/khr"));
        assert_eq!(localized("/user/hand/left/input/select/click", 7), "hand left mock controller select");
    }
}
