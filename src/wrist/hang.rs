//! PURE: whether the panel is shown, and where it hangs: over the wrist of the off hand, or in the air.

use std::time::Duration;

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use crate::aids::{PanelAid, facing};
use crate::controllers::{Hands, is_held};
use crate::rig::Pose;

/// Where the panel is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PanelPlace {
    /// Over the wrist of the off hand, facing the head.
    #[default]
    Wrist,
    /// In the air, where it was opened.
    Floating,
}

impl PanelPlace {
    /// Its name in settings.
    pub fn name(self) -> &'static str {
        match self {
            PanelPlace::Wrist => "wrist",
            PanelPlace::Floating => "floating",
        }
    }
}

/// Cosines of the angle between the palm and the way from the hand to the head at which bare hands show the panel (40
/// degrees) and hide it again (60).
const PALM: [f32; 2] = [0.77, 0.5];

/// The hand counts only where the head looks about there: cosine of 60 degrees.
const LOOKED_AT: f32 = 0.5;

/// Between the hand and the panel's lower edge, in metres.
const ABOVE_M: f32 = 0.05;

/// How far ahead of the head it floats, in metres, and how far below its height.
const AHEAD_M: f32 = 0.6;
const BELOW_M: f32 = 0.12;

/// How much larger it is there: it is as large for the eye as on the wrist, which is nearer.
const FLOATING_SCALE: f32 = 1.5;

/// Time in which about 2/3 of the hand's way is followed: letters that tremble with the hand are not read.
const FOLLOWS_S: f32 = 0.06;

/// Who wears the headset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wearer {
    /// His head, in metres from the seat.
    pub head: Pose,
    /// His off hand: 0 is the left one.
    pub off: usize,
    /// What his off hand holds has a button for the panel; None: it holds nothing that is known, and is not seen.
    pub has_button: Option<bool>,
    /// Where he wants it.
    pub place: PanelPlace,
}

/// The panel from frame to frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hang {
    /// It was opened, and not closed since.
    open: bool,
    /// The button was down; the palm faced the head.
    button: bool,
    palm: bool,
    shown: Option<Shown>,
}

#[derive(Clone, Copy, Debug)]
struct Shown {
    pose: Pose,
    place: PanelPlace,
}

impl Hang {
    /// Where the panel of this size (in metres, on the wrist) hangs in a frame of `dt`; None: it is hidden. While it is
    /// `held` it stands still: what is clicked on does not slip away.
    pub fn heed(
        &mut self,
        hands: &Hands,
        wearer: &Wearer,
        size_m: [f32; 2],
        (held, dt): (bool, Duration),
    ) -> Option<PanelAid> {
        let Wearer { head, off, place, .. } = *wearer;
        let pressed = !std::mem::replace(&mut self.button, hands.panel) && hands.panel;
        let grip = hands.hands[off].grip;
        let was = self.palm;
        self.palm = wearer.has_button == Some(false)
            && grip.is_some_and(|grip| is_held(was, palm(&grip, &head, off), PALM));
        self.open ^= pressed;
        match (place, wearer.has_button) {
            // As long as it is looked at, unless it was closed meanwhile.
            (PanelPlace::Wrist, Some(false)) => self.open = self.palm && (self.open || !was),
            (PanelPlace::Wrist, None) if was => self.open = false,
            (PanelPlace::Floating, Some(false)) => self.open ^= self.palm && !was,
            _ => {}
        }
        if !self.open {
            self.shown = None;
            return None;
        }
        let size_m =
            size_m.map(|side| if place == PanelPlace::Floating { FLOATING_SCALE } else { 1.0 } * side);
        let last = self.shown.filter(|shown| shown.place == place).map(|shown| shown.pose);
        let pose = match (place, grip, last) {
            (_, _, Some(last)) if held => last,
            (PanelPlace::Wrist, Some(grip), None) => over(&grip, &head, size_m),
            (PanelPlace::Wrist, Some(grip), Some(last)) => follow(&last, &over(&grip, &head, size_m), dt),
            // A hand that is not seen for a while leaves it where it is.
            (_, _, Some(last)) => last,
            (_, _, None) => ahead(&head),
        };
        self.shown = Some(Shown { pose, place });
        Some(PanelAid { pose, size_m })
    }

    /// Whether it is shown.
    pub fn is_shown(&self) -> bool {
        self.shown.is_some()
    }

    /// Positions count from elsewhere now: where it is shown, it opens anew.
    pub fn unseat(&mut self) {
        self.shown = None;
    }

    /// It is hidden, whatever showed it.
    pub fn close(&mut self) {
        (self.open, self.shown) = (false, None);
    }
}

