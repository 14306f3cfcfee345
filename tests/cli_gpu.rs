//! The program where it draws: pictures that are whole or not there, one sentence where it cannot, an end when asked.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// The program in an environment without headset, display or settings of the person at this desk.
fn fathomless(args: &[&str], folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fathomless"));
    command.args(args).current_dir(folder).stdin(Stdio::null());
    for name in ["DISPLAY", "WAYLAND_DISPLAY", "RUST_LOG", "XR_RUNTIME_JSON", "FATHOMLESS_GPU"] {
        command.env_remove(name);
    }
    without_runtime(&mut command, folder);
    command
}

/// Nothing is set up where OpenXR loaders look first. (The data folders stay: Vulkan's drivers are found there.)
fn without_runtime(command: &mut Command, folder: &Path) {
    for name in ["HOME", "XDG_CONFIG_HOME", "XDG_CONFIG_DIRS"] {
        command.env(name, folder.join("nothing-here"));
    }
}

fn run(args: &[&str], folder: &Path) -> Output {
    fathomless(args, folder).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A folder of its own, and the path of a folder in it that is not there yet.
fn room() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    (folder, out)
}

/// Names of what is in a folder; none if there is no folder.
fn names(folder: &Path) -> BTreeSet<String> {
    let Ok(entries) = fs::read_dir(folder) else { return BTreeSet::new() };
    entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

fn set(names: &[&str]) -> BTreeSet<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}

/// Size and bytes of a PNG of 8-bit RGB.
fn picture(path: &Path) -> ([u32; 2], Vec<u8>) {
    let decoder = png::Decoder::new(BufReader::new(File::open(path).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, png::BitDepth::Eight));
    ([info.width, info.height], bytes)
}

/// Many colours, none of which is most of it.
fn assert_shows_something(path: &Path) {
    let (_, bytes) = picture(path);
    let colours: BTreeSet<&[u8]> = bytes.chunks(3).collect();
    assert!(colours.len() > 500, "{}: {} colours", path.display(), colours.len());
}

/// Exit code 1, and one sentence on stderr with these words.
fn assert_fails(output: &Output, words: &[&str]) {
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert_eq!(stderr.trim_end().lines().count(), 1, "one line: {stderr}");
    assert!(stderr.starts_with("error: "), "{stderr}");
    for word in words {
        assert!(stderr.contains(word), "{word:?} expected: {stderr}");
    }
}

const SMALL: [&str; 4] = ["--size", "128x128", "--runtime", "mock"];

#[test]
fn capture_writes_a_whole_picture_for_each_eye_and_frame_and_nothing_else() {
    let (folder, out) = room();
    let args = ["capture", "--out", "out", "--frames", "0..2", "--validate", "-q"];
    let output = run(&[&args[..], &SMALL].concat(), folder.path());
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(output.stderr.is_empty(), "{}", text(&output.stderr));
    let four = [
        "frame_000000_left.png",
        "frame_000000_right.png",
        "frame_000001_left.png",
        "frame_000001_right.png",
    ];
    assert_eq!(names(&out), set(&four));
    assert_eq!(names(folder.path()), set(&["out"]));
    for name in four {
        assert_eq!(picture(&out.join(name)).0, [128, 128]);
        assert_shows_something(&out.join(name));
    }
    assert_ne!(picture(&out.join(four[0])).1, picture(&out.join(four[1])).1, "each eye has its own");
}

#[test]
fn a_frame_is_the_same_whether_drawn_alone_or_after_others() {
    let (folder, out) = room();
    for (to, frames) in [("all", "40..43"), ("alone", "42..43")] {
        let args = ["capture", "--out", &format!("out/{to}"), "--frames", frames, "--eyes", "left"];
        let output = run(&[&args[..], &SMALL].concat(), folder.path());
        assert!(output.status.success(), "{}", text(&output.stderr));
        assert!(text(&output.stdout).contains(&format!("out/{to}")), "says where: {}", text(&output.stdout));
    }
    let name = "frame_000042_left.png";
    assert_eq!(names(&out.join("alone")), set(&[name]), "only the eye asked for");
    assert_eq!(names(&out.join("all")).len(), 3);
    let [all, alone] = ["all", "alone"].map(|from| picture(&out.join(from).join(name)).1);
    let differing = all.iter().zip(&alone).filter(|(a, b)| a != b).count();
    assert_eq!(differing, 0, "of {} bytes", all.len());
}

