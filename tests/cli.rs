//! The command line: help teaches, nonsense gets one sentence and exit code 2, values arrive checked.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

use std::process::{Command as Process, Output};

use fathomless::cli::{self, Action, Depths, Eyes, RuntimeChoice, Shard, Size, Stop, Verbosity};
use fathomless::inspect::Inspect;

fn fathomless(args: &[&str]) -> Output {
    Process::new(env!("CARGO_BIN_EXE_fathomless")).args(args).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// These arguments end with exit code 2, nothing on stdout, and one line on stderr with all these words.
fn refused(args: &[&str], words: &[&str]) {
    let output = fathomless(args);
    let sentence = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{args:?}: {sentence}");
    assert!(output.stdout.is_empty(), "{args:?}");
    assert!(sentence.starts_with("error: "), "{args:?}: {sentence}");
    assert_eq!(sentence.matches('\n').count(), 1, "{args:?}: one line: {sentence}");
    for word in words {
        assert!(sentence.contains(word), "{args:?}: {word:?} expected: {sentence}");
    }
}

#[test]
fn nonsense_gets_one_sentence_and_exit_code_2() {
    let cases: &[(&[&str], &[&str])] = &[
        (&["captur"], &["'captur'", "'capture'", "--help"]),
        (&["--wrold", "hills"], &["'--wrold'", "'--world'"]),
        (&["view", "--tiles", "3"], &["'--tiles'"]),
        (&["--world", "hills", "capture"], &["`capture` should come before its options"]),
        (&["--world", "hils"], &["`hils`", "canyonlands, hills, tunkovic", "did you mean `hills`?"]),
        (&["view", "--world", "/nowhere/w.toml"], &["/nowhere/w.toml", "check the path"]),
        (
            &["capture", "--flight", "dve"],
            &["`dve`", "dive, dive-and-return, look-around", "did you mean `dive`?"],
        ),
        (&["capture", "--size", "0x512"], &["'0x512'", "--size", "1 to 16384"]),
        (&["capture", "--size", "512"], &["512x512"]),
        (&["capture", "--size", "512x99999"], &["16384"]),
        (&["capture", "--frames", "5..5"], &["no frame", "5..6"]),
        (&["capture", "--frames", "9..3"], &["no frame"]),
        (&["capture", "--frames", "7"], &["A..B", "0..60"]),
        (&["capture", "--frames", "0..182"], &["`dive`", "181", "0..181"]),
        (&["capture", "--octaves", "0"], &["1 to 1000000"]),
        (&["capture", "--flight", "skim", "--octaves", "9"], &["`skim`", "no dive"]),
        (&["capture", "--octaves", "200", "--frames", "0..9999"], &["4837", "0..4837"]),
        (&["capture", "--shard", "4/4"], &["'4/4'", "counted from 0", "0/4 to 3/4"]),
        (&["capture", "--shard", "0/0"], &["counted from 0"]),
        (&["capture", "--shard", "3"], &["I/N"]),
        (&["bench", "--depths", "10,deep"], &["'deep'", "0 to 1000000"]),
        (&["bench", "--depths", "10", "--depth", "3"], &["--depth"]),
        (&["bench", "--json", "x", "--html", "x"], &["the same file"]),
        (&["bench", "--frames", "0..100000"], &["`dive-and-return`"]),
        (&["capture", "--eyes", "lefft"], &["both, left, right", "'left'"]),
        (&["capture", "--runtime", "steam"], &["auto, system, mock"]),
        (&["capture", "--backdrop-layer"], &["--backdrop-layer", "leave it out"]),
        (
            &["capture", "--show", "wirefram"],
            &["--show", "`wirefram`", "wireframe, levels, boxes", "octave=N"],
        ),
        (&["capture", "--show", "octave=deep"], &["`deep`", "octave=4"]),
        (&["capture", "--show", "levels", "--eyes", "cube"], &["--show", "leave one of them out"]),
        (&["capture", "--show", "frozen", "--shard", "0/2"], &["--shard", "leave one of them out"]),
        (&["view", "--wait-for-headset", "--runtime", "mock"], &["no headset to wait for"]),
        (&["view", "--refresh-rate", "0"], &["--refresh-rate", "1 to 1000"]),
        (&["capture", "--depth", "1000001"], &["0 to 1000000"]),
        (&["capture", "--depth", "-1"], &["0 to 1000000"]),
        (&["capture", "--out"], &["--out"]),
        (&["verify", "--tiles", "0"], &["1 to 10000000"]),
        (&["verify", "--seed", "-1"], &["0 to 18446744073709551615"]),
        (&["verify", "--depth", "deep"], &["'deep'", "whole number"]),
        (&["export", "--cells", "4097"], &["1 to 4096"]),
        (&["export", "--level-offset", "-1000001"], &["-1000000 to 1000"]),
        (&["export", "--format", "stl"], &["csv, png16, obj"]),
        (&["export", "--format", "png16"], &["--out"]),
        (&["bookmarks", "add", "a b", "--at", "x"], &["'a b'", "letters, digits"]),
        (&["bookmarks", "add", "mesa"], &["--at"]),
        (&["bookmarks", "rename"], &["'rename'"]),
        (&["worlds", "-q", "-v"], &["--quiet", "--verbose"]),
        (&["worlds", "all"], &["'all'"]),
        (&["runtime", "mock.json"], &["'mock.json'"]),
    ];
    for (args, words) in cases {
        refused(args, words);
    }
}

#[test]
fn a_bad_world_file_is_refused_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mine.toml");
    std::fs::write(&path, "title = 'mine'\nsurfce = 1\n").unwrap();
    refused(
        &["view", "--world", path.to_str().unwrap()],
        &["mine.toml:2: ", "`surfce`", "did you mean `surface`?"],
    );
}

