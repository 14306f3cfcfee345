//! What a flight leaves behind: a trace that viewers of traces can read, whole or cut short, and a line of figures for each
//! frame; and a flight that nothing of this can end.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests stop at the first surprise")]

mod life;

use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

use fathomless::course::Course;
use fathomless::flight::Flight;
use fathomless::flying::{Flying, Headset};
use fathomless::mock::{Act, Cue, Mock, Script, When};
use fathomless::supervisor::{Absent, Supervisor};
use fathomless::telemetry::logbook::{Logbook, Wanted};
use fathomless::telemetry::trace::Trace;
use fathomless::telemetry::{FrameStats, GpuClock, GpuPass, GpuTimes, Lap, Row, Span};
use fathomless::viewer::ViewerConfig;
use fathomless::world::World;
use life::{assert_clean, headset, least, patience};
use serde_json::Value;

/// A folder of the test's own, empty.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("telemetry").join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// Flies until the wearer has had enough; frames drawn, and the logbook's count of them.
fn fly(wanted: &Wanted<'_>, frames: u64) -> (u64, u64) {
    let world = World::load("hills").unwrap();
    let flight = Flight::load("dive").unwrap();
    let cues = vec![Cue { when: When::Frame(frames), acts: vec![Act::Exit] }];
    let mock = Mock::with_script(Script { config: headset(), cues, ..Script::default() });
    let course = Course::new(world.surface, 3, 30.0, |_| ());
    let config = ViewerConfig { validate: true, ..least() };
    let mut flying = Flying::new(&world, &flight, course, config, Headset::Mock(mock.clone()));
    flying.logbook = Logbook::open(wanted);
    let stop = AtomicBool::new(false);
    let mut supervisor = Supervisor::new(patience(Absent::Fail), &stop);
    supervisor.fly(&mut flying).unwrap();
    flying.logbook.close();
    assert_eq!(flying.remarks().validation, 0, "{:?}", flying.remarks().first);
    let counted = flying.logbook.histogram.count();
    drop(flying);
    assert_clean(&mock, "a flight with a logbook");
    (supervisor.chronicle.drawn, counted)
}

/// A span of a trace, in nanoseconds.
#[derive(Clone, Debug)]
struct Slice {
    name: String,
    track: u64,
    from: u64,
    to: u64,
    frame: Option<u64>,
}

/// Microseconds as nanoseconds, to the digit.
fn ns(value: &Value) -> u64 {
    (value.as_f64().unwrap() * 1000.0).round() as u64
}

fn slices(events: &[Value]) -> Vec<Slice> {
    let spans = events.iter().filter(|event| event["ph"] == "X");
    spans
        .map(|event| Slice {
            name: event["name"].as_str().unwrap().to_owned(),
            track: event["tid"].as_u64().unwrap(),
            from: ns(&event["ts"]),
            to: ns(&event["ts"]) + ns(&event["dur"]),
            frame: event["args"]["frame"].as_u64(),
        })
        .collect()
}

/// The frames of a track, in order and apart, with the spans of each, all inside it.
fn frames(slices: &[Slice], track: u64) -> Vec<(Slice, Vec<Slice>)> {
    let mut frames: Vec<(Slice, Vec<Slice>)> = Vec::new();
    for slice in slices.iter().filter(|slice| slice.track == track) {
        match slice.frame {
            Some(_) => {
                if let Some((before, _)) = frames.last() {
                    assert!(before.to <= slice.from, "{before:?} overlaps {slice:?}");
                    assert!(before.frame < slice.frame, "{before:?} before {slice:?}");
                }
                frames.push((slice.clone(), Vec::new()));
            }
            None => {
                let (frame, inner) = frames.last_mut().unwrap();
                assert!(frame.from <= slice.from && slice.to <= frame.to, "{slice:?} outside {frame:?}");
                if let Some(before) = inner.last() {
                    assert!(before.to <= slice.from, "{before:?} overlaps {slice:?}");
                }
                inner.push(slice.clone());
            }
        }
    }
    frames
}

