//! Which hands are closed: on a trigger, on the land.

use glam::Vec3;

use super::{Hand, PULLED, is_held};

/// Hands from frame to frame: left, right.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Closed {
    /// Pulls its trigger, and not for something else.
    pub(super) pulls: [bool; 2],
    /// Has begun to in this frame.
    pub(super) begins: [bool; 2],
    /// Holds the land.
    pub(super) holds: [bool; 2],
    pulled: [bool; 2],
    squeezes: [bool; 2],
}

impl Closed {
    /// Takes note of hands, of which some are `occupied` otherwise: a trigger that is pulled then is for that.
    pub(super) fn close(&mut self, hands: &[Hand; 2], occupied: [bool; 2]) {
        for (i, hand) in hands.iter().enumerate() {
            let was = self.pulled[i];
            self.pulled[i] = is_held(was, hand.dive, PULLED);
            self.begins[i] = self.pulled[i] && !was && !occupied[i];
            self.pulls[i] = self.begins[i] || (self.pulls[i] && self.pulled[i]);
            self.squeezes[i] = hand.has_grab && is_held(self.squeezes[i], hand.grab, PULLED);
        }
        // Where nothing else is there to take hold with, two triggers are a grip, and one dives.
        let closed = |i: usize| if hands[i].has_grab { self.squeezes[i] } else { self.pulls[i] };
        let both = closed(0) && closed(1);
        self.holds = [0, 1].map(|i| {
            let holds = if hands[i].has_grab { self.squeezes[i] } else { both };
            // A hand that is not seen holds nothing: where it comes back, it takes hold anew.
            holds && place(&hands[i]).is_some()
        });
        // One of two triggers alone holds nothing.
        let alone = |i: usize| self.holds[i] && !self.holds[1 - i] && !hands[i].has_grab;
        let alone = [alone(0), alone(1)];
        for i in [0, 1].into_iter().filter(|i| alone[*i]) {
            self.holds[i] = false;
        }
    }
}

/// Where a hand is, in metres from the seat.
pub(super) fn place(hand: &Hand) -> Option<Vec3> {
    hand.grip.or(hand.aim).map(|pose| pose.position)
}
