//! The panel in the headset: what a person needs there, in letters and buttons that are large enough for it.
//!
//! [`Known`] goes in, [`WristWish`]es come out, a [`Painted`] picture is what is seen; where it hangs and what points at it
//! is elsewhere. It is laid out in points of [`METRES_PER_POINT`]: seen from [`READ_FROM_M`] a point is a thousandth of the
//! distance, and what is read needs about 20 of these, what is hit about 60 (Google, "Designing Screen Interfaces for VR",
//! 2017, which calls them dmm).

mod comfort;
mod controls;
mod fly;
mod ladder;
mod parts;
mod places;

use std::sync::Arc;
use std::time::Duration;

use egui::{
    Color32, ColorImage, Context, Event, FontId, Modifiers, MouseWheelUnit, PlatformOutput, PointerButton,
    Pos2, RawInput, Rect, TouchPhase, Ui, Vec2, ViewportId, pos2, vec2,
};

use self::parts::Parts;
use super::{ControllerLine, Painted};
use crate::wrist::PanelPlace;

/// Width and height in points.
pub const SIZE: [f32; 2] = [720.0, 600.0];

/// Metres of a point, on the wrist.
pub const METRES_PER_POINT: f32 = 0.0004;

/// How far from the eyes a wrist is about, in metres.
pub const READ_FROM_M: f32 = 0.4;

/// From one picture to the next at least, where only numbers change.
const NUMBERS_EVERY_S: f64 = 0.1;

/// Points by which a pointer has to move to be seen elsewhere.
const LEAST_WAY: f32 = 0.25;

/// What the panel knows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Known {
    /// What changes from frame to frame.
    pub gauges: Gauges,
    /// What was chosen.
    pub choices: Choices,
    /// The world's name.
    pub world: String,
    /// The worlds there are, by name, each with a line about it.
    pub worlds: Vec<[String; 2]>,
    /// The bookmarks, by name.
    pub places: Vec<String>,
    /// What the controllers do; nothing while none are held.
    pub controls: Vec<ControllerLine>,
    /// Something that was done, or went wrong, in a few words; empty: nothing.
    pub notice: String,
}

/// What changes from frame to frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gauges {
    /// Octaves below the start.
    pub depth: f64,
    /// Octaves per second at present; None: a flight goes by itself.
    pub speed: Option<f64>,
}

/// What a person chooses here.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Choices {
    /// As [`MotionSettings::speed`](crate::pilot::MotionSettings::speed).
    pub speed: f64,
    /// As [`MotionSettings::comfort_m`](crate::pilot::MotionSettings::comfort_m).
    pub comfort_m: f64,
    /// As [`ComfortSettings::vignette`](crate::comfort::ComfortSettings::vignette).
    pub vignette: bool,
    /// As [`ControllerSettings::snap_turn`](crate::controllers::ControllerSettings::snap_turn).
    pub snap_turn: f32,
    /// As [`ControllerSettings::fly_by_head`](crate::controllers::ControllerSettings::fly_by_head).
    pub fly_by_head: bool,
    /// As [`ControllerSettings::standing`](crate::controllers::ControllerSettings::standing).
    pub standing: bool,
    /// As [`ControllerSettings::panel`](crate::controllers::ControllerSettings::panel).
    pub panel: PanelPlace,
}

/// Something that a person asked for.
#[derive(Clone, Debug, PartialEq)]
pub enum WristWish {
    /// Have it like this. `settled`: he has let go of the slider.
    Choose {
        /// All of it.
        choices: Choices,
        /// It is not going to change at once.
        settled: bool,
    },
    /// Back to the start.
    Restart,
    /// Upright over the ground.
    Level,
    /// The seat is where the head is.
    Recentre,
    /// A bookmark of this place.
    Mark,
    /// To a bookmark, by its name.
    Go(String),
    /// To the start of a world, by its name.
    World(String),
    /// Hide the panel.
    Close,
}

/// What a hand does to the panel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Touch {
    /// Where it points, in points from the upper left corner; None: nowhere.
    pub at: Option<Pos2>,
    /// Its trigger is held that was pulled on the panel.
    pub pressed: bool,
    /// Points by which it scrolls in this picture, above 0 towards the beginning.
    pub scroll: f32,
}

/// What came of [`WristPanel::paint`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Felt {
    /// The pointer has come over another thing that does something.
    pub over: bool,
    /// Something was clicked.
    pub clicked: bool,
}

/// The pages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Page {
    #[default]
    Fly,
    Places,
    Worlds,
    Comfort,
    Controls,
}

