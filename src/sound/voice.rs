//! What the frames leave behind, made into samples.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use super::shepard::{Shepard, Wanted};

/// Seconds without a wish after which the tone fades: the session is lost, or the frame hangs.
const PATIENCE_S: f32 = 0.3;

/// What the frames leave for the device.
#[derive(Debug, Default)]
pub struct Wishes {
    depth: AtomicU64,
    loudness: AtomicU32,
    /// Wishes so far.
    count: AtomicU32,
}

impl Wishes {
    /// Leaves another wish.
    pub fn set(&self, wanted: &Wanted) {
        self.depth.store(wanted.depth.to_bits(), Ordering::Relaxed);
        self.loudness.store(wanted.loudness.to_bits(), Ordering::Relaxed);
        self.count.fetch_add(1, Ordering::Relaxed);
    }

    /// The last one.
    pub fn get(&self) -> Wanted {
        Wanted {
            depth: f64::from_bits(self.depth.load(Ordering::Relaxed)),
            loudness: f32::from_bits(self.loudness.load(Ordering::Relaxed)),
        }
    }
}

/// The tone of these wishes, buffer by buffer. It fades where none comes any more, and is back with the next one.
#[derive(Debug)]
pub struct Voice {
    wishes: Arc<Wishes>,
    tone: Shepard,
    /// Wishes when a buffer was last filled.
    heard: u32,
    /// Samples since the last wish was first heard, and how many are too many.
    stale: usize,
    patience: usize,
}

impl Voice {
    /// Silent, for so many samples per second.
    pub fn new(wishes: Arc<Wishes>, rate_hz: f32) -> Voice {
        let heard = wishes.count.load(Ordering::Relaxed);
        Voice {
            wishes,
            tone: Shepard::new(rate_hz),
            heard,
            stale: 0,
            patience: (PATIENCE_S * rate_hz) as usize,
        }
    }

    /// Fills a buffer of `channels` interleaved, all of which sound alike.
    pub fn fill<T: Copy>(&mut self, samples: &mut [T], channels: usize, from_tone: impl Fn(f32) -> T) {
        let count = self.wishes.count.load(Ordering::Relaxed);
        // By the buffers before this one: one that is long by itself is no sign of anything.
        if std::mem::replace(&mut self.heard, count) != count {
            self.stale = 0;
        }
        let mut wanted = self.wishes.get();
        if self.stale > self.patience {
            wanted.loudness = 0.0;
        }
        let moments = samples.chunks_mut(channels.max(1));
        self.stale = self.stale.saturating_add(moments.len());
        moments.for_each(|moment| moment.fill(from_tone(self.tone.next(&wanted))));
    }
}