/// How much a palm faces the head that looks at it, as a cosine. The palm of a left hand is towards +x of its grip pose,
/// that of a right hand towards −x (OpenXR, "Standard pose identifiers").
fn palm(grip: &Pose, head: &Pose, hand: usize) -> f32 {
    let outwards = grip.orientation * if hand == 0 { Vec3::X } else { Vec3::NEG_X };
    let to_head = (head.position - grip.position).normalize_or_zero();
    let looks = head.orientation * Vec3::NEG_Z;
    if looks.dot(-to_head) < LOOKED_AT { -1.0 } else { outwards.dot(to_head) }
}

/// Above a hand, tilted so that it faces the head.
fn over(grip: &Pose, head: &Pose, [_, height]: [f32; 2]) -> Pose {
    let up = 0.5 * height + ABOVE_M;
    let tilt = facing(grip.position + up * Vec3::Y, head.position, Vec3::Y).orientation;
    Pose { position: grip.position + tilt * (up * Vec3::Y), orientation: tilt }
}

/// Ahead of the head, whatever its pitch.
fn ahead(head: &Pose) -> Pose {
    let looks = head.orientation * Vec3::NEG_Z;
    let level = Vec3::new(looks.x, 0.0, looks.z).try_normalize().unwrap_or(Vec3::NEG_Z);
    let position = head.position + AHEAD_M * level - BELOW_M * Vec3::Y;
    facing(position, head.position, Vec3::Y)
}

