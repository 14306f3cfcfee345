//! What the viewer does about every answer of an OpenXR call: one table.

use openxr::sys;

/// What happens next, from harmless to hopeless.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Outcome {
    /// As if nothing had been: the call did its work, or did not matter.
    GoOn,
    /// The same call is made again, asking for less or with more room; where that does not help, it is given up.
    AskAgain,
    /// The frame ends without a picture; the next one may have one again.
    SkipFrame,
    /// The session does not run, whatever we thought: no frames until an event says READY. Where none says anything, the
    /// session is made anew.
    Idle,
    /// The session goes; another one is made on the same runtime and device, and shows what was shown.
    ReopenSession,
    /// Everything made from the runtime goes, and the runtime is opened again.
    ReopenInstance,
    /// No headset or no runtime answers at the moment: ask again each second.
    Wait,
    /// It is over, with a sentence that says what to do.
    GiveUp,
}

/// One line of the table: for these functions (none: any function) these codes (none: any error) come to this.
type Rule = (&'static [&'static str], &'static [sys::Result], Outcome);

/// Calls without which all goes on as well.
const OPTIONAL: &[&str] = &[
    "xrEnumerateDisplayRefreshRatesFB",
    "xrGetDisplayRefreshRateFB",
    "xrGetVisibilityMaskKHR",
    "xrPerfSettingsSetPerformanceLevelEXT",
    "xrRequestDisplayRefreshRateFB",
];

/// Calls for what the wearer does with his hands: without them he still looks around.
const INPUT: &[&str] = &[
    "xrApplyHapticFeedback",
    "xrAttachSessionActionSets",
    "xrCreateAction",
    "xrCreateActionSet",
    "xrCreateActionSpace",
    "xrCreateHandTrackerEXT",
    "xrEnumerateBoundSourcesForAction",
    "xrGetActionStateBoolean",
    "xrGetActionStateFloat",
    "xrGetActionStatePose",
    "xrGetActionStateVector2f",
    "xrGetCurrentInteractionProfile",
    "xrGetInputSourceLocalizedName",
    "xrLocateHandJointsEXT",
    "xrPathToString",
    "xrStringToPath",
    "xrSuggestInteractionProfileBindings",
    "xrSyncActions",
];

/// Calls for arrays, which may have grown since their length was asked.
const ARRAYS: &[&str] = &[
    "xrEnumerateEnvironmentBlendModes",
    "xrEnumerateInstanceExtensionProperties",
    "xrEnumerateReferenceSpaces",
    "xrEnumerateSwapchainFormats",
    "xrEnumerateSwapchainImages",
    "xrEnumerateViewConfigurationViews",
];

/// Calls of a frame.
const FRAME: &[&str] = &[
    "xrAcquireSwapchainImage",
    "xrBeginFrame",
    "xrEndFrame",
    "xrReleaseSwapchainImage",
    "xrWaitFrame",
    "xrWaitSwapchainImage",
];

