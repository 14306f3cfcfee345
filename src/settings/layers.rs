//! Settings from several texts, the later over the earlier, and what is wrong with one.

use std::fmt;
use std::ops::Range;

use serde::Deserialize;
use toml::de::{DeTable, DeValue};
use toml::{Spanned, Table, Value};

use super::schema::{self, Rule, entry, is_section, names_in};
use super::{MANUAL, Settings};
use crate::world::source::hint;

/// Where a setting comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// The manual.
    BuiltIn,
    /// A file; line and column count from 1.
    File {
        /// As it was named to us.
        file: String,
        /// Its line.
        line: usize,
        /// Its column, in characters.
        column: usize,
    },
    /// `--set` with this text.
    Set(String),
    /// The environment variable of this name.
    Variable(String),
    /// An option of the command line.
    Option(&'static str),
    /// A panel.
    Change,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::BuiltIn => f.write_str("built in"),
            Place::File { file, line, column } => write!(f, "{file}:{line}:{column}"),
            Place::Set(text) => write!(f, "--set {text}"),
            Place::Variable(name) => f.write_str(name),
            Place::Option(name) => f.write_str(name),
            Place::Change => f.write_str("a change"),
        }
    }
}

/// What is wrong with a setting, where, and what would be right: `PLACE: problem; remedy`, on one line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place}: {problem}; {remedy}")]
pub struct Problem {
    /// Where.
    pub place: Place,
    /// What is wrong.
    pub problem: String,
    /// What would be right.
    pub remedy: String,
}

/// One setting as one layer has it.
#[derive(Clone, Debug, PartialEq)]
pub struct Leaf {
    /// Its name, such as `motion.speed`.
    pub path: String,
    /// A value that the schema allows.
    pub value: Value,
    /// Where from.
    pub place: Place,
}

/// The settings in force, and where each comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct InForce {
    /// All of them.
    pub settings: Settings,
    /// Each by itself, in the manual's order.
    pub lines: Vec<Leaf>,
    /// What is no error and yet hardly meant.
    pub remarks: Vec<String>,
}

impl InForce {
    /// The names of settings that are not what they are in `other`.
    pub fn differing<'a>(&'a self, other: &'a InForce) -> impl Iterator<Item = &'a str> {
        let pairs = self.lines.iter().zip(&other.lines);
        pairs.filter(|(one, two)| one.value != two.value).map(|(one, _)| one.path.as_str())
    }
}

/// A setting, checked.
pub(super) fn leaf(path: &str, value: Value, place: Place) -> Result<Leaf, Problem> {
    let Some(entry) = entry(path) else { return Err(unknown(path, place)) };
    if !entry.rule.allows(&value) {
        return Err(refusal(path, &value.to_string(), &value, &entry.rule, place));
    }
    Ok(Leaf { path: path.to_owned(), value, place })
}

fn refusal(path: &str, written: &str, value: &Value, rule: &Rule, place: Place) -> Problem {
    let line = written.lines().next().unwrap_or_default();
    let mut shown: String = line.chars().take(40).collect();
    if shown.len() < written.len() {
        shown.push_str("...");
    }
    let problem = format!("`{path}` is {shown}");
    Problem { place, problem, remedy: format!("it should be {rule}{}", rule.hint(value)) }
}

fn unknown(path: &str, place: Place) -> Problem {
    let (section, name) = path.rsplit_once('.').unwrap_or(("", path));
    let problem = format!("there is no setting `{path}`");
    if is_section(path) {
        let names = names_in(path).join(", ");
        let remedy = format!("`{path}` is a section: its settings are {names}");
        return Problem { place, problem: format!("`{path}` is no setting"), remedy };
    }
    if section.is_empty() {
        let ends: Vec<_> =
            schema::entries().iter().filter_map(|e| Some((e.path.rsplit_once('.')?.1, &e.path))).collect();
        let meant =
            ends.iter().find(|(end, _)| *end == name).map(|(_, path)| format!(" (did you mean `{path}`?)"));
        let meant = meant.unwrap_or_else(|| hint(name, &names_in("")));
        let remedy = format!("the sections are {}{meant}", names_in("").join(", "));
        return Problem { place, problem, remedy };
    }
    if !is_section(section) {
        return Problem { place: place.clone(), problem, ..unknown(section, place) };
    }
    let names = names_in(section);
    let remedy = format!("the settings of [{section}] are {}{}", names.join(", "), hint(name, &names));
    Problem { place, problem, remedy }
}

