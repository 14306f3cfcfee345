//! Keys and mouse, from the window's events to what a person wants in a frame.

use std::collections::BTreeSet;

use glam::{Vec2, Vec3};
use winit::keyboard::KeyCode;

use super::pane::Side;
use crate::input::Input;

/// Radians that the look turns per count of the mouse.
const LOOK_PER_COUNT: f32 = 0.002;

/// What is pressed, and what has happened since it was last asked.
#[derive(Debug, Default)]
pub struct Controls {
    held: BTreeSet<KeyCode>,
    /// Pressed since the last frame, so that a press shorter than a frame counts for one.
    tapped: BTreeSet<KeyCode>,
    look: Vec2,
    notches: f32,
    cursor: Option<[f64; 2]>,
    /// The mouse looks around, and there is no cursor.
    taken: bool,
    window: [u32; 2],
    hidden: bool,
    side: Side,
    screenshots: u32,
    bookmarks: u32,
}

/// What a person wants in one frame, and of the window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hands {
    /// What he wants of the flight, but for the dive's ray.
    pub input: Input,
    /// Point of the window to dive to, while that is held.
    pub dive: Option<[f64; 2]>,
    /// Pixels of the window; 0 where nobody sees it.
    pub window: [u32; 2],
    /// Whose picture the window shows.
    pub side: Side,
    /// The picture is to be kept.
    pub screenshot: bool,
    /// The place is to be kept.
    pub bookmark: bool,
}

impl Hands {
    /// He wants to go or look somewhere.
    pub fn steer(&self) -> bool {
        self.dive.is_some() || Input { faster: 0.0, ..self.input } != Input::default()
    }
}

impl Controls {
    /// A key goes down.
    pub fn press(&mut self, key: KeyCode) {
        self.held.insert(key);
        self.tapped.insert(key);
        match key {
            KeyCode::KeyM => self.side = self.side.next(),
            KeyCode::KeyP => self.screenshots += 1,
            KeyCode::KeyB => self.bookmarks += 1,
            _ => {}
        }
    }

    /// A key goes up.
    pub fn release(&mut self, key: KeyCode) {
        self.held.remove(&key);
    }

    /// The keyboard goes elsewhere: what is held is not heard of again.
    pub fn release_all(&mut self) {
        self.held.clear();
    }

    /// The mouse moves by counts, to the right and down.
    pub fn look(&mut self, counts: [f64; 2]) {
        if self.taken {
            self.look += Vec2::new(counts[0] as f32, -counts[1] as f32) * LOOK_PER_COUNT;
        }
    }

    /// The wheel turns by notches, away from the person.
    pub fn wheel(&mut self, notches: f32) {
        self.notches += notches;
    }

    /// The cursor is at a pixel of the window, or outside.
    pub fn point(&mut self, cursor: Option<[f64; 2]>) {
        self.cursor = cursor;
    }

    /// The mouse looks around, or points.
    pub fn take_mouse(&mut self, taken: bool) {
        self.taken = taken;
    }

    /// The mouse looks around.
    pub fn has_mouse(&self) -> bool {
        self.taken
    }

    /// The window has so many pixels.
    pub fn resize(&mut self, window: [u32; 2]) {
        self.window = window;
    }

    /// Nobody sees the window.
    pub fn hide(&mut self, hidden: bool) {
        self.hidden = hidden;
    }

    /// What is wanted in the next frame.
    pub fn take(&mut self) -> Hands {
        let is = |key| self.held.contains(&key) || self.tapped.contains(&key);
        let axis = |more, less| f32::from(is(more)) - f32::from(is(less));
        let input = Input {
            travel: Vec3::new(
                axis(KeyCode::KeyD, KeyCode::KeyA),
                axis(KeyCode::Space, KeyCode::KeyC),
                axis(KeyCode::KeyS, KeyCode::KeyW),
            ),
            look: self.look,
            roll: axis(KeyCode::KeyE, KeyCode::KeyQ),
            faster: self.notches,
            rise: f32::from(is(KeyCode::KeyX)),
            level_up: is(KeyCode::KeyL),
            restart: self.tapped.contains(&KeyCode::KeyR),
            ..Input::default()
        };
        let middle = self.window.map(|pixels| f64::from(pixels) / 2.0);
        let target = self.cursor.filter(|_| !self.taken).unwrap_or(middle);
        let hands = Hands {
            input,
            dive: is(KeyCode::KeyZ).then_some(target),
            window: if self.hidden { [0, 0] } else { self.window },
            side: self.side,
            screenshot: std::mem::take(&mut self.screenshots) > 0,
            bookmark: std::mem::take(&mut self.bookmarks) > 0,
        };
        self.tapped.clear();
        (self.look, self.notches) = (Vec2::ZERO, 0.0);
        hands
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_press_shorter_than_a_frame_counts_for_one_frame() {
        let mut controls = Controls::default();
        controls.press(KeyCode::KeyW);
        controls.release(KeyCode::KeyW);
        assert_eq!(controls.take().input.travel, Vec3::NEG_Z);
        assert!(!controls.take().steer());
    }

    #[test]
    fn what_is_held_goes_on_until_it_is_let_go_or_the_window_left() {
        let mut controls = Controls::default();
        controls.press(KeyCode::KeyX);
        controls.press(KeyCode::KeyR);
        assert!(controls.take().input.restart);
        let next = controls.take();
        assert!(next.input.rise == 1.0 && !next.input.restart);
        controls.release_all();
        assert!(!controls.take().steer());
    }

    #[test]
    fn the_mouse_looks_only_when_taken_and_dives_go_to_the_middle_then() {
        let mut controls = Controls::default();
        controls.resize([800, 600]);
        controls.point(Some([10.0, 20.0]));
        controls.look([5.0, 5.0]);
        controls.press(KeyCode::KeyZ);
        let hands = controls.take();
        assert_eq!((hands.input.look, hands.dive), (Vec2::ZERO, Some([10.0, 20.0])));
        controls.take_mouse(true);
        controls.look([5.0, 5.0]);
        let hands = controls.take();
        assert!(hands.input.look.x > 0.0 && hands.input.look.y < 0.0);
        assert_eq!(hands.dive, Some([400.0, 300.0]));
    }
}
