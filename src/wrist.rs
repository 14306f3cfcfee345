//! The wearer's panel: where it hangs, what points at it, what is seen on it and what is asked for there.
//!
//! | file | noun |
//! |---|---|
//! | `hang` | PURE: whether it is shown, and where it hangs |
//! | `point` | PURE: the hand that points at it |
//! | `shelf` | bookmarks, worlds and settings, read and written beside the frames |
//!
//! Hidden, it costs nothing: nothing is laid out, drawn or asked of the runtime. Shown, its picture is made anew when it
//! would look otherwise, and no image of the runtime's is taken without that.

mod hang;
mod point;
mod shelf;

use std::collections::VecDeque;
use std::time::Duration;

use anyhow::Result;
use egui::pos2;

pub use self::hang::{Hang, PanelPlace, Wearer};
pub use self::point::{Pointer, Pointing};
use self::shelf::News;
pub use self::shelf::{Departure, Saver, Shelf};
use crate::aids::{Aids, PanelAid};
use crate::controllers::{ControllerSettings, Hands};
use crate::panels::controller_lines;
use crate::panels::wrist::{
    Choices, Gauges, METRES_PER_POINT, READ_FROM_M, SIZE, Touch, WristPanel, WristWish,
};
use crate::rig::Pose;
use crate::viewer::{Hung, Viewer};
use crate::world::World;

/// Pixels of the panel's picture for one of the display's, where it is read from [`READ_FROM_M`]: it may come nearer, and
/// the runtime's filter takes the first bit of sharpness.
const OVERSAMPLING: f32 = 1.5;

/// Pixels per point, at least and at most: below, letters break; above, nobody sees more.
const SCALES: [f32; 2] = [1.0, 2.0];

/// Points per second that a stick scrolls by.
const SCROLLS: f32 = 900.0;

/// A stick scrolls from the first share of its way on, and is at rest again at the second.
const STICK: [f32; 2] = [0.3, 0.2];

/// How strongly the hand feels that it points at something else, and that it has clicked, 0 to 1.
const OVER: f32 = 0.15;
const CLICK: f32 = 0.45;

/// How long the panel says what was done.
const NOTICE_S: f64 = 4.0;

/// The wearer's panel from frame to frame. It stays through everything that happens to sessions.
#[derive(Default)]
pub struct Wrist {
    /// Reads and writes beside the frames.
    pub shelf: Shelf,
    hang: Hang,
    pointer: Pointer,
    pointing: Pointing,
    aid: Option<PanelAid>,
    panel: WristPanel,
    wishes: VecDeque<WristWish>,
    departure: Option<Departure>,
    /// Pixels per point, once it was shown.
    scale: Option<f32>,
    /// The stick was pushed towards the panel, and is not back at rest.
    scrolls: bool,
    main: usize,
    now_s: f64,
    /// When the notice goes.
    notice_s: f64,
    /// As of the viewer's last frame: [`Viewer::seats_left`], and the number of [`Viewer::bound`].
    seats_left: u32,
    bound: Option<u32>,
}

impl Wrist {
    /// Whether the panel is shown.
    pub fn is_shown(&self) -> bool {
        self.aid.is_some()
    }

    /// Where it hangs.
    pub fn aid(&self) -> Option<&PanelAid> {
        self.aid.as_ref()
    }

    /// What it looks like.
    pub fn panel(&self) -> &WristPanel {
        &self.panel
    }

    /// The hands, left and right, that are at work on it.
    pub fn occupied(&self) -> [bool; 2] {
        std::array::from_fn(|hand| hand == self.main && self.pointing.occupied)
    }

    /// The stick that turns scrolls the panel, and is not to turn or lift the wearer.
    pub fn scrolls(&self) -> bool {
        self.scrolls
    }

    /// Ends the ray at the panel of the hand that points at it: what is behind is not meant.
    pub fn cut(&self, aids: &mut Aids) {
        if let (Some(hand), Some(ray_m)) = (&mut aids.hands[self.main], self.pointing.ray_m) {
            hand.ray_m = Some(ray_m);
        }
    }

    /// What was asked for.
    pub fn wish(&mut self) -> Option<WristWish> {
        self.wishes.pop_front()
    }

    /// Hides it.
    pub fn close(&mut self) {
        self.hang.close();
    }

    /// Where the wearer is to go, once that is ready.
    pub fn departure(&mut self) -> Option<Departure> {
        self.departure.take()
    }

    /// Whether there is somewhere to go.
    pub fn departs(&self) -> bool {
        self.departure.is_some()
    }

    /// What the panel is to say, where it is shown.
    pub fn know(&mut self, gauges: Gauges, choices: Choices, world: &World) {
        let known = &mut self.panel.known;
        (known.gauges, known.choices) = (gauges, choices);
        if known.world != world.name {
            known.world.clone_from(&world.name);
        }
    }

