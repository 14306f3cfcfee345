//! What a frame costs: spans of CPU time, GPU passes, work done, memory; recorded without touching the heap.

mod histogram;
pub mod logbook;
pub mod trace;

use std::fmt::Write as _;
use std::ops::AddAssign;
use std::time::Duration;

use crate::heap;

pub use histogram::Histogram;
pub use logbook::Logbook;

/// A part of a frame's work on the CPU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Span {
    /// Finding the place and its path.
    #[default]
    Place,
    /// Waiting until the runtime wants a frame.
    Wait,
    /// The other OpenXR calls.
    Xr,
    /// Beginning a frame on the GPU: waits for the one before the last.
    Begin,
    /// Choosing tiles.
    Select,
    /// Choosing what to bake; recording it where a frame bakes all.
    Bake,
    /// Writing records and recording commands.
    Record,
    /// Handing the commands over.
    Submit,
    /// Showing it in the window.
    Mirror,
}

impl Span {
    /// All of them, in the order of their work.
    pub const ALL: [Span; 9] = [
        Span::Place,
        Span::Wait,
        Span::Xr,
        Span::Begin,
        Span::Select,
        Span::Bake,
        Span::Record,
        Span::Submit,
        Span::Mirror,
    ];

    /// Those of a flight that no window shows.
    pub fn without_window() -> impl Iterator<Item = Span> {
        Span::ALL.into_iter().filter(|span| *span != Span::Mirror)
    }

    /// A word or two for tables.
    pub fn name(self) -> &'static str {
        match self {
            Span::Place => "place",
            Span::Wait => "wait",
            Span::Xr => "xr calls",
            Span::Begin => "begin",
            Span::Select => "select",
            Span::Bake => "bake",
            Span::Record => "record",
            Span::Submit => "submit",
            Span::Mirror => "mirror",
        }
    }
}

/// What a span cost.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// Milliseconds of this thread's time on a processor; waits cost none. Where the system does not tell, the clock's.
    pub cpu_ms: f64,
    /// Milliseconds by the clock.
    pub wall_ms: f64,
    /// Heap allocations of this thread.
    pub allocations: u32,
}

impl AddAssign for Cost {
    fn add_assign(&mut self, other: Cost) {
        self.cpu_ms += other.cpu_ms;
        self.wall_ms += other.wall_ms;
        self.allocations += other.allocations;
    }
}

/// The cost of each span, in the order of [`Span::ALL`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spans([Cost; Span::ALL.len()]);

impl Spans {
    /// What one span cost.
    pub fn of(&self, span: Span) -> Cost {
        self.0[span as usize]
    }

    /// Adds to what a span cost.
    pub fn add(&mut self, span: Span, cost: Cost) {
        self.0[span as usize] += cost;
    }

    /// CPU time of all spans.
    pub fn cpu_ms(&self) -> f64 {
        self.0.iter().map(|cost| cost.cpu_ms).sum()
    }

    /// Heap allocations of all spans but the OpenXR calls', whose runtime may be in this very process.
    pub fn allocations(&self) -> u32 {
        let ours = |span: &&Span| !matches!(span, Span::Wait | Span::Xr);
        Span::ALL.iter().filter(ours).map(|&span| self.of(span).allocations).sum()
    }
}

/// A span of one frame, and when it was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lap {
    /// What was done.
    pub span: Span,
    /// From when, as [`now_ns`] counts.
    pub begin_ns: u64,
    /// Until when.
    pub end_ns: u64,
}

/// Laps of a frame that are kept; more count in its [`Spans`] only. A frame has about fifteen.
pub const MAX_LAPS: usize = 24;

/// The laps of a frame, in their order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Laps {
    laps: [Lap; MAX_LAPS],
    count: usize,
}

impl Laps {
    /// Adds one at the end.
    pub fn push(&mut self, lap: Lap) {
        if let Some(room) = self.laps.get_mut(self.count) {
            *room = lap;
            self.count += 1;
        }
    }

    /// Those kept.
    pub fn as_slice(&self) -> &[Lap] {
        &self.laps[..self.count]
    }
}

