//! A report as one page: tiles, charts and tables, with neither scripts nor anything from outside.

use std::fmt::Write;

use super::report::{AtDepth, Named, Quantiles, Report, bytes, pass_names, short};
use super::svg::{Bars, Histogram, Layers, Line, Lines};
use crate::telemetry::{Row, Span};

/// The page's style: two sets of colours, chosen by the reader's system.
const STYLE: &str = include_str!("style.css");

/// The whole page.
pub(super) fn page(report: &Report) -> String {
    let title = format!("{} over {}", report.flight, report.world);
    let mut page = format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <meta name=\"color-scheme\" content=\"light dark\"/>\n<title>Fathomless bench: {}</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n",
        escaped(&title)
    );
    page += &head(report, &title);
    page += &tiles(report);
    if !report.rows.is_empty() {
        page += &frames(report);
        page += &spread(report);
        page += &work(report);
        page += &memory(report);
        page += &tables(report);
    }
    page += "</main>\n</body>\n</html>\n";
    page
}

/// Text as it may stand in a page, in attributes too.
pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn head(report: &Report, title: &str) -> String {
    let [width, height] = report.size;
    let machine = &report.machine;
    let stopped = if report.stopped { ", stopped early" } else { "" };
    let eyes = if report.multiview { "both eyes in one pass" } else { "a pass per eye" };
    let budget = if report.complete { "every frame complete" } else { "tiles made within a budget" };
    let facts = [
        (
            "Flight",
            format!("{}, {} frames in {:.1} s{stopped}", report.flight, report.frames, report.seconds),
        ),
        ("World", format!("{}, seed {}", report.world, report.seed)),
        ("Picture", format!("{width} × {height} per eye, {eyes}; {budget}")),
        ("Device", format!("{}, {} ({})", report.device, report.driver_version, report.driver)),
        (
            "Machine",
            format!(
                "{}, {} cores, {}, {}",
                machine.cpu,
                machine.cores,
                bytes(machine.memory_bytes as f64),
                machine.os
            ),
        ),
        ("Runtime", report.runtime.clone()),
        ("Version", format!("Fathomless {}", report.version)),
    ];
    let mut text = format!("<header>\n<h1>{}</h1>\n<dl>\n", escaped(title));
    for (name, value) in facts {
        let _ = writeln!(text, "<div><dt>{name}</dt><dd>{}</dd></div>", escaped(&value));
    }
    text + "</dl>\n</header>\n"
}

fn tiles(report: &Report) -> String {
    let median = |ms: Option<Quantiles>| ms.map_or("–".to_owned(), |ms| milliseconds(ms.p50));
    let worst =
        |ms: Option<Quantiles>| ms.map_or(String::new(), |ms| format!("worst {}", milliseconds(ms.worst)));
    let ratio = report.worst_over_median.map_or("–".to_owned(), |ratio| format!("{ratio:.2}"));
    let asked = if report.validated { "Vulkan and OpenXR" } else { "OpenXR only" };
    let of_cpu = report.worst_over_median_cpu.map_or(String::new(), |ratio| format!("{ratio:.2} on the CPU"));
    let tiles = [
        ("Frame, median", median(report.frame_ms), worst(report.frame_ms)),
        ("CPU, median", median(report.frame_cpu_ms), worst(report.frame_cpu_ms)),
        ("GPU, median", median(report.frame_gpu_ms), worst(report.frame_gpu_ms)),
        ("Worst over median", ratio, of_cpu),
        ("Validation messages", report.validation_messages.to_string(), asked.to_owned()),
    ];
    let mut text = String::from("<section class=\"tiles\">\n");
    for (name, value, note) in tiles {
        let _ = writeln!(
            text,
            "<div class=\"tile\"><span>{name}</span><strong>{}</strong><small>{}</small></div>",
            escaped(&value),
            escaped(&note)
        );
    }
    text + "</section>\n"
}

fn milliseconds(ms: f64) -> String {
    match ms {
        ms if ms >= 99.95 => format!("{ms:.0} ms"),
        ms if ms >= 9.995 => format!("{ms:.1} ms"),
        ms => format!("{ms:.2} ms"),
    }
}

/// Columns of the charts over frames, at most.
const COLUMNS: usize = 480;

/// For each column of a chart over frames, the row in which `cost` is greatest.
fn columns(rows: &[Row], cost: impl Fn(&Row) -> f64) -> Vec<&Row> {
    let count = rows.len().min(COLUMNS);
    let border = |i: usize| rows.len() * i / count;
    let worst = |i: usize| rows[border(i)..border(i + 1)].iter().max_by(|a, b| cost(a).total_cmp(&cost(b)));
    (0..count).filter_map(worst).collect()
}

