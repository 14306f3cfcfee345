//! OpenXR's "ask for the count, then for the elements" calls, and its fixed text fields.

use std::ffi::c_char;

use openxr::sys;

/// Attempts before a runtime whose count grows on every call is given up on.
pub(super) const ATTEMPTS: usize = 8;

/// Collects an array by the two-call idiom. `call(capacity, count, elements)` is the OpenXR function; `init` fills the
/// elements beforehand (their `ty` and `next` fields must be set).
///
/// # Errors
/// The call's own error; `ERROR_SIZE_INSUFFICIENT` when the array kept growing between the calls.
pub(super) fn two_call<T: Clone>(
    init: T,
    mut call: impl FnMut(u32, &mut u32, *mut T) -> sys::Result,
) -> Result<Vec<T>, sys::Result> {
    let mut elements = Vec::new();
    for _ in 0..ATTEMPTS {
        let mut needed = 0;
        match call(0, &mut needed, std::ptr::null_mut()) {
            sys::Result::ERROR_SIZE_INSUFFICIENT => continue,
            code if code.into_raw() < 0 => return Err(code),
            _ => {}
        }
        if needed == 0 {
            return Ok(elements);
        }
        elements.resize(needed as usize, init.clone());
        let mut count = needed;
        match call(needed, &mut count, elements.as_mut_ptr()) {
            sys::Result::ERROR_SIZE_INSUFFICIENT => elements.clear(),
            code if code.into_raw() < 0 => return Err(code),
            _ => {
                elements.truncate(count as usize);
                return Ok(elements);
            }
        }
    }
    Err(sys::Result::ERROR_SIZE_INSUFFICIENT)
}

/// The text in a fixed-size C field, up to its NUL or its end; bytes that are not UTF-8 are replaced.
pub(super) fn text(field: &[c_char]) -> String {
    let bytes: Vec<u8> = field.iter().take_while(|&&c| c != 0).map(|&c| c as u8).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    #![allow(unsafe_code, reason = "the fakes write through the pointer as a runtime does")]

    use super::*;

    /// A runtime whose array has `sizes[n]` elements at its n-th call.
    fn growing(sizes: &[u32]) -> Result<Vec<u32>, sys::Result> {
        let mut calls = sizes.iter().copied();
        let mut last = 0;
        two_call(0, |capacity, count, out| {
            last = calls.next().unwrap_or(last + 1);
            *count = last;
            if capacity == 0 {
                return sys::Result::SUCCESS;
            }
            if capacity < last {
                return sys::Result::ERROR_SIZE_INSUFFICIENT;
            }
            for i in 0..last {
                // SAFETY: the caller gave room for `capacity >= last` elements.
                unsafe { out.add(i as usize).write(i + 10) };
            }
            sys::Result::SUCCESS
        })
    }

    #[test]
    fn arrays_that_grow_or_shrink_between_the_calls_are_read_again() {
        assert_eq!(growing(&[3, 3]), Ok(vec![10, 11, 12]));
        assert_eq!(growing(&[0]), Ok(vec![]));
        assert_eq!(growing(&[1, 4, 4, 4]), Ok(vec![10, 11, 12, 13]));
        assert_eq!(growing(&[5, 2]), Ok(vec![10, 11]));
    }

    #[test]
    fn an_array_that_never_stops_growing_is_an_error_not_a_hang() {
        assert_eq!(growing(&[1]), Err(sys::Result::ERROR_SIZE_INSUFFICIENT));
    }

    #[test]
    fn fixed_text_needs_no_nul() {
        let full: Vec<c_char> = b"abc".iter().map(|&b| b as c_char).collect();
        assert_eq!(text(&full), "abc");
        assert_eq!(text(&[b'a' as c_char, 0, b'b' as c_char]), "a");
    }
}
