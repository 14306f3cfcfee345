//! What all of it means, and the keys.

use egui::{CollapsingHeader, Grid, RichText, ScrollArea, Ui, Window, vec2};

use crate::inspect::{BackdropView, OCTAVE, SWITCHES, SurfaceView};

/// What some keys do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeyLine {
    /// What is done, in a few words.
    pub action: String,
    /// The keys, as they are written on them.
    pub keys: String,
    /// What it does, in a sentence; may be empty.
    pub meaning: String,
}

/// The keys where nobody has chosen others.
pub fn usual_keys() -> Vec<KeyLine> {
    let lines = [
        ("Look around", "F", "Takes the mouse; F or Esc lets it go."),
        ("Fly", "W S, A D, Space C", "Ahead and back, left and right, up and down."),
        ("Roll", "Q E", "To the left and to the right."),
        ("Faster, slower", "wheel", "A quarter of an octave per notch."),
        ("Dive", "Z", "Held: towards the point under the cursor, or ahead while the mouse is taken."),
        ("Back out", "X", "Held: away from the ground, as fast as it was reached."),
        ("Level up", "L", "Held: turns upright."),
        ("Start", "R", "Back to where it began."),
        ("Eyes", "M", "Left eye, right eye, both, and a camera that follows the head smoothly."),
        ("Picture, bookmark", "P, B", "Keeps the picture in captures/; the place as a bookmark."),
        ("Panels", "F1", "Shows and hides these panels."),
        ("Full screen", "F11", ""),
        ("End", "Esc", ""),
    ];
    let line = |(action, keys, meaning): (&str, &str, &str)| KeyLine {
        action: action.to_owned(),
        keys: keys.to_owned(),
        meaning: meaning.to_owned(),
    };
    lines.into_iter().map(line).collect()
}

/// Questions that a newcomer has.
const QUESTIONS: [(&str, &str); 6] = [
    (
        "What am I looking at?",
        "A landscape that has detail at every scale. Hold Z over a rock: it becomes a landscape of its own, and the one you came from becomes mountains on the horizon. There is no bottom. Hold X to come back out.",
    ),
    (
        "What is an octave?",
        "Halving. Each octave that you fall, everything is twice as large, and new hills half the size have come up between the old ones. Ten octaves are a thousand times.",
    ),
    (
        "What is a tile?",
        "A square of ground with so many heights. Tiles near you are split into four of half the size, again and again, as far as you can see a difference: 'Colours by level' and 'Wireframe' show it.",
    ),
    (
        "What is the backdrop?",
        "Ground so far away that both eyes see the same, and that your moving does not shift it. It is baked into a cubemap, ring by ring, and drawn again only when you have come so far that it would show: 'Backdrop: Tinted' shows where it begins.",
    ),
    (
        "What are the numbers on the right?",
        "Each frame's time, by its parts: 'now' is the mean of the last ten frames, '99 %' is what only one frame in a hundred exceeds, 'worst' the longest of the last 300. The graphs show the same frames, the newest at the right. CPU parts and GPU passes run beside each other, so they do not add up.",
    ),
    (
        "What is an address?",
        "A place in the world as a line of text, exact to the bit at any depth. Every picture carries its own. `fathomless view --at ADDRESS` goes there.",
    ),
];

pub(super) struct Help {
    pub(super) is_open: bool,
    keys: Vec<KeyLine>,
}

impl Help {
    pub(super) fn new(keys: Vec<KeyLine>) -> Help {
        Help { is_open: false, keys }
    }

    pub(super) fn show(&mut self, ui: &Ui) {
        let room = ui.ctx().content_rect().shrink(16.0);
        Window::new("Help")
            .open(&mut self.is_open)
            .collapsible(false)
            .default_size(vec2(440.0, 420.0).min(room.size()))
            .default_pos(room.min + vec2(super::options::WIDTH + 8.0, 8.0))
            .constrain_to(room)
            .show(ui.ctx(), |ui| {
                ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                    show_keys(ui, &self.keys);
                    show_questions(ui);
                    show_options(ui);
                });
            });
    }
}

fn show_keys(ui: &mut Ui, keys: &[KeyLine]) {
    CollapsingHeader::new("Keys").default_open(true).show(ui, |ui| {
        Grid::new("keys").num_columns(3).spacing([12.0, 3.0]).show(ui, |ui| {
            for line in keys {
                ui.label(RichText::new(&line.keys).monospace().strong());
                ui.label(&line.action);
                ui.add(egui::Label::new(RichText::new(&line.meaning).weak()).wrap());
                ui.end_row();
            }
        });
    });
}

fn show_questions(ui: &mut Ui) {
    for (question, answer) in QUESTIONS {
        CollapsingHeader::new(question).show(ui, |ui| ui.label(answer));
    }
}

fn show_options(ui: &mut Ui) {
    CollapsingHeader::new("What do the options on the left show?").show(ui, |ui| {
        let switches = SWITCHES.iter().map(|switch| (switch.label, switch.about));
        let ground = SurfaceView::CHOICES.iter().map(|choice| (choice.label, choice.about));
        let backdrop = BackdropView::CHOICES.iter().map(|choice| (choice.label, choice.about));
        let all = switches.chain([(OCTAVE.label, OCTAVE.about)]).map(|(label, about)| ("", label, about));
        let ground = ground.map(|(label, about)| ("Ground: ", label, about));
        let backdrop = backdrop.map(|(label, about)| ("Backdrop: ", label, about));
        for (group, label, about) in all.chain(ground).chain(backdrop) {
            ui.horizontal_wrapped(|ui| {
                ui.strong(format!("{group}{label}."));
                ui.label(about);
            });
        }
    });
}