/// Tells one span from the next: every lap ends where the next begins.
#[derive(Debug)]
pub struct Stopwatch {
    spans: Spans,
    laps: Laps,
    cpu: Duration,
    wall_ns: u64,
    allocations: u64,
}

impl Stopwatch {
    /// The first lap begins now.
    pub fn start() -> Stopwatch {
        Stopwatch {
            spans: Spans::default(),
            laps: Laps::default(),
            cpu: thread_time(),
            wall_ns: now_ns(),
            allocations: heap::allocations(),
        }
    }

    /// What was done since the last lap belongs to `span`.
    pub fn lap(&mut self, span: Span) {
        let (cpu, begin_ns, allocations) = (self.cpu, self.wall_ns, self.allocations);
        self.skip();
        let cost = Cost {
            cpu_ms: milliseconds(self.cpu.saturating_sub(cpu)),
            wall_ms: (self.wall_ns - begin_ns) as f64 * 1e-6,
            allocations: (self.allocations - allocations) as u32,
        };
        self.spans.add(span, cost);
        self.laps.push(Lap { span, begin_ns, end_ns: self.wall_ns });
    }

    /// What was done since the last lap is nobody's here: another stopwatch has it.
    pub fn skip(&mut self) {
        (self.cpu, self.wall_ns, self.allocations) = (thread_time(), now_ns(), heap::allocations());
    }

    /// The laps so far.
    pub fn laps(&self) -> Laps {
        self.laps
    }

    /// The spans so far.
    pub fn spans(&self) -> Spans {
        self.spans
    }
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// Nanoseconds of a clock that only goes on; its zero means nothing. It is the one that a GPU's clock can be compared to.
#[cfg(unix)]
pub fn now_ns() -> u64 {
    use rustix::time::{ClockId, clock_gettime};
    let time = clock_gettime(ClockId::Monotonic);
    time.tv_sec.max(0) as u64 * 1_000_000_000 + time.tv_nsec.clamp(0, 999_999_999) as u64
}

/// Nanoseconds of a clock that only goes on; its zero means nothing.
#[cfg(not(unix))]
pub fn now_ns() -> u64 {
    static START: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
    START.get_or_init(std::time::Instant::now).elapsed().as_nanos() as u64
}

/// Time that this thread has spent on a processor.
#[cfg(unix)]
fn thread_time() -> Duration {
    use rustix::time::{ClockId, clock_gettime};
    let time = clock_gettime(ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec.max(0) as u64, time.tv_nsec.clamp(0, 999_999_999) as u32)
}

/// Without such a clock, the ordinary one.
#[cfg(not(unix))]
fn thread_time() -> Duration {
    Duration::from_nanos(now_ns())
}

/// GPU passes kept apart; the time of any more is added to the last.
pub const MAX_PASSES: usize = 12;

/// GPU time of the passes of one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Passes {
    names: [&'static str; MAX_PASSES],
    ms: [f64; MAX_PASSES],
    count: usize,
}

impl Passes {
    /// Adds to a pass; a name used twice is one pass.
    pub fn add(&mut self, name: &'static str, ms: f64) {
        let known = self.names[..self.count].iter().position(|&n| n == name);
        let index = known.unwrap_or_else(|| self.count.min(MAX_PASSES - 1));
        if index == self.count {
            self.names[index] = name;
            self.count += 1;
        }
        self.ms[index] += ms;
    }

    /// Name and milliseconds, in the order of the work.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, f64)> {
        self.names.into_iter().zip(self.ms).take(self.count)
    }

    /// Milliseconds of one pass, 0 if there is none of that name.
    pub fn of(&self, name: &str) -> f64 {
        self.iter().find(|pass| pass.0 == name).map_or(0.0, |pass| pass.1)
    }

    /// Milliseconds of all.
    pub fn total_ms(&self) -> f64 {
        self.ms.iter().sum()
    }

    /// Nothing was measured.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }
}

/// How the times of GPU passes were put on the processor's time line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GpuClock {
    /// The GPU begins a frame when it is handed over or has done the one before: no more is known.
    #[default]
    Submission,
    /// Both clocks were read at once.
    Calibrated,
}

