//! What is known of the person who wears the headset: whether he sees anything, where he looks, and what has moved him
//! by nobody's wish.

use glam::{Quat, Vec3};

use super::Viewer;
use crate::rig::Pose;
use crate::xr;

/// A head that is tracked again has moved if it is so far from where it was last taken to be: metres, and radians.
const JOLT_M: f32 = 0.1;
const JOLT: f32 = 0.1;

/// The wearer as of the last picture.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Wearer {
    /// The last call drew a picture.
    pub(super) drew: bool,
    /// Where his head was, and what was known of that.
    head: Option<(Pose, xr::Tracking)>,
    jolted: bool,
}

impl Wearer {
    /// The next picture is for this head. `moved`: its origin is not that of the picture before.
    pub(super) fn meet(&mut self, head: Pose, tracking: xr::Tracking, moved: bool) {
        let before = self.head.replace((head, tracking)).filter(|_| self.drew && !moved);
        self.jolted = before.is_none_or(|(was, knew)| {
            let again = |known: fn(xr::Tracking) -> bool| known(tracking) && !known(knew);
            (again(is_placed) && was.position.distance(head.position) > JOLT_M)
                || (again(is_turned) && was.orientation.angle_between(head.orientation) > JOLT)
        });
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
        self.wearer.head.is_none_or(|(_, tracking)| is_turned(tracking))
    }

    /// The last picture was the first of the session or after a while without one, or its wearer is elsewhere than in the
    /// one before by nobody's wish: the origin of all poses has moved, or he is tracked again.
    pub fn has_jolted(&self) -> bool {
        self.wearer.has_jolted()
    }

    /// The head of the last frame drawn, with its position in metres from the seat. Looking ahead from the seat before
    /// there was one.
    pub fn head(&self) -> Pose {
        let [left, right] = [0, 1].map(|eye| self.eye(eye).map(|eye| eye.pose));
        let middle = left.zip(right).map(|(left, right)| Pose {
            position: left.position.midpoint(right.position),
            orientation: left.orientation,
        });
        middle.unwrap_or(Pose { position: Vec3::ZERO, orientation: Quat::IDENTITY })
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
        let meets = |wearer: &mut Wearer, head, tracking, moved| {
            wearer.meet(head, tracking, moved);
            wearer.drew = true;
            wearer.has_jolted()
        };
        assert!(meets(&mut wearer, at(0.0, 0.0), Full, false), "the first picture");
        assert!(!meets(&mut wearer, at(0.0, 0.0), Full, false));
        assert!(!meets(&mut wearer, at(1.0, 1.0), Full, false), "a quick head is his own");
        assert!(!meets(&mut wearer, at(1.0, 1.0), Lost, false));
        assert!(!meets(&mut wearer, at(1.01, 1.01), Full, false), "back where he was");
        assert!(!meets(&mut wearer, at(1.0, 1.0), Lost, false));
        assert!(meets(&mut wearer, at(1.0, 1.5), Full, false), "turned meanwhile");
        assert!(!meets(&mut wearer, at(1.0, 3.0), OrientationOnly, false), "he turns, and is seen to");
        assert!(meets(&mut wearer, at(0.5, 3.0), Full, false), "moved meanwhile");
        assert!(meets(&mut wearer, at(0.5, 3.0), Full, true), "the origin has moved");
        wearer.drew = false;
        assert!(meets(&mut wearer, at(0.5, 3.0), Full, false), "after a while without a picture");
    }
}
