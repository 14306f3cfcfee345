//! The panels: laid out without a window, every option asks for what it says; in the real program under Xvfb they are
//! opened, used, resized, hidden and closed, without a word from the validation layers. Pictures of each step are left in
//! `target/tmp/panels/`.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

mod desk_support;
mod support;

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use ash::vk;
use desk_support::{Run, Screen, Shot, depth, wait_for};
use egui::accesskit::{Node, Role};
use egui::{Event, Modifiers, OutputCommand, PointerButton, Pos2, RawInput, Rect, ViewportId, pos2, vec2};
use fathomless::gpu::{Access, Buffer, BufferInfo, Gpu, Location, Transition};
use fathomless::inspect::{BackdropView, Inspect, SWITCHES, SurfaceView};
use fathomless::panels::{Facts, Feed, Moment, Painted, Panels, Report, Tuning, Wish, key_lines};
use fathomless::picture;
use fathomless::quality::Fineness;
use fathomless::render::PanelPass;
use fathomless::settings::{Settings, Side, entries};
use fathomless::telemetry::{Cost, Memory, Row, Span, Stopwatch, Work};
use fathomless::world::{Sun, World};
use x11rb::connection::Connection;
use x11rb::protocol::Event as XEvent;
use x11rb::protocol::xproto::{ConnectionExt, CreateWindowAux, WindowClass};

/// Panels without a window, laid out like those in one of the same size, and clicked on like them.
struct Twin {
    panels: Panels,
    feed: Feed,
    /// Pixels of the window, and pixels per point.
    size: [u32; 2],
    scale: f32,
    nodes: Vec<Node>,
    /// How soon the last picture would look different by itself.
    again_in: Duration,
    now_s: f64,
}

impl Twin {
    fn new(size: [u32; 2]) -> Twin {
        Twin::scaled(size, 1.0)
    }

    fn scaled(size: [u32; 2], scale: f32) -> Twin {
        let (panels, feed) = Panels::new(key_lines(&Settings::default()));
        panels.context().enable_accesskit();
        feed.tell(Report::Facts(Box::new(facts())));
        feed.tell(Report::Frame(moment(0)));
        let mut twin =
            Twin { panels, feed, size, scale, nodes: Vec::new(), again_in: Duration::ZERO, now_s: 0.0 };
        twin.see(Vec::new());
        twin.see(Vec::new());
        twin
    }

    /// A picture after these events.
    fn see(&mut self, events: Vec<Event>) -> Painted {
        self.look(events).0
    }

    /// The same, and what the platform is to do.
    fn look(&mut self, events: Vec<Event>) -> (Painted, Vec<OutputCommand>) {
        // A press and its release are a click, two clicks not a double one.
        self.now_s += 0.1;
        let [width, height] = self.size.map(|side| side as f32 / self.scale);
        let mut input = RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, vec2(width, height))),
            time: Some(self.now_s),
            focused: true,
            events,
            ..RawInput::default()
        };
        input.viewports.entry(ViewportId::ROOT).or_default().native_pixels_per_point = Some(self.scale);
        let outcome = self.panels.paint(input, self.size);
        let update = outcome.output.accesskit_update.expect("a tree of what is there");
        self.nodes = update.nodes.into_iter().map(|(_, node)| node).collect();
        self.again_in = outcome.again_in;
        (outcome.painted, outcome.output.commands)
    }

    fn find(&self, what: &str, is: impl Fn(&Node) -> bool) -> Pos2 {
        let found: Vec<_> = self.nodes.iter().filter(|node| is(node)).filter_map(Node::bounds).collect();
        assert_eq!(found.len(), 1, "{what}: {found:?}");
        pos2(((found[0].x0 + found[0].x1) / 2.0) as f32, ((found[0].y0 + found[0].y1) / 2.0) as f32)
    }

    /// Where a check box or a button of this label is.
    fn at(&self, label: &str) -> Pos2 {
        let clickable = [Role::CheckBox, Role::Button, Role::ComboBox];
        self.find(label, |node| node.label() == Some(label) && clickable.contains(&node.role()))
    }

    /// Where it begins, and the middle of its height, in pixels of a window that is not scaled.
    fn start_of(&self, label: &str) -> [usize; 2] {
        let is = |node: &&Node| node.label() == Some(label) && node.role() == Role::CheckBox;
        let bounds = self.nodes.iter().find(is).and_then(Node::bounds).unwrap_or_else(|| panic!("{label}"));
        [bounds.x0 as usize, ((bounds.y0 + bounds.y1) / 2.0) as usize]
    }

    /// Where something on the left is that has these words before it.
    fn beside(&self, words: &str, right: f32) -> Pos2 {
        let is_left = |node: &Node| node.bounds().is_some_and(|bounds| bounds.x0 < 216.0);
        let is = |node: &Node| node.role() == Role::Label && node.value() == Some(words) && is_left(node);
        let at = self.find(words, is);
        pos2(right, at.y)
    }

    fn press(&mut self, at: Pos2) {
        let button = |pressed| Event::PointerButton {
            pos: at,
            button: PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        };
        self.see(vec![Event::PointerMoved(at)]);
        self.see(vec![button(true)]);
        self.see(vec![button(false)]);
        self.see(Vec::new());
    }

    /// Whether this may be chosen.
    fn offers(&mut self, words: &str, choice: &str) -> bool {
        let combo = self.beside(words, 140.0);
        self.press(combo);
        let offered =
            self.nodes.iter().any(|node| node.role() == Role::Button && node.label() == Some(choice));
        self.press(combo);
        offered
    }

    fn wishes(&self) -> Vec<Wish> {
        std::iter::from_fn(|| self.feed.wish()).collect()
    }

    /// Clicks on the last of these that comes up after the ones before it are clicked: where each was.
    fn choose(&mut self, words: &str, choice: &str) -> [Pos2; 2] {
        let combo = self.beside(words, 140.0);
        self.press(combo);
        let item = self.at(choice);
        self.press(item);
        [combo, item]
    }
}