/// A pass, and when the GPU was at it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GpuPass {
    /// Its name.
    pub name: &'static str,
    /// From when, as [`now_ns`] counts.
    pub begin_ns: u64,
    /// Until when.
    pub end_ns: u64,
}

/// Passes of a frame that [`GpuTimes`] keeps; a frame has ten at most.
const MAX_GPU_PASSES: usize = 16;

/// When the GPU was at which pass of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GpuTimes {
    /// How that is known.
    pub clock: GpuClock,
    passes: [GpuPass; MAX_GPU_PASSES],
    count: usize,
}

impl GpuTimes {
    /// None yet.
    pub fn new(clock: GpuClock) -> GpuTimes {
        GpuTimes { clock, ..GpuTimes::default() }
    }

    /// Adds a pass.
    pub fn push(&mut self, pass: GpuPass) {
        if let Some(room) = self.passes.get_mut(self.count) {
            *room = pass;
            self.count += 1;
        }
    }

    /// Those kept, in the order of the work.
    pub fn as_slice(&self) -> &[GpuPass] {
        &self.passes[..self.count]
    }
}

/// What a frame made and drew.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Nodes of the quadtree looked at.
    pub nodes: u64,
    /// Tiles drawn.
    pub tiles_drawn: u64,
    /// Tiles made.
    pub tiles_made: u64,
    /// Tiles missing, with coarser ones in their place.
    pub tiles_waiting: u64,
    /// Triangles of the tiles drawn, for each eye.
    pub triangles: u64,
    /// Draw calls.
    pub draws: u64,
    /// Texels drawn into the backdrop.
    pub texels_baked: u64,
    /// Bytes written for the GPU to read.
    pub bytes_uploaded: u64,
}

/// The last frame drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameStats {
    /// Counts the frames drawn, from 1.
    pub serial: u64,
    /// CPU time.
    pub spans: Spans,
    /// The same, one after the other.
    pub laps: Laps,
    /// What it made and drew.
    pub work: Work,
    /// How fast the viewer may go on, as a share of his speed.
    pub headroom: f64,
    /// The share of its parallax bound that the backdrop has used up.
    pub parallax: f64,
    /// The frame, drawn before this one, that `passes` are of; 0 where none has been measured.
    pub timed_serial: u64,
    /// GPU time of that frame.
    pub passes: Passes,
    /// The same, one after the other.
    pub gpu: GpuTimes,
}

impl FrameStats {
    /// Adds what another stopwatch has of the time before and after the frame.
    pub fn surround(&mut self, watch: &Stopwatch) {
        let inner = std::mem::take(&mut self.laps);
        let begins = inner.as_slice().first().map_or(u64::MAX, |lap| lap.begin_ns);
        let outer = watch.laps();
        let (before, after) =
            outer.as_slice().split_at(outer.as_slice().partition_point(|lap| lap.begin_ns < begins));
        [before, inner.as_slice(), after].into_iter().flatten().for_each(|lap| self.laps.push(*lap));
        Span::ALL.into_iter().for_each(|span| self.spans.add(span, watch.spans().of(span)));
    }
}

/// Memory at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Memory {
    /// What the system counts as this process's in memory; 0 where it does not tell.
    pub rss_bytes: u64,
    /// Allocated on the GPU by us.
    pub gpu_bytes: u64,
    /// On the heap by us; 0 where nobody counts.
    pub heap_bytes: u64,
    /// The path.
    pub path_bytes: u64,
}

/// One frame as it is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// Frame of the flight.
    pub frame: u64,
    /// Octaves below the start.
    pub depth: f64,
    /// Counts the frames drawn.
    pub serial: u64,
    /// Milliseconds since the frame before was done.
    pub frame_ms: f64,
    /// CPU time.
    pub spans: Spans,
    /// GPU time, once it is known.
    pub passes: Passes,
    /// What it made and drew.
    pub work: Work,
    /// How fast the viewer might go on, as a share of his speed.
    pub headroom: f64,
    /// The share of its parallax bound that the backdrop had used up.
    pub parallax: f64,
    /// At the frame's end.
    pub memory: Memory,
    /// Heap allocations of the thread that drew it, since the frame before was done.
    pub allocations: u64,
}

