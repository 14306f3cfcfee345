//! What stands in a script file, as it stands there: values that remember their place in the text.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Spanned;

use crate::mock::input::InputValue;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawScript {
    pub(super) headset: Option<RawHeadset>,
    #[serde(default)]
    pub(super) head: Vec<RawKey>,
    pub(super) start: Option<RawCue>,
    #[serde(default)]
    pub(super) cue: Vec<Spanned<RawCue>>,
    #[serde(default)]
    pub(super) fault: Vec<RawFault>,
}

pub(super) type Number = Option<Spanned<f64>>;
pub(super) type Whole = Option<Spanned<u64>>;
pub(super) type Word = Option<Spanned<String>>;
pub(super) type Size = Option<Spanned<[u64; 2]>>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawHeadset {
    pub(super) clock: Word,
    pub(super) hz: Number,
    pub(super) eye_size: Size,
    pub(super) right_eye_size: Size,
    pub(super) max_image_size: Size,
    pub(super) fov_deg: Option<Spanned<[[f64; 4]; 2]>>,
    pub(super) fov_mutable: Option<bool>,
    pub(super) eye_turn_deg: Option<Spanned<[[f64; 3]; 2]>>,
    pub(super) ipd_m: Number,
    pub(super) mask: Word,
    pub(super) mask_cut: Number,
    pub(super) refresh_rates_hz: Option<Spanned<Vec<f64>>>,
    pub(super) user_presence: Option<bool>,
    pub(super) user_present: Option<bool>,
    pub(super) asleep: Option<bool>,
    pub(super) early_error_m: Option<Spanned<[f64; 3]>>,
    pub(super) local_origin: Option<RawPose>,
    pub(super) stage: Option<bool>,
    pub(super) bounds_m: Option<Spanned<Vec<f64>>>,
    #[serde(default)]
    pub(super) tracking: Vec<RawTracking>,
    pub(super) skip_rendering: Option<Spanned<Vec<[u64; 2]>>>,
    #[serde(default)]
    pub(super) timing: Vec<Spanned<RawTimingSpan>>,
    pub(super) read_back: Option<bool>,
    pub(super) keep_frames: Whole,
    pub(super) api_version: Word,
    pub(super) absent_extensions: Option<Vec<String>>,
    pub(super) unavailable_calls: Option<u32>,
    pub(super) formats: Option<Vec<Spanned<String>>>,
    pub(super) image_count: Whole,
    pub(super) depth_image_count: Whole,
    pub(super) shuffle_images: Option<bool>,
    pub(super) image_timeouts: Option<u32>,
    pub(super) max_layers: Whole,
    pub(super) view_count: Whole,
    pub(super) graphics_device: Whole,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawTracking {
    pub(super) frames: Spanned<[u64; 2]>,
    pub(super) state: Spanned<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawTimingSpan {
    pub(super) frames: Spanned<[u64; 2]>,
    pub(super) late: Whole,
    pub(super) every: Whole,
    pub(super) jitter_ms: Number,
    pub(super) ahead_ms: Number,
    pub(super) frozen: Option<Spanned<bool>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawTiming {
    pub(super) late: Whole,
    pub(super) every: Whole,
    pub(super) jitter_ms: Number,
    pub(super) ahead_ms: Number,
    pub(super) frozen: Option<Spanned<bool>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawPose {
    pub(super) position: Option<Spanned<[f64; 3]>>,
    pub(super) yaw_deg: Number,
    pub(super) pitch_deg: Number,
    pub(super) roll_deg: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawKey {
    pub(super) time_s: Spanned<f64>,
    pub(super) position: Option<Spanned<[f64; 3]>>,
    pub(super) yaw_deg: Number,
    pub(super) pitch_deg: Number,
    pub(super) roll_deg: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawRecentre {
    pub(super) position: Option<Spanned<[f64; 3]>>,
    pub(super) yaw_deg: Number,
    pub(super) pitch_deg: Number,
    pub(super) roll_deg: Number,
    pub(super) delay_s: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawPerformance {
    pub(super) domain: Spanned<String>,
    pub(super) sub_domain: Spanned<String>,
    pub(super) from: Spanned<String>,
    pub(super) to: Spanned<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawCue {
    pub(super) frame: Whole,
    pub(super) time_s: Number,
    pub(super) call: Word,
    pub(super) nth: Whole,
    pub(super) session: Word,
    pub(super) force_state: Word,
    pub(super) instance_loss_s: Number,
    pub(super) unavailable_calls: Option<u32>,
    #[serde(default)]
    pub(super) head: Vec<RawKey>,
    pub(super) tracking: Word,
    pub(super) should_render: Word,
    pub(super) recentre_on_head: Option<Spanned<bool>>,
    pub(super) recentre: Option<RawRecentre>,
    pub(super) bounds_m: Option<Spanned<Vec<f64>>>,
    pub(super) fov_deg: Option<Spanned<[[f64; 4]; 2]>>,
    pub(super) ipd_m: Number,
    pub(super) eye_turn_deg: Option<Spanned<[[f64; 3]; 2]>>,
    pub(super) eye_size: Size,
    pub(super) right_eye_size: Size,
    pub(super) mask: Word,
    pub(super) mask_cut: Number,
    pub(super) formats: Option<Vec<Spanned<String>>>,
    pub(super) refresh_hz: Number,
    pub(super) refresh_rates_hz: Option<Spanned<Vec<f64>>>,
    pub(super) user_present: Option<bool>,
    pub(super) timing: Option<Spanned<RawTiming>>,
    pub(super) image_timeouts: Option<u32>,
    pub(super) shuffle_images: Option<bool>,
    pub(super) view_count: Whole,
    pub(super) graphics_device: Whole,
    pub(super) performance: Option<RawPerformance>,
    pub(super) connect: Option<BTreeMap<String, Spanned<String>>>,
    pub(super) disconnect: Option<Vec<Spanned<String>>>,
    pub(super) input: Option<BTreeMap<String, Spanned<RawValue>>>,
    pub(super) poses: Option<BTreeMap<String, Spanned<Vec<RawKey>>>>,
    pub(super) device_tracking: Option<BTreeMap<String, Spanned<String>>>,
    pub(super) bare_hands: Option<BTreeMap<String, Spanned<bool>>>,
    pub(super) event: Word,
    pub(super) lost_events: Option<u32>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(untagged)]
pub(super) enum RawValue {
    Boolean(bool),
    Float(f32),
    Vector([f32; 2]),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawFault {
    pub(super) call: Spanned<String>,
    pub(super) nth: Whole,
    pub(super) from: Whole,
    pub(super) returns: Spanned<String>,
}

impl From<RawValue> for InputValue {
    fn from(value: RawValue) -> Self {
        match value {
            RawValue::Boolean(pressed) => Self::Boolean(pressed),
            RawValue::Float(value) => Self::Float(value),
            RawValue::Vector(vector) => Self::Vector(vector),
        }
    }
}