const FINENESS: Fineness = Fineness { split: 2.6, down: 3, cells: 32, mesh: 16, samples: 1 };
const TUNING: Tuning = Tuning { fineness: FINENESS, tile_ms: 2.0, bake_ms: 12.0 };

fn facts() -> Facts {
    let world = World::load("canyonlands").unwrap();
    Facts {
        world: world.name,
        title: world.title,
        seed: 42,
        sun: Sun { azimuth_deg: 125.0, elevation_deg: 32.0 },
        device: "a GPU".into(),
        eye_size: [640, 400],
        tuning: TUNING,
        by_settings: TUNING,
        side_by_settings: Side::Left,
        samples: vec![1, 4],
        inspect: Inspect::default(),
        vignette: None,
    }
}

fn moment(serial: u64) -> Moment {
    let mut row =
        Row { serial, frame_ms: 11.0 + (serial % 7) as f64, depth: 0.01 * serial as f64, ..Row::default() };
    for span in Span::ALL {
        row.spans.add(span, Cost { cpu_ms: 0.3, wall_ms: 0.5 + (serial % 3) as f64, allocations: 0 });
    }
    ["tiles", "bake", "terrain", "mirror"].into_iter().for_each(|pass| row.passes.add(pass, 1.5));
    Moment { row, speed: Some([0.5, 1.5]), side: Side::Left }
}

#[test]
fn every_option_asks_for_what_it_says_and_for_nothing_else() {
    let mut twin = Twin::new([1280, 800]);
    for switch in SWITCHES {
        let mut changed = Inspect::default();
        switch.set(&mut changed, !switch.usual());
        twin.press(twin.at(switch.label));
        assert_eq!(twin.wishes(), [Wish::Inspect(changed)], "{}", switch.label);
        twin.press(twin.at(switch.label));
        assert_eq!(twin.wishes(), [Wish::Inspect(Inspect::default())], "{}", switch.label);
    }
    for choice in SurfaceView::CHOICES.into_iter().skip(1) {
        twin.choose("Ground", choice.label);
        let changed = Inspect { surface: choice.value, ..Inspect::default() };
        assert_eq!(twin.wishes(), [Wish::Inspect(changed)], "{}", choice.label);
    }
    twin.press(twin.at("All as usual"));
    assert_eq!(twin.wishes(), [Wish::Inspect(Inspect::default())]);
    for choice in BackdropView::CHOICES.into_iter().skip(1) {
        twin.choose("Backdrop", choice.label);
        let changed = Inspect { backdrop: choice.value, ..Inspect::default() };
        assert_eq!(twin.wishes(), [Wish::Inspect(changed)], "{}", choice.label);
    }
    twin.press(twin.at("All as usual"));
    twin.wishes();
    twin.press(twin.at("A single octave"));
    assert_eq!(twin.wishes(), [Wish::Inspect(Inspect { octave: Some(0), ..Inspect::default() })]);
}

/// What spares a wearer's stomach is off in one click, where there is a wearer.
#[test]
fn the_wearers_vignette_is_on_or_off() {
    let mut twin = Twin::new([1280, 800]);
    let is_there = |twin: &Twin| twin.nodes.iter().any(|node| node.label() == Some("Vignette"));
    assert!(!is_there(&twin), "nobody wears a headset");
    for on in [true, false] {
        twin.feed.tell(Report::Facts(Box::new(Facts { vignette: Some(on), ..facts() })));
        twin.see(Vec::new());
        twin.see(Vec::new());
        twin.press(twin.at("Vignette"));
        assert_eq!(twin.wishes(), [Wish::Vignette(!on)]);
    }
}