/// Where runs begin, as columns, with what they are called.
fn runs(report: &Report, columns: usize) -> Vec<(usize, String)> {
    let rows = &report.rows;
    let begins = (0..rows.len()).filter(|&i| i == 0 || rows[i].frame <= rows[i - 1].frame);
    let begins: Vec<usize> = begins.collect();
    if begins.len() < 2 {
        return Vec::new();
    }
    let label = |at: &AtDepth| format!("depth {}", at.label);
    begins.into_iter().map(|i| i * columns / rows.len()).zip(report.per_depth.iter().map(label)).collect()
}

fn frames(report: &Report) -> String {
    let rows = &report.rows;
    let per_column = rows.len().div_ceil(COLUMNS);
    let note = match per_column {
        1 => "one column per frame".to_owned(),
        n => format!("each column shows the slowest of {n} frames"),
    };
    let mut text = section("Time over frames", &format!("Milliseconds, {note}."));
    let hint = |row: &Row, parts: &[(&str, f64)]| {
        let mut hint =
            format!("frame {}, depth {:.1}: {} in all", row.frame, row.depth, milliseconds(row.frame_ms));
        parts.iter().for_each(|(name, ms)| {
            let _ = write!(hint, "\n{name} {ms:.3} ms");
        });
        hint
    };

    let passes = pass_names(rows.iter());
    let worst = columns(rows, |row| row.frame_ms.max(row.passes.total_ms()));
    let parts = |row: &Row| passes.iter().map(|&name| (name, row.passes.of(name))).collect::<Vec<_>>();
    let chart = Layers {
        title: "GPU by pass, and the frame by the clock",
        unit: "ms",
        layers: passes
            .iter()
            .map(|&name| (name, worst.iter().map(|row| row.passes.of(name)).collect()))
            .collect(),
        line: Some(("frame, by the clock", worst.iter().map(|row| row.frame_ms).collect())),
        hints: worst.iter().map(|row| hint(row, &parts(row))).collect(),
        marks: runs(report, worst.len()),
        height: 250.0,
    };
    text += &chart.svg();

    let worst = columns(rows, |row| row.spans.cpu_ms());
    let parts = |row: &Row| -> Vec<_> {
        Span::without_window().map(|span| (span.name(), row.spans.of(span).cpu_ms)).collect()
    };
    let chart = Layers {
        title: "CPU by span, waits apart",
        unit: "ms",
        layers: Span::without_window()
            .map(|span| (span.name(), worst.iter().map(|row| row.spans.of(span).cpu_ms).collect()))
            .collect(),
        line: None,
        hints: worst.iter().map(|row| hint(row, &parts(row))).collect(),
        marks: runs(report, worst.len()),
        height: 250.0,
    };
    text += &chart.svg();
    text + "</section>\n"
}

fn spread(report: &Report) -> String {
    let mut text =
        section("How times are spread", "Frames by milliseconds, with the median and the 99th percentile.");
    let rows = &report.rows;
    let timed = || rows.iter().filter(|row| !row.passes.is_empty());
    let charts = [
        ("Frame, by the clock", report.frame_ms, rows.iter().map(|row| row.frame_ms).collect::<Vec<_>>()),
        ("CPU", report.frame_cpu_ms, rows.iter().map(|row| row.spans.cpu_ms()).collect()),
        ("GPU", report.frame_gpu_ms, timed().map(|row| row.passes.total_ms()).collect()),
    ];
    text += "<div class=\"thirds\">\n";
    for (i, (title, quantiles, values)) in charts.into_iter().enumerate() {
        if let Some(quantiles) = quantiles {
            let marks = [("p50", quantiles.p50), ("p99", quantiles.p99)];
            text += &Histogram { title, values, marks, colour: i }.svg();
        }
    }
    text + "</div>\n</section>\n"
}