impl Row {
    /// The head of a CSV file of rows: milliseconds, counts, bytes, shares.
    pub const CSV_HEAD: &'static str = "frame,depth,frame_ms,cpu_ms,gpu_ms,nodes,tiles_drawn,tiles_made,tiles_waiting,draws,\
         texels_baked,bytes_uploaded,headroom,parallax,rss_bytes,gpu_bytes,allocations\n";

    /// The frame that these are of, at `depth`; the rest is up to the caller.
    pub fn of(stats: &FrameStats, depth: f64) -> Row {
        let &FrameStats { serial, spans, work, headroom, parallax, .. } = stats;
        Row { depth, serial, spans, work, headroom, parallax, ..Row::default() }
    }

    /// Adds the row's line of CSV.
    pub fn write_csv(&self, out: &mut String) {
        let Row {
            frame, depth, frame_ms, spans, passes, work, headroom, parallax, memory, allocations, ..
        } = self;
        let Work {
            nodes, tiles_drawn, tiles_made, tiles_waiting, draws, texels_baked, bytes_uploaded, ..
        } = work;
        let (cpu, gpu, rss, on_gpu) = (spans.cpu_ms(), passes.total_ms(), memory.rss_bytes, memory.gpu_bytes);
        // Writing to a string cannot fail.
        let _ = writeln!(
            out,
            "{frame},{depth:.5},{frame_ms:.4},{cpu:.4},{gpu:.4},{nodes},{tiles_drawn},{tiles_made},{tiles_waiting},\
             {draws},{texels_baked},{bytes_uploaded},{headroom:.4},{parallax:.4},{rss},{on_gpu},{allocations}"
        );
    }
}

/// Keeps a row per frame, in memory that it takes beforehand.
#[derive(Debug)]
pub struct Recorder {
    /// The rows so far.
    pub rows: Vec<Row>,
}

impl Recorder {
    /// Room for so many frames; more are not kept.
    pub fn new(frames: usize) -> Recorder {
        // Written to, so that the pages are there now and do not look like the frames' own later on.
        let blank = Row { serial: 1, ..Row::default() };
        let mut rows = vec![blank; frames];
        rows.clear();
        Recorder { rows }
    }

    /// Keeps a frame.
    pub fn push(&mut self, row: Row) {
        if self.rows.len() < self.rows.capacity() {
            self.rows.push(row);
        }
    }

    /// Puts the GPU's times, which come a few frames late, with their frame.
    pub fn time(&mut self, serial: u64, passes: &Passes) {
        if let Some(row) = self.rows.iter_mut().rev().take(8).find(|row| row.serial == serial) {
            row.passes = *passes;
        }
    }
}

/// The resident set of this process, read again and again without touching the heap.
#[derive(Debug)]
pub struct ResidentSet {
    #[cfg(target_os = "linux")]
    file: Option<std::fs::File>,
}

impl ResidentSet {
    /// Begins; systems that do not tell give 0 for ever.
    pub fn open() -> ResidentSet {
        ResidentSet {
            #[cfg(target_os = "linux")]
            file: std::fs::File::open("/proc/self/statm").ok(),
        }
    }

    /// Bytes.
    #[cfg(target_os = "linux")]
    pub fn bytes(&self) -> u64 {
        use std::os::unix::fs::FileExt;
        let mut text = [0; 128];
        let read = self.file.as_ref().and_then(|file| file.read_at(&mut text, 0).ok()).unwrap_or(0);
        let pages = std::str::from_utf8(&text[..read]).ok().and_then(|text| text.split(' ').nth(1));
        let pages: Option<u64> = pages.and_then(|pages| pages.parse().ok());
        pages.unwrap_or(0) * rustix::param::page_size() as u64
    }

    /// Bytes.
    #[cfg(not(target_os = "linux"))]
    pub fn bytes(&self) -> u64 {
        0
    }
}

