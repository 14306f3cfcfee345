//! Small charts as SVG, coloured by the page's style.

use std::fmt::Write;

use super::html::escaped;
use super::report::short;

/// Colours in the style, used in turn.
const COLOURS: usize = 8;

/// Room for the numbers at the left and the labels below.
const LEFT: f64 = 46.0;
const BELOW: f64 = 20.0;
const ABOVE: f64 = 14.0;

/// Layers stacked on each other over columns, and a line over them.
pub(super) struct Layers<'a> {
    pub(super) title: &'a str,
    pub(super) unit: &'a str,
    /// Name and a value per column.
    pub(super) layers: Vec<(&'a str, Vec<f64>)>,
    pub(super) line: Option<(&'a str, Vec<f64>)>,
    /// What is shown for a column under the pointer.
    pub(super) hints: Vec<String>,
    /// Columns where something begins, and what.
    pub(super) marks: Vec<(usize, String)>,
    pub(super) height: f64,
}

/// One line of a chart: a value per column.
pub(super) struct Line {
    pub(super) values: Vec<f64>,
    pub(super) colour: usize,
}

/// Lines over columns.
pub(super) struct Lines<'a> {
    pub(super) title: &'a str,
    pub(super) lines: Vec<Line>,
    pub(super) marks: Vec<(usize, String)>,
    pub(super) height: f64,
}

/// A bar per label, with its value as a text.
pub(super) struct Bars<'a> {
    pub(super) title: &'a str,
    pub(super) bars: Vec<(String, f64, String)>,
    pub(super) colour: usize,
}

/// How many values there are of each size.
pub(super) struct Histogram<'a> {
    pub(super) title: &'a str,
    pub(super) values: Vec<f64>,
    pub(super) marks: [(&'a str, f64); 2],
    pub(super) colour: usize,
}

/// Where values lie on the picture.
struct Frame {
    width: f64,
    height: f64,
    /// The value at the upper edge.
    top: f64,
    columns: usize,
}

impl Frame {
    fn x(&self, column: f64) -> f64 {
        LEFT + (self.width - LEFT) * column / self.columns.max(1) as f64
    }

    fn y(&self, value: f64) -> f64 {
        let floor = self.height - BELOW;
        floor - (floor - ABOVE) * (value / self.top).clamp(0.0, 1.0)
    }

    fn begin(&self) -> String {
        format!("<svg viewBox=\"0 0 {:.0} {:.0}\" role=\"img\">\n", self.width, self.height)
    }

    /// Lines across with their values.
    fn grid(&self, step: f64) -> String {
        let mut text = String::new();
        let count = (self.top / step + 1e-9) as usize;
        for i in 0..=count {
            let value = step * i as f64;
            let y = self.y(value);
            let class = if i == 0 { "axis" } else { "grid" };
            let _ = writeln!(
                text,
                "<line class=\"{class}\" x1=\"{LEFT}\" y1=\"{y:.1}\" x2=\"{:.0}\" y2=\"{y:.1}\"/>\
                 <text x=\"{:.0}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                self.width,
                LEFT - 8.0,
                y + 4.0,
                axis_number(value, step)
            );
        }
        text
    }

    fn marks(&self, marks: &[(usize, String)]) -> String {
        let mut text = String::new();
        for (column, label) in marks {
            let x = self.x(*column as f64);
            let _ = writeln!(
                text,
                "<line class=\"limit\" x1=\"{x:.1}\" y1=\"{ABOVE}\" x2=\"{x:.1}\" y2=\"{:.1}\"/>\
                 <text class=\"mark\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                self.height - BELOW,
                x + 4.0,
                self.height - 6.0,
                escaped(label)
            );
        }
        text
    }

    /// A line through the middles of the columns.
    fn line(&self, values: &[f64], class: &str) -> String {
        let mut points = String::new();
        for (i, &value) in values.iter().enumerate() {
            let _ = write!(points, "{:.1},{:.1} ", self.x(i as f64 + 0.5), self.y(value));
        }
        format!("<polyline class=\"line {class}\" points=\"{}\"/>\n", points.trim_end())
    }
}

impl Layers<'_> {
    pub(super) fn svg(&self) -> String {
        let columns = self.hints.len();
        let sums: Vec<f64> =
            (0..columns).map(|i| self.layers.iter().map(|(_, layer)| layer[i]).sum()).collect();
        let shown =
            sums.iter().chain(self.line.iter().flat_map(|(_, line)| line)).copied().collect::<Vec<_>>();
        let (most, clipped) = sensible_most(&shown);
        let step = nice_step(most, 4);
        let frame = Frame { width: 1000.0, height: self.height, top: (most / step).ceil() * step, columns };
        let mut text = self.legend(clipped);
        text += &frame.begin();
        text += &frame.grid(step);
        let mut below = vec![0.0; columns];
        for (index, (_, layer)) in self.layers.iter().enumerate() {
            let above: Vec<f64> = below.iter().zip(layer).map(|(below, value)| below + value).collect();
            text += &area(&frame, &below, &above, index % COLOURS);
            below = above;
        }
        if let Some((_, line)) = &self.line {
            text += &frame.line(line, "sline");
        }
        text += &frame.marks(&self.marks);
        for (i, hint) in self.hints.iter().enumerate() {
            let (x, next) = (frame.x(i as f64), frame.x(i as f64 + 1.0));
            let _ = writeln!(
                text,
                "<rect class=\"over\" x=\"{x:.2}\" y=\"{ABOVE}\" width=\"{:.2}\" height=\"{:.1}\"><title>{}</title></rect>",
                next - x,
                self.height - BELOW - ABOVE,
                escaped(hint)
            );
        }
        text + "</svg>\n</figure>\n"
    }

    fn legend(&self, clipped: Option<f64>) -> String {
        let mut text =
            format!("<figure>\n<figcaption>{}</figcaption>\n<div class=\"legend\">", escaped(self.title));
        for (index, (name, _)) in self.layers.iter().enumerate() {
            let _ = write!(text, "<span><i class=\"f{}\"></i>{}</span>", index % COLOURS, escaped(name));
        }
        if let Some((name, _)) = &self.line {
            let _ = write!(text, "<span><i class=\"stroke sline\"></i>{}</span>", escaped(name));
        }
        if let Some(worst) = clipped {
            let _ =
                write!(text, "<span>the worst, {} {}, is above the chart</span>", short(worst), self.unit);
        }
        text + "</div>\n"
    }
}

