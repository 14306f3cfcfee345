//! The desktop window, the real program under Xvfb: it shows the world, obeys keys, follows its size, survives a lost
//! session, and ends the program with exit code 0, without a word from the validation layers. Pictures of each step are
//! left in `target/tmp/desk/`.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

mod desk_support;
mod foreign_support;

use std::fs;
use std::process::Command;
use std::time::Duration;

use desk_support::{Run, Screen, Shot, depth, wait_for};
use fathomless::address::Address;
use fathomless::at;
use fathomless::picture;
use fathomless::world::World;
use foreign_support::Stage;

#[test]
fn a_window_shows_the_world_obeys_keys_follows_its_size_and_ends_the_program() {
    let (screen, folder) = (Screen::open(), tempfile::tempdir().unwrap());
    let args = ["view", "--runtime", "mock", "--size", "240x150", "--validate"];
    let mut run = Run::new(&screen, folder.path(), &args);
    run.resize([480, 300]);
    run.until("its size", |shot| shot.size == [480, 300] && shot.shows_the_world());
    let start = run.still();
    start.keep("1_start");

    // It flies, and only while told to.
    let began = depth(&run.title_until("a title", |title| title.contains("depth")));
    run.key("keydown", "x");
    run.title_until("backing out", |title| title.contains("depth") && depth(title) < began - 1.0);
    run.key("keyup", "x");
    let higher = run.still();
    higher.keep("2_backed_out");
    assert!(higher.shows_the_world() && higher.differs(&start) > 4.0);

    // The mouse looks around once it is taken.
    run.key("key", "f");
    std::thread::sleep(Duration::from_millis(200));
    screen.tool(&["mousemove_relative", "--", "150", "0"]);
    run.until("a turn", |shot| shot.differs(&higher) > 4.0);
    run.still().keep("3_turned");
    run.key("key", "Escape");

    // Back at the start, and into the ground under the cursor.
    run.key("key", "r");
    run.until("the start", |shot| shot.differs(&start) < 2.0).keep("4_back");
    screen.tool(&["mousemove", "--window", &run.window.to_string(), "240", "240"]);
    run.key("keydown", "z");
    run.title_until("a dive", |title| title.contains("depth") && depth(title) > began + 1.0);
    run.key("keyup", "z");

    // The other eye is a little beside; both are side by side, each cropped and not squeezed.
    let left = run.still();
    left.keep("5_left");
    run.key("key", "m");
    run.until("the right eye", |shot| shot.differs(&left) > 0.3);
    let right = run.still();
    right.keep("6_right");
    run.key("key", "m");
    run.until("both eyes", |shot| shot.differs(&right) > 2.0);
    let both = run.still();
    both.keep("7_both");
    let middle = |shot: &Shot| shot.columns(120..360);
    let [beside_left, beside_right] = [0..240, 240..480].map(|half| both.columns(half));
    assert!(beside_left.differs(&middle(&left)) < 2.0, "{}", beside_left.differs(&middle(&left)));
    assert!(beside_right.differs(&middle(&right)) < 2.0, "{}", beside_right.differs(&middle(&right)));
    // Nobody wears a headset: a spectator sees what the left eye sees.
    run.key("key", "m");
    run.until("the spectator", |shot| shot.differs(&left) < 0.5).keep("7_spectator");
    run.key("key", "m");

    // What was asked for is kept, with the place in it.
    run.key("key", "p");
    let kept = folder.path().join("captures/screenshot_0001.png");
    let address = wait_for("a screenshot", || picture::address(&kept).ok());
    run.key("key", "b");
    let marks = folder.path().join("data/bookmarks.toml");
    let marks = wait_for("a bookmark", || fs::read_to_string(&marks).ok());
    assert!(marks.contains(&address), "{marks}\n{address}");

    for (i, size) in [[300, 500], [1, 1], [700, 120], [2, 400], [640, 400]].into_iter().enumerate() {
        run.resize(size);
        let is_that = |shot: &Shot| shot.size == size.map(|side| side as usize);
        if size.into_iter().min() < Some(100) {
            std::thread::sleep(Duration::from_millis(300));
        } else {
            run.until("a picture of that size", |shot| is_that(shot) && shot.shows_the_world())
                .keep(&format!("8_size_{i}"));
        }
    }
    run.key("key", "F11");
    // Hidden and shown again.
    screen.tool(&["windowunmap", &run.window.to_string()]);
    std::thread::sleep(Duration::from_millis(300));
    screen.tool(&["windowmap", &run.window.to_string()]);
    run.until("the world again", Shot::shows_the_world);

    run.close();
    let (code, said) = run.end();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("frames drawn") && !said.contains("WARN"), "{said}");
}

#[test]
fn a_flight_that_was_asked_for_goes_by_itself_until_escape() {
    let (screen, folder) = (Screen::open(), tempfile::tempdir().unwrap());
    let args = [
        "view",
        "--runtime",
        "mock",
        "--flight",
        "dive",
        "--size",
        "160x100",
        "--world",
        "hills",
        "--validate",
    ];
    let mut run = Run::new(&screen, folder.path(), &args);
    let began = depth(&run.title_until("a title", |title| title.contains("flight dive")));
    let later = run.title_until("falling", |title| title.contains("depth") && depth(title) > began + 0.5);
    assert!(later.contains("flight dive"), "{later}");
    run.key("key", "Escape");
    let (code, said) = run.end();
    assert_eq!(code, Some(0), "{said}");
}

#[test]
fn a_lost_session_leaves_the_window_and_the_place() {
    let screen = Screen::open();
    let stage = Stage::new("[headset]\neye_size = [160, 100]\n\n[[cue]]\nframe = 60\nsession = \"lost\"\n");
    let mut command = stage.command(env!("CARGO_BIN_EXE_fathomless"));
    command.args(["view", "--runtime", "system", "--validate"]).current_dir(stage.path(""));
    let mut run = Run::of(&screen, command, stage.path("said"));
    run.key("keydown", "x");
    run.title_until("backing out", |title| title.contains("depth") && depth(title) < -1.0);
    run.key("keyup", "x");
    let still = run.title_until("standing still", |title| title.contains(" 0.00 of "));
    let said = stage.path("said");
    wait_for("another session", || {
        fs::read_to_string(&said).unwrap().contains("another session").then_some(())
    });
    std::thread::sleep(Duration::from_millis(500));
    let after = run.title_until("a title", |title| title.contains(" 0.00 of "));
    assert!((depth(&still) - depth(&after)).abs() < 0.02, "{still}; {after}");
    run.until("the world is seen", Shot::shows_something).keep("9_another_session");
    run.close();
    let (code, said) = run.end();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("another session made 1 times"), "{said}");
}

#[test]
fn a_display_that_does_not_answer_is_as_good_as_none() {
    let folder = tempfile::tempdir().unwrap();
    let world = World::load("canyonlands").unwrap();
    let place = Address::of(&world, &at::stand(&world, 0, None).standpoint()).to_string();
    let out = Command::new(env!("CARGO_BIN_EXE_fathomless"))
        .args(["view", "--runtime", "mock", "--at", &place])
        .current_dir(folder.path())
        .env_remove("WAYLAND_DISPLAY")
        .env("DISPLAY", ":4711")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(0), "{said}");
    assert!(said.contains("without a window"), "{said}");
    assert!(fs::read_dir(folder.path().join("captures")).unwrap().count() > 0);
}
