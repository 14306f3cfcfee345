//! The panels over the mirror, laid out by egui. [`Numbers`] go in, [`Wish`]es come out, a [`Painted`] picture is what is
//! seen; window, renderer and flight are elsewhere.
//!
//! | file | noun |
//! |---|---|
//! | `numbers` | what is known of the flight: facts, and the last frames |
//! | `options` | left: options for seeing how it works, world, light, quality |
//! | `meters` | right: where the time goes, what is drawn, where this is |
//! | `graph` | the time graph |
//! | `help` | what all of it means, and the keys |
//! | `log` | the log's last lines |
//! | `wrist` | the panel in the headset, by itself |
//!
//! The panels live on the window's thread, and the flight has a [`Feed`], so that neither waits for the other: of frames
//! some may be left out, all else stays until it is read.

mod graph;
mod help;
mod log;
mod meters;
mod numbers;
mod options;
pub mod wrist;

pub use help::{ControllerLine, KeyLine, controller_lines, key_lines};
pub use numbers::{Facts, History, Moment, Numbers, Report, Tuning};

use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use egui::{
    Color32, ColorImage, Context, CornerRadius, Frame, Margin, Panel, PlatformOutput, RawInput, ViewportId,
};

use crate::inspect::Inspect;
use crate::settings::Side;
use crate::telemetry::{Span, Stopwatch};
use crate::world::Sun;

/// Frames that may be on their way: more than those between two pictures of the panels.
const FRAMES: usize = 64;

/// Something that a person asked for in the panels.
#[derive(Clone, Debug, PartialEq)]
pub enum Wish {
    /// Show it like this.
    Inspect(Inspect),
    /// The window shows this.
    Side(Side),
    /// Light from there. `settled`: he has let go of the slider.
    Sun {
        /// Where it comes from.
        sun: Sun,
        /// It is not going to change at once.
        settled: bool,
    },
    /// Draw so much.
    Tuning(Tuning),
    /// Narrow the wearer's view while he is moved, or do not.
    Vignette(bool),
    /// Go to the start of a world: its name, or its file; None takes the seed in its file.
    World {
        /// As [`World::load`](crate::world::World::load) takes it.
        name: String,
        /// The landscape's seed.
        seed: Option<u64>,
    },
    /// The address of the place, for the clipboard.
    CopyAddress,
    /// How much is drawn is to be so at the next start, too.
    Save,
}

/// What the panels have not read yet, but for frames: the last of each.
#[derive(Default)]
struct Unread {
    facts: Option<Box<Facts>>,
    address: Option<String>,
    to_copy: Option<String>,
    keys: Option<Vec<KeyLine>>,
    controllers: Option<Vec<ControllerLine>>,
}

/// The flight's end of the panels. It never waits.
pub struct Feed {
    frames: SyncSender<Moment>,
    unread: Arc<Mutex<Unread>>,
    wishes: Receiver<Wish>,
}

impl Feed {
    /// Tells the panels something. Frames that they are too slow for are left out; all else is kept until they read it,
    /// unless there is something newer by then.
    pub fn tell(&self, report: Report) {
        if let Report::Frame(moment) = report {
            let _ = self.frames.try_send(moment);
            return;
        }
        // Whoever reads has it for no longer than it takes to take it.
        let mut unread = self.unread.lock().unwrap_or_else(PoisonError::into_inner);
        match report {
            Report::Frame(_) => {}
            Report::Facts(facts) => unread.facts = Some(facts),
            Report::Address { text, copy: false } => unread.address = Some(text),
            Report::Address { text, copy: true } => unread.to_copy = Some(text),
            Report::Keys(keys) => unread.keys = Some(keys),
            Report::Controllers(lines) => unread.controllers = Some(lines),
        }
    }

    /// What was asked for since the last time.
    pub fn wish(&self) -> Option<Wish> {
        self.wishes.try_recv().ok()
    }
}

/// A picture of the panels, as triangles.
#[derive(Clone)]
pub struct Painted {
    /// What to draw, in this order. Positions are in points, colours are gamma-encoded and premultiplied.
    pub primitives: Vec<egui::ClippedPrimitive>,
    /// What all of it is textured with: letters.
    pub atlas: Arc<ColorImage>,
    /// Another one whenever `atlas` has changed, from 1.
    pub atlas_version: u64,
    /// Pixels per point.
    pub scale: f32,
    /// Pixels of the window.
    pub size: [u32; 2],
}

/// What came of [`Panels::paint`].
pub struct Outcome {
    /// What is seen.
    pub painted: Painted,
    /// For the platform: cursor, clipboard.
    pub output: PlatformOutput,
    /// How soon it would look different by itself.
    pub again_in: Duration,
}

/// The panels.
pub struct Panels {
    context: Context,
    numbers: Numbers,
    options: options::Options,
    meters: meters::Meters,
    help: help::Help,
    log: log::Log,
    frames: Receiver<Moment>,
    unread: Arc<Mutex<Unread>>,
    wishes: Sender<Wish>,
    atlas: Arc<ColorImage>,
    atlas_version: u64,
    /// What is left free, in points.
    free: egui::Rect,
    /// Milliseconds of a processor that the last pictures took to make, smoothed.
    cost_ms: f64,
}

