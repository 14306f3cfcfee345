//! What is heard: a tone that rises for ever as one falls, and is silent at rest. Off unless a volume is set.
//!
//! The frame only leaves two numbers behind; a thread of its own opens the device, which may take its time, and makes the
//! tone of them. A device that fails is opened again, and without frames the tone fades.

#[cfg(feature = "sound")]
mod device;
pub mod shepard;
mod voice;

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use self::shepard::Wanted;
pub use self::voice::{Voice, Wishes};

/// What is heard.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SoundSettings {
    /// Loudness of the tone, 0 to 1; 0: none, and no device is opened.
    pub volume: f32,
}

/// A device at play, or one that is being opened. Dropping it ends that.
pub trait Player {
    /// False once it has failed.
    fn plays(&self) -> bool;

    /// Why it does not play any more. Asked once it does not, and does not block then.
    fn why(self: Box<Self>) -> String;
}

/// Begins to open a device for these wishes, or says why not; must not block.
pub type Opener = Box<dyn FnMut(&Arc<Wishes>) -> Result<Box<dyn Player>, String>>;

/// The tone of a flight.
pub struct Sound {
    volume: f32,
    wishes: Arc<Wishes>,
    open: Opener,
    player: Option<Box<dyn Player>>,
    /// Until another attempt to open one may be made.
    rests: Duration,
    /// Why none plays, as it was last said; empty since one has played for a while.
    said: String,
    last: Option<f64>,
    /// Octaves per second, smoothed.
    speed: f64,
}

/// Seconds over which the speed is smoothed: frames are not all of one length.
const STEADY_S: f64 = 0.1;

/// From one attempt to open a device to the next.
const RETRY: Duration = Duration::from_secs(5);

impl Default for Sound {
    /// Silent, on the system's device.
    fn default() -> Sound {
        Sound::on(Box::new(system_device))
    }
}

impl Sound {
    /// Silent, on the device that this opens.
    pub fn on(open: Opener) -> Sound {
        Sound {
            volume: 0.0,
            wishes: Arc::default(),
            open,
            player: None,
            rests: Duration::ZERO,
            said: String::new(),
            last: None,
            speed: 0.0,
        }
    }

    /// As loud as that from now on. A device is opened when it is first to be heard.
    pub fn set(&mut self, settings: &SoundSettings) {
        let before = self.volume;
        self.volume = if settings.volume.is_finite() { settings.volume.clamp(0.0, 1.0) } else { 0.0 };
        if before == 0.0 {
            // Whoever turns it on has maybe just seen to the device.
            self.rests = Duration::ZERO;
        }
        self.tend(Duration::ZERO);
    }

    /// Whether a device is open, or being opened.
    pub fn plays(&self) -> bool {
        self.player.as_ref().is_some_and(|player| player.plays())
    }

    /// The viewer is at this depth, in octaves, `dt` after the frame before. `jumped`: he was taken there at once, and did
    /// not fall.
    pub fn follow(&mut self, depth: f64, dt: Duration, jumped: bool) {
        self.tend(dt);
        let dt = dt.as_secs_f64();
        let fallen = depth - self.last.replace(depth).unwrap_or(depth);
        if jumped || dt <= 0.0 {
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

    /// Sees to it that a device plays where one is to be heard, `dt` after it was last seen to.
    fn tend(&mut self, dt: Duration) {
        self.rests = self.rests.saturating_sub(dt);
        if let Some(failed) = self.player.take_if(|player| !player.plays()) {
            self.say(failed.why());
        }
        if self.player.is_some() && self.rests.is_zero() {
            self.said.clear();
        }
        if self.volume > 0.0 && self.player.is_none() && self.rests.is_zero() {
            self.rests = RETRY;
            match (self.open)(&self.wishes) {
                Ok(player) => self.player = Some(player),
                Err(why) => self.say(why),
            }
        }
    }

    /// Says why nothing is heard: once for each reason, however often it is tried.
    fn say(&mut self, why: String) {
        if why != self.said {
            tracing::info!("nothing is heard: {why}");
            self.said = why;
        }
    }
}

impl fmt::Debug for Sound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Sound { volume, said, .. } = self;
        f.debug_struct("Sound")
            .field("volume", volume)
            .field("plays", &self.plays())
            .field("said", said)
            .finish()
    }
}

#[cfg(feature = "sound")]
fn system_device(wishes: &Arc<Wishes>) -> Result<Box<dyn Player>, String> {
    Ok(Box::new(device::Device::open(wishes)?))
}

#[cfg(not(feature = "sound"))]
fn system_device(_: &Arc<Wishes>) -> Result<Box<dyn Player>, String> {
    Err("this build is without sound (the feature `sound`)".to_owned())
}
