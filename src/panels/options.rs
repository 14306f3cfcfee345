//! Left: options for seeing how it works, the world, its light, and how much is drawn.

use egui::{Button, ComboBox, DragValue, ScrollArea, Slider, TextEdit, Ui};

use super::help::Help;
use super::{Facts, Numbers, Tuning, Wish};
use crate::inspect::{BackdropView, Choice, Inspect, OCTAVE, SWITCHES, SurfaceView};
use crate::quality::{CELLS, Fineness, MESHES};
use crate::settings::{Action, Side};
use crate::world::{Sun, World};

/// Points.
pub(super) const WIDTH: f32 = 216.0;

/// What is chosen, as far as it can be changed here.
#[derive(Default)]
pub(super) struct Options {
    inspect: Inspect,
    /// The octave last chosen, for when one is wanted again.
    octave: i32,
    world: String,
    /// Digits as they are typed.
    seed: String,
    /// The light, and the world's own.
    sun: Sun,
    own_sun: Sun,
    tuning: Option<Tuning>,
    vignette: Option<bool>,
    /// Samples that a pixel may have.
    samples: Vec<u32>,
}

impl Options {
    /// Facts have changed. What was chosen in another world does not hold in this one.
    pub(super) fn learn(&mut self, before: Option<&Facts>, facts: &Facts) {
        let place = |facts: &Facts| (facts.world.clone(), facts.seed);
        if before.map(place) != Some(place(facts)) {
            self.world.clone_from(&facts.world);
            self.seed = facts.seed.to_string();
            (self.sun, self.own_sun) = (facts.sun, facts.sun);
        }
        if before.is_none() {
            self.inspect = facts.inspect;
        }
        self.tuning = Some(facts.tuning);
        self.vignette = facts.vignette;
        self.samples.clone_from(&facts.samples);
    }