/// The first line that fits holds; below the last one, success codes are [`Outcome::GoOn`] and errors
/// [`Outcome::GiveUp`]: they say that we broke a rule, or that the runtime can never do what is needed, and trying again
/// would break it again.
#[rustfmt::skip]
const TABLE: &[Rule] = {
    use Outcome::{AskAgain, GoOn, Idle, ReopenInstance, ReopenSession, SkipFrame, Wait};
    use sys::Result as R;
    &[
        // Success, but not quite.
        (&["xrWaitSwapchainImage"], &[R::TIMEOUT_EXPIRED], SkipFrame),
        (&[], &[R::SESSION_LOSS_PENDING], ReopenSession),

        // What was lost.
        (&[], &[R::ERROR_SESSION_LOST], ReopenSession),
        (&[], &[R::ERROR_INSTANCE_LOST], ReopenInstance),

        // Hands that are not read, messages that are not heard.
        (INPUT, &[], GoOn),
        (&["xrCreateDebugUtilsMessengerEXT"], &[], GoOn),

        // What is not there yet. A runtime whose service does not run fails in its own way (Monado: RUNTIME_FAILURE).
        (&["xrCreateInstance", "xrEnumerateInstanceExtensionProperties"],
            &[R::ERROR_RUNTIME_UNAVAILABLE, R::ERROR_RUNTIME_FAILURE, R::ERROR_INITIALIZATION_FAILED], Wait),
        (&["xrGetSystem"], &[R::ERROR_FORM_FACTOR_UNAVAILABLE], Wait),

        // The headset or its GPU is another one since it was asked.
        (&["xrCreateSession"], &[R::ERROR_GRAPHICS_DEVICE_INVALID], ReopenInstance),
        (&[], &[R::ERROR_SYSTEM_INVALID], ReopenInstance),

        // 1.1, then 1.0; a longer array.
        (&["xrCreateInstance"], &[R::ERROR_API_VERSION_UNSUPPORTED], AskAgain),
        (ARRAYS, &[R::ERROR_SIZE_INSUFFICIENT], AskAgain),

        // The session's state changes before the event that says so is read.
        (&["xrBeginSession"], &[R::ERROR_SESSION_NOT_READY], Idle),
        (&["xrWaitFrame", "xrBeginFrame", "xrEndFrame", "xrRequestExitSession"],
            &[R::ERROR_SESSION_NOT_RUNNING], Idle),
        (&["xrEndSession"], &[R::ERROR_SESSION_NOT_RUNNING], GoOn),
        (&["xrBeginSession"], &[R::ERROR_SESSION_RUNNING], ReopenSession),
        (&["xrEndSession"], &[R::ERROR_SESSION_NOT_STOPPING], ReopenSession),

        // This frame's numbers do not please; the next one has others.
        (&["xrEndFrame"], &[R::ERROR_TIME_INVALID, R::ERROR_POSE_INVALID, R::ERROR_LAYER_INVALID,
            R::ERROR_LAYER_LIMIT_EXCEEDED, R::ERROR_SWAPCHAIN_RECT_INVALID,
            R::ERROR_ENVIRONMENT_BLEND_MODE_UNSUPPORTED], SkipFrame),
        (&["xrLocateViews"], &[R::ERROR_TIME_INVALID], SkipFrame),
        (&["xrLocateSpace"], &[R::ERROR_TIME_INVALID], GoOn),

        // The runtime's count of the frame's calls is not ours: begin to count anew.
        (FRAME, &[R::ERROR_CALL_ORDER_INVALID], ReopenSession),

        // The runtime itself has failed, and may be better off for a new start.
        (OPTIONAL, &[R::ERROR_RUNTIME_FAILURE], GoOn),
        (&[], &[R::ERROR_RUNTIME_FAILURE], ReopenInstance),

        (OPTIONAL, &[R::ERROR_FUNCTION_UNSUPPORTED, R::ERROR_FEATURE_UNSUPPORTED, R::ERROR_SIZE_INSUFFICIENT,
            R::ERROR_VALIDATION_FAILURE, R::ERROR_VIEW_CONFIGURATION_TYPE_UNSUPPORTED,
            R::ERROR_DISPLAY_REFRESH_RATE_UNSUPPORTED_FB], GoOn),
    ]
};

/// What the viewer does when `function` answers `code`.
pub fn outcome(function: &str, code: sys::Result) -> Outcome {
    let fits = |(functions, codes, _): &&Rule| {
        let any_error = codes.is_empty() && code.into_raw() < 0;
        (functions.is_empty() || functions.contains(&function)) && (any_error || codes.contains(&code))
    };
    match TABLE.iter().find(fits) {
        Some((_, _, outcome)) => *outcome,
        None if code.into_raw() >= 0 => Outcome::GoOn,
        None => Outcome::GiveUp,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_line_of_the_table_hides_behind_an_earlier_one() {
        for (i, (functions, codes, _)) in TABLE.iter().enumerate() {
            let hidden = |function: &str, code| {
                TABLE[..i].iter().any(|(earlier, among, _)| {
                    (earlier.is_empty() || earlier.contains(&function)) && among.contains(&code)
                })
            };
            for code in *codes {
                let any = ["(any function)"];
                let functions = if functions.is_empty() { &any[..] } else { functions };
                assert!(functions.iter().any(|f| !hidden(f, *code)), "line {i}, {code:?}");
            }
        }
    }
}
