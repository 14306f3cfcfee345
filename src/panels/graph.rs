//! The time graph: a column per frame, its parts on top of each other.

use egui::{Align2, Color32, FontId, Mesh, Rect, Sense, Shape, Stroke, Ui, pos2, vec2};

use super::numbers::{History, Part};

/// Colours of parts, told apart by most eyes; after the last the first comes again.
const COLOURS: [Color32; 10] = [
    Color32::from_rgb(0x56, 0xb4, 0xe9),
    Color32::from_rgb(0x6b, 0x74, 0x82),
    Color32::from_rgb(0xcc, 0x79, 0xa7),
    Color32::from_rgb(0xe6, 0x9f, 0x00),
    Color32::from_rgb(0x00, 0x9e, 0x73),
    Color32::from_rgb(0xf0, 0xe4, 0x42),
    Color32::from_rgb(0xd5, 0x5e, 0x00),
    Color32::from_rgb(0x33, 0x7f, 0xd0),
    Color32::from_rgb(0xa6, 0xd8, 0x54),
    Color32::from_rgb(0xb1, 0x7a, 0xe0),
];

/// Milliseconds that a graph may reach up to.
const SCALES: [f64; 13] = [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0];

/// The colour of the part of this number.
pub(super) fn colour(index: usize) -> Color32 {
    COLOURS[index % COLOURS.len()]
}

/// Draws the parts of the frames remembered, each in its colour.
pub(super) fn show(ui: &mut Ui, title: &str, history: &History, parts: &[(Part, Color32)], height: f32) {
    let (area, _) = ui.allocate_exact_size(vec2(ui.available_width(), height), Sense::hover());
    let painter = ui.painter_at(area);
    painter.rect_filled(area, 2.0, Color32::from_black_alpha(120));
    let top = scale(history, parts);
    painter.add(columns(area, history, parts, top));
    let line = Stroke::new(1.0, Color32::from_white_alpha(40));
    painter.hline(area.x_range(), area.center().y, line);
    let small = FontId::proportional(10.0);
    let mark = |at, ms: f64, align| {
        painter.text(at, align, format!("{ms} ms"), small.clone(), Color32::from_gray(200));
    };
    mark(area.right_top() + vec2(-3.0, 1.0), top, Align2::RIGHT_TOP);
    mark(area.right_center() + vec2(-3.0, 1.0), top / 2.0, Align2::RIGHT_TOP);
    painter.text(
        area.left_top() + vec2(4.0, 1.0),
        Align2::LEFT_TOP,
        title,
        small.clone(),
        Color32::from_gray(200),
    );
}

/// The first scale that nearly all frames fit in.
fn scale(history: &History, parts: &[(Part, Color32)]) -> f64 {
    let mut sums: Vec<f64> =
        history.moments().map(|moment| parts.iter().map(|(part, _)| part.of(moment)).sum()).collect();
    let most = crate::telemetry::quantile_of(&mut sums, 0.98).unwrap_or(0.0);
    SCALES.into_iter().find(|scale| *scale >= most).unwrap_or(SCALES[SCALES.len() - 1])
}

fn columns(area: Rect, history: &History, parts: &[(Part, Color32)], top: f64) -> Shape {
    // A frame is a point wide: the newest are at the right.
    let room = area.width().max(0.0) as usize;
    let mut mesh = Mesh::default();
    mesh.reserve_triangles(2 * parts.len() * room.min(history.moments().len()));
    for (i, moment) in history.moments().rev().take(room).enumerate() {
        let right = area.right() - i as f32;
        let mut y = area.bottom();
        for (part, colour) in parts {
            let tall = (part.of(moment) / top) as f32 * area.height();
            // What is thinner than a hair is not seen.
            if tall < 0.05 {
                continue;
            }
            let above = (y - tall).max(area.top());
            mesh.add_colored_rect(Rect::from_min_max(pos2(right - 1.0, above), pos2(right, y)), *colour);
            y = above;
        }
    }
    Shape::mesh(mesh)
}
