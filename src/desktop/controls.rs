//! Keys, mouse and gamepad, from their events to what a person wants in a frame.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use glam::{Vec2, Vec3};
use winit::keyboard::KeyCode;

use super::gamepad::PadWish;
use crate::input::Input;
use crate::settings::{Action, Bindings, Key, MouseSettings, Settings, Side};

/// Radians that the look turns per count of the mouse, at a sensitivity of 1.
const LOOK_PER_COUNT: f32 = 0.002;

/// What is pressed, and what has happened since it was last asked.
#[derive(Debug)]
pub struct Controls {
    keys: Bindings<Key>,
    mouse: MouseSettings,
    held: BTreeSet<KeyCode>,
    /// Pressed since the last frame, so that a press shorter than a frame counts for one.
    tapped: BTreeSet<KeyCode>,
    pad: PadWish,
    look: Vec2,
    notches: f32,
    restart: bool,
    recentre: bool,
    cursor: Option<[f64; 2]>,
    /// The click before, which may become a double-click.
    clicked: Option<(Instant, [f64; 2])>,
    /// Where a double-click dives to, until something ends that.
    falling: Option<[f64; 2]>,
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
    /// Nobody holds the dive: it goes on until it has arrived, and [`Controls::land`] is called.
    pub falls: bool,
    /// Pixels of the window; 0 where nobody sees it.
    pub window: [u32; 2],
    /// Whose picture the window shows.
    pub side: Side,
    /// The picture is to be kept.
    pub screenshot: bool,
    /// The place is to be kept.
    pub bookmark: bool,
}

impl Controls {
    /// Nothing is pressed.
    pub fn new(settings: &Settings) -> Controls {
        Controls {
            keys: settings.keys.clone(),
            mouse: settings.mouse,
            held: BTreeSet::new(),
            tapped: BTreeSet::new(),
            pad: PadWish::default(),
            look: Vec2::ZERO,
            notches: 0.0,
            restart: false,
            recentre: false,
            cursor: None,
            clicked: None,
            falling: None,
            taken: false,
            window: [0, 0],
            hidden: false,
            side: settings.mirror.side,
            screenshots: 0,
            bookmarks: 0,
        }
    }

    /// Other keys, another mouse.
    pub fn set(&mut self, settings: &Settings) {
        self.keys.clone_from(&settings.keys);
        self.mouse = settings.mouse;
    }

    /// A key goes down. Returns what it does.
    pub fn press(&mut self, key: KeyCode) -> Vec<Action> {
        self.held.insert(key);
        self.tapped.insert(key);
        let actions: Vec<Action> = self.keys.actions(Key(key)).collect();
        self.falling = None;
        actions.iter().for_each(|action| self.fire(*action));
        actions
    }

    /// Whether a key does this.
    pub fn does(&self, key: KeyCode, action: Action) -> bool {
        self.keys.actions(Key(key)).any(|one| one == action)
    }

