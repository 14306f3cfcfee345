//! Buttons, choices and sliders that a hand can hit, and letters that are read at arm's length.

use std::sync::Arc;

use egui::text::LayoutJob;
use egui::{
    Align2, Color32, CornerRadius, FontId, Galley, Id, Pos2, Rect, Response, Sense, Stroke, StrokeKind, Ui,
    UiBuilder, WidgetInfo, WidgetType, pos2, vec2,
};

/// Points of letters: what is read, what is read now and then, what is read first.
pub(super) const BODY: f32 = 23.0;
pub(super) const SMALL: f32 = 20.0;
pub(super) const LARGE: f32 = 52.0;

/// Points that everything is high that can be hit, and between two of these.
pub(super) const KEY: f32 = 58.0;
pub(super) const GAP: f32 = 8.0;

pub(super) const TEXT: Color32 = Color32::from_rgb(232, 236, 242);
pub(super) const WEAK: Color32 = Color32::from_rgb(160, 170, 186);
pub(super) const ACCENT: Color32 = Color32::from_rgb(0x56, 0xb4, 0xe9);
const ON_ACCENT: Color32 = Color32::from_rgb(8, 16, 24);
const BACKING: Color32 = Color32::from_rgb(14, 17, 23);
const RIM: Color32 = Color32::from_rgb(44, 52, 66);
const AT_REST: Color32 = Color32::from_rgb(33, 40, 52);
const OVER: Color32 = Color32::from_rgb(52, 64, 84);
const HELD: Color32 = Color32::from_rgb(70, 88, 114);

/// What lays the parts out, and what they have to say.
pub(super) struct Parts<'a> {
    pub(super) ui: &'a mut Ui,
    /// The thing under the pointer that does something.
    over: &'a mut Option<Id>,
    /// Something was clicked.
    clicked: &'a mut bool,
}

/// What a slider came to.
pub(super) struct Slid {
    pub(super) share: f32,
    pub(super) settled: bool,
}

