//! What is known of the person who wears the headset: whether he sees anything, where he looks, and what has moved him
//! by nobody's wish.

use glam::{Quat, Vec3};

use super::Viewer;
use crate::rig::Pose;
use crate::xr;

/// A head that is tracked again has moved if it is so far from where it was last taken to be: metres, and radians.
const JOLT_M: f32 = 0.1;
const JOLT: f32 = 0.1;

/// Nanoseconds without a picture after which the wearer is no longer where he saw himself last. Single pictures that are
/// missing are stood in for by the runtime.
const GAP_NS: i64 = 250_000_000;

/// Whom a picture is for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight {
    /// Where his head is, and what is known of that.
    pub(super) head: Pose,
    pub(super) tracking: xr::Tracking,
    /// How often the origin of all poses had moved.
    pub(super) origin_moves: u32,
    /// When he sees it, in the runtime's nanoseconds.
    pub(super) at_ns: i64,
}

/// The wearer from picture to picture.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Wearer {
    /// The picture drawn last, and the last one that was shown: a frame may be refused.
    drawn: Option<Sight>,
    shown: Option<Sight>,
    /// The last call showed a picture; one since the last picture did not.
    fresh: bool,
    missed: bool,
    jolted: bool,
}

impl Wearer {
    /// Another frame, of which there may come a picture.
    pub(super) fn begin(&mut self) {
        self.missed |= !std::mem::take(&mut self.fresh);
    }

    /// The session rests: whatever comes is the first picture.
    pub(super) fn forget(&mut self) {
        self.shown = None;
    }

    /// The next picture is for this head.
    pub(super) fn meet(&mut self, sight: Sight) {
        self.drawn = Some(sight);
        let Sight { head, tracking, origin_moves, at_ns } = sight;
        // Pictures that follow each other may take as long as they do.
        let is_late = |was: &Sight| self.missed && at_ns.saturating_sub(was.at_ns) > GAP_NS;
        let before = self.shown.filter(|was| was.origin_moves == origin_moves && !is_late(was));
        self.jolted = before.is_none_or(|was| {
            let again = |known: fn(xr::Tracking) -> bool| known(tracking) && !known(was.tracking);
            (again(is_placed) && was.head.position.distance(head.position) > JOLT_M)
                || (again(is_turned) && was.head.orientation.angle_between(head.orientation) > JOLT)
        });
    }

    /// The picture was handed over.
    pub(super) fn show(&mut self) {
        (self.shown, self.fresh, self.missed) = (self.drawn, true, false);
    }

    /// The picture shows the wearer elsewhere of a sudden.
    pub(super) fn has_jolted(&self) -> bool {
        self.jolted
    }
}

/// The place is known.
fn is_placed(tracking: xr::Tracking) -> bool {
    matches!(tracking, xr::Tracking::Full | xr::Tracking::PositionOnly)
}

/// The direction is known.
fn is_turned(tracking: xr::Tracking) -> bool {
    matches!(tracking, xr::Tracking::Full | xr::Tracking::OrientationOnly)
}

impl Viewer {
    /// False while the runtime says that nobody wears the headset.
    pub fn is_worn(&self) -> bool {
        self.session.is_worn()
    }

    /// Somebody wears the headset and sees these pictures: they are not hidden, and the session runs.
    pub fn is_seen(&self) -> bool {
        let hidden =
            !matches!(self.session.phase(), xr::Phase::Running(xr::Shown::Visible | xr::Shown::Focused));
        self.is_worn() && !hidden
    }

    /// It was known at the last picture where the wearer looks. A head whose place alone is unknown stays where it was.
    pub fn is_tracked(&self) -> bool {
        self.wearer.drawn.is_none_or(|sight| is_turned(sight.tracking))
    }

    /// The last picture was the first of the session or after a quarter of a second without one, or its wearer is elsewhere
    /// than in the one before by nobody's wish: the origin of all poses has moved, or he is tracked again.
    pub fn has_jolted(&self) -> bool {
        self.wearer.has_jolted()
    }

    /// The head of the last frame drawn, with its position in metres from the seat. Looking ahead from the seat before
    /// there was one.
    pub fn head(&self) -> Pose {
        self.head_drawn().unwrap_or(Pose { position: Vec3::ZERO, orientation: Quat::IDENTITY })
    }

    /// The same; None before there was a frame.
    pub fn head_drawn(&self) -> Option<Pose> {
        let [left, right] = [self.eye(0)?.pose, self.eye(1)?.pose];
        Some(Pose { position: left.position.midpoint(right.position), orientation: left.orientation })
    }

