//! The desktop window, the real program under Xvfb: it shows the world, obeys keys, follows its size, survives a lost
//! session, and ends the program with exit code 0, without a word from the validation layers. Pictures of each step are
//! left in `target/tmp/desk/`.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

mod foreign_support;

use std::collections::BTreeSet;
use std::fs;
use std::io::{BufRead, BufReader};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use fathomless::address::Address;
use fathomless::at;
use fathomless::picture::{self, Pixels};
use fathomless::world::World;
use foreign_support::Stage;
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{ClientMessageEvent, ConnectionExt, EventMask, ImageFormat, Window};
use x11rb::rust_connection::RustConnection;

/// Longer than anything takes on a busy machine without a GPU.
const PATIENCE: Duration = Duration::from_secs(40);

/// A display of the test's own.
struct Screen {
    server: Child,
    name: String,
    x: RustConnection,
}

/// What a window shows: rows from the top, 3 bytes per pixel.
#[derive(Clone, PartialEq)]
struct Shot {
    size: [usize; 2],
    pixels: Vec<u8>,
}

/// The program in a window.
struct Run<'a> {
    screen: &'a Screen,
    program: Child,
    window: Window,
    said: PathBuf,
}

fn wait_for<T>(what: &str, mut ask: impl FnMut() -> Option<T>) -> T {
    let deadline = Instant::now() + PATIENCE;
    loop {
        if let Some(answer) = ask() {
            return answer;
        }
        assert!(Instant::now() < deadline, "not within {PATIENCE:?}: {what}");
        std::thread::sleep(Duration::from_millis(30));
    }
}

