//! The figures of a bench: per frame they come in, per depth they go out, as numbers and as a table.

use std::fmt::Write;
use std::ops::Range;

use serde::Serialize;

use super::Subject;
use crate::cli::Depths;
use crate::telemetry::{Row, Span, Work, quantile};
use crate::viewer::Viewer;

/// What a flight came to.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Of Fathomless.
    pub version: &'static str,
    /// The computer.
    pub machine: Machine,
    /// The graphics device's name.
    pub device: String,
    /// Its driver's name.
    pub driver: String,
    /// The driver's version in its own words.
    pub driver_version: String,
    /// The device is the processor itself.
    pub software: bool,
    /// The OpenXR runtime's name and version.
    pub runtime: String,
    /// The world's name.
    pub world: String,
    /// The world's seed.
    pub seed: u64,
    /// The flight's name.
    pub flight: String,
    /// Octaves from the flight's upper end to its lower.
    pub deepest: f64,
    /// Pixels of each eye, width and height.
    pub size: [u32; 2],
    /// Both eyes were drawn in one pass.
    pub multiview: bool,
    /// Every frame was complete, whatever it took; else a frame makes as many tiles as its budget lets it.
    pub complete: bool,
    /// Frames flown.
    pub frames: usize,
    /// It was stopped before the last frame.
    pub stopped: bool,
    /// From the first frame to the last, warming up apart.
    pub seconds: f64,
    /// Messages of the validation layer, and violations that the built-in runtime found.
    pub validation_messages: usize,
    /// The validation layer was on.
    pub validated: bool,
    /// Worst frame over median frame, by the clock, the whole frame.
    pub worst_over_median: Option<f64>,
    /// The same of the CPU time.
    pub worst_over_median_cpu: Option<f64>,
    /// The same of the GPU time.
    pub worst_over_median_gpu: Option<f64>,
    /// Work of the busiest frame over that of the median frame, where that is not 0.
    pub most_over_median: WorkRatios,
    /// Milliseconds from frame to frame.
    pub frame_ms: Option<Quantiles>,
    /// Milliseconds of this program on the CPU.
    pub frame_cpu_ms: Option<Quantiles>,
    /// Milliseconds of all passes on the GPU; none where the device has no clock.
    pub frame_gpu_ms: Option<Quantiles>,
    /// The same by depth, the least first.
    pub per_depth: Vec<AtDepth>,
    /// Each frame.
    #[serde(skip)]
    pub rows: Vec<Row>,
}

/// The computer.
#[derive(Clone, Debug, Serialize)]
pub struct Machine {
    /// The system's name.
    pub os: String,
    /// The processor's name.
    pub cpu: String,
    /// Processors that this program may use.
    pub cores: usize,
    /// Memory; 0 where the system does not tell.
    pub memory_bytes: u64,
}

/// Counters of the busiest frame over those of the median one.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct WorkRatios {
    /// Of [`Work::tiles_drawn`].
    pub tiles_drawn: Option<f64>,
    /// Of [`Work::tiles_made`].
    pub tiles_made: Option<f64>,
    /// Of [`Work::texels_baked`].
    pub texels_baked: Option<f64>,
    /// Of [`Work::draws`].
    pub draws: Option<f64>,
}

/// How numbers are spread: values that occur, by nearest rank.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quantiles {
    /// The median.
    pub p50: f64,
    /// 99 of 100 are no greater.
    pub p99: f64,
    /// 999 of 1000 are no greater.
    pub p999: f64,
    /// The greatest.
    pub worst: f64,
    /// The arithmetic mean.
    pub mean: f64,
}

/// The quantiles of something that has a name.
#[derive(Clone, Debug, Serialize)]
pub struct Named {
    /// The name.
    pub name: &'static str,
    /// Milliseconds.
    #[serde(flatten)]
    pub ms: Quantiles,
}

