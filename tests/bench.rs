//! What `bench` says: all of its keys, sane numbers, the same work at every depth, a page that needs nothing but
//! itself; and that parts of a capture are the whole.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn fathomless(args: &str, folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fathomless"))
        .args(args.split_whitespace())
        .current_dir(folder)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn succeeded(args: &str, folder: &Path) -> String {
    let output = fathomless(args, folder);
    assert!(output.status.success(), "{args}: {}", text(&output.stderr));
    text(&output.stdout)
}

fn report(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("`{key}` is {}", value[key]))
}

fn quantiles_are_sane(at: &Value, key: &str) {
    let [p50, p99, p999, worst] = ["p50", "p99", "p999", "worst"].map(|q| number(&at[key], q));
    assert!(
        0.0 < p50 && p50 <= p99 && p99 <= p999 && p999 <= worst && worst < 60_000.0,
        "{key}: {}",
        at[key]
    );
    let mean = number(&at[key], "mean");
    assert!(0.0 < mean && mean <= worst, "{key}: {}", at[key]);
}

#[test]
fn a_bench_gives_its_figures_as_table_json_and_page() {
    let folder = tempfile::tempdir().unwrap();
    let line = "bench -q --flight dive --octaves 12 --frames 60..84 --size 64x64 --complete --validate \
                --json out/figures.json --html out/page.html";
    let table = succeeded(line, folder.path());
    let out = folder.path().join("out");
    let report = report(&out.join("figures.json"));

    assert_eq!(report["frames"], 24);
    assert_eq!(report["validation_messages"], 0);
    assert_eq!((&report["flight"], &report["world"]), (&"dive".into(), &"canyonlands".into()));
    assert_eq!(report["size"], serde_json::json!([64, 64]));
    assert_eq!(report["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!((&report["stopped"], &report["validated"]), (&false.into(), &true.into()));
    for key in ["device", "driver", "driver_version", "runtime"] {
        assert!(!report[key].as_str().unwrap().is_empty(), "{key}");
    }
    assert!(number(&report["machine"], "cores") >= 1.0 && !report["machine"]["cpu"].is_null());
    for key in ["worst_over_median", "worst_over_median_cpu", "worst_over_median_gpu"] {
        assert!((1.0..1000.0).contains(&number(&report, key)), "{key}: {}", report[key]);
    }
    assert!(number(&report["most_over_median"], "draws") >= 1.0);
    for key in ["frame_ms", "frame_cpu_ms", "frame_gpu_ms"] {
        quantiles_are_sane(&report, key);
    }

    let per_depth = report["per_depth"].as_array().unwrap();
    assert_eq!(per_depth.len(), 1, "all of it lies above depth 10");
    for at in per_depth {
        for key in ["frame_ms", "frame_cpu_ms", "frame_gpu_ms"] {
            quantiles_are_sane(at, key);
        }
        assert_eq!((number(at, "depth"), number(at, "frames")), (0.0, 24.0));
        assert!((50.0..5_000.0).contains(&number(at, "tiles_drawn")));
        assert!((1.0..500.0).contains(&number(at, "tiles_made")), "{}", at["tiles_made"]);
        assert!(number(at, "triangles") > 100.0 * number(at, "tiles_drawn"));
        assert!(number(at, "nodes") > number(at, "tiles_drawn"));
        assert!((2.0..=64.0).contains(&number(at, "draws")), "{}", at["draws"]);
        assert!(number(at, "texels_baked") >= 0.0);
        assert!((1_000.0..=65_536.0).contains(&number(at, "bytes_uploaded")), "{}", at["bytes_uploaded"]);
        assert!(number(at, "gpu_bytes") > 1e6 && number(at, "heap_bytes") > 1e4);
        assert!(cfg!(not(target_os = "linux")) || number(at, "rss_bytes") > 1e6);
        assert!((1e3..1e6).contains(&number(at, "path_bytes")));
        // Steady frames leave the heap alone; only a path crossing a checkpoint may not.
        assert!(number(at, "allocations") < 2.0, "{}", at["allocations"]);
        let names = |key: &str| -> Vec<String> {
            at[key].as_array().unwrap().iter().map(|n| n["name"].as_str().unwrap().to_owned()).collect()
        };
        assert_eq!(
            names("spans"),
            ["place", "wait", "xr calls", "begin", "select", "bake", "record", "submit"]
        );
        assert!(names("passes").contains(&"terrain".to_owned()), "{:?}", names("passes"));
        let spans: f64 = at["spans"].as_array().unwrap().iter().map(|span| number(span, "mean")).sum();
        let cpu = number(&at["frame_cpu_ms"], "mean");
        assert!((spans / cpu - 1.0).abs() < 0.01, "the spans make up the frame: {spans} of {cpu}");
    }

    for words in ["dive over canyonlands, 24 frames", "0–9", "worst/p50", "0 validation messages", "terrain"]
    {
        assert!(table.contains(words), "{words:?} expected: {table}");
    }
    assert!(table.lines().all(|line| line.chars().count() <= 130), "{table}");

    let page = std::fs::read_to_string(out.join("page.html")).unwrap();
    well_formed(&page);
    for word in ["http:", "https:", "<script", "<link", "@import", "url(", "NaN", "inf\""] {
        assert!(!page.contains(word), "{word:?} in the page");
    }
    for word in
        ["prefers-color-scheme: dark", "<svg", "<polyline", "<polygon", "GPU by pass", "canyonlands, seed"]
    {
        assert!(page.contains(word), "{word:?} is missing in the page");
    }
    // Nothing half-written beside them.
    let mut files: Vec<_> =
        std::fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    files.sort();
    assert_eq!(files, ["figures.json", "page.html"]);
}

/// Every element is closed, in order; attributes are quoted; no bare `<` or `&`.
fn well_formed(page: &str) {
    let page = page.strip_prefix("<!doctype html>").expect("a doctype");
    let mut open: Vec<&str> = Vec::new();
    let mut rest = page;
    while let Some(start) = rest.find('<') {
        // The style has no references, and is read apart.
        if open.last() != Some(&"style") {
            for reference in rest[..start].split('&').skip(1) {
                let name = reference.split(';').next().unwrap();
                assert!(["amp", "lt", "gt", "quot"].contains(&name), "&{name}");
            }
        }
        let end = start + rest[start..].find('>').expect("a tag ends");
        let tag = &rest[start + 1..end];
        assert_eq!(tag.matches('"').count() % 2, 0, "<{tag}>");
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name));
        } else if !tag.ends_with('/') {
            open.push(tag.split([' ', '\n']).next().unwrap());
        }
        rest = &rest[end + 1..];
    }
    assert!(open.is_empty(), "{open:?} not closed");
}

