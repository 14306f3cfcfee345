//! Why a call does not succeed: an `XrResult` and a sentence, and whether the application is to blame.

use std::borrow::Cow;

use openxr::sys;

/// A call that failed. Misuses are recorded as violations; refusals (no headset, array too small) are not.
#[derive(Debug)]
pub struct Fault {
    pub code: sys::Result,
    pub misuse: bool,
    pub text: Cow<'static, str>,
}

pub type Outcome<T> = Result<T, Fault>;

/// The application broke a rule of the specification.
pub fn misuse(code: sys::Result, text: impl Into<Cow<'static, str>>) -> Fault {
    Fault { code, misuse: true, text: text.into() }
}

/// The runtime says no to something an application may ask.
pub fn refusal(code: sys::Result, text: impl Into<Cow<'static, str>>) -> Fault {
    Fault { code, misuse: false, text: text.into() }
}

/// `require!(condition, ERROR_CODE, "sentence {}", values)`: a misuse unless the condition holds.
macro_rules! require {
    ($condition:expr, $code:ident, $text:literal $(, $value:expr)* $(,)?) => {
        if !$condition {
            return Err($crate::mock::fault::misuse(openxr::sys::Result::$code, format!($text $(, $value)*)));
        }
    };
}
pub(in crate::mock) use require;
