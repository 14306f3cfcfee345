//! Bookmarks and worlds.

use egui::{Align2, Rect};

use super::parts::{BODY, KEY, Parts, WEAK};
use super::{Known, WristWish, scrolled};

pub(super) fn show_places(parts: &mut Parts<'_>, area: Rect, known: &Known, wish: &mut dyn FnMut(WristWish)) {
    let (list, foot) = area.split_top_bottom_at_y(area.bottom() - KEY - 8.0);
    if parts.button(foot.with_min_y(foot.bottom() - KEY), "Mark this place") {
        wish(WristWish::Mark);
    }
    if known.places.is_empty() {
        parts.text(list.center(), Align2::CENTER_CENTER, "No place is marked yet.", BODY, WEAK);
        return;
    }
    scrolled(parts, list, |parts| {
        for name in &known.places {
            if parts.row(name, "", false) {
                wish(WristWish::Go(name.clone()));
            }
        }
    });
}

pub(super) fn show_worlds(parts: &mut Parts<'_>, area: Rect, known: &Known, wish: &mut dyn FnMut(WristWish)) {
    scrolled(parts, area, |parts| {
        for [name, about] in &known.worlds {
            if parts.row(name, about, *name == known.world) {
                wish(WristWish::World(name.clone()));
            }
        }
    });
}