#[test]
fn worlds_light_quality_and_the_address_are_asked_for() {
    let mut twin = Twin::new([1280, 800]);
    twin.choose("Name", "hills");
    assert_eq!(twin.wishes(), [Wish::World { name: "hills".into(), seed: None }]);

    twin.press(twin.beside("Seed", 100.0));
    assert!(twin.panels.context().egui_wants_keyboard_input());
    let key = |key| Event::Key {
        key,
        physical_key: None,
        pressed: true,
        repeat: false,
        modifiers: Modifiers::NONE,
    };
    twin.see(vec![key(egui::Key::End), Event::Text("7".into())]);
    twin.see(vec![key(egui::Key::Enter)]);
    assert_eq!(twin.wishes(), [Wish::World { name: "hills".into(), seed: Some(427) }]);
    assert!(!twin.panels.context().egui_wants_keyboard_input());

    twin.press(twin.beside("From", 90.0));
    let wishes = twin.wishes();
    let lit = |wish: &Wish| matches!(wish, Wish::Sun { sun, .. } if sun.azimuth_deg < 120.0 && sun.elevation_deg == 32.0);
    assert!(!wishes.is_empty() && wishes.iter().all(lit), "{wishes:?}");
    assert!(matches!(wishes.last(), Some(Wish::Sun { settled: true, .. })), "{wishes:?}");
    twin.press(twin.at("The world's own light"));
    let own = Wish::Sun { sun: facts().sun, settled: true };
    assert_eq!(twin.wishes(), [own]);

    twin.press(twin.beside("Split", 130.0));
    let wishes = twin.wishes();
    let Some(Wish::Tuning(tuning)) = wishes.last() else { panic!("{wishes:?}") };
    let split = tuning.fineness.split;
    assert_eq!(tuning.fineness, Fineness { split, ..FINENESS });
    assert!(wishes.len() == 1 && split > 2.7, "{wishes:?}");

    // Each of these is of a picture without the change before: the flight did not answer it.
    for (words, choice, fineness) in [
        ("Cells", "128", Fineness { cells: 128, ..FINENESS }),
        ("Mesh", "8", Fineness { mesh: 8, ..FINENESS }),
        ("Samples", "4", Fineness { samples: 4, ..FINENESS }),
        // A mesh has no more squares than there are data.
        ("Cells", "16", Fineness { cells: 16, ..FINENESS }),
    ] {
        twin.feed.tell(Report::Facts(Box::new(facts())));
        twin.see(Vec::new());
        twin.choose(words, choice);
        let tuning = Tuning { fineness, ..facts().tuning };
        assert_eq!(twin.wishes(), [Wish::Tuning(tuning)], "{words}");
    }
    assert!(!twin.offers("Samples", "2"), "the device cannot");
    assert!(!twin.offers("Mesh", "32"), "more than there are data");

    twin.feed.tell(Report::Frame(moment(1)));
    twin.see(Vec::new());
    twin.press(twin.at("Copy address"));
    assert_eq!(twin.wishes(), [Wish::CopyAddress]);
}

#[test]
fn what_is_drawn_can_be_saved_where_it_is_not_what_the_settings_say() {
    let mut twin = Twin::new([1280, 800]);
    let save = |twin: &mut Twin, tuning| {
        twin.feed.tell(Report::Facts(Box::new(Facts { tuning, ..facts() })));
        twin.see(Vec::new());
        twin.press(twin.at("Save"));
        twin.wishes()
    };
    assert_eq!(save(&mut twin, TUNING), []);
    let tuning = Tuning { fineness: Fineness { split: 3.5, samples: 4, ..FINENESS }, bake_ms: 4.0, ..TUNING };
    assert_eq!(save(&mut twin, tuning), [Wish::Save]);
    assert_eq!(
        tuning.changes(&TUNING),
        [("quality.split", 3.5.into()), ("quality.samples", 4.into()), ("quality.bake_ms", 4.0.into())]
    );
    assert_eq!(save(&mut twin, TUNING), []);
    twin.choose("Window", "Both eyes");
    assert_eq!(twin.wishes(), [Wish::Side(Side::Both)]);
    twin.feed.tell(Report::Frame(Moment { side: Side::Both, ..moment(2) }));
    assert_eq!(save(&mut twin, TUNING), [Wish::Save]);
    let known = entries().iter().map(|entry| entry.path.as_str()).collect::<Vec<_>>();
    let nothing = Fineness { split: 0.0, down: 0, cells: 0, mesh: 0, samples: 0 };
    let all = Tuning { fineness: nothing, tile_ms: 0.0, bake_ms: 0.0 }.changes(&TUNING);
    assert_eq!(all.len(), 7);
    assert!(all.iter().all(|(path, _)| known.contains(path)), "{all:?}");
}

#[test]
fn help_names_the_keys_that_there_are_now() {
    let mut twin = Twin::new([1280, 800]);
    let says = |twin: &Twin, words: &str| {
        twin.nodes.iter().any(|node| node.value().is_some_and(|value| value.contains(words)))
    };
    assert!(says(&twin, "F1 hides the panels."));
    twin.press(twin.at("?"));
    assert!(says(&twin, "F1"));
    // What is folded up makes room.
    twin.press(twin.at("Keys"));
    twin.press(twin.at("What am I looking at?"));
    assert!(says(&twin, "Hold Z over a rock") && says(&twin, "Hold X to come back"));
    let keys = "panels = ['F3', 'Tab']\ndive = 'Enter'";
    let mut settings = Settings { keys: toml::from_str(keys).unwrap(), ..Settings::default() };
    twin.feed.tell(Report::Keys(key_lines(&settings)));
    twin.see(Vec::new());
    twin.press(twin.at("Keys"));
    assert!(says(&twin, "F3 hides the panels.") && says(&twin, "F3 Tab") && !says(&twin, "F1"));
    // Where no key does it, a button does.
    assert!(says(&twin, "Hold Enter over a rock") && says(&twin, "Hold left_trigger to come back"));
    settings.keys = toml::from_str("").unwrap();
    settings.gamepad.buttons = toml::from_str("").unwrap();
    twin.feed.tell(Report::Keys(key_lines(&settings)));
    twin.see(Vec::new());
    assert!(!says(&twin, "hides the panels") && says(&twin, "Hold (no key) over"));
}

