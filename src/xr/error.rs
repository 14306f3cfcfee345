//! What can go wrong with a runtime, sorted by what the caller does next.

use ash::vk;
use openxr::sys;

use super::outcome::{Outcome, outcome};

/// What was lost. The caller drops the session (and for `Instance` the runtime too), then asks again until it answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Lost {
    /// The session is gone, the instance is not: drop the `Session`, call `Runtime::find_headset` until it succeeds, make a new `Session`.
    #[error("the OpenXR session was lost: wake the headset, the session can be made anew")]
    Session,
    /// The runtime itself is gone: drop everything made from it and open it again.
    #[error("the OpenXR runtime went away: start it again, it can be opened anew")]
    Instance,
}

/// Every failure of this module. Each text is one sentence that says what to do.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// No loader, no runtime or no headset at the moment. Asking again later may succeed.
    #[error("{0}")]
    Unavailable(String),
    /// The runtime or headset can never do what is needed. Asking again is pointless.
    #[error("{0}")]
    Unsupported(String),
    /// The session or the instance was lost.
    #[error(transparent)]
    Lost(#[from] Lost),
    /// Any other refusal of an OpenXR call.
    #[error("{call} failed with {code:?} ({code}): restart the headset's OpenXR runtime and try again")]
    Call {
        /// The OpenXR function, e.g. `xrEndFrame`.
        call: &'static str,
        /// What it returned.
        code: sys::Result,
    },
    /// A Vulkan call made for the session's images failed.
    #[error("{what} failed ({code}): close other programs that use the GPU, or choose smaller eye images")]
    Vulkan {
        /// What was being made.
        what: &'static str,
        /// What Vulkan returned.
        code: vk::Result,
    },
    /// The session's own images could not be made.
    #[error("{0:#}")]
    Gpu(anyhow::Error),
}

impl Error {
    /// What was lost, if this is a loss.
    pub fn lost(&self) -> Option<Lost> {
        match self {
            Self::Lost(lost) => Some(*lost),
            _ => None,
        }
    }

    /// What the viewer does about it.
    pub fn outcome(&self) -> Outcome {
        match self {
            Self::Lost(Lost::Session) => Outcome::ReopenSession,
            Self::Lost(Lost::Instance) => Outcome::ReopenInstance,
            Self::Unavailable(_) => Outcome::Wait,
            Self::Call { call, code } => outcome(call, *code),
            Self::Unsupported(_) | Self::Vulkan { .. } | Self::Gpu(_) => Outcome::GiveUp,
        }
    }

    /// Finds the words for the error code of an OpenXR call. What is done about it is in [`outcome`].
    pub(super) fn from_code(call: &'static str, code: sys::Result) -> Self {
        use sys::Result as R;
        // Where all goes on, nobody needs to be told what to do.
        let goes_on = matches!(outcome(call, code), Outcome::GoOn | Outcome::SkipFrame | Outcome::Idle);
        match code {
            _ if goes_on => Self::Call { call, code },
            R::ERROR_SESSION_LOST => Lost::Session.into(),
            R::ERROR_INSTANCE_LOST => Lost::Instance.into(),
            R::ERROR_FORM_FACTOR_UNAVAILABLE => Self::Unavailable(
                "no headset answers the OpenXR runtime: connect it, switch it on and try again".into(),
            ),
            R::ERROR_RUNTIME_UNAVAILABLE => Self::Unavailable(
                "no OpenXR runtime answers: start the headset's software (SteamVR, Monado, WiVRn) or make it the active runtime".into(),
            ),
            R::ERROR_FORM_FACTOR_UNSUPPORTED => Self::Unsupported(
                "the active OpenXR runtime drives no head-mounted display: make the headset's own runtime the active one".into(),
            ),
            R::ERROR_VIEW_CONFIGURATION_TYPE_UNSUPPORTED => Self::Unsupported(
                "the OpenXR runtime offers no stereo views: use a headset with two eyes".into(),
            ),
            R::ERROR_API_VERSION_UNSUPPORTED => Self::Unsupported(
                "the OpenXR runtime speaks neither OpenXR 1.1 nor 1.0: update the headset's software".into(),
            ),
            _ => Self::Call { call, code },
        }
    }
}

/// Passes success codes on (the positive ones too) and sorts the others.
pub(super) fn check(call: &'static str, code: sys::Result) -> Result<sys::Result, Error> {
    if code.into_raw() >= 0 { Ok(code) } else { Err(Error::from_code(call, code)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positive_codes_are_kept_and_losses_are_typed() {
        let discarded = check("xrBeginFrame", sys::Result::FRAME_DISCARDED);
        assert!(matches!(discarded, Ok(sys::Result::FRAME_DISCARDED)));
        let lost = |code| check("xrEndFrame", code).err().and_then(|e| e.lost());
        assert_eq!(lost(sys::Result::ERROR_SESSION_LOST), Some(Lost::Session));
        assert_eq!(lost(sys::Result::ERROR_INSTANCE_LOST), Some(Lost::Instance));
        assert_eq!(lost(sys::Result::ERROR_LAYER_INVALID), None);
    }

    #[test]
    fn a_refusal_is_one_sentence_with_the_code() {
        let text = Error::from_code("xrEndFrame", sys::Result::ERROR_LAYER_INVALID).to_string();
        assert!(text.starts_with("xrEndFrame failed with ERROR_LAYER_INVALID"), "{text}");
        assert!(!text.contains('\n'));
    }
}
