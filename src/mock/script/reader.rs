//! Values out of a script's text, or words about what is wrong with them and where.

use std::ops::{Range, RangeBounds};

use glam::Vec3;
use toml::Spanned;

/// What is wrong in a script, where, and what would be right: `FILE:LINE: problem; remedy`, on one line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file}:{line}: {problem}; {remedy}")]
pub struct ScriptError {
    /// The file as it was named to us.
    pub file: String,
    /// The line, counted from 1.
    pub line: usize,
    /// What is wrong.
    pub problem: String,
    /// What would be right.
    pub remedy: String,
}

/// Keys, and the end of the sentence "it should be ..."; for the others the kind of value says it.
const KEYS: &[(&str, &str)] = &[
    ("hz", "a number of hertz from 1 to 1000"),
    ("refresh_hz", "a number of hertz from 1 to 1000"),
    ("refresh_rates_hz", "a list of numbers of hertz from 1 to 1000"),
    ("eye_size", "[width, height] in pixels, each from 1 to 65536"),
    ("right_eye_size", "[width, height] in pixels, each from 1 to 65536"),
    ("max_image_size", "[width, height] in pixels, each from 1 to 65536"),
    ("fov_deg", "[[left, right, up, down], [left, right, up, down]] in degrees, above -90 and below 90"),
    ("eye_turn_deg", "[[yaw, pitch, roll], [yaw, pitch, roll]] in degrees from -360 to 360"),
    ("ipd_m", "a number of metres from 0 to 1"),
    ("mask_cut", "a number from 0 to 0.5"),
    ("early_error_m", "[x, y, z] in metres, each from -1000 to 1000"),
    ("position", "[x, y, z] in metres, each from -1000000 to 1000000"),
    ("yaw_deg", "a number of degrees from -3600 to 3600"),
    ("pitch_deg", "a number of degrees from -3600 to 3600"),
    ("roll_deg", "a number of degrees from -3600 to 3600"),
    ("bounds_m", "[width, depth] in metres, above 0, or [] when they are not known"),
    ("frames", "[first, end]: two frame numbers, the first the smaller"),
    ("skip_rendering", "a list of [first, end]: two frame numbers, the first the smaller"),
    ("late", "a whole number of refreshes from 1 to 1000"),
    ("every", "a whole number of refreshes from 1 to 1000"),
    ("jitter_ms", "a number of milliseconds from 0 to 1000"),
    ("ahead_ms", "a number of milliseconds from 0 to 10000000000"),
    ("frozen", "true"),
    ("keep_frames", "a whole number from 1 to 100000"),
    ("api_version", "\"1.0\" or \"1.1\""),
    ("image_count", "a whole number from 1 to 16"),
    ("depth_image_count", "a whole number from 1 to 16"),
    ("max_layers", "a whole number from 1 to 10000"),
    ("view_count", "a whole number from 0 to 16"),
    ("graphics_device", "a whole number from 0 to 16"),
    ("frame", "a frame number, from 0"),
    ("time_s", "a number of seconds from 0 to 1000000"),
    ("delay_s", "a number of seconds from 0 to 1000000"),
    ("instance_loss_s", "a number of seconds from 0 to 1000000"),
    ("call", "the name of a function of the runtime, such as \"xrEndFrame\""),
    ("nth", "a whole number from 1"),
    ("from", "a whole number from 1"),
    ("returns", "the name of an XrResult, such as \"XR_ERROR_SESSION_LOST\" or \"XR_TIMEOUT_EXPIRED\""),
    ("force_state", "the name of an XrSessionState, such as \"VISIBLE\""),
    ("input", "a table of paths and values: true or false, a number from -1 to 1, or [x, y]"),
    ("poses", "a table of paths and lists of keyframes, as for [[head]]"),
    ("recentre_on_head", "true"),
    ("recentre", "a table such as { position = [1.0, 0.0, 0.0], yaw_deg = 90, delay_s = 0.5 }"),
];

const LARGEST_SIDE: u64 = 65536;

/// The text being read, for errors.
pub(super) struct Reader<'a> {
    pub(super) file: &'a str,
    pub(super) text: &'a str,
}