#[test]
fn a_place_that_cannot_be_written_is_refused_before_any_work() {
    let (folder, _) = room();
    fs::write(folder.path().join("taken"), "a file").unwrap();
    let before = names(folder.path());
    for out in ["taken", "taken/below", "/proc/fathomless", "/dev/null"] {
        let output =
            run(&[&["capture", "--out", out, "--frames", "0..1"], &SMALL[..]].concat(), folder.path());
        assert_fails(&output, &[out, "choose another folder with --out"]);
        assert!(output.stdout.is_empty());
        assert_eq!(names(folder.path()), before, "{out}: nothing is left behind");
    }
    assert_eq!(fs::read_to_string(folder.path().join("taken")).unwrap(), "a file");
}

#[test]
fn without_a_system_runtime_one_sentence_says_what_to_do() {
    let (folder, out) = room();
    let args = ["--runtime", "system"];
    let capture = ["capture", "--out", "out", "--frames", "0..1"];
    let named = |args: &[&str]| {
        let mut command = fathomless(args, folder.path());
        command.env("XR_RUNTIME_JSON", "/nowhere/runtime.json").output().unwrap()
    };
    for args in [[&["view"], &args[..]].concat(), [&capture[..], &args].concat()] {
        assert_fails(&named(&args), &["/nowhere/runtime.json", "XR_RUNTIME_JSON", "correct or unset"]);
    }
    assert_eq!(names(&out), set(&[]), "nothing is drawn");

    // And where no runtime is named, unless this machine has one in /etc after all.
    if !Path::new("/etc/openxr/1").exists() && !Path::new("/usr/local/etc/openxr/1").exists() {
        let mut command = fathomless(&["view", "--runtime", "system"], folder.path());
        for name in ["XDG_DATA_HOME", "XDG_DATA_DIRS"] {
            command.env(name, folder.path().join("nothing-here"));
        }
        let output = command.output().unwrap();
        assert_fails(&output, &["no OpenXR runtime is set up", "install the headset's software"]);
    }
}

/// As on a machine without any Vulkan driver.
fn without_a_driver(args: &[&str], folder: &Path) -> Output {
    let mut command = fathomless(args, folder);
    command.env("VK_DRIVER_FILES", "/nonexistent").env("VK_ICD_FILENAMES", "/nonexistent");
    command.output().unwrap()
}

#[test]
fn without_a_vulkan_driver_one_sentence_says_what_to_install() {
    let (folder, out) = room();
    let capture = ["capture", "--out", "out", "--frames", "0..1", "-q"];
    for args in [[&capture[..], &SMALL].concat(), vec!["verify", "--tiles", "1"]] {
        let output = without_a_driver(&args, folder.path());
        assert_fails(&output, &["No Vulkan driver found", "mesa-vulkan-drivers", "setup.sh"]);
        assert!(output.stdout.is_empty());
        assert!(!out.exists(), "nothing is left behind, not even the folder");
    }
}

#[test]
fn verify_says_how_much_is_equal() {
    let (folder, _) = room();
    let output = run(&["verify", "--tiles", "50", "--depth", "1000", "--validate"], folder.path());
    let said = text(&output.stdout);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(said.starts_with("equal: 50 tiles"), "{said}");
    assert!(said.contains("depth 1000") && said.contains("heights compared, 0 differ"), "{said}");
    assert!(names(folder.path()).is_empty());
}

