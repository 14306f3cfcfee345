//! How deep this is: a ladder with a rung per octave, and the things that are as large as what is seen.

use egui::{Align2, Color32, Mesh, Rect, Shape, Stroke, pos2, vec2};

use super::Gauges;
use super::parts::{ACCENT, LARGE, Parts, SMALL, TEXT, WEAK};
use crate::yardstick::{power_of_ten, things_between};

/// Points between two rungs.
const RUNG: f32 = 24.0;

/// Points from the ladder's left rail to its right one.
const ACROSS: f32 = 26.0;

pub(super) fn show(parts: &mut Parts<'_>, area: Rect, gauges: &Gauges) {
    let Gauges { depth, .. } = *gauges;
    let digits = format!("{depth:.2}");
    // At a million octaves there is less room.
    let size = LARGE * (7.0 / digits.len().max(7) as f32);
    let number = parts.text(area.left_top() - vec2(0.0, 6.0), Align2::LEFT_TOP, &digits, size, TEXT);
    let unit = pos2(area.left(), number.bottom() - 4.0);
    let unit = parts.text(unit, Align2::LEFT_TOP, "octaves deep", SMALL, WEAK);
    let power = parts.galley(&power_of_ten(depth), SMALL, WEAK, area.width(), 2);
    let foot = area.bottom() - power.size().y;
    parts.ui.painter().galley(pos2(area.left(), foot), power, WEAK);
    let ladder = Rect::from_min_max(pos2(area.left(), unit.bottom() + 12.0), pos2(area.right(), foot - 12.0));
    rungs(parts, ladder, depth);
    things(parts, ladder, depth);
}

/// How clearly something is seen at a height of the ladder: it fades towards both ends.
fn clear(ladder: Rect, y: f32) -> f32 {
    let away = (y - ladder.center().y).abs() / (0.5 * ladder.height());
    (1.6 * (1.0 - away)).clamp(0.0, 1.0)
}

fn rungs(parts: &Parts<'_>, ladder: Rect, depth: f64) {
    let painter = parts.ui.painter();
    let (left, right) = (ladder.left() + 14.0, ladder.left() + 14.0 + ACROSS);
    let reach = f64::from(0.5 * ladder.height() / RUNG);
    let height = |octave: f64| ladder.center().y + ((octave - depth) * f64::from(RUNG)) as f32;
    for x in [left, right] {
        painter.add(rail(ladder, x));
    }
    let mut octave = (depth - reach).ceil();
    while octave <= depth + reach {
        let y = height(octave);
        let tenth = octave.rem_euclid(10.0) == 0.0;
        let (colour, width) = if tenth { (TEXT, 3.5) } else { (WEAK, 2.0) };
        painter.hline(left..=right, y, Stroke::new(width, colour.gamma_multiply(clear(ladder, y))));
        octave += 1.0;
    }
    // Where this is.
    let here = ladder.center().y;
    painter.hline(left - 4.0..=right + 4.0, here, Stroke::new(4.0, ACCENT));
    let tip = pos2(left - 4.0, here);
    let arrow = vec![tip, tip + vec2(-11.0, -9.0), tip + vec2(-11.0, 9.0)];
    painter.add(Shape::convex_polygon(arrow, ACCENT, Stroke::NONE));
}

/// A rail of the ladder, two points wide.
fn rail(ladder: Rect, x: f32) -> Shape {
    let mut mesh = Mesh::default();
    let most = ((ladder.height() / RUNG) as u32).max(1);
    for i in 0..=most {
        let y = ladder.top() + ladder.height() * i as f32 / most as f32;
        let colour = WEAK.gamma_multiply(clear(ladder, y));
        mesh.colored_vertex(pos2(x - 1.0, y), colour);
        mesh.colored_vertex(pos2(x + 1.0, y), colour);
        if i > 0 {
            let corner = 2 * i;
            mesh.add_triangle(corner - 2, corner - 1, corner);
            mesh.add_triangle(corner - 1, corner, corner + 1);
        }
    }
    Shape::mesh(mesh)
}

/// Beside the rungs: what is as large as what is seen there, if the start was the Earth.
fn things(parts: &Parts<'_>, ladder: Rect, depth: f64) {
    let left = ladder.left() + 14.0 + ACROSS + 14.0;
    let reach = f64::from(0.5 * ladder.height() / RUNG);
    let mut nearest: Option<(f64, &str)> = None;
    for (at, thing) in things_between(depth - reach, depth + reach) {
        if nearest.is_none_or(|(other, _)| (at - depth).abs() < (other - depth).abs()) {
            nearest = Some((at, thing));
        }
    }
    let mut below = f32::NEG_INFINITY;
    for (at, thing) in things_between(depth - reach, depth + reach) {
        let y = ladder.center().y + ((at - depth) * f64::from(RUNG)) as f32;
        // What physics says of it has no room here.
        let words = thing.split(',').next().unwrap_or(thing);
        let is_here = nearest.is_some_and(|(other, _)| other == at);
        let colour: Color32 = if is_here { ACCENT } else { WEAK };
        let galley = parts.galley(
            words,
            SMALL - 1.0,
            colour.gamma_multiply(clear(ladder, y)),
            ladder.right() - left,
            2,
        );
        let top = y - galley.size().y / 2.0;
        // Above the start they lie close together.
        if top < below || top < ladder.top() || top + galley.size().y > ladder.bottom() {
            continue;
        }
        below = top + galley.size().y;
        parts.ui.painter().galley(pos2(left, top), galley, colour);
    }
}
