//! What the controllers do that are in the hands, in the runtime's words.

use egui::{Align2, Rect};

use super::parts::{BODY, Parts, WEAK};
use super::{Known, scrolled};

pub(super) fn show(parts: &mut Parts<'_>, area: Rect, known: &Known) {
    if known.controls.is_empty() {
        parts.text(area.center(), Align2::CENTER_CENTER, "No controller is held.", BODY, WEAK);
        return;
    }
    scrolled(parts, area, |parts| {
        for line in &known.controls {
            parts.entry(&line.action, &line.inputs);
        }
    });
}
