//! Time as the runtime counts it: nanoseconds, never zero, real or stepped.

use std::time::{Duration, Instant};

use super::config::Clock;

/// The first instant, so that no time is zero or negative.
const ORIGIN_NS: i64 = 1_000_000_000;

pub struct Timeline {
    stepped: bool,
    origin: Instant,
    /// Only for a stepped clock.
    now_ns: i64,
    pub period_ns: i64,
}

/// What one `xrWaitFrame` waits for.
pub struct Slot {
    pub display_ns: i64,
    /// `None`: at once.
    pub wake: Option<Instant>,
}

impl Timeline {
    pub fn new(clock: Clock) -> Self {
        Self {
            stepped: matches!(clock, Clock::Stepped { .. }),
            origin: Instant::now(),
            now_ns: ORIGIN_NS,
            period_ns: (1e9 / clock.hz()).round() as i64,
        }
    }

    pub fn now_ns(&self) -> i64 {
        if self.stepped {
            return self.now_ns;
        }
        let elapsed = i64::try_from(self.origin.elapsed().as_nanos()).unwrap_or(i64::MAX / 2);
        ORIGIN_NS + elapsed
    }

    /// The frame after the one displayed at `last_display_ns`. In real time the caller gets a whole period before
    /// the display, and a refresh that was missed is skipped.
    pub fn next_slot(&mut self, last_display_ns: i64) -> Slot {
        let period = self.period_ns;
        if self.stepped {
            let display_ns = last_display_ns.max(self.now_ns) + period;
            self.now_ns = display_ns - period;
            return Slot { display_ns, wake: None };
        }
        let refresh = (self.now_ns() - ORIGIN_NS).div_euclid(period) + 2;
        let after_last = (last_display_ns - ORIGIN_NS).div_euclid(period) + 1;
        let display_ns = ORIGIN_NS + refresh.max(after_last) * period;
        let wake_ns = (display_ns - period - ORIGIN_NS).max(0).unsigned_abs();
        Slot { display_ns, wake: Some(self.origin + Duration::from_nanos(wake_ns)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn display_times_increase_by_the_period_when_stepped() {
        let mut timeline = Timeline::new(Clock::Stepped { hz: 100.0 });
        let first = timeline.next_slot(0).display_ns;
        let second = timeline.next_slot(first).display_ns;
        assert_eq!(second - first, 10_000_000);
        assert_eq!(timeline.now_ns(), first);
    }

    #[test]
    fn real_display_times_lie_ahead_and_increase() {
        let mut timeline = Timeline::new(Clock::Real { hz: 120.0 });
        let mut last = 0;
        for _ in 0..5 {
            let now = timeline.now_ns();
            let slot = timeline.next_slot(last);
            assert!(slot.display_ns > last && slot.display_ns > now);
            last = slot.display_ns;
        }
    }
}