#[test]
fn what_is_told_while_nobody_looks_is_not_lost() {
    let mut twin = Twin::new([1280, 800]);
    (0..1000).for_each(|serial| twin.feed.tell(Report::Frame(moment(serial))));
    twin.feed.tell(Report::Facts(Box::new(Facts { title: "elsewhere".into(), ..facts() })));
    twin.feed.tell(Report::Address { text: "to be pasted".into(), copy: true });
    (0..1000).for_each(|serial| twin.feed.tell(Report::Frame(moment(serial))));
    let commands = twin.look(Vec::new()).1;
    let copied =
        commands.iter().any(|it| matches!(it, OutputCommand::CopyText(text) if text == "to be pasted"));
    assert!(copied, "{commands:?}");
    assert!(twin.nodes.iter().any(|node| node.value() == Some("elsewhere")));
}

#[test]
fn panels_that_nobody_touches_ask_for_no_picture_before_its_time() {
    let mut twin = Twin::new([1280, 800]);
    twin.feed.tell(Report::Frame(moment(0)));
    (0..5).for_each(|_| drop(twin.see(Vec::new())));
    for serial in 1..50 {
        twin.feed.tell(Report::Frame(moment(serial)));
        twin.see(Vec::new());
        assert!(twin.again_in > Duration::from_millis(66), "{serial}: {:?}", twin.again_in);
    }
}

/// A frame with numbers as long as they get.
fn great_moment(serial: u64) -> Moment {
    let mut great = moment(serial);
    let row = &mut great.row;
    (row.frame_ms, row.depth, row.headroom, row.parallax) = (12_345.6, 1_234_567.0, 1.0, 0.999);
    let (many, huge) = (99_999, 99_999_999);
    row.work = Work { tiles_drawn: 9_999, tiles_made: 9_999, tiles_waiting: 9_999, ..row.work };
    row.work = Work { triangles: huge, nodes: huge, draws: many, texels_baked: huge, ..row.work };
    let bytes = 99_999 << 20;
    row.memory = Memory { rss_bytes: bytes, gpu_bytes: bytes, heap_bytes: 999 << 20, path_bytes: huge };
    Span::ALL.into_iter().for_each(|span| {
        row.spans.add(span, Cost { cpu_ms: 12_345.0, wall_ms: 12_345.0, allocations: 0 });
    });
    great.speed = Some([7.99, 8.0]);
    great
}

#[test]
fn nothing_is_cut_off_in_a_window_of_1280_by_720_points_at_any_scale() {
    let gpu = support::gpu();
    for scale in [1.0, 1.5, 2.0f32] {
        let size = [1280.0, 720.0].map(|side: f32| (side * scale) as u32);
        let mut twin = Twin::scaled(size, scale);
        for (what, moment) in [("usual", moment as fn(u64) -> Moment), ("great", great_moment)] {
            for serial in 0..400 {
                twin.feed.tell(Report::Frame(moment(serial)));
                if serial % 50 == 0 {
                    twin.see(Vec::new());
                }
            }
            let text = "fathomless:1:canyonlands.".to_owned() + &"abc".repeat(1000);
            twin.feed.tell(Report::Address { text, copy: false });
            twin.see(Vec::new());
            let painted = twin.see(Vec::new());
            let has_words = |node: &&Node| node.label().or(node.value()).is_some();
            let seen: Vec<_> =
                twin.nodes.iter().filter(has_words).filter(|node| node.bounds().is_some()).collect();
            assert!(seen.len() > 100, "{}", seen.len());
            for node in seen {
                let bounds = node.bounds().unwrap();
                let inside = [0.0..=216.0, 988.0..=1280.0]
                    .into_iter()
                    .any(|panel| panel.contains(&bounds.x0) && panel.contains(&bounds.x1));
                assert!(inside && bounds.y0 >= 0.0 && bounds.y1 <= 720.0, "{scale} {what}: {node:?}");
            }
            let mut pass = PanelPass::new(&gpu).unwrap();
            pass.draw(&painted).unwrap();
            keep(&format!("scaled_{scale}_{what}"), size, &read(&gpu, &pass));
        }
    }
    support::assert_clean(gpu);
}

#[test]
fn what_is_behind_a_panel_is_known_and_the_rest_is_free() {
    let mut twin = Twin::new([1000, 700]);
    assert!(twin.panels.covers(pos2(10.0, 300.0)) && twin.panels.covers(pos2(990.0, 300.0)));
    assert!(!twin.panels.covers(pos2(450.0, 300.0)));
    twin.press(twin.at("?"));
    assert!(twin.panels.covers(pos2(450.0, 200.0)), "the help is over it");
    // Sizes that nothing fits into.
    for size in [[1, 1], [30, 500], [400, 20]] {
        twin.size = size;
        twin.see(Vec::new());
    }
}