/// The settings that a text of TOML has.
pub(super) fn leaves(file: &str, text: &str) -> Result<Vec<Leaf>, Problem> {
    let source = Source { file, text };
    let table = DeTable::parse(text).map_err(|error| {
        let at = error.span().unwrap_or(0..0);
        Problem {
            place: source.place(&at),
            problem: error.message().replace('\n', " "),
            remedy: "a file of settings is TOML: lines of `key = value` under [section] headings".to_owned(),
        }
    })?;
    let mut found = Vec::new();
    source.walk("", table.get_ref(), &mut found)?;
    Ok(found)
}

struct Source<'a> {
    file: &'a str,
    text: &'a str,
}

impl Source<'_> {
    fn place(&self, at: &Range<usize>) -> Place {
        let before = self.text.get(..at.start).unwrap_or(self.text);
        let line_start = before.rfind('\n').map_or(0, |end| end + 1);
        Place::File {
            file: self.file.to_owned(),
            line: 1 + before.matches('\n').count(),
            column: 1 + before[line_start..].chars().count(),
        }
    }

    fn walk(&self, section: &str, table: &DeTable<'_>, found: &mut Vec<Leaf>) -> Result<(), Problem> {
        for (key, value) in table {
            let name = key.get_ref();
            let path = if section.is_empty() { name.to_string() } else { format!("{section}.{name}") };
            match value.get_ref() {
                DeValue::Table(inner) if is_section(&path) => self.walk(&path, inner, found)?,
                _ => found.push(self.leaf(&path, key.span(), value)?),
            }
        }
        Ok(())
    }

    fn leaf(&self, path: &str, key: Range<usize>, value: &Spanned<DeValue<'_>>) -> Result<Leaf, Problem> {
        let Some(entry) = entry(path) else { return Err(unknown(path, self.place(&key))) };
        let written = self.text.get(value.span()).unwrap_or_default();
        let place = self.place(&value.span());
        let parsed = read_value(written).filter(|_| !matches!(value.get_ref(), DeValue::Table(_)));
        match parsed {
            Some(value) if entry.rule.allows(&value) => Ok(Leaf { path: path.to_owned(), value, place }),
            other => Err(refusal(path, written, &other.unwrap_or(Value::Boolean(false)), &entry.rule, place)),
        }
    }
}

/// A TOML value.
fn read_value(text: &str) -> Option<Value> {
    toml::from_str::<Table>(&format!("value = {text}")).ok().filter(|table| table.len() == 1)?.remove("value")
}

/// A setting that is written as text: a TOML value, or a word without quotes where the setting takes words.
pub(super) fn spoken(path: &str, text: &str, place: Place) -> Result<Leaf, Problem> {
    let word = || Value::String(text.to_owned());
    let value = read_value(text).unwrap_or_else(word);
    let takes_words =
        entry(path).is_some_and(|entry| !entry.rule.allows(&value) && entry.rule.allows(&word()));
    leaf(path, if takes_words { word() } else { value }, place)
}

/// The manual by itself.
pub(super) fn built_in() -> Result<InForce, Problem> {
    merge(&[])
}

/// The manual, and over it these, the later over the earlier.
pub(super) fn merge(layers: &[Leaf]) -> Result<InForce, Problem> {
    let mut lines: Vec<Leaf> = leaves("config/default.toml", MANUAL)?;
    let order = |line: &Leaf| schema::entries().iter().position(|entry| entry.path == line.path);
    lines.sort_by_key(order);
    for line in &mut lines {
        line.place = Place::BuiltIn;
    }
    for leaf in layers {
        if let Some(line) = lines.iter_mut().find(|line| line.path == leaf.path) {
            line.clone_from(leaf);
        }
    }
    let settings = Settings::deserialize(Value::Table(nested(&lines))).map_err(|error| Problem {
        place: Place::BuiltIn,
        problem: error.message().replace('\n', " "),
        remedy: "please report this sentence".to_owned(),
    })?;
    let mut remarks = Vec::new();
    for (name, actions) in settings.keys.shared() {
        remarks.push(format!("the key {name} does several things at once: {}", actions.join(", ")));
    }
    for (name, actions) in settings.gamepad.buttons.shared() {
        remarks.push(format!("the button {name} does several things at once: {}", actions.join(", ")));
    }
    Ok(InForce { settings, lines, remarks })
}

/// Tables in tables.
fn nested(lines: &[Leaf]) -> Table {
    let mut all = Table::new();
    lines.iter().for_each(|line| insert(&mut all, &line.path, line.value.clone()));
    all
}

fn insert(table: &mut Table, path: &str, value: Value) {
    let Some((section, rest)) = path.split_once('.') else {
        table.insert(path.to_owned(), value);
        return;
    };
    if let Value::Table(inner) = table.entry(section).or_insert_with(|| Value::Table(Table::new())) {
        insert(inner, rest, value);
    }
}