#[test]
fn a_trace_has_every_frame_and_what_is_in_it() {
    let folder = folder("flight");
    let (trace, lines) = (folder.join("new").join("trace.json"), folder.join("stats.csv"));
    let (drawn, counted) = fly(&Wanted { trace: Some(&trace), stats: Some(&lines) }, 60);
    assert!(drawn >= 50 && counted == drawn, "{drawn} frames drawn, {counted} counted");

    let text = std::fs::read_to_string(&trace).unwrap();
    let whole: Value = serde_json::from_str(&text).unwrap();
    let events = whole["traceEvents"].as_array().unwrap();
    assert_eq!(whole["otherData"]["frames_missing"], 0);
    let slices = slices(events);

    let cpu = frames(&slices, 1);
    assert_eq!(cpu.len() as u64, drawn);
    for (_, spans) in &cpu {
        let names: Vec<&str> = spans.iter().map(|span| span.name.as_str()).collect();
        for name in ["place", "wait", "select", "record", "submit"] {
            assert!(names.contains(&name), "no {name} in {names:?}");
        }
    }
    // Spans tell where a frame's time goes. Between two of them a machine may always do something else: so of the frame
    // in the middle, not of each.
    let mut told: Vec<(u64, u64)> = cpu
        .iter()
        .map(|(frame, spans)| {
            let inside: u64 = spans.iter().map(|span| span.to - span.from).sum();
            (inside * 1000 / (frame.to - frame.from).max(1), inside)
        })
        .collect();
    told.sort_unstable();
    let (permille, inside) = told[told.len() / 2];
    assert!(permille >= 900, "{permille} of 1000 parts, {inside} ns, are told of the frame in the middle");
    // The last frames' times have not come in; all others' have, each once.
    // What was baked at once before a frame is on the GPU's track, too, and not the frame's.
    let begun: BTreeMap<_, _> = cpu.iter().map(|(frame, _)| (frame.frame, frame)).collect();
    let mut gpu = frames(&slices, 2);
    gpu.retain(|(frame, _)| begun.contains_key(&frame.frame));
    assert!(
        gpu.len() as u64 + 3 >= drawn && gpu.len() as u64 <= drawn,
        "{} of {drawn} frames timed",
        gpu.len()
    );
    for (frame, passes) in &gpu {
        assert!(passes.iter().any(|pass| pass.name == "terrain"), "{passes:?}");
        let recorded = begun[&frame.frame];
        // The GPU begins when the frame was begun on the processor, or later: an hour off, and this would fail.
        assert!(
            frame.from >= recorded.from && frame.from <= recorded.to + 10_000_000_000,
            "{frame:?} of {recorded:?}"
        );
    }
    let named: Vec<&Value> = events.iter().filter(|event| event["name"] == "thread_name").collect();
    assert_eq!(named.len(), 2);
    assert!(
        whole["otherData"]["gpu_clock"] == "calibrated timestamps"
            || whole["otherData"]["gpu_clock"] == "submission"
    );

    let counters: Vec<&Value> = events.iter().filter(|event| event["ph"] == "C").collect();
    for name in ["tiles", "headroom", "texels baked"] {
        assert_eq!(counters.iter().filter(|event| event["name"] == name).count() as u64, drawn, "{name}");
    }
    let drawn_tiles = counters.iter().filter_map(|event| event["args"]["drawn"].as_u64());
    assert!(drawn_tiles.clone().count() as u64 == drawn && drawn_tiles.min() > Some(10));

    let rows = std::fs::read_to_string(&lines).unwrap();
    assert!(rows.starts_with(Row::CSV_HEAD));
    let rows: Vec<Vec<f64>> =
        rows.lines().skip(1).map(|row| row.split(',').map(|n| n.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len() as u64, drawn);
    assert!(rows.iter().enumerate().all(|(i, row)| row.len() == 17 && row[0] == i as f64));
    let timed = rows.iter().filter(|row| row[4] > 0.0).count() as u64;
    assert!(timed + 3 >= drawn, "{timed} of {drawn} rows have their GPU time");

    // A crash cuts it after any frame; whoever reads it adds the brackets.
    let ends: Vec<usize> = text.match_indices(",\n").map(|(at, _)| at).collect();
    for end in ends.iter().step_by(97).chain(ends.last()) {
        let cut: Value = serde_json::from_str(&format!("{}]}}", &text[..*end])).unwrap();
        assert!(!cut["traceEvents"].as_array().unwrap().is_empty());
    }
}

/// Collects what is logged by any thread.
#[derive(Clone, Default)]
struct Heard(Arc<Mutex<Vec<u8>>>);

impl Write for Heard {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().unwrap().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_and_a_folder_that_cannot_be_are_said_and_the_flight_goes_on() {
    let heard = Heard::default();
    let writer = heard.clone();
    tracing_subscriber::fmt().with_ansi(false).with_writer(move || writer.clone()).init();
    let folder = folder("full");
    let occupied = folder.join("file");
    std::fs::write(&occupied, "not a folder").unwrap();
    let impossible = occupied.join("stats.csv");
    let (drawn, counted) = fly(&Wanted { trace: Some(Path::new("/dev/full")), stats: Some(&impossible) }, 30);
    assert!(drawn >= 20 && counted == drawn, "{drawn} {counted}");
    let said = String::from_utf8(heard.0.lock().unwrap().clone()).unwrap();
    let warned = |words: &[&str]| {
        said.lines().any(|line| line.contains("WARN") && words.iter().all(|word| line.contains(word)))
    };
    assert!(warned(&["going on without --trace", "No space left"]), "{said}");
    assert!(warned(&["going on without --stats", "file"]), "{said}");
    assert_eq!(std::fs::read_to_string(&occupied).unwrap(), "not a folder");

    // What takes no more later on, too: here a reader who has seen enough.
    let pipe = folder.join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let path = pipe.clone();
    let reader =
        std::thread::spawn(move || std::fs::File::open(path).unwrap().read_exact(&mut [0; 10]).unwrap());
    let (drawn, counted) = fly(&Wanted { trace: Some(&pipe), stats: None }, 30);
    reader.join().unwrap();
    assert!(drawn >= 20 && counted == drawn, "{drawn} {counted}");
    let said = String::from_utf8(heard.0.lock().unwrap().clone()).unwrap();
    let said = said.lines().filter(|line| line.contains("WARN") && line.contains("ends early")).count();
    assert_eq!(said, 1, "said once");
}

/// Frames of two milliseconds whose passes the GPU's clock puts before and after where they can have been.
#[test]
fn passes_of_two_frames_never_overlap_whatever_the_clocks_say() {
    let mut trace = Trace::default();
    let mut text = String::new();
    trace.begin(&mut text);
    for serial in 1..=50u64 {
        let begin_ns = 5_000_000_000 + serial * 2_000_000;
        let mut stats = FrameStats { serial, timed_serial: serial - 1, ..FrameStats::default() };
        stats.laps.push(Lap { span: Span::Select, begin_ns, end_ns: begin_ns + 1_999_999 });
        stats.gpu = GpuTimes::new(if serial < 25 { GpuClock::Submission } else { GpuClock::Calibrated });
        let jitter = (serial * 7_919 % 13) * 300_000;
        let from = begin_ns - 3_000_000 + jitter;
        for (name, at, length) in [("tiles", 0, 700_001), ("terrain", 700_001, 1_100_000)] {
            stats.gpu.push(GpuPass { name, begin_ns: from + at, end_ns: from + at + length });
        }
        trace.frame(&mut text, &stats, 0.5);
    }
    trace.end(&mut text, 3);
    let whole: Value = serde_json::from_str(&text).unwrap();
    let slices = slices(whole["traceEvents"].as_array().unwrap());
    assert_eq!(frames(&slices, 1).len(), 50);
    // A serial of 0 is no frame's.
    assert_eq!(frames(&slices, 2).len(), 49);
    assert_eq!(whole["otherData"]["frames_missing"], 3);
    let names = text.matches("\"thread_name\"").count();
    assert_eq!(names, 3, "the track is named anew when the clock is");
}