impl Screen {
    fn open() -> Screen {
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1280x800x24", "-nolisten", "tcp"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb is missing: run `sh setup.sh`, which installs it");
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        let name = format!(":{}", number.trim());
        let x = wait_for("the display answers", || RustConnection::connect(Some(&name)).ok()).0;
        Screen { server, name, x }
    }

    fn root(&self) -> Window {
        self.x.setup().roots[0].root
    }

    /// xdotool with these arguments.
    fn tool(&self, args: &[&str]) {
        let status = Command::new("xdotool").args(args).env("DISPLAY", &self.name).status();
        assert!(
            status.expect("xdotool is missing: run `sh setup.sh`, which installs it").success(),
            "{args:?}"
        );
    }

    fn atom(&self, name: &str) -> u32 {
        self.x.intern_atom(false, name.as_bytes()).unwrap().reply().unwrap().atom
    }

    fn title(&self, window: Window) -> Option<String> {
        let (name, kind) = (self.atom("_NET_WM_NAME"), self.atom("UTF8_STRING"));
        let reply = self.x.get_property(false, window, name, kind, 0, 1000).ok()?.reply().ok()?;
        Some(String::from_utf8_lossy(&reply.value).into_owned())
    }

    fn window(&self) -> Option<Window> {
        let all = self.x.query_tree(self.root()).unwrap().reply().unwrap().children;
        all.into_iter()
            .find(|window| self.title(*window).is_some_and(|title| title.starts_with("Fathomless")))
    }

    fn shot(&self, window: Window) -> Option<Shot> {
        let size = self.x.get_geometry(window).ok()?.reply().ok()?;
        let (width, height) = (size.width, size.height);
        let image =
            self.x.get_image(ImageFormat::Z_PIXMAP, window, 0, 0, width, height, !0).ok()?.reply().ok()?;
        let pixels = image.data.chunks_exact(4).flat_map(|p| [p[2], p[1], p[0]]).collect();
        Some(Shot { size: [width.into(), height.into()], pixels })
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

impl Shot {
    fn colours(&self) -> usize {
        self.pixels.chunks(3).collect::<BTreeSet<_>>().len()
    }

    /// Many colours, and not only at the edges.
    fn shows_something(&self) -> bool {
        let middle = self.columns(self.size[0] / 4..self.size[0] / 2);
        self.colours() > 300
            && middle.pixels.iter().filter(|byte| **byte == 0).count() * 4 < middle.pixels.len()
    }

    /// Many colours, and no part of it is black.
    fn shows_the_world(&self) -> bool {
        let [width, height] = self.size;
        let is_black = |x: usize, y: usize| self.pixels[3 * (y * width + x)..][..3] == [0; 3];
        let corners =
            [[0, 0], [width - 1, 0], [0, height - 1], [width - 1, height - 1], [width / 2, height / 2]];
        self.colours() > 300 && !corners.into_iter().any(|[x, y]| is_black(x, y))
    }

    /// Mean difference of a byte; 255 where the sizes are different.
    fn differs(&self, other: &Shot) -> f64 {
        if self.size != other.size {
            return 255.0;
        }
        let sum: u64 = self.pixels.iter().zip(&other.pixels).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
        sum as f64 / self.pixels.len() as f64
    }

    fn columns(&self, columns: Range<usize>) -> Shot {
        let [width, height] = self.size;
        let row = |y: usize| &self.pixels[3 * (y * width + columns.start)..3 * (y * width + columns.end)];
        Shot { size: [columns.len(), height], pixels: (0..height).flat_map(row).copied().collect() }
    }

    fn keep(&self, name: &str) {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("desk");
        fs::create_dir_all(&folder).unwrap();
        let size = self.size.map(|side| side as u32);
        picture::write(&folder.join(format!("{name}.png")), size, Pixels::Rgb8(&self.pixels), &[]).unwrap();
    }
}

impl<'a> Run<'a> {
    /// The program in a folder, with what it says in a file there.
    fn new(screen: &'a Screen, folder: &Path, args: &[&str]) -> Run<'a> {
        let said = folder.join("said");
        let file = fs::File::create(&said).unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_fathomless"));
        command.args(args).current_dir(folder).stdin(Stdio::null());
        command.stdout(file.try_clone().unwrap()).stderr(file);
        for name in ["RUST_LOG", "XR_RUNTIME_JSON", "FATHOMLESS_GPU"] {
            command.env_remove(name);
        }
        command.env("XDG_CONFIG_HOME", folder.join("none")).env("FATHOMLESS_DATA_DIR", folder.join("data"));
        Run::of(screen, command, said)
    }

    fn of(screen: &'a Screen, mut command: Command, said: PathBuf) -> Run<'a> {
        let program = command.env_remove("WAYLAND_DISPLAY").env("DISPLAY", &screen.name).spawn().unwrap();
        let mut run = Run { screen, program, window: 0, said };
        run.window = wait_for("a window", || {
            run.assert_runs();
            screen.window()
        });
        run.until("the world is seen", Shot::shows_something);
        // There is no window manager to do it.
        screen.tool(&["windowfocus", "--sync", &run.window.to_string()]);
        run
    }

    fn assert_runs(&mut self) {
        let ended = self.program.try_wait().unwrap();
        assert!(ended.is_none(), "{ended:?}: {}", fs::read_to_string(&self.said).unwrap());
    }

    /// The first picture that is like this.
    fn until(&mut self, what: &str, is: impl Fn(&Shot) -> bool) -> Shot {
        wait_for(what, || {
            self.assert_runs();
            let shot = self.screen.shot(self.window)?;
            shot.keep(&format!("last{}", self.screen.name.replace(':', "-")));
            is(&shot).then_some(shot)
        })
    }

    /// The picture, when it has come to rest.
    fn still(&mut self) -> Shot {
        let mut before = None;
        wait_for("rest", || {
            std::thread::sleep(Duration::from_millis(800));
            let now = self.until("a picture", |_| true);
            let title = self.screen.title(self.window)?;
            let rests = before.as_ref().is_some_and(|before| now.differs(before) < 0.1);
            before = Some(now.clone());
            (rests && title.contains(" 0.00 of ")).then_some(now)
        })
    }

    fn title_until(&mut self, what: &str, is: impl Fn(&str) -> bool) -> String {
        wait_for(what, || {
            self.assert_runs();
            self.screen.title(self.window).filter(|title| is(title))
        })
    }

    fn key(&self, action: &str, key: &str) {
        self.screen.tool(&[action, key]);
    }

    fn resize(&self, [width, height]: [u32; 2]) {
        let words = [self.window, width, height].map(|number| number.to_string());
        self.screen.tool(&["windowsize", &words[0], &words[1], &words[2]]);
    }

    /// What a window manager does when somebody clicks the cross.
    fn close(&self) {
        let data = [self.screen.atom("WM_DELETE_WINDOW"), 0, 0, 0, 0];
        let event = ClientMessageEvent::new(32, self.window, self.screen.atom("WM_PROTOCOLS"), data);
        self.screen.x.send_event(false, self.window, EventMask::NO_EVENT, event).unwrap().check().unwrap();
    }

    /// The program's exit code and what it said.
    fn end(mut self) -> (Option<i32>, String) {
        let status = wait_for("the program's end", || self.program.try_wait().unwrap());
        (status.code(), fs::read_to_string(&self.said).unwrap())
    }
}

impl Drop for Run<'_> {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

fn depth(title: &str) -> f64 {
    let (_, rest) = title.split_once("depth ").unwrap_or_else(|| panic!("{title}"));
    rest.split_whitespace().next().unwrap().parse().unwrap_or_else(|_| panic!("{title}"))
}

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