    /// Where the wearer's head is in the next frame becomes his seat.
    pub fn recentre(&mut self) {
        self.seat = None;
        self.seats_left += 1;
        // Where it hangs was told from the old seat.
        self.panel.hide();
    }

    /// Another number each time that the seat was left: positions from it are others since.
    pub fn seats_left(&self) -> u32 {
        self.seats_left
    }

    /// How far below the seat the floor is, in metres; None where the runtime does not know.
    pub fn floor_m(&self) -> Option<f32> {
        let known = self.session.origin() != xr::Origin::Eyes;
        self.seat.filter(|_| known).map(|seat| seat.position.y)
    }

    /// Radians from the middle of the view to the farthest corner of an eye's picture; None before there was one.
    pub fn widest(&self) -> Option<f32> {
        let corner = |[left, right, up, down]: [f32; 4]| {
            let across = left.tan().abs().max(right.tan().abs());
            across.hypot(up.tan().abs().max(down.tan().abs())).atan()
        };
        self.eyes.map(|eyes| corner(eyes[0].fov).max(corner(eyes[1].fov)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xr::Tracking::{Full, Lost, OrientationOnly};

    #[test]
    fn what_jolts_is_being_elsewhere_by_nobodys_wish() {
        let at = |x: f32, turn: f32| Pose {
            position: Vec3::new(x, 1.6, 0.0),
            orientation: Quat::from_rotation_y(turn),
        };
        let mut wearer = Wearer::default();
        let mut at_ns = 0;
        let mut meets = |wearer: &mut Wearer, head, tracking, origin_moves| {
            at_ns += 11_000_000;
            wearer.begin();
            wearer.meet(Sight { head, tracking, origin_moves, at_ns });
            wearer.show();
            wearer.has_jolted()
        };
        assert!(meets(&mut wearer, at(0.0, 0.0), Full, 0), "the first picture");
        assert!(!meets(&mut wearer, at(0.0, 0.0), Full, 0));
        assert!(!meets(&mut wearer, at(1.0, 1.0), Full, 0), "a quick head is his own");
        assert!(!meets(&mut wearer, at(1.0, 1.0), Lost, 0));
        assert!(!meets(&mut wearer, at(1.01, 1.01), Full, 0), "back where he was");
        assert!(!meets(&mut wearer, at(1.0, 1.0), Lost, 0));
        assert!(meets(&mut wearer, at(1.0, 1.5), Full, 0), "turned meanwhile");
        assert!(!meets(&mut wearer, at(1.0, 3.0), OrientationOnly, 0), "he turns, and is seen to");
        assert!(meets(&mut wearer, at(0.5, 3.0), Full, 0), "moved meanwhile");
        assert!(meets(&mut wearer, at(0.5, 3.0), Full, 1), "the origin has moved");
        assert!(!meets(&mut wearer, at(0.5, 3.0), Full, 1));
        wearer.forget();
        assert!(meets(&mut wearer, at(0.5, 3.0), Full, 1), "the first picture since the session rested");
    }

    #[test]
    fn a_picture_jolts_after_a_while_without_one_and_what_was_not_shown_was_not_seen() {
        let head = Pose { position: Vec3::ZERO, orientation: Quat::IDENTITY };
        let sight = |ms: i64| Sight { head, tracking: Full, origin_moves: 0, at_ns: ms * 1_000_000 };
        let meets = |wearer: &mut Wearer, sight: Sight, is_shown: bool| {
            wearer.begin();
            wearer.meet(sight);
            if is_shown {
                wearer.show();
            }
            wearer.has_jolted()
        };
        let mut wearer = Wearer::default();
        assert!(meets(&mut wearer, sight(0), true));
        assert!(!meets(&mut wearer, sight(2000), true), "a long frame, and no picture missing");
        wearer.begin();
        assert!(!meets(&mut wearer, sight(2022), true), "one is missing");
        (0..20).for_each(|_| wearer.begin());
        assert!(!meets(&mut wearer, sight(2250), true), "some are");
        (0..25).for_each(|_| wearer.begin());
        assert!(meets(&mut wearer, sight(2530), false), "many are");
        assert!(meets(&mut wearer, sight(2541), true), "the one in the dark was refused");
        assert!(!meets(&mut wearer, sight(2552), false));
        assert!(!meets(&mut wearer, sight(2563), true), "one is refused");
        let moved = |ms| Sight { origin_moves: 1, ..sight(ms) };
        wearer.begin();
        assert!(meets(&mut wearer, moved(2585), false), "the origin has moved while one was missing");
        assert!(meets(&mut wearer, moved(2596), true), "and that was not seen yet");
        assert!(!meets(&mut wearer, moved(2607), true));
    }
}
