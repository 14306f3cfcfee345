//! A headless OpenXR runtime for tests and for desks without a headset; it imports nothing of the viewer.
//!
//! ```text
//! control   the `Mock` handle: entry points, acts, records            slot      which mock answers which entry points
//! script/   what happens when: cues, faults, TOML files               mask      what the lenses hide
//! config    what the headset is like                                  pose      poses, fields of view, pose tracks
//! journal   calls, violations, leaks, hooks                           record    submitted frames and their pixels
//! abi/      the C boundary: commands, pointers, conversions           fault     result codes with a sentence
//! state/    the state machine: instances, sessions, spaces, swapchains, frames, layers, paths, events; devices,
//!           actions and what binds the two
//! input     scripted devices                                          hand      the joints of a hand
//! registry  profiles, components, names, result codes: a table made from the OpenXR registry
//! handle    generation-checked handles                                timeline  real and stepped time
//! vulkan    the application's instance and device                     graphics  images on its device
//! library   the shared library: negotiation, one mock per process     log       a foreign application's life as JSON
//! ```
//!
//! - No handle is a pointer, and no handle value is ever used twice.
//! - No panic leaves the boundary, and nothing but the boundary follows an application's pointers.
//! - No lock is held while `xrWaitFrame` sleeps.
//! - No queue is touched outside `xrAcquireSwapchainImage` and `xrEndFrame`.
//! - No window, no input device but scripted ones, no compositor: images are only copied back.

mod abi;
mod config;
mod control;
mod fault;
mod graphics;
mod hand;
mod handle;
mod input;
mod journal;
mod library;
mod log;
mod mask;
mod pose;
mod record;
pub mod registry;
mod script;
mod slot;
mod state;
mod timeline;
mod vulkan;

pub use config::{Clock, Mask, MockConfig, Timing, TimingSpan, Tracking, TrackingSpan};
pub use control::{Mock, MockError, function_names};
pub use input::{InputError, InputValue};
pub use journal::{Call, Calls, Leak, Violation};
pub use pose::{Fov, Pose, PoseTrack};
pub use record::{
    SubmittedCube, SubmittedCylinder, SubmittedDepth, SubmittedFrame, SubmittedQuad, SubmittedView,
};
pub use script::{Act, CallFault, Cue, InputAct, PerformanceNotice, Script, ScriptError, When};
pub use state::action::Haptic;
