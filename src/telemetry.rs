//! What a frame costs: spans of CPU time, GPU passes, work done, memory; recorded without touching the heap.

use std::ops::AddAssign;
use std::time::{Duration, Instant};

use crate::heap;

/// A part of a frame's work on the CPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Span {
    /// Finding the place and its path.
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
}

impl Span {
    /// All of them, in the order of their work.
    pub const ALL: [Span; 8] = [
        Span::Place,
        Span::Wait,
        Span::Xr,
        Span::Begin,
        Span::Select,
        Span::Bake,
        Span::Record,
        Span::Submit,
    ];

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

/// Tells one span from the next: every lap ends where the next begins.
#[derive(Debug)]
pub struct Stopwatch {
    spans: Spans,
    cpu: Duration,
    wall: Instant,
    allocations: u64,
}

impl Stopwatch {
    /// The first lap begins now.
    pub fn start() -> Stopwatch {
        Stopwatch {
            spans: Spans::default(),
            cpu: thread_time(),
            wall: Instant::now(),
            allocations: heap::allocations(),
        }
    }

    /// What was done since the last lap belongs to `span`.
    pub fn lap(&mut self, span: Span) {
        let (cpu, wall, allocations) = (thread_time(), Instant::now(), heap::allocations());
        let cost = Cost {
            cpu_ms: milliseconds(cpu.saturating_sub(self.cpu)),
            wall_ms: milliseconds(wall - self.wall),
            allocations: (allocations - self.allocations) as u32,
        };
        self.spans.add(span, cost);
        (self.cpu, self.wall, self.allocations) = (cpu, wall, allocations);
    }

    /// The spans so far.
    pub fn spans(&self) -> Spans {
        self.spans
    }
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
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
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    START.get_or_init(Instant::now).elapsed()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_values_of_the_list() {
        let list: Vec<f64> = (1..=1000).map(f64::from).collect();
        let expected = [(0.0, 1.0), (0.5, 500.0), (0.99, 990.0), (0.999, 999.0), (1.0, 1000.0)];
        for (q, value) in expected {
            assert_eq!(quantile(&list, q), Some(value), "{q}");
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