impl<'a> Parts<'a> {
    pub(super) fn new(ui: &'a mut Ui, over: &'a mut Option<Id>, clicked: &'a mut bool) -> Parts<'a> {
        Parts { ui, over, clicked }
    }

    /// Whatever `add` lays out in a rectangle.
    pub(super) fn within(&mut self, area: Rect, add: impl FnOnce(&mut Ui, &mut Option<Id>, &mut bool)) {
        let Parts { ui, over, clicked } = self;
        ui.scope_builder(UiBuilder::new().max_rect(area), |ui| {
            ui.set_clip_rect(area.intersect(ui.clip_rect()));
            add(ui, over, clicked);
        });
    }

    /// What everything is on.
    pub(super) fn backing(&self, area: Rect) {
        let painter = self.ui.painter();
        painter.rect_filled(area, 26.0, BACKING);
        painter.rect_stroke(area, 26.0, Stroke::new(1.5, RIM), StrokeKind::Inside);
    }

    /// Letters from a point on.
    pub(super) fn text(&self, at: Pos2, align: Align2, text: &str, size: f32, colour: Color32) -> Rect {
        self.ui.painter().text(at, align, text, FontId::proportional(size), colour)
    }

    /// A line from a rectangle's left side, as long as there is room.
    pub(super) fn line(&self, area: Rect, text: &str, size: f32, colour: Color32) {
        let galley = self.galley(text, size, colour, area.width(), 1);
        let at = pos2(area.left(), area.center().y - galley.size().y / 2.0);
        self.ui.painter().galley(at, galley, colour);
    }

    /// Letters in so many rows at most.
    pub(super) fn galley(
        &self,
        text: &str,
        size: f32,
        colour: Color32,
        width: f32,
        rows: usize,
    ) -> Arc<Galley> {
        let mut job = LayoutJob::simple(text.to_owned(), FontId::proportional(size), colour, width);
        job.wrap.max_rows = rows;
        self.ui.painter().layout_job(job)
    }

    fn sense(&mut self, area: Rect, id: Id, sense: Sense) -> Response {
        let response = self.ui.interact(area, id, sense);
        if response.hovered() || response.is_pointer_button_down_on() {
            *self.over = Some(id);
        }
        *self.clicked |= response.clicked();
        response
    }

    /// A button's ground, and the colour of what is on it.
    fn ground(&self, area: Rect, response: &Response, selected: bool) -> Color32 {
        let (fill, on) = match (selected, response.is_pointer_button_down_on(), response.hovered()) {
            (true, ..) => (ACCENT, ON_ACCENT),
            (_, true, _) => (HELD, TEXT),
            (_, _, true) => (OVER, TEXT),
            _ => (AT_REST, TEXT),
        };
        let painter = self.ui.painter();
        painter.rect_filled(area, CornerRadius::same(12), fill);
        if selected && response.hovered() {
            painter.rect_stroke(area, CornerRadius::same(12), Stroke::new(3.0, TEXT), StrokeKind::Inside);
        }
        on
    }

    /// A button; true where it was clicked.
    pub(super) fn button(&mut self, area: Rect, label: &str) -> bool {
        let response = self.sense(area, self.ui.id().with(label), Sense::click());
        response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, label));
        let on = self.ground(area, &response, false);
        self.middle(area, label, on);
        response.clicked()
    }

    /// A button with a minus on it, or a plus.
    pub(super) fn step(&mut self, area: Rect, label: &str, more: bool) -> bool {
        let response = self.sense(area, self.ui.id().with(label), Sense::click());
        response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, label));
        let on = self.ground(area, &response, false);
        let (middle, stroke) = (area.center(), Stroke::new(3.5, on));
        self.ui.painter().line_segment([middle - vec2(11.0, 0.0), middle + vec2(11.0, 0.0)], stroke);
        if more {
            self.ui.painter().line_segment([middle - vec2(0.0, 11.0), middle + vec2(0.0, 11.0)], stroke);
        }
        response.clicked()
    }

    /// The button that hides the panel: a cross.
    pub(super) fn close(&mut self, area: Rect) -> bool {
        let response = self.sense(area, self.ui.id().with("Close"), Sense::click());
        response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, "Close"));
        let on = self.ground(area, &response, false);
        let (middle, arm) = (area.center(), 9.0);
        for way in [vec2(arm, arm), vec2(arm, -arm)] {
            self.ui.painter().line_segment([middle - way, middle + way], Stroke::new(3.0, on));
        }
        response.clicked()
    }

    /// A row of a list: words, and smaller ones about them. True where it was clicked.
    pub(super) fn row(&mut self, words: &str, about: &str, selected: bool) -> bool {
        let inset = 18.0;
        let width = self.ui.available_width();
        let about = self.galley(about, SMALL - 1.0, Color32::PLACEHOLDER, width - 2.0 * inset, 2);
        let height = if about.is_empty() { KEY } else { KEY + about.size().y + 2.0 };
        let (area, _) = self.ui.allocate_exact_size(vec2(width, height), Sense::hover());
        let response = self.sense(area, self.ui.id().with(words), Sense::click());
        response.widget_info(|| WidgetInfo::selected(WidgetType::Button, true, selected, words));
        let on = self.ground(area, &response, selected);
        let first = Rect::from_min_size(area.min, vec2(width, KEY)).shrink2(vec2(inset, 0.0));
        self.line(first, words, BODY, on);
        let colour = if selected { on } else { WEAK };
        let below = pos2(area.left() + inset, area.top() + KEY - 10.0);
        self.ui.painter().galley(below, about, colour);
        response.clicked()
    }

    /// Words in a list, and smaller ones about them.
    pub(super) fn entry(&mut self, words: &str, about: &str) {
        let width = self.ui.available_width();
        let words_of = self.galley(words, BODY, TEXT, width, 1);
        let about = self.galley(about, SMALL - 1.0, WEAK, width, 2);
        let height = words_of.size().y + about.size().y;
        let (area, response) = self.ui.allocate_exact_size(vec2(width, height), Sense::hover());
        response.widget_info(|| WidgetInfo::labeled(WidgetType::Label, true, words));
        let below = area.left_top() + vec2(0.0, words_of.size().y);
        self.ui.painter().galley(area.left_top(), words_of, TEXT);
        self.ui.painter().galley(below, about, WEAK);
    }

    /// One of several, side by side, each as wide as its words need; the one that was clicked.
    pub(super) fn choose<T: Copy + PartialEq>(
        &mut self,
        area: Rect,
        all: &[(T, &str)],
        now: &T,
    ) -> Option<T> {
        let width = |label: &str| self.galley(label, BODY, TEXT, f32::INFINITY, 1).size().x;
        let words: f32 = all.iter().map(|(_, label)| width(label)).sum();
        let gaps = GAP * (all.len() - 1) as f32;
        let padding = (area.width() - gaps - words) / all.len() as f32;
        let widths: Vec<f32> = all.iter().map(|(_, label)| width(label) + padding).collect();
        let (mut left, mut chosen) = (area.left(), None);
        for ((value, label), width) in all.iter().zip(widths) {
            let key = Rect::from_min_size(pos2(left, area.top()), vec2(width, area.height()));
            left += width + GAP;
            let response = self.sense(key, self.ui.id().with(label), Sense::click());
            let selected = value == now;
            response.widget_info(|| WidgetInfo::selected(WidgetType::RadioButton, true, selected, label));
            let on = self.ground(key, &response, selected);
            self.middle(key, label, on);
            if response.clicked() && !selected {
                chosen = Some(*value);
            }
        }
        chosen
    }

    /// A slider from 0 to 1; what it came to, where it was moved.
    pub(super) fn slide(&mut self, area: Rect, label: &str, share: f32) -> Option<Slid> {
        let response = self.sense(area, self.ui.id().with(label), Sense::click_and_drag());
        response.widget_info(|| WidgetInfo::slider(true, f64::from(share), label));
        let rail = area.shrink2(vec2(KNOB, 0.0)).x_range();
        let at = |share: f32| pos2(rail.min + share.clamp(0.0, 1.0) * rail.span(), area.center().y);
        let pointed = response.interact_pointer_pos().map(|pointer| (pointer.x - rail.min) / rail.span());
        // Where it is let go of, or lost sight of, it stays.
        let moved = pointed.filter(|_| response.clicked() || response.dragged());
        let shown = moved.unwrap_or(share).clamp(0.0, 1.0);
        let settled = response.clicked() || response.drag_stopped();
        let painter = self.ui.painter();
        let lit = response.hovered() || response.dragged();
        for (to, colour) in [(1.0, AT_REST), (shown, ACCENT)] {
            let bar = Rect::from_two_pos(at(0.0) - vec2(0.0, 6.0), at(to) + vec2(0.0, 6.0));
            painter.rect_filled(bar, 6.0, colour);
        }
        painter.circle_filled(at(shown), if lit { KNOB } else { KNOB - 3.0 }, TEXT);
        (moved.is_some() || settled).then_some(Slid { share: shown, settled })
    }

    /// Where the hand points.
    pub(super) fn cursor(&self, at: Pos2, pressed: bool) {
        let painter = self.ui.painter();
        let radius = if pressed { 6.0 } else { 9.0 };
        painter.circle_filled(at, radius + 2.5, Color32::from_black_alpha(170));
        painter.circle_filled(at, radius, if pressed { ACCENT } else { Color32::WHITE });
    }

    fn middle(&self, area: Rect, label: &str, colour: Color32) {
        let galley = self.galley(label, BODY, colour, area.width() - 12.0, 1);
        self.ui.painter().galley(area.center() - galley.size() / 2.0, galley, colour);
    }
}

/// Radius of a slider's knob.
const KNOB: f32 = 19.0;
