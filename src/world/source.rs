//! Files of settings, read so that every complaint names the file, the line, what is wrong and what would be right.

use std::borrow::Cow;
use std::ops::{Range, RangeBounds};
use std::path::Path;

use serde::de::DeserializeOwned;
use toml::Spanned;

/// What is wrong in a file, where, and what would be right: `FILE:LINE: problem; remedy`, on one line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file}:{line}: {problem}; {remedy}")]
pub struct FileError {
    /// The file as it was named to us.
    pub file: String,
    /// The line, counted from 1.
    pub line: usize,
    /// What is wrong.
    pub problem: String,
    /// What would be right.
    pub remedy: String,
}

/// Why a world or a flight could not be had by the name or path given.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// Neither a built-in name nor something that looks like a path.
    #[error("no {kind} is called `{name}`; the {kind}s are {known}{hint}, or give the path of a TOML file")]
    Unknown {
        /// What was asked for: `world` or `flight`.
        kind: &'static str,
        /// The name given.
        name: String,
        /// The built-in names, joined by commas.
        known: String,
        /// Empty, or ` (did you mean ...?)`.
        hint: String,
    },
    /// The path names nothing that can be read as text.
    #[error("cannot read the {kind} file {path}: {source}; check the path")]
    Unreadable {
        /// What was asked for: `world` or `flight`.
        kind: &'static str,
        /// The path given.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file was read and does not make sense.
    #[error(transparent)]
    Wrong(#[from] FileError),
}

/// A file that is part of the program.
pub(crate) struct Embedded {
    /// The name users call it by.
    pub(crate) name: &'static str,
    /// Its path in the repository, for errors.
    pub(crate) file: &'static str,
    /// Its text.
    pub(crate) text: &'static str,
}

/// One kind of file: what it is called, the built-in ones, and the meaning of its keys.
pub(crate) struct Kind {
    /// `world` or `flight`.
    pub(crate) name: &'static str,
    /// The built-in ones, the default first.
    pub(crate) embedded: &'static [Embedded],
    /// Every key, and the end of the sentence "it should be ...".
    pub(crate) keys: &'static [(&'static str, &'static str)],
}

impl Kind {
    /// Finds the text behind a built-in name or a path. Built-in names come first; anything with a slash, ending
    /// in `.toml`, or naming an existing file, is a path.
    pub(crate) fn find(&'static self, name_or_path: &str) -> Result<Source<'static>, LoadError> {
        if let Some(embedded) = self.embedded.iter().find(|e| e.name == name_or_path) {
            return Ok(self.source(embedded.name, embedded.file, embedded.text));
        }
        let path = Path::new(name_or_path);
        let is_path = name_or_path.contains('/') || name_or_path.ends_with(".toml") || path.is_file();
        if !is_path {
            return Err(self.unknown(name_or_path));
        }
        let text = std::fs::read_to_string(path).map_err(|source| LoadError::Unreadable {
            kind: self.name,
            path: name_or_path.to_owned(),
            source,
        })?;
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(self.source(stem, name_or_path.to_owned(), text))
    }

    /// A text as if it had been read from `file`.
    pub(crate) fn source<'a>(
        &'static self,
        name: impl Into<Cow<'a, str>>,
        file: impl Into<Cow<'a, str>>,
        text: impl Into<Cow<'a, str>>,
    ) -> Source<'a> {
        Source { name: name.into(), file: file.into(), text: text.into(), kind: self }
    }

    fn unknown(&self, name: &str) -> LoadError {
        let names: Vec<&str> = self.embedded.iter().map(|e| e.name).collect();
        LoadError::Unknown {
            kind: self.name,
            name: name.to_owned(),
            known: names.join(", "),
            hint: hint(name, &names),
        }
    }

    /// The end of the sentence "it should be ..." for a key.
    fn right(&self, key: &str) -> &'static str {
        self.keys
            .iter()
            .find(|(name, _)| *name == key)
            .map_or("of the kind the shipped files show", |(_, right)| right)
    }
}

/// The text of one file, and where it came from.
pub(crate) struct Source<'a> {
    /// What the thing in it is called: the built-in name, or the file's name without `.toml`.
    pub(crate) name: Cow<'a, str>,
    file: Cow<'a, str>,
    text: Cow<'a, str>,
    kind: &'static Kind,
}

