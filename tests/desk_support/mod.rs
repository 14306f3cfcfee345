//! A display of a test's own with the program in a window, seen and used as a person does.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]
#![allow(dead_code, reason = "each test uses a part of it")]

use std::collections::BTreeSet;
use std::fs;
use std::io::{BufRead, BufReader};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use fathomless::picture::{self, Pixels};
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{ClientMessageEvent, ConnectionExt, EventMask, ImageFormat, Window};
use x11rb::rust_connection::RustConnection;

/// Longer than anything takes on a busy machine without a GPU.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// Options by which a program leaves a line per frame in its folder, for [`Run::column`].
pub const STATS: [&str; 2] = ["--stats", "frames.csv"];

/// Lines by which that file is behind the frames, at most, where the disk takes them.
const BEHIND: usize = 10;

/// A display of the test's own.
pub struct Screen {
    server: Child,
    pub name: String,
    pub x: RustConnection,
}

/// What a window shows: rows from the top, 3 bytes per pixel.
#[derive(Clone, PartialEq)]
pub struct Shot {
    pub size: [usize; 2],
    pub pixels: Vec<u8>,
}

/// The program in a window, with [`STATS`] among its options.
pub struct Run<'a> {
    pub screen: &'a Screen,
    program: Child,
    pub window: Window,
    /// Pixels of the window as it opened.
    pub opened: [u16; 2],
    /// What it says; what else it writes is beside that.
    pub said: PathBuf,
}