/// The area between two lines.
fn area(frame: &Frame, below: &[f64], above: &[f64], colour: usize) -> String {
    let mut points = String::new();
    let mut point = |column: usize, value: f64| {
        let _ = write!(points, "{:.1},{:.1} ", frame.x(column as f64), frame.y(value));
    };
    for (i, &value) in above.iter().enumerate() {
        point(i, value);
        point(i + 1, value);
    }
    for (i, &value) in below.iter().enumerate().rev() {
        point(i + 1, value);
        point(i, value);
    }
    format!("<polygon class=\"f{colour}\" points=\"{}\"/>\n", points.trim_end())
}

impl Lines<'_> {
    pub(super) fn svg(&self) -> String {
        let values = || self.lines.iter().flat_map(|line| &line.values).copied();
        let columns = self.lines.iter().map(|line| line.values.len()).max().unwrap_or(0);
        let most = values().fold(0.0, f64::max);
        let step = if most > 0.0 { nice_step(most, 3) } else { 1.0 };
        let top = (most / step).ceil().max(1.0) * step;
        let frame = Frame { width: 500.0, height: self.height, top, columns };
        let mut text = format!("<figure>\n<figcaption>{}</figcaption>\n", escaped(self.title));
        text += &frame.begin();
        text += &frame.grid(step);
        text += &frame.marks(&self.marks);
        for line in &self.lines {
            text += &frame.line(&line.values, &format!("s{}", line.colour % COLOURS));
        }
        text + "</svg>\n</figure>\n"
    }
}

impl Bars<'_> {
    pub(super) fn svg(&self) -> String {
        let (width, row) = (240.0, 34.0);
        let height = row * self.bars.len() as f64 + 2.0;
        let most = self.bars.iter().map(|bar| bar.1).fold(0.0, f64::max);
        let mut text = format!(
            "<figure>\n<figcaption>{}</figcaption>\n<svg viewBox=\"0 0 {width} {height:.0}\" role=\"img\">\n",
            escaped(self.title)
        );
        for (i, (label, value, shown)) in self.bars.iter().enumerate() {
            let y = row * i as f64;
            // Something that is not 0 can be seen.
            let length = if *value > 0.0 { (width * value / most).max(2.0) } else { 0.0 };
            let _ = writeln!(
                text,
                "<text x=\"0\" y=\"{:.0}\">{}</text><text class=\"value\" x=\"{width}\" y=\"{:.0}\" \
                 text-anchor=\"end\">{}</text><rect class=\"grid\" fill=\"none\" x=\"0\" y=\"{:.0}\" \
                 width=\"{width}\" height=\"7\" rx=\"3\"/><rect class=\"f{}\" x=\"0\" y=\"{:.0}\" width=\"{length:.1}\" \
                 height=\"7\" rx=\"3\"/>",
                y + 13.0,
                escaped(label),
                y + 13.0,
                escaped(shown),
                y + 18.0,
                self.colour % COLOURS,
                y + 18.0
            );
        }
        text + "</svg>\n</figure>\n"
    }
}

/// Bins of a histogram.
const BINS: usize = 40;