impl Source<'_> {
    /// Reads the text into the raw form of the file: keys known and of the right type, values not yet judged.
    pub(crate) fn parse<T: DeserializeOwned>(&self) -> Result<T, FileError> {
        toml::from_str(&self.text).map_err(|error| self.explain(&error))
    }

    /// An error at a place of the text.
    pub(crate) fn error(
        &self,
        at: Range<usize>,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> FileError {
        let before = self.text.as_bytes().iter().take(at.start);
        FileError {
            file: self.file.to_string(),
            line: 1 + before.filter(|&&byte| byte == b'\n').count(),
            problem: problem.into(),
            remedy: remedy.into(),
        }
    }

    /// "`key` is <what the text says>; it should be <what the manual says>".
    pub(crate) fn refuse<T>(&self, key: &str, value: &Spanned<T>) -> FileError {
        self.refuse_at(key, value.span())
    }

    /// The number, where it lies in the range; NaN lies in none.
    pub(crate) fn number(
        &self,
        key: &str,
        value: &Spanned<f64>,
        range: impl RangeBounds<f64>,
    ) -> Result<f64, FileError> {
        if range.contains(value.get_ref()) { Ok(*value.get_ref()) } else { Err(self.refuse(key, value)) }
    }

    fn refuse_at(&self, key: &str, at: Range<usize>) -> FileError {
        let written = self.text.get(at.clone()).unwrap_or_default();
        let first_line = written.lines().next().unwrap_or_default();
        let mut shown: String = first_line.chars().take(40).collect();
        if shown.len() < written.len() {
            shown.push_str("...");
        }
        self.error(at, format!("`{key}` is {shown}"), format!("it should be {}", self.kind.right(key)))
    }

    /// Turns the parser's words into ours.
    fn explain(&self, error: &toml::de::Error) -> FileError {
        let at = error.span().unwrap_or(0..0);
        let message = error.message();
        if let Some(rest) = message.strip_prefix("unknown field ") {
            let mut names = quoted(rest);
            let unknown = if names.is_empty() { "" } else { names.remove(0) };
            let allowed: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
            let remedy = format!("the keys here are {}{}", allowed.join(", "), hint(unknown, &names));
            return self.error(at, format!("unknown key `{unknown}`"), remedy);
        }
        if let Some(rest) = message.strip_prefix("missing field ") {
            let key = quoted(rest).first().copied().unwrap_or_default();
            return self.error(
                at,
                format!("`{key}` is missing"),
                format!("it should be {}", self.kind.right(key)),
            );
        }
        if message == "duplicate key" {
            let key = self.text.get(at.clone()).unwrap_or_default();
            return self.error(at.clone(), format!("`{key}` is given twice"), "keep one of the two");
        }
        if message.starts_with("invalid type") || message.starts_with("invalid value") {
            return self.refuse_at(self.key_before(at.start), at);
        }
        self.error(
            at,
            message.replace('\n', " "),
            "a file is TOML: lines of `key = value` under [table] headings",
        )
    }

    /// The key whose value starts at or around this byte: the bare word before the last `=`.
    fn key_before(&self, at: usize) -> &str {
        let before = self.text.get(..at).unwrap_or_default();
        let before = before.rsplit_once('=').map_or(before, |(key, _)| key).trim_end();
        let is_key = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        before.rsplit(|c| !is_key(c)).next().unwrap_or_default()
    }
}

/// The words between backquotes.
fn quoted(text: &str) -> Vec<&str> {
    text.split('`').skip(1).step_by(2).collect()
}

/// ` (did you mean X?)` for the candidate nearest to a misspelt name, where one is near enough.
pub(crate) fn hint(name: &str, candidates: &[&str]) -> String {
    let near = candidates.iter().map(|candidate| (edits(name, candidate), candidate)).min();
    match near {
        Some((count, candidate)) if count <= 1 + name.chars().count() / 4 => {
            format!(" (did you mean `{candidate}`?)")
        }
        _ => String::new(),
    }
}

/// How many letters to insert, drop or change to get from one word to the other (Levenshtein).
fn edits(from: &str, to: &str) -> usize {
    let to: Vec<char> = to.chars().collect();
    let mut row: Vec<usize> = (0..=to.len()).collect();
    for (i, a) in from.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, b) in to.iter().enumerate() {
            let change = diagonal + usize::from(a != *b);
            diagonal = row[j + 1];
            row[j + 1] = change.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[to.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edits_count_letters() {
        assert_eq!(edits("hills", "hills"), 0);
        assert_eq!(edits("hils", "hills"), 1);
        assert_eq!(edits("", "abc"), 3);
        assert_eq!(edits("kitten", "sitting"), 3);
    }

    #[test]
    fn a_hint_needs_a_near_name() {
        assert_eq!(hint("canyonland", &["hills", "canyonlands"]), " (did you mean `canyonlands`?)");
        assert_eq!(hint("moon", &["hills", "canyonlands"]), "");
    }
}