    pub(super) fn show(
        &mut self,
        ui: &mut Ui,
        numbers: &Numbers,
        help: &mut Help,
        wish: &mut dyn FnMut(Wish),
    ) {
        ui.horizontal(|ui| {
            ui.heading("How it works");
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let button = ui.add(Button::new("?").selected(help.is_open));
                if button.on_hover_text("What all of this means, and the keys").clicked() {
                    help.is_open = !help.is_open;
                }
            });
        });
        ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            show_side(ui, numbers, wish);
            self.show_comfort(ui, wish);
            self.show_inspect(ui, wish);
            ui.add_space(3.0);
            self.show_world(ui, wish);
            ui.add_space(3.0);
            self.show_light(ui, wish);
            ui.add_space(3.0);
            self.show_quality(ui, wish);
            show_save(ui, numbers, wish);
            if let Some(key) = help.key(Action::Panels) {
                ui.add_space(3.0);
                ui.weak(format!("{key} hides the panels."));
            }
        });
    }

    fn show_inspect(&mut self, ui: &mut Ui, wish: &mut dyn FnMut(Wish)) {
        let before = self.inspect;
        choose(ui, "Ground", &SurfaceView::CHOICES, &mut self.inspect.surface);
        choose(ui, "Backdrop", &BackdropView::CHOICES, &mut self.inspect.backdrop);
        for switch in SWITCHES {
            let mut on = switch.is_on(&self.inspect);
            if ui.checkbox(&mut on, switch.label).on_hover_text(switch.about).changed() {
                switch.set(&mut self.inspect, on);
            }
        }
        ui.horizontal(|ui| {
            let mut one = self.inspect.octave.is_some();
            ui.checkbox(&mut one, OCTAVE.label).on_hover_text(OCTAVE.about);
            ui.add_enabled(one, DragValue::new(&mut self.octave).speed(0.05));
            self.inspect.octave = one.then_some(self.octave);
        });
        let usual = ui.add_enabled(!self.inspect.is_usual(), Button::new("All as usual"));
        if usual.on_hover_text("Undoes everything chosen above.").clicked() {
            self.inspect = Inspect::default();
        }
        if self.inspect != before {
            wish(Wish::Inspect(self.inspect));
        }
    }

    fn show_world(&mut self, ui: &mut Ui, wish: &mut dyn FnMut(Wish)) {
        ui.strong("World");
        let mut chosen = self.world.clone();
        labelled(ui, "Name", |ui| {
            ComboBox::from_id_salt("world").width(ui.available_width()).selected_text(&self.world).show_ui(
                ui,
                |ui| {
                    for name in World::names() {
                        ui.selectable_value(&mut chosen, name.to_owned(), name);
                    }
                },
            );
        });
        if chosen != self.world {
            self.world.clone_from(&chosen);
            wish(Wish::World { name: chosen, seed: None });
        }
        labelled(ui, "Seed", |ui| {
            let field = TextEdit::singleline(&mut self.seed).desired_width(ui.available_width() - 40.0);
            let done = ui.add(field).on_hover_text("A whole number: each has a landscape of its own.");
            let entered = done.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
            let seed: Option<u64> = self.seed.trim().parse().ok();
            let go = ui.add_enabled(seed.is_some(), Button::new("Go"));
            if (go.on_hover_text("To the start of that landscape").clicked() || entered) && seed.is_some() {
                wish(Wish::World { name: self.world.clone(), seed });
            }
        });
    }

    fn show_light(&mut self, ui: &mut Ui, wish: &mut dyn FnMut(Wish)) {
        ui.strong("Light");
        let before = self.sun;
        let mut held = false;
        let mut slide = |ui: &mut Ui, label, value: &mut f64, most, about| {
            labelled(ui, label, |ui| {
                ui.spacing_mut().slider_width = ui.available_width() - 48.0;
                // A slider rounds what it shows; that is no change yet.
                let mut shown = *value;
                let slider = ui.add(Slider::new(&mut shown, 0.0..=most).suffix("°").fixed_decimals(0));
                if shown != value.round() {
                    *value = shown;
                }
                held |= slider.dragged();
                slider.on_hover_text(about).drag_stopped()
            })
        };
        let turned = slide(
            ui,
            "From",
            &mut self.sun.azimuth_deg,
            360.0,
            "0° is ahead of the start, 90° to its right.",
        );
        let raised =
            slide(ui, "Height", &mut self.sun.elevation_deg, 90.0, "0° is the horizon, 90° straight above.");
        let own = ui.add_enabled(self.sun != self.own_sun, Button::new("The world's own light"));
        if own.clicked() {
            self.sun = self.own_sun;
        }
        if self.sun != before || turned || raised {
            wish(Wish::Sun { sun: self.sun, settled: !held });
        }
    }

    fn show_comfort(&mut self, ui: &mut Ui, wish: &mut dyn FnMut(Wish)) {
        let Some(on) = &mut self.vignette else { return };
        ui.strong("Headset");
        let about = "The wearer's view is narrowed while he is moved or turned: it is easier on the stomach.";
        if ui.checkbox(on, "Vignette").on_hover_text(about).changed() {
            wish(Wish::Vignette(*on));
        }
        ui.add_space(3.0);
    }

    fn show_quality(&mut self, ui: &mut Ui, wish: &mut dyn FnMut(Wish)) {
        let Some(tuning) = &mut self.tuning else { return };
        ui.strong("Quality");
        let mut done = false;
        let mut slide = |ui: &mut Ui, label, slider: Slider<'_>, about| {
            labelled(ui, label, |ui| {
                ui.spacing_mut().slider_width = ui.available_width() - 48.0;
                let slider = ui.add(slider).on_hover_text(about);
                // What it costs to follow it is too much for every step on the way.
                done |= slider.drag_stopped() || (slider.changed() && !slider.dragged());
            });
        };
        slide(
            ui,
            "Split",
            Slider::new(&mut tuning.fineness.split, 2.0..=4.0).fixed_decimals(1),
            "c: a tile is split when it is nearer than so many of its own sizes. More is finer, and draws more tiles.",
        );
        slide(
            ui,
            "Levels",
            Slider::new(&mut tuning.fineness.down, 1..=5),
            "Levels of tiles finer than those that the viewer is in.",
        );
        slide(
            ui,
            "Tiles",
            Slider::new(&mut tuning.tile_ms, 0.25..=16.0).logarithmic(true).fixed_decimals(1),
            "Milliseconds of GPU time that making tiles may take in a frame; what is missing is shown coarser.",
        );
        slide(
            ui,
            "Bake",
            Slider::new(&mut tuning.bake_ms, 0.25..=32.0).logarithmic(true).fixed_decimals(1),
            "Milliseconds of GPU time that baking the backdrop may take in a frame; with less, a fast flight is slowed down.",
        );
        let Fineness { cells, mesh, samples, .. } = &mut tuning.fineness;
        let before = (*cells, *mesh, *samples);
        pick(
            ui,
            "Cells",
            &CELLS,
            cells,
            "Heights a side of a tile. More shade more finely, and take more memory.",
        );
        *mesh = (*mesh).min(*cells);
        let meshes = &MESHES[..MESHES.partition_point(|mesh| mesh <= cells)];
        pick(
            ui,
            "Mesh",
            meshes,
            mesh,
            "Squares a side of a tile's mesh. More make finer outlines, and more triangles.",
        );
        let about = "Samples of a pixel (MSAA). More smooth the edges of ridges against the sky, and take more memory.";
        pick(ui, "Samples", &self.samples, samples, about);
        if done || before != (*cells, *mesh, *samples) {
            wish(Wish::Tuning(*tuning));
        }
    }
}