#[test]
fn help_teaches_with_examples() {
    for command in
        ["view", "capture", "bench", "verify", "doctor", "worlds", "export", "bookmarks", "runtime"]
    {
        for args in [[command, "--help"], ["help", command], [command, "-h"]] {
            let output = fathomless(&args);
            assert_eq!(output.status.code(), Some(0), "{args:?}");
            let help = text(&output.stdout);
            assert!(help.contains("Examples:\n  fathomless "), "{args:?}: {help}");
            assert!(help.contains(&format!("fathomless {command}")), "{args:?}: {help}");
            assert!(help.contains("--validate"), "{args:?}: {help}");
        }
    }
    let help = text(&fathomless(&["--help"]).stdout);
    for word in [
        "view",
        "capture",
        "bench",
        "verify",
        "doctor",
        "worlds",
        "export",
        "bookmarks",
        "runtime",
        "Exit codes",
        "RUST_LOG",
    ] {
        assert!(help.contains(word), "{help}");
    }
    let capture = text(&fathomless(&["capture", "--help"]).stdout);
    for word in ["canyonlands, hills, tunkovic", "dive, dive-and-return, look-around", "[default: captures]"]
    {
        assert!(capture.contains(word), "{capture}");
    }
}

/// The examples in the help are not only words: each of them is a command line that makes sense.
#[test]
fn the_examples_of_the_help_make_sense() {
    let own_files = ["my-world.toml", "my-flight.toml", "@mesa", "dive/frame_"];
    let mut tried = 0;
    let commands =
        ["view", "capture", "bench", "verify", "doctor", "worlds", "export", "bookmarks", "runtime"]
            .map(Some);
    for command in [None].into_iter().chain(commands) {
        let args: Vec<&str> = command.into_iter().chain(["--help"]).collect();
        let help = text(&fathomless(&args).stdout);
        let examples = help.split("Examples:\n").nth(1).unwrap();
        for line in examples.lines().take_while(|line| line.starts_with("  fathomless")) {
            // Two or more spaces part an example from its explanation.
            let example = line.trim_start().split("  ").next().unwrap();
            if own_files.iter().any(|file| example.contains(file)) {
                continue;
            }
            cli::parse_from(example.split_whitespace()).unwrap_or_else(|stop| panic!("{example}: {stop:?}"));
            tried += 1;
        }
    }
    assert!(tried >= 12, "{tried} examples tried");
}

#[test]
fn worlds_lists_each_with_a_line() {
    let output = fathomless(&["worlds"]);
    assert_eq!(output.status.code(), Some(0));
    let list = text(&output.stdout);
    let names: Vec<&str> = list.lines().map(|line| line.split_whitespace().next().unwrap()).collect();
    assert_eq!(names, ["canyonlands", "hills", "tunkovic"]);
    assert!(list.lines().all(|line| line.len() > 30 && line.len() <= 100), "{list}");
}

fn parse(args: &str) -> cli::Command {
    let words = ["fathomless"].into_iter().chain(args.split_whitespace());
    cli::parse_from(words).unwrap_or_else(|stop| panic!("{args}: {stop:?}"))
}

