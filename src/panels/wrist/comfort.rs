//! What spares the stomach, and where the panel is.

use egui::{Align2, Rect, pos2, vec2};

use super::parts::{BODY, GAP, KEY, Parts, TEXT};
use super::{Choices, Known, WristWish};
use crate::wrist::PanelPlace;

/// Points across that the names take.
const NAMES: f32 = 128.0;

/// Steps of turning, in degrees.
const TURNS: [(f32, &str); 5] = [(0.0, "smooth"), (15.0, "15°"), (30.0, "30°"), (45.0, "45°"), (90.0, "90°")];

/// Metres between which the nearest ground is kept, on the slider.
const NEAREST_M: [f64; 2] = [0.25, 50.0];

pub(super) fn show(parts: &mut Parts<'_>, area: Rect, known: &Known, wish: &mut dyn FnMut(WristWish)) {
    let now = known.choices;
    let mut row = area.top();
    let mut named = |parts: &Parts<'_>, name: &str| {
        let middle = pos2(area.left(), row + KEY / 2.0);
        parts.text(middle, Align2::LEFT_CENTER, name, BODY, TEXT);
        let left = area.left() + NAMES;
        let rest = Rect::from_min_size(pos2(left, row), vec2(area.right() - left, KEY));
        row += KEY + GAP + 4.0;
        rest
    };
    let mut choose = |choices, settled| wish(WristWish::Choose { choices, settled });

    let rest = named(parts, "Vignette");
    if let Some(vignette) = parts.choose(rest, &[(true, "on"), (false, "off")], &now.vignette) {
        choose(Choices { vignette, ..now }, true);
    }
    let rest = named(parts, "Turning");
    if let Some(snap_turn) = parts.choose(rest, &TURNS, &now.snap_turn) {
        choose(Choices { snap_turn, ..now }, true);
    }
    let rest = named(parts, "Ground at");
    let (slider, value) = rest.split_left_right_at_x(rest.right() - 76.0);
    let [low, high] = NEAREST_M.map(f64::log2);
    let share = (now.comfort_m.log2() - low) / (high - low);
    let slid = parts.slide(slider, "Ground at", share as f32);
    let metres = format!("{} m", two_digits(now.comfort_m));
    parts.text(value.right_center(), Align2::RIGHT_CENTER, &metres, BODY, TEXT);
    if let Some(slid) = slid {
        let comfort_m = (low + f64::from(slid.share) * (high - low)).exp2();
        choose(Choices { comfort_m, ..now }, slid.settled);
    }
    let rest = named(parts, "Posture");
    if let Some(standing) = parts.choose(rest, &[(false, "seated"), (true, "standing")], &now.standing) {
        choose(Choices { standing, ..now }, true);
    }
    let rest = named(parts, "Fly along");
    if let Some(fly_by_head) = parts.choose(rest, &[(false, "hand"), (true, "gaze")], &now.fly_by_head) {
        choose(Choices { fly_by_head, ..now }, true);
    }
    let rest = named(parts, "Panel");
    let places = [(PanelPlace::Wrist, "on the wrist"), (PanelPlace::Floating, "in the air")];
    if let Some(panel) = parts.choose(rest, &places, &now.panel) {
        choose(Choices { panel, ..now }, true);
    }
}

fn two_digits(number: f64) -> String {
    match number {
        n if n < 0.995 => format!("{n:.2}"),
        n if n < 9.95 => format!("{n:.1}"),
        n => format!("{n:.0}"),
    }
}