/// Whose picture the window shows.
const SIDES: [Choice<Side>; 4] = [
    side(Side::Left, "Left eye", "What the left eye sees, cropped to the window."),
    side(Side::Right, "Right eye", "What the right eye sees, cropped to the window."),
    side(Side::Both, "Both eyes", "Both, side by side."),
    side(
        Side::Spectator,
        "Spectator",
        "The left eye's without its trembling; the same where nobody wears a headset.",
    ),
];

const fn side(value: Side, label: &'static str, about: &'static str) -> Choice<Side> {
    Choice { value, word: "", label, about }
}

fn show_side(ui: &mut Ui, numbers: &Numbers, wish: &mut dyn FnMut(Wish)) {
    let Some(before) = numbers.history.last().map(|moment| moment.side) else { return };
    let mut side = before;
    choose(ui, "Window", &SIDES, &mut side);
    if side != before {
        wish(Wish::Side(side));
    }
}

/// Keeps the quality, and what the window shows.
fn show_save(ui: &mut Ui, numbers: &Numbers, wish: &mut dyn FnMut(Wish)) {
    let (Some(facts), Some(moment)) = (&numbers.facts, numbers.history.last()) else { return };
    let is_new = facts.tuning != facts.by_settings || moment.side != facts.side_by_settings;
    let save = ui.add_enabled(is_new, Button::new("Save"));
    let about = "Writes the quality and what the window shows to your own fathomless.toml, as far as they are otherwise \
                 in your settings; its comments stay. The log says where that is.";
    if save.on_hover_text(about).clicked() {
        wish(Wish::Save);
    }
}

/// A word before something that takes the rest of the row.
fn labelled<R>(ui: &mut Ui, label: &str, add: impl FnOnce(&mut Ui) -> R) -> R {
    ui.horizontal(|ui| {
        let room = egui::vec2(56.0, ui.spacing().interact_size.y);
        let left = egui::Layout::left_to_right(egui::Align::Center);
        ui.allocate_ui_with_layout(room, left, |ui| {
            ui.set_min_width(room.x);
            ui.label(label);
        });
        add(ui)
    })
    .inner
}

/// One of these numbers.
fn pick(ui: &mut Ui, label: &str, numbers: &[u32], value: &mut u32, about: &str) {
    labelled(ui, label, |ui| {
        let combo = ComboBox::from_id_salt(label).width(ui.available_width());
        let shown = combo.selected_text(value.to_string()).show_ui(ui, |ui| {
            for &number in numbers {
                ui.selectable_value(value, number, number.to_string());
            }
        });
        shown.response.on_hover_text(about);
    });
}

fn choose<T: Copy + PartialEq>(ui: &mut Ui, label: &str, choices: &[Choice<T>], value: &mut T) {
    let now = choices.iter().find(|choice| choice.value == *value);
    labelled(ui, label, |ui| {
        let combo = ComboBox::from_id_salt(label).width(ui.available_width());
        let shown = combo.selected_text(now.map_or("", |choice| choice.label)).show_ui(ui, |ui| {
            for choice in choices {
                ui.selectable_value(value, choice.value, choice.label).on_hover_text(choice.about);
            }
        });
        if let Some(choice) = now {
            shown.response.on_hover_text(choice.about);
        }
    });
}
