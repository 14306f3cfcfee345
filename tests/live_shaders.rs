//! Shaders of one's own: a copy of those that are built in draws the same to the bit, a change changes the picture, and
//! what is wrong is said with its file and line while everything stays as it was; in captures, in a session, and in the
//! real program's window.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

mod desk_support;
#[path = "support/studio.rs"]
mod studio;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use std::sync::Arc;
use std::time::Duration;

use desk_support::{Run, Screen, Shot, wait_for};
use fathomless::aids::PanelAid;
use fathomless::gpu::ShaderText;
use fathomless::panels::wrist::{Touch, WristPanel};
use fathomless::rig::Pose;
use fathomless::shaders::{self, BUILT_IN, Folder};
use fathomless::viewer::{Hung, PanelWay, ViewerConfig};
use fathomless::world::World;
use glam::{Quat, Vec3};
use studio::{Setup, Studio, pose};

/// The program without a display and without a headset.
fn fathomless(folder: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fathomless"));
    for name in ["DISPLAY", "WAYLAND_DISPLAY", "RUST_LOG", "XR_RUNTIME_JSON", "FATHOMLESS_GPU"] {
        command.env_remove(name);
    }
    for name in ["HOME", "XDG_CONFIG_HOME", "XDG_CONFIG_DIRS"] {
        command.env(name, folder.join("nothing-here"));
    }
    command.args(args).current_dir(folder).output().unwrap()
}

fn said(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// Changes a shader's file.
fn edit(folder: &Path, file: &str, from: &str, to: &str) {
    let path = folder.join(file);
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{file} has no {from}");
    fs::write(&path, text.replacen(from, to, 1)).unwrap();
}

/// A line of the terrain's shader: the light that falls on everything.
const LIT: &str = "return vec4(expose(mix(lit(";
const DARKER: &str = "return vec4(0.5 * expose(mix(lit(";
const WRONG: &str = "return vec4(0.5 + * expose(mix(lit(";

/// The line of a file that has these words, from 1.
fn line_of(folder: &Path, file: &str, words: &str) -> usize {
    let text = fs::read_to_string(folder.join(file)).unwrap();
    1 + text.lines().position(|line| line.contains(words)).unwrap()
}

/// Names and bytes of a folder's files.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    entries.map(|it| (it.file_name().into_string().unwrap(), fs::read(it.path()).unwrap())).collect()
}

#[test]
fn captures_with_a_copy_are_the_same_and_with_a_change_are_not() {
    let room = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| {
        let output = fathomless(room.path(), args);
        (output.status.code(), said(&output))
    };
    let (code, words) = run(&["shaders"]);
    assert!(
        code == Some(0)
            && BUILT_IN
                .iter()
                .all(|(one, about)| { words.contains(shaders::file_name(one)) && words.contains(about) }),
        "{words}"
    );
    let (code, words) = run(&["shaders", "--out", "mine"]);
    assert!(code == Some(0) && words.contains("--shaders mine"), "{words}");
    assert_eq!(files(&room.path().join("mine")).len(), BUILT_IN.len());

    let draw = |out: &str, more: &[&str]| {
        let usual = [
            "capture",
            "--frames",
            "0..1",
            "--size",
            "64x64",
            "--validate",
            "--runtime",
            "mock",
            "--out",
            out,
        ];
        run(&[&usual[..], more].concat())
    };
    assert_eq!(draw("usual", &[]).0, Some(0));
    let (code, words) = draw("copy", &["--shaders", "mine"]);
    assert_eq!(code, Some(0), "{words}");
    let usual = files(&room.path().join("usual"));
    assert_eq!(files(&room.path().join("copy")), usual);
    assert_eq!(usual.len(), 2);

    let mine = room.path().join("mine");
    edit(&mine, "terrain.wgsl", LIT, DARKER);
    let (code, words) = draw("changed", &["--shaders", "mine"]);
    assert_eq!(code, Some(0), "{words}");
    let changed = files(&room.path().join("changed"));
    assert!(usual.iter().all(|(name, bytes)| changed[name] != *bytes));

    // Nobody's work is written over.
    let (code, words) = run(&["shaders", "--out", "mine"]);
    assert!(code == Some(1) && words.contains("terrain.wgsl is there already"), "{words}");

    // What is wrong is said, and nothing is left behind.
    edit(&mine, "terrain.wgsl", DARKER, WRONG);
    let line = line_of(&mine, "terrain.wgsl", WRONG);
    let (code, words) = draw("broken", &["--shaders", "mine"]);
    assert!(code == Some(1) && words.contains(&format!("terrain.wgsl:{line}:")), "{words}");
    assert!(!room.path().join("broken").exists());
    fs::rename(mine.join("terrain.wgsl"), mine.join("terrian.wgsl")).unwrap();
    let (code, words) = draw("broken", &["--shaders", "mine"]);
    assert!(
        code == Some(1) && words.contains("has terrian.wgsl") && words.contains("`terrain.wgsl`"),
        "{words}"
    );
    fs::remove_file(mine.join("terrian.wgsl")).unwrap();
    let (code, words) = draw("broken", &["--shaders", "mine"]);
    assert!(
        code == Some(1) && words.contains("lacks terrain.wgsl") && words.contains("shaders --out"),
        "{words}"
    );
    let (code, words) = draw("broken", &["--shaders", "nowhere"]);
    assert!(code == Some(1) && words.contains("nowhere") && words.contains("shaders --out"), "{words}");
}