impl Panels {
    /// Panels, and the flight's end of them. `keys` are what the help lists.
    pub fn new(keys: Vec<KeyLine>) -> (Panels, Feed) {
        let (to_panels, frames) = sync_channel(FRAMES);
        let unread = Arc::default();
        let (wishes, to_flight) = channel();
        let context = Context::default();
        style(&context);
        let panels = Panels {
            context,
            numbers: Numbers::default(),
            options: options::Options::default(),
            meters: meters::Meters::default(),
            help: help::Help::new(keys),
            log: log::Log::default(),
            frames,
            unread: Arc::clone(&unread),
            wishes,
            atlas: Arc::new(ColorImage::default()),
            atlas_version: 0,
            free: egui::Rect::EVERYTHING,
            cost_ms: 0.0,
        };
        (panels, Feed { frames: to_panels, unread, wishes: to_flight })
    }

    /// What knows where pointer and focus are.
    pub fn context(&self) -> &Context {
        &self.context
    }

    /// Whether a point of the window is behind a panel, as of the last picture.
    pub fn covers(&self, point: egui::Pos2) -> bool {
        let above =
            self.context.layer_id_at(point).is_some_and(|layer| layer.order != egui::Order::Background);
        above || !self.free.contains(point)
    }

    /// Milliseconds of a processor that a picture takes to make, smoothed.
    pub fn cost_ms(&self) -> f64 {
        self.cost_ms
    }

    /// Takes in what was reported, lays out and paints a window of so many pixels.
    pub fn paint(&mut self, input: RawInput, size: [u32; 2]) -> Outcome {
        let mut watch = Stopwatch::start();
        self.hear();
        let context = self.context.clone();
        let full = context.run_ui(input, |ui| self.lay_out(ui));
        let egui::FullOutput {
            platform_output,
            mut textures_delta,
            shapes,
            pixels_per_point,
            viewport_output,
        } = full;
        if !textures_delta.set.is_empty() {
            // New letters are rare: the whole atlas each time keeps everybody else simple.
            self.atlas = Arc::new(context.fonts(|fonts| fonts.image()));
            self.atlas_version += 1;
        }
        textures_delta.clear();
        let painted = Painted {
            primitives: context.tessellate(shapes, pixels_per_point),
            atlas: Arc::clone(&self.atlas),
            atlas_version: self.atlas_version,
            scale: pixels_per_point,
            size,
        };
        let again_in =
            viewport_output.get(&ViewportId::ROOT).map_or(Duration::MAX, |viewport| viewport.repaint_delay);
        watch.lap(Span::Mirror);
        let ms = watch.spans().cpu_ms();
        self.cost_ms = if self.cost_ms == 0.0 { ms } else { self.cost_ms + 0.1 * (ms - self.cost_ms) };
        Outcome { painted, output: platform_output, again_in }
    }

    fn hear(&mut self) {
        self.frames.try_iter().for_each(|moment| self.numbers.history.push(moment));
        let unread = std::mem::take(&mut *self.unread.lock().unwrap_or_else(PoisonError::into_inner));
        if let Some(facts) = unread.facts {
            self.options.learn(self.numbers.facts.as_deref(), &facts);
            self.numbers.facts = Some(facts);
        }
        if let Some(text) = unread.address {
            self.numbers.address = text;
        }
        if let Some(text) = unread.to_copy {
            self.context.copy_text(text.clone());
            self.meters.copied();
            self.numbers.address = text;
        }
        if let Some(keys) = unread.keys {
            self.help.learn(keys);
        }
        if let Some(lines) = unread.controllers {
            self.help.controllers = lines;
        }
        self.log.read();
    }

    fn lay_out(&mut self, ui: &mut egui::Ui) {
        let mut wish = |wish| {
            // Whoever flies may have gone.
            let _ = self.wishes.send(wish);
        };
        self.log.show(ui);
        Panel::left("options").resizable(false).exact_size(options::WIDTH).frame(backing()).show(ui, |ui| {
            self.options.show(ui, &self.numbers, &mut self.help, &mut wish);
        });
        Panel::right("meters").resizable(false).exact_size(meters::WIDTH).frame(backing()).show(ui, |ui| {
            self.meters.show(ui, &self.numbers, self.cost_ms, &mut self.log, &mut wish);
        });
        self.free = ui.available_rect_before_wrap();
        self.help.show(ui);
    }
}

/// Dark, and a little of the land shines through.
fn backing() -> Frame {
    Frame::new().fill(Color32::from_rgba_unmultiplied(14, 17, 23, 225)).inner_margin(Margin::symmetric(10, 8))
}

/// Letters that are read at any scale, and no animation: nothing is drawn that need not be.
fn style(context: &Context) {
    context.set_theme(egui::Theme::Dark);
    context.all_styles_mut(|style| {
        use egui::{FontId, TextStyle};
        style.text_styles = [
            (TextStyle::Heading, FontId::proportional(16.0)),
            (TextStyle::Body, FontId::proportional(13.0)),
            (TextStyle::Button, FontId::proportional(13.0)),
            (TextStyle::Monospace, FontId::monospace(12.0)),
            (TextStyle::Small, FontId::proportional(11.0)),
        ]
        .into();
        style.animation_time = 0.0;
        style.spacing.item_spacing = egui::vec2(6.0, 4.0);
        style.visuals.override_text_color = Some(Color32::from_gray(225));
        style.visuals.window_fill = Color32::from_rgba_unmultiplied(20, 24, 32, 245);
        style.visuals.window_corner_radius = CornerRadius::same(6);
        style.visuals.window_shadow = egui::Shadow::NONE;
        style.visuals.popup_shadow = egui::Shadow::NONE;
    });
}
