//! The last lines of the log, kept to be shown in a window: warnings of everything, and what this program has to say.

use std::collections::VecDeque;
use std::fmt::{self, Write};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use tracing::field::{Field, Visit};
use tracing::{Event, Level, Metadata, Subscriber};
use tracing_subscriber::layer::{Context, Layer};

/// Lines kept.
const KEPT: usize = 200;

/// Characters kept of a line.
const LONGEST: usize = 600;

/// A line of the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    /// Counts all lines of this process, from 1.
    pub serial: u64,
    /// Seconds since the first line.
    pub second: u64,
    /// How bad it is.
    pub level: Level,
    /// What it says, and who says it where that is not this program itself.
    pub text: String,
}

#[derive(Default)]
struct Book {
    lines: VecDeque<Line>,
    serial: u64,
    began: Option<Instant>,
}

static BOOK: Mutex<Book> = Mutex::new(Book { lines: VecDeque::new(), serial: 0, began: None });

/// Writes the log's lines down; there is one book in a process, as there is one log.
pub struct LogLines;

impl<S: Subscriber> Layer<S> for LogLines {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let meta = event.metadata();
        if is_kept(meta) {
            let mut words = Words(String::new());
            event.record(&mut words);
            add(*meta.level(), meta.target(), words.0);
        }
    }
}

fn is_ours(target: &str) -> bool {
    ["fathomless", "vulkan"].iter().any(|name| target.starts_with(name))
}

fn is_kept(meta: &Metadata<'_>) -> bool {
    // `Level` counts upwards from errors.
    let most = if is_ours(meta.target()) { Level::INFO } else { Level::WARN };
    // They warn of displays that are a little unusual.
    let is_noise = ["winit", "arboard"].iter().any(|name| meta.target().starts_with(name));
    *meta.level() <= most && !is_noise
}

fn add(level: Level, target: &str, mut text: String) {
    if !target.starts_with("fathomless") {
        text = format!("{target}: {text}");
    }
    if let Some((end, _)) = text.char_indices().nth(LONGEST) {
        text.truncate(end);
        text.push('…');
    }
    let mut book = BOOK.lock().unwrap_or_else(PoisonError::into_inner);
    book.serial += 1;
    let second = book.began.get_or_insert_with(Instant::now).elapsed().as_secs();
    if book.lines.len() == KEPT {
        book.lines.pop_front();
    }
    let serial = book.serial;
    book.lines.push_back(Line { serial, second, level, text });
}

/// The lines after one of this serial (0: all that are kept), the oldest first, are added to `to`.
pub fn since(serial: u64, to: &mut VecDeque<Line>) {
    let book = BOOK.lock().unwrap_or_else(PoisonError::into_inner);
    to.extend(book.lines.iter().filter(|line| line.serial > serial).cloned());
    while to.len() > KEPT {
        to.pop_front();
    }
}

/// The message, and the other fields behind it.
struct Words(String);

impl Visit for Words {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        // Writing to a string does not fail.
        let _ = match field.name() {
            "message" => write!(self.0, "{value:?}"),
            name => write!(self.0, " {name}={value:?}"),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracing_subscriber::prelude::*;

    /// The one book is every test's: this is the only one.
    #[test]
    fn the_last_lines_are_kept_with_what_they_are_about() {
        let log = tracing_subscriber::registry().with(LogLines);
        tracing::subscriber::with_default(log, || {
            tracing::debug!("not this");
            tracing::info!(target: "elsewhere", "nor this");
            tracing::warn!(target: "vulkan", "something");
            tracing::info!(size = 3, "a thing");
        });
        let mut lines = VecDeque::new();
        since(0, &mut lines);
        let texts: Vec<&str> = lines.iter().map(|line| line.text.as_str()).collect();
        assert_eq!(texts, ["vulkan: something", "a thing size=3"]);
        assert_eq!((lines[0].level, lines[0].serial), (Level::WARN, 1));
        for i in 0..500 {
            add(Level::INFO, "fathomless", i.to_string());
        }
        since(lines[1].serial, &mut lines);
        assert_eq!(
            (lines.len(), lines[0].text.as_str(), lines[KEPT - 1].text.as_str()),
            (KEPT, "300", "499")
        );
        add(Level::INFO, "fathomless", "ü".repeat(10_000));
        let last = lines[KEPT - 1].serial;
        since(last, &mut lines);
        assert_eq!(lines[KEPT - 1].text.chars().count(), LONGEST + 1);
    }
}
