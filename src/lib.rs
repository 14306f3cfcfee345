//! Fathomless: a VR headset viewer for a fractal landscape you can fall into for ever.
//!
//! The architecture is written here once the modules stand; see the list below for the reading order.

pub mod address;
pub mod app;
pub mod at;
pub mod bookmarks;
pub mod capture;
pub mod cli;
pub mod course;
pub mod doctor;
pub mod export;
pub mod files;
pub mod flight;
pub mod gpu;
pub mod mock;
pub mod picture;
pub mod render;
pub mod rig;
pub mod terrain;
pub mod verify;
pub mod viewer;
pub mod world;
pub mod xr;
