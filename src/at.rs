//! `--at PLACE`: finds the address behind what somebody calls a place, and the way of a flight from there.

use std::ffi::OsStr;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::address::{Address, AddressError, MAX_TEXT, PREFIX};
use crate::bookmarks::{self, Store};
use crate::course::{Course, Stand};
use crate::flight::{Flight, FlightPose};
use crate::picture::{self, PictureError};
use crate::world::World;

/// Height above the world's start of a viewer of whom nothing is known, in cells.
const START_HEIGHT: f64 = 3.0;

/// Where to go.
#[derive(Clone, Debug, PartialEq)]
pub struct Destination {
    /// The place.
    pub address: Address,
    /// Stay there and see what the address shows, instead of flying on from there.
    pub stays: bool,
}

/// Why nothing is known of a place. Each sentence begins with how it was named.
#[derive(Debug, thiserror::Error)]
pub enum AtError {
    /// No address, no bookmark, no file.
    #[error("`{0}` is neither an address (`{PREFIX}...`) nor a bookmark (`@NAME`) nor a file that is there")]
    Nothing(String),
    /// The text is an address, but a wrong one.
    #[error("{place}: {error}")]
    Address {
        /// How it was named.
        place: String,
        /// What is wrong with it.
        error: AddressError,
    },
    /// The file holds no address.
    #[error("{place}: {error}")]
    Picture {
        /// The file.
        place: String,
        /// Why not.
        error: PictureError,
    },
    /// The file is neither a picture nor the text of an address.
    #[error("{0}: this is neither a PNG picture nor a text file with an address in it")]
    OtherFile(String),
    /// No such bookmark, or none can be read.
    #[error(transparent)]
    Bookmark(#[from] bookmarks::Error),
}

/// The address behind an address's own text, `@NAME` of a bookmark, a picture drawn by fathomless, or a file with an
/// address in it.
///
/// # Errors
/// [`AtError`], a sentence.
pub fn find(place: &OsStr) -> Result<Address, AtError> {
    let text = place.to_string_lossy();
    if let Some(name) = text.strip_prefix('@') {
        return parse(&text, &Store::open()?.find(name)?);
    }
    if text.trim_start().starts_with(PREFIX) {
        return parse(&shortened(&text), &text);
    }
    let path = Path::new(place);
    if !path.exists() {
        return Err(AtError::Nothing(shortened(&text)));
    }
    let in_picture = |error| AtError::Picture { place: text.to_string(), error };
    match picture::address(path) {
        Ok(address) => parse(&text, &address),
        Err(PictureError::NotPng) => {
            let mut bytes = Vec::new();
            let file = File::open(path).map_err(|error| in_picture(error.into()))?;
            file.take(MAX_TEXT as u64).read_to_end(&mut bytes).map_err(|error| in_picture(error.into()))?;
            let inside = String::from_utf8_lossy(&bytes);
            match inside.trim_start().starts_with(PREFIX) {
                true => parse(&text, &inside),
                false => Err(AtError::OtherFile(text.to_string())),
            }
        }
        Err(error) => Err(in_picture(error)),
    }
}

fn parse(place: &str, text: &str) -> Result<Address, AtError> {
    text.parse().map_err(|error| AtError::Address { place: place.to_owned(), error })
}

/// The beginning of what may be a very long text, for a sentence about it.
fn shortened(text: &str) -> String {
    let mut start: String = text.chars().take(60).filter(|c| !c.is_control()).collect();
    if start.len() < text.len() {
        start.push_str("...");
    }
    start
}

/// A flight's way through a world: from `depth` octaves below the start, or from a destination.
pub fn course(world: &World, flight: &Flight, depth: usize, at: Option<&Destination>) -> Course {
    let deepest = deepest(flight);
    match at.map(|at| (at.stays, at.address.stand(&world.surface))) {
        None => Course::new(world.surface, depth, deepest, |_| ()),
        Some((true, stand)) => Course::staying(stand),
        Some((false, stand)) => Course::from(&stand, deepest, |_| ()),
    }
}

/// A viewer at a destination, or over the world's own dive, `depth` octaves below the start.
pub fn stand(world: &World, depth: usize, at: Option<&Destination>) -> Stand {
    match at {
        Some(at) => at.address.stand(&world.surface),
        None => {
            let pose = FlightPose {
                depth: 0.0,
                yaw: 0.0,
                pitch: 0.0,
                roll: 0.0,
                height: START_HEIGHT,
                offset: [0.0; 2],
            };
            Course::new(world.surface, depth, 0.0, |_| ()).at(&pose).stand()
        }
    }
}

/// The deepest depth of a flight's keyframes.
pub fn deepest(flight: &Flight) -> f64 {
    flight.keyframes.iter().map(|key| key.pose.depth).fold(0.0, f64::max)
}