pub fn wait_for<T>(what: &str, mut ask: impl FnMut() -> Option<T>) -> T {
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
    pub fn open() -> Screen {
        Screen::of_size([1280, 800])
    }

    pub fn of_size([width, height]: [u32; 2]) -> Screen {
        let size = format!("{width}x{height}x24");
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", &size, "-nolisten", "tcp"])
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

    pub fn root(&self) -> Window {
        self.x.setup().roots[0].root
    }

    /// xdotool with these arguments.
    pub fn tool(&self, args: &[&str]) {
        let status = Command::new("xdotool").args(args).env("DISPLAY", &self.name).status();
        assert!(
            status.expect("xdotool is missing: run `sh setup.sh`, which installs it").success(),
            "{args:?}"
        );
    }

    pub fn atom(&self, name: &str) -> u32 {
        self.x.intern_atom(false, name.as_bytes()).unwrap().reply().unwrap().atom
    }

    pub fn title(&self, window: Window) -> Option<String> {
        let (name, kind) = (self.atom("_NET_WM_NAME"), self.atom("UTF8_STRING"));
        let reply = self.x.get_property(false, window, name, kind, 0, 1000).ok()?.reply().ok()?;
        Some(String::from_utf8_lossy(&reply.value).into_owned())
    }

    pub fn window(&self) -> Option<Window> {
        let all = self.x.query_tree(self.root()).unwrap().reply().unwrap().children;
        all.into_iter()
            .find(|window| self.title(*window).is_some_and(|title| title.starts_with("Fathomless")))
    }

    /// Pixels of a window.
    fn size(&self, window: Window) -> Option<[u16; 2]> {
        let size = self.x.get_geometry(window).ok()?.reply().ok()?;
        Some([size.width, size.height])
    }

    pub fn shot(&self, window: Window) -> Option<Shot> {
        let size = self.x.get_geometry(window).ok()?.reply().ok()?;
        let (width, height) = (size.width, size.height);
        let image =
            self.x.get_image(ImageFormat::Z_PIXMAP, window, 0, 0, width, height, !0).ok()?.reply().ok()?;
        let pixels = image.data.chunks_exact(4).flat_map(|p| [p[2], p[1], p[0]]).collect();
        Some(Shot { size: [width.into(), height.into()], pixels })
    }
}

impl Screen {
    /// From now on it reads and answers nothing, until it goes on.
    pub fn stop(&self) {
        self.signal("-STOP");
    }

    pub fn go_on(&self) {
        self.signal("-CONT");
    }

    fn signal(&self, signal: &str) {
        let status = Command::new("kill").args([signal, &self.server.id().to_string()]).status();
        assert!(status.unwrap().success());
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

impl Shot {
    pub fn colours(&self) -> usize {
        self.pixels.chunks(3).collect::<BTreeSet<_>>().len()
    }

    /// Many colours, and not only at the edges.
    pub fn shows_something(&self) -> bool {
        let middle = self.columns(self.size[0] / 4..self.size[0] / 2);
        self.colours() > 300
            && middle.pixels.iter().filter(|byte| **byte == 0).count() * 4 < middle.pixels.len()
    }

    /// Many colours, and no part of it is black.
    pub fn shows_the_world(&self) -> bool {
        let [width, height] = self.size;
        let is_black = |x: usize, y: usize| self.pixels[3 * (y * width + x)..][..3] == [0; 3];
        let corners =
            [[0, 0], [width - 1, 0], [0, height - 1], [width - 1, height - 1], [width / 2, height / 2]];
        self.colours() > 300 && !corners.into_iter().any(|[x, y]| is_black(x, y))
    }

    /// Mean difference of a byte; 255 where the sizes are different.
    pub fn differs(&self, other: &Shot) -> f64 {
        if self.size != other.size {
            return 255.0;
        }
        let sum: u64 = self.pixels.iter().zip(&other.pixels).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
        sum as f64 / self.pixels.len() as f64
    }

    pub fn columns(&self, columns: Range<usize>) -> Shot {
        let [width, height] = self.size;
        let row = |y: usize| &self.pixels[3 * (y * width + columns.start)..3 * (y * width + columns.end)];
        Shot { size: [columns.len(), height], pixels: (0..height).flat_map(row).copied().collect() }
    }

    /// The middle of it, such a share each way, as large as the whole.
    pub fn middle(&self, share: f64) -> Shot {
        let [width, height] = self.size;
        let from = |at: usize, side: usize| {
            let middle = side as f64 / 2.0;
            (middle + (at as f64 + 0.5 - middle) * share) as usize
        };
        let pixel = |x: usize, y: usize| &self.pixels[3 * (from(y, height) * width + from(x, width))..][..3];
        let all = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        Shot { size: self.size, pixels: all.flat_map(|(x, y)| pixel(x, y)).copied().collect() }
    }

    /// Leaves the picture in `target/tmp/`, in a folder named after the test's file.
    pub fn keep(&self, name: &str) {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(env!("CARGO_CRATE_NAME"));
        fs::create_dir_all(&folder).unwrap();
        let size = self.size.map(|side| side as u32);
        picture::write(&folder.join(format!("{name}.png")), size, Pixels::Rgb8(&self.pixels), &[]).unwrap();
    }
}

impl<'a> Run<'a> {
    /// The program in a folder, with what it says in a file there.
    pub fn new(screen: &'a Screen, folder: &Path, args: &[&str]) -> Run<'a> {
        Run::with(screen, folder, args, &[])
    }

    /// The same with environment variables.
    pub fn with(screen: &'a Screen, folder: &Path, args: &[&str], set: &[(&str, &str)]) -> Run<'a> {
        let said = folder.join("said");
        let file = fs::File::create(&said).unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_fathomless"));
        command.args(args).args(STATS).current_dir(folder).stdin(Stdio::null());
        command.stdout(file.try_clone().unwrap()).stderr(file);
        for name in ["RUST_LOG", "XR_RUNTIME_JSON", "FATHOMLESS_GPU"] {
            command.env_remove(name);
        }
        command.env("XDG_CONFIG_HOME", folder.join("none")).env("FATHOMLESS_DATA_DIR", folder.join("data"));
        command.env_remove("FATHOMLESS_WINDOW").envs(set.iter().copied());
        Run::of(screen, command, said)
    }

    pub fn of(screen: &'a Screen, mut command: Command, said: PathBuf) -> Run<'a> {
        let program = command.env_remove("WAYLAND_DISPLAY").env("DISPLAY", &screen.name).spawn().unwrap();
        let mut run = Run { screen, program, window: 0, opened: [0; 2], said };
        run.window = wait_for("a window", || {
            run.assert_runs();
            screen.window()
        });
        run.opened = wait_for("its size", || screen.size(run.window));
        // The fewer pixels, the faster a processor draws them.
        run.resize([480, 300]);
        run.until("the world is seen", Shot::shows_something);
        // There is no window manager to do it.
        screen.tool(&["windowfocus", "--sync", &run.window.to_string()]);
        run
    }

    pub fn assert_runs(&mut self) {
        let ended = self.program.try_wait().unwrap();
        assert!(ended.is_none(), "{ended:?}: {}", fs::read_to_string(&self.said).unwrap());
    }

    /// The first picture that is like this.
    pub fn until(&mut self, what: &str, is: impl Fn(&Shot) -> bool) -> Shot {
        wait_for(what, || {
            self.assert_runs();
            let shot = self.screen.shot(self.window)?;
            shot.keep(&format!("last{}", self.screen.name.replace(':', "-")));
            is(&shot).then_some(shot)
        })
    }

    /// The picture, when it has come to rest.
    pub fn still(&mut self) -> Shot {
        self.rests(|run, before| {
            let now = run.until("a picture", |_| true);
            let title = run.screen.title(run.window).unwrap_or_default();
            let rests = before.is_some_and(|before| now.differs(before) < 0.1) && title.contains(" 0.00 of ");
            (now, rests)
        })
    }

    /// What is seen, once it counts as at rest beside what was seen some frames and a while before.
    pub fn rests<T>(&mut self, mut see: impl FnMut(&mut Self, Option<&T>) -> (T, bool)) -> T {
        let mut before = None;
        wait_for("rest", || {
            // What moves slowly moves visibly in this time; what moves with the frames, in so many of them.
            std::thread::sleep(Duration::from_millis(700));
            self.frames_later(5);
            let (now, rests) = see(self, before.as_ref());
            before = Some(now);
            before.take_if(|_| rests)
        })
    }

    /// A column of the lines so far that are whole.
    pub fn column(&self, name: &str) -> Vec<f64> {
        let text = fs::read_to_string(self.said.with_file_name(STATS[1])).unwrap_or_default();
        let mut lines = text.split_inclusive('\n').filter(|line| line.ends_with('\n'));
        let head = lines.next().unwrap_or_default().trim();
        let Some(column) = head.split(',').position(|it| it == name) else { return Vec::new() };
        lines.map(|line| line.trim().split(',').nth(column).unwrap().parse().unwrap()).collect()
    }

    /// Waits until so many frames more are drawn, begun after this was asked. The number of lines there are then.
    pub fn frames_later(&mut self, more: usize) -> usize {
        let now = self.column("frame").len();
        wait_for("more frames", || {
            self.assert_runs();
            let then = self.column("frame").len();
            (then >= now + more + BEHIND).then_some(then)
        })
    }

    /// Presses the mouse's main button at a pixel of the window, and lets it go. The program hears of events in their
    /// order: whatever is done next comes after it.
    pub fn click(&self, at: [i32; 2]) {
        self.point_and(at, &["click", "1"]);
    }

    /// Moves the mouse to a pixel of the window, and does what xdotool's further words say there.
    pub fn point_and(&self, [x, y]: [i32; 2], then: &[&str]) {
        let words = [self.window.to_string(), x.to_string(), y.to_string()];
        let point = ["mousemove", "--window", &words[0], &words[1], &words[2]];
        self.screen.tool(&[&point[..], then].concat());
    }

    /// Takes the window off the screen for some frames.
    pub fn hide_for_a_while(&mut self) {
        let window = self.window.to_string();
        self.screen.tool(&["windowunmap", &window]);
        self.frames_later(5);
        self.screen.tool(&["windowmap", &window]);
    }

    pub fn title_until(&mut self, what: &str, is: impl Fn(&str) -> bool) -> String {
        wait_for(what, || {
            self.assert_runs();
            self.screen.title(self.window).filter(|title| is(title))
        })
    }

    pub fn key(&self, action: &str, key: &str) {
        self.screen.tool(&[action, key]);
    }

    pub fn resize(&self, [width, height]: [u32; 2]) {
        let words = [self.window, width, height].map(|number| number.to_string());
        self.screen.tool(&["windowsize", &words[0], &words[1], &words[2]]);
    }

    /// Takes many sizes, too small ones and fast changes among them, and shows the world in each that lasts.
    pub fn resizes(&mut self, name: &str) {
        for (i, size) in [[300, 500], [1, 1], [700, 120], [2, 400], [640, 400]].into_iter().enumerate() {
            for step in 0..3u32 {
                self.resize(size.map(|side| side + 7 * step));
            }
            self.resize(size);
            let is_that = |shot: &Shot| shot.size == size.map(|side| side as usize);
            if size.into_iter().min() < Some(100) {
                self.frames_later(5);
            } else {
                self.until("a picture of that size", |shot| is_that(shot) && shot.shows_the_world())
                    .keep(&format!("{name}_size_{i}"));
            }
        }
    }

    /// What a window manager does when somebody clicks the cross.
    pub fn close(&self) {
        let data = [self.screen.atom("WM_DELETE_WINDOW"), 0, 0, 0, 0];
        let event = ClientMessageEvent::new(32, self.window, self.screen.atom("WM_PROTOCOLS"), data);
        self.screen.x.send_event(false, self.window, EventMask::NO_EVENT, event).unwrap().check().unwrap();
    }

    /// Asks it to end, as Ctrl-C does.
    pub fn terminate(&self) {
        let status = Command::new("kill").args(["-TERM", &self.program.id().to_string()]).status();
        assert!(status.unwrap().success());
    }

    /// The program's exit code and what it said.
    pub fn end(mut self) -> (Option<i32>, String) {
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

/// Octaves, from the window's title.
pub fn depth(title: &str) -> f64 {
    let (_, rest) = title.split_once("depth ").unwrap_or_else(|| panic!("{title}"));
    rest.split_whitespace().next().unwrap().parse().unwrap_or_else(|_| panic!("{title}"))
}