impl Reader<'_> {
    pub(super) fn vector(
        &self,
        key: &str,
        raw: Option<&Spanned<[f64; 3]>>,
        most: f64,
    ) -> Result<Option<Vec3>, ScriptError> {
        match raw {
            Some(raw) if raw.get_ref().iter().all(|it| it.abs() <= most) => {
                Ok(Some(Vec3::from_array(raw.get_ref().map(|it| it as f32))))
            }
            Some(raw) => Err(self.refuse(key, raw)),
            None => Ok(None),
        }
    }

    pub(super) fn size(
        &self,
        key: &str,
        raw: Option<&Spanned<[u64; 2]>>,
    ) -> Result<Option<[u32; 2]>, ScriptError> {
        match raw {
            Some(raw) if raw.get_ref().iter().all(|side| (1..=LARGEST_SIDE).contains(side)) => {
                Ok(Some(raw.get_ref().map(|side| side as u32)))
            }
            Some(raw) => Err(self.refuse(key, raw)),
            None => Ok(None),
        }
    }

    pub(super) fn frames(&self, raw: &Spanned<[u64; 2]>) -> Result<Range<u64>, ScriptError> {
        let [first, end] = *raw.get_ref();
        if first < end { Ok(first..end) } else { Err(self.refuse("frames", raw)) }
    }

    /// The number, where it lies in the range; NaN lies in none.
    pub(super) fn number(
        &self,
        key: &str,
        value: Option<&Spanned<f64>>,
        range: impl RangeBounds<f64>,
    ) -> Result<Option<f64>, ScriptError> {
        match value {
            Some(value) if !range.contains(value.get_ref()) => Err(self.refuse(key, value)),
            value => Ok(value.map(|value| *value.get_ref())),
        }
    }

    pub(super) fn whole(
        &self,
        key: &str,
        value: Option<&Spanned<u64>>,
        range: impl RangeBounds<u64>,
    ) -> Result<Option<u64>, ScriptError> {
        match value {
            Some(value) if !range.contains(value.get_ref()) => Err(self.refuse(key, value)),
            value => Ok(value.map(|value| *value.get_ref())),
        }
    }

    /// From 0 to 16.
    pub(super) fn few(&self, key: &str, value: Option<&Spanned<u64>>) -> Result<Option<u32>, ScriptError> {
        Ok(self.whole(key, value, 0..=16)?.map(|it| it as u32))
    }

    /// For keys that can only be true.
    pub(super) fn yes(&self, key: &str, value: Option<&Spanned<bool>>) -> Result<Option<()>, ScriptError> {
        match value {
            Some(value) if !value.get_ref() => Err(self.refuse(key, value)),
            value => Ok(value.map(|_| ())),
        }
    }

    pub(super) fn choice<T: Clone>(
        &self,
        key: &str,
        value: Option<&Spanned<String>>,
        choices: &[(&str, T)],
    ) -> Result<Option<T>, ScriptError> {
        value.map(|value| self.chosen(key, value, choices)).transpose()
    }

    pub(super) fn chosen<T: Clone>(
        &self,
        key: &str,
        value: &Spanned<String>,
        choices: &[(&str, T)],
    ) -> Result<T, ScriptError> {
        if let Some((_, chosen)) = choices.iter().find(|(name, _)| name == value.get_ref()) {
            return Ok(chosen.clone());
        }
        let names: Vec<String> = choices.iter().map(|(name, _)| format!("{name:?}")).collect();
        let remedy = format!("it should be one of {}", names.join(", "));
        Err(self.error(value.span(), self.shown(key, value.span()), remedy))
    }

    pub(super) fn error(
        &self,
        at: Range<usize>,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> ScriptError {
        let before = self.text.bytes().take(at.start);
        ScriptError {
            file: self.file.to_owned(),
            line: 1 + before.filter(|byte| *byte == b'\n').count(),
            problem: problem.into(),
            remedy: remedy.into(),
        }
    }

    pub(super) fn refuse<T>(&self, key: &str, value: &Spanned<T>) -> ScriptError {
        self.refuse_at(key, value.span(), "of the kind config/mock/tour.toml shows")
    }

    pub(super) fn refuse_at(&self, key: &str, at: Range<usize>, otherwise: &str) -> ScriptError {
        let right = KEYS.iter().find(|(name, _)| *name == key).map_or(otherwise, |(_, right)| right);
        self.error(at.clone(), self.shown(key, at), format!("it should be {right}"))
    }

    /// "`key` is <what the text says>".
    pub(super) fn shown(&self, key: &str, at: Range<usize>) -> String {
        let written = self.text.get(at).unwrap_or_default();
        let mut shown: String = written.lines().next().unwrap_or_default().chars().take(40).collect();
        if shown.len() < written.len() {
            shown.push_str("...");
        }
        format!("`{key}` is {shown}")
    }

    /// Turns the parser's words into ours.
    pub(super) fn explain(&self, error: &toml::de::Error) -> ScriptError {
        let at = error.span().unwrap_or(0..0);
        let message = error.message();
        if let Some(rest) = message.strip_prefix("unknown field ") {
            let mut names = rest.split('`').skip(1).step_by(2);
            let unknown = names.next().unwrap_or_default();
            let allowed: Vec<String> = names.map(|name| format!("`{name}`")).collect();
            let remedy = format!("the keys here are {}", allowed.join(", "));
            return self.error(at, format!("unknown key `{unknown}`"), remedy);
        }
        if let Some(rest) = message.strip_prefix("missing field ") {
            let key = rest.trim_matches('`');
            let otherwise = "as config/mock/tour.toml shows";
            let right = KEYS.iter().find(|(name, _)| *name == key).map_or(otherwise, |(_, right)| right);
            return self.error(at, format!("`{key}` is missing"), format!("it should be {right}"));
        }
        if let Some((_, expected)) =
            message.strip_prefix("invalid ").and_then(|it| it.split_once("expected "))
        {
            return self.refuse_at(self.key_before(at.start), at, expected);
        }
        let remedy = "a script is TOML: lines of `key = value` under [table] headings";
        self.error(at, message.replace('\n', " "), remedy)
    }

    /// The key whose value starts at or around this byte: the bare word before the last `=`.
    pub(super) fn key_before(&self, at: usize) -> &str {
        let before = self.text.get(..at).unwrap_or_default();
        let before = before.rsplit_once('=').map_or(before, |(key, _)| key).trim_end();
        before.rsplit(|c: char| !c.is_ascii_alphanumeric() && c != '_').next().unwrap_or_default()
    }
}