/// The frames of one depth, or of one decade of depths. Counters are means per frame, bytes of memory are medians.
#[derive(Clone, Debug, Serialize)]
pub struct AtDepth {
    /// Octaves below the start: as asked for, or where the decade begins.
    pub depth: u64,
    /// The same for people: `1000`, or `100–999`.
    pub label: String,
    /// Frames.
    pub frames: usize,
    /// Worst frame over median frame, by the clock.
    pub worst_over_median: Option<f64>,
    /// Milliseconds from frame to frame.
    pub frame_ms: Quantiles,
    /// Milliseconds of this program on the CPU.
    pub frame_cpu_ms: Quantiles,
    /// Milliseconds of all passes on the GPU; none where the device has no clock.
    pub frame_gpu_ms: Option<Quantiles>,
    /// CPU time by span.
    pub spans: Vec<Named>,
    /// GPU time by pass.
    pub passes: Vec<Named>,
    /// Nodes of the quadtree looked at.
    pub nodes: f64,
    /// Tiles drawn.
    pub tiles_drawn: f64,
    /// Tiles made.
    pub tiles_made: f64,
    /// Tiles missing, with coarser ones in their place.
    pub tiles_waiting: f64,
    /// Triangles, for each eye.
    pub triangles: f64,
    /// Draw calls.
    pub draws: f64,
    /// Texels drawn into the backdrop.
    pub texels_baked: f64,
    /// Frames that did so.
    pub frames_baking: usize,
    /// Bytes written for the GPU to read.
    pub bytes_uploaded: f64,
    /// Heap allocations, the OpenXR calls' apart; 0 where nobody counts.
    pub allocations: f64,
    /// The most of them in a frame.
    pub allocations_worst: u32,
    /// The process's resident set.
    pub rss_bytes: u64,
    /// Allocated on the GPU.
    pub gpu_bytes: u64,
    /// On the heap; 0 where nobody counts.
    pub heap_bytes: u64,
    /// The path.
    pub path_bytes: u64,
}

impl Quantiles {
    /// None of no numbers.
    pub fn of(values: impl Iterator<Item = f64>) -> Option<Quantiles> {
        let mut sorted: Vec<f64> = values.collect();
        sorted.sort_by(f64::total_cmp);
        let mean = sorted.iter().sum::<f64>() / sorted.len() as f64;
        Some(Quantiles {
            p50: tidy(quantile(&sorted, 0.5)?),
            p99: tidy(quantile(&sorted, 0.99)?),
            p999: tidy(quantile(&sorted, 0.999)?),
            worst: tidy(*sorted.last()?),
            mean: tidy(mean),
        })
    }

    /// None where the median is 0.
    pub fn worst_over_median(&self) -> Option<f64> {
        (self.p50 > 0.0).then(|| tidy(self.worst / self.p50))
    }
}

/// To four decimals: a tenth of a microsecond.
fn tidy(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

fn frame_ms<'a>(rows: impl Iterator<Item = &'a Row>) -> Option<Quantiles> {
    Quantiles::of(rows.map(|row| row.frame_ms))
}

fn cpu_ms<'a>(rows: impl Iterator<Item = &'a Row>) -> Option<Quantiles> {
    Quantiles::of(rows.map(|row| row.spans.cpu_ms()))
}

fn gpu_ms<'a>(rows: impl Iterator<Item = &'a Row>) -> Option<Quantiles> {
    Quantiles::of(rows.filter(|row| !row.passes.is_empty()).map(|row| row.passes.total_ms()))
}

impl Report {
    /// The report of the rows, which are in the order of the runs: depth, and which rows.
    pub(super) fn new(
        subject: &Subject<'_>,
        viewer: &Viewer,
        rows: Vec<Row>,
        runs: &[(u32, Range<usize>)],
    ) -> Report {
        let (gpu, session) = (&viewer.gpu().info, viewer.session_info());
        let runtime = viewer.runtime().info();
        let ratio = |counter: fn(&Work) -> u64| {
            Quantiles::of(rows.iter().map(|row| counter(&row.work) as f64))?.worst_over_median()
        };
        let per_depth = match &subject.depths {
            Depths::Once(_) => by_decade(&rows),
            Depths::Each(_) => {
                let at = |(depth, run): &(u32, Range<usize>)| {
                    AtDepth::new(u64::from(*depth), depth.to_string(), rows[run.clone()].iter().collect())
                };
                runs.iter().filter_map(at).collect()
            }
        };
        let worst = |quantiles: Option<Quantiles>| quantiles.and_then(|q| q.worst_over_median());
        let [frame_ms, frame_cpu_ms, frame_gpu_ms] =
            [frame_ms(rows.iter()), cpu_ms(rows.iter()), gpu_ms(rows.iter())];
        Report {
            version: env!("CARGO_PKG_VERSION"),
            machine: Machine::this(),
            device: gpu.name.clone(),
            driver: gpu.driver.clone(),
            driver_version: gpu.driver_version.clone(),
            software: gpu.software,
            runtime: format!("{} {}", runtime.name, runtime.version),
            world: subject.world.name.clone(),
            seed: subject.world.surface.seed,
            flight: subject.flight.name.clone(),
            deepest: subject.flight.deepest(),
            size: [session.extent.width, session.extent.height],
            multiview: session.multiview,
            complete: subject.viewer.complete,
            frames: rows.len(),
            stopped: false,
            seconds: tidy(rows.iter().map(|row| row.frame_ms).sum::<f64>() / 1e3),
            validation_messages: 0,
            validated: subject.viewer.validate,
            worst_over_median: worst(frame_ms),
            worst_over_median_cpu: worst(frame_cpu_ms),
            worst_over_median_gpu: worst(frame_gpu_ms),
            most_over_median: WorkRatios {
                tiles_drawn: ratio(|work| work.tiles_drawn),
                tiles_made: ratio(|work| work.tiles_made),
                texels_baked: ratio(|work| work.texels_baked),
                draws: ratio(|work| work.draws),
            },
            frame_ms,
            frame_cpu_ms,
            frame_gpu_ms,
            per_depth,
            rows,
        }
    }