impl Page {
    const WORDS: [(Page, &'static str); 4] =
        [(Page::Fly, "Fly"), (Page::Places, "Places"), (Page::Worlds, "Worlds"), (Page::Comfort, "Comfort")];

    /// As wide as it is high.
    const SIGN: [(Page, &'static str); 1] = [(Page::Controls, "?")];
}

/// The panel. It is laid out only when it would look otherwise than it does.
pub struct WristPanel {
    /// What it knows; whoever flies keeps it up to date.
    pub known: Known,
    context: Context,
    page: Page,
    painted: Painted,
    serial: u64,
    /// What is seen.
    seen: Known,
    touch: Touch,
    painted_s: f64,
    /// When it would look different by itself.
    due_s: f64,
    over: Option<egui::Id>,
    output: PlatformOutput,
}

impl WristPanel {
    /// A panel that was never seen.
    pub fn new() -> WristPanel {
        let context = Context::default();
        style(&context);
        let painted = Painted {
            primitives: Vec::new(),
            atlas: Arc::new(ColorImage::default()),
            atlas_version: 0,
            scale: 1.0,
            size: [0; 2],
        };
        WristPanel {
            known: Known::default(),
            context,
            page: Page::default(),
            painted,
            serial: 0,
            seen: Known::default(),
            touch: Touch::default(),
            painted_s: 0.0,
            due_s: 0.0,
            over: None,
            output: PlatformOutput::default(),
        }
    }

    /// What knows where pointer and focus are.
    pub fn context(&self) -> &Context {
        &self.context
    }

    /// The picture; its serial is another one whenever it has changed, and 0 before there was one.
    pub fn picture(&self) -> (&Painted, u64) {
        (&self.painted, self.serial)
    }

    /// What else came of the last picture, such as a tree of what is there, where egui is asked for one.
    pub fn output(&self) -> &PlatformOutput {
        &self.output
    }

    /// Whether a trigger is held that was pulled on it, as far as it has heard.
    pub fn is_held(&self) -> bool {
        self.touch.pressed
    }

    /// Whether it would look otherwise than it does, at `now_s` seconds after any beginning.
    pub fn is_due(&self, touch: &Touch, now_s: f64) -> bool {
        let (known, seen) = (&self.known, &self.seen);
        let moved = match (touch.at, self.touch.at) {
            (Some(now), Some(then)) => now.distance(then) >= LEAST_WAY,
            (now, then) => now.is_some() != then.is_some(),
        };
        let numbers = known.gauges != seen.gauges && now_s - self.painted_s >= NUMBERS_EVERY_S;
        let rest = known.choices != seen.choices
            || known.world != seen.world
            || known.worlds != seen.worlds
            || known.places != seen.places
            || known.controls != seen.controls
            || known.notice != seen.notice;
        let handled = touch.pressed != self.touch.pressed || touch.scroll != 0.0;
        self.serial == 0 || moved || handled || numbers || rest || now_s >= self.due_s
    }

    /// Lays it out and paints it, with so many pixels per point.
    pub fn paint(&mut self, touch: &Touch, scale: f32, now_s: f64, wish: &mut dyn FnMut(WristWish)) -> Felt {
        let input = self.input(touch, scale, now_s);
        let (mut over, mut clicked) = (None, false);
        let context = self.context.clone();
        let full = context.run_ui(input, |ui| {
            (over, clicked) = (None, false);
            self.lay_out(&mut Parts::new(ui, &mut over, &mut clicked), touch, wish);
        });
        let mut textures_delta = full.textures_delta;
        if !textures_delta.set.is_empty() {
            self.painted.atlas = Arc::new(context.fonts(|fonts| fonts.image()));
            self.painted.atlas_version += 1;
        }
        textures_delta.clear();
        self.painted.primitives = context.tessellate(full.shapes, full.pixels_per_point);
        self.painted.scale = full.pixels_per_point;
        self.painted.size = SIZE.map(|side| (side * scale).round() as u32);
        self.serial += 1;
        self.output = full.platform_output;
        let again_in = full
            .viewport_output
            .get(&ViewportId::ROOT)
            .map_or(Duration::MAX, |viewport| viewport.repaint_delay);
        (self.painted_s, self.due_s) = (now_s, now_s + again_in.as_secs_f64());
        self.seen.clone_from(&self.known);
        self.touch = *touch;
        let came_over = over.is_some() && over != self.over;
        self.over = over;
        Felt { over: came_over, clicked }
    }

    /// What egui is told of a hand, and of the time.
    fn input(&self, touch: &Touch, scale: f32, now_s: f64) -> RawInput {
        let mut events = Vec::new();
        let before = self.touch;
        if let Some(at) = touch.at.filter(|at| before.at != Some(*at)) {
            events.push(Event::PointerMoved(at));
        }
        if touch.pressed != before.pressed {
            // A hand that is not there any more has let go, and has clicked nothing.
            let pos = touch.at.unwrap_or(NOWHERE);
            let (button, pressed) = (PointerButton::Primary, touch.pressed);
            events.push(Event::PointerButton { pos, button, pressed, modifiers: Modifiers::NONE });
        }
        if touch.at.is_none() && before.at.is_some() {
            events.push(Event::PointerGone);
        }
        if touch.scroll != 0.0 {
            events.push(Event::MouseWheel {
                unit: MouseWheelUnit::Point,
                delta: vec2(0.0, touch.scroll),
                phase: TouchPhase::Move,
                modifiers: Modifiers::NONE,
            });
        }
        let mut input = RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, Vec2::from(SIZE))),
            time: Some(now_s),
            focused: true,
            events,
            ..RawInput::default()
        };
        input.viewports.entry(ViewportId::ROOT).or_default().native_pixels_per_point = Some(scale);
        input
    }

    fn lay_out(&mut self, parts: &mut Parts<'_>, touch: &Touch, wish: &mut dyn FnMut(WristWish)) {
        let whole = Rect::from_min_size(Pos2::ZERO, Vec2::from(SIZE));
        parts.backing(whole.shrink(EDGE));
        let inside = whole.shrink(EDGE + 20.0);
        let (left, right) = inside.split_left_right_at_x(inside.left() + LADDER);
        ladder::show(parts, left, &self.known.gauges);
        let right = right.with_min_x(right.left() + 14.0);
        let (tabs, rest) = right.split_top_bottom_at_y(right.top() + parts::KEY);
        let (tabs, close) = tabs.split_left_right_at_x(tabs.right() - parts::KEY);
        if parts.close(close) {
            wish(WristWish::Close);
        }
        let tabs = tabs.with_max_x(tabs.right() - parts::GAP);
        let (words, sign) = tabs.split_left_right_at_x(tabs.right() - parts::KEY);
        let words = words.with_max_x(words.right() - parts::GAP);
        let chosen = parts.choose(words, &Page::WORDS, &self.page);
        if let Some(page) = parts.choose(sign, &Page::SIGN, &self.page).or(chosen) {
            self.page = page;
        }
        let (page, foot) = rest.split_top_bottom_at_y(rest.bottom() - 34.0);
        let page = page.with_min_y(page.top() + 22.0);
        let known = &self.known;
        match self.page {
            Page::Fly => fly::show(parts, page, known, wish),
            Page::Places => places::show_places(parts, page, known, wish),
            Page::Worlds => places::show_worlds(parts, page, known, wish),
            Page::Comfort => comfort::show(parts, page, known, wish),
            Page::Controls => controls::show(parts, page, known),
        }
        if !known.notice.is_empty() {
            parts.line(foot.with_min_y(foot.top() + 8.0), &known.notice, parts::SMALL, parts::WEAK);
        }
        if let Some(at) = touch.at {
            parts.cursor(at, touch.pressed);
        }
    }
}

impl Default for WristPanel {
    fn default() -> WristPanel {
        WristPanel::new()
    }
}

/// A point where nothing is.
const NOWHERE: Pos2 = pos2(-1e4, -1e4);

/// What is left free at the edges, in points: the picture fades out there, so that no edge of it is jagged.
const EDGE: f32 = 3.0;

/// Points across that the ladder takes.
const LADDER: f32 = 184.0;

/// Hands tremble: a click may wander, and take its time. Nothing is animated: nothing is drawn that need not be.
fn style(context: &Context) {
    context.set_theme(egui::Theme::Dark);
    context.options_mut(|options| {
        options.input_options.max_click_dist = 36.0;
        options.input_options.max_click_duration = 5.0;
    });
    context.all_styles_mut(|style| {
        style.animation_time = 0.0;
        style.spacing.item_spacing = vec2(0.0, parts::GAP);
        style.visuals.override_text_color = Some(parts::TEXT);
        style.visuals.panel_fill = Color32::TRANSPARENT;
        style.spacing.scroll =
            egui::style::ScrollStyle { bar_width: 14.0, ..egui::style::ScrollStyle::solid() };
        style.override_font_id = Some(FontId::proportional(parts::BODY));
    });
}

/// What lies in a scrolled list.
fn scrolled(parts: &mut Parts<'_>, area: Rect, add: impl FnOnce(&mut Parts<'_>)) {
    parts.within(area, |ui: &mut Ui, over, clicked| {
        egui::ScrollArea::vertical()
            .auto_shrink(false)
            .show(ui, |ui| add(&mut Parts::new(ui, over, clicked)));
    });
}
