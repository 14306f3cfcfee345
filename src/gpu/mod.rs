//! Vulkan, thinly: the device, memory, shaders, pipelines and frames in flight. Knows neither terrain nor OpenXR.
//!
//! Reading order: [`Gpu`] (who makes it: [`Bootstrap`]), [`Buffer`] and [`Image`], [`Shader`] (WGSL, reflected) and
//! [`Program`] (its layouts on the device), [`ComputePipeline`] and [`GraphicsPipeline`], [`Commands`] (what can be
//! recorded), [`Frames`] (what is in flight, and [`Lost`], how that ends badly), [`Presenter`] (a window's pictures).
//!
//! Conventions: clip space is Vulkan's own (y down, z in [0, 1]; shaders are not flipped behind your back), depth is up to
//! the caller. Handles given to [`Commands`] are trusted: what a recorded command names must stay alive until the
//! frame that uses it has finished ([`Frames::bury`] sees to it). With the validation layer on, breaking that is counted.

mod bootstrap;
mod buffer;
mod clock;
mod commands;
mod context;
mod diagnostic;
mod frames;
mod image;
mod instance;
mod layout;
mod memory;
mod paste;
mod pipeline;
mod present;
mod program;
mod shader;
mod shelf;
mod surface;
mod survey;
mod sync;
mod timing;
mod validation;

pub(crate) use bootstrap::NO_DRIVER;
pub use bootstrap::{Bootstrap, Direct};
pub use buffer::{Buffer, BufferInfo, Location};
pub use commands::{Attachment, Commands, Load, Target};
pub use context::{DeviceInfo, Gpu, GpuConfig};
pub use frames::{Frame, Frames, Lost, SemaphoreAt};
pub use image::{Image, ImageInfo, Sampler};
pub use layout::{Member, StructLayout, field_size};
pub use pipeline::{Blend, ComputePipeline, Depth, GraphicsInfo, GraphicsPipeline, Pipeline};
pub use present::{Canvas, Presenter, Shown, Way, surface_extension};
pub use program::{BindGroup, Program, Resource};
pub use shader::{Binding, Constant, Shader, ShaderError, Source};
pub use shelf::{ShaderText, Shelf, replaced};
pub use survey::{DeviceSurvey, Survey, survey};
pub use sync::{Access, Transition};
pub use timing::PassTime;
pub use validation::{ValidationLog, ValidationReport};