    /// A line per frame, as CSV: milliseconds, counts, bytes, shares.
    pub fn lines(&self) -> String {
        let mut out = String::from(Row::CSV_HEAD);
        self.rows.iter().for_each(|row| row.write_csv(&mut out));
        out
    }

    /// The figures for a terminal.
    pub fn table(&self) -> String {
        let [width, height] = self.size;
        let mut text = format!(
            "{} over {}, {} frames in {:.1} s at {width}x{height} per eye\n{} ({}), {}\n\n",
            self.flight,
            self.world,
            self.frames,
            self.seconds,
            self.device,
            self.driver_version,
            self.runtime
        );
        let mut table = Table::new(&["depth", "frames", "ms", "p50", "p99", "p99.9", "worst", "worst/p50"]);
        for at in &self.per_depth {
            let all =
                [("frame", Some(at.frame_ms)), ("cpu", Some(at.frame_cpu_ms)), ("gpu", at.frame_gpu_ms)];
            for (i, (name, ms)) in all.into_iter().enumerate() {
                let Some(ms) = ms else { continue };
                let head =
                    if i == 0 { [at.label.clone(), at.frames.to_string()] } else { <[String; 2]>::default() };
                let numbers = [ms.p50, ms.p99, ms.p999, ms.worst].map(|ms| format!("{ms:.3}"));
                let ratio = ms.worst_over_median().map_or(String::new(), |ratio| format!("{ratio:.2}"));
                table.row(head.into_iter().chain([name.to_owned()]).chain(numbers).chain([ratio]));
            }
        }
        text += &table.text();
        text += "\nCPU ms per frame by span (median)\n";
        text += &self.named(|at| &at.spans);
        text += "\nGPU ms per frame by pass (median)\n";
        text += &self.named(|at| &at.passes);
        text += "\nWork per frame (mean)\n";
        let mut table = Table::new(&[
            "depth",
            "nodes",
            "drawn",
            "made",
            "waiting",
            "triangles",
            "draws",
            "baked texels",
            "upload",
            "allocations",
        ]);
        for at in &self.per_depth {
            let counts = [at.nodes, at.tiles_drawn, at.tiles_made, at.tiles_waiting, at.triangles, at.draws];
            let counts = counts.map(short);
            let rest = [short(at.texels_baked), bytes(at.bytes_uploaded), short(at.allocations)];
            table.row([at.label.clone()].into_iter().chain(counts).chain(rest));
        }
        text += &table.text();
        text += "\nMemory\n";
        let mut table = Table::new(&["depth", "resident", "GPU", "heap", "path"]);
        for at in &self.per_depth {
            let all = [at.rss_bytes, at.gpu_bytes, at.heap_bytes, at.path_bytes].map(|n| bytes(n as f64));
            table.row([at.label.clone()].into_iter().chain(all));
        }
        text += &table.text();
        let ratio = |ratio: Option<f64>| ratio.map_or("-".to_owned(), |ratio| format!("{ratio:.2}"));
        let _ = writeln!(
            text,
            "\nWorst over median: frame {}, CPU {}, GPU {}; most over median: tiles drawn {}, tiles made {}, \
             texels baked {}, draws {}\n{} validation messages{}",
            ratio(self.worst_over_median),
            ratio(self.worst_over_median_cpu),
            ratio(self.worst_over_median_gpu),
            ratio(self.most_over_median.tiles_drawn),
            ratio(self.most_over_median.tiles_made),
            ratio(self.most_over_median.texels_baked),
            ratio(self.most_over_median.draws),
            self.validation_messages,
            if self.validated { "" } else { " (of the runtime; --validate asks Vulkan too)" },
        );
        text
    }

