//! Speed, and what one does at once.

use egui::{Align2, Rect, pos2, vec2};

use super::parts::{BODY, GAP, KEY, Parts, SMALL, TEXT, WEAK};
use super::{Choices, Known, WristWish};
use crate::pilot::SPEEDS;

/// Octaves of speed that a click on − or + changes it by, as the wheel of a mouse does.
const STEP: f64 = 0.25;

pub(super) fn show(parts: &mut Parts<'_>, area: Rect, known: &Known, wish: &mut dyn FnMut(WristWish)) {
    let choices = known.choices;
    let top = area.top();
    parts.text(pos2(area.left(), top), Align2::LEFT_TOP, "Speed", BODY, TEXT);
    let most = format!("{:.2} octaves a second", choices.speed);
    parts.text(pos2(area.right(), top), Align2::RIGHT_TOP, &most, BODY, TEXT);
    let row = Rect::from_min_size(pos2(area.left(), top + 36.0), vec2(area.width(), KEY));
    let (slower, rest) = row.split_left_right_at_x(row.left() + KEY);
    let (middle, faster) = rest.split_left_right_at_x(rest.right() - KEY);
    let mut set = |speed: f64, settled| {
        let speed = speed.clamp(SPEEDS.0, SPEEDS.1);
        wish(WristWish::Choose { choices: Choices { speed, ..choices }, settled });
    };
    if parts.step(slower, "Slower", false) {
        set(choices.speed * (-STEP).exp2(), true);
    }
    if parts.step(faster, "Faster", true) {
        set(choices.speed * STEP.exp2(), true);
    }
    let [low, high] = [SPEEDS.0.log2(), SPEEDS.1.log2()];
    let share = (choices.speed.log2() - low) / (high - low);
    if let Some(slid) = parts.slide(middle, "Speed", share as f32) {
        set((low + f64::from(slid.share) * (high - low)).exp2(), slid.settled);
    }
    let now = match known.gauges.speed {
        Some(speed) => format!("now {speed:.2}"),
        None => "A flight goes by itself: fly, and you steer.".to_owned(),
    };
    parts.text(pos2(area.left(), row.bottom() + 8.0), Align2::LEFT_TOP, &now, SMALL, WEAK);

    let all = [
        ("Back to the start", WristWish::Restart),
        ("Upright", WristWish::Level),
        ("Centre my seat", WristWish::Recentre),
        ("Mark this place", WristWish::Mark),
    ];
    let size = vec2((area.width() - GAP) / 2.0, KEY + 24.0);
    let first = pos2(area.left(), row.bottom() + 56.0);
    for (i, (label, asked)) in all.into_iter().enumerate() {
        let step = vec2((i % 2) as f32 * (size.x + GAP), (i / 2) as f32 * (size.y + GAP));
        if parts.button(Rect::from_min_size(first + step, size), label) {
            wish(asked);
        }
    }
    let below = first.y + 2.0 * (size.y + GAP) + 22.0;
    let rest = Rect::from_min_max(pos2(area.left(), below), area.max);
    let title = known.worlds.iter().find(|[name, _]| *name == known.world).map_or("", |[_, title]| title);
    parts.text(rest.left_top(), Align2::LEFT_TOP, &known.world, BODY, TEXT);
    let title = parts.galley(title, SMALL, WEAK, rest.width(), 2);
    parts.ui.painter().galley(rest.left_top() + vec2(0.0, 32.0), title, WEAK);
}
