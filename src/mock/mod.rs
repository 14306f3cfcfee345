//! A headless OpenXR runtime for tests and for desks without a headset; it imports nothing of the viewer.
//!
//! ```text
//! control   the `Mock` handle: entry points, scripting, records       slot      which mock answers which entry points
//! config    what the headset is like                                  pose      poses, fields of view, pose tracks
//! journal   calls, violations, leaks, hooks                           record    submitted frames and their pixels
//! abi/      the C boundary: commands, pointers, conversions           fault     result codes with a sentence
//! state/    the state machine: instances, sessions, spaces, swapchains, frames, layers, actions, paths, events
//! handle    generation-checked handles                                timeline  real and stepped time
//! vulkan    the application's instance and device                     graphics  images on its device
//! library   the shared library: negotiation, one mock per process     log       a foreign application's life as JSON
//! ```
//!
//! - No handle is a pointer, and no handle value is ever used twice.
//! - No panic leaves the boundary, and nothing but the boundary follows an application's pointers.
//! - No lock is held while `xrWaitFrame` sleeps.
//! - No queue is touched outside `xrAcquireSwapchainImage` and `xrEndFrame`.
//! - No window, no input device, no compositor: images are only copied back.

mod abi;
mod config;
mod control;
mod fault;
mod graphics;
mod handle;
mod journal;
mod library;
mod log;
mod pose;
mod record;
mod slot;
mod state;
mod timeline;
mod vulkan;

pub use config::{Clock, MockConfig, Tracking, TrackingSpan};
pub use control::{Mock, MockError, function_names};
pub use journal::{Call, Calls, Leak, Violation};
pub use pose::{Fov, Pose, PoseTrack};
pub use record::{SubmittedCube, SubmittedDepth, SubmittedFrame, SubmittedView};
pub use state::action::Haptic;