    /// The medians of what has names, a row per depth.
    fn named(&self, list: impl Fn(&AtDepth) -> &[Named]) -> String {
        let mut names: Vec<&str> = Vec::new();
        for named in self.per_depth.iter().flat_map(&list) {
            if !names.contains(&named.name) {
                names.push(named.name);
            }
        }
        let heads: Vec<&str> = ["depth"].into_iter().chain(names.iter().copied()).collect();
        let mut table = Table::new(&heads);
        for at in &self.per_depth {
            let of = |name: &&str| list(at).iter().find(|named| named.name == *name);
            let cells =
                names.iter().map(|name| of(name).map_or(String::new(), |n| format!("{:.3}", n.ms.p50)));
            table.row([at.label.clone()].into_iter().chain(cells));
        }
        table.text()
    }
}

/// The rows by decades of their depth: 0–9, 10–99, and so on.
fn by_decade(rows: &[Row]) -> Vec<AtDepth> {
    let decade = |row: &Row| (row.depth.max(1.0) as u64).ilog10();
    let last = rows.iter().map(decade).max().unwrap_or(0);
    let at = |exponent: u32| {
        let (least, most) =
            (if exponent == 0 { 0 } else { 10u64.pow(exponent) }, 10u64.pow(exponent + 1) - 1);
        let rows = rows.iter().filter(|row| decade(row) == exponent).collect();
        AtDepth::new(least, format!("{least}–{most}"), rows)
    };
    (0..=last).filter_map(at).collect()
}

impl AtDepth {
    /// None of no rows.
    fn new(depth: u64, label: String, rows: Vec<&Row>) -> Option<AtDepth> {
        let of = || rows.iter().copied();
        let mean = |counter: fn(&Work) -> u64| {
            tidy(of().map(|row| counter(&row.work) as f64).sum::<f64>() / rows.len() as f64)
        };
        let typical = |bytes: fn(&Row) -> u64| {
            let mut all: Vec<u64> = of().map(bytes).collect();
            all.sort_unstable();
            all.get(all.len() / 2).copied().unwrap_or(0)
        };
        let frame_ms = frame_ms(of())?;
        let spans = Span::without_window().filter_map(|span| {
            let ms = Quantiles::of(of().map(|row| row.spans.of(span).cpu_ms))?;
            Some(Named { name: span.name(), ms })
        });
        let timed = || of().filter(|row| !row.passes.is_empty());
        let passes = pass_names(of()).into_iter().filter_map(|name| {
            let ms = Quantiles::of(timed().map(|row| row.passes.of(name)))?;
            Some(Named { name, ms })
        });
        let allocations = || of().map(|row| row.spans.allocations());
        Some(AtDepth {
            depth,
            label,
            frames: rows.len(),
            worst_over_median: frame_ms.worst_over_median(),
            frame_ms,
            frame_cpu_ms: cpu_ms(of())?,
            frame_gpu_ms: gpu_ms(of()),
            spans: spans.collect(),
            passes: passes.collect(),
            nodes: mean(|work| work.nodes),
            tiles_drawn: mean(|work| work.tiles_drawn),
            tiles_made: mean(|work| work.tiles_made),
            tiles_waiting: mean(|work| work.tiles_waiting),
            triangles: mean(|work| work.triangles),
            draws: mean(|work| work.draws),
            texels_baked: mean(|work| work.texels_baked),
            frames_baking: of().filter(|row| row.work.texels_baked > 0).count(),
            bytes_uploaded: mean(|work| work.bytes_uploaded),
            allocations: tidy(allocations().map(f64::from).sum::<f64>() / rows.len() as f64),
            allocations_worst: allocations().max().unwrap_or(0),
            rss_bytes: typical(|row| row.memory.rss_bytes),
            gpu_bytes: typical(|row| row.memory.gpu_bytes),
            heap_bytes: typical(|row| row.memory.heap_bytes),
            path_bytes: typical(|row| row.memory.path_bytes),
        })
    }
}

/// The names of the GPU passes, in the order in which they came up.
pub(super) fn pass_names<'a>(rows: impl Iterator<Item = &'a Row>) -> Vec<&'static str> {
    let mut names = Vec::new();
    for row in rows {
        for (name, _) in row.passes.iter() {
            if !names.contains(&name) {
                names.push(name);
            }
        }
    }
    names
}

