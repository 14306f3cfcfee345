//! PURE: the hand that points at a panel: where its ray meets it, what its trigger clicks, and when it is back at the land.

use glam::Vec2;

use crate::aids::PanelAid;
use crate::controllers::{Hand, PULLED, is_held};

/// A ray that passes a panel's edge so near still points at it, in metres: whoever misses a button by a little does not
/// mean to fall. The second holds for one that points at it already.
const MARGIN_M: [f32; 2] = [0.01, 0.025];

/// The least share of a ray's direction that goes towards the panel: rays almost along it meet it nowhere in particular.
const LEAST_SLOPE: f32 = 0.1;

/// What a trigger that is held has hold of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Holds {
    #[default]
    Nothing,
    Panel,
    /// It was pulled on a panel that was hidden since: it means nothing, until it is let go.
    Gone,
    /// It was pulled away from the panel, and stays with what it does there.
    Land,
}

/// A hand from frame to frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pointer {
    holds: Holds,
    is_over: bool,
}

/// What a hand does with a panel in a frame. [`Pointing::default`] is nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pointing {
    /// Where on the panel, from its upper left corner, right and down as shares of its sides; None: nowhere. While the
    /// trigger is held that was pulled on the panel, it may be beyond the edges.
    pub at: Option<Vec2>,
    /// The trigger is held that was pulled on the panel.
    pub pressed: bool,
    /// The hand is at work on the panel: what it does is not meant for the land.
    pub occupied: bool,
    /// Metres from the hand to the panel, along its ray.
    pub ray_m: Option<f32>,
}

impl Pointer {
    /// What `hand` does with a panel; None: there is none.
    pub fn heed(&mut self, hand: &Hand, panel: Option<&PanelAid>) -> Pointing {
        let hit = panel.and_then(|panel| meet(hand, panel));
        let margin_m = MARGIN_M[usize::from(self.is_over)];
        self.is_over = hit.is_some_and(|hit| hit.beyond_m <= margin_m);
        self.holds = match self.holds {
            held if !is_held(held != Holds::Nothing, hand.dive, PULLED) => Holds::Nothing,
            Holds::Nothing if self.is_over => Holds::Panel,
            Holds::Nothing => Holds::Land,
            Holds::Panel if panel.is_none() => Holds::Gone,
            held => held,
        };
        let occupied = match self.holds {
            Holds::Nothing => self.is_over,
            Holds::Panel | Holds::Gone => true,
            Holds::Land => false,
        };
        let hit = hit.filter(|_| occupied);
        Pointing {
            at: hit.map(|hit| hit.at),
            pressed: hit.is_some() && self.holds == Holds::Panel,
            occupied,
            ray_m: hit.filter(|_| self.is_over).map(|hit| hit.ray_m),
        }
    }
}

#[derive(Clone, Copy)]
struct Hit {
    at: Vec2,
    ray_m: f32,
    /// Metres beyond the nearest edge; 0 within.
    beyond_m: f32,
}