#[test]
fn no_command_means_view() {
    for args in ["", "--validate", "-v", "-vv --validate", "-q", "--world hills", "--depth 7 -v"] {
        let command = parse(args);
        assert!(matches!(command.action, Action::View(_)), "{args}");
        assert_eq!(command.validate, args.contains("--validate"), "{args}");
    }
    let Action::View(view) = parse("--seed 0xff --depth 7").action else { panic!("not a view") };
    assert_eq!((view.world.surface.seed, view.depth, view.runtime), (255, 7, RuntimeChoice::Auto));
    assert_eq!((view.world.name.as_str(), view.flight.name.as_str()), ("canyonlands", "dive"));
    assert!(!view.backdrop_layer);
    let Action::View(view) = parse("--wait-for-headset --refresh-rate 90 --size 64x48").action else {
        panic!("not a view")
    };
    assert!(view.wait_for_headset && view.refresh_hz == Some(90.0));
    assert_eq!(view.size.map(|size| (size.width, size.height)), Some((64, 48)));
    let Action::View(view) = parse("--backdrop-layer").action else { panic!("not a view") };
    assert!(view.backdrop_layer);
}

#[test]
fn values_arrive_checked() {
    let line = "-v capture --out a/b --frames 3..9 --size 640x480 --eyes right --world tunkovic --seed 5 --depth 1000000 \
                --flight over --runtime mock --validate -v";
    let command = parse(line);
    assert!(command.validate);
    let Action::Capture(shown) = parse("capture --show wireframe,octave=-3,no-skirts").action else {
        panic!("not a capture")
    };
    let wanted = Inspect { wireframe: true, octave: Some(-3), skirts: false, ..Inspect::default() };
    assert_eq!(shown.show, wanted);
    let Action::Capture(capture) = command.action else { panic!("not a capture") };
    assert_eq!(capture.out, std::path::Path::new("a/b"));
    assert_eq!(capture.frames, 3..9);
    assert_eq!(capture.size, Size { width: 640, height: 480 });
    assert_eq!(capture.eyes, Eyes::Right);
    assert_eq!((capture.world.name.as_str(), capture.world.surface.seed), ("tunkovic", 5));
    assert_eq!((capture.depth, capture.flight.name.as_str()), (1_000_000, "over"));
    assert_eq!(capture.runtime, RuntimeChoice::Mock);

    let Action::Capture(capture) = parse("capture").action else { panic!("not a capture") };
    assert_eq!(capture.frames, 0..capture.flight.frames(), "all frames");

    assert_eq!(capture.shard, Shard::WHOLE);
    let Action::Capture(capture) = parse("capture --shard 3/8 --octaves 200").action else {
        panic!("not a capture")
    };
    assert_eq!(capture.shard, Shard { index: 3, count: 8 });
    assert_eq!((capture.flight.deepest(), capture.frames), (200.0, 0..4837));

    let Action::Bench(bench) = parse("bench").action else { panic!("not a bench") };
    assert_eq!((bench.depths, bench.runtime), (Depths::Once(0), RuntimeChoice::Mock));
    assert_eq!((bench.flight.name.as_str(), bench.frames), ("dive-and-return", 0..bench.flight.frames()));
    let line = "bench --depths 10,1000,100000 --json a.json --html b.html --complete --flight still";
    let Action::Bench(bench) = parse(line).action else { panic!("not a bench") };
    assert_eq!(bench.depths, Depths::Each(vec![10, 1_000, 100_000]));
    assert!(bench.complete && bench.json.is_some() && bench.html.is_some());

    let Action::Verify(verify) = parse("verify --tiles 2000 --depth 100000").action else {
        panic!("not a verify")
    };
    assert_eq!((verify.tiles, verify.depth), (2000, 100_000));
}

#[test]
fn shards_are_disjoint_and_together_the_whole() {
    for things in [0usize, 1, 7, 181, 1_000_003] {
        for count in [1u32, 2, 3, 8, 500, 1_000_000] {
            let mut next = 0;
            let mut lengths = (usize::MAX, 0);
            for index in 0..count {
                let part = Shard { index, count }.part_of(things);
                assert_eq!(part.start, next, "{index}/{count} of {things}");
                lengths = (lengths.0.min(part.len()), lengths.1.max(part.len()));
                next = part.end;
            }
            assert_eq!(next, things);
            assert!(lengths.1 - lengths.0 <= 1, "{lengths:?}");
        }
    }
}

#[test]
fn verbosity_counts() {
    let cases = [
        ("-q doctor", Verbosity::Quiet),
        ("doctor", Verbosity::Normal),
        ("doctor -v", Verbosity::Info),
        ("doctor -vv", Verbosity::Debug),
        ("doctor -vvvv", Verbosity::Trace),
    ];
    for (args, verbosity) in cases {
        assert_eq!(parse(args).verbosity, verbosity, "{args}");
    }
}

#[test]
fn help_and_version_are_no_errors() {
    for args in
        [["fathomless", "--help"], ["fathomless", "-h"], ["fathomless", "--version"], ["fathomless", "help"]]
    {
        assert!(matches!(cli::parse_from(args), Err(Stop::Help(_))), "{args:?}");
    }
}
