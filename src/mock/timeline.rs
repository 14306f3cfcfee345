//! Time as the runtime counts it: nanoseconds, never zero, real or stepped.

use std::time::{Duration, Instant};

use super::config::Clock;

/// The first instant of a stepped clock, so that no time is zero or negative.
const ORIGIN_NS: i64 = 1_000_000_000;

/// An `XrTime` is a time of the system's monotonic clock, on a stepped clock of one that only `xrWaitFrame` moves.
pub struct Timeline {
    stepped: bool,
    origin: Instant,
    origin_ns: i64,
    /// Only for a stepped clock.
    now_ns: i64,
    /// A refresh; the others lie whole periods from it.
    grid_ns: i64,
    pub hz: f64,
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
        let stepped = matches!(clock, Clock::Stepped { .. });
        let origin_ns = if stepped { ORIGIN_NS } else { monotonic_ns() };
        Self {
            stepped,
            origin: Instant::now(),
            origin_ns,
            now_ns: origin_ns,
            grid_ns: origin_ns,
            hz: clock.hz(),
            period_ns: period_of(clock.hz()),
        }
    }

    pub fn now_ns(&self) -> i64 {
        if self.stepped {
            return self.now_ns;
        }
        let elapsed = i64::try_from(self.origin.elapsed().as_nanos()).unwrap_or(i64::MAX / 4);
        self.origin_ns + elapsed
    }

    pub fn is_stepped(&self) -> bool {
        self.stepped
    }

    /// Another refresh rate from now on, hertz.
    pub fn set_hz(&mut self, hz: f64) {
        self.grid_ns = self.now_ns();
        self.hz = hz;
        self.period_ns = period_of(hz);
    }

    /// The frame that is displayed `periods` refreshes after the one displayed at `last_display_ns`. In real time the
    /// caller gets a whole period before the display, and a refresh that was missed is skipped.
    pub fn next_slot(&mut self, last_display_ns: i64, periods: u32) -> Slot {
        let (period, periods) = (self.period_ns, i64::from(periods.max(1)));
        if self.stepped {
            let display_ns = last_display_ns.max(self.now_ns) + periods * period;
            self.now_ns = display_ns - period;
            return Slot { display_ns, wake: None };
        }
        let refresh = (self.now_ns() - self.grid_ns).div_euclid(period) + 2;
        let after_last = (last_display_ns - self.grid_ns).div_euclid(period) + periods;
        let display_ns = self.grid_ns + refresh.max(after_last) * period;
        let wake_ns = (display_ns - period - self.origin_ns).max(0).unsigned_abs();
        Slot { display_ns, wake: Some(self.origin + Duration::from_nanos(wake_ns)) }
    }
}

fn period_of(hz: f64) -> i64 {
    (1e9 / hz).round() as i64
}

/// The system's monotonic clock, which `Instant` reads too.
#[cfg(unix)]
fn monotonic_ns() -> i64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    (time.tv_sec * 1_000_000_000 + time.tv_nsec).max(1)
}

#[cfg(not(unix))]
fn monotonic_ns() -> i64 {
    ORIGIN_NS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn display_times_increase_by_the_period_when_stepped() {
        let mut timeline = Timeline::new(Clock::Stepped { hz: 100.0 });
        let first = timeline.next_slot(0, 1).display_ns;
        let second = timeline.next_slot(first, 1).display_ns;
        assert_eq!(second - first, 10_000_000);
        assert_eq!(timeline.now_ns(), first);
    }

    #[test]
    fn real_display_times_lie_ahead_and_increase() {
        let mut timeline = Timeline::new(Clock::Real { hz: 120.0 });
        let mut last = 0;
        for _ in 0..5 {
            let now = timeline.now_ns();
            let slot = timeline.next_slot(last, 1);
            assert!(slot.display_ns > last && slot.display_ns > now);
            last = slot.display_ns;
        }
    }
}
