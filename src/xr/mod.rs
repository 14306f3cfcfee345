//! The edge towards the headset: an OpenXR runtime, a session with it, and its frames. Names neither terrain nor rendering.
//!
//! [`Runtime::open`] finds the headset, and makes the Vulkan device with [`gpu::Bootstrap`](crate::gpu::Bootstrap).
//! [`Session::poll`] says what to do next; a frame is [`Session::wait_frame`], [`Session::begin_frame`],
//! [`Frame::acquire`], [`Frame::locate_views`], [`Frame::end`]. What is begun is always ended, on every way out.
//! A loss ([`Lost`]) is an ordinary answer of every call: drop the session, open anew. What every answer of every call
//! comes to is one table ([`outcome`]); [`Error::outcome`] looks it up.
//!
//! Absent here: a session call that holds the Vulkan queue while it waits; a pose that is not a number or a
//! quaternion of length zero; a wait without end other than the runtime's own for the next frame.

mod actions;
mod arrays;
mod cube;
mod error;
mod frame;
mod joints;
mod loader;
mod mask;
mod messages;
mod outcome;
mod quad;
mod raw;
mod runtime;
mod session;
mod sources;
mod space;
mod survey;
mod swapchain;
mod view;

pub use cube::CubeSurface;
pub use error::{Error, Lost};
pub use frame::{EyeImages, Frame, Tick};
pub use loader::{system_entry, system_manifest};
pub use mask::HiddenAreas;
pub use outcome::{Outcome, outcome};
pub use quad::QuadSurface;
pub use runtime::{EyeSize, Runtime, RuntimeInfo};
pub use session::{Oddities, Phase, Session, SessionConfig, SessionInfo, Shown};
pub use space::Origin;
pub use survey::{RuntimeSurvey, Survey, survey};
pub use swapchain::Surface;
pub use view::{Fov, Pose, Tracking, View, Views};