/// Prints what the panels cost; run it with `--release -- --nocapture` to know.
#[test]
fn a_picture_of_the_panels_is_painted_of_all_that_is_known() {
    let mut twin = Twin::new([1280, 800]);
    for serial in 1..=400 {
        twin.feed.tell(Report::Frame(moment(serial)));
        twin.feed.tell(Report::Address { text: format!("fathomless:1:{serial}"), copy: false });
        twin.see(Vec::new());
    }
    let painted = twin.see(Vec::new());
    let meshes = painted.primitives.iter().filter_map(|clipped| match &clipped.primitive {
        egui::epaint::Primitive::Mesh(mesh) => Some(mesh),
        egui::epaint::Primitive::Callback(_) => None,
    });
    let (triangles, foreign) = meshes.fold((0, 0), |(triangles, foreign), mesh| {
        (triangles + mesh.indices.len() / 3, foreign + usize::from(mesh.texture_id != Default::default()))
    });
    println!("{triangles} triangles, {:.3} ms a picture", twin.panels.cost_ms());
    assert!(triangles > 5000 && foreign == 0, "{triangles} {foreign}");
    let texts = [
        "milliseconds",
        "GPU terrain",
        "4.00 octaves",
        "If the start was the Earth, this is a large country.",
    ];
    for text in texts {
        let is = |node: &Node| node.value() == Some(text);
        assert!(twin.nodes.iter().any(is), "{text}");
    }
}

#[test]
fn the_picture_is_clear_where_nothing_is_and_letters_are_bright_on_the_panels() {
    let gpu = support::gpu();
    let mut pass = PanelPass::new(&gpu).unwrap();
    assert!(pass.picture().is_none());
    let mut twin = Twin::new([1280, 800]);
    let mut cpu_ms = 0.0;
    // Two sizes, new letters, and more triangles than there was room for at first.
    for (i, size) in [[300, 200], [1280, 800]].into_iter().flat_map(|size| [size; 20]).enumerate() {
        twin.size = size;
        (0..10).for_each(|_| twin.feed.tell(Report::Frame(moment(i as u64))));
        let painted = twin.see(Vec::new());
        let mut watch = Stopwatch::start();
        pass.draw(&painted).unwrap();
        watch.lap(Span::Record);
        cpu_ms = watch.spans().of(Span::Record).cpu_ms;
    }
    println!("{cpu_ms:.3} ms of the flight's thread a picture");
    let [width, height] = [1280, 800];
    let pixels = read(&gpu, &pass);
    assert_eq!(pixels.len(), width as usize * height as usize);
    let row = |y: usize| &pixels[y * width as usize..(y + 1) * width as usize];
    assert!((0..800).all(|y| row(y)[230..980].iter().all(|pixel| *pixel == [0; 4])), "the middle is clear");
    assert!(pixels.iter().all(|[r, g, b, a]| r.max(g).max(b) <= a), "premultiplied");
    assert!((0..800).all(|y| row(y)[..210].iter().all(|[.., a]| *a > 200)), "the panel is nearly opaque");
    let bright = (0..800).flat_map(|y| &row(y)[..210]).filter(|[r, ..]| *r > 150).count();
    assert!(bright > 2000, "{bright} bright pixels");
    drop(pass);
    support::assert_clean(gpu);
}

/// What was drawn: red, green, blue, alpha, rows from the top.
fn read(gpu: &Arc<Gpu>, pass: &PanelPass) -> Vec<[u8; 4]> {
    let picture = pass.picture().unwrap();
    let buffer = Buffer::new(
        gpu,
        &BufferInfo {
            name: "read",
            size: u64::from(4 * picture.extent.width * picture.extent.height),
            usage: vk::BufferUsageFlags::TRANSFER_DST,
            location: Location::Readback,
        },
    )
    .unwrap();
    let aspect = vk::ImageAspectFlags::COLOR;
    let layers = vk::ImageSubresourceLayers { aspect_mask: aspect, layer_count: 1, ..Default::default() };
    let region = vk::BufferImageCopy::default().image_subresource(layers).image_extent(picture.extent.into());
    gpu.run(|commands| {
        let read = (Access::ALL, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
        let drawn = (Access::ALL, vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL);
        commands.transition(&[Transition { image: picture.raw, aspect, from: drawn, to: read }]);
        commands.copy_image_to_buffer((picture.raw, read.1), &buffer, &[region]);
        commands.transition(&[Transition { image: picture.raw, aspect, from: read, to: drawn }]);
    })
    .unwrap();
    buffer.slice::<[u8; 4]>().to_vec()
}

/// Leaves a picture of the panels, before grey, in the folder of this test's pictures.
fn keep(name: &str, size: [u32; 2], pixels: &[[u8; 4]]) {
    let over_grey = |&[r, g, b, a]: &[u8; 4]| [r, g, b].map(|byte| byte + (255 - a) / 2);
    let pixels = pixels.iter().flat_map(over_grey).collect();
    Shot { size: size.map(|side| side as usize), pixels }.keep(name);
}

/// The program with its panels, and their twin.
struct Desk<'a> {
    run: Run<'a>,
    twin: Twin,
}

