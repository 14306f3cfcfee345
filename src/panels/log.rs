//! The log's last lines.

use std::collections::VecDeque;

use egui::{Button, Color32, Panel, RichText, ScrollArea, Ui};
use tracing::Level;

use crate::log_lines::{self, Line};

#[derive(Default)]
pub(super) struct Log {
    lines: VecDeque<Line>,
    is_open: bool,
    /// Serial of the last line that was seen.
    seen: u64,
}

impl Log {
    /// Takes in what was written since.
    pub(super) fn read(&mut self) {
        log_lines::since(self.last(), &mut self.lines);
        if self.is_open {
            self.seen = self.last();
        }
    }

    fn last(&self) -> u64 {
        self.lines.back().map_or(0, |line| line.serial)
    }

    /// Opens and closes it; says how many warnings there are that nobody has seen.
    pub(super) fn button(&mut self, ui: &mut Ui) {
        let news =
            self.lines.iter().filter(|line| line.serial > self.seen && line.level <= Level::WARN).count();
        let text = match news {
            0 => RichText::new("Log"),
            _ => RichText::new(format!("Log ({news})")).color(colour(Level::WARN)),
        };
        let button = ui.add(Button::new(text).selected(self.is_open));
        if button
            .on_hover_text("The log's last lines: warnings, and what the layers and runtimes say.")
            .clicked()
        {
            self.is_open = !self.is_open;
        }
    }

    pub(super) fn show(&self, ui: &mut Ui) {
        if !self.is_open {
            return;
        }
        Panel::bottom("log").resizable(true).default_size(140.0).frame(super::backing()).show(ui, |ui| {
            ui.strong("Log");
            ScrollArea::vertical().auto_shrink(false).stick_to_bottom(true).show(ui, |ui| {
                if self.lines.is_empty() {
                    ui.weak("Nothing so far.");
                }
                for line in &self.lines {
                    let time = format!("{:02}:{:02}", line.second / 60, line.second % 60);
                    let text = format!("{time}  {}", line.text);
                    ui.label(RichText::new(text).monospace().color(colour(line.level)));
                }
            });
        });
    }
}

fn colour(level: Level) -> Color32 {
    match level {
        Level::ERROR => Color32::from_rgb(0xff, 0x7b, 0x6b),
        Level::WARN => Color32::from_rgb(0xff, 0xc8, 0x57),
        _ => Color32::from_gray(200),
    }
}
