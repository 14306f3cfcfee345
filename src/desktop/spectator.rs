//! A spectator's camera: it turns after the eye smoothly, so that a wearer's trembling does not reach the window.

use glam::{DQuat, DVec3};

use super::pane::{Pane, SPECTATOR_SHARE};

/// In so many seconds the camera has followed a turn of the eye, to a few hundredths.
const SETTLE_S: f64 = 0.8;

/// Steps in which the most is found that the camera may be turned from the eye: to a thousandth of where it is.
const STEPS: u32 = 10;

/// A camera on a critically damped spring between it and the eye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spectator {
    /// Where it looks, in the play space.
    pub orientation: DQuat,
    /// How it turns: radians per second about the play space's axes.
    pub rate: DVec3,
}

impl Spectator {
    /// At rest.
    pub fn at(eye: DQuat) -> Spectator {
        Spectator { orientation: eye, rate: DVec3::ZERO }
    }

    /// Where it is `dt_s` later, where it turns after an eye that looks in this direction. The same whatever the frame
    /// rate, as long as the eye rests.
    #[must_use]
    pub fn follow(self, eye: DQuat, dt_s: f64) -> Spectator {
        let stiffness = 5.0 / SETTLE_S;
        let error = between(eye, self.orientation);
        let pull = self.rate + stiffness * error;
        let fade = (-stiffness * dt_s).exp();
        let orientation = DQuat::from_scaled_axis((error + pull * dt_s) * fade) * eye;
        let rate = (pull - stiffness * (error + pull * dt_s)) * fade;
        Spectator { orientation: orientation.normalize(), rate }
    }

    /// The nearest to it that sees nothing but what is in the eye's picture: `pane` is the eye's, whose angles are `fov`.
    /// Where the eye turns too fast to be followed smoothly, it takes the camera with it.
    #[must_use]
    pub fn within(self, eye: DQuat, pane: &Pane, fov: [f32; 4]) -> Spectator {
        let turn = self.eye_from_camera(eye);
        let fits =
            |share: f64| pane.turned(fov, SPECTATOR_SHARE, DQuat::IDENTITY.slerp(turn, share)).is_filled();
        if fits(1.0) {
            return self;
        }
        let (mut least, mut most) = (0.0, 1.0);
        for _ in 0..STEPS {
            let middle = (least + most) / 2.0;
            if fits(middle) { least = middle } else { most = middle }
        }
        Spectator { orientation: (eye * DQuat::IDENTITY.slerp(turn, least)).normalize(), ..self }
    }

    /// Turns its axes to the eye's.
    pub fn eye_from_camera(&self, eye: DQuat) -> DQuat {
        (eye.conjugate() * self.orientation).normalize()
    }
}

/// The shortest turn about the axes around both that takes one to the other: radians times its axis.
fn between(from: DQuat, to: DQuat) -> DVec3 {
    let turn = to * from.conjugate();
    if turn.w < 0.0 { -turn } else { turn }.normalize().to_scaled_axis()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

    use super::*;

    const FOV: [f32; 4] = [-0.785, 0.785, 0.7, -0.7];

    #[test]
    fn it_follows_a_turn_smoothly_whatever_the_frame_rate() {
        let eye = DQuat::from_rotation_y(0.5) * DQuat::from_rotation_x(-0.2);
        let start = Spectator::at(DQuat::IDENTITY);
        let after = |hz: f64, s: f64| (0..(hz * s) as i32).fold(start, |now, _| now.follow(eye, 1.0 / hz));
        for s in [0.2, 0.5, 1.0] {
            let [slow, fast] = [after(20.0, s), after(1000.0, s)];
            assert!(slow.orientation.angle_between(fast.orientation) < 1e-6, "{s} s");
            assert!((slow.rate - fast.rate).length() < 1e-6, "{s} s");
        }
        assert!(after(90.0, SETTLE_S).orientation.angle_between(eye) < 0.05 * 0.54);
        // It begins to turn without a jerk, never overshoots, and is there in the end.
        assert!(after(1000.0, 0.001).rate.length() < 0.05);
        let mut left = f64::INFINITY;
        for i in 1..40 {
            let now = after(100.0, 0.05 * f64::from(i)).orientation.angle_between(eye);
            assert!(now < left || now < 1e-7, "{i}");
            left = now;
        }
        assert!(left < 1e-4, "{left}");
    }

    #[test]
    fn a_trembling_head_hardly_moves_it_and_a_half_turn_is_no_harder_than_another() {
        let mut camera = Spectator::at(DQuat::IDENTITY);
        let (mut most, hz) = (0.0f64, 90.0);
        for i in 0..(4.0 * hz) as i32 {
            // 1 degree, 6 times a second.
            let angle = 1f64.to_radians() * (std::f64::consts::TAU * 6.0 * f64::from(i) / hz).sin();
            camera = camera.follow(DQuat::from_rotation_x(angle), 1.0 / hz);
            if f64::from(i) > hz {
                most = most.max(camera.orientation.angle_between(DQuat::IDENTITY));
            }
        }
        assert!(most < 0.06 * 1f64.to_radians(), "{}", most.to_degrees());
        // The same look in its other quaternion.
        let other = Spectator::at(DQuat::IDENTITY).follow(-DQuat::from_rotation_y(0.1), 0.1);
        assert!(other.orientation.angle_between(DQuat::IDENTITY) < 0.1);
    }

    #[test]
    fn it_never_sees_past_the_edge_of_the_picture() {
        let pane = Pane::new(0, [0, 0, 1280, 800], FOV).unwrap();
        let mut camera = Spectator::at(DQuat::IDENTITY);
        let mut taken = 0;
        for i in 0..300 {
            // Up to a turn a second, this way and that, with a roll.
            let t = f64::from(i) / 90.0;
            let eye = DQuat::from_rotation_y(3.0 * (2.0 * t).sin()) * DQuat::from_rotation_z(0.5 * t.sin());
            let free = camera.follow(eye, 1.0 / 90.0);
            camera = free.within(eye, &pane, FOV);
            taken += i32::from(camera != free);
            let shown = pane.turned(FOV, SPECTATOR_SHARE, camera.eye_from_camera(eye));
            assert!(shown.is_filled(), "frame {i}");
        }
        assert!(taken > 50, "{taken}");
    }

    #[test]
    fn a_small_turn_of_the_eye_leaves_it_free() {
        let pane = Pane::new(0, [0, 0, 1280, 800], FOV).unwrap();
        let camera = Spectator::at(DQuat::IDENTITY);
        assert_eq!(camera.within(DQuat::from_rotation_y(0.08), &pane, FOV), camera);
    }
}