impl Desk<'_> {
    fn press(&mut self, at: Pos2) {
        self.run.click(pixel(at));
        self.twin.press(at);
    }

    /// Presses a check box, until it is seen to have changed.
    fn toggle(&mut self, label: &str) {
        let at = self.twin.start_of(label);
        let before = self.is_ticked(at);
        self.press(self.twin.at(label));
        wait_for(label, || (self.is_ticked(at) != before).then_some(()));
    }

    /// Whether there is a tick in the check box that begins here.
    fn is_ticked(&mut self, [x, y]: [usize; 2]) -> bool {
        let shot = self.run.until("a picture", is_whole);
        let mut inside =
            (y - 4..y + 4).flat_map(|y| (x + 3..x + 12).map(move |x| 3 * (y * shot.size[0] + x)));
        inside.any(|at| shot.pixels[at] > 120)
    }

    /// Presses there until the mark or the words at it look otherwise, and lets go then: what is dragged, and what is typed
    /// into, hears of that.
    fn press_until_seen(&mut self, at: Pos2) {
        // What is under the cursor looks otherwise, too.
        self.run.point_and(pixel(at), &[]);
        let pointed_at = self.run.rests(|run, before: Option<&Shot>| {
            let now = strip(&run.until("a picture", is_whole), at);
            let rests = before.is_some_and(|before| now.differs(before) == 0.0);
            (now, rests)
        });
        self.run.point_and(pixel(at), &["mousedown", "1"]);
        self.run.until("the press", |shot| is_whole(shot) && strip(shot, at).differs(&pointed_at) > 0.3);
        self.run.point_and(pixel(at), &["mouseup", "1"]);
        self.twin.press(at);
    }

    fn choose(&mut self, words: &str, choice: &str) {
        let closed = self.run.until("a picture", is_whole);
        self.press(self.twin.beside(words, 140.0));
        let at = self.twin.at(choice);
        // It can be pressed once it is seen.
        let closed = strip(&closed, at);
        self.run.until(choice, |shot| is_whole(shot) && strip(shot, at).differs(&closed) > 3.0);
        self.press(at);
    }

    /// The speed in the title, once there is one and it is so.
    fn speed_until(&mut self, what: &str, is: impl Fn(&str) -> bool) -> String {
        let speed = |title: &str| Some(title.split_once(" of ")?.1.split_once(' ')?.0.to_owned());
        let title = self.run.title_until(what, |title| speed(title).is_some_and(|speed| is(&speed)));
        speed(&title).unwrap()
    }

    fn speed_set(&mut self) -> String {
        self.speed_until("a speed", |_| true)
    }

    /// What is seen between the panels, once it is otherwise than it was.
    fn land_unlike(&mut self, what: &str, before: &Shot) -> Shot {
        let between = |shot: &Shot| shot.columns(BETWEEN);
        let shot = self.run.until(what, |shot| is_whole(shot) && between(shot).differs(before) > 0.3);
        between(&shot)
    }

    /// Waits until it is as it was.
    fn land_like(&mut self, before: &Shot) {
        self.run.until("all as usual", |shot| shot.columns(BETWEEN).differs(before) < 0.3);
    }

    /// What is seen between the panels, when it has come to rest.
    fn land(&mut self) -> Shot {
        self.run.rests(|run, before: Option<&Shot>| {
            let now = run.until("a picture", is_whole).columns(BETWEEN);
            let rests = before.is_some_and(|before| now.differs(before) < 0.05);
            (now, rests)
        })
    }

    /// Where it is, once it stays there to the bit: what pictures say of it.
    fn address(&mut self, folder: &Path) -> String {
        let mut pictures = 0;
        self.run.rests(|run, before: Option<&String>| {
            pictures += 1;
            run.key("key", "p");
            let kept = folder.join(format!("captures/screenshot_{pictures:04}.png"));
            let address = wait_for("a screenshot", || picture::address(&kept).ok());
            let rests = before == Some(&address);
            (address, rests)
        })
    }
}

fn pixel(at: Pos2) -> [i32; 2] {
    [at.x.round() as i32, at.y.round() as i32]
}

/// The window has the size that the test gives it.
fn is_whole(shot: &Shot) -> bool {
    shot.size == SIZE.map(|side| side as usize)
}

/// What is beside a point, in the left panel.
fn strip(shot: &Shot, at: Pos2) -> Shot {
    strip_of(&shot.columns(70..210), at.y as i32)
}

/// The rows around one.
fn strip_of(shot: &Shot, middle: i32) -> Shot {
    let (middle, width) = (middle as usize, shot.size[0]);
    let rows = middle.saturating_sub(6)..(middle + 6).min(shot.size[1]);
    let pixels = shot.pixels[3 * width * rows.start..3 * width * rows.end].to_vec();
    Shot { size: [width, rows.len()], pixels }
}

const SIZE: [u32; 2] = [1100, 780];

/// The columns between the panels.
const BETWEEN: std::ops::Range<usize> = 230..800;

/// What somebody would paste; None: there is no text.
fn clipboard(screen: &Screen) -> Option<String> {
    let (x, target) = (&screen.x, screen.atom("UTF8_STRING"));
    let (window, to) = (x.generate_id().unwrap(), screen.atom("PASTED"));
    let aux = CreateWindowAux::new();
    let root = screen.root();
    x.create_window(0, window, root, 0, 0, 1, 1, 0, WindowClass::INPUT_ONLY, 0, &aux)
        .unwrap()
        .check()
        .unwrap();
    let from = screen.atom("CLIPBOARD");
    x.convert_selection(window, from, target, to, x11rb::CURRENT_TIME).unwrap().check().unwrap();
    let answer = wait_for("the clipboard", || match x.poll_for_event().unwrap() {
        Some(XEvent::SelectionNotify(event)) => Some(event.property),
        _ => None,
    });
    let reply = x.get_property(true, window, to, target, 0, 100_000).unwrap().reply().unwrap();
    (answer != 0).then(|| String::from_utf8(reply.value).unwrap())
}

