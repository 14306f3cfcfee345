//! Fathomless: a VR headset viewer for a fractal landscape you can fall into for ever.
//!
//! The architecture is written here once the modules stand; see the list below for the reading order.

pub mod terrain;
pub mod world;
pub mod flight;
pub mod gpu;
pub mod render;
pub mod xr;
pub mod mock;
pub mod capture;
pub mod cli;
pub mod app;
