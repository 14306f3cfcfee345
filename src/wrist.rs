//! The panel on the wrist: where it hangs, what points at it, and what comes of it.

mod hang;
mod point;

pub use hang::{Hang, PanelPlace, Wearer};
pub use point::{Pointer, Pointing};