/// A counter of a row, by name.
type Counter = (&'static str, fn(&Row) -> f64);

fn work(report: &Report) -> String {
    let mut text = section("Work", "Over frames, and the mean per frame over depth.");
    let counters: [Counter; 6] = [
        ("Tiles drawn", |row| row.work.tiles_drawn as f64),
        ("Tiles made", |row| row.work.tiles_made as f64),
        ("Tiles waiting", |row| row.work.tiles_waiting as f64),
        ("Texels baked", |row| row.work.texels_baked as f64),
        ("Bytes uploaded", |row| row.work.bytes_uploaded as f64),
        ("Depth in octaves", |row| row.depth),
    ];
    text += "<div class=\"halves\">\n";
    for (i, (title, counter)) in counters.into_iter().enumerate() {
        let values: Vec<f64> = columns(&report.rows, counter).into_iter().map(counter).collect();
        let lines = vec![Line { values, colour: i }];
        let last = i + 1 == counters.len();
        let marks = if last { runs(report, report.rows.len().min(COLUMNS)) } else { Vec::new() };
        text += &Lines { title, lines, marks, height: 130.0 }.svg();
    }
    text += "</div>\n<div class=\"quarters\">\n";
    type Mean = (&'static str, fn(&AtDepth) -> f64);
    let unit = |title: &str| if title.starts_with("Bytes") { bytes } else { short };
    let means: [Mean; 8] = [
        ("Nodes", |at| at.nodes),
        ("Tiles drawn", |at| at.tiles_drawn),
        ("Tiles made", |at| at.tiles_made),
        ("Triangles, each eye", |at| at.triangles),
        ("Draw calls", |at| at.draws),
        ("Texels baked", |at| at.texels_baked),
        ("Bytes uploaded", |at| at.bytes_uploaded),
        ("Heap allocations", |at| at.allocations),
    ];
    for (title, mean) in means {
        text += &bars(report, title, 0, |at| (mean(at), unit(title)(mean(at))));
    }
    text + "</div>\n</section>\n"
}

fn memory(report: &Report) -> String {
    let mut text = section("Memory over depth", "The median of the frames. Only the path grows with depth.");
    text += "<div class=\"quarters\">\n";
    type Bytes = (&'static str, fn(&AtDepth) -> u64);
    let all: [Bytes; 4] = [
        ("Resident", |at| at.rss_bytes),
        ("On the GPU", |at| at.gpu_bytes),
        ("Our heap", |at| at.heap_bytes),
        ("The path", |at| at.path_bytes),
    ];
    for (title, of) in all {
        text += &bars(report, title, 2, |at| (of(at) as f64, bytes(of(at) as f64)));
    }
    text + "</div>\n</section>\n"
}

fn bars(report: &Report, title: &str, colour: usize, value: impl Fn(&AtDepth) -> (f64, String)) -> String {
    let bar = |at: &AtDepth| {
        let (number, text) = value(at);
        (at.label.clone(), number, text)
    };
    Bars { title, bars: report.per_depth.iter().map(bar).collect(), colour }.svg()
}

fn tables(report: &Report) -> String {
    let mut text = section("Figures", "Milliseconds per frame.");
    let heads = ["depth", "frames", "", "p50", "p99", "p99.9", "worst", "mean", "worst / p50"];
    let mut rows = Vec::new();
    for at in &report.per_depth {
        let all = [("frame", Some(at.frame_ms)), ("CPU", Some(at.frame_cpu_ms)), ("GPU", at.frame_gpu_ms)];
        for (i, (name, ms)) in all.into_iter().enumerate() {
            let Some(ms) = ms else { continue };
            let head =
                if i == 0 { [at.label.clone(), at.frames.to_string()] } else { <[String; 2]>::default() };
            let numbers = [ms.p50, ms.p99, ms.p999, ms.worst, ms.mean].map(|ms| format!("{ms:.3}"));
            let ratio = ms.worst_over_median().map_or(String::new(), |ratio| format!("{ratio:.2}"));
            rows.push(head.into_iter().chain([name.to_owned()]).chain(numbers).chain([ratio]).collect());
        }
    }
    text += &table(&heads, &rows);
    text += &named(report, "CPU, median by span", |at| &at.spans);
    text += &named(report, "GPU, median by pass", |at| &at.passes);
    text + "</section>\n"
}

fn named(report: &Report, title: &str, list: impl Fn(&AtDepth) -> &[Named]) -> String {
    let mut names: Vec<&str> = Vec::new();
    for named in report.per_depth.iter().flat_map(&list) {
        if !names.contains(&named.name) {
            names.push(named.name);
        }
    }
    if names.is_empty() {
        return String::new();
    }
    let row = |at: &AtDepth| {
        let of = |name: &&str| list(at).iter().find(|named| named.name == *name);
        let cells = names.iter().map(|name| of(name).map_or(String::new(), |n| format!("{:.3}", n.ms.p50)));
        [at.label.clone()].into_iter().chain(cells).collect()
    };
    let rows: Vec<Vec<String>> = report.per_depth.iter().map(row).collect();
    let heads: Vec<&str> = ["depth"].into_iter().chain(names.iter().copied()).collect();
    format!("<h3>{title}</h3>\n{}", table(&heads, &rows))
}

fn table(heads: &[&str], rows: &[Vec<String>]) -> String {
    let mut text = String::from("<div class=\"table\"><table>\n<thead><tr>");
    for head in heads {
        let _ = write!(text, "<th>{}</th>", escaped(head));
    }
    text += "</tr></thead>\n<tbody>\n";
    for row in rows {
        text += "<tr>";
        for cell in row {
            let _ = write!(text, "<td>{}</td>", escaped(cell));
        }
        text += "</tr>\n";
    }
    text + "</tbody>\n</table></div>\n"
}

fn section(title: &str, note: &str) -> String {
    format!("<section>\n<h2>{title}</h2>\n<p>{}</p>\n", escaped(note))
}
