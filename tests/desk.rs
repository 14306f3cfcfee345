//! The desktop window, the real program under Xvfb: it shows the world, obeys keys, follows its size, survives a lost
//! session, and ends the program with exit code 0, without a word from the validation layers. Pictures of each step are
//! left in `target/tmp/desk/`.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

mod desk_support;
mod foreign_support;

use std::fs;
use std::process::Command;
use std::time::Duration;

use desk_support::{Run, STATS, Screen, Shot, depth, wait_for};
use fathomless::address::Address;
use fathomless::at;
use fathomless::picture;
use fathomless::world::World;
use foreign_support::{Stage, number};

#[test]
fn a_window_shows_the_world_obeys_keys_follows_its_size_and_ends_the_program() {
    let (screen, folder) = (Screen::open(), tempfile::tempdir().unwrap());
    let args = ["view", "--runtime", "mock", "--size", "240x150", "--validate"];
    let mut run = Run::new(&screen, folder.path(), &args);
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

    run.resizes("8");
    run.key("key", "F11");
    // Hidden and shown again.
    run.hide_for_a_while();
    run.until("the world again", Shot::shows_the_world);

    run.close();
    let (code, said) = run.end();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("frames drawn") && !said.contains("WARN"), "{said}");
}

#[test]
fn a_steady_frame_of_the_window_takes_nothing_from_the_heap_while_the_panels_are_hidden() {
    let (screen, folder) = (Screen::open(), tempfile::tempdir().unwrap());
    let args = "view --runtime mock --size 96x64 --fixed-quality";
    let mut run = Run::new(&screen, folder.path(), &args.split(' ').collect::<Vec<_>>());
    // Shown once, so that there is something to hide.
    run.resize([900, 300]);
    let bare = run.until("its size", |shot| shot.size == [900, 300] && shot.shows_the_world());
    run.key("key", "F1");
    run.until("the panels", |shot| shot.differs(&bare) > 10.0);
    let shown = run.frames_later(40);
    run.key("key", "F1");
    run.until("the land alone", |shot| shot.differs(&bare) < 1.0);
    run.still();
    let steady = run.frames_later(10);
    let last = run.frames_later(200);
    let counts = run.column("allocations");
    assert!(counts[..shown].iter().any(|count| *count > 0.0), "the count hears allocations");
    assert_eq!(counts[steady..last], vec![0.0; last - steady]);
    run.close();
    assert_eq!(run.end().0, Some(0));
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
    // However late it is by now: from depth 0 down, without a key.
    run.title_until("falling", |title| title.contains("flight dive") && depth(title) > 2.0);
    run.key("key", "Escape");
    let (code, said) = run.end();
    assert_eq!(code, Some(0), "{said}");
}

#[test]
fn settings_are_taken_up_while_the_window_is_open_and_a_double_click_dives() {
    let (screen, folder) = (Screen::open(), tempfile::tempdir().unwrap());
    let home = folder.path().join("none/fathomless");
    fs::create_dir_all(&home).unwrap();
    let file = home.join("fathomless.toml");
    fs::write(&file, "[motion]\nspeed = 3\n[keys]\nback_out = 'K'\n[mirror]\nsize = '320x200'\n").unwrap();
    let args = ["view", "--runtime", "mock", "--size", "160x100", "--validate", "-v"];
    let mut run = Run::new(&screen, folder.path(), &args);
    assert_eq!(run.opened, [320, 200]);
    let one = run.until("one eye", Shot::shows_the_world);
    let began = depth(&run.title_until("the speed that is set", |title| title.contains(" of 3.00 ")));
    run.key("key", "x");
    run.key("keydown", "k");
    run.title_until("backing out", |title| title.contains("depth") && depth(title) < began - 0.5);
    run.key("keyup", "k");

    // What is wrong is said, and changes nothing.
    fs::write(&file, "[motion]\nspeed = 'fast'\n").unwrap();
    run.title_until("what is wrong", |title| title.contains("fathomless.toml:2:9"));
    run.title_until("the speed as it was", |title| title.contains(" of 3.00 "));

    let text = "[motion]\nspeed = 2\n[keys]\nback_out = 'J'\n[mirror]\nside = 'both'\n[mouse]\ndouble_click_octaves = 1\ndouble_click_ms = 2000\n";
    fs::write(&file, text).unwrap();
    run.title_until("another speed", |title| title.contains(" of 2.00 "));
    run.until("both eyes", |shot| shot.differs(&one) > 2.0).keep("10_set_to_both");
    run.key("keydown", "j");
    run.title_until("backing out", |title| title.contains("depth") && depth(title) < began - 1.5);
    run.key("keyup", "j");

    let rest = |run: &mut Run| {
        run.still();
        depth(&run.title_until("rest", |title| title.contains(" 0.00 of ")))
    };
    let above = rest(&mut run);
    run.point_and([120, 255], &["click", "--repeat", "2", "--delay", "1", "1"]);
    run.title_until("a dive", |title| title.contains("depth") && depth(title) > above + 0.5);
    let below = rest(&mut run);
    assert!((above + 0.9..above + 2.5).contains(&below), "{above} {below}");

    run.key("key", "Escape");
    let (code, said) = run.end();
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(said.matches("toml:2:9").count(), 1, "{said}");
    assert!(
        said.contains("motion.speed is taken up") && said.contains("mirror.size is taken up at the next"),
        "{said}"
    );
}