#[test]
fn what_the_program_hands_over_in_another_form_is_refused() {
    let room = tempfile::tempdir().unwrap();
    for (file, from, to, why) in [
        ("terrain.wgsl", "fn terrain_fragment(", "fn another_fragment(", "entry point terrain_fragment"),
        ("lines.wgsl", "struct LinePoint {", "struct LinePoint { more: f32,", "struct LinePoint"),
        ("panels.wgsl", "panel_sampler", "another_sampler", "panel_sampler"),
        ("mirror.wgsl", "drawn: vec2<f32>", "drawn: f32", "struct Pane"),
    ] {
        let folder = room.path().join(file);
        shaders::write(&folder).unwrap();
        let text = fs::read_to_string(folder.join(file)).unwrap();
        assert!(text.contains(from), "{file}");
        fs::write(folder.join(file), text.replace(from, to)).unwrap();
        let error = shaders::load(&folder).unwrap_err();
        assert!(format!("{error:#}").contains(why), "{file}: {error:#}");
    }
}

/// What a folder's watch has to say next.
fn news(folder: &Folder) -> anyhow::Result<Arc<[ShaderText]>> {
    wait_for("news of the shaders", || folder.news())
}

#[test]
fn a_session_takes_up_what_changes_and_keeps_what_works() {
    let room = tempfile::tempdir().unwrap();
    shaders::write(room.path()).unwrap();
    let folder = Folder::open(room.path()).unwrap();
    let config = ViewerConfig { validate: true, shaders: Some(folder.shelf), ..ViewerConfig::default() };
    let mut studio = Studio::open(&Setup { size: [64, 64], viewer: config, ..Setup::default() });
    let world = World::load("canyonlands").unwrap();
    let shoot = |studio: &mut Studio| studio.shoot(&pose(0.3, 2.2, -12.0, 40.0)).views[0].rgba.clone();
    let usual = shoot(&mut studio);
    assert!(folder.news().is_none());

    edit(room.path(), "terrain.wgsl", LIT, WRONG);
    let line = line_of(room.path(), "terrain.wgsl", WRONG);
    let error = format!("{:#}", news(&folder).unwrap_err());
    assert!(error.contains(&format!("{}:{line}:", room.path().join("terrain.wgsl").display())), "{error}");
    assert_eq!(shoot(&mut studio), usual);

    edit(room.path(), "terrain.wgsl", WRONG, DARKER);
    studio.viewer.set_shaders(&world, news(&folder).unwrap()).unwrap();
    let darker = shoot(&mut studio);
    let sum = |picture: &[u8]| picture.iter().map(|byte| u64::from(*byte)).sum::<u64>();
    assert!(sum(&darker) < sum(&usual), "{} {}", sum(&darker), sum(&usual));

    // A device, or a quality, may refuse what a look at the text does not.
    let texts = folder.shelf.texts();
    let mut odd = texts.to_vec();
    odd.iter_mut()
        .find(|text| text.name.ends_with("sky.wgsl"))
        .unwrap()
        .text
        .push_str("fn odd() -> u32 { return CELL; }");
    assert!(studio.viewer.set_shaders(&world, odd.into()).is_err());
    assert_eq!(folder.shelf.texts(), texts);
    assert_eq!(shoot(&mut studio), darker);

    edit(room.path(), "terrain.wgsl", DARKER, LIT);
    studio.viewer.set_shaders(&world, news(&folder).unwrap()).unwrap();
    assert_eq!(shoot(&mut studio), usual);
    studio.close();
}