impl Machine {
    /// The one that this runs on.
    fn this() -> Machine {
        let line = |file: &str, key: &str| {
            let text = std::fs::read_to_string(file).ok()?;
            let value = text.lines().find(|line| line.starts_with(key))?.split_once(':')?.1.trim().to_owned();
            Some(value)
        };
        let kib = line("/proc/meminfo", "MemTotal").and_then(|text| text.split(' ').next()?.parse().ok());
        Machine {
            os: operating_system(),
            cpu: line("/proc/cpuinfo", "model name").unwrap_or_else(|| std::env::consts::ARCH.to_owned()),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            memory_bytes: kib.unwrap_or(0u64) * 1024,
        }
    }
}

#[cfg(unix)]
fn operating_system() -> String {
    let name = rustix::system::uname();
    format!("{} {}", name.sysname().to_string_lossy(), name.release().to_string_lossy())
}

#[cfg(not(unix))]
fn operating_system() -> String {
    std::env::consts::OS.to_owned()
}

/// A number in four figures or fewer: 0, 3.25, 412, 1.21 M.
pub(super) fn short(value: f64) -> String {
    match value {
        v if v >= 9_999.5e3 => format!("{:.1} M", v / 1e6),
        v if v >= 999_500.0 => format!("{:.2} M", v / 1e6),
        v if v >= 99_950.0 => format!("{:.0} k", v / 1e3),
        v if v >= 9_999.5 => format!("{:.1} k", v / 1e3),
        v if v >= 99.95 => format!("{v:.0}"),
        v if v == v.trunc() => format!("{v:.0}"),
        v if v >= 9.995 => format!("{v:.1}"),
        v => format!("{v:.2}"),
    }
}

/// A number of bytes: 812 B, 64.0 KiB, 1.25 GiB.
pub(super) fn bytes(value: f64) -> String {
    let units = ["B", "KiB", "MiB", "GiB", "TiB"];
    let mut power = 0;
    let mut scaled = value;
    while scaled >= 1023.95 && power + 1 < units.len() {
        scaled /= 1024.0;
        power += 1;
    }
    let unit = units[power];
    match scaled {
        v if power == 0 => format!("{v:.0} {unit}"),
        v if v < 9.995 => format!("{v:.2} {unit}"),
        v => format!("{v:.1} {unit}"),
    }
}

/// Cells in columns, the first aligned to the left, the others to the right.
struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    fn new(heads: &[&str]) -> Table {
        Table { rows: vec![heads.iter().map(|head| (*head).to_owned()).collect()] }
    }

    fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }

    fn text(&self) -> String {
        let width =
            |column: usize| self.rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let mut text = String::new();
        for row in &self.rows {
            let mut line = String::new();
            for (column, cell) in row.iter().enumerate() {
                let width = width(column);
                let _ = match column {
                    0 => write!(line, "{cell:width$}"),
                    _ => write!(line, "  {cell:>width$}"),
                };
            }
            text += line.trim_end();
            text.push('\n');
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let cases = [
            (0.0, "0"),
            (0.04, "0.04"),
            (9.99, "9.99"),
            (12.34, "12.3"),
            (312.6, "313"),
            (5_000.0, "5000"),
            (12_345.0, "12.3 k"),
            (123_456.0, "123 k"),
            (1_234_567.0, "1.23 M"),
            (45_600_000.0, "45.6 M"),
        ];
        for (value, text) in cases {
            assert_eq!(short(value), text);
        }
        assert_eq!([0.0, 1023.0, 65_536.0, 1.5e9].map(bytes), ["0 B", "1023 B", "64.0 KiB", "1.40 GiB"]);
    }

    #[test]
    fn depths_fall_into_decades() {
        let rows: Vec<Row> = [0.0, 0.9, 9.99, 10.0, 99.9, 100.0, 123_456.7]
            .map(|depth| Row { depth, frame_ms: 1.0, ..Row::default() })
            .to_vec();
        let decades = by_decade(&rows);
        let found: Vec<(u64, &str, usize)> =
            decades.iter().map(|at| (at.depth, at.label.as_str(), at.frames)).collect();
        let expected = [(0, "0–9", 3), (10, "10–99", 2), (100, "100–999", 1), (100_000, "100000–999999", 1)];
        assert_eq!(found, expected);
    }
}