#[test]
fn a_lost_session_leaves_the_window_and_the_place() {
    let screen = Screen::open();
    let stage = Stage::new("[headset]\neye_size = [160, 100]\n\n[[cue]]\nframe = 60\nsession = \"lost\"\n");
    let mut command = stage.command(env!("CARGO_BIN_EXE_fathomless"));
    command.args(["view", "--runtime", "system", "--validate"]).args(STATS).current_dir(stage.path(""));
    let mut run = Run::of(&screen, command, stage.path("said"));
    run.key("keydown", "x");
    run.title_until("backing out", |title| title.contains("depth") && depth(title) < -1.0);
    run.key("keyup", "x");
    let still = run.title_until("standing still", |title| title.contains(" 0.00 of "));
    let said = stage.path("said");
    wait_for("another session", || {
        fs::read_to_string(&said).unwrap().contains("another session").then_some(())
    });
    // The titles of that session's frames come after these.
    run.frames_later(20);
    let after = *run.column("depth").last().unwrap();
    assert!((depth(&still) - after).abs() < 0.02, "{still}; {after}");
    run.until("the world is seen", Shot::shows_something).keep("9_another_session");
    run.close();
    let (code, said) = run.end();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("another session made 1 times"), "{said}");
}

/// A headset in real time, 30 frames a second, whose wearer ends the session at a frame.
fn worn(exit_frame: u64, more: &str) -> Stage {
    Stage::new(&format!(
        "[headset]\nclock = \"real\"\nhz = 30\neye_size = [64, 40]\nmask = \"empty\"\n{more}\n\
         [[cue]]\nframe = {exit_frame}\nsession = \"exit\"\n"
    ))
}

/// Frames of the session that went to the headset with a picture.
fn frames(stage: &Stage) -> u64 {
    let lives = stage.lives();
    let flight = lives.last().unwrap();
    assert_eq!(flight["violations"].as_array().unwrap().len(), 0, "{flight}");
    number(&flight["frames"]["with_projection"])
}

/// The viewer in a headset that is worn.
fn in_headset(stage: &Stage) -> Command {
    let mut command = stage.command(env!("CARGO_BIN_EXE_fathomless"));
    command.args(["view", "--runtime", "system", "--world", "hills"]).args(STATS).current_dir(stage.path(""));
    command
}

#[test]
fn the_headset_gets_its_frames_with_the_window_open_blocked_or_without_one() {
    let (screen, exit_frame) = (Screen::open(), 90);
    // The wearer ends the session, and with it the program: with a window, and without one.
    for display in [Some(&screen.name), None] {
        let stage = worn(exit_frame, "");
        let mut command = in_headset(&stage);
        if let Some(name) = display {
            command.env_remove("WAYLAND_DISPLAY").env("DISPLAY", name);
        }
        assert!(foreign_support::run(&mut command, &stage).success(), "{}", stage.said());
        let said = stage.said();
        assert_eq!(said.contains("takes the mouse"), display.is_some(), "it greets who has a window: {said}");
        assert!(!said.contains("the display does not answer any more"), "{said}");
        // But for a few while the session begins and ends. How long that takes is up to all else that the machine does.
        let frames = frames(&stage);
        assert!(frames + 10 > exit_frame && frames < exit_frame + 10, "{frames}");
    }
    // It ends as well where the display has stopped.
    let stage = worn(1_000_000, "");
    let mut run = Run::of(&screen, in_headset(&stage), stage.path("said"));
    screen.stop();
    run.frames_later(90);
    run.terminate();
    let (code, said) = run.end();
    screen.go_on();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("the display does not answer any more"), "{said}");
    frames(&stage);
}

#[test]
fn vulkan_shows_the_window_too_and_follows_every_size_and_a_display_that_stands_still() {
    let (screen, folder) = (Screen::open(), tempfile::tempdir().unwrap());
    let args = ["view", "--runtime", "mock", "--size", "160x100", "--validate"];
    let mut run = Run::with(
        &screen,
        folder.path(),
        &args,
        &[("FATHOMLESS_WINDOW", "swapchain"), ("RUST_LOG", "warn,winit=error,fathomless=debug")],
    );
    run.resizes("vulkan");
    // A while in which, with one queue for all, the flight may wait for the window, too.
    screen.stop();
    std::thread::sleep(Duration::from_millis(1500));
    screen.go_on();
    run.frames_later(20);
    let before = run.until("a picture", Shot::shows_the_world);
    run.key("key", "f");
    screen.tool(&["mousemove_relative", "--", "300", "0"]);
    run.until("it goes on", |shot| shot.differs(&before) > 4.0).keep("vulkan_goes_on");
    run.key("key", "Escape");
    run.close();
    let (code, said) = run.end();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("Vulkan shows pictures in the window") && !said.contains("WARN"), "{said}");
}

#[test]
fn a_spectator_sees_the_middle_of_what_the_left_eye_sees_once_the_head_is_still() {
    let head = "fov_deg = [[-49, 46, 40, -40], [-46, 49, 40, -40]]\n\n\
                [[head]]\ntime_s = 0\nposition = [0, 1.6, 0]\npitch_deg = 12\nroll_deg = 5\n";
    let (screen, stage) = (Screen::open(), worn(100_000, head));
    let mut command = in_headset(&stage);
    command.args(["--flight", "still", "--size", "160x100", "--validate"]);
    let mut run = Run::of(&screen, command, stage.path("said"));
    run.until("its size", |shot| shot.size == [480, 300] && shot.shows_the_world());
    run.key("key", "l"); // Nobody flies on now.
    let left = run.still();
    left.keep("worn_left");
    (0..3).for_each(|_| run.key("key", "m"));
    let middle = left.middle(fathomless::desktop::SPECTATOR_SHARE);
    run.until("what a spectator sees", |shot| shot.differs(&middle) < 3.0).keep("worn_spectator");
    assert!(left.differs(&middle) > 6.0, "{}", left.differs(&middle));
    run.close();
    let (code, said) = run.end();
    assert_eq!(code, Some(0), "{said}");
    assert!(!said.contains("WARN"), "{said}");
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
