//! What the validation layers say: sent to the log, and counted.
#![allow(unsafe_code, reason = "a callback called by the Vulkan loader")]

use std::borrow::Cow;
use std::ffi::{CStr, c_char, c_void};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError};

use ash::vk;

/// Texts kept; the rest is only counted.
const KEPT_TEXTS: usize = 8;

/// How many validation messages there were, and what the first few said.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ValidationReport {
    /// Warnings and errors, of validity and of performance.
    pub count: u32,
    /// The first eight.
    pub texts: Vec<String>,
}

/// Counts what the layers report. It outlives the [`Gpu`](super::Gpu), so leaks found at its end are counted too.
#[derive(Debug, Default)]
pub struct ValidationLog {
    count: AtomicU32,
    texts: Mutex<Vec<String>>,
}

impl ValidationLog {
    /// All messages so far.
    pub fn report(&self) -> ValidationReport {
        ValidationReport {
            count: self.count.load(Ordering::Relaxed),
            texts: self.texts.lock().unwrap_or_else(PoisonError::into_inner).clone(),
        }
    }

    fn add(&self, text: &str) {
        self.count.fetch_add(1, Ordering::Relaxed);
        let mut texts = self.texts.lock().unwrap_or_else(PoisonError::into_inner);
        if texts.len() < KEPT_TEXTS {
            texts.push(text.to_owned());
        }
    }
}

/// The messenger's description; `log` must outlive every call into Vulkan made with it.
pub(super) fn messenger_info(log: &ValidationLog) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(
            vk::DebugUtilsMessageSeverityFlagsEXT::ERROR
                | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING
                | vk::DebugUtilsMessageSeverityFlagsEXT::INFO
                | vk::DebugUtilsMessageSeverityFlagsEXT::VERBOSE,
        )
        .message_type(
            vk::DebugUtilsMessageTypeFlagsEXT::GENERAL
                | vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION
                | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
        )
        .pfn_user_callback(Some(on_message))
        .user_data(std::ptr::from_ref(log).cast::<c_void>().cast_mut())
}

/// Sends one message to the log. The loader's own chatter (`GENERAL`) is logged but is no fault of ours, so not counted.
unsafe extern "system" fn on_message(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    kinds: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the loader passes valid data for the length of the call, and the log given to `messenger_info`.
    let (data, log) = unsafe { (data.as_ref(), user.cast::<ValidationLog>().as_ref()) };
    let (Some(data), Some(log)) = (data, log) else {
        return vk::FALSE;
    };
    let (id, text) = (text_of(&data.p_message_id_name), text_of(&data.p_message));
    match severity {
        vk::DebugUtilsMessageSeverityFlagsEXT::ERROR => {
            tracing::error!(target: "vulkan", "{id}: {text}")
        }
        vk::DebugUtilsMessageSeverityFlagsEXT::WARNING => {
            tracing::warn!(target: "vulkan", "{id}: {text}")
        }
        vk::DebugUtilsMessageSeverityFlagsEXT::INFO => {
            tracing::debug!(target: "vulkan", "{id}: {text}")
        }
        _ => tracing::trace!(target: "vulkan", "{id}: {text}"),
    }
    let faulty = severity >= vk::DebugUtilsMessageSeverityFlagsEXT::WARNING;
    let ours = vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE;
    if faulty && kinds.intersects(ours) {
        log.add(&text);
    }
    vk::FALSE
}

/// A C string of the message, or nothing where the pointer is null.
fn text_of<'a>(pointer: &'a *const c_char) -> Cow<'a, str> {
    if pointer.is_null() {
        return Cow::Borrowed("");
    }
    // SAFETY: not null, and strings of the callback's data are nul-terminated and live as long as the data.
    unsafe { CStr::from_ptr(*pointer) }.to_string_lossy()
}
