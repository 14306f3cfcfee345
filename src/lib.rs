//! Fathomless: a VR headset viewer for a fractal landscape you can fall into for ever.
//!
//! The architecture is written here once the modules stand; see the list below for the reading order.

pub mod app;
pub mod bench;
pub mod capture;
pub mod cli;
pub mod course;
pub mod doctor;
pub mod flight;
pub mod gpu;
pub mod heap;
pub mod mock;
pub mod render;
pub mod rig;
pub mod telemetry;
pub mod terrain;
pub mod verify;
pub mod viewer;
pub mod whole;
pub mod world;
pub mod xr;