    /// Says something on the panel, for a while.
    pub fn notify(&mut self, words: String) {
        self.panel.known.notice = words;
        self.notice_s = self.now_s + NOTICE_S;
    }

    /// Takes the panel on by a frame of `dt`: places it, hears of the hands, lays it out where that is due, and has it shown.
    ///
    /// # Errors
    /// Session or device are lost.
    pub fn tend(&mut self, viewer: &mut Viewer, settings: &ControllerSettings, dt: Duration) -> Result<()> {
        self.now_s += dt.as_secs_f64();
        self.hear();
        let hands = viewer.hands();
        let off = usize::from(settings.left_handed);
        self.main = 1 - off;
        let was_shown = self.is_shown();
        let head = self.meet(viewer);
        self.aid = head.and_then(|head| {
            let has_button = viewer.has_panel_button(off);
            let wearer = Wearer { head, off, has_button, place: settings.panel };
            let size_m = SIZE.map(|points| points * METRES_PER_POINT);
            self.hang.heed(&hands, &wearer, size_m, (self.pointing.pressed, dt))
        });
        self.pointing = self.pointer.heed(&hands.hands[self.main], self.aid.as_ref());
        let scroll = self.scroll(&hands, dt);
        let Some(aid) = self.aid else {
            self.let_go();
            return viewer.hang(None);
        };
        if !was_shown {
            self.shelf.look();
        }
        self.learn_bound(viewer);
        let touch = Touch {
            at: self.pointing.at.map(|at| pos2(at.x * SIZE[0], at.y * SIZE[1])),
            pressed: self.pointing.pressed,
            scroll,
        };
        if self.panel.is_due(&touch, self.now_s) {
            let scale = self.scale(viewer);
            let wishes = &mut self.wishes;
            let felt = self.panel.paint(&touch, scale, self.now_s, &mut |wish| wishes.push_back(wish));
            if felt.over || felt.clicked {
                viewer.pulse_hand(self.main, if felt.clicked { CLICK } else { OVER })?;
            }
        }
        let (painted, serial) = self.panel.picture();
        viewer.hang(Some(&Hung { aid, painted, serial }))
    }

    /// Where the wearer's head is. None before the viewer's first frame: another session has other seats and controllers.
    fn meet(&mut self, viewer: &Viewer) -> Option<Pose> {
        let head = viewer.head_drawn();
        let seats_left = std::mem::replace(&mut self.seats_left, viewer.seats_left());
        if head.is_none() || seats_left != self.seats_left {
            self.hang.unseat();
        }
        if head.is_none() {
            self.bound = None;
        }
        head
    }

    /// What the controllers do, where that may have changed.
    fn learn_bound(&mut self, viewer: &Viewer) {
        let (bound, number) = viewer.bound();
        if self.bound.replace(number) != Some(number) {
            self.panel.known.controls = controller_lines(bound);
        }
    }

    /// The panel is gone: a slider that was held stays where it is.
    fn let_go(&mut self) {
        if let (true, Some(scale)) = (self.panel.is_held(), self.scale) {
            let wishes = &mut self.wishes;
            self.panel.paint(&Touch::default(), scale, self.now_s, &mut |wish| wishes.push_back(wish));
        }
    }

    /// News of what was read and written.
    fn hear(&mut self) {
        while let Some(news) = self.shelf.news() {
            match news {
                News::Places(places) => self.panel.known.places = places,
                News::Worlds(worlds) => self.panel.known.worlds = worlds,
                News::Notice(words) => self.notify(words),
                News::Departure(departure) => self.departure = Some(*departure),
            }
        }
        if self.now_s >= self.notice_s && !self.panel.known.notice.is_empty() {
            self.panel.known.notice.clear();
        }
    }

    /// Points by which the stick scrolls in this frame.
    fn scroll(&mut self, hands: &Hands, dt: Duration) -> f32 {
        let way = hands.turn.length();
        let begins = self.pointing.occupied && way >= STICK[0];
        self.scrolls = begins || (self.scrolls && way >= STICK[1]);
        let scrolls = self.scrolls && self.pointing.at.is_some() && hands.turn.is_finite();
        if scrolls { hands.turn.y * SCROLLS * dt.as_secs_f32() } else { 0.0 }
    }

    /// Pixels per point: so many that a display pixel at the panel's usual distance has more than one of them. It is
    /// settled once: the picture's size stays.
    fn scale(&mut self, viewer: &Viewer) -> f32 {
        let [least, most] = SCALES;
        *self.scale.get_or_insert_with(|| {
            let tangent_of_point = METRES_PER_POINT / READ_FROM_M;
            let pixels = viewer.display_pixels_per_tangent().map(|pixels| pixels * tangent_of_point);
            let wanted = pixels.map_or(least, |pixels| (OVERSAMPLING * pixels).clamp(least, most));
            (4.0 * wanted).ceil() / 4.0
        })
    }
}