#[test]
fn the_wearers_panel_takes_it_up_too() {
    let room = tempfile::tempdir().unwrap();
    shaders::write(room.path()).unwrap();
    let folder = Folder::open(room.path()).unwrap();
    let config = ViewerConfig { validate: true, shaders: Some(folder.shelf), ..ViewerConfig::default() };
    let mut studio = Studio::open(&Setup { size: [64, 64], viewer: config, ..Setup::default() });
    let world = World::load("canyonlands").unwrap();
    let mut panel = WristPanel::new();
    panel.paint(&Touch::default(), 1.0, 0.0, &mut |_| ());
    let shoot = |studio: &mut Studio| {
        let (painted, serial) = panel.picture();
        let ahead = Pose { position: Vec3::new(0.0, 0.0, -0.5), orientation: Quat::IDENTITY };
        let aid = PanelAid { pose: ahead, size_m: [0.3, 0.25] };
        studio.viewer.hang(Some(&Hung { aid, painted, serial })).unwrap();
        let frame = studio.shoot(&pose(0.3, 2.2, -12.0, 40.0));
        assert_eq!(studio.viewer.panel_way(), Some(PanelWay::Layer));
        frame.quads[0].rgba.clone()
    };
    let usual = shoot(&mut studio);
    let other_way: Vec<u8> = usual.chunks_exact(4).flat_map(|p| [p[2], p[1], p[0], p[3]]).collect();
    assert!(usual != other_way);
    let swapchains = studio.mock.calls("xrCreateSwapchain");
    let change = |studio: &mut Studio, file: &str, from: &str, to: &str| {
        edit(room.path(), file, from, to);
        studio.viewer.set_shaders(&world, news(&folder).unwrap()).unwrap();
    };
    let off = |a: &[u8], b: &[u8]| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    change(&mut studio, "quad.wgsl", "in.place, 0.0);", "in.place, 0.0).bgra;");
    let swapped = shoot(&mut studio);
    assert!(off(&swapped, &other_way) <= 1, "{}", off(&swapped, &other_way));
    change(&mut studio, "panels.wgsl", "return corner.colour *", "return corner.colour.bgra *");
    let twice = shoot(&mut studio);
    assert!(off(&twice, &usual) <= 1, "{}", off(&twice, &usual));

    // What the device refuses leaves the panel as it was.
    let mut odd = folder.shelf.texts().to_vec();
    odd.iter_mut().find(|text| text.name.ends_with("quad.wgsl")).unwrap().text.push_str("no");
    assert!(studio.viewer.set_shaders(&world, odd.into()).is_err());
    assert!(shoot(&mut studio) == twice);
    assert_eq!(studio.mock.calls("xrCreateSwapchain"), swapchains, "the layer's images stay");
    studio.close();
}

#[test]
fn a_window_shows_what_is_saved_and_the_log_what_is_wrong() {
    let (screen, room) = (Screen::open(), tempfile::tempdir().unwrap());
    let mine = room.path().join("mine");
    shaders::write(&mine).unwrap();
    let args = [
        "view",
        "--runtime",
        "mock",
        "--size",
        "160x100",
        "--fixed-quality",
        "--shaders",
        "mine",
        "--validate",
    ];
    let mut run = Run::new(&screen, room.path(), &args);
    run.until("its size", |shot| shot.size == [480, 300] && shot.shows_the_world());
    let usual = run.still();

    edit(&mine, "terrain.wgsl", LIT, DARKER);
    run.until("darker land", |shot| shot.differs(&usual) > 8.0);
    let darker = run.still();
    darker.keep("1_darker");
    edit(&mine, "mirror.wgsl", "pane.eye, 0.0).rgb", "pane.eye, 0.0).bgr");
    run.until("another window", |shot| shot.differs(&darker) > 4.0);
    let blue = run.still();
    blue.keep("2_mirror");

    edit(&mine, "terrain.wgsl", DARKER, WRONG);
    let line = line_of(&mine, "terrain.wgsl", WRONG);
    let place = format!("mine/terrain.wgsl:{line}:");
    run.title_until("a word about it", |title| title.contains("shaders stay as they were"));
    let words = fs::read_to_string(&run.said).unwrap();
    assert!(words.contains(&place), "{words}");
    run.until("all as before", |shot| shot.differs(&blue) < 0.5);

    // The panels are drawn by them, too, and have the error in their log.
    run.resize([1100, 780]);
    let bare = run.until("its size", |shot| shot.size == [1100, 780] && shot.shows_the_world());
    run.key("key", "F1");
    let left = 0..210;
    let is_there = |shot: &Shot| shot.columns(left.clone()).differs(&bare.columns(left.clone())) > 8.0;
    let land = run.until("the panels", is_there).columns(230..800);
    screen.tool(&["mousemove", "--window", &run.window.to_string(), "1065", "18"]);
    std::thread::sleep(Duration::from_millis(300));
    screen.tool(&["mousedown", "1"]);
    std::thread::sleep(Duration::from_millis(200));
    screen.tool(&["mouseup", "1"]);
    let log = run.until("the log", |shot| shot.columns(230..800).differs(&land) > 3.0);
    log.keep("3_log");
    let panels = log.columns(left.clone());
    edit(&mine, "terrain.wgsl", WRONG, LIT);
    edit(&mine, "panels.wgsl", "return corner.colour *", "return 0.4 * corner.colour *");
    run.until("paler panels", |shot| shot.columns(left.clone()).differs(&panels) > 8.0).keep("4_paler");
    run.key("key", "F1");
    run.resize([480, 300]);
    edit(&mine, "mirror.wgsl", "pane.eye, 0.0).bgr", "pane.eye, 0.0).rgb");
    run.until("all as it was", |shot: &Shot| shot.differs(&usual) < 0.5);
    run.close();
    let (code, words) = run.end();
    assert_eq!(code, Some(0), "{words}");
    assert_eq!(words.matches("WARN").count(), 1, "{words}");
}