fn follow(last: &Pose, wanted: &Pose, dt: Duration) -> Pose {
    let share = 1.0 - (-dt.as_secs_f32() / FOLLOWS_S).exp();
    let orientation: Quat = last.orientation.slerp(wanted.orientation, share);
    Pose { position: last.position.lerp(wanted.position, share), orientation: orientation.normalize() }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]

    use super::*;
    use crate::controllers::Hand;

    const SIZE: [f32; 2] = [0.28, 0.24];
    const FRAME: Duration = Duration::from_millis(11);

    fn wearer(has_button: Option<bool>, place: PanelPlace) -> Wearer {
        let head = Pose { position: Vec3::ZERO, orientation: Quat::IDENTITY };
        Wearer { head, off: 0, has_button, place }
    }

    /// The left hand, ahead and below, its palm turned so.
    fn hands(panel: bool, palm: Vec3) -> Hands {
        let orientation = Quat::from_rotation_arc(Vec3::X, palm.normalize());
        let grip = Pose { position: Vec3::new(-0.1, -0.2, -0.4), orientation };
        let hand = Hand { grip: Some(grip), ..Hand::default() };
        Hands { hands: [hand, Hand::default()], panel, ..Hands::default() }
    }

    #[test]
    fn a_button_opens_it_and_closes_it() {
        let mut hang = Hang::default();
        let wearer = wearer(Some(true), PanelPlace::Wrist);
        let mut heed = |panel| hang.heed(&hands(panel, Vec3::Z), &wearer, SIZE, (false, FRAME)).is_some();
        let seen = [false, true, true, false, true, true, false].map(&mut heed);
        assert_eq!(seen, [false, true, true, true, false, false, false]);
    }

    #[test]
    fn it_hangs_over_the_hand_and_faces_the_head() {
        let mut hang = Hang::default();
        let wearer = wearer(Some(true), PanelPlace::Wrist);
        let aid = hang.heed(&hands(true, Vec3::Z), &wearer, SIZE, (false, FRAME)).unwrap();
        assert_eq!(aid.size_m, SIZE);
        let front = aid.pose.orientation * Vec3::Z;
        assert!(front.dot((Vec3::ZERO - aid.pose.position).normalize()) > 0.98, "{aid:?}");
        let lower = aid.pose.position - aid.pose.orientation * Vec3::Y * SIZE[1] / 2.0;
        let grip = Vec3::new(-0.1, -0.2, -0.4);
        assert!((lower.distance(grip) - ABOVE_M).abs() < 1e-5, "{lower}");
        // It follows the hand, not at once; and while it is held, not at all.
        let mut moved = hands(true, Vec3::Z);
        moved.hands[0].grip.as_mut().unwrap().position.x += 0.1;
        let held = hang.heed(&moved, &wearer, SIZE, (true, FRAME)).unwrap();
        assert_eq!(held, aid);
        let first = hang.heed(&moved, &wearer, SIZE, (false, FRAME)).unwrap();
        let way = first.pose.position.distance(aid.pose.position);
        assert!(way > 0.01 && way < 0.05, "{way}");
        for _ in 0..100 {
            hang.heed(&moved, &wearer, SIZE, (false, FRAME));
        }
        // And where the hand is not seen it stays.
        let there = hang.heed(&moved, &wearer, SIZE, (false, FRAME)).unwrap();
        moved.hands[0].grip = None;
        assert_eq!(hang.heed(&moved, &wearer, SIZE, (false, FRAME)), Some(there));
        assert!((there.pose.position.x - aid.pose.position.x - 0.1).abs() < 0.02, "{there:?}");
    }

    #[test]
    fn bare_hands_show_it_by_turning_the_palm() {
        let wearer = wearer(Some(false), PanelPlace::Wrist);
        let to_head = Vec3::new(0.1, 0.2, 0.4).normalize();
        let aside = to_head.any_orthonormal_vector();
        let palm = |degrees: f32| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            hands(false, cos * to_head + sin * aside)
        };
        let mut hang = Hang::default();
        let mut heed = |degrees| hang.heed(&palm(degrees), &wearer, SIZE, (false, FRAME)).is_some();
        let seen = [90.0, 50.0, 35.0, 50.0, 65.0, 50.0].map(&mut heed);
        assert_eq!(seen, [false, false, true, true, false, false]);
        // Closed, it is shown when the palm is turned to the head another time.
        let mut hang = Hang::default();
        let heed =
            |hang: &mut Hang, degrees| hang.heed(&palm(degrees), &wearer, SIZE, (false, FRAME)).is_some();
        assert!(heed(&mut hang, 10.0));
        hang.close();
        let seen = [10.0, 50.0, 10.0, 65.0, 10.0].map(|degrees| heed(&mut hang, degrees));
        assert_eq!(seen, [false, false, false, false, true]);
        // Floating, each turn of the palm opens or closes it.
        let floating = Wearer { place: PanelPlace::Floating, ..wearer };
        let mut hang = Hang::default();
        let mut heed = |degrees| hang.heed(&palm(degrees), &floating, SIZE, (false, FRAME)).is_some();
        let seen = [90.0, 10.0, 90.0, 10.0, 10.0].map(&mut heed);
        assert_eq!(seen, [false, true, true, false, false]);
        // A hand that is not seen any more shows nothing.
        let mut hang = Hang::default();
        assert!(hang.heed(&palm(0.0), &wearer, SIZE, (false, FRAME)).is_some());
        let unseen = Wearer { has_button: None, ..wearer };
        assert!(hang.heed(&Hands::default(), &unseen, SIZE, (false, FRAME)).is_none());
        // A palm behind the back is not meant.
        let away = Wearer { head: Pose { orientation: Quat::from_rotation_y(2.5), ..wearer.head }, ..wearer };
        assert!(Hang::default().heed(&palm(0.0), &away, SIZE, (false, FRAME)).is_none());
    }

    #[test]
    fn it_floats_where_it_was_opened() {
        let mut hang = Hang::default();
        let mut wearer = wearer(Some(true), PanelPlace::Floating);
        wearer.head.orientation = Quat::from_rotation_y(1.0) * Quat::from_rotation_x(-0.8);
        let aid = hang.heed(&hands(true, Vec3::Z), &wearer, SIZE, (false, FRAME)).unwrap();
        let (x, y, z) = aid.pose.position.into();
        assert!((Vec3::new(x, 0.0, z).length() - AHEAD_M).abs() < 1e-5 && y == -BELOW_M, "{aid:?}");
        assert!(aid.pose.position.dot(wearer.head.orientation * Vec3::NEG_Z) > 0.0);
        assert_eq!(aid.size_m, SIZE.map(|side| side * FLOATING_SCALE));
        wearer.head = Pose { position: Vec3::ONE, orientation: Quat::IDENTITY };
        assert_eq!(hang.heed(&hands(true, Vec3::Z), &wearer, SIZE, (false, FRAME)), Some(aid));
        // From another seat it is ahead again, and stays there.
        hang.unseat();
        let anew = hang.heed(&hands(true, Vec3::Z), &wearer, SIZE, (true, FRAME)).unwrap();
        let ahead = Vec3::new(0.0, -BELOW_M, -AHEAD_M);
        assert!(anew.pose.position.distance(wearer.head.position + ahead) < 1e-5, "{anew:?}");
        wearer.head.position = Vec3::ZERO;
        assert_eq!(hang.heed(&hands(true, Vec3::Z), &wearer, SIZE, (false, FRAME)), Some(anew));
        hang.close();
        assert!(!hang.is_shown());
        assert_eq!(hang.heed(&hands(true, Vec3::Z), &wearer, SIZE, (false, FRAME)), None);
    }
}