#[test]
fn without_display_and_headset_a_dive_is_drawn_to_captures() {
    let (folder, _) = room();
    let flight = "title = 'short'\nfps = 20\n[[keyframe]]\ntime_s = 0\ndepth = 0\nheight = 2\n\
                  [[keyframe]]\ntime_s = 0.1\ndepth = 0.3\nheight = 2\n";
    fs::write(folder.path().join("short.toml"), flight).unwrap();
    let output = run(&["--flight", "./short.toml"], folder.path());
    let said = text(&output.stdout);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(said.contains("fathomless doctor") && said.contains("captures"), "says why and where: {said}");
    assert_eq!(names(folder.path()), set(&["captures", "short.toml"]));
    let drawn = names(&folder.path().join("captures"));
    assert_eq!(drawn.len(), 6, "three frames for two eyes: {drawn:?}");
    assert_shows_something(&folder.path().join("captures/frame_000002_right.png"));
}

/// Sends a signal, as a person at a terminal or a job scheduler does.
fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill").args([&format!("-{name}"), &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
}

#[test]
fn a_signal_ends_a_long_capture_with_whole_pictures_only() {
    for name in ["INT", "TERM"] {
        let (folder, out) = room();
        let args = ["capture", "--out", "out", "--flight", "still", "--eyes", "right", "-q"];
        let mut command = fathomless(&[&args[..], &SMALL].concat(), folder.path());
        let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let deadline = Instant::now() + Duration::from_secs(120);
        while names(&out).iter().filter(|name| name.ends_with(".png")).count() < 2 {
            assert!(Instant::now() < deadline, "no picture within two minutes");
            std::thread::sleep(Duration::from_millis(10));
        }
        signal(&child, name);
        let output = child.wait_with_output().unwrap();
        assert_fails(&output, &["stopped early", "whole"]);
        let drawn = names(&out);
        assert!((2..181).contains(&drawn.len()), "{} pictures", drawn.len());
        for name in &drawn {
            assert!(name.ends_with("_right.png"), "{name} is no whole picture");
            assert_eq!(picture(&out.join(name)).0, [128, 128]);
        }
    }
}

/// The findings of a report: mark and the rest of the line.
fn findings(report: &str) -> Vec<(&str, &str)> {
    let lines = report.lines().filter_map(|line| line.strip_prefix("  "));
    lines.filter_map(|line| line.split_once(' ')).map(|(mark, rest)| (mark, rest.trim_start())).collect()
}

#[test]
fn doctor_finds_what_is_here_and_what_is_not() {
    let (folder, _) = room();
    let doctor = |args: &[&str], name: &str, value: &str| {
        let mut command = fathomless(args, folder.path());
        command.env(name, value).output().unwrap()
    };
    let output = doctor(&["doctor"], "DISPLAY", ":4711");
    let report = text(&output.stdout);
    assert!(output.status.success(), "{report}{}", text(&output.stderr));
    assert!(output.stderr.is_empty(), "{}", text(&output.stderr));
    for title in ["Vulkan", "OpenXR", "Built-in runtime", "Display", "So"] {
        assert!(report.lines().any(|line| line == title), "{title}: {report}");
    }
    let found = findings(&report);
    let has = |mark: &str, words: &str| found.iter().any(|(m, rest)| *m == mark && rest.contains(words));
    assert!(has("ok", "loader") && has("ok", "all that is needed"), "{report}");
    assert!(has("ok", "XR_KHR_vulkan_enable2") && has("ok", "a frame drawn"), "{report}");
    assert!(has("missing", "DISPLAY=:4711, but no server") && has("missing", "WAYLAND_DISPLAY"), "{report}");
    assert!(report.contains("`fathomless` draws a short dive to captures/"), "{report}");

    let output = doctor(&["doctor", "-v"], "XR_RUNTIME_JSON", "/nowhere/runtime.json");
    let long = text(&output.stdout);
    assert!(output.status.success());
    assert!(long.contains("XR_RUNTIME_JSON says") && long.contains("Fedora   monado"), "{long}");
    assert!(long.contains("VK_KHR_swapchain") && long.lines().count() > 2 * report.lines().count(), "{long}");

    let output = without_a_driver(&["doctor"], folder.path());
    let report = text(&output.stdout);
    assert_fails(&output, &["nothing can be drawn on this machine", "mesa-vulkan-drivers"]);
    for words in ["missing  device", "Debian   mesa-vulkan-drivers", "cannot draw anything here yet"] {
        assert!(report.contains(words), "{words}: {report}");
    }
    assert!(names(folder.path()).is_empty());
}