#[test]
fn the_panels_are_opened_used_resized_hidden_and_closed_with_the_window() {
    let (screen, folder) = (Screen::open(), tempfile::tempdir().unwrap());
    let own = folder.path().join("none/fathomless/fathomless.toml");
    fs::create_dir_all(own.parent().unwrap()).unwrap();
    fs::write(&own, "# mine\n[mouse]\ninvert = false # as it was\n").unwrap();
    let args = ["view", "--runtime", "mock", "--size", "240x170", "--fixed-quality", "--validate", "-v"];
    let mut run = Run::new(&screen, folder.path(), &args);
    run.resize(SIZE);
    let bare = run.until("its size", |shot| is_whole(shot) && shot.shows_the_world());
    bare.keep("01_bare");
    run.key("key", "F1");
    let left = 0..210;
    let open = run
        .until("the panels", |shot| shot.columns(left.clone()).differs(&bare.columns(left.clone())) > 30.0);
    open.keep("02_panels");
    let mut desk = Desk { run, twin: Twin::new(SIZE) };

    // Each option, on and off. What it is to look like is tested elsewhere; here it has to reach the picture.
    let usual = desk.land();
    let subtle = ["frozen", "frusta", "no-morph", "no-skirts"];
    for switch in SWITCHES {
        let at = desk.twin.start_of(switch.label);
        let before = desk.is_ticked(at);
        desk.toggle(switch.label);
        let shot = match subtle.contains(&switch.word) {
            true => desk.land(),
            false => desk.land_unlike(switch.word, &usual),
        };
        shot.keep(&format!("03_{}", switch.word));
        assert_ne!(desk.is_ticked(at), before, "{}: the flight has not taken it up", switch.word);
        desk.toggle(switch.label);
        desk.land_like(&usual);
    }
    let mut before = usual.clone();
    for choice in SurfaceView::CHOICES.into_iter().skip(1) {
        desk.choose("Ground", choice.label);
        before = desk.land_unlike(choice.word, &before);
        before.keep(&format!("04_{}", choice.word));
    }
    desk.press(desk.twin.at("All as usual"));
    desk.land_like(&usual);
    before = usual.clone();
    for choice in BackdropView::CHOICES.into_iter().skip(1) {
        desk.choose("Backdrop", choice.label);
        before = desk.land_unlike(choice.word, &before);
        before.keep(&format!("05_{}", choice.word));
    }
    desk.press(desk.twin.at("All as usual"));
    desk.land_like(&usual);
    desk.toggle("A single octave");
    desk.land_unlike("an octave", &usual).keep("06_octave");
    desk.press(desk.twin.at("All as usual"));
    desk.land_like(&usual);

    // What the window shows.
    desk.choose("Window", "Both eyes");
    desk.land_unlike("both eyes", &usual).keep("06_both_eyes");
    desk.choose("Window", "Left eye");
    desk.land_like(&usual);

    // Light, and how much is drawn.
    desk.press_until_seen(desk.twin.beside("From", 90.0));
    desk.land_unlike("light from elsewhere", &usual).keep("07_light");
    desk.press(desk.twin.at("The world's own light"));
    desk.land_like(&usual);
    desk.press_until_seen(desk.twin.beside("Split", 130.0));
    desk.land().keep("08_finer");
    // It can be pressed once it is drawn like that; once is enough.
    let saved = |text: &String| text.contains("[quality]\nsplit = ");
    let text = wait_for("what is saved", || {
        desk.press(desk.twin.at("Save"));
        desk.run.frames_later(20);
        fs::read_to_string(&own).ok().filter(saved)
    });
    assert!(text.starts_with("# mine\n[mouse]\ninvert = false # as it was\n"), "{text}");
    let said = desk.run.said.clone();
    let is_taken_up = || fs::read_to_string(&said).unwrap().contains("quality.split is taken up");
    wait_for("a word about it", || is_taken_up().then_some(()));
    desk.run.title_until("the speed again", |title| title.contains(" 0.00 of "));

    // The mouse looks around, panels or not, and is a mouse again.
    let before = desk.land();
    desk.run.key("key", "f");
    screen.tool(&["mousemove_relative", "--", "150", "0"]);
    desk.land_unlike("a turn", &before).keep("08_turned");
    desk.run.key("key", "f");
    desk.run.key("key", "r");
    desk.land_like(&before);

    // Another world, and another landscape in it. What is typed is not flown.
    desk.choose("Name", "hills");
    desk.run.title_until("another world", |title| title.contains("hills"));
    desk.twin.feed.tell(Report::Facts(Box::new(Facts { world: "hills".into(), ..facts() })));
    desk.twin.see(Vec::new());
    let hills = desk.land();
    hills.keep("09_hills");
    let stood = depth(&desk.run.title_until("standing still", |title| title.contains(" 0.00 of ")));
    desk.press_until_seen(desk.twin.beside("Seed", 100.0));
    for key in ["ctrl+a", "x", "BackSpace", "7"] {
        desk.run.key("key", key);
    }
    desk.run.key("keydown", "x");
    // The wheel over the land is heard of after that, once the panels know that the cursor is there.
    let slow = desk.speed_set();
    wait_for("the land's wheel", || {
        desk.run.point_and([500, 400], &["click", "4"]);
        desk.run.frames_later(5);
        (desk.speed_set() != slow).then_some(())
    });
    desk.run.frames_later(20);
    desk.run.key("keyup", "x");
    let flown = *desk.run.column("depth").last().unwrap();
    assert!((flown - stood).abs() < 0.02, "typing does not fly: {flown}, {stood}");
    desk.run.key("key", "ctrl+a");
    desk.run.key("key", "7");
    desk.run.key("key", "Return");
    desk.land_unlike("another seed", &hills).keep("10_seed_7");
    desk.run.key("keydown", "x");
    desk.run.title_until("backing out", |title| title.contains("depth") && depth(title) < stood - 0.5);
    desk.run.key("keyup", "x");

    // Help, log, and the wheel over a panel.
    let before = desk.land();
    desk.press(desk.twin.at("?"));
    desk.land_unlike("help", &before);
    desk.land().keep("11_help");
    desk.press(desk.twin.at("?"));
    desk.land_like(&before);
    desk.press(desk.twin.at("Log"));
    desk.land_unlike("the log", &before);
    desk.land().keep("12_log");
    desk.press(desk.twin.at("Log"));
    desk.land_like(&before);
    // The button tells whether the panels know where the cursor is.
    let (land, log) = ([500, 400], pixel(desk.twin.at("Log")));
    let button = |shot: &Shot| shot.columns(log[0] as usize - 12..log[0] as usize + 12);
    let over_it = button(&desk.run.until("a picture", is_whole));
    desk.run.point_and(land, &[]);
    let beside = |shot: &Shot| strip_of(&button(shot), log[1]).differs(&strip_of(&over_it, log[1])) > 2.0;
    desk.run.until("the cursor over the land", beside);
    let before = desk.speed_set();
    desk.run.point_and(land, &["click", "4"]);
    let faster = desk.speed_until("the land's wheel", |now| now != before);
    // What is turned over the panel does nothing: what is turned back over the land leads to where it began.
    desk.run.point_and(log, &["click", "--repeat", "5", "4"]);
    desk.run.until("the cursor over the panel", |shot| !beside(shot));
    desk.run.point_and(land, &[]);
    desk.run.until("the cursor over the land", beside);
    desk.run.point_and(land, &["click", "5"]);
    let after = desk.speed_until("slower again", |now| now != faster);
    assert_eq!(after, before, "the wheel was the panel's");

    // A picture, and the place, exactly.
    desk.run.title_until("standing still", |title| title.contains(" 0.00 of "));
    let address = desk.address(folder.path());
    desk.twin.feed.tell(Report::Frame(moment(1)));
    desk.twin.see(Vec::new());
    desk.press(desk.twin.at("Copy address"));
    wait_for("the address", || clipboard(&screen).filter(|text| *text == address));
    assert!(address.contains("hills") && address.contains(":7:"), "{address}");

    let mut run = desk.run;
    for i in 0..20u32 {
        let size = match i % 5 {
            0 => [1, 1],
            1 => [1200 - 17 * i, 300 + 11 * i],
            2 => [260, 600],
            3 => [3, 500],
            _ => [700 + 13 * i, 90],
        };
        run.resize(size);
        let is_that = |shot: &Shot| shot.size == size.map(|side| side as usize);
        if i % 5 == 1 {
            run.until("that size", |shot| is_that(shot) && shot.colours() > 100)
                .keep(&format!("13_size_{i}"));
        } else {
            run.frames_later(2);
        }
    }
    run.resize(SIZE);
    run.hide_for_a_while();
    screen.tool(&["windowfocus", "--sync", &run.window.to_string()]);
    let again = run.until("all of it", |shot| {
        let panel = shot.columns(left.clone());
        is_whole(shot)
            && panel.differs(&bare.columns(left.clone())) > 30.0
            && shot.columns(BETWEEN).shows_the_world()
    });
    again.keep("14_again");
    run.key("key", "F1");
    run.until("the world alone", |shot| {
        let panel = shot.columns(left.clone());
        is_whole(shot) && panel.differs(&again.columns(left.clone())) > 20.0 && shot.shows_the_world()
    })
    .keep("15_hidden");
    run.key("key", "F1");

    run.close();
    let (code, said) = run.end();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("frames drawn") && !said.contains("WARN"), "{said}");
}

