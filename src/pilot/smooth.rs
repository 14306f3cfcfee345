//! Values that follow others smoothly, by the same way whatever the frame rate.

/// The share of a change that has happened after `dt_s`, of one that takes `time_s` for 1 − 1/e of it.
pub(super) fn share(dt_s: f64, time_s: f64) -> f64 {
    if time_s > 0.0 { -(-dt_s / time_s).exp_m1() } else { 1.0 }
}

/// 0 up to `low`, 1 from `high` on, smooth in between.
pub(super) fn step(v: f64, low: f64, high: f64) -> f64 {
    if v >= high {
        return 1.0;
    }
    let u = ((v - low) / (high - low)).clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}

/// So near to its goal, and so slow, a spring rests.
const RESTS_AT: f64 = 1e-8;

/// A value on a critically damped spring: its rate never jumps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spring {
    pub(super) value: f64,
    /// Per second.
    pub(super) rate: f64,
}

impl Spring {
    pub(super) fn at(value: f64) -> Spring {
        Spring { value, rate: 0.0 }
    }

    /// Follows what is at `goal` after `dt_s` and moves by `goal_rate`: without lag while that is steady. Settles in
    /// `settle_s` (to a few hundredths), no faster than `most` per second.
    pub(super) fn follow(&mut self, goal: f64, goal_rate: f64, dt_s: f64, settle_s: f64, most: f64) {
        // At rest it stays on its bits.
        if goal_rate == 0.0 && self.rate.abs() < RESTS_AT && (goal - self.value).abs() < RESTS_AT {
            self.rate = 0.0;
            return;
        }
        let stiffness = 5.0 / settle_s;
        // The exact solution, relative to the goal.
        let error = self.value - (goal - goal_rate * dt_s);
        let pull = self.rate - goal_rate + stiffness * error;
        let fade = (-stiffness * dt_s).exp();
        let value = goal + (error + pull * dt_s) * fade;
        let rate = goal_rate + (pull - stiffness * (error + pull * dt_s)) * fade;
        self.value += (value - self.value).clamp(-most * dt_s, most * dt_s);
        self.rate = rate.clamp(-most, most);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spring_follows_without_lag_and_settles_whatever_the_frame_rate() {
        for hz in [10.0, 90.0, 1_000.0] {
            let dt = 1.0 / hz;
            let mut spring = Spring::at(0.0);
            for i in 1..=(3.0 * hz) as i32 {
                spring.follow(2.0 * f64::from(i) * dt, 2.0, dt, 0.5, 100.0);
            }
            assert!((spring.value - 6.0).abs() < 1e-6 && (spring.rate - 2.0).abs() < 1e-6, "{spring:?}");
            for _ in 0..(0.5 * hz) as i32 {
                spring.follow(7.0, 0.0, dt, 0.5, 100.0);
            }
            assert!((spring.value - 7.0).abs() < 0.06, "{spring:?} at {hz} Hz");
            for _ in 0..(0.5 * hz) as i32 {
                spring.follow(1e9, 0.0, dt, 0.5, 3.0);
            }
            assert!((spring.value - 8.5).abs() < 0.06 && spring.rate <= 3.0, "{spring:?}");
        }
    }
}
