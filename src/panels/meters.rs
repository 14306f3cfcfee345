//! Right: where the time goes, what is drawn, and where this is.

use std::time::{Duration, Instant};

use egui::{
    Align, Button, Color32, FontId, Grid, Label, Layout, RichText, ScrollArea, Sense, TextStyle, Ui, vec2,
};

use super::graph;
use super::log::Log;
use super::numbers::{Moment, Numbers, Part, Summary};
use super::{Facts, Wish};
use crate::telemetry::Span;
use crate::yardstick::{power_of_ten, yardstick};

/// Points.
pub(super) const WIDTH: f32 = 292.0;

/// Heights of a graph: as much as is left, between these.
const GRAPH: std::ops::RangeInclusive<f32> = 24.0..=60.0;

/// How long the button says that the address was copied.
const COPIED_FOR: Duration = Duration::from_secs(2);

/// Letters of an address that are shown.
const LETTERS: usize = 40;

#[derive(Default)]
pub(super) struct Meters {
    /// Spans are measured on a processor instead of by the clock.
    processor: bool,
    copied: Option<Instant>,
    scratch: Vec<f64>,
    /// Height of all but the graphs, as of the last picture.
    rest: f32,
}

impl Meters {
    /// The address is in the clipboard.
    pub(super) fn copied(&mut self) {
        self.copied = Some(Instant::now());
    }

    pub(super) fn show(
        &mut self,
        ui: &mut Ui,
        numbers: &Numbers,
        cost_ms: f64,
        log: &mut Log,
        wish: &mut dyn FnMut(Wish),
    ) {
        ui.horizontal(|ui| {
            ui.heading("What it costs");
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| log.button(ui));
        });
        let graph = ((ui.available_height() - self.rest) / 2.0).clamp(*GRAPH.start(), *GRAPH.end());
        let shown = ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            dense(ui);
            self.show_times(ui, numbers, graph);
            ui.add_space(4.0);
            if let Some(moment) = numbers.history.last() {
                show_work(ui, moment, cost_ms);
                ui.add_space(4.0);
                self.show_place(ui, numbers, moment, wish);
            }
            if let Some(facts) = &numbers.facts {
                show_facts(ui, facts);
            }
        });
        self.rest = shown.content_size.y - 2.0 * graph;
    }

    fn show_times(&mut self, ui: &mut Ui, numbers: &Numbers, graph: f32) {
        let history = &numbers.history;
        let span = |span| if self.processor { Part::Processor(span) } else { Part::Clock(span) };
        let spans = Span::ALL.map(span);
        let cpu: Vec<_> = spans.into_iter().enumerate().map(|(i, part)| (part, graph::colour(i))).collect();
        let gpu: Vec<_> = history
            .passes()
            .iter()
            .enumerate()
            .map(|(i, name)| (Part::Pass(name), graph::colour(i + 3)))
            .collect();
        let scratch = &mut self.scratch;
        let mut row = |ui: &mut Ui, name: &str, part: Part, colour: Option<Color32>, about: &str| {
            let summary = history.summary(part, scratch);
            time_row(ui, name, colour, Some(summary), about);
        };
        Grid::new("times").num_columns(4).min_col_width(46.0).spacing([6.0, 1.0]).show(ui, |ui| {
            time_row(ui, "milliseconds", None, None, "");
            row(ui, "frame", Part::Frame, None, "From one frame drawn to the next.");
            for (i, (part, colour)) in cpu.iter().enumerate() {
                row(ui, Span::ALL[i].name(), *part, Some(*colour), about_span(Span::ALL[i]));
            }
            for (name, (part, colour)) in history.passes().iter().zip(&gpu) {
                row(ui, &format!("GPU {name}"), *part, Some(*colour), about_pass(name));
            }
        });
        ui.horizontal(|ui| {
            ui.weak("CPU");
            ui.selectable_value(&mut self.processor, false, "by the clock").on_hover_text("Waits included.");
            ui.selectable_value(&mut self.processor, true, "on the processor")
                .on_hover_text("What this thread computes; the driver's own threads are not counted.");
        });
        graph::show(ui, "CPU", history, &cpu, graph);
        graph::show(ui, "GPU", history, &gpu, graph);
    }

    fn show_place(&self, ui: &mut Ui, numbers: &Numbers, moment: &Moment, wish: &mut dyn FnMut(Wish)) {
        let depth = moment.row.depth;
        ui.strong("Where this is");
        pairs(ui, "place", |ui| {
            pair(ui, "Depth", &format!("{depth:.2} octaves"), "Each halves what is seen.");
            pair(ui, "", &power_of_ten(depth), "The same as a power of ten.");
            if let Some([speed, most]) = moment.speed {
                let about = "Octaves per second, and how many at full speed (the wheel).";
                pair(ui, "Speed", &format!("{speed:.2} of {most:.2} octaves/s"), about);
            }
        });
        ui.label(format!("If the start was the Earth, this is {}.", yardstick(depth)));
        ui.horizontal(|ui| {
            let copied = self.copied.is_some_and(|at| at.elapsed() < COPIED_FOR);
            let button =
                ui.add_sized([104.0, 20.0], Button::new(if copied { "Copied" } else { "Copy address" }));
            let about =
                "Puts this place on the clipboard, exact to the bit: `fathomless view --at` goes back to it.";
            if button.on_hover_text(about).clicked() {
                wish(Wish::CopyAddress);
            }
            let address = &numbers.address;
            let start: String = address.chars().take(LETTERS).collect();
            ui.add(Label::new(RichText::new(start).small().weak()).truncate()).on_hover_text(address);
        });
    }
}