#[test]
fn the_panels_are_as_large_as_the_display_wants_them() {
    let screen = Screen::of_size([2000, 1300]);
    for (scale, factor) in [("1", 1.0), ("1.5", 1.5), ("2", 2.0)] {
        let folder = tempfile::tempdir().unwrap();
        let args = ["view", "--runtime", "mock", "--size", "240x150", "--validate"];
        let mut run = Run::with(&screen, folder.path(), &args, &[("WINIT_X11_SCALE_FACTOR", scale)]);
        let size = [960.0, 600.0].map(|side: f64| (side * factor) as usize);
        run.resize(size.map(|side| side as u32));
        let bare = run.until("its size", |shot| shot.size == size && shot.shows_the_world());
        run.key("key", "F1");
        let changed = |shot: &Shot, x: f64| {
            let x = (x * factor) as usize;
            shot.columns(x..x + 2).differs(&bare.columns(x..x + 2)) > 20.0
        };
        // Up to the panel's edge, and not beyond it.
        let open = run.until("the panels", |shot| changed(shot, 4.0) && changed(shot, 212.0));
        assert!(!changed(&open, 222.0) && !changed(&open, 640.0) && changed(&open, 680.0), "{scale}");
        run.frames_later(20);
        run.until("a picture", |_| true).keep(&format!("scale_{scale}"));
        run.close();
        let (code, said) = run.end();
        assert_eq!(code, Some(0), "{said}");
    }
}
