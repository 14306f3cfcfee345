//! Who hears what is wrong with a viewer's use of Vulkan and OpenXR.

use std::sync::Arc;

use anyhow::Result;

use super::Viewer;
use crate::gpu::{Lost, ValidationLog};
use crate::mock::Mock;

impl Viewer {
    /// Ends the session and closes the device; what the validation layer and the built-in runtime had to say.
    ///
    /// # Errors
    /// The session or the device is lost.
    pub fn close(self) -> Result<Remarks> {
        self.painter.frames.wait_idle()?;
        let witness = self.witness();
        drop(self);
        Ok(witness.remarks())
    }

    /// Who hears what is wrong with our use of Vulkan and OpenXR. It outlives the viewer.
    pub fn witness(&self) -> Witness {
        Witness { log: self.gpu.validation_log(), mock: self.mock.clone() }
    }
}

/// The validation layer and the built-in runtime of a viewer, as far as they are there.
pub struct Witness {
    log: Arc<ValidationLog>,
    mock: Option<Mock>,
}

impl Witness {
    /// What they have said so far.
    pub fn remarks(&self) -> Remarks {
        let report = self.log.report();
        let violations = self.mock.as_ref().map(Mock::violations).unwrap_or_default();
        Remarks {
            validation: report.count as usize,
            violations: violations.len(),
            first: report.texts.into_iter().next().or_else(|| violations.first().map(|v| format!("{v:?}"))),
        }
    }
}

/// What was found wrong with our own use of Vulkan and OpenXR.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Remarks {
    /// Messages of the validation layer.
    pub validation: usize,
    /// Violations that the built-in runtime recorded.
    pub violations: usize,
    /// The first of them.
    pub first: Option<String>,
}

/// What fails for want of room is said, and all goes on as it was; false then.
///
/// # Errors
/// The device is lost.
pub fn survive<T>(done: Result<T>) -> Result<bool> {
    match done {
        Ok(_) => Ok(true),
        Err(error) if error.is::<Lost>() => Err(error),
        Err(error) => {
            tracing::warn!("all stays as it was: {error:#}");
            Ok(false)
        }
    }
}