fn time_row(ui: &mut Ui, name: &str, colour: Option<Color32>, summary: Option<Summary>, about: &str) {
    let label = ui.horizontal(|ui| {
        let (area, _) = ui.allocate_exact_size(vec2(9.0, 9.0), Sense::hover());
        if let Some(colour) = colour {
            ui.painter().rect_filled(area, 2.0, colour);
        }
        let text = RichText::new(name);
        ui.label(if summary.is_some() { text } else { text.weak() })
    });
    if !about.is_empty() {
        label.inner.on_hover_text(about);
    }
    let cells = match summary {
        Some(Summary { now, p99, worst }) => [now, p99, worst].map(milliseconds),
        None => ["now", "99 %", "worst"].map(str::to_owned),
    };
    for cell in cells {
        let text = RichText::new(cell).monospace();
        let text = if summary.is_some() { text } else { text.weak() };
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| ui.label(text));
    }
    ui.end_row();
}

/// Three digits.
fn milliseconds(ms: f64) -> String {
    match ms {
        ms if ms < 9.995 => format!("{ms:.2}"),
        ms if ms < 99.95 => format!("{ms:.1}"),
        ms => format!("{ms:.0}"),
    }
}

fn about_span(span: Span) -> &'static str {
    match span {
        Span::Place => "Finding the place and its path.",
        Span::Wait => "Waiting until the headset wants a frame: what is left over.",
        Span::Xr => "The other OpenXR calls.",
        Span::Begin => "Beginning a frame on the GPU: waits for the one before the last.",
        Span::Select => "Choosing the tiles to draw.",
        Span::Bake => "Choosing what of the backdrop to bake.",
        Span::Record => "Writing records and recording commands.",
        Span::Submit => "Handing the commands over. A software driver may draw in here.",
        Span::Mirror => "Putting the window's picture together and handing it over.",
    }
}

fn about_pass(name: &str) -> &'static str {
    match name {
        "tiles" => "The heights of new tiles.",
        "bake" => "A slice of the backdrop's next layer.",
        "terrain" => "Both eyes: tiles, backdrop, sky.",
        "mirror" => "A copy of the eyes' pictures for the window.",
        "sky cube" => "Sky and backdrop as a layer of their own.",
        _ => "A pass on the GPU.",
    }
}

fn show_work(ui: &mut Ui, moment: &Moment, cost_ms: f64) {
    let (work, memory) = (&moment.row.work, &moment.row.memory);
    ui.strong("What is drawn");
    pairs(ui, "work", |ui| {
        let tiles =
            format!("{} drawn, {} made, {} waiting", work.tiles_drawn, work.tiles_made, work.tiles_waiting);
        let about = "Made in this frame; waiting for a later frame, with coarser ones in their place.";
        pair(ui, "Tiles", &tiles, about);
        pair(ui, "Triangles", &grouped(work.triangles), "Of each eye.");
        let about = "Of the quadtree, looked at to choose the tiles; and draw calls.";
        pair(ui, "Nodes", &format!("{}, {} draws", grouped(work.nodes), work.draws), about);
        let baked = format!("{} texels baked", grouped(work.texels_baked));
        pair(ui, "Backdrop", &baked, "Of the next layer of the backdrop, in this frame.");
        let about =
            "The share of its parallax bound that the backdrop has used up, and how fast one may go on.";
        let (parallax, headroom) = (100.0 * moment.row.parallax, 100.0 * moment.row.headroom);
        pair(ui, "Parallax", &format!("{parallax:.0} % used, {headroom:.0} % speed"), about);
        let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
        let bytes = format!(
            "GPU {:.0}, heap {:.1}, all {:.0} MiB",
            mib(memory.gpu_bytes),
            mib(memory.heap_bytes),
            mib(memory.rss_bytes)
        );
        pair(
            ui,
            "Memory",
            &bytes,
            "On the GPU by us; on the heap by us; of this process, as the system counts.",
        );
        let about = "The way down from the root: all that grows with depth.";
        pair(ui, "Path", &format!("{} bytes", grouped(memory.path_bytes)), about);
        pair(
            ui,
            "Panels",
            &format!("{cost_ms:.2} ms a picture"),
            "What these panels cost, on a thread of their own.",
        );
    });
}

/// Much has to be seen at once.
fn dense(ui: &mut Ui) {
    let styles = &mut ui.style_mut().text_styles;
    styles.insert(TextStyle::Body, FontId::proportional(12.0));
    styles.insert(TextStyle::Monospace, FontId::monospace(11.5));
    ui.spacing_mut().interact_size.y = 16.0;
}

fn show_facts(ui: &mut Ui, facts: &Facts) {
    ui.add_space(4.0);
    let [width, height] = facts.eye_size;
    let device = format!("{width} x {height} pixels an eye, on {}", facts.device);
    for line in [&facts.title, &device] {
        ui.add(Label::new(RichText::new(line).weak()).truncate()).on_hover_text(line);
    }
}

fn pairs(ui: &mut Ui, name: &str, add: impl FnOnce(&mut Ui)) {
    Grid::new(name).num_columns(2).min_col_width(60.0).spacing([6.0, 1.0]).show(ui, add);
}

fn pair(ui: &mut Ui, name: &str, value: &str, about: &str) {
    ui.weak(name);
    ui.label(value).on_hover_text(about);
    ui.end_row();
}

/// A whole number with its thousands apart.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::with_capacity(digits.len() * 4 / 3);
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_to_be_read() {
        assert_eq!([0, 999, 1000, 1_234_567].map(grouped), ["0", "999", "1,000", "1,234,567"]);
        assert_eq!([0.0, 1.234, 12.34, 123.4].map(milliseconds), ["0.00", "1.23", "12.3", "123"]);
    }
}
