//! What inputs the wearer finds bound, in the runtime's words.

use openxr::sys;

use super::error::Error;
use super::outcome::Outcome;
use super::raw::RawSession;
use crate::bindings::{Action, Bound};

/// What is bound to each action now. What the runtime has no words for is left out.
///
/// # Errors
/// Losses.
pub(super) fn bound(raw: &RawSession, actions: &[sys::Action]) -> Result<Vec<Bound>, Error> {
    let mut all = Vec::new();
    for (action, handle) in Action::ALL.into_iter().zip(actions) {
        // Poses and ticks are nothing to press.
        if action.is_pressed() {
            let inputs = soft(inputs(raw, *handle))?;
            if !inputs.is_empty() {
                tracing::debug!("bound: {}: {}", action.title(), inputs.join(", "));
            }
            all.extend((!inputs.is_empty()).then_some(Bound { action, inputs }));
        }
    }
    Ok(all)
}

fn inputs(raw: &RawSession, action: sys::Action) -> Result<Vec<String>, Error> {
    let paths = raw.bound_sources(action)?;
    paths.into_iter().map(|path| raw.source_name(path)).collect()
}

/// What the runtime refuses is nothing.
fn soft<T: Default>(answer: Result<T, Error>) -> Result<T, Error> {
    match answer {
        Err(error) if error.outcome() == Outcome::GoOn => {
            tracing::debug!("the runtime does not say what is bound: {error}");
            Ok(T::default())
        }
        answer => answer,
    }
}