#[test]
fn the_work_is_the_same_at_every_depth() {
    let folder = tempfile::tempdir().unwrap();
    let json = folder.path().join("depths.json");
    let line = "bench -q --flight still --frames 0..4 --size 64x64 --complete --depths 10,1000,100000 --json depths.json";
    succeeded(line, folder.path());
    let report = report(&json);
    let per_depth = report["per_depth"].as_array().unwrap();
    let depths: Vec<f64> = per_depth.iter().map(|at| number(at, "depth")).collect();
    assert_eq!(depths, [10.0, 1_000.0, 100_000.0]);
    let of = |key: &str| -> Vec<f64> { per_depth.iter().map(|at| number(at, key)).collect() };
    let spread = |key: &str| {
        let all = of(key);
        let (least, most) =
            (all.iter().copied().fold(f64::MAX, f64::min), all.iter().copied().fold(0.0, f64::max));
        println!("{key}: {all:?}");
        if most == 0.0 { 1.0 } else { most / least }
    };
    // Places differ a little in what can be seen; the quadtree around the head hardly does.
    assert!(spread("tiles_drawn") <= 1.25);
    assert!(spread("nodes") <= 1.1);
    assert_eq!(spread("draws"), 1.0);
    assert_eq!(spread("gpu_bytes"), 1.0);
    assert_eq!(of("tiles_made"), [0.0; 3], "nothing moves, everything is made");
    assert_eq!(of("allocations_worst"), [0.0; 3], "nothing moves, nothing is allocated");
    let levels = 100_000.0 + 4_096.0;
    assert!(of("path_bytes")[2] <= 4.0 * levels, "{:?}", of("path_bytes"));
    let per_triangle: Vec<f64> =
        per_depth.iter().map(|at| number(at, "triangles") / number(at, "tiles_drawn")).collect();
    assert!(per_triangle.iter().all(|&n| n == per_triangle[0]), "{per_triangle:?}");
}

#[test]
fn files_that_cannot_be_written_are_refused_before_the_flight() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("file"), "").unwrap();
    for (args, words) in [("--json file/x.json", ["file", "--json"]), ("--html .", ["a folder", "--html"])] {
        let output =
            fathomless(&format!("bench --flight dive-and-return --octaves 100000 {args}"), folder.path());
        let sentence = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{args}: {sentence}");
        for word in words {
            assert!(sentence.contains(word), "{args}: {word:?} expected: {sentence}");
        }
    }
}

#[test]
fn the_parts_of_a_capture_are_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let line = "capture -q --flight dive-and-return --frames 100..107 --depth 40 --size 64x64 --runtime mock";
    succeeded(&format!("{line} --out whole"), folder.path());
    let mut together: Vec<String> = Vec::new();
    for part in 0..3 {
        succeeded(&format!("{line} --out part{part} --shard {part}/3"), folder.path());
        together.extend(names(&folder.path().join(format!("part{part}"))));
        for name in names(&folder.path().join(format!("part{part}"))) {
            let of = |folder_name: &str| std::fs::read(folder.path().join(folder_name).join(&name)).unwrap();
            assert!(of("whole") == of(&format!("part{part}")), "{name} differs");
        }
    }
    together.sort();
    assert_eq!(together, names(&folder.path().join("whole")), "disjoint, and together the whole");
    assert_eq!(together.len(), 14);
    // A part without frames is no failure: a job array may have more jobs than there are frames.
    succeeded(&format!("{line} --out none --shard 0/100"), folder.path());
    assert!(names(&folder.path().join("none")).is_empty());
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}
