//! What the OpenXR loader, its layers and the runtime have to say (`XR_EXT_debug_utils`): sent to the log.
#![allow(unsafe_code, reason = "a callback called by the OpenXR loader")]

use std::borrow::Cow;
use std::ffi::{CStr, c_char, c_void};

use openxr::sys;

use super::error::{Error, check};
use super::outcome::Outcome;

/// Hears messages until it is dropped, which must be before its instance goes.
pub(super) struct Messenger {
    handle: sys::DebugUtilsMessengerEXT,
    destroy: sys::pfn::DestroyDebugUtilsMessengerEXT,
}

impl Messenger {
    /// Listens to an instance; None where it was made without the extension, or refuses.
    ///
    /// # Errors
    /// The instance is lost.
    pub(super) fn new(instance: &openxr::Instance) -> Result<Option<Messenger>, Error> {
        use openxr::{DebugUtilsMessageSeverityFlagsEXT as Severity, DebugUtilsMessageTypeFlagsEXT as Kind};
        let Some(functions) = instance.exts().ext_debug_utils.as_ref() else { return Ok(None) };
        let info = sys::DebugUtilsMessengerCreateInfoEXT {
            ty: sys::DebugUtilsMessengerCreateInfoEXT::TYPE,
            next: std::ptr::null(),
            message_severities: Severity::ERROR | Severity::WARNING | Severity::INFO | Severity::VERBOSE,
            message_types: Kind::GENERAL | Kind::VALIDATION | Kind::PERFORMANCE | Kind::CONFORMANCE,
            user_callback: Some(on_message),
            user_data: std::ptr::null_mut(),
        };
        let mut handle = sys::DebugUtilsMessengerEXT::default();
        // SAFETY: a live instance with the extension on, and a valid create-info; the callback needs no data of ours.
        let code = unsafe {
            (functions.create_debug_utils_messenger)(instance.as_raw(), &raw const info, &raw mut handle)
        };
        match check("xrCreateDebugUtilsMessengerEXT", code) {
            Ok(_) => Ok(Some(Messenger { handle, destroy: functions.destroy_debug_utils_messenger })),
            Err(error) if error.outcome() == Outcome::GoOn => {
                tracing::debug!("the OpenXR runtime keeps its messages to itself ({code})");
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }
}

impl Drop for Messenger {
    fn drop(&mut self) {
        // SAFETY: made by `new`, destroyed once, and its instance is alive.
        let code = unsafe { (self.destroy)(self.handle) };
        if code.into_raw() < 0 {
            tracing::debug!("an OpenXR messenger could not be destroyed ({code})");
        }
    }
}

unsafe extern "system" fn on_message(
    severity: sys::DebugUtilsMessageSeverityFlagsEXT,
    _: sys::DebugUtilsMessageTypeFlagsEXT,
    data: *const sys::DebugUtilsMessengerCallbackDataEXT,
    _: *mut c_void,
) -> sys::Bool32 {
    use sys::DebugUtilsMessageSeverityFlagsEXT as Severity;
    // SAFETY: the runtime passes valid data, or none, for the length of the call.
    let Some(data) = (unsafe { data.as_ref() }) else { return sys::FALSE };
    let (function, text) = (text_of(&data.function_name), text_of(&data.message));
    let text = text.trim_end();
    if severity.contains(Severity::ERROR) {
        tracing::error!(target: "openxr", "{function}: {text}");
    } else if severity.contains(Severity::WARNING) {
        tracing::warn!(target: "openxr", "{function}: {text}");
    } else if severity.contains(Severity::INFO) {
        tracing::debug!(target: "openxr", "{function}: {text}");
    } else {
        tracing::trace!(target: "openxr", "{function}: {text}");
    }
    sys::FALSE
}

/// A C string of the message, or nothing where the pointer is null.
fn text_of<'a>(pointer: &'a *const c_char) -> Cow<'a, str> {
    if pointer.is_null() {
        return Cow::Borrowed("");
    }
    // SAFETY: not null, and strings of the callback's data are nul-terminated and live as long as the data.
    unsafe { CStr::from_ptr(*pointer) }.to_string_lossy()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
    use std::sync::{Arc, Mutex, PoisonError};

    #[derive(Clone, Default)]
    struct Heard(Arc<Mutex<Vec<u8>>>);

    impl Write for Heard {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn messages_are_logged_at_their_level_and_missing_ones_are_survived() {
        use sys::DebugUtilsMessageSeverityFlagsEXT as Severity;
        let heard = Heard::default();
        let writer = heard.clone();
        let log = tracing_subscriber::fmt()
            .with_ansi(false)
            .with_max_level(tracing::Level::DEBUG)
            .with_writer(move || writer.clone())
            .finish();
        let mut data = sys::DebugUtilsMessengerCallbackDataEXT {
            ty: sys::DebugUtilsMessengerCallbackDataEXT::TYPE,
            next: std::ptr::null(),
            message_id: c"id".as_ptr(),
            function_name: c"xrEndFrame".as_ptr(),
            message: c"too late\n".as_ptr(),
            object_count: 0,
            objects: std::ptr::null_mut(),
            session_label_count: 0,
            session_labels: std::ptr::null_mut(),
        };
        tracing::subscriber::with_default(log, || {
            let all = [Severity::ERROR, Severity::WARNING, Severity::INFO, Severity::VERBOSE];
            for severity in all {
                // SAFETY: valid data, which outlives the call.
                unsafe {
                    on_message(
                        severity,
                        sys::DebugUtilsMessageTypeFlagsEXT::GENERAL,
                        &raw const data,
                        std::ptr::null_mut(),
                    );
                }
            }
            data.message = std::ptr::null();
            // SAFETY: as above; null pointers are what is tested.
            unsafe {
                on_message(
                    Severity::ERROR,
                    sys::DebugUtilsMessageTypeFlagsEXT::GENERAL,
                    &raw const data,
                    std::ptr::null_mut(),
                );
                on_message(
                    Severity::ERROR,
                    sys::DebugUtilsMessageTypeFlagsEXT::GENERAL,
                    std::ptr::null(),
                    std::ptr::null_mut(),
                );
            }
        });
        let heard = heard.0.lock().unwrap_or_else(PoisonError::into_inner);
        let said = String::from_utf8_lossy(&heard);
        let levels: Vec<&str> = said.lines().filter_map(|line| line.split_whitespace().nth(1)).collect();
        assert_eq!(levels, ["ERROR", "WARN", "DEBUG", "ERROR"], "{said}");
        assert_eq!(said.matches("openxr: xrEndFrame: too late").count(), 3, "{said}");
    }
}
