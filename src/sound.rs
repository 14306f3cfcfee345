//! What is heard: a tone that rises for ever as one falls, and is silent at rest. Off unless a volume is set.
//!
//! The frame only leaves two numbers behind; a thread of its own opens the device, which may take its time, and makes the
//! tone of them.

#[cfg(feature = "sound")]
mod device;
pub mod shepard;

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::Duration;

use serde::{Deserialize, Serialize};

use self::shepard::Wanted;

/// What is heard.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SoundSettings {
    /// Loudness of the tone, 0 to 1; 0: none, and no device is opened.
    pub volume: f32,
}

/// What the frames leave for the device.
#[derive(Debug, Default)]
pub struct Wishes {
    depth: AtomicU64,
    loudness: AtomicU32,
}

impl Wishes {
    /// Leaves another wish.
    pub fn set(&self, wanted: &Wanted) {
        self.depth.store(wanted.depth.to_bits(), Ordering::Relaxed);
        self.loudness.store(wanted.loudness.to_bits(), Ordering::Relaxed);
    }

    /// The last one.
    pub fn get(&self) -> Wanted {
        Wanted {
            depth: f64::from_bits(self.depth.load(Ordering::Relaxed)),
            loudness: f32::from_bits(self.loudness.load(Ordering::Relaxed)),
        }
    }
}

/// The tone of a flight.
#[derive(Debug, Default)]
pub struct Sound {
    volume: f32,
    wishes: Arc<Wishes>,
    player: Option<Player>,
    last: Option<f64>,
    /// Octaves per second, smoothed.
    speed: f64,
}

/// Seconds over which the speed is smoothed: frames are not all of one length.
const STEADY_S: f64 = 0.1;

/// Octaves in a frame beyond which it is a leap, and not a fall.
const LEAP: f64 = 4.0;

impl Sound {
    /// As loud as that from now on. A device is opened when it is first to be heard.
    pub fn set(&mut self, settings: &SoundSettings) {
        self.volume = if settings.volume.is_finite() { settings.volume.clamp(0.0, 1.0) } else { 0.0 };
        if self.volume > 0.0 && self.player.is_none() {
            self.player = Player::open(&self.wishes);
        }
    }

    /// Whether a device is open, or being opened.
    pub fn plays(&self) -> bool {
        self.player.as_ref().is_some_and(Player::plays)
    }

    /// The viewer is at this depth, in octaves, `dt` after the frame before.
    pub fn follow(&mut self, depth: f64, dt: Duration) {
        let dt = dt.as_secs_f64();
        let fallen = depth - self.last.replace(depth).unwrap_or(depth);
        if fallen.abs() > LEAP || dt <= 0.0 {
            self.speed = 0.0;
        } else {
            self.speed += (fallen / dt - self.speed) * (1.0 - (-dt / STEADY_S).exp());
        }
        let loudness = self.volume * shepard::loudness(self.speed);
        self.wishes.set(&Wanted { depth, loudness });
    }

    /// What was last asked for.
    pub fn wanted(&self) -> Wanted {
        self.wishes.get()
    }
}

#[cfg(feature = "sound")]
use self::device::Player;

/// Nothing is heard: this build knows no devices.
#[cfg(not(feature = "sound"))]
#[derive(Debug)]
struct Player;

#[cfg(not(feature = "sound"))]
impl Player {
    fn open(_: &Arc<Wishes>) -> Option<Player> {
        tracing::info!("nothing is heard: this build is without sound (the feature `sound`)");
        Some(Player)
    }

    fn plays(&self) -> bool {
        false
    }
}
