//! The C boundary: entry points for each mock, pointers verified, structures converted, panics stopped.

mod action;
mod automation;
mod command;
mod debug;
mod event;
mod frame;
mod hand;
mod headset;
mod instance;
mod pointer;
mod session;
mod space;
mod swapchain;
mod text;
mod vulkan;

pub use command::{function_names, proc_addr_of};