/// Where a hand's ray meets the plane of a panel, from its front.
fn meet(hand: &Hand, panel: &PanelAid) -> Option<Hit> {
    let aim = hand.aim?;
    let turn = panel.pose.orientation.conjugate();
    let origin = turn * (aim.position - panel.pose.position);
    let direction = turn * (aim.orientation * glam::Vec3::NEG_Z);
    // The panel faces its own +z.
    if origin.z <= 0.0 || direction.z > -LEAST_SLOPE {
        return None;
    }
    let ray_m = -origin.z / direction.z;
    let at_m = (origin + ray_m * direction).truncate();
    let size = Vec2::from(panel.size_m);
    let beyond = (at_m.abs() - 0.5 * size).max(Vec2::ZERO);
    let at = Vec2::new(0.5 + at_m.x / size.x, 0.5 - at_m.y / size.y);
    at.is_finite().then_some(Hit { at, ray_m, beyond_m: beyond.length() })
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;
    use crate::rig::Pose;

    /// 40 cm wide and 20 cm high, half a metre ahead.
    fn panel() -> PanelAid {
        let pose = Pose { position: Vec3::new(0.0, 0.0, -0.5), orientation: Quat::IDENTITY };
        PanelAid { pose, size_m: [0.4, 0.2] }
    }

    /// A hand at the origin that points so far to the right of the panel's middle and above it.
    fn hand(right: f32, up: f32, dive: f32) -> Hand {
        let direction = Vec3::new(right, up, -0.5).normalize();
        let orientation = Quat::from_rotation_arc(Vec3::NEG_Z, direction);
        Hand { aim: Some(Pose { position: Vec3::ZERO, orientation }), dive, ..Hand::default() }
    }

    fn near(a: Vec2, b: Vec2) -> bool {
        a.distance(b) < 1e-4
    }

    #[test]
    fn a_ray_meets_the_panel_where_it_is_seen() {
        let mut pointer = Pointer::default();
        for (right, up, at) in [(0.0, 0.0, [0.5, 0.5]), (-0.2, 0.1, [0.0, 0.0]), (0.1, -0.05, [0.75, 0.75])] {
            let pointing = pointer.heed(&hand(right, up, 0.0), Some(&panel()));
            assert!(near(pointing.at.unwrap_or_default(), Vec2::from(at)), "{pointing:?}");
            assert!(pointing.occupied && !pointing.pressed);
            let length = Vec3::new(right, up, -0.5).length();
            assert!(pointing.ray_m.is_some_and(|m| (m - length).abs() < 1e-4), "{pointing:?}");
        }
        assert_eq!(pointer.heed(&hand(0.3, 0.0, 0.0), Some(&panel())), Pointing::default());
        assert_eq!(pointer.heed(&hand(0.0, 0.0, 0.0), None), Pointing::default());
        // From behind there is nothing.
        let turned = Pose { orientation: Quat::from_rotation_y(std::f32::consts::PI), ..panel().pose };
        let behind = PanelAid { pose: turned, ..panel() };
        assert_eq!(pointer.heed(&hand(0.0, 0.0, 1.0), Some(&behind)), Pointing::default());
        assert_eq!(pointer.heed(&Hand::default(), Some(&panel())), Pointing::default());
    }

    #[test]
    fn a_trigger_belongs_to_what_it_was_pulled_on_until_it_is_let_go() {
        let mut pointer = Pointer::default();
        let mut heed = |right, dive| pointer.heed(&hand(right, 0.0, dive), Some(&panel()));
        assert!(!heed(0.0, 0.5).pressed, "half-way is not pulled");
        assert!(heed(0.0, 0.7).pressed);
        assert!(heed(0.0, 0.5).pressed, "half-way back is still pulled");
        let dragged = heed(0.4, 0.5);
        assert!(dragged.pressed && dragged.occupied && dragged.at.is_some_and(|at| at.x > 1.4));
        assert_eq!(dragged.ray_m, None, "beyond the panel it ends at the land");
        assert_eq!(heed(0.4, 0.3), Pointing::default());
        // A dive that sweeps over the panel goes on.
        assert_eq!(heed(0.4, 1.0), Pointing::default());
        assert_eq!(heed(0.0, 1.0), Pointing::default());
        let over = heed(0.0, 0.0);
        assert!(over.occupied && !over.pressed);
    }

    #[test]
    fn a_panel_that_goes_takes_the_pull_with_it() {
        let mut pointer = Pointer::default();
        assert!(pointer.heed(&hand(0.0, 0.0, 1.0), Some(&panel())).pressed);
        let gone = pointer.heed(&hand(0.0, 0.0, 1.0), None);
        assert_eq!(gone, Pointing { occupied: true, ..Pointing::default() });
        // Shown again it is pointed at, and not held.
        let again = pointer.heed(&hand(0.0, 0.0, 1.0), Some(&panel()));
        assert!(again.occupied && again.at.is_some() && !again.pressed, "{again:?}");
        assert!(pointer.heed(&hand(0.3, 0.0, 1.0), None).occupied);
        assert!(!pointer.heed(&hand(0.0, 0.0, 0.0), None).occupied);
        // A hand that is not seen any more has let go.
        assert!(pointer.heed(&hand(0.0, 0.0, 1.0), Some(&panel())).pressed);
        let unseen = Hand { aim: None, ..hand(0.0, 0.0, 1.0) };
        assert!(!pointer.heed(&unseen, Some(&panel())).pressed);
    }

    #[test]
    fn an_edge_is_left_later_than_it_is_reached() {
        let mut pointer = Pointer::default();
        let mut over = |right| pointer.heed(&hand(right, 0.0, 0.0), Some(&panel())).occupied;
        assert_eq!([0.218, 0.205, 0.218, 0.23, 0.218].map(&mut over), [false, true, true, false, false]);
    }
}
