//! What all of it means, and the keys.

use egui::{CollapsingHeader, Grid, RichText, ScrollArea, Ui, Window, vec2};

use crate::bindings::Bound;
use crate::inspect::{BackdropView, OCTAVE, SWITCHES, SurfaceView};
use crate::settings::{Action, Settings};

/// What some keys and buttons do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeyLine {
    /// What is done.
    pub action: Action,
    /// The same in a few words.
    pub does: &'static str,
    /// The keys, as settings call them.
    pub keys: String,
    /// The gamepad's buttons, as settings call them.
    pub buttons: String,
}

/// What keys and buttons do by these settings.
pub fn key_lines(settings: &Settings) -> Vec<KeyLine> {
    let bindings = settings.bindings().into_iter();
    bindings
        .map(|it| KeyLine { action: it.action, does: it.does, keys: it.keys, buttons: it.buttons })
        .collect()
}

/// What something on a controller does that is bound now.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ControllerLine {
    /// What is done, in a few words.
    pub action: String,
    /// What to press, as the runtime calls it.
    pub inputs: String,
}

/// What the controllers do that are in the hands.
pub fn controller_lines(bound: &[Bound]) -> Vec<ControllerLine> {
    let line =
        |it: &Bound| ControllerLine { action: it.action.title().to_owned(), inputs: it.inputs.join(", ") };
    bound.iter().map(line).collect()
}

/// Questions that a newcomer has. `{dive}` and `{back_out}` are the keys for that.
const QUESTIONS: [(&str, &str); 6] = [
    (
        "What am I looking at?",
        "A landscape that has detail at every scale. Hold {dive} over a rock: it becomes a landscape of its own, and the one you came from becomes mountains on the horizon. There is no bottom. Hold {back_out} to come back out.",
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
    questions: Vec<(&'static str, String)>,
    /// Nothing while no controllers are held.
    pub(super) controllers: Vec<ControllerLine>,
}

impl Help {
    pub(super) fn new(keys: Vec<KeyLine>) -> Help {
        let mut help =
            Help { is_open: false, keys: Vec::new(), questions: Vec::new(), controllers: Vec::new() };
        help.learn(keys);
        help
    }

    /// Keys and buttons do this from now on.
    pub(super) fn learn(&mut self, keys: Vec<KeyLine>) {
        self.keys = keys;
        let [dive, back_out] =
            [Action::Dive, Action::BackOut].map(|action| self.key(action).unwrap_or("(no key)").to_owned());
        let named = |text: &str| text.replace("{dive}", &dive).replace("{back_out}", &back_out);
        self.questions = QUESTIONS.map(|(question, answer)| (question, named(answer))).into();
    }

    /// The first key of an action, or else its first button.
    pub(super) fn key(&self, action: Action) -> Option<&str> {
        let line = self.keys.iter().find(|line| line.action == action)?;
        line.keys.split(' ').chain(line.buttons.split(' ')).find(|name| !name.is_empty())
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
                    show_controllers(ui, &self.controllers);
                    show_questions(ui, &self.questions);
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
                ui.label(line.does);
                ui.add(egui::Label::new(RichText::new(&line.buttons).weak()).wrap());
                ui.end_row();
            }
        });
    });
}

fn show_controllers(ui: &mut Ui, controllers: &[ControllerLine]) {
    if controllers.is_empty() {
        return;
    }
    CollapsingHeader::new("Controllers").default_open(true).show(ui, |ui| {
        Grid::new("controllers").num_columns(2).spacing([12.0, 3.0]).show(ui, |ui| {
            for line in controllers {
                ui.add(egui::Label::new(RichText::new(&line.inputs).strong()).wrap());
                ui.label(&line.action);
                ui.end_row();
            }
        });
    });
}

fn show_questions(ui: &mut Ui, questions: &[(&'static str, String)]) {
    for (question, answer) in questions {
        CollapsingHeader::new(*question).show(ui, |ui| ui.label(answer));
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
