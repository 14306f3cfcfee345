//! Errors in shaders joined from several pieces, pointing at the piece's own line.

use std::fmt::Write;
use std::ops::Range;

use super::shader::Source;

/// The pieces joined, and where each begins.
pub(super) struct Joined {
    pub(super) text: String,
    /// Name and first byte of each piece, in order.
    pieces: Vec<(String, usize)>,
}

impl Joined {
    pub(super) fn new(pieces: &[Source<'_>]) -> Self {
        let mut joined = Self { text: String::new(), pieces: Vec::with_capacity(pieces.len()) };
        for piece in pieces {
            joined.pieces.push((piece.name.to_owned(), joined.text.len()));
            joined.text.push_str(piece.text);
            if !piece.text.ends_with('\n') {
                joined.text.push('\n');
            }
        }
        joined
    }

    /// The error's message, the lines it speaks of with carets below, and notes.
    pub(super) fn explain<'a>(
        &self,
        message: &str,
        labels: impl Iterator<Item = (Option<Range<usize>>, &'a str)>,
        notes: impl Iterator<Item = String>,
    ) -> String {
        let mut out = format!("error: {message}");
        let mut pointed = false;
        for (range, label) in labels {
            if let Some(range) = range {
                self.point(&mut out, range, label);
                pointed = true;
            }
        }
        if !pointed {
            let names: Vec<&str> = self.pieces.iter().map(|(name, _)| name.as_str()).collect();
            out.push_str("\n  --> ");
            out.push_str(&names.join(" + "));
        }
        for note in notes {
            out.push_str("\n  = ");
            out.push_str(&note);
        }
        out
    }

    fn point(&self, out: &mut String, range: Range<usize>, label: &str) {
        let start = range.start.min(self.text.len());
        let after = self.pieces.partition_point(|(_, first)| *first <= start);
        let Some((name, first)) = self.pieces.get(after.saturating_sub(1)) else {
            return;
        };
        let line_start = self.text[..start].rfind('\n').map_or(0, |newline| newline + 1);
        let line_end = self.text[start..].find('\n').map_or(self.text.len(), |length| start + length);
        let line = self.text[*first..line_start].matches('\n').count() + 1;
        let column = self.text[line_start..start].chars().count();
        let end = range.end.clamp(start, line_end);
        let carets = self.text[start..end].chars().count().max(1);
        let margin = line.to_string().len();
        // Writing to a string cannot fail.
        let _ = write!(
            out,
            "\n{:margin$}--> {name}:{line}:{}\n{:margin$} |\n{line} | {}\n{:margin$} | {:column$}{} {label}",
            "",
            column + 1,
            "",
            self.text[line_start..line_end].replace('\t', " "),
            "",
            "",
            "^".repeat(carets),
        );
        out.truncate(out.trim_end().len());
    }
}