/// The value below or at which a share `q` (0 to 1) of a sorted list lies: the smallest that will do, one of the list's
/// own (nearest rank). None of an empty list.
pub fn quantile(sorted: &[f64], q: f64) -> Option<f64> {
    let rank = (q * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.clamp(1, sorted.len().max(1)) - 1).copied()
}

/// The same of a list in any order, which is in another one afterwards.
pub fn quantile_of(values: &mut [f64], q: f64) -> Option<f64> {
    let rank = (q * values.len() as f64).ceil() as usize;
    let index = rank.clamp(1, values.len().max(1)) - 1;
    (index < values.len()).then(|| *values.select_nth_unstable_by(index, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_values_of_the_list() {
        let list: Vec<f64> = (1..=1000).map(f64::from).collect();
        let expected = [(0.0, 1.0), (0.5, 500.0), (0.99, 990.0), (0.999, 999.0), (1.0, 1000.0)];
        for (q, value) in expected {
            assert_eq!(quantile(&list, q), Some(value), "{q}");
            let mut backwards: Vec<f64> = list.iter().rev().copied().collect();
            assert_eq!(quantile_of(&mut backwards, q), Some(value), "{q}");
        }
        assert_eq!(quantile(&[7.0], 0.001), Some(7.0));
        assert_eq!(quantile(&[], 0.5), None);
    }

    #[test]
    fn laps_add_up_and_waiting_costs_no_cpu() {
        let mut watch = Stopwatch::start();
        std::thread::sleep(Duration::from_millis(30));
        watch.lap(Span::Wait);
        // Work costs time on a processor, however long it has to wait for one.
        while watch.spans().of(Span::Select).cpu_ms < 0.5 {
            for i in 0..10_000 {
                std::hint::black_box(i);
            }
            watch.lap(Span::Select);
        }
        watch.lap(Span::Wait);
        let spans = watch.spans();
        assert!(spans.of(Span::Wait).wall_ms >= 30.0 && spans.of(Span::Select).wall_ms >= 0.4);
        assert!(cfg!(not(unix)) || spans.of(Span::Wait).cpu_ms < 15.0, "{spans:?}");
        assert_eq!(spans.of(Span::Submit), Cost::default());
    }

    #[test]
    fn passes_of_one_name_are_one() {
        let mut passes = Passes::default();
        assert!(passes.is_empty());
        passes.add("tiles", 1.0);
        passes.add("bake", 2.0);
        passes.add("tiles", 4.0);
        assert_eq!(passes.iter().collect::<Vec<_>>(), [("tiles", 5.0), ("bake", 2.0)]);
        assert_eq!((passes.of("bake"), passes.of("sky"), passes.total_ms()), (2.0, 0.0, 7.0));
    }

    #[test]
    fn more_passes_than_are_kept_apart_lose_no_time() {
        let names = ["a", "b", "c", "d", "e", "f", "g", "h", "i", "j", "k", "l", "m", "n"];
        let mut passes = Passes::default();
        names.into_iter().for_each(|name| passes.add(name, 1.0));
        assert_eq!((passes.iter().count(), passes.total_ms()), (MAX_PASSES, 14.0));
    }

    #[test]
    fn gpu_times_find_their_frame() {
        let mut recorder = Recorder::new(3);
        for serial in 5..10 {
            recorder.push(Row { serial, ..Row::default() });
        }
        let mut passes = Passes::default();
        passes.add("tiles", 3.0);
        recorder.time(6, &passes);
        recorder.time(99, &passes);
        let totals: Vec<(u64, f64)> = recorder.rows.iter().map(|r| (r.serial, r.passes.total_ms())).collect();
        assert_eq!(totals, [(5, 0.0), (6, 3.0), (7, 0.0)]);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn the_resident_set_grows_with_what_is_used() {
        let resident = ResidentSet::open();
        let before = resident.bytes();
        let much = std::hint::black_box(vec![1u8; 64 << 20]);
        assert!(resident.bytes() > before + (48 << 20) && before > 1 << 20);
        drop(much);
    }
}