impl Histogram<'_> {
    pub(super) fn svg(&self) -> String {
        let (most, _) = sensible_most(&self.values);
        let least = self.values.iter().copied().fold(most, f64::min);
        let step = nice_step((most - least).max(1e-3 * most).max(1e-6), 4);
        let from = (least / step).floor() * step;
        let to = ((most / step).ceil() * step).max(from + step);
        let mut counts = vec![0usize; BINS];
        for value in &self.values {
            let bin = ((value - from) / (to - from) * BINS as f64) as usize;
            counts[bin.min(BINS - 1)] += 1;
        }
        let highest = counts.iter().copied().max().unwrap_or(1).max(1) as f64;
        let grid = nice_step(highest, 3).max(1.0);
        let top = (highest / grid).ceil() * grid;
        let frame = Frame { width: 320.0, height: 180.0, top, columns: BINS };
        let mut text = format!("<figure>\n<figcaption>{}</figcaption>\n", escaped(self.title));
        text += &frame.begin();
        text += &frame.grid(grid);
        for (i, &count) in counts.iter().enumerate().filter(|bin| *bin.1 > 0) {
            let (x, next, y) = (frame.x(i as f64), frame.x(i as f64 + 1.0), frame.y(count as f64));
            let low = from + (to - from) * i as f64 / BINS as f64;
            let high = from + (to - from) * (i + 1) as f64 / BINS as f64;
            let _ = writeln!(
                text,
                "<rect class=\"f{}\" x=\"{:.1}\" y=\"{y:.1}\" width=\"{:.1}\" height=\"{:.1}\" rx=\"1\">\
                 <title>{} to {} ms: {count} frames</title></rect>",
                self.colour % COLOURS,
                x + 0.5,
                (next - x - 1.0).max(0.5),
                frame.height - BELOW - y,
                short(low),
                short(high)
            );
        }
        let at = |value: f64| frame.x((value - from) / (to - from) * BINS as f64).min(frame.width);
        for i in 0..=((to - from) / step + 1e-9) as usize {
            let value = from + step * i as f64;
            let _ = writeln!(
                text,
                "<text x=\"{:.1}\" y=\"{:.0}\" text-anchor=\"middle\">{}</text>",
                at(value),
                frame.height - 5.0,
                axis_number(value, step)
            );
        }
        for (i, (name, value)) in self.marks.iter().enumerate() {
            let x = at(*value);
            let anchor = if x > 0.7 * frame.width { ("end", -4.0) } else { ("start", 4.0) };
            let _ = writeln!(
                text,
                "<line class=\"limit\" x1=\"{x:.1}\" y1=\"{ABOVE}\" x2=\"{x:.1}\" y2=\"{:.1}\"/>\
                 <text class=\"mark\" x=\"{:.1}\" y=\"{:.0}\" text-anchor=\"{}\">{name} {}</text>",
                frame.height - BELOW,
                x + anchor.1,
                ABOVE - 3.0 + 13.0 * i as f64,
                anchor.0,
                short(*value)
            );
        }
        text + "</svg>\n</figure>\n"
    }
}

/// The value at a chart's top: the greatest, unless a few dwarf all others; then those are cut off, and the greatest
/// of them is given too.
fn sensible_most(values: &[f64]) -> (f64, Option<f64>) {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let most = sorted.last().copied().unwrap_or(0.0).max(1e-6);
    let usual = crate::telemetry::quantile(&sorted, 0.98).unwrap_or(most).max(1e-6);
    if most > 3.0 * usual { (1.5 * usual, Some(most)) } else { (most, None) }
}

/// 1, 2 or 5 times a power of ten, so that about `steps` of them make `most`.
fn nice_step(most: f64, steps: usize) -> f64 {
    let raw = most.max(1e-6) / steps as f64;
    let power = 10f64.powf(raw.log10().floor());
    let nice = [1.0, 2.0, 5.0, 10.0].into_iter().find(|nice| nice * power >= raw * 0.999).unwrap_or(10.0);
    nice * power
}

/// A number of an axis with as many decimals as its step needs.
fn axis_number(value: f64, step: f64) -> String {
    match step {
        _ if value == 0.0 => "0".to_owned(),
        step if step >= 1e6 || value >= 1e6 => format!("{} M", trimmed(value / 1e6)),
        step if step >= 1e3 || value >= 1e4 => format!("{} k", trimmed(value / 1e3)),
        step if step >= 1.0 => format!("{value:.0}"),
        step => format!("{value:.*}", (-step.log10()).ceil().max(0.0) as usize),
    }
}

fn trimmed(value: f64) -> String {
    let text = format!("{value:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round_numbers() {
        let cases = [(10.0, 4, 5.0), (7.3, 4, 2.0), (0.9, 3, 0.5), (1234.0, 4, 500.0), (4.0, 4, 1.0)];
        for (most, steps, step) in cases {
            assert!((nice_step(most, steps) / step - 1.0).abs() < 1e-9, "{most}: {}", nice_step(most, steps));
        }
        assert!(nice_step(0.0, 4) > 0.0);
        let shown = [(0.0, 500.0), (0.5, 0.5), (20.0, 10.0), (3_000.0, 1_000.0), (2_500_000.0, 500_000.0)];
        let shown = shown.map(|(value, step)| axis_number(value, step));
        assert_eq!(shown, ["0", "0.5", "20", "3 k", "2.5 M"]);
    }

    #[test]
    fn one_value_that_dwarfs_all_is_cut_off_and_said() {
        let mut values = vec![10.0; 199];
        assert_eq!(sensible_most(&values), (10.0, None));
        values.push(500.0);
        assert_eq!(sensible_most(&values), (15.0, Some(500.0)));
        assert_eq!(sensible_most(&[]), (1e-6, None));
    }
}