    /// What happens once, as a key or a button goes down.
    fn fire(&mut self, action: Action) {
        match action {
            Action::NextEye => self.side = self.side.next(),
            Action::Screenshot => self.screenshots += 1,
            Action::Bookmark => self.bookmarks += 1,
            Action::Faster => self.notches += 1.0,
            Action::Slower => self.notches -= 1.0,
            Action::Restart => self.restart = true,
            Action::Recentre => self.recentre = true,
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

    /// What the gamepads ask for in the next frame. Returns what their buttons do that went down since the frame before.
    pub fn pad(&mut self, wish: PadWish) -> impl Iterator<Item = Action> + use<> {
        let pressed = wish.pressed_since(&self.pad);
        self.pad = wish;
        for action in pressed.clone() {
            self.falling = None;
            self.fire(action);
        }
        pressed
    }

    /// The mouse moves by counts, to the right and down.
    pub fn look(&mut self, counts: [f64; 2]) {
        if self.taken {
            let up = if self.mouse.invert { 1.0 } else { -1.0 };
            let per_count = LOOK_PER_COUNT * self.mouse.sensitivity;
            self.look += Vec2::new(counts[0] as f32, up * counts[1] as f32) * per_count;
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

    /// The mouse's main button goes down. Twice at one place within a moment is a dive to there.
    pub fn click(&mut self, now: Instant) {
        let at = self.target();
        let near = |before: [f64; 2]| {
            (at[0] - before[0]).hypot(at[1] - before[1]) <= f64::from(self.mouse.double_click_pixels)
        };
        let moment = Duration::from_millis(self.mouse.double_click_ms);
        let double = !moment.is_zero()
            && self
                .clicked
                .take()
                .is_some_and(|(when, before)| now.saturating_duration_since(when) <= moment && near(before));
        self.falling = double.then_some(at);
        if !double {
            self.clicked = Some((now, at));
        }
    }

    /// The dive of a double-click is over.
    pub fn land(&mut self) {
        self.falling = None;
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

    /// The window shows another picture.
    pub fn show(&mut self, side: Side) {
        self.side = side;
    }

    fn middle(&self) -> [f64; 2] {
        self.window.map(|pixels| f64::from(pixels) / 2.0)
    }

    /// Under the cursor, or in the middle where there is none.
    fn target(&self) -> [f64; 2] {
        self.cursor.filter(|_| !self.taken).unwrap_or(self.middle())
    }

    /// A key of the action is held, or was since the last frame.
    fn holds(&self, action: Action) -> bool {
        self.keys.of(action).iter().any(|key| self.held.contains(&key.0) || self.tapped.contains(&key.0))
    }

    /// What is wanted in the next frame.
    pub fn take(&mut self) -> Hands {
        let amount = |action| if self.holds(action) { 1.0 } else { self.pad.amount(action) };
        let axis = |more, less| amount(more) - amount(less);
        let travel = Vec3::new(
            axis(Action::Right, Action::Left),
            axis(Action::Up, Action::Down),
            axis(Action::Back, Action::Ahead),
        );
        let input = Input {
            travel: travel + self.pad.travel,
            look: self.look,
            turn: self.pad.turn,
            roll: axis(Action::RollRight, Action::RollLeft) + self.pad.roll,
            faster: self.notches,
            rise: amount(Action::BackOut),
            level_up: amount(Action::LevelUp) > 0.0,
            restart: self.restart,
            recentre: self.recentre,
            ..Input::default()
        };
        let held = self.holds(Action::Dive).then(|| self.target());
        let held = held.or_else(|| (self.pad.amount(Action::Dive) > 0.0).then(|| self.middle()));
        if held.is_some() {
            self.falling = None;
        }
        let hands = Hands {
            input,
            dive: held.or(self.falling),
            falls: self.falling.is_some(),
            window: if self.hidden { [0, 0] } else { self.window },
            side: self.side,
            screenshot: std::mem::take(&mut self.screenshots) > 0,
            bookmark: std::mem::take(&mut self.bookmarks) > 0,
        };
        self.tapped.clear();
        (self.look, self.notches) = (Vec2::ZERO, 0.0);
        (self.restart, self.recentre) = (false, false);
        hands
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn controls() -> Controls {
        Controls::new(&Settings::default())
    }

    fn steers(hands: &Hands) -> bool {
        hands.dive.is_some() || hands.input.steers()
    }

    #[test]
    fn a_press_shorter_than_a_frame_counts_for_one_frame() {
        let mut controls = controls();
        controls.press(KeyCode::KeyW);
        controls.release(KeyCode::KeyW);
        assert_eq!(controls.take().input.travel, Vec3::NEG_Z);
        assert!(!steers(&controls.take()));
    }

    #[test]
    fn what_is_held_goes_on_until_it_is_let_go_or_the_window_left() {
        let mut controls = controls();
        controls.press(KeyCode::KeyX);
        controls.press(KeyCode::KeyR);
        assert!(controls.take().input.restart);
        let next = controls.take();
        assert!(next.input.rise == 1.0 && !next.input.restart);
        controls.release_all();
        assert!(!steers(&controls.take()));
    }

    #[test]
    fn the_mouse_looks_only_when_taken_and_dives_go_to_the_middle_then() {
        let mut controls = controls();
        controls.resize([800, 600]);
        controls.point(Some([10.0, 20.0]));
        controls.look([5.0, 5.0]);
        controls.press(KeyCode::KeyZ);
        let hands = controls.take();
        assert_eq!((hands.input.look, hands.dive), (Vec2::ZERO, Some([10.0, 20.0])));
        assert!(!hands.falls);
        controls.take_mouse(true);
        controls.look([5.0, 5.0]);
        let hands = controls.take();
        assert!(hands.input.look.x > 0.0 && hands.input.look.y < 0.0);
        assert_eq!(hands.dive, Some([400.0, 300.0]));
    }

    #[test]
    fn a_double_click_dives_until_a_key_a_click_or_the_end_of_the_dive() {
        let start = Instant::now();
        let ms = |ms| start + Duration::from_millis(ms);
        let mut controls = controls();
        controls.resize([800, 600]);
        controls.point(Some([100.0, 50.0]));
        controls.click(ms(0));
        assert_eq!(controls.take().dive, None);
        controls.point(Some([104.0, 53.0]));
        controls.click(ms(390));
        for _ in 0..3 {
            let hands = controls.take();
            assert!(hands.falls && hands.dive == Some([104.0, 53.0]));
        }
        controls.press(KeyCode::KeyG);
        assert_eq!(controls.take().dive, None);

        let double = |controls: &mut Controls, first, second, moved| {
            controls.point(Some([100.0, 50.0]));
            controls.click(ms(first));
            controls.point(Some([100.0 + moved, 50.0]));
            controls.click(ms(second));
            controls.take().falls
        };
        assert!(!double(&mut controls, 1_000, 1_500, 0.0), "too slow");
        assert!(!double(&mut controls, 3_000, 3_100, 7.0), "too far");
        assert!(double(&mut controls, 5_000, 5_100, 6.0));
        controls.click(ms(9_000));
        assert!(!controls.take().falls, "ended by a click");
        assert!(double(&mut controls, 11_000, 11_100, 0.0));
        controls.land();
        assert!(!controls.take().falls, "arrived");
        assert!(double(&mut controls, 13_000, 13_100, 0.0));
        controls.press(KeyCode::KeyZ);
        let hands = controls.take();
        assert!(hands.dive.is_some() && !hands.falls, "held now");
    }

    #[test]
    fn other_keys_do_what_the_settings_say_and_the_old_ones_nothing() {
        let mut settings = Settings::default();
        let dive = toml::from_str("dive = ['Enter', 'Numpad5']\nnext_eye = 'Tab'");
        settings.keys = dive.unwrap_or_else(|error| panic!("{error}"));
        let mut controls = controls();
        controls.set(&settings);
        controls.resize([8, 8]);
        for key in [KeyCode::Enter, KeyCode::Numpad5] {
            assert_eq!(controls.press(key), [Action::Dive]);
            assert!(controls.take().dive.is_some());
            controls.release(key);
        }
        assert!(controls.press(KeyCode::KeyZ).is_empty() && controls.press(KeyCode::KeyM).is_empty());
        assert_eq!(controls.press(KeyCode::Tab), [Action::NextEye]);
        let hands = controls.take();
        assert!(hands.dive.is_none() && hands.side == Side::Right);
    }

    #[test]
    fn a_gamepad_flies_and_its_buttons_act_once() {
        use crate::desktop::gamepad::PadState;
        use crate::settings::{Button, Stick};
        let settings = Settings::default();
        let mut controls = controls();
        controls.resize([800, 600]);
        controls.point(Some([1.0, 2.0]));
        let mut state = PadState::default();
        state.sticks[Stick::LeftY as usize] = 1.0;
        state.sticks[Stick::RightX as usize] = -1.0;
        state.buttons[Button::LeftTrigger as usize] = 0.5;
        state.buttons[Button::West as usize] = 1.0;
        state.buttons[Button::DpadUp as usize] = 1.0;
        state.buttons[Button::RightTrigger as usize] = 1.0;
        let wish = || PadWish::new(&state, &settings.gamepad);
        let pressed: Vec<_> = controls.pad(wish()).collect();
        assert!(pressed.contains(&Action::Screenshot) && pressed.contains(&Action::Faster), "{pressed:?}");
        let hands = controls.take();
        assert!(hands.screenshot && hands.input.faster == 1.0);
        assert!(hands.input.travel == Vec3::NEG_Z && hands.input.turn == Vec2::NEG_X);
        assert!(hands.input.rise > 0.3 && hands.input.rise < 0.5, "{}", hands.input.rise);
        assert_eq!(hands.dive, Some([400.0, 300.0]), "to the middle, not to the cursor");
        assert_eq!(controls.pad(wish()).count(), 0, "held, not pressed again");
        let hands = controls.take();
        assert!(!hands.screenshot && hands.input.faster == 0.0 && hands.dive.is_some());
        assert_eq!(controls.pad(PadWish::default()).count(), 0);
        assert!(!steers(&controls.take()));
    }
}
